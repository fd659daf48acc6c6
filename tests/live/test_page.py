"""The page: what the controls say, what the server does, and how a browser sees it."""

import contextlib
import socket
import struct
import sys
import threading
import time
import urllib.request

import numpy as np
import pytest
from chromium import EXECUTABLE, Browser, wait_until
from scipy.spatial.transform import Rotation

from maniport.errors import InvalidInputError, MissingPackageError
from maniport.live.panel import RECORDING, SLIDERS
from maniport.live.server import LiveView, require_free

pytest.importorskip("viser")
in_a_browser = pytest.mark.skipif(EXECUTABLE is None, reason="there is no chromium here to open the page with")


@pytest.fixture
def make_view(make_state):
    """Make pages that stop with the test."""
    with contextlib.ExitStack() as stack:

        def make(**options):
            view = LiveView(make_state(**options), "parallel-transport", np.eye(3))
            stack.callback(view.stop)
            return view

        yield make


@contextlib.contextmanager
def running(view):
    """The loop of a view, in a thread."""
    stop = threading.Event()
    loop = threading.Thread(target=view.run, args=(stop,))
    loop.start()
    yield
    stop.set()
    loop.join(10.0)
    assert not loop.is_alive()


@pytest.fixture(scope="module")
def browser(tmp_path_factory):
    """One browser for all pages."""
    opened = Browser(tmp_path_factory.mktemp("profile"))
    yield opened
    opened.close()


def test_the_page_is_served_on_this_machine_only(make_view, capsys):
    """The address is a loopback one, the page answers, and nothing is printed that was not asked for."""
    view = make_view()
    assert view.url.startswith("http://127.0.0.1:")
    with urllib.request.urlopen(view.url, timeout=10) as answer:
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
def test_an_address_that_is_none_is_told(host, port):
    """Hosts and ports that there are not raise an error of ours."""
    with pytest.raises(InvalidInputError):
        require_free(host, port) if port >= 0 else LiveView(None, "icp", np.eye(3), host, port)


def test_without_viser_the_way_to_get_it_is_told(monkeypatch, make_state):
    """The package is optional; the message names the command that installs it."""
    monkeypatch.setitem(sys.modules, "viser", None)
    with pytest.raises(MissingPackageError, match=r"pip install maniport\[view\]"):
        LiveView(make_state(), "icp", np.eye(3))


def test_controls_become_wishes(make_view):
    """Method, checkbox and sliders say what is wished; the sliders are in degrees."""
    panel = make_view()._panel
    panel._method.value, panel._follows.value = "nearest-neighbor", True
    panel._sliders[3].value = 45.0
    wish = panel.read(0.02)
    assert (wish.method, wish.hand_follows) == ("nearest-neighbor", True)
    assert wish.joints[3] == pytest.approx(np.pi / 4)


def test_sliders_and_rings_show_one_mounting(make_view):
    """Sliders of roll, pitch and yaw turn the rings in space, the rings turn the sliders, the button takes all back."""
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
    panel._straight.set()
    assert panel.read(0.0).mounting == pytest.approx(np.eye(3))
    assert [slider.value for slider in panel._angles] == [0.0, 0.0, 0.0]


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
    assert panel._joints_folder.visible
    panel._source.value = RECORDING
    panel.read(0.1)
    assert not panel._joints_folder.visible


def test_the_numbers_name_every_method(make_view):
    """Distance, three ellipsoids and all methods with their gaps are there."""
    view = make_view()
    text = view._panel._numbers.content
    for word in ("distance", "person", "wanted", "robot", "condition", *view.state.methods):
        assert word in text
    assert "nan" not in text


@in_a_browser
def test_a_browser_shows_the_page(make_view, browser, tmp_path):
    """The page draws, moves when a slider moves, asks nothing of the network, and its console holds no error."""
    view = make_view()
    with running(view):
        tab = browser.open(view.url)
        assert wait_until(lambda: tab.evaluate("!!document.querySelector('canvas')"), 30.0)
        assert wait_until(lambda: "distance" in tab.evaluate("document.body.innerText"), 30.0)
        assert wait_until(lambda: view.rate > 0, 30.0)
        time.sleep(1.0)
        first = tab.screenshot(tmp_path / "first.png").read_bytes()
        assert len(first) > 15_000, "a picture of nothing is smaller"
        view._panel._sliders[1].value = 120.0
        assert wait_until(lambda: tab.screenshot(tmp_path / "second.png").read_bytes() != first, 20.0)
        assert struct.unpack(">II", first[16:24])[0] > 600
        strangers = [url for url in tab.requests if not url.startswith((view.url, "data:", "blob:"))]
        tab.close()
        assert not strangers
        assert not tab.errors


@in_a_browser
def test_a_browser_that_comes_back_finds_its_view(make_view, browser):
    """Method, sliders and the place one looks from are as they were; meanwhile nothing moves."""
    view = make_view()
    with running(view):
        tab = browser.open(view.url)
        assert wait_until(lambda: view.rate > 0, 30.0)
        (client,) = view._server.get_clients().values()
        client.camera.position = (1.0, -3.0, 2.0)
        assert wait_until(lambda: np.allclose(client.camera.position, (1, -3, 2), atol=1e-3), 10.0)
        view._panel._method.value = "nearest-neighbor"
        time.sleep(0.5)
        tab.close()
        assert wait_until(lambda: view.rate == 0, 20.0)
        tab = browser.open(view.url)
        assert wait_until(lambda: view.rate > 0, 30.0)
        (client,) = view._server.get_clients().values()
        assert wait_until(lambda: np.allclose(client.camera.position, (1, -3, 2), atol=1e-2), 20.0)
        shown = "[...document.querySelectorAll('input')].map(i => i.value).join()"
        assert wait_until(lambda: "nearest-neighbor" in (tab.evaluate(shown) or ""), 20.0)
        tab.close()
