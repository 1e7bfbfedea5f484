"""Observation kernels: what the controller gets to see, from own navigation and the sensor picture only.

``truth`` is the one exception, for ablation.  Layouts: tasks/task.py.  Everything is clipped into its bounds.
"""

from __future__ import annotations

import math

from ..jit import inner
from ..sensors.ais import ais_class
from ..trig import PI, TWO_PI, atan2, clip, hypot, sincos, sincos_random, wrap
from ..world.shore import coast, nearest_land
from ..world.state import AIS_ATON, DESCRIPTOR_VESSEL, L
from .task import N_OWN, N_TARGET, OBS_AIS, OBS_SECTORS, OBS_TRACKS, OBS_TRUTH


@inner
def cross_track_error(ax, ay, bx, by, n, e):
    """Signed distance [m] of a point from the line a -> b, + to starboard of its direction."""
    dn, de = bx - ax, by - ay
    length = hypot(dn, de)
    return (dn * (e - ay) - de * (n - ax)) / length if length > 0.0 else 0.0


@inner
def observe_own(w, o, task, north, east, heading, u, v, r, leg, obs):
    """Own part of the observation, from the position, heading, speeds and active leg that the caller believes in."""
    j = w.observer[o]
    route = w.routes
    obs[0] = clip(u / task.max_speed, -1.0, 1.0)
    obs[1] = clip(v / task.max_speed, -1.0, 1.0)
    obs[2] = clip(r / task.rate_scale, -1.0, 1.0)
    count = route.count[j]
    for i in range(3, N_OWN):
        obs[i] = 0.0
    obs[4] = obs[8] = obs[10] = 1.0
    if count == 0:
        return
    k = min(leg, count - 1)
    wn, we = route.waypoint[j, k, 0], route.waypoint[j, k, 1]
    dn, de = wn - north, we - east
    bearing = atan2(de, dn)
    course = bearing
    if k > 0:
        an, ae = route.waypoint[j, k - 1, 0], route.waypoint[j, k - 1, 1]
        if an != wn or ae != we:
            course = atan2(we - ae, wn - an)
            obs[5] = clip(cross_track_error(an, ae, wn, we, north, east) / task.cross_track_scale, -1.0, 1.0)
    obs[3], obs[4] = sincos(course - heading)
    obs[6] = clip(hypot(dn, de) / task.distance_scale, 0.0, 1.0)
    obs[7], obs[8] = sincos(bearing - heading)
    if k + 1 < count:
        following = atan2(route.waypoint[j, k + 1, 1] - we, route.waypoint[j, k + 1, 0] - wn)
        obs[9], obs[10] = sincos(following - course)
    else:
        obs[11] = 1.0


@inner
def _target(task, obs, at, dn, de, vn, ve, heading_s, heading_c, known, radius, spread, vessel):
    """One target's features, turned into {b}, into obs from ``at`` on."""
    obs[at] = 1.0
    obs[at + 1] = clip((heading_c * dn + heading_s * de) / task.range_scale, -1.0, 1.0)
    obs[at + 2] = clip((heading_c * de - heading_s * dn) / task.range_scale, -1.0, 1.0)
    if known:
        obs[at + 3] = clip((heading_c * vn + heading_s * ve) / task.target_speed_scale, -1.0, 1.0)
        obs[at + 4] = clip((heading_c * ve - heading_s * vn) / task.target_speed_scale, -1.0, 1.0)
        obs[at + 5] = 1.0
    else:
        obs[at + 3] = obs[at + 4] = obs[at + 5] = 0.0
    obs[at + 6] = clip(radius / task.radius_scale, 0.0, 1.0) if radius == radius else 0.0
    obs[at + 7] = clip(spread, 0.0, 1.0)
    obs[at + 8] = 1.0 if vessel else 0.0


@inner
def _ranges_of_truth(w, own, north, east):
    """Write the distance [m] of every source, less its radius, to a place into ``w.ranges``; inf for those that are not.

    Without a branch, as the two that follow, so that they become vector code.
    """
    v, m = w.vessels, w.obstacles
    V = v.active.shape[0]
    for s in range(V):
        distance = hypot(v.eta[s, 0] - north, v.eta[s, 1] - east)
        there = (v.active[s] != 0) & (s != own)
        w.ranges[s] = distance - 0.5 * max(v.length[s], v.beam[s]) if there else math.inf
    for i in range(m.active.shape[0]):
        distance = hypot(m.position[i, 0] - north, m.position[i, 1] - east)
        w.ranges[V + i] = distance - m.radius[i] if m.active[i] != 0 else math.inf


