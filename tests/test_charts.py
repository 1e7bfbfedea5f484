"""Land from files: formats, projection, simplification, the coastline package, and what is said when something is wrong."""

from __future__ import annotations

import builtins
import importlib.metadata
import json
import shutil

import numpy as np
import pytest
from land_helpers import BOSTON, HORTEN, shapes

from usv_gym.config import ConfigError
from usv_gym.scenarios.chart_files import COAST_PACKAGE, read_file
from usv_gym.scenarios.land import scenario_coast
from usv_gym.scenarios.loader import load_scenario
from usv_gym.units import metres_per_degree
from usv_gym.world.vessel import load_vessel

shapely = pytest.importorskip("shapely")
pyogrio = pytest.importorskip("pyogrio")
ODIN = load_vessel("odin")
HERE = {"latitude_deg": HORTEN[1][0], "longitude_deg": HORTEN[1][1]}
HARBOUR = {"latitude_deg": BOSTON[1][0], "longitude_deg": BOSTON[1][1]}
SQUARE = [[100, -50], [100, 50], [200, 50], [200, -50]]


def coast(land, origin=HERE, position=(0.0, 0.0)):
    scenario = {"name": "x", "origin": origin, "land": land, "own_ship": {"position": list(position)}}
    return scenario_coast(load_scenario(scenario), ODIN)


def complaint(land, **keys):
    with pytest.raises(ConfigError) as error:
        coast(land, **keys)
    text = str(error.value)
    assert "\n" not in text
    return text


# --- formats ---------------------------------------------------------------------------------------------------------
@pytest.mark.parametrize("suffix", ["geojson", "shp", "gpkg"])
@pytest.mark.parametrize("crs", ["EPSG:4326", "EPSG:25832"])
def test_every_format_gives_the_same_land(data, tmp_path, suffix, crs):
    """Horten's polygons, written by GDAL in each format, in degrees and in metres of UTM 32."""
    import pyproj

    if (suffix, crs) == ("geojson", "EPSG:25832"):
        pytest.skip("GeoJSON is in degrees by definition")
    source = str(data / HORTEN[0])
    meta, _, wkb, fields = pyogrio.raw.read(source)
    geometries = shapely.from_wkb(wkb)
    if crs != "EPSG:4326":
        to = pyproj.Transformer.from_crs("EPSG:4326", crs, always_xy=True)
        geometries = shapely.transform(geometries, lambda xy: np.column_stack(to.transform(*xy.T)))
    path = tmp_path / f"coast.{suffix}"
    pyogrio.raw.write(path, shapely.to_wkb(geometries), fields, meta["fields"], crs=crs, geometry_type="Polygon")
    ours, theirs = shapes(coast({"files": str(path), "simplify": 0.0})), shapes(coast({"files": source, "simplify": 0.0}))
    assert shapely.hausdorff_distance(shapely.boundary(ours), shapely.boundary(theirs)) < 0.01


def test_places_are_those_of_the_rest_of_the_scenario():
    """Corners by latitude and longitude and corners in metres meet where the scenario puts both."""
    north, east = metres_per_degree(HERE["latitude_deg"])
    geo = [
        {"latitude_deg": HERE["latitude_deg"] + n / north, "longitude_deg": HERE["longitude_deg"] + e / east} for n, e in SQUARE
    ]
    a, b = shapes(coast({"polygons": [geo]})), shapes(coast({"polygons": [SQUARE]}))
    assert shapely.hausdorff_distance(a, b) < 1e-6
    assert a.area == pytest.approx(10_000)


def test_everything_is_joined_and_lakes_stay():
    lake = {"shell": [[300, 0], [300, 100], [400, 100], [400, 0]], "holes": [[[330, 30], [330, 60], [360, 60], [360, 30]]]}
    overlapping = [[150, -50], [150, 50], [250, 50], [250, -50]]
    polygons = coast({"polygons": [SQUARE, overlapping, lake]})
    assert len(polygons) == 2
    assert sum(len(p.holes) for p in polygons) == 1
    assert shapes(polygons).area == pytest.approx(15_000 + 10_000 - 900)


def test_simplification_keeps_its_tolerance(data):
    fine, rough = (shapes(coast({"files": str(data / HORTEN[0]), "simplify": s, "radius": 20000.0})) for s in (0.0, 100.0))
    assert shapely.get_num_coordinates(rough) < 0.6 * shapely.get_num_coordinates(fine)
    assert shapely.hausdorff_distance(shapely.boundary(rough), shapely.boundary(fine)) < 100.0 + 1e-6


def test_only_the_square_around_the_origin_is_kept(data):
    land = shapes(coast({"files": str(data / HORTEN[0]), "radius": 1500.0}))
    assert np.abs(land.bounds).max() <= 1500.0


# --- S-57 ------------------------------------------------------------------------------------------------------------
def test_a_cell_of_boston(data):
    """Deeper keels find more land; quays are land at any depth."""
    file = str(data / BOSTON[0])
    start = 0.0, 3900.0
    areas = [shapes(coast({"files": file, "safety_depth": d, "radius": 4000.0}, HARBOUR, start)).area for d in (0, 2, 5)]
    assert areas[0] < areas[1] < areas[2]
    logan = shapes(coast({"files": file, "radius": 6000.0}, HARBOUR, (0.0, 3000.0)))
    north, east = metres_per_degree(HARBOUR["latitude_deg"])
    runway = [(42.3601 - HARBOUR["latitude_deg"]) * north, (-71.0050 - HARBOUR["longitude_deg"]) * east]
    assert shapely.contains_xy(logan, *runway)


