"""Two-way coupling: orders, a map of schemes over mass and stiffness ratios, what a window costs beside bare messages, the mapping's speed."""
import json
import math
from statistics import median


def lines(study, *arguments):
    return [json.loads(line) for line in study.run([study.program("coupling_bench"), *map(str, arguments)]).splitlines()]


def run(study):
    rows = lines(study, "orders")
    orders(study, rows)
    cells = lines(study, "map", *(["--coarse"] if study.quick else []))
    map_of_schemes(study, cells)
    speed(study)
    study.csv(["part", "scheme", "windows", "mass ratio 10^", "stiffness ratio 10^", "met", "error", "energy", "iterations", "seconds"],
              [["two masses", r["scheme"], r["windows"], "", "", r["met"], r["error"], r["energy"], r["iterations"], r["seconds"]] for r in rows] +
              [["sphere on plate", c["scheme"], 47, c["mass"], c["spring"], c["met"], c["error"], c["energy"], c["iterations"], c["seconds"]] for c in cells])
    draw(study, rows, cells)


def schemes_of(rows):
    return list(dict.fromkeys(row["scheme"] for row in rows))


def orders(study, rows):
    for scheme in schemes_of(rows):
        own = [row for row in rows if row["scheme"] == scheme]
        order = math.log2(own[-2]["error"] / own[-1]["error"])
        expected = 1 if scheme == "parallel" else 2
        study.target(f"Two masses: order of {scheme}", "–", order, f"{expected} ± 0.1", all(r["met"] for r in own) and abs(order - expected) <= 0.1, "{:.3f}")
    study.table("Two masses and three springs, one second: error against window and run time",
                ["scheme", "windows", "error, rms [m]", "energy after 1 s, relative", "iterations a window", "time [s]"],
                [[r["scheme"], r["windows"], f"{r['error']:.2e}", f"{r['energy']:+.1e}", f"{r['iterations']:.2f}", f"{r['seconds']:.3f}"] for r in rows])
    study.text("m = 1 kg each, walls' springs 4π² N/m, 16π² N/m between them, at rest at (1, 0) m; the implicit schemes to a tolerance of 1e-9. The time is that "
               "of the windows with both participants as threads of one process.")


def map_of_schemes(study, cells):
    implicit = [c for c in cells if c["scheme"].startswith("implicit, iqn")]
    study.at_least("Sphere on plate: cells where implicit iqn-ils converges, share of all", "–", sum(c["met"] for c in implicit) / len(implicit), 1.0, "{:.3f}")
    study.at_most("Sphere on plate: worst energy error of implicit iqn-ils, relative", "–", max(abs(c["energy"]) for c in implicit), 0.02, "{:.2g}")
    explicit = [c for c in cells if c["scheme"] == "explicit"]
    study.at_most("Sphere on plate: worst energy error of explicit in windows of 0.2 rad, relative", "–", max(abs(c["energy"]) for c in explicit), 0.05, "{:.2g}")
    rows = []
    for scheme in schemes_of(cells):
        own = [c for c in cells if c["scheme"] == scheme]
        rows.append([scheme, f"{sum(c['met'] for c in own)} of {len(own)}", f"{max(abs(c['energy']) for c in own):.1e}",
                     f"{median(abs(c['energy']) for c in own):.1e}", f"{max(c['error'] for c in own):.1e}",
                     f"{median(c['iterations'] for c in own):.1f}, {max(c['iterations'] for c in own):.1f}", f"{sum(c['seconds'] for c in own):.2f}"])
    study.table("A sphere hits a plate on a spring: mass ratios 1e-3 to 1e3, spring over contact 1e-6 to 1e6",
                ["scheme", "converged", "worst energy error", "median", "worst error of the sphere's speed [of 1 m/s]", "iterations a window: median, most",
                 "time of all [s]"], rows)
    study.text("The contact (1e4 N/m, plate 1 kg) is seen for three half swings in windows of 0.2 radians of it; the reference has both in one system, by "
               "Runge–Kutta in steps a hundred times finer. Plates whose own swing is faster than a window are integrated by their trapezoidal rule as they are.")


def speed(study):
    rows = []
    for vertices, windows in ((100, 400), (1000, 400), (10000, 100)):
        turns = lines(study, "overhead", vertices, windows // 4 if study.quick else windows)
        ratio = median(t["window"] for t in turns) / median(t["bare"] for t in turns)
        study.at_most(f"A window of explicit coupling over two bare ping-pongs of the same bytes, {turns[0]['vertices']} vertices", "–", ratio, 1.5, "{:.2f}")
        rows.append([turns[0]["vertices"], f"{1e3 * median(t['window'] for t in turns):.3f}", f"{1e3 * median(t['bare'] for t in turns):.3f}", f"{ratio:.2f}"])
    study.table("What a window costs over ipc: idle participants, medians of 7 turns of each", ["vertices", "window [ms]", "two ping-pongs [ms]", "ratio"], rows)
    made = lines(study, "mapping", 100000)[0]
    study.at_most(f"Mapping of {made['vertices']} vertices built [s]", "–", made["build"], 1.0, "{:.3f}")
    study.at_most(f"Mapping of {made['vertices']} vertices applied [ms]", "–", 1e3 * made["apply"], 10.0, "{:.2f}")


def draw(study, rows, cells):
    def curves(axes):
        for scheme in schemes_of(rows):
            own = [r for r in rows if r["scheme"] == scheme]
            axes[0].loglog([1 / r["windows"] for r in own], [r["error"] for r in own], "o-", ms=3, label=scheme)
            axes[1].loglog([r["seconds"] for r in own], [r["error"] for r in own], "o-", ms=3, label=scheme)
        axes[0].set_xlabel("window [s]")
        axes[0].set_ylabel("error, rms [m]")
        axes[1].set_xlabel("run time [s]")
        axes[0].legend(fontsize=7)

    study.figure(curves, size=(9, 4), panels=2)

    def maps(axes):
        masses, springs = sorted({c["mass"] for c in cells}), sorted({c["spring"] for c in cells})
        for ax, scheme in zip(axes, ("explicit", "parallel", "implicit, iqn-ils")):
            value = {(c["mass"], c["spring"]): abs(c["energy"]) for c in cells if c["scheme"] == scheme}
            grid = [[math.log10(min(max(value[m, s], 1e-8), 1e2)) if math.isfinite(value[m, s]) else 2 for m in masses] for s in springs]
            image = ax.imshow(grid, origin="lower", aspect="auto", vmin=-8, vmax=2, cmap="viridis",
                              extent=(masses[0] - 0.5, masses[-1] + 0.5, springs[0] - 0.5, springs[-1] + 0.5))
            ax.set_title(scheme, fontsize=9)
            ax.set_xlabel("log10 sphere/plate mass")
        axes[0].set_ylabel("log10 plate's spring/contact")
        axes[0].figure.colorbar(image, ax=axes, label="log10 energy error")

    study.figure(maps, size=(10, 4), panels=3, part="map")
