"""Land as kernels see it, against shapely: grounding, rays, the nearest shore; and land in an episode."""

from __future__ import annotations

import gymnasium as gym
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from land_helpers import BOSTON, HORTEN, OSLOFJORD, hull_distances, inside, ray_ranges, sector_ranges, shapes, square

from usv_gym.scenarios.land import scenario_coast
from usv_gym.scenarios.loader import load_scenario
from usv_gym.world.geometry import BOW_TAPER
from usv_gym.world.land import Polygon, land_pool
from usv_gym.world.vessel import load_vessel

shapely = pytest.importorskip("shapely")
BAND = 1e-6  #: [m] around the shore in which rounding decides
PLACES = {"horten": HORTEN, "oslofjord": OSLOFJORD, "boston": BOSTON}


@pytest.fixture(scope="module")
def place(data):
    """(polygons, the same in shapely, pool) of a real place."""
    known = {}

    def get(name):
        if name not in known:
            file, (latitude, longitude), keys = PLACES[name]
            origin = {"latitude_deg": latitude, "longitude_deg": longitude}
            start = {"boston": [0.0, 3000.0]}.get(name, [0.0, 0.0])
            scenario = load_scenario(
                {"origin": origin, "land": {"files": str(data / file), **keys}, "own_ship": {"position": start}}
            )
            polygons = scenario_coast(scenario, load_vessel("odin"))
            known[name] = polygons, shapes(polygons), land_pool((polygons,))
        return known[name]

    return get


def hulls(poses, length, beam):
    """The hulls at poses [n, 3] in shapely: the pentagon of world/geometry.py."""
    shoulder, stern, half = length / 2 - BOW_TAPER * length, -length / 2, beam / 2
    corners = np.array([(length / 2, 0), (shoulder, half), (stern, half), (stern, -half), (shoulder, -half)])
    c, s = np.cos(poses[:, 2, None]), np.sin(poses[:, 2, None])
    north = poses[:, :1] + c * corners[:, 0] - s * corners[:, 1]
    east = poses[:, 1:2] + s * corners[:, 0] + c * corners[:, 1]
    return shapely.polygons(np.stack([north, east], axis=-1))


def poses_near(land, n, rng, spread):
    """Random poses, most of them along the shore."""
    shore = shapely.boundary(land)
    along = shapely.line_interpolate_point(shore, rng.uniform(0, 1, n), normalized=True)
    places = shapely.get_coordinates(along) + rng.normal(0.0, spread, (n, 2))
    low, high = np.split(np.array(land.bounds), 2)
    far = rng.random(n) < 0.3
    places[far] = rng.uniform(low - 500.0, high + 500.0, (far.sum(), 2))
    return np.column_stack([places, rng.uniform(-4.0, 4.0, n)])


