"""The rules as reward terms: risk of collision now, and how far a vessel is from doing its duty in this step.

Reads truth, with the memory of the state machine in ``world.pairs``.  Both are 0 (all is well) to -1.
"""

from __future__ import annotations

import math

from ..jit import inner, spliced
from ..trig import atan2, clip, wrap
from ..units import DEG
from ..world.encounter import CROSSING_GIVE_WAY, CROSSING_STAND_ON, HEAD_ON, OVERTAKEN, SAFE
from .machine import advance

AHEAD_FROM, AHEAD_TO = -25.0 * DEG, 165.0 * DEG  #: contact angles of crossing ahead, as in the scores


@inner
def breach(pair, p, turn, change, passes):
    """How much the own ship breaks the rules towards one ship: 0 to 1.

    turn [rad] and change (relative) are of course and speed since the encounter began; passes: the closest point is now.
    Set A's limits: what cannot be detected is nothing, what is readily apparent is all.
    """
    to_port = clip((-turn - p.course_md) / (p.course_app - p.course_md), 0.0, 1.0)
    either = clip((abs(turn) - p.course_md) / (p.course_app - p.course_md), 0.0, 1.0)
    speed = clip((abs(change) - p.speed_md) / (p.speed_app - p.speed_md), 0.0, 1.0)
    slowed = clip((-change - p.speed_md) / (p.speed_app - p.speed_md), 0.0, 1.0)
    if pair.code == CROSSING_STAND_ON or pair.code == OVERTAKEN:  # Rule 17
        if pair.stage <= 2:
            return max(either, speed)
        return to_port if pair.stage == 4 and pair.code == CROSSING_STAND_ON and pair.beta < 0.0 else 0.0
    out = to_port if pair.code == HEAD_ON else 0.0  # Rule 14
    if pair.code == CROSSING_GIVE_WAY and passes and AHEAD_FROM < pair.alpha < AHEAD_TO:  # Rule 15
        out = 1.0
    if pair.stage >= 3 and pair.dcpa < pair.r_pref:  # Rules 8 and 16: too late for no action, and still at risk
        out = max(out, 1.0 - max(either, slowed))
    return out


@spliced
def rule_terms(w, o, p):
    """(risk, breach) of observer o's vessel, each 0 to -1: the worst over all ships.

    risk = (1 - DCPA / R_pref) (1 - range / R2) of a ship whose closest point is still to come.
    """
    own, v = w.observer[o], w.vessels
    slow = 0.25 * p.moving
    speed1 = math.hypot(v.velocity[own, 0], v.velocity[own, 1])
    course1 = atan2(v.velocity[own, 1], v.velocity[own, 0]) if speed1 > slow else v.eta[own, 2]
    risk = worst = 0.0
    for j in range(v.active.shape[0]):
        pair = w.pairs[o, j]
        if j == own or v.active[j] == 0:
            pair.code = SAFE
            pair.state = 0
            continue
        before = pair.code
        speed2 = math.hypot(v.velocity[j, 0], v.velocity[j, 1])
        course2 = atan2(v.velocity[j, 1], v.velocity[j, 0]) if speed2 > slow else v.eta[j, 2]
        advance(pair, p, v.eta[own, 0], v.eta[own, 1], v.velocity[own, 0], v.velocity[own, 1], course1, v.length[own],
                v.eta[j, 0], v.eta[j, 1], v.velocity[j, 0], v.velocity[j, 1], course2, v.length[j])  # fmt: skip
        if pair.code == SAFE:
            continue
        if before == SAFE:
            pair.course, pair.speed, pair.passed = course1, speed1, 0
        passes = pair.tcpa <= 0.0 and pair.passed == 0
        if pair.passed == 0:
            worst = max(worst, breach(pair, p, wrap(course1 - pair.course), speed1 / max(pair.speed, 1.0e-3) - 1.0, passes))
        if pair.tcpa > 0.0:
            risk = max(risk, max(1.0 - pair.dcpa / pair.r_pref, 0.0) * max(1.0 - pair.range / pair.r2, 0.0))
        if passes:
            pair.passed = 1
    return -risk, -worst
