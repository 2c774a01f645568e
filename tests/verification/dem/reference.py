#!/usr/bin/python3
"""Independent reference solutions for the verification of the DEM engine: closed forms, event-driven rigid limits and
piecewise-smooth ODEs integrated to round-off. Nothing here shares code or discretisation with the engine.

  reference.py            prints the references as JSON (this is reference.json)
  reference.py --check    recomputes them and compares with the committed reference.json; exit code 1 where they differ
  reference.py NAME...    only these cases

Every case is a function below that returns {source, parameters, values, converged}; `converged` is the relative error to
which the values are known (closed forms: round-off). README.md beside this file holds the set-up of each case in words.
SI units, angles in degrees where the key says so, 2D quantities per metre of depth.
"""
import json
import pathlib
import sys

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

G = 9.81
ROUND_OFF = 1e-13
CASES = {}


def case(function):
    CASES[function.__name__] = function
    return function


# --- restitution of contacts that never pull -------------------------------------------------------------------------


def restitution_of(zeta):
    """e of F = max(0, k x + c v), damping ratio zeta = c / (2 sqrt(k m)); contact ends when the force is zero.

    With x = (v0/w_d) e^(-zeta w t) sin(w_d t), F = 0 at w_d t = 2 acos(zeta), where |v| / v0 = e^(-zeta w t) exactly.
    The Hertzian law F = max(0, K x^1.5 + sqrt(5) beta sqrt(K m) x^0.25 v) has the same e(beta): with w = x^(5/4) its phase
    plane is v dv/dw = -(4/5)(w + sqrt(5) beta v), a linear oscillator of damping ratio beta, with the same end condition.
    """
    if zeta == 0:
        return 1.0
    if abs(zeta - 1) < 1e-9:
        return float(np.exp(-2.0 + (zeta - 1) * -2 / 3))
    if zeta < 1:
        return float(np.exp(-2 * zeta * np.arccos(zeta) / np.sqrt(1 - zeta**2)))
    return float(np.exp(-2 * zeta * np.arccosh(zeta) / np.sqrt(zeta**2 - 1)))


def damping_ratio_for(e):
    """The inverse of restitution_of."""
    if e == 1:
        return 0.0
    return brentq(lambda z: np.log(restitution_of(z)) - np.log(e), 0, 1e6, xtol=1e-15, rtol=1e-15)


def printed_damping_ratio(e):
    """-ln e / sqrt(ln^2 e + pi^2): Nasato (2011) eq. 6, 13, Gomes (2014) eq. 2.95-2.96 as corrected."""
    return float(-np.log(e) / np.sqrt(np.log(e) ** 2 + np.pi**2))


# --- stability of the integrator ------------------------------------------------------------------------------------------


def amplification(h, zeta, prediction=1.0, incremental=False):
    """One step of x += v dt + a dt^2/2; p = v + prediction a dt; a' = f(x, p); v += (a + a') dt/2 on x'' + 2 zeta w x' + w^2 x = 0
    with h = w dt, in units w = 1. State (x, v, a); incremental: (F, v, a), the spring force grown by F' = F - h p."""
    p = np.array([0.0, 1.0, prediction * h])
    if incremental:
        first = np.array([1.0, 0, 0]) - h * p
        force = first - 2 * zeta * p
    else:
        first = np.array([1.0, h, h * h / 2])
        force = -first - 2 * zeta * p
    return np.array([first, np.array([0.0, 1.0, h / 2]) + h / 2 * force, force])


def limit_by_eigenvalues(zeta, **scheme):
    """The first h at which the spectral radius passes 1."""
    def radius(h):
        return np.max(np.abs(np.linalg.eigvals(amplification(h, zeta, **scheme)))) - 1
    step = 1e-3 / (1 + zeta)
    h = step
    while radius(h + step) <= 1e-9:
        h += step
    return brentq(lambda x: radius(x) - 1e-14, h, h + step, xtol=1e-15, rtol=1e-15)


