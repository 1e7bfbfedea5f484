"""The native schema: what loads, what is refused and in which words, and what ends up in the world record."""

from __future__ import annotations

import json
import math
import pickle
import re
import subprocess
import sys
import textwrap
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
import yaml
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from usv_gym.config import ConfigError, json_schema, parse_yaml, read_yaml, suggestion, validate
from usv_gym.resources import shipped
from usv_gym.scenarios.build import build_worlds, write_world
from usv_gym.scenarios.loader import SensorRateWarning, load_scenario
from usv_gym.scenarios.schema import Scenario
from usv_gym.scenarios.sensor_schema import Sensors, load_sensors
from usv_gym.units import DEG, DEG_PER_MIN, KNOT
from usv_gym.world import state

BASE = """\
schema: 1
name: test
simulation: {dt: 0.05, control_interval: 1.0}
own_ship:
  vessel: odin
  route: [[100, 0]]
ships:
  research_ship:
    class: ship
    length: 100
    speed_kn: 10
    waypoints: [[0, 500], [0, -500]]
obstacles:
  berg: {kind: iceberg, position: [50, 50], radius: 15}
sensors: thesis
"""


def write(tmp_path: Path, text: str) -> Path:
    path = tmp_path / "case.yaml"
    path.write_text(text, encoding="utf-8")
    return path


