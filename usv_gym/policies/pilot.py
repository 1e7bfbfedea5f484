"""What the built-in controllers share: a kernel that decides for a batch of observations, and its eyes and rudder.

They look at the flat observation ``tracks``, that is, at the sensor picture and never at truth, and steer by
``heading_speed``, so that they drive every vessel.  One controller alone is a batch of one, bit for bit.

Inside the kernels everything is in SI units and in {b} as it is now: x ahead, y to starboard, angles off the bow.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from ..jit import inner
from ..tasks.task import N_OWN, N_TARGET, TaskConfig
from ..trig import PI, atan2, clip, sincos, wrap
from ..world.encounter import SAFE, encounter

#: what a lookout asks for: the 16 nearest targets within 2 NM, up to 50 kn and 500 m in radius
LOOKOUT = TaskConfig(
    action="heading_speed", targets=16, range_scale=3704.0, distance_scale=10_000.0, target_speed_scale=25.0,
    radius_scale=500.0,
)  # fmt: skip

#: facts of the vessel and of the observation
SHIP = np.dtype([
    ("targets", "i8"), ("land", "i8"),  # how many; sectors of land, 0: not observed
    ("max_speed", "f8"), ("cruise", "f8"), ("length", "f8"), ("dt", "f8"),
    ("range_scale", "f8"), ("distance_scale", "f8"), ("target_speed_scale", "f8"), ("radius_scale", "f8"),
    ("rate_scale", "f8"),
    ("lookahead", "f8"), ("sigma", "f8"),  # of the line of sight: [m], integral's weight [m/s]
    ("turn_rate", "f8"), ("speed_time", "f8"),  # assumed of its own turns [rad/s] and of its own speed [s]
], align=True)  # fmt: skip
#: the own ship as it is seen
OWN = np.dtype([
    ("u", "f8"), ("v", "f8"), ("r", "f8"),  # over ground [m/s]; [rad/s]
    ("leg", "f8"), ("cross_track", "f8"),  # course of the active leg [rad]; [m], + to starboard of it
    ("distance", "f8"), ("next_turn", "f8"), ("last", "i8"),  # to the active waypoint [m]; at it [rad]; is the last
    ("wanted", "f8"),  # line-of-sight course [rad]
], align=True)  # fmt: skip
#: a target as it is seen: a disc that moves
TARGET = np.dtype([
    ("x", "f8"), ("y", "f8"), ("vx", "f8"), ("vy", "f8"),  # [m], over ground [m/s]
    ("speed", "f8"), ("distance", "f8"),  # [m/s], [m] from here to its centre
    ("radius", "f8"),  # [m], with one standard deviation of its position
    ("moves", "i8"), ("code", "i8"),  # 1: under way; encounter with the own ship on its route
    ("dcpa", "f8"), ("tcpa", "f8"),  # with the own ship on its route [m], [s]
], align=True)  # fmt: skip
#: what a controller remembers of an episode
STATE = np.dtype([
    ("integral", "f8"),  # of the line of sight
    ("last", "f8"), ("slowed", "f8"),  # heading asked for last, off leg or wanted course [rad]; 1 - share of cruising speed
    ("waited", "f8"),  # [s] for which it has been turned away from where it wants to go; below 0: for which it has stopped
], align=True)  # fmt: skip

LAND_TIME = 60.0  #: [s] of cruising within which land is looked at
MOVING = 0.7  #: [m/s] what makes a target one that the steering rules are about
SIGMA = 0.2  # weight of the integral, as a share of the cruising speed; 0.25 is critically damped


@inner
def look(obs, ship, own, targets):
    """Read an observation [n] into ``own`` and ``targets`` [>= K + sectors of land]; returns how many targets there are.

    Everything that has to be kept clear of becomes a disc in ``targets``, ships, icebergs and shores alike.
    """
    own.u, own.v = obs[0] * ship.max_speed, obs[1] * ship.max_speed
    own.r = obs[2] * ship.rate_scale
    own.leg = atan2(np.float64(obs[3]), np.float64(obs[4]))
    own.distance = obs[6] * ship.distance_scale
    # not obs[5], which is clipped: the waypoint is on the leg, so its bearing tells the same
    bearing = atan2(np.float64(obs[7]), np.float64(obs[8]))
    if math.cos(own.leg - bearing) < 0.0:
        own.leg = bearing  # past the waypoint, and too far off for it to count: back to it
    own.cross_track = own.distance * math.sin(own.leg - bearing)
    own.next_turn = atan2(np.float64(obs[9]), np.float64(obs[10]))
    own.last = 1 if obs[11] > 0.5 else 0
    found = 0
    for i in range(ship.targets):
        at = N_OWN + i * N_TARGET
        if obs[at] < 0.5:
            break
        if abs(obs[at + 1]) >= 1.0 or abs(obs[at + 2]) >= 1.0:
            continue  # farther away than the observation can say
        t = targets[found]
        t.x, t.y = obs[at + 1] * ship.range_scale, obs[at + 2] * ship.range_scale
        t.vx, t.vy = obs[at + 3] * ship.target_speed_scale, obs[at + 4] * ship.target_speed_scale
        t.speed = math.hypot(t.vx, t.vy)
        t.distance = math.hypot(t.x, t.y)
        t.radius = (obs[at + 6] + obs[at + 7]) * ship.radius_scale
        t.moves = 1 if t.speed > MOVING else 0
        found += 1
    return _look_for_land(obs, ship, targets, found)


@inner
def _look_for_land(obs, ship, targets, found):
    """Add a disc for the land in every sector that is near, echoed or charted, whichever is nearer; returns the new count.

    The disc touches both sides of its sector, and its near side is where the land is.
    """
    n = ship.land
    start = N_OWN + ship.targets * N_TARGET
    width = math.sin(PI / max(n, 1))
    for i in range(n):
        r = (1.0 - max(obs[start + i], obs[start + n + i])) * ship.range_scale
        if r > LAND_TIME * ship.cruise:
            continue
        t = targets[found]
        t.radius = r * width / (1.0 - width)
        t.distance = r + t.radius
        s, c = sincos((i + 0.5) * 2.0 * PI / n)
        t.x, t.y = t.distance * c, t.distance * s
        t.vx = t.vy = t.speed = 0.0
        t.moves = 0
        found += 1
    return found


@inner
def line_of_sight(own, ship, state):
    """Turn [rad] on to the line-of-sight course, and a step of its integral ``state.integral``.

    ILOS of Boerhaug, Pavlov and Pettersen (CDC 2008): heading = leg course - atan((y + sigma y_int) / lookahead), with y the
    cross-track error and y_int' = lookahead y / (lookahead^2 + (y + sigma y_int)^2).
    """
    y = own.cross_track + ship.sigma * state.integral
    state.integral += ship.dt * ship.lookahead * own.cross_track / (ship.lookahead * ship.lookahead + y * y)
    own.wanted = wrap(own.leg - atan2(y, ship.lookahead))


@inner
def classify(own, ship, targets, found, dcpa, tcpa):
    """Which encounter each target is, were the own ship to cruise along its leg; SAFE beyond dcpa [m] or tcpa [s].

    Against the route and not against the course of the moment: what an encounter is does not change because one gives way.
    """
    s, c = sincos(own.leg)
    for i in range(found):
        t = targets[i]
        t.code, t.dcpa, t.tcpa = encounter(0.0, 0.0, ship.cruise * c, ship.cruise * s, t.x, t.y, t.vx, t.vy)
        if t.moves == 0 or t.dcpa - t.radius > dcpa or t.tcpa > tcpa:
            t.code = SAFE


@inner
def wait(state, offset, share, ship):
    """Count the time that the ship is turned away by more than 45 deg, or has stopped."""
    if share < 0.3:
        state.waited -= ship.dt
    elif abs(offset) > 0.25 * PI:
        state.waited += ship.dt
    else:
        state.waited -= clip(state.waited, -ship.dt, ship.dt)


@inner
def price_of_slowing(price, state, patience):
    """What slowing down costs, as time goes by [s].

    Beside a vessel of the same speed a ship that only turns would never come back to its route: it has to let it go ahead.
    One that has stopped has to go on at some time.
    """
    waited = state.waited / patience
    return price / (1.0 + waited) if waited > 0.0 else price * (1.0 - waited)


@inner
def command(action, ship, turn, speed):
    """Write the action [2] that asks for a heading ``turn`` rad to starboard of the present one and a speed [m/s]."""
    action[0] = np.float32(clip(wrap(turn) / (0.5 * PI), -1.0, 1.0))
    action[1] = np.float32(clip(2.0 * speed / ship.max_speed - 1.0, -1.0, 1.0))


def record(dtype: np.dtype[Any], values: Mapping[str, Any]) -> NDArray[Any]:
    """A record [1] of ``dtype`` with these values."""
    out = np.zeros(1, dtype)
    for name in dtype.names or ():
        out[name] = values[name]
    return out


@dataclass(frozen=True)
class NoTuning:
    """A controller without parameters of its own."""

    none: float = 0.0


class Pilot:
    """Base of the built-in controllers.

    A subclass gives the dataclass of its parameters, ``parameters``, and a kernel ``decide(obs [B, n], mask [B], ship [1],
    tuning [1], own [1], targets [K + sectors of land], states [B], actions [B, 2])`` that writes the actions of the rows of
    ``mask``; ``own`` and ``targets`` are room to work in.
    """

    parameters: ClassVar[type] = NoTuning
    decide: ClassVar[Any]
    task: ClassVar[TaskConfig] = LOOKOUT
    TURN_RATE: ClassVar[float] = 0.1
    SPEED_TIME: ClassVar[float] = 8.0

    def __init__(self, tuning: Any = None) -> None:
        self.tuning = self.parameters() if tuning is None else tuning

    # --- one of them -------------------------------------------------------------------------------------------------
    def reset(self, info: Mapping[str, Any]) -> None:
        """A new episode; ``info["scales"]`` says what observations mean."""
        self.reset_batch(1, info)

    def act(self, observation: Any) -> NDArray[np.float32]:
        """The action for one observation: flat, or its Dict form."""
        if isinstance(observation, Mapping):
            parts = [np.ravel(observation[name]) for name in ("own", "targets", "land", "chart") if name in observation]
            observation = np.concatenate(parts)
        action: NDArray[np.float32] = self.act_batch(np.asarray(observation, np.float32)[None])[0].copy()
        return action

    # --- many of them ------------------------------------------------------------------------------------------------
    def reset_batch(self, num: int, info: Mapping[str, Any]) -> None:
        """New episodes in ``num`` rows of one task."""
        scales = info["scales"]
        values = {name: scales.get(name, 0.0) for name in SHIP.names or ()}
        cruise = scales["cruise_speed"]
        values.update(cruise=cruise, dt=scales["control_interval"], sigma=SIGMA * cruise,
                      lookahead=4.0 * scales["length"] + 3.0 * cruise,
                      turn_rate=self.TURN_RATE, speed_time=self.SPEED_TIME)  # fmt: skip
        self._ship = record(SHIP, values)
        tuning = {key: np.asarray(value, float) for key, value in asdict(self.tuning).items()}
        dtype = np.dtype([(key, "f8", value.shape) for key, value in tuning.items()], align=True)
        self._tuning = record(dtype, tuning)
        self._own, self._targets = np.zeros(1, OWN), np.zeros(int(values["targets"] + values["land"]), TARGET)
        self._states = np.zeros(num, STATE)
        self._actions = np.zeros((num, 2), np.float32)
        self._all = np.ones(num, np.bool_)

    def act_batch(self, observations: NDArray[np.float32], mask: NDArray[np.bool_] | None = None) -> NDArray[np.float32]:
        """The actions [B, 2] for observations [B, n]; rows outside of ``mask`` [B] keep what they had.  A view."""
        mask = self._all if mask is None else mask
        self.decide(observations, mask, self._ship, self._tuning, self._own, self._targets, self._states, self._actions)
        return self._actions
