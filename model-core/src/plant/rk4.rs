//! The classical fourth-order Runge–Kutta step, with sums that lose nothing.
//!
//! Not here: step control. The step is the period of the task that calls it.

use crate::real::{Real, Sum};

/// A set of state variables, for every web span one strain and the speed of the roll at its end.
///
/// `T` is a value, a rate, or a running sum.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct State<T, const SPANS: usize> {
    /// Strain of the spans ε, from the unwind on.
    pub strain: [T; SPANS],
    /// Surface speed of the roll at the end of each span, m/s; the last one is the rear drum's, V_rd.
    pub v: [T; SPANS],
    /// Surface speeds of the other rolls of the windup, m/s: front drum, rider roll, shipping roll.
    pub windup: [T; 3],
    /// Angular velocity of the parent roll, rad/s.
    pub omega_uw: T,
    /// Radius of the parent roll, m.
    pub r_uw: T,
    /// Radius of the shipping roll, m.
    pub r_wu: T,
    /// Way of the rear drum's surface, m.
    pub travel: T,
}

impl<T: Copy, const SPANS: usize> State<T, SPANS> {
    /// Applies `f` to every variable.
    #[inline(always)]
    pub fn map<U>(&self, mut f: impl FnMut(T) -> U) -> State<U, SPANS> {
        State {
            strain: self.strain.map(&mut f),
            v: self.v.map(&mut f),
            windup: self.windup.map(&mut f),
            omega_uw: f(self.omega_uw),
            r_uw: f(self.r_uw),
            r_wu: f(self.r_wu),
            travel: f(self.travel),
        }
    }

    /// Applies `f` to every variable of two sets.
    #[inline(always)]
    pub fn zip<U: Copy, V>(
        &self,
        other: &State<U, SPANS>,
        mut f: impl FnMut(T, U) -> V,
    ) -> State<V, SPANS> {
        State {
            strain: core::array::from_fn(|i| f(self.strain[i], other.strain[i])),
            v: core::array::from_fn(|i| f(self.v[i], other.v[i])),
            windup: core::array::from_fn(|i| f(self.windup[i], other.windup[i])),
            omega_uw: f(self.omega_uw, other.omega_uw),
            r_uw: f(self.r_uw, other.r_uw),
            r_wu: f(self.r_wu, other.r_wu),
            travel: f(self.travel, other.travel),
        }
    }

    /// Every variable in a fixed order.
    pub fn iter(&self) -> impl Iterator<Item = T> {
        let rest = [self.omega_uw, self.r_uw, self.r_wu, self.travel];
        let speeds = self.v.into_iter().chain(self.windup);
        self.strain.into_iter().chain(speeds).chain(rest)
    }
}

/// The step's factors.
#[derive(Clone, Copy, Debug)]
pub struct Rk4<R> {
    half: R,
    whole: R,
    sixth: R,
}

impl<R: Real> Rk4<R> {
    /// For a step of `h` seconds.
    pub fn new(h: f64) -> Self {
        Self {
            half: R::of(h / 2.0),
            whole: R::of(h),
            sixth: R::of(h / 6.0),
        }
    }

    /// Advances the sums by x(t + h) = x + h/6·(k1 + 2·k2 + 2·k3 + k4), with `k1` the rates at the start.
    #[inline(always)]
    pub fn step<const SPANS: usize>(
        &self,
        sums: &mut State<R::Sum, SPANS>,
        k1: State<R, SPANS>,
        rates: impl Fn(&State<R, SPANS>) -> State<R, SPANS>,
    ) {
        let x = sums.map(|s| s.value());
        let k2 = rates(&x.zip(&k1, |x, k| x + self.half * k));
        let k3 = rates(&x.zip(&k2, |x, k| x + self.half * k));
        let k4 = rates(&x.zip(&k3, |x, k| x + self.whole * k));
        let outer = k1.zip(&k4, |a, b| a + b);
        let inner = k2.zip(&k3, |a, b| a + b);
        let increment = outer.zip(&inner, |o, i| self.sixth * (o + (i + i)));
        *sums = sums.zip(&increment, |mut sum, increment| {
            sum.add(increment);
            sum
        });
    }
}
