"""What the families share: numbers that belong to a slot, ships and own ships on straight legs."""

from __future__ import annotations

import math

import numpy as np

from ... import rng
from ...jit import inner
from ...trig import atan2, sincos
from ...units import DEG
from ...world.state import (
    AFTER_CONTINUE,
    AFTER_STOP,
    BEHAVIOUR_WAYPOINTS,
    KIND_SHIP,
    KIND_VESSEL,
    MODEL_KINEMATIC,
)

FIRST_MMSI = 257_000_001


@inner
def between(w, slot, draw, low, high):
    """A uniform number in [low, high) that belongs to (object slot, draw)."""
    return low + (high - low) * rng.uniform(w.seed, rng.FAMILY, np.int64(slot), np.int64(draw))


@inner
def put_ship(w, j, kind, length, beam, speed, n0, e0, n1, e1):
    """Put a kinematic ship of a class into slot j, from (n0, e0) towards (n1, e1) and on."""
    v, r = w.vessels, w.routes
    v.active[j] = 1
    v.kind[j] = kind
    v.model[j] = MODEL_KINEMATIC
    v.behaviour[j] = BEHAVIOUR_WAYPOINTS
    v.plant[j] = -1
    v.eta[j, 0] = n0
    v.eta[j, 1] = e0
    heading = atan2(e1 - e0, n1 - n0)
    s, c = sincos(heading)
    v.eta[j, 2] = heading
    v.heading_set[j] = heading
    v.length[j] = length
    v.beam[j] = beam
    v.speed[j] = speed
    v.nu[j, 0] = speed
    v.velocity[j, 0] = speed * c
    v.velocity[j, 1] = speed * s
    v.turn_time[j] = 10.0 if kind == KIND_SHIP else (6.0 if kind == KIND_VESSEL else 3.0)
    v.turn_rate_max[j] = (1.0 if kind == KIND_SHIP else (3.0 if kind == KIND_VESSEL else 10.0)) * DEG
    v.turn_decay[j] = 1.0 - math.exp(-w.frame_ticks * w.dt / v.turn_time[j])
    v.mmsi[j] = FIRST_MMSI + j
    r.waypoint[j, 0, 0] = n0
    r.waypoint[j, 0, 1] = e0
    r.waypoint[j, 1, 0] = n1
    r.waypoint[j, 1, 1] = e1
    r.count[j] = 2
    r.leg[j] = 1
    r.radius[j] = 50.0
    r.after_last[j] = AFTER_CONTINUE


@inner
def put_own_ship(w, north, east, heading, speed, distance):
    """Put the own ship to a place, under way, with a route ``distance`` m straight ahead; N, E [m], heading [rad] {n}.

    The circle of acceptance at its end is two lengths, and at least 2 % of the way.
    """
    v, r = w.vessels, w.routes
    s, c = sincos(heading)
    v.eta[0, 0] = north
    v.eta[0, 1] = east
    v.eta[0, 2] = heading
    v.heading_set[0] = heading
    v.nu[0, 0] = speed
    v.speed[0] = speed
    v.velocity[0, 0] = speed * c
    v.velocity[0, 1] = speed * s
    r.waypoint[0, 0, 0] = north
    r.waypoint[0, 0, 1] = east
    r.waypoint[0, 1, 0] = north + distance * c
    r.waypoint[0, 1, 1] = east + distance * s
    r.count[0] = 2
    r.leg[0] = 1
    r.radius[0] = max(2.0 * v.length[0], 0.02 * distance)
    r.after_last[0] = AFTER_STOP
    w.nav.leg[0] = 1
