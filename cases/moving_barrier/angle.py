#!/usr/bin/python3
"""The angle of repose of a heap of discs against the right wall: angle.py RESULTS [--wall X]

In bins two mean diameters wide from the wall the surface is the highest top of a disc that touches another or the floor; of these, a line is
fitted to those between 15 and 85 % of the highest. Beside the slope: its standard error, and atan(crest/toe) as a check.
"""
import argparse
import pathlib
import sys

import numpy as np

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent.parent))

from vtp import discs, pictures  # noqa: E402


def last_discs(results):
    """x, y and radius of the discs at the end of a run."""
    return discs(pictures(results, "discs")[-1][1])


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
