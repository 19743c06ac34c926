//! How many operations a step needs, whatever machine computes it.
//!
//! Not here: instructions, and fixed-point numbers. A [`Traced`] number computes what the number in it would and
//! records every operation that a call asks for. Needed is what is left when the same operation on the same numbers
//! is done once, and those are left out whose result nothing ever looks at: neither a result of the call nor a state
//! that a later call builds on. Nothing else may be left out, for the bits are given: sums keep their order.
//!
//! That is the floor for a compiler: it may find out what is the same and what is not looked at, as this does.
//! Loads, stores, branches and comparisons come on top.

use std::cell::RefCell;
use std::cmp::Ordering;
use std::collections::{BTreeMap, HashMap};
use std::ops::{Add, AddAssign, Div, Mul, Neg, Sub, SubAssign};

use anyhow::Result;
use model_core::drive::{DRIVE_PERIOD_MS, Drive};
use model_core::exchange::{Actuators, Brakes, DriveCommand, DriveStatus, Measurements};
use model_core::image::Feedback;
use model_core::logic::Logic;
use model_core::machine::{MAX_SPANS, Machine};
use model_core::plant::{PLANT_PERIOD_MS, Winder};
use model_core::real::{
    Accumulator, Arithmetic, Compensated, Float, Plain, Real, Ring, Scalar, Sum,
};
use model_core::simulator::{Plant, logic_tick};
use model_core::twin::{self, Course, Extent, Moving};

/// A floating-point number that can be traced.
pub trait Number: Float {
    /// What traced states are summed up in: as the number's own.
    type Sum: Sum<Traced<Self>> + Accumulator<Traced<Self>>;
}

impl Number for f32 {
    type Sum = Compensated<Traced<f32>>;
}

impl Number for f64 {
    type Sum = Plain<Traced<f64>>;
}

/// What can be done with numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
enum Operation {
    /// Comes from somewhere else.
    Given,
    /// Changes the sign, which is no arithmetic.
    Negate,
    Add,
    Subtract,
    Multiply,
    Divide,
    Root,
    Cosine,
}

/// Numbers of operations.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Operations {
    /// Sums and differences.
    pub sums: f64,
    /// Products.
    pub products: f64,
    /// Quotients.
    pub quotients: f64,
    /// Square roots.
    pub roots: f64,
    /// Cosines.
    pub cosines: f64,
}

impl Operations {
    fn count(&mut self, operation: Operation) {
        match operation {
            Operation::Given | Operation::Negate => {}
            Operation::Add | Operation::Subtract => self.sums += 1.0,
            Operation::Multiply => self.products += 1.0,
            Operation::Divide => self.quotients += 1.0,
            Operation::Root => self.roots += 1.0,
            Operation::Cosine => self.cosines += 1.0,
        }
    }

    /// All of them.
    pub fn total(&self) -> f64 {
        self.sums + self.products + self.quotients + self.roots + self.cosines
    }

    fn plus(&self, other: &Self) -> Self {
        Self {
            sums: self.sums + other.sums,
            products: self.products + other.products,
            quotients: self.quotients + other.quotients,
            roots: self.roots + other.roots,
            cosines: self.cosines + other.cosines,
        }
    }

    fn over(&self, n: f64) -> Self {
        Self {
            sums: self.sums / n,
            products: self.products / n,
            quotients: self.quotients / n,
            roots: self.roots / n,
            cosines: self.cosines / n,
        }
    }
}

/// Where a number comes from: the result of an operation, or a literal, which is the same wherever it stands.
type Origin = u32;
const LITERAL: Origin = 0;

/// What an operation works on: an origin, and of a literal its bits.
type Operand = (Origin, u64);

/// What has been done since the recording began.
struct Graph {
    next: Origin,
    /// The first operation of the recording.
    first: Origin,
    /// Within a window of calls: the operations since `first`, with their operands.
    recording: bool,
    nodes: Vec<(Operation, Origin, Origin)>,
    /// Within a call: its operations are asked for.
    calling: bool,
    known: HashMap<(Operation, Operand, Operand), Origin>,
    asked: Operations,
    /// What has been looked at.
    roots: Vec<Origin>,
}