@case
def stability():
    """Exact stability limits h = w dt of a damped spring under the engine's integrator (README, "Stability")."""
    restitutions = {f"restitution_{e:g}": damping_ratio_for(e) for e in (0.01, 0.1, 0.3, 0.5, 0.9)}
    printed = {f"printed_{e:g}": printed_damping_ratio(e) for e in (0.01, 0.1, 0.3, 0.5, 0.9)}
    ratios = {f"{z:g}": z for z in (0, 0.05, 0.1, 0.2, 0.3, 0.5, 0.7, 0.782, 1, 1.5, 2, 3, 4, 4.8, 5, 7, 10)}
    table, worst = {}, 0.0
    for name, zeta in (ratios | restitutions | printed).items():
        exact = 2 * (np.sqrt(1 + 4 * zeta**2) - 2 * zeta)
        incremental = np.sqrt(4 * zeta**2 + 2) - 2 * zeta
        numeric = limit_by_eigenvalues(zeta)
        numeric_incremental = limit_by_eigenvalues(zeta, incremental=True)
        numeric_half = limit_by_eigenvalues(zeta, prediction=0.5)
        lagged = 2 * (np.sqrt(1 + zeta**2) - zeta)
        worst = max(worst, abs(numeric / exact - 1), abs(numeric_incremental / incremental - 1), abs(numeric_half / lagged - 1))
        table[name] = {"zeta": zeta, "limit": exact, "limit_by_eigenvalues": numeric, "limit_incremental_spring": incremental,
                       "limit_incremental_by_eigenvalues": numeric_incremental, "limit_lagged_velocity": lagged,
                       "limit_half_prediction_by_eigenvalues": numeric_half, "lagged_over_exact": lagged / exact}
    return {"source": "eigenvalues of the amplification matrix; Groot & Warren (1997) with lambda = 1",
            "parameters": {"closed_form": "2 (sqrt(1 + 4 zeta^2) - 2 zeta)", "closed_form_incremental": "sqrt(4 zeta^2 + 2) - 2 zeta",
                           "closed_form_lagged": "2 (sqrt(1 + zeta^2) - zeta)"},
            "values": table, "converged": max(worst, ROUND_OFF)}


def disc(radius, density):
    mass = density * np.pi * radius**2
    return mass, mass * radius**2 / 2


def sphere(radius, density):
    mass = density * 4 / 3 * np.pi * radius**3
    return mass, 0.4 * mass * radius**2


def critical_step_of(quadratic, linear, masses):
    """The dt at which the largest eigenvalue of dt^2 Q + 4 dt C against 4 M is 1."""
    scale = 1 / np.sqrt(masses)
    q, c = quadratic * np.outer(scale, scale), linear * np.outer(scale, scale)
    top = lambda dt: np.linalg.eigvalsh(dt * dt * q + 4 * dt * c)[-1] / 4 - 1
    guess = 2 / np.sqrt(np.linalg.eigvalsh(q)[-1])
    return brentq(top, 1e-6 * guess, guess * (1 + 1e-12), xtol=1e-14 * guess, rtol=1e-14)