def test_updates_beside_the_cell_are_applied(data, tmp_path):
    """Four of the depth areas of US5BOSCD were replaced by its updates .001 to .005."""
    cell = data / BOSTON[0]
    alone = tmp_path / cell.name
    shutil.copy(cell, alone)
    everywhere = (-180.0, -90.0, 180.0, 90.0)
    bare, updated = ([g.wkb for _, g in read_file(str(path), None, everywhere, 100.0)] for path in (alone, cell))
    assert len(set(bare) - set(updated)) > 0
    assert len(set(updated) - set(bare)) > 0


# --- GSHHG -----------------------------------------------------------------------------------------------------------
def has_coastline():
    try:
        return bool(importlib.metadata.version(COAST_PACKAGE))
    except importlib.metadata.PackageNotFoundError:
        return False


@pytest.mark.skipif(not has_coastline(), reason=f"{COAST_PACKAGE} is not installed")
def test_the_coastline_package_is_full_resolution(data):
    """The package's polygons around Horten are those of GSHHG's full-resolution file, corner for corner."""
    ours, theirs = (coast({**land, "simplify": 0.0}) for land in ({"coast": "auto"}, {"files": str(data / HORTEN[0])}))
    a, b = shapes(ours), shapes(theirs)
    assert shapely.get_num_coordinates(a) == shapely.get_num_coordinates(b) > 100
    assert shapely.hausdorff_distance(shapely.boundary(a), shapely.boundary(b)) < 1.0  # numbers of 24 bits


@pytest.mark.skipif(not has_coastline(), reason=f"{COAST_PACKAGE} is not installed")
def test_the_coastline_goes_around_the_world():
    fiji = coast({"coast": "auto", "radius": 25000.0}, {"latitude_deg": -16.8, "longitude_deg": 179.99}, (0.0, 20000.0))
    assert np.ptp(np.concatenate([p.shell for p in fiji])[:, 1]) > 15000.0  # Taveuni: on both sides of the date line
    assert coast({"coast": "auto"}, {"latitude_deg": -40.0, "longitude_deg": -120.0}) == ()  # open sea is no error


# --- what is wrong ---------------------------------------------------------------------------------------------------
def test_a_polygon_that_crosses_itself_is_named(tmp_path):
    bow_tie = [[100, 0], [200, 100], [200, 0], [100, 100]]
    text = complaint({"polygons": [SQUARE, bow_tie]})
    assert "land.polygons.1 crosses itself near [150.0, 50.0]" in text
    rings = [[[HERE["longitude_deg"] + 1e-3 * e, HERE["latitude_deg"] + 1e-3 * n] for n, e in [*bow_tie, bow_tie[0]]]]
    file = tmp_path / "bad.geojson"
    polygon = {"type": "Feature", "properties": {}, "geometry": {"type": "Polygon", "coordinates": rings}}
    file.write_text(json.dumps({"type": "FeatureCollection", "features": [polygon]}))
    text = complaint({"files": str(file), "radius": 100_000.0})
    assert "bad.geojson" in text
    assert "1 crosses itself" in text


def test_an_own_ship_on_land_is_refused():
    assert "own_ship.position: expected water, but the hull at [150, 0] is on land" in complaint(
        {"polygons": [SQUARE]}, position=(150, 0)
    )
    complaint({"polygons": [SQUARE]}, position=(100 - ODIN.length / 2 + 0.1, 0))  # with its bow
    coast({"polygons": [SQUARE]}, position=(100 - ODIN.length / 2 - 0.1, 0))


def test_without_the_extra_one_line_says_what_to_install(data, monkeypatch):
    real = builtins.__import__

    def bare(name, *args, **kwargs):
        if name.partition(".")[0] in ("pyogrio", "shapely", "pyproj"):
            raise ImportError(f"No module named {name!r}", name=name)
        return real(name, *args, **kwargs)

    monkeypatch.setattr(builtins, "__import__", bare)
    assert "pip install 'usv-gym[charts]'" in complaint({"files": str(data / BOSTON[0])}, origin=HARBOUR)


def test_without_the_coastline_one_line_says_what_to_install(monkeypatch):
    def missing(name):
        raise importlib.metadata.PackageNotFoundError(name)

    monkeypatch.setattr("usv_gym.scenarios.chart_files.importlib.metadata.files", missing)
    assert f"pip install {COAST_PACKAGE}" in complaint({"coast": "auto"}, origin={"latitude_deg": 50.0, "longitude_deg": 0.0})


@pytest.mark.parametrize(
    ("land", "says"),
    [
        ({}, "land: give files, polygons or coast: auto"),
        ({"files": "nowhere.geojson"}, "land.files: no such file: 'nowhere.geojson'"),
        ({"polygons": [[[0, 0], [1, 1]]]}, "land.polygons.0: expected at least 3"),
        ({"polygons": [SQUARE], "simplify": -1}, "land.simplify: expected"),
        ({"polygon": [SQUARE]}, "did you mean 'polygons'?"),
        ({"polygons": [SQUARE], "coast": "gshhg"}, "land.coast: expected"),
    ],
)
def test_wrong_keys_are_named(land, says):
    with pytest.raises(ConfigError) as error:
        load_scenario({"land": land})
    assert says in str(error.value)


def test_a_file_that_is_no_chart_is_named(tmp_path):
    for name in ("chart.geojson", "chart.000"):
        file = tmp_path / name
        file.write_text("not a chart")
        assert f"{name}: cannot be read as a chart" in complaint({"files": str(file)})
