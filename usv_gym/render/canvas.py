"""A pygame surface that draws smoothly: shapes at several times the size, text at its own.  No display needed."""

from __future__ import annotations

import functools
import math
import os
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from gymnasium.error import DependencyNotInstalled

from .palette import STYLES, Style
from .primitives import Points
from .trace import AREA, BEADS, DOTS, LINE, SPOTS, average, blend, flood, trace

RGBA = tuple[int, int, int, int]
FINE = 3  #: text is written this many times as large and made smaller
APART = "  "  #: between words that are written, and kept for the next picture, each on its own: numbers that change


@functools.cache
def load_pygame() -> Any:
    """Import pygame and start its fonts.

    Raises
    ------
    DependencyNotInstalled
        if it is not installed.
    """
    os.environ.setdefault("PYGAME_HIDE_SUPPORT_PROMPT", "1")  # no banner on standard output
    try:
        import pygame
        import pygame.font
        import pygame.gfxdraw
    except ImportError as error:
        raise DependencyNotInstalled("pygame is needed to draw the map: pip install pygame-ce") from error
    pygame.font.init()
    return pygame


@functools.cache
def rgba(colour: str) -> RGBA | None:
    """``#rrggbb`` or ``#rrggbbaa`` as numbers, None for an empty text."""
    if not colour:
        return None
    digits = colour.removeprefix("#").ljust(8, "f")
    return int(digits[0:2], 16), int(digits[2:4], 16), int(digits[4:6], 16), int(digits[6:8], 16)


@functools.cache
def font(size: int) -> Any:
    """The font that comes with pygame, so that pictures look the same on every machine."""
    pg = load_pygame().font
    return pg.Font(pg.get_default_font(), size)


@functools.lru_cache(maxsize=2048)
def text_surface(text: str, size: int, colour: str, halo: str = "") -> Any:
    """Rendered text, with an outline of one pixel in the colour ``halo``."""
    pg = load_pygame()
    # it is written large and made smaller, for small letters have room for whole pixels only between them
    large = font(size * FINE).render(text, True, rgba(colour)[:3])  # type: ignore[index]
    front = pg.transform.smoothscale(large, text_size(text, size))
    if not halo:
        return front
    back = front.copy()
    back.fill((0, 0, 0, 255), special_flags=pg.BLEND_RGBA_MULT)
    back.fill((*rgba(halo)[:3], 0), special_flags=pg.BLEND_RGBA_ADD)  # type: ignore[index]
    out = pg.Surface((front.get_width() + 2, front.get_height() + 2), pg.SRCALPHA)
    for dx, dy in ((0, 0), (2, 0), (0, 2), (2, 2), (1, 0), (0, 1), (2, 1), (1, 2)):
        out.blit(back, (dx, dy))
    out.blit(front, (1, 1))
    return out


@functools.lru_cache(maxsize=4096)
def text_size(text: str, size: int) -> tuple[int, int]:
    """Width and height of a text [px]."""
    parts = text.split(APART)
    width, height = font(size * FINE).size(parts[0])
    more = sum(text_size(part, size)[0] + apart(size) for part in parts[1:])
    return max(math.ceil(width / FINE), 1) + more, math.ceil(height / FINE)


def apart(size: int) -> int:
    """Room [px] between words that stand apart."""
    return round(0.56 * size)


def fitting(text: str, room: float, size: int) -> str:
    """Text, shortened when it would be wider than ``room`` [px]."""
    if text_size(text, size)[0] <= room:
        return text
    while text and text_size(text + "…", size)[0] > room:
        text = text[:-1]
    return text + "…" if text else ""


class Look(NamedTuple):
    """How a role is drawn in a palette; None is not drawn."""

    style: Style
    fill: RGBA | None
    tint: RGBA | None  # the opaque colour of the area over the bare sea
    line: RGBA | None  # opaque too: thin decoration needs no true blending


