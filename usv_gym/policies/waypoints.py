"""``waypoints``: line-of-sight guidance with integral action along the route; sees no traffic."""

from __future__ import annotations

from ..jit import kernel
from .pilot import Pilot, command, line_of_sight, look


@kernel
def _decide(obs, mask, ship_, tuning_, own_, targets, states, actions):
    ship, own = ship_[0], own_[0]
    for b in range(obs.shape[0]):
        if mask[b]:
            look(obs[b], ship, own, targets)
            line_of_sight(own, ship, states[b])
            command(actions[b], ship, own.wanted, ship.cruise)


class Waypoints(Pilot):
    """Line-of-sight guidance with integral action (Boerhaug, Pavlov and Pettersen, CDC 2008); sees no traffic."""

    decide = staticmethod(_decide)
