"""One controller for many rows: how a campaign drives whatever it is given.

A controller that knows how to decide for a batch (``reset_batch`` and ``act_batch``: the built-in ones; ``act_batch`` alone:
a learned one) decides for all rows in one call; any other decides for one row at a time.  What a controller does wrong
becomes the cause of a failed episode, never an exception of the campaign.
"""

from __future__ import annotations

import faulthandler
import math
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..envs.core import Core
from ..policies.custom import cause
from ..tasks.task import DISCRETE, unflatten

GRACE = 60.0  #: [s] that resetting and the first step may take: modules are imported and kernels compiled then


def decides_for_batches(controller: Any) -> bool:
    """Whether a controller has ``act_batch``."""
    return callable(getattr(controller, "act_batch", None))


class Watchdog:
    """Ends this process when a controller takes too long, and leaves behind where it was.

    Nothing that Python can do interrupts a controller that hangs in compiled code; the process that runs it can be ended.
    ``path`` then holds what it was doing and the traceback; who started the process reads it with :func:`last_words`.
    """

    def __init__(self, path: Path | None, limit: float) -> None:
        self.limit = limit
        self._file = None if path is None or not math.isfinite(limit) else path.open("wb", buffering=0)

    @contextmanager
    def watch(self, doing: str, limit: float | None = None) -> Iterator[None]:
        """Allow the block ``limit`` seconds."""
        if self._file is None:
            yield
            return
        limit = self.limit if limit is None else limit
        os.ftruncate(self._file.fileno(), 0)
        os.pwrite(self._file.fileno(), f"{doing} took longer than {limit:g} s\n".encode(), 0)
        self._file.seek(0, os.SEEK_END)
        faulthandler.dump_traceback_later(limit, exit=True, file=self._file)
        try:
            yield
        finally:
            faulthandler.cancel_dump_traceback_later()
            os.ftruncate(self._file.fileno(), 0)


def last_words(path: Path) -> str:
    """What a watchdog left behind, in one line; "" if it did not bite."""
    try:
        lines = path.read_text(encoding="utf-8", errors="replace").splitlines()
    except OSError:
        return ""
    if len(lines) < 2:  # armed, but it was something else that ended the process
        return ""
    package = str(Path(__file__).resolve().parents[1])
    for line in lines[1:]:  # most recent call first
        if line.lstrip().startswith("File ") and package not in line:
            file, _, rest = line.strip().removeprefix("File ").partition(", line ")
            number, _, function = rest.partition(" in ")
            return f"{lines[0]} (in {function}, {Path(file.strip(chr(34))).name}:{number})"
    return lines[0]


class Helm:
    """Who steers the rows of a core.

    ``failures`` [B] says what a row's controller did wrong ("" for nothing); such a row is not to be stepped any more.
    """

    def __init__(self, make: Any, core: Core, watchdog: Watchdog, *, trusted: bool = False) -> None:
        self._core, self._watchdog, self._trusted = core, watchdog, trusted
        first = make()
        self._batch = first if decides_for_batches(first) else None
        self._each = [] if self._batch is not None else [first, *(make() for _ in range(core.num - 1))]
        self.failures = [""] * core.num
        self._new = True

    def reset(self, mask: NDArray[np.bool_]) -> None:
        """New episodes in the rows of ``mask`` [B]; the others are not used any more."""
        core = self._core
        self.failures = [""] * core.num
        if self._batch is not None:
            info = {**core.info(0), "scales": core.scales()}
            one = getattr(self._batch, "reset_batch", None)
            self._call("reset", mask, lambda: one(core.num, info) if one else self._batch.reset(info), GRACE)
            return
        for b in np.flatnonzero(mask).tolist():
            info = {**core.info(b), "scales": core.scales()}
            only = np.arange(core.num) == b
            if hasattr(self._each[b], "attach"):  # it looks at sensors that no observation holds (hil.external)
                self._each[b].attach(core, b)
            self._call("reset", only, lambda b=b, info=info: self._each[b].reset(info), GRACE)

    def steer(self, mask: NDArray[np.bool_], step: int) -> NDArray[np.bool_]:
        """Write the actions of the rows of ``mask`` [B] into the core; returns the rows that may be stepped."""
        core = self._core
        flat = core.config.flat
        limit = GRACE if self._new else None
        self._new = False
        doing = f"act() at step {step} (t = {step * core.control_interval:g} s)"
        if self._batch is not None:
            obs = core.obs if flat else unflatten(core.config, core.obs)
            ok, actions = self._call(doing, mask, lambda: self._batch.act_batch(obs, mask), limit)
            if ok:
                self._take(mask, actions, doing)
        else:
            for b in np.flatnonzero(mask).tolist():
                seen = core.obs[b].copy() if flat else unflatten(core.config, core.obs[b])
                only = np.arange(core.num) == b
                ok, action = self._call(doing, only, lambda b=b, seen=seen: self._each[b].act(seen), limit)
                if ok:
                    self._take(only, action, doing)
        sound: NDArray[np.bool_] = mask & np.array([not failure for failure in self.failures])
        return sound

    def _call(self, doing: str, mask: NDArray[np.bool_], what: Any, limit: float | None) -> tuple[bool, Any]:
        """Whether it went well, and what came back."""
        try:
            if self._trusted:
                return True, what()
            with self._watchdog.watch(doing, limit):
                return True, what()
        except Exception as error:
            self._fail(mask, f"{doing} raised {cause(error)}")
            return False, None

    def _take(self, mask: NDArray[np.bool_], actions: Any, doing: str) -> None:
        """Copy actions [B, n] (or [n] of the one row of ``mask``) into the core, or say what is wrong with them."""
        core = self._core
        try:
            given = np.asarray(actions, float)
            if self._batch is not None:
                given = given.reshape(core.num, -1)[mask]
            else:
                given = given.reshape(1, -1)
        except (TypeError, ValueError):
            self._fail(mask, f"{doing} returned {_short(actions)}, which is not numbers")
            return
        channels = core.actions.shape[1]
        if given.shape[1] != channels:
            self._fail(mask, f"{doing} returned {_short(actions)}: expected {channels} numbers, got {given.shape[1]}")
            return
        good = np.isfinite(given).all(axis=1)
        if core.config.action == "discrete":
            good &= np.isin(given, range(len(DISCRETE))).all(axis=1)
        rows = np.flatnonzero(mask)
        core.actions[rows[good]] = given[good]
        for b, action in zip(rows[~good].tolist(), given[~good], strict=True):
            expected = f"a whole number below {len(DISCRETE)}" if core.config.action == "discrete" else "finite numbers"
            self.failures[b] = f"{doing} returned {action.tolist()}: expected {expected}"

    def _fail(self, mask: NDArray[np.bool_], text: str) -> None:
        for b in np.flatnonzero(mask).tolist():
            self.failures[b] = text


def _short(value: Any) -> str:
    text = " ".join(repr(value).split())
    return text if len(text) <= 60 else f"{text[:57]}..."
