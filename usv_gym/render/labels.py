"""Where labels go: greedy placement on the picture, so that none overlaps another or leaves the frame.

Pure geometry in pixels; a box is left, top, right, bottom.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Box = tuple[float, float, float, float]
Boxes = NDArray[np.float64]

GAP = 3.0  #: [px] between an object and its label
LEADER = 14.0  #: [px] a label further from its object than this gets a line to it
#: right and left first, as people expect; then the corners, above and below (x, y), y down
_ANGLES = np.radians([0, 180, 45, -45, 135, -135, 90, -90, 20, -20, 160, -160])
_DIRECTIONS = np.column_stack((np.cos(_ANGLES), np.sin(_ANGLES)))
_PREFERENCE = np.array([0.0, 1.5, 1.0, 1.0, 2.5, 2.5, 3.0, 3.0, 0.8, 0.8, 2.0, 2.0])
_DISTANCES = np.array([0.0, 7.0, 16.0, 28.0, 44.0, 64.0, 90.0])


@dataclass(frozen=True)
class Request:
    """A label to place: its size and the place it belongs to [px].

    ``clearance`` is the radius of what is drawn at the anchor.  A ``fixed`` one is centred on its anchor or dropped,
    and covers nothing.
    """

    size: tuple[float, float]
    anchor: tuple[float, float]
    clearance: float = 0.0
    priority: float = 0.0
    fixed: bool = False
    far: float = 90.0  # [px] left out rather than moved further away than this


@dataclass(frozen=True)
class Placed:
    """Where a label goes, and whether it needs a line to its anchor."""

    box: Box
    leader: tuple[tuple[float, float], tuple[float, float]] | None = None


def place(
    requests: Sequence[Request], frame: Box, keep_out: Sequence[Box] = (), avoid: Sequence[Box] = ()
) -> list[Placed | None]:
    """Place labels, highest priority first; equal ones in their order.

    Parameters
    ----------
    requests
        the labels.
    frame
        no label leaves it.
    keep_out
        boxes no label may touch.
    avoid
        boxes that labels cover only when there is no better place.

    Returns
    -------
    list
        for each request its place, or None when there is none: two labels never overlap.
    """
    out: list[Placed | None] = [None] * len(requests)
    taken: list[Box] = list(keep_out)
    soft = np.array(avoid, dtype=np.float64).reshape(-1, 4)
    for i in sorted(range(len(requests)), key=lambda k: -requests[k].priority):
        request = requests[i]
        if not (frame[0] <= request.anchor[0] <= frame[2] and frame[1] <= request.anchor[1] <= frame[3]):
            continue  # what it belongs to is out of sight
        boxes, cost = _candidates(request)
        inside = (boxes[:, :2] >= frame[:2]).all(axis=1) & (boxes[:, 2:] <= frame[2:]).all(axis=1)
        hard = np.array(taken, dtype=np.float64).reshape(-1, 4)
        free = inside & (_overlap(boxes, hard).sum(axis=1) == 0.0)
        covered = _overlap(boxes, soft).sum(axis=1) / (request.size[0] * request.size[1])
        if request.fixed:
            free &= covered == 0.0
        if not free.any():
            continue
        cost = np.where(free, cost + 60.0 * covered, np.inf)
        best = int(cost.argmin())
        box: Box = tuple(float(x) for x in boxes[best])  # type: ignore[assignment]
        taken.append(box)
        out[i] = Placed(box, _leader(request, box))
    return out


def _candidates(request: Request) -> tuple[Boxes, NDArray[np.float64]]:
    """Boxes [n, 4] around the anchor and what each costs [n]."""
    w, h = request.size
    x, y = request.anchor
    if request.fixed:
        return np.array([(x - 0.5 * w, y - 0.5 * h, x + 0.5 * w, y + 0.5 * h)]), np.zeros(1)
    distances = _DISTANCES[request.far >= _DISTANCES, None]
    reach = request.clearance + GAP + distances
    # the box touches the circle of `reach`: its centre is further out by its own half extent in that direction
    cx = x + reach * _DIRECTIONS[:, 0] + 0.5 * w * np.clip(_DIRECTIONS[:, 0] * 1.5, -1.0, 1.0)
    cy = y + reach * _DIRECTIONS[:, 1] + 0.5 * h * np.clip(_DIRECTIONS[:, 1] * 1.5, -1.0, 1.0)
    boxes = np.stack((cx - 0.5 * w, cy - 0.5 * h, cx + 0.5 * w, cy + 0.5 * h), axis=-1).reshape(-1, 4)
    return boxes, (0.45 * distances + _PREFERENCE).ravel()


def _overlap(boxes: Boxes, others: Boxes) -> NDArray[np.float64]:
    """Shared areas [n, m]."""
    width = np.minimum(boxes[:, None, 2], others[None, :, 2]) - np.maximum(boxes[:, None, 0], others[None, :, 0])
    height = np.minimum(boxes[:, None, 3], others[None, :, 3]) - np.maximum(boxes[:, None, 1], others[None, :, 1])
    shared: NDArray[np.float64] = np.maximum(width, 0.0) * np.maximum(height, 0.0)
    return shared


def _leader(request: Request, box: Box) -> tuple[tuple[float, float], tuple[float, float]] | None:
    """From the rim of the object to the nearest point of the box, when that is not obvious anyway."""
    if request.fixed:
        return None
    x, y = request.anchor
    nearest = (min(max(x, box[0]), box[2]), min(max(y, box[1]), box[3]))
    d = math.hypot(nearest[0] - x, nearest[1] - y)
    if d - request.clearance < LEADER:
        return None
    k = request.clearance / d
    return (x + k * (nearest[0] - x), y + k * (nearest[1] - y)), nearest
