"""Generated encounters: the wanted class and closest point, by geometry and in motion, with traffic that keeps apart."""

from __future__ import annotations

import math
import re
from pathlib import Path

import gymnasium as gym
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from usv_gym.config import ConfigError
from usv_gym.engine import advance_worlds, reset_worlds
from usv_gym.scenarios.build import build_worlds
from usv_gym.scenarios.encounters import draw, generate, template
from usv_gym.scenarios.families.encounter import relative_speed
from usv_gym.scenarios.family_schema import ENCOUNTER_NAMES, SECTORS
from usv_gym.scenarios.freeze import freeze
from usv_gym.scenarios.loader import load_scenario
from usv_gym.traffic.replay import NO_TRACKS
from usv_gym.world.encounter import Encounter, encounters
from usv_gym.world.land import NO_LAND
from usv_gym.world.lanes import lanes_for

NO_ROWS = np.zeros((0, 0, 4, 3))
DOCS = Path(__file__).resolve().parents[1] / "docs" / "scenarios.md"


def drawn(n, seed=0, **family):
    """n records and what was asked of their ships."""
    return draw(template(**family), np.random.default_rng(seed).integers(0, 1 << 63, n, dtype=np.uint64))


def judged(worlds):
    """Codes, dcpa [m] and tcpa [s] of all ships, [B, V - 1], by the classifier, and which there are."""
    v = worlds["vessels"]
    state = np.concatenate([v["eta"][..., :2], v["velocity"]], axis=-1)
    shape = state[:, 1:].shape[:2]
    codes, distances, times = np.zeros(shape, np.int64), np.zeros(shape), np.zeros(shape)
    encounters(np.ascontiguousarray(state[:, 0]), np.ascontiguousarray(state[:, 1:]), codes, distances, times)
    return codes, distances, times, v["active"][:, 1:].astype(bool)


@pytest.mark.parametrize("vessel", ["odin", "otter", "ship"])
@pytest.mark.parametrize("difficulty", [0.0, 0.5, 1.0])
def test_every_ship_is_of_the_wanted_class_and_comes_as_near_as_asked(vessel, difficulty):
    worlds, asked = drawn(500, vessel=vessel, difficulty=difficulty)
    codes, distances, times, there = judged(worlds)
    assert (there == (asked["code"] > 0)).all()
    assert (codes == asked["code"])[there].all()
    assert np.abs(distances - asked["dcpa"])[there].max() < 1e-6
    assert np.abs(times - asked["tcpa"])[there].max() < 1e-6
    v = worlds["vessels"]
    assert v["speed"][:, 1:][there] == pytest.approx((asked["ratio"] * v["nu"][:, :1, 0])[there], rel=1e-9)
    bearing = np.arctan2(v["eta"][:, 1:, 1] - v["eta"][:, :1, 1], v["eta"][:, 1:, 0] - v["eta"][:, :1, 0]) - v["eta"][:, :1, 2]
    assert np.cos(bearing - asked["bearing"])[there].min() > 1.0 - 1e-12
    # all classes turn up, and with difficulty more ships
    assert set(asked["code"][there]) == {code for code in Encounter if code is not Encounter.SAFE}
    assert there.sum(axis=1).max() == 1 + int(3 * difficulty + 0.5)


@pytest.mark.slow
def test_ten_thousand():
    worlds, asked = drawn(10_000, seed=1)
    codes, distances, _, there = judged(worlds)
    assert (codes == asked["code"])[there].all()
    assert (np.abs(distances - asked["dcpa"])[there] <= np.maximum(5.0, 0.02 * asked["dcpa"])[there]).all()


