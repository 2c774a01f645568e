"""Reading acopla-dem's .vtp files without ParaView, for the pictures of the cases."""
import pathlib
import re

import numpy as np


def read_points(path):
    """Points and point data of a .vtp file with appended raw arrays, as acopla-dem writes it."""
    head, data = pathlib.Path(path).read_bytes().split(b'<AppendedData encoding="raw">\n_', 1)
    arrays = {}
    for kind, name, parts, offset in re.findall(rb'type="(\w+)" Name="(\w+)" NumberOfComponents="(\d+)" format="appended" offset="(\d+)"', head):
        start = int(offset)
        size = int(np.frombuffer(data, "<u8", 1, start)[0])
        values = np.frombuffer(data, {b"Float32": "<f4", b"Float64": "<f8", b"Int32": "<i4"}[kind], offset=start + 8,
                               count=size // (8 if kind == b"Float64" else 4))
        arrays[name.decode()] = values.reshape(-1, int(parts)) if int(parts) > 1 else values
    return arrays


def pictures(results, participant):
    """(time, file) of every picture of a participant's particles, from its .pvd, oldest first."""
    series = sorted(pathlib.Path(results).rglob(f"{participant}.pvd"))[-1]
    return [(float(time), series.parent / name) for time, name in re.findall(r'timestep="([^"]+)"[^>]*file="([^"]+)"', series.read_text())]


def discs(path):
    """x, y and radius of the discs in a file."""
    found = read_points(path)
    return found["Points"][:, 0].astype(float), found["Points"][:, 1].astype(float), found["radius"].astype(float)


def draw_discs(axes, x, y, radius, colours, edge=0.3):
    from matplotlib.collections import EllipseCollection
    axes.add_collection(EllipseCollection(2 * radius, 2 * radius, 0, units="xy", offsets=np.c_[x, y], transOffset=axes.transData,
                                          facecolors=colours, edgecolors="k", linewidths=edge))
    axes.set_aspect("equal")
