"""The thesis's own files (Appendix B): dynamics, obstacles and ships, sensors -> data of a native scenario.

Each file is recognised by its keys, so they may come in any order, or as the YAML files of a directory.  Where a file
is not given the original's own default holds: a calm sea at the same start, nobody there, the noise of B.3.  In a
file every key is required, as a missing one is more likely forgotten than meant (``AIS_range_m`` alone may be left
out: the original never read it).

Wind, waves *and current* are directions that they come from, as the thesis's text says.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any

from pydantic import BeforeValidator, Field, create_model

from ..config import ConfigError, Document, KeyPath, Model, problem, read_yaml, suggestion, validate
from .places import Direction, Latitude, Longitude
from .schema import MAX_WAYPOINTS, class_of_length
from .sensor_schema import RADAR_REACH, NonNegative, Positive, load_sensors

#: [m] straight ahead (north) of the start: the thesis's files have no route for the own ship
DEFAULT_ROUTE_LENGTH = 500.0


def _decimal(value: Any) -> Any:
    """A number with a decimal comma or point; anything else is left for the schema to refuse."""
    if isinstance(value, str) and re.fullmatch(r"\s*[-+]?\d+([.,]\d*)?\s*", value):
        return float(value.replace(",", "."))
    return value


Decimal = BeforeValidator(_decimal)
_Positive = Annotated[Positive, Decimal]
_NonNegative = Annotated[NonNegative, Decimal]
_Direction = Annotated[Direction, Decimal]


class DynamicsFile(Model):
    """B.1: weather, time step, navigation rates, start."""

    wind_speed: _NonNegative
    wind_direction: _Direction
    current_speed: _NonNegative
    current_direction: _Direction
    wave_height: _NonNegative
    wave_direction: _Direction
    dt: _Positive
    gps_frequency: _Positive
    mru_frequency: _Positive
    imu_frequency: _Positive
    speed_sensor_frequency: _Positive
    wind_sensor_frequency: _Positive
    start_latitude: Annotated[Latitude, Decimal]
    start_longitude: Annotated[Longitude, Decimal]


def _fields(text: Any, known: Mapping[str, bool]) -> dict[str, Any]:
    """``KEY=value`` fields of a text; ``known`` says of each whether it may be repeated."""
    if not isinstance(text, str):
        raise problem(f"expected a text of {' '.join(f'{key}=..' for key in known)}, got {text!r}")
    found: dict[str, Any] = {}
    for word in text.split():
        key, equals, value = word.partition("=")
        if not equals or not value:
            raise problem(f"expected KEY=value, got {word!r}")
        if key not in known:
            hint = "; did you mean 'LENGTH'?" if key.lower() == "size" else suggestion(key, known)
            raise problem(f"unknown field {key!r}{hint}")
        if known[key]:
            found.setdefault(key, []).append(value)
        elif key in found:
            raise problem(f"duplicate field {key!r}")
        else:
            found[key] = value
    return found


def _number(fields: Mapping[str, Any], key: str, default: float | None = None) -> float:
    if key not in fields:
        if default is None:
            raise problem(f"required field {key!r} is missing")
        return default
    value = _decimal(fields[key])
    if not isinstance(value, float):
        raise problem(f"expected {key}=number, got {key + '=' + fields[key]!r}")
    return value


def _place(key: str, text: str) -> dict[str, float]:
    """``lon/lat`` in decimal degrees -> native position."""
    parts = [_decimal(part) for part in text.split("/")]
    if len(parts) != 2 or not all(isinstance(part, float) for part in parts):
        raise problem(f"expected {key}=longitude/latitude in decimal degrees, got {key + '=' + text!r}")
    longitude, latitude = parts
    if abs(latitude) > 90.0 or abs(longitude) > 180.0:
        what, got, limit = ("latitude", latitude, 90) if abs(latitude) > 90.0 else ("longitude", longitude, 180)
        raise problem(f"expected a {what} from -{limit} to {limit} deg, got {got:g} in {key + '=' + text!r}")
    return {"latitude_deg": latitude, "longitude_deg": longitude}


def _obstacle(text: Any) -> dict[str, Any]:
    fields = _fields(text, {"RADIUS": False, "COORD": False})
    radius = _number(fields, "RADIUS")
    if radius <= 0.0:
        raise problem(f"expected a RADIUS greater than 0, got {radius:g}")
    if "COORD" not in fields:
        raise problem("required field 'COORD' is missing")
    return {"kind": "iceberg", "position": _place("COORD", fields["COORD"]), "radius": radius}


def _ship(text: Any) -> dict[str, Any]:
    fields = _fields(text, {"LENGTH": False, "SpeedInKnots": False, "WP": True})
    length, speed = _number(fields, "LENGTH", 1.0), _number(fields, "SpeedInKnots", 0.0)  # the original's defaults
    if length <= 0.0:
        raise problem(f"expected a LENGTH greater than 0, got {length:g}")
    if speed < 0.0:
        raise problem(f"expected SpeedInKnots of at least 0, got {speed:g}")
    waypoints = [_place("WP", place) for place in fields.get("WP", [])]
    if not 2 <= len(waypoints) <= MAX_WAYPOINTS:
        raise problem(f"needs at least two waypoints (WP=) and at most {MAX_WAYPOINTS}, got {len(waypoints)}")
    ship = {"class": class_of_length(length), "length": length, "speed_kn": speed, "waypoints": waypoints}
    return {**ship, "turn_time": 10.0}  # the thesis's heading filter has one time constant for all ships


class ObstaclesFile(Model):
    """B.2: icebergs and ships, each a text of ``KEY=value`` fields; decimal commas or points."""

    fixed_obstacles: dict[str, Annotated[dict[str, Any], BeforeValidator(_obstacle)]] = Field(default_factory=dict)
    ships: dict[str, Annotated[dict[str, Any], BeforeValidator(_ship)]] = Field(default_factory=dict)


# B.3 names its keys <sensor>_<quantity>_<measure_variance|bias_variance|bias_time_constant>_<unit>
_QUANTITIES = {  # (sensor, quantity, unit of the variance) -> native group and key
    ("AIS", "position", "m2"): ("ais", "position"),
    ("AIS", "COG", "deg2"): ("ais", "cog_deg"),
    ("AIS", "track", "deg2"): ("ais", "heading_deg"),
    ("AIS", "ROT", "deg2_pr_min2"): ("ais", "rot_deg_min"),
    ("AIS", "SOG", "knots2"): ("ais", "sog_kn"),
    ("radar", "position", "m2"): ("radar", "position"),
    ("radar", "radius", "m2"): ("radar", "radius"),
    ("lidar", "position", "m2"): ("lidar", "position"),
    ("lidar", "radius", "m2"): ("lidar", "radius"),
}


def _error_keys(sensor: str, quantity: str, unit: str) -> dict[str, str]:
    return {
        "variance": f"{sensor}_{quantity}_measure_variance_{unit}",
        "bias_variance": f"{sensor}_{quantity}_bias_variance_{unit}",
        "bias_time": f"{sensor}_{quantity}_bias_time_constant_sec",
    }


#: B.3: ranges and error parameters of AIS, radar and LiDAR
SensorsFile: type[Model] = create_model(
    "SensorsFile",
    __base__=Model,
    AIS_range_m=(_Positive, 10_000.0),
    radar_range_m=(Annotated[_Positive, Field(le=max(RADAR_REACH.values()))], ...),
    lidar_range_m=(_Positive, ...),
    TDM_update_rate_Hz=(_Positive, ...),
    error_pr_distance_gain=(_NonNegative, ...),
    **{
        key: (_Positive if what == "bias_time" else _NonNegative, ...)
        for quantity in _QUANTITIES
        for what, key in _error_keys(*quantity).items()
    },  # type: ignore[call-overload]
)


def _add_dynamics(file: DynamicsFile, data: dict[str, Any], sensors: dict[str, Any]) -> None:
    data["origin"] = {"latitude_deg": file.start_latitude, "longitude_deg": file.start_longitude}
    data["simulation"] = {"dt": file.dt}
    data["weather"] = {
        "wind": {"speed": file.wind_speed, "from_deg": file.wind_direction},
        "current": {"speed": file.current_speed, "to_deg": (file.current_direction + 180.0) % 360.0},
        "waves": {"height": file.wave_height, "from_deg": file.wave_direction},
    }
    rates = {
        "gnss": file.gps_frequency,
        "mru": file.mru_frequency,
        "imu": file.imu_frequency,
        "speed_log": file.speed_sensor_frequency,
        "wind": file.wind_sensor_frequency,
    }
    for key, rate in rates.items():
        sensors["navigation"][key]["rate"] = rate


def _add_obstacles(file: ObstaclesFile, data: dict[str, Any], sensors: dict[str, Any]) -> None:
    data["obstacles"], data["ships"] = file.fixed_obstacles, file.ships


def _add_sensors(file: Any, data: dict[str, Any], sensors: dict[str, Any]) -> None:
    sensors["tdm"]["rate"] = file.TDM_update_rate_Hz
    sensors["ais"]["range"] = file.AIS_range_m
    for key in ("radar", "lidar"):
        sensors[key]["range"] = getattr(file, f"{key}_range_m")
        sensors[key]["distance_gain"] = file.error_pr_distance_gain
    if file.radar_range_m <= sensors["radar"]["range_min"]:
        sensors["radar"]["range_min"] = 0.0
    # the fastest rotation that reaches that far
    sensors["radar"]["rpm"] = max(rpm for rpm, reach in RADAR_REACH.items() if reach >= file.radar_range_m)
    for group, key, error in _errors(file):
        sensors[group][key] = error


def _errors(file: Any) -> Iterator[tuple[str, str, dict[str, float]]]:
    for quantity, (group, native) in _QUANTITIES.items():
        yield group, native, {what: getattr(file, key) for what, key in _error_keys(*quantity).items()}


#: kind of file -> its schema, what takes its values over, the native groups that they go to
_KINDS: dict[str, tuple[type[Model], Callable[[Any, dict[str, Any], dict[str, Any]], None], tuple[str, ...]]] = {
    "dynamics": (DynamicsFile, _add_dynamics, ("origin", "simulation", "weather")),
    "obstacles": (ObstaclesFile, _add_obstacles, ("obstacles", "ships")),
    "sensors": (SensorsFile, _add_sensors, ("sensors",)),
}


def kind_of(data: Mapping[str, Any]) -> str | None:
    """Which of the three files this is (``dynamics``, ``obstacles``, ``sensors``), by its keys; None: none of them."""
    ships = data.get("ships")
    texts = isinstance(ships, Mapping) and any(isinstance(ship, str) for ship in ships.values())
    if "schema" in data or not (texts or "ships" not in data):
        return None
    shared = {kind: len(data.keys() & set(model.keys())) for kind, (model, _, _) in _KINDS.items()}
    best = max(shared, key=lambda kind: shared[kind])
    return best if shared[best] > 0 else None


def read_thesis(paths: Sequence[str | Path]) -> Document:
    """Read the thesis's files, given in any order or as one directory, into the data of a native scenario.

    Raises
    ------
    ConfigError
        if a file is none of the three, is there twice, lacks a key, or holds a value that makes no sense.
    """
    directory = Path(paths[0]) if len(paths) == 1 and Path(paths[0]).is_dir() else None
    files = sorted(directory.glob("*.y*ml")) if directory else [Path(path) for path in paths]
    if not files:
        raise ConfigError(f"{directory or 'thesis files'}: expected YAML files of the thesis's format, found none")
    return convert([read_yaml(path) for path in files], name=str(directory or files[0].parent))


def convert(documents: Sequence[Document], name: str = "thesis files") -> Document:
    """The data of a native scenario from the thesis's files.

    Raises
    ------
    ConfigError
        see :func:`read_thesis`.
    """
    found: dict[str, tuple[Document, Any]] = {}
    for document in documents:
        kind = kind_of(document.data)
        if kind is None:
            raise ConfigError(
                f"{document.name}: not one of the thesis's files: expected keys of dynamics (wind_speed, ...), "
                "obstacles (fixed_obstacles, ships) or sensors (radar_range_m, ...)"
            )
        if kind in found:
            raise ConfigError(f"{document.name}: {kind} are given by {found[kind][0].name} already")
        found[kind] = document, validate(_KINDS[kind][0], document)
    data: dict[str, Any] = {"schema": 1, "name": Path(name).name, "own_ship": {"route": [[DEFAULT_ROUTE_LENGTH, 0.0]]}}
    sensors = load_sensors("thesis").dump()
    origins: dict[KeyPath, str] = {}
    for kind, (document, file) in found.items():
        _, add, groups = _KINDS[kind]
        add(file, data, sensors)
        origins |= {(group,): document.name for group in groups}
    return Document(name, {**data, "sensors": sensors}, origins)
