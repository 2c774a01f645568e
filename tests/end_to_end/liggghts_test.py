#!/usr/bin/python3
"""LIGGGHTS in the place of acopla-dem: liggghts_test.py BIN. The same cases with one line changed, on one process and on two."""
import os
import pathlib
import re
import signal
import sys
import time
import unittest

import h5py
import numpy
from case_runner import CaseFolder
from sample_cases import GLASS, SMALL_BOX, WEIGHT, floor, make_small_box, stl

BIN = pathlib.Path(sys.argv.pop(1)).resolve()
ONE = ('solver = "dem"', 'solver = "liggghts"')
TWO = ('solver = "dem"', 'solver = "liggghts"\nprocesses = 2')

# One sphere above a floor of two triangles; alone, its forces recorded. The first impact takes a millisecond or so.
BOUNCE = f"""title = "bounce"
dimension = 3
gravity = [0, 0, -9.81]
end = 0.2
[coupling]
scheme = "one-way"
window = 0.002
max_distance = 0.1
[[coupling.interface]]
from = "grains.floor"
[grains]
solver = "dem"
{GLASS}[grains.wall.floor]
mesh = "floor.stl"
material = "glass"
[[grains.insert]]
material = "glass"
particles = [{{ at = [0.11, 0.06, 0.04], diameter = 0.04, velocity = [0, 0, -1] }}]
"""
NO_ROLLING = ('rolling = "constant_torque"\n', ""), ("rolling_friction = 0.05\n", "")


