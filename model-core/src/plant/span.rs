//! Web spans: strain and tension between two rolls.
//!
//! Not here: out-of-plane motion, wrinkles, temperature, moisture. Strain is uniform along a span.

use super::units::Machines;
use crate::machine::Machine;
use crate::real::Arithmetic;

/// The coefficients of all spans, which carry the same web.
#[derive(Clone, Copy, Debug)]
pub struct Spans<A: Arithmetic, const SPANS: usize> {
    /// h/3·1/L of each span.
    per_length: [A::Gain; SPANS],
    /// EA, N.
    stiffness: A,
    /// The share of it that a tension before it is limited to pull wants …
    elastic: A,
    /// … and that of d/L = EA·τ_v/L of each span, N·s/m.
    viscous: [A; SPANS],
}

/// Change of strain and tension of all spans at one instant.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Web<A: Arithmetic, const SPANS: usize> {
    /// ε̇, for a third of a step.
    pub strain_rate: [A::Rate; SPANS],
    /// t, N, total across the width.
    pub tension: [A; SPANS],
}

impl<A: Arithmetic, const SPANS: usize> Web<A, SPANS> {
    /// No web: no strain moves, nothing pulls.
    #[inline(always)]
    pub fn none() -> Self {
        Self {
            strain_rate: [A::no_rate(); SPANS],
            tension: [A::ZERO; SPANS],
        }
    }
}

impl<A: Arithmetic, const SPANS: usize> Spans<A, SPANS> {
    /// From the machines' description, for steps of `h` seconds.
    pub fn new(machines: &impl Machines<A>, h: f64) -> Self {
        let stiffness = |m: &Machine| m.web.stiffness_n_m * m.web.width_m;
        Self {
            per_length: core::array::from_fn(|i| {
                machines.gain(|m, u| h / 3.0 * u.speed / (m.span_m(i) * u.strain))
            }),
            stiffness: machines.coefficient(|m, u| stiffness(m) * u.strain / u.force),
            elastic: machines
                .coefficient(|m, u| A::POSITIVE_OF * stiffness(m) * u.strain / u.force),
            viscous: core::array::from_fn(|i| {
                let viscosity = |m: &Machine| stiffness(m) * m.web.retardation_s / m.span_m(i);
                machines.coefficient(|m, u| A::POSITIVE_OF * viscosity(m) * u.speed / u.force)
            }),
        }
    }

    /// The strain at which a span carries the tension, at rest.
    pub fn strain_of(&self, tension: A) -> A {
        tension.over(self.stiffness)
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
    pub fn web(&self, v_in: A, v: &[A; SPANS], strain: &[A; SPANS]) -> Web<A, SPANS> {
        let mut web = Web::none();
        let (mut v_up, mut strain_up, mut stretch_up) = (v_in, A::ZERO, A::ONE);
        for i in 0..SPANS {
            let stretch = A::stretch(strain[i]);
            let (draw, less) = (v[i] - v_up, v_up.strained(strain[i]));
            // L·ε̇; the parent roll gives off unstrained web
            let flow = if i == 0 {
                (draw - less) * stretch
            } else {
                (draw + (v[i].strained(strain_up) - less)) * stretch.over(stretch_up)
            };
            web.strain_rate[i] = flow.rate(self.per_length[i]);
            web.tension[i] = (strain[i].elastic(self.elastic) + self.viscous[i] * flow).positive();
            (v_up, strain_up, stretch_up) = (v[i], strain[i], stretch);
        }
        web
    }
}
