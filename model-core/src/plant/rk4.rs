//! The classical fourth-order Runge–Kutta step, with sums that lose nothing.
//!
//! Not here: step control. The step is the period of the task that calls it.

use crate::real::{Accumulator, Arithmetic};

/// A set of state variables, for every web span one strain and the speed of the roll at its end.
///
/// `T` is a value, a rate, or a running sum. `APART` of the windup's rolls have speeds of their own: all three other
/// than the rear drum, or, where the windup turns as one body, none.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct State<T, const SPANS: usize, const APART: usize = 3> {
    /// Strain of the spans ε, from the unwind on.
    pub strain: [T; SPANS],
    /// Surface speed of the roll at the end of each span, m/s; the last one is the rear drum's, V_rd.
    pub v: [T; SPANS],
    /// Surface speeds of the other rolls of the windup, m/s: front drum, rider roll, shipping roll.
    pub windup: [T; APART],
    /// Angular velocity of the parent roll, rad/s.
    pub omega_uw: T,
    /// Radius of the parent roll, m.
    pub r_uw: T,
    /// Radius of the shipping roll, m.
    pub r_wu: T,
}

impl<T: Copy, const SPANS: usize, const APART: usize> State<T, SPANS, APART> {
    /// Applies `f` to every variable.
    #[inline(always)]
    pub fn map<U>(&self, mut f: impl FnMut(T) -> U) -> State<U, SPANS, APART> {
        State {
            strain: self.strain.map(&mut f),
            v: self.v.map(&mut f),
            windup: self.windup.map(&mut f),
            omega_uw: f(self.omega_uw),
            r_uw: f(self.r_uw),
            r_wu: f(self.r_wu),
        }
    }

    /// Applies `f` to every variable of two sets.
    #[inline(always)]
    pub fn zip<U: Copy, V>(
        &self,
        other: &State<U, SPANS, APART>,
        mut f: impl FnMut(T, U) -> V,
    ) -> State<V, SPANS, APART> {
        State {
            strain: core::array::from_fn(|i| f(self.strain[i], other.strain[i])),
            v: core::array::from_fn(|i| f(self.v[i], other.v[i])),
            windup: core::array::from_fn(|i| f(self.windup[i], other.windup[i])),
            omega_uw: f(self.omega_uw, other.omega_uw),
            r_uw: f(self.r_uw, other.r_uw),
            r_wu: f(self.r_wu, other.r_wu),
        }
    }

    /// Every variable in a fixed order.
    pub fn iter(&self) -> impl Iterator<Item = T> + use<T, SPANS, APART> {
        let rest = [self.omega_uw, self.r_uw, self.r_wu];
        let speeds = self.v.into_iter().chain(self.windup);
        self.strain.into_iter().chain(speeds).chain(rest)
    }

    /// The same state with other rolls apart.
    pub fn with_apart<const OTHER: usize>(&self, windup: [T; OTHER]) -> State<T, SPANS, OTHER> {
        State {
            strain: self.strain,
            v: self.v,
            windup,
            omega_uw: self.omega_uw,
            r_uw: self.r_uw,
            r_wu: self.r_wu,
        }
    }
}

/// A system of differential equations.
pub trait System<A: Arithmetic, const SPANS: usize, const APART: usize> {
    /// Rates of all variables in a state, for a third of the step.
    fn rates(&self, x: &State<A, SPANS, APART>) -> State<A::Rate, SPANS, APART>;
}

/// Advances the sums by x(t + h) = x + h/6·(k1 + 2·(k2 + k3) + k4), with `k1` the rates at the start; rates come for a
/// third of the step, which weighs those within the step by 1.
///
/// Gives the mean of the last speed over the step. For its integral, the way, the method has h·(v + k1 + k2 + k3) with
/// the k of the speed: no stage needs to compute it.
#[inline(always)]
pub fn advance<A: Arithmetic, const SPANS: usize, const APART: usize>(
    sums: &mut State<A::Sum, SPANS, APART>,
    k1: State<A::Rate, SPANS, APART>,
    system: &impl System<A, SPANS, APART>,
) -> A {
    let last = SPANS - 1;
    let k2 = system.rates(&sums.zip(&k1, |sum, k| sum.after_half(k)));
    // what is added up by now need not be kept through the next rates
    let way = k1.v[last] + k2.v[last];
    let change = k2.zip(&k1, A::with_half);
    let k3 = system.rates(&sums.zip(&k2, |sum, k| sum.after_half(k)));
    let mean = sums.v[last].after_sixth(way + k3.v[last]);
    let change = change.zip(&k3, |a, b| a + b);
    let k4 = system.rates(&sums.zip(&k3, |sum, k| sum.after_whole(k)));
    let change = change.zip(&k4, A::with_half);
    *sums = sums.zip(&change, |mut sum, change| {
        sum.advance(change);
        sum
    });
    mean
}
