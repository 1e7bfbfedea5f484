"""The map: shapes and numbers of a scene without a picture, labels, and a few looks at pixels."""

from __future__ import annotations

import math
import subprocess
import sys
from typing import Any

import numpy as np
import pytest
from gymnasium.error import DependencyNotInstalled

from usv_gym.render import canvas, compose, shapes, trace
from usv_gym.render.labels import Request, place
from usv_gym.render.palette import PALETTES, STYLES
from usv_gym.render.primitives import Circle, Dots, Label, Polygon, Polyline
from usv_gym.render.pygame_view import View, render, save_png
from usv_gym.render.scene import History, scene_from_episode, scene_from_snapshot, sea_from_record
from usv_gym.replay.archive import Episode
from usv_gym.replay.recorder import Recorder
from usv_gym.units import KNOT
from usv_gym.world import geometry, state

V, M = 8, 16


def a_world(ticks: int = 0, dt: float = 0.05) -> Any:
    """One own ship going north at 5 m/s, a ship to the north-east going west, an iceberg to the east.  [1]"""
    worlds = np.zeros(1, state.world_dtype(V, M))
    w = worlds[0]
    w["dt_us"], w["dt"], w["tick"], w["traffic_tick"] = round(dt * 1e6), dt, ticks, ticks
    t = ticks * dt
    v = w["vessels"]
    v["plant"] = -1
    v["active"][:2] = 1
    v["kind"][:2] = state.KIND_USV, state.KIND_SHIP
    v["length"][:2], v["beam"][:2] = (10.0, 60.0), (3.0, 10.0)
    v["eta"][0], v["eta"][1] = (5.0 * t, 0.0, 0.0), (300.0, 300.0 - 5.0 * t, -0.5 * math.pi)
    v["nu"][:2, 0] = 5.0
    v["velocity"][0], v["velocity"][1] = (5.0, 0.0), (0.0, -5.0)
    m = w["obstacles"]
    m["active"][0], m["kind"][0], m["radius"][0], m["position"][0] = 1, state.KIND_ICEBERG, 15.0, (0.0, 200.0)
    r = w["routes"]
    r["waypoint"][0, :2], r["count"][0], r["radius"][0] = ((0.0, 0.0), (400.0, 0.0)), 2, 20.0
    s = w["sensors"]
    s["exteroceptive"] = s["radar"]["on"] = s["lidar"]["on"] = 1
    s["radar"]["range"], s["lidar"]["range"] = 500.0, 120.0
    places = np.concatenate((v["eta"][:, :2], m["position"]))
    w["safety"]["distance"][0] = np.hypot(*(places - places[0]).T) - 20.0
    return worlds


def detect(w: Any, source: int, **fields: Any) -> None:
    p = w["picture"]
    values = {"id": 7, "sensors": 0b011, "motion_known": 1, "radius": 12.0, "covariance": (100.0, 30.0, 25.0, 0, 0)}
    for name, value in (values | fields).items():
        p[name][0, source] = value
    p["sequence"] += 1
    p["tick"] = w["tick"]


def an_episode(steps: int = 60) -> Episode:
    worlds, recorder = a_world(), Recorder()
    for k in range(steps + 1):
        worlds[0] = a_world(k * 20)[0]
        detect(worlds[0], V, id=1, descriptor=state.DESCRIPTOR_FIXED, position=(1.0, 201.0), sensors=2)
        worlds[0]["picture"]["sequence"] = k + 1
        recorder.sample(worlds)
    return recorder.finish(names=["own", "Nordlys"], scenario={"name": "two ships"}, seed=4, policy="hold")


