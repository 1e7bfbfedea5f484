"""The 7 states of motion that all local filters of a target share, and their packed covariance.

[N, E, psi, u, r, b1, b2]: N' = u cos psi, E' = u sin psi, psi' = r, u' = b1, r' = b2 (thesis eq. 3.4, in metres and
radians); b1 and b2 are first-order Gauss-Markov processes with time constant ``process_time``, driven by white noise of
the spectral densities ``process_u`` and ``process_r``.  Layout of covariances and the record ``sensors``: see ``ekf``,
which adds the biases of a sensor.  Straight-line code on scalars, because it is several times faster than loops.
"""

from __future__ import annotations

import math

from ..jit import fma, inner
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
        fma(g, p40, p20), fma(g, p41, p21), fma(g, p42, p22), fma(g, p43, p32), fma(g, p44, p42), fma(g, p54, p52),
        fma(g, p64, p62),
    )  # fmt: skip
    w0, w1, w2, w3, w4, w5, w6 = (
        fma(g, p50, p30), fma(g, p51, p31), fma(g, p52, p32), fma(g, p53, p33), fma(g, p54, p43), fma(g, p55, p53),
        fma(g, p65, p63),
    )  # fmt: skip
    mm, mw, ww = fma(g, m4, m2), fma(g, m5, m3), fma(g, w5, w3)
    im, iw = fma(A0, mm, B0 * mw), fma(A0, mw, B0 * ww)  # what N gains, with the mid-point heading and speed
    p00 += fma(A0, fma(2.0, m0, im), B0 * fma(2.0, w0, iw))
    p10 = fma(A0, m1, fma(B0, w1, fma(A1, m0 + im, fma(B1, w0 + iw, p10))))
    jm, jw = fma(A1, mm, B1 * mw), fma(A1, mw, B1 * ww)
    p11 += fma(A1, fma(2.0, m1, jm), B1 * fma(2.0, w1, jw))
    p20, p21 = fma(B0, w2, fma(A0, m2, p20)), fma(B1, w2, fma(A1, m2, p21))
    p30, p31 = fma(B0, w3, fma(A0, m3, p30)), fma(B1, w3, fma(A1, m3, p31))
    p40, p41 = fma(B0, w4, fma(A0, m4, p40)), fma(B1, w4, fma(A1, m4, p41))
    p50, p51 = fma(B0, w5, fma(A0, m5, p50)), fma(B1, w5, fma(A1, m5, p51))
    p60, p61 = fma(B0, w6, fma(A0, m6, p60)), fma(B1, w6, fma(A1, m6, p61))
    # psi += h r + q b2
    n42, n62 = fma(q, p64, fma(h, p44, p42)), fma(q, p66, fma(h, p64, p62))
    p22 = fma(h, p42 + n42, fma(q, p62 + n62, p22))
    p20 = fma(q, p60, fma(h, p40, p20))
    p21 = fma(q, p61, fma(h, p41, p21))
    p32 = fma(q, p63, fma(h, p43, p32))
    p52 = fma(q, p65, fma(h, p54, p52))
    # u += c b1
    n53 = fma(c, p55, p53)
    p33 = fma(c, p53 + n53, p33)
    p30 = fma(c, p50, p30)
    p31 = fma(c, p51, p31)
    p32 = fma(c, p52, p32)
    p43 = fma(c, p54, p43)
    p63 = fma(c, p65, p63)
    # r += c b2
    n64 = fma(c, p66, p64)
    p44 = fma(c, p64 + n64, p44)
    p40 = fma(c, p60, p40)
    p41 = fma(c, p61, p41)
    n42 = fma(c, n62, n42)
    p43 = fma(c, p63, p43)
    p54 = fma(c, p65, p54)
    (P[0], P[1], P[2], P[3], P[4], P[5], P[6], P[7], P[8], P[9]) = (p00, p10, p11, p20, p21, p22, p30, p31, p32, p33)
    (P[10], P[11], P[12], P[13], P[14]) = (p40, p41, n42, p43, p44)
    # b1, b2 decay and are driven: stationary variance q T / 2
    d = 0.5 * (1.0 - a * a) * sensors.process_time * sensors.inflation
    (P[15], P[16], P[17], P[18], P[19]) = (a * p50, a * p51, a * p52, a * n53, a * p54)
    (P[21], P[22], P[23], P[24], P[25]) = (a * p60, a * p61, a * n62, a * p63, a * n64)
    P[20] = fma(a * a, p55, d * sensors.process_u)
    P[26] = a * a * p65
    P[27] = fma(a * a, p66, d * sensors.process_r)


