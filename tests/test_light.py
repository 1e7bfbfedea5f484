"""The light filters of the TDM (sensors/light.py): a textbook Kalman filter, consistent, fused by the same rule."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numba import njit

from usv_gym.scenarios.build import build_worlds
from usv_gym.scenarios.loader import load_scenario
from usv_gym.sensors import light
from usv_gym.world.state import PHASE_MOTION, PHASE_POSITION

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


def test_is_an_option_of_the_sensors():
    for name in ("thesis", "light"):
        worlds, _ = build_worlds(load_scenario("busy_open_sea", overrides=[f"sensors.tdm.filter={name}"]), 1)
        assert worlds["sensors"]["light"][0] == (name == "light")
