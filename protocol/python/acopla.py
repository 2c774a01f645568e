"""Lets a solver written in Python take part in a coupled run (docs/protocol.md, version 1).

    import acopla

    class Plate(acopla.Participant):
        def start(self, run):                   # read meshes, build matrices
            return [acopla.Surface("top", points, faces)]
        def advance(self, window, received):    # compute one window
            force = received["top", "force"]    # [points, 3], N, mean over the window
            return {("top", "displacement"): u, ("top", "velocity"): v}

    acopla.serve(Plate())

A case starts it by command = ["/usr/bin/python3", "plate.py"]; `acopla run` lets it find this file. Needs ZeroMQ, MessagePack and NumPy
(Debian: python3-zmq, python3-msgpack, python3-numpy). SI units everywhere; arrays are float64 of shape [points, 3], z = 0 in 2D.
"""
import dataclasses
import math
import os
import resource
import sys
import threading
import time
import tomllib

import msgpack
import numpy
import zmq

VERSION = 1
KINDS = ("hello", "welcome", "interface", "advance", "advanced", "save", "restore", "checkpoint", "resume", "finish", "done", "error",
         "ping", "pong")
FACES = {"line2": (1, 2), "line3": (2, 3), "triangle3": (3, 3), "triangle6": (4, 6), "quad4": (5, 4), "quad9": (6, 9)}  # kind, nodes
PATIENCE = 10.0  # s without a ping, after which the coupler counts as gone
SEND_LIMIT = 2000  # ms
# A gap of its own this long means that this very process was stopped or starved: the coupler is not to blame for it.
OWN_GAP = 0.75  # s


class ProtocolError(Exception):
    """Something arrived, or would be sent, that is not the protocol."""


class UserMistake(Exception):
    """What the user has to mend: a located sentence ("case.toml:3:1: …") that is shown as it is; the run ends with exit code 2."""


class Unsupported(Exception):
    """A request that this participant cannot do; it goes on, and the coupler decides what that means."""


# --- what a participant implements ----------------------------------------------------------------------------------------------------
@dataclasses.dataclass
class Use:
    """A surface that is coupled."""
    surface: str
    receives: list  # names of the fields that advance() is given for it, e.g. ["force"]
    sends: list     # names of the fields that advance() must give


@dataclasses.dataclass
class Run:
    """What the coupler tells of the run."""
    tick: float     # length of a tick [s]
    end: int        # end of coupled time [ticks]
    window: int     # nominal length of a window [ticks]
    gravity: numpy.ndarray  # [m/s²]
    results: str    # folder for own results, to be made when needed; empty: write none
    uses: list      # of Use; other surfaces need not be computed or sent
    resumes: bool = False  # resume() follows start(): what it brings need not be made first
    wants_mass: bool = False  # surfaces that send their motion should bring their mass, if it is known

    def time(self, ticks):
        return ticks * self.tick


@dataclasses.dataclass
class Window:
    """A span of coupled time."""
    start: int      # [ticks]
    end: int
    start_time: float  # [s]
    length: float
    estimate: bool = False  # also wanted, where known: `stiffness` [N/m] and `dashpot` [N s/m] of what touches the surface, per point

    @property
    def end_time(self):
        return self.start_time + self.length


@dataclasses.dataclass
class Surface:
    """A surface in its reference position, and how it is and moves when coupled time begins (None: at rest there)."""
    name: str
    points: object            # [n, 3], m
    faces: object = ()        # lists of point numbers in VTK's order; none where the surface only sends
    kind: str = None          # of all faces: "line2", "triangle6", …; None: by the number of nodes (three are a line in 2D, a triangle in 3D)
    displacement: object = None  # [n, 3], m
    velocity: object = None   # [n, 3], m/s
    mass: object = None       # [n, 3], kg: what a sudden force on that point alone would accelerate; 0 where it is held


@dataclasses.dataclass
class Advance:
    """What advance() may return where its fields alone do not say enough."""
    fields: dict              # (surface, field) → [n, 3]
    quantities: dict = dataclasses.field(default_factory=dict)  # scalars, named as [expect] names them: {"reaction.z": 12.5}
    steps: int = 1            # of its own in this window


