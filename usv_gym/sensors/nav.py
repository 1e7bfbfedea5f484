"""Own navigation: GNSS with heading (Seapath), MRU, IMU, speed log and wind sensor, each at its own rate (thesis B.1).

In a 3-DOF world roll, pitch and heave are zero, so the MRU gives heading and yaw rate only.
"""

from __future__ import annotations

from .. import rng
from ..jit import inner
from ..trig import atan2, hypot, sincos, wrap, wrap_positive
from ..world.geometry import waypoint_reached
from .ais import next_fire


@inner
def follow_own_route(w, o):
    """Advance the observer's own idea of its active waypoint, from the position it measures."""
    j = w.observer[o]
    r, nav = w.routes, w.nav
    while nav.leg[o] < r.count[j]:
        if not waypoint_reached(r, j, nav.leg[o], nav.position[o, 0], nav.position[o, 1]):
            return
        nav.leg[o] += 1
    nav.route_done[o] = r.count[j] > 0


@inner
def _noise2(w, stream, slot, tick, std):
    """Two numbers of this spread; drawn only if there is any."""
    if std == 0.0:
        return 0.0, 0.0
    a, b = rng.normal2(w.seed, stream, slot, tick)
    return std * a, std * b


@inner
def navigate(w, tick):
    """Fire every navigation sensor that is due and set ``w.next_nav``.

    A reading that the next one replaces before anybody can look (``w.look_tick``) is not worked out: noise is a counter's, so
    nothing else changes.  Only the position is always measured, which scans are referred to and the route is followed by.
    """
    nav, p, v = w.nav, w.sensors, w.vessels
    soonest = tick + (1 << 40)
    # a step may end early, where a frame ends
    look = min(w.look_tick, w.frame_tick + w.frame_ticks)
    look = tick if tick == w.frame_tick else look
    for o in range(w.observer.shape[0]):
        j = w.observer[o]
        psi, r = v.eta[j, 2], v.nu[j, 2]
        if tick >= nav.gnss_next[o]:
            nav.gnss_next[o] = next_fire(tick, w.dt_us, p.gnss_period_us)
            if p.gnss_frozen == 0:
                n0, n1 = _noise2(w, rng.GNSS, o * 3, tick, p.gnss_noise[0])
                drifting = (tick - p.gnss_drift_tick) * w.dt
                nav.position[o, 0] = v.eta[j, 0] + (p.gnss_drift[0] + p.gnss_drift_rate[0] * drifting) + n0
                nav.position[o, 1] = v.eta[j, 1] + (p.gnss_drift[1] + p.gnss_drift_rate[1] * drifting) + n1
                nav.gnss_stamp_us[o] = tick * w.dt_us
                if nav.gnss_next[o] > look:
                    heading_error, _ = _noise2(w, rng.GNSS, o * 3 + 1, tick, p.gnss_noise[1])
                    course_error, _ = _noise2(w, rng.GNSS, o * 3 + 2, tick, p.gnss_noise[2])
                    speed_error, _ = _noise2(w, rng.GNSS_SPEED, o, tick, p.gnss_noise[3])
                    sog = hypot(v.velocity[j, 0], v.velocity[j, 1])
                    nav.heading[o] = wrap_positive(psi + heading_error)
                    course = atan2(v.velocity[j, 1], v.velocity[j, 0]) if sog > 1.0e-9 else psi
                    nav.course[o] = wrap_positive(course + course_error)
                    nav.sog[o] = max(sog + speed_error, 0.0)
                follow_own_route(w, o)
        if tick >= nav.mru_next[o]:
            nav.mru_next[o] = next_fire(tick, w.dt_us, p.mru_period_us)
            if nav.mru_next[o] > look:
                nav.mru_heading[o] = wrap_positive(psi + _noise2(w, rng.MRU, o * 2, tick, p.mru_noise[0])[0])
                nav.yaw_rate[o] = r + _noise2(w, rng.MRU, o * 2 + 1, tick, p.mru_noise[1])[0]
        if tick >= nav.imu_next[o]:
            nav.imu_next[o] = next_fire(tick, w.dt_us, p.imu_period_us)
            if nav.imu_next[o] > look:
                seconds = (tick - nav.imu_tick[o]) * w.dt
                du = dv = 0.0
                if seconds > 0.0:
                    du = (v.nu[j, 0] - nav.imu_nu[o, 0]) / seconds
                    dv = (v.nu[j, 1] - nav.imu_nu[o, 1]) / seconds
                n0, n1 = _noise2(w, rng.IMU, o * 2, tick, p.imu_noise[0])
                nav.specific_force[o, 0] = du - v.nu[j, 1] * r + n0
                nav.specific_force[o, 1] = dv + v.nu[j, 0] * r + n1
                nav.imu_yaw_rate[o] = r + _noise2(w, rng.IMU, o * 2 + 1, tick, p.imu_noise[1])[0]
            nav.imu_tick[o] = tick
            for k in range(3):
                nav.imu_nu[o, k] = v.nu[j, k]
        if tick >= nav.log_next[o]:
            nav.log_next[o] = next_fire(tick, w.dt_us, p.log_period_us)
            if nav.log_next[o] > look:
                n0, n1 = _noise2(w, rng.SPEED_LOG, o, tick, p.log_noise)
                nav.water_speed[o, 0] = v.nu[j, 0] + n0
                nav.water_speed[o, 1] = v.nu[j, 1] + n1
        if tick >= nav.wind_next[o]:
            nav.wind_next[o] = next_fire(tick, w.dt_us, p.wind_period_us)
            if nav.wind_next[o] > look:
                speed, angle = _relative_wind(w, j)
                nav.wind_speed[o] = max(speed + _noise2(w, rng.WIND_SENSOR, o * 2, tick, p.wind_noise[0])[0], 0.0)
                nav.wind_angle[o] = wrap(angle + _noise2(w, rng.WIND_SENSOR, o * 2 + 1, tick, p.wind_noise[1])[0])
        soonest = min(soonest, nav.gnss_next[o], nav.mru_next[o], nav.imu_next[o], nav.log_next[o], nav.wind_next[o])
    w.next_nav = soonest


@inner
def _relative_wind(w, j):
    """Wind relative to vessel j at sensor height: speed [m/s] and the angle it comes from, off the bow [rad], starboard +."""
    speed = w.weather.wind_u10 * w.weather.wind_height_factor if w.weather.on else 0.0
    s, c = sincos(w.weather.wind_direction)
    dn = speed * c - w.vessels.velocity[j, 0]
    de = speed * s - w.vessels.velocity[j, 1]
    strength = hypot(dn, de)
    if strength == 0.0:
        return 0.0, 0.0
    return strength, wrap(atan2(-de, -dn) - w.vessels.eta[j, 2])
