"""Turns an instant of the sea into primitives: what each thing looks like is decided here, for frames and episodes."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from ..units import DEG, KNOT, wrap_360
from . import shapes
from .panel import clock, target_name, velocity_of
from .primitives import (
    LAYERS,
    Area,
    Circle,
    Dots,
    Fringe,
    Label,
    Panel,
    Points,
    Polygon,
    Polyline,
    Primitive,
    Scene,
    TargetRow,
)
from .sea import DESCRIPTORS, HULLS, OBSTACLES, Detection, Sea, Trail

DOMAIN = (4.0, 1.6)  #: semi-axes of the ship domain along and across, in lengths
CPA_SECONDS, CPA_METRES = 300.0, 150.0  #: closest approaches to come are marked if this soon and this near
SHALLOWS = ((90.0, "shallow"), (35.0, "shoal"))  #: [m] from the shore
VECTOR_SECONDS = 60.0  #: a speed vector shows where a vessel is after this time
HULL_PX, OWN_PX, OBSTACLE_PX, AIS_PX = 16.0, 24.0, 10.0, 14.0  #: smallest sizes on the picture

Layers = dict[str, list[Primitive]]


def compose(
    sea: Sea,
    trails: Mapping[int, Trail],
    panel: Panel,
    extent: tuple[float, float, float, float],
    extra: Mapping[str, Iterable[Primitive]] | None = None,
    hide: Sequence[str] = (),
    *,
    forecast: Sequence[TargetRow] = (),
) -> Scene:
    """Scene of one instant.

    Parameters
    ----------
    sea
        what there is.
    trails
        where vessels have been, by slot.
    panel
        what is shown beside the map.
    extent
        south, north, west, east [m] of what should be in view.
    extra
        more primitives by layer, drawn over those of the same layer.
    hide
        names of layers to leave out.
    forecast
        rows of the detected targets, to mark the closest approach to come; without them none is.
    """
    layers: Layers = {name: [] for name in LAYERS}
    _land(layers, sea)
    _shadows(layers["shadows"], sea)
    _rings(layers, sea, extent)
    for j, trail in sorted(trails.items()):
        _trail(layers, trail, own=j == sea.own)
    _route(layers, sea)
    for s in sea.others():
        if s >= sea.vessels:
            _obstacle(layers["obstacles"], sea, s)
        else:
            _vessel(layers, sea, s)
    for report in sea.ais:
        _ais(layers["symbols"], report.position, report.heading)
    for d in sea.detections:
        _detection(layers, d)
    _labels(layers["labels"], sea)
    if sea.active[sea.own]:
        _own(layers, sea)
        if forecast:
            _forecast(layers, sea, forecast)
    for name, primitives in (extra or {}).items():
        layers[name].extend(primitives)
    for name in hide:
        layers[name] = []
    return Scene(layers, panel, extent)


def _land(layers: Layers, sea: Sea) -> None:
    """Land with its lakes, and the water near it in two shades: by the distance from the shore, for there are no soundings."""
    for width, role in SHALLOWS:
        layers["shallows"] += [Fringe(ring, width, role) for rings in sea.land for ring in rings]
    layers["land"] += [Area(shell, tuple(holes), "land") for shell, *holes in sea.land]
    if len(sea.echoes):
        layers["land"].append(Dots(sea.echoes, "echo", 4.0))


def hull(sea: Sea, j: int) -> Points:
    """Outline of a vessel, to scale: [5, 2] clockwise from the bow."""
    north, east, psi = sea.eta[j]
    return shapes.placed(shapes.HULL, north, east, psi, sea.length[j], sea.beam[j])


def shadow_of(sea: Sea, source: int) -> Points | None:
    """Area that a source hides from the own ship's radar; None when it hides nothing."""
    centre = sea.place(source)
    half = float(sea.radius[source - sea.vessels]) if source >= sea.vessels else 0.0
    if source < sea.vessels:
        bearing = math.atan2(centre[1] - sea.here[1], centre[0] - sea.here[0])
        half = shapes.half_width(sea.length[source], sea.beam[source], bearing - sea.eta[source, 2])
    return shapes.shadow(sea.here, centre, half, sea.radar_range)


