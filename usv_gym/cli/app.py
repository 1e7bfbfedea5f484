"""What the commands share: the application, argument types, one line for an error."""

from __future__ import annotations

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

# arguments and options that several commands take
Scenarios = Annotated[
    list[str], typer.Argument(help="a name that ships, a YAML file, a directory, or the thesis's three files")
]
Vessel = Annotated[str | None, typer.Option(help="vessel by name or file, instead of the scenario's")]
Set = Annotated[list[str] | None, typer.Option("--set", metavar="KEY=VALUE", help="override a key, as weather.wind.speed=0")]
Seed = Annotated[int, typer.Option(help="of the random numbers")]
Trust = Annotated[bool, typer.Option("--trust", help="let a policy file of stable-baselines3 execute its code")]
Palette = Annotated[str, typer.Option(help="colours: day, dark or night")]
Archive = Annotated[Path, typer.Argument(metavar="DIR|FILE", help="results of a run, or an episode archive")]


def one_or_all(scenario: list[str]) -> str | list[str]:
    """A lone scenario argument as itself, the thesis's files as a list."""
    return scenario[0] if len(scenario) == 1 else scenario


def pixels(size: str) -> tuple[int, int]:
    """Width and height of ``WIDTHxHEIGHT``; ConfigError for anything else."""
    from ..config import ConfigError

    try:
        width, height = (int(part) for part in size.lower().split("x"))
        if not 1 <= min(width, height) <= max(width, height) <= 8192:
            raise ValueError
    except ValueError:
        raise ConfigError(f"--size {size}: expected WIDTHxHEIGHT in pixels, as 1180x800") from None
    return width, height


def complain(error: BaseException) -> None:
    """One line on stderr for every line of an error."""
    for line in str(error).splitlines():
        typer.echo(f"usv-gym: {line}", err=True)
