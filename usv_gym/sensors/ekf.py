"""The local extended Kalman filters of the Target Detection Module (thesis 3.2.1 and 3.2.2).

A target moves as in ``motion``, and every sensor adds biases to it, first-order Gauss-Markov processes (thesis 2.1).
Only biases are driven by noise, and those of another sensor never couple into a filter, so the thesis's 19-state filter
falls apart exactly into

    AIS           [N, E, psi, u, r, b1, b2, bN, bE, bpsi, bu, br]   measures N, E, COG, SOG, ROT
    radar, LiDAR  [N, E, psi, u, r, b1, b2, bN, bE]                 measures N, E;  z = N + f bN + f v,  f = f(d) (2.4)
    size          [alpha, balpha]                                  measures the apparent radius;  z = alpha + f b + f v

Covariances are packed: lower triangle, row by row, entry (i, j <= i) at i (i + 1) / 2 + j.  The first n states are then
the first n (n + 1) / 2 numbers, and the AIS filter begins with a scan filter: the 7 states of motion are 28 numbers in
both.

``sensors`` is the record of that name in the world (process_u, process_r, process_time, inflation, ais_noise, ais_bias,
ais_bias_time), ``scan`` is ``sensors.radar`` or ``sensors.lidar`` (noise, bias, bias_time).  ``h`` is the time since
the filter's own time of validity [s].  ``x`` and ``P`` are 1-D arrays that are changed in place.

The same arrays hold the static filter of a target whose motion is unknown: x = [N, E, bN, bE], and as the two axes do not
couple and are measured alike, one covariance [pp, pb, bb] for both.
"""

from __future__ import annotations

import math

import numpy as np

from ..jit import inner, scalar
from ..trig import exp, wrap
from .motion import column, correct, correct_row, predict_motion, start_motion

#: Standard deviation of a yaw rate of which nothing is known: 1 deg/s [rad/s]
YAW_RATE = math.radians(1.0)
#: Smallest variance of a white error [m2, rad2, ..]: a sensor without noise must not divide by zero
VARIANCE_MIN = 1e-8


#: Time constant of forgetting in the line fit of ``tracker`` [s]
MEMORY = 60.0


@inner
def decays(scan, h):
    """Work out what ``scan`` keeps of a time of h [s] between two fixes: nearly all targets of a scan ask for the same one."""
    if scan.elapsed != h or scan.fade == 0.0:  # 0: nobody has asked yet
        scan.elapsed = h
        for i in range(2):
            scan.decay[i] = exp(-h / scan.bias_time[i]) if h > 0.0 else 1.0
        scan.fade = exp(-h / MEMORY) if h > 0.0 else 1.0
        scan.slowness = (1.0 + scan.decay[0]) / (1.0 - scan.decay[0])


# --- prediction ------------------------------------------------------------------------------------------------------
@inner
def predict_scan(x, P, h, sensors, scan):
    """Move a radar or LiDAR filter by h [s]."""
    if h > 0.0:
        predict_motion(x, P, 9, h, sensors)
        decays(scan, h)
        for i in range(7, 9):
            _predict_bias(x, P, 9, i, scan.decay[0], scan.bias[0])


@inner
def predict_ais(x, P, h, sensors):
    """Move an AIS filter by h [s]."""
    if h > 0.0:
        predict_motion(x, P, 12, h, sensors)
        a, T = 1.0, 0.0
        for i in range(5):
            field = _field(i)
            if sensors.ais_bias_time[field] != T:  # most are equal, and an exponential is dear
                T = sensors.ais_bias_time[field]
                a = exp(-h / T)
            _predict_bias(x, P, 12, 7 + i, a, sensors.ais_bias[field])


