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
    load_cell_span: usize,
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
    /// Surface speed of the windup, m/s.
    pub v_rd: R,
    /// Way of the rear drum's surface since the last look, m.
    pub travel: R,
    /// Radius of the shipping roll, m.
    pub r_wu: R,
}

impl<R: Real> Sensors<R> {
    /// The sensors of a machine, looked at every `h` seconds.
    pub fn new(machine: &Machine, h: f64) -> Self {
        let per_radius = |roll: &DrivenRoll| R::of(1.0 / roll.radius_m);
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
                load_cell_span: machine.load_cells.roll + 1,
            },
            tension: R::ZERO,
            count: 0,
            fraction: R::ZERO,
        }
    }

    /// One look, every step of the plant.
    pub fn look<const SPANS: usize>(
        &mut self,
        sight: &Sight<R>,
        tension: &[R; SPANS],
    ) -> Measurements<R> {
        let c = &self.coefficients;
        self.tension += c.filter * (tension[c.load_cell_span] - self.tension);

        let way = self.fraction + sight.travel * c.pulses;
        let whole = way.floor_i32();
        self.count = self.count.wrapping_add_signed(whole);
        self.fraction = way - R::of_i32(whole);

        let omega = c.per_radius.map(|per_radius| sight.v_rd * per_radius);
        Measurements {
            omega: BySection {
                uw: sight.omega_uw,
                ..omega
            },
            tension: self.tension,
            d_wu: sight.r_wu + sight.r_wu,
            pulses_rd: self.count,
            brakes: Default::default(),
        }
    }
}