class Participant:
    """A solver. Override save() and restore() together, and checkpoint() and resume() together, and it offers them."""
    solver = "python"  # what it is, for people
    dimension = 3

    def start(self, run):
        """Reads meshes, builds matrices; called once. Returns the Surfaces that run.uses names, at least."""
        raise NotImplementedError

    def advance(self, window, received):
        """Computes a window. received: (surface, field) → [n, 3]. Returns an Advance, or its fields alone."""
        raise NotImplementedError

    def finish(self):
        """The run ends well: writes what is left to write. Returns scalars for the summary."""
        return {}

    def save(self):
        """Remembers the present state, in place of what was saved before."""
        raise Unsupported("this solver cannot save its state")

    def restore(self):
        """Returns to the saved state, as often as asked: everything it did since is undone."""
        raise Unsupported("this solver cannot restore its state")

    def checkpoint(self, folder):
        """Writes what the run needs to go on bit by bit into files of the folder that begin with the participant's name."""
        raise Unsupported("this solver cannot write a checkpoint")

    def resume(self, folder):
        """Right after start() of the same case: goes on from such files."""
        raise Unsupported("this solver cannot resume from a checkpoint")

    def capabilities(self):
        kind = type(self)
        return [name for name, pair in (("save", ("save", "restore")), ("checkpoint", ("checkpoint", "resume")))
                if all(getattr(kind, method) is not getattr(Participant, method) for method in pair)]


# --- messages as bytes (docs/protocol.md, §2) -------------------------------------------------------------------------------------------
TYPES = {"f8": numpy.dtype("<f8"), "i4": numpy.dtype("<i4"), "u1": numpy.dtype("u1")}
HEADER_BYTES, DEPTH, ELEMENTS, ARRAYS, ARRAY_BYTES = 1 << 20, 16, 1 << 16, 1024, 1 << 48


@dataclasses.dataclass
class Array:
    name: str  # the field, e.g. "force"
    mesh: str  # the surface it lives on
    values: numpy.ndarray


@dataclasses.dataclass
class Message:
    kind: str
    body: dict = dataclasses.field(default_factory=dict)
    sequence: int = 0
    arrays: list = dataclasses.field(default_factory=list)

    def find(self, name, mesh):
        return next((array.values for array in self.arrays if (array.name, array.mesh) == (name, mesh)), None)


def encode(message):
    """The frames of a message: a header, and the bytes of each array."""
    entries, frames = [], []
    for array in message.arrays:
        code = next((code for code, dtype in TYPES.items() if dtype == array.values.dtype), None)
        if code is None:
            raise ProtocolError(f"array {array.name} on {array.mesh} holds {array.values.dtype}; use float64, int32 or uint8")
        entries.append({"name": array.name, "mesh": array.mesh, "type": code, "shape": list(array.values.shape)})
        frames.append(numpy.ascontiguousarray(array.values, TYPES[code]).tobytes())
    header = msgpack.packb({"acopla": VERSION, "kind": message.kind, "sequence": message.sequence, "body": message.body, "arrays": entries})
    return [header] + frames


def decode(frames):
    """Reads a message. Raises ProtocolError for anything that is not exactly one well-formed message."""
    if not frames:
        raise ProtocolError("a message without frames")
    header = _unpack(bytes(frames[0]))
    spoken, kind = _entry(header, "acopla", int), _entry(header, "kind", str)
    if kind not in KINDS:
        raise ProtocolError(f"\"{kind[:40]}\" is not a kind of protocol version {VERSION}")
    if spoken != VERSION and kind not in ("hello", "error"):  # those are read whatever the version
        raise ProtocolError(f"a message of protocol version {spoken}, this is version {VERSION}")
    entries = _entry(header, "arrays", list)
    message = Message(kind, _entry(header, "body", dict), _entry(header, "sequence", int))
    if len(entries) > ARRAYS:
        raise ProtocolError(f"{len(entries)} arrays in one message")
    if len(entries) + 1 != len(frames):
        raise ProtocolError(f"the header names {len(entries)} arrays, {len(frames) - 1} frames follow")
    message.arrays = [_read_array(entry, frame) for entry, frame in zip(entries, frames[1:])]
    return message


