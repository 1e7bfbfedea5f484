"""``sbmpc``: simulation-based model predictive control.

T. A. Johansen, T. Perez and A. Cristofaro, "Ship Collision Avoidance and COLREGS Compliance Using Simulation-Based Control
Behavior Selection With Predictive Hazard Assessment", IEEE Transactions on Intelligent Transportation Systems 17(12),
3407-3422, 2016.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ..jit import inner, kernel
from ..trig import atan2, clip, sincos, wrap
from ..units import DEG
from ..world.encounter import CROSSING_STAND_ON, OVERTAKEN
from .pilot import Pilot, classify, command, line_of_sight, look, price_of_slowing, wait

_STEP = 4.0  # [s] of the prediction
_STEPS = 45
#: control behaviours: course offsets to the line of sight times propulsion, the paper's; small ones first
_OFFSETS = np.radians([0.0, 15.0, -15.0, 30.0, -30.0, 45.0, -45.0, 60.0, -60.0, 75.0, -75.0, 90.0, -90.0])
_SHARES = np.array([1.0, 0.5, 0.0])

_AHEAD = math.cos(15.0 * DEG)  # phi_ahead
_OPPOSITE = math.cos(22.5 * DEG)
_CROSSED = math.cos(68.5 * DEG)


@dataclass(frozen=True)
class Tuning:
    """The paper's parameters, scaled to craft of ten metres at five metres a second.  Distances are between hulls."""

    domain: float = 3.0  #: lengths of both vessels: nearer to what moves is a hazard,
    d_safe: float = 120.0  #: [m] but not farther than this
    d_safe_fixed: float = 22.0  #: [m] the same of what does not move
    d_close: float = 220.0  #: [m] nearer, the rules apply
    horizon: float = 160.0  #: [s] T
    horizon_fixed: float = 60.0  #: [s] the same for what does not move
    stand_on: float = 40.0  #: [s] the same for a vessel that has to keep clear of us (Rule 17)
    p: float = 1.0  #: exponent of time in the risk factor
    q: float = 4.0  #: exponent of distance
    collision: float = 60.0  #: K_coll [s] of meeting at twice the cruising speed; goes with the square of the speed
    collision_fixed: float = 12.0  #: [s] the same of what does not move
    rule: float = 3.0  #: kappa of breaking Rule 14 or 15
    committed: float = 8.0  #: [s] for so long a distance that does not shrink is no hazard
    settled: float = 12.0  #: [s] a behaviour is not judged by the rules before it has taken effect
    propulsion: float = 4.0  #: k_P of standing still
    patience: float = 30.0  #: [s] of being turned away, after which that costs half
    course: float = 1.0  #: k_chi of a radian, squared
    port: float = 1.6  #: times that to port
    propulsion_change: float = 0.5  #: K_dP
    course_change: float = 0.9  #: K_dchi of a radian from the last offset, squared


@inner
def _predict(offset, share, own, ship, path):
    """Simulate the own ship under a behaviour: path [_STEPS, 4] gets x, y [m] and velocity [m/s] at the end of each step.

    It follows the line of sight of its route with the offset, turns at a limited rate and gathers way with a time constant.
    """
    x = y = heading = 0.0
    speed = own.u
    leg, cross, left = own.leg, own.cross_track, own.distance
    turned = own.last != 0
    ls, lc = sincos(leg)
    set_speed = share * ship.cruise
    for i in range(_STEPS):
        wanted = leg - atan2(cross, ship.lookahead) + offset
        heading += clip(wrap(wanted - heading), -ship.turn_rate * _STEP, ship.turn_rate * _STEP)
        speed -= (set_speed - speed) * math.expm1(-_STEP / ship.speed_time)
        s, c = sincos(heading)
        dx, dy = _STEP * speed * c, _STEP * speed * s
        x += dx
        y += dy
        cross += lc * dy - ls * dx
        left -= lc * dx + ls * dy
        if left < 0.0 and not turned:
            # on to the next leg, which begins where this one ends; what comes after it is not in the observation
            turned = True
            beyond = -left
            leg += own.next_turn
            ns, nc = sincos(own.next_turn)
            cross, left = nc * cross - ns * beyond, math.inf
            ls, lc = sincos(leg)
        path[i, 0], path[i, 1], path[i, 2], path[i, 3] = x, y, speed * c, speed * s


@inner
def _breaks_rules(x, y, vx, vy, t, time):
    """Whether the own ship, there and then, breaks Rule 14 or 15 towards a target that is close (section IV of the paper)."""
    own2 = vx * vx + vy * vy
    if own2 < 0.01:
        return False
    lx, ly = t.x + t.vx * time - x, t.y + t.vy * time - y
    if vx * ly - vy * lx <= 0.0:
        return False  # not to starboard
    product = math.sqrt(own2) * t.speed
    along = vx * t.vx + vy * t.vy
    toward = vx * lx + vy * ly
    distance = math.sqrt(lx * lx + ly * ly)
    if along < -_OPPOSITE * product and toward > _AHEAD * math.sqrt(own2) * distance:
        return True  # Rule 14: head-on
    # Rule 15: it crosses, and has not been passed yet
    return along < _CROSSED * product and toward > 0.0


