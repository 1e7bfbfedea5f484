"""The Target Detection Module: measurements in, detected targets out.

Each source that any sensor reports has up to three local filters (AIS, radar, LiDAR) that live at the time of their own last
measurement (sensors/intake.py).  At its own rate the TDM predicts copies of them to now, fuses them (thesis 3.2,
sensors/fusion.py) and reports.  A sensor that was not heard for its timeout leaves the fusion and starts afresh when it
returns; a target without sensors is dropped, and its id is not used again.

Measurements are assigned by their hidden source number, as in the thesis; what is *said* of a target comes from
measurements only: it is a vessel if it sends AIS as one or if it is seen to move.
"""

from __future__ import annotations

import math

from ..jit import inner, scalar
from ..trig import PI, atan2, wrap_positive
from ..world.state import (
    AIS,
    AIS_ATON,
    DESCRIPTOR_FIXED,
    DESCRIPTOR_VESSEL,
    LIDAR,
    PHASE_MOTION,
    PHASE_NONE,
    RADAR,
)
from . import light
from .ais import ais_class
from .coastline import publish_land
from .fusion import fuse, fuse_size
from .tracker import predicted


@inner
def drop_silent(w, o, s, now_us):
    """Forget the filters of sensors that timed out; returns True if any sensor still holds the target."""
    t = w.tracks
    scans = w.sensors.radar.timeout_us, w.sensors.lidar.timeout_us
    alive = False
    for k in range(3):
        if t.phase[o, k, s] != PHASE_NONE:
            if now_us - t.stamp_us[o, k, s] > (t.ais_timeout_us[o, s] if k == AIS else scans[k - 1]):
                t.phase[o, k, s] = PHASE_NONE
            else:
                alive = True
    return alive


@inner
def fused(w, o, s, now_us):
    """Fuse what the thesis's filters know of a target into w.estimate_x[0], w.estimate_p[0]; returns the phase."""
    t = w.tracks
    x, p = w.estimate_x[0], w.estimate_p[0]
    phase = PHASE_NONE
    for k in range(3):
        other = t.phase[o, k, s]
        if other == PHASE_NONE:
            continue
        seconds = (now_us - t.stamp_us[o, k, s]) * 1.0e-6
        first = 0 if phase == PHASE_NONE else 1  # the first is where others are fused into
        y, q = w.estimate_x[first], w.estimate_p[first]
        if k == AIS:
            predicted(t.x_ais[o, s], t.p_ais[o, s], other, seconds, w.sensors, y, q)
        else:
            predicted(t.x_scan[o, k - 1, s], t.p_scan[o, k - 1, s], other, seconds, w.sensors, y, q)
        phase = fuse(x, p, phase, y, q, other) if first else other
    return phase


@scalar
def fused_light(w, o, now_us, first, ends):
    """Fuse what the light filters know of targets from ``first`` on into rows of ``w.look``; vector code.

    ends [3]: the first target for each sensor of which, and of all later ones, it knows nothing; or which is not of interest.
    Rows 0-3 [N, E, vN, vE], 4-6 [pp, pv, vv], 7 the phase; the columns are sources.
    """
    t, look, q = w.tracks, w.look, w.sensors.light_q
    if w.observer.shape[0] == 1:
        o = 0  # a constant tells LLVM that the rows are apart
    for s in range(first, max(ends)):
        look[7, s] = PHASE_NONE
    for k in range(3):
        g = t.filters[o, k]
        for s in range(first, ends[k]):
            look[8, s] = t.phase[o, k, s]
            look[9, s] = (now_us - t.stamp_us[o, k, s]) * 1.0e-6
        for s in range(first, ends[k]):
            n, e, vn, ve, pp, pv, vv = light.predicted(g.x[:, s], g.p[:, s], look[8, s], look[9, s], q)
            look[7, s] = light.fuse(look[:4, s], look[4:7, s], look[7, s], (n, e, vn, ve), (pp, pv, vv), look[8, s])


