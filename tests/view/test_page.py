"""The page: what the controls say, what the server does, and how a browser sees it."""

import contextlib
import socket
import struct
import sys
import time
import urllib.request

import numpy as np
import pytest
from receiver import receive
from running import running
from scipy.spatial.transform import Rotation

from maniport.bodies import Arm
from maniport.errors import FileFormatError, InvalidInputError, MissingPackageError
from maniport.telling.roles import ACHIEVED, PERSON, TARGET
from maniport.view import scene
from maniport.view.maps import Refitting
from maniport.view.numbers import LEGEND
from maniport.view.panel import MOUNTINGS, OWN, RECORDING, SLIDERS
from maniport.view.scene import ROBOT_AT, camera_for
from maniport.view.server import LiveView, require_free
from maniport.view.state import LiveState

pytest.importorskip("viser")
RING = 0.65 * 0.3
"""Radius of the arcs about the robot's base [m]: the page draws them at 0.65 of the handle's size."""


@pytest.fixture
def make_view(make_state):
    """Make pages that stop with the test."""
    with contextlib.ExitStack() as stack:

        def make(**options):
            view = LiveView(make_state(**options), "parallel-transport", np.eye(3))
            stack.callback(view.stop)
            return view

        yield make


def test_the_page_is_served_on_this_machine_only(make_view, capsys):
    """The address is a loopback one, the page answers, and nothing is printed that was not asked for."""
    view = make_view()
    assert view.url.startswith("http://127.0.0.1:")
    with urllib.request.urlopen(view.url, timeout=60) as answer:
        assert answer.status == 200
    listening = view._server._websock_server
    assert listening._host == "127.0.0.1"
    assert view._server.request_share_url() is None
    assert capsys.readouterr().out == ""


def test_two_views_have_two_ports(make_view):
    """A free port is chosen for each."""
    assert make_view().url != make_view().url


def test_a_port_that_is_taken_is_told(make_state):
    """Instead of listening somewhere else, or waiting for ever, an error says what to do."""
    with socket.socket() as other:
        other.bind(("127.0.0.1", 0))
        other.listen()
        with pytest.raises(InvalidInputError, match="Port 0 takes a free one"):
            LiveView(make_state(), "icp", np.eye(3), port=other.getsockname()[1])


@pytest.mark.parametrize(("host", "port"), [("no.such.host.invalid", 0), ("127.0.0.1", 70000), ("127.0.0.1", -1)])
def test_an_address_that_is_none_is_told(host, port, make_state):
    """Hosts and ports that there are not raise an error of ours."""
    with pytest.raises(InvalidInputError):
        require_free(host, port) if port >= 0 else LiveView(make_state(), "icp", np.eye(3), host, port)


def test_without_viser_the_way_to_get_it_is_told(monkeypatch, make_state):
    """The package is optional; the message names the command that installs it."""
    monkeypatch.setitem(sys.modules, "viser", None)
    with pytest.raises(MissingPackageError, match=r'pip install "maniport\[view\]"'):
        LiveView(make_state(), "icp", np.eye(3))


def test_controls_become_wishes(make_view):
    """Method, checkbox and sliders say what is wished; the sliders are in degrees."""
    panel = make_view()._panel
    panel._method.value, panel._follows.value = "nearest-neighbor", True
    panel._sliders[3].value = 45.0
    wish = panel.read(0.02)
    assert (wish.method, wish.tip_follows) == ("nearest-neighbor", True)
    assert wish.joints[3] == pytest.approx(np.pi / 4)


def test_sliders_and_rings_show_one_mounting(make_view):
    """Sliders of roll, pitch and yaw turn the rings in space, the rings the sliders, the list takes all back."""
    view = make_view()
    panel = view._panel
    for slider, value in zip(panel._angles, (30.0, -20.0, 75.0), strict=True):
        slider.value = value
    wanted = Rotation.from_euler("xyz", [30, -20, 75], degrees=True).as_matrix()
    assert panel.read(0.0).mounting == pytest.approx(wanted)
    x, y, z, w = Rotation.from_matrix(wanted.T).as_quat()
    assert np.abs(np.dot(panel.gizmo.wxyz, [w, x, y, z])) == pytest.approx(1.0)
    panel.gizmo.wxyz = (np.cos(0.5), 0.0, 0.0, np.sin(0.5))  # the robot's base is turned by 1 rad about the vertical
    turned = panel.read(0.0).mounting
    assert turned == pytest.approx(Rotation.from_euler("z", -1.0).as_matrix())
    assert panel._angles[2].value == pytest.approx(-57.5)
    assert panel.read(0.0).mounting == pytest.approx(turned), "the rounding of the sliders must not turn it"
    assert panel._preset.value == OWN
    panel._preset.value = "as the person"
    assert panel.read(0.0).mounting == pytest.approx(np.eye(3))
    assert [slider.value for slider in panel._angles] == [0.0, 0.0, 0.0]


