"""AIS on the wire: from a transmitted report to NMEA 0183 sentences, encoded by pyais.

The simulation knows a report as numbers (sensors/ais.py); sentences are made on demand.  Which number the wire carries
is decided by the ``_code`` functions: ``position_report`` sends those codes, and ``quantise_*`` turns them back into SI
units, which is what a receiver gets and what the kernel is tested against.

ITU-R M.1371: position in 1/10000 minute, SOG in 0.1 kn (102.2 means that or more), COG in 0.1 degree, true heading in
whole degrees, rate of turn as 4.733 sqrt(degrees per minute) with its sign, at most 126 (708 degrees per minute or
more).  "Not available" is latitude 91, longitude 181, SOG 102.3, COG 360, heading 511, ROT -128.
"""

from __future__ import annotations

import datetime
import unicodedata
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from ..units import DEG, DEG_PER_MIN, KNOT
from ..world.state import (
    AIS_ATON,
    AIS_CLASS_A,
    AIS_CLASS_B,
    KIND_BOAT,
    KIND_BUOY,
    KIND_ICEBERG,
    KIND_ISLET,
    KIND_LIGHTHOUSE,
    KIND_PLATFORM,
    KIND_SHIP,
)

Floats = npt.NDArray[np.float64]

STATIC_INTERVAL = 360.0  #: s between static messages of ships

_PER_DEGREE = 600000.0  # positions are in 1/10000 minute
_ROT = 4.733
_CS_RADIO = (1 << 19) | 0b1100000000000000110  # a class B "CS" unit has no communication state: the constant of M.1371

#: ship types and types of aid to navigation of M.1371 by kind of object
_SHIP_TYPE = {KIND_SHIP: 70, KIND_BOAT: 37}  # cargo, pleasure craft
_OTHER_TYPE = 90
_AID_TYPE = {KIND_ICEBERG: 28, KIND_BUOY: 30, KIND_ISLET: 17, KIND_LIGHTHOUSE: 5, KIND_PLATFORM: 3}


@dataclass(frozen=True)
class Station:
    """What a transmitter says about itself and never changes."""

    mmsi: int
    ais_class: int  # AIS_CLASS_A, AIS_CLASS_B or AIS_ATON
    kind: int  # KIND_*
    name: str
    length: float  # m
    beam: float  # m


def geodetic(
    north: npt.ArrayLike, east: npt.ArrayLike, origin: Sequence[float], metres_per_degree: Sequence[float]
) -> tuple[Floats, Floats]:
    """Latitude and longitude [deg], longitude within [-180, 180], of N, E [m] about an origin (latitude, longitude)."""
    latitude = origin[0] + np.asarray(north, float) / metres_per_degree[0]
    longitude = origin[1] + np.asarray(east, float) / metres_per_degree[1]
    return latitude, np.where(np.abs(longitude) > 180.0, (longitude + 180.0) % 360.0 - 180.0, longitude)


# --- what the wire can carry -----------------------------------------------------------------------------------------
def _nearest(value: npt.ArrayLike) -> Floats:
    return np.asarray(np.floor(np.asarray(value, float) + 0.5))


def _sog_code(sog: npt.ArrayLike) -> Floats:
    return np.clip(_nearest(np.asarray(sog, float) / KNOT * 10.0), 0.0, 1022.0)


def _cog_code(cog: npt.ArrayLike) -> Floats:
    return np.mod(_nearest(np.asarray(cog, float) / DEG * 10.0), 3600.0)


def _heading_code(heading: npt.ArrayLike) -> Floats:
    return np.mod(_nearest(np.asarray(heading, float) / DEG), 360.0)


def _rot_code(rot: npt.ArrayLike) -> Floats:
    per_minute = np.asarray(rot, float) / DEG_PER_MIN
    return np.copysign(np.minimum(_nearest(_ROT * np.sqrt(np.abs(per_minute))), 126.0), per_minute)


