"""Rows shared out among threads, for kernels that leave the interpreter lock alone."""

from __future__ import annotations

import os
from collections import deque
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor

#: chunks of rows per thread: enough that a thread which the machine holds up costs little
_CHUNKS = 4


class Crew:
    """``size`` threads, the calling one among them.

    The others are made at first use in a process, so that a crew can be pickled, and lives on after a fork.
    """

    def __init__(self, size: int) -> None:
        if not isinstance(size, int) or size < 1:
            raise ValueError(f"num_threads: expected a whole number of at least 1, got {size!r}")
        self.size = size
        self._pool: ThreadPoolExecutor | None = None
        self._process = 0

    def share(self, rows: int, unit: int, work: Callable[[slice], object]) -> None:
        """Call ``work`` on slices that cover ``range(rows)``, all but the last a multiple of ``unit`` rows.

        Each thread takes the next slice when it is done with its last.
        """
        chunk = -(-rows // (_CHUNKS * self.size * unit)) * unit
        left = deque(slice(low, min(low + chunk, rows)) for low in range(0, rows, chunk))

        def labour() -> None:
            while True:
                try:
                    part = left.popleft()  # atomic
                except IndexError:
                    return
                work(part)

        helpers = [self._helpers().submit(labour) for _ in range(min(self.size, len(left)) - 1)]
        try:
            labour()
        finally:
            for helper in helpers:
                if not helper.cancel():  # one that never came to work is not waited for
                    helper.result()

    def close(self) -> None:
        """Let the threads go; the next use makes new ones."""
        if self._pool is not None and self._process == os.getpid():
            self._pool.shutdown()
        self._pool = None

    def _helpers(self) -> ThreadPoolExecutor:
        if self._pool is None or self._process != os.getpid():
            self._pool = ThreadPoolExecutor(self.size - 1, thread_name_prefix="usv_gym")
            self._process = os.getpid()
        return self._pool

    def __getstate__(self) -> dict[str, object]:
        return {"size": self.size, "_pool": None, "_process": 0}
