"""`usv-gym check`: scripted scenario checks."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from .app import app


@app.command()
def check(
    files: Annotated[list[Path], typer.Argument(metavar="FILE...", help="files of checks, or directories with check_*.yaml")],
    junit: Annotated[Path | None, typer.Option(metavar="FILE.xml", help="write JUnit XML, for CI")] = None,
    trace: Annotated[
        Path | None, typer.Option(metavar="FILE.md|.csv", help="write which requirement was checked where, and how it fared")
    ] = None,
    workers: Annotated[
        int | None, typer.Option(min=1, help="processes; default: as many as there are processors")
    ] = None,
    quiet: Annotated[bool, typer.Option("--quiet", help="print nothing")] = False,
) -> None:
    """Run scripted checks; exit code 0 if all pass, 1 if not, 2 if a file, scenario or policy cannot be used."""
    from rich.console import Console

    from ..campaign.check_report import junit as junit_xml
    from ..campaign.check_report import print_table, write_trace
    from ..campaign.check_run import check_files, exit_code, fly, read_files
    from ..config import ConfigError
    from ..replay.archive import replacing

    if trace is not None and trace.suffix.lower() not in (".md", ".csv"):
        raise ConfigError(f"--trace {trace}: expected a file that ends in .md or .csv")
    for out in (junit, trace):
        if out is not None and out.is_dir():
            raise ConfigError(f"{out}: is a directory; expected a file to write")
    console = Console(quiet=quiet)
    verdicts = read_files(check_files(files))
    if console.is_terminal:
        from rich.progress import Progress

        with Progress(console=console, transient=True) as bar:
            task = bar.add_task("checks", total=None)
            fly(verdicts, workers=workers, progress=lambda done, all_: bar.update(task, completed=done, total=all_))
    else:
        fly(verdicts, workers=workers)
    try:
        if junit is not None:
            with replacing(junit) as file:
                file.write(junit_xml(verdicts))
        if trace is not None:
            write_trace(verdicts, trace)
    except OSError as error:
        raise ConfigError(f"{error.filename or junit or trace}: cannot be written: {error.strerror or error}") from None
    print_table(verdicts, console)
    raise typer.Exit(exit_code(verdicts))
