//! The winder's motion over a hold, as a Taylor series in time.
//!
//! Not here: when the motion is as smooth as a series wants it.
//!
//! With the mass of web per length q = 1/(1+ε) instead of the strain, the equations of web and rolls are products and
//! sums of their variables, and so each coefficient of their series follows from those before:
//!
//! - L·q̇ = V_up·q_up − V·q, where the parent roll gives off unstrained web: ω·R_uw;
//! - (1+ε)·q = 1, and t = EA·(ε + τ_v·ε̇);
//! - m·V̇ = t_down − t − c·V of the idle rolls, and the like of parent roll and windup;
//! - Ṙ_uw = −(z/2π)·ω, and for the windup's square of the radius (R²)˙ = 2·(z/2π)·V.
//!
//! Mass and inertia of the two rolls of paper change by some millionths in a hold: of them the derivative by the radius
//! is taken and nothing higher. A coefficient costs less than an evaluation of the equations, which has six divisions; a
//! stride has four in all.
//!
//! Source of the method: R. E. Moore, "Interval Analysis", Prentice-Hall 1966, chapter 11.

use std::f64::consts::TAU;

use model_core::machine::Machine;
use model_core::plant::rk4::State;

use crate::row::Row;

/// Order of the series in speeds and strains.
pub const ORDER: usize = 8;
/// Coefficients.
const TERMS: usize = ORDER + 1;

/// What acts over a hold.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Held {
    /// Torque on the parent roll, N·m.
    pub uw: f64,
    /// Force of all motors at the windup's surface, N.
    pub pull: f64,
}

/// The series of one machine for holds of one length, with a block of registers for every four rolls.
#[derive(Clone, Debug)]
pub struct Series<const BLOCKS: usize> {
    /// h, s.
    h: f64,
    spans: usize,
    /// h/L of the spans.
    per_length: Row<BLOCKS>,
    /// EA of the spans, and EA·τ_v/h, N.
    stiffness: Row<BLOCKS>,
    viscosity: Row<BLOCKS>,
    /// Friction c that goes with the speed, N·s/m: of all but the parent roll.
    friction: Row<BLOCKS>,
    /// That of the parent roll, which goes with ω·R_uw.
    friction_uw: Row<BLOCKS>,
    /// h·R²/J of the idle rolls.
    per_mass: Row<BLOCKS>,
    /// −h·z/2π of the parent roll.
    thinning: Row<BLOCKS>,
    /// 1 at the parent roll, and at the windup.
    at_uw: Row<BLOCKS>,
    at_wu: Row<BLOCKS>,
    /// z/2π, m.
    layer: f64,
    /// ½·π·ρ·W, kg/m².
    inertia_factor: f64,
    /// J_0 − ½·π·ρ·W·R_spool⁴, kg·m².
    inertia_offset: f64,
    /// J/R² of drums and rider roll, kg.
    drums: f64,
    /// R_core⁴, m⁴.
    core: f64,
    /// The tension at which the web breaks, N.
    strength: Row<BLOCKS>,
    /// Below 0 where there is no span.
    slack: Row<BLOCKS>,
}

/// What is constant over one hold.
struct Hold<const BLOCKS: usize> {
    /// Change of t with that of L·q̇: −EA·τ_v/h·(1+ε)²·h/L.
    retarded: Row<BLOCKS>,
    /// EA·ε, N.
    elastic: Row<BLOCKS>,
    /// −(1+ε)²
    square: Row<BLOCKS>,
    /// q before each place.
    q_before: Row<BLOCKS>,
    /// h over mass or inertia, times R_uw for the parent roll.
    per_mass: Row<BLOCKS>,
    /// Share that this changes by in an h, by the radii, over the speed.
    per_mass_by_way: Row<BLOCKS>,
    /// What is held, at the surface, N; and how this changes with the parent roll's radius.
    force: Row<BLOCKS>,
    force_by_way: Row<BLOCKS>,
    /// (J_wu/R_wu²)·(Ṙ_wu/R_wu)/V, kg/m; and how this changes in an h.
    growth: Row<BLOCKS>,
    growth_by_way: Row<BLOCKS>,
    /// How the last coefficients of v and q act on the next of v.
    by_v: Chain<BLOCKS>,
    by_q: Chain<BLOCKS>,
}

