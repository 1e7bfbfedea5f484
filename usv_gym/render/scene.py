"""The map as data: a world, or a recorded episode, becomes a `Scene` of shapes in metres.  No display, no pixels."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ..world.land import Coast
from .compose import compose
from .panel import panel, plots, target_rows
from .primitives import Points, Primitive, Scene
from .scene_episode import scene_from_episode
from .sea import AisReport, Detection, History, Sea, sides

__all__ = ["History", "Scene", "scene_from_episode", "scene_from_snapshot", "sea_from_record"]


def scene_from_snapshot(
    world: Any,
    names: Sequence[str] = (),
    trails: History | None = None,
    *,
    observer: int = 0,
    half_width: float = 450.0,
    status: Sequence[str] = (),
    hide: Sequence[str] = (),
    extra: Mapping[str, Sequence[Primitive]] | None = None,
    coast: Coast = (),
) -> Scene:
    """Scene of a live world, centred on the own ship.

    Parameters
    ----------
    world
        one world record, ``worlds[b]`` (dtype of `usv_gym.world.state.world_dtype`).
    names
        names of the sources, vessels first [S]; missing ones are named by what they are.
    trails
        memory of the caller; the present instant is added to it.  Without one there are no trails and no plots.
    observer
        whose eyes to see through.
    half_width
        [m] from the own ship to the edge of the map.
    status
        texts beside the title, after the time (scenario, seed, policy).
    hide
        names of layers to leave out, see `usv_gym.render.primitives.LAYERS`.
    extra
        more primitives by layer, drawn over those of the same layer.
    coast
        the land of the world (`Core.coast`).
    """
    sea = sea_from_record(world, names, observer, coast)
    curves = None
    if trails is not None:
        trails.push(sea)
        curves = trails.curves(sea.own)
    rows = target_rows(sea)
    n, e = sea.here
    return compose(
        sea,
        trails.trails() if trails is not None else {},
        panel(sea, rows, (f"t = {sea.t:.1f} s", *status), plots(*curves) if curves is not None else ()),
        (n - half_width, n + half_width, e - half_width, e + half_width),
        extra,
        hide,
        forecast=rows,
    )


def sea_from_record(world: Any, names: Sequence[str] = (), observer: int = 0, coast: Coast = ()) -> Sea:
    """What one observer's map shows of a world record; the arrays are copies."""
    v, m, routes = world["vessels"], world["obstacles"], world["routes"]
    own = int(world["observer"][observer])
    count = int(routes["count"][own])
    return Sea(
        t=float(world["tick"]) * float(world["dt"]),
        own=own,
        names=names,
        kind=np.concatenate((v["kind"], m["kind"])),
        active=np.concatenate((v["active"], m["active"])) != 0,
        eta=v["eta"].copy(),
        velocity=v["velocity"].copy(),
        rot=v["nu"][:, 2].copy(),
        length=v["length"].copy(),
        beam=v["beam"].copy(),
        position=m["position"].copy(),
        radius=m["radius"].copy(),
        distance=world["safety"]["distance"][observer].copy(),
        detections=_detections(world["picture"], observer),
        ais=_reports(world["ais"], observer),
        route=routes["waypoint"][own, :count].copy(),
        acceptance=float(routes["radius"][own]),
        radar_range=_range(world, "radar"),
        lidar_range=_range(world, "lidar"),
        echoes=_echoes(world["picture"], observer),
        thrust=_thrust(world["plants"], int(v["plant"][own])),
        land=[polygon.rings for polygon in coast],
    )


def _detections(p: Any, o: int) -> list[Detection]:
    sources = np.flatnonzero(p["id"][o])
    fields = ("id", "descriptor", "position", "cog", "sog", "radius", "covariance", "sensors", "motion_known")
    columns = [p[field][o][sources].tolist() for field in fields]
    return [
        Detection(s, id_, descriptor, tuple(position), cog, sog, radius, tuple(covariance[:3]), sensors, bool(known))
        for s, id_, descriptor, position, cog, sog, radius, covariance, sensors, known in zip(
            sources.tolist(), *columns, strict=True
        )
    ]


def _echoes(p: Any, o: int) -> Points:
    echoes: Points = p["land"][o][p["land_sensors"][o] != 0]
    return echoes


def _reports(ais: Any, o: int) -> list[AisReport]:
    """The last report of every source that has reached the observer."""
    return [
        AisReport(int(s), (float(ais["position"][s, 0]), float(ais["position"][s, 1])), _direction(ais, s))
        for s in np.flatnonzero(ais["received"][o] > 0)
    ]


def _direction(ais: Any, s: Any) -> float:
    heading = float(ais["heading"][s])
    return heading if np.isfinite(heading) else float(ais["cog"][s])


def _range(world: Any, name: str) -> float:
    """Range [m] of a scanning sensor in the present weather; 0 without it."""
    sensors = world["sensors"]
    if not (sensors["exteroceptive"] and sensors[name]["on"]):
        return 0.0
    return float(sensors[name]["range"]) * (float(world["weather"][f"{name}_range_factor"]) or 1.0)


def _thrust(plants: Any, p: int) -> tuple[float, ...]:
    """Demanded thrust of plant p, port and starboard."""
    if p < 0:
        return ()
    n = int(plants["thrusters"][p])
    return sides(plants["command"][p, :n, 0], plants["y"][p, :n])