def _unpack(data):
    if len(data) > HEADER_BYTES:
        raise ProtocolError(f"a header of {len(data)} bytes is over the limit of {HEADER_BYTES}")
    try:
        header = msgpack.unpackb(data, object_pairs_hook=_map_of, strict_map_key=False, max_array_len=ELEMENTS, max_map_len=ELEMENTS,
                                 max_str_len=HEADER_BYTES, max_bin_len=0, max_ext_len=0)
    except ProtocolError:
        raise
    except Exception as error:  # of several unrelated types
        raise ProtocolError(f"the header is not one MessagePack value within the limits ({type(error).__name__}: {error})") from None
    if not isinstance(header, dict):
        raise ProtocolError("the header is not a map")
    _check_depth(header, DEPTH)
    return header


def _map_of(pairs):
    made = {}
    for key, value in pairs:
        if not isinstance(key, str):
            raise ProtocolError("a header map has a key that is not text")
        if key in made:
            raise ProtocolError(f"the header names \"{key}\" twice")
        made[key] = value
    return made


def _check_depth(value, depth):
    if isinstance(value, (dict, list)):
        if depth == 0:
            raise ProtocolError("the header is nested too deeply")
        for inner in value.values() if isinstance(value, dict) else value:
            _check_depth(inner, depth - 1)
    elif not isinstance(value, (type(None), bool, int, float, str)):
        raise ProtocolError("the header holds a value of a type the protocol does not use")


def _entry(table, key, kind):
    value = table.get(key)
    if not isinstance(value, kind) or (kind is int and (isinstance(value, bool) or value < 0)):
        raise ProtocolError(f"the header has no {dict(zip((int, str, list, dict), ('count', 'text', 'list', 'map')))[kind]} \"{key}\"")
    return value


def _read_array(entry, frame):
    if not isinstance(entry, dict):
        raise ProtocolError("an array's entry in the header is not a map")
    name, mesh, code, shape = _entry(entry, "name", str), _entry(entry, "mesh", str), _entry(entry, "type", str), _entry(entry, "shape", list)
    if code not in TYPES:
        raise ProtocolError(f"\"{code[:40]}\" is not a type of protocol version {VERSION}")
    if not all(isinstance(extent, int) and not isinstance(extent, bool) and extent >= 0 for extent in shape):
        raise ProtocolError(f"array {name} has a shape that is not of counts")
    size = TYPES[code].itemsize * math.prod(shape)
    if TYPES[code].itemsize * math.prod(extent for extent in shape if extent) > ARRAY_BYTES or len(shape) > 32:
        raise ProtocolError(f"array {name} has an impossible shape")
    data = memoryview(frame)
    if size != data.nbytes:
        raise ProtocolError(f"array {name} on {mesh} should have {size} bytes by its shape, but has {data.nbytes}")
    return Array(name, mesh, numpy.frombuffer(bytes(data), TYPES[code]).reshape(shape))


# --- bodies (docs/protocol.md, §4) --------------------------------------------------------------------------------------------------------
def _value(message, key, kinds, body=None):
    """A value of a body; numbers may be integers, counts may not be floats."""
    value = (message.body if body is None else body).get(key)
    if value is None:
        raise ProtocolError(f"{message.kind} lacks \"{key}\"")
    if not isinstance(value, kinds) or (kinds is not bool and isinstance(value, bool)):
        raise ProtocolError(f"\"{key}\" of {message.kind} is of the wrong type")
    return value


def _texts(message, key, body=None):
    values = _value(message, key, list, body)
    if not all(isinstance(value, str) for value in values):
        raise ProtocolError(f"\"{key}\" of {message.kind} is of the wrong type")
    return values


