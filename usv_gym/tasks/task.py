"""What a controller may do, what it sees and what it is paid for: the part of an environment that is not the sea.

``TaskConfig`` is what a user writes; ``task_record`` turns it and a vessel into the flat record that the kernel reads.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Literal

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from ..colregs.params import Params, params_dtype
from ..config import ConfigError, Document, Model, validate
from ..world.state import A, L

ActionName = Literal["default", "throttle_nozzle", "thrusters", "actuators", "heading_speed", "discrete"]
ObservationName = Literal["tracks", "ais", "sectors", "truth"]

ACTION_DEMAND, ACTION_CHANNELS, ACTION_HEADING_SPEED, ACTION_DISCRETE = 0, 1, 2, 3
OBS_TRACKS, OBS_AIS, OBS_SECTORS, OBS_TRUTH = 0, 1, 2, 3
_OBSERVATIONS = {"tracks": OBS_TRACKS, "ais": OBS_AIS, "sectors": OBS_SECTORS, "truth": OBS_TRUTH}

#: what every observation says of the own ship: (name, unit it is divided by, bounds)
OWN_FEATURES = (
    ("surge speed", "max speed"), ("sway speed", "max speed"), ("yaw rate", "rate scale"),
    ("sin of (course of active leg - heading)", "1"), ("cos of the same", "1"),
    ("cross-track error, + to starboard of the leg", "cross-track scale"),
    ("distance to the active waypoint", "distance scale"),
    ("sin of relative bearing of the active waypoint", "1"), ("cos of the same", "1"),
    ("sin of the next turn", "1"), ("cos of the same", "1"),
    ("active waypoint is the last (0 or 1)", "1"),
)  # fmt: skip
#: what ``tracks``, ``ais`` and ``truth`` say of each target, nearest first; zeros where the mask is 0
TARGET_FEATURES = (
    ("mask: 1 where there is a target", "1"),
    ("position ahead, {b}", "range scale"), ("position to starboard, {b}", "range scale"),
    ("velocity over ground ahead, {b}", "target speed scale"), ("velocity over ground to starboard, {b}", "target speed scale"),
    ("motion is known (0 or 1)", "1"),
    ("apparent radius", "radius scale"),
    ("position standard deviation (age of the report for ``ais``)", "radius scale (60 s)"),
    ("is a vessel (0 or 1)", "1"),
)  # fmt: skip
N_OWN, N_TARGET = len(OWN_FEATURES), len(TARGET_FEATURES)

TERMS = ("progress", "cross_track", "proximity", "effort", "time", "collision", "arrival", "out_of_area", "grounding",
         "risk", "colregs")  # fmt: skip
N_TERMS = len(TERMS)
#: the terms, given in this order, by name: {"progress": progress, ..}; so written a dict takes half the time, in every step
named_terms: Callable[..., dict[str, float]] = eval(
    f"lambda {', '.join(TERMS)}: {{{', '.join(f'{term!r}: {term}' for term in TERMS)}}}"
)

#: effects of the actions of ``discrete``: change of heading [deg], of speed [share of max speed]
DISCRETE = ((0.0, 0.0), (-15.0, 0.0), (15.0, 0.0), (0.0, 0.125), (0.0, -0.125))
HEADING_SPAN = np.pi / 2.0  #: [rad] heading change that +-1 of ``heading_speed`` asks for


class RewardWeights(Model):
    """Weights of the reward terms; each term itself is a metric and stands in ``info["reward_terms"]`` unweighted."""

    progress: float = 1.0  #: distance made good along the route in the step / distance at max speed
    cross_track: float = 0.1  #: -min(1, |cross-track error| / scale)
    proximity: float = 1.0  #: -(1 - closest / safe distance)^2 inside the safe distance, else 0
    effort: float = 0.02  #: -mean squared change of the action
    time: float = 0.05  #: -1 each step
    collision: float = 50.0  #: -1 on first contact
    arrival: float = 20.0  #: +1 when the last waypoint is reached
    out_of_area: float = 20.0  #: -1 when the area is left
    grounding: float = 50.0  #: -1 when the hull first touches land
    # the two that follow are only worked out where their weight is not 0 (colregs/duty.py)
    risk: float = 0.0  #: -(1 - DCPA / preferred) (1 - range / R2) of the ship with the largest risk of collision
    colregs: float = 0.0  #: -1 for a duty of Rules 8 and 13 to 17 that is not done at all, 0 for one that is


class TaskConfig(Model):
    """The decision problem of an environment."""

    action: ActionName = "default"
    observation: ObservationName = "tracks"
    targets: int = Field(default=8, ge=1, le=64)  #: K nearest targets in the observation
    sectors: int = Field(default=24, ge=4, le=360)  #: bearing sectors of ``sectors``
    land: bool | None = None  #: whether the observation has the part ``land``; None: if the scenario has land
    land_sectors: int = Field(default=36, ge=4, le=L)  #: bearing sectors of ``land``
    flat: bool = True  #: False: a Dict space of own, targets and mask (or sectors), and land
    range_scale: float = Field(default=1852.0, gt=0)  #: [m]
    distance_scale: float = Field(default=1000.0, gt=0)  #: [m]
    cross_track_scale: float = Field(default=100.0, gt=0)  #: [m]
    target_speed_scale: float = Field(default=10.0, gt=0)  #: [m/s]
    radius_scale: float = Field(default=100.0, gt=0)  #: [m]
    rate_scale: float = Field(default=0.5, gt=0)  #: [rad/s]
    safe_distance: float = Field(default=50.0, gt=0)  #: [m] hull to hull, where the proximity term begins
    reward: RewardWeights = RewardWeights()
    end_on_collision: bool = True  #: or grounding
    end_on_arrival: bool = True
    end_out_of_area: bool = True

    def scaled(self, factor: float) -> TaskConfig:
        """The same with the distances that were not asked for multiplied by a scenario's ``scale``."""
        distances = ("range_scale", "distance_scale", "cross_track_scale", "radius_scale", "safe_distance")
        usual = [name for name in distances if name not in self.model_fields_set]
        return self.model_copy(update={name: factor * getattr(self, name) for name in usual}) if factor != 1.0 else self


