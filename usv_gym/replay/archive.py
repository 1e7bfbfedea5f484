"""The episode archive ``episode.usv``: everything that is needed to redraw and to re-judge one episode.

A zip of ``meta.json``, ``events.json`` and one ``.npy`` member per array, in that order.  ``docs/archive.md`` is the
format; ``Episode`` is the same thing in memory.  No pickle, so an archive from a stranger is data and nothing else.
Equal episodes give equal bytes.
"""

from __future__ import annotations

import contextlib
import functools
import io
import json
import math
import os
import zipfile
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
import numpy.typing as npt

from ..world.state import MODEL_3DOF, A
from ..world.state import T as T_LAND  # stretches of coast: here T is the number of samples

FORMAT = "usv-episode"
VERSION = 1

Array = npt.NDArray[Any]
Floats = npt.NDArray[np.float64]
Dtype = np.dtype[Any]

#: columns of ``Episode.nav``: own navigation as measured; SI and radians, positions {n}, forces and water speeds {b}
NAV = (
    "gnss_stamp_us", "north", "east", "heading", "course", "sog", "mru_heading", "yaw_rate",
    "specific_force_x", "specific_force_y", "imu_yaw_rate", "water_speed_x", "water_speed_y",
    "wind_speed", "wind_angle",
)  # fmt: skip
#: columns of ``Episode.weather``: as realised; m/s, rad (blowing, travelling *towards*), m
WEATHER = ("wind_u10", "wind_to", "current_north", "current_east", "wave_height", "wave_to")
#: columns of ``Episode.faults``
FAULTS = ("radar_outage", "lidar_outage", "ais_jammed", "gnss_frozen")

DETECTION: Dtype = np.dtype([
    ("t", "<f8"), ("id", "<i4"), ("source", "<i4"), ("descriptor", "i1"), ("sensors", "i1"), ("motion_known", "?"),
    ("north", "<f8"), ("east", "<f8"), ("cog", "<f8"), ("sog", "<f8"), ("rot", "<f8"), ("radius", "<f8"),
    ("cov_nn", "<f8"), ("cov_ne", "<f8"), ("cov_ee", "<f8"),
    ("var_cog", "<f8"), ("var_sog", "<f8"), ("var_radius", "<f8"),
])  # fmt: skip
AIS_REPORT: Dtype = np.dtype([
    ("t", "<f8"), ("source", "<i4"), ("mmsi", "<i8"), ("ais_class", "i1"), ("sequence", "<i4"), ("received", "?"),
    ("north", "<f8"), ("east", "<f8"), ("cog", "<f8"), ("heading", "<f8"), ("sog", "<f8"), ("rot", "<f8"),
    ("north_true", "<f8"), ("east_true", "<f8"), ("cog_true", "<f8"), ("heading_true", "<f8"), ("sog_true", "<f8"),
    ("rot_true", "<f8"),
])  # fmt: skip


@functools.cache
def sample_dtype(V: int, M: int) -> Dtype:
    """One sample of a world of V vessel and M obstacle slots; its fields are the ``[T, ..]`` arrays of ``Episode``."""
    S = V + M
    return np.dtype([
        ("t", "<f8"), ("traffic_t", "<f8"),
        ("eta", "<f8", (V, 3)), ("nu", "<f8", (V, 3)),
        ("active", "?", (S,)),
        ("obstacle", "<f8", (M, 2)),
        ("nav", "<f8", (len(NAV),)),
        ("command", "<f8", (A, 3)), ("actuator", "<f4", (A, 3)),
        ("weather", "<f8", (len(WEATHER),)),
        ("distance", "<f4", (S,)),
        ("visible", "?", (2, S)),
        ("faults", "?", (len(FAULTS),)),
    ])  # fmt: skip


class ArchiveError(ValueError):
    """A file that is no episode archive, a broken one, or one of a newer format."""


