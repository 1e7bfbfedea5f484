"""Native schema of a scenario: one sea with its weather, own ship, traffic and obstacles, frozen once it is read.

SI units and degrees; other units are named in the key.  Wind and waves come *from*, the current sets *to*.  Places are
``[north, east]`` metres from the origin, or ``{latitude_deg, longitude_deg}``.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from datetime import UTC, datetime
from pathlib import Path
from typing import Annotated, Any, Literal, NamedTuple, Self

from pydantic import (
    AwareDatetime,
    BeforeValidator,
    Discriminator,
    Field,
    Tag,
    ValidationInfo,
    field_validator,
    model_validator,
)

from ..config import ConfigError, Model, locate, problem, suggestion
from ..resources import shipped
from ..units import KNOT, metres_per_degree
from ..world.state import E
from ..world.vessel import KinematicModel
from .behaviours import Behaviour, Hostile, Waypoints
from .events import Event, Shower, check_targets, phantoms
from .family_schema import AnyFamily
from .land_schema import Land
from .places import Direction, GeoPoint, Name, Origin, Position
from .sensor_schema import Flag, NonNegative, Number, Positive, Sensors, SensorsInput, Share, expand_sensors
from .tracks import TrackError, check, nested, read_tracks

Preset = Literal["standard", "original"]

MAX_WAYPOINTS = 32  #: that a route in the world record holds
OWN_SHIP = "own_ship"  #: name of vessel slot 0
DT = 0.05  #: [s] tick of the thesis


# --- ship classes ----------------------------------------------------------------------------------------------------
class ShipClass(NamedTuple):
    """What a ship is like when the file does not say (thesis 3.1.1: size, speed, agility, use of AIS)."""

    length: float  # [m]
    speed_kn: float
    turn_time: float  # time constant of the heading filter [s]
    max_turn_rate_deg: float  # [deg/s]
    ais: Literal["A", "B"]


#: 10 s is the thesis's heading filter; the rest are assumptions of this project in the spirit of the thesis's groups
SHIP_CLASSES: Mapping[str, ShipClass] = {
    "ship": ShipClass(100.0, 10.0, 10.0, 1.0, "A"),
    "vessel": ShipClass(30.0, 8.0, 6.0, 3.0, "A"),
    "boat": ShipClass(8.0, 12.0, 3.0, 10.0, "B"),
}
CONSTANT_TURN_RATE_DEG = 5.0  #: [deg/s] of every ship in the original program


def class_of_length(length: float) -> str:
    """Class of a ship that has only a length [m]: ship above 50 m, vessel above 15 m, else boat."""
    return "ship" if length > 50.0 else "vessel" if length > 15.0 else "boat"


# --- groups ----------------------------------------------------------------------------------------------------------
class Simulation(Model):
    """Time and area.  Intervals are whole numbers of ticks, kept in whole microseconds."""

    dt: Annotated[float, Field(strict=True, gt=0, le=1)] = DT
    traffic_interval: Positive = Field(default=0.1, description="[s] ships decide and distances are swept this often")
    control_interval: Positive = Field(default=1.0, description="[s] between two actions")
    duration: Positive = Field(default=300.0, description="[s] an episode is truncated after this time")
    area: Positive | None = Field(default=None, description="half size [m] of the square around the origin; none: open")
    epoch: AwareDatetime = Field(default=datetime(2017, 6, 1, 12, tzinfo=UTC), description="UTC at the start")

    @model_validator(mode="after")
    def _whole_ticks(self) -> Self:
        if abs(self.dt * 1e6 - self.dt_us) > 1e-6 * self.dt_us:
            raise problem(f"expected a whole number of microseconds, got {self.dt!r} s", "dt")
        for key in ("traffic_interval", "control_interval"):
            value = getattr(self, key)
            ticks = value / self.dt
            if round(ticks) < 1 or abs(ticks - round(ticks)) > 1e-9 * ticks:
                raise problem(
                    f"expected a whole number of ticks of {self.dt:g} s, got {value:g} s ({ticks:.6g} ticks)", key
                )
        return self

    @property
    def dt_us(self) -> int:
        """Tick [us]."""
        return max(round(self.dt * 1e6), 1)

    @property
    def frame_ticks(self) -> int:
        """Ticks per traffic frame."""
        return round(self.traffic_interval / self.dt)

    @property
    def control_ticks(self) -> int:
        """Ticks per control step."""
        return round(self.control_interval / self.dt)


class Wind(Model):
    """Wind at 10 m height."""

    speed: NonNegative = 0.0
    from_deg: Direction = 0.0
    gusts: Flag = Field(default=True, description="false: wind and current are steady")


class Current(Model):
    """Surface current."""

    speed: NonNegative = 0.0
    to_deg: Direction = 0.0


class Waves(Model):
    """Sea state."""

    height: NonNegative = Field(default=0.0, description="significant wave height [m]")
    from_deg: Direction = 0.0


class Visibility(Model):
    """What the air does to the sensors, on top of rain, fog and snow; 1 is clear."""

    radar_range: Share = Field(default=1.0, description="share of the radar's range that is left")
    lidar_range: Share = Field(default=1.0, description="share of the LiDAR's range that is left")
    detection: Share = Field(default=1.0, description="factor of the probability of detection")


class Weather(Model):
    """Wind, current, waves, visibility and what falls."""

    wind: Wind = Wind()
    current: Current = Current()
    waves: Waves = Waves()
    visibility: Visibility = Visibility()
    rain: Share = Field(default=0.0, description="intensity; 1 is heavy")
    fog: Share = Field(default=0.0, description="intensity; 1 is dense")
    snow: Share = Field(default=0.0, description="intensity; 1 is a squall")


def _kind_of_vessel(value: Any) -> str | None:
    if isinstance(value, KinematicModel | Mapping):
        return "kinematic"
    return "name" if isinstance(value, str) else None


VesselSource = Annotated[
    Annotated[str, Tag("name")] | Annotated[KinematicModel, Tag("kinematic")],
    Discriminator(
        _kind_of_vessel,
        custom_error_type="vessel",
        custom_error_message="expected the name or path of a vessel, or a kinematic vessel in full",
    ),
]


class OwnShip(Model):
    """The USV: which vessel, where it starts, where it is going."""

    vessel: VesselSource = Field(
        default="odin", description="name in configs/vessels, path of a YAML file, or a kinematic vessel in full"
    )
    position: Position = (0.0, 0.0)
    heading_deg: Direction = 0.0
    speed: Number = Field(default=0.0, description="ahead, over ground [m/s]")
    route: Annotated[tuple[Position, ...], Field(max_length=MAX_WAYPOINTS - 1)] = Field(
        default=(), description="waypoints to reach, without the start"
    )
    acceptance_radius: Positive = Field(default=20.0, description="[m]")
    memory: Flag = Field(default=False, description="fluid-memory forces")
    ais: Literal["A", "B", "off"] = "A"
    mmsi: Annotated[int, Field(strict=True, ge=201_000_000, le=775_999_999)] | None = None

    @field_validator("vessel")
    @classmethod
    def _vessel_exists(cls, value: str | KinematicModel, info: ValidationInfo) -> str | KinematicModel:
        if isinstance(value, KinematicModel):
            return value
        try:
            path = locate("vessels", value, (info.context or {}).get("directory"))
        except ConfigError as error:
            raise problem(str(error)) from None
        # a path that was relative to the file must still hold where the scenario is used or dumped to
        return value if value in shipped("vessels") else str(path.resolve())

    @property
    def vessel_name(self) -> str:
        """What the vessel is called."""
        return self.vessel if isinstance(self.vessel, str) else self.vessel.name


def _by_class(what: str) -> Callable[[dict[str, Any]], Any]:
    # pydantic gives a default factory the fields validated so far; after a bad class any default will do
    return lambda fields: getattr(SHIP_CLASSES[fields.get("class_", "vessel")], what)


class Handover(Model):
    """When a replayed ship leaves its track, for good, to its `behaviour`."""

    distance: NonNegative = Field(default=0.0, description="[m] to the own ship")
    dcpa: NonNegative = Field(default=0.0, description="[m] from the own ship that it will pass at, ...")
    tcpa: Positive = Field(default=600.0, description="... within this time [s]")


Knot = Annotated[tuple[Number, ...], Field(min_length=5, max_length=6)]
Track = tuple[tuple[Knot, ...], ...]


class Ship(Model):
    """A ship that follows waypoints, the first one is where it starts, heading for the second; or that replays a track."""

    class_: Literal["ship", "vessel", "boat"] = Field(
        default="vessel", alias="class", description="default: by length, ship above 50 m, vessel above 15 m, else boat"
    )
    length: Positive = Field(default_factory=_by_class("length"), description="[m]")
    beam: Positive = Field(default_factory=lambda fields: fields.get("length", 6.0) / 6.0, description="[m]; L / 6")
    speed: NonNegative | None = Field(default=None, description="[m/s]")
    speed_kn: NonNegative | None = Field(default=None, description="[kn]; neither: by class")
    waypoints: Annotated[tuple[Position, ...], Field(max_length=MAX_WAYPOINTS)] = ()
    track: Annotated[Track, BeforeValidator(nested, json_schema_input_type=str | tuple[Knot, ...] | Track)] | None = Field(
        default=None,
        description="recorded, instead of waypoints: a CSV file beside this one, or knots [t, north, east, course_deg, "
        "speed, heading_deg], or a list of parts of knots between which the ship is not seen",
    )
    handover: Handover | None = Field(default=None, description="when a replayed ship is left to itself; none: never")
    after_last: Literal["stop", "continue", "loop"] = "stop"
    behaviour: Behaviour = Field(default=Waypoints(), description="what it does: a word, or a mapping with kind and options")
    acceptance_radius: Positive = Field(default=50.0, description="[m]")
    turn: Literal["lowpass", "constant"] | None = Field(
        default=None, description="low-pass filter, or constant rate; default: by preset (the original: constant)"
    )
    turn_time: Positive = Field(default_factory=_by_class("turn_time"), description="time constant of the filter [s]")
    max_turn_rate_deg: Positive | None = Field(default=None, description="[deg/s]; default: by class, or 5 if constant")
    ais: Annotated[
        Literal["A", "B", "off", "auto"], BeforeValidator(lambda value: "off" if value is False else value)
    ] = Field(default="auto", description="auto: by class")
    mmsi: Annotated[int, Field(strict=True, ge=201_000_000, le=775_999_999)] | None = None

    @model_validator(mode="before")
    @classmethod
    def _class_from_length(cls, data: Any) -> Any:
        if isinstance(data, Mapping) and "class" not in data and isinstance(data.get("length"), int | float):
            return {"class": class_of_length(data["length"]), **data}
        return data

    @model_validator(mode="after")
    def _makes_sense(self) -> Self:
        if self.track is not None:
            self._replays()
        elif self.handover is not None:
            raise problem("only a ship with a track is handed over", "handover")
        elif not self.waypoints:
            raise problem("required key is missing (or track)", "waypoints")
        elif len(self.waypoints) < 2:
            raise problem(f"needs at least two waypoints, got {len(self.waypoints)}", "waypoints")
        if self.speed is not None and self.speed_kn is not None:
            raise problem("give speed or speed_kn, not both", "speed_kn")
        return self

    def _replays(self) -> None:
        for key in ("waypoints", "speed", "speed_kn"):
            if getattr(self, key):
                raise problem("a ship with a track has none of its own", key)
        try:
            check(self.track or ())
        except TrackError as error:
            raise problem(str(error), "track") from None

    @property
    def set_speed(self) -> float:
        """Speed over ground [m/s]."""
        if self.speed is not None:
            return self.speed
        return KNOT * (SHIP_CLASSES[self.class_].speed_kn if self.speed_kn is None else self.speed_kn)

    @property
    def ais_class(self) -> Literal["A", "B", "off"]:
        """AIS station on board."""
        return SHIP_CLASSES[self.class_].ais if self.ais == "auto" else self.ais

    def turns_constantly(self, preset: Preset) -> bool:
        """True if the ship turns at a constant rate instead of through the low-pass filter."""
        return self.turn == "constant" or (self.turn is None and preset == "original")

    def turn_rate(self, preset: Preset) -> float:
        """Largest turn rate [deg/s]."""
        if self.max_turn_rate_deg is not None:
            return self.max_turn_rate_deg
        constant = self.turns_constantly(preset)
        return CONSTANT_TURN_RATE_DEG if constant else SHIP_CLASSES[self.class_].max_turn_rate_deg


def _drift(value: Any) -> Any:
    pair = isinstance(value, list | tuple) and len(value) == 2
    if value not in ("none", "current") and not (
        pair and all(isinstance(v, int | float) and not isinstance(v, bool) for v in value)
    ):
        raise problem(f"expected 'none', 'current' or [north, east] in m/s, got {value!r}")
    return value


class Obstacle(Model):
    """A disc: fixed, carried by the current, or drifting at a velocity of its own."""

    kind: Literal["iceberg", "buoy", "islet", "lighthouse", "platform"] = "iceberg"
    position: Position
    radius: Positive
    drift: Annotated[Literal["none", "current"] | tuple[float, float], BeforeValidator(_drift)] = Field(
        default="none", description="none, current, or velocity [north, east] [m/s]"
    )
    ais: Flag = Field(default=False, description="carries an AIS aid-to-navigation station")
    mmsi: Annotated[int, Field(strict=True, ge=992_000_000, le=997_999_999)] | None = None


def _read_tracks(ships: Any, info: ValidationInfo) -> Any:
    """Put the knots of CSV files in the place of their names, so that a scenario holds all that it needs."""
    if not isinstance(ships, Mapping):
        return ships
    directory = (info.context or {}).get("directory") or Path()
    read = {}
    for name, ship in ships.items():
        if isinstance(ship, Mapping) and isinstance(ship.get("track"), str):
            try:
                tracks = read_tracks(directory / ship["track"])
            except TrackError as error:
                raise problem(str(error), name, "track") from None
            if name not in tracks:
                raise problem(f"no rows of ship {name!r} in {ship['track']}{suggestion(name, tracks)}", name, "track")
            read[name] = {**ship, "track": tracks[name]}
    return {**ships, **read}


# --- scenario --------------------------------------------------------------------------------------------------------
class Scenario(Model):
    """Everything a world is made of."""

    schema_version: Literal[1] = Field(default=1, alias="schema")
    name: str = ""
    description: str = ""
    preset: Preset = Field(default="standard", description="original: constants and quirks of the simulator of 2017")
    base: str | None = Field(default=None, description="scenario by name or path that the other keys here change")
    family: AnyFamily | None = Field(
        default=None, description="random family, by name or in full, that is drawn on top of the rest at every reset"
    )
    scale: Positive = Field(default=1.0, description="of the distances by which a task observes and rewards")
    origin: Origin = Origin(latitude_deg=59.4377744115633, longitude_deg=10.4716511800410)
    simulation: Simulation = Simulation()
    weather: Weather = Weather()
    land: Land | None = None
    own_ship: OwnShip = Field(default_factory=OwnShip)
    ships: Annotated[dict[Name, Ship], BeforeValidator(_read_tracks)] = Field(default_factory=dict)
    obstacles: dict[Name, Obstacle] = Field(default_factory=dict)
    sensors: Annotated[Sensors, BeforeValidator(expand_sensors, json_schema_input_type=str | SensorsInput)] = Field(
        default="thesis", validate_default=True, description="name in configs/sensors, path, or mapping with `base`"
    )
    events: Annotated[tuple[Event, ...], Field(max_length=E)] = Field(default=(), description="what happens, and when")

    @model_validator(mode="after")
    def _names_and_numbers_are_unique(self) -> Self:
        for group in ("ships", "obstacles"):
            if OWN_SHIP in getattr(self, group):
                raise problem("this name is that of the own ship", group, OWN_SHIP)
        for name in self.obstacles:
            if name in self.ships:
                raise problem("a ship has this name already", "obstacles", name)
        given: dict[int, tuple[str, ...]] = {}
        for path, thing in self._stations():
            if thing.mmsi is not None:
                if thing.mmsi in given:
                    raise problem(f"{thing.mmsi} is that of {'.'.join(given[thing.mmsi])} already", *path, "mmsi")
                given[thing.mmsi] = path
        for name, ship in self.ships.items():
            if ship.waypoints and self.local(ship.waypoints[0]) == self.local(ship.waypoints[1]):
                raise problem("the first two are the same place: no direction to start in", "ships", name, "waypoints")
            if isinstance(ship.behaviour, Hostile):
                self._other_ship(ship.behaviour.target, name, "ships", name, "behaviour", "target")
        tracked = {name: ship.track is not None for name, ship in self.ships.items()}
        check_targets(self.events, tracked, list(self.obstacles))
        return self

    def _other_ship(self, target: str, name: str, *key: str | int) -> None:
        """Refuse a target that is no ship, or the ship itself."""
        known = [OWN_SHIP, *(other for other in self.ships if other != name)]
        if target not in known:
            raise problem(f"unknown ship {target!r}{suggestion(target, known)}", *key)

    def _stations(self) -> list[tuple[tuple[str, ...], OwnShip | Ship | Obstacle]]:
        return [
            ((OWN_SHIP,), self.own_ship),
            *((("ships", name), ship) for name, ship in self.ships.items()),
            *((("obstacles", name), obstacle) for name, obstacle in self.obstacles.items()),
        ]

    def local(self, position: tuple[float, float] | GeoPoint) -> tuple[float, float]:
        """Place in {n}: north, east of the origin [m]."""
        if not isinstance(position, GeoPoint):
            return position
        north, east = metres_per_degree(self.origin.latitude_deg)
        # the short way round, also across the date line
        turn = (position.longitude_deg - self.origin.longitude_deg + 180.0) % 360.0 - 180.0
        return (position.latitude_deg - self.origin.latitude_deg) * north, turn * east

    @property
    def clutter(self) -> bool:
        """True if there may be false alarms."""
        w, s = self.weather, self.sensors
        rates = (w.rain, w.fog, w.snow, s.radar.false_alarms, s.lidar.false_alarms)
        drawn = self.family is not None and self.family.failures > 0.0
        return any(rates) or drawn or any(isinstance(event, Shower) for event in self.events)

    def phantoms(self) -> list[str]:
        """Names of targets that are not there, false alarms and spoofed stations, from the last obstacle slot downwards."""
        return phantoms(self.events, self.clutter)

    def mmsis(self) -> dict[str, int]:
        """MMSI of own ship, ships and obstacles by name: as given, else the next free from 257000001 and 992570001."""
        stations = [(path[-1], thing) for path, thing in self._stations()]
        taken = {thing.mmsi for _, thing in stations}
        vessel = _free(257_000_001, taken)
        aid = _free(992_570_001, taken)
        return {
            name: thing.mmsi or (next(aid) if isinstance(thing, Obstacle) else next(vessel)) for name, thing in stations
        }

    def sensor_rates(self) -> dict[str, float]:
        """Rate [Hz] of every periodic sensor by key path."""
        s = self.sensors
        rates = {f"navigation.{key}": getattr(s.navigation, key).rate for key in type(s.navigation).model_fields}
        scans = {"radar": 1.0 / s.radar.period, "lidar": s.lidar.rate, "tdm": s.tdm.rate}
        return rates | scans

    def faster_than_tick(self) -> dict[str, float]:
        """Sensors [Hz] that are asked to fire more often than there are ticks; they fire every tick."""
        return {key: rate for key, rate in self.sensor_rates().items() if rate * self.simulation.dt > 1.0 + 1e-9}


def _free(first: int, taken: Iterable[int | None]) -> Any:
    used = set(taken)
    number = first
    while True:
        if number not in used:
            yield number
        number += 1
