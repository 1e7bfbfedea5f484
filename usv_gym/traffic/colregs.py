"""A ship that obeys the COLREGs: gives way early and to starboard, stands on, acts in extremis, returns to its route.

Every ``period_us`` it looks around, as a bridge does by eye and radar: at the true positions and velocities of the vessels
within its range.  What it is to another vessel (``world/encounter.py``) is decided once, as risk of collision arises, and
remembered until that vessel is past and clear.  Action:

- who gives way (Rules 13 to 16) alters course by the smallest readily apparent angle (Rule 8 b) that clears all vessels in
  range, to starboard except when overtaking; where no course does, or it would be led far off its route, it slackens speed
  or stops (Rule 8 e);
- who stands on (Rule 17) keeps course and speed until the other's inaction leaves ``extremis_time``; then it acts too, not to
  port for a vessel on its port side (Rule 17 c).

It resumes its route when that is clear by a quarter more than its clearance.  Obstacles, land and narrow channels do not
concern it: it is for the route to keep clear of them.
"""

from __future__ import annotations

import math

from ..jit import inner
from ..trig import PI, atan2, clip, sincos, wrap
from ..units import DEG
from ..world.encounter import (
    CROSSING_GIVE_WAY,
    CROSSING_STAND_ON,
    HEAD_ON,
    OVERTAKEN,
    OVERTAKING,
    SAFE,
    STERN_SECTOR,
    bearings,
    cpa,
    situation,
)

STEP = 15.0 * DEG  #: between the courses that are tried, up to a right angle
ANCHORED = 0.25  #: [m/s] below which another vessel counts as one at rest, which has no rights of way
EARLY = 2.0  #: an encounter begins at so many times act_time and clearance, before action is due
RESUME = 1.25  #: clearance at which the route is taken up again, in those that make it evade
NEAR, VERY_NEAR = 2.5, 1.25  #: safe distances at which it gives way, and acts as stand-on, however slowly they close
PATIENCE = 3.0  #: times act_time that it evades before it rather stops
IN_DOUBT = 0.5  #: share of the clearance below which a stand-on ship does not trust the other's manoeuvre


@inner
def _safe(w, j, k):
    """Distance of the centres [m] at which the ship in slot j is content with vessel k."""
    v = w.vessels
    return w.pilots.clearance[j] + 0.5 * (v.length[j] + v.length[k])


@inner
def _approach(w, j, k, vn, ve, delay):
    """(DCPA, TCPA) of vessel k if the ship in slot j sails at (vn, ve) [m/s] after a turn that takes ``delay`` [s]."""
    v = w.vessels
    half = 0.5 * delay
    dn = v.eta[k, 0] - v.eta[j, 0] - (v.velocity[j, 0] - vn) * half
    de = v.eta[k, 1] - v.eta[j, 1] - (v.velocity[j, 1] - ve) * half
    return cpa(dn, de, v.velocity[k, 0] - vn, v.velocity[k, 1] - ve)


@inner
def _role(w, j, k, base, speed):
    """What the ship in slot j, on its route, is to vessel k as risk of collision arises: never SAFE."""
    v = w.vessels
    other = math.hypot(v.velocity[k, 0], v.velocity[k, 1])
    if other < ANCHORED:
        return OVERTAKING  # keep clear of it, on either side
    course = atan2(v.velocity[k, 1], v.velocity[k, 0])
    alpha, beta = bearings(v.eta[j, 0], v.eta[j, 1], base, v.eta[k, 0], v.eta[k, 1], course)
    code = situation(alpha, beta, course - base, speed, other)
    if code != SAFE:
        return code
    if abs(beta) > STERN_SECTOR:
        return OVERTAKEN
    if abs(alpha) > STERN_SECTOR:
        return OVERTAKING
    if abs(beta) < STEP:
        return HEAD_ON  # in doubt whether it is one, it is one (Rule 14 c)
    return CROSSING_GIVE_WAY if beta > 0.0 else CROSSING_STAND_ON


@inner
def _remember(w, j, base, vn, ve, speed):
    """Note who is in range in ``w.order`` and keep the encounters of slot j up to date; returns how many are in range."""
    p, v = w.pilots, w.vessels
    reach2 = p.range[j] * p.range[j]
    early = EARLY * p.act_time[j]
    for i in range(p.role.shape[1]):
        if p.role[j, i] == SAFE:
            continue
        k = p.met[j, i]
        d, t = _approach(w, j, k, vn, ve, 0.0)
        dn, de = v.eta[k, 0] - v.eta[j, 0], v.eta[k, 1] - v.eta[j, 1]
        if v.active[k] == 0 or t <= 0.0 or d > 2.0 * EARLY * _safe(w, j, k) or dn * dn + de * de > 1.5 * reach2:
            p.role[j, i] = SAFE
    count = 0
    for k in range(v.active.shape[0]):
        if v.active[k] == 0 or k == j:
            continue
        dn, de = v.eta[k, 0] - v.eta[j, 0], v.eta[k, 1] - v.eta[j, 1]
        if dn * dn + de * de > reach2:
            continue
        w.order[count] = k
        count += 1
        d, t = _approach(w, j, k, vn, ve, 0.0)
        safe = _safe(w, j, k)
        near2 = (EARLY * NEAR * safe) ** 2
        if t <= 0.0 or d >= EARLY * safe or (t >= early and dn * dn + de * de >= near2):
            continue
        slot, last = -1, t  # a free place, else that of the encounter that is furthest ahead in time
        known = False
        for i in range(p.role.shape[1]):
            if p.role[j, i] == SAFE:
                if slot < 0 or p.role[j, slot] != SAFE:
                    slot = i
            elif p.met[j, i] == k:
                known = True
            elif slot < 0 or p.role[j, slot] != SAFE:
                _, later = _approach(w, j, p.met[j, i], vn, ve, 0.0)
                if later > last:
                    slot, last = i, later
        if not known and slot >= 0:
            p.met[j, slot] = k
            p.role[j, slot] = _role(w, j, k, base, speed)
    return count


