//! The unwind's regulators: tension, slack take-up, and speed after a web break.
//!
//! Not here: the parent roll's true radius or inertia; both come from the diameter estimate.

use super::motor::Motor;
use super::pi::{Gains, Pi};
use super::tuning::UnwindTuning;
use crate::exchange::{Measurements, UnwindControl};
use crate::machine::Machine;
use crate::real::Real;

/// Limit of the tension loop's trim, of rated torque.
const TRIM_LIMIT: f64 = 0.20;
/// Where the tension loop is opened, its whole trim is given back in this time, s.
const RELEASE_S: f64 = 2.0;
/// Corner of the high-pass that keeps a wrong diameter out of the damping, rad/s.
const WASHOUT: f64 = 1.0;
/// The slack take-up turns slower than the web by at least this, m/s …
const LEAST_DRAW: f64 = 0.5 / 60.0;
/// … and by a share of the web speed that grows with time, 1/s: a wrong diameter preset is found out, gently.
const DRAW_RATE: f64 = 0.005;
/// Mass and web mode follow the radius when it has changed by this share: the roll changes slowly.
const RADIUS_CHANGE: f64 = 1e-4;

/// Below this speed the compensation of the closed brake fades, m/s: at standstill the brake takes what it must.
const BRAKE_SPEED: f64 = 0.02;

/// Regulators of the unwind.
#[derive(Clone, Copy, Debug)]
pub struct Unwind<R> {
    c: Coefficients<R>,
    tension: Pi<R>,
    /// What the tension loop adds, N.
    trim: R,
    speed: Pi<R>,
    /// Draw of the slack take-up, share of the web speed.
    draw: R,
    /// Low-pass of the speed error; what it leaves is damped.
    slow_error: R,
    control: UnwindControl,
    /// Torque of the last period, N·m.
    torque: R,
    /// The motor gave all it could.
    at_limit: bool,
    known: Known<R>,
}

#[derive(Clone, Copy, Debug)]
struct Coefficients<R> {
    motor: Motor<R>,
    /// Mass and friction of the idle rolls before the load cells, at the surface.
    path_mass: R,
    path_friction: R,
    trim_limit: R,
    /// Share of the limit that a period gives back.
    release: R,
    per_max_speed: R,
    washout: R,
    draw_rate: R,
    least_draw: R,
    brake: R,
    per_brake_speed: R,
}

/// What follows from tuning and radius.
#[derive(Clone, Copy, Debug)]
struct Known<R> {
    tuning: UnwindTuning<R>,
    /// The radius it was computed for, and how far it is good, m.
    r: R,
    within: R,
    per_r: R,
    /// Ĵ/R̂², kg.
    mass: R,
    /// First web mode with the drums held, rad/s.
    mode: R,
    /// Speed by which the unwind runs slower for a rate of tension of 1 N/s, m/N.
    per_stiffness: R,
    tension_gains: Gains<R>,
    speed_gains: Gains<R>,
}

impl<R: Real> Known<R> {
    fn new(tuning: &UnwindTuning<R>, r: R) -> Self {
        let mass = tuning.inertia(r) / (r * r);
        let mode = tuning.mode(mass);
        Self {
            tuning: *tuning,
            r,
            within: R::of(RADIUS_CHANGE) * r,
            per_r: R::ONE / r,
            mass,
            mode,
            per_stiffness: R::ONE / tuning.web_stiffness,
            tension_gains: tuning.tension_gains(mode),
            speed_gains: tuning.speed_gains(mass, mode),
        }
    }
}

/// What the unwind is to do.
pub struct UnwindTask<R> {
    /// How it is controlled.
    pub control: UnwindControl,
    /// Speed reference, m/s.
    pub v_ref: R,
    /// Its acceleration that is to be compensated, m/s².
    pub a_ref: R,
    /// Tension reference, N.
    pub tension_ref: R,
    /// Its rate, N/s.
    pub tension_rate: R,
    /// Web speed as measured, m/s.
    pub v: R,
    /// Estimated radius, m.
    pub r: R,
    /// Limit of torque, of rated torque.
    pub limit: R,
    /// The tension loop is open: nothing is trimmed.
    pub open: bool,
    /// The tension loop is open and undamped, and pulls so much more, N: auto-tune looks how the web swings.
    pub probe: Option<R>,
}

