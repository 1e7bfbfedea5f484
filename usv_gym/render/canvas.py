"""A pygame surface that draws smoothly: shapes at several times the size, text at its own.  No display needed."""

from __future__ import annotations

import functools
import math
import os
from collections.abc import Sequence
from typing import Any

import numpy as np
from gymnasium.error import DependencyNotInstalled

from .palette import STYLES, Style
from .primitives import Points

RGBA = tuple[int, int, int, int]
Frame = tuple[float, float, float, float]  # left, top, right, bottom [px]


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
    front = font(size).render(text, True, rgba(colour)[:3])  # type: ignore[index]
    if not halo:
        return front
    back = font(size).render(text, True, rgba(halo)[:3])  # type: ignore[index]
    out = pg.Surface((front.get_width() + 2, front.get_height() + 2), pg.SRCALPHA)
    for dx, dy in ((0, 0), (2, 0), (0, 2), (2, 2), (1, 0), (0, 1), (2, 1), (1, 2)):
        out.blit(back, (dx, dy))
    out.blit(front, (1, 1))
    return out


@functools.lru_cache(maxsize=4096)
def text_size(text: str, size: int) -> tuple[int, int]:
    """Width and height of a text [px]."""
    width, height = font(size).size(text)
    return int(width), int(height)


def fitting(text: str, room: float, size: int) -> str:
    """Text, shortened when it would be wider than ``room`` [px]."""
    if text_size(text, size)[0] <= room:
        return text
    while text and text_size(text + "…", size)[0] > room:
        text = text[:-1]
    return text + "…" if text else ""


@functools.cache
def look(role: str, palette: str) -> tuple[Style, RGBA | None, RGBA | None]:
    """Style, area colour and line colour of a role."""
    style = STYLES[role]
    return style, rgba(style.fill(palette)), rgba(style.line(palette))


@functools.cache
def _unit_circle(n: int) -> Points:
    b = np.linspace(0.0, 2.0 * math.pi, n, endpoint=False)
    return np.column_stack((np.cos(b), np.sin(b)))


@functools.lru_cache(maxsize=64)
def _ring(radius: float, on: float, off: float) -> Points:
    """Dashes [n, 4] x, y, x, y of a circle about (0, 0): rings about the own ship are the same in every frame."""
    n = max(round(2.0 * math.pi * radius / (on + off)), 6)
    a = np.arange(n) * (2.0 * math.pi / n)
    b = a + 2.0 * math.pi / n * on / (on + off)
    return radius * np.column_stack((np.cos(a), np.sin(a), np.cos(b), np.sin(b)))