def _rot_per_minute(code: Floats) -> Floats:
    return np.copysign((code / _ROT) ** 2, code)


def quantise_position(
    north: npt.ArrayLike, east: npt.ArrayLike, origin: Sequence[float], metres_per_degree: Sequence[float]
) -> tuple[Floats, Floats]:
    """N, E [m] at the resolution of the wire, 1/600000 degree (0.19 m along a meridian)."""
    north_east = []
    for value, zero, scale in zip((north, east), origin, metres_per_degree, strict=True):
        degrees = _nearest((zero + np.asarray(value, float) / scale) * _PER_DEGREE) / _PER_DEGREE
        north_east.append((degrees - zero) * scale)
    return north_east[0], north_east[1]


def quantise_sog(sog: npt.ArrayLike) -> Floats:
    """Speed over ground [m/s] at the resolution of the wire, 0.1 kn, within 0..102.2 kn; NaN stays NaN."""
    return _sog_code(sog) / 10.0 * KNOT


def quantise_cog(cog: npt.ArrayLike) -> Floats:
    """Course over ground [rad] at the resolution of the wire, 0.1 degree, within [0, 2 pi); NaN stays NaN."""
    return _cog_code(cog) / 10.0 * DEG


def quantise_heading(heading: npt.ArrayLike) -> Floats:
    """True heading [rad] at the resolution of the wire, 1 degree, within [0, 2 pi); NaN stays NaN."""
    return _heading_code(heading) * DEG


def quantise_rot(rot: npt.ArrayLike) -> Floats:
    """Rate of turn [rad/s] as a receiver computes it from the code of the wire; NaN stays NaN."""
    return _rot_per_minute(_rot_code(rot)) * DEG_PER_MIN


