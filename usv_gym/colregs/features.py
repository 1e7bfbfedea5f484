"""From a trajectory to its encounters: what happened in each, in numbers that the scores are made of.

One pass over time per pair.  Extremes are those between the start of the encounter and its closest point (CPA): whenever a new
closest point is found, what was seen so far is kept.
"""

from __future__ import annotations

import functools
import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..jit import inner, kernel, spliced
from ..trig import atan2, sincos, wrap
from ..world.encounter import SAFE
from ..world.geometry import CLOSE, far_distance, hull_hull, hull_vertices
from ..world.state import pair_dtype
from .machine import EM, advance, domain_ratio
from .params import Params
from .trajectory import Trajectory

START_UP = 30.0  #: [s] by then an own ship is under way
MOST = 4  #: encounters of one pair in one episode; a fifth counts as a part of the fourth


@functools.cache
def encounter_dtype() -> np.dtype[Any]:
    """dtype of one encounter of the own ship with one ship.  Angles [rad], clockwise; NaN: did not happen."""
    f8 = "f8"
    seen = [  # between start and CPA
        ("turn_starboard", f8), ("turn_port", f8), ("turn_time", f8),  # largest changes of course, >= 0; time of the larger
        ("slowed", f8), ("slowed_time", f8), ("sped", f8),  # largest relative loss of speed, >= 0; largest gain
        ("manoeuvre_time", f8), ("manoeuvre_range", f8),  # the first detectable one
        # the same from the first sample of stages 2 and 3 on, while in them: either way
        ("turn2", f8), ("turn2_time", f8), ("change2", f8), ("change2_time", f8),
        ("turn3", f8), ("turn3_time", f8), ("change3", f8), ("change3_time", f8),
        ("port4", f8), ("port4_time", f8), ("port4_side", "i1"),  # turn to port in stage 4; 1: the ship is on the port side
        ("stage3_time", f8), ("stage4_time", f8), ("emergency_time", f8),
    ]  # fmt: skip
    return np.dtype([
        ("row", "i8"), ("ship", "i8"),  # episode; vessel slot
        ("code", "i1"),  # world.encounter.Encounter
        ("complete", "i1"),  # the closest point was passed before the episode was over
        ("contact", "i1"),
        ("size", f8), ("r2", f8), ("r3", f8), ("r4", f8),  # k_size, stage ranges [m]
        ("start", f8), ("end", f8),  # [s]
        ("start_range", f8), ("start_dcpa", f8), ("start_tcpa", f8), ("start_alpha", f8), ("start_beta", f8),
        ("start_speed", f8), ("start_target_speed", f8),  # [m/s]
        ("cpa_time", f8), ("cpa_range", f8), ("cpa_alpha", f8), ("cpa_beta", f8),
        ("clearance", f8), ("clearance_time", f8),  # smallest hull distance [m]
        ("domain", f8),  # smallest place of the own ship in the other's domain: 1 on its border
        ("seen", np.dtype(seen, align=True)),
    ], align=True)  # fmt: skip


SEEN = encounter_dtype()["seen"]


@inner
def hull_clearance(hulls, n1, e1, p1, l1, b1, n2, e2, p2, l2, b2):
    """Distance of two hulls [m]: exact when near, within 2 % when far.  hulls [2, 5, 2] is work space."""
    if math.hypot(n2 - n1, e2 - e1) > 0.5 * (math.hypot(l1, b1) + math.hypot(l2, b2)) + CLOSE:
        s1, c1 = sincos(p1)
        s2, c2 = sincos(p2)
        return far_distance(n1 - n2, e1 - e2, s1, c1, l1, b1, s2, c2, l2, b2)
    hull_vertices(hulls[0], n1, e1, p1, l1, b1)
    hull_vertices(hulls[1], n2, e2, p2, l2, b2)
    return hull_hull(hulls[0], hulls[1])


@inner
def courses(velocity, eta, steps, slow, course, speed):
    """Write unwrapped course [rad] and speed [m/s] of one vessel; a vessel slower than ``slow`` keeps its course."""
    for k in range(steps):
        vn, ve = velocity[k, 0], velocity[k, 1]
        speed[k] = math.hypot(vn, ve)
        before = course[k - 1] if k > 0 else wrap(eta[0, 2])
        course[k] = before + wrap(atan2(ve, vn) - before) if speed[k] > slow else before


