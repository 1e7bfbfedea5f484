"""Functions of the same process: for tests, and for controllers in Python that speak a wire format."""

from __future__ import annotations

import copy
from collections.abc import Callable, Mapping, Sequence
from typing import Any, ClassVar

from ..profile import Row
from . import Receive


class Memory:
    """Hands every message to ``listeners``, and takes messages with ``send``."""

    name = "memory"
    max_rate = float("inf")
    OPTIONS: ClassVar[dict[str, str]] = {}

    def __init__(self) -> None:
        """Nobody listens yet."""
        self.listeners: list[Callable[[str, Any], None]] = []
        self._incoming: dict[str, list[Row]] = {}
        self._receive: Receive | None = None

    def open(self, out: Sequence[Row], incoming: Sequence[Row], receive: Receive) -> None:
        """Remember where messages go."""
        self._receive = receive
        self._incoming = {}
        for row in incoming:
            self._incoming.setdefault(row.topic, []).append(row)

    def publish(self, row: Row, message: Any) -> None:
        """Call the listeners, in order."""
        for listener in self.listeners:
            listener(row.topic, copy.deepcopy(message))

    def send(self, topic: str, message: Any) -> None:
        """What a controller says."""
        if self._receive is not None:
            for row in self._incoming.get(topic, ()):
                self._receive(row, copy.deepcopy(message))

    def step(self) -> None:
        """Nothing to flush."""

    def peers(self) -> int:
        """Number of listeners."""
        return len(self.listeners)

    def counters(self) -> Mapping[str, int]:
        """Nothing can go wrong here."""
        return {}

    def close(self) -> None:
        """Forget the receiver."""
        self._receive = None
