"""PettingZoo's traffic_v0: the framework's own checks, agents that leave for good, and the same numbers every time."""

from __future__ import annotations

import warnings

import numpy as np
import pytest

from usv_gym import traffic_v0
from usv_gym.config import ConfigError

AHEAD = np.array([0.0, 0.4], np.float32)


def sail(env, steps, act=lambda env, agent, k: AHEAD):
    log = []
    for k in range(steps):
        if not env.agents:
            break
        log.append(env.step({agent: act(env, agent, k) for agent in env.agents}))
    return log


def test_pettingzoo_checks():
    with warnings.catch_warnings():  # PettingZoo's own test module imports its deprecated environments
        warnings.simplefilter("ignore")
        from pettingzoo.test import api_test, parallel_api_test
    parallel_api_test(traffic_v0.parallel_env(agents=3, vessels=("odin", "otter")), num_cycles=500)
    api_test(traffic_v0.env(agents=3), num_cycles=200)


def test_registered_with_pettingzoo():
    registry = pytest.importorskip("pettingzoo.env_registry.registration")
    env = registry.make("parallel", "usv_gym/traffic_v0", agents=2) if hasattr(registry, "make") else None
    if env is None:
        pytest.skip("this PettingZoo has no make")
    assert env.possible_agents == ["ship_0", "ship_1"]


def test_same_seed_same_episode_and_another_seed_another():
    def episode(seed):
        env = traffic_v0.parallel_env(agents=4, vessels=("odin", "otter"))
        first, _ = env.reset(seed=seed)
        rng = np.random.default_rng(1)
        log = sail(env, 300, lambda env, agent, k: rng.uniform(-1, 1, 2).astype(np.float32))
        return first, log, env.state()

    a, b, c = episode(5), episode(5), episode(6)
    for agent in a[0]:
        assert np.array_equal(a[0][agent], b[0][agent])
    assert len(a[1]) == len(b[1])
    for (oa, ra, ta, ua, _), (ob, rb, tb, ub, _) in zip(a[1], b[1], strict=True):
        assert (ra, ta, ua) == (rb, tb, ub)
        for agent in oa:
            assert np.array_equal(oa[agent], ob[agent])
            assert np.all(np.isfinite(oa[agent]))
    assert np.array_equal(a[2], b[2])
    assert not np.array_equal(a[2], c[2])


def test_agents_see_each_other_with_their_own_sensors():
    env = traffic_v0.parallel_env(agents=4, icebergs=0)
    env.reset(seed=2)
    sail(env, 12)
    picture = env.worlds["picture"][0]
    assert list(picture["count"]) == [3, 3, 3, 3, 0, 0, 0, 0]
    for o in range(4):
        seen = np.flatnonzero(picture["id"][o])
        assert list(seen) == [k for k in range(4) if k != o]
        truth = env.worlds["vessels"]["eta"][0, seen, :2]
        assert np.linalg.norm(picture["position"][o, seen] - truth, axis=1).max() < 25.0
    # two observers of the same ship make different errors of their own
    assert not np.allclose(picture["covariance"][0, 2], picture["covariance"][1, 2]) or not np.allclose(
        picture["position"][0, 2], picture["position"][1, 2]
    )


def test_ships_that_meet_leave_and_never_return():
    """Two ships head on without a rudder touch; both leave, and the third no longer sees them."""
    env = traffic_v0.parallel_env(agents=3, icebergs=0, action="throttle_nozzle")
    env.reset(seed=0)
    v, route = env.worlds["vessels"], env.worlds["routes"]
    for k, (north, east, psi) in enumerate([(-60.0, 0.0, 0.0), (60.0, 0.0, np.pi), (0.0, 900.0, 0.0)]):
        v["eta"][0, k] = v["frame_eta"][0, k] = north, east, psi
        route["waypoint"][0, k, 1] = 1400.0 * np.cos(psi), 900.0
    left = {}
    for k, (_, _, terminations, truncations, infos) in enumerate(
        sail(env, 60, lambda env, agent, k: np.array([0.5, 0.0], np.float32))
    ):
        for agent in terminations:
            assert agent not in left
            if terminations[agent] or truncations[agent]:
                left[agent] = (k, infos[agent]["outcome"])
    assert left["ship_0"] == left["ship_1"]
    assert left["ship_0"][1] == "collision"
    assert "ship_2" not in left
    assert env.agents == ["ship_2"]
    assert not env.worlds["vessels"]["active"][0, :2].any()
    assert env.worlds["picture"]["count"][0, 2] == 0