# --- errors: one line with file, key, and what was expected ---------------------------------------------------------
BAD = {
    "misspelt key": ("    length: 100", "    lenght: 100", "ships.research_ship.lenght", "did you mean 'length'?"),
    "unknown key": ("obstacles:", "colour: red\nobstacles:", ": colour: unknown key", "expected one of: schema, name"),
    "wrong type": ("speed_kn: 10", "speed_kn: fast", "ships.research_ship.speed_kn", "expected a number, got 'fast'"),
    "number as text": ("speed_kn: 10", "speed_kn: '10'", "ships.research_ship.speed_kn", "expected a number, got '10'"),
    "decimal comma": ("length: 100", "length: 100,5", "ships.research_ship.length", "expected a number, got '100,5'"),
    "not a number": ("radius: 15", "radius: .nan", "obstacles.berg.radius", "expected a"),
    "negative radius": (
        "radius: 15",
        "radius: -15",
        "obstacles.berg.radius",
        "expected a number greater than 0, got -15",
    ),
    "wrong class": ("class: ship", "class: shp", "ships.research_ship.class", "did you mean 'ship'?"),
    "latitude of 95": (
        "[50, 50]",
        "{latitude_deg: 95, longitude_deg: 10}",
        "obstacles.berg.position.latitude_deg",
        "at most 90, got 95",
    ),
    "longitude forgotten": (
        "[50, 50]",
        "{latitude_deg: 59}",
        "obstacles.berg.position.longitude_deg",
        "required key is missing",
    ),
    "three coordinates": ("[50, 50]", "[50, 50, 0]", "obstacles.berg.position", "expected [north, east] in metres"),
    "one waypoint": (
        "[[0, 500], [0, -500]]",
        "[[0, 500]]",
        "ships.research_ship.waypoints",
        "at least two waypoints, got 1",
    ),
    "same waypoint": ("[0, -500]]", "[0, 500]]", "ships.research_ship.waypoints", "the same place"),
    "both speeds": ("speed_kn: 10", "speed_kn: 10\n    speed: 5", "ships.research_ship.speed_kn", "not both"),
    "control interval": (
        "control_interval: 1.0",
        "control_interval: 0.12",
        "simulation.control_interval",
        "whole number of ticks of 0.05 s",
    ),
    "tick too fine": ("dt: 0.05", "dt: 1.5e-6", "simulation.dt", "whole number of microseconds"),
    "unknown vessel": (
        "vessel: odin",
        "vessel: odinn",
        "own_ship.vessel",
        "unknown vessel 'odinn'; did you mean 'odin'?",
    ),
    "missing vessel file": (
        "vessel: odin",
        "vessel: my.yaml",
        "own_ship.vessel",
        "vessel file 'my.yaml': no such file",
    ),
    "unknown sensor set": (
        "sensors: thesis",
        "sensors: thesiss",
        "sensors",
        "unknown sensor set 'thesiss'; did you mean 'thesis'?",
    ),
    "radar too far": (
        "sensors: thesis",
        "sensors: {base: thesis, radar: {range: 5000}}",
        "sensors.radar.range",
        "needs rpm 24 or 36",
    ),
    "radar speed": (
        "sensors: thesis",
        "sensors: {radar: {rpm: 30}}",
        "sensors.radar.rpm",
        "expected 24, 36 or 48, got 30",
    ),
    "std and variance": (
        "sensors: thesis",
        "sensors: {radar: {radius: {std: 1, variance: 1}}}",
        "sensors.radar.radius.variance",
        "not both",
    ),
    "bias without time": (
        "sensors: thesis",
        "sensors: {radar: {radius: {bias_std: 1}}}",
        "sensors.radar.radius.bias_time",
        "time constant",
    ),
    "AIS interval": (
        "sensors: thesis",
        "sensors: {ais: {interval: fast}}",
        "sensors.ais.interval",
        "or 'itu', got 'fast'",
    ),
    "duplicate key": (
        "    length: 100",
        "    length: 100\n    length: 90",
        "ships.research_ship.length",
        "duplicate key, first on line 10",
    ),
    "null group": (
        "  research_ship:",
        "  ghost:\n  research_ship:",
        "ships.ghost",
        "expected a mapping of keys, got nothing",
    ),
    "same MMSI": (
        "radius: 15}",
        "radius: 15, ais: true, mmsi: 992570001}\n  buoy: {kind: buoy, position: [9, 9], radius: 1, mmsi: 992570001}",
        "obstacles.buoy.mmsi",
        "obstacles.berg already",
    ),
    "bad MMSI": ("    length: 100", "    mmsi: 12", "ships.research_ship.mmsi", "at least 201000000"),
    "same name": ("  berg:", "  research_ship:", "obstacles.research_ship", "a ship has this name already"),
    "drift": (
        "radius: 15",
        "radius: 15, drift: fast",
        "obstacles.berg.drift",
        "expected 'none', 'current' or [north, east]",
    ),
    "flag": ("vessel: odin", "vessel: odin\n  memory: 1.5", "own_ship.memory", "expected true or false, got 1.5"),
    "memory of a vessel without": (
        "vessel: odin",
        "vessel: jolner\n  memory: true",
        "own_ship.memory",
        "no fluid_memory",
    ),
    "schema of the future": ("schema: 1", "schema: 2", "schema", "expected 1, got 2"),
    "name with a dot": ("  berg:", "  b.erg:", "obstacles.b.erg", "expected a name without '.'"),
}


@pytest.mark.parametrize("case", BAD)
def test_a_mistake_gives_one_line_with_file_key_and_expectation(tmp_path: Path, case: str) -> None:
    good, bad, key, expected = BAD[case]
    assert good in BASE
    path = write(tmp_path, BASE.replace(good, bad, 1))
    with pytest.raises(ConfigError) as caught:
        load_scenario(path)
    message = str(caught.value)
    assert len(message.splitlines()) == 1, message
    assert message.startswith(str(path))
    assert key in message
    assert expected in message


def test_errors_carry_the_line_of_the_key(tmp_path: Path) -> None:
    path = write(tmp_path, BASE.replace("length: 100", "length: -100"))
    with pytest.raises(ConfigError, match=r"case\.yaml:10: ships\.research_ship\.length: expected a number greater"):
        load_scenario(path)


