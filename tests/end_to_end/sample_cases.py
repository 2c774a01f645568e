"""Cases that several tests run, whole or with changes."""
import pathlib
import subprocess

# Of the participant "grains": what glass spheres do to each other.
GLASS = """[grains.material.glass]
density = 2500
shear_modulus = 5e6
poisson = 0.25
[[grains.contact]]
between = [["glass", "glass"]]
normal = "hertz"
tangential = "mindlin"
rolling = "constant_torque"
restitution = 0.3
friction = 0.5
rolling_friction = 0.05
"""

WEIGHT = 50 * 2500 * 3.141592653589793 / 6 * 0.04**3 * 9.81

# 50 spheres fall into a steel box.
SMALL_BOX = f"""title = "small box"
dimension = 3
gravity = [0, 0, -9.81]
end = 1.0
[coupling]
scheme = "one-way"
window = 0.05
max_distance = 0.02
[[coupling.interface]]
from = "grains.box"
to = "structure.inside"
[grains]
solver = "dem"
{GLASS}[grains.wall.box]
mesh = "box.stl"
material = "glass"
[[grains.insert]]
material = "glass"
diameter = 0.04
count = 50
region = {{ box = [[0, 0, 0], [0.3, 0.3, 0.3]] }}
[structure]
solver = "fem"
mesh = "box.msh"
degree = 1
[structure.material]
young = 2.1e11
poisson = 0.3
[structure.fix.base]
[expect]
"structure.reaction.z" = {{ value = {WEIGHT:.9g}, relative = 2e-3, mean_over = 0.2, source = "weight of the spheres" }}
"""


def make_small_box(folder):
    """The meshes of SMALL_BOX. @return the files"""
    maker = pathlib.Path(__file__).resolve().parent.parent.parent / "cases/box_fill/make_meshes.py"
    files = [folder / "box.stl", folder / "box.msh"]
    subprocess.run(["/usr/bin/python3", maker, "--side", "0.3", "--stl", files[0], "--triangles", "9", "8", "--msh", files[1], "--cells", "7", "8"], check=True,
                   stdout=subprocess.DEVNULL)
    return files


# A plate on a spring under known forces (tests/integration/stubs.h).
PLATE = """title = "plate"
dimension = 3
end = 1.0
[coupling]
scheme = "one-way"
window = 0.05
max_distance = 0.02
[[coupling.interface]]
from = "grains.box"
to = "plate.top"
[grains]
command = ["{programs}/stub_participant", "send"{send}]
[plate]
command = {command}
mass = 2.0
spring = 800.0
dashpot = 8.0
[expect]
"plate.u" = {{ value = 0, absolute = 1e9 }}
"plate.v" = {{ value = 0, absolute = 1e9 }}
"""


def stl(*triangles):
    """ASCII STL of triangles of three corners each."""
    facets = ("facet normal 0 0 1\nouter loop\n" + "".join("vertex {} {} {}\n".format(*corner) for corner in triangle) + "endloop\nendfacet\n" for triangle in triangles)
    return "solid s\n" + "".join(facets) + "endsolid s\n"


def floor(side):
    return stl([(0, 0, 0), (side, 0, 0), (side, side, 0)], [(0, 0, 0), (side, side, 0), (0, side, 0)])
