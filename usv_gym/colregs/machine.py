"""What two vessels are to each other over time: a state machine with memory, one small record (``pair_dtype``) per pair.

An encounter begins at the first sample in which both are under way, nearer than R2, with the closest point ahead of them and
nearer than R_pref (risk of collision, Rule 7), in one of the sectors of Rules 13 to 15.  Its class is then locked, whatever
the vessels do (Rule 13 d), until they are further apart than 1.05 R2: that is the hysteresis.  (Set A; the states are those
of Eriksen et al. 2020, Frontiers in Robotics and AI 7:11.)
"""

from __future__ import annotations

import math

from ..jit import inner
from ..trig import sincos
from ..world.encounter import CROSSING_GIVE_WAY, HEAD_ON, OVERTAKING, SAFE, bearings, cpa, situation

#: states, as in the literature: safe, overtaking, head-on, give-way, stand-on (also: being overtaken), emergency
SF, OT, HO, GW, SO, EM = range(6)
STATES = ("SF", "OT", "HO", "GW", "SO", "EM")


@inner
def size_factor(p, length1, length2):
    """k_size of a pair of lengths [m]."""
    return 0.5 * (length1 + length2) / p.reference_length if p.scaled else 1.0


@inner
def duty(code):
    """State that a class of encounter puts the own ship into."""
    if code == HEAD_ON:
        return HO
    if code == CROSSING_GIVE_WAY:
        return GW
    if code == OVERTAKING:
        return OT
    return SF if code == SAFE else SO


@inner
def advance(pair, p, n1, e1, vn1, ve1, course1, length1, n2, e2, vn2, ve2, course2, length2):
    """Bring a pair to the present: own ship 1 and target 2 by position [m], velocity [m/s], course [rad] {n}, length [m].

    Courses are given, because that of a vessel that hardly moves is for the caller to hold.
    """
    pair.range = math.hypot(n2 - n1, e2 - e1)
    pair.dcpa, pair.tcpa = cpa(n2 - n1, e2 - e1, vn2 - vn1, ve2 - ve1)
    pair.alpha, pair.beta = bearings(n1, e1, course1, n2, e2, course2)
    if pair.code != SAFE and pair.range > p.exit_factor * pair.r2:
        pair.code = SAFE
    if pair.code == SAFE:
        k = size_factor(p, length1, length2)
        closing = math.hypot(vn2 - vn1, ve2 - ve1) / p.reference_speed
        stages = max(k, closing) if p.scaled else 1.0
        pair.size = k
        pair.r2, pair.r3, pair.r4, pair.r_pref = stages * p.r2, stages * p.r3, stages * p.r4, k * p.r_pref
        speed1, speed2 = math.hypot(vn1, ve1), math.hypot(vn2, ve2)
        under_way = min(speed1, speed2) > p.moving * (math.sqrt(min(k, 1.0)))
        if under_way and pair.range <= pair.r2 and pair.tcpa > 0.0 and pair.dcpa <= pair.r_pref:
            pair.code = situation(pair.alpha, pair.beta, course2 - course1, speed1, speed2)
    pair.stage = 4 if pair.range <= pair.r4 else (3 if pair.range <= pair.r3 else (2 if pair.range <= pair.r2 else 1))
    emergency = pair.state == EM or (pair.stage == 4 and pair.tcpa <= p.emergency_tcpa)
    pair.state = duty(pair.code)
    if (pair.state == GW or pair.state == HO) and emergency and pair.tcpa > 0.0:
        pair.state = EM


@inner
def domain_ratio(n1, e1, n2, e2, course2, length2):
    """Where vessel 1 is in the ship domain of vessel 2: 1 on its border, less inside.

    The ellipse of Fujii and Tanaka (1971, Journal of Navigation 24:4): semi-axes of 4 and 1.6 lengths, along and across.
    """
    s, c = sincos(course2)
    along = ((n1 - n2) * c + (e1 - e2) * s) / (4.0 * length2)
    across = ((e1 - e2) * c - (n1 - n2) * s) / (1.6 * length2)
    return math.sqrt(along * along + across * across)
