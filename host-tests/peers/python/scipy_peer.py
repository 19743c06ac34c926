"""SciPy's solve_ivp on the winder of three spans: as the peers in C, see peer.h.

SETTING is the relative tolerance.
"""

import sys
import time

import numpy
import scipy
from scipy.integrate import solve_ivp


def read(path):
    values, loads = {}, []
    with open(path, encoding="ascii") as file:
        for line in file:
            name, *numbers = line.split()
            numbers = [float(number) for number in numbers]
            if name == "load":
                loads.append(numbers)
            else:
                values[name] = numbers if len(numbers) > 1 else numbers[0]
    return values, loads


def plant(p, load):
    """The rates under a load, in plain floats, which are quicker than arrays of three."""
    l0, l1, l2 = p["per_length"]
    d0, d1, d2 = p["viscosity"]
    m0, m1 = p["per_mass"]
    c0, c1 = p["friction"]
    stiffness, inertia, offset = p["stiffness"], p["uw_inertia"], p["uw_offset"]
    c_uw, layer, core = p["uw_friction"], p["layer"], p["core"]
    drums, c_wu = p["drums"], p["windup_friction"]
    torque, pull = load

    def rates(_, x):
        e0, e1, e2, v0, v1, v2, omega, r_uw, r_wu = x.tolist()
        v_uw = omega * r_uw
        s0, s1, s2 = 1.0 + e0, 1.0 + e1, 1.0 + e2
        f0 = ((v0 - v_uw) - v_uw * e0) * s0
        f1 = ((v1 - v0) + (v1 * e0 - v0 * e1)) * s1 / s0
        f2 = ((v2 - v1) + (v2 * e1 - v1 * e2)) * s2 / s1
        t0 = max(0.0, stiffness * e0 + d0 * f0)
        t1 = max(0.0, stiffness * e1 + d1 * f1)
        t2 = max(0.0, stiffness * e2 + d2 * f2)
        hollow = 1.0 - (core / r_wu) ** 4
        mass = inertia * r_wu * r_wu * hollow
        drag = (c_wu - inertia * layer * v2 * hollow) * v2
        return [
            f0 * l0,
            f1 * l1,
            f2 * l2,
            (t1 - t0 - c0 * v0) * m0,
            (t2 - t1 - c1 * v1) * m1,
            (pull - t2 - drag) / (drums + mass),
            (torque + (t0 - c_uw * v_uw) * r_uw) / (offset + inertia * r_uw**4),
            -layer * omega,
            layer * v2 / r_wu,
        ]

    return rates


def run(values, loads, method, tolerance):
    hold, x, states = values["hold_s"], numpy.array(values["start"]), []
    for load in loads:
        solution = solve_ivp(
            plant(values, load), (0.0, hold), x, method=method, rtol=tolerance, atol=1e-3 * tolerance
        )
        if not solution.success:
            sys.exit(solution.message)
        x = solution.y[:, -1]
        states.append(x)
    return numpy.array(states)


def main():
    if sys.argv[1:] == ["--version"]:
        print(scipy.__version__)
        return
    problem, method, setting, runs, out = sys.argv[1:]
    values, loads = read(problem)
    best = float("inf")
    for _ in range(int(runs)):
        began = time.process_time()
        states = run(values, loads, method, float(setting))
        best = min(best, time.process_time() - began)
    states.tofile(out)
    print(f"{best:.9e}")


main()
