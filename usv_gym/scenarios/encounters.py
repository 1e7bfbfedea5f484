"""Encounters from Python: scenarios of wanted classes, as many as one likes, with what was asked of them.

The drawing is that of the family ``encounter`` (``families/encounter.py``); here its draws become plain scenarios.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..config import ConfigError
from ..world.encounter import Encounter
from ..world.vessel import load_vessel
from .build import Worlds, build_worlds
from .family_schema import Encounters
from .freeze import freeze
from .loader import load_scenario
from .schema import Scenario

_AT_A_TIME = 256  #: records in memory


@dataclass(frozen=True)
class Asked:
    """What was asked of one ship, and so is."""

    encounter: Encounter
    dcpa: float  #: between the middles of the ships [m]
    tcpa: float  #: from the start [s]
    bearing: float  #: of the ship off the own bow, clockwise [rad]
    speed_ratio: float  #: its speed / own speed


def template(*, vessel: str = "odin", overrides: Sequence[str] = (), **family: Any) -> Scenario:
    """The scenario that encounters are drawn on; ``family`` are keys of the family, as ``classes`` or ``dcpa``.

    Raises
    ------
    ConfigError
        one line per wrong key or value.
    """
    source = {"base": "encounter", "family": {"name": "encounter", "weather": "scenario", **family}}
    return load_scenario(source, vessel=vessel, overrides=overrides)


def draw(scenario: Scenario, seeds: NDArray[np.uint64]) -> tuple[Worlds, NDArray[Any]]:
    """Records of the worlds with these seeds [n], and what was asked of their ships ([n, ships], ``encounter.ASKED``)."""
    from .families import FAMILIES
    from .families import encounter as kernels

    family = scenario.family
    if not isinstance(family, Encounters):
        raise ConfigError(f"scenario {scenario.name!r}: expected the family encounter")
    slots = FAMILIES[family.name].vessels, 16
    worlds, _ = build_worlds(scenario, len(seeds), capacity=slots)
    worlds["seed"] = seeds
    difficulty = np.full(len(seeds), family.difficulty)
    model = load_vessel(scenario.own_ship.vessel)
    return worlds, kernels.draw(worlds, np.ones(len(seeds), np.bool_), difficulty, model, scenario)


def generate(
    n: int = 1, *, seed: int = 0, vessel: str = "odin", overrides: Sequence[str] = (), **family: Any
) -> list[tuple[Scenario, tuple[Asked, ...]]]:
    """Draw n scenarios, each with what was asked of its ships in their order.

    Parameters
    ----------
    n, seed
        how many, and of which random numbers; the first k of n are those of n = k.
    vessel, overrides
        own ship, by name or file, and ``KEY=VALUE`` on the scenario.
    family
        keys of the family: ``classes``, ``ships``, ``together``, ``dcpa``, ``tcpa``, ``bearing_deg``, ``speed_ratio``,
        ``difficulty`` (docs/scenarios.md).

    Raises
    ------
    ConfigError
        for a wrong key or value, or if there are no such encounters.

    Examples
    --------
    >>> (scenario, asked), = generate(together=["head_on", "crossing_give_way"], dcpa=20, tcpa=[60, 90], seed=1)
    >>> [ship.encounter.name for ship in asked]
    ['HEAD_ON', 'CROSSING_GIVE_WAY']
    """
    if n < 1:
        raise ConfigError(f"n: expected a number of at least 1, got {n}")
    plain = template(vessel=vessel, overrides=overrides, **family)
    seeds = np.random.default_rng(seed).integers(0, 1 << 63, n, dtype=np.uint64)
    result: list[tuple[Scenario, tuple[Asked, ...]]] = []
    for first in range(0, n, _AT_A_TIME):
        worlds, asked = draw(plain, seeds[first : first + _AT_A_TIME])
        for b in range(len(worlds)):
            scenario = freeze(plain, worlds[b]).model_copy(update={"name": f"encounter_{seed}_{first + b}"})
            result.append((scenario, tuple(
                Asked(Encounter(row["code"]), *(float(row[key]) for key in ("dcpa", "tcpa", "bearing", "ratio")))
                for row in asked[b] if row["code"]
            )))  # fmt: skip
    return result
