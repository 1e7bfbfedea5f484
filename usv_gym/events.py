"""What happens in a scenario, and when: the table of events, looked at once per traffic frame.

An event waits for its trigger (a time, a source that comes near, a TCPA), acts, and ends after its duration.  Failures write
the fault fields of the record and nothing else; sensors, AIS stations and actuators act on those fields.  While several
events hold the same field they act on top of each other in the order of the table, on what the field was before the first
of them; when the last has ended it is that again.  The schema is ``scenarios/events.py``.
"""

from __future__ import annotations

import math

from .jit import inner
from .sensors.ais import NEVER, transmits
from .world.encounter import cpa
from .world.state import (
    AIS,
    BEHAVIOUR_HOLD,
    EVENT_AIS_JAMMED,
    EVENT_AIS_SILENT,
    EVENT_AIS_SPOOFED,
    EVENT_CHANGE_BEHAVIOUR,
    EVENT_CHANGE_COURSE,
    EVENT_CHANGE_SPEED,
    EVENT_DELETE,
    EVENT_GNSS_DRIFTING,
    EVENT_GNSS_FROZEN,
    EVENT_JET_STUCK,
    EVENT_LIDAR_OUTAGE,
    EVENT_NOZZLE_STUCK,
    EVENT_RADAR_OUTAGE,
    EVENT_RAIN,
    EVENT_REDUCED_THRUST,
    EVENT_SNOW,
    EVENT_SPAWN,
    PHASE_NONE,
    TRIGGER_DISTANCE,
    TRIGGER_NONE,
    TRIGGER_TCPA,
    TRIGGER_TIME,
)

_SLACK = 1.0e-9  # [s]


@inner
def run_events(w):
    """End and begin the events that are due at ``w.tick``."""
    if w.events_left > 0:
        e = w.events
        for i in range(e.state.shape[0]):
            if e.state[i] == 1 and (w.tick - e.began[i]) * w.dt >= e.duration[i] - _SLACK:
                _end(w, i)
        for i in range(e.state.shape[0]):
            if e.trigger[i] != TRIGGER_NONE and e.state[i] == 0 and _due(w, i):
                _begin(w, i)


# --- triggers --------------------------------------------------------------------------------------------------------
@inner
def _motion(w, s):
    """(there, N, E, vN, vE) of source s."""
    V = w.vessels.active.shape[0]
    if s < V:
        v = w.vessels
        return v.active[s] != 0, v.eta[s, 0], v.eta[s, 1], v.velocity[s, 0], v.velocity[s, 1]
    m, i = w.obstacles, s - V
    return m.active[i] != 0, m.position[i, 0], m.position[i, 1], m.velocity[i, 0], m.velocity[i, 1]


@inner
def _due(w, i):
    e = w.events
    if e.trigger[i] == TRIGGER_TIME:
        return w.tick * w.dt >= e.threshold[i] - _SLACK
    there, n, east, vn, ve = _motion(w, e.subject[i])
    if not there:
        return False
    if e.trigger[i] == TRIGGER_DISTANCE and e.point[i, 0] == e.point[i, 0]:
        return math.hypot(n - e.point[i, 0], east - e.point[i, 1]) < e.threshold[i]
    _, n0, e0, vn0, ve0 = _motion(w, w.observer[0])
    if e.trigger[i] == TRIGGER_TCPA:
        _, t = cpa(n - n0, east - e0, vn - vn0, ve - ve0)
        return 0.0 < t < e.threshold[i]
    return math.hypot(n - n0, east - e0) < e.threshold[i]


# --- beginning and end -----------------------------------------------------------------------------------------------
@inner
def _same(w, i, k):
    """True if events i and k are under way and write the same fields."""
    e = w.events
    if i == k or e.state[k] != 1:
        return False
    if EVENT_RAIN <= e.action[i] <= EVENT_SNOW:
        return EVENT_RAIN <= e.action[k] <= EVENT_SNOW
    if EVENT_CHANGE_COURSE <= e.action[i] <= EVENT_CHANGE_BEHAVIOUR:
        return EVENT_CHANGE_COURSE <= e.action[k] <= EVENT_CHANGE_BEHAVIOUR and e.target[k] == e.target[i]
    if EVENT_JET_STUCK <= e.action[i] <= EVENT_REDUCED_THRUST:
        return e.action[k] == e.action[i]  # one thruster or all: they overlap
    return e.action[k] == e.action[i] and e.target[k] == e.target[i]


@inner
def _begin(w, i):
    e = w.events
    e.state[i] = 1
    e.began[i] = w.tick
    if e.duration[i] == math.inf:
        w.events_left -= 1
    first = True
    for k in range(e.state.shape[0]):
        if first and _same(w, i, k):
            first = False
            for c in range(e.saved.shape[1]):
                e.saved[i, c] = e.saved[k, c]
    if first:
        _save(w, i)
    _act(w, i)


