#!/usr/bin/python3
"""A structure on several processes: the same answer to 10 κ ε, refusals, and every way to fail.

Usage: processes_test.py FOLDER_OF_EXECUTABLES [test names].
"""

import glob
import json
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import unittest

import h5py
import numpy as np

BIN = os.path.abspath(sys.argv[1])
SLACK = float(os.environ.get("ACOPLA_TEST_SLACK", "3"))
EPSILON = np.finfo(float).eps
MPI = os.environ | {"OMPI_ALLOW_RUN_AS_ROOT": "1", "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1", "OMPI_MCA_rmaps_base_oversubscribe": "1",
                    "OMPI_MCA_hwloc_base_binding_policy": "none"}
ONE_THREAD = os.environ | {"OPENBLAS_NUM_THREADS": "1", "DEAL_II_NUM_THREADS": "1"}  # sums on several threads agree to round-off only

# What differs: dimension, order, shape of the cells, what holds and loads the body, and how it moves.
STATIC = {
    "2D_Q1": ('dimension = 2', 'mesh = { bar = { size = [1, 0.2], cells = [20, 4] } }\ndegree = 1\nlocking = "b_bar"',
              '[structure.fix.x0]\n[structure.load.x1]\ntraction = [0, -1e6]'),
    "2D_P2": ('dimension = 2', 'mesh = { bar = { size = [1, 0.2], cells = [12, 3], simplices = true } }\ndegree = 2\nplane = "stress"',
              '[structure.foundation.y0]\nstiffness = 1e9\ndirections = "all"\n[structure.load.x1]\ntraction = [0, -1e6]'),
    "3D_Q2": ('dimension = 3\ngravity = [0, 0, -9.81]', 'mesh = { bar = { size = [1, 0.2, 0.2], cells = [8, 2, 2] } }\ndegree = 2',
              '[structure.fix.x0]\n[structure.move.x1]\ndisplacement = [0, 0, 1e-3]\ndirections = ["z"]'),
    "3D_P2": ('dimension = 3', 'mesh = { bar = { size = [1, 0.2, 0.2], cells = [5, 1, 1], simplices = true } }\ndegree = 2',
              '[structure.fix.x0]\n[structure.load.x1]\ntraction = [0, 0, -1e6]'),
}
DYNAMIC = {
    "2D_P1_newmark": ('dimension = 2', 'mesh = { bar = { size = [1, 0.2], cells = [20, 4], simplices = true } }\ndegree = 1\nstep = 1e-3\nnewmark = { beta = 0.3, gamma = 0.6 }',
                      '[structure.fix.x0]\n[structure.load.x1]\ntraction = [0, -1e6]\nramp = 2e-3'),
    "2D_Q2_generalised": ('dimension = 2', 'mesh = { bar = { size = [1, 0.2], cells = [10, 2] } }\ndegree = 2\nstep = 1e-3\ngeneralised_alpha = { spectral_radius = 0.8 }',
                          '[structure.fix.x0]\n[structure.load.x1]\ntraction = [0, -1e6]\nramp = 2e-3'),
    "3D_Q1_moved": ('dimension = 3\ngravity = [0, 0, -9.81]',
                    'mesh = { bar = { size = [1, 0.2, 0.2], cells = [10, 2, 2] } }\ndegree = 1\nstep = 1e-3\nrayleigh = { mass = 2, stiffness = 1e-5 }',
                    '[structure.fix.x0]\n[structure.move.x1]\nvelocity = [0, 0, 0.1]'),
}
CASE = """title = "processes"
{head}
end = {end}
[coupling]
scheme = "one-way"
window = {end}
max_distance = 0.1
[structure]
solver = "fem"
{body}
{more}
[structure.material]
young = 2.1e11
poisson = 0.3
density = 7850
{parts}
[structure.output]
vtu = false
hdf5 = true
condition = true
reactions = true
"""


