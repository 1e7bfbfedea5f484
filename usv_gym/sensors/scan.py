"""Radar and LiDAR: one scan of an observer measures position and size of all it can see.

Seen is what lies within range, beyond the minimum range, not in the shadow of something nearer or of land, and is detected:
P_d = detection * a^2 / (a^2 + detection_radius^2) for the half-width a that the source shows.  A measurement is relative to
the own ship and is reported at the own ship's *measured* position.  Its error is f(d) (b + v), f(d) = k d, with a slowly
drifting bias b and white noise v (thesis 2.4-2.5); the bias is discretised exactly.
"""

from __future__ import annotations

import math

from .. import rng
from ..jit import inner, spliced
from ..trig import exp, hypot
from ..world.state import LIDAR, RADAR
from .clutter import false_alarms
from .coastline import deliver_land, echo_land, hide_behind_land
from .noise import pair_slot
from .shadow import apparent_half_width, cast_shadows, look_around
from .tdm import take_scan


@spliced
def deliver(w, o, k, tick):
    """Hand the last scan of radar (k = 0) or LiDAR (k = 1) to the tracker, once its latency is over."""
    t = w.tracks
    if t.scan_due[o, k] < 0 or t.scan_due[o, k] > tick:
        return
    t.scan_due[o, k] = -1
    deliver_land(w, o, k)
    if t.scan_found[o, k] == 0:
        return
    for s in range(t.id.shape[1]):
        if t.measured_us[o, k, s] == t.scan_us[o, k]:
            if k == RADAR - 1:
                take_scan(w, o, k, s, w.sensors.radar)
            else:
                take_scan(w, o, k, s, w.sensors.lidar)


@inner
def _decay(bias, bias_time, seconds):
    """Share of a bias [m] that is left after so long, and standard deviation of what is new."""
    a = exp(-seconds / bias_time) if seconds >= 0.0 and bias_time > 0.0 else 0.0
    return a, bias * math.sqrt(1.0 - a * a)


@inner
def _scan(w, land, o, k, sensor, reach, tick, stream_bias, stream_noise, stream_detection,
          stream_land, clutter, stream_clutter):
    t = w.tracks
    own = w.observer[o]
    S = t.id.shape[1]
    for s in range(S):
        t.visible[o, k, s] = 0
    if sensor.outage:
        return
    t.scan_found[o, k] = 0
    count = look_around(w, own, reach)
    cast_shadows(w, count)
    hide_behind_land(w, land, own, count)
    V = w.vessels.active.shape[0]
    now = tick * w.dt_us
    before = now + 1  # when the last source's bias was drawn: nearly all were in the same scan
    a0 = g0 = a1 = g1 = 0.0
    for i in range(count):
        s = w.order[i]
        if w.hidden[s]:
            continue
        t.visible[o, k, s] = 1
        d = w.ranges[s]
        if d < sensor.range_min:
            continue
        detection = sensor.detection * w.weather.detection_factor
        if sensor.detection_radius > 0.0:
            shown = apparent_half_width(w, s)
            detection *= shown * shown / (shown * shown + sensor.detection_radius * sensor.detection_radius)
        if detection < 1.0 and rng.uniform(w.seed, stream_detection, pair_slot(w, o, s), tick) >= detection:
            continue
        if t.scan_bias_us[o, k, s] != before:
            before = t.scan_bias_us[o, k, s]
            seconds = (now - before) * 1.0e-6 if before >= 0 else -1.0
            a0, g0 = _decay(sensor.bias[0], sensor.bias_time[0], seconds)
            a1, g1 = _decay(sensor.bias[1], sensor.bias_time[1], seconds)
        t.scan_bias_us[o, k, s] = now
        slot = 2 * pair_slot(w, o, s)
        b0, b1 = rng.normal2(w.seed, stream_bias, slot, tick)
        b2, n2 = rng.normal2(w.seed, stream_bias, slot + 1, tick)
        n0, n1 = rng.normal2(w.seed, stream_noise, slot, tick)
        b = t.scan_bias[o, k, s]
        b[0] = a0 * b[0] + g0 * b0
        b[1] = a0 * b[1] + g0 * b1
        b[2] = a1 * b[2] + g1 * b2
        en, ee, er = b[0] + sensor.noise[0] * n0, b[1] + sensor.noise[0] * n1, b[2] + sensor.noise[1] * n2
        f = sensor.gain * d
        if s < V:
            dn = w.vessels.eta[s, 0] - w.vessels.eta[own, 0]
            de = w.vessels.eta[s, 1] - w.vessels.eta[own, 1]
            radius = 0.5 * max(w.vessels.length[s], w.vessels.beam[s])
        else:
            dn = w.obstacles.position[s - V, 0] - w.vessels.eta[own, 0]
            de = w.obstacles.position[s - V, 1] - w.vessels.eta[own, 1]
            radius = w.obstacles.radius[s - V]
        dn += f * en
        de += f * ee
        t.measured[o, k, s, 0] = w.nav.position[o, 0] + dn
        t.measured[o, k, s, 1] = w.nav.position[o, 1] + de
        t.measured[o, k, s, 2] = max(radius + f * er, w.sensors.radius_min)
        # the controller's side knows the measured range only
        t.measured[o, k, s, 3] = max(sensor.gain * hypot(dn, de), sensor.gain_floor)
        t.measured_us[o, k, s] = now
        t.scan_found[o, k] += 1
    echo_land(w, land, o, k, sensor, reach, tick, count, stream_land, stream_land + 1)
    if w.clutter:
        false_alarms(w, o, k, sensor, reach, clutter, tick, stream_clutter)
    t.scan_us[o, k] = now
    t.scan_due[o, k] = tick + sensor.latency_us // w.dt_us


@inner
def scan_radar(w, land, o, tick):
    """One revolution of the radar of observer o."""
    p = w.sensors.radar
    _scan(w, land, o, RADAR - 1, p, p.range * w.weather.radar_range_factor, tick,
          rng.RADAR_BIAS, rng.RADAR_NOISE, rng.RADAR_DETECTION, rng.RADAR_LAND,
          p.false_alarms + w.weather.radar_clutter, rng.RADAR_CLUTTER)  # fmt: skip


@inner
def scan_lidar(w, land, o, tick):
    """One sweep of the LiDAR of observer o."""
    p = w.sensors.lidar
    _scan(w, land, o, LIDAR - 1, p, p.range * w.weather.lidar_range_factor, tick,
          rng.LIDAR_BIAS, rng.LIDAR_NOISE, rng.LIDAR_DETECTION, rng.LIDAR_LAND,
          p.false_alarms + w.weather.lidar_clutter, rng.LIDAR_CLUTTER)  # fmt: skip
