"""The light filters of the TDM (sensors/light.py): a textbook Kalman filter, consistent, fused by the same rule."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numba import njit
from sensor_helpers import advance, sea

from usv_gym.jit import inner
from usv_gym.scenarios.build import build_worlds
from usv_gym.scenarios.loader import load_scenario
from usv_gym.sensors import intake, light
from usv_gym.world.state import PHASE_MOTION, PHASE_NONE, PHASE_POSITION, RADAR

Q, BIAS, T, NOISE = 0.004, 1.6, 10.0, 3.2


@njit(error_model="numpy")
def _run(x, P, fixes, velocities, h, f):
    for k in range(fixes.shape[0]):
        light.predict(x, P, h, math.exp(-h / T), Q, BIAS)
        light.update_position(x, P, fixes[k, 0], fixes[k, 1], f, f * f * NOISE * NOISE)
        if k % 3 == 0:
            light.update_velocity(x, P, velocities[k, 0], velocities[k, 1], 0.7)


@njit(error_model="numpy")
def _fuse(x, P, phase, y, R, other):
    return light.fuse(x, P, phase, y, R, other)


def textbook(x, P, fixes, velocities, h, f):
    """The same with matrices, one axis at a time: x [2, 3] of position, velocity, bias; P [3, 3]."""
    a = np.exp(-h / T)
    F = np.array([[1.0, h, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, a]])
    W = np.zeros((3, 3))
    W[:2, :2] = Q * np.array([[h**3 / 3.0, h**2 / 2.0], [h**2 / 2.0, h]])
    W[2, 2] = BIAS**2 * (1.0 - a * a)
    for k in range(len(fixes)):
        x, P = x @ F.T, F @ P @ F.T + W
        updates = [(np.array([1.0, 0.0, f]), f * f * NOISE**2, fixes[k])]
        if k % 3 == 0:
            updates.append((np.array([0.0, 1.0, 0.0]), 0.7, velocities[k]))
        for H, R, z in updates:
            K = P @ H / (H @ P @ H + R)
            x = x + np.outer(z - x @ H, K)
            P = P - np.outer(K, H @ P)
    return x, P


def test_equals_a_textbook_filter():
    rng = np.random.default_rng(2)
    fixes, velocities = rng.normal(0.0, 30.0, (200, 2)), rng.normal(3.0, 1.0, (200, 2))
    x, P = np.array([1.0, 2.0, 3.0, -1.0, 0.5, -0.5] + [0.0] * 3), np.zeros(45)
    P[:6] = 20.0, 1.0, 2.0, -2.0, 0.1, BIAS**2
    matrix = np.array([[20.0, 1.0, -2.0], [1.0, 2.0, 0.1], [-2.0, 0.1, BIAS**2]])
    expected, covariance = textbook(np.array([[1.0, 3.0, 0.5], [2.0, -1.0, -0.5]]), matrix, fixes, velocities, 1.25, 1.7)
    _run(x, P, fixes, velocities, 1.25, 1.7)
    np.testing.assert_allclose(x[:6], expected.T.ravel(), rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(P[:6], covariance[[0, 0, 1, 0, 1, 2], [0, 1, 1, 2, 2, 2]], rtol=1e-9, atol=1e-12)


def test_is_consistent_on_a_truth_that_obeys_the_model():
    """Normalised squared error of position and velocity within the 95 % band of 200 runs."""
    rng, h, steps, runs = np.random.default_rng(5), 2.0, 100, 200
    a, scores = np.exp(-h / T), []
    kick = np.linalg.cholesky(Q * np.array([[h**3 / 3.0, h**2 / 2.0], [h**2 / 2.0, h]]))
    for _ in range(runs):
        state, bias = np.array([rng.normal(0.0, 4.0, 2), rng.normal(0.0, 2.0, 2)]), rng.normal(0.0, BIAS, 2)
        x, P = np.zeros(9), np.zeros(45)
        P[:6] = 16.0, 0.0, 4.0, 0.0, 0.0, BIAS**2
        fixes, velocities = np.zeros((steps, 2)), np.zeros((steps, 2))
        for k in range(steps):
            state = np.array([state[0] + h * state[1], state[1]]) + kick @ rng.normal(size=(2, 2))
            bias = a * bias + BIAS * np.sqrt(1.0 - a * a) * rng.normal(size=2)
            fixes[k] = state[0] + bias + rng.normal(0.0, NOISE, 2)
            velocities[k] = state[1] + rng.normal(0.0, np.sqrt(0.7), 2)
        _run(x, P, fixes, velocities, h, 1.0)
        error = np.array([x[0:2] - state[0], x[2:4] - state[1]])
        scores.append((error * np.linalg.solve([[P[0], P[1]], [P[1], P[2]]], error)).sum() / 4.0)
    assert 0.9 < np.mean(scores) < 1.1


@pytest.mark.parametrize(
    "phases", [(PHASE_MOTION, PHASE_MOTION), (PHASE_MOTION, PHASE_POSITION), (PHASE_POSITION, PHASE_MOTION)]
)
def test_fusion_is_the_sum_of_information(phases):
    rng = np.random.default_rng(1)
    states, covariances = rng.normal(0.0, 5.0, (2, 7)), np.zeros((2, 28))
    information, weighted = np.zeros((2, 2)), np.zeros((2, 2))
    for k, phase in enumerate(phases):
        covariances[k, :3] = (4.0 + k, 0.5, 0.6 + 0.1 * k) if phase == PHASE_MOTION else (4.0 + k, 0.0, 0.0)
        pp, pv, vv = covariances[k, :3]
        if phase == PHASE_MOTION:
            inverse = np.linalg.inv([[pp, pv], [pv, vv]])
        else:
            inverse, states[k, 2:4] = np.array([[1.0 / pp, 0.0], [0.0, 0.0]]), 0.0
        information += inverse
        weighted += inverse @ states[k, :4].reshape(2, 2)
    x, P = states[0].copy(), covariances[0].copy()
    assert _fuse(x, P, phases[0], states[1], covariances[1], phases[1]) == PHASE_MOTION
    expected = np.linalg.inv(information)
    np.testing.assert_allclose(P[:3], [expected[0, 0], expected[0, 1], expected[1, 1]], rtol=1e-10)
    np.testing.assert_allclose(x[:4].reshape(2, 2), expected @ weighted, rtol=1e-10)


@inner
def _take(worlds, together):
    for b in range(worlds.shape[0]):
        w = worlds[b]
        if together:
            intake.take_scan(w, 0, RADAR, w.sensors.radar)
        else:
            for s in range(w.tracks.id.shape[1]):
                if w.tracks.measured_us[0, RADAR - 1, s] == w.tracks.scan_us[0, RADAR - 1]:
                    intake.take_fix(w, 0, RADAR, s, w.sensors.radar)


def test_fixes_taken_together_do_what_each_does_alone():
    """Scan after scan of targets that stand, set off, sail and stop, some missed, one heard on AIS."""
    ship = {"class": "boat", "length": 12, "after_last": "stop", "ais": "off"}
    ships = {
        "sails": ship | {"speed": 6.0, "waypoints": [[300, 300], [900, 300]]},
        "stops": ship | {"speed": 8.0, "waypoints": [[-300, 100], [-300, 400]]},
        "crawls": ship | {"speed": 0.5, "waypoints": [[300, -300], [400, -300]]},
        "moored": ship | {"speed": 0.0, "waypoints": [[-400, -200], [-300, -200]]},
        "heard": ship | {"ais": "A", "speed": 5.0, "waypoints": [[500, -500], [500, 500]]},
    }  # fmt: skip
    bergs = {f"berg_{i}": {"position": [200.0 * i - 900.0, 600.0], "radius": 8.0} for i in range(9)}
    worlds, _ = sea(6, ships=ships, obstacles=bergs, sensors={"base": "thesis", "tdm": {"filter": "light"}})
    worlds["sensors"]["radar"]["outage"] = 1  # its scans are made here
    scan, t = worlds["sensors"]["radar"][0], worlds["tracks"]
    rng, seen, changes = np.random.default_rng(3), set(), set()
    for _ in range(160):
        advance(worlds, 1.25)
        now = worlds["tick"] * worlds["dt_us"]
        truth = np.concatenate([worlds["vessels"]["eta"][..., :2], worlds["obstacles"]["position"]], axis=1)
        there = np.concatenate([worlds["vessels"]["active"], worlds["obstacles"]["active"]], axis=1).astype(bool)
        there[:, 0] = False
        there &= rng.random(there.shape) < np.linspace(1.0, 0.5, 6)[:, None]
        f = np.maximum(scan["gain"] * np.hypot(*np.moveaxis(truth, -1, 0)), scan["gain_floor"])
        fixes = [truth[..., i] + f * scan["noise"][0] * rng.normal(size=f.shape) for i in range(2)]
        t["filters"]["measured"][:, 0, RADAR] = np.stack([*fixes, 8.0 + f * scan["noise"][1] * rng.normal(size=f.shape), f], 1)
        t["scan_us"][:, 0, RADAR - 1] = now
        t["measured_us"][:, 0, RADAR - 1] = np.where(there, now[:, None], t["measured_us"][:, 0, RADAR - 1])
        before = t["phase"][:, 0, RADAR].copy()
        one_by_one = worlds.copy()
        _take(worlds, True)
        _take(one_by_one, False)
        for name in ("phase", "stamp_us", "id"):
            np.testing.assert_array_equal(t[name], one_by_one["tracks"][name])
        for name in ("x", "p", "line", "size", "p_size"):
            np.testing.assert_allclose(t["filters"][name], one_by_one["tracks"]["filters"][name], rtol=1e-9, atol=1e-12)
        after = t["phase"][:, 0, RADAR]
        seen |= {int(phase) for phase in np.unique(after)}
        changes |= {(int(a), int(b)) for a, b in zip(before.ravel(), after.ravel(), strict=True) if a != b}
    assert seen == {PHASE_NONE, PHASE_POSITION, PHASE_MOTION}
    assert changes >= {(PHASE_POSITION, PHASE_MOTION), (PHASE_MOTION, PHASE_POSITION)}


def test_is_an_option_of_the_sensors():
    for name in ("thesis", "light"):
        worlds, _ = build_worlds(load_scenario("busy_open_sea", overrides=[f"sensors.tdm.filter={name}"]), 1)
        assert worlds["sensors"]["light"][0] == (name == "light")