def task_config(arguments: Mapping[str, Any], reward: Mapping[str, float] | None) -> TaskConfig:
    """The task that keyword arguments of an environment describe.

    Raises
    ------
    ConfigError
        one line for each wrong name or value.
    """
    return validate(TaskConfig, Document("environment arguments", {**arguments, "reward": dict(reward or {})}))


@dataclass(frozen=True)
class Vessel:
    """What a task needs to know of the controlled vessel."""

    default_action: str
    max_speed: float  # [m/s]
    thrusters: int
    has_nozzle: tuple[bool, ...]
    has_bucket: tuple[bool, ...]


@functools.cache
def task_dtype() -> np.dtype[Any]:
    """dtype of the task record that the kernel reads."""
    return np.dtype([
        ("action", "i1"), ("channels", "i2"), ("thruster", "i2", (3 * A,)), ("part", "i2", (3 * A,)),
        ("observation", "i1"), ("targets", "i2"), ("sectors", "i2"), ("land", "i2"), ("size", "i4"),
        ("control_ticks", "i8"), ("max_steps", "i8"), ("max_speed", "f8"),
        ("range_scale", "f8"), ("distance_scale", "f8"), ("cross_track_scale", "f8"), ("target_speed_scale", "f8"),
        ("radius_scale", "f8"), ("rate_scale", "f8"), ("safe_distance", "f8"),
        ("weight", "f8", (N_TERMS,)),
        ("rules", "i1"), ("colregs", params_dtype()),  # whether the terms of the rules are wanted; their parameters
        ("end_on_collision", "i1"), ("end_on_arrival", "i1"), ("end_out_of_area", "i1"),
    ], align=True)  # fmt: skip


