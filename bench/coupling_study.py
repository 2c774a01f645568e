"""Two-way coupling: orders, a map of schemes over mass and stiffness ratios, what a window costs beside bare messages, the mapping's speed."""
import json
import math
import pathlib
import re
from statistics import median

from dem_speed import beds


def lines(study, *arguments):
    return [json.loads(line) for line in study.run([study.program("coupling_bench"), *map(str, arguments)]).splitlines()]


def run(study):
    rows = lines(study, "orders")
    orders(study, rows)
    cells = lines(study, "map", *(["--coarse"] if study.quick else []))
    map_of_schemes(study, cells)
    mappings(study)
    limits(study)
    long_run(study)
    if not study.quick:  # times, which the company of other tests would decide
        speed(study)
        large_run(study)
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


def accuracy(study, part):
    return [json.loads(line) for line in study.run([study.program("mapping_accuracy"), part]).splitlines()]


def mappings(study):
    fields, losses, rows = accuracy(study, "fields"), accuracy(study, "loads"), []
    for loss in losses:
        own = [row for row in fields if row["mapping"] == loss["mapping"]]
        order = math.log2(own[-2]["error"] / own[-1]["error"])
        if loss["mapping"] != "nearest":  # the last resort is of first order
            study.at_least(f"Cubes of unlike meshes, {loss['mapping']}: order of Franke's function", "–", order, 1.9, "{:.2f}")
        study.at_most(f"Cubes of unlike meshes, {loss['mapping']}: loss of Σ force", "–", loss["force"], 1e-12, "{:.1e}")
        study.at_most(f"Cubes of unlike meshes, {loss['mapping']}: loss of Σ moment", "–", loss["moment"], 1e-12, "{:.1e}")
        rows.append([loss["mapping"], *(f"{row['error']:.2e}" for row in own), f"{order:.2f}", f"{loss['force']:.1e}", f"{loss['moment']:.1e}"])
    study.table("Unit cubes of triangles and of five eighths as many quads: Franke's function, random loads in five frames",
                ["mapping", *(f"error, {row['cells']} cells a side" for row in own), "order", "loss of Σ force", "loss of Σ moment"], rows)


def limits(study):
    cells = accuracy(study, "limits")
    ratios = sorted({c["ratio"] for c in cells})
    at = {(c["particle"], c["ratio"]): c for c in cells}
    study.target("Explicit scheme, particle of a ten-thousandth of the node in a damped bed: limit ω_c Δt", "–", at[1e-4, 0.33]["held"], "2.83 ± 0.02",
                 abs(at[1e-4, 0.33]["held"] - math.sqrt(8)) <= 0.02, "{:.2f}")
    study.target("Explicit scheme, particle of a thousand nodes, undamped: limit ω_c Δt", "–", at[1e3, 0.0]["free"], "2 ± 0.02",
                 abs(at[1e3, 0.0]["free"] - 2) <= 0.02, "{:.2f}")
    study.table("Explicit scheme: the turn ω_c Δt of a contact in a window up to which nothing grows by a thousandth a window; particle that nothing else holds / in a bed",
                ["particle over node", *(f"ζ = {ratio:g}" for ratio in ratios)],
                [[f"{particle:g}", *(f"{at[particle, r]['free']:.2f} / {at[particle, r]['held']:.2f}" for r in ratios)] for particle in sorted({c["particle"] for c in cells})])
    study.text("ω_c² = k/M of the node's mass M, ζ of the contact with the reduced mass of both; 4.00: none found. From the eigenvalues of one window (docs/theory.md), which "
               "the tests compare with coupled runs. Damping moves the limit both ways: it takes the growth of light particles away, and a dashpot against a heavy one "
               "lowers the limit of 2 by (k Δt² + 2 c Δt)/M = 4.")


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
    overlap = lines(study, "mapping", 100000, "--overlap")[0]
    study.at_most(f"Mapping of {overlap['vertices']} vertices by overlap built [s]", "–", overlap["build"], 1.0, "{:.3f}")
    study.at_most(f"Mapping of {overlap['vertices']} vertices by overlap applied [ms]", "–", 1e3 * overlap["apply"], 10.0, "{:.2f}")


def long_run(study):
    """Memory over many windows, from a tenth of them on."""
    windows = 20000 if study.quick else 1000000
    rows = []
    for recorded in (False, True):
        count = windows if not recorded else windows // 5
        run = lines(study, "long", count, *(["--recorded"] if recorded else []))[0]
        grown = (run["late"] - run["early"]) / 2 ** 20
        rows.append(["interface.h5 and all else" if recorded else "nothing", f"{count:,}", f"{run['early'] / 2 ** 20:.1f}", f"{run['late'] / 2 ** 20:.1f}",
                     f"{(run['late'] - run['early']) / (0.9 * count):.1f}", f"{run['seconds']:.0f}"])
        if not recorded:
            study.at_most(f"{windows:,} windows of explicit coupling: growth of the memory of coupler and participants after the first tenth [MiB]", "–",
                          grown if run["met"] else None, 1.0, "{:.2f}")
    study.table("A long run: memory of coupler and two idle participants in one process",
                ["what is written", "windows", "after a tenth [MiB]", "at the end [MiB]", "growth [bytes a window]", "time [s]"], rows)
    study.text("What grows where a record is written is what HDF5 keeps of its tables.")


