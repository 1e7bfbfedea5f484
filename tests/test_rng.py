"""The counter generator: its numbers look random in every direction that the simulator counts in."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from usv_gym import rng
from usv_gym.jit import kernel

N = 200_000


@kernel
def _draw(out, seed, stream, slot, tick, d_seed, d_stream, d_slot, d_tick):
    for i in range(out.shape[0]):
        a, b = rng.normal2(seed + np.uint64(i * d_seed), stream + i * d_stream, slot + i * d_slot, tick + i * d_tick)
        out[i, 0] = a
        out[i, 1] = b
        out[i, 2] = rng.uniform(seed + np.uint64(i * d_seed), stream + i * d_stream, slot + i * d_slot, tick + i * d_tick)


@pytest.mark.parametrize("along", ["seed", "slot", "tick"])
@pytest.mark.parametrize("seed", [0, 1, 2**63 + 12345])
def test_numbers_along_every_axis_are_independent_and_well_distributed(along, seed):
    out = np.zeros((N, 3))
    step = {"seed": (1, 0, 0, 0), "slot": (0, 0, 1, 0), "tick": (0, 0, 0, 1)}[along]
    _draw(out, np.uint64(seed), 20, 3, 7, *step)
    for k in range(2):
        assert stats.kstest(out[:, k], "norm").pvalue > 1e-4
    assert stats.kstest(out[:, 2], "uniform").pvalue > 1e-4
    bound = 4.5 / np.sqrt(N)
    assert abs(np.corrcoef(out[:, 0], out[:, 1])[0, 1]) < bound
    for lag in (1, 2, 16):
        for k in range(3):
            x = out[:, k] - out[:, k].mean()
            assert abs((x[lag:] * x[:-lag]).mean() / x.var()) < bound


def test_streams_are_different():
    a, b = np.zeros((N, 3)), np.zeros((N, 3))
    _draw(a, np.uint64(5), 20, 0, 0, 0, 0, 0, 1)
    _draw(b, np.uint64(5), 21, 0, 0, 0, 0, 0, 1)
    assert abs(np.corrcoef(a[:, 0], b[:, 0])[0, 1]) < 4.5 / np.sqrt(N)
