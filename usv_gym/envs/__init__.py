"""The faces of the sea.  Importing this registers nothing heavy: kernels load with the first environment."""

from __future__ import annotations

import gymnasium as gym

#: id -> entry points of one world and of a batch
ENVIRONMENTS = {
    "usv_gym/OpenSea-v0": ("usv_gym.envs.single:OpenSeaEnv", "usv_gym.envs.vector:OpenSeaVectorEnv"),
    "usv_gym/Scenario-v0": ("usv_gym.envs.single:ScenarioEnv", "usv_gym.envs.vector:ScenarioVectorEnv"),
}


def register_all() -> None:
    """Register every environment with Gymnasium; doing it twice is harmless.

    The environments check their own actions, order and episode length, so Gymnasium's per-step wrappers are left out.
    """
    for name, (one, many) in ENVIRONMENTS.items():
        if name not in gym.registry:
            gym.register(name, one, vector_entry_point=many, order_enforce=False, disable_env_checker=True)
