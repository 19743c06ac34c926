/* The smooth winder of three spans, as one would write it in C: nine states, torques held.
 *
 * Not here: brakes, slip, a web that breaks. The equations are those of docs/physics.md. */
#ifndef PLANT_H
#define PLANT_H

enum { SPANS = 3, STATES = 9 };
/* Where in the state strains and surface speeds begin, and the places of the others. */
enum { STRAIN = 0, SPEED = 3, OMEGA_UW = 6, R_UW = 7, R_WU = 8 };

struct plant {
    double per_length[SPANS]; /* 1/L, 1/m */
    double stiffness;         /* EA, N */
    double viscosity[SPANS];  /* EA*tau/L, N s/m */
    double per_mass[2];       /* R^2/J of the idle rolls, 1/kg */
    double friction[2];       /* their c, N s/m */
    double uw_inertia;        /* pi rho W/2, kg/m^2 */
    double uw_offset;         /* J_0 less what the paper's hole would weigh, kg m^2 */
    double uw_friction;       /* N s/m */
    double layer;             /* z/2 pi, m */
    double core;              /* R_core, m */
    double drums;             /* J/R^2 of drums and rider roll, kg */
    double windup_friction;   /* N s/m */
};

/* What is held. */
struct load {
    double uw;   /* torque on the parent roll, N m */
    double pull; /* all motors at the windup's surface, N */
};

static inline double positive(double x) { return x > 0.0 ? x : 0.0; }

static inline void rates(const struct plant *p, const struct load *load, const double *restrict x,
                         double *restrict dx)
{
    const double r_uw = x[R_UW], r_wu = x[R_WU], v_rd = x[SPEED + 2];
    const double v_uw = x[OMEGA_UW] * r_uw;
    double t[SPANS];
    double v_up = v_uw, strain_up = 0.0, stretch_up = 1.0;
    for (int i = 0; i < SPANS; i++) {
        const double strain = x[STRAIN + i], v = x[SPEED + i];
        const double stretch = 1.0 + strain;
        const double draw = (v - v_up) + (v * strain_up - v_up * strain);
        const double flow = i == 0 ? draw * stretch : draw * stretch / stretch_up;
        dx[STRAIN + i] = flow * p->per_length[i];
        t[i] = positive(p->stiffness * strain + p->viscosity[i] * flow);
        v_up = v;
        strain_up = strain;
        stretch_up = stretch;
    }
    for (int i = 0; i < 2; i++)
        dx[SPEED + i] = (t[i + 1] - t[i] - p->friction[i] * x[SPEED + i]) * p->per_mass[i];

    const double kappa = p->core / r_wu;
    const double hollow = 1.0 - (kappa * kappa) * (kappa * kappa);
    const double mass = p->uw_inertia * (r_wu * r_wu) * hollow;
    const double growth = p->uw_inertia * p->layer * v_rd * hollow;
    const double drag = (p->windup_friction - growth) * v_rd;
    dx[SPEED + 2] = (load->pull - t[2] - drag) / (p->drums + mass);
    dx[R_WU] = p->layer * v_rd / r_wu;

    const double square = r_uw * r_uw;
    const double inertia = p->uw_offset + p->uw_inertia * (square * square);
    dx[OMEGA_UW] = (load->uw + (t[0] - p->uw_friction * v_uw) * r_uw) / inertia;
    dx[R_UW] = -p->layer * x[OMEGA_UW];
}

#endif
