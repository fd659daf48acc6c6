"""The pages: controls, server, and how a browser shows them."""

import contextlib
import socket
import sys
import time
import urllib.error
import urllib.request
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from maniport.arms import Arm
from maniport.errors import FileFormatError, InvalidInputError, MissingPackageError
from maniport.live import LiveArm, LiveState
from maniport.viewer.scene import camera_for
from maniport.viewer.server import LiveView, Onlooker, Panel, require_free

pytestmark = pytest.mark.slow

viser = pytest.importorskip("viser")
msgspec, zstandard, client, errors = map(  # viser's own
    pytest.importorskip, ("msgspec", "zstandard", "websockets.sync.client", "websockets.exceptions")
)

CAMERA = {
    "type": "ViewerCameraMessage",
    "wxyz": (1.0, 0.0, 0.0, 0.0),
    "position": (3.0, 0.0, 1.0),
    "fov": 0.8,
    "near": 0.01,
    "far": 1000.0,
    "image_height": 600,
    "image_width": 900,
    "look_at": (0.0, 0.0, 1.0),
    "up_direction": (0.0, 0.0, 1.0),
}


def wait_until(condition, patience=60.0):
    """Wait until a condition holds, at most so long [s]."""
    begun = time.monotonic()
    while not condition():
        assert time.monotonic() - begun < patience
        time.sleep(0.005)


def connected(url, origin=None, **headers):
    """Connect as the page does, from a page of some origin where one is given."""
    options = {
        "origin": origin,
        "subprotocols": [f"viser-v{viser.__version__}"],
        "additional_headers": headers,
    }
    return client.connect(url.replace("http", "ws", 1), max_size=None, **options)


def receive(url, enough):
    """Messages of the windows that arrive until `enough(windows)`, each window as it came: (name, type) pairs."""
    windows = []
    with connected(url) as page:
        page.send(msgspec.msgpack.encode(CAMERA))
        while not enough(windows):
            window = page.recv(timeout=60)
            told = int.from_bytes(window[8:16], "little")
            inner = msgspec.msgpack.decode(zstandard.decompress(window[16 : 16 + told]))
            windows.append(
                [(message.get("name"), message["type"]) for message in inner["messages"]]
            )
    return windows


@pytest.fixture
def make_view(make_state):
    with contextlib.ExitStack() as stack:

        def make(**options):
            view = LiveView(make_state(**options), np.eye(3))
            stack.callback(view.stop)
            return view

        yield make


def test_the_page_is_served_on_this_machine_only(make_view, make_state, capsys, monkeypatch):
    view = make_view()
    assert view.url.startswith("http://127.0.0.1:")
    with urllib.request.urlopen(view.url, timeout=60) as answer:
        assert b"<title>maniport view</title>" in answer.read()
    assert view._server._websock_server._host == "127.0.0.1"
    assert view._server.request_share_url() is None
    assert capsys.readouterr().out == ""
    for port in (view._server.get_port(), -1, 70000):
        with pytest.raises(InvalidInputError):
            LiveView(make_state(), np.eye(3), port)
    monkeypatch.setitem(sys.modules, "viser", None)
    with pytest.raises(MissingPackageError, match=r"\.\[view\]"):
        LiveView(make_state(), np.eye(3))


def test_other_pages_of_the_browser_cannot_connect(make_view):
    url = make_view().url
    here = url.split("/")[2]
    for origin in (
        "http://evil.example",
        "null",
        f"https://{here}",
        "http://localhost:1",
        "file://",
    ):
        with pytest.raises(errors.InvalidStatus) as refused, connected(url, origin):
            pass
        assert refused.value.response.status_code == 403
    for origin in (f"http://{here}", None):
        with connected(url, origin) as guest:
            assert guest.recv(timeout=60)
    for host in ("evil.example", "evil.example:80", "127.0.0.1.evil.example:1", "", "[::2]:1"):
        with pytest.raises(urllib.error.HTTPError, match="403"):
            urllib.request.urlopen(urllib.request.Request(url, headers={"Host": host}), timeout=60)


def status_of(url, *lines, path="/"):
    """Send a request as it is, and return the status of the answer."""
    host, port = url.split("/")[2].split(":")
    with socket.create_connection((host, int(port)), timeout=60) as stream:
        stream.sendall("\r\n".join([f"GET {path} HTTP/1.1", *lines, "", ""]).encode())
        return int(stream.makefile("rb").readline().split()[1])


