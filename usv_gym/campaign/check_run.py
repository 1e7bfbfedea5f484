"""Fly checks and say what became of them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from ..config import ConfigError
from ..policies import POLICIES
from .checks import Plan, load_checks
from .flight import FAILED, Flight, Result
from .runner import Fleet, flights

FEW = 20  #: episodes of built-in policies that are flown in this process: workers take longer to start


@dataclass
class Verdict:
    """What became of a check, or of a file that could not be read."""

    file: Path
    plan: Plan | None  #: None: the file could not be read
    results: list[Result] = field(default_factory=list)  #: one per seed, in order
    error: str = ""  #: why it was not flown

    @property
    def name(self) -> str:
        """``file::check``."""
        return self.plan.id if self.plan is not None else str(self.file)

    @property
    def passed(self) -> int:
        """Episodes that fulfil everything."""
        return sum(not faults(result) for result in self.results)

    @property
    def status(self) -> str:
        """``passed``, ``failed``, or ``error`` for what could not be judged: bad input, a controller that broke."""
        if self.error or self.plan is None:
            return "error"
        if self.passed < self.plan.check.pass_share * len(self.results) or not self.results:
            return "error" if any(result.outcome == FAILED for result in self.results) else "failed"
        return "passed"


def faults(result: Result) -> list[str]:
    """What an episode did not fulfil, each in one line; empty if all is well."""
    if result.outcome == FAILED:
        return [result.cause]
    return [
        f"{finding['what']}: {finding['text']}" + ("" if finding["time"] is None else f" at {finding['time']:.0f} s")
        for finding in findings(result)
        if finding["ok"] is False
    ]


def findings(result: Result) -> Sequence[dict[str, Any]]:
    """What was looked at in an episode: requirements, then assertions."""
    found: Sequence[dict[str, Any]] = result.seen.get("findings", ())
    return found


def check_files(paths: Sequence[str | Path]) -> list[Path]:
    """Files of checks: those given, and all ``check_*.yaml`` in directories.

    Raises
    ------
    ConfigError
        if a directory has none.
    """
    files: list[Path] = []
    for path in map(Path, paths):
        if path.is_dir():
            here = sorted(path.rglob("check_*.y*ml"))
            if not here:
                raise ConfigError(f"{path}: no check_*.yaml here")
            files += here
        else:
            files.append(path)
    return list(dict.fromkeys(files))


def read_files(files: Sequence[Path]) -> list[Verdict]:
    """A verdict for every check, still without results; a file that cannot be read is one with an error."""
    verdicts = []
    for file in files:
        try:
            verdicts += [Verdict(file, plan, error=plan.error) for plan in load_checks(file)]
        except ConfigError as error:
            verdicts.append(Verdict(file, None, error=str(error)))
    return verdicts


def fly(
    verdicts: Sequence[Verdict], *, workers: int | None = None, progress: Callable[[int, int], None] | None = None
) -> None:
    """Fly the checks that can be flown and put the results in.

    Parameters
    ----------
    verdicts
        of :func:`read_files`.
    workers
        processes; None: as many as there are processors, or none for a few episodes of built-in policies.  With 0 a
        controller that hangs is not noticed.
    progress
        called with (episodes done, episodes in all).
    """
    ready = {v.plan.id: v for v in verdicts if v.plan is not None and not v.error}
    all_flights = [v.plan.flight() for v in ready.values() if v.plan is not None]
    total = sum(len(flight.seeds) for flight in all_flights)
    if workers is None and total <= FEW and all(flight.policy in POLICIES for flight in all_flights):
        workers = 0
    by_seed: dict[str, dict[int, Result]] = {id: {} for id in ready}
    waiting: list[Flight] = [piece for flight in all_flights for piece in flights(flight)]
    with Fleet(workers) as fleet:
        for done, result in enumerate(fleet.fly(waiting), start=1):
            by_seed[result.case][result.seed] = result
            if progress is not None:
                progress(done, total)
    for id, verdict in ready.items():
        assert verdict.plan is not None
        verdict.results = [by_seed[id][seed] for seed in verdict.plan.check.seeds if seed in by_seed[id]]


def exit_code(verdicts: Sequence[Verdict]) -> int:
    """0: all passed; 2: a file, scenario or policy that cannot be used; else 1."""
    if any(verdict.error for verdict in verdicts):
        return 2
    return 0 if all(verdict.status == "passed" for verdict in verdicts) else 1


def rerun(verdict: Verdict, seed: int) -> str:
    """The command that flies one episode of a check again and keeps its recording."""
    assert verdict.plan is not None
    case, check = verdict.plan.case, verdict.plan.check
    if not isinstance(case.scenario, str):
        return f"usv-gym check {verdict.file}  # seed {seed}"
    sets = [*case.overrides, *([] if case.difficulty is None else [f"family.difficulty={case.difficulty!r}"])]
    words = ["usv-gym run", case.scenario, "--policy", verdict.plan.policy, "--seed", str(seed)]
    words += [word for text in sets for word in ("--set", f"'{text}'" if " " in text else text)]
    return " ".join(words + (["--vessel", check.vessel] if check.vessel else []))
