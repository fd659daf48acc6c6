"""Who can connect to the live view, and what they can do: attacks of a page that is open in the user's browser."""

import contextlib
import logging
import socket
from urllib.parse import urlsplit

import numpy as np
import pytest
from receiver import CAMERA, connected, msgspec

from maniport.viewer.access_control import LOGGED, MAX_PAGES, MESSAGE_BYTES, AccessControl
from maniport.viewer.server import LiveView
from waiting import wait

errors = pytest.importorskip("websockets.exceptions")
encode = msgspec.msgpack.encode


@pytest.fixture(scope="module")
def page(make_state):
    view = LiveView(make_state(), "parallel-transport", np.eye(3))
    yield view
    view.stop()


@pytest.fixture
def view(page, running):
    """The page, with its loop running."""
    page._access._counts.clear()
    with running(page):
        yield page


def serves(view):
    """Wait until a new page gets frames."""
    with connected(view.url) as guest:
        guest.send(encode(CAMERA))
        wait(lambda: view.rate > 0)


def status(url, path, host=None):
    """Status of a request for a path of any bytes."""
    parts = urlsplit(url)
    host = parts.netloc if host is None else host
    with socket.create_connection((parts.hostname, parts.port), timeout=10) as line:
        line.sendall(b"GET " + path + b" HTTP/1.1\r\nHost: " + host.encode() + b"\r\n\r\n")
        return int(line.recv(4096).split()[1])


def test_only_the_whole_address_is_answered(page):
    """Without the token, or with another, there is nothing; below it nothing but the page; no other host's name."""
    root, token = urlsplit(page.url).path.encode(), page._access.token.encode()
    assert status(page.url, root) == 200
    for path in (b"/", b"/index.html", b"/x" * 20, root[:-3], b"//", b"/?" + token):
        assert status(page.url, path) == 403
    for name in ("ä".encode(), b"\xff\xfe", b"%C3%A4", b"%00", b"x" * 300, b"%ff/../x"):
        assert status(page.url, root + name) == 404
        assert status(page.url, b"/" + name) == 403
    for host in ("evil.example", "evil.example:80", "127.0.0.1.evil.example:1", "", "[::2]:1"):
        assert status(page.url, root, host) == 403


def test_pages_of_other_origins_cannot_connect(page):
    here = urlsplit(page.url).netloc
    for origin in ("http://evil.example", "null", f"https://{here}", "http://localhost:1", "file://"):
        with pytest.raises(errors.InvalidStatus) as refused, connected(page.url, origin):
            pass
        assert refused.value.response.status_code == 403
    for origin in (f"http://{here}", None):
        with connected(page.url, origin) as guest:
            assert guest.recv(timeout=60)
    with pytest.raises(errors.InvalidStatus), connected(page.url.replace(page._access.token, "x" * 22)):
        pass


def test_an_open_page_is_open_to_its_own_origin_only():
    from websockets.datastructures import Headers

    access = AccessControl("0.0.0.0")
    path = f"/{access.token}/"
    assert access.refusal(Headers(Host="lab:80", Origin="http://lab:80"), path) == ""
    assert "evil" in access.refusal(Headers(Host="lab:80", Origin="http://evil.example"), path)
    assert "token" in access.refusal(Headers(Host="lab:80"), "/")


UPDATE = {"type": "GuiUpdateMessage", "uuid": "0"}
INVALID = {
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
    "no upward direction": CAMERA | {"up_direction": (0.0, 0.0, 0.0)},
    "a camera beyond all numbers": CAMERA | {"position": (1e308, 0.0, 0.0)},
    "no rotation": CAMERA | {"wxyz": (0.0, 0.0, 0.0, 0.0)},
    "a camera that looks at itself": CAMERA | {"look_at": CAMERA["position"]},
    "a view of no angle": CAMERA | {"fov": 0.0},
    "a window of no height": CAMERA | {"image_height": 0},
    "a window of inf": CAMERA | {"image_height": np.inf},
}


def test_invalid_messages_are_dropped_with_a_line(view, caplog):
    """The page goes on, the connection too, and the log has one line for each message."""
    for name, content in INVALID.items():
        view._access._counts.clear()
        caplog.clear()
        with caplog.at_level(logging.WARNING, "maniport.viewer"), connected(view.url) as guest:
            guest.send(content if isinstance(content, (str, bytes)) else encode(content))
            guest.send(encode(CAMERA))
            wait(lambda: caplog.records and view.rate > 0)
        (line,) = [record.getMessage() for record in caplog.records]
        assert "a message was refused" in line, name
        assert "\n" not in line


def test_invalid_values_of_controls_change_nothing(view, caplog):
    panel, refused = view._panel, view._access._counts
    with caplog.at_level(logging.WARNING, "maniport.viewer"), connected(view.url) as guest:
        guest.send(encode(CAMERA))
        wait(lambda: view.rate > 0)
        for control, value in (
            (panel._method, "no such method"), (panel._preset, "upside down"), (panel._sliders[0], 1e308),
            (panel._sliders[0], "nan"), (panel._angles[0], -181.0),
        ):  # fmt: skip
            before, count = control.value, refused["a value was"]
            guest.send(encode(UPDATE | {"uuid": control.handle._impl.uuid, "updates": {"value": value}}))
            wait(lambda: refused["a value was"] > count)  # noqa: B023 - it is called at once
            wait(lambda: control.handle.value == before)  # noqa: B023
            assert control.value == before
    assert not any(record.exc_info for record in caplog.records)


def test_a_flood_is_survived(view, caplog):
    """Thousands of invalid messages, and one too large: a few lines, and later pages are served."""
    gone = contextlib.suppress(errors.ConnectionClosed)
    with caplog.at_level(logging.WARNING, "maniport.viewer"), gone, connected(view.url) as guest:
        for _ in range(5_000):
            guest.send(b"\xc1")
        guest.send(b"\xc1" * (MESSAGE_BYTES + 1))
        guest.recv(timeout=60)
    wait(lambda: view._access._counts["a message was"] == 5_000)
    assert len(caplog.records) <= LOGGED + 2
    serves(view)


def test_the_number_of_pages_is_limited(view):
    wait(lambda: view._access._pages == 0)
    with contextlib.ExitStack() as stack:
        for _ in range(MAX_PAGES):
            stack.enter_context(connected(view.url))
        with pytest.raises(errors.InvalidStatus), connected(view.url):
            pass
    wait(lambda: view._access._pages == 0)
    serves(view)
