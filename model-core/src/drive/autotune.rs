//! Auto-tune: finds inertia, friction and web mode at the drives' own terminals, and the gains that follow.
//!
//! Not here: the gains in use (`tuning` has them), modes and brakes (the logic's), and everything that a drive cannot
//! measure.
//!
//! A speed loop is tuned without a web, so that nothing but the roll answers: the motor runs it up with a constant
//! torque and down with the same torque turned round, and both accelerations are taken over the same band of speed,
//! where friction is the same:
//!
//!     J = 2·T/(ω̇_up − ω̇_down),   b = −J·(ω̇_up + ω̇_down)/(2·ω)
//!
//! The tension loop is tuned with the web at thread speed: its regulator is held, the unwind pulls a step harder and
//! takes the step back, and the web swings twice about tensions that are known, for in balance a newton at the roll
//! is a newton in the web. Zero crossings and extremes give frequency and damping, frequency and inertia the
//! stiffness of the web path.

use super::pi::{Gains, Pi};
use crate::exchange::{Autotune, Loop, TuneAbort, TuneStep};
use crate::machine::Machine;
use crate::real::Real;

/// The band of speed in which accelerations are taken, of the highest speed.
const BAND: [f64; 2] = [0.03, 0.10];
/// A pass through the band takes at least this long, s, …
const LEAST_PASS_S: f64 = 2.0;
/// … with at most this share of the rated torque, …
const TORQUE_SHARE: f64 = 0.25;
/// … which must be so many times the friction that is expected at the upper end of the band.
const OVER_FRICTION: f64 = 3.0;
/// A step may take so many times as long as the description of the machine lets expect, …
const PATIENCE: f64 = 4.0;
/// … and this long besides, s.
const GRACE_S: f64 = 20.0;
/// An acceleration needs at least so many samples.
const LEAST_SAMPLES: u32 = 20;
/// An inertia or stiffness is plausible within this factor of what is described.
const PLAUSIBLE: f64 = 5.0;
/// Step of speed for the trial, of the highest speed.
const TRIAL_SPEED: f64 = 0.02;
/// The trial may overshoot by this share of its step.
const OVERSHOOT: f64 = 0.10;
/// It has settled when it is so near to the end of its step, of the step, …
const SETTLED: f64 = 0.05;
/// … for this long, s.
const SETTLED_S: f64 = 1.0;
/// Standstill, m/s.
const ZERO_SPEED: f64 = 0.01;
/// A web is there above this share of the stall tension, and lost below it.
const WEB_PRESENT: f64 = 0.5;
/// The conditions may take so long to come, s: brakes open …
const CHECK_S: f64 = 2.0;
/// … and tension and thread speed settle.
const SETTLE_S: f64 = 60.0;
/// A swing of the web, and the trial of the tension loop, may take so long, s.
const SWING_S: f64 = 30.0;
/// Step of force of the tension loop, of the tension reference.
const PROBE: f64 = 0.20;
/// The tension is at rest when it is so near to its reference, of the reference, …
const AT_REST: f64 = 0.05;
/// … for this long, s.
const REST_S: f64 = 3.0;
/// The band of speed for the tension loop, of the thread speed.
const THREAD_BAND: [f64; 2] = [0.5, 2.0];
/// A web that overshoots a step by less than this share of it does not swing: its mode is damped, or too fast for the
/// load cells, and the loop is limited by their filter.
const SWINGS: f64 = 0.20;
/// Zero crossings that are waited for: one whole swing between the first and the last.
const CROSSINGS: u32 = 3;

/// A driven roll without a web, all at one shaft.
#[derive(Clone, Copy, Debug)]
pub struct Axis<R> {
    /// Angular velocity, rad/s.
    pub omega: R,
    /// Radius of its surface, m.
    pub r: R,
    /// Torque that it can have at this speed, N·m.
    pub limit: R,
    /// Rated torque, N·m.
    pub rated: R,
    /// Inertia as known so far, kg·m².
    pub inertia: R,
    /// Friction as known so far, N·m·s/rad.
    pub friction: R,
    /// A brake is closed.
    pub braked: bool,
    /// Measured web tension, N.
    pub tension: R,
}

