#!/usr/bin/env python3
"""The codec of the Python client against that of C++ and against the worked example of docs/protocol.md.

Usage: python_codec_test.py PATH_OF_CODEC_ECHO SOURCE_FOLDER [test names]
"""
import pathlib
import random
import re
import struct
import subprocess
import sys
import unittest

ECHO, SOURCE = sys.argv[1], pathlib.Path(sys.argv[2])
sys.path.insert(0, str(SOURCE / "protocol/python"))
import acopla  # noqa: E402
import msgpack  # noqa: E402
import numpy  # noqa: E402


class Echo:
    """The C++ codec: frames in, frames or the reason of a refusal out."""

    def __init__(self):
        self.process = subprocess.Popen([ECHO], stdin=subprocess.PIPE, stdout=subprocess.PIPE)

    def __call__(self, frames):
        pipe = self.process.stdin
        pipe.write(struct.pack("<I", len(frames)) + b"".join(struct.pack("<I", len(frame)) + frame for frame in frames))
        pipe.flush()
        count = self._count()
        return [self._bytes() for _ in range(count)] if count else self._bytes().decode()

    def _count(self):
        return struct.unpack("<I", self.process.stdout.read(4))[0]

    def _bytes(self):
        return self.process.stdout.read(self._count())

    def close(self):
        self.process.stdin.close()
        self.process.wait()
        self.process.stdout.close()


def header(**changed):
    return msgpack.packb({"acopla": 1, "kind": "ping", "sequence": 0, "body": {}, "arrays": []} | changed)


def array(**changed):
    return header(arrays=[{"name": "force", "mesh": "box", "type": "f8", "shape": [1, 3]} | changed])


def nested(depth):
    value = 1
    for _ in range(depth):
        value = [value]
    return value


REFUSED = {
    "nothing": [], "an empty header": [b""], "garbage": [b"\xff\x00garbage"], "no map": [msgpack.packb([1, 2])],
    "bytes after the header": [header() + b"\xc0"], "a truncated header": [header()[:-1]], "no kind": [msgpack.packb({"acopla": 1})],
    "an unknown kind": [header(kind="explode")], "another version": [header(acopla=2)], "a negative version": [header(acopla=-1)],
    "a sequence that is no count": [header(sequence=1.0)], "a negative sequence": [header(sequence=-1)], "a boolean sequence": [header(sequence=True)],
    "a body that is a list": [header(body=[])], "a key that is no text": [header(body={1: 2})],
    "a key twice": [b"\x85" + header()[1:-8] + msgpack.packb("kind") + msgpack.packb("ping")],
    "binary values": [header(body={"x": b"\x00"})], "empty binary values": [header(body={"x": b""})],
    "extension types": [header(body={"x": msgpack.ExtType(5, b"a")})], "times": [header(body={"x": msgpack.Timestamp(1)})],
    "a deep header": [header(body={"x": nested(20)})], "a very deep header": [header(body={"x": nested(400)})],
    "a long list": [header(body={"x": [0] * 65537})], "a huge header": [header(body={"x": "a" * (1 << 20)})],
    "a list that promises four billion": [b"\x85" + msgpack.packb("body") + b"\xdd\xff\xff\xff\xff"],
    "text that is not UTF-8": [header(body={"x": "ab"}).replace(b"ab", b"\xc3(")], "a surrogate": [header(body={"x": "abc"}).replace(b"abc", b"\xed\xa0\x80")],
    "an overlong form": [header(body={"x": "ab"}).replace(b"ab", b"\xc0\xaf")], "a character beyond Unicode": [header(body={"x": "abcd"}).replace(b"abcd", b"\xf4\x90\x80\x80")],
    "a frame without an entry": [header(), b"12345678"], "an entry without a frame": [array()],
    "too few bytes": [array(), bytes(23)], "too many bytes": [array(), bytes(25)], "an unknown type": [array(type="f4"), bytes(12)],
    "a negative shape": [array(shape=[-1, 3]), b""], "a shape of floats": [array(shape=[1.0, 3]), bytes(24)],
    "an impossible shape": [array(shape=[1 << 60, 1 << 60]), b""], "an impossible shape of nothing": [array(shape=[0, 1 << 62, 1 << 62]), b""],
    "a shape of 33 extents": [array(shape=[1] * 33), bytes(8)],
    "an entry that is no map": [header(arrays=[7]), b""], "too many arrays": [header(arrays=[{}] * 1025)] + [b""] * 1025,
}