thread_local! {
    static GRAPH: RefCell<Graph> = RefCell::new(Graph {
        next: LITERAL + 1,
        first: LITERAL + 1,
        recording: false,
        nodes: Vec::new(),
        calling: false,
        known: HashMap::new(),
        asked: Operations::default(),
        roots: Vec::new(),
    });
}

impl Graph {
    fn with<T>(f: impl FnOnce(&mut Self) -> T) -> T {
        GRAPH.with_borrow_mut(f)
    }

    fn node(&mut self, operation: Operation, a: Origin, b: Origin) -> Origin {
        let origin = self.next;
        self.next += 1;
        if self.recording {
            self.nodes.push((operation, a, b));
        }
        origin
    }

    fn given(&mut self) -> Origin {
        self.node(Operation::Given, LITERAL, LITERAL)
    }

    fn result(&mut self, operation: Operation, a: Operand, b: Operand) -> Origin {
        if !self.calling {
            return self.given();
        }
        self.asked.count(operation);
        let one = (LITERAL, 1_f64.to_bits());
        match operation {
            // what a compiler computes, and what it need not
            Operation::Multiply if a == one => return b.0,
            Operation::Multiply | Operation::Divide if b == one => return a.0,
            _ if a.0 == LITERAL && b.0 == LITERAL => return LITERAL,
            _ => {}
        }
        let commutes = matches!(operation, Operation::Add | Operation::Multiply);
        let (a, b) = if commutes && b < a { (b, a) } else { (a, b) };
        let key = (operation, a, b);
        if let Some(origin) = self.known.get(&key) {
            return *origin;
        }
        let origin = self.node(operation, a.0, b.0);
        self.known.insert(key, origin);
        origin
    }

    fn look(&mut self, origin: Origin) {
        if self.recording && origin >= self.first {
            self.roots.push(origin);
        }
    }

    /// Of the operations before `end`, those that something looks at.
    fn needed(&self, end: Origin) -> Operations {
        let mut seen = vec![false; self.nodes.len()];
        let mut open = self.roots.clone();
        let mut needed = Operations::default();
        while let Some(origin) = open.pop() {
            let Some(at) = origin.checked_sub(self.first).map(|at| at as usize) else {
                continue;
            };
            if std::mem::replace(&mut seen[at], true) {
                continue;
            }
            let (operation, a, b) = self.nodes[at];
            if origin < end {
                needed.count(operation);
            }
            open.extend([a, b]);
        }
        needed
    }
}

/// A number that knows where it comes from.
#[derive(Clone, Copy, Debug)]
pub struct Traced<N> {
    value: N,
    origin: Origin,
}

impl<N: Number> Traced<N> {
    fn given(value: N) -> Self {
        Self {
            value,
            origin: Graph::with(Graph::given),
        }
    }

    fn operand(self) -> Operand {
        let bits = match self.origin {
            LITERAL => self.value.to_f64().to_bits(),
            _ => 0,
        };
        (self.origin, bits)
    }

    fn of_one(self, operation: Operation, value: N) -> Self {
        let (a, none) = (self.operand(), (LITERAL, u64::MAX));
        let origin = Graph::with(|graph| graph.result(operation, a, none));
        Self { value, origin }
    }

    fn of_two(self, operation: Operation, other: Self, value: N) -> Self {
        let (a, b) = (self.operand(), other.operand());
        let origin = Graph::with(|graph| graph.result(operation, a, b));
        Self { value, origin }
    }

    /// Somebody looks at it who is no number.
    fn look(self) -> N {
        Graph::with(|graph| {
            if graph.calling {
                graph.look(self.origin);
            }
        });
        self.value
    }
}

impl<N: Number> Default for Traced<N> {
    fn default() -> Self {
        Self::ZERO
    }
}

impl<N: Number> PartialEq for Traced<N> {
    fn eq(&self, other: &Self) -> bool {
        self.look() == other.look()
    }
}

