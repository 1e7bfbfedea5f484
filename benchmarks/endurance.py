"""An hour of simulated random policies in many worlds: no NaN, no growth of memory, no observation outside its space.

    python benchmarks/endurance.py [--worlds 1024] [--hours 1] [--observation tracks]

Every world draws uniform actions at every control step of 1 s and starts a new random open sea when its episode ends (the
vector environment's own autoreset).  Writes results/endurance.json; exit code 1 if anything is wrong.
"""

from __future__ import annotations

import argparse
import resource
import sys
import time
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np

sys.path.insert(0, str(Path(__file__).parent))
from measure import machine, save

import usv_gym  # noqa: F401


def resident() -> float:
    """Memory in use now [MB]."""
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * resource.getpagesize() / 1e6


def endure(worlds: int, hours: float, observation: str, **kwargs: Any) -> dict[str, Any]:
    """What went wrong, and what it cost."""
    env = gym.make_vec("usv_gym/OpenSea-v0", worlds, observation=observation, **kwargs)
    low, high = env.single_observation_space.low, env.single_observation_space.high
    rng = np.random.default_rng(1)
    actions = np.zeros((worlds, *env.single_action_space.shape), np.float32)
    env.reset(seed=1)
    steps = round(3600.0 * hours)
    outside = not_finite = episodes = 0
    memory: list[float] = []
    began = time.perf_counter()
    for k in range(steps):
        rng.random(out=actions, dtype=np.float32)
        actions *= 2.0
        actions -= 1.0
        obs, reward, terminated, truncated, _ = env.step(actions)
        outside += int(np.count_nonzero((obs < low) | (obs > high)))
        not_finite += int(np.count_nonzero(~np.isfinite(obs))) + int(np.count_nonzero(~np.isfinite(reward)))
        episodes += int(np.count_nonzero(terminated | truncated))
        if k % max(steps // 60, 1) == 0:
            memory.append(resident())
            print(f"  {k / 3600.0:5.2f} h, {episodes:,} episodes, {memory[-1]:.0f} MB, {not_finite} not finite, "
                  f"{outside} outside", flush=True)  # fmt: skip
    seconds = time.perf_counter() - began
    env.close()
    settled = memory[len(memory) // 10 :]
    return {"worlds": worlds, "steps": steps, "observation": observation, "episodes": episodes, "not_finite": not_finite,
            "outside": outside, "memory_start_mb": settled[0], "memory_end_mb": settled[-1],
            "growth_mb": float(settled[-1] - settled[0]), "wall_s": seconds,
            "steps_per_s": steps * worlds / seconds}  # fmt: skip


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--worlds", type=int, default=1024)
    parser.add_argument("--hours", type=float, default=1.0)
    parser.add_argument("--observation", default="tracks", choices=("tracks", "ais", "sectors", "truth"))
    options = parser.parse_args()
    if options.worlds < 1 or not options.hours > 0.0:
        parser.error("--worlds and --hours: expected numbers greater than 0")
    result = {"machine": machine(), **endure(options.worlds, options.hours, options.observation)}
    wrong = result["not_finite"] or result["outside"] or result["growth_mb"] > 20.0
    print(result)
    save("endurance.json", result)
    sys.exit(1 if wrong else 0)


if __name__ == "__main__":
    main()
