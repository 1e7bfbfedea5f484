"""Steps per second of everything, and what starting costs.  ``python benchmarks/throughput.py [--quick]``

Prints a table, writes benchmarks/results/throughput.json and draws docs/images/throughput.png.  How to read it:
benchmarks/README.md.  About nine minutes on a quiet machine, two of them compiling; ``--quick`` takes two and draws nothing.
"""

from __future__ import annotations

import argparse
import math
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).parent))
import ceiling
import faces
from measure import child, machine, save

BATCHES = (1, 16, 64, 256, 1024)
SHIPS = (1, 2, 4, 8, 16, 32, 64, 128, 256)
OBSTACLES = (0, 16, 32, 64, 128, 256)
TICKS = (0.2, 0.1, 0.05, 0.02)  # [s]; the control interval is 1 s


def one_world(seconds: float) -> list[dict[str, Any]]:
    rows = []
    for name, observation, filters in faces.SIGHTS:
        for weather in (False, True):
            arguments = faces.arguments(observation, filters, faces.sea(weather=weather))
            row = {"sight": name, "weather": weather, **faces.one_world(seconds, **arguments)}
            rows.append(row)
            say(row, f"{row['tracked']:.0f} targets tracked" if observation == "tracks" else "")
    return rows


def batches(seconds: float, sizes: tuple[int, ...]) -> list[dict[str, Any]]:
    rows = []
    for name, observation, filters in faces.SIGHTS:
        for weather in (False, True):
            arguments = faces.arguments(observation, filters, faces.sea(weather=weather))
            for worlds in sizes:
                row = {"sight": name, "weather": weather, "worlds": worlds, **faces.batch(seconds, worlds, **arguments)}
                rows.append(row)
                say(row, f"B = {worlds}")
    return rows


def say(row: dict[str, Any], rest: str) -> None:
    sky = "weather" if row["weather"] else "calm"
    print(f"  {row['sight']:14} {sky:8} {row['steps_per_s']:>11,.0f} steps/s   (median {row['median']:>10,.0f})  {rest}",
          flush=True)  # fmt: skip


def crews(seconds: float, sizes: tuple[int, ...]) -> list[dict[str, Any]]:
    """Gain of as many threads as cores, on the machine as it is and with a busy process on every core."""
    cores = os.cpu_count() or 1
    rows = []
    for name, observation, filters in faces.SIGHTS[::2]:  # truth, tracks
        arguments = faces.arguments(observation, filters, faces.sea())
        for worlds in sizes:
            gain = faces.threads(seconds, worlds, cores, **arguments)
            rate = faces.batch(seconds, worlds, cores, **arguments)["steps_per_s"]
            rows.append({"sight": name, "worlds": worlds, "threads": cores, "gain": gain, "steps_per_s": rate})
            print(f"  {name:14} B = {worlds:<5} {cores} threads {rate:>11,.0f} steps/s, {gain:.2f} x one", flush=True)
        worlds = 256
        others = [subprocess.Popen([sys.executable, "-c", "while True: pass"]) for _ in range(cores)]
        try:
            gain = faces.threads(4.0 * seconds, worlds, cores, "median", **arguments)
        finally:
            for other in others:
                other.kill()
                other.wait()
        rows.append({"sight": name, "worlds": worlds, "threads": cores, "busy_processes": cores, "gain": gain})
        print(f"  {name:14} B = {worlds:<5} {cores} threads beside {cores} busy processes: {gain:.2f} x one", flush=True)
    return rows


