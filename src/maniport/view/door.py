"""Who may come in to the live view, and what they may say.

viser listens to whoever connects: any page that is open in the user's browser could read the panel and move its
controls. The door stands between viser and the network: it asks for the address's token, for the names of the host and
of the page that asks, and passes on only messages that the page itself sends, with values that can be what they are
for.
"""

import contextlib
import gzip
import hmac
import http
import logging
import math
import secrets
import threading
from collections import Counter
from collections.abc import Awaitable, Callable, Iterator
from typing import Any

from maniport.errors import InvalidInputError
from maniport.ports import LOOPBACK_NAMES, is_loopback
from maniport.validation import MAX_POSITION, Bounds, inside

LOG = logging.getLogger("maniport.view")
LARGEST = 1 << 16
"""Bytes of a message; the page's own have a few hundred."""
GUESTS = 64
"""Pages that may look on at the same time."""
TOLD, THEN_EVERY = 5, 10_000
"""How many refusals of a kind are logged one by one, and how often after that."""
LONGEST_TEXT = 200
NUMBERS = {"wxyz": 4, "position": 3, "look_at": 3, "up_direction": 3}
"""How many numbers; of directions and rotations not all may be zero."""
SHORTEST = 1e-6
"""Length of a direction or a quaternion, and distance between camera and what it looks at [m]."""
SCALARS = {
    "fov": Bounds(above=0.0, below=math.pi), "near": Bounds(minimum=0.0, maximum=MAX_POSITION),
    "far": Bounds(above=0.0, maximum=1e3 * MAX_POSITION), "image_height": Bounds(minimum=1, maximum=1e5),
    "image_width": Bounds(minimum=1, maximum=1e5),
}  # fmt: skip
FIELDS = {
    "ViewerCameraMessage": {*NUMBERS, *SCALARS},
    "GuiUpdateMessage": {"uuid", "updates"},
    "TransformControlsUpdateMessage": {"name", "owner", "wxyz", "position"},
    "TransformControlsDragStartMessage": {"name", "owner"},
    "TransformControlsDragEndMessage": {"name", "owner"},
}
"""Messages of the page that are let in, and all that each holds."""


