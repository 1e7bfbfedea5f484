"""Questions to a coast of the pool (world/land.py): how near is a hull, what does a ray meet, where is land nearest.

A coast is a block of the pool that a uniform grid indexes.  Its edges are cut where they cross grid lines, so that every
piece belongs to one cell; cells of a row lie side by side, and so do their pieces.  A cell also knows the piece nearest to
its centre, a lower bound of the distance from anywhere in it to land, and whether its centre is on land.  A question far
from land is therefore answered by one look at a cell, one near land by a few pieces, however long the coast is.
"""

from __future__ import annotations

import math

import numpy as np

from ..jit import inner, scalar
from ..trig import PI, TWO_PI, atan2
from .geometry import point_segment
from .state import L

# header of a block: corner of the grid N, E [m]; side of a cell [m]; rows (north), columns (east)
# and, for what looks far around, the uncut edges in runs of RUN and groups of RUN runs: where the groups begin in the block,
# how many; a group is the box (south, west, north, east) around it, the boxes around its runs, and their edges
CORNER_N, CORNER_E, SIDE, ROWS, COLUMNS, EDGES, GROUPS, CELLS = 0, 1, 2, 3, 4, 5, 6, 7
RUN = 8
RINGS = 3  #: in which it looks, each four times as far as the one before
FEW_CELLS = 12.0  #: up to so many to a side, what looks around goes by cells
# four numbers per cell from CELLS on, and one more cell as the end of the last; places of pieces count from the block
FIRST, NEAREST, CLEARANCE, ON_LAND, CELL = 0, 1, 2, 3, 4
PIECE = 4  #: numbers of a piece: N, E of its ends
BOX = 4

EXACT = 100.0  #: [m] distances below are exact; beyond, to the piece that is nearest to the cell's centre
_NUDGE = 1.0e-7  #: [m] over a grid line
_BORDERS = np.column_stack([f(np.arange(L + 1) * (TWO_PI / L)) for f in (np.sin, np.cos)])
"""sine and cosine of the bearings at which sectors begin, and the last one ends [L + 1, 2]"""


@inner
def coast(land, coast_id):
    """Where the block of a coast begins in the pool; 0 for none."""
    return int(land[1 + coast_id]) if 0 <= coast_id < land[0] else 0


@inner
def _index(land, h, axis, x):
    """Row (axis 0) or column (1) of the grid of block h that holds a coordinate [m], the nearest one outside of it."""
    k = math.floor((x - land[h + axis]) / land[h + SIDE])
    return int(min(max(k, 0.0), land[h + ROWS + axis] - 1.0))


@inner
def _cell(land, h, row, column):
    """Where the cell begins in the pool."""
    return h + CELLS + CELL * (row * int(land[h + COLUMNS]) + column)


@inner
def clearance(land, h, n, e):
    """A lower bound of the distance of a place from land [m]; 0 near land."""
    row, column = _index(land, h, 0, n), _index(land, h, 1, e)
    bound = land[_cell(land, h, row, column) + CLEARANCE]
    # outside of the grid: less the way to the cell
    side = land[h + SIDE]
    low_n, low_e = land[h + CORNER_N] + row * side, land[h + CORNER_E] + column * side
    dn, de = max(low_n - n, n - low_n - side, 0.0), max(low_e - e, e - low_e - side, 0.0)
    return max(bound - dn - de, 0.0)


@inner
def _left(an, ae, bn, be, pn, pe):
    """Twice the signed area of the triangle a, b, p."""
    return (bn - an) * (pe - ae) - (be - ae) * (pn - an)


@inner
def crosses(an, ae, bn, be, pn, pe, qn, qe):
    """True if the way from p to q crosses the piece a, b; a way through an end that two pieces share crosses one of them."""
    if (_left(pn, pe, qn, qe, an, ae) >= 0.0) == (_left(pn, pe, qn, qe, bn, be) >= 0.0):
        return False
    return (_left(an, ae, bn, be, pn, pe) > 0.0) != (_left(an, ae, bn, be, qn, qe) > 0.0)