@inner
def _end(w, i):
    e = w.events
    e.state[i] = 2
    e.ended[i] = w.tick
    w.events_left -= 1
    _restore(w, i)
    for k in range(e.state.shape[0]):
        if _same(w, i, k):
            _act(w, k)


@inner
def listen(w, s):
    """Let the next tick look at the transmitter of source s, which then sends and goes on by its schedule."""
    w.ais.next_tick[s] = NEVER
    if w.sensors.exteroceptive and w.sensors.ais_on and transmits(w, s):
        w.ais.next_tick[s] = w.tick + 1
        w.ais_send = min(w.ais_send, w.tick + 1)
        w.next_sense = min(w.next_sense, w.tick + 1)


@inner
def _set_active(w, s, active):
    V = w.vessels.active.shape[0]
    if s < V:
        w.vessels.active[s] = active
    else:
        w.obstacles.active[s - V] = active
    listen(w, s)


@inner
def _set_ais(w, s, on):
    V = w.vessels.active.shape[0]
    if s < V:
        w.vessels.ais_on[s] = on
    else:
        w.obstacles.ais_on[s - V] = on
    listen(w, s)


# --- what was before, what an event does, and back -------------------------------------------------------------------
@inner
def _save(w, i):
    saved, action, s = w.events.saved[i], w.events.action[i], w.events.target[i]
    p, v = w.sensors, w.vessels
    V = v.active.shape[0]
    if action == EVENT_AIS_SILENT:
        saved[0] = v.ais_on[s] if s < V else w.obstacles.ais_on[s - V]
    elif action == EVENT_AIS_JAMMED:
        saved[0] = p.ais_jammed
    elif action == EVENT_GNSS_FROZEN:
        saved[0] = p.gnss_frozen
    elif action == EVENT_GNSS_DRIFTING:
        for c in range(2):
            saved[c] = p.gnss_drift[c]
            saved[2 + c] = p.gnss_drift_rate[c]
        saved[4] = p.gnss_drift_tick
    elif action == EVENT_RADAR_OUTAGE:
        saved[0] = p.radar.outage
    elif action == EVENT_LIDAR_OUTAGE:
        saved[0] = p.lidar.outage
    elif EVENT_RAIN <= action <= EVENT_SNOW:
        x = w.weather
        saved[0], saved[1], saved[2] = x.radar_range_factor, x.lidar_range_factor, x.detection_factor
        saved[3], saved[4] = x.radar_clutter, x.lidar_clutter
    elif EVENT_JET_STUCK <= action <= EVENT_REDUCED_THRUST:
        q, j = w.plants, v.plant[w.observer[0]]
        for a in range(q.n.shape[1]):
            if action == EVENT_JET_STUCK:
                saved[a] = q.jet_stuck[j, a]
            elif action == EVENT_NOZZLE_STUCK:
                saved[a] = q.nozzle_stuck[j, a]
            else:
                saved[a] = q.thrust_left[j, a]
    elif EVENT_CHANGE_COURSE <= action <= EVENT_CHANGE_BEHAVIOUR:
        b = w.pilots
        saved[0], saved[1], saved[2], saved[3] = v.behaviour[s], b.range[s], b.period_us[s], b.act_time[s]
        saved[4], saved[5], saved[6], saved[7] = b.extremis_time[s], b.clearance[s], b.alteration[s], b.acceleration[s]
        saved[8], saved[9], saved[10] = b.ahead[s], b.target[s], b.wander[s]
        saved[11], saved[12] = v.speed[s], v.heading_set[s]


