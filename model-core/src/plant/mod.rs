//! The winder and its web: what the drives act on and the sensors look at.
//!
//! Not here: regulators, logic, sensors' faults, bending and vibration of rolls.
//!
//! The web runs from the unwind `uw` over idle rolls (`gr`, `sr`) to the rear drum `rd`. Running direction is
//! positive for speeds and motor torques; a span pulls the roll before it forward and holds the roll after it
//! back. A span is named after the roll it leaves.

pub mod contact;
pub mod eccentricity;
pub mod friction;
pub mod glide;
pub mod modes;
pub mod motion;
pub mod nip;
pub mod rk4;
pub mod roll;
pub mod sensors;
pub mod span;
pub mod units;
pub mod windup;

use crate::exchange::{Actuators, Brakes, BySection, MachineFaults, Measurements, SensorFaults};
use crate::machine::{Machine, MachineError};
use crate::real::{Accumulator, Arithmetic, Real, Ring, Scalar};
use contact::{Contact, Holding, ParentRoll, Traction};
use eccentricity::{Eccentricity, Offsets};
use friction::{Brake, Delay, Friction, Law};
use motion::{Load, Motion};
use nip::Nips;
use rk4::State;
use sensors::{Sensors, Sight};
use span::Web;
use units::{Machines, One, Units};
use windup::{FRONT, Nip, Parts, ROLLS, Speeds, Whole};

/// Period of the plant task and longest step of its integration, ms.
pub const PLANT_PERIOD_MS: u32 = 4;

/// Strain of a web that has just been led through by hand: 2 mm of loop for each metre.
pub const THREADED_STRAIN: f64 = -0.002;

/// Share of its radius that the core of a machine running backwards may lose before the web is off.
const BARE: f64 = 0.99;

