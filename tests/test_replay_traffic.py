"""Ships that sail recorded tracks (traffic/replay.py), through the kernels that everybody uses."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest

from usv_gym.config import ConfigError
from usv_gym.engine import advance_worlds, reset_worlds
from usv_gym.render.scene_start import scene_of_start
from usv_gym.scenarios.ais_import.clean import Track, at_times
from usv_gym.scenarios.build import build_worlds, track_pool
from usv_gym.scenarios.commands import Commands
from usv_gym.scenarios.loader import load_scenario
from usv_gym.scenarios.tracks import write_tracks
from usv_gym.units import DEG
from usv_gym.world.land import NO_LAND
from usv_gym.world.lanes import lanes_for
from usv_gym.world.state import BEHAVIOUR_HOLD, BEHAVIOUR_REPLAY

NO_ROWS = np.zeros((0, 0, 4, 3))
V = 8
#: t, north, east, course, speed, heading: a ship that turns, is out of sight for a minute, and comes back with leeway
CURVE = [
    [[0, 1000, 0, 0, 6, 0], [60, 1330, 80, 30, 6, 30], [120, 1500, 370, 90, 5, 90]],
    [[180, 1500, 700, 90, 5, 100], [240, 1500, 1000, 90, 5, 100]],
]


def sea(track=CURVE, *, own=(-5000.0, 0.0), **keys):
    """A world of capacity (8, 16), which other tests compile for too."""
    scenario = load_scenario({
        "name": "replay", "simulation": {"dt": 0.05, "traffic_interval": 0.1}, "own_ship": {"position": list(own)},
        "sensors": {"base": "thesis", "ais": {"interval": "itu"}},
        "ships": {"ferry": {"length": 60.0, "ais": "A", "track": track, **keys}},
    })  # fmt: skip
    worlds, names = build_worlds(scenario, capacity=(V, 16))
    tracks = track_pool(scenario)
    reset_worlds(worlds, NO_LAND, tracks, np.ones(1, bool))
    return worlds, names, tracks, scenario


def sail(worlds, tracks, seconds):
    advance_worlds(worlds, lanes_for(worlds), NO_LAND, tracks, round(seconds / 0.05), NO_ROWS)


def as_track(parts):
    """The same track for the importer's interpolation, which the kernel is checked against."""
    return Track(tuple(np.array([[t, n, e, c * DEG, s, h * DEG] for t, n, e, c, s, h in part]) for part in parts))


def test_a_ship_sails_its_track_and_is_seen_only_where_there_is_one():
    worlds, _, tracks, _ = sea()
    v = worlds["vessels"]
    expected = at_times(as_track(CURVE), np.arange(0.0, 260.0, 10.0))
    for k, place in enumerate(expected):
        if k:
            sail(worlds, tracks, 10.0)
        t = 10.0 * k
        if np.isnan(place).any() or t in (120.0, 240.0):  # its last knot is the last moment that it is seen
            assert not v["active"][0, 1]
            continue
        assert v["active"][0, 1]
        assert v["eta"][0, 1, :2] == pytest.approx(place, abs=1e-6)
    assert worlds["replays"]["changes"][0, 1] == 3  # vanished, appeared, vanished


def test_a_record_has_a_ship_where_it_is_at_the_start_before_the_kernel_runs():
    earlier = [[[t - 30.0, *rest] for t, *rest in part] for part in CURVE]
    scenario = load_scenario({"ships": {"now": {"track": earlier}, "later": {"track": CURVE[1]}}})
    worlds, _ = build_worlds(scenario, capacity=(V, 16))
    before = worlds["vessels"]["eta"][0, :3].copy()
    assert worlds["vessels"]["active"][0, :3].tolist() == [1, 1, 0]
    reset_worlds(worlds, NO_LAND, track_pool(scenario), np.ones(1, bool))
    assert worlds["vessels"]["eta"][0, 1] == pytest.approx(before[1], abs=1e-6)
    assert worlds["vessels"]["active"][0, :3].tolist() == [1, 1, 0]


def test_course_and_speed_are_those_of_the_track():
    worlds, _, tracks, _ = sea()
    sail(worlds, tracks, 60.0)
    v = worlds["vessels"]
    assert math.hypot(*v["velocity"][0, 1]) == pytest.approx(6.0, abs=0.02)
    assert math.atan2(v["velocity"][0, 1, 1], v["velocity"][0, 1, 0]) == pytest.approx(30 * DEG, abs=0.01)
    sail(worlds, tracks, 150.0)  # leeway: heading and course differ
    assert v["eta"][0, 1, 2] == pytest.approx(100 * DEG, abs=1e-3)
    assert math.atan2(v["velocity"][0, 1, 1], v["velocity"][0, 1, 0]) == pytest.approx(90 * DEG, abs=0.01)
    assert v["nu"][0, 1, 0] == pytest.approx(5.0 * math.cos(10 * DEG), abs=1e-2)
    assert v["nu"][0, 1, 1] == pytest.approx(-5.0 * math.sin(10 * DEG), abs=1e-2)


