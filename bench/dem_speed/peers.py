"""LAMMPS and LIGGGHTS on the bed: each settles it once, then waits for its turns of 1000 timed steps (turn.sh)."""
import os
import re
import shutil
import subprocess
import sys
import time

PROGRAMS = {"LAMMPS": ("lmp", "lammps"), "LIGGGHTS": ("liggghts", "liggghts")}


class Peer:
    """A running peer. changes: pairs of old and new text of its deck."""

    def __init__(self, study, name, rounds, particles, changes):
        program, deck = PROGRAMS[name]
        self.name, self.deck, self.rounds, self.particles = name, deck, rounds, particles
        self.folder = study.work / deck
        self.folder.mkdir()
        source = study.root / "bench" / "dem_speed"
        text = (source / f"{deck}.in").read_text()
        for old, new in changes:
            assert old in text, (deck, old)
            text = text.replace(old, new)
        (self.folder / f"{deck}.in").write_text(text)
        shutil.copy(source / "turn.sh", self.folder)
        environment = dict(os.environ, OMP_NUM_THREADS="1", OMPI_ALLOW_RUN_AS_ROOT="1", OMPI_ALLOW_RUN_AS_ROOT_CONFIRM="1", ACOPLA_TURNS="1")
        command = ["mpirun", "--bind-to", "none", "--oversubscribe", "-np", "1", program, "-in", f"{deck}.in", "-var", "procs", "1",
                   "-var", "rounds", str(rounds)]
        self.log = open(self.folder / "out", "w+")
        self.process = subprocess.Popen(command, cwd=self.folder, env=environment, stdin=subprocess.DEVNULL, stdout=self.log, stderr=self.log)

    @staticmethod
    def start(study, name, rounds, particles, changes):
        """None where the program is not installed."""
        return Peer(study, name, rounds, particles, changes) if shutil.which(PROGRAMS[name][0]) else None

    def wait(self, turn):
        """Returns when the peer waits for this turn, or, after the last one, has ended."""
        while not (self.folder / f"waiting-{self.deck}-{turn}").exists():
            if self.process.poll() is not None:
                if turn > self.rounds and self.process.returncode == 0:
                    return
                sys.exit(f"{self.name} ended with {self.process.returncode}:\n{self.text()[-3000:]}")
            time.sleep(0.02)

    def turn(self, turn):
        """Million particle-steps a second of its next 1000 steps."""
        self.wait(turn)
        (self.folder / f"go-{self.deck}-{turn}").write_text("go\n")
        self.wait(turn + 1)
        return self.timed()[-1]

    def text(self):
        self.log.flush()
        return (self.folder / "out").read_text()

    def timed(self):
        runs = re.findall(r"Loop time of (\S+) on .* for (\d+) steps with (\d+) atoms", self.text())[1:]
        assert all(int(atoms) >= 0.99 * self.particles for _, _, atoms in runs), runs  # none may have been lost on the way
        return [int(atoms) * int(steps) / float(seconds) / 1e6 for seconds, steps, atoms in runs if int(steps) > 0]

    def pairs(self):
        """Touching pairs, listed pairs and particles at the end, once it has ended."""
        self.process.wait()
        text = self.text()
        atoms, touching = re.findall(r"^ *\d+ +(\d+) +(\d+) *$", text, re.M)[-1]
        return {"particles": int(atoms), "touching": int(touching) // 2, "listed": int(re.findall(r"Total # of neighbors = (\d+)", text)[-1])}
