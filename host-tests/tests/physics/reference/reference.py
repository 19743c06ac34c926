#!/usr/bin/env python3
"""The plant a second time: the winder's equations in double precision, for an adaptive integrator of eighth order.

Not here: anything of the simulator. Equations and numbers are written out again; brakes and nips follow Coulomb's
law in continuous time, with events where they begin to slide and where they stick.

    pip install scipy            # 1.17 wrote the tables
    python3 reference.py         # renews the tables beside the schedules, in ten seconds
    python3 reference.py steps   # those of one schedule

A schedule `NAME.csv` is what `cargo winder plant --schedule` reads. Its table `NAME.table.csv` has the columns of
that command's output, and those of the other rolls of the windup. `modes.csv` has the natural frequencies.

Of the simulator's sampling this much belongs to the model, and is here as well: torques change on ticks of 4 ms;
a brake acts 40 ms after its command; strength and end of the web are looked at on ticks. What is not here: that
the simulator decides once a step whether a brake or a nip holds, and lets a body come to rest at a step's end.
"""

import csv
import math
import pathlib
import sys
from copy import deepcopy

import numpy as np
from scipy.integrate import solve_ivp

HERE = pathlib.Path(__file__).parent
TICK = 0.004  # s
RTOL = 1e-11
AFTER = [2, 4, 7, 11, 16]  # ticks after a change for which a table of modes has a row
GRAVITY = 9.80665  # m/s²
SCHEDULE = ["T_uw", "T_rd", "T_fd", "T_rr", "brake_uw", "brake_rd", "brake_fd"]

# Machines: SI units, the rolls of the windup in the order rear drum, front drum, rider roll.
NEWS = {
    "W": 8.0, "g": 0.045, "z": 65e-6, "Ez": 260e3, "tau": 5e-3, "UTS": 2.0e3,
    "uw": {"full": 1.50, "spool": 0.40, "expire": 0.45, "J0": 950.0, "c": 20.0},
    "idle": [  # span before it, radius, inertia, friction
        (6.0, 0.20, 47.5, 6.25),
        (3.0, 0.15, 12.0, 7.2),
    ],
    "last": 2.5,
    "windup": [(0.425, 1300.0, 6.8), (0.425, 1300.0, 6.8), (0.15, 15.0, 2.7)],
    "wu": {"core": 0.05, "c": 13.6},
    "slip": False, "mu": 0.35, "gap": 0.012,
    "Q": [(0.10, 2530.0), (0.20, 3260.0), (0.30, 3540.0), (0.40, 3530.0), (0.50, 3320.0),
          (0.60, 2940.0), (0.70, 2410.0), (0.80, 1740.0), (0.90, 940.0), (1.00, 400.0)],
    "brake": (6e3, 5e3, 5e3), "delay": 0.040,  # N·m: unwind, rear drum, front drum
    "tension": 350.0, "stall": 0.30, "run": 2200.0 / 60.0, "measured": 1,
}


def variant(base, **changes):
    machine = deepcopy(base)
    for key, value in changes.items():
        if isinstance(value, dict):
            machine[key].update(value)
        else:
            machine[key] = value
    return machine


GUIDE, SPREADER = (0.20, 9.5, 1.25), (0.15, 6.0, 3.6)
LAB_ROLLS = (0.03, 0.006, 0.06)
MACHINES = {
    "NEWS-8000": NEWS,
    "NEWS-8000-SLIP": variant(NEWS, slip=True),
    "NEWS-8000-UNLUMPED": variant(
        NEWS,
        idle=[(4.0, *GUIDE), (1.5, *GUIDE), (1.0, *GUIDE), (1.0, *GUIDE), (1.0, *GUIDE),
              (1.2, *SPREADER), (0.8, *SPREADER)],
        last=1.0, measured=5,
    ),
    "LWC-8000": variant(NEWS, g=0.060, z=50e-6, Ez=420e3, UTS=3.0e3, uw={"full": 1.20}, tension=450.0),
    "LAB-300": variant(
        NEWS, W=0.30,
        uw={"full": 0.15, "spool": 0.038, "expire": 0.045, "J0": 0.02, "c": 0.5},
        idle=[(1.5, *LAB_ROLLS), (1.0, *LAB_ROLLS)], last=0.8,
        windup=[(0.06, 0.05, 0.2), (0.06, 0.05, 0.2), (0.03, 0.003, 0.1)],
        wu={"core": 0.038, "c": 0.4}, brake=(20.0, 10.0, 10.0), tension=250.0, run=4.0,
    ),
}