@inner
def _ranges_of_ais(w, o, north, east):
    """The same, of the sources that were heard on AIS."""
    a = w.ais
    for s in range(w.ranges.shape[0]):
        distance = hypot(a.inbox[o, s, 0] - north, a.inbox[o, s, 1] - east)
        w.ranges[s] = distance if a.inbox_stamp_us[o, s] >= 0 else math.inf


@inner
def _ranges_of_tracks(w, o, north, east, lag):
    """The same, of the detected targets, ``lag`` seconds after they were reported."""
    pic = w.picture
    for s in range(w.ranges.shape[0]):
        sine, cosine = sincos_random(pic.cog[o, s])
        way = pic.sog[o, s] * lag
        known = pic.motion_known[o, s] != 0
        dn = pic.position[o, s, 0] - north + (way * cosine if known else 0.0)
        de = pic.position[o, s, 1] - east + (way * sine if known else 0.0)
        radius = pic.radius[o, s] if pic.radius[o, s] == pic.radius[o, s] else 0.0
        w.ranges[s] = hypot(dn, de) - radius if pic.id[o, s] != 0 else math.inf


@inner
def _nearest(w, keep):
    """Put the ``keep`` sources of least ``w.ranges`` in order into ``w.order``, of equals the lower; returns how many."""
    found = 0
    farthest = math.inf
    for s in range(w.ranges.shape[0]):
        distance = w.ranges[s]
        if distance >= farthest:
            continue
        k = min(found, keep - 1)
        while k > 0 and w.ranges[w.order[k - 1]] > distance:
            w.order[k] = w.order[k - 1]
            k -= 1
        w.order[k] = s
        found = min(found + 1, keep)
        if found == keep:
            farthest = w.ranges[w.order[keep - 1]]
    return found


@inner
def observe(w, land, o, task, obs):
    """Write the flat observation of observer o into obs [size], float32."""
    nav, pic, v = w.nav, w.picture, w.vessels
    own = w.observer[o]
    V = v.active.shape[0]
    if task.observation == OBS_TRUTH:
        north, east, heading = v.eta[own, 0], v.eta[own, 1], v.eta[own, 2]
        observe_own(w, o, task, north, east, heading, v.nu[own, 0], v.nu[own, 1], v.nu[own, 2], w.routes.leg[own], obs)
    else:
        age = (w.tick * w.dt_us - nav.gnss_stamp_us[o]) * 1.0e-6
        heading = nav.mru_heading[o]
        cs, cc = sincos(nav.course[o])
        north = nav.position[o, 0] + nav.sog[o] * cc * age
        east = nav.position[o, 1] + nav.sog[o] * cs * age
        observe_own(w, o, task, north, east, heading, nav.water_speed[o, 0], nav.water_speed[o, 1], nav.yaw_rate[o],
                    nav.leg[o], obs)  # fmt: skip
    if task.observation == OBS_SECTORS:
        for i in range(N_OWN, N_OWN + task.sectors):
            obs[i] = 0.0
    if w.land_id >= 0 or w.chart_id >= 0 or task.land > 0:
        _observe_land(w, land, o, task, north, east, heading, obs)
    lag = (w.tick - pic.tick[o]) * w.dt
    if task.observation == OBS_SECTORS:
        _observe_sectors(w, o, task, north, east, heading, lag, obs)
        return
    if task.observation == OBS_TRUTH:
        _ranges_of_truth(w, own, north, east)
    elif task.observation == OBS_AIS:
        _ranges_of_ais(w, o, north, east)
    else:
        _ranges_of_tracks(w, o, north, east, lag)
    found = _nearest(w, task.targets)
    hs, hc = sincos(heading)
    for i in range(N_OWN + found * N_TARGET, N_OWN + task.targets * N_TARGET):
        obs[i] = 0.0
    for i in range(found):
        s = w.order[i]
        at = N_OWN + i * N_TARGET
        if task.observation == OBS_TRACKS:
            vn = ve = 0.0
            if pic.motion_known[o, s]:
                ts, tc = sincos(pic.cog[o, s])
                vn, ve = pic.sog[o, s] * tc, pic.sog[o, s] * ts
            _target(task, obs, at, pic.position[o, s, 0] + vn * lag - north, pic.position[o, s, 1] + ve * lag - east, vn, ve,
                    hs, hc, pic.motion_known[o, s], pic.radius[o, s],
                    math.sqrt(0.5 * (pic.covariance[o, s, 0] + pic.covariance[o, s, 2])) / task.radius_scale,
                    pic.descriptor[o, s] == DESCRIPTOR_VESSEL)  # fmt: skip
        elif task.observation == OBS_AIS:
            box = w.ais.inbox[o, s]
            vn = ve = 0.0
            known = box[4] == box[4]
            if known:
                ts, tc = sincos(box[2])
                vn, ve = box[4] * tc, box[4] * ts
            age = (w.tick * w.dt_us - w.ais.inbox_stamp_us[o, s]) * 1.0e-6
            _target(task, obs, at, box[0] - north, box[1] - east, vn, ve, hs, hc, known, 0.0, age / 60.0,
                    ais_class(w, s) != AIS_ATON)  # fmt: skip
        elif s < V:
            _target(task, obs, at, v.eta[s, 0] - north, v.eta[s, 1] - east, v.velocity[s, 0], v.velocity[s, 1], hs, hc, True,
                    0.5 * max(v.length[s], v.beam[s]), 0.0, True)  # fmt: skip
        else:
            m, k = w.obstacles, s - V
            _target(task, obs, at, m.position[k, 0] - north, m.position[k, 1] - east, m.velocity[k, 0], m.velocity[k, 1],
                    hs, hc, True, m.radius[k], 0.0, False)  # fmt: skip


