/* The classical Runge-Kutta step by hand. SETTING is the number of steps in a hold. */
#include "peer.h"

static const char *version(void) { return __VERSION__; }

static void step(const struct plant *plant, const struct load *load, double h, double *restrict x)
{
    double k1[STATES], k2[STATES], k3[STATES], k4[STATES], y[STATES];
    rates(plant, load, x, k1);
    for (int i = 0; i < STATES; i++) y[i] = x[i] + 0.5 * h * k1[i];
    rates(plant, load, y, k2);
    for (int i = 0; i < STATES; i++) y[i] = x[i] + 0.5 * h * k2[i];
    rates(plant, load, y, k3);
    for (int i = 0; i < STATES; i++) y[i] = x[i] + h * k3[i];
    rates(plant, load, y, k4);
    for (int i = 0; i < STATES; i++) x[i] += h / 6.0 * (k1[i] + 2.0 * (k2[i] + k3[i]) + k4[i]);
}

static int run(const struct problem *problem, const char *method, double setting, double *out)
{
    const int steps = (int)setting;
    const double h = problem->hold_s / steps;
    double x[STATES];
    if (strcmp(method, "rk4") != 0) return 1;
    memcpy(x, problem->start, sizeof x);
    for (int hold = 0; hold < problem->holds; hold++) {
        for (int i = 0; i < steps; i++) step(&problem->plant, &problem->loads[hold], h, x);
        memcpy(out + (size_t)hold * STATES, x, sizeof x);
    }
    return 0;
}