/// The winder with its web, advanced by fixed steps.
#[derive(Clone, Debug)]
pub struct Winder<R: Scalar, const SPANS: usize> {
    motion: Motion<R, SPANS>,
    holders: Holders<R::Si>,
    limits: Limits<R>,
    scale: Scale<R>,
    substeps: u32,
    /// Step of integration, s.
    step: R::Si,
    state: State<R::Sum, SPANS, 0>,
    /// Speeds of front drum, rider roll and shipping roll, where the windup may slip.
    apart: [R::Sum; ROLLS],
    /// Way of the rear drum's surface in the last step, m.
    travel: R::Si,
    /// Strain rates and tensions that belong to the state.
    web: Web<R, SPANS>,
    /// The web is led through the machine and whole.
    threaded: bool,
    /// The span in which it has parted last, counted from the unwind; 0 while it is whole.
    broken_span: u8,
    /// What a break in each span leaves before the rear drum, m; nothing where that is not wound up.
    tails: [R::Si; SPANS],
    /// What is left of it.
    tail: R::Si,
    delay: Brakes<Delay>,
    closed: Brakes<bool>,
    nips: [Nip<R::Si>; ROLLS],
    winding: Winding<R::Si>,
    eccentricity: Eccentricity<R::Si, SPANS>,
    sensors: Sensors<R::Si>,
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

/// What holds the rolls: brakes and nips.
#[derive(Clone, Debug)]
struct Holders<R> {
    parent: ParentRoll<R>,
    contact: Contact<R>,
    nips: Nips<R>,
    /// The rolls of the windup may slip.
    slips: bool,
    /// Brakes as they are when closed: a torque on the unwind, forces at the drums' surfaces.
    brakes: Brakes<Brake<R>>,
    /// Half width of the stiction band at the surface, m/s, where the paper's brake model is wanted.
    karnopp: Option<R>,
    /// Wound-on tension at which the shipping roll bursts, N/m.
    strength: R,
}

/// Where the web begins and ends.
#[derive(Clone, Copy, Debug)]
pub struct Limits<A> {
    /// Tension at which the web breaks.
    pub strength: A,
    core_radius: A,
    /// A shipping roll thinner than this has lost its web: the machine has run backwards.
    pub bare_radius: A,
    full_radius: A,
    /// A parent roll as thin as this has run out of paper.
    pub expire_radius: A,
    threaded_strain: A,
}

/// The units in which the state is counted.
#[derive(Clone, Copy, Debug)]
struct Scale<R: Scalar> {
    speed: R::Unit,
    strain: R::Unit,
    force: R::Unit,
    torque: R::Unit,
    torque_rolls: R::Unit,
    omega: R::Unit,
    omega_rolls: R::Unit,
    r_uw: R::Unit,
    r_wu: R::Unit,
    one: R::Unit,
}

impl<R: Scalar, const SPANS: usize> Winder<R, SPANS> {
    /// The winder of a machine with `SPANS` spans, in steps of `h` seconds: at standstill, web not threaded,
    /// full parent roll, bare core, brakes off.
    ///
    /// Fails with the first parameter that is outside its limits, when the machine has another number of spans, or
    /// when its coefficients are beyond the range of the numbers.
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
        let units = Units::of::<R>(machine);
        units.fit::<R>(machine, step)?;
        let limits = Limits::new(&One(machine, &units));
        let zero = R::Sum::at(R::ZERO);
        Ok(Self {
            motion: Motion::new(&One(machine, &units), step),
            holders: Holders::new(machine, step),
            scale: Scale::new(&units),
            substeps,
            step: R::Si::of(step),
            state: State {
                strain: [zero; SPANS],
                v: [zero; SPANS],
                windup: [],
                omega_uw: zero,
                r_uw: R::Sum::at(limits.full_radius),
                r_wu: R::Sum::at(limits.core_radius),
            },
            limits,
            apart: [zero; ROLLS],
            travel: R::Si::ZERO,
            web: Web::none(),
            threaded: false,
            broken_span: 0,
            tails: core::array::from_fn(|i| {
                R::Si::of(if machine.web.tail {
                    machine.tail_m(i)
                } else {
                    0.0
                })
            }),
            tail: R::Si::ZERO,
            delay: Brakes::all(Delay::new(machine.brakes.delay_s, h)),
            closed: Brakes::default(),
            nips: [Nip::Sticks; ROLLS],
            winding: Winding {
                wound_on_tension: R::Si::of(machine.wound_on_tension.reference_n_m),
                ..Winding::default()
            },
            eccentricity: Eccentricity::new(machine, step),
            sensors: Sensors::new(machine, h),
        })
    }

    /// One step of h: what people do, the brakes, the motion, the web's strength, the sensors.
    pub fn step(&mut self, actuators: &Actuators<R::Si>) -> Measurements<R::Si> {
        self.handle(actuators);
        let (brakes, stuck) = (actuators.brakes, actuators.faults.machine.brakes);
        self.closed = Brakes {
            uw: stuck.uw.acts_on(self.delay.uw.step(brakes.uw)),
            rd: stuck.rd.acts_on(self.delay.rd.step(brakes.rd)),
            fd: stuck.fd.acts_on(self.delay.fd.step(brakes.fd)),
        };
        self.travel = R::Si::ZERO;
        let trails = self.tail > R::Si::ZERO;
        for _ in 0..self.substeps {
            self.advance(actuators);
            self.break_web_if_due();
        }
        if trails {
            self.tail -= self.travel;
        }
        self.measure(&actuators.faults.sensors)
    }

    /// Steps of integration in one step of the winder: more than one where light rolls or short spans make a
    /// mode of the web too fast for it.
    pub fn substeps(&self) -> u32 {
        self.substeps
    }

    /// Puts the web under the same tension in all spans, in N, the machine as it stands.
    pub fn thread_at(&mut self, tension: R::Si) {
        let tension = R::of_si(tension, self.scale.force);
        self.thread_with(self.motion.spans.strain_of(tension));
    }

    /// The web parts: all tensions go to zero and stay there until it is threaded again.
    pub fn break_web(&mut self) {
        self.threaded = false;
        self.tail = R::Si::ZERO;
        self.state.strain = [R::Sum::at(R::ZERO); SPANS];
        self.web = Web::none();
    }

