"""Recorded tracks of ships: the CSV file beside a scenario, and the pool that kernels read.

A track is a list of parts, between which the ship is not seen; a part is a list of knots
``[t, north, east, course_deg, speed]`` with ``heading_deg`` as a sixth number where it is known: seconds since the start of the
scenario, metres from its origin, degrees, m/s.
"""

from __future__ import annotations

import csv
import functools
import math
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from ..units import DEG
from ..world.state import KNOT_FIELDS

Knot: TypeAlias = Sequence[float]
Parts: TypeAlias = Sequence[Sequence[Knot]]
Floats: TypeAlias = NDArray[np.float64]

#: header of the CSV file: the ship's name, the number of the part, a knot
HEADER = ("ship", "part", "t", "north", "east", "course_deg", "speed", "heading_deg")


class TrackError(ValueError):
    """A file of tracks, or a track, that cannot be used; the message says what is wrong with it."""


def read_tracks(path: Path) -> Mapping[str, list[list[list[float]]]]:
    """Tracks by name of the ship, from a CSV file with ``HEADER``; a file is read once.

    Raises
    ------
    TrackError
        if the file cannot be read, or a row is wrong; with file and line.
    """
    try:
        state = path.stat()
    except OSError as error:
        raise TrackError(f"{path}: cannot be read: {error.strerror}") from None
    return _read(path, state.st_mtime_ns, state.st_size)


@functools.lru_cache(maxsize=4)
def _read(path: Path, *_version: int) -> Mapping[str, list[list[list[float]]]]:
    tracks: dict[str, dict[str, list[list[float]]]] = {}
    try:
        with path.open(encoding="utf-8", newline="") as file:
            reader = csv.reader(file)
            header = next(reader, [])
            if tuple(header) not in (HEADER, HEADER[:-1]):
                raise TrackError(f"{path}:1: expected the columns {','.join(HEADER)}, got {','.join(header)}")
            for row in reader:
                if not row:
                    continue
                try:
                    knot = [float(cell) for cell in row[2:] if cell]
                except ValueError:
                    knot = []
                if not 5 <= len(knot) <= 6 or not all(map(math.isfinite, knot)):
                    raise TrackError(f"{path}:{reader.line_num}: expected finite numbers {', '.join(HEADER[2:])}")
                tracks.setdefault(row[0], {}).setdefault(row[1], []).append(knot)
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise TrackError(f"{path}: cannot be read: {error}") from None
    return {ship: list(parts.values()) for ship, parts in tracks.items()}


def write_tracks(tracks: Mapping[str, Parts]) -> str:
    """The text of a CSV file of tracks; times to 1 ms, places to 1 cm, speeds to 1 mm/s, angles to 0.01 degree."""
    lines = [",".join(HEADER)]
    for ship, parts in tracks.items():
        for number, part in enumerate(parts, 1):
            for t, north, east, course, speed, heading in part:
                lines.append(f"{ship},{number},{t:.3f},{north:.2f},{east:.2f},{course:.2f},{speed:.3f},{heading:.2f}")
    return "\n".join(lines) + "\n"


def check(parts: Parts) -> None:
    """Check that a track can be sailed.

    Raises
    ------
    TrackError
        if there is no part, a part has fewer than two knots, or times do not increase.
    """
    if not parts:
        raise TrackError("expected at least two knots")
    before = -math.inf
    for i, part in enumerate(parts):
        if len(part) < 2:
            raise TrackError(f"part {i + 1} has {len(part)} knot{'s' * (len(part) != 1)}, expected at least two")
        for knot in part:
            if round(knot[0] * 1e6) <= before:
                raise TrackError(f"part {i + 1}: the times must increase, got {knot[0]:g} s after {before * 1e-6:g} s")
            before = round(knot[0] * 1e6)


def pool(tracks: Iterable[Parts]) -> Floats:
    """Rows [n, 7] of the kernels' pool (traffic/replay.py) for tracks, one after the other."""
    rows: list[tuple[float, ...]] = []
    for parts in tracks:
        for part in parts:
            for i, (t, north, east, course, speed, *heading) in enumerate(part):
                chi = course * DEG
                psi = heading[0] * DEG if heading else chi
                rows.append((float(round(t * 1e6)), north, east, speed * math.cos(chi), speed * math.sin(chi), psi,
                             float(i + 1 < len(part))))  # fmt: skip
    return np.array(rows, np.float64).reshape(-1, KNOT_FIELDS)


def hermite(s: Floats, span: Floats, x0: Floats, x1: Floats, v0: Floats, v1: Floats) -> Floats:
    """Places [n, 2] on the cubics through x0 and x1 [n, 2] with velocities v0 and v1, a share s [n] of the span [n, s]."""
    s, span = s[:, None], span[:, None]
    return np.asarray((1 + 2 * s) * (1 - s) ** 2 * x0 + s * (1 - s) ** 2 * span * v0
                      + s**2 * (3 - 2 * s) * x1 + s**2 * (s - 1) * span * v1)  # fmt: skip


def along(rows: Floats, t: Floats) -> Floats:
    """Places N, E [n, 2] at times t [n, s] of a ship whose track is these rows of the pool; NaN where it is not seen.

    What the kernel does (traffic/replay.py), for those who look ahead or back.
    """
    at = np.asarray(t, np.float64) * 1e6
    k = np.searchsorted(rows[:, 0], at, side="right") - 1
    ends = (k > 0) & (rows[k, 6] == 0.0) & (rows[k, 0] == at)  # the last knot of a part is still the ship
    k = np.clip(np.where(ends, k - 1, k), 0, len(rows) - 2)
    a, b = rows[k], rows[k + 1]
    s = (at - a[:, 0]) / (b[:, 0] - a[:, 0])
    places = hermite(s, (b[:, 0] - a[:, 0]) * 1e-6, a[:, 1:3], b[:, 1:3], a[:, 3:5], b[:, 3:5])
    return np.where(((s >= 0.0) & (s <= 1.0) & (a[:, 6] == 1.0))[:, None], places, np.nan)


def start_of(parts: Parts) -> tuple[tuple[float, float], float, float, bool]:
    """Place N, E [m], heading [rad], speed [m/s] of a track at the start of the scenario, and whether the ship is seen then.

    Of a ship that is not there yet: those of its first knot.
    """
    rows = pool([parts])
    places = along(rows, np.array([0.0, 0.1]))
    if np.isnan(places).any():
        return (float(rows[0, 1]), float(rows[0, 2])), float(rows[0, 5]), math.hypot(rows[0, 3], rows[0, 4]), False
    heading = float(np.interp(0.0, rows[:, 0], np.unwrap(rows[:, 5])))
    (n0, e0), (n1, e1) = places.tolist()
    return (n0, e0), heading, math.hypot(n1 - n0, e1 - e0) / 0.1, True


def knots(parts: Parts) -> int:
    """How many rows of the pool a track takes."""
    return sum(map(len, parts))


def nested(value: Any) -> Any:
    """A track written as one list of knots as a list of one part; anything else as it is."""
    first = value[0] if isinstance(value, list | tuple) and value else None
    second = first[0] if isinstance(first, list | tuple) and first else None
    return [value] if isinstance(second, int | float) and not isinstance(second, bool) else value
