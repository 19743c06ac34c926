//! What can be measured on the winder, and how.
//!
//! Not here: noise, and sensors that fail.

use crate::exchange::{BySection, Measurements};
use crate::machine::{DrivenRoll, Machine};
use crate::real::Real;

/// Coefficients of the sensors.
#[derive(Clone, Copy, Debug)]
struct Coefficients<R> {
    /// 1 − exp(−h/τ) of the load cells' filter.
    filter: R,
    /// 1/R of the rear drum, the front drum and the rider roll, 1/m.
    per_radius: BySection<R>,
    /// Encoder pulses for a metre of surface, 1/m.
    pulses: R,
    /// The roll on the load cells, and the shares of the tension before and after it.
    load_cell_roll: usize,
    before: R,
    after: R,
    /// What the amplifier shows without web, N.
    zero: R,
}

/// Load cells, encoders and the position sensor of the rider-roll beam.
#[derive(Clone, Copy, Debug)]
pub struct Sensors<R> {
    coefficients: Coefficients<R>,
    tension: R,
    count: u32,
    /// Way since the last pulse, in pulses.
    fraction: R,
}

/// What the sensors look at.
pub struct Sight<R> {
    /// Angular velocity of the parent roll, rad/s.
    pub omega_uw: R,
    /// Surface speeds of rear drum, front drum and rider roll, m/s.
    pub v: [R; 3],
    /// Way of the rear drum's surface since the last look, m.
    pub travel: R,
    /// Radius of the shipping roll, m.
    pub r_wu: R,
}

impl<R: Real> Sensors<R> {
    /// The sensors of a machine, looked at every `h` seconds.
    pub fn new(machine: &Machine, h: f64) -> Self {
        let per_radius = |roll: &DrivenRoll| R::of(1.0 / roll.radius_m);
        let cells = &machine.load_cells;
        let sine = |wrap: f64| libm::sin(0.5 * wrap);
        let gain = sine(cells.wrap_rad) / sine(cells.calibrated_wrap_rad);
        let before = if cells.both_spans { 0.5 } else { 0.0 };
        let circumference = core::f64::consts::TAU * machine.rear_drum.radius_m;
        Self {
            coefficients: Coefficients {
                filter: R::of(-libm::expm1(-h / machine.load_cells.filter_s)),
                per_radius: BySection {
                    uw: R::ZERO,
                    rd: per_radius(&machine.rear_drum),
                    fd: per_radius(&machine.front_drum),
                    rr: per_radius(&machine.rider_roll),
                },
                pulses: R::of(machine.encoder_pulses / circumference),
                load_cell_roll: cells.roll,
                before: R::of(gain * before),
                after: R::of(gain * (1.0 - before)),
                zero: R::of(0.5 * cells.tare_n / sine(cells.calibrated_wrap_rad)),
            },
            tension: R::ZERO,
            count: 0,
            fraction: R::ZERO,
        }
    }

    /// One look, every step of the plant.
    ///
    /// The load cells carry F = (t_before + t_after)·sin(β/2) + tare and show F/(2·sin(β_cal/2)), filtered. Where
    /// they do not feel both spans, t_after stands for t_before.
    pub fn look<const SPANS: usize>(
        &mut self,
        sight: &Sight<R>,
        tension: &[R; SPANS],
    ) -> Measurements<R> {
        let c = &self.coefficients;
        let shown = c.before * tension[c.load_cell_roll] + c.after * tension[c.load_cell_roll + 1];
        self.tension += c.filter * (shown + c.zero - self.tension);

        let way = self.fraction + sight.travel * c.pulses;
        let whole = way.floor_i32();
        self.count = self.count.wrapping_add_signed(whole);
        self.fraction = way - R::of_i32(whole);

        let [rd, fd, rr] = sight.v;
        Measurements {
            omega: BySection {
                uw: sight.omega_uw,
                rd: rd * c.per_radius.rd,
                fd: fd * c.per_radius.fd,
                rr: rr * c.per_radius.rr,
            },
            tension: self.tension,
            d_wu: sight.r_wu + sight.r_wu,
            pulses_rd: self.count,
            brakes: Default::default(),
        }
    }
}
