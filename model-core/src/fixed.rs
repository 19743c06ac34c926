//! Fixed-point numbers, for a controller without a floating-point unit.
//!
//! Not here: equations. They are the same for every number, see [`crate::real`].
//!
//! The motion is computed in [`Word`]s, 32-bit per-unit numbers whose changes are summed up in 64 bits; everything
//! else in [`Wide`], 64-bit numbers in SI. A product of words is one instruction of the core and a shift. There is no
//! division: a reciprocal comes from 16 bits of quotient, which any core has an instruction for, and one step of
//! Newton's method. What is beyond the range of a number is as large as it can be; nothing wraps into the opposite.

use core::fmt;
use core::ops::{Add, AddAssign, Div, Mul, Neg, Sub, SubAssign};

use fixed::types::{I4F28, I32F32};

use crate::real::{Accumulator, Arithmetic, Plain, Real, Ring, Scalar};

/// Fractional bits of a word: it reaches from −8 to 8.
const WORD_BITS: u32 = I4F28::FRAC_NBITS;
/// Fractional bits of a sum beyond those of a word.
const FINER_BITS: u32 = 28;
/// A unit of strain is so many bits less than 1: 1/8, see [`crate::plant::units`].
const STRAIN_BITS: u32 = 3;
const STRAINED_BITS: u32 = WORD_BITS + STRAIN_BITS;
/// What comes from outside is at most half of what a word can hold, and so is a sound state: intermediate sums have
/// the other half.
const LARGEST_INPUT: i32 = 4 << WORD_BITS;
/// Largest shift of a [`Gain`] as it is made; a quotient may take three more.
const LARGEST_SHIFT: u32 = 28;

/// A per-unit number with 28 fractional bits.
#[derive(Clone, Copy, Default, PartialEq, Eq, PartialOrd, Ord)]
pub struct Word(I4F28);

/// A factor m·2^−(28 + s) from a word to the change of a sum.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Gain {
    mantissa: i32,
    shift: u32,
}

/// A change of a sum, 56 fractional bits.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Change(i64);

/// A sum of changes, 56 fractional bits. It stands half a word's last bit too high, so that cutting it off rounds it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Total(i64);

/// The size of a unit in SI, and its reciprocal as r·2^(places − 31), r a number of 31 bits.
#[derive(Clone, Copy, Debug)]
pub struct Unit {
    size: Wide,
    reciprocal: u32,
    places: i32,
}

impl Word {
    const fn bits(self) -> i32 {
        self.0.to_bits()
    }
    const fn from_bits(bits: i32) -> Self {
        Self(I4F28::from_bits(bits))
    }
}

impl fmt::Debug for Word {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Debug::fmt(&self.0, f)
    }
}

/// The 32 bits of a product or a sum from bit `SHIFT` on, for a shift below 32. Taken from its halves: so the compiler
/// sees that it is a number of 32 bits, and multiplies it by one instruction.
#[inline(always)]
const fn cut<const SHIFT: u32>(x: i64) -> i32 {
    let (low, high) = (x as u32, (x >> 32) as u32);
    (low >> SHIFT | high << (32 - SHIFT)) as i32
}

/// x·y/2^SHIFT, to the nearest.
#[inline(always)]
const fn product<const SHIFT: u32>(x: i32, y: i32) -> i32 {
    cut::<SHIFT>(x as i64 * y as i64 + (1 << (SHIFT - 1)))
}

/// y and s with 1/x = y·2^(s − 61), y a number of 30 bits and s the leading zeros of x, for x > 0; anything else
/// counts as 1. The relative error is below 2^−29.
///
/// With n = x·2^s and the quotient q = 2^31/(n/2^16) of 16 bits, 1/n is q·2^−47·(1 + e/2^47), e = 2^47 − n·q.
#[inline(always)]
const fn reciprocal(x: i32) -> (i32, u32) {
    let x = if x > 0 { x as u32 } else { 1 };
    let leading = x.leading_zeros();
    let n = x << leading;
    // n/2^16, to the nearest; it may become 2^16
    let upper = (n >> 16 | 1 << 15) + (n >> 15 & 1);
    let quotient = ((1 << 31) + (upper >> 1)) / upper;
    let error = (1_i64 << 47) - (n as i64 * quotient as i64);
    let correction = cut::<30>(quotient as i64 * cut::<3>(error) as i64);
    ((quotient << 14) as i32 + correction, leading)
}

