"""Ships that sail a recorded track: they come and go with their data, and may be handed over to a behaviour.

Tracks live outside the record, like land: a read-only pool ``tracks`` [n, 7] that all worlds share, and for each vessel where
its knots begin and how many they are (``w.replays``).  Between two knots a ship sails the cubic through their positions with
their velocities as end slopes (cubic Hermite), so that its course and speed are those of the track.

Within a traffic frame ships move straight, from where they are to where the track has them at its end: no error adds up.
"""

from __future__ import annotations

import math

import numpy as np

from ..jit import inner
from ..sensors.ais import NEVER, schedule
from ..trig import atan2, wrap
from ..world.encounter import cpa
from ..world.state import AFTER_CONTINUE, BEHAVIOUR_REPLAY, KNOT_FIELDS, W

#: columns of the pool: time since the start [us], N, E [m], velocity N, E [m/s], heading [rad], 1: seen until the next knot
T_US, NORTH, EAST, V_NORTH, V_EAST, HEADING, SEEN = range(7)
NO_TRACKS = np.zeros((0, KNOT_FIELDS))  #: the pool of worlds without replayed ships

_MAKES_WAY = 0.25  #: [m/s] below which a ship has no course to keep, and no way to give
_REACH = 50.0  #: [m] least distance between the waypoints of a ship that was handed over
_ON = 20_000.0  #: [m] how far ahead lies its last waypoint


@inner
def on_track(tracks, k, t_us):
    """N, E [m] and heading [rad] between the knots k and k + 1 at a time [us]."""
    span = tracks[k + 1, T_US] - tracks[k, T_US]
    s = (t_us - tracks[k, T_US]) / span
    seconds = span * 1.0e-6
    a = (1.0 + 2.0 * s) * (1.0 - s) * (1.0 - s)
    b = s * (1.0 - s) * (1.0 - s) * seconds
    c = s * s * (3.0 - 2.0 * s)
    d = s * s * (s - 1.0) * seconds
    n = a * tracks[k, NORTH] + b * tracks[k, V_NORTH] + c * tracks[k + 1, NORTH] + d * tracks[k + 1, V_NORTH]
    e = a * tracks[k, EAST] + b * tracks[k, V_EAST] + c * tracks[k + 1, EAST] + d * tracks[k + 1, V_EAST]
    return n, e, tracks[k, HEADING] + s * wrap(tracks[k + 1, HEADING] - tracks[k, HEADING])


@inner
def _find(w, tracks, j, t_us):
    """Set the active knot of vessel j for a time [us]; True if the ship is seen then."""
    r = w.replays
    last = r.first[j] + r.count[j] - 1
    k = r.knot[j]
    while k < last and tracks[k + 1, T_US] <= t_us:
        k += 1
    r.knot[j] = k
    return k < last and tracks[k, SEEN] != 0.0 and tracks[k, T_US] <= t_us


@inner
def begin_replay(w, tracks):
    """Put every replayed ship where its track has it at tick 0."""
    v, r = w.vessels, w.replays
    for j in range(v.active.shape[0]):
        if r.count[j] == 0 or v.behaviour[j] != BEHAVIOUR_REPLAY or r.first[j] + r.count[j] > tracks.shape[0]:
            continue
        r.knot[j] = r.first[j]
        v.active[j] = 0
        if _find(w, tracks, j, 0):
            v.active[j] = 1
            v.eta[j, 0], v.eta[j, 1], v.eta[j, 2] = on_track(tracks, r.knot[j], 0)


