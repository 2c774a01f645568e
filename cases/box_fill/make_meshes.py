#!/usr/bin/python3
"""Meshes of Nasato (2011, chapter 4): an open steel box, as triangles for the particles and hexahedra for the structure.

    make_meshes.py --side 1.0 --stl box.stl --triangles 36 38 --msh box.msh --cells 37 38

The inside is a cube of `side`, open at the top, its walls and floor 20 mm thick. `--triangles N M` divides the floor in
N x N and each wall in N x M squares of two triangles; `--cells N M` likewise for the hexahedra, with one cell through the
thickness. Nasato's meshes are not printed; these have his numbers of elements within 1.5 %:

    particles   coarse 36 38 -> 13,536   medium 46 47 -> 21,528   fine 58 57 -> 33,176   (13,523  21,568  33,102)
    structure   coarse 37 38 ->  7,297   medium 52 51 -> 13,728   fine 62 63 -> 19,972   ( 7,232  13,751  19,965)
"""
import argparse
import struct


def stl(path, side, n, m):
    """Binary STL of the five inner faces; normals point into the box."""
    quads = []
    at = lambda i, count: side * i / count

    def face(rows, columns, point):
        for r in range(rows):
            for c in range(columns):
                quads.append([point(r, c), point(r, c + 1), point(r + 1, c + 1), point(r + 1, c)])

    face(n, n, lambda r, c: (at(c, n), at(r, n), 0.0))
    face(m, n, lambda r, c: (0.0, at(c, n), at(r, m)))
    face(m, n, lambda r, c: (side, at(n - c, n), at(r, m)))
    face(m, n, lambda r, c: (at(n - c, n), 0.0, at(r, m)))
    face(m, n, lambda r, c: (at(c, n), side, at(r, m)))
    with open(path, "wb") as out:
        out.write(b"open box, inner faces".ljust(80))
        out.write(struct.pack("<I", 2 * len(quads)))
        for a, b, c, d in quads:
            for triangle in ((a, b, c), (a, c, d)):
                out.write(struct.pack("<12fH", 0, 0, 0, *triangle[0], *triangle[1], *triangle[2], 0))
    return 2 * len(quads)


def msh(path, side, n, m, thickness):
    """Gmsh 4.1 ASCII: volume `steel`, surfaces `inside` (what the particles touch) and `base` (the outer floor)."""
    plan = [-thickness] + [side * i / n for i in range(n + 1)] + [side + thickness]
    rise = [-thickness] + [side * i / m for i in range(m + 1)]
    solid = lambda i, j, k: k == 0 or i in (0, n + 1) or j in (0, n + 1)
    numbers, points, hexes, inside, base = {}, [], [], [], []

    def node(i, j, k):
        if (i, j, k) not in numbers:
            numbers[i, j, k] = len(points) + 1
            points.append((plan[i], plan[j], rise[k]))
        return numbers[i, j, k]

    for k in range(m + 1):
        for j in range(n + 2):
            for i in range(n + 2):
                if not solid(i, j, k):
                    continue
                low = [node(i, j, k), node(i + 1, j, k), node(i + 1, j + 1, k), node(i, j + 1, k)]
                high = [node(i, j, k + 1), node(i + 1, j, k + 1), node(i + 1, j + 1, k + 1), node(i, j + 1, k + 1)]
                hexes.append(low + high)
                if k == 0:
                    base.append(low[::-1])
                    if not solid(i, j, 1):
                        inside.append(high)
                    continue
                if i == 0 and 1 <= j <= n:
                    inside.append([low[1], low[2], high[2], high[1]])
                if i == n + 1 and 1 <= j <= n:
                    inside.append([low[3], low[0], high[0], high[3]])
                if j == 0 and 1 <= i <= n:
                    inside.append([low[2], low[3], high[3], high[2]])
                if j == n + 1 and 1 <= i <= n:
                    inside.append([low[0], low[1], high[1], high[0]])
    low, high = f"{plan[0]} {plan[0]} {rise[0]}", f"{plan[-1]} {plan[-1]} {rise[-1]}"
    blocks = [(2, 1, 3, inside), (2, 2, 3, base), (3, 1, 5, hexes)]  # dimension, entity, element type, elements
    with open(path, "w") as out:
        out.write("$MeshFormat\n4.1 0 8\n$EndMeshFormat\n")
        out.write('$PhysicalNames\n3\n2 1 "inside"\n2 2 "base"\n3 3 "steel"\n$EndPhysicalNames\n')
        out.write(f"$Entities\n0 0 2 1\n1 {low} {high} 1 1 0\n2 {low} {high} 1 2 0\n1 {low} {high} 1 3 2 1 2\n$EndEntities\n")
        out.write(f"$Nodes\n1 {len(points)} 1 {len(points)}\n3 1 0 {len(points)}\n")
        out.writelines(f"{k + 1}\n" for k in range(len(points)))
        out.writelines("%.12g %.12g %.12g\n" % point for point in points)
        count = sum(len(block[3]) for block in blocks)
        out.write(f"$EndNodes\n$Elements\n{len(blocks)} {count} 1 {count}\n")
        number = 1
        for dimension, entity, kind, elements in blocks:
            out.write(f"{dimension} {entity} {kind} {len(elements)}\n")
            for nodes in elements:
                out.write(f"{number} {' '.join(map(str, nodes))}\n")
                number += 1
        out.write("$EndElements\n")
    return len(hexes)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--side", type=float, default=1.0, help="inner edge of the box [m]")
    parser.add_argument("--thickness", type=float, default=0.02, help="of the walls and the floor [m]")
    parser.add_argument("--stl", help="write the particles' wall here")
    parser.add_argument("--triangles", type=int, nargs=2, default=(36, 38), metavar=("N", "M"))
    parser.add_argument("--msh", help="write the structure here")
    parser.add_argument("--cells", type=int, nargs=2, default=(37, 38), metavar=("N", "M"))
    given = parser.parse_args()
    if given.stl:
        print(f"{given.stl}: {stl(given.stl, given.side, *given.triangles)} triangles")
    if given.msh:
        print(f"{given.msh}: {msh(given.msh, given.side, *given.cells, given.thickness)} hexahedra")


if __name__ == "__main__":
    main()
