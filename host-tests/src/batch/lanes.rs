//! Sixteen numbers in single precision, one for each of sixteen winders side by side.
//!
//! Not here: anything that one lane decides for itself. Every operation is that of `f32`, lane by lane and correctly
//! rounded, so that a winder in a lane has the bits of one that is computed alone, as long as all its numbers are
//! numbers.

use std::ops::{Add, AddAssign, Div, Mul, Neg, Sub, SubAssign};

use bytemuck::cast;
use model_core::machine::Machine;
use model_core::plant::Limits;
use model_core::plant::rk4::State;
use model_core::plant::span::Web;
use model_core::plant::units::{Machines, Units};
use model_core::real::{Accumulator, Arithmetic, Compensated, Ring, Scalar};
use wide::{f32x16, u32x16};

use super::group::Extremes;

/// How many winders go side by side.
pub const LANES: usize = 16;

/// A number of each winder.
#[derive(Clone, Copy, Debug)]
pub struct Lanes(f32x16);

/// A set of lanes, a bit for each.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Set(u16);

/// A state's sums, of all lanes.
pub type Sums<const SPANS: usize> = State<Compensated<Lanes>, SPANS, 0>;

impl Set {
    /// No lane.
    pub const NONE: Self = Self(0);

    /// There is none.
    pub fn is_empty(self) -> bool {
        self.0 == 0
    }
    /// The lanes from the first.
    pub fn iter(self) -> impl Iterator<Item = usize> {
        (0..LANES).filter(move |lane| self.0 >> lane & 1 == 1)
    }
    /// Takes a lane in.
    pub fn insert(&mut self, lane: usize) {
        self.0 |= 1 << lane;
    }
    /// Leaves a lane out.
    pub fn remove(&mut self, lane: usize) {
        self.0 &= !(1 << lane);
    }
    /// Those that are in either.
    pub fn or(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }
    /// Those that are in both.
    pub fn and(self, other: Self) -> Self {
        Self(self.0 & other.0)
    }
}

impl Lanes {
    /// The same in every lane.
    pub fn all(x: f32) -> Self {
        Self(f32x16::splat(x))
    }
    /// What each lane has.
    pub fn each(of: impl FnMut(usize) -> f32) -> Self {
        Self(f32x16::new(std::array::from_fn(of)))
    }
    /// The number in a lane.
    pub fn lane(&self, lane: usize) -> f32 {
        self.0.as_array()[lane]
    }
    /// Changes the number in a lane.
    pub fn put(&mut self, lane: usize, x: f32) {
        self.0.as_mut_array()[lane] = x;
    }
}

macro_rules! operators {
    ($($trait:ident $method:ident $operator:tt),*) => {$(
        impl $trait for Lanes {
            type Output = Self;
            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                Self(self.0 $operator other.0)
            }
        }
    )*};
}
operators!(Add add +, Sub sub -, Mul mul *, Div div /);

impl Neg for Lanes {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        Self(-self.0)
    }
}

impl AddAssign for Lanes {
    #[inline(always)]
    fn add_assign(&mut self, other: Self) {
        *self = *self + other;
    }
}

impl SubAssign for Lanes {
    #[inline(always)]
    fn sub_assign(&mut self, other: Self) {
        *self = *self - other;
    }
}

impl Ring for Lanes {
    const ZERO: Self = Self(f32x16::ZERO);
    const ONE: Self = Self(f32x16::ONE);
}

/// As that of `f32`, operation by operation.
impl Arithmetic for Lanes {
    type Gain = Self;
    type Rate = Self;
    type Sum = Compensated<Self>;

    const POSITIVE_OF: f64 = f32::POSITIVE_OF;

    /// It lets through what is not a number, so that it shows in the end, see [`at_limit`].
    #[inline(always)]
    fn positive(self) -> Self {
        Self(self.0 + self.0.abs())
    }
    #[inline(always)]
    fn stretch(strain: Self) -> Self {
        Self::ONE + strain
    }
    #[inline(always)]
    fn strained(self, strain: Self) -> Self {
        self * strain
    }
    #[inline(always)]
    fn elastic(self, stiffness: Self) -> Self {
        stiffness * self
    }
    #[inline(always)]
    fn over(self, divisor: Self) -> Self {
        self / divisor
    }
    #[inline(always)]
    fn gain_over(gain: Self, divisor: Self) -> Self {
        gain / divisor
    }
    #[inline(always)]
    fn rate(self, gain: Self) -> Self {
        gain * self
    }
    #[inline(always)]
    fn no_rate() -> Self {
        Self::ZERO
    }
    #[inline(always)]
    fn with_half(change: Self, other: Self) -> Self {
        change + Self::all(0.5) * other
    }
}

