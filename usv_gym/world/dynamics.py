"""The 3-DOF model of a surface vessel: one tick of (eta, nu) of a group of lanes (lanes.py).

    M nu_r' + C(nu_r) nu_r + d(nu_r) + mu = tau_thrust + tau_wind + tau_wave,    eta' = R(psi) nu_r + current

in surge, sway and yaw, {b}, relative to the water (Fossen 2021, chapter 6).  Parameters come from a vessel file; the
equations with their sources are in ``docs/vessels.md``.
"""

from __future__ import annotations

import math

from ..jit import inner, scalar
from ..trig import log, sincos_random
from .actuators import thrust
from .disturbance import wind_load
from .lanes import LANES

WATER_DENSITY = 1025.0  #: [kg/m3]
VISCOSITY = 1.0e-6  #: kinematic, of water [m2/s]
_THIRD = 1.0 / 3.0
_PER_DECADE = 1.0 / math.log(10.0)


@inner
def sail(g):
    """Advance all lanes by a tick, after ``actuate`` and ``wave_step``.

    Thrust, wind load, wave force and skin friction are evaluated once per tick; (eta, nu) advance by Heun's method.
    Writes ``eta``, ``nu``, ``velocity``, ``sine``, ``cosine``, ``tau``, ``tau_wind`` and ``memory_x``.
    """
    thrust(g)
    wind_load(g)
    if g.any_memory:
        _fluid_memory(g)
    for l in range(LANES):
        h, psi, sine, cosine = g.h[l], g.eta[2, l], g.sine[l], g.cosine[l]
        current_n, current_e = g.current[0, l], g.current[1, l]
        current_u = cosine * current_n + sine * current_e
        current_v = cosine * current_e - sine * current_n
        u = g.nu[0, l] - current_u
        v = g.nu[1, l] - current_v
        r = g.nu[2, l]
        surge = g.tau[0, l] + (g.tau_wind[0, l] + g.tau_wave[0, l])
        sway = g.tau[1, l] + (g.tau_wind[1, l] + g.tau_wave[1, l])
        yaw = g.tau[2, l] + (g.tau_wind[2, l] + g.tau_wave[2, l])
        remembers = g.memory[l] != 0.0
        sway -= g.memory_force[0, l] if remembers else 0.0
        yaw -= g.memory_force[1, l] if remembers else 0.0
        friction = _surge_friction(g, l, u)

        du, dv, dr = _acceleration(g, l, u, v, r, friction, surge, sway, yaw)
        u1 = u + h * du
        v1 = v + h * dv
        r1 = r + h * dr
        gain = g.yaw_gain[l]
        sine1, cosine1 = sincos_random(psi + h * gain * r)
        du1, dv1, dr1 = _acceleration(g, l, u1, v1, r1, friction, surge, sway, yaw)

        half = 0.5 * h
        north = current_n + 0.5 * (cosine * u - sine * v + cosine1 * u1 - sine1 * v1)
        east = current_e + 0.5 * (sine * u + cosine * v + sine1 * u1 + cosine1 * v1)
        psi += half * gain * (r + r1)
        u += half * (du + du1)
        v += half * (dv + dv1)
        r += half * (dr + dr1)

        sine, cosine = sincos_random(psi)
        turns = g.current_turns[l] != 0.0
        u += cosine * current_n + sine * current_e if turns else current_u
        v += cosine * current_e - sine * current_n if turns else current_v
        g.eta[0, l] += h * north
        g.eta[1, l] += h * east
        g.eta[2, l] = psi
        g.nu[0, l] = u
        g.nu[1, l] = v
        g.nu[2, l] = r
        g.velocity[0, l] = cosine * u - sine * v
        g.velocity[1, l] = sine * u + cosine * v
        g.sine[l] = sine
        g.cosine[l] = cosine


@scalar
def _surge_friction(g, l, u):
    """Coefficient of |u| u: Xuu and, scaled, the ITTC-1957 line 0.075 / (log10 Re - 2)^2 plus a residual of 0.014."""
    reynolds = max(u, 0.2) * g.length_pp[l] / VISCOSITY
    decades = log(reynolds) * _PER_DECADE - 2.0
    scaled = g.Xuu_ittc[l]
    return g.Xuu[l] + (scaled * (0.075 / (decades * decades) + 0.014) if scaled != 0.0 else 0.0)


