"""Who comes in to the live view, and what they can do there: attacks of a page that is open in the user's browser."""

import contextlib
import gzip
import http.client
import logging
import re
import socket
import time
import urllib.request
from urllib.parse import urlsplit

import numpy as np
import pytest
from receiver import CAMERA, connected, msgspec

from maniport.errors import InvalidInputError
from maniport.view.door import GUESTS, LARGEST, TOLD, Door
from maniport.view.server import LiveView

websockets_errors = pytest.importorskip("websockets.exceptions")


@pytest.fixture(scope="module")
def view(arms, bank, methods, place):
    """One page for all attacks, with its loop running."""
    from running import running

    from maniport.view.maps import Refitting
    from maniport.view.state import LiveState

    state = LiveState(*arms, Refitting(methods, np.eye(3)), place, bank)
    page = LiveView(state, "parallel-transport", np.eye(3))
    with running(page):
        yield page
    page.stop()


def answer(url, path=None, **headers):
    """Status of a plain request."""
    parts = urlsplit(url)
    line = http.client.HTTPConnection(parts.hostname, parts.port, timeout=60)
    line.request("GET", parts.path if path is None else path, headers=headers)
    return line.getresponse().status


def test_only_the_whole_address_is_answered(view):
    """Without the token, or with another, there is nothing; with it the page."""
    assert answer(view.url) == 200
    for path in ("/", "/index.html", "/x" * 20, view.url[:-3], "//", f"/?{view._door.token}"):
        assert answer(view.url, path) == 403


def status(url, path):
    """Status of a request for a path of any bytes."""
    parts = urlsplit(url)
    with socket.create_connection((parts.hostname, parts.port), timeout=10) as line:
        line.sendall(b"GET " + path + b" HTTP/1.1\r\nHost: " + parts.netloc.encode() + b"\r\n\r\n")
        return int(line.recv(4096).split()[1])


@pytest.mark.parametrize(
    "name", ["ä".encode(), b"\xff\xfe", b"%C3%A4", b"%00", b"x" * 300, b"%ff/../x", b"\xf0\x9f\x98\x80"]
)
def test_paths_of_any_letters_are_answered(view, name):
    """Nothing is there with the token, nobody is answered without: no error of the server."""
    assert status(view.url, urlsplit(view.url).path.encode() + name) == 404
    assert status(view.url, b"/" + name) == 403


@pytest.mark.parametrize("up", [(0.0, 0.0, 0.0), (1e308, 0.0, 0.0), (1e308, 1e308, 1e308), (0.0, 1.0, 0.0)])
def test_who_comes_later_looks_from_a_sound_view(view, up, caplog):
    """What one page says of its camera does not break the pages that come after it."""
    with caplog.at_level(logging.WARNING), connected(view.url) as page:
        page.send(msgspec.msgpack.encode(CAMERA))
        page.send(msgspec.msgpack.encode(CAMERA | {"position": (2.0, 2.0, 1.0), "up_direction": up}))
        time.sleep(0.3)  # in which it must not be remembered
    caplog.clear()
    with caplog.at_level(logging.WARNING), connected(view.url) as page:
        page.send(msgspec.msgpack.encode(CAMERA))
        wait(lambda: view._server.get_clients())
        wait(lambda: all(np.isfinite(one.camera.wxyz).all() for one in view._server.get_clients().values()))
        ups = [one.camera.up_direction for one in view._server.get_clients().values()]
    assert all(0.1 < np.linalg.norm(one) < 10.0 for one in ups)
    assert not caplog.records


@pytest.mark.parametrize("host", ["evil.example", "evil.example:80", "127.0.0.1.evil.example:1", "", "[::2]:1"])
def test_names_of_other_hosts_are_refused(view, host):
    """A page whose name was bound to this machine's address afterwards asks for its own name."""
    assert answer(view.url, Host=host) == 403


