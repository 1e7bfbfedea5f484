"""The light filters of the Target Detection Module: six states at a constant velocity, instead of the thesis's nine or twelve.

    [N, E, vN, vE, bN, bE]      N' = vN, vN' = white noise of the spectral density ``light_q``;  z = N + f bN + f v

The axes do not couple, and both are measured by the same sensor at the same range, so one 3 x 3 covariance serves both: six
numbers, [pp, pv, vv, pb, vb, bb].  Everything is linear; speed has no sign, so nothing can end up reversed.  COG and SOG of an
AIS message become a velocity whose variance is the larger one of along and across; with the bias, which a filter without a
state for it cannot follow, counted as white noise that lets means converge as slowly.  Yaw rate is not estimated.

A target that does not move is averaged by the static filter of ``ekf``, and starts to move by the same test, as with the
thesis's filters (``tracker``); these functions stand in for PHASE_MOTION only.  ``sensors``, ``scan`` and ``h``: see ``ekf``.
docs/tracking.md compares the two.
"""

from __future__ import annotations

import numpy as np

from ..jit import inner
from ..trig import exp, sincos
from ..world.state import PHASE_MOTION, PHASE_NONE
from . import ekf


@inner
def predict(x, P, h, a, q, bias):
    """Move a filter by h [s], after which the share a of the bias is left.

    q is the density of the acceleration, ``bias`` the stationary deviation of the bias.
    """
    if h <= 0.0:
        return
    x[0] += h * x[2]
    x[1] += h * x[3]
    x[4] *= a
    x[5] *= a
    pv = P[1] + h * P[2]
    P[0] += h * (P[1] + pv) + q * h * h * h / 3.0
    P[1] = pv + 0.5 * q * h * h
    P[3] = a * (P[3] + h * P[4])
    P[2] += q * h
    P[4] *= a
    P[5] = a * a * P[5] + bias * bias * (1.0 - a * a)


@inner
def update_position(x, P, n, e, f, variance):
    """Fix n, e [m] with error factor f and this variance of its white part."""
    gp = P[0] + f * P[3]
    gv = P[1] + f * P[4]
    gb = P[3] + f * P[5]
    s = 1.0 / (gp + f * gb + variance)
    dn = s * (n - x[0] - f * x[4])
    de = s * (e - x[1] - f * x[5])
    _correct(x, P, s, gp, gv, gb, dn, de)


@inner
def update_velocity(x, P, vn, ve, variance):
    """Velocity N, E [m/s] of this variance per axis."""
    s = 1.0 / (P[2] + variance)
    _correct(x, P, s, P[1], P[2], P[4], s * (vn - x[2]), s * (ve - x[3]))


@inner
def _correct(x, P, s, gp, gv, gb, dn, de):
    x[0] += gp * dn
    x[1] += gp * de
    x[2] += gv * dn
    x[3] += gv * de
    x[4] += gb * dn
    x[5] += gb * de
    P[0] -= s * gp * gp
    P[1] -= s * gp * gv
    P[2] -= s * gv * gv
    P[3] -= s * gp * gb
    P[4] -= s * gv * gb
    P[5] -= s * gb * gb


@inner
def start(x, P, vn, ve, variance, age):
    """Turn the static filter in x, P (layout of ``ekf``) into a moving one: velocity [m/s], its variance per axis.

    age [s]: how long ago the velocity held, by which it correlates with the position.
    """
    bn, be, pb, bb = x[2], x[3], P[1], P[2]
    x[2] = vn
    x[3] = ve
    x[4] = bn
    x[5] = be
    P[1] = age * variance
    P[2] = variance
    P[3] = pb
    P[4] = 0.0
    P[5] = bb


@inner
def ais_velocity(psi, u, h, sensors):
    """Velocity N, E [m/s] that COG and SOG say, and its variance per axis; h [s] is the time from message to message."""
    sine, cosine = sincos(psi)
    along = _variance(sensors.ais_noise[4], sensors.ais_bias[4], sensors.ais_bias_time[4], h)
    across = u * u * _variance(sensors.ais_noise[2], sensors.ais_bias[2], sensors.ais_bias_time[2], h)
    return u * cosine, u * sine, max(along, across)


@inner
def _variance(noise, bias, bias_time, h):
    """Variance of white noise that lets means converge as slowly as this noise with its bias does (see ``tracker``)."""
    a = exp(-h / bias_time) if bias_time > 0.0 and h > 0.0 else 0.0
    return ekf.white(1.0, noise) + bias * bias * (1.0 + a) / (1.0 - a)


