"""Scripted checks: what a ``check_*.yaml`` may say, read and validated before anything is flown."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal, Self

from pydantic import BeforeValidator, Field, model_validator

from ..colregs.params import PROFILES, Params
from ..colregs.requirements import CATALOGUE, Requirement, read_requirements
from ..config import ConfigError, Document, KeyPath, Model, problem, read_yaml, suggestion, validate
from ..policies import POLICIES, is_custom
from ..scenarios.schema import Scenario
from ..scenarios.suites import Case, Unit
from .flight import Flight, scenario_of

#: what an assertion may say: its key, and the keys that go with it
ASSERTIONS: dict[str, tuple[str, ...]] = {
    "never_closer_than": ("to",),
    "route_done_before": (),
    "outcome": (),
    "passes": ("of",),
    "detects": ("before_range",),
    "score": ("at_least", "of"),
    "stl": ("of",),
}
Side = Literal["port_to_port", "starboard_to_starboard", "ahead", "astern"]
ScoreName = Literal["safety", "r8", "r13", "r14", "r15", "r16", "r17"]
Distance = Annotated[float, Field(ge=0)]


class Assertion(Model):
    """One statement about every episode of a check."""

    never_closer_than: Distance | None = Field(default=None, description="[m] hull to hull")
    to: str | None = Field(default=None, description="id of a ship or obstacle; none: anything, land too")
    route_done_before: Annotated[float, Field(gt=0)] | None = Field(default=None, description="[s]")
    outcome: Literal["arrival", "collision", "grounding", "out_of_area", "time_limit"] | None = None
    passes: Side | None = Field(default=None, description="where the own ship passes a ship")
    of: str | None = Field(default=None, description="id of the ship; none: every ship")
    detects: str | None = Field(default=None, description="id of a ship that the own ship's picture is to hold")
    before_range: Distance | None = Field(default=None, description="[m] centre to centre")
    score: ScoreName | None = None
    at_least: Annotated[float, Field(ge=0, le=1)] | None = None
    stl: str | None = Field(default=None, description="a formula; docs/verdict.md has the signals")

    @model_validator(mode="after")
    def _says_one_thing(self) -> Self:
        said = [key for key in ASSERTIONS if getattr(self, key) is not None]
        if len(said) != 1:
            raise problem(f"expected one of {', '.join(ASSERTIONS)}; got {' and '.join(said) or 'none'}")
        allowed = ASSERTIONS[said[0]]
        for key in ("to", "of", "before_range", "at_least"):
            if getattr(self, key) is not None and key not in allowed:
                raise problem(f"does not go with {said[0]}", key)
        for key in ("before_range", "at_least"):
            if key in allowed and getattr(self, key) is None:
                raise problem(f"{said[0]} needs {key}")
        if self.stl is not None:
            validate(Requirement, Document("formula", {"stl": self.stl}))
        return self

    @property
    def kind(self) -> str:
        """Its key."""
        return next(key for key in ASSERTIONS if getattr(self, key) is not None)

    @property
    def ship(self) -> str | None:
        """Id of what it is about, if of one thing."""
        return self.to or self.of or self.detects

    def __str__(self) -> str:
        more = "".join(f" {key} {getattr(self, key)}" for key in ASSERTIONS[self.kind] if getattr(self, key) is not None)
        return f"{self.kind} {getattr(self, self.kind)}{more}"


def _seeds(value: Any) -> Any:
    if isinstance(value, bool) or not isinstance(value, int | list | tuple):
        raise problem(f"expected how many, or a list of seeds, got {value!r}")
    return tuple(range(value)) if isinstance(value, int) else tuple(value)


class Check(Model):
    """One check: a controller in a scenario, what it has to fulfil."""

    description: str = ""
    scenario: str | dict[str, Any]
    difficulty: Unit | None = Field(default=None, description="of a family")
    overrides: tuple[str, ...] = Field(default=(), description="KEY=VALUE on the scenario")
    vessel: str | None = None
    policy: str = Field(description="as of `usv-gym run`; a path is looked for beside the file first")
    trust: bool = Field(default=False, strict=True, description="a policy file may execute its code")
    step_limit: float = Field(default=2.0, gt=0, description="[s] that one decision of one's own controller may take")
    seeds: Annotated[tuple[Annotated[int, Field(strict=True, ge=0)], ...], BeforeValidator(_seeds), Field(min_length=1)] = (0,)
    requirements: tuple[str, ...] = Field(default=(), description="ids; R14-* stands for all that begin so")
    parameters: Literal["scaled", "hagen2023", "ccta2023"] | Params = Field(
        default="scaled", union_mode="left_to_right", description="of encounters and scores"
    )
    asserts: tuple[Assertion, ...] = Field(default=(), alias="assert")
    pass_share: float = Field(default=1.0, ge=0, le=1, description="share of the episodes that have to fulfil everything")

    @model_validator(mode="after")
    def _asks_for_something(self) -> Self:
        if not self.requirements and not self.asserts:
            raise problem("asks for nothing: give requirements or assert")
        if len(set(self.seeds)) < len(self.seeds):
            raise problem("a seed is there twice", "seeds")
        return self


class CheckFile(Model):
    """A file of checks."""

    description: str = ""
    requirement_files: tuple[str, ...] = Field(default=(), description="files of requirements, beside `colregs`")
    requirements: dict[str, Requirement] = Field(default_factory=dict, description="more requirements, by id")
    checks: dict[str, Check] = Field(min_length=1)


@dataclass(frozen=True)
class Plan:
    """A check that is ready to fly, or why it is not."""

    file: Path
    name: str
    check: Check
    requirements: Mapping[str, Requirement]  #: those it asks for, by id
    error: str = ""  #: why it cannot be flown

    @property
    def id(self) -> str:
        """``file.yaml::name``."""
        return f"{self.file}::{self.name}"

    @property
    def params(self) -> Params:
        """Of encounters and scores."""
        given = self.check.parameters
        return given if isinstance(given, Params) else PROFILES[given]

    @property
    def policy(self) -> str:
        """The policy, with the path of a file as seen from here."""
        source, colon, rest = self.check.policy.partition(":")
        beside = self.file.parent / source
        return f"{beside}{colon}{rest}" if source not in POLICIES and beside.is_file() else self.check.policy

    @property
    def case(self) -> Case:
        """The scenario with what is changed in it; a path is seen from here."""
        check, scenario = self.check, self.check.scenario
        if isinstance(scenario, str) and (self.file.parent / scenario).exists() and Path(scenario).suffix:
            scenario = str(self.file.parent / scenario)
        return Case(id=self.id, scenario=scenario, difficulty=check.difficulty, overrides=check.overrides)

    def flight(self) -> Flight:
        """What to fly."""
        check = self.check
        return Flight(
            self.policy, self.case, check.seeds, check.vessel, check.trust, check.step_limit,
            "usv_gym.campaign.check_witness:CheckWitness",
            {"requirements": {id: one.dump() for id, one in self.requirements.items()},
             "asserts": [one.dump() for one in check.asserts], "params": self.params.dump()},
        )  # fmt: skip


def load_checks(path: str | Path) -> list[Plan]:
    """Read a file of checks.  A check whose scenario or policy does not exist is there, with its error.

    Raises
    ------
    ConfigError
        one line for everything that is wrong with the file itself.
    """
    document = read_yaml(path)
    file = validate(CheckFile, document)
    known = dict(read_requirements(CATALOGUE))
    for k, name in enumerate(file.requirement_files):
        try:
            known |= read_requirements(name, document.directory)
        except ConfigError as error:
            raise ConfigError(f"{document.where(('requirement_files', k))}: {error}") from None
    if taken := [id for id in file.requirements if id in known]:
        raise ConfigError(f"{document.where(('requirements', taken[0]))}: this id is taken already")
    known |= file.requirements
    plans = []
    for name, check in file.checks.items():
        at: KeyPath = ("checks", name)
        asked = dict(_asked(check, known, document, at))
        plan = Plan(Path(path), name, check, asked)
        plans.append(Plan(Path(path), name, check, asked, _obstacle_to_flying(plan, document, at)))
    return plans


def _asked(
    check: Check, known: Mapping[str, Requirement], document: Document, at: KeyPath
) -> Iterator[tuple[str, Requirement]]:
    for k, pattern in enumerate(check.requirements):
        ids = [pattern] if not pattern.endswith("*") else [id for id in known if id.startswith(pattern[:-1])]
        if not ids or ids[0] not in known:
            where = document.where((*at, "requirements", k))
            raise ConfigError(f"{where}: unknown requirement {pattern!r}{suggestion(pattern, known)}")
        for id in ids:
            yield id, known[id]


def _obstacle_to_flying(plan: Plan, document: Document, at: KeyPath) -> str:
    """What stands in the way of flying a check; "" for nothing."""
    policy = plan.policy
    if policy not in POLICIES and not is_custom(policy) and not Path(policy).is_file():
        return f"{document.where((*at, 'policy'))}: unknown policy {policy!r}{suggestion(policy, POLICIES)}"
    try:
        scenario = scenario_of(plan.case, plan.check.vessel)
    except ConfigError as error:
        return f"{document.where((*at, 'scenario'))}: {error}"
    return _unknown_ship(plan.check, scenario, document, at)


def _unknown_ship(check: Check, scenario: Scenario, document: Document, at: KeyPath) -> str:
    if scenario.family is not None:
        return ""  # what it draws is known once it is drawn
    ids = [*scenario.ships, *scenario.obstacles]
    for k, assertion in enumerate(check.asserts):
        if assertion.ship is not None and assertion.ship not in ids:
            where = document.where((*at, "assert", k))
            return f"{where}: nothing is called {assertion.ship!r}{suggestion(assertion.ship, ids)}"
    return ""