/// A tridiagonal matrix: what acts on a place from before, from itself, from after.
struct Chain<const BLOCKS: usize> {
    before: Row<BLOCKS>,
    own: Row<BLOCKS>,
    after: Row<BLOCKS>,
}

impl<const BLOCKS: usize> Chain<BLOCKS> {
    #[inline(always)]
    fn on(&self, x: Row<BLOCKS>) -> Row<BLOCKS> {
        self.own * x + (self.before * x.before() + self.after * x.after())
    }
}

/// Coefficients of the series so far, scaled by powers of h.
struct Terms<const BLOCKS: usize> {
    /// Surface speeds; ω for the parent roll.
    v: [Row<BLOCKS>; TERMS],
    /// Mass of web per length; the radius for the parent roll.
    q: [Row<BLOCKS>; TERMS],
    /// 1 + ε; 0 for the parent roll.
    stretch: [Row<BLOCKS>; TERMS],
    /// What (1+ε)·q = 1 makes of smaller coefficients, the last.
    inner: Row<BLOCKS>,
    /// V², the last.
    square: Row<BLOCKS>,
    /// Tensions at the start, N, and most that they leave it by.
    tension: Row<BLOCKS>,
    swing: Row<BLOCKS>,
}

impl<const BLOCKS: usize> Series<BLOCKS> {
    /// Of a machine, for holds of `h` seconds. Nothing where it has more rolls than there are places.
    pub fn new(machine: &Machine, h: f64) -> Option<Self> {
        let spans = machine.idle.len() + 1;
        if spans >= Row::<BLOCKS>::PLACES {
            return None;
        }
        let each_span = |of: &dyn Fn(usize) -> f64, else_: f64| {
            Row::each(|place| match place {
                0 => else_,
                place if place <= spans => of(place - 1),
                _ => else_,
            })
        };
        let at = |wanted: usize| Row::each(move |place| f64::from(u8::from(place == wanted)));
        let stiffness = machine.web.stiffness_n_m * machine.web.width_m;
        let rolls = [&machine.rear_drum, &machine.front_drum, &machine.rider_roll];
        let windup_friction = rolls.iter().map(|roll| roll.friction_n_s_m).sum::<f64>()
            + machine.shipping_roll.friction_n_s_m;
        let layer = machine.web.caliper_m / TAU;
        let core = machine.shipping_roll.core_radius_m;
        let square = core * core;
        let idle = |of: fn(f64, f64) -> f64, windup: f64| {
            let of = move |i: usize| {
                let roll = machine.idle.get(i);
                roll.map_or(windup, |roll| of(roll.mass_kg(), roll.friction_n_s_m))
            };
            each_span(&of, 0.0)
        };
        Some(Self {
            h,
            spans,
            per_length: each_span(&|i| h / machine.span_m(i), 0.0),
            stiffness: each_span(&|_| stiffness, 0.0),
            viscosity: each_span(&|_| stiffness * machine.web.retardation_s / h, 0.0),
            friction: idle(|_, friction| friction, windup_friction),
            friction_uw: at(0) * Row::all(machine.parent_roll.friction_n_s_m),
            per_mass: idle(|mass, _| 1.0 / mass, 0.0) * Row::all(h),
            thinning: at(0) * Row::all(-h * layer),
            at_uw: at(0),
            at_wu: at(spans),
            layer,
            inertia_factor: machine.web.inertia_factor(),
            inertia_offset: machine.parent_roll_offset(),
            drums: machine.windup_mass_kg(core),
            core: square * square,
            strength: Row::all(machine.web.strength_n_m * machine.web.width_m),
            slack: each_span(&|_| 0.0, -1.0),
        })
    }

