"""Own navigation: how often each sensor speaks, and what it says."""

from __future__ import annotations

import math

import numpy as np
import pytest
from sensor_helpers import NO_NOISE, advance, check_error, sea, watch, wrapped

from usv_gym.scenarios.loader import SensorRateWarning, load_scenario
from usv_gym.units import DEG

#: one field of each sensor, with the key of the sensor
FIELDS = {
    "gnss": "position",
    "mru": "mru_heading",
    "imu": "specific_force",
    "speed_log": "water_speed",
    "wind": "wind_angle",
}
NOISY = {
    "gnss": {"position_std": 1.0, "heading_std_deg": 0.2, "course_std_deg": 0.5, "speed_std": 0.1},
    "mru": {"heading_std_deg": 0.3, "yaw_rate_std_deg_s": 0.4},
    "imu": {"acceleration_std": 0.05, "yaw_rate_std_deg_s": 0.06},
    "speed_log": {"speed_std": 0.07},
    "wind": {"speed_std": 0.5, "angle_std_deg": 2.0},
}


def noisy(rates):
    return {name: keys | {"rate": float(rates[name])} for name, keys in NOISY.items()}


def changes(worlds, seconds, every):
    """How often per second the reading of each sensor changes; with noise every reading is another."""
    readings = watch(worlds, seconds, every, *(f"nav.{field}" for field in FIELDS.values()))
    return {
        name: (np.diff(reading[:, 0].reshape(len(reading), -1)[:, 0]) != 0).sum() / (seconds - every)
        for name, reading in zip(FIELDS, readings, strict=True)
    }


# --- rates -----------------------------------------------------------------------------------------------------------
def test_rates_of_the_thesis():
    """Appendix B.1, at a tick that is fast enough for all of them."""
    rates = {"gnss": 20, "mru": 100, "imu": 100, "speed_log": 20, "wind": 50}
    assert {name: getattr(load_scenario({}).sensors.navigation, name).rate for name in FIELDS} == rates
    worlds, _ = sea(simulation={"dt": 0.01}, sensors={"navigation": noisy(rates)})
    assert changes(worlds, 10.0, 0.01) == pytest.approx(rates, rel=0.01)


def test_a_sensor_faster_than_the_tick_fires_every_tick():
    """As in the original, where all of them ran at 20 Hz; the thesis's own rates do so silently."""
    rates = {"gnss": 20, "mru": 100, "imu": 100, "speed_log": 20, "wind": 50}
    worlds, _ = sea(sensors={"navigation": noisy(rates)})
    assert changes(worlds, 10.0, 0.05) == pytest.approx(dict.fromkeys(rates, 20.0))
    with pytest.warns(SensorRateWarning, match=r"gnss \(40 Hz\)"):
        worlds, _ = sea(sensors={"navigation": noisy(rates | {"gnss": 40})})
    assert changes(worlds, 10.0, 0.05) == pytest.approx(dict.fromkeys(rates, 20.0))


def test_slow_and_odd_rates_keep_their_mean():
    """A period that is no whole number of ticks fires at the first tick after it, without drifting."""
    rates = {"gnss": 1, "mru": 2, "imu": 7, "speed_log": 3, "wind": 0}
    worlds, _ = sea(sensors={"navigation": noisy(rates)})
    found = changes(worlds, 60.0, 0.05)
    assert found.pop("wind") == 0.0  # switched off
    rates.pop("wind")
    assert found == pytest.approx(rates, abs=1.1 / 60)  # one more or less


# --- noise -----------------------------------------------------------------------------------------------------------
def test_noise_has_the_configured_spread():
    """Sailing straight on at 5 m/s towards 60 deg, so that speed stays off its floor and angles are defined."""
    worlds, _ = sea(100, own_velocity=(5.0, 60 * DEG), sensors={"navigation": noisy(dict.fromkeys(FIELDS, 20.0))})
    names = ("position", "heading", "course", "sog", "mru_heading", "yaw_rate", "specific_force", "imu_yaw_rate",
             "water_speed", "wind_speed", "wind_angle")  # fmt: skip
    readings = watch(worlds, 5.0, 0.05, *(f"nav.{name}" for name in names))
    nav = {name: reading[:, :, 0] for name, reading in zip(names, readings, strict=True)}
    t = 0.05 * np.arange(1, 101)[:, None, None]
    truth = 5.0 * t * np.array([math.cos(60 * DEG), math.sin(60 * DEG)])
    for errors, std in (
        (nav["position"] - truth, 1.0),
        (wrapped(nav["heading"] - 60 * DEG), 0.2 * DEG),
        (wrapped(nav["course"] - 60 * DEG), 0.5 * DEG),
        (nav["sog"] - 5.0, 0.1),
        (wrapped(nav["mru_heading"] - 60 * DEG), 0.3 * DEG),
        (nav["yaw_rate"], 0.4 * DEG),
        (nav["specific_force"], 0.05),
        (nav["imu_yaw_rate"], 0.06 * DEG),
        (nav["water_speed"] - [5.0, 0.0], 0.07),
        (nav["wind_speed"] - 5.0, 0.5),  # in still air the wind is one's own
        (nav["wind_angle"], 2.0 * DEG),
    ):
        check_error(errors, std, 0.0, 0.0, lags=(0, 1))


