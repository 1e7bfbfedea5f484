"""Shapes in pixels, made ready to draw in one compiled pass: clipped, dashed, thinned, rounded; and pixels averaged.

A crowded map has hundreds of shapes of a few corners each, where a handful of NumPy calls per shape would be most of the
time.  Nothing here is called by another kernel, so numba's own stamp on this file is all the cache needs.
"""

from __future__ import annotations

import math

import numpy as np

from .. import jit

#: what becomes of a shape's points: an outline, a line, the points themselves (all, or those in sight), points along an outline
AREA, LINE, SPOTS, DOTS, BEADS = range(5)
INSIDE, ACROSS, OUTSIDE = range(3)
LONG = 24  #: points from which a line is thinned
NEAR = 0.15  #: [px] that a thinned line may be off
HEAD = 10.0  #: [px] length of an arrow head
MOST = 20_000  #: dashes or beads of one shape
BEND = 0.96  #: cosine of the bend from which a wide line needs a disc at its joint


@jit.kernel
def trace(points, first, kind, arrow, jointed, on, off, frame, scale):
    """Whole pixels to draw of K shapes.

    Parameters
    ----------
    points, first
        [n, 2] x, y [px] of all shapes, and where each begins [K + 1].
    kind, arrow, jointed
        [K] codes above; whether a line ends in a head; whether joints are wanted.
    on, off
        [K] px drawn and not drawn of a dashed line, 0 of a full one; of beads their distance and radius.
    frame
        left, top, right, bottom [px]; what lies outside is out of sight.
    scale
        pixels per px.

    Returns
    -------
    tuple
        corners int32 [m, 2] and where those of each shape begin [K + 1]: of a dashed line pairs of ends, of an arrow first
        the three of its head; then the joints among the corners, and where those of each shape begin.
    """
    corners, start, used = np.empty((2 * len(points) + 64, 2), np.int32), np.zeros(len(first), np.int32), 0
    joints, joint_start, bent = np.empty(64, np.int32), np.zeros(len(first), np.int32), 0
    for k in range(len(kind)):
        shape = points[first[k] : first[k + 1]]
        dashed = kind[k] == LINE and on[k] > 0.0
        head = 0
        if kind[k] == BEADS:
            shape = _beads(shape, on[k], off[k], frame)
        elif kind[k] == DOTS:
            shape = _seen(shape, frame)
        elif kind[k] != SPOTS:
            where = _where(shape, frame)
            if where == OUTSIDE:
                shape = shape[:0]
            elif kind[k] == AREA and where == ACROSS:
                shape = _clip(shape, frame)
            elif kind[k] == LINE and arrow[k]:
                shape, head = _arrow(shape), 3
            if dashed and len(shape):
                shape = _dashes(shape, head, on[k], off[k], frame)
            elif len(shape) > LONG:
                shape = _thin(shape)
        if used + len(shape) > len(corners):
            corners = _longer(corners, used + len(shape))
        for i in range(len(shape)):
            corners[used + i, 0] = round(shape[i, 0] * scale)
            corners[used + i, 1] = round(shape[i, 1] * scale)
        if jointed[k] and not dashed and len(shape) > 2 + head:
            if bent + len(shape) > len(joints):
                joints = _longer(joints.reshape(-1, 1), bent + len(shape)).reshape(-1)
            bent = _bends(shape[head:], kind[k] == AREA, used + head, joints, bent)
        used += len(shape)
        start[k + 1], joint_start[k + 1] = used, bent
    return corners[:used], start, joints[:bent], joint_start


@jit.inner
def _longer(rows, least):
    out = np.empty((2 * least, rows.shape[1]), rows.dtype)
    out[: len(rows)] = rows
    return out


@jit.inner
def _where(shape, frame):
    """How points lie to a rectangle."""
    if len(shape) == 0:
        return OUTSIDE
    left = right = shape[0, 0]
    top = bottom = shape[0, 1]
    for i in range(1, len(shape)):
        left, right = min(left, shape[i, 0]), max(right, shape[i, 0])
        top, bottom = min(top, shape[i, 1]), max(bottom, shape[i, 1])
    if left >= frame[0] and top >= frame[1] and right <= frame[2] and bottom <= frame[3]:
        return INSIDE
    return OUTSIDE if right < frame[0] or bottom < frame[1] or left > frame[2] or top > frame[3] else ACROSS


