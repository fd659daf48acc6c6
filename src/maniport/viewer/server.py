"""The pages: servers on this machine, controls and loop of the live view, and a page for `maniport.Live`."""

import contextlib
import http
import io
import logging
import socket
import threading
import time as clock
from collections.abc import Awaitable, Callable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.spatial.transform import Rotation

from maniport.arms import Arm, as_group
from maniport.errors import InvalidInputError
from maniport.live import LiveState
from maniport.report.page.content import ACHIEVED, PERSON, TARGET
from maniport.report.values import in_axes
from maniport.transfer import METHODS
from maniport.util.optional import viser
from maniport.util.process import LOOPBACK, LOOPBACK_NAMES, bound
from maniport.util.validation import Array
from maniport.viewer.messages import accepted
from maniport.viewer.scene import FIELD_OF_VIEW, NARROW, Scene, camera_for
from maniport.viewer.state import Command, Frame, Target, ViewState

if TYPE_CHECKING:
    from viser import ClientHandle, GuiApi, GuiInputHandle, GuiSliderHandle, ViserServer
    from websockets.asyncio.server import ServerConnection
    from websockets.http11 import Request, Response

Controls = Mapping[str, "GuiInputHandle"]  # viser's handles by their identifiers
Answer = Callable[["ServerConnection", "Request"], "Response | None"]
Handler = Callable[["ServerConnection"], Awaitable[None]]

PROTOCOL_ERROR = 1002  # code with which a connection is closed, as viser does it
NUMBERS_PERIOD = 0.25  # Time between two updates of the numbers [s]; they could not be read faster


BASE_ORIENTATIONS = {
    "as the person": (0.0, 0.0, 0.0),
    "facing the person": (0.0, 0.0, 180.0),
    "on a wall": (0.0, -90.0, 0.0),
    "from the ceiling": (180.0, 0.0, 0.0),
    "at the person's right side": (-90.0, 0.0, 0.0),
}
"""Usual base orientations by name: roll, pitch and yaw from the person's trunk frame to the base frame [degrees]."""

LEGEND = "".join(
    f'<span style="color: rgb{role.rgb}; margin-right: 0.9em; font-weight: bold">● {role.name}</span>'
    for role in (PERSON, TARGET, ACHIEVED)
)
"""Colors of the ellipsoids."""


class Page:
    """A server of viser that this machine alone can reach."""

    _server: "ViserServer"

    def __init__(self, port: int):
        module = viser()
        require_free(port)
        with _silent(), _own_pages_only(self._controls):
            server = module.ViserServer(host=LOOPBACK, port=port, label="maniport", verbose=False)
            self._server = server
        # A program could request an address that opens this page to others.
        server.request_share_url = lambda verbose=True: None
        server.gui.configure_theme(show_logo=False, show_share_button=False)
        server.gui.main_panel.dock_right()
        server.gui.main_panel.set_width(330)
        server.initial_camera.position, server.initial_camera.look_at = map(tuple, camera_for(1.0))
        server.initial_camera.fov = np.radians(FIELD_OF_VIEW)
        server.on_client_connect(fold_panel)
        self.url = f"http://{LOOPBACK}:{server.get_port()}/"

    def _controls(self) -> Controls:
        """Return viser's handles of the controls by their identifiers."""
        if not hasattr(self, "_server"):  # the server is being started
            return {}
        handles: Controls = self._server.gui._gui_input_handle_from_uuid
        return handles

    def stop(self) -> None:
        """End the server; browsers hold a reserve connection for which viser waits 6 s, others need not wait."""
        stopping = threading.Thread(target=self._server.stop, name="stop the page", daemon=True)
        with _silent():
            stopping.start()
            stopping.join(1.5)


def fold_panel(client: "ClientHandle") -> None:
    """Fold the controls of a browser on a phone, where they would cover the scene."""
    if client.camera.aspect < NARROW:
        client.gui.main_panel.minimize()


def require_free(port: int) -> None:
    """Raise unless something can listen there; viser would take another port, or wait for ever."""
    bound(LOOPBACK, port, socket.SOCK_STREAM).close()


