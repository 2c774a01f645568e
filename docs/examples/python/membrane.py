"""An elastic membrane on a square rim: ρ u'' = T Δu + p, pulled evenly, moving across its plane, z = 0.

    [membrane]
    command = ["/usr/bin/python3", "membrane.py"]
    tension = 100.0     # N/m
    density = 0.5       # kg/m2; 0: it follows its load without inertia
Also `side` (1.0 m) and `cells` along it (16). Its surface is "skin". Differences of second order in space, the trapezoidal rule in time (the mean
force of a window as an impulse).
"""
import numpy

import acopla


class Membrane(acopla.Participant):
    solver = "membrane"

    def __init__(self, tension, density, side=1.0, cells=16):
        self.tension, self.density, self.side, self.n = tension, density, side, cells
        self.u, self.v, self.step = numpy.zeros((cells + 1) ** 2), numpy.zeros((cells + 1) ** 2), None

    def start(self, run):
        n, at = self.n, numpy.arange((self.n + 1) ** 2).reshape(self.n + 1, self.n + 1)
        y, x = numpy.divmod(at.ravel(), n + 1)
        self.free = at[1:-1, 1:-1].ravel()
        line = 2 * numpy.eye(n - 1) - numpy.eye(n - 1, k=1) - numpy.eye(n - 1, k=-1)  # −h² d²/dx²; of forces on points, h² T Δu, h drops out
        self.stiffness = self.tension * (numpy.kron(line, numpy.eye(n - 1)) + numpy.kron(numpy.eye(n - 1), line))
        self.mass = self.density * (self.side / n) ** 2  # of each free point
        self.weight = self.mass * run.gravity[2]
        faces = numpy.column_stack([at[:-1, :-1].ravel(), at[:-1, 1:].ravel(), at[1:, 1:].ravel(), at[1:, :-1].ravel()])
        masses = self.upwards(numpy.where(numpy.isin(at.ravel(), self.free), self.mass, 0)) if self.mass else None
        return [acopla.Surface("skin", numpy.column_stack([x, y, 0 * x]) * (self.side / n), faces, mass=masses)]

    def advance(self, window, received):
        f = received["skin", "force"][self.free, 2] + self.weight
        u, v, h, k, m = self.u[self.free], self.v[self.free], window.length, self.stiffness, self.mass
        if self.step != h:  # the matrix depends on the window's length
            self.step, self.inverse = h, numpy.linalg.inv(k + 4 * m / h**2 * numpy.eye(len(u)))
        # m (v' − v) = h (f − k (u + u')/2) with u' = u + h (v + v')/2; without mass k u' = f
        moved = self.inverse @ (2 * f - k @ u + m * (4 / h**2 * u + 4 / h * v)) if m else self.inverse @ f
        self.v[self.free] = 2 * (moved - u) / h - v if m else 0
        self.u[self.free] = moved
        fields = {("skin", "displacement"): self.upwards(self.u), ("skin", "velocity"): self.upwards(self.v)}
        return acopla.Advance(fields, {"u.min": self.u.min(), "u.max": self.u.max()})

    def upwards(self, values):
        return numpy.multiply.outer(values, [0, 0, 1.0])

    def save(self):
        self.saved = self.u.copy(), self.v.copy()

    def restore(self):
        self.u, self.v = self.saved[0].copy(), self.saved[1].copy()


if __name__ == "__main__":
    table = acopla.own_table()
    acopla.serve(Membrane(**{key: table[key] for key in ("tension", "density", "side", "cells") if key in table}))
