//! How fast the web of a machine can swing, and what step that takes.
//!
//! Not here: the transport of strain by the running web, which is slower than any of these modes.

use heapless::Vec;

use crate::machine::{MAX_SPANS, Machine};

/// Largest h·|λ| of a machine that is integrated in one step.
///
/// RK4 is stable up to 2.83 on the imaginary axis and 2.79 on the real one; this is about accuracy, measured against
/// a much finer integration. As long as torques leave the web taut, one step holds the tensions of every preset
/// within 0.04 N, and the speeds of `LAB-300` (h·|λ| = 0.76) within 8e-6 of the largest, of all others 3e-7. A web
/// that comes taut within a step has a bend in its tension, and that costs the order of the method: with both drums
/// at 150 % for a tenth of a second `NEWS-8000` (0.23) is off by 2 N, `LWC-8000` (0.29) by 3 N, and
/// `NEWS-8000-UNLUMPED` (0.72) by 11 N; in steps of a fifth by 0.7 N.
const ONE_STEP: f64 = 0.5;
/// Largest h·|λ| of each of the smaller steps of a machine beyond [`ONE_STEP`]: as good as the lumped machine's.
const SMALLER_STEP: f64 = 0.2;
/// The most steps of integration in one step: what is stiffer than this is no winder.
const MOST_SUBSTEPS: u32 = 1000;

/// Steps of integration that a step of `h` seconds takes so that the fastest mode is followed.
pub fn substeps(machine: &Machine, h: f64) -> u32 {
    let size = h * fastest(machine);
    if size <= ONE_STEP {
        return 1;
    }
    (libm::ceil(size / SMALLER_STEP) as u32).clamp(1, MOST_SUBSTEPS)
}

/// Largest |λ| of the web with all rolls free, rad/s, with the parent roll and the shipping roll at their lightest.
///
/// A mode of ω in the elastic web has λ² + τ_v·ω²·λ + ω² = 0 in the Kelvin–Voigt web: |λ| = ω as long as it
/// swings, and at most τ_v·ω² once it only creeps.
pub fn fastest(machine: &Machine) -> f64 {
    let square = fastest_elastic(machine);
    let half = 0.5 * machine.web.retardation_s * square;
    if half * half > square {
        half + libm::sqrt(half * half - square)
    } else {
        libm::sqrt(square)
    }
}

/// Largest ω² of masses m_i between springs k_i = EA/L_i: the largest eigenvalue of a tridiagonal matrix with
/// diagonal (k_i + k_{i+1})/m_i and squared off-diagonal k_i²/(m_{i−1}·m_i), by bisection on Sturm's sequence.
///
/// Source: W. Barth, R. S. Martin, J. H. Wilkinson, Numer. Math. 9 (1967) 386.
fn fastest_elastic(machine: &Machine) -> f64 {
    let stiffness = machine.web.stiffness_n_m * machine.web.width_m;
    let springs: Vec<f64, MAX_SPANS> = machine
        .idle
        .iter()
        .map(|roll| stiffness / roll.span_m)
        .chain([stiffness / machine.last_span_m])
        .collect();
    let masses = masses(machine);
    let spring = |i: usize| springs.get(i).copied().unwrap_or(0.0);
    let before = |i: usize| if i > 0 { spring(i - 1) } else { 0.0 };
    let diagonal = |i: usize| (before(i) + spring(i)) / masses[i];
    let off_squared = |i: usize| before(i) * before(i) / (masses[i - 1] * masses[i]);
    // all eigenvalues lie below `x` when no term of the sequence is positive
    let all_below = |x: f64| {
        let mut term = diagonal(0) - x;
        (1..masses.len()).all(|i| {
            let above = term < 0.0;
            term = diagonal(i) - x - off_squared(i) / term;
            above
        }) && term < 0.0
    };
    // Gershgorin: an eigenvalue is at most twice the largest diagonal of such a chain, scaled by its masses
    let largest = (0..masses.len()).map(diagonal).fold(0.0, f64::max);
    let (mut low, mut high) = (0.0, 2.0 * largest);
    while high - low > 1e-6 * high {
        let middle = 0.5 * (low + high);
        if all_below(middle) {
            high = middle;
        } else {
            low = middle;
        }
    }
    high
}

/// Masses at the surface: parent roll, idle rolls, windup, kg.
fn masses(machine: &Machine) -> Vec<f64, { MAX_SPANS + 1 }> {
    let roll = &machine.parent_roll;
    let parent = |r: f64| (machine.parent_roll_offset() + machine.web.roll_inertia(r)) / (r * r);
    let lightest = parent(roll.expire_radius_m).min(parent(roll.full_radius_m));
    // where the windup may slip, the rear drum alone meets the web
    let drums = if machine.nips.slip {
        machine.rear_drum.mass_kg()
    } else {
        let drums = [&machine.rear_drum, &machine.front_drum, &machine.rider_roll];
        drums.iter().map(|roll| roll.mass_kg()).sum()
    };
    let idle = machine.idle.iter().map(|roll| roll.mass_kg());
    [lightest].into_iter().chain(idle).chain([drums]).collect()
}
