"""The DEM's verification table, and error against step size and run time of every case in it.

bench/dem_accuracy.cc runs the cases of tests/verification/dem (closed forms and ODEs in reference.json, see the README there); the piles are
the cases free_pile and moving_barrier.
"""
import importlib.util
import json
import math
import statistics
import subprocess

SMALLEST = 0.003125   # of the critical step
FILLINGS = 8


def lines(study, *command):
    return [json.loads(line) for line in study.run([study.program("dem_accuracy"), *command]).splitlines()]


def worst(rows, case, *keys):
    """Largest error of a case's rows whose key contains one of `keys` (all, if none is given)."""
    return max(row["worst"] for row in rows if row["case"] == case and (not keys or any(key in row["key"] for key in keys)))


def value(rows, case, key, name):
    return next(f["value"] for row in rows if row["case"] == case and row["key"] == key for f in row["figures"] if f["name"].startswith(name))


def tests(study, figure, reference, names):
    """Tests of the suite as one row: how many fail."""
    done = subprocess.run([study.program("test_dem_verification"), f"--gtest_filter={names}", "--gtest_output=json:" + str(study.work / "t.json")],
                          stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    told = json.loads((study.work / "t.json").read_text()) if (study.work / "t.json").exists() else {"tests": 0, "failures": 1}
    good = done.returncode == 0 and told["tests"] > 0
    study.target(figure, reference, f"{told['tests'] - told['failures']} of {told['tests']} tests", "all", good)


def analytic(study, rows):
    """The rows of the table that have a closed form or an ODE, at 0.01 of the critical step."""
    for name, printed in (("angle 1", 66.99), ("angle 2", -23.01)):
        found = value(rows, "collision", "1", name)
        study.target(f"elastic collision, {name} at k_n 4.9e4 [degrees]", f"{printed} (paper)", found, "± 0.005", abs(found - printed) <= 0.005,
                     "{:.4f}")
    study.at_most("elastic collision, velocities and angles against the ODE, worst of 7 stiffnesses", "ODE", worst(rows, "collision"), 2e-5)
    stiff = [value(rows, "collision", str(k), "angle 1") for k in range(7)]
    rigid = 90 - math.degrees(math.asin(0.03 / 0.08))
    study.at_most("elastic collision, distance from the rigid angle at k_n 4.9e10 [degrees]", f"{rigid:.4f} (sin θ = b/(r1 + r2))",
                  abs(stiff[6] - rigid), 2e-3)
    v, w = (value(rows, "struck", "disc_engine_stiffness_x100", name) for name in ("v at 0.2 s", "ω r at 0.2 s"))
    study.target("struck ball, speed in the end [m/s]", "0.94444 (rigid)", v, "± 1.5e-3 (overlap 2.5e-3 r)", abs(v - 0.944444) <= 1.5e-3, "{:.5f}")
    study.target("struck ball, spin in the end [rad/s]", "−31.4815 (rigid)", w / 0.03, "± 0.1 (overlap 2.5e-3 r)", abs(w / 0.03 + 31.4815) <= 0.1,
                 "{:.4f}")
    study.at_most("struck ball, trajectories of discs and spheres", "ODE", worst(rows, "struck"), 6e-5)
    for shape, ratio in (("disc", 2 / 3), ("sphere", 5 / 7)):
        key = f"{shape}_engine_stiffness_x1"
        slowing = (value(rows, "rolling_consistent", key, "v at 0.3 s") - value(rows, "rolling_consistent", key, "v at 0.4 s")) / 0.1 / (0.2 * 9.81)
        study.target(f"rolling {shape}, deceleration over μ_r g", f"{ratio:.5f}", slowing, "± 1.2e-3 relative (overlap 2.5e-3 r)",
                     abs(slowing / ratio - 1) <= 1.2e-3, "{:.5f}")
    study.at_most("rolling, trajectories and standstill, consistent parameters (figures 3.9–3.11)", "ODE", worst(rows, "rolling_consistent"), 1.5e-4)
    study.at_most("rolling, table 3.3 as printed, both radii", "ODE", worst(rows, "rolling_printed"), 4e-4)
    turned, stopped = (value(rows, "rolling_printed", f"r_{r}_engine", "distance") for r in ("0.05", "0.005"))
    study.target("rolling, table 3.3 as printed, r 0.05 m: turns back at [m]", "0.3904", turned, "± 2e-4", abs(turned - 0.39044) <= 2e-4, "{:.4f}")
    study.target("rolling, table 3.3 as printed, r 0.005 m: stops at [m]", "0.1537", stopped, "± 1e-4", abs(stopped - 0.15373) <= 1e-4, "{:.4f}")
    study.at_most("incline at 0.5 … 1.5 of the threshold, discs and spheres", "ODE", worst(rows, "incline"), 4e-4)
    study.at_most("free vibration, ten periods, ζ 0", "damped cosine", max(r["worst"] for r in rows if r["case"] == "vibration" and r["key"] == "0"), 1.4e-4)
    study.at_most("free vibration, ζ 0.1 and 0.5", "damped cosine", max(r["worst"] for r in rows if r["case"] == "vibration" and r["key"] != "0"), 1.2e-5)
    study.at_most("bouncing ball, four bounces, elastic", "ODE", worst(rows, "bounce", "e 1"), 5e-5)
    study.at_most("bouncing ball, four bounces, e 0.8, 0.5, 0.3", "ODE", worst(rows, "bounce", "e 0"), 3e-3)
    study.at_most("Hertz head-on, peak overlap, force, duration", "closed form", worst(rows, "hertz"), 1e-5)
    study.at_most("oblique impact in gross sliding", "Coulomb's impulse", worst(rows, "oblique", "e 1 slip 8"), 7e-6)
    study.at_most("oblique impacts that stick and slide, e 1 and 0.5", "ODE", worst(rows, "oblique"), 2e-3)
    study.at_most("spin decay, twisting and rolling", "ODE", worst(rows, "spin"), 1.5e-3)
    study.at_most("columns of equal, 10:1:10 and 100:1:100 spheres: weight on the floor", "statics",
                  max(f["error"] for r in rows if r["case"] == "column" for f in r["figures"] if f["name"].startswith("force")), 1e-7)
    study.at_most("three in a row, size ratios 10 and 100, squeezed: force and overlap", "statics", worst(rows, "row"), 1e-6)


def restitution(study):
    rows = lines(study, "restitution")
    own = [row for row in rows if not row["paper"] and row["restitution"] >= 0.1]
    for normal, bound in (("linear", 2e-3), ("hertz", 8e-3)):
        chosen = [row for row in own if row["normal"] == normal]
        study.at_most(f"restitution at the default step (0.2), {normal}, e 0.1 … 1: mean over phases", "input",
                      max(abs(row["mean"] - row["expected"]) for row in chosen), bound)
        study.at_most(f"restitution at the default step (0.2), {normal}, e 0.1 … 1: worst phase", "input", max(row["worst"] for row in chosen), 0.0125)
    printed = [row for row in rows if row["paper"]]
    study.at_most("restitution of the option `paper` at the default step: mean over phases", "what the printed formula gives",
                  max(abs(row["mean"] - row["expected"]) for row in printed), 8e-3)
    study.table("Restitution at the default step of 0.2 of critical: mean and worst deviation over 16 phases of the step at touch",
                ["e", "linear", "worst", "Hertz", "worst", "`paper`, linear", "what it really gives"],
                [[f"{row['restitution']:g}", f"{row['mean']:.4f}", f"{row['worst']:.1e}"] + next(
                    [f"{h['mean']:.4f}", f"{h['worst']:.1e}"] for h in rows if h["normal"] == "hertz" and not h["paper"]
                    and h["restitution"] == row["restitution"]) + next(
                    ([f"{p['mean']:.4f}", f"{p['expected']:.4f}"] for p in printed if p["normal"] == "linear" and
                     p["restitution"] == row["restitution"]), ["1", "1"])
                 for row in rows if row["normal"] == "linear" and not row["paper"]])
    return rows


def order_of(points):
    """Slope of log error over log step, least squares, over the finer half of the sweep."""
    half = sorted(points)[:max(3, len(points) // 2)]
    x, y = [math.log(p[0]) for p in half], [math.log(p[1]) for p in half]
    mx, my = statistics.mean(x), statistics.mean(y)
    return sum((a - mx) * (b - my) for a, b in zip(x, y)) / sum((a - mx)**2 for a in x)


def sweep(study):
    rows = lines(study, "sweep", str(0.0125 if study.quick else SMALLEST))
    series = {}
    for row in rows:
        series.setdefault((row["case"], row["law"]), []).append(row)
    orders = {name: order_of([(row["fraction"], row["error"]) for row in points]) for name, points in series.items()}
    for name in (("free vibration", "linear, ζ 0"), ("free vibration", "linear, ζ 0.1"), ("free vibration", "linear, ζ 0.5"),
                 ("tangential spring", "linear slider"), ("rolling spring", "elastic-plastic"), ("Hertz head-on", "Hertz, e 1")):
        study.target(f"order of convergence, {name[0]} ({name[1]})", "2", orders[name], "2 ± 0.1", abs(orders[name] - 2) <= 0.1, "{:.3f}")
    show = lambda points, fraction: next((f"{row['error']:.1e}" for row in points if abs(row["fraction"] / fraction - 1) < 1e-6), "–")
    study.table("Largest error of each case by step, as a fraction of the critical step (0.2 is the default), fitted order over the finer half",
                ["case", "law", "0.4", "0.2", "0.05", "0.0125", f"{SMALLEST:g}", "order", "expected"],
                [[*name, *(show(points, f) for f in (0.4, 0.2, 0.05, 0.0125, SMALLEST)), f"{orders[name]:.2f}", f"{points[0]['order']:g}"]
                 for name, points in series.items()])
    study.text("Orders other than 2 are those of a force that is not smooth: it jumps at touch (linear dashpot, 1), has a root there (Hertz's, "
               "5/4), switches between sticking and sliding within a step, or has a dashpot that takes the rate half a step late (tangential and "
               "rolling, 1). The worst of several phases of the step at touch is taken where there is an impact; fits of such cases scatter. The "
               "elastic collision is better than its path because energy is kept better. Rolling and spin begin with the printed law's dashpot "
               "outside the cap, which acts for the one step in which the spring reaches its limit.")
    study.csv(["case", "law", "expected_order", "fraction", "step_s", "steps", "seconds", "error"],
              [[row["case"], row["law"], row["order"], row["fraction"], row["step"], row["steps"], row["seconds"], row["error"]] for row in rows])

    groups = {"contacts that stay closed": ("free vibration", "tangential spring", "rolling spring"),
              "impacts": ("elastic collision", "bouncing ball", "Hertz head-on", "restitution", "oblique, gross sliding", "oblique, sticks then slides"),
              "sliding and rolling": ("struck disc", "struck sphere", "rolling disc", "rolling sphere", "spin decay, twisting", "spin decay, rolling")}

    def against(of, label):
        def draw(panels):
            for axes, (title, members) in zip(panels, groups.items()):
                for name, points in series.items():
                    if name[0] in members:
                        axes.loglog([row[of] for row in points], [row["error"] for row in points], "o-", ms=2.5, lw=1,
                                    label=f"{name[0]} ({name[1]})")
                axes.set_title(title, fontsize=9)
                axes.set_xlabel(label)
                axes.legend(fontsize=5.5)
                axes.grid(alpha=0.3)
            panels[0].set_ylabel("largest error")
        return draw

    study.figure(against("fraction", "step / critical step"), (12, 4.2), panels=3)
    study.figure(against("seconds", "run time [s]"), (12, 4.2), part="run_time", panels=3)


def rolling_figures(study):
    """Gomes's figures 3.9 to 3.11."""
    reference = json.loads((study.root / "tests" / "verification" / "dem" / "reference.json").read_text())["rolling_consistent"]["values"]["soft"]
    trace = lambda key, end: lines(study, "trace", key, str(end))
    speeds = {mu: trace(f"disc_engine_mu_r_{mu:g}", 2.2) for mu in (0.05, 0.1, 0.2, 0.4)}
    etas = {eta: trace(f"disc_engine_eta_{eta:g}", 0.6) for eta in (0, 0.3)}
    factors = {k: trace(f"disc_engine_k_r_x{k:g}", 0.65) for k in (0.5, 1, 2)}

    def draw(panels):
        for mu, rows in speeds.items():
            line = panels[0].plot([r["time"] for r in rows], [r["v"] for r in rows], lw=1, label=f"μ_r = {mu:g}")
            panels[0].plot([reference[f"disc_engine_mu_r_{mu:g}"]["first_standstill"][0]], [0], "x", color=line[0].get_color())
        panels[0].set_ylabel("speed [m/s]")
        for eta, rows in etas.items():
            late = [r for r in rows if r["time"] > 0.42]
            line = panels[1].plot([r["time"] for r in late], [1e3 * r["couple"] for r in late], lw=1, label=f"η = {eta:g}")
            panels[1].plot([s[0] for s in reference[f"disc_engine_eta_{eta:g}"]["samples_t_x_v_w_force_couple"]],
                           [1e3 * s[5] for s in reference[f"disc_engine_eta_{eta:g}"]["samples_t_x_v_w_force_couple"]], ".", ms=4,
                           color=line[0].get_color())
        panels[1].set_ylabel("rolling couple [mN m]")
        for k, rows in factors.items():
            late = [r for r in rows if r["time"] > 0.45]
            panels[2].plot([r["time"] for r in late], [1e3 * r["x"] for r in late], lw=1, label=f"{k:g} k_r")
        panels[2].set_ylabel("distance [mm]")
        for axes in panels:
            axes.set_xlabel("t [s]")
            axes.legend(fontsize=7)
            axes.grid(alpha=0.3)

    study.figure(draw, (12, 3.6), part="rolling", panels=3)
    study.text("Figures 3.9 to 3.11 of Gomes (2014) at the default step, parameters made consistent: speed for four rolling frictions (crosses: "
               "standstill by the ODE), the couple with and without the rolling dashpot (dots: ODE), the last millimetres for three rolling "
               "stiffnesses.")


def table_3_1(study, rows):
    pick = lambda k, name: value(rows, "collision", str(k), name)
    stiffness = (4.9e3, 4.9e4, 4.9e5, 4.9e6, 4.9e7, 4.9e8, 4.9e10)
    study.table("Table 3.1: elastic collision of two discs (paper at 4.9e4 N/m: 66.99°, −23.01°, (0.15, 0.36), (0.85, −0.36))",
                ["k_n [N/m]", "angle 1", "angle 2", "velocity 1", "velocity 2"],
                [[f"{k:g}", f"{pick(n, 'angle 1'):.4f}", f"{pick(n, 'angle 2'):.4f}",
                  f"({pick(n, 'velocity 1.x'):.4f}, {pick(n, 'velocity 1.y'):.4f})", f"({pick(n, 'velocity 2.x'):.4f}, {pick(n, 'velocity 2.y'):.4f})"]
                 for n, k in enumerate(stiffness)])


def module(study, path):
    spec = importlib.util.spec_from_file_location("heap", study.root / path)
    loaded = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(loaded)
    return loaded


def run_case(study, text, name):
    case = study.work / f"{name}.toml"
    case.write_text(text)
    return study.acopla(case, study.work / name), study.work / name


def piles(study):
    angle = module(study, "cases/moving_barrier/angle.py")
    summary, results = run_case(study, (study.root / "cases" / "free_pile" / "case.toml").read_text(), "free_pile")
    x, y, r = angle.last_discs(results)
    study.target("free pile of 25 discs, off the floor after 10 s", "a stable pile; 15 by an independent code", int((y > 1.5 * r).sum()), "15",
                 (y > 1.5 * r).sum() == 15 and summary["status"] == "met", "{:d}")
    text = (study.root / "cases" / "moving_barrier" / "case.toml").read_text()
    fillings = 4 if study.quick else FILLINGS
    found = []
    for seed in range(1, fillings + 1):
        summary, results = run_case(study, text.replace('solver = "dem"', f'solver = "dem"\nseed = {seed}'), f"barrier_{seed}")
        found.append((*angle.angle_of_repose(*angle.last_discs(results)), summary["participants"]["discs"]["seconds"]))
        print(f"  420 discs, filling {seed}: {found[-1][0]:.2f} ± {found[-1][1]:.2f} degrees in {found[-1][3]:.1f} s", flush=True)
    mean, spread = statistics.mean(a[0] for a in found), statistics.stdev(a[0] for a in found)
    study.target(f"moving barrier, 420 discs, angle [degrees], mean of {fillings} fillings", "28 (one filling); experiment 21",
                 f"{mean:.1f} ± {spread:.1f}", "28 within two spreads", abs(mean - 28) <= 2 * spread and spread < 5)
    rows = [[f"420, filling {k + 1}", f"{a[0]:.1f} ± {a[1]:.1f}", f"{a[2]:.1f}", f"{a[3]:.0f}"] for k, a in enumerate(found)]
    rows.append(["420, mean and spread", f"{mean:.1f} ± {spread:.1f}", "", ""])
    if not study.quick:
        summary, results = run_case(study, (study.root / "cases" / "moving_barrier" / "fine.toml").read_text(), "barrier_fine")
        fine = angle.angle_of_repose(*angle.last_discs(results))
        study.target("moving barrier, 15,000 discs, angle [degrees]", "20.5; experiment 21", fine[0], "20.5 ± 2", abs(fine[0] - 20.5) <= 2, "{:.1f}")
        study.target("moving barrier, angle of 420 discs over that of 15,000 [degrees]", "7.5", mean - fine[0], "> 0", mean > fine[0], "{:.1f}")
        rows.append(["15,000", f"{fine[0]:.1f} ± {fine[1]:.1f}", f"{fine[2]:.1f}", f"{summary['participants']['discs']['seconds']:.0f}"])
    study.table("Moving barrier: angle of repose [degrees]", ["discs", "fit ± standard error", "atan(crest/toe)", "time [s]"], rows)


def run(study):
    rows = lines(study, "table")
    analytic(study, rows)
    tests(study, "size ratio 100: a large ball on small ones, at rest and lifted off", "statics; no contact pulls", "SizeRatio100.*")
    tests(study, "silo: floor and walls carry the weight, friction takes its share", "statics, Janssen", "Silo.*")
    tests(study, "every law on particle, plane, facet, edge and vertex, 2D and 3D", "the plane's impact", "*SlowImpact*:FastImpact*")
    tests(study, "a ball rolling over a triangulated floor does not feel the edges", "the plane's motion, 1e-11 m", "TriangulatedFloor*")
    tests(study, "rests on an incline exactly while μ_r ≥ tan θ, to 1e-4", "statics", "Incline.*")
    restitution(study)
    table_3_1(study, rows)
    sweep(study)
    rolling_figures(study)
    piles(study)
