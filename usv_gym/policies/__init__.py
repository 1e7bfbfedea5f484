"""Controllers that ship with the package, by name, and those of others, by file."""

from __future__ import annotations

import importlib
from pathlib import Path

from ..config import ConfigError, suggestion
from .base import Controller

#: name: (module:class, what it does); imported when it is asked for, because it compiles
POLICIES: dict[str, tuple[str, str]] = {
    "waypoints": ("waypoints:Waypoints", "line-of-sight guidance along the route; sees no traffic"),
    "avoid": ("avoid:Avoid", "the same, going around what the TDM reports; an honest reactive baseline"),
    "vo": ("vo:VelocityObstacles", "velocity obstacles with COLREGs (Kuwata et al. 2014)"),
    "sbmpc": ("sbmpc:SimulationBasedMPC", "simulation-based model predictive control (Johansen et al. 2016)"),
    "apf": ("apf:PotentialField", "potential field that turns with the rules (Ge and Cui 2002, Lyu and Yin 2019)"),
    "idle": ("idle:Idle", "no thrust"),
}
#: drives the actuators from a recorded mission; needs no observation, so it is no controller
THRUST_LOG = "thrust-log"
#: ``PREFIX:ARGUMENT`` -> ``module:function`` that makes the controller; by name, because these stand above policies
FACTORIES = {"hil": "usv_gym.hil.rig:policy"}


def make_policy(name: str, *, trust: bool = False) -> Controller:
    """A controller: built in, learned (a file), behind a wire (``hil:RIG.yaml``), or of one's own
    (``module:Class``, ``path.py:Class``).

    ``trust`` also takes files of stable-baselines3 that execute code when they are read; see
    :func:`~usv_gym.policies.learned.load_policy`.

    Raises
    ------
    ConfigError
        if there is none of that name, the file is no policy, or the class no controller.
    """
    if name in POLICIES:
        module, _, cls = POLICIES[name][0].partition(":")
        controller: Controller = getattr(importlib.import_module(f"{__name__}.{module}"), cls)()
        return controller
    prefix, _, argument = name.partition(":")
    if prefix in FACTORIES:
        module, _, function = FACTORIES[prefix].partition(":")
        outside: Controller = getattr(importlib.import_module(module), function)(argument)
        return outside
    if is_custom(name):
        from .custom import load_custom

        return load_custom(name)
    if Path(name).suffix == ".zip" or Path(name).is_file():
        from .learned import load_policy

        return load_policy(name, trust=trust)
    raise ConfigError(
        f"unknown policy {name!r}{suggestion(name, [*POLICIES, THRUST_LOG])} "
        "(a controller of your own: my.py:Class or module:Class; a learned one: policy.zip)"
    )


def is_custom(name: str) -> bool:
    """Whether a policy is code of the user's: ``module:Class``, ``path.py:Class`` or ``path.py``."""
    return ":" in name or name.endswith(".py")


__all__ = ["POLICIES", "THRUST_LOG", "Controller", "is_custom", "make_policy"]