    /// The same in the span of an index.
    fn break_web_in(&mut self, span: usize) {
        self.break_web();
        let span = span.min(SPANS - 1);
        self.tail = self.tails[span];
        self.broken_span = (span + 1) as u8;
    }

    /// The span in which the web has parted, counted from the unwind; 0 while it is whole, or taken out.
    pub fn broken_span(&self) -> u8 {
        self.broken_span
    }

    /// The state variables in SI: ground truth, for records and tests.
    pub fn state(&self) -> State<R::Si, SPANS> {
        let (x, scale) = (self.values(), &self.scale);
        State {
            strain: x.strain.map(|strain| strain.to_si(scale.strain)),
            v: x.v.map(|v| v.to_si(scale.speed)),
            windup: x.windup.map(|v| v.to_si(scale.speed)),
            omega_uw: x.omega_uw.to_si(scale.omega),
            r_uw: x.r_uw.to_si(scale.r_uw),
            r_wu: x.r_wu.to_si(scale.r_wu),
        }
    }

    /// Takes the bits of every state variable, in a fixed order: equal trajectories have equal ones. Where the windup
    /// cannot slip, its speed is one of them.
    pub fn fingerprint(&self, mut take: impl FnMut(u32)) {
        let mut take = |sum: R::Sum| take(sum.value().fingerprint());
        self.state.map(&mut take);
        if self.holders.slips {
            self.apart.into_iter().for_each(take);
        }
    }

    /// Puts the machine into a state, in SI; the web stays threaded or not. Where the windup cannot slip, all of it
    /// takes the speed of the rear drum.
    pub fn set_state(&mut self, state: &State<R::Si, SPANS>) {
        let scale = self.scale;
        let at = |x, unit| R::Sum::at(R::of_si(x, unit));
        self.state = State {
            strain: state.strain.map(|strain| at(strain, scale.strain)),
            v: state.v.map(|v| at(v, scale.speed)),
            windup: [],
            omega_uw: at(state.omega_uw, scale.omega),
            r_uw: at(state.r_uw, scale.r_uw),
            r_wu: at(state.r_wu, scale.r_wu),
        };
        if self.holders.slips {
            let v = state.speeds();
            self.apart = state.windup.map(|v| at(v, scale.speed));
            self.nips = v.rolls.map(|roll| Nip::between(roll, v.wu));
        }
        if self.threaded {
            self.look_at_web(None);
        }
    }

    /// Way of the rear drum's surface in the last step, m: ground truth.
    pub fn travel(&self) -> R::Si {
        self.travel
    }

    /// Tensions of the spans, N: ground truth.
    pub fn tension(&self) -> [R::Si; SPANS] {
        self.web.tension.map(|t| t.to_si(self.scale.force))
    }

    /// How the shipping roll is being wound: ground truth. Known only where slip or layers that compress are computed.
    pub fn winding(&self) -> &Winding<R::Si> {
        &self.winding
    }

    /// It is computed how the shipping roll is being wound.
    pub fn winds(&self) -> bool {
        self.holders.winds()
    }

    /// The web is led through the machine and whole.
    pub fn threaded(&self) -> bool {
        self.threaded
    }

    fn handle(&mut self, actuators: &Actuators<R::Si>) {
        let (limits, handling) = (&self.limits, actuators.handling);
        if handling.new_core {
            self.state.r_wu = R::Sum::at(limits.core_radius);
            self.winding.burst = false;
        }
        if handling.new_parent_roll {
            let diameter = actuators.faults.machine.next_parent_roll;
            let radius = R::of_si(diameter * R::Si::of(0.5), self.scale.r_uw);
            let fits = radius > limits.expire_radius && radius < limits.full_radius;
            let radius = if fits { radius } else { limits.full_radius };
            self.state.r_uw = R::Sum::at(radius);
        }
        let strain = limits.threaded_strain;
        if handling.remove_web {
            self.break_web();
            self.broken_span = 0;
        }
        if handling.thread_web && !self.threaded {
            // whoever leads the web over idle rolls stops them
            self.state.v[..SPANS - 1].fill(R::Sum::at(R::ZERO));
            self.thread_with(strain);
        }
        // the rider roll has been lifted, or is loaded as the machine's table does not say
        if self.holders.nips.press(&actuators.rider) {
            self.let_slip();
        }
        self.suffer(&actuators.faults.machine);
    }

