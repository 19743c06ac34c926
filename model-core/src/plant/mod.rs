//! The winder and its web: what the drives act on and the sensors look at.
//!
//! Not here: regulators, logic, sensors' faults. The windup does not slip, rolls are round.
//!
//! The web runs from the unwind `uw` over idle rolls (`gr`, `sr`) to the rear drum `rd`. Running direction is
//! positive for speeds and motor torques; a span pulls the roll before it forward and holds the roll after it
//! back. A span is named after the roll it leaves.

pub mod friction;
pub mod rk4;
pub mod roll;
pub mod sensors;
pub mod span;
pub mod windup;

use crate::exchange::{Actuators, Brakes, Measurements};
use crate::machine::{Machine, MachineError};
use crate::real::{Real, Sum};
use friction::{Delay, Friction};
use rk4::{Rk4, State};
use roll::{Idle, Unwind};
use sensors::{Sensors, Sight};
use span::{Spans, Web};
use windup::Windup;

/// Period of the plant task and step of its integration, ms.
pub const PLANT_PERIOD_MS: u32 = 4;

/// Strain of a web that has just been led through by hand: 2 mm of loop for each metre.
pub const THREADED_STRAIN: f64 = -0.002;

/// The winder with its web, advanced by fixed steps.
#[derive(Clone, Debug)]
pub struct Winder<R: Real, const SPANS: usize> {
    coefficients: Coefficients<R, SPANS>,
    state: State<R::Sum, SPANS>,
    /// Strain rates and tensions that belong to the state.
    web: Web<R, SPANS>,
    /// The web is led through the machine and whole.
    threaded: bool,
    delay: Brakes<Delay>,
    closed: Brakes<bool>,
    sensors: Sensors<R>,
}

#[derive(Clone, Copy, Debug)]
struct Coefficients<R, const SPANS: usize> {
    spans: Spans<R, SPANS>,
    /// The roll at the end of each span but the last, where the windup is.
    idle: [Option<Idle<R>>; SPANS],
    unwind: Unwind<R>,
    windup: Windup<R>,
    rk4: Rk4<R>,
    /// 1/h, 1/s.
    per_step: R,
    /// Torque of the unwind's brake, N·m; forces of the drums' brakes at their surface, N.
    brakes: Brakes<R>,
    /// Tension at which the web breaks, N.
    strength: R,
    core_radius: R,
    full_radius: R,
    expire_radius: R,
    threaded_strain: R,
}

/// What drives the two bodies that have motors, constant over a step.
#[derive(Clone, Copy)]
struct Load<R> {
    /// Torque on the parent roll, N·m.
    uw: R,
    /// Force on the surface of the windup, N.
    wu: R,
}

/// The two bodies that have motors and brakes, at one instant.
struct Bodies<R> {
    /// Inertia of the parent roll, kg·m², and all torques on it, N·m.
    uw: (R, R),
    /// Mass of the windup at its surface, kg, and all forces on it, N.
    wu: (R, R),
    /// Ṙ_wu, m/s.
    r_wu_rate: R,
}

impl<R: Real, const SPANS: usize> Winder<R, SPANS> {
    /// The winder of a machine with `SPANS` spans, in steps of `h` seconds: at standstill, web not threaded,
    /// full parent roll, bare core, brakes off.
    ///
    /// Fails with the first parameter that is outside its limits, or when the machine has another number of
    /// spans.
    pub fn new(machine: &Machine, h: f64) -> Result<Self, MachineError> {
        machine.validate()?;
        if machine.idle.len() + 1 != SPANS {
            let rolls = (SPANS - 1) as f64;
            return Err(MachineError {
                parameter: "idle (number of rolls)",
                value: machine.idle.len() as f64,
                low: rolls,
                high: rolls,
            });
        }
        let roll = |i: usize| machine.idle.get(i);
        let (web, brakes) = (&machine.web, &machine.brakes);
        let coefficients = Coefficients {
            spans: Spans::new(
                core::array::from_fn(|i| roll(i).map_or(machine.last_span_m, |r| r.span_m)),
                web.stiffness_n_m * web.width_m,
                web.retardation_s,
            ),
            idle: core::array::from_fn(|i| roll(i).map(Idle::new)),
            unwind: Unwind::new(machine),
            windup: Windup::new(machine),
            rk4: Rk4::new(h),
            per_step: R::of(1.0 / h),
            brakes: Brakes {
                uw: R::of(brakes.uw_n_m),
                rd: R::of(brakes.rd_n_m / machine.rear_drum.radius_m),
                fd: R::of(brakes.fd_n_m / machine.front_drum.radius_m),
            },
            strength: R::of(web.strength_n_m * web.width_m),
            core_radius: R::of(machine.shipping_roll.core_radius_m),
            full_radius: R::of(machine.parent_roll.full_radius_m),
            expire_radius: R::of(machine.parent_roll.expire_radius_m),
            threaded_strain: R::of(THREADED_STRAIN),
        };
        let zero = R::Sum::at(R::ZERO);
        Ok(Self {
            state: State {
                strain: [zero; SPANS],
                v: [zero; SPANS],
                omega_uw: zero,
                r_uw: R::Sum::at(coefficients.full_radius),
                r_wu: R::Sum::at(coefficients.core_radius),
                travel: zero,
            },
            web: Web::NONE,
            threaded: false,
            delay: Brakes::all(Delay::new(brakes.delay_s, h)),
            closed: Brakes::default(),
            sensors: Sensors::new(machine, h),
            coefficients,
        })
    }