@inner
def _hazard(path, own, ship, k, targets, found, enough):
    """max over targets and time of collision cost times risk, plus the cost of breaking a rule; at most about ``enough``."""
    worst = 0.0
    for j in range(found):
        t = targets[j]
        size = t.radius + 0.5 * ship.length
        safe = min(2.0 * k.domain * size, k.d_safe) if t.moves else k.d_safe_fixed
        horizon = k.horizon if t.moves else k.horizon_fixed
        if t.code == CROSSING_STAND_ON or t.code == OVERTAKEN:
            horizon = k.stand_on
        near = max(safe, k.d_close) + size if t.moves else safe + size
        px, py = -t.x, -t.y  # the own ship as the target sees it
        now = t.distance - size
        for i in range(_STEPS):
            time = _STEP * (i + 1)
            if time > horizon:
                break
            qx, qy = path[i, 0] - t.x - t.vx * time, path[i, 1] - t.y - t.vy * time
            # nearest point of the step, both on straight lines
            dx, dy = qx - px, qy - py
            step2 = dx * dx + dy * dy
            share = clip(-(px * dx + py * dy) / step2, 0.0, 1.0) if step2 > 0.0 else 0.0
            ax, ay = px + share * dx, py + share * dy
            px, py = qx, qy
            d2 = ax * ax + ay * ay
            if d2 > near * near:
                continue
            d = max(math.sqrt(d2) - size, 1.0)
            hazard = 0.0
            # how near it is already is nobody's choice any more
            if d < safe and (time > k.committed or d < now - 3.0):
                wx, wy = path[i, 2] - t.vx, path[i, 3] - t.vy
                speed2 = (wx * wx + wy * wy + 0.25 * ship.cruise * ship.cruise) / (4.0 * ship.cruise * ship.cruise)
                since = max(time - (1.0 - share) * _STEP, 1.0)
                hazard = (k.collision if t.moves else k.collision_fixed) * speed2 * (safe / d) ** k.q / since ** k.p
            ruled = t.moves and d < k.d_close and time >= k.settled and horizon == k.horizon
            if ruled and _breaks_rules(path[i, 0], path[i, 1], path[i, 2], path[i, 3], t, time):
                hazard += k.rule
            if hazard > worst:
                worst = hazard
                if worst >= enough:
                    return worst
    return worst


@kernel
def _decide(obs, mask, ship_, tuning_, own_, targets, states, actions):
    ship, k, own = ship_[0], tuning_[0], own_[0]
    path = np.zeros((_STEPS, 4))
    for b in range(obs.shape[0]):
        if not mask[b]:
            continue
        state = states[b]
        found = look(obs[b], ship, own, targets)
        integral = state.integral
        line_of_sight(own, ship, state)
        classify(own, ship, targets, found, k.d_safe, k.horizon)
        best, best_offset, best_share = math.inf, 0.0, 1.0
        propulsion = price_of_slowing(k.propulsion, state, k.patience)
        for i in range(_OFFSETS.shape[0]):
            offset = _OFFSETS[i]
            for a in range(_SHARES.shape[0]):
                share = _SHARES[a]
                change = wrap(offset - state.last)
                cost = (
                    propulsion * (1.0 - share)
                    + k.course * offset * offset * (k.port if offset < 0.0 else 1.0)
                    + k.propulsion_change * abs(share + state.slowed - 1.0)
                    + k.course_change * change * change
                )
                if cost >= best:
                    continue
                if found > 0:
                    _predict(offset, share, own, ship, path)
                    cost += _hazard(path, own, ship, k, targets, found, best - cost)
                if cost < best:
                    best, best_offset, best_share = cost, offset, share
        wait(state, best_offset, best_share, ship)
        state.last, state.slowed = best_offset, 1.0 - best_share
        if best_offset != 0.0:
            state.integral = integral  # off the track on purpose
        command(actions[b], ship, own.wanted + best_offset, ship.cruise * best_share)


class SimulationBasedMPC(Pilot):
    """Simulation-based model predictive control, after Johansen, Perez and Cristofaro (2016).

    Every step it simulates 13 course offsets times 3 speeds under its own guidance along the route, with straight lines for
    the targets, and takes the behaviour of the least cost: the worst hazard over targets and time, that is the cost of a
    collision (relative speed squared) times its risk (near and soon) plus a price for breaking Rule 14 or 15, and the price
    of the behaviour itself and of changing it, with port dearer than starboard.

    Ours beyond the paper: hull sizes and the uncertainty of positions in the distances, a behaviour is judged by the rules
    once it has taken effect, and a stand-on vessel acts late (Rule 17).
    """

    parameters = Tuning
    decide = staticmethod(_decide)