def vectors(values, count, what):
    """An array [count, 3] of finite numbers. Raises ProtocolError, which names it, where it is another."""
    array = numpy.asarray(values, dtype=float)
    if array.shape != (count, 3):
        raise ProtocolError(f"{what} has the shape {list(array.shape)}, not [{count}, 3]")
    if not numpy.isfinite(array).all():
        raise ProtocolError(f"{what} is not finite at point {numpy.argwhere(~numpy.isfinite(array))[0][0]}")
    return array


def read_welcome(message):
    """The Run, and the address of the pulse."""
    tick, gravity = float(_value(message, "tick", (int, float))), _value(message, "gravity", list)
    if not (tick > 0 and math.isfinite(tick)):
        raise ProtocolError("\"tick\" of welcome is not positive")
    if len(gravity) != 3 or not all(isinstance(g, (int, float)) for g in gravity):
        raise ProtocolError("\"gravity\" of welcome must have three components")
    uses = []
    for use in _value(message, "uses", list):
        if not isinstance(use, dict):
            raise ProtocolError("\"uses\" of welcome is of the wrong type")
        uses.append(Use(_value(message, "surface", str, use), _texts(message, "receives", use), _texts(message, "sends", use)))
    run = Run(tick, _value(message, "end", int), _value(message, "window", int), numpy.array(gravity, float), _value(message, "results", str), uses,
              bool(message.body.get("resumes", False)), bool(message.body.get("wants_mass", False)))
    return run, _value(message, "pulse", str)


def interface_message(surfaces, dimension):
    message = Message("interface", {"surfaces": [surface.name for surface in surfaces]})
    for surface in surfaces:
        faces = [numpy.asarray(face, dtype="<i4") for face in surface.faces]
        points = vectors(surface.points, len(surface.points), f"points of {surface.name}")
        guess = {2: "line2", 3: "line3" if dimension == 2 else "triangle3", 4: "quad4", 6: "triangle6", 9: "quad9"}
        kinds = [surface.kind or guess.get(len(face)) for face in faces]
        for face, kind in zip(faces, kinds):
            if kind not in FACES or FACES[kind][1] != len(face) or face.min() < 0 or face.max() >= len(points):
                raise ProtocolError(f"surface {surface.name}: the face {face.tolist()} is none of {len(points)} points and of kind {kind}")
        nodes = numpy.concatenate(faces) if faces else numpy.zeros(0, "<i4")
        message.arrays += [Array("points", surface.name, points), Array("nodes", surface.name, nodes),
                           Array("kinds", surface.name, numpy.array([FACES[kind][0] for kind in kinds], "u1"))]
        for name in ("displacement", "velocity", "mass"):
            if (given := getattr(surface, name)) is not None:
                message.arrays.append(Array(name, surface.name, vectors(given, len(points), f"{name} on {surface.name}")))
    return message


def _values(quantities):
    return {"values": [[name, float(number)] for name, number in (quantities or {}).items()]}


# --- the connection -------------------------------------------------------------------------------------------------------------------------
class _Pulse:
    """Answers pings on a thread and a socket of its own, so that a long computation is not taken for death. (One that holds Python's
    interpreter lock for more than a second, as a few extension modules do, still is.)"""

    def __init__(self, context, address, name, keys):
        self._socket = _dealer(context, address, 0, keys)
        self._pong, self._stop, self._last_ping = encode(Message("pong", {"participant": name})), threading.Event(), time.monotonic()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def silence(self):
        return time.monotonic() - self._last_ping

    def close(self):
        self._stop.set()
        self._thread.join()

    def _run(self):
        self._answer()  # reports, so that the coupler starts to ping
        turn = time.monotonic()
        while not self._stop.is_set():
            if self._socket.poll(50):
                self._socket.recv_multipart()
                self._last_ping = time.monotonic()
                self._answer()
            if time.monotonic() - turn > OWN_GAP:
                self._last_ping = time.monotonic()
            turn = time.monotonic()
        self._socket.close()

    def _answer(self):
        try:
            self._socket.send_multipart(self._pong, zmq.NOBLOCK)
        except zmq.Again:
            pass  # no coupler: silence() will tell