    /// One step of h: what people do, the brakes, the motion, the web's strength, the sensors.
    pub fn step(&mut self, actuators: &Actuators<R>) -> Measurements<R> {
        self.handle(actuators);
        self.closed = Brakes {
            uw: self.delay.uw.step(actuators.brakes.uw),
            rd: self.delay.rd.step(actuators.brakes.rd),
            fd: self.delay.fd.step(actuators.brakes.fd),
        };
        self.advance(actuators);
        self.break_web_if_due();
        self.measure()
    }

    /// Puts the web under the same tension in all spans, in N, the machine as it stands.
    pub fn thread_at(&mut self, tension: R) {
        self.thread_with(self.coefficients.spans.strain_of(tension));
    }

    /// The web parts: all tensions go to zero and stay there until it is threaded again.
    pub fn break_web(&mut self) {
        self.threaded = false;
        self.state.strain = [R::Sum::at(R::ZERO); SPANS];
        self.web = Web::NONE;
    }

    /// The state variables: ground truth, for records and tests.
    pub fn state(&self) -> State<R, SPANS> {
        self.state.map(|sum| sum.value())
    }

    /// Puts the machine into a state; the web stays threaded or not.
    pub fn set_state(&mut self, state: &State<R, SPANS>) {
        self.state = state.map(R::Sum::at);
        if self.threaded {
            self.web = self.coefficients.web(state);
        }
    }

    /// Tensions of the spans, N: ground truth.
    pub fn tension(&self) -> [R; SPANS] {
        self.web.tension
    }

    /// The web is led through the machine and whole.
    pub fn threaded(&self) -> bool {
        self.threaded
    }

    fn handle(&mut self, actuators: &Actuators<R>) {
        let (c, handling) = (&self.coefficients, actuators.handling);
        if handling.new_core {
            self.state.r_wu = R::Sum::at(c.core_radius);
        }
        if handling.new_parent_roll {
            self.state.r_uw = R::Sum::at(c.full_radius);
        }
        if handling.thread_web && !self.threaded {
            self.thread_with(c.threaded_strain);
        }
    }

    fn thread_with(&mut self, strain: R) {
        self.threaded = true;
        self.state.strain = [R::Sum::at(strain); SPANS];
        self.web = self.coefficients.web(&self.state());
    }

    /// Moves everything by h, the friction of the brakes held as the step found it.
    fn advance(&mut self, actuators: &Actuators<R>) {
        let c = &self.coefficients;
        self.state.travel = R::Sum::at(R::ZERO);
        let x = self.state.map(|sum| sum.value());
        let torque = &actuators.torque;
        let mut load = Load {
            uw: torque.uw,
            wu: c.windup.force([torque.rd, torque.fd, torque.rr]),
        };
        let friction = self.friction(&x, &load);
        load.uw -= friction.uw.lambda;
        load.wu -= friction.wu.lambda;

        let k1 = c.rates(&x, &self.web, self.threaded, &load);
        let threaded = self.threaded;
        c.rk4.step(&mut self.state, k1, |x| {
            let web = if threaded { c.web(x) } else { Web::NONE };
            c.rates(x, &web, threaded, &load)
        });

        if friction.uw.sticks {
            self.state.omega_uw = R::Sum::at(R::ZERO);
        }
        if friction.wu.sticks {
            self.state.v[SPANS - 1] = R::Sum::at(R::ZERO);
        }
        if threaded {
            self.web = c.web(&self.state.map(|sum| sum.value()));
        }
    }

