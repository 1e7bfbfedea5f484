"""A mission under way: one world, who steers it, the commands given to it, and the recording of it all.

Running to the end (``run``), the live window (``play``), the live page (``live``) and the repetition of an archive all step a
``Voyage``.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from gymnasium.utils.seeding import np_random
from numpy.typing import NDArray

from .config import Document, validate
from .envs.core import Core
from .jit import compiling
from .policies import make_policy
from .replay.archive import Episode
from .replay.recorder import Recorder
from .scenarios.commands import Commands, Notice
from .scenarios.schema import Scenario
from .tasks.task import OUTCOMES, TaskConfig, unflatten
from .world.state import EVENTS

_ONE = np.ones(1, np.bool_)
BY_HAND = "by hand"  #: the policy of a mission that the user steers
#: a mission that goes on whatever happens
ENDLESS = TaskConfig(end_on_collision=False, end_on_arrival=False, end_out_of_area=False)


@dataclass
class Mission:
    """What to run.  ``rows`` [ticks, n, A, 3] drive the actuators directly; else ``policy`` names a controller."""

    scenario: Scenario
    policy: str
    seed: int = 0
    rows: NDArray[np.float64] | None = None
    #: (tick, command, arguments) to give on the way; see ``Commands``
    orders: Sequence[tuple[int, str, dict[str, Any]]] = ()
    #: a policy file may execute code when it is read
    trust: bool = False


def task_of(controller: Any) -> TaskConfig:
    """The task that a controller asks for: its ``task``, or its ``action``, ``observation`` and ``flat``."""
    if isinstance(getattr(controller, "task", None), TaskConfig):
        task: TaskConfig = controller.task
        return task
    asked = {name: getattr(controller, name) for name in ("action", "observation", "flat") if hasattr(controller, name)}
    return validate(TaskConfig, Document(f"controller {type(controller).__name__}", asked))


class Voyage:
    """A mission under way.

    Parameters
    ----------
    mission
        what to run.
    controller, config
        who steers, and the task; by default what the mission's policy names, and the task that it asks for.
    """

    def __init__(self, mission: Mission, controller: Any = None, config: TaskConfig | None = None) -> None:
        """Cast off."""
        self.mission = mission
        self.controller = controller
        rows = mission.rows
        if config is not None:
            self.config = config
        elif mission.policy == BY_HAND:
            self.config = ENDLESS.model_copy(update={"action": "throttle_nozzle"})
        elif rows is not None:
            self.config = ENDLESS
        else:
            self.controller = make_policy(mission.policy, trust=mission.trust)
            self.config = task_of(self.controller)
        # a log is recorded tick by tick
        tick = [f"simulation.control_interval={mission.scenario.simulation.dt!r}"] if rows is not None else []
        with compiling():
            self.core = Core(1, source=mission.scenario, config=self.config, overrides=tick)
            self.steps = len(rows) if rows is not None else int(self.core.task["max_steps"][0])
            self.core.task["max_steps"] = self.steps
            self.core.reset(_ONE, [np_random(mission.seed)[0]])
        self.commands = Commands(self.core.worlds, 0, self.core.ids(0), self.core.scenario)
        self._orders = list(mission.orders)
        self.recorder = Recorder()
        self.recorder.sample(self.core.worlds)
        if hasattr(self.controller, "attach"):  # it looks at sensors that no observation holds (hil.external)
            self.controller.attach(self.core, 0, self.commands.called)
        if self.controller is not None:
            self.controller.reset({**self.core.info(0), "scales": self.core.scales()})
        self.step_count = 0

    @property
    def world(self) -> Any:
        """The record of the world."""
        return self.core.worlds[0]

    @property
    def t(self) -> float:
        """Time [s]."""
        return float(self.world["tick"] * self.world["dt"])

    @property
    def duration(self) -> float:
        """Time at which it is over at the latest [s]."""
        return self.steps * self.core.control_interval

    @property
    def outcome(self) -> str:
        """Why it is over; empty while it is not."""
        if not (self.core.terminated[0] or self.core.truncated[0] or self.step_count >= self.steps):
            return ""
        outcome = OUTCOMES[self.core.episodes["outcome"][0]]
        if outcome in ("running", "time_limit"):
            return "log_end" if self.mission.rows is not None else "time_limit"
        return outcome

    def step(self, demand: tuple[float, float] = (0.0, 0.0)) -> list[Notice]:
        """One control step; ``demand`` is the action (surge, yaw) of a mission that is steered by hand."""
        core, rows = self.core, self.mission.rows
        while self._orders and self._orders[0][0] <= int(core.worlds["tick"][0]):
            _, command, arguments = self._orders.pop(0)
            self.commands.apply(command, arguments)
        if rows is not None:
            row = rows[self.step_count]
            self.recorder.action(row)
            core.step(rows=row[None])
        else:
            if self.controller is None:
                core.actions[0] = demand
            else:
                flat = core.obs[0]
                core.actions[0] = self.controller.act(flat.copy() if self.config.flat else unflatten(core.config, flat))
            self.recorder.action(core.actions[0])
            core.step()
        self.step_count += 1
        self.recorder.sample(core.worlds)
        notices = self.commands.notices()
        for notice in notices:
            if notice.kind in EVENTS:
                continue  # the recorder sees them by itself
            self.recorder.event(notice.t, notice.kind, notice.source, notice.text or notice.id)
        return notices

    def finish(self) -> Episode:
        """The episode so far."""
        mission, core = self.mission, self.core
        return self.recorder.finish(
            names=self.commands.called,
            scenario=mission.scenario.dump(),
            seed=mission.seed,
            policy=mission.policy,
            vessel=core.model.name,
            control_interval=core.control_interval,
            outcome={"outcome": self.outcome or "interrupted", "closest_m": float(core.episodes["closest"][0])},
            task=core.config.dump(),
            land=[[ring.round(2) for ring in polygon.rings] for polygon in core.coast(0)],
            orders=[[tick, command, arguments] for tick, command, arguments in self.commands.log],
        )
