"""What radar and LiDAR make of a target that is not known to move: the static filter of ``ekf``, and a line through its fixes.

A radar or LiDAR cannot tell (psi, u) from (psi + 180 deg, -u), and an EKF that starts with an unknown heading ends up
reversed in a fifth to a half of the runs.  So motion starts from a line through the fixes ("two-point initialisation"),
and only when the line is significant: the fixes' errors contain a slow bias, so neighbouring fixes say nearly the same.

The line fit is ten numbers, ``line``:

    0-2  first fix: N, E [m], variance of each [m2]
    3-5  sum of weights, mean time [s, of the newest fix, hence negative], sum of squared times about that mean
    6-9  mean N, mean E; sums of time by N and time by E about the means

Each fix weighs 1/variance, and weights fade with ``ekf.MEMORY``.  A bias with decay a from fix to fix lets means converge as
slowly as white noise of the variance sigma_b^2 (1 + a) / (1 - a) would; that variance is used.  The variance of the
velocity is 1 / line[5] while nothing has faded, and less later, since faded fixes are better than their weight: a
target that was watched for long and has not moved needs more evidence.

Arrays are 1-D, or columns of the rows of all targets: what averages one target is vector code over all (sensors/intake.py).
"""

from __future__ import annotations

from ..jit import inner, scalar
from . import ekf

#: Displacement from the first fix, in standard deviations of two fixes, and speed, in its own, at which motion starts
DISPLACED, MOVING = 3.0, 3.5
#: Speed of the fit at which "static" has become doubtful: the position then comes from the line
DOUBTFUL = 1.5


@inner
def first_fix(x, P, line, n, e, f, scan):
    """Begin with a fix n, e [m] of error factor f."""
    ekf.init_fix(x, P, n, e, f, scan.noise[0], scan.bias[0])
    start_line(line, n, e, f, scan)


@inner
def start_line(line, n, e, f, scan):
    """Begin the line fit with a first fix."""
    for i in range(10):
        line[i] = 0.0
    line[0] = line[6] = n
    line[1] = line[7] = e
    line[2] = _fix_variance(f, scan.noise[0], scan.bias[0])
    line[3] = 1.0 / line[2]


@scalar
def average(x, P, line, h, n, e, f, noise, bias, decay, fade, slowness):
    """Take a fix n, e [m] of error factor f, h [s] after the last one; returns 1 if the line says that the target moves, or 0.

    noise, bias: standard deviations [m] at f = 1; decay, fade, slowness: see ``ekf.decays``.
    """
    ekf.predict_position(x, P, decay, bias)
    ekf.update_position(x, P, n, e, f, noise)
    if h > 0.0:  # weighted running moments (West 1979), with forgetting
        b = f * bias
        fix = ekf.white(f, noise) + b * b * slowness
        old = fade * line[3]
        age = h - line[4]
        share = 1.0 / (1.0 + old * fix)
        dn, de = n - line[6], e - line[7]
        line[3] = old + 1.0 / fix
        line[4] = -age * (1.0 - share)
        line[5] = fade * line[5] + old * share * age * age
        line[6] += share * dn
        line[7] += share * de
        line[8] = fade * line[8] + old * share * age * dn
        line[9] = fade * line[9] + old * share * age * de
    variance = 1.0 / line[5]  # of the velocity
    speed2 = (line[8] * line[8] + line[9] * line[9]) * variance  # in variances
    if speed2 > DOUBTFUL * DOUBTFUL:  # False while the line is one point (0 times infinity)
        # The newest point of the line, whose error already contains the bias
        age = -line[4]
        x[0] = line[6] + age * line[8] * variance
        x[1] = line[7] + age * line[9] * variance
        x[2] = x[3] = 0.0
        P[0] = 1.0 / line[3] + age * age * variance
        P[1] = 0.0
        P[2] = bias * bias
    displaced2 = (n - line[0]) * (n - line[0]) + (e - line[1]) * (e - line[1])
    far = displaced2 > DISPLACED * DISPLACED * (line[2] + _fix_variance(f, noise, bias))
    return 1.0 if (speed2 > MOVING * MOVING) & far else 0.0


@inner
def velocity(line):
    """Velocity N, E [m/s] of the line, its variance per axis, and how long ago it was the mean one [s]."""
    variance = 1.0 / line[5]
    return line[8] * variance, line[9] * variance, variance, -line[4]


@scalar
def _fix_variance(f, noise, bias):
    return ekf.white(f, noise) + f * f * bias * bias
