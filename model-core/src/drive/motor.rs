//! Motors with ideal torque regulators: shaft torque is the reference, within the motor's limits.
//!
//! Not here: temperatures in kelvin, field weakening beyond constant power.
//!
//! A motor may give more than its rated torque for a while. Its current i, of the rated one, heats it with i² and it
//! gives off what the rated current heats, so that i² − 1 adds up; when a minute's worth at the overload is used up,
//! the rated torque is the limit until all of it has been given off again. Below base speed i is the torque, above it
//! the power. 150 % for 60 s is duty class II of IEC 60146-1-1.

use crate::exchange::BySection;
use crate::machine::{self, Machine};
use crate::real::Real;

/// Limits of a motor.
#[derive(Clone, Copy, Debug)]
pub struct Motor<R> {
    torque: R,
    power: R,
    /// Speed from which on the power is the limit, rad/s.
    base: R,
    per_torque: R,
    per_power: R,
    overload: R,
    /// Share of the budget that 1 of i² − 1 uses up in a period.
    heating: R,
}

/// How long a motor may take its overload, s.
const OVERLOAD_S: f64 = 60.0;
/// An overload so small that it needs no budget.
const LEAST_OVERLOAD: f64 = 1e-3;

/// How much of its overload a motor has used up.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Overload<R> {
    /// 0 rested, 1 used up.
    used: R,
    exhausted: bool,
}

impl<R: Real> Motor<R> {
    /// Those of a winder, looked at every `period` seconds.
    pub fn of_sections(machine: &Machine, period: f64) -> BySection<Self> {
        let motors = &machine.motors;
        let motor = |motor| Self::new(motor, motors.overload, period);
        BySection {
            uw: motor(&motors.uw),
            rd: motor(&motors.rd),
            fd: motor(&motors.fd),
            rr: motor(&motors.rr),
        }
    }

    /// From its description, its overload of rated torque, and the period, s.
    pub fn new(motor: &machine::Motor, overload: f64, period: f64) -> Self {
        let excess = (overload * overload - 1.0).max(LEAST_OVERLOAD);
        Self {
            torque: R::of(motor.torque_n_m),
            power: R::of(motor.power_w),
            base: R::of(motor.power_w / motor.torque_n_m),
            per_torque: R::of(1.0 / motor.torque_n_m),
            per_power: R::of(1.0 / motor.power_w),
            overload: R::of(overload),
            heating: R::of(period / (OVERLOAD_S * excess)),
        }
    }

    /// What its overload allows at the moment, of rated torque.
    pub fn allowed(&self, overload: &Overload<R>) -> R {
        if overload.exhausted {
            R::ONE
        } else {
            self.overload
        }
    }

    /// One period of a torque at a speed.
    pub fn heat(&self, overload: &mut Overload<R>, torque: R, omega: R) {
        // above base speed the current goes with the power
        let (low, high) = (torque * self.per_torque, torque * omega * self.per_power);
        let heat = (low * low).max(high * high);
        overload.used += self.heating * (heat - R::ONE);
        if overload.used >= R::ONE {
            *overload = Overload {
                used: R::ONE,
                exhausted: true,
            };
        } else if overload.used <= R::ZERO {
            *overload = Overload::default();
        }
    }

    /// Largest torque at a speed, N·m: `share` of the rated one, above the base speed of constant power.
    pub fn limit(&self, omega: R, share: R) -> R {
        let omega = omega.abs();
        let torque = if omega > self.base {
            self.power / omega
        } else {
            self.torque
        };
        torque * share
    }

    /// Rated torque, N·m.
    pub fn rated(&self) -> R {
        self.torque
    }

    /// A torque as share of the rated one.
    pub fn load(&self, torque: R) -> R {
        torque * self.per_torque
    }
}

/// The motors of a winder, protected against what they cannot take.
#[derive(Clone, Copy, Debug)]
pub struct Motors<R> {
    motors: BySection<Motor<R>>,
    overload: BySection<Overload<R>>,
}

impl<R: Real> Motors<R> {
    /// Rested, looked at every `period` seconds.
    pub fn new(machine: &Machine, period: f64) -> Self {
        Self {
            motors: Motor::of_sections(machine, period),
            overload: BySection::default(),
        }
    }

    /// One period of torques at speeds.
    pub fn heat(&mut self, torque: &BySection<R>, omega: &BySection<R>) {
        let (motors, o) = (&self.motors, &mut self.overload);
        motors.uw.heat(&mut o.uw, torque.uw, omega.uw);
        motors.rd.heat(&mut o.rd, torque.rd, omega.rd);
        motors.fd.heat(&mut o.fd, torque.fd, omega.fd);
        motors.rr.heat(&mut o.rr, torque.rr, omega.rr);
    }

    /// What their overload allows at the moment, of rated torque.
    pub fn allowed(&self) -> BySection<R> {
        self.motors
            .zip(self.overload)
            .map(|(motor, overload)| motor.allowed(&overload))
    }

    /// Those that are limited to their rated torque until they have recovered.
    pub fn exhausted(&self) -> BySection<bool> {
        self.overload.map(|overload| overload.is_exhausted())
    }

    /// Torques as shares of the rated ones.
    pub fn load(&self, torque: &BySection<R>) -> BySection<R> {
        torque.zip(self.motors).map(|(t, motor)| motor.load(t))
    }
}

impl<R: Real> Overload<R> {
    /// The motor is limited to its rated torque until it has recovered.
    pub fn is_exhausted(&self) -> bool {
        self.exhausted
    }

    /// Share that is used up, 0 to 1.
    pub fn used(&self) -> R {
        self.used
    }
}