    /// Where a state leads in a hold. Nothing where the web would be slack on the way, or torn.
    #[inline(always)]
    pub fn advance<const SPANS: usize>(
        &self,
        x: &State<f64, SPANS, 0>,
        held: Held,
    ) -> Option<State<f64, SPANS, 0>> {
        if self.spans != SPANS {
            return None;
        }
        let spread = |of: &dyn Fn(usize) -> f64, first: f64, rest: f64| {
            Row::<BLOCKS>::each(|place| match place {
                0 => first,
                place if place <= SPANS => of(place - 1),
                _ => rest,
            })
        };
        let speeds = spread(&|i| x.v[i], x.omega_uw, 0.0);
        let stretch = spread(&|i| 1.0 + x.strain[i], 1.0, 1.0);
        let strain = spread(&|i| x.strain[i], 0.0, 0.0);
        let (hold, mut terms) = self.start(speeds, strain, stretch, x.r_uw, x.r_wu, held);
        self.order::<0>(&hold, &mut terms);
        self.order::<1>(&hold, &mut terms);
        self.order::<2>(&hold, &mut terms);
        self.order::<3>(&hold, &mut terms);
        self.order::<4>(&hold, &mut terms);
        self.order::<5>(&hold, &mut terms);
        self.order::<6>(&hold, &mut terms);
        self.order::<7>(&hold, &mut terms);
        const { assert!(ORDER == 8, "an order for each coefficient after the first") };

        let (lowest, highest) = (terms.tension - terms.swing, terms.tension + terms.swing);
        if !(lowest.is_above(self.slack) && highest.is_within(self.strength)) {
            return None;
        }
        let (mut v, mut stretch, mut way) = (Row::ZERO, Row::ZERO, Row::ZERO);
        for k in (1..TERMS).rev() {
            // the smallest first
            v = v + terms.v[k];
            stretch = stretch + terms.stretch[k];
            way = way + terms.v[k] * Row::all(1.0 / (k + 1) as f64);
        }
        let way = (way + terms.v[0]) * Row::all(self.h * self.layer);
        let (r_uw, r_wu) = (x.r_uw - way.at(0), x.r_wu);
        Some(State {
            strain: std::array::from_fn(|i| x.strain[i] + stretch.at(i + 1)),
            v: std::array::from_fn(|i| x.v[i] + v.at(i + 1)),
            windup: [],
            omega_uw: x.omega_uw + v.at(0),
            r_uw,
            r_wu: (r_wu * r_wu + 2.0 * way.at(SPANS)).sqrt(),
        })
    }

    #[inline(always)]
    fn start(
        &self,
        v: Row<BLOCKS>,
        strain: Row<BLOCKS>,
        stretch: Row<BLOCKS>,
        r_uw: f64,
        r_wu: f64,
        held: Held,
    ) -> (Hold<BLOCKS>, Terms<BLOCKS>) {
        let (at_uw, at_wu, all) = (self.at_uw, self.at_wu, Row::all);
        // the parent roll: R/J, and its derivative by R as a share
        let square = r_uw * r_uw;
        let paper = self.inertia_factor * (square * square);
        let per_inertia = 1.0 / (self.inertia_offset + paper);
        let per_r = 1.0 / r_uw;
        let uw_by_r = per_r * (1.0 - 4.0 * paper * per_inertia);
        // the windup: 1/M, and its derivative by R² as a share
        let square = r_wu * r_wu;
        let per_square = 1.0 / square;
        let core = self.core * per_square * per_square;
        let hollow = 1.0 - core;
        let per_windup = 1.0 / (self.drums + self.inertia_factor * square * hollow);
        let wu_by_square = -(self.inertia_factor * (1.0 + core)) * per_windup;
        let growth = self.inertia_factor * self.layer;
        // Ṙ_uw and (R_wu²)˙ over the speed, for an h
        let (thin, thicken) = (-self.h * self.layer, 2.0 * self.h * self.layer);

        // the first place of the web's rows is the parent roll's radius
        let web = all(1.0) - at_uw;
        let elongated = stretch * web;
        let squared = elongated * elongated;
        let q = stretch.reciprocal() * web + at_uw * all(r_uw);
        let per_mass = self.per_mass
            + (at_uw * all(self.h * r_uw * per_inertia) + at_wu * all(self.h * per_windup));
        let retarded = Row::ZERO - self.viscosity * squared * self.per_length;
        let springs = Row::ZERO - self.stiffness * squared;
        let growth_by_v = at_wu * all(growth * hollow);
        // a roll between two spans: what flows past it pulls it, and its neighbours
        let after = retarded.after();
        let chain = |x: Row<BLOCKS>, own: Row<BLOCKS>, spring: Row<BLOCKS>| Chain {
            before: Row::ZERO - per_mass * retarded * x.before(),
            own: per_mass * ((after + retarded - self.friction_uw) * x + (own - spring)),
            after: per_mass * (spring.after() - after * x.after()),
        };
        let hold = Hold {
            retarded,
            elastic: self.stiffness * strain,
            square: Row::ZERO - squared,
            q_before: q.before(),
            per_mass_by_way: at_uw * all(uw_by_r * thin) + at_wu * all(wu_by_square * thicken),
            force: at_uw * all(held.uw * per_r) + at_wu * all(held.pull),
            force_by_way: at_uw * all(-(held.uw * per_r * per_r) * thin),
            growth: growth_by_v,
            growth_by_way: at_wu * all(growth * 2.0 * core * per_square * thicken) * v,
            by_v: chain(
                q,
                (growth_by_v + growth_by_v) * v - self.friction,
                Row::ZERO,
            ),
            by_q: chain(v, Row::ZERO, springs),
            per_mass,
        };
        let zero = [Row::ZERO; TERMS];
        let mut terms = Terms {
            v: zero,
            q: zero,
            stretch: zero,
            inner: Row::ZERO,
            square: Row::ZERO,
            tension: Row::ZERO,
            swing: Row::ZERO,
        };
        terms.v[0] = v;
        terms.q[0] = q;
        terms.stretch[0] = elongated;
        (hold, terms)
    }

