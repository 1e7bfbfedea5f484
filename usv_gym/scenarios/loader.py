"""From a name, a file, the thesis's files or a dict to a frozen :class:`Scenario`."""

from __future__ import annotations

import math
import warnings
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, TypeAlias

from ..config import ConfigError, Document, locate, read_yaml, validate
from ..world.vessel import load_vessel
from .events import unfit
from .schema import DT, Preset, Scenario
from .thesis_format import convert, kind_of, read_thesis

Source: TypeAlias = "str | Path | Sequence[str | Path] | Mapping[str, Any] | Scenario"


class SensorRateWarning(UserWarning):
    """A sensor is asked to fire more often than there are ticks."""


def load_scenario(
    source: Source, *, overrides: Sequence[str] = (), vessel: str | None = None, preset: Preset | None = None
) -> Scenario:
    """Read a scenario.

    Parameters
    ----------
    source
        a name that ships in ``configs/scenarios``; the path of a native YAML file, or of a DNV traffic situation (.json);
        the thesis's own files, as a directory or as paths in any order; a mapping with the native keys; or a scenario, to
        override.
    overrides
        ``key.path=value`` each, in native keys, with the value as in YAML: ``"ships.ferry.waypoints.0=[100, 0]"``.
    vessel, preset
        short for overriding ``own_ship.vessel`` and ``preset``.

    Raises
    ------
    ConfigError
        one line per problem, with file, line, key path, what was expected and what came.

    Warns
    -----
    SensorRateWarning
        once, if sensors are faster than the tick: they fire every tick, as in the original.  The rates that the thesis
        itself asks for at its own tick (MRU, IMU and wind) pass silently in native scenarios.
    """
    document, has_dynamics_file = _document(source)
    document = _names_as_mappings(document).override(overrides)
    for path, value in ((("own_ship", "vessel"), vessel), (("preset",), preset)):
        if value is not None:
            document = document.replaced(path, value, f"argument {path[-1]}={value!r}")
    scenario = validate(Scenario, document)
    model = load_vessel(scenario.own_ship.vessel)
    if scenario.family is not None:
        # what the family would choose, where the file does not
        if "duration" not in document.data.get("simulation", {}):
            seconds = float(math.ceil(scenario.family.duration(model)))
            document = document.replaced(("simulation", "duration"), seconds, "family")
        if "scale" not in document.data:
            document = document.replaced(("scale",), scenario.family.scale(model), "family")
        if "weather" in document.data and "weather" not in document.data["family"]:
            document = document.replaced(("family", "weather"), "scenario", "family")
        scenario = validate(Scenario, document)
    if scenario.own_ship.memory and model.fluid_memory is None:
        raise ConfigError(f"{document.where(('own_ship', 'memory'))}: vessel {model.name!r} has no fluid_memory")
    for i, event in enumerate(scenario.events):
        if wrong := unfit(event, model):
            raise ConfigError(f"{document.where(('events', i, wrong[0]))}: {wrong[1]}")
    _warn_of_fast_sensors(scenario, None if has_dynamics_file else Scenario())
    return scenario


def _document(source: Source) -> tuple[Document, bool]:
    """The data of a native scenario, and whether a dynamics file of the thesis asked for its rates."""
    if isinstance(source, Scenario):
        return Document(source.name or "scenario", source.dump()), False
    if isinstance(source, Mapping):
        return _on_base(Document("scenario", dict(source))), False
    if not isinstance(source, str | Path):
        paths = list(source)
        if not paths:
            raise ConfigError("scenario: expected a name, a path, paths or a mapping, got an empty list")
        return _document(paths[0]) if len(paths) == 1 else _converted(read_thesis(paths))
    if Path(source).is_dir():
        return _converted(read_thesis([source]))
    if Path(source).suffix == ".json":
        from .dnv import read_situation

        return read_situation(source), False
    is_file = Path(source).suffix in (".yaml", ".yml") or Path(source).is_file()
    path = Path(source) if is_file else locate("scenarios", str(source))
    document = read_yaml(path)
    if kind_of(document.data) is not None:
        return _converted(convert([document], name=str(path)))
    if not document.data.get("name"):
        document.data["name"] = path.stem
    return _on_base(document), False


def _on_base(document: Document, above: tuple[str, ...] = ()) -> Document:
    """A document with what it does not say from its ``base``, and from the base of that."""
    name = document.data.get("base")
    if name is None:
        return document
    if not isinstance(name, str):
        raise ConfigError(f"{document.where(('base',))}: expected the name or path of a scenario, got {name!r}")
    try:
        path = locate("scenarios", name, document.directory)
    except ConfigError as error:
        raise ConfigError(f"{document.where(('base',))}: {error}") from None
    if str(path) in above:
        raise ConfigError(f"{document.where(('base',))}: a scenario cannot be its own base")
    below = _names_as_mappings(_on_base(read_yaml(path), (*above, str(path))))
    ours = _names_as_mappings(document) if "sensors" in document.data else document
    rest = {key: value for key, value in ours.data.items() if key != "base"}
    return Document(document.name, _merged(below.data, rest), {**below.origins, **document.origins}, document.directory)


def _merged(below: Mapping[str, Any], above: Mapping[str, Any]) -> dict[str, Any]:
    """Two mappings as one: what is above wins, mappings in both are merged in turn."""
    both = {key: _merged(below[key], value) if isinstance(value, Mapping) and isinstance(below.get(key), Mapping) else value
            for key, value in above.items()}  # fmt: skip
    return {**below, **both}


def _converted(document: Document) -> tuple[Document, bool]:
    return document, ("simulation",) in document.origins


def _names_as_mappings(document: Document) -> Document:
    """``sensors: thesis`` as ``sensors: {base: thesis}``, so that ``sensors.radar.range=500`` can be written there.

    The same for ``family: open_sea`` and ``family.difficulty``.
    """
    data = document.data
    named = {key: {word: data.get(key, default)} for key, word, default in (
        ("sensors", "base", "thesis"), ("family", "name", None)) if isinstance(data.get(key, default), str)}  # fmt: skip
    return Document(document.name, {**data, **named}, document.origins, document.directory) if named else document


def _warn_of_fast_sensors(scenario: Scenario, usual: Scenario | None) -> None:
    fast = scenario.faster_than_tick()
    if usual is not None and scenario.simulation.dt <= DT:
        known = usual.sensor_rates()
        fast = {key: rate for key, rate in fast.items() if rate > known[key]}
    if fast:
        names = ", ".join(f"{key} ({rate:g} Hz)" for key, rate in fast.items())
        message = f"faster than the tick of {scenario.simulation.dt:g} s, so firing every tick: {names}"
        warnings.warn(message, SensorRateWarning, stacklevel=3)
