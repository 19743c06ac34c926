//! The numbers the models compute with, and sums that lose nothing.
//!
//! Not here: fixed-point numbers, which have a module of their own.
//!
//! There are two traits. [`Real`] is a number in SI units: regulators, logic, sensors, brakes and nips compute with
//! it. [`Arithmetic`] is the little that the motion of the winder needs, the part of the plant that is evaluated four
//! times a step; a number that has it may count its quantities in units of its own, see
//! [`Units`](crate::plant::units::Units), and may stand for several winders side by side. A [`Scalar`] is one winder's.
//!
//! Computed are `+ − × ÷`, comparison, a square root in references and nips, and a cosine where a roll is eccentric.
//! The first are correctly rounded on every machine, the last two come from one library in software, and nothing is
//! fused: the same inputs give the same bits on a PC and on a microcontroller.

use core::fmt::Debug;
use core::ops::{Add, AddAssign, Div, Mul, Neg, Sub, SubAssign};

/// What can be added and multiplied.
pub trait Ring:
    Copy
    + Debug
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Neg<Output = Self>
    + AddAssign
    + SubAssign
    + Send
    + 'static
{
    /// 0
    const ZERO: Self;
    /// 1
    const ONE: Self;
}

/// A number in SI units.
pub trait Real: Ring + Default + PartialOrd + Div<Output = Self> {
    /// What a regulator's state is summed up in.
    type Sum: Sum<Self>;

    /// The nearest number; for coefficients and settings, outside the step.
    fn of(x: f64) -> Self;
    /// The number as `f64`, exactly or nearest.
    fn to_f64(self) -> f64;
    /// The nearest number to an `f32`, which is cheap on a microcontroller.
    fn of_f32(x: f32) -> Self;
    /// The nearest `f32`.
    fn to_f32(self) -> f32;
    /// √x, correctly rounded; of a negative number, NaN.
    fn sqrt(self) -> Self;
    /// cos x, of an angle within ±2·π; the same bits on every machine.
    fn cos(self) -> Self;
    /// The whole number, exactly or nearest.
    fn of_i32(n: i32) -> Self;
    /// The largest whole number that is not larger, saturating.
    fn floor_i32(self) -> i32;

    /// Neither infinite nor no number.
    fn is_finite(self) -> bool;
    /// |x|
    fn abs(self) -> Self {
        if self < Self::ZERO { -self } else { self }
    }
    /// The smaller of two.
    fn min(self, other: Self) -> Self {
        if other < self { other } else { self }
    }
    /// The larger of two.
    fn max(self, other: Self) -> Self {
        if other > self { other } else { self }
    }
    /// The nearest number in `low ..= high`.
    fn clamp(self, low: Self, high: Self) -> Self {
        self.max(low).min(high)
    }
    /// At most `tolerance` away.
    fn is_near(self, other: Self, tolerance: Self) -> bool {
        (self - other).abs() <= tolerance
    }
    /// The nearest number in `−bound ..= bound`.
    fn limit(self, bound: Self) -> Self {
        self.clamp(-bound, bound)
    }
}

/// A running sum of many small increments.
pub trait Sum<R>: Copy + Debug + Send + 'static {
    /// A sum that stands at `value`.
    fn at(value: R) -> Self;
    /// The sum, rounded to the scalar.
    fn value(&self) -> R;
    /// Adds an increment.
    fn add(&mut self, increment: R);
}

/// A plain sum: an increment below half a unit in the last place is lost.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Plain<R>(R);

impl<R: Real> Sum<R> for Plain<R> {
    fn at(value: R) -> Self {
        Self(value)
    }
    fn value(&self) -> R {
        self.0
    }
    fn add(&mut self, increment: R) {
        self.0 += increment;
    }
}

/// A compensated sum: what rounding takes away is carried to the next increment.
///
/// Source: W. Kahan, "Further remarks on reducing truncation errors", CACM 8 (1965) 40.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Compensated<R> {
    /// The sum, rounded.
    pub value: R,
    /// What rounding has taken away and the next increment takes along.
    pub carry: R,
}

