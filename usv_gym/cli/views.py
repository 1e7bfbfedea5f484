"""`usv-gym play | watch | render | replay | live`: looking at a sea."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from .app import Archive, Palette, Scenarios, Seed, Set, Trust, Vessel, app, one_or_all, pixels


@app.command()
def play(
    scenario: Scenarios,
    policy: Annotated[str | None, typer.Option(help="who steers, as of `usv-gym run`; default: you, by keyboard")] = None,
    vessel: Vessel = None,
    set_: Set = None,
    seed: Seed = 0,
    palette: Palette = "day",
    scale: Annotated[float | None, typer.Option(min=0.5, max=4.0, help="pixels per px; default: by the screen")] = None,
    record: Annotated[Path | None, typer.Option(help="directory of the results, as of `usv-gym run`")] = None,
    trust: Trust = False,
) -> None:
    """Sail a scenario in a window: by keyboard or gamepad, or watch a policy; spawn and move obstacles with the mouse."""
    from ..config import ConfigError
    from ..play import Live, plan_by_hand, show
    from ..run import listing, plan, write_outputs

    if record is not None and record.exists() and not record.is_dir():
        raise ConfigError(f"{record}: is a file; expected a directory for the results")

    source = one_or_all(scenario)
    if policy is None:
        mission = plan_by_hand(source, vessel=vessel, overrides=set_ or [], seed=seed)
    else:
        mission = plan(source, policy=policy, vessel=vessel, overrides=set_ or [], seed=seed, trust=trust)
    live = show(lambda: Live(mission), palette=palette, ratio=scale)
    if record is not None:
        write_outputs(live.voyage.finish(), record)
        typer.echo(f"{record}: {listing(record)}")


@app.command()
def watch(
    archive: Archive,
    palette: Palette = "day",
    scale: Annotated[float | None, typer.Option(min=0.5, max=4.0, help="pixels per px; default: by the screen")] = None,
) -> None:
    """Replay a recorded episode in the window."""
    from ..play import Replay, show
    from ..replay.archive import open_archive

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

    from ..config import ConfigError
    from ..render.palette import PALETTES
    from ..replay.archive import open_archive

    width, height = pixels(size)
    if palette not in PALETTES:
        raise ConfigError(f"--palette {palette}: expected one of {', '.join(PALETTES)}")
    episode = open_archive(archive)
    try:
        if out.suffix.lower() == ".png":
            from ..render.pygame_view import save_png
            from ..render.scene_episode import scene_from_episode

            try:
                scene = scene_from_episode(episode, t, future=t is None)
            except ValueError as error:
                raise ConfigError(f"--t: {error}") from None
            save_png(scene, out, size=(width, height), palette=palette)
        else:
            from ..render.video import write_film

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
    from ..config import ConfigError
    from ..replay.archive import open_archive
    from ..replay.html import write_replay

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
    scenario: Scenarios,
    policy: Annotated[str | None, typer.Option(help="as of `usv-gym run`")] = None,
    vessel: Vessel = None,
    set_: Set = None,
    seed: Seed = 0,
    pace: Annotated[float, typer.Option(min=0.25, max=50.0, help="simulated seconds per second")] = 1.0,
    port: Annotated[int, typer.Option(min=0, max=65535, help="of 127.0.0.1; 0: any that is free")] = 0,
    open_: Annotated[bool, typer.Option("--open", help="show it in the browser")] = False,
) -> None:
    """Sail a scenario in the browser, in 3-D, while it runs; a click puts an obstacle into the sea.  Ctrl-C ends it."""
    from ..live import serve
    from ..run import plan

    mission = plan(one_or_all(scenario), policy=policy, vessel=vessel, overrides=set_ or [],
                   seed=seed)  # fmt: skip

    def ready(address: str) -> None:
        typer.echo(address)
        if open_:
            typer.launch(address)

    serve(mission, port=port, pace=pace, ready=ready)