def test_in_motion_it_is_the_same():
    # ships that hold their course: what was asked for happens, and nobody meets anybody else before
    together = ENCOUNTER_NAMES
    scenario = template(vessel="ship", together=together, dcpa=[0.0, 400.0])
    worlds, asked = draw(scenario, np.arange(24, dtype=np.uint64))
    worlds["sensors"]["exteroceptive"] = 0
    reset_worlds(worlds, NO_LAND, NO_TRACKS, np.ones(len(worlds), np.bool_))
    n = 1 + len(together)
    v = worlds["vessels"]
    last = float(asked["tcpa"].max())
    places = [v["eta"][:, :n, :2].copy()]
    for _ in range(math.ceil(last / 0.5) + 2):
        advance_worlds(worlds, lanes_for(worlds), NO_LAND, NO_TRACKS, 5, NO_ROWS)
        places.append(v["eta"][:, :n, :2].copy())
    track = np.array(places)  # [T, B, n, 2], every half second
    for i in range(n):
        for j in range(i + 1, n):
            apart, motion = track[:-1, :, i] - track[:-1, :, j], np.diff(track[:, :, i] - track[:, :, j], axis=0)
            share = np.clip(-(apart * motion).sum(-1) / np.maximum((motion**2).sum(-1), 1e-12), 0.0, 1.0)
            distance = np.hypot(*np.moveaxis(apart + share[..., None] * motion, -1, 0))  # least in each half second
            if i == 0:
                found, when = distance.min(axis=0), 0.5 * distance.argmin(axis=0)
                wanted = asked["dcpa"][:, j - 1]
                assert (np.abs(found - wanted) <= np.maximum(5.0, 0.02 * wanted)).all()
                assert np.abs(found - wanted).max() < 0.1  # and far better than that
                assert np.abs(when - asked["tcpa"][:, j - 1]).max() < 1.0
            else:
                assert (distance.min(axis=0) > 0.5 * (v["length"][:, i] + v["length"][:, j])).all()


@given(
    st.floats(-180.0, 180.0), st.floats(0.3, 2.5), st.sampled_from([-1.0, 1.0]), st.sampled_from([-1.0, 1.0]),
    st.floats(0.0, 200.0), st.floats(30.0, 600.0), st.floats(1.0, 10.0),
)  # fmt: skip
def test_the_relative_speed_solves_its_equation(bearing_deg, ratio, root, side, dcpa, tcpa, speed):
    bearing = math.radians(bearing_deg)
    w = relative_speed(root, bearing, ratio, side, dcpa, tcpa, speed)
    if not w > 0.0:  # no such motion
        return
    a = math.atan2(dcpa, w * tcpa)
    rest = w * w - 2.0 * speed * w * math.cos(bearing - side * a) + (1.0 - ratio**2) * speed**2
    if abs(rest) > 1e-6 * speed**2:  # next to a double root Newton's method is slow: such a draw is thrown away
        return
    # the ship, by its components: R along the bearing, the relative motion a off the line back
    distance = math.hypot(w * tcpa, dcpa)
    place = distance * np.array([math.cos(bearing), math.sin(bearing)])
    back = bearing + math.pi - side * a
    relative = w * np.array([math.cos(back), math.sin(back)])
    assert np.hypot(relative[0] + speed, relative[1]) == pytest.approx(ratio * speed, rel=1e-5)
    assert np.hypot(*(place + tcpa * relative)) == pytest.approx(dcpa, abs=1e-6 * distance)
    assert place @ relative == pytest.approx(-tcpa * w * w, rel=1e-9)


def test_ranges_are_kept():
    wish = {"together": ["crossing_give_way"], "dcpa": [30, 40], "tcpa": [80, 100], "bearing_deg": [40, 60],
            "speed_ratio": [0.9, 1.1]}  # fmt: skip
    _, asked = drawn(200, **wish)
    asked = asked[:, 0]
    for key, low, high in (("dcpa", 30, 40), ("tcpa", 80, 100), ("ratio", 0.9, 1.1)):
        assert asked[key].min() >= low
        assert asked[key].max() <= high
        assert np.ptp(asked[key]) > 0.8 * (high - low)
    assert np.degrees(asked["bearing"]).min() >= 40
    assert np.degrees(asked["bearing"]).max() <= 60


def test_a_draw_belongs_to_its_seed():
    plain = template(difficulty=1.0)
    seeds = np.array([5, 6, 7], np.uint64)
    three, _ = draw(plain, seeds)
    one, _ = draw(plain, seeds[1:2])
    assert one[0].tobytes() == three[1].tobytes()
    assert [s.ships for s, _ in generate(2, seed=3)] == [s.ships for s, _ in generate(5, seed=3)][:2]