@inner
def _act(w, i):
    e = w.events
    value, action, s = e.value[i], e.action[i], e.target[i]
    p, v = w.sensors, w.vessels
    V = v.active.shape[0]
    if action == EVENT_AIS_SILENT:
        _set_ais(w, s, 0)
    elif action == EVENT_AIS_SPOOFED:
        a, source = w.ais, int(value[5])
        for c in range(2):
            a.spoof_offset[s, c] = value[c]
            a.spoof_rate[s, c] = value[2 + c]
        a.spoof_tick[s] = e.began[i]
        a.spoof_mmsi[s] = int(value[4])
        a.spoof_source[s] = source
        w.obstacles.ais_class[source - V] = v.ais_class[s] if s < V else w.obstacles.ais_class[s - V]
        w.obstacles.mmsi[source - V] = int(value[4])
    elif action == EVENT_AIS_JAMMED:
        p.ais_jammed = 1
    elif action == EVENT_GNSS_FROZEN:
        p.gnss_frozen = 1
    elif action == EVENT_GNSS_DRIFTING:
        for c in range(2):
            p.gnss_drift[c] += value[c]
            p.gnss_drift_rate[c] = value[2 + c]
        p.gnss_drift_tick = e.began[i]
    elif action == EVENT_RADAR_OUTAGE:
        p.radar.outage = 1
    elif action == EVENT_LIDAR_OUTAGE:
        p.lidar.outage = 1
    elif EVENT_RAIN <= action <= EVENT_SNOW:
        x = w.weather
        x.radar_range_factor *= value[0]
        x.lidar_range_factor *= value[1]
        x.detection_factor *= value[2]
        x.radar_clutter += value[3]
        x.lidar_clutter += value[4]
    elif EVENT_JET_STUCK <= action <= EVENT_REDUCED_THRUST:
        q, j = w.plants, v.plant[w.observer[0]]
        for a in range(q.n.shape[1]):
            if s < 0 or s == a:
                if action == EVENT_JET_STUCK:
                    q.jet_stuck[j, a] = 1
                elif action == EVENT_NOZZLE_STUCK:
                    q.nozzle_stuck[j, a] = 1
                else:
                    q.thrust_left[j, a] *= value[0]
    elif action == EVENT_CHANGE_COURSE:
        v.behaviour[s] = BEHAVIOUR_HOLD
        v.heading_set[s] = value[0] + (v.eta[s, 2] if value[1] else 0.0)
    elif action == EVENT_CHANGE_SPEED:
        v.speed[s] = value[0]
    elif action == EVENT_CHANGE_BEHAVIOUR:
        _set_behaviour(w, s, value)
    elif action == EVENT_SPAWN:
        _set_active(w, s, 1)
    elif action == EVENT_DELETE:
        _set_active(w, s, 0)
        if s < V:
            w.replays.count[s] = 0  # its track does not bring it back


@inner
def _set_behaviour(w, s, value):
    v, b = w.vessels, w.pilots
    v.behaviour[s] = int(value[0])
    b.range[s], b.period_us[s], b.act_time[s] = value[1], int(value[2]), value[3]
    b.extremis_time[s], b.clearance[s], b.alteration[s], b.acceleration[s] = value[4], value[5], value[6], value[7]
    b.ahead[s], b.target[s], b.wander[s] = value[8], int(value[9]), value[10]
    b.next_tick[s] = w.tick
    b.phase[s] = 0
    b.factor[s] = 1.0
    for c in range(b.role.shape[1]):
        b.role[s, c] = 0
    if v.behaviour[s] == BEHAVIOUR_HOLD:
        v.heading_set[s] = v.eta[s, 2]


@inner
def _restore(w, i):
    e = w.events
    saved, action, s = e.saved[i], e.action[i], e.target[i]
    p, v = w.sensors, w.vessels
    if action == EVENT_AIS_SILENT:
        _set_ais(w, s, int(saved[0]))
    elif action == EVENT_AIS_SPOOFED:
        _end_spoof(w, s, int(e.value[i, 5]))
    elif action == EVENT_AIS_JAMMED:
        p.ais_jammed = int(saved[0])
    elif action == EVENT_GNSS_FROZEN:
        p.gnss_frozen = int(saved[0])
    elif action == EVENT_GNSS_DRIFTING:
        for c in range(2):
            p.gnss_drift[c] = saved[c]
            p.gnss_drift_rate[c] = saved[2 + c]
        p.gnss_drift_tick = int(saved[4])
    elif action == EVENT_RADAR_OUTAGE:
        p.radar.outage = int(saved[0])
    elif action == EVENT_LIDAR_OUTAGE:
        p.lidar.outage = int(saved[0])
    elif EVENT_RAIN <= action <= EVENT_SNOW:
        x = w.weather
        x.radar_range_factor, x.lidar_range_factor, x.detection_factor = saved[0], saved[1], saved[2]
        x.radar_clutter, x.lidar_clutter = saved[3], saved[4]
    elif EVENT_JET_STUCK <= action <= EVENT_REDUCED_THRUST:
        q, j = w.plants, v.plant[w.observer[0]]
        for a in range(q.n.shape[1]):
            if action == EVENT_JET_STUCK:
                q.jet_stuck[j, a] = int(saved[a])
            elif action == EVENT_NOZZLE_STUCK:
                q.nozzle_stuck[j, a] = int(saved[a])
            else:
                q.thrust_left[j, a] = saved[a]
    elif EVENT_CHANGE_COURSE <= action <= EVENT_CHANGE_BEHAVIOUR:
        _set_behaviour(w, s, saved)
        v.speed[s] = saved[11]
        v.heading_set[s] = saved[12]
    elif action == EVENT_SPAWN:
        _set_active(w, s, 0)


@inner
def _end_spoof(w, s, source):
    """The station of source s tells the truth again, and what it made of itself is gone from the receivers at once."""
    a = w.ais
    a.spoof_source[s] = 0
    a.spoof_mmsi[s] = 0
    for o in range(w.observer.shape[0]):
        a.inbox_stamp_us[o, source] = -1
        w.tracks.phase[o, AIS, source] = PHASE_NONE
