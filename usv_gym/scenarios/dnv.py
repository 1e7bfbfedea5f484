"""Traffic situations in DNV's maritime schema (JSON), as the generator ``trafficgen`` writes and reads them.

Places are latitude and longitude, speeds in knots, angles in degrees clockwise from north.  A ship is its waypoints, with the
speed of the leg that begins at each, and its initial state, which alone will do.
"""

from __future__ import annotations

import itertools
import json
import math
import re
import warnings
from collections.abc import Callable, Iterable
from datetime import datetime
from pathlib import Path
from typing import Annotated, Any

from pydantic import ConfigDict, Field, model_validator

from ..config import ConfigError, Document, Model, problem, validate
from ..units import KNOT, metres_per_degree
from ..world.vessel import load_vessel
from .family_schema import REFERENCE_DISTANCE
from .places import GeoPoint, Latitude, Longitude
from .schema import OWN_SHIP, SHIP_CLASSES, Scenario, Ship, class_of_length

SCHEMA_VERSION = "0.2.0"
WITHOUT_ROUTE = 3 * 3600.0  #: [s] a ship that has an initial state only sails straight on for so long, as trafficgen has it
LENGTH = 100.0  #: [m] of a ship that does not say
_SHIP_TYPES = {"ship": "Cargo", "vessel": "Other", "boat": "Pleasure craft"}

Positive = Annotated[float, Field(gt=0)]
Angle = Annotated[float, Field(ge=0, le=360)]
Knots = Annotated[float, Field(ge=0)]


class SituationWarning(UserWarning):
    """Something that the other format cannot say."""


# --- what is read of a file ------------------------------------------------------------------------------------------
class _Part(Model):
    """A part of a situation; other keys are allowed by the schema and ignored."""

    model_config = ConfigDict(extra="ignore")

    @model_validator(mode="before")
    @classmethod
    def _only_known_keys(cls, data: Any) -> Any:
        return data


class _Place(_Part):
    lat: Latitude
    lon: Longitude


class _Leg(_Part):
    sog: Knots | None = None


class _Waypoint(_Part):
    position: _Place
    leg: _Leg = _Leg()


class _Initial(_Part):
    position: _Place | None = None
    sog: Knots | None = None
    cog: Angle | None = None
    heading: Angle | None = None


class _Dimensions(_Part):
    length: Positive | None = None
    width: Positive | None = None
    a: Positive | None = None
    b: Positive | None = None
    c: Positive | None = None
    d: Positive | None = None


class _Static(_Part):
    mmsi: int | None = None
    name: str | None = None
    dimensions: _Dimensions = _Dimensions()
    sog_max: Knots | None = Field(default=None, alias="sogMax")


class _Ship(_Part):
    initial: _Initial = _Initial()
    waypoints: tuple[_Waypoint, ...] = ()
    static: _Static = _Static()

    @model_validator(mode="after")
    def _sails(self) -> _Ship:
        if not self.waypoints and self.initial.position is None:
            raise problem("expected waypoints, or an initial position", "waypoints")
        if self.speed is None:
            raise problem("expected a speed: waypoints.0.leg.sog or initial.sog", "initial")
        if len(self.waypoints) < 2 and self.course is None:
            raise problem("expected two waypoints, or an initial cog", "waypoints")
        return self

    @property
    def speed(self) -> float | None:
        """Speed at the start [kn]."""
        first = self.waypoints[0].leg.sog if self.waypoints else None
        return self.initial.sog if first is None else first

    @property
    def course(self) -> float | None:
        """Initial course [deg]."""
        return self.initial.heading if self.initial.cog is None else self.initial.cog

    def size(self) -> tuple[float, float]:
        """Length and beam [m]."""
        d = self.static.dimensions
        length = d.length or ((d.a + d.b) if d.a and d.b else LENGTH)
        return length, d.width or ((d.c + d.d) if d.c and d.d else length / 6.0)

    def places(self) -> list[dict[str, float]]:
        """Its way, two places at least, as the native schema writes them."""
        places = [w.position for w in self.waypoints]
        if not places and self.initial.position is not None:
            places = [self.initial.position]
        if len(places) < 2:
            north, east = metres_per_degree(places[0].lat)
            course, way = math.radians(self.course or 0.0), (self.speed or 0.0) * KNOT * WITHOUT_ROUTE
            places.append(_Place(lat=places[0].lat + way * math.cos(course) / north,
                                 lon=_turned(places[0].lon + way * math.sin(course) / east)))  # fmt: skip
        return [{"latitude_deg": p.lat, "longitude_deg": p.lon} for p in places]


class _Situation(_Part):
    title: str | None = None
    description: str | None = None
    start_time: datetime | None = Field(default=None, alias="startTime")
    own_ship: _Ship = Field(alias="ownShip")
    target_ships: tuple[_Ship, ...] = Field(default=(), alias="targetShips")


