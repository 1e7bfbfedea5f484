"""One tick of a world, and the entry points that advance a batch.

Weather and plants of eight worlds advance together (world/lanes.py), the rest of a world by itself, when it is due.

Order within a tick: weather, actuators, own-ship dynamics; at the end of a traffic frame the traffic, the collision sweep and
the next frame's decisions; then the sensors that are due.  What a sensor sees is therefore the world at its own tick.
"""

from __future__ import annotations

import math

from .events import run_events
from .jit import inner, lean_kernel, spliced
from .sensors.nav import navigate
from .sensors.schedule import first_events, moves_observers, sense
from .traffic.replay import begin_replay, replay
from .traffic.ships import follow_route, steer
from .world.actuators import actuate, prepare_lags
from .world.carry import move_traffic
from .world.disturbance import wave_step, weather_reset, weather_step
from .world.dynamics import sail
from .world.lanes import LANES, clear, gather, scatter, scatter_motion
from .world.safety import begin_frame, sweep
from .world.state import MODEL_3DOF


@spliced
def board(lanes, l, w, n):
    """Copy all plants of world w into lane l of its group; n command rows arrive within a tick for plant 0 (0: none)."""
    for p in range(lanes.shape[0]):
        prepare_lags(w, p, w.dt / n if p == 0 and n > 0 else w.dt)
        gather(lanes[p], l, w, p)
    lanes[0].under_way[l] = 1
    lanes[0].due[l] = _due(w)


@inner
def _due(w):
    """First tick at which anything besides the plants happens in a world."""
    return min(w.frame_tick + w.frame_ticks, w.next_nav, w.next_sense)


@inner
def sails(lanes, p):
    """True if any world of the group has plant p; the first record also carries the weather of worlds without a plant."""
    return p == 0 or lanes[p].any_plant != 0


@spliced
def tick_lanes(lanes, rows, row):
    """Advance weather and plants of a group by one tick.

    ``rows[row]`` [n, A, 3] are commands to plant 0 that arrive within the tick, in order (a thrust log faster than the
    tick); with n = 0 the commands in the lanes hold.
    """
    for p in range(lanes.shape[0]):
        g = lanes[p]
        if not sails(lanes, p):
            continue
        weather_step(g)
        if g.any_plant == 0:
            continue
        if rows.shape[1] > 0 and p == 0:
            for i in range(rows.shape[1]):
                for a in range(rows.shape[2]):
                    for c in range(3):
                        for l in range(LANES):
                            g.command[a, c, l] = rows[row, i, a, c]
                actuate(g)
        else:
            actuate(g)
        wave_step(g)
        sail(g)


@spliced
def attend(lanes, l, w, land, tracks):
    """Do what is due at this tick in world w, whose lane is l: end of the traffic frame, navigation, sensors."""
    eventful = w.events_left > 0  # an event may do anything to a plant
    if eventful:
        disembark(lanes, l, w)
    else:
        for p in range(lanes.shape[0]):
            if sails(lanes, p):
                scatter_motion(lanes[p], l, w, p)
    tick = w.tick
    if tick - w.frame_tick >= w.frame_ticks:
        end_frame(w, land, tracks)
    if tick >= w.next_nav:
        if moves_observers(w):
            move_traffic(w, tick)
        navigate(w, tick)
    if tick >= w.next_sense:
        sense(w, land, tick)
    if eventful:
        for p in range(lanes.shape[0]):
            gather(lanes[p], l, w, p)
    lanes[0].due[l] = _due(w)


@spliced
def disembark(lanes, l, w):
    """Write what has become of lane l into its world."""
    for p in range(lanes.shape[0]):
        if sails(lanes, p):
            scatter(lanes[p], l, w, p)


@spliced
def end_frame(w, land, tracks):
    """Close the traffic frame that ends now and decide the next one."""
    move_traffic(w, w.tick)
    sweep(w, land)
    for o in range(w.observer.shape[0]):
        j = w.observer[o]
        if w.vessels.model[j] == MODEL_3DOF or w.vessels.controlled[j]:
            follow_route(w, j)
    run_events(w)
    begin_frame(w)
    replay(w, tracks, w.frame_ticks * w.dt)
    steer(w, w.frame_ticks * w.dt)


@spliced
def reset_world(w, land, tracks):
    """Bring a freshly written world to tick 0: weather state, first decisions, first navigation, sensor schedule."""
    w.tick = 0
    w.traffic_tick = 0
    weather_reset(w)
    begin_replay(w, tracks)
    run_events(w)
    begin_frame(w)
    replay(w, tracks, w.frame_ticks * w.dt)
    steer(w, w.frame_ticks * w.dt)
    sweep(w, land)
    for o in range(w.observer.shape[0]):
        w.safety.step_closest[o] = math.inf
    navigate(w, w.tick)
    first_events(w)


@lean_kernel
def reset_worlds(worlds, land, tracks, mask):
    """Reset the rows of ``worlds`` [B] where ``mask`` [B] is true; the others are not touched.

    land: the pool that the worlds' ``land_id`` count in (world/land.py; ``NO_LAND`` for the open sea);
    tracks: the pool of recorded tracks (traffic/replay.py; ``NO_TRACKS`` for none).
    """
    for b in range(worlds.shape[0]):
        if mask[b]:
            reset_world(worlds[b], land, tracks)


@lean_kernel
def advance_worlds(worlds, lanes, land, tracks, ticks, rows):
    """Advance every world by ``ticks``; ``land`` and ``tracks`` are the pools of ``reset_worlds``, lanes ``lanes_for(worlds)``.

    rows: float64 [ticks, n, A, 3], commands to plant 0 of every world, n of them within each tick; [0, 0, A, 3] to let the
    commands in the records hold.
    """
    for first in range(0, worlds.shape[0], LANES):
        group = lanes[first // LANES]
        some = min(worlds.shape[0] - first, LANES)
        for p in range(group.shape[0]):
            clear(group[p])
        for l in range(some):
            board(group, l, worlds[first + l], rows.shape[1])
        for k in range(ticks):
            tick_lanes(group, rows, k)
            for l in range(some):
                if group[0].tick[l] >= group[0].due[l]:
                    attend(group, l, worlds[first + l], land, tracks)
        for l in range(some):
            disembark(group, l, worlds[first + l])


@lean_kernel
def settle_traffic(worlds):
    """Bring the traffic of every world to its present tick (between frames it lags behind)."""
    for b in range(worlds.shape[0]):
        move_traffic(worlds[b], worlds[b].tick)