@pytest.mark.parametrize("origin", ["http://evil.example", "null", "https://{here}", "http://localhost:1", "file://"])
def test_pages_of_other_origins_cannot_connect(view, origin):
    """The socket is closed to every page but the one that is served here, though they know the token."""
    here = urlsplit(view.url).netloc
    with pytest.raises(websockets_errors.InvalidStatus) as refused, connected(view.url, origin.format(here=here)):
        pass
    assert refused.value.response.status_code == 403


def test_the_page_itself_comes_in(view):
    """With its own origin, and a program without any, both with the token."""
    for origin in (f"http://{urlsplit(view.url).netloc}", None):
        with connected(view.url, origin) as page:
            assert page.recv(timeout=60)


def test_a_page_without_the_token_cannot_connect(view):
    """Nor can another user of this machine, who sees the port."""
    with pytest.raises(websockets_errors.InvalidStatus), connected(view.url.replace(view._door.token, "x" * 22)):
        pass


UUID = "0"
NONSENSE = {
    "text instead of bytes": "hello",
    "no MessagePack": b"\xc1" * 40,
    "no mapping": msgspec.msgpack.encode([1, 2]),
    "a deep one": b"\x91" * 5000 + b"\xc0",
    "no type": msgspec.msgpack.encode({"value": 1}),
    "a type that is none": msgspec.msgpack.encode({"type": ["GuiUpdateMessage"]}),
    "a message of the server": msgspec.msgpack.encode({"type": "RunJavascriptMessage", "source": "alert(1)"}),
    "a share": msgspec.msgpack.encode({"type": "ShareUrlRequest"}),
    "an upload": msgspec.msgpack.encode({"type": "FileTransferStartUpload", "size_bytes": 10**12}),
    "other fields": msgspec.msgpack.encode({"type": "GuiUpdateMessage", "uuid": UUID}),
    "another property": msgspec.msgpack.encode({"type": "GuiUpdateMessage", "uuid": UUID, "updates": {"removed": 1}}),
    "a value that is a mapping": msgspec.msgpack.encode(
        {"type": "GuiUpdateMessage", "uuid": UUID, "updates": {"value": {}}}
    ),
    "a camera at nan": msgspec.msgpack.encode(CAMERA | {"position": (np.nan, 0.0, 0.0)}),
    "a camera of two numbers": msgspec.msgpack.encode(CAMERA | {"look_at": (0.0, 0.0)}),
    "up to nowhere": msgspec.msgpack.encode(CAMERA | {"up_direction": (0.0, 0.0, 0.0)}),
    "up beyond all numbers": msgspec.msgpack.encode(CAMERA | {"up_direction": (1e308, 1e308, 0.0)}),
    "a camera beyond all numbers": msgspec.msgpack.encode(CAMERA | {"position": (1e308, 0.0, 0.0)}),
    "a camera turned by nothing": msgspec.msgpack.encode(CAMERA | {"wxyz": (0.0, 0.0, 0.0, 0.0)}),
    "a camera that looks at itself": msgspec.msgpack.encode(CAMERA | {"look_at": CAMERA["position"]}),
    "a view of no angle": msgspec.msgpack.encode(CAMERA | {"fov": 0.0}),
    "a window of no height": msgspec.msgpack.encode(CAMERA | {"image_height": 0}),
    "a window of inf": msgspec.msgpack.encode(CAMERA | {"image_height": np.inf}),
}


@pytest.mark.parametrize("name", NONSENSE)
def test_nonsense_is_dropped_with_a_line(view, name, caplog):
    """The page goes on, the connection too, and the log says in one line what was refused."""
    view._door._counts.clear()
    with caplog.at_level(logging.WARNING, "maniport.view"), connected(view.url) as page:
        page.send(NONSENSE[name])
        page.send(msgspec.msgpack.encode(CAMERA))
        wait(lambda: caplog.records and view.rate > 0)
    (line,) = [record.getMessage() for record in caplog.records]
    assert "a message was refused" in line
    assert "\n" not in line


