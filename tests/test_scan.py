"""Radar and LiDAR: what a scan measures, how well, and what it cannot."""

from __future__ import annotations

import math

import numpy as np
import pytest
from sensor_helpers import NO_NOISE, V, advance, by_source, check_error, sea, watch

from usv_gym.units import DEG, KNOT
from usv_gym.world.state import LIDAR, RADAR

TICK = 0.05
ROTATION = 1.25  # s at 48 rpm
R, L = RADAR - 1, LIDAR - 1


def discs(*places, radius=5.0):
    """Icebergs at (range [m], bearing [deg]) from the own ship at the origin."""
    return {
        f"berg_{i}": {"radius": radius, "position": [r * math.cos(b * DEG), r * math.sin(b * DEG)]}
        for i, (r, b) in enumerate(places)
    }


def scanned(worlds, k, source):
    """Whether the last scan measured the source, by world."""
    t = worlds["tracks"]
    return (t["measured_us"][:, 0, k, source] == t["scan_us"][:, 0, k]) & (t["scan_us"][:, 0, k] > 0)


# --- where it looks --------------------------------------------------------------------------------------------------
def test_range_and_minimum_range():
    worlds, _ = sea(obstacles=discs((30, 0), (60, 40), (62, 90), (99, 130), (101, 180), (1851, 220), (1853, 270)))
    advance(worlds, 5.0)
    assert [bool(scanned(worlds, R, V + i)[0]) for i in range(7)] == [False, False, True, True, True, True, False]
    assert [bool(scanned(worlds, L, V + i)[0]) for i in range(7)] == [True, True, True, True, False, False, False]
    # the radar has a line of sight to what is too near for it
    assert worlds["tracks"]["visible"][0, 0, R, V : V + 7].tolist() == [1, 1, 1, 1, 1, 1, 0]


def test_fog_and_rain_take_their_share_of_the_range():
    weather = {"visibility": {"radar_range": 0.5, "lidar_range": 0.2}}
    worlds, _ = sea(obstacles=discs((19, 0), (21, 90), (900, 180), (950, 270)), weather=weather)
    advance(worlds, 5.0)
    assert [bool(scanned(worlds, L, V + i)[0]) for i in range(2)] == [True, False]
    assert [bool(scanned(worlds, R, V + i)[0]) for i in range(2, 4)] == [True, False]


@pytest.mark.parametrize("rpm", [24, 36, 48])
def test_radar_scans_once_per_revolution(rpm):
    worlds, _ = sea(obstacles=discs((500, 0)), sensors={"radar": {"rpm": rpm}})
    (stamp,) = watch(worlds, 60.0 + TICK, TICK, "tracks.scan_us")
    stamps = np.unique(stamp[:, 0, 0, R])[1:] * 1e-6
    assert len(stamps) == rpm
    late = stamps - 60.0 / rpm * np.arange(1, rpm + 1)
    assert late.min() > -1e-9
    assert late.max() < TICK + 1e-9  # the period is kept in whole microseconds, and a tick is the first at or after it


@pytest.mark.parametrize("rate", [5.0, 10.0, 20.0])
def test_lidar_sweeps_at_its_rate(rate):
    worlds, _ = sea(obstacles=discs((50, 0)), sensors={"lidar": {"rate": rate}})
    (stamp,) = watch(worlds, 10.0, TICK, "tracks.scan_us")
    assert np.allclose(np.diff(np.unique(stamp[:, 0, 0, L])[1:]), 1e6 / rate)


def test_a_scan_sees_the_world_of_its_own_tick():
    """Traffic decides twice a second, a scan in between still measures where the ship is then."""
    ferry = {"speed_kn": 30, "waypoints": [[300, -500], [300, 5000]], "ais": "off"}
    worlds, _ = sea(ships={"ferry": ferry}, simulation={"traffic_interval": 0.5}, **NO_NOISE)
    measured, stamp = watch(worlds, 20.0, 0.25, "tracks.filters.measured", "tracks.measured_us")
    t = stamp[:, 0, 0, R, 1] * 1e-6
    measured = by_source(measured)[t > 0, 0, 0, R, 1]
    assert len(set(t)) > 10
    np.testing.assert_allclose(measured[:, 0], 300.0, atol=1e-6)
    np.testing.assert_allclose(measured[:, 1], -500.0 + 30 * KNOT * t[t > 0], atol=1e-6)


def test_nothing_is_measured_through_a_shadow():
    """A disc behind a larger one is hidden; one that sticks out, one behind a smaller and the larger itself are not."""
    worlds, _ = sea(
        obstacles=discs((200, 0), radius=30)
        | {"behind": {"radius": 5, "position": [400, 0]}}
        | {"sticks_out": {"radius": 5, "position": [400, 58]}}
        | {"larger": {"radius": 120, "position": [600, 0]}}
    )  # fmt: skip
    advance(worlds, 60.0)
    assert worlds["tracks"]["visible"][0, 0, R, V : V + 4].tolist() == [1, 0, 1, 1]
    assert worlds["tracks"]["measured_us"][0, 0, R, V + 1] == 0
    assert worlds["picture"]["id"][0, 0, V + 1] == 0
    assert all(scanned(worlds, R, V + i)[0] for i in (0, 2, 3))


