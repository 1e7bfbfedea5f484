"""The control step of a batch in one kernel call: action -> ticks -> observation, reward terms, end of episode."""

from __future__ import annotations

import math

from ..engine import reset_world, tick_world
from ..jit import inner, kernel, spliced
from ..traffic.ships import move_traffic
from ..trig import PI, clip, wrap
from ..world.autopilot import autopilot, mix
from .observe import cross_track_error, observe
from .task import ACTION_CHANNELS, ACTION_DEMAND, ACTION_DISCRETE

_TURN = PI / 12.0  # of ``discrete``
_FASTER = 0.125


@inner
def distance_to_go(w, j):
    """Distance [m] from vessel j along its route to the last waypoint (truth)."""
    r = w.routes
    if r.count[j] == 0 or r.done[j]:
        return 0.0
    k = r.leg[j]
    total = math.hypot(r.waypoint[j, k, 0] - w.vessels.eta[j, 0], r.waypoint[j, k, 1] - w.vessels.eta[j, 1])
    for i in range(k + 1, r.count[j]):
        total += math.hypot(r.waypoint[j, i, 0] - r.waypoint[j, i - 1, 0], r.waypoint[j, i, 1] - r.waypoint[j, i - 1, 1])
    return total


@spliced
def begin_episode(w, task, episode):
    """Reset world and episode memory."""
    reset_world(w)
    own = w.observer[0]
    episode.step = 0
    episode.to_go = distance_to_go(w, own)
    episode.heading_ref = w.nav.mru_heading[0]
    episode.speed_ref = max(w.nav.water_speed[0, 0], 0.0)
    for c in range(episode.last_action.shape[0]):
        episode.last_action[c] = 0.0
    episode.closest = 1.0e9
    episode.outcome = 0


@inner
def _decode(w, task, episode, action):
    """Turn an action into the references or commands of observer 0's plant; returns the squared change of the action."""
    change = 0.0
    for c in range(task.channels):
        delta = action[c] - episode.last_action[c]
        change += delta * delta
        episode.last_action[c] = action[c]
    p = w.vessels.plant[w.observer[0]]
    if task.action == ACTION_DEMAND:
        mix(w, p, clip(action[0], -1.0, 1.0), clip(action[1], -1.0, 1.0))
    elif task.action == ACTION_CHANNELS:
        for c in range(task.channels):
            w.plants.command[p, task.thruster[c], task.part[c]] = clip(action[c], -1.0, 1.0)
    elif task.action == ACTION_DISCRETE:
        change = 0.0 if action[0] == 0.0 else 1.0
        if action[0] == 1.0:
            episode.heading_ref = wrap(episode.heading_ref - _TURN)
        elif action[0] == 2.0:
            episode.heading_ref = wrap(episode.heading_ref + _TURN)
        elif action[0] == 3.0:
            episode.speed_ref = min(episode.speed_ref + _FASTER * task.max_speed, task.max_speed)
        elif action[0] == 4.0:
            episode.speed_ref = max(episode.speed_ref - _FASTER * task.max_speed, 0.0)
    else:
        episode.heading_ref = wrap(w.nav.mru_heading[0] + 0.5 * PI * clip(action[0], -1.0, 1.0))
        episode.speed_ref = 0.5 * (1.0 + clip(action[1], -1.0, 1.0)) * task.max_speed
    return change / task.channels