def _silent() -> contextlib.AbstractContextManager[io.StringIO]:
    """Keep what viser prints about itself from standard output, which belongs to the caller."""
    return contextlib.redirect_stdout(io.StringIO())


@contextlib.contextmanager
def _own_pages_only(controls: Callable[[], Controls]) -> Iterator[None]:
    """Let the server that viser starts in the context refuse other pages, which could move the controls.

    `controls` returns viser's handles by their identifiers; messages that do not fit them are dropped.
    """
    from websockets.asyncio import server as connections

    usual = connections.serve
    guarded = []
    log = logging.getLogger("maniport.viewer")
    log.setLevel(logging.CRITICAL)  # connections that break off need no traceback

    def serve(handler: Handler, *args: Any, process_request: Answer, **options: Any) -> Any:
        guarded.append(True)

        def answer(connection: "ServerConnection", request: "Request") -> "Response | None":
            return _response(connection, request, process_request)

        async def handle(connection: "ServerConnection") -> None:
            await _handle(connection, handler, controls)

        return usual(handle, *args, process_request=answer, logger=log, **options)

    names = vars(connections)  # viser takes the function from there when it starts its server
    names["serve"] = serve
    try:
        yield
    finally:
        names["serve"] = usual
    if not guarded:
        raise InvalidInputError(
            "this version of viser starts its server in a way that cannot be guarded"
        )


def _response(
    connection: "ServerConnection", request: "Request", process_request: Answer
) -> "Response | None":
    """Return the response to a request; None for a page of this server that opens its connection."""
    hosts = request.headers.get_all("Host")
    origins = request.headers.get_all("Origin")
    upgrades = request.headers.get_all("Upgrade")
    if max(len(hosts), len(origins), len(upgrades)) > 1:
        return connection.respond(
            http.HTTPStatus.BAD_REQUEST, "maniport view: a header occurs more than once\n"
        )
    host = ""
    if hosts:
        host = hosts[0]
    is_own = not origins or origins == [f"http://{host}"]
    if (host.rpartition(":")[0] or host) not in LOOPBACK_NAMES or not is_own:
        return connection.respond(
            http.HTTPStatus.FORBIDDEN, "maniport view: open its address itself\n"
        )
    if "Accept-Encoding" in request.headers:
        del request.headers["Accept-Encoding"]
    try:
        response = process_request(connection, request)
    except (OSError, ValueError):  # no file can have such a name
        return connection.respond(http.HTTPStatus.NOT_FOUND, "maniport view: no such page\n")
    title = b"<title>Viser</title>"  # viser has no option for it
    if response is not None and title in response.body:
        response.body = response.body.replace(title, b"<title>maniport view</title>", 1)
        del response.headers["Content-Length"]
        response.headers["Content-Length"] = str(len(response.body))
    return response


async def _handle(
    connection: "ServerConnection", handler: Handler, controls: Callable[[], Controls]
) -> None:
    """Let viser handle a connection of its own page, of which it gets only accepted messages."""
    version = f"viser-v{viser().__version__}"
    if connection.subprotocol != version:  # viser would print it
        await connection.close(PROTOCOL_ERROR, f"version mismatch; the server has {version}")
        return
    receive = connection.recv

    async def receive_accepted() -> object:
        message = await receive()
        while not accepted(message, controls()):
            message = await receive()
        return message

    connection.recv = receive_accepted  # type: ignore[method-assign, assignment]
    await handler(connection)


