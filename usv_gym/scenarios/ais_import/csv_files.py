"""AIS history as CSV: the Danish Maritime Authority's and NOAA MarineCadastre's own headers, and any with such columns.

The standard library's reader is used on purpose: it streams, needs no dependency, and with the filters applied to three columns
before anything else is parsed it reads some 200,000 rows a second.
"""

from __future__ import annotations

import csv
import gzip
import io
import math
import zipfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from datetime import UTC, datetime
from pathlib import Path
from typing import IO

from ...config import ConfigError, suggestion
from .fixes import NAN, Harvest, Progress, is_ship

#: what a column may be called, in lower case and without spaces, '#', '_'
_NAMES: Mapping[str, Sequence[str]] = {
    "timestamp": ("timestamp", "basedatetime", "datetime", "time", "t", "tstamp"),
    "mmsi": ("mmsi",),
    "latitude": ("latitude", "lat"),
    "longitude": ("longitude", "lon", "long", "lng"),
    "sog": ("sog", "speed", "speedoverground"),
    "cog": ("cog", "course", "courseoverground"),
    "heading": ("heading", "trueheading"),
    "name": ("name", "vesselname", "shipname"),
    "length": ("length",),
    "beam": ("width", "beam"),
    "ais_class": ("typeofmobile", "transceiverclass", "class"),
}
_REQUIRED = ("timestamp", "mmsi", "latitude", "longitude")
_TIMES = "YYYY-MM-DD HH:MM:SS, DD/MM/YYYY HH:MM:SS, or seconds since 1970"
_EVERY = 20_000  #: rows between two reports of progress


@contextmanager
def opened(path: Path) -> Iterator[tuple[IO[bytes], Callable[[], int]]]:
    """A file as bytes, unpacked if it is .gz or .zip, and a function that tells how many bytes of the file are read.

    Raises
    ------
    ConfigError
        if it cannot be read or unpacked.
    """
    try:
        with path.open("rb") as raw:
            if path.suffix == ".gz":
                with gzip.open(raw) as unpacked:
                    yield unpacked, raw.tell  # type: ignore[misc]
            elif path.suffix == ".zip":
                with zipfile.ZipFile(raw) as archive:
                    names = [name for name in archive.namelist() if not name.endswith("/")]
                    if len(names) != 1:
                        raise ConfigError(f"{path}: expected one file in the archive, found {len(names)}")
                    with archive.open(names[0]) as member:
                        yield member, raw.tell
            else:
                yield raw, raw.tell
    except FileNotFoundError:
        raise ConfigError(f"{path}: no such file") from None
    except (OSError, EOFError, zipfile.BadZipFile) as error:
        raise ConfigError(f"{path}: cannot be read: {getattr(error, 'strerror', None) or error}") from None


def read_csv(path: Path, harvest: Harvest, progress: Progress | None = None) -> None:
    """Stream a CSV file of many ships into a harvest.

    Raises
    ------
    ConfigError
        if the file cannot be read, has no columns for time, MMSI and position, or its times cannot be read.
    """
    for row, at, when in _rows(path, _REQUIRED, harvest, progress):
        try:
            mmsi, t = int(row[at["mmsi"]]), when(row[at["timestamp"]])
            latitude, longitude = float(row[at["latitude"]]), float(row[at["longitude"]])
        except (ValueError, IndexError):
            harvest.odd["unreadable rows"] += 1
            continue
        kind = _cell(row, at, "ais_class")
        if not is_ship(mmsi) or kind in ("Base Station", "AtoN", "SAR Airborne"):
            harvest.odd["rows of stations that are no ships"] += 1
            continue
        if harvest.add(mmsi, t, latitude, longitude, _number(row, at, "sog"), _number(row, at, "cog"),
                       _number(row, at, "heading")):  # fmt: skip
            harvest.about(mmsi).update(_cell(row, at, "name").strip(), _size(row, at, "length"), _size(row, at, "beam"),
                                       kind[-1:] if kind in ("A", "B", "Class A", "Class B") else "")  # fmt: skip


def read_own(path: Path, harvest: Harvest) -> None:
    """Read the own ship's track, a CSV file with time and position, into ``harvest.own``.

    Raises
    ------
    ConfigError
        as ``read_csv``.
    """
    for row, at, when in _rows(path, ("timestamp", "latitude", "longitude"), harvest, None):
        try:
            t = when(row[at["timestamp"]])
            place = float(row[at["latitude"]]), float(row[at["longitude"]])
        except (ValueError, IndexError):
            harvest.odd["unreadable rows"] += 1
            continue
        harvest.add_own(t, *place, *(_number(row, at, key) for key in ("sog", "cog", "heading")))


