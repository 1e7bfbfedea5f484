"""Flights in worker processes: as many at a time as there are workers, each result as it comes.

A worker that dies, or is ended by the watchdog because a controller hangs, costs the one episode that it was at; another
takes its place and the rest of the flight.  Results do not depend on who flew what: row b of any batch equals a batch of one.
"""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import signal
import sys
import tempfile
from collections import deque
from collections.abc import Iterable, Iterator
from dataclasses import replace
from multiprocessing.connection import Connection, wait
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from ..jit import compiling, is_warm
from .controllers import last_words
from .flight import FAILED, Flight, Result, Yard, batched, scenario_of

BATCH = 64  #: seeds of one flight at most; more gain nothing
CROWDED = 20  #: ships; with more, a trajectory of a full batch would fill the memory


def flights(flight: Flight, *, most: int = BATCH) -> Iterator[Flight]:
    """Cut a flight into pieces that are worth handing to a worker: batches, or for one's own controllers a few seeds."""
    crowded = len(scenario_of(flight.case, flight.vessel).ships) > CROWDED
    size = min(most, 8) if crowded or not batched(flight.policy) else most
    for start in range(0, len(flight.seeds), size):
        yield replace(flight, seeds=flight.seeds[start : start + size])


def _work(connection: Connection, traces: str) -> None:
    """A worker: receive flights, send results one by one and None after the last."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent ends its workers itself
    yard = Yard(Path(traces))
    try:
        while (flight := connection.recv()) is not None:
            pieces = [flight] if batched(flight.policy) else [replace(flight, seeds=(seed,)) for seed in flight.seeds]
            for piece in pieces:
                for result in yard.fly(piece):
                    connection.send(result)
            connection.send(None)
    except (EOFError, BrokenPipeError, ConnectionResetError):
        pass  # nobody is listening any more
    sys.stdout.flush()


class _Worker:
    def __init__(self, context: Any, traces: Path) -> None:
        self.traces = traces
        self.connection, other = context.Pipe()
        self.process = context.Process(target=_work, args=(other, str(traces)), daemon=True)
        self.process.start()
        other.close()
        self.flight: Flight | None = None
        self.done: set[int] = set()

    def give(self, flight: Flight) -> None:
        self.flight, self.done = flight, set()
        with contextlib.suppress(BrokenPipeError):  # it has died: that shows when its answer is read
            self.connection.send(flight)

    def end(self) -> None:
        self.connection.close()
        if self.process.is_alive():
            self.process.kill()
        self.process.join()


class Fleet:
    """Worker processes that fly; use it as a context.

    Parameters
    ----------
    workers
        how many; None: as many as there are processors.  0: fly in this process, without a time limit for controllers.
    """

    def __init__(self, workers: int | None = None) -> None:
        self.size = (os.cpu_count() or 1) if workers is None else workers
        self._context = multiprocessing.get_context("spawn")
        self._workers: list[_Worker] = []
        self._yard = Yard()

    def __enter__(self) -> Self:
        self._directory = tempfile.TemporaryDirectory(prefix="usv-gym-")
        self._count = 0
        return self

    def __exit__(self, kind: type[BaseException] | None, value: BaseException | None, trace: TracebackType | None) -> None:
        for worker in self._workers:
            worker.end()
        self._workers.clear()
        self._directory.cleanup()

    def _hire(self) -> _Worker:
        self._count += 1
        worker = _Worker(self._context, Path(self._directory.name) / f"worker-{self._count}")
        self._workers.append(worker)
        return worker

    def fly(self, waiting: Iterable[Flight]) -> Iterator[Result]:
        """Results of all flights, in the order in which they come."""
        queue = deque(waiting)
        if self.size == 0:
            while queue:
                flight = queue.popleft()
                for piece in [flight] if batched(flight.policy) else [replace(flight, seeds=(s,)) for s in flight.seeds]:
                    yield from self._yard.fly(piece)
            return
        if queue and not is_warm():
            with compiling():  # once, and not in every worker
                for flight in {flight.policy: flight for flight in queue if batched(flight.policy)}.values():
                    next(self._yard.fly(replace(flight, seeds=(0,))))
        while len(self._workers) < min(self.size, len(queue)):
            self._hire()
        while True:
            for worker in [*self._workers]:
                if worker.flight is None and queue:
                    if not worker.process.is_alive():
                        worker.end()
                        self._workers.remove(worker)
                        worker = self._hire()
                    worker.give(queue.popleft())
            busy = {worker.connection: worker for worker in self._workers if worker.flight is not None}
            if not busy:
                return
            for connection in wait(list(busy)):
                worker = busy[connection]
                try:
                    result = worker.connection.recv()
                except (EOFError, ConnectionResetError):
                    yield from self._bury(worker, queue)
                    continue
                if result is None:
                    worker.flight = None
                else:
                    worker.done.add(result.seed)
                    yield result

    def _bury(self, worker: _Worker, queue: deque[Flight]) -> Iterator[Result]:
        """A worker has died: blame the episode that it was at, queue the rest again, and hire another."""
        flight = worker.flight
        assert flight is not None
        worker.process.join()
        self._workers.remove(worker)
        left = [seed for seed in flight.seeds if seed not in worker.done]
        said = last_words(worker.traces)
        worker.end()
        if batched(flight.policy) and len(left) > 1:  # one of these; alone, each has its own worker to bring down
            queue.extendleft(replace(flight, seeds=(seed,)) for seed in reversed(left))
        elif left:
            code = worker.process.exitcode
            how = f"signal {signal.Signals(-code).name}" if code is not None and code < 0 else f"exit code {code}"
            yield Result(flight.policy, flight.case.id, left[0], FAILED, said or f"the process of the controller ended: {how}")
            if left[1:]:
                queue.appendleft(replace(flight, seeds=tuple(left[1:])))
        self._hire()
