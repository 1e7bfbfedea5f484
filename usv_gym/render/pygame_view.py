"""Draws a scene with pygame-ce, on a surface in memory: no window, no display.

image = render(scene)                         # uint8 [800, 1180, 3]
save_png(render(scene, palette="dark"), "map.png")
"""

from __future__ import annotations

import io
import math
import os
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import groupby
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..jit import compiling
from ..replay.archive import replacing
from .canvas import Canvas, load_pygame, text_size
from .labels import Box, Placed, Request, place
from .palette import PALETTES
from .panel_view import WIDTH as PANEL_WIDTH
from .panel_view import draw_panel
from .primitives import LAYERS, Area, Circle, Dots, Fringe, Label, Points, Polygon, Polyline, Primitive, Scene
from .shapes import nice_step
from .trace import unpack

SIZES = (12, 11)  #: [px] of the first and the second line of a label
IMPORTANT = 4.0  #: labels of this priority are moved far before they are left out
BARE = 200  #: [px] a map smaller than this has no text: it could not be read
SMALL = 11  #: [px] text of the grid and of the scale


@dataclass(frozen=True)
class View:
    """Which part of {n} the map shows: its centre [m], in the middle of the map, and pixels per metre; north is up."""

    north: float
    east: float
    scale: float

    @staticmethod
    def fit(extent: tuple[float, float, float, float], width: float, height: float) -> View:
        """All of south, north, west, east [m] in a map of width x height pixels."""
        south, north, west, east = extent
        scale = min(width / max(east - west, 1.0), height / max(north - south, 1.0))
        return View(0.5 * (south + north), 0.5 * (west + east), scale)

    def pixel(self, place: tuple[float, float], size: tuple[float, float]) -> tuple[float, float]:
        """Where north, east [m] is in a map of this width and height: x, y [px]."""
        return (
            0.5 * size[0] + (place[1] - self.east) * self.scale,
            0.5 * size[1] - (place[0] - self.north) * self.scale,
        )

    def place(self, pixel: tuple[float, float], size: tuple[float, float]) -> tuple[float, float]:
        """The opposite of `pixel`: north, east [m]."""
        return (
            self.north + (0.5 * size[1] - pixel[1]) / self.scale,
            self.east + (pixel[0] - 0.5 * size[0]) / self.scale,
        )


@compiling()
def render(
    scene: Scene,
    size: tuple[int, int] = (1180, 800),
    palette: str = "day",
    view: View | None = None,
    *,
    panel: bool | None = None,
    supersample: int = 2,
    ratio: float = 1.0,
) -> NDArray[np.uint8]:
    """Picture of a scene as an array [height, width, 3] of red, green, blue; parameters and errors as `draw`."""
    surface = draw(scene, size, palette, view, panel=panel, supersample=supersample, ratio=ratio)
    image = np.empty((size[1], size[0], 3), np.uint8)
    unpack(load_pygame().surfarray.pixels2d(surface).T, image)
    return image


@compiling()
def draw(
    scene: Scene,
    size: tuple[int, int] = (1180, 800),
    palette: str = "day",
    view: View | None = None,
    *,
    panel: bool | None = None,
    supersample: int = 2,
    ratio: float = 1.0,
) -> Any:
    """Picture of a scene as a pygame surface.

    Parameters
    ----------
    scene
        what to draw.
    size
        width and height in pixels.
    palette
        "day", "dark" or "night".
    view
        part of the sea to show; the scene's extent when None.
    panel
        whether gauges, targets and plots stand beside the map; when None, if that leaves the map most of the picture.
    supersample
        smoothness: 1 is jagged and fastest, 2 is good, 3 for print.
    ratio
        how large text and symbols are: 2 for a screen of high density.

    Raises
    ------
    ValueError
        if the palette is unknown or the size not positive.
    DependencyNotInstalled
        if pygame-ce is not installed.
    """
    if palette not in PALETTES:
        raise ValueError(f"unknown palette {palette!r}: one of {', '.join(PALETTES)}")
    if min(size) < 1 or supersample < 1 or not ratio > 0.0:
        raise ValueError(f"size, supersample and ratio must be positive, not {size}, {supersample} and {ratio}")
    canvas = Canvas(size, palette, supersample, ratio, "sea")
    width, height = map_size(canvas.size, panel)
    if width > 0:
        beside = width < canvas.size[0]
        _Map(canvas, scene, width, height, view or View.fit(scene.extent, width, height), title=not beside).draw()
    if width < canvas.size[0]:
        draw_panel(canvas, scene.panel, (width, 0, *canvas.size))
    return canvas.finish()


def map_size(size: tuple[float, float], panel: bool | None = None) -> tuple[float, float]:
    """Width and height [px] that the map has of a picture; the rest of the width is the panel's."""
    beside = size[0] - PANEL_WIDTH >= 0.6 * size[1] if panel is None else panel
    return (max(size[0] - PANEL_WIDTH, 0.0) if beside else size[0]), size[1]


