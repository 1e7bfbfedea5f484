"""`usv-gym run`: the main job."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Annotated

import typer

from .app import Scenarios, Seed, Set, Trust, Vessel, app, one_or_all


@app.command()
def run(
    scenario: Scenarios,
    policy: Annotated[
        str | None,
        typer.Option(help="waypoints, avoid (default), idle, thrust-log (`usv-gym list policies`) or a policy.zip"),
    ] = None,
    thrust_log: Annotated[
        Path | None, typer.Option(help="recorded mission to drive by; default of --policy thrust-log: a synthetic one")
    ] = None,
    vessel: Vessel = None,
    set_: Set = None,
    seed: Seed = 0,
    out: Annotated[Path | None, typer.Option(help="directory of the results; default runs/SCENARIO-POLICY-SEED")] = None,
    trust: Trust = False,
    quiet: Annotated[bool, typer.Option("--quiet", help="print nothing but errors")] = False,
) -> None:
    """Run a scenario headless and leave archive, AIS sentences, detections, map and summary."""
    from rich.console import Console

    from ..run import listing, plan, write_outputs
    from ..run import run as run_mission

    console = Console(quiet=quiet)
    mission = plan(one_or_all(scenario), policy=policy, thrust_log=thrust_log, vessel=vessel,
                   overrides=set_ or [], seed=seed, trust=trust)  # fmt: skip
    name = mission.scenario.name or "scenario"
    directory = out or Path("runs") / f"{name}-{Path(mission.policy).stem}-{seed}"
    if directory.exists() and not directory.is_dir():
        from ..config import ConfigError

        raise ConfigError(f"{directory}: is a file; expected a directory for the results")
    began = time.perf_counter()
    if console.is_terminal:
        from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

        with Progress(TextColumn("{task.description}"), BarColumn(), TextColumn("{task.completed:.0f} s of {task.total:.0f} s"),
                      TimeElapsedColumn(), console=console, transient=True) as bar:  # fmt: skip
            task = bar.add_task(name, total=None)
            episode = run_mission(mission, lambda done, total: bar.update(task, completed=done, total=total))
    else:
        episode = run_mission(mission)
    result = write_outputs(episode, directory, wall_time_s=time.perf_counter() - began)
    if not quiet:
        from ..replay.outputs import print_summary

        print_summary(result, console)
        console.print(f"[bold]{directory}[/]: {listing(directory)}")
