"""Access to the live view: who may connect, and which messages are passed on.

viser accepts every connection: any page in the user's browser could read the panel and move its controls. Requests
therefore need the address's token and the names of this host and page, and only messages that the page itself sends
pass, with valid values.
"""

import contextlib
import gzip
import hmac
import http
import logging
import math
import secrets
import sys
import threading
from collections import Counter
from collections.abc import Awaitable, Callable, Iterator
from functools import cache, partial
from types import GenericAlias
from typing import Annotated, Any

from maniport.errors import InvalidInputError
from maniport.util.ports import LOOPBACK_NAMES, is_loopback
from maniport.util.validation import MAX_POSITION

LOG = logging.getLogger("maniport.viewer")
MESSAGE_BYTES = 1 << 16  # Largest message; the page's own have a few hundred bytes
MAX_PAGES = 64  # Pages that may be connected at the same time
LOGGED = 5  # So many refusals of a kind are logged one by one, then every 10 000th
LONGEST_TEXT = 200
SHORTEST = 1e-6  # Least length of a direction or a quaternion, and distance between camera and its target [m]


@cache
def _decoder() -> Any:
    """Return the decoder of the messages that pass, with all fields of each and their ranges; nan is out of range."""
    from msgspec import Meta, defstruct, msgpack  # comes with viser

    def number(low: float, high: float) -> Any:
        return Annotated[float, Meta(ge=low, le=high)]

    text, finite = Annotated[str, Meta(max_length=LONGEST_TEXT)], number(-sys.float_info.max, sys.float_info.max)
    length, size = number(-MAX_POSITION, MAX_POSITION), number(1.0, 1e5)
    camera = {
        **dict.fromkeys(("position", "look_at", "up_direction"), GenericAlias(tuple, 3 * (length,))),
        "wxyz": GenericAlias(tuple, 4 * (length,)),
        "fov": number(1e-3, math.pi - 1e-3),
        "near": number(0.0, MAX_POSITION),
        "far": number(1e-3, 1e3 * MAX_POSITION),
        "image_height": size,
        "image_width": size,
    }
    updates = defstruct("Updates", [("value", bool | finite | text)], forbid_unknown_fields=True)
    fields = {"ViewerCameraMessage": camera, "GuiUpdateMessage": {"uuid": text, "updates": updates}}
    kinds = [defstruct(name, own.items(), tag_field="type", tag=name, forbid_unknown_fields=True)
             for name, own in fields.items()]  # fmt: skip
    return msgpack.Decoder(kinds[0] | kinds[1])


