"""The bridge: one thread that owns the world and steps it, in lock-step with a controller or in real time.

Real time is an absolute schedule: tick k is due at start + k dt / factor, whatever happened to the ticks before it, so that
nothing drifts; how late each step began is measured and reported.
"""

from __future__ import annotations

import contextlib
import gc
import json
import math
import os
import queue
import time
from collections.abc import Callable, Sequence
from typing import Any, Literal

import numpy as np

from ..config import ConfigError
from ..engine import settle_traffic
from ..replay.recorder import Recorder
from ..run import plan
from ..scenarios.build import carry_on_from_here
from ..scenarios.loader import Source, load_scenario
from ..voyage import ENDLESS, Mission, Voyage
from ..world.state import BEHAVIOUR_HOLD, MODEL_KINEMATIC
from .external import ExternalController
from .link import Link
from .report import Report
from .signals import Values

OwnShip = Literal["simulated", "external", "only"]
FOREVER = 1e8  #: [s]
SLIP = 5.0  #: [s] behind schedule after which the schedule starts anew
SPAWN_RADIUS = 20.0  #: [m] of an obstacle that is spawned without one, as in the original
_LIMITS = {"north": 1e7, "east": 1e7, "sog": 100.0, "yaw_rate": 10.0, "heading": 1e3, "course": 1e3}  # of a pose
_KEPT = 1 << 17  #: latenesses that are kept


def plan_hil(
    source: Source,
    *,
    vessel: str | None = None,
    overrides: Sequence[str] = (),
    seed: int = 0,
    own_ship: OwnShip = "simulated",
    duration: float | None = None,
) -> Mission:
    """A mission for the bridge: a step is one tick, and it has no end unless ``duration`` [s] says so.

    ``only`` leaves out all other ships, obstacles and their sensors.

    Raises
    ------
    ConfigError
        for anything that is wrong with scenario or vessel.
    """
    dt = load_scenario(source, overrides=overrides, vessel=vessel).simulation.dt
    time_keys = [f"simulation.control_interval={dt!r}", f"simulation.duration={duration or FOREVER!r}"]
    mission = plan(source, policy="idle", vessel=vessel, overrides=[*overrides, *time_keys], seed=seed)
    scenario = mission.scenario
    if own_ship == "only":
        scenario = scenario.model_copy(update={"ships": {}, "obstacles": {}})
    return Mission(scenario, "hil", seed)


