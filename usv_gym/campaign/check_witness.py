"""The witness of a check: judges every episode of a batch by requirements and assertions, where it was flown."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..colregs.params import Params
from ..colregs.requirements import Requirement, evaluate, requirement
from ..colregs.signals import MODE, signals
from ..colregs.trajectory import Trajectory
from ..colregs.verdict import Verdict, judge
from ..config import ConfigError
from ..envs.core import Core
from ..tasks.task import OUTCOMES
from .checks import Assertion
from .evidence import TruthWitness

Finding = dict[str, Any]  #: what, ok (None: not applicable), value, time [s], text


class CheckWitness(TruthWitness):
    """A witness of a flight (``flight.Witness``); adds ``findings`` to every result: requirements first, then assertions."""

    def __init__(
        self, requirements: Mapping[str, Mapping[str, Any]], asserts: Sequence[Mapping[str, Any]], params: Mapping[str, Any]
    ) -> None:
        self.requirements = {id: Requirement.model_validate(one) for id, one in requirements.items()}
        self.asserts = [Assertion.model_validate(one) for one in asserts]
        self.params = Params.model_validate(params)
        # formulas of assertions are judged like requirements, by the kernels
        self._formulas = {f"assert {k}": requirement(str(one.stl)) for k, one in enumerate(self.asserts) if one.stl is not None}

    def finish(self, core: Core, rows: int) -> list[dict[str, Any]]:
        """Judge."""
        x = self._recorder.trajectory.rows(slice(0, rows))
        verdict = judge(x, self.params)
        margins = evaluate(x, {**self.requirements, **self._formulas}, self.params)
        worst = margins.worst()
        out = []
        for b in range(rows):
            names = core.ids(b)
            found = [_of_margin(id, _at(worst, r, b), names) for r, id in enumerate(self.requirements)]
            for k, one in enumerate(self.asserts):
                try:
                    if one.stl is not None:
                        r = margins.ids.index(f"assert {k}")
                        margin = _at(worst, r, b)
                        if one.of is not None:
                            j = _slot(one.of, names)
                            value = margins.value[r, b, j]
                            margin = math.nan if value >= 0.5 * MODE else value, j, margins.time[r, b, j]
                        found.append(_of_margin(str(one), margin, names))
                    else:
                        found.append(_assert(one, x, verdict, core, b, names, self.params))
                except ConfigError as error:
                    found.append({"what": str(one), "ok": False, "value": None, "time": None,
                                  "text": str(error)})  # fmt: skip
            out.append({"findings": found})
        return out


def _finding(what: str, ok: bool | None, value: float, time: float, text: str) -> Finding:
    return {"what": what, "ok": ok, "value": float(value) if math.isfinite(value) else None,
            "time": float(time) if math.isfinite(time) else None, "text": text}  # fmt: skip


def _at(worst: tuple[NDArray[Any], ...], r: int, b: int) -> tuple[float, int, float]:
    """(margin, ship, time) of requirement r in row b."""
    value, ship, time = (column[r, b].item() for column in worst)
    return value, ship, time


def _of_margin(what: str, margin: tuple[float, int, float], names: Sequence[str]) -> Finding:
    value, ship, time = margin
    if math.isnan(value):
        return _finding(what, None, math.nan, math.nan, "not applicable")
    about = f" towards {names[ship]}" if ship > 0 else ""
    return _finding(what, value >= 0.0, value, time, f"margin {value:.3g}{about}")


def _slot(name: str, names: Sequence[str]) -> int:
    if name not in names:
        raise ConfigError(f"nothing is called {name!r}; there are {', '.join(n for n in names if n)}")
    return list(names).index(name)


def _assert(
    one: Assertion, x: Trajectory, verdict: Verdict, core: Core, b: int, names: Sequence[str], params: Params
) -> Finding:
    what, row, V = str(one), verdict.row(b), x.vessels
    if one.outcome is not None:
        outcome = OUTCOMES[core.episodes["outcome"][b]]
        return _finding(what, outcome == one.outcome, math.nan, row["time"], f"outcome {outcome}")
    if one.route_done_before is not None:
        done = bool(row["arrival"]) and row["time"] < one.route_done_before
        text = f"{'done' if row['arrival'] else 'not done'} at {row['time']:.0f} s"
        return _finding(what, done, row["time"], row["time"], text)
    if one.never_closer_than is not None:
        distance, time, to = _nearest(one.to, x, verdict, core, b, names)
        ok = distance >= one.never_closer_than
        return _finding(what, ok, distance, time, f"{distance:.1f} m{to}" if math.isfinite(distance) else "nothing was there")
    if one.score is not None:
        assert one.at_least is not None
        score = verdict.scores[one.score]
        here = [i for i in verdict.of_row(b) if verdict.encounters["complete"][i]
                and (one.of is None or verdict.encounters["ship"][i] == _slot(one.of, names))]  # fmt: skip
        known = [i for i in here if not math.isnan(score[i])]
        if not known:
            return _finding(what, None, math.nan, math.nan, "not applicable")
        i = min(known, key=lambda i: float(score[i]))
        value = float(score[i])
        e = verdict.encounters[i]
        text = f"{value:.2f} towards {names[e['ship']]}: {verdict.why(i)}"
        return _finding(what, value >= one.at_least, value, math.nan, text)
    if one.detects is not None:
        assert one.before_range is not None
        j = _slot(one.detects, names)
        s = signals(x, b, j, params)
        seen = np.flatnonzero(s["tracked"] > 0)
        if not len(seen):
            return _finding(what, False, math.nan, row["time"], "never detected")
        k = int(seen[0])
        return _finding(what, s["range"][k] >= one.before_range, s["range"][k], s["t"][k],
                        f"detected at {s['range'][k]:.0f} m, {s['t'][k]:.0f} s")  # fmt: skip
    ships = [_slot(one.of, names)] if one.of else [j for j in range(V) if j != x.own[b] and x.active[b, :, j].any()]
    findings = [_passing(one, x, b, j, names, params) for j in ships]
    bad = [finding for finding in findings if finding["ok"] is False]
    return (bad or findings or [_finding(what, None, math.nan, math.nan, "no ship was there")])[0]


def _passing(one: Assertion, x: Trajectory, b: int, j: int, names: Sequence[str], params: Params) -> Finding:
    """On which side the own ship passes ship j, at the closest sample."""
    s = signals(x, b, j, params)
    k = int(np.argmin(s["range"]))
    alpha, beta = s["contact_angle"][k], s["bearing"][k]
    if k == len(s["range"]) - 1 and s["tcpa"][k] > 0:
        return _finding(str(one), None, math.nan, s["t"][k], f"has not passed {names[j]}")
    ok = {
        "port_to_port": alpha < 0 and beta < 0,
        "starboard_to_starboard": alpha > 0 and beta > 0,
        "ahead": abs(alpha) < 90,
        "astern": abs(alpha) > 90,
    }[str(one.passes)]
    text = f"passed {names[j]} at {s['range'][k]:.0f} m, bearing {beta:.0f} deg, contact angle {alpha:.0f} deg"
    return _finding(str(one), bool(ok), s["range"][k], s["t"][k], text)


def _nearest(
    to: str | None, x: Trajectory, verdict: Verdict, core: Core, b: int, names: Sequence[str]
) -> tuple[float, float, str]:
    """(smallest hull distance [m], its time [s] where known, " to what")."""
    row, V = verdict.row(b), x.vessels
    if to is not None:
        s = _slot(to, names)
        closest = float(core.worlds["safety"]["closest"][b, 0, s])
        k = int(np.argmin(signals(x, b, s)["clearance"])) if s < V else -1
        return closest, float(x.t[b, k]) if k >= 0 else math.nan, f" to {to}"
    if row["min_distance"] <= row["min_obstacle_distance"]:
        return row["min_distance"], row["min_distance_time"], f" to {names[int(row['min_distance_ship'])]}"
    k = int(np.argmin(x.obstacle[b, : x.steps[b]]))
    return row["min_obstacle_distance"], float(x.t[b, k]), " to an obstacle or land"
