"""The built-in baselines: ``idle``, ``waypoints`` and ``avoid``."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .base import Picture, Piloted


class Idle:
    """Asks for nothing: no thrust."""

    action = "default"
    observation = "tracks"
    flat = True

    def reset(self, info: dict[str, Any]) -> None:
        """Remember how long an action is."""
        self.zero = np.zeros(int(info["scales"]["channels"]), np.float32)

    def act(self, observation: Any) -> NDArray[np.float32]:
        """Zero demand."""
        return self.zero


class Waypoints(Piloted):
    """Line-of-sight guidance with integral action along the route; sees no traffic.

    ILOS of Boerhaug, Pavlov and Pettersen (CDC 2008): heading = leg course - atan((y + sigma y_int) / lookahead), with y the
    cross-track error and y_int' = lookahead y / (lookahead^2 + (y + sigma y_int)^2).
    """

    SIGMA = 0.3  # [m/s] weight of the integral

    def reset(self, info: dict[str, Any]) -> None:
        """Start the integral at zero."""
        super().reset(info)
        self.integral = 0.0
        self.cruise = self.scales["cruise_speed"]
        self.lookahead = 4.0 * self.scales["length"] + 3.0 * self.cruise

    def course(self, picture: Picture) -> float:
        """Turn [rad] that brings the bow on to the line-of-sight course."""
        y = picture.cross_track + self.SIGMA * self.integral
        self.integral += self.dt * self.lookahead * picture.cross_track / (self.lookahead**2 + y * y)
        return picture.leg_course - math.atan2(y, self.lookahead)

    def act(self, observation: dict[str, NDArray[Any]]) -> NDArray[np.float32]:
        """Follow the line of sight at cruising speed."""
        return self.command(self.course(Picture(observation, self.scales)), self.cruise)


class Avoid(Waypoints):
    """The waypoint follower, made to go around what the TDM reports: one honest reactive baseline.

    Every step it tries headings up to 100 deg to either side of the line-of-sight course, at cruising and at reduced speed,
    predicts straight lines for all targets (closest point of approach), and takes the cheapest: deviation, with port dearer
    than starboard, plus a steep price for passing any target closer than its radius, its uncertainty and a margin.
    """

    HORIZON = 90.0  # [s] approaches further in the future do not count yet
    OFFSETS = np.radians(np.arange(-100.0, 101.0, 10.0))
    SPEEDS = np.array([1.0, 0.5])  # shares of the cruising speed

    def reset(self, info: dict[str, Any]) -> None:
        """Forget the last course."""
        super().reset(info)
        self.margin = 25.0 + 2.0 * self.scales["length"]
        self.last = 0.0

    def act(self, observation: dict[str, NDArray[Any]]) -> NDArray[np.float32]:
        """Take the cheapest of the courses and speeds that were tried."""
        picture = Picture(observation, self.scales)
        wanted = self.course(picture)
        if not len(picture.position):
            self.last = 0.0
            return self.command(wanted, self.cruise)
        offset, share = (grid.ravel() for grid in np.meshgrid(self.OFFSETS, self.SPEEDS, indexing="ij"))
        heading = wanted + offset
        velocity = self.cruise * share[:, None] * np.stack([np.cos(heading), np.sin(heading)], axis=1)  # [c, 2] {b}
        relative = picture.target_velocity[None] - velocity[:, None]  # [c, n, 2]
        position = picture.position[None]
        closing = np.einsum("cnk,cnk->cn", np.broadcast_to(position, relative.shape), relative)
        tcpa = np.clip(-closing / np.maximum((relative**2).sum(-1), 1e-9), 0.0, self.HORIZON)
        passing = np.linalg.norm(position + relative * tcpa[..., None], axis=-1) - picture.radius - picture.spread
        lack = np.clip(1.0 - passing / self.margin, 0.0, 2.0)
        urgency = 1.0 / (1.0 + tcpa / 20.0)
        price = (
            (lack**2 * (0.4 + urgency)).max(axis=1) * 30.0
            + np.abs(offset)
            + 0.2 * (offset < 0.0)
            + 1.2 * (1.0 - share)
            + 0.3 * np.abs(offset - self.last)
        )
        best = int(np.argmin(price))
        self.last = float(offset[best])
        return self.command(float(heading[best]), float(self.cruise * share[best]))
