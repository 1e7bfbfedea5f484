"""The 3-D replay: an episode and its viewer in one HTML file that needs no network.

The episode travels as columns of whole numbers, see ``pack``; ``docs/replay.md`` says what a reader may rely on.  The
viewer is the bundle in ``viewer/viewer.html``, built from ``viewer/`` at the top of the repository.
"""

from __future__ import annotations

import base64
import html
import json
import math
import os
import struct
import zlib
from collections.abc import Mapping
from importlib import resources
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..config import ConfigError
from ..render.palette import STYLES
from ..world.vessel import load_vessel
from .archive import FAULTS, Episode, plain, replacing

VERSION = 1
LIMIT = 1_500_000  #: bytes of a page; of an episode that does not fit, every other sample and report is left out
INTERVAL = 0.2  #: [s] samples are not kept more often
NONE = -(2**31)  #: stands for NaN and infinity
NEAR = 400.0  #: [m] closest approaches beyond are no events
UNDERWAY = 60.0  #: [s] an AIS message arrives within this time, or never
MARKED = 12  #: nor are more than this many of them

#: what one unit of a column is worth (SI and radians); a value is off by half of it at most
QUANTUM = {
    "t": 0.001, "north": 0.01, "east": 0.01, "psi": 0.001, "sog": 0.01, "course": 0.001, "rot": 0.0001,
    "active": 1.0, "distance": 0.1, "seen": 1.0, "thrust_x": 0.01, "thrust_y": 0.01, "faults": 1.0,
    "wind": 0.1, "wind_to": 0.01, "current_north": 0.01, "current_east": 0.01, "wave_height": 0.01, "wave_to": 0.01,
    "source": 1.0, "id": 1.0, "descriptor": 1.0, "sensors": 1.0, "motion_known": 1.0, "cog": 0.01,
    "heading": 0.01, "radius": 0.1, "cov_nn": 0.1, "cov_ne": 0.1, "cov_ee": 0.1,
}  # fmt: skip
_SMOOTH = ("t", "north", "east")  # of samples: second differences are smaller than first ones
_DETECTION = ("source", "t", "id", "descriptor", "sensors", "motion_known", "north", "east", "cog", "sog", "radius",
              "cov_nn", "cov_ne", "cov_ee")  # fmt: skip
_AIS = ("source", "t", "north", "east", "heading", "sog")

Columns = dict[str, NDArray[Any]]


def write_replay(episode: Episode, path: str | os.PathLike[str]) -> int:
    """Write the replay of an episode as one HTML file; it appears whole or not at all.  Returns its size in bytes.

    Raises
    ------
    OSError
        if the file cannot be written.
    """
    typical = float(np.median(np.diff(episode.t))) if len(episode.t) > 1 else INTERVAL
    stride = max(1, round(INTERVAL / typical))
    thin = 1
    while True:
        text = page(base64.b64encode(pack(episode, stride=stride * thin, thin=thin)).decode(), title(episode.meta))
        data = text.encode()
        if len(data) <= LIMIT or thin >= 64:
            break
        thin *= 2
    with replacing(path) as file:
        file.write(data)
    return len(data)


def page(data: str, name: str, live: str = "") -> str:
    """The viewer's page around packed data (base64), or around nothing when it is ``live`` and fed by a server."""
    template = resources.files(__package__).joinpath("viewer/viewer.html").read_text("utf-8")
    for key, value in {"TITLE": html.escape(name), "LIVE": html.escape(live), "DATA": data}.items():
        template = template.replace(f"@@{key}@@", value, 1)
    return template


def title(meta: Mapping[str, Any]) -> str:
    """Scenario, policy and seed."""
    scenario = meta.get("scenario")
    name = scenario.get("name") if isinstance(scenario, Mapping) else scenario
    seed = meta.get("seed")
    return " · ".join(str(x) for x in (name, meta.get("policy"), "" if seed is None else f"seed {seed}") if x)