_Row = tuple[list[str], dict[str, int], Callable[[str], float]]


def _rows(path: Path, required: Sequence[str], harvest: Harvest, progress: Progress | None) -> Iterator[_Row]:
    """Rows of a file, with where its columns are and how its times are read."""
    size = path.stat().st_size if path.is_file() else 0
    with opened(path) as (raw, tell):
        reader = csv.reader(io.TextIOWrapper(raw, encoding="utf-8-sig", errors="replace", newline=""))
        try:
            header = next(reader, [])
            at = columns(header, path, required)
            first = next(reader, None)
            if first is None:
                harvest.lines += 1
                return
            when = clock(first[at["timestamp"]] if at["timestamp"] < len(first) else "", path, header[at["timestamp"]])
            harvest.lines += 2
            yield first, at, when
            for count, row in enumerate(reader):
                if row:
                    yield row, at, when
                if count % _EVERY == 0 and progress is not None:
                    progress(tell(), size)
            harvest.lines += reader.line_num - 2
        except csv.Error as error:
            raise ConfigError(f"{path}:{reader.line_num}: not CSV: {error}") from None


def _plain(name: str) -> str:
    return "".join(c for c in name.lower() if c not in " #_\ufeff")


def columns(header: Sequence[str], path: Path, required: Sequence[str] = _REQUIRED) -> dict[str, int]:
    """Index of each known column of a header.

    Raises
    ------
    ConfigError
        if one of ``required`` is missing; the message names it, what it may be called, and the likely meant column.
    """
    plain = [_plain(name) for name in header]
    found = {key: next((plain.index(n) for n in names if n in plain), -1) for key, names in _NAMES.items()}
    missing = [key for key in required if found[key] < 0]
    if missing:
        unused = [name for i, name in enumerate(header) if i not in found.values() and name.strip()]
        likely = (suggestion(key, unused) for key in missing)
        what = "; ".join(
            f"no column for {key} (called {' or '.join(_NAMES[key][:2])}){hint if 'mean' in hint else ''}"
            for key, hint in zip(missing, likely, strict=True)
        )
        shown = "".join(c for c in ", ".join(filter(str.strip, header))[:200] if c.isprintable()) or "nothing"
        if len(missing) == len(required):
            raise ConfigError(f"{path}:1: neither NMEA sentences nor a table of AIS: no columns for {', '.join(required)}; "
                              f"the first line has: {shown}")  # fmt: skip
        raise ConfigError(f"{path}:1: {what}; the header has: {shown}")
    return {key: i for key, i in found.items() if i >= 0}


def clock(example: str, path: Path, column: str) -> Callable[[str], float]:
    """How times that look like ``example`` are read: a function from text to UTC [s since 1970] that raises ValueError.

    Raises
    ------
    ConfigError
        if the example cannot be read.
    """
    days: dict[str, float] = {}  # parsing a date is dear, and there are few

    def day(text: str) -> float:
        if text not in days:
            parts = [int(part) for part in (text[6:10], text[3:5], text[:2])] if text[2:3] == "/" else [
                int(part) for part in (text[:4], text[5:7], text[8:10])]  # fmt: skip
            days[text] = datetime(*parts, tzinfo=UTC).timestamp()  # type: ignore[arg-type, misc]
        return days[text]

    def calendar(text: str) -> float:
        if text[13:14] != ":":
            raise ValueError(text)
        return day(text[:10]) + 3600 * int(text[11:13]) + 60 * int(text[14:16]) + float(text[17:].rstrip("Zz") or 0.0)

    for read in (calendar, float):
        try:
            if math.isfinite(read(example)):
                return read
        except ValueError:
            continue
    raise ConfigError(f"{path}:2: column {column.strip()!r}: unreadable time {example!r}: expected {_TIMES}")


def _cell(row: list[str], at: Mapping[str, int], key: str) -> str:
    i = at.get(key, -1)
    return row[i] if 0 <= i < len(row) else ""


def _number(row: list[str], at: Mapping[str, int], key: str) -> float:
    try:
        return float(_cell(row, at, key) or NAN)
    except ValueError:
        return NAN


def _size(row: list[str], at: Mapping[str, int], key: str) -> float:
    value = _number(row, at, key)
    return value if 1.0 <= value <= 500.0 else 0.0
