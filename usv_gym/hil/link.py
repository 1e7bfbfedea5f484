"""Between a world and its transports: which row is due, what it says, what came in; and what goes wrong on the way.

No transport is known here, and no clock: time is that of the simulation.
"""

from __future__ import annotations

import fnmatch
import heapq
import threading
from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ..config import ConfigError, suggestion
from ..envs.core import Core
from .backends import Backend
from .fields import Refused, decoder, encoder
from .mailbox import Mailbox, command_rows
from .profile import Profile, Row, Trouble
from .signals import Signals, Values

NEW_ONLY = ("ais", "target", "targets", "notice", "step")  #: signals that are told when they happen, whatever the rate
DEFAULT_RATE = {"objects": 1.0, "object": 1.0, "markers": 2.0, "track": 1.0, "weather": 1.0, "actuators": 10.0}  # [Hz]


class _Out:
    """An outgoing row, ready to use."""

    def __init__(self, row: Row, trouble: Trouble, where: str, factor: float, max_rate: float) -> None:
        self.row, self.trouble = row, trouble
        self.nmea = isinstance(row.fields, list | tuple)
        self.encode = (lambda values: values) if self.nmea else encoder(row.fields, where)
        self.items = {} if self.nmea else {key: encoder(fields, f"{where}.{key}") for key, fields in row.items.items()}
        self.rate = row.rate or DEFAULT_RATE.get(row.signal)
        self.note = ""
        if self.rate and factor * self.rate > max_rate:
            self.note = f"{row.topic}: {self.rate:g} Hz at {factor:g} times real time: sent at {max_rate / factor:g} Hz"
            self.rate = max_rate / factor
        self.limited = not self.rate and factor * 100.0 > max_rate
        if self.limited:
            self.rate = max_rate / factor  # else as fast as sensors fire, which may be too fast
        self.period_us = round(1e6 / self.rate) if self.rate else 0
        self.last = -1


