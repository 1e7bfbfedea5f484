"""Rule scores of encounters by set A: Hagen, Vassbotn, Skogvold, Johansen and Brekke, Ocean Engineering 288 (2023) 115991.

Everything is an array function over encounters [n]; equation numbers are the paper's.  1 is perfect, 0 is worst; a score that
says nothing of an encounter is NaN (Rule 15 of a head-on meeting).  Where we differ from the published text:

* Distances follow vessel and geometry (``Params``), and separation is counted from the hulls: r = clearance + R_col, so that
  r = R_col is contact, whatever the lengths and aspects.
* Scores of Rules 13 and 15 do not fall below 0.
* The penalty for turning to port (Rule 17 c) concerns a ship on the own *port* side, in a crossing.
* Rule 14 has no safety factor: a collision can score above 0 there; read it beside ``safety``.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..units import DEG
from ..world.encounter import Encounter
from .params import Params

Floats = NDArray[np.float64]

#: scores of an encounter; ``r<k>`` is of Rule k
SCORES = ("safety", "r8", "r13", "r14", "r15", "r16", "r17")
#: what they are made of: a share of 1 that is lost (p_*, ahead*), or kept (s_*)
PARTS = ("s_range", "s_angle", "p_course", "p_speed", "s_apparent", "p_delay", "p_starboard", "p_side", "p_stage2", "p_stage3",
         "p_port", "ahead13", "ahead15")  # fmt: skip
#: rules that are not judged: their subject (channels, lanes, lights, fog) is not in the world
NOT_JUDGED = {9: "narrow channels", 10: "traffic separation schemes", 18: "responsibilities between vessels",
              19: "restricted visibility"}  # fmt: skip


def range_score(r: Floats, r_pref: Floats, r_min: Floats, r_nm: Floats, r_col: Floats) -> Floats:
    """S_r, Eq 3: 1 beyond r_pref, 0.8 at r_min, 0.5 at r_nm, 0 below r_col; linear between.  All [n] in metres."""
    far = 1.0 - 0.2 * (r_pref - r) / (r_pref - r_min)
    middle = 0.8 - 0.3 * (r_min - r) / (r_min - r_nm)
    near = 0.5 - 0.5 * (r_nm - r) / (r_nm - r_col)
    return np.select([r >= r_pref, r >= r_min, r >= r_nm, r >= r_col], [np.ones_like(r), far, middle, near], 0.0)


def angle_score(alpha: Floats, beta: Floats) -> Floats:
    """S_theta, Eq 4-6: 0 dead ahead of each other, 1 abaft the beam of each other; angles [rad] [n]."""

    def clear(angle: Floats) -> Floats:
        return np.where(np.abs(angle) < 0.5 * np.pi, 1.0 - np.cos(angle), 1.0)

    return 0.25 * clear(alpha) + 0.75 * clear(beta)


def safety_score(s_range: Floats, s_angle: Floats) -> Floats:
    """S_safety, Eq 2: a short distance is less bad with the bow pointing elsewhere; contact is 0."""
    return np.where(s_range == 0.0, 0.0, s_range + (1.0 - s_range) * s_angle)


def not_apparent(x: Floats, detectable: float, apparent: float) -> Floats:
    """P_na, Eq 10-14: 1 for a change that cannot be seen, 0 for one that is readily apparent (Rule 8 b)."""
    middle = 1.0 - ((x - detectable) / (apparent - detectable)) ** 2
    return np.select([x <= detectable, x >= apparent], [np.ones_like(x), np.zeros_like(x)], middle)


def deviation(x: Floats, detectable: float, apparent: float) -> Floats:
    """a(x) of P_st, Eq 16-24: 0 for a change that cannot be seen, growing linearly to 1 for a readily apparent one."""
    return np.clip((x - detectable) / (apparent - detectable), 0.0, 1.0)


def delay(manoeuvre_range: Floats, start_range: Floats, r3: Floats) -> Floats:
    """P_delay, Eq 8: 0 for a first manoeuvre beyond R3, else the share of the entry range that was let go; 1 for none."""
    late = np.clip((start_range - manoeuvre_range) / start_range, 0.0, 1.0)
    return np.where(np.isnan(manoeuvre_range), 1.0, np.where(manoeuvre_range > r3, 0.0, late))


def wrong_side(alpha: Floats, beta: Floats) -> Floats:
    """P_sts, Eq 28: 0 for port to port (alpha = beta = -90 deg), 1 for starboard to starboard."""
    return 1.0 - ((np.sin(alpha) - 1.0) / 2.0) ** 2 * ((np.sin(beta) - 1.0) / 2.0) ** 2


def no_starboard_turn(turn: Floats) -> Floats:
    """P_nsb, Eq 29-30: 1 for less than 10 deg to starboard, 0 for more than 30 deg; ``turn`` [rad] [n]."""
    d = turn / DEG
    return np.select([d < 10.0, d > 30.0], [np.ones_like(d), np.zeros_like(d)], 1.0 - ((d - 10.0) / 20.0) ** 2)


def parts(e: NDArray[Any], params: Params) -> dict[str, Floats]:
    """The parts of all scores of encounters [n] (``features.encounter_dtype``); names are :data:`PARTS`."""
    seen, k = e["seen"], e["size"] if params.scaled else np.ones(len(e))
    alpha, beta = e["cpa_alpha"], e["cpa_beta"]
    md, app = params.course_md_deg * DEG, params.course_app_deg * DEG
    s_range = range_score(e["clearance"] + k * params.r_col, k * params.r_pref, k * params.r_min, k * params.r_nm,
                          k * params.r_col)  # fmt: skip
    s_range = np.where((e["contact"] != 0) | (e["clearance"] <= 0.0), 0.0, s_range)
    turn = np.maximum(seen["turn_starboard"], seen["turn_port"])
    p_course = not_apparent(turn, md, app)
    p_speed = not_apparent(seen["slowed"], params.speed_md, params.speed_app)

    def stood_on(turned: Floats, changed: Floats) -> Floats:
        return 0.5 * deviation(turned, md, app) + 0.5 * deviation(changed, params.speed_md, params.speed_app)

    crossing = e["code"] == Encounter.CROSSING_STAND_ON
    low, high = (angle * DEG for angle in params.alpha15_deg)
    return {
        "s_range": s_range,
        "s_angle": angle_score(alpha, beta),
        "p_course": p_course,
        "p_speed": p_speed,
        "s_apparent": 1.0 - 0.5 * p_course - 0.5 * p_speed,  # Eq 9
        "p_delay": delay(seen["manoeuvre_range"], e["start_range"], e["r3"]),
        "p_starboard": no_starboard_turn(seen["turn_starboard"]),
        "p_side": wrong_side(alpha, beta),
        "p_stage2": stood_on(seen["turn2"], seen["change2"]),
        "p_stage3": stood_on(seen["turn3"], seen["change3"]),
        "p_port": (crossing & (seen["port4_side"] != 0) & (seen["port4"] >= md)).astype(float),
        "ahead13": (np.abs(alpha) < params.alpha13_deg * DEG).astype(float),
        "ahead15": ((low < alpha) & (alpha < high)).astype(float),
    }


def combine(code: NDArray[Any], p: dict[str, Floats]) -> dict[str, Floats]:
    """Scores [n] from codes of encounters [n] and their parts; names are :data:`SCORES`."""
    safety = safety_score(p["s_range"], p["s_angle"])
    s8 = p["s_apparent"] * (1.0 - p["p_delay"])  # from the same terms; the paper has no equation of its own
    s16 = safety * s8  # Eq 7
    s17 = safety * (1.0 - p["p_stage2"]) * (1.0 - p["p_stage3"]) * (1.0 - p["p_port"])  # Eq 15
    s14 = (1.0 - 0.4 * p["p_starboard"] - 0.6 * p["p_side"]) * (1.0 - p["p_course"]) * (1.0 - p["p_delay"])  # Eq 27
    overtakes, overtaken = code == Encounter.OVERTAKING, code == Encounter.OVERTAKEN
    gives_way, stands_on = code == Encounter.CROSSING_GIVE_WAY, code == Encounter.CROSSING_STAND_ON
    head_on = code == Encounter.HEAD_ON
    acts = overtakes | gives_way | head_on

    def of(*cases: tuple[NDArray[np.bool_], Floats]) -> Floats:
        return np.select([case for case, _ in cases], [np.clip(value, 0.0, 1.0) for _, value in cases], np.nan)

    return {
        "safety": safety,
        "r8": of((acts, s8)),
        "r13": of((overtakes, s16 - 0.3 * p["ahead13"]), (overtaken, s17)),  # Eq 25
        "r14": of((head_on, s14)),
        "r15": of((gives_way, s16 - 0.5 * p["ahead15"]), (stands_on, s17)),  # Eq 31
        "r16": of((overtakes | gives_way, s16)),
        "r17": of((overtaken | stands_on, s17)),
    }


def scores(e: NDArray[Any], params: Params) -> tuple[dict[str, Floats], dict[str, Floats]]:
    """(scores, parts) of encounters [n] by set A."""
    p = parts(e, params)
    return combine(e["code"], p), p


_PERFECT = {name: np.full(1, 1.0 if name.startswith("s_") else 0.0) for name in PARTS}


def reasons(e: Any, params: Params, score: str) -> list[tuple[float, float, str]]:
    """What cost a score of one encounter: (loss, time [s], text), the dearest first.

    The loss of a part is what it costs by itself, everything else being perfect; where a fault is that nothing was done, the
    time is that of the closest point.
    """
    one = np.asarray(e).reshape(1)
    code, p = one["code"], parts(one, params)
    row: Any = one[0]
    seen = row["seen"]
    turn, starboard = max(seen["turn_starboard"], seen["turn_port"]) / DEG, seen["turn_starboard"] / DEG
    passed = "collided" if p["s_range"][0] == 0.0 else f"passed at {row['clearance']:.0f} m"
    acted = not np.isnan(seen["manoeuvre_range"])
    keeping = "did not keep course and speed in stage"
    faults: tuple[tuple[tuple[str, ...], str, float], ...] = (
        (("s_range", "s_angle"), passed, row["clearance_time"]),
        (("p_course",), f"changed course by {turn:.0f} deg at most", seen["turn_time"]),
        (("p_speed",), f"reduced speed by {seen['slowed']:.0%} at most", seen["slowed_time"]),
        (("p_delay",), f"first acted at {seen['manoeuvre_range']:.0f} m" if acted else "did not act", seen["manoeuvre_time"]),
        (("p_starboard",), f"turned {starboard:.0f} deg to starboard at most", seen["turn_time"]),
        (("p_side",), "did not pass port to port", row["cpa_time"]),
        (("p_stage2",), f"{keeping} 2", _later(seen, "2", params)),
        (("p_stage3",), f"{keeping} 3", _later(seen, "3", params)),
        (("p_port",), "turned to port for a ship on the port side", seen["port4_time"]),
        (("ahead13",), "passed ahead of the overtaken vessel", row["cpa_time"]),
        (("ahead15",), "crossed ahead", row["cpa_time"]),
    )
    found = []
    for names, text, when in faults:
        alone = {**_PERFECT, **{name: p[name] for name in names}}
        alone["s_apparent"] = 1.0 - 0.5 * alone["p_course"] - 0.5 * alone["p_speed"]
        loss = 1.0 - float(combine(code, alone)[score][0])
        if loss > 1e-9:
            found.append((loss, float(row["cpa_time"]) if np.isnan(when) else float(when), text))
    return sorted(found, key=lambda fault: -fault[0])


def _later(seen: Any, stage: str, params: Params) -> float:
    """Time of the larger of the two deviations of a stage, each as a share of what is apparent."""
    turn, change = seen[f"turn{stage}"] / (params.course_app_deg * DEG), seen[f"change{stage}"] / params.speed_app
    return float(seen[f"turn{stage}_time"] if turn >= change else seen[f"change{stage}_time"])
