"""The PettingZoo face: several ships are agents, each with its own sensors and its own picture of the sea.

``usv_gym.traffic_v0`` holds the conventional ``parallel_env``, ``env`` and ``raw_env``.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium.utils.seeding import np_random
from numpy.typing import NDArray
from pettingzoo import ParallelEnv

from ..config import ConfigError
from ..jit import compiling
from ..scenarios.build import build_worlds, track_pool, write_agent
from ..scenarios.loader import load_scenario
from ..tasks.share import ALONE, NO_CONTROL
from ..tasks.step import BEGIN, STEP, run_batch
from ..tasks.task import (
    N_TERMS,
    OUTCOMES,
    action_space,
    episode_dtype,
    named_terms,
    observation_size,
    observation_space,
    resolve_action,
    task_config,
    task_record,
    unflatten,
)
from ..world.land import NO_LAND
from ..world.lanes import lanes_for
from ..world.state import CAPACITIES
from ..world.vessel import VesselModel, load_vessel
from .core import NO_ROWS, vessel_facts

MAX_AGENTS = 8  #: observers and plants of the record, so that every number of agents runs the same compiled kernel

#: what the agents sail in, but for themselves
TRAFFIC: dict[str, Any] = {
    "name": "traffic",
    "simulation": {"dt": 0.1, "traffic_interval": 0.5, "control_interval": 1.0, "duration": 400.0, "area": 1500.0},
    "sensors": {
        "base": "thesis",
        "navigation": {key: {"rate": 10.0} for key in ("gnss", "mru", "imu", "speed_log", "wind")},
    },
}


class TrafficEnv(ParallelEnv):  # type: ignore[misc]
    """Ships that meet: every agent sails from one side of a circle to the other, through all the others.

    Parameters
    ----------
    agents
        how many, 2 to 8.
    vessels
        vessel files of the agents, repeated as needed: the fleet may be mixed.
    icebergs
        how many discs stand between them.
    scenario
        a scenario (name, path, mapping) with everything but the agents: weather, sensors, further ships and obstacles, times.
    action, observation, targets, reward, ...
        as ``usv_gym/OpenSea-v0``; ``heading_speed`` (default) and ``discrete`` give every vessel the same action space.
    render_mode
        ``rgb_array``: the map around the first agent that is still there.

    An agent leaves when it collides, completes its route or leaves the area; its vessel is taken off the sea and never
    returns.  ``state()`` is the truth about all of them.
    """

    metadata: dict[str, Any] = {  # noqa: RUF012
        "name": "traffic_v0", "render_modes": ["rgb_array"], "is_parallelizable": True, "render_fps": 10,
    }  # fmt: skip

    def __init__(
        self,
        agents: int = 4,
        *,
        vessels: Sequence[str] = ("odin",),
        icebergs: int = 4,
        scenario: Any = None,
        overrides: Sequence[str] = (),
        reward: Mapping[str, float] | None = None,
        render_mode: str | None = None,
        **task: Any,
    ) -> None:
        if not 2 <= agents <= MAX_AGENTS:
            raise ConfigError(f"agents: expected 2 to {MAX_AGENTS}, got {agents}")
        if not 0 <= icebergs <= 12:
            raise ConfigError(f"icebergs: expected 0 to 12, got {icebergs}")
        if not vessels:
            raise ConfigError("vessels: expected at least one vessel")
        self.render_mode = render_mode
        config = task_config({"action": "heading_speed", **task}, reward)
        self.scenario = load_scenario(TRAFFIC if scenario is None else scenario, overrides=overrides)
        for key in ("land", "family"):
            if getattr(self.scenario, key) is not None:
                raise ConfigError(f"scenario {self.scenario.name!r}: {key}: the traffic environment has none; leave it out")
        self.icebergs = icebergs
        self.possible_agents = [f"ship_{k}" for k in range(agents)]
        self.agents: list[str] = []
        self._slot = {agent: k for k, agent in enumerate(self.possible_agents)}
        self._models: list[VesselModel] = [load_vessel(vessels[k % len(vessels)]) for k in range(agents)]
        facts = [vessel_facts(model) for model in self._models]
        self.configs = [config.model_copy(update={"action": resolve_action(config, f)}) for f in facts]
        self.observation_spaces = {
            agent: observation_space(c) for agent, c in zip(self.possible_agents, self.configs, strict=True)
        }
        self.action_spaces = {
            agent: action_space(c, f) for agent, c, f in zip(self.possible_agents, self.configs, facts, strict=True)
        }
        simulation = self.scenario.simulation
        self._interval = simulation.control_ticks * simulation.dt
        steps = math.ceil(simulation.duration / self._interval - 1e-9)
        tasks = [task_record(c, f, simulation.control_ticks, steps) for c, f in zip(self.configs, facts, strict=True)]
        self._tasks = np.concatenate(tasks + [tasks[0]] * (MAX_AGENTS - agents))
        V, M = next(c for c in CAPACITIES[1:] if MAX_AGENTS + len(self.scenario.ships) <= c[0]
                    and 12 + len(self.scenario.obstacles) + len(self.scenario.phantoms()) <= c[1])  # fmt: skip
        self.worlds, self.names = build_worlds(
            self.scenario, 1, capacity=(V, M), observers=range(MAX_AGENTS), agents=MAX_AGENTS
        )
        self._lanes = lanes_for(self.worlds)
        self._tracks = track_pool(self.scenario)
        self._template = self.worlds.copy()
        self._obs = np.zeros((1, MAX_AGENTS, observation_size(config)), np.float32)
        self._episodes = np.zeros((1, MAX_AGENTS), episode_dtype())
        self._columns = np.zeros((4 + N_TERMS, 1)), np.zeros((5, 1), np.uint8)  # of the first agent alone, so nobody reads them
        self._rng: np.random.Generator | None = None
        self._history: Any = None  # trails of the map
        w = self.worlds[0]
        state = 8 * len(w["vessels"]["active"]) + 4 * len(w["obstacles"]["active"])
        self.state_space = gym.spaces.Box(-np.inf, np.inf, (state,), np.float32)

    # --- PettingZoo --------------------------------------------------------------------------------------------------
    def observation_space(self, agent: str) -> gym.Space[Any]:
        """Observation space of an agent."""
        return self.observation_spaces[agent]

    def action_space(self, agent: str) -> gym.Space[Any]:
        """Action space of an agent."""
        return self.action_spaces[agent]

    def reset(
        self, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, Any], dict[str, dict[str, Any]]]:
        """Put all agents back; without a seed the last generator goes on."""
        if seed is not None or self._rng is None:
            self._rng = np_random(seed)[0]
        self._history = None
        self.worlds[:] = self._template
        self.worlds["seed"] = self._rng.integers(0, 1 << 63, dtype=np.uint64)
        self._draw(self._rng)
        self._episodes["what"] = BEGIN
        with compiling():
            self._run()
        self.agents = list(self.possible_agents)
        return self._observations(self.agents), {agent: {"scales": self._scales(agent)} for agent in self.agents}

    def _run(self) -> int:
        return int(run_batch(NO_CONTROL, ALONE, self.worlds, self._lanes, NO_LAND, self._tracks, self._tasks, self._episodes,
                             self._obs, *self._columns, NO_ROWS))  # fmt: skip

    def step(self, actions: Mapping[str, Any]) -> tuple[Any, Any, Any, Any, Any]:
        """One control step of all agents that are left.

        Raises
        ------
        ValueError
            if the action of an agent is missing, has a wrong shape, or is not finite; nothing has moved then.
        """
        here = list(self.agents)
        if not here:
            return {}, {}, {}, {}, {}
        episodes = self._episodes[0]
        for agent in here:
            if agent not in actions:
                raise ValueError(f"no action for agent {agent!r}")
            space, action = self.action_spaces[agent], actions[agent]
            if np.shape(action) != (space.shape or ()):
                raise ValueError(f"action of {agent!r}: {' '.join(repr(action).split())} does not fit {space}")
            width = int(self._tasks["channels"][self._slot[agent]])
            episodes["action"][self._slot[agent], :width] = action
        self._episodes["what"] = STEP
        if self._run() >= 0:
            raise ValueError(f"actions {dict(actions)!r}: expected finite numbers, and whole ones from 0 to 4 for discrete")
        slots = {agent: self._slot[agent] for agent in here}
        rewards = {agent: float(episodes["reward"][k]) for agent, k in slots.items()}
        terminations = {agent: bool(episodes["terminated"][k]) for agent, k in slots.items()}
        truncations = {agent: bool(episodes["truncated"][k]) for agent, k in slots.items()}
        infos = {agent: self._info(k) for agent, k in slots.items()}
        observations = self._observations(here)
        for agent, k in slots.items():
            if terminations[agent] or truncations[agent]:
                self.agents.remove(agent)
                self.worlds["vessels"]["active"][0, k] = 0
        return observations, rewards, terminations, truncations, infos

    def state(self) -> NDArray[np.float32]:
        """Truth: of every vessel slot active, N, E, sin and cos of heading, u, v, r; of every obstacle active, N, E, radius."""
        v, m = self.worlds["vessels"][0], self.worlds["obstacles"][0]
        psi = v["eta"][:, 2]
        vessels = np.column_stack([v["active"], v["eta"][:, :2], np.sin(psi), np.cos(psi), v["nu"]])
        obstacles = np.column_stack([m["active"], m["position"], m["radius"]])
        there = (vessels * v["active"][:, None]).ravel(), (obstacles * m["active"][:, None]).ravel()
        return np.concatenate(there).astype(np.float32)

    def render(self) -> NDArray[np.uint8] | None:
        """The map around the first agent that is left, [H, W, 3]."""
        if self.render_mode is None:
            gym.logger.warn("render() needs a render_mode; pass render_mode='rgb_array'")
            return None
        from ..render.pygame_view import render
        from ..render.scene import History, scene_from_snapshot

        if self._history is None:
            self._history = History()
        observer = self._slot[self.agents[0]] if self.agents else 0
        scene = scene_from_snapshot(self.worlds[0], self.names, self._history, observer=observer)
        return render(scene, size=(800, 800))

    def close(self) -> None:
        """Nothing to close."""

    # --- inside ------------------------------------------------------------------------------------------------------
    def _draw(self, rng: np.random.Generator) -> None:
        """Put the agents on a circle, evenly but for some jitter, each bound for the far side; icebergs between them."""
        w: Any = self.worlds[0]
        n = len(self.possible_agents)
        turn = rng.uniform(0.0, 2.0 * math.pi)
        radius = rng.uniform(300.0, 450.0)
        angles = turn + 2.0 * math.pi * (np.arange(n) + rng.uniform(-0.2, 0.2, n)) / n
        for k, model in enumerate(self._models):
            far = angles[k] + math.pi + rng.uniform(-0.25, 0.25)
            route = [(radius * math.cos(a), radius * math.sin(a)) for a in (float(angles[k]), float(far))]
            write_agent(model, self.worlds, 0, k, route, preset=self.scenario.preset)
            self.names[k] = self.possible_agents[k]
        m = w["obstacles"]
        first = len(self.scenario.obstacles)
        for i in range(first, first + self.icebergs):
            m["active"][i], m["kind"][i] = 1, 10
            r, a = radius * 0.75 * math.sqrt(rng.random()), rng.uniform(0.0, 2.0 * math.pi)
            m["position"][i] = m["frame_position"][i] = r * math.cos(a), r * math.sin(a)
            m["radius"][i] = rng.uniform(4.0, 15.0)
            self.names[len(w["vessels"]["active"]) + i] = f"iceberg_{i + 1}"

    def _observations(self, agents: Sequence[str]) -> dict[str, Any]:
        result = {}
        for agent in agents:
            k = self._slot[agent]
            config = self.configs[k]
            result[agent] = self._obs[0, k].copy() if config.flat else unflatten(config, self._obs[0, k])
        return result

    def _scales(self, agent: str) -> dict[str, float]:
        k = self._slot[agent]
        model, config = self._models[k], self.configs[k]
        return {
            "max_speed": model.max_speed, "cruise_speed": model.cruise_speed, "length": model.length, "beam": model.beam,
            "control_interval": self._interval, "channels": int(self._tasks["channels"][k]),
            **{name: getattr(config, name) for name in (
                "range_scale", "distance_scale", "cross_track_scale", "target_speed_scale", "radius_scale", "rate_scale")},
        }  # fmt: skip

    def _info(self, k: int) -> dict[str, Any]:
        episode = self._episodes[0, k]
        outcome = OUTCOMES[episode["outcome"]]
        return {
            "reward_terms": named_terms(*episode["terms"].tolist()),
            "closest": float(episode["closest"]),
            "outcome": outcome,
            "is_success": outcome == "arrival",
        }
