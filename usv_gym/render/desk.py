"""Everything a user can do in the live window: pygame events in, commands to the world and a scene to draw out.

No display is needed here: a test hands in events and looks at what became of the world.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from ..config import ConfigError
from ..scenarios.commands import Commands
from ..scenarios.schema import OWN_SHIP
from . import keys
from .canvas import load_pygame
from .helm import Helm
from .palette import PALETTES
from .panel import clock
from .primitives import Circle, Label, Points, Polyline, Primitive, Scene
from .pygame_view import View, map_size, save_png

SPEEDS = (0.25, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0)  #: times real time
SCALES = (0.01, 20.0)  #: [px/m] furthest and nearest zoom
HALF_WIDTH = 450.0  #: [m] from the middle to the edge of the map at first
BAR = 34.0  #: [px] height of the bar below the picture
NEAR_PX, SLACK_PX = 12.0, 4.0  #: a click this near means the object; the mouse may move this much in a click
MESSAGE_SECONDS = 5.0
SCRUB_SECONDS = 5.0
#: what a mark becomes: kind and radius [m]; a ship sails through the marks, and its number is half its length
BRUSHES: Mapping[str, float] = {"iceberg": 15.0, "islet": 40.0, "buoy": 2.0, "platform": 20.0, "ship": 25.0}


@dataclass(frozen=True)
class Thing:
    """Something that can be pointed at."""

    source: int
    id: str
    position: tuple[float, float]
    clearance: float  # [m] from its middle
    text: str = ""


class Show(Protocol):
    """What the window shows: a running world, or a recording."""

    name: str
    #: commands to the running world; None: a recording
    commands: Commands | None
    #: whether the user drives
    manual: bool
    #: first and last time of a recording
    span: tuple[float, float] | None

    @property
    def t(self) -> float:
        """Time that is shown [s]."""

    @property
    def ended(self) -> str:
        """Why there is no more to come; empty while there is."""

    @property
    def here(self) -> tuple[float, float]:
        """Where the own ship is shown [m]."""

    def advance(self, seconds: float, demand: tuple[float, float]) -> None:
        """Let simulated time pass."""

    def step(self, demand: tuple[float, float]) -> None:
        """One control step, or one sample."""

    def seek(self, t: float) -> None:
        """Go to a time of a recording."""

    def restart(self) -> None:
        """Begin anew."""

    def things(self) -> Sequence[Thing]:
        """What can be pointed at, as it is shown."""

    def touched(self, source: int) -> None:
        """An object was spawned or moved: do not glide there."""

    def news(self) -> Sequence[str]:
        """What happened since the last call."""

    def scene(self, half_width: float, extra: Mapping[str, Sequence[Primitive]]) -> Scene:
        """The picture, with more primitives by layer."""


@dataclass
class _Press:
    """The left button is down: since where, on what, and where the mouse is now [px]."""

    start: tuple[float, float]
    thing: Thing | None
    now: tuple[float, float]
    moved: bool = False
    slider: bool = False


@dataclass
class Desk:
    """State of the window, and what events do to it.

    Parameters
    ----------
    show
        what is shown.
    size
        of the window [px].
    palette
        "day", "dark" or "night".
    pictures
        directory of saved pictures.
    """

    show: Show
    size: tuple[float, float] = (1280.0, 800.0)
    palette: str = "day"
    pictures: Path = field(default_factory=Path)
    speed: float = 1.0
    paused: bool = False
    follow: bool = True
    help: bool = False
    done: bool = False
    brush: str = "iceberg"
    marks: list[tuple[float, float]] = field(default_factory=list)  # [m]
    selected: int = -1  # source
    message: str = ""

    def __post_init__(self) -> None:
        """Look at the own ship."""
        self.pg = load_pygame()
        self.helm = Helm()
        self.radius = dict(BRUSHES)
        self.scale = 0.5 * min(self.map_size) / HALF_WIDTH
        self.centre = self.show.here
        self._press: _Press | None = None
        self._left = 0.0  # [s] for which the message stays
        self._actions = keys.actions(live=self.show.commands is not None)

    # --- what the window asks for ------------------------------------------------------------------------------------
    def help_text(self) -> list[tuple[str, str]]:
        """What to press and what it does."""
        return keys.help_text(live=self.show.commands is not None, manual=self.show.manual)

    @property
    def map_size(self) -> tuple[float, float]:
        """Width and height of the map [px]."""
        return map_size((self.size[0], max(self.size[1] - BAR, 1.0)))

    @property
    def view(self) -> View:
        """Part of the sea that is shown."""
        return View(*(self.show.here if self.follow else self.centre), self.scale)

    def scene(self) -> Scene:
        """What to draw, marks and selection included."""
        half_width = 0.5 * min(self.map_size) / self.scale
        return self.show.scene(half_width, {"symbols": self._symbols(), "labels": self._labels()})

    def slider(self) -> tuple[float, float] | None:
        """Left and right end of the time slider in the bar [px]; None without one."""
        return (150.0, max(self.size[0] - 330.0, 200.0)) if self.show.span else None

    def state(self) -> str:
        """How time passes."""
        if self.show.ended:
            return self.show.ended
        return "paused" if self.paused else f"x{self.speed:g}"

    def hint(self) -> str:
        """What is selected, or what a click would do."""
        thing = self._thing()
        if thing is not None:
            return f"{thing.id}  {thing.text}".rstrip()
        if self.show.commands is None:
            return ""
        radius = self.radius[self.brush]
        size = f"{2.0 * radius:g} m long" if self.brush == "ship" else f"r = {radius:g} m"
        marked = f", {len(self.marks)} marked" if self.marks else ""
        return f"{self.brush} {size}{marked}"

    # --- time --------------------------------------------------------------------------------------------------------
    def tick(self, seconds: float) -> None:
        """Real time has passed."""
        self.helm.tick(seconds)
        if not self.paused:
            self.show.advance(seconds * self.speed, self._demand())
        self._left -= seconds
        if self._left <= 0.0:
            self.message = ""
        for text in self.show.news():
            self.say(text)

    def say(self, text: str) -> None:
        """Show a message for a while."""
        self.message, self._left = text, MESSAGE_SECONDS

    def _demand(self) -> tuple[float, float]:
        return self.helm.throttle, self.helm.yaw

    # --- events ------------------------------------------------------------------------------------------------------
    def handle(self, event: Any) -> None:
        """React to one event; positions in px of the window."""
        pg = self.pg
        if event.type == pg.QUIT:
            self.done = True
        elif event.type in (pg.VIDEORESIZE, pg.WINDOWSIZECHANGED):
            self.size = (event.w, event.h) if event.type == pg.VIDEORESIZE else (event.x, event.y)
        elif self.show.manual and self.helm.handle(event):
            pass
        elif event.type == pg.KEYDOWN and event.key in self._actions:
            self._try(self._actions[event.key])
        elif event.type == pg.MOUSEBUTTONDOWN and event.button == 1:
            self._pressed(event.pos)
        elif event.type == pg.MOUSEBUTTONDOWN and event.button == 3 and self._on_map(event.pos):
            self._try("spawn_at", self.view.place(event.pos, self.map_size))
        elif event.type == pg.MOUSEMOTION and self._press is not None:
            self._dragged(event.pos)
        elif event.type == pg.MOUSEBUTTONUP and event.button == 1 and self._press is not None:
            self._released()
        elif event.type == pg.MOUSEWHEEL and event.y:
            self._zoom(1.2**event.y, getattr(event, "pos", None))

    def _try(self, action: str, *arguments: Any) -> None:
        """Call a method; what the world refuses becomes a message."""
        try:
            getattr(self, action)(*arguments)
        except (ConfigError, OSError) as error:
            self.say(str(error))

    def _on_map(self, at: tuple[float, float]) -> bool:
        width, height = self.map_size
        return at[0] < width and at[1] < height

    def _pressed(self, at: tuple[float, float]) -> None:
        if self.help:
            self.help = False
        elif self._on_map(at):
            self._press = _Press(at, self._at(at), at)
        elif self.slider() and at[1] >= self.size[1] - BAR:
            self._press = _Press(at, None, at, slider=True)
            self._dragged(at)

    def _dragged(self, at: tuple[float, float]) -> None:
        press = self._press
        assert press is not None
        dx, dy = at[0] - press.now[0], at[1] - press.now[1]
        slider = self.slider()
        if press.slider and slider and self.show.span:
            share = min(max((at[0] - slider[0]) / (slider[1] - slider[0]), 0.0), 1.0)
            self.show.seek(self.show.span[0] + share * (self.show.span[1] - self.show.span[0]))
            return
        if not press.moved and math.dist(at, press.start) <= SLACK_PX:
            return
        press.moved, press.now = True, at
        if press.thing is None or not self._movable(press.thing):
            view = self.view
            self.follow = False
            self.centre = (view.north + dy / view.scale, view.east - dx / view.scale)

    def _released(self) -> None:
        press, self._press = self._press, None
        assert press is not None
        if press.slider:
            return
        if press.moved:
            if press.thing is not None and self._movable(press.thing):
                self._try("move", press.thing, self.view.place(press.now, self.map_size))
        elif press.thing is not None:
            self.selected = press.thing.source
        else:
            self.selected = -1
            if self.show.commands is not None:
                self.marks.append(self.view.place(press.start, self.map_size))

    def _movable(self, thing: Thing) -> bool:
        return self.show.commands is not None and thing.id != OWN_SHIP

    def _at(self, at: tuple[float, float]) -> Thing | None:
        """The thing under the mouse: the one whose middle is nearest."""
        view, size, best = self.view, self.map_size, None
        for thing in self.show.things():
            d = math.dist(view.pixel(thing.position, size), at)
            if d <= max(thing.clearance * view.scale, NEAR_PX) and (best is None or d < best[0]):
                best = (d, thing)
        return best[1] if best else None

    def _thing(self) -> Thing | None:
        return next((thing for thing in self.show.things() if thing.source == self.selected), None)

    def _zoom(self, factor: float, at: tuple[float, float] | None = None) -> None:
        """About the mouse, or about the middle of what is followed."""
        scale = min(max(self.scale * factor, SCALES[0]), SCALES[1])
        if at is not None and not self.follow and self._on_map(at):
            north, east = self.view.place(at, self.map_size)
            k = self.scale / scale
            self.centre = (north + k * (self.centre[0] - north), east + k * (self.centre[1] - east))
        self.scale = scale

    # --- actions: keys -----------------------------------------------------------------------------------------------
    def pause(self) -> None:
        """Stop time, or let it go on."""
        self.paused = not self.paused

    def single_step(self) -> None:
        """Stop time and do one step."""
        self.paused = True
        self.show.step(self._demand())

    def faster(self) -> None:
        """Next speed."""
        self.speed = next((s for s in SPEEDS if s > self.speed), SPEEDS[-1])

    def slower(self) -> None:
        """Speed before."""
        self.speed = next((s for s in reversed(SPEEDS) if s < self.speed), SPEEDS[0])

    def restart(self) -> None:
        """Begin anew."""
        self.show.restart()
        self.marks.clear()
        self.selected = -1

    def follow_own(self) -> None:
        """Keep the own ship in the middle, or let it sail away."""
        self.centre, self.follow = (self.view.north, self.view.east), not self.follow

    def zoom_in(self) -> None:
        """Nearer."""
        self._zoom(1.25)

    def zoom_out(self) -> None:
        """Further away."""
        self._zoom(0.8)

    def next_palette(self) -> None:
        """Day, dark, night."""
        self.palette = PALETTES[(PALETTES.index(self.palette) + 1) % len(PALETTES)]

    def screenshot(self) -> None:
        """Save what is shown, without the bar."""
        t = round(self.show.t)
        stem = f"{self.show.name or 'map'}-{t // 60:02d}m{t % 60:02d}s"
        paths = (self.pictures / f"{stem}{f'-{k}' if k else ''}.png" for k in range(1000))
        path = next(path for path in paths if not path.exists())
        size = (round(self.size[0]), max(round(self.size[1] - BAR), 1))
        save_png(self.scene(), path, size=size, palette=self.palette, view=self.view)
        self.say(f"saved {path}")

    def toggle_help(self) -> None:
        """Show the keys, or hide them."""
        self.help = not self.help

    def escape(self) -> None:
        """Close the help; else drop marks and selection."""
        if self.help:
            self.help = False
        else:
            self.marks.clear()
            self.selected = -1

    def quit(self) -> None:
        """Close the window."""
        self.done = True

    # --- actions: a recording ----------------------------------------------------------------------------------------
    def back(self) -> None:
        """A little back."""
        self.show.seek(self.show.t - SCRUB_SECONDS)

    def forward(self) -> None:
        """A little on."""
        self.show.seek(self.show.t + SCRUB_SECONDS)

    def to_start(self) -> None:
        """To the first sample."""
        self.show.seek(-math.inf)

    def to_end(self) -> None:
        """To the last sample."""
        self.show.seek(math.inf)

    # --- actions: the running world ----------------------------------------------------------------------------------
    @property
    def _commands(self) -> Commands:
        if self.show.commands is None:
            raise ConfigError("a recording cannot be changed")
        return self.show.commands

    def next_brush(self) -> None:
        """What marks become."""
        kinds = list(BRUSHES)
        self.brush = kinds[(kinds.index(self.brush) + 1) % len(kinds)]

    def smaller(self) -> None:
        """Smaller by a quarter."""
        self.radius[self.brush] = max(float(f"{self.radius[self.brush] / 1.25:.2g}"), 0.5)

    def larger(self) -> None:
        """Larger by a quarter."""
        self.radius[self.brush] = min(float(f"{self.radius[self.brush] * 1.25:.2g}"), 300.0)

    def spawn_marks(self) -> None:
        """Put an object at every mark, or one ship that sails through them."""
        if not self.marks:
            raise ConfigError("nothing is marked: click the sea first")
        if self.brush == "ship":
            if len(self.marks) < 2:
                raise ConfigError("mark where the ship starts and where it goes")
            length = 2.0 * self.radius["ship"]
            self._spawn({"length": length, "waypoints": [list(m) for m in self.marks], "after_last": "continue"})
            self.marks.clear()
            return
        while self.marks:  # what is spawned is no longer marked, even if the next one finds no room
            self._spawn({"kind": self.brush, "radius": self.radius[self.brush], "position": list(self.marks[0])})
            self.marks.pop(0)

    def spawn_at(self, place: tuple[float, float]) -> None:
        """Put an object at a place at once."""
        if self.brush == "ship":
            raise ConfigError("a ship needs two marks or more, then Enter")
        self._spawn({"kind": self.brush, "radius": self.radius[self.brush], "position": list(place)})

    def _spawn(self, spec: Mapping[str, Any]) -> None:
        commands = self._commands
        id = next(name for name in (f"{self.brush}_{k}" for k in range(1, 10_000)) if name not in commands.names)
        self.show.touched(commands.spawn(id, spec))

    def move(self, thing: Thing, place: tuple[float, float]) -> None:
        """Put an object elsewhere."""
        self._commands.move(thing.id, *place)
        self.show.touched(thing.source)

    def delete(self) -> None:
        """Take the selected object out of the world."""
        self._commands.delete(self._chosen().id)
        self.selected = -1

    def switch_ais(self) -> None:
        """Switch the transmitter of the selected object."""
        thing = self._chosen()
        self._commands.set_ais(thing.id, "AIS on" not in thing.text)

    def _chosen(self) -> Thing:
        thing = self._thing()
        if thing is None:
            raise ConfigError("nothing is selected: click an object first")
        return thing

    # --- what is drawn over the scene --------------------------------------------------------------------------------
    def _symbols(self) -> list[Primitive]:
        out: list[Primitive] = []
        radius = self.radius[self.brush]
        arm = max(radius, 12.0 / self.scale)
        if self.brush == "ship":
            radius = 0.0
            if len(self.marks) > 1:
                out.append(Polyline(np.array(self.marks), "mark_route", arrow=True))
        for north, east in self.marks:
            out.append(Circle((north, east), radius, "mark", 12.0))
            out += [Polyline(_line(north, east, dn * arm, de * arm), "mark") for dn, de in ((1.3, 0.0), (0.0, 1.3))]
        thing = self._thing()
        if thing is not None:
            out.append(Circle(thing.position, thing.clearance, "selected", 36.0))
        press = self._press
        if press is not None and press.moved and press.thing is not None and self._movable(press.thing):
            ghost = self.view.place(press.now, self.map_size)
            out += [
                Circle(ghost, press.thing.clearance, "mark", 12.0),
                Polyline(np.array([press.thing.position, ghost]), "mark_route", arrow=True),
            ]
        return out

    def _labels(self) -> list[Primitive]:
        if not self.marks:
            return []
        what = "route of a ship" if self.brush == "ship" else f"{self.brush} r = {self.radius[self.brush]:g} m"
        clearance = 0.0 if self.brush == "ship" else self.radius[self.brush]
        return [Label((what, "Enter spawns"), self.marks[-1], "label_cpa", clearance, 8.0)]

    def time_text(self) -> str:
        """Time shown, and of a recording how long it is."""
        now = clock(self.show.t - (self.show.span[0] if self.show.span else 0.0))
        return f"{now} / {clock(self.show.span[1] - self.show.span[0])}" if self.show.span else now


def _line(north: float, east: float, dn: float, de: float) -> Points:
    return np.array([(north - dn, east - de), (north + dn, east + de)])