# --- scenarios of them -----------------------------------------------------------------------------------------------
@pytest.mark.parametrize("name", ["encounter", "imazu", "open_sea"])
def test_a_frozen_draw_is_the_world_it_was_drawn_as(name):
    env = gym.make("usv_gym/Scenario-v0", scenario=name, difficulty=0.8, observation="truth").unwrapped
    env.reset(seed=4)
    core = env.core
    frozen = freeze(core.scenario, core.worlds[0], core.ids(0))
    again = load_scenario(frozen)  # it validates
    assert again.family is None
    worlds, names = build_worlds(again, capacity=(8, 16))
    assert [n for n in names if n] == [n for n in core.ids(0) if n]
    a, b = worlds[0], core.worlds[0]
    there = b["vessels"]["active"] > 0
    for key in ("kind", "model", "behaviour", "length", "beam", "speed", "turn_time", "turn_rate_max", "mmsi", "ais_class"):
        assert a["vessels"][key][there] == pytest.approx(b["vessels"][key][there], rel=1e-12), key
    turns = (a["vessels"]["eta"] - b["vessels"]["eta"])[there]
    assert np.abs(turns[:, :2]).max() < 1e-9
    assert np.cos(turns[:, 2]).min() > 1 - 1e-12
    assert a["vessels"]["velocity"][there] == pytest.approx(b["vessels"]["velocity"][there], abs=1e-9)
    assert a["obstacles"]["position"] == pytest.approx(b["obstacles"]["position"])
    assert a["obstacles"]["radius"] == pytest.approx(b["obstacles"]["radius"])
    for key in ("wind_speed", "wind_to", "current_speed", "current_to", "wave_height", "wave_to", "on"):
        assert a["weather"][key] == pytest.approx(b["weather"][key], abs=1e-9), key


def test_generated_scenarios_say_what_was_asked():
    for scenario, asked in generate(20, seed=2, ships=[1, 3], vessel="otter"):
        worlds, _ = build_worlds(scenario)
        codes, distances, times, there = judged(worlds)
        assert [Encounter(code) for code in codes[0][there[0]]] == [ship.encounter for ship in asked]
        assert distances[0][there[0]] == pytest.approx([ship.dcpa for ship in asked], abs=1e-6)
        assert times[0][there[0]] == pytest.approx([ship.tcpa for ship in asked], abs=1e-6)


# --- environment and mistakes ----------------------------------------------------------------------------------------
def test_arguments_of_the_environment_choose():
    env = gym.make("usv_gym/Encounter-v0", together=["overtaken", "head_on"], dcpa=0, observation="truth").unwrapped
    for seed in range(5):
        env.reset(seed=seed)
        codes, distances, _, there = judged(env.core.worlds)
        assert [Encounter(code).name for code in codes[there]] == ["OVERTAKEN", "HEAD_ON"]
        assert distances[there].max() < 1e-6


@pytest.mark.parametrize(
    ("family", "message"),
    [
        ({"classes": ["headon"]}, r"family.classes.0: .*did you mean 'head_on'\?"),
        ({"classes": []}, "family.classes: expected at least 1 items"),
        ({"dcpa": [50, 10]}, r"family.dcpa: expected \[least, most\], got \[50, 10\]"),
        ({"dcpa": -1}, "family.dcpa"),
        ({"tcpa": 0}, "family.tcpa"),
        ({"ships": 9}, "family.ships"),
        ({"classes": ["overtaking"], "speed_ratio": [1.2, 2]}, "family.speed_ratio: overtaking needs a ship that is slower"),
        ({"classes": ["head_on"], "bearing_deg": [90, 120]}, "family.bearing_deg: a ship on these bearings is not head_on"),
        ({"clases": ["head_on"]}, r"family.clases: unknown key; did you mean 'classes'\?"),
    ],
)
def test_mistakes_are_said_in_one_line(family, message):
    with pytest.raises(ConfigError, match=message) as error:
        template(**family)
    assert len(str(error.value).splitlines()) <= 2  # a range has two ends


def test_what_cannot_be_had_is_refused():
    # abeam and slower than the own ship: no collision course
    with pytest.raises(ConfigError, match="no crossing_give_way found in 8000 draws"):
        drawn(1, classes=["crossing_give_way"], bearing_deg=[95, 112], speed_ratio=[0.3, 0.5], ships=1)


def test_sectors_are_those_of_the_classifier():
    assert set(SECTORS) == set(ENCOUNTER_NAMES) == {code.name.lower() for code in Encounter} - {"safe"}


def test_the_examples_of_the_page_run(capsys):
    names: dict[str, object] = {}
    for block in re.findall(r"^```python\n(.*?)^```$", DOCS.read_text(encoding="utf-8"), re.MULTILINE | re.DOTALL):
        exec(compile(block, "example", "exec"), names)
    assert "CROSSING_GIVE_WAY" in capsys.readouterr().out
