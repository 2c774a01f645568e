#!/usr/bin/python3
"""The examples of the guide are read by the programs: guide.py BIN. And the small cases of particles alone are checked as a user would check them."""
import pathlib
import re
import subprocess
import sys
import tempfile
import unittest

BIN = pathlib.Path(sys.argv.pop(1)).resolve()
ROOT = pathlib.Path(__file__).resolve().parent.parent.parent

# What an example leaves out: it is read as part of this case, and what it has itself takes the place of that here.
HEAD = """title = "example"
dimension = {dimension}
gravity = {gravity}
end = 0.01
[coupling]
window = 0.01
"""
PARTS = {
    "material": """[grains.material.glass]
density = 2500
shear_modulus = 1e7
poisson = 0.2
[grains.material.steel]
density = 7800
shear_modulus = 8e10
poisson = 0.3
""",
    "contact": """[[grains.contact]]
between = [["glass", "glass"], ["glass", "steel"]]
normal = {{ law = "linear", stiffness = 1e5 }}
restitution = 0.5
""",
    "insert": """[[grains.insert]]
material = "glass"
diameter = 0.01
count = 1
region = {{ box = [{low}, {high}] }}
""",
}


def whole_case(example):
    """The example and what it lacks."""
    plane = bool(re.search(r"\[\[(-?[\d.]+), (-?[\d.]+)\]", example))
    words = {"dimension": 2 if plane else 3, "gravity": "[0, -9.81]" if plane else "[0, 0, -9.81]", "low": "[0, 0.1]" if plane else "[0, 0, 0]",
             "high": "[0.1, 0.2]" if plane else "[0.1, 0.1, 0.1]"}
    lacking = [name for name in PARTS if f"[grains.{name}" not in example and f"[[grains.{name}" not in example]
    if "start_from" in example:
        lacking.remove("insert")
    own = example if "[grains]\n" in example else '[grains]\n' + example
    own = own.replace("[grains]\n", '[grains]\nsolver = "dem"\n')
    return HEAD.format(**words) + own + "".join(PARTS[name].format(**words) for name in lacking)


def whole_structure(example):
    """The example and what it lacks; its parts are sides of a block."""
    names = re.findall(r"^\[structure\.(?:fix|load|move)\.(\w+)\]", example, re.M)
    sides = ["y0", "z1", "z0", "x1"]
    for name, side in zip(names, sides):
        example = example.replace(f".{name}]", f".{side}]")
    head = "" if "[structure]" in example else "[structure]\nmesh = { bar = { size = [1, 1, 1], cells = [2, 2, 2] } }\n"
    tail = "" if "fix" in example else "[structure.fix.x0]\n"
    whole = head + example + "[structure.material]\nyoung = 1e9\npoisson = 0.3\n" + tail
    return "dimension = 3\nend = 1\n" + whole.replace("[structure]\n", '[structure]\nsolver = "fem"\n')


class Guide(unittest.TestCase):
    def check(self, case, *options):
        done = subprocess.run([BIN / "acopla-dem", case, *(options or ["--check"])], capture_output=True, text=True, timeout=120)
        self.assertEqual(done.returncode, 0, f"{done.stderr}\n{pathlib.Path(case).read_text()}")

    @unittest.skipUnless((BIN / "acopla-fem").exists(), "built without deal.II")
    def test_examples_of_structures(self):
        examples = [e for e in re.findall(r"```toml\n(.*?)```", (ROOT / "docs/guide.md").read_text(), re.S) if "[structure" in e]
        self.assertGreater(len(examples), 1)
        with tempfile.TemporaryDirectory() as name:
            folder = pathlib.Path(name)
            (folder / "earthquake.csv").write_text("0, 0\n1, 0.1\n")
            for number, example in enumerate(examples):
                with self.subTest(example=example):
                    case = folder / f"structure{number}.toml"
                    case.write_text(whole_structure(example))
                    done = subprocess.run([BIN / "acopla-fem", case, "--explain"], capture_output=True, text=True, timeout=120)
                    self.assertEqual(done.returncode, 0, f"{done.stderr}\n{case.read_text()}")

    def test_examples(self):
        examples = re.findall(r"```toml\n(.*?)```", (ROOT / "docs/guide.md").read_text(), re.S)
        self.assertGreater(len(examples), 3)
        with tempfile.TemporaryDirectory() as name:
            folder = pathlib.Path(name)
            settled = folder / "settled.toml"
            settled.write_text(whole_case("[grains.output]\ncheckpoint = true\n"))
            self.check(settled, "--results", str(folder / "settled"))  # what start_from names
            for number, example in enumerate(examples):
                if "[structure" in example:
                    continue  # below
                with self.subTest(example=example):
                    case = folder / f"example{number}.toml"
                    case.write_text(whole_case(example))
                    self.check(case)
                    if "settle]" not in example:  # that has no walls to settle between
                        self.check(case, "--results", str(folder / f"results{number}"))

    def test_cases(self):
        cases = [case for case in sorted((ROOT / "cases").glob("*/case.toml")) if 'solver = "fem"' not in case.read_text() and "[coupling]" in case.read_text()]
        self.assertGreater(len(cases), 1)
        for case in cases:
            with self.subTest(case=str(case)):
                done = subprocess.run([BIN / "acopla", "check", case], capture_output=True, text=True, timeout=120)
                self.assertEqual(done.returncode, 0, done.stderr)


if __name__ == "__main__":
    unittest.main()
