"""The thesis's own three files: recognised by their keys, read as its text means them, refused in one line."""

from __future__ import annotations

from itertools import permutations
from pathlib import Path

import pytest

from usv_gym.config import ConfigError
from usv_gym.scenarios.loader import SensorRateWarning, load_scenario
from usv_gym.scenarios.schema import GeoPoint

DYNAMICS = """\
wind_speed: 10
wind_direction: 90
current_speed: 0.5
current_direction: 270
wave_height: 2
wave_direction: 90
dt: 0.05
gps_frequency: 20
mru_frequency: 20
imu_frequency: 20
speed_sensor_frequency: 20
wind_sensor_frequency: 20
start_latitude: 59.4377744115633
start_longitude: 10.4716511800410
"""
OBSTACLES = """\
fixed_obstacles: {
  "obstacle_1": "RADIUS=30 COORD=10,4613435/59,444234",
  "obstacle_2": "RADIUS=25.5 COORD=10.4515451/59.434341" }

ships: {
  "ship_1": "LENGTH=60 SpeedInKnots=19 WP=10,46715/59,44006 WP=10,46146/59,43564",
  "ship_2": "LENGTH=20 SpeedInKnots=21 WP=10,46146/59,43564 WP=10,46715/59,44006" }
"""
_ERRORS = {
    "AIS": (("position", "m2", 5, 0.5, 20), ("COG", "deg2", 1, 0.5, 10), ("track", "deg2", 1, 0.5, 10),
            ("ROT", "deg2_pr_min2", 2000, 500, 10), ("SOG", "knots2", 0.5, 0.1, 10)),
    "radar": (("position", "m2", 10, 0.5, 10), ("radius", "m2", 20, 3, 5)),
    "lidar": (("position", "m2", 0.1, 0.1, 0.1), ("radius", "m2", 0.1, 0.1, 1)),
}  # fmt: skip
SENSORS = "AIS_range_m: 10000\nradar_range_m: 1852\nlidar_range_m: 100\n"
SENSORS += "TDM_update_rate_Hz: 1\nerror_pr_distance_gain: 0.01\n"
SENSORS += "".join(
    f"{sensor}_{what}_measure_variance_{unit}: {noise}\n{sensor}_{what}_bias_variance_{unit}: {bias}\n"
    f"{sensor}_{what}_bias_time_constant_sec: {time}\n"
    for sensor, rows in _ERRORS.items()
    for what, unit, noise, bias, time in rows
)
FILES = {"a.yaml": DYNAMICS, "b.yaml": OBSTACLES, "c.yaml": SENSORS}
ORIGINAL = Path(__file__).parent.parent.parent / "shared" / "data" / "original"


def write(tmp_path: Path, **changed: str) -> list[Path]:
    paths = []
    for name, text in FILES.items():
        path = tmp_path / name
        path.write_text(changed.get(path.stem, text), encoding="utf-8")
        paths.append(path)
    return paths


def test_three_files_in_any_order_and_as_a_directory(tmp_path: Path) -> None:
    paths = write(tmp_path)
    scenario = load_scenario(tmp_path)
    for order in permutations(paths):
        assert load_scenario(order) == scenario
    assert list(scenario.obstacles) == ["obstacle_1", "obstacle_2"]
    assert scenario.obstacles["obstacle_1"].position == GeoPoint(latitude_deg=59.444234, longitude_deg=10.4613435)
    assert scenario.obstacles["obstacle_2"].position == GeoPoint(latitude_deg=59.434341, longitude_deg=10.4515451)
    assert scenario.obstacles["obstacle_2"].radius == 25.5
    first, second = scenario.ships.values()
    assert (first.class_, first.length, first.speed_kn) == ("ship", 60.0, 19.0)
    assert (second.class_, second.turn_time) == ("vessel", 10.0)
    assert scenario.own_ship.route == ((500.0, 0.0),)
    assert load_scenario(tmp_path, overrides=["ships.ship_1.length=70"], vessel="otter").ships["ship_1"].length == 70.0


def test_wind_waves_and_current_are_where_they_come_from(tmp_path: Path) -> None:
    write(tmp_path)
    weather = load_scenario(tmp_path).weather
    assert (weather.wind.from_deg, weather.waves.from_deg, weather.current.to_deg) == (90.0, 90.0, 90.0)


def test_a_file_that_is_not_given_takes_the_original_s_default(tmp_path: Path) -> None:
    dynamics, obstacles, sensors = write(tmp_path)
    alone = load_scenario(obstacles)
    assert len(alone.ships) == 2
    assert alone.weather.wind.speed == 0.0
    assert alone.sensors == load_scenario({}).sensors
    assert load_scenario(dynamics).obstacles == {}
    assert load_scenario([sensors, dynamics]).weather.wind.speed == 10.0


def test_sensors_are_those_of_appendix_b3(tmp_path: Path) -> None:
    sensors = load_scenario(write(tmp_path)).sensors
    thesis = load_scenario({"sensors": "thesis"}).sensors
    assert (sensors.ais, sensors.radar, sensors.lidar, sensors.tdm) == (
        thesis.ais, thesis.radar, thesis.lidar, thesis.tdm
    )  # fmt: skip