# --- a run of real solvers ---------------------------------------------------------------------------------------------
PLATE_CELLS = (40, 40, 3)
PLATE = """
[plate]
solver = "fem"
mesh = {{ bar = {{ size = [1, 1, 0.1], cells = {cells}, origin = [0, 0, -0.1] }} }}
degree = 1
analysis = "dynamic"
rayleigh = {{ mass = 5 }}
[plate.material]
young = 2e9
poisson = 0.3
density = 3e4
[plate.fix.x0]
[plate.fix.x1]
[plate.output]
vtu = false
"""


def large_run(study):
    """The bed of dem_speed on an elastic plate: what the run takes beyond the solvers' own computing."""
    figure = "Coupled run of 21,296 spheres and 20,172 unknowns, window of 20 steps: coupling and idling over the windows' time [%]"
    if not pathlib.Path(study.program("acopla-fem")).exists():
        study.at_most(figure, "–", None, 5.0)
        return
    bed = (study.root / "bench" / "dem_speed" / "case.toml").read_text()
    settled = beds.Beds(study).settled(bed)
    floor = study.work / "floor.stl"
    beds.write_floor(floor, 1, 1, 2 * PLATE_CELLS[0] * PLATE_CELLS[1])
    text = bed[:bed.index("[[grains.insert]]")] + bed[bed.index("[grains.output]"):].replace("checkpoint = true", "")
    text = re.sub(r"^end = .*$", "end = 0.06", text, flags=re.M)
    text = re.sub(r"^step = .*$", "step = 3e-5", text, flags=re.M)
    text = re.sub(r"^window = .*$", 'window = 6e-4\nscheme = "explicit"\nmax_distance = 1e-3\noutput_every = 1\n[[coupling.interface]]\nfrom = "grains.z0"\nto = "plate.z1"',
                  text, flags=re.M)
    text = text.replace('solver = "dem"', f'solver = "dem"\nstart_from = "{settled}"')
    text = text[:text.index("[grains.wall.z0]")] + f'[grains.wall.z0]\nmesh = "{floor}"\nmaterial = "glass"\n' + text[text.index("[grains.output]"):]
    case = study.work / "plate.toml"
    case.write_text(text + PLATE.format(cells=list(PLATE_CELLS)))
    rows = []
    for turn in range(5):
        results = study.work / f"plate-{turn}"
        said = study.run([study.program("acopla"), "run", str(case), "--results", str(results)])
        value = {name: float(number) for name, number in re.findall(r"^(\S+) +(\S+)$", said, re.M) if re.fullmatch(r"[-+.e0-9]+", number)}
        windows = json.loads((results / "summary.json").read_text())["seconds_windows"]
        rows.append((windows, value["grains.seconds.steps"], value["plate.seconds.solve"]))
    rows.sort(key=lambda r: 1 - (r[1] + r[2]) / r[0])
    shares = [100 * (1 - (dem + fem) / windows) for windows, dem, fem in rows]
    study.at_most(figure, "–", median(shares), 5.0, "{:.2f}")
    windows, dem, fem = rows[len(rows) // 2]
    study.table("The same: medians of five runs of 100 windows", ["what", "time [s]"],
                [["windows", f"{windows:.3f}"], ["particles: 2,000 steps, the floor of 3,200 triangles moved by the plate", f"{dem:.3f}"],
                 ["structure: 100 solutions", f"{fem:.3f}"], ["the rest: messages, mapping, ledger, record, waking", f"{windows - dem - fem:.3f}"]])
    bare = lines(study, "waking", (PLATE_CELLS[0] + 1) * (PLATE_CELLS[1] + 1), 0.02)[0]
    study.text(f"Two bare ping-pongs of the same bytes between threads that compute for 20 ms each before they answer take {1e3 * bare['cold']:.2f} ms on this machine, "
               f"{100 * bare['cold'] * 100 / windows:.1f} % of such a window, against {1e3 * bare['hot']:.2f} ms between threads that only answer: a core that slept, and whose caches are full of "
               "other things, wakes slowly, at each of the six hops of a message and its answer (thread to input and output thread to socket, twice).")
    study.text(f"In turns (staggered), over ipc, three processes, interface.h5 written. Shares of the five runs: {', '.join(f'{s:.1f}' for s in shares)} %. The plate is heavier than "
               "steel (30 t/m³) and the particles take a fifth of their longest step, so that the staggered scheme is stable in windows of 20 steps.")


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
