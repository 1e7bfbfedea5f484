"""Commands to a running world, the notices that come back, and what the sensors make of it."""

from __future__ import annotations

import numpy as np
import pytest

from usv_gym.config import ConfigError
from usv_gym.envs.single import FamilyEnv, ScenarioEnv
from usv_gym.world.state import AIS, LIDAR, RADAR

REST = np.array([0.0, -1.0], np.float32)  # of heading_speed: stay where you are
SCENARIO = {
    "name": "harbour",
    "own_ship": {"route": [[500, 0]]},
    "ships": {
        "coaster": {"class": "vessel", "speed": 3, "waypoints": [[200, 300], [200, -600]], "after_last": "continue"},
        "liner": {"class": "ship", "speed": 3, "waypoints": [[4000, 0], [4000, 900]]},  # beyond the radar
        "rower": {"class": "boat", "speed": 1, "ais": "off", "waypoints": [[-150, 50], [-150, 300]]},
    },
    "obstacles": {"berg": {"position": [120, -90], "radius": 12}},
}


class Sea:
    """A running environment, its commands, and short words for what the TDM reports."""

    def __init__(self):
        self.env = ScenarioEnv(SCENARIO, action="heading_speed")
        self.env.reset(seed=1)
        self.commands = self.env.commands

    def wait(self, seconds):
        """Let time pass; returns the notices (kind, id) that came."""
        for _ in range(seconds):
            self.env.step(REST)
        return [(notice.kind, notice.id) for notice in self.commands.notices()]

    def target(self, id):
        """Target id of an object in the picture; 0: not there."""
        return int(self.env.world["picture"]["id"][0, self.commands.called.index(id)])

    def sensors(self, id):
        """Which sensors hold the target."""
        bits = int(self.env.world["picture"]["sensors"][0, self.commands.called.index(id)]) if self.target(id) else 0
        return {sensor for sensor in (AIS, RADAR, LIDAR) if bits & 1 << sensor}

    def position(self, id):
        source = self.commands.names.index(id)
        vessels, obstacles = self.env.world["vessels"]["eta"], self.env.world["obstacles"]["position"]
        return vessels[source, :2] if source < len(vessels) else obstacles[source - len(vessels)]


@pytest.fixture
def sea():
    here = Sea()
    here.wait(6)
    return here


# --- spawn and delete ------------------------------------------------------------------------------------------------
def test_a_spawned_iceberg_appears_under_a_new_id(sea):
    known = {sea.target(id) for id in sea.commands.names if id}
    sea.commands.spawn("growler", {"position": [-100, -100], "radius": 6})
    assert sea.target("growler") == 0
    assert sea.wait(3) == [("spawned", "growler")]
    assert sea.target("growler") > max(known)
    assert sea.sensors("growler") == {RADAR}
    picture = sea.env.world["picture"]["position"][0, sea.commands.names.index("growler")]
    assert picture == pytest.approx([-100, -100], abs=20)


def test_a_deleted_object_disappears_when_its_sensors_time_out(sea):
    sea.commands.delete("berg")
    assert sea.wait(2) == [("removed", "berg")]
    assert sea.target("berg") > 0  # the radar turns in 1.25 s and is believed for 2.5 turns
    sea.wait(3)
    assert sea.target("berg") == 0
    with pytest.raises(ConfigError, match="unknown id 'berg'"):
        sea.commands.delete("berg")


def test_the_next_one_in_a_slot_knows_nothing_of_its_predecessor(sea):
    source = sea.commands.names.index("coaster")
    old = sea.target("coaster")
    assert old > 0
    sea.commands.delete("coaster")
    spec = {"class": "boat", "speed": 4, "ais": "B", "waypoints": [[-80, -80], [-80, 400]]}
    assert sea.commands.spawn("launch", spec) == source
    assert sea.target("launch") == 0
    assert sea.env.world["tracks"]["phase"][0, :, source].tolist() == [0, 0, 0]
    assert sea.env.world["ais"]["sequence"][source] == 0
    sea.wait(4)
    assert sea.target("launch") > old
    assert sea.position("launch") == pytest.approx([-80, -80 + 4 * 4], abs=0.5)


