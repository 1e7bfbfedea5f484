"""Rows shared out among threads, for kernels that leave the interpreter lock alone."""

from __future__ import annotations

import os
import threading
from collections import deque
from collections.abc import Callable
from queue import SimpleQueue

#: chunks of rows per thread: enough that a thread which the machine holds up costs little
_CHUNKS = 4


class _Job:
    """Slices that are left, who has come to work on them, and what went wrong."""

    def __init__(self, slices: list[slice], work: Callable[[slice], object]) -> None:
        self.left = deque(slices)
        self.work = work
        self.places: deque[None] = deque()  # for helpers who have yet to come
        self.done: SimpleQueue[BaseException | None] = SimpleQueue()

    def labour(self, place: int) -> None:
        """Work until nothing is left: the caller (place 0) from the front, helpers from the back.

        So each thread comes back to nearly the same rows from call to call, which are in its own cache.
        """
        take = self.left.pop if place else self.left.popleft
        while True:
            try:
                part = take()  # atomic
            except IndexError:
                return
            self.work(part)


class Crew:
    """``size`` threads, the calling one among them.

    The others are made at first use in a process, so that a crew can be pickled, and lives on after a fork.
    """

    def __init__(self, size: int) -> None:
        self._calls: list[SimpleQueue[_Job | None]] = []
        self._process = 0
        if not isinstance(size, int) or size < 1:
            raise ValueError(f"num_threads: expected a whole number of at least 1, got {size!r}")
        self.size = size

    def share(self, rows: int, unit: int, work: Callable[[slice], object]) -> None:
        """Call ``work`` on slices that cover ``range(rows)``, all but the last a multiple of ``unit`` rows.

        Each thread takes the next slice when it is done with its last.
        """
        chunk = -(-rows // (_CHUNKS * self.size * unit)) * unit
        job = _Job([slice(low, min(low + chunk, rows)) for low in range(0, rows, chunk)], work)
        helpers = self._helpers()[: len(job.left) - 1]
        job.places.extend([None] * len(helpers))
        for call in helpers:
            call.put(job)
        came = len(helpers)
        try:
            job.labour(0)
        finally:
            while job.places:  # those who have not come are not waited for
                try:
                    job.places.pop()
                    came -= 1
                except IndexError:
                    break
            errors = [job.done.get() for _ in range(came)]
        for error in errors:
            if error is not None:
                raise error

    def close(self) -> None:
        """Let the threads go; the next use makes new ones."""
        if self._process == os.getpid():
            for call in self._calls:
                call.put(None)
        self._calls = []

    def _helpers(self) -> list[SimpleQueue[_Job | None]]:
        if len(self._calls) != self.size - 1 or self._process != os.getpid():
            self._calls = [SimpleQueue() for _ in range(self.size - 1)]
            self._process = os.getpid()
            for k, call in enumerate(self._calls):
                threading.Thread(target=_help, args=(call,), name=f"usv_gym-{k + 1}", daemon=True).start()
        return self._calls

    def __getstate__(self) -> dict[str, object]:
        return {"size": self.size, "_calls": [], "_process": 0}

    def __del__(self) -> None:
        self.close()


def _help(calls: SimpleQueue[_Job | None]) -> None:
    """The life of a helper: come when called, as long as there is a place left in the job."""
    while (job := calls.get()) is not None:
        try:
            job.places.pop()
        except IndexError:
            continue
        error: BaseException | None = None
        try:
            job.labour(1)
        except BaseException as raised:  # handed to the caller
            error = raised
        job.done.put(error)
        del job