def _shadows(layer: list[Primitive], sea: Sea) -> None:
    wedges = [shadow_of(sea, s) for s in sea.others()] if sea.radar_range > 0.0 else []
    layer.extend(Polygon(wedge, "shadow") for wedge in wedges if wedge is not None)


def _rings(layers: Layers, sea: Sea, extent: tuple[float, float, float, float]) -> None:
    """Range rings of the sensors, rings at round distances between, and bearings on the largest that is in view."""
    here, rings = sea.here, layers["rings"]
    view = 0.5 * min(extent[1] - extent[0], extent[3] - extent[2])
    step = shapes.nice_step(view, 4.0)
    count = math.floor(0.97 * view / step)  # rings that are in view all around
    distances = [k * step for k in range(1, count + 1) if not 0.0 < sea.radar_range <= 1.03 * k * step]
    for r in distances:
        rings.append(Circle(here, r, "ring"))
        layers["labels"].append(_ring_label(here, r, f"{r:.0f} m"))
    if sea.lidar_range > 0.0:
        rings.append(Circle(here, sea.lidar_range, "ring_lidar"))
        layers["labels"].append(
            _ring_label(here, sea.lidar_range, f"LiDAR {sea.lidar_range:.0f} m", "label_lidar", 250.0)
        )
    if sea.radar_range > 0.0:
        rings.append(Circle(here, sea.radar_range, "ring_radar"))
        layers["labels"].append(_ring_label(here, sea.radar_range, f"radar {sea.radar_range:.0f} m"))
    compass = sea.radar_range if 0.0 < sea.radar_range <= view else count * step
    for degrees in range(0, 360, 10):
        b = degrees * DEG
        inward = (0.95 if degrees % 30 == 0 else 0.975) * compass
        ends = [(here[0] + r * math.cos(b), here[1] + r * math.sin(b)) for r in (compass, inward)]
        rings.append(Polyline(np.array(ends), "ring_radar" if compass == sea.radar_range else "ring_tick"))
        if degrees % 30 == 0:
            at = (here[0] + 0.91 * compass * math.cos(b), here[1] + 0.91 * compass * math.sin(b))
            layers["labels"].append(Label((f"{degrees:03d}",), at, "label_ring", priority=-1.0, fixed=True))


def _ring_label(
    here: tuple[float, float], r: float, text: str, role: str = "label_ring", bearing: float = 195.0
) -> Label:
    """Text on a ring, by default off the bearings [deg] that have numbers."""
    b = bearing * DEG
    at = (here[0] + r * math.cos(b), here[1] + r * math.sin(b))
    return Label((text,), at, role, priority=-2.0, fixed=True)


def _trail(layers: Layers, trail: Trail, own: bool) -> None:
    """Track with a dot every minute; the own one with times beside some of them."""
    if len(trail.t) < 2:
        return
    who = "own" if own else "ship"
    layers["tracks"].append(Polyline(np.ascontiguousarray(trail.eta[:, :2]), f"track_{who}"))
    minutes = np.arange(math.ceil(trail.t[0] / 60.0), math.floor(trail.t[-1] / 60.0) + 1) * 60.0
    at = np.column_stack([np.interp(minutes, trail.t, trail.eta[:, i]) for i in range(2)])
    layers["tracks"].append(Dots(at, f"tick_{who}", 6.0 if own else 4.5))
    if own and len(minutes) > 1:
        every = max(60.0, 60.0 * shapes.nice_step(len(minutes), 5.0))
        for m, place in zip(minutes, at, strict=True):
            if m > trail.t[0] and m % every == 0.0:
                where = (float(place[0]), float(place[1]))
                layers["labels"].append(Label((clock(m),), where, "label_track", priority=2.0))


def _route(layers: Layers, sea: Sea) -> None:
    if len(sea.route) == 0:
        return
    layers["route"].append(Polyline(sea.route, "route"))
    # the first is where the route starts
    for k, (north, east) in enumerate(sea.route[1:], start=1):
        at = (float(north), float(east))
        if sea.acceptance > 0.0:
            layers["route"].append(Circle(at, sea.acceptance, "acceptance"))
        layers["route"] += [Circle(at, 0.0, "waypoint", 13.0), Dots(np.array([at]), "waypoint", 3.0)]
        layers["labels"].append(Label((f"WP{k:02d}",), at, "label_route", priority=6.0))