@spliced
def step_task(w, task, episode, action, rows, terms):
    """One control step of a world.  Returns (reward, terminated, truncated) and fills terms."""
    own = w.observer[0]
    p = w.vessels.plant[own]
    change = _decode(w, task, episode, action)
    piloted = task.action != ACTION_DEMAND and task.action != ACTION_CHANNELS
    w.safety.step_closest[0] = 1.0e9
    had_collided, had_arrived = w.safety.collided_with[0] >= 0, w.routes.done[own] != 0
    for k in range(task.control_ticks):
        if piloted:
            surge, yaw = autopilot(w, p, w.nav.mru_heading[0], w.nav.yaw_rate[0], w.nav.water_speed[0, 0],
                                   episode.heading_ref, episode.speed_ref, w.dt)  # fmt: skip
            mix(w, p, surge, yaw)
        tick_world(w, rows, k)
        if task.end_on_collision and w.safety.collided_with[0] >= 0:
            break
    move_traffic(w, w.tick)
    episode.step += 1
    closest = w.safety.step_closest[0]
    episode.closest = min(episode.closest, closest)

    to_go = distance_to_go(w, own)
    terms[0] = (episode.to_go - to_go) / (task.max_speed * task.control_ticks * w.dt)
    episode.to_go = to_go
    terms[1] = 0.0
    r = w.routes
    k = r.leg[own]
    if 0 < k < r.count[own]:
        error = cross_track_error(r.waypoint[own, k - 1, 0], r.waypoint[own, k - 1, 1], r.waypoint[own, k, 0],
                                  r.waypoint[own, k, 1], w.vessels.eta[own, 0], w.vessels.eta[own, 1])  # fmt: skip
        terms[1] = -min(abs(error) / task.cross_track_scale, 1.0)
    intrusion = clip(1.0 - closest / task.safe_distance, 0.0, 1.0)
    terms[2] = -intrusion * intrusion
    terms[3] = -change
    terms[4] = -1.0
    collision = w.safety.collided_with[0] >= 0
    arrival = r.count[own] > 0 and r.done[own] != 0
    half = w.area[0]
    outside = half > 0.0 and (abs(w.vessels.eta[own, 0]) > half or abs(w.vessels.eta[own, 1]) > half)
    terms[5] = -1.0 if collision and not had_collided else 0.0
    terms[6] = 1.0 if arrival and not had_arrived and not collision else 0.0
    terms[7] = -1.0 if outside else 0.0
    reward = 0.0
    for i in range(terms.shape[0]):
        reward += task.weight[i] * terms[i]
    terminated = (
        (collision and task.end_on_collision) or (arrival and task.end_on_arrival) or (outside and task.end_out_of_area)
    )
    truncated = not terminated and task.max_steps > 0 and episode.step >= task.max_steps
    if terminated or truncated:
        episode.outcome = 1 if collision else (2 if arrival else (3 if outside else 4))
    return reward, terminated, truncated


BEGIN, STEP = 1, 2  #: what ``run_batch`` does with a row


@kernel
def run_batch(worlds, task, episodes, what, actions, rows, obs, terms, reward, terminated, truncated):
    """Begin an episode in the rows where ``what`` [B] is BEGIN, make a control step where it is STEP, leave the others.

    worlds [B], task [1], episodes [B], actions [B, n] float64, rows [ticks, n, A, 3] (see engine.advance_worlds),
    obs [B, size] float32, terms [B, N_TERMS], reward [B], terminated [B], truncated [B]; the last five are written.
    Returns -1, or the first row whose action is not finite or none of ``discrete``; then nothing at all has moved.  (One
    entry point for both, because what they share is then compiled once.)
    """
    for b in range(worlds.shape[0]):
        if what[b] == STEP:
            for c in range(actions.shape[1]):
                a = actions[b, c]
                if not math.isfinite(a) or (task[0].action == ACTION_DISCRETE and not (a == math.floor(a) and 0.0 <= a < 5.0)):
                    return b
    for b in range(worlds.shape[0]):
        if what[b] == BEGIN:
            begin_episode(worlds[b], task[0], episodes[b])
            reward[b] = 0.0
            terminated[b] = truncated[b] = False
            for i in range(terms.shape[1]):
                terms[b, i] = 0.0
        elif what[b] == STEP:
            reward[b], terminated[b], truncated[b] = step_task(
                worlds[b], task[0], episodes[b], actions[b], rows, terms[b]
            )
        if what[b] != 0:
            observe(worlds[b], 0, task[0], obs[b])
    return -1


@kernel
def observe_batch(worlds, task, obs):
    """Write the observation [B, size] that the records hold now; reads nothing but navigation and picture."""
    for b in range(worlds.shape[0]):
        observe(worlds[b], 0, task[0], obs[b])
