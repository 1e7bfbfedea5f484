"""`usv-gym judge`: the verdict on a recorded run."""

from __future__ import annotations

from typing import Annotated

import typer

from .app import Archive, app


@app.command()
def judge(
    archive: Archive,
    profile: Annotated[str, typer.Option(help="parameters of the judge: scaled, hagen2023 or ccta2023")] = "scaled",
    requirements: Annotated[
        str, typer.Option(help="requirements to judge by: `colregs`, or a file of your own")
    ] = "colregs",
) -> None:
    """Judge a recorded run by the COLREGs: its encounters with their scores and why, and the requirements."""
    from rich.console import Console
    from rich.table import Table

    from ..colregs.params import PROFILES
    from ..colregs.requirements import evaluate, read_requirements, verdict_word
    from ..colregs.verdict import judge as judge_trajectory
    from ..config import ConfigError, suggestion
    from ..replay.archive import open_archive
    from ..replay.truth import trajectory_of

    if profile not in PROFILES:
        raise ConfigError(f"--profile {profile}: unknown{suggestion(profile, PROFILES)}")
    params = PROFILES[profile]
    wanted = read_requirements(requirements)
    episode = open_archive(archive)
    x = trajectory_of(episode)
    verdict = judge_trajectory(x, params)
    console = Console()
    table = Table(box=None, pad_edge=False)
    for heading in ("ship", "encounter", "from", "to", "CPA", "clearance", "safety", "lowest score, and why"):
        table.add_column(heading, justify="left" if heading in ("ship", "encounter", "lowest score, and why") else "right")
    for i in range(len(verdict.encounters)):
        e = verdict.encounter(i)
        table.add_row(
            episode.name(e["ship"]), e["class"].replace("_", " "), f"{e['start']:.0f} s", f"{e['end']:.0f} s",
            f"{e['cpa_range']:.0f} m", f"{e['clearance']:.0f} m", f"{e['safety']:.2f}", e["why"],
        )  # fmt: skip
    console.print(table if len(verdict.encounters) else "no encounters")
    value, ship, time = (column[:, 0].tolist() for column in evaluate(x, wanted, params).worst())
    table = Table(box=None, pad_edge=False)
    for heading in ("requirement", "verdict", "margin", "towards", "at"):
        table.add_column(heading, justify="right" if heading in ("margin", "at") else "left")
    colours = {"holds": "green", "violated": "red", "not applicable": "dim"}
    for id, margin, j, t in zip(wanted, value, ship, time, strict=True):
        word = verdict_word(margin)
        known = word != "not applicable"
        table.add_row(id, f"[{colours[word]}]{word}[/]", f"{margin:.3g}" if known else "",
                      episode.name(j) if known and j != episode.own else "", f"{t:.0f} s" if known else "")  # fmt: skip
    console.print(table)
