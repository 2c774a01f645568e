"""A participant that keeps every rule of the protocol but one: broken.py FAULT.

It moves a triangle, "top", by a millimetre a newton, and remembers the sum of what it received. Without a FAULT it keeps all.
"""
import json
import math
import os
import signal
import sys
import threading
import time

import acopla
import msgpack
import numpy
import zmq

FAULT = sys.argv[1] if len(sys.argv) > 1 else ""
NAME = os.environ["ACOPLA_PARTICIPANT"]
context, own_context = zmq.Context(), zmq.Context()  # that of the main socket can end, and wait for its last words, while the pulse goes on
main = own_context.socket(zmq.DEALER)
main.connect(os.environ["ACOPLA_ENDPOINT"])
last_ping = time.monotonic()
total = numpy.zeros((3, 3))
saved = None
memory = None  # that the coupler offers


def send(kind, body=None, sequence=0, arrays=()):
    main.send_multipart(acopla.encode(acopla.Message(kind, body or {}, sequence, [acopla.Array(*array) for array in arrays])))


def fail(text, code=1, **more):
    send("error", {"text": text, "state": "testing", **more})
    leave(code)


def leave(code):
    main.close(2000)
    own_context.term()
    sys.stdout.flush()
    os._exit(code)  # with all threads


def pulse(address):
    global last_ping
    socket = context.socket(zmq.DEALER)
    socket.connect(address)
    answers = 0
    while True:
        if FAULT != "pulse-once" or answers == 0:
            socket.send_multipart(acopla.encode(acopla.Message("pong", {"participant": "nobody" if FAULT == "pulse-name" else NAME})))
            answers += 1
        while not socket.poll(100):
            if time.monotonic() - last_ping > 10 and FAULT != "silence":
                os._exit(1)
        while busy.is_set():
            time.sleep(0.01)
        socket.recv_multipart()
        last_ping = time.monotonic()


busy = threading.Event()


def hello():
    if FAULT == "hello-never":
        time.sleep(1000)
    if FAULT == "hello-dies":
        print("I could not", flush=True)
        leave(7)
    if FAULT == "hello-late":
        send("interface", {"surfaces": []})
    capabilities = ["save", "checkpoint"]
    if FAULT.startswith("unsupported"):
        capabilities = []
    body = {"participant": "nobody" if FAULT == "hello-name" else NAME, "solver": "broken", "dimension": 2 if FAULT == "dimension" else 3,
            "versions": [2, 3] if FAULT == "version" else [1, 1], "capabilities": capabilities}
    if FAULT == "hello-lacks":
        del body["capabilities"]
    send("hello", body)


def interface():
    points = numpy.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]])
    if FAULT == "interface-shape":
        points = points.reshape(9, 1)
    if FAULT == "interface-nan":
        points[1, 2] = float("nan")
    nodes = numpy.array([0, 1, 3 if FAULT == "interface-nodes" else 2], "<i4")
    kinds = numpy.array([3], "u1")
    if FAULT == "interface-faceless":
        nodes, kinds = nodes[:0], kinds[:0]
    name = "bottom" if FAULT == "interface-name" else "top"
    found = {"memory": True} if memory else {}
    send("interface", {"surfaces": [name], **found}, arrays=[("points", name, points), ("nodes", name, nodes), ("kinds", name, kinds)])


def with_frames(frames):
    """Arrays that lie in shared memory (docs/protocol.md, §8) as frames, which the client reads."""
    try:
        header = msgpack.unpackb(frames[0])
        entries = [entry for entry in header["arrays"] if "at" in entry]
    except Exception:
        return frames
    for entry in entries:
        size = numpy.dtype(acopla.TYPES[entry["type"]]).itemsize * math.prod(entry["shape"])
        with open(memory["requests"], "rb") as file:
            file.seek(entry.pop("at") + (8 if FAULT == "memory-place" else 0))
            frames.append(file.read(size))
    return [msgpack.packb(header), *frames[1:]] if entries else frames


