"""How long a campaign takes, and that one which is killed half-way and resumed has the same rows.

``python benchmarks/campaign.py`` flies 10,000 open seas with ``avoid``: once undisturbed; once until half is done and the
process is killed, and on from there.  Prints wall and processor time, and compares the sorted rows.
"""

from __future__ import annotations

import argparse
import resource
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from usv_gym.campaign.plan import read_campaign


def command(out: Path, arguments: argparse.Namespace) -> list[str]:
    each = -(-arguments.episodes // 3)  # the suite has three cases
    return [sys.executable, "-m", "usv_gym.cli", "evaluate", "--suite", "open-sea", "--policy", arguments.policy, "--seeds",
            str(each), "--out", str(out), "--no-report", "--quiet"]  # fmt: skip


def timed(words: list[str]) -> tuple[float, float]:
    """Wall and processor time [s] of a command with its workers."""
    before, began = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
    subprocess.run(words, check=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return time.perf_counter() - began, after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def rows(out: Path) -> list[dict[str, object]]:
    return [{key: value for key, value in row.items() if key != "wall"} for row in read_campaign(out)[1]]


def lines(out: Path) -> int:
    journal = out / "episodes.jsonl"
    return journal.read_bytes().count(b"\n") if journal.exists() else 0


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--episodes", type=int, default=10_000)
    parser.add_argument("--policy", default="avoid")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as directory:
        whole, killed = Path(directory) / "whole", Path(directory) / "killed"
        wall, processor = timed(command(whole, arguments))
        done = rows(whole)
        outcomes = {name: sum(row["outcome"] == name for row in done) for name in sorted({str(row["outcome"]) for row in done})}
        print(f"{len(done):,} episodes: {wall:.0f} s, {processor:.0f} s of processors; {outcomes}", flush=True)
        process = subprocess.Popen(command(killed, arguments))
        while lines(killed) < len(done) // 2:
            time.sleep(0.2)
        process.send_signal(signal.SIGKILL)
        process.wait()
        half = lines(killed)
        wall, processor = timed(command(killed, arguments))
        print(f"killed after {half:,}, then {lines(killed) - half:,} more in {wall:.0f} s, {processor:.0f} s of processors")
        same = rows(killed) == done
        print("rows are the same" if same else "ROWS DIFFER")
        sys.exit(not same)


if __name__ == "__main__":
    main()
