"""What two controllers did on the same noise: tests of paired results.  Needs scipy (the extra ``campaign``)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from ..config import ConfigError


@dataclass(frozen=True)
class Discordance:
    """Of a yes-or-no result of pairs: how many only a had, only b had, and what that says."""

    only_a: int
    only_b: int
    both: int
    neither: int
    p: float  #: two-sided exact McNemar test of a = b


@dataclass(frozen=True)
class Shift:
    """Of a number of pairs: the mean difference b - a, its interval and the p of a Wilcoxon signed-rank test."""

    n: int
    mean: float
    low: float
    high: float
    p: float


def mcnemar(a: npt.ArrayLike, b: npt.ArrayLike) -> Discordance:
    """Exact McNemar test of two paired yes-or-no results [n] (McNemar 1947): the discordant pairs are a fair coin's.

    Raises
    ------
    ConfigError
        if scipy is not installed.
    """
    x, y = np.asarray(a, bool), np.asarray(b, bool)
    only_a, only_b = int((x & ~y).sum()), int((~x & y).sum())
    p = 1.0 if only_a + only_b == 0 else float(_scipy().binomtest(only_a, only_a + only_b, 0.5).pvalue)
    return Discordance(only_a, only_b, int((x & y).sum()), int((~x & ~y).sum()), p)


def shift(a: npt.ArrayLike, b: npt.ArrayLike, confidence: float = 0.95, resamples: int = 2000) -> Shift:
    """Mean of b - a over pairs [n] in which both are known, with a percentile bootstrap interval over the pairs.

    The same data give the same interval.

    Raises
    ------
    ConfigError
        if scipy is not installed.
    """
    difference = np.asarray(b, float) - np.asarray(a, float)
    difference = difference[np.isfinite(difference)]
    n = len(difference)
    if n == 0:
        return Shift(0, np.nan, np.nan, np.nan, np.nan)
    mean = float(difference.mean())
    if n < 2 or np.ptp(difference) == 0.0:
        return Shift(n, mean, mean, mean, 1.0 if mean == 0.0 else np.nan)
    stats = _scipy()
    rng = np.random.default_rng(0)
    means = np.concatenate([
        difference[rng.integers(0, n, (min(100, resamples - k), n))].mean(axis=1) for k in range(0, resamples, 100)
    ])
    tail = 50.0 * (1.0 - confidence)
    low, high = np.percentile(means, [tail, 100.0 - tail])
    return Shift(n, mean, float(low), float(high), float(stats.wilcoxon(difference).pvalue))


def _scipy() -> Any:
    try:
        import scipy.stats
    except ImportError as error:
        raise ConfigError(f"comparing policies needs scipy ({error}): pip install 'usv-gym[campaign]'") from None
    return scipy.stats
