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
_OUTWARD = np.clip(1.5 * _DIRECTIONS, -1.0, 1.0)
_DISTANCES = (0.0, 7.0, 16.0, 28.0, 44.0, 64.0, 90.0)


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
    hard = np.zeros((len(keep_out) + len(requests), 4))  # what is taken
    hard[: len(keep_out)] = np.reshape(keep_out, (-1, 4))
    taken = len(keep_out)
    soft = np.array(avoid, dtype=np.float64).reshape(-1, 4)
    for i in sorted(range(len(requests)), key=lambda k: -requests[k].priority):
        request = requests[i]
        if not (frame[0] <= request.anchor[0] <= frame[2] and frame[1] <= request.anchor[1] <= frame[3]):
            continue  # what it belongs to is out of sight
        box = _best(request, frame, hard[:taken], soft)
        if box is not None:
            hard[taken] = box
            taken += 1
            out[i] = Placed(box, _leader(request, box))
    return out


def _best(request: Request, frame: Box, hard: Boxes, soft: Boxes) -> Box | None:
    """The cheapest free box, looking further away only while that could be cheaper."""
    (w, h), (x, y) = request.size, request.anchor
    half = np.array((0.5 * w, 0.5 * h))
    if request.fixed:
        box = (x - 0.5 * w, y - 0.5 * h, x + 0.5 * w, y + 0.5 * h)
        free = _inside(np.array([box]), frame)[0] and not _overlap(np.array([box]), np.vstack((hard, soft))).any()
        return box if free else None
    best, cheapest = None, math.inf
    for distance in _DISTANCES:
        if distance > request.far or 0.45 * distance >= cheapest:
            break
        # a box touches the circle of `reach`: its centre is further out by its own half extent in that direction
        reach = request.clearance + GAP + distance
        centres = (x, y) + reach * _DIRECTIONS + half * _OUTWARD
        boxes = np.hstack((centres - half, centres + half))
        free = _inside(boxes, frame) & (_overlap(boxes, hard).sum(axis=1) == 0.0)
        if not free.any():
            continue
        covered = _overlap(boxes, soft).sum(axis=1) / (w * h)
        cost = np.where(free, 0.45 * distance + _PREFERENCE + 60.0 * covered, math.inf)
        k = int(cost.argmin())
        if cost[k] < cheapest:
            best, cheapest = boxes[k], float(cost[k])
    return None if best is None else tuple(best.tolist())


def _inside(boxes: Boxes, frame: Box) -> NDArray[np.bool_]:
    """Which boxes [n, 4] lie in the frame."""
    inside = (boxes[:, :2] >= frame[:2]) & (boxes[:, 2:] <= frame[2:])
    return np.asarray(inside.all(axis=1))


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
