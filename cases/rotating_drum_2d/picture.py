#!/usr/bin/python3
"""Draws a run of the drum and prints the angle of its surface: picture.py RESULTS OUT.png. Needs python3-matplotlib and python3-h5py.

The angle is that of a line through the highest discs of bins across the middle of the drum, the mean over the second half of the run; beside it
the angle that the torque on the drum says.
"""
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

RADIUS, WEIGHT = 0.098, 294.3  # inside the glued discs [m]; [N per metre of depth]


def surface_angle(grains):
    x, y, r = grains["Points"][:, 0], grains["Points"][:, 1], grains["radius"]
    edges = np.linspace(-0.6 * RADIUS, 0.6 * RADIUS, 13)
    tops = [(y + r)[(x >= a) & (x < b)].max() for a, b in zip(edges, edges[1:])]
    slope, _ = np.polyfit((edges[1:] + edges[:-1]) / 2, tops, 1)
    return np.degrees(np.arctan(slope))


def main():
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    files = discs.pictures_of(sys.argv[1], "grains")
    angles = [surface_angle(discs.read_points(file)) for file in files[len(files) // 2:]]
    with h5py.File(pathlib.Path(sys.argv[1]) / "interface.h5") as record:
        time = record["windows"][...][:, 1]
        torque = record["quantities/grains.drum.torque.z"][...]
        energy = {name: record[f"quantities/grains.energy.{name}"][...] for name in ("wall_work", "lost.normal", "lost.sliding", "lost.rolling")}
    mean = -torque[time > 0.5 * time[-1]].mean()
    by_torque = np.degrees(np.arcsin(mean / (WEIGHT * 4 * RADIUS / (3 * np.pi))))
    print(f"surface {np.mean(angles):.1f} ± {np.std(angles):.1f} degrees; by the torque of {mean:.2f} N m {by_torque:.1f} degrees")

    figure, (left, right) = plt.subplots(1, 2, figsize=(11, 4.6))
    grains = discs.read_points(files[-1])
    shown = discs.draw(left, grains, grains["speed"].astype(float))
    left.add_patch(plt.Circle((0, 0), RADIUS, fill=False))
    left.set_xlim(-0.11, 0.11)
    left.set_ylim(-0.11, 0.11)
    figure.colorbar(shown, ax=left, shrink=0.7, label="speed [m/s]")
    right.plot(time, energy["wall_work"], "k", label="work of the drum")
    below = np.zeros_like(time)
    for name, what in (("lost.sliding", "friction"), ("lost.normal", "normal dashpots"), ("lost.rolling", "rolling resistance")):
        right.fill_between(time, below, below + energy[name], alpha=0.6, label=f"lost to {what}")
        below = below + energy[name]
    right.set_xlabel("time [s]")
    right.set_ylabel("energy [J per metre of depth]")
    right.legend()
    figure.tight_layout()
    figure.savefig(sys.argv[2], dpi=110)


if __name__ == "__main__":
    main()
