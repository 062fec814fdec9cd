"""A headless Chromium, told by its DevTools protocol; keeps what it asks for and complains of."""

import base64
import json
import os
import pathlib
import shutil
import subprocess
import time
import urllib.request
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import pytest
import websocket

NAMES = ("chromium", "chromium-browser", "google-chrome")
FLAGS = (
    "--headless",
    "--no-sandbox",
    "--disable-gpu",
    "--disable-dev-shm-usage",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--hide-scrollbars",
    "--remote-debugging-port=0",
    "--remote-allow-origins=*",
)
PATIENCE = 120.0  # [s] for one answer; the machine may be busy


def find_browser() -> str:
    """The program; skips the test where there is none, and fails it where there must be one."""
    for name in NAMES:
        found = shutil.which(name)
        if found:
            return found
    reason = f"no browser to open the page in: none of {', '.join(NAMES)} is on the path"
    if os.environ.get("CI") or os.environ.get("QUIETBUS_REQUIRE_BROWSER"):
        pytest.fail(reason)
    pytest.skip(reason)


class Page:
    """An open page: its requests, its complaints, and what scripts in it say."""

    def __init__(self, address: str):
        self._socket = websocket.create_connection(address, timeout=PATIENCE)
        self._last = 0
        self._loaded = False
        self.requests: list[str] = []
        self.complaints: list[str] = []
        for domain in ("Page", "Network", "Runtime", "Log"):
            self.call(f"{domain}.enable")
        self.call("Emulation.setFocusEmulationEnabled", enabled=True)

    def call(self, method: str, **parameters: Any) -> dict[str, Any]:
        """One command of the protocol and its answer; events that come first are kept."""
        self._last += 1
        self._socket.send(json.dumps({"id": self._last, "method": method, "params": parameters}))
        while True:
            message = json.loads(self._socket.recv())
            if message.get("id") == self._last:
                assert "error" not in message, f"{method}: {message['error']}"
                return message["result"]
            self._keep(message)

    def open(self, path: pathlib.Path, width: int = 1280, height: int = 900) -> None:
        """Open a file in a window of so many pixels and wait until it is loaded."""
        self.resize(width, height)
        self._loaded = False
        self.requests.clear()
        self.complaints.clear()
        self.call("Page.navigate", url=path.resolve().as_uri())
        while not self._loaded:
            self._keep(json.loads(self._socket.recv()))
        self.wait()

    def resize(self, width: int, height: int) -> None:
        """Another size of the window."""
        self.call(
            "Emulation.setDeviceMetricsOverride",
            width=width,
            height=height,
            deviceScaleFactor=1,
            mobile=False,
        )

    def wait(self) -> None:
        """Until two pictures of the screen have been drawn, and what they led to is told."""
        self.run("new Promise(done => requestAnimationFrame(() => requestAnimationFrame(done)))")

    def run(self, script: str) -> Any:
        """Value of a JavaScript expression, of a promise when it is kept."""
        answer = self.call(
            "Runtime.evaluate",
            expression=script,
            awaitPromise=True,
            returnByValue=True,
            userGesture=True,
        )
        assert "exceptionDetails" not in answer, answer["exceptionDetails"]
        return answer["result"].get("value")

    def press(self, key: str) -> None:
        """Press and release a key."""
        text = {"text": key} if len(key) == 1 else {}
        self.call("Input.dispatchKeyEvent", type="keyDown", key=key, **text)
        self.call("Input.dispatchKeyEvent", type="keyUp", key=key)

    def picture(self, path: pathlib.Path, whole: bool = False) -> None:
        """The screen, or the whole page, as PNG."""
        data = self.call("Page.captureScreenshot", format="png", captureBeyondViewport=whole)
        path.write_bytes(base64.b64decode(data["data"]))

    def _keep(self, message: dict[str, Any]) -> None:
        event = message["params"]
        match message["method"]:
            case "Page.loadEventFired":
                self._loaded = True
            case "Network.requestWillBeSent":
                self.requests.append(event["request"]["url"])
            case "Network.webSocketCreated":
                self.requests.append(event["url"])
            case "Runtime.exceptionThrown":
                self.complaints.append(str(event["exceptionDetails"]))
            case "Runtime.consoleAPICalled" if event["type"] in ("error", "warning", "assert"):
                self.complaints.append(f"{event['type']}: {event['args']}")
            case "Log.entryAdded" if event["entry"]["level"] in ("error", "warning"):
                self.complaints.append(str(event["entry"]))


@contextmanager
def open_browser(folder: pathlib.Path) -> Iterator[Page]:
    """A browser with one page, its profile in an empty folder; ended with the context."""
    port_file = folder / "DevToolsActivePort"
    arguments = [find_browser(), *FLAGS, f"--user-data-dir={folder}", "about:blank"]
    with subprocess.Popen(
        arguments, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
    ) as process:
        try:
            yield Page(_address(process, port_file))
        finally:
            process.terminate()


def _address(process: subprocess.Popen[bytes], port_file: pathlib.Path) -> str:
    """WebSocket address of the browser's first page."""
    deadline = time.monotonic() + PATIENCE
    while time.monotonic() < deadline:
        assert process.poll() is None, f"the browser ended with status {process.returncode}"
        lines = port_file.read_text().splitlines() if port_file.is_file() else []
        if len(lines) == 2:
            with urllib.request.urlopen(f"http://127.0.0.1:{lines[0]}/json/list") as answer:
                pages = [each for each in json.load(answer) if each["type"] == "page"]
            if pages:
                return pages[0]["webSocketDebuggerUrl"]
        time.sleep(0.05)
    raise TimeoutError(f"the browser did not answer within {PATIENCE:g} s")