def test_a_spawned_ship_sails_reports_and_can_be_hit(sea):
    sea.commands.spawn("rammer", {"class": "ship", "speed": 8, "length": 60, "waypoints": [[300, 0], [-300, 0]]})
    sea.wait(6)
    assert sea.sensors("rammer") >= {AIS, RADAR}
    for _ in range(60):
        *_, terminated, _, info = sea.env.step(REST)
        if terminated:
            break
    assert info["outcome"] == "collision"
    assert sea.commands.names[sea.env.world["safety"]["collided_with"][0]] == "rammer"


# --- move and set_waypoints ------------------------------------------------------------------------------------------
def test_move_puts_an_object_elsewhere(sea):
    sea.commands.move("berg", 250.0, 80.0)
    assert sea.position("berg").tolist() == [250.0, 80.0]
    sea.commands.move("rower", -300.0, 10.0, heading_deg=180)
    sea.commands.move("own_ship", 20.0, 5.0)
    assert sea.wait(2) == [("moved", "berg"), ("moved", "rower"), ("moved", "own_ship")]
    assert sea.position("rower")[0] < -301  # sails on along its new heading before it turns to its waypoint
    assert sea.position("own_ship") == pytest.approx([20, 5], abs=2)


def test_an_object_that_is_moved_hits_nothing_on_the_way(sea):
    sea.commands.spawn("wall", {"position": [0, 150], "radius": 40})
    sea.wait(1)
    sea.commands.move("own_ship", 0.0, 300.0)
    sea.wait(2)
    assert sea.env.world["safety"]["collided_with"][0] == -1


def test_what_is_put_somewhere_within_a_traffic_frame_goes_on_from_there():
    simulation = {"dt": 0.05, "traffic_interval": 1.0, "control_interval": 0.25}
    env = ScenarioEnv({**SCENARIO, "simulation": simulation}, action="heading_speed")
    env.reset(seed=1)
    for _ in range(5):  # a quarter into the second frame
        env.step(REST)
    env.commands.spawn("ferry", {"speed": 8.0, "length": 40, "waypoints": [[300, 0], [900, 0]]})
    env.commands.spawn("floe", {"position": [-200, 50], "radius": 5, "drift": [0.0, 2.0]})
    env.commands.move("rower", -150.0, -80.0, 90.0)
    places = {"ferry": (300.0, 0.0), "floe": (-200.0, 50.0), "rower": (-150.0, -80.0)}

    def place(id):
        source, vessels = env.commands.names.index(id), env.world["vessels"]["eta"]
        objects = vessels[:, :2] if source < len(vessels) else env.world["obstacles"]["position"]
        return objects[source if source < len(vessels) else source - len(vessels)].copy()

    for id, there in places.items():
        np.testing.assert_array_equal(place(id), there)
    rowing = float(env.world["vessels"]["nu"][env.commands.names.index("rower"), 0])
    env.step(REST)
    np.testing.assert_allclose(place("ferry"), (302.0, 0.0), atol=1e-9)
    np.testing.assert_allclose(place("floe"), (-200.0, 50.5), atol=1e-9)
    np.testing.assert_allclose(place("rower"), (-150.0, -80.0 + 0.25 * rowing), atol=1e-9)


def test_a_ship_takes_its_new_route_and_says_when_it_is_done(sea):
    north, east = sea.position("rower").tolist()
    sea.commands.set_waypoints("rower", [[north - 60, east], [north - 60, east - 120]])
    kinds = sea.wait(240)
    assert kinds == [("waypoints_set", "rower"), ("waypoint_reached", "rower"), ("waypoint_reached", "rower"),
                     ("route_done", "rower")]  # fmt: skip
    assert np.linalg.norm(sea.position("rower") - [north - 60, east - 120]) < 51  # within its circle of acceptance


def test_the_own_ship_takes_a_new_route(sea):
    sea.commands.set_waypoints("own_ship", [[-200, 0]])
    obs, *_ = sea.env.step(REST)
    assert obs[4] == pytest.approx(-1, abs=1e-3)  # the leg leads astern
    assert obs[6] == pytest.approx(0.2, abs=1e-2)


