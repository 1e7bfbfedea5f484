"""The cases of Imazu: as published, all ships in one place at one time, at any scale, and what each is to the own ship."""

from __future__ import annotations

import math

import gymnasium as gym
import numpy as np
import pytest
import yaml

from usv_gym.config import ConfigError
from usv_gym.engine import advance_worlds, reset_worlds
from usv_gym.scenarios.build import build_worlds
from usv_gym.scenarios.families import FAMILIES, imazu
from usv_gym.scenarios.family_schema import imazu_cases
from usv_gym.scenarios.loader import load_scenario
from usv_gym.traffic.replay import NO_TRACKS
from usv_gym.units import KNOT
from usv_gym.world.encounter import Encounter, encounters
from usv_gym.world.land import NO_LAND
from usv_gym.world.lanes import lanes_for
from usv_gym.world.vessel import load_vessel

CASES = imazu_cases()
NM = 1852.0
FULL = ["own_ship.vessel=ship", "family.time=1800.0", "sensors.base=ship"]
SIZES = {"full": FULL, "odin": [], "otter": ["own_ship.vessel=otter"], "odin in 5 min": ["family.time=300.0"]}


def worlds_of(overrides):
    """All cases with their variants, a row each, and time to the meeting [s]."""
    rows = []
    for name in CASES:
        scenario = load_scenario(f"imazu/{name}", overrides=overrides)
        model = load_vessel(scenario.own_ship.vessel)
        w, _ = build_worlds(scenario, capacity=(8, 16))
        FAMILIES["imazu"].sample(w, np.ones(1, np.bool_), np.full(1, 0.5), model, scenario)
        rows.append(w)
    return np.concatenate(rows), scenario.family.meeting_time(model), scenario, model


def own_and_others(worlds):
    """[B, 4] and [B, 7, 4]: N, E [m], vN, vE [m/s]."""
    v = worlds["vessels"]
    state = np.concatenate([v["eta"][..., :2], v["velocity"]], axis=-1)
    return state[:, 0], state[:, 1:]


@pytest.mark.parametrize("size", SIZES)
def test_every_ship_is_at_the_meeting_point_at_the_time(size):
    worlds, time, scenario, _ = worlds_of(SIZES[size])
    worlds["sensors"]["exteroceptive"] = 0
    start = worlds["vessels"]["eta"].copy()
    reset_worlds(worlds, NO_LAND, NO_TRACKS, np.ones(len(worlds), np.bool_))
    advance_worlds(worlds, lanes_for(worlds), NO_LAND, NO_TRACKS, round(time / scenario.simulation.dt), np.zeros((0, 0, 4, 3)))
    v = worlds["vessels"]
    ships = v["active"].astype(bool)
    ships[:, 0] = False
    assert ships.sum() == sum(map(len, CASES.values()))
    late = np.hypot(v["eta"][..., 0], v["eta"][..., 1])[ships] / v["speed"][ships]
    assert late.max() < 1.0  # s; what is left is the roundness of floating point
    assert late.max() < 1e-6 * time
    # straight there
    assert v["distance"][ships] == pytest.approx(np.hypot(start[..., 0], start[..., 1])[ships], rel=1e-9)


def test_the_own_ship_would_be_there_too():
    worlds, time, _, model = worlds_of(FULL)
    own, _ = own_and_others(worlds)
    assert own[:, :2] + time * own[:, 2:] == pytest.approx(np.zeros((len(worlds), 2)), abs=1e-6)
    assert model.cruise_speed == pytest.approx(12 * KNOT, abs=1e-4)
    assert own[:, 0] == pytest.approx(-6 * NM, abs=1.0)


@pytest.mark.parametrize("size", SIZES)
def test_every_ship_is_what_the_file_says(size):
    worlds, *_ = worlds_of(SIZES[size])
    own, others = own_and_others(worlds)
    shape = others.shape[:2]
    codes, d, t = np.zeros(shape, np.int64), np.zeros(shape), np.zeros(shape)
    encounters(own, others, codes, d, t)
    for b, (name, ships) in enumerate(CASES.items()):
        assert [Encounter(code).name.lower() for code in codes[b, : len(ships)]] == [ship["class"] for ship in ships], name


def test_full_scale_is_the_published_table(data):
    published = yaml.safe_load((data.parent / "reference" / "imazu.yaml").read_text())
    table = {**{f"{key:02d}": case for key, case in published["cases"].items()},
             **{key.zfill(3): case for key, case in published["variants"].items()}}  # fmt: skip
    classes = {"head_on": "head_on", "crossing, OS give-way": "crossing_give_way",
               "crossing, OS stand-on": "crossing_stand_on", "overtaking (OS gives way)": "overtaking"}  # fmt: skip
    worlds, *_ = worlds_of(FULL)
    _, others = own_and_others(worlds)
    assert set(table) == set(CASES)
    for b, name in enumerate(CASES):
        for k, ship in enumerate(table[name]["targets"]):
            place = np.array([ship["north_nm"], ship["east_nm"]])
            assert others[b, k, :2] / NM == pytest.approx(place, abs=1e-3), name
            course = math.radians(ship["heading_deg"])
            velocity = ship["speed_kn"] * KNOT * np.array([math.cos(course), math.sin(course)])
            assert others[b, k, 2:] == pytest.approx(velocity, abs=1e-4), name
            if "geometry" in ship:
                assert classes[ship["geometry"]] == CASES[name][k]["class"], name


def test_distances_of_the_task_grow_along():
    small, full = load_scenario("imazu/05"), load_scenario("imazu/05", overrides=FULL)
    assert small.scale == 1.0
    assert full.scale == pytest.approx(6 * NM / 900.0, rel=1e-4)
    env = gym.make("usv_gym/Imazu-v0", case=5, vessel="ship", time=1800.0, overrides=["sensors=ship"]).unwrapped
    assert env.core.config.safe_distance == pytest.approx(50.0 * full.scale)
    given = gym.make("usv_gym/Imazu-v0", case=5, vessel="ship", time=1800.0, safe_distance=500.0).unwrapped
    assert given.core.config.safe_distance == 500.0  # who asks for a distance gets it


def test_a_case_is_drawn_at_every_reset():
    env = gym.make_vec("usv_gym/Imazu-v0", 400, observation="truth")
    env.reset(seed=0)
    core = env.unwrapped.core
    drawn = [imazu.drawn_case(int(seed), core.scenario.family) for seed in core.worlds["seed"]]
    assert set(drawn) == {f"{case:02d}" for case in range(1, 23)}
    counts = [int(active[1:].sum()) for active in core.worlds["vessels"]["active"]]
    assert counts == [len(CASES[name]) for name in drawn]
    one = gym.make("usv_gym/Imazu-v0", case=["12b", 3], heading_jitter_deg=5.0, observation="truth").unwrapped
    headings = []
    for seed in range(30):
        one.reset(seed=seed)
        headings.append(math.degrees(one.world["vessels"]["eta"][0, 2]))
    assert 3.0 < max(np.abs(headings)) <= 5.0


@pytest.mark.parametrize("case", [23, 0, "8d", "five", -1, True, 1.5, []])
def test_there_is_no_such_case(case):
    with pytest.raises(ConfigError, match=r"family\.case"):
        load_scenario({"base": "imazu", "family": {"name": "imazu", "case": case}})
