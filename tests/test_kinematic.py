"""A kinematic own ship: turns and changes speed as its file says, and everything above works as with any vessel."""

from __future__ import annotations

import math

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

from usv_gym.config import ConfigError
from usv_gym.run import plan, resimulate, run
from usv_gym.world.vessel import load_vessel

KN12 = 12 * 1852 / 3600
NAVIGATION = {key: {"rate": 10.0} for key in ("gnss", "mru", "imu", "speed_log", "wind")}
SEA = {
    "name": "passage",
    "simulation": {"dt": 0.1, "traffic_interval": 0.5, "control_interval": 1.0, "duration": 600.0},
    "own_ship": {"vessel": "ship", "speed": KN12, "route": [[1500, 0]], "acceptance_radius": 50},
    "sensors": {"base": "perfect", "navigation": NAVIGATION},
}


def make(scenario=SEA, **kwargs):
    return gym.make("usv_gym/Scenario-v0", scenario=scenario, **kwargs).unwrapped


def sail(env, action, seconds):
    """Heading [rad], speed [m/s] and yaw rate [rad/s] after each second."""
    rows = []
    for _ in range(seconds):
        env.step(np.array(action(), np.float32))
        v = env.world["vessels"]
        rows.append((v["eta"][0, 2], v["nu"][0, 0], v["nu"][0, 2]))
    return np.array(rows).T


def test_turns_and_accelerates_as_its_file_says():
    model = load_vessel("ship")
    env = make(action="heading_speed", observation="truth")
    env.reset(seed=1)
    wanted = math.radians(60.0)

    def turn():  # to a course of 60 deg at full speed
        return [(wanted - env.world["nav"]["mru_heading"][0]) / (math.pi / 2), 1.0]

    heading, speed, rate = sail(env, turn, 180)
    limit = math.radians(model.max_turn_rate_deg)
    assert np.abs(rate).max() == pytest.approx(limit, rel=1e-9)
    # within the largest rate the error decays with the filter's time constant
    error = wanted - heading
    filtered = np.flatnonzero((np.abs(error) < 0.9 * limit * model.turn_time) & (error > 1e-5))
    assert error[filtered[1:]] / error[filtered[:-1]] == pytest.approx(math.exp(-1 / model.turn_time), abs=1e-6)
    assert heading[-1] == pytest.approx(wanted, abs=1e-3)
    # the speed comes up with its own; a command acts when the traffic decides next, half a second later
    t = np.arange(1, 181) - 0.5
    reached = model.max_speed + (KN12 - model.max_speed) * np.exp(-t / model.speed_time)
    assert speed == pytest.approx(reached, rel=0.01)


def test_wind_waves_and_current_do_not_move_it():
    weather = {"wind": {"speed": 20}, "waves": {"height": 3}, "current": {"speed": 1}}
    rows = []
    for scenario in (SEA, {**SEA, "weather": weather}):
        env = make(scenario, action="heading_speed", observation="truth")
        env.reset(seed=1)
        rows.append(sail(env, lambda: [0.1, 0.5], 30))
    assert np.array_equal(*rows)


@pytest.mark.parametrize("action", ["default", "discrete"])
def test_is_an_own_ship_like_any_other(action):
    check_env(make(action=action), skip_render_check=True)


def test_sails_its_route_sees_the_traffic_and_is_recorded():
    ferry = {"class": "vessel", "speed": 3, "waypoints": [[700, 700], [700, -700]], "after_last": "continue"}
    sensors = {"base": "thesis", "navigation": NAVIGATION}
    mission = plan({**SEA, "sensors": sensors, "ships": {"ferry": ferry}}, policy="waypoints", seed=3)
    episode = run(mission)
    assert episode.meta["outcome"]["outcome"] == "arrival"
    assert episode.t[-1] == pytest.approx(1450 / KN12, rel=0.03)
    assert len(episode.detections)
    again = resimulate(episode)
    assert np.array_equal(again.eta, episode.eta)


def test_a_collision_ends_the_episode():
    berg = {"kind": "iceberg", "position": [400, 0], "radius": 20}
    env = make({**SEA, "obstacles": {"berg": berg}}, action="heading_speed")
    env.reset(seed=0)
    for _ in range(120):
        *_, terminated, _, info = env.step(np.array([0.0, 0.6], np.float32))
        if terminated:
            break
    assert info["outcome"] == "collision"


@pytest.mark.parametrize("action", ["throttle_nozzle", "thrusters", "actuators"])
def test_has_no_thrusters_to_command(action):
    with pytest.raises(ConfigError, match=f"action '{action}': a kinematic vessel has no thrusters"):
        make(action=action)


def test_a_thrust_log_cannot_drive_it():
    with pytest.raises(ConfigError, match="vessel ship"):
        plan(SEA, policy="thrust-log")


def test_mistakes_in_its_file(tmp_path):
    text = load_vessel("ship").to_yaml()
    for i, (wrong, message) in enumerate((
        (text.replace("model: kinematic", "model: kinmatic"), r"model: unknown model 'kinmatic'; did you mean 'kinematic'\?"),
        (text.replace("turn_time", "turntime"), r"turntime: unknown key; did you mean 'turn_time'\?"),
        (text.replace("max_speed: 7", "max_speed: 5"), "cruise_speed: expected at most max_speed"),
    )):  # fmt: skip
        path = tmp_path / f"{i}.yaml"
        path.write_text(wrong)
        with pytest.raises(ConfigError, match=message):
            load_vessel(path)