@inner
def _propagate_row(P, k, h, a, c, q, A0, B0, A1, B1):
    """row := F row of the 7 covariances from P[k] on of a sensor bias with the motion."""
    p2, p3, p4, p5, p6 = P[k + 2], P[k + 3], P[k + 4], P[k + 5], P[k + 6]
    m, w = p2 + 0.5 * h * p4, p3 + 0.5 * h * p5
    P[k] = fma(B0, w, fma(A0, m, P[k]))
    P[k + 1] = fma(B1, w, fma(A1, m, P[k + 1]))
    P[k + 2] = fma(q, p6, fma(h, p4, p2))
    P[k + 3] = fma(c, p5, p3)
    P[k + 4] = fma(c, p6, p4)
    P[k + 5] = a * p5
    P[k + 6] = a * p6


@inner
def column(P, i, k, f):
    """Covariance of the 7 states of motion with state i (0 to 4) plus f times the bias whose row begins at P[k]."""
    row = i * (i + 1) // 2
    return (
        fma(f, P[k], P[row]),
        fma(f, P[k + 1], P[row + 1 if i >= 1 else 1]),
        fma(f, P[k + 2], P[row + 2 if i >= 2 else 3 + i]),
        fma(f, P[k + 3], P[row + 3 if i >= 3 else 6 + i]),
        fma(f, P[k + 4], P[10 + i]),
        fma(f, P[k + 5], P[15 + i]),
        fma(f, P[k + 6], P[21 + i]),
    )


@inner
def correct(x, P, s, d, g0, g1, g2, g3, g4, g5, g6):
    """x += g d and P -= s g g' of the 7 states of motion."""
    P[0] = fma(-s * g0, g0, P[0])
    t = s * g1
    P[1], P[2] = fma(-t, g0, P[1]), fma(-t, g1, P[2])
    t = s * g2
    P[3], P[4], P[5] = fma(-t, g0, P[3]), fma(-t, g1, P[4]), fma(-t, g2, P[5])
    t = s * g3
    P[6], P[7], P[8], P[9] = fma(-t, g0, P[6]), fma(-t, g1, P[7]), fma(-t, g2, P[8]), fma(-t, g3, P[9])
    t = s * g4
    P[10], P[11], P[12], P[13], P[14] = (
        fma(-t, g0, P[10]), fma(-t, g1, P[11]), fma(-t, g2, P[12]), fma(-t, g3, P[13]), fma(-t, g4, P[14]),
    )  # fmt: skip
    t = s * g5
    P[15], P[16], P[17], P[18], P[19], P[20] = (
        fma(-t, g0, P[15]), fma(-t, g1, P[16]), fma(-t, g2, P[17]), fma(-t, g3, P[18]), fma(-t, g4, P[19]), fma(-t, g5, P[20]),
    )  # fmt: skip
    correct_row(P, 21, s * g6, g0, g1, g2, g3, g4, g5, g6)
    x[0] = fma(g0, d, x[0])
    x[1] = fma(g1, d, x[1])
    x[2] = fma(g2, d, x[2])
    x[3] = fma(g3, d, x[3])
    x[4] = fma(g4, d, x[4])
    x[5] = fma(g5, d, x[5])
    x[6] = fma(g6, d, x[6])


@inner
def correct_row(P, k, t, g0, g1, g2, g3, g4, g5, g6):
    """Seven covariances from P[k] on: row -= t g."""
    P[k] = fma(-t, g0, P[k])
    P[k + 1] = fma(-t, g1, P[k + 1])
    P[k + 2] = fma(-t, g2, P[k + 2])
    P[k + 3] = fma(-t, g3, P[k + 3])
    P[k + 4] = fma(-t, g4, P[k + 4])
    P[k + 5] = fma(-t, g5, P[k + 5])
    P[k + 6] = fma(-t, g6, P[k + 6])
