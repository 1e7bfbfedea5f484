"""Suites: named lists of scenarios with seeds, from ``configs/suites``.

A case is a scenario, for a family with a difficulty, with overrides if need be.  A file may say several cases at once: a
pattern like ``imazu/*`` stands for all shipped scenarios of that name, and a list of difficulties for one case each.
"""

from __future__ import annotations

import fnmatch
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Annotated, Any

from pydantic import BeforeValidator, Field

from ..config import ConfigError, Document, Model, locate, read_yaml, suggestion, validate
from ..resources import shipped

Unit = Annotated[float, Field(strict=True, ge=0, le=1)]
ScenarioName = str | dict[str, Any]


class Seeds(Model):
    """Which seeds every case is run with, unless one asks for others."""

    first: Annotated[int, Field(strict=True, ge=0)] = 0
    number: Annotated[int, Field(strict=True, ge=1)] = 10

    @property
    def range(self) -> range:
        """The seeds."""
        return range(self.first, self.first + self.number)


class Case(Model):
    """One case: a scenario by name, path or mapping, and how it is to be changed."""

    id: str = Field(min_length=1, description="unique in its suite")
    scenario: ScenarioName
    difficulty: Unit | None = Field(default=None, description="of a family; none: the scenario's own")
    overrides: tuple[str, ...] = Field(default=(), description="KEY=VALUE on the scenario")


class Suite(Model):
    """A named list of cases, to be run with these seeds by default."""

    name: str
    description: str
    seeds: Seeds
    cases: tuple[Case, ...]


# --- what a file says ------------------------------------------------------------------------------------------------
def _as_list(value: Any) -> Any:
    return value if isinstance(value, list | tuple) else [value]


class Entry(Model):
    """One or several cases, as a file says them; a scenario's name alone will do."""

    id: str | None = Field(default=None, min_length=1, description="default: the scenario's name")
    scenario: ScenarioName
    difficulty: Annotated[tuple[Unit, ...], BeforeValidator(_as_list)] | None = Field(
        default=None, description="one number, or a list: a case each"
    )
    overrides: tuple[str, ...] = ()


class SuiteFile(Model):
    """A file in ``configs/suites``."""

    name: str = ""
    description: str = ""
    seeds: Seeds = Seeds()
    cases: tuple[
        Annotated[Entry, BeforeValidator(lambda item: {"scenario": item} if isinstance(item, str) else item)], ...
    ]


def load_suite(source: str | Path | Mapping[str, Any]) -> Suite:
    """Read a suite by the name of a shipped file (``"imazu"``), by path, or from a mapping with the same keys.

    That every scenario exists is checked; what stands in it is checked when it is loaded.

    Raises
    ------
    ConfigError
        one line per problem.
    """
    if isinstance(source, Mapping):
        document = Document("suite", dict(source))
    else:
        path = locate("suites", str(source))
        document = read_yaml(path)
        document.data.setdefault("name", path.stem)
    file = validate(SuiteFile, document)
    if not file.cases:
        raise ConfigError(f"{document.where(('cases',))}: expected at least one case")
    cases: dict[str, Case] = {}
    for i, entry in enumerate(file.cases):
        try:
            for case in _cases(entry, document.directory):
                if case.id in cases:
                    raise ConfigError(f"the id {case.id!r} is there already; give one of the two an `id` of its own")
                cases[case.id] = case
        except ConfigError as error:
            raise ConfigError(f"{document.where(('cases', i))}: {error}") from None
    return Suite(name=file.name, description=file.description, seeds=file.seeds, cases=tuple(cases.values()))


def _cases(entry: Entry, directory: Path | None) -> Iterator[Case]:
    """The cases that an entry stands for."""
    scenarios = _scenarios(entry.scenario, directory)
    if entry.id and len(scenarios) > 1:
        raise ConfigError(f"{entry.scenario!r} stands for {len(scenarios)} scenarios, which cannot all be {entry.id!r}")
    for scenario in scenarios:
        for difficulty in entry.difficulty or (None,):
            name = entry.id or _short(scenario)
            if len(entry.difficulty or ()) > 1:
                name += f"-{difficulty:g}"
            yield Case(id=name, scenario=scenario, difficulty=difficulty, overrides=entry.overrides)


def _scenarios(scenario: ScenarioName, directory: Path | None) -> list[ScenarioName]:
    """The scenarios that a name or pattern stands for; paths are first looked for beside the suite's file."""
    known = shipped("scenarios")
    if not isinstance(scenario, str) or scenario in known:
        return [scenario]
    if any(letter in scenario for letter in "*?["):
        found: list[ScenarioName] = [*fnmatch.filter(known, scenario)]
        if not found:
            raise ConfigError(f"no scenario that ships matches {scenario!r}")
        return found
    for path in ([directory / scenario] if directory else []) + [Path(scenario)]:
        if path.exists():
            return [str(path.resolve())]
    raise ConfigError(f"unknown scenario {scenario!r}{suggestion(scenario, known)}")


def _short(scenario: ScenarioName) -> str:
    if not isinstance(scenario, str):
        return str(scenario.get("name") or "scenario")
    return scenario if scenario in shipped("scenarios") else Path(scenario).stem