@pytest.mark.parametrize(
    ("control", "value"),
    [
        ("_method", "no such method"), ("_method", ""), ("_preset", "upside down"), ("_sliders", 1e308),
        ("_sliders", "nan"), ("_sliders", "ten"), ("_angles", -181.0), ("_angles", "inf"),
    ],
)  # fmt: skip
def test_values_that_a_control_cannot_have_change_nothing(view, control, value, caplog):
    """They are taken back on the page; the loop that reads them goes on."""
    view._door._counts.clear()
    found = getattr(view._panel, control)
    one = found[0] if isinstance(found, list) else found
    before = one.value
    update = {"type": "GuiUpdateMessage", "uuid": one.handle._impl.uuid, "updates": {"value": value}}
    with caplog.at_level(logging.WARNING, "maniport.view"), connected(view.url) as page:
        page.send(msgspec.msgpack.encode(CAMERA))
        wait(lambda: view.rate > 0)
        page.send(msgspec.msgpack.encode(update))
        wait(lambda: caplog.records)
        wait(lambda: one.handle.value == before)
    assert one.value == before
    assert all("Traceback" not in record.getMessage() and not record.exc_info for record in caplog.records)


def test_a_flood_is_survived(view, caplog):
    """Twenty thousand messages of nonsense, and one larger than any: a few lines, and who comes next is served."""
    view._door._counts.clear()
    gone = contextlib.suppress(websockets_errors.ConnectionClosed)
    with caplog.at_level(logging.WARNING, "maniport.view"), gone, connected(view.url) as page:
        for _ in range(20_000):
            page.send(b"\xc1")
        page.send(b"\xc1" * (LARGEST + 1))
        page.recv(timeout=60)
    wait(lambda: view._door._counts["a message was"] == 20_000)
    assert len(caplog.records) <= TOLD + 2
    with connected(view.url) as page:
        page.send(msgspec.msgpack.encode(CAMERA))
        wait(lambda: view.rate > 0)


def test_as_many_look_on_as_there_is_room_for(view):
    """So many pages are served at the same time, one more is told that there is no room, and afterwards there is."""
    wait(lambda: view._door._guests == 0)
    with contextlib.ExitStack() as stack:
        for _ in range(GUESTS):
            stack.enter_context(connected(view.url))
        with pytest.raises(websockets_errors.InvalidStatus), connected(view.url):
            pass
    wait(lambda: view._door._guests == 0)
    with connected(view.url) as page:
        assert page.recv(timeout=60)


def test_a_server_that_passes_by_the_door_is_none():
    """If viser made its server in another way, nobody would guard it: then there is no page."""

    class Module:
        serve = None

    with pytest.raises(InvalidInputError, match="cannot be guarded"), Door("127.0.0.1").guarding(Module):
        pass


def test_open_to_others_the_origin_still_counts():
    """Served to other machines under any name, a page of another origin is refused all the same."""
    from websockets.datastructures import Headers

    door = Door("0.0.0.0")
    path = f"/{door.token}/"
    assert door.refusal(Headers(Host="lab:80", Origin="http://lab:80"), path) == ""
    assert "comes from" in door.refusal(Headers(Host="lab:80", Origin="http://evil.example"), path)
    assert "token" in door.refusal(Headers(Host="lab:80"), "/")


def wait(condition, seconds=60.0):
    """Wait until something holds."""
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end, "it did not come about"
        time.sleep(0.01)


@pytest.mark.parametrize("encoding", ["gzip", "identity"])
def test_title_of_the_tab_is_maniport(view, encoding):
    """The page has a title of its own, compressed or not, and its length is told right."""
    with urllib.request.urlopen(urllib.request.Request(view.url, headers={"Accept-Encoding": encoding})) as response:
        page = response.read()
        assert response.headers["Content-Encoding"] == encoding
        assert int(response.headers["Content-Length"]) == len(page)
    text = gzip.decompress(page) if encoding == "gzip" else page
    assert re.findall(rb"<title>(.*?)</title>", text) == [b"maniport"]
