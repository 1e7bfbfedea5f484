"""A calm sea made from a few keys, many seeds at a time, for the tests of the sensors."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from usv_gym.engine import advance_worlds, reset_worlds
from usv_gym.scenarios.build import build_worlds
from usv_gym.scenarios.loader import load_scenario
from usv_gym.traffic.replay import NO_TRACKS
from usv_gym.world.land import NO_LAND
from usv_gym.world.lanes import lanes_for
from usv_gym.world.state import MODEL_KINEMATIC

V = 8  #: vessel slots of the worlds below: obstacle i is source V + i
NO_ROWS = np.zeros((0, 0, 4, 3))
NO_NOISE = {"sensors": {}}  #: keys of a sea with the ranges and rates of the thesis and no errors


def sea(B=1, *, first_seed=1, own_velocity=None, **keys: Any):
    """B worlds of one calm scenario that differ in their seeds only; the own ship rests unless the keys say otherwise.

    ``own_velocity`` (speed [m/s], heading [rad]) makes the own ship sail straight on, kinematically, tick by tick.
    """
    if own_velocity is not None:
        keys = {"simulation": {"traffic_interval": 0.05}} | keys
    worlds, names = build_worlds(load_scenario(keys), B, capacity=(V, 16))
    worlds["seed"] = np.arange(first_seed, first_seed + B)
    if own_velocity is not None:
        v = worlds["vessels"]
        v["model"][:, 0], v["plant"][:, 0] = MODEL_KINEMATIC, -1
        v["speed"][:, 0], v["heading_set"][:, 0] = own_velocity
        v["eta"][:, 0, 2] = v["frame_eta"][:, 0, 2] = own_velocity[1]
    reset_worlds(worlds, NO_LAND, NO_TRACKS, np.ones(B, bool))
    return worlds, names


def advance(worlds, seconds):
    """Sail on for a time that is a whole number of ticks."""
    ticks = round(seconds / worlds["dt"][0])
    assert abs(ticks * worlds["dt"][0] - seconds) < 1e-9
    advance_worlds(worlds, lanes_for(worlds), NO_LAND, NO_TRACKS, ticks, NO_ROWS)


def watch(worlds, seconds, every, *paths):
    """Sail on and sample fields, given as "group.name", after every ``every`` seconds: one array [T, B, ..] each."""
    kept: list[list[Any]] = [[] for _ in paths]
    for _ in range(round(seconds / every)):
        advance(worlds, every)
        for samples, path in zip(kept, paths, strict=True):
            field = worlds
            for name in path.split("."):
                field = field[name]
            samples.append(field.copy())
    return [np.array(samples) for samples in kept]


def by_source(measured):
    """Raw measurements of radar and LiDAR as [.., 2, S, 4] from ``tracks.filters.measured``, [.., 3, 4, S]."""
    return np.swapaxes(measured[..., 1:, :, :], -1, -2)


def wrapped(angle):
    """Angles within [-pi, pi)."""
    return (np.asarray(angle) + np.pi) % (2.0 * np.pi) - np.pi


def rms(error):
    """Root mean square, leaving out NaN."""
    return float(np.sqrt(np.nanmean(np.square(error))))


def check_error(errors, noise, bias, decay, lags=(0, 1, 3)):
    """Series of errors [T, ..] are white noise plus a bias that decays by ``decay`` from sample to sample.

    Their autocovariance must agree within four standard deviations of its estimate (Bartlett 1946), which count how many
    independent samples there are: of some hundred such checks none should fail by chance.
    """

    def expected(lag):
        return bias**2 * decay ** np.abs(lag) + noise**2 * (lag == 0)

    j = np.arange(-1000, 1001)
    assert abs(errors.mean()) < 4.0 * math.sqrt(expected(j).sum() / errors.size)
    for k in lags:
        found = np.mean(errors[k:] * errors[: len(errors) - k])
        spread = math.sqrt((expected(j) ** 2 + expected(j + k) * expected(j - k)).sum() / errors[k:].size)
        assert abs(found - expected(np.array(k))) < 4.0 * spread, (k, found, expected(np.array(k)), spread)
