"""``waypoints``: line-of-sight guidance with integral action along the route; sees no traffic."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..jit import kernel
from .pilot import OWN, TARGET, Pilot, command, line_of_sight, look


@kernel
def _decide(obs, mask, ship, tuning, states, actions):
    own = np.zeros(1, OWN)[0]
    targets = np.zeros(ship[0].targets + ship[0].land, TARGET)
    for b in range(obs.shape[0]):
        if mask[b]:
            look(obs[b], ship[0], own, targets)
            line_of_sight(own, ship[0], states[b])
            command(actions[b], ship[0], own.wanted, ship[0].cruise)


class Waypoints(Pilot):
    """Line-of-sight guidance with integral action (Boerhaug, Pavlov and Pettersen, CDC 2008); sees no traffic."""

    @staticmethod
    def kernel() -> Any:
        """See :class:`~usv_gym.policies.pilot.Pilot`."""
        return _decide
