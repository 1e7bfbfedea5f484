"""Radar and LiDAR shadow: which sources an observer has no line of sight to.

Seen from the sensor every source covers an interval of bearings: that of a disc is atan(radius / d) to either side, that
of a hull the same with half its projected width.  A source is hidden only if the whole of its interval is covered by the
intervals of nearer sources together (thesis 2.3.1 and 6.2.3; there only its centre counted, and one occluder at a time).

Sources are taken in the order of range, and their intervals merged into a sorted list of disjoint lit intervals; a source
whose interval lies inside one of them is hidden.  Cost: O(S log S) plus the insertions, while the order of range changes
little from look to look; O(S^2) at the first one.  As only the order of bearings is of account, a pseudo-bearing takes their
place, which rises with the bearing and needs no arctangent.

A look leaves rows of ``w.look``, in the order of range, the source being ``w.order``:
"""

from __future__ import annotations

import math

from ..jit import inner, scalar
from ..trig import atan2, sincos_random

DN, DE = 0, 1  #: place from the sensor [m] {n}
HEADING, LENGTH, BEAM = 2, 3, 4  #: of a hull [rad], [m], [m]; 0 for a disc
RADIUS = 5  #: of a disc [m]; 0 for a hull
LOW, HIGH = 6, 7  #: pseudo-bearings of the edges, the second clockwise of the first
WIDTH = 8  #: half of what it shows [m]
RANGE = 9  #: [m]
BEARING, HALF = 10, 11  #: [rad] of the centre, and to either side; only where there is land

_SOUTH = 2.0  #: where pseudo-bearings end; they begin at the negative
_TINY = 1e-300


@inner
def look_around(w, o, reach):
    """Look at all sources within ``reach`` metres of observer o.

    Returns how many there are; ``w.order[:count]`` are their indices, nearest first.
    """
    v, m, t, own = w.vessels, w.obstacles, w.tracks, w.observer[o]
    V, M = v.active.shape[0], m.active.shape[0]
    n0, e0 = v.eta[own, 0], v.eta[own, 1]
    reach2 = reach * reach
    # squared distances first, without a branch, so that it becomes vector code: a LiDAR mostly looks at an empty sea
    count = 0
    for s in range(V):
        dn, de = v.eta[s, 0] - n0, v.eta[s, 1] - e0
        d2 = dn * dn + de * de if (v.active[s] != 0) & (s != own) else math.inf
        w.ranges[s] = d2
        count += d2 <= reach2
    for i in range(M):
        dn, de = m.position[i, 0] - n0, m.position[i, 1] - e0
        d2 = dn * dn + de * de if m.active[i] != 0 else math.inf
        w.ranges[V + i] = d2
        count += d2 <= reach2
    if count > 0:
        _sort_by_range(w, t.nearest[o], V + M)  # nearly as it was at the last look
        for k in range(count):
            w.order[k] = t.nearest[o, k]
        _work_out(w, n0, e0, count)
    return count


@inner
def look_at(w, o, reach, sources, n):
    """The same of the first n of some sources, all of which are there."""
    v, m, own = w.vessels, w.obstacles, w.observer[o]
    V = v.active.shape[0]
    n0, e0 = v.eta[own, 0], v.eta[own, 1]
    count = 0
    for i in range(n):
        s = sources[i]
        if s < V:
            dn, de = v.eta[s, 0] - n0, v.eta[s, 1] - e0
        else:
            dn, de = m.position[s - V, 0] - n0, m.position[s - V, 1] - e0
        w.ranges[s] = dn * dn + de * de
        if w.ranges[s] <= reach * reach:
            w.order[count] = s
            count += 1
    if count > 0:
        _sort_by_range(w, w.order, count)
        _work_out(w, n0, e0, count)
    return count


@inner
def _sort_by_range(w, order, n):
    """Sort the first n of ``order``, indices of sources, by ``w.ranges`` [n, inf allowed]; ties keep the lower index first."""
    for i in range(1, n):
        s = order[i]
        d = w.ranges[s]
        k = i
        while k > 0:
            t = order[k - 1]
            if w.ranges[t] < d or (w.ranges[t] == d and t < s):
                break
            order[k] = t
            k -= 1
        order[k] = s


