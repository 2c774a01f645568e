"""What the pictures of two-dimensional cases share: finding what acopla-dem wrote, and drawing discs and lines."""
import pathlib
import tomllib

import numpy as np
from matplotlib.collections import EllipseCollection
from vtp import read_points  # noqa: F401: for those who import this


def pictures_of(results, name):
    """Files of a participant's particles in the order of time."""
    return sorted(pathlib.Path(results).rglob(f"{name}_[0-9]*.vtp"))


def lines_of(case, name):
    """The walls of a case that do not move: corners, one array a wall."""
    walls = tomllib.loads(pathlib.Path(case).read_text())[name]["wall"]
    return [np.array(wall["line"] + (wall["line"][:1] if wall.get("closed") else [])) for wall in walls.values() if "motion" not in wall]


def draw(axes, discs, colour, fastest=None, walls=()):
    """Discs filled by `colour` from 0 to `fastest` (default: the largest)."""
    x, r = discs["Points"], discs["radius"].astype(float)
    collection = EllipseCollection(2 * r, 2 * r, 0, units="xy", offsets=x[:, :2], transOffset=axes.transData, array=colour, cmap="viridis",
                                   edgecolors="k", linewidths=0.1)
    collection.set_clim(0, fastest or colour.max())
    axes.add_collection(collection)
    for wall in walls:
        axes.plot(wall[:, 0], wall[:, 1], "k-", lw=1)
    axes.set_aspect("equal")
    axes.axis("off")
    return collection
