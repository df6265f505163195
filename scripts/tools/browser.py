"""Chromium without a window, spoken to through its DevTools pipe: pages as people see them.

Only what a look at a report needs: open, evaluate, press keys, take pictures, print. Messages are
JSON that ends with a zero byte, read from and written to two pipes of the process.
"""

import base64
import json
import os
import shutil
import subprocess
import tempfile
import time
from contextlib import contextmanager
from pathlib import Path

NAMES = ("chromium", "chromium-browser", "google-chrome")
FLAGS = ("--headless", "--no-sandbox", "--disable-gpu", "--remote-debugging-pipe")
FLAGS += ("--disable-background-networking", "--no-first-run", "--hide-scrollbars")
PATIENCE_SECOND = 120.0  # for one answer, on a machine that is busy


def found() -> str | None:
    """Path of a Chromium on this machine, or None."""
    return next(filter(None, map(shutil.which, NAMES)), None)


@contextmanager
def opened():
    """A tab of a browser that ends with the block."""
    down, up = os.pipe(), os.pipe()
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as profile:
        # The browser reads from descriptor 3 and writes to 4, which a shell can name.
        command = f'exec "$0" "$@" 3<&{down[0]} 4>&{up[1]}'
        arguments = [found(), *FLAGS, f"--user-data-dir={profile}", "about:blank"]
        process = subprocess.Popen(
            ["bash", "-c", command, *arguments],
            pass_fds=(down[0], up[1]),
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        os.close(down[0])
        os.close(up[1])
        tab = Tab(down[1], up[0])
        try:
            yield tab.attached()
        finally:
            tab.close()
            process.terminate()
            process.wait(timeout=PATIENCE_SECOND)


class Tab:
    """One tab: `console` and `requests` gather what the page says and asks for."""

    def __init__(self, write, read):
        self.write, self.read, self.rest = write, read, b""
        self.number, self.session = 0, None
        self.console, self.requests, self.events = [], [], []

    def attached(self):
        """The tab, spoken to from now on."""
        (target,) = [
            one for one in self.call("Target.getTargets")["targetInfos"] if one["type"] == "page"
        ]
        where = {"targetId": target["targetId"], "flatten": True}
        self.session = self.call("Target.attachToTarget", **where)["sessionId"]
        for domain in ("Page", "Runtime", "Log", "Network"):
            self.call(f"{domain}.enable")
        return self

    def close(self):
        """Close both pipes."""
        os.close(self.write)
        os.close(self.read)

    def call(self, method, **params) -> dict:
        """The answer to one message.

        Raises
        ------
        RuntimeError : the browser refuses it.
        """
        self.number += 1
        message = {"id": self.number, "method": method, "params": params}
        message |= {"sessionId": self.session} if self.session else {}
        text = json.dumps(message).encode() + b"\0"
        while text:
            text = text[os.write(self.write, text) :]
        while True:
            answer = self._next()
            if answer.get("id") == self.number:
                break
            self._hear(answer)
        if "error" in answer:
            raise RuntimeError(f"{method}: {answer['error']}")
        return answer["result"]

    def _next(self):
        while b"\0" not in self.rest:
            more = os.read(self.read, 1 << 20)
            if not more:
                raise RuntimeError("the browser has ended")
            self.rest += more
        one, _, self.rest = self.rest.partition(b"\0")
        return json.loads(one)

    def _hear(self, event):
        method, params = event.get("method"), event.get("params", {})
        if method == "Runtime.consoleAPICalled":
            self.console.append(" ".join(str(a.get("value")) for a in params["args"]))
        elif method == "Runtime.exceptionThrown":
            self.console.append(json.dumps(params["exceptionDetails"]))
        elif method == "Log.entryAdded":
            self.console.append(params["entry"]["text"])
        elif method == "Network.requestWillBeSent":
            self.requests.append(params["request"]["url"])

    def evaluate(self, expression):
        """Value of an expression of JavaScript; a promise is waited for."""
        answer = self.call(
            "Runtime.evaluate",
            expression=expression,
            returnByValue=True,
            awaitPromise=True,
            userGesture=True,
        )
        if "exceptionDetails" in answer:
            raise RuntimeError(json.dumps(answer["exceptionDetails"]))
        return answer["result"].get("value")

    def wait(self, expression):
        """Wait until an expression holds.

        Raises
        ------
        TimeoutError : it does not within the time that the module states.
        """
        end = time.monotonic() + PATIENCE_SECOND
        while not self.evaluate(f"Boolean({expression})"):
            if time.monotonic() > end:
                raise TimeoutError(f"waited for {expression}")
            time.sleep(0.02)

    def size(self, width, height=900):
        """Width and height of the window [pixel]."""
        self.call(
            "Emulation.setDeviceMetricsOverride",
            width=width,
            height=height,
            deviceScaleFactor=1,
            mobile=False,
        )

    def go(self, path, place="", *, shown=True):
        """Open a file at a place; `shown`: wait until the report's script has shown it."""
        self.call("Page.navigate", url="about:blank")
        self.wait("location.href === 'about:blank'")
        address = Path(path).resolve().as_uri()
        self.call("Page.navigate", url=f"{address}#{place}" if place else address)
        ready = "location.protocol === 'file:' && document.readyState === 'complete'"
        self.wait(f"{ready} && document.body.dataset.shown" if shown else ready)

    def press(self, key, text=""):
        """Press and release one key, such as Tab, Enter or Space."""
        codes = {"Tab": 9, "Enter": 13, " ": 32}
        what = {"key": key, "windowsVirtualKeyCode": codes.get(key, 0)}
        what |= {"text": text} if text else {}
        self.call("Input.dispatchKeyEvent", type="keyDown", **what)
        self.call("Input.dispatchKeyEvent", type="keyUp", key=key)

    def picture(self, file, *, whole=False, of="", height=None):
        """Save what is seen, the whole page, or the first element of a selector, as PNG.

        height : most of the element [pixel], from its top; None: all of it.
        """
        options = {"captureBeyondViewport": whole or bool(of)}
        if of:
            corner = "x: b.x + scrollX, y: b.y + scrollY, width: b.width, height: b.height"
            element = f"document.querySelector({json.dumps(of)})"
            box = self.evaluate(f"(b => ({{{corner}}}))({element}.getBoundingClientRect())")
            box["height"] = min(box["height"], height or box["height"])
            options["clip"] = box | {"scale": 1}
        if whole:
            box = self.call("Page.getLayoutMetrics")["cssContentSize"]
            options["clip"] = box | {"scale": 1}
        found_bytes = self.call("Page.captureScreenshot", format="png", **options)["data"]
        Path(file).write_bytes(base64.b64decode(found_bytes))

    def printed(self) -> bytes:
        """The page on paper, as PDF."""
        answer = self.call("Page.printToPDF", preferCSSPageSize=True, printBackground=True)
        return base64.b64decode(answer["data"])
