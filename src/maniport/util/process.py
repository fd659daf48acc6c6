"""Sockets, signals and threads of this process, and workers that end with their parent."""

import os
import signal
import socket
import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import Future
from contextlib import contextmanager
from types import FrameType
from typing import TypeVar, TypeVarTuple

from maniport.errors import InvalidInputError
from maniport.util.validation import as_count

Result = TypeVar("Result")
Arguments = TypeVarTuple("Arguments")

LOOPBACK = "127.0.0.1"
LOOPBACK_NAMES = (
    LOOPBACK,
    "localhost",
    "[::1]",
)  # This machine's own names, as addresses of pages spell them
LAST_PORT = 65_535


def is_loopback(host: str) -> bool:
    """Whether only this machine can reach a host's address."""
    return host in LOOPBACK_NAMES or f"[{host}]" in LOOPBACK_NAMES


def bound(host: str, port: int, kind: socket.SocketKind, name: str = "port") -> socket.socket:
    """Return a socket that is bound to an address; `name` is what messages call the port."""
    as_count(port, name, minimum=0, maximum=LAST_PORT)  # some systems take it modulo 65536
    try:
        family, kind, protocol, _, address = socket.getaddrinfo(host, port, type=kind)[0]
        made = socket.socket(family, kind, protocol)
        try:
            if kind == socket.SOCK_STREAM:  # of datagrams it would let two listen at once
                made.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            made.bind(address)
        except OSError:
            made.close()
            raise
    except OSError as error:
        raise InvalidInputError(
            f"cannot listen on host {host!r}, {name} {port}: {error}. Port 0 takes a free one, host {LOOPBACK} is "
            "always there"
        ) from None
    return made


@contextmanager
def ending_in_order(end: Callable[[], object] | None = None) -> Iterator[None]:
    """Call `end`, or raise `KeyboardInterrupt`, at the first Ctrl-C or termination signal; a second one ends at once.

    In the main thread only.
    """
    before = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}

    def restore() -> None:
        for number, handler in before.items():
            signal.signal(number, handler)

    def ended(number: int, frame: FrameType | None) -> None:
        restore()
        if end is None:
            raise KeyboardInterrupt
        end()

    for number in before:
        signal.signal(number, ended)
    try:
        yield
    finally:
        restore()


def end_with_parent(parent: int) -> None:
    """End this process without a message soon after its parent has ended, and at Ctrl-C."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)

    def watch(period: float = 0.5) -> None:
        while os.getppid() == parent:
            time.sleep(period)
        os._exit(1)

    if os.name == "posix":
        threading.Thread(target=watch, daemon=True).start()


def settled(
    future: Future[Result], work: Callable[[*Arguments], Result], *args: *Arguments
) -> Future[Result]:
    """Call a function and put its result or its error into a future."""
    try:
        future.set_result(work(*args))
    except Exception as error:  # noqa: BLE001 - raised again by the result
        future.set_exception(error)
    return future


def in_background(work: Callable[[*Arguments], Result], *args: *Arguments) -> Future[Result]:
    """Call a function in a thread for which nothing waits when the program ends."""
    future: Future[Result] = Future()
    threading.Thread(target=settled, args=(future, work, *args), daemon=True).start()
    return future
