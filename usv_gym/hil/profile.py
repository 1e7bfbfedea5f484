"""Profiles: tables of rows that say which topic carries what, in which type, how often, and in which units.

A profile is a YAML file (``configs/profiles`` ships three).  docs/hil.md lists signals, commands and their names.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, Any, Literal

from pydantic import Field

from ..config import ConfigError, Document, Model, locate, parse_yaml, read_yaml, suggestion, validate
from .fields import names_in
from .vocabulary import COMMANDS, COMMON, ITEMS, SIGNALS

Seconds = Annotated[float, Field(ge=0.0, le=3600.0)]


class Trouble(Model):
    """What may happen to the messages of a topic on their way."""

    delay: Seconds = 0.0  #: [s] of simulated time
    jitter: Seconds = 0.0  #: [s] more, at random: uniform in [0, jitter]
    loss: float = Field(default=0.0, ge=0.0, le=1.0)  #: share that gets lost

    def __bool__(self) -> bool:
        return self.delay > 0.0 or self.jitter > 0.0 or self.loss > 0.0


class Row(Model):
    """One topic."""

    topic: str
    direction: Literal["out", "in"] = "out"
    type: str = Field(description="package/Message, or the name of an NMEA sentence with its talker, as GPGGA")
    signal: str = Field(default="", description="what an outgoing row tells")
    command: str = Field(default="", description="what an incoming row asks for")
    rate: float | None = Field(default=None, gt=0, description="[Hz] at most; none: whenever the signal is new")
    fields: Any = Field(default_factory=dict, description="of the message; NMEA: a list")
    items: dict[str, Any] = Field(default_factory=dict, description="the list in the message -> fields of each item")
    required: bool = Field(default=True, description="lock-step waits for this row, if its command is the one in use")
    match: str = Field(
        default="", description="value that, if given, must be the stamp or the number of the step (lock-step)"
    )
    delay: Seconds = 0.0
    jitter: Seconds = 0.0
    loss: float = Field(default=0.0, ge=0.0, le=1.0)

    def __hash__(self) -> int:
        return id(self)  # each row is itself, whatever it says

    @property
    def trouble(self) -> Trouble:
        """What the profile itself does to the messages of this row."""
        return Trouble(delay=self.delay, jitter=self.jitter, loss=self.loss)


class Profile(Model):
    """A table of topics."""

    description: str = ""
    backends: tuple[str, ...] = Field(default=(), description="that can carry it; none: all")
    control: Literal["actuators", "heading_speed", "demand"] = Field(
        default="actuators", description="the command that steers, unless the user says otherwise"
    )
    rows: tuple[Row, ...]


def load_profile(name: str, overrides: Sequence[str] = ()) -> Profile:
    """A profile that ships, by name, or one in a YAML file.

    Raises
    ------
    ConfigError
        for an unknown name, signal, command, unit or value: one line that says where.
    """
    document = read_yaml(locate("profiles", name)).override(overrides)
    profile = validate(Profile, document)
    for k, row in enumerate(profile.rows):
        _check(row, document.where(("rows", k)))
    return profile


def profile_from_text(text: str, name: str = "profile") -> Profile:
    """A profile from YAML text."""
    document = parse_yaml(text, name)
    profile = validate(Profile, document)
    for k, row in enumerate(profile.rows):
        _check(row, document.where(("rows", k)))
    return profile


def _check(row: Row, where: str) -> None:
    if row.direction == "out":
        if row.signal not in SIGNALS:
            raise ConfigError(f"{where}.signal: unknown signal {row.signal!r}{suggestion(row.signal, SIGNALS)}")
        _check_names(row.fields, {*COMMON, *SIGNALS[row.signal]}, f"{where}.fields")
        for key, fields in row.items.items():
            if row.signal not in ITEMS:
                raise ConfigError(f"{where}.items: signal {row.signal!r} is no list; lists are {', '.join(ITEMS)}")
            _check_names(fields, {*COMMON, *SIGNALS[ITEMS[row.signal]]}, f"{where}.items.{key}")
    else:
        if row.command not in COMMANDS:
            raise ConfigError(f"{where}.command: unknown command {row.command!r}{suggestion(row.command, COMMANDS)}")
        _check_names(row.fields, {"answers", *COMMANDS[row.command]}, f"{where}.fields")
    if not row.topic or any(c.isspace() for c in row.topic):
        raise ConfigError(f"{where}.topic: expected a name without spaces, got {row.topic!r}")


def _check_names(fields: Any, known: set[str], where: str) -> None:
    for name in names_in(_plain(fields), where):
        if name not in known:
            raise ConfigError(f"{where}: unknown name {name!r}{suggestion(name, sorted(known))}")


def _plain(fields: Any) -> Any:
    """Fields without the formats of NMEA (`name [unit] %.2f`)."""
    from .backends.nmea_fields import without_format

    return [without_format(part) for part in fields] if isinstance(fields, list | tuple) else fields


def parse_trouble(text: str) -> tuple[str, Trouble]:
    """``topic:delay=0.1,jitter=0.05,loss=0.01`` as given on the command line; ``*`` is every topic.

    Raises
    ------
    ConfigError
        if it is written in another way.
    """
    topic, colon, rest = text.rpartition(":")
    pairs = [part.partition("=") for part in rest.split(",")]
    try:
        values = {key.strip(): float(value) for key, _, value in pairs}
    except ValueError:
        values = {}
    if not colon or not topic or not values:
        raise ConfigError(f"--inject {text!r}: expected TOPIC:delay=0.1,jitter=0.05,loss=0.01")
    return topic, validate(Trouble, Document(f"--inject {text!r}", values))
