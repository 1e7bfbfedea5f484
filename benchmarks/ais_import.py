"""Import of AIS history: memory and time on a table of 1 GB, and how near replayed ships pass to where they reported to be.

    python benchmarks/ais_import.py [--data ../shared/data] [--gigabytes 1]

The table is synthetic, in the columns of the Danish Maritime Authority: 2000 ships on straight courses, a report every ten
seconds.  The import takes those within 20 km for two hours, in a process of its own whose peak of memory is read.  The replay
runs through the kernel, second by second, for all ships of both recordings of real traffic.  Writes results/ais_import.json.
"""

from __future__ import annotations

import argparse
import json
import math
import subprocess
import sys
import tempfile
import textwrap
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from usv_gym.engine import advance_worlds, reset_worlds
from usv_gym.scenarios.ais_import import clean
from usv_gym.scenarios.ais_import.csv_files import read_csv
from usv_gym.scenarios.ais_import.fixes import Harvest
from usv_gym.scenarios.ais_import.request import parse_area, parse_start
from usv_gym.scenarios.ais_import.scene import Request, import_ais
from usv_gym.scenarios.build import build_worlds, track_pool
from usv_gym.scenarios.loader import load_scenario
from usv_gym.world.land import NO_LAND
from usv_gym.world.lanes import lanes_for

SHIPS, EVERY = 2000, 10  # ships; seconds between two reports of each
COLUMNS = ("# Timestamp,Type of mobile,MMSI,Latitude,Longitude,Navigational status,ROT,SOG,COG,Heading,IMO,Callsign,Name,"
           "Ship type,Cargo type,Width,Length,Position fixing device,Draught,Destination,ETA,Data source type")  # fmt: skip
NO_ROWS = np.zeros((0, 0, 4, 3))
RECORDINGS = (("solent_20160112_noaa.csv", "solent", "2016-01-12T13:02:11", 5070),
              ("channel_20110726_dma.csv", "english-channel", "2011-07-26T10:00", 14396))  # fmt: skip
IMPORT = """
    import json, resource, sys, time
    from pathlib import Path
    from usv_gym.scenarios.ais_import.request import parse_area, parse_start
    from usv_gym.scenarios.ais_import.scene import Request, file_texts, import_ais
    began = time.process_time()
    imported = import_ais(Request([Path(sys.argv[1])], parse_area("56,11,20km"), parse_start("2018-02-08T01:00"), 7200.0))
    file_texts(imported, Path("big.yaml"))
    print(json.dumps({"rows": imported.harvest.fixes, "ships": len(imported.scenario["ships"]), "reports": imported.fixes,
                      "cpu_s": time.process_time() - began,
                      "peak_MB": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024}))
"""


def big_table(path: Path, size: float) -> None:
    """Write a table of ``size`` bytes."""
    draw = np.random.default_rng(1)
    lat, lon = draw.uniform(54.5, 57.5, SHIPS), draw.uniform(9.0, 13.0, SHIPS)
    course, knots = draw.uniform(0, 360, SHIPS), draw.uniform(0, 20, SHIPS)
    rest = [f"{k:.1f},{c:.1f},{c:.0f},9{i:06d},CALL{i},SHIP {i},Cargo,,20,120,GPS,8.0,SOMEWHERE,,AIS" for i, (k, c) in
            enumerate(zip(knots, course, strict=True))]  # fmt: skip
    north, east = knots * np.cos(np.radians(course)) / 3600 / 60, knots * np.sin(np.radians(course)) / 3600 / 33
    with path.open("w") as file:
        file.write(COLUMNS + "\n")
        t = 0
        while file.tell() < size:
            stamp = f"08/02/2018 {t // 3600:02d}:{t // 60 % 60:02d}:{t % 60:02d}"
            file.writelines(
                f"{stamp},Class A,{219_000_000 + i},{la:.6f},{lo:.6f},Under way using engine,0.0,{r}\n"
                for i, (la, lo, r) in enumerate(zip((lat + north * t).tolist(), (lon + east * t).tolist(), rest, strict=True))
            )
            t += EVERY


