"""The worked example of a policy that all ships of a mixed fleet share (examples/shared_policy.py)."""

from __future__ import annotations

import importlib.util
from pathlib import Path

import numpy as np
import pytest

EXAMPLE = Path(__file__).parents[1] / "examples" / "shared_policy.py"


@pytest.fixture(scope="module")
def example():
    pytest.importorskip("supersuit")
    spec = importlib.util.spec_from_file_location("shared_policy", EXAMPLE)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.filterwarnings("ignore::DeprecationWarning", "ignore::UserWarning")
def test_rows_of_the_vector_environment_are_the_ships(example):
    env = example.vector_env(2, agents=3, vessels=("odin", "ship"), observation="truth", icebergs=0)
    assert env.num_envs == 6
    first = env.reset()
    rows = first.copy()
    for _ in range(60):
        rows, _, _, _ = env.step(np.tile(np.array([0.0, 1.0], np.float32), (6, 1)))
    assert rows.shape == first.shape
    assert np.isfinite(rows).all()
    assert not np.array_equal(rows, first)


@pytest.mark.filterwarnings("ignore::DeprecationWarning", "ignore::UserWarning")
def test_a_shared_policy_learns_and_acts(example):
    model = example.train(1200, seas=1, icebergs=0, agents=3)
    assert model.num_timesteps >= 1200
    env = example.vector_env(1, agents=3, vessels=("odin", "otter", "ship"), observation="truth")
    actions, _ = model.predict(env.reset(), deterministic=True)
    assert actions.shape == (3, 2)
    assert np.abs(actions).max() <= 1.0