impl Add for Word {
    type Output = Self;
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        Self(self.0.wrapping_add(other.0))
    }
}
impl Sub for Word {
    type Output = Self;
    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        Self(self.0.wrapping_sub(other.0))
    }
}
impl Mul for Word {
    type Output = Self;
    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        Self::from_bits(product::<WORD_BITS>(self.bits(), other.bits()))
    }
}
impl Neg for Word {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        Self(self.0.wrapping_neg())
    }
}
impl AddAssign for Word {
    #[inline(always)]
    fn add_assign(&mut self, other: Self) {
        *self = *self + other;
    }
}
impl SubAssign for Word {
    #[inline(always)]
    fn sub_assign(&mut self, other: Self) {
        *self = *self - other;
    }
}
impl Ring for Word {
    const ZERO: Self = Self(I4F28::ZERO);
    const ONE: Self = Self(I4F28::ONE);
}

impl Add for Change {
    type Output = Self;
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        Self(self.0.wrapping_add(other.0))
    }
}

impl Arithmetic for Word {
    type Gain = Gain;
    type Rate = Change;
    type Sum = Total;

    const POSITIVE_OF: f64 = 1.0;

    #[inline(always)]
    fn positive(self) -> Self {
        let bits = self.bits();
        Self::from_bits(bits & !(bits >> 31))
    }
    #[inline(always)]
    fn stretch(strain: Self) -> Self {
        Self::ONE + Self::from_bits(strain.bits() >> STRAIN_BITS)
    }
    #[inline(always)]
    fn strained(self, strain: Self) -> Self {
        Self::from_bits(product::<STRAINED_BITS>(self.bits(), strain.bits()))
    }
    /// Force is counted in the elastic force of the unit of strain.
    #[inline(always)]
    fn elastic(self, _: Self) -> Self {
        self
    }
    #[inline(always)]
    fn over(self, divisor: Self) -> Self {
        let (reciprocal, leading) = reciprocal(divisor.bits());
        // x/y = x·r·2^(leading + 28 − 61), and leading is at most 31
        let quotient = self.bits() as i64 * reciprocal as i64;
        Self::from_bits((quotient >> 2 >> ((31 - leading) & 31)) as i32)
    }
    #[inline(always)]
    fn gain_over(gain: Gain, divisor: Self) -> Gain {
        let (reciprocal, leading) = reciprocal(divisor.bits());
        Gain {
            mantissa: cut::<30>(gain.mantissa as i64 * reciprocal as i64),
            // of a divisor of 1 three bits lead
            shift: (gain.shift + 3).saturating_sub(leading),
        }
    }
    #[inline(always)]
    fn rate(self, gain: Gain) -> Change {
        Change((self.bits() as i64 * gain.mantissa as i64) >> (gain.shift & 31))
    }
    #[inline(always)]
    fn no_rate() -> Change {
        Change(0)
    }
    #[inline(always)]
    fn with_half(Change(change): Change, Change(other): Change) -> Change {
        Change(change.wrapping_add(other >> 1))
    }
}

impl Total {
    #[inline(always)]
    const fn word(sum: i64) -> Word {
        Word::from_bits(cut::<FINER_BITS>(sum))
    }
}

