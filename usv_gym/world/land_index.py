"""The index of a coast, built once when it is loaded: pieces by cell, the nearest of them, what lies on land."""

from __future__ import annotations

import math

from ..jit import inner, kernel
from .geometry import point_segment
from .shore import crosses


@inner
def _next_line(x, d, low, side):
    """Parameter at which x + t d next meets a grid line, and by how much it grows from line to line."""
    if d == 0.0:
        return math.inf, math.inf
    k = math.floor((x - low) / side)
    line = low + side * (k + 1 if d > 0.0 else k)
    t = (line - x) / d
    step = side / abs(d)
    return (t if t > 0.0 else t + step), step


@kernel
def cut(edges, low_n, low_e, side, columns, cells, pieces):
    """Cut edges [E, 4] where they cross grid lines; returns how many pieces there are.

    Writes the cell of each into cells [n] and its ends into pieces [n, 4], as far as there is room.
    """
    count = 0
    for k in range(edges.shape[0]):
        an, ae = edges[k, 0], edges[k, 1]
        dn, de = edges[k, 2] - an, edges[k, 3] - ae
        tn, step_n = _next_line(an, dn, low_n, side)
        te, step_e = _next_line(ae, de, low_e, side)
        t = 0.0
        while t < 1.0:
            end = min(tn, te, 1.0)
            if tn <= end:
                tn += step_n
            if te <= end:
                te += step_e
            if end > t:
                if count < cells.shape[0]:
                    middle = 0.5 * (t + end)
                    row = math.floor((an + middle * dn - low_n) / side)
                    column = math.floor((ae + middle * de - low_e) / side)
                    cells[count] = int(row) * columns + int(column)
                    pieces[count, 0] = an + t * dn
                    pieces[count, 1] = ae + t * de
                    pieces[count, 2] = edges[k, 2] if end == 1.0 else an + end * dn
                    pieces[count, 3] = edges[k, 3] if end == 1.0 else ae + end * de
                count += 1
            t = end
    return count


@inner
def _search(first, pieces, columns, n, e, row, column, best):
    """Distance of the place (n, e) from the pieces of one cell, and which is nearest: (distance, piece), or what came in."""
    distance, piece = best
    k = row * columns + column
    for i in range(first[k], first[k + 1]):
        d = point_segment(n, e, pieces[i, 0], pieces[i, 1], pieces[i, 2], pieces[i, 3])
        if d < distance:
            distance, piece = d, i
    return distance, piece


@kernel
def nearest_pieces(first, pieces, low_n, low_e, side, rows, columns, distance, nearest):
    """For the centre of every cell the piece that is nearest, and how far it is: nearest, distance [rows * columns].

    The distance cannot change by more than the way from one centre to the next, so that only a few rings of cells around
    where the last one was have to be searched.
    """
    before = 0
    for row in range(rows):
        for k in range(columns):
            column = k if row % 2 == 0 else columns - 1 - k  # to and fro: neighbours follow each other
            n, e = low_n + (row + 0.5) * side, low_e + (column + 0.5) * side
            i = before
            best = (point_segment(n, e, pieces[i, 0], pieces[i, 1], pieces[i, 2], pieces[i, 3]) + 1.0e-12, i)
            start = max(best[0] - 2.0 * side, 0.0) if row + k > 0 else 0.0
            ring = max(int(start / (math.sqrt(2.0) * side)) - 1, 0)
            while (ring - 0.5) * side <= best[0] and ring <= max(rows, columns):
                for r in range(max(row - ring, 0), min(row + ring, rows - 1) + 1):
                    if r == row - ring or r == row + ring:
                        for c in range(max(column - ring, 0), min(column + ring, columns - 1) + 1):
                            best = _search(first, pieces, columns, n, e, r, c, best)
                    else:
                        if column - ring >= 0:
                            best = _search(first, pieces, columns, n, e, r, column - ring, best)
                        if column + ring < columns:
                            best = _search(first, pieces, columns, n, e, r, column + ring, best)
                ring += 1
            before = best[1]
            distance[row * columns + column] = best[0]
            nearest[row * columns + column] = before


@kernel
def centres_on_land(first, pieces, low_n, low_e, side, rows, columns, inside):
    """Whether the centre of each cell lies on land, inside [rows * columns]; the outermost column must be water."""
    for row in range(rows):
        n = low_n + (row + 0.5) * side
        land = False
        inside[row * columns] = 0
        for column in range(1, columns):
            e = low_e + (column + 0.5) * side
            for k in range(row * columns + column - 1, row * columns + column + 1):
                for i in range(first[k], first[k + 1]):
                    if crosses(pieces[i, 0], pieces[i, 1], pieces[i, 2], pieces[i, 3], n, e - side, n, e):
                        land = not land
            inside[row * columns + column] = land