    /// The windup may slip from now on; a nip that sticks computes what a whole windup does.
    fn let_slip(&mut self) {
        if !self.holders.slips {
            self.holders.slips = true;
            self.apart = [self.state.v[SPANS - 1]; ROLLS];
        }
    }

    /// The faults that a test puts into the machine.
    fn suffer(&mut self, faults: &MachineFaults<R::Si>) {
        if faults.parent_roll_expired {
            self.state.r_uw = R::Sum::at(self.limits.expire_radius);
        }
        if let Some(span) = faults.web_break.checked_sub(1)
            && self.threaded
        {
            self.break_web_in(span.into());
        }
        if self.holders.nips.wear(faults.drum_wear) {
            self.let_slip();
        }
        self.eccentricity.add_to_parent_roll(faults.eccentricity);
    }

    fn thread_with(&mut self, strain: R) {
        self.threaded = true;
        self.tail = R::Si::ZERO;
        self.broken_span = 0;
        self.state.strain = [R::Sum::at(strain); SPANS];
        self.look_at_web(None);
    }

    fn look_at_web(&mut self, offsets: Option<&Offsets<R, SPANS>>) {
        let x = self.state.map(|sum| sum.value());
        self.web = self.motion.web(&x, offsets);
    }

    /// The state variables, all speeds of the windup among them.
    fn values(&self) -> State<R, SPANS> {
        let x = self.state.map(|sum| sum.value());
        x.with_apart(if self.holders.slips {
            self.apart.map(|sum| sum.value())
        } else {
            [x.v[SPANS - 1]; ROLLS]
        })
    }

    /// Moves everything by a step of integration, the friction of brakes and nips as it found it.
    fn advance(&mut self, actuators: &Actuators<R::Si>) {
        let radii = [self.state.r_uw, self.state.r_wu];
        let eccentric = self.eccentricity.present();
        let offsets = eccentric.then(|| self.turn_eccentric_rolls());
        if self.threaded && offsets.is_some() {
            self.look_at_web(offsets.as_ref());
        }
        let layer = if !self.threaded {
            // the tail of a broken web, as it comes
            if self.tail > R::Si::ZERO {
                R::ONE
            } else {
                R::ZERO
            }
        } else if self.holders.nips.compress() {
            let thickness = self.holders.nips.thickness(self.winding.wound_on_tension);
            R::of_si(thickness, self.scale.one)
        } else {
            R::ONE
        };
        let unwind = if self.closed.uw {
            self.hold_unwind(actuators.torque.uw)
        } else {
            Friction::NONE
        };
        let torque = actuators.torque.uw - unwind.lambda;
        let load = Load {
            uw: R::of_si(torque, self.scale.torque),
            windup: (),
            layer,
            threaded: self.threaded,
            offsets: offsets.as_ref(),
        };
        if self.holders.winds() {
            self.turn_wound_windup(&actuators.torque, &load);
        } else {
            let drums = if self.closed.rd || self.closed.fd {
                self.hold_drums(&actuators.torque, layer)
            } else {
                Friction::NONE
            };
            self.turn_windup(self.whole(&actuators.torque, drums.lambda), &load);
            if drums.sticks {
                self.state.v[SPANS - 1] = R::Sum::at(R::ZERO);
            }
        }
        if unwind.sticks {
            self.state.omega_uw = R::Sum::at(R::ZERO);
        }
        self.stop_wreck(radii);
        if self.threaded {
            self.look_at_web(offsets.as_ref());
        }
    }