@pytest.mark.parametrize(
    ("name", "base"),
    [("on a wall", (1, 0, 0)), ("from the ceiling", (0, 0, -1)), ("at the person's right side", (0, -1, 0))],
)
def test_mountings_by_name_point_the_base_where_they_say(make_view, name, base):
    """The robot's first axis, seen from the person's trunk (x forward, y left, z up)."""
    panel = make_view()._panel
    panel._preset.value = name
    assert pytest.approx(base) == panel.read(0.0).mounting.T @ [0, 0, 1]
    assert panel.read(0.0).mounting == pytest.approx(panel.read(0.0).mounting)
    assert name in MOUNTINGS


def test_a_recording_plays_until_sliders_are_chosen(make_view):
    """Played time moves the arm, a moved time slider seeks, and the sliders go on where the recording was."""
    view = make_view(recorded=True)
    panel, player = view._panel, view.state.playback
    first = panel.read(0.0).joints
    assert np.abs(panel.read(0.5).joints - first).max() > 0.01
    assert player.position == pytest.approx(0.5)
    panel._time.value = 1.5
    panel.read(0.1)
    assert player.position == pytest.approx(1.5)
    panel._plays.value = False
    panel.read(0.1)
    assert player.position == pytest.approx(1.5)
    panel._source.value = SLIDERS
    assert panel.read(0.1).joints == pytest.approx(player.joints(), abs=1e-6)
    assert panel._folders[0].visible
    panel._source.value = RECORDING
    panel.read(0.1)
    assert not panel._folders[0].visible


def test_the_numbers_name_every_method(make_view):
    """Distance, three ellipsoids and all methods with their gaps are there."""
    view = make_view()
    panel = view._panel
    text = panel._head.content + panel._ellipsoids.content + panel._methods.content
    for word in ("distance", "person", "target", "achieved", "condition", *view.state.methods):
        assert word in text
    assert "nan" not in text
    (lookup,) = [line for line in panel._methods.content.splitlines() if line.startswith("| nearest-neighbor")]
    assert "| — |" in lookup, "what the robot made once has no gap: 0.00 would flatter"


def test_roles_have_the_colours_of_the_report():
    """The legend's and the shells' colours come from the one table."""
    for role in (PERSON, TARGET, ACHIEVED):
        assert f"rgb{role.rgb}" in LEGEND
        assert getattr(scene, role.name.upper()) is role


def test_the_surface_can_be_taken_off(make_view):
    """The checkbox is set at first, and without it the skeleton is wished."""
    panel = make_view()._panel
    assert panel.covered
    panel._surface.value = False
    assert not panel.covered


def test_a_robot_without_a_surface_is_a_skeleton(make_view, monkeypatch):
    """The checkbox is out of use and says why."""

    def fail(self):
        raise FileFormatError("a mesh is missing: 'hand.dae'")

    monkeypatch.setattr(Arm, "surfaces", fail)
    view = make_view()
    assert view.bare == "a mesh is missing: 'hand.dae'"
    assert (view._panel._surface.handle.disabled, view._panel._surface.handle.hint) == (True, view.bare)
    assert not view._panel.covered


def test_what_goes_wrong_while_it_is_furnished_leaves_nothing_behind(make_state, monkeypatch):
    """An error, or Ctrl-C, before the page is whole ends its server too."""

    def fail(self):
        raise KeyboardInterrupt

    monkeypatch.setattr(Arm, "surfaces", fail)
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    with pytest.raises(KeyboardInterrupt):
        LiveView(make_state(), "icp", np.eye(3), port=port)
    require_free("127.0.0.1", port)
    with pytest.raises(OSError, match="refused"):
        socket.create_connection(("127.0.0.1", port), timeout=1.0)


def test_pictures_arrive_whole_and_meshes_once(make_view):
    """Robot, person and ellipsoids move in one message; shapes are sent when a page comes and never again."""

    def moving(windows):
        return [window for window in windows if ("/robot/surface/7", "SetPositionMessage") in window]

    view = make_view(recorded=True)
    with running(view):
        windows = receive(view.url, lambda windows: len(moving(windows)) > 20)
    moves = "/person/arm/hand", "/robot/surface/7", "/person/ellipsoid", "/robot/target", "/robot/achieved"
    shapes = [name for window in windows for name, kind in window if kind == "MeshMessage"]
    assert len(shapes) == len(set(shapes)) == len(view.state.student.surfaces())
    for picture in moving(windows)[1:]:
        assert {(name, "SetPositionMessage") for name in moves} <= set(picture)


