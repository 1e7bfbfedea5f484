"""What a local filter knows of a target: position only, or position and motion.

PHASE_POSITION  the static filter of ``ekf``: an iceberg's fixes are averaged; heading and speed are unknown
PHASE_MOTION    the extended Kalman filter, or with ``sensors.light`` the filter of ``light``

These are the thesis's filters; ``light`` has functions of the same names.  When motion starts: see ``still``.  ``sensors``
and ``scan`` are the records described in ``ekf``; phases are those of ``world.state``.
"""

from __future__ import annotations

import math

import numpy as np

from ..jit import inner
from ..trig import PI, atan2, exp
from ..world.state import PHASE_MOTION, PHASE_POSITION
from . import ekf, still
from .motion import predict_motion, start_motion

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
        ekf.predict_ais(x, P, h, sensors)
        ekf.update_ais(x, P, n, e, psi, u, r, sensors)
    elif not (np.isnan(psi) or np.isnan(u)):
        ekf.init_ais(x, P, n, e, psi, u, r, sensors)
        phase = PHASE_MOTION
    else:
        phase = track_station(x, P, phase, h, n, e, sensors)
    return phase


@inner
def track_station(x, P, phase, h, n, e, sensors):
    """Take an AIS message without COG and SOG into a static filter.  Returns the new phase."""
    if phase == PHASE_POSITION:
        ekf.predict_position(x, P, exp(-h / sensors.ais_bias_time[0]) if h > 0.0 else 1.0, sensors.ais_bias[0])
        ekf.update_position(x, P, n, e, 1.0, sensors.ais_noise[0])
    else:
        ekf.init_fix(x, P, n, e, 1.0, sensors.ais_noise[0], sensors.ais_bias[0])
    return PHASE_POSITION


@inner
def track_scan(x, P, line, phase, h, n, e, f, sensors, scan):
    """Take one fix n, e [m] of radar or LiDAR with error factor f = f(d) into a local filter.  Returns the new phase.

    h [s] is the time since the filter's time of validity, of no account in PHASE_NONE.
    """
    if phase == PHASE_MOTION:
        ekf.predict_scan(x, P, h, sensors, scan)
        ekf.update_scan(x, P, n, e, f, scan)
        fold(x, P)
        if x[3] * x[3] < STOPPED * STOPPED * P[9]:
            ekf.init_position(x, P, x[0], x[1], max(P[0], P[2]), 0.0, scan.bias[0])
            still.start_line(line, n, e, f, scan)
            phase = PHASE_POSITION
    elif phase == PHASE_POSITION:
        ekf.decays(scan, h)
        if still.average(x, P, line, h, n, e, f, scan.noise[0], scan.bias[0], scan.decay[0], scan.fade, scan.slowness) != 0.0:
            _start_motion(x, P, line, sensors)
            phase = PHASE_MOTION
    else:
        still.first_fix(x, P, line, n, e, f, scan)
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


@inner
def _start_motion(x, P, line, sensors):
    """Heading and speed of the line for a static filter that stands at the newest point of the line.

    The velocity is that at the mean time of the line, ``age`` ago, so yaw rate and acceleration add to its uncertainty.
    """
    north, east, variance, age = still.velocity(line)
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