class Door:
    """Lets in who knows the address, and understands what they say.

    Parameters
    ----------
    host : str
        That the page is served on. On a loopback address only its names are let in.

    Attributes
    ----------
    token : str
        First part of the path of every address that is answered.
    """

    def __init__(self, host: str):
        self.token = secrets.token_urlsafe(16)
        self._names = LOOPBACK_NAMES if is_loopback(host) else None
        self._guests = 0
        self._counts: Counter[str] = Counter()

    def refusal(self, headers: Any, path: str) -> str:
        """Why a request is not answered; empty where it is."""
        hosts, origins = headers.get_all("Host"), headers.get_all("Origin")
        if len(hosts) != 1 or len(origins) > 1:
            return "it names no host, or more than one"
        name = hosts[0].rpartition(":")[0] or hosts[0]
        if self._names is not None and name.lower() not in self._names:
            return f"it asks for the host {hosts[0][:LONGEST_TEXT]!r}"
        if origins and origins[0].lower() != f"http://{hosts[0].lower()}":
            return f"it comes from {origins[0][:LONGEST_TEXT]!r}"
        given = path.partition("?")[0].strip("/").split("/")[0]
        if not hmac.compare_digest(given.encode(errors="surrogateescape"), self.token.encode()):
            return "its address lacks the token"
        return ""

    def objection(self, raw: Any) -> str:
        """Why a message is not passed on; empty where it is."""
        from msgspec import DecodeError, msgpack

        if not isinstance(raw, bytes):
            return "it is text"
        try:
            message = msgpack.decode(raw)
        except (DecodeError, RecursionError, UnicodeDecodeError) as error:
            return f"it cannot be decoded: {str(error)[:LONGEST_TEXT]}"
        kind = message.pop("type", None) if isinstance(message, dict) else None
        wanted = FIELDS.get(kind) if isinstance(kind, str) else None
        if wanted is None:
            return f"the page sends no {str(kind)[:LONGEST_TEXT]!r}"
        if set(message) != wanted:
            return f"a {kind} holds other fields"
        return _wrong_value(message)

    def refuse(self, what: str, why: str) -> None:
        """Log that something was refused: one line, and of many only some."""
        self._counts[what] += 1
        count = self._counts[what]
        if count <= TOLD or count % THEN_EVERY == 0:
            LOG.warning("%s refused (%d so far): %s", what, count, " ".join(why.split()))

    @contextlib.contextmanager
    def guarding(self, server_module: Any) -> Iterator[None]:
        """Stand before the server that viser starts meanwhile."""
        usual, passed = server_module.serve, []

        def serve(handler: Callable[[Any], Awaitable[None]], *args: Any, **options: Any) -> Any:
            passed.append(True)
            answer = options.pop("process_request")
            options |= {"max_size": LARGEST, "logger": _quiet(), "process_request": self._answering(answer)}
            return usual(self._listening(handler), *args, **options)

        with _ONE_AT_A_TIME:
            server_module.serve = serve
            try:
                yield
            finally:
                server_module.serve = usual
        if not passed:
            raise InvalidInputError("this version of viser starts its server in a way that cannot be guarded")

    def _answering(self, answer: Callable[[Any, Any], Any]) -> Callable[[Any, Any], Any]:
        def process(connection: Any, request: Any) -> Any:
            why = self.refusal(request.headers, request.path)
            if not why and self._guests >= GUESTS and request.headers.get("Upgrade"):
                why = f"{GUESTS} pages look on already"
            if why:
                self.refuse("a connection was", why)
                return connection.respond(http.HTTPStatus.FORBIDDEN, "maniport view: use the address that it printed\n")
            request.path = "/" + request.path.lstrip("/")[len(self.token) :].lstrip("/")
            try:
                return _titled(answer(connection, request))
            except (OSError, ValueError):  # viser looks for a file of that name, which may be none
                return connection.respond(http.HTTPStatus.NOT_FOUND, "maniport view: there is no such page\n")

        return process

    def _listening(self, handler: Callable[[Any], Awaitable[None]]) -> Callable[[Any], Awaitable[None]]:
        async def listen(connection: Any) -> None:
            usual = connection.recv

            async def recv(*args: Any, **options: Any) -> Any:
                while True:
                    raw = await usual(*args, **options)
                    why = self.objection(raw)
                    if not why:
                        return raw
                    self.refuse("a message was", why)

            connection.recv = recv
            self._guests += 1
            try:
                await handler(connection)
            finally:
                self._guests -= 1

        return listen


def _titled(response: Any) -> Any:
    """Replace the title of viser's page, which viser has no option for."""
    if response is None or not str(response.headers.get("Content-Type", "")).startswith("text/html"):
        return response
    packed = response.headers.get("Content-Encoding") == "gzip"
    page = gzip.decompress(response.body) if packed else response.body
    page = page.replace(b"<title>Viser</title>", b"<title>maniport</title>", 1)
    response.body = gzip.compress(page) if packed else page
    del response.headers["Content-Length"]
    response.headers["Content-Length"] = str(len(response.body))
    return response


_ONE_AT_A_TIME = threading.Lock()


def _wrong_value(message: dict[str, Any]) -> str:
    """What of a message cannot be what it is for; empty where all can."""
    for name, value in message.items():
        if name in NUMBERS:
            good = _vector(value, NUMBERS[name]) and (name in ("position", "look_at") or math.hypot(*value) > SHORTEST)
        elif name in SCALARS:
            good = _number(value) and inside(value, SCALARS[name])
        elif name == "updates":
            good = isinstance(value, dict) and set(value) == {"value"} and _control_value(value["value"])
        else:  # uuid, name and owner
            good = value is None or isinstance(value, int) or _short(value)
        if not good:
            return f"its {name} is none"
    if "look_at" in message and math.dist(message["look_at"], message["position"]) <= SHORTEST:
        return "its camera looks at where it is"
    return ""


def _vector(value: Any, size: int) -> bool:
    return (
        isinstance(value, (list, tuple))
        and len(value) == size
        and all(_number(one) and abs(one) <= MAX_POSITION for one in value)
    )


def _control_value(value: Any) -> bool:
    return isinstance(value, bool) or _number(value) or _short(value)


def _short(value: Any) -> bool:
    return isinstance(value, str) and len(value) <= LONGEST_TEXT


def _number(value: Any) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool) and math.isfinite(value)


def _quiet() -> logging.Logger:
    """A log for the server: who hangs up, or sends nonsense instead of a handshake, is not worth a traceback."""
    log = logging.getLogger("maniport.view.server")
    log.setLevel(logging.CRITICAL)
    return log
