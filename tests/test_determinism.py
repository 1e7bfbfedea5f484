"""Bit for bit: the same seed gives the same episode, whatever runs beside it.  And only the sensors tell of the truth."""

from __future__ import annotations

import numpy as np
import pytest
from gymnasium.utils.seeding import np_random

from usv_gym.envs.core import Core
from usv_gym.envs.single import FamilyEnv
from usv_gym.replay.archive import load, save
from usv_gym.run import plan, resimulate, run
from usv_gym.scenarios.build import build_worlds
from usv_gym.tasks.task import TaskConfig
from usv_gym.voyage import Mission
from usv_gym.world.state import RADAR

STEPS = 200
#: random seas, strong wind, and sensors that lose, delay and miss
HARD = {
    "difficulty": 1.0,
    "weather": "thesis",
    "overrides": ["sensors.base=realistic", "sensors.ais.loss=0.2", "sensors.ais.latency=3", "sensors.radar.detection=0.8"],
}


def core(num, observation="tracks", source="open_sea", **more):
    config = TaskConfig(observation=observation, end_on_collision=False, end_on_arrival=False)
    return Core(num, source=source, config=config, **(HARD if source == "open_sea" else {}), **more)


def generators(num, first=0):
    return [np_random(first + b)[0] for b in range(num)]


def actions(num, steps=STEPS, seed=0):
    """Random actions [steps, num, 2]; row b does not depend on num."""
    return np.stack([np.random.default_rng([seed, b]).uniform(-1, 1, (steps, 2)) for b in range(num)], axis=1)


def roll(core, given, mask=None):
    """Step through given actions [steps, num, 2]; returns all that came out, as bytes per row."""
    mask = np.ones(core.num, bool) if mask is None else mask
    out = [[] for _ in range(core.num)]
    for now in given:
        core.actions[:] = now
        core.step(mask)
        for b in range(core.num):
            out[b].append(core.obs[b].tobytes() + core.terms[b].tobytes() + core.reward[b].tobytes()
                          + core.terminated[b].tobytes() + core.worlds[b].tobytes())  # fmt: skip
    return out


def started(num, first=0, **more):
    new = core(num, **more)
    new.reset(np.ones(num, bool), generators(num, first))
    return new


def rows_of(core):
    """All that is remembered of each row, as bytes; but for what it was told to do last."""
    lasting = [name for name in core.episodes.dtype.names if name not in ("action", "change", "what")]
    return [core.worlds[b].tobytes() + core.obs[b].tobytes() + b"".join(core.episodes[name][b].tobytes() for name in lasting)
            for b in range(core.num)]  # fmt: skip


# --- seeds -----------------------------------------------------------------------------------------------------------
def test_the_same_seed_gives_the_same_episode():
    given = actions(1)
    assert roll(started(1), given) == roll(started(1), given)


def test_another_seed_gives_another_sea_and_other_noise():
    a, b = started(1), started(1, first=1)
    assert a.worlds["obstacles"]["position"].tobytes() != b.worlds["obstacles"]["position"].tobytes()
    a, b = (started(1, first=seed, source="busy_open_sea") for seed in (0, 1))
    given = actions(1, 30)
    roll(a, given), roll(b, given)
    assert a.worlds["ais"]["position"].tobytes() != b.worlds["ais"]["position"].tobytes()


def test_episodes_of_one_environment_differ():
    env = FamilyEnv("open_sea")
    first, second = env.reset(seed=0), env.reset()
    assert not np.array_equal(first[0], second[0])
    assert np.array_equal(env.reset(seed=0)[0], first[0])


def test_a_row_is_the_same_in_a_batch_of_8_of_4_and_alone():
    given = actions(8)
    eight, four = roll(started(8), given), roll(started(4), given[:, :4])
    assert eight[:4] == four
    for b in (0, 3, 7):
        assert roll(started(1, first=b), given[:, b : b + 1])[0] == eight[b]


def test_the_environment_is_row_0_of_its_core():
    env = FamilyEnv("open_sea", end_on_collision=False, end_on_arrival=False, **HARD)
    alone = started(1, first=6)
    assert np.array_equal(env.reset(seed=6)[0], alone.obs[0])
    for action in actions(1, 50):
        obs, reward, *_ = env.step(action[0])
        alone.actions[:] = action
        alone.step(np.ones(1, bool))
        assert obs.tobytes() == alone.obs[0].tobytes()
        assert reward == alone.reward[0]


def test_a_masked_reset_makes_fresh_rows_and_leaves_the_others():
    given = actions(4, 40)
    mask = np.array([True, False, False, True])
    some = started(4)
    roll(some, given)
    before = rows_of(some)
    some.reset(mask, generators(4, first=50))
    fresh = started(4, first=50)
    assert rows_of(some) == [(rows_of(fresh) if mask[b] else before)[b] for b in range(4)]
    again, anew = roll(some, given), roll(fresh, given)
    assert again[0] == anew[0]
    assert again[3] == anew[3]