@scalar
def _acceleration(g, l, u, v, r, friction, surge, sway, yaw):
    """(u', v', r') from velocities through the water and the external force: M^-1 (tau - C nu - d(nu))."""
    av = abs(v)
    ar = abs(r)
    surge += (g.Xu[l] + friction * abs(u) + g.Xuuu[l] * u * u) * u
    sway += (
        (g.Yv[l] + g.Yvv[l] * av + g.Yvvv[l] * v * v + g.Yrv[l] * ar) * v
        + (g.Yr[l] + g.Yvr[l] * av + g.Yrr[l] * ar) * r
    )  # fmt: skip
    yaw += (
        (g.Nv[l] + g.Nvv[l] * av + g.Nrv[l] * ar) * v
        + (g.Nr[l] + g.Nvr[l] * av + g.Nrr[l] * ar + g.Nrrr[l] * r * r) * r
    )  # fmt: skip
    c11 = g.coriolis[0, l]
    sway -= c11 * u * r
    full = 1.0 - g.coriolis_linearised[l]  # what does no work
    momentum = full * (g.coriolis[1, l] * v + g.coriolis[2, l] * r)
    surge += momentum * r
    yaw -= momentum * u - full * c11 * u * v
    drag = 0.5 * WATER_DENSITY * g.draught[l] * g.cd2d[l] if av >= g.crossflow_dead_zone[l] else 0.0
    force, moment = crossflow(v, r, g.strip_x0[l], g.strip_x1[l])
    sway -= g.crossflow_sway[l] * drag * force
    yaw -= g.crossflow_yaw[l] * drag * moment
    return g.i11[l] * surge, g.i22[l] * sway + g.i23[l] * yaw, g.i32[l] * sway + g.i33[l] * yaw


@scalar
def crossflow(v, r, x0, x1):
    """Integrals over x0..x1 of |v + x r|(v + x r) dx and of the same times x, in closed form.

    The strip theory of cross-flow drag (Faltinsen 1990, section 6) with constant draught and coefficient.  Where the
    local velocity keeps its sign the integrand is a polynomial; else it is integrated over y = v + x r, which gives
    [|y|^3] / 3r and [y |y|^3 / 4 - v |y|^3 / 3] / r^2.
    """
    y0 = v + x0 * r
    y1 = v + x1 * r
    m0 = x1 - x0
    m1 = 0.5 * (x1 * x1 - x0 * x0)
    m2 = (x1 * x1 * x1 - x0 * x0 * x0) * _THIRD
    m3 = m1 * 0.5 * (x1 * x1 + x0 * x0)
    sign = 1.0 if y0 + y1 >= 0.0 else -1.0
    force, moment = sign * (v * v * m0 + r * (2.0 * v * m1 + r * m2)), sign * (v * v * m1 + r * (2.0 * v * m2 + r * m3))
    c0 = abs(y0 * y0 * y0)
    c1 = abs(y1 * y1 * y1)
    third = (c1 - c0) * _THIRD
    one_sign = y0 * y1 >= 0.0
    g = 1.0 / (1.0 if one_sign else r)
    crossing = (0.25 * (y1 * c1 - y0 * c0) - v * third) * g * g
    return force if one_sign else third * g, moment if one_sign else crossing


@inner
def _fluid_memory(g):
    """Radiation force of the waves that the hull itself has made into ``memory_force``, and one step of its states.

    Three transfer functions in controllable companion form, with a zero at 0 (no effect on steady motion): sway to
    sway, yaw to yaw, and one of order 2 for both couplings (Kristiansen, Hjulstad and Egeland 2005).
    """
    for l in range(LANES):
        h, sine, cosine = g.h[l], g.sine[l], g.cosine[l]
        v = g.nu[1, l] - (cosine * g.current[1, l] - sine * g.current[0, l])
        r = g.nu[2, l]
        sway = _transfer(g, l, 0, 0, v, h) + _transfer(g, l, 2, 2, r, h)
        yaw = _transfer(g, l, 1, 1, r, h) + _transfer(g, l, 3, 2, v, h)
        g.memory_force[0, l] = g.memory_scale[0, l] * sway
        g.memory_force[1, l] = g.memory_scale[1, l] * yaw


@scalar
def _transfer(g, l, s, k, drive, h):
    """Output of x1' = drive - den x, x_i' = x_{i-1} half a step on, and the states a step on (implicit midpoint rule).

    x: row s of ``memory_x``; den, num: row k.  Midpoints are m_i = x_i + h/2 m_{i-1}; all follow from m_1, for which one linear
    equation is solved.  The rule is stable at any step, which explicit Euler is not.
    """
    x, den, num = g.memory_x, g.memory_den, g.memory_num
    half = 0.5 * h
    k2 = x[s, 1, l]
    k3 = x[s, 2, l] + half * k2
    k4 = x[s, 3, l] + half * k3
    m1 = (x[s, 0, l] + half * (drive - den[k, 1, l] * k2 - den[k, 2, l] * k3 - den[k, 3, l] * k4)) / (
        1.0 + half * (den[k, 0, l] + half * (den[k, 1, l] + half * (den[k, 2, l] + half * den[k, 3, l])))
    )
    m2 = x[s, 1, l] + half * m1
    m3 = x[s, 2, l] + half * m2
    m4 = x[s, 3, l] + half * m3
    x[s, 0, l] = 2.0 * m1 - x[s, 0, l]
    x[s, 1, l] = 2.0 * m2 - x[s, 1, l]
    x[s, 2, l] = 2.0 * m3 - x[s, 2, l]
    x[s, 3, l] = 2.0 * m4 - x[s, 3, l]
    return num[k, 0, l] * m1 + num[k, 1, l] * m2 + num[k, 2, l] * m3 + num[k, 3, l] * m4
