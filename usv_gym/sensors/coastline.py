"""Land in the picture: what radar and LiDAR echo of it, what it hides, and what the TDM and the chart say of it.

A scan gives the nearest land in each of L bearing sectors from true north.  A sector in which an object hides the nearest
land is looked through between the objects, along five rays.  The range has the sensor's noise and bias as one white error,
f(d) sqrt(bias^2 + noise^2), drawn for each sector and scan: along a coast neighbouring echoes come from different places.
Land is wide, so what lies within a sensor's minimum range is echoed by the land behind it.
"""

from __future__ import annotations

import math

from .. import rng
from ..jit import inner, spliced
from ..trig import TWO_PI, atan2, hypot, sincos, wrap
from ..world.shore import (
    bearing_sectors,
    clearance,
    coast,
    nearest_land,
    ray_range,
    sector_bearing,
    sector_of,
)
from ..world.state import DESCRIPTOR_LAND, LIDAR, RADAR, L, T
from .shadow import BEARING, HALF, RANGE

CHART_REACH = 1852.0  #: [m] how far around the own ship the chart is read
CHART_STEP = 10.0  #: [m] from where it was read last, it is read again
RAYS = 5  #: per sector, where objects hide land
#: neighbouring echoes belong to two stretches of coast if one is so many times as far as the other and that much farther [m];
#: along a straight shore the ratio stays below 2.6 up to 18 times the distance abeam
GAP_RATIO, GAP = 3.0, 50.0


@inner
def hide_behind_land(w, land, own, count):
    """Set ``w.hidden`` of sources of a look that land hides: the centre, and both ends of its width."""
    h = coast(land, w.land_id)
    if h == 0:
        return
    n, e = w.vessels.eta[own, 0], w.vessels.eta[own, 1]
    free = clearance(land, h, n, e)
    for i in range(count):
        d = w.look[RANGE, i]
        if w.hidden[i] or d <= free:
            continue
        bearing, half = w.look[BEARING, i], w.look[HALF, i]
        blocked = True
        for side in range(3):
            if blocked:
                rs, rc = sincos(bearing + (0.0 if side == 0 else half if side == 1 else -half))
                blocked = ray_range(land, h, n, e, rc, rs, d) < d
        if blocked:
            w.hidden[i] = 1


@inner
def _covered(w, count, bearing, r):
    """True if a source nearer than r [m] stands in a bearing."""
    for i in range(count):
        if w.look[RANGE, i] >= r:
            return False
        if abs(wrap(bearing - w.look[BEARING, i])) <= w.look[HALF, i]:
            return True
    return False


@inner
def _look_between(w, land, h, n, e, i, reach, count, echo):
    """Nearest land in sector i that no object hides, along rays; echo[i] is relative to (n, e)."""
    best = reach
    bn = be = math.nan
    for ray in range(RAYS):
        bearing = sector_bearing(i) + (ray + 0.5) * TWO_PI / (RAYS * L)
        s, c = sincos(bearing)
        r = ray_range(land, h, n, e, c, s, best)
        if r < best and not _covered(w, count, bearing, r):
            best, bn, be = r, r * c, r * s
    echo[i, 0] = bn
    echo[i, 1] = be


@spliced
def echo_land(w, land, o, k, sensor, reach, tick, count, stream_noise, stream_detection):
    """What a scan of radar (k = 0) or LiDAR (k = 1) of observer o gets back from land, between the sources of its look."""
    h = coast(land, w.land_id)
    if h == 0:
        return
    t = w.tracks
    own = w.observer[o]
    n, e = w.vessels.eta[own, 0], w.vessels.eta[own, 1]
    echo = t.land[o, k, 0]
    t.land_us[o, k, 0] = tick * w.dt_us
    if not nearest_land(land, h, n, e, reach, echo):
        return
    for m in range(count):
        bearing, half = w.look[BEARING, m], w.look[HALF, m]
        first, sectors = bearing_sectors(bearing, half)
        for step in range(sectors):
            i = (first + step) % L
            r = hypot(echo[i, 0], echo[i, 1])
            if r > w.look[RANGE, m] and abs(wrap(atan2(echo[i, 1], echo[i, 0]) - bearing)) <= half:
                _look_between(w, land, h, n, e, i, reach, count, echo)
    detection = sensor.detection * w.weather.detection_factor
    spread = sensor.gain * hypot(sensor.noise[0], sensor.bias[0])
    pair, even, odd = -1, 0.0, 0.0
    for i in range(L):
        r2 = echo[i, 0] * echo[i, 0] + echo[i, 1] * echo[i, 1]
        if not r2 > 0.0:
            continue
        r = math.sqrt(r2)
        if detection < 1.0 and rng.uniform(w.seed, stream_detection, L * o + i, tick) >= detection:
            echo[i, 0] = echo[i, 1] = math.nan
            continue
        if i >> 1 != pair:  # two sectors share a draw of two numbers
            pair = i >> 1
            even, odd = rng.normal2(w.seed, stream_noise, L * o + pair, tick)
        seen = max(r, sensor.range_min)
        stretch = max(seen + spread * seen * (odd if i & 1 else even), 0.0) / r
        echo[i, 0] = w.nav.position[o, 0] + echo[i, 0] * stretch
        echo[i, 1] = w.nav.position[o, 1] + echo[i, 1] * stretch


@inner
def deliver_land(w, o, k):
    """The last scan's echoes of land arrive at the tracker."""
    if w.land_id < 0:
        return
    t = w.tracks
    t.land_us[o, k, 1] = t.land_us[o, k, 0]
    for i in range(L):
        t.land[o, k, 1, i, 0] = t.land[o, k, 0, i, 0]
        t.land[o, k, 1, i, 1] = t.land[o, k, 0, i, 1]


