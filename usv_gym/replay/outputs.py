"""What a run leaves behind for people and other programs: ``ais.nmea``, ``detections.csv``, ``summary.json``.

All of it is made from an ``Episode``, so it can be made again from ``episode.usv`` at any time.  docs/outputs.md has
the column tables.
"""

from __future__ import annotations

import csv
import dataclasses
import datetime
import io
import json
import os
from typing import TYPE_CHECKING, Any

import numpy as np

from ..metrics.errors import (
    SLOW,
    Statistic,
    ais_errors,
    angle_difference,
    closest,
    hidden_intervals,
    statistic,
    tdm_errors,
)
from ..sensors.sentences import STATIC_INTERVAL, Station, encode, geodetic, position_report, static_reports, tag
from ..units import DEG, DEG_PER_MIN, KNOT
from ..world.state import EVENTS
from .archive import Array, Episode, Floats, plain, replacing

if TYPE_CHECKING:
    from rich.console import Console

Path = str | os.PathLike[str]

_SENSORS = ("AIS", "radar", "LiDAR")  # bits of a detection's sensors
_DESCRIPTORS = ("fixed", "vessel", "land")
#: fields of an AIS report with the unit a person reads, and radians or metres per second in it
_AIS_UNITS = {
    "north": ("m", 1.0), "east": ("m", 1.0), "cog": ("deg", DEG), "heading": ("deg", DEG), "sog": ("kn", KNOT),
    "rot": ("deg_per_min", DEG_PER_MIN),
}  # fmt: skip


# --- ais.nmea --------------------------------------------------------------------------------------------------------
def station(episode: Episode, source: int) -> Station:
    """The AIS transmitter of a source."""
    V, meta = episode.vessels, episode.meta
    side = 0.0 if source < V else 2.0 * float(episode.radius[source - V])
    return Station(
        mmsi=meta["mmsi"][source],
        ais_class=meta["ais_class"][source],
        kind=meta["kinds"][source],
        name=episode.name(source),
        length=float(episode.length[source]) if source < V else side,
        beam=float(episode.beam[source]) if source < V else side,
    )


def write_nmea(episode: Episode, path: Path) -> None:
    """Write every AIS message that was sent, in time order: one sentence per line behind a TAG block with its UTC.

    Ships send their static messages after their first position report, and every six minutes from then on.
    """
    origin, scale = episode.meta["origin"], episode.meta["metres_per_degree"]
    latitude, longitude = geodetic(episode.ais["north"], episode.ais["east"], origin, scale)
    stations = {int(source): station(episode, int(source)) for source in np.unique(episode.ais["source"])}
    static_due = dict.fromkeys(stations, -np.inf)
    group = 0
    with replacing(path) as file:
        for i, report in enumerate(episode.ais):
            source, t = int(report["source"]), float(report["t"])
            utc_us = episode.meta["epoch_us"] + round(t * 1e6)
            motion = {name: float(report[name]) for name in ("cog", "heading", "sog", "rot")}
            spoken = dataclasses.replace(stations[source], mmsi=int(report["mmsi"]))  # a spoofed station may lie about it
            messages = [
                position_report(spoken, float(latitude[i]), float(longitude[i]), **motion, utc_us=utc_us)
            ]
            if t >= static_due[source]:
                static_due[source] = t + STATIC_INTERVAL
                messages += static_reports(stations[source])
            channel = "AB"[int(report["sequence"]) % 2]  # transponders alternate
            for message in messages:
                sentences = encode(message, own=source == episode.own, channel=channel, sequence=group)
                group += len(sentences) > 1
                file.writelines(f"{line}\n".encode("ascii") for line in tag(sentences, utc_us, group))


