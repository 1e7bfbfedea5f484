"""Measurements arrive at the Target Detection Module: AIS messages one by one, a scan's fixes all at once.

What one fix does to the filters of its target says ``take_fix``.  With the light filters (sensors/light.py) the fixes of most
targets do the same: of those that go on moving or standing still, as at the scan before.  They are taken together in vector
code, by the same functions on the same rows.
"""

from __future__ import annotations

from ..jit import inner
from ..trig import hypot
from ..world.state import AIS, PHASE_MOTION, PHASE_NONE, PHASE_POSITION
from . import ekf, light, still, tracker
from .ais import ais_class, reporting_interval_us
from .tdm import drop_silent, fused, fused_light

_CHANGED = 3.0  #: in ``todo``: the target has stopped, or set off; else the phase of what is to be taken together


@inner
def _appear(w, o, s):
    """Give a target that had none an id."""
    if w.tracks.id[o, s] == 0:
        w.picture.next_id[o] += 1
        w.tracks.id[o, s] = w.picture.next_id[o]


@inner
def _ais_timeout_us(w, o, s):
    """How long after the message in the inbox a source is taken to be silent."""
    # as slow as the station may be, given the error of its SOG: a moored one reports seldom, and not always 0
    slowest = w.ais.inbox[o, s, 4] - 3.0 * hypot(w.sensors.ais_noise[4], w.sensors.ais_bias[4])
    interval = reporting_interval_us(ais_class(w, s), max(slowest, 0.0), 0.0, w.sensors.ais_interval_us)
    return w.sensors.ais_timeout * interval


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
            t.phase[o, AIS, sender] = PHASE_NONE
    stamp = a.stamp_us[sender]
    box = a.inbox[o, s]
    box[0] = a.position[sender, 0]
    box[1] = a.position[sender, 1]
    box[2] = a.cog[sender]
    box[3] = a.heading[sender]
    box[4] = a.sog[sender]
    box[5] = a.rot[sender]
    a.inbox_stamp_us[o, s] = stamp
    phase = t.phase[o, AIS, s]
    elapsed = stamp - t.stamp_us[o, AIS, s]
    t.ais_timeout_us[o, s] = timeout = _ais_timeout_us(w, o, s)
    if phase != PHASE_NONE and elapsed > timeout:
        phase = PHASE_NONE
    h = elapsed * 1.0e-6
    if w.sensors.light:
        g = t.filters[o, AIS]
        phase = light.track_ais(g.x[:, s], g.p[:, s], phase, h, box[0], box[1], box[2], box[4], w.sensors)
    else:
        phase = tracker.track_ais(t.x_ais[o, s], t.p_ais[o, s], phase, h, box[0], box[1], box[2], box[4], box[5], w.sensors)
    t.phase[o, AIS, s] = phase
    t.stamp_us[o, AIS, s] = stamp
    _appear(w, o, s)


@inner
def take_scan(w, o, k, scan):
    """The last scan of radar (k = 1) or LiDAR (k = 2) arrives at the tracker of observer o; ``scan`` is the sensor's record."""
    t = w.tracks
    now = t.scan_us[o, k - 1]
    if w.sensors.light:
        _take_together(w, o, k, scan, now)
    else:
        for s in range(t.id.shape[1]):
            if t.measured_us[o, k - 1, s] == now:
                take_fix(w, o, k, s, scan)


@inner
def take_fix(w, o, k, s, scan):
    """The last measurement of source s arrives."""
    t, g = w.tracks, w.tracks.filters[o, k]
    stamp = t.measured_us[o, k - 1, s]
    n, e, radius, f = g.measured[0, s], g.measured[1, s], g.measured[2, s], g.measured[3, s]
    x, p, line = t.x_scan[o, k - 1, s], t.p_scan[o, k - 1, s], g.line[:, s]
    y, q = g.x[:, s], g.p[:, s]  # of the light filter
    elapsed = stamp - t.stamp_us[o, k, s]
    h = elapsed * 1.0e-6
    phase = t.phase[o, k, s]
    if phase != PHASE_NONE and elapsed > scan.timeout_us:
        phase = PHASE_NONE
    fresh = phase == PHASE_NONE
    if phase == PHASE_POSITION:
        north, east = (y[0], y[1]) if w.sensors.light else (x[0], x[1])
        f = _factor(north, east, w.nav.position[o, 0], w.nav.position[o, 1], scan.gain, scan.gain_floor)
    t.phase[o, k, s] = PHASE_NONE if fresh else phase
    started = False
    if phase != PHASE_MOTION and (t.phase[o, AIS, s] != PHASE_NONE or t.phase[o, 3 - k, s] != PHASE_NONE):
        # another sensor may know how the target moves: then start from its heading and speed
        drop_silent(w, o, s, stamp)
        own_phase = t.phase[o, k, s]
        t.phase[o, k, s] = PHASE_NONE
        if w.sensors.light:
            fused_light(w, o, stamp, s, (s + 1, s + 1, s + 1))
            vn, ve, variance = w.look[2, s], w.look[3, s], w.look[6, s]
            known = w.look[7, s] == PHASE_MOTION
            if known and vn * vn + ve * ve > still.MOVING * still.MOVING * variance:
                ekf.init_fix(y, q, n, e, f, scan.noise[0], scan.bias[0])
                light.start(y, q, vn, ve, variance, 0.0)
                started = True
        else:
            known = fused(w, o, s, stamp) == PHASE_MOTION
            z, c = w.estimate_x[0], w.estimate_p[0]
            if known and z[3] > 0.0 and z[3] * z[3] > still.MOVING * still.MOVING * c[9]:
                ekf.init_scan_motion(x, p, n, e, f, z[2], z[3], z[4], c[5], c[9], c[14], w.sensors, scan)
                started = True
        t.phase[o, k, s] = own_phase
    if started:
        phase = PHASE_MOTION
    elif w.sensors.light:
        phase = light.track_scan(y, q, line, phase, h, n, e, f, w.sensors, scan)
    else:
        phase = tracker.track_scan(x, p, line, phase, h, n, e, f, w.sensors, scan)
    size, variance = g.size[:, s], g.p_size[:, s]
    if fresh:
        ekf.init_size(size, variance, radius, f, scan)
    else:
        ekf.decays(scan, h)
        ekf.predict_size(size, variance, scan.decay[1], scan.bias[1])
        ekf.update_size(size, variance, radius, f, scan.noise[1])
    t.phase[o, k, s] = phase
    t.stamp_us[o, k, s] = stamp
    _appear(w, o, s)