@functools.cache
def episode_dtype() -> np.dtype[Any]:
    """dtype of what passes between face and kernel, and of what a task remembers of an episode: one per observer."""
    return np.dtype([
        ("what", "i1"), ("action", "f8", (3 * A,)),  # in: tasks/step.py, BEGIN or STEP; channels of the action
        ("reward", "f8"),  # out
        # time since reset [s]; smallest hull distance to anything since then [m]; distance to go along the route [m];
        # floats_dtype() sees all as one
        ("time", "f8"), ("closest", "f8"), ("to_go", "f8"), ("terms", "f8", (N_TERMS,)),
        ("terminated", "?"), ("truncated", "?"),
        ("outcome", "i1"),  # 0 running, 1 collision, 2 arrival, 3 out of area, 4 time limit, 5 grounding
        ("step", "i8"),  # steps so far
        ("heading_ref", "f8"), ("speed_ref", "f8"),  # of heading_speed and discrete
        ("last_action", "f8", (3 * A,)), ("change", "f8"),  # mean squared change of the action in this step
        ("collided", "i1"), ("grounded", "i1"), ("arrived", "i1"),  # before this step
    ], align=True)  # fmt: skip


@functools.cache
def floats_dtype() -> np.dtype[Any]:
    """Overlay of ``episode_dtype``: from ``time`` to ``terms`` as one row ``floats``, which is read at once."""
    whole = episode_dtype()
    assert whole.fields is not None
    return np.dtype({"names": ["floats"], "formats": [("f8", (3 + N_TERMS,))], "offsets": [whole.fields["time"][1]],
                     "itemsize": whole.itemsize})  # fmt: skip


OUTCOMES = ("running", "collision", "arrival", "out_of_area", "time_limit", "grounding")


def action_channels(name: str, vessel: Vessel) -> list[tuple[int, int]]:
    """(thruster, part) of every channel of an action; part 0 rpm, 1 nozzle, 2 bucket."""
    channels: list[tuple[int, int]] = []
    for a in range(vessel.thrusters):
        channels.append((a, 0))
        if name == "actuators":
            if vessel.has_nozzle[a]:
                channels.append((a, 1))
            if vessel.has_bucket[a]:
                channels.append((a, 2))
    return channels


def resolve_action(config: TaskConfig, vessel: Vessel) -> str:
    """The action's name, with ``default`` replaced by the vessel's own.

    Raises
    ------
    ConfigError
        for an action on thrusters of a vessel that has none.
    """
    name = vessel.default_action if config.action == "default" else config.action
    if vessel.thrusters == 0 and name not in ("heading_speed", "discrete"):
        raise ConfigError(f"action {name!r}: a kinematic vessel has no thrusters; expected 'heading_speed' or 'discrete'")
    return name


def task_record(config: TaskConfig, vessel: Vessel, control_ticks: int, max_steps: int) -> NDArray[Any]:
    """The record [1] of a task for a vessel; control_ticks ticks per step, max_steps steps per episode (0: no limit)."""
    task = np.zeros(1, task_dtype())
    name = resolve_action(config, vessel)
    row = task[0]
    if name in ("thrusters", "actuators"):
        row["action"] = ACTION_CHANNELS
        channels = action_channels(name, vessel)
        row["channels"] = len(channels)
        for c, (thruster, part) in enumerate(channels):
            row["thruster"][c] = thruster
            row["part"][c] = part
    else:
        row["action"] = {
            "throttle_nozzle": ACTION_DEMAND, "heading_speed": ACTION_HEADING_SPEED, "discrete": ACTION_DISCRETE
        }[name]  # fmt: skip
        row["channels"] = 1 if name == "discrete" else 2
    row["observation"] = _OBSERVATIONS[config.observation]
    row["size"] = observation_size(config)
    row["land"] = config.land_sectors if config.land else 0
    row["control_ticks"] = control_ticks
    row["max_steps"] = max_steps
    row["max_speed"] = vessel.max_speed
    for field in ("targets", "sectors", "range_scale", "distance_scale", "cross_track_scale", "target_speed_scale",
                  "radius_scale", "rate_scale", "safe_distance", "end_on_collision", "end_on_arrival",
                  "end_out_of_area"):  # fmt: skip
        row[field] = getattr(config, field)
    row["weight"] = [getattr(config.reward, name) for name in TERMS]
    row["rules"] = config.reward.risk != 0.0 or config.reward.colregs != 0.0
    row["colregs"] = Params().record()[0]
    return task


