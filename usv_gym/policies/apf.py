"""``apf``: an artificial potential field that turns with the rules.

S. S. Ge and Y. J. Cui, "Dynamic Motion Planning for Mobile Robots Using Potential Field Method", Autonomous Robots 13,
207-222, 2002: repulsion by the speed of approach.  H. Lyu and Y. Yin, "COLREGS-Constrained Real-Time Path Planning for
Autonomous Ships Using Modified Artificial Potential Fields", Journal of Navigation 72(3), 588-608, 2019: a force to starboard
where the rules ask for it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from ..jit import kernel
from ..trig import atan2, clip, sincos, wrap
from ..world.encounter import CROSSING_GIVE_WAY, CROSSING_STAND_ON, HEAD_ON, OVERTAKEN
from .pilot import Pilot, classify, command, line_of_sight, look


@dataclass(frozen=True)
class Tuning:
    """Reach and strength of the field.  The pull along the line of sight is 1; distances are between hulls."""

    reach: float = 260.0  #: [m] of what moves
    reach_fixed: float = 80.0  #: [m] of what does not
    strength: float = 1.8  #: of the push away from what is approached, at half its reach
    swirl: float = 1.8  #: of the push to starboard, where Rules 14 and 15 ask to give way
    swirl_fixed: float = 0.7  #: of the push around what does not move, on the nearer side
    stand_on: float = 0.45  #: share of the reach that a vessel has which has to keep clear of us (Rule 17)
    rule_dcpa: float = 120.0  #: [m]
    rule_tcpa: float = 120.0  #: [s]


@kernel
def _decide(obs, mask, ship_, tuning_, own_, targets, states, actions):
    ship, k, own = ship_[0], tuning_[0], own_[0]
    for b in range(obs.shape[0]):
        if not mask[b]:
            continue
        state = states[b]
        found = look(obs[b], ship, own, targets)
        integral = state.integral
        line_of_sight(own, ship, state)
        classify(own, ship, targets, found, k.rule_dcpa, k.rule_tcpa)
        fy, fx = sincos(own.wanted)
        pushed = 0.0
        for j in range(found):
            t = targets[j]
            reach = k.reach if t.moves else k.reach_fixed
            if t.code == CROSSING_STAND_ON or t.code == OVERTAKEN:
                reach *= k.stand_on
            gap = max(t.distance - t.radius - 0.5 * ship.length, 1.0)
            if gap >= reach or t.distance == 0.0:
                continue
            nx, ny = t.x / t.distance, t.y / t.distance  # towards it
            approach = ((own.u - t.vx) * nx + (own.v - t.vy) * ny) / ship.cruise
            if approach <= 0.0:
                continue
            push = min(approach, 2.0) * (reach / gap - 1.0)
            pushed += push
            fx -= k.strength * push * nx
            fy -= k.strength * push * ny
            if t.code == HEAD_ON or t.code == CROSSING_GIVE_WAY:
                side, swirl = 1.0, k.swirl  # to starboard of the line to it
            else:
                # around it on the side where it will be passed anyway
                wx, wy = own.u - t.vx, own.v - t.vy
                side = -1.0 if wx * ny - wy * nx > 0.0 else 1.0
                swirl = k.swirl_fixed
            fx -= side * swirl * push * ny
            fy += side * swirl * push * nx
        turn = atan2(fy, fx)
        if pushed > 0.0:
            state.integral = integral  # off the track on purpose
        # slower, the more the field turns away from where the ship is heading
        share = clip(0.25 + 0.75 * math.cos(clip(turn, -1.5, 1.5)), 0.25, 1.0) if pushed > 0.0 else 1.0
        command(actions[b], ship, wrap(turn), ship.cruise * share)


class PotentialField(Pilot):
    """An artificial potential field that turns with the rules, after Ge and Cui (2002) and Lyu and Yin (2019).

    The route pulls; what is approached pushes away, the more the nearer and the faster, and sideways: to starboard in head-on
    and give-way encounters, else around on the side where it will be passed.
    """

    parameters = Tuning
    decide = staticmethod(_decide)
