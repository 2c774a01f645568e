#!/usr/bin/python3
"""Independent reference solutions for the verification of the DEM engine: closed forms, event-driven rigid limits and
piecewise-smooth ODEs integrated to round-off. Nothing here shares code or discretisation with the engine.

  reference.py            prints the references as JSON (this is reference.json)
  reference.py --check    recomputes all but the slow ones (SLOW in their first line) and compares with the committed reference.json;
                          exit code 1 where they differ
  reference.py NAME...    only these cases

Every case is a function below that returns {source, parameters, values, converged}; `converged` is the relative error to
which the values are known (closed forms: round-off). README.md beside this file holds the set-up of each case in words.
SI units, angles in degrees where the key says so, 2D quantities per metre of depth.
"""
import json
import pathlib
import re
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


def amplification(h, zeta, extrapolated):
    """One step of leapfrog, v' = v + a dt, x' = x + v' dt, on x'' + 2 zeta w x' + w^2 x = 0 with h = w dt, in units dt = 1. State (x of
    the whole step, v of the half step before it, v of the one before that). The dashpot takes the rate extrapolated to the whole step,
    3/2 v - 1/2 v_before (normal contact), or that of the half step, v (slip and rolling). A spring that adds up v dt is x exactly."""
    rate = np.array([0.0, 1.5, -0.5]) if extrapolated else np.array([0.0, 1.0, 0.0])
    v = np.array([0.0, 1.0, 0.0]) - np.array([h * h, 0, 0]) - 2 * zeta * h * rate
    return np.array([np.array([1.0, 0, 0]) + v, v, [0.0, 1.0, 0.0]])


def limit_by_eigenvalues(zeta, extrapolated):
    """The first h at which the spectral radius passes 1."""
    def radius(h):
        return np.max(np.abs(np.linalg.eigvals(amplification(h, zeta, extrapolated)))) - 1
    step = 1e-3 / (1 + zeta)
    h = step
    while radius(h + step) <= 1e-7:  # the double root z = 1 of h = 0 is resolved to the root of round-off
        h += step
    return brentq(lambda x: radius(x) - 1e-13, h, h + step, xtol=1e-15, rtol=1e-15)


@case
def stability():
    """Exact stability limits h = w dt of a damped spring under the engine's integrator (README, "Stability")."""
    restitutions = {f"restitution_{e:g}": damping_ratio_for(e) for e in (0.01, 0.1, 0.3, 0.5, 0.9)}
    printed = {f"printed_{e:g}": printed_damping_ratio(e) for e in (0.01, 0.1, 0.3, 0.5, 0.9)}
    ratios = {f"{z:g}": z for z in (0, 0.05, 0.1, 0.2, 0.3, 0.5, 0.7, 0.782, 1, 1.5, 2, 3, 4, 4.8, 5, 7, 10)}
    table, worst = {}, 0.0
    for name, zeta in (ratios | restitutions | printed).items():
        normal = 2 * (np.sqrt(1 + 4 * zeta**2) - 2 * zeta)
        shear = 2 * (np.sqrt(1 + zeta**2) - zeta)
        numeric, numeric_shear = limit_by_eigenvalues(zeta, True), limit_by_eigenvalues(zeta, False)
        worst = max(worst, abs(numeric / normal - 1), abs(numeric_shear / shear - 1))
        table[name] = {"zeta": zeta, "limit_normal": normal, "limit_normal_by_eigenvalues": numeric, "limit_tangential": shear,
                       "limit_tangential_by_eigenvalues": numeric_shear}
    # Both dashpots on one spring: stable exactly while h^2 + 4 g_n + 2 g_t <= 4, g = c dt / m.
    random = np.random.default_rng(1)
    for _ in range(20000):
        h2, g_n, g_t = random.dirichlet((1, 1, 1)) * [4, 1, 2] * random.choice([1 - 1e-6, 1 + 1e-6])
        roots = np.roots([1, h2 + 1.5 * g_n + g_t - 2, 1 - 2 * g_n - g_t, 0.5 * g_n])
        if (np.max(np.abs(roots)) <= 1 + 1e-12) != (h2 + 4 * g_n + 2 * g_t <= 4):
            raise RuntimeError("the criterion with both dashpots fails")
    return {"source": "eigenvalues of the amplification matrix of leapfrog; dashpots at the extrapolated rate (normal), at that of the half "
                      "step (tangential, rolling)",
            "parameters": {"closed_form_normal": "2 (sqrt(1 + 4 zeta^2) - 2 zeta)", "closed_form_tangential": "2 (sqrt(1 + zeta^2) - zeta)"},
            "values": table, "converged": max(worst, ROUND_OFF)}


def disc(radius, density):
    mass = density * np.pi * radius**2
    return mass, mass * radius**2 / 2


def sphere(radius, density):
    mass = density * 4 / 3 * np.pi * radius**3
    return mass, 0.4 * mass * radius**2