class AccessControl:
    """Refuses requests without the token, and messages that the page does not send."""

    def __init__(self, host: str):
        self.token = secrets.token_urlsafe(16)
        self._names = LOOPBACK_NAMES if is_loopback(host) else None
        self._pages = 0
        self._counts: Counter[str] = Counter()

    def refusal(self, headers: Any, path: str) -> str:
        """Why a request is not answered; empty where it is."""
        hosts, origins = headers.get_all("Host"), headers.get_all("Origin")
        if len(hosts) != 1 or len(origins) > 1:
            return "it names no host, or more than one"
        name = hosts[0].rpartition(":")[0] or hosts[0]
        if self._names is not None and name.lower() not in self._names:
            return f"it requests the host {hosts[0][:LONGEST_TEXT]!r}"
        if origins and origins[0].lower() != f"http://{hosts[0].lower()}":
            return f"it comes from {origins[0][:LONGEST_TEXT]!r}"
        token = path.partition("?")[0].strip("/").split("/")[0]
        if not hmac.compare_digest(token.encode(errors="surrogateescape"), self.token.encode()):
            return "its address lacks the token"
        return ""

    def objection(self, raw: Any) -> str:
        """Why a message is not passed on; empty where it is."""
        if not isinstance(raw, bytes):
            return "it is text"
        try:
            message = _decoder().decode(raw)
        except (ValueError, RecursionError) as error:  # msgspec's errors are ValueErrors, too
            return str(error)[:LONGEST_TEXT]
        if hasattr(message, "updates"):
            return ""
        if min(math.hypot(*message.wxyz), math.hypot(*message.up_direction)) <= SHORTEST:
            return "a direction of its camera has no length"
        return "its camera looks at itself" if math.dist(message.look_at, message.position) <= SHORTEST else ""

    def refuse(self, what: str, why: str) -> None:
        """Log that something was refused: one line, and of many only some."""
        self._counts[what] += 1
        count = self._counts[what]
        if count <= LOGGED or count % 10_000 == 0:
            LOG.warning("%s refused (%d so far): %s", what, count, " ".join(why.split()))

    @contextlib.contextmanager
    def guarding(self, server_module: Any) -> Iterator[None]:
        """Guard the server that viser starts in the context."""
        usual, passed = server_module.serve, []
        log = logging.getLogger("maniport.viewer.server")
        log.setLevel(logging.CRITICAL)  # connections that break off need no traceback

        def serve(handler: Callable[[Any], Awaitable[None]], *args: Any, **options: Any) -> Any:
            passed.append(True)
            answer = options.pop("process_request")
            options |= {"max_size": MESSAGE_BYTES, "logger": log, "process_request": partial(self._answer, answer)}
            return usual(partial(self._listen, handler), *args, **options)

        with _ONE_AT_A_TIME:
            server_module.serve = serve
            try:
                yield
            finally:
                server_module.serve = usual
        if not passed:
            raise InvalidInputError("this version of viser starts its server in a way that cannot be guarded")

    def _answer(self, answer: Callable[[Any, Any], Any], connection: Any, request: Any) -> Any:
        """Answer a request as viser does, unless it is refused."""
        why = self.refusal(request.headers, request.path)
        if not why and self._pages >= MAX_PAGES and request.headers.get("Upgrade"):
            why = f"{MAX_PAGES} pages are connected already"
        if why:
            self.refuse("a connection was", why)
            return connection.respond(http.HTTPStatus.FORBIDDEN, "maniport view: use the address that it printed\n")
        request.path = "/" + request.path.lstrip("/")[len(self.token) :].lstrip("/")
        try:
            return _titled(answer(connection, request))
        except (OSError, ValueError):  # viser looks for a file of that name, which may be none
            return connection.respond(http.HTTPStatus.NOT_FOUND, "maniport view: there is no such page\n")

    async def _listen(self, handler: Callable[[Any], Awaitable[None]], connection: Any) -> None:
        """Handle a connection as viser does, with valid messages alone."""
        usual = connection.recv

        async def recv(*args: Any, **options: Any) -> Any:
            while True:
                raw = await usual(*args, **options)
                why = self.objection(raw)
                if not why:
                    return raw
                self.refuse("a message was", why)

        connection.recv = recv
        self._pages += 1
        try:
            await handler(connection)
        finally:
            self._pages -= 1


def _titled(response: Any) -> Any:
    """Replace the title of viser's page, which viser has no option for."""
    if response is None or not str(response.headers.get("Content-Type", "")).startswith("text/html"):
        return response
    packed = response.headers.get("Content-Encoding") == "gzip"
    page = gzip.decompress(response.body) if packed else response.body
    page = page.replace(b"<title>Viser</title>", b"<title>maniport view</title>", 1)
    response.body = gzip.compress(page) if packed else page
    del response.headers["Content-Length"]
    response.headers["Content-Length"] = str(len(response.body))
    return response


_ONE_AT_A_TIME = threading.Lock()


class Control:
    """A control of the page whose value is always valid, whatever a browser sends."""

    def __init__(self, handle: Any, access: AccessControl, allows: Callable[[Any], bool]):
        self.handle, self._access, self._allows, self._valid = handle, access, allows, handle.value

    @property
    def value(self) -> Any:
        """The newest valid value; others are taken back on the page."""
        value = self.handle.value
        if self._allows(value):
            self._valid = value
        else:
            self._access.refuse("a value was", f"{str(value)[:80]!r} is no value of this control")
            self.handle.value = self._valid
        return self._valid

    @value.setter
    def value(self, value: Any) -> None:
        self._valid = value
        self.handle.value = value
