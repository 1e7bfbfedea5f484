"""The controllers that ship: that they arrive, that ``avoid`` avoids, and that a thrust log is read as it is meant."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from gymnasium.utils.seeding import np_random

from usv_gym.config import ConfigError
from usv_gym.envs.core import Core
from usv_gym.policies import POLICIES, Controller, make_policy
from usv_gym.policies.thrust_log import commands, per_tick, read_thrust_log
from usv_gym.run import plan, run, shipped_log
from usv_gym.tasks.task import N_OWN, N_TARGET, OUTCOMES, observation_size
from usv_gym.voyage import task_of
from usv_gym.world.vessel import load_vessel

ROUTE = [[250, 0], [350, 200], [600, 250]]


def scenario(vessel, **more):
    return {
        "simulation": {"dt": 0.05, "duration": 1000.0},
        "own_ship": {"vessel": vessel, "position": [0, 15], "route": ROUTE},
        **more,
    }


def off_track(episode, route=ROUTE):
    """Distance [m] of the own ship from its route at every sample."""
    track = episode.eta[:, 0, :2]
    legs = []
    for a, b in pairwise(np.array([[0, 15], *route], float)):
        share = np.clip(((track - a) @ (b - a)) / ((b - a) @ (b - a)), 0, 1)
        legs.append(np.linalg.norm(track - a - share[:, None] * (b - a), axis=1))
    return np.min(legs, axis=0)


def fly(name, num=60, **arguments):
    """Outcomes of the open seas 0 .. num - 1 with a policy, all in one batch."""
    pilot = make_policy(name)
    core = Core(num, source="open_sea", config=task_of(pilot), **arguments)
    core.reset(np.ones(num, bool), [np_random(seed)[0] for seed in range(num)])
    pilot.reset_batch(num, {"scales": core.scales()})
    running = np.ones(num, bool)
    while running.any():
        core.actions[:] = pilot.act_batch(core.obs, running)
        core.step(running)
        running &= ~(core.terminated | core.truncated)
    return [OUTCOMES[outcome] for outcome in core.episodes["outcome"]]


# --- waypoints -------------------------------------------------------------------------------------------------------
@pytest.mark.parametrize("vessel", ["odin", "jolner", "otter"])
def test_waypoints_arrives_and_stays_on_its_route(vessel):
    episode = run(plan(scenario(vessel), policy="waypoints"))
    assert episode.meta["outcome"]["outcome"] == "arrival"
    error = off_track(episode)
    assert error.max() < 20  # turns begin a circle of acceptance, 20 m, ahead of the corner
    assert np.median(error) < 2.5
    assert error[-1] < 2


def test_waypoints_holds_its_track_in_a_cross_current():
    sea = scenario("odin", weather={"current": {"speed": 0.7, "to_deg": 90}})
    sea["own_ship"]["route"] = [[1500, 15]]
    error = off_track(run(plan(sea, policy="waypoints")), [[1500, 15]])
    assert error.max() > 2  # it is set off first,
    assert error[len(error) // 2 :].mean() < 1  # then the integral knows of the current


# --- avoid -----------------------------------------------------------------------------------------------------------
def test_avoid_collides_far_less_than_waypoints_on_60_open_seas():
    """Found: ``avoid`` 0 collisions and 57 arrivals, ``waypoints`` 49 collisions; tuned on the seeds 1000 to 1059."""
    careful, blind = fly("avoid"), fly("waypoints")
    assert blind.count("collision") >= 30
    assert careful.count("collision") <= 4
    assert careful.count("arrival") >= 50


def meet(seed=0, **what):
    """Run ``avoid`` due north at 5 m/s into something; returns the episode."""
    sea = scenario("odin", **what)
    sea["own_ship"].update(route=[[500, 0]], position=[0, 0], speed=5.0)
    return run(plan(sea, policy="avoid", seed=seed))


@pytest.mark.parametrize("seed", range(3))
def test_avoid_goes_around_an_iceberg(seed):
    outcome = meet(seed, obstacles={"berg": {"position": [200, 0], "radius": 15}}).meta["outcome"]
    assert outcome["outcome"] == "arrival"
    assert 10 < outcome["closest_m"] < 60


@pytest.mark.parametrize("seed", range(3))
def test_avoid_passes_a_ship_head_on_port_to_port(seed):
    episode = meet(seed, ships={"coaster": {"length": 30, "speed": 4, "waypoints": [[500, 0], [-500, 0]]}})
    assert episode.meta["outcome"]["outcome"] == "arrival"
    assert episode.meta["outcome"]["closest_m"] > 20
    ours, theirs = episode.eta[:, 0, :2], episode.eta[:, 1, :2]
    passing = np.linalg.norm(ours - theirs, axis=1).argmin()
    assert ours[passing, 1] > 20  # to starboard of its own track


def test_avoid_is_the_waypoint_follower_where_nothing_is_seen():
    careful, blind = (run(plan(scenario("odin"), policy=name)) for name in ("avoid", "waypoints"))
    assert careful.eta.tobytes() == blind.eta.tobytes()


# --- all -------------------------------------------------------------------------------------------------------------
@pytest.mark.parametrize("name", POLICIES)
def test_every_policy_is_a_controller(name):
    assert isinstance(make_policy(name), Controller)


@pytest.mark.parametrize("name", ["waypoints", "avoid", "vo", "sbmpc", "apf"])
def test_every_lookout_has_room_for_all_targets_and_land_all_around(name):
    pilot = make_policy(name)
    config = pilot.task.model_copy(update={"land": True})
    scales = {key: getattr(config, key) for key in ("range_scale", "distance_scale", "target_speed_scale", "radius_scale",
                                                    "rate_scale")}  # fmt: skip
    pilot.reset_batch(1, {"scales": {**scales, "max_speed": 5.0, "cruise_speed": 4.0, "length": 10.0, "control_interval": 1.0,
                                     "targets": config.targets, "land": config.land_sectors}})  # fmt: skip
    seen = np.full((1, observation_size(config)), 0.1, np.float32)
    seen[0, N_OWN : N_OWN + config.targets * N_TARGET : N_TARGET] = 1.0  # every target is there
    seen[0, N_OWN + config.targets * N_TARGET :] = 0.99  # and land at 37 m on every side
    assert np.isfinite(pilot.act_batch(seen)).all()
    assert len(pilot._targets) == config.targets + config.land_sectors
    assert (pilot._targets["distance"] > 0.0).all()


def test_an_unknown_policy_gets_a_suggestion():
    with pytest.raises(ConfigError, match="did you mean 'avoid'"):
        make_policy("avoyd")


def test_idle_drifts_with_the_wind():
    sea = scenario("otter", weather={"wind": {"speed": 8, "from_deg": 270}})
    sea["simulation"]["duration"] = 60.0
    episode = run(plan(sea, policy="idle"))
    assert episode.eta[-1, 0, 1] > 16  # eastwards


# --- thrust logs -----------------------------------------------------------------------------------------------------
def write(tmp_path, text):
    path = tmp_path / "log.txt"
    path.write_text(text, encoding="utf-8")
    return path


def test_a_log_may_have_commas_spaces_comments_and_empty_lines(tmp_path):
    rows = read_thrust_log(write(tmp_path, "# rpm nozzle bucket, twice\n1,2,3,4,5,6\n\n 7 8\t9 10 11 12.5  # then\n"))
    assert rows.tolist() == [[1, 2, 3, 4, 5, 6], [7, 8, 9, 10, 11, 12.5]]


@pytest.mark.parametrize(("text", "words"), [
    ("", "an empty thrust log"),
    ("# nothing\n\n", "an empty thrust log"),
    ("1,2,3,4,5,6\n1,2,3,4,5\n", r"log.txt:2: expected 6 numbers \(left rpm, .*\), got 5"),
    ("1,2,3,4,5,6\n1,2,nan,4,5,6\n", "log.txt:2: expected finite numbers"),
    ("1,2,3,4,5,inf\n", "log.txt:1: expected finite numbers"),
    ("full ahead\n", "log.txt:1: expected 6 numbers, got 'full ahead'"),
])  # fmt: skip
def test_a_broken_log_says_where(tmp_path, text, words):
    with pytest.raises(ConfigError, match=words) as error:
        read_thrust_log(write(tmp_path, text))
    assert "\n" not in str(error.value)


def test_a_missing_log_says_so(tmp_path):
    with pytest.raises(ConfigError, match="no such file"):
        read_thrust_log(tmp_path / "nowhere.txt")


@pytest.mark.parametrize("vessel", ["odin", "jolner", "otter"])
def test_left_is_port_and_right_is_starboard(vessel):
    model = load_vessel(vessel)
    given = commands(np.array([[50.0, -20.0, 100.0, 150.0, 10.0, -100.0]]), model)[0]
    for thruster, command in zip(model.thrusters, given, strict=False):
        expected = {-1: [0.5, -0.2, 1.0], 0: [0, 0, 0], 1: [1.0, 0.1, -1.0]}[int(np.sign(thruster.y_m))]
        assert command.tolist() == expected  # 150 % is 100 %


@pytest.mark.parametrize(("dt", "expected"), [
    (0.05, [[0, 1, 2, 3, 4], [5, 6, 6, 6, 6]]),  # five rows a tick, the last one held
    (0.01, [[0], [1], [2], [3], [4], [5], [6]]),
    (0.005, [[0], [0], [1], [1], [2], [2], [3], [3], [4], [4], [5], [5], [6], [6]]),
])  # fmt: skip
def test_rows_come_at_100_hz_whatever_the_tick(dt, expected):
    rows = np.zeros((7, 4, 3))
    rows[:, 0, 0] = np.arange(7)
    assert per_tick(rows, dt)[:, :, 0, 0].tolist() == expected


def test_the_shipped_log_drives():
    log = read_thrust_log(shipped_log())
    assert log.shape[1] == 6
    assert np.abs(log).max() <= 100
    mission = plan("calm_crossing", policy="thrust-log", overrides=["ships={}", "obstacles={}"])
    episode = run(mission)
    assert episode.t[-1] == pytest.approx(len(log) / 100, abs=0.05)
    assert np.linalg.norm(np.diff(episode.eta[:, 0, :2], axis=0), axis=1).sum() > 100
    assert episode.meta["outcome"]["outcome"] == "log_end"
