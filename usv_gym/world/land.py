"""Land as kernels see it: one flat, read-only pool of indexed coasts that any number of worlds share.

A world names its coast by ``land_id`` (truth) and ``chart_id`` (what the own ship's chart shows), both -1 for none; the
pool itself is an argument of the batch kernels and never part of a record.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

#: the pool of the open sea
NO_LAND: NDArray[np.float64] = np.zeros(1)
