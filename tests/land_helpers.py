"""Coasts and questions to them, for the tests of land."""

from __future__ import annotations

import numpy as np

from usv_gym.jit import kernel
from usv_gym.world.geometry import hull_vertices
from usv_gym.world.land import Polygon
from usv_gym.world.shore import coast, hull_land, nearest_land, on_land, ray_range

#: where the places are: file below ../shared/data, origin, keys of ``land``
HORTEN = "coast/oslofjord_horten.geojson", (59.4377744115633, 10.4716511800410), {}
OSLOFJORD = "coast/oslofjord_full.geojson", (59.66, 10.62), {"radius": 12000.0}
BOSTON = "enc/US5BOSCD.000", (42.3385, -70.985), {"radius": 5000.0, "safety_depth": 2.0}


def shapes(polygons):
    """A coast as one shapely geometry, x = N, y = E."""
    import shapely

    return shapely.union_all([shapely.Polygon(p.shell, p.holes) for p in polygons])


def square(n, e, half):
    """A square island."""
    return Polygon(np.array([[n - half, e - half], [n - half, e + half], [n + half, e + half], [n + half, e - half]], float))


@kernel
def _hulls(land, poses, length, beam, exact, out):
    h = coast(land, 0)
    hull = np.zeros((5, 2))
    reach = 0.5 * np.sqrt(length * length + beam * beam)
    for k in range(poses.shape[0]):
        hull_vertices(hull, poses[k, 0], poses[k, 1], poses[k, 2], length, beam)
        out[k] = hull_land(land, h, hull, poses[k, 0], poses[k, 1], reach, exact)


@kernel
def _rays(land, places, bearings, reach, out):
    h = coast(land, 0)
    for k in range(places.shape[0]):
        out[k] = ray_range(land, h, places[k, 0], places[k, 1], np.cos(bearings[k]), np.sin(bearings[k]), reach)


@kernel
def _nearest(land, places, reach, out):
    h = coast(land, 0)
    for k in range(places.shape[0]):
        nearest_land(land, h, places[k, 0], places[k, 1], reach, out[k])


@kernel
def _inside(land, places, out):
    h = coast(land, 0)
    for k in range(places.shape[0]):
        out[k] = on_land(land, h, places[k, 0], places[k, 1])


def hull_distances(pool, poses, length, beam, exact=100.0):
    """Distance from land [m] of hulls at poses [n, 3]."""
    out = np.zeros(len(poses))
    _hulls(pool, poses, length, beam, exact, out)
    return out


def ray_ranges(pool, places, bearings, reach):
    """Range of land [m] along rays from places [n, 2]."""
    out = np.zeros(len(places))
    _rays(pool, places, bearings, reach, out)
    return out


def sector_ranges(pool, places, reach):
    """Range of the nearest land [n, 72] in each sector around places [n, 2]; NaN for none."""
    out = np.zeros((len(places), 72, 2))
    _nearest(pool, places, reach, out)
    return np.hypot(out[..., 0], out[..., 1])


def inside(pool, places):
    """Whether places [n, 2] are on land."""
    out = np.zeros(len(places), bool)
    _inside(pool, places, out)
    return out
