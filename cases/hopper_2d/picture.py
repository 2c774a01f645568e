#!/usr/bin/python3
"""Draws a run of the hopper: picture.py RESULTS OUT.png. Needs python3-matplotlib, and python3-h5py for the flow."""
import pathlib
import sys

import h5py
import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

here = pathlib.Path(__file__).parent
sys.path.insert(0, str(here.parent))
import discs


def main():
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    figure, axes = plt.subplots(1, 3, figsize=(11, 5.2), gridspec_kw={"width_ratios": [1, 1, 1.3]})
    files = discs.pictures_of(sys.argv[1], "grains")
    walls = discs.lines_of(here / "case.toml", "grains")
    for part, file in zip(axes, (files[0], files[-1])):
        grains = discs.read_points(file)
        shown = discs.draw(part, grains, grains["speed"].astype(float), 1.5, walls)
        part.set_xlim(-0.16, 0.16)
        part.set_ylim(-0.1, 0.72)
    axes[0].set_title("settled")
    axes[1].set_title("while it flows")
    figure.colorbar(shown, ax=axes[1], shrink=0.5, label="speed [m/s]")
    with h5py.File(pathlib.Path(sys.argv[1]) / "interface.h5") as record:
        time, mass = record["windows"][...][:, 1], record["quantities/grains.below.mass"][...]
    axes[2].plot(time, mass, label="left through the outlet")
    late = time > 0.5 * time[-1]
    rate, first = np.polyfit(time[late], mass[late], 1)
    axes[2].plot(time, rate * time + first, "k:", label=f"{rate:.1f} kg/s over the second half")
    axes[2].set_xlabel("time [s]")
    axes[2].set_ylabel("mass [kg per metre of depth]")
    axes[2].legend()
    figure.tight_layout()
    figure.savefig(sys.argv[2], dpi=110)
    print(f"flow over the second half of the run: {rate:.2f} kg/s")


if __name__ == "__main__":
    main()