def test_every_mistake_has_its_line(tmp_path: Path) -> None:
    text = BASE.replace("length: 100", "length: -100").replace("radius: 15", "radius: big").replace("odin", "odinn")
    with pytest.raises(ConfigError) as caught:
        load_scenario(write(tmp_path, text))
    lines = str(caught.value).splitlines()
    assert [line.split(": ")[1] for line in lines] == [
        "own_ship.vessel",
        "ships.research_ship.length",
        "obstacles.berg.radius",
    ]


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("", "is empty"),
        ("# only a comment\n", "is empty"),
        ("- a\n- b\n", "expected a mapping of keys, got ['a', 'b']"),
        ("a: [1, 2", "not valid YAML"),
        ("a: 1\n b: 2\n", "not valid YAML"),
        ("a: &x [*x]", "an alias that contains itself"),
        ("[1, 2]: 3", "expected a plain key"),
        ("a: !!python/object:os.system {}", "not valid YAML"),
        ("a: 1\n---\nb: 2\n", "not valid YAML"),
    ],
)
def test_broken_files(tmp_path: Path, text: str, expected: str) -> None:
    path = write(tmp_path, text)
    with pytest.raises(ConfigError) as caught:
        load_scenario(path)
    assert str(caught.value).startswith(str(path))
    assert expected in str(caught.value)
    assert "\n" not in str(caught.value)


def test_missing_and_unreadable_files(tmp_path: Path) -> None:
    path = write(tmp_path, BASE)
    with pytest.raises(ConfigError, match=r"no such file; did you mean .*case\.yaml"):
        load_scenario(path.with_name("cas.yaml"))
    path.write_bytes(b"name: \xff\xfe")
    with pytest.raises(ConfigError, match="expected UTF-8 text"):
        load_scenario(path)
    with pytest.raises(ConfigError, match="unknown scenario 'busy_open_see'; did you mean 'busy_open_sea'"):
        load_scenario("busy_open_see")
    with pytest.raises(ConfigError, match="empty list"):
        load_scenario([])


def test_config_errors_can_be_pickled() -> None:
    error = pickle.loads(pickle.dumps(ConfigError("a: b")))
    assert isinstance(error, ConfigError)
    assert isinstance(error, ValueError)
    assert str(error) == "a: b"


def test_suggestions() -> None:
    assert suggestion("Lenght", ["length", "beam"]) == "; did you mean 'length'?"
    assert suggestion("zzz", ["length", "beam"]) == "; expected one of: length, beam"
    assert suggestion("zzz", []) == ""


# --- YAML -------------------------------------------------------------------------------------------------------------
def test_scalars_are_those_of_yaml_1_2() -> None:
    data = parse_yaml(
        "{a: off, b: 1e-6, c: 12:30, d: 010, e: 2017-06-01, f: true, g: ~, h: .5, i: -3, j: yes}", "t"
    ).data
    assert data == {
        "a": "off", "b": 1e-6, "c": "12:30", "d": 10.0, "e": "2017-06-01", "f": True, "g": None, "h": 0.5, "i": -3,
        "j": "yes",
    }  # fmt: skip


def test_anchors_and_merge_keys_work() -> None:
    data = parse_yaml("a: &x {p: 1, q: 2}\nb: {<<: *x, q: 3}", "t").data
    assert data["b"] == {"p": 1, "q": 3}


# --- overrides --------------------------------------------------------------------------------------------------------
def test_overrides(tmp_path: Path) -> None:
    scenario = load_scenario(
        write(tmp_path, BASE),
        overrides=[
            "weather.wind.speed=7.5",  # a group that the file does not have
            "ships.research_ship.waypoints.0=[10, 400]",
            "sensors.radar.range=900",  # into a set that is given by name
            "sensors.ais.position.std=3",  # replaces the variance of the set
            "own_ship.ais=off",
            "name=a=b",
        ],
        vessel="otter",
        preset="original",
    )
    assert scenario.weather.wind.speed == 7.5
    assert scenario.ships["research_ship"].waypoints[0] == (10.0, 400.0)
    assert scenario.sensors.radar.range == 900.0
    assert scenario.sensors.radar.position == load_sensors("thesis").radar.position
    assert scenario.sensors.ais.position.noise == 3.0
    assert scenario.sensors.ais.position.bias == pytest.approx(math.sqrt(5.0))
    assert (scenario.own_ship.ais, scenario.own_ship.vessel, scenario.preset) == ("off", "otter", "original")
    assert scenario.name == "a=b"
    assert load_scenario(scenario, overrides=["name=again"]).name == "again"


