"""Truth about distances: the collision sweep between an observer's hull and everything else.

Once per traffic frame every source is tested with a swept bounding circle.  Only the pairs that this leaves are followed
through the frame by conservative advancement: with the hulls d apart and closing at most at v, nothing can touch for d / v
seconds, so that is how far time may jump.  Nothing tunnels, and a pair far apart costs a few nanoseconds.
"""

from __future__ import annotations

import math

from ..jit import inner
from ..trig import sincos
from .geometry import CLOSE, CONTACT_STEP, far_distance, hull_hull, hull_vertices, point_hull
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
    closing = math.hypot(dn1 - dn2, de1 - de2) + abs(dp1) * 0.5 * math.hypot(l1, b1) + abs(dp2) * 0.5 * math.hypot(l2, b2)
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
def _pass_discs(w, o, j):
    """Distances of vessel j to all discs as if they were far, without a branch, so that the loop becomes vector code.

    Leaves the distance over the frame in ``w.ranges`` and at its end in ``safety.distance``, and 1 in ``w.hidden`` for the
    discs that came close and have to be followed.
    """
    v, m = w.vessels, w.obstacles
    V = v.active.shape[0]
    n1, e1 = v.frame_eta[j, 0], v.frame_eta[j, 1]
    dn1, de1 = v.eta[j, 0] - n1, v.eta[j, 1] - e1
    half_l, half_b = 0.5 * v.length[j], 0.5 * v.beam[j]
    limit = math.sqrt(half_l * half_l + half_b * half_b) + CLOSE
    s1, c1 = sincos(v.eta[j, 2])
    for i in range(m.active.shape[0]):
        rn, re = n1 - m.frame_position[i, 0], e1 - m.frame_position[i, 1]
        vn = dn1 - (m.position[i, 0] - m.frame_position[i, 0])
        ve = de1 - (m.position[i, 1] - m.frame_position[i, 1])
        t = min(max(-(rn * vn + re * ve) / max(vn * vn + ve * ve, 1.0e-12), 0.0), 1.0)
        an, ae = rn + t * vn, re + t * ve
        bn, be = rn + vn, re + ve
        a = math.sqrt(an * an + ae * ae) + 1.0e-9
        b = math.sqrt(bn * bn + be * be) + 1.0e-9
        a_near = a - m.radius[i] - (abs(an * c1 + ae * s1) * half_l + abs(ae * c1 - an * s1) * half_b) / a
        b_near = b - m.radius[i] - (abs(bn * c1 + be * s1) * half_l + abs(be * c1 - bn * s1) * half_b) / b
        end = max(b_near, 0.0)
        w.ranges[V + i] = min(max(a_near, 0.0), end)
        w.half_angles[V + i] = end
        w.hidden[V + i] = 1 if a < limit + m.radius[i] else 0


@inner
def _note(safety, o, s, near, end):
    safety.distance[o, s] = end
    safety.closest[o, s] = min(safety.closest[o, s], near)
    safety.step_closest[o] = min(safety.step_closest[o], near)
    if near <= 0.0 and safety.collided_with[o] < 0:
        safety.collided_with[o] = s


@inner
def _pass_land(w, h, land, o, j):
    """Distances of vessel j from the coast of block h over the frame, followed as above where land is near."""
    v, safety = w.vessels, w.safety
    n, e, p = v.frame_eta[j, 0], v.frame_eta[j, 1], v.frame_eta[j, 2]
    dn, de, dp = v.eta[j, 0] - n, v.eta[j, 1] - e, v.eta[j, 2] - p
    length, beam = v.length[j], v.beam[j]
    reach = 0.5 * math.hypot(length, beam)
    closing = math.hypot(dn, de) + abs(dp) * reach + 1.0e-9
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
    v, m, safety = w.vessels, w.obstacles, w.safety
    V = v.active.shape[0]
    h = coast(land, w.land_id)
    for o in range(w.observer.shape[0]):
        j = w.observer[o]
        if v.active[j] == 0:
            continue
        if h != 0:
            _pass_land(w, h, land, o, j)
        n1, e1 = v.frame_eta[j, 0], v.frame_eta[j, 1]
        dn1, de1 = v.eta[j, 0] - n1, v.eta[j, 1] - e1
        l1, b1 = v.length[j], v.beam[j]
        s1, c1 = sincos(v.eta[j, 2])
        reach1 = 0.5 * math.sqrt(l1 * l1 + b1 * b1)
        for s in range(V):
            if v.active[s] == 0 or s == j:
                continue
            n2, e2, p2 = v.frame_eta[s, 0], v.frame_eta[s, 1], v.frame_eta[s, 2]
            dn2, de2, dp2 = v.eta[s, 0] - n2, v.eta[s, 1] - e2, v.eta[s, 2] - p2
            l2, b2 = v.length[s], v.beam[s]
            rn, re = n1 - n2, e1 - e2
            vn, ve = dn1 - dn2, de1 - de2
            travelled2 = vn * vn + ve * ve
            t = min(max(-(rn * vn + re * ve) / travelled2, 0.0), 1.0) if travelled2 > 0.0 else 1.0
            limit = reach1 + 0.5 * math.sqrt(l2 * l2 + b2 * b2) + CLOSE
            if (rn + t * vn) ** 2 + (re + t * ve) ** 2 > limit * limit:
                s2, c2 = sincos(p2 + dp2)
                end = far_distance(rn + vn, re + ve, s1, c1, l1, b1, s2, c2, l2, b2)
                near = end
                if 0.0 < t < 1.0:  # passing: the nearest point lies within the frame
                    near = min(near, far_distance(rn + t * vn, re + t * ve, s1, c1, l1, b1, s2, c2, l2, b2))
            else:
                near, end = _follow(w, j, s, False, l2, b2, n2, e2, p2, dn2, de2, dp2)
            _note(safety, o, s, near, end)
        _pass_discs(w, o, j)
        for i in range(m.active.shape[0]):
            if m.active[i] == 0:
                continue
            s = V + i
            near, end = w.ranges[s], w.half_angles[s]
            if w.hidden[s]:
                d2 = 2.0 * m.radius[i]
                n2, e2 = m.frame_position[i, 0], m.frame_position[i, 1]
                near, end = _follow(
                    w, j, s, True, d2, d2, n2, e2, 0.0, m.position[i, 0] - n2, m.position[i, 1] - e2, 0.0
                )
            _note(safety, o, s, near, end)
