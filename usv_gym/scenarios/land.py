"""From a scenario's ``land`` to polygons in {n}: read, projected around the origin, clipped, joined, simplified.

Projection: degrees of latitude and longitude times their lengths at the origin, as for everything else that a scenario
places by latitude and longitude.
"""

from __future__ import annotations

import functools
import math
import os
import re
from typing import Any

import numpy as np

from ..config import ConfigError
from ..units import DEG, metres_per_degree
from ..world.land import Coast, Polygon
from ..world.vessel import VesselModel
from .chart_files import S57_SUFFIX, need_charts, read_file, world_coast
from .land_schema import Land
from .places import GeoPoint
from .schema import Scenario

BEYOND = 3000.0  #: [m] kept around the places that a scenario names, unless it gives a radius
LEAST_AREA = 1.0  #: [m2] of a piece of land


def scenario_coast(scenario: Scenario, model: VesselModel) -> Coast:
    """The land of a scenario as polygons that do not overlap; empty if it has none, or none is near.

    Raises
    ------
    ConfigError
        if the land cannot be read, a polygon crosses itself, or the own ship starts on land.
    """
    if scenario.land is None:
        return ()
    need_charts(f"scenario {scenario.name!r}: land")
    land = scenario.land
    stamps = tuple(os.stat(name).st_mtime_ns for name in land.files)
    geometry, coast = _read(scenario.name, land, scenario.origin.latitude_deg, scenario.origin.longitude_deg,
                            land.radius or _reach(scenario), stamps)  # fmt: skip
    _check_start(scenario, model, geometry)
    return coast


def _reach(scenario: Scenario) -> float:
    """Half size [m] of a square around the origin that holds where things happen, and what a radar sees from there."""
    own = scenario.own_ship
    places = [own.position, *own.route, *(ship.waypoints[0] for ship in scenario.ships.values())]
    return max(abs(x) for place in places for x in scenario.local(place)) + BEYOND


@functools.lru_cache(maxsize=8)
def _read(
    name: str, land: Land, latitude: float, longitude: float, radius: float, stamps: tuple[int, ...]
) -> tuple[Any, Coast]:
    """The land as one shapely geometry in {n}, x = N, y = E [m], and as polygons."""
    import shapely

    north, east = metres_per_degree(latitude)
    half_n, half_e = 1.1 * radius / north, 1.1 * radius / east  # wider: what is cut here is cut again below
    around = longitude - half_e, max(latitude - half_n, -90.0), longitude + half_e, min(latitude + half_n, 90.0)

    def local(degrees: Any) -> Any:
        turn = (degrees[:, 0] - longitude + 180.0) % 360.0 - 180.0
        return np.column_stack([(degrees[:, 1] - latitude) * north, turn * east])

    parts = []
    for path in land.files:
        for what, geometry in read_file(path, land.layer, around, land.safety_depth):
            parts.append(_valid(f"{path}: {what}", shapely.transform(geometry, local), path.endswith(S57_SUFFIX)))
    if land.coast:
        parts += [_valid(what, shapely.transform(geometry, local), True) for what, geometry in world_coast(around)]
    for k, polygon in enumerate(land.polygons):
        rings = [[_place(c, local) for c in ring] for ring in (polygon.shell, *polygon.holes)]
        parts.append(_valid(f"scenario {name!r}: land.polygons.{k}", shapely.Polygon(rings[0], rings[1:]), False))
    square = [shapely.clip_by_rect(part, -radius, -radius, radius, radius) for part in parts]
    whole = shapely.union_all(square)
    if land.simplify > 0.0:
        whole = _simplified(whole, land.simplify)
    return whole, _polygons(whole)


def _simplified(geometry: Any, tolerance: float) -> Any:
    """A geometry with fewer corners; none of the old ones is farther from the new shore than ``tolerance`` [m]."""
    import shapely

    corners = shapely.points(shapely.get_coordinates(geometry))
    step = tolerance
    while True:
        # each part stays valid, but neighbours may come to overlap
        simple = shapely.union_all(shapely.get_parts(shapely.simplify(geometry, step)))
        shore = shapely.boundary(simple)
        shapely.prepare(shore)
        if len(corners) == 0 or shapely.distance(shore, corners).max() <= tolerance:
            return simple
        step *= 0.7  # where it keeps apart what would touch, GEOS may go beyond


def _place(place: tuple[float, float] | GeoPoint, local: Any) -> tuple[float, float]:
    if isinstance(place, GeoPoint):
        n, e = local(np.array([[place.longitude_deg, place.latitude_deg]]))[0].tolist()
        return n, e
    return place


def _valid(what: str, geometry: Any, repair: bool) -> Any:
    """A geometry whose rings do not cross; published charts are repaired, anything else is the user's to mend."""
    import shapely

    if shapely.is_valid(geometry):
        return geometry
    if repair:
        return shapely.make_valid(geometry)
    reason = shapely.is_valid_reason(geometry)
    place = re.search(r"\[(.*)\]", reason)
    at = f" near [{', '.join(f'{float(x):.1f}' for x in place[1].split())}]" if place else ""
    why = "crosses itself" if "elf-intersection" in reason else f"is no polygon ({reason.split('[')[0].strip().lower()})"
    raise ConfigError(f"{what} {why}{at} (north, east of the origin in metres)")


def _check_start(scenario: Scenario, model: VesselModel, geometry: Any) -> None:
    import shapely

    n, e = scenario.local(scenario.own_ship.position)
    psi = scenario.own_ship.heading_deg * DEG
    centre, bow = np.array([n, e]), 0.5 * model.length * np.array([math.cos(psi), math.sin(psi)])
    hull = shapely.LineString([centre - bow, centre + bow]).buffer(0.5 * model.beam, cap_style="flat")
    if shapely.intersects(geometry, hull):
        raise ConfigError(
            f"scenario {scenario.name!r}: own_ship.position: expected water, but the hull at [{n:g}, {e:g}] is on land"
        )


def _polygons(geometry: Any) -> Coast:
    """A shapely geometry as polygons; what is no area is left out."""
    import shapely

    parts = (part for part in shapely.get_parts(geometry) if part.geom_type == "Polygon" and part.area >= LEAST_AREA)
    return tuple(
        Polygon(
            np.array(part.exterior.coords[:-1], float),
            tuple(np.array(ring.coords[:-1], float) for ring in part.interiors),
        )
        for part in parts
    )
