#!/usr/bin/env python3
"""The plate in C (docs/examples/c) in the place of the plate in Python: the same motion, and every rule of the protocol kept.

Usage: c_plate_test.py FOLDER_OF_EXECUTABLES SOURCE_FOLDER PLATE
"""
import json
import os
import pathlib
import subprocess
import sys
import unittest

BIN, SOURCE, PLATE = os.path.abspath(sys.argv[1]), pathlib.Path(sys.argv[2]).resolve(), os.path.abspath(sys.argv[3])
sys.path.insert(0, str(SOURCE / "tests/end_to_end"))
from case_runner import CaseFolder  # noqa: E402
from sample_cases import PLATE as CASE  # noqa: E402


class PlateInC(unittest.TestCase):
    def run_plate(self, *command):
        case = CaseFolder(self, BIN)
        done = case.run("run", case.write(CASE.format(programs=BIN, send="", command=json.dumps(command))), "--results", "out")
        self.assertEqual(done.returncode, 0, done.stderr)
        return case.quantities()

    def test_it_moves_as_the_plate_in_python(self):
        c, python = self.run_plate(PLATE, "2.0", "800.0", "8.0"), self.run_plate("/usr/bin/python3", str(SOURCE / "docs/examples/python/plate.py"))
        for name, theirs in python.items():
            mine = c[name]
            self.assertNotEqual(mine, 0)
            # The same formula through two libraries' complex sines: some ulps a window, 20 windows.
            self.assertAlmostEqual(mine, theirs, delta=1e-13 * abs(theirs))

    def test_it_keeps_the_rules(self):
        done = subprocess.run([f"{BIN}/acopla", "conformance", "--quick", "--use", "top:force:displacement,velocity", "--", PLATE, "2", "800", "8"],
                              capture_output=True, text=True, timeout=120)
        self.assertEqual(done.returncode, 0, done.stdout)
        self.assertIn("kept    restore-again", done.stdout)

    def test_the_library_shows_nothing_but_the_interface(self):
        library = pathlib.Path(PLATE).parent.parent / "prefix/lib/libacopla-participant.so"
        shown = subprocess.run(["nm", "-D", "--defined-only", str(library)], capture_output=True, text=True, check=True).stdout.splitlines()
        self.assertGreater(len(shown), 20)
        self.assertEqual([line for line in shown if not line.split()[2].startswith("acopla_")], [])

    def test_without_a_run_it_says_so(self):
        environment = {key: value for key, value in os.environ.items() if not key.startswith("ACOPLA")}
        done = subprocess.run([PLATE, "2", "800", "8"], capture_output=True, text=True, env=environment)
        self.assertEqual(done.returncode, 1)
        self.assertIn("no address: ACOPLA_ENDPOINT is not set. This program is started by `acopla run`", done.stderr)


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1])