@scalar
def _pseudo_bearing(n, e):
    """Number in [-2, 2] that rises with the bearing of (n, e) from south by west, north and east to south."""
    t = e / max(abs(n) + abs(e), _TINY)
    return t if n >= 0.0 else (-_SOUTH - t if e < 0.0 else _SOUTH - t)


@inner
def _work_out(w, n0, e0, count):
    """Fill the rows of the ``count`` sources of ``w.order``, as seen from (n0, e0)."""
    v, m, look = w.vessels, w.obstacles, w.look
    V = v.active.shape[0]
    for k in range(count):
        s = w.order[k]
        if s < V:
            look[DN, k] = v.eta[s, 0] - n0
            look[DE, k] = v.eta[s, 1] - e0
            look[HEADING, k] = v.eta[s, 2]
            look[LENGTH, k] = v.length[s]
            look[BEAM, k] = v.beam[s]
            look[RADIUS, k] = 0.0
        else:
            look[DN, k] = m.position[s - V, 0] - n0
            look[DE, k] = m.position[s - V, 1] - e0
            look[HEADING, k] = look[LENGTH, k] = look[BEAM, k] = 0.0
            look[RADIUS, k] = m.radius[s - V]
    for k in range(count):  # vector code
        dn, de = look[DN, k], look[DE, k]
        d = math.sqrt(dn * dn + de * de)
        sine, cosine = sincos_random(look[HEADING, k])
        across, along = de * cosine - dn * sine, dn * cosine + de * sine
        hull = 0.5 * (abs(look[LENGTH, k] * across) + abs(look[BEAM, k] * along))
        width = look[RADIUS, k] + hull / max(d, _TINY)
        # the line of sight, turned by atan(width / d) to either side
        look[LOW, k] = _pseudo_bearing(dn * d + de * width, de * d - dn * width)
        look[HIGH, k] = _pseudo_bearing(dn * d - de * width, de * d + dn * width)
        look[WIDTH, k] = width
        look[RANGE, k] = d
    if w.land_id >= 0:
        for k in range(count):
            look[BEARING, k] = atan2(look[DE, k], look[DN, k])
            look[HALF, k] = atan2(look[WIDTH, k], look[RANGE, k])


@inner
def _cover(w, n, low, high):
    """Merge [low, high] into the n disjoint sorted intervals.  Returns (new n, whether it was covered already)."""
    lo, hi = w.lit_from, w.lit_to
    # first interval that ends at or after low
    a, b = 0, n
    while a < b:
        mid = (a + b) >> 1
        if hi[mid] < low:
            a = mid + 1
        else:
            b = mid
    if a < n and lo[a] <= low and hi[a] >= high:
        return n, True
    # last interval that starts at or before high
    last = a
    while last < n and lo[last] <= high:
        low = min(low, lo[last])
        high = max(high, hi[last])
        last += 1
    merged = last - a
    if merged == 0:
        for k in range(n, a, -1):
            lo[k] = lo[k - 1]
            hi[k] = hi[k - 1]
    elif merged > 1:
        for k in range(last, n):
            lo[k - merged + 1] = lo[k]
            hi[k - merged + 1] = hi[k]
    lo[a] = low
    hi[a] = high
    return n + 1 - merged, False


@inner
def cast_shadows(w, count):
    """Set ``w.hidden`` of the ``count`` sources of a look, in their order."""
    n = 0
    for i in range(count):
        low, high = w.look[LOW, i], w.look[HIGH, i]
        if high < low:  # crosses due south, where bearings jump
            n, first = _cover(w, n, low, _SOUTH)
            n, second = _cover(w, n, -_SOUTH, high)
            w.hidden[i] = first and second
        else:
            n, covered = _cover(w, n, low, high)
            w.hidden[i] = covered
