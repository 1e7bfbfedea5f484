"""From a world at its start to the plain scenario that it is: one draw of a family, as a file."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from ..config import ConfigError
from ..units import DEG
from ..world import state
from .schema import Current, Obstacle, OwnShip, Scenario, Ship, Visibility, Waves, Weather, Wind

_CLASSES = {state.KIND_SHIP: "ship", state.KIND_VESSEL: "vessel", state.KIND_BOAT: "boat"}
_OBSTACLES = {
    state.KIND_ICEBERG: "iceberg", state.KIND_BUOY: "buoy", state.KIND_ISLET: "islet",
    state.KIND_LIGHTHOUSE: "lighthouse", state.KIND_PLATFORM: "platform",
}  # fmt: skip
_AFTER = {state.AFTER_STOP: "stop", state.AFTER_CONTINUE: "continue", state.AFTER_LOOP: "loop"}
_AIS = {state.AIS_NONE: "off", state.AIS_CLASS_A: "A", state.AIS_CLASS_B: "B"}


def freeze(scenario: Scenario, world: Any, names: Sequence[str] | None = None) -> Scenario:
    """The scenario without its family, with the ships, obstacles, weather and own ship that the record ``world`` has.

    Building it gives the same motion as the record.  ``names`` [S] are those of the sources; by default ship_1, .. and
    obstacle_1, ..  What the record does not hold (sensors, vessel, time) is taken from ``scenario``, and so are the ships of
    a scenario without a family.

    Raises
    ------
    ConfigError
        if a family drew what a plain scenario does not keep: its coast, or ships that do more than follow waypoints.
    """
    v, m = world["vessels"], world["obstacles"]
    if scenario.family and (world["land_id"] >= 0 or (v["behaviour"][v["active"] > 0] > state.BEHAVIOUR_WAYPOINTS).any()):
        raise ConfigError(
            f"family {scenario.family.name}: its coast and what its ships do cannot be written as a plain scenario; "
            "name the family and a seed instead"
        )
    V = len(v["active"])
    ships: dict[str, Ship] = {}
    for j in (1 + np.flatnonzero(v["active"][1:])).tolist():
        name = (names[j] if names else "") or f"ship_{j}"
        given = None if scenario.family else scenario.ships.get(name)
        ships[name] = given or _ship(world, j)
    obstacles: dict[str, Obstacle] = {}
    for i in np.flatnonzero(m["active"]).tolist():
        name = (names[V + i] if names else "") or f"obstacle_{i + 1}"
        obstacles[name] = _obstacle(m, i)
    return scenario.model_copy(
        update={"family": None, "weather": _weather(world["weather"]), "own_ship": _own_ship(scenario, world),
                "ships": ships, "obstacles": obstacles}
    )  # fmt: skip


def _route(world: Any, j: int) -> list[tuple[float, float]]:
    routes = world["routes"]
    return [(float(n), float(e)) for n, e in routes["waypoint"][j, : routes["count"][j]]]


def _ship(world: Any, j: int) -> Ship:
    v, routes = world["vessels"], world["routes"]
    start = (float(v["eta"][j, 0]), float(v["eta"][j, 1]))
    leg = int(routes["leg"][j])
    ahead = _route(world, j)[max(leg, 1) :]
    if not ahead:  # done with its route, or without one: straight on
        psi = float(v["eta"][j, 2])
        ahead = [(start[0] + 1000.0 * math.cos(psi), start[1] + 1000.0 * math.sin(psi))]
    return Ship.model_validate({
        "class": _CLASSES.get(int(v["kind"][j]), "vessel"),
        "length": float(v["length"][j]), "beam": float(v["beam"][j]), "speed": float(v["speed"][j]),
        "waypoints": (start, *ahead), "after_last": _AFTER[int(routes["after_last"][j])],
        "acceptance_radius": float(routes["radius"][j]),
        "turn": "constant" if v["turn_constant"][j] else "lowpass", "turn_time": float(v["turn_time"][j]),
        "max_turn_rate_deg": float(v["turn_rate_max"][j] / DEG),
        "ais": _AIS[int(v["ais_class"][j])], "mmsi": int(v["mmsi"][j]),
    })  # fmt: skip


def _obstacle(m: Any, i: int) -> Obstacle:
    drift: Any = "current" if m["drifts"][i] else (float(m["velocity"][i, 0]), float(m["velocity"][i, 1]))
    return Obstacle.model_validate({
        "kind": _OBSTACLES[int(m["kind"][i])], "position": (float(m["position"][i, 0]), float(m["position"][i, 1])),
        "radius": float(m["radius"][i]), "drift": "none" if drift == (0.0, 0.0) else drift,
        "ais": bool(m["ais_class"][i]), "mmsi": int(m["mmsi"][i]) or None,
    })  # fmt: skip


def _own_ship(scenario: Scenario, world: Any) -> OwnShip:
    v, routes = world["vessels"], world["routes"]
    update: dict[str, Any] = {
        "position": (float(v["eta"][0, 0]), float(v["eta"][0, 1])),
        "heading_deg": math.degrees(math.remainder(float(v["eta"][0, 2]), math.tau)),
        "speed": float(v["nu"][0, 0]),
        "route": tuple(_route(world, 0)[1:]),
    }
    if update["route"]:
        update["acceptance_radius"] = float(routes["radius"][0])
    return scenario.own_ship.model_copy(update=update)


def _weather(p: Any) -> Weather:
    def back(to: float) -> float:
        return (math.degrees(to) + 180.0) % 360.0

    return Weather(
        wind=Wind(speed=float(p["wind_speed"]), from_deg=back(p["wind_to"]), gusts=bool(p["wind_slow"]["std"])),
        current=Current(speed=float(p["current_speed"]), to_deg=math.degrees(p["current_to"]) % 360.0),
        waves=Waves(height=float(p["wave_height"]), from_deg=back(p["wave_to"])),
        visibility=Visibility(radar_range=float(p["radar_range_factor"]), lidar_range=float(p["lidar_range_factor"]),
                              detection=float(p["detection_factor"])),
    )  # fmt: skip
