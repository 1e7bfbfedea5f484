"""The 3-DOF model of a surface vessel: one tick of (eta, nu) of a vessel slot that has a plant.

    M nu_r' + C(nu_r) nu_r + d(nu_r) + mu = tau_thrust + tau_wind + tau_wave,    eta' = R(psi) nu_r + current

in surge, sway and yaw, {b}, relative to the water (Fossen 2021, chapter 6).  Parameters come from a vessel file; the
equations with their sources are in ``docs/vessels.md``.
"""

from __future__ import annotations

import math

from ..jit import inner, scalar
from ..trig import log, sincos
from .actuators import thrust
from .disturbance import wind_load

WATER_DENSITY = 1025.0  #: [kg/m3]
VISCOSITY = 1.0e-6  #: kinematic, of water [m2/s]
_THIRD = 1.0 / 3.0
_PER_DECADE = 1.0 / math.log(10.0)


@inner
def plant_step(w, j, p, h):
    """Advance vessel slot j with plant p by h seconds, after ``actuate`` and ``wave_step``.

    Thrust, wind load, wave force and skin friction are evaluated once per tick; (eta, nu) advance by Heun's method.
    Writes ``eta``, ``nu``, ``velocity`` of the slot and ``tau``, ``tau_wind``, ``memory_x``, ``turned`` of the plant.
    """
    vessels = w.vessels
    q = w.plants
    psi = vessels.eta[j, 2]
    if psi != q.turned[p, 0]:  # somebody has put it there
        q.turned[p, 0] = psi
        q.turned[p, 1], q.turned[p, 2] = sincos(psi)
    sine, cosine = q.turned[p, 1], q.turned[p, 2]
    current_n = w.weather.current[0]
    current_e = w.weather.current[1]
    current_u = cosine * current_n + sine * current_e
    current_v = cosine * current_e - sine * current_n
    u = vessels.nu[j, 0] - current_u
    v = vessels.nu[j, 1] - current_v
    r = vessels.nu[j, 2]

    surge, sway, yaw = thrust(w, p)
    q.tau[p, 0] = surge
    q.tau[p, 1] = sway
    q.tau[p, 2] = yaw
    wind_load(w, j, p, sine, cosine)
    surge += q.tau_wind[p, 0] + q.tau_wave[p, 0]
    sway += q.tau_wind[p, 1] + q.tau_wave[p, 1]
    yaw += q.tau_wind[p, 2] + q.tau_wave[p, 2]
    if q.memory[p] != 0:
        mu_sway, mu_yaw = _fluid_memory(w, p, v, r, h)
        sway -= mu_sway
        yaw -= mu_yaw
    friction = _surge_friction(w, p, u)

    du, dv, dr = _acceleration(w, p, u, v, r, friction, surge, sway, yaw)
    u1 = u + h * du
    v1 = v + h * dv
    r1 = r + h * dr
    gain = q.yaw_gain[p]
    sine1, cosine1 = sincos(psi + h * gain * r)
    du1, dv1, dr1 = _acceleration(w, p, u1, v1, r1, friction, surge, sway, yaw)

    half = 0.5 * h
    north = current_n + 0.5 * (cosine * u - sine * v + cosine1 * u1 - sine1 * v1)
    east = current_e + 0.5 * (sine * u + cosine * v + sine1 * u1 + cosine1 * v1)
    psi += half * gain * (r + r1)
    u += half * (du + du1)
    v += half * (dv + dv1)
    r += half * (dr + dr1)

    sine, cosine = sincos(psi)
    q.turned[p, 0] = psi
    q.turned[p, 1] = sine
    q.turned[p, 2] = cosine
    if q.current_turns[p] != 0:
        current_u = cosine * current_n + sine * current_e
        current_v = cosine * current_e - sine * current_n
    u += current_u
    v += current_v
    vessels.eta[j, 0] += h * north
    vessels.eta[j, 1] += h * east
    vessels.eta[j, 2] = psi
    vessels.nu[j, 0] = u
    vessels.nu[j, 1] = v
    vessels.nu[j, 2] = r
    vessels.velocity[j, 0] = cosine * u - sine * v
    vessels.velocity[j, 1] = sine * u + cosine * v


@scalar
def _surge_friction(w, p, u):
    """Coefficient of |u| u: Xuu and, scaled, the ITTC-1957 line 0.075 / (log10 Re - 2)^2 plus a residual of 0.014."""
    q = w.plants
    if q.Xuu_ittc[p] == 0.0:
        return q.Xuu[p]
    reynolds = max(u, 0.2) * q.length_pp[p] / VISCOSITY
    decades = log(reynolds) * _PER_DECADE - 2.0
    return q.Xuu[p] + q.Xuu_ittc[p] * (0.075 / (decades * decades) + 0.014)