    /// The deviations of eccentric rolls in the step that begins.
    #[inline(never)]
    fn turn_eccentric_rolls(&mut self) -> Offsets<R, SPANS> {
        let x = self.state();
        let offsets = self.eccentricity.turn(&x);
        offsets.map(|v| R::of_si(v, self.scale.speed))
    }

    /// Moves everything, the windup as one body.
    #[inline(always)]
    fn turn_windup(&mut self, whole: Whole<R>, load: &Load<R, (), SPANS>) {
        let load = load.on(whole);
        let v_rd = self.motion.advance(&mut self.state, &self.web, &load);
        self.go(v_rd);
    }

    /// The way at a mean speed over a step of integration.
    fn go(&mut self, v_rd: R) {
        self.travel += v_rd.to_si(self.scale.speed) * self.step;
    }

    /// What drives the windup as one body: its motors less its brakes' friction, N.
    fn whole(&self, torque: &BySection<R::Si>, friction: R::Si) -> Whole<R> {
        let torque = [torque.rd, torque.fd, torque.rr];
        let torque = torque.map(|torque| R::of_si(torque, self.scale.torque_rolls));
        let friction = R::of_si(friction, self.scale.force);
        Whole(self.motion.windup.pull(torque) - friction)
    }

    /// Moves everything, the windup with its nips and brakes. Not inlined: the step without nips is shorter so.
    #[inline(never)]
    fn turn_wound_windup(&mut self, torque: &BySection<R::Si>, load: &Load<R, (), SPANS>) {
        let x = self.state();
        let traction = self.load_nips(x.r_wu);
        let layer = load.layer.to_si(self.scale.one);
        let mut holding = self.hold_windup(torque, &x, layer, traction.as_ref());
        let parts = &holding.parts;
        if parts.nips.iter().all(|nip| *nip == Nip::Sticks) {
            let [rd, fd, rr] = parts.drive;
            self.turn_windup(Whole(R::of_si(rd + fd + rr, self.scale.force)), load);
            self.apart = [self.state.v[SPANS - 1]; ROLLS];
        } else {
            let parts = parts.map(|force| R::of_si(force, self.scale.force));
            let mut sums = self.state.with_apart(self.apart);
            let v_rd = self.motion.advance(&mut sums, &self.web, &load.on(parts));
            self.go(v_rd);
            (self.state, self.apart) = (sums.with_apart([]), sums.windup);
        }
        if !holding.goes_on() {
            self.settle_windup(x.r_wu, &mut holding);
        }
        if self.holders.winds() {
            self.look_at_winding(&holding);
        }
    }

    /// What the nips can carry in this step, where they may let go.
    fn load_nips(&mut self, r_wu: R::Si) -> Option<Traction<R::Si>> {
        let holders = &self.holders;
        if holders.winds() {
            self.winding.nip_load = holders.nips.loads(r_wu);
        }
        if !holders.slips {
            return None;
        }
        Some(Traction {
            sticking: holders.nips.static_traction(&self.winding.nip_load),
            sliding: holders.nips.traction(&self.winding.nip_load),
        })
    }

    /// How the closed brake of the unwind holds over the step that begins.
    #[inline(never)]
    fn hold_unwind(&self, torque: R::Si) -> Friction<R::Si> {
        let scale = &self.scale;
        let t_uw = self.web.tension[0].to_si(scale.force);
        let omega = self.state.omega_uw.value().to_si(scale.omega);
        let r = self.state.r_uw.value().to_si(scale.r_uw);
        let brake = self.holders.brake_uw(r);
        self.holders.parent.hold(&brake, torque, t_uw, omega, r)
    }

    /// How the closed brakes of the drums hold the windup over the step that begins, where it is one body.
    #[inline(never)]
    fn hold_drums(&self, torque: &BySection<R::Si>, layer: R) -> Friction<R::Si> {
        let scale = &self.scale;
        let Holders {
            contact, brakes, ..
        } = &self.holders;
        let v = self.state.v[SPANS - 1].value().to_si(scale.speed);
        let r_wu = self.state.r_wu.value().to_si(scale.r_wu);
        let roll = contact.shipping_roll(r_wu, v * layer.to_si(scale.one));
        let t_sr = self.web.tension[SPANS - 1].to_si(scale.force);
        let rd = brakes.rd.when(self.closed.rd);
        let brake = rd.with(&brakes.fd.when(self.closed.fd));
        contact.hold_whole(v, &roll, t_sr, &contact.drive(torque), &brake)
    }

