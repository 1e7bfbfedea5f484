"""Synthetic coasts: drawn from fixed seeds when a family first needs them, and the same ever after.

Coast k of n is one of difficulty about k / n.  Every shape is valid by construction: a shore is a function of the distance
along its channel, an island a function of the angle around its centre, and they keep clear of each other.
"""

from __future__ import annotations

import functools
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...world.land import Coast, Polygon, Ring

Array = NDArray[np.float64]

CHANNELS, PORTS = 32, 24  #: how many there are
WAY, POINTS = 6, 26  #: waypoints of the own ship; points of a channel's middle line, 100 m apart, from -500 m on
BERTHS = 24  #: most in a port


class Channels(NamedTuple):
    """Narrow waters with land to both sides, with islands."""

    coasts: tuple[Coast, ...]
    route: Array  # [n, WAY, 2] along the middle, N, E [m]; starts at [0, 0]
    middle: Array  # [n, POINTS, 2] N, E [m]
    width: Array  # [n, POINTS] what is free of land to either side of the middle [m]


class Ports(NamedTuple):
    """Basins behind breakwaters, with piers to both sides of a fairway."""

    coasts: tuple[Coast, ...]
    frame: Array  # [n, 2] sine and cosine of the course in
    size: Array  # [n, 3] half width of the fairway, distance from the heads of the breakwaters to the inner end, free water [m]
    berths: Array  # [n, BERTHS, 4] N, E [m], heading [rad], largest length [m] (0: no berth)


