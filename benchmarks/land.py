"""What land costs: the same sea with and without a coast, and the index against shapely.  ``python benchmarks/land.py``

Needs the extra ``charts``.  Charts of Horten and Boston are read from ../shared/data where they are there.  Prints tables and
writes benchmarks/results/land.json.  How to read it: benchmarks/README.md.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
sys.path.insert(0, str(Path(__file__).parent))
from seas import crowded_sea
from throughput import machine

HERE = Path(__file__).parent
DATA = HERE.parents[1] / "shared" / "data"
#: ragged shores 200 to 300 m off to both sides
SYNTHETIC = {
    "polygons": [
        [[-3000 + 20 * k, side * (200 + 40 * (k % 3))] for k in range(300)] + [[3000, side * 2500], [-3000, side * 2500]]
        for side in (-1, 1)
    ]
}


def places() -> dict[str, dict[str, Any]]:
    """Keys of a scenario that put a coast around the own ship."""
    found: dict[str, dict[str, Any]] = {"synthetic, 600 corners": {"land": {**SYNTHETIC, "simplify": 0.0}}}
    if DATA.is_dir():
        for name, file, (n, e), start in (
            ("Horten (GSHHG)", "coast/oslofjord_horten.geojson", (59.4377744, 10.4716512), [0.0, 0.0]),
            ("Oslo (GSHHG)", "coast/oslofjord_full.geojson", (59.88, 10.68), [0.0, 0.0]),
            ("Boston (S-57)", "enc/US5BOSCD.000", (42.33, -70.985), [0.0, 0.0]),
        ):
            found[name] = {
                "origin": {"latitude_deg": n, "longitude_deg": e},
                "land": {"files": str(DATA / file), "safety_depth": 2.0, "radius": 8000.0},
                "own_ship": {"vessel": "odin", "position": start, "route": [[400.0, 0.0], [0.0, 400.0]]},
            }
    return found


def environments(ships: int, icebergs: int, observation: str) -> dict[str, Any]:
    import gymnasium as gym

    import usv_gym  # noqa: F401

    made = {}
    for name, keys in {"open sea": {}, **places()}.items():
        try:
            scenario = crowded_sea(ships, icebergs) | keys
            made[name] = gym.make("usv_gym/Scenario-v0", scenario=scenario, observation=observation, disable_env_checker=True,
                                  end_on_collision=False, end_on_arrival=False)  # fmt: skip
        except ValueError as error:
            print(f"  {name}: {error}")
    return made


def ratios(ships: int, icebergs: int, observation: str, rounds: int) -> list[dict[str, Any]]:
    """Time of a step near each coast / of the same sea without one; rounds of all take turns, the fastest counts."""
    made = environments(ships, icebergs, observation)
    best = dict.fromkeys(made, np.inf)
    action = np.zeros(2, np.float32)  # adrift: it stays where the coast is near
    for _ in range(rounds):
        for name, env in made.items():
            env.reset(seed=1)
            for _ in range(20):
                env.step(action)
            began = time.perf_counter()
            for _ in range(100):
                env.step(action)
            best[name] = min(best[name], (time.perf_counter() - began) / 100)
    rows = []
    for name, env in made.items():
        core = env.unwrapped.core
        corners = sum(len(ring) for polygon in core.coast(0) for ring in polygon.rings)
        sectors = int(np.isfinite(core.worlds[0]["picture"]["land"][0, :, 0]).sum())
        rows.append({"place": name, "ships": ships, "icebergs": icebergs, "observation": observation, "corners": corners,
                     "index_kB": core.land.nbytes / 1e3, "sectors": sectors, "step_us": 1e6 * best[name],
                     "ratio": best[name] / best["open sea"]})  # fmt: skip
    return rows


def grounding(n: int) -> list[dict[str, Any]]:
    """Groundings of n random hulls at each place, as the kernel and as shapely say, and the times that they take."""
    import shapely
    from land_helpers import BOSTON, HORTEN, OSLOFJORD, hull_distances, shapes
    from test_land import hulls, poses_near

    from usv_gym.scenarios.land import scenario_coast
    from usv_gym.scenarios.loader import load_scenario
    from usv_gym.world.land import land_pool
    from usv_gym.world.vessel import load_vessel

    rows = []
    for name, (file, (latitude, longitude), keys) in {"Horten": HORTEN, "Oslofjord": OSLOFJORD, "Boston": BOSTON}.items():
        start = [0.0, 3000.0] if name == "Boston" else [0.0, 0.0]
        scenario = load_scenario({"origin": {"latitude_deg": latitude, "longitude_deg": longitude},
                                  "land": {"files": str(DATA / file), **keys}, "own_ship": {"position": start}})  # fmt: skip
        polygons = scenario_coast(scenario, load_vessel("odin"))
        land, pool = shapes(polygons), land_pool((polygons,))
        shapely.prepare(land)
        rng = np.random.default_rng(0)
        poses = poses_near(land, n, rng, 30.0)
        hull_distances(pool, poses[:10], 30.0, 6.0)
        began = time.perf_counter()
        ours = hull_distances(pool, poses, 30.0, 6.0) == 0.0
        between = time.perf_counter()
        bodies = hulls(poses, 30.0, 6.0)
        theirs = shapely.intersects(land, bodies)
        ended = time.perf_counter()
        differ = np.flatnonzero(ours != theirs)
        band = [float(shapely.distance(bodies[k].boundary, shapely.boundary(land))) for k in differ]
        rows.append({"place": name, "hulls": n, "aground": int(theirs.sum()), "differ": len(differ),
                     "differ_beyond_1e-6_m": sum(d > 1e-6 for d in band), "kernel_ns": 1e9 * (between - began) / n,
                     "shapely_ns": 1e9 * (ended - between) / n})  # fmt: skip
    return rows


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rounds", type=int, default=15, help="of 100 steps per case")
    options = parser.parse_args()
    result: dict[str, Any] = {"machine": machine(), "steps": [], "grounding": []}
    for ships, icebergs, observation in ((3, 4, "tracks"), (3, 4, "sectors"), (16, 32, "tracks")):
        rows = ratios(ships, icebergs, observation, options.rounds)
        result["steps"] += rows
        for row in rows:
            print(f"  {row['ships']:2} ships {row['icebergs']:2} icebergs {row['observation']:8} {row['place']:24} "
                  f"{row['corners']:5} corners {row['index_kB']:6.0f} kB {row['sectors']:3} sectors "
                  f"{row['step_us']:7.1f} us  x {row['ratio']:.2f}", flush=True)  # fmt: skip
    if DATA.is_dir():
        result["grounding"] = grounding(100_000)
        for row in result["grounding"]:
            print(f"  {row['place']:10} {row['hulls']} hulls, {row['aground']} aground, {row['differ']} differ "
                  f"({row['differ_beyond_1e-6_m']} beyond 1e-6 m); {row['kernel_ns']:.0f} ns, "
                  f"shapely {row['shapely_ns']:.0f} ns")  # fmt: skip
    path = HERE / "results" / "land.json"
    path.write_text(json.dumps(result, indent=2) + "\n")


if __name__ == "__main__":
    main()