impl<R: Ring> Compensated<R> {
    /// A sum that stands at `value`.
    pub fn at(value: R) -> Self {
        Self {
            value,
            carry: R::ZERO,
        }
    }
    /// Adds an increment.
    #[inline(always)]
    pub fn add(&mut self, increment: R) {
        let increment = increment + self.carry;
        let sum = self.value + increment;
        self.carry = increment - (sum - self.value);
        self.value = sum;
    }
}

impl<R: Real> Sum<R> for Compensated<R> {
    fn at(value: R) -> Self {
        Self::at(value)
    }
    fn value(&self) -> R {
        self.value
    }
    fn add(&mut self, increment: R) {
        self.add(increment);
    }
}

/// What the motion of a winder is computed in: one number, or one for each of several winders side by side.
///
/// Nothing here compares, so that all of them go the same way.
pub trait Arithmetic: Ring {
    /// A factor between a quantity and what it changes another by.
    type Gain: Copy + Debug + Send + 'static;
    /// What a state changes by in a third of a step.
    type Rate: Copy + Debug + Add<Output = Self::Rate> + Send + 'static;
    /// What a state is summed up in.
    type Sum: Accumulator<Self>;

    /// The share of a quantity that [`positive`](Self::positive) wants, a power of two. A coefficient can have it in it,
    /// so that it costs nothing and changes no digit.
    const POSITIVE_OF: f64;

    /// max(0, x) of that share of x; of what is not a number, anything.
    fn positive(self) -> Self;
    /// 1 + ε
    fn stretch(strain: Self) -> Self;
    /// v·ε of a speed.
    fn strained(self, strain: Self) -> Self;
    /// EA·ε of a strain. Where strain and force are counted alike, nothing is to be done.
    fn elastic(self, stiffness: Self) -> Self;
    /// x/y, of a positive y.
    fn over(self, divisor: Self) -> Self;
    /// g/y, of a positive y.
    fn gain_over(gain: Self::Gain, divisor: Self) -> Self::Gain;
    /// The change g·x.
    fn rate(self, gain: Self::Gain) -> Self::Rate;
    /// No change.
    fn no_rate() -> Self::Rate;
    /// A change with half of another.
    fn with_half(change: Self::Rate, other: Self::Rate) -> Self::Rate;
}

/// A running sum of the changes of a state.
pub trait Accumulator<A: Arithmetic>: Copy + Debug + Send + 'static {
    /// A sum that stands at `value`.
    fn at(value: A) -> Self;
    /// The sum, rounded.
    fn value(&self) -> A;
    /// Where a sixth of a step at a rate would lead.
    fn after_sixth(&self, rate: A::Rate) -> A;
    /// Where half a step at a rate would lead.
    fn after_half(&self, rate: A::Rate) -> A;
    /// Where a step at a rate would lead.
    fn after_whole(&self, rate: A::Rate) -> A;
    /// Adds a change.
    fn advance(&mut self, change: A::Rate);
}

/// What one winder's motion is computed in.
pub trait Scalar: Arithmetic + PartialOrd + Default {
    /// Numbers for everything else about the winder.
    type Si: Real;
    /// The size of a unit, for converting from and to SI.
    type Unit: Copy + Debug + Send + 'static;

    /// Whether quantities are counted in units of the machine's own; otherwise in SI.
    const PER_UNIT: bool;
    /// The largest coefficient that can be held, in the units that [`Scalar::PER_UNIT`] says.
    const LARGEST: f64;
    /// The largest factor from a quantity to a change.
    const LARGEST_GAIN: f64;

    /// The nearest number.
    fn coefficient(x: f64) -> Self;
    /// The nearest factor.
    fn gain(x: f64) -> Self::Gain;
    /// A unit of this size in SI.
    fn unit(size: f64) -> Self::Unit;
    /// A quantity in SI, counted in its unit; at most as much as can be.
    fn of_si(x: Self::Si, unit: Self::Unit) -> Self;
    /// A quantity counted in its unit, in SI.
    fn to_si(self, unit: Self::Unit) -> Self::Si;
    /// Whether all are within what may be computed with: finite.
    fn sound(values: impl Iterator<Item = Self>) -> bool;
    /// The bits folded to 32, for comparing trajectories.
    fn fingerprint(self) -> u32;
}

/// A number that serves for everything: floating point.
pub trait Float: Scalar<Si = Self, Rate = Self> + Real {}

