"""The 7 states of motion that all local filters of a target share, and their packed covariance.

[N, E, psi, u, r, b1, b2]: N' = u cos psi, E' = u sin psi, psi' = r, u' = b1, r' = b2 (thesis eq. 3.4, in metres and
radians); b1 and b2 are first-order Gauss-Markov processes with time constant ``process_time``, driven by white noise of
the spectral densities ``process_u`` and ``process_r``.  Layout of covariances and the record ``sensors``: see ``ekf``,
which adds the biases of a sensor.  Straight-line code on scalars, because it is several times faster than loops.
"""

from __future__ import annotations

import math

from ..jit import inner
from ..trig import sincos

#: Longest step of the mid-point rule [s], largest turn in it [rad], and shortest step, whatever a filter believes [s]
SUBSTEP, SUBTURN, SUBSTEP_MIN = 2.0, 0.1, 0.2


@inner
def start_motion(x, P, psi, u, r, var_psi, var_u, var_r, sensors):
    """Give a static filter a heading, speed and yaw rate; b1 and b2 start at their stationary variance."""
    x[2] = psi
    x[3] = u
    x[4] = r
    P[5] = var_psi
    P[9] = var_u
    P[14] = var_r
    P[20] = 0.5 * sensors.process_u * sensors.process_time * sensors.inflation
    P[27] = 0.5 * sensors.process_r * sensors.process_time * sensors.inflation


@inner
def predict_motion(x, P, n, h, sensors):
    """Move the motion by h >= 0 [s], with its covariance and that with the biases 7 to n - 1 (which stand still here).

    n = 7 is all that a copy for publication needs.
    """
    if h > 0.0:
        steps = substeps(h, x[4])
        g = h / steps
        a, c, q = _bias_step(g, sensors)
        for _ in range(steps):
            A0, B0, A1, B1 = _move(x, g, a, c, q)
            _propagate(P, g, a, c, q, A0, B0, A1, B1, sensors)
            for i in range(7, n):
                _propagate_row(P, i * (i + 1) // 2, g, a, c, q, A0, B0, A1, B1)


@inner
def substeps(h, r):
    """Number of equal steps into which h [s] is cut at a yaw rate of r [rad/s].

    The mid-point rule takes an arc for a straight line, too long by u r^2 h^3 / 24.  In 2 s at 5 m/s this is 0.5 mm for
    a turn of 1 deg/s, and 5 cm, which a LiDAR would notice, for one of 10 deg/s.
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

    F is a product of elementary row operations: N, E, psi, u, r in this order gain multiples of states behind them.
    ``m`` and ``w`` are the covariances of the mid-point heading and speed with all states.
    """
    (p00, p10, p11, p20, p21, p22, p30, p31, p32, p33) = (P[0], P[1], P[2], P[3], P[4], P[5], P[6], P[7], P[8], P[9])
    (p40, p41, p42, p43, p44) = (P[10], P[11], P[12], P[13], P[14])
    (p50, p51, p52, p53, p54, p55) = (P[15], P[16], P[17], P[18], P[19], P[20])
    (p60, p61, p62, p63, p64, p65, p66) = (P[21], P[22], P[23], P[24], P[25], P[26], P[27])
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
    # b1, b2 decay and are driven: stationary variance q T / 2
    d = 0.5 * (1.0 - a * a) * sensors.process_time * sensors.inflation
    (P[15], P[16], P[17], P[18], P[19]) = (a * p50, a * p51, a * p52, a * n53, a * p54)
    (P[21], P[22], P[23], P[24], P[25]) = (a * p60, a * p61, a * n62, a * p63, a * n64)
    P[20] = a * a * p55 + d * sensors.process_u
    P[26] = a * a * p65
    P[27] = a * a * p66 + d * sensors.process_r


@inner
def _propagate_row(P, k, h, a, c, q, A0, B0, A1, B1):
    """row := F row of the 7 covariances from P[k] on of a sensor bias with the motion."""
    p2, p3, p4, p5, p6 = P[k + 2], P[k + 3], P[k + 4], P[k + 5], P[k + 6]
    m, w = p2 + 0.5 * h * p4, p3 + 0.5 * h * p5
    P[k] += A0 * m + B0 * w
    P[k + 1] += A1 * m + B1 * w
    P[k + 2] = p2 + h * p4 + q * p6
    P[k + 3] = p3 + c * p5
    P[k + 4] = p4 + c * p6
    P[k + 5] = a * p5
    P[k + 6] = a * p6


@inner
def column(P, i, k, f):
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
def correct(x, P, s, d, g0, g1, g2, g3, g4, g5, g6):
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
    correct_row(P, 21, s * g6, g0, g1, g2, g3, g4, g5, g6)
    x[0] += g0 * d
    x[1] += g1 * d
    x[2] += g2 * d
    x[3] += g3 * d
    x[4] += g4 * d
    x[5] += g5 * d
    x[6] += g6 * d


@inner
def correct_row(P, k, t, g0, g1, g2, g3, g4, g5, g6):
    """Seven covariances from P[k] on: row -= t g."""
    P[k] -= t * g0
    P[k + 1] -= t * g1
    P[k + 2] -= t * g2
    P[k + 3] -= t * g3
    P[k + 4] -= t * g4
    P[k + 5] -= t * g5
    P[k + 6] -= t * g6