# --- messages, in the field names of pyais ---------------------------------------------------------------------------
def position_report(
    station: Station,
    latitude: float,
    longitude: float,
    *,
    cog: float,
    heading: float,
    sog: float,
    rot: float,
    utc_us: int,
) -> dict[str, Any]:
    """Fields of the position report of a station: type 1 (class A), 18 (class B) or 21 (aid to navigation).

    Latitude and longitude in degrees, angles in rad, speed in m/s, rate of turn in rad/s, NaN for what is not
    available; ``utc_us`` is the time of the fix in microseconds since 1970.

    Raises
    ------
    ValueError
        if the station has no AIS.
    """
    utc = datetime.datetime.fromtimestamp(utc_us // 1_000_000, datetime.UTC)
    fix = abs(latitude) <= 90.0 and abs(longitude) <= 180.0  # False for NaN
    place = {
        "mmsi": station.mmsi,
        "accuracy": True,
        "lat": float(latitude) if fix else 91.0,
        "lon": float(longitude) if fix else 181.0,
        "second": utc.second,
    }
    motion = {
        "speed": _or(_sog_code(sog) / 10.0, 102.3),
        "course": _or(_cog_code(cog) / 10.0, 360.0),
        "heading": int(_or(_heading_code(heading), 511.0)),
    }
    if station.ais_class == AIS_CLASS_A:
        # Communication state: synchronised to UTC, slot time-out 1, whose sub-message is the hour and the minute.
        radio = (1 << 14) | (utc.hour << 9) | (utc.minute << 2)
        # pyais takes degrees per minute, rounds to a code without a limit, and lets -128 pass.
        turn = _or(_rot_per_minute(_rot_code(rot)), -128.0)
        return {"msg_type": 1, **place, **motion, "status": 0, "turn": turn, "maneuver": 0, "radio": radio}
    if station.ais_class == AIS_CLASS_B:
        return {"msg_type": 18, **place, **motion, "cs": True, "band": True, "msg22": True, "radio": _CS_RADIO}
    if station.ais_class == AIS_ATON:
        return {
            "msg_type": 21,
            **place,
            **_dimensions(station),
            "aid_type": _AID_TYPE.get(station.kind, 0),
            "name": wire_text(station.name),
            "name_ext": None,  # a name of 20 characters has no extension; pyais would send 14 empty ones
            "epfd": 7,  # surveyed
        }
    raise ValueError(f"station {station.mmsi} ({station.name}) has no AIS")


def static_reports(station: Station) -> list[dict[str, Any]]:
    """Fields of the static messages of a ship: type 5 (class A), 24 A and B (class B); aids to navigation have none."""
    name, ship_type = wire_text(station.name), _SHIP_TYPE.get(station.kind, _OTHER_TYPE)
    if station.ais_class == AIS_CLASS_A:
        return [{
            "msg_type": 5, "mmsi": station.mmsi, "shipname": name, "ship_type": ship_type, **_dimensions(station),
            "epfd": 1, "hour": 24, "minute": 60,  # no estimated time of arrival
        }]  # fmt: skip
    if station.ais_class == AIS_CLASS_B:
        return [
            {"msg_type": 24, "mmsi": station.mmsi, "partno": 0, "shipname": name},
            {
                "msg_type": 24, "mmsi": station.mmsi, "partno": 1, "ship_type": ship_type, **_dimensions(station),
                "mothership_mmsi": 0,  # in place of the dimensions for auxiliary craft, MMSI 98xxxxxxx
            },
        ]  # fmt: skip
    return []


def _or(code: Floats, missing: float) -> float:
    value = float(code)
    return missing if np.isnan(value) else value


def _dimensions(station: Station) -> dict[str, int]:
    """Distances from the reference point, amidships, to the four sides [m]."""
    length, beam = max(1, round(station.length)), max(1, round(station.beam))
    return {
        "to_bow": min((length + 1) // 2, 511), "to_stern": min(length // 2, 511),
        "to_port": min((beam + 1) // 2, 63), "to_starboard": min(beam // 2, 63),
    }  # fmt: skip


def wire_text(text: str, width: int = 20) -> str:
    """Text in the 6-bit alphabet of AIS: upper case, accents dropped, ``?`` for what it has no letter for."""
    for letter, replacement in (("Ø", "O"), ("Æ", "AE"), ("Œ", "OE"), ("Ł", "L"), ("Đ", "D")):
        text = text.upper().replace(letter, replacement)
    letters = (c for c in unicodedata.normalize("NFKD", text).upper() if not unicodedata.combining(c))
    # '@' is the end of a text on the wire
    return "".join(c if " " <= c <= "_" and c != "@" else "?" for c in letters).strip()[:width].strip()


# --- sentences -------------------------------------------------------------------------------------------------------
def encode(fields: dict[str, Any], *, own: bool = False, channel: str = "A", sequence: int = 0) -> list[str]:
    """NMEA 0183 sentences of one message: ``!AIVDM``, or ``!AIVDO`` for the own ship's own.

    ``sequence`` tells apart messages of several sentences; it counts 0..9.
    """
    import pyais

    kind = "VDO" if own else "VDM"
    return pyais.encode_dict(fields, talker_id="AI", sentence_type=kind, radio_channel=channel, seq_id=sequence % 10)


def tag(sentences: Sequence[str], utc_us: int, group: int = 0) -> list[str]:
    r"""Sentences with an NMEA 4.10 TAG block, ``\c:<unix time in s>*hh\!AIVDM,..``.

    The sentences of one message of several are tied together by ``g:<part>-<parts>-<group>``.
    """
    from pyais.util import compute_checksum

    lines = []
    for part, sentence in enumerate(sentences, start=1):
        grouping = f"g:{part}-{len(sentences)}-{group}," if len(sentences) > 1 else ""
        block = f"{grouping}c:{utc_us // 1_000_000}"
        lines.append(f"\\{block}*{compute_checksum(f'!{block}'):02X}\\{sentence}")
    return lines
