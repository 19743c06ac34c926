//! The smooth winder of three spans, written out for the peers: what `c/plant.h` is in C.

/// Where in the state strains and surface speeds begin, and the places of the others.
const SPEED: usize = 3;
const OMEGA_UW: usize = 6;
const R_UW: usize = 7;
const R_WU: usize = 8;
pub const STATES: usize = 9;

/// Coefficients; see `c/plant.h` for their units.
#[derive(Clone, Copy, Debug, Default)]
pub struct Plant {
    pub per_length: [f64; 3],
    pub stiffness: f64,
    pub viscosity: [f64; 3],
    pub per_mass: [f64; 2],
    pub friction: [f64; 2],
    pub uw_inertia: f64,
    pub uw_offset: f64,
    pub uw_friction: f64,
    pub layer: f64,
    pub core: f64,
    pub drums: f64,
    pub windup_friction: f64,
}

/// What is held.
#[derive(Clone, Copy, Debug, Default)]
pub struct Load {
    pub uw: f64,
    pub pull: f64,
}

impl Plant {
    #[inline(always)]
    pub fn rates(&self, load: &Load, x: &[f64; STATES], dx: &mut [f64; STATES]) {
        let (r_uw, r_wu, v_rd) = (x[R_UW], x[R_WU], x[SPEED + 2]);
        let v_uw = x[OMEGA_UW] * r_uw;
        let mut t = [0.0; 3];
        let (mut v_up, mut strain_up, mut stretch_up) = (v_uw, 0.0, 1.0);
        for i in 0..3 {
            let (strain, v) = (x[i], x[SPEED + i]);
            let stretch = 1.0 + strain;
            let draw = (v - v_up) + (v * strain_up - v_up * strain);
            let flow = if i == 0 {
                draw * stretch
            } else {
                draw * stretch / stretch_up
            };
            dx[i] = flow * self.per_length[i];
            t[i] = (self.stiffness * strain + self.viscosity[i] * flow).max(0.0);
            (v_up, strain_up, stretch_up) = (v, strain, stretch);
        }
        for i in 0..2 {
            let force = t[i + 1] - t[i] - self.friction[i] * x[SPEED + i];
            dx[SPEED + i] = force * self.per_mass[i];
        }
        let kappa = self.core / r_wu;
        let hollow = 1.0 - (kappa * kappa) * (kappa * kappa);
        let mass = self.uw_inertia * (r_wu * r_wu) * hollow;
        let growth = self.uw_inertia * self.layer * v_rd * hollow;
        let drag = (self.windup_friction - growth) * v_rd;
        dx[SPEED + 2] = (load.pull - t[2] - drag) / (self.drums + mass);
        dx[R_WU] = self.layer * v_rd / r_wu;
        let square = r_uw * r_uw;
        let inertia = self.uw_offset + self.uw_inertia * (square * square);
        dx[OMEGA_UW] = (load.uw + (t[0] - self.uw_friction * v_uw) * r_uw) / inertia;
        dx[R_UW] = -self.layer * x[OMEGA_UW];
    }
}