@jit.inner
def _clip(shape, frame):
    """Part of a polygon inside a rectangle (Sutherland-Hodgman); its new edges lie along the rectangle."""
    for side in range(4):
        axis, sign, bound = side % 2, 1.0 if side < 2 else -1.0, frame[side]
        out, n = np.empty((2 * len(shape) + 1, 2)), 0
        for i in range(len(shape)):
            p, q = shape[i - 1], shape[i]
            dp, dq = sign * (p[axis] - bound), sign * (q[axis] - bound)
            if (dp >= 0.0) != (dq >= 0.0):  # where the edge crosses the bound
                share = dp / (dp - dq)
                out[n, 0], out[n, 1] = p[0] + share * (q[0] - p[0]), p[1] + share * (q[1] - p[1])
                n += 1
            if dq >= 0.0:
                out[n, 0], out[n, 1] = q[0], q[1]
                n += 1
        shape = out[:n]
    return shape


@jit.inner
def _arrow(shape):
    """Three corners of the head at the end of a line, then the line as far as the head."""
    out = np.empty((len(shape) + 3, 2))
    out[3:] = shape
    tip, back = shape[-1], shape[-2]
    along_x, along_y = tip[0] - back[0], tip[1] - back[1]
    length = math.hypot(along_x, along_y)
    size = min(HEAD, 0.6 * length)
    if size < 2.0:
        size = 0.0
    along_x, along_y = along_x / max(length, 1e-9), along_y / max(length, 1e-9)
    x, y = tip[0] - size * along_x, tip[1] - size * along_y
    out[0] = tip
    out[1, 0], out[1, 1] = x - 0.38 * size * along_y, y + 0.38 * size * along_x
    out[2, 0], out[2, 1] = x + 0.38 * size * along_y, y - 0.38 * size * along_x
    out[-1, 0], out[-1, 1] = x, y
    return out


