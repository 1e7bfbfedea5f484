"""10,000 generated encounters: are they what was asked for, and how fast do they come?  `python benchmarks/encounters.py`."""

from __future__ import annotations

import time

import numpy as np

from usv_gym.scenarios.encounters import draw, generate, template
from usv_gym.world.encounter import encounters

N = 10_000


def main() -> None:
    print(f"{'difficulty':>10} {'ships':>6} {'class %':>8} {'worst dcpa error m':>19} {'records/s':>10}")
    for difficulty in (0.0, 0.5, 1.0):
        scenario = template(difficulty=difficulty)
        draw(scenario, np.arange(2, dtype=np.uint64))  # compile
        seeds = np.random.default_rng(1).integers(0, 1 << 63, N, dtype=np.uint64)
        began = time.process_time()
        worlds, asked = draw(scenario, seeds)
        seconds = time.process_time() - began
        v = worlds["vessels"]
        state = np.concatenate([v["eta"][..., :2], v["velocity"]], axis=-1)
        shape = state[:, 1:].shape[:2]
        codes, distances, times = np.zeros(shape, np.int64), np.zeros(shape), np.zeros(shape)
        encounters(np.ascontiguousarray(state[:, 0]), np.ascontiguousarray(state[:, 1:]), codes, distances, times)
        there = asked["code"] > 0
        right = 100.0 * (codes == asked["code"])[there].mean()
        worst = np.abs(distances - asked["dcpa"])[there].max()
        print(f"{difficulty:>10} {there.sum():>6} {right:>8.2f} {worst:>19.2e} {N / seconds:>10.0f}")
    began = time.process_time()
    generate(2000, seed=1)
    print(f"as plain scenarios, difficulty 0.5: {2000 / (time.process_time() - began):.0f} per second")


if __name__ == "__main__":
    main()
