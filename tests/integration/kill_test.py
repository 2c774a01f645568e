#!/usr/bin/python3
"""Ends the processes of a run in every way there is, and looks at what the launcher says and leaves behind.

Usage: kill_test.py FOLDER_OF_EXECUTABLES [test names].
"""

import json
import os
import resource
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import time
import unittest

import h5py
import numpy

BIN = os.path.abspath(sys.argv[1])
# Bounds are on top of what the design promises, for machines that are busy with other things.
SLACK = float(os.environ.get("ACOPLA_TEST_SLACK", "3"))

CASE = """title = "kill test"
dimension = 3
end = {end}
[coupling]
scheme = "one-way"
window = 0.05
max_distance = 0.02
start_limit = {start_limit}
[[coupling.interface]]
from = "grains.box"
to = "structure.inside"
[grains]
command = ["{bin}/stub_participant", "send", {send}, "--tag", "{folder}"]
{grains}
[structure]
command = ["{bin}/stub_participant", "receive", {receive}, "--tag", "{folder}"]
{structure}
"""


def processes_with(text):
    """Pids of all processes whose command line holds the text, zombies left out."""
    found = {}
    for entry in os.listdir("/proc"):
        if not entry.isdigit() or int(entry) == os.getpid():
            continue
        try:
            with open(f"/proc/{entry}/cmdline", "rb") as stream:
                words = stream.read().decode(errors="replace").split("\0")
            with open(f"/proc/{entry}/stat") as stream:
                state = stream.read().rsplit(")", 1)[1].split()[0]
        except OSError:
            continue
        if state != "Z" and any(text in word for word in words):
            found[int(entry)] = words
    return found


class Run:
    """A run of `acopla run` on two stubs in a folder of its own."""

    def __init__(self, pause=20, end=100.0, start_limit=60, send="", receive="", grains="", structure="", results=None, preexec=None):
        self.folder = tempfile.mkdtemp(prefix="kill-test-")
        quoted = lambda words: ", ".join(f'"{w}"' for w in ["--pause", str(pause)] + words.split())
        with open(f"{self.folder}/case.toml", "w") as stream:
            stream.write(CASE.format(bin=BIN, folder=self.folder, end=end, start_limit=start_limit, send=quoted(send),
                                     receive=quoted(receive), grains=grains, structure=structure))
        self.results = results or f"{self.folder}/results"
        self.begin = time.monotonic()
        self.process = subprocess.Popen(
            [f"{BIN}/acopla", "run", f"{self.folder}/case.toml", "--results", self.results], cwd=self.folder,
            stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True, preexec_fn=preexec)

    def pid(self, who):
        """Waits until the process is there. who: coupler, send, receive or launcher."""
        if who == "launcher":
            return self.process.pid
        wanted = {"coupler": "/acopla-coupler", "send": "send", "receive": "receive"}[who]
        for _ in range(400):
            for pid, words in processes_with(self.folder).items():
                if words[0].endswith(wanted) or (len(words) > 1 and words[0].endswith("stub_participant") and words[1] == wanted):
                    return pid
            time.sleep(0.01)
        raise AssertionError(f"{who} never started")

    def wait_for_windows(self):
        """Until some windows are recorded."""
        for _ in range(1000):
            pictures = f"{self.results}/surfaces"
            log = f"{self.results}/interface.h5"
            if os.path.exists(log) and os.path.getsize(log) > 4000 and os.path.isdir(pictures):
                time.sleep(0.3)
                return
            if self.process.poll() is not None:
                return
            time.sleep(0.01)

    def strike(self, who, number):
        target = self.pid(who)
        self.wait_for_windows()
        os.kill(target, number)
        self.begin = time.monotonic()

    def end(self, timeout=30):
        self.out, self.err = self.process.communicate(timeout=timeout)
        self.seconds = time.monotonic() - self.begin
        return self.process.returncode

    def summary(self):
        with open(f"{self.results}/summary.json") as stream:
            return json.load(stream)

    def remove(self):
        for pid in processes_with(self.folder):
            os.kill(pid, signal.SIGKILL)
        shutil.rmtree(self.folder, ignore_errors=True)