    /// How nips and brakes of the windup hold over the step that starts at `x`.
    fn hold_windup(
        &self,
        torque: &BySection<R::Si>,
        x: &State<R::Si, SPANS>,
        layer: R::Si,
        traction: Option<&Traction<R::Si>>,
    ) -> Holding<R::Si> {
        let Holders {
            contact, brakes, ..
        } = &self.holders;
        let parts = Parts {
            drive: contact.drive(torque),
            nips: self.nips,
        };
        let brakes = [
            brakes.rd.when(self.closed.rd),
            brakes.fd.when(self.closed.fd),
            Brake::NONE,
        ];
        let roll = contact.shipping_roll(x.r_wu, x.v[SPANS - 1] * layer);
        let t_sr = self.web.tension[SPANS - 1].to_si(self.scale.force);
        contact.hold(&x.speeds(), &roll, t_sr, parts, &brakes, traction)
    }

    fn settle_windup(&mut self, r_wu: R::Si, holding: &mut Holding<R::Si>) {
        let contact = &self.holders.contact;
        let roll = contact.shipping_roll(r_wu, R::Si::ZERO);
        let moved = self.state().speeds();
        let mut settled = moved;
        contact.settle(&mut settled, &roll, holding);
        self.nips = holding.parts.nips;
        // only what has been changed loses what its sum carries
        let speed = self.scale.speed;
        let put = |sum: &mut R::Sum, from: R::Si, to: R::Si| {
            if from != to {
                *sum = R::Sum::at(R::of_si(to, speed));
            }
        };
        let [rd, fd, rr] = settled.rolls;
        put(&mut self.state.v[SPANS - 1], moved.rolls[0], rd);
        put(&mut self.apart[0], moved.rolls[1], fd);
        put(&mut self.apart[1], moved.rolls[2], rr);
        put(&mut self.apart[2], moved.wu, settled.wu);
    }

    /// A step so violent that its numbers overflow leaves a wreck: the web torn, the machine at standstill, the
    /// rolls as they were. So the state stays finite whatever the motors do.
    fn stop_wreck(&mut self, [r_uw, r_wu]: [R::Sum; 2]) {
        let whole = R::sound(self.state.map(|sum| sum.value()).iter());
        if whole && (!self.holders.slips || R::sound(self.apart.iter().map(|sum| sum.value()))) {
            return;
        }
        self.state = self.state.map(|_| R::Sum::at(R::ZERO));
        (self.state.r_uw, self.state.r_wu) = (r_uw, r_wu);
        self.apart = [R::Sum::at(R::ZERO); ROLLS];
        self.nips = [Nip::Sticks; ROLLS];
        self.break_web();
    }

    fn look_at_winding(&mut self, holding: &Holding<R::Si>) {
        let nips = &self.holders.nips;
        let t_sr = self.web.tension[SPANS - 1].to_si(self.scale.force);
        let front = holding.nip_force[FRONT];
        let tight = nips.wound_on_tension(&self.winding.nip_load, t_sr, front);
        self.winding = Winding {
            nip_force: holding.nip_force,
            nip_load: self.winding.nip_load,
            slides: self.nips.map(|nip| nip != Nip::Sticks),
            wound_on_tension: tight,
            burst: self.winding.burst || tight > self.holders.strength,
        };
    }

