"""The light filters against the thesis's: how far off the picture is, on the busy open sea and on random ones.

    python benchmarks/filters.py [--worlds 64] [--steps 240]

Same worlds, same noise; only ``sensors.tdm.filter`` differs.  Prints root mean square errors of position, speed and course of
every target that the Target Detection Module reports, at the time of the report, and their ratios.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np

import usv_gym  # noqa: F401
from usv_gym.engine import settle_traffic

WARM = 50  # steps until filters have settled


def errors(id: str, kind: str, worlds: int, steps: int, **kwargs: Any) -> dict[str, float]:
    """RMS errors with the filter ``kind`` over the reports of ``worlds`` worlds in ``steps`` control steps."""
    kwargs["overrides"] = [f"sensors.tdm.filter={kind}", *kwargs.pop("overrides", [])]
    env = gym.make_vec(id, worlds, end_on_collision=False, end_on_arrival=False, end_out_of_area=False, **kwargs)
    env.reset(seed=7)
    w = env.unwrapped.core.worlds
    action = np.tile(np.array([0.5, 0.02], np.float32), (worlds, 1))
    V = w["vessels"]["active"].shape[1]
    squared: dict[str, list[Any]] = {key: [] for key in ("position", "ships", "icebergs", "sog", "cog_deg")}
    known = 0
    for step in range(steps):
        env.step(action)
        if step < WARM or not (w["picture"]["tick"][:, 0] == w["tick"]).all():
            continue
        settle_traffic(w)
        truth = np.concatenate([w["vessels"]["eta"][:, :, :2], w["obstacles"]["position"]], 1)
        pic = w["picture"]
        S = truth.shape[1]
        there = pic["id"][:, 0, :S] > 0
        d2 = ((pic["position"][:, 0, :S] - truth) ** 2).sum(-1)
        squared["position"].append(d2[there])
        squared["ships"].append(d2[:, :V][there[:, :V]])
        squared["icebergs"].append(d2[:, V:][there[:, V:]])
        moving = there[:, :V] & (pic["motion_known"][:, 0, :V] == 1)
        known += int(moving.sum())
        v = w["vessels"]["velocity"]
        sog, cog = np.hypot(v[..., 0], v[..., 1]), np.arctan2(v[..., 1], v[..., 0])
        squared["sog"].append((pic["sog"][:, 0, :V] - sog)[moving] ** 2)
        turn = (pic["cog"][:, 0, :V] - cog)[moving]
        squared["cog_deg"].append(np.degrees((turn + np.pi) % (2 * np.pi) - np.pi) ** 2)
    env.close()
    result = {key: float(np.sqrt(np.concatenate(parts).mean())) for key, parts in squared.items()}
    return {**result, "reports": float(sum(len(part) for part in squared["position"])), "motion_known": float(known)}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--worlds", type=int, default=64)
    parser.add_argument("--steps", type=int, default=240)
    parser.add_argument("--set", nargs="*", default=[], help="KEY=VALUE on the scenario of the light filters")
    options = parser.parse_args()
    result: dict[str, Any] = {}
    for name, id, kwargs in (
        ("busy_open_sea", "usv_gym/Scenario-v0", {"scenario": "busy_open_sea"}),
        ("OpenSea-v0", "usv_gym/OpenSea-v0", {"action": "throttle_nozzle"}),
    ):
        thesis = errors(id, "thesis", options.worlds, options.steps, **kwargs)
        light = errors(id, "light", options.worlds, options.steps, overrides=options.set, **kwargs)
        result[name] = {"thesis": thesis, "light": light}
        print(f"{name}: {thesis['reports']:,.0f} reports; root mean square errors, thesis / light (ratio)")
        for key in ("position", "ships", "icebergs", "sog", "cog_deg", "motion_known"):
            print(f"  {key:12} {thesis[key]:10.4g} {light[key]:10.4g}   {light[key] / thesis[key]:.3f}", flush=True)
    if not options.set:
        target = Path(__file__).parent / "results" / "filters.json"
        target.write_text(json.dumps(result, indent=2) + "\n")


if __name__ == "__main__":
    main()