@pytest.mark.parametrize(
    ("override", "expected"),
    [
        ("ships.research_ship.lenght=3", "ships.research_ship.lenght: unknown key; did you mean 'length'?"),
        ("ships.research_ship.length=big", "ships.research_ship.length: expected a number, got 'big'"),
        ("ships.research_ship.waypoints.5=[0, 0]", "ships.research_ship.waypoints is a list of 2: no item '5'"),
        ("name.x=1", "name is 'test': it has no key 'x'"),
        ("name", "expected key.path=value"),
        ("a..b=1", "expected key.path=value"),
        ("name=[1", "not valid YAML"),
    ],
)
def test_bad_overrides_name_themselves(tmp_path: Path, override: str, expected: str) -> None:
    with pytest.raises(ConfigError) as caught:
        load_scenario(write(tmp_path, BASE), overrides=[override])
    message = str(caught.value)
    assert message.startswith(f"override {override!r}")
    assert expected in message
    assert "\n" not in message


def test_overrides_are_a_list(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="expected a list"):
        load_scenario(write(tmp_path, BASE), overrides="name=x")
    with pytest.raises(ConfigError, match=r"argument vessel='odinn': own_ship.vessel: unknown vessel"):
        load_scenario(write(tmp_path, BASE), vessel="odinn")


# --- what ships -------------------------------------------------------------------------------------------------------
@pytest.mark.parametrize("name", shipped("scenarios"))
def test_shipped_scenarios_load_round_trip_and_build(name: str, tmp_path: Path) -> None:
    scenario = load_scenario(name)
    assert scenario.name == name.replace("/", "_")
    assert scenario.description
    assert scenario.own_ship.route or scenario.family  # a family draws the route
    assert load_scenario(write(tmp_path, scenario.to_yaml())) == scenario
    worlds, names = build_worlds(scenario, 2)
    assert worlds.shape == (2,)
    assert worlds[0].tobytes() == worlds[1].tobytes()
    assert len(names) == worlds["ais"]["stamp_us"].shape[1]


@pytest.mark.parametrize("name", shipped("sensors"))
def test_shipped_sensor_sets_load_and_round_trip(name: str, tmp_path: Path) -> None:
    sensors = load_sensors(name)
    assert validate(Sensors, read_yaml(write(tmp_path, sensors.to_yaml()))) == sensors


def test_the_route_of_the_busy_open_sea_keeps_clear_of_icebergs() -> None:
    worlds, _ = build_worlds(load_scenario("busy_open_sea"))
    w = worlds[0]
    route = w["routes"]["waypoint"][0, : w["routes"]["count"][0]]
    for i in range(14):
        p = w["obstacles"]["position"][i]
        for a, b in pairwise(route):
            t = np.clip((p - a) @ (b - a) / ((b - a) @ (b - a)), 0.0, 1.0)
            assert np.hypot(*(a + t * (b - a) - p)) - w["obstacles"]["radius"][i] > 30.0


