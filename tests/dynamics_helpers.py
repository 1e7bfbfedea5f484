"""Kernels and loops with which tests drive the own-ship physics, without an env.

``python tests/dynamics_helpers.py`` writes the golden tables anew; review the diff.
"""

from __future__ import annotations

import functools
import json
from pathlib import Path
from typing import Any

import numpy as np

from usv_gym.jit import kernel
from usv_gym.world.actuators import actuate
from usv_gym.world.autopilot import autopilot, mix
from usv_gym.world.disturbance import set_weather, wave_step, weather_reset, weather_step
from usv_gym.world.dynamics import plant_step
from usv_gym.world.state import world_dtype
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
    write_plant(model(vessel), worlds, 0, 0, preset=preset, memory=memory)
    set_weather(worlds[0], original=preset == "original", **weather)
    reset(worlds)
    return worlds


@kernel
def reset(worlds):
    weather_reset(worlds[0])


@kernel
def run(worlds, ticks, out):
    """Hold the commands for some ticks; out [ticks, 6] gets eta and nu."""
    w = worlds[0]
    for i in range(ticks):
        weather_step(w, w.tick)
        actuate(w, 0, w.dt)
        wave_step(w, 0, 0, w.tick)
        plant_step(w, 0, 0, w.dt)
        w.tick += 1
        if i < out.shape[0]:
            for k in range(3):
                out[i, k] = w.vessels.eta[0, k]
                out[i, 3 + k] = w.vessels.nu[0, k]


@kernel
def replay(worlds, commands, rows, wind, current, out):
    """Each tick: some command rows, one actuator call each, with wind [ticks, 2] and current [ticks, 2] prescribed."""
    w = worlds[0]
    for i in range(out.shape[0]):
        for k in range(3):
            out[i, k] = w.vessels.eta[0, k]
            out[i, 3 + k] = w.vessels.nu[0, k]
        for row in range(rows * i, rows * i + rows):
            if row < commands.shape[0]:
                for side in range(2):
                    for k in range(3):
                        w.plants.command[0, side, k] = commands[row, side, k]
                actuate(w, 0, w.dt)
        if i < wind.shape[0]:
            w.weather.wind_u10 = wind[i, 0]
            w.weather.wind_direction = wind[i, 1]
            w.weather.current[0] = current[i, 0]
            w.weather.current[1] = current[i, 1]
        plant_step(w, 0, 0, w.dt)


@kernel
def steer(worlds, heading_ref, speed_ref, ticks, every, out):
    """Autopilot on exact measurements, called every few ticks; out [ticks, 6]."""
    w = worlds[0]
    for i in range(ticks):
        weather_step(w, w.tick)
        if i % every == 0:
            nu = w.vessels.nu
            surge, yaw = autopilot(w, 0, w.vessels.eta[0, 2], nu[0, 2], nu[0, 0], heading_ref, speed_ref, w.dt * every)
            mix(w, 0, surge, yaw)
        actuate(w, 0, w.dt)
        wave_step(w, 0, 0, w.tick)
        plant_step(w, 0, 0, w.dt)
        w.tick += 1
        for k in range(3):
            out[i, k] = w.vessels.eta[0, k]
            out[i, 3 + k] = w.vessels.nu[0, k]


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
