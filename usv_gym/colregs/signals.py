"""The named signals that temporal-logic requirements speak of: of the own ship, and of the own ship and one other.

A signal has a value at every sample.  Modes ("the own ship is the give-way vessel") are signals of +MODE or -MODE, so that
they never decide the margin of a requirement that applies; a robustness of MODE says that it never applied.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..jit import inner, kernel, spliced
from ..units import DEG
from ..world.encounter import CROSSING_GIVE_WAY, CROSSING_STAND_ON, HEAD_ON, OVERTAKEN, OVERTAKING, SAFE
from ..world.state import pair_dtype
from .features import closest_fraction, courses, hull_distance_at, under_way
from .machine import EM, advance, domain_ratio, size_factor
from .params import Params
from .stl_kernels import worst_sample
from .trajectory import Floats, Trajectory

MODE = 1.0e6  #: of a signal that is true; minus that if it is false


class Signal(NamedTuple):
    """What a signal means."""

    name: str
    unit: str
    of_pair: bool  # of the own ship and one other; else of the episode alone
    meaning: str


SIGNALS = tuple(Signal(name, unit, bool(of_pair), meaning) for name, unit, of_pair, meaning in (
    ("t", "s", 0, "time since the start"),
    ("remaining", "s", 0, "time until the end of the episode"),
    ("speed", "m/s", 0, "of the own ship over ground"),
    ("turn_rate", "deg/s", 0, "of the own course, + to starboard"),
    ("obstacle", "m", 0, "hull to the nearest obstacle; 1e6 without any"),
    ("arrived", "mode", 0, "the route is done (known at the last sample)"),
    ("collided", "mode", 0, "something was touched (known at the last sample)"),
    ("stopping_distance", "m", 0, "in which the own ship comes to rest: speed times `stop_time`"),
    ("range", "m", 1, "centre to centre"),
    ("clearance", "m", 1, "hull to hull, the smallest since the sample before"),
    ("d_pref", "m", 1, "clearance that set A prefers for these two vessels: k (R_pref - R_col)"),
    ("d_min", "m", 1, "least acceptable clearance: k (R_min - R_col)"),
    ("d_nm", "m", 1, "clearance of a near miss: k (R_nm - R_col)"),
    ("domain", "", 1, "where the own ship is in the other's domain (4 by 1.6 lengths): 1 on its border, less inside"),
    ("dcpa", "m", 1, "distance of the closest point of approach, centre to centre"),
    ("tcpa", "s", 1, "time to it; negative when it is past"),
    ("bearing", "deg", 1, "beta: the other off the own bow, clockwise, -180..180"),
    ("contact_angle", "deg", 1, "alpha: the own ship off the other's bow"),
    ("target_speed", "m/s", 1, "of the other over ground"),
    ("stage", "", 1, "1 far, 2, 3, 4 close, by R2, R3, R4"),
    ("course_change", "deg", 1, "of the own ship since the encounter began, + to starboard; 0 outside"),
    ("speed_change", "", 1, "relative, since the encounter began; 0 outside"),
    ("tracked", "mode", 1, "the own ship's picture holds the other"),
    ("encounter", "mode", 1, "an encounter is on"),
    ("start", "mode", 1, "this is its first sample"),
    ("passing", "mode", 1, "this is the first sample after its closest point"),
    ("passed", "mode", 1, "its closest point is past"),
    ("head_on", "mode", 1, "Rule 14 applies"),
    ("give_way", "mode", 1, "crossing, the own ship gives way (Rules 15, 16)"),
    ("stand_on", "mode", 1, "crossing, the own ship stands on (Rule 17)"),
    ("overtaking", "mode", 1, "the own ship overtakes (Rules 13, 16)"),
    ("overtaken", "mode", 1, "the own ship is overtaken (Rules 13, 17)"),
    ("emergency", "mode", 1, "give-way or head-on, stage 4, closest point within 60 s"),
))  # fmt: skip
NAMES = tuple(signal.name for signal in SIGNALS)
(
    _T, _REMAINING, _SPEED, _TURN_RATE, _OBSTACLE, _ARRIVED, _COLLIDED, _STOPPING, _RANGE, _CLEARANCE, _D_PREF, _D_MIN, _D_NM,
    _DOMAIN, _DCPA, _TCPA, _BEARING, _CONTACT, _TARGET_SPEED, _STAGE, _COURSE_CHANGE, _SPEED_CHANGE, _TRACKED, _ENCOUNTER,
    _START, _PASSING, _PASSED, _HEAD_ON, _GIVE_WAY, _STAND_ON, _OVERTAKING, _OVERTAKEN, _EMERGENCY,
) = range(len(NAMES))  # fmt: skip
STOP_TIME = 8.0  #: [s] time constant of the loss of speed: what `avoid` assumes of its vessels


@inner
def _mode(true):
    return MODE if true else -MODE


@spliced
def write_signals(p, d, x, n, b, i, j, ready, course1, speed1, course2, speed2, hulls, pair, out):
    """Write the signals [S, T] of episode b, own ship i, other ship j (-1: none), n samples.

    p: params_dtype record; d [3]: R_pref, R_min, R_nm less R_col [m] for k = 1; x: the arrays of a Trajectory as a tuple.
    """
    t, eta, velocity, active, tracked, obstacle, length, beam, touched, arrived = x
    for k in range(n):
        out[_T, k] = t[b, k]
        out[_REMAINING, k] = t[b, n - 1] - t[b, k]
        out[_SPEED, k] = speed1[k]
        step = t[b, k] - t[b, k - 1] if k > 0 else 1.0
        out[_TURN_RATE, k] = (course1[k] - course1[k - 1]) / DEG / step if k > 0 else 0.0
        out[_OBSTACLE, k] = min(obstacle[b, k], MODE)
        out[_ARRIVED, k] = _mode(k == n - 1 and arrived[b])
        out[_COLLIDED, k] = _mode(k == n - 1 and touched[b] >= 0)
        out[_STOPPING, k] = speed1[k] * STOP_TIME
    if j < 0:
        return
    l1, b1, l2, b2 = length[b, i], beam[b, i], length[b, j], beam[b, j]
    size = size_factor(p, l1, l2)
    pair.code = SAFE
    pair.state = 0
    passed = False
    first = 0
    for k in range(n):
        before = pair.code
        there = active[b, k, i] and active[b, k, j]
        if there:
            was = pair.code
            advance(pair, p, eta[b, k, i, 0], eta[b, k, i, 1], velocity[b, k, i, 0], velocity[b, k, i, 1], course1[k], l1,
                    eta[b, k, j, 0], eta[b, k, j, 1], velocity[b, k, j, 0], velocity[b, k, j, 1], course2[k], l2)  # fmt: skip
            if k < ready and was == SAFE:
                pair.code = SAFE
                pair.state = 0
            a = k - 1 if k > 0 and active[b, k - 1, j] else k
            f = closest_fraction(a, k, eta[b, :, i], eta[b, :, j])
            near = hull_distance_at(hulls, a, k, f, eta[b, :, i], eta[b, :, j], l1, b1, l2, b2)
            if f < 1.0:
                near = min(near, hull_distance_at(hulls, a, k, 1.0, eta[b, :, i], eta[b, :, j], l1, b1, l2, b2))
            out[_CLEARANCE, k] = 0.0 if touched[b] == j and k == n - 1 else near
        else:  # gone: far away, and no more to come
            pair.code = SAFE
            pair.state = 0
            pair.range, pair.dcpa, pair.tcpa, pair.alpha, pair.beta, pair.stage = MODE, MODE, -MODE, math.pi, math.pi, 1
            out[_CLEARANCE, k] = MODE
        started = pair.code != SAFE and before == SAFE
        if started:
            first = k
            passed = False
        out[_RANGE, k], out[_DCPA, k] = pair.range, pair.dcpa
        out[_DOMAIN, k] = MODE
        if there:
            out[_DOMAIN, k] = domain_ratio(eta[b, k, i, 0], eta[b, k, i, 1], eta[b, k, j, 0], eta[b, k, j, 1], course2[k], l2)
        out[_TCPA, k] = min(max(pair.tcpa, -MODE), MODE)
        out[_D_PREF, k], out[_D_MIN, k], out[_D_NM, k] = size * d[0], size * d[1], size * d[2]
        out[_BEARING, k], out[_CONTACT, k] = pair.beta / DEG, pair.alpha / DEG
        out[_TARGET_SPEED, k] = speed2[k]
        out[_STAGE, k] = pair.stage
        on = pair.code != SAFE
        out[_COURSE_CHANGE, k] = (course1[k] - course1[first]) / DEG if on else 0.0
        out[_SPEED_CHANGE, k] = speed1[k] / max(speed1[first], 1.0e-3) - 1.0 if on else 0.0
        out[_TRACKED, k] = _mode(tracked[b, k, j])
        out[_ENCOUNTER, k], out[_START, k] = _mode(on), _mode(started)
        passes = on and pair.tcpa <= 0.0 and not passed
        passed = on and (passed or passes)
        out[_PASSING, k], out[_PASSED, k] = _mode(passes), _mode(passed)
        out[_HEAD_ON, k] = _mode(pair.code == HEAD_ON)
        out[_GIVE_WAY, k] = _mode(pair.code == CROSSING_GIVE_WAY)
        out[_STAND_ON, k] = _mode(pair.code == CROSSING_STAND_ON)
        out[_OVERTAKING, k] = _mode(pair.code == OVERTAKING)
        out[_OVERTAKEN, k] = _mode(pair.code == OVERTAKEN)
        out[_EMERGENCY, k] = _mode(pair.state == EM)


@kernel
def margins(params, d, x, steps, ready, own, work, hulls, pairs, signals, of_pair, ops, arguments, starts, stack, queue,
            only, out, when):  # fmt: skip
    """Margins of R formulas: out [R, B, V] robustness, NaN where there is no such ship; when [R, B, V] the sample that decided.

    A formula of the episode alone stands in the column of the own ship.  ops [n], arguments [n, 2] hold all programs one after
    the other, starts [R + 1] where each begins; of_pair [R].  signals [S, T] is left with those of the last pair; only: the
    one column to look at, -1 for all.
    """
    out[:] = math.nan
    when[:] = -1
    slow = 0.25 * params[0].moving
    for b in range(steps.shape[0]):
        n, i = steps[b], own[b]
        courses(x[2][b, :, i], x[1][b, :, i], n, slow, work[0], work[1])
        for j in range(out.shape[2]):
            if only >= 0 and j != only:
                continue
            if n == 0 or not (j == i or x[3][b, :n, j].any()):
                continue
            if j != i:
                courses(x[2][b, :, j], x[1][b, :, j], n, slow, work[2], work[3])
            write_signals(params[0], d, x, n, b, i, -1 if j == i else j, ready[b], work[0], work[1], work[2], work[3], hulls,
                          pairs[0], signals)  # fmt: skip
            for r in range(starts.shape[0] - 1):
                if (j == i) != (of_pair[r] == 0):
                    continue
                part = slice(starts[r], starts[r + 1])
                out[r, b, j], when[r, b, j] = worst_sample(ops[part], arguments[part], signals, n, stack, queue)


def arguments_of(x: Trajectory, params: Params) -> tuple[Any, Any, Any, Any, Any, Any]:
    """The leading arguments of the kernel for a trajectory."""
    d = np.array([params.r_pref, params.r_min, params.r_nm]) - params.r_col
    arrays = (x.t, x.eta, x.velocity, x.active, x.tracked, x.obstacle, x.length, x.beam, x.touched, x.arrived)
    return params.record(), d, arrays, x.steps, under_way(x), x.own


def work_space(T: int) -> tuple[NDArray[Any], NDArray[Any], NDArray[Any]]:
    """Its work space for T samples."""
    return np.zeros((4, T)), np.zeros((2, 5, 2)), np.zeros(1, pair_dtype())


def signals(x: Trajectory, b: int, ship: int = -1, params: Params | None = None) -> dict[str, Floats]:
    """Signals of episode b by name, [steps[b]] each; those of a pair are there if ``ship`` is a vessel slot."""
    T, column = x.t.shape[1], int(x.own[b]) if ship < 0 else ship
    out = np.full((len(NAMES), T), np.nan)
    none = np.zeros(0, np.int64)
    margins(*arguments_of(x.rows(slice(b, b + 1)), params or Params()), *work_space(T), out, none.astype(np.int8), none,
            np.zeros((0, 2)), np.zeros(1, np.int64), np.zeros((1, T)), np.zeros((3, T)), column,
            np.zeros((0, 1, x.vessels)), np.zeros((0, 1, x.vessels), np.int64))  # fmt: skip
    n = int(x.steps[b])
    return {s.name: out[i, :n] for i, s in enumerate(SIGNALS) if ship >= 0 or not s.of_pair}