@case
def stability_of_a_packing():
    """A triangular lattice of discs on a floor, every contact loaded and sticking: the exact critical step of the engine's
    integrator for Gomes's table 4.1, beside the two bounds that a program can evaluate contact by contact (README)."""
    radius, density, columns, rows = 0.0009, 1600.0, 12, 12
    kn, kt, cn, ct, eta = 1.98e6, 9.91e4, 99.31, 15.90, 0.3
    mass, inertia = disc(radius, density)
    centres = np.array([[(2 * i + j % 2) * radius, radius + j * np.sqrt(3) * radius] for j in range(rows) for i in range(columns)])
    n = len(centres)
    contacts = [(i, j) for i in range(n) for j in range(i) if np.hypot(*(centres[i] - centres[j])) < 2.001 * radius]
    contacts += [(i, None) for i in range(columns)]
    masses = np.tile([mass, mass, inertia], n)

    def assemble(normal, tangential, rolling_of):
        matrix = np.zeros((3 * n, 3 * n))
        for i, j in contacts:
            normal_vector = (centres[i] - centres[j]) / (2 * radius) if j is not None else np.array([0.0, 1.0])
            tangent = np.array([-normal_vector[1], normal_vector[0]])
            rows_of = []
            for stiffness, vector, spin_i, spin_j in ((normal, normal_vector, 0, 0), (tangential, tangent, -radius, -radius),
                                                      (rolling_of(j is None), np.zeros(2), 1, -1)):
                b = np.zeros(3 * n)
                b[3 * i:3 * i + 2], b[3 * i + 2] = vector, spin_i
                if j is not None:
                    b[3 * j:3 * j + 2], b[3 * j + 2] = -vector, spin_j
                rows_of.append(np.sqrt(stiffness) * b)
            block = np.array(rows_of)
            used = np.flatnonzero(np.abs(block).sum(axis=0))
            matrix[np.ix_(used, used)] += block[:, used].T @ block[:, used]
        return matrix

    rolling = lambda wall: kt * (radius if wall else radius / 2) ** 2
    arm_inertia = lambda wall: (inertia + mass * radius**2) / (1 if wall else 2)
    rolling_dashpot = lambda wall: 2 * eta * np.sqrt(arm_inertia(wall) * rolling(wall))
    elastic, direct = assemble(kn, kt, rolling), assemble(kn, 0, lambda wall: 0)
    incremental = elastic - direct
    dashpots = assemble(cn, ct, rolling_dashpot)
    exact = critical_step_of(direct + 2 * incremental, dashpots, masses)
    second_order = critical_step_of(elastic, dashpots, masses)
    lagged = critical_step_of(elastic, dashpots / 2, masses)  # lagged: dt^2 K + 2 dt C = 4 M
    undamped = critical_step_of(direct, 0 * dashpots, masses)

    def contact_bound(dt):
        """max over contacts of K_i/m_i + K_j/m_j, K_i the sum over i's contacts of kappa (README)."""
        kappa = np.zeros(n)
        for i, j in contacts:
            wall = j is None
            turning = (2 * kt * dt**2 + 4 * ct * dt) * 3 + (2 * rolling(wall) * dt**2 + 4 * rolling_dashpot(wall) * dt) * mass / inertia
            value = max(kn * dt**2 + 4 * cn * dt, turning)
            kappa[i] += value
            if not wall:
                kappa[j] += value
        return max((kappa[i] + (kappa[j] if j is not None else 0)) / mass for i, j in contacts) / 4 - 1

    def block_bound(dt):
        """2 max over particles of the largest eigenvalue of its own diagonal block."""
        q, c = direct + 2 * incremental, dashpots
        total = (dt * dt * q + 4 * dt * c) / np.sqrt(np.outer(masses, masses))
        return 2 * max(np.linalg.eigvalsh(total[3 * i:3 * i + 3, 3 * i:3 * i + 3])[-1] for i in range(n)) / 4 - 1

    by_contacts = brentq(contact_bound, 1e-9, 1e-3, xtol=1e-19, rtol=1e-13)
    by_blocks = brentq(block_bound, 1e-9, 1e-3, xtol=1e-19, rtol=1e-13)
    omega = np.sqrt(2 * kn / mass)
    zeta = cn / (mass * omega)
    return {"source": "Gomes (2014) table 4.1, smallest discs of table 4.2; eta_r = 0.3",
            "parameters": {"radius": radius, "density": density, "normal_stiffness": kn, "tangential_stiffness": kt, "normal_damping": cn,
                           "tangential_damping": ct, "rolling_damping_ratio": eta, "columns": columns, "rows": rows},
            "values": {"sqrt_m_over_k": np.sqrt(mass / kn), "paper_step_over_sqrt_m_over_k": 4e-5 / np.sqrt(mass / kn),
                       "pair_damping_ratio": zeta,
                       "pair_normal_engine": 2 / omega * (np.sqrt(1 + 4 * zeta**2) - 2 * zeta),
                       "pair_normal_lagged": 2 / omega * (np.sqrt(1 + zeta**2) - zeta),
                       "packing_engine_incremental_springs": exact, "packing_engine_exact_springs": second_order,
                       "packing_lagged": lagged, "packing_undamped_normal_only": undamped,
                       "bound_by_contacts": by_contacts, "bound_by_blocks": by_blocks},
            "converged": 1e-11}


# --- piecewise-smooth integration --------------------------------------------------------------------------------------


def integrate(rates, state, start, end, switches, longest, rtol):
    """DOP853 from start to end or to the first switch (function, direction). Returns t, y, index of the switch or None, solution."""
    events = []
    for function, direction in switches:
        event = lambda t, y, f=function: f(y)
        event.terminal, event.direction = True, direction
        events.append(event)
    solution = solve_ivp(rates, (start, end), state, method="DOP853", rtol=rtol, atol=rtol * 1e-4, max_step=longest, events=events or None,
                         dense_output=True)
    if not solution.success:
        raise RuntimeError(solution.message)
    hit = next((i for i, times in enumerate(solution.t_events or []) if len(times)), None)
    return solution.t[-1], solution.y[:, -1], hit, solution.sol


