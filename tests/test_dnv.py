"""DNV traffic situations: the samples, and there and back through the generator's own types."""

from __future__ import annotations

import json
import math
import warnings

import numpy as np
import pytest

from usv_gym.config import ConfigError
from usv_gym.run import plan, run
from usv_gym.scenarios.build import build_worlds
from usv_gym.scenarios.dnv import SituationWarning, situation_of, write_situation
from usv_gym.scenarios.encounters import generate
from usv_gym.scenarios.loader import load_scenario
from usv_gym.units import KNOT
from usv_gym.world.encounter import Encounter, encounters

#: what DNV's titles call them, as the own ship sees it
KINDS = {"HO": "HEAD_ON", "CR-GW": "CROSSING_GIVE_WAY", "CR-SO": "CROSSING_STAND_ON", "OT-GW": "OVERTAKING",
         "OT-SO": "OVERTAKEN"}  # fmt: skip
#: situation 39, ship 1 comes from 13 deg on the bow: crossing with DNV's 5 deg, head-on with the 13 deg of our sectors
OTHERWISE = {("traffic_situation_39", 0): "HEAD_ON"}
STATE = {"initial": {"position": {"lat": 58.0, "lon": 10.0}, "sog": 8.0, "cog": 90.0}, "static": {"id": 1}}


@pytest.fixture(scope="module")
def samples(data):
    return sorted((data / "scenarios" / "dnv_baseline").glob("*.json"))


def judged(scenario):
    """Name of the encounter, dcpa [m] and tcpa [s] of each ship at the start."""
    v = build_worlds(scenario)[0]["vessels"][0]
    state = np.column_stack([v["eta"][:, :2], v["velocity"]])[: 1 + len(scenario.ships)]
    codes, d, t = np.zeros((1, len(state) - 1), np.int64), np.zeros((1, len(state) - 1)), np.zeros((1, len(state) - 1))
    encounters(state[:1], state[None, 1:], codes, d, t)
    return [Encounter(code).name for code in codes[0]], d[0], t[0]


def same(a, b, tolerance=1e-6):
    """Whether two scenarios have the same ships in the same places, sailing the same way."""
    assert list(a.ships) == list(b.ships)
    one, other = (build_worlds(s)[0][0] for s in (a, b))
    for key in ("eta", "velocity", "length", "beam", "speed", "mmsi", "active"):
        np.testing.assert_allclose(one["vessels"][key], other["vessels"][key], atol=tolerance, err_msg=key)
    np.testing.assert_allclose(one["routes"]["waypoint"], other["routes"]["waypoint"], atol=tolerance)
    assert (one["routes"]["count"] == other["routes"]["count"]).all()


def test_all_samples_load_as_what_they_are_called(samples):
    assert len(samples) == 28
    for path in samples:
        scenario = load_scenario(path)
        situation = json.loads(path.read_text())
        names, dcpa, tcpa = judged(scenario)
        called = [KINDS[word] for word in situation["title"].split(", ")]
        assert names == [OTHERWISE.get((path.stem, k), name) for k, name in enumerate(called)], path.stem
        assert dcpa.max() < 50.0  # the generator makes them collide
        assert 600.0 < tcpa.max() < 2000.0
        assert scenario.own_ship.speed == pytest.approx(10 * KNOT)
        assert scenario.own_ship.vessel.length == 122.0
        assert [ship.speed for ship in scenario.ships.values()] == pytest.approx(
            [ship["waypoints"][0]["leg"]["sog"] * KNOT for ship in situation["targetShips"]]
        )


def test_all_samples_run(samples):
    for path in samples:
        episode = run(plan(str(path), policy="waypoints", overrides=["simulation.duration=30"]))
        assert episode.t[-1] == pytest.approx(30.0)
        assert episode.meta["outcome"]["outcome"] == "time_limit"
        assert np.hypot(*episode.nu[-1, 0, :2]) == pytest.approx(10 * KNOT, rel=0.1)


def through_trafficgen(data):
    """JSON data through trafficgen's own types and back."""
    types = pytest.importorskip("trafficgen.types", reason="trafficgen is not installed")
    return json.loads(types.TrafficSituation.model_validate(data).model_dump_json(by_alias=True, exclude_none=True))


