//! The unwind's regulators: tension, slack take-up, and speed after a web break.
//!
//! Not here: the parent roll's true radius or inertia; both come from the diameter estimate.

use super::motor::Motor;
use super::pi::{Gains, Pi};
use super::symmetrical_optimum;
use crate::exchange::{Measurements, UnwindControl};
use crate::machine::Machine;
use crate::real::Real;

/// Crossover of the tension loop's integral action, rad/s.
const TENSION_CROSSOVER: f64 = 1.2;
/// Proportional gain of the tension loop.
const TENSION_GAIN: f64 = 0.3;
/// Limit of the tension loop's trim, of rated torque.
const TRIM_LIMIT: f64 = 0.20;
/// Damping ratio that the first web mode is given at crawl, where it has none of its own.
const CRAWL_DAMPING: f64 = 0.5;
/// Corner of the high-pass that keeps a wrong diameter out of the damping, rad/s.
const WASHOUT: f64 = 1.0;
/// The slack take-up turns slower than the web by at least this, m/s …
const LEAST_DRAW: f64 = 0.5 / 60.0;
/// … and by a share of the web speed that grows with time, 1/s: a wrong diameter preset is found out, gently.
const DRAW_RATE: f64 = 0.005;

/// Below this speed the compensation of the closed brake fades, m/s: at standstill the brake takes what it must.
const BRAKE_SPEED: f64 = 0.1;

/// Regulators of the unwind.
#[derive(Clone, Copy, Debug)]
pub struct Unwind<R> {
    c: Coefficients<R>,
    tension: Pi<R>,
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
}

#[derive(Clone, Copy, Debug)]
struct Coefficients<R> {
    motor: Motor<R>,
    inertia_factor: R,
    inertia_offset: R,
    friction: R,
    /// Mass and friction of the idle rolls before the load cells, at the surface.
    path_mass: R,
    path_friction: R,
    /// Stiffness of the whole web path, N/m.
    web_stiffness: R,
    tension_gains: Gains<R>,
    trim_limit: R,
    /// Gains of the speed loop for 1 kg and 1 rad/s.
    per_crossover: Gains<R>,
    /// Largest crossover of the speed loop, rad/s.
    fastest: R,
    damping: R,
    per_max_speed: R,
    washout: R,
    draw_rate: R,
    least_draw: R,
    brake: R,
    per_brake_speed: R,
}

/// What the unwind is to do.
pub struct UnwindTask<R> {
    /// How it is controlled.
    pub control: UnwindControl,
    /// Speed reference, m/s.
    pub v_ref: R,
    /// Its acceleration, m/s².
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
}

impl<R: Real> Unwind<R> {
    /// For a machine, stepped every `period` seconds.
    pub fn new(machine: &Machine, period: f64) -> Self {
        let path = &machine.idle[..=machine.load_cells.roll];
        let stiffness = super::web_stiffness(machine);
        let r = R::of;
        Self {
            c: Coefficients {
                motor: Motor::new(&machine.motors.uw),
                inertia_factor: r(machine.web.inertia_factor()),
                inertia_offset: r(machine.parent_roll_offset()),
                friction: r(machine.parent_roll.friction_n_s_m),
                path_mass: r(path.iter().map(|roll| roll.mass_kg()).sum()),
                path_friction: r(path.iter().map(|roll| roll.friction_n_s_m).sum()),
                web_stiffness: r(stiffness),
                tension_gains: Gains {
                    proportional: r(TENSION_GAIN),
                    integral: r(TENSION_CROSSOVER * period),
                },
                trim_limit: r(TRIM_LIMIT * machine.motors.uw.torque_n_m),
                // the crossover is scheduled with the web mode, see `speed_gains`
                per_crossover: symmetrical_optimum(1.0, period),
                fastest: r(super::fastest_crossover()),
                damping: r(2.0 * CRAWL_DAMPING),
                per_max_speed: r(1.0 / machine.operation.max_speed_m_s),
                washout: r(WASHOUT * period),
                draw_rate: r(DRAW_RATE * period),
                least_draw: r(LEAST_DRAW),
                brake: r(machine.brakes.uw_n_m),
                per_brake_speed: r(1.0 / BRAKE_SPEED),
            },
            tension: Pi::default(),
            speed: Pi::default(),
            draw: R::ZERO,
            slow_error: R::ZERO,
            control: UnwindControl::Off,
            torque: R::ZERO,
            at_limit: false,
        }
    }