def twice(function):
    """The result of function(rtol, refinement) at two accuracies, and the largest relative difference between them."""
    fine, coarse = function(3e-14, 2.0), function(1e-12, 1.0)

    def worst(a, b, scale=None):
        if isinstance(a, dict):
            return max((worst(a[k], b[k]) for k in a), default=0.0)
        if isinstance(a, (list, np.ndarray)):
            top = max((abs(x) for x in a if isinstance(x, float)), default=0.0)
            return max((worst(x, y, top) for x, y in zip(a, b)), default=0.0)
        if isinstance(a, (str, bool)) or a is None or b is None:
            return 0.0 if a == b else np.inf
        size = max(abs(a), abs(b), scale or 0.0)
        return abs(a - b) / size if size > 1e-13 else 0.0
    return fine, max(worst(fine, coarse), 1e-12)


class Slider:
    """A spring in series with a slider of limit L and a dashpot beside the spring while the slider sticks: tangential (2.44-2.56) and
    rolling (2.64-2.77) alike. `capped`: the sum of spring and dashpot is held to L as well. The rate is the relative motion."""

    def __init__(self, stiffness, dashpot, limit, capped):
        self.k, self.c, self.limit, self.capped = stiffness, dashpot, limit, capped
        self.sliding = 0   # sign of the force while sliding
        self.clipped = 0   # sign of the sum while it is held to the limit

    def start(self, force, rate):
        self.clipped = 0
        if self.capped and abs(force - self.c * rate) > self.limit:
            self.clipped = int(np.sign(force - self.c * rate))

    def total(self, force, rate):
        if self.sliding:
            return self.sliding * self.limit
        return self.clipped * self.limit if self.clipped else force - self.c * rate

    def growth(self, rate):
        return 0.0 if self.sliding else -self.k * rate

    def switches(self, force_of, rate_of):
        """[(function of the state, direction, what to do)]"""
        if self.sliding:
            s = self.sliding
            return [(lambda y: s * rate_of(y), 1, "stick")]
        found = [(lambda y: force_of(y) - self.limit, 1, "slide+"), (lambda y: -force_of(y) - self.limit, 1, "slide-")]
        if self.capped and self.c > 0:
            total = lambda y: force_of(y) - self.c * rate_of(y)
            if self.clipped:
                s = self.clipped
                found.append((lambda y: s * total(y) - self.limit, -1, "unclip"))
            else:
                found += [(lambda y: total(y) - self.limit, 1, "clip+"), (lambda y: -total(y) - self.limit, 1, "clip-")]
        return found

    def switch(self, what):
        if what == "stick":
            self.sliding = self.clipped = 0
        elif what.startswith("slide"):
            self.sliding, self.clipped = (1 if what[-1] == "+" else -1), 0
        else:
            self.clipped = {"unclip": 0, "clip+": 1, "clip-": -1}[what]


def on_floor(body, end, rtol, refinement, samples=(), speed=0.0, spin=0.0, slope=0.0):
    """A disc or sphere on a plane, its normal force constant (settled, plane at rest), friction and rolling springs at zero at t = 0.

    body: mass, inertia, radius, lever, k_t, c_t, mu, k_r, c_r, mu_r, capped. State x, v, w, F, M. Returns the log of switches [(t, what,
    x, v, w, F, M)], the samples [(t, x, v, w, total force, total couple)], the turning points of x, and the last state.
    """
    normal = body["mass"] * G * np.cos(slope)
    drive = G * np.sin(slope)
    mass, inertia, lever = body["mass"], body["inertia"], body["lever"]
    friction = Slider(body["k_t"], body["c_t"], body["mu"] * normal, body["capped"])
    rolling = Slider(body["k_r"], body["c_r"], body["mu_r"] * body["radius"] * normal, body["capped"])
    if rolling.limit == 0:
        rolling = Slider(0.0, 0.0, 1.0, False)
    slip, turn = lambda y: y[1] + lever * y[2], lambda y: y[2]
    force, couple = lambda y: y[3], lambda y: y[4]

    def rates(_, y):
        u, w = y[1] + lever * y[2], y[2]
        f, m = friction.total(y[3], u), rolling.total(y[4], w)
        return [y[1], drive + f / mass, (f * lever + m) / inertia, friction.growth(u), rolling.growth(w)]

    state, t = np.array([0.0, speed, spin, 0.0, 0.0]), 0.0
    friction.start(0.0, slip(state))
    rolling.start(0.0, spin)
    fastest = max(np.sqrt(body["k_t"] * (1 / mass + lever**2 / inertia)), np.sqrt(body["k_r"] / inertia), body["c_r"] / inertia,
                  body["c_t"] * (1 / mass + lever**2 / inertia), 1e-9)
    longest = 0.25 / fastest / refinement  # short enough that no switch is stepped over
    pending, log, taken, turns = list(samples), [], [], []
    for _ in range(100000):
        parts = [(part, what, function, direction) for part, found in ((friction, friction.switches(force, slip)), (rolling, rolling.switches(couple, turn)))
                 for function, direction, what in found]
        before = t
        t, state, hit, path = integrate(rates, state, t, end, [(p[2], p[3]) for p in parts], longest, rtol)
        while pending and pending[0] <= t:
            y = path(pending[0])
            taken.append([pending.pop(0), y[0], y[1], y[2], friction.total(y[3], slip(y)), rolling.total(y[4], y[2])])
        grid = np.linspace(before, t, max(2, int((t - before) / longest) + 2))
        speeds = path(grid)[1]
        for a, b, va, vb in zip(grid[:-1], grid[1:], speeds[:-1], speeds[1:]):
            if va * vb < 0:
                instant = brentq(lambda s: path(s)[1], a, b, xtol=1e-15, rtol=1e-14)
                turns.append([instant, float(path(instant)[0])])
        if hit is None:
            break
        part, what = parts[hit][0], parts[hit][1]
        part.switch(what)
        if what == "stick":  # held exactly where the slider left it
            state[3 if part is friction else 4] = np.copysign(part.limit, state[3 if part is friction else 4])
        log.append([t, ("friction " if part is friction else "rolling ") + what, *map(float, state)])
    return log, taken, turns, state


