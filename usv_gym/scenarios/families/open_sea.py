"""The thesis's busy open sea (chapter 7) as a random family.

A route of a few legs, icebergs strewn along it, and ships timed to meet the own ship on its way.  ``difficulty`` from 0 to 1
scales how many there are and how near they come.
"""

from __future__ import annotations

import math
from typing import Any

from ... import rng
from ...jit import inner, kernel, spliced
from ...trig import PI, atan2, sincos
from ...units import DEG
from ...world.state import (
    AFTER_STOP,
    AIS_CLASS_A,
    AIS_CLASS_B,
    AIS_NONE,
    KIND_BOAT,
    KIND_ICEBERG,
    KIND_SHIP,
    KIND_VESSEL,
)
from ...world.vessel import VesselModel
from ..schema import Scenario
from .common import between, put_ship

#: most that the family puts into one world; fits the smallest capacity class
MAX_SHIPS, MAX_ICEBERGS = 7, 16


@inner
def _point_on_route(w, distance):
    """(N, E, course) of the point ``distance`` metres along the own ship's route."""
    r = w.routes
    left = distance
    for k in range(1, r.count[0]):
        dn = r.waypoint[0, k, 0] - r.waypoint[0, k - 1, 0]
        de = r.waypoint[0, k, 1] - r.waypoint[0, k - 1, 1]
        length = math.hypot(dn, de)
        if left <= length or k == r.count[0] - 1:
            return (r.waypoint[0, k - 1, 0] + dn * left / length, r.waypoint[0, k - 1, 1] + de * left / length,
                    atan2(de, dn))  # fmt: skip
        left -= length
    return r.waypoint[0, 0, 0], r.waypoint[0, 0, 1], 0.0


@spliced
def draw_open_sea(w, difficulty, cruise):
    """Draw route, icebergs and ships of an open sea into a template whose own ship is in place, from ``w.seed``."""
    v, r, m = w.vessels, w.routes, w.obstacles
    # the route: three legs of 250 to 450 m that turn by at most 40 deg
    course = between(w, 0, 0, -PI, PI)
    r.waypoint[0, 0, 0] = v.eta[0, 0]
    r.waypoint[0, 0, 1] = v.eta[0, 1]
    total = 0.0
    for k in range(1, 4):
        length = between(w, 0, 10 + k, 250.0, 450.0)
        if k > 1:
            course += between(w, 0, 20 + k, -40.0 * DEG, 40.0 * DEG)
        s, c = sincos(course)
        r.waypoint[0, k, 0] = r.waypoint[0, k - 1, 0] + length * c
        r.waypoint[0, k, 1] = r.waypoint[0, k - 1, 1] + length * s
        total += length
    r.count[0] = 4
    r.leg[0] = 1
    r.radius[0] = 30.0
    r.after_last[0] = AFTER_STOP
    v.eta[0, 2] = atan2(r.waypoint[0, 1, 1] - r.waypoint[0, 0, 1], r.waypoint[0, 1, 0] - r.waypoint[0, 0, 0])
    end_n, end_e = r.waypoint[0, 3, 0], r.waypoint[0, 3, 1]

    bergs = int(2.0 + 12.0 * difficulty + between(w, 0, 1, 0.0, 2.99))
    spread = 160.0 - 90.0 * difficulty
    for i in range(min(bergs, MAX_ICEBERGS, m.active.shape[0])):
        slot = 100 + i
        radius = between(w, slot, 0, 5.0, 25.0)
        for attempt in range(20):
            along = between(w, slot, 10 + attempt, 120.0, total + 100.0)
            a, b = rng.normal2(w.seed, rng.FAMILY, slot, 50 + attempt)
            n, e, _ = _point_on_route(w, min(along, total))
            n += spread * a
            e += spread * b
            clear = math.hypot(n - v.eta[0, 0], e - v.eta[0, 1]) > radius + 90.0
            clear = clear and math.hypot(n - end_n, e - end_e) > radius + 70.0
            for other in range(i):
                gap = math.hypot(n - m.position[other, 0], e - m.position[other, 1]) - radius - m.radius[other]
                clear = clear and gap > 45.0
            if clear:
                m.active[i] = 1
                m.kind[i] = KIND_ICEBERG
                m.position[i, 0] = n
                m.position[i, 1] = e
                m.radius[i] = radius
                break

    ships = int(1.0 + 4.0 * difficulty + between(w, 0, 2, 0.0, 1.99))
    for i in range(min(ships, MAX_SHIPS, v.active.shape[0] - 1)):
        j = 1 + i
        slot = 200 + i
        pick = between(w, slot, 0, 0.0, 1.0)
        kind = KIND_SHIP if pick < 0.3 else (KIND_VESSEL if pick < 0.65 else KIND_BOAT)
        if kind == KIND_SHIP:
            length, speed = between(w, slot, 1, 50.0, 120.0), between(w, slot, 2, 4.0, 8.0)
        elif kind == KIND_VESSEL:
            length, speed = between(w, slot, 1, 15.0, 50.0), between(w, slot, 2, 3.0, 7.0)
        else:
            length, speed = between(w, slot, 1, 5.0, 15.0), between(w, slot, 2, 2.0, 9.0)
        v.ais_class[j] = AIS_CLASS_B if kind == KIND_BOAT else AIS_CLASS_A
        if kind == KIND_BOAT and between(w, slot, 3, 0.0, 1.0) < 0.5:
            v.ais_class[j] = AIS_NONE
        v.ais_on[j] = v.ais_class[j] != AIS_NONE
        for attempt in range(20):
            # meet at a point of the route, a little before or after the own ship gets there
            along = between(w, slot, 10 + attempt, 0.25 * total, 0.95 * total)
            n, e, own_course = _point_on_route(w, along)
            relative = between(w, slot, 40 + attempt, -PI, PI)
            s, c = sincos(own_course + relative)
            when = max(along / cruise + between(w, slot, 70 + attempt, -1.0, 1.0) * (60.0 - 45.0 * difficulty), 30.0)
            n0, e0 = n - speed * c * when, e - speed * s * when
            if math.hypot(n0 - v.eta[0, 0], e0 - v.eta[0, 1]) < 150.0 + length:
                continue
            put_ship(w, j, kind, length, length / 6.0 if kind != KIND_BOAT else length / 3.0, speed, n0, e0,
                     n + speed * c * 600.0, e + speed * s * 600.0)  # fmt: skip
            break


def sample(worlds: Any, mask: Any, difficulty: Any, model: VesselModel, scenario: Scenario) -> None:
    """Draw an open sea into the rows of ``mask`` [B]; see :class:`~usv_gym.scenarios.families.FamilySpec`."""
    _sample(worlds, mask, difficulty, model.cruise_speed)


@kernel
def _sample(worlds, mask, difficulty, cruise):
    """Draw an open sea into the rows of ``worlds`` [B] where ``mask`` [B] is true; difficulty [B], cruise speed [m/s]."""
    for b in range(worlds.shape[0]):
        if mask[b]:
            draw_open_sea(worlds[b], difficulty[b], cruise)