impl<N: Number> PartialOrd for Traced<N> {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        self.look().partial_cmp(&other.look())
    }
}

impl<N: Number> Add for Traced<N> {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        self.of_two(Operation::Add, other, self.value + other.value)
    }
}

impl<N: Number> Sub for Traced<N> {
    type Output = Self;
    fn sub(self, other: Self) -> Self {
        self.of_two(Operation::Subtract, other, self.value - other.value)
    }
}

impl<N: Number> Mul for Traced<N> {
    type Output = Self;
    fn mul(self, other: Self) -> Self {
        self.of_two(Operation::Multiply, other, self.value * other.value)
    }
}

impl<N: Number> Div for Traced<N> {
    type Output = Self;
    fn div(self, other: Self) -> Self {
        self.of_two(Operation::Divide, other, self.value / other.value)
    }
}

impl<N: Number> Neg for Traced<N> {
    type Output = Self;
    fn neg(self) -> Self {
        self.of_one(Operation::Negate, -self.value)
    }
}

impl<N: Number> AddAssign for Traced<N> {
    fn add_assign(&mut self, other: Self) {
        *self = *self + other;
    }
}

impl<N: Number> SubAssign for Traced<N> {
    fn sub_assign(&mut self, other: Self) {
        *self = *self - other;
    }
}

impl<N: Number> Ring for Traced<N> {
    const ZERO: Self = Self {
        value: N::ZERO,
        origin: LITERAL,
    };
    const ONE: Self = Self {
        value: N::ONE,
        origin: LITERAL,
    };
}

impl<N: Number> Real for Traced<N> {
    type Sum = <N as Number>::Sum;

    /// Within a call a literal; otherwise a coefficient, of which no two are the same.
    fn of(x: f64) -> Self {
        let origin = Graph::with(|graph| {
            if graph.calling {
                LITERAL
            } else {
                graph.given()
            }
        });
        let value = N::of(x);
        Self { value, origin }
    }
    fn to_f64(self) -> f64 {
        self.look().to_f64()
    }
    fn of_f32(x: f32) -> Self {
        Self::given(N::of_f32(x))
    }
    fn to_f32(self) -> f32 {
        self.look().to_f32()
    }
    fn sqrt(self) -> Self {
        self.of_one(Operation::Root, self.value.sqrt())
    }
    fn cos(self) -> Self {
        self.of_one(Operation::Cosine, self.value.cos())
    }
    fn of_i32(n: i32) -> Self {
        Self::given(N::of_i32(n))
    }
    fn floor_i32(self) -> i32 {
        self.look().floor_i32()
    }
    fn is_finite(self) -> bool {
        self.look().is_finite()
    }
}

/// As floating-point numbers do it.
impl<N: Number> Arithmetic for Traced<N> {
    type Gain = Self;
    type Rate = Self;
    type Sum = <N as Number>::Sum;

    const POSITIVE_OF: f64 = 1.0;

    fn positive(self) -> Self {
        if self > Self::ZERO { self } else { Self::ZERO }
    }
    fn stretch(strain: Self) -> Self {
        Self::ONE + strain
    }
    fn strained(self, strain: Self) -> Self {
        self * strain
    }
    fn elastic(self, stiffness: Self) -> Self {
        stiffness * self
    }
    fn over(self, divisor: Self) -> Self {
        self / divisor
    }
    fn gain_over(gain: Self, divisor: Self) -> Self {
        gain / divisor
    }
    fn rate(self, gain: Self) -> Self {
        gain * self
    }
    fn no_rate() -> Self {
        Self::ZERO
    }
    fn with_half(change: Self, other: Self) -> Self {
        change + Self::of(0.5) * other
    }
}