def test_odd_requests_are_refused(make_view):
    """Headers that occur twice, and names that no file can have, are errors of the client."""
    url = make_view().url
    host = f"Host: {url.split('/')[2]}"
    origin = f"Origin: {url.rstrip('/')}"
    assert status_of(url, host) == status_of(url, host, origin) == 200
    assert status_of(url, host, "Accept-Encoding: gzip", "Accept-Encoding: br") == 200
    for lines in (
        (host, host),
        (host, "Host: evil.example"),
        ("Host: evil.example", host),
        (host, origin, origin),
        (host, "Upgrade: websocket", "Upgrade: h2c"),
    ):
        assert status_of(url, *lines) == 400
    assert status_of(url) == 403
    for path in (
        "/" + 7000 * "a",
        "/" + 2000 * "a/",
        "/%00",
        "/a%00/b",
        "/%ff%fe",
        "/%ed%a0%80",
        "/..%2f..%2fetc/passwd",
        "//",
        "/assets",
        "nothing",
        "/nothing?" + 7000 * "b",
    ):
        assert status_of(url, host, path=path) in (200, 404), path
    assert status_of(url, host, path="/" + 7000 * "a") == 404


NAN = float("nan")
INFINITY = float("inf")


def test_messages_that_no_page_sends_are_dropped(make_view, capfd):
    """No message of a program on this machine prints a traceback, or reaches the controls."""
    view = make_view()
    panel = view._panel
    before = panel.read(0.0)
    cameras = [
        {name: value}
        for value in (0, -1, INFINITY, -INFINITY, NAN, 1e300, "1", None, [], True)
        for name in ("image_height", "image_width", "fov", "near", "far")
    ]
    cameras += [
        {name: value}
        for value in ((NAN,) * 4, (INFINITY,) * 3, (0.0,) * 4, (), 1.0, "abcd", None)
        for name in ("wxyz", "position", "look_at", "up_direction")
        if (name, value) == ("wxyz", (0.0,) * 4) or value != (0.0,) * 4
    ]
    slider = panel._sliders[0]._impl.uuid
    updates = [
        {"uuid": uuid, "updates": update}
        for uuid, values in (
            (slider, (NAN, INFINITY, 1e6, -1e6, "1", None, [1], {}, True)),
            (panel._method._impl.uuid, ("nothing", 1, None, [])),
            (panel._follows._impl.uuid, (1, "yes", None)),
            (panel._head._impl.uuid, ("<script>",)),
            ("nothing", (1.0,)),
            (1, (1.0,)),
        )
        for update in ({"value": value} for value in values)
    ]
    updates += [
        {"uuid": slider, "updates": {"min": 1.0}},
        {"uuid": slider, "updates": {"nothing": 1.0}},
        {"uuid": slider, "updates": {}},
        {"uuid": slider, "updates": 1},
        {"uuid": slider},
    ]
    messages = [CAMERA | change for change in cameras]
    messages += [{"type": "GuiUpdateMessage", **update} for update in updates]
    messages += [
        {name: value for name, value in CAMERA.items() if name != "fov"},
        {},
        {"type": "nothing"},
        {"type": 1},
        {"type": "ShareUrlRequest"},
        {"type": "GuiFormSubmitMessage", "uuid": slider},
        [1],
        7,
    ]
    junk = [b"", b"\xc1", b"\x91" * 100_000, msgspec.msgpack.encode(CAMERA)[:-1]]
    with connected(view.url) as page:
        page.send("a text")
        for content in (*junk, *map(msgspec.msgpack.encode, messages)):
            page.send(content)
        page.send(msgspec.msgpack.encode(CAMERA))  # still connected
        wait_until(lambda: len(view._server.get_clients()) == 1)
        moved = {"uuid": slider, "updates": {"value": 12.5}}
        page.send(msgspec.msgpack.encode({"type": "GuiUpdateMessage", **moved}))
        wait_until(lambda: panel._sliders[0].value == 12.5)
        (guest,) = view._server.get_clients().values()
        assert guest.camera.image_height == CAMERA["image_height"]
    after = panel.read(0.0)
    assert after.joints[0] == pytest.approx(np.radians(12.5))
    np.testing.assert_array_equal(after.joints[1:], before.joints[1:])
    assert (after.method, after.follow_hand) == (before.method, before.follow_hand)
    assert "".join(capfd.readouterr()) == ""


def test_a_page_of_another_version_is_refused(make_view, capfd):
    options = {"subprotocols": ["viser-v0.0.1"], "max_size": None}
    url = make_view().url.replace("http", "ws", 1)
    with client.connect(url, **options) as page, pytest.raises(errors.ConnectionClosed) as closed:
        page.recv(timeout=60)
    assert closed.value.rcvd.code == 1002
    assert "version" in closed.value.rcvd.reason
    assert "".join(capfd.readouterr()) == ""


def test_controls_become_commands(make_view):
    view = make_view()
    panel = view._panel
    panel._method.value = "nearest-neighbor"
    panel._follows.value = True
    panel._sliders[3].value = 45.0
    command = panel.read(0.02)
    assert (command.method, command.follow_hand) == ("nearest-neighbor", True)
    assert command.joints[3] == pytest.approx(np.pi / 4)
    for word in ("distance", "person", "target", "achieved"):
        assert word in panel._head.content
    assert "nan" not in panel._head.content
    for name, base in (
        ("on a wall", (1, 0, 0)),
        ("from the ceiling", (0, 0, -1)),
        ("at the person's right side", (0, -1, 0)),
        ("as the person", (0, 0, 1)),
    ):
        panel._preset.value = name
        assert pytest.approx(base) == panel.read(0.0).base_rotation.T @ [0, 0, 1]
    own = Rotation.from_euler("xyz", [30, -20, 75], degrees=True).as_matrix()
    np.testing.assert_array_equal(
        Panel(view._server.gui, view.state, own).read(0.0).base_rotation, own
    )


