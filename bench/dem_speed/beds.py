"""Cases of settled beds: a tile is settled between its own walls, then repeated side by side and measured by dem_bed."""
import json
import math
import os
import struct

SPHERES, EDGE, DIAMETER = 1000, 0.2167, 0.02  # of a tile: as deep as the large bed
DISCS, WIDTH = 1500, 0.12

MATERIAL = """[grains.material.{name}]
density = 2500
young = 1.25e7
poisson = 0.25
"""
INSERT = """[[grains.insert]]
material = "{name}"
diameter = 0.02
count = {count}
region = {{ box = [[0, 0, 0], [{edge}, {edge}, {top}]] }}
velocity = [0, 0, -0.5]
"""
HERTZ_MINDLIN = 'normal = "hertz"\ntangential = "mindlin"\nfriction = 0.5\nrestitution = 0.3'
# A spring that is as stiff as Hertz's at an overlap of a hundredth of the radius.
LINEAR = 'normal = { law = "linear", stiffness = 6e3 }\nrestitution = 0.3'
SLIDER = LINEAR + '\ntangential = "linear_slider"\nfriction = 0.5'


def rolling(law):
    return f'\nrolling = "{law}"\nrolling_friction = 0.1'


def plane(name, point, normal, more=""):
    return f'[grains.wall.{name}]\nplane = {{ point = {point}, normal = {normal} }}\nmaterial = "glass"\n{more}'


def spheres(size, start=None, contact=HERTZ_MINDLIN, floor=None, more="", insert="", materials=("glass",), count=SPHERES):
    """The text of a case. size: x and y of the box [m]; start: results of the settled tile, else it is filled; floor: in place of a plane."""
    x, y = size
    pairs = [[a, b] for k, a in enumerate(materials) for b in materials[k:]]
    text = ["dimension = 3\ngravity = [0, 0, -9.81]\nend = 0.9\n[coupling]\nwindow = 0.15\n[grains]\nsolver = \"dem\"\nstep = 1.5e-4",
            "allow_unstable_step = true", f'start_from = "{start}"' if start else "", more]
    text += [MATERIAL.format(name=name) for name in materials]
    text += [f"[[grains.contact]]\nbetween = {json.dumps(pairs)}\n{contact}"]
    text += [plane("x0", [0, 0, 0], [1, 0, 0]), plane("x1", [x, 0, 0], [-1, 0, 0]), plane("y0", [0, 0, 0], [0, 1, 0]),
             plane("y1", [0, y, 0], [0, -1, 0]), floor or plane("z0", [0, 0, 0], [0, 0, 1])]
    if not start:
        text += [INSERT.format(name=name, count=count // len(materials), edge=x, top=0.6) for name in materials]
    text += [insert, "[grains.output]\nparticles = false\ncheckpoint = true\n"]
    return "\n".join(text)


def gomes(width, start=None, more=""):
    """Discs of Gomes's (2014) tables 4.1 and 4.2. c_n = 99.31 N s/m is half the critical damping of the mean disc, that of e = 0.3."""
    walls = [f'[grains.wall.{name}]\nplane = {{ point = {point}, normal = {normal} }}\nmaterial = "soil"\n'
             for name, point, normal in (("left", [0, 0], [1, 0]), ("right", [width, 0], [-1, 0]), ("floor", [0, 0], [0, 1]))]
    fill = f"""[[grains.insert]]
material = "soil"
sizes = {{ groups = [{{ diameter = 0.0022, count = {DISCS // 4} }}, {{ diameter = 0.002, count = {DISCS // 2} }}, {{ diameter = 0.0018, count = {DISCS // 4} }}] }}
region = {{ box = [[0, 0], [{width}, 0.08]] }}
"""
    return "\n".join(["dimension = 2\ngravity = [0, -9.81]\nend = 0.3\n[coupling]\nwindow = 0.05\n[grains]\nsolver = \"dem\"\nstep_fraction = 0.4",
                      "allow_unstable_step = true", f'start_from = "{start}"' if start else "", more,
                      "[grains.damping]\nviscous = { translation = 4.91e-3, rotation = 3.03e-3 }\n[grains.material.soil]\ndensity = 1600",
                      """[[grains.contact]]
between = [["soil", "soil"]]
normal = { law = "linear", stiffness = 1.98e6 }
tangential = { law = "linear_slider", ratio = 20 }
rolling = "elastic_plastic"
restitution = 0.3
friction = 0.8
rolling_friction = 0.2
""", *walls, "" if start else fill, "[grains.output]\nparticles = false\ncheckpoint = true\n"])


def write_floor(path, x, y, triangles, z=0.0):
    """A flat floor of about so many triangles as a binary STL; returns how many there are."""
    across = max(1, round(math.sqrt(triangles / 2 * x / y)))
    along = max(1, round(triangles / 2 / across))
    with open(path, "wb") as out:
        out.write(bytes(80) + struct.pack("<I", 2 * across * along))
        for i in range(across):
            for j in range(along):
                corner = [(x * (i + a) / across, y * (j + b) / along, z) for a, b in ((0, 0), (1, 0), (1, 1), (0, 1))]
                for face in ((0, 1, 2), (0, 2, 3)):
                    out.write(struct.pack("<12fH", 0, 0, 1, *(v for k in face for v in corner[k]), 0))
    return 2 * across * along


def mesh_floor(path, more=""):
    return f'[grains.wall.z0]\nmesh = "{path}"\nmaterial = "glass"\n{more}'


class Beds:
    """Settles tiles and measures what is made of them."""

    def __init__(self, study):
        self.study, self.count = study, 0

    def write(self, text):
        self.count += 1
        path = self.study.work / f"bed{self.count}.toml"
        path.write_text(text)
        return path

    def settled(self, text):
        """Runs a case to its end; its results hold the checkpoint."""
        case = self.write(text)
        results = case.with_suffix("")
        self.study.run([self.study.program("acopla-dem"), str(case), "--results", str(results)], cwd=self.study.work)
        return results

    def measure(self, text, tile=None, warm=2000, steps=250, repeats=5):
        command = [self.study.program("dem_bed"), str(self.write(text)), "--warm", warm, "--steps", steps, "--repeats", repeats]
        if tile:
            command += ["--tile", *tile]
        return json.loads(self.study.run(list(map(str, command)), cwd=self.study.work))
