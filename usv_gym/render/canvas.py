"""A pygame surface that draws smoothly: shapes at several times the size, text at its own.  No display needed."""

from __future__ import annotations

import functools
import math
import os
from collections.abc import Sequence
from typing import Any

import numpy as np
from gymnasium.error import DependencyNotInstalled
from numpy.typing import NDArray

from .palette import STYLES, Style
from .primitives import Points

RGBA = tuple[int, int, int, int]


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


def text_size(text: str, size: int) -> tuple[int, int]:
    """Width and height of a text [px]."""
    width, height = font(size).size(text)
    return int(width), int(height)


class Canvas:
    """A picture in the making.  All coordinates are pixels of the result, x right, y down.

    Parameters
    ----------
    size
        width and height [px].
    palette
        name of a palette.
    supersample
        shapes are drawn this many times as large and averaged.
    """

    def __init__(self, size: tuple[int, int], palette: str, supersample: int = 2) -> None:
        """Blank picture."""
        self.size, self.palette, self.ss = size, palette, supersample
        self.pg = load_pygame()
        self.surface = self.pg.Surface((size[0] * supersample, size[1] * supersample))
        self._text: list[tuple[Any, tuple[int, int]]] = []

    def style(self, role: str) -> tuple[Style, RGBA | None, RGBA | None]:
        """Style, area colour and line colour of a role."""
        style = STYLES[role]
        return style, rgba(style.fill(self.palette)), rgba(style.line(self.palette))

    # --- shapes ------------------------------------------------------------------------------------------------------
    def box(self, box: Sequence[float], role: str, radius: float = 0.0) -> None:
        """Rectangle left, top, right, bottom with rounded corners."""
        x0, y0, x1, y1 = box
        self.polygon(_rounded(x0, y0, x1, y1, radius), role)

    def polygon(self, points: Points, role: str) -> None:
        """Filled outline [n, 2]."""
        style, fill, line = self.style(role)
        if fill is not None:
            self._fill(points, fill)
        if line is not None:
            self._stroke(np.vstack((points, points[:1])), line, style)

    def polyline(self, points: Points, role: str, arrow: bool = False) -> None:
        """Line through points [n, 2]."""
        style, _, line = self.style(role)
        if line is None or len(points) < 2:
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
        n = int(np.clip(radius * 0.8, 24, 360))
        b = np.linspace(0.0, 2.0 * math.pi, n, endpoint=False)
        self.polygon(np.column_stack((centre[0] + radius * np.cos(b), centre[1] + radius * np.sin(b))), role)

    def dots(self, points: Points, role: str, px: float) -> None:
        """Small discs."""
        _, fill, line = self.style(role)
        colour = fill or line
        if colour is None:
            return
        radius = max(round(0.5 * px * self.ss), 1)
        for x, y in np.rint(self._visible(points) * self.ss).astype(int).tolist():
            if colour[3] < 255:
                self.pg.gfxdraw.filled_circle(self.surface, x, y, radius, colour)
            else:
                self.pg.draw.circle(self.surface, colour[:3], (x, y), radius)

    def tint(self, points: Points, role: str) -> None:
        """Fill an outline as if its translucent colour lay on the bare sea: where two overlap it is no darker."""
        fill = self.style(role)[1]
        if fill is not None:
            self._fill(points, self._on_sea(fill))

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
        image = text_surface(text, size, style.line(self.palette), style.fill(self.palette) if halo else "")
        x = at[0] - align * (image.get_width() - (2 if halo else 0)) - (1 if halo else 0)
        self._text.append((image, (round(x), round(at[1]) - (1 if halo else 0))))

    def finish(self) -> NDArray[np.uint8]:
        """The picture, [height, width, 3]."""
        pg = self.pg
        out = self.surface if self.ss == 1 else pg.transform.smoothscale(self.surface, self.size)
        out.blits(self._text, doreturn=False)
        pixels = np.frombuffer(pg.image.tobytes(out, "RGB"), dtype=np.uint8)
        return pixels.reshape(self.size[1], self.size[0], 3).copy()  # writable, like any array of an environment

    # --- the inner drawing -----------------------------------------------------------------------------------------
    def _frame(self) -> tuple[float, float, float, float]:
        return -20.0, -20.0, self.size[0] + 20.0, self.size[1] + 20.0

    def _on_sea(self, colour: RGBA) -> RGBA:
        """Opaque colour of a translucent one over the bare sea."""
        if colour[3] == 255:
            return colour
        sea, k = rgba(STYLES["sea"].fill(self.palette)) or colour, colour[3] / 255.0
        r, g, b = (round(k * c + (1.0 - k) * s) for c, s in zip(colour[:3], sea[:3], strict=True))
        return r, g, b, 255

    def _visible(self, points: Points) -> Points:
        x0, y0, x1, y1 = self._frame()
        inside = (points[:, 0] > x0) & (points[:, 0] < x1) & (points[:, 1] > y0) & (points[:, 1] < y1)
        return points[inside]

    def _width(self, style: Style) -> int:
        return max(round(style.width * self.ss), 1)

    def _fill(self, points: Points, colour: RGBA) -> None:
        shape = clip(points, self._frame())
        if len(shape) < 3:
            return
        corners = np.rint(shape * self.ss).astype(int).tolist()
        if colour[3] < 255:
            self.pg.gfxdraw.filled_polygon(self.surface, corners, colour)
        else:
            self.pg.draw.polygon(self.surface, colour[:3], corners)

    def _stroke(self, points: Points, colour: RGBA, style: Style) -> None:
        """Lines of the style's width with round joints."""
        x0, y0, x1, y1 = self._frame()
        low, high = points.min(axis=0), points.max(axis=0)
        if high[0] < x0 or low[0] > x1 or high[1] < y0 or low[1] > y1:
            return
        width = self._width(style)
        colour = self._on_sea(colour)  # thin decoration needs no true blending
        if style.dash is not None:
            for p, q in dashes(points, *style.dash, (x0, y0, x1, y1)):
                self.pg.draw.line(self.surface, colour[:3], p * self.ss, q * self.ss, width)
            return
        path = _thin(points) * self.ss
        self.pg.draw.lines(self.surface, colour[:3], False, path.tolist(), width)
        if width > 2:  # fill the notch on the outside of bends
            a, b = np.diff(path[:-1], axis=0), np.diff(path[1:], axis=0)
            bend = (a * b).sum(axis=1) < 0.96 * np.hypot(*a.T) * np.hypot(*b.T)
            for p in path[1:-1][bend].tolist():
                self.pg.draw.circle(self.surface, colour[:3], p, 0.5 * width)

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
        self._fill(np.array([tip, base + 0.38 * size * across, base - 0.38 * size * across]), (*colour[:3], 255))
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


