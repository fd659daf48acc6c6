"""A page that draws nothing: it says where it looks from, and notes what the server sends."""

import pytest

viser = pytest.importorskip("viser")
msgspec, zstandard, client = map(pytest.importorskip, ("msgspec", "zstandard", "websockets.sync.client"))  # viser's own

CAMERA = {
    "type": "ViewerCameraMessage", "wxyz": (1.0, 0.0, 0.0, 0.0), "position": (3.0, 0.0, 1.0), "fov": 0.8, "near": 0.01,
    "far": 1000.0, "image_height": 600, "image_width": 900, "look_at": (0.0, 0.0, 1.0), "up_direction": (0.0, 0.0, 1.0),
}  # fmt: skip


def connected(url, origin=None):
    """Connect as the page does, from a page of some origin where one is given."""
    subprotocols = [f"viser-v{viser.__version__}"]
    return client.connect(url.replace("http", "ws", 1), origin=origin, subprotocols=subprotocols, max_size=None)


def receive(url, enough):
    """Messages of the windows that arrive until `enough(windows)`, each window as it came: (name, type) pairs."""
    windows = []
    with connected(url) as page:
        page.send(msgspec.msgpack.encode(CAMERA))
        while not enough(windows):
            window = page.recv(timeout=60)
            told = int.from_bytes(window[8:16], "little")
            inner = msgspec.msgpack.decode(zstandard.decompress(window[16 : 16 + told]))
            windows.append([(message.get("name"), message["type"]) for message in inner["messages"]])
    return windows