def pack(episode: Episode, *, since: float = -math.inf, stride: int = 1, thin: int = 1) -> bytes:
    """An episode, or what is new in one, as the viewer reads it.

    zlib of: length of the header (u32, little endian); header (JSON); the columns it lists as ``[name, rows, count,
    quantum, order]``, one after the other.  A column holds whole multiples of its quantum, row after row, as
    ``order``-fold differences, zigzag-coded (0, -1, 1, -2 ..) in little-endian groups of 7 bits.

    Parameters
    ----------
    episode
        what to pack.
    since
        only what is later than this time [s].
    stride
        every so manieth sample is kept, the last one always.
    thin
        every so manieth report of the TDM is kept.
    """
    tables = {"": _samples(episode, since, stride), "d_": _detections(episode, since, thin),
              "a_": _reports(episode, since)}  # fmt: skip
    index: list[list[Any]] = []
    streams: list[bytes] = []
    for prefix, columns in tables.items():
        for name, values in columns.items():
            rows, count = values.shape if values.ndim == 2 else (1, len(values))
            order = 2 if not prefix and name in _SMOOTH else 1
            index.append([prefix + name, rows, count, QUANTUM[name], order])
            streams.append(_encode(values.ravel(), QUANTUM[name], order))
    head = {**_header(episode), "columns": index}
    if since == -math.inf:  # what never changes is sent once: rings of north, east, north, .. [m], a polygon's shell first
        head["land"] = plain([[np.round(np.ravel(ring), 1) for ring in rings] for rings in episode.meta.get("land") or ()])
    header = json.dumps(head, separators=(",", ":"), allow_nan=False).encode()
    return zlib.compress(struct.pack("<I", len(header)) + header + b"".join(streams), 9)


def unpack(data: bytes) -> tuple[dict[str, Any], Columns]:
    """The header and the columns ``[rows, count]`` of what ``pack`` made; NaN for values that are not there."""
    raw = zlib.decompress(data)
    (length,) = struct.unpack_from("<I", raw)
    header = json.loads(raw[4 : 4 + length])
    stream = np.frombuffer(raw, np.uint8, offset=4 + length).astype(np.int64)
    ends = np.flatnonzero(stream < 128)
    starts = np.concatenate([[0], ends[:-1] + 1])[: len(ends)]
    within = np.arange(len(stream)) - np.repeat(starts, ends - starts + 1)
    coded = np.add.reduceat((stream & 127) << (7 * within), starts) if len(starts) else stream
    whole = (coded >> 1) ^ -(coded & 1)
    columns, at = {}, 0
    for name, rows, count, quantum, order in header["columns"]:
        values = whole[at : at + rows * count]
        at += rows * count
        for _ in range(order):
            values = np.cumsum(values)
        columns[name] = np.where(values == NONE, np.nan, values * quantum).reshape(rows, count)
    return header, columns


def _encode(values: NDArray[Any], quantum: float, order: int) -> bytes:
    values = values.astype(np.float64)
    whole = np.full(values.shape, NONE, np.int64)
    known = np.isfinite(values)
    whole[known] = np.rint(values[known] / quantum).astype(np.int64)
    for _ in range(order):
        whole = np.diff(whole, prepend=0)
    coded = (whole << 1) ^ (whole >> 63)
    groups = np.arange(10) * 7
    digits = coded[:, None] >> groups & 127
    length = 1 + (coded[:, None] >> groups[1:] > 0).sum(axis=1)
    digits[np.arange(10) < length[:, None] - 1] |= 128
    data: bytes = digits[np.arange(10) < length[:, None]].astype(np.uint8).tobytes()
    return data


def _samples(episode: Episode, since: float, stride: int) -> Columns:
    """Poses of everything at the time of the sample, and what else changes; ``[rows, T]``."""
    at = np.flatnonzero(episode.t > since)
    at = np.unique(np.append(at[::stride], at[-1:]))
    t = episode.t[at]
    place = np.array([episode.position(s, t) for s in range(episode.sources)])  # [S, T, 2]
    psi, nu = episode.eta[at, :, 2].T, episode.nu[at].T  # [V, T], [3, V, T]
    for j in np.flatnonzero(np.asarray(episode.meta["models"]) == 0):
        psi[j] = np.interp(t, episode.traffic_t, episode.eta[:, j, 2])
    speed = np.hypot(nu[0], nu[1])
    force = _thrust(episode, at)
    weather = episode.weather[at].T
    columns = {
        "t": t, "north": place[:, :, 0], "east": place[:, :, 1], "psi": psi, "sog": speed,
        "course": psi + np.where(speed > 0.05, np.arctan2(nu[1], nu[0]), 0.0), "rot": nu[2],
        "active": episode.active[at].T, "distance": episode.distance[at].T,
        "seen": (episode.visible[at] * np.array([1, 2])[:, None]).sum(axis=1).T,
        "thrust_x": force.real, "thrust_y": force.imag,
        "faults": (episode.faults[at] << np.arange(len(FAULTS))).sum(axis=1),
    }  # fmt: skip
    names = ("wind", "wind_to", "current_north", "current_east", "wave_height", "wave_to")
    columns.update(zip(names, weather, strict=True))
    return columns


def _detections(episode: Episode, since: float, thin: int) -> Columns:
    table = episode.detections
    table = table[(table["t"] > since) & (table["source"] < episode.sources)]
    if thin > 1:
        times = np.unique(table["t"])[::thin]
        table = table[np.isin(table["t"], times)]
    table = table[np.lexsort((table["t"], table["source"]))]
    return {name: table[name] for name in _DETECTION}


