#!/usr/bin/env python3
"""Runs of `acopla run` with participants in Python: the examples of docs/examples/python against closed forms, and how they fail.

Usage: python_client_test.py FOLDER_OF_EXECUTABLES SOURCE_FOLDER [test names]
"""
import math
import os
import pathlib
import signal
import subprocess
import sys
import time
import unittest

BIN, SOURCE = os.path.abspath(sys.argv[1]), pathlib.Path(sys.argv[2]).resolve()
EXAMPLES = SOURCE / "docs/examples/python"
sys.path[:0] = [str(EXAMPLES), str(SOURCE / "protocol/python"), str(SOURCE / "tests/end_to_end")]
import acopla  # noqa: E402
import membrane  # noqa: E402
import numpy  # noqa: E402
import plate  # noqa: E402
from case_runner import CaseFolder  # noqa: E402
from sample_cases import PLATE  # noqa: E402

OSCILLATOR = """title = "two halves"
dimension = 3
end = {end}
[coupling]
window = {window}
max_distance = 0.1
{scheme}
[[coupling.interface]]
from = "{loader}.end"
to = "{structure}.end"
[left]
command = ["/usr/bin/python3", "oscillator_half.py"]
u = 1.0
[right]
command = ["/usr/bin/python3", "oscillator_half.py"]
[expect]
"left.u" = {{ value = 0, absolute = 1e9 }}
"right.u" = {{ value = 0, absolute = 1e9 }}
"""


class Run:
    """A run of `acopla run` in a folder that holds the examples and these scripts."""

    def __init__(self, test, case, scripts=()):
        self.case = CaseFolder(test, BIN, EXAMPLES.glob("*.py"))
        for name, text in scripts:
            (self.case.path / name).write_text(text)
        environment = {key: value for key, value in os.environ.items() if key != "PYTHONPATH"}
        self.process = self.case.start("run", self.case.write(case), "--results", "out", env=environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE)

    def end(self):
        self.out, self.err = self.process.communicate(timeout=60)
        self.code = self.process.returncode
        self.log = "".join(path.read_text() for path in sorted(self.case.path.glob("out/log/*")))
        return self


def known_force(window, points):
    """z component of tests/integration/stubs.h, summed over the points."""
    return sum(-1 - math.sin(0.1 * window + p) for p in range(points))


def exact_plate(m, k, c, h, forces):
    """m u'' + c u' + k u = F, piecewise constant, through the matrix exponential by its series in steps so small that it is exact."""
    a = numpy.array([[0, 1, 0], [-k / m, -c / m, 1 / m], [0, 0, 0]]) * h
    step, term = numpy.eye(3), numpy.eye(3)
    for n in range(1, 40):
        term = term @ a / n
        step = step + term
    state = numpy.zeros(3)
    for force in forces:
        state[2] = force
        state = step @ state
    return state


