"""Run one scenario with one policy, and leave everything that is needed to look at it again: the main job."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from gymnasium.utils.seeding import np_random
from numpy.typing import NDArray

from .config import ConfigError, Document, validate
from .envs.core import Core
from .envs.notice import compiling
from .policies import THRUST_LOG, make_policy
from .policies.thrust_log import commands, per_tick, read_thrust_log
from .replay.archive import Episode
from .replay.recorder import Recorder
from .resources import configs
from .scenarios.commands import Commands
from .scenarios.loader import Source, load_scenario
from .scenarios.schema import Scenario
from .tasks.task import OUTCOMES, TaskConfig, unflatten
from .world.vessel import load_vessel

_ONE = np.ones(1, np.bool_)
#: called after every control step with (simulated seconds, seconds in all)
Progress = Callable[[float, float], None]


def shipped_log() -> Path:
    """The synthetic thrust log that ships with the package."""
    return configs() / "thrust_logs" / "synthetic.txt"


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


def plan(
    source: Source,
    *,
    policy: str | None = None,
    thrust_log: str | Path | None = None,
    vessel: str | None = None,
    overrides: Sequence[str] = (),
    seed: int = 0,
    trust: bool = False,
) -> Mission:
    """Read everything that a run needs, so that nothing can fail half-way.

    Raises
    ------
    ConfigError
        for anything that is wrong with scenario, vessel, policy or thrust log.
    """
    if seed < 0:
        raise ConfigError(f"seed: expected a whole number of at least 0, got {seed}")
    scenario = load_scenario(source, overrides=overrides, vessel=vessel)
    name = policy or (THRUST_LOG if thrust_log is not None else "avoid")
    if name != THRUST_LOG:
        if thrust_log is not None:
            raise ConfigError(f"policy {name!r} does not read a thrust log; leave --thrust-log or --policy out")
        make_policy(name, trust=trust)
        return Mission(scenario, name, seed, trust=trust)
    log = read_thrust_log(thrust_log if thrust_log is not None else shipped_log())
    rows = per_tick(commands(log, load_vessel(scenario.own_ship.vessel)), scenario.simulation.dt)
    return Mission(scenario, name, seed, rows)


def run(mission: Mission, progress: Progress | None = None) -> Episode:
    """Run a mission to its end and return the recorded episode.

    A thrust log runs from its first row to its last and drives blindly, through collisions if there are any; a controller
    runs until the episode ends.
    """
    rows = mission.rows
    if rows is not None:
        config, controller = TaskConfig(end_on_collision=False, end_on_arrival=False, end_out_of_area=False), None
    else:
        controller = make_policy(mission.policy, trust=mission.trust)
        config = task_of(controller)
    # a log is recorded tick by tick
    tick = [f"simulation.control_interval={mission.scenario.simulation.dt!r}"] if rows is not None else []
    with ExitStack() as stack:
        stack.enter_context(compiling())
        core = Core(1, source=mission.scenario, config=config, overrides=tick)
        steps = len(rows) if rows is not None else int(core.task["max_steps"][0])
        core.task["max_steps"] = steps
        core.reset(_ONE, [np_random(mission.seed)[0]])
    recorder = Recorder()
    orders = Commands(core.worlds, 0, core.ids(0), core.scenario)
    recorder.sample(core.worlds)
    if controller is not None:
        controller.reset({**core.info(0), "scales": core.scales()})
    waiting = list(mission.orders)
    seconds = steps * core.control_interval
    for step in range(steps):
        while waiting and waiting[0][0] <= int(core.worlds["tick"][0]):
            _, command, arguments = waiting.pop(0)
            orders.apply(command, arguments)
        if controller is not None:
            observation = core.obs[0].copy() if config.flat else unflatten(config, core.obs[0])
            core.actions[0] = controller.act(observation)
            recorder.action(core.actions[0])
            core.step()
        else:
            assert rows is not None
            recorder.action(rows[step])
            core.step(rows=rows[step : step + 1])
        recorder.sample(core.worlds)
        for notice in orders.notices():
            recorder.event(notice.t, notice.kind, notice.source, notice.text or notice.id)
        if progress is not None:
            progress((step + 1) * core.control_interval, seconds)
        if core.terminated[0] or core.truncated[0]:
            break
    outcome = OUTCOMES[core.episodes["outcome"][0]]
    if rows is not None and outcome == "time_limit":
        outcome = "log_end"
    return recorder.finish(
        names=orders.called,
        scenario=mission.scenario.dump(),
        seed=mission.seed,
        policy=mission.policy,
        vessel=core.model.name,
        control_interval=core.control_interval,
        outcome={"outcome": outcome, "closest_m": float(core.episodes["closest"][0])},
        task=config.dump(),
        orders=[[tick, command, arguments] for tick, command, arguments in orders.log],
    )


def task_of(controller: Any) -> TaskConfig:
    """The task that a controller asks for: its ``task``, or its ``action``, ``observation`` and ``flat``."""
    if isinstance(getattr(controller, "task", None), TaskConfig):
        task: TaskConfig = controller.task
        return task
    asked = {name: getattr(controller, name) for name in ("action", "observation", "flat") if hasattr(controller, name)}
    return validate(TaskConfig, Document(f"controller {type(controller).__name__}", asked))


def resimulate(episode: Episode) -> Episode:
    """Run the recorded actions of an archive again, in a world built from what the archive says.

    The result equals the recording bit for bit, as long as the code that moves the world is the same.
    """
    meta = episode.meta
    scenario = validate(Scenario, Document("archive", meta["scenario"]))
    config = validate(TaskConfig, Document("archive", meta["task"]))
    driven = episode.actions.ndim == 4
    tick = [f"simulation.control_interval={scenario.simulation.dt!r}"] if driven else []
    core = Core(1, source=scenario, config=config, overrides=tick)
    core.task["max_steps"] = len(episode.actions)
    core.reset(_ONE, [np_random(meta["seed"])[0]])
    recorder = Recorder()
    recorder.sample(core.worlds)
    orders = Commands(core.worlds, 0, core.ids(0), core.scenario)
    waiting = [tuple(order) for order in meta.get("orders", [])]
    for action in episode.actions:
        while waiting and waiting[0][0] <= int(core.worlds["tick"][0]):
            orders.apply(*waiting.pop(0)[1:])
        if driven:
            core.step(rows=action[None])
        else:
            core.actions[0] = action
            core.step()
        recorder.sample(core.worlds)
    return recorder.finish(
        names=orders.called, scenario=meta["scenario"], seed=meta["seed"], policy=meta["policy"], vessel=meta["vessel"]
    )


def write_outputs(
    episode: Episode, directory: Path, *, picture: bool = True, wall_time_s: float | None = None
) -> dict[str, Any]:
    """Leave ``episode.usv``, ``ais.nmea``, ``detections.csv``, ``map.png`` and ``summary.json`` in a directory.

    Each file appears whole or not at all.  Returns the summary.

    Raises
    ------
    ConfigError
        if the directory cannot be written.
    """
    from .replay.archive import save
    from .replay.outputs import summary, write_detections, write_nmea, write_summary

    try:
        directory.mkdir(parents=True, exist_ok=True)
        result = summary(episode, wall_time_s)
        save(episode, directory / "episode.usv")
        write_nmea(episode, directory / "ais.nmea")
        write_detections(episode, directory / "detections.csv")
        if picture:
            from .render.pygame_view import save_png
            from .render.scene_episode import scene_from_episode

            save_png(scene_from_episode(episode), directory / "map.png")
        write_summary(result, directory / "summary.json")
    except OSError as error:
        raise ConfigError(f"{directory}: cannot be written: {error.strerror or error}") from None
    return result
