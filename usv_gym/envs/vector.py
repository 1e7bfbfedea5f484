"""The Gymnasium vector face: B worlds in one process, one kernel call per step."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium.utils.seeding import np_random
from gymnasium.vector import AutoresetMode
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from ..jit import compiling
from ..scenarios.commands import Commands
from ..scenarios.loader import Source
from ..tasks.task import task_config, unflatten
from .core import Core, check_difficulty, check_weather, masked
from .single import USVEnv, with_family

Step = tuple[Any, NDArray[np.float64], NDArray[np.bool_], NDArray[np.bool_], dict[str, Any]]


class Row:
    """One world of a vector environment: what :meth:`USVVectorEnv.get_attr`, ``set_attr`` and ``call`` reach.

    ``difficulty`` and ``weather`` can be set; the next reset of the row draws from them.
    """

    def __init__(self, env: USVVectorEnv, b: int) -> None:
        self._env, self._b = env, b
        self.action_space, self.observation_space = env.single_action_space, env.single_observation_space
        self.render_mode, self.metadata = env.render_mode, env.metadata
        self.forget()

    def forget(self) -> None:
        """Drop what belongs to the episode that is over."""
        self._commands: Commands | None = None
        self._history: Any = None

    @property
    def spec(self) -> Any:
        """The ``EnvSpec`` of the vector environment."""
        return self._env.spec

    @property
    def world(self) -> Any:
        """The record of the world (a view; see world/state.py)."""
        return self._env.core.worlds[self._b]

    @property
    def commands(self) -> Commands:
        """Commands to the running world; see :attr:`USVEnv.commands`."""
        if self._commands is None:
            core = self._env.core
            self._commands = Commands(core.worlds, self._b, core.ids(self._b), core.scenario)
        return self._commands

    @property
    def np_random(self) -> np.random.Generator:
        """The generator of the row."""
        return self._env.generators[self._b]

    @property
    def np_random_seed(self) -> int:
        """The seed of the generator of the row."""
        return self._env.seeds[self._b]

    @property
    def difficulty(self) -> float:
        """Of the next episode, 0 to 1."""
        return float(self._env.core.difficulty[self._b])

    @difficulty.setter
    def difficulty(self, value: float) -> None:
        self._env.core.difficulty[self._b] = check_difficulty(value)

    @property
    def weather(self) -> Any:
        """Of the next episode: a name, a mapping, or None for the scenario's own."""
        return self._env.core.weather[self._b]

    @weather.setter
    def weather(self, value: Any) -> None:
        self._env.core.weather[self._b] = check_weather(value)

    def set(self, name: str, value: Any) -> None:
        """Set ``difficulty`` or ``weather``.

        Raises
        ------
        AttributeError
            for any other name: setting it would do nothing.
        """
        if name not in ("difficulty", "weather"):
            raise AttributeError(f"a row has no attribute {name!r} to set; difficulty and weather can be set")
        setattr(self, name, value)

    def info(self) -> dict[str, Any]:
        """The info dict of the row as it is now."""
        return self._env.core.info(self._b)

    def render(self) -> NDArray[np.uint8] | None:
        """The map as [H, W, 3]; None without a render mode."""
        if self.render_mode is None:
            return None
        from ..render.pygame_view import render
        from ..render.scene import History, scene_from_snapshot

        if self._history is None:
            self._history = History()
        names = self._commands.names if self._commands else self._env.core.ids(self._b)
        scene = scene_from_snapshot(self.world, names, self._history, coast=self._env.core.coast(self._b))
        return render(scene, size=(800, 800))