@inner
def on_land(land, h, n, e):
    """True if a place lies on land."""
    side = land[h + SIDE]
    row, column = math.floor((n - land[h + CORNER_N]) / side), math.floor((e - land[h + CORNER_E]) / side)
    if row < 0 or column < 0 or row >= land[h + ROWS] or column >= land[h + COLUMNS]:
        return False
    c = _cell(land, h, int(row), int(column))
    inside = land[c + ON_LAND] != 0.0
    cn, ce = land[h + CORNER_N] + (row + 0.5) * side, land[h + CORNER_E] + (column + 0.5) * side
    for i in range(h + int(land[c + FIRST]), h + int(land[c + CELL + FIRST]), PIECE):
        if crosses(land[i], land[i + 1], land[i + 2], land[i + 3], n, e, cn, ce):
            inside = not inside
    return inside


@inner
def segment_hull(hull, an, ae, bn, be):
    """Distance of a segment from a convex clockwise polygon [n, 2] [m], 0 when they touch or overlap."""
    corners = hull.shape[0]
    best = math.inf
    apart = False
    low, high = math.inf, -math.inf
    for i in range(corners):
        k = i + 1 if i + 1 < corners else 0
        pn, pe, qn, qe = hull[i, 0], hull[i, 1], hull[k, 0], hull[k, 1]
        a, b = _left(pn, pe, qn, qe, an, ae), _left(pn, pe, qn, qe, bn, be)
        if a < 0.0 and b < 0.0:  # beyond this edge with both ends
            apart = True
        side = _left(an, ae, bn, be, pn, pe)
        low, high = min(low, side), max(high, side)
        best = min(best, point_segment(an, ae, pn, pe, qn, qe), point_segment(bn, be, pn, pe, qn, qe),
                   point_segment(pn, pe, an, ae, bn, be))  # fmt: skip
    return best if apart or low > 0.0 or high < 0.0 else 0.0


@inner
def hull_land(land, h, hull, n, e, reach, exact):
    """Distance of a hull from land [m], 0 aground.

    hull [5, 2] with its centre at (n, e) and no corner farther from it than ``reach``.  Below ``exact`` metres the distance
    is exact; beyond, it is that of the piece nearest to the centre of the cell.
    """
    c = _cell(land, h, _index(land, h, 0, n), _index(land, h, 1, e))
    i = h + int(land[c + NEAREST])
    best = segment_hull(hull, land[i], land[i + 1], land[i + 2], land[i + 3])
    if on_land(land, h, n, e):
        return 0.0
    if clearance(land, h, n, e) - reach > exact or best == 0.0:
        return best
    first, last = _index(land, h, 1, e - reach - best), _index(land, h, 1, e + reach + best)
    for row in range(_index(land, h, 0, n - reach - best), _index(land, h, 0, n + reach + best) + 1):
        end = h + int(land[_cell(land, h, row, last) + CELL + FIRST])
        for i in range(h + int(land[_cell(land, h, row, first) + FIRST]), end, PIECE):
            if point_segment(n, e, land[i], land[i + 1], land[i + 2], land[i + 3]) - reach < best:
                best = min(best, segment_hull(hull, land[i], land[i + 1], land[i + 2], land[i + 3]))
    return best