/// The web between unwind and drums, as the drive sees it.
#[derive(Clone, Copy, Debug)]
pub struct Span<R> {
    /// Measured tension, N.
    pub tension: R,
    /// Its reference, N.
    pub tension_ref: R,
    /// Web speed, m/s.
    pub v: R,
    /// The speed reference rests.
    pub steady: bool,
    /// Unwind in tension control and drums on.
    pub controlled: bool,
    /// Stiffness of the web path as known so far, N/m.
    pub stiffness: R,
    /// Mass of the parent roll at its surface, kg.
    pub mass: R,
    /// Mass of the windup at its surface, kg: the speed loop of the drums is slower than the web, which swings between
    /// the two.
    pub drum_mass: R,
}

/// What has been found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Found<R> {
    /// A roll, at its shaft.
    Roll {
        /// kg·m²
        inertia: R,
        /// N·m·s/rad
        friction: R,
    },
    /// A web.
    Web {
        /// Stiffness of its whole path, N/m.
        stiffness: R,
        /// Damping ratio of its first mode without the regulators' help.
        damping: R,
    },
}

/// The sequence: numbered steps with limits.
#[derive(Clone, Copy, Debug)]
pub struct Tuner<R> {
    c: Coefficients<R>,
    report: Autotune<R>,
    commanded: Option<Loop>,
    found: Option<Found<R>>,
    /// Periods in this step, and how many it may take.
    periods: u32,
    most: u32,
    /// Periods for which a condition has held.
    held: u32,
    /// Test torque, N·m, or force, N.
    level: R,
    line: Line<R>,
    up: Slope<R>,
    /// Tension at rest, N.
    rest: R,
    ring: Ring<R>,
    swing: Swing<R>,
    pi: Pi<R>,
    /// Speed reference of trial and stop, where the trial began and goes to, and how far it came, rad/s.
    omega_ref: R,
    omega_start: R,
    omega_end: R,
    omega_peak: R,
}

#[derive(Clone, Copy, Debug)]
struct Coefficients<R> {
    period: R,
    per_period: R,
    band: [R; 2],
    trial: R,
    deceleration: R,
    web_present: R,
    thread_band: [R; 2],
    rest_periods: u32,
    settled_periods: u32,
    check_periods: u32,
    settle_periods: u32,
    swing_periods: u32,
}

impl<R: Real> Tuner<R> {
    /// For a machine, stepped every `period` seconds.
    pub fn new(machine: &Machine, period: f64) -> Self {
        let o = &machine.operation;
        let periods = |seconds: f64| (seconds / period) as u32;
        let stall = o.stall_share * o.tension_n_m * machine.web.width_m;
        let zero = R::ZERO;
        Self {
            c: Coefficients {
                period: R::of(period),
                per_period: R::of(1.0 / period),
                band: BAND.map(|share| R::of(share * o.max_speed_m_s)),
                trial: R::of(TRIAL_SPEED * o.max_speed_m_s),
                deceleration: R::of(o.acceleration_m_s2),
                web_present: R::of(WEB_PRESENT * stall),
                thread_band: THREAD_BAND.map(|share| R::of(share * o.thread_speed_m_s)),
                rest_periods: periods(REST_S),
                settled_periods: periods(SETTLED_S),
                check_periods: periods(CHECK_S),
                settle_periods: periods(SETTLE_S),
                swing_periods: periods(SWING_S),
            },
            report: Autotune::default(),
            commanded: None,
            found: None,
            periods: 0,
            most: 0,
            held: 0,
            level: zero,
            line: Line::default(),
            up: Slope::default(),
            rest: zero,
            ring: Ring::default(),
            swing: Swing::default(),
            pi: Pi::default(),
            omega_ref: zero,
            omega_start: zero,
            omega_end: zero,
            omega_peak: zero,
        }
    }

