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

    SIGMA = 0.2  # weight of the integral, as a share of the cruising speed; 0.25 is critically damped

    def reset(self, info: dict[str, Any]) -> None:
        """Start the integral at zero."""
        super().reset(info)
        self.integral = 0.0
        self.cruise = self.scales["cruise_speed"]
        self.sigma = self.SIGMA * self.cruise
        self.lookahead = 4.0 * self.scales["length"] + 3.0 * self.cruise

    def course(self, picture: Picture) -> float:
        """Turn [rad] that brings the bow on to the line-of-sight course."""
        y = picture.cross_track + self.sigma * self.integral
        self.integral += self.dt * self.lookahead * picture.cross_track / (self.lookahead**2 + y * y)
        return picture.leg_course - math.atan2(y, self.lookahead)

    def act(self, observation: dict[str, NDArray[Any]]) -> NDArray[np.float32]:
        """Follow the line of sight at cruising speed."""
        return self.command(self.course(Picture(observation, self.scales)), self.cruise)


class Avoid(Waypoints):
    """The waypoint follower, made to go around what the TDM reports: one honest reactive baseline.

    Every step it tries headings to either side of the line-of-sight course, each at full, half and no cruising speed.  It
    predicts its own path (a turn at ``TURN_RATE``, then straight) and straight lines for all targets, and takes the cheapest:
    deviation, with port dearer than starboard, more so near moving targets, and a steep price for coming closer to a target,
    soonest first, than a margin beyond its radius and its uncertainty.
    """

    TURN_RATE = 0.1  # [rad/s] assumed of its own turns
    SPEED_TIME = 8.0  # [s] assumed time constant of its own speed
    TIMES = np.arange(3.0, 61.0, 3.0)  # [s] of the prediction
    OFFSETS = np.radians(np.arange(-120.0, 121.0, 15.0))
    SHARES = np.array([1.0, 0.5, 0.0])  # of the cruising speed
    NEAR, MOVING = 600.0, 1.0  # [m], [m/s]: what makes a target one to give way to starboard for

    def reset(self, info: dict[str, Any]) -> None:
        """Forget the last course."""
        super().reset(info)
        self.margin = 10.0 + self.scales["length"]
        self.last = 0.0  # heading asked for last, off the course of the leg
        self.offset, self.share = (grid.ravel() for grid in np.meshgrid(self.OFFSETS, self.SHARES, indexing="ij"))

    def paths(self, turn: NDArray[np.float64], picture: Picture) -> NDArray[np.float64]:
        """Own positions [c, T, 2] {b} at ``TIMES``, for every turn [c] [rad] with the speed of ``self.share`` [c]."""
        limit = self.TURN_RATE * self.TIMES
        heading = np.clip(turn[:, None], -limit, limit)
        change = self.cruise * self.share[:, None] - picture.speed
        speed = picture.speed + change * -np.expm1(-self.TIMES / self.SPEED_TIME)
        step = self.TIMES[1] - self.TIMES[0]
        return np.cumsum(step * speed[..., None] * np.stack([np.cos(heading), np.sin(heading)], axis=-1), axis=1)

    def danger(self, own: NDArray[np.float64], picture: Picture) -> NDArray[np.float64]:
        """How much own positions [c, T, 2] lack of the margin to the worst target, discounted in time; [c], 0 is clear."""
        target = picture.position[:, None] + picture.target_velocity[:, None] * self.TIMES[:, None]  # [n, T, 2]
        apart = own[:, None] - target[None]  # [c, n, T, 2]
        size = (picture.radius + picture.spread + 0.5 * self.scales["length"])[:, None]
        gap = np.sqrt(np.einsum("cntk,cntk->cnt", apart, apart)) - size
        lack = np.clip(1.0 - gap / self.margin, 0.0, 2.0)
        worst: NDArray[np.float64] = (lack**2 * np.exp(-self.TIMES / 30.0)).max(axis=(1, 2))
        return worst

    def act(self, observation: dict[str, NDArray[Any]]) -> NDArray[np.float32]:
        """Take the cheapest of the courses and speeds that were tried."""
        picture = Picture(observation, self.scales)
        integral = self.integral
        wanted = self.course(picture)
        if not len(picture.position):
            self.last = wanted - picture.leg_course
            return self.command(wanted, self.cruise)
        moving = np.hypot(*picture.target_velocity.T) > self.MOVING
        meeting = bool((moving & (np.hypot(*picture.position.T) < self.NEAR)).any())
        turn = (wanted + self.offset + math.pi) % (2.0 * math.pi) - math.pi
        heading = wanted - picture.leg_course + self.offset
        price = (
            30.0 * self.danger(self.paths(turn, picture), picture)
            + np.abs(self.offset)
            + (0.6 if meeting else 0.2) * (self.offset < 0.0)
            + 1.5 * (1.0 - self.share)
            + 0.5 * np.abs(heading - self.last)
        )
        best = int(np.argmin(price))
        self.last = float(heading[best])
        if self.offset[best] != 0.0:
            self.integral = integral  # off the track on purpose
        return self.command(float(turn[best]), float(self.cruise * self.share[best]))