# --- detections.csv --------------------------------------------------------------------------------------------------
def write_detections(episode: Episode, path: Path) -> None:
    """Write what the TDM reported, one line per target and report; an empty cell is "not known"."""
    d, meta = episode.detections, episode.meta
    latitude, longitude = geodetic(d["north"], d["east"], meta["origin"], meta["metres_per_degree"])
    columns: dict[str, list[str]] = {
        "t_s": _numbers(d["t"], 3),
        "utc": [_utc(meta["epoch_us"] + round(t * 1e6)) for t in d["t"].tolist()],
        "id": _numbers(d["id"], 0),
        "source": _numbers(d["source"], 0),
        "name": [episode.name(source) for source in d["source"].tolist()],
        "descriptor": [_DESCRIPTORS[code] for code in d["descriptor"].tolist()],
        "sensors": ["+".join(n for k, n in enumerate(_SENSORS) if bits >> k & 1) for bits in d["sensors"].tolist()],
        "motion_known": _numbers(d["motion_known"], 0),
        "latitude_deg": _numbers(latitude, 7),
        "longitude_deg": _numbers(longitude, 7),
        "north_m": _numbers(d["north"], 2),
        "east_m": _numbers(d["east"], 2),
        "cog_deg": _numbers(np.mod(d["cog"] / DEG, 360.0), 2),
        "sog_kn": _numbers(d["sog"] / KNOT, 2),
        "rot_deg_per_min": _numbers(d["rot"] / DEG_PER_MIN, 2),
        "radius_m": _numbers(d["radius"], 2),
        "cov_nn_m2": _numbers(d["cov_nn"], 4),
        "cov_ne_m2": _numbers(d["cov_ne"], 4),
        "cov_ee_m2": _numbers(d["cov_ee"], 4),
        "var_cog_deg2": _numbers(d["var_cog"] / DEG**2, 4),
        "var_sog_kn2": _numbers(d["var_sog"] / KNOT**2, 4),
        "var_radius_m2": _numbers(d["var_radius"], 4),
    }
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(columns)
    writer.writerows(zip(*columns.values(), strict=True))
    with replacing(path) as file:
        file.write(text.getvalue().encode())


def _numbers(values: Array, decimals: int) -> list[str]:
    return [f"{x:.{decimals}f}" if np.isfinite(x) else "" for x in values.tolist()]


