//! A number for each roll of the winder, in registers of four.
//!
//! Not here: what the numbers mean.

use std::array::from_fn;
use std::ops::{Add, Mul, Sub};

use wide::f64x4;

/// Numbers of a block.
const LANES: usize = 4;

/// A number for each roll in the web's direction, the parent roll first; places without a roll after the last.
#[derive(Clone, Copy, Debug)]
pub struct Row<const BLOCKS: usize>([f64x4; BLOCKS]);

impl<const BLOCKS: usize> Row<BLOCKS> {
    /// Places.
    pub const PLACES: usize = LANES * BLOCKS;
    /// 0 everywhere.
    pub const ZERO: Self = Self([f64x4::ZERO; BLOCKS]);

    /// The same everywhere.
    #[inline(always)]
    pub fn all(x: f64) -> Self {
        Self([f64x4::splat(x); BLOCKS])
    }
    /// What each place has.
    #[inline(always)]
    pub fn each(mut of: impl FnMut(usize) -> f64) -> Self {
        Self(from_fn(|b| {
            f64x4::new(from_fn(|lane| of(LANES * b + lane)))
        }))
    }
    /// The number at a place, which must be there.
    #[inline(always)]
    pub fn at(&self, place: usize) -> f64 {
        self.0[place / LANES].as_array()[place % LANES]
    }
    /// At each place the number of the place before; 0 at the first.
    #[inline(always)]
    pub fn before(self) -> Self {
        Self(from_fn(|b| {
            let [x0, x1, x2, _] = self.0[b].to_array();
            let last = if b == 0 {
                0.0
            } else {
                self.0[b - 1].to_array()[LANES - 1]
            };
            f64x4::new([last, x0, x1, x2])
        }))
    }
    /// At each place the number of the place after; 0 at the last.
    #[inline(always)]
    pub fn after(self) -> Self {
        Self(from_fn(|b| {
            let [_, x1, x2, x3] = self.0[b].to_array();
            let next = self.0.get(b + 1).map_or(0.0, |next| next.to_array()[0]);
            f64x4::new([x1, x2, x3, next])
        }))
    }
    /// 1/x at each place.
    #[inline(always)]
    pub fn reciprocal(self) -> Self {
        Self(self.0.map(|x| f64x4::ONE / x))
    }
    /// |x| at each place.
    #[inline(always)]
    pub fn abs(self) -> Self {
        Self(self.0.map(f64x4::abs))
    }
    /// Every number is above the other's.
    #[inline(always)]
    pub fn is_above(self, other: Self) -> bool {
        let mut blocks = self.0.into_iter().zip(other.0);
        blocks.all(|(x, y)| x.simd_gt(y).all())
    }
    /// No number is above the other's.
    #[inline(always)]
    pub fn is_within(self, other: Self) -> bool {
        let mut blocks = self.0.into_iter().zip(other.0);
        blocks.all(|(x, y)| x.simd_le(y).all())
    }
}

macro_rules! operators {
    ($($trait:ident $method:ident $operator:tt),*) => {$(
        impl<const BLOCKS: usize> $trait for Row<BLOCKS> {
            type Output = Self;
            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                Self(from_fn(|b| self.0[b] $operator other.0[b]))
            }
        }
    )*};
}
operators!(Add add +, Sub sub -, Mul mul *);

#[cfg(test)]
mod tests {
    // places are moved, not computed
    #![allow(clippy::float_cmp)]
    use super::*;

    #[test]
    fn neighbours_are_found_across_blocks() {
        let row = Row::<2>::each(|place| 1.0 + place as f64);
        for place in 0..8 {
            let before = if place == 0 { 0.0 } else { place as f64 };
            let after = if place == 7 { 0.0 } else { 2.0 + place as f64 };
            assert_eq!(row.before().at(place), before);
            assert_eq!(row.after().at(place), after);
        }
    }
}
