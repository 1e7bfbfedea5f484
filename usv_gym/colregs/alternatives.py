"""Other ways to score an encounter, for comparison; the encounters and what happened in them are those of set A.

Use one as ``judge(trajectory, params, set_b)``.  Their reasons are not put into words.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..units import DEG
from ..world.encounter import Encounter
from .params import Params
from .scores import SCORES, Floats, angle_score, wrong_side

#: set B: separation [m] of ships in open waters: least acceptable, near miss, collision, and what each is worth
B_MIN, B_NM, B_COL, B_GAMMA_NM, B_GAMMA_COL = 1000.0, 800.0, 200.0, 0.4, 0.6


def _columns(code: NDArray[Any], safety: Floats, **rules: tuple[tuple[Encounter, ...], Floats]) -> dict[str, Floats]:
    """Scores by name, NaN where a rule says nothing of an encounter; all within 0 and 1."""
    out = {name: np.full(len(code), np.nan) for name in SCORES}
    out["safety"] = np.clip(safety, 0.0, 1.0)
    for name, (codes, value) in rules.items():
        out[name] = np.where(np.isin(code, codes), np.clip(value, 0.0, 1.0), np.nan)
    return out


def set_b(e: NDArray[Any], params: Params) -> tuple[dict[str, Floats], dict[str, Floats]]:
    """Scores and parts of the AIS verification at NTNU (Minne 2017, Hagen), after Woerner et al. 2019 (Auton. Robots).

    Distances are constants for ships of open waters (1000, 800, 200 m), centre to centre.  Where our source leaves it open: a
    starboard turn of d counts as 1 - (d / 20 deg)^4 of a penalty, and P_sts is that of set A.
    """
    seen, code, r = e["seen"], e["code"], e["cpa_range"]
    s_range = np.select(
        [r >= B_MIN, r >= B_NM, r >= B_COL],
        [np.ones(len(e)), 1.0 - B_GAMMA_NM * (B_MIN - r) / (B_MIN - B_NM),
         1.0 - B_GAMMA_NM - B_GAMMA_COL * (B_NM - r) / (B_NM - B_COL)], 0.0)  # fmt: skip
    safety = np.where(e["contact"] != 0, 0.0, 0.5 * s_range + 0.5 * angle_score(e["cpa_alpha"], e["cpa_beta"]))
    turn = np.maximum(seen["turn_starboard"], seen["turn_port"])
    p_course = 0.5 * np.maximum(0.0, 1.0 - (turn / (30.0 * DEG)) ** 2)
    p_speed = 0.5 * np.maximum(0.0, 1.0 - (seen["slowed"] / 0.5) ** 2)
    p_apparent = np.where((p_course < 0.3) | (p_speed < 0.3), 0.0, p_course * p_speed)
    span = np.maximum(e["start_range"] - r, 1e-9)
    p_delay = np.clip((e["start_range"] - np.nan_to_num(seen["manoeuvre_range"], nan=-np.inf)) / span, 0.0, 1.0)
    p_starboard = 1.0 - np.clip(seen["turn_starboard"] / (20.0 * DEG), 0.0, 1.0) ** 4
    p_side = wrong_side(e["cpa_alpha"], e["cpa_beta"])
    ahead13, ahead15 = np.abs(e["cpa_alpha"]) < 45 * DEG, (e["cpa_alpha"] > -25 * DEG) & (e["cpa_alpha"] < 165 * DEG)
    r16 = safety * (1.0 - p_delay) * (1.0 - p_apparent)
    r14 = (1.0 - 0.6 * p_starboard - 0.2 * p_delay - p_side) * (1.0 - p_apparent)
    kept = np.clip((turn - 2 * DEG) / (28 * DEG), 0.0, 1.0)
    r17 = (safety - kept) / (1.0 + seen["sped"]) ** 2 - 0.5 * seen["slowed"]
    E = Encounter
    overtaken, stands = code == E.OVERTAKEN, code == E.CROSSING_STAND_ON
    scores = _columns(
        code, safety,
        r13=((E.OVERTAKING, E.OVERTAKEN), np.where(overtaken, r17, r16 - 0.3 * ahead13)),
        r14=((E.HEAD_ON,), r14),
        r15=((E.CROSSING_GIVE_WAY, E.CROSSING_STAND_ON), np.where(stands, r17, r16 - 0.5 * ahead15)),
        r16=((E.CROSSING_GIVE_WAY, E.OVERTAKING), r16),
        r17=((E.CROSSING_STAND_ON, E.OVERTAKEN), r17),
    )  # fmt: skip
    made_of = {"s_range": s_range, "p_apparent": p_apparent, "p_delay": p_delay, "p_starboard": p_starboard, "p_side": p_side}
    return scores, made_of


def set_c(e: NDArray[Any], params: Params) -> tuple[dict[str, Floats], dict[str, Floats]]:
    """Scores and parts by shares that add up, after VesselNav-Bench: a turn counts from 10 deg, contact is 0.

    The safe distance is the preferred clearance of set A, k (R_pref - R_col).
    """
    seen, code = e["seen"], e["code"]
    safe = (e["size"] if params.scaled else 1.0) * (params.r_pref - params.r_col)
    touched = e["contact"] != 0
    separation = np.where(touched, 0.0, np.clip(e["clearance"] / safe, 0.0, 1.0))
    starboard = (seen["turn_starboard"] >= 10 * DEG).astype(float)
    held = (np.maximum(seen["turn_starboard"], seen["turn_port"]) < 10 * DEG).astype(float)
    early = (seen["manoeuvre_time"] <= e["start"] + 0.5 * e["start_tcpa"]).astype(float)  # false for none
    alive = ~touched
    head_on = alive * (0.5 * starboard + 0.5 * separation)
    give_way = alive * (0.3 * early + 0.3 * starboard + 0.4 * separation)
    stand_on = alive * (0.4 * held + 0.6 * (separation >= 0.8))
    E = Encounter
    scores = _columns(
        code, separation,
        r13=((E.OVERTAKING, E.OVERTAKEN), np.where(code == E.OVERTAKEN, stand_on, separation)),
        r14=((E.HEAD_ON,), head_on),
        r15=((E.CROSSING_GIVE_WAY, E.CROSSING_STAND_ON), np.where(code == E.CROSSING_STAND_ON, stand_on, give_way)),
        r16=((E.CROSSING_GIVE_WAY,), give_way),
        r17=((E.CROSSING_STAND_ON, E.OVERTAKEN), stand_on),
    )  # fmt: skip
    return scores, {"separation": separation, "starboard": starboard, "held": held, "early": early}
