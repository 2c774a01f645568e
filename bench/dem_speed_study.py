"""How fast the particles step: against LAMMPS and LIGGGHTS on the same bed, and against ourselves with each feature on and off."""
import math
import statistics
import subprocess
import time

from dem_speed import beds
from dem_speed.peers import Peer

PARTICLES, WINDOW = 21296, 0.15  # 1000 steps
median = statistics.median

# What each step of the engine's making gained, best of short intervals on this bed.
HISTORY = [("staged kernel over contacts sorted by cell, velocity Verlet", "6.9"),
           ("leapfrog with half-step velocities, no stored accelerations; histories beside the compacted pairs that nearly touch, which serve "
            "for about ten steps; packs of four contacts", "12.9"),
           ("packs of eight where the machine has AVX-512", "20.5"),
           ("packs meet, are answered and push in three passes over eight of them; forces and torques of both bodies scattered from the same rows", "24.9"),
           ("pairs keep their places when others come and go, so they are looked through more often and hardly any is computed in vain", "26.3")]


# --- one core, the large bed ------------------------------------------------------------------------------------------
class Ours:
    """acopla-dem on the settled bed: the last window of a run that starts from its checkpoint."""

    def __init__(self, study, program, start_text, more=""):
        self.study, self.program, self.turns = study, program, 0
        self.case = study.work / f"start-{program.parent.parent.name}-{len(more)}.toml"
        self.case.write_text(start_text.replace('solver = "dem"', 'solver = "dem"\n' + more))

    def turn(self, _):
        self.turns += 1
        results = self.case.with_name(f"{self.case.stem}-{self.turns}")
        text = self.study.run([str(self.program), str(self.case), "--results", str(results)], cwd=self.study.work)
        line = next(line for line in text.splitlines() if line.startswith("particle_steps_per_second.last"))
        return float(line.split()[1]) / 1e6


def baseline_program(study):
    """acopla-dem for any x86-64, built beside ours. The quick study does without where it has not been built."""
    build = study.root / "build" / "baseline"
    program = build / "bin" / "acopla-dem"
    if study.quick:
        return program if program.exists() else None
    if not (build / "build.ninja").exists():
        study.run(["cmake", "--preset", "baseline", "-DACOPLA_FEM=OFF", "-DACOPLA_TESTS=OFF"], cwd=study.root)
    study.run(["cmake", "--build", str(build), "--target", "acopla-dem"])
    return program


def large_bed(study):
    """The case, the text that starts from the settled bed, and the changes of the decks."""
    text = (study.root / "bench" / "dem_speed" / "case.toml").read_text()
    particles, changes = PARTICLES, {"LAMMPS": [], "LIGGGHTS": []}
    if study.quick:
        particles = 1936 * 2
        text = text.replace(f"count = {PARTICLES}", f"count = {particles}").replace("end = 0.9 ", "end = 0.45 ").replace("0.6]] }", "0.15]] }")
        changes = {"LAMMPS": [("0.02 0.25", "0.02 0.05"), ("run 6000", "run 3000")],
                   "LIGGGHTS": [("particles_in_region 21296", f"particles_in_region {particles}"), ("box block 0 1 0 1 0 1", "box block 0 1 0 1 0 0.3"),
                                ("run 6000", "run 3000")]}
    return particles, text, changes