@dataclass(frozen=True, eq=False)
class Episode:
    """One recorded episode.  T samples, V vessel slots, M obstacle slots, S = V + M sources, A thrusters.

    SI and radians, {n} north-east at ``meta["origin"]``.  A source is vessel slot j or V + m for obstacle m.
    """

    meta: dict[str, Any]  # docs/archive.md
    events: list[dict[str, Any]]  # t [s], kind, id (source, -1 for none), text
    t: Floats  # [T] s since the start of the episode
    traffic_t: Floats  # [T] s to which kinematic ships and obstacles refer: traffic moves in frames, lazily
    eta: Floats  # [T, V, 3] N, E [m], psi [rad] {n}
    nu: Floats  # [T, V, 3] u, v [m/s], r [rad/s] {b}, over ground
    active: npt.NDArray[np.bool_]  # [T, S]
    obstacle: Floats  # [T, M, 2] N, E [m] {n}
    nav: Floats  # [T, len(NAV)] own navigation as measured
    command: Floats  # [T, A, 3] demanded rpm, nozzle, bucket in [-1, 1]; NaN for a kinematic own ship
    actuator: npt.NDArray[np.float32]  # [T, A, 3] rpm, nozzle [rad], bucket [-1, 1]; NaN for a kinematic own ship
    weather: Floats  # [T, len(WEATHER)]
    distance: npt.NDArray[np.float32]  # [T, S] hull of the own ship to hull [m]
    visible: npt.NDArray[np.bool_]  # [T, 2, S] line of sight of radar and LiDAR at their last scans
    faults: npt.NDArray[np.bool_]  # [T, len(FAULTS)]
    radius: Floats  # [M] m
    length: Floats  # [V] m
    beam: Floats  # [V] m
    detections: Array  # [n] of DETECTION, by time
    ais: Array  # [n] of AIS_REPORT, by time
    actions: Array  # [steps, ..] as given to the environment; [0] when unknown

    @property
    def vessels(self) -> int:
        """V, the number of vessel slots; obstacle m is source V + m."""
        return int(self.eta.shape[1])

    @property
    def sources(self) -> int:
        """S, the number of sources."""
        return int(self.active.shape[1])

    @property
    def own(self) -> int:
        """Vessel slot of the own ship."""
        return int(self.meta["own"])

    def name(self, source: int) -> str:
        """Name of a source; ``source <n>`` where the scenario gave none, ``land <n>`` for a stretch of coast."""
        if source >= self.sources:
            return f"land {source - self.sources + 1}"
        names = self.meta.get("names", [])
        return str(names[source]) if 0 <= source < len(names) and names[source] else f"source {source}"

    def position(self, source: int, t: npt.ArrayLike | None = None) -> Floats:
        """True N, E [n, 2] of a source at times t [n] (of every sample when None), interpolated between samples."""
        V = self.vessels
        track = self.eta[:, source, :2] if source < V else self.obstacle[:, source - V]
        return self._at(t, source, track)

    def velocity(self, source: int, t: npt.ArrayLike | None = None) -> Floats:
        """True velocity N, E [n, 2] over ground of a source at times t [n] (of every sample when None)."""
        V = self.vessels
        if source < V:
            psi, u, v = self.eta[:, source, 2], self.nu[:, source, 0], self.nu[:, source, 1]
            track = np.stack([u * np.cos(psi) - v * np.sin(psi), u * np.sin(psi) + v * np.cos(psi)], axis=1)
        else:
            moves = np.flatnonzero(np.diff(self.traffic_t, prepend=-np.inf))  # a frame that stands still has no slope
            at, known = self.traffic_t[moves], self.obstacle[moves, source - V]
            slope = np.gradient(known, at, axis=0) if len(at) > 1 else np.zeros_like(known)
            track = slope[np.searchsorted(at, self.traffic_t)]
        return self._at(t, source, track)

    def radius_of(self, source: int) -> float:
        """What a sensor takes for the radius of a source [m]: of a ship, half its larger side."""
        V = self.vessels
        return float(max(self.length[source], self.beam[source]) / 2 if source < V else self.radius[source - V])

    def _at(self, t: npt.ArrayLike | None, source: int, track: Floats) -> Floats:
        integrated = source < self.vessels and self.meta["models"][source] == MODEL_3DOF
        at = self.t if t is None else np.asarray(t, float)
        samples = self.t if integrated else self.traffic_t
        return np.stack([np.interp(at, samples, column) for column in track.T], axis=1)


_ARRAYS = (*(sample_dtype(1, 1).names or ()), "radius", "length", "beam", "detections", "ais", "actions")


def save(episode: Episode, path: str | os.PathLike[str]) -> None:
    """Write an archive; the file appears whole or not at all.

    Raises
    ------
    ArchiveError
        if arrays of the episode do not fit together.
    OSError
        if the file cannot be written.
    """
    _check(episode)
    meta = {**plain(episode.meta), "format": FORMAT, "version": VERSION}
    with replacing(path) as file, zipfile.ZipFile(file, "w") as archive:
        _write(archive, "meta.json", json.dumps(meta, indent=1, allow_nan=False).encode())
        _write(archive, "events.json", json.dumps(plain(episode.events), indent=1, allow_nan=False).encode())
        for name in _ARRAYS:
            buffer = io.BytesIO()
            np.lib.format.write_array(buffer, np.asarray(getattr(episode, name)), allow_pickle=False)
            _write(archive, f"{name}.npy", buffer.getvalue())