def observation_size(config: TaskConfig) -> int:
    """Length of the flat observation."""
    return _land_start(config) + (2 * config.land_sectors if config.land else 0)


def _land_start(config: TaskConfig) -> int:
    """Where the part ``land`` begins in the flat observation: behind own ship and targets or sectors."""
    return N_OWN + (config.sectors if config.observation == "sectors" else config.targets * N_TARGET)


def action_space(config: TaskConfig, vessel: Vessel) -> gym.Space[Any]:
    """Box in [-1, 1] of the named action's channels, or Discrete(5)."""
    name = resolve_action(config, vessel)
    if name == "discrete":
        return gym.spaces.Discrete(len(DISCRETE))
    n = len(action_channels(name, vessel)) if name in ("thrusters", "actuators") else 2
    return gym.spaces.Box(-1.0, 1.0, (n,), np.float32)


def observation_space(config: TaskConfig) -> gym.Space[Any]:
    """Flat Box, or a Dict of ``own`` and ``targets`` with ``mask`` (or ``sectors``), and ``land``."""
    low = np.full(observation_size(config), -1.0, np.float32)
    high = np.ones(observation_size(config), np.float32)
    zero_to_one = (6, 11)
    low[list(zero_to_one)] = 0.0
    land = _land_start(config)
    low[land:] = 0.0
    if config.observation == "sectors":
        low[N_OWN:] = 0.0
    else:
        grid = low[N_OWN:land].reshape(config.targets, N_TARGET)
        grid[:, [0, 5, 6, 7, 8]] = 0.0
    if config.flat:
        return gym.spaces.Box(low, high, dtype=np.float32)
    spaces: dict[str, gym.Space[Any]] = {"own": gym.spaces.Box(low[:N_OWN], high[:N_OWN], dtype=np.float32)}
    if config.observation == "sectors":
        spaces["sectors"] = gym.spaces.Box(low[N_OWN:land], high[N_OWN:land], dtype=np.float32)
    else:
        least, most = (side[N_OWN:land].reshape(config.targets, N_TARGET) for side in (low, high))
        spaces["targets"] = gym.spaces.Box(least, most, dtype=np.float32)
        spaces["mask"] = gym.spaces.MultiBinary(config.targets)
    if config.land:
        for name in ("land", "chart"):
            spaces[name] = gym.spaces.Box(0.0, 1.0, (config.land_sectors,), np.float32)
    return gym.spaces.Dict(spaces)


def unflatten(config: TaskConfig, flat: NDArray[np.float32]) -> dict[str, NDArray[Any]]:
    """The Dict form of flat observations [..., n]."""
    start = _land_start(config)
    own, rest = flat[..., :N_OWN].copy(), flat[..., N_OWN:start]
    parts = {"own": own}
    if config.observation == "sectors":
        parts["sectors"] = rest.copy()
    else:
        targets = rest.reshape(*rest.shape[:-1], config.targets, N_TARGET).copy()
        parts |= {"targets": targets, "mask": targets[..., 0].astype(np.int8)}
    if config.land:
        end = start + config.land_sectors
        parts |= {"land": flat[..., start:end].copy(), "chart": flat[..., end:].copy()}
    return parts
