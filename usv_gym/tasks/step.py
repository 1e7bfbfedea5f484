"""The control step of a batch in one kernel call: action -> ticks -> observation, reward terms, end of episode."""

from __future__ import annotations

import math

from ..colregs.duty import rule_terms
from ..engine import attend, board, disembark, reset_world, tick_lanes
from ..jit import inner, lean_kernel, spliced
from ..trig import clip, hypot, wrap
from ..units import DEG
from ..world.autopilot import autopilot, mix
from ..world.carry import move_traffic
from ..world.lanes import LANES, clear, gather_command
from .observe import cross_track_error, observe
from .share import HELP, LEAD, UNFINISHED, announce, await_end, await_work, claim, finish
from .task import ACTION_CHANNELS, ACTION_DEMAND, ACTION_DISCRETE, DISCRETE, HEADING_SPAN

_TURN, _FASTER = DISCRETE[2][0] * DEG, DISCRETE[3][1]
_CHOICES = float(len(DISCRETE))


@inner
def distance_to_go(w, j):
    """Distance [m] from vessel j along its route to the last waypoint (truth)."""
    r = w.routes
    if r.count[j] == 0 or r.done[j]:
        return 0.0
    k = r.leg[j]
    total = hypot(r.waypoint[j, k, 0] - w.vessels.eta[j, 0], r.waypoint[j, k, 1] - w.vessels.eta[j, 1])
    for i in range(k + 1, r.count[j]):
        total += hypot(r.waypoint[j, i, 0] - r.waypoint[j, i - 1, 0], r.waypoint[j, i, 1] - r.waypoint[j, i - 1, 1])
    return total


@spliced
def begin_episodes(w, land, tracks, tasks, episodes):
    """Reset a world and what its observers remember of their episodes."""
    reset_world(w, land, tracks)
    for o in range(w.observer.shape[0]):
        episode = episodes[o]
        own = w.observer[o]
        episode.step = 0
        episode.time = 0.0
        for j in range(w.vessels.active.shape[0]):
            w.pairs[o, j].code = w.pairs[o, j].state = 0
        episode.to_go = distance_to_go(w, own)
        episode.heading_ref = w.nav.mru_heading[o]
        episode.speed_ref = w.vessels.nu[own, 0]
        for c in range(episode.last_action.shape[0]):
            episode.last_action[c] = 0.0
        episode.closest = math.inf
        episode.outcome = 0
        episode.reward = 0.0
        episode.terminated = episode.truncated = False
        for i in range(episode.terms.shape[0]):
            episode.terms[i] = 0.0


@inner
def _decode(w, o, task, episode):
    """Turn an action into the references or commands of observer o's plant; returns the squared change of the action."""
    action = episode.action
    change = 0.0
    for c in range(task.channels):
        delta = action[c] - episode.last_action[c]
        change += delta * delta
        episode.last_action[c] = action[c]
    p = w.vessels.plant[w.observer[o]]
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
        episode.heading_ref = wrap(w.nav.mru_heading[o] + HEADING_SPAN * clip(action[0], -1.0, 1.0))
        episode.speed_ref = 0.5 * (1.0 + clip(action[1], -1.0, 1.0)) * task.max_speed
    return change / task.channels


@inner
def _pilot(w, o, task, episode):
    """Let the autopilot of observer o's plant follow the references, from what it measures; a kinematic ship takes them."""
    j = w.observer[o]
    p = w.vessels.plant[j]
    if p < 0:
        w.vessels.heading_set[j] = episode.heading_ref
        w.vessels.speed[j] = episode.speed_ref
        return
    surge, yaw = autopilot(w, p, w.nav.mru_heading[o], w.nav.yaw_rate[o], w.nav.water_speed[o, 0],
                           episode.heading_ref, episode.speed_ref, w.dt)  # fmt: skip
    mix(w, p, surge, yaw)


