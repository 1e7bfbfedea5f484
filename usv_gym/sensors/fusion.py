"""Simple Fusion (thesis 3.2): the average of local estimates, weighted with the inverses of their covariances.

    P = (sum P_i^-1)^-1,   x = P sum P_i^-1 x_i

over [N, E, psi, u, r], the states that every local filter shares and a controller needs; the apparent radius is fused
on its own, since nothing couples it to the motion.  b1 and b2 stay out: 5x5 marginals are less optimistic than 8x8.

The rule takes the estimates for independent, but they watched the same manoeuvres: its covariance is optimistic.  With
AIS, radar and LiDAR the normalised squared error is 1.3 to 1.5 times what it should be (docs/tracking.md); inflation =
number of sensors in the parameters of the local filters (Carlson 1990) corrects it.

Two estimates are one Kalman update, x + P (P + Q)^-1 (y - x), and three are two of them: no inverse is needed, and a
filter that knows its position only is the same update with two rows.  Covariances are packed as in ``ekf``.
"""

from __future__ import annotations

from ..jit import inner
from ..trig import wrap
from ..world.state import PHASE_MOTION, PHASE_NONE


@inner
def fuse(x, P, phase, y, Q, other):
    """Fuse estimate y, Q of phase ``other`` into x, P of phase ``phase``; returns the phase of the result.

    The leading 5 numbers of x, y are [N, E, psi, u, r], the leading 15 of P, Q their packed covariance; both are copies
    predicted to one time, see ``tracker.predicted``.  y and Q are not changed.  PHASE_NONE means no information,
    PHASE_POSITION none but on N, E.  psi comes out unwrapped, near that of x.
    """
    if other == PHASE_NONE:
        return phase
    if phase == PHASE_MOTION and other == PHASE_MOTION:
        _fuse_motion(x, P, y, Q)
        return phase
    n, e, nn, ne, ee = x[0], x[1], P[0], P[1], P[2]
    if other == PHASE_MOTION or phase == PHASE_NONE:
        for i in range(5):
            x[i] = y[i]
        for i in range(15):
            P[i] = Q[i]
        if phase != PHASE_NONE:
            _fuse_position(x, P, n, e, nn, ne, ee)
        return other
    _fuse_position(x, P, y[0], y[1], Q[0], Q[1], Q[2])
    return phase


@inner
def fuse_size(radius, variance, other, other_variance):
    """Radius [m] and variance [m2] of two estimates of the apparent radius."""
    w = variance / (variance + other_variance)
    return radius + w * (other - radius), variance - w * variance


@inner
def _fuse_position(x, P, n, e, nn, ne, ee):
    """Kalman update with a position whose covariance is nn, ne, ee: first N, then what E says beyond it."""
    s = 1.0 / (P[0] + nn)
    k = (P[1] + ne) * s
    t = 1.0 / (P[2] + ee - k * (P[1] + ne))
    dn = n - x[0]
    de = e - x[1] - k * dn
    a0, a1, a2, a3, a4 = P[0], P[1], P[3], P[6], P[10]
    b0, b1, b2, b3, b4 = P[1] - k * a0, P[2] - k * a1, P[4] - k * a2, P[7] - k * a3, P[11] - k * a4
    _downdate(x, P, s, dn, a0, a1, a2, a3, a4)
    _downdate(x, P, t, de, b0, b1, b2, b3, b4)