@spliced
def publish_land(w, land, o, tick):
    """Write land into the picture of observer o: echoes by sector (the LiDAR's first), the chart, stretches of coast."""
    p, t, pic = w.sensors, w.tracks, w.picture
    h = coast(land, w.chart_id)
    north, east = w.nav.position[o, 0], w.nav.position[o, 1]
    at = pic.chart_place[o]
    if h != 0 and not hypot(north - at[0], east - at[1]) <= CHART_STEP:  # NaN: not read yet
        at[0] = north
        at[1] = east
        nearest_land(land, h, north, east, CHART_REACH, pic.chart[o])
        for i in range(L):
            pic.chart[o, i, 0] += north
            pic.chart[o, i, 1] += east
    if coast(land, w.land_id) == 0:
        return
    now = tick * w.dt_us
    radar = t.land_us[o, 0, 1] >= 0 and now - t.land_us[o, 0, 1] <= p.radar.timeout_us
    lidar = t.land_us[o, 1, 1] >= 0 and now - t.land_us[o, 1, 1] <= p.lidar.timeout_us
    for i in range(L):
        sensors = 0
        if radar and t.land[o, 0, 1, i, 0] == t.land[o, 0, 1, i, 0]:
            sensors = 1 << RADAR
        near = lidar and t.land[o, 1, 1, i, 0] == t.land[o, 1, 1, i, 0]
        if near:
            sensors |= 1 << LIDAR
        k = 1 if near else 0
        pic.land[o, i, 0] = t.land[o, k, 1, i, 0] if sensors else math.nan
        pic.land[o, i, 1] = t.land[o, k, 1, i, 1] if sensors else math.nan
        pic.land_sensors[o, i] = sensors
    _stretches(w, o)


@inner
def _apart(w, o, i, k):
    """True if the echoes of sectors i and k do not belong to one stretch of coast, or one of them is missing."""
    a, b = w.picture.land[o, i], w.picture.land[o, k]
    ra = hypot(a[0] - w.nav.position[o, 0], a[1] - w.nav.position[o, 1])
    rb = hypot(b[0] - w.nav.position[o, 0], b[1] - w.nav.position[o, 1])
    return not max(ra, rb) <= max(GAP_RATIO * min(ra, rb), min(ra, rb) + GAP)


@inner
def _stretches(w, o):
    """Group echoes into stretches of coast and report the T nearest as targets: the nearest point of each.

    A stretch keeps the id and the slot of the one whose point lay in the sectors that it covers now.
    """
    pic = w.picture
    S = w.tracks.id.shape[1]
    north, east = w.nav.position[o, 0], w.nav.position[o, 1]
    # work space: first and last sector, sector of the nearest point and its range, of up to T stretches
    first, last, at, ranges, slots = w.lit_from, w.lit_to, w.order, w.ranges, w.hidden
    start = 0
    for i in range(L):
        if _apart(w, o, (i + L - 1) % L, i):
            start = i
            break
    found = 0
    i = start
    while i < start + L:
        begin = i
        nearest, where = math.inf, -1
        while True:
            k = i % L
            r = hypot(pic.land[o, k, 0] - north, pic.land[o, k, 1] - east)
            if r < nearest:
                nearest, where = r, k
            i += 1
            if i >= start + L or _apart(w, o, k, i % L):
                break
        if where < 0:
            continue
        place = found
        if found == T:  # no room: instead of the farthest, if that is farther
            place = 0
            for q in range(1, T):
                if ranges[q] > ranges[place]:
                    place = q
            if ranges[place] <= nearest:
                continue
        else:
            found += 1
        first[place], last[place], at[place], ranges[place], slots[place] = begin, i - 1, where, nearest, -1
    for q in range(S, S + T):
        taken = False
        if pic.id[o, q] != 0:
            k = sector_of(atan2(pic.position[o, q, 1] - east, pic.position[o, q, 0] - north))
            for m in range(found):
                if not taken and slots[m] < 0 and (k + L - first[m]) % L <= last[m] - first[m]:
                    slots[m] = q - S
                    taken = True
        if not taken:
            pic.id[o, q] = 0
    p = w.sensors
    for m in range(found):
        q = S + slots[m]
        if slots[m] < 0:
            q = S
            while pic.id[o, q] != 0:
                q += 1
            pic.next_id[o] += 1
            pic.id[o, q] = pic.next_id[o]
        k = at[m]
        seen = pic.land_sensors[o, k]
        spread = p.radar.gain * hypot(p.radar.noise[0], p.radar.bias[0])
        if seen & (1 << LIDAR):
            spread = p.lidar.gain * hypot(p.lidar.noise[0], p.lidar.bias[0])
        pic.descriptor[o, q] = DESCRIPTOR_LAND
        pic.sensors[o, q] = seen
        pic.motion_known[o, q] = 0
        pic.position[o, q, 0] = pic.land[o, k, 0]
        pic.position[o, q, 1] = pic.land[o, k, 1]
        pic.cog[o, q] = pic.sog[o, q] = pic.rot[o, q] = math.nan
        pic.radius[o, q] = pic.radius_variance[o, q] = math.nan  # land is no disc
        pic.covariance[o, q, 0] = pic.covariance[o, q, 2] = (spread * ranges[m]) ** 2
        pic.covariance[o, q, 1] = 0.0
        pic.covariance[o, q, 3] = pic.covariance[o, q, 4] = math.nan
    pic.count[o] += found
