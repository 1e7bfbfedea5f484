"""The native vector environment: the numbers of SyncVectorEnv bit for bit, in every mode, and what a batch has of its own."""

from __future__ import annotations

import copy
import multiprocessing
import os
import pickle
import time

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.error import ResetNeeded
from gymnasium.vector import AutoresetMode

from usv_gym.config import ConfigError
from usv_gym.envs.threads import Crew
from usv_gym.envs.vector import USVVectorEnv
from usv_gym.jit import lean_kernel
from usv_gym.tasks.share import (
    ALONE,
    HELP,
    LEAD,
    NO_CONTROL,
    UNFINISHED,
    announce,
    await_end,
    await_work,
    claim,
    finish,
)

OPEN_SEA, SCENARIO = "usv_gym/OpenSea-v0", "usv_gym/Scenario-v0"
SHORT = ["simulation.duration=12"]  # many autoresets in few steps
KINDS = [
    (OPEN_SEA, {}),
    (OPEN_SEA, {"action": "heading_speed", "observation": "truth", "flat": False, "weather": "calm", "difficulty": 1.0}),
    (OPEN_SEA, {"action": "discrete", "observation": "ais", "targets": 3, "vessel": "otter"}),
    (SCENARIO, {"action": "actuators", "observation": "sectors", "flat": False}),
    (SCENARIO, {"scenario": "calm_crossing", "action": "thrusters", "weather": "thesis", "reward": {"collision": 9.0}}),
]  # fmt: skip


def native(id=OPEN_SEA, num=3, **kwargs) -> USVVectorEnv:
    env = gym.make_vec(id, num, **kwargs)
    assert isinstance(env, USVVectorEnv)
    return env


def sync(id, num, mode=AutoresetMode.NEXT_STEP, **kwargs):
    return gym.make_vec(id, num, vectorization_mode="sync", vector_kwargs={"autoreset_mode": mode}, **kwargs)


def assert_same(a, b, where="") -> None:
    """Equal in every bit, type and key, through dicts, arrays and objects."""
    assert type(a) is type(b), where
    if isinstance(a, dict):
        assert a.keys() == b.keys(), where
        for key in a:
            assert_same(a[key], b[key], f"{where}/{key}")
    elif isinstance(a, np.ndarray):
        assert a.dtype == b.dtype, where
        assert a.shape == b.shape, where
        if a.dtype == object:
            for x, y in zip(a, b, strict=True):
                assert_same(x, y, where)
        else:
            assert a.tobytes() == b.tobytes(), (where, a, b)
    elif isinstance(a, tuple):
        for i, (x, y) in enumerate(zip(a, b, strict=True)):
            assert_same(x, y, f"{where}[{i}]")
    else:
        assert a == b, where


def memory(env) -> np.ndarray:
    """The bytes of every world [B, n], a copy."""
    return env.core.worlds.view(np.uint8).reshape(env.num_envs, -1).copy()


# --- equal to SyncVectorEnv ------------------------------------------------------------------------------------------
@pytest.mark.parametrize("mode", [AutoresetMode.NEXT_STEP, AutoresetMode.SAME_STEP])
@pytest.mark.parametrize(("id", "kwargs"), KINDS)
def test_equals_the_single_environments(id, kwargs, mode):
    kwargs = {**kwargs, "overrides": SHORT}
    a, b = native(id, 4, autoreset_mode=mode, **kwargs), sync(id, 4, mode, **kwargs)
    assert a.metadata["autoreset_mode"] is b.metadata["autoreset_mode"] is mode
    for space in ("action_space", "observation_space", "single_action_space", "single_observation_space"):
        assert getattr(a, space) == getattr(b, space)
    assert_same(a.reset(seed=7), b.reset(seed=7), "reset")
    a.action_space.seed(1)
    ended = 0
    for k in range(40):
        if k == 5:  # so that the episodes do not end all at once
            mask = np.array([True, False, True, False])
            options = {"difficulty": 0.1, "weather": "random"}
            seed = [3, 4, None, None]
            assert_same(
                a.reset(seed=seed, options={**options, "reset_mask": mask}),
                b.reset(seed=seed, options={**options, "reset_mask": mask.copy()}),
                "masked reset",
            )
        actions = a.action_space.sample()
        step = a.step(actions)
        assert_same(step, b.step(actions), f"step {k}")
        assert step[0] in a.observation_space
        ended += int((step[2] | step[3]).sum())
    assert ended >= 8
    assert a.np_random_seed == b.np_random_seed == (3, 8, 9, 10)
    assert_same(a.reset(), b.reset(), "reset without a seed")
    assert_same(a.reset(seed=[5, None, 6, 5]), b.reset(seed=[5, None, 6, 5]), "reset with a list")


