"""A mission under way in the browser: the page of the 3-D replay, fed over localhost while the episode runs.

``GET /`` is the page, ``GET /events`` a stream of server-sent events (``pace``: simulated seconds per second; ``part``:
what is new, as ``replay.html.pack`` makes it; ``end``: the outcome), ``POST /spawn`` puts an iceberg where it is told
to.  Only this machine can connect.
"""

from __future__ import annotations

import base64
import json
import math
import queue
import threading
import time
from collections.abc import Callable
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any

from .config import ConfigError
from .replay.archive import Episode
from .replay.html import pack, page, title
from .voyage import Mission, Voyage

RADIUS = 10.0  #: [m] of an obstacle that is put into the world
PUBLISH = 0.2  #: [s] of real time between two parts, at least
PATIENCE = 10.0  #: [s] after which a silent stream says that it is alive


class Broadcast:
    """A voyage that runs at its pace while others look at it; ``run`` in one thread, everything else from any."""

    def __init__(self, mission: Mission, pace: float = 1.0) -> None:
        """Cast off; time stands until ``run``."""
        self.pace = pace
        self.voyage = Voyage(mission)
        self.title = mission.scenario.name or "live"
        self._orders: queue.SimpleQueue[tuple[float, float, queue.SimpleQueue[str]]] = queue.SimpleQueue()
        self._news = threading.Condition()
        self._stopped = False
        self._publish()

    def run(self) -> str:
        """Sail to the end, or until ``stop``; returns the outcome."""
        interval = float(self.voyage.core.control_interval) / self.pace
        began = published = time.monotonic()
        steps = 0
        while not self.voyage.outcome and not self._stopped:
            self._obey(began + steps * interval)
            self.voyage.step()
            steps += 1
            if time.monotonic() - published >= PUBLISH or self.voyage.outcome:
                published = time.monotonic()
                self._publish()
        return self.voyage.outcome

    def stop(self) -> None:
        """Let ``run`` and all streams come to an end."""
        self._stopped = True
        with self._news:
            self._news.notify_all()

    def newer(self, than: float) -> tuple[Episode, str] | None:
        """The episode so far and its outcome, once it is longer than ``than`` [s]; None if that takes too long."""
        with self._news:
            self._news.wait_for(lambda: self._stopped or self.episode.t[-1] > than, PATIENCE)
            return (self.episode, self.outcome) if self.episode.t[-1] > than else None

    def spawn(self, north: float, east: float) -> str:
        """Ask for an obstacle [m]; returns what is wrong with that, or nothing."""
        if self.voyage.outcome or self._stopped:
            return "the episode is over"
        answer: queue.SimpleQueue[str] = queue.SimpleQueue()
        self._orders.put((north, east, answer))
        try:
            return answer.get(timeout=PATIENCE)
        except queue.Empty:
            return "no answer"

    @property
    def stopped(self) -> bool:
        """Whether ``stop`` was called."""
        return self._stopped

    def _obey(self, until: float) -> None:
        """Carry out what was asked for until it is time for the next step."""
        while True:
            try:
                north, east, answer = self._orders.get(timeout=max(0.0, until - time.monotonic()) or 1e-4)
            except queue.Empty:
                return
            names = self.voyage.commands.called
            name = next(f"obstacle_{n}" for n in range(1, len(names) + 2) if f"obstacle_{n}" not in names)
            try:
                self.voyage.commands.spawn(name, {"kind": "iceberg", "radius": RADIUS, "position": [north, east]})
                answer.put("")
            except ConfigError as error:
                answer.put(str(error))

    def _publish(self) -> None:
        episode = self.voyage.finish()
        with self._news:
            self.episode, self.outcome = episode, self.voyage.outcome
            self._news.notify_all()


def server(broadcast: Broadcast, port: int = 0) -> ThreadingHTTPServer:
    """A server on 127.0.0.1; call its ``serve_forever`` in a thread of its own.

    Raises
    ------
    OSError
        if the port is taken.
    """

    class Handler(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            if not self._ours():
                return
            if self.path == "/":
                text = page("", title(broadcast.episode.meta), live="events")
                self._answer(200, text.encode(), "text/html; charset=utf-8")
            elif self.path == "/events":
                self.send_response(200)
                self.send_header("Content-Type", "text/event-stream")
                self.send_header("Cache-Control", "no-store")
                self.end_headers()
                self._stream()
            else:
                self._answer(404, b"not found")

        def do_POST(self) -> None:
            length = int(self.headers.get("Content-Length") or 0)
            if not self._ours():
                return
            if self.path != "/spawn" or self.headers.get_content_type() != "application/json" or not 0 < length < 1000:
                self._answer(404, b"not found")
                return
            try:
                place = json.loads(self.rfile.read(length))
                north, east = float(place["north"]), float(place["east"])
                wrong = "" if math.isfinite(north + east) else "expected finite numbers"
            except (ValueError, KeyError, TypeError):
                wrong = "expected north and east [m]"
            wrong = wrong or broadcast.spawn(north, east)
            self._answer(400 if wrong else 200, wrong.encode())

        def log_message(self, format: str, *args: Any) -> None:
            """Nothing on the terminal."""

        def _ours(self) -> bool:
            """Refuse what another site made a browser send."""
            name = (self.headers.get("Host") or "").rsplit(":", 1)[0]
            origin = self.headers.get("Origin")
            good = name in ("127.0.0.1", "localhost") and origin in (None, f"http://{self.headers.get('Host')}")
            if not good:
                self._answer(403, b"only this machine")
            return good

        def _answer(self, status: int, body: bytes, kind: str = "text/plain; charset=utf-8") -> None:
            self.send_response(status)
            self.send_header("Content-Type", kind)
            self.send_header("Content-Length", str(len(body)))
            self.end_headers()
            self.wfile.write(body)

        def _stream(self) -> None:
            since = -math.inf
            try:
                self._event("pace", f"{broadcast.pace:g}")
                while not broadcast.stopped:
                    news = broadcast.newer(since)
                    if news is None:
                        self.wfile.write(b": alive\n\n")
                        continue
                    episode, outcome = news
                    self._event("part", base64.b64encode(pack(episode, since=since)).decode())
                    since = float(episode.t[-1])
                    if outcome:
                        self._event("end", outcome)
                        return
            except OSError:
                return  # the page was closed

        def _event(self, kind: str, data: str) -> None:
            self.wfile.write(f"event: {kind}\ndata: {data}\n\n".encode())
            self.wfile.flush()

    made = ThreadingHTTPServer(("127.0.0.1", port), Handler)
    made.daemon_threads = True
    return made


def serve(mission: Mission, *, port: int = 0, pace: float = 1.0, ready: Callable[[str], None]) -> Episode:
    """Run a mission in front of a browser until it is over and the user interrupts; ``ready`` is told the address."""
    broadcast = Broadcast(mission, pace)
    try:
        http = server(broadcast, port)
    except OSError as error:
        raise ConfigError(f"port {port}: {error.strerror or error}") from None
    thread = threading.Thread(target=http.serve_forever, daemon=True)
    thread.start()
    try:
        ready(f"http://127.0.0.1:{http.server_address[1]}/")
        broadcast.run()
        thread.join()
    except KeyboardInterrupt:
        pass
    finally:
        broadcast.stop()
        http.shutdown()
        http.server_close()
    return broadcast.voyage.finish()