class KillTest(unittest.TestCase):
    def start(self, **options):
        run = Run(**options)
        self.addCleanup(run.remove)
        return run

    def assert_nothing_left(self, run, within=1.0):
        until = time.monotonic() + within * SLACK
        while time.monotonic() < until and processes_with(run.folder):
            time.sleep(0.02)
        self.assertEqual(processes_with(run.folder), {}, "processes are left")
        pid = run.process.pid
        while time.monotonic() < until and [n for n in os.listdir("/tmp") if n.startswith(f"acopla-{pid}-")]:
            time.sleep(0.02)
        self.assertEqual([n for n in os.listdir("/tmp") if n.startswith(f"acopla-{pid}-")], [], "the socket's folder is left")

    def assert_readable(self, run):
        if os.path.exists(f"{run.results}/interface.h5"):
            with h5py.File(f"{run.results}/interface.h5") as record:
                self.assertIn("grains.box", record)
                self.assertEqual(record["grains.box/force"].shape[0], record["windows"].shape[0])
                self.assertTrue(numpy.isfinite(record["grains.box/force"][...]).all())

    def assert_failed(self, run, code, participant, words, seconds, status="failed", reached=True):
        self.assertEqual(run.end(), code, run.err)
        for word in [words] if isinstance(words, str) else words:
            self.assertIn(word, run.err)
        self.assertLess(run.seconds, seconds + SLACK)
        summary = run.summary()
        self.assertEqual(summary["status"], status)
        self.assertEqual(summary["error"]["participant"], participant)
        if reached:
            self.assertGreater(summary["time"]["windows"], 0)
            self.assertIn("Results up to", run.err)
        self.assert_nothing_left(run)
        self.assert_readable(run)
        if not reached or "the coupler (acopla-coupler)" in run.err:
            return  # there is none, or it went with some windows that were not written yet
        with h5py.File(f"{run.results}/interface.h5") as record:
            self.assertEqual(len(record["windows"]), summary["time"]["windows"], "the summary counts what the record holds")

    # --- exits are seen at once, and named ---

    def test_sender_killed(self):
        run = self.start()
        run.strike("send", signal.SIGKILL)
        self.assert_failed(run, 1, "grains", ["grains (stub_participant) was killed by signal 9 (Killed)", "while advancing from",
                                              "Its last words", "the stub has started"], 1.5)

    def test_receiver_killed(self):
        run = self.start()
        run.strike("receive", signal.SIGKILL)
        self.assert_failed(run, 1, "structure", "structure (stub_participant) was killed by signal 9 (Killed)", 1.5)

    def test_coupler_killed(self):
        run = self.start()
        run.strike("coupler", signal.SIGKILL)
        self.assert_failed(run, 1, "coupler", "the coupler (acopla-coupler) was killed by signal 9 (Killed) after window", 1.5)

    def test_launcher_killed(self):
        run = self.start()
        run.strike("launcher", signal.SIGKILL)
        self.assertEqual(run.end(), -signal.SIGKILL)
        self.assert_nothing_left(run)
        self.assert_readable(run)

    def test_launcher_and_guard_killed(self):
        run = self.start()
        run.pid("send")
        run.wait_for_windows()
        for pid, words in processes_with(run.folder).items():
            if words[0].endswith("/acopla"):
                os.kill(pid, signal.SIGKILL)
        run.end()
        until = time.monotonic() + SLACK
        while time.monotonic() < until and processes_with(run.folder):
            time.sleep(0.02)
        self.assertEqual(processes_with(run.folder), {})
        # The socket's folder is cleaned by the next run.
        after = self.start(end=0.1)
        self.assertEqual(after.end(), 0, after.err)
        self.assertEqual([n for n in os.listdir("/tmp") if n.startswith(f"acopla-{run.process.pid}-")], [])

    def test_sender_ends_by_itself(self):
        run = self.start(send="--at 10 --do die")
        self.assert_failed(run, 1, "grains", "grains (stub_participant) ended with exit code 7 while advancing from 0.5 s to 0.55 s", 4)

    def test_exception(self):
        run = self.start(receive="--at 10 --do exception")
        self.assert_failed(run, 1, "structure", "structure (stub_participant) failed while advancing from 0.5 s to 0.55 s: "
                                                "the stub was told to fail", 4)

    def test_user_error_is_verbatim(self):
        run = self.start(receive="--at 3 --do user_error")
        self.assert_failed(run, 2, "structure", "case.toml:7:3: stub.key = 3 is wrong. Use 4.\n", 4)
        self.assertTrue(run.err.startswith("case.toml:7:3: stub.key = 3 is wrong. Use 4.\n"), run.err)

    def test_ends_before_hello(self):
        run = self.start(structure="")
        with open(f"{run.folder}/case.toml") as stream:
            text = stream.read()
        run.process.terminate()
        run.end()
        with open(f"{run.folder}/case.toml", "w") as stream:
            stream.write(text.replace(f'"{BIN}/stub_participant", "receive"', '"sh", "-c", "echo bad luck; exit 4"'))
        again = subprocess.run([f"{BIN}/acopla", "run", "case.toml", "--results", "again"], cwd=run.folder, capture_output=True, text=True)
        self.assertEqual(again.returncode, 1)
        self.assertIn("structure (sh) ended with exit code 4 while not connected", again.stderr)
        self.assertIn("bad luck", again.stderr)
        self.assert_nothing_left(run)

    # --- freezes are seen by missed pings within two seconds ---

    def test_sender_frozen(self):
        run = self.start()
        run.strike("send", signal.SIGSTOP)
        self.assert_failed(run, 1, "grains", ["grains (stub_participant)", "frozen"], 2 + 1)

    def test_receiver_frozen(self):
        run = self.start()
        run.strike("receive", signal.SIGSTOP)
        self.assert_failed(run, 1, "structure", ["structure (stub_participant)", "frozen"], 2 + 1)

    def test_coupler_frozen(self):
        run = self.start()
        run.strike("coupler", signal.SIGSTOP)
        self.assert_failed(run, 1, "coupler", "the coupler (acopla-coupler)", 2 + 1)

    def test_launcher_stopped_and_continued(self):
        run = self.start(end=2.0)
        run.strike("launcher", signal.SIGSTOP)
        time.sleep(3)
        os.kill(run.process.pid, signal.SIGCONT)
        self.assertEqual(run.end(), 0, run.err)
        self.assert_nothing_left(run)

    def test_short_stop_is_forgiven(self):
        run = self.start(end=2.0)
        run.strike("send", signal.SIGSTOP)
        time.sleep(0.4)
        os.kill(run.pid("send"), signal.SIGCONT)
        self.assertEqual(run.end(), 0, run.err)

    # --- a process that lives but does nothing ---

    def test_no_progress(self):
        run = self.start(receive="--at 5 --do hang", structure="advance_limit = 1.0")
        self.assert_failed(run, 1, "structure", "structure (stub_participant) lives but made no progress for 1 s (its advance_limit) "
                                                "while advancing from 0.25 s to 0.3 s", 4)

    def test_long_window_is_no_freeze(self):
        run = self.start(pause=3000, end=0.05)
        self.assertEqual(run.end(), 0, run.err)

    def test_never_says_hello(self):
        run = self.start(receive="--never", start_limit=1.5)
        self.assert_failed(run, 1, "structure", "structure (stub_participant) did not say hello within 1.5 s", 4, reached=False)

    def test_no_such_program(self):
        run = self.start()
        run.process.kill()
        run.end()
        path = f"{run.folder}/case.toml"
        with open(path) as stream:
            text = stream.read()
        with open(path, "w") as stream:
            stream.write(text.replace("stub_participant", "stub_particpant"))
        again = subprocess.run([f"{BIN}/acopla", "run", "case.toml"], cwd=run.folder, capture_output=True, text=True)
        self.assertEqual(again.returncode, 2)
        self.assertIn("case.toml:12:1: grains.command names", again.stderr)
        self.assertFalse(os.path.exists(f"{run.folder}/results/{os.path.basename(run.folder)}-001"))

    # --- the user ends it ---

    def test_interrupt(self):
        for number in (signal.SIGINT, signal.SIGTERM):
            run = self.start()
            run.strike("launcher", number)
            self.assertEqual(run.end(), 130, run.err)
            self.assertLess(run.seconds, 2 + SLACK)
            summary = run.summary()
            self.assertEqual(summary["status"], "interrupted")
            self.assertGreater(summary["time"]["windows"], 0)
            self.assert_nothing_left(run)
            self.assert_readable(run)

    def test_interrupt_with_everybody_frozen(self):
        run = self.start()
        for who in ("send", "receive", "coupler"):
            os.kill(run.pid(who), signal.SIGSTOP)
        os.kill(run.process.pid, signal.SIGINT)
        run.begin = time.monotonic()
        self.assertEqual(run.end(), 130, run.err)
        self.assertEqual(run.summary()["status"], "interrupted")
        self.assert_nothing_left(run)

    # --- results and addresses ---

    def test_full_disk(self):
        # Files of 200 KB at most stand for it: writing beyond fails in every process.
        def little_room():
            signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
            resource.setrlimit(resource.RLIMIT_FSIZE, (200_000, 200_000))
        run = self.start(pause=1, preexec=little_room)
        self.assert_failed(run, 2, "coupler", ["interface.h5: ", "cannot be written. Check the free space of the results folder."], 20)

    def test_existing_results_are_refused(self):
        folder = tempfile.mkdtemp(prefix="kill-test-results-")
        self.addCleanup(shutil.rmtree, folder, True)
        run = self.start(results=folder)
        self.assertEqual(run.end(), 2)
        self.assertIn("exists. Results are never overwritten", run.err)
        self.assertEqual(os.listdir(folder), [])
        self.assert_nothing_left(run)

    def test_garbage_at_the_socket_does_not_matter(self):
        run = self.start(end=3.0)
        run.pid("coupler")
        run.wait_for_windows()
        folder = [n for n in os.listdir("/tmp") if n.startswith(f"acopla-{run.process.pid}-")][0]
        generator = __import__("random").Random(7)
        for name in ("hub", "hub.pulse"):
            for size in (0, 1, 9, 64, 65, 1000, 100000):
                with socket.socket(socket.AF_UNIX) as stranger:
                    stranger.settimeout(1)
                    stranger.connect(f"/tmp/{folder}/{name}")
                    try:
                        stranger.sendall(bytes(generator.randrange(256) for _ in range(size)))
                    except OSError:
                        pass
        self.assertEqual(run.end(), 0, run.err)
        self.assertEqual(run.summary()["status"], "met")

    def test_socket_in_use(self):
        folder = tempfile.mkdtemp(prefix="kill-test-port-")
        self.addCleanup(shutil.rmtree, folder, True)
        holder = socket.socket(socket.AF_INET)
        self.addCleanup(holder.close)
        holder.bind(("127.0.0.1", 0))
        holder.listen()
        run = self.start(end=0.1)
        run.end()
        address = f"tcp://127.0.0.1:{holder.getsockname()[1]}"
        coupler = subprocess.run([f"{BIN}/acopla-coupler", f"{run.folder}/case.toml", "--bind", address], cwd=folder,
                                 capture_output=True, text=True, timeout=20)
        self.assertEqual(coupler.returncode, 2)
        self.assertIn(f"{address} is in use", coupler.stderr)

    def test_other_exit_codes(self):
        run = self.start(end=0.1)
        self.assertEqual(run.end(), 0, run.err)
        with open(f"{run.folder}/case.toml", "a") as stream:
            stream.write('[expect]\n"structure.reaction.z" = { value = 1.0, relative = 1e-3 }\n')
        missed = subprocess.run([f"{BIN}/acopla", "run", "case.toml", "--results", "missed"], cwd=run.folder, capture_output=True, text=True)
        self.assertEqual(missed.returncode, 3, missed.stderr)
        self.assertIn("MISSED", missed.stdout)
        replayed = subprocess.run([f"{BIN}/acopla", "replay", "missed", "case.toml", "--results", "replayed"], cwd=run.folder,
                                  capture_output=True, text=True)
        self.assertEqual(replayed.returncode, 3, replayed.stderr)
        values = []
        for name in ("missed", "replayed"):
            with open(f"{run.folder}/{name}/summary.json") as stream:
                values.append(json.load(stream)["expectations"][0]["value"])
        self.assertEqual(values[0], values[1])


if __name__ == "__main__":
    unittest.main(argv=[sys.argv[0]] + sys.argv[2:], verbosity=2)