class Canvas:
    """A picture in the making.  Coordinates are px of 1/96 inch, which are pixels unless ``ratio`` says otherwise.

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
    """

    def __init__(self, pixels: tuple[int, int], palette: str, supersample: int = 2, ratio: float = 1.0) -> None:
        """Blank picture."""
        self.pixels, self.ratio, self.palette, self.ss = pixels, ratio, palette, supersample * ratio
        self.size = size = (pixels[0] / ratio, pixels[1] / ratio)  # [px]
        self.frame = -20.0, -20.0, size[0] + 20.0, size[1] + 20.0  # what lies outside is out of sight
        self.pg = load_pygame()
        self.surface = self.pg.Surface((pixels[0] * supersample, pixels[1] * supersample))
        self._text: list[tuple[Any, tuple[int, int]]] = []

    def style(self, role: str) -> tuple[Style, RGBA | None, RGBA | None]:
        """Style, area colour and line colour of a role."""
        return look(role, self.palette)

    # --- shapes ------------------------------------------------------------------------------------------------------
    def box(self, box: Sequence[float], role: str, radius: float = 0.0) -> None:
        """Rectangle left, top, right, bottom with rounded corners."""
        x0, y0, x1, y1 = box
        self.polygon(_rounded(x0, y0, x1, y1, radius), role)

    def polygon(self, points: Points, role: str) -> None:
        """Filled outline [n, 2]."""
        style, fill, line = self.style(role)
        shape = clip(points, self.frame)  # its new edges lie out of sight
        if len(shape) < 3:
            return
        if fill is not None:
            self._fill(shape, fill)
        if line is not None:
            self._stroke(shape, line, style, closed=True)

    def area(self, shell: Points, holes: Sequence[Points], role: str, hole_role: str) -> None:
        """A large outline with holes in it; corners that fall on the same pixel are drawn once."""
        style, fill, line = self.style(role)
        for ring, colour in ((shell, fill), *((hole, self.style(hole_role)[1]) for hole in holes)):
            corners = (_pixels(clip(ring, self.frame)) * self.ss).tolist()
            if len(corners) < 3:
                continue
            if colour is not None:
                self.pg.draw.polygon(self.surface, colour[:3], corners)
            if line is not None:
                self.pg.draw.lines(self.surface, line[:3], True, corners, self._width(style))

    def fringe(self, ring: Points, width: float, role: str) -> None:
        """What lies within ``width`` of a closed outline: discs along it, near enough to look like one band."""
        fill = self.style(role)[1]
        if fill is None or width < 1.0:
            return
        line = np.vstack((ring, ring[:1]))
        along = np.concatenate(((0.0,), np.hypot(*np.diff(line, axis=0).T).cumsum()))
        at = np.arange(0.0, along[-1], 0.25 * width)[:20000]
        centres = np.column_stack([np.interp(at, along, line[:, k]) for k in range(2)])
        x0, y0, x1, y1 = self.frame
        for x, y in (seen(centres, (x0 - width, y0 - width, x1 + width, y1 + width)) * self.ss).tolist():
            self.pg.draw.circle(self.surface, fill[:3], (x, y), width * self.ss)

    def polyline(self, points: Points, role: str, arrow: bool = False) -> None:
        """Line through points [n, 2]."""
        style, _, line = self.style(role)
        if line is None or len(points) < 2 or _where(points, self.frame) == OUTSIDE:
            return
        if arrow:
            points = self._arrow(points, line)
        self._stroke(points, line, style)

    def circle(self, centre: Sequence[float], radius: float, role: str) -> None:
        """Disc or ring."""
        style, fill, line = self.style(role)
        if fill is None and line is not None and style.dash is None:
            at = (centre[0] * self.ss, centre[1] * self.ss)
            self.pg.draw.circle(self.surface, line[:3], at, (radius + 0.5 * style.width) * self.ss, self._width(style))
            return
        if fill is None and line is not None and style.dash is not None and radius < 5000.0:
            x, y = centre
            ring = _ring(round(radius, 1), *style.dash) + np.array((x, y, x, y))
            self._dashes(seen(ring, self.frame), line, style)
            return
        n = int(np.clip(radius * 0.8, 24, 360))
        self.polygon(radius * _unit_circle(n) + centre, role)

    def dots(self, points: Points, role: str, px: float) -> None:
        """Small discs."""
        _, fill, line = self.style(role)
        colour = fill or line
        if colour is None:
            return
        radius = max(round(0.5 * px * self.ss), 1)
        for x, y in np.rint(seen(points, self.frame) * self.ss).astype(int).tolist():
            if colour[3] < 255:
                self.pg.gfxdraw.filled_circle(self.surface, x, y, radius, colour)
            else:
                self.pg.draw.circle(self.surface, colour[:3], (x, y), radius)

    def tint(self, points: Points, role: str) -> None:
        """Fill an outline as if its translucent colour lay on the bare sea: where two overlap it is no darker."""
        fill = self.style(role)[1]
        shape = clip(points, self.frame)
        if fill is not None and len(shape) > 2:
            self._fill(shape, self._on_sea(fill))

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
        style = STYLES[role]
        edge = 1 if halo else 0
        fill = style.fill(self.palette) if halo else ""
        image = text_surface(text, round(size * self.ratio), style.line(self.palette), fill)
        x = at[0] * self.ratio - align * (image.get_width() - 2 * edge) - edge
        self._text.append((image, (round(x), round(at[1] * self.ratio) - edge)))

    def finish(self) -> Any:
        """The picture as a surface."""
        whole = self.surface.get_size() == self.pixels
        out = self.surface if whole else self.pg.transform.smoothscale(self.surface, self.pixels)
        out.blits(self._text, doreturn=False)
        return out

    # --- the inner drawing -----------------------------------------------------------------------------------------
    def _on_sea(self, colour: RGBA) -> RGBA:
        """Opaque colour of a translucent one over the bare sea."""
        if colour[3] == 255:
            return colour
        sea, k = rgba(STYLES["sea"].fill(self.palette)) or colour, colour[3] / 255.0
        r, g, b = (round(k * c + (1.0 - k) * s) for c, s in zip(colour[:3], sea[:3], strict=True))
        return r, g, b, 255

    def _width(self, style: Style) -> int:
        return max(round(style.width * self.ss), 1)

    def _fill(self, shape: Points, colour: RGBA) -> None:
        corners = np.rint(shape * self.ss).astype(int).tolist()
        if colour[3] < 255:
            self.pg.gfxdraw.filled_polygon(self.surface, corners, colour)
        else:
            self.pg.draw.polygon(self.surface, colour[:3], corners)

    def _stroke(self, points: Points, colour: RGBA, style: Style, closed: bool = False) -> None:
        """Lines of the style's width with round joints."""
        draw, surface, width = self.pg.draw, self.surface, self._width(style)
        rgb = self._on_sea(colour)[:3]  # thin decoration needs no true blending
        if style.dash is not None:
            line = np.vstack((points, points[:1])) if closed else points
            self._dashes(dashes(line, *style.dash, self.frame), colour, style)
            return
        path = _thin(points) * self.ss
        draw.lines(surface, rgb, closed, path.tolist(), width)
        if width > 2 and len(path) > 2:  # fill the notch on the outside of bends
            if closed:
                path = np.vstack((path[-1:], path, path[:1]))
            leg = path[1:] - path[:-1]
            length = np.hypot(leg[:, 0], leg[:, 1])
            bend = (leg[:-1] * leg[1:]).sum(axis=1) < 0.96 * length[:-1] * length[1:]
            for p in path[1:-1][bend].tolist():
                draw.circle(surface, rgb, p, 0.5 * width)

    def _dashes(self, pieces: Points, colour: RGBA, style: Style) -> None:
        line, surface, width, rgb = self.pg.draw.line, self.surface, self._width(style), self._on_sea(colour)[:3]
        for x0, y0, x1, y1 in (self.ss * pieces).tolist():
            line(surface, rgb, (x0, y0), (x1, y1), width)

    def _arrow(self, points: Points, colour: RGBA) -> Points:
        """Draw the head at the end of a line and return the line without it."""
        tip, back = points[-1], points[-2]
        length = math.hypot(*(tip - back))
        size = min(10.0, 0.6 * length)
        if size < 2.0:
            return points
        along = (tip - back) / length
        across = np.array([-along[1], along[0]])
        base = tip - size * along
        head = clip(np.array([tip, base + 0.38 * size * across, base - 0.38 * size * across]), self.frame)
        if len(head) > 2:
            self._fill(head, (*colour[:3], 255))
        return np.vstack((points[:-1], base))


