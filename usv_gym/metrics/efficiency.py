"""What an episode cost: distance, time, and how busy the controls were.  Functions of plain arrays, B episodes at once."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]


def _within(steps: npt.NDArray[np.int64], T: int) -> npt.NDArray[np.bool_]:
    """[B, T - 1] whether the way to the next sample is part of the episode."""
    return np.arange(1, T)[None] < steps[:, None]


def sailed(position: Floats, steps: npt.NDArray[np.int64]) -> Floats:
    """Length [B] of tracks [B, T, 2] in metres, over their first ``steps`` [B] samples."""
    ways = np.hypot(*np.moveaxis(np.diff(position, axis=1), -1, 0))
    return np.asarray(np.where(_within(steps, position.shape[1]), ways, 0.0).sum(axis=1))


def activity(signal: Floats, t: Floats, steps: npt.NDArray[np.int64]) -> Floats:
    """Mean rate [B] at which signals [B, T] move, up and down alike, per second; NaN where a signal is not known."""
    moves = np.where(_within(steps, signal.shape[1]), np.abs(np.diff(signal, axis=1)), 0.0).sum(axis=1)
    duration = np.take_along_axis(t, np.maximum(steps - 1, 0)[:, None], axis=1)[:, 0] - t[:, 0]
    return np.asarray(np.divide(moves, duration, out=np.full(len(steps), np.nan), where=duration > 0.0))
