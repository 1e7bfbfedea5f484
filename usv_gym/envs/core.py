"""What all faces share: B worlds of one task, their templates, seeds and buffers.

``Core`` holds no physics, no reward and no geometry; it writes records, calls the kernels and keeps the arrays they fill.
Row b of any batch equals a batch of one with the same seed, bit for bit.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

from ..config import ConfigError, Document, validate
from ..jit import bound
from ..scenarios.build import build_worlds, track_pool, write_weather
from ..scenarios.families import FAMILIES
from ..scenarios.families.failures import sample_failures
from ..scenarios.land import scenario_coast
from ..scenarios.loader import Source, load_scenario
from ..scenarios.schema import Scenario, Weather
from ..tasks.share import ALONE, NO_CONTROL
from ..tasks.step import BEGIN, STEP, observe_batch, run_batch
from ..tasks.task import (
    N_TERMS,
    OUTCOMES,
    TERMS,
    TaskConfig,
    Vessel,
    action_space,
    episode_dtype,
    floats_dtype,
    named_terms,
    observation_size,
    observation_space,
    resolve_action,
    task_record,
)
from ..units import DEG
from ..world.disturbance import set_weather
from ..world.land import Coast, land_pool
from ..world.lanes import lanes_for
from ..world.state import A, capacity
from ..world.vessel import VesselModel, load_vessel
from .threads import Crew

_OUTCOME_TEXTS = np.array(OUTCOMES, object)
_TERM_KEYS = tuple((term, f"_{term}") for term in TERMS)
_WORTH_SHARING = 16  # rows; fewer are done by one thread before another wakes up
NO_ROWS = np.zeros((0, 0, A, 3))
_WEATHERS = ("calm", "random", "thesis")


def vessel_facts(model: VesselModel) -> Vessel:
    """What a task needs to know of a vessel file."""
    return Vessel(
        default_action=model.default_action,
        max_speed=model.max_speed,
        thrusters=len(model.thrusters),
        has_nozzle=tuple(t.nozzle_max_deg > 0 for t in model.thrusters),
        has_bucket=tuple(t.bucket for t in model.thrusters),
    )


class Core:
    """B worlds that run the same task.

    Parameters
    ----------
    num
        B, the number of worlds.
    source
        scenario name, path or mapping.
    config
        the task.
    vessel
        name or path of a vessel file; None: the scenario's.
    overrides
        ``KEY=VALUE`` strings on the scenario.
    difficulty
        0 to 1, of the scenario's family; None: as the scenario says.
    weather
        ``calm``, ``random``, ``thesis`` or a mapping like ``weather`` of a scenario; None: as the scenario says.
    max_steps
        most control steps of an episode; None: as many as the scenario's duration holds.
    num_threads
        threads that share the rows of a large batch.
    """

    worlds: NDArray[Any]
    coasts: tuple[Coast, ...]  #: what the worlds' ``land_id`` count in
    land: NDArray[np.float64]  #: the same, indexed (world/land.py)
    tracks: NDArray[np.float64]  #: pool of the worlds' recorded tracks (traffic/replay.py)
    task: NDArray[Any]
    action_space: gym.Space[Any]
    names: list[str]
    scenario: Scenario
    model: VesselModel

    def __init__(
        self,
        num: int,
        *,
        source: Source,
        config: TaskConfig,
        vessel: str | None = None,
        overrides: Sequence[str] = (),
        difficulty: float | None = None,
        weather: str | Mapping[str, Any] | None = None,
        max_steps: int | None = None,
        num_threads: int = 1,
    ) -> None:
        self.num = num
        self.config = self._asked = config
        self.overrides = tuple(overrides)
        self.weather = [check_weather(weather)] * num  # [B]
        self.max_steps = max_steps
        self.crew = Crew(num_threads)
        self._load(source, vessel)
        if difficulty is None:
            difficulty = self.scenario.family.difficulty if self.scenario.family else 0.5
        self.difficulty = np.full(num, check_difficulty(difficulty))  # [B]
        self.observation_space = observation_space(self.config)
        # one observer per world; the kernel knows of more
        self._obs = np.zeros((num, 1, observation_size(self.config)), np.float32)
        self._episodes = np.zeros((num, 1), episode_dtype())
        # the same of all rows in columns, for vector faces: see run_batch
        self._numbers, self._flags = np.zeros((4 + N_TERMS, num)), np.zeros((5, num), np.uint8)
        self._name_views()

    def _name_views(self) -> None:
        self.obs, self.episodes = self._obs[:, 0], self._episodes[:, 0]
        self.actions = self.episodes["action"][:, : int(self.task["channels"][0])]
        self.terms, self.reward = self.episodes["terms"], self.episodes["reward"]
        self.terminated, self.truncated = self.episodes["terminated"], self.episodes["truncated"]
        self._what, self._outcome = self.episodes["what"], self.episodes["outcome"]
        self._stepping = False  # ``what`` is STEP in all rows
        self._no_texts = np.full(self.num, OUTCOMES[0], object)
        # by row, for the single environment: making a view costs as much as half a kernel call
        self.row_obs, self.row_actions = list(self.obs), list(self.actions)
        self._row_floats = list(self.episodes.view(floats_dtype())["floats"])

    def __getstate__(self) -> dict[str, Any]:
        return {**self.__dict__, "_alone": None}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        self._name_views()  # pickle makes arrays of their own of them

    # --- set-up ------------------------------------------------------------------------------------------------------
    def _load(self, source: Source, vessel: str | None) -> None:
        """(Re)build template and worlds for a scenario; all rows become fresh."""
        scenario = load_scenario(source, overrides=self.overrides, vessel=vessel)
        model = load_vessel(scenario.own_ship.vessel)
        facts = vessel_facts(model)
        config = self._asked.scaled(scenario.scale).model_copy(update={"action": resolve_action(self._asked, facts)})
        space = action_space(config, facts)
        if space != getattr(self, "action_space", space):
            raise ConfigError(
                f"vessel {model.name!r} has another action space; make the environment with vessel={model.name!r}, "
                "or with action='throttle_nozzle', 'heading_speed' or 'discrete', which fit every vessel"
            )
        family = FAMILIES[scenario.family.name] if scenario.family else None
        slots = None if family is None else capacity(
            max(family.vessels, 1 + len(scenario.ships)),
            max(family.obstacles, len(scenario.obstacles)) + len(scenario.phantoms()),
        )  # fmt: skip
        coasts = family.coasts() if family else ()
        if scenario.land is not None:
            if scenario.family and coasts:
                raise ConfigError(f"scenario {scenario.name!r}: land: the family {scenario.family.name!r} has its own")
            coast = scenario_coast(scenario, model)
            coasts = (coast,) if coast else ()
        if config.land is None:
            config = config.model_copy(update={"land": bool(coasts)})
        if hasattr(self, "_obs") and observation_size(config) != self._obs.shape[-1]:
            raise ConfigError(
                f"scenario {scenario.name!r} has {'' if coasts else 'no '}land, so its observation has another size; make the "
                "environment with land=True or land=False, which fit every scenario"
            )
        worlds, names = build_worlds(scenario, self.num, capacity=slots)
        if scenario.land is not None and coasts:
            worlds["land_id"], worlds["chart_id"] = 0, 0 if scenario.land.chart else -1
        # nothing is changed until all of it is known to be right
        self.source, self.vessel, self.scenario, self.model, self._family = source, vessel, scenario, model, family
        self.worlds, self.names, self.action_space, self.config = worlds, names, space, config
        self.coasts, self.land = coasts, land_pool(coasts)
        self.tracks = track_pool(scenario)
        self._lanes = lanes_for(worlds)
        self._alone: Callable[[], int] | None = None  # one thread's work, bound to the arrays of now
        simulation = self.scenario.simulation
        self.control_interval = simulation.control_ticks * simulation.dt
        max_steps = int(np.ceil(simulation.duration / self.control_interval - 1e-9))
        if self.max_steps is not None:
            max_steps = min(max_steps, self.max_steps)
        self.task = task_record(self.config, facts, simulation.control_ticks, max_steps)
        if self.config.observation == "truth":
            # nobody looks at the picture, so nobody has to paint it
            self.worlds["sensors"]["exteroceptive"] = 0
        self._template = self._bytes[0].copy()

    @property
    def _bytes(self) -> NDArray[np.uint8]:
        """The worlds as bytes [B, n]: a view."""
        return self.worlds.view(np.uint8).reshape(self.num, -1)

    def coast(self, b: int) -> Coast:
        """The land of row b."""
        k = int(self.worlds["land_id"][b])
        return self.coasts[k] if k >= 0 else ()

    def ids(self, b: int) -> list[str]:
        """Ids of the sources of row b [S], "" where a slot is empty; what a family drew is called ship_1, obstacle_1, ..."""
        w = self.worlds[b]
        V = len(w["vessels"]["active"])
        active = np.concatenate([w["vessels"]["active"], w["obstacles"]["active"]])
        drawn = [f"ship_{s}" if s < V else f"obstacle_{s - V + 1}" for s in range(len(active))]
        return [name or (drawn[s] if active[s] else "") for s, name in enumerate(self.names)]

    def configure(self, options: Mapping[str, Any] | None, mask: NDArray[np.bool_] | None = None) -> None:
        """Apply ``reset(options=...)`` to the rows of ``mask`` [B], or to all: scenario, vessel, weather, difficulty.

        Raises
        ------
        ConfigError
            for an unknown key, a bad value, a vessel that does not fit the action space, or a scenario or vessel for some
            rows only.
        """
        if not options:
            return
        unknown = [key for key in options if key not in ("scenario", "vessel", "weather", "difficulty")]
        if unknown:
            raise ConfigError(f"reset options: unknown key {unknown[0]!r}; known are scenario, vessel, weather, difficulty")
        difficulty = check_difficulty(options["difficulty"]) if "difficulty" in options else None
        weather = check_weather(options.get("weather"))
        if "scenario" in options or "vessel" in options:
            if mask is not None and not mask.all():
                raise ConfigError("reset options: all rows share scenario and vessel; give them in a reset of all rows")
            self._load(options.get("scenario", self.source), options.get("vessel", self.vessel))
        for b in range(self.num) if mask is None else np.flatnonzero(mask).tolist():
            if difficulty is not None:
                self.difficulty[b] = difficulty
            if "weather" in options:
                self.weather[b] = weather

    # --- running -----------------------------------------------------------------------------------------------------
    def reset(self, mask: NDArray[np.bool_], generators: Sequence[np.random.Generator]) -> None:
        """Draw and start new episodes in the rows of ``mask`` [B]; generators [B] own the randomness."""
        self.draw(mask, generators)
        self._what[:] = np.where(mask, BEGIN, 0)
        self._stepping = False
        self._run(NO_ROWS)

    def draw(self, mask: NDArray[np.bool_], generators: Sequence[np.random.Generator]) -> None:
        """The first half of ``reset``: write the rows of ``mask`` anew, as they stand before anything has fired."""
        rows = self._bytes
        for b in np.flatnonzero(mask).tolist():
            rows[b] = self._template
            self.worlds["seed"][b] = generators[b].integers(0, 1 << 63, dtype=np.uint64)
            self._set_weather(b, generators[b])
        if self._family is not None:
            self._family.sample(self.worlds, mask, self.difficulty, self.model, self.scenario)
            if self.scenario.family is not None and self.scenario.family.failures > 0.0:
                time = 0.5 * self.scenario.simulation.duration  # what a route takes, about
                sample_failures(self.worlds, mask, self.scenario.family.failures, self.difficulty, time)

    def _set_weather(self, b: int, generator: np.random.Generator) -> None:
        """Overwrite the weather of row b where the caller or the family asks for it."""
        weather = self.weather[b]
        if weather is None:
            if self.scenario.family is None or self.scenario.family.weather == "scenario":
                return
            weather = "random"
        original = self.scenario.preset == "original"
        if isinstance(weather, Weather):
            write_weather(weather, self.worlds[b], self.scenario.preset)
            return
        if weather == "calm":
            set_weather(self.worlds[b], original=original)
        elif weather == "thesis":
            set_weather(self.worlds[b], wind_speed=10.0, wind_to=270 * DEG, current_speed=0.5, current_to=90 * DEG,
                        wave_height=2.0, wave_to=270 * DEG, original=original)  # fmt: skip
        else:
            d = float(self.difficulty[b])
            wind, current, height, way, drift = generator.random(5)
            set_weather(self.worlds[b], wind_speed=12.0 * d * wind, wind_to=2 * np.pi * way,
                        current_speed=0.6 * d * current, current_to=2 * np.pi * drift,
                        wave_height=1.5 * d * height, wave_to=2 * np.pi * way, original=original)  # fmt: skip

    def step(self, mask: NDArray[np.bool_] | None = None, rows: NDArray[np.float64] = NO_ROWS) -> None:
        """One control step of the rows of ``mask`` [B] (all) with ``self.actions``; results are in obs, reward, terms, ...

        Raises
        ------
        ValueError
            if an action is not finite, or none of ``discrete``; nothing has moved then.
        """
        if mask is None:
            if not self._stepping:
                self._what.fill(STEP)
                self._stepping = True
        else:
            self._stepping = False
            np.multiply(mask, STEP, out=self._what, casting="unsafe")
        bad = self._run(rows)
        if bad >= 0:
            expected = "a whole number from 0 to 4" if self.config.action == "discrete" else "finite numbers"
            row = f" (row {bad})" if self.num > 1 else ""
            raise ValueError(f"action {self.actions[bad].tolist()}{row}: expected {expected}")

    def _run(self, rows: NDArray[np.float64]) -> int:
        alone = self.crew.size == 1 or np.count_nonzero(self._what) < _WORTH_SHARING
        if alone and rows is NO_ROWS:
            if self._alone is None:
                self._alone = bound(run_batch, NO_CONTROL, ALONE, *self._arguments(rows))
            return self._alone()
        if alone or rows is not NO_ROWS:
            return int(run_batch(NO_CONTROL, ALONE, *self._arguments(rows)))
        return self.crew.run(run_batch, *self._arguments(rows))

    def _arguments(self, rows: NDArray[np.float64]) -> tuple[NDArray[Any], ...]:
        results = self._episodes, self._obs, self._numbers, self._flags
        return self.worlds, self._lanes, self.land, self.tracks, self.task, *results, rows

    def observe(self) -> NDArray[np.float32]:
        """Observations [B, n] of the records as they are now; does not advance anything."""
        observe_batch(self.worlds, self.land, self.task, self._obs)
        return self.obs

    def scales(self) -> dict[str, float]:
        """What turns observations and actions into SI units: the scales of the task and facts of the vessel."""
        config = self.config
        return {
            "max_speed": self.model.max_speed,
            "cruise_speed": self.model.cruise_speed,
            "length": self.model.length,
            "beam": self.model.beam,
            "control_interval": self.control_interval,
            "channels": self.actions.shape[1],
            "targets": config.targets,
            "land": config.land_sectors if config.land else 0,
            **{name: getattr(config, name) for name in (
                "range_scale", "distance_scale", "cross_track_scale", "target_speed_scale", "radius_scale", "rate_scale")},
        }  # fmt: skip

    def info(self, b: int) -> dict[str, Any]:
        """The info dict of row b after a step."""
        outcome = OUTCOMES[self._outcome.item(b)]
        time, closest, to_go, *terms = self._row_floats[b].tolist()
        return {
            "reward_terms": named_terms(*terms),
            "time": time,
            "closest": closest,
            "to_go": to_go,
            "outcome": outcome,
            "is_success": outcome == "arrival",
        }

    def results(self) -> tuple[NDArray[np.float64], NDArray[np.bool_], NDArray[np.uint8]]:
        """Copies of numbers [4 + terms, B], flags [4, B] and outcomes [B] of all rows.

        Numbers are reward, time, closest, to_go and the terms; flags terminated, truncated, either, arrived.
        """
        flags = self._flags.copy()
        return self._numbers.copy(), flags[:4].view(np.bool_), flags[4]

    def infos(self, mask: NDArray[np.bool_], results: Any = None, over: bool = True) -> dict[str, Any]:
        """The info dicts of the rows of ``mask`` [B] as Gymnasium's vector environments batch them.

        ``results``: those of now, where the mask is known to be all true; not ``over``: no episode is known to have ended.

        Every key has an array [B], with zeros (None among texts) in the other rows, and a mask under ``_key``.
        """
        numbers, flags, outcome = results or self.results()
        _, time, closest, to_go, *terms = numbers
        texts = _OUTCOME_TEXTS[outcome] if over else self._no_texts.copy()
        success = flags[3]
        if results is None and not mask.all():
            others = ~mask
            numbers[:, others] = 0.0
            texts[others] = None
            success[others] = False
        # written out, as this is done in every step
        rewards: dict[str, Any] = {}
        for (key, masked_key), term in zip(_TERM_KEYS, terms, strict=True):
            rewards[key] = term
            rewards[masked_key] = mask
        return {
            "reward_terms": rewards, "_reward_terms": mask, "time": time, "_time": mask, "closest": closest, "_closest": mask,
            "to_go": to_go, "_to_go": mask, "outcome": texts, "_outcome": mask, "is_success": success, "_is_success": mask
        }  # fmt: skip


def masked(columns: Mapping[str, Any], mask: NDArray[np.bool_]) -> dict[str, Any]:
    """Columns, each followed by the mask of the rows that it speaks for, under ``_key``."""
    return {name: value for key, column in columns.items() for name, value in ((key, column), (f"_{key}", mask))}


def check_difficulty(value: Any) -> float:
    """Difficulty as a float in [0, 1]; ConfigError otherwise."""
    if not isinstance(value, int | float) or not 0.0 <= value <= 1.0:
        raise ConfigError(f"difficulty: expected a number from 0 to 1, got {value!r}")
    return float(value)


def check_weather(value: Any) -> str | Weather | None:
    """A weather by name or, from a mapping, in full; ConfigError otherwise."""
    if isinstance(value, Mapping):
        return validate(Weather, Document("weather", dict(value)))
    if value is None or isinstance(value, Weather) or (isinstance(value, str) and value in _WEATHERS):
        return value
    raise ConfigError(f"weather: expected one of {', '.join(_WEATHERS)} or a mapping, got {value!r}")
