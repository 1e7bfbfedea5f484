"""Kernels and loops with which tests drive the own-ship physics, without an env.

``python tests/dynamics_helpers.py`` writes the golden tables anew; review the diff.
"""

from __future__ import annotations

import functools
import json
from pathlib import Path
from typing import Any

import numpy as np

from usv_gym.jit import inner, kernel
from usv_gym.world.actuators import actuate, prepare_lags
from usv_gym.world.autopilot import autopilot, mix
from usv_gym.world.disturbance import set_weather, wave_step, weather_reset, weather_step
from usv_gym.world.dynamics import sail
from usv_gym.world.lanes import clear, gather, gather_command, lanes_for, scatter
from usv_gym.world.state import MODEL_3DOF, world_dtype
from usv_gym.world.vessel import VesselModel, load_vessel, write_plant

GOLDEN = Path(__file__).parent / "golden" / "steady_motion.json"
RECORDINGS = Path(__file__).resolve().parents[2] / "shared" / "data" / "original"
DTYPE = world_dtype(8, 16)


@functools.cache
def model(vessel: str) -> VesselModel:
    return load_vessel(vessel)


def make_world(vessel="odin", preset="standard", memory=False, dt=0.05, seed=1, **weather) -> np.ndarray[Any, Any]:
    """One world with one vessel at rest at the origin, heading north."""
    worlds = np.zeros(1, DTYPE)
    worlds["dt"], worlds["dt_us"], worlds["seed"] = dt, round(dt * 1e6), seed
    worlds["vessels"]["active"][0, 0], worlds["vessels"]["model"][0, 0] = 1, MODEL_3DOF
    worlds["vessels"]["plant"] = -1
    worlds["vessels"]["plant"][0, 0] = 0
    write_plant(model(vessel), worlds, 0, 0, preset=preset, memory=memory)
    set_weather(worlds[0], original=preset == "original", **weather)
    reset(worlds)
    return worlds


@kernel
def reset(worlds):
    weather_reset(worlds[0])


@inner
def board(g, w):
    """Put the only world into the first lane of a group."""
    clear(g)
    prepare_lags(w, 0, w.dt)
    gather(g, 0, w, 0)


@inner
def write(g, out):
    for k in range(3):
        out[k] = g.eta[k, 0]
        out[3 + k] = g.nu[k, 0]


def run(worlds, ticks, out):
    """Hold the commands for some ticks; out [ticks, 6] gets eta and nu."""
    _run(worlds, lanes_for(worlds)[0], ticks, out)


@kernel
def _run(worlds, lanes, ticks, out):
    w, g = worlds[0], lanes[0]
    board(g, w)
    for i in range(ticks):
        weather_step(g)
        actuate(g)
        wave_step(g)
        sail(g)
        if i < out.shape[0]:
            write(g, out[i])
    scatter(g, 0, w, 0)


def replay(worlds, commands, rows, wind, current, out):
    """Each tick: some command rows, one actuator call each, with wind [ticks, 2] and current [ticks, 2] prescribed."""
    _replay(worlds, lanes_for(worlds)[0], commands, rows, wind, current, out)


@kernel
def _replay(worlds, lanes, commands, rows, wind, current, out):
    w, g = worlds[0], lanes[0]
    board(g, w)
    for i in range(out.shape[0]):
        write(g, out[i])
        for row in range(rows * i, rows * i + rows):
            if row < commands.shape[0]:
                for side in range(2):
                    for k in range(3):
                        g.command[side, k, 0] = commands[row, side, k]
                actuate(g)
        if i < wind.shape[0]:
            g.wind_u10[0] = wind[i, 0]
            g.wind_direction[0] = wind[i, 1]
            g.current[0, 0] = current[i, 0]
            g.current[1, 0] = current[i, 1]
        sail(g)
    scatter(g, 0, w, 0)


def steer(worlds, heading_ref, speed_ref, ticks, every, out):
    """Autopilot on exact measurements, called every few ticks; out [ticks, 6]."""
    _steer(worlds, lanes_for(worlds)[0], heading_ref, speed_ref, ticks, every, out)


@kernel
def _steer(worlds, lanes, heading_ref, speed_ref, ticks, every, out):
    w, g = worlds[0], lanes[0]
    board(g, w)
    for i in range(ticks):
        if i % every == 0:
            surge, yaw = autopilot(w, 0, g.eta[2, 0], g.nu[2, 0], g.nu[0, 0], heading_ref, speed_ref, w.dt * every)
            mix(w, 0, surge, yaw)
            gather_command(g, 0, w, 0)
        weather_step(g)
        actuate(g)
        wave_step(g)
        sail(g)
        write(g, out[i])
    scatter(g, 0, w, 0)


def simulate(worlds, seconds, *, command=None):
    """[ticks, 6] of eta and nu under constant commands [A, 3]."""
    if command is not None:
        worlds["plants"]["command"][0, 0] = command
    out = np.zeros((round(seconds / worlds["dt"][0]), 6))
    run(worlds, len(out), out)
    return out


def jets(rpm, nozzle=0.0, bucket=1.0, bow=0.0):
    """Commands [A, 3] of two jets and a bow thruster."""
    return [[rpm, nozzle, bucket], [rpm, nozzle, bucket], [bow, 0.0, 0.0], [0.0, 0.0, 0.0]]


def propellers(port, starboard):
    """Commands [A, 3] of two propellers."""
    return [[port, 0.0, 1.0], [starboard, 0.0, 1.0], [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]]


def thrust_log(name):
    """Command rows [rows, side, 3] of a log; sides starboard, port."""
    table = np.genfromtxt(RECORDINGS / name, delimiter=",")[:, :6] / 100.0
    return np.ascontiguousarray(table.reshape(-1, 2, 3)[:, ::-1])


def steady_motion(vessel, preset="standard"):
    """Table of steady [u m/s, v m/s, r deg/s] by surge and yaw demand in per cent."""
    table = {}
    for surge in (0, 25, 50, 75, 100, -50):
        for yaw in (0, 10, 25, 50, 100):
            worlds = make_world(vessel, preset)
            demand(worlds, surge / 100, yaw / 100)
            u, v, r = simulate(worlds, 200.0)[-1, 3:]
            table[f"{surge} {yaw}"] = [round(float(x), 5) + 0.0 for x in (u, v, np.degrees(r))]
    return table


@kernel
def demand(worlds, surge, yaw):
    mix(worlds[0], 0, surge, yaw)


def golden_tables():
    return {
        "odin": steady_motion("odin"),
        "odin original": steady_motion("odin", "original"),
        "jolner": steady_motion("jolner"),
        "otter": steady_motion("otter"),
    }


if __name__ == "__main__":
    GOLDEN.parent.mkdir(exist_ok=True)
    GOLDEN.write_text(json.dumps(golden_tables(), indent=1) + "\n")
