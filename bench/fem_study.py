"""The structure: error against run time of every element, static and in motion; CalculiX on the same mesh; what a window costs."""
import json
import math
import os
import pathlib
import shutil
import subprocess
import time
from statistics import median

ELEMENTS = ("Q1", "Q1_b_bar", "Q2")
NAMES = {"Q1": "Q1", "Q1_b_bar": "Q1 B-bar", "Q2": "Q2", "Q2_b_bar": "Q2 B-bar"}
# Steel, 1 m, ten times longer than high: CalculiX and the program get the same cells.
CASE = """dimension = 3
end = 1
[structure]
solver = "fem"
mesh = {{ bar = {{ size = [1, 0.1, 0.1], cells = [{along}, {cells}, {cells}] }} }}
degree = 1
[structure.material]
young = 2.1e11
poisson = 0.3
[structure.fix.x0]
[structure.load.x1]
traction = [0, 0, -1e6]
"""


def bench(study, *arguments):
    return json.loads(study.run([study.program("fem_bench"), *map(str, arguments)]))


def run(study):
    rows = []
    cantilevers = static(study, rows)
    space, steps = motion(study, rows)
    advice(study, cantilevers)
    calculix(study, rows)
    if not study.quick:  # a speed near its target, which the tests' company would decide
        window(study)
    processes(study)
    start_up(study)
    study.csv(["part", "element", "cells over the height", "steps", "unknowns", "error", "seconds", "peak MiB"], rows)
    draw(study, cantilevers, space, steps)


def order(curve):
    return math.log2(curve[-2]["error"] / curve[-1]["error"])


def table(study, title, curves, first):
    study.table(title, ["element", first, "unknowns", "error, relative", "time [s]", "peak memory [MiB]"],
                [[NAMES[e], p["at"], p["unknowns"], f"{p['error']:.2e}", f"{p['seconds']:.4f}", f"{p['mebibytes']:.0f}"]
                 for e, curve in curves.items() for p in curve])


# --- a cantilever in equilibrium --------------------------------------------------------------------------------------
def static(study, rows):
    found = {}
    finest = 16 if study.quick else 64
    for title, shape, poisson, elements, cells, reference in (
            ("plane strain", "plane", 0.3, ELEMENTS, {1: (2, 4, 8, 16, 32), 2: (1, 2, 4, 8, 16)}, ("Q2", finest)),
            ("plane strain, ν = 0.4999", "plane", 0.4999, (*ELEMENTS, "Q2_b_bar"), {1: (2, 4, 8, 16, 32), 2: (1, 2, 4, 8, 16)},
             ("Q2_b_bar", finest)),
            ("solid", "solid", 0.3, ELEMENTS, {1: (2, 4, 8), 2: (1, 2, 3)}, ("Q2", 4 if study.quick else 6))):
        exact = bench(study, "static", shape, reference[0], poisson, reference[1])["deflection"]
        curves = {}
        for element in elements:
            curve = curves[element] = []
            for n in cells[2 if element.startswith("Q2") else 1]:
                if study.quick and n > 8:
                    continue
                turns = [bench(study, "static", shape, element, poisson, n) for _ in range(1 if study.quick else 5)]
                best = turns[0] | {"seconds": median(t["seconds"] for t in turns), "at": n,
                                   "error": abs(turns[0]["deflection"] / exact - 1)}
                curve.append(best)
                rows.append([f"static, {title}", NAMES[element], n, "", best["unknowns"], best["error"], best["seconds"], best["mebibytes"]])
        found[title] = curves
        table(study, f"Cantilever, {title}: error of the deflection against cells over the height and run time", curves, "cells over the height")
    plane = found["plane strain"]
    study.target("Cantilever: order of Q1 in the deflection", "–", order(plane["Q1"][:4]), "2 ± 0.15",
                 abs(order(plane["Q1"][:4]) - 2) <= 0.15, "{:.2f}")
    four = {e: next(p["error"] for p in plane[e] if p["at"] == 4) for e in ELEMENTS}
    study.at_most("Cantilever: error of Q2, 4 cells over the height", "–", four["Q2"], 1e-3, "{:.2g}")
    locked = next(p["error"] for p in found["plane strain, ν = 0.4999"]["Q1"] if p["at"] == 4)
    cured = next(p["error"] for p in found["plane strain, ν = 0.4999"]["Q1_b_bar"] if p["at"] == 4)
    study.at_most("Cantilever, ν = 0.4999: error of Q1 B-bar over that of Q1, which locks, 4 cells over the height", "–", cured / locked, 0.1, "{:.2g}")
    study.text(f"Steel, 1 m by 0.1 m, clamped at one end, 1 MPa of shear on the other. The reference is Q2 (B-bar where ν = 0.4999) on {finest} cells over the height "
               f"in the plane, {4 if study.quick else 6} in space; the corners of the clamp are singular, so that no element keeps its full order. The time is that of "
               "mesh, assembly, factorisation and solution in a process that has begun; the memory that of the process, of which deal.II's libraries take 150 MiB.")
    return found


