"""What was: the true motion of B episodes, as the judge needs it.

Row b is one episode; its first ``steps[b]`` samples along T are valid.  SI and radians, {n}.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from .sample import take_sample

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
    obstacle: Floats  # [B, T] hull of the own ship to the nearest obstacle or land [m]; inf without any
    demand: Floats  # [B, T, 2] surge and yaw asked of the thrusters, each in [-1, 1]; NaN where there are none
    length: Floats  # [B, V] m
    beam: Floats  # [B, V] m
    own: Ints  # [B] vessel slot of the own ship
    closest: Floats  # [B, V] smallest hull distance, between samples too [m]; inf where not swept
    closest_obstacle: Floats  # [B] the same to obstacles and land
    touched: Ints  # [B] source that was touched first: vessel slot, or V + obstacle slot; -1: none
    aground: Bools  # [B] land, or an islet, was touched
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
        x = self.trajectory
        take_sample(
            self._worlds, np.ones(len(x), np.bool_) if mask is None else mask, x.steps, x.own, x.t, x.eta, x.velocity, x.active,
            x.tracked, x.obstacle, x.demand, x.closest, x.closest_obstacle, x.touched, x.aground, x.arrived,
        )  # fmt: skip
