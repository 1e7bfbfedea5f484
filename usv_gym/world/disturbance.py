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
from ..jit import inner, scalar
from ..trig import atan2, clip, exp, sincos_random
from ..units import DEG
from .lanes import LANES

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
    x = weather.wind_slow.x, weather.wind_gust.x, weather.wind_turn.x
    limit = weather.wind_slow.limit, weather.wind_gust.limit, weather.wind_turn.limit
    weather.wind_direction, weather.wind_u10 = _wind(
        weather.wind_speed, weather.wind_to, weather.original,
        clip(x[0], -limit[0], limit[0]), clip(x[1], -limit[1], limit[1]), clip(x[2], -limit[2], limit[2]),
    )  # fmt: skip
    slow, turn = weather.current_slow, weather.current_turn
    weather.current[0], weather.current[1] = _current(
        weather.current_speed, weather.current_to, clip(slow.x, -slow.limit, slow.limit), clip(turn.x, -turn.limit, turn.limit)
    )
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
def weather_step(g):
    """Advance the clock of all lanes by a tick; where there is weather, wind and current as well.

    Writes ``wind_u10``, ``wind_direction`` and ``current``.
    """
    for l in range(LANES):
        g.tick[l] += 1
    if g.any_weather == 0:
        return
    for l in range(LANES):
        on = g.on[l] != 0.0
        a, b = rng.normal2(g.seed[l], rng.WIND, 0, g.tick[l])
        c, _ = rng.normal2(g.seed[l], rng.WIND, 1, g.tick[l])
        blows = on & (g.wind_speed[l] > 0.0)
        slow, gust, turn = _ou_step(g.wind_slow, g, l, a), _ou_step(g.wind_gust, g, l, b), _ou_step(g.wind_turn, g, l, c)
        g.wind_slow.x[l] = slow if blows else g.wind_slow.x[l]
        g.wind_gust.x[l] = gust if blows else g.wind_gust.x[l]
        g.wind_turn.x[l] = turn if blows else g.wind_turn.x[l]
    for l in range(LANES):
        on = g.on[l] != 0.0
        a, b = rng.normal2(g.seed[l], rng.CURRENT, 0, g.tick[l])
        flows = on & (g.current_speed[l] > 0.0)
        slow, turn = _ou_step(g.current_slow, g, l, a), _ou_step(g.current_turn, g, l, b)
        g.current_slow.x[l] = slow if flows else g.current_slow.x[l]
        g.current_turn.x[l] = turn if flows else g.current_turn.x[l]
    for l in range(LANES):
        on = g.on[l] != 0.0
        direction, u10 = _wind(g.wind_speed[l], g.wind_to[l], g.original[l], _limited(g.wind_slow, l), _limited(g.wind_gust, l),
                               _limited(g.wind_turn, l))  # fmt: skip
        north, east = _current(g.current_speed[l], g.current_to[l], _limited(g.current_slow, l), _limited(g.current_turn, l))
        g.wind_direction[l] = direction if on else g.wind_direction[l]
        g.wind_u10[l] = u10 if on else g.wind_u10[l]
        g.current[0, l] = north if on else g.current[0, l]
        g.current[1, l] = east if on else g.current[1, l]


@scalar
def _ou_step(process, g, l, noise):
    """x of lane l a tick on."""
    x = process.decay[l] * process.x[l] + process.kick[l] * noise
    return clip(x, -process.limit[l], process.limit[l]) if g.original[l] != 0.0 else x


@scalar
def _limited(process, l):
    return clip(process.x[l], -process.limit[l], process.limit[l])


@scalar
def _wind(mean, to, original, slow, gust, turn):
    """Direction [rad] and speed at 10 m [m/s] of the wind; a mean of 0 stays exactly 0."""
    speed = mean + slow + gust
    speed = speed if original != 0.0 else max(speed, 0.0)
    return (to + turn if mean > 0.0 else to), (speed if mean > 0.0 else 0.0)


@scalar
def _current(mean, to, slow, turn):
    """Velocity [N, E] of the water [m/s]; a mean of 0 stays exactly 0."""
    sine, cosine = sincos_random(to + turn)
    speed = mean + slow if mean > 0.0 else 0.0
    return speed * cosine, speed * sine