@inner
def replay(w, tracks, seconds):
    """Steer every replayed ship through the frame of so many seconds that begins; let ships appear, vanish, be handed over."""
    if tracks.shape[0] == 0:
        return
    v, r = w.vessels, w.replays
    end_us = w.tick * w.dt_us + w.frame_ticks * w.dt_us
    for j in range(v.active.shape[0]):
        if r.count[j] == 0 or v.controlled[j] or r.first[j] + r.count[j] > tracks.shape[0]:  # the last: not its pool
            continue
        if v.behaviour[j] != BEHAVIOUR_REPLAY:  # an event has given it something else to do
            _leave_track(w, tracks, j)
            continue
        if not _find(w, tracks, j, end_us):
            if v.active[j]:
                _vanish(w, j)
            continue
        k = r.knot[j]
        n, e, psi = on_track(tracks, k, end_us)
        if v.active[j] == 0:
            _appear(w, tracks, j, k)
        vn, ve = (n - v.eta[j, 0]) / seconds, (e - v.eta[j, 1]) / seconds
        turn = wrap(psi - v.eta[j, 2])
        v.velocity[j, 0] = vn
        v.velocity[j, 1] = ve
        middle = v.eta[j, 2] + 0.5 * turn
        c, s = math.cos(middle), math.sin(middle)
        v.nu[j, 0] = vn * c + ve * s
        v.nu[j, 1] = ve * c - vn * s
        v.nu[j, 2] = turn / seconds
        v.speed[j] = math.hypot(vn, ve)
        if r.hands_over[j] and v.speed[j] > _MAKES_WAY and _own_ship_near(w, j):
            v.behaviour[j] = r.then[j]
            v.heading_set[j] = atan2(ve, vn)
            _leave_track(w, tracks, j)


@inner
def _appear(w, tracks, j, k):
    v, r = w.vessels, w.replays
    v.active[j] = 1
    begin = max(w.tick * w.dt_us, tracks[k, T_US])
    v.eta[j, 0], v.eta[j, 1], v.eta[j, 2] = on_track(tracks, k, begin)
    for i in range(3):
        v.frame_eta[j, i] = v.eta[j, i]
    v.nu[j, 0] = math.hypot(tracks[k, V_NORTH], tracks[k, V_EAST])
    r.changes[j] += 1
    if w.sensors.exteroceptive:
        schedule(w, j, w.tick)
        w.ais_send = min(w.ais_send, w.ais.next_tick[j])
        w.next_sense = min(w.next_sense, w.ais.next_tick[j])


@inner
def _vanish(w, j):
    v = w.vessels
    v.active[j] = 0
    v.velocity[j, 0] = v.velocity[j, 1] = 0.0
    for i in range(3):
        v.nu[j, i] = 0.0
    w.replays.changes[j] += 1
    w.ais.next_tick[j] = NEVER
    for o in range(w.observer.shape[0]):
        w.safety.distance[o, j] = math.inf


@inner
def _own_ship_near(w, j):
    """True if an observer's vessel is within the range of the handover, or will pass too close too soon."""
    v, r = w.vessels, w.replays
    for o in range(w.observer.shape[0]):
        own = w.observer[o]
        if own == j or v.active[own] == 0:
            continue
        dn, de = v.eta[j, 0] - v.eta[own, 0], v.eta[j, 1] - v.eta[own, 1]
        if dn * dn + de * de < r.range[j] * r.range[j]:
            return True
        if r.dcpa[j] > 0.0:
            d, t = cpa(dn, de, v.velocity[j, 0] - v.velocity[own, 0], v.velocity[j, 1] - v.velocity[own, 1])
            if d < r.dcpa[j] and 0.0 < t < r.tcpa[j]:
                return True
    return False


@inner
def _leave_track(w, tracks, j):
    """Let its behaviour have vessel j for good, at its present speed, with what is left of its track as its route."""
    v, r, route = w.vessels, w.replays, w.routes
    k = r.knot[j]
    r.count[j] = 0
    r.changes[j] += 1
    course = atan2(v.velocity[j, 1], v.velocity[j, 0]) if v.speed[j] > _MAKES_WAY else v.eta[j, 2]
    left = 0
    while tracks[k + left, SEEN] != 0.0:  # the last knot of a track is never seen to a next one
        left += 1
    n, e = v.eta[j, 0], v.eta[j, 1]
    route.waypoint[j, 0, 0], route.waypoint[j, 0, 1] = n, e
    count = 1
    for i in range(1, left + 1):
        if (left - i) % (left // (W - 2) + 1):  # evenly, the last one for certain
            continue
        wn, we = tracks[k + i, NORTH], tracks[k + i, EAST]
        if math.hypot(wn - n, we - e) > _REACH:
            course = atan2(we - e, wn - n)
            n, e = wn, we
            route.waypoint[j, count, 0], route.waypoint[j, count, 1] = n, e
            count += 1
    route.waypoint[j, count, 0], route.waypoint[j, count, 1] = n + _ON * math.cos(course), e + _ON * math.sin(course)
    route.count[j] = count + 1
    route.leg[j] = 1
    route.done[j] = 0
    route.radius[j] = _REACH
    route.after_last[j] = AFTER_CONTINUE
