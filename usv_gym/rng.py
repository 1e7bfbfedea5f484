"""Noise inside a step: a counter, not a generator.

Every random number is a pure function of (world seed, stream, slot, tick).  Nothing is carried along, so a sensor that
does not fire draws nothing, a controller that acts differently moves nobody's noise, and row i of any batch equals the
same world alone.  The generator is SplitMix64 (Steele, Lea and Flood 2014) read at any place: the counter's place in the stream
of the world's seed.

``numpy.random.Generator`` is used at reset only, to draw ``seed`` and the scenario.
"""

from __future__ import annotations

import math

import numpy as np

from .jit import scalar
from .trig import log, sincos_random

# Streams: one per use, never reused.  Each world draws stream x slot x tick.
WIND, CURRENT, WAVE = 1, 2, 3
GNSS, IMU, SPEED_LOG, WIND_SENSOR, MRU, GNSS_SPEED = 10, 11, 12, 13, 14, 15
AIS_BIAS, AIS_NOISE, AIS_LOSS, AIS_PHASE, AIS_LATENCY = 20, 21, 22, 23, 24
RADAR_BIAS, RADAR_NOISE, RADAR_DETECTION, RADAR_CLUTTER = 30, 31, 32, 33
RADAR_LAND, RADAR_LAND_DETECTION = 34, 35
LIDAR_BIAS, LIDAR_NOISE, LIDAR_DETECTION, LIDAR_CLUTTER = 40, 41, 42, 43
LIDAR_LAND, LIDAR_LAND_DETECTION = 44, 45
FAMILY, FAILURES = 60, 61
WHIM = 70  # of an erratic boat

_GOLDEN = np.uint64(0x9E3779B97F4A7C15)
_M1 = np.uint64(0xBF58476D1CE4E5B9)
_M2 = np.uint64(0x94D049BB133111EB)
_S30, _S27, _S31, _S11 = np.uint64(30), np.uint64(27), np.uint64(31), np.uint64(11)
_SLOT_BITS, _STREAM_BITS = np.uint64(32), np.uint64(52)
_S32, _LOW = np.uint64(32), np.uint64(0xFFFFFFFF)
_TO_UNIT = 1.0 / 9007199254740992.0  # 2^-53
_TO_UNIT32 = 1.0 / 4294967296.0


@scalar
def _mix(z):
    z = (z ^ (z >> _S30)) * _M1
    z = (z ^ (z >> _S27)) * _M2
    return z ^ (z >> _S31)


@scalar
def bits(seed, stream, slot, tick):
    """64 random bits of a counter: number ``word`` of the SplitMix64 stream ``seed``; slot < 2^20, tick < 2^32."""
    word = (np.uint64(stream) << _STREAM_BITS) | (np.uint64(slot) << _SLOT_BITS) | np.uint64(tick)
    return _mix(np.uint64(seed) + word * _GOLDEN)


@scalar
def uniform(seed, stream, slot, tick):
    """One number in [0, 1)."""
    return np.float64(np.int64(bits(seed, stream, slot, tick) >> _S11)) * _TO_UNIT


@scalar
def normal2(seed, stream, slot, tick):
    """Two independent standard normal numbers (Box and Muller 1958)."""
    word = bits(seed, stream, slot, tick)
    # half of the bits each: normal numbers up to 6.7 standard deviations
    u = (np.float64(np.int64(word >> _S32)) + 0.5) * _TO_UNIT32
    v = np.float64(np.int64(word & _LOW)) * _TO_UNIT32
    radius = math.sqrt(-2.0 * log(u))
    s, c = sincos_random(2.0 * math.pi * v)
    return radius * c, radius * s