# --- shapes ----------------------------------------------------------------------------------------------------------
def test_shadow_is_bounded_by_the_tangents_of_the_disc():
    observer, centre, radius, reach = (10.0, -20.0), (130.0, 70.0), 25.0, 800.0
    wedge = shapes.shadow(observer, centre, radius, reach)
    assert wedge is not None
    o, c = np.array(observer), np.array(centre)
    d = np.linalg.norm(c - o)
    for near, far in ((wedge[0], wedge[-1]), (wedge[1], wedge[2])):
        assert np.linalg.norm(near - c) == pytest.approx(radius)  # starts on the disc
        assert np.dot(near - c, near - o) == pytest.approx(0.0, abs=1e-9)  # where the line of sight touches it
        along, across = (far - near) / np.linalg.norm(far - near), near - o
        assert along[0] * across[1] - along[1] * across[0] == pytest.approx(0.0, abs=1e-9)  # and goes on behind it
        assert np.linalg.norm(far - o) == pytest.approx(reach)
    cosine = np.dot(wedge[0] - o, wedge[1] - o) / np.prod(np.linalg.norm(wedge[:2] - o, axis=1))
    assert math.acos(cosine) == pytest.approx(2.0 * math.asin(radius / d))


def test_no_shadow_from_inside_or_beyond_reach():
    assert shapes.shadow((0.0, 0.0), (3.0, 4.0), 6.0, 100.0) is None
    assert shapes.shadow((0.0, 0.0), (300.0, 400.0), 6.0, 400.0) is None


def test_hull_is_the_one_that_collides():
    w = a_world()[0]
    w["vessels"]["eta"][1] = (12.0, -7.0, 2.3)
    drawn = compose.hull(sea_from_record(w), 1)
    truth = np.zeros((5, 2))
    geometry.hull_vertices(truth, 12.0, -7.0, 2.3, 60.0, 10.0)
    np.testing.assert_allclose(drawn, truth, atol=1e-9)


@pytest.mark.parametrize("aspect", [0.0, 0.4, 1.5, -2.5, 3.1])
def test_shadow_of_a_hull_is_as_wide_as_sensors_reckon(aspect):
    assert shapes.half_width(60.0, 10.0, aspect) == pytest.approx(geometry.half_width(60.0, 10.0, aspect))


@pytest.mark.parametrize("index", range(20))
def test_iceberg_lies_in_its_disc_and_stays_the_same(index):
    rim, shade = shapes.crag((100.0, 50.0), 15.0, index)
    r = np.hypot(*(rim - (100.0, 50.0)).T)
    assert r.max() == pytest.approx(15.0)
    assert r.min() > 0.5 * 15.0
    assert np.hypot(*(shade - (100.0, 50.0)).T).max() <= 15.0 + 1e-9
    np.testing.assert_array_equal(rim, shapes.crag((100.0, 50.0), 15.0, index)[0])


def test_covariance_ellipse_is_two_sigma():
    p = np.array([(100.0, 30.0), (30.0, 25.0)])
    outline = shapes.covariance_ellipse((5.0, 6.0), 100.0, 30.0, 25.0) - (5.0, 6.0)
    np.testing.assert_allclose(np.einsum("ni,ij,nj->n", outline, np.linalg.inv(p), outline), 4.0, rtol=1e-9)


@pytest.mark.parametrize(("span", "parts", "step"), [(800.0, 8.0, 100.0), (1000.0, 7.0, 200.0), (3.0, 3.5, 1.0)])
def test_steps_are_round(span, parts, step):
    assert shapes.nice_step(span, parts) == pytest.approx(step)


# --- scenes ----------------------------------------------------------------------------------------------------------
def test_what_a_snapshot_shows():
    w = a_world()[0]
    detect(w, V, descriptor=state.DESCRIPTOR_FIXED, position=(3.0, 204.0))
    scene = scene_from_snapshot(w, ["own", "Nordlys"])
    assert len(scene.all(Polygon, "own_hull")) == len(scene.all(Polygon, "ship_hull")) == 1
    assert len(scene.all(Polygon, "iceberg")) == 1
    assert len(scene.all(Polygon, "shadow")) == 2
    assert [c.radius for c in scene.all(Circle, "ring_radar")] == [500.0]
    assert [c.radius for c in scene.all(Circle, "ring_lidar")] == [120.0]
    assert [c.radius for c in scene.all(Circle, "acceptance")] == [20.0]  # the start has none
    disc = scene.all(Circle, "detection")[0]
    assert disc.centre == (3.0, 204.0)
    assert disc.radius == 12.0
    texts = [label.lines for label in scene.all(Label)]
    assert ("WP01",) in texts
    assert ("T07 fixed",) in texts
    assert ("Nordlys", "not detected") in texts
    label = next(label for label in scene.all(Label) if label.lines == ("T07 fixed",))
    assert label.anchor == (0.0, 200.0)  # beside the true object


