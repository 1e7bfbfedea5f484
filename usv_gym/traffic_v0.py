"""PettingZoo's conventional module: ``from usv_gym import traffic_v0; env = traffic_v0.parallel_env(agents=4)``.

Needs the extra ``pettingzoo``.  Importing it also registers ``usv_gym/traffic_v0`` with PettingZoo's registry, if it has one.
"""

from __future__ import annotations

from typing import Any

try:
    from pettingzoo.utils import parallel_to_aec, wrappers
except ImportError as error:  # pragma: no cover
    raise ImportError("traffic_v0 needs PettingZoo: pip install 'usv-gym[pettingzoo]'") from error

from .envs.parallel import TrafficEnv


def parallel_env(**kwargs: Any) -> TrafficEnv:
    """All agents act at once; see ``usv_gym.envs.parallel.TrafficEnv``."""
    return TrafficEnv(**kwargs)


def raw_env(**kwargs: Any) -> Any:
    """The agents act in turn, without checks of the order."""
    return parallel_to_aec(parallel_env(**kwargs))


def env(**kwargs: Any) -> Any:
    """The agents act in turn, with PettingZoo's usual checks."""
    return wrappers.OrderEnforcingWrapper(raw_env(**kwargs))


def _register() -> None:
    try:
        from pettingzoo.env_registry.registration import register
    except ImportError:  # older PettingZoo
        return
    register("parallel", "usv_gym/traffic_v0", entry_point="usv_gym.traffic_v0:parallel_env")
    register("aec", "usv_gym/traffic_v0", entry_point="usv_gym.traffic_v0:env")


_register()
