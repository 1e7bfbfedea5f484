"""`usv-gym show | export`: a scenario as a picture or in another format."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from .app import Palette, Scenarios, Seed, Set, Vessel, app, one_or_all


def _drawn(scenario: list[str], vessel: str | None, overrides: list[str], seed: int) -> Any:
    """The one world of a scenario at its start, as an episode with this seed begins."""
    from gymnasium.utils.seeding import np_random
    from numpy import ones

    from ..config import ConfigError
    from ..envs.core import Core
    from ..scenarios.loader import load_scenario
    from ..tasks.task import TaskConfig

    if seed < 0:
        raise ConfigError(f"seed: expected a whole number of at least 0, got {seed}")
    source = load_scenario(one_or_all(scenario), overrides=overrides, vessel=vessel)
    core = Core(1, source=source, config=TaskConfig())
    core.draw(ones(1, bool), [np_random(seed)[0]])
    return core


@app.command()
def show(
    scenario: Scenarios,
    vessel: Vessel = None,
    set_: Set = None,
    seed: Seed = 0,
    out: Annotated[Path | None, typer.Option("--out", "-o", help="default: NAME.png, of a family NAME-SEED.png")] = None,
    size: Annotated[str, typer.Option(help="width x height")] = "1180x800",
    palette: Palette = "day",
) -> None:
    """Draw the start of a scenario: who is where, the routes, and how near they come if nobody manoeuvres."""
    from ..config import ConfigError
    from ..render.palette import PALETTES
    from ..render.pygame_view import save_png
    from ..render.scene_start import scene_of_start
    from .app import pixels

    if palette not in PALETTES:
        raise ConfigError(f"--palette {palette}: expected one of {', '.join(PALETTES)}")
    pixel_size = pixels(size)
    core = _drawn(scenario, vessel, set_ or [], seed)
    sea = core.scenario
    name = sea.name or "scenario"
    target = out or Path(f"{Path(name).name}-{seed}.png" if sea.family else f"{Path(name).name}.png")
    if target.suffix.lower() != ".png":
        raise ConfigError(f"{target}: expected a file that ends in .png")
    scene = scene_of_start(
        core.worlds[0], core.ids(0), title=name, cruise=core.model.cruise_speed, duration=sea.simulation.duration,
        status=(sea.own_ship.vessel_name, *([f"seed {seed}"] if sea.family else [])), tracks=core.tracks,
        coast=core.coast(0),
    )  # fmt: skip
    try:
        save_png(scene, target, size=pixel_size, palette=palette)
    except OSError as error:
        raise ConfigError(f"{target}: cannot be written: {error.strerror or error}") from None
    typer.echo(str(target))


@app.command()
def export(
    scenario: Scenarios,
    out: Annotated[Path, typer.Option("--out", "-o", help=".json: a DNV traffic situation; .yaml: a plain scenario")],
    vessel: Vessel = None,
    set_: Set = None,
    seed: Seed = 0,
) -> None:
    """Write a scenario, of a family the one that a seed draws, as a plain file or as a DNV traffic situation."""
    from ..config import ConfigError
    from ..replay.archive import replacing
    from ..scenarios.dnv import write_situation
    from ..scenarios.freeze import freeze

    kind = out.suffix.lower()
    if kind not in (".json", ".yaml", ".yml"):
        raise ConfigError(f"{out}: expected a file that ends in .json (a DNV traffic situation) or .yaml (a scenario)")
    core = _drawn(scenario, vessel, set_ or [], seed)
    plain = freeze(core.scenario, core.worlds[0], core.ids(0)) if core.scenario.family else core.scenario
    data = write_situation(plain) if kind == ".json" else plain.to_yaml().encode()
    try:
        with replacing(out) as file:
            file.write(data)
    except OSError as error:
        raise ConfigError(f"{out}: cannot be written: {error.strerror or error}") from None
    typer.echo(f"{out}: {len(plain.ships)} ships")
