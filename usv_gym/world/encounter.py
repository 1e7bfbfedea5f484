"""Encounter geometry of two vessels: closest point of approach, bearings, and which COLREGs situation it is.

One place for what behaviours, scores, samplers and views mean by "crossing".  Bearings are clockwise: beta, where the target
bears from the own bow (relative bearing), and alpha, where the own ship bears from the target's bow (contact angle).

The sectors are those of Hagen, Vassbotn, Skogvold, Johansen and Brekke (2023, Ocean Engineering,
doi 10.1016/j.oceaneng.2023.115991): an encounter is classified once, as it begins; who keeps track of it over time is
``usv_gym.colregs``.
"""

from __future__ import annotations

import enum
import math

from ..jit import inner, kernel
from ..trig import atan2, wrap
from ..units import DEG


class Encounter(enum.IntEnum):
    """What two vessels are to each other, as the own ship sees it; values are the codes of the kernels."""

    SAFE = 0  #: no risk of collision, or no rule of 13 to 15 applies
    HEAD_ON = 1
    CROSSING_GIVE_WAY = 2
    CROSSING_STAND_ON = 3
    OVERTAKING = 4
    OVERTAKEN = 5


SAFE, HEAD_ON, CROSSING_GIVE_WAY, CROSSING_STAND_ON, OVERTAKING, OVERTAKEN = (int(code) for code in Encounter)

HEAD_ON_SECTOR = 13.0 * DEG  #: |alpha| and |beta| of a head-on encounter
CROSSING_ASPECT = 10.0 * DEG  #: from here on a vessel on the bow crosses
OVERTAKING_ASPECT = 45.0 * DEG  #: of the overtaken vessel off the bow of the overtaking one
STERN_SECTOR = 112.5 * DEG  #: abaft this is "more than 22.5 deg abaft the beam" (Rule 13 b)
HEAD_ON_COURSES = 154.0 * DEG  #: least difference of the courses (reciprocal to within 26 deg)


@inner
def cpa(dn, de, dvn, dve):
    """Distance [m] and time [s] of the closest point of approach.

    (dn, de) is the other's position and (dvn, dve) its velocity, relative to one's own.  The time is negative when the closest
    point has been passed; with no relative motion it is 0 and the distance is the present one.
    """
    speed2 = dvn * dvn + dve * dve
    tcpa = -(dn * dvn + de * dve) / speed2 if speed2 > 1.0e-12 else 0.0
    return math.hypot(dn + tcpa * dvn, de + tcpa * dve), tcpa


@inner
def bearings(n1, e1, course1, n2, e2, course2):
    """(alpha, beta) in (-pi, pi]: contact angle and relative bearing of vessel 2 seen from vessel 1."""
    line = atan2(e2 - e1, n2 - n1)
    return wrap(line + math.pi - course2), wrap(line - course1)


@inner
def situation(alpha, beta, course_difference, speed1, speed2):
    """Code of the encounter for contact angle, relative bearing, course2 - course1 [rad] and speeds [m/s].

    The order decides where sectors meet: overtaking before head-on before crossing (Rule 13 applies notwithstanding the
    others).
    """
    if abs(alpha) > STERN_SECTOR and abs(beta) < OVERTAKING_ASPECT and speed1 > speed2:
        return OVERTAKING
    if abs(beta) > STERN_SECTOR and abs(alpha) < OVERTAKING_ASPECT and speed2 > speed1:
        return OVERTAKEN
    if abs(alpha) <= HEAD_ON_SECTOR and abs(beta) <= HEAD_ON_SECTOR and abs(wrap(course_difference)) >= HEAD_ON_COURSES:
        return HEAD_ON
    if CROSSING_ASPECT < beta <= STERN_SECTOR and -STERN_SECTOR <= alpha < -CROSSING_ASPECT:
        return CROSSING_GIVE_WAY
    if -STERN_SECTOR <= beta < -CROSSING_ASPECT and CROSSING_ASPECT < alpha <= STERN_SECTOR:
        return CROSSING_STAND_ON
    return SAFE


@inner
def encounter(n1, e1, vn1, ve1, n2, e2, vn2, ve2):
    """(code, dcpa [m], tcpa [s]) of vessel 1 towards vessel 2, from positions [m] and velocities over ground [m/s] {n}.

    Geometry alone: the code is SAFE once the closest point has been passed; whether the distance is of concern is for the
    caller to say.
    """
    distance, time = cpa(n2 - n1, e2 - e1, vn2 - vn1, ve2 - ve1)
    if time <= 0.0:
        return SAFE, distance, time
    course1, course2 = atan2(ve1, vn1), atan2(ve2, vn2)
    alpha, beta = bearings(n1, e1, course1, n2, e2, course2)
    code = situation(alpha, beta, course2 - course1, math.hypot(vn1, ve1), math.hypot(vn2, ve2))
    return code, distance, time


@kernel
def encounters(own, others, codes, distances, times):
    """Encounters of each own ship with each other vessel.

    own [n, 4] and others [n, m, 4] are N, E [m], vN, vE [m/s] {n}; codes, distances [m] and times [s] [n, m] are written.
    """
    for i in range(others.shape[0]):
        for j in range(others.shape[1]):
            a, b = own[i], others[i, j]
            codes[i, j], distances[i, j], times[i, j] = encounter(a[0], a[1], a[2], a[3], b[0], b[1], b[2], b[3])
