"""Encounters of wanted classes as a family: the geometry is solved, not searched for.

Of a ship are drawn: distance d and time T of the closest point (CPA), its bearing beta off the own bow at the start, its
speed as a multiple k of the own speed U, and on which side it passes.  With w the relative speed, the ship starts at range
R = sqrt((w T)^2 + d^2), and the relative motion is a = atan2(d, w T) off the line between the two.  That its speed be k U
asks for

    w^2 - 2 U w cos(beta - s a(w)) + (1 - k^2) U^2 = 0,     s = +-1 the side,

which Newton's method solves from its roots for d = 0, w = U (cos beta +- sqrt(k^2 - sin^2 beta)).  Of the draws, those are kept
that are the wanted class by ``world/encounter.py``, and clear of the other ships on their way.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...config import ConfigError
from ...jit import inner, kernel, spliced
from ...trig import PI, atan2, sincos
from ...units import DEG
from ...world.encounter import Encounter, cpa, encounter
from ...world.state import AIS_CLASS_A, AIS_CLASS_B, AIS_NONE, KIND_BOAT, KIND_SHIP, KIND_VESSEL
from ...world.vessel import VesselModel
from ..family_schema import MOST_SHIPS, RATIOS, SECTORS, Encounters
from ..schema import Scenario
from .common import between, put_own_ship, put_ship

ATTEMPTS, ROUNDS = 200, 40  #: draws of a ship before all are drawn anew, and how often
NEWTON = 12  #: steps; quadratic, so far more than it takes

#: what was asked for, per ship: class (Encounter), dcpa [m], tcpa [s], bearing [rad], speed ratio
ASKED = np.dtype([("code", "i8"), ("dcpa", "f8"), ("tcpa", "f8"), ("bearing", "f8"), ("ratio", "f8")], align=True)
WISHES = np.dtype([
    ("codes", "i8", (MOST_SHIPS,)), ("n_codes", "i8"), ("exactly", "i1"),  # classes to draw from, or to have
    ("ships", "i8", (2,)),  # least and most; 0: by difficulty
    ("dcpa", "f8", (2,)), ("tcpa", "f8", (2,)),  # [m] (NaN: by difficulty), [s]
    ("bearing", "f8", (len(Encounter), 2)), ("ratio", "f8", (len(Encounter), 2)),  # [rad] off the bow, [-], by class
], align=True)  # fmt: skip


def wishes(family: Encounters, model: VesselModel) -> NDArray[Any]:
    """What a family asks for, as the record [1] that the kernel reads."""
    result = np.zeros(1, WISHES)
    row = result[0]
    names = family.together or family.classes
    row["codes"][: len(names)] = [Encounter[name.upper()] for name in names]
    row["n_codes"], row["exactly"] = len(names), bool(family.together)
    row["ships"] = family.ships or (0, 0)
    row["dcpa"] = family.dcpa or (math.nan, math.nan)
    row["tcpa"] = family.times(model)
    for name, sector in SECTORS.items():
        code = Encounter[name.upper()]
        row["bearing"][code] = np.multiply(family.bearing_deg or sector, DEG)
        row["ratio"][code] = family.speed_ratio or RATIOS[name]
    return result


def sample(worlds: Any, mask: Any, difficulty: Any, model: VesselModel, scenario: Scenario) -> None:
    """Draw encounters into the rows of ``mask`` [B]; see :class:`~usv_gym.scenarios.families.FamilySpec`."""
    draw(worlds, mask, difficulty, model, scenario)


def draw(worlds: Any, mask: Any, difficulty: Any, model: VesselModel, scenario: Scenario) -> NDArray[Any]:
    """Like ``sample``; returns what was asked of the ships, [B, MOST_SHIPS] of ``ASKED``, code 0 where there is none.

    Raises
    ------
    ConfigError
        if there are no such ships: the ranges contradict each other, or crowd the ships.
    """
    family = scenario.family
    assert isinstance(family, Encounters)
    asked = np.zeros((len(worlds), MOST_SHIPS), ASKED)
    missing = _sample(worlds, mask, difficulty, wishes(family, model), model.cruise_speed, asked)
    if missing >= 0:
        name = Encounter(missing).name.lower()
        raise ConfigError(
            f"family encounter: no {name} found in {ATTEMPTS * ROUNDS} draws with these dcpa, tcpa, bearing_deg, speed_ratio "
            "and clear of the other ships"
        )
    return asked


@inner
def relative_speed(root, bearing, ratio, side, dcpa, tcpa, speed):
    """Speed w [m/s] of the relative motion (the module's docstring); NaN if there is none.  root +1 or -1."""
    s, c = sincos(bearing)
    square = ratio * ratio - s * s
    if square < 0.0:
        return math.nan
    w = speed * (c + root * math.sqrt(square))
    for _ in range(NEWTON):
        if not w > 1.0e-3 * speed:
            return math.nan
        wt = w * tcpa
        sa, ca = sincos(bearing - side * atan2(dcpa, wt))
        value = w * w - 2.0 * speed * w * ca + (1.0 - ratio * ratio) * speed * speed
        # a = atan(d / (w T)) has the slope -d T / ((w T)^2 + d^2)
        turning = dcpa * tcpa / (wt * wt + dcpa * dcpa)
        slope = 2.0 * w - 2.0 * speed * ca + 2.0 * speed * w * side * turning * sa
        if slope == 0.0:
            return math.nan
        w -= value / slope
    return w


@inner
def _place(w, j, wish, code, slot, attempt, speed, difficulty, asked):
    """Try to put a ship of class ``code`` into slot j; True if it fits."""
    v = w.vessels
    base = 16 * attempt
    course = v.eta[0, 2]
    # what it is: its size goes by the own ship's
    length = min(max(v.length[0] * math.exp(between(w, slot, base, math.log(0.5), math.log(8.0))), 2.0), 300.0)
    kind = KIND_SHIP if length > 50.0 else (KIND_VESSEL if length > 15.0 else KIND_BOAT)
    low, high = wish.dcpa[0], wish.dcpa[1]
    if not low >= 0.0:
        low, high = 0.0, (2.0 - 1.5 * difficulty) * (v.length[0] + length)
    dcpa = between(w, slot, base + 1, low, high)
    tcpa = between(w, slot, base + 2, wish.tcpa[0], wish.tcpa[1])
    bearing = between(w, slot, base + 3, wish.bearing[code, 0], wish.bearing[code, 1])
    ratio = between(w, slot, base + 4, wish.ratio[code, 0], wish.ratio[code, 1])
    side = 1.0 if between(w, slot, base + 5, 0.0, 1.0) < 0.5 else -1.0
    root = 1.0 if between(w, slot, base + 6, 0.0, 1.0) < 0.5 else -1.0
    if ratio > 1.0:
        root = 1.0  # the other is negative
    relative = relative_speed(root, bearing, ratio, side, dcpa, tcpa, speed)
    if not relative > 0.0:
        return False
    away = relative * tcpa
    distance = math.hypot(away, dcpa)
    s, c = sincos(course + bearing)
    n, e = v.eta[0, 0] + distance * c, v.eta[0, 1] + distance * s
    s, c = sincos(course + bearing + PI - side * atan2(dcpa, away))
    so, co = sincos(course)
    vn, ve = speed * co + relative * c, speed * so + relative * s
    found, d, t = encounter(v.eta[0, 0], v.eta[0, 1], speed * co, speed * so, n, e, vn, ve)
    if found != code or abs(d - dcpa) > 1.0e-6 * (1.0 + distance) or abs(t - tcpa) > 1.0e-6 * tcpa:
        return False
    if abs(math.hypot(vn, ve) - ratio * speed) > 1.0e-9 * speed:
        return False  # next to a double root, where Newton's method is slow
    if distance < 2.0 * (v.length[0] + length):
        return False  # on top of each other already
    for i in range(1, j):  # clear of the others until all closest points are past
        vn2, ve2 = v.velocity[i, 0], v.velocity[i, 1]
        dn, de = v.eta[i, 0] - n, v.eta[i, 1] - e
        _, when = cpa(dn, de, vn2 - vn, ve2 - ve)
        when = min(max(when, 0.0), 1.25 * wish.tcpa[1])
        if math.hypot(dn + when * (vn2 - vn), de + when * (ve2 - ve)) < 0.5 * (length + v.length[i]) + v.length[0]:
            return False
    far = 3.0 * wish.tcpa[1]
    put_ship(w, j, kind, length, length / 6.0 if kind != KIND_BOAT else length / 3.0, math.hypot(vn, ve), n, e,
             n + far * vn, e + far * ve)  # fmt: skip
    silent = kind == KIND_BOAT and between(w, slot, base + 7, 0.0, 1.0) < 0.5
    v.ais_class[j] = AIS_NONE if silent else (AIS_CLASS_B if kind == KIND_BOAT else AIS_CLASS_A)
    v.ais_on[j] = not silent
    asked.code, asked.dcpa, asked.tcpa, asked.bearing, asked.ratio = code, dcpa, tcpa, bearing, ratio
    return True


@spliced
def draw_encounters(w, wish, difficulty, speed, asked):
    """Draw own course and ships into a template, from ``w.seed``; returns the class that could not be had, or -1."""
    count = wish.n_codes
    if not wish.exactly:
        low, high = wish.ships[0], wish.ships[1]
        if low == 0:
            low, high = 1, 1 + int(3.0 * difficulty + 0.5)
        count = min(low + int(between(w, 0, 1, 0.0, 1.0) * (high - low + 1)), high)
    put_own_ship(w, w.vessels.eta[0, 0], w.vessels.eta[0, 1], between(w, 0, 0, -PI, PI), speed, 1.6 * speed * wish.tcpa[1])
    code = -1
    for turn in range(ROUNDS):
        placed = 0
        for k in range(count):
            code = wish.codes[k]
            if not wish.exactly:
                code = wish.codes[int(between(w, 0, 2 + MOST_SHIPS * turn + k, 0.0, 1.0) * wish.n_codes)]
            for attempt in range(ATTEMPTS):
                if _place(w, 1 + k, wish, code, 200 + MOST_SHIPS * turn + k, attempt, speed, difficulty, asked[k]):
                    placed += 1
                    break
            if placed <= k:
                break
        if placed == count:
            return -1
    return code


@kernel
def _sample(worlds, mask, difficulty, wish, speed, asked):
    """Draw into the rows of ``worlds`` [B] where ``mask`` [B] is true; asked [B, MOST_SHIPS] is written.

    difficulty [B], wish [1] of ``WISHES``, speed of the own ship [m/s].  Returns the class of a ship that could not be had, or
    -1.
    """
    missing = -1
    for b in range(worlds.shape[0]):
        if mask[b]:
            code = draw_encounters(worlds[b], wish[0], difficulty[b], speed, asked[b])
            if code >= 0:
                missing = code
    return missing
