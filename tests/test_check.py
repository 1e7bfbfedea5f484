"""Scripted checks: what a file may say, what is found, what is reported, and that nothing bad stops the rest."""

from __future__ import annotations

import csv
import subprocess
import sys
import xml.etree.ElementTree as ET
from pathlib import Path

import pytest

from usv_gym.campaign.check_report import junit, trace, write_trace
from usv_gym.campaign.check_run import check_files, exit_code, faults, fly, read_files
from usv_gym.campaign.checks import load_checks
from usv_gym.config import ConfigError
from usv_gym.resources import configs

CONTROLLERS = '''
class Base:
    action, observation, flat = "heading_speed", "tracks", True

    def reset(self, info):
        self.n = 0

    def act(self, observation):
        self.n += 1
        return self.do()

class Raises(Base):
    def do(self):
        if self.n > 3:
            raise ValueError("lost my way")
        return [0, 0]

class Nan(Base):
    def do(self):
        return [float("nan"), 0.0]

class Hangs(Base):
    def do(self):
        while self.n > 2:
            pass
        return [0, 0]

class Fine(Base):
    def do(self):
        return [0.0, 0.5]
'''


def write(directory, name, text):
    path = directory / name
    path.write_text(text)
    return path


def one_check(body, more=""):
    return f"{more}\nchecks:\n  it:\n    scenario: calm_crossing\n    policy: idle\n{body}"


# --- what a file may say ---------------------------------------------------------------------------------------------
ARRIVAL = "    assert: [{outcome: arrival}]"
WRONG = {
    one_check("    asert: [{never_closer_than: 5}]"): r"check_x\.yaml:6: checks\.it\.asert: unknown key; did you mean 'assert'",
    one_check(""): r"checks\.it: asks for nothing: give requirements or assert",
    one_check("    requirements: [R14-starbord]"):
        r"checks\.it\.requirements\.0: unknown requirement 'R14-starbord'; did you mean 'R14-starboard'",
    one_check("    assert: [{never_closer_than: -5}]"): r"0\.never_closer_than: expected a number of at least 0, got -5",
    one_check("    assert: [{never_closer_than: 5, outcome: arrival}]"):
        r"assert\.0: expected one of never_closer_than.*got never_closer_than and outcome",
    one_check("    assert: [{to: coaster}]"): r"assert\.0: expected one of .*; got none",
    one_check("    assert: [{detects: coaster}]"): r"assert\.0: detects needs before_range",
    one_check("    assert: [{outcome: arrival, of: coaster}]"): r"assert\.0\.of: does not go with outcome",
    one_check("    assert: [{passes: port_to_prt}]"): r"assert\.0\.passes: .*did you mean 'port_to_port'",
    one_check("    assert: [{stl: always (clearence > 5)}]"): r"unknown signal 'clearence'; did you mean 'clearance'",
    one_check("    seeds: [1, 1]\n" + ARRIVAL): r"checks\.it\.seeds: a seed is there twice",
    one_check("    seeds: many\n" + ARRIVAL): r"checks\.it\.seeds: expected how many, or a list of seeds, got 'many'",
    one_check(ARRIVAL, "requirements: {R2-contact: {stl: t > 1}}"): r"requirements\.R2-contact: this id is taken already",
    one_check(ARRIVAL, "requirement_files: [colreg]"):
        r"requirement_files\.0: unknown requirements 'colreg'; did you mean 'colregs'",
    "checks: {}": r"checks: ",
    "": r"is empty",
}  # fmt: skip


@pytest.mark.parametrize(("text", "message"), WRONG.items(), ids=range(len(WRONG)))
def test_what_is_wrong_with_a_file_is_said(tmp_path, text, message):
    with pytest.raises(ConfigError, match=message):
        load_checks(write(tmp_path, "check_x.yaml", text))