def _check_endpoint(endpoint, keys=None):
    if not keys and endpoint.startswith("tcp://") and endpoint[6:].rpartition(":")[0] not in ("127.0.0.1", "localhost", "[::1]"):
        raise UserMistake(f"{endpoint}: tcp is open to loopback only, because messages are neither signed nor encrypted "
                          "without keys. Use tcp://127.0.0.1:PORT, or make keys by `acopla keys DIR` and give them to both sides (ACOPLA_KEYS=DIR).")


def read_keys(folder):
    """The participants' CURVE keys that `acopla keys` made: public, secret, and the coupler's public."""
    path = os.path.join(folder, "participant.keys")
    try:
        if os.stat(path).st_mode & 0o077:
            raise UserMistake(f"{path}: may be read by others. Use chmod 600 {path}, and make new keys if others did.")
        with open(path) as stream:
            entries = dict(line.split() for line in stream if not line.startswith("#") and len(line.split()) == 2)
        return tuple(entries[word].encode() for word in ("public", "secret", "other"))
    except (OSError, KeyError) as error:
        raise UserMistake(f"{path}: cannot be read ({error}). Make keys by `acopla keys DIR`, and copy participant.keys to here.") from None


def _reachable(pulse, hub):
    """A coupler that listens on every address of its machine does not know by which it is seen: the one that reached it will do."""
    for anywhere in ("tcp://0.0.0.0:", "tcp://[::]:"):
        if pulse.startswith(anywhere):
            return hub[:hub.rindex(":") + 1] + pulse[len(anywhere):]
    return pulse


def _dealer(context, address, linger, keys):
    _check_endpoint(address, keys)
    socket = context.socket(zmq.DEALER)
    if keys and address.startswith("tcp://"):
        socket.curve_publickey, socket.curve_secretkey, socket.curve_serverkey = keys
    socket.setsockopt(zmq.LINGER, linger)
    socket.setsockopt(zmq.SNDTIMEO, SEND_LIMIT)
    socket.setsockopt(zmq.RECONNECT_IVL, 20)
    socket.setsockopt(zmq.SNDHWM, 0)
    socket.setsockopt(zmq.RCVHWM, 0)
    socket.connect(address)
    return socket


