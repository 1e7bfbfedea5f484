"""``avoid``: the waypoint follower, made to go around what the TDM reports; one honest reactive baseline."""

from __future__ import annotations

import math
from dataclasses import dataclass

from ..jit import inner, kernel
from ..trig import clip, sincos, wrap
from ..units import DEG
from .pilot import Pilot, command, line_of_sight, look

_STEP, _STEPS = 3.0, 20  # [s] of the prediction
_SPREAD, _OFFSETS = 15.0 * DEG, 17  # headings from 120 deg to port to 120 deg to starboard of the wanted one
_SHARES = 3  # full, half and no cruising speed


@dataclass(frozen=True)
class Tuning:
    """Weights of the price of a heading and a speed."""

    margin: float = 10.0  #: [m] and a ship's length: distance between hulls that costs nothing
    danger: float = 30.0  #: of touching, less by exp(-t / fade)
    fade: float = 30.0  #: [s]
    port: float = 0.2  #: of a heading to port of the wanted one,
    port_meeting: float = 0.6  #: with a moving target nearer than ``near``
    near: float = 600.0  #: [m]
    slow: float = 1.5  #: of standing still instead of cruising
    change: float = 0.5  #: of a radian away from the heading asked for last


@inner
def _danger(turn, share, own, ship, k, targets, found, enough):
    """How much a turn [rad] with a share of cruising speed lacks of the margin to the worst target; at most ``enough``."""
    worst = 0.0
    x = y = 0.0
    margin = k.margin + ship.length
    for i in range(_STEPS):
        t = _STEP * (i + 1)
        limit = ship.turn_rate * t
        s, c = sincos(clip(turn, -limit, limit))
        speed = own.u - (ship.cruise * share - own.u) * math.expm1(-t / ship.speed_time)
        x += _STEP * speed * c
        y += _STEP * speed * s
        fade = math.exp(-t / k.fade)
        for j in range(found):
            b = targets[j]
            reach = b.radius + 0.5 * ship.length + margin
            dx, dy = x - b.x - b.vx * t, y - b.y - b.vy * t
            d2 = dx * dx + dy * dy
            if d2 < reach * reach:
                lack = min((reach - math.sqrt(d2)) / margin, 2.0)
                worst = max(worst, lack * lack * fade)
        if worst >= enough:
            break
    return worst


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
        meeting = False
        for j in range(found):
            meeting = meeting or (targets[j].moves != 0 and targets[j].distance < k.near)
        base = own.wanted - own.leg
        best, best_offset, best_share = math.inf, 0.0, 1.0
        for i in range(_OFFSETS):
            # 0, 1, -1, 2, -2, ..: what deviates least is cheapest and rules out the most
            offset = _SPREAD * ((i + 1) // 2) * (1 if i % 2 == 1 else -1)
            for a in range(_SHARES):
                share = 1.0 - 0.5 * a
                price = abs(offset) + k.slow * (1.0 - share) + k.change * abs(wrap(base + offset - state.last))
                if offset < 0.0:
                    price += k.port_meeting if meeting else k.port
                if found > 0 and price < best:
                    turn = wrap(own.wanted + offset)
                    price += k.danger * _danger(turn, share, own, ship, k, targets, found, (best - price) / k.danger)
                if price < best:
                    best, best_offset, best_share = price, offset, share
            if found == 0:
                break
        state.last = base + best_offset
        if best_offset != 0.0:
            state.integral = integral  # off the track on purpose
        command(actions[b], ship, own.wanted + best_offset, ship.cruise * best_share)


class Avoid(Pilot):
    """The waypoint follower, made to go around what the TDM reports.

    Every step it tries headings to either side of the line-of-sight course, each at full, half and no cruising speed.  It
    predicts its own path (a turn, then straight) and straight lines for all targets, and takes the cheapest: deviation, with
    port dearer than starboard, more so near moving targets, and a steep price for coming closer to a target, soonest first,
    than a margin beyond its radius and its uncertainty.
    """

    parameters = Tuning
    decide = staticmethod(_decide)