def test_json_schema_describes_what_ships() -> None:
    schema = json_schema(Scenario)
    json.dumps(schema)
    assert schema["additionalProperties"] is False
    assert {"schema", "own_ship", "ships", "sensors"} <= set(schema["properties"])
    assert "base" in schema["$defs"]["SensorsInput"]["properties"]
    assert {"waypoints", "track"} <= set(schema["$defs"]["Ship"]["properties"])
    jsonschema = pytest.importorskip("jsonschema")
    for path in shipped("scenarios").values():
        jsonschema.validate(read_yaml(path).data, schema)
    for path in shipped("sensors").values():
        jsonschema.validate(read_yaml(path).data, json_schema(Sensors))


def test_reading_configuration_needs_no_compiler() -> None:
    code = """
        import sys, types
        package = types.ModuleType("usv_gym"); package.__path__ = ["usv_gym"]; sys.modules["usv_gym"] = package
        import usv_gym.config, usv_gym.scenarios.loader
        assert not {"numba", "gymnasium"} & set(sys.modules), "slow import"
    """
    subprocess.run([sys.executable, "-c", textwrap.dedent(code)], check=True, cwd=Path(__file__).parent.parent)


# --- defaults and derived values --------------------------------------------------------------------------------------
def ship(**keys: object):
    return load_scenario({"ships": {"s": {"waypoints": [[0, 0], [100, 0]], **keys}}}).ships["s"]


def test_ship_classes_fill_what_is_not_given() -> None:
    big, middle, small = ship(**{"class": "ship"}), ship(), ship(**{"class": "boat"})
    assert big.length > middle.length > small.length
    assert big.turn_time > middle.turn_time > small.turn_time
    assert big.turn_rate("standard") < middle.turn_rate("standard") < small.turn_rate("standard")
    assert (big.ais_class, middle.ais_class, small.ais_class) == ("A", "A", "B")
    assert [ship(length=n).class_ for n in (51, 50, 16, 15)] == ["ship", "vessel", "vessel", "boat"]
    assert big.beam == big.length / 6.0
    assert ship(beam=9).beam == 9.0
    assert ship(speed_kn=10).set_speed == pytest.approx(10 * KNOT)
    assert ship(speed=3).set_speed == 3.0
    assert ship(speed=0).set_speed == 0.0
    assert ship(**{"class": "boat"}).set_speed == pytest.approx(12 * KNOT)
    assert ship(ais="off").ais_class == ship(ais=False).ais_class == "off"


def test_turning_follows_the_preset_unless_given() -> None:
    assert not ship().turns_constantly("standard")
    assert ship().turns_constantly("original")
    assert ship().turn_rate("original") == 5.0
    assert ship(turn="lowpass").turn_rate("original") == 3.0
    assert ship(turn="constant", max_turn_rate_deg=2).turn_rate("standard") == 2.0


def test_mmsis_are_valid_and_unique() -> None:
    lane = [[0, 0], [100, 0]]
    scenario = load_scenario(
        {
            "ships": {"a": {"waypoints": lane}, "b": {"waypoints": lane, "mmsi": 257000002}, "c": {"waypoints": lane}},
            "obstacles": {"x": {"position": [0, 9], "radius": 1}, "y": {"position": [0, 9], "radius": 1}},
        }
    )
    assert scenario.mmsis() == {
        "own_ship": 257000001, "a": 257000003, "b": 257000002, "c": 257000004, "x": 992570001, "y": 992570002
    }  # fmt: skip


def test_one_warning_for_sensors_faster_than_the_tick() -> None:
    load_scenario({})  # what the thesis itself asks for passes silently (warnings are errors here)
    with pytest.warns(SensorRateWarning, match=r"tick of 0.05 s.*: navigation.gnss \(50 Hz\)$") as caught:
        load_scenario({}, overrides=["sensors.navigation.gnss.rate=50"])
    assert len(caught) == 1
    with pytest.warns(SensorRateWarning, match=r"0.2 s.*navigation.gnss \(20 Hz\).*lidar \(10 Hz\)"):
        load_scenario({}, overrides=["simulation={dt: 0.2, traffic_interval: 0.2}"])