@inner
def _observe_sectors(w, o, task, north, east, heading, lag, obs):
    """Shade the bearing sectors of the observation with the detected targets."""
    pic = w.picture
    for s in range(w.ranges.shape[0]):
        if pic.id[o, s] == 0:
            continue
        dn, de = pic.position[o, s, 0] - north, pic.position[o, s, 1] - east
        radius = pic.radius[o, s] if pic.radius[o, s] == pic.radius[o, s] else 0.0
        if pic.motion_known[o, s]:
            ts, tc = sincos(pic.cog[o, s])
            dn += pic.sog[o, s] * tc * lag
            de += pic.sog[o, s] * ts * lag
        distance = hypot(dn, de)
        half = PI if distance <= radius else math.asin(radius / distance)
        gap = max(distance - radius, 0.0)
        _shade_sectors(obs, N_OWN, task.sectors, wrap(atan2(de, dn) - heading), half, 1.0 - gap / task.range_scale)


@inner
def _shade_sectors(obs, start, n, bearing, half, closeness):
    """Write closeness 1 - range / scale into those of n sectors, from obs[start] on, that the arc bearing +- half touches.

    Sector 0 starts at the bow.
    """
    closeness = clip(closeness, 0.0, 1.0)
    if closeness == 0.0:
        return
    first = math.floor((bearing - half) * (n / TWO_PI))
    more = math.floor((bearing + half) * (n / TWO_PI)) - first
    i = first
    while i < 0:
        i += n
    for _ in range(min(more, n - 1) + 1):
        if i >= n:
            i -= n
        obs[start + i] = max(obs[start + i], closeness)
        i += 1


@inner
def _observe_land(w, land, o, task, north, east, heading, obs):
    """The part ``land`` at the end of the observation, echoes and then chart; echoes also in ``sectors``.

    Each point that the picture holds fills the width that its sector had.
    """
    pic = w.picture
    if task.observation == OBS_TRUTH:
        # nobody paints a picture then, so there is room for what is true
        for chart in range(2):
            h = coast(land, w.chart_id if chart else w.land_id)
            points = pic.chart[o] if chart else pic.land[o]
            if h != 0:
                nearest_land(land, h, north, east, task.range_scale, points)
                for i in range(L):
                    points[i, 0] += north
                    points[i, 1] += east
    n = task.land
    start = task.size - 2 * n
    for i in range(start, task.size):
        obs[i] = 0.0
    half = PI / L
    for chart in range(2):
        points = pic.chart[o] if chart else pic.land[o]
        for i in range(L):
            dn, de = points[i, 0] - north, points[i, 1] - east
            closeness = 1.0 - hypot(dn, de) / task.range_scale
            if closeness > 0.0:  # False where there is no point (NaN)
                bearing = wrap(atan2(de, dn) - heading)
                if n > 0:
                    _shade_sectors(obs, start + chart * n, n, bearing, half, closeness)
                if chart == 0 and task.observation == OBS_SECTORS:
                    _shade_sectors(obs, N_OWN, task.sectors, bearing, half, closeness)