    /// What it tells.
    pub fn report(&self) -> &Autotune<R> {
        &self.report
    }

    /// What it tells, to add the settings.
    pub fn report_mut(&mut self) -> &mut Autotune<R> {
        &mut self.report
    }

    /// What has been found since the last call, to be tried or kept.
    pub fn take_found(&mut self) -> Option<Found<R>> {
        self.found.take()
    }

    /// Follows the command; tells which loop is at work. A loop begins when it is commanded anew, and is aborted when
    /// its command is taken back or changed; what is commanded instead begins a period later.
    pub fn follow(&mut self, command: Option<Loop>) -> Option<Loop> {
        if command != self.commanded {
            if self.running().is_some() {
                self.abort(TuneAbort::Cancelled);
                self.commanded = None;
                return None;
            }
            if let Some(of) = command {
                self.report = Autotune {
                    of: Some(of),
                    ..Autotune::default()
                };
                let most = match of {
                    Loop::Tension => self.c.settle_periods,
                    Loop::DrumSpeed | Loop::UnwindSpeed => self.c.check_periods,
                };
                self.found = None;
                self.enter(TuneStep::Check, most);
            }
            self.commanded = command;
        }
        self.running()
    }

    fn running(&self) -> Option<Loop> {
        match self.report.step {
            TuneStep::Idle | TuneStep::Done | TuneStep::Aborted => None,
            _ => self.report.of,
        }
    }

    fn enter(&mut self, step: TuneStep, most: u32) {
        self.report.step = step;
        (self.periods, self.most, self.held) = (0, most, 0);
    }

    fn abort(&mut self, why: TuneAbort) {
        self.report.abort = why;
        self.enter(TuneStep::Aborted, 0);
    }

    /// True for the last of `needed` periods in a row in which `now` was so.
    fn holds(&mut self, now: bool, needed: u32) -> bool {
        self.held = if now { self.held + 1 } else { 0 };
        self.held >= needed
    }

    fn is_late(&mut self) -> bool {
        self.periods += 1;
        self.periods > self.most
    }

    fn progress(&mut self, from: f64, to: f64, share: R) {
        let share = share.clamp(R::ZERO, R::ONE);
        self.report.progress = R::of(from) + R::of(to - from) * share;
    }

    /// One period of a speed loop: the torque at the shaft, N·m. `gains` are those of the speed loop at the shaft for
    /// an inertia.
    pub fn drive(&mut self, axis: &Axis<R>, gains: impl Fn(R) -> Gains<R>) -> R {
        let late = self.is_late();
        let torque = match self.report.step {
            TuneStep::Check => self.check_axis(axis, late),
            TuneStep::Up => self.run_up(axis, late, &gains),
            TuneStep::Down => self.run_down(axis, late, &gains),
            TuneStep::Verify => self.try_gains(axis, late, &gains),
            TuneStep::Stop => self.stop(axis, late, &gains),
            TuneStep::Idle | TuneStep::Done | TuneStep::Aborted => R::ZERO,
        };
        torque.limit(axis.limit)
    }

    fn check_axis(&mut self, axis: &Axis<R>, late: bool) -> R {
        let [low, high] = self.c.band;
        let (low, high) = (low / axis.r, high / axis.r);
        let gentle = axis.inertia * (high - low) * R::of(1.0 / LEAST_PASS_S);
        let friction = axis.friction * high * R::of(OVER_FRICTION);
        self.level = gentle.max(friction).min(axis.rated * R::of(TORQUE_SHARE));
        if !(axis.omega * axis.r).is_near(R::ZERO, R::of(ZERO_SPEED)) {
            self.abort(TuneAbort::NotAtStandstill);
        } else if axis.tension > self.c.web_present {
            self.abort(TuneAbort::WebPresent);
        } else if axis.limit < self.level {
            self.abort(TuneAbort::TorqueLimit);
        } else if !axis.braked {
            self.line = Line::default();
            let expected = axis.inertia * high / self.level;
            self.enter(TuneStep::Up, self.patience(expected));
        } else if late {
            self.abort(TuneAbort::BrakeClosed);
        }
        R::ZERO
    }