@functools.cache
def look(role: str, palette: str) -> Look:
    """Style and colours of a role."""
    style = STYLES[role]
    fill, line, sea = (rgba(c) for c in (style.fill(palette), style.line(palette), STYLES["sea"].fill(palette)))
    return Look(style, fill, _over(fill, sea), _over(line, sea))


def _over(colour: RGBA | None, ground: RGBA | None) -> RGBA | None:
    """Opaque colour of a translucent one on a ground."""
    if colour is None or ground is None:
        return colour
    k = colour[3] / 255.0
    r, g, b = (round(k * c + (1.0 - k) * s) for c, s in zip(colour[:3], ground[:3], strict=True))
    return r, g, b, 255


@functools.cache
def _unit_circle(n: int) -> Points:
    b = np.linspace(0.0, 2.0 * math.pi, n, endpoint=False)
    return np.column_stack((np.cos(b), np.sin(b)))


_SPARE: list[Any] = []  # the last large surface: fresh memory costs more than a scene's shapes
KEPT = 16_000_000  #: pixels; one larger is not kept


def _spare(pg: Any, size: tuple[int, int]) -> Any:
    """A surface of 32 bits with anything on it."""
    try:
        large = _SPARE.pop()  # nobody else has it now
    except IndexError:
        large = None
    return large if large is not None and large.get_size() == size else pg.Surface(size, 0, 32)


class _Shape(NamedTuple):
    """Something to draw: its points as `trace` takes them, and what is done with the corners that come of them."""

    kind: int
    points: Points  # [n, 2] px
    fill: RGBA | None = None
    line: RGBA | None = None
    width: int = 1  # of the line [pixels]
    on: float = 0.0
    off: float = 0.0
    arrow: bool = False
    radius: float = 0.0  # of discs or of a ring [pixels]
    joints: bool = True  # whether bends are filled
    together: int = 1  # shapes filled at once, of which this is the first; 0: a further one


