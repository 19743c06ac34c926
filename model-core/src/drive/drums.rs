//! The windup's regulators: web speed by both drums together, winding force by their split, and the rider roll.
//!
//! Not here: slip of a single drum.

use super::motor::Motor;
use super::pi::Pi;
use super::table::Table;
use super::tuning::DrumTuning;
use crate::exchange::{BySection, Measurements};
use crate::machine::{MAX_FRONT_SHARES, Machine};
use crate::real::Real;

/// Lag with which the drums take over the tension that the unwind holds, s.
const TENSION_LAG_S: f64 = 0.5;
/// A drum whose lever on the force is shorter than this, m, does not limit it.
const LEAST_LEVER: f64 = 1e-3;

/// Speed regulator of the windup, inertia and friction compensated, with the split of its force.
#[derive(Clone, Copy, Debug)]
pub struct Drums<R> {
    c: Coefficients<R>,
    tuning: DrumTuning<R>,
    speed: Pi<R>,
    /// Tension that is worked against, N; from the measured to the held one it goes smoothly.
    tension: R,
}

#[derive(Clone, Copy, Debug)]
struct Coefficients<R> {
    motors: BySection<Motor<R>>,
    r_rd: R,
    r_fd: R,
    r_rr: R,
    per_r_rr: R,
    /// Mass and friction of the idle rolls after the load cells, at the surface.
    path_mass: R,
    path_friction: R,
    rider_mass: R,
    rider_friction: R,
    /// Front drum's share of the drums' force over the diameter.
    front_share: Table<R, MAX_FRONT_SHARES>,
    /// Rider roll's share of the winding force.
    rider_share: R,
    /// Share of a change of tension that a period makes up for.
    tension_share: R,
}

/// What the drums are to do.
pub struct DrumTask<R> {
    /// Speed reference, m/s.
    pub v_ref: R,
    /// Its acceleration that is to be compensated, m/s².
    pub a_ref: R,
    /// Limits of torque, of rated torque.
    pub limit: BySection<R>,
    /// Tension that the unwind holds, N, to work against; otherwise it is the measured one. With that, web and drums
    /// would push each other up.
    pub tension: Option<R>,
    /// What the unwind pulls besides, N: auto-tune looks how the web swings.
    pub probe: R,
    /// Added to the front drum's share.
    pub share_trim: R,
    /// The rider roll is lifted and coasts.
    pub rider_lifted: bool,
}

impl<R: Real> Drums<R> {
    /// For a machine, stepped every `period` seconds.
    pub fn new(
        machine: &Machine,
        motors: &BySection<Motor<R>>,
        tuning: &DrumTuning<R>,
        period: f64,
    ) -> Self {
        let (rd, fd, rr) = (&machine.rear_drum, &machine.front_drum, &machine.rider_roll);
        let path = &machine.idle[machine.load_cells.roll + 1..];
        let shares = machine.operation.front_share.iter();
        let shares = shares.map(|point| (point.diameter_m, point.share));
        let r = R::of;
        Self {
            c: Coefficients {
                motors: *motors,
                r_rd: r(rd.radius_m),
                r_fd: r(fd.radius_m),
                r_rr: r(rr.radius_m),
                per_r_rr: r(1.0 / rr.radius_m),
                path_mass: r(path.iter().map(|roll| roll.mass_kg()).sum()),
                path_friction: r(path.iter().map(|roll| roll.friction_n_s_m).sum()),
                rider_mass: r(rr.mass_kg()),
                rider_friction: r(rr.friction_n_s_m),
                front_share: Table::new(shares),
                rider_share: r(machine.operation.rider_share),
                tension_share: r(-libm::expm1(-period / TENSION_LAG_S)),
            },
            tuning: *tuning,
            speed: Pi::default(),
            tension: R::ZERO,
        }
    }

    /// Opens the loop.
    pub fn off(&mut self) {
        self.speed.reset();
        self.tension = R::ZERO;
    }