# --- Gomes's three analytic tests ---------------------------------------------------------------------------------------


@case
def elastic_collision():
    """Gomes (2014) 3.2.1, table 3.1: frictionless discs of equal mass, the second at rest."""
    r1, r2, mass, b, speed = 0.03, 0.05, 0.5, 0.03, 1.0

    def outgoing(w):
        v1, v2 = np.array([speed / 2, 0]) + w / 2, np.array([speed / 2, 0]) - w / 2
        return {"speed_1": list(map(float, v1)), "speed_2": list(map(float, v2)), "angle_1_degrees": float(np.degrees(np.arctan2(v1[1], v1[0]))),
                "angle_2_degrees": float(np.degrees(np.arctan2(v2[1], v2[0])))}

    def soft(stiffness):
        def run(rtol, refinement):
            reduced = mass / 2
            rates = lambda _, y: [y[2], y[3], *(stiffness / reduced * (r1 + r2 - np.hypot(y[0], y[1])) * y[:2] / np.hypot(y[0], y[1]))]
            start = np.array([-np.sqrt((r1 + r2) ** 2 - b**2), b, speed, 0.0])
            longest = np.sqrt(reduced / stiffness) / 10 / refinement
            separation = lambda y: np.hypot(y[0], y[1]) - r1 - r2
            closing = lambda y: y[0] * y[2] + y[1] * y[3]
            t1, y1, hit, _ = integrate(rates, start, 0, 100 * np.sqrt(reduced / stiffness), [(closing, 1)], longest, rtol)
            t2, y2, hit, _ = integrate(rates, y1, t1, 100 * np.sqrt(reduced / stiffness), [(separation, 1)], longest, rtol)
            return outgoing(y2[2:]) | {"stiffness": stiffness, "duration": t2, "largest_overlap": float(r1 + r2 - np.hypot(y1[0], y1[1]))}
        return twice(run)

    angle = np.arcsin(b / (r1 + r2))
    along = np.array([np.cos(angle), -np.sin(angle)])
    rigid = outgoing(np.array([speed, 0]) - 2 * speed * np.cos(angle) * along)
    results = [soft(k) for k in (4.9e3, 4.9e4, 4.9e5, 4.9e6, 4.9e7, 4.9e8, 4.9e10)]
    softened = [r[0] for r in results]
    errors = np.array([abs(s["angle_1_degrees"] - rigid["angle_1_degrees"]) for s in softened])
    orders = np.log(errors[:-1] / errors[1:]) / np.log([b["stiffness"] / a["stiffness"] for a, b in zip(softened[:-1], softened[1:])])
    paper = {"speed_1": [0.15, 0.36], "speed_2": [0.85, -0.36], "angle_1_degrees": 66.99, "angle_2_degrees": -23.01}
    return {"source": "Gomes (2014) 3.2.1, table 3.1, k_n = 4.9e4 N/m; rigid limit sin(angle) = b / (r1 + r2)",
            "parameters": {"radius_1": r1, "radius_2": r2, "mass": mass, "offset": b, "speed": speed,
                           "contact_begins_at": [-float(np.sqrt((r1 + r2) ** 2 - b**2)), b], "printed_in_the_paper": paper},
            "values": {"rigid": rigid, "soft": softened, "order_of_angle_in_stiffness": [float(f"{x:.6f}") for x in orders[:-1]]},
            "converged": max(r[1] for r in results) * 10}