def _noise(rng: np.random.Generator, n: int, coarsest: int) -> Array:
    """Fractal noise [n] in about [-1, 1] with octaves down to two points."""
    total, size = np.zeros(n), 0.0
    step, amplitude = coarsest, 1.0
    while step >= 2:
        knots = rng.uniform(-1.0, 1.0, n // step + 2)
        total += amplitude * np.interp(np.arange(n) / step, np.arange(len(knots)), knots)
        size += amplitude
        step, amplitude = step // 2, 0.55 * amplitude
    return 1.6 * total / size


def _bend(n: Array, bends: list[tuple[float, float, float]]) -> Array:
    """East [m] of a channel's middle line at north n [m] in its own frame; 0 at 0."""
    return np.asarray(sum(wide * (np.sin(number * n + phase) - np.sin(phase)) for number, wide, phase in bends))


def _turned(points: Array, angle: float) -> Array:
    """Points [.., 2] in the frame of a channel or port, turned by an angle [rad] from north to east."""
    s, c = np.sin(angle), np.cos(angle)
    return np.stack([c * points[..., 0] - s * points[..., 1], s * points[..., 0] + c * points[..., 1]], axis=-1)


def _island(rng: np.random.Generator, place: Array, radius: float) -> Ring:
    corners = int(rng.integers(9, 18))
    angle = 2 * np.pi * (np.arange(corners) + rng.uniform(-0.3, 0.3, corners)) / corners
    r = radius * rng.uniform(0.6, 1.0, corners)
    return np.asarray(place + np.column_stack([r * np.cos(angle), r * np.sin(angle)]))


@functools.cache
def channels() -> Channels:
    """The coasts of the family ``near_shore``."""
    coasts, routes, middles, widths = [], [], [], []
    for k in range(CHANNELS):
        rng = np.random.default_rng([20170601, 1, k])
        share = k / (CHANNELS - 1)
        n: Array = np.arange(-900.0, 2900.0, 20.0)
        # wave number [rad/m], amplitude [m], phase [rad] of the middle line's two bends
        bends = [(2 * np.pi / rng.uniform(*long), rng.uniform(*wide), rng.uniform(0, 2 * np.pi))
                 for long, wide in (((1300, 2200), (50, 140)), ((600, 900), (8, 25)))]  # fmt: skip
        half = (230.0 - 160.0 * share) * rng.uniform(0.9, 1.1)
        west, east = (half * (1.15 + 0.5 * np.maximum(_noise(rng, len(n), 32), -1.0)) for _ in range(2))
        shores = [np.column_stack([n, _bend(n, bends) - west]), np.column_stack([n, _bend(n, bends) + east])]
        edge = np.array([[n[-1], -1600.0], [n[0], -1600.0]])
        polygons = [np.concatenate([shores[0], edge]), np.concatenate([shores[1], -edge * (-1.0, 1.0)])]
        rings: list[Ring] = []
        for _ in range(int(2 + 6 * rng.random())):
            at, radius = rng.uniform(250.0, 1750.0), rng.uniform(6.0, 0.2 * half + 8.0)
            side = rng.choice((-1.0, 1.0))
            near = np.abs(n - at) < radius + 60.0
            free = (west if side < 0 else east)[near].min()
            # off the middle line, which bends by less than 20 m within an island's length, and off the shore
            low, high = radius + 55.0, free - radius - 35.0
            if low < high:
                place = np.array([at, float(_bend(np.array([at]), bends)[0]) + side * rng.uniform(low, high)])
                if all(np.hypot(*(place - other).T).min() > radius + 40.0 for other in rings):
                    rings.append(_island(rng, place, radius))
        angle = rng.uniform(-np.pi, np.pi)
        coasts.append(tuple(Polygon(_turned(ring, angle)) for ring in polygons + rings))
        way = np.array([300.0 * i for i in range(WAY)])
        routes.append(_turned(np.column_stack([way, _bend(way, bends)]), angle))
        along = np.array([100.0 * i - 500.0 for i in range(POINTS)])
        middle = np.column_stack([along, _bend(along, bends)])
        middles.append(_turned(middle, angle))
        corners = np.concatenate(shores + rings)
        reach = np.stack([middle, np.roll(middle, -1, axis=0), (middle + np.roll(middle, -1, axis=0)) / 2])[:, :-1]
        free_here = np.min([np.hypot(*(p[:, None] - corners).transpose(2, 0, 1)).min(axis=1) for p in reach], axis=0)
        widths.append(np.append(free_here, free_here[-1]) - 15.0)  # corners are 20 m apart
    return Channels(tuple(coasts), np.array(routes), np.array(middles), np.array(widths))


@functools.cache
def ports() -> Ports:
    """The coasts of the family ``busy_port``."""
    coasts, frames, sizes, berths = [], [], [], []
    for k in range(PORTS):
        rng = np.random.default_rng([20170601, 3, k])
        share = k / (PORTS - 1)
        fairway, length = (75.0 - 35.0 * share) * rng.uniform(0.9, 1.1), rng.uniform(600.0, 900.0)
        found: list[tuple[float, float, float, float]] = []
        sides, basins = [], []
        for side in (-1.0, 1.0):
            basin = fairway + rng.uniform(110.0, 190.0)
            shore, n = [(0.0, basin)], rng.uniform(40.0, 80.0)
            while n < length - 150.0:
                width, reach = rng.uniform(16.0, 30.0), rng.uniform(0.4, 0.75) * (basin - fairway)
                shore += [(n, basin), (n, basin - reach), (n + width, basin - reach), (n + width, basin)]
                for edge, out in ((n, -1.0), (n + width, 1.0)):
                    longest = 0.8 * reach
                    found.append((edge + out * (longest / 10.0 + 2.0), side * (basin - 0.5 * reach), side * np.pi / 2, longest))
                gap = rng.uniform(70.0, 120.0)
                n += width + gap
            shore.append((length, basin))
            sides.append(np.array(shore) * (1.0, side))
            basins.append(basin)
        block = np.array([[length + 700.0, 1600.0], [length + 700.0, -1600.0], [0.0, -1600.0]])
        rings = [np.concatenate([sides[0], sides[1][::-1], [[0.0, 1600.0]], block])]
        for side, basin in zip((-1.0, 1.0), basins, strict=True):
            arm = np.array([[-15.0, basin], [-120.0, basin], [-120.0, 1.1 * fairway], [-132.0, 1.1 * fairway],
                            [-132.0, basin + 12.0], [-15.0, basin + 12.0]])  # fmt: skip
            rings.append(arm * (1.0, side))
        angle = rng.uniform(-np.pi, np.pi)
        coasts.append(tuple(Polygon(_turned(ring, angle)) for ring in rings))
        frames.append((np.sin(angle), np.cos(angle)))
        sizes.append((fairway, length, min(basins)))
        table = np.zeros((BERTHS, 4))
        order = rng.permutation(len(found))[:BERTHS]
        table[: len(order)] = np.array(found)[order]
        table[: len(order), :2] = _turned(table[: len(order), :2], angle)
        table[: len(order), 2] += angle
        berths.append(table)
    return Ports(tuple(coasts), np.array(frames), np.array(sizes), np.array(berths))