def load(path: str | os.PathLike[str]) -> Episode:
    """Read an archive.

    Raises
    ------
    ArchiveError
        if the file is no archive, is broken, or has a newer format than this version of usv_gym knows.
    OSError
        if there is no such file, or it cannot be read.
    """
    data = Path(path).read_bytes()
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            meta = json.loads(archive.read("meta.json"))
            if meta["format"] != FORMAT:
                raise ArchiveError(f"the format is {meta['format']!r}, not {FORMAT!r}")
            if meta["version"] > VERSION:
                raise ArchiveError(
                    f"format version {meta['version']}; this usv_gym reads up to {VERSION}: install a newer one"
                )
            events = json.loads(archive.read("events.json"))
            arrays = {
                name: np.lib.format.read_array(io.BytesIO(archive.read(f"{name}.npy")), allow_pickle=False)
                for name in _ARRAYS
            }
        episode = Episode(meta=meta, events=events, **arrays)
        _check(episode)
    except ArchiveError as error:
        raise ArchiveError(f"{os.fspath(path)}: {error}") from None
    except Exception as error:  # zip, zlib, json and NumPy have a dozen for broken bytes; here they mean one thing
        reason = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise ArchiveError(f"{os.fspath(path)}: not an episode archive, or a broken one ({reason})") from error
    return episode


def open_archive(path: str | os.PathLike[str]) -> Episode:
    """Read an archive, or the ``episode.usv`` of a directory of results.

    Raises
    ------
    ArchiveError
        as `load`, and if the file cannot be read.
    """
    file = Path(path)
    file = file / "episode.usv" if file.is_dir() else file
    try:
        return load(file)
    except OSError as error:
        raise ArchiveError(f"{file}: cannot be read: {error.strerror or error}") from None


def _write(archive: zipfile.ZipFile, name: str, data: bytes) -> None:
    info = zipfile.ZipInfo(name, (1980, 1, 1, 0, 0, 0))  # not the clock: equal episodes give equal bytes
    info.create_system = 3
    info.external_attr = 0o644 << 16
    info.compress_type = zipfile.ZIP_DEFLATED
    archive.writestr(info, data)


def _check(episode: Episode) -> None:
    """Shapes and dtypes of the arrays, and that sources in the tables exist."""
    if np.ndim(episode.eta) != 3 or np.ndim(episode.obstacle) != 3:
        raise ArchiveError("eta and obstacle must be [T, V, 3] and [T, M, 2]")
    T, V, M = len(episode.eta), episode.eta.shape[1], episode.obstacle.shape[1]
    expected: dict[str, tuple[Dtype, tuple[int, ...]]] = {
        "radius": (np.dtype("<f8"), (M,)),
        "length": (np.dtype("<f8"), (V,)),
        "beam": (np.dtype("<f8"), (V,)),
        "detections": (DETECTION, (len(episode.detections),)),
        "ais": (AIS_REPORT, (len(episode.ais),)),
    }
    sample = sample_dtype(V, M)
    for name in sample.names or ():
        expected[name] = (sample[name].base, (T, *sample[name].shape))
    for name, (dtype, shape) in expected.items():
        array = getattr(episode, name)
        if array.dtype != dtype or array.shape != shape:
            raise ArchiveError(f"{name} must be {list(shape)} of {dtype}, not {list(array.shape)} of {array.dtype}")
    if episode.actions.dtype.hasobject:
        raise ArchiveError("actions must be numbers")
    if T == 0 or np.any(np.diff(episode.t) <= 0):
        raise ArchiveError("t must hold at least one sample and increase")
    for table, sources in ((episode.detections, V + M + T_LAND), (episode.ais, V + M)):
        if np.any((table["source"] < 0) | (table["source"] >= sources)):
            raise ArchiveError(f"sources must lie in 0..{sources - 1}")
    if not 0 <= episode.meta.get("own", -1) < V:
        raise ArchiveError(f"meta: own must be a vessel slot, 0..{V - 1}")
    for name, count in (("models", V), ("kinds", V + M), ("mmsi", V + M), ("ais_class", V + M)):
        if len(episode.meta.get(name, ())) != count:
            raise ArchiveError(f"meta: {name} must have {count} entries")


def plain(value: Any) -> Any:
    """A value as JSON knows it: mappings, lists, text, finite numbers; NaN and infinity become None."""
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, np.ndarray | np.generic):
        return plain(value.tolist())
    if isinstance(value, list | tuple | set | frozenset):
        return [plain(item) for item in value]
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if value is None or isinstance(value, bool | int | str):
        return value
    return str(value)


@contextlib.contextmanager
def replacing(path: str | os.PathLike[str]) -> Iterator[BinaryIO]:
    """Open a file that takes the place of ``path`` once the block ends well, and leaves nothing if it does not."""
    target = Path(path)
    target.parent.mkdir(parents=True, exist_ok=True)
    temporary = target.with_name(f".{target.name}.{os.getpid()}.tmp")
    try:
        with temporary.open("wb") as file:
            yield file
        os.replace(temporary, target)
    finally:
        temporary.unlink(missing_ok=True)
