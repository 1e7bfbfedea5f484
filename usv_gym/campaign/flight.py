"""One policy, one case and some seeds, flown in one batch: the unit of work of a campaign."""

from __future__ import annotations

import importlib
import time
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from gymnasium.utils.seeding import np_random
from numpy.typing import NDArray

from ..config import ConfigError
from ..envs.core import Core
from ..policies import POLICIES, make_policy
from ..policies.custom import cause
from ..scenarios.loader import load_scenario
from ..scenarios.schema import Scenario
from ..scenarios.suites import Case
from ..tasks.task import OUTCOMES
from ..voyage import task_of
from .controllers import Helm, Watchdog, decides_for_batches

FAILED = "failed"  #: outcome of an episode whose controller raised, returned nonsense or hung


class Witness(Protocol):
    """Watches the episodes of a batch and says what there was to see; made in the process that flies.

    ``begin`` and ``sample`` get the core after the reset and after every control step, with the rows that are new.
    """

    def begin(self, core: Core, mask: NDArray[np.bool_]) -> None:
        """Episodes begin in the rows of ``mask`` [B]."""

    def sample(self, core: Core, mask: NDArray[np.bool_]) -> None:
        """The rows of ``mask`` [B] have made a step."""

    def finish(self, core: Core, rows: int) -> list[dict[str, Any]]:
        """What to add to the result of each of the first ``rows`` rows: plain data."""


@dataclass(frozen=True)
class Flight:
    """What to fly.

    ``policy`` is what :func:`~usv_gym.policies.make_policy` takes.  ``witness`` is ``module:Class`` of a :class:`Witness`, made
    with ``settings``.
    """

    policy: str
    case: Case
    seeds: tuple[int, ...]
    vessel: str | None = None
    trust: bool = False
    step_limit: float = 2.0  #: [s] that one decision may take, of controllers that are not built in
    witness: str | None = None
    settings: Mapping[str, Any] = field(default_factory=dict)

    @property
    def label(self) -> str:
        """``policy, case``."""
        return f"{self.policy}, {self.case.id}"


@dataclass(frozen=True)
class Result:
    """What became of one episode.  SI units."""

    policy: str
    case: str
    seed: int
    outcome: str  #: collision, arrival, out_of_area, time_limit or failed
    cause: str = ""  #: what the controller did wrong
    steps: int = 0
    time: float = 0.0  #: [s] simulated
    closest: float | None = None  #: [m] smallest hull distance to anything; None: nothing was there
    closest_to: str = ""  #: id of what that was
    to_go: float = 0.0  #: [m] left of the route
    reward: float = 0.0  #: sum over the episode
    seen: Mapping[str, Any] = field(default_factory=dict)  #: what the witness says
    wall: float = 0.0  #: [s] of this machine, its share of the batch

    @property
    def key(self) -> tuple[str, str, int]:
        """Policy, case and seed."""
        return self.policy, self.case, self.seed

    def plain(self) -> dict[str, Any]:
        """As JSON has it."""
        return asdict(self)


def scenario_of(case: Case, vessel: str | None = None) -> Scenario:
    """The scenario of a case, with its difficulty and overrides in it."""
    more = () if case.difficulty is None else (f"family.difficulty={case.difficulty!r}",)
    return load_scenario(case.scenario, overrides=(*case.overrides, *more), vessel=vessel)


def batched(policy: str) -> bool:
    """Whether a policy is known to decide for batches: built in or learned.  (One's own is flown a row at a time.)"""
    return policy in POLICIES or policy.endswith(".zip")


class Yard:
    """Builds what flights need and keeps it: cores by (policy, case, size), for those that follow."""

    def __init__(self, traces: Path | None = None) -> None:
        self.traces = traces  #: where the watchdog writes; None: no time limit
        self._kept: dict[Any, tuple[Core, Helm]] = {}

    def _ready(self, flight: Flight) -> tuple[Core, Helm]:
        key = (flight.policy, flight.case.model_dump_json(), flight.vessel, len(flight.seeds), flight.step_limit)
        if key not in self._kept:
            while len(self._kept) > 3:
                self._kept.pop(next(iter(self._kept)))

            def make() -> Any:
                return make_policy(flight.policy, trust=flight.trust)

            core = Core(len(flight.seeds), source=scenario_of(flight.case, flight.vessel), config=task_of(make()))
            helm = Helm(make, core, Watchdog(self.traces, flight.step_limit), trusted=flight.policy in POLICIES)
            self._kept[key] = core, helm
        return self._kept[key]

    def fly(self, flight: Flight) -> Iterator[Result]:
        """Fly it; a failed controller or a policy that cannot be made is a failed result."""
        began = time.perf_counter()
        try:
            core, helm = self._ready(flight)
            witness = _make_witness(flight)
        except Exception as error:
            said = str(error) if isinstance(error, ConfigError) else cause(error)
            for seed in flight.seeds:
                yield Result(flight.policy, flight.case.id, seed, FAILED, said)
            return
        running = np.ones(core.num, np.bool_)
        total = np.zeros(core.num)
        core.reset(running, [np_random(seed)[0] for seed in flight.seeds])
        helm.reset(running)
        running = np.array([not failure for failure in helm.failures])
        if witness is not None:
            witness.begin(core, np.ones(core.num, np.bool_))
        step = 0
        while running.any():
            running = helm.steer(running, step)
            core.step(running)
            step += 1
            total[running] += core.reward[running]
            if witness is not None:
                witness.sample(core, running)
            running &= ~(core.terminated | core.truncated)
        seen = witness.finish(core, core.num) if witness is not None else [{}] * core.num
        wall = (time.perf_counter() - began) / core.num
        for b, seed in enumerate(flight.seeds):
            yield _result(flight, core, b, seed, helm.failures[b], float(total[b]), seen[b], wall)


def _result(flight: Flight, core: Core, b: int, seed: int, failure: str, reward: float, seen: dict[str, Any],
            wall: float) -> Result:  # fmt: skip
    episode = core.episodes[b]
    closest = core.worlds["safety"]["closest"][b, 0]
    nearest = int(np.argmin(closest))
    there = bool(np.isfinite(closest[nearest]))
    return Result(
        flight.policy, flight.case.id, seed, FAILED if failure else OUTCOMES[episode["outcome"]], failure,
        steps=int(episode["step"]), time=float(core.worlds["tick"][b] * core.worlds["dt"][b]),
        closest=float(closest[nearest]) if there else None, closest_to=core.ids(b)[nearest] if there else "",
        to_go=float(episode["to_go"]), reward=reward, seen=seen, wall=wall,
    )  # fmt: skip


def _make_witness(flight: Flight) -> Witness | None:
    if flight.witness is None:
        return None
    module, _, name = flight.witness.partition(":")
    witness: Witness = getattr(importlib.import_module(module), name)(**flight.settings)
    return witness


__all__ = ["FAILED", "Flight", "Result", "Witness", "Yard", "batched", "decides_for_batches", "scenario_of"]
