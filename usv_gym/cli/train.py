"""`usv-gym train`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from .app import Seed, app, complain


@app.command()
def train(
    id: Annotated[str, typer.Argument(metavar="ID", help="an environment, as OpenSea-v0")],
    steps: Annotated[int, typer.Option(help="environment steps in all, over all worlds")] = 1_000_000,
    algo: Annotated[str, typer.Option(help="the algorithm: ppo")] = "ppo",
    envs: Annotated[int, typer.Option(help="worlds that run at the same time")] = 64,
    seed: Seed = 0,
    set_: Annotated[
        list[str] | None,
        typer.Option("--set", metavar="KEY=VALUE",
                     help="env.KEY: argument of the environment; ppo.KEY: hyperparameter; else a key of the scenario"),
    ] = None,
    out: Annotated[Path | None, typer.Option(help="directory of the results; default runs/ID-ALGO-SEED")] = None,
    resume: Annotated[bool, typer.Option("--resume", help="go on from the latest checkpoint in the directory")] = False,
    episodes: Annotated[int, typer.Option(help="of the evaluation at the end; 0: none")] = 200,
) -> None:  # fmt: skip
    """Train a policy; leaves policy.zip, checkpoints, logs and an evaluation beside `waypoints`."""
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

    from ..train import plan_training, print_evaluations
    from ..train import train as run_training

    training = plan_training(id, algo=algo, envs=envs, seed=seed, settings=set_ or [])
    directory = out or Path("runs") / f"{training.id.split('/')[-1]}-{algo}-{seed}"
    console = Console()
    columns = (TextColumn("{task.description}"), BarColumn(), TextColumn("{task.completed:,} of {task.total:,} steps"),
               TimeElapsedColumn(), TimeRemainingColumn())  # fmt: skip
    said = 0

    def tell(done: int, total: int, reward: float, success: float) -> None:
        nonlocal said
        description = f"return {reward:6.1f}  success {success:4.0%}" if reward == reward else "no episode is over yet"
        bar.update(task, completed=done, total=total, description=description)
        if not console.is_terminal and 10 * done // total > said:  # a log gets ten lines instead of a bar
            said = 10 * done // total
            console.print(f"{done:,} of {total:,} steps  {description}")

    try:
        with Progress(*columns, console=console, transient=True) as bar:
            task = bar.add_task("training", total=steps)
            results = run_training(training, steps, directory, resume=resume, episodes=episodes, progress=tell)
    except KeyboardInterrupt:
        complain(KeyboardInterrupt(f"interrupted; {directory} has a checkpoint: go on with --resume"))
        raise typer.Exit(130) from None
    print_evaluations(results, console)
    console.print(f"[bold]{directory}[/]: policy.zip  checkpoints  logs{'  evaluation.json' if results else ''}")