@inner
def ray_range(land, h, n, e, dn, de, reach):
    """How far [m] a ray goes from (n, e) along the unit vector (dn, de) until it meets land, at most ``reach``."""
    side = land[h + SIDE]
    low_n, low_e = land[h + CORNER_N], land[h + CORNER_E]
    t, end = 0.0, reach
    # the part of the ray within the grid
    for axis in range(2):
        x, d, low = (n, dn, low_n) if axis == 0 else (e, de, low_e)
        high = low + side * land[h + ROWS + axis]
        if d == 0.0:
            if x < low or x > high:
                return reach
        else:
            a, b = (low - x) / d, (high - x) / d
            t, end = max(t, min(a, b)), min(end, max(a, b))
    while t < end:
        pn, pe = n + t * dn, e + t * de
        row, column = _index(land, h, 0, pn), _index(land, h, 1, pe)
        c = _cell(land, h, row, column)
        nearest = math.inf
        for i in range(h + int(land[c + FIRST]), h + int(land[c + CELL + FIRST]), PIECE):
            an, ae = land[i] - n, land[i + 1] - e
            bn, be = land[i + 2] - n, land[i + 3] - e
            a, b = dn * ae - de * an, dn * be - de * bn  # offsets of the ends to starboard of the ray
            if (a >= 0.0) != (b >= 0.0):
                s = a / (a - b)
                hit = (an + s * (bn - an)) * dn + (ae + s * (be - ae)) * de
                if hit >= 0.0:
                    nearest = min(nearest, hit)
        if nearest < math.inf:
            return min(nearest, reach)
        # on to the next cell, or farther if nothing is near
        tn = te = math.inf
        if dn != 0.0:
            tn = (low_n + side * (row + (1 if dn > 0.0 else 0)) - n) / dn
        if de != 0.0:
            te = (low_e + side * (column + (1 if de > 0.0 else 0)) - e) / de
        t = max(min(tn, te), t + land[c + CLEARANCE]) + _NUDGE
    return reach


@inner
def sector_bearing(i):
    """Bearing [rad] at which sector i begins."""
    return i * (TWO_PI / L)


@inner
def sector_of(bearing):
    """Sector of a bearing in [-pi, pi]."""
    i = math.floor((bearing + TWO_PI if bearing < 0.0 else bearing) * (L / TWO_PI))
    return min(max(i, 0), L - 1)


@inner
def _in_sector(i, n, e):
    """True if the point (n, e), relative to the observer, lies in sector i."""
    return _BORDERS[i, 1] * e >= _BORDERS[i, 0] * n and _BORDERS[i + 1, 1] * e < _BORDERS[i + 1, 0] * n


@scalar
def _closest_point(an, ae, bn, be):
    """Point of the segment a, b that is nearest to the origin."""
    dn, de = bn - an, be - ae
    length2 = dn * dn + de * de
    t = min(max(-(an * dn + ae * de) / length2, 0.0), 1.0) if length2 > 0.0 else 0.0
    return an + t * dn, ae + t * de


@scalar
def _keep(out, i, n, e):
    """Keep a point (relative to the observer) in out[i] if it is nearer than what is there."""
    if not n * n + e * e >= out[i, 0] * out[i, 0] + out[i, 1] * out[i, 1]:  # nothing was there: NaN
        out[i, 0] = n
        out[i, 1] = e


@inner
def _worth_a_look(land, box, n, e, inner2, outer2, out):
    """True if a box begins more than sqrt(inner2) and at most sqrt(outer2) metres from (n, e), and out has not something
    nearer in each of its sectors."""
    south, west, north, east = land[box] - n, land[box + 1] - e, land[box + 2] - n, land[box + 3] - e
    dn, de = max(south, -north, 0.0), max(west, -east, 0.0)
    d2 = dn * dn + de * de
    if d2 <= inner2 or d2 > outer2:
        return False
    cn, ce = 0.5 * (south + north), 0.5 * (west + east)
    radius2 = (north - cn) * (north - cn) + (east - ce) * (east - ce)
    clear2 = cn * cn + ce * ce - radius2
    if not clear2 > radius2:
        return True
    first, count = bearing_sectors(atan2(ce, cn), math.sqrt(radius2 / clear2))  # the tangent of its half-angle: not less
    for k in range(first, first + count):
        i = k - L if k >= L else k
        if not out[i, 0] * out[i, 0] + out[i, 1] * out[i, 1] < d2:
            return True
    return False


@inner
def _keep_nearest(land, begin, end, n, e, reach, out):
    """Keep what of the pieces or edges from ``begin`` to ``end`` is nearest in its sector."""
    last_n = last_e = math.nan  # where the edge before ended, and in which sector: most begin there
    last = 0
    for k in range(begin, end, PIECE):
        an, ae, bn, be = land[k] - n, land[k + 1] - e, land[k + 2] - n, land[k + 3] - e
        pn, pe = _closest_point(an, ae, bn, be)
        if pn * pn + pe * pe > reach * reach:
            continue
        first = last if an == last_n and ae == last_e else sector_of(atan2(ae, an))
        clockwise = an * be - ae * bn >= 0.0
        last, last_n, last_e = first, bn, be
        if not _in_sector(first, bn, be):
            last = (first + 1 if first + 1 < L else 0) if clockwise else (first - 1 if first > 0 else L - 1)
            if not _in_sector(last, bn, be):
                last = sector_of(atan2(be, bn))
        if first == last:
            _keep(out, first, pn, pe)
        elif clockwise:
            _keep_parts(out, first, last, an, ae, bn, be)
        else:
            _keep_parts(out, last, first, bn, be, an, ae)