impl Accumulator<Lanes> for Compensated<Lanes> {
    fn at(value: Lanes) -> Self {
        Self::at(value)
    }
    #[inline(always)]
    fn value(&self) -> Lanes {
        self.value
    }
    #[inline(always)]
    fn after_sixth(&self, rate: Lanes) -> Lanes {
        self.value + Lanes::all(0.5) * rate
    }
    #[inline(always)]
    fn after_half(&self, rate: Lanes) -> Lanes {
        self.value + Lanes::all(1.5) * rate
    }
    #[inline(always)]
    fn after_whole(&self, rate: Lanes) -> Lanes {
        self.value + Lanes::all(3.0) * rate
    }
    #[inline(always)]
    fn advance(&mut self, change: Lanes) {
        self.add(change);
    }
}

/// A machine in each lane.
pub struct SideBySide<'a>(pub [&'a Machine; LANES]);

impl Machines<Lanes> for SideBySide<'_> {
    fn coefficient(&self, of: impl Fn(&Machine, &Units) -> f64) -> Lanes {
        Lanes::each(|lane| f32::coefficient(of(self.0[lane], &Units::SI)))
    }
    fn gain(&self, of: impl Fn(&Machine, &Units) -> f64) -> Lanes {
        Lanes::each(|lane| f32::gain(of(self.0[lane], &Units::SI)))
    }
}

/// The sums of one lane.
pub fn sums_of<const SPANS: usize>(
    sums: &Sums<SPANS>,
    lane: usize,
) -> State<Compensated<f32>, SPANS, 0> {
    sums.map(|sum| Compensated {
        value: sum.value.lane(lane),
        carry: sum.carry.lane(lane),
    })
}

/// Changes the sums of one lane.
pub fn put_sums<const SPANS: usize>(
    sums: &mut Sums<SPANS>,
    lane: usize,
    of: &State<Compensated<f32>, SPANS, 0>,
) {
    *sums = sums.zip(of, |mut sum, of| {
        sum.value.put(lane, of.value);
        sum.carry.put(lane, of.carry);
        sum
    });
}

/// The lanes in which a limit is reached, so that the step is not for all: a state that is not finite, a web torn or
/// pulled off its core, or run out.
#[inline(always)]
pub fn at_limit<const SPANS: usize>(
    limits: &Limits<Lanes>,
    x: &State<Lanes, SPANS, 0>,
    web: Option<&Web<Lanes, SPANS>>,
) -> Set {
    // as one winder asks it: what is not finite makes the sum so
    let mut sum = Lanes::ZERO;
    x.map(|x| sum += x);
    let mut reached = !sum.0.is_finite() | x.r_wu.0.simd_lt(limits.bare_radius.0);
    if let Some(web) = web {
        for t in &web.tension {
            reached |= !t.0.simd_le(limits.strength.0);
        }
        reached |= x.r_uw.0.simd_le(limits.expire_radius.0);
    }
    Set(reached.to_bitmask() as u16)
}

/// The smallest and the largest of tensions, which are no less than +0 and numbers all.
#[inline(always)]
fn range<const SPANS: usize>(tension: &[Lanes; SPANS]) -> (Lanes, Lanes) {
    let rest = &tension[1..];
    rest.iter()
        .fold((tension[0], tension[0]), |(low, high), t| {
            (Lanes(low.0.fast_min(t.0)), Lanes(high.0.fast_max(t.0)))
        })
}

/// Largest and smallest tension of each lane's whole web so far, and the step after which it was the largest.
#[derive(Clone, Copy, Debug)]
pub struct AllExtremes {
    largest: Lanes,
    at: u32x16,
    smallest: Lanes,
}

impl AllExtremes {
    /// Of no lane yet.
    pub fn none() -> Self {
        Self {
            largest: Lanes::ZERO,
            at: u32x16::ZERO,
            smallest: Lanes::ZERO,
        }
    }

    /// Sees the tensions after a step.
    #[inline(always)]
    pub fn see<const SPANS: usize>(&mut self, tension: &[Lanes; SPANS], step: u32) {
        let (low, high) = range(tension);
        let more = high.0.simd_gt(self.largest.0);
        self.largest.0 = more.select(high.0, self.largest.0);
        self.at = cast::<_, u32x16>(more).select(u32x16::splat(step), self.at);
        self.smallest.0 = self.smallest.0.fast_min(low.0);
    }

    /// Those of a lane.
    pub fn lane(&self, lane: usize) -> Extremes<f32> {
        Extremes {
            largest: self.largest.lane(lane),
            at: self.at.as_array()[lane],
            smallest: self.smallest.lane(lane),
        }
    }

    /// Changes those of a lane.
    pub fn put(&mut self, lane: usize, of: &Extremes<f32>) {
        self.largest.put(lane, of.largest);
        self.at.as_mut_array()[lane] = of.at;
        self.smallest.put(lane, of.smallest);
    }
}
