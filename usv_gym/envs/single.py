"""The Gymnasium face: one world."""

from __future__ import annotations

import copy
import json
import warnings
from collections.abc import Mapping, Sequence
from typing import Any

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

from ..jit import compiling
from ..scenarios.commands import Commands
from ..scenarios.family_schema import Family
from ..scenarios.loader import Source, load_scenario
from ..tasks.task import task_config, unflatten
from .core import Core

_ONE = np.ones(1, np.bool_)


def with_family(sea: str, arguments: Mapping[str, Any]) -> dict[str, Any]:
    """Arguments of an id that draws its own sea, with the keys of its family (``case=5``) as overrides of the scenario.

    Raises
    ------
    ValueError
        where ``scenario=`` is given.
    """
    if "scenario" in arguments:
        raise ValueError("this environment draws its own sea; use usv_gym/Scenario-v0 for scenario=")
    family = load_scenario(sea).family
    known = type(family).model_fields.keys() - Family.model_fields.keys() if family else ()
    own = [key for key in arguments if key in known]
    rest = {key: value for key, value in arguments.items() if key not in own}
    said = [f"family.{key}={json.dumps(arguments[key])}" for key in own]
    return {**rest, "overrides": [*rest.get("overrides", ()), *said]} if said else rest


class USVEnv(gym.Env[Any, Any]):
    """An unmanned surface vehicle follows a route through ships and obstacles that it knows from its sensors only.

    Description
    -----------
    A 3-DOF vessel with its real actuators sails among kinematic ships, icebergs and other discs, in wind, current and waves.
    Radar, LiDAR and AIS measure the surroundings; the Target Detection Module (TDM) fuses them with Kalman filters into the
    list of detected targets that the agent observes.  ``OpenSea-v0`` draws a new sea at every reset; ``Scenario-v0`` runs a
    scenario file.

    Action space
    ------------
    ``action=`` picks one; all boxes are [-1, 1].

    ================== ============== ==================================================================================
    name               space          meaning
    ================== ============== ==================================================================================
    ``default``                       what the vessel file says: ``throttle_nozzle`` for Odin, ``thrusters`` for Otter
    throttle_nozzle    Box(2)         surge demand (astern below 0) and yaw demand (to starboard above 0)
    thrusters          Box(thrusters) shaft speed of each thruster
    actuators          Box(channels)  shaft speed, nozzle and bucket of each thruster that has them
    heading_speed      Box(2)         heading change / 90 deg from the measured heading; speed from 0 to the largest
    discrete           Discrete(5)    hold; 15 deg to port; to starboard; 1/8 of the largest speed faster; slower
    ================== ============== ==================================================================================

    Observation space
    -----------------
    A float32 Box in [-1, 1] (or, with ``flat=False``, a Dict of ``own``, ``targets`` and ``mask``): twelve numbers of own
    navigation and route, then nine per target for the K nearest (``targets=``), or one per sector.  docs/environments.md has
    the table with the units.

    ============ =======================================================================================================
    observation  what it tells of the surroundings
    ============ =======================================================================================================
    ``tracks``   the nearest detected targets as the TDM last reported them (default)
    ``ais``      the nearest ships by the last AIS message received of each
    ``sectors``  closeness of the nearest detected target in each bearing sector
    ``truth``    the nearest objects as they really are (for ablation only; no sensor is simulated)
    ============ =======================================================================================================

    Rewards
    -------
    The weighted sum of named terms, which ``info["reward_terms"]`` gives unweighted: progress, cross_track, proximity,
    effort, time, collision, arrival, out_of_area.  Weights: ``reward={"collision": 100}``.

    Starting state
    --------------
    The own ship at the start of its route; AIS, radar and LiDAR have not fired yet, so no target is known.

    Episode end
    -----------
    Terminated by a collision of the hulls, by reaching the last waypoint, or by leaving the area; truncated at the end of the
    scenario's duration.

    Arguments
    ---------
    action, observation, targets, sectors, flat, reward and the other fields of ``TaskConfig``; ``scenario`` (Scenario-v0);
    ``vessel``, ``difficulty``, ``weather``; ``overrides``: a list of ``KEY=VALUE`` on the scenario.
    ``reset(options=...)`` takes scenario, vessel, weather and difficulty.

    Version history
    ---------------
    v0: first version.
    """

    metadata: dict[str, Any] = {"render_modes": ["human", "rgb_array"], "render_fps": 10}  # noqa: RUF012

    def __init__(
        self,
        scenario: Source,
        *,
        vessel: str | None = None,
        difficulty: float | None = None,
        weather: str | Mapping[str, Any] | None = None,
        overrides: Sequence[str] = (),
        reward: Mapping[str, float] | None = None,
        render_mode: str | None = None,
        **task: Any,
    ) -> None:
        if render_mode is not None and render_mode not in self.metadata["render_modes"]:
            raise ValueError(f"render_mode: expected one of {self.metadata['render_modes']}, got {render_mode!r}")
        config = task_config(task, reward)
        self.metadata = copy.deepcopy(self.metadata)  # one's own: Gymnasium's wrappers write into it
        self.render_mode = render_mode
        if render_mode == "human":
            from ..render.canvas import load_pygame

            load_pygame()  # better missing now than at the first reset
        with compiling():
            self.core = Core(1, source=scenario, config=config, vessel=vessel, overrides=overrides, difficulty=difficulty,
                             weather=weather)  # fmt: skip
        self.action_space = self.core.action_space
        self.observation_space = self.core.observation_space
        self._action_shape, self._flat = self.action_space.shape, config.flat
        self._started = False
        self._commands: Commands | None = None
        self._history: Any = None
        self._window: Any = None

    def _observation(self) -> Any:
        flat = self.core.row_obs[0]
        return flat.copy() if self._flat else unflatten(self.core.config, flat)

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Any, dict[str, Any]]:
        """Start a new episode; options: scenario, vessel, weather, difficulty."""
        super().reset(seed=seed)
        self.core.configure(options)
        with compiling():
            self.core.reset(_ONE, [self.np_random])
        self._commands = self._history = None
        self._started = True
        if self.render_mode == "human":
            self.render()
        return self._observation(), {**self.core.info(0), "scales": self.core.scales()}

    def step(self, action: Any) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        """Advance by one control interval.

        Raises
        ------
        gymnasium.error.ResetNeeded
            before the first reset.
        ValueError
            if the action has a wrong shape or is not finite.
        """
        if not self._started:
            raise gym.error.ResetNeeded("call reset() before step()")
        core = self.core
        try:
            fits = getattr(action, "shape", None) == self._action_shape or np.shape(action) == self._action_shape
            if fits:
                core.row_actions[0][:] = action
        except (ValueError, TypeError):
            fits = False
        if not fits:
            raise ValueError(f"action {' '.join(repr(action).split())} does not fit {self.action_space}")
        core.step()
        if self.render_mode == "human":
            self.render()
        return self._observation(), core.reward.item(0), core.terminated.item(0), core.truncated.item(0), core.info(0)

    def render(self) -> NDArray[np.uint8] | None:
        """The map as [H, W, 3] for ``rgb_array``; None without a render mode.

        With ``human`` it is shown in a window, which ``reset`` and ``step`` do by themselves, at ``metadata["render_fps"]``;
        the user may close the window, and the environment goes on without.
        """
        if self.render_mode is None:
            warnings.warn("render() needs a render_mode; pass render_mode='rgb_array' to gym.make", stacklevel=2)
            return None
        from ..render.scene import History, scene_from_snapshot

        if self._window is False:
            return None
        if self._history is None:
            self._history = History()
        names = self._commands.names if self._commands else self.core.ids(0)
        scene = scene_from_snapshot(self.core.worlds[0], names, self._history, coast=self.core.coast(0))
        if self.render_mode == "rgb_array":
            from ..render.pygame_view import render

            return render(scene, size=(800, 800))
        from ..render.window import Window

        if self._window is None:
            self._window = Window(size=(1180, 800))
        if not self._window.show(scene, float(self.metadata["render_fps"])):
            self.close()
        return None

    def close(self) -> None:
        """Close the window, if there is one."""
        if self._window:
            self._window.close()
            self._window = False

    @property
    def commands(self) -> Commands:
        """Commands to the running world: spawn, delete, move, set_waypoints, set_ais; and its notices."""
        if self._commands is None:
            self._commands = Commands(self.core.worlds, 0, self.core.ids(0), self.core.scenario)
        return self._commands

    @property
    def world(self) -> Any:
        """The record of the world (a view; see world/state.py)."""
        return self.core.worlds[0]


class FamilyEnv(USVEnv):
    """An id with a sea of its own, drawn anew at every reset, as ``usv_gym/OpenSea-v0``."""

    __doc__ = USVEnv.__doc__

    def __init__(self, sea: str, **kwargs: Any) -> None:
        super().__init__(sea, **with_family(sea, kwargs))


class ScenarioEnv(USVEnv):
    """``usv_gym/Scenario-v0``: a scenario by name, path or mapping."""

    __doc__ = USVEnv.__doc__

    def __init__(self, scenario: Source = "busy_open_sea", **kwargs: Any) -> None:
        super().__init__(scenario, **kwargs)