macro_rules! accumulator {
    ($sum:ident) => {
        impl<N: Number> Accumulator<Traced<N>> for $sum<Traced<N>>
        where
            Traced<N>: Arithmetic<Rate = Traced<N>>,
        {
            fn at(value: Traced<N>) -> Self {
                Sum::at(value)
            }
            fn value(&self) -> Traced<N> {
                Sum::value(self)
            }
            fn after_sixth(&self, rate: Traced<N>) -> Traced<N> {
                Sum::value(self) + Traced::of(0.5) * rate
            }
            fn after_half(&self, rate: Traced<N>) -> Traced<N> {
                Sum::value(self) + Traced::of(1.5) * rate
            }
            fn after_whole(&self, rate: Traced<N>) -> Traced<N> {
                Sum::value(self) + Traced::of(3.0) * rate
            }
            fn advance(&mut self, change: Traced<N>) {
                Sum::add(self, change);
            }
        }
    };
}

accumulator!(Compensated);
accumulator!(Plain);

impl<N: Number> Scalar for Traced<N> {
    type Si = Self;
    type Unit = ();

    const PER_UNIT: bool = N::PER_UNIT;
    const LARGEST: f64 = N::LARGEST;
    const LARGEST_GAIN: f64 = N::LARGEST_GAIN;

    fn coefficient(x: f64) -> Self {
        Self::given(N::coefficient(x))
    }
    fn gain(x: f64) -> Self {
        Self::given(N::of(x))
    }
    fn unit(_: f64) {}
    fn of_si(x: Self, (): ()) -> Self {
        x
    }
    fn to_si(self, (): ()) -> Self {
        self
    }
    fn sound(values: impl Iterator<Item = Self>) -> bool {
        values.fold(Self::ZERO, |sum, x| sum + x).is_finite()
    }
    fn fingerprint(self) -> u32 {
        self.look().fingerprint()
    }
}

/// What the calls of one part need.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Floor {
    /// Operations that a call needs, on average.
    pub needed: Operations,
    /// Operations that its source asks for, on average.
    pub asked: Operations,
}

/// Calls that are recorded together: what the first leaves behind is looked at in the others.
const WINDOW: u32 = 3;
/// From window to window, calls.
const EVERY: u32 = 16;

/// Sorts calls by what they were.
#[derive(Default)]
struct Recorder {
    calls: u32,
    first: Option<(&'static str, Operations, Origin)>,
    totals: BTreeMap<&'static str, (f64, Floor)>,
}

impl Recorder {
    /// A call; `results` gives what it leaves for others, `state` what it keeps and would tell.
    fn call<T, N: Number>(
        &mut self,
        call: impl FnOnce() -> T,
        name: impl FnOnce(&T) -> &'static str,
        results: impl FnOnce(&T) -> Vec<Traced<N>>,
    ) -> T {
        let place = self.calls % EVERY;
        self.calls += 1;
        Graph::with(|graph| {
            if place == 0 {
                graph.first = graph.next;
                graph.nodes.clear();
                graph.roots.clear();
                graph.recording = true;
            }
            graph.known.clear();
            graph.asked = Operations::default();
            graph.calling = graph.recording;
        });
        let outcome = call();
        let results = results(&outcome);
        let (asked, end) = Graph::with(|graph| {
            graph.calling = false;
            for number in results {
                graph.look(number.origin);
            }
            (graph.asked, graph.next)
        });
        if place == 0 {
            self.first = Some((name(&outcome), asked, end));
        }
        if place == WINDOW - 1
            && let Some((name, asked, end)) = self.first.take()
        {
            let needed = Graph::with(|graph| {
                graph.recording = false;
                graph.needed(end)
            });
            let (times, total) = self.totals.entry(name).or_default();
            *times += 1.0;
            total.needed = total.needed.plus(&needed);
            total.asked = total.asked.plus(&asked);
        }
        outcome
    }

    fn floors(self) -> impl Iterator<Item = (&'static str, Floor)> {
        self.totals.into_iter().map(|(name, (times, total))| {
            let floor = Floor {
                needed: total.needed.over(times),
                asked: total.asked.over(times),
            };
            (name, floor)
        })
    }
}

/// What a preset needs, by the names of the sections that the twin counts.
pub fn floors<N: Number>(machine: &Machine) -> Result<BTreeMap<&'static str, Floor>> {
    match machine.idle.len() + 1 {
        3 => floors_with::<N, 3>(machine),
        MAX_SPANS => floors_with::<N, MAX_SPANS>(machine),
        spans => anyhow::bail!("a machine of {spans} spans is not counted: 3 or {MAX_SPANS}"),
    }
}

