"""Where commands arrive: from any thread, in any number; read by the one thread that owns the world."""

from __future__ import annotations

import heapq
import threading
import time
from collections import Counter, deque
from typing import Any

from .profile import Row

QUEUE = 64  #: messages of one row that wait for a lock-step
ORDERS = 256  #: orders that wait


class Mailbox:
    """Latest values of each command row with their age, queues for lock-step, and orders to the simulation."""

    def __init__(self) -> None:
        """Empty."""
        self._news = threading.Condition()
        self._queues: dict[int, deque[dict[str, Any]]] = {}
        self._orders: deque[dict[str, Any]] = deque()
        self._pose: dict[str, Any] | None = None
        self._late: list[tuple[int, int, str, int, dict[str, Any]]] = []  # due [us], number, kind, row, values
        self._matured: list[dict[str, Any]] = []  # commands whose delay is over
        self._number = 0
        self.now_us = 0  #: simulated time [us]; the owner of the world keeps it
        self.counters: Counter[str] = Counter()

    def put(self, kind: str, row: int, values: dict[str, Any], due_us: int = 0) -> None:
        """Take a message in; one with a delay takes effect at ``due_us`` of simulated time.

        A lock-step that waits for this row goes on at once: simulated time stands while it waits.
        """
        with self._news:
            if due_us > self.now_us:
                if len(self._late) >= ORDERS * 16:
                    self.counters["flood"] += 1
                    return
                self._number += 1
                heapq.heappush(self._late, (due_us, self._number, kind, row, values))
                if kind not in ("order", "own_pose"):
                    self._deliver(kind, row, {})
            else:
                self._deliver(kind, row, values)
            self._news.notify_all()

    def _deliver(self, kind: str, row: int, values: dict[str, Any]) -> None:
        if kind == "order":
            if len(self._orders) >= ORDERS:
                self.counters["flood"] += 1
            else:
                self._orders.append(values)
        elif kind == "own_pose":
            self._pose = {**(self._pose or {}), **values}  # position and heading may come apart
        else:
            queue = self._queues.setdefault(row, deque())
            if len(queue) >= QUEUE:
                queue.popleft()
                self.counters["superseded"] += 1
            queue.append(values)

    def advance(self, now_us: int) -> None:
        """Tell what time it is: what was delayed until now arrives."""
        with self._news:
            self.now_us = now_us
            while self._late and self._late[0][0] <= now_us:
                _, _, kind, row, values = heapq.heappop(self._late)
                if kind in ("order", "own_pose"):
                    self._deliver(kind, row, values)
                else:
                    self._matured.append(values)

    def clear(self) -> None:
        """Throw away commands that nobody waited for (lock-step: answers to an earlier step)."""
        with self._news:
            surplus = sum(map(len, self._queues.values()))
            if surplus:
                self.counters["superseded"] += surplus
            self._queues.clear()

    def forget(self) -> None:
        """Throw away everything: a new episode begins."""
        with self._news:
            self._queues.clear()
            self._late.clear()
            self._matured.clear()
            self._pose = None
            self.now_us = 0

    def latest(self) -> list[dict[str, Any]]:
        """The newest values of each row that came since the last call; delayed ones first."""
        with self._news:
            found = [queue[-1] for queue in self._queues.values() if queue]
            self.counters["superseded"] += sum(max(len(queue) - 1, 0) for queue in self._queues.values())
            self._queues.clear()
            return self._with_matured(found)

    def _with_matured(self, found: list[dict[str, Any]]) -> list[dict[str, Any]]:
        matured, self._matured = self._matured, []
        return [*matured, *(values for values in found if values)]

    def wait(self, rows: set[int], patience: float) -> list[dict[str, Any]] | None:
        """The next message of each of ``rows``, and of others that are there; None after ``patience`` [s]."""
        until = time.monotonic() + patience
        with self._news:
            while not all(self._queues.get(row) for row in rows):
                left = until - time.monotonic()
                if left <= 0.0:
                    return None
                self._news.wait(left)
            return self._with_matured([queue.popleft() for queue in self._queues.values() if queue])

    def orders(self, patience: float = 0.0) -> list[dict[str, Any]]:
        """Orders that came, oldest first; waits for one if none is there."""
        with self._news:
            if not self._orders and patience > 0.0:
                self._news.wait(patience)
            taken, self._orders = list(self._orders), deque()
            return taken

    def pose(self) -> dict[str, Any] | None:
        """The own ship's pose if a new one came."""
        with self._news:
            pose, self._pose = self._pose, None
            return pose

    def wake(self) -> None:
        """Let whoever waits look again."""
        with self._news:
            self._news.notify_all()


def command_rows(rows: list[Row], control: str) -> set[int]:
    """Indices of the rows that a lock-step waits for."""
    return {k for k, row in enumerate(rows) if row.command == control and row.required}
