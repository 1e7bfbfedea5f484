"""AIS: what ships and aids to navigation transmit, and which messages an observer receives.

A report is the truth plus a slowly drifting bias plus white noise (thesis 2.1-2.3).  The bias is discretised exactly over
the time since the last message: a = exp(-t / T), variance sigma_b^2 (1 - a^2).  What is received has the resolution of the
wire (ITU-R M.1371: position 1/10000 min, SOG 0.1 kn, COG 0.1 deg, heading 1 deg, ROT in its square-root code).
Sentences are made from these values on demand (sensors/sentences.py).
"""

from __future__ import annotations

import math

import numpy as np

from .. import rng
from ..jit import inner
from ..trig import atan2, exp, hypot, wrap, wrap_positive
from ..units import DEG, DEG_PER_MIN, KNOT
from ..world.state import AIS_ATON, AIS_CLASS_A, AIS_CLASS_B
from .noise import noise_slot, pair_slot

NEVER = 1 << 60  #: a tick that does not come
_SECOND = 1_000_000
ATON_INTERVAL_US = 180 * _SECOND  #: type 21: every three minutes
_TURNING = 5.0 * DEG_PER_MIN  #: [rad/s] above which a class A station reports at the shorter interval


@inner
def next_fire(tick, dt_us, period_us):
    """First tick after ``tick`` at which floor(t / period) advances."""
    if period_us <= 0:
        return NEVER
    if period_us <= dt_us:  # every tick; and divisions are dear
        return tick + 1
    k = (tick * dt_us) // period_us + 1
    return max((k * period_us + dt_us - 1) // dt_us, tick + 1)


@inner
def reporting_interval_us(ais_class, speed, rot, fixed_us):
    """Interval between position reports [us]; the schedule of ITU-R M.1371-5 table 1 unless ``fixed_us`` is set."""
    if ais_class == AIS_ATON:
        return ATON_INTERVAL_US
    if fixed_us > 0:
        return fixed_us
    knots = speed / KNOT
    if ais_class == AIS_CLASS_B:
        return 180 * _SECOND if knots <= 2.0 else 30 * _SECOND
    turning = abs(rot) > _TURNING
    if knots > 23.0:
        return 2 * _SECOND
    if knots > 14.0:
        return 2 * _SECOND if turning else 6 * _SECOND
    if knots <= 0.2:  # moored or at anchor
        return 180 * _SECOND
    return 10 * _SECOND // 3 if turning else 10 * _SECOND


@inner
def transmits(w, s):
    """True if source s carries a working AIS transmitter."""
    V = w.vessels.active.shape[0]
    if s < V:
        return w.vessels.active[s] and w.vessels.ais_on[s] and w.vessels.ais_class[s] > 0
    i = s - V
    return w.obstacles.active[i] and w.obstacles.ais_on[i] and w.obstacles.ais_class[i] > 0


@inner
def ais_class(w, s):
    """AIS class code of source s."""
    V = w.vessels.active.shape[0]
    return w.vessels.ais_class[s] if s < V else w.obstacles.ais_class[s - V]


@inner
def schedule(w, s, tick):
    """Set the tick of the first transmission of source s after ``tick``: a random phase within its interval."""
    a = w.ais
    if transmits(w, s) == 0 or w.sensors.ais_on == 0:
        a.next_tick[s] = NEVER
        return
    V = w.vessels.active.shape[0]
    speed = w.vessels.nu[s, 0] if s < V else 0.0
    interval = reporting_interval_us(ais_class(w, s), speed, 0.0, w.sensors.ais_interval_us)
    wait = np.int64(rng.uniform(w.seed, rng.AIS_PHASE, noise_slot(w, s), tick) * interval) // w.dt_us + 1
    a.next_tick[s] = tick + wait


@inner
def _quantise(value, step):
    return math.floor(value / step + 0.5) * step


@inner
def quantise_rot(rot):
    """Rate of turn [rad/s] through the AIS code: round(4.733 sqrt(deg/min)), at most 126."""
    code = min(math.floor(4.733 * math.sqrt(abs(rot) / DEG_PER_MIN) + 0.5), 126.0)
    rate = (code / 4.733) ** 2 * DEG_PER_MIN
    return rate if rot >= 0.0 else -rate


@inner
def transmit(w, s, tick):
    """Source s sends a position report: bias, noise, quantisation; then each observer receives it or not."""
    a, p = w.ais, w.sensors
    V = w.vessels.active.shape[0]
    seconds = (tick - a.last_tick[s]) * w.dt
    fresh = a.last_tick[s] < 0
    a.last_tick[s] = tick
    slot = 4 * noise_slot(w, s)
    b0, b1 = rng.normal2(w.seed, rng.AIS_BIAS, slot, tick)
    b2, b3 = rng.normal2(w.seed, rng.AIS_BIAS, slot + 1, tick)
    b4, b5 = rng.normal2(w.seed, rng.AIS_BIAS, slot + 2, tick)
    n0, n1 = rng.normal2(w.seed, rng.AIS_NOISE, slot, tick)
    n2, n3 = rng.normal2(w.seed, rng.AIS_NOISE, slot + 1, tick)
    n4, n5 = rng.normal2(w.seed, rng.AIS_NOISE, slot + 2, tick)
    drive = (b0, b1, b2, b3, b4, b5)
    decay, kick, T = 0.0, 1.0, 0.0
    for k in range(6):
        if fresh or p.ais_bias_time[k] <= 0.0:
            decay, kick, T = 0.0, 1.0, 0.0
        elif p.ais_bias_time[k] != T:  # most are equal, and an exponential is dear
            T = p.ais_bias_time[k]
            decay = exp(-seconds / T)
            kick = math.sqrt(1.0 - decay * decay)
        a.bias[s, k] = decay * a.bias[s, k] + p.ais_bias[k] * kick * drive[k]
    kind = ais_class(w, s)
    if s < V:
        v = w.vessels
        north, east = v.eta[s, 0], v.eta[s, 1]
        heading = v.eta[s, 2]
        vn, ve = v.velocity[s, 0], v.velocity[s, 1]
        sog = hypot(vn, ve)
        # a ship at rest has no course of its own: report the heading, as navigation systems do
        cog = heading + wrap(atan2(ve, vn) - heading) if sog > 0.05 else heading
        rot = v.nu[s, 2]
    else:
        north, east = w.obstacles.position[s - V, 0], w.obstacles.position[s - V, 1]
        heading = cog = sog = rot = 0.0
    north += a.bias[s, 0] + p.ais_noise[0] * n0
    east += a.bias[s, 1] + p.ais_noise[1] * n1
    a.sent_as[s] = a.spoof_source[s]
    if a.spoof_source[s]:
        lying = (tick - a.spoof_tick[s]) * w.dt
        north += a.spoof_offset[s, 0] + a.spoof_rate[s, 0] * lying
        east += a.spoof_offset[s, 1] + a.spoof_rate[s, 1] * lying
    cog = wrap_positive(cog + a.bias[s, 2] + p.ais_noise[2] * n2)
    heading = wrap_positive(heading + a.bias[s, 3] + p.ais_noise[3] * n3)
    sog = max(sog + a.bias[s, 4] + p.ais_noise[4] * n4, 0.0)
    rot = rot + a.bias[s, 5] + p.ais_noise[5] * n5
    if p.ais_quantised:
        lat = math.floor((w.origin[0] + north / w.metres_per_degree[0]) * 600000.0 + 0.5) / 600000.0
        lon = math.floor((w.origin[1] + east / w.metres_per_degree[1]) * 600000.0 + 0.5) / 600000.0
        north = (lat - w.origin[0]) * w.metres_per_degree[0]
        east = (lon - w.origin[1]) * w.metres_per_degree[1]
        cog = wrap_positive(_quantise(cog, 0.1 * DEG))
        heading = wrap_positive(_quantise(heading, DEG))
        sog = min(_quantise(sog, 0.1 * KNOT), 102.2 * KNOT)
        rot = quantise_rot(rot)
    if kind != AIS_CLASS_A:
        rot = math.nan  # types 18 and 21 have no rate of turn
    if kind == AIS_ATON:
        cog = heading = sog = math.nan
    a.position[s, 0] = north
    a.position[s, 1] = east
    a.cog[s] = cog
    a.heading[s] = heading
    a.sog[s] = sog
    a.rot[s] = rot
    a.stamp_us[s] = tick * w.dt_us
    a.sequence[s] += 1
    _receive(w, s, tick)
    speed = 0.0 if s >= V else w.vessels.nu[s, 0]
    turn = 0.0 if s >= V else w.vessels.nu[s, 2]
    a.next_tick[s] = tick + max(reporting_interval_us(kind, speed, turn, p.ais_interval_us) // w.dt_us, 1)


@inner
def _receive(w, s, tick):
    a, p = w.ais, w.sensors
    V = w.vessels.active.shape[0]
    for o in range(w.observer.shape[0]):
        own = w.observer[o]
        if own == s or w.vessels.active[own] == 0 or p.ais_jammed:
            continue
        north = w.vessels.eta[s, 0] if s < V else w.obstacles.position[s - V, 0]
        east = w.vessels.eta[s, 1] if s < V else w.obstacles.position[s - V, 1]
        dn, de = north - w.vessels.eta[own, 0], east - w.vessels.eta[own, 1]
        if dn * dn + de * de > p.ais_range * p.ais_range:
            continue
        slot = pair_slot(w, o, s)
        if p.ais_loss > 0.0 and rng.uniform(w.seed, rng.AIS_LOSS, slot, tick) < p.ais_loss:
            continue
        latency = p.ais_latency_us
        if latency > 0:
            latency = np.int64(rng.uniform(w.seed, rng.AIS_LATENCY, slot, tick) * latency)
        a.received[o, s] = a.sequence[s]
        a.due_tick[o, s] = tick + latency // w.dt_us
