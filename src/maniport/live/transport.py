"""Frames and answers: as arrays, mappings and lines of JSON, by a pipe or a UDP port."""

import json
import math
import os
import select
import socket
import time
from collections.abc import Mapping, Sequence, Set
from contextlib import suppress
from typing import BinaryIO, NamedTuple, Protocol

import numpy as np

from maniport.errors import InvalidInputError, OutputError, unknown_name
from maniport.mocap.recording import MAX_POSITION
from maniport.util.input_limits import FRAME_BYTES
from maniport.util.process import LAST_PORT, LOOPBACK, bound
from maniport.util.validation import LATEST, Array, as_count, require_shape

SILENCE = 2.0  # Of a sender, after which others are admitted [s]
Address = tuple[str | int, ...]  # of a socket
EXAMPLE = '{"t": 0.02, "points": {"NAME": [0.1, 0.2, 0.3]}}'


class HasDescriptor(Protocol):
    """What has a file descriptor, such as a socket."""

    def fileno(self) -> int:
        """Return the file descriptor."""


Source = int | HasDescriptor
"""What `select.select` waits for."""


class Order(NamedTuple):
    """Consent to a motion, and the robot's configuration, of a line with or without a frame."""

    engage: bool | None = None  # True: engage; False: hold
    joints: Array | None = None  # measured, (dof,) [rad or m]


class Frame(NamedTuple):
    """Positions of the points at a time."""

    t: float  # [s]
    points: Array  # Shape (n_points, 3); nan where a point is not seen
    order: Order = Order()


def as_frame(points: object, names: Sequence[str]) -> Array | None:
    """Copy to positions (n, 3) in the order of the names, nan where a coordinate is; None stays None."""
    if points is None:
        return None
    if isinstance(points, Mapping):
        positions = np.full((len(names), 3), np.nan)
        for name, value in points.items():
            if name not in names:
                raise unknown_name(
                    "point", name[:80] if isinstance(name, str) else name, names, "in points"
                )
            if value is not None:
                label = f"points[{name!r}]"
                position = _as_numbers(value, label)
                require_shape(position, label, (3,))
                positions[names.index(name)] = position
    else:
        positions = _as_numbers(points, "points")
        require_shape(positions, "points", (len(names), 3), ", a row for each of live.points")
    if not np.vdot(positions, positions) <= MAX_POSITION**2:
        if (np.abs(positions) > MAX_POSITION).any():
            largest = np.nanmax(np.abs(positions))
            raise InvalidInputError(
                f"points must be within ±{MAX_POSITION:g}, or nan where they are not seen; found {largest:g}"
            )
        positions[np.isnan(positions).any(axis=1)] = np.nan
    return positions


def as_joints(joints: object, names: Sequence[str]) -> Array:
    """Copy to finite joint positions (dof,) in the order of the names."""
    if isinstance(joints, Mapping):
        for name in joints:
            if name not in names:
                raise unknown_name(
                    "joint", name[:80] if isinstance(name, str) else name, names, "in joints"
                )
        missing = [name for name in names if name not in joints]
        if missing:
            raise InvalidInputError(f"joints must contain all joints; {missing[0]!r} is missing")
        joints = [joints[name] for name in names]
    q = _as_numbers(joints, "joints")
    require_shape(q, "joints", (len(names),), ", a number for each joint of the robot")
    if not np.isfinite(q).all():
        raise InvalidInputError(f"joints must be finite; found {q[~np.isfinite(q)][0]}")
    return q


def _as_numbers(value: object, name: str) -> Array:
    """Convert to numbers; nan may be among them, and replaces masked entries."""
    try:
        if isinstance(value, np.ma.MaskedArray):
            value = np.ma.filled(value.astype(np.float64), np.nan)
        array = np.asarray(value)
        if array.dtype.kind not in "iufO":
            raise TypeError
        # Numba compiles anew for each order and read-only flag
        return np.array(array, dtype=np.float64, order="C")
    except (OverflowError, TypeError, ValueError):
        raise InvalidInputError(f"{name} must be numbers; found {value!r:.80}") from None