# --- AIS -------------------------------------------------------------------------------------------------------------
def test_a_ship_that_falls_silent_is_kept_by_radar_in_range_and_lost_beyond(sea):
    coaster, liner = sea.target("coaster"), sea.target("liner")
    assert sea.sensors("coaster") == {AIS, RADAR}
    assert sea.sensors("liner") == {AIS}
    sea.commands.set_ais("coaster", False)
    sea.commands.set_ais("liner", False)
    assert sea.wait(8) == [("ais_off", "coaster"), ("ais_off", "liner")]
    assert sea.sensors("coaster") == {RADAR}
    assert sea.target("coaster") == coaster  # the same target all the time
    assert sea.target("liner") == 0
    sea.commands.set_ais("liner", True)
    sea.commands.set_ais("coaster", True)
    sea.wait(4)
    assert sea.sensors("coaster") == {AIS, RADAR}
    assert sea.target("coaster") == coaster
    assert sea.target("liner") > liner


# --- ids and errors --------------------------------------------------------------------------------------------------
def test_what_a_family_draws_has_ids():
    env = FamilyEnv("open_sea", difficulty=1.0)
    env.reset(seed=0)
    names = env.commands.names
    assert {"own_ship", "ship_1", "obstacle_1"} <= set(names)
    assert [bool(name) for name in names] == [*(env.world["vessels"]["active"] != 0), *(env.world["obstacles"]["active"] != 0)]
    env.commands.delete("obstacle_1")
    env.reset(seed=0)
    assert "obstacle_1" in env.commands.names  # a new episode knows nothing of the commands of the last


ERRORS = [
    ("spawn", {"id": "berg", "spec": {"position": [0, 90], "radius": 5}}, "this id is taken"),
    ("spawn", {"id": "", "spec": {"position": [0, 90], "radius": 5}}, "expected an id"),
    ("spawn", {"id": "b", "spec": {"position": [0, 90], "radius": -5}}, "obstacles.b.radius"),
    ("spawn", {"id": "b", "spec": {"position": [0, 90], "radios": 5}}, "did you mean 'radius'"),
    ("spawn", {"id": "b", "spec": {"position": [0, 90], "radius": float("nan")}}, "obstacles.b.radius"),
    ("spawn", {"id": "s", "spec": {"waypoints": [[0, 90]]}}, "at least two waypoints"),
    ("spawn", {"id": "s", "spec": {"waypoints": [[0, 90], [9, 9]], "mmsi": 257000001}}, "mmsi 257000001 is taken"),
    ("delete", {"id": "own_ship"}, "not possible with the own ship"),
    ("delete", {"id": "bergg"}, "did you mean 'berg'"),
    ("move", {"id": "berg", "north": float("nan"), "east": 0.0}, "finite"),
    ("set_waypoints", {"id": "berg", "waypoints": [[0, 0]]}, "an obstacle has no route"),
    ("set_waypoints", {"id": "rower", "waypoints": []}, "1 to 31 waypoints, got 0"),
    ("set_waypoints", {"id": "rower", "waypoints": [[0, 0, 0]]}, "pairs"),
    ("set_waypoints", {"id": "rower", "waypoints": [[0, float("inf")]]}, "finite"),
    ("set_ais", {"id": "rower", "on": True}, "carries no AIS station"),
    ("set_ais", {"id": "berg", "on": True}, "carries no AIS station"),
    ("sink", {"id": "berg"}, "unknown command 'sink'"),
]


@pytest.mark.parametrize(("command", "arguments", "words"), ERRORS)
def test_a_wrong_command_says_so_in_one_line_and_changes_nothing(command, arguments, words):
    sea = Sea()
    before, names = sea.env.core.worlds.tobytes(), list(sea.commands.names)
    with pytest.raises(ConfigError, match=words) as error:
        sea.commands.apply(command, arguments)
    assert "\n" not in str(error.value)
    assert sea.env.core.worlds.tobytes() == before
    assert sea.commands.names == names
    assert sea.commands.notices() == []
    assert sea.commands.log == []


def test_when_all_slots_are_taken_nothing_more_is_spawned(sea):
    free = int((sea.env.world["obstacles"]["active"] == 0).sum())
    for k in range(free):
        sea.commands.spawn(f"buoy_{k}", {"kind": "buoy", "position": [800 + 20 * k, 800], "radius": 1})
    with pytest.raises(ConfigError, match="no free slot"):
        sea.commands.spawn("one_more", {"position": [900, 900], "radius": 1})
