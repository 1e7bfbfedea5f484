"""Outlines in metres {n}: hulls, icebergs, ellipses, arcs and radar shadows.  Plain NumPy, no drawing."""

from __future__ import annotations

import functools
import math

import numpy as np

from ..world.geometry import BOW_TAPER
from .primitives import Points

#: the hull of world/geometry.py in units of length and beam, clockwise from the bow (forward, starboard)
HULL = np.array([(0.5, 0.0), (0.5 - BOW_TAPER, 0.5), (-0.5, 0.5), (-0.5, -0.5), (0.5 - BOW_TAPER, -0.5)])
DECKHOUSE = np.array([(-0.22, 0.34), (-0.40, 0.34), (-0.40, -0.34), (-0.22, -0.34)])
#: AIS target symbol (IMO SN.1/Circ.243): an acute triangle, pointing along the heading
TRIANGLE = np.array([(0.62, 0.0), (-0.38, 0.33), (-0.38, -0.33)])


def placed(unit: Points, north: float, east: float, psi: float, length: float, beam: float | None = None) -> Points:
    """Outline given in units of (length, beam) {b}, scaled, turned by psi [rad] and moved to (north, east) [m]."""
    xy = unit * (length, length if beam is None else beam)
    s, c = math.sin(psi), math.cos(psi)
    out: Points = xy @ np.array([(c, s), (-s, c)]) + (north, east)
    return out


def arc(centre: tuple[float, float], radius: float, start: float, stop: float, n: int = 24) -> Points:
    """Points on a circle between two true bearings [rad]."""
    b = np.linspace(start, stop, n)
    out: Points = np.column_stack((centre[0] + radius * np.cos(b), centre[1] + radius * np.sin(b)))
    return out


#: circle of radius 1, [40, 2]
CIRCLE = arc((0.0, 0.0), 1.0, 0.0, 2.0 * math.pi, 41)[:-1]


def ellipse(centre: tuple[float, float], semi_along: float, semi_across: float, psi: float) -> Points:
    """Ellipse with its first axis along the bearing psi [rad]."""
    return placed(CIRCLE, centre[0], centre[1], psi, semi_along, semi_across)


def covariance_ellipse(centre: tuple[float, float], nn: float, ne: float, ee: float, sigmas: float = 2.0) -> Points:
    """Contour of ``sigmas`` standard deviations of a position with covariance [[nn, ne], [ne, ee]] [m^2]."""
    # any square root of the covariance maps the unit circle on to that contour; this one is Cholesky's
    a = math.sqrt(max(nn, 0.0))
    b = ne / a if a > 0.0 else 0.0
    c = math.sqrt(max(ee - b * b, 0.0))
    out: Points = CIRCLE @ np.array([(sigmas * a, sigmas * b), (0.0, sigmas * c)]) + centre
    return out


def crag(centre: tuple[float, float], radius: float, index: int) -> tuple[Points, Points]:
    """Irregular outline in the disc of ``radius``, touching it, and its shaded side; always the same for an index."""
    rim, shade = _crag(index)
    return rim * radius + centre, shade * radius + centre


@functools.lru_cache(maxsize=1024)
def _crag(index: int) -> tuple[Points, Points]:
    """crag() of radius 1."""
    rng = np.random.default_rng(1009 + index)
    n = int(rng.integers(11, 16))
    bearing = (np.arange(n) + rng.uniform(-0.35, 0.35, n)) * (2.0 * math.pi / n)
    r = rng.uniform(0.76, 1.0, n)
    r /= r.max()
    rim = np.column_stack((np.cos(bearing), np.sin(bearing))) * r[:, None]
    # light comes from the north-west: the rim facing south-east, closed over a jagged ridge, is in shade
    facing = np.roll(np.arange(n), -int(np.argmin(np.abs(bearing - 0.3 * math.pi))))[: n // 2 + 1]
    ridge = rim[facing][::-1] * rng.uniform(0.1, 0.55, (len(facing), 1))
    return rim, np.vstack((rim[facing], ridge[1:-1]))


def half_width(length: float, beam: float, aspect: float) -> float:
    """Half the width [m] a hull shows at the angle ``aspect`` [rad] from its centre line (as the sensors reckon it)."""
    return 0.5 * (abs(length * math.sin(aspect)) + abs(beam * math.cos(aspect)))


def shadow(observer: tuple[float, float], centre: tuple[float, float], half: float, reach: float) -> Points | None:
    """Area hidden behind a disc of radius ``half`` [m], out to ``reach`` [m] from the observer.

    Starts at the two tangent points; None when the observer is inside the disc or the disc is out of reach.
    """
    dn, de = centre[0] - observer[0], centre[1] - observer[1]
    d = math.hypot(dn, de)
    if half <= 0.0 or d <= half or d >= reach:
        return None
    bearing, opening = math.atan2(de, dn), math.asin(half / d)
    tangent = math.sqrt(d * d - half * half)
    b = bearing + opening * _fan(2 + int(opening * 40.0))
    out = reach * np.column_stack((np.cos(b), np.sin(b)))
    out[:2] *= tangent / reach
    out += observer
    return out


@functools.cache
def _fan(n: int) -> Points:
    """From 1 to -1 along the near edge, and back in n steps along the far one."""
    return np.concatenate(((1.0, -1.0), np.linspace(-1.0, 1.0, n)))


def nice_step(span: float, parts: float) -> float:
    """1, 2 or 5 times a power of ten, such that ``span`` has about ``parts`` of them."""
    raw = max(span / parts, 1e-9)
    power = 10.0 ** math.floor(math.log10(raw))
    return float(next(f * power for f in (1.0, 2.0, 5.0, 10.0) if raw <= f * power * 1.0001))
