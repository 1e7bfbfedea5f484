"""Questions to a coast of the pool (world/land.py): how near is a hull, what does a ray meet, where is land nearest.

A coast is a block of the pool that a uniform grid indexes.  Its edges are cut where they cross grid lines, so that every
piece belongs to one cell; cells of a row lie side by side, and so do their pieces.  A cell also knows the piece nearest to
its centre, a lower bound of the distance from anywhere in it to land, and whether its centre is on land.  A question far
from land is therefore answered by one look at a cell, one near land by a few pieces, however long the coast is.
"""

from __future__ import annotations

import math

import numpy as np

from ..jit import inner
from ..trig import PI, TWO_PI, atan2
from .geometry import point_segment
from .state import L

# header of a block: corner of the grid N, E [m]; side of a cell [m]; rows (north), columns (east)
# and, for what looks far around, the uncut edges in runs of RUN, each behind the box (south, west, north, east) around it:
# where they begin in the block, how many runs
CORNER_N, CORNER_E, SIDE, ROWS, COLUMNS, EDGES, RUNS, CELLS = 0, 1, 2, 3, 4, 5, 6, 7
RUN = 8
# four numbers per cell from CELLS on, and one more cell as the end of the last; places of pieces count from the block
FIRST, NEAREST, CLEARANCE, ON_LAND, CELL = 0, 1, 2, 3, 4
PIECE = 4  #: numbers of a piece: N, E of its ends

EXACT = 100.0  #: [m] distances below are exact; beyond, to the piece that is nearest to the cell's centre
_NUDGE = 1.0e-7  #: [m] over a grid line
_ENDS = (np.arange(L) + 1.0) * (TWO_PI / L)  # bearings at which sectors end [L]
_BORDERS = np.column_stack([np.sin(_ENDS), np.cos(_ENDS)])  # [L, 2]


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
def _closest_part(out, i, an, ae, bn, be):
    """Keep in out[i] the point of the segment a, b (relative to the observer) if it is nearer than what is there."""
    dn, de = bn - an, be - ae
    length2 = dn * dn + de * de
    t = min(max(-(an * dn + ae * de) / length2, 0.0), 1.0) if length2 > 0.0 else 0.0
    pn, pe = an + t * dn, ae + t * de
    d2, old = pn * pn + pe * pe, out[i, 0] * out[i, 0] + out[i, 1] * out[i, 1]
    if not d2 >= old:  # nothing was there: NaN
        out[i, 0] = pn
        out[i, 1] = pe


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
    reach2 = reach * reach
    begin, size = h + int(land[h + EDGES]), 4 + RUN * PIECE
    for run in range(begin, begin + size * int(land[h + RUNS]), size):
        dn, de = max(land[run] - n, n - land[run + 2], 0.0), max(land[run + 1] - e, e - land[run + 3], 0.0)
        if dn * dn + de * de > reach2:
            continue
        last_n = last_e = math.nan  # where the edge before ended, and in which sector: most begin there
        last = 0
        for k in range(run + 4, run + size, PIECE):
            if point_segment(n, e, land[k], land[k + 1], land[k + 2], land[k + 3]) > reach:
                continue
            an, ae, bn, be = land[k] - n, land[k + 1] - e, land[k + 2] - n, land[k + 3] - e
            first = last if an == last_n and ae == last_e else sector_of(atan2(ae, an))
            last, last_n, last_e = sector_of(atan2(be, bn)), bn, be
            if an * be - ae * bn >= 0.0:  # a to b is clockwise
                _sectors_of_piece(out, first, last, an, ae, bn, be)
            else:
                _sectors_of_piece(out, last, first, bn, be, an, ae)
    for i in range(L):
        if out[i, 0] * out[i, 0] + out[i, 1] * out[i, 1] > reach2:
            out[i, 0] = out[i, 1] = math.nan
    return True


@inner
def _sectors_of_piece(out, i, last, an, ae, bn, be):
    """Cut the piece a, b (clockwise, relative to the observer, from sector i to ``last``) at the borders of the sectors.

    What is nearest in each of them is kept.
    """
    count = (last - i + L) % L
    if count > L // 2:  # on a line with the observer, and on a border
        count = 0
    pn, pe = an, ae
    for _ in range(count):
        # the border ahead: where the piece meets the ray that ends sector i
        s, c = _BORDERS[i, 0], _BORDERS[i, 1]
        p, b = pn * s - pe * c, bn * s - be * c
        t = p / (p - b) if p != b else 0.0
        t = min(max(t, 0.0), 1.0)
        qn, qe = pn + t * (bn - pn), pe + t * (be - pe)
        _closest_part(out, i, pn, pe, qn, qe)
        pn, pe = qn, qe
        i = i + 1 if i + 1 < L else 0
    _closest_part(out, i, pn, pe, bn, be)


@inner
def bearing_sectors(bearing, half):
    """First sector that an arc of ``half`` [rad] to either side of a bearing touches, and how many there are."""
    first = math.floor((bearing - half) * (L / TWO_PI))
    count = math.floor((bearing + half) * (L / TWO_PI)) - first + 1
    return int(first + L) % L, int(min(count, L)) if half < PI else L
