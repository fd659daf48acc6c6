"""Addresses and ports to listen on, and whether others than this machine can reach them."""

import socket

from maniport.errors import InvalidInputError
from maniport.util.validation import as_count

LOOPBACK = "127.0.0.1"
LOOPBACK_NAMES = (LOOPBACK, "localhost", "[::1]")  # This machine's own names, as addresses of pages spell them
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