def test_a_vessel_is_detected_as_an_oblong_along_its_course():
    w = a_world()[0]
    detect(
        w, 1, descriptor=state.DESCRIPTOR_VESSEL, position=(300.0, 300.0), cog=1.5 * math.pi, sog=10 * KNOT, radius=30.0
    )
    scene = scene_from_snapshot(w, ["own", "Nordlys"])
    north, east = np.ptp(scene.all(Polygon, "detection")[0].points, axis=0)
    assert east == pytest.approx(60.0)
    assert north == pytest.approx(20.0)
    arrow = scene.all(Polyline, "detection_vector")[0]
    assert arrow.arrow
    np.testing.assert_allclose(arrow.points[-1] - arrow.points[0], (0.0, -600 * KNOT), atol=1e-9)
    assert ("T07 Nordlys", "vessel  270°  10.0 kn") in [label.lines for label in scene.all(Label)]


def test_target_table_by_hand():
    w = a_world()[0]
    # own goes north at 5 m/s, the target at (300, 300) west at 5 m/s: a collision in 60 s
    detect(w, 1, descriptor=state.DESCRIPTOR_VESSEL, position=(300.0, 300.0), cog=1.5 * math.pi, sog=5.0)
    detect(w, V, id=9, descriptor=state.DESCRIPTOR_FIXED, position=(100.0, -40.0), sensors=0b110)
    fixed, ship = scene_from_snapshot(w).panel.targets
    assert (fixed.id, fixed.type, fixed.sensors) == ("T09", "fixed", "RL")
    assert fixed.bearing == pytest.approx(math.degrees(math.atan2(-40.0, 100.0)) % 360.0)
    assert (fixed.cpa, fixed.tcpa) == (pytest.approx(40.0), pytest.approx(20.0))
    assert (ship.id, ship.type, ship.encounter, ship.sensors) == (
        "T07",
        "vessel",
        "give way",
        "AR",
    )  # it is to starboard
    assert (ship.bearing, ship.range) == (pytest.approx(45.0), pytest.approx(300.0 * math.sqrt(2.0)))
    assert (ship.cpa, ship.tcpa) == (pytest.approx(0.0, abs=1e-6), pytest.approx(60.0))


def test_a_vessel_of_unknown_motion_has_no_cpa():
    w = a_world()[0]
    detect(w, 1, descriptor=state.DESCRIPTOR_VESSEL, position=(300.0, 300.0), cog=np.nan, sog=np.nan, motion_known=0)
    row = scene_from_snapshot(w).panel.targets[0]
    assert math.isnan(row.cpa)
    assert math.isnan(row.tcpa)


def test_a_target_at_rest_relative_to_us_is_as_near_as_it_will_be():
    w = a_world()[0]
    w["vessels"]["velocity"][0] = 0.0
    detect(w, V, id=9, descriptor=state.DESCRIPTOR_FIXED, position=(100.0, -40.0), sensors=0b110)
    row = scene_from_snapshot(w).panel.targets[0]
    assert (row.cpa, row.tcpa) == (pytest.approx(math.hypot(100.0, 40.0)), 0.0)


@pytest.mark.parametrize(
    ("position", "cog_deg", "sog", "encounter"),
    [((600.0, 0.0), 180.0, 5.0, "head on"), ((300.0, -300.0), 90.0, 5.0, "stand on"), ((300.0, 0.0), 0.0, 2.0, "overtaking"),
     ((-300.0, 0.0), 0.0, 9.0, "overtaken"), ((300.0, 0.0), 0.0, 9.0, "")],
)  # fmt: skip
def test_the_table_names_the_encounter(position, cog_deg, sog, encounter):
    w = a_world()[0]
    detect(w, 1, descriptor=state.DESCRIPTOR_VESSEL, position=position, cog=math.radians(cog_deg), sog=sog)
    assert scene_from_snapshot(w).panel.targets[0].encounter == encounter


