"""What a count of k in n says about a rate."""

from __future__ import annotations

import math
from collections.abc import Callable


def clopper_pearson(k: int, n: int, confidence: float = 0.95) -> tuple[float, float]:
    """The exact (Clopper-Pearson) interval of a rate of which ``k`` in ``n`` independent trials were seen."""
    if not 0 <= k <= n or n == 0:
        raise ValueError(f"expected 0 <= k <= n and n > 0, got {k} of {n}")
    tail = (1.0 - confidence) / 2.0
    low = 0.0 if k == 0 else _solve(lambda p: 1.0 - _at_most(k - 1, n, p), tail)
    high = 1.0 if k == n else _solve(lambda p: 1.0 - _at_most(k, n, p), 1.0 - tail)
    return low, high


def _at_most(k: int, n: int, p: float) -> float:
    """P(X <= k) of a binomial number X."""
    lp, lq, ln = math.log(p), math.log1p(-p), math.lgamma(n + 1)
    return math.fsum(
        math.exp(ln - math.lgamma(i + 1) - math.lgamma(n - i + 1) + i * lp + (n - i) * lq) for i in range(k + 1)
    )


def _solve(rising: Callable[[float], float], value: float) -> float:
    """Where a rising function on (0, 1) takes a value, by bisection."""
    low, high = 0.0, 1.0
    for _ in range(50):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if rising(middle) < value else (low, middle)
    return 0.5 * (low + high)


def upper_bound(k: int, n: int, confidence: float = 0.95) -> float:
    """What a rate lies below at a one-sided confidence, after ``k`` in ``n``: 0 in 1000 is below 0.3 % at 95 %."""
    return clopper_pearson(k, n, 2.0 * confidence - 1.0)[1]