def dashes(
    points: Points, on: float, off: float, frame: tuple[float, float, float, float]
) -> list[tuple[Points, Points]]:
    """Pieces of a line that are drawn when ``on`` pixels are, then ``off`` are not; only those in the frame."""
    along = np.concatenate(([0.0], np.cumsum(np.hypot(*np.diff(points, axis=0).T))))
    starts = np.arange(0.0, along[-1], on + off)[:20000]
    ends = np.minimum(starts + on, along[-1])
    a = np.column_stack([np.interp(starts, along, points[:, i]) for i in range(2)])
    b = np.column_stack([np.interp(ends, along, points[:, i]) for i in range(2)])
    x0, y0, x1, y1 = frame
    seen = (a[:, 0] > x0) & (a[:, 0] < x1) & (a[:, 1] > y0) & (a[:, 1] < y1)
    return list(zip(a[seen], b[seen], strict=True))


def clip(points: Points, frame: tuple[float, float, float, float]) -> Points:
    """Part of a polygon inside a rectangle (Sutherland-Hodgman), for gfxdraw counts pixels in 16 bits."""
    x0, y0, x1, y1 = frame
    low, high = points.min(axis=0), points.max(axis=0)
    if low[0] >= x0 and low[1] >= y0 and high[0] <= x1 and high[1] <= y1:
        return points
    if high[0] < x0 or high[1] < y0 or low[0] > x1 or low[1] > y1:
        return points[:0]
    shape = points.tolist()
    for axis, bound, sign in ((0, x0, 1.0), (0, x1, -1.0), (1, y0, 1.0), (1, y1, -1.0)):
        out: list[list[float]] = []
        for k, q in enumerate(shape):
            p = shape[k - 1]
            dp, dq = sign * (p[axis] - bound), sign * (q[axis] - bound)
            if (dp < 0.0) != (dq < 0.0):
                f = dp / (dp - dq)
                out.append([p[0] + f * (q[0] - p[0]), p[1] + f * (q[1] - p[1])])
            if dq >= 0.0:
                out.append(q)
        shape = out
        if not shape:
            return points[:0]
    return np.array(shape)