def _rounded(x0: float, y0: float, x1: float, y1: float, r: float) -> Points:
    if r <= 0.0:
        return np.array([(x0, y0), (x1, y0), (x1, y1), (x0, y1)])
    b = np.linspace(0.0, 0.5 * math.pi, 6)
    corners = ((x1 - r, y1 - r, 0.0), (x0 + r, y1 - r, 0.5), (x0 + r, y0 + r, 1.0), (x1 - r, y0 + r, 1.5))
    return np.vstack(
        [np.column_stack((cx + r * np.cos(b + q * math.pi), cy + r * np.sin(b + q * math.pi))) for cx, cy, q in corners]
    )


def _thin(points: Points) -> Points:
    """Drop points of a long line that are less than about a pixel from the last one kept."""
    if len(points) < 200:
        return points
    along = np.concatenate(([0.0], np.cumsum(np.hypot(*np.diff(points, axis=0).T))))
    keep = np.concatenate(([True], np.diff(np.floor(along / 1.2)) > 0))
    keep[-1] = True
    return points[keep]


def _pixels(points: Points) -> Points:
    """An outline without corners that are within a pixel of the one before."""
    whole = np.rint(points)
    kept: Points = points[(whole != np.roll(whole, 1, axis=0)).any(axis=1)]
    return kept


def dashes(points: Points, on: float, off: float, frame: Frame) -> Points:
    """Pieces of a line that are drawn when ``on`` pixels are, then ``off`` are not: [n, 4] x, y, x, y in the frame."""
    along = np.concatenate(((0.0,), np.hypot(*np.diff(points, axis=0).T).cumsum()))
    starts = np.arange(0.0, along[-1], on + off)[:20000]
    n, at = len(starts), np.concatenate((starts, np.minimum(starts + on, along[-1])))
    x, y = np.interp(at, along, points[:, 0]), np.interp(at, along, points[:, 1])
    return seen(np.column_stack((x[:n], y[:n], x[n:], y[n:])), frame)


def seen(points: Points, frame: Frame) -> Points:
    """Those of points [n, >= 2] whose x, y lie in a rectangle."""
    x0, y0, x1, y1 = frame
    x, y = points[:, 0], points[:, 1]
    return points[(x > x0) & (x < x1) & (y > y0) & (y < y1)]


INSIDE, ACROSS, OUTSIDE = range(3)


def _where(points: Points, frame: Frame) -> int:
    """How points lie to a rectangle; plain numbers, for most outlines are short."""
    x, y = zip(*points.tolist(), strict=True)
    left, right, top, bottom = min(x), max(x), min(y), max(y)
    x0, y0, x1, y1 = frame
    if left >= x0 and top >= y0 and right <= x1 and bottom <= y1:
        return INSIDE
    return OUTSIDE if right < x0 or bottom < y0 or left > x1 or top > y1 else ACROSS


def clip(points: Points, frame: Frame) -> Points:
    """Part of a polygon inside a rectangle (Sutherland-Hodgman), for gfxdraw counts pixels in 16 bits."""
    where = _where(points, frame)
    if where != ACROSS:
        return points if where == INSIDE else points[:0]
    x0, y0, x1, y1 = frame
    shape = points
    for axis, bound, sign in ((0, x0, 1.0), (0, x1, -1.0), (1, y0, 1.0), (1, y1, -1.0)):
        # for each edge p -> q: where it crosses the bound, then q if that is inside
        dq = sign * (shape[:, axis] - bound)
        inside = dq >= 0.0
        if inside.all():
            continue
        before = np.arange(-1, len(shape) - 1)
        p, dp = shape[before], dq[before]
        crosses = inside[before] != inside
        share = np.divide(dp, dp - dq, out=np.zeros_like(dp), where=crosses)
        both = np.stack((p + share[:, None] * (shape - p), shape), axis=1)
        shape = both[np.column_stack((crosses, inside))]
        if not len(shape):
            return points[:0]
    return shape