def test_samples_go_through_trafficgen_and_back(samples, tmp_path):
    for path in samples:
        scenario = load_scenario(path)
        back = tmp_path / path.name
        back.write_text(json.dumps(through_trafficgen(json.loads(write_situation(scenario)))))
        same(load_scenario(back), scenario)
        # and in the file's own terms: degrees and knots
        published = json.loads(path.read_text())["targetShips"]
        for ours, theirs in zip(situation_of(scenario)["targetShips"], published, strict=True):
            for a, b in zip(ours["waypoints"], theirs["waypoints"], strict=True):
                assert a["position"]["lat"] == pytest.approx(b["position"]["lat"], abs=1e-6)
                assert a["position"]["lon"] == pytest.approx(b["position"]["lon"], abs=1e-6)
                assert a["leg"]["sog"] == pytest.approx(b["leg"]["sog"], abs=1e-6)
            assert ours["initial"]["heading"] == pytest.approx(theirs["initial"]["heading"], abs=0.01)  # its two decimals


def test_our_encounters_go_through_trafficgen_and_back(tmp_path):
    for k, (scenario, asked) in enumerate(generate(10, seed=1, vessel="ship", ships=[1, 3])):
        path = tmp_path / f"{k}.json"
        path.write_text(json.dumps(through_trafficgen(situation_of(scenario))))
        again = load_scenario(path)
        names, dcpa, tcpa = judged(again)
        assert names == [ship.encounter.name for ship in asked]
        assert dcpa == pytest.approx([ship.dcpa for ship in asked], abs=1e-5)
        assert tcpa == pytest.approx([ship.tcpa for ship in asked], abs=1e-5)
        assert json.loads(write_situation(again))["ownShip"]["waypoints"] == [
            {"position": {"lat": pytest.approx(p["position"]["lat"], abs=1e-9),
                          "lon": pytest.approx(p["position"]["lon"], abs=1e-9)}, "leg": {"sog": pytest.approx(p["leg"]["sog"])}}
            for p in situation_of(scenario)["ownShip"]["waypoints"]
        ]  # fmt: skip


def test_what_trafficgen_generates_runs_unchanged(tmp_path):
    generator = pytest.importorskip("trafficgen.ship_traffic_generator", reason="trafficgen is not installed")
    from trafficgen.types import Dimensions, EncounterSettings, ShipStatic, SituationInput
    from trafficgen.write_traffic_situation_to_file import write_traffic_situations_to_json_file

    position = {"lat": 58.763449, "lon": 10.490654}
    initial = {"position": position, "sog": 10.0, "cog": 0.0, "heading": 0.0, "navStatus": "Under way using engine"}
    kinds = {"head-on": "HEAD_ON", "crossing-give-way": "CROSSING_GIVE_WAY", "overtaking-stand-on": "OVERTAKEN"}
    situations = [SituationInput.model_validate({
        "title": kind, "description": kind, "ownShip": {"initial": initial},
        "encounters": [{"desiredEncounterType": kind, "vectorTime": 15.0, **({"beta": 45.0} if "crossing" in kind else {})}],
    }) for kind in kinds]  # fmt: skip
    settings = EncounterSettings.model_validate({
        "classification": {"theta13Criteria": 67.5, "theta14Criteria": 5.0, "theta15Criteria": 5.0, "theta15": [112.5, 247.5]},
        "relativeSpeed": {"overtakingStandOn": [1.5, 2.0], "overtakingGiveWay": [0.25, 0.75], "headOn": [0.5, 1.5],
                          "crossingGiveWay": [0.9, 1.1], "crossingStandOn": [0.5, 1.5]},
        "commonVector": 5.0, "situationLength": 30.0, "maxMeetingDistance": 0.0, "situationDevelopTime": 60.0,
        "disableLandCheck": True,
    })  # fmt: skip
    size = Dimensions(length=100, width=18)
    own, others = ShipStatic(id=1, dimensions=size, sog_max=20), [ShipStatic(id=2, dimensions=size, sog_max=20)]
    write_traffic_situations_to_json_file(generator.generate_traffic_situations(situations, own, others, settings), tmp_path)
    files = sorted(tmp_path.glob("*.json"))
    assert len(files) == len(kinds)
    for path, wanted in zip(files, kinds.values(), strict=True):
        names, _, tcpa = judged(load_scenario(path))
        if json.loads(path.read_text())["targetShips"]:  # its search may fail
            assert names == [wanted]
            assert 600.0 < tcpa[0] < 1400.0
        assert run(plan(str(path), policy="waypoints", overrides=["simulation.duration=5"])).t[-1] == pytest.approx(5.0)


