"""Vessels of several worlds side by side, so that their physics become vector code.

One record of ``lanes_dtype`` holds plant p of up to LANES worlds, each number a row [LANES], with the weather of those worlds.
``gather`` copies one lane from its world's record, ``actuators``, ``disturbance`` and ``dynamics`` advance all lanes at once,
and ``scatter`` writes a lane back; a lane's numbers never depend on its neighbours, and a world alone takes one lane of eight,
so that it sails as it does in any batch.

All loops run over all LANES, idle ones included, and have no branch: numbers are chosen, not jumped to.  Rows are 64 bytes,
eight times eight, which is what lets LLVM prove that no lane reads what another writes.
"""

from __future__ import annotations

import functools
from typing import Any

import numpy as np

from ..jit import inner, line_by_line
from ..trig import sincos
from .state import MODEL_3DOF, A, Dtype, f8, i8, u8

LANES = 8

#: rows [LANES] of numbers that ``gather`` copies under the name they have in the group ``plants`` of a world (state.py)
_PLANT = (
    "i11", "i22", "i23", "i32", "i33", "coriolis_linearised", "Xu", "Xuu", "Xuuu", "Xuu_ittc", "Yv", "Yr", "Yvv", "Yrv", "Yvr",
    "Yrr", "Yvvv", "Nv", "Nr", "Nvv", "Nrv", "Nvr", "Nrr", "Nrrr", "cd2d", "draught", "strip_x0", "strip_x1", "crossflow_sway",
    "crossflow_yaw", "crossflow_dead_zone", "length_pp", "area_side", "wind_arm", "cd_t", "cd_l_bow", "cd_l_stern",
    "wind_delta", "wind_surge_factor", "current_turns", "yaw_gain", "bucket_in_yaw", "memory",
)  # fmt: skip
#: the same per thruster, [A, LANES]
_THRUSTER = (
    "x", "y", "direction", "gain_ahead", "gain_astern", "n_idle", "n_max", "n_min", "nozzle_max", "thrust_left",
    "n", "alpha", "beta",
)  # fmt: skip
#: of the group ``weather``
_WEATHER = (
    "original", "wind_speed", "wind_to", "wind_height_factor", "wind_u10", "wind_direction", "current_speed", "current_to",
    "wave_height", "wave_to", "wave_omega0", "wave_damping", "wave_scale",
)  # fmt: skip
_PROCESSES = ("wind_slow", "wind_gust", "wind_turn", "current_slow", "current_turn")


@functools.cache
def lanes_dtype() -> Dtype:
    """dtype of one plant of LANES worlds (see the module's docstring)."""
    row = (LANES,)
    process = np.dtype([(name, f8, row) for name in ("limit", "decay", "kick", "x")])
    return np.dtype([
        # of the group: most thrusters of any lane; whether any has weather, waves, the preset `original`, fluid memory, a plant
        ("thrusters", i8), ("any_weather", i8), ("any_waves", i8), ("any_original", i8), ("any_memory", i8), ("any_plant", i8),
        ("_", i8, (2,)),
        # of the engine: whether the world of the lane is under way, and tick at which something besides its plants is due
        ("under_way", i8, row), ("due", i8, row),
        ("slot", i8, row),  # vessel slot that has the plant; -1: none, so only the weather of the lane is of account
        ("tick", i8, row), ("seed", u8, row), ("h", f8, row),  # last tick; [s] of a tick
        ("on", f8, row),  # 1: there is weather
        *((name, f8, row) for name in _WEATHER), *((name, process) for name in _PROCESSES),
        ("current", f8, (2, LANES)),
        *((name, f8, row) for name in _PLANT), *((name, f8, (A, LANES)) for name in _THRUSTER),
        ("coriolis", f8, (3, LANES)), ("wave_gain", f8, (3, LANES)),
        ("lag", f8, (A, 3, LANES)), ("command", f8, (A, 3, LANES)),  # lag 0: not fitted or stuck
        ("memory_scale", f8, (2, LANES)), ("memory_den", f8, (3, 4, LANES)), ("memory_num", f8, (3, 4, LANES)),
        # state
        ("memory_x", f8, (4, 4, LANES)), ("wave_x", f8, (3, 2, LANES)),
        ("tau", f8, (3, LANES)), ("tau_wind", f8, (3, LANES)), ("tau_wave", f8, (3, LANES)),
        ("memory_force", f8, (2, LANES)),  # work space: sway [N], yaw [N m]
        ("eta", f8, (3, LANES)), ("nu", f8, (3, LANES)), ("velocity", f8, (2, LANES)),
        ("sine", f8, row), ("cosine", f8, row),  # of the heading
    ])  # fmt: skip


