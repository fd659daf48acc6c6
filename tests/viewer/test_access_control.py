"""Who can connect to the live view, and what they can do: attacks of a page that is open in the user's browser."""

import contextlib
import http.client
import logging
import socket
import time
from urllib.parse import urlsplit

import numpy as np
import pytest
from receiver import CAMERA, connected, msgspec

from maniport.viewer.access_control import LOGGED, MAX_PAGES, MESSAGE_BYTES, AccessControl
from maniport.viewer.server import LiveView

websockets_errors = pytest.importorskip("websockets.exceptions")


@pytest.fixture(scope="module")
def page(make_state):
    """One page for all attacks."""
    view = LiveView(make_state(), "parallel-transport", np.eye(3))
    yield view
    view.stop()


@pytest.fixture
def view(page, running):
    """The page, with its loop running."""
    page._access._counts.clear()
    with running(page):
        yield page


def wait(condition, seconds=60.0):
    """Wait until something holds."""
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end, "it did not happen"
        time.sleep(0.01)


def status(url, path, host=None):
    """Status of a request for a path of any bytes."""
    parts = urlsplit(url)
    host = parts.netloc if host is None else host
    with socket.create_connection((parts.hostname, parts.port), timeout=10) as line:
        line.sendall(b"GET " + path + b" HTTP/1.1\r\nHost: " + host.encode() + b"\r\n\r\n")
        return int(line.recv(4096).split()[1])


def test_only_the_whole_address_is_answered(page):
    """Without the token, or with another, there is nothing; below it nothing but the page, whatever the path."""
    parts = urlsplit(page.url)
    line = http.client.HTTPConnection(parts.hostname, parts.port, timeout=60)
    line.request("GET", parts.path)
    assert line.getresponse().status == 200
    token = page._access.token.encode()
    for path in (b"/", b"/index.html", b"/x" * 20, parts.path[:-3].encode(), b"//", b"/?" + token):
        assert status(page.url, path) == 403
    for name in ("ä".encode(), b"\xff\xfe", b"%C3%A4", b"%00", b"x" * 300, b"%ff/../x"):
        assert status(page.url, parts.path.encode() + name) == 404
        assert status(page.url, b"/" + name) == 403


@pytest.mark.parametrize("host", ["evil.example", "evil.example:80", "127.0.0.1.evil.example:1", "", "[::2]:1"])
def test_names_of_other_hosts_are_refused(page, host):
    """A page whose name is bound to this machine's address afterwards requests its own name."""
    assert status(page.url, urlsplit(page.url).path.encode(), host) == 403


def test_pages_of_other_origins_cannot_connect(page):
    """Only the page that is served here can, and programs without an origin; all need the token."""
    here = urlsplit(page.url).netloc
    for origin in ("http://evil.example", "null", f"https://{here}", "http://localhost:1", "file://"):
        with pytest.raises(websockets_errors.InvalidStatus) as refused, connected(page.url, origin):
            pass
        assert refused.value.response.status_code == 403
    for origin in (f"http://{here}", None):
        with connected(page.url, origin) as guest:
            assert guest.recv(timeout=60)
    with pytest.raises(websockets_errors.InvalidStatus), connected(page.url.replace(page._access.token, "x" * 22)):
        pass


def test_an_open_page_is_open_to_its_own_origin_only():
    """Served to other machines under any name, a page of another origin is refused all the same."""
    from websockets.datastructures import Headers

    access = AccessControl("0.0.0.0")
    path = f"/{access.token}/"
    assert access.refusal(Headers(Host="lab:80", Origin="http://lab:80"), path) == ""
    assert "evil" in access.refusal(Headers(Host="lab:80", Origin="http://evil.example"), path)
    assert "token" in access.refusal(Headers(Host="lab:80"), "/")