    /// Periods that a step may take which is expected to take some seconds.
    fn patience(&self, expected: R) -> u32 {
        let seconds = expected * R::of(PATIENCE) + R::of(GRACE_S);
        (seconds * self.c.per_period).floor_i32().max(0) as u32
    }

    fn run_up(&mut self, axis: &Axis<R>, late: bool, gains: &impl Fn(R) -> Gains<R>) -> R {
        let [low, high] = self.c.band.map(|v| v / axis.r);
        self.progress(0.0, 40.0, axis.omega / high);
        if let Some(why) = self.trouble(axis, late) {
            return self.give_up(axis, why, gains);
        }
        if axis.omega >= low && axis.omega <= high {
            self.line.add(axis.omega);
        }
        if axis.omega <= high {
            return self.level;
        }
        self.up = self.line.slope(self.c.per_period);
        self.line = Line::default();
        self.enter(TuneStep::Down, self.most);
        -self.level
    }

    fn run_down(&mut self, axis: &Axis<R>, late: bool, gains: &impl Fn(R) -> Gains<R>) -> R {
        let [low, high] = self.c.band.map(|v| v / axis.r);
        self.progress(70.0, 40.0, (axis.omega - low) / (high - low));
        if let Some(why) = self.trouble(axis, late) {
            return self.give_up(axis, why, gains);
        }
        if axis.omega >= low && axis.omega <= high {
            self.line.add(axis.omega);
        }
        if axis.omega >= low {
            return -self.level;
        }
        let (up, down) = (self.up, self.line.slope(self.c.per_period));
        if up.samples < LEAST_SAMPLES || down.samples < LEAST_SAMPLES || down.rate >= up.rate {
            return self.give_up(axis, TuneAbort::Implausible, gains);
        }
        let half = R::of(0.5);
        let inertia = (self.level + self.level) / (up.rate - down.rate);
        let braking = -half * inertia * (up.rate + down.rate);
        let friction = (braking / (half * (up.mean + down.mean))).max(R::ZERO);
        self.report.inertia = inertia;
        self.report.friction = friction;
        if !is_plausible(inertia, axis.inertia) {
            return self.give_up(axis, TuneAbort::Implausible, gains);
        }
        self.pi.reset();
        self.omega_start = axis.omega;
        self.omega_ref = axis.omega;
        self.omega_end = axis.omega + self.c.trial / axis.r;
        self.omega_peak = axis.omega;
        let action = self.action_time(gains);
        self.enter(TuneStep::Verify, self.patience(action));
        self.try_gains(axis, false, gains)
    }

    fn trouble(&self, axis: &Axis<R>, late: bool) -> Option<TuneAbort> {
        let [low, high] = self.c.band;
        let v = axis.omega * axis.r;
        if axis.tension > self.c.web_present {
            Some(TuneAbort::WebPresent)
        } else if axis.braked {
            Some(TuneAbort::BrakeClosed)
        } else if axis.limit < self.level {
            Some(TuneAbort::TorqueLimit)
        } else if v < -low || v > high + high {
            Some(TuneAbort::WrongDirection)
        } else {
            late.then_some(TuneAbort::TimeOut)
        }
    }

    /// Comes to rest with the old gains.
    fn give_up(&mut self, axis: &Axis<R>, why: TuneAbort, gains: &impl Fn(R) -> Gains<R>) -> R {
        self.report.abort = why;
        self.come_to_rest(axis, gains)
    }

