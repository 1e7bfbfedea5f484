"""Suites: what a file stands for, that all that ship can be used, and what a mistake says."""

from __future__ import annotations

import pytest

from usv_gym.config import ConfigError
from usv_gym.resources import shipped
from usv_gym.scenarios.loader import load_scenario
from usv_gym.scenarios.suites import load_suite


def suite(*cases, **more):
    return load_suite({"name": "test", "cases": list(cases), **more})


@pytest.mark.parametrize("name", shipped("suites"))
def test_every_case_that_ships_loads(name):
    found = load_suite(name)
    assert found.name == name
    assert found.description
    for case in found.cases[:: max(1, len(found.cases) // 12)]:  # those between are written alike
        load_scenario(case.scenario, overrides=case.overrides)


def test_an_entry_stands_for_cases():
    graded = {"scenario": "octagon", "difficulty": [0.2, 1], "overrides": ["weather.wind.speed=3"]}
    found = suite("octagon", graded, "busy_open*")
    assert [case.id for case in found.cases] == ["octagon", "octagon-0.2", "octagon-1", "busy_open_sea"]
    assert [case.difficulty for case in found.cases] == [None, 0.2, 1.0, None]
    assert found.cases[1].overrides == ("weather.wind.speed=3",)
    assert list(suite("octagon", seeds={"first": 5, "number": 3}).seeds.range) == [5, 6, 7]


def test_a_path_is_looked_for_beside_the_file(tmp_path):
    (tmp_path / "mine.yaml").write_text("name: mine\n")
    (tmp_path / "suite.yaml").write_text("cases: [mine.yaml]\n")
    found = load_suite(tmp_path / "suite.yaml")
    assert (found.name, found.cases[0].id) == ("suite", "mine")
    assert load_scenario(found.cases[0].scenario).name == "mine"


@pytest.mark.parametrize(
    ("cases", "message"),
    [
        (["octagn"], r"cases.0: unknown scenario 'octagn'; did you mean 'octagon'\?"),
        (["octagon", "octagon"], r"cases.1: the id 'octagon' is there already"),
        (["imzu/*"], "no scenario that ships matches"),
        ([{"scenario": "*o*", "id": "one"}], "cannot all be 'one'"),
        ([{"scenario": "octagon", "difficulty": 2}], "cases.0.difficulty.*: expected a number of at most 1, got 2"),
        ([{"scenaro": "octagon"}], r"cases.0.scenaro: unknown key; did you mean 'scenario'\?"),
        ([], "cases: expected at least one case"),
    ],
)
def test_mistakes_are_said_in_one_line(cases, message):
    with pytest.raises(ConfigError, match=message) as error:
        load_suite({"name": "test", "cases": cases})
    assert "\n" not in str(error.value)


def test_an_unknown_suite_is_suggested():
    with pytest.raises(ConfigError, match=r"unknown suite 'thsis'; did you mean 'thesis'\?"):
        load_suite("thsis")
