"""Where lines come in and answers go out: a pipe, or a UDP port."""

import os
import select
import socket
from contextlib import suppress
from typing import Any, BinaryIO, NamedTuple

from maniport.errors import InvalidInputError, OutputError
from maniport.input_limits import FRAME_BYTES
from maniport.ports import LAST_PORT, LOOPBACK, bound
from maniport.validation import as_count

CHUNK = 1 << 16
"""Bytes that are read of a pipe at a time: all that one holds, usually."""
PIECE = 4096
"""Bytes that a pipe which is ready takes at once, by POSIX."""
AT_ONCE = 256
"""Datagrams that are taken before one is worked."""


class Line(NamedTuple):
    """A line without its end, or None where it was too long to be kept; and whom to answer."""

    text: bytes | None
    sender: Any = None


class Pipe:
    """Lines in by a file descriptor, lines out by another.

    Who reads may leave, or stay and not read: then the line that is under way waits, and those that come after it are
    lost, so that nothing else has to wait.

    Parameters
    ----------
    source, sink : int
        File descriptors to read and to write.

    Attributes
    ----------
    lost : int
        Lines that nobody took.
    """

    def __init__(self, source: int, sink: int):
        self._source, self._sink = source, sink
        self._rest, self._too_long = b"", False
        self._waiting, self.lost = b"", 0
        self.about: dict[str, Any] = {}
        """What there is to say of it."""

    def fileno(self) -> int:
        """What to wait for."""
        return self._source

    def receive(self) -> list[Line] | None:
        """The lines that are there, without those that hold nothing; None when there will be no more."""
        data = os.read(self._source, CHUNK)
        if not data and not self._rest and not self._too_long:
            return None
        *whole, rest = (self._rest + (data or b"\n")).split(b"\n")
        if whole and self._too_long:
            whole[0], self._too_long = None, False  # type: ignore[call-overload]
        if len(rest) > FRAME_BYTES:
            rest, self._too_long = b"", True
        self._rest = b"" if self._too_long else rest
        kept = [None if line is None or len(line) > FRAME_BYTES else line for line in whole]
        return [Line(line) for line in kept if line is None or line.strip()]

    def send(self, text: bytes, receiver: Any = None) -> bool:
        """Write a line; whether somebody still reads. Raises OutputError where a disk is full, or the like."""
        if self._waiting:
            self.lost += 1
        else:
            self._waiting = text
        return self.go_on()

    def blocked(self) -> list[int]:
        """What must be ready for writing before a line can go on."""
        return [self._sink] if self._waiting else []

    def go_on(self) -> bool:
        """Write what waits as far as it is taken; whether somebody still reads."""
        try:
            while self._waiting and select.select([], [self._sink], [], 0)[1]:
                self._waiting = self._waiting[os.write(self._sink, self._waiting[:PIECE]) :]
        except BrokenPipeError:
            return False
        except OSError as error:
            raise _not_written(error) from None
        return True


class Datagrams:
    """A UDP port: one line a datagram, answered to who sent it, or to one port for all.

    Parameters
    ----------
    port : int
        To listen on; 0 takes a free one.
    host : str
        Address to listen on. Whoever can reach it moves the robot.
    send : int, optional
        Port of the same address that gets all answers instead of the sender.
    sink : binary stream, optional
        That gets what is for nobody else: the first line.

    Raises
    ------
    InvalidInputError
        When nothing can listen there, or answers would come in again.
    """

    def __init__(self, port: int, host: str = LOOPBACK, send: int | None = None, sink: BinaryIO | None = None):
        if send is not None:
            as_count(send, "send", maximum=LAST_PORT)
            if send == port:
                raise InvalidInputError(f"send must be another port than udp, or answers come in; both are {port}")
        self._socket = bound(host, port, socket.SOCK_DGRAM, "udp")
        self._socket.setblocking(False)
        self._sink, self.lost = sink, 0
        here = self._socket.getsockname()
        self._receiver = None if send is None else (here[0], send, *here[2:])
        self.about = {"host": here[0], "udp": here[1]}

    def fileno(self) -> int:
        """What to wait for."""
        return self._socket.fileno()

    def receive(self) -> list[Line]:
        """The datagrams that are there, at most `AT_ONCE`."""
        found: list[Line] = []
        while len(found) < AT_ONCE:
            try:
                text, sender = self._socket.recvfrom(FRAME_BYTES + 1)  # the rest of a longer one is dropped unread
            except BlockingIOError:
                break
            found.append(Line(text if len(text) <= FRAME_BYTES else None, sender))
        return found

    def send(self, text: bytes, receiver: Any = None) -> bool:
        """Send a line to a sender or to who gets all; True: a datagram that is lost is nobody's end."""
        if receiver is None and self._sink is not None:
            try:
                self._sink.write(text)
                self._sink.flush()
            except OSError as error:
                raise _not_written(error) from None
        to = self._receiver or receiver
        if to is not None:
            with suppress(OSError):  # it is full on the way, or nobody can be reached: lost, as datagrams may be
                self._socket.sendto(text, to)
        return True

    def blocked(self) -> list[int]:
        """Nothing: a datagram goes, or is lost."""
        return []

    def go_on(self) -> bool:
        """Nothing waits."""
        return True

    def close(self) -> None:
        """Listen no more."""
        self._socket.close()


def _not_written(error: OSError) -> OutputError:
    return OutputError(f"answers cannot be written: {error.strerror or error}")
