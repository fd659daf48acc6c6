"""The pages: servers on this machine, the loop of the live view, and a page for `maniport.Live`."""

import contextlib
import http
import io
import logging
import socket
import threading
import time as clock
from collections.abc import Iterator
from typing import Any

import numpy as np

from maniport.arms import Arm
from maniport.errors import InvalidInputError
from maniport.live import LiveState
from maniport.util.optional import viser
from maniport.util.process import LOOPBACK, LOOPBACK_NAMES, bound
from maniport.util.validation import Array
from maniport.viewer.panel import Panel
from maniport.viewer.scene import FIELD_OF_VIEW, Scene, camera_for, find_surfaces
from maniport.viewer.state import Frame, Target, ViewState

NUMBERS_PERIOD = 0.25  # Time between two updates of the numbers [s]; they could not be read faster


class Page:
    """A server of viser that this machine alone can reach."""

    def __init__(self, port: int):
        module = viser()
        require_free(port)
        with _silent(), _own_pages_only():
            self._server = server = module.ViserServer(host=LOOPBACK, port=port, label="maniport", verbose=False)
        server.request_share_url = lambda verbose=True: None  # a program could request it, and open this page to others
        server.gui.configure_theme(show_logo=False, show_share_button=False)
        server.gui.main_panel.dock_right()
        server.gui.main_panel.set_width(330)
        server.initial_camera.position, server.initial_camera.look_at = map(tuple, camera_for(1.0))
        server.initial_camera.fov = np.radians(FIELD_OF_VIEW)
        self.url = f"http://{LOOPBACK}:{server.get_port()}/"

    def stop(self) -> None:
        """End the server; browsers hold a reserve connection for which viser waits 6 s, others need not wait."""
        stopping = threading.Thread(target=self._server.stop, name="stop the page", daemon=True)
        with _silent():
            stopping.start()
            stopping.join(1.5)


def require_free(port: int) -> None:
    """Raise unless something can listen there; viser would take another port, or wait for ever."""
    bound(LOOPBACK, port, socket.SOCK_STREAM).close()


def _silent() -> contextlib.AbstractContextManager[Any]:
    """Keep what viser prints about itself from standard output, which belongs to the caller."""
    return contextlib.redirect_stdout(io.StringIO())


@contextlib.contextmanager
def _own_pages_only() -> Iterator[None]:
    """Let the server that viser starts in the context refuse other pages of the user's browser.

    viser accepts every connection: any page could connect to this address, or to a host name of its own that leads
    here, and move the controls. Requests must therefore name this machine, and come from the page itself.
    """
    from websockets.asyncio import server as connections

    usual, guarded = connections.serve, []
    log = logging.getLogger("maniport.viewer")
    log.setLevel(logging.CRITICAL)  # connections that break off need no traceback

    def serve(*args: Any, process_request: Any, **options: Any) -> Any:
        guarded.append(True)

        def answer(connection: Any, request: Any) -> Any:
            host, origin = request.headers.get("Host", ""), request.headers.get("Origin")
            if (host.rpartition(":")[0] or host) not in LOOPBACK_NAMES or origin not in (None, f"http://{host}"):
                return connection.respond(http.HTTPStatus.FORBIDDEN, "maniport view: open its address itself\n")
            request.headers.pop("Accept-Encoding", None)
            response = process_request(connection, request)
            if response is not None and b"<title>Viser</title>" in response.body:  # viser has no option for it
                response.body = response.body.replace(b"<title>Viser</title>", b"<title>maniport view</title>", 1)
                response.headers.pop("Content-Length")
                response.headers["Content-Length"] = str(len(response.body))
            return response

        return usual(*args, process_request=answer, logger=log, **options)

    connections.serve = serve  # type: ignore[assignment, misc]
    try:
        yield
    finally:
        connections.serve = usual  # type: ignore[misc]
    if not guarded:
        raise InvalidInputError("this version of viser starts its server in a way that cannot be guarded")


class LiveView(Page):
    """A page with a state and its controls; the camera of a browser sees the whole scene in its window."""

    def __init__(self, state: ViewState, method: str, base_rotation: Array, port: int = 0):
        super().__init__(port)
        self.state, self.rate, self.no_surface = state, 0.0, ""
        try:
            surfaces, self.no_surface = find_surfaces(state.robot)
            self._panel = Panel(self._server.gui, state, method, base_rotation)
            first = state.frames(self._panel.read(0.0), 0.0)
            self._scene = Scene(self._server.scene, first, state.robot, surfaces, [side.base for side in state.sides])
            self._panel.write(first)
            self._server.on_client_connect(self._frame)
        except BaseException:  # Ctrl-C too: a listening server must not stay behind
            self.stop()
            raise

    def run(self, stop: threading.Event, rate: float = 60.0) -> None:
        """Read the controls, let the robot follow and draw, at most so often [Hz], until `stop` is set."""
        before, numbers_at, count = clock.perf_counter(), 0.0, 0
        while not stop.is_set():
            started = clock.perf_counter()
            if not self._server.get_clients():
                self.rate, count, numbers_at, before = 0.0, 0, started, started
                stop.wait(0.05)
                continue
            seconds = started - before
            frames = self.state.frames(self._panel.read(seconds), seconds)
            before, count = started, count + 1
            with self._server.atomic():
                self._scene.draw(frames)
                if started - numbers_at >= NUMBERS_PERIOD:
                    self.rate = count / (started - numbers_at)
                    numbers_at, count = started, 0
                    self._panel.write(frames)
            stop.wait(max(0.0, 1.0 / rate - (clock.perf_counter() - started)))

    def _frame(self, client: Any) -> None:
        position, target = camera_for(client.camera.aspect, len(self.state.sides))
        client.camera.position = position  # viser shifts the target along, so that it is set afterwards
        client.camera.look_at = target


class Onlooker(Page):
    """A page that shows the states of `maniport.Live`, of one arm, without controls."""

    def __init__(self, person: Arm, robot: Arm, port: int = 0):
        super().__init__(port)
        self._person, self._robot = person, robot
        self._scene: Scene | None = None
        self._text, self._written = self._server.gui.add_markdown("The person has not been seen yet."), 0.0

    def show(self, state: LiveState) -> None:
        """Draw a state; nothing before the person was seen for the first time."""
        arm = state.arm
        if len(arm.achieved) != 3:
            raise InvalidInputError(f"state: the page shows 3×3 ellipsoids; found {arm.achieved.shape}")
        if arm.person is None or arm.demonstrated is None or arm.target is None or arm.distance is None:
            return
        target = Target(arm.person, arm.demonstrated, arm.target, np.eye(3))
        joints = state.joint_positions
        frame = Frame(self._person, self._robot, target, joints, arm.achieved, arm.distance, np.eye(3))
        with self._server.atomic():
            if self._scene is None:
                surfaces = find_surfaces(self._robot)[0]
                self._scene = Scene(self._server.scene, [frame], self._robot, surfaces)
            self._scene.draw([frame])
            if (now := clock.monotonic()) - self._written >= NUMBERS_PERIOD:
                error = "" if arm.position_error is None else f", position error {1e3 * arm.position_error:.0f} mm"
                numbers = f"{state.time:.1f} s: distance {arm.distance:.2f}{error}"
                self._text.content, self._written = f"**{state.state}**\n\n{numbers}", now
