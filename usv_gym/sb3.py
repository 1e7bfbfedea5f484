"""The stable-baselines3 face: the native vector environment as a ``VecEnv``.  Needs the extra ``train``."""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import Any

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

from .envs.vector import Row, USVVectorEnv

try:
    from stable_baselines3.common.monitor import Monitor
    from stable_baselines3.common.vec_env import VecEnv
except ImportError as error:
    raise ImportError(f"training needs stable-baselines3 ({error}): pip install 'usv-gym[train]'") from error


class SB3VecEnv(VecEnv):
    """A :class:`~usv_gym.envs.vector.USVVectorEnv` for stable-baselines3; it replaces ``DummyVecEnv`` and ``Monitor``.

    A row whose episode ends is reset in the same step.  Its info then is the info of the last step with
    ``terminal_observation``, ``TimeLimit.truncated`` and what ``Monitor`` would say (``episode``: return r, length l, time t);
    the infos of running rows hold nothing but ``TimeLimit.truncated``, because making them would cost more than the step.
    ``env_method``, ``get_attr`` and ``set_attr`` reach :class:`~usv_gym.envs.vector.Row`, so ``set_attr("difficulty", 0.8)``
    makes a curriculum.

    Parameters
    ----------
    env
        the vector environment; the adapter drives it from then on.
    reward_scale
        factor on the rewards that the learner sees; ``episode`` counts them unscaled.
    """

    def __init__(self, env: USVVectorEnv, *, reward_scale: float = 1.0) -> None:
        self.env = env
        self.reward_scale = reward_scale
        self._returns = np.zeros(env.num_envs)
        self._began = time.perf_counter()
        self._actions: Any = None
        super().__init__(env.num_envs, env.single_observation_space, env.single_action_space)

    # --- running -----------------------------------------------------------------------------------------------------
    def reset(self) -> Any:
        """Start new episodes in all rows, with the seeds and options that were set before."""
        core = self.env.core
        first = self._options[0]
        if all(options == first for options in self._options):
            core.configure(first)
        else:
            for b, options in enumerate(self._options):
                core.configure(options, np.arange(self.num_envs) == b)
        self.env.reset(seed=self._seeds)
        self._reset_seeds()
        self._reset_options()
        self._returns[:] = 0.0
        self.reset_infos = [{**core.info(b), "scales": core.scales()} for b in range(self.num_envs)]
        return self.env.observation()

    def step_async(self, actions: NDArray[Any]) -> None:
        """Take the actions of the next :meth:`step_wait`."""
        self._actions = actions

    def step_wait(self) -> tuple[Any, NDArray[np.float32], NDArray[np.bool_], list[dict[str, Any]]]:
        """Advance all rows by one control interval."""
        env, core = self.env, self.env.core
        env.advance(self._actions)
        done = core.terminated | core.truncated
        reward = (core.reward * self.reward_scale).astype(np.float32)
        self._returns += core.reward
        infos: list[dict[str, Any]] = [{"TimeLimit.truncated": False} for _ in range(self.num_envs)]
        if done.any():
            over = np.flatnonzero(done).tolist()
            elapsed = round(time.perf_counter() - self._began, 6)
            for b in over:
                infos[b] = {
                    **core.info(b),
                    "TimeLimit.truncated": bool(core.truncated[b]),
                    "terminal_observation": env.observation(b),
                    "episode": {
                        "r": round(float(self._returns[b]), 6), "l": int(core.episodes["step"][b]), "t": elapsed
                    },
                }  # fmt: skip
            self._returns[done] = 0.0
            env.begin(done)
            for b in over:
                self.reset_infos[b] = {**core.info(b), "scales": core.scales()}
        return env.observation(), reward, done, infos

    def close(self) -> None:
        """Release the environment."""
        self.env.close()

    # --- rows --------------------------------------------------------------------------------------------------------
    def _rows(self, indices: Any) -> list[Row]:
        return [self.env.rows[b] for b in self._get_indices(indices)]

    def get_attr(self, attr_name: str, indices: Any = None) -> list[Any]:
        """An attribute of rows."""
        return [getattr(row, attr_name) for row in self._rows(indices)]

    def set_attr(self, attr_name: str, value: Any, indices: Any = None) -> None:
        """Set an attribute of rows, ``difficulty`` or ``weather``; their next reset draws from it."""
        for row in self._rows(indices):
            row.set(attr_name, value)

    def env_method(self, method_name: str, *method_args: Any, indices: Any = None, **method_kwargs: Any) -> list[Any]:
        """Call a method of rows."""
        return [getattr(row, method_name)(*method_args, **method_kwargs) for row in self._rows(indices)]

    def env_is_wrapped(self, wrapper_class: type[gym.Wrapper[Any, Any, Any, Any]], indices: Any = None) -> list[bool]:
        """True for ``Monitor``, whose work is done here; False for any other wrapper."""
        return [issubclass(wrapper_class, Monitor) for _ in self._rows(indices)]

    def get_images(self) -> Sequence[NDArray[np.uint8] | None]:
        """The map of every row."""
        return self.env.render() or [None] * self.num_envs


def make_vec_env(id: str, n_envs: int = 64, *, reward_scale: float = 1.0, **kwargs: Any) -> SB3VecEnv:
    """``gym.make_vec(id, n_envs, **kwargs)`` for stable-baselines3.

    Raises
    ------
    ValueError
        if the environment is none of this package.
    """
    env = gym.make_vec(id, n_envs, **kwargs)
    if not isinstance(env, USVVectorEnv):
        raise ValueError(f"{id} is not an environment of usv_gym")
    return SB3VecEnv(env, reward_scale=reward_scale)