def memory(size: float) -> dict[str, Any]:
    """Import a table of ``size`` bytes in a process of its own."""
    with tempfile.TemporaryDirectory() as directory:
        path = Path(directory) / "big.csv"
        big_table(path, size)
        began = time.perf_counter()
        done = subprocess.run([sys.executable, "-c", textwrap.dedent(IMPORT), path], check=True, capture_output=True, text=True)
        return {"bytes": path.stat().st_size, "wall_s": round(time.perf_counter() - began, 1), **json.loads(done.stdout)}


def replay(path: Path, place: str, begin: str, seconds: int) -> dict[str, Any]:
    """Sail all ships of a recording and compare with every report of theirs."""
    area, start = parse_area(place), parse_start(begin)
    imported = import_ais(Request([path], area, start, float(seconds)))
    whole = imported.whole()
    reported = Harvest(replace(area, start=start, end=start + seconds))
    read_csv(path, reported)
    names, off, sog_off, unseen = list(whole["ships"]), [], [], 0
    for first in range(0, len(names), 7):
        some = names[first : first + 7]
        scenario = load_scenario({**whole, "ships": {name: whole["ships"][name] for name in some}, "own_ship": {"ais": "off"},
                                  "simulation": {"dt": 0.05, "traffic_interval": 1.0}})  # fmt: skip
        worlds, _ = build_worlds(scenario, capacity=(8, 16))
        worlds["sensors"]["exteroceptive"] = 0
        tracks = track_pool(scenario)
        reset_worlds(worlds, NO_LAND, tracks, np.ones(1, bool))
        states = np.full((seconds + 1, len(some), 3), np.nan)
        v = worlds["vessels"][0]
        for t in range(seconds + 1):
            if t:
                advance_worlds(worlds, lanes_for(worlds), NO_LAND, tracks, 20, NO_ROWS)
            for k in range(len(some)):
                if v["active"][1 + k]:
                    states[t, k] = *v["eta"][1 + k, :2], math.hypot(*v["velocity"][1 + k])
        for k, name in enumerate(some):
            fixes = clean.to_local(reported.ships[whole["ships"][name]["mmsi"]].table(), area)
            there = states[np.rint(fixes[:, 0] - start).astype(int), k]
            d = np.hypot(there[:, 0] - fixes[:, 1], there[:, 1] - fixes[:, 2])
            seen = np.isfinite(d)
            off.append(d[seen])
            unseen += int((~seen).sum())
            sog_off.append((there[:, 2] - np.hypot(fixes[:, 3], fixes[:, 4]))[seen])
    distance, sog = np.concatenate(off), np.abs(np.concatenate(sog_off))
    return {
        "recording": path.name, "ships": len(names), "reports": len(distance), "reports_while_not_seen": unseen,
        "knots": imported.knots, "single_reports": imported.single,
        "distance_m": dict(zip(("p50", "p95", "p99", "max"), np.round(np.percentile(distance, (50, 95, 99, 100)), 1).tolist(),
                               strict=True)),
        "sog_difference_kn_p95": round(float(np.nanpercentile(sog, 95)) / 0.514444, 2),
    }  # fmt: skip


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("--data", type=Path, default=Path(__file__).resolve().parents[2] / "shared" / "data")
    parser.add_argument("--gigabytes", type=float, default=1.0)
    given = parser.parse_args()
    results: dict[str, Any] = {"table": memory(given.gigabytes * 1e9)}
    print(results["table"])
    for name, *rest in RECORDINGS:
        if (given.data / "ais" / name).is_file():
            results[name] = replay(given.data / "ais" / name, *rest)
            print(results[name])
    path = Path(__file__).parent / "results" / "ais_import.json"
    path.write_text(json.dumps(results, indent=1) + "\n")


if __name__ == "__main__":
    main()