@inner
def _factor(n, e, north, east, gain, floor):
    """f(d) at the range of an estimate n, e: by their own, fixes that are too near would count for more and pull it nearer."""
    return max(gain * hypot(n - north, e - east), floor)


@inner
def _take_together(w, o, k, scan, now):
    """All measurements of a scan, with the light filters."""
    t, g = w.tracks, w.tracks.filters[o, k]
    S = t.id.shape[1]
    common = 0  # time since the scan before, in which nearly all targets were measured
    end = end_moving = 0
    for s in range(S):
        g.todo[s] = 0.0
        if t.measured_us[o, k - 1, s] != now:
            continue
        phase, elapsed = t.phase[o, k, s], now - t.stamp_us[o, k, s]
        alone = t.phase[o, AIS, s] == PHASE_NONE and t.phase[o, 3 - k, s] == PHASE_NONE
        if 0 < elapsed <= scan.timeout_us and (phase == PHASE_MOTION or (phase == PHASE_POSITION and alone)):
            if common == 0:
                common = elapsed
            if elapsed == common:
                g.todo[s] = phase
                t.stamp_us[o, k, s] = now
                end = s + 1
                if phase == PHASE_MOTION:
                    end_moving = s + 1
                continue
        take_fix(w, o, k, s, scan)
    if end == 0:
        return
    h = common * 1.0e-6
    ekf.decays(scan, h)
    decay, decay_size, fade, slowness = scan.decay[0], scan.decay[1], scan.fade, scan.slowness
    noise, noise_size, bias, bias_size = scan.noise[0], scan.noise[1], scan.bias[0], scan.bias[1]
    gain, floor, density = scan.gain, scan.gain_floor, w.sensors.light_q
    north, east = w.nav.position[o, 0], w.nav.position[o, 1]
    for s in range(end):
        if g.todo[s] == PHASE_POSITION:
            g.factor[s] = f = _factor(g.x[0, s], g.x[1, s], north, east, gain, floor)
            sets_off = still.average(g.x[:, s], g.p[:, s], g.line[:, s], h, g.measured[0, s], g.measured[1, s], f,
                                     noise, bias, decay, fade, slowness)  # fmt: skip
            g.todo[s] = _CHANGED if sets_off != 0.0 else 1.0
    for s in range(end_moving):
        if g.todo[s] == PHASE_MOTION:
            g.factor[s] = f = g.measured[3, s]
            light.predict(g.x[:, s], g.p[:, s], h, decay, density, bias)
            light.update_position(g.x[:, s], g.p[:, s], g.measured[0, s], g.measured[1, s], f, ekf.white(f, noise))
            g.todo[s] = _CHANGED if light.stopped(g.x[:, s], g.p[:, s]) else 2.0
    for s in range(end):
        if g.todo[s] != 0.0:
            ekf.predict_size(g.size[:, s], g.p_size[:, s], decay_size, bias_size)
            ekf.update_size(g.size[:, s], g.p_size[:, s], g.measured[2, s], g.factor[s], noise_size)
    for s in range(end):
        if g.todo[s] == _CHANGED:
            if t.phase[o, k, s] == PHASE_MOTION:
                phase = light.stop(g.x[:, s], g.p[:, s], g.line[:, s], g.measured[0, s], g.measured[1, s], g.factor[s], scan)
            else:
                phase = light.set_off(g.x[:, s], g.p[:, s], g.line[:, s])
            t.phase[o, k, s] = phase
