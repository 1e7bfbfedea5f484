"""Set up bridge, transports, recording and view, run, and tidy up: what ``usv-gym hil`` does."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from ..config import ConfigError
from ..voyage import Mission
from .backends import make_backend
from .bridge import Bridge
from .report import Report
from .rig import Process, Rig, make_controller, make_link, profile_of


def serve(
    mission: Mission,
    rig: Rig,
    *,
    lock_step: bool,
    realtime: float | None,
    interval: float = 0.1,
    own_ship: Any = "simulated",
    record: Path | None = None,
    out: Path | None = None,
    endless: bool = True,
    view: str | None = None,
    port: int = 0,
    say: Callable[[str], None] = print,
) -> Report:
    """Run a mission in front of a control system until it ends, is told to stop, or Ctrl-C.

    Raises
    ------
    ConfigError
        for whatever is wrong with transports, files or the interval, before anything runs.
    """
    dt = mission.scenario.simulation.dt
    steps = round(interval / dt)
    if steps < 1 or abs(interval / dt - steps) > 1e-9 * steps:
        raise ConfigError(f"--interval {interval:g}: expected a whole number of ticks of {dt:g} s")
    recorders = [make_backend("mcap", {"file": str(record)})] if record is not None else []
    profile = profile_of(rig)
    link = make_link(
        rig, profile, more=recorders, seed=mission.seed, factor=realtime or 0.0, external=own_ship == "external"
    )
    controller = make_controller(rig, link, lock_step=lock_step, interval=steps)
    if view == "map" and threading.current_thread() is not threading.main_thread():
        raise ConfigError("--view map: needs the main thread")
    keep = out is not None or view == "browser"
    bridge = Bridge(mission, link, controller, realtime=realtime, own_ship=own_ship, record=keep, endless=endless)
    controller.told = _Told(say)
    process = None
    try:
        link.open()
        for note in link.notes:
            say(f"note: {note}")
        pace = "lock-step" if lock_step else f"{realtime:g} times real time"
        say(f"{mission.scenario.name or 'scenario'} over {rig.backend}: {len(link.out)} topics out, {len(link.incoming)} in, "
            f"steered by {link.control}; {pace}; fail-safe: {rig.fail_safe} after {rig.timeout:g} s")  # fmt: skip
        if rig.start:
            process = Process(rig.start)
        _run(bridge, view, port, say)
    finally:
        if process is not None:
            process.end()
        link.close()
        report = bridge.report()
    for line in report.lines():
        say(line)
    if record is not None:
        say(f"{record}: {record.stat().st_size / 1e6:.2f} MB")
    if out is not None:
        from ..run import listing, write_outputs

        write_outputs(bridge.voyage.finish(), out)
        say(f"{out}: {listing(out)}")
    return report


class _Told:
    """Events on the terminal, at most ``MOST`` in a second."""

    MOST = 10

    def __init__(self, say: Callable[[str], None]) -> None:
        self._say, self._began, self._count = say, 0.0, 0

    def __call__(self, event: Mapping[str, str], t: float) -> None:
        now = time.monotonic()
        if now - self._began > 1.0:
            if self._count > self.MOST:
                self._say(f"and {self._count - self.MOST} more")
            self._began, self._count = now, 0
        self._count += 1
        if self._count <= self.MOST:
            self._say(f"t={t:.2f} s: " + " ".join(part for part in event.values() if part)[:200])


def _run(bridge: Bridge, view: str | None, port: int, say: Callable[[str], None]) -> None:
    try:
        if view is None:
            bridge.run()
        else:
            from .look import look

            look(bridge, view, port, say)
    except KeyboardInterrupt:
        bridge.stop()
