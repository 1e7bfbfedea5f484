"""`usv-gym evaluate` and `usv-gym compare`: campaigns and the gate between two of them."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from .app import Set, Trust, Vessel, app, complain


@app.command()
def evaluate(
    suite: Annotated[str, typer.Option(help="a suite (`usv-gym list suites`), or a scenario or family, by name or file")],
    policy: Annotated[
        list[str] | None,
        typer.Option(help="a name, policy.zip, my.py:Class or module:Class; give it several times to compare. Default: avoid"),
    ] = None,
    seeds: Annotated[int | None, typer.Option(help="episodes of each case; default: as the suite says")] = None,
    first_seed: Annotated[int | None, typer.Option(help="the first of them; default: as the suite says")] = None,
    out: Annotated[
        Path | None, typer.Option(help="directory of the results; what is there already is not flown again. Default runs/SUITE")
    ] = None,
    accept: Annotated[
        float | None, typer.Option(help="acceptable probability of a collision or grounding, as 0.003; else exit code 1")
    ] = None,
    only: Annotated[
        list[str] | None, typer.Option(metavar="CASE[:SEED]", help="fly only this; may be given several times")
    ] = None,
    vessel: Vessel = None,
    set_: Set = None,
    step_limit: Annotated[float, typer.Option(help="seconds that one decision of your own controller may take")] = 2.0,
    profile: Annotated[str, typer.Option(help="parameters of the judge: scaled, hagen2023 or ccta2023")] = "scaled",
    workers: Annotated[
        int | None, typer.Option(min=0, help="processes; default: as many as processors; 0: this one, without time limit")
    ] = None,
    report: Annotated[bool, typer.Option("--report/--no-report", help="write report.html with the worst cases")] = True,
    trust: Trust = False,
    quiet: Annotated[bool, typer.Option("--quiet", help="print nothing but errors")] = False,
) -> None:
    """Fly policies through a suite on the same noise and leave Parquet, JSON and a report."""
    from rich.console import Console

    from ..campaign.evaluate import arrow, fly, write_results
    from ..campaign.plan import plan_campaign
    from ..campaign.printed import print_summary, progress_bar
    from ..config import ConfigError

    if accept is not None and not 0.0 < accept < 1.0:
        raise ConfigError(f"--accept {accept:g}: expected a probability between 0 and 1, as 0.003")
    arrow()  # better missing now than after an hour
    campaign = plan_campaign(
        suite, policy or ["avoid"], seeds=seeds, first_seed=first_seed, only=only or [], overrides=set_ or [], vessel=vessel,
        trust=trust, step_limit=step_limit, profile=profile,
    )  # fmt: skip
    directory = out or Path("runs") / campaign.suite
    console = Console(quiet=quiet)
    if not console.is_terminal:
        console.width = 120  # a log may scroll
    try:
        with progress_bar(console) as progress:
            journal = fly(campaign, directory, workers=workers, progress=progress)
    except KeyboardInterrupt:
        complain(KeyboardInterrupt(f"interrupted; {directory} keeps what was flown: the same command goes on from there"))
        raise typer.Exit(130) from None
    rows, summary = write_results(journal, accept=accept)
    files = "episodes.parquet  encounters.parquet  summary.json"
    if report:
        from ..campaign.report import write_report

        with console.status("report: flying the worst cases again, with a camera"):
            size = write_report(directory, journal.meta, rows, summary, workers=workers)
        files += f"  report.html ({size / 1e6:.1f} MB)"
    print_summary(summary, console)
    console.print(f"[bold]{directory}[/]: {files}", highlight=False)
    bad = [one for one in summary["policies"].values() if one["verdict"] not in ("pass", "none")]
    if bad:
        raise typer.Exit(1)


@app.command()
def compare(
    old: Annotated[Path, typer.Argument(metavar="OLD", help="results of `usv-gym evaluate`")],
    new: Annotated[Path, typer.Argument(metavar="NEW", help="results of `usv-gym evaluate` on the same cases and seeds")],
    alpha: Annotated[float, typer.Option(help="of all tests of a policy together (Holm)")] = 0.05,
    tolerance: Annotated[float, typer.Option(help="loss of a mean score that is let pass")] = 0.01,
    out: Annotated[Path | None, typer.Option(metavar="FILE.json", help="write the comparison there")] = None,
) -> None:
    """Compare two campaigns pair by pair; exit code 1 if NEW is worse than OLD."""
    import json

    from rich.console import Console

    from ..campaign.compare import compare_campaigns, print_comparison
    from ..replay.archive import replacing

    result = compare_campaigns(old, new, alpha=alpha, tolerance=tolerance)
    print_comparison(result, Console())
    if out is not None:
        with replacing(out) as file:
            file.write(json.dumps(result, indent=1).encode() + b"\n")
    if result["regressions"]:
        raise typer.Exit(1)
