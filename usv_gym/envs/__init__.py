"""The faces of the sea.  Importing this registers nothing heavy: kernels load with the first environment."""

from __future__ import annotations

import gymnasium as gym

#: id -> what it is, and the scenario that it draws its seas from; None: ``scenario=`` is an argument
ENVIRONMENTS: dict[str, tuple[str, str | None]] = {
    "usv_gym/OpenSea-v0": ("a new random open sea at every reset: a route, icebergs, crossing ships, weather", "open_sea"),
    "usv_gym/NearShore-v0": ("narrow waters: land to both sides, islands, unpredictable leisure boats", "near_shore"),
    "usv_gym/BusyPort-v0": ("a port: fairway, quays, moored and moving vessels, ferries", "busy_port"),
    "usv_gym/Encounter-v0": ("ships on collision courses, by class of encounter, distance and time of the CPA", "encounter"),
    "usv_gym/Imazu-v0": ("one of the 22 cases of Imazu at every reset, or case= one of them", "imazu"),
    "usv_gym/Scenario-v0": ("a scenario by name, file or mapping", None),
}


def register_all() -> None:
    """Register every environment with Gymnasium; doing it twice is harmless.

    The environments check their own actions, order and episode length, so Gymnasium's per-step wrappers are left out.
    """
    for name, (_, sea) in ENVIRONMENTS.items():
        if name not in gym.registry:
            kind = "Scenario" if sea is None else "Family"
            gym.register(
                name,
                f"usv_gym.envs.single:{kind}Env",
                vector_entry_point=f"usv_gym.envs.vector:{kind}VectorEnv",
                kwargs={} if sea is None else {"sea": sea},
                order_enforce=False,
                disable_env_checker=True,
            )
