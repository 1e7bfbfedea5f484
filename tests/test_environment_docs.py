"""docs/environments.md and docs/commands.md say what the code does: every name is there, and their Python runs."""

from __future__ import annotations

import re
from pathlib import Path
from typing import get_args

import pytest

from usv_gym.envs import ENVIRONMENTS
from usv_gym.policies import POLICIES
from usv_gym.resources import shipped
from usv_gym.tasks.task import (
    OUTCOMES,
    OWN_FEATURES,
    TARGET_FEATURES,
    ActionName,
    ObservationName,
    RewardWeights,
    TaskConfig,
)

DOCS = Path(__file__).resolve().parents[1] / "docs"
ENVIRONMENTS_MD = (DOCS / "environments.md").read_text(encoding="utf-8")
COMMANDS_MD = (DOCS / "commands.md").read_text(encoding="utf-8")


@pytest.mark.parametrize("features", [OWN_FEATURES, TARGET_FEATURES], ids=["own", "target"])
def test_every_feature_stands_in_its_row(features):
    for index, (name, scale) in enumerate(features):
        assert f"| {index} | {name} | {scale}".replace("``", "`") in ENVIRONMENTS_MD, name


def test_every_name_is_explained():
    names = [*ENVIRONMENTS, *get_args(ActionName), *get_args(ObservationName), *TaskConfig.model_fields, *OUTCOMES[1:],
             *POLICIES, *shipped("vessels"), *(name for name in shipped("scenarios") if "/" not in name)]  # fmt: skip
    for name in names:
        assert f"`{name}`" in ENVIRONMENTS_MD, name


def test_every_reward_stands_with_its_weight():
    for name, field in RewardWeights.model_fields.items():
        assert re.search(rf"^\| `{name}` \|.*\| {field.default:g} \|$", ENVIRONMENTS_MD, re.MULTILINE), name


@pytest.mark.parametrize("page", [ENVIRONMENTS_MD, COMMANDS_MD], ids=["environments", "commands"])
def test_the_examples_run(page, capsys):
    blocks = re.findall(r"^```python\n(.*?)^```$", page, re.MULTILINE | re.DOTALL)
    assert blocks
    names: dict[str, object] = {}
    for block in blocks:
        exec(compile(block, "example", "exec"), names)  # a page reads from top to bottom: later blocks use earlier names
    if page is COMMANDS_MD:
        out = capsys.readouterr().out
        for kind in ("spawned", "removed", "moved", "waypoints_set", "ais_off"):
            assert f": {kind} " in out
