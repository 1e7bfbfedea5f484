"""How a message is filled from what the simulation knows, and read: the small language of profiles.

A field is written as ``name [unit] rounding``::

    speed: sog [kn]              # sog, which is in m/s, in knots
    heading: heading [deg] round
    frame_id: =map               # a text as it stands; numbers and true/false stand for themselves
    position: {x: east, y: north}
    position_covariance: covariance   # a list, where the simulation has one

Inside, everything is SI and radians (latitude and longitude are degrees); the unit in brackets is the unit of the message.
The same line serves both ways: in an incoming row, ``rightRPM: starboard.rpm [%]`` divides by 100, and a constant must match.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from ..config import ConfigError, suggestion
from ..units import DEG, DEG_PER_MIN, KNOT

#: how much of a unit one SI unit (one radian, one degree of latitude) is
UNITS: dict[str, float] = {
    "": 1.0, "1": 1.0, "m": 1.0, "rad": 1.0, "m/s": 1.0, "rad/s": 1.0, "s": 1.0, "N": 1.0, "%": 100.0, "km": 1e-3,
    "ms": 1e3, "us": 1e6, "deg": 1 / DEG, "deg/s": 1 / DEG, "deg/min": 1 / DEG_PER_MIN, "kn": 1 / KNOT, "km/h": 3.6,
    "min": 1 / 60.0, "M": 1 / 1852.0,
}  # fmt: skip
#: values that come in and are no numbers
NO_NUMBERS: dict[str, Any] = {"command": str, "id": str, "arguments": str, "paused": bool, "answers": int}
_REFERENCE = re.compile(r"^([A-Za-z_][\w.]*)(?:\s*\[([^\]]*)\])?(?:\s+(round|int))?$")

Values = Mapping[str, Any]
Encoder = Callable[[Values], Any]


class Refused(ValueError):
    """An incoming message that cannot be used; the text is the reason under which it is counted."""


class Stamp(int):
    """A time in nanoseconds since 1970; a backend makes its own kind of time of it."""


def parse_reference(text: str, where: str) -> tuple[str, float, str]:
    """(name, units per SI unit, rounding) of ``name [unit] rounding``.

    Raises
    ------
    ConfigError
        if it is written in another way, or the unit is unknown.
    """
    match = _REFERENCE.match(text.strip())
    if match is None:
        raise ConfigError(f"{where}: expected `name [unit]`, a number or `=text`, got {text!r}")
    name, unit, rounding = match[1], (match[2] or "").strip(), match[3] or ""
    if unit not in UNITS:
        raise ConfigError(f"{where}: unknown unit {unit!r}{suggestion(unit, UNITS)}")
    return name, UNITS[unit], rounding


def names_in(spec: Any, where: str) -> list[str]:
    """Every name that a field refers to."""
    if isinstance(spec, Mapping):
        return [name for key, part in spec.items() for name in names_in(part, f"{where}.{key}")]
    if isinstance(spec, list | tuple):
        return [name for k, part in enumerate(spec) for name in names_in(part, f"{where}[{k}]")]
    return [parse_reference(spec, where)[0]] if isinstance(spec, str) and not spec.startswith("=") else []


# --- out -------------------------------------------------------------------------------------------------------------
def encoder(spec: Any, where: str) -> Encoder:
    """A function from the values of a signal to the value of a field; nested mappings give nested dicts."""
    if isinstance(spec, Mapping):
        parts = [(str(key), encoder(part, f"{where}.{key}")) for key, part in spec.items()]
        return lambda values: {key: make(values) for key, make in parts}
    if isinstance(spec, list | tuple):
        items = [encoder(part, f"{where}[{k}]") for k, part in enumerate(spec)]
        return lambda values: [make(values) for make in items]
    if not isinstance(spec, str):
        return lambda _: spec
    if spec.startswith("="):
        return lambda _: spec[1:]
    name, factor, rounding = parse_reference(spec, where)
    if rounding == "int":
        return lambda values: int(_whole(values[name] * factor))
    if rounding == "round":
        return lambda values: float(_whole(values[name] * factor))
    if factor == 1.0:
        return lambda values: values[name]
    return lambda values: values[name] * factor


def _whole(value: float) -> float:
    return math.floor(value + 0.5) if math.isfinite(value) else 0.0


# --- in --------------------------------------------------------------------------------------------------------------
def decoder(spec: Any, where: str) -> Callable[[Any], dict[str, Any]]:
    """A function from a message (nested dicts and lists) to the values that it carries, by name.

    It raises :class:`Refused` for what is missing, not finite, or not as a constant in the profile says.
    """
    steps: list[tuple[tuple[str | int, ...], Any]] = []
    _collect(spec, (), where, steps)

    def decode(message: Any) -> dict[str, Any]:
        values: dict[str, Any] = {}
        for path, (name, factor, constant) in steps:
            node = message
            try:
                for key in path:
                    node = node[key]
            except (KeyError, IndexError, TypeError):
                raise Refused("field missing") from None
            if name is None:
                if node != constant:
                    raise Refused("not for us")
            elif name in NO_NUMBERS:
                if not isinstance(node, NO_NUMBERS[name]):
                    raise Refused("wrong type")
                values[name] = node
            elif isinstance(node, int | float) and not isinstance(node, bool | Stamp):
                if not math.isfinite(node):
                    raise Refused("not finite")
                values[name] = node / factor
            else:
                raise Refused("wrong type")
        return values

    return decode


def _collect(spec: Any, path: tuple[str | int, ...], where: str, steps: list[Any]) -> None:
    if isinstance(spec, Mapping):
        for key, part in spec.items():
            _collect(part, (*path, str(key)), f"{where}.{key}", steps)
    elif isinstance(spec, list | tuple):
        for k, part in enumerate(spec):
            if part is not None:
                _collect(part, (*path, k), f"{where}[{k}]", steps)
    elif isinstance(spec, str) and not spec.startswith("="):
        name, factor, _ = parse_reference(spec, where)
        steps.append((path, (name, factor, None)))
    else:
        steps.append((path, (None, 1.0, spec[1:] if isinstance(spec, str) else spec)))


def flat(message: Any, prefix: str = "") -> dict[str, Any]:
    """A nested message as one level of dotted names, for logs and comparisons."""
    if isinstance(message, Mapping):
        parts: Sequence[tuple[Any, Any]] = list(message.items())
    elif isinstance(message, list | tuple):
        parts = list(enumerate(message))
    else:
        return {prefix: message}
    result: dict[str, Any] = {}
    for key, part in parts:
        result.update(flat(part, f"{prefix}.{key}" if prefix else str(key)))
    return result
