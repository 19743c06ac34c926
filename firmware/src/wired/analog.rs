//! The load cells' amplifier as an analogue output.

/// A converter's scaling.
#[derive(Clone, Copy, Debug)]
pub struct Analog {
    /// Codes for each unit.
    gain: f32,
    full: u16,
}

impl Analog {
    /// A converter whose largest code, `full`, stands for `full_scale`.
    pub fn new(full_scale: f32, full: u16) -> Self {
        Self {
            gain: f32::from(full) / full_scale,
            full,
        }
    }

    /// The code nearest to a value; what is out of range stays at its end, as an amplifier does.
    pub fn code(&self, value: f32) -> u16 {
        // the cast saturates, and takes what is not a number to 0
        ((value * self.gain + 0.5) as u16).min(self.full)
    }
}