@inner
def _predict_bias(x, P, n, i, a, bias):
    """Exact step of bias i of n states: decay a, stationary standard deviation ``bias``."""
    x[i] *= a
    k = i * (i + 1) // 2
    for j in range(k, k + i + 1):
        P[j] *= a
    for j in range(i, n):
        P[j * (j + 1) // 2 + i] *= a
    P[k + i] += bias * bias * (1.0 - a * a)


@scalar
def predict_position(x, P, a, bias):
    """Move a static filter: only its sensor biases (standard deviation [m]) change, of which the share a is left."""
    x[2] *= a
    x[3] *= a
    P[1] *= a
    P[2] = a * a * P[2] + bias * bias * (1.0 - a * a)


@scalar
def predict_size(x, P, a, bias):
    """Move a size filter: the radius is constant, its bias (standard deviation [m]) is not, of which the share a is left."""
    x[1] *= a
    P[1] *= a
    P[2] = a * a * P[2] + bias * bias * (1.0 - a * a)


@inner
def _field(i):
    """Index of measurement i = N, E, psi, u, r among the AIS fields, which are N, E, COG, heading, SOG, ROT."""
    return i if i < 3 else i + 1


@scalar
def white(f, noise):
    """Variance of the white part of an error with factor f and standard deviation ``noise`` at f = 1."""
    return max(f * f * noise * noise, VARIANCE_MIN)


# --- update ----------------------------------------------------------------------------------------------------------
@inner
def update_scan(x, P, n, e, f, scan):
    """Fix n, e [m] of radar or LiDAR with error factor f = f(d)."""
    variance = white(f, scan.noise[0])
    z = (n, e)
    for i in range(2):  # numba would compile a call with a literal index once per index
        if not np.isnan(z[i]):
            _update_scan(x, P, i, z[i], f, variance)


@inner
def update_ais(x, P, n, e, psi, u, r, sensors):
    """Message with position [m], COG [rad], SOG [m/s] and ROT [rad/s]; NaN is "not available" and is skipped."""
    z = (n, e, psi, u, r)
    for i in range(5):
        innovation = z[i] - x[i] - x[7 + i]
        if not np.isnan(innovation):
            _update_ais(x, P, i, wrap(innovation) if i == 2 else innovation, sensors.ais_noise[_field(i)])


@scalar
def update_position(x, P, n, e, f, noise):
    """Fix n, e [m] into a static filter; noise is the white standard deviation [m] at f = 1."""
    gp = P[0] + f * P[1]
    gb = P[1] + f * P[2]
    s = 1.0 / (gp + f * gb + white(f, noise))
    dn = s * (n - x[0] - f * x[2])
    de = s * (e - x[1] - f * x[3])
    x[0] += gp * dn
    x[1] += gp * de
    x[2] += gb * dn
    x[3] += gb * de
    P[0] -= s * gp * gp
    P[1] -= s * gp * gb
    P[2] -= s * gb * gb


@scalar
def update_size(x, P, radius, f, noise):
    """Measured apparent radius [m] with error factor f; noise is the white standard deviation [m] at f = 1."""
    g0 = P[0] + f * P[1]
    g1 = P[1] + f * P[2]
    s = 1.0 / (g0 + f * g1 + white(f, noise))
    d = s * (radius - x[0] - f * x[1])
    x[0] += g0 * d
    x[1] += g1 * d
    P[0] -= s * g0 * g0
    P[1] -= s * g0 * g1
    P[2] -= s * g1 * g1


@inner
def _update_scan(x, P, i, z, f, variance):
    """Scalar update with z = x_i + f x_{7+i} + white noise."""
    k = 28 if i == 0 else 36
    g0, g1, g2, g3, g4, g5, g6 = column(P, i, k, f)
    g7 = P[28 + i] + f * P[35 if i == 0 else 43]
    g8 = P[36 + i] + f * P[43 if i == 0 else 44]
    s = 1.0 / ((g0 if i == 0 else g1) + f * (g7 if i == 0 else g8) + variance)
    d = s * (z - x[i] - f * x[7 + i])
    correct(x, P, s, d, g0, g1, g2, g3, g4, g5, g6)
    for row, g in ((28, g7), (36, g8)):
        correct_row(P, row, s * g, g0, g1, g2, g3, g4, g5, g6)
    P[35] -= s * g7 * g7
    P[43] -= s * g8 * g7
    P[44] -= s * g8 * g8
    x[7] += g7 * d
    x[8] += g8 * d


@inner
def _update_ais(x, P, i, innovation, noise):
    """Scalar update with measurement i of N, E, psi, u, r = x_i + x_{7+i} + white noise."""
    k = (7 + i) * (8 + i) // 2
    g0, g1, g2, g3, g4, g5, g6 = column(P, i, k, 1.0)
    g7 = P[28 + i] + P[k + 7]
    g8 = P[36 + i] + P[k + 8 if i >= 1 else 43]
    g9 = P[45 + i] + P[k + 9 if i >= 2 else 52 + i]
    g10 = P[55 + i] + P[k + 10 if i >= 3 else 62 + i]
    g11 = P[66 + i] + P[73 + i]
    own = P[i * (i + 1) // 2 + i] + 2.0 * P[k + i] + P[k + 7 + i]
    s = 1.0 / (own + white(1.0, noise))
    d = s * innovation
    correct(x, P, s, d, g0, g1, g2, g3, g4, g5, g6)
    for row, g in ((28, g7), (36, g8), (45, g9), (55, g10), (66, g11)):
        correct_row(P, row, s * g, g0, g1, g2, g3, g4, g5, g6)
    P[35] -= s * g7 * g7
    P[43], P[44] = P[43] - s * g8 * g7, P[44] - s * g8 * g8
    P[52], P[53], P[54] = P[52] - s * g9 * g7, P[53] - s * g9 * g8, P[54] - s * g9 * g9
    P[62], P[63], P[64] = P[62] - s * g10 * g7, P[63] - s * g10 * g8, P[64] - s * g10 * g9
    P[65] -= s * g10 * g10
    P[73], P[74], P[75] = P[73] - s * g11 * g7, P[74] - s * g11 * g8, P[75] - s * g11 * g9
    P[76], P[77] = P[76] - s * g11 * g10, P[77] - s * g11 * g11
    x[7] += g7 * d
    x[8] += g8 * d
    x[9] += g9 * d
    x[10] += g10 * d
    x[11] += g11 * d


# --- initialisation --------------------------------------------------------------------------------------------------
@scalar
def init_position(x, P, n, e, variance, cross, bias):
    """Static filter at n, e [m]; per axis the variance [m2], its covariance with the bias, the bias's deviation [m]."""
    x[0] = n
    x[1] = e
    x[2] = x[3] = 0.0
    P[0] = variance
    P[1] = cross
    P[2] = bias * bias


@inner
def expand(x, P):
    """Turn the static filter into one of motion, of which nothing is known yet."""
    bn, be, pp, pb, bb = x[2], x[3], P[0], P[1], P[2]
    for i in range(2, len(x)):
        x[i] = 0.0
    for i in range(len(P)):
        P[i] = 0.0
    x[7] = bn
    x[8] = be
    P[0] = P[2] = pp
    P[28] = P[37] = pb
    P[35] = P[44] = bb


@inner
def init_fix(x, P, n, e, f, noise, bias):
    """Static filter from one fix: position is known as well as the fix is, and wrong by just what the bias is."""
    init_position(x, P, n, e, white(f, noise) + f * f * bias * bias, -f * bias * bias, bias)


@inner
def init_scan_motion(x, P, n, e, f, psi, u, r, var_psi, var_u, var_r, sensors, scan):
    """Radar or LiDAR filter from one fix and a heading [rad], speed [m/s] and yaw rate [rad/s] known from elsewhere."""
    init_fix(x, P, n, e, f, scan.noise[0], scan.bias[0])
    expand(x, P)
    start_motion(x, P, psi, u, r, var_psi, var_u, var_r, sensors)


@inner
def init_ais(x, P, n, e, psi, u, r, sensors):
    """AIS filter from the first message.  r may be NaN; psi and u may not (see ``tracker.track_ais``)."""
    init_fix(x, P, n, e, 1.0, sensors.ais_noise[0], sensors.ais_bias[0])
    expand(x, P)
    rate = 0.0 if np.isnan(r) else r
    start_motion(x, P, psi, u, rate, 0.0, 0.0, YAW_RATE * YAW_RATE * sensors.inflation, sensors)
    for i in range(2, 5):
        noise, bias = sensors.ais_noise[_field(i)], sensors.ais_bias[_field(i)]
        k = (7 + i) * (8 + i) // 2
        P[k + 7 + i] = bias * bias
        if i < 4 or not np.isnan(r):
            P[i * (i + 1) // 2 + i] = white(1.0, noise) + bias * bias
            P[k + i] = -bias * bias


@inner
def init_size(x, P, radius, f, scan):
    """Size filter from the first measured radius [m]."""
    bias = scan.bias[1] * scan.bias[1]
    x[0] = radius
    x[1] = 0.0
    P[0] = white(f, scan.noise[1]) + f * f * bias
    P[1] = -f * bias
    P[2] = bias