    fn come_to_rest(&mut self, axis: &Axis<R>, gains: &impl Fn(R) -> Gains<R>) -> R {
        self.pi.reset();
        self.omega_ref = axis.omega;
        let (inertia, _) = self.known(axis);
        let action = gains(inertia).setting(self.c.period).time;
        let expected = (axis.omega * axis.r).abs() / self.c.deceleration + action;
        self.enter(TuneStep::Stop, self.patience(expected));
        self.stop(axis, false, gains)
    }

    /// Inertia and friction of the roll: as found, once it has been found well.
    fn known(&self, axis: &Axis<R>) -> (R, R) {
        if self.report.abort == TuneAbort::None {
            (self.report.inertia, self.report.friction)
        } else {
            (axis.inertia, axis.friction)
        }
    }

    fn action_time(&self, gains: &impl Fn(R) -> Gains<R>) -> R {
        gains(self.report.inertia).setting(self.c.period).time
    }

    /// A step of speed with the new gains, its reference smoothed by the integral action time as the symmetrical
    /// optimum wants it.
    fn try_gains(&mut self, axis: &Axis<R>, late: bool, gains: &impl Fn(R) -> Gains<R>) -> R {
        let step = self.omega_end - self.omega_start;
        self.omega_peak = self.omega_peak.max(axis.omega);
        let gone = (axis.omega - self.omega_start) / step;
        self.progress(70.0, 90.0, gone);
        if let Some(why) = self.trouble(axis, late) {
            return self.give_up(axis, why, gains);
        }
        if self.omega_peak > self.omega_end + step * R::of(OVERSHOOT) {
            return self.give_up(axis, TuneAbort::Implausible, gains);
        }
        let near = axis.omega.is_near(self.omega_end, step * R::of(SETTLED));
        if self.holds(near, self.c.settled_periods) {
            return self.come_to_rest(axis, gains);
        }
        let share = self.c.period / self.action_time(gains).max(self.c.period);
        self.omega_ref += share * (self.omega_end - self.omega_ref);
        self.regulate(axis, R::ZERO, gains)
    }

    fn stop(&mut self, axis: &Axis<R>, late: bool, gains: &impl Fn(R) -> Gains<R>) -> R {
        let change = self.c.deceleration / axis.r * self.c.period;
        let before = self.omega_ref;
        self.omega_ref = before - before.limit(change);
        self.progress(90.0, 100.0, R::ONE - axis.omega * axis.r / self.c.band[0]);
        let still = (axis.omega * axis.r).is_near(R::ZERO, R::of(ZERO_SPEED));
        let stands = self.omega_ref == R::ZERO && still;
        if self.holds(stands, self.c.settled_periods) {
            self.end(axis);
            return R::ZERO;
        }
        if late {
            self.abort(TuneAbort::TimeOut);
            return R::ZERO;
        }
        self.regulate(axis, (self.omega_ref - before) * self.c.per_period, gains)
    }

    /// At rest: what was found is kept, or the reason why not.
    fn end(&mut self, axis: &Axis<R>) {
        if self.report.abort != TuneAbort::None {
            self.enter(TuneStep::Aborted, 0);
            return;
        }
        let (inertia, friction) = self.known(axis);
        self.found = Some(Found::Roll { inertia, friction });
        self.report.progress = R::of(100.0);
        self.enter(TuneStep::Done, 0);
    }

    /// T = J·ω̇* + b·ω* + PI(ω* − ω)
    fn regulate(&mut self, axis: &Axis<R>, rate: R, gains: &impl Fn(R) -> Gains<R>) -> R {
        let (inertia, friction) = self.known(axis);
        let feed_forward = inertia * rate + friction * self.omega_ref;
        let error = self.omega_ref - axis.omega;
        let (low, high) = (-axis.limit, axis.limit);
        self.pi
            .step(&gains(inertia), error, feed_forward, low, high)
    }