class Plate(unittest.TestCase):
    def run_plate(self, script="plate.py", keys="", send="", scripts=()):
        return Run(self, PLATE.format(programs=BIN, command=f'["/usr/bin/python3", "{script}"]\n{keys}', send=send), scripts)

    def failing(self, line):
        text = f"import acopla, plate\nclass Bad(plate.Plate):\n{line}\nacopla.serve(Bad(2.0, 800.0))\n"
        return self.run_plate("bad.py", scripts=[("bad.py", text)]).end()

    def test_a_plate_on_a_spring_moves_as_the_closed_form_under_the_senders_forces(self):
        run = self.run_plate().end()
        self.assertEqual(run.code, 0, run.err)
        u, v, _ = exact_plate(2.0, 800.0, 8.0, 0.05, [known_force(k, 64) for k in range(20)])
        found = run.case.quantities()
        # Both are exact for forces constant in a window; the mapping keeps the sum of forces to round-off.
        self.assertAlmostEqual(found["plate.u"], u, delta=1e-12 * abs(u))
        self.assertAlmostEqual(found["plate.v"], v, delta=1e-11 * abs(v))

    def test_every_damping_is_exact(self):
        for c in (0.0, 3.0, 80.0, 2 * math.sqrt(2.0 * 800.0), 400.0):  # none, little, critical, over-critical
            body = plate.Plate(2.0, 800.0, c)
            body.start(acopla.Run(0.05, 10, 1, numpy.zeros(3), "", []))
            for k in range(10):
                body.advance(acopla.Window(k, k + 1, 0.05 * k, 0.05), {("top", "force"): numpy.array([[0, 0, 1.0 + k]])})
            u, v, _ = exact_plate(2.0, 800.0, c, 0.05, [1.0 + k for k in range(10)])
            self.assertAlmostEqual(body.u, u, delta=1e-8 * abs(u))  # near critical damping the sine over its frequency loses half the digits
            self.assertAlmostEqual(body.v, v, delta=1e-8)

    def test_an_exception_reaches_the_user_with_its_words_and_state(self):
        run = self.failing("    def advance(self, window, received):\n        if window.start == 4: raise ArithmeticError('no convergence')\n"
                           "        return super().advance(window, received)")
        self.assertEqual(run.code, 1)
        self.assertIn("plate (python3) failed while advancing from 0.2 s to 0.25 s: no convergence", run.err)
        self.assertIn("ArithmeticError: no convergence", run.log)  # and the traceback is in its log

    def test_a_users_mistake_is_shown_as_it_is(self):
        run = self.failing("    def start(self, run):\n        raise acopla.UserMistake('case.toml:17:1: plate.mass = 0 makes no plate. Use more.')")
        self.assertEqual(run.code, 2)
        self.assertEqual(run.err.splitlines()[0], "case.toml:17:1: plate.mass = 0 makes no plate. Use more.")

    def test_fields_of_the_wrong_shape_or_not_finite_never_leave_the_process(self):
        run = self.failing("    def advance(self, window, received):\n        return {('top', 'displacement'): [(0, 0, 0)] * 3}")
        self.assertIn("displacement on top has the shape [3, 3], not [4, 3]", run.err)
        run = self.failing("    def advance(self, window, received):\n        return {('top', 'velocity'): [(0, 0, float('nan'))] * 4}")
        self.assertIn("velocity on top is not finite at point 0", run.err)
        run = self.failing("    def advance(self, window, received):\n        return {('side', 'velocity'): []}")
        self.assertIn("velocity is on side, a surface that was never offered", run.err)

    def test_a_script_that_leaves_without_a_word_is_named(self):
        run = self.failing("    def advance(self, window, received):\n        import os; os._exit(9)")
        self.assertEqual(run.code, 1)
        self.assertIn("plate (python3) ended with exit code 9 while advancing from 0 s to 0.05 s", run.err)

    def test_a_long_computation_keeps_its_pulse_and_a_stopped_process_does_not(self):
        busy = "import time, acopla, plate\nclass Slow(plate.Plate):\n    def advance(self, window, received):\n        until = time.monotonic() + ({})\n" \
               "        while time.monotonic() < until: pass\n        return super().advance(window, received)\nacopla.serve(Slow(2.0, 800.0))\n"
        # Three seconds of pure Python: twice what a silent participant has.
        run = self.run_plate("slow.py", scripts=[("slow.py", busy.format("3 if window.start == 2 else 0"))]).end()
        self.assertEqual(run.code, 0, run.err)
        run = self.run_plate("slow.py", scripts=[("slow.py", busy.format("0.05"))], send=', "--pause", "20"')
        child = self.child_of(run, "slow.py")
        time.sleep(0.3)
        os.kill(child, signal.SIGSTOP)
        begin = time.monotonic()
        run.end()
        self.assertEqual(run.code, 1)
        self.assertIn("plate (python3)", run.err)
        self.assertLess(time.monotonic() - begin, 2 + float(os.environ.get("ACOPLA_TEST_SLACK", "3")))

    def child_of(self, run, script):
        for _ in range(500):
            for entry in pathlib.Path("/proc").glob("[0-9]*"):
                try:
                    words = (entry / "cmdline").read_bytes().split(b"\0")
                    if script.encode() in words and os.readlink(entry / "cwd") == str(run.case.path) and b"python3" in words[0]:
                        return int(entry.name)
                except OSError:
                    pass
            time.sleep(0.01)
        raise AssertionError("it never started")

    def test_started_by_hand_it_says_how_it_is_started(self):
        environment = {key: value for key, value in os.environ.items() if not key.startswith("ACOPLA")}
        done = subprocess.run(["/usr/bin/python3", "-c", "import acopla; acopla.serve(acopla.Participant())"], capture_output=True, text=True,
                              env=environment | {"PYTHONPATH": str(SOURCE / "protocol/python")})
        self.assertEqual((done.returncode, done.stderr.strip()),
                         (1, "ACOPLA_ENDPOINT is not set. This program is started by `acopla run`, as a case's command = […]."))

    def test_tcp_beyond_loopback_is_refused(self):
        with self.assertRaises(acopla.UserMistake):
            acopla._check_endpoint("tcp://192.168.0.1:5555")
        acopla._check_endpoint("tcp://127.0.0.1:5555")