class _Session:
    """The solver's half of the state machine (docs/protocol.md, §3)."""

    def __init__(self, participant, endpoint, name, keys, context):
        self._participant, self._endpoint, self._name, self._context = participant, endpoint, name, context
        self._keys = read_keys(keys) if keys and endpoint.startswith("tcp://") else None
        self._socket, self._pulse, self._state, self._coupler_knows = _dealer(context, endpoint, 2000, self._keys), None, "connected", False
        self._begin = time.monotonic()

    def run(self):
        try:
            self._introduce()
            self._state = "starting"
            surfaces = self._participant.start(self._run)
            self._points = {surface.name: len(surface.points) for surface in surfaces}
            self._send(interface_message(surfaces, self._participant.dimension))
            self._state = "ready"
            while self._answer(self._next_request()):
                pass
        except BaseException as error:  # a KeyboardInterrupt too: the coupler learns why
            self._report(str(error) or type(error).__name__, isinstance(error, UserMistake))
            raise
        finally:
            if self._pulse:
                self._pulse.close()
            self._socket.close()

    def _introduce(self):
        participant = self._participant
        self._send(Message("hello", {"participant": self._name, "solver": participant.solver, "dimension": participant.dimension,
                                     "versions": [VERSION, VERSION], "capabilities": participant.capabilities()}))
        message = self._next_request()
        if message.kind != "welcome":
            self._refuse(message)
        self._run, address = read_welcome(message)
        self._pulse = _Pulse(self._context, _reachable(address, self._endpoint), self._name, self._keys)

    def _next_request(self):
        begin = time.monotonic()
        while not self._socket.poll(100):
            silence = self._pulse.silence() if self._pulse else time.monotonic() - begin
            if silence > PATIENCE:
                raise ProtocolError(f"no sign of a coupler at {self._endpoint} for {silence:.1f} s. Start it first, and check the address.")
        message = decode(self._socket.recv_multipart())
        if message.kind == "error":
            self._coupler_knows = True
            raise ProtocolError(f"the coupler ended the run: {message.body.get('text', '')}")
        return message

    def _answer(self, request):
        try:
            reply = self._compute(request)
        except Unsupported as error:
            reply = Message("error", {"text": str(error), "state": self._state, "unsupported": True})
        reply.sequence = request.sequence
        self._send(reply)
        self._state = "ready"
        return request.kind != "finish"

    def _compute(self, request):
        if request.kind == "advance":
            return self._advance(request)
        if request.kind in ("save", "restore"):
            getattr(self._participant, request.kind)()
            return Message("done", _values({}))
        if request.kind in ("checkpoint", "resume"):
            self._state = "writing a checkpoint" if request.kind == "checkpoint" else "resuming from a checkpoint"
            getattr(self._participant, request.kind)(_value(request, "folder", str))
            return Message("done", _values({}))
        if request.kind == "finish":
            self._state = "finishing"
            peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024
            return Message("done", _values({"peak_bytes": peak, **(self._participant.finish() or {})}))
        self._refuse(request)

    def _advance(self, request):
        start, end = _value(request, "start", int), _value(request, "end", int)
        if not 0 <= start < end:
            raise ProtocolError("advance over a window that has no length")
        time_of = self._run.time
        window = Window(start, end, time_of(start), time_of(end - start), bool(request.body.get("estimate", False)))
        self._state = f"advancing from {time_of(start):.6g} s to {time_of(end):.6g} s"
        wanted = {(use.surface, name) for use in self._run.uses for name in use.receives}
        received = {(array.mesh, array.name): self._field(array.mesh, array.name, array.values) for array in request.arrays
                    if (array.mesh, array.name) in wanted}  # other arrays are of a later release
        result = self._participant.advance(window, received)
        if not isinstance(result, Advance):
            result = Advance(result or {})
        reply = Message("advanced", {"steps": int(result.steps), **_values(result.quantities)})
        for (surface, name), values in result.fields.items():
            reply.arrays.append(Array(name, surface, self._field(surface, name, values)))
        return reply

    def _field(self, surface, name, values):
        if surface not in self._points:
            raise ProtocolError(f"{name} is on {surface}, a surface that was never offered")
        return vectors(values, self._points[surface], f"{name} on {surface}")

    def _refuse(self, message):
        raise ProtocolError(f"the coupler sent {message.kind} to {self._name} while it was {self._state}")

    def _send(self, message):
        try:
            self._socket.send_multipart(encode(message))
        except zmq.Again:
            raise ProtocolError("the coupler is gone: nothing can be sent to it") from None

    def _report(self, text, mistake):
        if self._coupler_knows:
            return
        try:
            self._send(Message("error", {"text": text, "state": self._state, "mistake": mistake}))
        except ProtocolError:
            pass  # nobody listens any more; the exception that is being reported goes on


def own_table():
    """This participant's table of the case, with whatever keys it likes."""
    with open(os.environ["ACOPLA_CASE"], "rb") as stream:
        return tomllib.load(stream)[os.environ["ACOPLA_PARTICIPANT"]]


def serve(participant, endpoint=None, name=None, keys=None):
    """Serves the participant until the coupler says finish. An exception of the participant reaches the user, with its words, before it
    leaves this function. Without an address and a name they are those that `acopla run` gave in the environment. keys: the folder with
    participant.keys, for tcp beyond loopback."""
    try:
        endpoint = endpoint or os.environ["ACOPLA_ENDPOINT"]
        name = name or os.environ["ACOPLA_PARTICIPANT"]
    except KeyError as missing:
        sys.exit(f"{missing.args[0]} is not set. This program is started by `acopla run`, as a case's command = […].")
    context = zmq.Context()
    try:
        _Session(participant, endpoint, name, keys or os.environ.get("ACOPLA_KEYS"), context).run()
    except UserMistake as mistake:
        print(mistake, file=sys.stderr)
        sys.exit(2)
    finally:
        context.term()