# Discs fall onto a beam, bounce, and bend it.
BEAM = """title = "beam"
dimension = 2
gravity = [0, -9.81]
end = {end}
[coupling]
{scheme}
window = 2e-4
max_distance = 1e-3
record_motion = true
[[coupling.interface]]
from = "discs.floor"
to = "beam.y1"
[discs]
solver = "dem"
[discs.material.disc]
density = 500
[[discs.contact]]
between = [["disc", "disc"]]
normal = {{ law = "linear", stiffness = 1e5 }}
restitution = 0.5
[discs.wall.floor]
line = [[0, 0], [0.1, 0], [0.2, 0], [0.3, 0], [0.4, 0], [0.5, 0], [0.6, 0], [0.7, 0], [0.8, 0], [0.9, 0], [1, 0]]
material = "disc"
[[discs.insert]]
material = "disc"
particles = [{{ at = [0.31, 0.0102], diameter = 0.02, velocity = [0, -0.5] }}, {{ at = [0.52, 0.0104], diameter = 0.02, velocity = [0, -1] }}]
[beam]
solver = "fem"
processes = {processes}
mesh = {{ bar = {{ size = [1, 0.03], cells = [20, 1], origin = [0, -0.03] }} }}
analysis = "dynamic"
rayleigh = {{ mass = 10 }}
[beam.material]
young = 5e8
poisson = 0.3
density = 7800
[beam.fix.x0]
[beam.fix.x1]
[beam.output]
vtu = false
hdf5 = true
condition = true
"""
SCHEMES = {"explicit": 'scheme = "explicit"', "implicit": 'scheme = "implicit"\ntolerance = 1e-10'}


def two_materials(path):
    """A bar of 8 cells, soft and stiff, as gmsh 2.2 writes it."""
    points = [(i, j, k) for i in range(9) for j in range(2) for k in range(2)]
    number = {p: n + 1 for n, p in enumerate(points)}
    ring = [(0, 0), (1, 0), (1, 1), (0, 1)]
    cells = [[number[(i + a, j, k)] for a, (j, k) in [(0, r) for r in ring] + [(1, r) for r in ring]] for i in range(8)]
    faces = [[number[(0, j, k)] for j, k in ring], [number[(8, j, k)] for j, k in ring]]
    lines = ["$MeshFormat", "2.2 0 8", "$EndMeshFormat", "$PhysicalNames", "4", '2 1 "foot"', '2 2 "head"', '3 3 "soft"', '3 4 "stiff"', "$EndPhysicalNames",
             "$Nodes", str(len(points))] + [f"{number[p]} {0.1 * p[0]} {0.1 * p[1]} {0.1 * p[2]}" for p in points] + ["$EndNodes", "$Elements", "10"]
    for n, (face, group) in enumerate(zip(faces, (1, 2))):
        lines.append(f"{n + 1} 3 2 {group} {group} " + " ".join(map(str, face)))
    for n, cell in enumerate(cells):
        group = 3 if n < 4 else 4
        lines.append(f"{n + 3} 5 2 {group} {group} " + " ".join(map(str, cell)))
    with open(path, "w") as stream:
        stream.write("\n".join(lines + ["$EndElements", ""]))