@scalar
def _acceleration(w, p, u, v, r, friction, surge, sway, yaw):
    """(u', v', r') from velocities through the water and the external force: M^-1 (tau - C nu - d(nu))."""
    q = w.plants
    av = abs(v)
    ar = abs(r)
    surge += (q.Xu[p] + friction * abs(u) + q.Xuuu[p] * u * u) * u
    sway += (
        (q.Yv[p] + q.Yvv[p] * av + q.Yvvv[p] * v * v + q.Yrv[p] * ar) * v
        + (q.Yr[p] + q.Yvr[p] * av + q.Yrr[p] * ar) * r
    )  # fmt: skip
    yaw += (
        (q.Nv[p] + q.Nvv[p] * av + q.Nrv[p] * ar) * v
        + (q.Nr[p] + q.Nvr[p] * av + q.Nrr[p] * ar + q.Nrrr[p] * r * r) * r
    )  # fmt: skip
    c11 = q.coriolis[p, 0]
    sway -= c11 * u * r
    if q.coriolis_linearised[p] == 0:  # does no work
        momentum = q.coriolis[p, 1] * v + q.coriolis[p, 2] * r
        surge += momentum * r
        yaw -= momentum * u - c11 * u * v
    if av >= q.crossflow_dead_zone[p]:
        drag = 0.5 * WATER_DENSITY * q.draught[p] * q.cd2d[p]
        force, moment = crossflow(v, r, q.strip_x0[p], q.strip_x1[p])
        sway -= q.crossflow_sway[p] * drag * force
        yaw -= q.crossflow_yaw[p] * drag * moment
    return q.i11[p] * surge, q.i22[p] * sway + q.i23[p] * yaw, q.i32[p] * sway + q.i33[p] * yaw


@scalar
def crossflow(v, r, x0, x1):
    """Integrals over x0..x1 of |v + x r|(v + x r) dx and of the same times x, in closed form.

    The strip theory of cross-flow drag (Faltinsen 1990, section 6) with constant draught and coefficient.  Where the
    local velocity keeps its sign the integrand is a polynomial; else it is integrated over y = v + x r, which gives
    [|y|^3] / 3r and [y |y|^3 / 4 - v |y|^3 / 3] / r^2.
    """
    y0 = v + x0 * r
    y1 = v + x1 * r
    if y0 * y1 >= 0.0:
        m0 = x1 - x0
        m1 = 0.5 * (x1 * x1 - x0 * x0)
        m2 = (x1 * x1 * x1 - x0 * x0 * x0) * _THIRD
        m3 = m1 * 0.5 * (x1 * x1 + x0 * x0)
        sign = 1.0 if y0 + y1 >= 0.0 else -1.0
        return sign * (v * v * m0 + r * (2.0 * v * m1 + r * m2)), sign * (v * v * m1 + r * (2.0 * v * m2 + r * m3))
    c0 = abs(y0 * y0 * y0)
    c1 = abs(y1 * y1 * y1)
    third = (c1 - c0) * _THIRD
    g = 1.0 / r
    return third * g, (0.25 * (y1 * c1 - y0 * c0) - v * third) * g * g


@inner
def _fluid_memory(w, p, v, r, h):
    """Radiation force of the waves that the hull itself has made: (sway [N], yaw [N m]), and one step of its states.

    Three transfer functions in controllable companion form, with a zero at 0 (no effect on steady motion): sway to
    sway, yaw to yaw, and one of order 2 for both couplings (Kristiansen, Hjulstad and Egeland 2005).
    """
    q = w.plants
    sway = _transfer(q.memory_x[p, 0], q.memory_den[p, 0], q.memory_num[p, 0], v, h)
    yaw = _transfer(q.memory_x[p, 1], q.memory_den[p, 1], q.memory_num[p, 1], r, h)
    sway += _transfer(q.memory_x[p, 2], q.memory_den[p, 2], q.memory_num[p, 2], r, h)
    yaw += _transfer(q.memory_x[p, 3], q.memory_den[p, 2], q.memory_num[p, 2], v, h)
    return q.memory_scale[p, 0] * sway, q.memory_scale[p, 1] * yaw


@inner
def _transfer(x, den, num, drive, h):
    """Output of x1' = drive - den x, x_i' = x_{i-1} half a step on, and the states a step on (implicit midpoint rule).

    Midpoints are m_i = x_i + h/2 m_{i-1}; all follow from m_1, for which one linear equation is solved.  The rule is
    stable at any step, which explicit Euler is not.
    """
    g = 0.5 * h
    k2 = x[1]
    k3 = x[2] + g * k2
    k4 = x[3] + g * k3
    m1 = (x[0] + g * (drive - den[1] * k2 - den[2] * k3 - den[3] * k4)) / (
        1.0 + g * (den[0] + g * (den[1] + g * (den[2] + g * den[3])))
    )
    m2 = x[1] + g * m1
    m3 = x[2] + g * m2
    m4 = x[3] + g * m3
    x[0] = 2.0 * m1 - x[0]
    x[1] = 2.0 * m2 - x[1]
    x[2] = 2.0 * m3 - x[2]
    x[3] = 2.0 * m4 - x[3]
    return num[0] * m1 + num[1] * m2 + num[2] * m3 + num[3] * m4