@pytest.mark.parametrize(
    "error", [FileFormatError("a mesh is missing: 'hand.dae'"), KeyboardInterrupt()]
)
def test_errors_before_the_page_is_complete(make_state, monkeypatch, error):
    def surfaces(self):
        raise error

    monkeypatch.setattr(Arm, "surfaces", surfaces)
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    if isinstance(error, KeyboardInterrupt):
        with pytest.raises(KeyboardInterrupt):
            LiveView(make_state(), np.eye(3), port=port)
    else:
        view = LiveView(make_state(), np.eye(3), port=port)
        view.stop()
        assert view.no_surface == "a mesh is missing: 'hand.dae'"
    require_free(port)


def test_frames_arrive_whole_and_meshes_once(make_view, running):
    def moving(windows):
        return [
            window for window in windows if ("/robot/surface/7", "SetPositionMessage") in window
        ]

    view = make_view(recorded=True)
    with running(view):
        windows = receive(view.url, lambda windows: len(moving(windows)) > 20)
    corners = len(view.state.sides[0].teacher.skeleton(np.zeros(7)))
    moves = (
        f"/person/arm/{corners - 1}",
        f"/person/arm/rod/{corners - 2}",
        "/robot/surface/7",
        "/person/ellipsoid",
        "/robot/target",
        "/robot/achieved",
    )
    shapes = [name for window in windows for name, kind in window if kind == "MeshMessage"]
    assert len(shapes) == len(set(shapes)) == len(view.state.robot.arms[0].surfaces())
    for frame in moving(windows)[1:]:
        assert {(name, "SetPositionMessage") for name in moves} <= set(frame)


def test_a_browser_shows_the_page(make_view, running, browser):
    view = make_view()
    panel = view._panel

    def cameras():
        return [client.camera for client in view._server.get_clients().values()]

    with running(view):
        browser.dress(900, 480)  # little to draw without a graphics card
        browser.go(view.url)
        browser.wait("!!document.body && document.body.innerText.includes('distance')")
        browser.wait(lambda: view.rate > 0)
        browser.wait(
            lambda: np.allclose(
                cameras()[0].position, camera_for(cameras()[0].aspect)[0], atol=1e-3
            )
        )
        browser.wait(
            lambda: np.allclose(cameras()[0].look_at, camera_for(cameras()[0].aspect)[1], atol=1e-3)
        )
        browser.wait("document.querySelectorAll('[role=slider]').length > 6")
        thumb = "document.querySelector('[role=slider]').getBoundingClientRect()"
        browser.wait(f"{thumb}.x > 500")
        before = panel.read(0.0).joints

        def moved():  # a drag while the page is being laid out has no effect
            x, y = browser.run(
                f"(({{x, y, width, height}}) => [x + width / 2, y + height / 2])({thumb})"
            )
            browser.drag((x, y), (x - 40, y))
            return panel.read(0.0).joints[0] < before[0] - 0.1

        home = np.array(cameras()[0].position)

        def looks_from_elsewhere():
            browser.drag((350, 100), (280, 120))
            return np.abs(cameras()[0].position - home).max() > 0.3

        browser.wait(moved)
        browser.wait(looks_from_elsewhere)
        assert not [
            url
            for url in browser.requests
            if not url.startswith((view.url, "data:", "blob:", "about:"))
        ]
        assert not browser.errors
        assert browser.run("document.title").startswith("maniport view")
        browser.go("about:blank")
        browser.wait(lambda: view.rate == 0)


def test_states_of_live_are_drawn(arms):
    person, robot = (arm.sample(1, 0)[0] for arm in arms)
    own, other = (arm.manipulability(q) for arm, q in zip(arms, (person, robot), strict=True))
    tip = arms[1].forward(robot)[:3, 3]
    arm = LiveArm(other, tip, person, own, own, 0.5, 0.01)
    state = LiveState(1.0, "following", robot, np.zeros(7), (arm,))
    page = Onlooker(*arms)
    try:
        page.show(replace(state, arms=(LiveArm(other, tip),)))
        assert page._scene is None
        moved = replace(state, joint_positions=arms[1].sample(1, 1)[0])
        for shown in (state, moved):
            page.show(shown)
        assert "**following**, 0.0 s" in page._text.content  # since the first state
        surface = arms[1].surfaces()[-1]
        pose = arms[1].link_poses(moved.joint_positions)[surface.joint]
        np.testing.assert_allclose(page._scene.sides[0].meshes[-1].position, pose[:3, 3], atol=1e-6)
        with pytest.raises(InvalidInputError, match="3×3"):
            page.show(replace(state, arms=(LiveArm(np.eye(6), tip),)))
    finally:
        page.stop()
