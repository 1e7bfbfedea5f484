"""The map against stored pictures, one per palette, with a tolerance: fonts and rounding may differ by a little.

After a change that is meant: ``python tests/test_golden_map.py`` draws them anew; look at the diff.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from usv_gym.render.canvas import load_pygame
from usv_gym.render.palette import PALETTES
from usv_gym.render.primitives import Scene
from usv_gym.render.pygame_view import View, render, save_png
from usv_gym.render.scene import History, scene_from_snapshot
from usv_gym.world import state
from usv_gym.world.land import Coast, Polygon

GOLDEN = Path(__file__).parent / "golden"
SIZE, VIEW = (820, 560), View(20.0, 0.0, 0.75)
MEAN, SHARE = 0.2, 0.002  #: largest mean difference (of 255), and share of pixels that may differ by more than 40


def one_of_everything() -> Scene:
    """Every kind of hull and obstacle, detected or not, with a route, trails, AIS, covariances, shadows and plots."""
    history = History()
    for second in range(0, 61, 2):
        scene = scene_from_snapshot(_world(second), ["own", "Nordlys", "Aurora", "Skarv"], history, half_width=300.0,
                                    status=("golden", "seed 1"), coast=_coast())  # fmt: skip
    return scene


def _coast() -> Coast:
    """A shore in the south east with a lake, cut by the edge of the map."""
    shore = np.array([(-160, 130), (-190, 60), (-260, 20), (-330, 60), (-900, 300), (-900, 900), (-80, 900), (-120, 250)])
    return (Polygon(shore.astype(float), (np.array([(-230.0, 120.0), (-215.0, 170.0), (-250.0, 150.0)]),)),)


def _world(second: int) -> Any:
    V, M = 8, 16
    w = np.zeros(1, state.world_dtype(V, M))[0]
    w["dt_us"], w["dt"], w["tick"] = 50_000, 0.05, 20 * second
    v, m, p = w["vessels"], w["obstacles"], w["picture"]
    v["plant"] = -1
    v["plant"][0] = 0
    w["plants"]["thrusters"][0] = 2
    w["plants"]["y"][0, :2], w["plants"]["command"][0, :2, 0] = (0.5, -0.5), (0.6, 0.4)
    psi = np.array([0.02 * second, 2.6, 4.4, 5.5])
    v["active"][:4], v["kind"][:4] = 1, (state.KIND_USV, state.KIND_SHIP, state.KIND_VESSEL, state.KIND_BOAT)
    v["length"][:4], v["beam"][:4] = (10.9, 70, 30, 12), (3, 12, 6, 3.5)
    v["velocity"][:4] = np.array([4.0, 3.0, 2.0, 2.5])[:, None] * np.column_stack((np.cos(psi), np.sin(psi)))
    v["nu"][:4, 0] = 4, 3, 2, 2.5
    start = np.array([(-170, -60), (260, 20), (60, 230), (-210, 190)])
    v["eta"][:4, :2], v["eta"][:4, 2] = start + second * v["velocity"][:4], psi
    kinds = (state.KIND_ICEBERG, state.KIND_BUOY, state.KIND_ISLET, state.KIND_LIGHTHOUSE, state.KIND_PLATFORM)
    m["active"][:6], m["kind"][:5], m["kind"][5] = 1, kinds, state.KIND_ICEBERG
    m["radius"][:6] = 18, 3, 30, 8, 14, 12
    m["position"][:6] = (150, -100), (-60, 60), (-200, -220), (230, 230), (-20, -200), (40, -70)
    r, s = w["routes"], w["sensors"]
    r["waypoint"][0, :3], r["count"][0], r["radius"][0] = ((-170, -60), (100, 40), (220, -180)), 3, 25
    s["exteroceptive"] = s["radar"]["on"] = s["lidar"]["on"] = 1
    s["radar"]["range"], s["lidar"]["range"] = 250, 100
    places = np.concatenate((v["eta"][:, :2], m["position"]))
    w["safety"]["distance"][0] = np.hypot(*(places - places[0]).T)
    for source, letters in ((1, 0b011), (2, 0b001), (V, 0b110), (V + 2, 0b010), (V + 5, 0b110)):
        ship = source < V
        p["id"][0, source], p["sensors"][0, source] = source, letters
        p["position"][0, source] = places[source] + (6.0, -4.0)
        p["descriptor"][0, source] = state.DESCRIPTOR_VESSEL if ship else state.DESCRIPTOR_FIXED
        p["motion_known"][0, source] = ship
        p["cog"][0, source] = psi[source] + 0.1 if ship else math.nan
        p["sog"][0, source] = v["nu"][source, 0] if ship else math.nan
        p["radius"][0, source] = 0.5 * v["length"][source] if ship else m["radius"][source - V] * 1.2
        p["covariance"][0, source] = 90, 40, 60, 0, 0
    w["ais"]["received"][0, 1:3] = 1
    w["ais"]["position"][1:3], w["ais"]["heading"][1:3] = v["eta"][1:3, :2] + 3.0, psi[1:3]
    return w


def _read(path: Path) -> np.ndarray:
    pg = load_pygame()
    return pg.surfarray.array3d(pg.image.load(path)).swapaxes(0, 1).astype(float)


@pytest.fixture(scope="module")
def scene() -> Scene:
    return one_of_everything()


@pytest.mark.parametrize("palette", PALETTES)
def test_the_map_looks_as_it_did(scene, palette):
    off = np.abs(render(scene, SIZE, palette, VIEW).astype(float) - _read(GOLDEN / f"map_{palette}.png"))
    assert off.mean() < MEAN
    assert (off.max(axis=2) > 40.0).mean() < SHARE


def test_the_tolerance_would_notice_a_missing_layer():
    whole = render(one_of_everything(), SIZE, view=VIEW).astype(float)
    scene = one_of_everything()
    scene.layers["vessels"].clear()
    off = np.abs(render(scene, SIZE, view=VIEW).astype(float) - whole)
    scene = one_of_everything()
    scene.layers["rings"].clear()
    rings = np.abs(render(scene, SIZE, view=VIEW).astype(float) - whole)
    for difference in (off, rings):
        assert difference.mean() > MEAN or (difference.max(axis=2) > 40.0).mean() > SHARE


if __name__ == "__main__":
    GOLDEN.mkdir(exist_ok=True)
    for name in PALETTES:
        save_png(one_of_everything(), GOLDEN / f"map_{name}.png", size=SIZE, palette=name, view=VIEW)
        print(GOLDEN / f"map_{name}.png", (GOLDEN / f"map_{name}.png").stat().st_size)