/// A floating-point number computes in SI, with its own operators.
macro_rules! floating {
    ($type:ty, $sum:ty, $fingerprint:expr) => {
        impl Float for $type {}

        impl Ring for $type {
            const ZERO: Self = 0.0;
            const ONE: Self = 1.0;
        }

        impl Arithmetic for $type {
            type Gain = Self;
            type Rate = Self;
            type Sum = $sum;

            const POSITIVE_OF: f64 = 0.5;

            #[inline(always)]
            fn positive(self) -> Self {
                self + self.abs()
            }
            #[inline(always)]
            fn stretch(strain: Self) -> Self {
                1.0 + strain
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
                0.0
            }
            #[inline(always)]
            fn with_half(change: Self, other: Self) -> Self {
                change + 0.5 * other
            }
        }

        impl Accumulator<$type> for $sum {
            fn at(value: $type) -> Self {
                Sum::at(value)
            }
            #[inline(always)]
            fn value(&self) -> $type {
                Sum::value(self)
            }
            #[inline(always)]
            fn after_sixth(&self, rate: $type) -> $type {
                Sum::value(self) + 0.5 * rate
            }
            #[inline(always)]
            fn after_half(&self, rate: $type) -> $type {
                Sum::value(self) + 1.5 * rate
            }
            #[inline(always)]
            fn after_whole(&self, rate: $type) -> $type {
                Sum::value(self) + 3.0 * rate
            }
            #[inline(always)]
            fn advance(&mut self, change: $type) {
                Sum::add(self, change);
            }
        }

        impl Scalar for $type {
            type Si = Self;
            type Unit = ();

            const PER_UNIT: bool = false;
            const LARGEST: f64 = f64::INFINITY;
            const LARGEST_GAIN: f64 = f64::INFINITY;

            fn coefficient(x: f64) -> Self {
                x as Self
            }
            fn gain(x: f64) -> Self {
                x as Self
            }
            fn unit(_: f64) {}
            #[inline(always)]
            fn of_si(x: Self, (): ()) -> Self {
                x
            }
            #[inline(always)]
            fn to_si(self, (): ()) -> Self {
                self
            }
            /// One number that is not finite makes their sum so.
            fn sound(values: impl Iterator<Item = Self>) -> bool {
                values.fold(0.0, |sum, x| sum + x).is_finite()
            }
            fn fingerprint(self) -> u32 {
                $fingerprint(self)
            }
        }
    };
}

floating!(f32, Compensated<f32>, f32::to_bits);
floating!(f64, Plain<f64>, |x: f64| {
    let bits = x.to_bits();
    (bits ^ (bits >> 32)) as u32
});

impl Real for f32 {
    type Sum = Compensated<f32>;

    fn of(x: f64) -> Self {
        x as f32
    }
    fn to_f64(self) -> f64 {
        f64::from(self)
    }
    fn of_f32(x: f32) -> Self {
        x
    }
    fn to_f32(self) -> f32 {
        self
    }
    fn sqrt(self) -> Self {
        libm::sqrtf(self)
    }
    fn cos(self) -> Self {
        libm::cosf(self)
    }
    fn of_i32(n: i32) -> Self {
        n as f32
    }
    fn floor_i32(self) -> i32 {
        let toward_zero = self as i32;
        toward_zero.saturating_sub(i32::from(toward_zero as f32 > self))
    }
    fn abs(self) -> Self {
        self.abs()
    }
    fn is_finite(self) -> bool {
        f32::is_finite(self)
    }
}

impl Real for f64 {
    type Sum = Plain<f64>;

    fn of(x: f64) -> Self {
        x
    }
    fn to_f64(self) -> f64 {
        self
    }
    fn of_f32(x: f32) -> Self {
        f64::from(x)
    }
    fn to_f32(self) -> f32 {
        self as f32
    }
    fn sqrt(self) -> Self {
        libm::sqrt(self)
    }
    fn cos(self) -> Self {
        libm::cos(self)
    }
    fn of_i32(n: i32) -> Self {
        n as f64
    }
    fn floor_i32(self) -> i32 {
        let toward_zero = self as i32;
        toward_zero.saturating_sub(i32::from(toward_zero as f64 > self))
    }
    fn abs(self) -> Self {
        self.abs()
    }
    fn is_finite(self) -> bool {
        f64::is_finite(self)
    }
}