def _turned(longitude: float) -> float:
    return (longitude + 180.0) % 360.0 - 180.0


# --- reading ---------------------------------------------------------------------------------------------------------
def read_situation(path: str | Path) -> Document:
    """Read a traffic situation as the data of a native scenario.

    The own ship becomes a kinematic vessel of its size and speed; its start is the origin.

    Raises
    ------
    ConfigError
        if the file cannot be read, is not JSON, or not such a situation: one line per problem, with the key.

    Warns
    -----
    SituationWarning
        if a ship changes its speed from leg to leg: it keeps that of the first.
    """
    file = Path(path)
    try:
        data = json.loads(file.read_text(encoding="utf-8"))
    except json.JSONDecodeError as error:
        raise ConfigError(f"{file}:{error.lineno}: not valid JSON: {error.msg}") from None
    except UnicodeDecodeError as error:
        raise ConfigError(f"{file}: expected UTF-8 text: {error.reason} at byte {error.start}") from None
    except OSError as error:
        raise ConfigError(f"{file}: cannot be read: {error.strerror or error}") from None
    if not isinstance(data, dict) or "ownShip" not in data:
        raise ConfigError(f"{file}: expected a traffic situation: a mapping with ownShip and targetShips")
    return Document(str(file), _native(validate(_Situation, Document(str(file), data)), file.stem))


def _native(situation: _Situation, name: str) -> dict[str, Any]:
    own = situation.own_ship
    places = own.places()
    start = places[0]
    length, beam = own.size()
    speed = (own.speed or 0.0) * KNOT
    kind = SHIP_CLASSES[class_of_length(length)]
    north, east = metres_per_degree(start["latitude_deg"])
    steps = [((b["latitude_deg"] - a["latitude_deg"]) * north,
              _turned(b["longitude_deg"] - a["longitude_deg"]) * east) for a, b in itertools.pairwise(places)]
    way = sum(math.hypot(*step) for step in steps)
    cruise = speed or kind.speed_kn * KNOT
    heading = own.initial.heading
    if heading is None:
        heading = math.degrees(math.atan2(steps[0][1], steps[0][0])) % 360.0
    called = _unique()
    result: dict[str, Any] = {
        "schema": 1,
        "name": name,
        "description": ": ".join(text for text in (situation.title, situation.description) if text),
        "origin": start,
        "simulation": {"dt": 0.1, "traffic_interval": 0.5, "control_interval": 1.0,
                       "duration": float(math.ceil(1.5 * way / cruise))},
        "scale": max(0.5 * way / REFERENCE_DISTANCE, 1e-3),
        "own_ship": {
            "vessel": {
                "model": "kinematic", "name": own.static.name or "own ship", "length": length, "beam": beam,
                "cruise_speed": cruise, "max_speed": max((own.static.sog_max or 0.0) * KNOT, 1.25 * cruise),
                "turn_time": kind.turn_time, "max_turn_rate_deg": kind.max_turn_rate_deg,
                "speed_time": 4.0 * length / cruise,
            },
            "position": start, "heading_deg": heading, "speed": speed, "route": places[1:],
            "acceptance_radius": max(2.0 * length, 0.02 * way), **_mmsi(own),
        },
        "ships": {called(ship.static.name or f"ship_{k}"): _ship(ship) for k, ship in enumerate(situation.target_ships, 1)},
        "sensors": {"base": "ship"},
    }  # fmt: skip
    if situation.start_time is not None:
        moment = situation.start_time
        result["simulation"]["epoch"] = moment.isoformat() if moment.tzinfo else moment.isoformat() + "Z"
    return result


def _ship(ship: _Ship) -> dict[str, Any]:
    length, beam = ship.size()
    others = {w.leg.sog for w in ship.waypoints[:-1]} - {None, ship.speed}
    if others:
        message = f"{ship.static.name}: sails all legs at the {ship.speed:g} kn of the first"
        warnings.warn(message, SituationWarning, stacklevel=6)
    return {"length": length, "beam": beam, "speed": (ship.speed or 0.0) * KNOT, "waypoints": ship.places(),
            "after_last": "continue", "ais": "A", **_mmsi(ship)}  # fmt: skip


def _mmsi(ship: _Ship) -> dict[str, int]:
    """The MMSI, if it is one of a ship."""
    mmsi = ship.static.mmsi
    return {"mmsi": mmsi} if mmsi is not None and 201_000_000 <= mmsi <= 775_999_999 else {}


def _unique() -> Callable[[str], str]:
    """A function that makes names that are fit and unique."""
    taken = {OWN_SHIP}

    def called(text: str) -> str:
        base = re.sub(r"[.=]|[^\x20-\x7e\xa0-\U0010ffff]", "_", text).strip() or "ship"
        name, number = base, 2
        while name in taken:
            name, number = f"{base}_{number}", number + 1
        taken.add(name)
        return name

    return called


