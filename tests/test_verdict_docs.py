"""docs/verdict.md says what the code does: every name is there, and its examples run."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from usv_gym.campaign.checks import ASSERTIONS, Check, CheckFile, load_checks
from usv_gym.colregs.requirements import RequirementFile, read_requirements
from usv_gym.colregs.scores import NOT_JUDGED, PARTS, SCORES
from usv_gym.colregs.signals import SIGNALS
from usv_gym.colregs.verdict import episode_columns
from usv_gym.config import parse_yaml, validate

TEXT = (Path(__file__).resolve().parents[1] / "docs" / "verdict.md").read_text(encoding="utf-8")


def blocks(language):
    return re.findall(rf"```{language}\n(.*?)```", TEXT, re.DOTALL)


def test_every_name_is_explained():
    for signal in SIGNALS:
        assert f"| `{signal.name}` | {signal.unit} | {'pair' if signal.of_pair else 'episode'} | {signal.meaning} |" in TEXT
    names = [*read_requirements("colregs"), *PARTS, *Check.keys(), *CheckFile.keys()]
    names += [name for name in episode_columns() if not re.fullmatch(r"(safety|r\d+)(_min)?", name)]
    for name in names:
        assert f"`{name}`" in TEXT or f"{name}:" in TEXT, name
    for key in (*ASSERTIONS, *(more for keys in ASSERTIONS.values() for more in keys), *SCORES):
        assert re.search(rf"\b{key}\b", TEXT), key
    for rule in NOT_JUDGED:
        assert re.search(rf"\b{rule} \(", TEXT), rule


def test_yaml_examples_are_valid(tmp_path):
    requirements, checks = blocks("yaml")
    assert validate(RequirementFile, parse_yaml(requirements, "example")).requirements
    path = tmp_path / "check_crossing.yaml"
    path.write_text(checks)
    (plan,) = load_checks(path)
    assert not plan.error
    assert len(plan.check.asserts) == 7


def test_the_examples_in_python_run(tmp_path, monkeypatch):
    captain, analysis = blocks("python")
    assert captain.count("\n") <= 20
    monkeypatch.chdir(tmp_path)
    (tmp_path / "captain.py").write_text(captain)
    from usv_gym.policies import make_policy
    from usv_gym.run import plan, run

    assert make_policy("captain.py:Captain").action == "heading_speed"
    episode = run(plan("calm_crossing", policy="captain.py:Captain", overrides=["simulation.duration=20"]))
    assert len(episode.t) > 5
    scope = {}
    exec(compile(analysis, "docs/verdict.md", "exec"), scope)
    assert scope["verdict"].row(0)["r14"] == 0.0
    assert scope["value"].shape == (len(read_requirements("colregs")), 1)
    with pytest.raises(IndexError):
        scope["verdict"].why(1)
