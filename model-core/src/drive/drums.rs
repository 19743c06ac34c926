//! The windup's regulators: web speed by both drums together, winding force by their split, and the rider roll.
//!
//! Not here: slip of a single drum, the rider roll's share of the winding force.

use super::motor::Motor;
use super::pi::{Gains, Pi};
use super::symmetrical_optimum;
use crate::exchange::{BySection, Measurements};
use crate::machine::Machine;
use crate::real::Real;

/// Speed regulator of the windup, inertia and friction compensated, with the split of its force.
#[derive(Clone, Copy, Debug)]
pub struct Drums<R> {
    c: Coefficients<R>,
    speed: Pi<R>,
}

#[derive(Clone, Copy, Debug)]
struct Coefficients<R> {
    rd: Motor<R>,
    fd: Motor<R>,
    rr: Motor<R>,
    r_rd: R,
    r_fd: R,
    r_rr: R,
    /// Mass of drums and rider roll at the surface, kg.
    drum_mass: R,
    /// ½·π·ρ·W/4: mass of the shipping roll for each m² of its diameter squared.
    roll_mass: R,
    /// Friction of all rolls at the surface, N·s/m.
    friction: R,
    /// Mass and friction of the idle rolls after the load cells, at the surface.
    path_mass: R,
    path_friction: R,
    rider_mass: R,
    rider_friction: R,
    /// Gains of the speed loop for 1 kg.
    gains_per_mass: Gains<R>,
    /// Front drum's share of the force at the core, and its change for each metre of diameter.
    share_core: R,
    share_slope: R,
    d_core: R,
}

/// What the drums are to do.
pub struct DrumTask<R> {
    /// Speed reference, m/s, and its acceleration, m/s².
    pub v_ref: R,
    /// m/s²
    pub a_ref: R,
    /// Limits of torque, of rated torque.
    pub limit: BySection<R>,
    /// Added to the front drum's share.
    pub share_trim: R,
}

impl<R: Real> Drums<R> {
    /// For a machine, stepped every `period` seconds.
    ///
    /// The speed loop is set by the symmetrical optimum and then slowed to a third of the first web mode, so
    /// that it does not work against the web.
    pub fn new(machine: &Machine, period: f64) -> Self {
        let (rd, fd, rr) = (&machine.rear_drum, &machine.front_drum, &machine.rider_roll);
        let path = &machine.idle[machine.load_cell_roll + 1..];
        let shipping = &machine.shipping_roll;
        let (d_core, d_full) = (2.0 * shipping.core_radius_m, 2.0 * shipping.full_radius_m);
        let [share_core, share_full] = machine.operation.front_share;
        let slope = if d_full > d_core {
            (share_full - share_core) / (d_full - d_core)
        } else {
            0.0
        };
        let r = R::of;
        Self {
            c: Coefficients {
                rd: Motor::new(&machine.motors.rd),
                fd: Motor::new(&machine.motors.fd),
                rr: Motor::new(&machine.motors.rr),
                r_rd: r(rd.radius_m),
                r_fd: r(fd.radius_m),
                r_rr: r(rr.radius_m),
                drum_mass: r(rd.mass_kg() + fd.mass_kg() + rr.mass_kg()),
                roll_mass: r(machine.web.inertia_factor() / 4.0),
                friction: r(rd.friction_n_s_m
                    + fd.friction_n_s_m
                    + rr.friction_n_s_m
                    + shipping.friction_n_s_m),
                path_mass: r(path.iter().map(|roll| roll.mass_kg()).sum()),
                path_friction: r(path.iter().map(|roll| roll.friction_n_s_m).sum()),
                rider_mass: r(rr.mass_kg()),
                rider_friction: r(rr.friction_n_s_m),
                gains_per_mass: symmetrical_optimum(
                    (super::first_web_mode(machine) / 3.0).min(super::fastest_crossover()),
                    period,
                ),
                share_core: r(share_core),
                share_slope: r(slope),
                d_core: r(d_core),
            },
            speed: Pi::default(),
        }
    }

    /// Opens the loop.
    pub fn off(&mut self) {
        self.speed.reset();
    }

    /// Web speed as the rear drum's encoder gives it, m/s.
    pub fn speed(&self, m: &Measurements<R>) -> R {
        m.omega.rd * self.c.r_rd
    }

    /// One period: torques of rear drum, front drum and rider roll, N·m. The unwind's is zero.
    ///
    /// F = M̂·a* + ĉ·v* + t + path + PI(v* − v), with the measured tension t and what the idle rolls after the load
    /// cells take; the front drum takes its share of what is left after the rider roll has turned itself.
    pub fn step(&mut self, task: &DrumTask<R>, m: &Measurements<R>) -> BySection<R> {
        let c = &self.c;
        let error = task.v_ref - self.speed(m);
        let mass = c.drum_mass + c.roll_mass * (m.d_wu * m.d_wu);
        let gains = Gains {
            proportional: c.gains_per_mass.proportional * mass,
            integral: c.gains_per_mass.integral * mass,
        };

        let limit_rr = c.rr.limit(m.omega.rr, task.limit.rr);
        let rider =
            ((c.rider_mass * task.a_ref + c.rider_friction * task.v_ref) * c.r_rr).limit(limit_rr);
        let rider_force = rider / c.r_rr;

        let share = (c.share_core + c.share_slope * (m.d_wu - c.d_core) + task.share_trim)
            .clamp(R::ZERO, R::ONE);
        let lever_fd = share * c.r_fd;
        let lever_rd = (R::ONE - share) * c.r_rd;
        let limit_fd = c.fd.limit(m.omega.fd, task.limit.fd);
        let limit_rd = c.rd.limit(m.omega.rd, task.limit.rd);
        // the drum that comes to its limit first limits the force, so that the split holds
        let limit = force_limit(limit_fd, lever_fd).min(force_limit(limit_rd, lever_rd));

        let path = c.path_mass * task.a_ref + c.path_friction * task.v_ref;
        let feed_forward =
            mass * task.a_ref + c.friction * task.v_ref + m.tension + path - rider_force;
        let force = self.speed.step(&gains, error, feed_forward, -limit, limit);
        BySection {
            uw: R::ZERO,
            rd: force * lever_rd,
            fd: force * lever_fd,
            rr: rider,
        }
    }
}

/// The force at which a torque limit is reached; a drum without a share has none that matters.
fn force_limit<R: Real>(torque: R, lever: R) -> R {
    let smallest = R::of(1e-3);
    torque / lever.max(smallest)
}
