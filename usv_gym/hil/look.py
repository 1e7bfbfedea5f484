"""Look at a running bridge: in the browser in 3-D, or on the map; a click puts an obstacle into the sea.

The bridge runs in a thread of its own and owns the world; a view gets copies, and asks for changes with ``Bridge.ask``.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from typing import Any

from ..config import ConfigError
from ..live import Broadcast, server
from ..play import Live, show
from ..render.scene import History
from ..voyage import Voyage
from .bridge import Bridge

FRESH = 0.05  #: [s] of real time between two copies for the map
SHARE = 20.0  #: a copy of the whole episode so far may take this part of the time, one in ..


def look(bridge: Bridge, view: str, port: int, say: Callable[[str], None]) -> None:
    """Run a bridge with a view: ``browser`` (until the mission ends or Ctrl-C) or ``map`` (until the window is closed)."""
    if view == "browser":
        shown = Shown(bridge)
        try:
            http = server(shown, port)
        except OSError as error:
            raise ConfigError(f"port {port}: {error.strerror or error}") from None
        threading.Thread(target=http.serve_forever, daemon=True).start()
        try:
            say(f"http://127.0.0.1:{http.server_address[1]}/")
            bridge.view = shown.look
            bridge.run()
        finally:
            shown.stop()
            http.shutdown()
            http.server_close()
        return
    onlooker = Onlooker(bridge)
    running = threading.Thread(target=bridge.run, name="usv_gym bridge")

    def stage() -> Onlooker:
        running.start()
        return onlooker

    try:
        show(stage, title=f"usv_gym hil: {bridge.mission.scenario.name}")
    finally:
        bridge.stop()
        if running.ident is not None:
            running.join()


class Shown(Broadcast):
    """The page of ``usv-gym live``, fed by a bridge."""

    def __init__(self, bridge: Bridge) -> None:  # not the parent's: it would cast off on its own
        self.bridge, self.pace = bridge, bridge.realtime or 1.0
        self.title = bridge.mission.scenario.name or "hil"
        self._news = threading.Condition()
        self._stopped = False
        self._next = 0.0
        self._publish()

    @property
    def voyage(self) -> Voyage:  # type: ignore[override]
        """The bridge's."""
        return self.bridge.voyage

    def look(self, voyage: Voyage) -> None:
        """After every step: show what is new, now and then."""
        began = time.monotonic()
        if began >= self._next or voyage.outcome:
            self._publish()
            took = time.monotonic() - began  # grows with the episode
            self._next = began + max(0.2, SHARE * took)

    def spawn(self, north: float, east: float) -> str:
        """Put an obstacle into the sea; returns what is wrong with that, or nothing."""
        try:
            self.bridge.ask(lambda: self.bridge.spawn_at(north, east))
        except (ConfigError, TimeoutError) as error:
            return str(error)
        return ""


class Onlooker(Live):
    """The live window on a world that runs in another thread."""

    def __init__(self, bridge: Bridge) -> None:  # not the parent's: it would cast off on its own
        self.bridge = bridge
        self.mission, self.name, self.manual = bridge.mission, bridge.mission.scenario.name, False
        self.history = History()
        self._news: list[str] = []
        self._copied = 0.0
        self._take(bridge.voyage)
        bridge.view = self._look
        self.commands = _Asked(bridge)  # type: ignore[assignment]

    @property
    def voyage(self) -> Voyage:  # type: ignore[override]
        """The bridge's."""
        return self.bridge.voyage

    def _look(self, voyage: Voyage) -> None:
        now = time.monotonic()
        if now - self._copied >= FRESH:
            self._copied = now
            self._take(voyage)

    def _take(self, voyage: Voyage) -> None:
        self._shot = voyage.core.worlds[:1].copy()[0]
        self._shown = voyage.t

    def _record(self) -> Any:
        return self._shot

    @property
    def ended(self) -> str:
        """Whether it is over."""
        return self.bridge.voyage.outcome or ("stopped" if self.bridge.stopped else "")

    def restart(self) -> None:
        """Begin anew."""
        self.bridge.ask(self.bridge.reset)
        self.history = History()

    def advance(self, seconds: float, demand: tuple[float, float]) -> None:
        """Time passes by itself."""

    def step(self, demand: tuple[float, float]) -> None:
        """Time passes by itself."""

    def touched(self, source: int) -> None:
        """Show it at once."""
        self.bridge.ask(lambda: self._take(self.bridge.voyage))


class _Asked:
    """The commands of a world that runs in another thread."""

    def __init__(self, bridge: Bridge) -> None:
        self._bridge = bridge

    def __getattr__(self, name: str) -> Any:
        value = getattr(self._bridge.voyage.commands, name)
        if not callable(value):
            return value
        return lambda *arguments, **more: self._bridge.ask(
            lambda: getattr(self._bridge.voyage.commands, name)(*arguments, **more)
        )
