#!/usr/bin/python3
"""Draws a run of the free pile: picture.py RESULTS OUT.png. The discs as they are put down and at the end, with their contacts."""
import pathlib
import sys

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent.parent))

from vtp import discs, draw_discs, pictures  # noqa: E402


def main():
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    series = pictures(sys.argv[1], "discs")
    figure, panels = plt.subplots(1, 2, figsize=(11, 2.6), layout="constrained")
    for axes, (time, file) in zip(panels, (series[0], series[-1])):
        x, y, r = discs(file)
        draw_discs(axes, x, y, r, "tab:blue")
        for i in range(len(x)):
            for j in range(i):
                if np.hypot(x[i] - x[j], y[i] - y[j]) < r[i] + r[j]:
                    axes.plot([x[i], x[j]], [y[i], y[j]], "w", lw=1)
        axes.axhline(0, color="k", lw=1)
        axes.set_xlim(-0.065, 0.115)
        axes.set_ylim(-0.003, 0.052)
        axes.set_title(f"{time:.2f} s", fontsize=9)
    figure.savefig(sys.argv[2], dpi=110)


if __name__ == "__main__":
    main()