def test_what_does_not_exist_is_an_error_of_its_check_alone(tmp_path):
    path = write(tmp_path, "check_x.yaml", """
checks:
  policy: {scenario: calm_crossing, policy: avoidd, assert: [{outcome: arrival}]}
  scenario: {scenario: calm_crosing, policy: avoid, assert: [{outcome: arrival}]}
  ship: {scenario: calm_crossing, policy: avoid, assert: [{never_closer_than: 5, to: coster}]}
  fine: {scenario: calm_crossing, policy: avoid, requirements: ["R14-*"]}
""")  # fmt: skip
    plans = {plan.name: plan for plan in load_checks(path)}
    assert "check_x.yaml:3: checks.policy.policy: unknown policy 'avoidd'; did you mean 'avoid'" in plans["policy"].error
    assert "unknown scenario 'calm_crosing'; did you mean 'calm_crossing'" in plans["scenario"].error
    assert "nothing is called 'coster'; did you mean 'coaster'" in plans["ship"].error
    assert plans["fine"].error == ""
    assert list(plans["fine"].requirements) == ["R14-starboard", "R14-not-to-port", "R14-port-to-port"]


# --- flown -----------------------------------------------------------------------------------------------------------
@pytest.fixture(scope="module")
def flown(tmp_path_factory):
    """All kinds of trouble in one directory, and a check that is well."""
    directory = tmp_path_factory.mktemp("checks")
    write(directory, "mine.py", CONTROLLERS)
    write(directory, "check_wrong.yaml", one_check("    asert: []"))
    write(directory, "check_trouble.yaml", """
checks:
  unknown: {scenario: calm_crossing, policy: avoidd, assert: [{outcome: arrival}]}
  raises: {scenario: calm_crossing, policy: "mine.py:Raises", seeds: 2, assert: [{outcome: arrival}]}
  nan: {scenario: calm_crossing, policy: "mine.py:Nan", assert: [{outcome: arrival}]}
  hangs: {scenario: calm_crossing, policy: "mine.py:Hangs", step_limit: 0.5, requirements: [R2-contact]}
  fine: {scenario: calm_crossing, policy: "mine.py:Fine", requirements: [R2-obstacle]}
""")  # fmt: skip
    verdicts = read_files(check_files([directory]))
    fly(verdicts, workers=1)
    return verdicts


def test_every_trouble_is_reported_with_its_cause_and_the_rest_goes_on(flown):
    by_name = {v.plan.name if v.plan else v.file.name: v for v in flown}
    assert "check_wrong.yaml:6: checks.it.asert: unknown key" in by_name["check_wrong.yaml"].error
    assert "unknown policy 'avoidd'" in by_name["unknown"].error
    assert [faults(r) for r in by_name["raises"].results] == [
        ["act() at step 3 (t = 3 s) raised ValueError: lost my way (mine.py:15)"]
    ] * 2
    assert faults(by_name["nan"].results[0]) == ["act() at step 0 (t = 0 s) returned [nan, 0.0]: expected finite numbers"]
    (hung,) = faults(by_name["hangs"].results[0])
    assert hung.startswith("act() at step 2 (t = 2 s) took longer than 0.5 s (in ")
    assert {name: v.status for name, v in by_name.items()} == {
        "check_wrong.yaml": "error", "unknown": "error", "raises": "error", "nan": "error", "hangs": "error", "fine": "passed",
    }  # fmt: skip
    assert exit_code(flown) == 2
    assert exit_code([v for v in flown if not v.error]) == 1
    assert exit_code([by_name["fine"]]) == 0


def test_junit_has_a_case_for_every_episode(flown):
    root = ET.fromstring(junit(flown))
    assert root.tag == "testsuites"
    counts = {Path(suite.get("name")).name: tuple(int(suite.get(key)) for key in ("tests", "failures", "errors"))
              for suite in root}  # fmt: skip
    assert counts == {"check_trouble.yaml": (6, 0, 5), "check_wrong.yaml": (1, 0, 1)}
    hangs = root.find(".//testcase[@name='hangs[0]']")
    assert hangs.find("properties/property").attrib == {"name": "requirement", "value": "R2-contact"}
    assert "took longer than 0.5 s" in hangs.find("error").get("message")


@pytest.fixture(scope="module")
def shipped():
    verdicts = read_files([configs() / "checks" / "check_calm_crossing.yaml"])
    fly(verdicts, workers=0)
    return {v.plan.name: v for v in verdicts}


def test_the_shipped_example_passes_and_says_what_waypoints_do_wrong(shipped):
    assert [v.status for v in shipped.values()] == ["passed", "passed"]
    wrong = "\n".join(faults(shipped["waypoints-cross-ahead"].results[0]))
    assert "R15-not-ahead: margin -" in wrong
    assert "towards coaster" in wrong
    assert "score r15 at_least 0.4" in wrong
    assert "crossed ahead" in wrong


