"""The map of a whole recorded episode: tracks, detections and their history, shadows, closest approaches."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ..replay.archive import Episode
from .compose import compose
from .panel import clock, panel, plots, target_rows
from .primitives import Circle, Dots, Label, Points, Polyline, Primitive, Scene
from .sea import AisReport, Detection, Sea, Trail, sides

MARKED = 4  #: this many closest approaches are marked
NEAR = 400.0  #: [m] objects that never came nearer (or than the own track is long) do not widen the view
HISTORY = 1500  #: past detections shown, at most
STALE_REPORTS = 180.0  #: [s] an AIS symbol stays this long after its report (the slowest class A interval)


def scene_from_episode(
    episode: Episode,
    t: float | None = None,
    *,
    marked: int = MARKED,
    status: Sequence[str] | None = None,
    hide: Sequence[str] = (),
    future: bool = True,
    half_width: float | None = None,
    extra: Mapping[str, Sequence[Primitive]] | None = None,
) -> Scene:
    """Scene of an archive: whole tracks, and everything else as it was at one time.

    Parameters
    ----------
    episode
        from `usv_gym.replay.archive.load` or a recorder.
    t
        time [s] of positions, detections and shadows; the end when None.
    marked
        how many of the closest approaches to mark, nearest first.
    status
        texts beside the title, after the time; scenario, seed and policy when None.
    hide
        names of layers to leave out, see `usv_gym.render.primitives.LAYERS`.
    future
        whether tracks and closest approaches after t are shown.
    half_width
        [m] from the own ship to the edge of the map; everything that came near is in view when None.
    extra
        more primitives by layer, drawn over those of the same layer.

    Raises
    ------
    ValueError
        if t lies outside the episode.
    """
    start, end = float(episode.t[0]), float(episode.t[-1])
    if t is not None and not start <= t <= end:
        raise ValueError(f"t = {t:g} s lies outside the episode ({start:g} to {end:g} s)")
    i = len(episode.t) - 1 if t is None else int(np.searchsorted(episode.t, t, side="right")) - 1
    sea = sea_from_episode(episode, i, 0.0 if t is None else t)
    last = math.inf if future else sea.t
    speed = np.hypot(episode.nu[:, sea.own, 0], episode.nu[:, sea.own, 1])
    curves = plots(episode.t, speed, episode.eta[:, sea.own, 2], _nearest(episode), marker=None if t is None else sea.t)
    texts = _status(episode.meta) if status is None else tuple(status)
    labels, marks = _approaches(episode, marked, last)
    more: dict[str, list[Primitive]] = {"detections": _past(episode, sea.t), "symbols": marks, "labels": labels}
    for name, primitives in (extra or {}).items():
        more.setdefault(name, []).extend(primitives)
    (n, e), r, rows = sea.here, half_width or 0.0, target_rows(sea)
    trails = {j: _trail(episode, j, sea, future) for j in range(sea.vessels)}
    return compose(
        sea,
        {j: trail for j, trail in trails.items() if len(trail.t) > 1},
        panel(sea, rows, (f"t = {clock(sea.t)}", *texts), curves),
        (n - r, n + r, e - r, e + r) if half_width else _extent(episode, sea),
        more,
        hide,
        forecast=rows if t is not None else (),
    )


def sea_from_episode(episode: Episode, i: int, t: float = 0.0) -> Sea:
    """What there was on the sea at sample i; at a time t [s] before the next sample, everything has moved on its way there."""
    meta, now = episode.meta, float(episode.t[i])
    eta, obstacle = episode.eta[i], episode.obstacle[i]
    if t > now and i + 1 < len(episode.t):
        share, now = (t - now) / (float(episode.t[i + 1]) - now), t
        there = (episode.active[i] & episode.active[i + 1])[:, None]
        change = episode.eta[i + 1] - eta
        change[:, 2] = (change[:, 2] + math.pi) % (2.0 * math.pi) - math.pi
        eta = eta + share * change * there[: len(eta)]
        obstacle = obstacle + share * (episode.obstacle[i + 1] - obstacle) * there[len(eta) :]
    own = int(meta["own"])
    psi, nu = eta[:, 2], episode.nu[i]
    sensors = meta.get("sensors", {})
    waypoints = meta.get("waypoints") or []
    radii = meta.get("acceptance_radius") or []
    command = episode.command[i, :, 0]
    thruster_y = meta.get("thruster_y")
    return Sea(
        t=now,
        own=own,
        names=meta.get("names", []),
        kind=np.asarray(meta["kinds"]),
        active=episode.active[i],
        eta=eta,
        velocity=np.column_stack(
            (nu[:, 0] * np.cos(psi) - nu[:, 1] * np.sin(psi), nu[:, 0] * np.sin(psi) + nu[:, 1] * np.cos(psi))
        ),
        rot=nu[:, 2],
        length=episode.length,
        beam=episode.beam,
        position=obstacle,
        radius=episode.radius,
        distance=episode.distance[i].astype(np.float64),
        detections=_detections(episode.detections, now),
        ais=_reports(episode.ais, now),
        route=np.array(waypoints[own] if own < len(waypoints) else [], dtype=np.float64).reshape(-1, 2),
        acceptance=float(radii[own] or 0.0) if own < len(radii) else 0.0,
        radar_range=_range(sensors, "radar"),
        lidar_range=_range(sensors, "lidar"),
        thrust=sides(command, np.asarray(thruster_y)) if thruster_y else (),
        land=[[np.array(ring, dtype=np.float64) for ring in rings] for rings in meta.get("land") or ()],
    )


def _range(sensors: Mapping[str, Any], name: str) -> float:
    sensor = sensors.get(name, {})
    return float(sensor.get("range") or 0.0) if sensor.get("on") else 0.0


def _status(meta: Mapping[str, Any]) -> tuple[str, ...]:
    scenario = meta.get("scenario")
    name = scenario.get("name", "") if isinstance(scenario, Mapping) else scenario
    seed = meta.get("seed")
    texts = (str(name or ""), str(meta.get("policy") or ""), "" if seed is None else f"seed {seed}")
    return tuple(text for text in texts if text)


def _detections(table: Any, now: float) -> list[Detection]:
    """The picture that was current: the rows of the last one sent out."""
    past = table[table["t"] <= now + 1e-9]
    rows = past[past["t"] == past["t"][-1]] if len(past) else past
    return [
        Detection(
            source=int(r["source"]),
            id=int(r["id"]),
            descriptor=int(r["descriptor"]),
            position=(float(r["north"]), float(r["east"])),
            cog=float(r["cog"]),
            sog=float(r["sog"]),
            radius=float(r["radius"]),
            covariance=(float(r["cov_nn"]), float(r["cov_ne"]), float(r["cov_ee"])),
            sensors=int(r["sensors"]),
            motion_known=bool(r["motion_known"]),
        )
        for r in rows
    ]


def _reports(table: Any, now: float) -> list[AisReport]:
    """The last message of every source that got through."""
    past = table[(table["t"] <= now) & (table["t"] >= now - STALE_REPORTS) & table["received"]]
    last = {int(r["source"]): r for r in past}
    return [
        AisReport(
            s, (float(r["north"]), float(r["east"])), float(r["heading"] if np.isfinite(r["heading"]) else r["cog"])
        )
        for s, r in sorted(last.items())
    ]


def _trail(episode: Episode, j: int, sea: Sea, future: bool) -> Trail:
    on = episode.active[:, j]
    if future:
        return Trail(episode.t[on], episode.eta[on, j])
    on = on & (episode.t < sea.t)
    return Trail(np.append(episode.t[on], sea.t), np.vstack((episode.eta[on, j], sea.eta[j])))


def _hull_distances(episode: Episode) -> Points:
    """Distance from the own ship to every source [T, S]; infinite where there is none."""
    known = episode.active & np.isfinite(episode.distance)
    d: Points = np.where(known, episode.distance, np.inf).astype(np.float64)
    d[:, int(episode.meta["own"])] = np.inf
    return d


def _nearest(episode: Episode) -> Points:
    nearest: Points = _hull_distances(episode).min(axis=1, initial=np.inf)
    return nearest


def _past(episode: Episode, now: float) -> list[Primitive]:
    """Where targets were detected before: faint dots, thinned out when there are many."""
    past = episode.detections[episode.detections["t"] <= now]
    past = past[:: max(1, math.ceil(len(past) / HISTORY))]
    return [Dots(np.column_stack((past["north"], past["east"])), "detection_past", 2.5)] if len(past) else []


def _approaches(episode: Episode, marked: int, last: float) -> tuple[list[Primitive], list[Primitive]]:
    """Labels and marks of the nearest of the closest approaches: a line between the two as they were then."""
    labels: list[Primitive] = []
    marks: list[Primitive] = []
    distance = _hull_distances(episode)
    nearest = distance.min(axis=0)
    for s in np.argsort(nearest, kind="stable")[:marked]:
        if not nearest[s] < NEAR:
            break
        i = int(distance[:, s].argmin())
        if episode.t[i] > last:
            continue
        own = episode.eta[i, int(episode.meta["own"]), :2]
        other = episode.position(int(s))[i]
        middle = (float(0.5 * (own[0] + other[0])), float(0.5 * (own[1] + other[1])))
        time = clock(float(episode.t[i]))
        if nearest[s] <= 0.0:
            here = (float(own[0]), float(own[1]))
            marks.append(Circle(here, 0.0, "collision", 26.0))
            labels.append(Label((f"COLLISION at {time}",), here, "label_cpa", priority=9.0))
            continue
        marks += [Polyline(np.array([own, other]), "cpa"), Dots(own[None], "cpa_dot", 5.0)]
        labels.append(Label((f"{nearest[s]:.0f} m at {time}",), middle, "label_cpa", priority=4.5))
    return labels, marks


def _extent(episode: Episode, sea: Sea) -> tuple[float, float, float, float]:
    """Own track, route, and whatever came near, with a margin for labels."""
    points = [episode.eta[episode.active[:, sea.own], sea.own, :2], sea.route]
    span = float(np.ptp(np.vstack(points), axis=0).max())
    distance, limit = _hull_distances(episode), max(NEAR, span)
    for s in np.flatnonzero(distance.min(axis=0) < limit):
        points.append(episode.position(int(s))[[distance[:, s].argmin()]])
        if sea.distance[s] < limit:
            points.append(np.array([sea.place(int(s))]))
    cloud = np.vstack(points)
    (south, west), (north, east) = cloud.min(axis=0), cloud.max(axis=0)
    margin = max(60.0, 0.07 * max(north - south, east - west))
    return float(south - margin), float(north + margin), float(west - margin), float(east + margin)