@jit.inner
def _dashes(shape, head, on, off, frame):
    """Ends of the dashes of a line, those with both in the rectangle; ``head`` points before the line are kept."""
    length = 0.0
    for i in range(head + 1, len(shape)):
        length += math.hypot(shape[i, 0] - shape[i - 1, 0], shape[i, 1] - shape[i - 1, 1])
    out, n = np.empty((head + 2 * min(int(length / (on + off)) + 1, MOST), 2)), head
    out[:head] = shape[:head]
    leg, walked = head + 1, 0.0  # the leg that ends at point `leg`, and the way to where it begins
    for k in range((len(out) - head) // 2):
        ends = k * (on + off), min(k * (on + off) + on, length)
        kept = True
        for j in range(2):
            step = math.hypot(shape[leg, 0] - shape[leg - 1, 0], shape[leg, 1] - shape[leg - 1, 1])
            while ends[j] > walked + step and leg + 1 < len(shape):
                walked += step
                leg += 1
                step = math.hypot(shape[leg, 0] - shape[leg - 1, 0], shape[leg, 1] - shape[leg - 1, 1])
            share = (ends[j] - walked) / step if step > 0.0 else 0.0
            x = shape[leg - 1, 0] + share * (shape[leg, 0] - shape[leg - 1, 0])
            y = shape[leg - 1, 1] + share * (shape[leg, 1] - shape[leg - 1, 1])
            out[n + j, 0], out[n + j, 1] = x, y
            kept = kept and frame[0] < x < frame[2] and frame[1] < y < frame[3]
        if kept:
            n += 2
    return out[:n]


@jit.inner
def _beads(ring, every, radius, frame):
    """Centres of discs along a closed outline that reach into the rectangle, each so far from the one before."""
    out, n = np.empty((64, 2)), 0
    last_x, last_y = math.inf, math.inf
    for i in range(len(ring)):
        p, q = ring[i - 1], ring[i]
        if (
            max(p[0], q[0]) + radius < frame[0]
            or min(p[0], q[0]) - radius > frame[2]
            or max(p[1], q[1]) + radius < frame[1]
            or min(p[1], q[1]) - radius > frame[3]
        ):
            continue
        steps = min(int(math.hypot(q[0] - p[0], q[1] - p[1]) / (0.25 * every)) + 1, MOST)
        for k in range(1, steps + 1):
            x, y = p[0] + k / steps * (q[0] - p[0]), p[1] + k / steps * (q[1] - p[1])
            if math.hypot(x - last_x, y - last_y) < every or n == MOST:
                continue
            if x + radius < frame[0] or x - radius > frame[2] or y + radius < frame[1] or y - radius > frame[3]:
                continue
            if n == len(out):
                out = _longer(out, n)
            out[n, 0], out[n, 1] = last_x, last_y = x, y
            n += 1
    return out[:n]


@jit.inner
def _seen(points, frame):
    """Those of points that lie in the rectangle."""
    out, n = np.empty(points.shape), 0
    for i in range(len(points)):
        if frame[0] < points[i, 0] < frame[2] and frame[1] < points[i, 1] < frame[3]:
            out[n] = points[i]
            n += 1
    return out[:n]


@jit.inner
def _thin(shape):
    """A line through fewer of its points: those left out are within `NEAR` of it (a sleeve, after Zhao and Saalfeld 1997)."""
    out, n = np.empty(shape.shape), 0
    out[0] = shape[0]
    x, y = shape[0]
    low, high, ahead_x, ahead_y, far = -math.inf, math.inf, 0.0, 0.0, 0.0
    i = 1
    while i < len(shape):
        dx, dy = shape[i, 0] - x, shape[i, 1] - y
        if far == 0.0:  # the first leg from the point kept last: slopes are measured from its direction
            far = math.hypot(dx, dy)
            if far <= NEAR:
                far = 0.0
                i += 1
                continue
            ahead_x, ahead_y = dx / far, dy / far
            low, high = -NEAR / far, NEAR / far
            i += 1
            continue
        along, across = ahead_x * dx + ahead_y * dy, ahead_x * dy - ahead_y * dx
        if along >= far and low <= across / along <= high:
            low, high, far = max(low, (across - NEAR) / along), min(high, (across + NEAR) / along), along
            i += 1
            continue
        n += 1
        out[n] = shape[i - 1]
        x, y = shape[i - 1]
        far = 0.0
    n += 1
    out[n] = shape[-1]
    return out[: n + 1]


@jit.inner
def _bends(shape, closed, first, joints, n):
    """Write at which corners a line bends much, counted from ``first``; returns how many have been written by now."""
    count = len(shape)
    for i in range(0 if closed else 1, count if closed else count - 1):
        p, q, r = shape[i - 1], shape[i], shape[(i + 1) % count]
        ax, ay, bx, by = q[0] - p[0], q[1] - p[1], r[0] - q[0], r[1] - q[1]
        if ax * bx + ay * by < BEND * math.hypot(ax, ay) * math.hypot(bx, by):
            joints[n] = first + i
            n += 1
    return n


# --- pixels ------------------------------------------------------------------------------------------------------------
@jit.kernel
def blend(pixels, corners, colour, opacity):
    """Fill an outline (whole pixels [n, 2], even-odd) with a translucent colour; ``opacity`` is out of 256.

    ``pixels`` and ``colour`` are uint32 0xRRGGBB, [h, w] and one.
    """
    height, width = pixels.shape
    edges, crossings = np.empty((len(corners), 4)), np.empty(len(corners))
    top, bottom = _edges(corners, edges, height)
    pairs, green, byte = np.uint32(0xFF00FF), np.uint32(0x00FF00), np.uint32(8)  # red and blue are blended at once
    rest = np.uint32(256 - opacity)
    pairs_over = np.uint32((colour & pairs) * np.uint32(opacity))
    green_over = np.uint32((colour & green) * np.uint32(opacity))
    for y in range(top, bottom):
        n = _crossings(edges, len(corners), y + 0.5, crossings)
        for k in range(0, n - 1, 2):
            first, last = _between(crossings[k], crossings[k + 1], width)
            row = pixels[y, first:last]
            for x in range(len(row)):
                under = row[x]
                mixed = (np.uint32(np.uint32(under & pairs) * rest + pairs_over) >> byte) & pairs
                row[x] = mixed | ((np.uint32(np.uint32(under & green) * rest + green_over) >> byte) & green)


@jit.kernel
def flood(pixels, corners, start, radius, colour):
    """Fill S outlines (corners [n, 2], where each begins [S + 1]) or, with a radius, discs about the corners.

    One after the other would write most pixels many times: neighbours overlap.  So each row remembers the last span, which
    grows as long as the next one touches it.
    """
    height = pixels.shape[0]
    left, right = np.zeros(height), np.zeros(height)  # of no width where there is none yet
    edges, crossings = np.empty((len(corners), 4)), np.empty(len(corners))
    if radius > 0.0:
        for i in range(start[0], start[-1]):
            x, middle = corners[i, 0], corners[i, 1]
            for y in range(max(math.floor(middle - radius), 0), min(math.ceil(middle + radius), height)):
                half = math.sqrt(max(radius * radius - (y + 0.5 - middle) ** 2, 0.0))
                _lengthen(left, right, y, x - half, x + half, pixels, colour)
    else:
        for s in range(len(start) - 1):
            shape = corners[start[s] : start[s + 1]]
            top, bottom = _edges(shape, edges, height)
            for y in range(top, bottom):
                for k in range(0, _crossings(edges, len(shape), y + 0.5, crossings) - 1, 2):
                    _lengthen(left, right, y, crossings[k], crossings[k + 1], pixels, colour)
    for y in range(height):
        _paint(pixels, y, left[y], right[y], colour)


@jit.scalar
def _lengthen(left, right, y, begin, end, pixels, colour):
    """Add to the last span of a row what touches it; else paint that and begin anew."""
    if begin > right[y] or end < left[y]:
        _paint(pixels, y, left[y], right[y], colour)
        left[y], right[y] = begin, end
    else:
        left[y], right[y] = min(left[y], begin), max(right[y], end)


@jit.scalar
def _paint(pixels, y, left, right, colour):
    first, last = _between(left, right, pixels.shape[1])
    for x in range(first, last):
        pixels[y, x] = colour


@jit.inner
def _edges(corners, edges, height):
    """Write an outline's edges (y of both ends, x of the first, slope); returns the first row it reaches and the one after."""
    top, bottom = height, 0
    for i in range(len(corners)):
        x0, y0 = corners[i - 1]
        x1, y1 = corners[i]
        edges[i, 0], edges[i, 1], edges[i, 2] = y0, y1, x0
        edges[i, 3] = (x1 - x0) / (y1 - y0) if y1 != y0 else 0.0
        top, bottom = min(top, y1), max(bottom, y1)
    return max(top, 0), min(bottom, height)


@jit.scalar
def _crossings(edges, count, y, out):
    """Where a row crosses an outline, from left to right; returns how often."""
    n = 0
    for i in range(count):
        if (edges[i, 0] > y) != (edges[i, 1] > y):
            x, k = edges[i, 2] + (y - edges[i, 0]) * edges[i, 3], n
            while k > 0 and out[k - 1] > x:
                out[k] = out[k - 1]
                k -= 1
            out[k] = x
            n += 1
    return n


@jit.scalar
def _between(left, right, width):
    """The first pixel of a row whose middle lies between two places, and the one after the last."""
    first = min(max(math.ceil(left - 0.5), 0), width)
    return first, max(min(math.ceil(right - 0.5), width), first)


@jit.kernel
def average(large, times, out):
    """Mean of each block of ``times`` x ``times`` pixels; colours are uint32 0xRRGGBB, [h * times, w * times] and [h, w]."""
    if times == 2:  # a constant, which makes it vector code
        _average(large, 2, out)
    else:
        _average(large, times, out)


@jit.spliced
def _average(large, times, out):
    count = np.uint32(times * times)
    half = count // np.uint32(2)
    byte = np.uint32(255)
    for i in range(out.shape[0]):
        for j in range(out.shape[1]):
            red = green = blue = half
            for y in range(times):
                for x in range(times):
                    colour = large[times * i + y, times * j + x]
                    red += (colour >> np.uint32(16)) & byte
                    green += (colour >> np.uint32(8)) & byte
                    blue += colour & byte
            out[i, j] = ((red // count) << np.uint32(16)) | ((green // count) << np.uint32(8)) | (blue // count)


@jit.kernel
def unpack(pixels, out):
    """Colours uint32 0xRRGGBB [h, w] as red, green, blue uint8 [h, w, 3]."""
    for i in range(out.shape[0]):
        for j in range(out.shape[1]):
            colour = pixels[i, j]
            out[i, j, 0] = colour >> np.uint32(16)
            out[i, j, 1] = colour >> np.uint32(8)
            out[i, j, 2] = colour
