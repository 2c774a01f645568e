"""One half of two masses on three springs:  wall –k– (m) –κ– (m) –k– wall, with k = 4π² N/m, κ = 16π² N/m, m = 1 kg.

    [left]
    command = ["/usr/bin/python3", "oscillator_half.py"]
    u = 1.0             # m, at the start; default 0
From (1, 0) at rest the masses swing as u = ½ (cos 2πt ± cos 6πt). The half that the case lets send `force` owns the spring in the middle and takes
many steps in a window; the other answers with its motion. The surface of either, "end", is a triangle that moves as a whole, along x."""
import numpy

import acopla


class Half(acopla.Participant):
    solver = "oscillator"

    def __init__(self, u=0.0, v=0.0, mass=1.0, wall=4 * numpy.pi**2, middle=16 * numpy.pi**2, steps=32):
        self.u, self.v, self.m, self.wall, self.middle, self.steps = u, v, mass, wall, middle, steps

    def start(self, run):
        self.sends_force = any("force" in use.sends for use in run.uses)
        return [acopla.Surface("end", [(0, 0, 0), (1, 0, 0), (0, 1, 0)], [(0, 1, 2)], displacement=[(self.u, 0, 0)] * 3, velocity=[(self.v, 0, 0)] * 3)]

    def advance(self, window, received):
        fields, steps = self.pull(window, received) if self.sends_force else self.follow(window, received)
        return acopla.Advance(fields, {"u": self.u, "v": self.v}, steps)

    def follow(self, window, received):
        """The trapezoidal rule under the mean force, its acceleration anew from that force."""
        h, force, wall = window.length, received["end", "force"].sum(axis=0)[0], self.wall
        a = (force - wall * self.u) / self.m
        u = (self.u + h * self.v + h * h / 4 * (a + force / self.m)) / (1 + h * h / 4 * wall / self.m)
        self.u, self.v = u, self.v + h / 2 * (a + (force - wall * u) / self.m)
        return {("end", "displacement"): [(self.u, 0, 0)] * 3, ("end", "velocity"): [(self.v, 0, 0)] * 3}, 1

    def pull(self, window, received):
        """The midpoint rule in small steps; the other follows Hermite's cubic, a straight line where its end is not known."""
        mean = {name: values.mean(axis=0)[0] for (surface, name), values in received.items()}
        h, d, v = window.length, mean["displacement"], mean["velocity"]
        d_end, v_end = mean.get("end_displacement", d + h * v), mean.get("end_velocity", v)

        def rate(s, state):  # of u, v and the impulse on the other
            force = self.middle * (state[0] - d - s * s * (3 - 2 * s) * (d_end - d) - h * s * (1 - s) * (v * (1 - s) - v_end * s))
            return numpy.array([state[1], (-self.wall * state[0] - force) / self.m, force])

        state, n = numpy.array([self.u, self.v, 0.0]), self.steps
        for k in range(n):
            state = state + h / n * rate((k + 0.5) / n, state + h / n / 2 * rate(k / n, state))
        self.u, self.v, impulse = map(float, state)
        return {("end", "force"): [(impulse / h / 3, 0, 0)] * 3}, n

    def save(self):
        self.saved = self.u, self.v

    def restore(self):
        self.u, self.v = self.saved


if __name__ == "__main__":
    acopla.serve(Half(**{key: value for key, value in acopla.own_table().items() if key != "command"}))