def read_frame(
    line: bytes | None, names: Sequence[str], joint_names: Sequence[str] = ()
) -> Frame | Order | None:
    """Read a line of JSON, None where it was too long; None is returned for the empty object."""
    if line is None:
        raise InvalidInputError(f"a line has at most {FRAME_BYTES} bytes; this one has more")
    try:
        content = json.loads(line.decode())
    # numbers with thousands of digits, and wrong UTF-8, raise ValueError, too
    except (ValueError, RecursionError) as error:
        text = line[:80].decode(errors="replace")
        raise InvalidInputError(
            f"a line must be JSON such as {EXAMPLE}; found {text!r}: {error!s:.100}"
        ) from None
    if content == {}:
        return None
    if not isinstance(content, dict) or not _are_keys(content.keys()):
        raise InvalidInputError(
            f"a line is an object of t and points, such as {EXAMPLE}, of engage, of joints, or of all of them; found "
            f"{content!r:.80}"
        )
    order = _read_order(content, joint_names)
    if "t" not in content:
        return order
    t = content["t"]
    points = content["points"]
    latest = 0.5 * LATEST  # steps without a frame may come after it
    if type(t) not in (int, float) or not -latest <= t <= latest:
        raise InvalidInputError(f"t must be a number within ±{latest:g}; found {t!r:.80}")
    if isinstance(points, list) and len(points) == len(names):
        points = dict(zip(names, points, strict=True))
    if not isinstance(points, dict):
        wanted = f"an object of positions by name, or a list of {len(names)} positions in the given order"
        raise InvalidInputError(f"points must be {wanted}; found {points!r:.80}")
    positions = as_frame(points, names)
    assert positions is not None
    return Frame(float(t), positions, order)


def _are_keys(keys: Set[str]) -> bool:
    """Whether keys are those of a line."""
    frame = keys & {"t", "points"}
    return len(frame) != 1 and keys <= {"t", "points", "engage", "joints"}


def _read_order(content: dict[str, object], joint_names: Sequence[str]) -> Order:
    """Read consent and measured joints of a line; `null` is the same as their absence."""
    engage = content.get("engage")
    if engage is not None and not isinstance(engage, bool):
        raise InvalidInputError(f"engage must be true or false; found {engage!r:.80}")
    joints = content.get("joints")
    if joints is not None:
        joints = as_joints(joints, joint_names)
    return Order(engage, joints)


def encoded(**content: object) -> bytes:
    """Encode an answer as a line of JSON."""
    return json.dumps(content, allow_nan=False).encode() + b"\n"


class Line(NamedTuple):
    """A line without its end, and whom to answer."""

    text: bytes | None  # None where it was too long to be kept
    sender: Address | None = None


class Pipe:
    """Lines in by a file descriptor, lines out by another; `lost` counts answers that could not be written."""

    def __init__(self, source: int, sink: int):
        self._source = source
        self._sink = sink
        self._begun = b""  # of a line whose end has not arrived
        self._too_long = False  # whether this line is too long to be kept
        self._waiting = b""
        self.lost = 0
        self.about: dict[str, object] = {}

    def sources(self) -> list[int]:
        """File descriptors to wait for."""
        return [self._source]

    def admit(self, sender: Address | None) -> list[Line]:
        """Return no lines: there is one sender."""
        return []

    def dismiss(self) -> None:
        """Nothing to do: there is one sender."""

    def turn_away(self) -> None:
        """Nothing to do: there is one sender."""

    def receive(self, size: int = 1 << 16) -> list[Line] | None:
        """Lines that have arrived, without empty ones; None when there will be no more."""
        data = os.read(self._source, size)
        if not data and not self._begun and not self._too_long:
            return None
        *texts, begun = (self._begun + (data or b"\n")).split(b"\n")
        lines = []
        for text in texts:
            if self._too_long or len(text) > FRAME_BYTES:
                lines.append(Line(None))
            elif text.strip():
                lines.append(Line(text))
            self._too_long = False
        self._too_long = self._too_long or len(begun) > FRAME_BYTES
        self._begun = b"" if self._too_long else begun
        return lines

    def send(self, text: bytes, receiver: Address | None = None) -> bool:
        """Write a line; False when the reader left. Raises OutputError where a disk is full, or the like."""
        if self._waiting:
            self.lost += 1
        else:
            self._waiting = text
        return self.flush()

    def blocked(self) -> list[int]:
        """File descriptors that must be ready for writing before a line can go on."""
        if self._waiting:
            return [self._sink]
        return []

    def flush(self, piece: int = 4096) -> bool:
        """Write what waits, as far as it is taken; False when the reader left. POSIX pipes take such pieces whole."""
        try:
            while self._waiting and select.select([], [self._sink], [], 0)[1]:
                self._waiting = self._waiting[os.write(self._sink, self._waiting[:piece]) :]
        except BrokenPipeError:
            return False
        except OSError as error:
            raise OutputError(f"answers cannot be written: {error.strerror or error}") from None
        return True


