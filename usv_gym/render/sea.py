"""What is on the sea at one instant: the common ground of live frames (world records) and recorded episodes."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..world import state
from .primitives import Points

DESCRIPTORS = {state.DESCRIPTOR_FIXED: "fixed", state.DESCRIPTOR_VESSEL: "vessel", state.DESCRIPTOR_LAND: "land"}
HULLS = {
    state.KIND_SHIP: "ship",
    state.KIND_VESSEL: "vessel",
    state.KIND_BOAT: "boat",
    state.KIND_USV: "usv",
}
OBSTACLES = {
    state.KIND_ICEBERG: "iceberg",
    state.KIND_BUOY: "buoy",
    state.KIND_ISLET: "islet",
    state.KIND_LIGHTHOUSE: "lighthouse",
    state.KIND_PLATFORM: "platform",
}


@dataclass(frozen=True)
class Detection:
    """One detected target, as the TDM reports it; SI and radians, {n}."""

    source: int  # what it is in truth: index of a vessel, or V + index of an obstacle; -1 unknown
    id: int
    descriptor: int
    position: tuple[float, float]
    cog: float = math.nan
    sog: float = math.nan
    radius: float = math.nan
    covariance: tuple[float, float, float] = (math.nan, math.nan, math.nan)  # NN, NE, EE [m2]
    sensors: int = 0  # bit 0 AIS, 1 radar, 2 LiDAR
    motion_known: bool = False

    @property
    def is_vessel(self) -> bool:
        """Whether the TDM takes it for a vessel."""
        return self.descriptor == state.DESCRIPTOR_VESSEL

    @property
    def sensor_letters(self) -> str:
        """Letters of the sensors that see it: A, R, L."""
        return "".join(letter for bit, letter in enumerate("ARL") if self.sensors >> bit & 1)


@dataclass(frozen=True)
class AisReport:
    """Last position report of a source: place [m] {n} and heading or course [rad]."""

    source: int
    position: tuple[float, float]
    heading: float


@dataclass(frozen=True)
class Sea:
    """Everything a map shows of one instant.  V vessels, M obstacles, S = V + M sources; own ship is vessel ``own``."""

    t: float
    own: int
    names: Sequence[str]  # [S]
    kind: NDArray[Any]  # [S] codes of world/state.py
    active: NDArray[np.bool_]  # [S]
    eta: Points  # [V, 3]
    velocity: Points  # [V, 2] over ground {n}
    rot: Points  # [V] rad/s
    length: Points  # [V]
    beam: Points  # [V]
    position: Points  # [M, 2]
    radius: Points  # [M]
    distance: Points  # [S] hull to hull from the own ship, NaN or inf where meaningless
    detections: Sequence[Detection] = ()
    ais: Sequence[AisReport] = ()
    route: Points = field(default_factory=lambda: np.zeros((0, 2)))
    acceptance: float = 0.0  # [m]
    radar_range: float = 0.0  # [m], 0: no such sensor
    lidar_range: float = 0.0
    land: Sequence[Sequence[Points]] = ()  # of each polygon the shell [n, 2] and its holes
    echoes: Points = field(default_factory=lambda: np.zeros((0, 2)))  # of land, as radar and LiDAR have them {n} [m]
    thrust: tuple[float, ...] = ()  # demand in [-1, 1]: port and starboard, or one for all

    @property
    def vessels(self) -> int:
        """Vessel slots."""
        return len(self.eta)

    @property
    def here(self) -> tuple[float, float]:
        """Where the own ship is."""
        return float(self.eta[self.own, 0]), float(self.eta[self.own, 1])

    def place(self, source: int) -> tuple[float, float]:
        """Where a source truly is."""
        row = self.eta[source] if source < self.vessels else self.position[source - self.vessels]
        return float(row[0]), float(row[1])

    def others(self) -> list[int]:
        """Active sources but for the own ship."""
        return [int(s) for s in np.flatnonzero(self.active) if s != self.own]

    def closest(self) -> tuple[float, int]:
        """Smallest hull distance [m] and to which source; (NaN, -1) when there is nothing."""
        best = [(float(self.distance[s]), s) for s in self.others() if math.isfinite(self.distance[s])]
        return min(best, default=(math.nan, -1))


def sides(demand: Points, y: Points) -> tuple[float, ...]:
    """Mean demand of the thrusters to port and to starboard, given where they sit; one number if a side has none."""
    n = min(len(demand), len(y))
    demand, y = demand[:n], y[:n]
    if n == 0 or not np.isfinite(demand).all():
        return ()
    groups = (demand[y < 0.0], demand[y > 0.0])
    return tuple(float(g.mean()) for g in groups) if all(len(g) for g in groups) else (float(demand[0]),)


@dataclass(frozen=True)
class Trail:
    """Where a vessel has been: times [T] and poses [T, 3]."""

    t: Points
    eta: Points


class History:
    """Rolling memory of one world, for trails and plots of live frames.

    Parameters
    ----------
    seconds
        how far back it reaches.
    every
        [s] of two instants that are closer, only the later one is kept.
    """

    def __init__(self, seconds: float = 120.0, every: float = 0.25) -> None:
        """Empty memory."""
        self.seconds, self.every = seconds, every
        self._rows: deque[tuple[float, Points, Points, NDArray[np.bool_], float]] = deque()

    def push(self, sea: Sea) -> None:
        """Remember an instant; one that is earlier than the last starts a new memory (the world was reset)."""
        if self._rows and sea.t < self._rows[-1][0]:
            self._rows.clear()
        last, before = (self._rows[-k][0] if len(self._rows) >= k else -math.inf for k in (1, 2))
        if sea.t == last or sea.t < before + self.every:
            self._rows.pop()
        active = sea.active[: sea.vessels].copy()
        self._rows.append((sea.t, sea.eta.copy(), sea.velocity.copy(), active, sea.closest()[0]))
        while self._rows and self._rows[0][0] < sea.t - self.seconds:
            self._rows.popleft()

    def trails(self) -> dict[int, Trail]:
        """Trail of every vessel that is active now, over the time it has been active."""
        if len(self._rows) < 2:
            return {}
        t, eta, active = self._column(0), self._column(1), self._column(3) != 0
        return {int(j): Trail(t[active[:, j]], eta[active[:, j], j]) for j in np.flatnonzero(active[-1])}

    def curves(self, own: int) -> tuple[Points, Points, Points, Points]:
        """Times [s], speeds [m/s], headings [rad] and ranges to the closest [m] of the own ship, each [T]."""
        velocity = self._column(2)
        speed = np.hypot(velocity[:, own, 0], velocity[:, own, 1])
        return self._column(0), speed, self._column(1)[:, own, 2], self._column(4)

    def _column(self, i: int) -> Points:
        return np.array([row[i] for row in self._rows], dtype=np.float64)
