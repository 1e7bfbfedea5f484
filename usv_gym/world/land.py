"""Land as kernels see it: one flat pool, never written to, of indexed coasts that any number of worlds share.

A world names its coast by ``land_id`` (truth) and ``chart_id`` (what the own ship's chart shows), both -1 for none; the
pool itself is an argument of the batch kernels and never part of a record.  Layout: how many coasts there are, where the
block of each begins, the blocks.  A block has no pointers out of itself (its layout: world/shore.py).
"""

from __future__ import annotations

import functools
import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Ring = NDArray[np.float64]  #: [n, 2] N, E [m] {n}; the last corner is joined to the first
Block = NDArray[np.float64]  #: an indexed coast

#: the pool of the open sea
NO_LAND: NDArray[np.float64] = np.zeros(1)

CELLS_PER_EDGE, FEWEST, MOST = 16.0, 4096, 131072  #: cells of an index
SMALLEST_SIDE = 10.0  #: [m] of a cell


@dataclass(frozen=True, eq=False)
class Polygon:
    """Land with its lakes: a ring around it, rings around the holes."""

    shell: Ring
    holes: tuple[Ring, ...] = ()

    @property
    def rings(self) -> tuple[Ring, ...]:
        """Shell and holes."""
        return self.shell, *self.holes


Coast = tuple[Polygon, ...]  #: polygons that do not overlap


def index_coast(coast: Sequence[Polygon]) -> Block:
    """The block of a coast: its edges, cut and sorted into the cells of a grid (see world/shore.py).

    Raises
    ------
    ValueError
        if there is no polygon, or a ring has fewer than three corners.
    """
    from .land_index import centres_on_land, cut, nearest_pieces
    from .shore import CELLS, RUN

    edges = _edges(ring for polygon in coast for ring in polygon.rings)
    low = edges.reshape(-1, 2).min(axis=0)
    high = edges.reshape(-1, 2).max(axis=0)
    cells = min(max(CELLS_PER_EDGE * len(edges), FEWEST), MOST)
    side = max(math.sqrt(float(np.prod(high - low + 1.0)) / cells), SMALLEST_SIDE)
    while True:
        # a margin of water all around; its odd width keeps centres and grid lines off the corners of drawn shapes
        corner = low - side * (1.0 + np.array([0.3819660113, 0.2360679775]))
        rows, columns = (int(k) for k in np.ceil((high - corner) / side + 1.0))
        n, e = corner.tolist()
        count = cut(edges, n, e, side, columns, np.zeros(0, np.int64), np.zeros((0, 4)))
        cell, pieces = np.zeros(count, np.int64), np.zeros((count, 4))
        cut(edges, n, e, side, columns, cell, pieces)
        order = np.argsort(cell, kind="stable")
        pieces = pieces[order]
        first = np.searchsorted(cell[order], np.arange(rows * columns + 1))
        distance, nearest = np.zeros(rows * columns), np.zeros(rows * columns, np.int64)
        nearest_pieces(first, pieces, n, e, side, rows, columns, distance, nearest)
        if distance.min() > 1e-7:
            break
        side *= 1.0123456789  # a centre lies on the shore: whether it is on land would be chance
    inside = np.zeros(rows * columns, np.int8)
    centres_on_land(first, pieces, n, e, side, rows, columns, inside)
    table = np.zeros((rows * columns + 1, 4))
    start = CELLS + table.size
    table[:, 0] = start + 4 * first
    table[:-1, 1] = start + 4 * nearest
    # to be used as "nothing is nearer": less what rounding may do
    table[:-1, 2] = np.maximum(distance - side * math.sqrt(0.5) - 1e-6, 0.0)
    table[:-1, 3] = inside
    groups = _groups(edges, RUN)
    header = [n, e, side, rows, columns, start + pieces.size, len(groups)]
    return np.concatenate([header, table.ravel(), pieces.ravel(), groups.ravel()])


def _groups(edges: NDArray[np.float64], run: int) -> NDArray[np.float64]:
    """Edges [E, 4] in groups: each the box around it, the boxes of its runs, their edges (see world/shore.py)."""
    last = len(edges) - 1
    runs = edges[np.minimum(np.arange(-(-len(edges) // run) * run), last)].reshape(-1, run, 2, 2)  # the last repeats
    boxes = np.hstack([runs.min(axis=(1, 2)), runs.max(axis=(1, 2))])
    missing = -len(runs) % run  # a group of less than so many runs has boxes at infinity
    boxes = np.vstack([boxes, np.full((missing, 4), np.inf)]).reshape(-1, run, 4)
    around = np.hstack([boxes[..., :2].min(axis=1), np.where(boxes < np.inf, boxes, -np.inf)[..., 2:].max(axis=1)])
    content = np.concatenate([runs.ravel(), np.zeros(missing * run * 4)])
    return np.hstack([around, boxes.reshape(len(boxes), -1), content.reshape(len(boxes), -1)])


def _edges(rings: Iterable[Ring]) -> NDArray[np.float64]:
    """Edges [E, 4] of closed rings, without those of no length."""
    parts = []
    for ring in rings:
        if len(ring) < 3:
            raise ValueError(f"a ring needs three corners, got {len(ring)}")
        parts.append(np.hstack([ring, np.roll(ring, -1, axis=0)]))
    if not parts:
        raise ValueError("a coast needs a polygon")
    edges = np.concatenate(parts)
    kept: NDArray[np.float64] = edges[(edges[:, :2] != edges[:, 2:]).any(axis=1)]
    return kept


@functools.lru_cache(maxsize=16)
def land_pool(coasts: tuple[Coast, ...]) -> NDArray[np.float64]:
    """The pool of coasts 0, 1, ..; the same coasts share one pool."""
    if not coasts:
        return NO_LAND
    blocks = [index_coast(coast) for coast in coasts]
    starts = 1 + len(blocks) + np.cumsum([0, *(len(block) for block in blocks)])
    pool: NDArray[np.float64] = np.concatenate([[len(blocks)], starts[:-1], *blocks])
    return pool