class ProcessesTest(unittest.TestCase):
    def setUp(self):
        self.folder = tempfile.mkdtemp(prefix="processes-test-")
        self.addCleanup(shutil.rmtree, self.folder, ignore_errors=True)

    def write(self, text, name="case.toml"):
        path = f"{self.folder}/{name}"
        with open(path, "w") as stream:
            stream.write(text)
        return path

    def mpirun(self, processes, *command, timeout=120):
        return subprocess.run(["mpirun", "-np", str(processes), *command], env=MPI, capture_output=True, text=True, timeout=timeout, cwd=self.folder)

    def solve(self, case, processes, name="structure"):
        """Displacements of all nodes and the quantities."""
        results = f"{self.folder}/results-{processes}"
        command = [f"{BIN}/acopla-fem", case, "--results", results]
        done = subprocess.run(command, capture_output=True, text=True) if processes == 1 else self.mpirun(processes, *command)
        self.assertEqual(done.returncode, 0, done.stderr + done.stdout)
        values = {words[0]: float(words[1]) for words in map(str.split, done.stdout.splitlines()) if len(words) == 2}
        with h5py.File(f"{results}/{name}.h5") as file:
            found = []
            file.visititems(lambda name, item: found.append(item) if name.endswith("displacement") and isinstance(item, h5py.Dataset) else None)
            self.assertEqual(len(found), 1)
            return np.array(found[0])[-1], values

    def assert_same(self, case):
        alone, values = self.solve(case, 1)
        kappa = values["condition"]
        self.assertGreater(kappa, 1)
        self.assertGreater(np.abs(alone).max(), 0)
        self.assertNotIn("processes", values)
        for processes in (2, 3):
            shared, quantities = self.solve(case, processes)
            self.assertEqual(quantities["processes"], processes)
            self.assertGreater(quantities["memory.sum"], quantities["memory.largest"])
            self.assertAlmostEqual(quantities["condition"] / kappa, 1, delta=0.01)
            difference = np.abs(shared - alone).max() / np.abs(alone).max()
            print(f"  {self.id().split('.')[-1]}, {processes} processes: difference {difference:.1e} = {difference / (kappa * EPSILON):.2g} κ ε, κ = {kappa:.3g}", file=sys.stderr)
            self.assertLessEqual(difference, 10 * kappa * EPSILON)
            largest = max(abs(v) for name, v in values.items() if "reaction" in name or "load" in name)
            for name in values:
                if "reaction" in name or "load" in name:
                    self.assertAlmostEqual(quantities[name], values[name], delta=max(100 * kappa * EPSILON, 1e-9) * largest, msg=name)

    def test_static_answers(self):
        for name, (head, body, parts) in STATIC.items():
            with self.subTest(name):
                self.assert_same(self.write(CASE.format(head=head, body=body, parts=parts, end=1, more="")))
                shutil.rmtree(f"{self.folder}/results-1")
                shutil.rmtree(f"{self.folder}/results-2")
                shutil.rmtree(f"{self.folder}/results-3")

    def test_dynamic_answers(self):
        for name, (head, body, parts) in DYNAMIC.items():
            with self.subTest(name):
                self.assert_same(self.write(CASE.format(head=head, body=body, parts=parts, end=0.005, more='analysis = "dynamic"')))
                for results in glob.glob(f"{self.folder}/results-*"):
                    shutil.rmtree(results)

    def test_several_materials(self):
        two_materials(f"{self.folder}/bar.msh")
        text = CASE.format(head="dimension = 3", body='mesh = "bar.msh"\ndegree = 2', end=1, more="", parts="[structure.fix.foot]\n[structure.load.head]\ntraction = [0, 0, -1e4]")
        soft = "[structure.material.soft]\nyoung = 1e8\npoisson = 0.3\n[structure.material.stiff]\nyoung = 2e11\npoisson = 0.2\n"
        before, after = text.split("[structure.material]\n")
        self.assert_same(self.write(before + soft + after.split("density = 7850\n")[1]))

    def test_refusals(self):
        head, body, parts = STATIC["3D_Q2"]
        for more, words in (('displacements = "large"', ["displacements", "one process"]), ('linear_solver = "direct"', ["linear_solver", "one process"])):
            case = self.write(CASE.format(head=head, body=body, parts=parts, end=1, more=more).replace("condition = true", "condition = false"))
            done = self.mpirun(2, f"{BIN}/acopla-fem", case)
            self.assertEqual(done.returncode, 2, done.stderr)
            for word in ["case.toml:", *words]:
                self.assertIn(word, done.stderr)
            self.assertEqual(done.stderr.count("one process"), 1, done.stderr)
            with_key = self.write(CASE.format(head=head, body=body, parts=parts, end=1, more=more + "\nprocesses = 2").replace("condition = true", "condition = false"))
            done = subprocess.run([f"{BIN}/acopla", "check", with_key], capture_output=True, text=True)
            self.assertEqual(done.returncode, 2, done.stderr + done.stdout)

    def test_explain(self):
        head, body, parts = STATIC["3D_Q2"]
        case = self.write(CASE.format(head=head, body=body, parts=parts, end=1, more="processes = 2"))
        done = subprocess.run([f"{BIN}/acopla", "explain", case], capture_output=True, text=True)
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertIn("2 processes", done.stdout)

    def test_bodies_that_have_no_answer(self):
        free = CASE.format(head="dimension = 3", body='mesh = { bar = { size = [1, 0.2, 0.2], cells = [8, 2, 2] } }', end=1, more="",
                           parts='[structure.fix.x0]\ndirections = ["x"]\n[structure.load.x1]\ntraction = [0, 0, -1e6]')
        done = self.mpirun(2, f"{BIN}/acopla-fem", self.write(free))
        self.assertEqual(done.returncode, 2, done.stderr)
        self.assertEqual(done.stderr.count("leaves the structure free to"), 1, done.stderr)
        # Two squares that share one corner: the second turns about it.
        hinge = ["$MeshFormat", "2.2 0 8", "$EndMeshFormat", "$PhysicalNames", "3", '1 1 "foot"', '1 2 "head"', '2 3 "solid"', "$EndPhysicalNames", "$Nodes", "7", "1 0 0 0", "2 1 0 0",
                 "3 1 1 0", "4 0 1 0", "5 2 1 0", "6 2 2 0", "7 1 2 0", "$EndNodes", "$Elements", "4", "1 1 2 1 1 4 1", "2 1 2 2 2 5 6", "3 3 2 3 3 1 2 3 4", "4 3 2 3 3 3 5 6 7",
                 "$EndElements", ""]
        self.write("\n".join(hinge), "hinge.msh")
        case = CASE.format(head="dimension = 2", body='mesh = "hinge.msh"\ndegree = 2', end=1, more="", parts="[structure.fix.foot]\n[structure.load.head]\ntraction = [0, -1e6]")
        done = self.mpirun(2, f"{BIN}/acopla-fem", self.write(case))
        self.assertEqual(done.returncode, 2, done.stderr + done.stdout)
        self.assertEqual(done.stderr.count("is a mechanism"), 1, done.stderr)
        endless = CASE.format(head="dimension = 3", body='mesh = { bar = { size = [1, 0.2, 0.2], cells = [8, 2, 2] } }', end=1, more="",
                              parts="[structure.fix.x0]\n[structure.load.x1]\ntraction = [0, 0, -1e6]").replace("2.1e11", "1e308")
        done = self.mpirun(2, f"{BIN}/acopla-fem", self.write(endless))
        self.assertNotEqual(done.returncode, 0, done.stdout)
        self.assertIn("conjugate gradients", done.stderr)
        small = CASE.format(head="dimension = 2", body='mesh = { bar = { size = [1, 1], cells = [1, 1] } }', end=1, more="", parts="[structure.fix.x0]")
        done = self.mpirun(3, f"{BIN}/acopla-fem", self.write(small))
        self.assertEqual(done.returncode, 2, done.stderr)
        self.assertIn("too small for 3 processes", done.stderr)

    def test_a_process_that_fails_alone_ends_all(self):
        for who in ("0", "1", "2"):
            for what, code, words in (("throws", 1, f"process {who} gave up"), ("mistakes", 2, "case.toml:3:1: a mistake."), ("dies", 137, "")):
                with self.subTest(who=who, what=what):
                    begin = time.monotonic()
                    done = self.mpirun(3, f"{BIN}/team_stub", who, what, timeout=60)
                    self.assertEqual(done.returncode, code, done.stderr)
                    self.assertIn(words, done.stderr)
                    self.assertLess(time.monotonic() - begin, 4 + 2 * SLACK)

    def test_processes_that_fail_alike_say_it_once(self):
        done = self.mpirun(3, f"{BIN}/team_stub", "all", "mistakes")
        self.assertEqual(done.returncode, 2, done.stderr)
        self.assertEqual(done.stderr.count("a mistake."), 1, done.stderr)
        self.assertNotIn("MPI_ABORT", done.stderr)
        done = self.mpirun(3, f"{BIN}/team_stub", "before", "throws")
        self.assertEqual(done.returncode, 1, done.stderr)
        self.assertEqual(done.stderr.count("gave up"), 1, done.stderr)
        done = self.mpirun(3, f"{BIN}/team_stub", "nobody", "throws")
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertIn("3 processes are well", done.stdout)

    # --- under acopla run ---------------------------------------------------------------------------------------------
    def processes(self):
        """Name and parent of every process of this case."""
        found = {}
        for entry in filter(str.isdigit, os.listdir("/proc")):
            try:
                with open(f"/proc/{entry}/cmdline", "rb") as stream:
                    words = stream.read().decode(errors="replace").split("\0")
                with open(f"/proc/{entry}/stat") as stream:
                    state = stream.read().rsplit(")", 1)[1].split()
            except OSError:
                continue
            if int(entry) != os.getpid() and state[0] != "Z" and any(self.folder in w for w in words):
                found[int(entry)] = os.path.basename(words[0])
        return found

    def rank_of(self, pid):
        with open(f"/proc/{pid}/environ", "rb") as stream:
            for entry in stream.read().split(b"\0"):
                if entry.startswith(b"OMPI_COMM_WORLD_RANK="):
                    return int(entry.split(b"=")[1])
        return None

    def begin(self, end="0.005"):
        head, body, parts = DYNAMIC["3D_Q1_moved"]
        text = CASE.format(head=head, body=body, parts=parts, end=end, more='analysis = "dynamic"\nprocesses = 2')
        case = self.write(text.replace(f"window = {end}", "window = 0.005"))
        return subprocess.Popen([f"{BIN}/acopla", "run", case, "--results", f"{self.folder}/results"], cwd=self.folder, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
                                start_new_session=True)

    def test_run_starts_them(self):
        run = self.begin()
        out, err = run.communicate(timeout=120)
        self.assertEqual(run.returncode, 0, err + out)
        with open(f"{self.folder}/results/summary.json") as stream:
            self.assertIn('"processes": 2', stream.read())

    def beam(self, name, **values):
        """A case of the beam, and how it is run to the folder `name`."""
        case = self.write(BEAM.format(**values), f"{name}.toml")
        return [f"{BIN}/acopla", "run", case, "--results", f"{self.folder}/{name}"]

    def couple(self, command):
        done = subprocess.run(command, env=ONE_THREAD, capture_output=True, text=True, timeout=120)
        self.assertEqual(done.returncode, 0, done.stderr + done.stdout)

    def record(self, name):
        """All that the interface's record holds, by name."""
        found = {}
        with h5py.File(f"{self.folder}/{name}/interface.h5") as file:
            file.visititems(lambda key, item: found.update({key: item[...]}) if isinstance(item, h5py.Dataset) else None)
        return found

    def test_two_way_coupling(self):
        """Forces and motion of every window, to what the stiffness's condition leaves of the equilibrium that the beam begins in."""
        alone = BEAM.format(scheme='scheme = "one-way"', processes=1, end=0.01).replace('analysis = "dynamic"\nrayleigh = { mass = 10 }', "")
        kappa = self.solve(self.write(alone[:alone.index("[[coupling.interface]]")] + alone[alone.index("[beam]"):]), 1, "beam")[1]["condition"]
        for name, scheme in SCHEMES.items():
            with self.subTest(name):
                for processes in (1, 2):
                    self.couple(self.beam(f"{name}{processes}", scheme=scheme, processes=processes, end=0.01))
                one, two = self.record(name + "1"), self.record(name + "2")
                self.assertEqual(set(one), set(two))
                for key in ("beam.y1/force", "beam.y1/displacement", "beam.y1/velocity"):
                    self.assertGreater(np.abs(one[key]).max(), 0)
                    difference = np.abs(two[key] - one[key]).max() / np.abs(one[key]).max()
                    print(f"  {name}, {key}: difference {difference:.1e} = {difference / (kappa * EPSILON):.2g} κ ε, κ = {kappa:.3g}", file=sys.stderr)
                    self.assertLessEqual(difference, 10 * kappa * EPSILON, key)

    def test_a_two_way_run_that_was_killed_is_resumed_bit_by_bit(self):
        for name, scheme in SCHEMES.items():
            with self.subTest(name):
                values = {"scheme": scheme + "\ncheckpoint_every = 0.004", "processes": 2, "end": 0.02}
                self.couple(self.beam(f"{name}-whole", **values))
                command = self.beam(f"{name}-killed", **values)
                run = subprocess.Popen(command, env=ONE_THREAD, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
                until = time.monotonic() + 60
                while not os.path.exists(f"{self.folder}/{name}-killed/checkpoint/coupler.h5") and time.monotonic() < until:
                    time.sleep(0.01)
                time.sleep(0.02)  # into windows that will be computed again
                run.kill()
                self.assertEqual(run.wait(), -signal.SIGKILL, "the run ended before it was killed")
                until = time.monotonic() + 2 + SLACK
                while self.processes() and time.monotonic() < until:
                    time.sleep(0.02)
                self.couple([f"{BIN}/acopla", "run", f"{self.folder}/{name}-killed.toml", "--resume", f"{self.folder}/{name}-killed"])
                whole, resumed = self.record(f"{name}-whole"), self.record(f"{name}-killed")
                self.assertEqual(set(whole), set(resumed))
                self.assertEqual(len(whole["windows"]), 100)
                for key in whole:
                    self.assertEqual(whole[key].tobytes(), resumed[key].tobytes(), key)

    def test_a_death_ends_the_run(self):
        for victim in ("first", "second", "mpirun", "launcher"):
            with self.subTest(victim):
                run = self.begin(end="1000")
                for _ in range(1500):
                    if run.poll() is not None:
                        self.fail("the run ended by itself: " + run.communicate()[1])
                    ranks = {self.rank_of(pid): pid for pid, name in self.processes().items() if name == "acopla-fem"}
                    log = f"{self.folder}/results/interface.h5"
                    if len(ranks) == 2 and os.path.exists(log) and os.path.getsize(log) > 4000:
                        break
                    time.sleep(0.02)
                self.assertEqual(set(ranks), {0, 1})
                launchers = [pid for pid, name in self.processes().items() if name == "mpirun"]
                target = {"first": ranks[0], "second": ranks[1], "mpirun": launchers[0], "launcher": run.pid}[victim]
                os.kill(target, signal.SIGKILL)
                begin = time.monotonic()
                out, err = run.communicate(timeout=30)
                seconds = time.monotonic() - begin
                print(f"  {victim} killed: over after {seconds:.2f} s", file=sys.stderr)
                if victim != "launcher":
                    self.assertEqual(run.returncode, 1, err)
                    self.assertIn("structure", err)
                self.assertLess(seconds, 2 + SLACK)
                until = time.monotonic() + SLACK
                while self.processes() and time.monotonic() < until:
                    time.sleep(0.02)
                self.assertEqual(self.processes(), {}, "processes are left")
                shutil.rmtree(f"{self.folder}/results", ignore_errors=True)


if __name__ == "__main__":
    unittest.main(argv=[sys.argv[0]] + sys.argv[2:], verbosity=2)
