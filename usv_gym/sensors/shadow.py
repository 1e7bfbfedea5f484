"""Radar and LiDAR shadow: which sources an observer has no line of sight to.

Seen from the sensor every source covers an interval of bearings: that of a disc is atan(radius / d) to either side, that
of a hull the same with half its projected width.  A source is hidden only if the whole of its interval is covered by the
intervals of nearer sources together (thesis 2.3.1 and 6.2.3; there only its centre counted, and one occluder at a time).

Sources are taken in the order of range, and their intervals merged into a sorted list of disjoint lit intervals; a source
whose interval lies inside one of them is hidden.  Cost: O(S log S) plus the insertions.
"""

from __future__ import annotations

import math

from ..jit import inner
from ..trig import PI, TWO_PI, atan2, wrap
from ..world.geometry import half_width


@inner
def look_around(w, own, reach):
    """Fill ranges, bearings, half_angles and widths of all sources within ``reach`` metres of vessel ``own``.

    A width is half of what the source shows [m].

    Returns how many there are; ``w.order[:count]`` are their indices, nearest first.
    """
    v, m = w.vessels, w.obstacles
    V, M = v.active.shape[0], m.active.shape[0]
    n0, e0 = v.eta[own, 0], v.eta[own, 1]
    reach2 = reach * reach
    # squared distances first, without a branch, so that it becomes vector code: a LiDAR mostly looks at an empty sea
    near = 0
    for s in range(V):
        dn, de = v.eta[s, 0] - n0, v.eta[s, 1] - e0
        d2 = dn * dn + de * de if (v.active[s] != 0) & (s != own) else math.inf
        w.ranges[s] = d2
        near += d2 <= reach2
    for i in range(M):
        dn, de = m.position[i, 0] - n0, m.position[i, 1] - e0
        d2 = dn * dn + de * de if m.active[i] != 0 else math.inf
        w.ranges[V + i] = d2
        near += d2 <= reach2
    count = 0
    if near > 0:
        for s in range(V + M):
            if w.ranges[s] <= reach2:
                _note(w, n0, e0, s, count)
                count += 1
    return _work_out(w, count)


@inner
def look_at(w, own, reach, sources, n):
    """The same of the first n of some sources, in rising order, all of which are there."""
    v, m = w.vessels, w.obstacles
    V = v.active.shape[0]
    n0, e0 = v.eta[own, 0], v.eta[own, 1]
    count = 0
    for i in range(n):
        s = sources[i]
        if s < V:
            dn, de = v.eta[s, 0] - n0, v.eta[s, 1] - e0
        else:
            dn, de = m.position[s - V, 0] - n0, m.position[s - V, 1] - e0
        if dn * dn + de * de <= reach * reach:
            _note(w, n0, e0, s, count)
            count += 1
    return _work_out(w, count)


@inner
def _note(w, n0, e0, s, k):
    """Source s is number k in reach of (n0, e0): write down what vector code needs of it."""
    v, m, look = w.vessels, w.obstacles, w.look
    V = v.active.shape[0]
    w.order[k] = s
    if s < V:
        look[0, k] = v.eta[s, 0] - n0
        look[1, k] = v.eta[s, 1] - e0
        look[2, k] = v.eta[s, 2]
        look[3, k] = v.length[s]
        look[4, k] = v.beam[s]
        look[5, k] = 0.0
    else:
        look[0, k] = m.position[s - V, 0] - n0
        look[1, k] = m.position[s - V, 1] - e0
        look[2, k] = look[3, k] = look[4, k] = 0.0
        look[5, k] = m.radius[s - V]


@inner
def _work_out(w, count):
    """Ranges, bearings and widths of the ``count`` sources that were noted, and their order; returns ``count``."""
    look = w.look
    for k in range(count):  # vector code
        dn, de = look[0, k], look[1, k]
        d = math.sqrt(dn * dn + de * de)
        bearing = atan2(de, dn)
        width = look[5, k] + half_width(look[3, k], look[4, k], bearing - look[2, k])  # a disc's, or a hull's
        look[6, k] = bearing
        look[7, k] = atan2(width, d)
        look[8, k] = width
        look[9, k] = d
    for k in range(count):
        s = w.order[k]
        w.bearings[s] = look[6, k]
        w.half_angles[s] = look[7, k]
        w.widths[s] = look[8, k]
        w.ranges[s] = look[9, k]
    _sort_by_range(w, count)
    return count


@inner
def _sort_by_range(w, count):
    """Shell sort of ``w.order[:count]`` (Ciura's gaps); ties keep the lower index first."""
    for gap in (132, 57, 23, 10, 4, 1):
        for i in range(gap, count):
            s = w.order[i]
            d = w.ranges[s]
            k = i
            while k >= gap:
                t = w.order[k - gap]
                if w.ranges[t] < d or (w.ranges[t] == d and t < s):
                    break
                w.order[k] = t
                k -= gap
            w.order[k] = s


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
    """Set ``w.hidden`` of the ``count`` sources that look_around() found."""
    n = 0
    for i in range(count):
        s = w.order[i]
        half = w.half_angles[s]
        low = wrap(w.bearings[s] - half)
        high = low + 2.0 * half
        if high >= PI:  # crosses due south, where bearings jump
            n, first = _cover(w, n, low, PI)
            n, second = _cover(w, n, -PI, high - TWO_PI)
            w.hidden[s] = first and second
        else:
            n, covered = _cover(w, n, low, high)
            w.hidden[s] = covered