def test_traceability_goes_from_requirement_to_verdict(shipped, tmp_path):
    rows = trace(list(shipped.values()))
    by_id = {(row["requirement"], str(row["check"]).rpartition("::")[2]): row for row in rows}
    berth = by_id["EX-berth", "avoid-keeps-clear"]
    assert (berth["episodes"], berth["holds"], berth["violated"], berth["verdict"]) == (5, 5, 0, "holds")
    assert float(berth["worst margin"]) >= 0
    assert by_id["R15-not-ahead", "waypoints-cross-ahead"]["verdict"] == "violated"
    assert by_id["R17-act", ""]["verdict"] == "not checked"
    for name in ("trace.csv", "trace.md"):
        write_trace(list(shipped.values()), tmp_path / name)
    with (tmp_path / "trace.csv").open() as file:
        assert [row["requirement"] for row in csv.DictReader(file)] == [row["requirement"] for row in rows]
    assert (tmp_path / "trace.md").read_text().count("\n") == len(rows) + 2
    with pytest.raises(ConfigError, match=r"expected a file that ends in \.md or \.csv"):
        write_trace(list(shipped.values()), tmp_path / "trace.txt")


def test_findings_say_what_when_and_how_much(shipped):
    found = {f["what"]: f for f in shipped["avoid-keeps-clear"].results[0].seen["findings"]}
    near = found["never_closer_than 10.0"]
    assert near["ok"]
    assert near["value"] >= 10
    assert 0 < near["time"] < 240
    assert found["detects coaster before_range 200.0"]["value"] >= 200
    assert found["stl eventually (range < 400) of coaster"]["ok"]


# --- as a command and as tests ---------------------------------------------------------------------------------------
def test_the_command_prints_writes_and_exits(tmp_path):
    write(tmp_path, "check_a.yaml", "checks:\n  idle: {scenario: calm_crossing, policy: idle, assert: [{outcome: arrival}]}\n")
    done = subprocess.run(
        [sys.executable, "-m", "usv_gym.cli", "check", ".", "--junit", "out/junit.xml", "--trace", "out/trace.md"],
        cwd=tmp_path, capture_output=True, text=True,
    )  # fmt: skip
    assert done.returncode == 1, done.stderr
    assert "check_a.yaml::idle" in done.stdout
    assert "usv-gym run calm_crossing --policy idle --seed 0" in done.stdout
    assert ET.parse(tmp_path / "out/junit.xml").getroot()[0].get("failures") == "1"
    assert (tmp_path / "out/trace.md").exists()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["check_none.yaml"], "check_none.yaml: no such file"),
        (["."], "no check_*.yaml here"),
        ([str(configs() / "checks"), "--trace", "trace.doc"], "expected a file that ends in .md or .csv"),
    ],
)
def test_careless_commands(tmp_path, arguments, message):
    done = subprocess.run(
        [sys.executable, "-m", "usv_gym.cli", "check", *arguments], cwd=tmp_path, capture_output=True, text=True
    )
    assert done.returncode == 2
    assert message in done.stdout + done.stderr
    assert "Traceback" not in done.stderr


def test_pytest_collects_files_of_checks(tmp_path):
    write(tmp_path, "check_a.yaml", """
checks:
  stays: {scenario: calm_crossing, policy: idle, assert: [{outcome: time_limit}]}
  arrives: {scenario: calm_crossing, policy: idle, requirements: [R2-contact], assert: [{outcome: arrival}]}
""")  # fmt: skip
    write(tmp_path, "check_b.yaml", one_check("    asert: []"))
    done = subprocess.run(
        [sys.executable, "-m", "pytest", "-p", "usv_gym.campaign.pytest_plugin", "-p", "no:cacheprovider", "--rootdir", ".",
         "--continue-on-collection-errors", "--junitxml", "out.xml", "."],
        cwd=tmp_path, capture_output=True, text=True,
    )  # fmt: skip
    assert "1 failed, 1 passed, 1 error" in done.stdout, done.stdout + done.stderr
    assert "outcome arrival: outcome time_limit at 240 s" in done.stdout
    assert "check_b.yaml:6: checks.it.asert: unknown key" in done.stdout
    assert "Traceback" not in done.stdout
    properties = ET.parse(tmp_path / "out.xml").getroot().findall(".//property")
    assert [p.get("value") for p in properties] == ["R2-contact"]
