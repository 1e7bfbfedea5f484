"""A recording that ROS 2 tools and Foxglove open: every message in both directions, stamped with simulated time.

Written by rosbags, so that no ROS is needed.  The file appears when it is closed, whole.
"""

from __future__ import annotations

import os
import re
import shutil
import threading
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from ...config import ConfigError
from ...resources import ros
from ..profile import Row
from . import Receive
from .nmea_fields import sentence, sentence_encoder


class Mcap:
    """Writes ``file``; listens to nothing."""

    name = "mcap"
    max_rate = float("inf")
    OPTIONS: ClassVar[dict[str, str]] = {"file": "FILE.mcap"}

    def __init__(self, file: str = "") -> None:
        """Check the place; nothing is written yet."""
        if not file:
            raise ConfigError("backend mcap: expected file=FILE.mcap")
        self.file = Path(file)
        if self.file.is_dir():
            raise ConfigError(f"{file}: is a directory; expected a file for the recording")
        self._temporary = self.file.with_name(f".{self.file.name}.{os.getpid()}.tmp")
        self._lock = threading.Lock()
        self._writer: Any = None
        self.stamp = 0  #: time of the simulation [ns since 1970]

    def open(self, out: Sequence[Row], incoming: Sequence[Row], receive: Receive) -> None:
        """Begin the file, with a connection for every topic."""
        try:
            from rosbags.rosbag2 import StoragePlugin, Writer
            from rosbags.typesys import Stores, get_typestore
        except ImportError as error:
            raise ConfigError(f"a recording in MCAP needs rosbags ({error}): pip install 'usv-gym[hil]'") from None
        store = get_typestore(Stores.ROS2_KILTED)
        _register(store)
        try:
            self.file.parent.mkdir(parents=True, exist_ok=True)
            shutil.rmtree(self._temporary, ignore_errors=True)
            self._writer = Writer(self._temporary, version=9, storage_plugin=StoragePlugin.MCAP)
            self._writer.open()
        except OSError as error:
            raise ConfigError(f"{self.file}: cannot be written: {error.strerror or error}") from None
        self._store = store
        self._rows: dict[Row, tuple[Any, str, Callable[[Any], Any]]] = {}
        connections: dict[tuple[str, str], Any] = {}
        for row in (*out, *incoming):
            text = isinstance(row.fields, list | tuple)
            kind = "std_msgs/msg/String" if text else _kind(row.type)
            topic = f"/nmea/{row.topic}" if text else f"/{row.topic.lstrip('/')}"
            if kind not in store.fielddefs:
                raise ConfigError(f"{row.topic}: message type {row.type!r} is not known")
            if (topic, kind) not in connections:
                connections[topic, kind] = self._writer.add_connection(topic, kind, typestore=store)
            build = _sentences(row, row in out, store) if text else _renamed(row.type, builder(store, kind))
            self._rows[row] = connections[topic, kind], kind, build

    def publish(self, row: Row, message: Any) -> None:
        """Append one message."""
        connection, kind, build = self._rows[row]
        made = build(message)
        with self._lock:
            if self._writer is not None:
                for one in made if isinstance(made, list) else [made]:
                    self._writer.write(connection, self.stamp, self._store.serialize_cdr(one, kind))

    heard = publish  #: what came in, too

    def step(self) -> None:
        """Nothing to flush."""

    def peers(self) -> int:
        """A file has no listeners."""
        return -1

    def counters(self) -> Mapping[str, int]:
        """Nothing can go wrong that is not raised."""
        return {}

    def close(self) -> None:
        """End the file and put it in its place."""
        with self._lock:
            if self._writer is None:
                return
            writer, self._writer = self._writer, None
            writer.close()
            os.replace(next(self._temporary.glob("*.mcap")), self.file)
            shutil.rmtree(self._temporary, ignore_errors=True)


ORIGINAL = "simulator_messages"  #: ROS 2 does not allow its names: MMSI and headingRate become mmsi and heading_rate


def _snake(name: str) -> str:
    return re.sub(r"(?<=[a-z])(?=[A-Z])", "_", name).lower()


def _kind(kind: str) -> str:
    package, _, name = kind.partition("/")
    return f"{package}/msg/{name[:1].upper() + name[1:] if package == ORIGINAL else name}"


def _renamed(kind: str, build: Callable[[Any], Any]) -> Callable[[Any], Any]:
    if not kind.startswith(f"{ORIGINAL}/"):
        return build
    return lambda message: build({_snake(name): value for name, value in message.items()})


def _register(store: Any) -> None:
    """Add the project's own message types."""
    from rosbags.typesys import get_types_from_msg

    types: dict[str, Any] = {}
    for path in sorted(ros().glob("*/msg/*.msg")):
        text = path.read_text().replace("\nHeader ", "\nstd_msgs/Header ")
        text = f"std_msgs/{text}" if text.startswith("Header ") else text
        if path.parts[-3] == ORIGINAL:
            lines = (line.partition(" ") for line in text.splitlines())
            text = "\n".join(f"{kind} {_snake(name)}" for kind, _, name in lines)
        types.update(get_types_from_msg(text, _kind(f"{path.parts[-3]}/{path.stem}")))
    store.register(types)


def builder(store: Any, kind: str) -> Callable[[Any], Any]:
    """A function from nested dicts to a message of rosbags; what is not given is zero."""
    from rosbags.interfaces import Nodetype

    base: dict[str, Callable[..., Any]] = {"string": str, "bool": bool}

    def field(node: Any) -> Callable[[Any], Any]:
        what, detail = node
        if what == Nodetype.BASE:
            kind_of = base.get(detail[0], float if detail[0].startswith("float") else int)
            return lambda value: kind_of() if value is None else kind_of(value)
        if what == Nodetype.NAME:
            if detail in ("builtin_interfaces/msg/Time", "builtin_interfaces/msg/Duration"):
                cls = store.types[detail]
                return lambda value: cls(*divmod(int(value or 0), 1_000_000_000))
            return builder(store, detail)
        (inner, inner_detail), length = detail
        size = length if what == Nodetype.ARRAY else 0
        if inner == Nodetype.BASE and inner_detail[0] != "string":
            dtype = np.dtype({"bool": "bool", "byte": "u1", "char": "u1"}.get(inner_detail[0], inner_detail[0]))

            def numbers(value: Any) -> Any:
                array = np.zeros(size if value is None else max(size, len(value)), dtype)
                if value is not None:
                    array[: len(value)] = value
                return array

            return numbers
        make = field((inner, inner_detail))
        return lambda value: [make(None) for _ in range(size)] if value is None else [make(item) for item in value]

    cls = store.types[kind]
    fields = [(name, field(node)) for name, node in store.fielddefs[kind][1]]

    def build(message: Any) -> Any:
        given = message or {}
        return cls(*(make(given.get(name)) for name, make in fields))

    return build


def _sentences(row: Row, out: bool, store: Any) -> Callable[[Any], Any]:
    """A function from what NMEA carries to messages with the sentences as text."""
    text = store.types["std_msgs/msg/String"]
    if not out:
        return lambda fields: [text(sentence(",".join([row.type, *fields])))]
    if row.signal == "ais":
        return lambda values: [text(line) for line in values["sentences"]]
    encode = sentence_encoder(row)
    return lambda values: [text(encode(values))]