impl Accumulator<Word> for Total {
    fn at(value: Word) -> Self {
        Self(((value.bits() as i64) << FINER_BITS) + (1 << (FINER_BITS - 1)))
    }
    #[inline(always)]
    fn value(&self) -> Word {
        Self::word(self.0)
    }
    #[inline(always)]
    fn after_sixth(&self, Change(third): Change) -> Word {
        Self::word(self.0.wrapping_add(third >> 1))
    }
    #[inline(always)]
    fn after_half(&self, Change(third): Change) -> Word {
        Self::word(self.0.wrapping_add(third.wrapping_mul(3) >> 1))
    }
    #[inline(always)]
    fn after_whole(&self, Change(third): Change) -> Word {
        Self::word(self.0.wrapping_add(third.wrapping_mul(3)))
    }
    #[inline(always)]
    fn advance(&mut self, Change(change): Change) {
        self.0 = self.0.wrapping_add(change);
    }
}

impl Scalar for Word {
    type Si = Wide;
    type Unit = Unit;

    const PER_UNIT: bool = true;
    const LARGEST: f64 = 8.0;
    const LARGEST_GAIN: f64 = 8.0;

    fn coefficient(x: f64) -> Self {
        Self(I4F28::saturating_from_num(x))
    }

    fn gain(x: f64) -> Gain {
        let mut shift = 0;
        let mut mantissa = x * f64::from(1 << WORD_BITS);
        // as many significant bits as the mantissa has room for
        while shift < LARGEST_SHIFT && mantissa.abs() < f64::from(1 << 30) {
            mantissa *= 2.0;
            shift += 1;
        }
        Gain {
            mantissa: libm::round(mantissa) as i32,
            shift,
        }
    }

    fn unit(size: f64) -> Unit {
        let (fraction, places) = libm::frexp(1.0 / size);
        Unit {
            size: Wide::of(size),
            reciprocal: (fraction * f64::from(1_u32 << 31)) as u32,
            places,
        }
    }

    fn of_si(x: Wide, unit: Unit) -> Self {
        let ((high, low), reciprocal) = (x.halves(), u64::from(unit.reciprocal));
        // x/size·2^−places with 31 fractional bits
        let quotient = high * reciprocal as i64 + ((low * reciprocal) >> 32) as i64;
        let shift = 31 - WORD_BITS as i32 - unit.places;
        let bits = if shift > 0 {
            (quotient + (1 << (shift - 1))) >> shift
        } else {
            quotient.saturating_mul(1 << -shift)
        };
        let largest = i64::from(LARGEST_INPUT);
        Self::from_bits(bits.clamp(-largest, largest) as i32)
    }

    #[inline]
    fn to_si(self, unit: Unit) -> Wide {
        let (high, low) = unit.size.halves();
        let bits = self.bits() as i64;
        let above = (bits * high) << (I32F32::FRAC_NBITS - WORD_BITS);
        Wide::from_bits(above + ((bits * low as i64) >> WORD_BITS))
    }

    /// Within ±4: the sign and the bit below it are the same.
    fn sound(values: impl Iterator<Item = Self>) -> bool {
        values.fold(0, |differs, x| differs | (x.bits() ^ (x.bits() << 1))) >= 0
    }

    fn fingerprint(self) -> u32 {
        self.bits() as u32
    }
}

/// A number in SI with 32 integer and 32 fractional bits.
#[derive(Clone, Copy, Default, PartialEq, Eq, PartialOrd, Ord)]
pub struct Wide(I32F32);

impl Wide {
    const fn bits(self) -> i64 {
        self.0.to_bits()
    }
    const fn from_bits(bits: i64) -> Self {
        Self(I32F32::from_bits(bits))
    }
    /// The upper word, signed, and the lower.
    const fn halves(self) -> (i64, u64) {
        let bits = self.bits();
        (bits >> 32, bits as u32 as u64)
    }
    const fn saturated(negative: bool) -> Self {
        Self(if negative { I32F32::MIN } else { I32F32::MAX })
    }
}

/// As a decimal number.
impl fmt::Debug for Wide {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Debug::fmt(&self.to_f64(), f)
    }
}

