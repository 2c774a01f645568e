#!/usr/bin/python3
"""The real programs on a box with 50 spheres: small_box.py BIN. What a user gets, and what he is told when it goes wrong."""
import os
import pathlib
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import unittest
import unittest.mock

from case_runner import CaseFolder
from sample_cases import SMALL_BOX, WEIGHT, make_small_box

BIN = pathlib.Path(sys.argv.pop(1)).resolve()


class SmallBox(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.meshes = pathlib.Path(tempfile.mkdtemp(prefix="acopla-test-"))
        make_small_box(cls.meshes)

    @classmethod
    def tearDownClass(cls):
        shutil.rmtree(cls.meshes)

    def setUp(self):
        self.case = CaseFolder(self, BIN, self.meshes.iterdir())
        self.folder, self.summary = self.case.path, self.case.summary

    def write(self, *changes, text=SMALL_BOX):
        return self.case.write(text, *changes)

    def acopla(self, *arguments, program="acopla"):
        done = self.case.run(*arguments, program=program)
        return done.returncode, done.stdout + done.stderr

    # --- what a user gets ---------------------------------------------------------------------------------------------
    def test_run_balances_the_weight_and_leaves_results(self):
        code, text = self.acopla("run", self.write(), "--results", "out")
        self.assertEqual(code, 0, text)
        summary = self.summary()
        self.assertEqual(summary["status"], "met")
        # One interface, matching planes: nothing may be lost but round-off.
        self.assertLess(summary["ledgers"]["force_loss"], 1e-14)
        self.assertLess(summary["ledgers"]["moment_loss"], 1e-14)
        for name in ("interface.h5", "grains/grains.pvd", "structure/structure.pvd", "grains.box.pvd", "log/grains.log", "log/structure.log",
                     "log/coupler.log"):
            self.assertTrue((self.folder / "out" / name).exists(), name)
        for about in summary["participants"].values():
            self.assertGreater(about["peak_bytes"], 1e6)

    def test_replay_gives_the_structure_bitwise_the_same_load(self):
        import h5py
        case = self.write()
        self.assertEqual(self.acopla("run", case, "--results", "out")[0], 0)
        code, text = self.acopla("replay", "out/interface.h5", case, "--results", "again")
        self.assertEqual(code, 0, text)
        with h5py.File(self.folder / "out/interface.h5") as first, h5py.File(self.folder / "again/interface.h5") as second:
            self.assertTrue((first["structure.inside/force"][...] == second["structure.inside/force"][...]).all())
            # The structure's own arithmetic runs on threads: equal to round-off.
            a, b = first["quantities/structure.reaction.z"][...], second["quantities/structure.reaction.z"][...]
            self.assertLess(abs(a - b).max(), 1e-12 * abs(a).max())

    def test_a_run_that_was_killed_is_resumed_bit_by_bit(self):
        import h5py
        # One thread each: a structure's sums on several threads agree to round-off only.
        alone = {"OPENBLAS_NUM_THREADS": "1", "DEAL_II_NUM_THREADS": "1"}
        case = self.write(('scheme = "one-way"\nwindow = 0.05', 'scheme = "explicit"\nwindow = 1e-4\ncheckpoint_every = 0.03\noutput_every = 0.05'), ("end = 1.0", "end = 0.15"),
                          ('mesh = "box.msh"', 'mesh = "box.msh"\nanalysis = "dynamic"\nrayleigh = { mass = 10 }\noutput = { every = 0.05 }'),
                          ("young = 2.1e11", "young = 1e8\ndensity = 8000"),
                          text=SMALL_BOX[:SMALL_BOX.index("[expect]")])
        with unittest.mock.patch.dict(os.environ, alone):
            code, text = self.acopla("run", case, "--results", "whole")
            self.assertEqual(code, 0, text)
            process = self.case.start("run", case, "--results", "killed", stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
            deadline = time.time() + 60
            while not (self.folder / "killed/checkpoint/coupler.h5").exists() and time.time() < deadline:
                time.sleep(0.01)
            time.sleep(0.02)  # into the windows that will be computed again
            process.kill()
            process.wait()
            code, text = self.acopla("run", case, "--resume", "killed")
        self.assertEqual(code, 0, text)
        compared = []
        with h5py.File(self.folder / "whole/interface.h5") as whole, h5py.File(self.folder / "killed/interface.h5") as resumed:
            def compare(name, data):
                if isinstance(data, h5py.Dataset):
                    self.assertEqual(data[...].tobytes(), resumed[name][...].tobytes(), name)
                    compared.append(name)
            whole.visititems(compare)
        self.assertIn("structure.inside/force", compared)
        for series in ("grains.box.pvd", "structure/structure.pvd", "grains/grains.pvd"):
            self.assertEqual((self.folder / "whole" / series).read_text(), (self.folder / "killed" / series).read_text(), series)

    def test_first_line_comes_at_once(self):
        process = self.case.start("run", self.write(), "--results", "out", stdout=subprocess.PIPE)
        begin = time.time()
        line = process.stdout.readline()
        waited = time.time() - begin
        process.stdout.read()
        process.wait()
        process.stdout.close()
        self.assertIn("small box", line)
        self.assertLess(waited, 0.3)

    def test_explain_says_what_is_needed_and_how_long_it_takes(self):
        case = self.write(("end = 1.0", "end = 12.0"), ("count = 50", "count = 120"), ("0.3, 0.3, 0.3]]", "0.3, 0.3, 0.8]]"), (f"{WEIGHT:.9g}", f"{2.4 * WEIGHT:.9g}"))
        for attempt in range(3):  # other work on the machine may slow either measurement
            code, text = self.acopla("explain", case)
            self.assertEqual(code, 0, text)
            for words in ("bytes a particle", "bytes a contact", "critical step", "left out", "restitution", "expected run time"):
                self.assertIn(words, text)
            expected = float(re.search(r"expected run time +(\S+) s", text).group(1))
            code, text = self.acopla(case, "--results", f"alone{attempt}", program="acopla-dem")
            self.assertEqual(code, 0, text)
            taken = float(re.search(r"seconds.steps +(\S+)", text).group(1))
            if 0.5 < taken / expected < 2:
                return
        self.fail(f"expected {expected} s, took {taken} s")

    def test_solvers_run_alone(self):
        case = self.write(("end = 1.0", "end = 0.1"))
        code, text = self.acopla(case, "--results", "dem", program="acopla-dem")
        self.assertEqual(code, 0, text)
        self.assertIn("box.force.z", text)
        code, text = self.acopla(case, "--results", "fem", program="acopla-fem")
        self.assertEqual(code, 0, text)
        self.assertIn("reaction.z", text)

    # --- what he is told when it goes wrong ---------------------------------------------------------------------------
    def test_mistakes_are_located_and_say_how_to_mend_them(self):
        far = self.folder / "far.stl"
        stl = bytearray((self.folder / "box.stl").read_bytes())
        import struct
        for k in range((len(stl) - 84) // 50):
            for v in range(3):
                at = 84 + 50 * k + 12 + 12 * v + 8
                struct.pack_into("<f", stl, at, struct.unpack_from("<f", stl, at)[0] + 1)
        far.write_bytes(stl)
        (self.folder / "cut.stl").write_bytes((self.folder / "box.stl").read_bytes()[:500])
        (self.folder / "empty.stl").write_bytes(b"")
        mistakes = [
            (("friction = 0.5", "fricton = 0.5"), r"case\.toml:\d+:\d+: .*friction"),
            (("young = 2.1e11", "yong = 2.1e11"), r"case\.toml:\d+:\d+: .*young"),
            (("window = 0.05", "windw = 0.05"), r"case\.toml:\d+:\d+: .*window"),
            (("[structure.fix.base]", "[structure.fix.bas]"), r"case\.toml:\d+:\d+: .*base"),
            (("structure.inside", "structure.insid"), r"case\.toml:\d+:\d+: .*inside"),
            (("grains.box", "grain.box"), r"case\.toml:\d+:\d+: .*grains"),
            (("box.stl", "cut.stl"), r"cut\.stl.*cut short"),
            (("box.stl", "empty.stl"), r"empty\.stl.*empty"),
            (("box.stl", "far.stl"), r"case\.toml:\d+:\d+: .*max_distance"),
            (("count = 50", "count = 5000"), r"case\.toml:\d+:\d+: .*Enlarge the region"),
            (("box.msh", "nothing.msh"), r"case\.toml:\d+:\d+: .*nothing\.msh"),
            (("window = 0.05", "window = 0.03"), r"case\.toml:\d+:\d+: .*whole number"),
            (("young = 2.1e11", "young = nan"), r"case\.toml:\d+:\d+: .*finite"),
        ]
        for k, (change, expected) in enumerate(mistakes):
            with self.subTest(change=change[1]):
                begin = time.time()
                code, text = self.acopla("run", self.write(change), "--results", f"out{k}")
                self.assertEqual(code, 2, text)
                self.assertRegex(text, expected)
                self.assertLess(time.time() - begin, 10)

    def test_check_finds_mistakes_without_running(self):
        code, text = self.acopla("check", self.write())
        self.assertEqual(code, 0, text)
        code, text = self.acopla("check", self.write(("poisson = 0.25", "poisson = 0.6")))
        self.assertEqual(code, 2, text)
        self.assertRegex(text, r"case\.toml:17:1: grains\.material\.glass\.poisson = 0\.6 is outside")

    def test_existing_results_are_never_overwritten(self):
        (self.folder / "out").mkdir()
        code, text = self.acopla("run", self.write(), "--results", "out")
        self.assertEqual(code, 2)
        self.assertIn("never overwritten", text)
        self.assertEqual(list((self.folder / "out").iterdir()), [])

    def test_missed_expectation_is_3(self):
        code, text = self.acopla("run", self.write((f"{WEIGHT:.9g}", "1.0"), ("end = 1.0", "end = 0.2")), "--results", "out")
        self.assertEqual(code, 3, text)
        self.assertEqual(self.summary()["status"], "missed")

    def test_unstable_step_is_refused_and_a_wild_run_is_stopped(self):
        code, text = self.acopla("run", self.write(('solver = "dem"', 'solver = "dem"\nstep = 0.01')), "--results", "out1")
        self.assertEqual(code, 2, text)
        self.assertIn("above the critical step", text)
        code, text = self.acopla("run", self.write(('solver = "dem"', 'solver = "dem"\nstep = 0.01\nallow_unstable_step = true')), "--results", "out2")
        self.assertEqual(code, 1, text)
        self.assertRegex(text, r"particle \d+")

    def start(self):
        case = self.write(("end = 1.0", "end = 100.0"))
        process = self.case.start("run", case, "--results", "out", stdout=subprocess.PIPE, stderr=subprocess.STDOUT)
        deadline = time.time() + 20
        while time.time() < deadline:  # until some windows are through
            time.sleep(0.1)
            log = self.folder / "out" / "interface.h5"
            if log.exists() and log.stat().st_size > 200_000:
                return process
        process.kill()
        self.fail("the run did not get going")

    def pid(self, program):
        return int(subprocess.run(["pgrep", "-f", f"{program} .*{self.folder}"], capture_output=True, text=True).stdout.split()[0])

    def finish(self, process, limit):
        begin = time.time()
        text = process.communicate(timeout=20)[0]
        self.assertLess(time.time() - begin, limit, text)
        return process.returncode, text

    def test_each_process_that_dies_or_freezes_is_named(self):
        import h5py
        for program, name in (("acopla-dem", "grains"), ("acopla-fem", "structure"), ("acopla-coupler", "coupler")):
            for sign in (signal.SIGKILL, signal.SIGSTOP):
                with self.subTest(program=program, signal=sign.name):
                    shutil.rmtree(self.folder / "out", ignore_errors=True)
                    process = self.start()
                    os.kill(self.pid(program), sign)
                    code, text = self.finish(process, 4)
                    self.assertEqual(code, 1, text)
                    self.assertIn(name, text)
                    self.assertEqual(self.summary()["status"], "failed")
                    if program != "acopla-coupler":
                        with h5py.File(self.folder / "out/interface.h5") as record:
                            self.assertGreater(record["windows"].shape[0], 0)

    def test_interrupt_keeps_what_there_is(self):
        process = self.start()
        process.send_signal(signal.SIGINT)
        code, text = self.finish(process, 4)
        self.assertEqual(code, 130, text)
        self.assertEqual(self.summary()["status"], "interrupted")


if __name__ == "__main__":
    unittest.main(verbosity=1)
