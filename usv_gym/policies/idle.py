"""``idle``: asks for nothing."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray


class Idle:
    """Asks for nothing: no thrust."""

    action = "default"
    observation = "tracks"
    flat = True

    def reset(self, info: dict[str, Any]) -> None:
        """Remember how long an action is."""
        self.reset_batch(1, info)

    def act(self, observation: Any) -> NDArray[np.float32]:
        """Zero demand."""
        zero: NDArray[np.float32] = self._zero[0]
        return zero

    def reset_batch(self, num: int, info: Any) -> None:
        """The same for many rows."""
        self._zero = np.zeros((num, int(info["scales"]["channels"])), np.float32)

    def act_batch(self, observations: Any, mask: Any = None) -> NDArray[np.float32]:
        """Zero demand."""
        return self._zero