class Panel:
    """Controls and numbers of the live view; the loop reads the controls, which call nothing."""

    def __init__(self, gui: "GuiApi", state: ViewState, base_rotation: Array):
        self._state = state
        player = state.playback
        several = len(state.sides) > 1
        self._names = [""]
        if several:
            self._names = [f"{side.teacher.side}: " for side in state.sides]
        moved = "Move the sliders of"
        if player is not None:
            moved = "The recording moves"
        gui.add_markdown(f"{moved} the person's arm; the robot follows. Drag to rotate the view.")
        self._head = gui.add_html("")
        self._method = gui.add_dropdown("Method", tuple(METHODS), initial_value="length-field")
        self._follows = gui.add_checkbox("End effector follows", player is not None)
        button = gui.add_button(
            "Find a better configuration", hint="The robot jumps to the best configuration found"
        )
        button.on_click(lambda _: setattr(state, "jump", True))
        self._sliders: list[GuiSliderHandle] = []
        if player is not None:
            self._plays = gui.add_checkbox("Play", True)
            self._duration = float(player.t[-1])
            self._time = gui.add_slider(
                "Time [s]", 0.0, float(np.ceil(100 * self._duration) / 100), 0.01, 0.0
            )
            self._speed = gui.add_slider("Speed", 0.1, 2.0, 0.1, 1.0)
            self._position = 0.0
            self._written = 0.0  # position in the slider
        else:
            bent = {
                "elv_angle": 60.0,
                "shoulder_elv": 50.0,
                "elbow_flexion": 80.0,
            }  # at first, far from singular
            for side in state.sides:
                arm = side.teacher
                name = ""
                if several:
                    name = f"{side.teacher.side} "
                limits = np.degrees([arm.lower, arm.upper]).round(3).T.tolist()
                with gui.add_folder(f"Person's {name}joints [°]"):
                    for joint, (low, high) in zip(arm.joint_names, limits, strict=True):
                        start = float(np.clip(bent.get(joint, 0.0), low, high))
                        self._sliders.append(gui.add_slider(readable(joint), low, high, 0.5, start))
        self._rotations = orientations_with(base_rotation)
        chosen = "own"
        for name, rotation in self._rotations.items():
            if rotation is base_rotation:
                chosen = name
        self._preset = gui.add_dropdown(
            "Base orientation", tuple(self._rotations), initial_value=chosen
        )
        self._notes = gui.add_markdown("")

    def read(self, seconds: float) -> Command:
        """Return the values of the controls, `seconds` after the last time."""
        player = self._state.playback
        if player is None:
            joints = np.radians([slider.value for slider in self._sliders])
        else:
            if self._time.value != self._written:  # the slider was moved
                self._written = self._time.value
                self._position = min(self._time.value, self._duration)
            elif self._plays.value:
                self._position = (self._position + self._speed.value * seconds) % self._duration
            joints = player(self._position)
        return Command(
            joints, self._method.value, self._rotations[self._preset.value], self._follows.value
        )

    def write(self, frames: Sequence[Frame]) -> None:
        """Write the numbers of the frame of each arm."""
        lines = []
        notes = []
        for name, frame in zip(self._names, frames, strict=True):
            error = ""
            if frame.position_error is not None:
                error = f"; position error {1e3 * frame.position_error:.1f} mm"
            lines += [
                f'<div style="font-size: 2.2em; line-height: 1.1">{frame.distance:.2f}</div>',
                f"<div>{name}ellipsoid distance: {in_axes(frame.distance).replace(' %', '&nbsp;%')}{error}</div>",
            ]
            notes += [f"*{name}{note}*\n" for note in frame.target.notes]
        self._head.content = (
            f'<div style="padding: 0 0.6em">{"".join(lines)}<div>{LEGEND}</div></div>'
        )
        self._notes.content = "\n".join(notes)
        if self._state.playback is not None and self._plays.value:
            self._time.value = self._written = round(self._position, 2)


def orientations_with(base_rotation: Array) -> dict[str, Array]:
    """Return the usual base orientations by name, with a rotation in place of one that equals it, or as "own"."""
    rotations = {}
    place = "own"
    for name, angles in BASE_ORIENTATIONS.items():
        rotation = np.asarray(Rotation.from_euler("xyz", angles, degrees=True).as_matrix())
        rotations[name] = rotation
        if place == "own" and np.allclose(rotation, base_rotation, atol=1e-6):
            place = name
    rotations[place] = base_rotation
    return rotations