@pytest.mark.parametrize(("range_m", "rpm", "range_min"), [(1852, 48, 61), (5000, 36, 61), (50, 48, 0)])
def test_the_radar_turns_as_fast_as_its_range_allows(tmp_path: Path, range_m: int, rpm: int, range_min: int) -> None:
    write(tmp_path, c=SENSORS.replace("radar_range_m: 1852", f"radar_range_m: {range_m}"))
    radar = load_scenario(tmp_path).sensors.radar
    assert (radar.range, radar.rpm, radar.range_min) == (range_m, rpm, range_min)


def test_one_warning_for_rates_above_the_tick(tmp_path: Path) -> None:
    write(tmp_path, a=DYNAMICS.replace("mru_frequency: 20", "mru_frequency: 100"))
    with pytest.warns(SensorRateWarning, match=r"every tick: navigation\.mru \(100 Hz\)$") as caught:
        load_scenario(tmp_path)
    assert len(caught) == 1


BAD = {
    "missing sensor key": (
        "c",
        "radar_radius_bias_variance_m2: 3\n",
        "",
        "radar_radius_bias_variance_m2: required key is missing",
    ),
    "misspelt sensor key": (
        "c",
        "radar_range_m",
        "radar_rnge_m",
        "radar_rnge_m: unknown key; did you mean 'radar_range_m'?",
    ),
    "missing dynamics key": ("a", "start_latitude: 59.4377744115633\n", "", "start_latitude: required key is missing"),
    "latitude of 95": (
        "a",
        "start_latitude: 59.4",
        "start_latitude: 95.4",
        "start_latitude: expected a number of at most 90",
    ),
    "waypoint latitude of 95": (
        "b",
        "WP=10,46715/59,44006 WP=10,46146",
        "WP=10,46715/95,44006 WP=10,46146",
        "ships.ship_1: expected a latitude from -90 to 90 deg, got 95.44",
    ),
    "one waypoint": ("b", ' WP=10,46146/59,43564"', '"', "ships.ship_1: needs at least two waypoints"),
    "comma garbage": (
        "b",
        "10,4613435/59,444234",
        "10,461,3435/59,444234",
        "fixed_obstacles.obstacle_1: expected COORD=longitude/latitude in decimal degrees",
    ),
    "no slash": ("b", "10,4613435/59,444234", "10,4613435,59,444234", "fixed_obstacles.obstacle_1: expected COORD="),
    "speed in words": ("b", "SpeedInKnots=19", "SpeedInKnots=fast", "ships.ship_1: expected SpeedInKnots=number"),
    "negative radius": ("b", "RADIUS=30", "RADIUS=-30", "fixed_obstacles.obstacle_1: expected a RADIUS greater than 0"),
    "missing radius": ("b", "RADIUS=30 ", "", "fixed_obstacles.obstacle_1: required field 'RADIUS' is missing"),
    "misspelt field": ("b", "LENGTH=60", "LENGHT=60", "ships.ship_1: unknown field 'LENGHT'; did you mean 'LENGTH'?"),
    "field of an older version": ("b", "LENGTH=60", "Size=60", "unknown field 'Size'; did you mean 'LENGTH'?"),
    "twice": ("b", "LENGTH=60", "LENGTH=60 LENGTH=70", "ships.ship_1: duplicate field 'LENGTH'"),
    "not a text": (
        "b",
        '"RADIUS=30 COORD=10,4613435/59,444234"',
        "30",
        "expected a text of RADIUS=.. COORD=.., got 30",
    ),
    "wind in words": ("a", "wind_speed: 10", "wind_speed: strong", "wind_speed: expected a number, got 'strong'"),
    "tick that does not fit": (
        "a",
        "dt: 0.05",
        "dt: 0.07",
        "simulation.traffic_interval: expected a whole number of ticks",
    ),
    "duplicate key": ("a", "dt: 0.05", "dt: 0.05\ndt: 0.1", "dt: duplicate key, first on line 7"),
    "empty file": ("a", DYNAMICS, "", "is empty"),
    "something else": ("a", DYNAMICS, "colour: red\n", "not one of the thesis's files"),
    "obstacles twice": ("c", SENSORS, OBSTACLES, "obstacles are given by"),
}


@pytest.mark.parametrize("case", BAD)
def test_a_mistake_gives_one_line_with_its_file(tmp_path: Path, case: str) -> None:
    stem, good, bad, expected = BAD[case]
    text = FILES[f"{stem}.yaml"]
    assert good in text
    paths = write(tmp_path, **{stem: text.replace(good, bad, 1)})
    with pytest.raises(ConfigError) as caught:
        load_scenario(paths)
    message = str(caught.value)
    assert message.startswith(str(tmp_path / f"{stem}.yaml")), message
    assert expected in message
    assert "\n" not in message


def test_a_directory_without_files(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="expected YAML files of the thesis's format, found none"):
        load_scenario(tmp_path)


@pytest.mark.skipif(not ORIGINAL.is_dir(), reason="the thesis's own files are not here")
def test_busy_open_sea_is_appendix_b() -> None:
    """The shipped native file equals the thesis's own three files, but for its route, name and description."""
    with pytest.warns(SensorRateWarning):
        thesis = load_scenario(ORIGINAL).dump()
    native = load_scenario("busy_open_sea").dump()
    for data in (thesis, native):
        del data["own_ship"]["route"], data["name"], data["description"]
    assert native == thesis
    assert list(native["ships"]) == list(thesis["ships"])
    assert list(native["obstacles"]) == list(thesis["obstacles"])
