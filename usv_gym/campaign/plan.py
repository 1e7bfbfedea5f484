"""What a campaign is made of, checked before anything is flown, and where it lives on disk.

``DIR/campaign.json`` says what the rows of ``DIR/episodes.jsonl`` were made of.  A row is written once it is known and never
again; an interrupted campaign goes on where it was, and one with more seeds or policies adds to what is there.
"""

from __future__ import annotations

import contextlib
import functools
import hashlib
import importlib.metadata
import json
import platform
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, BinaryIO

from ..colregs.params import PROFILES
from ..config import ConfigError, read_yaml, suggestion
from ..policies import POLICIES, THRUST_LOG, is_custom, make_policy
from ..policies.custom import source_of
from ..replay.archive import replacing
from ..resources import shipped
from ..scenarios.suites import Case, Seeds, Suite, load_suite
from ..voyage import task_of
from .flight import Flight, Result, scenario_of

FORMAT, VERSION = "usv-campaign", 1
JUDGE = "usv_gym.campaign.evidence:Judgement"


@dataclass(frozen=True)
class Campaign:
    """Cases times policies times seeds."""

    suite: str
    description: str
    cases: tuple[Case, ...]
    policies: tuple[str, ...]
    seeds: tuple[int, ...]
    vessel: str | None = None
    trust: bool = False
    step_limit: float = 2.0
    profile: str = "scaled"  #: of the judge's parameters
    only: frozenset[tuple[str, int | None]] = field(default_factory=frozenset)  #: (case, seed or None): fly no other
    source: str = ""  #: what the suite was called by: its name or path

    def wanted(self, case: str, seed: int) -> bool:
        """Whether an episode is to be flown."""
        return not self.only or (case, None) in self.only or (case, seed) in self.only

    def flights(self, done: frozenset[tuple[str, str, int]] | set[tuple[str, str, int]]) -> Iterator[Flight]:
        """What is left to fly."""
        for case in self.cases:
            for policy in self.policies:
                seeds = tuple(s for s in self.seeds if self.wanted(case.id, s) and (policy, case.id, s) not in done)
                if seeds:
                    yield Flight(policy, case, seeds, self.vessel, self.trust, self.step_limit, JUDGE,
                                 {"profile": self.profile})  # fmt: skip

    def identity(self) -> dict[str, Any]:
        """What the results depend on, by part: rows of one directory agree in all that they share."""
        parts = {f"policy {name}": policy_hash(name) for name in self.policies}
        for case in self.cases:
            data = scenario_of(case, self.vessel).dump()
            parts[f"case {case.id}"] = _sha(json.dumps(data, sort_keys=True).encode())
        return {"code of usv_gym": code_hash(), "profile of the judge": self.profile,
                "time limit of a step": f"{self.step_limit:g} s", **parts}  # fmt: skip


def plan_campaign(
    suite: str,
    policies: Sequence[str],
    *,
    seeds: int | None = None,
    first_seed: int | None = None,
    only: Sequence[str] = (),
    overrides: Sequence[str] = (),
    vessel: str | None = None,
    trust: bool = False,
    step_limit: float = 2.0,
    profile: str = "scaled",
) -> Campaign:
    """Read everything that a campaign needs, so that nothing can fail half-way for want of a file.

    ``suite`` is a suite, or a scenario or family that stands for a suite of one case.  ``only`` are ``CASE`` or ``CASE:SEED``.

    Raises
    ------
    ConfigError
        for anything that is wrong.
    """
    found = read_suite(suite)
    first = found.seeds.first if first_seed is None else first_seed
    number = found.seeds.number if seeds is None else seeds
    if number < 1 or first < 0:
        raise ConfigError(f"seeds: expected at least 1 from 0 on, got {number} from {first}")
    if step_limit <= 0.0:
        raise ConfigError(f"step limit: expected more than 0 s, got {step_limit:g}")
    if profile not in PROFILES:
        raise ConfigError(f"unknown profile {profile!r} of the judge{suggestion(profile, PROFILES)}")
    cases = tuple(replace_case(case, overrides) for case in found.cases)
    for case in cases:
        try:
            scenario_of(case, vessel)
        except ConfigError as error:
            raise ConfigError(f"case {case.id}: {error}") from None
    if len(set(policies)) != len(policies) or not policies:
        raise ConfigError("policy: expected at least one, and none twice")
    for name in policies:
        if name == THRUST_LOG:
            raise ConfigError(f"policy {THRUST_LOG!r} drives blindly and is no controller; expected one of "
                              f"{', '.join(POLICIES)}, or one of your own")  # fmt: skip
        task_of(make_policy(name, trust=trust))
    chosen = frozenset(_only(text, [case.id for case in cases]) for text in only)
    more = sorted(seed for _, seed in chosen if seed is not None)
    numbers = tuple(range(first, first + number))
    if chosen and all(seed is not None for _, seed in chosen):
        numbers = tuple(dict.fromkeys(more))
    return Campaign(found.name, found.description, cases, tuple(policies), numbers, vessel, trust, step_limit, profile, chosen,
                    suite)  # fmt: skip