def test_an_initial_state_alone_will_do(tmp_path):
    path = tmp_path / "s.json"
    path.write_text(json.dumps({"ownShip": STATE, "targetShips": [{**STATE, "static": {"id": 2, "name": "a=b.c"}}] * 2}))
    scenario = load_scenario(path)
    assert list(scenario.ships) == ["a_b_c", "a_b_c_2"]
    assert scenario.own_ship.heading_deg == 90.0
    north, east = scenario.local(scenario.own_ship.route[0])
    assert (north, east) == (pytest.approx(0.0, abs=1e-6), pytest.approx(3 * 3600 * 8 * KNOT))


def test_what_the_format_cannot_say_is_named():
    with pytest.warns(SituationWarning, match=r"no place for obstacle berg_west, obstacle berg_east, obstacle growler"):
        situation = situation_of(load_scenario("calm_crossing"))
    assert situation["targetShips"][0]["static"]["name"] == "coaster"
    with pytest.raises(ConfigError, match="a family has no ships of its own"):
        situation_of(load_scenario("encounter"))


def test_distances_are_kept_in_places_far_from_the_origin():
    own_ship = {"position": [9000, -4000], "speed": 5, "route": [[12000, -4000]]}
    ship = {"waypoints": [[9800, -3500], [9000, -9000]], "speed": 4}
    place = {"latitude_deg": 60, "longitude_deg": 5}
    scenario = load_scenario({"origin": place, "own_ship": own_ship, "ships": {"s": ship}})
    situation = situation_of(scenario)
    own, ship = situation["ownShip"]["waypoints"][0]["position"], situation["targetShips"][0]["waypoints"][0]["position"]
    from usv_gym.units import metres_per_degree

    north, east = metres_per_degree(own["lat"])
    assert (ship["lat"] - own["lat"]) * north == pytest.approx(800.0, abs=1e-6)
    assert (ship["lon"] - own["lon"]) * east == pytest.approx(500.0, abs=1e-6)
    assert own["lat"] == pytest.approx(60 + 9000 / metres_per_degree(60)[0])


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("{", r"s.json:1: not valid JSON"),
        ("[]", "expected a traffic situation"),
        ('{"ownShip": {"static": {"id": 1}}}', "ownShip.waypoints: expected waypoints, or an initial position"),
        (json.dumps({"ownShip": {"initial": {"position": {"lat": 99, "lon": 1}, "sog": 1, "cog": 1}}}), "position.lat"),
        (json.dumps({"ownShip": {"waypoints": [{"position": {"lat": 9, "lon": 1}}]}}), "ownShip.initial: expected a speed"),
    ],
)
def test_mistakes_are_said_in_one_line(tmp_path, text, message):
    path = tmp_path / "s.json"
    path.write_text(text)
    with pytest.raises(ConfigError, match=message) as error:
        load_scenario(path)
    assert "\n" not in str(error.value)


def test_a_speed_that_changes_is_named(tmp_path):
    legs = [{"position": {"lat": 58.0 + 0.1 * k, "lon": 10.0}, "leg": {"sog": 8.0 + k}} for k in range(3)]
    path = tmp_path / "s.json"
    path.write_text(json.dumps({"ownShip": STATE, "targetShips": [{"waypoints": legs, "static": {"id": 2, "name": "S"}}]}))
    with pytest.warns(SituationWarning, match="S: sails all legs at the 8 kn of the first"):
        assert load_scenario(path).ships["S"].speed == pytest.approx(8 * KNOT)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert math.isfinite(load_scenario({"name": "plain"}).scale)
