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
from ..world.carry import place
from ..world.state import LIDAR, MODEL_3DOF, RADAR
from .clutter import false_alarms
from .coastline import deliver_land, echo_land, hide_behind_land
from .intake import take_scan
from .noise import pair_slot
from .shadow import (
    BEAM,
    BEARING,
    DE,
    DN,
    HEADING,
    HIGH,
    LENGTH,
    LOW,
    RADIUS,
    RANGE,
    WIDTH,
    cast_shadows,
    look_around,
    look_at,
)

#: rows of ``w.look`` that a scan puts in the place of what the shadows are done with: decay and kick of the bias of position
#: and of radius, the three biases, 1 for what is detected
_A0, _G0, _A1, _G1, _BIAS, _FOUND = HEADING, BEAM, LENGTH, LOW, BEARING, HIGH
_SURE = 0.01  #: [m] more than rounding can make


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
    take_scan(w, o, k + 1, w.sensors.radar if k == RADAR - 1 else w.sensors.lidar)


@inner
def _decay(bias, bias_time, seconds):
    """Share of a bias [m] that is left after so long, and standard deviation of what is new."""
    a = exp(-seconds / bias_time) if seconds >= 0.0 and bias_time > 0.0 else 0.0
    return a, bias * math.sqrt(1.0 - a * a)


@inner
def _moved(w, o, tick):
    """How far [m] the own ship and any source may have come nearer to each other since the LiDAR last looked at all sources."""
    t, weather, own = w.tracks, w.weather, w.observer[o]
    current = weather.current_speed + weather.current_slow.limit if weather.current_speed > 0.0 else 0.0
    moved = hypot(w.vessels.eta[own, 0] - t.looked_from[o, 0], w.vessels.eta[own, 1] - t.looked_from[o, 1])
    moved += t.fastest[o] * ((tick - t.looked_tick[o]) * w.dt)
    return moved + 2.0 * current * ((tick - w.frame_tick) * w.dt)  # what drifts, from the start of the frame to then and to now


@inner
def lidars_know(w, tick):
    """True if the LiDAR of every observer knows which few sources it has to look at: within a frame ships move as foreseen."""
    for o in range(w.observer.shape[0]):
        if w.tracks.looked_tick[o] < w.frame_tick or not _moved(w, o, tick) + _SURE < w.tracks.slack[o]:
            return False
    return True


@inner
def _remember(w, o, own, reach, tick):
    """Note which sources may come into the LiDAR's reach soon."""
    t, v, m = w.tracks, w.vessels, w.obstacles
    V = v.active.shape[0]
    fastest2 = 0.0
    for s in range(V):
        if v.active[s] and s != own:
            # a vessel with forces is bound to nothing
            speed2 = v.velocity[s, 0] * v.velocity[s, 0] + v.velocity[s, 1] * v.velocity[s, 1]
            fastest2 = max(fastest2, math.inf if v.model[s] == MODEL_3DOF else speed2)
    for i in range(m.active.shape[0]):
        if m.active[i]:
            fastest2 = max(fastest2, m.velocity[i, 0] * m.velocity[i, 0] + m.velocity[i, 1] * m.velocity[i, 1])
    t.looked_tick[o] = tick
    t.looked_from[o, 0], t.looked_from[o, 1] = v.eta[own, 0], v.eta[own, 1]
    t.fastest[o] = math.sqrt(fastest2)
    # as far as things come in a frame, about
    own_speed = hypot(v.nu[own, 0], v.nu[own, 1])
    t.slack[o] = _SURE + 1.5 * (own_speed + t.fastest[o] + w.weather.current_speed) * w.frame_ticks * w.dt
    far2 = (reach + t.slack[o]) * (reach + t.slack[o])
    t.close_count[o] = 0
    for s in range(V + m.active.shape[0]):
        if s < V:
            dn, de, there = v.eta[s, 0] - v.eta[own, 0], v.eta[s, 1] - v.eta[own, 1], v.active[s] != 0 and s != own
        else:
            dn, de = m.position[s - V, 0] - v.eta[own, 0], m.position[s - V, 1] - v.eta[own, 1]
            there = m.active[s - V] != 0
        if there and dn * dn + de * de <= far2:
            t.close[o, t.close_count[o]] = s
            t.close_count[o] += 1


