"""Chromium without a window, driven over its DevTools socket.

A test that takes the fixture `browser` is skipped where there is no Chromium; `.ci/run` installs it, and repeats what
was skipped. Folders of tests get the fixture by importing it in conftest.py.
The same holds for `axe`, the script of axe-core: the file that MANIPORT_AXE names, or what
``npm install --no-save axe-core`` leaves in the folder of the project.
"""

import base64
import itertools
import json
import os
import shutil
import subprocess
import time
from pathlib import Path

import pytest
from websockets.sync.client import connect

CHROMIUM = next(
    filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome", "chrome"))),
    None,
)
MISSING = "no Chromium here; Debian: apt-get install chromium"

INSTALL = "npm install --no-save axe-core"

FLAGS = (
    "--headless",
    "--no-sandbox",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--remote-debugging-port=0",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--disable-back-forward-cache",
    "--disable-dev-shm-usage",
    "--hide-scrollbars",
    "--host-resolver-rules=MAP * ~NOTFOUND, EXCLUDE 127.0.0.1",
)


@pytest.fixture(scope="session")
def browser(tmp_path_factory):
    if CHROMIUM is None:
        pytest.skip(MISSING)
    opened = Browser(tmp_path_factory.mktemp("chromium"))
    yield opened
    opened.close()


@pytest.fixture(scope="session")
def axe():
    """axe-core, which looks for what keeps people from using a page, as a script."""
    path = Path(
        os.environ.get(
            "MANIPORT_AXE", Path(__file__).parents[1] / "node_modules/axe-core/axe.min.js"
        )
    )
    if not path.exists():
        pytest.skip(f"no axe-core at {path}: {INSTALL}")
    return path.read_text(encoding="utf-8")


class Browser:
    """One page in a headless Chromium, and what it complains of and asks the network for.

    `complaints` are errors and warnings, `errors` those of them that are errors, `requests` addresses: since the page
    was opened.
    """

    def __init__(self, profile: Path):
        words = [CHROMIUM, *FLAGS, f"--user-data-dir={profile}", "about:blank"]
        port = profile / "DevToolsActivePort"
        self.process = subprocess.Popen(words, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        while not port.exists() or len(port.read_text().split()) < 2:
            assert self.process.poll() is None, "Chromium has ended"
            time.sleep(0.05)
        self.socket = connect(
            "ws://127.0.0.1:{}{}".format(*port.read_text().split()), max_size=None
        )
        self.numbers = itertools.count(1)
        self.session = None
        self.complaints = []
        self.errors = []
        self.requests = []
        target = self.call("Target.createTarget", url="about:blank")["targetId"]
        self.session = self.call("Target.attachToTarget", targetId=target, flatten=True)[
            "sessionId"
        ]
        for domain in ("Page", "Runtime", "Log", "Network"):
            self.call(f"{domain}.enable")

    def call(self, method, **params):
        """Give an order and wait for its answer; what comes in between is noted."""
        number = next(self.numbers)
        order = {"id": number, "method": method, "params": params}
        order |= {"sessionId": self.session} if self.session else {}
        self.socket.send(json.dumps(order))
        while (message := json.loads(self.socket.recv(timeout=60))).get("id") != number:
            self.note(message)
        if "error" in message:
            raise RuntimeError(f"{method}: {message['error']}")
        return message["result"]

    def note(self, message):
        method = message.get("method")
        params = message.get("params", {})
        if method == "Runtime.exceptionThrown":
            self.complain(
                "error",
                params["exceptionDetails"].get("exception", {}).get("description", "exception"),
            )
        elif method == "Runtime.consoleAPICalled":
            self.complain(params["type"], str(params["args"]))
        elif method == "Log.entryAdded":
            self.complain(
                params["entry"]["level"],
                f"{params['entry']['text']} {params['entry'].get('url', '')}",
            )
        elif method == "Network.requestWillBeSent":
            self.requests.append(params["request"]["url"])

    def complain(self, level, text):
        if level in ("error", "warning"):
            self.complaints.append(text)
        if level == "error":
            self.errors.append(text)

    def run(self, script):
        found = self.call(
            "Runtime.evaluate", expression=script, returnByValue=True, awaitPromise=True
        )
        if "exceptionDetails" in found:
            raise RuntimeError(str(found["exceptionDetails"]))
        return found["result"].get("value")

    def go(self, url):
        """Leave the page, forget what it complained of, and go to another."""
        self.call("Page.navigate", url="about:blank")
        for kept in (self.complaints, self.errors, self.requests):
            kept.clear()
        self.call("Page.navigate", url=url)

    def open(self, path, fragment=""):
        self.go(f"{Path(path).as_uri()}{fragment}")
        self.wait(
            "document.documentElement?.dataset.ready === 'true' || document.documentElement?.dataset.error"
        )

    def wait(self, condition, seconds=90.0):
        """Wait until a script, or a function of this process, is true."""
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            if condition() if callable(condition) else self.run(condition):
                return
            time.sleep(0.05)
        raise TimeoutError(f"never true: {condition}; {self.complaints}")

    def dress(self, width=1280, height=900, scheme="light", touch=False):
        """Take the size of a screen, and what its owner prefers."""
        self.call(
            "Emulation.setDeviceMetricsOverride",
            width=width,
            height=height,
            deviceScaleFactor=1,
            mobile=touch,
        )
        self.call(
            "Emulation.setEmulatedMedia",
            features=[{"name": "prefers-color-scheme", "value": scheme}],
        )

    def press(self, key):
        text = {"text": " "} if key == " " else {}
        self.call("Input.dispatchKeyEvent", type="keyDown", key=key, **text)
        self.call("Input.dispatchKeyEvent", type="keyUp", key=key)

    def drag(self, start, end, steps=8):
        """Press the mouse at a place (x, y), move it to another, and release it there."""
        (x, y), (to_x, to_y) = start, end
        self.call("Input.dispatchMouseEvent", type="mouseMoved", x=x, y=y)
        self.call(
            "Input.dispatchMouseEvent", type="mousePressed", x=x, y=y, button="left", clickCount=1
        )
        for i in range(1, steps + 1):
            at = {"x": x + (to_x - x) * i / steps, "y": y + (to_y - y) * i / steps}
            self.call("Input.dispatchMouseEvent", type="mouseMoved", button="left", buttons=1, **at)
        self.call(
            "Input.dispatchMouseEvent",
            type="mouseReleased",
            x=to_x,
            y=to_y,
            button="left",
            clickCount=1,
        )

    def picture(self, path):
        Path(path).write_bytes(
            base64.b64decode(self.call("Page.captureScreenshot", format="png")["data"])
        )

    def close(self):
        self.socket.close()
        self.process.terminate()
        self.process.wait(20)
