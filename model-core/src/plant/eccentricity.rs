//! Rolls that turn about an axis beside their centre.
//!
//! Not here: the changing lever of an eccentric roll, and the force it puts on its bearings.
//!
//! V_surface = ω·\[R + e·cos(θ + φ)\]: the web sees the deviation ω·e·cos(θ + φ). It is taken at the middle of each
//! step and held over it.

use super::rk4::State;
use crate::machine::Machine;
use crate::real::{Arithmetic, Real};

/// Phase from roll to roll, rad: the golden angle, so that no two rolls agree.
const PHASE: f64 = 2.399_963_229_728_653;

/// Deviations of surface speeds, m/s.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Offsets<R, const SPANS: usize> {
    /// Of the parent roll.
    pub uw: R,
    /// Of the roll at the end of each span.
    pub rolls: [R; SPANS],
}

impl<T: Copy, const SPANS: usize> Offsets<T, SPANS> {
    /// The same in other numbers.
    pub fn map<U>(&self, mut f: impl FnMut(T) -> U) -> Offsets<U, SPANS> {
        Offsets {
            uw: f(self.uw),
            rolls: self.rolls.map(f),
        }
    }
}

impl<A: Arithmetic, const SPANS: usize> Offsets<A, SPANS> {
    /// Speeds with their deviations.
    #[inline(always)]
    pub fn added_to(&self, v: &[A; SPANS]) -> [A; SPANS] {
        core::array::from_fn(|i| v[i] + self.rolls[i])
    }
}

/// The eccentric rolls and how far they have turned.
#[derive(Clone, Debug)]
pub struct Eccentricity<R, const SPANS: usize> {
    /// The machine's own rolls are eccentric.
    own: bool,
    present: bool,
    period: R,
    uw: Roll<R>,
    /// The parent roll's own eccentricity, and what has been added to it, m.
    uw_own: R,
    uw_more: R,
    rolls: [Roll<R>; SPANS],
    /// 1/R of the roll at the end of each span, 1/m; zero where it is round.
    per_radius: [R; SPANS],
}

#[derive(Clone, Copy, Debug)]
struct Roll<R> {
    /// e, m.
    eccentricity: R,
    /// θ + φ, within ±π rad.
    angle: R,
}

impl<R: Real> Roll<R> {
    /// The deviation at the middle of a step at ω; turns by the step.
    fn turn(&mut self, omega: R, period: R) -> R {
        let way = omega * period;
        let middle = self.angle + R::of(0.5) * way;
        let (pi, turn) = (R::of(core::f64::consts::PI), R::of(core::f64::consts::TAU));
        let mut angle = self.angle + way;
        if angle > pi {
            angle -= turn;
        } else if angle < -pi {
            angle += turn;
        }
        self.angle = angle;
        omega * self.eccentricity * middle.cos()
    }
}

impl<R: Real, const SPANS: usize> Eccentricity<R, SPANS> {
    /// From the machine's description, in steps of `h` seconds.
    pub fn new(machine: &Machine, h: f64) -> Self {
        let roll = |i: usize, eccentricity: f64| Roll {
            eccentricity: R::of(eccentricity),
            angle: R::of(libm::remainder(PHASE * i as f64, core::f64::consts::TAU)),
        };
        let idle = |i: usize| machine.idle.get(i);
        let parent = machine.parent_roll.eccentricity_m;
        let own = parent > 0.0 || machine.idle.iter().any(|roll| roll.eccentricity_m > 0.0);
        Self {
            own,
            present: own,
            period: R::of(h),
            uw: roll(0, parent),
            uw_own: R::of(parent),
            uw_more: R::ZERO,
            rolls: core::array::from_fn(|i| roll(i + 1, idle(i).map_or(0.0, |r| r.eccentricity_m))),
            per_radius: core::array::from_fn(|i| {
                idle(i).map_or(R::ZERO, |r| R::of(1.0 / r.radius_m))
            }),
        }
    }

    /// Any roll is eccentric.
    pub fn present(&self) -> bool {
        self.present
    }

    /// A parent roll that is eccentric by `more`, m, beside the machine's own.
    pub fn add_to_parent_roll(&mut self, more: R) {
        if more == self.uw_more {
            return;
        }
        self.uw_more = more;
        self.present = self.own || more > R::ZERO;
        self.uw.eccentricity = self.uw_own + more;
    }

    /// The deviations of the step that starts at `x`.
    pub fn turn(&mut self, x: &State<R, SPANS>) -> Offsets<R, SPANS> {
        Offsets {
            uw: self.uw.turn(x.omega_uw, self.period),
            rolls: core::array::from_fn(|i| {
                self.rolls[i].turn(x.v[i] * self.per_radius[i], self.period)
            }),
        }
    }
}
