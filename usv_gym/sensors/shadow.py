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
    """Fill ranges, bearings, half_angles and widths (half the width shown) of all sources within ``reach`` metres of vessel ``own``.

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
    if near == 0:
        return count
    for s in range(V + M):
        if not w.ranges[s] <= reach2:
            continue
        if s < V:
            row = v.eta[s, 0] - n0, v.eta[s, 1] - e0, v.eta[s, 2], v.length[s], v.beam[s], 0.0
        else:
            row = m.position[s - V, 0] - n0, m.position[s - V, 1] - e0, 0.0, 0.0, 0.0, m.radius[s - V]
        for i in range(6):
            w.look[i, count] = row[i]
        w.order[count] = s
        count += 1
    for k in range(count):  # vector code
        dn, de = w.look[0, k], w.look[1, k]
        d = math.sqrt(dn * dn + de * de)
        bearing = atan2(de, dn)
        width = w.look[5, k] + half_width(w.look[3, k], w.look[4, k], bearing - w.look[2, k])  # a hull's, or a disc's
        w.look[6, k] = bearing
        w.look[7, k] = atan2(width, d)
        w.look[8, k] = width
    for k in range(count):
        s = w.order[k]
        w.ranges[s] = math.sqrt(w.ranges[s])
        w.bearings[s] = w.look[6, k]
        w.half_angles[s] = w.look[7, k]
        w.widths[s] = w.look[8, k]
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
