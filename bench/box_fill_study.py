"""Nasato (2011), chapter 4: four boxes, three particle meshes, three structure meshes: 12 DEM runs feed 36 FEM runs.

Each DEM run is recorded once. One FEM process a box and structure mesh, factored once, then takes the last 0.2 s of the
three recordings, one after another, so only windows at rest are solved.
"""
import json
import math
import pathlib

LEVELS = ("coarse", "medium", "fine")
TRIANGLES = {"coarse": (36, 38), "medium": (46, 47), "fine": (58, 57)}
CELLS = {"coarse": (37, 38), "medium": (52, 51), "fine": (62, 63)}
# side [m], count, diameter [m], height of the region the spheres start in [m]
BOXES = {1: (1.0, 2000, 0.04, 1.6), 2: (1.5, 3000, 0.04, 0.8), 3: (3.0, 6000, 0.04, 0.3), 4: (3.0, 2000, 0.08, 0.5)}
# Tables 4-4 to 4-7: error of the particles' vertical force [%] by particle mesh.
PAPER_DEM = {1: (0.10, -0.04, -0.07), 2: (0.03, 0.02, 0.00), 3: (-0.08, -0.02, -0.09), 4: (-0.03, 0.00, 0.00)}
# Tables 4-8 to 4-11: error of the reaction [%] by particle mesh, then structure mesh.
PAPER_FEM = {1: ((1.59, 1.70, 1.62), (1.79, 1.59, 1.70), (0.99, 2.10, 1.59)),
             2: ((1.59, 1.29, 1.62), (2.36, 1.59, 1.52), (4.88, 2.06, 1.59)),
             3: ((1.59, 1.60, 1.60), (1.65, 1.59, 1.66), (1.77, 1.44, 1.59)),
             4: ((1.62, 1.68, 1.66), (1.78, 1.53, 1.61), (3.04, 1.74, 1.65))}
END, WINDOW, REST = 3.0, 0.05, 0.2


def particles_case(study, box, level, stl):
    """The committed case with another box: same materials, laws and step; recorded, with no structure."""
    side, count, diameter, height = BOXES[box]
    text = (study.root / "cases" / "box_fill" / "case.toml").read_text()
    grains = text[text.index("[grains]"):text.index("[grains.output]")]
    grains = grains.replace('"box.stl"', f'"{stl}"').replace("diameter = 0.04", f"diameter = {diameter}")
    grains = grains.replace("count = 2000", f"count = {count}").replace("[1, 1, 1.6]", f"[{side}, {side}, {height}]")
    return f"""title = "box fill, test {box}, {level}"
dimension = 3
gravity = [0, 0, -9.81]
end = {END}
[coupling]
scheme = "one-way"
window = {WINDOW}
max_distance = 0.02
output_every = {END}
[[coupling.interface]]
from = "grains.box"
{grains}
[grains.output]
particles = false
"""


def structure_case(study, box, level, records, msh):
    replays = interfaces = ""
    for k, name in enumerate(LEVELS):
        interfaces += f'[[coupling.interface]]\nfrom = "{name}.box"\nto = "structure.inside"\n'
        replays += (f'[{name}]\nreplay = {{ file = "{records[name]}", of = "grains", from = {END - REST}, to = {END}, at = {k * REST} }}\n')
    text = (study.root / "cases" / "box_fill" / "case.toml").read_text()
    structure = text[text.index("[structure]"):text.index("[structure.output]")].replace('"box.msh"', f'"{msh}"')
    return f"""title = "box fill, test {box}, structure {level}"
dimension = 3
end = {3 * REST}
[coupling]
scheme = "one-way"
window = {WINDOW}
max_distance = 0.02
output_every = {3 * REST}
""" + interfaces + replays + structure + "[structure.output]\nvtu = false\n"


def series(results, name):
    import h5py
    with h5py.File(pathlib.Path(results) / "interface.h5") as record:
        return record[name][...]


