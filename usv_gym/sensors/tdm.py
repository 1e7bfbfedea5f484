"""The Target Detection Module: measurements in, detected targets out.

Each source that any sensor reports has up to three local filters (AIS, radar, LiDAR; sensors/tracker.py) that live at the
time of their own last measurement.  At its own rate the TDM predicts copies of them to now, fuses them (thesis 3.2,
sensors/fusion.py) and reports.  A sensor that was not heard for its timeout leaves the fusion and starts afresh when it
returns; a target without sensors is dropped, and its id is not used again.

Measurements are assigned by their hidden source number, as in the thesis; what is *said* of a target comes from
measurements only: it is a vessel if it sends AIS as one or if it is seen to move.
"""

from __future__ import annotations

import math

from ..jit import inner
from ..trig import PI, atan2, hypot, wrap_positive
from ..world.state import (
    AIS,
    AIS_ATON,
    DESCRIPTOR_FIXED,
    DESCRIPTOR_VESSEL,
    PHASE_MOTION,
    PHASE_NONE,
    PHASE_POSITION,
)
from . import light
from .ais import ais_class, reporting_interval_us
from .coastline import publish_land
from .ekf import init_fix, init_scan_motion, init_size, predict_size, update_size
from .fusion import fuse, fuse_size
from .tracker import MOVING, predicted, track_ais, track_scan


@inner
def _ais_timeout_us(w, o, s):
    """How long after the message in the inbox a source is taken to be silent."""
    # as slow as the station may be, given the error of its SOG: a moored one reports seldom, and not always 0
    slowest = w.ais.inbox[o, s, 4] - 3.0 * hypot(w.sensors.ais_noise[4], w.sensors.ais_bias[4])
    interval = reporting_interval_us(ais_class(w, s), max(slowest, 0.0), 0.0, w.sensors.ais_interval_us)
    return w.sensors.ais_timeout * interval


@inner
def _drop_silent(w, o, s, now_us):
    """Forget the filters of sensors that timed out; returns True if any sensor still holds the target."""
    t = w.tracks
    scans = w.sensors.radar.timeout_us, w.sensors.lidar.timeout_us
    alive = False
    for k in range(3):
        if t.phase[o, s, k] != PHASE_NONE:
            if now_us - t.stamp_us[o, s, k] > (t.ais_timeout_us[o, s] if k == AIS else scans[k - 1]):
                t.phase[o, s, k] = PHASE_NONE
            else:
                alive = True
    return alive


@inner
def _fused(w, o, s, now_us):
    """Fuse what is known of a target at ``now_us`` into w.estimate_x[0], w.estimate_p[0]; returns the phase."""
    t = w.tracks
    x, p = w.estimate_x[0], w.estimate_p[0]
    phase = PHASE_NONE
    for k in range(3):
        other = t.phase[o, s, k]
        if other == PHASE_NONE:
            continue
        seconds = (now_us - t.stamp_us[o, s, k]) * 1.0e-6
        first = 0 if phase == PHASE_NONE else 1  # the first is where others are fused into
        y, q = w.estimate_x[first], w.estimate_p[first]
        if w.sensors.light:
            if k == AIS:
                light.predicted(t.x_ais[o, s], t.p_ais[o, s], other, seconds, w.sensors, y, q)
            else:
                light.predicted(t.x_scan[o, k - 1, s], t.p_scan[o, k - 1, s], other, seconds, w.sensors, y, q)
            phase = light.fuse(x, p, phase, y, q, other) if first else other
            continue
        if k == AIS:
            predicted(t.x_ais[o, s], t.p_ais[o, s], other, seconds, w.sensors, y, q)
        else:
            predicted(t.x_scan[o, k - 1, s], t.p_scan[o, k - 1, s], other, seconds, w.sensors, y, q)
        phase = fuse(x, p, phase, y, q, other) if first else other
    return phase


@inner
def _appear(w, o, s):
    """Give a target that had none an id."""
    if w.tracks.id[o, s] == 0:
        w.picture.next_id[o] += 1
        w.tracks.id[o, s] = w.picture.next_id[o]


@inner
def take_ais(w, o, sender):
    """An AIS message of a source arrives at observer o: into the inbox and into the AIS filter.

    One of a spoofed station is that of another target.  Under the sender's own MMSI that one takes the sender's place.
    """
    a, t = w.ais, w.tracks
    s = sender
    if a.sent_as[sender]:
        s = a.sent_as[sender]
        if a.spoof_mmsi[sender] == 0:
            a.inbox_stamp_us[o, sender] = -1
            t.phase[o, sender, AIS] = PHASE_NONE
    stamp = a.stamp_us[sender]
    box = a.inbox[o, s]
    box[0] = a.position[sender, 0]
    box[1] = a.position[sender, 1]
    box[2] = a.cog[sender]
    box[3] = a.heading[sender]
    box[4] = a.sog[sender]
    box[5] = a.rot[sender]
    a.inbox_stamp_us[o, s] = stamp
    phase = t.phase[o, s, AIS]
    elapsed = stamp - t.stamp_us[o, s, AIS]
    t.ais_timeout_us[o, s] = timeout = _ais_timeout_us(w, o, s)
    if phase != PHASE_NONE and elapsed > timeout:
        phase = PHASE_NONE
    t.phase[o, s, AIS] = track_ais(
        t.x_ais[o, s], t.p_ais[o, s], phase, elapsed * 1.0e-6, box[0], box[1], box[2], box[4], box[5], w.sensors
    )
    t.stamp_us[o, s, AIS] = stamp
    _appear(w, o, s)