@inner
def _judge(w, o, task, episode):
    """Terms, reward and end of the step that observer o has just made, from truth."""
    own = w.observer[o]
    r, terms = w.routes, episode.terms
    episode.step += 1
    episode.time = w.tick * w.dt
    closest = w.safety.step_closest[o]
    episode.closest = min(episode.closest, closest)
    to_go = distance_to_go(w, own)
    terms[0] = (episode.to_go - to_go) / (task.max_speed * task.control_ticks * w.dt)
    episode.to_go = to_go
    terms[1] = 0.0
    k = r.leg[own]
    if 0 < k < r.count[own]:
        error = cross_track_error(r.waypoint[own, k - 1, 0], r.waypoint[own, k - 1, 1], r.waypoint[own, k, 0],
                                  r.waypoint[own, k, 1], w.vessels.eta[own, 0], w.vessels.eta[own, 1])  # fmt: skip
        terms[1] = -min(abs(error) / task.cross_track_scale, 1.0)
    intrusion = clip(1.0 - closest / task.safe_distance, 0.0, 1.0)
    terms[2] = -intrusion * intrusion
    terms[3] = -episode.change
    terms[4] = -1.0
    collision = w.safety.collided_with[o] >= 0
    grounding = w.safety.grounded[o] != 0
    arrival = r.count[own] > 0 and r.done[own] != 0
    half = w.area[0]
    outside = half > 0.0 and (abs(w.vessels.eta[own, 0]) > half or abs(w.vessels.eta[own, 1]) > half)
    terms[5] = -1.0 if collision and episode.collided == 0 else 0.0
    terms[6] = 1.0 if arrival and episode.arrived == 0 and not (collision or grounding) else 0.0
    terms[7] = -1.0 if outside else 0.0
    terms[8] = -1.0 if grounding and episode.grounded == 0 else 0.0
    if task.rules:
        terms[9], terms[10] = rule_terms(w, o, task.colregs)
    episode.reward = 0.0
    for i in range(terms.shape[0]):
        episode.reward += task.weight[i] * terms[i]
    terminated = (
        ((collision or grounding) and task.end_on_collision)
        or (arrival and task.end_on_arrival)
        or (outside and task.end_out_of_area)
    )
    truncated = not terminated and task.max_steps > 0 and episode.step >= task.max_steps
    if terminated or truncated:
        episode.outcome = 1 if collision else (5 if grounding else (2 if arrival else (3 if outside else 4)))
    episode.terminated = terminated
    episode.truncated = truncated


@inner
def _take_actions(w, tasks, episodes):
    """Begin the control step of a world: what every observer asks for."""
    for o in range(w.observer.shape[0]):
        own = w.observer[o]
        w.safety.step_closest[o] = math.inf
        episodes[o].collided = w.safety.collided_with[o] >= 0
        episodes[o].grounded = w.safety.grounded[o]
        episodes[o].arrived = w.routes.done[own] != 0
        if w.vessels.active[own]:
            episodes[o].change = _decode(w, o, tasks[o], episodes[o])


@spliced
def step_group(worlds, lanes, land, tracks, tasks, episodes, rows):
    """One control step of up to LANES worlds: every observer's action, the ticks, every observer's judgement.

    Observers whose vessel has left the sea do nothing.  A lone observer's step ends where its vessel collides or runs aground.
    """
    task, crew = tasks[0], lanes[0]
    piloted = task.action != ACTION_DEMAND and task.action != ACTION_CHANNELS
    left = 0
    for p in range(lanes.shape[0]):
        clear(lanes[p])
    for l in range(worlds.shape[0]):
        if episodes[l, 0].what == STEP:
            w = worlds[l]
            if w.sensors.exteroceptive == 0 and not piloted:
                # nobody reads the own navigation before the step is over, so it is not measured before
                w.next_nav = max(w.next_nav, w.tick + task.control_ticks)
            w.look_tick = w.tick if piloted else w.tick + task.control_ticks
            _take_actions(w, tasks, episodes[l])
            board(lanes, l, w, rows.shape[1])
            left += 1
    for k in range(task.control_ticks if left > 0 else 0):
        if piloted:
            for l in range(worlds.shape[0]):
                if crew.under_way[l]:
                    w = worlds[l]
                    for o in range(w.observer.shape[0]):
                        if w.vessels.active[w.observer[o]]:
                            _pilot(w, o, tasks[o], episodes[l, o])
                    for p in range(lanes.shape[0]):
                        gather_command(lanes[p], l, w, p)
        tick_lanes(lanes, rows, k)
        for l in range(worlds.shape[0]):
            if crew.under_way[l] and crew.tick[l] >= crew.due[l]:
                w = worlds[l]
                attend(lanes, l, w, land, tracks)
                hit = w.safety.collided_with[0] >= 0 or w.safety.grounded[0] != 0
                if hit and w.observer.shape[0] == 1 and task.end_on_collision:
                    disembark(lanes, l, w)
                    crew.under_way[l] = 0
                    left -= 1
        if left == 0:
            break
    for l in range(worlds.shape[0]):
        if episodes[l, 0].what == STEP:
            w = worlds[l]
            if crew.under_way[l]:
                disembark(lanes, l, w)
            move_traffic(w, w.tick)
            for o in range(w.observer.shape[0]):
                if w.vessels.active[w.observer[o]]:
                    _judge(w, o, tasks[o], episodes[l, o])