@inner
def _fuse_motion(x, P, y, Q):
    """Kalman update with all five states: S = P + Q = L D L', and every row of L^-1 P is one rank-one update."""
    s00, s10, s11 = P[0] + Q[0], P[1] + Q[1], P[2] + Q[2]
    s20, s21, s22 = P[3] + Q[3], P[4] + Q[4], P[5] + Q[5]
    s30, s31, s32, s33 = P[6] + Q[6], P[7] + Q[7], P[8] + Q[8], P[9] + Q[9]
    s40, s41, s42, s43, s44 = P[10] + Q[10], P[11] + Q[11], P[12] + Q[12], P[13] + Q[13], P[14] + Q[14]
    # s becomes D (as inverses d) and L D below the diagonal; l is L
    d0 = 1.0 / s00
    l10, l20, l30, l40 = s10 * d0, s20 * d0, s30 * d0, s40 * d0
    d1 = 1.0 / (s11 - l10 * s10)
    s21, s31, s41 = s21 - l20 * s10, s31 - l30 * s10, s41 - l40 * s10
    l21, l31, l41 = s21 * d1, s31 * d1, s41 * d1
    d2 = 1.0 / (s22 - l20 * s20 - l21 * s21)
    s32, s42 = s32 - l30 * s20 - l31 * s21, s42 - l40 * s20 - l41 * s21
    l32, l42 = s32 * d2, s42 * d2
    d3 = 1.0 / (s33 - l30 * s30 - l31 * s31 - l32 * s32)
    s43 = s43 - l40 * s30 - l41 * s31 - l42 * s32
    l43 = s43 * d3
    d4 = 1.0 / (s44 - l40 * s40 - l41 * s41 - l42 * s42 - l43 * s43)
    # rows a, b, c, d, e of L^-1 P and the innovations i = L^-1 (y - x)
    a0, a1, a2, a3, a4 = P[0], P[1], P[3], P[6], P[10]
    b0, b1, b2, b3, b4 = _minus(P[1], P[2], P[4], P[7], P[11], l10, a0, a1, a2, a3, a4)
    c0, c1, c2, c3, c4 = _minus(P[3], P[4], P[5], P[8], P[12], l20, a0, a1, a2, a3, a4)
    c0, c1, c2, c3, c4 = _minus(c0, c1, c2, c3, c4, l21, b0, b1, b2, b3, b4)
    e0, e1, e2, e3, e4 = _minus(P[6], P[7], P[8], P[9], P[13], l30, a0, a1, a2, a3, a4)
    e0, e1, e2, e3, e4 = _minus(e0, e1, e2, e3, e4, l31, b0, b1, b2, b3, b4)
    e0, e1, e2, e3, e4 = _minus(e0, e1, e2, e3, e4, l32, c0, c1, c2, c3, c4)
    g0, g1, g2, g3, g4 = _minus(P[10], P[11], P[12], P[13], P[14], l40, a0, a1, a2, a3, a4)
    g0, g1, g2, g3, g4 = _minus(g0, g1, g2, g3, g4, l41, b0, b1, b2, b3, b4)
    g0, g1, g2, g3, g4 = _minus(g0, g1, g2, g3, g4, l42, c0, c1, c2, c3, c4)
    g0, g1, g2, g3, g4 = _minus(g0, g1, g2, g3, g4, l43, e0, e1, e2, e3, e4)
    i0 = y[0] - x[0]
    i1 = y[1] - x[1] - l10 * i0
    i2 = wrap(y[2] - x[2]) - l20 * i0 - l21 * i1
    i3 = y[3] - x[3] - l30 * i0 - l31 * i1 - l32 * i2
    i4 = y[4] - x[4] - l40 * i0 - l41 * i1 - l42 * i2 - l43 * i3
    _downdate(x, P, d0, i0, a0, a1, a2, a3, a4)
    _downdate(x, P, d1, i1, b0, b1, b2, b3, b4)
    _downdate(x, P, d2, i2, c0, c1, c2, c3, c4)
    _downdate(x, P, d3, i3, e0, e1, e2, e3, e4)
    _downdate(x, P, d4, i4, g0, g1, g2, g3, g4)


@inner
def _minus(p0, p1, p2, p3, p4, w, q0, q1, q2, q3, q4):
    """One row less w times another."""
    return p0 - w * q0, p1 - w * q1, p2 - w * q2, p3 - w * q3, p4 - w * q4


@inner
def _downdate(x, P, s, innovation, g0, g1, g2, g3, g4):
    """x += s g innovation and P -= s g g' of five states."""
    t0, t1, t2, t3, t4 = s * g0, s * g1, s * g2, s * g3, s * g4
    P[0] -= t0 * g0
    P[1], P[2] = P[1] - t1 * g0, P[2] - t1 * g1
    P[3], P[4], P[5] = P[3] - t2 * g0, P[4] - t2 * g1, P[5] - t2 * g2
    P[6], P[7], P[8], P[9] = P[6] - t3 * g0, P[7] - t3 * g1, P[8] - t3 * g2, P[9] - t3 * g3
    P[10], P[11], P[12], P[13] = P[10] - t4 * g0, P[11] - t4 * g1, P[12] - t4 * g2, P[13] - t4 * g3
    P[14] -= t4 * g4
    x[0] += t0 * innovation
    x[1] += t1 * innovation
    x[2] += t2 * innovation
    x[3] += t3 * innovation
    x[4] += t4 * innovation