class Link:
    """Rows of a profile on their transports.

    Parameters
    ----------
    profile
        the table.
    backends
        transports; commands may come from any of them.
    control
        the command that steers; rows of other steering commands are not listened to.
    trouble
        (pattern of topics, what happens to them), later ones first; else what the profile says.
    seed
        of jitter and loss.
    factor
        simulated seconds per second, so that no topic is faster than a transport carries; 0: lock-step, no limit.
    external
        listen to where the own ship is.
    """

    def __init__(
        self,
        profile: Profile,
        backends: Sequence[Backend],
        *,
        control: str | None = None,
        trouble: Sequence[tuple[str, Trouble]] = (),
        seed: int = 0,
        factor: float = 0.0,
        external: bool = False,
    ) -> None:
        self.profile, self.backends = profile, list(backends)
        self.control = control or profile.control
        steering = ("actuators", "heading_speed", "demand")
        unheard = {*steering, "own_pose"} - {self.control, "own_pose" if external else ""}
        rows = [row for row in profile.rows if row.direction == "out" or row.command not in unheard]
        for pattern, _ in trouble:
            if not any(fnmatch.fnmatch(row.topic, pattern) for row in rows):
                raise ConfigError(
                    f"--inject {pattern}: no such topic{suggestion(pattern, [row.topic for row in rows])}"
                )
        max_rate = min((backend.max_rate for backend in self.backends), default=float("inf"))
        self.out = [
            _Out(row, _trouble(row, trouble), f"{row.topic}.fields", factor, max_rate)
            for row in rows
            if row.direction == "out"
        ]
        self.incoming = [row for row in rows if row.direction == "in"]
        self._decoders = {row: _decoder(row) for row in self.incoming}
        self._trouble = {row: _trouble(row, trouble) for row in self.incoming}
        self._index = {row: k for k, row in enumerate(self.incoming)}
        self.required = command_rows(self.incoming, self.control)
        self.notes = [out.note for out in self.out if out.note]
        if unrated := [out for out in self.out if out.limited and out.row.signal not in NEW_ONLY]:
            self.notes.append(f"{', '.join(out.row.topic for out in unrated)}: at most {unrated[0].rate:g} Hz")
        self.mailbox = Mailbox()
        self.counters: Counter[str] = Counter()
        self.sent: Counter[str] = Counter()
        self.received: Counter[str] = Counter()
        self.strict = True  #: an answer has to bear the step that waits, or none; a lock-step wants that
        self.expected: tuple[Any, ...] = ()  # stamp and number of the step that waits
        self._lock = threading.Lock()
        self._seed = seed
        self._random = np.random.default_rng([seed, 0x48494C])
        self._random_in = np.random.default_rng([seed, 0x48494D])
        self._late: list[tuple[int, int, _Out, Any]] = []
        self._number = 0
        self.signals: Signals | None = None
        self.step_count = 0

    # --- life ---------------------------------------------------------------------------------------------------------
    def open(self) -> None:
        """Open the transports.

        Raises
        ------
        ConfigError
            if one cannot be opened; those that were are closed again.
        """
        try:
            for backend in self.backends:
                backend.open([out.row for out in self.out], self.incoming, self.receive)
        except BaseException:
            self.close()
            raise

    def close(self) -> None:
        """Close the transports."""
        for backend in self.backends:
            backend.close()

    def attach(self, core: Core, b: int = 0, names: list[str] | None = None) -> None:
        """Look at world b of a core from now on: a new episode."""
        self.signals = Signals(core, {out.row.signal for out in self.out}, b, names)
        self.mailbox.forget()
        self._late.clear()
        self.step_count = 0
        self._random = np.random.default_rng([self._seed, 0x48494C])
        for out in self.out:
            out.last = -1

    # --- out ----------------------------------------------------------------------------------------------------------
    def publish(self, status: Values | None = None, notices: Sequence[Values] = (), again: bool = False) -> None:
        """Send what is due now.  ``status``: of a step that waits for a command; ``again``: everything once more."""
        assert self.signals is not None
        signals = self.signals
        now = signals.t_us
        common = {**signals.common(), "step": self.step_count}
        self.mailbox.advance(now)
        for backend in self.backends:
            backend.stamp = int(common["stamp"])
        new = signals.fresh() if not again else signals.present()
        if notices:
            new["notice"] = list(notices)
        last: list[tuple[_Out, list[Values]]] = []
        if status is not None:
            new["step"] = [status]
            if self.strict:
                self.expected = (common["stamp"], self.step_count, 0, "")
        for out in self.out:
            name = out.row.signal
            if name not in new:
                continue
            if out.period_us and name not in NEW_ONLY and not again:
                slot = now // out.period_us
                if slot == out.last:
                    continue
                out.last = slot
            occurrences = new[name]
            if not occurrences and name not in NEW_ONLY:
                occurrences = new[name] = signals.listing(name)
            if name in ("step", "clock"):
                last.append((out, occurrences))  # behind everything else
            else:
                self._send(out, occurrences, common, now)
        while self._late and self._late[0][0] <= now:
            _, _, out, message = heapq.heappop(self._late)
            self._hand_over(out, message)
        for out, occurrences in sorted(last, key=lambda pair: pair[0].row.signal):  # the clock, then the step
            self._send(out, occurrences, common, now)
        for backend in self.backends:
            backend.step()

    def _send(self, out: _Out, occurrences: Sequence[Values], common: Values, now: int) -> None:
        for values in occurrences:
            complete = {**common, **values}
            message = out.encode(complete)
            for key, make in out.items.items():
                message[key] = [make({**common, **item}) for item in values["items"]]
            if out.nmea and out.row.items:
                message["items"] = values["items"]
            trouble = out.trouble
            if trouble:
                loss, wait = self._random.random(2)
                if loss < trouble.loss:
                    self.counters["lost on purpose"] += 1
                    continue
                due = now + round(1e6 * (trouble.delay + wait * trouble.jitter))
                if due > now:
                    self._number += 1
                    heapq.heappush(self._late, (due, self._number, out, message))
                    continue
            self._hand_over(out, message)

    def _hand_over(self, out: _Out, message: Any) -> None:
        self.sent[out.row.topic] += 1
        for backend in self.backends:
            backend.publish(out.row, message)

    # --- in -----------------------------------------------------------------------------------------------------------
    def receive(self, row: Row, message: Any) -> None:
        """Take a message from a transport, in whatever thread; what is wrong with it is counted, never raised."""
        try:
            values = self._decoders[row](message)
            if row.match and self.expected and values.get(row.match, "") not in self.expected:
                raise Refused("answers another step")
        except Refused as reason:
            self.refuse(str(reason))
            return
        except Exception as error:  # a hole in a decoder must not stop the loop
            self.refuse(f"broken: {type(error).__name__}")
            return
        due = 0
        if trouble := self._trouble[row]:
            with self._lock:
                loss, wait = self._random_in.random(2)
            if loss < trouble.loss:
                self.counters["lost on purpose"] += 1
                values = {}
            else:
                due = self.mailbox.now_us + round(1e6 * (trouble.delay + wait * trouble.jitter))
        with self._lock:
            self.received[row.topic] += 1
        for backend in self.backends:
            if hasattr(backend, "heard"):
                backend.heard(row, message)
        if values or row.command not in ("order", "own_pose"):
            self.mailbox.put(row.command, self._index[row], values, due)

    def refuse(self, reason: str) -> None:
        """Count a message that cannot be used."""
        with self._lock:
            self.counters[reason] += 1

    def rejected(self) -> dict[str, int]:
        """Reason -> how many messages were refused or lost so far."""
        total: Counter[str] = Counter(self.counters)
        total.update({key: n for key, n in self.mailbox.counters.items() if n})
        for backend in self.backends:
            total.update(backend.counters())
        return dict(total)


def _trouble(row: Row, given: Sequence[tuple[str, Trouble]]) -> Trouble:
    return next((trouble for pattern, trouble in reversed(given) if fnmatch.fnmatch(row.topic, pattern)), row.trouble)


def _decoder(row: Row) -> Any:
    if isinstance(row.fields, list | tuple):
        from .backends.nmea_fields import sentence_decoder

        return sentence_decoder(row)
    decode = decoder(row.fields, f"{row.topic}.fields")

    def wire(message: Any) -> Mapping[str, Any]:
        return decode(message)

    return wire
