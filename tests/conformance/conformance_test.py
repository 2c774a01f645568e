#!/usr/bin/env python3
"""`acopla conformance` on participants that keep the protocol, and on ones that break one rule each and are told which.

Usage: conformance_test.py FOLDER_OF_EXECUTABLES SOURCE_FOLDER [test names]
"""
import concurrent.futures
import os
import pathlib
import re
import subprocess
import sys
import unittest

BIN, SOURCE = os.path.abspath(sys.argv[1]), pathlib.Path(sys.argv[2]).resolve()
sys.path.insert(0, str(SOURCE / "tests/end_to_end"))
from case_runner import CaseFolder  # noqa: E402
from sample_cases import GLASS, floor  # noqa: E402

BROKEN, EXAMPLES = SOURCE / "tests/conformance/broken.py", SOURCE / "docs/examples/python"

# fault: (rule, sentence). The sentence is the whole of what the kit says.
FAULTS = {
    "hello-never": ("hello", "did not send hello within 2 s"),
    "hello-dies": ("hello", "ended with exit code 7 where hello was expected; its last words: I could not"),
    "hello-late": ("hello", "sent interface where hello was expected"),
    "hello-name": ("hello", 'says hello as "nobody", and its name is "participant" (ACOPLA_PARTICIPANT)'),
    "hello-lacks": ("hello", 'sent a message that cannot be used: hello lacks "capabilities"'),
    "version": ("version", "speaks versions 2 to 3, not 1"),
    "dimension": ("dimension", "works in 2 dimensions, the case has 3"),
    "interface-name": ("interface", 'does not offer the surface "top", which is coupled'),
    "interface-shape": ("interface", "sent a message that cannot be used: array points on top must have the shape [points, 3]"),
    "interface-nan": ("interface", "sent a message that cannot be used: points on top is not finite at point 1"),
    "interface-nodes": ("interface", None),
    "interface-faceless": ("interface", "offers top without faces, though it receives forces there: they could not be mapped"),
    "pulse-never": ("pulse", "never reported to the pulse whose address is in welcome"),
    "pulse-name": ("pulse", 'reports to the pulse as "nobody", and its name is "participant"'),
    "pulse-once": ("idle-pings", "did not answer pings for more than 1.5 s while it waited for a request. Answer them from a thread and a socket of its own"),
    "busy": ("busy-pings", "did not answer pings for more than 1.5 s while it computed. Answer them from a thread and a socket of its own"),
    "order": ("order", "sent done without being asked"),
    "zero": ("zero-fields", "answered advance by an error: float division by zero"),
    "slow": ("zero-fields", "did not send an answer to advance within 2.5 s"),
    "fields-missing": ("fields", "did not send velocity on top"),
    "fields-nan": ("fields", "sent a message that cannot be used: velocity on top is not finite at point 0"),
    "fields-points": ("fields", "sent displacement on top with 2 values for 3 points"),
    "fields-surface": ("fields", "sent velocity on side, a surface it never offered"),
    "fields-kind": ("zero-fields", "answered advance by done, not advanced"),
    "sequence": ("sequence", "gave its answer to advance the number 2, the request's is 1"),
    "windows": ("windows", "answered advance by an error: one window is enough"),
    "unknown-keys": ("unknown-keys", "answered advance by an error: there is a key I do not know"),
    "unsupported-done": ("unsupported", "answered save by done, though it does not offer it"),
    "unsupported-fault": ("unsupported", "answered save by an error without `unsupported`, which ends a run"),
    "restore": ("restore", "computed a window otherwise after restore: displacement on top differs at point 0: …"),
    "restore-once": ("restore-again", "computed a window otherwise after other fields and a second restore: displacement on top differs at point 0: …"),
    "save-once": ("restore-again", "did not return to the second save but elsewhere: displacement on top differs at point 0: …"),
    "resume": ("checkpoint", "computed the window after resume otherwise: displacement on top differs at point 0: …"),
    "finish": ("finish", "answered finish by advanced, not done"),
    "exit-code": ("exit", "ended with exit code 3 after finish"),
    "exit-never": ("exit", "did not end within 2 s after finish"),
    "before-welcome": ("before-welcome", "ended with exit code 1 where an error after finish before welcome was expected; its last words: KeyError: 'pulse'"),
    "out-of-turn": ("out-of-turn", "did not send an error after an interface from the coupler within 2.5 s"),
    "no-words": ("out-of-turn", "sent an error without a text after an interface from the coupler"),
    "error-code": ("out-of-turn", "ended with exit code 0 after an interface from the coupler and its error; the exit code should tell that it failed"),
    "error-unsupported": ("out-of-turn", "called an interface from the coupler unsupported, as if it were a request; it is a fault"),
    "not-finite": ("not-finite", "sent advanced after a field with a NaN, not error"),
    "wrong-points": ("wrong-points", "sent advanced after a field with a point too many, not error"),
    "malformed": ("malformed", "was killed by signal 11 (Segmentation fault) where an error after bytes that are no message was expected"),
    "wrong-bytes": ("wrong-bytes", "sent advanced after an array that is shorter than its shape, not error"),
    "other-version": ("other-version", "sent advanced after a request of version 2, not error"),
    "memory-blind": ("shared-memory", "answered advance by an error: the header names 2 arrays, 0 frames follow"),
    "memory-place": ("shared-memory", "computed a window otherwise from arrays in shared memory: displacement on top differs at point 0: …"),
    "refusal": ("refusal", "did not end within 2 s after it was refused"),
    "end-of-run": ("end-of-run", "sent error after the coupler said error"),
    "silence": ("silence", "did not end within 15 s after the last ping"),
}

