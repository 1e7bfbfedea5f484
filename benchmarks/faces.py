"""Rates of the faces: one world through ``Env.step``, batches natively and in threads, stable-baselines3, and peers."""

from __future__ import annotations

from typing import Any

import gymnasium as gym
import numpy as np
from measure import ACTION, WARM, rewinder, rounds
from seas import crowded_sea

import usv_gym  # noqa: F401

SCENARIO = "usv_gym/Scenario-v0"
ENDLESS = {"end_on_collision": False, "end_on_arrival": False, "end_out_of_area": False}
#: what is measured: name, observation, filters of the Target Detection Module
SIGHTS = (
    ("truth", "truth", "thesis"), ("ais", "ais", "thesis"), ("tracks", "tracks", "thesis"), ("tracks, light", "tracks", "light")
)  # fmt: skip


def arguments(observation: str, filters: str, scenario: dict[str, Any]) -> dict[str, Any]:
    """What ``gym.make`` and ``gym.make_vec`` take."""
    return {"scenario": scenario, "observation": observation, "overrides": [f"sensors.tdm.filter={filters}"], **ENDLESS}


def one_world(seconds: float, **kwargs: Any) -> dict[str, float]:
    """``gym.make(...).step``."""
    env = gym.make(SCENARIO, **kwargs)
    action = np.array(ACTION, np.float32)
    env.reset(seed=1)
    for _ in range(WARM):
        env.step(action)

    def work() -> int:
        for _ in range(300):
            env.step(action)
        return 300

    result = rounds(work, seconds, rewinder(env.unwrapped.core))  # type: ignore[attr-defined]
    tracked = float(env.unwrapped.world["picture"]["count"][0])  # type: ignore[attr-defined]
    env.close()
    return {**result, "tracked": tracked}


def batch(seconds: float, worlds: int, threads: int = 1, **kwargs: Any) -> dict[str, float]:
    """``gym.make_vec(..., worlds).step``, in environment steps a second."""
    env = gym.make_vec(SCENARIO, worlds, num_threads=threads, **kwargs)
    actions = np.tile(np.array(ACTION, np.float32), (worlds, 1))
    env.reset(seed=1)
    for _ in range(WARM):
        env.step(actions)
    steps = max(2000 // worlds, 30)  # so many that a rewind, which empties the caches, does not count

    def work() -> int:
        for _ in range(steps):
            env.step(actions)
        return steps * worlds

    result = rounds(work, seconds, rewinder(env.unwrapped.core))  # type: ignore[attr-defined]
    env.close()
    return result


def threads(seconds: float, worlds: int, crew: int, figure: str = "steps_per_s", **kwargs: Any) -> float:
    """Rate of ``crew`` threads over that of one, in rounds that alternate: what each can do, or by ``median`` what it did."""
    envs = [gym.make_vec(SCENARIO, worlds, num_threads=n, **kwargs) for n in (1, crew)]
    actions = np.tile(np.array(ACTION, np.float32), (worlds, 1))
    for env in envs:
        env.reset(seed=1)
        for _ in range(WARM):
            env.step(actions)
    steps = max(4000 // worlds, 30)
    rates: list[list[float]] = [[], []]

    def work(env: Any) -> int:
        for _ in range(steps):
            env.step(actions)
        return steps * worlds

    rewind = [rewinder(env.unwrapped.core) for env in envs]  # type: ignore[attr-defined]
    for _ in range(4):
        for k, env in enumerate(envs):
            rates[k].append(rounds(lambda env=env: work(env), seconds / 8.0, rewind[k])[figure])  # type: ignore[misc]
    for env in envs:
        env.close()
    one, all_of_them = (max(found) if figure == "steps_per_s" else float(np.median(found)) for found in rates)
    return all_of_them / one


def sb3(seconds: float, worlds: int, **kwargs: Any) -> dict[str, float] | None:
    """Steps/s through the adapter, DummyVecEnv and SubprocVecEnv, of PPO's rollouts, and of the vector environment alone."""
    try:
        import torch
        from stable_baselines3 import PPO
        from stable_baselines3.common.vec_env import DummyVecEnv, SubprocVecEnv, VecEnv

        from usv_gym.sb3 import make_vec_env
    except ImportError:
        return None
    torch.set_num_threads(1)
    actions = np.tile(np.array(ACTION, np.float32), (worlds, 1))

    def rate(env: VecEnv, steps: int) -> float:
        given = actions[: env.num_envs]
        env.reset()
        for _ in range(5):
            env.step(given)

        def work() -> int:
            for _ in range(steps):
                env.step(given)
            return steps * env.num_envs

        result = rounds(work, seconds)["steps_per_s"]
        env.close()
        return result

    def make() -> gym.Env[Any, Any]:
        return gym.make(SCENARIO, **kwargs)

    result = {
        "adapter": rate(make_vec_env(SCENARIO, worlds, **kwargs), 30),
        "dummy": rate(DummyVecEnv([make] * worlds), 5),
        "subproc": rate(SubprocVecEnv([make] * min(worlds, 8), start_method="fork"), 20),
        "vector": batch(seconds, worlds, **kwargs)["steps_per_s"],
    }
    env = make_vec_env(SCENARIO, worlds, **kwargs)
    model = PPO("MlpPolicy", env, n_steps=32, batch_size=32 * worlds, policy_kwargs={"net_arch": [64, 64]}, device="cpu")
    _, callback = model._setup_learn(1 << 30)

    def rollout() -> int:
        model.collect_rollouts(env, callback, model.rollout_buffer, n_rollout_steps=32)
        return 32 * worlds

    result["ppo_rollouts"] = rounds(rollout, seconds)["steps_per_s"]
    env.close()
    return result


def peers(seconds: float) -> dict[str, dict[str, float] | None]:
    """Steps/s of what pip can install of the competition, and of the smallest environment there is."""
    result: dict[str, dict[str, float] | None] = {}
    for name, module in (("CartPole-v1", None), ("highway-v0", "highway_env"), ("highway-fast-v0", "highway_env")):
        try:
            if module:
                gym.register_envs(__import__(module))
            env = gym.make(name)
        except (ImportError, gym.error.Error):
            result[name] = None
            continue
        steps = 10 if module else 2000
        result[name] = rounds(lambda env=env, steps=steps: _play(env, steps), seconds)  # type: ignore[misc]
        env.close()
    return result


def _play(env: gym.Env[Any, Any], steps: int) -> int:
    env.reset(seed=1)
    for _ in range(steps):
        _, _, terminated, truncated, _ = env.step(env.action_space.sample())
        if terminated or truncated:
            env.reset()
    return steps


def sea(ships: int = 16, icebergs: int = 32, **kwargs: Any) -> dict[str, Any]:
    """The sea that everything is measured in (seas.py)."""
    return crowded_sea(ships, icebergs, **kwargs)
