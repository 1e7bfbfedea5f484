"""The light filters of the Target Detection Module: six states at a constant velocity, instead of the thesis's nine or twelve.

    [N, E, vN, vE, bN, bE]      N' = vN, vN' = white noise of the spectral density ``light_q``;  z = N + f bN + f v

The axes do not couple, and both are measured by the same sensor at the same range, so one 3 x 3 covariance serves both: six
numbers, [pp, pv, vv, pb, vb, bb].  Everything is linear; speed has no sign, so nothing can end up reversed.  COG and SOG of an
AIS message become a velocity whose variance is the larger one of along and across; with the bias, which a filter without a
state for it cannot follow, counted as white noise that lets means converge as slowly.  Yaw rate is not estimated.

A target that does not move is averaged by the static filter of ``ekf``, and starts to move by the same test (``still``), as
with the thesis's filters (``tracker``).  ``sensors``, ``scan`` and ``h``: see ``ekf``.  docs/tracking.md compares the two.

Arrays are 1-D, or columns of the rows of all targets, for which ``predict``, ``update_position``, ``stopped``, ``predicted``
and ``fuse`` become vector code (sensors/intake.py, sensors/tdm.py).
"""

from __future__ import annotations

import numpy as np

from ..jit import fma, inner, scalar
from ..trig import exp, sincos
from ..world.state import PHASE_MOTION, PHASE_NONE, PHASE_POSITION
from . import ekf, still
from .tracker import STOPPED, track_station


@scalar
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


@scalar
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


@scalar
def _correct(x, P, s, gp, gv, gb, dn, de):
    x[0] = fma(gp, dn, x[0])
    x[1] = fma(gp, de, x[1])
    x[2] = fma(gv, dn, x[2])
    x[3] = fma(gv, de, x[3])
    x[4] = fma(gb, dn, x[4])
    x[5] = fma(gb, de, x[5])
    t = -s * gp
    P[0] = fma(t, gp, P[0])
    P[1] = fma(t, gv, P[1])
    P[3] = fma(t, gb, P[3])
    t = -s * gv
    P[2] = fma(t, gv, P[2])
    P[4] = fma(t, gb, P[4])
    P[5] = fma(-s * gb, gb, P[5])


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
    T = sensors.ais_bias_time[4]
    a = _decay(T, h)
    along = _variance(sensors.ais_noise[4], sensors.ais_bias[4], a)
    if sensors.ais_bias_time[2] != T:  # most are equal, and an exponential is dear
        a = _decay(sensors.ais_bias_time[2], h)
    across = u * u * _variance(sensors.ais_noise[2], sensors.ais_bias[2], a)
    return u * cosine, u * sine, max(along, across)


@inner
def _decay(bias_time, h):
    return exp(-h / bias_time) if bias_time > 0.0 and h > 0.0 else 0.0


@scalar
def _variance(noise, bias, a):
    """Variance of white noise that lets means converge as slowly as this noise with a bias of decay a (see ``still``)."""
    return ekf.white(1.0, noise) + bias * bias * (1.0 + a) / (1.0 - a)


@inner
def track_ais(x, P, phase, h, n, e, psi, u, sensors):
    """Take an AIS message: position [m], COG [rad] and SOG [m/s], which may be NaN.  Returns the new phase."""
    if phase == PHASE_MOTION:
        predict(x, P, h, exp(-h / sensors.ais_bias_time[0]), sensors.light_q, sensors.ais_bias[0])
        update_position(x, P, n, e, 1.0, ekf.white(1.0, sensors.ais_noise[0]))
        if not (np.isnan(psi) or np.isnan(u)):
            vn, ve, variance = ais_velocity(psi, u, h, sensors)
            update_velocity(x, P, vn, ve, variance)
    elif not (np.isnan(psi) or np.isnan(u)):
        ekf.init_fix(x, P, n, e, 1.0, sensors.ais_noise[0], sensors.ais_bias[0])
        vn, ve, variance = ais_velocity(psi, u, 0.0, sensors)
        start(x, P, vn, ve, variance, 0.0)
        phase = PHASE_MOTION
    else:
        phase = track_station(x, P, phase, h, n, e, sensors)
    return phase