@spliced
def _begin(e, seen, pair, b, j, t, speed1, speed2):
    e.row, e.ship, e.code = b, j, pair.code
    e.size, e.r2, e.r3, e.r4 = pair.size, pair.r2, pair.r3, pair.r4
    e.start = e.end = t
    e.start_range, e.start_dcpa, e.start_tcpa = pair.range, pair.dcpa, pair.tcpa
    e.start_alpha, e.start_beta = pair.alpha, pair.beta
    e.start_speed, e.start_target_speed = speed1, speed2
    e.cpa_time, e.cpa_range, e.cpa_alpha, e.cpa_beta = t, pair.range, pair.alpha, pair.beta
    e.clearance, e.clearance_time, e.domain = math.inf, t, math.inf
    seen.turn_starboard = seen.turn_port = seen.slowed = seen.sped = 0.0
    seen.turn2 = seen.turn3 = seen.change2 = seen.change3 = seen.port4 = 0.0
    seen.turn_time = seen.slowed_time = seen.manoeuvre_time = seen.manoeuvre_range = math.nan
    seen.turn2_time = seen.turn3_time = seen.change2_time = seen.change3_time = seen.port4_time = math.nan
    seen.stage3_time = seen.stage4_time = seen.emergency_time = math.nan
    seen.port4_side = 0


@spliced
def _observe(seen, e, p, pair, t, turn, change, turn_rate, acceleration, ref):
    """Extend what was seen by one sample: ``turn`` and ``change`` are of course [rad] and speed (relative) since the start.

    ref [3, 2] are course and speed, since the start, at the first sample of stages 2, 3, 4; NaN before.
    """
    if turn > seen.turn_starboard:
        if turn > seen.turn_port:
            seen.turn_time = t
        seen.turn_starboard = turn
    if -turn > seen.turn_port:
        if -turn > seen.turn_starboard:
            seen.turn_time = t
        seen.turn_port = -turn
    if -change > seen.slowed:
        seen.slowed, seen.slowed_time = -change, t
    seen.sped = max(seen.sped, change)
    if seen.manoeuvre_time != seen.manoeuvre_time:
        turns = abs(turn_rate) >= p.turn_rate_md and abs(turn) > p.course_md
        if turns or (abs(acceleration) >= p.acceleration_md and abs(change) > p.speed_md):
            seen.manoeuvre_time, seen.manoeuvre_range = t, pair.range
    stage = max(pair.stage, 2)
    r = ref[stage - 2]
    if r[0] != r[0]:
        r[0], r[1] = turn, change
        if stage >= 3 and seen.stage3_time != seen.stage3_time:
            seen.stage3_time = t
        if stage == 4:
            seen.stage4_time = t
            seen.port4_side = pair.beta < 0.0
    # relative to the speed at that first sample
    turned, changed = turn - r[0], abs(change - r[1]) / max(1.0 + r[1], 1.0e-3)
    if stage == 2:
        if abs(turned) > seen.turn2:
            seen.turn2, seen.turn2_time = abs(turned), t
        if changed > seen.change2:
            seen.change2, seen.change2_time = changed, t
    elif stage == 3:
        if abs(turned) > seen.turn3:
            seen.turn3, seen.turn3_time = abs(turned), t
        if changed > seen.change3:
            seen.change3, seen.change3_time = changed, t
    elif -turned > seen.port4:
        seen.port4, seen.port4_time = -turned, t
    if pair.state == EM and seen.emergency_time != seen.emergency_time:
        seen.emergency_time = t


@inner
def hull_distance_at(hulls, a, k, f, own, other, l1, b1, l2, b2):
    """Hull distance [m] a fraction f of the way from sample a to k."""
    return hull_clearance(
        hulls,
        own[a, 0] + f * (own[k, 0] - own[a, 0]), own[a, 1] + f * (own[k, 1] - own[a, 1]),
        own[a, 2] + f * wrap(own[k, 2] - own[a, 2]), l1, b1,
        other[a, 0] + f * (other[k, 0] - other[a, 0]), other[a, 1] + f * (other[k, 1] - other[a, 1]),
        other[a, 2] + f * wrap(other[k, 2] - other[a, 2]), l2, b2,
    )  # fmt: skip


