"""The true motion of an archived episode, as the judge reads it."""

from __future__ import annotations

import numpy as np

from ..colregs.trajectory import Trajectory
from ..world.state import KIND_ISLET, MODEL_3DOF
from .archive import Episode


def trajectory_of(episode: Episode) -> Trajectory:
    """The one episode (B = 1) of an archive.  Its samples are those of the archive; nothing is known of a route."""
    T, V = episode.eta.shape[:2]
    one = Trajectory.empty(1, T, V)
    one.steps[0], one.own[0] = T, episode.own
    one.t[0], one.length[0], one.beam[0] = episode.t, episode.length, episode.beam
    one.active[0] = episode.active[:, :V]
    for j in range(V):
        late = episode.traffic_t if episode.meta["models"][j] != MODEL_3DOF else episode.t
        one.eta[0, :, j] = episode.eta[:, j]
        one.velocity[0, :, j] = episode.velocity(j)
        # between frames kinematic ships lag behind: carry them on
        one.eta[0, :, j, :2] += one.velocity[0, :, j] * (episode.t - late)[:, None]
    discs = np.where(episode.active[:, V:], episode.distance[:, V:], np.inf)
    one.obstacle[0] = discs.min(axis=1, initial=np.inf)
    for row in episode.detections:
        if row["source"] < V:
            k = min(int(np.searchsorted(episode.t, row["t"])), T - 1)
            one.tracked[0, k:, row["source"]] = True
    outcome = episode.meta.get("outcome", {})
    one.arrived[0] = outcome.get("outcome") == "arrival"
    hits = [event["id"] for event in episode.events if event["kind"] == "collision"]
    one.touched[0] = hits[0] if hits else -1
    one.aground[0] = one.touched[0] >= V and episode.meta["kinds"][one.touched[0]] == KIND_ISLET
    one.aground[0] |= outcome.get("outcome") == "grounding"
    one.closest_obstacle[0] = 0.0 if one.touched[0] >= V else one.obstacle[0].min()
    return one
