"""Controllers: anything with ``reset(info)`` and ``act(observation) -> action``.

What a controller wants to see and do it says in attributes: ``action``, ``observation`` and ``flat``, or a whole ``task``.
``Picture`` and ``Piloted`` are for writing one in Python; the built-in ones are kernels (policies/pilot.py).
"""

from __future__ import annotations

import math
from typing import Any, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray


@runtime_checkable
class Controller(Protocol):
    """What a campaign, a check or ``usv-gym run`` can drive with."""

    def reset(self, info: dict[str, Any]) -> None:
        """A new episode begins; ``info`` is what ``env.reset`` returned and holds the scales of the observation."""

    def act(self, observation: Any) -> Any:
        """The action for an observation."""


@runtime_checkable
class BatchController(Controller, Protocol):
    """A controller that also decides for many rows of one task at once."""

    def reset_batch(self, num: int, info: dict[str, Any]) -> None:
        """New episodes begin in ``num`` rows."""

    def act_batch(self, observations: Any, mask: NDArray[np.bool_] | None = None) -> Any:
        """The actions [B, n] for observations [B, ...]; those of rows outside of ``mask`` [B] are not used."""


class Picture:
    """The Dict observation ``tracks`` in SI units and the body frame."""

    def __init__(self, observation: dict[str, NDArray[Any]], scales: dict[str, float]) -> None:
        own = observation["own"].astype(float)
        self.speed = own[0] * scales["max_speed"]  # [m/s]
        self.velocity = own[:2] * scales["max_speed"]  # ahead, to starboard [m/s]
        self.yaw_rate = own[2] * scales["rate_scale"]  # [rad/s]
        self.leg_course = math.atan2(own[3], own[4])  # course of the active leg, off the bow [rad]
        self.cross_track = own[5] * scales["cross_track_scale"]  # [m], + to starboard of the leg
        self.distance = own[6] * scales["distance_scale"]  # to the active waypoint [m]
        self.waypoint_bearing = math.atan2(own[7], own[8])  # off the bow [rad]
        targets = observation["targets"][observation["mask"].astype(bool)].astype(float)
        self.position = targets[:, 1:3] * scales["range_scale"]  # [n, 2] ahead, to starboard [m]
        self.target_velocity = targets[:, 3:5] * scales["target_speed_scale"]  # [n, 2] {b}, over ground [m/s]
        self.radius = targets[:, 6] * scales["radius_scale"]  # [n] m
        self.spread = targets[:, 7] * scales["radius_scale"]  # [n] standard deviation of position [m]


class Piloted:
    """Base of controllers that ask for a heading and a speed."""

    action = "heading_speed"
    observation = "tracks"
    flat = False

    def reset(self, info: dict[str, Any]) -> None:
        """Learn the scales and the vessel's speeds."""
        self.scales: dict[str, float] = info["scales"]
        self.dt = self.scales["control_interval"]

    def command(self, turn: float, speed: float) -> NDArray[np.float32]:
        """The action that asks for a heading ``turn`` rad to starboard of the present one and a speed [m/s]."""
        heading = np.clip((turn + math.pi) % (2.0 * math.pi) - math.pi, -math.pi / 2, math.pi / 2) / (math.pi / 2)
        return np.array([heading, np.clip(2.0 * speed / self.scales["max_speed"] - 1.0, -1.0, 1.0)], np.float32)
