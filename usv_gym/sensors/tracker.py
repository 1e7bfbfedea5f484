"""What a local filter knows of a target: position only, or position and motion.

PHASE_POSITION  the static filter of ``ekf``: an iceberg's fixes are averaged; heading and speed are unknown
PHASE_MOTION    the extended Kalman filter, or with ``sensors.light`` the filter of ``light``

A radar or LiDAR cannot tell (psi, u) from (psi + 180 deg, -u), and an EKF that starts with an unknown heading ends up
reversed in a fifth to a half of the runs.  So motion starts from a line through the fixes ("two-point initialisation"),
and only when the line is significant: the fixes' errors contain a slow bias, so neighbouring fixes say nearly the same.

The line fit of a scan filter is ten numbers, ``start``:

    0-2  first fix: N, E [m], variance of each [m2]
    3-5  sum of weights, mean time [s, of the newest fix, hence negative], sum of squared times about that mean
    6-9  mean N, mean E; sums of time by N and time by E about the means

Each fix weighs 1/variance, and weights fade with ``ekf.MEMORY``.  A bias with decay a from fix to fix lets means converge as
slowly as white noise of the variance sigma_b^2 (1 + a) / (1 - a) would; that variance is used.  The variance of the
velocity is 1 / start[5] while nothing has faded, and less later, since faded fixes are better than their weight: a
target that was watched for long and has not moved needs more evidence.

``sensors`` and ``scan`` are the records described in ``ekf``; phases are those of ``world.state``.
"""

from __future__ import annotations

import math

import numpy as np

from ..jit import inner
from ..trig import PI, atan2, exp
from ..world.state import PHASE_MOTION, PHASE_POSITION
from . import ekf, light
from .motion import predict_motion, start_motion

#: Displacement from the first fix, in standard deviations of two fixes, and speed, in its own, at which motion starts
DISPLACED, MOVING = 3.0, 3.5
#: Speed of the fit at which "static" has become doubtful: the position then comes from the line
DOUBTFUL = 1.5
#: Speed of the filter, in its standard deviations, below which motion is unknown again
STOPPED = 2.0


# --- one measurement -------------------------------------------------------------------------------------------------
@inner
def track_ais(x, P, phase, h, n, e, psi, u, r, sensors):
    """Take one AIS message into a local filter; h [s] since its time of validity.  Returns the new phase.

    Position [m], COG [rad], SOG [m/s], ROT [rad/s]; COG, SOG and ROT may be NaN.  A source that never gives COG and SOG
    (an aid to navigation) stays in PHASE_POSITION.
    """
    if phase == PHASE_MOTION:
        if sensors.light:
            light.track_ais(x, P, h, n, e, psi, u, sensors)
        else:
            ekf.predict_ais(x, P, h, sensors)
            ekf.update_ais(x, P, n, e, psi, u, r, sensors)
    elif not (np.isnan(psi) or np.isnan(u)):
        if sensors.light:
            light.init_ais(x, P, n, e, psi, u, sensors)
        else:
            ekf.init_ais(x, P, n, e, psi, u, r, sensors)
        phase = PHASE_MOTION
    elif phase == PHASE_POSITION:
        ekf.predict_position(x, P, exp(-h / sensors.ais_bias_time[0]) if h > 0.0 else 1.0, sensors.ais_bias[0])
        ekf.update_position(x, P, n, e, 1.0, sensors.ais_noise[0])
    else:
        ekf.init_fix(x, P, n, e, 1.0, sensors.ais_noise[0], sensors.ais_bias[0])
        phase = PHASE_POSITION
    return phase


