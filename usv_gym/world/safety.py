"""Truth about distances: the collision sweep between an observer's hull and everything else.

Once per traffic frame every source is measured as if it were far away; those that may have been near are tested with a swept
bounding circle.  Only the pairs that this leaves are followed through the frame by conservative advancement: with the hulls d
apart and closing at most at v, nothing can touch for d / v seconds, so that is how far time may jump.  Nothing tunnels, and a
pair far apart costs a few nanoseconds.
"""

from __future__ import annotations

import math

import numpy as np

from ..jit import inner
from ..trig import clip, hypot, sincos, sincos_random
from .geometry import CLOSE, CONTACT_STEP, PASSING, TINY, far_distance, hull_hull, hull_vertices, point_hull
from .shore import coast, hull_land


@inner
def begin_frame(w):
    """Remember where everything is as the frame begins."""
    v, m = w.vessels, w.obstacles
    for j in range(v.active.shape[0]):
        v.frame_eta[j, 0] = v.eta[j, 0]
        v.frame_eta[j, 1] = v.eta[j, 1]
        v.frame_eta[j, 2] = v.eta[j, 2]
    for i in range(m.active.shape[0]):
        m.frame_position[i, 0] = m.position[i, 0]
        m.frame_position[i, 1] = m.position[i, 1]
    w.frame_tick = w.tick


@inner
def _follow(w, j, s, disc, l2, b2, n2, e2, p2, dn2, de2, dp2):
    """Smallest and last distance [m] of the hulls of vessel j and source s over the frame, by conservative advancement.

    The other hull moves from (n2, e2, p2) by (dn2, de2, dp2); both are straight lines over t in [0, 1].
    """
    v = w.vessels
    n1, e1, p1 = v.frame_eta[j, 0], v.frame_eta[j, 1], v.frame_eta[j, 2]
    dn1, de1, dp1 = v.eta[j, 0] - n1, v.eta[j, 1] - e1, v.eta[j, 2] - p1
    l1, b1 = v.length[j], v.beam[j]
    # fastest that any two points of the hulls can close, per frame
    closing = hypot(dn1 - dn2, de1 - de2) + abs(dp1) * 0.5 * hypot(l1, b1) + abs(dp2) * 0.5 * hypot(l2, b2)
    closing += 1.0e-9
    least = CONTACT_STEP / closing
    near = math.inf
    t = 0.0
    while True:
        hull_vertices(w.hull[0], n1 + t * dn1, e1 + t * de1, p1 + t * dp1, l1, b1)
        if disc:
            d = max(point_hull(w.hull[0], n2 + t * dn2, e2 + t * de2) - 0.5 * l2, 0.0)
        else:
            hull_vertices(w.hull[1], n2 + t * dn2, e2 + t * de2, p2 + t * dp2, l2, b2)
            d = hull_hull(w.hull[0], w.hull[1])
        near = min(near, d)
        if t >= 1.0:
            return near, d
        # nothing can come nearer than ``near`` before (d - near) / closing; the tenth bounds the error of the minimum
        t = 1.0 if near <= 0.0 else min(t + max((d - near) / closing, 0.1 * d / closing, least), 1.0)


@inner
def _pass_all(w, j):
    """Distances of vessel j to all sources at the end of the frame as if they were far, without a branch: vector code.

    Leaves them in ``w.end`` and ``w.near`` (inf where there is nothing), and 1 in ``w.hidden`` for the sources that may
    have come nearer than PASSING within the frame; returns how many those are.  What passes farther away than that comes
    no nearer than at the ends of its frames by more than 0.2 m.
    """
    v, m = w.vessels, w.obstacles
    V = v.active.shape[0]
    n1, e1 = v.eta[j, 0], v.eta[j, 1]
    l1, b1 = v.length[j], v.beam[j]
    s1, c1 = sincos(v.eta[j, 2])
    limit = 0.5 * (l1 + b1) + PASSING + hypot(n1 - v.frame_eta[j, 0], e1 - v.frame_eta[j, 1])
    close = 0
    for s in range(V):
        dn, de = n1 - v.eta[s, 0], e1 - v.eta[s, 1]
        l2, b2 = v.length[s], v.beam[s]
        # the heading in the middle of the frame: a frame is short, and reading all of a row spares the loop a remainder
        s2, c2 = sincos_random(0.5 * (v.frame_eta[s, 2] + v.eta[s, 2]))
        end = far_distance(dn, de, s1, c1, l1, b1, s2, c2, l2, b2)
        reach = limit + 0.5 * (l2 + b2) + abs(v.eta[s, 0] - v.frame_eta[s, 0]) + abs(v.eta[s, 1] - v.frame_eta[s, 1])
        there = (v.active[s] != 0) & (s != j)
        follow = there & (dn * dn + de * de <= reach * reach)
        w.near[s] = end if there else math.inf
        w.end[s] = end
        w.hidden[s] = follow
        close += follow
    half_l, half_b = 0.5 * l1, 0.5 * b1
    for i in range(m.active.shape[0]):
        dn, de = n1 - m.position[i, 0], e1 - m.position[i, 1]
        r2 = dn * dn + de * de
        r = math.sqrt(r2)
        along = abs(dn * c1 + de * s1) * half_l + abs(de * c1 - dn * s1) * half_b
        end = max(r - m.radius[i] - along / max(r, TINY), 0.0)
        reach = limit + m.radius[i]
        reach += abs(m.position[i, 0] - m.frame_position[i, 0]) + abs(m.position[i, 1] - m.frame_position[i, 1])
        there = m.active[i] != 0
        follow = there & (r2 <= reach * reach)
        w.near[V + i] = end if there else math.inf
        w.end[V + i] = end
        w.hidden[V + i] = follow
        close += follow
    return close