def _body(points: Points, role: str, anchor: tuple[float, float], size: float, min_px: float) -> Polygon:
    return Polygon(points, role, anchor, float(size), min_px)


def _obstacle(layer: list[Primitive], sea: Sea, source: int) -> None:
    """Symbol of an obstacle: natural shapes inside the true disc, marks at the size they need to be seen."""
    m = source - sea.vessels
    at, radius = sea.place(source), float(sea.radius[m])
    kind = OBSTACLES.get(int(sea.kind[source]), "iceberg")
    size = 2.0 * radius

    def part(unit: Points, role: str, min_px: float) -> None:
        layer.append(_body(shapes.placed(unit, *at, 0.0, size), role, at, size, min_px))

    disc = 0.5 * shapes.CIRCLE
    if kind in ("iceberg", "islet", "lighthouse"):
        ground = "islet" if kind == "lighthouse" else kind
        rim, shade = shapes.crag(at, radius, m)
        min_px = 18.0 if kind == "lighthouse" else OBSTACLE_PX
        layer += [_body(rim, ground, at, size, min_px), _body(shade, f"{ground}_shade", at, size, min_px)]
    if kind == "lighthouse":
        tower = np.array([(0.34, 0.10), (-0.34, 0.17), (-0.34, -0.17), (0.34, -0.10)])
        part(tower, "lighthouse", 26.0)
        part(disc * 0.34 + (0.42, 0.0), "light", 26.0)
    elif kind == "buoy":
        part(disc, "buoy", 9.0)
        part(disc * 0.4, "buoy_top", 9.0)
    elif kind == "platform":
        square = np.array([(1.0, 1.0), (-1.0, 1.0), (-1.0, -1.0), (1.0, -1.0)]) * math.sqrt(0.125)
        part(square, "platform", 16.0)
        part(square * 0.55, "platform_deck", 16.0)


def _vessel(layers: Layers, sea: Sea, j: int) -> None:
    kind = HULLS.get(int(sea.kind[j]), "ship")
    layers["vessels"] += _hull(sea, j, f"{kind}_hull", "hull_house", HULL_PX)
    _vector(layers["vessels"], sea.place(j), sea.velocity[j], "vector")


def _own(layers: Layers, sea: Sea) -> None:
    """The own ship: its domain, heading line, speed vector, hull.

    The domain is that of Fujii and Tanaka (1971): an ellipse of 4 lengths ahead and astern and 1.6 lengths to either side.
    """
    at, psi, layer = sea.here, float(sea.eta[sea.own, 2]), layers["own"]
    length = float(sea.length[sea.own])
    outline = shapes.ellipse(at, DOMAIN[0] * length, DOMAIN[1] * length, psi)
    layers["rings"].append(Polygon(outline, "domain"))
    reach = max(float(np.hypot(*sea.velocity[sea.own])) * VECTOR_SECONDS, 6.0 * float(sea.length[sea.own]))
    ahead = (at[0] + reach * math.cos(psi), at[1] + reach * math.sin(psi))
    layer.append(Polyline(np.array([at, ahead]), "own_heading"))
    _vector(layer, at, sea.velocity[sea.own], "own_vector")
    layer += _hull(sea, sea.own, "own_hull", "own_house", OWN_PX)


def _forecast(layers: Layers, sea: Sea, rows: Sequence[TargetRow]) -> None:
    """Where own ship and target will be when they are closest, for the target that the picture says comes closest."""
    best = min(((row.cpa, row.tcpa, d) for d, row in zip(sea.detections, rows, strict=True)
                if 1.0 < row.tcpa < CPA_SECONDS and row.cpa < CPA_METRES), key=lambda b: b[:2], default=None)  # fmt: skip
    if best is None:
        return
    cpa, tcpa, d = best
    own = np.add(sea.here, tcpa * sea.velocity[sea.own])
    target = np.add(d.position, np.multiply(tcpa, velocity_of(d) or (0.0, 0.0)))
    layers["symbols"] += [Polyline(np.array([own, target]), "cpa"), Dots(np.array([own, target]), "cpa_dot", 5.0)]
    middle = 0.5 * (own + target)
    text = f"CPA {target_name(d)} {cpa:.0f} m in {clock(tcpa)}"
    layers["labels"].append(Label((text,), (float(middle[0]), float(middle[1])), "label_cpa", priority=7.0))