    /// The web breaks when it is torn, when the parent roll has run out, and when it has been pulled off the core.
    fn break_web_if_due(&mut self) {
        let limits = &self.limits;
        // what is not a number holds nothing
        let holds = |t: &R| *t <= limits.strength;
        let torn = self.web.tension.iter().position(|t| !holds(t));
        let expired = self.state.r_uw.value() <= limits.expire_radius;
        let pulled_off = self.state.r_wu.value() < limits.bare_radius;
        if pulled_off {
            self.state.r_wu = R::Sum::at(limits.core_radius);
        }
        if self.threaded && (torn.is_some() || expired || pulled_off) {
            let first = if expired { 0 } else { SPANS - 1 };
            self.break_web_in(torn.unwrap_or(first));
        }
    }

    fn measure(&mut self, faults: &SensorFaults<R::Si>) -> Measurements<R::Si> {
        let (x, scale) = (&self.state, &self.scale);
        let v_rd = x.v[SPANS - 1].value();
        let v = if self.holders.slips {
            [v_rd, self.apart[0].value(), self.apart[1].value()]
        } else {
            [v_rd; ROLLS]
        };
        let omega = self.motion.windup.turn(v);
        let [rd, fd, rr] = omega.map(|omega| omega.to_si(scale.omega_rolls));
        let uw = x.omega_uw.value().to_si(scale.omega);
        let sight = Sight {
            omega: BySection { uw, rd, fd, rr },
            travel: self.travel,
            r_wu: x.r_wu.value().to_si(scale.r_wu),
            rider_lifted: self.holders.nips.rider_lifted(),
        };
        let t = self
            .sensors
            .spans()
            .map(|span| self.web.tension[span].to_si(scale.force));
        let mut measurements = self.sensors.look(&sight, t, faults);
        measurements.brakes = self.closed;
        measurements
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

impl<R: Real> Holders<R> {
    fn new(machine: &Machine, h: f64) -> Self {
        let brakes = &machine.brakes;
        let karnopp = (brakes.karnopp_m_s > 0.0).then(|| R::of(brakes.karnopp_m_s));
        let set_valued = Law::SetValued {
            per_step: R::of(1.0 / h),
        };
        let at_surface = karnopp.map_or(set_valued, |band| Law::Karnopp { band });
        let brake = |force: f64, law| Brake::closed(R::of(force), R::of(brakes.static_ratio), law);
        Self {
            parent: ParentRoll::new(machine),
            contact: Contact::new(machine, h),
            nips: Nips::new(machine),
            slips: machine.nips.slip,
            brakes: Brakes {
                uw: brake(brakes.uw_n_m, set_valued),
                rd: brake(brakes.rd_n_m / machine.rear_drum.radius_m, at_surface),
                fd: brake(brakes.fd_n_m / machine.front_drum.radius_m, at_surface),
            },
            karnopp,
            strength: R::of(machine.web.strength_n_m),
        }
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
}

impl<A: Arithmetic> Limits<A> {
    /// From the machines' description.
    pub fn new(machines: &impl Machines<A>) -> Self {
        let core = |m: &Machine| m.shipping_roll.core_radius_m;
        Self {
            strength: machines.coefficient(|m, u| m.web.strength_n_m * m.web.width_m / u.force),
            core_radius: machines.coefficient(|m, u| core(m) / u.r_wu),
            bare_radius: machines.coefficient(|m, u| BARE * core(m) / u.r_wu),
            full_radius: machines.coefficient(|m, u| m.parent_roll.full_radius_m / u.r_uw),
            expire_radius: machines.coefficient(|m, u| m.parent_roll.expire_radius_m / u.r_uw),
            threaded_strain: machines.coefficient(|_, u| THREADED_STRAIN / u.strain),
        }
    }
}

impl<R: Scalar> Scale<R> {
    fn new(units: &Units) -> Self {
        Self {
            speed: R::unit(units.speed),
            strain: R::unit(units.strain),
            force: R::unit(units.force),
            torque: R::unit(units.torque()),
            torque_rolls: R::unit(units.torque_rolls()),
            omega: R::unit(units.omega()),
            omega_rolls: R::unit(units.omega_rolls()),
            r_uw: R::unit(units.r_uw),
            r_wu: R::unit(units.r_wu),
            one: R::unit(1.0),
        }
    }
}
