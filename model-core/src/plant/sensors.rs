//! What can be measured on the winder, and how.
//!
//! Not here: noise. Sensors fail only where a test makes them.

use crate::exchange::{BySection, Measurements, SensorFaults};
use crate::machine::Machine;
use crate::real::Real;

/// Coefficients of the sensors.
#[derive(Clone, Copy, Debug)]
struct Coefficients<R> {
    /// 1 − exp(−h/τ) of the load cells' filter.
    filter: R,
    /// Encoder pulses for a metre of surface, 1/m.
    pulses: R,
    /// The roll on the load cells, and whether they feel the span before it, too.
    load_cell_roll: usize,
    both_spans: bool,
    /// The load cells' wrap angle, and the one they are calibrated for, rad.
    wrap: f64,
    calibrated_wrap: f64,
    /// Step of the sensors, s.
    h: R,
    /// What the amplifier shows without web, N.
    zero: R,
}

/// Load cells, encoders and the position sensor of the rider-roll beam.
#[derive(Clone, Copy, Debug)]
pub struct Sensors<R> {
    coefficients: Coefficients<R>,
    tension: R,
    /// Error of the wrap angle, rad, and sin(β/2)/(2·sin(β_cal/2)) with it.
    wrap_error: R,
    gain: R,
    /// How far the zero has wandered off, N.
    wandered: R,
    count: u32,
    /// Way since the last pulse, in pulses.
    fraction: R,
    /// Diameter under the rider roll when it lay on the shipping roll last, m.
    d_wu: R,
}

/// sin(β/2)/(2·sin(β_cal/2)): what the load cells show of the sum of both tensions.
fn gain(wrap: f64, calibrated: f64) -> f64 {
    0.5 * libm::sin(0.5 * wrap) / libm::sin(0.5 * calibrated)
}

/// What the sensors look at.
pub struct Sight<R> {
    /// Angular velocities of the parent roll, the drums and the rider roll, rad/s.
    pub omega: BySection<R>,
    /// Way of the rear drum's surface since the last look, m.
    pub travel: R,
    /// Radius of the shipping roll, m.
    pub r_wu: R,
    /// The rider roll is off it.
    pub rider_lifted: bool,
}

impl<R: Real> Sensors<R> {
    /// The sensors of a machine, looked at every `h` seconds.
    pub fn new(machine: &Machine, h: f64) -> Self {
        let cells = &machine.load_cells;
        let calibrated = cells.calibrated_wrap_rad;
        let circumference = core::f64::consts::TAU * machine.rear_drum.radius_m;
        Self {
            coefficients: Coefficients {
                filter: R::of(-libm::expm1(-h / machine.load_cells.filter_s)),
                pulses: R::of(machine.encoder_pulses / circumference),
                load_cell_roll: cells.roll,
                both_spans: cells.both_spans,
                wrap: cells.wrap_rad,
                calibrated_wrap: calibrated,
                h: R::of(h),
                zero: R::of(0.5 * cells.tare_n / libm::sin(0.5 * calibrated)),
            },
            tension: R::ZERO,
            wrap_error: R::ZERO,
            gain: R::of(gain(cells.wrap_rad, calibrated)),
            wandered: R::ZERO,
            count: 0,
            fraction: R::ZERO,
            d_wu: R::of(2.0 * machine.shipping_roll.core_radius_m),
        }
    }

    /// The spans before and after the roll on the load cells, counted from 0.
    pub fn spans(&self) -> [usize; 2] {
        let roll = self.coefficients.load_cell_roll;
        [roll, roll + 1]
    }

    /// One look, every step of the plant, with the tensions of [`Sensors::spans`].
    ///
    /// The load cells carry F = (t_before + t_after)·sin(β/2) + tare and show F/(2·sin(β_cal/2)), filtered. Where
    /// they do not feel both spans, t_after stands for t_before. A drift adds to the tare as time goes.
    #[inline(always)]
    pub fn look(
        &mut self,
        sight: &Sight<R>,
        tensions: [R; 2],
        faults: &SensorFaults<R>,
    ) -> Measurements<R> {
        self.weigh(tensions, faults);
        let heard = |silent: bool, omega: R| if silent { R::ZERO } else { omega };
        let omega = BySection {
            uw: heard(faults.encoder_uw, sight.omega.uw),
            rd: heard(faults.encoder_rd, sight.omega.rd),
            ..sight.omega
        };
        if !faults.encoder_rd {
            self.count_pulses(sight.travel);
        }
        if !sight.rider_lifted {
            self.d_wu = sight.r_wu + sight.r_wu;
        }
        Measurements {
            omega,
            tension: self.tension,
            d_wu: self.d_wu,
            pulses_rd: self.count,
            brakes: Default::default(),
            rider_lifted: sight.rider_lifted,
        }
    }

    fn weigh(&mut self, [before, after]: [R; 2], faults: &SensorFaults<R>) {
        let c = &self.coefficients;
        if faults.wrap_error != self.wrap_error {
            self.wrap_error = faults.wrap_error;
            let wrap = c.wrap + faults.wrap_error.to_f64();
            self.gain = R::of(gain(wrap, c.calibrated_wrap));
        }
        let mut zero = c.zero;
        if faults.drift == R::ZERO {
            self.wandered = R::ZERO;
        } else {
            self.wandered += faults.drift * c.h;
            zero += self.wandered;
        }
        if faults.load_cell_stuck {
            return;
        }
        let sum = after + if c.both_spans { before } else { after };
        let shown = self.gain * sum + zero;
        self.tension += c.filter * (shown - self.tension);
    }

    fn count_pulses(&mut self, travel: R) {
        let way = self.fraction + travel * self.coefficients.pulses;
        let whole = way.floor_i32();
        self.count = self.count.wrapping_add_signed(whole);
        self.fraction = way - R::of_i32(whole);
    }
}