DEM = f"""title = "spheres"
dimension = 3
gravity = [0, 0, -9.81]
end = 1.0
[coupling]
scheme = "implicit"
window = 0.01
max_distance = 0.02
[[coupling.interface]]
from = "grains.floor"
to = "structure.top"
[grains]
solver = "dem"
{GLASS}[grains.wall.floor]
mesh = "floor.stl"
material = "glass"
[[grains.insert]]
material = "glass"
diameter = 0.04
count = 20
region = {{ box = [[0, 0, 0], [0.3, 0.3, 0.3]] }}
[structure]
solver = "fem"
mesh = {{ plate = {{ size = [0.3, 0.3, 0.02], cells = [3, 3, 1] }} }}
analysis = "dynamic"
[structure.material]
young = 1e7
poisson = 0.3
density = 1000
[structure.fix.edges]
"""


def examine(arguments, command=(), **options):
    words = [f"{BIN}/acopla", "conformance", *arguments] + (["--", *command] if command else [])
    done = subprocess.run(words, capture_output=True, text=True, timeout=240, **options)
    lines = {}
    for line in done.stdout.splitlines():
        if match := re.match(r"  (kept|BROKEN|-) +([\w-]+) +§\d  (.*)", line):
            lines[match[2]] = (match[1], match[3])
    return done, lines


def examine_fault(fault):
    command = ["/usr/bin/python3", str(BROKEN)] + ([fault] if fault else [])
    quick = [] if fault in ("silence", "") else ["--quick"]
    return examine(["--use", "top:force:displacement,velocity", "--start-limit", "2" if fault == "hello-never" else "20", "--answer-limit", "2.5", "--exit-limit", "2", *quick],
                   command)


class Conformance(unittest.TestCase):
    maxDiff = None

    def assert_kept(self, result, but=()):
        done, lines = result
        self.assertEqual(done.returncode, 0, done.stdout + done.stderr)
        self.assertEqual({rule for rule, (verdict, _) in lines.items() if verdict != "kept"}, set(but), done.stdout)

    def test_who_keeps_all_passes(self):
        self.assert_kept(examine_fault(""), but={"unsupported", "busy-pings"})

    def test_each_fault_breaks_its_rule_and_is_told_so(self):
        with concurrent.futures.ThreadPoolExecutor(10) as pool:  # they wait more than they compute
            results = dict(zip(FAULTS, pool.map(examine_fault, FAULTS)))
        for fault, (rule, sentence) in FAULTS.items():
            with self.subTest(fault):
                done, lines = results[fault]
                broken = {name: text for name, (verdict, text) in lines.items() if verdict == "BROKEN"}
                self.assertEqual(done.returncode, 3, done.stdout + done.stderr)
                self.assertEqual(set(broken), {rule}, done.stdout)
                if sentence and sentence.endswith("…"):
                    self.assertTrue(broken[rule].startswith(sentence[:-1]), broken[rule])
                elif sentence:
                    self.assertEqual(broken[rule], sentence)

    def test_every_rule_has_a_fault(self):
        listed = subprocess.run([f"{BIN}/acopla", "conformance", "--list"], capture_output=True, text=True).stdout.splitlines()
        self.assertEqual({line.split()[0] for line in listed}, {rule for rule, _ in FAULTS.values()})

    def test_the_examples_in_python_pass(self):
        folder = CaseFolder(self, BIN, EXAMPLES.glob("*.py"))
        case = """title = "examples"
dimension = 3
end = 1.0
[coupling]
scheme = "implicit"
window = 0.01
max_distance = 0.02
[[coupling.interface]]
from = "left.end"
to = "right.end"
[[coupling.interface]]
from = "left.end2"
to = "plate.top"
[[coupling.interface]]
from = "left.end3"
to = "membrane.skin"
[left]
command = ["/usr/bin/python3", "oscillator_half.py"]
[right]
command = ["/usr/bin/python3", "oscillator_half.py"]
[plate]
command = ["/usr/bin/python3", "plate.py"]
mass = 2.0
spring = 800.0
[membrane]
command = ["/usr/bin/python3", "membrane.py"]
tension = 100.0
density = 0.5
"""
        folder.write(case)
        # The half that sends forces has one surface: a case of its own.
        folder.write(re.sub(r'\[\[coupling.interface\]\]\nfrom = "left.end[23]"\nto = .*\n', "", case), name="two.toml")
        for file, name in (("two.toml", "left"), ("two.toml", "right"), ("case.toml", "plate"), ("case.toml", "membrane")):
            with self.subTest(name):
                self.assert_kept(examine(["--case", folder.path / file, "--as", name, "--quick"]), but={"checkpoint", "busy-pings", "shared-memory", "silence"})

    def test_the_solvers_pass(self):
        folder = CaseFolder(self, BIN)
        folder.write(floor(0.3), name="floor.stl")
        case = folder.write(DEM)
        for solver, name in (("dem", "grains"), ("fem", "structure")):
            if not os.path.exists(f"{BIN}/acopla-{solver}"):
                continue  # a build without deal.II
            with self.subTest(solver):
                self.assert_kept(examine(["--case", case, "--as", name]), but={"unsupported", "busy-pings"})

    def test_mistakes_on_the_command_line_are_told(self):
        for arguments, command, sentence in (
                ([], [], "nothing to examine: write the command after --"),
                (["--use", "top"], ["true"], "--use top is not SURFACE:RECEIVES:SENDS"),
                ([], ["no_such_program"], 'names "no_such_program", which is not a program')):
            done, _ = examine(arguments, command)
            self.assertEqual(done.returncode, 2)
            self.assertIn(sentence, done.stderr)


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1] + sys.argv[3:])
