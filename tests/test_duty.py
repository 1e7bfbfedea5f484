"""The rules as reward terms: zero unless asked for, and by the same state machine as the scores."""

from __future__ import annotations

import gymnasium as gym
import numpy as np
import pytest

import usv_gym  # noqa: F401
from usv_gym.colregs.duty import breach
from usv_gym.colregs.params import Params
from usv_gym.jit import kernel
from usv_gym.world.encounter import Encounter
from usv_gym.world.state import pair_dtype

DEG = np.pi / 180.0


@kernel
def ask(pairs, params, turn, change, passes):
    return breach(pairs[0], params[0], turn, change, passes)


def duty(code, *, stage=2, dcpa=0.0, turn=0.0, change=0.0, passes=False, alpha=0.0, beta=0.0):
    pair = np.zeros(1, pair_dtype())
    pair["code"], pair["stage"], pair["dcpa"], pair["r_pref"] = code, stage, dcpa, 200.0
    pair["alpha"], pair["beta"] = alpha * DEG, beta * DEG
    return ask(pair, Params().record(), turn * DEG, change, passes)


@pytest.mark.parametrize(
    ("expected", "case"),
    [
        # (16 - 2) / 28 = 0.5 of an apparent turn
        (0.5, {"code": Encounter.CROSSING_STAND_ON, "turn": 16}),
        (0.5, {"code": Encounter.CROSSING_STAND_ON, "turn": -16}),
        (0.5, {"code": Encounter.OVERTAKEN, "change": 0.16}),  # (0.16 - 0.07) / 0.18
        (0.0, {"code": Encounter.CROSSING_STAND_ON, "turn": 16, "stage": 3}),  # may act
        (0.0, {"code": Encounter.CROSSING_STAND_ON, "turn": 40, "stage": 4, "beta": -40}),  # shall act
        (1.0, {"code": Encounter.CROSSING_STAND_ON, "turn": -40, "stage": 4, "beta": -40}),  # not to port
        (0.5, {"code": Encounter.HEAD_ON, "turn": -16}),
        (0.0, {"code": Encounter.HEAD_ON, "turn": 16}),
        (1.0, {"code": Encounter.HEAD_ON, "stage": 3}),  # does nothing, and it is late
        (0.5, {"code": Encounter.HEAD_ON, "stage": 3, "turn": 16}),
        (0.0, {"code": Encounter.HEAD_ON, "stage": 3, "dcpa": 250}),  # no risk any more
        (0.0, {"code": Encounter.CROSSING_GIVE_WAY, "stage": 3, "change": -0.3}),  # slowing down is acting
        (1.0, {"code": Encounter.CROSSING_GIVE_WAY, "turn": -60, "dcpa": 300, "passes": True, "alpha": 20}),  # crossed ahead
        (0.0, {"code": Encounter.CROSSING_GIVE_WAY, "turn": 60, "dcpa": 300, "passes": True, "alpha": -130}),
    ],
)
def test_breach_of_each_duty(expected, case):
    assert duty(**case) == pytest.approx(expected)


HEAD_ON = {
    "simulation": {"control_interval": 1.0, "duration": 200.0},
    "own_ship": {"speed": 5.0, "route": [[1500, 0]]},
    "ships": {"coaster": {"length": 30, "speed": 5.0, "waypoints": [[900, 0], [-900, 0]], "after_last": "continue"}},
    "sensors": "perfect",
}


def sail(turn, **weights):
    """Reward terms [T, 2] and rewards [T] of a head-on meeting, with the own ship on a heading ``turn`` deg off its start."""
    env = gym.make("usv_gym/Scenario-v0", scenario=HEAD_ON, action="heading_speed", observation="truth", reward=weights)
    env.reset(seed=1)
    sea = env.unwrapped.core.worlds
    terms, rewards = [], []
    over = False
    while not over:
        psi = float(sea["vessels"]["eta"][0, 0, 2])
        wanted = (turn * DEG - psi) / (np.pi / 2)
        _, reward, terminated, truncated, info = env.step(np.array([np.clip(wanted, -1, 1), 0.4], np.float32))
        terms.append((info["reward_terms"]["risk"], info["reward_terms"]["colregs"]))
        rewards.append(reward)
        over = terminated or truncated or len(terms) > 85
    env.close()
    return np.array(terms), np.array(rewards)


def test_terms_are_zero_and_cost_nothing_unless_asked_for():
    terms, rewards = sail(0.0)
    asked, paid = sail(0.0, risk=2.0, colregs=3.0)
    assert (terms == 0.0).all()
    assert ((asked <= 0.0) & (asked >= -1.0)).all()
    np.testing.assert_allclose(paid, rewards + asked @ [2.0, 3.0], atol=1e-12)


def test_head_on_to_starboard_is_paid_better_than_to_port_or_nothing():
    nothing, starboard, port = (sail(turn, colregs=1.0, risk=1.0)[0] for turn in (0.0, 35.0, -35.0))
    assert nothing[:, 0].min() < -0.8  # the risk grows to all but a collision
    assert nothing[:, 1].min() == -1.0
    assert port[:, 1].min() == -1.0
    assert starboard[:, 1].sum() > 0.2 * nothing[:, 1].sum()
    assert starboard[:, 1].sum() > 0.2 * port[:, 1].sum()
    assert starboard[:, 0].sum() > 0.6 * nothing[:, 0].sum()
