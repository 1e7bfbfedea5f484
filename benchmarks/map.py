"""How fast ``rgb_array`` is: 800 x 800 pixels of a crowded sea, on one core.

    python benchmarks/map.py

Sixteen ships and 32 obstacles within 440 m off a shore of 400 corners with an island, all detected, with trails, covariances,
AIS, shadows and labels: the worst case of a map; each frame half a second later, the own ship in the middle.  One frame is a
scene made from the record and drawn; times are of the processor.  Writes results/map.json.
"""

from __future__ import annotations

import statistics
import time
from typing import Any

import numpy as np
from measure import machine, save

from usv_gym.render.pygame_view import render
from usv_gym.render.scene import History, scene_from_snapshot
from usv_gym.world import state
from usv_gym.world.land import Polygon

V, M, SHIPS, OBSTACLES = 20, 40, 16, 32
WARM, FRAMES = 120, 120


def crowded_sea() -> Any:
    """The record."""
    rng = np.random.default_rng(3)
    w = np.zeros(1, state.world_dtype(V, M))[0]
    w["dt_us"], w["dt"] = 50_000, 0.05
    v, m, p, sensors = w["vessels"], w["obstacles"], w["picture"], w["sensors"]
    n = SHIPS + 1
    v["plant"] = -1
    v["active"][:n], v["kind"][1:n], v["kind"][0] = 1, rng.integers(0, 3, SHIPS), state.KIND_USV
    v["length"][:n] = rng.uniform(20.0, 90.0, n)
    v["length"][0] = 10.9
    v["beam"] = v["length"] / 6.0
    v["eta"][1:n, :2], v["eta"][:n, 2] = rng.uniform(-440.0, 440.0, (SHIPS, 2)), rng.uniform(-3.0, 3.0, n)
    v["nu"][:n, 0] = speed = rng.uniform(1.0, 8.0, n)
    psi = v["eta"][:n, 2]
    v["velocity"][:n] = speed[:, None] * np.column_stack((np.cos(psi), np.sin(psi)))
    m["active"][:OBSTACLES], m["kind"][:OBSTACLES] = 1, rng.choice([10, 10, 10, 11, 12, 13, 14], OBSTACLES)
    m["radius"][:OBSTACLES] = rng.uniform(4.0, 30.0, OBSTACLES)
    m["position"][:OBSTACLES] = rng.uniform(-440.0, 440.0, (OBSTACLES, 2))
    route = w["routes"]
    route["waypoint"][0, :5], route["count"][0], route["radius"][0] = rng.uniform(-400.0, 400.0, (5, 2)), 5, 20.0
    sensors["exteroceptive"] = sensors["radar"]["on"] = sensors["lidar"]["on"] = 1
    sensors["radar"]["range"], sensors["lidar"]["range"] = 1852.0, 120.0
    for source in (*range(1, n), *range(V, V + OBSTACLES)):
        ship = source < V
        p["id"][0, source], p["sensors"][0, source] = source, rng.integers(1, 8)
        p["descriptor"][0, source], p["motion_known"][0, source] = ship, 1
        p["cog"][0, source], p["sog"][0, source] = (psi[source], speed[source]) if ship else (np.nan, np.nan)
        p["radius"][0, source] = 0.5 * v["length"][source] if ship else m["radius"][source - V]
        p["covariance"][0, source] = 60.0, 20.0, 40.0, 0.0, 0.0
    w["ais"]["received"][0, 1:n], w["ais"]["heading"][1:n] = 1, psi[1:]
    w["safety"]["distance"][0] = 200.0
    advance(w)
    return w


def coast() -> tuple[Polygon, ...]:
    """A ragged shore along the eastern edge of the map, and an island."""
    rng = np.random.default_rng(5)
    north = np.linspace(-1500.0, 1500.0, 400)
    east = 330.0 + np.cumsum(rng.normal(0.0, 4.0, 400)).clip(-90.0, 90.0)
    shore = np.vstack((np.column_stack((north, east)), [(1500.0, 2000.0), (-1500.0, 2000.0)]))
    angle = np.linspace(0.0, 2.0 * np.pi, 60, endpoint=False)
    radius = rng.uniform(30.0, 45.0, 60)
    return Polygon(shore), Polygon(np.column_stack((radius * np.cos(angle) - 250.0, radius * np.sin(angle) - 280.0)))


def advance(w: Any, seconds: float = 0.5) -> None:
    """Half a second later: ships and what is known of them have moved on."""
    v, p = w["vessels"], w["picture"]
    w["tick"] += round(seconds / 0.05)
    v["eta"][:, :2] += seconds * v["velocity"]
    places = np.concatenate((v["eta"][:, :2], w["obstacles"]["position"]))
    p["position"][0, : len(places)] = places + np.array((4.0, -3.0))
    w["ais"]["position"] = places + np.array((3.0, 3.0))


def frames(size: tuple[int, int]) -> dict[str, object]:
    """Time of a frame [ms] of this size."""
    w, history, times, land = crowded_sea(), History(), [], coast()
    for _ in range(WARM + FRAMES):
        advance(w)
        began = time.process_time()
        render(scene_from_snapshot(w, [], history, coast=land), size)
        times.append(time.process_time() - began)
        if w["tick"] > 1200:  # everything stays in sight
            w["vessels"]["eta"][:, :2] -= 60.0 * w["vessels"]["velocity"]
            w["tick"] = 0
    times = times[WARM:]
    middle, best = statistics.median(times), min(times)
    return {"size": size, "frames_per_s": round(1.0 / middle),
            "median_ms": round(1e3 * middle, 1), "best_ms": round(1e3 * best, 1)}  # fmt: skip


def main() -> None:
    """Print median and best frame of the map alone, and of the map with its panel."""
    rows = [frames(size) for size in ((800, 800), (1180, 800))]
    for row in rows:
        print(f"{SHIPS} ships, {OBSTACLES} obstacles, land, {row['size']}: median {row['median_ms']} ms "
              f"({row['frames_per_s']} frames/s), best {row['best_ms']} ms")  # fmt: skip
    save("map.json", {"machine": machine(), "ships": SHIPS, "obstacles": OBSTACLES, "frames": rows})


if __name__ == "__main__":
    main()