def meshes(study, box):
    side = BOXES[box][0]
    make = [str(study.root / "cases" / "box_fill" / "make_meshes.py"), "--side", str(side)]
    for level in LEVELS:
        triangles, cells = TRIANGLES[level], CELLS[level]
        if study.quick:
            triangles, cells = [n // 4 for n in triangles], [n // 5 for n in cells]
        study.run(["/usr/bin/python3", *make, "--stl", str(study.work / f"box{box}_{level}.stl"), "--triangles", *map(str, triangles),
                   "--msh", str(study.work / f"box{box}_{level}.msh"), "--cells", *map(str, cells)])


def weight_of(box):
    _, count, diameter, _ = BOXES[box]
    return count * 2500 * math.pi / 6 * diameter**3 * 9.81


def mapping_rows(study):
    drum = json.loads(study.run([study.program("mapping_balance")]))
    study.at_most("Σ moment after mapping against before, 32-gon drum on a 48-gon one", "–", drum["moment_loss"], 1e-12)
    lines = study.run([study.program("search_speed")] + (["--quick"] if study.quick else [])).splitlines()
    sizes = [json.loads(line) for line in lines]
    study.target("partners found by buckets and exhaustively", "–", "same" if all(s["same_partners"] for s in sizes) else "differ",
                 "same at every size", all(s["same_partners"] for s in sizes))
    first, last = sizes[0], sizes[-1]
    exponent = math.log(last["bucket_seconds"] / first["bucket_seconds"]) / math.log(last["points"] / first["points"])
    study.at_most(f"growth of the search, exponent of n from {first['points']} to {last['points']}", "1 (O(n))", exponent, 1.15, "{:.2f}")
    study.table("Finding n partners among n triangles (build and search, s)", ["n", "buckets", "exhaustive", "points compared"],
                [[s["points"], f"{s['bucket_seconds']:.3g}", f"{s['exhaustive_seconds']:.3g}", s["sampled"]] for s in sizes])


def run(study):
    boxes = {1: BOXES[1]} if study.quick else BOXES
    if study.quick:
        BOXES[1] = (0.5, 300, 0.04, 0.6)
        global END
        END = 2.0
    dem, fem, losses = {}, {}, {"force": 0.0, "moment": 0.0}
    rows = []
    for box in boxes:
        meshes(study, box)
        weight, records = weight_of(box), {}
        for level in LEVELS:
            case, results = study.work / f"box{box}_{level}.toml", study.work / f"dem{box}_{level}"
            case.write_text(particles_case(study, box, level, study.work / f"box{box}_{level}.stl"))
            summary = study.acopla(case, results)
            force = series(results, "quantities/grains.box.force.z")
            mean = -force[-round(REST / WINDOW):].mean()
            dem[box, level] = (mean, summary["participants"]["grains"])
            records[level] = results / "interface.h5"
            rows.append(("dem", box, level, "", mean, mean / weight - 1, summary["participants"]["grains"]["seconds"],
                         summary["participants"]["grains"]["peak_bytes"]))
            print(f"  test {box}, particles {level}: {mean:.3f} N, {100 * (mean / weight - 1):+.4f} %", flush=True)
        for level in LEVELS:
            case, results = study.work / f"fem{box}_{level}.toml", study.work / f"fem{box}_{level}"
            case.write_text(structure_case(study, box, level, records, study.work / f"box{box}_{level}.msh"))
            summary = study.acopla(case, results)
            losses["force"] = max(losses["force"], summary["ledgers"]["force_loss"])
            losses["moment"] = max(losses["moment"], summary["ledgers"]["moment_loss"])
            reaction = series(results, "quantities/structure.reaction.z")
            peak = series(results, "quantities/structure.von_mises.max")
            per = round(REST / WINDOW)
            for k, particles in enumerate(LEVELS):
                mean = reaction[k * per:(k + 1) * per].mean()
                fem[box, particles, level] = (mean, peak[k * per:(k + 1) * per].max(), summary["participants"]["structure"])
                rows.append(("fem", box, particles, level, mean, mean / weight - 1, summary["participants"]["structure"]["seconds"],
                             summary["participants"]["structure"]["peak_bytes"]))
            worst = max(abs(fem[box, p, level][0] / weight - 1) for p in LEVELS)
            print(f"  test {box}, structure {level}: worst {100 * worst:.4f} %", flush=True)
    weights = {box: weight_of(box) for box in boxes}
    percent = lambda value: 100 * value
    worst_dem = max(abs(percent(value[0] / weights[box] - 1)) for (box, _), value in dem.items())
    worst_fem = max(abs(percent(value[0] / weights[box] - 1)) for (box, _, _), value in fem.items())
    study.at_most(f"DEM vertical force, mean over the last {REST} s, against weight, worst of {len(dem)} [%]", "0.10", worst_dem, 0.02, "{:.4f}")
    study.at_most(f"Σ force after mapping against before, worst of {len(fem)}, of Σ\\|F\\|", "(not separable)", losses["force"], 1e-12)
    study.at_most(f"Σ moment after mapping against before, worst of {len(fem)}, of Σ\\|r\\|\\|F\\|", "–", losses["moment"], 1e-12)
    study.at_most(f"FEM reaction against weight, worst of {len(fem)} [%]", "4.88", worst_fem, 0.02, "{:.4f}")
    mapping_rows(study)
    tables(study, boxes, dem, fem, weights)
    study.csv(["kind", "test", "particles", "structure", "vertical_force_N", "relative_error", "seconds", "peak_bytes"], rows)
    draw_errors(study, boxes, fem, weights)


def tables(study, boxes, dem, fem, weights):
    mib = lambda about: f"{about['peak_bytes'] / 2**20:.0f}"
    error = lambda value, box: f"{100 * (value / weights[box] - 1):+.4f}"
    for box in boxes:
        side, count, diameter, _ = BOXES[box]
        study.table(f"Table 4-{3 + box}: test {box}, {count} spheres of {1000 * diameter:.0f} mm in a box of {side} m, weight {weights[box]:.2f} N",
                    ["particle mesh", "vertical force [N]", "error [%]", "paper's error [%]", "time [s]", "peak memory [MiB]"],
                    [[level, f"{dem[box, level][0]:.3f}", error(dem[box, level][0], box), f"{PAPER_DEM[box][k]:+.2f}",
                      f"{dem[box, level][1]['seconds']:.1f}", mib(dem[box, level][1])] for k, level in enumerate(LEVELS)])
    for box in boxes:
        study.table(f"Table 4-{7 + box}: test {box}, reaction of the structure",
                    ["particle mesh", "structure mesh", "reaction [N]", "error [%]", "paper's error [%]", "largest von Mises [MPa]",
                     "time [s] (three loads)", "peak memory [MiB]"],
                    [[p, s, f"{fem[box, p, s][0]:.3f}", error(fem[box, p, s][0], box), f"{PAPER_FEM[box][i][j]:.2f}",
                      f"{fem[box, p, s][1] / 1e6:.3f}", f"{fem[box, p, s][2]['seconds']:.1f}", mib(fem[box, p, s][2])]
                     for i, p in enumerate(LEVELS) for j, s in enumerate(LEVELS)])
    study.text("The three particle meshes give the same force because a plane cut into triangles is a plane to round-off; where they "
               "part in the last digits, the bed has amplified round-off. What is left of the error is motion: some spheres still roll.")
    study.text("Errors are signed, (computed − weight) / weight; the paper gives magnitudes for the reaction. The largest von Mises "
               "stress is the value at a quadrature point under nodal point loads and grows as the mesh is refined: read it as a "
               "place, not as a strength.")


def draw_errors(study, boxes, fem, weights):
    def draw(axes):
        for box in boxes:
            for i, p in enumerate(LEVELS):
                for j, s in enumerate(LEVELS):
                    value, _, about = fem[box, p, s]
                    axes.loglog(about["seconds"], max(abs(100 * (value / weights[box] - 1)), 1e-6), "o", color=f"C{box - 1}",
                                label=f"test {box}" if i == j == 0 else None)
                    axes.loglog(about["seconds"], PAPER_FEM[box][i][j], "x", color=f"C{box - 1}")
        axes.axhline(0.02, color="0.7", lw=1)
        axes.set_xlabel("time of the structure's process, three loads [s]")
        axes.set_ylabel("error of the reaction [%]")
        axes.legend(title="o here, x paper", fontsize=8)

    study.figure(draw)
