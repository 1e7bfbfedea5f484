"""Thrusters of a 3-DOF plant: commands -> lagged states -> forces.

Each thruster has three first-order lags: shaft speed n [rpm], nozzle angle alpha [rad] and bucket beta (a waterjet's
reversing deflector, +1 ahead, -1 astern).  A fixed propeller is a thruster without nozzle and bucket; a bow thruster is
a fixed propeller that points sideways.
"""

from __future__ import annotations

import math

from ..jit import inner
from ..trig import clip, sincos

EULER_STEP = 0.05  #: [s] step per command row of the preset `original`


@inner
def actuate(w, p, h):
    """Advance shaft speed, nozzle and bucket of plant p by h seconds towards ``plants.command[p]`` ([A, 3] in [-1, 1]).

    The lag is exact for a constant command, x <- x + (1 - exp(-h / T)) (x_ref - x).  With ``euler_actuators`` every
    call is one explicit Euler step of 0.05 s, whatever h is: the original stepped its actuators once per message.
    Demands beyond [-1, 1] saturate; NaN is for the caller to refuse.
    """
    q = w.plants
    if q.lag_step[p] != h:
        _prepare_lags(w, p, h)
    for i in range(q.thrusters[p]):
        demand = clip(q.command[p, i, 0], -1.0, 1.0)
        idle = q.n_idle[p, i]
        span = q.n_max[p, i] - idle if demand >= 0.0 else idle - q.n_min[p, i]
        if q.jet_stuck[p, i] == 0:
            q.n[p, i] += q.lag[p, i, 0] * (idle + demand * span - q.n[p, i])
        if q.nozzle_stuck[p, i] == 0:
            # a nozzle that points to port pushes the stern to port and the bow to starboard
            alpha = -q.nozzle_max[p, i] * clip(q.command[p, i, 1], -1.0, 1.0)
            q.alpha[p, i] += q.lag[p, i, 1] * (alpha - q.alpha[p, i])
        if q.bucket[p, i] != 0 and q.jet_stuck[p, i] == 0:
            q.beta[p, i] += q.lag[p, i, 2] * (clip(q.command[p, i, 2], -1.0, 1.0) - q.beta[p, i])


@inner
def _prepare_lags(w, p, h):
    """Share of the way to the reference that each lag covers in h seconds."""
    q = w.plants
    q.lag_step[p] = h
    for i in range(q.thrusters[p]):
        q.lag[p, i, 0] = _share(q.n_lag[p, i], h, q.euler_actuators[p])
        q.lag[p, i, 1] = _share(q.nozzle_lag[p, i], h, q.euler_actuators[p])
        q.lag[p, i, 2] = _share(q.bucket_lag[p, i], h, q.euler_actuators[p])


@inner
def _share(lag, h, euler):
    if lag <= 0.0:
        return 1.0
    return min(EULER_STEP / lag, 1.0) if euler != 0 else 1.0 - math.exp(-h / lag)


@inner
def thrust(w, p):
    """Force and moment (X [N], Y [N], N [N m]) {b} of all thrusters of plant p.

    Each gives F = gain n|n| beta along direction + alpha at (x, y), hence N = x Y - y X.  With ``bucket_in_yaw`` 0 the
    moment leaves beta out, as the original did.
    """
    q = w.plants
    surge = 0.0
    sway = 0.0
    yaw = 0.0
    for i in range(q.thrusters[p]):
        n = q.n[p, i]
        if n == 0.0:
            continue
        force = (q.gain_ahead[p, i] if n > 0.0 else q.gain_astern[p, i]) * n * abs(n) * q.thrust_left[p, i]
        sine, cosine = sincos(q.direction[p, i] + q.alpha[p, i])
        beta = q.beta[p, i] if q.bucket[p, i] != 0 else 1.0
        surge += force * beta * cosine
        sway += force * beta * sine
        yaw += force * (beta if q.bucket_in_yaw[p] != 0 else 1.0) * (q.x[p, i] * sine - q.y[p, i] * cosine)
    return surge, sway, yaw