impl<R: Real> Unwind<R> {
    /// For a machine, with a roll of radius `r`, stepped every `period` seconds.
    pub fn new(
        machine: &Machine,
        motor: Motor<R>,
        tuning: &UnwindTuning<R>,
        r: R,
        period: f64,
    ) -> Self {
        let path = &machine.idle[..=machine.load_cells.roll];
        let of = R::of;
        Self {
            c: Coefficients {
                motor,
                path_mass: of(path.iter().map(|roll| roll.mass_kg()).sum()),
                path_friction: of(path.iter().map(|roll| roll.friction_n_s_m).sum()),
                trim_limit: of(TRIM_LIMIT * machine.motors.uw.torque_n_m),
                release: of(period / RELEASE_S),
                per_max_speed: of(1.0 / machine.operation.max_speed_m_s),
                washout: of(WASHOUT * period),
                draw_rate: of(DRAW_RATE * period),
                least_draw: of(LEAST_DRAW),
                brake: of(machine.brakes.uw_n_m),
                per_brake_speed: of(1.0 / BRAKE_SPEED),
            },
            tension: Pi::default(),
            trim: R::ZERO,
            speed: Pi::default(),
            draw: R::ZERO,
            slow_error: R::ZERO,
            control: UnwindControl::Off,
            torque: R::ZERO,
            at_limit: false,
            known: Known::new(tuning, r),
        }
    }

    /// The motor gave all it could in the last period.
    pub fn at_limit(&self) -> bool {
        self.at_limit
    }

    /// What the regulators know, and their gains.
    pub fn tuning(&self) -> &UnwindTuning<R> {
        &self.known.tuning
    }

    /// Changes that, with a roll of radius `r`.
    pub fn tune(&mut self, tuning: &UnwindTuning<R>, r: R) {
        self.known = Known::new(tuning, r);
    }

    /// Gains of the tension loop at the present radius.
    pub fn tension_gains(&self) -> Gains<R> {
        self.known.tension_gains
    }

    /// The motor has been driven by something else.
    pub fn stand_by(&mut self, torque: R) {
        self.control = UnwindControl::Off;
        self.torque = torque;
        self.at_limit = false;
    }

    /// One period: the shaft torque, N·m.
    pub fn step(&mut self, task: &UnwindTask<R>, m: &Measurements<R>) -> R {
        if !task.r.is_near(self.known.r, self.known.within) {
            self.known = Known::new(&self.known.tuning, task.r);
        }
        let (c, k) = (&self.c, &self.known);
        let limit = c.motor.limit(m.omega.uw, task.limit) * k.per_r;
        let v = m.omega.uw * task.r;
        let roll = Roll {
            entered: task.control != self.control,
            was: self.control,
            v,
            // to raise the tension the unwind must run a little slower than the web
            error: v - task.v + task.tension_rate * k.per_stiffness,
            limit,
        };
        self.slow_error += c.washout * (roll.error - self.slow_error);
        self.control = task.control;
        let force = match task.control {
            UnwindControl::Off => R::ZERO,
            UnwindControl::TakeUp => self.take_up(task, m, &roll),
            UnwindControl::Tension => self.hold_tension(task, m, &roll),
            UnwindControl::Speed => self.hold_speed(task, m, &roll),
        };
        self.at_limit = force.abs() >= limit;
        self.torque = force.limit(limit) * task.r;
        self.torque
    }

