"""Draws the pictures of the pages anew, as a user would make them, into docs/images.

    python benchmarks/pictures.py            # all
    python benchmarks/pictures.py window encounter replay_3d

Look at every one.  The maps need pygame-ce, the film the extra ``video``, the 3-D replays Chromium, the sea of real traffic its
recording.  Pictures of tracks (behaviours), of throughput.py and of RViz are not made here.
"""

from __future__ import annotations

import functools
import os
import sys
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

from usv_gym.render.pygame_view import save_png
from usv_gym.render.scene import scene_from_episode
from usv_gym.run import plan, run

IMAGES = Path(__file__).parents[1] / "docs" / "images"
PAGE = (1400, 850)


@functools.cache
def sailed(scenario: str, policy: str, seed: int) -> Any:
    """A recorded episode."""
    return run(plan(scenario, policy=policy, seed=seed))


def map_dark() -> None:
    """In the middle of the busy open sea."""
    _busy("dark")


def map_night() -> None:
    """The same in red."""
    _busy("night")


def _busy(palette: str) -> None:
    scene = scene_from_episode(sailed("busy_open_sea", "avoid", 0), t=95.0, future=False)
    save_png(scene, IMAGES / f"map_{palette}.png", palette=palette)


def near_shore() -> None:
    """A whole run between two shores."""
    save_png(scene_from_episode(sailed("near_shore", "avoid", 2)), IMAGES / "near_shore.png")


def real_traffic() -> None:
    """The entrance of Portsmouth harbour, as the page has it; the recording lies outside the project."""
    recording = Path(__file__).parents[2] / "shared" / "data" / "ais" / "solent_20160112_noaa.csv"
    if not recording.exists():
        print(f"real_traffic: {recording} is not here", file=sys.stderr)
        return
    with TemporaryDirectory() as directory:
        scenario = str(Path(directory) / "portsmouth.yaml")
        _cli("import-ais", str(recording), "--area", "50.775,-1.10,3km", "--start", "2016-01-12T13:20", "--duration", "20min",
             "--own", "235070762", "--handover", "250", "--behaviour", "colregs", "--ships", "19", "-o", scenario)  # fmt: skip
        save_png(scene_from_episode(sailed(scenario, "avoid", 0)), IMAGES / "real_traffic.png")


def show_encounter() -> None:
    """The start of a generated encounter."""
    _cli("show", "encounter", "--seed", "5", "-o", str(IMAGES / "show_encounter.png"))


def show_imazu_13() -> None:
    """The start of Imazu's case 13."""
    _cli("show", "imazu/13", "-o", str(IMAGES / "show_imazu_13.png"))


def encounter() -> None:
    """The film at the top of the README."""
    from usv_gym.render.video import write_film

    write_film(sailed("busy_open_sea", "avoid", 0), IMAGES / "encounter.gif", size=(600, 500), fps=7.0, speed=21.0)


def window() -> None:
    """The live window: a few places marked, a vessel selected."""
    os.environ["SDL_VIDEODRIVER"] = "dummy"
    from usv_gym.play import Live, plan_by_hand
    from usv_gym.render.canvas import load_pygame
    from usv_gym.render.desk import Desk
    from usv_gym.render.window import Window

    pg = load_pygame()
    frame = Window(ratio=1.0)
    frame.screen = pg.display.set_mode((1180, 834))  # whatever the size of the screen
    desk = Desk(Live(plan_by_hand("busy_open_sea")), frame.size)

    def key(name: str, seconds: float = 0.0) -> None:
        code = getattr(pg, f"K_{name}")
        desk.handle(pg.event.Event(pg.KEYDOWN, key=code))
        pass_time(seconds)
        desk.handle(pg.event.Event(pg.KEYUP, key=code))

    def pass_time(seconds: float) -> None:
        for _ in range(round(seconds / 0.1)):
            desk.tick(0.1)
            desk.scene()  # which remembers the trail

    def click(place: tuple[float, float]) -> None:
        at = desk.view.pixel(place, desk.map_size)
        for event in (pg.MOUSEBUTTONDOWN, pg.MOUSEBUTTONUP):
            desk.handle(pg.event.Event(event, button=1, pos=at))

    frame.frame(desk, 0.0)
    desk.scale *= 1.15
    key("UP", 4.0)
    key("LEFT", 1.0)
    key("RIGHT", 0.4)
    pass_time(9.6)
    north, east = desk.show.here
    for ahead in ((150.0, 140.0), (100.0, 180.0), (40.0, 220.0)):
        click((north + ahead[0], east + ahead[1]))
    click(next(thing.position for thing in desk.show.things() if thing.id == "support_vessel"))
    frame.draw(desk)
    save_png(pg.surfarray.array3d(frame.screen).swapaxes(0, 1), IMAGES / "window.png")
    frame.close()


def replay_3d() -> None:
    """The busy open sea in the browser."""
    _page(sailed("busy_open_sea", "avoid", 0), "replay_3d", "t=95&camera=free", yaw=133.0, pitch=14.0, distance=52.0)


def near_shore_3d() -> None:
    """The shore in the browser."""
    _page(sailed("near_shore", "avoid", 2), "near_shore_3d", "t=330&camera=free", yaw=42.0, pitch=24.0, distance=330.0)


def _page(episode: Any, name: str, start: str, **view: float) -> None:
    from browser import Browser

    from usv_gym.replay.archive import replacing
    from usv_gym.replay.html import write_replay

    with TemporaryDirectory() as directory, Browser(*PAGE) as browser:
        path = Path(directory) / "replay.html"
        write_replay(episode, path)
        browser.open(f"{path.as_uri()}#{start}", "!!window.replay?.rig.views && window.replay.plots?.length > 0")
        browser.run(f"Object.assign(replay.rig.view, {dict(view)}), replay.dirty = true")
        picture = browser.screenshot()
    with replacing(IMAGES / f"{name}.png") as file:
        file.write(picture)


def _cli(*arguments: str) -> None:
    from typer.testing import CliRunner

    from usv_gym.cli.app import app

    result = CliRunner().invoke(app, arguments)
    if result.exit_code:
        raise SystemExit(result.output)


PICTURES: dict[str, Callable[[], None]] = {
    f.__name__: f
    for f in (map_dark, map_night, near_shore, real_traffic, show_encounter, show_imazu_13, encounter, window, replay_3d,
              near_shore_3d)
}


def main() -> None:
    """Draw those that are named, or all."""
    wanted = sys.argv[1:] or list(PICTURES)
    if unknown := [name for name in wanted if name not in PICTURES]:
        raise SystemExit(f"no such picture: {', '.join(unknown)}; there are {', '.join(PICTURES)}")
    for name in wanted:
        PICTURES[name]()
        file = next(IMAGES.glob(f"{name}.*"))
        print(f"{file.name}: {file.stat().st_size / 1e6:.2f} MB", flush=True)


if __name__ == "__main__":
    main()