@case
def struck_ball():
    """Gomes (2014) 3.2.2, table 3.2: slip, then rolling without slip."""
    mass, radius, speed, mu = 0.5, 0.03, 1.0, 0.57
    offset = 0.01
    spin = -2.5 * speed * offset / radius**2
    rigid, soft, worst = {}, {}, 0.0
    for shape, beta in (("disc", 0.5), ("sphere", 0.4)):
        slip = speed + spin * radius
        t1 = slip / (mu * G * (1 + 1 / beta))
        v1 = speed - mu * G * t1
        rigid[shape] = {"slip_ends": t1, "speed": v1, "spin": -v1 / radius, "distance": speed * t1 - mu * G * t1**2 / 2,
                        "energy_lost": 0.5 * mass * speed**2 + 0.5 * beta * mass * radius**2 * spin**2 - 0.5 * mass * v1**2 * (1 + beta)}
        for factor in (1, 100):
            for rule in ("printed", "capped"):
                body = {"mass": mass, "inertia": beta * mass * radius**2, "radius": radius, "lever": radius, "k_t": 3.3e3 * factor,
                        "c_t": 12.6 * np.sqrt(factor), "mu": mu, "k_r": 0.0, "c_r": 0.0, "mu_r": 0.0, "capped": rule == "capped"}
                def run(rtol, refinement):
                    log, samples, _, last = on_floor(body, 0.2, rtol, refinement, (0.002, 0.005, 0.0075, 0.01, 0.015, 0.02, 0.05, 0.2), speed, spin)
                    slides = [e for e in log if "slide" in e[1]]
                    sticks = [e for e in log if e[1] == "friction stick"]
                    first = sticks[0] if sticks else [None] * 7
                    return {"slides_from": slides[0][0] if slides else None, "slip_ends": first[0], "speed_then": first[3],
                            "spin_then": first[4], "switches": len(log),
                            "samples_t_x_v_w": [s[:4] for s in samples]}
                soft[f"{shape}_{rule}_stiffness_x{factor}"], error = twice(run)
                worst = max(worst, error)
    return {"source": "Gomes (2014) 3.2.2, A.8-A.19, table 3.2; inertia of a disc (as 2D code) and of a sphere (as appendix A)",
            "parameters": {"mass": mass, "radius": radius, "speed": speed, "spin": spin, "friction": mu, "normal_stiffness": 6.5e4,
                           "tangential_stiffness": 3.3e3, "tangential_damping": 12.6, "static_overlap": mass * G / 6.5e4,
                           "lever": "radius", "normal_force": mass * G},
            "values": {"rigid": rigid, "soft": soft}, "converged": worst}


def rolling_body(beta, mass, radius, k_t, c_t, k_r, eta, mu, mu_r, capped, c_r=None, lever=None):
    inertia = beta * mass * radius**2
    return {"mass": mass, "inertia": inertia, "radius": radius, "lever": lever or radius, "k_t": k_t, "c_t": c_t, "mu": mu, "k_r": k_r,
            "c_r": 2 * eta * np.sqrt((inertia + mass * radius**2) * k_r) if c_r is None else c_r, "mu_r": mu_r, "capped": capped}


def rigid_rolling(beta, radius, speed, mu, mu_r):
    """Slides with friction and rolling couple at their limits, then rolls with the couple at its limit, then rests."""
    slide = speed / (G * (mu + (mu - mu_r) / beta))
    v1 = speed - mu * G * slide
    deceleration = mu_r * G / (1 + beta)
    return {"slip_ends": slide, "speed_then": v1, "spin_then": -v1 / radius, "distance_then": (speed + v1) / 2 * slide,
            "deceleration": deceleration, "deceleration_over_mu_r_g": 1 / (1 + beta), "rests_at": slide + v1 / deceleration,
            "distance": (speed + v1) / 2 * slide + v1**2 / (2 * deceleration)}


def roll(body, end, samples=()):
    def run(rtol, refinement):
        log, taken, turns, last = on_floor(body, end, rtol, refinement, samples, 1.0)
        stick = next((e for e in log if e[1] == "friction stick"), None)
        slides = [e[0] for e in log if e[1].startswith("rolling slide")]
        return {"slip_first_ends": stick and stick[0], "rolling_limit_first_reached": slides[0] if slides else None,
                "first_standstill": turns[0] if turns else None, "turning_points": turns[:6], "largest_distance": max([x for _, x in turns] + [float(last[0])]),
                "distance_at_end": float(last[0]), "speed_at_end": float(last[1]) if abs(last[1]) > 1e-9 else 0.0, "end": end,
                "samples_t_x_v_w_force_couple": taken}
    return twice(run)