def test_gauges():
    w = a_world()[0]
    w["vessels"]["plant"][0] = 0
    w["plants"]["thrusters"][0] = 2
    w["plants"]["y"][0, :2], w["plants"]["command"][0, :2, 0] = (0.5, -0.5), (0.5, 0.72)
    w["vessels"]["eta"][0, 2] = math.radians(-0.02)
    values = dict(scene_from_snapshot(w).panel.gauges)
    assert values["HDG"] == "000.0°"
    assert values["SOG"] == "9.7 kn"
    assert values["THR P/S"] == "72 / 50 %"
    assert values["TRACKS"] == "0 / 2"
    assert values["CLOSEST"] == "180.0 m"


def test_history_gives_trails_and_plots_and_forgets():
    history = History(seconds=70.0)
    for second in range(101):
        scene = scene_from_snapshot(a_world(second * 20)[0], [], history)
    own = scene.all(Polyline, "track_own")[0].points
    assert own[0, 0] == pytest.approx(5.0 * 30.0)
    assert own[-1, 0] == pytest.approx(500.0)
    assert [len(d.points) for d in scene.all(Dots, "tick_own")] == [1]  # the minute at 60 s
    assert [p.title for p in scene.panel.plots] == ["Speed", "Heading", "Range to closest"]
    assert scene.panel.plots[0].series[0].values[-1] == pytest.approx(5.0 / KNOT)
    again = scene_from_snapshot(a_world(0)[0], [], history)  # the world was reset
    assert again.all(Polyline, "track_own") == []


def test_hidden_layers_are_left_out():
    assert scene_from_snapshot(a_world()[0], hide=("shadows",)).all(Polygon, "shadow") == []


def test_every_role_has_a_style():
    w = a_world()[0]
    detect(w, 1, descriptor=state.DESCRIPTOR_VESSEL, position=(300.0, 300.0), cog=1.0, sog=2.0)
    for k, kind in enumerate((state.KIND_BUOY, state.KIND_ISLET, state.KIND_LIGHTHOUSE, state.KIND_PLATFORM), start=1):
        m = w["obstacles"]
        m["active"][k], m["kind"][k], m["radius"][k], m["position"][k] = 1, kind, 8.0, (-50.0 * k, 90.0)
    w["ais"]["received"][0, 1] = 1
    w["ais"]["position"][1] = (301.0, 299.0)
    for scene in (scene_from_snapshot(w), scene_from_episode(an_episode())):
        assert {p.role for p in scene.all()} <= set(STYLES)
        render(scene, (300, 300))


def test_the_whole_episode():
    episode = an_episode()
    scene = scene_from_episode(episode)
    assert scene.all(Polyline, "track_own")[0].points.shape == (61, 2)
    assert scene.panel.status == ("t = 1:00", "two ships", "hold", "seed 4")
    assert len(scene.all(Dots, "detection_past")[0].points) == 61
    assert len(scene.all(Circle, "detection")) == 1
    # the iceberg, 20 m less than 200 m away at the start, is among the marked approaches
    assert ("180 m at 0:00",) in [label.lines for label in scene.all(Label, "label_cpa")]
    assert scene.all(Circle, "collision")  # the two ships meet at 60 s
    south, north, west, east = scene.extent
    assert south < 0.0 < 400.0 < north
    assert west < 0.0 < 200.0 < east


def test_an_episode_at_a_time():
    episode = an_episode()
    scene = scene_from_episode(episode, t=30.0)
    assert scene.all(Polygon, "own_hull")[0].anchor == (pytest.approx(150.0), 0.0)
    assert len(scene.all(Polyline, "track_own")[0].points) == 61  # the whole track
    assert scene.panel.plots[0].marker == 30.0
    with pytest.raises(ValueError, match="outside the episode"):
        scene_from_episode(episode, t=61.0)


def test_a_scene_needs_no_pygame():
    code = "import sys; import usv_gym.render.scene; assert 'pygame' not in sys.modules, 'scene must not import pygame'"
    subprocess.run([sys.executable, "-c", code], check=True)