@inner
def _pass_near(w, o, j):
    """Look closer at what _pass_all() has found near vessel j of observer o: the closest point of approach within the frame.

    Hulls that come nearer than CLOSE are followed.
    """
    v, m, safety = w.vessels, w.obstacles, w.safety
    V = v.active.shape[0]
    n1, e1 = v.frame_eta[j, 0], v.frame_eta[j, 1]
    dn1, de1 = v.eta[j, 0] - n1, v.eta[j, 1] - e1
    l1, b1 = v.length[j], v.beam[j]
    s1, c1 = sincos(v.eta[j, 2])
    for s in range(w.hidden.shape[0]):
        if w.hidden[s] == 0:
            continue
        if s < V:
            n2, e2, p2 = v.frame_eta[s, 0], v.frame_eta[s, 1], v.frame_eta[s, 2]
            dn2, de2, dp2 = v.eta[s, 0] - n2, v.eta[s, 1] - e2, v.eta[s, 2] - p2
            l2, b2 = v.length[s], v.beam[s]
            reach = 0.5 * (hypot(l1, b1) + hypot(l2, b2)) + CLOSE
        else:
            n2, e2, p2 = m.frame_position[s - V, 0], m.frame_position[s - V, 1], 0.0
            dn2, de2, dp2 = m.position[s - V, 0] - n2, m.position[s - V, 1] - e2, 0.0
            l2 = b2 = 2.0 * m.radius[s - V]
            reach = 0.5 * (hypot(l1, b1) + l2) + CLOSE
        rn, re = n1 - n2, e1 - e2
        vn, ve = dn1 - dn2, de1 - de2
        t = clip(-(rn * vn + re * ve) / max(vn * vn + ve * ve, 1.0e-12), 0.0, 1.0)
        rn, re = rn + t * vn, re + t * ve
        if rn * rn + re * re > reach * reach:
            s2, c2 = sincos(p2 + t * dp2)
            w.near[s] = min(w.near[s], far_distance(rn, re, s1, c1, l1, b1, s2, c2, l2, b2))
            continue
        w.near[s], w.end[s] = _follow(w, j, s, s >= V, l2, b2, n2, e2, p2, dn2, de2, dp2)
        if w.near[s] <= 0.0 and safety.collided_with[o] < 0:
            safety.collided_with[o] = s


@inner
def _pass_land(w, h, land, o, j):
    """Distances of vessel j from the coast of block h over the frame, followed as above where land is near."""
    v, safety = w.vessels, w.safety
    n, e, p = v.frame_eta[j, 0], v.frame_eta[j, 1], v.frame_eta[j, 2]
    dn, de, dp = v.eta[j, 0] - n, v.eta[j, 1] - e, v.eta[j, 2] - p
    length, beam = v.length[j], v.beam[j]
    reach = 0.5 * hypot(length, beam)
    closing = hypot(dn, de) + abs(dp) * reach + 1.0e-9
    exact = CLOSE + closing
    hull_vertices(w.hull[0], n + dn, e + de, p + dp, length, beam)
    end = near = hull_land(land, h, w.hull[0], n + dn, e + de, reach, exact)
    t = 0.0
    while t < 1.0 and near > 0.0 and end < exact:
        hull_vertices(w.hull[0], n + t * dn, e + t * de, p + t * dp, length, beam)
        d = hull_land(land, h, w.hull[0], n + t * dn, e + t * de, reach, exact)
        near = min(near, d)
        t += max((d - near) / closing, 0.1 * d / closing, CONTACT_STEP / closing)
    safety.land_distance[o] = end
    safety.land_closest[o] = min(safety.land_closest[o], near)
    safety.step_closest[o] = min(safety.step_closest[o], near)
    if near <= 0.0:
        safety.grounded[o] = 1


@inner
def sweep(w, land):
    """Distances of every observer's hull to every source, and to land, over the frame that ends now."""
    safety = w.safety
    S = w.near.shape[0]
    h = coast(land, w.land_id)
    for o in range(w.observer.shape[0]):
        j = w.observer[o]
        if w.vessels.active[j] == 0:
            continue
        if h != 0:
            _pass_land(w, h, land, o, j)
        if _pass_all(w, j) > 0:
            _pass_near(w, o, j)
        # distances are not negative, and such numbers have the order of their bits: whole numbers are compared in parallel
        nearest = np.float64(math.inf).view(np.int64)
        for s in range(S):
            nearest = min(nearest, np.float64(w.near[s]).view(np.int64))
            safety.closest[o, s] = min(safety.closest[o, s], w.near[s])
            safety.distance[o, s] = w.end[s] if w.near[s] < math.inf else safety.distance[o, s]
        safety.step_closest[o] = min(safety.step_closest[o], np.int64(nearest).view(np.float64))