def test_a_masked_step_moves_no_other_row():
    pair = started(2)
    before = pair.worlds[1].tobytes()
    roll(pair, actions(2, 10), mask=np.array([True, False]))
    assert pair.worlds[1].tobytes() == before
    assert pair.worlds["tick"][0] > 0


# --- archives --------------------------------------------------------------------------------------------------------
SHORT = ["simulation.duration=40"]
ORDERS = [
    (0, "set_ais", {"id": "coaster", "on": False}),
    (50, "spawn", {"id": "late", "spec": {"position": [120, 80], "radius": 12, "kind": "iceberg"}}),
    (100, "spawn", {"id": "tug", "spec": {"class": "boat", "speed": 4, "waypoints": [[50, 150], [50, -150]], "ais": "A"}}),
    (200, "move", {"id": "berg_east", "north": 200.0, "east": 120.0}),
    (300, "set_waypoints", {"id": "tug", "waypoints": [[300, 0], [300, 100]]}),
    (400, "delete", {"id": "late"}),
    (405, "set_ais", {"id": "coaster", "on": True}),
    (500, "spawn", {"id": "later", "spec": {"position": [260, -60], "radius": 9, "ais": True}}),
]  # fmt: skip


@pytest.mark.parametrize(("mission", "orders"), [
    (plan("calm_crossing", policy="avoid", overrides=SHORT, seed=4), []),
    (plan("calm_crossing", policy="avoid", overrides=SHORT, seed=4), ORDERS),
    (plan("busy_open_sea", policy="thrust-log", overrides=SHORT, seed=4), []),
], ids=["controller", "running commands", "thrust log"])  # fmt: skip
def test_an_archive_is_simulated_again_bit_for_bit(tmp_path, mission, orders):
    mission = Mission(mission.scenario, mission.policy, mission.seed, None if mission.rows is None else mission.rows[:800],
                      orders)  # fmt: skip
    recorded = run(mission)
    save(recorded, tmp_path / "episode.usv")
    archive = load(tmp_path / "episode.usv")
    again = resimulate(archive)
    assert len(archive.t) > 30
    assert len(archive.detections) > 20
    for name in ("t", "traffic_t", "eta", "nu", "active", "obstacle", "nav", "command", "weather", "distance", "visible",
                 "detections", "ais"):  # fmt: skip
        assert getattr(again, name).tobytes() == getattr(archive, name).tobytes(), name
    assert {event["kind"] for event in archive.events} >= {command_notice[command] for _, command, _ in orders}


command_notice = {"spawn": "spawned", "delete": "removed", "move": "moved", "set_waypoints": "waypoints_set",
                  "set_ais": "ais_off"}  # fmt: skip


# --- capacity classes ------------------------------------------------------------------------------------------------
CROWD = {
    "weather": {"wind": {"speed": 8, "from_deg": 30}, "current": {"speed": 0.4}, "waves": {"height": 1}},
    "own_ship": {"speed": 4.0, "route": [[400, 0]]},
    "ships": {
        "ferry": {"class": "ship", "waypoints": [[200, 200], [200, -300]]},
        "sailor": {"class": "boat", "ais": "off", "speed": 3, "waypoints": [[90, -60], [300, 90]]},
    },
    "obstacles": {
        "near": {"position": [70, 30], "radius": 8, "drift": "current"},
        "far": {"position": [900, 300], "radius": 25},
        "light": {"kind": "lighthouse", "position": [500, -100], "radius": 5, "ais": True},
    },
    "sensors": {"base": "realistic", "ais": {"loss": 0.2, "latency": 2}, "radar": {"detection": 0.7}},
}


@pytest.mark.parametrize("filters", ["thesis", "light"])
def test_inactive_slots_change_no_bit(monkeypatch, filters):
    given, source = actions(1, 100), {**CROWD, "sensors": {**CROWD["sensors"], "tdm": {"filter": filters}}}
    small = started(1, source=source)
    monkeypatch.setattr(
        "usv_gym.envs.core.build_worlds", lambda scenario, num, capacity: build_worlds(scenario, num, capacity=(20, 40))
    )
    large = started(1, source=source)
    # slots in use on an axis of this length: of vessels or of obstacles, and of sources
    used = {n: [0, 1, 2] for n in (8, 16, 20, 40)} | {8 + 16: [0, 1, 2, 8, 9, 10], 20 + 40: [0, 1, 2, 20, 21, 22]}
    # and of the picture, with its stretches of coast
    used |= {n + 8: [*used[n], *range(n, n + 8)] for n in (8 + 16, 20 + 40)}
    tracked = np.zeros(20 + 40, bool)
    for now in given:
        roll(small, [now]), roll(large, [now])
        assert small.obs.tobytes() == large.obs.tobytes()
        assert small.terms.tobytes() == large.terms.tobytes()
        tracked |= large.worlds["picture"]["id"][0, 0, : 20 + 40] > 0
    assert np.flatnonzero(tracked).tolist() == [1, 2, 20, 21, 22]
    groups = [("tracks", "filters"), *((name,) for name in (
        "vessels", "routes", "obstacles", "plants", "weather", "safety", "nav", "ais", "tracks", "picture"))]  # fmt: skip
    for group in groups:
        one, other = small.worlds, large.worlds
        for name in group:
            one, other = one[name], other[name]
        for name in one.dtype.names:
            if name in ("close", "nearest", "filters"):  # numbers of slots; a group of its own
                continue
            a, b = one[name][0], other[name][0]
            for axis, (n, m) in enumerate(zip(a.shape, b.shape, strict=True)):
                if n != m:
                    a, b = a.take(used[n], axis), b.take(used[m], axis)
            assert a.tobytes() == b.tobytes(), f"{group}.{name}"


