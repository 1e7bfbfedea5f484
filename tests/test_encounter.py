"""Encounter geometry: CPA against brute force, sectors against hand-drawn situations, mirrors and turns."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from usv_gym.world.encounter import Encounter, encounters

E = Encounter
MIRRORED = {  # to port becomes to starboard
    E.SAFE: E.SAFE, E.HEAD_ON: E.HEAD_ON, E.OVERTAKING: E.OVERTAKING, E.OVERTAKEN: E.OVERTAKEN,
    E.CROSSING_GIVE_WAY: E.CROSSING_STAND_ON, E.CROSSING_STAND_ON: E.CROSSING_GIVE_WAY,
}  # fmt: skip
SEEN_BY_THE_OTHER = {**MIRRORED, E.OVERTAKING: E.OVERTAKEN, E.OVERTAKEN: E.OVERTAKING}


def vessel(north, east, course_deg, speed):
    course = math.radians(course_deg)
    return np.array([north, east, speed * math.cos(course), speed * math.sin(course)])


def judge(own, other):
    codes, distances, times = np.zeros((1, 1), np.int64), np.zeros((1, 1)), np.zeros((1, 1))
    encounters(own[None], other[None, None], codes, distances, times)
    return Encounter(codes[0, 0]), distances[0, 0], times[0, 0]


@pytest.mark.parametrize(
    ("other", "expected"),
    [
        (vessel(2000, 0, 180, 5), E.HEAD_ON),
        (vessel(2000, 100, 178, 5), E.HEAD_ON),
        (vessel(1000, 1000, 270, 5), E.CROSSING_GIVE_WAY),  # from starboard: give way
        (vessel(1000, -1000, 90, 5), E.CROSSING_STAND_ON),  # from port: it gives way
        (vessel(1000, 0, 0, 2), E.OVERTAKING),
        (vessel(-1000, 0, 0, 9), E.OVERTAKEN),
        (vessel(1000, 0, 0, 9), E.SAFE),  # sails away from us
        (vessel(-300, 300, 45, 5), E.SAFE),  # opening
    ],
)
def test_situations_drawn_by_hand(other, expected):
    assert judge(vessel(0, 0, 0, 5), other)[0] == expected


def test_cpa_of_a_perpendicular_crossing():
    # worked by hand: 1000 m ahead and 1000 m to starboard, crossing to port at our own 5 m/s: a collision in 200 s
    _, dcpa, tcpa = judge(vessel(0, 0, 0, 5), vessel(1000, 1000, 270, 5))
    assert dcpa == pytest.approx(0.0, abs=1e-9)
    assert tcpa == pytest.approx(200.0)
    # 50 m further ahead it passes at 50 / sqrt 2 m, 5 s later
    _, dcpa, tcpa = judge(vessel(0, 0, 0, 5), vessel(1050, 1000, 270, 5))
    assert dcpa == pytest.approx(50 / math.sqrt(2))
    assert tcpa == pytest.approx(205.0)


PLACES = st.floats(-2000, 2000)
VESSELS = st.builds(vessel, PLACES, PLACES, st.floats(-180, 180), st.floats(0.5, 12))


@given(VESSELS, VESSELS)
def test_cpa_equals_brute_force(own, other):
    _, dcpa, tcpa = judge(own, other)
    assume(0.0 < tcpa < 2000.0)
    t = np.linspace(max(tcpa - 5.0, 0.0), tcpa + 5.0, 2001)[:, None]
    distance = np.linalg.norm(own[:2] + t * own[2:] - other[:2] - t * other[2:], axis=1)
    assert distance.min() >= dcpa - 1e-6
    assert distance.min() == pytest.approx(dcpa, abs=0.1)


def _edge(own, other):
    """Whether a bearing lies so near the edge of a sector that rounding decides."""
    line = math.atan2(*(other[:2] - own[:2])[::-1])
    courses = [math.atan2(v[3], v[2]) for v in (own, other)]
    angles = [line - courses[0], line + math.pi - courses[1], courses[1] - courses[0]]
    degrees = [abs(math.degrees(math.remainder(a, 2 * math.pi))) for a in angles]
    speeds = abs(math.hypot(*own[2:]) - math.hypot(*other[2:]))
    return speeds < 1e-6 or any(abs(d - edge) < 1e-6 for d in degrees for edge in (10, 13, 45, 112.5, 154))


@given(VESSELS, VESSELS)
def test_the_mirror_swaps_port_and_starboard(own, other):
    assume(not _edge(own, other))
    flip = np.array([1.0, -1.0, 1.0, -1.0])
    assert judge(own * flip, other * flip)[0] == MIRRORED[judge(own, other)[0]]


@given(VESSELS, VESSELS)
def test_the_other_vessel_sees_the_other_role(own, other):
    assume(not _edge(own, other))
    assert judge(other, own)[0] == SEEN_BY_THE_OTHER[judge(own, other)[0]]


@given(VESSELS, VESSELS, st.floats(-math.pi, math.pi), PLACES, PLACES)
def test_turning_and_moving_the_sea_changes_nothing(own, other, angle, north, east):
    assume(not _edge(own, other))
    c, s = math.cos(angle), math.sin(angle)
    turn = np.kron(np.eye(2), np.array([[c, -s], [s, c]]))
    shift = np.array([north, east, 0.0, 0.0])
    before, after = judge(own, other), judge(turn @ own + shift, turn @ other + shift)
    assume(abs(before[2]) > 1e-6)
    assert after[0] == before[0]
    assert after[1] == pytest.approx(before[1], abs=1e-6, rel=1e-6)