# Schedules: name, machine, seconds between the rows of the table, more rows after every change.
SCHEDULES = [
    ("full_set", "NEWS-8000", 5.0, False),
    ("brakes", "NEWS-8000", 0.5, False),
    ("slip", "NEWS-8000-SLIP", 0.25, True),
    ("break", "NEWS-8000", 1.0, False),
    ("run_out", "LAB-300", 5.0, False),
    ("steps", "NEWS-8000", 0.5, True),
    ("steps_unlumped", "NEWS-8000-UNLUMPED", 0.5, True),
    ("steps_lwc", "LWC-8000", 0.5, True),
    ("steps_lab", "LAB-300", 0.5, True),
    ("slack", "NEWS-8000", 0.1, False),
    ("slack_unlumped", "NEWS-8000-UNLUMPED", 0.1, False),
]

STICKS = 0


def sign(x):
    return 1 if x > 0.0 else -1


class Winder:
    """State y: strains, speeds of the idle rolls, V_rd, V_fd, V_rr, V_wu, ω_uw, R_uw, R_wu."""

    def __init__(self, machine):
        m = self.m = machine
        self.spans = [roll[0] for roll in m["idle"]] + [m["last"]]
        self.n = n = len(self.spans)
        self.EA = m["Ez"] * m["W"]
        self.paper = 0.5 * math.pi * m["g"] / m["z"] * m["W"]  # ½·π·ρ·W
        self.idle = [(J / R**2, c) for _, R, J, c in m["idle"]]
        self.rolls = [(J / R**2, c) for R, J, c in m["windup"]]
        self.radii = [roll[0] for roll in m["windup"]]
        self.V = slice(n, 2 * n - 1)
        self.RD, self.FD, self.RR, self.WU = range(2 * n - 1, 2 * n + 3)
        self.W, self.R, self.RWU = range(2 * n + 3, 2 * n + 6)
        self.size = 2 * n + 6
        # what acts
        self.T = [0.0] * 4
        self.closed = [False] * 3
        self.threaded = True
        # how it acts: spans that pull; brakes that slide with sign ±1, or hold (0); nips likewise
        self.taut = [True] * n
        self.uw_slides = self.wu_slides = 1
        self.nip = [STICKS] * 3

    # --- the equations ---

    def strain_rates(self, y):
        """d/dt [L/(1+ε)] = V_up/(1+ε_up) − V/(1+ε): what enters a span without its strain, less what leaves it."""
        entering = y[self.W] * y[self.R]
        rates = []
        for length, e, v in zip(self.spans, y[: self.n], [*y[self.V], y[self.RD]]):
            leaving = v / (1.0 + e)
            rates.append((leaving - entering) * (1.0 + e) ** 2 / length)
            entering = leaving
        return rates

    def pulls(self, y, rates):
        """EA·(ε + τ·ε̇), whatever its sign."""
        return [self.EA * (e + self.m["tau"] * rate) for e, rate in zip(y[: self.n], rates)]

    def tensions(self, y):
        pulls = self.pulls(y, self.strain_rates(y))
        return [max(0.0, pull) if self.threaded else 0.0 for pull in pulls]

    def J_uw(self, r):
        return self.m["uw"]["J0"] + self.paper * (r**4 - self.m["uw"]["spool"] ** 4)

    def m_wu(self, r):
        return self.paper * (r**4 - self.m["wu"]["core"] ** 4) / r**2

    def nip_loads(self, r):
        """N per width: rear drum, front drum, rider roll."""
        m = self.m
        Q = float(np.interp(2.0 * r, *zip(*m["Q"])))
        weight = m["g"] / m["z"] * GRAVITY * math.pi * (r**2 - m["wu"]["core"] ** 2)
        drums = []
        for R in self.radii[:2]:
            alpha = math.asin((R + m["gap"] / 2.0) / (R + r))
            drums.append((weight + Q) / (2.0 * math.cos(alpha)))
        return [*drums, Q]

    def traction(self, y):
        return [self.m["mu"] * N * self.m["W"] for N in self.nip_loads(y[self.RWU])]

    def uw_force(self, y, t_uw):
        """Torque on the parent roll without its brake."""
        R = y[self.R]
        return self.T[0] + R * (t_uw - self.m["uw"]["c"] * y[self.W] * R)

    def roll_forces(self, y, t_sr):
        """On rear drum, front drum, rider roll without nips and brakes; on the shipping roll with its growth."""
        forces = [T / R - c * y[i] for T, R, (_, c), i in
                  zip(self.T[1:], self.radii, self.rolls, (self.RD, self.FD, self.RR))]
        forces[0] = forces[0] - t_sr
        R = y[self.RWU]
        growth = self.m_wu(R) * self.r_wu_rate(y) / R
        return forces, (growth - self.m["wu"]["c"]) * y[self.WU]

    def r_wu_rate(self, y):
        return self.m["z"] * y[self.RD] / (2.0 * math.pi * y[self.RWU]) if self.threaded else 0.0

    def brake_limits(self):
        """What closed brakes give: torque on the parent roll, force on the windup."""
        uw, rd, fd = (B if closed else 0.0 for B, closed in zip(self.m["brake"], self.closed))
        return uw, rd / self.radii[0] + fd / self.radii[1]

    def body(self, y, t_sr):
        """Mass and force of the shipping roll and all that sticks to it, without brakes."""
        forces, force = self.roll_forces(y, t_sr)
        mass = self.m_wu(y[self.RWU])
        traction = self.traction(y) if any(self.nip) else None
        for j, slides in enumerate(self.nip):
            if slides == STICKS:
                mass, force = mass + self.rolls[j][0], force + forces[j]
            else:
                force = force + slides * traction[j]
        return mass, force

    def rates(self, _, y):
        y = y.tolist()
        strain = self.strain_rates(y)
        if self.threaded:
            t = [pull if taut else 0.0 for pull, taut in zip(self.pulls(y, strain), self.taut)]
        else:
            strain, t = [0.0] * self.n, [0.0] * self.n
        idle = [(t[i + 1] - t[i] - c * y[self.n + i]) / mass for i, (mass, c) in enumerate(self.idle)]
        uw_brake, wu_brake = self.brake_limits()
        torque = self.uw_force(y, t[0])
        if uw_brake:
            torque = torque - self.uw_slides * uw_brake if self.uw_slides else 0.0
        mass, force = self.body(y, t[-1])
        if wu_brake:
            force = force - self.wu_slides * wu_brake if self.wu_slides else 0.0
        common = force / mass
        windup = [common] * 3
        if any(self.nip):
            forces, _ = self.roll_forces(y, t[-1])
            traction = self.traction(y)
            for j, slides in enumerate(self.nip):
                if slides:
                    windup[j] = (forces[j] - slides * traction[j]) / self.rolls[j][0]
        radius = -self.m["z"] * y[self.W] / (2.0 * math.pi) if self.threaded else 0.0
        return np.array([*strain, *idle, *windup, common, torque / self.J_uw(y[self.R]), radius, self.r_wu_rate(y)])

    # --- what holds and what slides ---

    def nip_forces(self, y):
        """What each nip carries on to the shipping roll."""
        t_sr = self.tensions(y)[-1]
        forces, _ = self.roll_forces(y, t_sr)
        mass, force = self.body(y, t_sr)
        traction = self.traction(y)
        return [forces[j] - self.rolls[j][0] * force / mass if slides == STICKS else slides * traction[j]
                for j, slides in enumerate(self.nip)]

    def decide(self, y):
        """Which brakes hold and which nips stick from here on."""
        t = self.tensions(y)
        self.taut = [bool(pull > 0.0) for pull in self.pulls(y, self.strain_rates(y))]
        uw_brake, wu_brake = self.brake_limits()
        self.uw_slides = self.side(y[self.W], self.uw_force(y, t[0]), uw_brake)
        self.wu_slides = self.side(y[self.WU], self.body(y, t[-1])[1], wu_brake)
        while self.m["slip"]:
            excess = [abs(F) - limit if slides == STICKS else -1.0
                      for F, limit, slides in zip(self.nip_forces(y), self.traction(y), self.nip)]
            j = max(range(3), key=lambda j: excess[j])
            if excess[j] <= 0.0:
                break
            self.nip[j] = sign(self.nip_forces(y)[j])

    @staticmethod
    def side(speed, force, limit):
        if speed == 0.0 and abs(force) <= limit:
            return 0
        return sign(speed if speed != 0.0 else force)

    def events(self, watch):
        """Functions of the state that go through zero where something changes, and what is done then."""
        events = []

        def add(function, direction, act):
            def event(_, y):
                return function(y)

            event.terminal, event.direction = True, direction
            events.append((event, act))

        if self.threaded:
            for i in range(self.n):
                def flip(y, i=i):
                    self.taut[i] = not self.taut[i]

                add(lambda y, i=i: self.pulls(y, self.strain_rates(y))[i], -1 if self.taut[i] else 1, flip)
        if self.threaded and watch:
            def look(y):
                self.due = True

            strength = self.m["UTS"] * self.m["W"]
            add(lambda y: max(self.tensions(y)) - strength, 1, look)
            add(lambda y: y[self.R] - self.m["uw"]["expire"], -1, look)
        uw_brake, wu_brake = self.brake_limits()

        def stop(y, index):
            y[index] = 0.0
            self.decide(y)

        if uw_brake and self.uw_slides:
            add(lambda y: y[self.W], -self.uw_slides, lambda y: stop(y, [self.W]))
        elif uw_brake:
            def let_go(y):
                self.uw_slides = sign(self.uw_force(y, self.tensions(y)[0]))

            add(lambda y: abs(self.uw_force(y, self.tensions(y)[0])) - uw_brake, 1, let_go)
        windup = [self.RD, self.FD, self.RR, self.WU]
        if wu_brake and self.wu_slides:
            assert not any(self.nip), "brakes on sliding rolls are not here"
            add(lambda y: y[self.WU], -self.wu_slides, lambda y: stop(y, windup))
        elif wu_brake:
            def let_go(y):
                self.wu_slides = sign(self.body(y, self.tensions(y)[-1])[1])

            add(lambda y: abs(self.body(y, self.tensions(y)[-1])[1]) - wu_brake, 1, let_go)
        elif self.m["slip"]:
            for j in range(3):
                index = windup[j]
                if self.nip[j] == STICKS:
                    def slide(y, j=j):
                        self.nip[j] = sign(self.nip_forces(y)[j])
                        self.decide(y)

                    add(lambda y, j=j: abs(self.nip_forces(y)[j]) - self.traction(y)[j], 1, slide)
                else:
                    def meet(y, j=j, index=index):
                        y[index] = y[self.WU]
                        self.nip[j] = STICKS
                        self.decide(y)

                    add(lambda y, index=index: y[index] - y[self.WU], -self.nip[j], meet)
        return events

    # --- a run ---

    def advance(self, t, y, end, watch, log):
        """Integrates from t to `end`, from event to event; ends early where the web is due to part."""
        atol = np.full(self.size, 1e-12)
        atol[: self.n] = 1e-15
        self.due = False
        while t < end and not self.due:
            events = self.events(watch)
            run = solve_ivp(self.rates, (t, end), y, method="DOP853", rtol=RTOL, atol=atol, max_step=0.5,
                            events=[event for event, _ in events])
            assert run.success, run.message
            t, y = run.t[-1], run.y[:, -1].copy()
            for (_, act), times in zip(events, run.t_events):
                if len(times):
                    act(y)
                    slack = [i for i, taut in enumerate(self.taut) if not taut]
                    brakes = f"brakes of unwind {self.uw_slides} and windup {self.wu_slides}"
                    log(t, f"nips {self.nip}, {brakes}, slack {slack}")
        return t, y

    def broken(self, y):
        """Looked at on ticks: strength, and the end of the parent roll."""
        m = self.m
        return self.threaded and (max(self.tensions(y)) > m["UTS"] * m["W"] or y[self.R] <= m["uw"]["expire"])

    def run(self, rows, every, dense, log):
        """Rows of the table: time and state, on ticks."""
        m = self.m
        ticks = [round(row[0] / TICK) for row in rows]
        assert all(abs(tick * TICK - row[0]) < 1e-9 for tick, row in zip(ticks, rows)), "changes must be on ticks"
        delay = round(m["delay"] / TICK)
        last, every = ticks[-1], round(every / TICK)
        acts = {}  # tick -> torques, brakes
        for tick, row in zip(ticks, rows):
            acts.setdefault(tick, {})["T"] = row[1:5]
            acts.setdefault(tick + delay, {})["closed"] = [b > 0.5 for b in row[5:8]]
        y = np.zeros(self.size)
        y[: self.n] = m["stall"] * m["tension"] * m["W"] / self.EA
        y[self.R], y[self.RWU] = m["uw"]["full"], m["wu"]["core"]
        tick = 0
        shown = {*range(0, last, every), last} | {
            tick + k for tick in ticks[:-1] if dense for k in AFTER
        }
        while True:
            if tick in shown:
                yield tick * TICK, y
            if tick == last:
                return
            if tick in acts:
                self.T = acts[tick].get("T", self.T)
                self.closed = acts[tick].get("closed", self.closed)
                self.decide(y)
            to = min(other for other in shown | set(acts) | {last} if other > tick)
            t, y = self.advance(tick * TICK, y, to * TICK, True, log)
            tick = to
            if self.due:
                # on to the tick at which the simulator looks
                tick = math.ceil(t / TICK - 1e-9)
                _, y = self.advance(t, y, tick * TICK, False, log)
                if self.broken(y):
                    log(tick * TICK, f"the web parts, {max(self.tensions(y)):.3f} N, R_uw {y[self.R]:.9f} m")
                    self.threaded = False
                    y[: self.n] = 0.0
                    self.decide(y)

    # --- modes ---

    def modes(self, v, held):
        """Eigenvalues about the steady run at V_rd = v with a full parent roll and a bare core; drums held or free."""
        m, n = self.m, self.n
        t = [0.0] * n
        k = m["measured"]
        t[k] = m["tension"] * m["W"]
        for i in range(k, n - 1):
            t[i + 1] = t[i] + self.idle[i][1] * v
        for i in range(k, 0, -1):
            t[i - 1] = t[i] - self.idle[i - 1][1] * v
        strain = [force / self.EA for force in t]
        unstrained = v / (1.0 + strain[-1])
        y = np.zeros(self.size, dtype=complex)
        y[:n] = strain
        y[n : 2 * n] = [unstrained * (1.0 + e) for e in strain]
        y[self.FD : self.WU + 1] = v
        y[self.R], y[self.RWU] = m["uw"]["full"], m["wu"]["core"]
        y[self.W] = unstrained / y[self.R]
        moving = [i for i in range(2 * n) if not (held and i == self.RD)] + [self.W]
        jacobian = np.zeros((len(moving), len(moving)))
        for column, i in enumerate(moving):
            x = y.copy()
            x[i] += 1e-30j
            if i == self.RD:
                x[self.FD : self.WU + 1] += 1e-30j
            jacobian[:, column] = self.rates(0.0, x)[moving].imag / 1e-30
        values = np.linalg.eigvals(jacobian)
        return sorted((abs(s), -s.real / abs(s)) for s in values if s.imag > 1e-3)