class Liggghts(unittest.TestCase):
    def setUp(self):
        self.case = CaseFolder(self, BIN)
        (self.case.path / "floor.stl").write_text(floor(0.3))

    def run_it(self, text, *changes, results, code=0):
        done = self.case.run("run", self.case.write(text, *changes), "--results", results)
        self.assertEqual(done.returncode, code, done.stdout + done.stderr)
        return done.stdout + done.stderr

    def record(self, results):
        return h5py.File(self.case.path / results / "interface.h5")

    def series(self, results, name):
        with self.record(results) as record:
            return record[f"quantities/grains.{name}"][...]

    # --- what it computes ---------------------------------------------------------------------------------------------
    @unittest.skipUnless((BIN / "acopla-fem").exists(), "built without deal.II")
    def test_the_box_carries_the_weight_on_one_process_and_on_two(self):
        make_small_box(self.case.path)
        for name, change in (("one", ONE), ("two", TWO)):
            with self.subTest(name):
                self.run_it(SMALL_BOX, change, results=name)
                summary = self.case.summary(name)
                self.assertEqual(summary["status"], "met")
                self.assertLess(summary["ledgers"]["force_loss"], 1e-12)
                self.assertLess(summary["ledgers"]["moment_loss"], 1e-12)
                self.assertEqual(summary["participants"]["grains"]["solver"], "liggghts")
                self.assertAlmostEqual(self.case.quantities(name)["structure.reaction.z"], WEIGHT, delta=1e-4 * WEIGHT)  # at rest to 1e-8 J
                # Means over windows leave no impulse out: all of them together held the weight for the whole second, but for what the
                # spheres still have: at most sqrt(2 m E).
                force, energy = self.series(name, "box.force.z"), self.series(name, "kinetic_energy")[-1]
                self.assertAlmostEqual(-force.sum() * 0.05, WEIGHT * 1.0, delta=(2 * WEIGHT / 9.81 * energy) ** 0.5 + 1e-9)

    def test_vertex_forces_have_the_force_and_the_moment_of_the_contacts(self):
        for name, change in (("one", ONE), ("two", TWO)):
            many = ("particles = [{ at = [0.11, 0.06, 0.04], diameter = 0.04, velocity = [0, 0, -1] }]",
                    "diameter = 0.02\ncount = 60\nvelocity = [0.3, -0.2, 0]\nspin = [5, 0, 9]\nregion = { box = [[0.1, 0.1, 0], [0.2, 0.2, 0.1]] }")
            self.run_it(BOUNCE, change, many, results=name)
            with self.record(name) as record:
                points, force = record["grains.floor/points"][...], record["grains.floor/force"][...]
            moment = numpy.cross(points - points.mean(axis=0), force).sum(axis=1)
            size = abs(force).max()
            self.assertGreater(size, 0)
            for k, axis in enumerate("xyz"):
                # Sums of the same numbers in another order.
                self.assertLess(abs(force[:, :, k].sum(axis=1) - self.series(name, f"floor.force.{axis}")).max(), 1e-12 * size)
                self.assertLess(abs(moment[:, k] - self.series(name, f"floor.torque.{axis}")).max(), 1e-12 * size)
            self.assertGreater(abs(self.series(name, "floor.torque.z")).max(), 1e-6)  # friction and spin were there

    def test_a_sphere_falls_and_rebounds_as_in_acopla_dem(self):
        """The laws are the same but for the springs of friction and the force that rolling resistance is a share of: head on both
        converge to one trajectory."""
        difference = []
        for fraction in (0.05, 0.025, 0.0125):
            step = "\nstep_fraction = "
            for name, solver in (("dem", "dem"), ("liggghts", "liggghts")):
                self.run_it(BOUNCE, *NO_ROLLING, ("-9.81", "0"), ('solver = "dem"', f'solver = "{solver}"{step}{fraction}'), results=f"{name}{fraction}")
            one, other = (self.series(f"{name}{fraction}", "kinetic_energy") for name in ("dem", "liggghts"))
            difference.append(abs(one - other).max() / one.max())
        # Both take dashpots at the velocity of half a step before, one of them extrapolates it: of first order, but for the phase of the
        # step at the impact.
        self.assertLess(difference[2], 0.01)
        self.assertLess(difference[2], 0.4 * difference[0])
        # And it is the restitution that was asked for: 0.3.
        energy = self.series("liggghts0.0125", "kinetic_energy")
        self.assertAlmostEqual((energy[-1] / energy[0]) ** 0.5, 0.3, delta=0.003)

    def test_planes_carry_the_weight_as_meshes_do(self):
        # Between two planes beside it and on one below, with a name that LIGGGHTS would not take.
        mesh = '[grains.wall.floor]\nmesh = "floor.stl"\nmaterial = "glass"'
        planes = "".join(f'[grains.wall.{name}]\nplane = {{ point = {point}, normal = {normal} }}\nmaterial = "glass"\n' for name, point, normal in
                         (("left-side", "[0.09, 0, 0]", "[1, 0, 0]"), ("right-side", "[0.13, 0, 0]", "[-1, 0, 0]"), ("below", "[0, 0, -0.01]", "[0, 0, 1]")))
        self.run_it(BOUNCE, TWO, (mesh, planes), ('[[coupling.interface]]\nfrom = "grains.floor"\n', ""), ("end = 0.2", "end = 0.6"), results="out")
        weight = self.series("out", "weight")[-1]
        self.assertAlmostEqual(self.series("out", "below.force.z")[-20:].mean(), -weight, delta=1e-3 * weight)
        self.assertEqual(self.series("out", "particles")[-1], 1)

    def test_windows_may_be_so_many_of_its_steps(self):
        self.run_it(BOUNCE, ONE, ("window = 0.002", 'window = "steps:10"'), ("end = 0.2", "end = 0.02"), results="out")
        summary = self.case.summary()
        self.assertEqual(summary["participants"]["grains"]["steps"], 10 * summary["time"]["windows"])

    def test_the_linear_law_is_the_same_too(self):
        linear = [('normal = "hertz"', 'normal = { law = "linear", stiffness = 2e4 }'), ('tangential = "mindlin"', 'tangential = { law = "linear_slider", ratio = 3.5 }'),
                  *NO_ROLLING, ("velocity = [0, 0, -1]", "velocity = [0.4, 0, -1], spin = [0, 0, 3]")]
        for solver in ("dem", "liggghts"):
            self.run_it(BOUNCE, *linear, ('solver = "dem"', f'solver = "{solver}"\nstep_fraction = 0.02'), results=solver)
        one, other = (self.series(name, "kinetic_energy") for name in ("dem", "liggghts"))
        self.assertLess(abs(one - other).max(), 0.02 * one.max())
        sideways = [self.series(name, "floor.force.x").sum() for name in ("dem", "liggghts")]
        self.assertLess(abs(sideways[0] - sideways[1]), 0.02 * abs(sideways[0]))
        self.assertGreater(sideways[0], 0)

    def test_it_keeps_the_rules(self):
        for name, change in (("one", ONE), ("two", TWO)):
            with self.subTest(name):
                done = self.case.run("conformance", "--case", self.case.write(BOUNCE, change), "--as", "grains", "--quick", timeout=240)
                self.assertEqual(done.returncode, 0, done.stdout + done.stderr)
                broken = {line.split()[1] for line in done.stdout.splitlines() if re.match("  (BROKEN|-) ", line)}
                self.assertEqual(broken, {"restore", "restore-again", "checkpoint", "busy-pings", "not-finite", "wrong-points", "wrong-bytes", "silence"})

    # --- what the user is told ----------------------------------------------------------------------------------------
    def test_what_liggghts_cannot_do_alike_is_refused_where_it_stands(self):
        wall = '[grains.wall.floor]\nmesh = "floor.stl"'
        for old, new, words in (
                ('rolling = "constant_torque"', 'rolling = "elastic_plastic"', r"grains\.contact has the law elastic_plastic, which LIGGGHTS has not"),
                ("restitution = 0.3", "restitution = 0.1", r"grains\.contact has restitution = 0\.1\. The dashpot"),
                (wall, wall + '\nmotion = { kind = "translation", velocity = [1, 0, 0] }', r"grains\.wall\.floor\.motion is not handed"),
                (wall, wall + "\nglued = { diameter = 0.01 }", r"grains\.wall\.floor\.glued particles"),
                (wall, '[grains.wall.side]\nplane = { point = [0, 0, 0], normal = [1, 1, 0] }\nmaterial = "glass"\n' + wall, r"grains\.wall\.side\.plane is oblique"),
                ('solver = "liggghts"', 'solver = "liggghts"\nthreads = 2', r"grains\.threads .* processes = 2"),
                ('solver = "liggghts"', 'solver = "liggghts"\nenergy = true', r"grains\.energy keeps the energy ledger"),
                ('solver = "liggghts"', 'solver = "liggghts"\nprocesses = 0', r"grains\.processes")):
            with self.subTest(new):
                done = self.case.run("check", self.case.write(BOUNCE, ONE, (old, new)))
                self.assertEqual(done.returncode, 2, done.stdout)
                self.assertRegex(done.stderr, r"case\.toml:\d+:\d+: " + words)

    def test_walls_stand_so_two_ways_are_refused(self):
        plate = '[[coupling.interface]]\nfrom = "grains.floor"\nto = "plate.top"\n[plate]\ncommand = ["/usr/bin/python3", "plate.py"]\n'
        (self.case.path / "plate.py").write_text(
            "import acopla\nclass Plate(acopla.Participant):\n    def start(self, run):\n"
            "        return [acopla.Surface('top', [(0, 0, 0), (.3, 0, 0), (.3, .3, 0), (0, .3, 0)], [(0, 1, 2, 3)])]\nacopla.serve(Plate())\n")
        said = self.run_it(BOUNCE, ONE, ("one-way", "explicit"), ('[[coupling.interface]]\nfrom = "grains.floor"\n', plate), results="out", code=2)
        self.assertIn("walls of solver = \"liggghts\" stand", said)

    def test_its_errors_reach_the_user_in_its_own_words(self):
        corners = [(0, 0, 0), (0.3, 0, 0), (0.3, 0.3, 0)]
        (self.case.path / "floor.stl").write_text(stl(corners, corners))
        for name, change in (("one", ONE), ("two", TWO)):
            said = self.run_it(BOUNCE, change, results=name, code=1)
            self.assertIn("grains (acopla-liggghts) failed while starting: LIGGGHTS: Fix mesh: Bad mesh, cannot continue.", said)

    def test_particles_that_leave_are_counted(self):
        away = ("at = [0.11, 0.06, 0.04]", "at = [-0.11, 0.06, 0.04]")
        for name, change in (("one", ONE), ("two", TWO)):
            said = self.run_it(BOUNCE, change, away, ("end = 0.2", "end = 1.0"), results=name, code=1)
            self.assertRegex(said, r"1 of 1 particles left the domain before t = 0\.\d+ s\. Close the walls")

    def test_a_process_that_is_killed_ends_the_run(self):
        case = self.case.write(BOUNCE, TWO, ("end = 0.2", "end = 1000.0"))
        for victim in (0, 1):
            with self.subTest(victim=victim):
                run = self.case.start("run", case, "--results", f"out{victim}", stdout=-1, stderr=-1)
                record = self.case.path / f"out{victim}/interface.h5"
                deadline = time.time() + 30
                while not (record.exists() and record.stat().st_size > 20_000) and time.time() < deadline:
                    time.sleep(0.02)
                own = [pid for pid in map(int, filter(str.isdigit, os.listdir("/proc"))) if self.is_rank(pid)]
                self.assertEqual(len(own), 2)
                os.kill(sorted(own)[victim], signal.SIGKILL)
                begin = time.time()
                out, err = run.communicate(timeout=30)
                self.assertLess(time.time() - begin, 2 + float(os.environ.get("ACOPLA_TEST_SLACK", "3")))
                self.assertEqual(run.returncode, 1)
                self.assertIn("grains (acopla-liggghts) ended with exit code", err)
                self.assertEqual(self.case.summary(f"out{victim}")["status"], "failed")

    def is_rank(self, pid):
        try:
            words = pathlib.Path(f"/proc/{pid}/cmdline").read_bytes().split(b"\0")
        except OSError:
            return False
        return words[0].endswith(b"acopla-liggghts") and any(str(self.case.path).encode() in word for word in words)


if __name__ == "__main__":
    unittest.main(verbosity=1)
