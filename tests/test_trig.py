"""The kernels' own functions against libm, to the errors that their docstrings state."""

from __future__ import annotations

import math

import numba
import numpy as np
import pytest

from usv_gym import trig

RNG = np.random.default_rng(7)
POLAR = RNG.uniform(-1e6, 1e6, (20_000, 2)) * 10.0 ** RNG.uniform(-9, 0, (20_000, 2))


def _over(function):
    """An inlined scalar as a function of arrays."""

    @numba.njit
    def apply(x):
        out = np.empty_like(x)
        for i in range(len(x)):
            out[i] = function(x[i])
        return out

    return apply


@pytest.mark.parametrize(
    ("ours", "numpys", "x"),
    [
        (trig.log, np.log, 10.0 ** RNG.uniform(-300, 300, 20_000)),
        (trig.exp, np.exp, np.concatenate([RNG.uniform(-700, 700, 20_000), RNG.uniform(-1e-6, 1e-6, 1000), [0.0, -0.0, 1.0]])),
    ],
    ids=["log", "exp"],
)
def test_logarithm_and_exponential_to_a_unit_in_the_last_place(ours, numpys, x):
    y, exact = _over(ours)(x), numpys(x)
    assert np.abs((y - exact) / np.spacing(np.abs(exact))).max() <= 2.0


def test_exponential_far_out():
    y = _over(trig.exp)(np.array([-1e9, -701.0, -math.inf, math.nan]))
    assert (y[:3] < 1e-300).all()
    assert (y[:3] >= 0.0).all()
    assert np.isnan(y[3])


@pytest.mark.parametrize("kind", [trig.sincos, trig.sincos_random], ids=["sincos", "sincos_random"])
def test_sine_and_cosine(kind):
    @numba.njit
    def both(x):
        out = np.empty((len(x), 2))
        for i in range(len(x)):
            out[i, 0], out[i, 1] = kind(x[i])
        return out

    x = np.concatenate([RNG.uniform(-1e5, 1e5, 20_000), np.arange(-16, 17) * (math.pi / 4)])
    assert np.abs(both(x) - np.column_stack([np.sin(x), np.cos(x)])).max() < 4.5e-16


def test_angle_of_a_point():
    @numba.njit
    def angles(points):
        out = np.empty(len(points))
        for i in range(len(points)):
            out[i] = trig.atan2(points[i, 0], points[i, 1])
        return out

    signs = np.array([[a, b] for a in (-1.0, 0.0, 1.0) for b in (-1.0, 0.0, 1.0)])
    points = np.concatenate([POLAR, signs])
    assert np.abs(angles(points) - np.arctan2(points[:, 0], points[:, 1])).max() < 9e-16