@inner
def wind_load(g):
    """Wind force on all vessels: writes ``tau_wind``.

    Coefficients after Blendermann (1994), in the form of Fossen (2021), section 10.1; see ``docs/vessels.md``.
    """
    for l in range(LANES):
        sine, cosine, wind = g.sine[l], g.cosine[l], g.wind_height_factor[l] * g.wind_u10[l]
        east, north = sincos_random(g.wind_direction[l])
        wind_n, wind_e = wind * north, wind * east
        # velocity of the vessel through the air: along its bow and to starboard
        u = g.nu[0, l] - (cosine * wind_n + sine * wind_e)
        v = g.nu[1, l] - (cosine * wind_e - sine * wind_n)
        speed2 = u * u + v * v
        felt = (g.area_side[l] > 0.0) & (speed2 > 0.0)
        per_speed = 1.0 / math.sqrt(speed2 if felt else 1.0)
        along = u * per_speed
        across = v * per_speed
        bow, stern = g.cd_l_bow[l], g.cd_l_stern[l]
        cd_l = (bow if u >= 0.0 else stern) * g.wind_surge_factor[l]
        # delta / 2 sin^2(2 angle) = 2 delta (along across)^2
        squeeze = 1.0 - 2.0 * g.wind_delta[l] * (1.0 - cd_l / (g.cd_t[l] if felt else 1.0)) * (along * across) ** 2
        load = 0.5 * AIR_DENSITY * speed2 * g.area_side[l] / squeeze
        side = -load * g.cd_t[l] * across
        turn = side * (g.wind_arm[l] - 0.18 * (atan2(abs(v), u) - 0.5 * math.pi) * g.length_pp[l])
        g.tau_wind[0, l] = -load * cd_l * along if felt else 0.0
        g.tau_wind[1, l] = side if felt else 0.0
        g.tau_wind[2, l] = turn if felt else 0.0


@inner
def wave_step(g):
    """Advance the wave-force states of all plants by one tick and write ``tau_wave`` (X, Y, N).

    First-order wave force of degree of freedom i: F_i = sigma_i y2 with y1' = omega y2,
    y2' = -omega y1 - 2 lambda omega y2 + white noise (Fossen 2021, section 10.2), omega the encounter frequency.
    Scaled so that the stationary covariance of y is I, one step is y <- Phi y + chol(I - Phi Phi^T) noise, exactly.
    """
    if g.any_waves == 0:
        return
    if g.any_original:
        _original_waves(g)
    for l in range(LANES):
        h, damping, omega0 = g.h[l], g.wave_damping[l], g.wave_omega0[l]
        sine, cosine = sincos_random(g.wave_to[l] - g.eta[2, l])
        omega = abs(omega0 - omega0 * omega0 / GRAVITY * g.nu[0, l] * cosine)
        root = math.sqrt(1.0 - damping * damping)
        s, c = sincos_random(omega * root * h)
        e = exp(-damping * omega * h)
        s *= e / root
        c *= e
        a11 = c + damping * s
        a22 = c - damping * s
        l11 = math.sqrt(max(1.0 - a11 * a11 - s * s, 0.0))
        l21 = s * (a11 - a22) / (l11 if l11 > 0.0 else 1.0)
        l21 = l21 if l11 > 0.0 else 0.0
        l22 = math.sqrt(max(1.0 - a22 * a22 - s * s - l21 * l21, 0.0))
        waves = (g.on[l] != 0.0) & (g.wave_height[l] > 0.0)
        drawn = waves & (g.original[l] == 0.0)
        for i in range(3):
            a, b = rng.normal2(g.seed[l], rng.WAVE, 3 * g.slot[l] + i, g.tick[l])
            y1 = g.wave_x[i, 0, l]
            y2 = g.wave_x[i, 1, l]
            z1 = a11 * y1 + s * y2 + l11 * a
            z2 = a22 * y2 - s * y1 + l21 * a + l22 * b
            g.wave_x[i, 0, l] = z1 if drawn else y1
            g.wave_x[i, 1, l] = z2 if drawn else y2
        scale = g.wave_scale[l]
        g.tau_wave[0, l] = -scale * g.wave_gain[0, l] * abs(cosine) * g.wave_x[0, 1, l] if waves else g.tau_wave[0, l]
        g.tau_wave[1, l] = -scale * g.wave_gain[1, l] * abs(sine) * g.wave_x[1, 1, l] if waves else g.tau_wave[1, l]
        g.tau_wave[2, l] = scale * g.wave_gain[2, l] * g.wave_x[2, 1, l] if waves else g.tau_wave[2, l]


@inner
def _original_waves(g):
    """The states of lanes with the preset `original`: an Euler step, one noise for all degrees of freedom."""
    for l in range(LANES):
        h, damping, omega0 = g.h[l], g.wave_damping[l], g.wave_omega0[l]
        _, cosine = sincos_random(g.wave_to[l] - g.eta[2, l])
        omega = abs(omega0 - omega0 * omega0 / GRAVITY * g.nu[0, l] * cosine)
        noise, _ = rng.normal2(g.seed[l], rng.WAVE, 3 * g.slot[l], g.tick[l])
        drawn = (g.on[l] != 0.0) & (g.wave_height[l] > 0.0) & (g.original[l] != 0.0)
        x1 = g.wave_x[0, 0, l]
        x2 = g.wave_x[0, 1, l]
        z1 = x1 + h * x2
        z2 = x2 + h * (noise - omega * omega * x1 - 2.0 * damping * omega * x2)
        for i in range(3):
            g.wave_x[i, 0, l] = z1 if drawn else g.wave_x[i, 0, l]
            g.wave_x[i, 1, l] = z2 if drawn else g.wave_x[i, 1, l]


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
