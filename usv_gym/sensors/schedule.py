"""Which exteroceptive sensor fires when: one look at the clock per tick, O(S) work only when something is due."""

from __future__ import annotations

from ..jit import inner, spliced
from ..world.carry import move_traffic, place
from ..world.state import MODEL_3DOF
from .ais import NEVER, next_fire, schedule, transmit, transmits
from .intake import take_ais
from .scan import deliver, lidars_know, scan_lidar, scan_radar
from .tdm import publish


@spliced
def first_events(w):
    """Schedule the first transmissions and set ``w.next_sense``."""
    S = w.ais.next_tick.shape[0]
    for s in range(S):
        w.ais.last_tick[s] = -1
        w.ais.next_tick[s] = NEVER
        if w.sensors.exteroceptive:
            schedule(w, s, w.tick)
    for o in range(w.observer.shape[0]):
        for s in range(S):
            w.tracks.nearest[o, s] = s
    w.ais_send = w.ais_due = 0
    w.radar_next = next_fire(w.tick, w.dt_us, w.sensors.radar.period_us)
    w.lidar_next = next_fire(w.tick, w.dt_us, w.sensors.lidar.period_us)
    w.report_next = next_fire(w.tick, w.dt_us, w.sensors.tdm_period_us)
    _set_next(w, w.tick)


@inner
def _schedule_messages(w, tick):
    """Set the first ticks after ``tick`` at which an AIS message is sent, ``ais_send``, and arrives, ``ais_due``."""
    soonest = NEVER
    for s in range(w.ais.next_tick.shape[0]):
        soonest = min(soonest, w.ais.next_tick[s])
    w.ais_send = soonest
    soonest = NEVER
    for o in range(w.observer.shape[0]):
        for s in range(w.ais.next_tick.shape[0]):
            due = w.ais.due_tick[o, s]
            soonest = min(soonest, due if due > tick else NEVER)
    w.ais_due = soonest


@inner
def _set_next(w, tick):
    """Set ``w.next_sense`` after what was due at ``tick`` is done."""
    p = w.sensors
    soonest = NEVER
    if p.exteroceptive:
        if tick >= min(w.ais_send, w.ais_due):
            _schedule_messages(w, tick)
        soonest = min(w.ais_send, w.ais_due)
        for o in range(w.observer.shape[0]):
            for k in range(2):
                if w.tracks.scan_due[o, k] > tick:
                    soonest = min(soonest, w.tracks.scan_due[o, k])
        if p.radar.on:
            soonest = min(soonest, w.radar_next)
        if p.lidar.on:
            soonest = min(soonest, w.lidar_next)
        soonest = min(soonest, w.report_next)
    w.next_sense = soonest


@inner
def moves_observers(w):
    """True if an observer's vessel moves with the traffic."""
    for o in range(w.observer.shape[0]):  # noqa: SIM110 (numba knows no any())
        if w.vessels.model[w.observer[o]] != MODEL_3DOF:
            return True
    return False


@spliced
def sense(w, land, tick):
    """Fire everything that is due at ``tick``: transmissions, receptions, scans, then the TDM's report.

    The traffic is carried to this tick if somebody looks at it.
    There is room for one message of each source and for one scan under way: what is later than that arrives just before
    the next one is made.
    """
    p = w.sensors
    S = w.ais.next_tick.shape[0]
    radar, lidar, report = p.radar.on and tick >= w.radar_next, p.lidar.on and tick >= w.lidar_next, tick >= w.report_next
    if radar:
        w.radar_next = next_fire(tick, w.dt_us, p.radar.period_us)
    if lidar:
        w.lidar_next = next_fire(tick, w.dt_us, p.lidar.period_us)
    if report:
        w.report_next = next_fire(tick, w.dt_us, p.tdm_period_us)
    sends, receives = tick >= w.ais_send, w.ais_due != NEVER
    if radar or moves_observers(w) or (lidar and not lidars_know(w, tick)):
        move_traffic(w, tick)
    for make_room in (True, False):
        if sends and not make_room:
            for s in range(S):
                if tick >= w.ais.next_tick[s]:
                    if transmits(w, s):
                        if w.traffic_tick != tick:
                            place(w, s, tick)
                        transmit(w, s, tick)
                        for o in range(w.observer.shape[0]):
                            if w.ais.due_tick[o, s] == tick:  # without latency
                                w.ais.due_tick[o, s] = -1
                                take_ais(w, o, s)
                    else:  # it has left the sea, or its station is off
                        w.ais.next_tick[s] = NEVER
        for o in range(w.observer.shape[0]):
            if w.vessels.active[w.observer[o]] == 0:
                continue
            if make_room and receives and (sends or tick >= w.ais_due):
                for s in range(S):
                    due = w.ais.due_tick[o, s]
                    if due >= 0 and (due <= tick or tick >= w.ais.next_tick[s]):
                        w.ais.due_tick[o, s] = -1
                        take_ais(w, o, s)
            if not make_room:
                if radar:
                    scan_radar(w, land, o, tick)
                if lidar:
                    scan_lidar(w, land, o, tick)
            for k in range(2):
                fires = radar if k == 0 else lidar
                deliver(w, o, k, NEVER if make_room and fires else tick)
            if report and not make_room:
                publish(w, land, o, tick)
    _set_next(w, tick)
