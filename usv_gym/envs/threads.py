"""Rows shared out among threads, by a kernel that leaves the interpreter lock alone and shares by itself (tasks/step.py).

A thread that has to be woken comes 20 to 50 microseconds late, as long as the work of dozens of worlds.  So helpers stay in the
kernel for a moment after their work is done, and are there when the next step comes at once; else they sleep until called.
"""

from __future__ import annotations

import os
import threading
from collections.abc import Callable
from queue import SimpleQueue
from typing import Any

import numpy as np

from ..tasks.share import CONTROLS, HELP, LEAD, STOP, TAKEN, UNFINISHED

_NEVER = np.iinfo(np.int64).max // 2


class _Helper:
    """One thread, asleep until it is called."""

    def __init__(self, name: str) -> None:
        self.calls: SimpleQueue[tuple[Callable[..., int], tuple[Any, ...]] | None] = SimpleQueue()
        self.asleep = threading.Event()
        self.asleep.set()
        threading.Thread(target=self._live, name=name, daemon=True).start()

    def call(self, kernel: Callable[..., int], arguments: tuple[Any, ...]) -> None:
        """Wake it, if it sleeps; one that is about to fall asleep comes next time."""
        if self.asleep.is_set():
            self.asleep.clear()
            self.calls.put((kernel, arguments))

    def _live(self) -> None:
        while (call := self.calls.get()) is not None:
            kernel, arguments = call
            kernel(*arguments)
            del call, kernel, arguments
            self.asleep.set()


class Crew:
    """``size`` threads, the calling one among them.

    The others are made at first use in a process, so that a crew can be pickled, and lives on after a fork.
    """

    def __init__(self, size: int) -> None:
        self._forget()
        if not isinstance(size, int) or size < 1:
            raise ValueError(f"num_threads: expected a whole number of at least 1, got {size!r}")
        self.size = size

    def _forget(self) -> None:
        self._helpers: list[_Helper] = []
        self._process = 0
        self._arguments: tuple[Any, ...] = ()
        self._control = np.zeros(CONTROLS, np.int64)

    def run(self, kernel: Callable[..., int], *arguments: Any) -> int:
        """``kernel(control, LEAD, *arguments)``, while the others call it with HELP and the same arguments."""
        if self._process != os.getpid():
            self._forget()
            self._process = os.getpid()
            self._helpers = [_Helper(f"usv_gym-{k + 1}") for k in range(self.size - 1)]
        if len(arguments) != len(self._arguments) or any(a is not b for a, b in zip(arguments, self._arguments, strict=True)):
            self._control[STOP] = 1  # helpers who still wait for more of the old work
            self._control = np.zeros(CONTROLS, np.int64)
            self._control[TAKEN] = _NEVER
            self._arguments = arguments
        for helper in self._helpers:
            helper.call(kernel, (self._control, HELP, *arguments))
        result = kernel(self._control, LEAD, *arguments)
        if result == UNFINISHED:
            for helper in self._helpers:
                helper.asleep.wait()
            return -1
        return result

    def close(self) -> None:
        """Let the threads go; the next use makes new ones."""
        self._control[STOP] = 1
        if self._process == os.getpid():
            for helper in self._helpers:
                helper.calls.put(None)
        self._forget()

    def __getstate__(self) -> dict[str, Any]:
        return {"size": self.size}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self._forget()
        self.size = state["size"]

    def __del__(self) -> None:
        self.close()