def save_png(picture: NDArray[np.uint8] | Scene, path: str | os.PathLike[str], **options: Any) -> None:
    """Write a picture, or a scene with the options of `render`, as PNG; the file appears whole or not at all.

    Raises
    ------
    OSError
        if the file cannot be written.
    """
    image = render(picture, **options) if isinstance(picture, Scene) else picture
    pg = load_pygame()
    buffer = io.BytesIO()
    pg.image.save(pg.surfarray.make_surface(image.swapaxes(0, 1)), buffer, "map.png")
    with replacing(path) as file:
        file.write(buffer.getvalue())


def _points(p: Primitive) -> Points:
    """Points of a primitive that has any: of an area those of its shell."""
    points: Points = (
        p.shell if isinstance(p, Area) else p.ring if isinstance(p, Fringe) else getattr(p, "points", _NONE)
    )
    return points


_NONE = np.zeros((0, 2))


def _boxes(outlines: list[Points]) -> list[Box]:
    """Left, top, right, bottom of outlines."""
    if not outlines:
        return []
    first = np.cumsum([0, *(len(points) for points in outlines[:-1])])
    points = np.concatenate(outlines)
    return np.hstack([edge.reduceat(points, first) for edge in (np.minimum, np.maximum)]).tolist()  # type: ignore[no-any-return]


