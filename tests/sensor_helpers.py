"""A calm sea made from a few keys, many seeds at a time, for the tests of the sensors."""

from __future__ import annotations

from typing import Any

import numpy as np

from usv_gym.engine import advance_worlds, reset_worlds
from usv_gym.scenarios.build import build_worlds
from usv_gym.scenarios.loader import load_scenario
from usv_gym.world.state import MODEL_KINEMATIC

V = 8  #: vessel slots of the worlds below: obstacle i is source V + i
NO_ROWS = np.zeros((0, 0, 4, 3))
SILENT = {"std": 0.0}  #: an error that is none


def sea(B=1, *, first_seed=1, own_velocity=None, **keys: Any):
    """B worlds of one calm scenario that differ in their seeds only; the own ship rests unless the keys say otherwise.

    ``own_velocity`` (speed [m/s], heading [rad]) makes the own ship sail straight on, kinematically.
    """
    worlds, names = build_worlds(load_scenario(keys), B, capacity=(V, 16))
    worlds["seed"] = np.arange(first_seed, first_seed + B)
    if own_velocity is not None:
        v = worlds["vessels"]
        v["model"][:, 0], v["plant"][:, 0] = MODEL_KINEMATIC, -1
        v["speed"][:, 0], v["heading_set"][:, 0] = own_velocity
        v["eta"][:, 0, 2] = v["frame_eta"][:, 0, 2] = own_velocity[1]
    reset_worlds(worlds, np.ones(B, bool))
    return worlds, names


def advance(worlds, seconds):
    """Sail on for a time that is a whole number of ticks."""
    ticks = round(seconds / worlds["dt"][0])
    assert abs(ticks * worlds["dt"][0] - seconds) < 1e-9
    advance_worlds(worlds, ticks, NO_ROWS)


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
