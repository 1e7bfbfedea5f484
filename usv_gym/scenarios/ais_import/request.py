"""What an import is asked for, as words of the command line: a place, a start, a duration."""

from __future__ import annotations

import re
from collections.abc import Mapping
from datetime import UTC, datetime

from ...config import ConfigError, suggestion
from .fixes import Selection

#: places by name: latitude, longitude [deg], radius [m]
AREAS: Mapping[str, tuple[float, float, float]] = {
    "boston": (42.34, -70.95, 10_000.0),
    "english-channel": (49.85, -3.2, 60_000.0),
    "gothenburg": (57.65, 11.75, 20_000.0),
    "harlingen": (53.18, 5.42, 10_000.0),
    "oslofjord": (59.43, 10.52, 10_000.0),
    "portsmouth": (50.785, -1.11, 3_000.0),
    "solent": (50.775, -1.15, 12_000.0),
}
_METRES = {"": 1.0, "m": 1.0, "km": 1000.0, "nm": 1852.0}
_SECONDS = {"": 1.0, "s": 1.0, "min": 60.0, "h": 3600.0}


def _quantity(text: str, units: Mapping[str, float]) -> float | None:
    match = re.fullmatch(r"\s*([0-9]*\.?[0-9]+)\s*([a-z]*)\s*", text.lower())
    return float(match[1]) * units[match[2]] if match and match[2] in units and float(match[1]) > 0.0 else None


def parse_area(text: str) -> Selection:
    """``LAT,LON,RADIUS`` with the radius in m, km or nm (``5000``, ``5km``, ``3nm``), or a name of ``AREAS``.

    Raises
    ------
    ConfigError
        if it is neither.
    """
    parts = text.split(",")
    if len(parts) == 1 and not any(c.isdigit() for c in text):
        if text not in AREAS:
            raise ConfigError(f"--area {text}: unknown place{suggestion(text, AREAS)}; or give LAT,LON,RADIUS")
        return Selection(*AREAS[text])
    expected = f"--area {text}: expected LAT,LON,RADIUS in degrees and metres (or km, nm), as 50.78,-1.11,3km"
    try:
        latitude, longitude = float(parts[0]), float(parts[1])
    except (ValueError, IndexError):
        raise ConfigError(expected) from None
    radius = _quantity(parts[2], _METRES) if len(parts) == 3 else None
    if radius is None:
        raise ConfigError(expected)
    if not (-89.0 <= latitude <= 89.0 and -180.0 <= longitude <= 180.0):
        raise ConfigError(f"{expected}: latitude within 89, longitude within 180 degrees")
    if radius > 200_000.0:
        raise ConfigError(f"--area {text}: at most 200 km, beyond which the plane of a scenario bends too much")
    return Selection(latitude, longitude, radius)


def parse_start(text: str) -> float:
    """UTC [s since 1970] of a date and time in ISO 8601; without a zone it is UTC.

    Raises
    ------
    ConfigError
        if it cannot be read.
    """
    try:
        moment = datetime.fromisoformat(text.strip())
    except ValueError:
        raise ConfigError(f"--start {text}: expected a date and time in UTC, as 2016-01-12T13:10") from None
    return (moment if moment.tzinfo else moment.replace(tzinfo=UTC)).timestamp()


def parse_duration(text: str) -> float:
    """Seconds of ``600``, ``600s``, ``30min`` or ``1.5h``.

    Raises
    ------
    ConfigError
        if it is not a positive time.
    """
    seconds = _quantity(text, _SECONDS)
    if seconds is None:
        raise ConfigError(f"--duration {text}: expected a time, as 600, 30min or 1.5h")
    return seconds
