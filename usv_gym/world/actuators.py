"""Thrusters of a 3-DOF plant: commands -> lagged states -> forces.

Each thruster has three first-order lags: shaft speed n [rpm], nozzle angle alpha [rad] and bucket beta (a waterjet's
reversing deflector, +1 ahead, -1 astern).  A fixed propeller is a thruster without nozzle and bucket; a bow thruster is
a fixed propeller that points sideways.  g: a group of lanes (lanes.py).
"""

from __future__ import annotations

import math

from ..jit import inner, scalar
from ..trig import clip, sincos_random
from .lanes import LANES

EULER_STEP = 0.05  #: [s] step per command row of the preset `original`


@inner
def prepare_lags(w, p, h):
    """Write which share of the way to its reference each lag of plant p covers in h seconds, before lanes are gathered.

    The lag is exact for a constant command, 1 - exp(-h / T).  With ``euler_actuators`` every call of ``actuate`` is one
    explicit Euler step of 0.05 s, whatever h is: the original stepped its actuators once per message.
    """
    q = w.plants
    if q.lag_step[p] == h:
        return
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
def actuate(g):
    """Advance shaft speeds, nozzles and buckets towards ``command`` ([A, 3] in [-1, 1]): x <- x + share (x_ref - x).

    Demands beyond [-1, 1] saturate; NaN is for the caller to refuse.
    """
    # by constants, so that LLVM sees which rows are meant, and that they are others than those written
    if g.thrusters > 0:
        _actuate(g, 0)
    if g.thrusters > 1:
        _actuate(g, 1)
    if g.thrusters > 2:
        _actuate(g, 2)
    if g.thrusters > 3:
        _actuate(g, 3)


@scalar
def _actuate(g, i):
    for l in range(LANES):
        demand = clip(g.command[i, 0, l], -1.0, 1.0)
        idle = g.n_idle[i, l]
        ahead, astern = g.n_max[i, l] - idle, idle - g.n_min[i, l]
        g.n[i, l] += g.lag[i, 0, l] * (idle + demand * (ahead if demand >= 0.0 else astern) - g.n[i, l])
        # a nozzle that points to port pushes the stern to port and the bow to starboard
        alpha = -g.nozzle_max[i, l] * clip(g.command[i, 1, l], -1.0, 1.0)
        g.alpha[i, l] += g.lag[i, 1, l] * (alpha - g.alpha[i, l])
        g.beta[i, l] += g.lag[i, 2, l] * (clip(g.command[i, 2, l], -1.0, 1.0) - g.beta[i, l])


@inner
def thrust(g):
    """Write force and moment (X [N], Y [N], N [N m]) {b} of all thrusters into ``tau``.

    Each gives F = gain n|n| beta along direction + alpha at (x, y), hence N = x Y - y X.  With ``bucket_in_yaw`` 0 the
    moment leaves beta out, as the original did.
    """
    for l in range(LANES):
        g.tau[0, l] = 0.0
        g.tau[1, l] = 0.0
        g.tau[2, l] = 0.0
    if g.thrusters > 0:
        _thrust(g, 0)
    if g.thrusters > 1:
        _thrust(g, 1)
    if g.thrusters > 2:
        _thrust(g, 2)
    if g.thrusters > 3:
        _thrust(g, 3)


@scalar
def _thrust(g, i):
    for l in range(LANES):
        n = g.n[i, l]
        ahead, astern, beta = g.gain_ahead[i, l], g.gain_astern[i, l], g.beta[i, l]
        force = (ahead if n > 0.0 else astern) * n * abs(n) * g.thrust_left[i, l]
        sine, cosine = sincos_random(g.direction[i, l] + g.alpha[i, l])
        g.tau[0, l] += force * beta * cosine
        g.tau[1, l] += force * beta * sine
        lever = beta if g.bucket_in_yaw[l] != 0.0 else 1.0
        g.tau[2, l] += force * lever * (g.x[i, l] * sine - g.y[i, l] * cosine)
