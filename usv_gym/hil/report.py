"""How a run of the bridge went."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np


@dataclass
class Report:
    """How a run went."""

    steps: int
    simulated: float  # [s]
    covered: float  # of that between the starts of the first and of the last step, without pauses [s]
    elapsed: float  # the real time that this took [s]
    lateness: np.ndarray[Any, Any]  # [s] of the last steps
    overruns: int  # steps that began more than a step late
    slips: int  # times the schedule began anew
    failsafes: int
    sent: dict[str, int]
    received: dict[str, int]
    rejected: dict[str, int]
    round_trips: np.ndarray[Any, Any]  # of lock-step [s]

    @property
    def factor(self) -> float:
        """Simulated seconds per second."""
        return self.covered / self.elapsed if self.elapsed > 0.0 else math.nan

    def lines(self) -> list[str]:
        """The report as text."""
        pace = f"{self.elapsed:.3f} s: {self.factor:.5f} times real time"
        text = [f"{self.steps} steps, {self.simulated:.2f} s simulated in {pace}"]
        for name, values in (("lateness", self.lateness), ("round trip", self.round_trips)):
            if len(values):
                p50, p95, p99, top = (1e3 * float(np.percentile(values, q)) for q in (50, 95, 99, 100))
                text.append(f"{name} [ms]: median {p50:.3f}  95 % {p95:.3f}  99 % {p99:.3f}  worst {top:.3f}")
        if self.overruns or self.slips or self.failsafes:
            text.append(f"overruns {self.overruns}, schedule begun anew {self.slips}, fail-safe {self.failsafes} times")
        tables = (("sent", self.sent), ("received", self.received), ("refused", self.rejected))
        for name, table in tables:
            if table:
                text.append(f"{name}: " + "  ".join(f"{key} {n}" for key, n in sorted(table.items())))
        return text