BEGIN, STEP = 1, 2  #: what ``run_batch`` does with a row


@inner
def _possible(task, action):
    """True if an action can be carried out."""
    for c in range(task.channels):
        if not math.isfinite(action[c]):
            return False
    if task.action == ACTION_DISCRETE:
        return action[0] == math.floor(action[0]) and 0.0 <= action[0] < _CHOICES
    return True


@inner
def _report(episode, numbers, flags, b):
    """Write what has come of an episode into column b."""
    numbers[0, b] = episode.reward
    numbers[1, b] = episode.time
    numbers[2, b] = episode.closest
    numbers[3, b] = episode.to_go
    for i in range(episode.terms.shape[0]):
        numbers[4 + i, b] = episode.terms[i]
    flags[0, b] = episode.terminated
    flags[1, b] = episode.truncated
    flags[2, b] = episode.terminated or episode.truncated
    flags[3, b] = episode.outcome == 2
    flags[4, b] = episode.outcome


@lean_kernel
def run_batch(control, role, worlds, lanes, land, tracks, tasks, episodes, obs, numbers, flags, rows):
    """Begin an episode in the rows that ask for BEGIN, make a control step in those that ask for STEP, leave the others.

    control, role: see ``tasks.share``; ALONE needs no control.  worlds [B]; lanes, the room that ``lanes_for(worlds)`` makes;
    land, the pool that their ``land_id`` count in (world/land.py); tracks, that of recorded tracks; tasks [O], one per
    observer; episodes [B, O] with ``what`` (of observer 0) and ``action`` as input and the rest as result; obs [B, O, size]
    float32, written; numbers [4 + terms, B] and flags uint8 [5, B], written: of observer 0 reward, time, closest, to_go and
    terms; terminated, truncated, either, arrived, outcome; rows [ticks, n, A, 3] (see engine.advance_worlds).
    Returns -1 (UNFINISHED where helpers are at work yet), or the first row with an action that is not finite or none of
    ``discrete``; then nothing at all has moved.
    (One entry point for all, because what they share is then compiled once.)
    """
    O = episodes.shape[1]
    groups = lanes.shape[0]
    if role != HELP:
        for b in range(worlds.shape[0]):
            if episodes[b, 0].what == STEP:
                for o in range(O):
                    # in this order, as actions are all in one place
                    if not _possible(tasks[o], episodes[b, o].action) and worlds[b].vessels.active[worlds[b].observer[o]]:
                        return b
    if role == LEAD:
        announce(control)
    while role != HELP or await_work(control, groups):
        had = 0
        while True:
            group = claim(control, role, groups, had)
            if group < 0:
                break
            had += 1
            first, last = LANES * group, min(LANES * (group + 1), worlds.shape[0])
            for b in range(first, last):
                if episodes[b, 0].what == BEGIN:
                    begin_episodes(worlds[b], land, tracks, tasks, episodes[b])
            step_group(worlds[first:last], lanes[group], land, tracks, tasks, episodes[first:last], rows)
            for b in range(first, last):
                if episodes[b, 0].what != 0:
                    for o in range(O):
                        observe(worlds[b], land, o, tasks[o], obs[b, o])
                    _report(episodes[b, 0], numbers, flags, b)
            finish(control, role)
        if role == LEAD and not await_end(control, groups):
            return UNFINISHED
        if role != HELP:
            break
    return -1


@lean_kernel
def observe_batch(worlds, land, tasks, obs):
    """Write the observations [B, O, size] that the records hold now; reads nothing but navigation and picture."""
    for b in range(worlds.shape[0]):
        for o in range(worlds[b].observer.shape[0]):
            observe(worlds[b], land, o, tasks[o], obs[b, o])
