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