@case
def rolling_consistent():
    """Gomes (2014) 3.2.3 with parameters that agree with 2.97, 2.100-2.103: r = 0.005 m, table 3.3, k_r = k_t r^2, c_r by 2.101."""
    radius, density, mu, mu_r, eta = 0.005, 1056.0, 0.8, 0.2, 0.3
    instants = (0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.3, 0.4, 0.5)
    values, worst = {"rigid": {}, "soft": {}}, 0.0
    for shape, beta, mass in (("disc", 0.5, disc(radius, density)[0]), ("sphere", 0.4, sphere(radius, density)[0])):
        values["rigid"][shape] = rigid_rolling(beta, radius, 1.0, mu, mu_r)
        scale = 1.0 if shape == "disc" else mass / disc(radius, density)[0]  # the sphere's springs scaled to the same static overlap
        for factor in (1, 100):
            for rule in ("printed", "capped"):
                k_t, c_t = 3250.0 * scale * factor, 5.7 * scale * np.sqrt(factor)
                body = rolling_body(beta, mass, radius, k_t, c_t, k_t * radius**2, eta, mu, mu_r, rule == "capped")
                values["soft"][f"{shape}_{rule}_stiffness_x{factor}"], error = roll(body, 0.8, instants)
                worst = max(worst, error)
    mass = disc(radius, density)[0]
    for value in (0.05, 0.1, 0.2, 0.4):  # figure 3.9
        values["rigid"][f"disc_mu_r_{value:g}"] = rigid_rolling(0.5, radius, 1.0, mu, value)
        body = rolling_body(0.5, mass, radius, 3250.0, 5.7, 0.08125, eta, mu, value, True)
        values["soft"][f"disc_capped_mu_r_{value:g}"], error = roll(body, {0.05: 2.2, 0.1: 1.2}.get(value, 1.0))
        worst = max(worst, error)
    for value in (0.0, 0.3):  # figure 3.10
        body = rolling_body(0.5, mass, radius, 3250.0, 5.7, 0.08125, value, mu, mu_r, True)
        values["soft"][f"disc_capped_eta_{value:g}"], error = roll(body, 0.8, np.round(np.arange(0.42, 0.6, 0.005), 6).tolist())
        worst = max(worst, error)
    for value in (0.5, 1.0, 2.0):  # figure 3.11
        body = rolling_body(0.5, mass, radius, 3250.0, 5.7, 0.08125 * value, eta, mu, mu_r, True)
        values["soft"][f"disc_capped_k_r_x{value:g}"], error = roll(body, 0.8)
        worst = max(worst, error)
    return {"source": "Gomes (2014) 3.2.3, table 3.3 read with r = 0.005 m; figures 3.9-3.11",
            "parameters": {"radius": radius, "density": density, "speed": 1.0, "friction": mu, "rolling_friction": mu_r, "eta_r": eta,
                           "normal_stiffness": 6.5e4, "tangential_stiffness": 3250.0, "tangential_damping": 5.7, "rolling_stiffness": 0.08125,
                           "rolling_damping": rolling_body(0.5, mass, radius, 1, 1, 0.08125, eta, mu, mu_r, False)["c_r"],
                           "mass": mass, "normal_force": mass * G, "static_overlap": mass * G / 6.5e4,
                           "sphere": "springs and dashpots times m_sphere/m_disc per metre = 4 r/3", "stiffness_x100": "k x 100, dashpots x 10",
                           "initial": "settled on the floor, then v = 1 m/s, no spin, friction and rolling springs at zero"},
            "values": values, "converged": worst}


@case
def rolling_printed():
    """Gomes (2014) 3.2.3 exactly as table 3.3 prints it, with the radius of the text and with the radius that the table fits."""
    values, worst = {}, 0.0
    for radius in (0.05, 0.005):
        mass = disc(radius, 1056.0)[0]
        for rule in ("printed", "capped"):
            for c_r in (0.004, 0.0):
                body = rolling_body(0.5, mass, radius, 3.3e3, 5.7, 8.1e-2, 0, 0.8, 0.2, rule == "capped", c_r=c_r)
                key = f"r_{radius:g}_{rule}" + ("" if c_r else "_without_rolling_dashpot")
                values[key], error = roll(body, 6.0 if radius == 0.05 else 1.0, (0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0))
                worst = max(worst, error)
    return {"source": "Gomes (2014) table 3.3: k_t 3.3e3, k_r 8.1e-2, c_t 5.7, c_r 0.004, mu 0.8, mu_r 0.2",
            "parameters": {"density": 1056.0, "normal_stiffness": 6.5e4, "speed": 1.0, "lever": "radius"}, "values": values, "converged": worst}