# --- labels ----------------------------------------------------------------------------------------------------------
def overlaps(a: Any, b: Any) -> bool:
    return bool(a[0] < b[2] and b[0] < a[2] and a[1] < b[3] and b[1] < a[3])


@pytest.mark.parametrize("seed", range(5))
def test_labels_neither_overlap_nor_leave_the_frame(seed):
    rng = np.random.default_rng(seed)
    frame, wall = (0.0, 0.0, 400.0, 300.0), (0.0, 250.0, 120.0, 300.0)
    requests = [
        Request((float(rng.uniform(20, 110)), 14.0), (float(x), float(y)), 5.0, float(k % 3), fixed=k % 7 == 0)
        for k, (x, y) in enumerate(rng.uniform((0, 0), (400, 300), (60, 2)))
    ]
    placed = [p.box for p in place(requests, frame, [wall]) if p is not None]
    assert len(placed) > 15
    for i, box in enumerate(placed):
        assert box[0] >= 0.0
        assert box[1] >= 0.0
        assert box[2] <= 400.0
        assert box[3] <= 300.0
        assert not overlaps(box, wall)
        assert not any(overlaps(box, other) for other in placed[:i])


def test_a_lonely_label_stands_to_the_right_and_a_crowded_one_gets_a_leader():
    lonely = place([Request((50.0, 12.0), (100.0, 100.0), 5.0)], (0.0, 0.0, 400.0, 300.0))[0]
    assert lonely is not None
    assert lonely.leader is None
    assert lonely.box[0] > 105.0
    crowd = place([Request((90.0, 40.0), (200.0, 150.0), 5.0)] * 8, (0.0, 0.0, 400.0, 300.0))
    assert any(p is not None and p.leader is not None for p in crowd)


def test_the_important_label_wins():
    requests = [Request((80.0, 12.0), (50.0, 50.0), priority=p) for p in (0.0, 1.0)]
    placed = place(requests, (44.0, 40.0, 140.0, 60.0))
    assert placed[0] is None
    assert placed[1] is not None


# --- pictures --------------------------------------------------------------------------------------------------------
@pytest.mark.parametrize("palette", PALETTES)
def test_each_palette_renders(palette):
    image = render(scene_from_episode(an_episode()), palette=palette)
    assert image.shape == (800, 1180, 3)
    assert image.dtype == np.uint8
    assert len(np.unique(image.astype(np.int32) @ (65536, 256, 1))) > 50
    mean = {"day": (180, 240), "dark": (5, 60), "night": (2, 30)}[palette]
    assert mean[0] < image.mean() < mean[1]


def test_a_target_changes_the_picture_where_it_is():
    w = a_world()[0]
    size, view = (400, 400), View(0.0, 0.0, 0.5)
    before = render(scene_from_snapshot(w), size, view=view)
    np.testing.assert_array_equal(before, render(scene_from_snapshot(w), size, view=view))  # deterministic
    detect(w, V, descriptor=state.DESCRIPTOR_FIXED, position=(0.0, 200.0), radius=30.0)
    changed = (render(scene_from_snapshot(w), size, view=view) != before).any(axis=2)
    assert changed[200 - 20 : 200 + 20, 300 - 20 : 300 + 20].any()
    assert not changed[:, :100].any()


def test_a_picture_does_not_depend_on_what_was_drawn_before():
    first, other = scene_from_episode(an_episode()), scene_from_snapshot(a_world(200)[0])
    once = render(first, (700, 500))
    for size, palette in (((700, 500), "night"), ((500, 700), "dark"), ((700, 500), "dark")):
        render(other, size, palette)
    canvas.text_surface.cache_clear()
    np.testing.assert_array_equal(render(first, (700, 500)), once)


