"""What the benchmarks share: the machine, rates of environments, fresh interpreters, results that are never half-written."""

from __future__ import annotations

import json
import os
import platform
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

RESULTS = Path(__file__).parent / "results"
ACTION = (0.3, 0.1)  # a wide circle in the middle of the sea
WARM = 60  # steps until the sensors have seen everything


def machine() -> dict[str, Any]:
    """Processor, load and versions."""
    facts = Path("/proc/cpuinfo")
    lines = facts.read_text().splitlines() if facts.is_file() else []
    model = next((line.split(":")[1].strip() for line in lines if line.startswith("model name")), platform.processor())
    import gymnasium
    import numba

    return {"cpu": model, "cores": os.cpu_count(), "load": round(os.getloadavg()[0], 2), "python": platform.python_version(),
            "numba": numba.__version__, "numpy": np.__version__, "gymnasium": gymnasium.__version__}  # fmt: skip


def rewinder(core: Any) -> Callable[[], None]:
    """What puts the worlds of a ``Core`` back to where they are now, in the middle of it all."""
    worlds, episodes = core.worlds.copy(), core._episodes.copy()

    def rewind() -> None:
        core.worlds[:] = worlds
        core._episodes[:] = episodes

    return rewind


def rounds(work: Callable[[], int], seconds: float, before: Callable[[], None] = lambda: None) -> dict[str, float]:
    """Rates of ``work``, which returns how many steps it made, over at least three rounds and so many seconds.

    ``before`` goes before each round and is not timed.

    The 95th percentile is what the machine can do, the median what it did.
    """
    rates: list[float] = []
    spent = 0.0
    while spent < seconds or len(rates) < 3:
        before()
        began = time.perf_counter()
        steps = work()
        passed = time.perf_counter() - began
        spent += passed
        rates.append(steps / passed)
    return {"steps_per_s": float(np.percentile(rates, 95)), "median": float(np.median(rates))}


def child(code: str, **env: str) -> tuple[float, str]:
    """Wall time and output of a fresh Python."""
    began = time.perf_counter()
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, env={**os.environ, **env}, check=True)
    return time.perf_counter() - began, done.stdout.strip()


def save(name: str, result: dict[str, Any]) -> None:
    """Write results/NAME, whole or not at all."""
    RESULTS.mkdir(exist_ok=True)
    partial = RESULTS / f".{name}.part"
    partial.write_text(json.dumps(result, indent=1) + "\n")
    partial.replace(RESULTS / name)