    /// The motor gave all it could in the last period.
    pub fn at_limit(&self) -> bool {
        self.at_limit
    }

    /// One period: the shaft torque, N·m.
    pub fn step(&mut self, task: &UnwindTask<R>, m: &Measurements<R>) -> R {
        let c = &self.c;
        let square = task.r * task.r;
        let mass = (c.inertia_offset + c.inertia_factor * (square * square)) / square;
        let limit = c.motor.limit(m.omega.uw, task.limit) / task.r;
        let v = m.omega.uw * task.r;
        let roll = Roll {
            entered: task.control != self.control,
            v,
            mass,
            mode: (c.web_stiffness / mass).sqrt(),
            // to raise the tension the unwind must run a little slower than the web
            error: v - task.v + task.tension_rate / c.web_stiffness,
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
    /// transport takes over.
    fn hold_tension(&mut self, task: &UnwindTask<R>, m: &Measurements<R>, roll: &Roll<R>) -> R {
        let c = &self.c;
        let path = c.path_mass * task.a_ref + c.path_friction * task.v_ref;
        let open_loop = self.feed_forward(task, m, roll) + path - task.tension_ref;
        let error = task.tension_ref - m.tension;
        let bound = c.trim_limit / task.r;
        if roll.entered {
            // bumpless: the trim takes up where the torque stands
            let trim = open_loop - self.torque / task.r;
            self.tension
                .start_at(&c.tension_gains, error, trim.limit(bound));
        }
        let trim = self
            .tension
            .step(&c.tension_gains, error, R::ZERO, -bound, bound);
        let crawl = (R::ONE - task.v.abs() * c.per_max_speed).max(R::ZERO);
        let damping = c.damping * crawl * roll.mode * roll.mass * (roll.error - self.slow_error);
        open_loop - trim - damping
    }

    /// Turns a little slower than the web, so that slack is taken up, and holds the web with no more than the
    /// tension reference once it is tight.
    fn take_up(&mut self, task: &UnwindTask<R>, m: &Measurements<R>, roll: &Roll<R>) -> R {
        let c = &self.c;
        self.draw = if roll.entered {
            R::ZERO
        } else {
            self.draw + c.draw_rate
        };
        let draw = (self.draw * task.v_ref.abs()).max(c.least_draw);
        let feed_forward = self.feed_forward(task, m, roll);
        let low = (feed_forward - task.tension_ref).max(-roll.limit);
        self.regulate_speed(task.v_ref - draw, feed_forward, low, roll)
    }

    /// Follows the speed reference.
    fn hold_speed(&mut self, task: &UnwindTask<R>, m: &Measurements<R>, roll: &Roll<R>) -> R {
        let feed_forward = self.feed_forward(task, m, roll);
        self.regulate_speed(task.v_ref, feed_forward, -roll.limit, roll)
    }

    /// Speed regulator by the symmetrical optimum, slowed to a third of the web mode of this radius.
    fn regulate_speed(&mut self, v_ref: R, feed_forward: R, low: R, roll: &Roll<R>) -> R {
        let c = &self.c;
        let crossover = (roll.mode * R::of(1.0 / 3.0)).min(c.fastest);
        let gains = Gains {
            proportional: c.per_crossover.proportional * crossover * roll.mass,
            integral: c.per_crossover.integral * (crossover * crossover) * roll.mass,
        };
        if roll.entered {
            self.speed.reset();
        }
        self.speed
            .step(&gains, v_ref - roll.v, feed_forward, low, roll.limit)
    }

    /// Inertia, friction and the closed brake: m̂·a* + ĉ·v* + F_brake
    fn feed_forward(&self, task: &UnwindTask<R>, m: &Measurements<R>, roll: &Roll<R>) -> R {
        let c = &self.c;
        let turning = (task.v * c.per_brake_speed).limit(R::ONE);
        let brake = if m.brakes.uw {
            c.brake * turning / task.r
        } else {
            R::ZERO
        };
        roll.mass * task.a_ref + c.friction * task.v_ref + brake
    }
}

/// The parent roll as the drive knows it in this period.
struct Roll<R> {
    /// Its control has changed.
    entered: bool,
    /// Surface speed, m/s.
    v: R,
    /// Ĵ/R̂², kg.
    mass: R,
    /// First web mode with the drums held, rad/s.
    mode: R,
    /// Surface speed less the speed that belongs to the tension reference, m/s.
    error: R,
    /// Largest force, N.
    limit: R,
}
