"""`usv-gym show` and `export`: what the chart of a start says, and what careless input is told."""

from __future__ import annotations

import json

import numpy as np
import pytest
from gymnasium.utils.seeding import np_random
from typer.testing import CliRunner

from usv_gym.cli import app
from usv_gym.config import ConfigError
from usv_gym.envs.core import Core
from usv_gym.render.primitives import Circle, Label, Polyline
from usv_gym.render.scene_start import scene_of_start
from usv_gym.scenarios.dnv import SituationWarning
from usv_gym.scenarios.loader import load_scenario
from usv_gym.tasks.task import TaskConfig


def start(name, seed=0, **kwargs):
    core = Core(1, source=load_scenario(name), config=TaskConfig())
    core.draw(np.ones(1, np.bool_), [np_random(seed)[0]])
    more = {"cruise": core.model.cruise_speed, "duration": core.scenario.simulation.duration, "tracks": core.tracks}
    return scene_of_start(core.worlds[0], core.ids(0), **{**more, **kwargs})


def texts(scene, role):
    return [label.lines[0] for label in scene.all(Label, role)]


def test_closest_points_of_imazu_13():
    scene = start("imazu/13", title="imazu_13")
    assert scene.panel.title == "imazu_13"
    assert [(row.encounter, round(row.cpa), round(row.tcpa)) for row in scene.panel.targets] == [
        ("head on", 0, 180), ("stand on", 0, 180), ("stand on", 0, 180)]  # fmt: skip
    assert texts(scene, "label_cpa") == ["CPA (3 ships) 0 m at 3:00"]  # one place, one text
    assert [circle.centre for circle in scene.all(Circle, "mark")] == [pytest.approx((0, 0), abs=1e-6)]
    assert texts(scene, "label_vessel") == [
        "S1 ship_1  head-on", "S2 ship_2  crossing, stand on", "S3 ship_3  crossing, stand on"]  # fmt: skip
    assert len(scene.all(Polyline, "track_ship")) == 3
    south, north, west, east = scene.extent
    assert south < -900 < 900 < north
    assert west < -636 < 0 < east


def test_an_own_ship_that_starts_at_rest_sails_its_route():
    # the support vessel of the thesis: worked by hand along the first leg at Odin's 5 m/s, 187 m to the waypoint
    scene = start("busy_open_sea")
    row = scene.panel.targets[0]
    assert 30 < row.tcpa < 40
    assert row.cpa == pytest.approx(136, abs=3)
    assert texts(scene, "label_fixed") == []  # fourteen icebergs need no names
    assert len(texts(start("calm_crossing"), "label_fixed")) == 3


def test_show_draws_a_picture(tmp_path):
    out = tmp_path / "a.png"
    result = CliRunner().invoke(app, ["show", "calm_crossing", "-o", str(out), "--size", "640x480", "--palette", "dark"])
    assert result.exit_code == 0, result.output
    import pygame

    image = pygame.surfarray.array3d(pygame.image.load(out))
    assert image.shape[:2] == (640, 480)
    assert len(np.unique(image.reshape(-1, 3), axis=0)) > 50


def test_export_writes_what_loads_again(tmp_path):
    runner = CliRunner()
    for name in ("a.yaml", "a.json"):
        result = runner.invoke(app, ["export", "imazu/05", "-o", str(tmp_path / name)])
        assert result.exit_code == 0, result.output
        scenario = load_scenario(tmp_path / name)
        assert scenario.family is None
        assert len(scenario.ships) == 2
        assert scenario.ships["ship_1"].set_speed == pytest.approx(5.0)
    assert json.loads((tmp_path / "a.json").read_text())["schemaVersion"] == "0.2.0"
    with pytest.warns(SituationWarning, match="no place for obstacle"):
        assert runner.invoke(app, ["export", "calm_crossing", "-o", str(tmp_path / "b.json")]).exit_code == 0


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["show", "imzu"], "did you mean 'imazu'"),
        (["show", "octagon", "--size", "big"], "expected WIDTHxHEIGHT"),
        (["show", "octagon", "--palette", "pink"], "expected one of day, dark, night"),
        (["show", "octagon", "--seed", "-1"], "seed: expected a whole number of at least 0"),
        (["show", "octagon", "-o", "a.jpg"], "ends in .png"),
        (["export", "octagon", "-o", "a.txt"], "ends in .json"),
        (["export", "near_shore", "-o", "a.yaml"], "cannot be written as a plain scenario"),
        (["export", "imazu", "-o", "a.json", "--set", "family.case=40"], "unknown case '40'"),
    ],
)
def test_careless_input(tmp_path, monkeypatch, arguments, message):
    monkeypatch.chdir(tmp_path)
    result = CliRunner().invoke(app, arguments)
    assert isinstance(result.exception, ConfigError)  # one line and exit code 2, by `cli.main`
    assert message in str(result.exception)
    assert "\n" not in str(result.exception)
    assert list(tmp_path.iterdir()) == []