# --- a bar that swings ------------------------------------------------------------------------------------------------
def motion(study, rows):
    fine = 4000 if study.quick else 16000
    steps, space = {}, {}
    for element, cells in (("Q2", 4),):
        curve = steps[element] = []
        for count in (50, 100, 200, 400, 800):
            curve.append(bench(study, "motion", element, cells, count) | {"at": count})
            rows.append(["motion, steps", element, cells, count, *(curve[-1][k] for k in ("unknowns", "error", "seconds", "mebibytes"))])
    for element, counts in (("Q1", (1, 2, 4)), ("Q2", (1, 2))):
        curve = space[element] = []
        for n in counts:
            curve.append(bench(study, "motion", element, n, fine) | {"at": n})
            rows.append(["motion, cells", element, n, fine, *(curve[-1][k] for k in ("unknowns", "error", "seconds", "mebibytes"))])
    study.target("Free vibration: order in the step", "–", order(steps["Q2"]), "2 ± 0.05", abs(order(steps["Q2"]) - 2) <= 0.05, "{:.3f}")
    study.target("Free vibration: order of Q1 in the cells", "–", order(space["Q1"]), "2 ± 0.1", abs(order(space["Q1"]) - 2) <= 0.1, "{:.3f}")
    # The trapezoidal rule lags by (ω Δt)²/12 of the phase, which is 4.5 π/2 after two and a quarter periods.
    expected = 4.5 * math.pi * (4.5 * math.pi / 800) ** 2 / 12
    study.at_most("Free vibration: error of 800 steps over the phase's lag ω t (ω Δt)²/12, less 1", "–", abs(steps["Q2"][-1]["error"] / expected - 1), 0.01, "{:.2g}")
    table(study, "A bar swings along itself for 2¼ periods, Q2, 4 cells over the height: error against steps and run time", steps, "steps")
    table(study, f"The same in {fine} steps: error against cells and run time", space, "cells over the height")
    study.text("u = cos(ωt) sin(πx/2L), exact for ν = 0. After 2¼ periods the bar should be straight: what is left is the error of the phase.")
    return space, steps


def advice(study, found):
    """A sentence from the tables: the cheapest element to 1 % and to 0.2 %."""
    words = []
    for title, curves in found.items():
        for bound in (1e-2, 2e-3):
            reached = [(p["unknowns"], NAMES[e], p["at"], p["seconds"]) for e, curve in curves.items() for p in curve if p["error"] <= bound]
            if reached:
                unknowns, name, n, seconds = min(reached)
                words.append(f"{title}, to {100 * bound:g} %: {name} with {n} cell{'s' * (n > 1)} over the height ({unknowns} unknowns, {seconds:.3f} s)")
    study.text("**What to choose.** The fewest unknowns of this table that reach an error of the deflection: " + "; ".join(words) + ". "
               "B-bar cures what ν near 0.5 does to a cell; that first order is too stiff in bending it cannot cure, second order does.")


