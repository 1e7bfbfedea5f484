"""What the environments promise: spaces, actions, observations, rewards, ends of episodes, options, errors."""

from __future__ import annotations

import itertools
import json
import pickle
import subprocess
import sys

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.envs.registration import EnvSpec
from gymnasium.error import ResetNeeded
from gymnasium.utils.env_checker import check_env
from stable_baselines3.common.env_checker import check_env as check_env_sb3

from usv_gym.config import ConfigError
from usv_gym.envs import ENVIRONMENTS
from usv_gym.envs.single import USVEnv
from usv_gym.tasks.task import N_OWN, N_TARGET, TERMS, RewardWeights

ACTIONS = ("default", "throttle_nozzle", "thrusters", "actuators", "heading_speed", "discrete")
OBSERVATIONS = ("tracks", "ais", "sectors", "truth")
AHEAD = np.array([1.0, 0.0], np.float32)  # of throttle_nozzle and of heading_speed: straight on, full speed

#: an empty calm sea to put things into
SEA = {
    "name": "test_sea",
    "simulation": {"dt": 0.1, "traffic_interval": 0.5, "control_interval": 1.0, "duration": 200.0},
    "own_ship": {"speed": 5.0, "route": [[1000, 0]]},
    "sensors": {"base": "thesis", "navigation": {k: {"rate": 10} for k in ("gnss", "mru", "imu", "speed_log", "wind")}},
}
BERG = {"kind": "iceberg", "position": [60, 0], "radius": 15}


def sea(**more):
    return {**SEA, **more}


def make(id: str = "usv_gym/OpenSea-v0", **kwargs) -> USVEnv:
    env = gym.make(id, **kwargs).unwrapped
    assert isinstance(env, USVEnv)
    return env


def drive(env, action=AHEAD, most=300):
    """Step with one action until the episode ends; returns the last step."""
    for _ in range(most):
        step = env.step(action)
        if step[2] or step[3]:
            return step
    raise AssertionError("the episode did not end")


def same(a, b):
    if isinstance(a, dict):
        return a.keys() == b.keys() and all(same(a[key], b[key]) for key in a)
    return a.dtype == b.dtype and np.array_equal(a, b)


def memory(env):
    """All that an environment remembers, as bytes; but for the action itself."""
    episodes = env.core.episodes
    rest = b"".join(episodes[name].tobytes() for name in episodes.dtype.names if name not in ("action", "what"))
    return env.core.worlds.tobytes() + env.core.obs.tobytes() + rest


# --- every registered environment ------------------------------------------------------------------------------------
# warnings are errors in this project's tests
@pytest.mark.parametrize("flat", [True, False])
@pytest.mark.parametrize("action", ["default", "discrete"])
@pytest.mark.parametrize("id", ENVIRONMENTS)
def test_passes_the_checker_of_gymnasium(id, action, flat):
    check_env(make(id, action=action, flat=flat, render_mode="rgb_array"))


@pytest.mark.parametrize("action", ["default", "discrete"])
@pytest.mark.parametrize("id", ENVIRONMENTS)
def test_passes_the_checker_of_stable_baselines(id, action):
    check_env_sb3(gym.make(id, action=action))
    check_env_sb3(gym.make(id, action=action, observation="sectors", flat=False))


@pytest.mark.parametrize("id", ENVIRONMENTS)
def test_survives_json_and_pickle(id):
    env = gym.make(id, observation="sectors", sectors=12, reward={"time": 0.5})
    again = gym.make(EnvSpec.from_json(env.spec.to_json()))
    assert again.observation_space == env.observation_space
    assert same(env.reset(seed=5)[0], again.reset(seed=5)[0])
    core = env.unwrapped
    copy = pickle.loads(pickle.dumps(core))
    for _ in range(3):
        a, b = core.step(AHEAD), copy.step(AHEAD)
        assert same(a[0], b[0])
        assert a[1:] == b[1:]
    assert same(core.reset()[0], copy.reset()[0])  # the generator went along