@inner
def _room(w, j, count, course, speed):
    """Least ratio of DCPA to safe distance over the vessels in range, if the ship in slot j turned to a course now."""
    v, p = w.vessels, w.pilots
    s, c = sincos(course)
    turn = abs(wrap(course - v.eta[j, 2]))
    delay = v.turn_time[j] + turn / max(v.turn_rate_max[j], 1.0e-6) if turn > DEG else 0.0
    room = math.inf
    for i in range(count):
        k = w.order[i]
        d, t = _approach(w, j, k, speed * c, speed * s, delay)
        if 0.0 < t < EARLY * p.act_time[j]:
            room = min(room, d / _safe(w, j, k))
    return room


@inner
def _must_act(w, j, vn, ve):
    """(whether the ship in slot j may not keep to its route, whether it may also turn to port)."""
    p, v = w.pilots, w.vessels
    margin = RESUME if p.phase[j] else 1.0
    act = False
    to_port = True
    for i in range(p.role.shape[1]):
        role = p.role[j, i]
        if role == SAFE:
            continue
        k = p.met[j, i]
        d, t = _approach(w, j, k, vn, ve, 0.0)
        safe = margin * _safe(w, j, k)
        if t <= 0.0 or d >= safe:
            continue
        apart = math.hypot(v.eta[k, 0] - v.eta[j, 0], v.eta[k, 1] - v.eta[j, 1])
        if role in (CROSSING_STAND_ON, OVERTAKEN):
            if t >= margin * p.extremis_time[j] and apart >= VERY_NEAR * safe:
                continue
            if d >= IN_DOUBT * safe and p.phase[j] == 0:
                continue
            bearing = wrap(atan2(v.eta[k, 1] - v.eta[j, 1], v.eta[k, 0] - v.eta[j, 0]) - v.eta[j, 2])
            to_port = to_port and role == OVERTAKEN and bearing > 0.0
        else:
            if t >= margin * p.act_time[j] and apart >= NEAR * safe:
                continue
            to_port = to_port and role == OVERTAKING
        act = True
    return act, to_port


@inner
def _look(w, j, base, speed):
    """Look around and decide: the route, or a course and a share of the speed until the next look."""
    p = w.pilots
    s, c = sincos(base)
    vn, ve = speed * c, speed * s
    count = _remember(w, j, base, vn, ve, speed)
    act, to_port = _must_act(w, j, vn, ve)
    if not act:
        p.phase[j] = 0
        p.factor[j] = 1.0
        return
    if p.phase[j] == 0:
        p.since[j] = w.tick
    elif (w.tick - p.since[j]) * w.dt > PATIENCE * p.act_time[j]:
        p.factor[j] = 0.0  # evading did not help, since the other sails along: let it go ahead
        return
    if p.phase[j] and _room(w, j, count, p.course[j], speed * p.factor[j]) >= 1.0:
        return  # what it does will do
    best, best_course, best_factor = -1.0, base, 1.0
    for slower in range(3):
        factor = 1.0 - 0.5 * slower
        angle = p.alteration[j]
        while angle <= 0.5 * PI + 1.0e-9:
            for side in range(2 if to_port else 1):
                course = base + angle if side == 0 else base - angle
                room = _room(w, j, count, course, factor * speed)
                if room > best + 1.0e-9:
                    best, best_course, best_factor = room, course, factor
                if room >= 1.0:
                    break
            if best >= 1.0:
                break
            angle += STEP
        if best >= 1.0:
            break
    p.phase[j] = 1
    p.course[j] = best_course
    p.factor[j] = best_factor


@inner
def obey(w, j, base, speed, seconds):
    """Course [rad] and speed [m/s] of the COLREGs-obeying ship in slot j whose route asks for these."""
    p, v = w.pilots, w.vessels
    if speed <= 0.0:
        return base, speed
    if w.tick >= p.next_tick[j]:
        p.next_tick[j] = w.tick + max(p.period_us[j] // w.dt_us, 1)
        _look(w, j, base, speed)
    if p.phase[j]:
        base = p.course[j]
    change = p.acceleration[j] * seconds
    return base, v.nu[j, 0] + clip(p.factor[j] * speed - v.nu[j, 0], -change, change)