@inner
def _scan(w, land, o, k, sensor, reach, tick, stream_bias, stream_noise, stream_detection,
          stream_land, clutter, stream_clutter):
    t, g, look = w.tracks, w.tracks.filters[o, k + 1], w.look
    own = w.observer[o]
    for s in range(t.id.shape[1]):
        t.visible[o, k, s] = 0
    if sensor.outage:
        return
    t.scan_found[o, k] = 0
    if w.traffic_tick == tick:
        count = look_around(w, o, reach)
        if k == LIDAR - 1:
            _remember(w, o, own, reach, tick)
    else:  # only for a LiDAR
        for i in range(t.close_count[o]):
            place(w, t.close[o, i], tick)
        count = look_at(w, o, reach, t.close[o], t.close_count[o])
    cast_shadows(w, count)
    hide_behind_land(w, land, own, count)
    echo_land(w, land, o, k, sensor, reach, tick, count, stream_land, stream_land + 1)
    now = tick * w.dt_us
    before = now + 1  # when the last source's bias was drawn: nearly all were in the same scan
    a0 = g0 = a1 = g1 = 0.0
    seen = 0
    for i in range(count):  # what may be detected moves up
        s = w.order[i]
        if w.hidden[i]:
            continue
        t.visible[o, k, s] = 1
        if look[RANGE, i] < sensor.range_min:
            continue
        if t.scan_bias_us[o, k, s] != before:
            before = t.scan_bias_us[o, k, s]
            seconds = (now - before) * 1.0e-6 if before >= 0 else -1.0
            a0, g0 = _decay(sensor.bias[0], sensor.bias_time[0], seconds)
            a1, g1 = _decay(sensor.bias[1], sensor.bias_time[1], seconds)
        w.order[seen] = s
        w.slots[seen] = pair_slot(w, o, s)
        look[DN, seen], look[DE, seen] = look[DN, i], look[DE, i]
        look[WIDTH, seen], look[RANGE, seen] = look[WIDTH, i], look[RANGE, i]
        look[RADIUS, seen] = look[RADIUS, i] + 0.5 * max(look[LENGTH, i], look[BEAM, i])
        look[_A0, seen], look[_G0, seen], look[_A1, seen], look[_G1, seen] = a0, g0, a1, g1
        for c in range(3):
            look[_BIAS + c, seen] = g.bias[c, s]
        seen += 1
    seed, north, east = w.seed, w.nav.position[o, 0], w.nav.position[o, 1]
    detection = sensor.detection * w.weather.detection_factor
    half2 = sensor.detection_radius * sensor.detection_radius
    gain, floor, radius_min = sensor.gain, sensor.gain_floor, w.sensors.radius_min
    noise0, noise1 = sensor.noise[0], sensor.noise[1]
    for i in range(seen):  # vector code
        slot = w.slots[i]
        b0, b1 = rng.normal2(seed, stream_bias, 2 * slot, tick)
        b2, v2 = rng.normal2(seed, stream_bias, 2 * slot + 1, tick)
        v0, v1 = rng.normal2(seed, stream_noise, 2 * slot, tick)
        shown = look[WIDTH, i] * look[WIDTH, i]
        chance = detection * (shown / (shown + half2) if half2 > 0.0 else 1.0)
        look[_FOUND, i] = 1.0 if rng.uniform(seed, stream_detection, slot, tick) < chance else 0.0
        b0 = look[_A0, i] * look[_BIAS, i] + look[_G0, i] * b0
        b1 = look[_A0, i] * look[_BIAS + 1, i] + look[_G0, i] * b1
        b2 = look[_A1, i] * look[_BIAS + 2, i] + look[_G1, i] * b2
        f = gain * look[RANGE, i]
        dn = look[DN, i] + f * (b0 + noise0 * v0)
        de = look[DE, i] + f * (b1 + noise0 * v1)
        look[_BIAS, i], look[_BIAS + 1, i], look[_BIAS + 2, i] = b0, b1, b2
        look[DN, i], look[DE, i] = north + dn, east + de
        look[RADIUS, i] = max(look[RADIUS, i] + f * (b2 + noise1 * v2), radius_min)
        # the controller's side knows the measured range only
        look[RANGE, i] = max(gain * hypot(dn, de), floor)
    found = 0
    for i in range(seen):
        if look[_FOUND, i] == 0.0:
            continue
        s = w.order[i]
        for c in range(3):
            g.bias[c, s] = look[_BIAS + c, i]
        t.scan_bias_us[o, k, s] = now
        g.measured[0, s] = look[DN, i]
        g.measured[1, s] = look[DE, i]
        g.measured[2, s] = look[RADIUS, i]
        g.measured[3, s] = look[RANGE, i]
        t.measured_us[o, k, s] = now
        found += 1
    t.scan_found[o, k] = found
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
