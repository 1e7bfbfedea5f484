"""A headless Chromium over its DevTools protocol, with nothing but the standard library."""

import base64
import json
import os
import shutil
import socket
import subprocess
import tempfile
import time
import urllib.request
from pathlib import Path

FLAGS = (
    "--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--disable-background-networking",
    "--disable-component-update", "--disable-sync", "--use-angle=swiftshader", "--enable-unsafe-swiftshader",
    "--hide-scrollbars", "--force-device-scale-factor=1", "--remote-debugging-port=0",
)  # fmt: skip


def chromium():
    """Path of the browser, or None."""
    return next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)


class Browser:
    """One page; ``requests`` and ``complaints`` are what it asked the network for and what it wrote on the console."""

    def __init__(self, width=1400, height=850):
        self.size = width, height
        self.requests, self.complaints = [], []
        self._count = 0

    def __enter__(self):
        self._profile = tempfile.TemporaryDirectory(ignore_cleanup_errors=True)
        command = [chromium(), *FLAGS, f"--user-data-dir={self._profile.name}", "about:blank"]
        self._process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        try:
            port = self._port()
            with urllib.request.urlopen(f"http://127.0.0.1:{port}/json") as answer:
                path = next(p for p in json.load(answer) if p["type"] == "page")["webSocketDebuggerUrl"].split(
                    str(port)
                )[1]
            self._socket = socket.create_connection(("127.0.0.1", port), timeout=120)
            self._shake_hands(port, path)
            for domain in ("Page", "Runtime", "Network", "Log"):
                self.call(f"{domain}.enable")
            self.resize(*self.size)
        except BaseException:
            self.__exit__()
            raise
        return self

    def __exit__(self, *_):
        if hasattr(self, "_socket"):
            self._socket.close()
        self._process.kill()
        self._process.wait()
        self._profile.cleanup()

    def resize(self, width, height, mobile=False):
        self.call("Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=1, mobile=mobile)

    def open(self, url, ready="document.readyState === 'complete'"):
        self.call("Page.navigate", url=url)
        self.wait(ready)

    def wait(self, condition, seconds=90):
        end = time.monotonic() + seconds
        while not self.run(condition):
            if time.monotonic() > end:
                raise TimeoutError(f"{condition}; console: {self.complaints}")
            time.sleep(0.1)

    def run(self, script):
        """Value of an expression in the page; promises are awaited."""
        answer = self.call("Runtime.evaluate", expression=script, returnByValue=True, awaitPromise=True)
        if "exceptionDetails" in answer:
            raise RuntimeError(json.dumps(answer["exceptionDetails"])[:800])
        return answer["result"].get("value")

    def frame(self):
        """Let the page draw what has changed."""
        self.run("new Promise(done => requestAnimationFrame(() => requestAnimationFrame(done)))")

    def screenshot(self):
        self.frame()
        return base64.b64decode(self.call("Page.captureScreenshot", format="png")["data"])

    def call(self, method, **params):
        self._count += 1
        self._send(json.dumps({"id": self._count, "method": method, "params": params}).encode())
        while True:
            message = json.loads(self._receive())
            if message.get("id") == self._count:
                if "error" in message:
                    raise RuntimeError(f"{method}: {message['error']}")
                return message["result"]
            self._note(message.get("method"), message.get("params", {}))

    def _note(self, method, params):
        if method == "Network.requestWillBeSent":
            self.requests.append(params["request"]["url"])
        elif method == "Runtime.consoleAPICalled" and params["type"] in ("error", "warning", "assert"):
            self.complaints.append(" ".join(str(a.get("value", a.get("description"))) for a in params["args"]))
        elif method == "Runtime.exceptionThrown":
            self.complaints.append(json.dumps(params["exceptionDetails"])[:800])
        elif method == "Log.entryAdded":
            entry = params["entry"]
            # "rendering" is the software renderer, which says that a screenshot is slow
            if entry["level"] in ("error", "warning") and entry["source"] != "rendering":
                self.complaints.append(entry["text"])

    def _port(self):
        file = Path(self._profile.name) / "DevToolsActivePort"
        for _ in range(600):
            if file.exists() and (lines := file.read_text().splitlines()):
                return int(lines[0])
            time.sleep(0.1)
        raise TimeoutError("Chromium did not start")

    # --- RFC 6455 ----------------------------------------------------------------------------------------------------
    def _shake_hands(self, port, path):
        key = base64.b64encode(os.urandom(16)).decode()
        self._socket.sendall(
            f"GET {path} HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
            f"Sec-WebSocket-Key: {key}\r\nSec-WebSocket-Version: 13\r\n\r\n".encode()
        )
        head = b""
        while not head.endswith(b"\r\n\r\n"):
            head += self._socket.recv(1)
        assert b" 101 " in head

    def _send(self, data):
        n = len(data)
        size = (
            bytes([128 | n]) if n < 126 else bytes([254]) + n.to_bytes(2) if n < 65536 else bytes([255]) + n.to_bytes(8)
        )
        self._socket.sendall(b"\x81" + size + bytes(4) + data)  # the mask is zero

    def _receive(self):
        data = b""
        while True:
            first, second = self._exactly(2)
            n = second & 127
            n = int.from_bytes(self._exactly(2)) if n == 126 else int.from_bytes(self._exactly(8)) if n == 127 else n
            payload = self._exactly(n)
            if first & 15 in (0, 1):
                data += payload
                if first & 128:
                    return data

    def _exactly(self, n):
        data = bytearray()
        while len(data) < n:
            piece = self._socket.recv(n - len(data))
            if not piece:
                raise ConnectionError("Chromium closed the connection")
            data += piece
        return bytes(data)
