"""``vo``: velocity obstacles with COLREGs.

Y. Kuwata, M. T. Wolf, D. Zarzhitsky and T. L. Huntsberger, "Safe Maritime Autonomous Navigation With COLREGS, Using Velocity
Obstacles", IEEE Journal of Oceanic Engineering 39(1), 110-119, 2014.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ..jit import inner, kernel
from ..trig import sincos, wrap
from ..units import DEG
from ..world.encounter import CROSSING_GIVE_WAY, CROSSING_STAND_ON, HEAD_ON, OVERTAKEN, SAFE
from .pilot import Pilot, classify, command, line_of_sight, look, price_of_slowing, wait

_SPREAD, _OFFSETS = 5.0 * DEG, 49  # headings from 120 deg to port to 120 deg to starboard of the wanted one
_DELAY = 1.5  # [s] before it begins to turn
_ARC_STEP = 3.0  # [s] at which it looks around in a turn
_SHARES = 5  # of the cruising speed: 1, 3/4, 1/2, 1/4, 0


@dataclass(frozen=True)
class Tuning:
    """Sizes of the velocity obstacles, and the cost of a velocity.  Distances are between hulls."""

    domain: float = 2.1  #: lengths of both vessels kept from what moves,
    margin: float = 90.0  #: [m] but not more
    margin_fixed: float = 20.0  #: [m] kept from what does not
    on_arc: float = 0.5  #: share of the margin kept while turning
    horizon: float = 120.0  #: [s] a velocity that meets something later than this is free
    horizon_fixed: float = 35.0  #: [s] the same of what does not move
    stand_on: float = 60.0  #: [s] the same of a vessel that has to keep clear of us (Rule 17)
    rule_dcpa: float = 120.0  #: [m] nearer than this on the route, a vessel is one that the rules are about
    rule_tcpa: float = 150.0  #: [s]
    turn: float = 1.0  #: cost of a radian off the wanted heading
    slow: float = 4.0  #: of standing still instead of cruising
    patience: float = 30.0  #: [s] of being turned away, after which slowing down costs half
    change: float = 0.8  #: of a radian off the heading asked for last
    timid: float = 0.6  #: of a turn that nobody would notice (Rule 8), less than ``apparent``
    apparent: float = 30.0 * DEG  #: [rad]
    unlawful: float = 6.0  #: of passing on the wrong side
    danger: float = 20.0  #: of a velocity inside an obstacle, and as much again the sooner it meets it


@inner
def _time_to_contact(px, py, vx, vy, reach):
    """When a point at (px, py) that moves at (vx, vy) comes within ``reach`` of the origin; inf if never."""
    d2 = px * px + py * py
    closing = -(px * vx + py * vy)
    if closing <= 0.0:
        return math.inf
    if d2 <= reach * reach:
        return 0.0
    v2 = vx * vx + vy * vy
    root = closing * closing - v2 * (d2 - reach * reach)
    if root < 0.0:
        return math.inf
    return (closing - math.sqrt(root)) / v2


@inner
def _cost(turn, offset, speed, own, ship, k, targets, found, arc, enough):
    """What the velocity (turn off the present heading, speed) costs for the sake of the targets; at most about ``enough``."""
    s, c = sincos(turn)
    vx, vy = speed * c, speed * s
    # it takes a while to turn: the new velocity holds from the end of an arc on, and a ship that slows runs on a little
    radius = own.u / ship.turn_rate
    then = _DELAY + abs(turn) / ship.turn_rate
    points = min(1 + int(then / _ARC_STEP), arc.shape[0])
    for i in range(points):
        part = turn * (i + 1) / points
        ps, pc = sincos(part)
        arc[i, 0] = own.u * _DELAY + radius * abs(ps)
        arc[i, 1] = radius * (1.0 - pc) * (1.0 if turn > 0.0 else -1.0)
        arc[i, 2] = _DELAY + abs(part) / ship.turn_rate
    run = max(own.u - speed, 0.0) * ship.speed_time
    ex, ey = arc[points - 1, 0] + run * c, arc[points - 1, 1] + run * s
    cost = 0.0
    for j in range(found):
        t = targets[j]
        bare = t.radius + 0.5 * ship.length
        margin = min(2.0 * k.domain * bare, k.margin) if t.moves else k.margin_fixed
        reach = bare + margin
        px, py = t.x + t.vx * then - ex, t.y + t.vy * then - ey
        d = math.hypot(px, py)
        on_arc = d
        for i in range(points):
            on_arc = min(on_arc, math.hypot(t.x + t.vx * arc[i, 2] - arc[i, 0], t.y + t.vy * arc[i, 2] - arc[i, 1]))
        if on_arc < min(bare + k.on_arc * margin, 0.95 * t.distance):
            cost = max(cost, 2.0 * k.danger)  # met while it is still turning or losing way
        # inside the margin already: a velocity that leads out of it is free
        reach = max(bare, min(reach, 0.995 * d, 0.995 * t.distance))
        horizon = k.horizon if t.moves else k.horizon_fixed
        gives_way = t.code == CROSSING_STAND_ON or t.code == OVERTAKEN
        if gives_way:
            horizon = k.stand_on
        wx, wy = t.vx - vx, t.vy - vy
        contact = then + _time_to_contact(px, py, wx, wy, reach)
        if contact < horizon:
            cost = max(cost, k.danger * (2.0 - contact / horizon))
        if t.code == HEAD_ON or t.code == CROSSING_GIVE_WAY:
            # the region V1 of the paper: towards the vessel, and past it with the vessel to starboard
            w2 = wx * wx + wy * wy
            if px * wx + py * wy < 0.0 and wy * px - wx * py > 0.0 and abs(wy * px - wx * py) < (
                k.rule_dcpa + t.radius) * math.sqrt(w2):
                cost += k.unlawful
        elif gives_way and offset < 0.0 and t.y < 0.0:
            cost += k.unlawful  # Rule 17 c: not to port for a vessel on one's own port side
        if cost >= enough:
            break
    return cost


@kernel
def _decide(obs, mask, ship_, tuning_, own_, targets, states, actions):
    ship, k, own = ship_[0], tuning_[0], own_[0]
    arc = np.zeros((8, 3))  # x, y [m] and time [s] along a turn
    for b in range(obs.shape[0]):
        if not mask[b]:
            continue
        state = states[b]
        found = look(obs[b], ship, own, targets)
        integral = state.integral
        line_of_sight(own, ship, state)
        classify(own, ship, targets, found, k.rule_dcpa, k.rule_tcpa)
        ruled = False
        for j in range(found):
            ruled = ruled or targets[j].code != SAFE
        base = own.wanted - own.leg
        slow = price_of_slowing(k.slow, state, k.patience)
        best, best_offset, best_share = math.inf, 0.0, 1.0
        for i in range(_OFFSETS):
            offset = _SPREAD * ((i + 1) // 2) * (1 if i % 2 == 1 else -1)
            for a in range(_SHARES):
                share = 1.0 - a / (_SHARES - 1)
                cost = k.turn * abs(offset) + slow * (1.0 - share) + k.change * abs(wrap(base + offset - state.last))
                if ruled and 0.0 < abs(offset) < k.apparent:
                    cost += k.timid
                if found > 0 and cost < best:
                    turn = wrap(own.wanted + offset)
                    cost += _cost(turn, offset, share * ship.cruise, own, ship, k, targets, found, arc, best - cost)
                if cost < best:
                    best, best_offset, best_share = cost, offset, share
            if found == 0:
                break
        state.last = base + best_offset
        wait(state, best_offset, best_share, ship)
        if best_offset != 0.0:
            state.integral = integral  # off the track on purpose
        command(actions[b], ship, own.wanted + best_offset, ship.cruise * best_share)


class VelocityObstacles(Pilot):
    """Velocity obstacles with COLREGs, after Kuwata et al. (2014).

    Every step it weighs 49 headings times 5 speeds.  A velocity is inside an obstacle if it brings the hulls nearer than a
    margin within the horizon; of those outside it takes the one nearest to the line of sight at cruising speed, of those
    inside the one that leaves most time.  In head-on and give-way encounters a velocity that passes a vessel with that vessel
    to starboard is unlawful (the region V1 of the paper; overtaking leaves the side free, as Rule 13 does).

    Ours beyond the paper: the time that a turn takes, an encounter that is classified against the route, a stand-on vessel
    that acts late and not to port (Rule 17), and turns that can be noticed (Rule 8).
    """

    parameters = Tuning
    decide = staticmethod(_decide)
