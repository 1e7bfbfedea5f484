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
#: right and left first, as people expect; then the corners, above and below: angle [deg], y down, and what it costs
_ANGLES = ((0, 0.0), (180, 1.5), (45, 1.0), (-45, 1.0), (135, 2.5), (-135, 2.5), (90, 3.0), (-90, 3.0), (20, 0.8),
           (-20, 0.8), (160, 2.0), (-160, 2.0))  # fmt: skip
_DISTANCES = (0.0, 7.0, 16.0, 28.0, 44.0, 64.0, 90.0)


def _candidate(angle: float, price: float, distance: float) -> tuple[float, ...]:
    x, y = math.cos(math.radians(angle)), math.sin(math.radians(angle))
    out_x, out_y = (min(max(1.5 * k, -1.0), 1.0) for k in (x, y))
    return price + 0.45 * distance, distance, x, y, out_x, out_y


#: cheapest first: price, distance [px], direction, and how far the box goes that way, in halves of its size
_CANDIDATES = sorted(_candidate(angle, price, d) for angle, price in _ANGLES for d in _DISTANCES)


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
    """The cheapest free box.  Plain numbers: the first few candidates are good enough nearly always."""
    (w, h), (x, y) = request.size, request.anchor
    reach = 0.0 if request.fixed else request.clearance + GAP + min(request.far, _DISTANCES[-1])
    around = (x - reach - w, y - reach - h, x + reach + w, y + reach + h)
    taken, bodies = _touching(hard, around), _touching(soft, around)
    if request.fixed:
        box = (x - 0.5 * w, y - 0.5 * h, x + 0.5 * w, y + 0.5 * h)
        return box if _inside(box, frame) and not any(_shared(box, other) for other in (*taken, *bodies)) else None
    best, cheapest = None, math.inf
    for price, distance, dx, dy, out_x, out_y in _CANDIDATES:
        if price >= cheapest:
            break
        if distance > request.far:
            continue
        # the box touches the circle of `r`: its centre is further out by its own half extent in that direction
        r = request.clearance + GAP + distance
        left, top = x + r * dx + 0.5 * w * (out_x - 1.0), y + r * dy + 0.5 * h * (out_y - 1.0)
        box = (left, top, left + w, top + h)
        if _inside(box, frame) and not any(_shared(box, other) for other in taken):
            cost = price + 60.0 * sum(_shared(box, other) for other in bodies) / (w * h)
            if cost < cheapest:
                best, cheapest = box, cost
    return best


def _touching(boxes: Boxes, around: Box) -> list[Box]:
    """Those of boxes [n, 4] that overlap one."""
    x0, y0, x1, y1 = around
    touching = (boxes[:, 0] < x1) & (boxes[:, 1] < y1) & (boxes[:, 2] > x0) & (boxes[:, 3] > y0)
    found: list[Box] = boxes[touching].tolist()
    return found


def _inside(box: Box, frame: Box) -> bool:
    return box[0] >= frame[0] and box[1] >= frame[1] and box[2] <= frame[2] and box[3] <= frame[3]


def _shared(a: Box, b: Box) -> float:
    """Area that two boxes share."""
    width = (a[2] if a[2] < b[2] else b[2]) - (a[0] if a[0] > b[0] else b[0])
    height = (a[3] if a[3] < b[3] else b[3]) - (a[1] if a[1] > b[1] else b[1])
    return width * height if width > 0.0 and height > 0.0 else 0.0


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