def one_core(study, own):
    particles, text, changes = large_bed(study)
    rounds = 1 if study.quick else 5
    baseline = baseline_program(study)
    peers = {name: Peer.start(study, name, rounds, particles, changes[name]) for name in changes}
    for peer in filter(None, peers.values()):
        peer.wait(1)  # both settle their beds, which is not timed
    settled = own.settled(text)
    start = text[:text.index("[[grains.insert]]")] + text[text.index("[grains.output]"):]
    start = start.replace('solver = "dem"', f'solver = "dem"\nstart_from = "{settled}"')
    start = "\n".join(f"end = {2 * WINDOW}" if line.startswith("end = ") else line for line in start.splitlines()).replace("checkpoint = true", "")
    program = study.build / "bin" / "acopla-dem"
    engines = {"Acopla": Ours(study, program, start), "LAMMPS": peers["LAMMPS"], "LIGGGHTS": peers["LIGGGHTS"],
               "Acopla, baseline": Ours(study, baseline, start) if baseline else None, "Acopla, 2 threads": Ours(study, program, start, "threads = 2")}
    rates, pair = {name: [] for name in engines}, []
    for turn in range(1, rounds + 1):
        for name, engine in engines.items():
            if engine:
                rates[name].append(engine.turn(turn))
        # One thread right before two, and thrice a round: a neighbour on the second core's host spoils some of them.
        for _ in range(3):
            one = engines["Acopla"].turn(turn)
            pair.append(engines["Acopla, 2 threads"].turn(turn) / one)
        print("  million particle-steps a second:", {name: round(values[-1], 2) for name, values in rates.items() if values}, flush=True)
    bed = own.measure(start, warm=1000, steps=250, repeats=4)
    pairs = {"Acopla": bed} | {name: peer.pairs() for name, peer in peers.items() if peer}
    return particles, start, rates, pair, pairs


def report_one_core(study, particles, rates, two_over_one, pairs):
    rounds = len(rates["Acopla"])

    def over(name):
        return median(rates["Acopla"][k] / rates[name][k] for k in range(rounds)) if rates[name] else None

    both = [over(name) for name in ("LAMMPS", "LIGGGHTS")]
    study.at_least(f"DEM rate over the better of LAMMPS and LIGGGHTS (medians of {rounds} rounds)", "–", min(both) if None not in both else None, 6, "{:.2f}")
    study.at_least(f"Two threads over one, large bed (median of {len(two_over_one)} pairs in turn)", "–", median(two_over_one), 1.85, "{:.2f}")
    rows = []
    for name, values in rates.items():
        if not values:
            rows.append([name] + ["missing"] * 6)
            continue
        of = pairs[name if name in pairs else "Acopla"]
        rate = median(values)
        rows.append([name, of["particles"], of["touching"], of["listed"], f"{rate:.2f} ({min(values):.2f} … {max(values):.2f})",
                     f"{1e3 / rate:.1f}", f"{1e3 / rate * of['particles'] / of['touching']:.1f}", f"{1e3 / rate * of['particles'] / of['listed']:.1f}"])
    study.table(f"{particles} spheres, one core; medians of {rounds} rounds, the engines in turn (least … most)",
                ["engine", "spheres", "touching pairs", "listed pairs", "million particle-steps a second", "ns a particle-step", "ns a touching pair",
                 "ns a listed pair"], rows)
    study.text(f"{particles} spheres of 20 mm, Hertz–Mindlin with history, E 12.5 MPa, ν 0.25, e 0.3, μ 0.5, step 1.5e-4 s; 1000 timed steps of a settled "
               "bed a round, lists and walls included, ours from the last window of acopla-dem. The decks are in bench/dem_speed: LAMMPS starts from a "
               "shaken lattice, the other two from random places, so each has packed a bed of its own; skins differ too (the peers' 5 mm; ours follows "
               f"the motion, and {pairs['Acopla']['near']} of the listed pairs are nearer than a skin of its own and computed). LAMMPS and LIGGGHTS are "
               "Debian's packages; ours is compiled for the machine's own instruction set, and `baseline` for any x86-64, as they are.")


