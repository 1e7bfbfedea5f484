"""Numbers beside the map: gauges, the target table and the plots.  Degrees and knots begin here."""

from __future__ import annotations

import math

import numpy as np

from ..units import DEG, DEG_PER_MIN, KNOT, wrap_360
from .primitives import Panel, Plot, Points, Series, TargetRow
from .sea import DESCRIPTORS, Detection, Sea


def closest_approach(dn: float, de: float, dvn: float, dve: float) -> tuple[float, float]:
    """Distance [m] and time [s] of the closest approach of a target at (dn, de) that moves at (dvn, dve) relatively.

    A time below zero has passed already; without relative motion it is zero.
    """
    v2 = dvn * dvn + dve * dve
    t = -(dn * dvn + de * dve) / v2 if v2 > 1e-12 else 0.0
    return math.hypot(dn + dvn * t, de + dve * t), t


def target_row(sea: Sea, d: Detection) -> TargetRow:
    """Row of one detected target, seen from the own ship: what the picture says, not what is true."""
    dn, de = d.position[0] - sea.here[0], d.position[1] - sea.here[1]
    moving = d.motion_known and math.isfinite(d.sog) and math.isfinite(d.cog)
    cpa = tcpa = math.nan
    if moving or not d.is_vessel:
        vn, ve = (d.sog * math.cos(d.cog), d.sog * math.sin(d.cog)) if moving else (0.0, 0.0)
        own = sea.velocity[sea.own]
        cpa, tcpa = closest_approach(dn, de, vn - float(own[0]), ve - float(own[1]))
    return TargetRow(
        id=target_name(d),
        type=DESCRIPTORS.get(d.descriptor, "?"),
        bearing=wrap_360(math.atan2(de, dn) / DEG),
        range=math.hypot(dn, de),
        cpa=cpa,
        tcpa=tcpa,
        sensors=d.sensor_letters,
    )


def target_name(d: Detection) -> str:
    """Short name of a target: T and its id."""
    return f"T{d.id:02d}"


def gauges(sea: Sea) -> tuple[tuple[str, str], ...]:
    """Captions and values of the six boxes."""
    own = sea.own
    heading = wrap_360(sea.eta[own, 2] / DEG)
    speed = float(np.hypot(*sea.velocity[own]))
    closest = sea.closest()[0]
    thrust = " / ".join(f"{100.0 * x:.0f}" for x in sea.thrust) + " %" if sea.thrust else "-"
    return (
        ("HDG", f"{_heading(heading)}°"),
        ("SOG", f"{speed / KNOT:.1f} kn"),
        ("ROT", f"{sea.rot[own] / DEG_PER_MIN:+.0f}°/min"),
        ("THR P/S" if len(sea.thrust) == 2 else "THRUST", thrust),
        ("TRACKS", f"{len(sea.detections)} / {len(sea.others())}"),
        ("CLOSEST", f"{closest:.1f} m" if math.isfinite(closest) else "-"),
    )


def plots(t: Points, speed: Points, heading: Points, closest: Points, marker: float | None = None) -> tuple[Plot, ...]:
    """Speed [kn], heading [deg] and range to the closest object [m] over time [s]; inputs are SI and radians, each [T].

    The values printed are those at ``marker``, or the last ones.
    """
    if len(t) < 2:
        return ()
    now = len(t) - 1 if marker is None else int(np.clip(np.searchsorted(t, marker, side="right") - 1, 0, len(t) - 1))
    knots, degrees = speed / KNOT, np.unwrap(heading) / DEG
    near = np.where(np.isfinite(closest), closest, np.nan)
    near_text = f"{near[now]:.1f} m" if np.isfinite(near[now]) else "-"
    return (
        Plot("Speed", (Series("speed", t, knots, f"SOG {knots[now]:.1f} kn"),), marker=marker),
        Plot("Heading", (Series("heading", t, degrees, f"HDG {_heading(wrap_360(degrees[now]))}°"),), True, marker),
        Plot("Range to closest", (Series("closest", t, near, near_text),), marker=marker),
    )


def panel(sea: Sea, status: tuple[str, ...], curves: tuple[Plot, ...]) -> Panel:
    """The whole panel of one instant."""
    rows = sorted((target_row(sea, d) for d in sea.detections), key=lambda row: row.range)
    return Panel(status=status, gauges=gauges(sea), targets=tuple(rows), plots=curves)


def clock(t: float) -> str:
    """Time as minutes and seconds, 3:05."""
    whole = round(t)
    return f"{whole // 60}:{whole % 60:02d}"


def _heading(degrees: float) -> str:
    """Three digits and a decimal, 359.96 being 000.0."""
    return f"{round(degrees, 1) % 360.0:05.1f}"
