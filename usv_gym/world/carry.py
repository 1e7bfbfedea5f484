"""Within a frame traffic goes straight on: where it is at any tick.

Always from where it was as the frame began, so that nobody who looks on the way leaves a trace in the last digit.
"""

from __future__ import annotations

from ..jit import inner
from ..trig import TWO_PI, wrap
from .state import MODEL_KINEMATIC

MANY_TURNS = 1.0e4 * TWO_PI  #: [rad] a heading is wrapped beyond


@inner
def place(w, s, tick):
    """Carry source s alone to ``tick``, as ``move_traffic`` would."""
    whole = (tick - w.frame_tick) * w.dt
    v, m, i = w.vessels, w.obstacles, s - w.vessels.active.shape[0]
    if i < 0:
        if v.model[s] == MODEL_KINEMATIC:
            v.eta[s, 0] = v.frame_eta[s, 0] + v.velocity[s, 0] * whole
            v.eta[s, 1] = v.frame_eta[s, 1] + v.velocity[s, 1] * whole
            psi = v.frame_eta[s, 2] + v.nu[s, 2] * whole
            v.eta[s, 2] = wrap(psi) if abs(psi) > MANY_TURNS else psi
        return
    current = w.weather.current
    m.position[i, 0] = m.frame_position[i, 0] + (m.velocity[i, 0] + m.drifts[i] * current[0]) * whole
    m.position[i, 1] = m.frame_position[i, 1] + (m.velocity[i, 1] + m.drifts[i] * current[1]) * whole


@inner
def move_traffic(w, tick):
    """Carry all traffic to ``tick``."""
    if tick == w.traffic_tick:
        return
    whole, part = (tick - w.frame_tick) * w.dt, (tick - w.traffic_tick) * w.dt
    w.traffic_tick = tick
    v, m = w.vessels, w.obstacles
    for j in range(v.active.shape[0]):
        moves = (v.active[j] != 0) & (v.model[j] == MODEL_KINEMATIC)
        north, east = v.frame_eta[j, 0] + v.velocity[j, 0] * whole, v.frame_eta[j, 1] + v.velocity[j, 1] * whole
        psi = v.frame_eta[j, 2] + v.nu[j, 2] * whole
        v.eta[j, 0] = north if moves else v.eta[j, 0]
        v.eta[j, 1] = east if moves else v.eta[j, 1]
        psi = wrap(psi) if abs(psi) > MANY_TURNS else psi  # a ship on a loop for weeks
        v.eta[j, 2] = psi if moves else v.eta[j, 2]
        v.distance[j] += abs(v.nu[j, 0]) * (part if moves else 0.0)
    cn, ce = w.weather.current[0], w.weather.current[1]
    for i in range(m.active.shape[0]):
        moves = m.active[i] != 0
        north = m.frame_position[i, 0] + (m.velocity[i, 0] + m.drifts[i] * cn) * whole
        east = m.frame_position[i, 1] + (m.velocity[i, 1] + m.drifts[i] * ce) * whole
        m.position[i, 0] = north if moves else m.position[i, 0]
        m.position[i, 1] = east if moves else m.position[i, 1]