def critical_step_of(quadratic, linear, masses):
    """The dt at which the largest eigenvalue of dt^2 K + 2 dt C against 4 M is 1."""
    scale = 1 / np.sqrt(masses)
    q, c = quadratic * np.outer(scale, scale), linear * np.outer(scale, scale)
    top = lambda dt: np.linalg.eigvalsh(dt * dt * q + 2 * dt * c)[-1] / 4 - 1
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
    elastic, normal_only = assemble(kn, kt, rolling), assemble(kn, 0, lambda wall: 0)
    normal_dashpots = assemble(cn, 0, lambda wall: 0)
    other_dashpots = assemble(0, ct, rolling_dashpot)
    exact = critical_step_of(elastic, 2 * normal_dashpots + other_dashpots, masses)
    lagged = critical_step_of(elastic, normal_dashpots + other_dashpots, masses)
    undamped = critical_step_of(normal_only, 0 * elastic, masses)

    def block_bound(dt):
        """The largest eigenvalue of the particles' own diagonal blocks, with pairs counted twice and walls once (dem/stability.h)."""
        scale = 1 / np.sqrt(np.outer(masses, masses))
        total = scale * (dt * dt * elastic + 2 * dt * (2 * normal_dashpots + other_dashpots))
        walls = scale * (dt * dt * walls_elastic + 2 * dt * walls_dashpots)
        return max(np.linalg.eigvalsh((2 * total - walls)[3 * i:3 * i + 3, 3 * i:3 * i + 3])[-1] for i in range(n)) / 4 - 1

    pairs, contacts = contacts, [(i, j) for i, j in contacts if j is None]
    walls_elastic, walls_dashpots = assemble(kn, kt, rolling), 2 * assemble(cn, 0, lambda wall: 0) + assemble(0, ct, rolling_dashpot)
    contacts = pairs
    by_blocks = brentq(block_bound, 1e-9, 1e-3, xtol=1e-19, rtol=1e-13)
    omega = np.sqrt(2 * kn / mass)
    zeta = cn / (mass * omega)
    return {"source": "Gomes (2014) table 4.1, smallest discs of table 4.2; eta_r = 0.3",
            "parameters": {"radius": radius, "density": density, "normal_stiffness": kn, "tangential_stiffness": kt, "normal_damping": cn,
                           "tangential_damping": ct, "rolling_damping_ratio": eta, "columns": columns, "rows": rows},
            "values": {"sqrt_m_over_k": np.sqrt(mass / kn), "paper_step_over_sqrt_m_over_k": 4e-5 / np.sqrt(mass / kn),
                       "pair_damping_ratio": zeta,
                       "pair_normal_extrapolated": 2 / omega * (np.sqrt(1 + 4 * zeta**2) - 2 * zeta),
                       "pair_normal_lagged": 2 / omega * (np.sqrt(1 + zeta**2) - zeta),
                       "packing": exact, "packing_all_dashpots_lagged": lagged, "packing_undamped_normal_only": undamped,
                       "bound_by_blocks": by_blocks},
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
    friction = Slider(body["k_t"], body["c_t"], body["mu"] * normal, body.get("friction_capped", body["capped"]))
    rolling = Slider(body["k_r"], body["c_r"], body["mu_r"] * body["radius"] * normal, body["capped"])
    if rolling.limit == 0:
        rolling = Slider(0.0, 0.0, 1.0, False)
    if friction.limit == 0:
        friction = Slider(0.0, 0.0, 1.0, False)
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
        parts = [(part, what, function, direction) for part, found in ((friction, friction.switches(force, slip)),
                                                                       (rolling, rolling.switches(couple, turn)))
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
        return {"speed_1": list(map(float, v1)), "speed_2": list(map(float, v2)),
                "angle_1_degrees": float(np.degrees(np.arctan2(v1[1], v1[0]))),
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
                    log, samples, _, last = on_floor(body, 0.2, rtol, refinement, (0.002, 0.005, 0.0075, 0.01, 0.015, 0.02, 0.05, 0.2),
                                                     speed, spin)
                    slides = [e for e in log if "slide" in e[1]]
                    sticks = [e for e in log if e[1] == "friction stick"]
                    first = sticks[0] if sticks else [None] * 7
                    return {"slides_from": slides[0][0] if slides else None, "slip_ends": first[0], "speed_then": first[3],
                            "spin_then": first[4], "switches": len(log),
                            "samples_t_x_v_w": [s[:4] for s in samples]}
                soft[f"{shape}_{rule}_stiffness_x{factor}"], error = twice(run)
                worst = max(worst, error)
                if rule == "capped":
                    body["lever"] = radius - mass * G / 6.5e4
                    soft[f"{shape}_engine_stiffness_x{factor}"], error = twice(run)
                    worst = max(worst, error)
    return {"source": "Gomes (2014) 3.2.2, A.8-A.19, table 3.2; inertia of a disc (as 2D code) and of a sphere (as appendix A)",
            "parameters": {"mass": mass, "radius": radius, "speed": speed, "spin": spin, "friction": mu, "normal_stiffness": 6.5e4,
                           "tangential_stiffness": 3.3e3, "tangential_damping": 12.6, "static_overlap": mass * G / 6.5e4,
                           "lever": "radius", "normal_force": mass * G},
            "values": {"rigid": rigid, "soft": soft}, "converged": worst}


def rolling_body(beta, mass, radius, k_t, c_t, k_r, eta, mu, mu_r, rule, c_r=None, overlap=0.0):
    """rule: `printed`, `capped`, or `engine` (README): friction capped, rolling printed, friction acting at r minus the overlap."""
    inertia = beta * mass * radius**2
    return {"mass": mass, "inertia": inertia, "radius": radius, "lever": radius - (overlap if rule == "engine" else 0), "k_t": k_t,
            "c_t": c_t, "mu": mu, "k_r": k_r, "c_r": 2 * eta * np.sqrt((inertia + mass * radius**2) * k_r) if c_r is None else c_r,
            "mu_r": mu_r, "capped": rule == "capped", "friction_capped": rule != "printed"}


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
                "first_standstill": turns[0] if turns else None, "turning_points": turns[:6],
                "largest_distance": max([x for _, x in turns] + [float(last[0])]),
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
        overlap = disc(radius, density)[0] * G / 6.5e4
        scale = 1.0 if shape == "disc" else mass / disc(radius, density)[0]  # the sphere's springs scaled to the same static overlap
        for factor in (1, 100):
            for rule in ("printed", "capped", "engine"):
                k_t, c_t = 3250.0 * scale * factor, 5.7 * scale * np.sqrt(factor)
                body = rolling_body(beta, mass, radius, k_t, c_t, k_t * radius**2, eta, mu, mu_r, rule, overlap=overlap)
                values["soft"][f"{shape}_{rule}_stiffness_x{factor}"], error = roll(body, 0.8 if factor == 1 else 0.54, instants)
                worst = max(worst, error)
    mass = disc(radius, density)[0]
    disc_of = lambda k_r, eta, mu_r, rule: rolling_body(0.5, mass, radius, 3250.0, 5.7, k_r, eta, mu, mu_r, rule, overlap=overlap)
    for rule in ("capped", "engine"):
        for value in (0.05, 0.1, 0.2, 0.4):  # figure 3.9
            values["rigid"][f"disc_mu_r_{value:g}"] = rigid_rolling(0.5, radius, 1.0, mu, value)
            values["soft"][f"disc_{rule}_mu_r_{value:g}"], error = roll(disc_of(0.08125, eta, value, rule), {0.05: 2.2, 0.1: 1.2}.get(value, 1.0))
            worst = max(worst, error)
        for value in (0.0, 0.3):  # figure 3.10
            values["soft"][f"disc_{rule}_eta_{value:g}"], error = roll(disc_of(0.08125, value, mu_r, rule), 0.8,
                                                                       np.round(np.arange(0.42, 0.6, 0.005), 6).tolist())
            worst = max(worst, error)
        for value in (0.5, 1.0, 2.0):  # figure 3.11
            values["soft"][f"disc_{rule}_k_r_x{value:g}"], error = roll(disc_of(0.08125 * value, eta, mu_r, rule), 0.8)
            worst = max(worst, error)
    return {"source": "Gomes (2014) 3.2.3, table 3.3 read with r = 0.005 m; figures 3.9-3.11",
            "parameters": {"radius": radius, "density": density, "speed": 1.0, "friction": mu, "rolling_friction": mu_r, "eta_r": eta,
                           "normal_stiffness": 6.5e4, "tangential_stiffness": 3250.0, "tangential_damping": 5.7,
                           "rolling_stiffness": 0.08125,
                           "rolling_damping": disc_of(0.08125, eta, mu_r, "engine")["c_r"],
                           "mass": mass, "normal_force": mass * G, "static_overlap": mass * G / 6.5e4,
                           "sphere": "springs and dashpots times m_sphere/m_disc per metre = 4 r/3",
                           "stiffness_x100": "k x 100, dashpots x 10",
                           "initial": "settled on the floor, then v = 1 m/s, no spin, friction and rolling springs at zero"},
            "values": values, "converged": worst}


@case
def rolling_printed():
    """Gomes (2014) 3.2.3 exactly as table 3.3 prints it, with the radius of the text and with the radius that the table fits."""
    values, worst = {}, 0.0
    for radius in (0.05, 0.005):
        mass = disc(radius, 1056.0)[0]
        for rule in ("printed", "capped", "engine"):
            for c_r in (0.004, 0.0):
                body = rolling_body(0.5, mass, radius, 3.3e3, 5.7, 8.1e-2, 0, 0.8, 0.2, rule, c_r=c_r, overlap=mass * G / 6.5e4)
                key = f"r_{radius:g}_{rule}" + ("" if c_r else "_without_rolling_dashpot")
                values[key], error = roll(body, 6.0 if radius == 0.05 else 1.0, (0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0))
                worst = max(worst, error)
    return {"source": "Gomes (2014) table 3.3: k_t 3.3e3, k_r 8.1e-2, c_t 5.7, c_r 0.004, mu 0.8, mu_r 0.2",
            "parameters": {"density": 1056.0, "normal_stiffness": 6.5e4, "speed": 1.0, "lever": "radius"}, "values": values,
            "converged": worst}


@case
def incline():
    """A disc or sphere put at rest on a slope with rolling resistance: it stays while mu_r >= tan(slope)."""
    radius, density, mu, mu_r, eta = 0.005, 1056.0, 0.8, 0.2, 0.3
    values, worst = {}, 0.0
    for shape, beta, mass in (("disc", 0.5, disc(radius, density)[0]), ("sphere", 0.4, sphere(radius, density)[0])):
        scale = mass / disc(radius, density)[0]
        for ratio in (0.5, 0.95, 0.999, 1.001, 1.05, 1.5):
            slope = np.arctan(ratio * mu_r)
            body = rolling_body(beta, mass, radius, 3250.0 * scale, 5.7 * scale, 0.08125 * scale, eta, mu, mu_r, "capped")
            def run(rtol, refinement):
                log, taken, _, last = on_floor(body, 0.5, rtol, refinement, (0.1, 0.2, 0.3, 0.4, 0.5), 0.0, 0.0, slope)
                return {"samples_t_x_v_w": [s[:4] for s in taken]}
            found, error = twice(run)
            body = rolling_body(beta, mass, radius, 3250.0 * scale, 5.7 * scale, 0.08125 * scale, eta, mu, mu_r, "engine",
                                overlap=disc(radius, density)[0] * G * np.cos(slope) / 6.5e4)
            by_engine, more = twice(run)
            error = max(error, more)
            values[f"{shape}_tan_over_mu_r_{ratio:g}"] = found | {
                "engine_samples_t_x_v_w": by_engine["samples_t_x_v_w"],
                "slope_degrees": float(np.degrees(slope)),
                "acceleration_while_it_rolls": float(G * (np.sin(slope) - mu_r * np.cos(slope)) / (1 + beta)),
                "elastic_rest_by_statics": float(mass * G * np.sin(slope) * (radius**2 / body["k_r"] + 1 / body["k_t"])),
                "stays": ratio <= 1}
            worst = max(worst, error)
    return {"source": "Gomes (2014) 2.57, figure 2.9(b); Ai et al. (2011)",
            "parameters": {"radius": radius, "density": density, "friction": mu, "rolling_friction": mu_r, "eta_r": eta,
                           "tangential_stiffness": 3250.0,
                           "rolling_stiffness": 0.08125, "tangential_damping": 5.7, "sphere": "springs and dashpots times 4 r/3",
                           "initial": "settled overlap m g cos(slope)/k_n, released at rest, friction and rolling springs at zero; capped"},
            "values": values, "converged": worst}


# --- impacts and vibrations with closed forms -----------------------------------------------------------------------------


def hertz_stiffness(radius, young):
    """K of F = K overlap^1.5 = 4/3 Y sqrt(R) overlap^1.5, reduced radius and modulus given."""
    return 4 / 3 * young * np.sqrt(radius)


HERTZ_PEAK = (5 / 4) ** 0.4                                # overlap in units of (m v^2 / K)^(2/5)


def hertz_duration():
    """Of an undamped impact, in units of peak overlap / speed: 2 int_0^1 dx / sqrt(1 - x^(5/2)) = (4/5) B(2/5, 1/2)."""
    from scipy.special import beta
    return 0.8 * beta(0.4, 0.5)


def hertz_impact(b, rtol=1e-13, refinement=1.0):
    """F = max(0, x^1.5 + sqrt(5) b x^0.25 v), m = K = v0 = 1: restitution, duration, peak overlap, peak force by integration.

    x^0.25 has no derivative at touch, so the start is integrated in q = x^0.25, in which it is smooth: dt/dq = 4 q^3 / v."""
    alpha = np.sqrt(5) * b
    force = lambda x, v: x**1.5 + alpha * x**0.25 * v
    middle = 0.3
    first = solve_ivp(lambda q, y: [-(q**6 + alpha * q * y[0]) * 4 * q**3 / y[0], 4 * q**3 / y[0]], (0, middle), [1.0, 0.0],
                      method="DOP853",
                      rtol=rtol, atol=rtol * 1e-3, max_step=0.01 / refinement, events=None)
    v, t = first.y[:, -1]
    rates = lambda _, y: [y[1], -force(max(y[0], 1e-300), y[1])]
    longest = 0.02 / refinement
    end = lambda y: y[0] + 0.0 if b == 0 else y[0] ** 1.25 + alpha * y[1] if y[0] > 0 else -1.0
    t1, y1, _, path = integrate(rates, np.array([middle**4, v]), t, t + 50, [(lambda y: y[1], -1)], longest, rtol)
    t2, y2, hit, _ = integrate(rates, y1, t1, t1 + 1e4, [(end, -1)], longest, rtol)
    qs = np.linspace(0, middle, 4001)[1:]
    return {"restitution": float(-y2[1]), "duration": float(t2), "peak_overlap": float(y1[0])}


@case
def restitution():
    """No-tension inversion: damping ratio for e (linear zeta = Tsuji's beta of Hertz), and what the printed formula returns."""
    values, worst = {}, 0.0
    for e in (0.01, 0.02, 0.05, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 0.95, 0.99, 1.0):
        zeta, printed = damping_ratio_for(e), printed_damping_ratio(e)
        entry = {"zeta": zeta, "alpha_hertz": np.sqrt(5) * zeta, "zeta_local_hertz": np.sqrt(5 / 6) * zeta, "zeta_printed": printed,
                 "restitution_of_printed": restitution_of(printed)}
        root = np.sqrt(abs(1 - zeta**2))
        angle = np.arccos(zeta) if zeta < 1 else np.arccosh(zeta)
        decay = zeta / root * angle if root else 1.0
        entry["linear_duration"] = 2 * angle / root                      # in units of sqrt(m/k): F falls to zero
        entry["linear_peak_overlap"] = np.exp(-decay)                    # in units of v0 sqrt(m/k): at w_d t = acos(zeta); it is sqrt(e)
        entry["hertz_peak_overlap"] = (np.sqrt(5 / 4) * np.exp(-decay)) ** 0.8  # in units of (m v0^2/K)^(2/5)
        if e >= 0.02 and e < 1:
            found = hertz_impact(zeta)
            finer = hertz_impact(zeta, 3e-14, 2.0)
            entry["hertz_duration"] = finer["duration"]
            entry["hertz_by_integration"] = finer
            worst = max(worst, abs(finer["restitution"] / e - 1), abs(finer["peak_overlap"] / entry["hertz_peak_overlap"] - 1),
                        abs(finer["duration"] / found["duration"] - 1))
        values[f"{e:g}"] = entry
    return {"source": "Schwager & Poeschel (2007), Thornton et al. (2013); closed forms derived in reference.py, checked by integration",
            "parameters": {"linear": "x'' + 2 zeta x' + x = 0 while the force is positive", "hertz": "x'' + alpha x^0.25 x' + x^1.5 = 0"},
            "values": values, "converged": max(worst, 1e-12)}


@case
def hertz_head_on():
    """Two spheres of different size and material, elastic, head on."""
    r1, r2, density_1, density_2, e1, e2, nu1, nu2, speed = 0.01, 0.015, 2500.0, 7800.0, 1e9, 2e9, 0.25, 0.3, 0.5
    m1, m2 = sphere(r1, density_1)[0], sphere(r2, density_2)[0]
    radius, mass = r1 * r2 / (r1 + r2), m1 * m2 / (m1 + m2)
    young = 1 / ((1 - nu1**2) / e1 + (1 - nu2**2) / e2)
    stiffness = hertz_stiffness(radius, young)
    peak = (5 * mass * speed**2 / (4 * stiffness)) ** 0.4
    unit = (mass * speed**2 / stiffness) ** 0.4
    numeric = hertz_impact(0.0)
    return {"source": "Hertz; Johnson (1985) 11.4: overlap (15 m v^2 / (16 sqrt(R) Y))^(2/5), duration (4/5) B(2/5, 1/2) peak / v",
            "parameters": {"radius": [r1, r2], "density": [density_1, density_2], "young": [e1, e2], "poisson": [nu1, nu2],
                           "shear_modulus": [e1 / 2 / (1 + nu1), e2 / 2 / (1 + nu2)], "closing_speed": speed},
            "values": {"reduced_mass": mass, "reduced_radius": radius, "reduced_modulus": young, "hertz_stiffness": stiffness,
                       "peak_overlap": peak, "peak_force": stiffness * peak**1.5, "duration": hertz_duration() * peak / speed,
                       "duration_constant": hertz_duration(), "peak_constant": HERTZ_PEAK,
                       "duration_in_impact_units": hertz_duration() * HERTZ_PEAK,
                       "rebound_speed_of_1": speed * m2 / (m1 + m2), "energy_stored_at_peak": mass * speed**2 / 2,
                       "integrated_over_closed": {"peak": numeric["peak_overlap"] / HERTZ_PEAK,
                                                  "duration": numeric["duration"] / hertz_duration() / HERTZ_PEAK}},
            "converged": 1e-11}


@case
def free_vibration():
    """A sphere that rests on a floor by a linear spring, set moving at equilibrium and never leaving the floor; undamped and damped."""
    radius, density, stiffness, speed = 0.01, 2500.0, 1e4, 0.005
    mass, _ = sphere(radius, density)
    omega = np.sqrt(stiffness / mass)
    rest = mass * G / stiffness
    values = {"mass": mass, "static_overlap": rest, "angular_frequency": omega, "period": 2 * np.pi / omega,
              "amplitude_undamped": speed / omega,
              "stays_in_contact": bool(speed / omega < rest)}
    for zeta in (0.0, 0.1, 0.5):
        damped = omega * np.sqrt(1 - zeta**2)
        instants = [f * 2 * np.pi / omega for f in (0.125, 0.25, 0.5, 1, 2.3, 10)]
        values[f"zeta_{zeta:g}"] = {"dashpot": 2 * zeta * np.sqrt(stiffness * mass), "damped_period": 2 * np.pi / damped,
                                    "samples_t_rise_v": [[t, speed / damped * np.exp(-zeta * omega * t) * np.sin(damped * t),
                                                          speed * np.exp(-zeta * omega * t) * (np.cos(damped * t) - zeta * omega / damped * np.sin(damped * t))]
                                                         for t in instants]}
    return {"source": "closed form: height above rest = (v0/w_d) exp(-zeta w t) sin(w_d t)",
            "parameters": {"radius": radius, "density": density, "stiffness": stiffness, "upward_speed": speed}, "values": values,
            "converged": ROUND_OFF}


@case
def bouncing_ball():
    """A sphere dropped on a floor: apex heights and instants of four bounces, contact times and gravity during contact included."""
    radius, density, gap = 0.01, 2500.0, 0.1
    mass, _ = sphere(radius, density)

    def bounces(law, stiffness, zeta, rtol, refinement):
        dashpot = {"linear": lambda x: 2 * zeta * np.sqrt(stiffness * mass) + 0 * x,
                   "hertz": lambda x: np.sqrt(5) * zeta * np.sqrt(stiffness * mass) * max(x, 0) ** 0.25}[law]
        elastic = {"linear": lambda x: stiffness * x, "hertz": lambda x: stiffness * max(x, 0) ** 1.5}[law]
        unit = np.sqrt(mass / stiffness) if law == "linear" else hertz_duration() / 3 * (mass**2 / stiffness**2 / np.sqrt(2 * G * gap)) ** 0.2
        force = lambda y: elastic(y[0]) + dashpot(y[0]) * y[1]
        rates = lambda _, y: [y[1], G - force(y) / mass]
        longest = unit / 10 / refinement
        t, height, result = 0.0, gap, []
        for _ in range(4):
            fall = np.sqrt(2 * height / G)
            touch = t + fall
            speed = G * fall
            if law == "hertz":  # start in q = overlap^(1/4), see hertz_impact
                q = (0.01 * HERTZ_PEAK * (mass * speed**2 / stiffness) ** 0.4) ** 0.25
                begin = solve_ivp(lambda q, y: [(G - (stiffness * q**6 + dashpot(q**4) * y[0]) / mass) * 4 * q**3 / y[0], 4 * q**3 / y[0]],
                                  (0, q), [speed, touch], method="DOP853", rtol=rtol, atol=1e-18, max_step=q / 20 / refinement)
                state, start = np.array([q**4, begin.y[0, -1]]), begin.y[1, -1]
            else:
                state, start = np.array([0.0, speed]), touch
            start, state, _, _ = integrate(rates, state, start, start + 1e3 * unit, [(lambda y: y[1], -1)], longest, rtol)
            peak = state[0]
            leave, state, hit, _ = integrate(rates, state, start, start + 20 * unit, [(lambda y: force(y) if zeta else y[0], -1)], longest,
                                             rtol)
            rise = -state[1] / G
            if hit is None or -state[0] + state[1] ** 2 / (2 * G) <= 0:  # too slow to clear the floor again: it settles
                break
            height = -state[0] + state[1] ** 2 / (2 * G)
            t = leave + rise
            result.append({"touch": touch, "peak_overlap": peak, "leaves": leave, "leaves_at_overlap": state[0], "speed_up": -state[1],
                           "apex": t, "height": height, "speed_ratio": -state[1] / speed})
        return {"bounces": result}

    values, worst = {}, 0.0
    for e in (1.0, 0.8, 0.5, 0.3):
        zeta = damping_ratio_for(e)
        values[f"rigid_e_{e:g}"] = {"heights": [gap * e ** (2 * n) for n in (1, 2, 3, 4)]}
        for law, stiffness in (("linear", 1e4), ("linear", 1e6), ("hertz", hertz_stiffness(radius, 1e7)),
                               ("hertz", hertz_stiffness(radius, 1e9))):
            found, error = twice(lambda rtol, refinement: bounces(law, stiffness, zeta, rtol, refinement))
            values[f"{law}_{stiffness:.3g}_e_{e:g}"] = found | {"stiffness": stiffness, "damping_ratio": zeta}
            worst = max(worst, error)
    return {"source": "ODE with events: m x'' = m g - F, F = max(0, spring + dashpot); contact ends when F = 0",
            "parameters": {"radius": radius, "density": density, "gap": gap, "hertz_modulus": "reduced modulus 1e7 and 1e9 Pa",
                           "height": "of the lowest point above the floor; overlap positive in contact"},
            "values": values, "converged": worst}


@case
def oblique_impact():
    """A sphere hits a wall at an angle: gross sliding (closed form) and a damped impact that first sticks (ODE)."""
    radius, density, stiffness, ratio, mu, speed, slip = 0.01, 2500.0, 1e5, 20.0, 0.3, 1.0, 8.0
    mass, inertia = sphere(radius, density)
    k_t = stiffness / ratio
    omega = np.sqrt(stiffness / mass)
    closed = {}
    for e in (1.0,):
        impulse = mu * (1 + e) * mass * speed
        closed[f"e_{e:g}"] = {"normal_impulse": (1 + e) * mass * speed, "tangential_impulse": impulse,
                              "tangential_speed": slip - impulse / mass,
                              "spin": -impulse * radius / inertia,
                              "spin_lever_at_half_overlap": -(impulse * (radius - np.pi / 8 * speed / omega)) / inertia,
                              "slip_after": slip - impulse * (1 / mass + radius**2 / inertia), "peak_overlap": speed / omega}
    sticking_limit = max(ratio * mu, 2 * mu * (1 + mass * radius**2 / inertia))

    def damped(e, slip_speed, shortens, rtol, refinement):
        """State overlap, closing speed, tangential speed, spin, spring force; the spring capped by mu F_n, no tangential dashpot. The friction
        acts at the radius, or where it shortens at the radius less the overlap."""
        zeta = damping_ratio_for(e)
        c = 2 * zeta * np.sqrt(stiffness * mass)
        normal = lambda y: stiffness * y[0] + c * y[1]
        arm = lambda y: radius - shortens * y[0]
        surface = lambda y: y[2] + arm(y) * y[3]
        growth = lambda y: stiffness * y[1] - c * normal(y) / mass
        state, t = np.array([0.0, speed, slip_speed, 0.0, 0.0]), 0.0
        sliding = -1 if c == 0 and slip_speed > ratio * mu * speed else 0
        longest, log = 0.02 / omega / refinement, []
        for _ in range(100):
            held = lambda y: sliding * mu * normal(y) if sliding else y[4]
            rates = lambda _, y: [y[1], -normal(y) / mass, held(y) / mass, held(y) * arm(y) / inertia,
                                  (sliding * mu * growth(y)) if sliding else -k_t * surface(y)]
            switches = [(lambda y: normal(y) if zeta else y[0], -1)]
            if sliding:
                switches.append((lambda y: sliding * (-k_t * surface(y)) - mu * growth(y), -1))
            else:
                switches += [(lambda y: y[4] - mu * normal(y), 1), (lambda y: -y[4] - mu * normal(y), 1)]
            t, state, hit, _ = integrate(rates, state, t, t + 20 * np.pi / omega, switches, longest, rtol)
            if hit == 0:
                break
            sliding = 0 if sliding else (1 if hit == 1 else -1)
            log.append([t, "slides" if sliding else "sticks"])
            if sliding:
                state[4] = sliding * mu * normal(state)
        return {"duration": t, "normal_speed": -state[1], "tangential_speed": state[2], "spin": state[3], "switches": log,
                "tangential_over_normal_impulse": mass * (slip_speed - state[2]) / (mass * (speed - state[1]))}

    values, worst = {"gross_sliding": closed}, 0.0
    for e in (1.0, 0.5):
        for slip_speed in (8.0, 1.0, 0.2):
            for shortens, name in ((0, ""), (1, "_engine")):
                found, error = twice(lambda rtol, refinement: damped(e, slip_speed, shortens, rtol, refinement))
                values[f"e_{e:g}_tangential_{slip_speed:g}{name}"] = found
                worst = max(worst, error)
    return {"source": "Coulomb: tangential impulse = mu x normal impulse while it slides throughout; ODE with events for the rest",
            "parameters": {"radius": radius, "density": density, "normal_stiffness": stiffness, "stiffness_ratio": ratio, "friction": mu,
                           "normal_speed": speed, "tangential_speed": slip,
                           "slides_throughout_if_slip_over_normal_speed_exceeds": sticking_limit,
                           "lever": "radius; of _engine the radius less the overlap. No tangential dashpot"},
            "values": values, "converged": worst}


@case
def spin_decay():
    """A sphere that spins on a floor: about the vertical by torsion, about the horizontal by rolling resistance on a frictionless floor."""
    radius, density, limit_coefficient, eta, spin, k_t = 0.01, 2500.0, 0.05, 0.3, 50.0, 5e3
    mass, inertia = sphere(radius, density)
    limit = limit_coefficient * radius * mass * G
    values, worst = {}, 0.0
    for name, stiffness, reduced in (("torsion", k_t * radius**2, inertia),
                                     ("rolling_frictionless_floor", k_t * radius**2, inertia + mass * radius**2)):
        dashpot = 2 * eta * np.sqrt(reduced * stiffness)
        rigid = {"limit_couple": limit, "deceleration": limit / inertia, "stops_at": inertia * spin / limit,
                 "angle": inertia * spin**2 / (2 * limit)}
        for rule in ("printed", "capped"):
            body = {"mass": mass, "inertia": inertia, "radius": radius, "lever": 0.0, "k_t": 0.0, "c_t": 0.0, "mu": 0.0, "k_r": stiffness,
                    "c_r": dashpot,
                    "mu_r": limit_coefficient, "capped": rule == "capped"}
            def run(rtol, refinement):
                log, taken, _, last = on_floor(body, 1.2 * inertia * spin / limit, rtol, refinement,
                                               [f * inertia * spin / limit for f in (0.1, 0.25, 0.5, 0.75, 0.9)], 0.0, spin)
                return {"samples_t_w": [[s[0], s[3]] for s in taken], "stops_at": next(e[0] for e in log if e[1] == "rolling stick"),
                        "spin_at_end": float(last[2]) if abs(last[2]) > 1e-9 else 0.0}
            found, error = twice(run)
            values[f"{name}_{rule}"] = found | {"stiffness": stiffness, "dashpot": dashpot}
            worst = max(worst, error)
        values[name + "_rigid"] = rigid
    return {"source": "I w' = -T_m: w = w0 - T_m t / I; soft: the same law with its spring and dashpot",
            "parameters": {"radius": radius, "density": density, "coefficient": limit_coefficient, "eta": eta, "spin": spin,
                           "tangential_stiffness": k_t,
                           "normal_force": mass * G}, "values": values, "converged": worst}


# --- statics -----------------------------------------------------------------------------------------------------------


@case
def statics():
    """Columns under gravity, rows of unequal particles squeezed between walls, Janssen."""
    values = {}
    stiffness, young, density = 1e5, 1e8, 2500.0
    radii_of = {"five_equal": [0.01] * 5, "ratio_10": [0.01, 0.001, 0.01], "ratio_100": [0.01, 0.0001, 0.01], "tower_of_100": [0.01] * 100}
    for name, radii in radii_of.items():
        masses = [sphere(r, density)[0] for r in radii]
        for law in ("linear", "hertz"):
            height, centres, overlaps, forces = 0.0, [], [], []
            below = None
            for i, r in enumerate(radii):  # lowest first
                force = sum(masses[i:]) * G
                reduced = r if below is None else r * below / (r + below)
                overlap = force / stiffness if law == "linear" else (force / hertz_stiffness(reduced, young)) ** (2 / 3)
                height = r - overlap if below is None else height + below + r - overlap
                below = r
                centres.append(height), overlaps.append(overlap), forces.append(force)
            if len(radii) > 10:
                values[f"column_{name}_{law}"] = {"top_centre": centres[-1], "lowest_overlap": overlaps[0], "floor_force": forces[0]}
            else:
                values[f"column_{name}_{law}"] = {"centres": centres, "overlaps": overlaps, "forces": forces}
    for name in ("ratio_10", "ratio_100"):
        radii = radii_of[name]
        squeeze = 1e-6
        reduced = [radii[0]] + [a * b / (a + b) for a, b in zip(radii[:-1], radii[1:])] + [radii[-1]]
        ks = np.array([hertz_stiffness(r, young) for r in reduced])
        force = (squeeze / np.sum(ks ** (-2 / 3))) ** 1.5
        values[f"row_{name}"] = {"gap_between_walls": 2 * sum(radii) - squeeze, "squeeze": squeeze, "linear_force": stiffness * squeeze / 4,
                                 "linear_overlap": squeeze / 4, "hertz_force": force, "hertz_overlaps": list((force / ks) ** (2 / 3))}
    depth, diameter, bulk, mu, ratio = 1.0, 0.2, 1500.0, 0.4, 0.5
    length = diameter / (4 * mu * ratio)
    values["janssen_cylinder"] = {"decay_length": length, "base_stress": bulk * G * length * (1 - np.exp(-depth / length)),
                                  "base_force": bulk * G * length * (1 - np.exp(-depth / length)) * np.pi * diameter**2 / 4,
                                  "weight": bulk * G * depth * np.pi * diameter**2 / 4, "saturated_base_stress": bulk * G * length}
    slot = diameter / (2 * mu * ratio)
    values["janssen_slot"] = {"decay_length": slot, "base_stress": bulk * G * slot * (1 - np.exp(-depth / slot)),
                              "base_force": bulk * G * slot * (1 - np.exp(-depth / slot)) * diameter, "weight": bulk * G * depth * diameter}
    return {"source": "equilibrium; Janssen (1895)",
            "parameters": {"linear_stiffness": stiffness, "reduced_modulus_of_every_pair": young, "density": density,
                           "order": "lowest first",
                           "janssen": {"depth": depth, "width_or_diameter": diameter, "bulk_density": bulk, "wall_friction": mu,
                                       "lateral_stress_ratio": ratio}},
            "values": values, "converged": 1e-12}


# --- orders of convergence ----------------------------------------------------------------------------------------------


def march(force, x, v, step, steps, until=None):
    """The engine's integrator as README states it, on x'' = force(x, v) for many independent copies at once (arrays); the rate that a
    dashpot takes is extrapolated from the last two half steps, except in the first step of a contact (x > 0). Ends at whole steps."""
    v = v + 0.5 * step * force(x, v)
    before, touched = v, x >= 0
    for k in range(steps):
        x = x + v * step
        a = force(x, np.where(touched, 1.5 * v - 0.5 * before, v))
        before, touched = v, x >= 0
        v = v + step * a
        if k + 1 == steps or (until is not None and until(x, v)):
            break
    return x, v - 0.5 * step * a


@case
def orders():
    """Expected orders of convergence, seen on scalar contacts with the integrator as README states it; step halved each time."""
    values = {}
    counts = [2**k for k in range(5, 12)]

    def observed(errors):
        return [float(f"{np.log2(a / b):.6f}") for a, b in zip(errors[:-1], errors[1:])]

    for zeta in (0.0, 0.1, 0.5):  # never leaves the spring
        end, damped, rest = 2.3 * 2 * np.pi, np.sqrt(1 - zeta**2), 10.0
        exact = np.exp(-zeta * end) / damped * np.sin(damped * end)
        errors = [abs(march(lambda x, v: rest - x - 2 * zeta * v, np.array([rest]), np.array([1.0]), end / (4 * n),
                            4 * n)[0][0] - rest - exact) for n in counts]
        values[f"smooth_contact_zeta_{zeta:g}"] = {"expected": 2.0, "observed": observed(errors)}

    for zeta, expected in ((0.0, 2.0), (0.1, 1.0)):  # tangential spring and dashpot at the rate of the half step
        end, errors, damped = 2.3 * 2 * np.pi, [], np.sqrt(1 - zeta**2)
        for n in counts:
            step = end / (4 * n)
            f, v = 0.0, 1.0
            v += 0.5 * step * (f - 2 * zeta * v)
            for _ in range(4 * n):
                f -= step * v
                v += step * (f - 2 * zeta * v)
            errors.append(abs(-f - np.exp(-zeta * end) / damped * np.sin(damped * end)))
        values[f"tangential_contact_zeta_{zeta:g}"] = {"expected": expected, "observed": observed(errors)}

    phases = (np.arange(256) + 0.5) / 256
    for name, zeta, p, q in (("linear_e_1", 0.0, 1.0, 0.0), ("linear_e_0.5", damping_ratio_for(0.5), 1.0, 0.0),
                             ("hertz_e_1", 0.0, 1.5, 0.25),
                             ("hertz_e_0.5", damping_ratio_for(0.5), 1.5, 0.25)):
        c = 2 * zeta if q == 0 else np.sqrt(5) * zeta
        def force(x, v):
            depth = np.maximum(x, 0)
            return -np.where(x > 0, np.maximum(0, depth**p + c * depth**q * v), 0.0)
        e = restitution_of(zeta)
        rms, mean = [], []
        for n in counts[1:]:
            step = np.pi / n
            _, v = march(force, -phases * step, np.ones_like(phases), step, 100 * n, lambda x, v: np.all((x < 0) & (v < 0)))
            rms.append(np.sqrt(np.mean((-v - e) ** 2)))
            mean.append(abs(np.mean(-v - e)))
        values[f"impact_{name}"] = {"expected_rms": {"linear_e_1": 3.0, "linear_e_0.5": 1.0, "hertz_e_1": 2.5, "hertz_e_0.5": 1.25}[name],
                                    "observed_rms": observed(rms), "observed_mean": observed(mean),
                                    "rms_error_at_steps_per_half_period": dict(zip(map(str, counts[1:]), map(float, rms)))}
    return {"source": "the integrator of README on scalar contacts; impacts start at 256 phases of the step",
            "parameters": {"steps_per_half_period": counts, "columns": "log2 of the error ratio when the step is halved"},
            "values": values, "converged": 1e-6}


# --- piles --------------------------------------------------------------------------------------------------------------


def pile_positions(radius, copies, jitter, seed=1):
    """25 discs in five rows of five, triangular lattice of pitch 2.04 r just above the floor, odd rows shifted by half a pitch."""
    pitch = 2.04 * radius
    base = np.array([[(i + 0.5 * (j % 2)) * pitch, 1.02 * radius + j * pitch * np.sqrt(3) / 2] for j in range(5) for i in range(5)])
    noise = np.random.default_rng(seed).uniform(-jitter, jitter, (copies, 25, 2)) * radius
    return base[None] + noise


def free_pile(mu_r, copies=8, end=4.0, step=1e-4, radius=0.005):
    """Leapfrog with lagged velocities, all pairs, the printed laws (caps on the springs alone). For statistics, not trajectories."""
    mass, inertia = disc(radius, 1056.0)
    kn, kt, cn, ct, mu, eta = 6.5e4, 3.25e3, 36.5, 5.7, 0.8, 0.6
    x = pile_positions(radius, copies, 0.01)
    v, w = np.zeros_like(x), np.zeros((copies, 25))
    first, second = np.triu_indices(25, 1)
    spread = np.zeros((300, 25))
    spread[np.arange(300), first], spread[np.arange(300), second] = 1.0, -1.0
    both = np.abs(spread)
    def constants(wall):
        rolling_radius = radius if wall else radius / 2
        k_r = kt * rolling_radius**2
        return rolling_radius, k_r, 2 * eta * np.sqrt((inertia + mass * radius**2) / (1 if wall else 2) * k_r)
    stored = {wall: [np.zeros((copies, 25 if wall else 300)) for _ in range(2)] for wall in (False, True)}

    def contact(wall, overlap, closing, slip, turn):
        """Normal force, tangential force, couple on the first body; slip and turn are its motion over the other."""
        rolling_radius, k_r, c_r = constants(wall)
        touching = overlap > 0
        normal = np.where(touching, np.maximum(0, kn * overlap + cn * closing), 0.0)
        spring, couple = stored[wall]
        trial = np.where(touching, spring - kt * slip * step, 0.0)
        limit = mu * normal
        slides = np.abs(trial) > limit
        spring[:] = np.clip(trial, -limit, limit)
        tangential = spring - np.where(slides | ~touching, 0.0, ct * slip)
        turning = np.where(touching, couple - k_r * turn * step, 0.0)
        limit = mu_r * rolling_radius * normal
        full = np.abs(turning) >= limit
        couple[:] = np.clip(turning, -limit, limit)
        return normal, tangential, couple - np.where(full | ~touching, 0.0, c_r * turn)

    for _ in range(int(round(end / step))):
        gap = x[:, first] - x[:, second]
        distance = np.sqrt((gap**2).sum(-1))
        n = gap / distance[..., None]
        t = np.stack([-n[..., 1], n[..., 0]], -1)
        relative = v[:, first] - v[:, second]
        slip = (relative * t).sum(-1) - radius * (w[:, first] + w[:, second])
        normal, tangential, couple = contact(False, 2 * radius - distance, -(relative * n).sum(-1), slip, w[:, first] - w[:, second])
        force = np.einsum("cpk,pi->cik", normal[..., None] * n + tangential[..., None] * t, spread)
        torque = couple @ spread - radius * tangential @ both
        normal, tangential, couple = contact(True, radius - x[..., 1], -v[..., 1], v[..., 0] + radius * w, w)
        force[..., 0] += tangential
        force[..., 1] += normal - mass * G
        torque += radius * tangential + couple
        v += step * force / mass
        w += step * torque / inertia
        x += step * v
    kinetic = 0.5 * mass * (v**2).sum((1, 2)) + 0.5 * inertia * (w**2).sum(1)
    return {"highest_centre_over_r": list(x[..., 1].max(1) / radius), "width_over_r": list((x[..., 0].max(1) - x[..., 0].min(1)) / radius),
            "mean_height_over_r": list(x[..., 1].mean(1) / radius),
            "discs_off_the_floor": [int(c) for c in (x[..., 1] > 1.5 * radius).sum(1)],
            "kinetic_energy": list(kinetic)}


@case
def free_pile_statistics():
    """SLOW (a minute). Gomes (2014) 3.3.1: what an independent small code makes of the 25 discs, with and without rolling resistance."""
    values = {}
    for mu_r in (0.2, 0.0):
        found = free_pile(mu_r, end=3.0)
        values[f"mu_r_{mu_r:g}"] = {key: {"least": min(x), "mean": float(np.mean(x)), "most": max(x)} for key,
                                    x in found.items() if key != "kinetic_energy"} | {
            "largest_kinetic_energy": max(found["kinetic_energy"])}
    return {"source": "free_pile in reference.py: leapfrog, step 1e-4 s, 3 s, eight copies with jitter 0.01 r",
            "parameters": {"reads": "over the eight copies; widths are between outermost centres"}, "values": values, "converged": 0.05}


@case
def piles():
    """Gomes (2014) 3.3: parameters of the two pile tests, with the geometry the text does not give chosen here."""
    def restitution_behind(dashpot, mass, stiffness):
        zeta = dashpot / (2 * np.sqrt(mass * stiffness))
        return {"damping_ratio": zeta, "restitution_of_printed_formula": np.exp(-np.pi * zeta / np.sqrt(1 - zeta**2)),
                "restitution_without_tension": restitution_of(zeta)}

    free_mass = disc(0.005, 1056.0)[0]
    barrier_mass = disc(0.006, 1056.0)[0]
    solid = 105 * np.pi / 4 * (0.013**2 + 2 * 0.012**2 + 0.011**2)
    fine = 3750 * np.pi / 4 * (0.0022**2 + 0.002**2 + 2 * 0.0018**2)
    width, fraction = 0.3, 0.82
    triangle = {f"{angle:g}": {"crest_height": np.sqrt(2 * solid / fraction * np.tan(np.radians(angle))),
                               "toe_distance": np.sqrt(2 * solid / fraction / np.tan(np.radians(angle)))} for angle in (20.5, 21.0, 28.0)}
    return {"source": "Gomes (2014) 3.3.1-3.3.2, tables 3.4-3.7; angles 28, 20.5 degrees, experiment of Li et al. (2005) 21 degrees",
            "parameters": {
                "free_pile": {"radius": 0.005, "density": 1056.0, "count": 25, "normal_stiffness": 6.5e4, "tangential_stiffness": 3.25e3,
                              "normal_damping": 36.5,
                              "tangential_damping": 5.7, "friction": 0.8, "rolling_friction": 0.2, "eta_r": 0.6,
                              "global_damping": [1e-4, 1e-5],
                              "paper_step": 1e-5, "paper_end": 10.0},
                "barrier": {"density_implied_by_c_n": 1056.0, "normal_stiffness": 1.02e6, "tangential_stiffness": 5.09e4,
                            "normal_damping": 173.4,
                            "tangential_damping": 27.7, "friction": 0.4, "rolling_friction": 0.1, "eta_r": 0.3,
                            "global_damping": [6.7e-5, 6.7e-6],
                            "paper_step": 1e-5, "settling": 2.0, "lift_speed": 0.01, "lift_time": 15.0, "rest": 2.0,
                            "groups_420": [[0.013, 105], [0.012, 210], [0.011, 105]],
                            "groups_15000": [[0.0022, 3750], [0.002, 3750], [0.0018, 7500]],
                            "chosen_column_width": width, "chosen_floor_length": 0.8, "chosen_wall_height": 0.6,
                            "chosen_barrier_thickness": "glued particles on a line"}},
            "values": {"free_pile_positions_without_jitter": pile_positions(0.005, 1, 0.0)[0],
                       "free_pile": restitution_behind(36.5, free_mass, 6.5e4) | {"mass": free_mass,
                                                                                  "sqrt_m_over_k": np.sqrt(free_mass / 6.5e4)},
                       "barrier": restitution_behind(173.4, barrier_mass, 1.02e6) | {"mean_mass": barrier_mass, "solid_area_420": solid,
                                                                                     "solid_area_15000": fine,
                                                                                     "fill_height_at_solid_fraction_0.82": solid / fraction / width},
                       "triangle_against_the_wall_at_solid_fraction_0.82": triangle},
            "converged": ROUND_OFF}


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


def printed(results):
    """JSON with the innermost lists on one line each."""
    flat = lambda match: re.sub(r"\s+", " ", match.group(0)).replace("[ ", "[").replace(" ]", "]")
    return re.sub(r"\[[^\[\]{}]*\]", flat, json.dumps(results, indent=1))


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
    slow = {name for name in CASES if CASES[name].__doc__.startswith("SLOW")}
    names = [a for a in arguments if not a.startswith("-")] or [name for name in CASES if not check or name not in slow]
    results = {name: rounded(CASES[name]()) for name in names}
    if not check:
        print(printed(results))
        return 0
    committed = json.loads(pathlib.Path(__file__).with_name("reference.json").read_text())
    found = []
    for name in names:
        found += differences(results[name]["values"], committed[name]["values"], 10 * results[name]["converged"], name)
    print("\n".join(found) or f"{len(names)} cases as committed")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
