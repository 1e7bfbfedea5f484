"""The start of a scenario as a chart: who is where, where everybody is going, and how near they come if nobody manoeuvres.

Unlike the other scenes this one shows the truth, for it is the scenario that is looked at, not what a vessel sees of it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..scenarios.tracks import along
from ..units import DEG, KNOT, wrap_360
from ..world.encounter import Encounter, encounters
from ..world.land import Coast
from ..world.state import AFTER_CONTINUE, AFTER_LOOP
from .compose import compose
from .panel import ENCOUNTERS, clock
from .primitives import Circle, Dots, Label, Panel, Plot, Points, Polyline, Primitive, Scene, Series, TargetRow
from .scene import sea_from_record
from .sea import HULLS, Sea

STEP = 1.0  #: [s] of the prediction
LOOP = 3  #: rounds of a loop that are predicted
FEW = 12  #: obstacles up to which each that has a name of its own shows it
ROUTE_SHARE = 0.3  #: closest points are marked up to this share of the own way
WORDS = {
    Encounter.SAFE: "", Encounter.HEAD_ON: "head-on", Encounter.CROSSING_GIVE_WAY: "crossing, give way",
    Encounter.CROSSING_STAND_ON: "crossing, stand on", Encounter.OVERTAKING: "overtaking", Encounter.OVERTAKEN: "overtaken",
}  # fmt: skip


@dataclass(frozen=True)
class Meeting:
    """One ship and its closest point to the own ship, both sailing their routes at their speeds."""

    slot: int
    name: str
    code: Encounter  #: at the start
    track: Points  #: [T, 2] N, E [m]
    distance: Points  #: [T] between the middles of the ships [m]
    nearest: int  #: index of the closest point

    @property
    def id(self) -> str:
        """Short name: S and its slot."""
        return f"S{self.slot}"

    @property
    def tcpa(self) -> float:
        """Time of the closest point [s]."""
        return STEP * self.nearest

    @property
    def dcpa(self) -> float:
        """Distance then [m]."""
        return float(self.distance[self.nearest])


def scene_of_start(
    world: Any,
    names: Sequence[str] = (),
    *,
    title: str = "",
    cruise: float = 0.0,
    duration: float = 600.0,
    status: Sequence[str] = (),
    hide: Sequence[str] = ("shadows",),
    tracks: Points | None = None,
    coast: Coast = (),
) -> Scene:
    """Scene of a world at its start.

    Parameters
    ----------
    world
        one world record just reset.
    names
        names of the sources, vessels first [S].
    title
        of the scenario.
    cruise
        speed [m/s] of an own ship that starts at rest.
    duration
        time [s] to look ahead at most.
    status
        texts beside the title, as the seed.
    hide
        names of layers to leave out.
    tracks
        pool of recorded tracks [n, 7], of a world with replayed ships.
    coast
        the land of the world (`Core.coast`).
    """
    sea = sea_from_record(world, names, coast=coast)
    own = _own_track(world, sea, cruise, duration)
    t = STEP * np.arange(len(own), dtype=np.float64)
    meetings = [_meeting(world, sea, j, own, t, tracks) for j in sea.others() if j < sea.vessels]
    way = float(np.hypot(*np.diff(own, axis=0).T).sum())
    near = max(ROUTE_SHARE * way, 100.0)
    marked = [m for m in meetings if sea.velocity[m.slot].any() and m.dcpa < near and 0 < m.nearest < len(t) - 1]
    extent = _extent(sea, own, marked)
    scene = compose(sea, {}, _panel(sea, meetings, t, title, status), extent, _plan(own, meetings, marked), hide)
    labels = [p for p in scene.layers["labels"] if getattr(p, "role", "") not in ("label_vessel", "label_fixed")]
    scene.layers["labels"] = [] if "labels" in hide else [*labels, *_names(sea, meetings)]
    return scene


# --- where everybody goes --------------------------------------------------------------------------------------------
def _sail(points: Points, speed: float, t: Points, on: bool) -> Points:
    """Places [T, 2] of a ship that sails straight from point to point [n, 2] at a speed [m/s], and straight ``on`` or stops."""
    lengths = np.hypot(*np.diff(points, axis=0).T)
    points = points[np.concatenate([[True], lengths > 1e-9])]
    if len(points) < 2 or speed <= 0.0:
        return np.repeat(points[:1], len(t), axis=0)
    if on:
        last = points[-1] - points[-2]
        points = np.vstack([points, points[-1] + last / np.hypot(*last) * (speed * t[-1] + 1.0)])
    along = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(points, axis=0).T))])
    return np.column_stack([np.interp(speed * t, along, points[:, i]) for i in range(2)])


def _ahead(world: Any, j: int, place: Points) -> tuple[Points, bool]:
    """The way of vessel j from where it is, [n, 2], and whether it goes straight on behind its end."""
    routes = world["routes"]
    waypoints = np.asarray(routes["waypoint"][j, : routes["count"][j]], np.float64)
    ahead = waypoints[int(routes["leg"][j]) :]
    if not len(ahead):
        psi = float(world["vessels"]["eta"][j, 2])
        return np.vstack([place, np.add(place, (math.cos(psi), math.sin(psi)))]), True
    if routes["after_last"][j] == AFTER_LOOP:
        ahead = np.vstack([ahead, *[waypoints] * LOOP])
    return np.vstack([place, ahead]), bool(routes["after_last"][j] == AFTER_CONTINUE)


def _own_track(world: Any, sea: Sea, cruise: float, duration: float) -> Points:
    """Places [T, 2] of the own ship until it is at the end of its route, or for the whole duration without one."""
    place = np.array(sea.here)
    points, on = _ahead(world, sea.own, place)
    speed = float(np.hypot(*sea.velocity[sea.own]))
    speed = speed if speed > 0.1 else cruise
    if not on and speed > 0.0:
        duration = min(duration, float(np.hypot(*np.diff(points, axis=0).T).sum()) / speed)
    return _sail(points, speed, STEP * np.arange(math.floor(duration / STEP) + 2, dtype=np.float64), on)


def _meeting(world: Any, sea: Sea, j: int, own: Points, t: Points, tracks: Points | None) -> Meeting:
    first, count = int(world["replays"]["first"][j]), int(world["replays"]["count"][j])
    if tracks is not None and count:
        track = along(tracks[first : first + count], t)
        track[0] = sea.place(j)
    else:
        points, on = _ahead(world, j, np.array(sea.place(j)))
        track = _sail(points, float(np.hypot(*sea.velocity[j])), t, on)
    distance = np.nan_to_num(np.hypot(*(track - own).T), nan=np.inf)  # a replayed ship may not be there any more
    codes, d, when = np.zeros((1, 1), np.int64), np.zeros((1, 1)), np.zeros((1, 1))
    velocity = (own[1] - own[0]) / STEP  # of one who starts at rest, as it will be
    encounters(np.array([[*own[0], *velocity]]), np.array([[[*track[0], *sea.velocity[j]]]]), codes, d, when)
    name = sea.names[j] if j < len(sea.names) else ""
    code = Encounter(codes[0, 0]) if sea.velocity[j].any() else Encounter.SAFE  # one at rest is an obstacle
    return Meeting(j, name or HULLS.get(int(sea.kind[j]), "ship"), code, track, distance,
                   int(distance.argmin()))  # fmt: skip


# --- what is drawn ---------------------------------------------------------------------------------------------------
def _plan(own: Points, meetings: Sequence[Meeting], marked: Sequence[Meeting]) -> dict[str, list[Primitive]]:
    tracks: list[Primitive] = []
    symbols: list[Primitive] = []
    labels: list[Primitive] = []
    for m in meetings:
        tracks.append(Polyline(_seen(m.track[: m.nearest + 1]), "track_ship"))
        tracks.append(Polyline(_seen(m.track[m.nearest :]), "track_later"))
    # several closest points in one place are said in one label
    groups: list[list[Meeting]] = []
    near = 0.02 * float(np.ptp(own, axis=0).max())
    for m in marked:
        here = _middle(own, m)
        group = next((g for g in groups if np.hypot(*(here - _middle(own, g[0]))) < near), None)
        groups.append([m]) if group is None else group.append(m)
        places = np.array([own[m.nearest], m.track[m.nearest]])
        symbols += [Polyline(places, "cpa"), Dots(places, "cpa_dot", 5.0)]
    for group in groups:
        at = _middle(own, group[0])
        symbols.append(Circle((float(at[0]), float(at[1])), 0.0, "mark", 16.0))
        first = group[0]
        more = f" ({len(group)} ships)" if len(group) > 1 else f" {first.id}" if len(meetings) > 1 else ""
        text = f"CPA{more} {first.dcpa:.0f} m at {clock(first.tcpa)}"
        free = at + 1.6 * near * _free_side(own, group)
        labels.append(Label((text,), (float(free[0]), float(free[1])), "label_cpa", priority=7.0))
    return {"tracks": tracks, "symbols": symbols, "labels": labels}


def _seen(track: Points) -> Points:
    """The places of a track at which there is a ship."""
    return track[np.isfinite(track[:, 0])]


def _free_side(own: Points, group: Sequence[Meeting]) -> Points:
    """Direction to the east [N, E] in which a text is crossed by none of the tracks of a closest point, if there is one."""
    lines = [own[-1] - own[0], *(_seen(m.track)[-1] - m.track[0] for m in group)]
    taken = np.array([math.atan2(line[1], line[0]) + turn for line in lines for turn in (0.0, math.pi)])
    sides = np.radians([55.0, 125.0, 90.0, 75.0, 105.0])
    free = np.abs(np.angle(np.exp(1j * (sides[:, None] - taken)))).min(axis=1)
    best = float(sides[int(free.argmax())])
    return np.array([math.cos(best), math.sin(best)])


def _middle(own: Points, m: Meeting) -> Points:
    middle: Points = 0.5 * (own[m.nearest] + m.track[m.nearest])
    return middle


def _names(sea: Sea, meetings: Sequence[Meeting]) -> list[Primitive]:
    """What each ship is to the own ship, its course and speed; obstacles by name if they are few."""
    labels: list[Primitive] = []
    for m in meetings:
        speed = float(np.hypot(*sea.velocity[m.slot]))
        first = f"{m.id} {m.name}  {WORDS[m.code]}".strip()
        second = f"{wrap_360(round(sea.eta[m.slot, 2] / DEG)):03.0f}°  {speed / KNOT:.1f} kn  {sea.length[m.slot]:.0f} m"
        labels.append(Label((first, second), sea.place(m.slot), "label_vessel", 0.3 * float(sea.length[m.slot]), 5.0))
    obstacles = [s for s in sea.others() if s >= sea.vessels]
    if len(obstacles) <= FEW:
        for s in obstacles:
            name = sea.names[s] if s < len(sea.names) and not sea.names[s].startswith("obstacle_") else ""
            labels.append(Label((name,), sea.place(s), "label_fixed", float(sea.radius[s - sea.vessels]), 2.0))
    return [label for label in labels if isinstance(label, Label) and label.lines[0]]


def _panel(sea: Sea, meetings: Sequence[Meeting], t: Points, title: str, status: Sequence[str]) -> Panel:
    own = sea.own
    speed = float(np.hypot(*sea.velocity[own]))
    rows = []
    for m in meetings:
        dn, de = np.subtract(sea.place(m.slot), sea.here)
        rows.append(TargetRow(
            id=m.id, type=HULLS.get(int(sea.kind[m.slot]), "ship"), encounter=ENCOUNTERS[m.code],
            bearing=wrap_360(math.atan2(de, dn) / DEG), range=math.hypot(dn, de), cpa=m.dcpa, tcpa=m.tcpa, sensors="",
        ))  # fmt: skip
    gauges = (
        ("HDG", f"{wrap_360(round(sea.eta[own, 2] / DEG, 1)) % 360.0:05.1f}°"), ("SOG", f"{speed / KNOT:.1f} kn"),
        ("LENGTH", f"{sea.length[own]:.1f} m"), ("SHIPS", str(len(meetings))),
        ("OBSTACLES", str(len(sea.others()) - len(meetings))),
        ("CPA", f"{min(m.dcpa for m in meetings):.0f} m" if meetings else "-"),
    )  # fmt: skip
    curves: tuple[Plot, ...] = ()
    if meetings and len(t) > 1:
        near = np.min([m.distance for m in meetings], axis=0)
        near = np.minimum(near, near[np.isfinite(near)].max())
        curves = (Plot("Range to closest ship, as planned", (Series("closest", t, near, f"least {near.min():.0f} m"),)),)
    return Panel(title or "start", tuple(status), gauges, tuple(rows), curves)


def _extent(sea: Sea, own: Points, marked: Sequence[Meeting]) -> tuple[float, float, float, float]:
    """The own way, the ships that come near from their start to their closest point, and what is not too far away."""
    points = [own, sea.route] if len(sea.route) else [own]
    limit = 3.0 * max(float(np.ptp(np.vstack(points), axis=0).max()), 400.0)
    points += [_seen(m.track[: m.nearest + 1]) for m in marked]
    for s in sea.others():
        place = np.array([sea.place(s)])
        if np.hypot(*(place[0] - own[0])) < limit:
            points.append(place)
    cloud = np.vstack(points)
    (south, west), (north, east) = cloud.min(axis=0), cloud.max(axis=0)
    margin = max(60.0, 0.08 * max(north - south, east - west))
    return float(south - margin), float(north + margin), float(west - margin), float(east + margin)