fn floors_with<N: Number, const SPANS: usize>(
    machine: &Machine,
) -> Result<BTreeMap<&'static str, Floor>> {
    let mut floors = BTreeMap::new();
    floors.extend(motion::<N, SPANS>(machine).floors());
    floors.extend(drive::<N, SPANS>(machine)?.floors());
    floors.extend(plant::<N, SPANS>(machine)?.floors());
    let mut machine = machine.clone();
    twin::may_slip(&mut machine);
    floors.extend(plant::<N, SPANS>(&machine)?.floors());
    Ok(floors)
}

fn measured<N: Number>(m: &Measurements<Traced<N>>) -> Vec<Traced<N>> {
    let mut numbers = m.omega.into_array().to_vec();
    numbers.extend([m.tension, m.d_wu]);
    numbers
}

/// The motion alone.
fn motion<N: Number, const SPANS: usize>(machine: &Machine) -> Recorder {
    let mut moving = Moving::<Traced<N>, SPANS>::of(machine);
    let mut recorder = Recorder::default();
    for _ in 0..WINDOW {
        recorder.call(
            || {
                moving.step();
                moving.values()
            },
            |_| "motion",
            |state| state.iter().collect(),
        );
    }
    recorder
}

/// The plant alone, through its short course.
fn plant<N: Number, const SPANS: usize>(machine: &Machine) -> Result<Recorder> {
    let period = 1e-3 * f64::from(PLANT_PERIOD_MS);
    let mut winder = Winder::<Traced<N>, SPANS>::new(machine, period)?;
    let mut recorder = Recorder::default();
    for (_, actuators) in Course::of(machine, Extent::Short).steps::<Traced<N>>() {
        recorder.call(
            || {
                let measurements = winder.step(&actuators);
                let braked = measurements.brakes != Brakes::default();
                let sliding = winder.winding().slides.contains(&true);
                let name = match (machine.nips.slip, braked, sliding) {
                    (true, _, true) => "sliding",
                    (true, _, false) => "gripping",
                    (false, true, _) => "braked",
                    (false, false, _) => "smooth",
                };
                (name, measurements, winder.state())
            },
            |(name, ..)| name,
            |(_, measurements, state)| {
                let mut numbers = measured(measurements);
                numbers.extend(state.iter());
                numbers
            },
        );
    }
    Ok(recorder)
}

/// The regulators, in the whole simulator.
fn drive<N: Number, const SPANS: usize>(machine: &Machine) -> Result<Recorder> {
    let mut plant = Plant::<Traced<N>, SPANS>::new(machine)?;
    let mut drive = Drive::<Traced<N>>::new(machine);
    let mut logic = Logic::<Traced<N>>::new(machine);
    let (mut actuators, mut command) = (Actuators::default(), DriveCommand::default());
    let (mut feedback, mut ticks) = (Feedback::default(), 0);
    let mut recorder = Recorder::default();
    for cycle in 0..twin::CYCLES {
        let commands = twin::commands(machine, cycle);
        let mut seen = None;
        while ticks < (cycle + 1) * DRIVE_PERIOD_MS / PLANT_PERIOD_MS {
            ticks += 1;
            seen = Some(plant.tick(&actuators));
        }
        let Some((measurements, record)) = seen else {
            continue;
        };
        let (acts, status) = recorder.call(
            || {
                let (mut acts, mut status) = (actuators, DriveStatus::default());
                drive.step(&command, &measurements, &mut acts, &mut status);
                (acts, status)
            },
            |_| "drive",
            |(acts, status)| {
                let mut numbers = acts.torque.into_array().to_vec();
                numbers.extend([status.v, status.v_ref, status.a_ref, status.v_uw]);
                numbers.extend([status.r_uw, status.tension_ref]);
                numbers
            },
        );
        actuators = acts;
        command = logic_tick(
            &mut logic,
            &commands,
            &measurements,
            &status,
            &record,
            &mut feedback,
        );
    }
    Ok(recorder)
}

