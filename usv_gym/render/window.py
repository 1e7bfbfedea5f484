"""The live window: draws a desk at the pace of the screen, and shows an environment's frames in render mode "human"."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..config import ConfigError
from .canvas import Canvas, fitting, load_pygame, text_size
from .desk import BAR, Desk
from .primitives import Scene
from .pygame_view import draw

FPS = 30  #: frames per second at most
SIZE = (1280, 834)  #: [px] of a new window
DENSE = 1800  #: [pixels] a screen at least this high is taken for one of high density


class Window:
    """A window on the screen.

    Parameters
    ----------
    title
        text of its frame.
    size
        width and height [px]; less if the screen is smaller.
    ratio
        pixels per px; None: 2 on a screen of high density, else 1.

    Raises
    ------
    ConfigError
        if there is no screen.
    DependencyNotInstalled
        if pygame-ce is not installed.
    """

    def __init__(self, title: str = "usv_gym", size: tuple[int, int] = SIZE, ratio: float | None = None) -> None:
        """Open it."""
        self.pg = pg = load_pygame()
        try:
            pg.display.init()
            width, height = pg.display.get_desktop_sizes()[0]
            self.ratio = ratio or (2.0 if height >= DENSE else 1.0)
            fitting = (min(round(size[0] * self.ratio), width), min(round(size[1] * self.ratio), height))
            self.screen = pg.display.set_mode(fitting, pg.RESIZABLE)
        except (pg.error, IndexError) as error:
            raise ConfigError(f"no window can be opened here ({error}); `usv-gym run` and `render` need none") from None
        pg.display.set_caption(title)
        self._clock = pg.time.Clock()
        self._sticks: dict[int, Any] = {}

    @property
    def size(self) -> tuple[float, float]:
        """Width and height [px]."""
        width, height = self.screen.get_size()
        return width / self.ratio, height / self.ratio

    def close(self) -> None:
        """Close it."""
        self.pg.display.quit()

    # --- a desk ------------------------------------------------------------------------------------------------------
    def run(self, desk: Desk) -> None:
        """Show a desk until the user closes the window."""
        self.pg.joystick.init()
        desk.handle(self._resized())
        self._clock.tick()
        while not desk.done:
            self.frame(desk, self._clock.tick(FPS) / 1000.0)

    def frame(self, desk: Desk, seconds: float) -> None:
        """Hand events on, let time [s] pass, draw."""
        for event in self.events():
            desk.handle(event)
        desk.tick(seconds)
        self.draw(desk)

    def events(self) -> list[Any]:
        """What has happened since the last call, in px."""
        pg, out = self.pg, []
        for event in pg.event.get():
            if event.type == pg.VIDEORESIZE:
                self.screen = pg.display.get_surface()
                event = self._resized()
            elif event.type in (pg.MOUSEBUTTONDOWN, pg.MOUSEBUTTONUP, pg.MOUSEMOTION):
                event = pg.event.Event(event.type, {**event.dict, "pos": self._px(event.pos)})
            elif event.type == pg.MOUSEWHEEL:
                event = pg.event.Event(event.type, {**event.dict, "pos": self._px(pg.mouse.get_pos())})
            elif event.type == pg.JOYDEVICEADDED:
                stick = pg.joystick.Joystick(event.device_index)
                self._sticks[stick.get_instance_id()] = stick
            elif event.type == pg.KEYDOWN and event.key == pg.K_F11:
                pg.display.toggle_fullscreen()
            out.append(event)
        return out

    def draw(self, desk: Desk) -> None:
        """Draw one frame and show it."""
        width, height = self.screen.get_size()
        bar = round(BAR * self.ratio)
        if height > bar:
            picture = draw(desk.scene(), (width, height - bar), desk.palette, desk.view, ratio=self.ratio)
            self.screen.blit(picture, (0, 0))
        self.screen.blit(_bar(desk, (width, bar), self.ratio), (0, height - bar))
        if desk.help:
            plate = _help(desk, self.ratio)
            self.screen.blit(
                plate, ((width - plate.get_width()) // 2, max((height - bar - plate.get_height()) // 2, 0))
            )
        self.pg.display.flip()

    def _resized(self) -> Any:
        width, height = self.size
        return self.pg.event.Event(self.pg.VIDEORESIZE, w=width, h=height)

    def _px(self, at: tuple[int, int]) -> tuple[float, float]:
        return at[0] / self.ratio, at[1] / self.ratio

    # --- an environment ----------------------------------------------------------------------------------------------
    def show(self, scene: Scene, fps: float) -> bool:
        """Show a scene, and wait so that there are at most ``fps`` a second; False once the user has closed the window."""
        if any(event.type == self.pg.QUIT for event in self.events()):
            return False
        self.screen.blit(draw(scene, self.screen.get_size(), ratio=self.ratio), (0, 0))
        self.pg.display.flip()
        self._clock.tick(fps)
        return True


def _bar(desk: Desk, pixels: tuple[int, int], ratio: float) -> Any:
    """The bar below the picture: time and speed, throttle or slider, what is selected, a message."""
    canvas = Canvas(pixels, desk.palette, 2, ratio)
    width, height = canvas.size
    canvas.box((0.0, 0.0, width, height), "panel")
    y, middle = 10.0, 0.5 * height
    if desk.paused or desk.show.ended:
        canvas.box((12.0, middle - 6.0, 16.0, middle + 6.0), "needle")
        canvas.box((19.0, middle - 6.0, 23.0, middle + 6.0), "needle")
    else:
        canvas.polygon(np.array([(12.0, middle - 7.0), (24.0, middle), (12.0, middle + 7.0)]), "needle")
    canvas.text(desk.state(), (32.0, y), "text", 13)
    x = 42.0 + text_size(desk.state(), 13)[0]
    slider = desk.slider()
    if slider is not None and desk.show.span is not None:
        left, right = slider
        first, last = desk.show.span
        knob = left + (desk.show.t - first) / max(last - first, 1e-9) * (right - left)
        canvas.box((left, middle - 2.0, right, middle + 2.0), "panel_grid_fill", 2.0)
        canvas.box((left, middle - 2.0, knob, middle + 2.0), "scale", 2.0)
        canvas.circle((knob, middle), 7.0, "scale")
        x = right + 16.0
        canvas.text(desk.time_text(), (x, y), "text", 13)
        x += 14.0 + text_size(desk.time_text(), 13)[0]
    elif desk.show.manual:
        for caption, value in (("throttle", desk.helm.throttle), ("turn", desk.helm.yaw)):
            canvas.text(caption, (x + 10.0, y + 1.0), "text_muted", 12)
            x += 18.0 + text_size(caption, 12)[0]
            canvas.box((x, middle - 5.0, x + 90.0, middle + 5.0), "panel_grid_fill", 3.0)
            end = x + 45.0 + 45.0 * value
            canvas.box((min(end, x + 44.0), middle - 5.0, max(end, x + 46.0), middle + 5.0), "scale")
            x += 96.0
        x += 10.0
    keys = "H: keys"
    room = width - 14.0 - text_size(keys, 12)[0]
    canvas.text(keys, (room, y + 1.0), "text_muted", 12)
    text, role = (desk.message, "text") if desk.message else (desk.hint(), "text_muted")
    canvas.text(fitting(text, room - x - 16.0, 12), (room - 16.0, y + 1.0), role, 12, 1.0)
    return canvas.finish()


def _help(desk: Desk, ratio: float) -> Any:
    """The plate of keys."""
    rows = desk.help_text()
    half = (len(rows) + 1) // 2
    row, column = 22.0, 312.0
    canvas = Canvas((round(2.0 * column * ratio), round((half * row + 62.0) * ratio)), desk.palette, 2, ratio)
    canvas.box((0.0, 0.0, *canvas.size), "panel")
    canvas.box((8.0, 40.0, canvas.size[0] - 8.0, canvas.size[1] - 8.0), "panel_box", 4.0)
    canvas.text("Keys and mouse", (20.0, 13.0), "text", 16)
    for k, (key, text) in enumerate(rows):
        x, y = 20.0 + column * (k // half), 50.0 + row * (k % half)
        canvas.text(key, (x, y), "label_ring", 12)
        canvas.text(text, (x + 112.0, y), "text", 12)
    return canvas.finish()
