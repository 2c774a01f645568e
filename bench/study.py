"""What every study shares: targets, tables, a figure, and the page that keeps them."""
import csv
import json
import os
import pathlib
import platform
import shutil
import subprocess
import sys
import tempfile
import time


class Study:
    """Collects the rows of one study and writes docs/evidence/NAME.md, .csv, .svg."""

    def __init__(self, name, about, build, quick):
        self.name, self.about, self.build, self.quick = name, about, build, quick
        self.root = pathlib.Path(__file__).resolve().parent.parent
        self.work = pathlib.Path(tempfile.mkdtemp(prefix=f"acopla-bench-{name}-"))
        self.out = build / "evidence-quick" if quick else self.root / "docs" / "evidence"
        self.targets, self.parts, self.figures = [], [], 0
        self.started = time.time()

    # --- what a study reports -------------------------------------------------------------------------------------
    def target(self, figure, reference, value, bound, met, show="{:.3g}"):
        """One figure to reach. `value` None: the peer, tool or reference is missing, which counts as missed."""
        shown = "missing" if value is None else value if isinstance(value, str) else show.format(value)
        self.targets.append((figure, reference, shown, bound, bool(met) and value is not None))
        print(f"  {'met   ' if self.targets[-1][4] else 'MISSED'} {figure}: {shown} (target {bound})", flush=True)

    def at_most(self, figure, reference, value, bound, show="{:.3g}"):
        self.target(figure, reference, value, f"≤ {show.format(bound)}", value is not None and value <= bound, show)

    def at_least(self, figure, reference, value, bound, show="{:.3g}"):
        self.target(figure, reference, value, f"≥ {show.format(bound)}", value is not None and value >= bound, show)

    def text(self, paragraph):
        self.parts.append(paragraph)

    def table(self, title, header, rows):
        lines = [f"**{title}**", "", "| " + " | ".join(header) + " |", "| " + " | ".join("---" for _ in header) + " |"]
        lines += ["| " + " | ".join(str(cell) for cell in row) + " |" for row in rows]
        self.parts.append("\n".join(lines))

    def csv(self, header, rows):
        self.out.mkdir(parents=True, exist_ok=True)
        with open(self.out / f"{self.name}.csv", "w", newline="") as out:
            writer = csv.writer(out)
            writer.writerow(header)
            writer.writerows(rows)

    def figure(self, draw, size=(7, 4), heights=None):
        """draw(axes) on a fresh figure, saved as NAME.svg; with `heights`, axes are so many, one above the other, of such relative heights.
        Without matplotlib the page says so."""
        try:
            import matplotlib
        except ImportError:
            self.parts.append("(No figure: python3-matplotlib is not installed.)")
            return
        matplotlib.use("Agg")
        matplotlib.rcParams["svg.hashsalt"] = self.name  # the same data give the same file
        import matplotlib.pyplot as plt
        figure, axes = plt.subplots(len(heights or [1]), figsize=size, height_ratios=heights, layout="constrained")
        draw(axes)
        self.out.mkdir(parents=True, exist_ok=True)
        figure.savefig(self.out / f"{self.name}.svg", bbox_inches="tight", metadata={"Date": None})
        plt.close(figure)
        self.parts.append(f"![{self.about}]({self.name}.svg)")

    # --- running things -------------------------------------------------------------------------------------------
    def program(self, name):
        return str(self.build / "bin" / name)

    def run(self, command, **options):
        """Runs a command to its end; its failure ends the study with its last words."""
        done = subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, **options)
        if done.returncode != 0:
            sys.exit(f"{self.name}: {' '.join(map(str, command))} ended with {done.returncode}:\n{done.stdout[-3000:]}")
        return done.stdout

    def acopla(self, case, results, codes=(0,)):
        """`acopla run` on a case; returns its summary. `codes`: exit codes that still are results."""
        done = subprocess.run([self.program("acopla"), "run", str(case), "--results", str(results)],
                              stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
        if done.returncode not in codes:
            sys.exit(f"{self.name}: acopla run {case} ended with {done.returncode}:\n{done.stdout[-3000:]}")
        return json.loads((pathlib.Path(results) / "summary.json").read_text())

    # --- the end --------------------------------------------------------------------------------------------------
    def finish(self):
        met = sum(1 for row in self.targets if row[4])
        last = f"{self.name}: met {met} of {len(self.targets)}"
        self.out.mkdir(parents=True, exist_ok=True)
        command = f"./acopla bench {self.name}" + (" --quick" if self.quick else "")
        page = [f"# {self.name}", self.about[0].upper() + self.about[1:] + ".",
                f"Printed by `{command}` on {machine()}, in {time.time() - self.started:.0f} s.", "## Targets"]
        rows = [f"| {a} | {b} | {c} | {d} | {'yes' if e else '**no**'} |" for a, b, c, d, e in self.targets]
        page.append("\n".join(["| figure | paper | here | target | met |", "| --- | --- | --- | --- | --- |"] + rows))
        page += self.parts + [last]
        (self.out / f"{self.name}.md").write_text("\n\n".join(page) + "\n")
        shutil.rmtree(self.work, ignore_errors=True)
        print(f"written: {os.path.relpath(self.out / self.name)}.md")
        print(last)
        return 0 if met == len(self.targets) else 1


def machine():
    model = platform.machine()
    try:
        with open("/proc/cpuinfo") as info:
            model = next(line.split(":")[1].strip() for line in info if line.startswith("model name"))
    except (OSError, StopIteration):
        pass
    return f"{os.cpu_count()} cores of {model}"