def readable(name: str) -> str:
    """Write the name of a joint in words."""
    words = {"elv": "elevation", "rot": "rotation", "pro": "pronation", "sup": "supination"}
    return " ".join(words.get(word, word) for word in name.split("_"))


class LiveView(Page):
    """A page with a state and its controls; the camera of a browser sees the whole scene in its window."""

    def __init__(self, state: ViewState, base_rotation: Array, port: int = 0):
        super().__init__(port)
        self.state = state
        self.rate = 0.0
        try:
            self._panel = Panel(self._server.gui, state, base_rotation)
            first = state.frames(self._panel.read(0.0), 0.0)
            persons = [side.teacher for side in state.sides]
            bases = [side.base for side in state.sides]
            self._scene = Scene(self._server.scene, persons, state.robot, first, bases)
            self.no_surface = self._scene.no_surface
            self._scene.draw(first, base_rotation)
            self._panel.write(first)
            self._server.on_client_connect(self._frame)
        except BaseException:  # Ctrl-C too: a listening server must not stay behind
            self.stop()
            raise

    def run(self, stop: threading.Event, rate: float = 60.0) -> None:
        """Read the controls, let the robot follow and draw, at most so often [Hz], until `stop` is set."""
        before = clock.perf_counter()
        numbers_at = 0.0
        count = 0
        while not stop.is_set():
            started = clock.perf_counter()
            if not self._server.get_clients():
                self.rate = 0.0
                count = 0
                numbers_at = started
                before = started
                stop.wait(0.05)
                continue
            command = self._panel.read(started - before)
            frames = self.state.frames(command, started - before)
            before = started
            count = count + 1
            with self._server.atomic():
                self._scene.draw(frames, command.base_rotation)
                if started - numbers_at >= NUMBERS_PERIOD:
                    self.rate = count / (started - numbers_at)
                    numbers_at = started
                    count = 0
                    self._panel.write(frames)
            stop.wait(max(0.0, 1.0 / rate - (clock.perf_counter() - started)))

    def _frame(self, client: "ClientHandle") -> None:
        position, target = camera_for(client.camera.aspect, len(self.state.sides))
        client.camera.position = (
            position  # viser shifts the target along, so that it is set afterwards
        )
        client.camera.look_at = target


class Onlooker(Page):
    """A page that shows the states of `maniport.Live`, of one arm, without controls."""

    def __init__(self, person: Arm, robot: Arm, port: int = 0):
        super().__init__(port)
        self._person = person
        self._robot = as_group(robot)
        self._scene: Scene | None = None
        self._began = 0.0  # time of the first state that was drawn [s]
        self._text = self._server.gui.add_markdown("The person has not been seen yet.")
        self._written = 0.0
        self._server.gui.add_html(f'<div style="padding: 0 0.6em">{LEGEND}</div>')

    def show(self, state: LiveState) -> None:
        """Draw a state; nothing before the person was seen for the first time."""
        arm = state.arm
        if len(arm.achieved) != 3:
            raise InvalidInputError(
                f"state: the page shows 3×3 ellipsoids; found {arm.achieved.shape}"
            )
        if (
            arm.person is None
            or arm.demonstrated is None
            or arm.target is None
            or arm.distance is None
        ):
            return
        target = Target(arm.person, arm.demonstrated, arm.target)
        frames = [Frame(target, state.joint_positions, arm.achieved, arm.distance)]
        with self._server.atomic():
            if self._scene is None:
                self._scene = Scene(self._server.scene, [self._person], self._robot, frames)
                self._began = state.time
            self._scene.draw(frames, np.eye(3))
            now = clock.monotonic()
            if now - self._written >= NUMBERS_PERIOD:
                error = ""
                if arm.position_error is not None:
                    error = f", position error {1e3 * arm.position_error:.0f} mm"
                numbers = f"ellipsoid distance {arm.distance:.2f}{error}"
                self._text.content = (
                    f"**{state.state}**, {state.time - self._began:.1f} s\n\n{numbers}"
                )
                self._written = now
