"""What was: the true motion of B episodes, as the judge needs it.

Row b is one episode; its first ``steps[b]`` samples along T are valid.  SI and radians, {n}.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from ..world.state import KIND_ISLET

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]
Ints = NDArray[np.int64]


@dataclass(eq=False)
class Trajectory:
    """Truth of B episodes of V vessel slots: T samples, one at the start and one after every control step."""

    steps: Ints  # [B] valid samples of the row
    t: Floats  # [B, T] s since the start
    eta: Floats  # [B, T, V, 3] N, E [m], psi [rad] {n}
    velocity: Floats  # [B, T, V, 2] N, E over ground [m/s] {n}
    active: Bools  # [B, T, V]
    tracked: Bools  # [B, T, V] the own ship's picture holds this vessel
    obstacle: Floats  # [B, T] hull of the own ship to the nearest obstacle [m]; inf without any
    demand: Floats  # [B, T, 2] surge and yaw asked of the thrusters, each in [-1, 1]; NaN where there are none
    length: Floats  # [B, V] m
    beam: Floats  # [B, V] m
    own: Ints  # [B] vessel slot of the own ship
    closest: Floats  # [B, V] smallest hull distance, between samples too [m]; inf where not swept
    closest_obstacle: Floats  # [B] the same to the obstacles
    touched: Ints  # [B] source that was touched first: vessel slot, or V + obstacle slot; -1: none
    aground: Bools  # [B] what was touched is land
    arrived: Bools  # [B] the route is done
    route: Floats  # [B] length of the route [m]; 0 without one
    speed: Floats  # [B] speed at which the route is meant to be sailed [m/s]; 0 unknown

    @property
    def vessels(self) -> int:
        """V."""
        return int(self.eta.shape[2])

    def __len__(self) -> int:
        return len(self.steps)

    def rows(self, which: Sequence[int] | Ints | Bools | slice) -> Self:
        """The episodes of some rows (views where NumPy gives views)."""
        return type(self)(**{f.name: getattr(self, f.name)[which] for f in fields(self)})

    @classmethod
    def empty(cls, B: int, T: int, V: int) -> Self:
        """Room for B episodes of T samples, none of them taken."""
        return cls(
            steps=np.zeros(B, np.int64), t=np.zeros((B, T)), eta=np.zeros((B, T, V, 3)), velocity=np.zeros((B, T, V, 2)),
            active=np.zeros((B, T, V), np.bool_), tracked=np.zeros((B, T, V), np.bool_),
            obstacle=np.full((B, T), np.inf), demand=np.full((B, T, 2), np.nan),
            length=np.zeros((B, V)), beam=np.zeros((B, V)), own=np.zeros(B, np.int64), closest=np.full((B, V), np.inf),
            closest_obstacle=np.full(B, np.inf), touched=np.full(B, -1), aground=np.zeros(B, np.bool_),
            arrived=np.zeros(B, np.bool_), route=np.zeros(B), speed=np.zeros(B),
        )  # fmt: skip

    @classmethod
    def from_tracks(cls, t: Floats, eta: Floats, length: Floats, beam: Floats, own: int = 0) -> Self:
        """One episode (B = 1) from positions alone, for recordings: velocities are differences.

        Parameters
        ----------
        t
            [T] s, increasing.
        eta
            [T, V, 3] N, E [m], psi [rad] {n}; NaN where a vessel is not there.
        length, beam
            [V] m.
        own
            vessel slot of the own ship.
        """
        T, V = eta.shape[:2]
        one = cls.empty(1, T, V)
        one.steps[0], one.own[0] = T, own
        one.t[0], one.length[0], one.beam[0] = t, length, beam
        one.active[0] = np.isfinite(eta).all(-1)
        one.eta[0] = np.nan_to_num(eta)
        one.velocity[0] = np.nan_to_num(np.gradient(eta[:, :, :2], t, axis=0))
        return one


class TrajectoryRecorder:
    """Takes samples of the rows of a batch, each row at its own pace.

    Parameters
    ----------
    worlds
        [B] records.
    samples
        most samples of an episode: control steps + 1.
    cruise_speed
        [m/s] at which the route is meant to be sailed.
    """

    def __init__(self, worlds: NDArray[Any], samples: int, cruise_speed: float) -> None:
        self._worlds = worlds
        B, V = worlds["vessels"]["active"].shape
        self.trajectory = Trajectory.empty(B, samples, V)
        self.trajectory.speed[:] = cruise_speed

    def begin(self, mask: Bools | None = None) -> None:
        """Forget the episodes of the rows of ``mask`` [B] (all) and sample their start."""
        x, w = self.trajectory, self._worlds
        rows = np.arange(len(x)) if mask is None else np.flatnonzero(mask)
        x.steps[rows] = 0
        x.own[rows] = w["observer"][rows, 0]
        x.length[rows], x.beam[rows] = w["vessels"]["length"][rows], w["vessels"]["beam"][rows]
        for b in rows.tolist():
            own = x.own[b]
            waypoints = w["routes"]["waypoint"][b, own, : max(int(w["routes"]["count"][b, own]), 1)]
            x.route[b] = np.hypot(*np.diff(waypoints, axis=0).T).sum()
        self.sample(mask)

    def sample(self, mask: Bools | None = None) -> None:
        """Take a sample of the rows of ``mask`` [B] (all)."""
        x, w = self.trajectory, self._worlds
        rows = np.arange(len(x)) if mask is None else np.flatnonzero(mask)
        at, own = (rows, x.steps[rows]), x.own[rows]
        vessels, V = w["vessels"], x.vessels
        x.t[at] = w["tick"][rows] * w["dt"][rows]
        x.eta[at] = vessels["eta"][rows]
        x.velocity[at] = vessels["velocity"][rows]
        x.active[at] = vessels["active"][rows] != 0
        x.tracked[at] = w["picture"]["id"][rows, 0, :V] != 0
        there = w["obstacles"]["active"][rows] != 0
        x.obstacle[at] = np.where(there, w["safety"]["distance"][rows, 0, V:], np.inf).min(axis=1, initial=np.inf)
        x.demand[at] = demand(w["plants"], rows, vessels["plant"][rows, own])
        swept = w["safety"]["closest"][rows, 0]
        x.closest[rows], x.closest_obstacle[rows] = swept[:, :V], swept[:, V:].min(axis=1, initial=np.inf)
        touched = w["safety"]["collided_with"][rows, 0]
        x.touched[rows] = touched
        x.aground[rows] = (touched >= V) & (w["obstacles"]["kind"][rows, np.maximum(touched - V, 0)] == KIND_ISLET)
        x.arrived[rows] = w["routes"]["done"][rows, own] != 0
        x.steps[rows] += 1


def demand(plants: NDArray[Any], rows: Ints, plant: NDArray[Any]) -> Floats:
    """Surge and yaw demands [n, 2] in [-1, 1] that the commands of plants [n] amount to; NaN where there is no plant."""
    at = (rows, np.maximum(plant, 0))
    command, surge, yaw, nozzle = (plants[name][at] for name in ("command", "mix_surge", "mix_yaw", "mix_nozzle"))
    rpm = command[..., 0] * np.where(plants["reverse_by_bucket"][at][:, None] != 0, command[..., 2], 1.0)
    weight = np.maximum((surge**2).sum(1), 1e-9), np.maximum((yaw**2 + nozzle**2).sum(1), 1e-9)
    out = np.stack([(surge * rpm).sum(1) / weight[0],
                    (yaw * command[..., 0] + nozzle * command[..., 1]).sum(1) / weight[1]], axis=1)  # fmt: skip
    return np.where(plant[:, None] >= 0, np.clip(out, -1.0, 1.0), np.nan)
