"""The verdict on episodes: contacts, near misses, efficiency, and every encounter with its scores and their reasons."""

from __future__ import annotations

import functools
import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..metrics.efficiency import activity, sailed
from ..units import DEG
from ..world.encounter import Encounter
from .features import encounters_of
from .params import Params
from .scores import PARTS, SCORES, reasons
from .scores import scores as set_a
from .trajectory import Floats, Trajectory

#: (scores, parts) of encounters [n]: set A, or one of ``alternatives``
Scoring = Callable[[NDArray[Any], Params], tuple[dict[str, Floats], dict[str, Floats]]]


@dataclass(eq=False)
class Verdict:
    """What the judge says of B episodes."""

    params: Params
    episodes: dict[str, NDArray[Any]]  # [B] each; docs/verdict.md has the list
    encounters: NDArray[Any]  # [n] of features.encounter_dtype, by row, ship, time
    scores: dict[str, Floats]  # [n] each; NaN where a rule says nothing of the encounter
    parts: dict[str, Floats]  # [n] each
    scoring: Scoring

    def __len__(self) -> int:
        return len(self.episodes["time"])

    def row(self, b: int) -> dict[str, float]:
        """One episode as a flat row of numbers."""
        return {name: float(column[b]) for name, column in self.episodes.items()}

    def of_row(self, b: int) -> NDArray[np.int64]:
        """Indices of the encounters of episode b."""
        return np.flatnonzero(self.encounters["row"] == b)

    def encounter(self, i: int) -> dict[str, Any]:
        """One encounter as a flat row: numbers, the class as text, and ``why``: what its lowest score lost, and when."""
        e, out = self.encounters[i], {}
        for name in ("row", "ship", "complete", "contact", "start", "end", "start_range", "start_dcpa", "start_tcpa",
                     "cpa_time", "cpa_range", "clearance", "clearance_time", "domain"):  # fmt: skip
            out[name] = e[name].item()
        out["class"] = Encounter(e["code"]).name.lower()
        for name in ("start_alpha", "start_beta", "cpa_alpha", "cpa_beta"):
            out[f"{name}_deg"] = e[name] / DEG
        seen = e["seen"]
        out["turn_starboard_deg"], out["turn_port_deg"] = seen["turn_starboard"] / DEG, seen["turn_port"] / DEG
        for name in ("slowed", "manoeuvre_time", "manoeuvre_range", "emergency_time"):
            out[name] = seen[name].item()
        out |= {name: float(self.scores[name][i]) for name in SCORES if name in self.scores}
        out |= {name: float(column[i]) for name, column in self.parts.items()}
        out["why"] = self.why(i)
        return out

    def why(self, i: int) -> str:
        """The lowest score of encounter i, and in words what cost it, the dearest first."""
        known = {name: values[i] for name, values in self.scores.items() if not math.isnan(values[i]) and name in SCORES}
        lowest = min(known, key=lambda name: float(known[name]))
        causes = reasons(self.encounters[i], self.params, lowest) if self.scoring is set_a else []
        said = "; ".join(f"{text} at {t:.0f} s (-{loss:.2f})" for loss, t, text in causes[:3])
        name = "safety" if lowest == "safety" else f"rule {lowest[1:]}"
        so_far = "" if self.encounters["complete"][i] else ", not over yet"
        return f"{name} {known[lowest]:.2f}{so_far}" + (f": {said}" if said else "")


def judge(trajectory: Trajectory, params: Params | None = None, scoring: Scoring = set_a) -> Verdict:
    """Judge B episodes from truth.

    Only encounters whose closest point was passed (``complete``) count in the scores of an episode: of the others nothing
    can be said yet.  ``<score>`` is the mean over them, ``<score>_min`` the worst; NaN without any.
    """
    params = params or Params()
    x = trajectory
    B, V = len(x), x.vessels
    encounters, nearest = encounters_of(x, params)
    values, made_of = scoring(encounters, params)
    rows = np.arange(B)
    last = np.maximum(x.steps - 1, 0)
    way = sailed(x.eta[rows, :, x.own, :2], x.steps)
    time = x.t[rows, last]
    size = 0.5 * (x.length[rows, x.own][:, None] + x.length) / params.reference_length if params.scaled else 1.0
    near = nearest[..., 0] < (params.r_nm - params.r_col) * size
    collision = (x.touched >= 0) & (x.touched < V)
    planned = x.arrived & (x.route > 0.0)
    ship = nearest[..., 0].argmin(axis=1)
    episodes: dict[str, NDArray[Any]] = {
        "collision": collision,
        "allision": (x.touched >= V) & ~x.aground,
        "grounding": x.aground,
        "near_miss": near.any(axis=1) & ~collision,
        "arrival": x.arrived,
        "time": time,
        "min_distance": nearest[rows, ship, 0],
        "min_distance_time": nearest[rows, ship, 1],
        "min_distance_ship": np.where(np.isfinite(nearest[rows, ship, 0]), ship, -1),
        "min_obstacle_distance": np.minimum(x.closest_obstacle, np.where(x.touched >= V, 0.0, np.inf)),
        "distance": way,
        "extra_distance": np.where(planned, way - x.route, np.nan),
        "extra_time": np.where(planned & (x.speed > 0.0), time - x.route / np.where(x.speed > 0.0, x.speed, 1.0), np.nan),
        "throttle_activity": activity(x.demand[:, :, 0], x.t, x.steps),
        "rudder_activity": activity(x.demand[:, :, 1], x.t, x.steps),
    }
    complete = encounters["complete"] != 0
    episodes["encounters"] = np.bincount(encounters["row"], minlength=B)
    episodes["encounters_complete"] = np.bincount(encounters["row"][complete], minlength=B)
    for code in Encounter:
        if code is not Encounter.SAFE:
            episodes[code.name.lower()] = np.bincount(encounters["row"][encounters["code"] == code], minlength=B)
    domain = np.full(B, np.inf)
    np.minimum.at(domain, encounters["row"], encounters["domain"])
    episodes["domain_min"] = np.where(np.isfinite(domain), domain, np.nan)
    for name, value in values.items():
        counts = complete & ~np.isnan(value)
        at = encounters["row"][counts]
        n, total = np.bincount(at, minlength=B), np.bincount(at, value[counts], minlength=B)
        episodes[name] = np.divide(total, n, out=np.full(B, np.nan), where=n > 0)
        worst = np.full(B, np.inf)
        np.minimum.at(worst, at, value[counts])
        episodes[f"{name}_min"] = np.where(n > 0, worst, np.nan)
    return Verdict(params, episodes, encounters, values, made_of, scoring)


@functools.cache
def episode_columns() -> tuple[str, ...]:
    """Names of the columns of an episode, in order."""
    return tuple(judge(Trajectory.empty(0, 1, 1)).episodes)


__all__ = ["PARTS", "SCORES", "Scoring", "Verdict", "episode_columns", "judge"]