def test_sensor_sets_may_be_files_next_to_the_scenario(tmp_path: Path) -> None:
    (tmp_path / "mine.yaml").write_text("radar: {range: 700}\n")
    assert load_scenario(write(tmp_path, BASE.replace("thesis", "mine.yaml"))).sensors.radar.range == 700.0
    (tmp_path / "mine.yaml").write_text("radar: {rang: 700}\n")
    with pytest.raises(ConfigError) as caught:
        load_scenario(write(tmp_path, BASE.replace("thesis", "mine.yaml")))
    assert "case.yaml:15: sensors" in str(caught.value)
    assert "mine.yaml:1: radar.rang: unknown key; did you mean 'range'?" in str(caught.value)


def test_vessel_files_next_to_the_scenario_survive_a_dump(tmp_path: Path) -> None:
    (tmp_path / "tug.yaml").write_bytes(shipped("vessels")["odin"].read_bytes())
    scenario = load_scenario(write(tmp_path, BASE.replace("vessel: odin", "vessel: tug.yaml")))
    assert load_scenario(scenario.dump()) == scenario


# --- the record -------------------------------------------------------------------------------------------------------
def test_everything_reaches_the_record(tmp_path: Path) -> None:
    text = BASE.replace(
        "sensors: thesis",
        "  mark: {kind: lighthouse, position: {latitude_deg: 59.45, longitude_deg: 10.5}, radius: 4, ais: true}\n"
        "  floe: {position: [9, 9], radius: 3, drift: [0.1, -0.2]}\n"
        "  loose: {position: [9, 9], radius: 3, drift: current}\n"
        "weather:\n  wind: {speed: 10, from_deg: 90}\n  current: {speed: 0.5, to_deg: 90}\n"
        "  waves: {height: 2, from_deg: 270}\n"
        "sensors: thesis",
    ).replace("vessel: odin", "vessel: odin\n  heading_deg: 90\n  speed: 2")
    scenario = load_scenario(write(tmp_path, text))
    worlds, names = build_worlds(scenario)
    V, M = state.CAPACITIES[0]
    assert names == ["own_ship", "research_ship", *[""] * (V - 2), "berg", "mark", "floe", "loose", *[""] * (M - 4)]
    w = worlds[0]
    assert (w["dt_us"], w["dt"], w["frame_ticks"]) == (50_000, 0.05, 2)
    assert w["epoch_us"] == 1_496_318_400_000_000
    weather = w["weather"]
    assert weather["wind_to"] == pytest.approx(1.5 * math.pi)
    assert weather["current_to"] == pytest.approx(0.5 * math.pi)
    assert weather["wave_to"] == pytest.approx(0.5 * math.pi)
    v = w["vessels"]
    assert v["active"].tolist() == [1, 1] + [0] * (V - 2)
    assert v["plant"][:2].tolist() == [0, -1]
    np.testing.assert_allclose(v["eta"][0], [0, 0, math.pi / 2])
    np.testing.assert_allclose(v["velocity"][0], [0, 2], atol=1e-15)
    np.testing.assert_allclose(v["eta"][1], [0, 500, -math.pi / 2])  # at its first waypoint, heading for the second
    np.testing.assert_allclose(v["velocity"][1], [0, -10 * KNOT], atol=1e-12)
    np.testing.assert_array_equal(v["frame_eta"], v["eta"])
    assert v["turn_decay"][1] == pytest.approx(1 - math.exp(-0.1 / 10))
    assert v["ais_class"][:2].tolist() == [state.AIS_CLASS_A, state.AIS_CLASS_A]
    r = w["routes"]
    assert r["count"][:3].tolist() == [2, 2, 0]
    assert r["leg"][:2].tolist() == [1, 1]
    np.testing.assert_array_equal(r["waypoint"][0, :2], [[0, 0], [100, 0]])
    m = w["obstacles"]
    assert m["kind"][:2].tolist() == [state.KIND_ICEBERG, state.KIND_LIGHTHOUSE]
    north, east = w["metres_per_degree"]
    np.testing.assert_allclose(
        m["position"][1], [(59.45 - w["origin"][0]) * north, (10.5 - w["origin"][1]) * east], rtol=1e-9
    )
    assert m["ais_on"][:2].tolist() == [0, 1]
    assert m["mmsi"][1] == 992570002
    assert m["velocity"][2].tolist() == [0.1, -0.2]
    assert m["drifts"][2:4].tolist() == [0, 1]
    np.testing.assert_array_equal(m["frame_position"], m["position"])
    assert np.isposinf(w["safety"]["closest"]).all()
    assert w["safety"]["collided_with"].tolist() == [-1]
    assert (w["ais"]["due_tick"] == -1).all()


