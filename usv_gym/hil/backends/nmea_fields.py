"""Fields of NMEA 0183 sentences: positions in a line instead of names.

A row of an NMEA profile lists its fields in order, each as in other profiles with a C format behind it: ``sog [kn] %.2f``.
Four units are of NMEA's own: ``utc [time]`` is hhmmss.ss, ``utc [date]`` ddmmyy, ``latitude [lat]`` and ``longitude [lon]`` are
two fields, 5926.2665,N and 01028.2991,E.  ``~`` behind all of it: may be missing in a sentence that comes in.
"""

from __future__ import annotations

import datetime
import math
import re
from collections.abc import Callable, Sequence
from typing import Any

from ..fields import Refused, parse_reference

_FORMAT = re.compile(r"\s+(%[-+0-9.]*[dfgs])\s*$")
_OWN_UNITS = re.compile(r"\[(lat|lon|time|date)\]")
TEXTS = ("command", "id", "arguments")  #: values that are no numbers
OPTIONAL = "~"


def split_format(text: str) -> tuple[str, str]:
    """``sog [kn] %.2f`` -> (``sog [kn]``, ``%.2f``)."""
    match = _FORMAT.search(text)
    return (text[: match.start()], match[1]) if match else (text, "")


def without_format(spec: Any) -> Any:
    """The reference in a field, as the profile's checks know it."""
    if not isinstance(spec, str) or spec.startswith("=") or not spec:
        return 0
    return _OWN_UNITS.sub("", split_format(spec.rstrip(OPTIONAL))[0]).strip()


def checksum(body: str) -> int:
    """XOR of the characters between the start and the asterisk."""
    total = 0
    for byte in body.encode("ascii", "replace"):
        total ^= byte
    return total


def sentence(body: str, start: str = "$") -> str:
    """A sentence with its checksum, without the line end."""
    return f"{start}{body}*{checksum(body):02X}"


# --- out -------------------------------------------------------------------------------------------------------------
def sentence_encoder(row: Any) -> Callable[[dict[str, Any]], str]:
    """A function from the values of a signal to a sentence."""
    parts = [_part(spec, f"{row.topic}.fields[{k}]") for k, spec in enumerate(row.fields)]
    return lambda values: sentence(",".join([row.type, *(part(values) for part in parts)]))


def _part(spec: Any, where: str) -> Callable[[dict[str, Any]], str]:
    if not isinstance(spec, str):
        return lambda _: f"{spec:g}"
    if not spec or spec.startswith("="):
        return lambda _: spec[1:]
    text, form = split_format(spec.rstrip(OPTIONAL))
    own = _OWN_UNITS.search(text)
    name, factor, rounding = parse_reference(_OWN_UNITS.sub("", text), where)
    if own is not None:
        write = {"lat": _latitude, "lon": _longitude, "time": _time, "date": _date}[own[1]]
        return lambda values: write(values[name])
    form = form or ("%d" if rounding == "int" else "%g")

    def number(values: dict[str, Any]) -> str:
        value = values[name]
        if isinstance(value, str):
            return re.sub(r"[,*$!\\\r\n^]", " ", value)
        if not math.isfinite(value):
            return ""
        text = form % (value * factor)
        # 360.0 of a bearing that was rounded up is 0.0
        return form % 0.0 if factor > 57.0 and factor < 58.0 and float(text) == 360.0 else text

    return number


def _degrees(value: float, width: int) -> str:
    minutes = round(abs(value) * 60.0, 6)
    return f"{int(minutes // 60):0{width}d}{minutes % 60.0:09.6f}"


def _latitude(value: float) -> str:
    return f"{_degrees(value, 2)},{'N' if value >= 0 else 'S'}"


def _longitude(value: float) -> str:
    return f"{_degrees(value, 3)},{'E' if value >= 0 else 'W'}"


def _time(utc: float) -> str:
    moment = datetime.datetime.fromtimestamp(round(utc * 100) / 100, datetime.UTC)
    return f"{moment:%H%M%S}.{moment.microsecond // 10000:02d}"


def _date(utc: float) -> str:
    return f"{datetime.datetime.fromtimestamp(utc, datetime.UTC):%d%m%y}"


# --- in --------------------------------------------------------------------------------------------------------------
def sentence_decoder(row: Any) -> Callable[[Sequence[str]], dict[str, Any]]:
    """A function from the fields of a sentence (without its type) to values; it raises ``Refused``."""
    parts: list[tuple[str, str, float, bool]] = []  # kind, name or literal, factor, may be missing
    for k, spec in enumerate(row.fields):
        if not isinstance(spec, str):
            parts.append(("literal", f"{spec:g}", 1.0, False))
        elif not spec:
            parts.append(("any", "", 1.0, True))
        elif spec.startswith("="):
            parts.append(("literal", spec[1:], 1.0, False))
        else:
            text, _ = split_format(spec.rstrip(OPTIONAL))
            own = _OWN_UNITS.search(text)
            name, factor, _ = parse_reference(_OWN_UNITS.sub("", text), f"{row.topic}.fields[{k}]")
            kind = own[1] if own else ("text" if name in TEXTS else "number")
            parts.append((kind, name, factor, spec.endswith(OPTIONAL)))

    def decode(fields: Sequence[str]) -> dict[str, Any]:
        values: dict[str, Any] = {}
        at = 0
        for kind, name, factor, optional in parts:
            width = 2 if kind in ("lat", "lon") else 1
            got = fields[at : at + width]
            at += width
            if len(got) < width:
                if optional:
                    continue
                raise Refused("field missing")
            if kind == "literal":
                if got[0] != name:
                    raise Refused("not for us")
            elif kind == "text":
                values[name] = got[0]
            elif kind in ("lat", "lon"):
                if got[0] or not optional:
                    values[name] = _read_degrees(got[0], got[1], kind)
            elif kind == "number" and got[0]:
                values[name] = _read_number(got[0]) / factor
        return values

    return decode


def _read_number(text: str) -> float:
    if len(text) > 24 or "_" in text:
        raise Refused("not a number")
    try:
        value = float(text)
    except ValueError:
        raise Refused("not a number") from None
    if not math.isfinite(value):
        raise Refused("not finite")
    return value


def _read_degrees(text: str, side: str, kind: str) -> float:
    value = _read_number(text)
    degrees, minutes = divmod(value, 100.0)
    if (
        not 0.0 <= minutes < 60.0
        or not 0.0 <= degrees <= (90 if kind == "lat" else 180)
        or side not in ("NS", "EW")[kind == "lon"]
        or not side
    ):
        raise Refused("no place on earth")
    result = degrees + minutes / 60.0
    return -result if side in "SW" else result
