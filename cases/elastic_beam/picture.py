#!/usr/bin/python3
"""Draws a run of the elastic beam: picture.py RESULTS OUT.png. Discs and beam at three instants, and the middle's deflection over time."""
import pathlib
import sys

import h5py
import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent.parent))

from vtp import discs, draw_discs, pictures, read_points  # noqa: E402


def main():
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    results = pathlib.Path(sys.argv[1])
    series, walls = pictures(results, "discs"), pictures(results, "discs_floor")
    figure, panels = plt.subplots(2, 2, figsize=(11, 6), layout="constrained")
    for axes, at in zip(panels.flat, (0, len(series) // 6, -1)):
        time, file = series[at]
        draw_discs(axes, *discs(file), "tab:blue", 0.2)
        x = read_points(walls[at][1])["Points"]
        axes.plot(x[:, 0], x[:, 1], "k-", lw=2)
        axes.set_xlim(-0.02, 1.02)
        axes.set_ylim(-0.06, 0.5)
        axes.set_title(f"{time:.2f} s", fontsize=9)
    with h5py.File(results / "interface.h5") as record:
        panels[1, 1].plot(record["windows"][:, 1], 1e3 * record["quantities/beam.middle.displacement.y"][:], lw=0.8)
    panels[1, 1].set_xlabel("time [s]")
    panels[1, 1].set_ylabel("deflection of the middle [mm]")
    figure.savefig(sys.argv[2], dpi=110)


if __name__ == "__main__":
    main()