    fn friction(&self, x: &State<R, SPANS>, load: &Load<R>) -> BrakeFriction<R> {
        let (c, closed) = (&self.coefficients, &self.closed);
        if !(closed.uw || closed.rd || closed.fd) {
            return BrakeFriction::NONE;
        }
        let of = |closed, brake| if closed { brake } else { R::ZERO };
        let bodies = c.bodies(x, &self.web, self.threaded, load);
        let (inertia, torque) = bodies.uw;
        let (mass, force) = bodies.wu;
        BrakeFriction {
            uw: Friction::of(
                inertia * x.omega_uw,
                torque,
                of(closed.uw, c.brakes.uw),
                c.per_step,
            ),
            wu: Friction::of(
                mass * x.v[SPANS - 1],
                force,
                of(closed.rd, c.brakes.rd) + of(closed.fd, c.brakes.fd),
                c.per_step,
            ),
        }
    }

    fn break_web_if_due(&mut self) {
        let c = &self.coefficients;
        let torn = self.web.tension.iter().any(|t| *t > c.strength);
        let expired = self.state.r_uw.value() <= c.expire_radius;
        if self.threaded && (torn || expired) {
            self.break_web();
        }
    }

    fn measure(&mut self) -> Measurements<R> {
        let x = self.state();
        let sight = Sight {
            omega_uw: x.omega_uw,
            v_rd: x.v[SPANS - 1],
            travel: x.travel,
            r_wu: x.r_wu,
        };
        Measurements {
            brakes: self.closed,
            ..self.sensors.look(&sight, &self.web.tension)
        }
    }
}

/// Friction of the unwind's brake, N·m, and of the drums' brakes at their surface, N.
struct BrakeFriction<R> {
    uw: Friction<R>,
    wu: Friction<R>,
}

impl<R: Real> BrakeFriction<R> {
    const NONE: Self = Self {
        uw: Friction::NONE,
        wu: Friction::NONE,
    };
}

impl<R: Real, const SPANS: usize> Coefficients<R, SPANS> {
    #[inline(always)]
    fn web(&self, x: &State<R, SPANS>) -> Web<R, SPANS> {
        self.spans.web(x.omega_uw * x.r_uw, &x.v, &x.strain)
    }

    #[inline(always)]
    fn bodies(
        &self,
        x: &State<R, SPANS>,
        web: &Web<R, SPANS>,
        threaded: bool,
        load: &Load<R>,
    ) -> Bodies<R> {
        let (v, t) = (x.v[SPANS - 1], web.tension[SPANS - 1]);
        let roll = self.windup.shipping_roll(x.r_wu);
        // without web the roll neither grows nor is pushed by the paper that arrives
        let r_wu_rate = if threaded {
            self.windup.radius_rate(&roll, v)
        } else {
            R::ZERO
        };
        let torque = self
            .unwind
            .torque(load.uw, web.tension[0], x.omega_uw * x.r_uw, x.r_uw);
        Bodies {
            uw: (self.unwind.inertia(x.r_uw), torque),
            wu: (
                self.windup.mass(&roll),
                self.windup.resultant(&roll, load.wu, t, v, r_wu_rate),
            ),
            r_wu_rate,
        }
    }

    #[inline(always)]
    fn rates(
        &self,
        x: &State<R, SPANS>,
        web: &Web<R, SPANS>,
        threaded: bool,
        load: &Load<R>,
    ) -> State<R, SPANS> {
        let bodies = self.bodies(x, web, threaded, load);
        State {
            strain: web.strain_rate,
            v: core::array::from_fn(|i| match &self.idle[i] {
                Some(idle) => idle.acceleration(x.v[i], web.tension[i], web.tension[i + 1]),
                None => bodies.wu.1 / bodies.wu.0,
            }),
            omega_uw: bodies.uw.1 / bodies.uw.0,
            r_uw: if threaded {
                self.unwind.radius_rate(x.omega_uw)
            } else {
                R::ZERO
            },
            r_wu: bodies.r_wu_rate,
            travel: x.v[SPANS - 1],
        }
    }
}