def test_without_noise_the_readings_are_the_truth():
    worlds, _ = sea(own_velocity=(5.0, 300 * DEG), **NO_NOISE)
    advance(worlds, 10.0)
    nav = {name: worlds["nav"][name][0, 0] for name in worlds["nav"].dtype.names}
    np.testing.assert_allclose(nav["position"], 50 * np.array([math.cos(300 * DEG), math.sin(300 * DEG)]), atol=1e-9)
    assert [nav[name] / DEG for name in ("heading", "course", "mru_heading")] == pytest.approx([300.0] * 3)
    assert nav["sog"] == pytest.approx(5.0)
    assert nav["gnss_stamp_us"] == 10_000_000


def test_a_boat_at_rest_has_its_heading_for_a_course():
    worlds, _ = sea(own_ship={"heading_deg": 200.0}, **NO_NOISE)
    advance(worlds, 1.0)
    assert worlds["nav"]["course"][0, 0] == pytest.approx(200 * DEG)


# --- accelerations ---------------------------------------------------------------------------------------------------
def test_the_imu_feels_the_turn():
    """In a steady turn the specific force is [-v r, u r]: the centripetal acceleration, with nothing from du or dv."""
    worlds, _ = sea(own_ship={"speed": 4.0}, **NO_NOISE)
    worlds["plants"]["command"][:, 0, :2] = 0.5, 0.5, 1.0  # both jets: rpm 50 %, nozzle 50 % to starboard, ahead
    advance(worlds, 120.0)
    u, v, r = worlds["vessels"]["nu"][0, 0]
    assert r > 8 * DEG  # 11 deg/s by the table of the original
    force = worlds["nav"]["specific_force"][0, 0]
    np.testing.assert_allclose(force, [-v * r, u * r], atol=1e-4)
    assert force[1] == pytest.approx(u * r, rel=1e-3)
    assert force[1] > 0.5  # to starboard
    assert worlds["nav"]["imu_yaw_rate"][0, 0] == pytest.approx(r)
    # the same force from the path itself: speed squared over radius
    (eta,) = watch(worlds, 60.0, 0.05, "vessels.eta")
    radius = 0.5 * np.ptp(eta[:, 0, 0, 0])
    assert np.hypot(*force) == pytest.approx((u * u + v * v) / radius, rel=0.01)


def test_the_imu_feels_thrust():
    """Two jets at full thrust push with 2 x 10 kN against some 7 t with added mass: towards 3 m/s2 from rest."""
    worlds, _ = sea(**NO_NOISE)
    worlds["plants"]["command"][:, 0, :2] = 1.0, 0.0, 1.0
    nu, force = watch(worlds, 3.0, 0.05, "vessels.nu", "nav.specific_force")
    np.testing.assert_allclose(force[1:, 0, 0, 0], np.diff(nu[:, 0, 0, 0]) / 0.05, atol=1e-9)
    assert 2.0 < force[:, 0, 0, 0].max() < 20_000 / 6527.36


# --- wind ------------------------------------------------------------------------------------------------------------
@pytest.mark.parametrize(("heading", "angle"), [(90.0, 0.0), (0.0, 90.0), (180.0, -90.0), (45.0, 45.0)])
def test_the_wind_angle_is_where_it_comes_from_starboard_positive(heading, angle):
    """Wind from the east: ahead of a boat that heads east, on the starboard side of one that heads north."""
    worlds, _ = sea(own_ship={"heading_deg": heading}, weather={"wind": {"speed": 10, "from_deg": 90, "gusts": False}},
                    **NO_NOISE)  # fmt: skip
    advance(worlds, 0.05)  # before it drifts
    assert worlds["nav"]["wind_angle"][0, 0] / DEG == pytest.approx(angle, abs=0.1)
    # at sensor height, 1 m, by the thesis's log profile: 0.712 of the wind at 10 m
    assert worlds["nav"]["wind_speed"][0, 0] == pytest.approx(7.12, abs=0.02)


def test_own_speed_is_head_wind():
    worlds, _ = sea(own_velocity=(5.0, 1.0), weather={"wind": {"speed": 0.0}}, **NO_NOISE)
    advance(worlds, 1.0)
    assert worlds["nav"]["wind_speed"][0, 0] == pytest.approx(5.0)
    assert worlds["nav"]["wind_angle"][0, 0] == pytest.approx(0.0, abs=1e-9)


# --- faults ----------------------------------------------------------------------------------------------------------
def test_a_frozen_gnss_keeps_its_last_fix_and_its_old_stamp():
    worlds, _ = sea(own_velocity=(5.0, 0.0), **NO_NOISE)
    advance(worlds, 10.0)
    worlds["sensors"]["gnss_frozen"] = 1
    advance(worlds, 10.0)
    nav = worlds["nav"][0]
    assert nav["position"][0].tolist() == pytest.approx([50.0, 0.0])
    assert nav["gnss_stamp_us"][0] == 10_000_000
    worlds["sensors"]["gnss_frozen"] = 0
    advance(worlds, 0.05)
    assert worlds["nav"]["position"][0, 0].tolist() == pytest.approx([100.25, 0.0])


def test_a_gnss_that_has_drifted_is_off_by_the_drift():
    worlds, _ = sea(own_velocity=(5.0, 0.0), **NO_NOISE)
    worlds["sensors"]["gnss_drift"] = 20.0, -30.0
    advance(worlds, 10.0)
    assert worlds["nav"]["position"][0, 0].tolist() == pytest.approx([70.0, -30.0])
    assert worlds["vessels"]["eta"][0, 0, :2].tolist() == pytest.approx([50.0, 0.0])
    # course and speed come from Doppler, heading from the compass: no drift in them
    assert worlds["nav"]["sog"][0, 0] == pytest.approx(5.0)
