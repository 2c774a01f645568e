#!/usr/bin/python3
"""Draws a run of the mixer blade: picture.py RESULTS OUT.png. The discs at three instants, and the torque of the shaft on both sides of the coupling."""
import pathlib
import sys

import h5py
import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent.parent))

from discs import lines_of  # noqa: E402
from vtp import discs, draw_discs, pictures, read_points  # noqa: E402


def main():
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    results = pathlib.Path(sys.argv[1])
    series, blades = pictures(results, "grains"), pictures(results, "grains_blade")
    drum = lines_of(pathlib.Path(__file__).with_name("case.toml"), "grains")
    figure, panels = plt.subplots(2, 3, figsize=(11, 6.5), layout="constrained")
    for axes, at in zip(panels[0], (0, len(series) // 3, -1)):
        time, file = series[at]
        draw_discs(axes, *discs(file), "tab:blue", 0.2)
        for line in (*drum, read_points(blades[at][1])["Points"]):
            axes.plot(line[:, 0], line[:, 1], "k-", lw=1)
        axes.set_xlim(-0.105, 0.105)
        axes.set_ylim(-0.105, 0.105)
        axes.set_title(f"{time:.2f} s", fontsize=9)
    with h5py.File(results / "interface.h5") as record:
        time, values = record["windows"][:, 1], record["quantities"]
        of = {name: values[name][:] for name in values}
    panels[1, 0].plot(time, of["grains.blade.torque.z"], lw=0.8, label="grains.blade.torque.z")
    panels[1, 0].plot(time, of["steel.shaft.torque.load"], "--", lw=0.8, label="steel.shaft.torque.load")
    panels[1, 0].set_title("torque about the shaft [N m/m]", fontsize=9)
    panels[1, 1].plot(time, of["steel.load.y"], lw=0.8, label="across, in its frame")
    panels[1, 1].plot(time, of["steel.load.x"], lw=0.8, label="along")
    panels[1, 1].set_title("force on the blade [N/m]", fontsize=9)
    panels[1, 2].plot(time, 1e6 * of["steel.tip.displacement.y"], lw=0.8, label="tip, across")
    panels[1, 2].set_title("deflection [µm]", fontsize=9)
    for axes in panels[1]:
        axes.set_xlabel("time [s]")
        axes.legend(fontsize=7)
    figure.savefig(sys.argv[2], dpi=100)
    difference = np.abs(of["grains.blade.torque.z"] - of["steel.shaft.torque.load"])
    print(f"torque about the shaft: at most {np.abs(of['steel.shaft.torque.load']).max():.1f} N m/m, the two sides differ by {difference.max():.2g} at most")


if __name__ == "__main__":
    main()
