//! Frequency response of a closed loop, by sines on top of its torque.
//!
//! Not here: which loop; the caller adds the disturbance and says what the regulator answered.

use std::f64::consts::{PI, TAU};

/// Lines of the spectrum, in multiples of the lowest that the window resolves.
const LINES: [u32; 24] = [
    3, 6, 9, 12, 15, 18, 22, 27, 33, 40, 48, 58, 70, 85, 105, 130, 165, 210, 275, 350, 450, 600,
    900, 1400,
];
/// Drive cycles of the window.
pub const WINDOW: u32 = 3142;

/// Open-loop response at a frequency.
#[derive(Clone, Copy, Debug)]
pub struct Point {
    /// rad/s
    pub omega: f64,
    pub re: f64,
    pub im: f64,
}

/// Collects a window of disturbance and answer.
pub struct Response {
    period: f64,
    cycle: u32,
    sums: Vec<[f64; 4]>,
}

impl Response {
    pub fn new(period: f64) -> Self {
        Self {
            period,
            cycle: 0,
            sums: vec![[0.0; 4]; LINES.len()],
        }
    }

    fn omega(&self, line: u32) -> f64 {
        TAU * f64::from(line) / (f64::from(WINDOW) * self.period)
    }

    fn phase(&self, line: u32) -> f64 {
        let n = u64::from(line) * u64::from(self.cycle) % u64::from(WINDOW);
        TAU * n as f64 / f64::from(WINDOW)
    }

    /// The disturbance of this cycle, of amplitude 1 in every line, their phases a golden angle apart.
    pub fn disturbance(&self) -> f64 {
        let golden = PI * (3.0 - 5.0_f64.sqrt());
        let sine = |(i, line): (usize, &u32)| (self.phase(*line) + golden * (i * i) as f64).sin();
        LINES.iter().enumerate().map(sine).sum()
    }

    /// What the regulator answered in this cycle, and the disturbance on top of it.
    pub fn look(&mut self, answer: f64, disturbance: f64) {
        let hann = 1.0 - (TAU * f64::from(self.cycle) / f64::from(WINDOW)).cos();
        for (i, line) in LINES.iter().enumerate() {
            let (sin, cos) = self.phase(*line).sin_cos();
            let sums = &mut self.sums[i];
            sums[0] += hann * answer * cos;
            sums[1] -= hann * answer * sin;
            sums[2] += hann * (answer + disturbance) * cos;
            sums[3] -= hann * (answer + disturbance) * sin;
        }
        self.cycle += 1;
    }

    /// L = −answer/(answer + disturbance)
    pub fn open_loop(&self) -> Vec<Point> {
        let point = |(line, s): (&u32, &[f64; 4])| {
            let square = s[2] * s[2] + s[3] * s[3];
            Point {
                omega: self.omega(*line),
                re: -(s[0] * s[2] + s[1] * s[3]) / square,
                im: -(s[1] * s[2] - s[0] * s[3]) / square,
            }
        };
        LINES.iter().zip(&self.sums).map(point).collect()
    }
}

/// By what factor the gain may rise, and may fall, until the loop is unstable: where L crosses the negative real axis.
pub fn gain_margins(open_loop: &[Point]) -> (f64, f64) {
    let (mut up, mut down) = (f64::INFINITY, f64::INFINITY);
    for pair in open_loop.windows(2) {
        let [a, b] = pair else { continue };
        if a.im * b.im >= 0.0 {
            continue;
        }
        let share = a.im / (a.im - b.im);
        let re = a.re + share * (b.re - a.re);
        if re < -1.0 {
            down = down.min(-re);
        } else if re < 0.0 {
            up = up.min(-1.0 / re);
        }
    }
    (up, down)
}

/// Largest |1/(1 + L)|: the reciprocal of the distance from −1.
pub fn sensitivity(open_loop: &[Point]) -> f64 {
    let distance = |p: &Point| (1.0 + p.re).hypot(p.im);
    1.0 / open_loop.iter().map(distance).fold(f64::INFINITY, f64::min)
}
