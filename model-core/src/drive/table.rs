//! A quantity over a diameter, linear between its points and constant beyond their ends.
//!
//! Not here: which quantities; the machine's description has their points.

use crate::real::Real;

/// `N` is the most points.
#[derive(Clone, Copy, Debug)]
pub struct Table<R, const N: usize> {
    /// Diameter, value, and slope to the next point.
    points: [(R, R, R); N],
    used: usize,
}

impl<R: Real, const N: usize> Table<R, N> {
    /// From points whose diameters do not fall; what is more than `N` is left out.
    pub fn new(points: impl Iterator<Item = (f64, f64)> + Clone) -> Self {
        let mut table = Self {
            points: [(R::ZERO, R::ZERO, R::ZERO); N],
            used: 0,
        };
        let next = points.clone().skip(1).map(Some).chain([None]);
        for (point, ((x, y), next)) in table.points.iter_mut().zip(points.zip(next)) {
            let slope = match next {
                Some((x_next, y_next)) if x_next > x => (y_next - y) / (x_next - x),
                _ => 0.0,
            };
            *point = (R::of(x), R::of(y), R::of(slope));
            table.used += 1;
        }
        table
    }

    /// The value at a diameter; zero of an empty table.
    pub fn at(&self, d: R) -> R {
        let mut value = self.points.first().map_or(R::ZERO, |point| point.1);
        for (from, at_from, slope) in &self.points[..self.used] {
            if d < *from {
                break;
            }
            value = *at_from + *slope * (d - *from);
        }
        value
    }
}
