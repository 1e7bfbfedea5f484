"""What the judge reads: samples of a running batch, the same from an archive, and from positions alone."""

from __future__ import annotations

import numpy as np
import pytest
from gymnasium.utils.seeding import np_random

from usv_gym.colregs.trajectory import Trajectory, TrajectoryRecorder
from usv_gym.colregs.verdict import episode_columns, judge
from usv_gym.envs.core import Core
from usv_gym.replay.truth import trajectory_of
from usv_gym.run import plan
from usv_gym.tasks.task import TaskConfig
from usv_gym.voyage import Voyage


@pytest.fixture(scope="module")
def voyage():
    """A crossing sailed once, recorded for the judge and for the archive."""
    voyage = Voyage(plan("calm_crossing", policy="waypoints", seed=3))
    core = voyage.core
    recorder = TrajectoryRecorder(core.worlds, voyage.steps + 1, core.model.cruise_speed)
    recorder.begin()
    while not voyage.outcome:
        voyage.step()
        recorder.sample()
    return voyage, recorder.trajectory, voyage.finish()


def test_the_recorder_takes_what_the_archive_has(voyage):
    _, x, episode = voyage
    n = int(x.steps[0])
    y = trajectory_of(episode)
    np.testing.assert_array_equal(x.t[0, :n], y.t[0])
    there = y.active[0].any(axis=0)
    np.testing.assert_array_equal(x.active[0, :n][:, there], y.active[0][:, there])
    np.testing.assert_allclose(x.eta[0, :n, 0], y.eta[0, :, 0])
    np.testing.assert_allclose(x.eta[0, :n, 1, :2], y.eta[0, :, 1, :2], atol=1e-6)
    np.testing.assert_allclose(x.velocity[0, :n, 1], y.velocity[0, :, 1], atol=1e-9)
    np.testing.assert_allclose(x.obstacle[0, :n], y.obstacle[0], rtol=1e-6)
    assert (x.arrived[0], x.touched[0]) == (y.arrived[0], y.touched[0])


def test_an_archive_is_judged_like_the_run(voyage):
    _, x, episode = voyage
    run, archive = judge(x), judge(trajectory_of(episode))
    assert list(run.encounters["code"]) == list(archive.encounters["code"])
    assert len(run.encounters) == 1
    for name in ("safety", "r8", "r15", "r16"):
        np.testing.assert_allclose(run.scores[name], archive.scores[name], atol=0.02)
    assert run.row(0)["min_distance"] == pytest.approx(archive.row(0)["min_distance"], abs=0.3)
    assert run.row(0)["arrival"] == archive.row(0)["arrival"] == 1
    assert tuple(run.row(0)) == episode_columns()


def test_distances_are_those_of_the_simulation(voyage):
    made, x, _ = voyage
    row, safety = judge(x).row(0), made.core.worlds["safety"]
    assert row["min_distance"] == safety["closest"][0, 0, 1]  # the sweep sees every frame
    assert row["min_obstacle_distance"] == safety["closest"][0, 0, x.vessels :].min()
    # by samples and straight lines between them it would be much the same
    y = Trajectory.empty(1, x.t.shape[1], x.vessels)
    for name in ("steps", "t", "eta", "velocity", "active", "length", "beam"):
        getattr(y, name)[:] = getattr(x, name)
    assert judge(y).row(0)["min_distance"] == pytest.approx(row["min_distance"], abs=0.3)
    n = int(x.steps[0])
    speed = np.hypot(*x.velocity[0, :n, 0].T)
    assert row["distance"] == pytest.approx((0.5 * (speed[1:] + speed[:-1]) * np.diff(x.t[0, :n])).sum(), rel=0.01)
    assert row["time"] == made.t


def test_rows_begin_and_end_at_their_own_pace():
    core = Core(3, source="calm_crossing", config=TaskConfig(action="throttle_nozzle"))
    every = np.ones(3, bool)
    core.reset(every, [np_random(seed)[0] for seed in range(3)])
    recorder = TrajectoryRecorder(core.worlds, 20, core.model.cruise_speed)
    recorder.begin()
    core.actions[:] = [0.5, 0.25]
    for k in range(10):
        mask = np.array([True, k < 4, k != 7])
        core.step(mask)
        recorder.sample(mask)
    x = recorder.trajectory
    assert list(x.steps) == [11, 5, 10]
    np.testing.assert_allclose(x.demand[0, 1:11], [[0.5, 0.25]] * 10)  # the demands that the thrusters' commands amount to
    assert np.isnan(judge(x).episodes["extra_time"]).all()  # not arrived
    assert x.route[0] == pytest.approx(250 + np.hypot(250, 60))
    before = x.eta[0].copy()
    recorder.begin(np.array([False, True, False]))
    assert list(x.steps) == [11, 1, 10]
    np.testing.assert_array_equal(x.eta[0], before)


def test_positions_alone_are_enough():
    t = np.arange(0.0, 300.0, 2.0)
    own = np.stack([5 * t, 0 * t, 0 * t], axis=1)
    ship = np.stack([1500 - 5 * t, 0 * t + 40, 0 * t + np.pi], axis=1)
    late = np.where(t[:, None] < 20, np.nan, ship + np.array([0, 300, 0]))  # a third comes into sight at 20 s
    x = Trajectory.from_tracks(t, np.stack([own, ship, late], axis=1), np.full(3, 12.0), np.full(3, 4.0))
    verdict = judge(x)
    assert verdict.row(0)["head_on"] == 1
    assert verdict.row(0)["min_distance"] == pytest.approx(36.0)  # 40 m abeam less two half beams
    assert verdict.row(0)["min_distance_time"] == pytest.approx(150.0)
    assert not x.active[0, :10, 2].any()