    /// The coefficients of t^(K+1) from those up to t^K.
    ///
    /// What the newest of them add is linear, and taken by itself: each order waits for the one before, and so it waits
    /// for little.
    #[inline(always)]
    fn order<const K: usize>(&self, hold: &Hold<BLOCKS>, terms: &mut Terms<BLOCKS>) {
        let next = Row::all((K + 1) as f64);
        let per_next = Row::all(1.0 / (K + 1) as f64);
        let (v, q, stretch) = (&terms.v, &terms.q, &terms.stretch);

        // what flows past each roll, V·q, of smaller coefficients; and what stays in each span
        let mut smaller = Row::ZERO;
        for j in 1..K {
            smaller = smaller + v[j] * q[K - j];
        }
        let smaller_stays = smaller.before() - smaller;
        let mut stays = v[K].before() * hold.q_before - v[K] * q[0];
        if K > 0 {
            let by_q = v[0] * q[K];
            stays = (smaller_stays + (by_q.before() - by_q)) + stays;
        }
        // (1+ε)·q = 1: of the next coefficient, what does not come from the next of q
        let mut inner = Row::ZERO;
        for j in 1..=K {
            inner = inner + stretch[j] * q[K + 1 - j];
        }
        let inner = stretch[0] * inner;
        let retarded = self.viscosity * next * inner;
        let q_next = (self.per_length * stays + self.thinning * v[K]) * per_next;

        // V² by halves
        let mut square = Row::ZERO;
        for j in 1..K.div_ceil(2) {
            square = square + v[j] * v[K - j];
        }
        square = square + square;
        if K > 0 && K.is_multiple_of(2) {
            square = square + v[K / 2] * v[K / 2];
        }

        let elastic = if K == 0 {
            hold.elastic
        } else {
            self.stiffness * stretch[K]
        };
        let tension = hold.retarded * stays + (elastic - retarded);
        let change = if K == 0 {
            let square = v[0] * v[0];
            let drag = self.friction * v[0] + self.friction_uw * v[0] * q[0];
            let force = (tension.after() - tension) + (hold.growth * square - drag);
            terms.square = square;
            hold.per_mass * (force + hold.force)
        } else {
            let tension = hold.retarded * smaller_stays - (self.stiffness * terms.inner + retarded);
            let mut force = (tension.after() - tension)
                + (hold.growth * square - self.friction_uw * smaller)
                + hold.growth_by_way * terms.square;
            // the radii's own series, of which two coefficients are felt
            if K <= 2 {
                force = force + hold.force_by_way * v[K - 1] * Row::all(1.0 / K as f64);
            }
            let mut share = v[0] * v[K] * Row::all(K as f64);
            if K >= 2 {
                share = share + v[1] * v[K - 1] * Row::all(0.5 * (K - 1) as f64);
            }
            terms.square = square + (v[0] + v[0]) * v[K];
            (hold.per_mass * force + (hold.per_mass_by_way * share + hold.by_q.on(q[K])))
                + hold.by_v.on(v[K])
        };

        let stretch_next = hold.square * q_next - inner;
        if K == 0 {
            terms.tension = tension;
        } else {
            terms.swing = terms.swing + tension.abs();
        }
        terms.v[K + 1] = change * per_next;
        terms.q[K + 1] = q_next;
        terms.stretch[K + 1] = stretch_next;
        terms.inner = inner;
    }
}
