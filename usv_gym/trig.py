"""Scalar math for the kernels: polynomial sine, cosine, arctangent, logarithm and exponential, distances, and angle wrapping.

libm's calls keep LLVM from vectorising a loop and cost about 12 ns each; these are branch-free and cost 1 to 2 ns.
Coefficients: Moshier's Cephes library (sin.c) with the reduction by Cody and Waite, error at most 4.5e-16 for |x| < 1e5;
arctangent, logarithm and exponential are those of Sun's fdlibm (s_atan.c, e_log.c, e_exp.c), error about one unit in the last
place.
"""

from __future__ import annotations

import math

import numpy as np

from .jit import fma, scalar

PI = math.pi
TWO_PI = 2.0 * math.pi

_PIO4_1 = 7.85398125648498535156e-1
_PIO4_2 = 3.77489470793079817668e-8
_PIO4_3 = 2.69515142907905952645e-15
_MANTISSA = np.int64(0x000FFFFFFFFFFFFF)
_ONE = np.int64(0x3FF0000000000000)
_ABOVE_ROOT = np.int64(0x3FF0000000000000 - 0x3FE6A09E667F3BCD)  # bits of 1 less bits of sqrt(1/2)


@scalar
def _octant(x):
    """Sine and cosine of x less the nearest multiple n of pi/2, and n."""
    n = np.floor(fma(x, 2.0 / PI, 0.5))
    m = 2.0 * n
    y = fma(m, -_PIO4_3, fma(m, -_PIO4_2, fma(m, -_PIO4_1, x)))
    z = y * y
    p = fma(z, 1.58962301576546568060e-10, -2.50507477628578072866e-8)
    p = fma(z, p, 2.75573136213857245213e-6)
    p = fma(z, p, -1.98412698295895385996e-4)
    p = fma(z, p, 8.33333333332211858878e-3)
    p = fma(z, p, -1.66666666666666307295e-1)
    q = fma(z, -1.13585365213876817300e-11, 2.08757008419747316778e-9)
    q = fma(z, q, -2.75573141792967388112e-7)
    q = fma(z, q, 2.48015872888517045348e-5)
    q = fma(z, q, -1.38888888888730564116e-3)
    q = fma(z, q, 4.16666666666665929218e-2)
    return fma(y * z, p, y), fma(z * z, q, fma(z, -0.5, 1.0)), np.int64(n)


@scalar
def sincos(x):
    """(sin x, cos x) of an angle [rad]."""
    s, c, n = _octant(x)
    q = n & 3
    swap = (q & 1) == 1
    sine = c if swap else s
    cosine = s if swap else c
    sine = -sine if q >= 2 else sine
    cosine = -cosine if (q == 1 or q == 2) else cosine
    return sine, cosine


@scalar
def sincos_random(x):
    """The same without a branch, which is slower for angles that change slowly and twice as fast for random ones."""
    s, c, q = _octant(x)
    swap = np.float64(q & 1)
    keep = 1.0 - swap
    sine, cosine = fma(keep, s, swap * c), fma(keep, c, swap * s)
    return (1.0 - np.float64(q & 2)) * sine, (1.0 - np.float64((q + 1) & 2)) * cosine


@scalar
def atan2(y, x):
    """Angle [rad] in (-pi, pi] of the point (x, y); 0 for (0, 0)."""
    ax = abs(x)
    ay = abs(y)
    top = min(ax, ay)
    bottom = max(ax, ay)
    far = top > 0.41421356237309503 * bottom  # tan(pi/8)
    w = (top - bottom if far else top) / max(top + bottom if far else bottom, 2.2250738585072014e-308)
    z = w * w
    u = z * z
    odd = fma(u, 1.62858201153657823623e-02, 4.97687799461593236017e-02)
    odd = fma(u, odd, 6.66107313738753120669e-02)
    odd = fma(u, odd, 9.09088713343650656196e-02)
    odd = fma(u, odd, 1.42857142725034663711e-01)
    odd = fma(u, odd, 3.33333333333329318027e-01)
    even = fma(u, -3.65315727442169155270e-02, -5.83357013379057348645e-02)
    even = fma(u, even, -7.69187620504482999495e-02)
    even = fma(u, even, -1.11111104054623557880e-01)
    even = fma(u, even, -1.99999999998764832476e-01)
    a = fma(-w, fma(z, odd, u * even), w)
    a = a + 0.25 * PI if far else a
    a = 0.5 * PI - a if ay > ax else a
    a = PI - a if x < 0.0 else a
    return -a if y < 0.0 else a


@scalar
def log(x):
    """Natural logarithm of a positive normal number."""
    bits = np.float64(x).view(np.int64)
    # x = 2^k (1 + f) with 1 + f in [sqrt(1/2), sqrt(2))
    shifted = bits + _ABOVE_ROOT
    k = np.float64((shifted >> 52) - 1023)
    f = np.int64((shifted & _MANTISSA) - _ABOVE_ROOT + _ONE).view(np.float64) - 1.0
    s = f / (2.0 + f)
    z = s * s
    r = fma(z, 1.479819860511658591e-01, 1.531383769920937332e-01)
    r = fma(z, r, 1.818357216161805012e-01)
    r = fma(z, r, 2.222219843214978396e-01)
    r = fma(z, r, 2.857142874366239149e-01)
    r = fma(z, r, 3.999999999940941908e-01)
    r = fma(z, r, 6.666666666666735130e-01)
    half = 0.5 * f * f
    small = fma(s, fma(z, r, half), k * 1.90821492927058770002e-10)
    return fma(k, 6.93147180369123816490e-01, f - (half - small))


@scalar
def exp(x):
    """e to the power of x, for x up to 700; below -700 as at -700."""
    x = -700.0 if x < -700.0 else x
    k = np.floor(x * 1.44269504088896338700 + 0.5)
    high = fma(k, -6.93147180369123816490e-01, x)
    low = k * 1.90821492927058770002e-10
    r = high - low
    t = r * r
    p = fma(t, 4.13813679705723846039e-08, -1.65339022054652515390e-06)
    p = fma(t, p, 6.61375632143793436117e-05)
    p = fma(t, p, -2.77777777770155933842e-03)
    p = fma(t, p, 1.66666666666666019037e-01)
    c = fma(-t, p, r)
    y = 1.0 - ((low - (r * c) / (2.0 - c)) - high)
    return y * np.int64((np.int64(k) + 1023) << 52).view(np.float64)


@scalar
def hypot(x, y):
    """Length of a vector; of sizes of which the square is a number."""
    return math.sqrt(fma(x, x, y * y))


@scalar
def wrap(angle):
    """Angle [rad] wrapped to [-pi, pi)."""
    return fma(np.floor(fma(angle, 1.0 / TWO_PI, 0.5)), -TWO_PI, angle)


@scalar
def wrap_positive(angle):
    """Angle [rad] wrapped to [0, 2 pi)."""
    a = fma(np.floor(angle * (1.0 / TWO_PI)), -TWO_PI, angle)
    return 0.0 if a >= TWO_PI else a


@scalar
def clip(value, low, high):
    """Value limited to [low, high]."""
    return min(max(value, low), high)
