#!/usr/bin/python3
"""The angle of repose of a heap of discs against the right wall: angle.py RESULTS [--wall X]

In bins two mean diameters wide from the wall the surface is the highest top of a disc that touches another or the floor; of these, a line is
fitted to those between 15 and 85 % of the highest. Beside the slope: its standard error, and atan(crest/toe) as a check.
"""
import argparse
import pathlib
import re

import numpy as np


def read_points(path):
    """Points and point data of a .vtp file with appended raw arrays, as acopla-dem writes it."""
    head, data = path.read_bytes().split(b'<AppendedData encoding="raw">\n_', 1)
    arrays = {}
    for kind, name, parts, offset in re.findall(rb'type="(\w+)" Name="(\w+)" NumberOfComponents="(\d+)" format="appended" offset="(\d+)"', head):
        start = int(offset)
        size = int(np.frombuffer(data, "<u8", 1, start)[0])
        values = np.frombuffer(data, {b"Float32": "<f4", b"Float64": "<f8", b"Int32": "<i4"}[kind], offset=start + 8,
                               count=size // (8 if kind == b"Float64" else 4))
        arrays[name.decode()] = values.reshape(-1, int(parts)) if int(parts) > 1 else values
    return arrays


def last_discs(results):
    """x, y and radius of the discs at the end of a run."""
    found = read_points(sorted(pathlib.Path(results).rglob("discs_[0-9]*.vtp"))[-1])
    return found["Points"][:, 0], found["Points"][:, 1], found["radius"].astype(float)


def touching(x, y, r):
    """Discs with at least one contact. Positions are in single precision: a gap of 1e-4 radii is none."""
    touches = y - r < 1e-4 * r
    reach = 2 * r.max()
    order = np.argsort(x)
    for a, i in enumerate(order):
        for j in order[a + 1:]:
            if x[j] - x[i] > reach:
                break
            if np.hypot(x[j] - x[i], y[j] - y[i]) < (r[i] + r[j]) * (1 + 1e-4):
                touches[i] = touches[j] = True
    return touches


def angle_of_repose(x, y, r, wall=0.8):
    """(angle, its standard error, atan(crest/toe)) in degrees."""
    keep = touching(x, y, r)
    distance, top = (wall - x)[keep], (y + r)[keep]
    bins = np.floor(distance / (4 * r.mean())).astype(int)
    surface = np.array([max((t, d) for t, d in zip(top[bins == k], distance[bins == k])) for k in np.unique(bins)])
    crest = surface[:, 0].max()
    slope_part = surface[(surface[:, 0] >= 0.15 * crest) & (surface[:, 0] <= 0.85 * crest)]
    matrix = np.c_[slope_part[:, 1], np.ones(len(slope_part))]
    (slope, _), rest, _, _ = np.linalg.lstsq(matrix, slope_part[:, 0], rcond=None)
    spread = np.sqrt((rest[0] if len(rest) else 0) / max(1, len(slope_part) - 2) / np.sum((matrix[:, 0] - matrix[:, 0].mean())**2))
    # The toe: as far as the heap is two discs high.
    toe = distance[top > 4 * r.mean()].max()
    return np.degrees(np.arctan(abs(slope))), np.degrees(spread / (1 + slope**2)), np.degrees(np.arctan(crest / toe))


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("results")
    parser.add_argument("--wall", type=float, default=0.8)
    given = parser.parse_args()
    angle, error, check = angle_of_repose(*last_discs(given.results), given.wall)
    print(f"angle of repose {angle:.2f} ± {error:.2f} degrees; atan(crest/toe) {check:.2f} degrees")


if __name__ == "__main__":
    main()
