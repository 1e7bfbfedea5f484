"""Controllers that ship with the package, by name."""

from __future__ import annotations

from pathlib import Path

from ..config import ConfigError, suggestion
from .base import Controller
from .baselines import Avoid, Idle, Waypoints

POLICIES: dict[str, tuple[type, str]] = {
    "waypoints": (Waypoints, "line-of-sight guidance along the route; sees no traffic"),
    "avoid": (Avoid, "the same, going around what the TDM reports; an honest reactive baseline"),
    "idle": (Idle, "no thrust"),
}
#: drives the actuators from a recorded mission; needs no observation, so it is no controller
THRUST_LOG = "thrust-log"


def make_policy(name: str, *, trust: bool = False) -> Controller:
    """A built-in controller by name, or a learned one from its file.

    ``trust`` also takes files that execute code when they are read; see :func:`~usv_gym.policies.learned.load_policy`.

    Raises
    ------
    ConfigError
        if there is none of that name, or the file is no policy.
    """
    if name not in POLICIES and (Path(name).suffix == ".zip" or Path(name).is_file()):
        from .learned import load_policy

        return load_policy(name, trust=trust)
    if name not in POLICIES:
        raise ConfigError(f"unknown policy {name!r}{suggestion(name, [*POLICIES, THRUST_LOG])}")
    controller: Controller = POLICIES[name][0]()
    return controller


__all__ = ["POLICIES", "THRUST_LOG", "Controller", "make_policy"]