def scaling(seconds: float, quick: bool) -> dict[str, Any]:
    """Microseconds per step of one world (B = 16) against what there is in it, sensors and shadows included."""
    result: dict[str, Any] = {"ships": [], "obstacles": [], "frames": [], "sub_steps": []}

    def cost(observation: str, worlds: int = 16, **kwargs: Any) -> float:
        return 1e6 / faces.batch(seconds, worlds, **faces.arguments(observation, "thesis", faces.sea(**kwargs)))["steps_per_s"]

    for n in (8, 16) if quick else SHIPS:
        row = {"n": n, "tracks_us": cost("tracks", ships=n, icebergs=0), "truth_us": cost("truth", ships=n, icebergs=0)}
        result["ships"].append(row)
        print(f"  {n:4} ships      truth {row['truth_us']:8.2f} us, tracks {row['tracks_us']:8.2f} us", flush=True)
    many = [row for row in result["ships"] if row["n"] >= 8]
    for key in ("truth_us", "tracks_us"):
        x, y = np.log([row["n"] for row in many]), np.log([row[key] for row in many])
        result[f"slope_{key[:-3]}"] = float(np.polyfit(x, y, 1)[0])
    print(f"  log-log slope from 8 ships on: truth {result['slope_truth']:.2f}, tracks {result['slope_tracks']:.2f}")
    for n in (0, 32) if quick else OBSTACLES:
        row = {"n": n, "tracks_us": cost("tracks", icebergs=n), "truth_us": cost("truth", icebergs=n)}
        result["obstacles"].append(row)
        print(f"  {n:4} obstacles  truth {row['truth_us']:8.2f} us, tracks {row['tracks_us']:8.2f} us", flush=True)
    for frames in (1, 10) if quick else (1, 2, 5, 10):
        row = {"n": frames, "truth_us": cost("truth", worlds=64, traffic_interval=1.0 / frames)}
        result["frames"].append(row)
        print(f"  {frames:4} frames     truth {row['truth_us']:8.2f} us", flush=True)
    for dt in TICKS[:2] if quick else TICKS:
        row = {"n": round(1.0 / dt), "truth_us": cost("truth", worlds=64, dt=dt)}
        result["sub_steps"].append(row)
        print(f"  {row['n']:4} sub-steps  truth {row['truth_us']:8.2f} us", flush=True)
    return result


def starting() -> dict[str, float]:
    """Seconds to import, to compile for the first time, to make an environment, and to run a scenario when all is compiled."""
    imports = [float(child("import time; t = time.perf_counter(); import usv_gym; print(time.perf_counter() - t)")[1])
               for _ in range(5)]  # fmt: skip
    make = ("import time, gymnasium as gym, usv_gym; t = time.perf_counter(); "
            "env = gym.make('usv_gym/Scenario-v0'); m = time.perf_counter(); "
            "env.reset(seed=1); env.step(env.action_space.sample()); print(time.perf_counter() - t, m - t)")  # fmt: skip
    with tempfile.TemporaryDirectory() as cache, tempfile.TemporaryDirectory() as out:
        cold = float(child(make, USV_GYM_CACHE=cache)[1].split()[0])
        warm, made = (float(part) for part in child(make, USV_GYM_CACHE=cache)[1].split())
        arguments = ["usv-gym", "run", "busy_open_sea", "--policy", "thrust-log", "--quiet", "--out", out]
        run = f"import sys; from usv_gym.cli import main; sys.argv = {arguments!r}; main()"
        runs = [child(run, USV_GYM_CACHE=cache)[0] for _ in range(3)]
    return {"import_s": min(imports), "cold_compile_s": cold, "warm_first_step_s": warm, "gym_make_s": made,
            "warm_run_s": min(runs)}  # fmt: skip