UPDATE = {"type": "GuiUpdateMessage", "uuid": "0"}
JUNK = {
    "text instead of bytes": "hello",
    "no MessagePack": b"\xc1" * 40,
    "no mapping": [1, 2],
    "a deep one": b"\x91" * 5000 + b"\xc0",
    "no type": {"value": 1},
    "a type that is none": {"type": ["GuiUpdateMessage"]},
    "a message of the server": {"type": "RunJavascriptMessage", "source": "alert(1)"},
    "a share": {"type": "ShareUrlRequest"},
    "an upload": {"type": "FileTransferStartUpload", "size_bytes": 10**12},
    "other fields": UPDATE,
    "another property": UPDATE | {"updates": {"removed": 1}},
    "a value that is a mapping": UPDATE | {"updates": {"value": {}}},
    "a camera at nan": CAMERA | {"position": (np.nan, 0.0, 0.0)},
    "a camera of two numbers": CAMERA | {"look_at": (0.0, 0.0)},
    "up to nowhere": CAMERA | {"up_direction": (0.0, 0.0, 0.0)},
    "a camera beyond all numbers": CAMERA | {"position": (1e308, 0.0, 0.0)},
    "a camera turned by nothing": CAMERA | {"wxyz": (0.0, 0.0, 0.0, 0.0)},
    "a camera that looks at itself": CAMERA | {"look_at": CAMERA["position"]},
    "a view of no angle": CAMERA | {"fov": 0.0},
    "a window of no height": CAMERA | {"image_height": 0},
    "a window of inf": CAMERA | {"image_height": np.inf},
}


def test_junk_is_dropped_with_a_line(view, caplog):
    """The page goes on, the connection too, and the log has one line for each message."""
    for name, junk in JUNK.items():
        view._access._counts.clear()
        caplog.clear()
        message = junk if isinstance(junk, (str, bytes)) else msgspec.msgpack.encode(junk)
        with caplog.at_level(logging.WARNING, "maniport.viewer"), connected(view.url) as guest:
            guest.send(message)
            guest.send(msgspec.msgpack.encode(CAMERA))
            wait(lambda: caplog.records and view.rate > 0)
        (line,) = [record.getMessage() for record in caplog.records]
        assert "a message was refused" in line, name
        assert "\n" not in line


def test_invalid_values_of_controls_change_nothing(view, caplog):
    """They are taken back on the page; the loop that reads them goes on."""
    with caplog.at_level(logging.WARNING, "maniport.viewer"), connected(view.url) as guest:
        guest.send(msgspec.msgpack.encode(CAMERA))
        wait(lambda: view.rate > 0)
        for name, value in [
            ("_method", "no such method"), ("_preset", "upside down"), ("_sliders", 1e308), ("_sliders", "nan"),
            ("_angles", -181.0),
        ]:  # fmt: skip
            found = getattr(view._panel, name)
            control = found[0] if isinstance(found, list) else found
            before, count = control.value, view._access._counts["a value was"]
            update = {"type": "GuiUpdateMessage", "uuid": control.handle._impl.uuid, "updates": {"value": value}}
            guest.send(msgspec.msgpack.encode(update))
            wait(lambda: view._access._counts["a value was"] > count)  # noqa: B023 - it is called at once
            wait(lambda: control.handle.value == before)  # noqa: B023
            assert control.value == before
    assert not any(record.exc_info for record in caplog.records)


def test_a_flood_is_survived(view, caplog):
    """Thousands of junk messages, and one too large: a few lines, and later pages are served."""
    gone = contextlib.suppress(websockets_errors.ConnectionClosed)
    with caplog.at_level(logging.WARNING, "maniport.viewer"), gone, connected(view.url) as guest:
        for _ in range(5_000):
            guest.send(b"\xc1")
        guest.send(b"\xc1" * (MESSAGE_BYTES + 1))
        guest.recv(timeout=60)
    wait(lambda: view._access._counts["a message was"] == 5_000)
    assert len(caplog.records) <= LOGGED + 2
    with connected(view.url) as guest:
        guest.send(msgspec.msgpack.encode(CAMERA))
        wait(lambda: view.rate > 0)


def test_the_number_of_pages_is_limited(page):
    """One more is refused; afterwards there is room."""
    wait(lambda: page._access._pages == 0)
    with contextlib.ExitStack() as stack:
        for _ in range(MAX_PAGES):
            stack.enter_context(connected(page.url))
        with pytest.raises(websockets_errors.InvalidStatus), connected(page.url):
            pass
    wait(lambda: page._access._pages == 0)
    with connected(page.url) as guest:
        assert guest.recv(timeout=60)
