//! The winder and its web: what the drives act on and the sensors look at.
//!
//! Not here: regulators, logic, sensors' faults, bending and vibration of rolls.
//!
//! The web runs from the unwind `uw` over idle rolls (`gr`, `sr`) to the rear drum `rd`. Running direction is
//! positive for speeds and motor torques; a span pulls the roll before it forward and holds the roll after it
//! back. A span is named after the roll it leaves.

pub mod eccentricity;
pub mod friction;
pub mod modes;
pub mod nip;
pub mod rk4;
pub mod roll;
pub mod sensors;
pub mod span;
pub mod windup;

use crate::exchange::{Actuators, Brakes, BySection, Measurements};
use crate::machine::{Machine, MachineError};
use crate::real::{Real, Sum};
use eccentricity::{Eccentricity, Offsets};
use friction::{Brake, Delay, Friction, Law};
use nip::Nips;
use rk4::{Rk4, State};
use roll::{Idle, Unwind};
use sensors::{Sensors, Sight};
use span::{Spans, Web};
use windup::{FRONT, Holding, Nip, Parts, ROLLS, Speeds, Traction, Windup};

/// Period of the plant task and longest step of its integration, ms.
pub const PLANT_PERIOD_MS: u32 = 4;

/// Strain of a web that has just been led through by hand: 2 mm of loop for each metre.
pub const THREADED_STRAIN: f64 = -0.002;

/// Share of its radius that the core of a machine running backwards may lose before the web is off.
const BARE: f64 = 0.99;

/// The winder with its web, advanced by fixed steps.
#[derive(Clone, Debug)]
pub struct Winder<R: Real, const SPANS: usize> {
    coefficients: Coefficients<R, SPANS>,
    substeps: u32,
    state: State<R::Sum, SPANS>,
    /// Strain rates and tensions that belong to the state.
    web: Web<R, SPANS>,
    /// The web is led through the machine and whole.
    threaded: bool,
    delay: Brakes<Delay>,
    closed: Brakes<bool>,
    nips: [Nip<R>; ROLLS],
    winding: Winding<R>,
    eccentricity: Eccentricity<R, SPANS>,
    sensors: Sensors<R>,
}

/// How the shipping roll is being wound: ground truth. Known only where slip or layers that compress are computed.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Winding<R> {
    /// Forces of the nips on the shipping roll, N: rear drum, front drum, rider roll.
    pub nip_force: [R; ROLLS],
    /// Loads of the nips per width, N/m.
    pub nip_load: [R; ROLLS],
    /// Nips that slide.
    pub slides: [bool; ROLLS],
    /// Wound-on tension per width, N/m.
    pub wound_on_tension: R,
    /// The wound-on tension has been above the web's strength since the core was put in: the roll has burst.
    pub burst: bool,
}

#[derive(Clone, Debug)]
struct Coefficients<R, const SPANS: usize> {
    spans: Spans<R, SPANS>,
    /// The roll at the end of each span but the last, where the windup is.
    idle: [Option<Idle<R>>; SPANS],
    unwind: Unwind<R>,
    windup: Windup<R>,
    nips: Nips<R>,
    /// The rolls of the windup may slip.
    slips: bool,
    rk4: Rk4<R>,
    /// Brakes as they are when closed: a torque on the unwind, forces at the drums' surfaces.
    brakes: Brakes<Brake<R>>,
    /// Half width of the stiction band at the surface, m/s, where the paper's brake model is wanted.
    karnopp: Option<R>,
    /// Tension at which the web breaks, N, and per width, N/m.
    strength: R,
    strength_per_width: R,
    core_radius: R,
    /// A shipping roll as thin as this has lost its web: the machine has run backwards.
    bare_radius: R,
    full_radius: R,
    expire_radius: R,
    threaded_strain: R,
}