class PythonCodec(unittest.TestCase):
    def setUp(self):
        self.echo = Echo()
        self.addCleanup(self.echo.close)

    def random_value(self, dice, depth=0):
        sorts = [None, True, False, dice.randint(-2**63, -1), dice.randint(0, 2**64 - 1), dice.uniform(-1e300, 1e300), 5e-324, float("inf"),
                 "Σ F = 0", "", "x" * dice.randint(0, 300)]
        choice = dice.randint(0, len(sorts) + (1 if depth < 6 else -1))
        if choice < len(sorts):
            return sorts[choice]
        size = dice.choice([0, 1, 3, 20 if depth < 2 else 2])
        if choice == len(sorts):
            return [self.random_value(dice, depth + 1) for _ in range(size)]
        return {f"key {k}": self.random_value(dice, depth + 1) for k in range(size)}

    def random_message(self, dice):
        message = acopla.Message(dice.choice(acopla.KINDS), {f"k{k}": self.random_value(dice) for k in range(dice.randint(0, 5))},
                                 dice.randint(0, 2**64 - 1))
        for k in range(dice.randint(0, 4)):
            shape = [dice.randint(0, 5) for _ in range(dice.randint(0, 3))]
            kind = dice.choice(list(acopla.TYPES.values()))
            values = numpy.frombuffer(dice.randbytes(kind.itemsize * int(numpy.prod(shape, dtype=int))), kind).reshape(shape)
            message.arrays.append(acopla.Array(f"field {k}", "box", values))
        return message

    def test_messages_come_back_bit_for_bit(self):
        dice = random.Random(1)
        for _ in range(500):
            sent = self.random_message(dice)
            frames = self.echo(acopla.encode(sent))
            self.assertIsInstance(frames, list, frames)
            back = acopla.decode(frames)
            self.assertEqual((back.kind, back.sequence, back.body), (sent.kind, sent.sequence, sent.body))
            self.assertEqual([(a.name, a.mesh, a.values.dtype, a.values.shape, a.values.tobytes()) for a in back.arrays],
                             [(a.name, a.mesh, a.values.dtype, a.values.shape, a.values.tobytes()) for a in sent.arrays])
            # What C++ wrote, it reads again from Python the same.
            self.assertEqual(self.echo(acopla.encode(back)), frames)

    def test_what_one_refuses_the_other_refuses(self):
        for what, frames in REFUSED.items():
            with self.subTest(what):
                self.assertIsInstance(self.echo(frames), str)
                with self.assertRaises(acopla.ProtocolError):
                    acopla.decode(frames)

    def test_damaged_messages_end_in_the_same_verdict(self):
        dice, refused = random.Random(2), 0
        for _ in range(3000):
            frames = acopla.encode(self.random_message(dice))
            at = dice.randrange(len(frames))
            frame = bytearray(frames[at])
            if frame and dice.random() < 0.7:
                frame[dice.randrange(len(frame))] = dice.randrange(256)
            else:
                frame = frame[:dice.randrange(len(frame) + 1)]
            frames[at] = bytes(frame)
            try:
                acopla.decode(frames)
                accepted = True
            except acopla.ProtocolError:
                accepted, refused = False, refused + 1
            verdict = self.echo(frames)
            self.assertEqual(accepted, isinstance(verdict, list), (verdict, frames))
        self.assertGreater(refused, 500)

    def test_a_hello_and_an_error_are_read_whatever_the_version(self):
        for kind in ("hello", "error"):
            self.assertEqual(acopla.decode([header(kind=kind, acopla=7)]).kind, kind)

    def test_the_worked_example_reads_as_the_specification_says(self):
        text = (SOURCE / "docs/protocol.md").read_text()
        part = text[text.index("## 8."):text.index("In `welcome`, `c0")]
        found = {}
        for title, block in re.findall(r"`(\w+)`, header \d+ bytes:\n\n(.*?)(?=\n`|\Z)", part, re.S):
            frames = [bytes.fromhex(re.sub(r"[^0-9a-f]", "", frame)) for frame in re.split(r"# frame \w+ \d+ bytes", block)]
            found[title] = acopla.decode(frames)
        self.assertEqual(set(found), {"hello", "welcome", "interface", "advance", "advanced", "pong"})
        run, pulse = acopla.read_welcome(found["welcome"])
        self.assertEqual((run.tick, run.end, run.window, list(run.gravity)), (0.05, 60, 1, [0, 0, -9.81]))
        self.assertEqual((run.uses, pulse), ([acopla.Use("skin", ["force"], [])], "ipc:///tmp/a/hub.pulse"))
        ring = acopla.Surface("skin", [(0, 0, 0), (1, 0, 0), (0, 1, 0)], [(0, 1, 2)])
        self.assertEqual(acopla.encode(acopla.interface_message([ring], 3)), acopla.encode(found["interface"]))
        self.assertEqual(found["advance"].find("force", "skin").tolist(), [[0, 0, -1.5], [0, 0, 0], [2, 0, 0]])


class PythonInterface(unittest.TestCase):
    """What a participant's own mistakes are called before they leave its process."""

    def refusal(self, surface, dimension=3):
        with self.assertRaises(acopla.ProtocolError) as caught:
            acopla.interface_message([surface], dimension)
        return str(caught.exception)

    def test_faces_are_named_by_their_nodes(self):
        points = [(k, k * k, 0) for k in range(9)]
        for nodes, dimension, kind in ((2, 2, 1), (3, 2, 2), (3, 3, 3), (6, 3, 4), (4, 3, 5), (9, 3, 6)):
            message = acopla.interface_message([acopla.Surface("s", points, [range(nodes)])], dimension)
            self.assertEqual(message.find("kinds", "s").tolist(), [kind])

    def test_mistakes_are_named(self):
        triangle = [(0, 0, 0), (1, 0, 0), (0, 1, 0)]
        self.assertEqual(self.refusal(acopla.Surface("s", triangle, [(0, 1, 3)])),
                         "surface s: the face [0, 1, 3] is none of 3 points and of kind triangle3")
        self.assertEqual(self.refusal(acopla.Surface("s", triangle, [(0, 1, 2)], velocity=[(0, 0, 0)])),
                         "velocity on s has the shape [1, 3], not [3, 3]")
        self.assertEqual(self.refusal(acopla.Surface("s", [(0, 0, 0), (0, float("nan"), 0)])), "points of s is not finite at point 1")


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1] + sys.argv[3:])