def test_the_lidar_has_shadows_too():
    worlds, _ = sea(obstacles=discs((50, 0), radius=10) | {"behind": {"radius": 5, "position": [90, 0]}})
    advance(worlds, 5.0)
    assert worlds["tracks"]["visible"][0, 0, L, V : V + 2].tolist() == [1, 0]
    assert worlds["picture"]["id"][0, 0, V + 1] == 0


# --- how well it measures --------------------------------------------------------------------------------------------
def thesis_variances(k):
    """White and stationary bias variance of position [m2 per axis] and radius [m2] at 100 m, and bias times [s]."""
    if k == R:
        return (10.0, 0.5 * 10 / 2, 10.0), (20.0, 3.0 * 5 / 2, 5.0)
    return (0.1, 0.1 * 0.1 / 2, 0.1), (0.1, 0.1 * 1 / 2, 1.0)


@pytest.mark.parametrize(
    ("k", "interval", "ranges"), [(R, ROTATION, (100.0, 400.0, 1600.0)), (L, 0.1, (20.0, 50.0, 95.0))]
)
def test_errors_grow_with_distance(k, interval, ranges):
    """Raw measurements: error = d / 100 m times (drifting bias + white noise) of the thesis, per axis and for the radius."""
    radius = 15.0  # large enough for its floor of 2 m not to matter: 15 - 5 sigma at the largest f(d) of the LiDAR
    places = [(r, 120 * i) for i, r in enumerate(ranges)]
    worlds, _ = sea(64, obstacles=discs(*places, radius=radius if k == L else 500.0 / 3))
    radius = worlds["obstacles"]["radius"][0, 0]
    if k == R:  # the discs would touch the boat; only what they show matters here
        worlds["safety"]["collided_with"] = -1
    measured, stamp = watch(worlds, 400 * interval, interval, "tracks.filters.measured", "tracks.measured_us")
    measured = by_source(measured)
    assert np.all(np.diff(stamp[:, :, 0, k, V : V + 3], axis=0) == round(interval * 1e6))
    truth = worlds["obstacles"]["position"][0, :3]
    (white, bias, time), (white_r, bias_r, time_r) = thesis_variances(k)
    for i, d in enumerate(ranges):
        f = 0.01 * d
        error = (measured[:, :, 0, k, V + i, :2] - truth[i]) / f
        check_error(error, math.sqrt(white), math.sqrt(bias), math.exp(-interval / time))
        error = (measured[:, :, 0, k, V + i, 2] - radius) / f
        if k == L or d <= 1000.0:  # a radius of 167 m and a spread of 84 m do reach the floor of 2 m
            check_error(error, math.sqrt(white_r), math.sqrt(bias_r), math.exp(-interval / time_r))


def test_errors_of_different_targets_and_axes_are_independent():
    worlds, _ = sea(500, obstacles=discs((100, 0), (100, 120), (100, 240)))
    advance(worlds, ROTATION)
    error = by_source(worlds["tracks"]["filters"]["measured"])[:, 0, R, V : V + 3, :2] - worlds["obstacles"]["position"][0, :3]
    correlation = np.corrcoef(error.reshape(500, 6).T)
    assert np.abs(correlation - np.eye(6)).max() < 4 / math.sqrt(500)


def test_the_tracker_is_told_the_factor_of_the_measured_range():
    worlds, _ = sea(20, obstacles=discs((1000, 0), (1, 120), radius=0.5))
    advance(worlds, ROTATION)
    measured = by_source(worlds["tracks"]["filters"]["measured"])[:, 0]
    np.testing.assert_allclose(measured[:, R, V, 3], 0.01 * np.hypot(measured[:, R, V, 0], measured[:, R, V, 1]))
    assert np.ptp(measured[:, R, V, 3]) > 0.1  # a true range would always be the same
    assert np.all(measured[:, L, V + 1, 3] == 0.05)  # the floor


def test_own_navigation_errors_enter():
    """A scan is relative to the boat and reported at the place where the boat believes to be."""
    worlds, _ = sea(obstacles=discs((100, 30)), **NO_NOISE)
    worlds["sensors"]["gnss_drift"] = 5.0, -3.0
    advance(worlds, 10.0)
    shift = by_source(worlds["tracks"]["filters"]["measured"])[0, 0, R, V, :2] - worlds["obstacles"]["position"][0, 0]
    np.testing.assert_allclose(shift, [5.0, -3.0], atol=1e-9)
    navigation = {"gnss": {"position_std": 2.0}}
    worlds, _ = sea(200, obstacles=discs((100, 30)), sensors={"navigation": navigation})
    (measured,) = watch(worlds, 50 * ROTATION, ROTATION, "tracks.filters.measured")
    error = by_source(measured)[:, :, 0, R, V, :2] - worlds["obstacles"]["position"][0, 0]
    check_error(error, 2.0, 0.0, 0.0)


