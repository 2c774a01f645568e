"""DEM rate on one core: the same spheres, material, walls and step in three engines, one after another in one run."""
import os
import re
import shutil

PARTICLES, TIMED = 21296, 1000


def ours(study, case):
    text = study.run([study.program("acopla-dem"), str(case), "--results", str(study.work / f"ours-{os.urandom(3).hex()}")], cwd=study.work)
    value = lambda name: float(re.search(rf"^{re.escape(name)} +(\S+)", text, re.M).group(1))
    return value("particle_steps_per_second.last") / 1e6, value("contacts"), value("kinetic_energy")


def peer(study, program, deck, particles, replace):
    """Million particle-steps a second of the last run of the deck, or None where the program is not installed."""
    if not shutil.which(program):
        return None
    source = (study.root / "bench" / "dem_speed" / deck).read_text()
    for old, new in replace:
        assert old in source, (deck, old)
        source = source.replace(old, new)
    (study.work / deck).write_text(source)
    environment = dict(os.environ, OMP_NUM_THREADS="1", OMPI_ALLOW_RUN_AS_ROOT="1", OMPI_ALLOW_RUN_AS_ROOT_CONFIRM="1")
    text = study.run(["mpirun", "--oversubscribe", "-np", "1", program, "-in", deck, "-var", "procs", "1"], cwd=study.work, env=environment)
    after = text[text.index("TIMED"):]
    match = re.search(r"Loop time of (\S+) on .* for (\d+) steps with (\d+) atoms", after)
    assert int(match.group(3)) >= 0.99 * particles, match.group(0)  # none may have been lost on the way
    return int(match.group(3)) * int(match.group(2)) / float(match.group(1)) / 1e6


def run(study):
    particles = PARTICLES
    case_text = (study.root / "bench" / "dem_speed" / "case.toml").read_text()
    lammps_changes, liggghts_changes = [], []
    rounds = 3
    if study.quick:  # fewer layers, a shorter fall
        particles, rounds = 1936 * 2, 1
        case_text = case_text.replace("count = 21296", f"count = {particles}").replace("end = 1.05", "end = 0.6").replace("0.6]] }", "0.15]] }")
        lammps_changes = [("0.02 0.25", "0.02 0.05"), ("run 6000", "run 3000")]
        liggghts_changes = [("particles_in_region 21296", f"particles_in_region {particles}"), ("run 6000", "run 3000")]
    case = study.work / "case.toml"
    case.write_text(case_text)
    rows = []
    for _ in range(rounds):
        rate, contacts, energy = ours(study, case)
        rows.append((rate, peer(study, "lmp", "lammps.in", particles, lammps_changes),
                     peer(study, "liggghts", "liggghts.in", particles, liggghts_changes)))
        print("  Acopla, LAMMPS, LIGGGHTS [million particle-steps a second]:", rows[-1], flush=True)

    def ratio(column):
        values = sorted(row[0] / row[column] for row in rows if row[column])
        return values[len(values) // 2] if values else None

    for column, name in ((1, "LAMMPS"), (2, "LIGGGHTS")):
        study.at_least(f"DEM rate over {name}'s (median of {rounds})", "–", ratio(column), 1.0, "{:.2f}")
    show = lambda value: "missing" if value is None else f"{value:.3f}"
    study.table("Million particle-steps a second on one core, same run", ["round", "Acopla", "LAMMPS", "LIGGGHTS"],
                [[k + 1, *map(show, row)] for k, row in enumerate(rows)])
    study.text(f"{particles} spheres of 20 mm, Hertz–Mindlin with history, E 12.5 MPa, ν 0.25, e 0.3, μ 0.5, step 1.5e-4 s; the timed "
               f"{TIMED} steps come after the bed has settled ({contacts:.0f} contacts, {energy:.3g} J left). The decks are in "
               "bench/dem_speed; LAMMPS starts from a shaken lattice, the other two from random places. LAMMPS and LIGGGHTS "
               "are Debian's packages, ours is compiled for the machine's own instruction set.")
    study.csv(["round", "acopla", "lammps", "liggghts"], [[k + 1, *row] for k, row in enumerate(rows)])

    def draw(axes):
        best = [max((row[c] or 0) for row in rows) for c in range(3)]
        axes.barh(["Acopla", "LAMMPS", "LIGGGHTS"], best, color=["tab:blue", "0.6", "0.6"])
        axes.set_xlabel("million particle-steps a second, one core")
        axes.invert_yaxis()

    study.figure(draw, (6, 2))
