"""Real traffic: ``usv-gym import-ais``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from .app import app


@app.command("import-ais")
def import_ais(
    files: Annotated[
        list[Path], typer.Argument(metavar="FILE..", help="AIS history: CSV of DMA or NOAA, or NMEA logs; also .gz, .zip")
    ],
    area: Annotated[str, typer.Option(help="LAT,LON,RADIUS (as 50.78,-1.11,3km), or a name, as solent")],
    start: Annotated[str | None, typer.Option(help="UTC, as 2016-01-12T13:10; default: the first fix in the area")] = None,
    duration: Annotated[str, typer.Option(help="as 600, 30min or 1.5h")] = "30min",
    own: Annotated[
        str, typer.Option(metavar="MMSI|FILE|log", help="own ship from a real track: start and route; log: who wrote the log")
    ] = "",
    vessel: Annotated[str, typer.Option(help="vessel of the own ship, by name or file")] = "odin",
    out: Annotated[Path, typer.Option("--out", "-o", help="scenario to write; its tracks go beside it")] = Path("traffic.yaml"),
    handover: Annotated[
        float, typer.Option(min=0.0, help="[m] from the own ship at which a ship leaves its track; 0: never")
    ] = 0.0,
    behaviour: Annotated[str, typer.Option(help="of ships that left their track: waypoints, keep_course, colregs, ..")] = "",
    max_gap: Annotated[float, typer.Option(min=1.0, help="[s] without a report after which a ship is not seen")] = 400.0,
    tolerance: Annotated[float, typer.Option(min=0.1, help="[m] that thinning may move a ship")] = 3.0,
    ships: Annotated[int, typer.Option(min=0, max=256, help="at most so many, those that come nearest to the centre")] = 256,
    quiet: Annotated[bool, typer.Option("--quiet", help="print nothing but errors")] = False,
) -> None:
    """Turn AIS history into a scenario: the ships of a place and a time, replayed."""
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

    from ..config import ConfigError
    from ..replay.archive import replacing
    from ..scenarios.ais_import.request import parse_area, parse_duration, parse_start
    from ..scenarios.ais_import.scene import Request, file_texts
    from ..scenarios.ais_import.scene import import_ais as make

    if out.suffix not in (".yaml", ".yml"):
        raise ConfigError(f"--out {out}: expected a file that ends in .yaml")
    request = Request(
        files, parse_area(area), None if start is None else parse_start(start), parse_duration(duration), own=own,
        vessel=vessel, name=out.stem, handover={"distance": handover} if handover else {}, behaviour=behaviour,
        max_gap=max_gap, tolerance=tolerance, most=ships,
    )  # fmt: skip
    console = Console(quiet=quiet)
    if behaviour and not handover:
        raise ConfigError(f"--behaviour {behaviour}: is for ships that left their track; give --handover METRES too")
    with Progress(TextColumn("reading"), BarColumn(), TextColumn("{task.completed:.0f} of {task.total:.0f} MB"),
                  TimeElapsedColumn(), console=console, transient=True, disable=not console.is_terminal) as bar:  # fmt: skip
        task = bar.add_task("reading", total=1)
        imported = make(request, lambda done, total: bar.update(task, completed=done / 1e6, total=total / 1e6))
    texts = file_texts(imported, out)
    try:
        for path, text in texts.items():
            with replacing(path) as file:
                file.write(text.encode())
    except OSError as error:
        raise ConfigError(f"{out}: cannot be written: {error.strerror or error}") from None
    _report(console, imported)
    sizes = ", ".join(f"{path.name} ({len(text) / 1000:.0f} kB)" for path, text in texts.items())
    console.print(f"[bold]{out}[/]: {sizes}", soft_wrap=True)


def _report(console: Any, imported: Any) -> None:
    """What was read, and what became of it."""
    harvest, scenario = imported.harvest, imported.scenario
    console.print(f"{harvest.lines:,} lines, {harvest.fixes:,} position reports of ships", highlight=False)
    for what, count in harvest.odd.most_common():
        console.print(f"  {count:,} {what}", highlight=False)
    summary = f"{len(scenario['ships'])} ships from {imported.fixes:,} reports, {imported.knots:,} knots"
    console.print(f"{summary}; they pass the reported places within {imported.spread[0]:.1f} m (half of them) and "
                  f"{imported.spread[1]:.1f} m (95 %)", highlight=False, soft_wrap=True)  # fmt: skip
    if imported.single:
        console.print(f"  {imported.single} more with a single report have no track", highlight=False)
    if imported.left_out:
        console.print(f"  {imported.left_out} more are farther from the centre and left out", highlight=False)
