"""Hulls: shape, distance between two of them, and the closest they come while both move.

A hull is a convex pentagon, symmetric about the centre line: transom, straight sides, and a bow that tapers over the
foremost quarter of the length.  Fixed obstacles are discs.  All in {n}, metres.
"""

from __future__ import annotations

import math

from ..jit import inner, scalar
from ..trig import hypot, sincos, sincos_random

BOW_TAPER = 0.25  #: share of the length over which the bow narrows to a point
CLOSE = 30.0  #: [m] hulls nearer than this (plus their half lengths) are measured exactly
PASSING = 60.0  #: [m] the closest point of approach of hulls nearer than this is found within the frame
TINY = 1.0e-9  #: [m] instead of a distance of 0, to divide by
CONTACT_STEP = 0.02  #: [m] resolution of the sweep: hulls may graze by less than this unnoticed


@inner
def hull_vertices(out, north, east, psi, length, beam):
    """Write the five corners of a hull into out [5, 2], clockwise from the bow."""
    s, c = sincos(psi)
    half_l, half_b = 0.5 * length, 0.5 * beam
    shoulder = half_l - BOW_TAPER * length
    for i in range(5):
        x = half_l if i == 0 else (shoulder if (i == 1 or i == 4) else -half_l)
        y = 0.0 if i == 0 else (half_b if i < 3 else -half_b)
        out[i, 0] = north + c * x - s * y
        out[i, 1] = east + s * x + c * y


@inner
def point_segment(pn, pe, an, ae, bn, be):
    """Distance of a point from a segment [m]."""
    dn, de = bn - an, be - ae
    length2 = dn * dn + de * de
    t = ((pn - an) * dn + (pe - ae) * de) / length2 if length2 > 0.0 else 0.0
    t = min(max(t, 0.0), 1.0)
    return hypot(pn - an - t * dn, pe - ae - t * de)


@inner
def contains(hull, pn, pe):
    """True if a point lies inside a convex clockwise polygon [n, 2]."""
    n = hull.shape[0]
    for i in range(n):
        k = i + 1 if i + 1 < n else 0
        cross = (hull[k, 0] - hull[i, 0]) * (pe - hull[i, 1]) - (hull[k, 1] - hull[i, 1]) * (pn - hull[i, 0])
        if cross < 0.0:
            return False
    return True


@inner
def point_hull(hull, pn, pe):
    """Distance of a point from a hull [m], 0 inside."""
    if contains(hull, pn, pe):
        return 0.0
    best = math.inf
    n = hull.shape[0]
    for i in range(n):
        k = i + 1 if i + 1 < n else 0
        best = min(best, point_segment(pn, pe, hull[i, 0], hull[i, 1], hull[k, 0], hull[k, 1]))
    return best


@inner
def _separated(a, b):
    """True if an edge of a separates the convex polygons a and b (one half of the separating-axis test)."""
    n = a.shape[0]
    for i in range(n):
        k = i + 1 if i + 1 < n else 0
        dn, de = a[k, 0] - a[i, 0], a[k, 1] - a[i, 1]
        outside = True
        for j in range(b.shape[0]):
            if dn * (b[j, 1] - a[i, 1]) - de * (b[j, 0] - a[i, 0]) >= 0.0:
                outside = False
                break
        if outside:
            return True
    return False


@inner
def hull_hull(a, b):
    """Distance between two convex clockwise polygons [m], 0 when they touch or overlap."""
    if not _separated(a, b) and not _separated(b, a):
        return 0.0
    best = math.inf
    n, m = a.shape[0], b.shape[0]
    for i in range(n):
        for j in range(m):
            k = j + 1 if j + 1 < m else 0
            best = min(best, point_segment(a[i, 0], a[i, 1], b[j, 0], b[j, 1], b[k, 0], b[k, 1]))
    for j in range(m):
        for i in range(n):
            k = i + 1 if i + 1 < n else 0
            best = min(best, point_segment(b[j, 0], b[j, 1], a[i, 0], a[i, 1], a[k, 0], a[k, 1]))
    return best


@scalar
def half_width(length, beam, aspect):
    """Half the width [m] a hull shows to a line of sight at the angle ``aspect`` [rad] from its centre line."""
    s, c = sincos_random(aspect)
    return 0.5 * (abs(length * s) + abs(beam * c))


@scalar
def far_distance(dn, de, s1, c1, l1, b1, s2, c2, l2, b2):
    """Distance of two hulls that are far apart [m]: the other hull as a capsule, the own one by its extent towards it.

    dn, de [m] lead from the other hull to the own one; s1, c1, s2, c2 are sine and cosine of the headings.  A disc is
    l2 = b2 = its diameter.  Within 2 % of the exact distance, plus a share of the beams, beyond CLOSE.
    """
    axis = 0.5 * max(l2 - b2, 0.0)
    t = min(max(dn * c2 + de * s2, -axis), axis)
    rn, re = dn - t * c2, de - t * s2
    r = hypot(rn, re)
    along = abs(rn * c1 + re * s1) * 0.5 * l1 + abs(re * c1 - rn * s1) * 0.5 * b1
    return max(r - 0.5 * b2 - along / max(r, TINY), 0.0)


@inner
def waypoint_reached(routes, j, k, north, east):
    """True if someone at a place has reached waypoint k of vessel j's route.

    That is inside its circle of acceptance, or past it: with the projection on the leg beyond its end while within three
    radii, so that nobody circles a waypoint that cannot be hit.
    """
    dn = routes.waypoint[j, k, 0] - north
    de = routes.waypoint[j, k, 1] - east
    distance2 = dn * dn + de * de
    radius2 = routes.radius[j] * routes.radius[j]
    if distance2 <= radius2:
        return True
    if k == 0 or distance2 > 9.0 * radius2:
        return False
    ln = routes.waypoint[j, k, 0] - routes.waypoint[j, k - 1, 0]
    le = routes.waypoint[j, k, 1] - routes.waypoint[j, k - 1, 1]
    return ln * dn + le * de < 0.0