# --- CalculiX ---------------------------------------------------------------------------------------------------------
def timed(study, command, folder):
    """Seconds and peak memory [MiB] of a process from its start to its end, on one thread."""
    start = time.perf_counter()
    process = subprocess.Popen(command, cwd=folder, stdout=subprocess.DEVNULL, stderr=subprocess.STDOUT,
                               env=os.environ | {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", "CCX_NPROC_RESULTS": "1"})
    _, status, usage = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode != 0:
        raise SystemExit(f"{study.name}: {' '.join(map(str, command))} ended with {process.returncode}")
    return time.perf_counter() - start, usage.ru_maxrss / 1024


def calculix(study, rows):
    cells = 8
    what = f"Cantilever of {10 * cells} × {cells} × {cells} Q1"
    time_of, same = f"{what}: process start to results over CalculiX's", f"{what}: displacements against CalculiX's C3D8, relative to the largest"
    if not shutil.which("ccx"):
        study.at_most(time_of, "–", None, 1.0, "{:.2f}")
        study.at_most(same, "–", None, 1e-6)
        return
    folder = pathlib.Path(study.work)
    study.run([study.program("fem_bench"), "deck", str(cells), str(folder / "bar.inp")])
    (folder / "bar.toml").write_text(CASE.format(along=10 * cells, cells=cells))
    ours, theirs = [], []
    for turn in range(5 if study.quick else 11):
        ours.append(timed(study, [study.program("acopla-fem"), "bar.toml", "--results", f"results-{turn}"], folder))
        theirs.append(timed(study, ["ccx", "bar"], folder))
    ratio = median(t for t, _ in ours) / median(t for t, _ in theirs)
    study.at_most(time_of, "–", ratio, 1.0, "{:.2f}")
    compared = bench(study, "compare", cells, folder / "bar.dat")
    bound = 10 * compared["condition"] * 2.0 ** -52
    study.at_most(same, "–", compared["plain"], bound + compared["rounding"], "{:.4g}")
    for name, runs in (("Acopla", ours), ("CalculiX", theirs)):
        rows.append([what, name, cells, "", compared["unknowns"], "", median(t for t, _ in runs), median(m for _, m in runs)])
    study.table(f"{what}, {compared['unknowns']} unknowns, one thread: process start to results", ["program", "median [s]", "least", "most", "peak memory [MiB]"],
                [[name, f"{median(t for t, _ in runs):.3f}", f"{min(runs)[0]:.3f}", f"{max(runs)[0]:.3f}", f"{median(m for _, m in runs):.0f}"]
                 for name, runs in (("Acopla", ours), ("CalculiX (SPOOLES)", theirs))])
    study.text(f"Runs in turns; the aim beyond the target is 0.6. CalculiX's C3D8 is the fully integrated trilinear brick of its manual, the same discretisation as Q1 without B-bar "
               f"(with B-bar the two differ by {compared['b_bar']:.1e}). The stiffness has κ = {compared['condition']:.2g}, so 10 κ ε = {bound:.1e}; CalculiX prints seven digits, "
               f"and half a unit of the last ({compared['rounding']:.1e} of the largest displacement) is allowed on top: it is what limits the comparison.")


# --- a window ---------------------------------------------------------------------------------------------------------
def window(study):
    cost = bench(study, "window", 8)
    study.at_most(f"Re-solve of a window, {cost['unknowns']} unknowns, over the time to stream the factor once", "–", cost["solve"] / cost["stream"], 2.0, "{:.2f}")
    study.table("A window of a structure in motion (medians of turns)", ["what", "time [ms]"],
                [["the factor, read once", f"{1e3 * cost['stream']:.2f}"], ["forward and back substitution", f"{1e3 * cost['solve']:.2f}"],
                 ["the whole window: products, substitution, reactions", f"{1e3 * cost['window']:.2f}"]])
    study.text(f"The factor L takes {cost['factor'] / 2 ** 20:.0f} MiB, the process {cost['mebibytes']:.0f} MiB. Substitution reads it twice, as L and as Lᵀ.")


# --- the same case on one process and on two ---------------------------------------------------------------------------
SHARED = """dimension = 3
end = 1
[structure]
solver = "fem"
mesh = {{ bar = {{ size = [1, 0.2, 0.2], cells = [{along}, {across}, {across}] }} }}
degree = 1
linear_solver = "{solver}"
[structure.material]
young = 2.1e11
poisson = 0.3
[structure.fix.x0]
[structure.load.x1]
traction = [0, 0, -1e6]
[structure.output]
vtu = false
hdf5 = true
condition = {condition}
"""


def processes(study):
    import h5py
    import numpy as np
    across = 4 if study.quick else 16
    environment = os.environ | {"OMPI_ALLOW_RUN_AS_ROOT": "1", "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1", "OMPI_MCA_rmaps_base_oversubscribe": "1"}
    rows, fields, kappa = [], {}, None
    for name, count, solver in (("one, direct", 1, "direct"), ("one, conjugate gradients", 1, "cg"), ("two", 2, "auto")):
        folder = pathlib.Path(study.work) / f"shared-{count}-{solver}"
        shutil.rmtree(folder, ignore_errors=True)
        folder.mkdir(parents=True)
        case = folder / "case.toml"
        case.write_text(SHARED.format(along=5 * across, across=across, solver=solver, condition="true" if solver == "direct" else "false"))
        command = ([] if count == 1 else ["mpirun", "-np", str(count)]) + [study.program("acopla-fem"), str(case), "--results", str(folder / "results")]
        begin = time.perf_counter()
        with open(folder / "out.txt", "w") as out:
            process = subprocess.Popen(command, stdout=out, stderr=subprocess.STDOUT, env=environment)
            _, status, usage = os.wait4(process.pid, 0)
        process.returncode = os.waitstatus_to_exitcode(status)
        seconds = time.perf_counter() - begin
        if process.returncode != 0:
            study.at_most("Two processes: difference from one [κ ε]", "–", None, 10.0)
            return
        values = {w[0]: float(w[1]) for w in map(str.split, (folder / "out.txt").read_text().splitlines()) if len(w) == 2}
        kappa = values.get("condition", kappa)
        found = []
        with h5py.File(folder / "results/structure.h5") as file:
            file.visititems(lambda path, item: found.append(item[-1]) if path.endswith("displacement") and isinstance(item, h5py.Dataset) else None)
        fields[name] = np.array(found[0])
        rows.append([name, f"{int(values['dofs'])}", seconds, values.get("memory.largest", 1024 * usage.ru_maxrss) / 2 ** 20])
    scale = np.abs(fields["one, direct"]).max() * kappa * np.finfo(float).eps
    differences = {name: np.abs(field - fields["one, direct"]).max() / scale for name, field in fields.items()}
    study.at_most("Two processes: difference from one with its direct solver [κ ε]", "–", differences["two"], 10.0, "{:.2g}")
    study.table(f"A bar in bending on one process and on two (κ = {kappa:.3g}; memory is the largest peak of a process; the direct solver also found κ, by 12 more solutions)",
                ["processes", "unknowns", "difference from the direct solver [κ ε]", "run time [s]", "peak memory of a process [MiB]"],
                [[name, unknowns, f"{differences[name]:.2g}", f"{seconds:.2f}", f"{mebibytes:.0f}"] for name, unknowns, seconds, mebibytes in rows])


def start_up(study):
    suite = study.program("test_fem")
    if not os.path.exists(suite):
        study.at_most("Unit tests: start of the process, share of each test [s]", "–", None, 0.05)
        return
    tests = sum(1 for line in study.run([suite, "--gtest_list_tests"]).splitlines() if line.startswith("  "))
    seconds = median(timed(study, [suite, "--gtest_list_tests"], study.work)[0] for _ in range(5))
    study.at_most(f"Unit tests: start of the process [s] over its {tests} tests", "–", seconds / tests, 0.02, "{:.4f}")


def draw(study, cantilevers, space, steps):
    def curves(axes):
        for axis, (title, of) in zip(axes, cantilevers.items()):
            for element, curve in of.items():
                axis.loglog([p["seconds"] for p in curve], [p["error"] for p in curve], "o-", ms=3, label=NAMES[element])
            axis.set_title(title, fontsize=9)
            axis.set_xlabel("run time [s]")
            axis.legend(fontsize=7)
        axes[0].set_ylabel("error of the deflection")
        for element, curve in space.items():
            axes[-1].loglog([p["seconds"] for p in curve], [p["error"] for p in curve], "o-", ms=3, label=f"{NAMES[element]}, cells")
        for element, curve in steps.items():
            axes[-1].loglog([p["seconds"] for p in curve], [p["error"] for p in curve], "s--", ms=3, label=f"{NAMES[element]}, steps")
        axes[-1].set_title("free vibration", fontsize=9)
        axes[-1].set_xlabel("run time [s]")
        axes[-1].legend(fontsize=7)

    study.figure(curves, size=(13, 3.6), panels=4)
