"""A headless Chromium spoken to over its debugging pipe: no port, no package beyond Python's own.

The DevTools protocol: https://chromedevtools.github.io/devtools-protocol/ (domains Page, Runtime, Network, Emulation, Input, Fetch).
"""

import base64
import json
import os
import select
import shutil
import subprocess
import tempfile
import time

FLAGS = [
    "--headless", "--no-sandbox", "--disable-quic", "--no-first-run", "--disable-background-networking",
    "--disable-component-update", "--disable-sync", "--disable-extensions", "--disable-dev-shm-usage", "--mute-audio",
    # WebGL 2 without a graphics card, as a user without one has it: the browser puts pages together itself, where
    # --ignore-gpu-blocklist would have that drawn in software as well.
    "--enable-unsafe-swiftshader",
    # Whatever is asked for outside goes to a port where nobody listens.
    "--proxy-server=127.0.0.1:9", "--remote-debugging-pipe",
]
#: Loopback addresses go there too, or are let through for a page that has a server of its own on this machine.
NOWHERE, THIS_MACHINE = "--proxy-bypass-list=<-loopback>", "--proxy-bypass-list=127.0.0.1"


class Browser:
    def __init__(self, width=1280, height=900, javascript=True, dark=False, reduced_motion=False, served=False):
        self.profile = tempfile.mkdtemp(prefix="hgm-page-")
        program = next(filter(None, map(shutil.which, ["chromium", "chromium-browser", "google-chrome"])), None)
        if program is None:
            raise SystemExit("chromium is missing: sudo apt-get install chromium")
        to_browser, self.out = os.pipe()
        self.inp, from_browser = os.pipe()

        def wire():
            # The protocol wants descriptors 3 (read) and 4 (write); duplicates far away first, so that none is overwritten.
            a, b = os.dup2(to_browser, 20), os.dup2(from_browser, 21)
            os.dup2(a, 3)
            os.dup2(b, 4)

        self.process = subprocess.Popen(
            [program, *FLAGS, THIS_MACHINE if served else NOWHERE, f"--user-data-dir={self.profile}", f"--window-size={width},{height}", "about:blank"],
            preexec_fn=wire, close_fds=False, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        os.close(to_browser)
        os.close(from_browser)
        self.buffer, self.number, self.events, self.session = b"", 0, [], None
        target = next(t for t in self.call("Target.getTargets")["targetInfos"] if t["type"] == "page")
        self.session = self.call("Target.attachToTarget", targetId=target["targetId"], flatten=True)["sessionId"]
        for domain in ["Page", "Runtime", "Network", "Log", "DOM"]:
            self.call(f"{domain}.enable")
        self.call("Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=1, mobile=False)
        features = [{"name": "prefers-color-scheme", "value": "dark" if dark else "light"}]
        if reduced_motion:
            features.append({"name": "prefers-reduced-motion", "value": "reduce"})
        self.call("Emulation.setEmulatedMedia", features=features)
        if not javascript:
            self.call("Emulation.setScriptExecutionDisabled", value=True)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        try:
            self.session = None
            self.call("Browser.close", timeout=5)
        except (TimeoutError, OSError, RuntimeError):
            pass
        try:
            self.process.wait(10)
        except subprocess.TimeoutExpired:
            self.process.kill()
        os.close(self.out)
        os.close(self.inp)
        shutil.rmtree(self.profile, ignore_errors=True)

    def _receive(self, seconds):
        end = time.monotonic() + seconds
        while b"\0" not in self.buffer:
            left = end - time.monotonic()
            if left <= 0 or not select.select([self.inp], [], [], left)[0]:
                return None
            chunk = os.read(self.inp, 1 << 20)
            if not chunk:
                raise OSError("the browser went away")
            self.buffer += chunk
        message, self.buffer = self.buffer.split(b"\0", 1)
        return json.loads(message)

    def call(self, method, timeout=60, **params):
        self.number += 1
        message = {"id": self.number, "method": method, "params": params}
        if self.session:
            message["sessionId"] = self.session
        self._write(message)
        end = time.monotonic() + timeout
        while time.monotonic() < end:
            answer = self._receive(end - time.monotonic())
            if answer is None:
                break
            if answer.get("id") == self.number:
                if "error" in answer:
                    raise RuntimeError(f"{method}: {answer['error']}")
                return answer["result"]
            if "method" in answer:
                self.events.append(answer)
        raise TimeoutError(method)

    def _write(self, message):
        data = json.dumps(message).encode() + b"\0"
        while data:
            data = data[os.write(self.out, data):]

    def listen(self, seconds):
        """Collects events for a while."""
        end = time.monotonic() + seconds
        while (left := end - time.monotonic()) > 0:
            answer = self._receive(left)
            if answer and "method" in answer:
                self.events.append(answer)

    def open(self, address, timeout=60):
        """Loads a page; returns seconds from navigation to the load event."""
        begin = time.monotonic()
        # An earlier page's load is not this one's.
        self.events = [event for event in self.events if event["method"] != "Page.loadEventFired"]
        self.call("Page.navigate", url=address)
        while time.monotonic() < begin + timeout:
            if any(e["method"] == "Page.loadEventFired" for e in self.events):
                return time.monotonic() - begin
            self.listen(0.05)
        raise TimeoutError(address)

    def evaluate(self, expression):
        answer = self.call("Runtime.evaluate", expression=expression, returnByValue=True, awaitPromise=True)
        if "exceptionDetails" in answer:
            raise RuntimeError(answer["exceptionDetails"]["exception"].get("description", "script error"))
        return answer["result"].get("value")

    def wait_for(self, expression, timeout=30):
        """Seconds until a script expression becomes true."""
        begin = time.monotonic()
        while time.monotonic() < begin + timeout:
            if self.evaluate(expression):
                return time.monotonic() - begin
            self.listen(0.05)
        raise TimeoutError(expression)

    def picture(self, path=None, clip=None, scale=1):
        """PNG bytes of the visible part, or of a rectangle of the page, at a scale."""
        params = {"format": "png"}
        if clip:
            params |= {"clip": dict(zip(["x", "y", "width", "height"], clip)) | {"scale": scale}, "captureBeyondViewport": True}
        data = base64.b64decode(self.call("Page.captureScreenshot", **params)["data"])
        if path:
            with open(path, "wb") as file:
                file.write(data)
        return data

    def key(self, name, code):
        for kind in ["keyDown", "keyUp"]:
            self.call("Input.dispatchKeyEvent", type=kind, key=name, code=name, windowsVirtualKeyCode=code)

    def requests(self):
        """Addresses asked for, without data: and blob:, and without the page itself."""
        seen = [e["params"]["request"]["url"] for e in self.events if e["method"] == "Network.requestWillBeSent"]
        return [url for url in seen if not url.startswith(("data:", "blob:", "file:", "about:"))]

    def complaints(self):
        """Console errors, exceptions and log entries at the level of an error."""
        found = []
        for event in self.events:
            params = event["params"]
            if event["method"] == "Runtime.exceptionThrown":
                found.append(params["exceptionDetails"].get("exception", {}).get("description", "exception"))
            elif event["method"] == "Runtime.consoleAPICalled" and params["type"] in ("error", "assert"):
                found.append(" ".join(str(a.get("value", a.get("description", ""))) for a in params["args"]))
            elif event["method"] == "Log.entryAdded" and params["entry"]["level"] == "error":
                found.append(params["entry"]["text"])
        return found
