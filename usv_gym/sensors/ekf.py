"""The local extended Kalman filters of the Target Detection Module (thesis 3.2.1 and 3.2.2).

Model (thesis eq. 3.4, metres and radians): N' = u cos psi, E' = u sin psi, psi' = r, u' = b1, r' = b2.  b1, b2 and every
sensor bias are first-order Gauss-Markov processes (thesis 2.1), and only they are driven by noise.  Biases of a sensor
that a filter does not read never couple into it, so the thesis's 19-state filter falls apart exactly into

    AIS           [N, E, psi, u, r, b1, b2, bN, bE, bpsi, bu, br]   measures N, E, COG, SOG, ROT
    radar, LiDAR  [N, E, psi, u, r, b1, b2, bN, bE]                 measures N, E;  z = N + f bN + f v,  f = f(d) (2.4)
    size          [alpha, balpha]                                  measures the apparent radius;  z = alpha + f b + f v

Covariances are packed: lower triangle, row by row, entry (i, j <= i) at i (i + 1) / 2 + j.  The first n states are then the
first n (n + 1) / 2 numbers, and the AIS filter begins with a scan filter: 7 states of motion are 28 numbers in both.

``sensors`` is the record of that name in the world (process_u, process_r, process_time, inflation, ais_noise, ais_bias,
ais_bias_time), ``scan`` is ``sensors.radar`` or ``sensors.lidar`` (noise, bias, bias_time).  ``h`` is the time since the
filter's own time of validity [s].  ``x`` and ``P`` are 1-D arrays that are changed in place.

The same arrays hold the static filter of a target whose motion is unknown: states 2 to 6 and their covariances are zero,
and the two axes, which then do not couple, share one covariance.
"""

from __future__ import annotations

import math

import numpy as np

from ..jit import inner
from ..trig import sincos, wrap

#: Longest step of the mid-point rule [s], largest turn in it [rad], and shortest step, whatever a filter believes [s]
SUBSTEP, SUBTURN, SUBSTEP_MIN = 2.0, 0.1, 0.2
#: Standard deviation of a yaw rate of which nothing is known: 1 deg/s [rad/s]
YAW_RATE = math.radians(1.0)

_N, _E, _BN_N, _BN, _BE_E, _BE = 0, 2, 28, 35, 37, 44  # packed entries that the static filter uses


# --- prediction ------------------------------------------------------------------------------------------------------
@inner
def predict_motion(x, P, h, sensors):
    """Move the 7 states of motion and their covariance by h [s]: all that a copy for publication needs."""
    if h > 0.0:
        steps = substeps(h, x[4])
        a, c, q = _bias_step(h / steps, sensors)
        for _ in range(steps):
            A0, B0, A1, B1 = _move(x, h / steps, a, c, q)
            _propagate(P, h / steps, a, c, q, A0, B0, A1, B1, sensors)


@inner
def predict_scan(x, P, h, sensors, scan):
    """Move a radar or LiDAR filter by h [s]."""
    if h > 0.0:
        steps = substeps(h, x[4])
        g = h / steps
        a, c, q = _bias_step(g, sensors)
        ab = math.exp(-g / scan.bias_time[0])
        for _ in range(steps):
            A0, B0, A1, B1 = _move(x, g, a, c, q)
            _propagate(P, g, a, c, q, A0, B0, A1, B1, sensors)
            _propagate_row(P, 28, ab, g, a, c, q, A0, B0, A1, B1)
            _propagate_row(P, 36, ab, g, a, c, q, A0, B0, A1, B1)
        a = math.exp(-h / scan.bias_time[0])
        v = scan.bias[0] * scan.bias[0] * (1.0 - a * a)
        x[7] *= a
        x[8] *= a
        P[35] = a * a * P[35] + v
        P[43] *= a * a
        P[44] = a * a * P[44] + v