# --- what it misses --------------------------------------------------------------------------------------------------
def test_detection_probability_grows_with_apparent_size():
    radar = {"detection": 0.9, "detection_radius": 2.0}
    sloop = {"length": 20, "beam": 4, "speed_kn": 0, "ais": "off"}
    ships = {
        "bow_on": sloop | {"waypoints": [[0, 700], [0, 800]]},  # shows 2 m to either side
        "beam_on": sloop | {"waypoints": [[500, 500], [400, 600]]},  # shows 10 m
    }
    radii = (0.5, 2.0, 8.0)
    bergs = {}
    for i, radius in enumerate(radii):
        bergs |= {f"berg_{i}": {"radius": radius, "position": [-500, 300 * (i - 1)]}}
    worlds, _ = sea(50, ships=ships, obstacles=bergs, sensors={"radar": radar})
    scans = 200
    measured, scan = watch(worlds, scans * ROTATION, ROTATION, "tracks.measured_us", "tracks.scan_us")
    hit = (measured[:, :, 0, R] == scan[:, :, 0, R, None]).mean(axis=(0, 1))
    for source, shown in ((1, 2.0), (2, 10.0), *((V + i, radius) for i, radius in enumerate(radii))):
        p = 0.9 * shown**2 / (shown**2 + 4.0)
        assert hit[source] == pytest.approx(p, abs=4 * math.sqrt(p * (1 - p) / (50 * scans))), source


def test_weather_lowers_the_probability_of_detection():
    worlds, _ = sea(100, obstacles=discs((500, 0)), weather={"visibility": {"detection": 0.6}})
    measured, scan = watch(worlds, 100 * ROTATION, ROTATION, "tracks.measured_us", "tracks.scan_us")
    hit = (measured[:, :, 0, R, V] == scan[:, :, 0, R]).mean()
    assert hit == pytest.approx(0.6, abs=4 * math.sqrt(0.24 / 10_000))


@pytest.mark.parametrize(("name", "k", "distance"), [("radar", R, 500), ("lidar", L, 50)])
def test_outage(name, k, distance):
    worlds, _ = sea(obstacles=discs((distance, 0)), **NO_NOISE)
    advance(worlds, 10.0)
    stamp = int(worlds["tracks"]["measured_us"][0, 0, k, V])
    first = int(worlds["picture"]["id"][0, 0, V])
    assert stamp > 0
    assert first > 0
    worlds["sensors"][name]["outage"] = 1
    advance(worlds, 10.0)
    assert worlds["tracks"]["measured_us"][0, 0, k, V] == stamp
    assert worlds["tracks"]["visible"][0, 0, k, V] == 0
    assert worlds["picture"]["id"][0, 0, V] == 0
    worlds["sensors"][name]["outage"] = 0
    advance(worlds, 10.0)
    assert worlds["tracks"]["measured_us"][0, 0, k, V] > stamp
    assert worlds["picture"]["id"][0, 0, V] > first


# --- latency ---------------------------------------------------------------------------------------------------------
@pytest.mark.parametrize(("latency", "arrives"), [(0.0, 0.0), (0.5, 0.5), (1.2, 1.2), (1.25, 1.25), (3.0, 1.25)])
def test_a_scan_arrives_after_its_latency_stamped_with_its_own_time(latency, arrives):
    """One scan can be under way: what takes longer arrives just before the next one is made."""
    worlds, _ = sea(obstacles=discs((500, 0)), sensors={"radar": {"latency": latency}})
    stamp, tick = watch(worlds, 30.0, TICK, "tracks.stamp_us", "tick")
    stamp, now = stamp[:, 0, 0, RADAR, V] * 1e-6, tick[:, 0] * TICK
    new = np.flatnonzero(np.diff(stamp) > 0) + 1
    assert len(new) >= 22
    np.testing.assert_allclose(now[new] - stamp[new], arrives, atol=1e-6)
    np.testing.assert_allclose(np.diff(stamp[new]), ROTATION)


def test_the_tdm_predicts_late_scans_to_now():
    """Without errors a ship at 30 kn, seen by radar alone a second late, is where the picture says."""
    ferry = {"speed_kn": 30, "waypoints": [[300, -500], [300, 5000]], "ais": "off"}
    worlds, _ = sea(ships={"ferry": ferry}, sensors={"radar": {"latency": 1.0}})
    advance(worlds, 30.0)
    position, truth = watch(worlds, 20.0, 1.0, "picture.position", "vessels.eta")
    assert np.abs(position[:, 0, 0, 1] - truth[:, 0, 1, :2]).max() < 0.5  # 15 m if it were not predicted