def test_thesis_noise_in_the_record() -> None:
    """Totals of the design: position 10 m2 per axis, COG 3.5 deg2, SOG 1 kn2, ROT 4500 (deg/min)2."""
    worlds, _ = build_worlds(load_scenario({}))
    p = worlds[0]["sensors"]
    total = (p["ais_noise"] ** 2 + p["ais_bias"] ** 2) / np.array([1, 1, DEG, DEG, KNOT, DEG_PER_MIN]) ** 2
    np.testing.assert_allclose(total, [10, 10, 3.5, 3.5, 1, 4500])
    assert p["ais_interval_us"] == 2_000_000
    assert (p["radar"]["period_us"], p["radar"]["timeout_us"]) == (1_250_000, 3_125_000)
    assert (p["lidar"]["period_us"], p["tdm_period_us"], p["mru_period_us"]) == (100_000, 1_000_000, 10_000)
    np.testing.assert_allclose(p["radar"]["noise"] ** 2, [10, 20])
    np.testing.assert_allclose(p["radar"]["bias"] ** 2, [2.5, 7.5])
    np.testing.assert_allclose(p["lidar"]["bias"] ** 2, [0.005, 0.05])
    realistic, _ = build_worlds(load_scenario({"sensors": "realistic"}))
    assert realistic[0]["sensors"]["ais_interval_us"] == 0


def test_a_row_is_written_completely_and_alone() -> None:
    first, second = load_scenario("busy_open_sea"), load_scenario("calm_crossing")
    worlds, _ = build_worlds(first, 3, capacity=(8, 16))
    fresh, _ = build_worlds(second, 1, capacity=(8, 16))
    before = [worlds[b : b + 1].tobytes() for b in (0, 2)]  # a copy of a record does not keep its padding
    write_world(second, worlds, 1, 0)
    assert [worlds[b : b + 1].tobytes() for b in (0, 2)] == before
    assert worlds[1:2].tobytes() == fresh.tobytes()
    write_world(second, worlds, 1, 2**64 - 1)
    assert worlds["seed"][1] == 2**64 - 1


def test_observers_and_capacity() -> None:
    scenario = load_scenario("busy_open_sea")
    worlds, _ = build_worlds(scenario, observers=[0, 2], capacity=(20, 40))
    assert worlds["observer"].tolist() == [[0, 2]]
    assert worlds["nav"]["leg"].tolist() == [[1, 1]]
    with pytest.raises(ConfigError, match="3 vessels and 14 obstacles do not fit into 2 and 4 slots"):
        build_worlds(scenario, capacity=(2, 4))
    many = {f"b{i}": {"position": [i, 0], "radius": 1} for i in range(300)}
    with pytest.raises(ConfigError, match="at most"):
        build_worlds(load_scenario({"obstacles": many}))


