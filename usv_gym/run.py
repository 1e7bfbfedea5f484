"""Run one scenario with one policy, and leave everything that is needed to look at it again: the main job."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .config import ConfigError, Document, validate
from .policies import THRUST_LOG, make_policy
from .policies.thrust_log import commands, per_tick, read_thrust_log
from .replay.archive import Episode
from .resources import configs
from .scenarios.loader import Source, load_scenario
from .scenarios.schema import Scenario
from .tasks.task import TaskConfig
from .voyage import Mission, Voyage
from .world.vessel import load_vessel

OUTPUTS = ("episode.usv", "ais.nmea", "detections.csv", "map.png", "summary.json")
#: called after every control step with (simulated seconds, seconds in all)
Progress = Callable[[float, float], None]


def shipped_log() -> Path:
    """The synthetic thrust log that ships with the package."""
    return configs() / "thrust_logs" / "synthetic.txt"


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
    voyage = Voyage(mission)
    while not voyage.outcome:
        voyage.step()
        if progress is not None:
            progress(voyage.t, voyage.duration)
    return voyage.finish()


class _Recorded:
    """A controller that does what was done before."""

    def __init__(self, actions: NDArray[np.float64]) -> None:
        self._actions = iter(actions)

    def reset(self, info: dict[str, Any]) -> None:
        """Nothing to learn."""

    def act(self, observation: Any) -> NDArray[np.float64]:
        """The next recorded action."""
        return next(self._actions)


def resimulate(episode: Episode) -> Episode:
    """Run the recorded actions of an archive again, in a world built from what the archive says.

    The result equals the recording bit for bit, as long as the code that moves the world is the same.
    """
    meta, actions = episode.meta, episode.actions
    mission = Mission(
        validate(Scenario, Document("archive", meta["scenario"])),
        meta["policy"],
        meta["seed"],
        actions if actions.ndim == 4 else None,
        [(tick, command, arguments) for tick, command, arguments in meta.get("orders", [])],
    )
    voyage = Voyage(mission, _Recorded(actions), validate(TaskConfig, Document("archive", meta["task"])))
    for _ in range(len(actions)):
        voyage.step()
    return voyage.finish()


def write_outputs(
    episode: Episode, directory: Path, *, picture: bool = True, wall_time_s: float | None = None
) -> dict[str, Any]:
    """Leave ``episode.usv``, ``ais.nmea``, ``detections.csv``, ``map.png`` and ``summary.json`` in a directory.

    Each file appears whole or not at all; without pygame the map is left out, with a warning.  Returns the summary.

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
        write_summary(result, directory / "summary.json")
        if picture:
            _draw(episode, directory / "map.png")
    except OSError as error:
        raise ConfigError(f"{directory}: cannot be written: {error.strerror or error}") from None
    return result


def _draw(episode: Episode, path: Path) -> None:
    from gymnasium.error import DependencyNotInstalled

    from .render.pygame_view import save_png
    from .render.scene_episode import scene_from_episode

    try:
        save_png(scene_from_episode(episode), path)
    except DependencyNotInstalled as error:
        path.unlink(missing_ok=True)  # one of an earlier run
        warnings.warn(f"{path.name} is left out: {error}", stacklevel=2)


def listing(directory: Path) -> str:
    """What `write_outputs` has left, for a line on the terminal."""
    return "  ".join(name for name in OUTPUTS if (directory / name).exists())
