"""What a campaign keeps of an episode: the judge's numbers, and of the worst ones a recording."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..colregs.params import PROFILES, Params
from ..colregs.trajectory import TrajectoryRecorder
from ..colregs.verdict import judge
from ..config import Document, validate
from ..envs.core import Core
from ..replay.archive import plain, save
from ..replay.html import write_replay
from ..replay.recorder import Recorder

#: what is kept of an encounter; the rest is one command away
ENCOUNTER = ("class", "ship", "complete", "contact", "start", "start_range", "start_dcpa", "start_tcpa", "start_beta_deg",
             "cpa_time", "cpa_range", "clearance", "safety", "r8", "r13", "r14", "r15", "r16", "r17", "why")  # fmt: skip


class TruthWitness:
    """What witnesses that judge have in common: they record the truth of the batch."""

    def begin(self, core: Core, mask: NDArray[np.bool_]) -> None:
        """Record the start."""
        self._recorder = TrajectoryRecorder(core.worlds, int(core.task["max_steps"][0]) + 1, core.model.cruise_speed)
        self._recorder.begin(mask)

    def sample(self, core: Core, mask: NDArray[np.bool_]) -> None:
        """Record a step."""
        self._recorder.sample(mask)


class Judgement(TruthWitness):
    """A witness that records the truth of a batch and has it judged.

    Adds to a result every number of :attr:`~usv_gym.colregs.verdict.Verdict.episodes`, and ``encounters``.
    """

    def __init__(self, profile: str = "scaled", params: dict[str, Any] | None = None) -> None:
        self.params = PROFILES[profile] if params is None else validate(Params, Document("parameters", params))  # type: ignore[index]

    def finish(self, core: Core, rows: int) -> list[dict[str, Any]]:
        """Have it judged."""
        verdict = judge(self._recorder.trajectory, self.params)
        out = []
        for b in range(rows):
            encounters = []
            for i in verdict.of_row(b).tolist():
                row = verdict.encounter(i)
                kept = {name: row[name] for name in ENCOUNTER if name in row}
                e = verdict.encounters[i]
                kept["start_speed_ratio"] = float(e["start_target_speed"] / max(float(e["start_speed"]), 0.1))
                encounters.append(plain(kept))
            numbers = {name: column[b].item() for name, column in verdict.episodes.items()}
            out.append({**plain(numbers), "encounters": encounters})
        return out


class Film:
    """A witness that records one episode whole: ``NAME.usv`` and its 3-D replay ``NAME.html`` in a directory.

    Adds the name of the replay and, for a drawing, the tracks: ``[[ids], [[t, north, east, ..], ..]]`` with a pair of
    columns for each vessel, own ship first, and the discs ``[north, east, radius]``.
    """

    def __init__(self, directory: str, name: str, meta: dict[str, Any]) -> None:
        self.directory, self.name, self.meta = Path(directory), name, meta

    def begin(self, core: Core, mask: NDArray[np.bool_]) -> None:
        """Record the start."""
        self._recorder = Recorder()
        self._recorder.sample(core.worlds)

    def sample(self, core: Core, mask: NDArray[np.bool_]) -> None:
        """Record a step."""
        if mask[0]:
            self._recorder.action(core.actions[0].copy())
            self._recorder.sample(core.worlds)

    def finish(self, core: Core, rows: int) -> list[dict[str, Any]]:
        """Write both files."""
        from ..tasks.task import OUTCOMES

        episode = self._recorder.finish(
            names=core.ids(0), scenario=core.scenario.dump(), vessel=core.model.name,
            control_interval=core.control_interval, task=core.config.dump(), orders=[],
            outcome={"outcome": OUTCOMES[core.episodes["outcome"][0]], "closest_m": float(core.episodes["closest"][0])},
            **self.meta,
        )  # fmt: skip
        save(episode, self.directory / f"{self.name}.usv")
        write_replay(episode, self.directory / f"{self.name}.html")
        there = [j for j in range(episode.vessels) if episode.active[:, j].any()]
        every = max(len(episode.t) // 240, 1)
        columns = [episode.t[::every]]
        for j in there:
            track = np.where(episode.active[:, j, None], episode.eta[:, j, :2], math.nan)
            columns += [*track[::every].T]
        last = episode.obstacle[-1]
        discs = [[*last[m], episode.radius[m]] for m in range(len(last)) if episode.active[:, episode.vessels + m].any()]
        w = core.worlds[0]
        route = w["routes"]["waypoint"][0, : int(w["routes"]["count"][0])]
        return [plain({
            "replay": f"{self.name}.html", "vessels": [episode.name(j) for j in there], "own": episode.own,
            "columns": [np.round(column, 1) for column in columns], "discs": np.round(np.array(discs), 1), "route": route,
        })]  # fmt: skip
