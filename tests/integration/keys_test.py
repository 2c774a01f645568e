#!/usr/bin/env python3
"""Runs over tcp with keys: on an address that is not loopback's own, in C++ and Python, with strangers at the port.

Usage: keys_test.py FOLDER_OF_EXECUTABLES SOURCE_FOLDER [test names]
"""
import json
import os
import pathlib
import re
import shutil
import socket
import subprocess
import sys
import tempfile
import threading
import time
import unittest

BIN, SOURCE = os.path.abspath(sys.argv[1]), pathlib.Path(sys.argv[2]).resolve()
sys.path.insert(0, str(SOURCE / "protocol/python"))
import acopla  # noqa: E402
import zmq  # noqa: E402

# An address of this machine that counts as beyond loopback, as only 127.0.0.1 is taken for it.
HOST = "127.0.0.2"
CASE = """title = "keys"
dimension = 3
end = 2.0
[coupling]
scheme = "one-way"
window = 0.05
max_distance = 0.02
start_limit = 20
[[coupling.interface]]
from = "grains.box"
to = "plate.top"
[grains]
command = ["unused"]
[plate]
command = ["unused"]
mass = 2.0
spring = 800.0
[expect]
"plate.u" = { value = 0, absolute = 1e9 }
"""


class Strangers:
    """Knock in every way there is without the key, as fast as they can, until stopped; remember whatever they were answered."""

    def __init__(self, port, keys):
        self.port, self.stop, self.answers, self.knocks = port, threading.Event(), [], [0, 0, 0, 0]
        other = zmq.curve_keypair()
        hello = acopla.encode(acopla.Message("hello", {"participant": "plate", "solver": "stranger", "dimension": 3, "versions": [1, 1], "capabilities": []}))
        ways = (lambda: self.by_zmq(0, hello, None), lambda: self.by_zmq(1, hello, (other[0], other[1], keys[2])), lambda: self.by_zmq(2, hello, (*other, other[0])),
                self.by_bytes)
        self.threads = [threading.Thread(target=way) for way in ways]
        for thread in self.threads:
            thread.start()

    def by_zmq(self, way, message, keys):
        context = zmq.Context()
        while not self.stop.is_set():
            dealer = context.socket(zmq.DEALER)
            dealer.setsockopt(zmq.LINGER, 0)
            dealer.setsockopt(zmq.SNDTIMEO, 100)  # who was turned away already has nobody to send to, and would wait for ever
            if keys:
                dealer.curve_publickey, dealer.curve_secretkey, dealer.curve_serverkey = keys
            dealer.connect(f"tcp://{HOST}:{self.port}")
            self.knocks[way] += 1
            try:
                dealer.send_multipart(message)
            except zmq.Again:
                pass
            if dealer.poll(100):
                self.answers.append(dealer.recv_multipart())
            dealer.close()
        context.term()

    def by_bytes(self):
        while not self.stop.is_set():
            try:
                with socket.create_connection((HOST, self.port), timeout=1) as plain:
                    plain.sendall(b"GET / HTTP/1.1\r\n\r\n" + os.urandom(1000))
                    self.knocks[3] += 1
            except OSError:
                pass
            time.sleep(0.01)

    def end(self):
        self.stop.set()
        for thread in self.threads:
            thread.join()