def columns(n):
    idle = ["gr", "sr"] if n == 3 else [str(i) for i in range(1, n)]
    return ["t_s", "v_uw", *[f"v_{i}" for i in idle], "v_rd", "t_uw", *[f"t_{i}" for i in idle], "r_uw", "r_wu",
            "v_fd", "v_rr", "v_wu"]


def read(path):
    with open(path, newline="") as file:
        return [[float(row["t_s"])] + [float(row.get(name) or 0) for name in SCHEDULE] for row in csv.DictReader(file)]


def write(path, header, rows):
    with open(path, "w", newline="") as file:
        file.write(",".join(header) + "\n")
        for row in rows:
            file.write(",".join(x if isinstance(x, str) else f"{x:.10g}" for x in row) + "\n")


def table(name, machine, every, dense):
    winder = Winder(MACHINES[machine])
    rows = []
    n = winder.n
    schedule = read(HERE / f"{name}.csv")
    for t, y in winder.run(schedule, every, dense, lambda t, what: print(f"{name} {t:.6f} s: {what}")):
        rows.append([round(t, 3), y[winder.W] * y[winder.R], *y[n : 2 * n], *winder.tensions(y), y[winder.R],
                     y[winder.RWU], y[winder.FD], y[winder.RR], y[winder.WU]])
    write(HERE / f"{name}.table.csv", columns(winder.n), rows)


def modes():
    rows = []
    for name in ["NEWS-8000", "NEWS-8000-UNLUMPED", "LWC-8000", "LAB-300"]:
        winder = Winder(MACHINES[name])
        for v in [0.5, winder.m["run"]]:
            for held in [True, False]:
                for omega, damping in winder.modes(v, held):
                    rows.append([name, v, "held" if held else "free", omega, damping])
    write(HERE / "modes.csv", ["machine", "v_m_s", "drums", "omega_rad_s", "damping"], rows)


if __name__ == "__main__":
    wanted = sys.argv[1:]
    for name, machine, every, dense in SCHEDULES:
        if not wanted or name in wanted:
            table(name, machine, every, dense)
    if not wanted or "modes" in wanted:
        modes()
