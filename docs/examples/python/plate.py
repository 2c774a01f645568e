"""A rigid square plate that moves up and down on a spring: m u'' = F + m g − k u − c u'.

    [plate]
    command = ["/usr/bin/python3", "plate.py"]
    mass = 2.0          # kg
    spring = 800.0      # N/m
    dashpot = 0.0       # N s/m; default 0
    side = 1.0          # m; its corner is at the origin; default 1

Its surface is "top". The motion is exact under a force that is constant in a window, which is what the protocol's mean force is.
"""
import cmath
import math

import acopla


class Plate(acopla.Participant):
    solver = "plate"

    def __init__(self, mass, spring, dashpot=0.0, side=1.0):
        self.m, self.k, self.c, self.side = mass, spring, dashpot, side
        self.u = self.v = 0.0

    def start(self, run):
        self.weight = self.m * run.gravity[2]
        a = self.side
        points = [(0, 0, 0), (a, 0, 0), (a, a, 0), (0, a, 0)]
        # A force on one corner alone accelerates a quarter of a body that cannot turn.
        return [acopla.Surface("top", points, [(0, 1, 2, 3)], mass=[(0, 0, self.m / 4)] * 4)]

    def advance(self, window, received):
        force, h = received["top", "force"].sum(axis=0)[2], window.length
        rest = (force + self.weight) / self.k
        decay, w = self.c / (2 * self.m), cmath.sqrt(self.k / self.m - (self.c / (2 * self.m)) ** 2)
        cosine, sine = cmath.cos(w * h).real, (cmath.sin(w * h) / w).real if w else h  # overdamped where w is imaginary
        d, v, shrink = self.u - rest, self.v, math.exp(-decay * h)
        self.u = rest + shrink * (d * cosine + (v + decay * d) * sine)
        self.v = shrink * (v * cosine - (decay * v + self.k / self.m * d) * sine)
        fields = {("top", "displacement"): [(0, 0, self.u)] * 4, ("top", "velocity"): [(0, 0, self.v)] * 4}
        return acopla.Advance(fields, {"u": self.u, "v": self.v, "reaction.z": -self.k * self.u - self.c * self.v})

    def save(self):
        self.saved = self.u, self.v

    def restore(self):
        self.u, self.v = self.saved


if __name__ == "__main__":
    table = acopla.own_table()
    acopla.serve(Plate(table["mass"], table["spring"], table.get("dashpot", 0.0), table.get("side", 1.0)))
