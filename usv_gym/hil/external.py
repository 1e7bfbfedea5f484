"""A controller behind the bridge, used as any policy: publish the state, wait for the command, act.

In lock-step the world stands until the answer is there, so that an episode depends on the controller alone and not on clocks;
campaigns and scenario checks can therefore judge a real control system.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..config import ConfigError
from ..envs.core import Core, vessel_facts
from ..tasks.task import HEADING_SPAN, TaskConfig, action_channels
from .link import Link
from .signals import Values, thruster_names

ACTIONS = {"actuators": "actuators", "heading_speed": "heading_speed", "demand": "throttle_nozzle"}
FAIL_SAFES = ("zero", "hold")


class ExternalController:
    """A policy whose actions come over a link.

    Parameters
    ----------
    link
        the open link.
    lock_step
        wait for a command at each step; else take what is there.
    timeout
        [s] without a command after which the fail-safe acts: of simulated time, in lock-step of real time.
    fail_safe
        ``zero``: thrust to zero; ``hold``: the last command.
    patience
        [s] of real time to wait for the first command of a lock-step: a controller has to start.
    interval
        control steps between two commands that a lock-step waits for.
    must_answer
        raise when the first command does not come, instead of going on with the fail-safe.
    """

    def __init__(
        self,
        link: Link,
        *,
        lock_step: bool = True,
        timeout: float = 1.0,
        fail_safe: str = "zero",
        patience: float = 30.0,
        interval: int = 1,
        must_answer: bool = False,
    ) -> None:
        if fail_safe not in FAIL_SAFES:
            raise ConfigError(f"fail-safe {fail_safe!r}: expected one of {', '.join(FAIL_SAFES)}")
        if lock_step and not link.required:
            raise ConfigError(f"profile has no incoming row for {link.control!r}: nothing to wait for in lock-step")
        self.link, self.lock_step, self.timeout, self.fail_safe = link, lock_step, timeout, fail_safe
        link.strict = lock_step  # in real time a late answer is better than none
        self.patience, self.interval, self.must_answer = patience, interval, must_answer
        self.task = TaskConfig(action=ACTIONS[link.control])  # type: ignore[arg-type]
        self.failsafe = False
        self.failsafes = 0  # how often it began to act
        self.events: list[Values] = []  # fail-safe on and off, for the bridge to tell
        self.lateness, self.overruns, self.paused = 0.0, 0, False
        self.stopped: Callable[[], bool] = lambda: False
        self.told: Callable[[Values, float], None] = lambda event, t: None  # who else wants to know of events
        self.round_trips: list[float] = []  # of lock-step [s]
        self.ever = False  # whether a command has come in this life

    # --- policy -------------------------------------------------------------------------------------------------------
    def attach(self, core: Core, b: int = 0, names: list[str] | None = None) -> None:
        """Look at world b of a core; before ``reset``."""
        self.core, self.b, self.names = core, b, names

    def reset(self, info: dict[str, Any]) -> None:
        """A new episode: no command yet."""
        if getattr(self, "core", None) is None:
            raise ConfigError("an external controller needs the world: call attach(env.unwrapped.core) before reset")
        self.link.attach(self.core, self.b, self.names)
        facts = vessel_facts(self.core.model)
        names = thruster_names(self.core)
        self._channels = [(names[a], part) for a, part in action_channels("actuators", facts)]
        self._thrusters = dict(zip(names, self.core.model.thrusters, strict=True))
        self._max_speed = float(info["scales"]["max_speed"])
        self._demand: dict[str, float] = {}
        self._count = 0
        self._last_us = 0  # time of the last command
        self.failsafe = False
        self._fresh = False

    def act(self, observation: Any = None) -> NDArray[np.float64]:
        """Tell the state, get the command."""
        signals = self.link.signals
        assert signals is not None
        waits = self._count % self.interval == 0
        self._count += 1
        if waits:
            self.link.step_count += 1
        if self.lock_step and waits:
            self.link.mailbox.clear()
        events, self.events = self.events, []
        for event in events:
            self.told(event, signals.t_us / 1e6)
        began = time.perf_counter()
        self.link.publish(self._status() if waits else None, events)
        if not self.lock_step:
            values = self.link.mailbox.latest()
        elif waits:
            values = self._wait()
            self.round_trips.append(time.perf_counter() - began)
            del self.round_trips[:-100_000]
        else:
            values = []
        for part in values:
            self._take(part)
        now = signals.t_us
        if values:
            self._last_us = now
            self._alive(True)
        elif not self.lock_step and now - self._last_us > self.timeout * 1e6:
            self._alive(False)
        return self._action()

    # --- commands -----------------------------------------------------------------------------------------------------
    def _wait(self) -> list[Values]:
        """The command that answers this step; [] if the controller is gone."""
        mailbox, rows = self.link.mailbox, self.link.required
        limit = self.patience if not self.ever else self.timeout
        if self.failsafe:
            limit = min(self.timeout, self.core.control_interval * self.interval)  # about real time, until it is back
        until, nudge = time.monotonic() + limit, 1.0
        while True:
            left = until - time.monotonic()
            found = mailbox.wait(rows, max(min(left, nudge), 0.0))
            if found is not None:
                self.ever = True
                return found
            if time.monotonic() >= until or self.stopped():
                break
            if not self.ever:
                self.link.publish(self._status(), again=True)  # it may have subscribed only now
        if self.must_answer and not self.ever and not self.stopped():
            raise ConfigError(f"no command within {self.patience:g} s: is the controller running, and does it send "
                              f"{', '.join(self.link.incoming[k].topic for k in sorted(rows))}?")  # fmt: skip
        self._alive(False)
        return []

    def _alive(self, alive: bool) -> None:
        if alive == self.failsafe:
            self.failsafe = not alive
            self.failsafes += not alive
            text = "commands are back" if alive else f"no command for {self.timeout:g} s: {self.fail_safe}"
            self.events.append({"kind": "failsafe_off" if alive else "failsafe_on", "id": "own_ship", "text": text})

    def _take(self, values: Values) -> None:
        for name, value in values.items():
            thruster, _, part = name.partition(".")
            if name == "answers":
                continue
            if part == "thrust":
                self._thrust(thruster, float(value))
            elif part == "angle":
                if (fitted := self._thrusters.get(thruster)) and fitted.nozzle_max_deg > 0:
                    self._demand[f"{thruster}.nozzle"] = _limited(math.degrees(float(value)) / fitted.nozzle_max_deg)
            elif part:
                self._demand[name] = _limited(float(value))
            else:
                self._demand[name] = float(value)

    def _thrust(self, name: str, force: float) -> None:
        """Demand for a force ahead [N], by the thruster's curve F = gain n|n|, with the bucket where there is one."""
        fitted = self._thrusters.get(name)
        if fitted is None:
            return
        gain = fitted.gain_ahead_N_per_rpm2 if force >= 0.0 or fitted.bucket else fitted.gain_astern_N_per_rpm2
        n = math.sqrt(abs(force) / gain)
        if fitted.bucket:
            idle = gain * fitted.rpm_idle**2
            self._demand[f"{name}.bucket"] = math.copysign(min(abs(force) / idle, 1.0) if idle > 0.0 else 1.0, force)
            n = max(n, fitted.rpm_idle)
        elif force < 0.0:
            n = -n
        idle = fitted.rpm_idle
        span = fitted.rpm_max - idle if n >= idle else idle - fitted.rpm_min
        self._demand[f"{name}.rpm"] = _limited((n - idle) / span)

    def _action(self) -> NDArray[np.float64]:
        """The action that the demand, or the fail-safe, amounts to."""
        dead = self.failsafe and self.fail_safe == "zero"
        if self.link.control == "actuators":
            if dead:
                return np.zeros(len(self._channels))
            parts = ("rpm", "nozzle", "bucket")
            return np.array(
                [self._demand.get(f"{name}.{parts[part]}", self._missing(name, part)) for name, part in self._channels]
            )
        if self.link.control == "demand":
            return (
                np.zeros(2)
                if dead
                else np.array([_limited(self._demand.get("surge", 0.0)), _limited(self._demand.get("yaw", 0.0))])
            )
        assert self.link.signals is not None
        heading = float(self.link.signals.w["nav"]["mru_heading"][0])
        turn = 0.0 if dead else (self._demand.get("heading", heading) - heading + math.pi) % (2 * math.pi) - math.pi
        speed = 0.0 if dead else self._demand.get("speed", 0.0)
        return np.array([_limited(turn / HEADING_SPAN), _limited(2.0 * speed / self._max_speed - 1.0)])

    def _missing(self, name: str, part: int) -> float:
        """A controller that never speaks of the bucket wants it ahead, once it has asked for revolutions."""
        return 1.0 if part == 2 and f"{name}.rpm" in self._demand else 0.0

    def _status(self) -> Values:
        signals = self.link.signals
        assert signals is not None
        age = (signals.t_us - self._last_us) / 1e6 if self.ever else math.nan
        return {
            "paused": self.paused, "failsafe": self.failsafe, "command_age": age, "lateness": self.lateness,
            "overruns": self.overruns, "rejected": sum(self.link.counters.values()),
        }  # fmt: skip


def _limited(value: float) -> float:
    return min(max(value, -1.0), 1.0)