@pytest.fixture(scope="module")
def opened(arms, bank, methods, place, browser):
    """One page in a browser for all tests that look at it: a heavy page comes once."""
    state = LiveState(*arms, Refitting(methods, np.eye(3)), place, bank)
    view = LiveView(state, "parallel-transport", np.eye(3))
    with running(view):
        browser.dress(900, 600)
        browser.go(view.url)
        browser.wait("!!document.querySelector('canvas')")
        browser.wait("document.body.innerText.includes('distance')")
        browser.wait(lambda: view.rate > 0)
        yield view
        browser.go("about:blank")
    view.stop()


def test_a_browser_shows_the_page(opened, browser, tmp_path):
    """The page draws, moves when a slider moves, asks nothing of the network, and its console holds no error."""
    (client,) = opened._server.get_clients().values()
    browser.wait(lambda: np.allclose(client.camera.position, camera_for(client.camera.aspect)[0], atol=1e-3))
    first = settled(browser, tmp_path)
    assert len(first) > 15_000, "a picture of nothing is smaller"
    assert struct.unpack(">II", first[16:24]) == (900, 600)
    opened._panel._surface.value = False
    browser.wait(lambda: seen(browser, tmp_path) != first)
    assert not [url for url in browser.requests if not url.startswith((opened.url, "data:", "blob:", "about:"))]
    assert not browser.errors
    opened._panel._surface.value = True


def test_what_is_touched_in_the_browser_is_wished(opened, browser):
    """Dragging a slider moves the person's arm, a click takes the surface off, dragging a ring fits all anew."""
    panel, refitting = opened._panel, opened.state.refitting
    before, first = panel.read(0.0).joints, refitting.maps
    browser.dress(1400, 900)
    browser.wait("document.querySelectorAll('[role=slider]').length > 8")
    thumb = "document.querySelector('[role=slider]').getBoundingClientRect()"
    browser.wait(f"{thumb}.x > 900")  # the panel has moved to the new edge of the window

    def moved():
        """Drag once more: a drag that begins while the page is still being laid out takes hold of nothing."""
        x, y = browser.run(f"(({{x, y, width, height}}) => [x + width / 2, y + height / 2])({thumb})")
        browser.drag((x, y), (x - 40, y))
        return panel.read(0.0).joints[0] < before[0] - 0.1

    browser.wait(moved)
    assert panel.read(0.0).joints[1:] == pytest.approx(before[1:])
    browser.run(f"document.getElementById('{panel._surface.handle._impl.uuid}').click()")
    browser.wait(lambda: not panel.covered)

    def turned():
        (client,) = opened._server.get_clients().values()
        x, y = on_screen(client.camera, np.array(ROBOT_AT) + RING * np.sqrt(0.5) * np.array([1.0, 1.0, 0.0]))
        browser.drag((x, y), (x - 30, y + 10))
        return abs(panel._angles[2].value) > 5.0

    browser.wait(turned)
    browser.wait(lambda: not refitting.busy)
    assert all(refitting.maps[name] is not one for name, one in first.items())


def test_a_browser_that_comes_back_finds_its_view(opened, browser):
    """Method, sliders and the place one looks from are as they were; meanwhile nothing moves."""

    def camera():
        return np.array([client.camera.position for client in opened._server.get_clients().values()])

    browser.dress(900, 600)
    time.sleep(0.5)
    home = camera()

    def looks_from_elsewhere():
        browser.drag((450, 100), (380, 120))
        return np.abs(camera() - home).max() > 0.3

    browser.wait(looks_from_elsewhere)
    opened._panel._method.value = "nearest-neighbor"
    time.sleep(1.0)  # until it has come to rest
    place = camera()
    browser.go("about:blank")
    browser.wait(lambda: opened.rate == 0)
    browser.go(opened.url)
    browser.wait(lambda: opened.rate > 0 and np.allclose(camera(), place, atol=1e-2))
    browser.wait("[...document.querySelectorAll('input')].some(input => input.value === 'nearest-neighbor')")


def on_screen(camera, point):
    """Where a camera shows a point [pixels]."""
    x, y, z = (point - camera.position) @ Rotation.from_quat(camera.wxyz, scalar_first=True).as_matrix()
    scale = 0.5 * camera.image_height / np.tan(0.5 * camera.fov)
    return 0.5 * camera.image_width + scale * x / z, 0.5 * camera.image_height + scale * y / z


def seen(browser, folder):
    """What the browser shows, as a PNG file's bytes."""
    browser.picture(folder / "seen.png")
    return (folder / "seen.png").read_bytes()


def settled(browser, folder):
    """What the browser shows once nothing but the numbers changes: a page that comes fades in."""
    time.sleep(2.0)
    return seen(browser, folder)