def lanes_for(worlds: np.ndarray[Any, Any]) -> np.ndarray[Any, Any]:
    """Room for the lanes of worlds [B]: [ceil(B / LANES), P]."""
    plants = worlds.dtype["plants"]["thrusters"].shape[0]
    return np.zeros((-(-len(worlds) // LANES), plants), lanes_dtype())


_copy_weather = line_by_line("g, l, weather", "g.{0}[l] = weather.{0}", _WEATHER)
_copy_processes = line_by_line("g, l, weather", "; ".join(
    f"g.{{0}}.{field}[l] = weather.{{0}}.{field}" for field in ("limit", "decay", "kick", "x")), _PROCESSES)  # fmt: skip
_write_processes = line_by_line("g, l, weather", "weather.{0}.x = g.{0}.x[l]", _PROCESSES)
_copy_plant = line_by_line("g, l, q, p", "g.{0}[l] = q.{0}[p]", _PLANT)
_copy_thruster = line_by_line("g, l, q, p, i", "g.{0}[i, l] = q.{0}[p, i]", _THRUSTER)


@inner
def clear(g):
    """Empty a group: no lane has a plant or weather."""
    g.thrusters = g.any_plant = 0
    g.any_weather = g.any_waves = g.any_original = g.any_memory = 0
    for l in range(LANES):
        g.under_way[l] = 0
        g.slot[l] = -1
        g.on[l] = 0.0


@inner
def find_vessel(w, p):
    """Slot of the active vessel that has plant p; -1 if none has."""
    v = w.vessels
    for j in range(v.active.shape[0]):
        if v.plant[j] == p and v.active[j] != 0 and v.model[j] == MODEL_3DOF:
            return j
    return -1


@inner
def gather(g, l, w, p):
    """Copy plant p of world w and the weather into lane l."""
    weather, q, v = w.weather, w.plants, w.vessels
    g.tick[l] = w.tick
    g.h[l] = w.dt
    g.seed[l] = w.seed
    g.on[l] = 1.0 if weather.on else 0.0
    _copy_weather(g, l, weather)
    _copy_processes(g, l, weather)
    g.current[0, l] = weather.current[0]
    g.current[1, l] = weather.current[1]
    if weather.on:
        g.any_weather = 1
        if weather.original:
            g.any_original = 1
    g.slot[l] = j = find_vessel(w, p)
    if j < 0:
        return
    g.any_plant = 1
    if weather.on and weather.wave_height > 0.0:
        g.any_waves = 1
    g.thrusters = max(g.thrusters, np.int64(q.thrusters[p]))
    _copy_plant(g, l, q, p)
    for k in range(3):
        g.coriolis[k, l] = q.coriolis[p, k]
        g.wave_gain[k, l] = q.wave_gain[p, k]
        g.wave_x[k, 0, l] = q.wave_x[p, k, 0]
        g.wave_x[k, 1, l] = q.wave_x[p, k, 1]
        g.tau_wave[k, l] = q.tau_wave[p, k]
        g.eta[k, l] = v.eta[j, k]
        g.nu[k, l] = v.nu[j, k]
    for i in range(A):
        _copy_thruster(g, l, q, p, i)
        g.lag[i, 0, l] = 0.0 if q.jet_stuck[p, i] else q.lag[p, i, 0]
        g.lag[i, 1, l] = 0.0 if q.nozzle_stuck[p, i] else q.lag[p, i, 1]
        g.lag[i, 2, l] = 0.0 if q.jet_stuck[p, i] else q.lag[p, i, 2]
        if q.bucket[p, i] == 0:
            g.lag[i, 2, l] = 0.0
            g.beta[i, l] = 1.0
    gather_command(g, l, w, p)
    if q.memory[p]:
        g.any_memory = 1
        for k in range(2):
            g.memory_scale[k, l] = q.memory_scale[p, k]
        for i in range(4):
            for k in range(3):
                g.memory_den[k, i, l] = q.memory_den[p, k, i]
                g.memory_num[k, i, l] = q.memory_num[p, k, i]
            for k in range(4):
                g.memory_x[k, i, l] = q.memory_x[p, k, i]
    psi = v.eta[j, 2]
    if psi != q.turned[p, 0]:  # somebody has put it there
        q.turned[p, 0] = psi
        q.turned[p, 1], q.turned[p, 2] = sincos(psi)
    g.sine[l] = q.turned[p, 1]
    g.cosine[l] = q.turned[p, 2]


@inner
def gather_command(g, l, w, p):
    """Copy what plant p of world w was told to do into lane l."""
    for i in range(A):
        for c in range(3):
            g.command[i, c, l] = w.plants.command[p, i, c]


@inner
def scatter_motion(g, l, w, p):
    """Write position and motion from lane l into its world, whose plant p it is; with plant 0 also the tick and the weather."""
    weather, v, j = w.weather, w.vessels, g.slot[l]
    if p == 0:
        w.tick = g.tick[l]
        weather.wind_u10 = g.wind_u10[l]
        weather.wind_direction = g.wind_direction[l]
        weather.current[0] = g.current[0, l]
        weather.current[1] = g.current[1, l]
    if j >= 0:
        for k in range(3):
            v.eta[j, k] = g.eta[k, l]
            v.nu[j, k] = g.nu[k, l]
        v.velocity[j, 0] = g.velocity[0, l]
        v.velocity[j, 1] = g.velocity[1, l]


@inner
def scatter(g, l, w, p):
    """Write all that has changed in lane l into its world, whose plant p it is."""
    weather, q = w.weather, w.plants
    scatter_motion(g, l, w, p)
    if p == 0:
        _write_processes(g, l, weather)
    j = g.slot[l]
    if j < 0:
        return
    q.turned[p, 0], q.turned[p, 1], q.turned[p, 2] = g.eta[2, l], g.sine[l], g.cosine[l]
    for k in range(3):
        q.tau[p, k] = g.tau[k, l]
        q.tau_wind[p, k] = g.tau_wind[k, l]
        q.tau_wave[p, k] = g.tau_wave[k, l]
        q.wave_x[p, k, 0] = g.wave_x[k, 0, l]
        q.wave_x[p, k, 1] = g.wave_x[k, 1, l]
    for i in range(A):
        for c in range(3):
            q.command[p, i, c] = g.command[i, c, l]
    for i in range(q.thrusters[p]):
        q.n[p, i] = g.n[i, l]
        q.alpha[p, i] = g.alpha[i, l]
        if q.bucket[p, i]:
            q.beta[p, i] = g.beta[i, l]
    if q.memory[p]:
        for k in range(4):
            for i in range(4):
                q.memory_x[p, k, i] = g.memory_x[k, i, l]
