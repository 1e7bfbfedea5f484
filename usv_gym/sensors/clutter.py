"""False alarms: echoes of rain, snow and sea that radar and LiDAR take for objects.

Each is a source of its own that nothing else knows of: one of the record's phantoms, inactive obstacle slots at the end.  It
starts a track as any echo does, may come back in the next scans near the same place, and times out; then the slot is free for
another.  They are independent of what is really there, and draw from streams of their own.
"""

from __future__ import annotations

import math

from .. import rng
from ..jit import inner
from ..trig import TWO_PI, sincos
from ..world.state import LIDAR_PHANTOMS, PHASE_NONE, RADAR, RADAR_PHANTOMS

RETURNS = 0.3  #: probability that a false alarm is there in the next scan too: a wave crest or a squall lasts


@inner
def false_alarms(w, o, k, sensor, reach, rate, tick, stream):
    """Add the false alarms of a scan of radar (k = 0) or LiDAR (k = 1), ``rate`` of them on average while slots are free."""
    t = w.tracks
    M = w.obstacles.active.shape[0]
    last = M - 1 if k == RADAR - 1 else M - 1 - RADAR_PHANTOMS
    count = RADAR_PHANTOMS if k == RADAR - 1 else LIDAR_PHANTOMS
    now = tick * w.dt_us
    for i in range(count):
        s = w.vessels.active.shape[0] + last - i
        slot = 4 * (16 * o + i)
        held = t.phase[o, k + 1, s] != PHASE_NONE
        if not held and t.id[o, s] != 0:
            continue  # the TDM has yet to drop the one before
        chance = RETURNS if held else min(rate / count, 1.0)
        if rng.uniform(w.seed, stream, slot, tick) >= chance:
            continue
        measured = t.filters[o, k + 1].measured[:, s]
        if held:
            if now - t.measured_us[o, k, s] > sensor.timeout_us:
                continue  # timed out; the TDM will notice
            a, b = rng.normal2(w.seed, stream, slot + 1, tick)
            spread = measured[3] * sensor.noise[0]
            measured[0] += spread * a
            measured[1] += spread * b
        else:
            # anywhere in what the sensor covers, all areas alike
            near2 = sensor.range_min * sensor.range_min
            d = math.sqrt(near2 + (max(reach * reach, near2) - near2) * rng.uniform(w.seed, stream, slot + 1, tick))
            sine, cosine = sincos(TWO_PI * rng.uniform(w.seed, stream, slot + 2, tick))
            measured[0] = w.nav.position[o, 0] + d * cosine
            measured[1] = w.nav.position[o, 1] + d * sine
            measured[2] = w.sensors.radius_min * (1.0 + rng.uniform(w.seed, stream, slot + 3, tick))
            measured[3] = max(sensor.gain * d, sensor.gain_floor)
        t.measured_us[o, k, s] = now
        t.scan_found[o, k] += 1
