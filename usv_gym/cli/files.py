"""`usv-gym validate | list | schema`: what ships and what a file says."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer

from .app import app, complain


@app.command()
def validate(
    files: Annotated[list[str], typer.Argument(help="scenario files or names")],
) -> None:
    """Check scenario files; exit code 2 if any is wrong."""
    from ..config import ConfigError
    from ..scenarios.loader import load_scenario

    wrong = False
    for file in files:
        try:
            scenario = load_scenario(file)
        except ConfigError as error:
            wrong = True
            complain(error)
        else:
            typer.echo(f"{file}: ok: {len(scenario.ships)} ships, {len(scenario.obstacles)} obstacles, "
                       f"vessel {scenario.own_ship.vessel_name}")  # fmt: skip
    if wrong:
        raise typer.Exit(2)


@app.command("list")
def list_(
    what: Annotated[
        str, typer.Argument(help="scenarios, suites, vessels, sensors, policies, requirements or environments; default: all")
    ] = "all",
) -> None:
    """List what ships with the package."""
    from rich.console import Console
    from rich.table import Table

    from ..colregs.requirements import CATALOGUE, read_requirements
    from ..config import ConfigError, read_yaml, suggestion
    from ..envs import ENVIRONMENTS
    from ..policies import POLICIES, THRUST_LOG
    from ..resources import shipped

    kinds = {kind: {name: str(read_yaml(path).data.get("description", "")) for name, path in shipped(kind).items()}
             for kind in ("scenarios", "suites", "vessels", "sensors")}  # fmt: skip
    kinds["policies"] = {name: text for name, (_, text) in POLICIES.items()}
    kinds["policies"][THRUST_LOG] = "a recorded mission, row by row, blind"
    kinds["requirements"] = {id: one.text for id, one in read_requirements(CATALOGUE).items()}
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
    from ..config import json_schema
    from ..scenarios.schema import Scenario

    text = json.dumps(json_schema(Scenario), indent=2)
    if out is None:
        typer.echo(text)
    else:
        from ..replay.archive import replacing

        with replacing(out) as file:
            file.write(text.encode() + b"\n")
