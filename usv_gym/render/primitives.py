"""What a scene is made of: shapes in metres {n}, each with a role instead of a colour, and the numbers beside the map.

Nothing here knows about pixels or colours, so that a scene can be tested without a picture and drawn by any renderer.
Points are ``[n, 2]`` float arrays of north, east [m].
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Points = NDArray[np.float64]

#: drawing order, bottom first
LAYERS = (
    "shallows", "shadows", "land", "rings", "tracks", "route", "detections", "obstacles", "vessels", "symbols", "own", "labels"
)  # fmt: skip


@dataclass(frozen=True)
class Polygon:
    """Filled outline.  ``size`` [m] is drawn at least ``min_px`` wide, growing about ``anchor``; 0: always to scale."""

    points: Points
    role: str
    anchor: tuple[float, float] = (0.0, 0.0)
    size: float = 0.0
    min_px: float = 0.0


@dataclass(frozen=True)
class Area:
    """A large filled outline with holes, always to scale: land with its lakes."""

    shell: Points
    holes: tuple[Points, ...]
    role: str


@dataclass(frozen=True)
class Fringe:
    """What lies within ``width`` [m] of a closed outline."""

    ring: Points
    width: float
    role: str


@dataclass(frozen=True)
class Polyline:
    """Line through points, with an arrow head at its end if ``arrow``.  Dashes and width belong to the role."""

    points: Points
    role: str
    arrow: bool = False


@dataclass(frozen=True)
class Circle:
    """Disc or ring of ``radius`` [m], at least ``min_px`` across."""

    centre: tuple[float, float]
    radius: float
    role: str
    min_px: float = 0.0


@dataclass(frozen=True)
class Dots:
    """Points of ``px`` pixels across, at any scale."""

    points: Points
    role: str
    px: float = 3.0


@dataclass(frozen=True)
class Label:
    """Text beside a place.

    ``lines`` are one or two lines; the first is prominent.  ``clearance`` [m] keeps off the object drawn there.
    A ``fixed`` label is centred on its anchor or left out; others are moved until they fit, highest ``priority`` first.
    """

    lines: tuple[str, ...]
    anchor: tuple[float, float]
    role: str
    clearance: float = 0.0
    priority: float = 0.0
    fixed: bool = False


Primitive = Polygon | Area | Fringe | Polyline | Circle | Dots | Label


@dataclass(frozen=True)
class Series:
    """One curve of a plot: times [s] and values [T], in a role's colour, with the text of its latest value."""

    role: str
    t: Points
    values: Points
    text: str
    filled: bool = True


@dataclass(frozen=True)
class Plot:
    """A small plot of the panel; ``wrap_deg`` marks headings, whose axis is labelled 0 to 359."""

    title: str
    series: tuple[Series, ...]
    wrap_deg: bool = False
    marker: float | None = None  # time [s] of a vertical line


@dataclass(frozen=True)
class TargetRow:
    """One detected target in the table.  ``cpa`` [m] and ``tcpa`` [s] are NaN while its motion is unknown."""

    id: str
    type: str
    encounter: str  # as the COLREGs see it by its motion, whatever the distance; empty if none or unknown
    bearing: float  # true, [deg]
    range: float  # [m]
    cpa: float
    tcpa: float
    sensors: str  # letters A, R, L


@dataclass(frozen=True)
class Panel:
    """Text and curves beside the map."""

    title: str = "USV-GYM"
    status: tuple[str, ...] = ()  # right of the title: time, scenario, seed, policy
    gauges: tuple[tuple[str, str], ...] = ()  # (caption, value)
    targets: tuple[TargetRow, ...] = ()  # nearest first
    plots: tuple[Plot, ...] = ()


@dataclass(frozen=True)
class Scene:
    """Primitives by layer, what to show beside them, and the part of {n} that should be in view."""

    layers: dict[str, list[Primitive]]
    panel: Panel
    extent: tuple[float, float, float, float]  # south, north, west, east [m]

    def all(self, kind: type[Any] | None = None, role: str | None = None) -> list[Any]:
        """Primitives of one type and role, in drawing order (for tests and for other renderers)."""
        return [
            p
            for layer in LAYERS
            for p in self.layers.get(layer, [])
            if (kind is None or isinstance(p, kind)) and (role is None or p.role == role)
        ]