def _hull(sea: Sea, j: int, role: str, house_role: str, min_px: float) -> list[Primitive]:
    at, length = sea.place(j), float(sea.length[j])
    house = shapes.placed(shapes.DECKHOUSE, *at, sea.eta[j, 2], length, sea.beam[j])
    return [_body(hull(sea, j), role, at, length, min_px), _body(house, house_role, at, length, min_px)]


def _vector(layer: list[Primitive], at: tuple[float, float], velocity: Points, role: str) -> None:
    if math.hypot(*velocity) > 0.1:
        layer.append(Polyline(np.array([at, np.add(at, velocity * VECTOR_SECONDS)]), role, arrow=True))


def _ais(layer: list[Primitive], at: tuple[float, float], heading: float) -> None:
    psi = heading if math.isfinite(heading) else 0.0
    layer.append(_body(shapes.placed(shapes.TRIANGLE, *at, psi, 1.0), "ais", at, 1.0, AIS_PX))


def _detection(layers: Layers, d: Detection) -> None:
    """What the TDM reports: a disc of the apparent radius or an oblong along the course, and how sure it is of that."""
    layer = layers["detections"]
    nn, ne, ee = d.covariance
    if math.isfinite(d.radius):
        if d.is_vessel and d.motion_known and math.isfinite(d.cog):
            # as long as the estimated size, a third as wide (as the original drew it)
            outline = shapes.ellipse(d.position, d.radius, d.radius / 3.0, d.cog)
            layer.append(_body(outline, "detection", d.position, 2.0 * d.radius, OBSTACLE_PX))
        else:
            layer.append(Circle(d.position, d.radius, "detection", OBSTACLE_PX))
    if math.isfinite(nn) and math.isfinite(ne) and math.isfinite(ee):
        outline = shapes.covariance_ellipse(d.position, nn, ne, ee)
        layer.append(Polyline(np.vstack((outline, outline[:1])), "covariance"))
    velocity = velocity_of(d)
    if d.is_vessel and velocity is not None:
        _vector(layers["symbols"], d.position, np.array(velocity), "detection_vector")


def _labels(layer: list[Primitive], sea: Sea) -> None:
    """One label per object, beside where it truly is: what the picture knows of it, nearest and vessels first."""
    by_source = {d.source: d for d in sea.detections}
    for s in sea.others():
        d = by_source.get(s)
        at, vessel = sea.place(s), s < sea.vessels
        clearance = 0.5 * float(sea.length[s]) if vessel else float(sea.radius[s - sea.vessels])
        away = math.hypot(at[0] - sea.here[0], at[1] - sea.here[1])
        name = sea.names[s] if s < len(sea.names) else ""
        if d is None:
            if vessel:
                lines: tuple[str, ...] = (name or HULLS.get(int(sea.kind[s]), "ship"), "not detected")
                layer.append(Label(lines, at, "label_fixed", 0.3 * clearance, 4.0))
            continue
        kind = DESCRIPTORS.get(d.descriptor, "?")
        lines = (f"{target_name(d)} {name}" if vessel and name else f"{target_name(d)} {kind}",)
        if d.is_vessel and d.motion_known and math.isfinite(d.sog):
            lines += (f"{kind}  {wrap_360(round(d.cog / DEG)):03.0f}°  {d.sog / KNOT:.1f} kn",)
        role = "label_vessel" if vessel else "label_fixed"
        priority = (5.0 if vessel else 3.0) - 0.5 * math.tanh(away / 1000.0)
        layer.append(Label(lines, at, role, (0.3 if vessel else 1.0) * clearance, priority))