@inner
def track_scan(x, P, line, phase, h, n, e, f, sensors, scan):
    """Take a fix n, e [m] with error factor f of radar or LiDAR.  Returns the new phase."""
    ekf.decays(scan, h)
    if phase == PHASE_MOTION:
        predict(x, P, h, scan.decay[0], sensors.light_q, scan.bias[0])
        update_position(x, P, n, e, f, ekf.white(f, scan.noise[0]))
        if stopped(x, P):
            phase = stop(x, P, line, n, e, f, scan)
    elif phase == PHASE_POSITION:
        if still.average(x, P, line, h, n, e, f, scan.noise[0], scan.bias[0], scan.decay[0], scan.fade, scan.slowness) != 0.0:
            phase = set_off(x, P, line)
    else:
        still.first_fix(x, P, line, n, e, f, scan)
        phase = PHASE_POSITION
    return phase


@scalar
def stopped(x, P):
    """True if the speed is nothing that can be told from 0."""
    return speed2(x) < STOPPED * STOPPED * P[2]


@inner
def stop(x, P, line, n, e, f, scan):
    """Make the filter that of a target which does not move, after a fix n, e [m]; returns its phase."""
    ekf.init_position(x, P, x[0], x[1], P[0], 0.0, scan.bias[0])
    still.start_line(line, n, e, f, scan)
    return PHASE_POSITION


@inner
def set_off(x, P, line):
    """Make the static filter one of the motion that its line shows; returns its phase."""
    vn, ve, variance, age = still.velocity(line)
    start(x, P, vn, ve, variance, age)
    return PHASE_MOTION


@scalar
def predicted(x, P, phase, h, q):
    """[N, E, vN, vE] and [pp, pv, vv] of a filter, moved by h [s]; q as in ``predict``.  Of no account in PHASE_NONE."""
    moving = phase == PHASE_MOTION
    t = h if moving else 0.0
    vn, ve = x[2] if moving else 0.0, x[3] if moving else 0.0
    vv = P[2] if moving else 0.0
    pv = (P[1] if moving else 0.0) + t * vv
    pp = P[0] + t * ((P[1] if moving else 0.0) + pv) + q * t * t * t / 3.0
    return x[0] + t * vn, x[1] + t * ve, vn, ve, pp, pv + 0.5 * q * t * t, vv + q * t


@scalar
def fuse(x, P, phase, y, Q, other):
    """Fuse estimate y, Q of phase ``other`` into x, P of phase ``phase``, as ``predicted`` gives them; returns the phase.

    Simple Fusion (see ``fusion``): a Kalman update with S = P + Q, a 2 x 2 matrix for both axes.  An estimate that does not
    move says nothing of the velocity.
    """
    moves, joins = phase == PHASE_MOTION, other == PHASE_MOTION
    # the one that moves, if one does, is corrected by the other
    swap = joins & (not moves)
    n, e, vn, ve = y[0] if swap else x[0], y[1] if swap else x[1], y[2] if swap else x[2], y[3] if swap else x[3]
    pp, pv, vv = Q[0] if swap else P[0], Q[1] if swap else P[1], Q[2] if swap else P[2]
    dn, de = (x[0] if swap else y[0]) - n, (x[1] if swap else y[1]) - e
    a = pp + (P[0] if swap else Q[0])
    s = 1.0 / a
    k0, l0, k1, l1 = pp * s, 0.0, pv * s, 0.0  # K = P S^-1, rows of position and velocity
    dvn = dve = 0.0
    if moves & joins:
        b, c = pv + Q[1], vv + Q[2]
        s = 1.0 / (a * c - b * b)
        k0, l0 = (pp * c - pv * b) * s, (pv * a - pp * b) * s
        k1, l1 = (pv * c - vv * b) * s, (vv * a - pv * b) * s
        dvn, dve = y[2] - vn, y[3] - ve
    if other != PHASE_NONE:
        first = phase == PHASE_NONE
        x[0] = y[0] if first else n + k0 * dn + l0 * dvn
        x[1] = y[1] if first else e + k0 * de + l0 * dve
        x[2] = y[2] if first else vn + k1 * dn + l1 * dvn
        x[3] = y[3] if first else ve + k1 * de + l1 * dve
        P[0] = Q[0] if first else pp - k0 * pp - l0 * pv
        P[1] = Q[1] if first else pv - k0 * pv - l0 * vv
        P[2] = Q[2] if first else vv - k1 * pv - l1 * vv
    return max(phase, other)


@scalar
def speed2(x):
    """Squared speed [m2/s2]."""
    return x[2] * x[2] + x[3] * x[3]