@inner
def predict_ais(x, P, h, sensors):
    """Move an AIS filter by h [s]."""
    if h > 0.0:
        steps = substeps(h, x[4])
        g = h / steps
        a, c, q = _bias_step(g, sensors)
        for _ in range(steps):
            A0, B0, A1, B1 = _move(x, g, a, c, q)
            _propagate(P, g, a, c, q, A0, B0, A1, B1, sensors)
            for i in range(7, 12):
                _propagate_row(P, i * (i + 1) // 2, 1.0, g, a, c, q, A0, B0, A1, B1)
        T = 0.0
        for i in range(7, 12):
            k = i * (i + 1) // 2
            if sensors.ais_bias_time[_field(i - 7)] != T:  # most are equal, and an exponential is dear
                T = sensors.ais_bias_time[_field(i - 7)]
                a = math.exp(-h / T)
            x[i] *= a
            for j in range(k, k + i):
                P[j] *= a
            for j in range(i, 12):  # its column below the diagonal, and the diagonal
                P[j * (j + 1) // 2 + i] *= a
            b = sensors.ais_bias[_field(i - 7)]
            P[k + i] = P[k + i] * a + b * b * (1.0 - a * a)


@inner
def predict_position(x, P, h, bias, bias_time):
    """Move a static filter by h [s]: only its sensor biases (standard deviation [m], time constant [s]) change."""
    if h > 0.0:
        a = math.exp(-h / bias_time)
        x[7] *= a
        x[8] *= a
        P[_BN_N] = P[_BE_E] = a * P[_BN_N]
        P[_BN] = P[_BE] = a * a * P[_BN] + bias * bias * (1.0 - a * a)


@inner
def predict_size(x, P, h, scan):
    """Move a size filter by h [s]: the radius is constant, its bias is not."""
    if h > 0.0:
        a = math.exp(-h / scan.bias_time[1])
        x[1] *= a
        P[1] *= a
        P[2] = a * a * P[2] + scan.bias[1] * scan.bias[1] * (1.0 - a * a)


@inner
def substeps(h, r):
    """Number of equal steps into which h [s] is cut at a yaw rate of r [rad/s].

    The chord of an arc is too long by u r^2 h^3 / 24; in 2 s at 1 deg/s that is nothing, at 10 deg/s it is a LiDAR's noise.
    """
    return math.ceil(h * min(max(1.0 / SUBSTEP, abs(r) / SUBTURN), 1.0 / SUBSTEP_MIN))


@inner
def _bias_step(h, sensors):
    """Over h [s]: decay a of b1 and b2, the integral c of that decay, and the second integral q."""
    T = sensors.process_time
    c = -T * math.expm1(-h / T)
    return 1.0 - c / T, c, T * (h - c)


@inner
def _move(x, h, a, c, q):
    """One step of the motion.  The linear part (psi, u, r, b) is exact, the position follows the mid-point rule.

    Returns the derivatives of N (A0, B0) and E (A1, B1) with respect to mid-point heading and speed.
    """
    speed = x[3] + 0.5 * h * x[5]
    s, co = sincos(x[2] + 0.5 * h * x[4])
    B0 = h * co
    B1 = h * s
    x[0] += B0 * speed
    x[1] += B1 * speed
    x[2] += h * x[4] + q * x[6]
    x[3] += c * x[5]
    x[4] += c * x[6]
    x[5] *= a
    x[6] *= a
    return -B1 * speed, B0, B0 * speed, B1


@inner
def _propagate(P, h, a, c, q, A0, B0, A1, B1, sensors):
    """P := F P F' + Q of the 7 states of motion, F the Jacobian of ``_move``.

    F is a product of elementary row operations: N, E, psi, u, r in this order each gain a multiple of states behind them.
    ``m`` and ``w`` are the covariances of the mid-point heading and speed with all states.
    """
    (p00, p10, p11, p20, p21, p22, p30, p31, p32, p33) = (P[0], P[1], P[2], P[3], P[4], P[5], P[6], P[7], P[8], P[9])
    (p40, p41, p42, p43, p44) = (P[10], P[11], P[12], P[13], P[14])
    (p50, p51, p52, p53, p54, p55) = (P[15], P[16], P[17], P[18], P[19], P[20])
    (p60, p61, p62, p63, p64, p65, p66) = (P[21], P[22], P[23], P[24], P[25], P[26], P[27])
    # b1, b2 are driven half before and half after the step; their variance q T / 2 (1 - a^2) over it is exact
    d = 0.5 * (1.0 - a * a) / (1.0 + a * a) * sensors.process_time * sensors.inflation
    p55 += d * sensors.process_u
    p66 += d * sensors.process_r
    g = 0.5 * h
    m0, m1, m2, m3, m4, m5, m6 = (
        p20 + g * p40, p21 + g * p41, p22 + g * p42, p32 + g * p43, p42 + g * p44, p52 + g * p54, p62 + g * p64,
    )  # fmt: skip
    w0, w1, w2, w3, w4, w5, w6 = (
        p30 + g * p50, p31 + g * p51, p32 + g * p52, p33 + g * p53, p43 + g * p54, p53 + g * p55, p63 + g * p65,
    )  # fmt: skip
    mm, mw, ww = m2 + g * m4, m3 + g * m5, w3 + g * w5
    im, iw = A0 * mm + B0 * mw, A0 * mw + B0 * ww  # what N gains, with the mid-point heading and speed
    p00 += 2.0 * (A0 * m0 + B0 * w0) + A0 * im + B0 * iw
    p10 += A0 * m1 + B0 * w1 + A1 * m0 + B1 * w0 + A1 * im + B1 * iw
    p11 += 2.0 * (A1 * m1 + B1 * w1) + A1 * (A1 * mm + B1 * mw) + B1 * (A1 * mw + B1 * ww)
    p20, p21 = p20 + A0 * m2 + B0 * w2, p21 + A1 * m2 + B1 * w2
    p30, p31 = p30 + A0 * m3 + B0 * w3, p31 + A1 * m3 + B1 * w3
    p40, p41 = p40 + A0 * m4 + B0 * w4, p41 + A1 * m4 + B1 * w4
    p50, p51 = p50 + A0 * m5 + B0 * w5, p51 + A1 * m5 + B1 * w5
    p60, p61 = p60 + A0 * m6 + B0 * w6, p61 + A1 * m6 + B1 * w6
    # psi += h r + q b2
    n42, n62 = p42 + h * p44 + q * p64, p62 + h * p64 + q * p66
    p22 += h * (p42 + n42) + q * (p62 + n62)
    p20 += h * p40 + q * p60
    p21 += h * p41 + q * p61
    p32 += h * p43 + q * p63
    p52 += h * p54 + q * p65
    # u += c b1
    n53 = p53 + c * p55
    p33 += c * (p53 + n53)
    p30 += c * p50
    p31 += c * p51
    p32 += c * p52
    p43 += c * p54
    p63 += c * p65
    # r += c b2
    n64 = p64 + c * p66
    p44 += c * (p64 + n64)
    p40 += c * p60
    p41 += c * p61
    n42 += c * n62
    p43 += c * p63
    p54 += c * p65
    (P[0], P[1], P[2], P[3], P[4], P[5], P[6], P[7], P[8], P[9]) = (p00, p10, p11, p20, p21, p22, p30, p31, p32, p33)
    (P[10], P[11], P[12], P[13], P[14]) = (p40, p41, n42, p43, p44)
    # b1, b2 decay
    (P[15], P[16], P[17], P[18], P[19]) = (a * p50, a * p51, a * p52, a * n53, a * p54)
    (P[21], P[22], P[23], P[24], P[25]) = (a * p60, a * p61, a * n62, a * p63, a * n64)
    P[20] = a * a * p55 + d * sensors.process_u
    P[26] = a * a * p65
    P[27] = a * a * p66 + d * sensors.process_r


@inner
def _propagate_row(P, k, ab, h, a, c, q, A0, B0, A1, B1):
    """The 7 covariances from P[k] on of one sensor bias (decay ab) with the motion: row := ab F row."""
    p2, p3, p4, p5, p6 = P[k + 2], P[k + 3], P[k + 4], P[k + 5], P[k + 6]
    m, w = p2 + 0.5 * h * p4, p3 + 0.5 * h * p5
    P[k] = ab * (P[k] + A0 * m + B0 * w)
    P[k + 1] = ab * (P[k + 1] + A1 * m + B1 * w)
    P[k + 2] = ab * (p2 + h * p4 + q * p6)
    P[k + 3] = ab * (p3 + c * p5)
    P[k + 4] = ab * (p4 + c * p6)
    P[k + 5] = ab * a * p5
    P[k + 6] = ab * a * p6


@inner
def _field(i):
    """Index of measurement i = N, E, psi, u, r among the AIS fields, which are N, E, COG, heading, SOG, ROT."""
    return i if i < 3 else i + 1


# --- update ----------------------------------------------------------------------------------------------------------
@inner
def update_scan(x, P, n, e, f, scan):
    """Fix n, e [m] of radar or LiDAR with error factor f = f(d)."""
    variance = f * f * scan.noise[0] * scan.noise[0]
    _update_scan(x, P, 0, n, f, variance)
    _update_scan(x, P, 1, e, f, variance)


@inner
def update_ais(x, P, n, e, psi, u, r, sensors):
    """Message with position [m], COG [rad], SOG [m/s] and ROT [rad/s]; NaN is "not available" and is skipped."""
    z = (n, e, psi, u, r)
    for i in range(5):
        innovation = z[i] - x[i] - x[7 + i]
        if not np.isnan(innovation):
            _update_ais(x, P, i, wrap(innovation) if i == 2 else innovation, sensors.ais_noise[_field(i)])


@inner
def update_position(x, P, n, e, f, noise):
    """Fix n, e [m] into a static filter; noise is the white standard deviation [m] at f = 1."""
    g0 = P[_N] + f * P[_BN_N]
    g7 = P[_BN_N] + f * P[_BN]
    s = 1.0 / (g0 + f * g7 + f * f * noise * noise)
    dn = s * (n - x[0] - f * x[7])
    de = s * (e - x[1] - f * x[8])
    x[0] += g0 * dn
    x[1] += g0 * de
    x[7] += g7 * dn
    x[8] += g7 * de
    P[_N] = P[_E] = P[_N] - s * g0 * g0
    P[_BN_N] = P[_BE_E] = P[_BN_N] - s * g0 * g7
    P[_BN] = P[_BE] = P[_BN] - s * g7 * g7


@inner
def update_size(x, P, radius, f, scan):
    """Measured apparent radius [m] with error factor f."""
    g0 = P[0] + f * P[1]
    g1 = P[1] + f * P[2]
    s = 1.0 / (g0 + f * g1 + f * f * scan.noise[1] * scan.noise[1])
    d = s * (radius - x[0] - f * x[1])
    x[0] += g0 * d
    x[1] += g1 * d
    P[0] -= s * g0 * g0
    P[1] -= s * g0 * g1
    P[2] -= s * g1 * g1


@inner
def _update_scan(x, P, i, z, f, variance):
    """Scalar update with z = x_i + f x_{7+i} + white noise."""
    if np.isnan(z):
        return
    k = 28 if i == 0 else 36
    g0, g1, g2, g3, g4, g5, g6 = _column(P, i, k, f)
    g7 = P[28 + i] + f * P[35 if i == 0 else 43]
    g8 = P[36 + i] + f * P[43 if i == 0 else 44]
    s = 1.0 / ((g0 if i == 0 else g1) + f * (g7 if i == 0 else g8) + variance)
    d = s * (z - x[i] - f * x[7 + i])
    _correct(x, P, s, d, g0, g1, g2, g3, g4, g5, g6)
    _correct_row(P, 28, s * g7, g0, g1, g2, g3, g4, g5, g6)
    P[35] -= s * g7 * g7
    _correct_row(P, 36, s * g8, g0, g1, g2, g3, g4, g5, g6)
    P[43] -= s * g8 * g7
    P[44] -= s * g8 * g8
    x[7] += g7 * d
    x[8] += g8 * d


@inner
def _update_ais(x, P, i, innovation, noise):
    """Scalar update with measurement i of N, E, psi, u, r = x_i + x_{7+i} + white noise."""
    k = (7 + i) * (8 + i) // 2
    g0, g1, g2, g3, g4, g5, g6 = _column(P, i, k, 1.0)
    g7 = P[28 + i] + P[k + 7]
    g8 = P[36 + i] + P[k + 8 if i >= 1 else 43]
    g9 = P[45 + i] + P[k + 9 if i >= 2 else 52 + i]
    g10 = P[55 + i] + P[k + 10 if i >= 3 else 62 + i]
    g11 = P[66 + i] + P[73 + i]
    own = P[i * (i + 1) // 2 + i] + 2.0 * P[k + i] + P[k + 7 + i]
    s = 1.0 / (own + noise * noise)
    d = s * innovation
    _correct(x, P, s, d, g0, g1, g2, g3, g4, g5, g6)
    _correct_row(P, 28, s * g7, g0, g1, g2, g3, g4, g5, g6)
    _correct_row(P, 36, s * g8, g0, g1, g2, g3, g4, g5, g6)
    _correct_row(P, 45, s * g9, g0, g1, g2, g3, g4, g5, g6)
    _correct_row(P, 55, s * g10, g0, g1, g2, g3, g4, g5, g6)
    _correct_row(P, 66, s * g11, g0, g1, g2, g3, g4, g5, g6)
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


@inner
def _column(P, i, k, f):
    """Covariance of the 7 states of motion with state i (0 to 4) plus f times the bias whose row begins at P[k]."""
    row = i * (i + 1) // 2
    return (
        P[row] + f * P[k],
        P[row + 1 if i >= 1 else 1] + f * P[k + 1],
        P[row + 2 if i >= 2 else 3 + i] + f * P[k + 2],
        P[row + 3 if i >= 3 else 6 + i] + f * P[k + 3],
        P[10 + i] + f * P[k + 4],
        P[15 + i] + f * P[k + 5],
        P[21 + i] + f * P[k + 6],
    )


@inner
def _correct(x, P, s, d, g0, g1, g2, g3, g4, g5, g6):
    """x += g d and P -= s g g' of the 7 states of motion."""
    P[0] -= s * g0 * g0
    t = s * g1
    P[1], P[2] = P[1] - t * g0, P[2] - t * g1
    t = s * g2
    P[3], P[4], P[5] = P[3] - t * g0, P[4] - t * g1, P[5] - t * g2
    t = s * g3
    P[6], P[7], P[8], P[9] = P[6] - t * g0, P[7] - t * g1, P[8] - t * g2, P[9] - t * g3
    t = s * g4
    P[10], P[11], P[12], P[13], P[14] = (
        P[10] - t * g0, P[11] - t * g1, P[12] - t * g2, P[13] - t * g3, P[14] - t * g4,
    )  # fmt: skip
    t = s * g5
    P[15], P[16], P[17], P[18], P[19], P[20] = (
        P[15] - t * g0, P[16] - t * g1, P[17] - t * g2, P[18] - t * g3, P[19] - t * g4, P[20] - t * g5,
    )  # fmt: skip
    _correct_row(P, 21, s * g6, g0, g1, g2, g3, g4, g5, g6)
    x[0] += g0 * d
    x[1] += g1 * d
    x[2] += g2 * d
    x[3] += g3 * d
    x[4] += g4 * d
    x[5] += g5 * d
    x[6] += g6 * d


@inner
def _correct_row(P, k, t, g0, g1, g2, g3, g4, g5, g6):
    """Seven covariances from P[k] on: row -= t g."""
    P[k] -= t * g0
    P[k + 1] -= t * g1
    P[k + 2] -= t * g2
    P[k + 3] -= t * g3
    P[k + 4] -= t * g4
    P[k + 5] -= t * g5
    P[k + 6] -= t * g6


# --- initialisation --------------------------------------------------------------------------------------------------
@inner
def init_position(x, P, n, e, variance, cross, bias):
    """Static filter at n, e [m]: variance [m2] per axis, its covariance with the bias, standard deviation of the bias."""
    x[:] = 0.0
    P[:] = 0.0
    x[0] = n
    x[1] = e
    P[_N] = P[_E] = variance
    P[_BN_N] = P[_BE_E] = cross
    P[_BN] = P[_BE] = bias * bias


@inner
def init_fix(x, P, n, e, f, noise, bias):
    """Static filter from one fix: position is known as well as the fix is, and wrong by just what the bias is."""
    init_position(x, P, n, e, f * f * (noise * noise + bias * bias), -f * bias * bias, bias)


@inner
def init_scan_motion(x, P, n, e, f, psi, u, r, var_psi, var_u, var_r, sensors, scan):
    """Radar or LiDAR filter from one fix and a heading [rad], speed [m/s] and yaw rate [rad/s] known from elsewhere."""
    init_fix(x, P, n, e, f, scan.noise[0], scan.bias[0])
    start_motion(x, P, psi, u, r, var_psi, var_u, var_r, sensors)


@inner
def init_ais(x, P, n, e, psi, u, r, sensors):
    """AIS filter from the first message.  r may be NaN; psi and u may not (see ``tracker.track_ais``)."""
    init_fix(x, P, n, e, 1.0, sensors.ais_noise[0], sensors.ais_bias[0])
    rate = 0.0 if np.isnan(r) else r
    start_motion(x, P, psi, u, rate, 0.0, 0.0, YAW_RATE * YAW_RATE * sensors.inflation, sensors)
    for i in range(2, 5):
        noise, bias = sensors.ais_noise[_field(i)], sensors.ais_bias[_field(i)]
        k = (7 + i) * (8 + i) // 2
        P[k + 7 + i] = bias * bias
        if i < 4 or not np.isnan(r):
            P[i * (i + 1) // 2 + i] = noise * noise + bias * bias
            P[k + i] = -bias * bias


@inner
def init_size(x, P, radius, f, scan):
    """Size filter from the first measured radius [m]."""
    bias = scan.bias[1] * scan.bias[1]
    x[0] = radius
    x[1] = 0.0
    P[0] = f * f * (scan.noise[1] * scan.noise[1] + bias)
    P[1] = -f * bias
    P[2] = bias


@inner
def start_motion(x, P, psi, u, r, var_psi, var_u, var_r, sensors):
    """Heading, speed and yaw rate of a filter that knew its position only; b1, b2 start at their stationary variance."""
    x[2] = psi
    x[3] = u
    x[4] = r
    P[5] = var_psi
    P[9] = var_u
    P[14] = var_r
    P[20] = 0.5 * sensors.process_u * sensors.process_time * sensors.inflation
    P[27] = 0.5 * sensors.process_r * sensors.process_time * sensors.inflation