class Datagrams:
    """A UDP port: one line a datagram, answered to its sender, or to the port `send` for all.

    Answers without a receiver are also written to the file `sink`. Datagrams never wait and may be lost.

    While one sender is admitted, a second socket of the same port is connected to it. The kernel gives this socket the
    datagrams of this sender alone, so that those of others, however many, neither fill its buffer nor take time. A few
    of them are answered by a refusal, the rest is lost.
    """

    lost = 0

    def __init__(
        self, port: int, host: str = LOOPBACK, send: int | None = None, sink: BinaryIO | None = None
    ):
        if send is not None:
            as_count(send, "send", maximum=LAST_PORT)
            if send == port:
                raise InvalidInputError(
                    f"send must be another port than udp, or answers come in; both are {port}"
                )
        self._socket = bound(host, port, socket.SOCK_DGRAM, "udp")
        self._socket.setblocking(False)
        self._sink = sink
        address = self._socket.getsockname()
        self._receiver = None if send is None else (address[0], send, *address[2:])
        self.about: dict[str, object] = {"host": address[0], "udp": address[1]}
        self._admitted: Address | None = None
        self._session = self._socket  # of the sender who is admitted
        self._turned_away_at = -math.inf  # [s]

    def close(self) -> None:
        """Close the port."""
        self.dismiss()
        self._socket.close()

    def sources(self) -> list[socket.socket]:
        """Sockets to wait for."""
        return [self._session]

    def admit(self, sender: Address | None) -> list[Line]:
        """Receive the datagrams of this sender alone, until it is dismissed; return those that wait."""
        self.dismiss()
        if sender is None:
            return []
        self._admitted = sender
        # where a port cannot be shared, the datagrams of others are filtered
        with suppress(OSError, AttributeError):
            self._session = _connected(self._socket, sender)
        waiting = _received(self._socket, 256)
        return [line for line in waiting if line.sender == sender]

    def dismiss(self) -> None:
        """Receive the datagrams of all senders."""
        self._admitted = None
        if self._session is not self._socket:
            self._session.close()
        self._session = self._socket

    def receive(self, most: int = 256) -> list[Line]:
        """Datagrams that have arrived; no more than some, since frames are processed in between."""
        lines = _received(self._session, most)
        if self._admitted is None:
            return lines
        return [line for line in lines if line.sender == self._admitted]

    def turn_away(self, most: int = 32, period: float = 0.1) -> None:
        """Refuse some datagrams of others, at most once in a period [s]."""
        now = time.monotonic()
        if self._session is self._socket or now - self._turned_away_at < period:
            return
        self._turned_away_at = now
        lines = _received(self._socket, most)
        text = f"another sender is followed; it must be silent for {SILENCE:g} s before others are"
        refusal = encoded(error=text)
        for other in {line.sender for line in lines} - {self._admitted}:
            self._send_to(refusal, other)

    def send(self, text: bytes, receiver: Address | None = None) -> bool:
        """Send a line to a sender or to the port for all; True, since a lost datagram does not end the connection."""
        if receiver is None and self._sink is not None:
            try:
                self._sink.write(text)
                self._sink.flush()
            except OSError as error:
                raise OutputError(f"answers cannot be written: {error.strerror or error}") from None
        self._send_to(text, self._receiver or receiver)
        return True

    def _send_to(self, text: bytes, receiver: Address | None) -> None:
        if receiver is None:
            return
        # buffers may be full, or nobody can be reached: the datagram is lost, as datagrams may be
        with suppress(OSError):
            self._socket.sendto(text, receiver)

    def blocked(self) -> list[int]:
        """Nothing waits."""
        return []

    def flush(self) -> bool:
        """Nothing waits."""
        return True


def _received(source: socket.socket, most: int) -> list[Line]:
    """Receive datagrams that have arrived, no more than some."""
    received: list[Line] = []
    for _ in range(most):
        try:  # the rest of a longer one is dropped unread
            text, sender = source.recvfrom(FRAME_BYTES + 1)
        except BlockingIOError:
            break
        except OSError:  # an earlier answer did not arrive, since its receiver ended
            continue
        received.append(Line(text if len(text) <= FRAME_BYTES else None, sender))
    return received


def _connected(port: socket.socket, sender: Address) -> socket.socket:
    """Return another socket of the same port that receives from one sender alone."""
    session = socket.socket(port.family, socket.SOCK_DGRAM)
    try:
        session.setblocking(False)
        port.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEPORT, 1)
        session.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEPORT, 1)
        session.bind(port.getsockname())
        session.connect(sender)
    except OSError:
        session.close()
        raise
    finally:
        port.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEPORT, 0)
    session.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEPORT, 0)
    return session