class Canvas:
    """A picture in the making.  Coordinates are px of 1/96 inch, which are pixels unless ``ratio`` says otherwise.

    Shapes are only remembered; `finish` prepares them in one pass and draws them in their order, then the texts.

    Parameters
    ----------
    pixels
        width and height of the result.
    palette
        name of a palette.
    supersample
        shapes are drawn this many times as large and averaged.
    ratio
        pixels per px: 2 on a screen of high density.
    ground
        role whose colour fills it.
    """

    def __init__(
        self, pixels: tuple[int, int], palette: str, supersample: int = 2, ratio: float = 1.0, ground: str = "panel"
    ) -> None:
        """Blank picture."""
        self.ground = look(ground, palette).fill
        self.pixels, self.ratio, self.palette, self.supersample = pixels, ratio, palette, supersample
        self.ss = supersample * ratio
        self.size = size = (pixels[0] / ratio, pixels[1] / ratio)  # [px]
        self.frame = -20.0, -20.0, size[0] + 20.0, size[1] + 20.0  # what lies outside is out of sight
        self.pg = load_pygame()
        self._shapes: list[_Shape] = []
        self._text: list[tuple[Any, tuple[int, int]]] = []

    # --- shapes ------------------------------------------------------------------------------------------------------
    def box(self, box: Sequence[float], role: str, radius: float = 0.0) -> None:
        """Rectangle left, top, right, bottom with rounded corners."""
        x0, y0, x1, y1 = box
        self.polygon(_rounded(x0, y0, x1, y1, radius), role)

    def polygon(self, points: Points, role: str) -> None:
        """Filled outline [n, 2]."""
        style, fill, _, line = look(role, self.palette)
        dashed = line is not None and style.dash is not None
        if fill is not None or not dashed:
            self._shapes.append(_Shape(AREA, points, fill, None if dashed else line, self._width(style)))
        if dashed:
            self.polyline(np.concatenate((points, points[:1])), role)

    def area(self, shell: Points, holes: Sequence[Points], role: str, hole_role: str) -> None:
        """A large outline with holes in it."""
        style, fill, _, line = look(role, self.palette)
        hole = look(hole_role, self.palette).fill
        for ring, colour in ((shell, fill), *((ring, hole) for ring in holes)):
            self._shapes.append(_Shape(AREA, ring, colour, line, self._width(style), joints=False))

    def fringe(self, rings: Sequence[Points], width: float, role: str) -> None:
        """What lies within ``width`` of closed outlines: discs along them, near enough to look like one band."""
        if width >= 1.0:
            self._flood([_Shape(BEADS, r, on=0.15 * width, off=width, radius=width * self.ss) for r in rings], role)

    def tint(self, outlines: Sequence[Points], role: str) -> None:
        """Fill outlines as if their translucent colour lay on the bare sea: where two overlap it is no darker."""
        self._flood([_Shape(AREA, outline) for outline in outlines], role)

    def _flood(self, shapes: list[_Shape], role: str) -> None:
        """Shapes to be filled together."""
        colour = look(role, self.palette).tint
        if shapes and colour is not None:
            self._shapes.append(shapes[0]._replace(fill=colour, together=len(shapes)))
            self._shapes += [shape._replace(together=0) for shape in shapes[1:]]

    def polyline(self, points: Points, role: str, arrow: bool = False) -> None:
        """Line through points [n, 2]."""
        style, _, _, line = look(role, self.palette)
        if line is not None and len(points) > 1:
            on, off = style.dash or (0.0, 0.0)
            self._shapes.append(_Shape(LINE, points, None, line, self._width(style), on, off, arrow))

    def circle(self, centre: Sequence[float], radius: float, role: str) -> None:
        """Disc or ring."""
        style, fill, _, line = look(role, self.palette)
        if fill is None and style.dash is None:
            outer = (radius + 0.5 * style.width) * self.ss
            self._shapes.append(_Shape(SPOTS, np.array([centre]), None, line, self._width(style), radius=outer))
        else:
            n = min(max(int(0.8 * radius), 24), 360)
            self.polygon(radius * _unit_circle(n) + centre, role)

    def dots(self, points: Points, role: str, px: float) -> None:
        """Small discs."""
        _, fill, _, line = look(role, self.palette)
        self._shapes.append(_Shape(DOTS, points, fill or line, radius=max(round(0.5 * px * self.ss), 1)))

    # --- text --------------------------------------------------------------------------------------------------------
    def text(
        self,
        text: str,
        at: tuple[float, float],
        role: str = "text",
        size: int = 13,
        align: float = 0.0,
        halo: bool = False,
    ) -> None:
        """Text with its top left at ``at``; align 0.5 centres it, 1 ends it there.  The halo is in the area colour."""
        style, points = STYLES[role], round(size * self.ratio)
        edge = 1 if halo else 0
        x = at[0] * self.ratio - (align * text_size(text, points)[0] if align else 0.0) - edge
        top = round(at[1] * self.ratio) - edge
        for word in text.split(APART):
            if word.strip():  # a blank cannot be made smaller
                fill = style.fill(self.palette) if halo else ""
                image = text_surface(word, points, style.line(self.palette), fill)
                self._text.append((image, (round(x), top)))
            x += text_size(word, points)[0] + apart(points)

    # --- drawing -----------------------------------------------------------------------------------------------------
    def finish(self) -> Any:
        """The picture as a surface of 32 bits."""
        pg, (width, height), times = self.pg, self.pixels, self.supersample
        out = pg.Surface(self.pixels, 0, 32)
        large = out if times == 1 else _spare(pg, (width * times, height * times))
        large.fill(self.ground)
        if self._shapes:
            self._draw(large)
        if times > 1:
            average(pg.surfarray.pixels2d(large).T, times, pg.surfarray.pixels2d(out).T)
            _SPARE[:] = [large][: width * height * times * times <= KEPT]
        out.blits(self._text, doreturn=False)
        return out

    def _width(self, style: Style) -> int:
        return max(round(style.width * self.ss), 1)

    def _draw(self, surface: Any) -> None:
        shapes = self._shapes
        first = np.cumsum([0, *(len(s.points) for s in shapes)])
        jointed = [s.joints and s.width > 2 and s.line is not None for s in shapes]
        kind, arrow = np.array([s.kind for s in shapes]), np.array([s.arrow for s in shapes])
        on, off = np.array([s.on for s in shapes]), np.array([s.off for s in shapes])
        points = np.concatenate([s.points for s in shapes])
        corners, start, joints, joint_start = trace(
            points, first, kind, arrow, np.array(jointed), on, off, self.frame, self.ss
        )
        places, begin, bends, bend = corners.tolist(), start.tolist(), joints.tolist(), joint_start.tolist()
        pixels = self.pg.surfarray.pixels2d(surface).T
        for k, shape in enumerate(shapes):
            path = places[begin[k] : begin[k + 1]]
            if shape.together != 1:
                if shape.together:
                    flood(pixels, corners, start[k : k + shape.together + 1], shape.radius, _number(shape.fill))
            elif not path:
                continue
            elif shape.kind == AREA:
                if shape.fill is not None and shape.fill[3] < 255:
                    outline = corners[begin[k] : begin[k + 1]]
                    blend(pixels, outline, _number(shape.fill), round(shape.fill[3] * 256 / 255))
                self._area(surface, shape, path)
            elif shape.kind == LINE:
                self._line(surface, shape, path)
            else:
                self._discs(surface, shape, path)
            for j in bends[bend[k] : bend[k + 1]]:  # fill the notch on the outside of bends
                self.pg.draw.circle(surface, shape.line, places[j], 0.5 * shape.width)

    def _area(self, surface: Any, shape: _Shape, path: list[list[int]]) -> None:
        if len(path) < 3:
            return
        if shape.fill is not None and shape.fill[3] == 255:
            self.pg.draw.polygon(surface, shape.fill, path)
        if shape.line is not None:
            self.pg.draw.lines(surface, shape.line, True, path, shape.width)

    def _line(self, surface: Any, shape: _Shape, path: list[list[int]]) -> None:
        if shape.arrow:
            self.pg.draw.polygon(surface, shape.line, path[:3])
            path = path[3:]
        if shape.on == 0.0:
            self.pg.draw.lines(surface, shape.line, False, path, shape.width)
            return
        line, colour, width = self.pg.draw.line, shape.line, shape.width
        for begin, end in zip(path[::2], path[1::2], strict=True):
            line(surface, colour, begin, end, width)

    def _discs(self, surface: Any, shape: _Shape, path: list[list[int]]) -> None:
        """Discs, or a ring."""
        colour, ring = shape.fill or shape.line, shape.fill is None
        if colour is None:
            return
        for at in path:
            if colour[3] < 255:
                self.pg.gfxdraw.filled_circle(surface, *at, int(shape.radius), colour)
            else:
                self.pg.draw.circle(surface, colour, at, shape.radius, shape.width if ring else 0)


def _number(colour: RGBA | None) -> np.uint32:
    """A colour as the pixels of a surface have it."""
    assert colour is not None
    return np.uint32(colour[0] << 16 | colour[1] << 8 | colour[2])


def _rounded(x0: float, y0: float, x1: float, y1: float, r: float) -> Points:
    """Outline of a rectangle with rounded corners."""
    if r <= 0.0:
        return np.array([(x0, y0), (x1, y0), (x1, y1), (x0, y1)])
    return r * _CORNERS[0] + np.where(_CORNERS[1] > 0.0, (x1 - r, y1 - r), (x0 + r, y0 + r))


def _corners() -> tuple[Points, Points]:
    """Of the unit rectangle with rounded corners: points around the centres of the corners, and on which side those are."""
    b = np.linspace(0.0, 0.5 * math.pi, 6)
    angle = np.concatenate([b + q * math.pi for q in (0.0, 0.5, 1.0, 1.5)])
    side = np.repeat(((1.0, 1.0), (-1.0, 1.0), (-1.0, -1.0), (1.0, -1.0)), 6, axis=0)
    return np.column_stack((np.cos(angle), np.sin(angle))), side


_CORNERS = _corners()
