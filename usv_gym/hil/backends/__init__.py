"""Transports.  Each imports what it needs when it is opened, so that none is a dependency of the package."""

from __future__ import annotations

import importlib
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Protocol

from ...config import ConfigError, suggestion
from ..profile import Row

Receive = Callable[[Row, Any], None]  #: from any thread; never raises


class Backend(Protocol):
    """What the bridge wants from a transport."""

    name: str
    max_rate: float  #: messages per second of one topic and of real time that it carries well
    stamp: int  #: time of the simulation [ns since 1970]: the bridge keeps it

    def open(self, out: Sequence[Row], incoming: Sequence[Row], receive: Receive) -> None:
        """Advertise and subscribe; ``receive`` is called with every message that comes in, as nested dicts and lists.

        Raises
        ------
        ConfigError
            if something is missing: a library, a message type, a free port.
        """

    def publish(self, row: Row, message: Any) -> None:
        """Send one message; never blocks for long, never raises."""

    def step(self) -> None:
        """All messages of a step have been published."""

    def peers(self) -> int:
        """How many listen to us, as far as the transport knows; -1 if it cannot know."""

    def counters(self) -> Mapping[str, int]:
        """What went wrong so far, by reason."""

    def close(self) -> None:
        """Let go of everything."""


BACKENDS: dict[str, tuple[str, str]] = {
    "ros2": ("ros2:Ros2", "rclpy, of a ROS 2 installation"),
    "ros1": ("ros1:Ros1", "rospy"),
    "nmea": ("nmea:Nmea", "NMEA 0183 over UDP and TCP"),
    "mcap": ("mcap:Mcap", "a file that ROS 2 tools and Foxglove open"),
    "memory": ("memory:Memory", "functions of the same process"),
}


def make_backend(name: str, options: Mapping[str, str] | None = None) -> Backend:
    """A backend by name, with its options as texts.

    Raises
    ------
    ConfigError
        for an unknown name or option.
    """
    if name not in BACKENDS:
        raise ConfigError(f"unknown backend {name!r}{suggestion(name, BACKENDS)}")
    module, _, kind = BACKENDS[name][0].partition(":")
    cls = getattr(importlib.import_module(f"{__name__}.{module}"), kind)
    known = cls.OPTIONS
    for key in options or {}:
        if key not in known:
            raise ConfigError(f"backend {name}: unknown option {key!r}{suggestion(key, known)}")
    backend: Backend = cls(**(options or {}))
    return backend
