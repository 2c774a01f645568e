#!/usr/bin/python3
"""Draws a run of the box case: picture.py RESULTS OUT.png. ParaView shows more; this needs python3-matplotlib only.

Left: the spheres at rest, seen from above one corner, and the box's edges. Right: the force that the structure received at
the nodes of its floor, mean over the last window.
"""
import pathlib
import sys

import h5py
import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.collections import EllipseCollection, LineCollection

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent.parent))

from vtp import read_points  # noqa: E402


def main():
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    results, out = pathlib.Path(sys.argv[1]), sys.argv[2]
    spheres = read_points(sorted((results / "grains").glob("grains_*.vtp"))[-1])
    with h5py.File(results / "interface.h5") as record:
        nodes, forces = record["structure.inside/points"][...], record["structure.inside/force"][-1]

    figure, (left, right) = plt.subplots(1, 2, figsize=(11, 5), gridspec_kw={"width_ratios": [1.15, 1]})
    # A parallel projection, painter's order.
    azimuth, elevation = np.radians(-60), np.radians(28)
    across = np.array([-np.sin(azimuth), np.cos(azimuth), 0])
    towards = np.array([np.cos(azimuth) * np.cos(elevation), np.sin(azimuth) * np.cos(elevation), np.sin(elevation)])
    up = np.cross(towards, across)
    x = spheres["Points"]
    order = np.argsort(x @ towards)
    x, radius = x[order], spheres["radius"][order]
    face = plt.cm.viridis(0.1 + 0.85 * x[:, 2] / x[:, 2].max())
    low, high = nodes.min(axis=0), nodes.max(axis=0)
    corners = np.array([[(low, high)[i][0], (low, high)[j][1], (low, high)[k][2]] for i in (0, 1) for j in (0, 1) for k in (0, 1)])
    edges = [(a, b) for a in range(8) for b in range(a) if bin(a ^ b).count("1") == 1]
    left.add_collection(LineCollection([[(corners[e] @ across, corners[e] @ up) for e in edge] for edge in edges], colors="0.55", lw=1))
    left.add_collection(EllipseCollection(2 * radius, 2 * radius, 0, units="xy", offsets=np.c_[x @ across, x @ up],
                                          transOffset=left.transData, facecolors=face, edgecolors="k", linewidths=0.25))
    left.autoscale_view()
    left.set_aspect("equal")
    left.axis("off")
    left.set_title(f"{len(x)} glass spheres at rest in a steel box", fontsize=10)

    floor = np.isclose(nodes[:, 2], low[2])
    drawn = right.scatter(nodes[floor, 0], nodes[floor, 1], c=-forces[floor, 2], s=14, marker="s", cmap="magma_r")
    figure.colorbar(drawn, ax=right, shrink=0.75, label="downward force at a node [N]")
    right.set_aspect("equal")
    right.set_xlabel("x [m]")
    right.set_ylabel("y [m]")
    right.set_title(f"forces at the floor's nodes; whole box: {-forces[:, 2].sum():.2f} N", fontsize=10)
    figure.savefig(out, dpi=110, bbox_inches="tight")


if __name__ == "__main__":
    main()
