"""Near shore, the thesis's second scenario (3.1.2), as a random family.

A route of 1.5 km through narrow waters: land to both sides, islands, leisure boats that wander about without a plan, and a few
that keep to the fairway.  ``difficulty`` from 0 to 1 narrows the water and adds boats.
"""

from __future__ import annotations

from typing import Any

from ...jit import inner, kernel, spliced
from ...trig import atan2, sincos
from ...units import DEG
from ...world.land import Coast
from ...world.state import (
    AFTER_LOOP,
    AFTER_STOP,
    AIS_CLASS_A,
    AIS_CLASS_B,
    AIS_NONE,
    BEHAVIOUR_ERRATIC,
    KIND_BOAT,
    KIND_VESSEL,
)
from ...world.vessel import VesselModel
from ..schema import Scenario
from .coasts import channels
from .common import between, put_ship

MAX_BOATS = 7  #: fits the smallest capacity class
SPREAD = 0.35  #: of difficulties of the coasts that one difficulty meets


@inner
def pick_coast(w, difficulty, count):
    """One of ``count`` coasts, which get more difficult with their number; also what the chart shows."""
    share = difficulty * (1.0 - SPREAD) + between(w, 0, 0, 0.0, SPREAD)
    k = min(int(share * count), count - 1)
    w.land_id = k
    w.chart_id = k
    return k


@inner
def set_own_route(w, route, radius):
    """Put the own ship at the first point of a route [k, 2], on its way to the last."""
    v, r = w.vessels, w.routes
    for i in range(route.shape[0]):
        r.waypoint[0, i, 0] = route[i, 0]
        r.waypoint[0, i, 1] = route[i, 1]
    r.count[0] = route.shape[0]
    r.leg[0] = 1
    r.radius[0] = radius
    r.after_last[0] = AFTER_STOP
    w.nav.leg[0] = 1
    v.eta[0, 0] = route[0, 0]
    v.eta[0, 1] = route[0, 1]
    v.eta[0, 2] = atan2(route[1, 1] - route[0, 1], route[1, 0] - route[0, 0])


@inner
def make_erratic(w, j, wander):
    """Let the boat in slot j wander about its route, never farther from it than ``wander`` metres."""
    p = w.pilots
    w.vessels.behaviour[j] = BEHAVIOUR_ERRATIC
    p.wander[j] = wander
    p.acceleration[j] = 0.5
    p.alteration[j] = 100.0 * DEG
    p.period_us[j] = 15_000_000


@inner
def set_station(w, j, ais_class):
    """Give the ship in slot j an AIS station, or none."""
    w.vessels.ais_class[j] = ais_class
    w.vessels.ais_on[j] = ais_class != AIS_NONE


@spliced
def draw_near_shore(w, difficulty, route, middle, width):
    """Draw coast, route and boats into a template whose own ship is in place, from ``w.seed``."""
    k = pick_coast(w, difficulty, route.shape[0])
    set_own_route(w, route[k], 25.0)
    boats = int(2.0 + 3.5 * difficulty + between(w, 0, 1, 0.0, 1.99))
    for i in range(min(boats, MAX_BOATS, w.vessels.active.shape[0] - 1)):
        j, slot = 1 + i, 200 + i
        # a stretch of the middle line, ahead of where the own ship starts
        a = 8 + int(between(w, slot, 0, 0.0, 9.0))
        b = a + 2 + int(between(w, slot, 1, 0.0, 4.0))
        free = width[k, a]
        for m in range(a, b + 1):
            free = min(free, width[k, m])
        erratic = between(w, slot, 2, 0.0, 1.0) < 0.4 + 0.5 * difficulty
        northward = between(w, slot, 3, 0.0, 1.0) < 0.3
        first, last = (a, b) if northward else (b, a)
        length = between(w, slot, 4, 5.0, 12.0)
        boat = erratic or between(w, slot, 5, 0.0, 1.0) < 0.6
        if not boat:
            length = between(w, slot, 4, 15.0, 30.0)
        put_ship(w, j, KIND_BOAT if boat else KIND_VESSEL, length, length / 3.0 if boat else length / 5.0,
                 between(w, slot, 6, 2.0, 6.0), middle[k, first, 0], middle[k, first, 1],
                 middle[k, last, 0], middle[k, last, 1])  # fmt: skip
        # to the starboard side of the water, as Rule 9 asks; a wanderer keeps to the middle
        side = 0.0 if erratic else min(0.4 * free, 40.0)
        r = w.routes
        step = 1 if northward else -1
        for m in range(b - a + 1):
            at = first + step * m
            before, after = max(at - 1, 0), min(at + 1, middle.shape[1] - 1)
            s, c = sincos(atan2(step * (middle[k, after, 1] - middle[k, before, 1]),
                                step * (middle[k, after, 0] - middle[k, before, 0])))  # fmt: skip
            r.waypoint[j, m, 0] = middle[k, at, 0] - side * s
            r.waypoint[j, m, 1] = middle[k, at, 1] + side * c
        r.count[j] = b - a + 1
        r.radius[j] = 25.0
        r.after_last[j] = AFTER_LOOP
        w.vessels.eta[j, 0] = r.waypoint[j, 0, 0]
        w.vessels.eta[j, 1] = r.waypoint[j, 0, 1]
        w.vessels.eta[j, 2] = atan2(r.waypoint[j, 1, 1] - r.waypoint[j, 0, 1], r.waypoint[j, 1, 0] - r.waypoint[j, 0, 0])
        if erratic:
            make_erratic(w, j, max(free - length, 10.0))
        station = AIS_CLASS_A if not boat else (AIS_CLASS_B if between(w, slot, 7, 0.0, 1.0) < 0.4 else AIS_NONE)
        set_station(w, j, station)


def coasts() -> tuple[Coast, ...]:
    """The coasts that ``land_id`` counts in."""
    return channels().coasts


def sample(worlds: Any, mask: Any, difficulty: Any, model: VesselModel, scenario: Scenario) -> None:
    """Draw narrow waters into the rows of ``mask`` [B]; see :class:`~usv_gym.scenarios.families.FamilySpec`."""
    water = channels()
    _sample(worlds, mask, difficulty, water.route, water.middle, water.width)


@kernel
def _sample(worlds, mask, difficulty, route, middle, width):
    for b in range(worlds.shape[0]):
        if mask[b]:
            draw_near_shore(worlds[b], difficulty[b], route, middle, width)
