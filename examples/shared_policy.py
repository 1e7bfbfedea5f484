"""One policy for all ships of ``traffic_v0``, trained with SuperSuit and stable-baselines3.

    pip install 'usv-gym[pettingzoo,train]' supersuit
    python examples/shared_policy.py [--steps 200000] [--out shared_policy.zip]

Ships of different vessels become one kind of agent: SuperSuit pads observations and actions to one space, ``black_death_v3``
lets an agent that has left stay on as zeros, and the agents of several seas become the rows of one vector environment.
"""

from __future__ import annotations

import argparse
from typing import Any

import supersuit
from stable_baselines3 import PPO
from stable_baselines3.common.utils import set_random_seed

from usv_gym import traffic_v0


def vector_env(seas: int = 4, **kwargs: Any) -> Any:
    """``seas`` seas of ``traffic_v0.parallel_env(**kwargs)`` as a ``VecEnv`` with a row per ship."""
    env = traffic_v0.parallel_env(**kwargs)
    env = supersuit.black_death_v3(env)
    env = supersuit.pad_observations_v0(env)
    env = supersuit.pad_action_space_v0(env)
    rows = supersuit.pettingzoo_env_to_vec_env_v1(env)
    return supersuit.concat_vec_envs_v1(rows, seas, num_cpus=0, base_class="stable_baselines3")


def train(steps: int, seas: int = 4, **kwargs: Any) -> Any:
    """The trained model; ``kwargs`` go to the environment."""
    ships = {"agents": 4, "vessels": ("odin", "otter", "ship"), "observation": "truth", **kwargs}
    set_random_seed(1)  # of the learner; SuperSuit's vector environment cannot be seeded after it is made
    model = PPO("MlpPolicy", vector_env(seas, **ships), n_steps=128, batch_size=512, device="cpu")
    return model.learn(steps)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--steps", type=int, default=200_000, help="of all ships together")
    parser.add_argument("--out", default="shared_policy.zip")
    options = parser.parse_args()
    if options.steps < 1:
        parser.error(f"--steps: expected a whole number of at least 1, got {options.steps}")
    train(options.steps).save(options.out)
    print(f"wrote {options.out}")


if __name__ == "__main__":
    main()
