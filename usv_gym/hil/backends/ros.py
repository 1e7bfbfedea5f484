"""What both ROS versions share: messages from nested dicts and back."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from ..fields import Stamp


def fill(message: Any, values: Any, seconds: tuple[str, str]) -> Any:
    """Write nested dicts into a message; ``seconds`` are the names of the parts of a time.

    A list of dicts goes into a field that the message class makes items for with ``item_class(name)``.
    """
    for name, value in values.items():
        if isinstance(value, Stamp):
            time = getattr(message, name)
            whole, rest = divmod(int(value), 1_000_000_000)
            setattr(time, seconds[0], whole)
            setattr(time, seconds[1], rest)
        elif isinstance(value, dict):
            fill(getattr(message, name), value, seconds)
        elif isinstance(value, list) and value and isinstance(value[0], dict):
            cls = item_class(message, name)
            setattr(message, name, [fill(cls(), item, seconds) for item in value])
        elif isinstance(value, list):
            present = getattr(message, name)
            padding = len(present) - len(value)  # of an array of fixed length
            setattr(message, name, [*value, *list(present)[len(value) :]] if padding > 0 else value)
        else:
            setattr(message, name, value)
    return message


def item_class(message: Any, name: str) -> Any:
    """The class of the items of a list field."""
    if hasattr(message, "get_fields_and_field_types"):  # ROS 2
        from importlib import import_module

        kind = message.get_fields_and_field_types()[name].removeprefix("sequence<").partition(">")[0].partition("[")[0]
        package, _, short = kind.partition("/")
        return getattr(import_module(f"{package}.msg"), short)
    kind = message._slot_types[message.__slots__.index(name)].partition("[")[0]
    return ros1_class(message, kind)


def ros1_class(message: Any, kind: str) -> Any:
    """A ROS 1 message class by type; one that was made at run time is found beside its parent."""
    made = getattr(type(message), "usv_gym_types", None)
    if made and kind in made:
        return made[kind]
    from genpy.message import get_message_class

    return get_message_class(kind)


def read(message: Any, slots: Iterable[str], seconds: tuple[str, str]) -> Any:
    """A message as nested dicts and lists."""
    result: dict[str, Any] = {}
    for name in slots:
        result[name.lstrip("_")] = _plain(getattr(message, name.lstrip("_")), seconds)
    return result


def _plain(value: Any, seconds: tuple[str, str]) -> Any:
    if isinstance(value, bool | int | float | str):
        return value
    if isinstance(value, bytes):
        return list(value)
    if hasattr(value, seconds[0]) and hasattr(value, seconds[1]):
        return Stamp(getattr(value, seconds[0]) * 1_000_000_000 + getattr(value, seconds[1]))
    if hasattr(value, "get_fields_and_field_types"):
        return read(value, value.get_fields_and_field_types(), seconds)
    if hasattr(value, "__slots__") and hasattr(value, "_slot_types"):
        return read(value, value.__slots__, seconds)
    if hasattr(value, "tolist"):
        return value.tolist()
    return [_plain(item, seconds) for item in value]