    /// One period of the tension loop: what the unwind pulls besides, N, its regulator being held; or nothing.
    pub fn watch(&mut self, span: &Span<R>) -> Option<R> {
        let late = self.is_late();
        let [slowest, fastest] = self.c.thread_band;
        let at_thread = span.v >= slowest && span.v <= fastest;
        let checking = self.report.step == TuneStep::Check;
        let trouble = if !span.controlled {
            Some(TuneAbort::WrongControl)
        } else if span.tension < self.c.web_present {
            Some(TuneAbort::NoTension)
        } else if (!checking || span.v > fastest || late) && !at_thread {
            Some(TuneAbort::WrongSpeed)
        } else {
            late.then_some(TuneAbort::TimeOut)
        };
        if let Some(why) = trouble {
            self.abort(why);
            return None;
        }
        let bound = span.tension_ref * R::of(AT_REST);
        let near = span.tension.is_near(span.tension_ref, bound);
        let rests = near && span.steady && at_thread;
        match self.report.step {
            TuneStep::Check => self.wait_for_rest(span, rests),
            TuneStep::Up => self.pull(span),
            TuneStep::Down => self.let_go(span),
            TuneStep::Verify => {
                if self.holds(rests, self.c.rest_periods) {
                    self.report.progress = R::of(100.0);
                    self.enter(TuneStep::Done, 0);
                }
                None
            }
            _ => None,
        }
    }

    fn wait_for_rest(&mut self, span: &Span<R>, rests: bool) -> Option<R> {
        if self.held == 0 {
            self.rest = R::ZERO;
        }
        let periods = self.c.rest_periods;
        let share = R::ONE / R::of_i32(periods as i32);
        let ready = self.holds(rests, periods);
        self.rest += share * span.tension;
        self.progress(0.0, 20.0, share * R::of_i32(self.held as i32));
        if !ready {
            return None;
        }
        self.level = span.tension_ref * R::of(PROBE);
        self.ring = Ring::about(self.rest + self.level);
        self.enter(TuneStep::Up, self.c.swing_periods);
        Some(self.level)
    }

    fn pull(&mut self, span: &Span<R>) -> Option<R> {
        self.ring.look(span.tension);
        self.progress(20.0, 45.0, self.ring.share());
        if self.ring.is_whole() {
            self.swing = self.ring.swing();
            self.ring = Ring::about(self.rest);
            self.enter(TuneStep::Down, self.c.swing_periods);
            return Some(R::ZERO);
        }
        Some(self.level)
    }

    fn let_go(&mut self, span: &Span<R>) -> Option<R> {
        self.ring.look(span.tension);
        self.progress(45.0, 70.0, self.ring.share());
        if !self.ring.is_whole() {
            return Some(R::ZERO);
        }
        let swing = self.swing.mean(&self.ring.swing());
        let (stiffness, damping) = if swing.overshoot < self.level * R::of(SWINGS) {
            (span.stiffness, R::ONE)
        } else {
            let (mode, damping) = swing.mode(self.c.per_period);
            let mass = span.mass * span.drum_mass / (span.mass + span.drum_mass);
            (mass * (mode * mode), damping)
        };
        self.report.stiffness = stiffness;
        if !is_plausible(stiffness, span.stiffness) {
            self.abort(TuneAbort::Implausible);
            return None;
        }
        self.found = Some(Found::Web { stiffness, damping });
        self.enter(TuneStep::Verify, self.c.swing_periods);
        None
    }
}

fn is_plausible<R: Real>(found: R, described: R) -> bool {
    let factor = R::of(PLAUSIBLE);
    found * factor > described && found < described * factor
}

/// The straight line of least squares through samples that are taken every period.
#[derive(Clone, Copy, Debug, Default)]
struct Line<R> {
    first: R,
    samples: u32,
    /// Σy and Σk·y, y from the first sample on.
    sum: R,
    moment: R,
}

