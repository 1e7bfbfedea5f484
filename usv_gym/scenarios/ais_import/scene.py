"""From files of AIS history to a scenario: read, clean, place around an origin, write."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np

from ...config import ConfigError, dump_yaml, locate, suggestion
from ...units import DEG
from ..behaviours import KINDS
from ..loader import load_scenario
from ..schema import MAX_WAYPOINTS, OWN_SHIP, class_of_length
from ..tracks import write_tracks
from .clean import MAX_GAP, TOLERANCE, Floats, Track, at_times, clean, split_where_worst, to_local
from .csv_files import opened, read_csv, read_own
from .fixes import Harvest, Particulars, Progress, Selection, utc
from .nmea_logs import looks_like_nmea, read_nmea

MOST = 256  #: ships that fit into a world beside the own ship
LOG = "log"  #: as own ship: the one that wrote the log (RMC, AIVDO)
_PASSED = 30.0  #: [m] circle of acceptance of the own ship's waypoints


@dataclass
class Request:
    """What to import."""

    files: Sequence[Path]
    area: Selection
    start: float | None = None  #: UTC [s since 1970]; None: the first fix in the area
    duration: float = 1800.0  #: [s]
    own: str = ""  #: MMSI, file of a track, or ``log``; "": none
    vessel: str = "odin"
    name: str = "traffic"
    handover: Mapping[str, float] = field(default_factory=dict)  #: of every ship, as in a scenario
    behaviour: str = ""  #: after a handover
    max_gap: float = MAX_GAP  #: [s]
    tolerance: float = TOLERANCE  #: [m]
    most: int = MOST  #: ships; the ones that come nearest to the centre are kept


@dataclass
class Imported:
    """A scenario made of real traffic, and what there is to say about how it was made."""

    scenario: dict[str, Any]  #: as a file holds it, without the tracks of its ships
    tracks: dict[str, list[list[list[float]]]]  #: by name of the ship, as ``scenarios.tracks`` writes them
    harvest: Harvest
    left_out: int  #: ships that are too many
    single: int  #: ships that reported only once
    spread: tuple[float, float]  #: median and 95th percentile of the distance [m] between fixes and tracks
    fixes: int  #: of the ships of the scenario

    @property
    def knots(self) -> int:
        """Knots of all tracks."""
        return sum(len(part) for parts in self.tracks.values() for part in parts)

    def whole(self) -> dict[str, Any]:
        """The scenario with its tracks in it."""
        ships = {name: {**ship, "track": self.tracks[name]} for name, ship in self.scenario["ships"].items()}
        return {**self.scenario, "ships": ships}


def import_ais(request: Request, progress: Progress | None = None) -> Imported:
    """Make a scenario of the traffic that AIS files tell about.

    Raises
    ------
    ConfigError
        if a file cannot be read, nothing is found, or the own ship is not there at the start; one line.
    """
    if not request.files:
        raise ConfigError("import-ais: expected at least one file")
    if request.behaviour not in ("", *KINDS):
        raise ConfigError(f"--behaviour {request.behaviour}: unknown{suggestion(request.behaviour, KINDS)}")
    locate("vessels", request.vessel)
    start = request.start
    if start is None:
        found = _harvest(request, replace(request.area, start=math.inf, end=math.inf), progress)
        if not math.isfinite(found.first_here):
            raise ConfigError(_nobody(request.area, found))
        start = math.ceil(max(found.first_here, found.first_own if math.isfinite(found.first_own) else 0.0))
    end = start + request.duration
    harvest = _harvest(request, replace(request.area, start=start - request.max_gap, end=end + request.max_gap), progress)
    own = _own_ship(request, harvest, start, end)
    ships, tables = _ships(request, harvest, start, end)
    single = sum(len(fixes) == 1 for fixes in harvest.ships.values())
    if not ships and own is None:
        raise ConfigError(_nobody(replace(request.area, start=start, end=end), harvest, single))
    left_out = 0
    if len(ships) > request.most:
        nearest = sorted(ships, key=lambda name: _nearest(ships[name][1]))[: request.most]
        left_out = len(ships) - len(nearest)
        ships = {name: ship for name, ship in ships.items() if name in set(nearest)}
    off = [d for name, (_, track) in ships.items() for d in [_distances(tables[name], track)] if len(d)]
    spread = np.percentile(np.concatenate(off), (50, 95)).tolist() if off else (0.0, 0.0)
    scenario: dict[str, Any] = {
        "schema": 1,
        "name": request.name,
        "description": f"Real traffic, {request.area}, {utc(start)} and {request.duration:g} s on; "
                       f"AIS from {', '.join(path.name for path in request.files)}",
        "origin": {"latitude_deg": request.area.latitude, "longitude_deg": request.area.longitude},
        "simulation": {"duration": float(request.duration), "epoch": datetime.fromtimestamp(start, UTC).isoformat()},
        "own_ship": own or {"vessel": request.vessel},
        "ships": {name: ship for name, (ship, _) in ships.items()},
    }  # fmt: skip
    tracks = {name: _relative(track, start) for name, (_, track) in ships.items()}
    fixes = sum(len(tables[name]) for name in ships)
    return Imported(scenario, tracks, harvest, left_out, single, (spread[0], spread[1]), fixes)


def file_texts(imported: Imported, path: Path) -> dict[Path, str]:
    """What to write: the tracks, ``NAME.tracks.csv`` beside ``path``, then the scenario itself.

    Raises
    ------
    ConfigError
        if the scenario is none.
    """
    load_scenario(imported.whole())  # what is written can be read
    beside = path.with_name(f"{path.stem}.tracks.csv")
    ships = {name: {**ship, "track": beside.name} for name, ship in imported.scenario["ships"].items()}
    return {beside: write_tracks(imported.tracks), path: dump_yaml({**imported.scenario, "ships": ships})}


# --- reading ---------------------------------------------------------------------------------------------------------
def _harvest(request: Request, selection: Selection, progress: Progress | None) -> Harvest:
    harvest = Harvest(selection)
    if request.own.isdecimal():
        harvest.everywhere = int(request.own)
    for path in request.files:
        with opened(path) as (raw, _):
            nmea = looks_like_nmea(raw.read(200))
        (read_nmea if nmea else read_csv)(path, harvest, progress)
    if request.own and request.own != LOG and not request.own.isdecimal():
        read_own(Path(request.own), harvest)
    return harvest


def _nobody(wanted: Selection, harvest: Harvest, single: int = 0) -> str:
    if not harvest.fixes:
        return f"import-ais: no position reports of ships in {harvest.lines} lines"
    if single:
        return f"import-ais: no tracks within {wanted}: {single} ships reported only once; choose another place or time"
    when = f" between {utc(wanted.start)} and {utc(wanted.end)}" if math.isfinite(wanted.start) else ""
    here = f"; the first there is at {utc(harvest.first_here)}" if when and math.isfinite(harvest.first_here) else ""
    return f"import-ais: no ships within {wanted}{when}{here}; {harvest.extent()}"


# --- ships -----------------------------------------------------------------------------------------------------------
def _ships(
    request: Request, harvest: Harvest, start: float, end: float
) -> tuple[dict[str, tuple[dict[str, Any], Track]], dict[str, Floats]]:
    """Keys of a scenario and track by name, and the fixes [n, 6] of each, for all ships that are seen in the time."""
    ships: dict[str, tuple[dict[str, Any], Track]] = {}
    tables: dict[str, Floats] = {}
    for mmsi in sorted(harvest.ships):
        if request.own == str(mmsi):
            continue
        table = harvest.ships[mmsi].table()
        tracks, _ = clean(table, request.area, max_gap=request.max_gap, tolerance=request.tolerance)
        for number, track in enumerate(t for t in tracks if t.parts[0][0, 0] < end and t.parts[-1][-1, 0] > start):
            about = harvest.particulars.get(mmsi, Particulars())
            name = _name(about.name, mmsi, ships)
            ships[name] = _keys(request, about, mmsi if number == 0 else 0), track
            tables[name] = to_local(table, request.area) if len(tracks) == 1 else np.empty((0, 6))
    return ships, tables


def _name(called: str, mmsi: int, taken: Mapping[str, Any]) -> str:
    """A name without the signs that overrides need, unlike all others."""
    plain = re.sub(r"[^a-z0-9]+", "_", called.lower()).strip("_")
    name = plain if plain and plain != OWN_SHIP else f"mmsi_{mmsi}"
    if name in taken:
        name = f"{name}_{mmsi}"
    while name in taken:
        name += "_b"
    return name


def _keys(request: Request, about: Particulars, mmsi: int) -> dict[str, Any]:
    """A ship as a scenario file holds it."""
    keys: dict[str, Any] = {}
    if about.length:
        keys["class"], keys["length"] = class_of_length(about.length), about.length
        if about.beam:
            keys["beam"] = about.beam
    elif about.ais_class == "B":
        keys["class"] = "boat"
    if about.ais_class:
        keys["ais"] = about.ais_class
    if 201_000_000 <= mmsi <= 775_999_999:
        keys["mmsi"] = mmsi
    if request.handover:
        keys["handover"] = dict(request.handover)
        if request.behaviour:
            keys["behaviour"] = request.behaviour
    return keys


def _relative(track: Track, start: float) -> list[list[list[float]]]:
    """Knots as in a scenario: seconds since the start, metres, degrees, m/s; rounded to what a file keeps."""
    def knot(row: Floats) -> list[float]:
        t, north, east, course, speed, psi = row.tolist()
        return [round(t - start, 3), round(north, 2), round(east, 2), round(course / DEG % 360.0, 2), round(speed, 3),
                round(psi / DEG % 360.0, 2)]  # fmt: skip

    return [[knot(row) for row in part] for part in track.parts]


def _nearest(track: Track) -> float:
    return min(float(np.hypot(part[:, 1], part[:, 2]).min()) for part in track.parts)


def _distances(fixes: Floats, track: Track) -> Floats:
    """How far from the track [m] each fix is that lies in its time."""
    off = np.hypot(*(at_times(track, fixes[:, 0]) - fixes[:, 1:3]).T)
    return np.asarray(off[np.isfinite(off)])


# --- own ship --------------------------------------------------------------------------------------------------------
def _own_ship(request: Request, harvest: Harvest, start: float, end: float) -> dict[str, Any] | None:
    """Initial pose and route of the own ship from a real track; None if none is asked for."""
    if not request.own:
        return None
    fixes = harvest.ships.get(int(request.own)) if request.own.isdecimal() else harvest.own
    what = f"--own {request.own}"
    if not fixes:
        hint = "" if request.own != LOG else " (a log has them as RMC or AIVDO)"
        raise ConfigError(f"{what}: no positions of it between {utc(start)} and {utc(end)}{hint}; {harvest.extent()}")
    tracks, _ = clean(fixes.table(), request.area, max_gap=request.max_gap, tolerance=request.tolerance)
    part = next((p for track in tracks for p in track.parts if p[0, 0] <= start < p[-1, 0]), None)
    if part is None:
        times = fixes.columns[0]
        raise ConfigError(f"{what}: is not there at the start, {utc(start)}; it is seen from {utc(min(times))} "
                          f"to {utc(max(times))}")  # fmt: skip
    t = np.array([start, *part[(part[:, 0] > start) & (part[:, 0] < end), 0], min(end, part[-1, 0])])
    places = at_times(Track((part,)), t)
    own: dict[str, Any] = {
        "vessel": request.vessel,
        "position": np.round(places[0], 2).tolist(),
        "heading_deg": round(_heading(part, start) / DEG % 360.0, 2),
        "speed": round(_speed(part, start), 2),
    }
    route = _route(places)
    if route:
        own["route"], own["acceptance_radius"] = route, _PASSED
    if request.own.isdecimal() and 201_000_000 <= int(request.own) <= 775_999_999:
        own["mmsi"] = int(request.own)
    return own


def _speed(part: Floats, t: float, step: float = 1.0) -> float:
    """Speed [m/s] on a part of a track at a time."""
    a, b = max(t - step, float(part[0, 0])), min(t + step, float(part[-1, 0]))
    (n0, e0), (n1, e1) = at_times(Track((part,)), np.array([a, b]))
    return math.hypot(n1 - n0, e1 - e0) / (b - a)


def _heading(part: Floats, t: float) -> float:
    """Heading [rad] on a part of a track at a time."""
    return float(np.interp(t, part[:, 0], np.unwrap(part[:, 5])))


def _route(places: Floats) -> list[list[float]]:
    """At most as many waypoints as a route holds, that stay as near as can be to a line [n, 2] from the start."""
    def off(a: int, b: int) -> Floats:
        leg, rel = places[b] - places[a], places[a + 1 : b] - places[a]
        length = math.hypot(*leg)
        across = np.abs(leg[0] * rel[:, 1] - leg[1] * rel[:, 0]) / length if length > 1.0 else np.hypot(*rel.T)
        return np.asarray(across / tolerance)

    tolerance = 25.0  # a sailing yacht wanders that much
    while True:
        route: list[Floats] = []
        for place in places[split_where_worst(len(places), off)][1:]:
            if math.hypot(*(place - (route[-1] if route else places[0]))) > 2.0 * _PASSED:
                route.append(place)
        if len(route) < MAX_WAYPOINTS:
            return [np.round(place, 2).tolist() for place in route]
        tolerance *= 1.5