/// What drives the winder, constant over a step.
#[derive(Clone, Copy)]
struct Load<R> {
    /// Torque on the parent roll less its brake's, N·m.
    uw: R,
    /// On the windup.
    windup: windup::Load<R>,
    /// Speed of the layer that is wound, of the web's: z_eff/z; zero without web.
    layer: R,
    threaded: bool,
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
        let substeps = modes::substeps(machine, h);
        let step = h / f64::from(substeps);
        let coefficients = Coefficients::new(machine, step);
        let zero = R::Sum::at(R::ZERO);
        Ok(Self {
            substeps,
            state: State {
                strain: [zero; SPANS],
                v: [zero; SPANS],
                windup: [zero; 3],
                omega_uw: zero,
                r_uw: R::Sum::at(coefficients.full_radius),
                r_wu: R::Sum::at(coefficients.core_radius),
                travel: zero,
            },
            web: Web::NONE,
            threaded: false,
            delay: Brakes::all(Delay::new(machine.brakes.delay_s, h)),
            closed: Brakes::default(),
            nips: [Nip::Sticks; ROLLS],
            winding: Winding {
                wound_on_tension: R::of(machine.wound_on_tension.reference_n_m),
                ..Winding::default()
            },
            eccentricity: Eccentricity::new(machine, step),
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
        self.state.travel = R::Sum::at(R::ZERO);
        for _ in 0..self.substeps {
            self.advance(actuators);
            self.break_web_if_due();
        }
        self.measure()
    }

    /// Steps of integration in one step of the winder: more than one where light rolls or short spans make a
    /// mode of the web too fast for it.
    pub fn substeps(&self) -> u32 {
        self.substeps
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

    /// Puts the machine into a state; the web stays threaded or not. Where the windup cannot slip, all of it
    /// takes the speed of the rear drum.
    pub fn set_state(&mut self, state: &State<R, SPANS>) {
        self.state = state.map(R::Sum::at);
        if self.coefficients.slips {
            let v = state.speeds();
            self.nips = v.rolls.map(|roll| Nip::between(roll, v.wu));
        } else {
            self.state.windup = [self.state.v[SPANS - 1]; 3];
        }
        if self.threaded {
            self.web = self.coefficients.web(state, &Offsets::NONE);
        }
    }

    /// Tensions of the spans, N: ground truth.
    pub fn tension(&self) -> [R; SPANS] {
        self.web.tension
    }

    /// How the shipping roll is being wound: ground truth. Known only where slip or layers that compress are computed.
    pub fn winding(&self) -> &Winding<R> {
        &self.winding
    }

    /// The web is led through the machine and whole.
    pub fn threaded(&self) -> bool {
        self.threaded
    }

    fn handle(&mut self, actuators: &Actuators<R>) {
        let (c, handling) = (&self.coefficients, actuators.handling);
        if handling.new_core {
            self.state.r_wu = R::Sum::at(c.core_radius);
            self.winding.burst = false;
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
        self.web = self.coefficients.web(&self.state(), &Offsets::NONE);
    }

    /// Moves everything by a step of integration, the friction of brakes and nips as it found it.
    fn advance(&mut self, actuators: &Actuators<R>) {
        let x = self.state.map(|sum| sum.value());
        let offsets = self.eccentricity.turn(&x);
        if self.threaded && self.eccentricity.present() {
            self.web = self.coefficients.web(&x, &offsets);
        }
        let traction = self.load_nips(x.r_wu);
        let c = &self.coefficients;
        let layer = if self.threaded {
            c.nips.thickness(self.winding.wound_on_tension)
        } else {
            R::ZERO
        };
        let unwind = self.hold_unwind(actuators.torque.uw, &x);
        let mut windup = self.hold_windup(&actuators.torque, &x, layer, traction.as_ref());
        let load = Load {
            uw: actuators.torque.uw - unwind.lambda,
            windup: windup.parts.load(),
            layer,
            threaded: self.threaded,
        };

        let k1 = c.rates(&x, &self.web, &load);
        c.rk4.step(&mut self.state, k1, |x| {
            let web = if load.threaded {
                c.web(x, &offsets)
            } else {
                Web::NONE
            };
            c.rates(x, &web, &load)
        });

        if unwind.sticks {
            self.state.omega_uw = R::Sum::at(R::ZERO);
        }
        if !windup.goes_on() {
            self.settle_windup(&x, &mut windup);
        }
        self.stop_wreck(&x);
        if self.threaded {
            self.web = self.coefficients.web(&self.state(), &offsets);
        }
        if self.coefficients.winds() {
            self.look_at_winding(&windup);
        }
    }

    /// What the nips can carry in this step, where they may let go.
    fn load_nips(&mut self, r_wu: R) -> Option<Traction<R>> {
        let c = &self.coefficients;
        if c.winds() {
            self.winding.nip_load = c.nips.loads(r_wu);
        }
        if !c.slips {
            return None;
        }
        Some(Traction {
            sticking: c.nips.static_traction(&self.winding.nip_load),
            sliding: c.nips.traction(&self.winding.nip_load),
        })
    }

    /// How the brake of the unwind holds over the step that starts at `x`.
    fn hold_unwind(&self, torque: R, x: &State<R, SPANS>) -> Friction<R> {
        let c = &self.coefficients;
        if !self.closed.uw {
            return Friction::NONE;
        }
        let v = x.omega_uw * x.r_uw;
        let free = c.unwind.torque(torque, self.web.tension[0], v, x.r_uw);
        let brake = c.brake_uw(x.r_uw);
        brake.hold(c.unwind.inertia(x.r_uw), x.omega_uw, free)
    }

    /// How nips and brakes of the windup hold over the step that starts at `x`.
    fn hold_windup(
        &self,
        torque: &BySection<R>,
        x: &State<R, SPANS>,
        layer: R,
        traction: Option<&Traction<R>>,
    ) -> Holding<R> {
        let c = &self.coefficients;
        let drive = c.windup.drive(torque);
        if !(c.winds() || self.closed.rd || self.closed.fd) {
            return Holding::free(drive);
        }
        let parts = Parts {
            drive,
            nips: self.nips,
        };
        let brakes = [
            c.brakes.rd.when(self.closed.rd),
            c.brakes.fd.when(self.closed.fd),
            Brake::NONE,
        ];
        let roll = c.windup.shipping_roll(x.r_wu, x.v[SPANS - 1] * layer);
        let t_sr = self.web.tension[SPANS - 1];
        c.windup
            .hold(&x.speeds(), &roll, t_sr, parts, &brakes, traction)
    }

    fn settle_windup(&mut self, x: &State<R, SPANS>, holding: &mut Holding<R>) {
        let c = &self.coefficients;
        let roll = c.windup.shipping_roll(x.r_wu, R::ZERO);
        let moved = self.state().speeds();
        let mut settled = moved;
        c.windup.settle(&mut settled, &roll, holding);
        self.nips = holding.parts.nips;
        // only what has been changed loses what its sum carries
        let put = |sum: &mut R::Sum, from: R, to: R| {
            if from != to {
                *sum = R::Sum::at(to);
            }
        };
        let [rd, fd, rr] = settled.rolls;
        put(&mut self.state.v[SPANS - 1], moved.rolls[0], rd);
        put(&mut self.state.windup[0], moved.rolls[1], fd);
        put(&mut self.state.windup[1], moved.rolls[2], rr);
        put(&mut self.state.windup[2], moved.wu, settled.wu);
    }

    /// A step so violent that its numbers overflow leaves a wreck: the web torn, the machine at standstill, the
    /// rolls as they were. So the state stays finite whatever the motors do.
    fn stop_wreck(&mut self, before: &State<R, SPANS>) {
        // one number that is not finite makes the sum so
        let x = self.state();
        let sum = |values: &[R]| values.iter().fold(R::ZERO, |sum, x| sum + *x);
        let radii = x.omega_uw + x.r_uw + x.r_wu + x.travel;
        if (sum(&x.strain) + sum(&x.v) + sum(&x.windup) + radii).is_finite() {
            return;
        }
        self.state = before.map(|_| R::Sum::at(R::ZERO));
        self.state.r_uw = R::Sum::at(before.r_uw);
        self.state.r_wu = R::Sum::at(before.r_wu);
        self.nips = [Nip::Sticks; ROLLS];
        self.break_web();
    }

    fn look_at_winding(&mut self, holding: &Holding<R>) {
        let c = &self.coefficients;
        let (t_sr, front) = (self.web.tension[SPANS - 1], holding.nip_force[FRONT]);
        let tight = c.nips.wound_on_tension(&self.winding.nip_load, t_sr, front);
        self.winding = Winding {
            nip_force: holding.nip_force,
            nip_load: self.winding.nip_load,
            slides: self.nips.map(|nip| nip != Nip::Sticks),
            wound_on_tension: tight,
            burst: self.winding.burst || tight > c.strength_per_width,
        };
    }

    /// The web breaks when it is torn, when the parent roll has run out, and when it has been pulled off the core.
    fn break_web_if_due(&mut self) {
        let c = &self.coefficients;
        let torn = |t: &R| *t > c.strength || !t.is_finite();
        let torn = self.web.tension.iter().any(torn);
        let expired = self.state.r_uw.value() <= c.expire_radius;
        let pulled_off = self.state.r_wu.value() < c.bare_radius;
        if pulled_off {
            self.state.r_wu = R::Sum::at(c.core_radius);
        }
        if self.threaded && (torn || expired || pulled_off) {
            self.break_web();
        }
    }

    fn measure(&mut self) -> Measurements<R> {
        let x = self.state();
        let sight = Sight {
            omega_uw: x.omega_uw,
            v: x.speeds().rolls,
            travel: x.travel,
            r_wu: x.r_wu,
        };
        Measurements {
            brakes: self.closed,
            ..self.sensors.look(&sight, &self.web.tension)
        }
    }
}

impl<T: Copy, const SPANS: usize> State<T, SPANS> {
    /// The speeds of the windup.
    pub fn speeds(&self) -> Speeds<T> {
        let [fd, rr, wu] = self.windup;
        Speeds {
            rolls: [self.v[SPANS - 1], fd, rr],
            wu,
        }
    }
}

impl<R: Real, const SPANS: usize> Coefficients<R, SPANS> {
    fn new(machine: &Machine, h: f64) -> Self {
        let roll = |i: usize| machine.idle.get(i);
        let (web, brakes) = (&machine.web, &machine.brakes);
        let law = Law::SetValued {
            per_step: R::of(1.0 / h),
        };
        let brake = |force: f64| Brake::closed(R::of(force), R::of(brakes.static_ratio), law);
        let mut coefficients = Self {
            spans: Spans::new(
                core::array::from_fn(|i| roll(i).map_or(machine.last_span_m, |r| r.span_m)),
                web.stiffness_n_m * web.width_m,
                web.retardation_s,
            ),
            idle: core::array::from_fn(|i| roll(i).map(Idle::new)),
            unwind: Unwind::new(machine),
            windup: Windup::new(machine, h),
            nips: Nips::new(machine),
            slips: machine.nips.slip,
            rk4: Rk4::new(h),
            brakes: Brakes {
                uw: brake(brakes.uw_n_m),
                rd: brake(brakes.rd_n_m / machine.rear_drum.radius_m),
                fd: brake(brakes.fd_n_m / machine.front_drum.radius_m),
            },
            karnopp: (brakes.karnopp_m_s > 0.0).then(|| R::of(brakes.karnopp_m_s)),
            strength: R::of(web.strength_n_m * web.width_m),
            strength_per_width: R::of(web.strength_n_m),
            core_radius: R::of(machine.shipping_roll.core_radius_m),
            bare_radius: R::of(BARE * machine.shipping_roll.core_radius_m),
            full_radius: R::of(machine.parent_roll.full_radius_m),
            expire_radius: R::of(machine.parent_roll.expire_radius_m),
            threaded_strain: R::of(THREADED_STRAIN),
        };
        if let Some(band) = coefficients.karnopp {
            coefficients.brakes.rd = coefficients.brakes.rd.following(Law::Karnopp { band });
            coefficients.brakes.fd = coefficients.brakes.fd.following(Law::Karnopp { band });
        }
        coefficients
    }

    /// Nip loads and wound-on tension are wanted.
    fn winds(&self) -> bool {
        self.slips || self.nips.compress()
    }

    /// The unwind's brake at a radius: the stiction band is one of the surface.
    fn brake_uw(&self, r: R) -> Brake<R> {
        match self.karnopp {
            Some(band) => self.brakes.uw.following(Law::Karnopp { band: band / r }),
            None => self.brakes.uw,
        }
    }

    #[inline(always)]
    fn web(&self, x: &State<R, SPANS>, offsets: &Offsets<R, SPANS>) -> Web<R, SPANS> {
        let v_uw = x.omega_uw * x.r_uw;
        self.spans
            .web(v_uw + offsets.uw, &offsets.added_to(&x.v), &x.strain)
    }

    #[inline(always)]
    fn rates(&self, x: &State<R, SPANS>, web: &Web<R, SPANS>, load: &Load<R>) -> State<R, SPANS> {
        let (v_rd, t_sr) = (x.v[SPANS - 1], web.tension[SPANS - 1]);
        let roll = self.windup.shipping_roll(x.r_wu, v_rd * load.layer);
        let windup = self.windup.rates(&x.speeds(), &roll, t_sr, &load.windup);
        let v_uw = x.omega_uw * x.r_uw;
        let torque = self.unwind.torque(load.uw, web.tension[0], v_uw, x.r_uw);
        let [rd, fd, rr] = windup.rolls;
        State {
            strain: web.strain_rate,
            v: core::array::from_fn(|i| match &self.idle[i] {
                Some(idle) => idle.acceleration(x.v[i], web.tension[i], web.tension[i + 1]),
                None => rd,
            }),
            windup: [fd, rr, windup.wu],
            omega_uw: torque / self.unwind.inertia(x.r_uw),
            r_uw: if load.threaded {
                self.unwind.radius_rate(x.omega_uw)
            } else {
                R::ZERO
            },
            r_wu: roll.radius_rate,
            travel: v_rd,
        }
    }
}
