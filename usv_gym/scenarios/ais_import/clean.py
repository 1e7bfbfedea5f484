"""From the fixes of one station to tracks: wild fixes out, gaps found, the rest smoothed and thinned.

Why not a library: those for trajectories (movingpandas, traja, trackintel) bring pandas and GDAL, know positions only, and drop
or average fixes.  An AIS report also tells speed and course, and the weak point of recorded AIS is its *clock*: a second or two
of delay puts a ship 20 m off.  A Kalman smoother over position and velocity, with the delay in its measurement noise, is the
textbook answer and short (Rauch, Tung and Striebel 1965; constant velocity with white acceleration, Bar-Shalom 2001, 6.2.2).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...units import DEG, KNOT
from ..tracks import along, hermite
from .fixes import Selection

Floats = NDArray[np.float64]

#: fastest that a ship may be between two fixes [m/s], and the slack of position and clock [m], [s]
FASTEST, SLACK, SLACK_TIME = 60.0 * KNOT, 50.0, 3.0
#: [m] and [s] standard deviations of a reported position and of its time; of SOG [m/s] and COG [rad]
POSITION_STD, TIME_STD, SPEED_STD, COURSE_STD = 5.0, 1.0, 0.3, 2.0 * DEG
ACCELERATION = 0.05  #: spectral density of a ship's acceleration [m^2/s^3]
HULLS = 8  #: that may share an MMSI at a time; with more, the one that was silent longest is over
STILL = 0.5 * KNOT  #: [m/s] below which course over ground says nothing about heading
MAX_GAP = 400.0  #: [s] moored ships report every 180 s; one report may be lost
TOLERANCE = 3.0  #: [m] that thinning may move a ship
HEADING_TOLERANCE = 4.0 * DEG

#: columns of a table of fixes: t [s], N, E [m] about the origin, velocity N, E [m/s], heading [rad]; NaN: not told
T, N, E, VN, VE, PSI = range(6)


@dataclass(frozen=True)
class Track:
    """Where one ship was: stretches of knots, between which it is not seen."""

    #: each [n, 6]: t [s since 1970], N, E [m] about the origin, course [rad], speed [m/s], heading [rad]
    parts: tuple[Floats, ...]

    @property
    def knots(self) -> int:
        """Number of knots."""
        return sum(map(len, self.parts))


def to_local(table: Floats, place: Selection) -> Floats:
    """Fixes [n, 6] in the order of ``fixes.COLUMNS`` as t, N, E [m], velocity N, E [m/s], heading [rad]."""
    north, east = place.scale
    turn = (table[:, 2] - place.longitude + 180.0) % 360.0 - 180.0
    sog, cog = table[:, 3] * KNOT, table[:, 4] * DEG
    vn, ve = sog * np.cos(cog), sog * np.sin(cog)
    at_rest = np.isnan(cog) & (sog < STILL)  # speed without a course: at rest all the same
    vn, ve = np.where(at_rest, 0.0, vn), np.where(at_rest, 0.0, ve)
    return np.column_stack([table[:, 0], (table[:, 1] - place.latitude) * north, turn * east, vn, ve, table[:, 5] * DEG])


def chains(fixes: Floats) -> list[Floats]:
    """Sort fixes [n, 6] by what one hull can have sailed: a wild fix, or another ship of that MMSI, makes a chain of its own.

    Fixes that repeat an earlier one (same time; or same place at speed: a message received twice) are left out.
    """
    open_: list[list[int]] = []
    over: list[list[int]] = []
    t, n, e, vn, ve = (fixes[:, k].tolist() for k in (T, N, E, VN, VE))
    for i in range(len(t)):
        best, nearest = None, math.inf
        for chain in open_:
            k = chain[-1]
            dt = t[i] - t[k]
            apart = math.hypot(n[i] - n[k], e[i] - e[k])
            if apart > FASTEST * (dt + SLACK_TIME) + SLACK:
                continue
            known = vn[k] == vn[k]
            error = math.hypot(n[i] - n[k] - vn[k] * dt, e[i] - e[k] - ve[k] * dt) if known else apart
            if error < nearest:
                best, nearest = chain, error
        if best is None:
            if len(open_) == HULLS:
                oldest = min(open_, key=lambda chain: chain[-1])
                open_.remove(oldest)
                over.append(oldest)
            open_.append([i])
            continue
        k = best[-1]
        again = n[i] == n[k] and e[i] == e[k] and math.hypot(vn[i], ve[i]) > STILL and t[i] - t[k] < 30.0
        if t[i] > t[k] and not again:
            best.append(i)
    return [fixes[chain] for chain in sorted(over + open_)]


def stretches(fixes: Floats, max_gap: float = MAX_GAP) -> list[Floats]:
    """Cut fixes [n, 6] where nothing was heard for more than ``max_gap`` seconds."""
    return np.split(fixes, np.flatnonzero(np.diff(fixes[:, T]) > max_gap) + 1)


def smooth(fixes: Floats, time_std: float = TIME_STD) -> tuple[Floats, Floats]:
    """Positions and velocities [n, 2] of a ship at its fixes [n, 6], by a Rauch-Tung-Striebel smoother.

    North and east have the same noise, so that one covariance serves both axes.
    """
    count = len(fixes)
    at, speed = fixes[:, T], np.hypot(fixes[:, VN], fixes[:, VE])
    told = np.isfinite(speed)
    z, zv = fixes[:, N : E + 1], np.where(told[:, None], fixes[:, VN : VE + 1], 0.0)
    fallback = float(np.nanmedian(speed)) if told.any() else 5.0
    r = (POSITION_STD**2 + (np.where(told, speed, fallback) * time_std) ** 2).tolist()
    rv = (SPEED_STD**2 + (speed * COURSE_STD) ** 2).tolist()
    x = np.empty((count, 4))  # N, E, velocity N, E: filtered, then smoothed
    ahead = np.empty((count, 4))  # predicted
    p = np.empty((count, 3))  # pp, pv, vv: filtered
    q = np.empty((count, 3))  # predicted
    pn, pe = z[0].tolist()
    vn, ve = zv[0].tolist()
    pp, pv, vv = 1e4, 0.0, 100.0
    before = float(at[0])
    for i, (t, (zn, ze), (un, ue), heard) in enumerate(
        zip(at.tolist(), z.tolist(), zv.tolist(), told.tolist(), strict=True)
    ):
        dt = t - before
        before = t
        pn, pe = pn + dt * vn, pe + dt * ve
        pp, pv, vv = (pp + dt * (2 * pv + dt * vv) + ACCELERATION * dt**3 / 3, pv + dt * vv + ACCELERATION * dt**2 / 2,
                      vv + ACCELERATION * dt)  # fmt: skip
        ahead[i] = pn, pe, vn, ve
        q[i] = pp, pv, vv
        k, kv = pp / (pp + r[i]), pv / (pp + r[i])
        dn, de = zn - pn, ze - pe
        pn, pe, vn, ve = pn + k * dn, pe + k * de, vn + kv * dn, ve + kv * de
        pp, pv, vv = (1 - k) * pp, (1 - k) * pv, vv - kv * pv
        if heard:
            k, kv = pv / (vv + rv[i]), vv / (vv + rv[i])
            dn, de = un - vn, ue - ve
            pn, pe, vn, ve = pn + k * dn, pe + k * de, vn + kv * dn, ve + kv * de
            pp, pv, vv = pp - k * pv, (1 - kv) * pv, (1 - kv) * vv
        x[i] = pn, pe, vn, ve
        p[i] = pp, pv, vv
    for i in range(count - 2, -1, -1):
        dt = float(at[i + 1] - at[i])
        fpp, fpv, fvv = p[i].tolist()
        qpp, qpv, qvv = q[i + 1].tolist()
        det = qpp * qvv - qpv * qpv
        a, b = fpp + dt * fpv, fpv + dt * fvv  # rows of P F'
        g00, g01 = (a * qvv - fpv * qpv) / det, (fpv * qpp - a * qpv) / det
        g10, g11 = (b * qvv - fvv * qpv) / det, (fvv * qpp - b * qpv) / det
        d = x[i + 1] - ahead[i + 1]
        x[i, :2] += g00 * d[:2] + g01 * d[2:]
        x[i, 2:] += g10 * d[:2] + g11 * d[2:]
    return x[:, :2], x[:, 2:]


def headings(velocity: Floats, told: Floats, before: float = math.nan) -> Floats:
    """Headings [n, rad]: as told; else the course while the ship makes way; else that of its neighbours in time."""
    course = np.arctan2(velocity[:, 1], velocity[:, 0])
    makes_way = np.hypot(velocity[:, 0], velocity[:, 1]) > STILL
    psi = np.where(np.isfinite(told), told, np.where(makes_way, course, np.nan))
    known = np.flatnonzero(np.isfinite(psi))
    if not len(known):
        return np.full(len(psi), before if math.isfinite(before) else 0.0)
    place = np.searchsorted(known, np.arange(len(psi)), side="right") - 1
    return psi[known[np.maximum(place, 0)]]


def split_where_worst(count: int, off: Callable[[int, int], Floats]) -> NDArray[np.int64]:
    """Indices to keep of a sequence of ``count``, after Ramer, Douglas and Peucker.

    ``off(a, b)`` says how far each of the elements between a and b is off if they are left out, as a share of what may be.
    """
    keep, todo = {0, count - 1}, [(0, count - 1)]
    while todo:
        a, b = todo.pop()
        if b - a < 2:
            continue
        error = off(a, b)
        worst = int(np.argmax(error))
        if error[worst] > 1.0:
            middle = a + 1 + worst
            keep.add(middle)
            todo += [(a, middle), (middle, b)]
    return np.array(sorted(keep))


def thin(t: Floats, x: Floats, v: Floats, psi: Floats, tolerance: float = TOLERANCE) -> NDArray[np.int64]:
    """Indices of the knots to keep, so that the cubics between them pass all others in time, within the tolerance [m]."""
    turned = np.unwrap(psi)

    def off(a: int, b: int) -> Floats:
        inner = slice(a + 1, b)
        share = (t[inner] - t[a]) / (t[b] - t[a])
        apart = np.hypot(*(hermite(share, np.full(b - a - 1, t[b] - t[a]), x[a], x[b], v[a], v[b]) - x[inner]).T)
        swing = np.abs(turned[a] + share * (turned[b] - turned[a]) - turned[inner])
        return np.asarray(np.maximum(apart / tolerance, swing / HEADING_TOLERANCE))

    return split_where_worst(len(t), off)


def clean(table: Floats, place: Selection, *, max_gap: float = MAX_GAP, tolerance: float = TOLERANCE,
          time_std: float = TIME_STD) -> tuple[list[Track], int]:  # fmt: skip
    """Tracks of one station from its fixes [n, 6] in the order of ``fixes.COLUMNS``, and how many fixes were left out.

    More than one track means that ships share the MMSI.  A single fix is no track.
    """
    tracks, used = [], 0
    for chain in chains(to_local(table, place)):
        parts: list[Floats] = []
        for fixes in stretches(chain, max_gap):
            if len(fixes) < 2:
                continue
            used += len(fixes)
            x, v = smooth(fixes, time_std)
            psi = headings(v, fixes[:, PSI], parts[-1][-1, 5] if parts else math.nan)
            at = thin(fixes[:, T], x, v, psi, tolerance)
            course, speed = np.arctan2(v[:, 1], v[:, 0]), np.hypot(v[:, 0], v[:, 1])
            parts.append(np.column_stack([fixes[:, T], x, course, speed, psi])[at])
        if parts:
            tracks.append(Track(tuple(parts)))
    return tracks, len(table) - used


def at_times(track: Track, t: Floats) -> Floats:
    """Positions N, E [n, 2] of a track at times t [n]; NaN where the ship is not seen."""
    rows = []
    for part in track.parts:
        seen = np.ones(len(part))
        seen[-1] = 0.0
        v = part[:, 4:5] * np.column_stack([np.cos(part[:, 3]), np.sin(part[:, 3])])
        rows.append(np.column_stack([part[:, 0] * 1e6, part[:, 1:3], v, part[:, 5], seen]))
    return along(np.vstack(rows), t)