def check_grounding(land, pool, n, rng):
    shapely.prepare(land)
    for length, beam in ((6.0, 2.5), (120.0, 20.0)):
        poses = poses_near(land, n // 2, rng, length)
        ours = hull_distances(pool, poses, length, beam) == 0.0
        bodies = hulls(poses, length, beam)
        theirs = shapely.intersects(land, bodies)
        differ = np.flatnonzero(ours != theirs)
        # within the band the hull, shrunk or grown by as much, decides otherwise
        for k in differ:
            assert shapely.distance(bodies[k], land) < BAND or not shapely.intersects(land, bodies[k].buffer(-BAND))
        assert theirs.any()
        assert not theirs.all()


@pytest.mark.parametrize("name", PLACES)
def test_grounding_is_that_of_shapely(place, name):
    _, land, pool = place(name)
    check_grounding(land, pool, 20_000, np.random.default_rng(1))


@pytest.mark.slow
@pytest.mark.parametrize("name", PLACES)
def test_grounding_is_that_of_shapely_at_100_000_poses(place, name):
    _, land, pool = place(name)
    check_grounding(land, pool, 100_000, np.random.default_rng(2))


@pytest.mark.parametrize("name", PLACES)
def test_distances_are_exact_near_land_and_close_beyond(place, name):
    _, land, pool = place(name)
    poses = poses_near(land, 3000, np.random.default_rng(3), 60.0)
    ours, true = hull_distances(pool, poses, 30.0, 6.0), shapely.distance(hulls(poses, 30.0, 6.0), land)
    near = true < 100.0
    assert near.sum() > 1000
    np.testing.assert_allclose(ours[near], true[near], atol=1e-9)
    # beyond, the piece that is nearest to the middle of the cell stands for the shore: off by less than the cell is wide
    cell = pool[int(pool[1]) + 2]
    assert (ours[~near] > true[~near] - 1e-9).all()
    low, high = np.split(np.array(land.bounds), 2)
    within = ~near & (poses[:, :2] >= low).all(axis=1) & (poses[:, :2] <= high).all(axis=1)
    assert (ours[within] - true[within]).max() < 1.5 * cell


@pytest.mark.parametrize("name", PLACES)
def test_rays_meet_land_where_all_edges_say(place, name):
    polygons, land, pool = place(name)
    rng = np.random.default_rng(4)
    places = poses_near(land, 400, rng, 300.0)[:, :2]
    places = places[~shapely.contains_xy(land, places)]
    bearings = rng.uniform(-np.pi, np.pi, len(places))
    reach = 1852.0
    edges = np.concatenate([np.hstack([r, np.roll(r, -1, axis=0)]) for p in polygons for r in p.rings])
    ours = ray_ranges(pool, places, bearings, reach)
    for place_, bearing, found in zip(places, bearings, ours, strict=True):
        d = np.array([np.cos(bearing), np.sin(bearing)])
        a, b = edges[:, :2] - place_, edges[:, 2:] - place_
        off_a, off_b = a @ (-d[1], d[0]), b @ (-d[1], d[0])
        cut = (off_a >= 0) != (off_b >= 0)
        share = off_a[cut] / (off_a[cut] - off_b[cut])
        along = (a[cut] + share[:, None] * (b[cut] - a[cut])) @ d
        assert found == pytest.approx(min(along[along >= 0], default=reach) if (along >= 0).any() else reach, abs=1e-6) or (
            found == reach and min(along[along >= 0]) >= reach
        )
    assert (ours < reach).mean() > 0.3


@pytest.mark.parametrize("reach", [100.0, 1000.0, 6000.0], ids=["lidar", "in between", "radar"])
@pytest.mark.parametrize("name", ["horten", "boston"])
def test_the_nearest_land_of_a_sector_is_that_of_shapely(place, name, reach):
    _, land, pool = place(name)
    places = poses_near(land, 60, np.random.default_rng(5), 200.0)[:, :2]
    places = places[~shapely.contains_xy(land, places)][:25]
    ours = sector_ranges(pool, places, reach)
    borders = np.arange(73) * np.pi / 36
    rays = np.column_stack([np.cos(borders), np.sin(borders)])
    for k, here in enumerate(places):
        wedges = shapely.polygons([[here, here + 2.0 * reach * rays[i], here + 2.0 * reach * rays[i + 1]] for i in range(72)])
        true = shapely.distance(shapely.Point(here), shapely.intersection(wedges, land))
        true[~(true <= reach)] = np.nan  # what is empty is NaN
        np.testing.assert_allclose(ours[k], true, atol=1e-7)


@settings(max_examples=30, deadline=None)
@given(st.floats(-300, 300), st.floats(-300, 300), st.floats(-2000, 2000), st.floats(-2000, 2000))
def test_moving_everything_changes_nothing(n, e, dn, de):
    lake = np.array([[-20.0, -20.0], [-20.0, 20.0], [20.0, 20.0], [20.0, -20.0]])
    rings = square(0, 0, 100).shell, lake
    there = land_pool(((Polygon(rings[0], (rings[1],)),),))
    moved = land_pool(((Polygon(rings[0] + (dn, de), (rings[1] + (dn, de),)),),))
    a = hull_distances(there, np.array([[n, e, 0.3]]), 5.0, 2.0, 1e4)
    b = hull_distances(moved, np.array([[n + dn, e + de, 0.3]]), 5.0, 2.0, 1e4)
    assert a == pytest.approx(b, abs=1e-6)


def test_lakes_are_water_and_islands_in_them_are_land():
    lake = square(0, 0, 100)
    coast = (Polygon(square(0, 0, 200).shell, (lake.shell,)), square(0, 0, 30))
    places = np.array([[0.0, 0.0], [60.0, 0.0], [150.0, 150.0], [250.0, 0.0], [1e6, 0.0]])
    assert inside(land_pool((coast,)), places).tolist() == [True, False, True, False, False]


# --- in an episode ---------------------------------------------------------------------------------------------------
AHEAD = np.array([1.0, 0.0], np.float32)
QUIET = {key: {"rate": 10.0} for key in ("gnss", "mru", "imu", "speed_log", "wind")}


def sea(polygons, **keys):
    """A scenario with land given by corners, on a tick of 0.1 s."""
    return {
        "name": "islands",
        "simulation": {"dt": 0.1, "traffic_interval": 0.5, **keys.pop("simulation", {})},
        "sensors": {"base": "perfect", "navigation": QUIET, **keys.pop("sensors", {})},
        "land": {"polygons": polygons, **keys.pop("land", {})},
        **keys,
    }


def make(polygons, own=None, env=None, **keys):
    own = {"route": [[1000, 0]], "speed": 5.0, **(own or {})}
    scenario = sea(polygons, own_ship=own, **keys)
    return gym.make("usv_gym/Scenario-v0", scenario=scenario, disable_env_checker=True, **(env or {}))


def corners(n, e, half_n, half_e):
    return [[n - half_n, e - half_e], [n - half_n, e + half_e], [n + half_n, e + half_e], [n + half_n, e - half_e]]


def record(env):
    return env.unwrapped.core.worlds[0]


def test_running_aground_ends_the_episode():
    env = make([corners(150, 0, 20, 200)])
    env.reset(seed=0)
    for _ in range(60):
        _, _, terminated, _, info = env.step(AHEAD)
        if terminated:
            break
    assert (info["outcome"], info["reward_terms"]["grounding"], info["closest"]) == ("grounding", -1.0, 0.0)
    bow = record(env)["vessels"]["eta"][0, 0] + load_vessel("odin").length / 2
    assert bow == pytest.approx(130.0, abs=5.0)  # it ends with the frame in which the bow touched


def test_nothing_tunnels_through_a_breakwater():
    """2 cm of stone, frames in which the vessel moves 20 m: its hull is on either side at both ends."""
    env = make([corners(75, 0, 0.01, 200)], own={"speed": 10.0}, simulation={"traffic_interval": 2.0}, land={"simplify": 0.0})
    env.reset(seed=0)
    for _ in range(30):
        _, _, terminated, _, info = env.step(AHEAD)
        if terminated:
            break
    assert info["outcome"] == "grounding"


def test_without_errors_the_picture_is_the_coast():
    env = make([corners(200, 300, 50, 40), corners(-400, 0, 30, 500)], own={"speed": 0.0}, sensors={"base": "perfect"},
               env={"land_sectors": 72})  # fmt: skip
    env.reset(seed=0)
    for _ in range(5):
        observation, *_ = env.step(0 * AHEAD)
    w = record(env)
    pool, here = env.unwrapped.core.land, w["vessels"]["eta"][:1, :2]
    true = sector_ranges(pool, here, 1852.0)[0]
    seen = np.hypot(*(w["picture"]["land"][0] - here[0]).T)
    charted = np.hypot(*(w["picture"]["chart"][0] - here[0]).T)
    assert np.isfinite(true).sum() > 20
    np.testing.assert_array_equal(np.isfinite(seen), np.isfinite(true))
    np.testing.assert_allclose(seen, true, rtol=0.003)  # 1 sigma of the set `perfect` is 0.05 % of the range
    np.testing.assert_allclose(charted, true, atol=1.0)  # from the measured position
    land = observation[-144:].reshape(2, 72)
    heading = w["nav"]["mru_heading"][0]
    for k in np.flatnonzero(np.isfinite(seen)):
        n, e = w["picture"]["land"][0, k] - w["nav"]["position"][0]
        i = int(((np.arctan2(e, n) - heading) % (2 * np.pi)) * 72 / (2 * np.pi))
        assert land[0, i] >= 1.0 - np.hypot(n, e) / 1852.0 - 1e-3
    targets = w["picture"]["descriptor"][0][w["picture"]["id"][0] > 0]
    assert targets.tolist() == [2, 2]  # two stretches of coast


def echoes(**keys):
    """Ranges [72] that the picture has of land, after some seconds at rest."""
    env = make(keys.pop("polygons", [corners(300, 0, 50, 400)]), own={"speed": 0.0}, **keys)
    env.reset(seed=3)
    for _ in range(5):
        env.step(0 * AHEAD)
    w = record(env)
    return np.hypot(*(w["picture"]["land"][0] - w["nav"]["position"][0]).T)


def test_objects_hide_land_and_weather_shortens_the_sight():
    ahead = [0, 71]  # the sectors to either side of north
    free = echoes()
    assert (free[ahead] < 260).all()
    berg = {"obstacles": {"berg": {"position": [100, 0], "radius": 30.0}}}
    assert np.isnan(echoes(**berg)[ahead]).all()
    assert np.isfinite(echoes(**berg)[6])
    fog = {"weather": {"visibility": {"radar_range": 0.1, "lidar_range": 0.1}}}
    assert np.isnan(echoes(**fog)).all()
    assert np.nanmin(echoes(weather={"visibility": {"radar_range": 0.15}})) == pytest.approx(250, rel=0.01)


def test_land_hides_ships_from_radar_but_not_from_ais():
    ship = {"ships": {"ferry": {"waypoints": [[600, 0], [600, 10]], "speed": 0.0, "length": 20.0}}}
    for polygons, sensors in (([corners(300, 0, 50, 400)], 1), ([corners(300, 300, 50, 100)], 3)):
        env = make(polygons, own={"speed": 0.0}, **ship)
        env.reset(seed=0)
        for _ in range(8):
            env.step(0 * AHEAD)
        assert record(env)["picture"]["sensors"][0, 1] == sensors


def test_the_land_of_the_picture_is_what_sensors_and_chart_gave():
    """Truth is poisoned, the polygons taken away: the observation stays what it was."""
    from test_determinism import poison

    for observation in ("tracks", "ais", "sectors"):
        env = make([corners(200, 0, 50, 400)], env={"observation": observation}, sensors={"base": "thesis"})
        env.reset(seed=0)
        for _ in range(5):
            env.step(AHEAD)
        core = env.unwrapped.core
        before = core.obs.copy()
        assert before[0, -72:-36].any()
        assert before[0, -36:].any()
        poison(core.worlds)
        core.worlds["tracks"]["land"] = np.nan
        after = core.observe()
        assert np.isfinite(after).all()
        assert after.tobytes() == before.tobytes()


def test_without_a_chart_only_the_sensors_know():
    env = make([corners(300, 0, 50, 400)], land={"chart": False})
    observation, _ = env.reset(seed=0)
    for _ in range(3):
        observation, *_ = env.step(AHEAD)
    assert observation[-72:-36].any()
    assert not observation[-36:].any()


def test_a_silent_radar_forgets_the_coast():
    env = make([corners(500, 0, 50, 800)], own={"speed": 0.0})
    env.reset(seed=0)
    for _ in range(4):
        env.step(0 * AHEAD)
    w = record(env)
    assert np.isfinite(w["picture"]["land"]).any()
    w["sensors"]["radar"]["outage"] = 1
    for _ in range(5):  # its timeout is 3.1 s
        env.step(0 * AHEAD)
    assert np.isnan(w["picture"]["land"]).all()
    assert not (w["picture"]["id"][0] > 0).any()


def test_a_stretch_of_coast_keeps_its_id_along_the_way():
    env = make([corners(0, 150, 2000, 50)], own={"route": [[3000, 0]]})
    env.reset(seed=0)
    ids = set()
    for _ in range(60):
        env.step(AHEAD)
        picture = record(env)["picture"]
        ids |= set(picture["id"][0][picture["id"][0] > 0].tolist())
    assert ids == {1}


def test_the_part_land_comes_with_land_or_when_asked_for():
    assert make([corners(300, 0, 50, 400)]).observation_space.shape == (12 + 8 * 9 + 2 * 36,)
    assert make([corners(300, 0, 50, 400)], env={"land": False}).observation_space.shape == (12 + 8 * 9,)
    env = gym.make("usv_gym/OpenSea-v0", land=True, land_sectors=24, flat=False)
    observation, _ = env.reset(seed=0)
    assert observation["land"].shape == observation["chart"].shape == (24,)
    assert not observation["land"].any()
