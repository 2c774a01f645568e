"""What steps the particles' solver stands: its stability limits found by bisection and told beforehand, energy error from 0.05 to 2.5 of the
critical step for every law, extremes of every parameter, a million steps at rest; and whether what breaks says so.

bench/dem_stability.cc runs the scenes. A run breaks where the steps make more than a twentieth of the energy the scene ever held, or where it
cannot go on. Each is run three times: unguarded, to learn what happens; as a user with the energy ledger runs it; and as one without.
"""
import json
import math

DEFAULT = 0.2


def lines(study, part):
    command = [study.program("dem_stability"), part] + (["--quick"] if study.quick else [])
    return [json.loads(line) for line in study.run(command).splitlines()]


def limits(study):
    rows = lines(study, "limits")
    study.at_most(f"step_ratio at the first unstable step, {len(rows)} scenes found by bisection: largest distance from 1", "1",
                  max(abs(row["ratio"] - 1) for row in rows), 0.06)
    study.at_least("step_ratio at the first unstable step: smallest (below 1 it would come too late)", "1", min(row["ratio"] for row in rows), 0.99)
    lowest = min(rows, key=lambda row: row["first_unstable"])
    study.at_least(f"first unstable step over the critical step, lowest of all laws ({lowest['laws']}, {lowest['dimension']}D, e {lowest['restitution']:g}, "
                   f"{lowest['scene']}); {DEFAULT:g} is the default", "> 0.2", lowest["first_unstable"], 1.2 * DEFAULT)
    for normal in ("hertz", "linear"):
        chosen = [row for row in rows if row["laws"].startswith(normal)]
        keys = sorted({(row["laws"], row["restitution"]) for row in chosen}, key=lambda key: (key[1] * -1, [r["laws"] for r in chosen].index(key[0])))
        cell = lambda key, dimension, scene: next(f"{row['first_unstable']:.2f} ({row['ratio']:.3f})" for row in chosen if (row["laws"], row["restitution"]) ==
                                                  key and row["dimension"] == dimension and row["scene"] == scene)
        study.table(f"First unstable step over the critical step (and the step_ratio told there), {normal}",
                    ["laws", "e", "disc on a floor", "squeezed bed of discs", "sphere on a floor", "squeezed bed of spheres"],
                    [[laws, f"{e:g}"] + [cell((laws, e), d, s) for d in (2, 3) for s in ("ball on a floor", "squeezed bed")] for laws, e in keys])
    study.text("The critical step of Hertz's law is set for an overlap of 1 % of the radius; deeper contacts have a shorter limit, which `step_ratio` "
               "tells while the run goes on. The beds' mean overlap is 1 %.")


def told(row):
    """What a run with the ledger and one without said."""
    return f"{row['ledger'] or '–'} / {row['plain'] or '–'}"


def guarded(study, rows, what):
    """No run breaks at the default step and goes on; nothing that breaks is silent; every stop says when, where and why."""
    at_default = [row for row in rows if row["fraction"] == DEFAULT]
    study.target(f"{what}: runs at the default step that break and are not refused", "0",
                 sum(1 for row in at_default if row["broke"] and row["ledger"] not in ("overlap", "travel")), "0 of " + str(len(at_default)),
                 not any(row["broke"] and row["ledger"] not in ("overlap", "travel") for row in at_default), "{:d}")
    study.target(f"{what}: false alarms at the default step", "0", sum(1 for row in at_default if not row["broke"] and false_alarm(row)), "0",
                 not any(not row["broke"] and false_alarm(row) for row in at_default), "{:d}")
    broken = [row for row in rows if row["broke"]]
    silent = [row for row in broken if row["silent"]]
    study.target(f"{what}: runs that break and say nothing", "0", len(silent), f"0 of {len(broken)}", not silent, "{:d}")
    stops = [row["said"] for row in rows if row["said"]]
    complete = [text for text in stops if "particle" in text and " at (" in text and ("t =" in text or "begin with" in text)]
    study.target(f"{what}: stops that say when, where and at which particle", "all", f"{len(complete)} of {len(stops)}", "all", len(complete) == len(stops))


def false_alarm(row):
    return any(word and word != "overlap" for word in (row["ledger"], row["plain"]))