def test_equals_the_single_environments_when_the_caller_resets():
    a, b = native(num=4, autoreset_mode="Disabled", overrides=SHORT), sync(OPEN_SEA, 4, "Disabled", overrides=SHORT)
    assert_same(a.reset(seed=1), b.reset(seed=1))
    a.action_space.seed(1)
    for k in range(30):
        actions = a.action_space.sample()
        step = a.step(actions)
        assert_same(step, b.step(actions), f"step {k}")
        over = step[2] | step[3]
        if k == 4:
            over[1] = True
        if over.any():
            assert_same(a.reset(options={"reset_mask": over}), b.reset(options={"reset_mask": over}), f"reset {k}")
    while not over.any():
        _, _, terminated, truncated, _ = a.step(actions)
        over = terminated | truncated
    with pytest.raises(ResetNeeded, match="reset_mask"):
        a.step(actions)


def test_rows_do_not_depend_on_the_size_of_the_batch():
    small, large = native(num=2), native(num=5)
    assert_same(small.reset(seed=3)[0], large.reset(seed=3)[0][:2])
    large.action_space.seed(1)
    for _ in range(20):
        actions = large.action_space.sample()
        assert_same(small.step(actions[:2])[:4], tuple(x[:2] for x in large.step(actions)[:4]))


# --- its own ---------------------------------------------------------------------------------------------------------
def test_what_was_returned_stays_as_it_was():
    env = native(autoreset_mode="SameStep", overrides=SHORT)
    results = [env.reset(seed=1)]
    kept = copy.deepcopy(results)
    for _ in range(30):
        step = env.step(env.action_space.sample())
        results.append(step)
        kept.append(copy.deepcopy(step))
    assert_same(tuple(results), tuple(kept))


def test_a_masked_reset_touches_only_its_rows():
    env = native(num=4)
    first, _ = env.reset(seed=1)
    for _ in range(3):
        before = env.step(env.action_space.sample())[0]
    worlds = memory(env)
    mask = np.array([False, True, False, False])
    after, infos = env.reset(seed=[9, 2, 9, 9], options={"reset_mask": mask})
    assert np.array_equal(after[~mask], before[~mask])
    assert np.array_equal(worlds[~mask], memory(env)[~mask])
    assert np.array_equal(after[1], first[1])
    assert infos["_time"].tolist() == mask.tolist()
    with pytest.raises(ValueError, match="reset_mask"):
        env.reset(options={"reset_mask": np.zeros(4, bool)})
    with pytest.raises(ValueError, match="reset_mask"):
        env.reset(options={"reset_mask": [True, False, True, False]})


def test_options_by_row():
    env = native(num=3)
    env.reset(seed=1, options={"difficulty": 1.0})
    env.reset(options={"reset_mask": np.array([True, False, False]), "difficulty": 0.25})
    assert env.get_attr("difficulty") == (0.25, 1.0, 1.0)
    env.set_attr("difficulty", [0.0, 0.5, 1.0])
    env.set_attr("weather", "calm")
    env.reset(seed=1)
    single = gym.make(OPEN_SEA)
    state = memory(env)
    for b, difficulty in enumerate((0.0, 0.5, 1.0)):
        obs, _ = single.reset(seed=1 + b, options={"difficulty": difficulty, "weather": "calm"})
        assert np.array_equal(obs, env.core.obs[b])
        assert np.array_equal(single.unwrapped.core.worlds.view(np.uint8), state[b])
    with pytest.raises(ConfigError, match="all rows share"):
        env.reset(options={"reset_mask": np.array([True, False, False]), "scenario": "calm_crossing"})
    with pytest.raises(ConfigError, match="unknown key 'wether'"):
        env.reset(options={"wether": "calm"})
    with pytest.raises(ConfigError, match="difficulty"):
        env.set_attr("difficulty", 2.0)
    with pytest.raises(AttributeError, match="difficulty and weather"):
        env.set_attr("dificulty", 1.0)
    env.reset(seed=1, options={"scenario": "calm_crossing"})
    assert env.core.scenario.name == "calm_crossing"


def test_own_episode_limit():
    env = native(max_episode_steps=4)
    env.reset(seed=1)
    for k in range(1, 6):
        _, _, terminated, truncated, infos = env.step(env.action_space.sample())
        assert not terminated.any()
        assert truncated.all() == truncated.any() == (k == 4)
    assert set(infos["outcome"]) == {"running"}


def test_wrong_use():
    env = native()
    with pytest.raises(ResetNeeded):
        env.step(env.action_space.sample())
    env.reset(seed=1, options={"reset_mask": np.array([True, False, True])})
    with pytest.raises(ResetNeeded):
        env.step(env.action_space.sample())
    env.reset(seed=1)
    before = memory(env)
    actions = np.zeros((3, 2), np.float32)
    for wrong in (actions[0], actions[:2], 0.0, None, [[0, 0], [0], [0, 0]], "abc"):
        with pytest.raises(ValueError, match="do not fit"):
            env.step(wrong)
    actions[1, 0] = np.nan
    for threads in (1, 2):
        env.core.crew = Crew(threads)
        with pytest.raises(ValueError, match=r"row 1"):
            env.step(actions)
    assert np.array_equal(before, memory(env))
    with pytest.raises(ValueError, match="expected 3 seeds"):
        env.reset(seed=[1, 2])
    for kwargs in ({"num_threads": 0}, {"render_mode": "human"}, {"scenario": "octagon"}, {"obsrvation": "ais"}):
        with pytest.raises(ValueError, match=next(iter(kwargs))):
            native(**kwargs)
    with pytest.raises(ValueError, match="num_envs"):
        native(num=0)


