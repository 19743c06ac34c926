//! The winder in closed form, `f64`, from the machine's description: what the core is held against.
//!
//! Not here: anything taken from the core but the description itself, and the [`Bench`] to run it on.

use std::f64::consts::{PI, TAU};

use model_core::exchange::{Actuators, BySection};
use model_core::machine::{DrivenRoll, Machine};
use model_core::plant::Winder;
use model_core::plant::rk4::State;
use model_core::real::{Real, Ring, Scalar};

/// The plant's step, s.
pub const H: f64 = 0.004;
/// Run speed 2 200 m/min, m/s.
pub const RUN: f64 = 2200.0 / 60.0;

/// EA, N
pub fn stiffness(m: &Machine) -> f64 {
    m.web.stiffness_n_m * m.web.width_m
}

/// t* = full tension, N
pub fn tension(m: &Machine) -> f64 {
    m.operation.tension_n_m * m.web.width_m
}

/// Lengths of the spans, m
pub fn lengths<const SPANS: usize>(m: &Machine) -> [f64; SPANS] {
    assert_eq!(m.idle.len() + 1, SPANS);
    std::array::from_fn(|i| m.idle.get(i).map_or(m.last_span_m, |roll| roll.span_m))
}

/// Number of the span whose tension is measured: it follows the roll on the load cells.
pub fn measured(m: &Machine) -> usize {
    m.load_cells.roll + 1
}

/// ½·π·ρ·W·(R⁴ − r⁴), kg·m²
fn paper(m: &Machine, outer: f64, inner: f64) -> f64 {
    let density = m.web.grammage_kg_m2 / m.web.caliper_m;
    0.5 * PI * density * m.web.width_m * (outer.powi(4) - inner.powi(4))
}

/// J_uw(R) = J_0 + ½·π·ρ·W·(R⁴ − R_spool⁴), kg·m²
pub fn parent_inertia(m: &Machine, r: f64) -> f64 {
    m.parent_roll.spool_inertia_kg_m2 + paper(m, r, m.parent_roll.spool_radius_m)
}

/// J_wu/R², kg
pub fn shipping_mass(m: &Machine, r: f64) -> f64 {
    paper(m, r, m.shipping_roll.core_radius_m) / (r * r)
}

/// J/R² of the idle roll `i`, kg
pub fn idle_mass(m: &Machine, i: usize) -> f64 {
    m.idle[i].inertia_kg_m2 / m.idle[i].radius_m.powi(2)
}

fn driven(m: &Machine) -> [&DrivenRoll; 3] {
    [&m.rear_drum, &m.front_drum, &m.rider_roll]
}

/// M = J_rd/R_rd² + J_fd/R_fd² + J_rr/R_rr² + J_wu/R_wu², kg
pub fn windup_mass(m: &Machine, r_wu: f64) -> f64 {
    let drums: f64 = driven(m)
        .map(|roll| roll.inertia_kg_m2 / roll.radius_m.powi(2))
        .iter()
        .sum();
    drums + shipping_mass(m, r_wu)
}

/// Σ c_j of the windup, N·s/m
pub fn windup_friction(m: &Machine) -> f64 {
    let drums: f64 = driven(m).map(|roll| roll.friction_n_s_m).iter().sum();
    drums + m.shipping_roll.friction_n_s_m
}

/// {1} R_wu after a length: √(R_core² + z·L/π), m
pub fn shipping_radius(m: &Machine, length: f64) -> f64 {
    (m.shipping_roll.core_radius_m.powi(2) + m.web.caliper_m * length / PI).sqrt()
}

/// {4} R_uw after a length: √(R_full² − z·L/π), m
pub fn parent_radius(m: &Machine, length: f64) -> f64 {
    (m.parent_roll.full_radius_m.powi(2) - m.web.caliper_m * length / PI).sqrt()
}

/// A state with all its rates by the equations of motion, and the tensions that go with it.
pub struct Motion<const SPANS: usize> {
    pub rates: State<f64, SPANS>,
    pub tension: [f64; SPANS],
}

/// The equations of motion of the threaded winder, without brakes.
pub fn motion<const SPANS: usize>(
    m: &Machine,
    x: &State<f64, SPANS>,
    torque: &BySection<f64>,
) -> Motion<SPANS> {
    let (ea, lengths) = (stiffness(m), lengths::<SPANS>(m));
    let v_uw = x.omega_uw * x.r_uw;
    // web: d/dt [L/(1+ε)] = V_up/(1+ε_up) − V/(1+ε)
    let stretched = |i: usize| 1.0 + x.strain[i];
    let unstrained = |i: usize| x.v[i] / stretched(i);
    let strain: [f64; SPANS] = std::array::from_fn(|i| {
        let entering = if i == 0 { v_uw } else { unstrained(i - 1) };
        stretched(i).powi(2) / lengths[i] * (unstrained(i) - entering)
    });
    let t: [f64; SPANS] =
        std::array::from_fn(|i| (ea * (x.strain[i] + m.web.retardation_s * strain[i])).max(0.0));
    let idle = |i: usize| (t[i + 1] - t[i] - m.idle[i].friction_n_s_m * x.v[i]) / idle_mass(m, i);
    let v = x.v[SPANS - 1];
    let r_wu = m.web.caliper_m * v / (TAU * x.r_wu);
    let force = torque.rd / m.rear_drum.radius_m
        + torque.fd / m.front_drum.radius_m
        + torque.rr / m.rider_roll.radius_m;
    let growth = shipping_mass(m, x.r_wu) * r_wu / x.r_wu;
    let windup =
        (force - t[SPANS - 1] - (windup_friction(m) - growth) * v) / windup_mass(m, x.r_wu);
    let parent = torque.uw + x.r_uw * (t[0] - m.parent_roll.friction_n_s_m * v_uw);
    Motion {
        rates: State {
            strain,
            v: std::array::from_fn(|i| if i + 1 < SPANS { idle(i) } else { windup }),
            windup: [windup; 3],
            omega_uw: parent / parent_inertia(m, x.r_uw),
            r_uw: -m.web.caliper_m * v_uw / (TAU * x.r_uw),
            r_wu,
        },
        tension: t,
    }
}