class _Map:
    """The map of one picture, in the rectangle (0, 0, width, height) of a canvas."""

    def __init__(self, canvas: Canvas, scene: Scene, width: float, height: float, view: View, title: bool) -> None:
        self.canvas, self.scene, self.view = canvas, scene, view
        self.width, self.height, self.title = width, height, title
        self.step = nice_step(width / view.scale, 8.0)  # of the grid [m]
        self._turn = np.array([(0.0, -view.scale), (view.scale, 0.0)])  # north, east to x, y
        self._origin = np.array(self._at((0.0, 0.0)))
        self.bodies: list[Points] = []  # outlines of hulls and obstacles: labels rather stand beside them

    def draw(self) -> None:
        """Everything, bottom up; labels last, for they look for free places."""
        layers = self.scene.layers
        shallows = [p for p in layers.get("shallows", []) if isinstance(p, Fringe)]
        for (width, role), fringes in groupby(shallows, lambda p: (p.width, p.role)):
            self.canvas.fringe([self.px(p.ring) for p in fringes], width * self.view.scale, role)
        shadows = [p for p in layers.get("shadows", []) if isinstance(p, Polygon)]
        for role, wedges in groupby(shadows, lambda p: p.role):
            self.canvas.tint([self.px(p.points) for p in wedges], role)
        self._grid()
        for name in LAYERS:
            if name not in ("shallows", "shadows", "labels"):
                for primitive, points in self._projected(layers.get(name, [])):
                    self._primitive(primitive, points, name in ("obstacles", "vessels", "own"))
        if min(self.width, self.height) >= BARE:
            plates = self._furniture()
            self._labels([p for p in layers.get("labels", []) if isinstance(p, Label)], plates)

    def px(self, points: Points) -> Points:
        """Metres {n} to pixels, [n, 2]."""
        out: Points = points @ self._turn + self._origin
        return out

    def _at(self, place: tuple[float, float]) -> tuple[float, float]:
        return self.view.pixel(place, (self.width, self.height))

    def _projected(self, primitives: list[Primitive]) -> Iterator[tuple[Primitive, Points]]:
        """Primitives with their points [px], all of a layer projected at once."""
        if not primitives:
            return
        points = [np.array([p.centre]) if isinstance(p, Circle) else _points(p) for p in primitives]
        ends = np.cumsum([len(some) for some in points]).tolist()
        pixels = self.px(np.concatenate(points))
        for p, begin, end in zip(primitives, [0, *ends[:-1]], ends, strict=True):
            yield p, pixels[begin:end]

    def _primitive(self, p: Primitive, points: Points, body: bool) -> None:
        if isinstance(p, Polygon):
            points = self._grown(p, points)
            self.canvas.polygon(points, p.role)
            if body:
                self.bodies.append(points)
        elif isinstance(p, Area):
            self.canvas.area(points, [self.px(hole) for hole in p.holes], p.role, "lake")
        elif isinstance(p, Polyline):
            self.canvas.polyline(points, p.role, p.arrow)
        elif isinstance(p, Circle):
            self.canvas.circle(points[0], max(p.radius * self.view.scale, 0.5 * p.min_px), p.role)
        elif isinstance(p, Dots):
            self.canvas.dots(points, p.role, p.px)

    def _grown(self, p: Polygon, points: Points) -> Points:
        """Points of a polygon, grown about its anchor to the smallest size it is drawn at."""
        size = p.size * self.view.scale
        if 0.0 < size < p.min_px:
            anchor = np.array(self._at(p.anchor))
            points = anchor + (points - anchor) * (p.min_px / size)
        return points

    # --- furniture: what belongs to the picture and not to the sea ---------------------------------------------------
    def _grid(self) -> None:
        """Lines at round coordinates, and the coordinates along the left and the lower edge."""
        w, h, view, step = self.width, self.height, self.view, self.step
        half_n, half_e = 0.5 * h / view.scale, 0.5 * w / view.scale
        for k in range(math.ceil((view.north - half_n) / step), math.floor((view.north + half_n) / step) + 1):
            y = self._at((k * step, 0.0))[1]
            self.canvas.polyline(np.array([(0.0, y), (w, y)]), "grid")
            if min(w, h) >= BARE and 70.0 < y < h - 70.0:
                self.canvas.text(f"N {k * step:.0f}", (5.0, y - 13.0), "text_muted", SMALL, halo=True)
        for k in range(math.ceil((view.east - half_e) / step), math.floor((view.east + half_e) / step) + 1):
            x = self._at((0.0, k * step))[0]
            self.canvas.polyline(np.array([(x, 0.0), (x, h)]), "grid")
            if w > 500 and 280.0 < x < w - 70.0:
                self.canvas.text(f"E {k * step:.0f}", (x + 4.0, h - 16.0), "text_muted", SMALL, halo=True)

    def _furniture(self) -> list[Box]:
        """Scale bar, north arrow and, without a panel, the title.  Returns the boxes labels must keep off."""
        boxes = [self._scale_bar(), self._north_arrow()]
        if self.title:
            boxes.append(self._title())
        w, h = float(self.width), float(self.height)
        return [*boxes, (0.0, 0.0, 42.0, h), (0.0, h - 18.0, w, h)]  # coordinates stand along these edges

    def _scale_bar(self) -> Box:
        c, step = self.canvas, nice_step(self.width / self.view.scale, 20.0)
        parts = 2 if 4.0 * step * self.view.scale > 0.35 * self.width else 4
        length = parts * step * self.view.scale
        x, y = 22.0, self.height - 24.0
        plate = (x - 14.0, y - 24.0, x + length + 34.0, y + 14.0)
        c.box(plate, "plate", 5.0)
        for k in range(parts):
            left, right = x + k * length / parts, x + (k + 1) * length / parts
            c.box((left, y, right, y + 5.0), "scale" if k % 2 == 0 else "scale_gap")
        for k in (0, parts // 2, parts):
            text = f"{k * step:g}" + (" m" if k == parts else "")
            shift = 0.5 * text_size(f"{k * step:g}", SMALL)[0]
            c.text(text, (x + k * length / parts - shift, y - 16.0), "text", SMALL)
        return plate

    def _north_arrow(self) -> Box:
        c, (x, y) = self.canvas, (self.width - 40.0, 44.0)
        c.circle((x, y), 24.0, "plate")
        right = np.array([(x, y - 17.0), (x + 8.0, y + 13.0), (x, y + 7.0)])
        c.polygon(right, "needle")
        c.polygon(right * (-1.0, 1.0) + (2.0 * x, 0.0), "needle_light")
        c.text("N", (x, y + 27.0), "text", 13, 0.5, halo=True)
        return x - 27.0, y - 27.0, x + 27.0, y + 43.0

    def _title(self) -> Box:
        """Title, times and the most wanted gauges in a strip at the top left."""
        c, panel = self.canvas, self.scene.panel
        lines = [" · ".join((panel.title, *panel.status)), "   ".join(f"{k} {v}" for k, v in panel.gauges[:4] if v != "-")]
        room = self.width - 110.0
        lines = [line for line in lines if line]
        size = next((s for s in (13, 12, 11, 10) if max(text_size(t, s)[0] for t in lines) + 20.0 <= room), 0)
        if not size:
            return 0.0, 0.0, 0.0, 0.0
        width = max(text_size(t, size)[0] for t in lines) + 20.0
        plate = (10.0, 10.0, 10.0 + width, 18.0 + 18.0 * len(lines))
        c.box(plate, "plate", 5.0)
        for k, line in enumerate(lines):
            c.text(line, (20.0, 15.0 + 18.0 * k), "text" if k == 0 else "text_muted", size)
        return plate

    # --- labels ------------------------------------------------------------------------------------------------------
    def _labels(self, labels: list[Label], keep_out: list[Box]) -> None:
        requests = [self._request(label) for label in labels]
        frame = (4.0, 4.0, self.width - 4.0, self.height - 4.0)
        placed = place(requests, frame, keep_out, _boxes(self.bodies))
        for result in placed:
            if result is not None and result.leader is not None:
                self.canvas.polyline(np.array(result.leader), "leader")
        for label, result in zip(labels, placed, strict=True):
            if result is not None:
                self._write(label, result)

    def _request(self, label: Label) -> Request:
        sizes = [text_size(text, size) for text, size in zip(label.lines, SIZES, strict=False)]
        size = (max(w for w, _ in sizes) + 2.0, sum(h for _, h in sizes) + 1.0)
        clearance = max(label.clearance * self.view.scale, 7.0)
        far = 90.0 if label.priority >= IMPORTANT else 20.0
        return Request(size, self._at(label.anchor), clearance, label.priority, label.fixed, far)

    def _write(self, label: Label, where: Placed) -> None:
        x, y = where.box[0] + 1.0, where.box[1]
        for k, (text, size) in enumerate(zip(label.lines, SIZES, strict=False)):
            self.canvas.text(text, (x, y), label.role if k == 0 else "text_muted", size, halo=True)
            y += text_size(text, size)[1]
