"""The families with land: their coasts, what they draw, and a baseline that sees nothing but the picture."""

from __future__ import annotations

import gymnasium as gym
import numpy as np
import pytest

from usv_gym.policies import make_policy
from usv_gym.scenarios.families.coasts import channels, ports
from usv_gym.world.state import BEHAVIOUR_ERRATIC, BEHAVIOUR_HOLD

shapely = pytest.importorskip("shapely")


@pytest.mark.parametrize("water", [channels, ports])
def test_synthetic_coasts_are_valid_and_do_not_overlap(water):
    for polygons in water().coasts:
        parts = [shapely.Polygon(p.shell, p.holes) for p in polygons]
        assert all(part.is_valid for part in parts)
        assert shapely.union_all(parts).area == pytest.approx(sum(part.area for part in parts))


def test_channels_are_free_along_the_middle_and_narrow_with_difficulty():
    water = channels()
    for polygons, route, middle, width in zip(water.coasts, water.route, water.middle, water.width, strict=True):
        land = shapely.union_all([shapely.Polygon(p.shell) for p in polygons])
        assert shapely.LineString(route).distance(land) > 25.0
        legs = shapely.linestrings(np.stack([middle[:-1], middle[1:]], axis=1))
        assert (shapely.distance(legs, land) >= width[:-1]).all()
    assert water.width[:8].mean() > 1.3 * water.width[-8:].mean()


@pytest.mark.parametrize("name", ["NearShore", "BusyPort"])
def test_nobody_starts_on_land_or_on_another(name):
    env = gym.make(f"usv_gym/{name}-v0")
    core = env.unwrapped.core
    lands = [shapely.union_all([shapely.Polygon(p.shell) for p in polygons]) for polygons in core.coasts]
    seen = set()
    for k in range(60):
        env.reset(seed=k, options={"difficulty": k / 59})
        w = core.worlds[0]
        seen.add(int(w["land_id"]))
        land, v = lands[w["land_id"]], w["vessels"]
        here = np.flatnonzero(v["active"])
        c, s = np.cos(v["eta"][here, 2, None]), np.sin(v["eta"][here, 2, None])
        x, y = np.array([1, 1, -1, -1]) * v["length"][here, None] / 2, np.array([1, -1, -1, 1]) * v["beam"][here, None] / 2
        north, east = v["eta"][here, :1] + c * x - s * y, v["eta"][here, 1:2] + s * x + c * y
        bodies = shapely.polygons(np.stack([north, east], axis=-1))
        assert not shapely.intersects(bodies, land).any()
        assert not shapely.intersects(bodies[0], bodies[1:]).any()
        assert w["safety"]["land_distance"][0] > 10.0
        route = w["routes"]["waypoint"][0, : w["routes"]["count"][0]]
        assert shapely.LineString(route).distance(land) > 10.0
    assert len(seen) > 12


def test_leisure_boats_wander_and_keep_off_the_land():
    env = gym.make("usv_gym/NearShore-v0", difficulty=1.0)
    core = env.unwrapped.core
    erratic = 0
    for seed in range(4):
        env.reset(seed=seed)
        w = core.worlds[0]
        land = shapely.union_all([shapely.Polygon(p.shell) for p in core.coast(0)])
        boats = np.flatnonzero(w["vessels"]["active"] & (w["vessels"]["behaviour"] == BEHAVIOUR_ERRATIC))
        erratic += len(boats)
        for _ in range(60):
            _, _, terminated, truncated, _ = env.step(np.zeros(2, np.float32))
            assert not shapely.contains_xy(land, w["vessels"]["eta"][boats, :2]).any()
            if terminated or truncated:
                break
    assert erratic > 8


def test_a_port_has_moored_and_moving_vessels():
    env = gym.make("usv_gym/BusyPort-v0", difficulty=0.5)
    env.reset(seed=2)
    v = env.unwrapped.core.worlds[0]["vessels"]
    active = v["active"] != 0
    moored = active & (v["behaviour"] == BEHAVIOUR_HOLD) & (v["speed"] == 0)
    moored[0] = False
    moving = active & (v["speed"] > 0)
    before = v["eta"].copy()
    for _ in range(5):
        env.step(np.zeros(2, np.float32))
    assert moored.sum() >= 5
    assert moving.sum() >= 4
    assert (v["eta"][moored] == before[moored]).all()
    assert (np.hypot(*(v["eta"] - before)[moving, :2].T) > 1.0).all()


def voyages(name, policy, episodes, **keys):
    """Outcomes of a policy in the first seeds of a family."""
    controller = make_policy(policy)
    task = controller.task.model_dump(exclude={"action", "reward"}, exclude_unset=True)
    env = gym.make(f"usv_gym/{name}-v0", action="heading_speed", **task, **keys)
    outcomes = []
    for seed in range(episodes):
        observation, info = env.reset(seed=seed)
        controller.reset(info)
        over = False
        while not over:
            observation, _, terminated, truncated, info = env.step(controller.act(observation))
            over = terminated or truncated
        outcomes.append(info["outcome"])
    return outcomes


def test_a_baseline_that_reads_the_picture_keeps_off_the_land():
    """Blown off its route by wind and current, dodging boats: `avoid` never runs aground, and it does arrive."""
    outcomes = voyages("NearShore", "avoid", 30)
    assert "grounding" not in outcomes
    assert outcomes.count("arrival") > 20


def test_learned_policies_tell_land_from_targets():
    """The part `land` goes on as it is; it is never taken for targets."""
    import torch

    from usv_gym.policies.networks import TargetEncoder

    look = TargetEncoder(gym.spaces.Box(-1.0, 1.0, (12 + 8 * 9 + 2 * 36,), np.float32), 16, 1852.0, 8)
    sea = torch.zeros(1, 156)
    shore = sea.clone()
    shore[:, 84:] = 1.0
    a, b = look(sea), look(shore)
    assert look.features_dim == a.shape[1] == 12 + 16 + 72
    assert (a[:, :28] == b[:, :28]).all()
    assert (b[:, 28:] == 1.0).all()