@pytest.mark.parametrize("filters", ["thesis", "light"])
def test_vectors_of_any_length_give_the_same_bits(monkeypatch, filters):
    """Loops over slots become vector code with a rest, and other slots are in the rest where there are more of them."""
    rng = np.random.default_rng(8)
    boat = {"class": "boat", "ais": "B", "speed": 4.0, "after_last": "loop"}
    ships = {f"ship_{i}": boat | {"waypoints": rng.uniform(-700, 700, (3, 2)).tolist()} for i in range(7)}
    bergs = {f"berg_{i}": {"position": rng.uniform(-900, 900, 2).tolist(), "radius": 6.0 + i} for i in range(15)}
    source = {**CROWD, "ships": ships, "obstacles": bergs, "sensors": {"base": "thesis", "tdm": {"filter": filters}}}
    rows = []
    for V, M in ((8, 16), (20, 40)):
        with monkeypatch.context() as patch:
            patch.setattr(
                "usv_gym.envs.core.build_worlds",
                lambda scenario, num, capacity, slots=(V, M): build_worlds(scenario, num, capacity=slots),
            )
            sea = started(1, source=source)
        row = []
        for now in actions(1, 60):
            roll(sea, [now])
            targets = [*range(1, 8), *range(V, V + 15)]
            said = [sea.worlds["picture"][name][0, 0, targets].tobytes() for name in ("position", "covariance", "radius")]
            row.append((sea.obs.tobytes(), *said))
        rows.append(row)
    assert rows[0] == rows[1]


# --- noise belongs to the world, not to what the controller does -----------------------------------------------------
def test_what_others_transmit_does_not_depend_on_our_actions():
    ahead, about = (started(1) for _ in range(2))
    for a, b in zip(actions(1, seed=1), actions(1, seed=2), strict=True):
        roll(ahead, [a]), roll(about, [b])
        for name in ("position", "cog", "heading", "sog", "rot", "stamp_us", "bias", "next_tick"):
            others = (ahead.worlds["ais"][name][0, 1:], about.worlds["ais"][name][0, 1:])
            assert others[0].tobytes() == others[1].tobytes(), name
    assert (ahead.worlds["ais"]["sequence"][0, 1:] > 10).any()
    assert ahead.worlds["vessels"]["eta"][0, 0, 0] != about.worlds["vessels"]["eta"][0, 0, 0]


def test_radar_noise_does_not_depend_on_our_actions():
    ahead, about = (started(1) for _ in range(2))
    roll(ahead, actions(1, 60, seed=1)), roll(about, actions(1, 60, seed=2))
    seen = [(c.worlds["tracks"]["scan_bias_us"][0, 0, 0] == c.worlds["tracks"]["scan_us"][0, 0, 0]) for c in (ahead, about)]
    both = np.flatnonzero(seen[0] & seen[1])
    assert len(both) > 3
    # the bias of a target that both have always seen is the same; one that was missed once has forgotten less of it
    biases = [c.worlds["tracks"]["filters"]["bias"][0, 0, RADAR, :, both] for c in (ahead, about)]
    assert (biases[0] == biases[1]).all(axis=1).sum() > 3


# --- truth and picture -----------------------------------------------------------------------------------------------
def poison(worlds):
    """NaN into every number of the truth."""
    for group in ("vessels", "obstacles", "plants", "weather", "safety"):
        for name in worlds[group].dtype.names:
            field = worlds[group][name]
            if field.dtype.names:  # a process of the weather
                for part in field.dtype.names:
                    field[part] = np.nan
            elif field.dtype.kind == "f":
                field[...] = np.nan
    worlds["ais"]["bias"] = worlds["tracks"]["filters"]["bias"] = np.nan
    worlds["routes"]["waypoint"][:, 1:] = np.nan  # where the others are going
    worlds["routes"]["leg"] = worlds["routes"]["reached"] = -9  # what the own ship believes of its leg is in nav


@pytest.mark.parametrize("observation", ["tracks", "ais", "sectors"])
def test_observations_come_from_the_sensors_only(observation):
    seas = started(4, observation=observation)
    roll(seas, actions(4, 60))
    before = seas.obs.copy()
    assert before[:, 12:].any(axis=1).all()
    seas.obs[:] = np.nan
    poison(seas.worlds)
    after = seas.observe()
    assert np.isfinite(after).all()
    assert after.tobytes() == before.tobytes()


def test_the_poison_works():
    """The observation ``truth``, which is for ablation, is the one exception."""
    seas = started(2, observation="truth")
    before = seas.obs.copy()
    poison(seas.worlds)
    assert seas.observe().tobytes() != before.tobytes()