def _utc(microseconds: int) -> str:
    moment = datetime.datetime.fromtimestamp(microseconds // 1_000_000, datetime.UTC)
    return f"{moment:%Y-%m-%dT%H:%M:%S}.{microseconds % 1_000_000 // 1000:03d}Z"


# --- summary.json ----------------------------------------------------------------------------------------------------
def summary(episode: Episode, wall_time_s: float | None = None) -> dict[str, Any]:
    """The numbers of an episode that a person asks for, each with its unit in its key; None for what is not known.

    ``wall_time_s`` is how long the run took, when it is to be told.
    """
    t, own, meta = episode.t, episode.own, episode.meta
    duration = float(t[-1] - t[0])
    steps = np.diff(episode.eta[:, own, :2], axis=0)
    speed = np.hypot(*episode.velocity(own).T)
    ticks = round(duration * 1e6 / meta["dt_us"])
    run: dict[str, Any] = {"start_utc": _utc(meta["epoch_us"]), "duration_s": duration, "ticks_count": ticks}
    if wall_time_s:
        run |= {"wall_time_s": wall_time_s, "real_time_factor_ratio": duration / wall_time_s}
    result = {
        "scenario": _scenario_name(meta.get("scenario")),
        "policy": meta.get("policy"), "vessel": meta.get("vessel"), "seed": meta.get("seed"),
        "run": run,
        "own_ship": {
            "name": episode.name(own),
            "distance_sailed_m": np.hypot(steps[:, 0], steps[:, 1]).sum(),
            "speed_mean_kn": speed.mean() / KNOT, "speed_max_kn": speed.max() / KNOT,
        },
        "outcome": meta.get("outcome"),
        "collisions": [
            {"t_s": event["t"], "source": event["id"], "name": episode.name(event["id"])}
            for event in episode.events if event["kind"] == "collision"
        ],
        "events": _events(episode),
        "objects": _objects(episode),
        "tdm": _tdm(episode),
        "ais": _ais(episode),
    }  # fmt: skip
    clean: dict[str, Any] = plain(result)
    return clean


def write_summary(result: dict[str, Any], path: Path) -> None:
    """Write a summary as JSON."""
    with replacing(path) as file:
        file.write(json.dumps(plain(result), indent=2, allow_nan=False).encode() + b"\n")


def _scenario_name(scenario: Any) -> Any:
    return scenario.get("name") if isinstance(scenario, dict) else scenario


def _events(episode: Episode) -> list[dict[str, Any]]:
    """Events of the scenario: what, about whom, from when to when (None: to the end)."""
    found: list[dict[str, Any]] = []
    for event in episode.events:
        if event["kind"] not in EVENTS:
            continue
        name = episode.name(event["id"]) if event["id"] >= 0 else None
        if event["text"] == "begins":
            found.append({"event": event["kind"], "name": name, "from_s": event["t"], "to_s": None})
            continue
        for begun in found:
            if (begun["event"], begun["name"], begun["to_s"]) == (event["kind"], name, None):
                begun["to_s"] = event["t"]
                break
    return found


def _objects(episode: Episode) -> list[dict[str, Any]]:
    """Closest approach, times in the shadow of others, and AIS traffic of every object."""
    t, own = episode.t, episode.own
    smallest, when = closest(t, episode.distance, episode.active)
    here = episode.position(own)
    objects = []
    for source in range(episode.sources):
        if source == own or not episode.active[:, source].any():
            continue
        apart = np.hypot(*(episode.position(source) - here).T)
        messages = episode.ais[episode.ais["source"] == source]
        entry: dict[str, Any] = {
            "source": source, "name": episode.name(source),
            "closest_m": smallest[source], "closest_at_s": when[source],
        }  # fmt: skip
        for k, name in enumerate(("radar", "lidar")):
            sensor = episode.meta["sensors"][name]
            if not sensor["on"]:
                continue
            in_range = episode.active[:, source] & (apart <= sensor["range"]) & ~episode.faults[:, k]
            # a scan is up to one period old, so shorter intervals are only late news
            spans = hidden_intervals(t, in_range, episode.visible[:, k, source], 1.5 * sensor["period"])
            entry[f"hidden_from_{name}"] = [{"from_s": start, "to_s": end} for start, end in spans]
        entry["ais_sent_count"] = len(messages)
        entry["ais_received_count"] = int(messages["received"].sum())
        objects.append(entry)
    return objects


def _tdm(episode: Episode) -> dict[str, Any]:
    """Errors of the detected targets against the truth at the time of the report; false targets have none."""
    d, own = episode.detections, episode.own
    land_count = int((d["source"] >= episode.sources).sum())
    d = d[d["source"] < episode.sources]  # of a stretch of coast nobody can say which point should have been reported
    sample = np.clip(np.searchsorted(episode.t, d["t"], side="right") - 1, 0, len(episode.t) - 1)
    there = episode.active[sample, d["source"]]
    ever = np.asarray(episode.active.any(axis=0))
    false_count = int((~ever[d["source"]]).sum())
    d = d[there]
    truth, velocity, radius = np.zeros((len(d), 2)), np.zeros((len(d), 2)), np.zeros(len(d))
    for source in np.unique(d["source"]).tolist():
        rows = d["source"] == source
        truth[rows] = episode.position(source, d["t"][rows])
        velocity[rows] = episode.velocity(source, d["t"][rows])
        radius[rows] = episode.radius_of(source)
    reported = np.stack([d["north"], d["east"]], axis=1)
    apart = np.hypot(*(truth - episode.position(own, d["t"])).T)
    sog = np.hypot(*velocity.T)
    moving = d["motion_known"] & (sog >= SLOW)
    cog_error = angle_difference(d["cog"], np.arctan2(velocity[:, 1], velocity[:, 0]))[moving]
    return {
        "reports_count": len(np.unique(episode.detections["t"])),
        "detections_count": len(episode.detections), "land_detections_count": land_count,
        "false_detections_count": false_count,
        "position_error_by_range": [
            {
                "range_from_m": b.from_m, "range_to_m": b.to_m, "count": b.count, "rms_m": b.rms,
                "bias_north_m": b.bias_north, "bias_east_m": b.bias_east,
            }
            for b in tdm_errors(reported, truth, apart)
        ],
        "radius_error": _with_unit(statistic(d["radius"] - radius), "m"),
        "course_error": _with_unit(statistic(cog_error / DEG), "deg"),
        "speed_error": _with_unit(statistic((d["sog"] - sog)[d["motion_known"]] / KNOT), "kn"),
    }  # fmt: skip


def _ais(episode: Episode) -> dict[str, Any]:
    """Errors of what others transmitted, next to what the sensor configuration asks for."""
    reports = episode.ais[episode.ais["source"] != episode.own]
    sensor = episode.meta["sensors"]["ais"]
    design = np.hypot(_floats(sensor["noise"]), _floats(sensor["bias"]))  # of E = b + v, thesis 2.1
    fields = {}
    for k, (name, error) in enumerate(ais_errors(reports).items()):
        unit, size = _AIS_UNITS[name]
        scaled = Statistic(error.count, error.mean / size, error.std / size, error.rms / size)
        variance = {f"design_std_{unit}": design[k] / size, f"design_variance_{unit}2": (design[k] / size) ** 2}
        fields[name] = {**_with_unit(scaled, unit), f"variance_{unit}2": scaled.std**2, **variance}
    return {"messages_count": len(reports), "errors": fields}


def _floats(values: Any) -> Floats:
    return np.asarray(values, float)


def _with_unit(error: Statistic, unit: str) -> dict[str, Any]:
    return {
        "count": error.count, f"bias_{unit}": error.mean, f"std_{unit}": error.std, f"rms_{unit}": error.rms,
    }  # fmt: skip


def print_summary(result: dict[str, Any], console: Console | None = None) -> None:
    """Print a summary as tables."""
    import rich.box
    from rich.console import Console
    from rich.markup import escape
    from rich.table import Table

    out = console or Console()

    def table(title: str, *columns: str) -> Table:
        made = Table(title=title, title_justify="left", box=rich.box.SIMPLE_HEAD)
        for k, column in enumerate(columns):
            made.add_column(escape(column), justify="right" if k else "left")
        return made

    run, ship = result["run"], result["own_ship"]
    facts = table("Run", "", "")
    for label in ("scenario", "vessel", "policy", "seed"):
        if result[label] not in (None, ""):
            facts.add_row(label, escape(str(result[label])))
    facts.add_row("duration", f"{_text(run['duration_s'], 1)} s, {run['ticks_count']} ticks")
    if "wall_time_s" in run:
        factor = _text(run["real_time_factor_ratio"], 1)
        facts.add_row("computed in", f"{_text(run['wall_time_s'], 2)} s, {factor} times real time")
    facts.add_row("distance sailed", f"{_text(ship['distance_sailed_m'], 0)} m")
    facts.add_row("speed, mean and max", f"{_text(ship['speed_mean_kn'], 1)}, {_text(ship['speed_max_kn'], 1)} kn")
    hits = ", ".join(f"{hit['name']} at {_text(hit['t_s'], 1)} s" for hit in result["collisions"])
    facts.add_row("collisions", escape(hits or "none"))
    out.print(facts)

    if result["events"]:
        events = table("Events", "event", "of", "from [s]", "to [s]")
        for item in result["events"]:
            events.add_row(item["event"].replace("_", " "), escape(item["name"] or "-"), _text(item["from_s"], 1),
                           _text(item["to_s"], 1))  # fmt: skip
        out.print(events)

    if result["objects"]:
        objects = table("Objects", "name", "closest [m]", "at [s]", "hidden from radar [s]", "AIS sent", "received")
        for item in result["objects"]:
            spans = [f"{_text(s['from_s'], 0)}-{_text(s['to_s'], 0)}" for s in item.get("hidden_from_radar", [])]
            objects.add_row(
                escape(item["name"]), _text(item["closest_m"], 1), _text(item["closest_at_s"], 1),
                ", ".join(spans) or "-", str(item["ais_sent_count"]), str(item["ais_received_count"]),
            )  # fmt: skip
        out.print(objects)

    if result["tdm"]["detections_count"]:
        errors = table("TDM position error", "range [m]", "detections", "RMS [m]", "bias N [m]", "bias E [m]")
        for b in result["tdm"]["position_error_by_range"]:
            errors.add_row(
                f"{_text(b['range_from_m'], 0)}-{_text(b['range_to_m'], 0)}", str(b["count"]),
                _text(b["rms_m"], 2), _text(b["bias_north_m"], 2), _text(b["bias_east_m"], 2),
            )  # fmt: skip
        out.print(errors)
        other = table("TDM other errors", "", "count", "bias", "std", "RMS")
        for name, unit in (("radius", "m"), ("course", "deg"), ("speed", "kn")):
            e = result["tdm"][f"{name}_error"]
            values = (_text(e[f"{key}_{unit}"], 2) for key in ("bias", "std", "rms"))
            other.add_row(escape(f"{name} [{unit}]"), str(e["count"]), *values)
        out.print(other)

    if result["ais"]["messages_count"]:
        sent = table("AIS errors", "", "count", "bias", "std", "std asked for")
        for name, e in result["ais"]["errors"].items():
            unit = _AIS_UNITS[name][0]
            values = (_text(e[f"{key}_{unit}"], 2) for key in ("bias", "std", "design_std"))
            sent.add_row(escape(f"{name} [{unit.replace('_per_', '/')}]"), str(e["count"]), *values)
        out.print(sent)


def _text(value: float | None, decimals: int) -> str:
    return "-" if value is None else f"{value:.{decimals}f}"