@inner
def take_scan(w, o, k, s, scan):
    """The last measurement of source s by radar (k = 0) or LiDAR (k = 1) arrives at the tracker of observer o."""
    t = w.tracks
    stamp = t.measured_us[o, k, s]
    n, e, radius, f = t.measured[o, k, s, 0], t.measured[o, k, s, 1], t.measured[o, k, s, 2], t.measured[o, k, s, 3]
    x, p = t.x_scan[o, k, s], t.p_scan[o, k, s]
    elapsed = stamp - t.stamp_us[o, s, k + 1]
    phase = t.phase[o, s, k + 1]
    if phase != PHASE_NONE and elapsed > scan.timeout_us:
        phase = PHASE_NONE
    fresh = phase == PHASE_NONE
    if phase == PHASE_POSITION:
        # f(d) at the range of the estimate: by their own, fixes that are too near count for more and pull the target nearer
        f = max(scan.gain * hypot(x[0] - w.nav.position[o, 0], x[1] - w.nav.position[o, 1]), scan.gain_floor)
    t.phase[o, s, k + 1] = PHASE_NONE if fresh else phase
    started = False
    if phase != PHASE_MOTION and (t.phase[o, s, AIS] != PHASE_NONE or t.phase[o, s, 2 - k] != PHASE_NONE):
        # another sensor may know how the target moves: then start from its heading and speed
        _drop_silent(w, o, s, stamp)
        own_phase = t.phase[o, s, k + 1]
        t.phase[o, s, k + 1] = PHASE_NONE
        known = _fused(w, o, s, stamp)
        t.phase[o, s, k + 1] = own_phase
        y, q = w.estimate_x[0], w.estimate_p[0]
        if w.sensors.light:
            if known == PHASE_MOTION and light.speed2(y) > MOVING * MOVING * q[2]:
                init_fix(x, p, n, e, f, scan.noise[0], scan.bias[0])
                light.start(x, p, y[2], y[3], q[2], 0.0)
                phase = PHASE_MOTION
                started = True
        elif known == PHASE_MOTION and y[3] > 0.0 and y[3] * y[3] > MOVING * MOVING * q[9]:
            init_scan_motion(x, p, n, e, f, y[2], y[3], y[4], q[5], q[9], q[14], w.sensors, scan)
            phase = PHASE_MOTION
            started = True
    if not started:
        phase = track_scan(x, p, t.start[o, k, s], phase, elapsed * 1.0e-6, n, e, f, w.sensors, scan)
    if fresh:
        init_size(t.size[o, k, s], t.p_size[o, k, s], radius, f, scan)
    else:
        predict_size(t.size[o, k, s], t.p_size[o, k, s], elapsed * 1.0e-6, scan)
        update_size(t.size[o, k, s], t.p_size[o, k, s], radius, f, scan)
    t.phase[o, s, k + 1] = phase
    t.stamp_us[o, s, k + 1] = stamp
    _appear(w, o, s)


@inner
def publish(w, land, o, tick):
    """Write the picture of observer o: every target that a sensor holds, predicted to now and fused."""
    t, pic = w.tracks, w.picture
    now = tick * w.dt_us
    count = 0
    for s in range(t.id.shape[1]):
        if t.id[o, s] == 0:
            continue
        if not _drop_silent(w, o, s, now):
            t.id[o, s] = 0
            pic.id[o, s] = 0
            continue
        phase = _fused(w, o, s, now)
        x, p = w.estimate_x[0], w.estimate_p[0]
        sensors = 0
        radius = variance = math.nan
        for k in range(3):
            if t.phase[o, s, k] == PHASE_NONE:
                continue
            sensors |= 1 << k
            if k != AIS:
                if radius == radius:
                    radius, variance = fuse_size(radius, variance, t.size[o, k - 1, s, 0], t.p_size[o, k - 1, s, 0])
                else:
                    radius, variance = t.size[o, k - 1, s, 0], t.p_size[o, k - 1, s, 0]
        count += 1
        pic.id[o, s] = t.id[o, s]
        pic.sensors[o, s] = sensors
        pic.position[o, s, 0] = x[0]
        pic.position[o, s, 1] = x[1]
        pic.radius[o, s] = max(radius, w.sensors.radius_min) if radius == radius else radius
        pic.radius_variance[o, s] = variance
        pic.covariance[o, s, 0] = p[0]
        pic.covariance[o, s, 1] = 0.0 if w.sensors.light else p[1]
        pic.covariance[o, s, 2] = p[0] if w.sensors.light else p[2]
        moving = phase == PHASE_MOTION
        station = t.phase[o, s, AIS] != PHASE_NONE and ais_class(w, s) != AIS_ATON
        pic.motion_known[o, s] = moving
        pic.descriptor[o, s] = DESCRIPTOR_VESSEL if moving or station else DESCRIPTOR_FIXED
        if moving and w.sensors.light:
            speed2 = light.speed2(x)
            pic.cog[o, s] = wrap_positive(atan2(x[3], x[2]))
            pic.sog[o, s] = math.sqrt(speed2)
            pic.rot[o, s] = math.nan
            pic.covariance[o, s, 3] = p[2] / max(speed2, p[2])
            pic.covariance[o, s, 4] = p[2]
        elif moving:
            astern = x[3] < 0.0
            pic.cog[o, s] = wrap_positive(x[2] + PI if astern else x[2])
            pic.sog[o, s] = abs(x[3])
            pic.rot[o, s] = x[4]
            pic.covariance[o, s, 3] = p[5]
            pic.covariance[o, s, 4] = p[9]
        else:
            pic.cog[o, s] = pic.sog[o, s] = pic.rot[o, s] = math.nan
            pic.covariance[o, s, 3] = pic.covariance[o, s, 4] = math.nan
    pic.count[o] = count
    publish_land(w, land, o, tick)
    pic.tick[o] = tick
    pic.sequence[o] += 1