/// What a line has.
#[derive(Clone, Copy, Debug, Default)]
struct Slope<R> {
    /// For a second.
    rate: R,
    mean: R,
    samples: u32,
}

impl<R: Real> Line<R> {
    fn add(&mut self, y: R) {
        if self.samples == 0 {
            self.first = y;
        }
        let from_first = y - self.first;
        self.sum += from_first;
        self.moment += R::of_i32(self.samples as i32) * from_first;
        self.samples += 1;
    }

    /// Σ(k − k̄)·y/Σ(k − k̄)² with Σ(k − k̄)² = n·(n² − 1)/12
    fn slope(&self, per_period: R) -> Slope<R> {
        if self.samples < 2 {
            return Slope::default();
        }
        let n = R::of_i32(self.samples as i32);
        let middle = (n - R::ONE) * R::of(0.5);
        let spread = n * (n * n - R::ONE) * R::of(1.0 / 12.0);
        Slope {
            rate: (self.moment - middle * self.sum) / spread * per_period,
            mean: self.first + self.sum / n,
            samples: self.samples,
        }
    }
}

/// A swing about a level, looked at every period.
#[derive(Clone, Copy, Debug, Default)]
struct Ring<R> {
    level: R,
    periods: u32,
    last: R,
    crossings: u32,
    /// Times of the first and of the latest crossing, in periods.
    first: R,
    latest: R,
    /// Largest deviation since the latest crossing, and those between crossings.
    peak: R,
    peaks: [R; CROSSINGS as usize - 1],
}

/// Half a swing.
#[derive(Clone, Copy, Debug, Default)]
struct Swing<R> {
    /// Its duration, in periods.
    half: R,
    /// How far the first half goes, and how much smaller the second is.
    overshoot: R,
    ratio: R,
}

impl<R: Real> Ring<R> {
    fn about(level: R) -> Self {
        Self {
            level,
            ..Self::default()
        }
    }

    fn look(&mut self, y: R) {
        let deviation = y - self.level;
        let crosses = self.periods > 0 && deviation * self.last < R::ZERO;
        if crosses && !self.is_whole() {
            let within = self.last / (self.last - deviation);
            self.latest = R::of_i32(self.periods as i32 - 1) + within;
            if self.crossings == 0 {
                self.first = self.latest;
            } else if let Some(peak) = self.peaks.get_mut(self.crossings as usize - 1) {
                *peak = self.peak;
            }
            self.peak = R::ZERO;
            self.crossings += 1;
        }
        self.peak = self.peak.max(deviation.abs());
        self.last = deviation;
        self.periods += 1;
    }

    fn is_whole(&self) -> bool {
        self.crossings >= CROSSINGS
    }

    fn share(&self) -> R {
        R::of_i32(self.crossings as i32) * R::of(1.0 / CROSSINGS as f64)
    }

    fn swing(&self) -> Swing<R> {
        let [before, after] = self.peaks;
        Swing {
            half: (self.latest - self.first) * R::of(0.5),
            overshoot: before,
            ratio: after / before,
        }
    }
}

impl<R: Real> Swing<R> {
    fn mean(&self, other: &Self) -> Self {
        let half = R::of(0.5);
        Self {
            half: half * (self.half + other.half),
            overshoot: half * (self.overshoot + other.overshoot),
            ratio: half * (self.ratio + other.ratio),
        }
    }

    /// ω and ζ of the undamped mode: with δ = ln(1/ratio), ζ = δ/√(π² + δ²) and ω = √(π² + δ²)/T_half.
    fn mode(&self, per_period: R) -> (R, R) {
        let pi = core::f64::consts::PI;
        let decrement = -libm::log(self.ratio.to_f64().clamp(1e-6, 1.0));
        let turn = libm::sqrt(pi * pi + decrement * decrement);
        (
            R::of(turn) / self.half * per_period,
            R::of(decrement / turn),
        )
    }
}