class USVVectorEnv(gym.vector.VectorEnv[Any, Any, NDArray[Any]]):
    """``num_envs`` worlds of one task; the numbers are those of ``SyncVectorEnv`` over single environments, bit for bit.

    ``gym.make_vec("usv_gym/OpenSea-v0", 64)`` makes one.  Each row has its own random generator, seeded ``seed + row`` or
    from a list, and its own episode, which ends where that of the single environment does.

    Parameters
    ----------
    num_envs
        B, the number of worlds.
    autoreset_mode
        what happens when an episode ends: its row is reset by the next ``step`` (``NEXT_STEP``), by the same one
        (``SAME_STEP``: the last observation and info are in ``infos["final_obs"]`` and ``infos["final_info"]``), or by the
        caller with ``reset(options={"reset_mask": mask})`` (``DISABLED``).
    num_threads
        threads that share the rows; 1 is serial.  Worth it from about 64 rows; changes no bit.
    max_episode_steps
        ends episodes sooner than the scenario's duration does.
    scenario, vessel, difficulty, weather, overrides, reward, render_mode, **task
        as for the single environment, :class:`~usv_gym.envs.single.USVEnv`.

    ``reset(options=...)`` takes ``reset_mask`` and the options of the single environment, for the rows that are reset; all
    rows share scenario and vessel.
    """

    def __init__(
        self,
        num_envs: int = 1,
        scenario: Source = "busy_open_sea",
        *,
        autoreset_mode: str | AutoresetMode = AutoresetMode.NEXT_STEP,
        num_threads: int = 1,
        max_episode_steps: int | None = None,
        vessel: str | None = None,
        difficulty: float | None = None,
        weather: str | Mapping[str, Any] | None = None,
        overrides: Sequence[str] = (),
        reward: Mapping[str, float] | None = None,
        render_mode: str | None = None,
        **task: Any,
    ) -> None:
        if num_envs < 1:
            raise ValueError(f"num_envs: expected a whole number of at least 1, got {num_envs!r}")
        if render_mode not in (None, "rgb_array"):
            raise ValueError(f"render_mode: expected 'rgb_array', got {render_mode!r}")
        config = task_config(task, reward)
        self.autoreset_mode = AutoresetMode(autoreset_mode)
        self.metadata = {**USVEnv.metadata, "render_modes": ["rgb_array"], "autoreset_mode": self.autoreset_mode}
        self.num_envs = num_envs
        self.render_mode = render_mode
        with compiling():
            self.core = Core(num_envs, source=scenario, config=config, vessel=vessel, overrides=overrides, weather=weather,
                             difficulty=difficulty, max_steps=max_episode_steps, num_threads=num_threads)  # fmt: skip
        self.single_action_space = self.core.action_space
        self.single_observation_space = self.core.observation_space
        self.action_space = batch_space(self.single_action_space, num_envs)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.rows = tuple(Row(self, b) for b in range(num_envs))
        owned = [np_random() for _ in range(num_envs)]
        self.generators, self.seeds = [generator for generator, _ in owned], [seed for _, seed in owned]
        self._all = np.ones(num_envs, np.bool_)
        self._started = np.zeros(num_envs, np.bool_)
        self._all_started = False
        self._action_shape = self.action_space.shape
        self._ended = np.zeros(num_envs, np.bool_)
        self._any_ended = False

    @property  # type: ignore[misc]
    def np_random(self) -> tuple[np.random.Generator, ...]:  # type: ignore[override]
        """The random generator of each row."""
        return tuple(self.generators)

    @property
    def np_random_seed(self) -> tuple[int, ...]:  # type: ignore[override]
        """The seed of the generator of each row."""
        return tuple(self.seeds)

    # --- running -----------------------------------------------------------------------------------------------------
    def begin(self, mask: NDArray[np.bool_]) -> None:
        """Start new episodes in the rows of ``mask`` [B]; what comes of it is in ``core``."""
        with compiling():
            self.core.reset(mask, self.generators)
        for b in np.flatnonzero(mask).tolist():
            self.rows[b].forget()

    def advance(self, actions: Any, mask: NDArray[np.bool_] | None = None) -> None:
        """One control step of the rows of ``mask`` [B], or of all; what comes of it is in ``core``.

        Raises
        ------
        gymnasium.error.ResetNeeded
            before the first reset of a row.
        ValueError
            if the actions have a wrong shape or one is not finite.
        """
        if not self._all_started:
            raise gym.error.ResetNeeded("call reset() before step()")
        try:
            given = np.asarray(actions)
            fits = given.shape == self._action_shape
            if fits:
                self.core.actions[:] = given.reshape(self.core.actions.shape)
        except (ValueError, TypeError):
            fits = False
        if not fits:
            raise ValueError(f"actions {' '.join(repr(actions).split())[:200]} do not fit {self.action_space}")
        self.core.step(mask)

    def reset(
        self,
        *,
        seed: int | Sequence[int | None] | None = None,
        options: dict[str, Any] | None = None,
    ) -> tuple[Any, dict[str, Any]]:
        """Start new episodes, in all rows or in those of ``options["reset_mask"]``.

        Raises
        ------
        ConfigError
            for options that no row can take; see :meth:`Core.configure`.
        """
        if seed is None or isinstance(seed, int | np.integer):
            seeds: Sequence[int | None] = [None if seed is None else int(seed) + b for b in range(self.num_envs)]
        else:
            seeds = seed
        if len(seeds) != self.num_envs:
            raise ValueError(f"seed: expected {self.num_envs} seeds, one for each environment, got {len(seeds)}")
        others = dict(options or {})
        mask = self._checked(others.pop("reset_mask")) if "reset_mask" in others else self._all.copy()
        self.core.configure(others, mask)
        for b in np.flatnonzero(mask).tolist():
            if seeds[b] is not None:
                self.generators[b], self.seeds[b] = np_random(seeds[b])
        self.begin(mask)
        self._started[mask] = True
        self._all_started = bool(self._started.all())
        self._ended = self._ended & ~mask
        self._any_ended = bool(self._ended.any())
        return self.observation(), self._reset_infos(self.core.infos(mask), mask)

    def step(self, actions: Any) -> Step:
        """Advance all rows by one control interval; see ``autoreset_mode`` for those whose episode has ended."""
        core, ended, any_ended = self.core, self._ended, self._any_ended
        if self.autoreset_mode is AutoresetMode.NEXT_STEP:
            if any_ended:
                self.advance(actions, ~ended)
                self.begin(ended)
            else:
                self.advance(actions)
        elif self.autoreset_mode is AutoresetMode.DISABLED:
            if any_ended:
                raise gym.error.ResetNeeded(
                    f"the episodes of rows {np.flatnonzero(ended).tolist()} have ended: reset them with "
                    "reset(options={'reset_mask': mask})"
                )
            self.advance(actions)
        else:
            self.advance(actions)
        results = core.results()
        reward, (terminated, truncated, over, _) = results[0][0], results[1]
        any_over = 1 in over.tobytes()  # far sooner than any()
        infos: dict[str, Any] = {}
        restarted, any_restarted = ended, any_ended
        if self.autoreset_mode is AutoresetMode.SAME_STEP:
            restarted, any_restarted = over, any_over
            if any_over:
                last = np.full(self.num_envs, None, object)
                for b in np.flatnonzero(over).tolist():
                    last[b] = self.observation(b)
                infos = masked({"final_obs": last, "final_info": core.infos(over)}, over)
                self.begin(over)
                results = core.results()
        self._ended, self._any_ended = over, any_over
        infos.update(core.infos(self._all.copy(), results, any_over))
        if any_restarted:
            self._reset_infos(infos, restarted)
        return self.observation(), reward, terminated, truncated, infos

    def observation(self, rows: int | slice = slice(None)) -> Any:
        """A copy of the observations as they are now, batched, or of one row."""
        flat = self.core.obs[rows]
        return flat.copy() if self.core.config.flat else unflatten(self.core.config, flat)

    def _checked(self, mask: Any) -> NDArray[np.bool_]:
        if not isinstance(mask, np.ndarray) or mask.dtype != np.bool_ or mask.shape != (self.num_envs,) or not mask.any():
            raise ValueError(f"options['reset_mask']: expected a bool array of shape ({self.num_envs},) with at least one "
                             f"True, got {mask!r}")  # fmt: skip
        return mask.copy()

    def _reset_infos(self, infos: dict[str, Any], mask: NDArray[np.bool_]) -> dict[str, Any]:
        """Add what only a reset tells, the scales, for the rows of ``mask`` [B]."""
        if mask.any():
            scales = {key: np.where(mask, value, np.zeros((), type(value))) for key, value in self.core.scales().items()}
            infos.update(masked({"scales": masked(scales, mask)}, mask))
        return infos

    # --- rows --------------------------------------------------------------------------------------------------------
    def call(self, name: str, *args: Any, **kwargs: Any) -> tuple[Any, ...]:
        """Of every row: what its method returns, or its attribute; see :class:`Row`."""
        found = [getattr(row, name) for row in self.rows]
        return tuple(value(*args, **kwargs) if callable(value) else value for value in found)

    def get_attr(self, name: str) -> tuple[Any, ...]:
        """An attribute of every row; see :class:`Row`."""
        return self.call(name)

    def set_attr(self, name: str, values: Any) -> None:
        """Set an attribute of every row, from a list of one value for each, or one for all; see :class:`Row`."""
        each = list(values) if isinstance(values, list | tuple) else [values] * self.num_envs
        if len(each) != self.num_envs:
            raise ValueError(f"set_attr({name!r}): expected {self.num_envs} values, got {len(each)}")
        for row, value in zip(self.rows, each, strict=True):
            row.set(name, value)

    def render(self) -> tuple[Any, ...] | None:
        """The map of every row as [H, W, 3]; None without a render mode."""
        return None if self.render_mode is None else tuple(row.render() for row in self.rows)

    def close_extras(self, **kwargs: Any) -> None:
        """Let the threads go."""
        self.core.crew.close()


class FamilyVectorEnv(USVVectorEnv):
    """An id with a sea of its own, ``num_envs`` times: a new sea at every reset of a row."""

    def __init__(self, num_envs: int = 1, *, sea: str, **kwargs: Any) -> None:
        super().__init__(num_envs, sea, **with_family(sea, kwargs))


class ScenarioVectorEnv(USVVectorEnv):
    """``usv_gym/Scenario-v0``, ``num_envs`` times: a scenario by name, path or mapping."""

    def __init__(self, num_envs: int = 1, scenario: Source = "busy_open_sea", **kwargs: Any) -> None:
        super().__init__(num_envs, scenario, **kwargs)