#[cfg(test)]
mod tests {
    // counts are whole numbers
    #![allow(clippy::float_cmp)]

    use super::*;

    type T = Traced<f32>;

    /// What one call needs and asks for, whose results are looked at.
    fn floor(call: impl Fn() -> Vec<T>) -> Floor {
        let mut recorder = Recorder::default();
        for _ in 0..WINDOW {
            recorder.call(&call, |_| "call", Clone::clone);
        }
        recorder.floors().next().unwrap().1
    }

    #[test]
    fn a_polynomial_needs_as_many_products_as_its_degree() {
        let coefficients: Vec<T> = (0..=7).map(|i| T::of(f64::from(i))).collect();
        let x = T::of(0.5);
        let horner = floor(|| vec![coefficients.iter().fold(T::ZERO, |sum, c| sum * x + *c)]);
        // the first step is a compiler's: it does not know that 0·x is 0
        assert_eq!(horner.needed.products, 8.0);
        assert_eq!(horner.needed.sums, 8.0);
        assert_eq!(horner.needed, horner.asked);
    }

    #[test]
    fn what_is_the_same_or_not_looked_at_is_not_needed() {
        let (a, b) = (T::of(3.0), T::of(3.0));
        let floor = floor(|| {
            let _nobody_asks = (a / b).sqrt();
            vec![a * b + b * a, a * T::ONE, -(a - b)]
        });
        let asked = floor.asked;
        assert_eq!(
            (asked.products, asked.quotients, asked.roots),
            (3.0, 1.0, 1.0)
        );
        let needed = Operations {
            sums: 2.0,
            products: 1.0,
            ..Operations::default()
        };
        assert_eq!(floor.needed, needed);
    }

    #[test]
    fn what_decides_is_needed() {
        let (a, b) = (T::of(1.0), T::of(2.0));
        let floor = floor(|| vec![(a - b).max(T::ZERO)]);
        assert_eq!(floor.needed.total(), 1.0);
    }

    /// Kahan's sum takes four additions where a plain one takes one.
    #[test]
    fn sums_cost_what_they_are_known_to() {
        let (x, dx) = (T::of(1.0), T::of(1e-9));
        let floor = floor(|| {
            let mut sum = <Compensated<T> as Sum<T>>::at(x);
            Sum::add(&mut sum, dx);
            Sum::add(&mut sum, dx);
            vec![Sum::value(&sum)]
        });
        // the first starts without a carry, but adds it; what the second carries on nobody looks at
        assert_eq!(floor.asked.sums, 8.0);
        assert_eq!(floor.needed.sums, 6.0);
        let (x, dx) = (Traced::<f64>::of(1.0), Traced::of(1e-9));
        let mut recorder = Recorder::default();
        for _ in 0..WINDOW {
            let call = || {
                let mut sum = <Plain<Traced<f64>> as Sum<Traced<f64>>>::at(x);
                Sum::add(&mut sum, dx);
                vec![Sum::value(&sum)]
            };
            recorder.call(call, |_| "call", Clone::clone);
        }
        let floor = recorder.floors().next().unwrap().1;
        assert_eq!(floor.needed.total(), 1.0);
    }

    /// Tracing changes no bit.
    #[test]
    fn traced_numbers_compute_the_same_bits() {
        let machine = twin::machine();
        let mut plain = Plant::<f32, 3>::new(&machine).unwrap();
        let mut traced = Plant::<T, 3>::new(&machine).unwrap();
        let course = Course::of(&machine, Extent::Short);
        let steps = course.steps::<f32>().zip(course.steps::<T>());
        for ((phase, plain_acts), (_, traced_acts)) in steps.step_by(3) {
            let (_, expected) = plain.tick(&plain_acts);
            let (_, record) = traced.tick(&traced_acts);
            assert_eq!(record, expected, "{}", phase.name());
        }
    }
}