@inner
def closest_fraction(a, k, own, other):
    """Where between samples a and k two tracks [T, >= 2] are closest, as a fraction in [0, 1]; straight motion."""
    rn, re = other[a, 0] - own[a, 0], other[a, 1] - own[a, 1]
    dn, de = other[k, 0] - own[k, 0] - rn, other[k, 1] - own[k, 1] - re
    moved = dn * dn + de * de
    return min(max(-(rn * dn + re * de) / moved, 0.0), 1.0) if moved > 0.0 else 1.0


@inner
def _approach(nearest, hulls, a, k, f, t, own, other, l1, b1, l2, b2):
    """Extend nearest [2], hull distance and its time, by the way from sample a to k, closest at the fraction f."""
    rn, re = other[a, 0] - own[a, 0], other[a, 1] - own[a, 1]
    rn += f * (other[k, 0] - own[k, 0] - rn)
    re += f * (other[k, 1] - own[k, 1] - re)
    if math.hypot(rn, re) < nearest[0] + 0.5 * (math.hypot(l1, b1) + math.hypot(l2, b2)):
        d = hull_distance_at(hulls, a, k, f, own, other, l1, b1, l2, b2)
        if d < nearest[0]:
            nearest[0] = d
            nearest[1] = t[a] + f * (t[k] - t[a])


@spliced
def _nearer(e, hulls, k, f, t, own, other, l1, b1, l2, b2, course1, course2):
    """Take the instant a fraction f of the way from sample k - 1 to k for the closest, if it is; true if it is."""
    a = k - 1
    n1, e1 = own[a, 0] + f * (own[k, 0] - own[a, 0]), own[a, 1] + f * (own[k, 1] - own[a, 1])
    n2, e2 = other[a, 0] + f * (other[k, 0] - other[a, 0]), other[a, 1] + f * (other[k, 1] - other[a, 1])
    when = t[a] + f * (t[k] - t[a])
    gap = hull_distance_at(hulls, a, k, f, own, other, l1, b1, l2, b2)
    if gap < e.clearance:
        e.clearance, e.clearance_time = gap, when
    d = math.hypot(n2 - n1, e2 - e1)
    if d >= e.cpa_range:
        return False
    line = atan2(e2 - e1, n2 - n1)
    e.cpa_range, e.cpa_time = d, when
    e.cpa_alpha = wrap(line + math.pi - course2[a] - f * (course2[k] - course2[a]))
    e.cpa_beta = wrap(line - course1[a] - f * (course1[k] - course1[a]))
    return True


