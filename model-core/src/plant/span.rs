//! Web spans: strain and tension between two rolls.
//!
//! Not here: out-of-plane motion, wrinkles, temperature, moisture. Strain is uniform along a span.

use crate::real::Real;

/// The coefficients of all spans, which carry the same web.
#[derive(Clone, Copy, Debug)]
pub struct Spans<R, const SPANS: usize> {
    /// 1/L of each span, 1/m.
    per_length: [R; SPANS],
    /// EA, N.
    stiffness: R,
    /// d = EA·τ_v, N·s.
    viscosity: R,
}

/// Rate of strain and tension of all spans at one instant.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Web<R, const SPANS: usize> {
    /// ε̇, 1/s.
    pub strain_rate: [R; SPANS],
    /// t, N, total across the width.
    pub tension: [R; SPANS],
}

impl<R: Real, const SPANS: usize> Web<R, SPANS> {
    /// No web: no strain moves, nothing pulls.
    pub const NONE: Self = Self {
        strain_rate: [R::ZERO; SPANS],
        tension: [R::ZERO; SPANS],
    };
}

impl<R: Real, const SPANS: usize> Spans<R, SPANS> {
    /// From lengths in m, EA in N and the retardation time in s.
    pub fn new(lengths: [f64; SPANS], stiffness_n: f64, retardation_s: f64) -> Self {
        Self {
            per_length: lengths.map(|l| R::of(1.0 / l)),
            stiffness: R::of(stiffness_n),
            viscosity: R::of(stiffness_n * retardation_s),
        }
    }

    /// The strain at which a span carries the tension, at rest.
    pub fn strain_of(&self, tension: R) -> R {
        tension / self.stiffness
    }

    /// Continuity of mass, exact in the strain, and a Kelvin–Voigt web that cannot push:
    ///
    /// ε̇ = (1/L)·(1+ε)/(1+ε_up)·\[(V − V_up) + V·ε_up − V_up·ε\],  t = max(0, EA·ε + d·ε̇)
    ///
    /// `v_in` is the speed at which the web enters the first span, unstrained; `v` the speeds at the ends of
    /// the spans. A negative strain is slack: a stored loop of length L·|ε|.
    ///
    /// Source: J. J. Shelton, "Dynamics of web tension control with velocity or torque control", ACC 1986, for
    /// the exact form; H. Koç et al., IEEE TCST 10 (2002) 179, figure 3, for its check.
    #[inline(always)]
    pub fn web(&self, v_in: R, v: &[R; SPANS], strain: &[R; SPANS]) -> Web<R, SPANS> {
        let mut web = Web::NONE;
        let (mut v_up, mut strain_up, mut stretch_up) = (v_in, R::ZERO, R::ONE);
        for i in 0..SPANS {
            let stretch = R::ONE + strain[i];
            let flow = (v[i] - v_up) + v[i] * strain_up - v_up * strain[i];
            // the parent roll gives off unstrained web: no division in the first span
            let ratio = if i == 0 {
                stretch
            } else {
                stretch / stretch_up
            };
            web.strain_rate[i] = self.per_length[i] * ratio * flow;
            web.tension[i] =
                (self.stiffness * strain[i] + self.viscosity * web.strain_rate[i]).max(R::ZERO);
            (v_up, strain_up, stretch_up) = (v[i], strain[i], stretch);
        }
        web
    }
}
