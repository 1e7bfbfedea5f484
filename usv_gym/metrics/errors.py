"""How good the picture was: the arithmetic of sensor errors, as functions of plain arrays.  SI and radians."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]
Bools = npt.NDArray[np.bool_]

#: edges of the range bins of TDM errors [m]; the LiDAR sees to 100 m, the radar to 1 NM
RANGE_EDGES = (0.0, 100.0, 300.0, 600.0, 1000.0, 1852.0)
#: below this a course says nothing [m/s]
SLOW = 0.25


@dataclass(frozen=True)
class Statistic:
    """Of an error: how many values, their mean (the bias), standard deviation about it, and root mean square."""

    count: int
    mean: float
    std: float
    rms: float


@dataclass(frozen=True)
class RangeBin:
    """Position errors of targets at distances within [from_m, to_m)."""

    from_m: float
    to_m: float
    count: int
    rms: float  # of the horizontal distance to the truth [m]
    bias_north: float  # m
    bias_east: float  # m


def angle_difference(a: npt.ArrayLike, b: npt.ArrayLike) -> Floats:
    """a - b [rad], wrapped to [-pi, pi)."""
    return np.asarray(np.mod(np.asarray(a, float) - np.asarray(b, float) + np.pi, 2.0 * np.pi) - np.pi)


def statistic(error: npt.ArrayLike) -> Statistic:
    """Statistic of errors; NaN (not available) is left out, and all but the count are NaN when nothing is left."""
    values = np.asarray(error, float)
    values = values[np.isfinite(values)]
    if not len(values):
        return Statistic(0, np.nan, np.nan, np.nan)
    return Statistic(len(values), float(values.mean()), float(values.std()), float(np.sqrt(np.mean(values**2))))


def tdm_errors(
    position: Floats, truth: Floats, distance: Floats, edges: Sequence[float] = RANGE_EDGES
) -> list[RangeBin]:
    """Position errors of detected targets against their distance.

    Parameters
    ----------
    position, truth
        [n, 2] N, E [m] as reported, and of the source at that moment.
    distance
        [n] true distance from the own ship to the source [m].
    edges
        of the bins [m], increasing.
    """
    error = position - truth
    bins = []
    for low, high in itertools.pairwise(edges):
        inside = (distance >= low) & (distance < high)
        north, east = statistic(error[inside, 0]), statistic(error[inside, 1])
        rms = float(np.hypot(north.rms, east.rms))
        bins.append(RangeBin(float(low), float(high), north.count, rms, north.mean, east.mean))
    return bins


def ais_errors(reports: npt.NDArray[Any]) -> dict[str, Statistic]:
    """Errors of transmitted AIS reports, by field.

    ``reports`` is a structured array with north, east, cog, heading, sog, rot and the same with ``_true``.  Courses of
    ships that hardly move are left out.
    """
    errors = {name: reports[name] - reports[f"{name}_true"] for name in ("north", "east", "sog", "rot")}
    for name in ("cog", "heading"):
        errors[name] = angle_difference(reports[name], reports[f"{name}_true"])
    errors["cog"] = np.where(reports["sog_true"] >= SLOW, errors["cog"], np.nan)
    return {name: statistic(errors[name]) for name in ("north", "east", "cog", "heading", "sog", "rot")}


def hidden_intervals(t: Floats, in_range: Bools, visible: Bools, shortest: float = 0.0) -> list[tuple[float, float]]:
    """Times (from, to) [s] in which an object was in range of a sensor that could not see it.

    Parameters
    ----------
    t
        [T] s.
    in_range, visible
        [T] whether the sensor reaches so far, and whether its line of sight was free at its last scan.
    shortest
        shorter intervals are dropped [s]: ``visible`` lags behind ``in_range`` by up to one scan.
    """
    hidden = np.concatenate([[False], in_range & ~visible, [False]])
    change = np.flatnonzero(np.diff(hidden.astype(np.int8)))
    last = len(t) - 1
    spans = [(float(t[start]), float(t[min(end, last)])) for start, end in change.reshape(-1, 2)]
    return [(start, end) for start, end in spans if end - start >= shortest]


def closest(t: Floats, distance: npt.NDArray[np.floating[Any]], active: Bools) -> tuple[Floats, Floats]:
    """Smallest distance [S] to each source and its time [S] [s], from [T, S]; NaN where a source was never there."""
    known = np.where(active & ~np.isnan(distance), distance, np.inf).astype(float)
    index = known.argmin(axis=0)
    smallest = known[index, np.arange(known.shape[1])]
    there = np.isfinite(smallest)
    return np.where(there, smallest, np.nan), np.where(there, t[index], np.nan)
