"""Chromium without a window, driven over its DevTools pipe with the standard library alone."""

import base64
import fcntl
import itertools
import json
import os
import select
import shutil
import subprocess
import time
from pathlib import Path

CHROMIUM = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome", "chrome"))), None)

FLAGS = (
    "--headless", "--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--remote-debugging-pipe",
    "--no-first-run", "--disable-background-networking", "--disable-dev-shm-usage", "--hide-scrollbars",
)  # fmt: skip


class Browser:
    """One page in a headless Chromium, and what it complains of and asks the network for."""

    def __init__(self, profile: Path):
        orders_out, orders_in = (fcntl.fcntl(end, fcntl.F_DUPFD, 20) for end in os.pipe())
        answers_out, answers_in = (fcntl.fcntl(end, fcntl.F_DUPFD, 20) for end in os.pipe())

        def connect():  # Chromium reads orders from 3 and writes answers to 4
            os.dup2(orders_out, 3)
            os.dup2(answers_in, 4)

        self.process = subprocess.Popen(
            [CHROMIUM, *FLAGS, f"--user-data-dir={profile}", "about:blank"],
            preexec_fn=connect, close_fds=False, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
        )  # fmt: skip
        self.orders, self.answers, self.rest = orders_in, answers_out, b""
        self.numbers, self.complaints, self.requests = itertools.count(1), [], []
        self.session = None
        target = self.call("Target.createTarget", url="about:blank")["targetId"]
        self.session = self.call("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]
        for domain in ("Page", "Runtime", "Log", "Network"):
            self.call(f"{domain}.enable")

    def call(self, method, **params):
        """Give an order and wait for its answer; what comes in between is noted."""
        number = next(self.numbers)
        order = {"id": number, "method": method, "params": params}
        order |= {"sessionId": self.session} if self.session else {}
        os.write(self.orders, json.dumps(order).encode() + b"\0")
        while (message := self.read()).get("id") != number:
            self.note(message)
        if "error" in message:
            raise RuntimeError(f"{method}: {message['error']}")
        return message["result"]

    def read(self):
        """Wait for the next message."""
        while b"\0" not in self.rest:
            if not select.select([self.answers], [], [], 60)[0]:
                raise TimeoutError("Chromium does not answer")
            self.rest += os.read(self.answers, 1 << 20)
        message, self.rest = self.rest.split(b"\0", 1)
        return json.loads(message)

    def note(self, message):
        """Keep complaints and requests."""
        method, params = message.get("method"), message.get("params", {})
        if method == "Runtime.exceptionThrown":
            self.complaints.append(params["exceptionDetails"].get("exception", {}).get("description", "exception"))
        elif method == "Runtime.consoleAPICalled" and params["type"] in ("error", "warning"):
            self.complaints.append(str(params["args"]))
        elif method == "Log.entryAdded" and params["entry"]["level"] in ("error", "warning"):
            self.complaints.append(params["entry"]["text"])
        elif method == "Network.requestWillBeSent":
            self.requests.append(params["request"]["url"])

    def run(self, script):
        """Return what a script evaluates to."""
        found = self.call("Runtime.evaluate", expression=script, returnByValue=True, awaitPromise=True)
        if "exceptionDetails" in found:
            raise RuntimeError(str(found["exceptionDetails"]))
        return found["result"].get("value")

    def open(self, path, fragment=""):
        """Go to a page, and wait until it is drawn."""
        self.call("Page.navigate", url="about:blank")
        self.complaints.clear()
        self.requests.clear()
        self.call("Page.navigate", url=f"{Path(path).as_uri()}{fragment}")
        self.wait("document.documentElement?.dataset.ready === 'true' || document.documentElement?.dataset.error")

    def wait(self, condition):
        """Wait until a script is true."""
        for _ in range(300):
            if self.run(condition):
                return
            time.sleep(0.05)
        raise TimeoutError(f"never true: {condition}; {self.complaints}")

    def dress(self, width=1280, height=900, scheme="light", motion="no-preference", touch=False):
        """Take the size of a screen, and what its owner prefers."""
        self.call("Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=1, mobile=touch)
        wishes = {"prefers-color-scheme": scheme, "prefers-reduced-motion": motion}
        features = [{"name": name, "value": value} for name, value in wishes.items()]
        self.call("Emulation.setEmulatedMedia", features=features)

    def press(self, key):
        """Press and release a key."""
        text = {"text": " "} if key == " " else {}
        self.call("Input.dispatchKeyEvent", type="keyDown", key=key, **text)
        self.call("Input.dispatchKeyEvent", type="keyUp", key=key)

    def picture(self, path):
        """Write what is seen to a PNG file."""
        Path(path).write_bytes(base64.b64decode(self.call("Page.captureScreenshot", format="png")["data"]))

    def close(self):
        """End the browser."""
        os.close(self.orders)
        self.process.terminate()
        self.process.wait(timeout=20)
        os.close(self.answers)
