"""Copy what the judge needs out of world records: the kernel of the trajectory recorder."""

from __future__ import annotations

import math

from ..jit import inner, kernel
from ..trig import clip
from ..world.state import KIND_ISLET


@inner
def demand(q, p):
    """Surge and yaw demands, each in [-1, 1], that the commands of plant p amount to: ``autopilot.mix`` the other way round."""
    surge = yaw = surge_weight = yaw_weight = 0.0
    for a in range(q.thrusters[p]):
        ahead = q.command[p, a, 2] if q.reverse_by_bucket[p] else 1.0
        surge += q.mix_surge[p, a] * q.command[p, a, 0] * ahead
        surge_weight += q.mix_surge[p, a] ** 2
        yaw += q.mix_yaw[p, a] * q.command[p, a, 0] + q.mix_nozzle[p, a] * q.command[p, a, 1]
        yaw_weight += q.mix_yaw[p, a] ** 2 + q.mix_nozzle[p, a] ** 2
    return clip(surge / max(surge_weight, 1.0e-9), -1.0, 1.0), clip(yaw / max(yaw_weight, 1.0e-9), -1.0, 1.0)


@kernel
def take_sample(worlds, mask, steps, own, t, eta, velocity, active, tracked, obstacle, asked, closest, closest_obstacle,
                touched, aground, arrived):  # fmt: skip
    """Append a sample of the rows of ``worlds`` [B] where ``mask`` [B] is true; the arrays are those of a ``Trajectory``."""
    for b in range(worlds.shape[0]):
        if not mask[b]:
            continue
        w = worlds[b]
        v, s, k, i = w.vessels, w.safety, steps[b], own[b]
        V, M = v.active.shape[0], w.obstacles.active.shape[0]
        t[b, k] = w.tick * w.dt
        for j in range(V):
            for c in range(3):
                eta[b, k, j, c] = v.eta[j, c]
            velocity[b, k, j, 0] = v.velocity[j, 0]
            velocity[b, k, j, 1] = v.velocity[j, 1]
            active[b, k, j] = v.active[j] != 0
            tracked[b, k, j] = w.picture.id[0, j] != 0
            closest[b, j] = s.closest[0, j]
        near, nearest = s.land_distance[0], s.land_closest[0]
        for m in range(M):
            if w.obstacles.active[m]:
                near = min(near, s.distance[0, V + m])
            nearest = min(nearest, s.closest[0, V + m])
        obstacle[b, k] = near
        closest_obstacle[b] = nearest
        asked[b, k, 0] = asked[b, k, 1] = math.nan
        if v.plant[i] >= 0:
            asked[b, k, 0], asked[b, k, 1] = demand(w.plants, v.plant[i])
        touched[b] = s.collided_with[0]
        aground[b] = s.grounded[0] != 0 or (touched[b] >= V and w.obstacles.kind[touched[b] - V] == KIND_ISLET)
        arrived[b] = w.routes.done[i] != 0
        steps[b] += 1