@inner
def nearest_land(land, h, n, e, reach, out):
    """Nearest land in each bearing sector around (n, e), within ``reach`` metres.

    Writes out [L, 2]: the point relative to (n, e), N and E [m], NaN where there is none.  Nothing on land can hide it,
    because what hides it is nearer and in the same sector.  Returns False if it is clear without a look that there is none.
    """
    for i in range(L):
        out[i, 0] = out[i, 1] = math.nan
    if clearance(land, h, n, e) > reach:
        return False
    if reach <= FEW_CELLS * land[h + SIDE]:
        first, last = _index(land, h, 1, e - reach), _index(land, h, 1, e + reach)
        for row in range(_index(land, h, 0, n - reach), _index(land, h, 0, n + reach) + 1):
            begin = h + int(land[_cell(land, h, row, first) + FIRST])
            _keep_nearest(land, begin, h + int(land[_cell(land, h, row, last) + CELL + FIRST]), n, e, reach, out)
    else:
        _look_far(land, h, n, e, reach, out)
    for i in range(L):
        if out[i, 0] * out[i, 0] + out[i, 1] * out[i, 1] > reach * reach:  # the rest of a piece that begins in reach
            out[i, 0] = out[i, 1] = math.nan
    return True


@inner
def _look_far(land, h, n, e, reach, out):
    """The same with edges by their boxes: a box that is behind what is found already has nothing to add."""
    begin, size = h + int(land[h + EDGES]), BOX + RUN * (BOX + RUN * PIECE)
    end = begin + size * int(land[h + GROUPS])
    inner2 = -1.0
    for ring in range(RINGS):  # what is near goes first, so that most of what is far is behind it
        outer2 = reach * reach * 0.0625 ** (RINGS - 1 - ring)
        for group in range(begin, end, size):
            if _worth_a_look(land, group, n, e, -1.0, outer2, out):
                for k in range(RUN):
                    if _worth_a_look(land, group + BOX * (1 + k), n, e, inner2, outer2, out):
                        run = group + BOX * (1 + RUN) + RUN * PIECE * k
                        _keep_nearest(land, run, run + RUN * PIECE, n, e, reach, out)
        inner2 = outer2


@inner
def _keep_parts(out, i, last, an, ae, bn, be):
    """Cut the piece a, b (clockwise, relative to the observer, from sector i to ``last``) at the borders of the sectors.

    What is nearest in each of them is kept.
    """
    count = (last - i + L) % L
    if count > L // 2:  # on a line with the observer, and on a border
        count = 0
    for _ in range(count):
        # the border ahead: where the piece meets the ray that ends sector i
        s, c = _BORDERS[i + 1, 0], _BORDERS[i + 1, 1]
        a, b = an * s - ae * c, bn * s - be * c
        t = min(max(a / (a - b), 0.0), 1.0) if a != b else 0.0
        qn, qe = an + t * (bn - an), ae + t * (be - ae)
        pn, pe = _closest_point(an, ae, qn, qe)
        _keep(out, i, pn, pe)
        an, ae = qn, qe
        i = i + 1 if i + 1 < L else 0
    pn, pe = _closest_point(an, ae, bn, be)
    _keep(out, i, pn, pe)


@inner
def bearing_sectors(bearing, half):
    """First sector that an arc of ``half`` [rad] to either side of a bearing touches, and how many there are."""
    first = math.floor((bearing - half) * (L / TWO_PI))
    count = math.floor((bearing + half) * (L / TWO_PI)) - first + 1
    return int(first + L) % L, int(min(count, L)) if half < PI else L