impl Add for Wide {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        Self(self.0.saturating_add(other.0))
    }
}
impl Sub for Wide {
    type Output = Self;
    fn sub(self, other: Self) -> Self {
        Self(self.0.saturating_sub(other.0))
    }
}
impl Neg for Wide {
    type Output = Self;
    fn neg(self) -> Self {
        Self(self.0.saturating_neg())
    }
}
impl AddAssign for Wide {
    fn add_assign(&mut self, other: Self) {
        *self = *self + other;
    }
}
impl SubAssign for Wide {
    fn sub_assign(&mut self, other: Self) {
        *self = *self - other;
    }
}

/// To the nearest. The four products of the halves, which a core of 32 bits multiplies each in an instruction.
impl Mul for Wide {
    type Output = Self;
    fn mul(self, other: Self) -> Self {
        let ((a, a_low), (b, b_low)) = (self.halves(), other.halves());
        let (left, right) = (a * b_low as i64, b * a_low as i64);
        let half = 1 << 31;
        let low = ((a_low * b_low + half) >> 32) + (left as u32 as u64) + (right as u32 as u64);
        let high = a * b + (left >> 32) + (right >> 32) + (low >> 32) as i64;
        if high as i32 as i64 == high {
            Self::from_bits((high << 32) | (low as u32 as i64))
        } else {
            Self::saturated(high < 0)
        }
    }
}

/// To 58 bits of the quotient at the least. A quotient by zero is as large as can be.
impl Div for Wide {
    type Output = Self;
    fn div(self, divisor: Self) -> Self {
        let negative = (self < Self::ZERO) != (divisor < Self::ZERO);
        let (x, y) = (self.bits().unsigned_abs(), divisor.bits().unsigned_abs());
        if y == 0 {
            return Self::saturated(negative);
        }
        let leading = y.leading_zeros();
        let n = y << leading;
        // 2^93/n to 29 bits, and by a step of Newton's method 2^125/n to 58
        let (rough, _) = reciprocal((n >> 33) as i32);
        let error = (1_i128 << 93) - i128::from(n) * i128::from(rough);
        let correction = (i64::from(rough) * ((error >> 33) as i64)) >> 28;
        let fine = (i64::from(rough) << 32) + correction;
        // x/y = x·fine·2^(leading − 125), with 32 fractional bits
        let product = u128::from(x) * u128::from(fine as u64);
        let shift = 93 - leading;
        let quotient = (product + (1 << (shift - 1))) >> shift;
        match i64::try_from(quotient) {
            Ok(bits) => Self::from_bits(if negative { -bits } else { bits }),
            Err(_) => Self::saturated(negative),
        }
    }
}

impl Ring for Wide {
    const ZERO: Self = Self(I32F32::ZERO);
    const ONE: Self = Self(I32F32::ONE);
}

impl Real for Wide {
    type Sum = Plain<Self>;

