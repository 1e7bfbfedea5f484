"""The 22 cases of Imazu as a family: one of them at every reset, at the own ship's speed and to any scale of time.

Every ship starts its speed times the time to the meeting point away from the origin and sails straight to it; the own ship
comes from the south.  The ships are as long as the own ship, so that a scaled case is the same case in smaller.
"""

from __future__ import annotations

import functools
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ... import rng
from ...jit import kernel
from ...trig import sincos
from ...units import DEG
from ...world.state import AIS_CLASS_A, KIND_SHIP
from ...world.vessel import VesselModel
from ..family_schema import Imazu, imazu_cases
from ..schema import Scenario
from .common import between, put_own_ship, put_ship

MOST = 3  #: ships of a case


@functools.lru_cache(maxsize=64)
def case_table(names: tuple[str, ...]) -> NDArray[np.float64]:
    """Course [rad] and speed ratio of the ships of these cases, [cases, MOST, 2]; speed ratio 0: no such ship."""
    table = np.zeros((len(names), MOST, 2))
    cases = imazu_cases()
    for i, name in enumerate(names):
        for k, ship in enumerate(cases[name]):
            table[i, k] = ship["course_deg"] * DEG, ship["speed_ratio"]
    return table


def sample(worlds: Any, mask: Any, difficulty: Any, model: VesselModel, scenario: Scenario) -> None:
    """Draw a case into the rows of ``mask`` [B]; see :class:`~usv_gym.scenarios.families.FamilySpec`."""
    family = scenario.family
    assert isinstance(family, Imazu)
    _sample(worlds, mask, case_table(family.case), model.cruise_speed, family.meeting_time(model),
            family.heading_jitter_deg * DEG)  # fmt: skip


def drawn_case(seed: int, family: Imazu) -> str:
    """Name of the case that a world's ``seed`` draws."""
    return family.case[int(_which(np.uint64(seed), len(family.case)))]


@kernel
def _which(seed, cases):
    return min(int(cases * rng.uniform(seed, rng.FAMILY, np.int64(0), np.int64(0))), cases - 1)


@kernel
def _sample(worlds, mask, table, speed, time, jitter):
    """Draw a case of ``table`` [cases, MOST, 2] into the rows of ``worlds`` [B] where ``mask`` [B] is true.

    speed of the own ship [m/s], time to the meeting point [s], largest deviation of the own heading [rad].
    """
    for b in range(worlds.shape[0]):
        if not mask[b]:
            continue
        w = worlds[b]
        v = w.vessels
        way = speed * time
        case = min(int(between(w, 0, 0, 0.0, 1.0) * table.shape[0]), table.shape[0] - 1)
        put_own_ship(w, -way, 0.0, 0.0, speed, 2.0 * way)
        if jitter > 0.0:
            turned = between(w, 0, 1, -jitter, jitter)
            s, c = sincos(turned)
            v.eta[0, 2] = v.heading_set[0] = turned
            v.velocity[0, 0], v.velocity[0, 1] = speed * c, speed * s
        for k in range(table.shape[1]):
            ratio = table[case, k, 1]
            if ratio == 0.0:
                continue
            j = 1 + k
            s, c = sincos(table[case, k, 0])
            n, e = ratio * way * c, ratio * way * s
            put_ship(w, j, KIND_SHIP, v.length[0], v.beam[0], ratio * speed, -n, -e, 2.0 * n, 2.0 * e)
            v.ais_class[j] = AIS_CLASS_A
            v.ais_on[j] = 1
