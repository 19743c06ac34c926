/* GSL's explicit integrators. SETTING is the relative tolerance, and for `rk4` the number of steps in a hold. */
#include <gsl/gsl_errno.h>
#include <gsl/gsl_odeiv2.h>
#include <gsl/gsl_version.h>

#include "peer.h"

static const char *version(void) { return gsl_version; }

struct held {
    const struct plant *plant;
    const struct load *load;
};

static int function(double t, const double x[], double dx[], void *held)
{
    const struct held *h = (const struct held *)held;
    (void)t;
    rates(h->plant, h->load, x, dx);
    return GSL_SUCCESS;
}

static int run(const struct problem *problem, const char *method, double setting, double *out)
{
    const int fixed = strcmp(method, "rk4") == 0;
    const gsl_odeiv2_step_type *type = fixed ? gsl_odeiv2_step_rk4
        : strcmp(method, "rkf45") == 0       ? gsl_odeiv2_step_rkf45
        : strcmp(method, "rk8pd") == 0       ? gsl_odeiv2_step_rk8pd
                                             : NULL;
    struct held held = {&problem->plant, NULL};
    gsl_odeiv2_system system = {function, NULL, STATES, &held};
    double x[STATES], t = 0.0;
    int status = type ? GSL_SUCCESS : GSL_EINVAL;
    if (status) return status;
    memcpy(x, problem->start, sizeof x);
    gsl_odeiv2_driver *driver =
        fixed ? gsl_odeiv2_driver_alloc_y_new(&system, type, problem->hold_s, 1e-6, 1e-6)
              : gsl_odeiv2_driver_alloc_y_new(&system, type, problem->hold_s, 1e-3 * setting, setting);
    for (int hold = 0; hold < problem->holds && status == GSL_SUCCESS; hold++) {
        held.load = &problem->loads[hold];
        /* the rates jump: nothing of the last step may be used again but its length */
        gsl_odeiv2_driver_reset(driver);
        if (fixed) {
            const unsigned long steps = (unsigned long)setting;
            status = gsl_odeiv2_driver_apply_fixed_step(driver, &t, problem->hold_s / (double)steps, steps, x);
        } else {
            status = gsl_odeiv2_driver_apply(driver, &t, (hold + 1) * problem->hold_s, x);
        }
        memcpy(out + (size_t)hold * STATES, x, sizeof x);
    }
    gsl_odeiv2_driver_free(driver);
    return status;
}
