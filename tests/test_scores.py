"""Rule scores (set A) against cases worked by hand, one for each rule; symmetry, monotonicity, batches."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from meeting import meeting

from usv_gym.colregs import scores as s
from usv_gym.colregs.alternatives import set_b, set_c
from usv_gym.colregs.params import PUBLISHED, Params
from usv_gym.colregs.trajectory import Trajectory
from usv_gym.colregs.verdict import judge
from usv_gym.config import ConfigError, Document, validate
from usv_gym.world.encounter import Encounter

DEG = math.pi / 180.0

def one(x, params=PUBLISHED):
    verdict = judge(x, params)
    assert len(verdict.encounters) == 1
    return verdict, {name: float(v[0]) for name, v in (verdict.scores | verdict.parts).items()}, verdict.encounters[0]


# --- the terms -------------------------------------------------------------------------------------------------------
@pytest.mark.parametrize(
    ("r", "expected"),
    [
        (250.0, 1.0),
        (200.0, 1.0),
        (150.0, 0.9),  # 1 - 0.2 (200 - 150) / (200 - 100)
        (100.0, 0.8),
        (75.0, 0.65),  # 0.8 - 0.3 (100 - 75) / (100 - 50)
        (50.0, 0.5),
        (42.5, 0.25),  # 0.5 - 0.5 (50 - 42.5) / (50 - 35)
        (35.0, 0.0),
        (34.9, 0.0),
    ],
)
def test_range_score(r, expected):
    bounds = (np.array([v]) for v in (200.0, 100.0, 50.0, 35.0))
    assert s.range_score(np.array([r]), *bounds)[0] == pytest.approx(expected)


@pytest.mark.parametrize(
    ("alpha", "beta", "expected"),
    [
        (0, 0, 0.0),  # bow to bow
        (90, 90, 1.0),
        (180, 180, 1.0),
        (60, 0, 0.125),  # 0.25 (1 - cos 60)
        (0, 60, 0.375),  # 0.75 (1 - cos 60)
        (-60, -60, 0.5),
    ],
)
def test_angle_score(alpha, beta, expected):
    assert s.angle_score(np.array([alpha * DEG]), np.array([beta * DEG]))[0] == pytest.approx(expected)


def test_safety_of_contact_is_zero_whatever_the_angle():
    # S = S_r + (1 - S_r) S_theta: 0.5 + 0.5 * 0.4 = 0.7, but 0 once S_r is 0
    assert s.safety_score(np.array([0.5, 0.0]), np.array([0.4, 1.0])) == pytest.approx([0.7, 0.0])


def test_apparent_change():
    x = np.array([1.0, 2.0, 16.0, 30.0, 50.0])
    # (16 - 2) / (30 - 2) = 0.5, and 1 - 0.5^2 = 0.75
    assert s.not_apparent(x, 2.0, 30.0) == pytest.approx([1.0, 1.0, 0.75, 0.0, 0.0])
    assert s.deviation(x, 2.0, 30.0) == pytest.approx([0.0, 0.0, 0.5, 1.0, 1.0])


def test_delay():
    r3, entry = np.full(4, 700.0), np.full(4, 1900.0)
    # beyond R3 in time; (1900 - 570) / 1900 = 0.7; no manoeuvre at all
    assert s.delay(np.array([1000.0, 701.0, 570.0, np.nan]), entry, r3) == pytest.approx([0.0, 0.0, 0.7, 1.0])


def test_side_and_starboard_turn():
    # port to port 0; starboard to starboard 1; bow to bow 1 - (1/2)^2 (1/2)^2 = 15/16
    alpha = np.array([-90.0, 90.0, 0.0]) * DEG
    assert s.wrong_side(alpha, alpha) == pytest.approx([0.0, 1.0, 0.9375])
    # (20 - 10) / 20 = 0.5, 1 - 0.25
    assert s.no_starboard_turn(np.array([9.0, 10.0, 20.0, 30.5]) * DEG) == pytest.approx([1.0, 1.0, 0.75, 0.0])


# --- the rules, one encounter each -----------------------------------------------------------------------------------
def test_rule_14_a_clear_turn_to_starboard_is_perfect():
    # head-on at 5 m/s each, seen at 1900 m; 40 deg to starboard at 1500 m, back after 60 s at 5 sin 40 = 3.2 m/s: 193 m off
    x = meeting([(100, 0, 5), (60, 40, 5), (300, 0, 5)], [(500, 180, 5)], [2500, 0])
    verdict, v, e = one(x)
    assert Encounter(e["code"]) is Encounter.HEAD_ON
    assert e["start_range"] == pytest.approx(1900.0)
    assert e["cpa_range"] == pytest.approx(60 * 5 * math.sin(40 * DEG))  # abeam, port to port
    assert (e["cpa_alpha"] / DEG, e["cpa_beta"] / DEG) == pytest.approx((-90.0, -90.0))
    assert e["seen"]["manoeuvre_range"] == pytest.approx(1500.0)
    # r = 192.8 + 35 > 200 m: S_r = 1.  40 > 30 deg: P_na = P_nsb = 0; beyond R3: P_delay = 0; port to port: P_sts = 0
    assert v["safety"] == pytest.approx(1.0)
    assert v["r14"] == pytest.approx(1.0)
    # speed was kept: S8 = S_app = 1 - 0.5
    assert v["r8"] == pytest.approx(0.5)
    assert all(math.isnan(v[name]) for name in ("r13", "r15", "r16", "r17"))
    assert verdict.row(0)["head_on"] == 1


def test_rule_14_late_and_small():
    # 20 deg to starboard at 570 m: dchi 20: P_na = 1 - (18/28)^2 = 0.5867; P_nsb = 1 - (10/20)^2 = 0.75;
    # P_delay = (1900 - 570) / 1900 = 0.7; in 24 s 5 sin 20 = 1.71 m/s: 41 m, port to port: P_sts = 0
    x = meeting([(193, 0, 5), (24, 20, 5), (300, 0, 5)], [(500, 180, 5)], [2500, 0])
    _, v, _ = one(x)
    assert v["p_course"] == pytest.approx(1 - (18 / 28) ** 2)
    assert v["p_delay"] == pytest.approx(0.7, abs=1e-6)
    assert v["p_side"] == pytest.approx(0.0, abs=1e-6)
    assert v["r14"] == pytest.approx((1 - 0.4 * 0.75) * (18 / 28) ** 2 * 0.3, abs=1e-6)


def test_rule_14_to_port_is_starboard_to_starboard():
    # the mirror image of the perfect case: P_sts = 1, P_nsb = 1: 1 - 0.4 - 0.6 = 0
    x = meeting([(100, 0, 5), (60, -40, 5), (300, 0, 5)], [(500, 180, 5)], [2500, 0])
    verdict, v, e = one(x)
    assert v["r14"] == pytest.approx(0.0, abs=1e-9)
    assert v["safety"] == pytest.approx(1.0)
    why = s.reasons(e, PUBLISHED, "r14")
    assert [text for _, _, text in why][:2] == ["did not pass port to port", "turned 0 deg to starboard at most"]
    assert why[0][0] == pytest.approx(0.6)
    assert why[0][1] == pytest.approx(e["cpa_time"])
    assert "did not pass port to port" in verdict.why(0) or verdict.why(0).startswith("rule 14 0.00")


def test_rules_15_and_16_give_way_passing_astern():
    # perpendicular crossing from starboard, contact in 300 s at the origin of the paths if nobody acts;
    # at 100 s 60 deg to starboard for 60 s, then back: the other has passed ahead of us
    own = [(100, 0, 5), (60, 60, 5), (400, 0, 5)]
    x = meeting(own, [(600, 270, 5)], [1500, 1500])
    _, v, e = one(x)
    assert Encounter(e["code"]) is Encounter.CROSSING_GIVE_WAY
    # own falls back 5 * 60 * (1 - cos 60) = 150 m and moves 5 * 60 sin 60 = 259.8 m to starboard.  Relative motion runs
    # along (-1, -1) / sqrt 2, so the two pass at |150 + 259.8| / sqrt 2 = 289.8 m
    assert e["cpa_range"] == pytest.approx((150 + 300 * math.sin(60 * DEG)) / math.sqrt(2), rel=1e-6)
    # the other is then 45 deg on the port bow; we are 45 deg abaft ... of its port beam: alpha = -135 deg
    assert (e["cpa_alpha"] / DEG, e["cpa_beta"] / DEG) == pytest.approx((-135.0, -45.0))
    assert v["ahead15"] == 0.0
    assert v["safety"] == 1.0
    assert v["r16"] == pytest.approx(0.5)  # S_safety S_app: 60 deg are apparent, speed was kept
    assert v["r15"] == pytest.approx(0.5)


def test_rule_15_crossing_ahead_costs_a_half():
    # the same, but speeding through to port: 40 deg to port and back, passing ahead of the other
    own = [(100, 0, 5), (60, -40, 8), (400, 0, 8)]
    x = meeting(own, [(600, 270, 5)], [1500, 1500])
    _, v, e = one(x)
    assert Encounter(e["code"]) is Encounter.CROSSING_GIVE_WAY
    assert -25.0 < e["cpa_alpha"] / DEG < 165.0
    assert v["ahead15"] == 1.0
    assert v["r15"] == pytest.approx(max(v["r16"] - 0.5, 0.0))
    assert v["r16"] == pytest.approx(v["safety"] * 0.5)  # dU is a *reduction* of speed: none


def test_rule_16_by_speed_alone():
    # half speed from 100 s on: dU = 0.5 > 0.25 is apparent, the course was kept: S_app = 0.5, and the other passes ahead
    x = meeting([(100, 0, 6), (600, 0, 3)], [(700, 270, 5)], [1500, 1300])
    _, v, e = one(x)
    assert (v["p_course"], v["p_speed"]) == (1.0, 0.0)
    assert e["seen"]["slowed"] == pytest.approx(0.5)
    assert v["r8"] == pytest.approx(0.5)


def test_rule_17_standing_on_is_perfect_and_a_deviation_costs():
    # from port, it gives way by 60 deg to starboard and back; we stand on
    other = [(100, 90, 5), (60, 150, 5), (400, 90, 5)]
    _, v, e = one(meeting([(600, 0, 5)], other, [1500, -1500]))
    assert Encounter(e["code"]) is Encounter.CROSSING_STAND_ON
    assert v["r17"] == v["r15"] == pytest.approx(1.0)
    assert math.isnan(v["r16"])
    # 16 deg in stage 2, from 50 s on: P_st2 = 0.5 (16 - 2) / 28 = 0.25; P_st3 is relative to the first sample of stage 3: 0
    _, v, e = one(meeting([(50, 0, 5), (550, 16, 5)], other, [1500, -1500]))
    assert (v["p_stage2"], v["p_stage3"]) == pytest.approx((0.25, 0.0))
    assert v["r17"] == pytest.approx(0.75 * v["safety"])
    assert e["seen"]["turn2_time"] == pytest.approx(50.0)


def test_rule_17c_turning_to_port_for_a_ship_on_the_port_side():
    # it does not give way; at R4 = 200 m (closing at 5 sqrt 2: 28 s before contact at 300 s) we turn 20 deg to port
    at = 300 - 27
    x = meeting([(at, 0, 5), (200, -20, 5)], [(600, 90, 5)], [1500, -1500])
    _, v, e = one(x)
    assert e["seen"]["stage4_time"] == pytest.approx(300 - 200 / (5 * math.sqrt(2)), abs=1.0)
    assert v["p_port"] == 1.0
    assert v["r17"] == 0.0
    assert any(text == "turned to port for a ship on the port side" for _, _, text in s.reasons(e, PUBLISHED, "r17"))
    # to starboard it is no fault of Rule 17 c, and stage 4 has no other
    x = meeting([(at, 0, 5), (200, 20, 5)], [(600, 90, 5)], [1500, -1500])
    assert one(x)[1]["r17"] == pytest.approx(one(x)[1]["safety"])


def test_rule_13_overtaking():
    # 8 m/s past 3 m/s: 40 deg to starboard at 1000 m for 40 s, then parallel: passes at 8 * 40 sin 40 = 205.7 m abeam
    own = [(20, 0, 8), (40, 40, 8), (400, 0, 8)]
    _, v, e = one(meeting(own, [(500, 0, 3)], [1100, 0]))
    assert Encounter(e["code"]) is Encounter.OVERTAKING
    assert e["cpa_range"] == pytest.approx(320 * math.sin(40 * DEG), rel=1e-4)
    assert v["ahead13"] == 0.0  # abeam: alpha = 90 deg
    assert v["r13"] == v["r16"] == pytest.approx(0.5)
    # being overtaken: the other keeps clear, we keep course and speed
    _, v, e = one(meeting([(500, 0, 3)], own, [-1100, 0]))
    assert Encounter(e["code"]) is Encounter.OVERTAKEN
    assert v["r13"] == v["r17"] == pytest.approx(1.0)
    # and with 44 deg to starboard in stage 3 (range < 700 m): P_st3 = 0.5
    _, v, e = one(meeting([(130, 0, 3), (370, 44, 3)], own, [-1100, 0]))
    assert v["p_stage3"] == pytest.approx(0.5)
    assert v["r13"] == pytest.approx(0.5 * v["safety"])


def test_a_collision_scores_zero_safety_but_rule_14_says_nothing_of_it():
    # warned of in the reference: 40 deg to starboard and back to the old track in time to hit
    own = [(20, 0, 5), (20, 40, 5), (20, -40, 5), (400, 0, 5)]
    x = meeting(own, [(500, 180, 5)], [2000, 0])
    x.steps[0] = 1 + np.hypot(*(x.eta[0, :, 0, :2] - x.eta[0, :, 1, :2]).T).argmin()
    x.touched[0] = 1
    _, v, e = one(x)
    assert e["contact"] == 1
    assert v["safety"] == 0.0
    assert v["r14"] > 0.0


# --- properties ------------------------------------------------------------------------------------------------------
def mirrored(x):
    eta = x.eta * np.array([1.0, -1.0, -1.0])
    y = x.rows(slice(None))
    y.eta, y.velocity = eta, x.velocity * np.array([1.0, -1.0])
    return y


tracks = st.tuples(
    st.floats(-60, 60), st.floats(2.5, 9), st.floats(-60, 60), st.floats(20, 150), st.floats(120, 240), st.floats(2.5, 9),
    st.floats(300, 1500), st.floats(-1200, 1200),
)  # fmt: skip


@settings(max_examples=60, deadline=None)
@given(tracks)
def test_mirror_image_swaps_crossing_roles_and_nothing_else(track):
    turn, speed, back, when, course_other, other_speed, north, east = track
    x = meeting([(when, 0, speed), (60, turn, speed), (200, back, speed)], [(600, course_other, other_speed)], [north, east])
    a, b = judge(x, PUBLISHED), judge(mirrored(x), PUBLISHED)
    swap = {Encounter.CROSSING_GIVE_WAY: Encounter.CROSSING_STAND_ON, Encounter.CROSSING_STAND_ON: Encounter.CROSSING_GIVE_WAY}
    assert [swap.get(Encounter(c), Encounter(c)) for c in a.encounters["code"]] == list(b.encounters["code"])
    np.testing.assert_allclose(a.scores["safety"], b.scores["safety"], atol=1e-9)
    # Rule 13 knows no side
    overtaking = np.isin(a.encounters["code"], (Encounter.OVERTAKING, Encounter.OVERTAKEN))
    np.testing.assert_allclose(a.scores["r13"][overtaking], b.scores["r13"][overtaking], atol=1e-9)
    np.testing.assert_allclose(a.parts["p_course"], b.parts["p_course"], atol=1e-9)


def test_monotone():
    r = np.linspace(0, 300, 601)
    bounds = (np.full(601, v) for v in (200.0, 100.0, 50.0, 35.0))
    assert (np.diff(s.range_score(r, *bounds)) >= 0).all()
    x = np.linspace(0, 60, 601)
    assert (np.diff(s.not_apparent(x, 2.0, 30.0)) <= 0).all()
    assert (np.diff(s.deviation(x, 2.0, 30.0)) >= 0).all()
    assert (np.diff(s.no_starboard_turn(x * DEG)) <= 0).all()
    assert (np.diff(s.delay(r + 1, np.full(601, 400.0), np.full(601, 700.0))) <= 0).all()
    angle = np.linspace(0, np.pi, 181)
    assert (np.diff(s.angle_score(angle, np.zeros(181))) >= -1e-12).all()


def test_a_wider_berth_and_a_larger_turn_never_score_worse():
    last = -1.0
    for turn in (5, 10, 15, 20, 25, 30, 35):
        x = meeting([(100, 0, 5), (60, turn, 5), (300, 0, 5)], [(500, 180, 5)], [2500, 0])
        score = one(x)[1]["r14"]
        assert score >= last
        last = score


def test_distances_follow_the_vessels():
    # two boats of 10.5 m: all distances are 0.3 of those of 35 m, so a meeting drawn to that scale scores the same
    def run(scale, length):
        x = meeting([(100, 0, 5), (20, 15, 5), (300, 0, 5)], [(500, 180, 5)], [2500, 0], size=length)
        x.eta[..., :2] *= scale
        x.velocity *= scale
        return judge(x, Params(moving=0.1, acceleration_md=0.05 * scale))

    a, b = run(1.0, 35.0), run(0.3, 10.5)
    assert len(a.encounters) == len(b.encounters) == 1
    for name in a.scores:
        np.testing.assert_allclose(a.scores[name], b.scores[name], atol=1e-6)


def random_rows(n, seed=0):
    rng = np.random.default_rng(seed)
    T, V = 240, 5
    x = Trajectory.empty(n, T, V)
    for b in range(n):
        x.steps[b] = rng.integers(120, T + 1)
        x.t[b] = np.arange(T)
        psi = np.cumsum(rng.normal(0, 0.01, (T, V)), axis=0) + rng.uniform(-np.pi, np.pi, V)
        speed = rng.uniform(3, 9, V)
        x.velocity[b] = speed[:, None] * np.stack([np.cos(psi), np.sin(psi)], -1)
        x.eta[b, ..., :2] = np.cumsum(x.velocity[b], axis=0)
        for j in range(V):  # all are near the same place some time
            x.eta[b, :, j, :2] -= x.eta[b, rng.integers(60, 180), j, :2] + rng.uniform(-60, 60, 2)
        x.eta[b, ..., 2] = psi
        x.active[b, :, : rng.integers(2, V + 1)] = True
        x.length[b], x.beam[b] = rng.uniform(8, 80, V), 3.0
    return x


def test_batched_equals_single():
    x = random_rows(12)
    together = judge(x)
    assert len(together.encounters) > 12
    for b in range(12):
        alone = judge(x.rows(slice(b, b + 1)))
        np.testing.assert_equal(alone.row(0), together.row(b))
        which = together.of_row(b)
        for name, values in together.scores.items():
            np.testing.assert_array_equal(alone.scores[name], values[which])


def test_parameters_say_what_is_wrong():
    with pytest.raises(ConfigError, match=r"params: r3: expected less than r2 = 1900, got 2000"):
        validate(Params, Document("params", {"r3": 2000.0}))
    with pytest.raises(ConfigError, match=r"unknown key; did you mean 'r_pref'"):
        validate(Params, Document("params", {"r_perf": 100.0}))


# --- other sets ------------------------------------------------------------------------------------------------------
def test_set_c_adds_shares():
    # 60 deg to starboard at 100 s of the crossing that begins at 32 s, 268 s before the CPA: early, to starboard, and
    # 290 m are more than the 165 m that are safe: 0.3 + 0.3 + 0.4
    x = meeting([(100, 0, 5), (60, 60, 5), (400, 0, 5)], [(600, 270, 5)], [1500, 1500])
    scores = judge(x, PUBLISHED, set_c).scores
    assert scores["r15"][0] == scores["r16"][0] == pytest.approx(1.0)
    # nothing done, 100 m apart: 0.4 * 100 / 165
    x = meeting([(600, 0, 5)], [(600, 270, 5)], [1500, 1500 + 100 * math.sqrt(2)])
    assert judge(x, PUBLISHED, set_c).scores["r15"][0] == pytest.approx(0.4 * 100 / 165, rel=1e-4)


def test_set_b_of_ships_in_open_waters():
    # 900 m apart: S_r = 1 - 0.4 (1000 - 900) / 200 = 0.8; abeam to port of each other S_theta = 1: S = 0.9
    x = meeting([(600, 0, 5)], [(600, 180, 5)], [4500, -900])
    wide = Params(scaled=False, r2=5000, r_pref=1500, r_min=1000, r_nm=800, r_col=200)
    verdict = judge(x, wide, set_b)
    e = verdict.encounters
    assert e["cpa_range"] == pytest.approx(900.0)
    assert verdict.parts["s_range"][0] == pytest.approx(0.8)
    assert verdict.scores["safety"][0] == pytest.approx(0.9)
    assert ":" not in verdict.why(0)  # their reasons are not put into words