def test_heterogeneous_action_spaces_and_state():
    env = traffic_v0.parallel_env(agents=2, vessels=("odin", "otter"), action="actuators")
    assert env.action_space("ship_0") != env.action_space("ship_1")
    env.reset(seed=1)
    assert env.state_space.contains(env.state())
    env.step({agent: env.action_space(agent).sample() for agent in env.agents})
    with pytest.warns(UserWarning, match="render_mode"):
        assert env.render() is None


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        ({"agents": 1}, "agents: expected 2 to 8"),
        ({"icebergs": -1}, "icebergs: expected 0 to 12"),
        ({"vessels": ()}, "vessels: expected at least one"),
        ({"vessels": ("odim",)}, "did you mean 'odin'"),
        ({"acton": "discrete"}, "did you mean 'action'"),
    ],
)
def test_bad_arguments_are_one_line(arguments, says):
    with pytest.raises(ConfigError, match=says) as error:
        traffic_v0.parallel_env(**arguments)
    assert len(str(error.value).splitlines()) == 1


def test_bad_actions_move_nothing():
    env = traffic_v0.parallel_env(agents=2)
    env.reset(seed=1)
    before = env.worlds.tobytes()
    for actions in (
        {"ship_0": AHEAD},
        {"ship_0": AHEAD, "ship_1": np.zeros(3, np.float32)},
        {"ship_0": AHEAD, "ship_1": np.array([np.nan, 0.0], np.float32)},
    ):
        with pytest.raises(ValueError, match="action"):
            env.step(actions)
        assert env.worlds.tobytes() == before


def test_kinematic_ships_are_agents_by_heading_and_speed():
    """A ship without forces turns to where it is told and takes the speed it is told, beside a boat with jets."""
    env = traffic_v0.parallel_env(agents=3, vessels=("odin", "ship"), icebergs=0)
    env.reset(seed=3)
    start = env.worlds["vessels"]["eta"][0, :3, 2].copy()
    assert list(env.worlds["vessels"]["plant"][0, :3] >= 0) == [True, False, True]
    to_starboard = np.array([0.5, 0.0], np.float32)  # 45 deg off the measured heading, half speed, at each step
    for _ in range(20):
        _, rewards, *_ = env.step(dict.fromkeys(env.agents, to_starboard))
        assert all(np.isfinite(reward) for reward in rewards.values())
    v = env.worlds["vessels"]
    assert (v["eta"][0, :3, 2] - start > np.radians(8.0)).all()
    ship = env._models[1]
    assert 0.5 * ship.max_speed < v["nu"][0, 1, 0] < 0.95 * ship.cruise_speed  # slowly, as a ship does
    nav = env.worlds["nav"]["position"][0, 1]
    assert np.hypot(*(nav - v["eta"][0, 1, :2])) < 1.0  # measured where it is, not where the last frame left it


@pytest.mark.parametrize("key", ["land", "family"])
def test_what_the_traffic_environment_would_ignore_is_refused(key):
    scenario = {"name": "mine", "land": {"polygons": [{"shell": [[900, 0], [900, 9], [990, 9]]}]}, "family": "near_shore"}
    with pytest.raises(ConfigError, match=f"'mine': {key}: the traffic environment has none"):
        traffic_v0.parallel_env(scenario={"name": "mine", key: scenario[key]})