    /// What the regulators know, and their gains.
    pub fn tuning(&self) -> &DrumTuning<R> {
        &self.tuning
    }

    /// Changes that.
    pub fn tune(&mut self, tuning: &DrumTuning<R>) {
        self.tuning = *tuning;
    }

    /// Web speed as the rear drum's encoder gives it, m/s.
    pub fn speed(&self, m: &Measurements<R>) -> R {
        m.omega.rd * self.c.r_rd
    }

    /// Radius of the rear drum, m.
    pub fn radius(&self) -> R {
        self.c.r_rd
    }

    /// Largest force of both drums with the same torque for each metre of radius, N.
    pub fn limit(&self, limit: &BySection<R>, m: &Measurements<R>) -> R {
        let c = &self.c;
        let half = R::of(0.5);
        self.force_limit(half * c.r_rd, half * c.r_fd, limit, m)
    }

    /// Torques that give a force, N, both drums with the same torque for each metre of radius.
    pub fn evenly(&self, force: R) -> BySection<R> {
        let half = R::of(0.5) * force;
        BySection {
            rd: half * self.c.r_rd,
            fd: half * self.c.r_fd,
            ..BySection::default()
        }
    }

    /// The drum that comes to its limit first limits the force, so that the split holds.
    fn force_limit(
        &self,
        lever_rd: R,
        lever_fd: R,
        limit: &BySection<R>,
        m: &Measurements<R>,
    ) -> R {
        let motors = &self.c.motors;
        let least = R::of(LEAST_LEVER);
        let fd = motors.fd.limit(m.omega.fd, limit.fd) / lever_fd.max(least);
        let rd = motors.rd.limit(m.omega.rd, limit.rd) / lever_rd.max(least);
        fd.min(rd)
    }

    /// One period: torques of rear drum, front drum and rider roll, N·m. The unwind's is zero.
    ///
    /// F = M̂·a* + ĉ·v* + t + path + PI(v* − v), with the tension t and what the idle rolls after the load
    /// cells take. The rider roll turns itself and gives its share of what is compensated; of the rest, which the
    /// regulator trims, the front drum takes its share. A lifted rider roll neither takes nor gives.
    pub fn step(&mut self, task: &DrumTask<R>, m: &Measurements<R>) -> BySection<R> {
        let c = &self.c;
        match task.tension {
            Some(held) => self.tension += c.tension_share * (held - self.tension),
            None => self.tension = m.tension,
        }
        let error = task.v_ref - self.speed(m);
        let mass = self.tuning.mass(m.d_wu);
        let gains = self.tuning.speed_gains(mass);

        let path = c.path_mass * task.a_ref + c.path_friction * task.v_ref;
        let feed_forward = mass * task.a_ref
            + self.tuning.friction * task.v_ref
            + self.tension
            + task.probe
            + path;
        let own = c.rider_mass * task.a_ref + c.rider_friction * task.v_ref;
        let (feed_forward, rider_force) = if task.rider_lifted {
            (feed_forward - own, R::ZERO)
        } else {
            (feed_forward, own + c.rider_share * (feed_forward - own))
        };
        let rider = (rider_force * c.r_rr).limit(c.motors.rr.limit(m.omega.rr, task.limit.rr));

        let share = (c.front_share.at(m.d_wu) + task.share_trim).clamp(R::ZERO, R::ONE);
        let lever_fd = share * c.r_fd;
        let lever_rd = (R::ONE - share) * c.r_rd;
        let limit = self.force_limit(lever_rd, lever_fd, &task.limit, m);
        let rest = feed_forward - rider * c.per_r_rr;
        let force = self.speed.step(&gains, error, rest, -limit, limit);
        BySection {
            uw: R::ZERO,
            rd: force * lever_rd,
            fd: force * lever_fd,
            rr: rider,
        }
    }
}