def draw(result: dict[str, Any], target: Path) -> None:
    """The scaling as a picture."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot as plt

    figure, (left, right) = plt.subplots(1, 2, figsize=(10.0, 4.0), layout="constrained")
    for name, *_ in faces.SIGHTS:
        for weather, style in ((False, "o-"), (True, "o--")):
            rows = [r for r in result["batches"] if r["sight"] == name and r["weather"] == weather]
            colour = f"C{[s[0] for s in faces.SIGHTS].index(name)}"
            left.plot([r["worlds"] for r in rows], [r["steps_per_s"] for r in rows], style, color=colour, markersize=4,
                      label=name if not weather else None)  # fmt: skip
    left.set(xscale="log", yscale="log", xlabel="worlds in the batch", ylabel="environment steps per second, one core",
             title="16 ships, 32 icebergs, 10 sub-steps; dashed: weather")  # fmt: skip
    left.set_ylim(top=4.0 * left.get_ylim()[1])  # room for the legend
    ships = result["scaling"]["ships"]
    for key, name in (("truth_us", "truth"), ("tracks_us", "tracks")):
        right.plot([r["n"] for r in ships], [r[key] for r in ships], "o-", markersize=4,
                   label=f"{name}, slope {result['scaling'][f'slope_{name}']:.2f}")  # fmt: skip
    right.set(xscale="log", yscale="log", xlabel="ships in the world", ylabel="microseconds per step, one core",
              title="cost against ships, shadows included")  # fmt: skip
    for axes in (left, right):
        axes.grid(True, which="major", alpha=0.3)
        axes.legend(loc="upper left", ncols=2 if axes is left else 1)
    target.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(target, dpi=110)
    plt.close(figure)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=float, default=1.0, help="per case")
    parser.add_argument("--quick", action="store_true", help="fewer and shorter cases, no picture")
    parser.add_argument("--no-start", action="store_true", help="leave start-up times out")
    options = parser.parse_args()
    if not (math.isfinite(options.seconds) and options.seconds > 0.0):
        parser.error(f"--seconds: expected a number greater than 0, got {options.seconds}")
    seconds = 0.2 if options.quick else options.seconds
    name = "throughput_quick.json" if options.quick else "throughput.json"
    from usv_gym.world.state import CAPACITIES, world_dtype

    began = time.perf_counter()
    result: dict[str, Any] = {"machine": machine(), "sub_steps": 10, "ships": 16, "obstacles": 32}
    print(result["machine"], flush=True)

    def part(key: str, title: str, work: Any) -> None:
        print(f"[{time.perf_counter() - began:4.0f} s] {title}", flush=True)
        result[key] = work()
        save(name, result)

    part("ceiling", "own-ship kernel against the same physics in C", lambda: _ceilings(seconds))
    part("one_world", "one world through Env.step, one core", lambda: one_world(seconds))
    part("batches", "native batches, one core", lambda: batches(seconds, (1, 64) if options.quick else BATCHES))
    part("threads", "threads", lambda: crews(2.0 * seconds, (256,) if options.quick else (64, 256, 1024)))
    part("scaling", "cost of a step", lambda: scaling(0.5 * seconds, options.quick))
    part("sb3", "stable-baselines3, 64 worlds", lambda: _sb3(seconds))
    part("peers", "peers, one world, random actions", lambda: _peers(seconds))
    result["bytes_per_world"] = {f"{V}x{M}": world_dtype(V, M).itemsize for V, M in CAPACITIES}
    print("bytes per world (vessel x obstacle slots):", result["bytes_per_world"])
    if not (options.no_start or options.quick):
        part("start", "starting", starting)
        print("  seconds:", {key: round(value, 2) for key, value in result["start"].items()})
    save(name, result)
    if not options.quick:
        draw(result, Path(__file__).parents[1] / "docs" / "images" / "throughput.png")
    print(f"{time.perf_counter() - began:.0f} s in all")


def _ceilings(seconds: float) -> list[dict[str, Any]]:
    rows = []
    for vessel in ("odin", "otter", "jolner"):
        row = ceiling.compare(2.0 * seconds, vessel=vessel)
        if row is None:
            print("  skipped: no C compiler")
            break
        rows.append(row)
        print(f"  {vessel:8} {row['kernel_ns']:6.1f} ns per tick, C {row['c_ns']:6.1f} ns: {row['ratio']:.2f} x C", flush=True)
    return rows


def _sb3(seconds: float) -> dict[str, Any] | None:
    result: dict[str, Any] = {}
    for name, observation, filters in faces.SIGHTS:
        if name == "ais":
            continue
        rates = faces.sb3(seconds, 64, **faces.arguments(observation, filters, faces.sea()))
        if rates is None:
            print("  skipped: stable-baselines3 is not installed")
            return None
        result[name] = rates
        print(f"  {name:14} " + ", ".join(f"{key} {value:,.0f}" for key, value in rates.items()) + " steps/s", flush=True)
    return result


def _peers(seconds: float) -> dict[str, Any]:
    result = faces.peers(seconds)
    for name, rates in result.items():
        print(f"  {name:16} " + (f"{rates['steps_per_s']:>9,.0f} steps/s" if rates else "skipped: not installed (pip install "
              "'usv-gym[bench]')"), flush=True)  # fmt: skip
    return result


if __name__ == "__main__":
    main()
