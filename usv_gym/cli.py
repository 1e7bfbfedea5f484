"""The command line: ``usv-gym run | train | play | watch | render | validate | list | schema``.

Exit codes: 0 done, 1 a check failed, 2 bad input (one clear line on stderr, no traceback, nothing half-written).
"""

from __future__ import annotations

import json
import sys
import time
import warnings
from pathlib import Path
from typing import Annotated

import typer

app = typer.Typer(
    name="usv-gym",
    help="Train, evaluate and verify collision avoidance for unmanned surface vehicles.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
)


@app.callback()
def _options() -> None:
    """usv-gym: a simulated sea for unmanned surface vehicles."""


@app.command()
def run(
    scenario: Annotated[
        list[str], typer.Argument(help="a name that ships, a YAML file, a directory, or the thesis's three files")
    ],
    policy: Annotated[
        str | None,
        typer.Option(help="waypoints, avoid (default), idle, thrust-log (`usv-gym list policies`) or a policy.zip"),
    ] = None,
    thrust_log: Annotated[
        Path | None, typer.Option(help="recorded mission to drive by; default of --policy thrust-log: a synthetic one")
    ] = None,
    vessel: Annotated[str | None, typer.Option(help="vessel by name or file, instead of the scenario's")] = None,
    set_: Annotated[
        list[str] | None, typer.Option("--set", metavar="KEY=VALUE", help="override a key, as weather.wind.speed=0")
    ] = None,
    seed: Annotated[int, typer.Option(help="of the random numbers")] = 0,
    out: Annotated[Path | None, typer.Option(help="directory of the results; default runs/SCENARIO-POLICY-SEED")] = None,
    trust: Annotated[
        bool, typer.Option("--trust", help="let a policy file of stable-baselines3 execute its code")
    ] = False,
    quiet: Annotated[bool, typer.Option("--quiet", help="print nothing but errors")] = False,
) -> None:
    """Run a scenario headless and leave archive, AIS sentences, detections, map and summary."""
    from rich.console import Console

    from .run import plan, write_outputs
    from .run import run as run_mission

    console = Console(quiet=quiet)
    mission = plan(scenario[0] if len(scenario) == 1 else scenario, policy=policy, thrust_log=thrust_log, vessel=vessel,
                   overrides=set_ or [], seed=seed, trust=trust)  # fmt: skip
    name = mission.scenario.name or "scenario"
    directory = out or Path("runs") / f"{name}-{Path(mission.policy).stem}-{seed}"
    if directory.exists() and not directory.is_dir():
        from .config import ConfigError

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
        from .replay.outputs import print_summary

        print_summary(result, console)
        console.print(f"[bold]{directory}[/]: episode.usv  ais.nmea  detections.csv  map.png  summary.json")


