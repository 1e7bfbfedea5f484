"""The busy port, the thesis's third scenario (3.1.2), as a random family.

In between the heads of the breakwaters, on the starboard side of a buoyed fairway, to a berth at the inner end.  Vessels are
moored at the piers; others sail out and in, ferries cross, and leisure boats wander off the entrance.  ``difficulty`` from 0 to
1 narrows the fairway and adds traffic.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ...jit import inner, kernel, spliced
from ...trig import sincos
from ...world.land import Coast
from ...world.state import (
    AFTER_LOOP,
    AIS_CLASS_A,
    AIS_CLASS_B,
    AIS_NONE,
    BEHAVIOUR_HOLD,
    KIND_BOAT,
    KIND_BUOY,
    KIND_SHIP,
    KIND_VESSEL,
)
from ...world.vessel import VesselModel
from ..schema import Scenario
from .coasts import BERTHS, ports
from .common import between, put_ship
from .near_shore import make_erratic, pick_coast, set_own_route, set_station

MOORED, SAILING, FERRIES, LEISURE = 9, 5, 2, 3  #: most of each; with the own ship 20
BUOYS = 12
START = -420.0  #: [m] from the heads of the breakwaters, where the own ship begins
LANE = 0.35  #: of the fairway's half width, from its middle to the middle of a lane


@inner
def _place(frame, k, n, e):
    """A place in the frame of port k as N, E {n}; the own ship starts at the origin of {n}, the frame does not move."""
    return frame[k, 1] * n - frame[k, 0] * e, frame[k, 0] * n + frame[k, 1] * e


@inner
def _sail(w, j, frame, k, slot, kind, length, speed, n0, e0, n1, e1):
    """A ship in slot j from one place of port k to another and back."""
    an, ae = _place(frame, k, n0, e0)
    bn, be = _place(frame, k, n1, e1)
    put_ship(w, j, kind, length, length / (3.0 if kind == KIND_BOAT else 5.0), speed, an, ae, bn, be)
    w.routes.radius[j] = 20.0
    w.routes.after_last[j] = AFTER_LOOP
    boat = kind == KIND_BOAT
    seen = not boat or between(w, slot, 9, 0.0, 1.0) < 0.5
    set_station(w, j, AIS_NONE if not seen else (AIS_CLASS_B if boat else AIS_CLASS_A))


@spliced
def draw_busy_port(w, difficulty, frame, size, berths, way):
    """Draw port, route and traffic into a template whose own ship is in place, from ``w.seed``; way [4, 2] is work space."""
    v = w.vessels
    k = pick_coast(w, difficulty, frame.shape[0])
    fairway, length, basin = size[k, 0], size[k, 1], size[k, 2]
    lane = LANE * fairway
    stages = (START, -200.0, 0.5 * length, length - 90.0)
    for i in range(4):
        way[i, 0], way[i, 1] = _place(frame, k, stages[i], lane)
    set_own_route(w, way, 20.0)

    j = 1
    wanted = int(3.0 + 6.0 * difficulty + between(w, 0, 2, 0.0, 0.99))
    free = v.active.shape[0]
    first = int(between(w, 0, 3, 0.0, BERTHS - 0.01))
    for i in range(BERTHS):
        b = (first + i) % BERTHS
        longest = berths[k, b, 3]
        if longest <= 0.0 or wanted == 0 or j >= free:
            continue
        wanted -= 1
        slot = 100 + i
        side = between(w, slot, 0, 0.5, 1.0) * longest
        s, c = sincos(berths[k, b, 2])
        put_ship(w, j, KIND_VESSEL if side > 15.0 else KIND_BOAT, side, side / 5.0, 0.0, berths[k, b, 0], berths[k, b, 1],
                 berths[k, b, 0] + c, berths[k, b, 1] + s)  # fmt: skip
        v.behaviour[j] = BEHAVIOUR_HOLD
        v.heading_set[j] = v.eta[j, 2]
        w.routes.count[j] = 0
        w.routes.leg[j] = 0
        set_station(w, j, AIS_CLASS_A if between(w, slot, 1, 0.0, 1.0) < 0.5 else AIS_NONE)
        j += 1

    for i in range(min(int(1.0 + 4.0 * difficulty + between(w, 0, 4, 0.0, 0.99)), SAILING)):
        if j >= free:
            break
        slot = 200 + i
        # out and back again on the port hand of who comes in; what is not long out yet, and what has been
        kind = KIND_SHIP if between(w, slot, 0, 0.0, 1.0) < 0.25 else KIND_VESSEL
        long = between(w, slot, 1, 50.0, 80.0) if kind == KIND_SHIP else between(w, slot, 1, 12.0, 40.0)
        at = between(w, slot, 2, 150.0, length + 500.0)
        out = min(at, length - 120.0)
        _sail(w, j, frame, k, slot, kind, long, between(w, slot, 3, 1.5, 3.5), out, -1.1 * lane, -1500.0, -1.1 * lane)
        j += 1
    for i in range(min(int(2.0 * difficulty + between(w, 0, 5, 0.0, 0.99)), FERRIES)):
        if j >= free:
            break
        slot = 300 + i
        n = between(w, slot, 0, -60.0, -30.0) if i == 0 else between(w, slot, 0, length - 110.0, length - 60.0)
        reach = 0.8 * basin
        phase = between(w, slot, 1, -1.0, 1.0)
        _sail(w, j, frame, k, slot, KIND_VESSEL, between(w, slot, 2, 15.0, 25.0), between(w, slot, 3, 2.0, 3.5),
              n, phase * reach, n, -reach if phase > 0.0 else reach)  # fmt: skip
        j += 1
    for i in range(min(int(1.0 + 2.0 * difficulty + between(w, 0, 6, 0.0, 0.99)), LEISURE)):
        if j >= free:
            break
        slot = 400 + i
        n, e = between(w, slot, 0, -400.0, -250.0), between(w, slot, 1, -150.0, -60.0)
        _sail(w, j, frame, k, slot, KIND_BOAT, between(w, slot, 2, 5.0, 12.0), between(w, slot, 3, 2.0, 5.0),
              n, e, n + between(w, slot, 4, -80.0, 80.0), between(w, slot, 5, 60.0, 200.0))  # fmt: skip
        make_erratic(w, j, 80.0)
        j += 1

    m = w.obstacles
    for i in range(min(BUOYS, m.active.shape[0])):
        n, e = -380.0 + 170.0 * (i // 2), fairway if i % 2 else -fairway
        if n > length - 60.0:
            break
        m.active[i] = 1
        m.kind[i] = KIND_BUOY
        m.position[i, 0], m.position[i, 1] = _place(frame, k, n, e)
        m.radius[i] = 1.5


def coasts() -> tuple[Coast, ...]:
    """The coasts that ``land_id`` counts in."""
    return ports().coasts


def sample(worlds: Any, mask: Any, difficulty: Any, model: VesselModel, scenario: Scenario) -> None:
    """Draw a port into the rows of ``mask`` [B]; see :class:`~usv_gym.scenarios.families.FamilySpec`."""
    port = ports()
    _sample(worlds, mask, difficulty, port.frame, port.size, port.berths, np.zeros((4, 2)))


@kernel
def _sample(worlds, mask, difficulty, frame, size, berths, way):
    for b in range(worlds.shape[0]):
        if mask[b]:
            draw_busy_port(worlds[b], difficulty[b], frame, size, berths, way)