def replace_case(case: Case, overrides: Sequence[str]) -> Case:
    """A case with more overrides."""
    return case.model_copy(update={"overrides": (*case.overrides, *overrides)}) if overrides else case


def read_suite(name: str) -> Suite:
    """A suite by name or path, or the one case that a scenario's name or path stands for."""
    suites, scenarios = shipped("suites"), shipped("scenarios")
    is_file = Path(name).suffix in (".yaml", ".yml") and Path(name).is_file()
    if name in suites or (is_file and "cases" in read_yaml(name).data):
        return load_suite(name)
    key = name if name in scenarios else name.replace("-", "_")
    if key in scenarios or is_file or Path(name).is_dir():
        source = key if key in scenarios else str(Path(name).resolve())
        return Suite(name=Path(name).stem, description="", seeds=Seeds(), cases=(Case(id=Path(key).stem, scenario=source),))
    raise ConfigError(f"unknown suite or scenario {name!r}{suggestion(name, [*suites, *scenarios])}")


def _only(text: str, cases: Sequence[str]) -> tuple[str, int | None]:
    case, colon, seed = text.rpartition(":")
    if not colon:
        case, seed = text, ""
    if case not in cases:
        raise ConfigError(f"--only {text}: the suite has no case {case!r}{suggestion(case, cases)}")
    if seed and not seed.isdecimal():
        raise ConfigError(f"--only {text}: expected CASE or CASE:SEED, with a whole number as seed")
    return case, int(seed) if seed else None


# --- identity --------------------------------------------------------------------------------------------------------
def _sha(data: bytes) -> str:
    return hashlib.sha256(data).hexdigest()[:16]


@functools.cache
def code_hash() -> str:
    """Hash over all code of the package."""
    package = Path(__file__).resolve().parents[1]
    digest = hashlib.sha256()
    for path in sorted(package.rglob("*.py")):
        digest.update(path.relative_to(package).as_posix().encode() + path.read_bytes())
    return digest.hexdigest()[:16]


def policy_hash(name: str) -> str:
    """Hash of the file that a policy comes from; of a built-in one, "built in"."""
    if name in POLICIES:
        return "built in"
    data = source_of(name) if is_custom(name) else Path(name).read_bytes()
    return "unknown" if data is None else _sha(data)


def versions() -> dict[str, str]:
    """Versions of what the results depend on."""
    from .. import __version__

    return {"usv_gym": __version__, "python": platform.python_version(),
            **{name: importlib.metadata.version(name) for name in ("numpy", "numba")}}  # fmt: skip


# --- on disk ---------------------------------------------------------------------------------------------------------
class Journal:
    """The rows of a campaign in a directory: ``campaign.json`` and ``episodes.jsonl``.

    Raises
    ------
    ConfigError
        if the directory cannot be used, or holds results of something else.
    """

    def __init__(self, directory: Path, campaign: Campaign) -> None:
        self.directory = directory
        if directory.exists() and not directory.is_dir():
            raise ConfigError(f"{directory}: is a file; expected a directory for the results")
        before = read_meta(directory) if (directory / "campaign.json").exists() else None
        if before is None and (directory / "episodes.jsonl").exists():
            raise ConfigError(f"{directory}: has episodes.jsonl but no campaign.json; give another --out")
        identity = campaign.identity()
        known = before["identity"] if before else {}
        changed = [part for part in identity if part in known and known[part] != identity[part]]
        if before is not None and before["suite"] != campaign.suite:
            raise ConfigError(f"{directory}: holds a campaign of {before['suite']!r}, not of {campaign.suite!r}; "
                              "give another --out")  # fmt: skip
        if changed:
            raise ConfigError(f"{directory}: holds results of another {changed[0]} "
                              f"({known[changed[0]]}, now {identity[changed[0]]}); give another --out")  # fmt: skip
        self.meta = _meta(campaign, {**known, **identity}, before)
        try:
            with replacing(directory / "campaign.json") as file:
                file.write(json.dumps(self.meta, indent=1).encode() + b"\n")
            self.rows = list(_read_rows(directory / "episodes.jsonl", mend=True))
        except OSError as error:
            raise ConfigError(f"{directory}: cannot be written: {error.strerror or error}") from None
        self.done = {(row["policy"], row["case"], row["seed"]) for row in self.rows}

    @contextlib.contextmanager
    def writing(self) -> Iterator[Any]:
        """A function that appends a result; the line is with the operating system when it returns."""
        with (self.directory / "episodes.jsonl").open("ab", buffering=0) as file:
            with contextlib.suppress(ImportError):  # no such locks on Windows
                import fcntl

                try:
                    fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
                except OSError:
                    raise ConfigError(f"{self.directory}: another campaign is being flown into it") from None

            def write(result: Result) -> None:
                row = flat(result)
                _append(file, row)
                self.rows.append(row)
                self.done.add(result.key)

            yield write