def test_make_works_without_an_import():
    code = (
        "import gymnasium, json; env = gymnasium.make('usv_gym:usv_gym/OpenSea-v0'); "
        "print(json.dumps(env.reset(seed=1)[0].tolist()))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert np.array_equal(np.float32(json.loads(done.stdout)), make().reset(seed=1)[0])


def test_every_environment_has_its_own_metadata():
    a, b = make(), make()
    a.metadata["render_fps"] = 99
    assert b.metadata["render_fps"] != 99
    assert make().metadata["render_fps"] != 99


# --- spaces ----------------------------------------------------------------------------------------------------------
@pytest.mark.parametrize("flat", [True, False])
@pytest.mark.parametrize("observation", OBSERVATIONS)
@pytest.mark.parametrize("action", ACTIONS)
def test_observations_lie_in_their_space(action, observation, flat):
    env = make(action=action, observation=observation, flat=flat, difficulty=1.0)
    env.action_space.seed(1)
    seen = [env.reset(seed=2)[0]]
    for _ in range(15):
        seen.append(env.step(env.action_space.sample())[0])
    for obs in seen:
        assert env.observation_space.contains(obs)
        for array in obs.values() if isinstance(obs, dict) else [obs]:
            assert array.dtype == np.float32 or array is obs["mask"]
            assert np.isfinite(array).all()
            assert not any(np.shares_memory(array, mine) for mine in (env.core.obs, env.core.worlds))
    if not flat:
        surroundings = "sectors" if observation == "sectors" else "targets"
        assert any(obs[surroundings].any() for obs in seen)


@pytest.mark.parametrize("vessel", ["odin", "jolner", "otter"])
@pytest.mark.parametrize("action", ACTIONS)
def test_every_vessel_takes_every_action(vessel, action):
    env = make("usv_gym/Scenario-v0", scenario=sea(), vessel=vessel, action=action)
    env.reset(seed=1)
    env.action_space.seed(3)
    before = env.world["vessels"]["eta"][0].copy()
    for _ in range(5):
        env.step(env.action_space.sample())
    assert np.isfinite(env.world["vessels"]["eta"][0]).all()
    assert (env.world["vessels"]["eta"][0] != before).any()


def test_dict_and_flat_say_the_same():
    flat, nested = make(observation="tracks"), make(observation="tracks", flat=False)
    a, b = flat.reset(seed=4)[0], nested.reset(seed=4)[0]
    for _ in range(10):
        assert same(a[:N_OWN], b["own"])
        assert same(a[N_OWN:].reshape(-1, N_TARGET), b["targets"])
        assert (a[N_OWN::N_TARGET] == b["mask"]).all()
        a, b = flat.step(AHEAD)[0], nested.step(AHEAD)[0]
    assert b["mask"].any()


# --- what the observation says ---------------------------------------------------------------------------------------
def test_truth_tells_where_things_are():
    scenario = sea(
        own_ship={"position": [0, 30], "heading_deg": 90, "speed": 4.0, "route": [[0, 100], [200, 100]]},
        obstacles={"berg": {"position": [-100, 230], "radius": 20}},
        ships={"ferry": {"speed": 5.0, "length": 40, "waypoints": [[300, 30], [0, 30]]}},
    )
    env = make("usv_gym/Scenario-v0", scenario=scenario, observation="truth", flat=False)
    obs, info = env.reset(seed=0)
    scales = info["scales"]
    own = obs["own"]
    assert own[0] * scales["max_speed"] == pytest.approx(4.0, rel=1e-6)
    assert own[3:5] == pytest.approx([0, 1], abs=1e-6)  # the leg leads where the bow points
    assert own[5] == pytest.approx(0, abs=1e-6)
    assert own[6] * scales["distance_scale"] == pytest.approx(70)
    assert own[7:9] == pytest.approx([0, 1], abs=1e-6)
    assert own[9:11] == pytest.approx([-1, 0], abs=1e-6)  # then 90 deg to port
    assert own[11] == 0
    berg, ferry = obs["targets"][:2]  # by the distance of their hulls: 204 m and 280 m
    assert berg[1:3] * scales["range_scale"] == pytest.approx([200, 100], rel=1e-5)
    assert berg[6] * scales["radius_scale"] == pytest.approx(20)
    assert berg[8] == 0
    assert ferry[1:3] * scales["range_scale"] == pytest.approx([0, -300], abs=1e-3)
    assert ferry[3:5] * scales["target_speed_scale"] == pytest.approx([0, 5], abs=1e-5)
    assert ferry[8] == 1
    assert obs["mask"].tolist() == [1, 1, 0, 0, 0, 0, 0, 0]


@pytest.mark.parametrize("observation", ["tracks", "sectors", "ais"])
def test_nothing_is_known_before_a_sensor_has_fired(observation):
    obs, _ = make(observation=observation, difficulty=1.0).reset(seed=0)
    assert obs[:N_OWN].any()
    assert not obs[N_OWN:].any()


def test_sectors_show_a_disc_where_it_is():
    env = make("usv_gym/Scenario-v0", observation="sectors", sectors=4, flat=False,
               scenario=sea(own_ship={"route": [[1000, 0]]},
                            obstacles={"berg": {"position": [-200, 200], "radius": 10}}))  # fmt: skip
    env.reset(seed=0)
    for _ in range(8):
        obs = env.step(np.array([0.0, 0.0]))[0]
    assert np.flatnonzero(obs["sectors"]).tolist() == [1]  # from abeam to starboard to astern
    assert (1 - obs["sectors"][1]) * 1852 == pytest.approx(np.hypot(200, 200) - 10, abs=30)


# --- actions ---------------------------------------------------------------------------------------------------------
@pytest.mark.parametrize("vessel", ["odin", "jolner", "otter"])
def test_heading_and_speed_are_reached(vessel):
    env = make("usv_gym/Scenario-v0", scenario=sea(), vessel=vessel, action="heading_speed")
    _, info = env.reset(seed=0)
    speed = info["scales"]["cruise_speed"]
    command = 2 * speed / info["scales"]["max_speed"] - 1
    for _ in range(90):
        to_go = np.radians(120) - env.world["nav"]["mru_heading"][0]
        env.step(np.clip([to_go / (np.pi / 2), command], -1, 1))
    v = env.world["vessels"]
    assert np.degrees(v["eta"][0, 2]) == pytest.approx(120, abs=3)
    assert v["nu"][0, 0] == pytest.approx(speed, rel=0.05)


def test_discrete_turns_by_15_degrees_and_changes_speed_by_an_eighth():
    env = make("usv_gym/Scenario-v0", scenario=sea(own_ship={"speed": 3.0}), action="discrete")
    _, info = env.reset(seed=0)
    for action in [2] * 8 + [1] * 2 + [3] + [0] * 60:
        env.step(action)
    v = env.world["vessels"]
    assert np.degrees(v["eta"][0, 2]) == pytest.approx(6 * 15, abs=3)
    assert v["nu"][0, 0] == pytest.approx(3 + info["scales"]["max_speed"] / 8, rel=0.05)


BAD_ACTIONS = [
    ("throttle_nozzle", [np.nan, 0.0], "finite"),
    ("throttle_nozzle", [0.0, np.inf], "finite"),
    ("throttle_nozzle", np.zeros(3), "does not fit"),
    ("throttle_nozzle", np.zeros((2, 1)), "does not fit"),
    ("throttle_nozzle", 0.5, "does not fit"),
    ("throttle_nozzle", ["fast", "left"], "does not fit"),
    ("throttle_nozzle", None, "does not fit"),
    ("discrete", 5, "from 0 to 4"),
    ("discrete", 1.5, "from 0 to 4"),
    ("discrete", [1], "does not fit"),
]


@pytest.mark.parametrize(("name", "action", "words"), BAD_ACTIONS)
def test_a_bad_action_is_refused_and_nothing_moves(name, action, words):
    env = make(action=name)
    env.reset(seed=1)
    good = 2 if name == "discrete" else [0.3, 0.3]
    env.step(good)
    before = memory(env)
    with pytest.raises(ValueError, match=words) as error:
        env.step(action)
    assert "\n" not in str(error.value)
    assert memory(env) == before
    env.step(good)


def test_step_needs_a_reset():
    with pytest.raises(ResetNeeded):
        make().step(AHEAD)


# --- rewards and ends ------------------------------------------------------------------------------------------------
def test_reward_is_the_weighted_sum_of_its_terms():
    weights = {name: 0.5 + i for i, name in enumerate(TERMS)}
    assert set(TERMS) == set(RewardWeights.model_fields)
    env = make(reward=weights, difficulty=1.0)
    env.action_space.seed(0)
    env.reset(seed=7)
    paid = set()
    for _ in range(100):
        _, reward, terminated, _, info = env.step(env.action_space.sample())
        terms = info["reward_terms"]
        assert tuple(terms) == TERMS
        assert reward == pytest.approx(sum(weights[name] * terms[name] for name in TERMS), rel=1e-12)
        paid |= {name for name in TERMS if terms[name]}
        if terminated:
            break
    assert {"progress", "cross_track", "effort", "time"} <= paid


def test_collision_ends_the_episode():
    env = make("usv_gym/Scenario-v0", scenario=sea(obstacles={"berg": BERG}))
    env.reset(seed=0)
    _, reward, terminated, truncated, info = drive(env)
    assert (terminated, truncated) == (True, False)
    assert (info["outcome"], info["is_success"], info["closest"]) == ("collision", False, 0.0)
    assert info["reward_terms"]["collision"] == -1
    assert info["reward_terms"]["proximity"] == -1
    assert reward < -50
    # bow at the ice: 60 m less the radius and half of the vessel's 10.9 m
    contact = 60 - 15 - 10.9 / 2
    assert contact < env.world["vessels"]["eta"][0, 0] < contact + 0.5 * 6  # noticed within a traffic frame


def test_a_collision_that_does_not_end_the_episode_is_paid_once():
    env = make("usv_gym/Scenario-v0", scenario=sea(obstacles={"berg": BERG}), end_on_collision=False)
    env.reset(seed=0)
    paid = [env.step(AHEAD)[4]["reward_terms"]["collision"] for _ in range(25)]
    assert sorted(paid) == [-1.0] + [0.0] * 24


def test_the_last_waypoint_ends_the_episode():
    env = make("usv_gym/Scenario-v0", scenario=sea(own_ship={"speed": 5.0, "route": [[60, 0], [120, 0]]}))
    env.reset(seed=0)
    to_go = [env.step(AHEAD)[4]["to_go"] for _ in range(5)]
    assert all(a > b for a, b in itertools.pairwise(to_go))
    *_, terminated, truncated, info = drive(env)
    assert (terminated, truncated) == (True, False)
    assert (info["outcome"], info["is_success"], info["to_go"]) == ("arrival", True, 0.0)
    assert info["reward_terms"]["arrival"] == 1


def test_leaving_the_area_ends_the_episode():
    scenario = sea(simulation={**SEA["simulation"], "area": 80.0})
    env = make("usv_gym/Scenario-v0", scenario=scenario)
    env.reset(seed=0)
    *_, terminated, _, info = drive(env)
    assert terminated
    assert (info["outcome"], info["reward_terms"]["out_of_area"]) == ("out_of_area", -1)
    assert 80 < env.world["vessels"]["eta"][0, 0] < 90


def test_time_is_up_after_the_duration():
    env = make(overrides=["simulation.duration=5"])
    env.reset(seed=0)
    ends = [env.step(AHEAD)[2:4] for _ in range(5)]
    assert ends == [(False, False)] * 4 + [(False, True)]
    assert env.core.info(0)["outcome"] == "time_limit"


# --- reset -----------------------------------------------------------------------------------------------------------
def test_reset_takes_a_scenario_a_vessel_a_weather_and_a_difficulty():
    env = make()
    env.reset(seed=0, options={"scenario": "calm_crossing"})
    assert env.core.scenario.name == "calm_crossing"
    assert env.world["vessels"]["active"].sum() == 2
    _, info = env.reset(options={"scenario": "open_sea", "vessel": "otter"})
    assert env.core.scenario.name == "open_sea"
    assert info["scales"]["length"] == 2.0
    for action in (AHEAD, -AHEAD):  # what an action means does not change with the vessel: throttle and nozzle
        env.step(action)
    env.reset(options={"weather": "calm"})
    assert not env.world["weather"]["on"]
    env.reset(options={"weather": {"wind": {"speed": 7, "from_deg": 90}}})
    assert env.world["weather"]["wind_speed"] == 7
    env.reset()  # options hold until they are changed
    assert env.world["weather"]["wind_speed"] == 7
    few, many = (
        [env.reset(seed=s, options={"difficulty": d})[0] is not None and int(env.world["obstacles"]["active"].sum())
         for s in range(10)]
        for d in (0.0, 1.0)
    )  # fmt: skip
    assert max(few) < min(many)


BAD_OPTIONS = [
    ({"dificulty": 1}, "dificulty"),
    ({"scenario": "busy_open_see"}, "did you mean 'busy_open_sea'"),
    ({"scenario": {"weather": {"wind": {"sped": 3}}}}, "weather.wind.sped"),
    ({"vessel": "odinn"}, "did you mean 'odin'"),
    ({"weather": "stormy"}, "stormy"),
    ({"weather": {"wind": {"speed": -3}}}, "weather: wind.speed"),
    ({"difficulty": 2.0}, "from 0 to 1"),
    ({"difficulty": "hard"}, "from 0 to 1"),
]


@pytest.mark.parametrize(("options", "words"), BAD_OPTIONS)
def test_bad_options_are_refused_and_change_nothing(options, words):
    env, other = make(), make()
    env.reset(seed=3)
    before = env.core.worlds.tobytes()
    with pytest.raises(ConfigError, match=words) as error:
        env.reset(options={"difficulty": 1.0, **options})
    assert "\n" not in str(error.value)
    assert env.core.worlds.tobytes() == before
    assert same(env.reset(seed=4)[0], other.reset(seed=4)[0])
    assert env.core.worlds.tobytes() == other.core.worlds.tobytes()


def test_a_vessel_with_other_actuators_does_not_fit_a_running_environment():
    env = make(action="thrusters")
    with pytest.raises(ConfigError, match="another action space"):
        env.reset(options={"vessel": "otter"})


@pytest.mark.parametrize(("arguments", "words"), [
    ({"observation": "track"}, "did you mean 'tracks'"),
    ({"action": "fly"}, "environment arguments: action"),
    ({"targets": 0}, "environment arguments: targets"),
    ({"rewards": {}}, "did you mean 'reward'"),
    ({"reward": {"colision": 1}}, "did you mean 'collision'"),
    ({"weather": "foul"}, "calm, random, thesis"),
    ({"difficulty": -1}, "from 0 to 1"),
    ({"vessel": "boat"}, "boat"),
    ({"overrides": ["simulation.duraton=3"]}, "duration"),
    ({"scenario": "octagon"}, "Scenario-v0"),
])  # fmt: skip
def test_bad_arguments_are_refused_at_once(arguments, words):
    with pytest.raises(ValueError, match=words):
        gym.make("usv_gym/OpenSea-v0", **arguments)


def test_an_override_of_something_else_does_not_calm_the_weather():
    plain, longer = make(), make(overrides=["simulation.duration=900"])
    plain.reset(seed=0)
    longer.reset(seed=0)
    assert plain.world["weather"]["on"]
    assert longer.world["weather"].tobytes() == plain.world["weather"].tobytes()


@pytest.mark.parametrize("vessel", ["odin", "jolner", "otter"])
def test_there_is_time_for_every_vessel(vessel):
    """The longest route of the open sea, 1350 m, is well within reach at cruising speed."""
    core = make(vessel=vessel).core
    assert core.scenario.simulation.duration * core.scales()["cruise_speed"] >= 2500


# --- rendering -------------------------------------------------------------------------------------------------------
def test_render_gives_a_picture_that_changes():
    env = make(render_mode="rgb_array", difficulty=1.0)
    env.reset(seed=1)
    first = env.render()
    assert first.dtype == np.uint8
    assert first.ndim == 3
    assert first.shape[2] == 3
    assert first.std() > 5
    for _ in range(10):
        env.step(AHEAD)
    assert (env.render() != first).any(axis=2).mean() > 0.01


def test_a_render_mode_that_does_not_exist_is_refused():
    with pytest.raises(ValueError, match="rgb_array"):
        USVEnv("calm_crossing", render_mode="ansi")


def test_render_without_a_mode_says_what_to_do():
    env = make()
    env.reset(seed=1)
    with pytest.warns(UserWarning, match="render_mode='rgb_array'"):
        assert env.render() is None


def test_a_compilation_is_announced_and_nothing_else(capsys):
    import numba

    from usv_gym.jit import compiling

    function = numba.njit(lambda x: x + x)
    with compiling():
        function(1)
        function(1.0)  # another one within the same wait
    assert capsys.readouterr().err.count("compiling kernels") == 1
    with compiling():
        function(2)
    assert capsys.readouterr().err == ""