def heard():
    frames = main.recv_multipart()
    if FAULT != "memory-blind":
        frames = with_frames(frames)
    if FAULT == "malformed" and len(frames[0]) < 30:
        os.kill(os.getpid(), signal.SIGSEGV)
    if FAULT == "wrong-bytes" and len(frames) > 1 and len(frames[1]) < 72:
        frames[1] += bytes(72 - len(frames[1]))
    if FAULT == "other-version" and frames[0][8] == 2:
        frames[0] = frames[0][:8] + b"\x01" + frames[0][9:]
    try:
        message = acopla.decode(frames)
    except acopla.ProtocolError as error:
        fail(str(error))
    if message.kind == "error":
        if FAULT == "end-of-run" and message.body["text"] == "somebody else failed":
            fail("I heard that")
        if FAULT == "refusal" and message.body["state"] == "refused":
            time.sleep(1000)
        leave(1)
    return message


def advance(message):
    global total
    force = next((array.values for array in message.arrays if array.name == "force"), None)
    if force is None or not numpy.isfinite(force).all() and FAULT != "not-finite":
        fail("the force is not finite")
    if force.shape != (3, 3) and FAULT != "wrong-points":
        fail("the force has another number of points")
    if FAULT == "unknown-keys" and set(message.body) - {"start", "end"}:
        fail("there is a key I do not know")
    if FAULT == "zero" and not force.any():
        fail("float division by zero")
    if FAULT == "slow":
        time.sleep(3)
    if FAULT == "windows" and message.body["start"] == 1:
        fail("one window is enough")
    if FAULT == "busy" and message.body["start"] == 1:
        busy.set()
        time.sleep(2.2)
        busy.clear()
    total = total + force[:3]
    u = 1e-3 * total
    fields = [("displacement", "top", u), ("velocity", "top", 0 * u)]
    if FAULT == "fields-missing":
        fields.pop()
    if FAULT == "fields-nan":
        fields[1] = ("velocity", "top", u + float("inf"))
    if FAULT == "fields-points":
        fields[0] = ("displacement", "top", u[:2])
    if FAULT == "fields-surface":
        fields.append(("velocity", "side", u))
    if FAULT == "fields-kind":
        return send("done", {"values": []}, message.sequence)
    send("advanced", {"steps": 1, "values": []}, message.sequence + (1 if FAULT == "sequence" else 0), fields)


def keep_state(message):
    global total, saved
    if FAULT.startswith("unsupported"):
        if FAULT == "unsupported-done":
            return send("done", {}, message.sequence)
        return send("error", {"text": "cannot", "state": "ready", "unsupported": FAULT != "unsupported-fault"}, message.sequence)
    path = os.path.join(message.body.get("folder", ""), NAME + ".json")
    if message.kind == "save" and not (FAULT == "save-once" and saved is not None):
        saved = total
    elif message.kind == "restore" and FAULT != "restore":
        total = saved if saved is not None else total
        if FAULT == "restore-once":
            saved = None
    elif message.kind == "checkpoint":
        with open(path, "w") as stream:
            json.dump(total.tolist(), stream)
    elif message.kind == "resume" and FAULT != "resume":
        with open(path) as stream:
            total = numpy.array(json.load(stream))
    send("done", {}, message.sequence)


def finish(message):
    if FAULT == "finish":
        return send("advanced", {"steps": 0}, message.sequence)
    send("done", {"values": []}, message.sequence)
    if FAULT == "exit-never":
        time.sleep(1000)
    leave(3 if FAULT == "exit-code" else 0)


hello()
welcome = heard()
if welcome.kind != "welcome" and FAULT != "before-welcome":
    fail(f"{welcome.kind} before welcome")
if FAULT != "pulse-never":
    threading.Thread(target=pulse, args=(welcome.body["pulse"],), daemon=True).start()
memory = welcome.body.get("memory")
interface()
if FAULT == "order":
    send("done", {"values": []})
while True:
    request = heard()
    if request.kind == "advance":
        advance(request)
    elif request.kind in ("save", "restore", "checkpoint", "resume"):
        keep_state(request)
    elif request.kind == "finish":
        finish(request)
    elif FAULT != "out-of-turn":
        fail("" if FAULT == "no-words" else f"{request.kind} out of turn", 0 if FAULT == "error-code" else 1, unsupported=FAULT == "error-unsupported")
