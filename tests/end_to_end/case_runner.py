"""Runs of the programs in a folder of their own, which goes when the test ends; and it must find no process that was left behind."""
import json
import pathlib
import shutil
import subprocess
import tempfile


class CaseFolder:
    def __init__(self, test, programs, files=()):
        """@param programs  folder of the executables. @param files  copied into the folder"""
        self.test, self.programs = test, pathlib.Path(programs)
        self.path = pathlib.Path(tempfile.mkdtemp(prefix="acopla-test-"))
        for file in files:
            shutil.copy(file, self.path)
        test.addCleanup(self.remove)

    def remove(self):
        left = subprocess.run(["pgrep", "-af", str(self.path)], capture_output=True, text=True).stdout
        shutil.rmtree(self.path, ignore_errors=True)
        self.test.assertEqual(left, "", "processes were left behind")

    def write(self, text, *changes, name="case.toml"):
        """@param changes  pairs (old, new); each old text must be there. @return the file"""
        for old, new in changes:
            self.test.assertIn(old, text)
            text = text.replace(old, new, 1)
        (self.path / name).write_text(text)
        return self.path / name

    def start(self, *words, program="acopla", **options):
        return subprocess.Popen([self.programs / program, *map(str, words)], cwd=self.path, **{"text": True} | options)

    def run(self, *words, program="acopla", timeout=120, **options):
        return subprocess.run([self.programs / program, *map(str, words)], cwd=self.path, capture_output=True, text=True, timeout=timeout, **options)

    def summary(self, results="out"):
        return json.loads((self.path / results / "summary.json").read_text())

    def quantities(self, results="out"):
        """Values of what the case expects, by name."""
        return {expectation["name"]: expectation["value"] for expectation in self.summary(results)["expectations"]}
