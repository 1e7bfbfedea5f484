"""Autopilot of a 3-DOF plant: set points of heading and speed -> demands -> thruster commands, from measured values."""

from __future__ import annotations

from ..jit import inner
from ..trig import clip, wrap

_REVERSE_SLOPE = 20.0  # the bucket is all the way over at 5 % of surge demand


@inner
def autopilot(w, p, heading, yaw_rate, speed, heading_ref, speed_ref, h):
    """Demands (surge, yaw), each in [-1, 1], that bring plant p to ``heading_ref`` [rad] and ``speed_ref`` [m/s].

    Heading is a cascade: the wrapped error asks for a yaw rate, limited to ``ap_rate_max``, which a PI law on the
    measured ``yaw_rate`` [rad/s] follows; its integral, against wind, waits while rate or demand is at its limit.
    Speed is the inverse of the steady speed curve plus a PI law, whose integral waits while the demand is at its limit.
    ``speed`` is the measured surge speed [m/s], h the time since the last call [s].
    """
    q = w.plants
    rate_ref = clip(q.ap_heading[p, 0] * wrap(heading_ref - heading), -q.ap_rate_max[p], q.ap_rate_max[p])
    error = rate_ref - yaw_rate
    yaw = q.ap_heading[p, 1] * error + q.ap_integral[p, 0]
    if abs(yaw) < 1.0 and abs(rate_ref) < q.ap_rate_max[p]:
        q.ap_integral[p, 0] = clip(q.ap_integral[p, 0] + q.ap_heading[p, 2] * error * h, -1.0, 1.0)

    share = min(abs(speed_ref) / q.ap_speed_max[p], 1.0)
    steady = share ** q.ap_speed[p, 2] if speed_ref >= 0.0 else -(share ** q.ap_speed[p, 2])
    error = speed_ref - speed
    surge = steady + q.ap_speed[p, 0] * error + q.ap_integral[p, 1]
    if abs(surge) < 1.0 or surge * error < 0.0:
        q.ap_integral[p, 1] = clip(q.ap_integral[p, 1] + q.ap_speed[p, 1] * error * h, -1.0, 1.0)
    return clip(surge, -1.0, 1.0), clip(yaw, -1.0, 1.0)


@inner
def mix(w, p, surge, yaw):
    """Write the commands of all thrusters of plant p from demands in [-1, 1]: surge (ahead +) and yaw (to starboard +).

    Jets with buckets take |surge| as shaft speed and go astern by the bucket, which crosses over smoothly around 0;
    their nozzles are mirrored astern, so that a positive demand still turns to starboard.
    """
    q = w.plants
    bucket = clip(_REVERSE_SLOPE * surge, -1.0, 1.0)
    astern = surge < 0.0 and q.reverse_by_bucket[p] != 0 and q.bucket_in_yaw[p] != 0
    for i in range(q.thrusters[p]):
        ahead = abs(surge) if q.reverse_by_bucket[p] != 0 else surge
        q.command[p, i, 0] = clip(q.mix_surge[p, i] * ahead + q.mix_yaw[p, i] * yaw, -1.0, 1.0)
        q.command[p, i, 1] = clip(q.mix_nozzle[p, i] * (-yaw if astern else yaw), -1.0, 1.0)
        q.command[p, i, 2] = bucket if q.reverse_by_bucket[p] != 0 else 1.0