# --- writing ---------------------------------------------------------------------------------------------------------
def situation_of(scenario: Scenario) -> dict[str, Any]:
    """A scenario as the data of a traffic situation; distances from the own ship's start are kept exactly.

    Raises
    ------
    ConfigError
        if the scenario is a family: draw from it first (``freeze``).

    Warns
    -----
    SituationWarning
        for obstacles, and for ships that sail in circles: the format has neither.
    """
    if scenario.family is not None:
        raise ConfigError(f"scenario {scenario.name!r}: a family has no ships of its own; draw a scenario from it first")
    lost = [f"obstacle {name}" for name in scenario.obstacles]
    lost += [f"the loop of {name}" for name, ship in scenario.ships.items() if ship.after_last == "loop"]
    lost += [f"the times of the track of {name}" for name, ship in scenario.ships.items() if ship.track]
    if lost:
        more = f" and {len(lost) - 3} more" if len(lost) > 3 else ""
        warnings.warn(f"a traffic situation has no place for {', '.join(lost[:3])}{more}", SituationWarning, stacklevel=2)
    from .. import __version__

    own = scenario.own_ship
    n0, e0 = scenario.local(own.position)
    north, east = metres_per_degree(scenario.origin.latitude_deg)
    latitude, longitude = scenario.origin.latitude_deg + n0 / north, scenario.origin.longitude_deg + e0 / east
    if isinstance(own.position, GeoPoint):
        latitude, longitude = own.position.latitude_deg, own.position.longitude_deg
    north, east = metres_per_degree(latitude)

    def places(route: Iterable[tuple[float, float] | GeoPoint], speed: float) -> list[dict[str, Any]]:
        local = [scenario.local(place) for place in route]
        return [{"position": {"lat": latitude + (n - n0) / north, "lon": _turned(longitude + (e - e0) / east)},
                 "leg": {"sog": speed / KNOT}} for n, e in local]  # fmt: skip

    mmsis = scenario.mmsis()
    model = load_vessel(own.vessel)
    speed = own.speed or model.cruise_speed
    first = _data(1, own.heading_deg, places([own.position, *own.route], speed), model.name, model.length, model.beam,
                  mmsis[OWN_SHIP], "Other")  # fmt: skip
    if not own.route:
        del first["waypoints"]
        first["initial"] |= {"position": {"lat": latitude, "lon": longitude}, "sog": speed / KNOT,
                             "cog": own.heading_deg % 360.0}  # fmt: skip
    return {
        "trafficgenVersion": f"usv-gym {__version__}",
        "schemaVersion": SCHEMA_VERSION,
        "title": scenario.name,
        "description": scenario.description,
        "startTime": scenario.simulation.epoch.isoformat().replace("+00:00", "Z"),
        "ownShip": first,
        "targetShips": [
            _data(k, *_way(scenario, ship, places), name, ship.length, ship.beam, mmsis[name], _SHIP_TYPES[ship.class_])
            for k, (name, ship) in enumerate(scenario.ships.items(), start=2)
        ],
    }  # fmt: skip


def _way(scenario: Scenario, ship: Ship, places: Callable[..., list[dict[str, Any]]]) -> tuple[float, list[dict[str, Any]]]:
    """Heading at the start [deg], and waypoints; of a recorded track its knots, at the speed of the first."""
    if ship.track:
        knots = [knot for part in ship.track for knot in part]
        return knots[0][3], places([(knot[1], knot[2]) for knot in knots], knots[0][4])
    (n0, e0), (n1, e1) = (scenario.local(place) for place in ship.waypoints[:2])
    return math.degrees(math.atan2(e1 - e0, n1 - n0)), places(ship.waypoints, ship.set_speed)


def _data(
    number: int, heading_deg: float, waypoints: list[dict[str, Any]], name: str, length: float, beam: float, mmsi: int,
    kind: str,
) -> dict[str, Any]:  # fmt: skip
    """A ship of a situation: its state at the start, its way, what it is."""
    return {
        "initial": {"heading": heading_deg % 360.0, "navStatus": "Under way using engine"},
        "waypoints": waypoints,
        "static": {
            "id": number, "mmsi": mmsi, "name": name, "shipType": kind,
            "dimensions": {"length": length, "width": beam, "a": length / 2, "b": length / 2, "c": beam / 2, "d": beam / 2},
        },
    }  # fmt: skip


def write_situation(scenario: Scenario) -> bytes:
    """The file of a scenario's traffic situation; see :func:`situation_of`."""
    return json.dumps(situation_of(scenario), indent=1, allow_nan=False).encode() + b"\n"
