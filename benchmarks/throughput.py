"""Steps per second of one world through Env.step, and what starting costs.  ``python benchmarks/throughput.py``

Prints a table and writes benchmarks/results/throughput.json.  How to read it: benchmarks/README.md.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).parent))
from seas import crowded_sea


def machine() -> dict[str, Any]:
    model = next((line.split(":")[1].strip() for line in Path("/proc/cpuinfo").read_text().splitlines()
                  if line.startswith("model name")), "") if Path("/proc/cpuinfo").is_file() else ""  # fmt: skip
    import numba

    return {"cpu": model or platform.processor(), "cores": os.cpu_count(), "load": os.getloadavg()[0],
            "python": platform.python_version(), "numba": numba.__version__, "numpy": np.__version__}  # fmt: skip


def env_steps(observation: str, weather: bool, seconds: float) -> dict[str, Any]:
    """Steps/s through Env.step: the 95th percentile of rounds of 300 steps (the machine), and their median (what it did)."""
    import gymnasium as gym

    import usv_gym  # noqa: F401

    env = gym.make("usv_gym/Scenario-v0", scenario=crowded_sea(weather=weather), observation=observation,
                   end_on_collision=False, end_on_arrival=False)  # fmt: skip
    action = np.array([0.3, 0.1], np.float32)
    rates, tracked = [], []
    spent = 0.0
    while spent < seconds:
        env.reset(seed=1)  # and back to the middle of it all
        for _ in range(60):  # until the sensors have seen everything
            env.step(action)
        began = time.perf_counter()
        for _ in range(300):
            env.step(action)
        passed = time.perf_counter() - began
        spent += passed
        rates.append(300 / passed)
        tracked.append(int(env.unwrapped.world["picture"]["count"][0]))
    env.close()
    return {"observation": observation, "weather": weather, "steps_per_s": float(np.percentile(rates, 95)),
            "median": float(np.median(rates)), "targets_tracked": float(np.mean(tracked))}  # fmt: skip


def child(code: str, **env: str) -> tuple[float, str]:
    """Wall time and output of a fresh Python."""
    began = time.perf_counter()
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, env={**os.environ, **env}, check=True)
    return time.perf_counter() - began, done.stdout.strip()


def starting() -> dict[str, float]:
    """Seconds to import, to compile for the first time, and to run a scenario when all is compiled."""
    imports = [float(child("import time; t = time.perf_counter(); import usv_gym; print(time.perf_counter() - t)")[1])
               for _ in range(5)]  # fmt: skip
    make = ("import time, gymnasium as gym, usv_gym; t = time.perf_counter(); "
            "env = gym.make('usv_gym/Scenario-v0'); env.reset(seed=1); env.step(env.action_space.sample()); "
            "print(time.perf_counter() - t)")  # fmt: skip
    with tempfile.TemporaryDirectory() as cache, tempfile.TemporaryDirectory() as out:
        cold = float(child(make, USV_GYM_CACHE=cache)[1])
        warm = float(child(make, USV_GYM_CACHE=cache)[1])
        arguments = ["usv-gym", "run", "busy_open_sea", "--policy", "thrust-log", "--quiet", "--out", out]
        run = f"import sys; from usv_gym.cli import main; sys.argv = {arguments!r}; main()"
        runs = [child(run, USV_GYM_CACHE=cache)[0] for _ in range(3)]
    return {"import_s": min(imports), "cold_compile_s": cold, "warm_first_step_s": warm, "warm_run_s": min(runs)}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=5.0, help="per case")
    parser.add_argument("--no-start", action="store_true", help="leave start-up times out")
    options = parser.parse_args()
    from usv_gym.world.state import CAPACITIES, world_dtype

    result: dict[str, Any] = {"machine": machine(), "sub_steps": 10, "ships": 16, "obstacles": 32}
    print(json.dumps(result["machine"]))
    print("one world, 16 ships, 32 obstacles, own ship at 10 Hz, control 1 s, through Env.step on one core")
    result["env"] = []
    for observation in ("truth", "ais", "sectors", "tracks"):
        for weather in (False, True):
            row = env_steps(observation, weather, options.seconds)
            result["env"].append(row)
            print(f"  {observation:8} {'weather' if weather else 'calm':8} {row['steps_per_s']:>9,.0f} steps/s"
                  f"   (median {row['median']:,.0f}; {row['targets_tracked']:.0f} targets tracked)", flush=True)  # fmt: skip
    result["bytes_per_world"] = {f"{V}x{M}": world_dtype(V, M).itemsize for V, M in CAPACITIES}
    print("bytes per world (vessel x obstacle slots):", result["bytes_per_world"])
    if not options.no_start:
        result["start"] = starting()
        print("seconds:", {key: round(value, 2) for key, value in result["start"].items()})
    target = Path(__file__).parent / "results" / "throughput.json"
    target.parent.mkdir(exist_ok=True)
    target.write_text(json.dumps(result, indent=2) + "\n")


if __name__ == "__main__":
    main()
