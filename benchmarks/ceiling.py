"""The own-ship kernel against the same physics in C (own_ship.c), compiled where a compiler is found."""

from __future__ import annotations

import ctypes
import shutil
import subprocess
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np
from numba import njit

from usv_gym.scenarios.build import build_worlds
from usv_gym.scenarios.loader import load_scenario
from usv_gym.world.actuators import actuate, prepare_lags
from usv_gym.world.dynamics import sail
from usv_gym.world.lanes import LANES, clear, gather, lanes_for, scatter

STEP = 0.1  # [s]
FLAGS = ["-O3", "-march=native", "-ffp-contract=fast", "-fno-math-errno", "-shared", "-fPIC"]
#: (member of the struct, field of the plant), in the order of own_ship.c
FIELDS = """
i11 i22 i23 i32 i33 coriolis coriolis_linearised Xu Xuu Xuuu Xuu_ittc Yv Yr Yvv Yrv Yvr Yrr Yvvv Nv Nr Nvv Nrv Nvr Nrr Nrrr
cd2d draught strip_x0 strip_x1 crossflow_sway crossflow_yaw crossflow_dead_zone length_pp area_side wind_arm cd_t cd_l_bow
cd_l_stern wind_delta wind_surge_factor thrusters bucket_in_yaw x y direction gain_ahead gain_astern n_idle n_max n_min
nozzle_max bucket thrust_left nozzle_stuck lag command n alpha beta
"""
LAST = "memory memory_scale memory_den memory_num memory_x"


@njit(error_model="numpy", nogil=True)
def _advance(worlds: Any, lanes: Any, ticks: int, h: float) -> None:
    for group in range(lanes.shape[0]):
        g, first = lanes[group, 0], group * LANES
        clear(g)
        for l in range(min(LANES, worlds.shape[0] - first)):
            worlds[first + l].dt = h
            prepare_lags(worlds[first + l], 0, h)
            gather(g, l, worlds[first + l], 0)
        for _ in range(ticks):
            actuate(g)
            sail(g)
        for l in range(min(LANES, worlds.shape[0] - first)):
            scatter(g, l, worlds[first + l], 0)


def _ships(worlds: Any) -> Any:
    """The C structs [B, n] of what the records hold."""
    B, q, v = len(worlds), worlds["plants"], worlds["vessels"]
    parts = [np.asarray(q[name][:, 0], float).reshape(B, -1) for name in FIELDS.split()]
    parts += [v["eta"][:, 0], v["nu"][:, 0], v["velocity"][:, 0]]
    parts += [np.asarray(q[name][:, 0], float).reshape(B, -1) for name in LAST.split()]
    return np.ascontiguousarray(np.concatenate(parts, axis=1))


def library() -> Any:
    """The compiled kernel, or None where there is no C compiler."""
    compiler = shutil.which("cc") or shutil.which("gcc") or shutil.which("clang")
    if compiler is None:
        return None
    source = Path(__file__).parent / "own_ship.c"
    with tempfile.TemporaryDirectory() as folder:
        target = Path(folder) / "own_ship.so"
        subprocess.run([compiler, *FLAGS, str(source), "-o", str(target), "-lm"], check=True)
        loaded = ctypes.CDLL(str(target))
    loaded.advance.argtypes = [ctypes.c_void_p, ctypes.c_long, ctypes.c_long, ctypes.c_double]
    return loaded


def compare(seconds: float = 3.0, worlds: int = 64, vessel: str = "odin") -> dict[str, Any] | None:
    """Nanoseconds per tick of the own ship alone, of our kernel and of C, calm; rounds alternate, the least counts.

    Raises
    ------
    AssertionError
        if the two do not sail the same way.
    """
    c = library()
    if c is None:
        return None
    scenario = load_scenario({"name": "alone", "own_ship": {"vessel": vessel, "route": [[0.0, 0.0], [1000.0, 0.0]]}})
    start, _ = build_worlds(scenario, worlds)
    rng = np.random.default_rng(1)
    command = start["plants"]["command"]
    command[:, 0, :, :2] = rng.uniform(-0.3, 0.9, command[:, 0, :, :2].shape)
    command[:, 0, :, 2] = 1.0
    lanes = lanes_for(start)
    _advance(start, lanes, 1, STEP)  # compiles, and prepares the lags
    ours, theirs = start.copy(), _ships(start)

    def run_c(ticks: int) -> None:
        c.advance(theirs.ctypes.data, worlds, ticks, STEP)

    _advance(ours, lanes, 300, STEP)
    run_c(300)
    at = theirs.shape[1] - sum(int(np.prod(start["plants"][name].shape[2:])) for name in LAST.split()) - 8
    motion = np.concatenate([ours["vessels"]["eta"][:, 0], ours["vessels"]["nu"][:, 0]], 1)
    np.testing.assert_allclose(theirs[:, at : at + 6], motion, rtol=1e-6, atol=1e-6)
    best = [np.inf, np.inf]
    began = time.perf_counter()
    while time.perf_counter() - began < seconds:
        for k, work in enumerate((lambda: _advance(ours, lanes, 100, STEP), lambda: run_c(100))):
            t = time.process_time()
            work()
            best[k] = min(best[k], (time.process_time() - t) / (100 * worlds))
    return {"vessel": vessel, "kernel_ns": 1e9 * best[0], "c_ns": 1e9 * best[1], "ratio": best[1] / best[0]}
