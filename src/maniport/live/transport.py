"""Where lines come in and answers go out: a pipe, or a UDP port."""

import os
import select
import socket
from contextlib import suppress
from typing import Any, BinaryIO, NamedTuple

from maniport.errors import InvalidInputError, OutputError
from maniport.util.input_limits import FRAME_BYTES
from maniport.util.process import LAST_PORT, LOOPBACK, bound
from maniport.util.validation import as_count


class Line(NamedTuple):
    """A line without its end, and whom to answer."""

    text: bytes | None  # None where it was too long to be kept
    sender: Any = None


class Pipe:
    """Lines in by a file descriptor, lines out by another; `lost` counts answers that could not be written."""

    def __init__(self, source: int, sink: int):
        self._source, self._sink = source, sink
        self._rest, self._too_long = b"", False
        self._waiting, self.lost = b"", 0
        self.about: dict[str, Any] = {}

    def fileno(self) -> int:
        """File descriptor to wait for."""
        return self._source

    def receive(self, size: int = 1 << 16) -> list[Line] | None:
        """Lines that have arrived, without empty ones; None when there will be no more."""
        data = os.read(self._source, size)
        if not data and not self._rest and not self._too_long:
            return None
        *lines, rest = (self._rest + (data or b"\n")).split(b"\n")
        received = [Line(line if len(line) <= FRAME_BYTES else None) for line in lines]
        if lines and self._too_long:
            received[0], self._too_long = Line(None), False
        self._too_long = self._too_long or len(rest) > FRAME_BYTES
        self._rest = b"" if self._too_long else rest
        return [line for line in received if line.text is None or line.text.strip()]

    def send(self, text: bytes, receiver: Any = None) -> bool:
        """Write a line; False when the reader left. Raises OutputError where a disk is full, or the like."""
        if self._waiting:
            self.lost += 1
        else:
            self._waiting = text
        return self.flush()

    def blocked(self) -> list[int]:
        """File descriptors that must be ready for writing before a line can go on."""
        return [self._sink] if self._waiting else []

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
    """

    def __init__(self, port: int, host: str = LOOPBACK, send: int | None = None, sink: BinaryIO | None = None):
        if send is not None:
            as_count(send, "send", maximum=LAST_PORT)
            if send == port:
                raise InvalidInputError(f"send must be another port than udp, or answers come in; both are {port}")
        self._socket = bound(host, port, socket.SOCK_DGRAM, "udp")
        self._socket.setblocking(False)
        self._sink, self.lost = sink, 0
        address = self._socket.getsockname()
        self._receiver = None if send is None else (address[0], send, *address[2:])
        self.about = {"host": address[0], "udp": address[1]}
        self.fileno, self.close = self._socket.fileno, self._socket.close

    def receive(self, most: int = 256) -> list[Line]:
        """Datagrams that have arrived; no more than some, since frames are processed in between."""
        received: list[Line] = []
        with suppress(BlockingIOError):
            while len(received) < most:
                text, sender = self._socket.recvfrom(FRAME_BYTES + 1)  # the rest of a longer one is dropped unread
                received.append(Line(text if len(text) <= FRAME_BYTES else None, sender))
        return received

    def send(self, text: bytes, receiver: Any = None) -> bool:
        """Send a line to a sender or to the port for all; True, since a lost datagram does not end the connection."""
        if receiver is None and self._sink is not None:
            try:
                self._sink.write(text)
                self._sink.flush()
            except OSError as error:
                raise OutputError(f"answers cannot be written: {error.strerror or error}") from None
        if (to := self._receiver or receiver) is not None:
            with suppress(OSError):  # buffers are full, or nobody can be reached: lost, as datagrams may be
                self._socket.sendto(text, to)
        return True

    def blocked(self) -> list[int]:
        """Nothing waits."""
        return []

    def flush(self) -> bool:
        """Nothing waits."""
        return True