@inner
def _courses(w, n):
    """Rows 8-10 of ``w.look`` from 0-7, in the first n columns: course [rad], speed [m/s], variance of the course."""
    look = w.look
    for i in range(n):  # vector code
        vn, ve, vv = look[2, i], look[3, i], look[6, i]
        speed2 = vn * vn + ve * ve
        look[8, i] = wrap_positive(atan2(ve, vn))
        look[9, i] = math.sqrt(speed2)
        look[10, i] = vv / max(speed2, vv)


@inner
def _fused_size(w, o, s):
    """Apparent radius [m] of a target and its variance; NaN while only AIS has seen it."""
    t = w.tracks
    radius = variance = math.nan
    for k in range(1, 3):
        if t.phase[o, k, s] != PHASE_NONE:
            g = t.filters[o, k]
            if radius == radius:
                radius, variance = fuse_size(radius, variance, g.size[0, s], g.p_size[0, s])
            else:
                radius, variance = g.size[0, s], g.p_size[0, s]
    return max(radius, w.sensors.radius_min) if radius == radius else radius, variance


@inner
def publish(w, land, o, tick):
    """Write the picture of observer o: every target that a sensor holds, predicted to now and fused."""
    t, pic, look = w.tracks, w.picture, w.look
    now = tick * w.dt_us
    count = 0
    end_ais = end_radar = end_lidar = 0
    for s in range(t.id.shape[1]):
        if t.id[o, s] == 0:
            continue
        if drop_silent(w, o, s, now):
            w.order[count] = s
            count += 1
            end_ais = s + 1 if t.phase[o, AIS, s] != PHASE_NONE else end_ais
            end_radar = s + 1 if t.phase[o, RADAR, s] != PHASE_NONE else end_radar
            end_lidar = s + 1 if t.phase[o, LIDAR, s] != PHASE_NONE else end_lidar
        else:
            t.id[o, s] = 0
            pic.id[o, s] = 0
    if w.sensors.light:
        ends = (end_ais, end_radar, end_lidar)
        fused_light(w, o, now, 0, ends)
        _courses(w, max(ends))
    for i in range(count):
        s = w.order[i]
        if w.sensors.light:
            moving = look[7, s] == PHASE_MOTION
            pic.position[o, s, 0] = look[0, s]
            pic.position[o, s, 1] = look[1, s]
            pic.cog[o, s] = look[8, s] if moving else math.nan
            pic.sog[o, s] = look[9, s] if moving else math.nan
            pic.rot[o, s] = math.nan
            pic.covariance[o, s, 0] = pic.covariance[o, s, 2] = look[4, s]
            pic.covariance[o, s, 1] = 0.0
            pic.covariance[o, s, 3] = look[10, s] if moving else math.nan
            pic.covariance[o, s, 4] = look[6, s] if moving else math.nan
        else:
            moving = fused(w, o, s, now) == PHASE_MOTION
            x, p = w.estimate_x[0], w.estimate_p[0]
            pic.position[o, s, 0] = x[0]
            pic.position[o, s, 1] = x[1]
            for c in range(3):
                pic.covariance[o, s, c] = p[c]
            if moving:
                astern = x[3] < 0.0
                pic.cog[o, s] = wrap_positive(x[2] + PI if astern else x[2])
                pic.sog[o, s] = abs(x[3])
                pic.rot[o, s] = x[4]
                pic.covariance[o, s, 3] = p[5]
                pic.covariance[o, s, 4] = p[9]
            else:
                pic.cog[o, s] = pic.sog[o, s] = pic.rot[o, s] = math.nan
                pic.covariance[o, s, 3] = pic.covariance[o, s, 4] = math.nan
        sensors = 0
        for k in range(3):
            if t.phase[o, k, s] != PHASE_NONE:
                sensors |= 1 << k
        station = t.phase[o, AIS, s] != PHASE_NONE and ais_class(w, s) != AIS_ATON
        pic.id[o, s] = t.id[o, s]
        pic.sensors[o, s] = sensors
        pic.motion_known[o, s] = moving
        pic.descriptor[o, s] = DESCRIPTOR_VESSEL if moving or station else DESCRIPTOR_FIXED
        pic.radius[o, s], pic.radius_variance[o, s] = _fused_size(w, o, s)
    pic.count[o] = count
    publish_land(w, land, o, tick)
    pic.tick[o] = tick
    pic.sequence[o] += 1