def test_ais_speaks_while_the_ship_is_seen_and_is_silent_otherwise():
    worlds, _, tracks, _ = sea(own=(0.0, 0.0))
    sail(worlds, tracks, 119.0)
    sent = int(worlds["ais"]["sequence"][0, 1])
    assert 11 <= sent <= 40  # every 10 s, every 10/3 s while it turns
    sail(worlds, tracks, 60.0)
    assert worlds["ais"]["sequence"][0, 1] - sent <= 1
    sail(worlds, tracks, 20.0)
    assert worlds["ais"]["sequence"][0, 1] - sent >= 2
    assert worlds["safety"]["distance"][0, 0, 1] < 2000.0
    sail(worlds, tracks, 60.0)
    assert worlds["safety"]["distance"][0, 0, 1] == np.inf


@pytest.mark.parametrize("handover", [{"distance": 800.0}, {"dcpa": 100.0, "tcpa": 120.0}])
def test_a_ship_near_the_own_ship_is_left_to_its_behaviour_for_good(handover):
    straight = [[0, 2000, 0, 180, 5, 180], [600, -1000, 0, 180, 5, 180], [700, -1000, 500, 90, 5, 90]]
    worlds, _, tracks, _ = sea(straight, own=(0.0, 0.0), handover=handover, behaviour="keep_course")
    v = worlds["vessels"]
    sail(worlds, tracks, 200.0)
    assert v["behaviour"][0, 1] == BEHAVIOUR_REPLAY
    sail(worlds, tracks, 100.0)
    assert v["behaviour"][0, 1] == BEHAVIOUR_HOLD
    sail(worlds, tracks, 400.0)
    assert v["active"][0, 1]  # it stays, though its data have ended
    assert v["eta"][0, 1, :2] == pytest.approx([2000.0 - 5.0 * 700.0, 0.0], abs=3.0)


def test_a_ship_at_rest_stays_with_its_data_until_it_casts_off():
    moored = [[0, 50, 0, 0, 0, 90], [100, 50, 0, 0, 0, 90], [150, 100, 0, 0, 2, 0], [400, 600, 0, 0, 2, 0]]
    worlds, _, tracks, _ = sea(moored, own=(0.0, 0.0), handover={"distance": 500.0})
    sail(worlds, tracks, 90.0)
    assert worlds["vessels"]["behaviour"][0, 1] == BEHAVIOUR_REPLAY
    assert worlds["vessels"]["eta"][0, 1] == pytest.approx([50.0, 0.0, math.pi / 2], abs=1e-6)
    sail(worlds, tracks, 60.0)
    assert worlds["vessels"]["behaviour"][0, 1] != BEHAVIOUR_REPLAY


@pytest.mark.parametrize("behaviour", ["waypoints", "colregs"])
def test_what_is_left_of_a_track_is_the_route_of_a_ship_that_was_handed_over(behaviour):
    corner = [[0, 2000, 500, 180, 5, 180], [400, 0, 500, 180, 5, 180], [600, -500, 0, 225, 5, 225]]
    worlds, _, tracks, _ = sea(corner, own=(0.0, -2000.0), handover={"distance": 4000.0}, behaviour=behaviour)
    sail(worlds, tracks, 1.0)
    assert worlds["vessels"]["behaviour"][0, 1] == {"waypoints": 1, "colregs": 2}[behaviour]
    assert worlds["routes"]["count"][0, 1] == 4
    sail(worlds, tracks, 390.0)
    assert worlds["vessels"]["eta"][0, 1, :2] == pytest.approx([45.0, 500.0], abs=30.0)
    sail(worlds, tracks, 150.0)
    assert worlds["vessels"]["eta"][0, 1, 1] < 100.0


def test_an_event_takes_a_ship_off_its_track_at_its_present_speed():
    scenario = load_scenario({
        "ships": {"ferry": {"length": 60.0, "track": CURVE}},
        "events": [{"at": 60.0, "action": "change_behaviour", "target": "ferry", "behaviour": "waypoints"}],
    })  # fmt: skip
    worlds, _ = build_worlds(scenario, capacity=(V, 16))
    tracks = track_pool(scenario)
    reset_worlds(worlds, NO_LAND, tracks, np.ones(1, bool))
    sail(worlds, tracks, 62.0)
    assert worlds["vessels"]["behaviour"][0, 1] == 1
    assert worlds["vessels"]["speed"][0, 1] == pytest.approx(6.0, abs=0.05)
    assert worlds["routes"]["waypoint"][0, 1, 1] == pytest.approx([1500.0, 370.0])
    sail(worlds, tracks, 60.0)
    assert math.dist(worlds["vessels"]["eta"][0, 1, :2], (1500.0, 370.0)) < 60.0