@inner
def track_scan(x, P, start, phase, h, n, e, f, sensors, scan):
    """Take one fix n, e [m] of radar or LiDAR with error factor f = f(d) into a local filter.  Returns the new phase.

    h [s] is the time since the filter's time of validity, of no account in PHASE_NONE.
    """
    if phase == PHASE_MOTION:
        if sensors.light:
            light.track_scan(x, P, h, n, e, f, sensors, scan)
            stopped = light.speed2(x) < STOPPED * STOPPED * P[2]
        else:
            ekf.predict_scan(x, P, h, sensors, scan)
            ekf.update_scan(x, P, n, e, f, scan)
            fold(x, P)
            stopped = x[3] * x[3] < STOPPED * STOPPED * P[9]
        if stopped:
            ekf.init_position(x, P, x[0], x[1], P[0] if sensors.light else max(P[0], P[2]), 0.0, scan.bias[0])
            start_line(start, n, e, f, scan)
            phase = PHASE_POSITION
    elif phase == PHASE_POSITION:
        ekf.decays(scan, h)
        ekf.predict_position(x, P, scan.decay[0], scan.bias[0])
        ekf.update_position(x, P, n, e, f, scan.noise[0])
        extend_line(start, h, n, e, f, scan)
        speed2 = (start[8] * start[8] + start[9] * start[9]) / start[5]  # in variances of the velocity
        if speed2 > DOUBTFUL * DOUBTFUL:  # False while the line is one point (NaN)
            # The newest point of the line, whose error already contains the bias
            age = -start[4]
            north = start[6] + age * start[8] / start[5]
            east = start[7] + age * start[9] / start[5]
            ekf.init_position(x, P, north, east, 1.0 / start[3] + age * age / start[5], 0.0, scan.bias[0])
            displaced2 = (n - start[0]) * (n - start[0]) + (e - start[1]) * (e - start[1])
            variance = start[2] + _fix_variance(f, scan)
            if speed2 > MOVING * MOVING and displaced2 > DISPLACED * DISPLACED * variance:
                _start_motion(x, P, start, sensors)
                phase = PHASE_MOTION
    else:
        ekf.init_fix(x, P, n, e, f, scan.noise[0], scan.bias[0])
        start_line(start, n, e, f, scan)
        phase = PHASE_POSITION
    return phase


@inner
def predicted(x, P, phase, h, sensors, X, Q):
    """Copy the motion of a local filter into X [>= 7], Q [>= 28] and move the copy by h [s], for publication."""
    if phase == PHASE_MOTION:
        for i in range(7):
            X[i] = x[i]
        for i in range(28):
            Q[i] = P[i]
        predict_motion(X, Q, 7, h, sensors)
    else:
        for i in range(7):
            X[i] = 0.0
        for i in range(28):
            Q[i] = 0.0
        X[0] = x[0]
        X[1] = x[1]
        Q[0] = Q[2] = P[0]


@inner
def fold(x, P):
    """Motion astern is motion ahead of the opposite heading, for sensors that do not see heading."""
    if x[3] < 0.0:
        x[2] += PI
        x[3] = -x[3]
        x[5] = -x[5]
        for i in (3, 5):  # twice changed signs stay
            k = i * (i + 1) // 2
            for j in range(i):
                P[k + j] = -P[k + j]
            for j in range(i + 1, 9):
                P[j * (j + 1) // 2 + i] = -P[j * (j + 1) // 2 + i]


# --- the line --------------------------------------------------------------------------------------------------------
@inner
def start_line(start, n, e, f, scan):
    """Begin the line fit with a first fix."""
    for i in range(10):
        start[i] = 0.0
    start[0] = start[6] = n
    start[1] = start[7] = e
    start[2] = _fix_variance(f, scan)
    start[3] = 1.0 / start[2]


@inner
def extend_line(start, h, n, e, f, scan):
    """Add a fix h [s] after the last one (weighted running moments, West 1979, with forgetting)."""
    if h <= 0.0:
        return
    ekf.decays(scan, h)
    fade = scan.fade
    bias = f * scan.bias[0]
    w = 1.0 / (ekf.white(f, scan.noise[0]) + bias * bias * scan.slowness)
    old = fade * start[3]
    age = h - start[4]
    share = w / (old + w)
    dn, de = n - start[6], e - start[7]
    start[3] = old + w
    start[4] = -age * (1.0 - share)
    start[5] = fade * start[5] + old * share * age * age
    start[6] += share * dn
    start[7] += share * de
    start[8] = fade * start[8] + old * share * age * dn
    start[9] = fade * start[9] + old * share * age * de


@inner
def _fix_variance(f, scan):
    return ekf.white(f, scan.noise[0]) + f * f * scan.bias[0] * scan.bias[0]


@inner
def _start_motion(x, P, start, sensors):
    """Heading and speed of the line for a static filter that stands at the newest point of the line.

    The velocity is that at the mean time of the line, ``age`` ago, so yaw rate and acceleration add to its uncertainty.
    """
    age, variance = -start[4], 1.0 / start[5]
    north, east = start[8] * variance, start[9] * variance
    if sensors.light:
        light.start(x, P, north, east, variance, age)
        return
    ekf.expand(x, P)
    u = math.sqrt(north * north + east * east)
    yaw_rate = ekf.YAW_RATE * ekf.YAW_RATE * sensors.inflation
    start_motion(x, P, atan2(east, north), u, 0.0, variance / (u * u), variance, yaw_rate, sensors)
    c, s = north / u, east / u
    P[3], P[4] = -s * age * variance / u, c * age * variance / u
    P[6], P[7] = c * age * variance, s * age * variance
    P[5] += age * age * yaw_rate
    P[12] = age * yaw_rate
    P[9] += age * age * P[20]
    P[18] = age * P[20]
