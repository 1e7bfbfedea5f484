"""Numbers beside the map: gauges, the target table and the plots.  Degrees and knots begin here."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from ..units import DEG, DEG_PER_MIN, KNOT, wrap_360
from ..world.encounter import Encounter, encounters
from .primitives import Panel, Plot, Points, Series, TargetRow
from .sea import DESCRIPTORS, Detection, Sea

#: what a target is to the own ship
ENCOUNTERS = {
    Encounter.SAFE: "", Encounter.HEAD_ON: "head on", Encounter.CROSSING_GIVE_WAY: "give way",
    Encounter.CROSSING_STAND_ON: "stand on", Encounter.OVERTAKING: "overtaking", Encounter.OVERTAKEN: "overtaken",
}  # fmt: skip


def target_rows(sea: Sea) -> list[TargetRow]:
    """Rows of the detected targets, seen from the own ship: what the picture says, not what is true [one per detection]."""
    n = len(sea.detections)
    others = np.zeros((1, n, 4))
    for i, d in enumerate(sea.detections):
        others[0, i] = *d.position, *(velocity_of(d) or (0.0, 0.0))
    codes, distances, times = np.zeros((1, n), np.int64), np.zeros((1, n)), np.zeros((1, n))
    encounters(np.array([[*sea.here, *sea.velocity[sea.own]]]), others, codes, distances, times)
    rows = []
    for i, d in enumerate(sea.detections):
        dn, de = others[0, i, :2] - sea.here
        moving = velocity_of(d) is not None
        known = moving or not d.is_vessel  # of a vessel whose motion is not known nothing can be foretold
        rows.append(
            TargetRow(
                id=target_name(d),
                type=DESCRIPTORS.get(d.descriptor, "?"),
                encounter=ENCOUNTERS[Encounter(codes[0, i])] if moving else "",
                bearing=wrap_360(math.atan2(de, dn) / DEG),
                range=math.hypot(dn, de),
                cpa=float(distances[0, i]) if known else math.nan,
                tcpa=float(times[0, i]) if known else math.nan,
                sensors=d.sensor_letters,
            )
        )
    return rows


def velocity_of(d: Detection) -> tuple[float, float] | None:
    """Velocity [m/s] {n} of a detected target; None while its motion is unknown."""
    if not (d.motion_known and math.isfinite(d.sog) and math.isfinite(d.cog)):
        return None
    return d.sog * math.cos(d.cog), d.sog * math.sin(d.cog)


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


def panel(sea: Sea, rows: Sequence[TargetRow], status: tuple[str, ...], curves: tuple[Plot, ...]) -> Panel:
    """The whole panel of one instant, with the rows of its targets."""
    nearest = sorted(rows, key=lambda row: row.range)
    return Panel(status=status, gauges=gauges(sea), targets=tuple(nearest), plots=curves)


def clock(t: float) -> str:
    """Time as minutes and seconds, 3:05."""
    whole = round(t)
    return f"{whole // 60}:{whole % 60:02d}"


def _heading(degrees: float) -> str:
    """Three digits and a decimal, 359.96 being 000.0."""
    return f"{round(degrees, 1) % 360.0:05.1f}"
