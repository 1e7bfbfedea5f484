"""Wind, current and waves: their spread is what was asked for, at any time step, and noise belongs to its owner."""

from __future__ import annotations

import numpy as np
import pytest
from dynamics_helpers import board, make_world, simulate

from usv_gym.jit import kernel
from usv_gym.world.disturbance import wave_step, weather_step
from usv_gym.world.lanes import lanes_for

SECONDS = 100_000


@kernel
def wave_series(worlds, lanes, ticks, speed, out):
    """Spread of the unit wave states [3, 2] over some ticks, at a constant speed over ground."""
    g = lanes[0]
    board(g, worlds[0])
    for i in range(ticks):
        g.nu[0, 0] = speed
        g.tick[0] = i
        wave_step(g)
        for dof in range(3):
            for k in range(2):
                out[dof, k] += g.wave_x[dof, k, 0] ** 2
            out[dof, 2] += g.wave_x[dof, 1, 0] * g.wave_x[(dof + 1) % 3, 1, 0]


@kernel
def weather_series(worlds, lanes, out):
    """Out [ticks, 4]: wind [m/s] and direction [rad], current N and E [m/s]."""
    g = lanes[0]
    board(g, worlds[0])
    for i in range(out.shape[0]):
        weather_step(g)
        out[i, 0] = g.wind_u10[0]
        out[i, 1] = g.wind_direction[0]
        out[i, 2] = g.current[0, 0]
        out[i, 3] = g.current[1, 0]


def wave_force_std(dt, *, speed=0.0, to=0.0, **kw):
    worlds = make_world(dt=dt, wave_height=2.0, wave_to=to, **kw)
    ticks = round(SECONDS / dt)
    sums = np.zeros((3, 3))
    wave_series(worlds, lanes_for(worlds)[0], ticks, speed, sums)
    scale = worlds["weather"]["wave_scale"][0] * worlds["plants"]["wave_gain"][0, 0]
    return scale * np.sqrt(sums[:, 1] / ticks), sums / ticks


@pytest.mark.parametrize("dt", [0.02, 0.05, 0.1])
@pytest.mark.parametrize(("speed", "to"), [(0.0, 0.0), (5.0, 0.0), (5.0, np.pi)])
def test_wave_force_spread_does_not_depend_on_the_step(dt, speed, to):
    """Whatever the step and the encounter frequency: sigma_i = K_i Hs sqrt(0.05 / (4 lambda omega0))."""
    omega0 = (4.0 * 3.11 / 2.0**2 / 5.0) ** 0.25
    sigma = np.array([3200.0, 4000.0, 1000.0]) * 2.0 * np.sqrt(0.05 / (4.0 * 0.1017 * omega0))
    std, moments = wave_force_std(dt, speed=speed, to=to)
    # 3 %; the slow encounter in following seas leaves fewer independent samples
    limit = 0.06 if speed and to == 0.0 else 0.03
    assert std == pytest.approx(sigma, rel=limit)
    assert np.abs(moments[:, 2]).max() < 0.06  # independent noise per degree of freedom


def test_original_wave_force_spread():
    std, _ = wave_force_std(0.05, preset="original")
    assert std == pytest.approx((3067.0, 3834.0, 958.0), rel=0.05)


def test_wave_force_directions():
    worlds = make_world(wave_height=2.0, wave_to=np.pi / 2)
    worlds["vessels"]["eta"][0, 0, 2] = np.pi / 2  # following sea: no sway force
    simulate(worlds, 0.05)
    x, y, n = worlds["plants"]["tau_wave"][0, 0]
    assert y == pytest.approx(0.0, abs=1e-6)
    assert x != 0.0
    assert n != 0.0


@pytest.mark.parametrize("dt", [0.05, 0.5])
def test_wind_and_current_spread(dt):
    worlds = make_world(dt=dt, wind_speed=15.0, wind_to=1.0, current_speed=0.5, current_to=2.0)
    out = np.zeros((round(SECONDS / dt), 4))
    weather_series(worlds, lanes_for(worlds)[0], out)
    wind = out[:, 0] - 15.0
    assert abs(wind.mean()) < 0.1
    assert wind.std() == pytest.approx(np.hypot(1.8, 0.5), rel=0.03)
    lag = round(1.0 / dt)
    assert np.corrcoef(wind[lag:], wind[:-lag])[0, 1] == pytest.approx(0.85, abs=0.03)
    assert np.degrees(out[:, 1].std()) == pytest.approx(0.51, rel=0.05)
    current = np.hypot(out[:, 2], out[:, 3])
    assert current.std() == pytest.approx(0.114, rel=0.03)
    assert np.abs(current - 0.5).max() <= 0.2 + 1e-12
    assert np.degrees(np.arctan2(out[:, 3], out[:, 2]).std()) == pytest.approx(0.51, rel=0.05)


def test_original_wind_and_current_spread():
    worlds = make_world(preset="original", wind_speed=15.0, wind_to=1.0, current_speed=0.5, current_to=2.0)
    out = np.zeros((round(SECONDS / 0.05), 4))
    weather_series(worlds, lanes_for(worlds)[0], out)
    assert (out[:, 0] - 15.0).std() == pytest.approx(np.hypot(1.8, 0.5), rel=0.05)
    assert np.hypot(out[:, 2], out[:, 3]).std() == pytest.approx(0.114, rel=0.05)


def test_steady_and_calm_weather():
    out = np.zeros((100, 4))
    worlds = make_world(wind_speed=7.0, wind_to=1.0, current_speed=0.5, current_to=0.0, gusts=False)
    weather_series(worlds, lanes_for(worlds)[0], out)
    np.testing.assert_allclose(out, np.tile((7.0, 1.0, 0.5, 0.0), (100, 1)), atol=1e-15)
    worlds = make_world()
    weather_series(worlds, lanes_for(worlds)[0], out)
    assert not out[:, [0, 2, 3]].any()
    assert not simulate(worlds, 1.0, command=[[0.0, 0.0, 0.0]] * 4).any()


def test_noise_belongs_to_the_world():
    weather = {"wind_speed": 10.0, "current_speed": 0.5, "wave_height": 1.0}
    a, b, c = (simulate(make_world(seed=s, **weather), 5.0) for s in (3, 3, 4))
    np.testing.assert_array_equal(a, b)
    assert not np.allclose(a, c)


def test_intended_against_original_constants():
    """Height factor, longitudinal wind load and modal frequency as meant, and as they were."""
    new, old = make_world(wave_height=2.0), make_world(preset="original", wave_height=2.0)
    assert new["weather"]["wind_height_factor"][0] == pytest.approx(0.712, abs=5e-4)
    assert old["weather"]["wind_height_factor"][0] == pytest.approx(0.5697)
    assert new["plants"]["wind_surge_factor"][0, 0] == pytest.approx(6.4 / 11.31)
    assert old["plants"]["wind_surge_factor"][0, 0] == 1.0
    assert new["weather"]["wave_omega0"][0] == pytest.approx(0.888, abs=5e-4)
    assert old["weather"]["wave_omega0"][0] == pytest.approx(0.628, abs=5e-4)