@app.command()
def train(
    id: Annotated[str, typer.Argument(metavar="ID", help="an environment, as OpenSea-v0")],
    steps: Annotated[int, typer.Option(help="environment steps in all, over all worlds")] = 1_000_000,
    algo: Annotated[str, typer.Option(help="the algorithm: ppo")] = "ppo",
    envs: Annotated[int, typer.Option(help="worlds that run at the same time")] = 64,
    seed: Annotated[int, typer.Option(help="of the random numbers")] = 0,
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

    from .train import plan_training, print_evaluations
    from .train import train as run_training

    training = plan_training(id, algo=algo, envs=envs, seed=seed, settings=set_ or [])
    directory = out or Path("runs") / f"{training.id.split('/')[-1]}-{algo}-{seed}"
    console = Console()
    columns = (TextColumn("{task.description}"), BarColumn(), TextColumn("{task.completed:,} of {task.total:,} steps"),
               TimeElapsedColumn(), TimeRemainingColumn())  # fmt: skip
    try:
        with Progress(*columns, console=console, transient=True) as bar:
            task = bar.add_task("training", total=steps)
            results = run_training(
                training, steps, directory, resume=resume, episodes=episodes,
                progress=lambda done, total, reward, success: bar.update(
                    task, completed=done, total=total, description=f"return {reward:6.1f}  success {success:4.0%}"),
            )  # fmt: skip
    except KeyboardInterrupt:
        _complain(KeyboardInterrupt(f"interrupted; {directory} has a checkpoint: go on with --resume"))
        raise typer.Exit(130) from None
    print_evaluations(results, console)
    console.print(f"[bold]{directory}[/]: policy.zip  checkpoints  logs{'  evaluation.json' if results else ''}")


Palette = Annotated[str, typer.Option(help="colours: day, dark or night")]


@app.command()
def play(
    scenario: Annotated[list[str], typer.Argument(help="as of `usv-gym run`")],
    policy: Annotated[str | None, typer.Option(help="who steers, as of `usv-gym run`; default: you, by keyboard")] = None,
    vessel: Annotated[str | None, typer.Option(help="vessel by name or file, instead of the scenario's")] = None,
    set_: Annotated[
        list[str] | None, typer.Option("--set", metavar="KEY=VALUE", help="override a key, as weather.wind.speed=0")
    ] = None,
    seed: Annotated[int, typer.Option(help="of the random numbers")] = 0,
    palette: Palette = "day",
    scale: Annotated[float | None, typer.Option(min=0.5, max=4.0, help="pixels per px; default: by the screen")] = None,
    record: Annotated[Path | None, typer.Option(help="directory of the results, as of `usv-gym run`")] = None,
    trust: Annotated[
        bool, typer.Option("--trust", help="let a policy file of stable-baselines3 execute its code")
    ] = False,
) -> None:
    """Sail a scenario in a window: by keyboard or gamepad, or watch a policy; spawn and move obstacles with the mouse."""
    from .config import ConfigError
    from .play import Live, plan_by_hand, show
    from .run import plan, write_outputs

    if record is not None and record.exists() and not record.is_dir():
        raise ConfigError(f"{record}: is a file; expected a directory for the results")

    source = scenario[0] if len(scenario) == 1 else scenario
    if policy is None:
        mission = plan_by_hand(source, vessel=vessel, overrides=set_ or [], seed=seed)
    else:
        mission = plan(source, policy=policy, vessel=vessel, overrides=set_ or [], seed=seed, trust=trust)
    live = show(lambda: Live(mission), palette=palette, ratio=scale)
    if record is not None:
        write_outputs(live.voyage.finish(), record)
        typer.echo(f"{record}: episode.usv  ais.nmea  detections.csv  map.png  summary.json")


Archive = Annotated[Path, typer.Argument(metavar="DIR|FILE", help="results of a run, or an episode archive")]


@app.command()
def watch(
    archive: Archive,
    palette: Palette = "day",
    scale: Annotated[float | None, typer.Option(min=0.5, max=4.0, help="pixels per px; default: by the screen")] = None,
) -> None:
    """Replay a recorded episode in the window."""
    from .play import Replay, show
    from .replay.archive import open_archive

    episode = open_archive(archive)
    show(lambda: Replay(episode), palette=palette, ratio=scale)


@app.command()
def render(
    archive: Archive,
    out: Annotated[Path, typer.Option("--out", "-o", help="picture or film: .png, .mp4 or .gif")],
    size: Annotated[str, typer.Option(help="width x height")] = "1180x800",
    palette: Palette = "day",
    t: Annotated[float | None, typer.Option("--t", help="time [s] of a picture; default: the whole episode")] = None,
    fps: Annotated[float, typer.Option(help="of a film")] = 20.0,
    speed: Annotated[float, typer.Option(help="of a film: times real time")] = 10.0,
) -> None:
    """Draw a recorded episode as a picture or a film."""
    from rich.progress import Progress

    from .config import ConfigError
    from .render.palette import PALETTES
    from .replay.archive import open_archive

    try:
        width, height = (int(part) for part in size.lower().split("x"))
        if not 1 <= min(width, height) <= max(width, height) <= 8192:
            raise ValueError
    except ValueError:
        raise ConfigError(f"--size {size}: expected WIDTHxHEIGHT in pixels, as 1180x800") from None
    if palette not in PALETTES:
        raise ConfigError(f"--palette {palette}: expected one of {', '.join(PALETTES)}")
    episode = open_archive(archive)
    try:
        if out.suffix.lower() == ".png":
            from .render.pygame_view import save_png
            from .render.scene_episode import scene_from_episode

            try:
                scene = scene_from_episode(episode, t, future=t is None)
            except ValueError as error:
                raise ConfigError(f"--t: {error}") from None
            save_png(scene, out, size=(width, height), palette=palette)
        else:
            from .render.video import write_film

            with Progress(transient=True) as bar:
                task = bar.add_task(out.name, total=None)
                write_film(episode, out, fps=fps, speed=speed, size=(width, height), palette=palette,
                           progress=lambda done, total: bar.update(task, completed=done, total=total))  # fmt: skip
    except OSError as error:
        raise ConfigError(f"{out}: cannot be written: {error.strerror or error}") from None
    typer.echo(f"{out}: {out.stat().st_size / 1e6:.2f} MB")


@app.command()
def replay(
    archive: Archive,
    out: Annotated[
        Path | None, typer.Option("-o", "--out", metavar="FILE.html", help="default: replay.html beside the episode")
    ] = None,
    open_: Annotated[bool, typer.Option("--open", help="show it in the browser")] = False,
) -> None:
    """Write the 3-D replay of a recorded episode: one HTML file that needs no network."""
    from .config import ConfigError
    from .replay.archive import open_archive
    from .replay.html import write_replay

    episode = open_archive(archive)
    target = out or (archive / "replay.html" if archive.is_dir() else archive.with_suffix(".html"))
    try:
        size = write_replay(episode, target)
    except OSError as error:
        raise ConfigError(f"{target}: cannot be written: {error.strerror or error}") from None
    typer.echo(f"{target}: {size / 1e6:.2f} MB")
    if open_:
        typer.launch(target.resolve().as_uri())


@app.command()
def live(
    scenario: Annotated[list[str], typer.Argument(help="as of `usv-gym run`")],
    policy: Annotated[str | None, typer.Option(help="as of `usv-gym run`")] = None,
    vessel: Annotated[str | None, typer.Option(help="vessel by name or file, instead of the scenario's")] = None,
    set_: Annotated[
        list[str] | None, typer.Option("--set", metavar="KEY=VALUE", help="override a key, as weather.wind.speed=0")
    ] = None,
    seed: Annotated[int, typer.Option(help="of the random numbers")] = 0,
    pace: Annotated[float, typer.Option(min=0.25, max=50.0, help="simulated seconds per second")] = 1.0,
    port: Annotated[int, typer.Option(min=0, max=65535, help="of 127.0.0.1; 0: any that is free")] = 0,
    open_: Annotated[bool, typer.Option("--open", help="show it in the browser")] = False,
) -> None:
    """Sail a scenario in the browser, in 3-D, while it runs; a click puts an obstacle into the sea.  Ctrl-C ends it."""
    from .live import serve
    from .run import plan

    mission = plan(scenario[0] if len(scenario) == 1 else scenario, policy=policy, vessel=vessel, overrides=set_ or [],
                   seed=seed)  # fmt: skip

    def ready(address: str) -> None:
        typer.echo(address)
        if open_:
            typer.launch(address)

    serve(mission, port=port, pace=pace, ready=ready)


@app.command()
def validate(
    files: Annotated[list[str], typer.Argument(help="scenario files or names")],
) -> None:
    """Check scenario files; exit code 2 if any is wrong."""
    from .config import ConfigError
    from .scenarios.loader import load_scenario

    wrong = False
    for file in files:
        try:
            scenario = load_scenario(file)
        except ConfigError as error:
            wrong = True
            _complain(error)
        else:
            typer.echo(f"{file}: ok: {len(scenario.ships)} ships, {len(scenario.obstacles)} obstacles, "
                       f"vessel {scenario.own_ship.vessel}")  # fmt: skip
    if wrong:
        raise typer.Exit(2)


@app.command("list")
def list_(
    what: Annotated[
        str, typer.Argument(help="scenarios, suites, vessels, sensors, policies or environments; default: all")
    ] = "all",
) -> None:
    """List what ships with the package."""
    from rich.console import Console
    from rich.table import Table

    from .config import ConfigError, read_yaml, suggestion
    from .envs import ENVIRONMENTS
    from .policies import POLICIES, THRUST_LOG
    from .resources import shipped

    kinds = {kind: {name: str(read_yaml(path).data.get("description", "")) for name, path in shipped(kind).items()}
             for kind in ("scenarios", "suites", "vessels", "sensors")}  # fmt: skip
    kinds["policies"] = {name: text for name, (_, text) in POLICIES.items()}
    kinds["policies"][THRUST_LOG] = "a recorded mission, row by row, blind"
    kinds["environments"] = {name: text for name, (text, _) in ENVIRONMENTS.items()}
    if what != "all" and what not in kinds:
        raise ConfigError(f"list {what!r}: unknown kind{suggestion(what, [*kinds, 'all'])}")
    table = Table(box=None, show_header=False)
    for kind, things in kinds.items():
        if what in ("all", kind):
            for name, text in things.items():
                table.add_row(kind, f"[bold]{name}[/]", text.split(". ")[0].strip())
    Console().print(table)


@app.command()
def schema(
    out: Annotated[Path | None, typer.Option(help="file to write; default: standard output")] = None,
) -> None:
    """Write the JSON Schema of scenario files, for editors."""
    from .config import json_schema
    from .scenarios.schema import Scenario

    text = json.dumps(json_schema(Scenario), indent=2)
    if out is None:
        typer.echo(text)
    else:
        from .replay.archive import replacing

        with replacing(out) as file:
            file.write(text.encode() + b"\n")


def _complain(error: BaseException) -> None:
    for line in str(error).splitlines():
        typer.echo(f"usv-gym: {line}", err=True)


def _short_warning(message: Warning | str, category: type[Warning], *_: object, **__: object) -> None:
    typer.echo(f"usv-gym: warning: {message}", err=True)


def main() -> None:
    """Entry point: errors of input become one line and exit code 2."""
    from .config import ConfigError
    from .replay.archive import ArchiveError

    warnings.showwarning = _short_warning
    try:
        app()
    except (ConfigError, ArchiveError) as error:
        _complain(error)
        sys.exit(2)
    except KeyboardInterrupt:
        _complain(KeyboardInterrupt("interrupted; nothing was written"))
        sys.exit(130)


if __name__ == "__main__":
    main()