def test_the_chart_of_the_start_shows_where_a_replayed_ship_will_sail():
    worlds, names, tracks, _ = sea(own=(1200.0, 300.0))
    scene = scene_of_start(worlds[0], names, cruise=1.0, duration=250.0, tracks=tracks)
    lines = [p.points for p in scene.layers["tracks"] if getattr(p, "role", "") in ("track_ship", "track_later")]
    places = np.vstack(lines)
    assert np.isfinite(places).all()
    for knot in (CURVE[0][1], CURVE[0][2], CURVE[1][0]):
        assert np.hypot(*(places - knot[1:3]).T).min() < 10.0


def test_notices_and_commands_know_replayed_ships():
    worlds, names, tracks, scenario = sea()
    commands = Commands(worlds, 0, names, scenario)
    sail(worlds, tracks, 130.0)
    assert [(n.kind, n.id) for n in commands.notices()] == [("vanished", "ferry")]
    # a slot whose ship is away is not free
    assert commands.spawn("new", {"waypoints": [[0, 0], [100, 0]]}) == 2
    sail(worlds, tracks, 60.0)
    assert ("appeared", "ferry") in [(n.kind, n.id) for n in commands.notices()]
    commands.set_waypoints("ferry", [[3000.0, 700.0]])
    sail(worlds, tracks, 120.0)
    assert worlds["vessels"]["active"][0, 1]
    assert worlds["vessels"]["eta"][0, 1, 0] > 1600.0
    commands.delete("ferry")
    sail(worlds, tracks, 10.0)
    assert not worlds["vessels"]["active"][0, 1]


def test_a_track_beside_the_scenario_or_within_it_is_the_same(tmp_path):
    (tmp_path / "sea.tracks.csv").write_text(write_tracks({"ferry": CURVE}))
    (tmp_path / "sea.yaml").write_text("ships:\n  ferry: {length: 60, track: sea.tracks.csv}\n")
    beside = load_scenario(tmp_path / "sea.yaml")
    within = load_scenario({"name": "sea", "ships": {"ferry": {"length": 60, "track": CURVE}}})
    assert beside == within
    again = load_scenario(json.loads(json.dumps(beside.dump())))  # as an archive keeps it
    assert again == beside
    assert np.array_equal(track_pool(again), track_pool(beside))
    one = load_scenario({"ships": {"ferry": {"track": CURVE[0]}}})  # a list of knots is a track of one part
    assert one.ships["ferry"].track == within.ships["ferry"].track[:1]


@pytest.mark.parametrize(("ship", "message"), [
    ({"track": [[0, 0, 0, 0, 5]]}, "track: part 1 has 1 knot, expected at least two"),
    ({"track": [[0, 0, 0, 0, 5], [0, 10, 0, 0, 5]]}, "times must increase"),
    ({"track": [[0, 0, 0, 0], [1, 10, 0, 0]]}, "at least 5 items"),
    ({"track": CURVE, "speed": 5.0}, "speed: a ship with a track has none of its own"),
    ({"track": "missing.csv"}, "missing.csv: cannot be read: No such file"),
    ({"waypoints": [[0, 0], [1, 1]], "handover": {"distance": 5.0}}, "handover: only a ship with a track"),
    ({}, "waypoints: required key is missing"),
])  # fmt: skip
def test_wrong_tracks_are_refused(ship, message):
    with pytest.raises(ConfigError, match=message):
        load_scenario({"ships": {"ferry": ship}})


def test_wrong_files_are_refused_with_line_and_likely_name(tmp_path):
    (tmp_path / "a.yaml").write_text("ships:\n  fery: {track: a.csv}\n")
    (tmp_path / "a.csv").write_text(write_tracks({"ferry": CURVE}))
    with pytest.raises(ConfigError, match=r"ships\.fery\.track: no rows of ship 'fery' in a.csv; did you mean 'ferry'"):
        load_scenario(tmp_path / "a.yaml")
    (tmp_path / "a.csv").write_text("ship,part,t,north,east,course_deg,speed,heading_deg\nfery,1,0,0,x,0,0,0\n")
    with pytest.raises(ConfigError, match=r"a\.csv:2: expected finite numbers t, north"):
        load_scenario(tmp_path / "a.yaml")
    (tmp_path / "a.csv").write_text("lat,lon\n")
    with pytest.raises(ConfigError, match=r"a\.csv:1: expected the columns ship,part"):
        load_scenario(tmp_path / "a.yaml")
