"""Wind, current and waves: slow random processes of a world, and the forces they put on a vessel.

Wind and current are a mean plus exactly discretised Ornstein-Uhlenbeck fluctuations; wave forces are a second-order
filter driven by white noise, one per degree of freedom, exactly discretised too.  Their spread depends neither on the
time step nor on the encounter frequency.  Noise comes from the counter of ``rng.py``.  The preset `original`
(``weather.original``) keeps the Euler steps, clips and per-step noise of the simulator of 2017 instead.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from .. import rng
from ..jit import inner
from ..trig import atan2, clip, exp, sincos
from ..units import DEG

GRAVITY = 9.81  #: [m/s2]
AIR_DENSITY = 1.204  #: [kg/m3]
NOISE_STEP = 0.05  #: [s] the wave gains are per metre of wave height for noise that is drawn anew at this step
_RESET = 1 << 19  # slots above this are drawn at reset


@inner
def weather_reset(w):
    """Start wind, current and wave states: drawn from their stationary distributions, or at zero in the `original`."""
    weather = w.weather
    _ou_start(weather.wind_slow, w, rng.WIND, 0)
    _ou_start(weather.wind_gust, w, rng.WIND, 1)
    _ou_start(weather.wind_turn, w, rng.WIND, 2)
    _ou_start(weather.current_slow, w, rng.CURRENT, 0)
    _ou_start(weather.current_turn, w, rng.CURRENT, 1)
    _realise(weather)
    q = w.plants
    for p in range(q.thrusters.shape[0]):
        for i in range(3):
            a, b = rng.normal2(w.seed, rng.WAVE, _RESET + 3 * p + i, 0)
            q.wave_x[p, i, 0] = 0.0 if weather.original != 0 else a
            q.wave_x[p, i, 1] = 0.0 if weather.original != 0 else b
            q.tau_wave[p, i] = 0.0
            q.tau_wind[p, i] = 0.0


@inner
def _ou_start(process, w, stream, slot):
    if w.weather.original != 0:  # x' = noise - x / T, one Euler step with a fresh normal number of spread std per tick
        process.decay = 1.0 - w.dt / process.time_constant
        process.kick = w.dt * process.std
        process.x = 0.0
    else:
        process.decay = math.exp(-w.dt / process.time_constant)
        process.kick = process.std * math.sqrt(1.0 - process.decay * process.decay)
        process.x = process.std * rng.normal2(w.seed, stream, _RESET + slot, 0)[0]


@inner
def weather_step(w, tick):
    """Advance wind and current by one tick and write ``wind_u10``, ``wind_direction`` and ``current``."""
    weather = w.weather
    if weather.on == 0:
        return
    if weather.wind_speed > 0.0:
        a, b = rng.normal2(w.seed, rng.WIND, 0, tick)
        c, _ = rng.normal2(w.seed, rng.WIND, 1, tick)
        _ou_step(weather.wind_slow, a, weather.original)
        _ou_step(weather.wind_gust, b, weather.original)
        _ou_step(weather.wind_turn, c, weather.original)
    if weather.current_speed > 0.0:
        a, b = rng.normal2(w.seed, rng.CURRENT, 0, tick)
        _ou_step(weather.current_slow, a, weather.original)
        _ou_step(weather.current_turn, b, weather.original)
    _realise(weather)


@inner
def _ou_step(process, noise, original):
    process.x = process.decay * process.x + process.kick * noise
    if original != 0:
        process.x = _limited(process)


@inner
def _limited(process):
    return clip(process.x, -process.limit, process.limit)


@inner
def _realise(weather):
    """Write the realised wind and current; a mean of 0 stays exactly 0."""
    weather.wind_direction = weather.wind_to
    weather.wind_u10 = 0.0
    if weather.wind_speed > 0.0:
        weather.wind_direction += _limited(weather.wind_turn)
        speed = weather.wind_speed + _limited(weather.wind_slow) + _limited(weather.wind_gust)
        weather.wind_u10 = speed if weather.original != 0 else max(speed, 0.0)
    weather.current[0] = 0.0
    weather.current[1] = 0.0
    if weather.current_speed > 0.0:
        sine, cosine = sincos(weather.current_to + _limited(weather.current_turn))
        speed = weather.current_speed + _limited(weather.current_slow)
        weather.current[0] = speed * cosine
        weather.current[1] = speed * sine


@inner
def wind_load(w, j, p, sine, cosine):
    """Wind force on vessel slot j with plant p at heading (sine, cosine): writes ``tau_wind``.

    Coefficients after Blendermann (1994), in the form of Fossen (2021), section 10.1; see ``docs/vessels.md``.
    """
    weather = w.weather
    q = w.plants
    wind_n = 0.0
    wind_e = 0.0
    if weather.wind_u10 != 0.0:
        east, north = sincos(weather.wind_direction)
        wind_n = weather.wind_height_factor * weather.wind_u10 * north
        wind_e = weather.wind_height_factor * weather.wind_u10 * east
    # velocity of the vessel through the air: along its bow and to starboard
    u = w.vessels.nu[j, 0] - (cosine * wind_n + sine * wind_e)
    v = w.vessels.nu[j, 1] - (cosine * wind_e - sine * wind_n)
    speed2 = u * u + v * v
    if q.area_side[p] <= 0.0 or speed2 == 0.0:
        q.tau_wind[p, 0] = q.tau_wind[p, 1] = q.tau_wind[p, 2] = 0.0
        return
    per_speed = 1.0 / math.sqrt(speed2)
    along = u * per_speed
    across = v * per_speed
    cd_l = (q.cd_l_bow[p] if u >= 0.0 else q.cd_l_stern[p]) * q.wind_surge_factor[p]
    # delta / 2 sin^2(2 angle) = 2 delta (along across)^2
    squeeze = 1.0 - 2.0 * q.wind_delta[p] * (1.0 - cd_l / q.cd_t[p]) * (along * across) ** 2
    load = 0.5 * AIR_DENSITY * speed2 * q.area_side[p] / squeeze
    side = -load * q.cd_t[p] * across
    q.tau_wind[p, 0] = -load * cd_l * along
    q.tau_wind[p, 1] = side
    q.tau_wind[p, 2] = side * (q.wind_arm[p] - 0.18 * (atan2(abs(v), u) - 0.5 * math.pi) * q.length_pp[p])


@inner
def wave_step(w, p, j, tick):
    """Advance the wave-force states of plant p, vessel slot j, by one tick and write ``tau_wave[p]`` (X, Y, N).

    First-order wave force of degree of freedom i: F_i = sigma_i y2 with y1' = omega y2,
    y2' = -omega y1 - 2 lambda omega y2 + white noise (Fossen 2021, section 10.2), omega the encounter frequency.
    Scaled so that the stationary covariance of y is I, one step is y <- Phi y + chol(I - Phi Phi^T) noise, exactly.
    """
    weather = w.weather
    q = w.plants
    if weather.wave_height <= 0.0:
        for i in range(3):
            q.tau_wave[p, i] = 0.0
        return
    h = w.dt
    damping = weather.wave_damping
    omega0 = weather.wave_omega0
    sine, cosine = sincos(weather.wave_to - w.vessels.eta[j, 2])
    omega = abs(omega0 - omega0 * omega0 / GRAVITY * w.vessels.nu[j, 0] * cosine)
    if weather.original != 0:  # Euler, one noise for all degrees of freedom
        noise = rng.normal2(w.seed, rng.WAVE, 3 * j, tick)[0]
        x1 = q.wave_x[p, 0, 0]
        x2 = q.wave_x[p, 0, 1]
        for i in range(3):
            q.wave_x[p, i, 0] = x1 + h * x2
            q.wave_x[p, i, 1] = x2 + h * (noise - omega * omega * x1 - 2.0 * damping * omega * x2)
    else:
        root = math.sqrt(1.0 - damping * damping)
        s, c = sincos(omega * root * h)
        e = exp(-damping * omega * h)
        s *= e / root
        c *= e
        a11 = c + damping * s
        a22 = c - damping * s
        l11 = math.sqrt(max(1.0 - a11 * a11 - s * s, 0.0))
        l21 = s * (a11 - a22) / l11 if l11 > 0.0 else 0.0
        l22 = math.sqrt(max(1.0 - a22 * a22 - s * s - l21 * l21, 0.0))
        for i in range(3):
            a, b = rng.normal2(w.seed, rng.WAVE, 3 * j + i, tick)
            y1 = q.wave_x[p, i, 0]
            y2 = q.wave_x[p, i, 1]
            q.wave_x[p, i, 0] = a11 * y1 + s * y2 + l11 * a
            q.wave_x[p, i, 1] = a22 * y2 - s * y1 + l21 * a + l22 * b
    scale = weather.wave_scale
    q.tau_wave[p, 0] = -scale * q.wave_gain[p, 0] * abs(cosine) * q.wave_x[p, 0, 1]
    q.tau_wave[p, 1] = -scale * q.wave_gain[p, 1] * abs(sine) * q.wave_x[p, 1, 1]
    q.tau_wave[p, 2] = scale * q.wave_gain[p, 2] * q.wave_x[p, 2, 1]


#: (std, time constant [s], limit) of x.  Clipping leaves the spreads of the original: gusts 1.8, current 0.114 m/s
_PROCESSES: dict[str, tuple[float, float, float]] = {
    "wind_slow": (0.5, 10.0, 3.0),
    "wind_gust": (2.07, 6.2, 3.0),
    "wind_turn": (0.51 * DEG, 10.0, 10.0 * DEG),
    "current_slow": (0.127, 1.0, 0.2),
    "current_turn": (0.51 * DEG, 10.0, 5.0 * DEG),
}
#: the same for the preset `original`, where std is that of the noise of one step; gusts are a clipped random walk
_PROCESSES_ORIGINAL: dict[str, tuple[float, float, float]] = {
    "wind_slow": (1.0, 10.0, 3.0),
    "wind_gust": (5.0, math.inf, 3.0),
    "wind_turn": (DEG, 10.0, 10.0 * DEG),
    "current_slow": (1.0, 1.0, 0.2),
    "current_turn": (DEG, 10.0, 5.0 * DEG),
}


def set_weather(
    world: np.void,
    *,
    wind_speed: float = 0.0,
    wind_to: float = 0.0,
    current_speed: float = 0.0,
    current_to: float = 0.0,
    wave_height: float = 0.0,
    wave_to: float = 0.0,
    gusts: bool = True,
    original: bool = False,
    radar_range_factor: float = 1.0,
    lidar_range_factor: float = 1.0,
    detection_factor: float = 1.0,
    radar_clutter: float = 0.0,
    lidar_clutter: float = 0.0,
) -> None:
    """Fill the weather group of one record, ``worlds[b]``, from physical numbers; ``weather_reset`` then starts it.

    Parameters
    ----------
    world
        one record of the world dtype, a view.
    wind_speed, wind_to
        mean wind at 10 m height [m/s] and the direction it blows *towards* [rad].
    current_speed, current_to
        mean current [m/s] and the direction it sets towards [rad].
    wave_height, wave_to
        significant wave height [m] and the direction the waves travel towards [rad].
    gusts
        False: wind and current are steady.
    original
        the recipes and constants of the simulator of 2017.
    radar_range_factor, lidar_range_factor, detection_factor
        what this weather does to the sensors, 1 = nothing.
    radar_clutter, lidar_clutter
        false alarms that it adds, per scan.
    """
    weather: Any = world["weather"]
    weather["radar_clutter"], weather["lidar_clutter"] = radar_clutter, lidar_clutter
    weather["wind_u10"], weather["current"] = 0.0, 0.0  # written by weather_reset, and by weather_step if on
    weather["on"] = wind_speed > 0.0 or current_speed > 0.0 or wave_height > 0.0
    weather["original"] = original
    weather["wind_speed"], weather["wind_to"] = wind_speed, wind_to
    weather["current_speed"], weather["current_to"] = current_speed, current_to
    weather["wave_height"], weather["wave_to"] = wave_height, wave_to
    # U(1 m) / U(10 m) of the log profile with surface drag 0.0025; in the original 5/2 was an integer division
    weather["wind_height_factor"] = 0.5697 if original else 0.7122
    for name, (std, time_constant, limit) in (_PROCESSES_ORIGINAL if original else _PROCESSES).items():
        process = weather[name]
        process["std"], process["time_constant"], process["limit"] = std if gusts else 0.0, time_constant, limit
    # modal frequency of the Pierson-Moskowitz spectrum: omega0^4 = 4 B / 5, B = 3.11 / Hs^2; the original lost the 4
    spectrum = 3.11 / wave_height**2 if wave_height > 0.0 else 0.0
    weather["wave_omega0"] = omega0 = ((1.0 if original else 4.0) * spectrum / 5.0) ** 0.25
    weather["wave_damping"] = damping = 0.1017
    # stationary spread of x2 that white noise gives which the original drew with spread Hs every 0.05 s
    filtered = math.sqrt(NOISE_STEP / (4.0 * damping * omega0)) if wave_height > 0.0 and not original else 1.0
    weather["wave_scale"] = wave_height * filtered
    weather["radar_range_factor"], weather["lidar_range_factor"] = radar_range_factor, lidar_range_factor
    weather["detection_factor"] = detection_factor