# --- round trip -------------------------------------------------------------------------------------------------------
number = st.integers(-(10**7), 10**7).map(lambda v: v / 128)
positive = st.floats(1e-3, 1e3)
# decimals, so that two places that differ on paper differ on the globe too
degrees = st.integers(-89_000, 89_000).map(lambda v: v / 1000)
place = st.one_of(
    st.tuples(number, number).map(list),
    st.fixed_dictionaries({"latitude_deg": degrees, "longitude_deg": degrees}),
)
name = st.text(st.characters(exclude_categories=("C", "Z"), exclude_characters=".="), min_size=1, max_size=12)
speed = st.one_of(
    st.just({}), positive.map(lambda v: {"speed": v}), st.floats(0, 40).map(lambda v: {"speed_kn": v})
)  # fmt: skip
ships = st.builds(
    lambda fixed, optional, speed: {**fixed, **optional, **speed},
    st.fixed_dictionaries({"waypoints": st.lists(place, min_size=2, max_size=5, unique_by=str)}),
    st.fixed_dictionaries({}, optional={
        "class": st.sampled_from(["ship", "vessel", "boat"]), "length": positive, "beam": positive,
        "after_last": st.sampled_from(["stop", "continue", "loop"]),
        "turn_time": positive, "max_turn_rate_deg": positive,
        "turn": st.sampled_from(["lowpass", "constant"]), "ais": st.sampled_from(["A", "B", "off", "auto"]),
    }),
    speed,
)  # fmt: skip
obstacles = st.fixed_dictionaries(
    {"position": place, "radius": positive},
    optional={
        "kind": st.sampled_from(["iceberg", "buoy", "islet", "lighthouse", "platform"]), "ais": st.booleans(),
        "drift": st.one_of(st.sampled_from(["none", "current"]), st.tuples(number, number).map(list)),
    },
)  # fmt: skip
scenarios = st.fixed_dictionaries(
    {},
    optional={
        "name": st.text(max_size=20), "description": st.text(max_size=40),
        "preset": st.sampled_from(["standard", "original"]),
        "origin": st.fixed_dictionaries({"latitude_deg": st.floats(-85, 85), "longitude_deg": st.floats(-180, 180)}),
        "simulation": st.integers(1, 2_000).flatmap(lambda ms: st.just(
            {"dt": ms / 1000, "traffic_interval": 2 * ms / 1000, "control_interval": 7 * ms / 1000})),
        "weather": st.fixed_dictionaries({"wind": st.fixed_dictionaries({"speed": positive, "gusts": st.booleans()})}),
        "own_ship": st.fixed_dictionaries({"position": place, "route": st.lists(place, max_size=4), "speed": number}),
        "ships": st.dictionaries(name, ships, max_size=3),
        "sensors": st.sampled_from(["thesis", "perfect", "realistic", {"base": "thesis", "ais": {"loss": 0.5}}, {}]),
    },
)  # fmt: skip


@pytest.mark.filterwarnings("ignore::usv_gym.scenarios.loader.SensorRateWarning")
@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(scenarios, st.dictionaries(name, obstacles, max_size=3))
def test_round_trip_through_yaml(data: dict, discs: dict) -> None:
    data = {**data, "obstacles": {f"disc {key}": value for key, value in discs.items()}}
    data["ships"] = {f"ship {key}": value for key, value in data.get("ships", {}).items()}
    if data.get("simulation", {}).get("dt", 0) > 1:
        data["simulation"] = {}
    scenario = load_scenario(data)
    again = validate(Scenario, parse_yaml(scenario.to_yaml(), "round trip"))
    assert again == scenario
    assert yaml.safe_load(json.dumps(scenario.dump())) is not None


def test_every_key_is_documented() -> None:
    text = (Path(__file__).parent.parent / "docs" / "configuration.md").read_text(encoding="utf-8")
    text = re.sub(r"^```.*?^```", "", text, flags=re.M | re.S)
    words = set(re.findall(r"\w+", " ".join(re.findall(r"`([^`]+)`", text))))
    for definition in [json_schema(Scenario), *json_schema(Scenario)["$defs"].values()]:
        missing = set(definition.get("properties", {})) - words
        assert not missing, definition["title"]
