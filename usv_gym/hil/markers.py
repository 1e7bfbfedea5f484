"""What RViz draws: own ship with thrust arrows, ships, obstacles, detections with their uncertainty, the track.  {enu}."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from .fields import Stamp

ARROW, CUBE, CYLINDER, LINE_STRIP, TEXT = 0, 1, 3, 4, 9
_COLOURS = {
    "own": (0.95, 0.85, 0.2, 1.0), "ship": (0.85, 0.3, 0.25, 1.0), "obstacle": (0.65, 0.8, 0.9, 1.0),
    "detection": (0.2, 0.9, 0.4, 0.45), "thrust": (1.0, 0.5, 0.0, 1.0), "track": (0.95, 0.85, 0.2, 0.8),
    "text": (1.0, 1.0, 1.0, 1.0),
}  # fmt: skip
LIFETIME_NS = 2_000_000_000  #: a marker that is not repeated vanishes
METRES_PER_KN = 12.0  #: length of a thrust arrow per kN


def markers(signals: Any) -> list[dict[str, Any]]:
    """The markers of a world as it is now."""
    stamp = signals.common()["stamp"]
    made: list[dict[str, Any]] = []

    def add(ns: str, kind: int, colour: str, scale: tuple[float, float, float], x: float = 0.0, y: float = 0.0,
            yaw: float = 0.0, z: float = 0.0, **more: Any) -> None:  # fmt: skip
        r, g, b, a = _COLOURS[colour]
        made.append({
            "header": {"stamp": stamp, "frame_id": "map"}, "ns": ns, "id": len(made), "type": kind, "action": 0,
            "pose": {"position": {"x": x, "y": y, "z": z},
                     "orientation": {"x": 0.0, "y": 0.0, "z": math.sin(yaw / 2), "w": math.cos(yaw / 2)}},
            "scale": dict(zip("xyz", scale, strict=True)), "color": {"r": r, "g": g, "b": b, "a": a},
            "lifetime": Stamp(LIFETIME_NS), **more,
        })  # fmt: skip

    for thing in signals.sample("object"):
        x, y, size = thing["east"], thing["north"], thing["size"]
        if thing["descriptor"] == "ship":
            colour = "own" if thing["own"] else "ship"
            yaw, wide = thing["enu_yaw"], max(thing["beam"], 0.3 * size)
            stern = x - 0.5 * size * math.cos(yaw), y - 0.5 * size * math.sin(yaw)
            add("ships", ARROW, colour, (size, wide, 2.0), *stern, yaw)
            if thing["own"]:
                _thrust(signals, thing, add)
        else:
            add("obstacles", CYLINDER, "obstacle", (2 * size, 2 * size, 2.0), x, y)
        add("names", TEXT, "text", (1.0, 1.0, 12.0), x, y + size + 8.0, z=20.0, text=thing["id"])
    picture = signals.w["picture"]
    for s in np.flatnonzero(picture["id"][0]).tolist():
        north, east = map(float, picture["position"][0, s])
        c = picture["covariance"][0, s]
        radius = float(picture["radius"][0, s])
        spread = 2.0 * math.sqrt(max(float(c[0]) + float(c[2]), 0.0))
        reach = max((0.0 if math.isnan(radius) else radius) + spread, 3.0)
        add("detections", CYLINDER, "detection", (2 * reach, 2 * reach, 0.5), east, north)
        cog, sog = float(picture["cog"][0, s]), float(picture["sog"][0, s])
        if sog > 0.5 and math.isfinite(cog):
            add(
                "detections", ARROW, "detection", (30.0 * sog, 4.0, 1.0), east, north, math.pi / 2 - cog
            )  # half a minute ahead
    if len(signals.track) > 1:
        points = [{"x": x, "y": y, "z": 0.0} for x, y, _, _ in signals.track]
        add("track", LINE_STRIP, "track", (2.0, 0.0, 0.0), points=points)
    return made


def _thrust(signals: Any, own: dict[str, Any], add: Any) -> None:
    """An arrow for the force of each thruster, at its place."""
    w = signals.w
    p = int(w["vessels"]["plant"][signals.own])
    q, psi = w["plants"], own["heading"]
    for a in range(int(q["thrusters"][p])):
        n = float(q["n"][p, a])
        bucket = float(q["beta"][p, a]) if q["bucket"][p, a] else 1.0
        force = float(q["gain_ahead" if n > 0 else "gain_astern"][p, a]) * n * abs(n) * bucket
        if abs(force) < 1.0:
            continue
        x, y = float(q["x"][p, a]), float(q["y"][p, a])
        along = psi + float(q["direction"][p, a]) + float(q["alpha"][p, a]) + (math.pi if force < 0 else 0.0)
        north = own["north"] + x * math.cos(psi) - y * math.sin(psi)
        east = own["east"] + x * math.sin(psi) + y * math.cos(psi)
        length = METRES_PER_KN * abs(force) / 1000.0
        add("thrust", ARROW, "thrust", (length, 2.5, 1.0), east, north, math.pi / 2 - along, z=5.0)
