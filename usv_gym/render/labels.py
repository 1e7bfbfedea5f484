"""Where labels go: greedy placement on the picture, so that none overlaps another or leaves the frame.

Pure geometry in pixels; a box is left, top, right, bottom.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from .. import jit

Box = tuple[float, float, float, float]

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
_CANDIDATES = np.array(sorted(_candidate(angle, price, d) for angle, price in _ANGLES for d in _DISTANCES))
FURTHEST = _DISTANCES[-1]
COVERING = 60.0  #: price of covering a body with the whole label


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
    if not requests:
        return []
    numbers = np.array([(*r.size, *r.anchor, r.clearance, r.far, r.fixed) for r in requests], dtype=np.float64)
    order = np.argsort([-r.priority for r in requests], kind="stable")
    walls, bodies = (np.array(boxes, dtype=np.float64).reshape(-1, 4) for boxes in (keep_out, avoid))
    boxes = _place(numbers, order, np.array(frame, dtype=np.float64), walls, bodies, _CANDIDATES)
    return [
        Placed((left, top, right, bottom), _leader(request, (left, top, right, bottom))) if right > left else None
        for request, (left, top, right, bottom) in zip(requests, boxes.tolist(), strict=True)
    ]


@jit.kernel
def _place(requests, order, frame, keep_out, avoid, candidates):
    """Boxes [n, 4] of requests [n, 7] (width, height, x, y, clearance, far, fixed); of no width where there is no place."""
    out = np.zeros((len(requests), 4))
    taken, n = np.empty((len(keep_out) + len(requests), 4)), len(keep_out)
    taken[:n] = keep_out
    near, touched = np.empty(taken.shape), np.empty(avoid.shape)
    for i in order:
        request, box = requests[i], out[i]
        x, y = request[2], request[3]
        if not (frame[0] <= x <= frame[2] and frame[1] <= y <= frame[3]):
            continue  # what it belongs to is out of sight
        hard = _within_reach(request, taken[:n], near)
        soft = _within_reach(request, avoid, touched)
        if request[6] != 0.0:
            _centred(box, request, x, y)
            found = _inside(box, frame) and _covered(box, hard) == 0.0 and _covered(box, soft) == 0.0
        else:
            found = _best(box, request, frame, hard, soft, candidates)
        if found:
            taken[n] = box
            n += 1
        else:
            box[:] = 0.0
    return out


@jit.inner
def _best(best, request, frame, hard, soft, candidates):
    """Write the cheapest free box; returns whether there is one."""
    w, h, clearance, far = request[0], request[1], request[4], request[5]
    cheapest, box = math.inf, np.empty(4)
    for k in range(len(candidates)):
        price, distance, dx, dy, out_x, out_y = candidates[k]
        if price >= cheapest:
            break
        if distance > far:
            continue
        # the box touches the circle of `r`: its centre is further out by its own half extent in that direction
        r = clearance + GAP + distance
        _centred(box, request, request[2] + r * dx + 0.5 * w * out_x, request[3] + r * dy + 0.5 * h * out_y)
        if _inside(box, frame) and _covered(box, hard) == 0.0:
            cost = price + COVERING * _covered(box, soft) / (w * h)
            if cost < cheapest:
                cheapest = cost
                best[:] = box
    return cheapest < math.inf


@jit.inner
def _within_reach(request, boxes, out):
    """Those of boxes [n, 4] that a label could touch."""
    reach = 0.0 if request[6] != 0.0 else request[4] + GAP + min(request[5], FURTHEST)
    x, y = request[2], request[3]
    n = 0
    for k in range(len(boxes)):
        b = boxes[k]
        if (
            b[0] < x + reach + request[0]
            and b[1] < y + reach + request[1]
            and b[2] > x - reach - request[0]
            and b[3] > y - reach - request[1]
        ):
            out[n] = b
            n += 1
    return out[:n]


@jit.inner
def _centred(box, request, x, y):
    box[0], box[1] = x - 0.5 * request[0], y - 0.5 * request[1]
    box[2], box[3] = box[0] + request[0], box[1] + request[1]


@jit.inner
def _inside(box, frame):
    return box[0] >= frame[0] and box[1] >= frame[1] and box[2] <= frame[2] and box[3] <= frame[3]


@jit.inner
def _covered(box, others):
    """Area that a box shares with others, together."""
    area = 0.0
    for k in range(len(others)):
        width = min(box[2], others[k, 2]) - max(box[0], others[k, 0])
        height = min(box[3], others[k, 3]) - max(box[1], others[k, 1])
        if width > 0.0 and height > 0.0:
            area += width * height
    return area


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