    /// F = −t* + m̂·a* + ĉ·v* + F_brake + path − trim − damping
    ///
    /// `path` is what the idle rolls before the load cells take: their inertia and friction are compensated as
    /// the roll's own. The damping acts on the fast part of the unwind's speed error and fades as the web's own
    /// transport takes over. Where the tension loop is open, the trim goes to zero and stays there.
    fn hold_tension(&mut self, task: &UnwindTask<R>, m: &Measurements<R>, roll: &Roll<R>) -> R {
        let (c, k) = (&self.c, &self.known);
        let path = c.path_mass * task.a_ref + c.path_friction * task.v_ref;
        let open_loop = self.feed_forward(task, m) + path - task.tension_ref;
        let error = task.tension_ref - m.tension;
        let bound = c.trim_limit * k.per_r;
        let crawl = (R::ONE - task.v.abs() * c.per_max_speed).max(R::ZERO);
        let fast = roll.error - self.slow_error;
        let damping = k.tuning.damping * crawl * k.mode * k.mass * fast;
        if roll.entered {
            // bumpless: the trim takes up where the torque stands. The damping is left out, for what swings now does
            // not stay
            self.trim = (open_loop - self.torque * k.per_r).limit(bound);
            self.tension.start_at(&k.tension_gains, error, self.trim);
        }
        if let Some(probe) = task.probe {
            return open_loop - self.trim - probe;
        }
        if task.open {
            self.trim -= self.trim.limit(c.release * bound);
            self.tension.start_at(&k.tension_gains, error, self.trim);
        } else {
            let gains = &k.tension_gains;
            self.trim = self.tension.step(gains, error, R::ZERO, -bound, bound);
        }
        open_loop - self.trim - damping
    }

    /// Turns a little slower than the web, so that slack is taken up, and holds the web with no more than the
    /// tension reference once it is tight. Goes on from the torque of another control.
    fn take_up(&mut self, task: &UnwindTask<R>, m: &Measurements<R>, roll: &Roll<R>) -> R {
        let c = &self.c;
        self.draw = if roll.entered {
            R::ZERO
        } else {
            self.draw + c.draw_rate
        };
        let draw = (self.draw * task.v_ref.abs()).max(c.least_draw);
        let feed_forward = self.feed_forward(task, m);
        let low = (feed_forward - task.tension_ref).max(-roll.limit);
        let error = task.v_ref - draw - roll.v;
        if roll.entered && roll.was == UnwindControl::Off {
            self.speed.reset();
        } else if roll.entered {
            let standing = self.torque * self.known.per_r - feed_forward;
            self.speed
                .start_at(&self.known.speed_gains, error, standing);
        }
        self.regulate_speed(error, feed_forward, low, roll)
    }

    /// Follows the speed reference. Begins without the torque that stands: the web that it held is gone.
    fn hold_speed(&mut self, task: &UnwindTask<R>, m: &Measurements<R>, roll: &Roll<R>) -> R {
        let feed_forward = self.feed_forward(task, m);
        if roll.entered {
            self.speed.reset();
        }
        let error = task.v_ref - roll.v;
        self.regulate_speed(error, feed_forward, -roll.limit, roll)
    }

    fn regulate_speed(&mut self, error: R, feed_forward: R, low: R, roll: &Roll<R>) -> R {
        let gains = &self.known.speed_gains;
        self.speed.step(gains, error, feed_forward, low, roll.limit)
    }

    /// Inertia, friction and the closed brake: m̂·a* + ĉ·v* + F_brake
    fn feed_forward(&self, task: &UnwindTask<R>, m: &Measurements<R>) -> R {
        let (c, k) = (&self.c, &self.known);
        let brake = if m.brakes.uw {
            let turning = (task.v * c.per_brake_speed).limit(R::ONE);
            c.brake * turning * k.per_r
        } else {
            R::ZERO
        };
        k.mass * task.a_ref + k.tuning.friction * task.v_ref + brake
    }
}

/// The parent roll as the drive sees it in this period.
struct Roll<R> {
    /// Its control has changed …
    entered: bool,
    /// … from this.
    was: UnwindControl,
    /// Surface speed, m/s.
    v: R,
    /// Surface speed less the speed that belongs to the tension reference, m/s.
    error: R,
    /// Largest force, N.
    limit: R,
}
