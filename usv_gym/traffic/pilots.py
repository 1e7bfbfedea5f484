"""Ships that leave their route for reasons of their own: hostile ones and erratic leisure boats; and who calls whom.

``steer`` (traffic/ships.py) asks here only for ships that have such a behaviour; a sea without them pays one comparison per
ship.
"""

from __future__ import annotations

import math

import numpy as np

from .. import rng
from ..jit import inner
from ..trig import atan2, clip, sincos, wrap
from ..world.state import BEHAVIOUR_COLREGS, BEHAVIOUR_HOSTILE
from .colregs import obey

CROSSED = 20.0  #: [s] that a hostile ship sails on after it has crossed
HOMEWARD, SLOWING = 0.6, 0.8  #: shares of its bound at which an erratic boat turns back, and slackens speed
BRAKING = 5.0  #: [s] in which an erratic boat that heads outward would reach its bound, at least


@inner
def pilot(w, j, wanted, speed, seconds):
    """Heading [rad] and speed [m/s] of the ship in slot j for a frame, whose route asks for ``wanted`` and ``speed``."""
    r = w.routes
    if r.done[j] and r.count[j] > 1:  # its route is done: the last leg goes on
        last = r.count[j] - 1
        wanted = atan2(r.waypoint[j, last, 1] - r.waypoint[j, last - 1, 1], r.waypoint[j, last, 0] - r.waypoint[j, last - 1, 0])
    if w.vessels.behaviour[j] == BEHAVIOUR_COLREGS:
        return obey(w, j, wanted, speed, seconds)
    if w.vessels.behaviour[j] == BEHAVIOUR_HOSTILE:
        return _cross_ahead(w, j, wanted, speed), speed
    return _wander(w, j, seconds)


# --- hostile ---------------------------------------------------------------------------------------------------------
@inner
def _intercept(dn, de, vn, ve, speed):
    """Course [rad] that meets a point at (dn, de) [m] that moves at (vn, ve) [m/s]; towards it if it is too fast."""
    a = vn * vn + ve * ve - speed * speed
    b = dn * vn + de * ve
    c = dn * dn + de * de
    t = math.sqrt(c) / max(speed, 1.0e-6)
    root = b * b - a * c
    if abs(a) < 1.0e-9:
        if b < 0.0:
            t = -0.5 * c / b
    elif root >= 0.0:
        root = math.sqrt(root)
        low, high = min((-b - root) / a, (-b + root) / a), max((-b - root) / a, (-b + root) / a)
        if high > 0.0:
            t = low if low > 0.0 else high
    return atan2(de + ve * t, dn + vn * t)


@inner
def _cross_ahead(w, j, wanted, speed):
    """Heading [rad] of the hostile ship in slot j: its route, the water ahead of its target's bow, on, its route."""
    p, v = w.pilots, w.vessels
    k = p.target[j]
    if p.phase[j] == 3 or v.active[k] == 0:
        return wanted
    if p.phase[j] == 2:
        if w.tick < p.next_tick[j]:
            return p.course[j]
        p.phase[j] = 3
        return wanted
    s, c = sincos(v.eta[k, 2])
    dn, de = v.eta[k, 0] - v.eta[j, 0], v.eta[k, 1] - v.eta[j, 1]
    x, y = -(c * dn + s * de), s * dn - c * de  # of the hostile ship, ahead and to starboard of the target
    side = 1 if y >= 0.0 else -1
    if p.phase[j] == 0:
        if dn * dn + de * de > p.range[j] * p.range[j]:
            return wanted
        p.phase[j] = 1
        p.role[j, 0] = side
    elif side != p.role[j, 0] and x > 0.0:
        p.phase[j] = 2
        p.course[j] = v.eta[j, 2]
        p.next_tick[j] = w.tick + np.int64(CROSSED / w.dt + 0.5)
        return p.course[j]
    lead = p.ahead[j] + 0.5 * v.length[k]
    return _intercept(dn + lead * c, de + lead * s, v.velocity[k, 0], v.velocity[k, 1], speed)


# --- erratic ---------------------------------------------------------------------------------------------------------
@inner
def _off_route(w, j):
    """(distance [m], N, E) from the ship in slot j to the nearest point of its route."""
    r = w.routes
    n, e = w.vessels.eta[j, 0], w.vessels.eta[j, 1]
    best, best_n, best_e = math.inf, n, e
    for k in range(1, r.count[j]):
        n0, e0 = r.waypoint[j, k - 1, 0], r.waypoint[j, k - 1, 1]
        dn, de = r.waypoint[j, k, 0] - n0, r.waypoint[j, k, 1] - e0
        length2 = dn * dn + de * de
        t = clip(((n - n0) * dn + (e - e0) * de) / length2, 0.0, 1.0) if length2 > 0.0 else 0.0
        pn, pe = n0 + t * dn, e0 + t * de
        d2 = (n - pn) * (n - pn) + (e - pe) * (e - pe)
        if d2 < best:
            best, best_n, best_e = d2, pn, pe
    return math.sqrt(best), best_n, best_e


@inner
def _wander(w, j, seconds):
    """Heading [rad] and speed [m/s] of the erratic boat in slot j.

    Within HOMEWARD of its bound it follows its whim; beyond it heads back; and beyond SLOWING it makes so little speed outward
    that it cannot pass the bound: the distance to a route grows no faster than the boat sails.
    """
    p, v, r = w.pilots, w.vessels, w.routes
    if w.tick >= p.next_tick[j]:
        first = 3 * j
        p.course[j] = p.alteration[j] * (2.0 * rng.uniform(w.seed, rng.WHIM, first, w.tick) - 1.0)
        u = rng.uniform(w.seed, rng.WHIM, first + 1, w.tick)
        p.factor[j] = 0.1 if u < 0.15 else 0.3 + u  # drifts for a while, or up to 1.3 times its speed
        wait = p.period_us[j] * (0.5 + rng.uniform(w.seed, rng.WHIM, first + 2, w.tick))
        p.next_tick[j] = w.tick + max(int(wait) // w.dt_us, 1)
    if r.done[j] or r.leg[j] >= r.count[j]:  # a leisure boat does not arrive: the same again, the other way first
        r.done[j] = 0
        r.leg[j] = 0
    k = r.leg[j]
    wanted = atan2(r.waypoint[j, k, 1] - v.eta[j, 1], r.waypoint[j, k, 0] - v.eta[j, 0]) + p.course[j]
    change = p.acceleration[j] * seconds
    speed = v.nu[j, 0] + clip(p.factor[j] * v.speed[j] - v.nu[j, 0], -change, change)
    off, n, e = _off_route(w, j)
    if off > HOMEWARD * p.wander[j]:
        home = atan2(e - v.eta[j, 1], n - v.eta[j, 0])
        wanted = home + 0.2 * p.course[j]
        _, inward = sincos(wrap(v.eta[j, 2] - home))
        if off > SLOWING * p.wander[j] and inward < 0.5:
            speed = min(speed, max(p.wander[j] - off, 0.0) / max(BRAKING, 2.0 * seconds))
    return wanted, speed