class Keys(unittest.TestCase):
    def setUp(self):
        self.folder = pathlib.Path(tempfile.mkdtemp(prefix="keys-test-"))
        self.addCleanup(shutil.rmtree, self.folder, ignore_errors=True)
        (self.folder / "case.toml").write_text(CASE)
        self.keys = self.folder / "keys"
        subprocess.run([f"{BIN}/acopla", "keys", str(self.keys)], check=True, capture_output=True)
        self.processes = []
        self.addCleanup(self.kill)

    def kill(self):
        for process in self.processes:
            if process.poll() is None:
                process.kill()
            process.communicate()

    def start(self, words, **environment):
        clean = {key: value for key, value in os.environ.items() if not key.startswith("ACOPLA_")}
        process = subprocess.Popen(words, cwd=self.folder, env=clean | environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        self.processes.append(process)
        return process

    def start_coupler(self):
        coupler = self.start([f"{BIN}/acopla-coupler", "case.toml", "--bind", "tcp://0.0.0.0:*", "--keys", "keys", "--results", "results"])
        line = coupler.stdout.readline()
        return coupler, int(re.search(r"open at tcp://0.0.0.0:(\d+)", line)[1])

    def start_participants(self, port, pause="0", **environment):
        environment = {"ACOPLA_ENDPOINT": f"tcp://{HOST}:{port}", "ACOPLA_KEYS": str(self.keys), "ACOPLA_CASE": str(self.folder / "case.toml"),
                       "PYTHONPATH": str(SOURCE / "protocol/python")} | environment
        return (self.start([f"{BIN}/stub_participant", "send", "--pause", pause], ACOPLA_PARTICIPANT="grains", **environment),
                self.start(["/usr/bin/python3", str(SOURCE / "docs/examples/python/plate.py")], ACOPLA_PARTICIPANT="plate", **environment))

    def finish(self, *processes):
        for process in processes:
            out, err = process.communicate(timeout=60)
            self.assertEqual(process.returncode, 0, out + err)
        return json.loads((self.folder / "results/summary.json").read_text())["expectations"][0]["value"]

    def test_a_run_in_which_strangers_knock_is_the_run_without_them(self):
        coupler, port = self.start_coupler()
        alone = self.finish(*self.start_participants(port), coupler)
        shutil.rmtree(self.folder / "results")
        coupler, port = self.start_coupler()
        strangers = Strangers(port, acopla.read_keys(str(self.keys)))
        self.addCleanup(strangers.end)
        time.sleep(0.5)  # they come first, and in the name of one who is still to come
        participants = self.start_participants(port, pause="50")
        disturbed = self.finish(*participants, coupler)
        strangers.end()
        self.assertGreater(min(strangers.knocks), 5, strangers.knocks)
        self.assertEqual(strangers.answers, [])
        self.assertEqual(disturbed, alone)
        self.assertNotEqual(alone, 0)

    def test_without_keys_an_address_beyond_loopback_is_refused_on_both_sides(self):
        for words in ([f"{BIN}/acopla-coupler", "case.toml", "--bind", "tcp://0.0.0.0:*", "--results", "results"],
                      [f"{BIN}/stub_participant", "send"], ["/usr/bin/python3", str(SOURCE / "docs/examples/python/plate.py")]):
            process = self.start(words, ACOPLA_ENDPOINT=f"tcp://{HOST}:5555", ACOPLA_PARTICIPANT="plate", ACOPLA_CASE=str(self.folder / "case.toml"),
                                 PYTHONPATH=str(SOURCE / "protocol/python"))
            out, err = process.communicate(timeout=20)
            self.assertEqual(process.returncode, 2, out + err)
            self.assertIn("tcp is open to loopback only", err)
            self.assertIn("acopla keys DIR", err)

    def test_keys_are_made_once_and_readable_by_their_user_alone(self):
        for name in ("coupler.keys", "participant.keys"):
            self.assertEqual((self.keys / name).stat().st_mode & 0o777, 0o600)
        self.assertEqual(self.keys.stat().st_mode & 0o777, 0o700)
        again = subprocess.run([f"{BIN}/acopla", "keys", str(self.keys)], capture_output=True, text=True)
        self.assertEqual(again.returncode, 2)
        self.assertIn("coupler.keys: exists already", again.stderr)
        lines = (self.keys / "participant.keys").read_text().splitlines()
        other = (self.keys / "coupler.keys").read_text().splitlines()
        self.assertEqual(lines[3].split()[1], other[1].split()[1])  # the participants know the coupler,
        self.assertEqual(lines[1].split()[1], other[3].split()[1])  # and it them

    def test_key_files_that_are_missing_open_to_others_or_damaged_are_named(self):
        def coupler():
            process = self.start([f"{BIN}/acopla-coupler", "case.toml", "--bind", "tcp://0.0.0.0:*", "--keys", "keys", "--results", f"results{time.monotonic()}"])
            _, err = process.communicate(timeout=20)
            self.assertEqual(process.returncode, 2)
            return err

        path = self.keys / "coupler.keys"
        path.chmod(0o644)
        self.assertIn("coupler.keys: may be read by others. Use chmod 600", coupler())
        path.chmod(0o600)
        path.write_text(path.read_text().replace("secret", "sacred"))
        self.assertIn('coupler.keys: holds no key "secret"', coupler())
        path.unlink()
        self.assertIn("coupler.keys: cannot be read. Make keys by `acopla keys DIR`", coupler())
        with self.assertRaisesRegex(acopla.UserMistake, "participant.keys: may be read by others"):
            (self.keys / "participant.keys").chmod(0o640)
            acopla.read_keys(str(self.keys))


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1] + sys.argv[3:])
