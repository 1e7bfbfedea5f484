"""The command line: ``usv-gym run | validate | list | schema``.

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
        str | None, typer.Option(help="waypoints, avoid (default), idle or thrust-log; see `usv-gym list policies`")
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
    quiet: Annotated[bool, typer.Option("--quiet", help="print nothing but errors")] = False,
) -> None:
    """Run a scenario headless and leave archive, AIS sentences, detections, map and summary."""
    from rich.console import Console

    from .run import plan, write_outputs
    from .run import run as run_mission

    console = Console(quiet=quiet)
    mission = plan(scenario[0] if len(scenario) == 1 else scenario, policy=policy, thrust_log=thrust_log, vessel=vessel,
                   overrides=set_ or [], seed=seed)  # fmt: skip
    name = mission.scenario.name or "scenario"
    directory = out or Path("runs") / f"{name}-{mission.policy}-{seed}"
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
        str, typer.Argument(help="scenarios, vessels, sensors, policies or environments; default: all")
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
             for kind in ("scenarios", "vessels", "sensors")}  # fmt: skip
    kinds["policies"] = {name: text for name, (_, text) in POLICIES.items()}
    kinds["policies"][THRUST_LOG] = "a recorded mission, row by row, blind"
    kinds["environments"] = dict.fromkeys(ENVIRONMENTS, "")
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
