//! The units in which a scalar counts the quantities of a machine.
//!
//! Not here: units of measurement for people; the description of a machine is in SI.
//!
//! Floating-point numbers count in SI: every unit is 1. A fixed-point number has the same distance between its values
//! everywhere, so it counts per unit: each quantity in a unit of about its largest value on this machine. The
//! equations are the same; their coefficients take the units in, once, when they are made.

use crate::machine::{Machine, MachineError};
use crate::real::{Arithmetic, Scalar};

/// Units over the largest regular value of the speed, so that an overspeed can be held.
const SPEED_RESERVE: f64 = 1.25;
/// A strain that no web survives: the unit of strain, and that of the force with the stiffness.
const STRAIN: f64 = 0.125;

/// Sizes of the units, in SI.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Units {
    /// Of surface speeds, m/s.
    pub speed: f64,
    /// Of strains.
    pub strain: f64,
    /// Of tensions and surface forces, N.
    pub force: f64,
    /// Of the parent roll's radius, m.
    pub r_uw: f64,
    /// Of the parent roll's inertia, kg·m².
    pub inertia: f64,
    /// Of the shipping roll's radius, m.
    pub r_wu: f64,
    /// Of the radii of drums and rider roll, m.
    pub r_rolls: f64,
    /// Of the windup's masses at the surface, kg.
    pub mass: f64,
}

/// Where the coefficients of a motion come from: one machine, or several side by side.
pub trait Machines<A: Arithmetic> {
    /// A coefficient of each machine, given its units.
    fn coefficient(&self, of: impl Fn(&Machine, &Units) -> f64) -> A;
    /// A factor from a quantity to a change, likewise.
    fn gain(&self, of: impl Fn(&Machine, &Units) -> f64) -> A::Gain;
}

/// One machine with its units.
pub struct One<'a>(pub &'a Machine, pub &'a Units);

impl<R: Scalar> Machines<R> for One<'_> {
    fn coefficient(&self, of: impl Fn(&Machine, &Units) -> f64) -> R {
        R::coefficient(of(self.0, self.1))
    }
    fn gain(&self, of: impl Fn(&Machine, &Units) -> f64) -> R::Gain {
        R::gain(of(self.0, self.1))
    }
}

impl Units {
    /// Everything in SI.
    pub const SI: Self = Self {
        speed: 1.0,
        strain: 1.0,
        force: 1.0,
        r_uw: 1.0,
        inertia: 1.0,
        r_wu: 1.0,
        r_rolls: 1.0,
        mass: 1.0,
    };

    /// The units that `R` counts a valid machine in.
    pub fn of<R: Scalar>(machine: &Machine) -> Self {
        if !R::PER_UNIT {
            return Self::SI;
        }
        let speed = SPEED_RESERVE * machine.operation.max_speed_m_s;
        let parent = |r: f64| machine.parent_roll_offset() + machine.web.roll_inertia(r);
        let (roll, shipping) = (&machine.parent_roll, &machine.shipping_roll);
        let rolls = [&machine.rear_drum, &machine.front_drum, &machine.rider_roll];
        Self {
            speed,
            strain: STRAIN,
            force: STRAIN * machine.web.stiffness_n_m * machine.web.width_m,
            r_uw: roll.full_radius_m,
            inertia: parent(roll.full_radius_m).max(parent(roll.spool_radius_m)),
            r_wu: shipping.full_radius_m,
            r_rolls: rolls
                .iter()
                .fold(f64::INFINITY, |r, roll| r.min(roll.radius_m)),
            mass: machine.windup_mass_kg(shipping.full_radius_m),
        }
    }

    /// Of angular velocities of the parent roll, rad/s.
    pub fn omega(&self) -> f64 {
        self.speed / self.r_uw
    }

    /// Of torques on the parent roll, N·m.
    pub fn torque(&self) -> f64 {
        self.force * self.r_uw
    }

    /// Of angular velocities of drums and rider roll, rad/s.
    pub fn omega_rolls(&self) -> f64 {
        self.speed / self.r_rolls
    }

    /// Of torques on drums and rider roll, N·m.
    pub fn torque_rolls(&self) -> f64 {
        self.force * self.r_rolls
    }

    /// Refuses a machine with coefficients that `R` cannot hold in these units: spans too short, or a web too
    /// viscous, for numbers of limited range; `h` is the step of integration.
    pub fn fit<R: Scalar>(&self, machine: &Machine, h: f64) -> Result<(), MachineError> {
        let web = &machine.web;
        // the coefficients of a span of 1 m, see `Spans`
        let change = h / 3.0 * self.speed / self.strain / R::LARGEST_GAIN;
        let viscous = web.stiffness_n_m * web.width_m * web.retardation_s * self.speed
            / self.force
            / R::LARGEST;
        let shortest = change.max(viscous);
        let spans = machine.idle.iter().map(|roll| roll.span_m);
        match spans
            .chain([machine.last_span_m])
            .find(|span| *span < shortest)
        {
            None => Ok(()),
            Some(span) => Err(MachineError {
                parameter: "span_m (of a web that fixed-point numbers can hold)",
                value: span,
                low: shortest,
                high: f64::INFINITY,
            }),
        }
    }
}