@inner
def track_ais(x, P, h, n, e, psi, u, sensors):
    """Take an AIS message into a moving filter: position [m], COG [rad] and SOG [m/s], which may be NaN."""
    predict(x, P, h, exp(-h / sensors.ais_bias_time[0]), sensors.light_q, sensors.ais_bias[0])
    update_position(x, P, n, e, 1.0, ekf.white(1.0, sensors.ais_noise[0]))
    if not (np.isnan(psi) or np.isnan(u)):
        vn, ve, variance = ais_velocity(psi, u, h, sensors)
        update_velocity(x, P, vn, ve, variance)


@inner
def init_ais(x, P, n, e, psi, u, sensors):
    """Moving filter from the first AIS message."""
    ekf.init_fix(x, P, n, e, 1.0, sensors.ais_noise[0], sensors.ais_bias[0])
    vn, ve, variance = ais_velocity(psi, u, 0.0, sensors)
    start(x, P, vn, ve, variance, 0.0)


@inner
def track_scan(x, P, h, n, e, f, sensors, scan):
    """Take a fix n, e [m] with error factor f of radar or LiDAR into a moving filter."""
    ekf.decays(scan, h)
    predict(x, P, h, scan.decay[0], sensors.light_q, scan.bias[0])
    update_position(x, P, n, e, f, ekf.white(f, scan.noise[0]))


@inner
def predicted(x, P, phase, h, sensors, X, Q):
    """Copy [N, E, vN, vE] and [pp, pv, vv] of a filter into X and Q and move the copy by h [s]."""
    if phase == PHASE_MOTION:
        X[2] = x[2]
        X[3] = x[3]
        X[0] = x[0] + h * x[2]
        X[1] = x[1] + h * x[3]
        q = sensors.light_q
        pv = P[1] + h * P[2]
        Q[0] = P[0] + h * (P[1] + pv) + q * h * h * h / 3.0
        Q[1] = pv + 0.5 * q * h * h
        Q[2] = P[2] + q * h
    else:
        X[0] = x[0]
        X[1] = x[1]
        X[2] = X[3] = 0.0
        Q[0] = P[0]
        Q[1] = Q[2] = 0.0


@inner
def fuse(x, P, phase, y, Q, other):
    """Fuse estimate y, Q of phase ``other`` into x, P of phase ``phase``, as ``predicted`` gives them; returns the phase.

    Simple Fusion (see ``fusion``): a Kalman update with S = P + Q, a 2 x 2 matrix for both axes.
    """
    if other == PHASE_NONE:
        return phase
    if phase == PHASE_NONE:
        _copy(x, P, y, Q)
        return other
    if phase == PHASE_MOTION and other == PHASE_MOTION:
        pp, pv, vv = P[0], P[1], P[2]
        a, b, c = pp + Q[0], pv + Q[1], vv + Q[2]
        g = 1.0 / (a * c - b * b)
        # K = P S^-1
        k00, k01 = (pp * c - pv * b) * g, (pv * a - pp * b) * g
        k10, k11 = (pv * c - vv * b) * g, (vv * a - pv * b) * g
        for i in range(2):
            dp, dv = y[i] - x[i], y[2 + i] - x[2 + i]
            x[i] += k00 * dp + k01 * dv
            x[2 + i] += k10 * dp + k11 * dv
        P[0] = pp - k00 * pp - k01 * pv
        P[1] = pv - k00 * pv - k01 * vv
        P[2] = vv - k10 * pv - k11 * vv
        return phase
    n, e, variance = y[0], y[1], Q[0]
    if other == PHASE_MOTION:
        n, e, variance = x[0], x[1], P[0]
        _copy(x, P, y, Q)
        phase = other
    s = 1.0 / (P[0] + variance)
    gp, gv = P[0], P[1]
    for i in range(2):
        d = s * ((n if i == 0 else e) - x[i])
        x[i] += gp * d
        x[2 + i] += gv * d
    P[0] -= s * gp * gp
    P[1] -= s * gp * gv
    P[2] -= s * gv * gv
    return phase


@inner
def _copy(x, P, y, Q):
    for i in range(4):
        x[i] = y[i]
    for i in range(3):
        P[i] = Q[i]


@inner
def speed2(x):
    """Squared speed [m2/s2]."""
    return x[2] * x[2] + x[3] * x[3]
