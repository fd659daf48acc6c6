"""A headless Chromium that opens a page, through its DevTools protocol."""

import base64
import itertools
import json
import shutil
import subprocess
import time
import urllib.request
from pathlib import Path
from typing import Any

EXECUTABLE = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
FLAGS = (
    "--headless", "--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--no-first-run",
    "--disable-dev-shm-usage", "--remote-debugging-port=0", "--host-resolver-rules=MAP * ~NOTFOUND, EXCLUDE 127.0.0.1",
)  # fmt: skip


class Browser:
    """Opens pages; nothing but this machine can be reached from them."""

    def __init__(self, profile: Path, size: tuple[int, int] = (900, 600)):
        command = [
            EXECUTABLE,
            *FLAGS,
            f"--user-data-dir={profile}",
            f"--window-size={size[0]},{size[1]}",
            "about:blank",
        ]
        self._process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        file = profile / "DevToolsActivePort"
        wait_until(lambda: file.exists() and len(file.read_text().split()) == 2, 30.0)
        self._port = file.read_text().split()[0]

    def open(self, url: str) -> "Tab":
        """Open a page in a tab of its own."""
        return Tab(self._port, url)

    def close(self) -> None:
        """End the browser."""
        self._process.kill()
        self._process.wait(20)


class Tab:
    """One page; what its console says of errors is in `errors`."""

    def __init__(self, port: str, url: str):
        from websockets.sync.client import connect

        request = urllib.request.Request(f"http://127.0.0.1:{port}/json/new?about:blank", method="PUT")
        with urllib.request.urlopen(request, timeout=10) as answer:
            self._id = json.load(answer)
        self._port, self._numbers, self.errors = port, itertools.count(1), []
        self._socket = connect(self._id["webSocketDebuggerUrl"], max_size=None)
        for domain in ("Runtime", "Page", "Log", "Network"):
            self.call(f"{domain}.enable")
        self.requests: list[str] = []
        self.call("Page.navigate", url=url)

    def call(self, method: str, **parameters: Any) -> dict[str, Any]:
        """Send a command and wait for its answer."""
        number = next(self._numbers)
        self._socket.send(json.dumps({"id": number, "method": method, "params": parameters}))
        while True:
            message = json.loads(self._socket.recv(timeout=60))
            if message.get("id") == number:
                return message.get("result", {})
            self._note(message)

    def evaluate(self, script: str) -> Any:
        """Value of an expression in the page."""
        return self.call("Runtime.evaluate", expression=script, returnByValue=True)["result"].get("value")

    def screenshot(self, file: Path) -> Path:
        """Write what the page looks like."""
        file.write_bytes(base64.b64decode(self.call("Page.captureScreenshot", format="png")["data"]))
        return file

    def close(self) -> None:
        """Leave the page."""
        self._socket.close()
        urllib.request.urlopen(f"http://127.0.0.1:{self._port}/json/close/{self._id['id']}", timeout=10).close()

    def _note(self, message: dict[str, Any]) -> None:
        kind, what = message.get("method"), message.get("params", {})
        if kind == "Runtime.exceptionThrown":
            self.errors.append(str(what["exceptionDetails"].get("text")))
        elif kind == "Log.entryAdded" and what["entry"]["level"] == "error":
            self.errors.append(what["entry"]["text"] + " " + what["entry"].get("url", ""))
        elif kind == "Runtime.consoleAPICalled" and what["type"] == "error":
            self.errors.append(" ".join(str(a.get("value", a.get("description"))) for a in what["args"]))
        elif kind == "Network.requestWillBeSent":
            self.requests.append(what["request"]["url"])


def wait_until(condition: Any, seconds: float) -> bool:
    """Whether a condition comes true in time."""
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        if condition():
            return True
        time.sleep(0.05)
    return False
