"""What all faces share: B worlds of one task, their templates, seeds and buffers.

``Core`` holds no physics, no reward and no geometry; it writes records, calls the kernels and keeps the arrays they fill.
Row b of any batch equals a batch of one with the same seed, bit for bit.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..config import ConfigError, Document, validate
from ..scenarios.build import build_worlds, write_weather
from ..scenarios.loader import Source, load_scenario
from ..scenarios.schema import Scenario, Weather
from ..tasks.task import (
    N_TERMS,
    OUTCOMES,
    TERMS,
    TaskConfig,
    Vessel,
    action_space,
    episode_dtype,
    observation_size,
    observation_space,
    resolve_action,
    task_record,
)
from ..units import DEG
from ..world.disturbance import set_weather
from ..world.state import A
from ..world.vessel import VesselModel, load_vessel

#: template of the family ``open_sea``: everything but what the family draws
OPEN_SEA: dict[str, Any] = {
    "name": "open_sea",
    "simulation": {"dt": 0.1, "traffic_interval": 0.5, "control_interval": 1.0, "duration": 500.0, "area": 2000.0},
    "sensors": {
        "base": "thesis",
        # own navigation as often as the tick
        "navigation": {key: {"rate": 10.0} for key in ("gnss", "mru", "imu", "speed_log", "wind")},
    },
}
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
        scenario name, path or mapping; None: the family ``open_sea``.
    config
        the task.
    vessel
        name or path of a vessel file; None: the scenario's.
    overrides
        ``KEY=VALUE`` strings on the scenario.
    difficulty
        0 to 1, of the family.
    weather
        ``calm``, ``random``, ``thesis`` or a mapping like ``weather`` of a scenario; None: the scenario's own (the family:
        ``random``).
    """

    worlds: NDArray[Any]
    names: list[str]
    scenario: Scenario
    model: VesselModel

    def __init__(
        self,
        num: int,
        *,
        source: Source | None,
        config: TaskConfig,
        vessel: str | None = None,
        overrides: Sequence[str] = (),
        difficulty: float = 0.5,
        weather: str | Mapping[str, Any] | None = None,
    ) -> None:
        self.num = num
        self.config = config
        self.overrides = tuple(overrides)
        self.difficulty = check_difficulty(difficulty)
        self.weather = weather
        self._load(source, vessel)
        facts = vessel_facts(self.model)
        self.action_name = resolve_action(config, facts)
        self.action_space = action_space(config, facts)
        self.observation_space = observation_space(config)
        self.obs = np.zeros((num, observation_size(config)), np.float32)
        self.terms = np.zeros((num, N_TERMS))
        self.reward = np.zeros(num)
        self.terminated = np.zeros(num, np.bool_)
        self.truncated = np.zeros(num, np.bool_)
        self.actions = np.zeros((num, 1 if self.action_name == "discrete" else self.action_space.shape[0]))  # type: ignore[index]
        self.episodes = np.zeros(num, episode_dtype())
        self._what = np.zeros(num, np.int8)

    # --- set-up ------------------------------------------------------------------------------------------------------
    def _load(self, source: Source | None, vessel: str | None) -> None:
        """(Re)build template and worlds for a scenario; all rows become fresh."""
        self.source, self.vessel = source, vessel
        self.scenario = load_scenario(OPEN_SEA if source is None else source, overrides=self.overrides, vessel=vessel)
        self.model = load_vessel(self.scenario.own_ship.vessel)
        self.worlds, self.names = build_worlds(self.scenario, self.num)
        self._bytes = self.worlds.view(np.uint8).reshape(self.num, -1)
        self._template = self._bytes[0].copy()
        simulation = self.scenario.simulation
        self.control_interval = simulation.control_ticks * simulation.dt
        max_steps = int(np.ceil(simulation.duration / self.control_interval - 1e-9))
        self.task = task_record(self.config, vessel_facts(self.model), simulation.control_ticks, max_steps)
        if self.config.observation == "truth":
            # nobody looks at the picture, so nobody has to paint it
            self.worlds["sensors"]["exteroceptive"] = 0
            self._template = self._bytes[0].copy()

    def configure(self, options: Mapping[str, Any] | None) -> None:
        """Apply ``reset(options=...)``: scenario, vessel, weather, difficulty.

        Raises
        ------
        ConfigError
            for an unknown key, a bad value, or a vessel that does not fit the action space.
        """
        if not options:
            return
        unknown = [key for key in options if key not in ("scenario", "vessel", "weather", "difficulty")]
        if unknown:
            raise ConfigError(f"reset options: unknown key {unknown[0]!r}; known are scenario, vessel, weather, difficulty")
        if "difficulty" in options:
            self.difficulty = check_difficulty(options["difficulty"])
        if "weather" in options:
            check_weather(options["weather"])
            self.weather = options["weather"]
        if "scenario" in options or "vessel" in options:
            before = self.source, self.vessel
            self._load(options.get("scenario", self.source), options.get("vessel", self.vessel))
            if action_space(self.config, vessel_facts(self.model)) != self.action_space:
                name = self.model.name
                self._load(*before)
                raise ConfigError(
                    f"reset options: vessel {name!r} has another action space; make the environment with "
                    f"vessel={name!r}, or with action='heading_speed' or 'discrete', which fit every vessel"
                )

    # --- running -----------------------------------------------------------------------------------------------------
    def reset(self, mask: NDArray[np.bool_], generators: Sequence[np.random.Generator]) -> None:
        """Draw and start new episodes in the rows of ``mask`` [B]; generators [B] own the randomness."""
        from ..scenarios.families import sample_open_sea
        for b in np.flatnonzero(mask).tolist():
            self._bytes[b] = self._template
            self.worlds["seed"][b] = generators[b].integers(0, 1 << 63, dtype=np.uint64)
            self._set_weather(b, generators[b])
        if self.source is None:
            difficulty = np.full(self.num, self.difficulty)
            sample_open_sea(self.worlds, mask, difficulty, self.model.cruise_speed)
        self._what[:] = mask  # BEGIN is 1
        self._run(NO_ROWS)

    def _set_weather(self, b: int, generator: np.random.Generator) -> None:
        """Overwrite the weather of row b where the caller or the family asks for it."""
        weather = self.weather
        if weather is None:
            if self.source is not None or self.overrides:
                return
            weather = "random"
        original = self.scenario.preset == "original"
        if isinstance(weather, Mapping):
            write_weather(validate(Weather, Document("weather", dict(weather))), self.worlds[b], self.scenario.preset)
            return
        if weather == "calm":
            set_weather(self.worlds[b], original=original)
        elif weather == "thesis":
            set_weather(self.worlds[b], wind_speed=10.0, wind_to=270 * DEG, current_speed=0.5, current_to=90 * DEG,
                        wave_height=2.0, wave_to=270 * DEG, original=original)  # fmt: skip
        else:
            d = self.difficulty
            wind, current, height, way, drift = generator.random(5)
            set_weather(self.worlds[b], wind_speed=12.0 * d * wind, wind_to=2 * np.pi * way,
                        current_speed=0.6 * d * current, current_to=2 * np.pi * drift,
                        wave_height=1.5 * d * height, wave_to=2 * np.pi * way, original=original)  # fmt: skip

    def step(self, mask: NDArray[np.bool_], rows: NDArray[np.float64] = NO_ROWS) -> None:
        """One control step of the rows of ``mask`` with ``self.actions``; results are in obs, reward, terms, ...

        Raises
        ------
        ValueError
            if an action is not finite; nothing has moved then.
        """
        self._what[:] = mask
        self._what *= 2  # STEP
        bad = self._run(rows)
        if bad >= 0:
            raise ValueError(f"action {self.actions[bad].tolist()} is not finite" + (f" (row {bad})" if self.num > 1 else ""))

    def _run(self, rows: NDArray[np.float64]) -> int:
        from ..tasks.step import run_batch

        bad: int = run_batch(self.worlds, self.task, self.episodes, self._what, self.actions, rows, self.obs, self.terms,
                             self.reward, self.terminated, self.truncated)  # fmt: skip
        return bad

    def observe(self) -> NDArray[np.float32]:
        """Observations [B, n] of the records as they are now; does not advance anything."""
        from ..tasks.step import observe_batch

        observe_batch(self.worlds, self.task, self.obs)
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
            **{name: getattr(config, name) for name in (
                "range_scale", "distance_scale", "cross_track_scale", "target_speed_scale", "radius_scale", "rate_scale")},
        }  # fmt: skip

    def info(self, b: int) -> dict[str, Any]:
        """The info dict of row b after a step."""
        episode = self.episodes[b]
        outcome = OUTCOMES[episode["outcome"]]
        return {
            "reward_terms": dict(zip(TERMS, self.terms[b].tolist(), strict=True)),
            "time": float(self.worlds["tick"][b] * self.worlds["dt"][b]),
            "closest": float(episode["closest"]),
            "to_go": float(episode["to_go"]),
            "outcome": outcome,
            "is_success": outcome == "arrival",
        }


def check_difficulty(value: Any) -> float:
    """Difficulty as a float in [0, 1]; ConfigError otherwise."""
    if not isinstance(value, int | float) or not 0.0 <= value <= 1.0:
        raise ConfigError(f"difficulty: expected a number from 0 to 1, got {value!r}")
    return float(value)


def check_weather(value: Any) -> None:
    """ConfigError unless the value names or describes a weather."""
    if value is not None and not isinstance(value, Mapping) and value not in _WEATHERS:
        raise ConfigError(f"weather: expected one of {', '.join(_WEATHERS)} or a mapping, got {value!r}")
