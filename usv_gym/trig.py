"""Scalar math for the kernels: polynomial sine, cosine, arctangent, logarithm and exponential, distances, and angle wrapping.

libm's calls keep LLVM from vectorising a loop and cost about 12 ns each; these are branch-free and cost 1 to 2 ns.
Coefficients: Moshier's Cephes library (sin.c) with the reduction by Cody and Waite, error at most 4.5e-16 for |x| < 1e5;
arctangent, logarithm and exponential are those of Sun's fdlibm (s_atan.c, e_log.c, e_exp.c), error about one unit in the last
place.
"""

from __future__ import annotations

import math

import numpy as np

from .jit import scalar

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
    n = np.floor(x * (2.0 / PI) + 0.5)
    m = 2.0 * n
    y = ((x - m * _PIO4_1) - m * _PIO4_2) - m * _PIO4_3
    z = y * y
    s = y + y * z * (
        (((((1.58962301576546568060e-10 * z - 2.50507477628578072866e-8) * z + 2.75573136213857245213e-6) * z
           - 1.98412698295895385996e-4) * z + 8.33333333332211858878e-3) * z) - 1.66666666666666307295e-1
    )
    c = 1.0 - 0.5 * z + z * z * (
        ((((-1.13585365213876817300e-11 * z + 2.08757008419747316778e-9) * z - 2.75573141792967388112e-7) * z
          + 2.48015872888517045348e-5) * z - 1.38888888888730564116e-3) * z + 4.16666666666665929218e-2
    )
    return s, c, np.int64(n)


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
    return (1.0 - np.float64(q & 2)) * (keep * s + swap * c), (1.0 - np.float64((q + 1) & 2)) * (keep * c + swap * s)


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
    odd = z * (3.33333333333329318027e-01 + u * (1.42857142725034663711e-01 + u * (9.09088713343650656196e-02
        + u * (6.66107313738753120669e-02 + u * (4.97687799461593236017e-02 + u * 1.62858201153657823623e-02)))))  # fmt: skip
    even = u * (-1.99999999998764832476e-01 + u * (-1.11111104054623557880e-01 + u * (-7.69187620504482999495e-02
        + u * (-5.83357013379057348645e-02 + u * -3.65315727442169155270e-02))))  # fmt: skip
    a = w - w * (odd + even)
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
    r = z * (6.666666666666735130e-01 + z * (3.999999999940941908e-01 + z * (2.857142874366239149e-01
        + z * (2.222219843214978396e-01 + z * (1.818357216161805012e-01 + z * (1.531383769920937332e-01
        + z * 1.479819860511658591e-01))))))  # fmt: skip
    half = 0.5 * f * f
    return k * 6.93147180369123816490e-01 - ((half - (s * (half + r) + k * 1.90821492927058770002e-10)) - f)


@scalar
def exp(x):
    """e to the power of x, for x up to 700; below -700 as at -700."""
    x = -700.0 if x < -700.0 else x
    k = np.floor(x * 1.44269504088896338700 + 0.5)
    high = x - k * 6.93147180369123816490e-01
    low = k * 1.90821492927058770002e-10
    r = high - low
    t = r * r
    c = r - t * (1.66666666666666019037e-01 + t * (-2.77777777770155933842e-03 + t * (6.61375632143793436117e-05
        + t * (-1.65339022054652515390e-06 + t * 4.13813679705723846039e-08))))  # fmt: skip
    y = 1.0 - ((low - (r * c) / (2.0 - c)) - high)
    return y * np.int64((np.int64(k) + 1023) << 52).view(np.float64)


@scalar
def hypot(x, y):
    """Length of a vector; of sizes of which the square is a number."""
    return math.sqrt(x * x + y * y)


@scalar
def wrap(angle):
    """Angle [rad] wrapped to [-pi, pi)."""
    return angle - TWO_PI * np.floor(angle * (1.0 / TWO_PI) + 0.5)


@scalar
def wrap_positive(angle):
    """Angle [rad] wrapped to [0, 2 pi)."""
    a = angle - TWO_PI * np.floor(angle * (1.0 / TWO_PI))
    return 0.0 if a >= TWO_PI else a


@scalar
def clip(value, low, high):
    """Value limited to [low, high]."""
    return min(max(value, low), high)
