"""Ships and obstacles as they really move: kinematic ships along waypoints, drifting discs.

Traffic moves in frames of ``frame_ticks``.  At the start of a frame each ship decides its turn (thesis 6.2.2: heading
through a discrete low-pass filter, here exact over the frame and with a largest turn rate); within the frame it moves
straight along the mean heading at constant speed, so that positions at any tick are a linear extrapolation.
"""

from __future__ import annotations

import math

from ..jit import inner
from ..trig import TWO_PI, atan2, clip, sincos, wrap
from ..world.geometry import waypoint_reached
from ..world.state import (
    AFTER_CONTINUE,
    AFTER_LOOP,
    BEHAVIOUR_COLREGS,
    BEHAVIOUR_HOLD,
    BEHAVIOUR_REPLAY,
    MODEL_KINEMATIC,
)
from .pilots import pilot

DEAD_BAND = 2.0 * math.pi / 180.0  #: [rad] of the original's constant-rate turn


@inner
def follow_route(w, j):
    """Advance the active leg of vessel j as far as its position allows."""
    r = w.routes
    while r.leg[j] < r.count[j] and r.done[j] == 0:
        k = r.leg[j]
        if not waypoint_reached(r, j, k, w.vessels.eta[j, 0], w.vessels.eta[j, 1]):
            return
        r.reached[j] += 1
        if k + 1 < r.count[j]:
            r.leg[j] = k + 1
        elif r.after_last[j] == AFTER_LOOP and r.count[j] > 1:
            r.leg[j] = 0
            return  # at most one lap per frame
        else:
            r.leg[j] = r.count[j]
            r.done[j] = 1


@inner
def steer(w, seconds):
    """Decide turn and speed of every kinematic ship for a frame of this many seconds."""
    v, r = w.vessels, w.routes
    for j in range(v.active.shape[0]):
        if v.active[j] == 0 or v.model[j] != MODEL_KINEMATIC or v.behaviour[j] == BEHAVIOUR_REPLAY:
            continue
        psi = v.eta[j, 2]
        speed = v.speed[j]
        wanted = psi
        if v.controlled[j] or v.behaviour[j] == BEHAVIOUR_HOLD:
            wanted = v.heading_set[j]
        else:
            follow_route(w, j)
            if r.done[j] == 0 and r.leg[j] < r.count[j]:
                k = r.leg[j]
                wanted = atan2(r.waypoint[j, k, 1] - v.eta[j, 1], r.waypoint[j, k, 0] - v.eta[j, 0])
            elif r.count[j] > 0 and r.after_last[j] != AFTER_CONTINUE:
                speed = 0.0
            if v.behaviour[j] >= BEHAVIOUR_COLREGS:
                wanted, speed = pilot(w, j, wanted, speed, seconds)
        error = wrap(wanted - psi)
        limit = v.turn_rate_max[j] * seconds
        if v.turn_constant[j]:
            turn = 0.0 if abs(error) < DEAD_BAND else clip(error, -limit, limit)
        else:
            turn = clip(error * v.turn_decay[j], -limit, limit)
        speed += v.speed_hold[j] * (v.nu[j, 0] - speed)
        if speed == 0.0:
            turn = 0.0
        s, c = sincos(psi + 0.5 * turn)
        v.nu[j, 0] = speed
        v.nu[j, 1] = 0.0
        v.nu[j, 2] = turn / seconds
        v.velocity[j, 0] = speed * c
        v.velocity[j, 1] = speed * s


@inner
def move_traffic(w, tick):
    """Carry all traffic from ``traffic_tick`` to ``tick``."""
    seconds = (tick - w.traffic_tick) * w.dt
    if seconds == 0.0:
        return
    w.traffic_tick = tick
    v, m = w.vessels, w.obstacles
    for j in range(v.active.shape[0]):
        if v.active[j] and v.model[j] == MODEL_KINEMATIC:
            v.eta[j, 0] += v.velocity[j, 0] * seconds
            v.eta[j, 1] += v.velocity[j, 1] * seconds
            v.eta[j, 2] += v.nu[j, 2] * seconds
            if abs(v.eta[j, 2]) > 1.0e4 * TWO_PI:  # a ship on a loop for weeks
                v.eta[j, 2] = wrap(v.eta[j, 2])
            v.distance[j] += abs(v.nu[j, 0]) * seconds
    cn, ce = w.weather.current[0], w.weather.current[1]
    for i in range(m.active.shape[0]):
        if m.active[i]:
            m.position[i, 0] += (m.velocity[i, 0] + m.drifts[i] * cn) * seconds
            m.position[i, 1] += (m.velocity[i, 1] + m.drifts[i] * ce) * seconds