class Bridge:
    """A mission in front of a link.

    Parameters
    ----------
    mission
        of ``plan_hil``.
    link
        its rows and transports, not yet open.
    controller
        how commands are awaited.
    realtime
        simulated seconds per second; None: as fast as the lock-step goes.
    own_ship
        ``external``: its pose comes over the link, and nothing steers it here.
    record
        keep the episode; memory grows with time.
    endless
        go on after collisions and arrival.
    view
        called after every step with the voyage.
    """

    def __init__(
        self,
        mission: Mission,
        link: Link,
        controller: ExternalController,
        *,
        realtime: float | None = None,
        own_ship: OwnShip = "simulated",
        record: bool = False,
        endless: bool = True,
        view: Callable[[Voyage], None] | None = None,
    ) -> None:
        if realtime is not None and not 0.1 <= realtime <= 20.0:
            raise ConfigError(f"real-time factor {realtime:g}: expected 0.1 to 20")
        self.mission, self.link, self.controller = mission, link, controller
        self.realtime, self.own_ship, self.record, self.endless, self.view = realtime, own_ship, record, endless, view
        controller.stopped = lambda: self.stopped
        self.stopped = False
        self.paused = False
        self.resets = 0
        self._steps = 0
        self._simulated_us = 0
        self._lateness = np.zeros(_KEPT)
        self._elapsed, self._covered_us = 0.0, 0
        self.overruns = self.slips = 0
        self._spawned = 0
        self._asked: queue.SimpleQueue[tuple[Callable[[], Any], queue.SimpleQueue[Any]]] = queue.SimpleQueue()
        self._cast_off()

    def _cast_off(self) -> None:
        """Build the world anew."""
        config = self.controller.task
        if self.endless:
            config = ENDLESS.model_copy(update={"action": config.action})
        self.voyage = Voyage(self.mission, self.controller, config)
        if not self.record:
            self.voyage.recorder = _Forgetful()
        self._world = self.voyage.core.worlds[0]
        self._dt_us = int(self._world["dt_us"])
        self._pose: Values = {}
        if self.own_ship == "only":
            self._world["sensors"]["exteroceptive"] = 0
        if self.own_ship == "external":
            v = self._world["vessels"]
            v["model"][0], v["behaviour"][0], v["controlled"][0] = MODEL_KINEMATIC, BEHAVIOUR_HOLD, 1
            v["turn_rate_max"][0], v["turn_decay"][0] = 0.0, 1.0
            v["speed"][0] = v["nu"][0, 0]
        self._anchor: tuple[float, int] | None = None  # real and simulated time that the schedule counts from

    # --- running ------------------------------------------------------------------------------------------------------
    def run(self) -> Report:
        """Run until ``stop``, an order to stop, or the end of the mission; the link must be open."""
        self.stopped = False
        gc.collect()
        gc.freeze()  # what there is now stays: collecting it again and again would cost milliseconds
        try:
            while not self.stopped and not self.voyage.outcome:
                self.step()
        finally:
            gc.unfreeze()
            self._rest()
            with contextlib.suppress(Exception):
                self.link.publish()
        return self.report()

    def step(self) -> None:
        """Obey orders, wait for the time of the next step, and make it."""
        self._obey(0.0)
        if self.paused:
            self._rest()
            while self.paused and not self.stopped:
                self._obey(0.05)
        if self.stopped:
            return
        if self.realtime is not None:
            self._pace(self.realtime)
        elif self._anchor is None:
            self._anchor = time.perf_counter(), self.t_us
        if self.own_ship == "external":
            self._place()
        notices = self.voyage.step()
        self._steps += 1
        self._simulated_us += self._dt_us
        self.controller.events += [{"kind": n.kind, "id": n.id, "text": n.text} for n in notices]
        if self.view is not None:
            self.view(self.voyage)

    def stop(self) -> None:
        """Let ``run`` come to an end; from any thread, or a signal handler."""
        self.stopped = True
        self.link.mailbox.wake()

    @property
    def t_us(self) -> int:
        """Time of the world [us]."""
        return int(self._world["tick"]) * self._dt_us

    def _pace(self, factor: float) -> None:
        """Sleep until the present tick is due."""
        now = time.perf_counter()
        if self._anchor is None:
            self._anchor = self._latest = now, self.t_us
        began, first = self._anchor
        due = began + (self.t_us - first) / 1e6 / factor
        if due > now:
            time.sleep(due - now)
            now = time.perf_counter()
        late = now - due
        self._latest = now, self.t_us
        self._lateness[self._steps % _KEPT] = late
        self.controller.lateness = late
        if late > self._dt_us / 1e6 / factor:
            self.overruns += 1
            self.controller.overruns = self.overruns
            if late > SLIP:
                self.slips += 1
                self._rest()
                self._anchor = now, self.t_us

    def _rest(self) -> None:
        """Real time stops to count: from the start of the first step to that of the last one."""
        if self._anchor is not None:
            if self.realtime is None:
                self._latest = time.perf_counter(), self.t_us
            self._elapsed += self._latest[0] - self._anchor[0]
            self._covered_us += self._latest[1] - self._anchor[1]
            self._anchor = None

    def report(self) -> Report:
        """How it went so far."""
        paced = self.realtime is not None
        return Report(
            self._steps, self._simulated_us / 1e6, self._covered_us / 1e6, self._elapsed,
            self._lateness[: min(self._steps, _KEPT)].copy() if paced else np.zeros(0),
            self.overruns, self.slips, self.controller.failsafes, dict(self.link.sent), dict(self.link.received),
            self.link.rejected(), np.array(self.controller.round_trips),
        )  # fmt: skip

    def ask(self, what: Callable[[], Any], patience: float = 10.0) -> Any:
        """Let the thread of the world do something between two steps, and return what it returns; from any other thread.

        Raises
        ------
        TimeoutError
            if the bridge does not run.
        """
        answer: queue.SimpleQueue[Any] = queue.SimpleQueue()
        self._asked.put((what, answer))
        self.link.mailbox.wake()
        try:
            good, value = answer.get(timeout=patience)
        except queue.Empty:
            raise TimeoutError("the bridge does not answer") from None
        if not good:
            raise value
        return value

    def spawn_at(self, north: float, east: float, radius: float = SPAWN_RADIUS) -> None:
        """Put an obstacle somewhere [m]."""
        self._spawned += 1
        place = {"kind": "iceberg", "radius": radius, "position": [north, east]}
        self.voyage.commands.spawn(f"spawned_{self._spawned}", place)

    # --- orders -------------------------------------------------------------------------------------------------------
    def _obey(self, patience: float) -> None:
        while not self._asked.empty():
            what, answer = self._asked.get()
            try:
                answer.put((True, what()))
            except Exception as error:  # it is the asker's
                answer.put((False, error))
        for order in self.link.mailbox.orders(patience):
            try:
                self._order(order)
            except Exception as error:  # an order from outside must not stop the loop
                reason = " ".join(str(error).split())[:200] or type(error).__name__
                self.link.refuse("order refused")
                self.controller.events.append({"kind": "refused", "id": str(order.get("id", ""))[:60], "text": reason})
        if self.paused and self.controller.events:
            events, self.controller.events = self.controller.events, []
            for event in events:
                self.controller.told(event, self.t_us / 1e6)
            self.link.publish(notices=events)

    def _order(self, order: Values) -> None:
        if "paused" in order:
            self._pause(bool(order["paused"]))
            return
        command = str(order.get("command", ""))
        more = json.loads(str(order["arguments"])) if order.get("arguments") else {}
        if not isinstance(more, dict):
            raise ConfigError("arguments: expected a JSON object")
        id = str(more.pop("id", order.get("id") or ""))
        if command in ("pause", "resume"):
            self._pause(command == "pause")
        elif command == "stop":
            self.stop()
        elif command == "reset":
            self.reset(more.get("seed"))
        elif command == "spawn":
            self._spawned += 1
            spec = more or {
                "kind": "iceberg",
                "radius": float(order.get("radius") or SPAWN_RADIUS),
                "position": {"latitude_deg": float(order["latitude"]), "longitude_deg": float(order["longitude"])},
            }
            self.voyage.commands.spawn(id or f"spawned_{self._spawned}", spec)
        elif command == "move" and not more:
            place = {"latitude_deg": float(order["latitude"]), "longitude_deg": float(order["longitude"])}
            north, east = self._local(place["latitude_deg"], place["longitude_deg"])
            heading = math.degrees(order["heading"]) if "heading" in order else None
            self.voyage.commands.move(id, north, east, heading)
        else:
            self.voyage.commands.apply(command, {"id": id, **more})

    def _pause(self, pause: bool) -> None:
        if pause != self.paused:
            self.paused = self.controller.paused = pause
            self.controller.events.append({"kind": "paused" if pause else "resumed", "id": "", "text": ""})

    def reset(self, seed: int | None = None) -> None:
        """Begin the mission anew, with another seed if one is given."""
        if seed is not None:
            if isinstance(seed, bool) or not isinstance(seed, int) or seed < 0:
                raise ConfigError(f"seed: expected a whole number of at least 0, got {seed!r}")
            self.mission = Mission(self.mission.scenario, self.mission.policy, seed)
        self._rest()
        self.resets += 1
        self._cast_off()
        self.controller.events.append({"kind": "reset", "id": "", "text": f"seed {self.mission.seed}"})

    # --- the own ship elsewhere ---------------------------------------------------------------------------------------
    def _local(self, latitude: float, longitude: float) -> tuple[float, float]:
        from ..scenarios.places import GeoPoint

        return self.mission.scenario.local(GeoPoint(latitude_deg=latitude, longitude_deg=longitude))

    def _place(self) -> None:
        """Put the own ship where the last message says; between messages it goes on straight."""
        news = self.link.mailbox.pose()
        if news is None:
            return
        if "flu_yaw_rate" in news:
            news["yaw_rate"] = -news["flu_yaw_rate"]
        if "enu_qz" in news:
            news["enu_yaw"] = 2.0 * math.atan2(news["enu_qz"], news["enu_qw"])
        if "enu_yaw" in news:
            news["heading"] = math.pi / 2 - news["enu_yaw"]
        try:
            if "latitude" in news:
                news["north"], news["east"] = self._local(news["latitude"], news["longitude"])
        except ValueError:
            self.link.refuse("no place on earth")
            return
        if any(abs(news.get(name, 0.0)) > limit for name, limit in _LIMITS.items()):
            self.link.refuse("out of range")
            return
        v = self._world["vessels"]
        settle_traffic(self.voyage.core.worlds)
        heading = float(news.get("heading", v["eta"][0, 2]))
        if "north" in news:
            v["eta"][0, :2] = news["north"], news["east"]
        speed = float(news.get("sog", v["speed"][0]))
        course = float(news["course"]) if "course" in news and "heading" not in news else heading
        v["eta"][0, 2] = v["heading_set"][0] = heading
        v["speed"][0] = v["nu"][0, 0] = speed
        v["nu"][0, 2] = float(news.get("yaw_rate", v["nu"][0, 2]))
        v["velocity"][0] = speed * math.cos(course), speed * math.sin(course)
        carry_on_from_here(self._world, 0)


class _Forgetful(Recorder):
    """Keeps nothing: a rig may run for weeks."""

    def sample(self, worlds: Any, b: int = 0) -> None:
        """Nothing."""

    def event(self, t: float, kind: str, id: int = -1, text: str = "") -> None:
        """Nothing."""

    def action(self, action: Any) -> None:
        """Nothing."""


def real_time_priority() -> str:
    """Ask the system for the scheduling class FIFO; returns what is wrong with that, or nothing."""
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(50))
    except (AttributeError, OSError) as error:
        return getattr(error, "strerror", None) or "not on this system"
    return ""
