//! The numbers the models compute with, and sums that lose nothing.
//!
//! Not here: units, conversions, transcendental functions. A step uses `+ − × ÷`, comparison, a square
//! root in references and nips, and a cosine where a roll is eccentric. The first are correctly rounded on every
//! machine, the last two come from one library in software, and nothing is fused: the same inputs give the same bits
//! on a PC and on a microcontroller.

use core::fmt::Debug;
use core::ops::{Add, AddAssign, Div, Mul, Neg, Sub, SubAssign};

/// A scalar the winder and its regulators can be computed in.
pub trait Real:
    Copy
    + Debug
    + Default
    + PartialOrd
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
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
    /// What a state of this scalar is summed up in.
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
    /// The bits folded to 32, for comparing trajectories.
    fn fingerprint(self) -> u32;
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
    value: R,
    carry: R,
}

impl<R: Real> Sum<R> for Compensated<R> {
    fn at(value: R) -> Self {
        Self {
            value,
            carry: R::ZERO,
        }
    }
    fn value(&self) -> R {
        self.value
    }
    fn add(&mut self, increment: R) {
        let increment = increment + self.carry;
        let sum = self.value + increment;
        self.carry = increment - (sum - self.value);
        self.value = sum;
    }
}

impl Real for f32 {
    const ZERO: Self = 0.0;
    const ONE: Self = 1.0;
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
    fn is_finite(self) -> bool {
        f32::is_finite(self)
    }
    fn fingerprint(self) -> u32 {
        self.to_bits()
    }
}

impl Real for f64 {
    const ZERO: Self = 0.0;
    const ONE: Self = 1.0;
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
    fn is_finite(self) -> bool {
        f64::is_finite(self)
    }
    fn fingerprint(self) -> u32 {
        let bits = self.to_bits();
        (bits ^ (bits >> 32)) as u32
    }
}
