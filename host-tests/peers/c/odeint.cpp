/* Boost odeint. SETTING is the number of steps in a hold, and for `dopri5` the relative tolerance. */
#include <algorithm>
#include <array>
#include <boost/numeric/odeint.hpp>
#include <boost/version.hpp>

#include "peer.h"

namespace odeint = boost::numeric::odeint;
using State = std::array<double, STATES>;

static const char *version(void) { return BOOST_LIB_VERSION; }

template <class Stepper>
static void fixed(Stepper stepper, const problem *problem, int steps, double *out)
{
    State x;
    std::copy_n(problem->start, STATES, x.begin());
    const double h = problem->hold_s / steps;
    for (int hold = 0; hold < problem->holds; hold++) {
        const load &load = problem->loads[hold];
        const auto system = [&](const State &x, State &dx, double) {
            rates(&problem->plant, &load, x.data(), dx.data());
        };
        for (int i = 0; i < steps; i++) stepper.do_step(system, x, 0.0, h);
        std::copy(x.begin(), x.end(), out + static_cast<size_t>(hold) * STATES);
    }
}

template <class Stepper>
static int controlled(Stepper stepper, const problem *problem, double *out)
{
    State x;
    std::copy_n(problem->start, STATES, x.begin());
    const double end = problem->hold_s;
    double next = end;
    for (int hold = 0; hold < problem->holds; hold++) {
        const load &load = problem->loads[hold];
        const auto system = [&](const State &x, State &dx, double) {
            rates(&problem->plant, &load, x.data(), dx.data());
        };
        // the rates jump: the last ones of the hold before are not the first ones of this
        stepper.reset();
        double t = 0.0;
        while (end - t > 1e-12 * end) {
            double h = std::min(next, end - t);
            const bool cut = h < next;
            if (stepper.try_step(system, x, t, h) == odeint::success) next = cut ? std::max(next, h) : h;
            else next = h;
            if (!(next > 1e-9 * end)) return 1;
        }
        std::copy(x.begin(), x.end(), out + static_cast<size_t>(hold) * STATES);
    }
    return 0;
}

static int run(const problem *problem, const char *method, double setting, double *out)
{
    const int steps = static_cast<int>(setting);
    if (std::strcmp(method, "rk4") == 0) {
        fixed(odeint::runge_kutta4<State>(), problem, steps, out);
    } else if (std::strcmp(method, "rkf78") == 0) {
        fixed(odeint::runge_kutta_fehlberg78<State>(), problem, steps, out);
    } else if (std::strcmp(method, "dopri5") == 0) {
        const auto stepper = odeint::make_controlled<odeint::runge_kutta_dopri5<State>>(1e-3 * setting, setting);
        return controlled(stepper, problem, out);
    } else {
        return 1;
    }
    return 0;
}