def scan(study):
    rows = lines(study, "scan")
    guarded(study, rows, "shaken bed")
    quiet = [row for row in rows if row["fraction"] <= DEFAULT]
    worst = max(quiet, key=lambda row: abs(row["drift"]))
    study.at_most(f"shaken bed: energy error up to the default step, worst of all laws ({worst['laws']}, {worst['dimension']}D, e {worst['restitution']:g})",
                  "0", abs(worst["drift"]), 0.015)
    fractions = sorted({row["fraction"] for row in rows})
    series = {}
    for row in rows:
        series.setdefault((row["dimension"], row["laws"], row["restitution"]), []).append(row)

    def first_broken(points):
        return next((f"{row['fraction']:g}" for row in sorted(points, key=lambda row: row["fraction"]) if row["broke"]), f"> {fractions[-1]:g}")
    study.table("Shaken bed: energy error by step over critical step, and the first of them that breaks",
                ["laws", "dimension", "e", *[f"{f:g}" for f in fractions], "breaks"],
                [[laws, f"{d}D", f"{e:g}"] + ["**broke**" if row["broke"] else f"{abs(row['drift']):.1e}" for row in sorted(points, key=lambda r: r["fraction"])] +
                 [first_broken(points)] for (d, laws, e), points in series.items()])
    study.csv(["scene", "dimension", "laws", "restitution", "fraction", "step_s", "drift", "gain", "step_ratio", "broke", "with_ledger", "without"],
              [[row["scene"], row["dimension"], row["laws"], row["restitution"], row["fraction"], row["step"], row["drift"], row["gain"], row["ratio"],
                int(row["broke"]), row["ledger"], row["plain"]] for row in rows])

    def draw(panels):
        for axes, (dimension, restitution) in zip(panels, ((2, 1.0), (3, 1.0), (2, 0.5), (3, 0.5))):
            chosen = {laws: sorted(points, key=lambda row: row["fraction"]) for (d, laws, e), points in series.items() if (d, e) == (dimension, restitution)}
            shades = [[math.log10(max(1e-5, abs(row["drift"]))) if not row["broke"] else float("nan") for row in points] for points in chosen.values()]
            image = axes.imshow(shades, vmin=-5, vmax=-1, cmap="viridis", aspect="auto")
            for y, points in enumerate(chosen.values()):
                for x, row in enumerate(points):
                    if row["broke"]:
                        axes.text(x, y, row["plain"][:6] or "silent", ha="center", va="center", fontsize=5, color="#a00")
            axes.set_xticks(range(len(fractions)), [f"{f:g}" for f in fractions], fontsize=6)
            axes.set_yticks(range(len(chosen)), list(chosen) if axes is panels[0] else [""] * len(chosen), fontsize=6)
            axes.set_xlabel("step / critical step", fontsize=7)
            axes.set_title(f"{'discs' if dimension == 2 else 'spheres'}, e {restitution:g}", fontsize=8)
        bar = axes.figure.colorbar(image, ax=list(panels), shrink=0.8)
        bar.set_label("log10 of the energy error", fontsize=7)

    study.figure(draw, (13, 3.4), panels=4)
    study.text("Where a run breaks, the map says what stopped it without the ledger: travel (a particle moves half a radius in a step), step r(atio), "
               "energy (from half the critical step on the ledger is kept without being asked).")


def extremes(study):
    rows = lines(study, "extremes")
    guarded(study, rows, "extremes")
    groups = {}
    for row in rows:
        groups.setdefault((row["scene"], row["what"], row["dimension"], row["laws"], row["restitution"] if row["what"] != "restitution" else None), {}).setdefault(
            row["value"], {})[row["fraction"]] = row
    kept = [row for row in rows if row["fraction"] == DEFAULT and not row["broke"] and row["ledger"] != "overlap"]
    worst = max(kept, key=lambda row: abs(row["drift"]))
    study.at_most(f"extremes: energy error at the default step, worst ({worst['scene']}, {worst['what']} {worst['value']:g}, {worst['laws']})", "0",
                  abs(worst["drift"]), 0.05)
    stiff = [row for row in kept if row["what"] == "stiffness [N/m]"]
    study.at_most("stiffness from 1e3 to 1e12 N/m: energy error at the default step", "0", max(abs(row["drift"]) for row in stiff), 2e-3)

    def cell(row):
        return f"**{told(row)}**" if row["broke"] else f"{abs(row['drift']):.1e}" + (f" ({told(row)})" if row["ledger"] or row["plain"] else "")
    study.table("Extremes: energy error at 0.2, 0.5 and 1 of the critical step; in bold what breaks, with what stops it (with the ledger / without)",
                ["scene", "what", "value", "laws", "e", "0.2", "0.5", "1"],
                [[scene, what, f"{value:g}", f"{dimension}D {laws}", "" if e is None else f"{e:g}", *(cell(at[f]) for f in (0.2, 0.5, 1.0))]
                 for (scene, what, dimension, laws, e), values in groups.items() for value, at in values.items()])


def rest(study):
    rows = lines(study, "rest")
    study.at_most("a million steps at rest: distance moved over the radius, worst of four piles", "0", max(row["moved"] for row in rows), 1e-12)
    study.at_most("a million steps at rest: change of energy over that of the springs", "0", max(abs(row["drift"]) for row in rows), 1e-8)
    study.table("A million steps at rest: piles that friction and rolling resistance hold",
                ["pile", "laws", "step [s]", "moved / radius", "fastest [m/s]", "energy drift", "kinetic energy / springs'"],
                [[f"{row['particles']} {'discs' if row['dimension'] == 2 else 'spheres'}", row["laws"], f"{row['step']:.2e}", f"{row['moved']:.1e}",
                  f"{row['fastest']:.1e}", f"{row['drift']:.1e}", f"{row['kinetic']:.1e}"] for row in rows])


def run(study):
    limits(study)
    scan(study)
    extremes(study)
    rest(study)