@case
def incline():
    """A disc or sphere put at rest on a slope with rolling resistance: it stays while mu_r >= tan(slope)."""
    radius, density, mu, mu_r, eta = 0.005, 1056.0, 0.8, 0.2, 0.3
    values, worst = {}, 0.0
    for shape, beta, mass in (("disc", 0.5, disc(radius, density)[0]), ("sphere", 0.4, sphere(radius, density)[0])):
        scale = mass / disc(radius, density)[0]
        for ratio in (0.5, 0.95, 0.999, 1.001, 1.05, 1.5):
            slope = np.arctan(ratio * mu_r)
            body = rolling_body(beta, mass, radius, 3250.0 * scale, 5.7 * scale, 0.08125 * scale, eta, mu, mu_r, True)
            def run(rtol, refinement):
                log, taken, _, last = on_floor(body, 0.5, rtol, refinement, (0.1, 0.2, 0.3, 0.4, 0.5), 0.0, 0.0, slope)
                return {"samples_t_x_v_w": [s[:4] for s in taken]}
            found, error = twice(run)
            values[f"{shape}_tan_over_mu_r_{ratio:g}"] = found | {
                "slope_degrees": float(np.degrees(slope)),
                "acceleration_while_it_rolls": float(G * (np.sin(slope) - mu_r * np.cos(slope)) / (1 + beta)),
                "elastic_rest_by_statics": float(mass * G * np.sin(slope) * (radius**2 / body["k_r"] + 1 / body["k_t"])),
                "stays": ratio <= 1}
            worst = max(worst, error)
    return {"source": "Gomes (2014) 2.57, figure 2.9(b); Ai et al. (2011)",
            "parameters": {"radius": radius, "density": density, "friction": mu, "rolling_friction": mu_r, "eta_r": eta, "tangential_stiffness": 3250.0,
                           "rolling_stiffness": 0.08125, "tangential_damping": 5.7, "sphere": "springs and dashpots times 4 r/3",
                           "initial": "settled overlap m g cos(slope)/k_n, released at rest with friction and rolling springs at zero; capped"},
            "values": values, "converged": worst}


# --- output ---------------------------------------------------------------------------------------------------------


def rounded(value):
    if isinstance(value, dict):
        return {k: rounded(v) for k, v in value.items()}
    if isinstance(value, (list, tuple, np.ndarray)):
        return [rounded(v) for v in value]
    if isinstance(value, (bool, np.bool_)):
        return bool(value)
    if isinstance(value, (int, np.integer, str)) or value is None:
        return value
    return float(f"{float(value):.14g}")


def differences(new, old, tolerance, path=""):
    if isinstance(new, dict) and isinstance(old, dict):
        if new.keys() != old.keys():
            yield f"{path}: keys {sorted(new.keys() ^ old.keys())} are on one side only"
        for key in new.keys() & old.keys():
            yield from differences(new[key], old[key], tolerance, f"{path}.{key}")
    elif isinstance(new, list) and isinstance(old, list) and len(new) == len(old):
        for i, (a, b) in enumerate(zip(new, old)):
            yield from differences(a, b, tolerance, f"{path}[{i}]")
    elif isinstance(new, float) and isinstance(old, (int, float)):
        if abs(new - old) > tolerance * max(abs(new), abs(old)) + 1e-13:
            yield f"{path}: {new!r} against {old!r}"
    elif new != old:
        yield f"{path}: {new!r} against {old!r}"


def main(arguments):
    check = "--check" in arguments
    names = [a for a in arguments if not a.startswith("-")] or list(CASES)
    results = {name: rounded(CASES[name]()) for name in names}
    if not check:
        print(json.dumps(results, indent=1))
        return 0
    committed = json.loads(pathlib.Path(__file__).with_name("reference.json").read_text())
    found = []
    for name in names:
        found += differences(results[name]["values"], committed[name]["values"], 10 * results[name]["converged"], name)
    print("\n".join(found) or f"{len(names)} cases as committed")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
