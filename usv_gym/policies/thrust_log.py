"""Recorded missions: rows of percent commands, 100 a second, that drive the actuators directly."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..config import ConfigError
from ..world.state import A
from ..world.vessel import VesselModel

RATE = 100.0  #: rows per second
COLUMNS = ("left rpm", "left nozzle", "left bucket", "right rpm", "right nozzle", "right bucket")


def read_thrust_log(path: str | Path) -> NDArray[np.float64]:
    """Rows [n, 6] of a thrust log in percent: rpm, nozzle and bucket, left then right.

    One row per line, numbers separated by commas or white space; ``#`` starts a comment.

    Raises
    ------
    ConfigError
        if the file is missing, empty, or a line is not six finite numbers.
    """
    file = Path(path)
    try:
        text = file.read_text(encoding="utf-8")
    except FileNotFoundError:
        raise ConfigError(f"{file}: no such file") from None
    except (OSError, UnicodeDecodeError) as error:
        raise ConfigError(f"{file}: cannot be read as text: {error}") from None
    rows: list[list[float]] = []
    for number, line in enumerate(text.splitlines(), 1):
        parts = line.partition("#")[0].replace(",", " ").split()
        if not parts:
            continue
        try:
            row = [float(part) for part in parts]
        except ValueError:
            raise ConfigError(f"{file}:{number}: expected {len(COLUMNS)} numbers, got {line.strip()[:60]!r}") from None
        if len(row) != len(COLUMNS):
            raise ConfigError(f"{file}:{number}: expected {len(COLUMNS)} numbers ({', '.join(COLUMNS)}), got {len(row)}")
        if not all(map(math.isfinite, row)):
            raise ConfigError(f"{file}:{number}: expected finite numbers, got {line.strip()[:60]!r}")
        rows.append(row)
    if not rows:
        raise ConfigError(f"{file}: an empty thrust log: expected rows of {', '.join(COLUMNS)} in percent")
    return np.array(rows)


def commands(log: NDArray[np.float64], model: VesselModel) -> NDArray[np.float64]:
    """Commands [n, A, 3] in [-1, 1] of a log [n, 6] for a vessel: its port thruster takes left, the starboard one right.

    Raises
    ------
    ConfigError
        if the vessel has no pair of stern thrusters.
    """
    port = [a for a, t in enumerate(model.thrusters) if t.y_m < 0]
    starboard = [a for a, t in enumerate(model.thrusters) if t.y_m > 0]
    if len(port) != 1 or len(starboard) != 1:
        raise ConfigError(f"vessel {model.name}: a thrust log needs one thruster on either side")
    result = np.zeros((len(log), A, 3))
    result[:, port[0]] = log[:, 0:3] / 100.0
    result[:, starboard[0]] = log[:, 3:6] / 100.0
    limited: NDArray[np.float64] = np.clip(result, -1.0, 1.0)
    return limited


def per_tick(rows: NDArray[np.float64], dt: float) -> NDArray[np.float64]:
    """Rows [n, A, 3] at ``RATE`` grouped by tick: [ticks, k, A, 3], the last row held to fill the last tick.

    A tick shorter than a row's spacing holds the row that is current.
    """
    k = RATE * dt
    if k < 1.0:
        ticks = math.ceil(len(rows) / k)
        held: NDArray[np.float64] = rows[np.minimum((np.arange(ticks) * k).astype(int), len(rows) - 1)]
        return held[:, None]
    per = max(round(k), 1)
    ticks = -(-len(rows) // per)
    index = np.minimum(np.arange(ticks * per), len(rows) - 1)
    grouped: NDArray[np.float64] = rows[index].reshape(ticks, per, *rows.shape[1:])
    return grouped