    fn of(x: f64) -> Self {
        if x.is_nan() {
            return Self::ZERO;
        }
        Self(I32F32::saturating_from_num(x))
    }
    fn to_f64(self) -> f64 {
        self.0.to_num()
    }
    fn of_f32(x: f32) -> Self {
        Self::of(f64::from(x))
    }
    fn to_f32(self) -> f32 {
        self.0.to_num()
    }
    /// To 31 bits; of a negative number, 0.
    fn sqrt(self) -> Self {
        if self <= Self::ZERO {
            return Self::ZERO;
        }
        let bits = self.bits() as u64;
        // an even number of places, so that the root moves by half of it
        let places = bits.leading_zeros() & !1;
        let root = (bits << places).isqrt();
        Self::from_bits(((root << 16) >> (places / 2)) as i64)
    }
    fn cos(self) -> Self {
        Self::of_f32(libm::cosf(self.to_f32()))
    }
    fn of_i32(n: i32) -> Self {
        Self(I32F32::from_num(n))
    }
    fn floor_i32(self) -> i32 {
        (self.bits() >> 32) as i32
    }
    fn is_finite(self) -> bool {
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn word(x: f64) -> Word {
        Word::coefficient(x)
    }
    fn value(x: Word) -> f64 {
        x.0.to_num()
    }

    /// The last bit of a wide number.
    const WIDE_BIT: f64 = 1.0 / (1_u64 << 32) as f64;
    /// Half of the last bit of a word.
    const HALF: f64 = 1.0 / (1_u64 << 29) as f64;

    proptest! {
        #[test]
        fn products_and_quotients_of_words_are_the_nearest(x in -2.0..2.0, y in 0.02..2.0) {
            let (a, b) = (word(x), word(y));
            prop_assert!((value(a * b) - value(a) * value(b)).abs() <= HALF);
            let (exact, quotient) = (value(a) / value(b), value(a.over(b)));
            if exact.abs() < 7.9 {
                prop_assert!((quotient - exact).abs() <= 4.0 * HALF + exact.abs() * 2.0 * HALF);
            }
            let strained = value(a.strained(b));
            prop_assert!((strained - value(a) * value(b) / 8.0).abs() <= HALF);
        }

        #[test]
        fn changes_keep_thirty_bits(x in -2.0..2.0, exponent in -24.0..2.0, y in 0.05..2.0) {
            let gain: f64 = 2.0_f64.powf(exponent);
            let (x, y) = (word(x), word(y));
            let scale = (1_u64 << 56) as f64;
            let exact = value(x) * gain;
            let Change(change) = x.rate(Word::gain(gain));
            prop_assert!((change as f64 / scale - exact).abs() <= 1e-9 * exact.abs() + 2.0 / scale);
            if gain / value(y) < 4.0 {
                let Change(change) = x.rate(Word::gain_over(Word::gain(gain), y));
                let exact = exact / value(y);
                let error = (change as f64 / scale - exact).abs();
                prop_assert!(error <= 4e-9 * exact.abs() + 2.0 / scale, "{error}");
            }
        }

        #[test]
        fn wide_numbers_compute_as_f64_does(x in -4e4..4e4, y in -4e4..4e4) {
            let (a, b) = (Wide::of(x), Wide::of(y));
            let (x, y) = (a.to_f64(), b.to_f64());
            prop_assert!(((a * b).to_f64() - x * y).abs() <= WIDE_BIT + (x * y).abs() * 1e-15);
            if y.abs() > 1e-3 {
                let exact = x / y;
                prop_assert!(((a / b).to_f64() - exact).abs() <= WIDE_BIT + exact.abs() * 1e-15);
            }
            let root = x.abs().sqrt();
            prop_assert!((Wide::of(x.abs()).sqrt().to_f64() - root).abs() <= root * 1e-9 + 2.0 * WIDE_BIT);
        }

        #[test]
        fn nothing_from_outside_turns_over(x in any::<f64>(), y in any::<f64>()) {
            let (a, b) = (Wide::of(x), Wide::of(y));
            let (x, y) = (a.to_f64(), b.to_f64());
            for (wide, sign) in [(a * b, x * y), (a / b, x / y), (a + b, x + y)] {
                prop_assert!(wide.to_f64() * sign >= 0.0 || sign.is_nan(), "{x} {y}: {wide:?}");
            }
            let unit = Word::unit(390e3);
            prop_assert!(value(Word::of_si(a, unit)).abs() <= 4.0);
        }
    }

    #[test]
    fn units_convert_both_ways() {
        for size in [0.01, 0.125, 0.208, 1.5, 52.1, 260e3, 390e3] {
            let unit = Word::unit(size);
            for part in [0.0, 1e-3, 0.3, -0.8, 3.9] {
                let si = Wide::of(part * size);
                let back = Word::of_si(si, unit).to_si(unit).to_f64();
                assert!(
                    (back - part * size).abs() <= 4.0 * HALF * size + 3.0 * WIDE_BIT,
                    "{part} of {size}"
                );
            }
        }
    }
}
