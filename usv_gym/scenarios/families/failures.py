"""Failures of a family: what goes wrong in an episode, drawn into the free places of the table of events.

``failures`` from 0 to 1 is how much goes wrong, and ``difficulty`` how often: on average failures * (0.5 + 2 * difficulty)
failures an episode, three at most.  Each begins within the first 60 % of the time that the route takes and lasts for 5 to 25 %
of it.
"""

from __future__ import annotations

import math

import numpy as np

from ... import rng
from ...jit import inner, kernel
from ...world.state import (
    EVENT_AIS_JAMMED,
    EVENT_AIS_SILENT,
    EVENT_FOG,
    EVENT_GNSS_DRIFTING,
    EVENT_GNSS_FROZEN,
    EVENT_LIDAR_OUTAGE,
    EVENT_NOZZLE_STUCK,
    EVENT_RADAR_OUTAGE,
    EVENT_RAIN,
    EVENT_REDUCED_THRUST,
    EVENT_SNOW,
    TRIGGER_NONE,
    TRIGGER_TIME,
)
from ..events import PRECIPITATION

MOST = 3  #: failures of an episode
KINDS = (EVENT_AIS_JAMMED, EVENT_AIS_SILENT, EVENT_GNSS_FROZEN, EVENT_GNSS_DRIFTING, EVENT_RADAR_OUTAGE, EVENT_LIDAR_OUTAGE,
         EVENT_RAIN, EVENT_FOG, EVENT_SNOW, EVENT_REDUCED_THRUST, EVENT_NOZZLE_STUCK)  # fmt: skip
_PLANTLESS = len(KINDS) - 2  # kinds that an own ship without thrusters can have
_FALLS = np.array([PRECIPITATION[kind] for kind in ("rain", "fog", "snow")])  # [3, 5]
DRIFT = 1.5  #: largest rate of a drifting GNSS, per axis [m/s]


@inner
def _draw(w, i, n):
    """Number n of failure i, in [0, 1)."""
    return rng.uniform(w.seed, rng.FAILURES, np.int64(i), np.int64(n))


@inner
def _draw_failure(w, slot, i, seconds):
    e, v = w.events, w.vessels
    kinds = len(KINDS) if v.plant[w.observer[0]] >= 0 else _PLANTLESS
    action = KINDS[int(_draw(w, i, 0) * kinds)]
    target = -1
    if action == EVENT_AIS_SILENT:
        stations = 0
        for j in range(1, v.active.shape[0]):  # one of those there are, all alike
            if v.active[j] and v.ais_on[j]:
                stations += 1
                if _draw(w, i, 20 + j) * stations < 1.0:
                    target = j
        if target < 0:
            return
    e.trigger[slot] = TRIGGER_TIME
    e.threshold[slot] = seconds * 0.6 * _draw(w, i, 1)
    e.duration[slot] = seconds * (0.05 + 0.2 * _draw(w, i, 2))
    e.action[slot] = action
    e.target[slot] = target
    e.point[slot, 0] = math.nan
    if action == EVENT_GNSS_DRIFTING:
        e.value[slot, 2] = DRIFT * (2.0 * _draw(w, i, 3) - 1.0)
        e.value[slot, 3] = DRIFT * (2.0 * _draw(w, i, 4) - 1.0)
    elif action == EVENT_REDUCED_THRUST:
        e.value[slot, 0] = 0.3 + 0.5 * _draw(w, i, 3)
    elif EVENT_RAIN <= action <= EVENT_SNOW:
        intensity = 0.3 + 0.7 * _draw(w, i, 3)
        for c in range(5):
            fall = _FALLS[action - EVENT_RAIN, c]
            e.value[slot, c] = 1.0 - intensity * (1.0 - fall) if c < 3 else intensity * fall
    w.events_left += 1


@kernel
def sample_failures(worlds, mask, failures, difficulty, seconds):
    """Draw failures into the rows of ``worlds`` [B] where ``mask`` [B] is true; difficulty [B], time of the route [s]."""
    for b in range(worlds.shape[0]):
        if mask[b]:
            w = worlds[b]
            count = min(int(failures * (0.5 + 2.0 * difficulty[b]) + _draw(w, MOST, 0)), MOST)
            slot = w.events.state.shape[0]
            for i in range(count):
                slot -= 1
                while slot >= 0 and w.events.trigger[slot] != TRIGGER_NONE:
                    slot -= 1
                if slot >= 0:
                    _draw_failure(w, slot, i, seconds)