def test_goes_through_pickle_with_its_generators():
    env = native(num_threads=2, num=20, overrides=SHORT)
    env.reset(seed=1)
    env.step(env.action_space.sample())
    again = pickle.loads(pickle.dumps(env))
    for _ in range(25):
        actions = env.action_space.sample()
        assert_same(env.step(actions), again.step(actions))
    env.close()


def test_renders_every_row():
    env = native(num=2, render_mode="rgb_array")
    env.reset(seed=1)
    frames = env.render()
    assert len(frames) == 2
    assert frames[0].shape == frames[1].shape == (800, 800, 3)
    assert native(num=2).render() is None


def test_commands_reach_one_row():
    env = native(SCENARIO, 2, scenario="calm_crossing")
    env.reset(seed=1)
    env.rows[1].commands.spawn("berg", {"kind": "iceberg", "position": [40, 0], "radius": 5})
    active = [int(row.world["obstacles"]["active"].sum()) for row in env.rows]
    assert active[1] == active[0] + 1


# --- threads and processes -------------------------------------------------------------------------------------------
@pytest.mark.parametrize("kwargs", [{}, {"action": "discrete", "observation": "truth"}])
def test_threads_change_no_bit(kwargs):
    serial, threaded = (native(num=40, num_threads=n, overrides=SHORT, **kwargs) for n in (1, 3))
    assert_same(serial.reset(seed=1), threaded.reset(seed=1))
    serial.action_space.seed(1)
    for _ in range(25):
        actions = serial.action_space.sample()
        assert_same(serial.step(actions), threaded.step(actions))
    threaded.close()


@lean_kernel
def count_groups(control, role, counts, spins):
    """Share the groups [G] out as ``run_batch`` does; each is ``spins`` long and is counted."""
    groups = counts.shape[0]
    if role == LEAD:
        announce(control)
    while role != HELP or await_work(control, groups):
        had = 0
        while True:
            group = claim(control, role, groups, had)
            if group < 0:
                break
            had += 1
            for _ in range(spins):
                counts[group] = 7 * counts[group] % 1000003
            counts[group] += 1
            finish(control, role)
        if role == LEAD and not await_end(control, groups):
            return UNFINISHED
        if role != HELP:
            break
    return -1


@pytest.mark.parametrize("spins", [0, 10_000])  # the longer ones keep the leader waiting beyond its patience
def test_a_crew_does_every_group_once(spins):
    count_groups(NO_CONTROL, ALONE, np.zeros(1, np.int64), 0)
    for size, groups in ((1, 5), (2, 100), (4, 7), (3, 200)):
        alone, shared = np.zeros(groups, np.int64), np.zeros(groups, np.int64)
        crew = Crew(size)
        for k in range(40):
            count_groups(NO_CONTROL, ALONE, alone, spins)
            assert crew.run(count_groups, shared, spins) == -1
            np.testing.assert_array_equal(shared, alone)
            if k % 10 == 9:
                time.sleep(0.002)  # so that the helpers fall asleep
        crew.close()


def test_a_crew_changes_its_work():
    """Other arguments: helpers that still wait for more of the old work never touch the new."""
    crew = Crew(3)
    work = [np.zeros(50, np.int64) for _ in range(4)]
    for _ in range(25):
        for counts in work:
            crew.run(count_groups, counts, 0)
    assert all((counts == 25).all() for counts in work)
    crew.close()


@pytest.mark.skipif(not hasattr(os, "fork"), reason="needs fork")
@pytest.mark.filterwarnings("ignore:.*multi-threaded:DeprecationWarning")
def test_a_fork_makes_its_own_threads():
    env = native(num=40, num_threads=2)
    env.reset(seed=1)
    actions = env.action_space.sample()
    env.step(actions)  # the threads exist now
    read, write = os.pipe()
    child = os.fork()
    if child == 0:
        os.write(write, env.step(actions)[1].tobytes())
        os._exit(0)
    expected = env.step(actions)[1].tobytes()
    assert os.read(read, len(expected)) == expected
    os.waitpid(child, 0)
    env.close()


@pytest.mark.parametrize("context", ["fork", "spawn"])
def test_async_vector_env(context):
    if context not in multiprocessing.get_all_start_methods():
        pytest.skip(f"no {context} here")
    a = gym.make_vec(
        OPEN_SEA, 2, vectorization_mode="async", vector_kwargs={"context": context, "shared_memory": False}, overrides=SHORT
    )
    b = native(num=2, overrides=SHORT)
    try:
        assert_same(a.reset(seed=1), b.reset(seed=1))
        for _ in range(15):
            actions = b.action_space.sample()
            assert_same(a.step(actions), b.step(actions))
    finally:
        a.close()