@kernel
def find_encounters(params, t, eta, velocity, active, steps, ready, own, length, beam, work, hulls, seen_, pairs, ref, out,
                    nearest):  # fmt: skip
    """Write all encounters of the own ships of B episodes to ``out`` and return how many there are.

    params [1]: params_dtype; t .. beam: as in Trajectory; ready [B]: first sample at which an encounter may begin.
    work [4, T], hulls [2, 5, 2], seen_ [1]: SEEN, pairs [1]: pair_dtype and ref [3, 2] are work space.
    out [B * V * MOST]: encounter_dtype; nearest [B, V, 2]: smallest hull distance [m] and its time [s] to every ship at any
    time, inf and NaN where there was none.
    """
    p, seen, pair = params[0], seen_[0], pairs[0]
    count = 0
    nearest[:, :, 0] = math.inf
    nearest[:, :, 1] = math.nan
    course1, speed1, course2, speed2 = work[0], work[1], work[2], work[3]
    for b in range(steps.shape[0]):
        n, i = steps[b], own[b]
        slow = 0.25 * p.moving
        courses(velocity[b, :, i], eta[b, :, i], n, slow, course1, speed1)
        for j in range(eta.shape[2]):
            if j == i or not active[b, :n, j].any():
                continue
            courses(velocity[b, :, j], eta[b, :, j], n, slow, course2, speed2)
            l1, b1, l2, b2 = length[b, i], beam[b, i], length[b, j], beam[b, j]
            met = 0
            pair.code = SAFE
            pair.state = 0
            for k in range(n):
                if not (active[b, k, i] and active[b, k, j]):
                    pair.code = SAFE
                    continue
                a = k - 1 if k > 0 and active[b, k - 1, j] else k
                f = closest_fraction(a, k, eta[b, :, i], eta[b, :, j])
                _approach(nearest[b, j], hulls, a, k, f, t[b], eta[b, :, i], eta[b, :, j], l1, b1, l2, b2)
                if k < ready[b]:
                    continue
                before = pair.code
                advance(pair, p, eta[b, k, i, 0], eta[b, k, i, 1], velocity[b, k, i, 0], velocity[b, k, i, 1], course1[k], l1,
                        eta[b, k, j, 0], eta[b, k, j, 1], velocity[b, k, j, 0], velocity[b, k, j, 1], course2[k],
                        l2)  # fmt: skip
                if pair.code == SAFE:
                    continue
                fresh = before == SAFE
                if fresh and met < MOST:
                    met += 1
                    count += 1
                    e = out[count - 1]
                    _begin(e, seen, pair, b, j, t[b, k], speed1[k], speed2[k])
                    chi0, u0, first = course1[k], max(speed1[k], 1.0e-3), k
                    for r in range(3):
                        ref[r, 0] = ref[r, 1] = math.nan
                    e.clearance = hull_clearance(hulls, eta[b, k, i, 0], eta[b, k, i, 1], eta[b, k, i, 2], l1, b1,
                                                 eta[b, k, j, 0], eta[b, k, j, 1], eta[b, k, j, 2], l2, b2)  # fmt: skip
                e = out[count - 1]
                rate = acceleration = 0.0
                if k > first:
                    step = t[b, k] - t[b, k - 1]
                    rate, acceleration = (course1[k] - course1[k - 1]) / step, (speed1[k] - speed1[k - 1]) / step
                    if f < 1.0 and a < k and _nearer(
                        e, hulls, k, f, t[b], eta[b, :, i], eta[b, :, j], l1, b1, l2, b2, course1, course2
                    ):
                        e.seen = seen
                _observe(seen, e, p, pair, t[b, k], course1[k] - chi0, speed1[k] / u0 - 1.0, rate, acceleration, ref)
                if k == first or _nearer(
                    e, hulls, k, 1.0, t[b], eta[b, :, i], eta[b, :, j], l1, b1, l2, b2, course1, course2
                ):
                    e.seen = seen
                e.domain = min(e.domain, domain_ratio(eta[b, k, i, 0], eta[b, k, i, 1], eta[b, k, j, 0], eta[b, k, j, 1],
                                                      course2[k], l2))  # fmt: skip
                e.end = t[b, k]
                e.complete = pair.tcpa <= 0.0
    return count


def under_way(x: Trajectory) -> NDArray[np.int64]:
    """First sample [B] at which the own ship has its intended speed, or the first after START_UP seconds.

    A boat that starts from rest is not yet a stand-on vessel that fails to keep its speed.
    """
    speed = np.hypot(*np.moveaxis(x.velocity[np.arange(len(x)), :, x.own], -1, 0))
    return np.asarray(((speed >= 0.9 * x.speed[:, None]) | (x.t >= START_UP)).argmax(axis=1))


def encounters_of(trajectory: Trajectory, params: Params) -> tuple[NDArray[Any], NDArray[np.float64]]:
    """Encounters [n] (:func:`encounter_dtype`) of the own ships of all episodes, by row, ship and time; and [B, V, 2] the
    smallest hull distance [m] and its time [s] to every ship.
    """
    x, (B, T, V) = trajectory, trajectory.eta.shape[:3]
    out: NDArray[Any] = np.zeros(B * V * MOST, encounter_dtype())
    nearest = np.empty((B, V, 2))
    count = find_encounters(
        params.record(), x.t, x.eta, x.velocity, x.active, x.steps, under_way(x), x.own, x.length, x.beam, np.zeros((4, T)),
        np.zeros((2, 5, 2)), np.zeros(1, SEEN), np.zeros(1, pair_dtype()), np.zeros((3, 2)), out, nearest,
    )  # fmt: skip
    found = out[:count].copy()
    last = x.t[np.arange(B), np.maximum(x.steps - 1, 0)]
    hit = (x.touched[found["row"]] == found["ship"]) & (found["end"] >= last[found["row"]])
    found["contact"] = hit
    found["complete"] |= hit
    found["clearance"][hit] = 0.0
    # between samples the sweep of the simulation knows better
    nearest[..., 0] = np.minimum(nearest[..., 0], x.closest)
    touched = np.flatnonzero((x.touched >= 0) & (x.touched < V))
    nearest[touched, x.touched[touched]] = np.stack([np.zeros(len(touched)), last[touched]], axis=1)
    return found, nearest