@pytest.mark.parametrize("seed", range(3))
def test_areas_are_filled_where_they_are(seed):
    rng = np.random.default_rng(seed)
    y, x = np.mgrid[:80, :90] + 0.5
    centres = rng.integers(-10, 100, (12, 2)).astype(np.int32)
    pixels = np.zeros((80, 90), np.uint32)
    trace.flood(pixels, centres, np.array([0, 5, 12], np.int32), 13.0, np.uint32(7))
    inside = np.hypot(x[..., None] - centres[:, 0], y[..., None] - centres[:, 1])
    expected = (inside <= 13.0).any(axis=-1)
    sure = (np.abs(inside - 13.0) > 0.01).all(axis=-1)
    np.testing.assert_array_equal((pixels == 7)[sure], expected[sure])

    corners = rng.integers(-30, 120, (9, 2)).astype(np.int32)  # three triangles, all over each other
    triangles = corners.reshape(3, 3, 2, 1, 1).astype(float)
    ahead = np.roll(triangles, -1, axis=1) - triangles
    sides = ahead[:, :, 0] * (y - triangles[:, :, 1]) - ahead[:, :, 1] * (x - triangles[:, :, 0])  # [3, 3, 80, 90]
    expected = (sides > 0.0).all(axis=1) | (sides < 0.0).all(axis=1)
    sure = (np.abs(sides) > 1e-6).all(axis=(0, 1))  # no middle of a pixel on a side
    pixels[:] = 0
    trace.flood(pixels, corners, np.array([0, 3, 6, 9], np.int32), 0.0, np.uint32(7))
    np.testing.assert_array_equal((pixels == 7)[sure], expected.any(axis=0)[sure])
    pixels[:] = 0x204060
    trace.blend(pixels, corners[:3], np.uint32(0xE0C0A0), 64)
    assert set(np.unique(pixels)) <= {0x204060, 0x506070}  # a quarter of the way
    np.testing.assert_array_equal((pixels == 0x506070)[sure], expected[0][sure])


def test_an_outline_is_clipped_and_a_line_that_is_out_of_sight_is_left_out():
    square = np.array([(-50.0, 10.0), (50.0, 10.0), (50.0, 90.0), (-50.0, 90.0)])
    far = np.array([(200.0, 0.0), (300.0, 50.0)])
    shapes, none = (square, far), np.zeros(2)
    corners, start, *_ = trace.trace(
        np.concatenate(shapes), np.array([0, 4, 6]), np.array([trace.AREA, trace.LINE]), none != 0, none != 0, none, none,
        (0.0, 0.0, 100.0, 50.0), 2.0,
    )  # fmt: skip
    assert start.tolist() == [0, 4, 4]
    assert {tuple(c) for c in corners.tolist()} == {(0, 20), (100, 20), (100, 100), (0, 100)}


@pytest.mark.parametrize("size", [(64, 64), (84, 84), (300, 120), (1180, 400), (1600, 1200)])
def test_any_size(size):
    image = render(scene_from_episode(an_episode()), size)
    assert image.shape == (size[1], size[0], 3)


def test_zoomed_far_in_and_out():
    scene = scene_from_episode(an_episode())
    for scale in (1e-4, 1e-2, 10.0, 1000.0):
        render(scene, (300, 200), view=View(100.0, 20.0, scale))


def test_an_empty_sea():
    w = np.zeros(1, state.world_dtype(V, M))[0]
    w["vessels"]["active"][0], w["vessels"]["length"][0], w["vessels"]["beam"][0] = 1, 10.0, 3.0
    w["vessels"]["plant"] = -1
    render(scene_from_snapshot(w))


def test_png(tmp_path):
    pygame = canvas.load_pygame()
    image = render(scene_from_snapshot(a_world()[0]), (200, 100))
    save_png(image, tmp_path / "map.png")
    back = pygame.surfarray.array3d(pygame.image.load(tmp_path / "map.png")).swapaxes(0, 1)
    np.testing.assert_array_equal(back, image)
    assert [p.name for p in tmp_path.iterdir()] == ["map.png"]


def test_bad_arguments():
    scene = scene_from_snapshot(a_world()[0])
    with pytest.raises(ValueError, match="palette"):
        render(scene, palette="noon")
    with pytest.raises(ValueError, match="positive"):
        render(scene, (0, 10))


def test_without_pygame_the_error_says_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "pygame", None)
    canvas.load_pygame.cache_clear()
    try:
        with pytest.raises(DependencyNotInstalled, match="pip install pygame-ce"):
            canvas.load_pygame()
    finally:
        canvas.load_pygame.cache_clear()