/// The winder in steady run: V_rd = `v`, `t` in the measured span, all tensions at rest.
pub fn steady<const SPANS: usize>(
    m: &Machine,
    v: f64,
    t: f64,
    r_uw: f64,
    r_wu: f64,
) -> State<f64, SPANS> {
    let ea = stiffness(m);
    let strain = steady_tensions::<SPANS>(m, v, t).map(|t| t / ea);
    // V/(1+ε) is the same everywhere
    let unstrained = v / (1.0 + strain[SPANS - 1]);
    State {
        strain,
        v: strain.map(|e| unstrained * (1.0 + e)),
        windup: [v; 3],
        omega_uw: unstrained / r_uw,
        r_uw,
        r_wu,
    }
}

/// What each idle roll takes from the tension adds up along the web, from the measured span both ways.
fn tensions<const SPANS: usize>(m: &Machine, t: f64, taken: impl Fn(usize) -> f64) -> [f64; SPANS] {
    let taken = &taken;
    let measured = measured(m);
    std::array::from_fn(|span| {
        let before: f64 = (span..measured).map(taken).sum();
        let after: f64 = (measured..span).map(taken).sum();
        t - before + after
    })
}

/// The idle roll between two spans takes c·V: with lumped rolls t_gr − t_uw = c_gr·V, t_sr − t_gr = c_sr·V
pub fn steady_tensions<const SPANS: usize>(m: &Machine, v: f64, t: f64) -> [f64; SPANS] {
    tensions(m, t, |i| m.idle[i].friction_n_s_m * v)
}

/// Torques that accelerate all surfaces by `a` [m/s²] with `t` in the measured span.
///
/// The parent roll also speeds up as its radius falls, ω̇ = (a − ω·Ṙ)/R, and a growing shipping roll turns slower at
/// one surface speed.
pub fn torques<const SPANS: usize>(
    m: &Machine,
    x: &State<f64, SPANS>,
    t: f64,
    a: f64,
) -> BySection<f64> {
    let idle = |i: usize| m.idle[i].friction_n_s_m * x.v[i] + idle_mass(m, i) * a;
    let t: [f64; SPANS] = tensions(m, t, idle);
    let (t_uw, t_sr) = (t[0], t[SPANS - 1]);
    let (v_uw, v) = (x.omega_uw * x.r_uw, x.v[SPANS - 1]);
    let layer = m.web.caliper_m / TAU;
    let spin_up = (a + layer * x.omega_uw * x.omega_uw) / x.r_uw;
    let parent =
        parent_inertia(m, x.r_uw) * spin_up + x.r_uw * (m.parent_roll.friction_n_s_m * v_uw - t_uw);
    let growth = shipping_mass(m, x.r_wu) * layer * v / x.r_wu.powi(2);
    let windup = windup_mass(m, x.r_wu) * a + (windup_friction(m) - growth) * v + t_sr;
    // shared by the drums as on a real machine; the rider roll idles
    BySection {
        uw: parent,
        rd: 0.45 * windup * m.rear_drum.radius_m,
        fd: 0.55 * windup * m.front_drum.radius_m,
        rr: 0.0,
    }
}

/// What `f32` may be off by, or what `f64` may.
pub fn either<R: Scalar>(single: f64, double: f64) -> f64 {
    if size_of::<R>() == size_of::<f32>() {
        single
    } else {
        double
    }
}

/// A winder under test.
pub struct Bench<R: Scalar, const SPANS: usize = 3> {
    pub machine: Machine,
    pub winder: Winder<R, SPANS>,
}

impl<R: Scalar, const SPANS: usize> Bench<R, SPANS> {
    /// At standstill, not threaded, in steps of [`H`].
    pub fn new(machine: Machine) -> Self {
        Self::with_step(machine, H)
    }

    /// In steps of `h` seconds.
    pub fn with_step(machine: Machine, h: f64) -> Self {
        let winder = Winder::new(&machine, h).unwrap();
        Self { machine, winder }
    }

    /// Threaded, in the state `x`.
    pub fn threaded(machine: Machine, x: &State<f64, SPANS>) -> Self {
        let mut bench = Self::new(machine);
        bench.winder.thread_at(R::Si::ZERO);
        bench.set(x);
        bench
    }

    pub fn set(&mut self, x: &State<f64, SPANS>) {
        self.winder.set_state(&x.map(R::Si::of));
    }

    /// The state as `f64`.
    pub fn x(&self) -> State<f64, SPANS> {
        self.winder.state().map(Real::to_f64)
    }

    /// Way of the rear drum's surface in the last step as `f64`, m.
    pub fn travel(&self) -> f64 {
        self.winder.travel().to_f64()
    }

    /// The tensions as `f64`, N.
    pub fn t(&self) -> [f64; SPANS] {
        self.winder.tension().map(Real::to_f64)
    }

    /// One step with torques.
    pub fn step(&mut self, torque: &BySection<f64>) {
        self.winder.step(&Actuators {
            torque: torque.map(R::Si::of),
            ..Actuators::default()
        });
    }

    /// One step of the machine accelerated by `a` with `t` in the measured span.
    pub fn pull(&mut self, t: f64, a: f64) -> BySection<f64> {
        let torque = torques(&self.machine, &self.x(), t, a);
        self.step(&torque);
        torque
    }
}
