"""The page: a server on this machine, and the loop that asks the controls and draws."""

import contextlib
import io
import socket
import threading
import time as clock
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from maniport.optional import viser
from maniport.ports import LOOPBACK, bound
from maniport.signals import ending_in_order
from maniport.validation import Array
from maniport.view.bodies import find_surfaces
from maniport.view.door import Door
from maniport.view.pair import LivePair
from maniport.view.panel import Panel
from maniport.view.recorder import Recorder
from maniport.view.scene import FIELD, ROOMS, Room, Scene, camera_for
from maniport.view.state import LiveState

RATE = 60.0
"""Pictures a second that the loop aims at."""
NUMBERS_EVERY = 0.25
"""Seconds between two updates of the numbers; they could not be read faster."""
STOPPING = 1.5
"""How long to wait for the server's end [s]; it stops listening at once."""
PANEL_WIDTH = 330
"""Of the controls [pixels]."""
IDLE = 0.05
"""How often to look for a browser while there is none [s]."""


class LiveView:
    """A page that shows a state.

    The server keeps the state and all controls: a browser that leaves and comes back, or a second one, finds them as
    they are, and looks from where the last one looked. Nothing moves while no browser is there.

    Parameters
    ----------
    state : LiveState or LivePair
        Of one arm of person and robot, or of both.
    method : str
        Shown first.
    mounting : ndarray, shape (3, 3)
        The first one.
    host : str
        Address to listen on. With others than the default, whoever knows the address of the page can see and move
        the arms from other machines.
    port : int
        Zero for a free one.

    Attributes
    ----------
    url : str
        Where the page is. It holds a token: nobody is answered who does not know it.
    rate : float
        Pictures a second at present; zero while no browser is there.
    bare : str
        Why the robot is shown as a skeleton; empty where its surface is there.

    Raises
    ------
    MissingPackageError
        Without viser.
    InvalidInputError
        When nothing can listen there.
    """

    def __init__(self, state: LiveState | LivePair, method: str, mounting: Array, host: str = LOOPBACK, port: int = 0):
        viser()  # what is missing is told first
        self.state, self.rate, self.bare = state, 0.0, ""
        self._door, self._recorder = Door(host), Recorder(state.each[0].teacher)
        self._server, self.url = guarded_server(self._door, host, port)
        try:
            self._furnish(method, mounting)
        except BaseException:  # Ctrl-C too: what listens must not stay behind
            self.stop()
            raise

    def run(self, stop: threading.Event) -> None:
        """Ask the controls, let the robot follow and draw, until `stop` is set."""
        for one in self.state.each:
            one.refitting.begin()
        before, numbers_at, count = clock.perf_counter(), 0.0, 0
        while not stop.is_set():
            started = clock.perf_counter()
            if not self._server.get_clients():
                self.rate, count, numbers_at, before = 0.0, 0, started, started
                stop.wait(IDLE)
                continue
            seconds = started - before
            pictures = self.state.pictures(self._panel.read(seconds), seconds)
            self._panel.note(pictures, seconds)
            if said := self._recorder.take(self._panel.records, pictures[0].teacher_joints, seconds):
                self._panel.tell(said)
            before, count = started, count + 1
            with self._server.atomic():
                self._scene.draw(pictures, self._panel.covered)
                if started - numbers_at >= NUMBERS_EVERY:
                    self.rate = count / (started - numbers_at)
                    numbers_at, count = started, 0
                    self._panel.write(pictures, self.rate)
            stop.wait(max(0.0, 1.0 / RATE - (clock.perf_counter() - started)))

    def run_until_interrupted(self, announce: Callable[[], None]) -> None:
        """Run until Ctrl-C, or a termination signal; a second one ends at once. Only from the main thread."""
        stop = threading.Event()
        with ending_in_order(stop.set):
            announce()
            self.run(stop)

    def stop(self) -> None:
        """End the server and the fits; one that is under way goes on in its daemon thread, and nothing waits for it."""
        for one in self.state.each:
            one.refitting.close(0.0)
        stop_server(self._server)

    def _furnish(self, method: str, mounting: Array) -> None:
        """Put the controls and the first picture on the page."""
        server, state = self._server, self.state
        surfaces, self.bare = find_surfaces(state.robot)
        self._panel = Panel(server.gui, state, method, mounting, self._door, self.bare)
        first = state.pictures(self._panel.read(0.0), 0.0)
        self._scene = Scene(
            server.scene,
            first,
            [one.teacher for one in state.each],
            state.robot,
            surfaces,
            [one.base for one in state.each],
        )
        self._panel.gizmo = self._scene.gizmo
        self._panel.note(first, 0.0)
        self._panel.write(first, 0.0)
        self._look()

    def _look(self) -> None:
        """Let browsers look from where the last one looked."""
        last: dict[str, Any] = {}

        def welcome(client: Any) -> None:
            ours = _frame(client.camera, self._scene.room)

            def remember(camera: Any) -> None:
                nonlocal ours
                if np.allclose(camera.position, ours, atol=1e-3):  # nobody has moved it; its window may be another
                    if not np.allclose(camera_for(camera.aspect, self._scene.room)[0], ours, atol=1e-3):
                        ours = _frame(camera, self._scene.room)
                    return
                last.update(up_direction=camera.up_direction, position=camera.position, look_at=camera.look_at)

            with contextlib.suppress(ValueError):  # on the way from one view to the other nothing is seen at times
                for name in last:
                    setattr(client.camera, name, last[name])
            client.camera.on_update(remember)

        self._server.on_client_connect(welcome)


def _frame(camera: Any, room: Room) -> Array:
    """Let a camera see both bodies in its window; return where it is then."""
    place, camera.look_at = camera_for(camera.aspect, room)
    camera.position = place
    return place


def guarded_server(door: Door, host: str, port: int) -> tuple[Any, str]:
    """A server of viser that a door stands before, and its address with the token; seen from the front."""
    module = viser()
    require_free(host, port)
    from websockets.asyncio import server as connections

    with _silent(), door.guarding(connections):
        server = module.ViserServer(host=host, port=port, label="maniport", verbose=False)

    def log(loop: Any, context: dict[str, Any]) -> None:
        """Say in a line what went wrong while a message was worked on; the page goes on."""
        door.refuse("a message was", f"{context.get('exception') or context.get('message')}")

    server.get_event_loop().set_exception_handler(log)
    # any page in the browser could ask for it, and would hand this one to strangers
    server.request_share_url = lambda verbose=True: None
    server.gui.configure_theme(show_logo=False, show_share_button=False)
    server.gui.main_panel.dock_right()
    server.gui.main_panel.set_width(PANEL_WIDTH)
    server.initial_camera.position, server.initial_camera.look_at = map(tuple, camera_for(1.0, ROOMS[1]))
    server.initial_camera.fov = np.radians(FIELD)
    shown = f"[{host}]" if ":" in host else host
    return server, f"http://{shown}:{server.get_port()}/{door.token}/"


def stop_server(server: Any) -> None:
    """End a server."""
    # Browsers hold a connection in reserve that viser waits for, 6 s long: no reason for anyone else to wait.
    stopping = threading.Thread(target=server.stop, name="stop the page", daemon=True)
    with _silent():
        stopping.start()
        stopping.join(STOPPING)


def require_free(host: str, port: int) -> None:
    """Raise unless something can listen there; viser would take another port, or wait for ever."""
    bound(host, port, socket.SOCK_STREAM).close()


@contextlib.contextmanager
def _silent() -> Iterator[None]:
    """Keep what viser prints about itself from standard output, which belongs to the caller."""
    with contextlib.redirect_stdout(io.StringIO()):
        yield