def _reports(episode: Episode, since: float) -> Columns:
    """AIS messages that got through, and once more those that may have been on their way ``since``."""
    table = episode.ais[episode.ais["received"] & (episode.ais["t"] > since - UNDERWAY)]
    table = table[np.lexsort((table["t"], table["source"]))]
    columns = {name: table[name] for name in _AIS}
    columns["heading"] = np.where(np.isfinite(table["heading"]), table["heading"], table["cog"])
    return columns


def _thrusters(meta: Mapping[str, Any]) -> list[Any]:
    """Thrusters of the own ship; none when its vessel file is not known here."""
    scenario = meta.get("scenario")
    own = scenario.get("own_ship", {}) if isinstance(scenario, Mapping) else {}
    for name in (own.get("vessel"), meta.get("vessel")):
        if isinstance(name, str) and name:
            try:
                return list(load_vessel(name).thrusters)
            except (ConfigError, OSError):
                continue
    return []


def _thrust(episode: Episode, at: NDArray[Any]) -> NDArray[np.complex128]:
    """Force of each thruster on the hull {b}, as a share of its largest: [thrusters, T], forward + i starboard."""
    forces = []
    for k, thruster in enumerate(_thrusters(episode.meta)):
        rpm, nozzle, bucket = episode.actuator[at, k].astype(np.float64).T
        share = rpm * np.abs(rpm) / thruster.rpm_max**2 * (bucket if thruster.bucket else 1.0)
        forces.append(share * np.exp(1j * (math.radians(thruster.direction_deg) + nozzle)))
    return np.array(forces).reshape(-1, len(at))


def _side(thruster: Any) -> str:
    if abs(math.sin(math.radians(thruster.direction_deg))) > 0.5:
        return "bow"
    return "port" if thruster.y_m < 0 else "starboard" if thruster.y_m > 0 else "centre"


def _header(episode: Episode) -> dict[str, Any]:
    """What does not change with time."""
    meta = episode.meta
    own, sensors = episode.own, meta.get("sensors", {})
    routes, radii = meta.get("waypoints") or [], meta.get("acceptance_radius") or []
    ranges = {
        k: sensors.get(k, {}).get("range") or 0 if sensors.get(k, {}).get("on") else 0 for k in ("radar", "lidar")
    }
    header: dict[str, Any] = plain({
        "format": "usv-replay", "version": VERSION, "title": title(meta), "own": own, "vessels": episode.vessels,
        "sources": episode.sources, "names": [episode.name(s) for s in range(episode.sources)],
        "kinds": meta["kinds"], "mmsi": meta["mmsi"], "ais_class": meta["ais_class"],
        "length": episode.length, "beam": episode.beam, "radius": episode.radius,
        "route": routes[own] if own < len(routes) else [], "acceptance": radii[own] if own < len(radii) else 0,
        **ranges, "tdm_period": sensors.get("tdm", {}).get("period") or 1.0,
        "thrusters": [[t.x_m, t.y_m, _side(t)] for t in _thrusters(meta)],
        "outcome": (meta.get("outcome") or {}).get("outcome") or "", "origin": meta["origin"],
        "metres_per_degree": meta["metres_per_degree"], "epoch_us": meta.get("epoch_us"),
        "events": _events(episode), "colours": {role: style.colours[0] for role, style in STYLES.items()},
    })  # fmt: skip
    return header


def _events(episode: Episode) -> list[dict[str, Any]]:
    """What was noticed, faults that began or ended, and closest approaches; in order of time."""
    events = [
        {"t": e["t"], "kind": e["kind"], "id": e.get("id", -1), "text": e.get("text", "")} for e in episode.events
    ]
    told = {e["kind"] for e in events}
    for k, fault in enumerate(FAULTS):
        if fault in told:
            continue
        state = episode.faults[:, k].astype(int)
        for i in np.flatnonzero(np.diff(state, prepend=0)):
            events.append({"t": episode.t[i], "kind": fault, "id": -1, "text": "begins" if state[i] else "ends"})
    d = np.where(episode.active & np.isfinite(episode.distance), episode.distance, np.inf)
    d[:, episode.own] = np.inf
    first, nearest = d.argmin(axis=0), d.min(axis=0)
    for s in np.argsort(nearest, kind="stable")[:MARKED]:
        if 0 < nearest[s] < NEAR and 0 < first[s] < len(d) - 1:
            events.append({"t": episode.t[first[s]], "kind": "cpa", "id": int(s), "text": f"{nearest[s]:.0f} m"})
    return sorted(events, key=lambda e: float(e["t"]))
