"""Ships and obstacles as they really move: kinematic ships along waypoints, drifting discs.

Traffic moves in frames of ``frame_ticks``.  At the start of a frame each ship decides its turn (thesis 6.2.2: heading
through a discrete low-pass filter, here exact over the frame and with a largest turn rate); within the frame it moves
straight along the mean heading at constant speed, so that positions at any tick are a linear extrapolation.
"""

from __future__ import annotations

import math

from ..jit import inner
from ..trig import atan2, clip, sincos_random, wrap
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
#: what a ship of ``steer_how`` does: not steered here, goes straight on, turns to ``steer_heading``, towards a point
NOWHERE, STRAIGHT, TO_HEADING, TO_POINT = 0, 1, 2, 3


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
def _decide(w, seconds):
    """Write where every kinematic ship wants to go: ``steer_how``, where to and ``steer_speed``."""
    v, r = w.vessels, w.routes
    for j in range(v.active.shape[0]):
        w.steer_how[j] = NOWHERE
        if v.active[j] == 0 or v.model[j] != MODEL_KINEMATIC or v.behaviour[j] == BEHAVIOUR_REPLAY:
            continue
        w.steer_speed[j] = v.speed[j]
        if v.controlled[j] or v.behaviour[j] == BEHAVIOUR_HOLD:
            w.steer_how[j] = TO_HEADING
            w.steer_heading[j] = v.heading_set[j]
        else:
            w.steer_how[j] = STRAIGHT
            follow_route(w, j)
            if r.done[j] == 0 and r.leg[j] < r.count[j]:
                k = r.leg[j]
                w.steer_how[j] = TO_POINT
                w.steer_north[j] = r.waypoint[j, k, 0] - v.eta[j, 0]
                w.steer_east[j] = r.waypoint[j, k, 1] - v.eta[j, 1]
            elif r.count[j] > 0 and r.after_last[j] != AFTER_CONTINUE:
                w.steer_speed[j] = 0.0
            if v.behaviour[j] >= BEHAVIOUR_COLREGS:
                wanted = v.eta[j, 2]
                if w.steer_how[j] == TO_POINT:
                    wanted = atan2(w.steer_east[j], w.steer_north[j])
                w.steer_how[j] = TO_HEADING
                w.steer_heading[j], w.steer_speed[j] = pilot(w, j, wanted, w.steer_speed[j], seconds)
        w.steer_speed[j] += v.speed_hold[j] * (v.nu[j, 0] - w.steer_speed[j])


@inner
def steer(w, seconds):
    """Decide turn and speed of every kinematic ship for a frame of this many seconds."""
    _decide(w, seconds)
    v = w.vessels
    per_second = 1.0 / seconds
    for j in range(v.active.shape[0]):  # without a branch, so that it becomes vector code
        how = w.steer_how[j]
        psi = v.eta[j, 2]
        wanted = atan2(w.steer_east[j], w.steer_north[j]) if how == TO_POINT else psi
        wanted = w.steer_heading[j] if how == TO_HEADING else wanted
        error = wrap(wanted - psi)
        limit = v.turn_rate_max[j] * seconds
        lagged = clip(error * v.turn_decay[j], -limit, limit)
        steady = 0.0 if abs(error) < DEAD_BAND else clip(error, -limit, limit)
        turn = steady if v.turn_constant[j] != 0 else lagged
        speed = w.steer_speed[j]
        turn = 0.0 if speed == 0.0 else turn
        s, c = sincos_random(psi + 0.5 * turn)
        w.steered_rate[j] = turn * per_second
        w.steered_velocity[0, j] = speed * c
        w.steered_velocity[1, j] = speed * s
    for j in range(v.active.shape[0]):
        if w.steer_how[j] != NOWHERE:
            v.nu[j, 0] = w.steer_speed[j]
            v.nu[j, 1] = 0.0
            v.nu[j, 2] = w.steered_rate[j]
            v.velocity[j, 0] = w.steered_velocity[0, j]
            v.velocity[j, 1] = w.steered_velocity[1, j]
