"""The faces of the sea.  Importing this registers nothing heavy: kernels load with the first environment."""

from __future__ import annotations

import gymnasium as gym

#: id -> entry point
ENVIRONMENTS = {
    "usv_gym/OpenSea-v0": "usv_gym.envs.single:OpenSeaEnv",
    "usv_gym/Scenario-v0": "usv_gym.envs.single:ScenarioEnv",
}


def register_all() -> None:
    """Register every environment with Gymnasium; doing it twice is harmless.

    The environments check their own actions, order and episode length, so Gymnasium's per-step wrappers are left out.
    """
    for name, entry_point in ENVIRONMENTS.items():
        if name not in gym.registry:
            gym.register(name, entry_point, order_enforce=False, disable_env_checker=True)
