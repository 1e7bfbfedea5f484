"""One tick of a world, and the entry points that advance a batch.

Order within a tick: weather, actuators, own-ship dynamics; at the end of a traffic frame the traffic, the collision sweep and
the next frame's decisions; then the sensors that are due.  What a sensor sees is therefore the world at its own tick.
"""

from __future__ import annotations

import math

from .events import run_events
from .jit import lean_kernel, spliced
from .sensors.nav import navigate
from .sensors.schedule import first_events, sense
from .traffic.replay import begin_replay, replay
from .traffic.ships import follow_route, move_traffic, steer
from .world.actuators import actuate
from .world.disturbance import wave_step, weather_reset, weather_step
from .world.dynamics import plant_step
from .world.safety import begin_frame, sweep
from .world.state import MODEL_3DOF


@spliced
def tick_world(w, land, tracks, rows, row):
    """Advance one world by one tick; ``land`` and ``tracks`` are the pools of world/land.py and traffic/replay.py.

    ``rows[row]`` [n, A, 3] are commands to plant 0 that arrive within the tick, in order (a thrust log faster than the
    tick); with n = 0 the command in the record holds.
    """
    w.tick += 1
    tick = w.tick
    if w.weather.on:
        weather_step(w, tick)
    v = w.vessels
    for j in range(v.active.shape[0]):
        if v.active[j] and v.model[j] == MODEL_3DOF:
            p = v.plant[j]
            if rows.shape[1] > 0 and p == 0:
                n = rows.shape[1]
                for i in range(n):
                    for a in range(rows.shape[2]):
                        for c in range(3):
                            w.plants.command[0, a, c] = rows[row, i, a, c]
                    actuate(w, p, w.dt / n)
            else:
                actuate(w, p, w.dt)
            if w.weather.on:
                wave_step(w, p, j, tick)
            plant_step(w, j, p, w.dt)
    if tick - w.frame_tick >= w.frame_ticks:
        end_frame(w, land, tracks)
    if tick >= w.next_nav:
        for o in range(w.observer.shape[0]):
            if w.vessels.model[w.observer[o]] != MODEL_3DOF:
                move_traffic(w, tick)  # a kinematic observer is where the traffic is
        navigate(w, tick)
    if tick >= w.next_sense:
        move_traffic(w, tick)
        sense(w, land, tick)


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
def advance_worlds(worlds, land, tracks, ticks, rows):
    """Advance every world by ``ticks``; ``land`` and ``tracks`` are the pools of ``reset_worlds``.

    rows: float64 [ticks, n, A, 3], commands to plant 0 of every world, n of them within each tick; [0, 0, A, 3] to let the
    commands in the records hold.
    """
    for b in range(worlds.shape[0]):
        for k in range(ticks):
            tick_world(worlds[b], land, tracks, rows, k)


@lean_kernel
def settle_traffic(worlds):
    """Bring the traffic of every world to its present tick (between frames it lags behind)."""
    for b in range(worlds.shape[0]):
        move_traffic(worlds[b], worlds[b].tick)
