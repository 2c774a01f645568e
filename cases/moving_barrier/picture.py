#!/usr/bin/python3
"""Draws a run of the moving barrier: picture.py RESULTS OUT.png. Four instants, coloured by where the discs lay when they had settled."""
import pathlib
import sys

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))

from angle import angle_of_repose, discs, pictures  # noqa: E402
from vtp import draw_discs, read_points  # noqa: E402


def main():
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    series = pictures(sys.argv[1], "discs")
    end = series[-1][0]
    shown = [min(series, key=lambda picture: abs(picture[0] - t)) for t in (2.0, 2 + (end - 2) / 5, 2 + (end - 2) / 2, end)]
    settled = read_points(shown[0][1])
    layer = dict(zip(settled["id"].tolist(), np.floor(settled["Points"][:, 1] / 0.03).astype(int) % 2))
    figure, panels = plt.subplots(2, 2, figsize=(11, 4.6), layout="constrained")
    for axes, (time, file) in zip(panels.flat, shown):
        found = read_points(file)
        colours = np.where([layer.get(k, 0) for k in found["id"].tolist()], "tab:blue", "0.8")
        draw_discs(axes, found["Points"][:, 0], found["Points"][:, 1], found["radius"], colours, 0.3 if len(colours) < 2000 else 0)
        axes.plot([0, 0, 0.8, 0.8], [0.3, 0, 0, 0.3], "k", lw=1)
        axes.set_xlim(0, 0.81)
        axes.set_ylim(-0.005, 0.3)
        axes.set_title(f"{time:.1f} s", fontsize=9)
    x, y, r = discs(shown[-1][1])
    panels[1, 1].set_title(f"{shown[-1][0]:.1f} s, angle of repose {angle_of_repose(x, y, r)[0]:.1f}°", fontsize=9)
    figure.savefig(sys.argv[2], dpi=110)


if __name__ == "__main__":
    main()