class Oscillator(unittest.TestCase):
    """u = ½ (cos 2πt ± cos 6πt), in either direction of the coupling."""

    def error(self, window, scheme, loader="left", structure="right", end=0.6):
        run = Run(self, OSCILLATOR.format(end=end, window=window, scheme=scheme, loader=loader, structure=structure)).end()
        self.assertEqual(run.code, 0, run.err)
        found = run.case.quantities()
        exact = [0.5 * (math.cos(2 * math.pi * end) + sign * math.cos(6 * math.pi * end)) for sign in (1, -1)]
        return math.hypot(found["left.u"] - exact[0], found["right.u"] - exact[1])

    def test_the_serial_explicit_scheme_is_of_order_two_either_way_round(self):
        for loader, structure in (("left", "right"), ("right", "left")):
            coarse, fine = (self.error(h, 'scheme = "explicit"', loader, structure) for h in (0.01, 0.005))
            self.assertLess(fine, 0.02)
            self.assertAlmostEqual(math.log2(coarse / fine), 2, delta=0.3)  # the next term is h² smaller: a few per cent of it at these steps

    def test_the_implicit_scheme_saves_restores_and_is_of_order_two(self):
        coarse, fine = (self.error(h, 'scheme = "implicit"\ntolerance = 1e-9') for h in (0.01, 0.005))
        self.assertAlmostEqual(math.log2(coarse / fine), 2, delta=0.3)


class Membrane(unittest.TestCase):
    def at_rest(self, cells):
        skin = membrane.Membrane(tension=100.0, density=0.0, side=2.0, cells=cells)
        skin.start(acopla.Run(0.1, 1, 1, numpy.zeros(3), "", []))
        pressure = -3.0
        force = numpy.full(((cells + 1) ** 2, 3), [0, 0, pressure * (2.0 / cells) ** 2])
        return skin.advance(acopla.Window(0, 1, 0, 0.1), {("skin", "force"): force}).quantities["u.min"]

    def test_it_sags_as_the_series_of_poissons_equation(self):
        # u(centre) = 4 p a²/(π⁴ T) · 4 Σ (−1)^((i+j)/2−1) / (i j (i² + j²)) over odd i, j
        total = sum((-1) ** ((i + j) // 2 - 1) / (i * j * (i * i + j * j)) for i in range(1, 400, 2) for j in range(1, 400, 2))
        exact = -3.0 * 2.0**2 / 100.0 * 16 / math.pi**4 * total
        errors = [abs(self.at_rest(cells) - exact) for cells in (8, 16)]
        self.assertLess(errors[1], 0.005 * abs(exact))
        self.assertAlmostEqual(math.log2(errors[0] / errors[1]), 2, delta=0.05)

    def test_it_swings_at_its_first_frequency_and_restores_bit_for_bit(self):
        # ω² = 2 T/ρ · (2/h)² sin²(π h / 2 a): the exact frequency of the differences
        n, tension, density = 8, 100.0, 0.5
        skin = membrane.Membrane(tension, density, 1.0, n)
        skin.start(acopla.Run(0.1, 1, 1, numpy.zeros(3), "", []))
        mode = numpy.outer(*[numpy.sin(math.pi * numpy.arange(n + 1) / n)] * 2).ravel()
        skin.u = 0.01 * mode
        omega = math.sqrt(2 * tension / density) * 2 * n * math.sin(math.pi / 2 / n)
        steps, h = 400, 2 * math.pi / omega / 400
        at_rest = {("skin", "force"): numpy.zeros((mode.size, 3))}
        skin.save()
        runs = []
        for _ in range(2):
            for k in range(steps):
                skin.advance(acopla.Window(k, k + 1, k * h, h), at_rest)
            runs.append((skin.u.tobytes(), skin.v.tobytes()))
            self.assertAlmostEqual(skin.u.max(), 0.01, delta=1e-6)  # the trapezoidal rule's phase error, (ωh)²/12 of a turn, squared
            skin.restore()
        self.assertEqual(*runs)


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1] + sys.argv[3:])