# --- beds of our own --------------------------------------------------------------------------------------------------
def in_turn(own, measurements, rounds):
    """Measures each of {name: arguments of measure} in rounds; the median of each by `ns_particle`, and the rounds' rates."""
    results = {name: [] for name in measurements}
    for _ in range(rounds):
        for name, (arguments, options) in measurements.items():
            results[name].append(own.measure(*arguments, **options))
    return {name: sorted(values, key=lambda v: v["ns_particle"])[len(values) // 2] for name, values in results.items()}, results


def threads_and_discs(study, own, start, tile):
    """Two threads on a bed of 100,000, and discs beside spheres."""
    e, side = beds.EDGE, 4 if study.quick else 10
    large = {name: ((beds.spheres((side * e, side * e), tile, more=more),), {"tile": (side, side, e), "warm": 300, "steps": 100, "repeats": 3})
             for name, more in (("one", ""), ("two", "threads = 2"))}
    rounds = 1 if study.quick else 3
    best, each = in_turn(own, large, rounds)
    study.at_least(f"Two threads over one, {best['one']['particles']} spheres", "–",
                   median(one["ns_particle"] / two["ns_particle"] for one, two in zip(each["one"], each["two"])), 1.85, "{:.2f}")
    across = 2 if study.quick else 10
    discs = own.settled(beds.gomes(beds.WIDTH))
    pair = {"spheres": ((start,), {"warm": 300}),
            "discs": ((beds.gomes(across * beds.WIDTH, discs),), {"tile": (across, 1, beds.WIDTH), "warm": 2000, "steps": 500})}
    beside, each = in_turn(own, pair, rounds)
    study.at_least(f"Rate of {beside['discs']['particles']} discs with type-C rolling over that of the Hertz–Mindlin spheres", "–",
                   median(d["rate"] / s["rate"] for d, s in zip(each["discs"], each["spheres"])), 1.3, "{:.2f}")
    rows = [[name, *shown(m)] for name, m in (("21,296 spheres, Hertz–Mindlin" if not study.quick else "spheres", beside["spheres"]),
                                              ("discs of Gomes (2014), tables 4.1 and 4.2", beside["discs"]),
                                              ("the tile repeated, one thread", best["one"]), ("the same, two threads", best["two"]))]
    study.table("Discs and spheres; one thread and two", ["bed", *SHOWN], rows)
    return {"spheres": beside["spheres"], "discs": beside["discs"], "one thread": best["one"], "two threads": best["two"]}


SHOWN = ["particles", "touching pairs", "near", "listed", "steps a rebuild", "steps a refresh", "million particle-steps a second", "ns a particle-step",
         "ns a touching pair"]


def shown(m):
    each = lambda count: f"{m['steps'] / count:.0f}" if count else f"> {m['steps']}"
    return [m["particles"], m["touching"], m["near"], m["listed"], each(m["rebuilds"]), each(m["refreshes"]), f"{m['rate']:.2f}",
            f"{m['ns_particle']:.1f}", f"{m['ns_touching']:.1f}"]


def feature_beds(study, own, tile):
    """{feature: (text, options)}: each settles a tile with its own physics where that differs, and repeats it."""
    e, (nx, ny) = beds.EDGE, (2, 2) if study.quick else (4, 5)
    big, options = (nx * e, ny * e), {"tile": (nx, ny, e), "warm": 600 if study.quick else 1500}
    table = {}

    def add(name, settle=None, alone="", **scene):
        start = own.settled(beds.spheres((e, e), **(scene if settle is None else settle))) if settle is not False else tile
        table[name] = (beds.spheres(big, start, more=alone, **scene), options)

    add("Hertz–Mindlin between planes", False)
    add("… without friction (Hertz)", contact='normal = "hertz"\nrestitution = 0.3')
    for law in ("constant_torque", "elastic_plastic"):
        add(f"… with rolling = {law}", contact=beds.HERTZ_MINDLIN + beds.rolling(law))
    add("linear springs with the slider", contact=beds.SLIDER)
    add("… without friction (linear)", contact=beds.LINEAR)
    add("… with rolling = elastic_plastic", contact=beds.SLIDER + beds.rolling("elastic_plastic"))
    add("energy ledger", False, "energy = true")
    add("viscous damping", False, "[grains.damping]\nviscous = { translation = 0.1, rotation = 0.1 }")
    add("local damping", False, "[grains.damping]\nlocal = 0.1")
    for name, motion in (("floor that vibrates", '{ kind = "vibration", amplitude = 1e-7, direction = [0, 0, 1], frequency = 50 }'),
                         ("floor that turns", f'{{ kind = "rotation", centre = [{big[0] / 2}, {big[1] / 2}, 0], axis = [0, 0, 1], rpm = 0.001 }}')):
        add(name, False, floor=beds.plane("z0", [0, 0, 0], [0, 0, 1], f"motion = {motion}"))
    flat, glued, glued_tile = (study.work / f"{name}.stl" for name in ("flat", "glued", "glued_tile"))
    beds.write_floor(flat, *big, 2)
    beds.write_floor(glued, *big, 2, -beds.DIAMETER / 2)
    beds.write_floor(glued_tile, e, e, 2, -beds.DIAMETER / 2)
    add("floor of two triangles", False, floor=beds.mesh_floor(flat))
    glue = f"glued = {{ diameter = {beds.DIAMETER} }}"
    add("floor of glued particles", {"floor": beds.mesh_floor(glued_tile, glue)}, floor=beds.mesh_floor(glued, glue))
    add("two materials", materials=("glass", "stone"))
    rate = 2500 * math.pi / 6 * beds.DIAMETER ** 3 / (100 * 1.5e-4)
    add("inlet, a particle every 100 steps", False,
        insert=f'[[grains.inlet]]\nmaterial = "glass"\ndiameter = 0.02\nrate = {rate}\nregion = {{ box = [[0, 0, 0.5], [{big[0]}, {big[1]}, 0.6]] }}\n')
    add("four partitions on one thread", False, "threads = 1\npartitions = 4")
    return table


def features(study, own, tile):
    table = feature_beds(study, own, tile)
    measured, base = {}, next(iter(table))
    for name, (text, options) in table.items():
        # The base beside each, so that what else the machine does meets both.
        reference = own.measure(table[base][0], steps=100, repeats=3, **table[base][1]) if name != base else None
        measured[name] = own.measure(text, steps=250, repeats=3, **options)
        measured[name]["over"] = measured[name]["ns_particle"] / reference["ns_particle"] if reference else 1
    per = lambda m, key: f"{m[key] / m['particles']:.2f}"
    study.table("What each feature costs: the bed of tiles, one core", ["scene", "touching a particle", "near", "listed", "on walls", "ns a particle-step",
                "over the first row", "ns a touching pair", "bytes a particle", "bytes a pair"],
                [[name, per(m, "touching"), per(m, "near"), per(m, "listed"), per(m, "on_walls"), f"{m['ns_particle']:.1f}", f"{m['over']:.2f}",
                  f"{m['ns_touching']:.1f}", m["bytes_particle"], m["bytes_contact"]] for name, m in measured.items()])
    study.text(f"Each row is the first one with one thing changed; {measured[base]['particles']} spheres made of tiles of {beds.SPHERES}, which settled with the "
               "row's own laws, so that beds without friction are denser. `near`: pairs that are computed; `over the first row`: against the first row measured "
               "beside it. A law that is not used costs nothing: no friction means no spins, torques or springs, and fewer bytes.")
    return measured


def bytes_table(study, discs, spheres, largest):
    """Stored bytes beside what the laws cannot do without."""
    rows = [["sphere with spin", spheres["bytes_particle"], "136", "position, velocity, spin, force, torque (3 each), radius, mass; the inertia follows"],
            ["disc", discs["bytes_particle"], "88", "position, velocity, force (2 each), angle-free spin and torque, radius, mass, each 8 bytes; "
             "id and material are 5 more"],
            ["pair, Hertz–Mindlin", spheres["bytes_contact"], "32", "two indices (4 each), the tangential spring (3 × 8)"],
            ["pair, discs with type-C rolling", discs["bytes_contact"], "24", "two indices, the tangential spring, the rolling torque (8 each)"]]
    rows[1][2:] = ["80", "position, velocity, force (2 each), spin, torque, radius, mass"]
    study.table("Stored bytes beside the least there can be", ["what", "here", "least", "the least is"], rows)
    study.text("Beyond the least: a particle keeps its position at the last rebuild (32 bytes), id and material (5), and pads records to four doubles; the "
               "inertia stands where a load brings it along. A pair keeps the closing speed of the half step before and, for Mindlin, the stiffness of the step "
               "before, 8 bytes each (second order, and no energy made when it unloads), and its place in the list (4). With the list of neighbours, the pairs "
               "that nearly touch, and the grid, the process holds "
               f"{largest['heap_particle']:.0f} bytes a particle at {largest['particles']} spheres with {largest['near'] / largest['particles']:.2f} near and "
               f"{largest['listed'] / largest['particles']:.2f} listed pairs each.")


def growth(study, own, tile):
    """Time of a particle-step from a thousand to a million spheres."""
    e = beds.EDGE
    sides = [(1, 1), (1, 3), (2, 5), (3, 10)] if study.quick else [(1, 1), (1, 3), (2, 5), (5, 6), (10, 10), (15, 20), (25, 40)]
    measured = []
    for nx, ny in sides:
        steps = max(20, 300 // (nx * ny) * 10)
        measured.append(own.measure(beds.spheres((nx * e, ny * e), tile), tile=(nx, ny, e), warm=max(60, steps), steps=steps, repeats=3))
    x, y = [math.log(m["particles"]) for m in measured], [math.log(m["ns_particle"]) for m in measured]
    mean_x, mean_y = statistics.mean(x), statistics.mean(y)
    exponent = sum((a - mean_x) * (b - mean_y) for a, b in zip(x, y)) / sum((a - mean_x) ** 2 for a in x)
    rate, last = stream_rate(), measured[-1]
    # What one step has to move when nothing stays in a cache: the pass over the pairs reads position, velocity, spin, force and torque and
    # writes the last two; the pass over the particles reads those and the position of the last rebuild and writes the five; every pair reads
    # its indices and reads and writes its history.
    moved = 32 * (7 + 11) + last["near"] / last["particles"] * (8 + 2 * 40)
    study.table("Growth with the number of particles: one core", ["bed", *SHOWN, "MB at work"],
                [[f"{nx} × {ny} tiles", *shown(m), f"{m['heap_particle'] * m['particles'] / 1e6:.1f}"] for (nx, ny), m in zip(sides, measured)])
    study.text(f"A particle-step's time grows as N^{exponent:.3f} from {measured[0]['particles']} to {measured[-1]['particles']} spheres. What rise there is, is the "
               f"memory's: {caches()}. A step of {last['particles']} spheres has to move {moved:.0f} bytes a particle, {moved / rate:.0f} ns at the "
               f"{rate:.1f} GB/s of a copy of 256 MB in this run; it takes {last['ns_particle'] * rate / moved:.1f} times that. Tiles rub against each other at their seams until they have settled, so the larger beds rebuild more often than a bed "
               "that settled as one; the single tile has more walls.")
    return measured


def stream_rate():
    """Bytes a nanosecond of a copy far beyond the caches, read and written, the best of five."""
    import numpy
    source, target = numpy.ones(2**25), numpy.zeros(2**25)
    best = math.inf
    for _ in range(5):
        began = time.perf_counter()
        numpy.copyto(target, source)
        best = min(best, time.perf_counter() - began)
    return 2 * source.nbytes / best / 1e9


def caches():
    done = subprocess.run(["lscpu", "-B", "-C=NAME,ONE-SIZE"], stdout=subprocess.PIPE, text=True)
    sizes = [line.split() for line in done.stdout.splitlines()[1:]]
    return "caches here are " + ", ".join(f"{name} {int(size) // 1024} KiB" for name, size in sizes if name != "L1i") if sizes else "caches unknown"


def triangles(study, own, tile):
    """Floors of more and more triangles under the same bed."""
    e, (nx, ny) = beds.EDGE, (2, 2) if study.quick else (4, 5)
    size, options = (nx * e, ny * e), {"tile": (nx, ny, e), "warm": 600 if study.quick else 1500, "steps": 150, "repeats": 3}
    texts, floors = {0: beds.spheres(size, tile)}, [100, 1000, 10000] if study.quick else [100, 1000, 10000, 100000]
    for wanted in floors:
        path = study.work / f"floor{wanted}.stl"
        beds.write_floor(path, *size, wanted)
        texts[wanted] = beds.spheres(size, tile, floor=beds.mesh_floor(path))
    best, each = in_turn(own, {wanted: ((text,), options) for wanted, text in texts.items()}, 1 if study.quick else 3)
    over = {wanted: median(m["ns_particle"] / plane["ns_particle"] for m, plane in zip(each[wanted], each[0])) for wanted in texts}
    study.table("Triangles under the same bed: one core", ["floor", "ns a particle-step", "over the plane", "bytes a triangle", "spheres on walls"],
                [[f"{m['triangles']} triangles" if m["triangles"] else "plane", f"{m['ns_particle']:.1f}", f"{over[wanted]:.2f}",
                  f"{m['bytes_triangle']:.0f}" if m["triangles"] else "–", m["on_walls"]] for wanted, m in best.items()])
    energies = {m["kinetic_energy"] for m in best.values()}
    edge = math.sqrt(2 * size[0] * size[1] / best[floors[-1]]["triangles"]) * 1e3
    study.text(f"A flat floor, split finer and finer: the finest triangles have legs of {edge:.1f} mm under spheres of 20 mm. "
               + ("The bed's kinetic energy after the timed steps is the same to all printed digits on every floor: it does not feel the edges."
                  if len(energies) == 1 else f"Kinetic energies after the timed steps: {sorted(energies)} J."))
    return best


# --- the study --------------------------------------------------------------------------------------------------------
def run(study):
    own = beds.Beds(study)
    began = time.time()
    lap = lambda: f"{time.time() - began:.0f} s"
    particles, start, rates, two_over_one, pairs = one_core(study, own)
    report_one_core(study, particles, rates, two_over_one, pairs)
    print("  one core", lap(), flush=True)
    e = beds.EDGE
    tile = own.settled(beds.spheres((e, e)))
    beside = threads_and_discs(study, own, start, tile)
    print("  threads and discs", lap(), flush=True)
    by_feature = features(study, own, tile)
    print("  features", lap(), flush=True)
    by_number = growth(study, own, tile)
    print("  growth", lap(), flush=True)
    by_triangles = triangles(study, own, tile)
    print("  triangles", lap(), flush=True)
    bytes_table(study, beside["discs"], beside["spheres"], by_number[-1])
    study.table("What each step of the engine's making gained on the large bed (best of short intervals, same machine, not in this run)",
                ["step", "million particle-steps a second"], HISTORY)
    rows = [["large bed, " + name, f"round {k + 1}", "rate", value] for name, values in rates.items() for k, value in enumerate(values)]
    rows += [["large bed", f"pair {k + 1}", "two threads over one", value] for k, value in enumerate(two_over_one)]
    groups = {"beside": beside, "feature": by_feature, "growth": {m["particles"]: m for m in by_number},
              "floor": {m["triangles"]: m for m in by_triangles.values()}}
    rows += [[group, name, key, value] for group, entries in groups.items() for name, m in entries.items() for key, value in m.items()]
    study.csv(["group", "name", "quantity", "value"], rows)
    draw_all(study, rates, by_feature, by_number)


def draw_all(study, rates, by_feature, by_number):
    def draw(axes):
        peers, costs, number = axes
        names = list(rates)
        peers.barh(names, [median(rates[name]) if rates[name] else 0 for name in names], color=["tab:blue", "0.6", "0.6", "tab:cyan", "tab:cyan"])
        peers.set_xlabel("million particle-steps a second, large bed")
        peers.invert_yaxis()
        names = list(by_feature)
        costs.barh(names, [by_feature[name]["ns_particle"] for name in names], color=["tab:blue"] + ["tab:cyan"] * (len(names) - 1))
        costs.axvline(by_feature[names[0]]["ns_particle"], color="0.3", linewidth=0.8)
        costs.set_xlabel("ns a particle-step")
        costs.invert_yaxis()
        number.semilogx([m["particles"] for m in by_number], [m["ns_particle"] for m in by_number], "o-")
        number.set_ylim(bottom=0)
        number.set_xlabel("spheres")
        number.set_ylabel("ns a particle-step")

    study.figure(draw, (8, 11), heights=[1, 3, 1.6])