def _append(file: BinaryIO, row: Mapping[str, Any]) -> None:
    file.write(json.dumps(row, allow_nan=False, separators=(",", ":")).encode() + b"\n")


def flat(result: Result) -> dict[str, Any]:
    """A result as one flat row, with ``encounters`` last."""
    row = result.plain()
    seen = dict(row.pop("seen"))
    encounters = seen.pop("encounters", [])
    return {**row, **{key: value for key, value in seen.items() if key not in row}, "encounters": encounters}


def _meta(campaign: Campaign, identity: Mapping[str, Any], before: Mapping[str, Any] | None) -> dict[str, Any]:
    cases = {case.id: case.model_dump(mode="json", exclude_none=True) for case in campaign.cases}
    policies = [*(before["policies"] if before else []), *campaign.policies]
    seeds = sorted({*(before["seeds"] if before else []), *campaign.seeds})
    return {
        "format": FORMAT, "version": VERSION, "suite": campaign.suite, "source": campaign.source,
        "description": campaign.description,
        "policies": list(dict.fromkeys(policies)), "seeds": seeds,
        "cases": {**(before["cases"] if before else {}), **cases}, "vessel": campaign.vessel,
        "step_limit": campaign.step_limit, "profile": campaign.profile, "trust": campaign.trust,
        "identity": dict(identity), "versions": versions(),
    }  # fmt: skip


def read_meta(directory: Path) -> dict[str, Any]:
    """``campaign.json`` of a directory of results.

    Raises
    ------
    ConfigError
        if there is none, or one of another format.
    """
    path = directory / "campaign.json"
    try:
        meta = json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise ConfigError(f"{directory}: holds no campaign (no campaign.json)") from None
    except (OSError, ValueError) as error:
        raise ConfigError(f"{path}: cannot be read: {error}") from None
    if not isinstance(meta, dict) or meta.get("format") != FORMAT or meta.get("version") != VERSION:
        raise ConfigError(f"{path}: expected {FORMAT} version {VERSION}")
    return meta


def _read_rows(path: Path, *, mend: bool = False) -> Iterator[dict[str, Any]]:
    """The rows of a journal; a last line that was not written whole is no row, and with ``mend`` is cut off."""
    if not path.exists():
        return
    data = path.read_bytes()
    whole = data.rfind(b"\n") + 1
    if mend and whole < len(data):
        with path.open("r+b") as file:
            file.truncate(whole)
    for number, line in enumerate(data[:whole].splitlines(), start=1):
        try:
            yield json.loads(line)
        except ValueError:
            raise ConfigError(f"{path}:{number}: is no row of a campaign") from None


def read_campaign(directory: Path) -> tuple[dict[str, Any], list[dict[str, Any]]]:
    """What a campaign was made of, and its rows sorted by policy, case and seed.

    Raises
    ------
    ConfigError
        if the directory holds no campaign.
    """
    meta = read_meta(directory)
    return meta, in_order(meta, list(_read_rows(directory / "episodes.jsonl")))


def in_order(meta: Mapping[str, Any], rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Rows sorted by policy, case (both as in the campaign) and seed."""
    policy = {name: i for i, name in enumerate(meta["policies"])}
    case = {name: i for i, name in enumerate(meta["cases"])}
    return sorted(rows, key=lambda row: (policy[row["policy"]], case[row["case"]], row["seed"]))


__all__ = ["Campaign", "Journal", "in_order", "plan_campaign", "read_campaign", "read_suite"]
