"""One half of two masses on three springs:  wall –k– (m) –κ– (m) –k– wall, with k = 4π² N/m, κ = 16π² N/m, m = 1 kg.

    [left]
    command = ["/usr/bin/python3", "oscillator_half.py"]
    u = 1.0             # m, at the start; default 0

From (1, 0) at rest the masses swing as u = ½ (cos 2πt ± cos 6πt). Either half takes either side of the coupling, which the case chooses:
the one that sends `force` owns the spring in the middle and takes many steps in a window; the other answers with its motion. The surface
is "end" of either: a triangle that moves as a whole, along x.
"""
import math

import numpy

import acopla


class Half(acopla.Participant):
    solver = "oscillator"

    def __init__(self, u=0.0, v=0.0, mass=1.0, wall=4 * math.pi**2, middle=16 * math.pi**2, steps=32):
        self.u, self.v, self.m, self.wall, self.middle, self.steps = u, v, mass, wall, middle, steps

    def start(self, run):
        self.sends_force = any("force" in use.sends for use in run.uses)
        along_x = [(1, 0, 0)] * 3
        return [acopla.Surface("end", [(0, 0, 0), (1, 0, 0), (0, 1, 0)], [(0, 1, 2)], displacement=numpy.multiply(self.u, along_x),
                               velocity=numpy.multiply(self.v, along_x))]

    def advance(self, window, received):
        fields = self.pull(window, received) if self.sends_force else self.follow(window, received)
        return acopla.Advance(fields, {"u": self.u, "v": self.v}, self.steps if self.sends_force else 1)

    def follow(self, window, received):
        """The trapezoidal rule under the mean force, its acceleration anew from that force."""
        h, force, wall = window.length, received["end", "force"].sum(axis=0)[0], self.wall
        a = (force - wall * self.u) / self.m
        u = (self.u + h * self.v + h * h / 4 * (a + force / self.m)) / (1 + h * h / 4 * wall / self.m)
        self.v += h / 2 * (a + (force - wall * u) / self.m)
        self.u = u
        return {("end", "displacement"): [(self.u, 0, 0)] * 3, ("end", "velocity"): [(self.v, 0, 0)] * 3}

    def pull(self, window, received):
        """The classic Runge–Kutta method in small steps; the force is its mean over the window."""
        h, n = window.length, self.steps
        d0, v0 = (received["end", name].mean(axis=0)[0] for name in ("displacement", "velocity"))
        d1, v1 = (received[key].mean(axis=0)[0] if (key := ("end", name)) in received else None for name in ("end_displacement", "end_velocity"))

        def other(s):  # a straight line from the window's start or, between both ends, Hermite's cubic
            if d1 is None:
                return d0 + s * h * v0
            return d0 * (1 + s * s * (2 * s - 3)) + d1 * s * s * (3 - 2 * s) + h * (v0 * s * (s - 1) ** 2 + v1 * s * s * (s - 1))

        def rate(state, s):  # of u, v and the impulse on the other
            force = self.middle * (state[0] - other(s))
            return numpy.array([state[1], (-self.wall * state[0] - force) / self.m, force])

        state, dt = numpy.array([self.u, self.v, 0.0]), h / n
        for k in range(n):
            a = rate(state, k / n)
            b = rate(state + dt / 2 * a, (k + 0.5) / n)
            c = rate(state + dt / 2 * b, (k + 0.5) / n)
            state = state + dt / 6 * (a + 2 * b + 2 * c + rate(state + dt * c, (k + 1) / n))
        self.u, self.v = float(state[0]), float(state[1])
        return {("end", "force"): [(state[2] / h / 3, 0, 0)] * 3}

    def save(self):
        self.saved = self.u, self.v

    def restore(self):
        self.u, self.v = self.saved


if __name__ == "__main__":
    table = acopla.own_table()
    acopla.serve(Half(**{key: table[key] for key in ("u", "v", "mass", "wall", "middle", "steps") if key in table}))
