"""The command line, as a user meets it: what a run leaves, and what bad input gets."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from pathlib import Path

import pytest

from usv_gym.replay.archive import load

GOOD = """\
schema: 1
name: mine
own_ship: {route: [[100, 0]]}
ships:
  ferry: {length: 60, speed_kn: 10, waypoints: [[0, 500], [0, -500]]}
obstacles:
  berg: {position: {latitude_deg: 59.44, longitude_deg: 10.47}, radius: 15}
"""
LOG = "50,0,100,50,0,100\n" * 300
FILES = {"episode.usv", "ais.nmea", "detections.csv", "map.png", "summary.json"}


def usv_gym(*arguments: str, cwd: Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run([sys.executable, "-m", "usv_gym.cli", *arguments], cwd=cwd, capture_output=True, text=True)


def quietly(done: subprocess.CompletedProcess[str]) -> str:
    """Standard error without the notice that kernels are being compiled."""
    return "".join(line + "\n" for line in done.stderr.splitlines() if "compiling kernels" not in line)


# --- run -------------------------------------------------------------------------------------------------------------
@pytest.fixture(scope="module")
def ran(tmp_path_factory):
    cwd = tmp_path_factory.mktemp("run")
    done = usv_gym("run", "busy_open_sea", "--set", "simulation.duration=20", "--seed", "3", "--out", "out", cwd=cwd)
    return done, cwd / "out"


def test_a_run_leaves_five_files_and_no_other(ran):
    done, out = ran
    assert done.returncode == 0, done.stderr
    assert quietly(done) == ""
    assert {path.name for path in out.iterdir()} == FILES
    assert (out / "map.png").read_bytes()[:8] == b"\x89PNG\r\n\x1a\n"
    assert "!AIVDM" in (out / "ais.nmea").read_text()
    assert len((out / "detections.csv").read_text().splitlines()) > 20


def test_a_run_prints_a_summary_that_a_person_can_read(ran):
    text = ran[0].stdout
    for words in (r"scenario +busy_open_sea", r"policy +avoid", r"seed +3", r"duration +20\.0 s", r"distance sailed +\d+ m",
                  r"Iceberg_13 +\d+\.\d", r"TDM position error", r"0-100 +\d+", r"AIS errors"):  # fmt: skip
        assert re.search(words, text), words
    assert "nan" not in text
    assert "1000000000" not in text


def test_the_archive_of_a_run_knows_what_was_run(ran):
    episode = load(ran[1] / "episode.usv")
    assert (episode.meta["policy"], episode.meta["seed"], episode.meta["vessel"]) == ("avoid", 3, "odin")
    assert episode.meta["scenario"]["simulation"]["duration"] == 20
    assert episode.t[-1] == 20
    summary = json.loads((ran[1] / "summary.json").read_text())
    assert summary["policy"] == "avoid"


def test_a_thrust_log_drives_another_vessel(tmp_path):
    (tmp_path / "log.txt").write_text(LOG)
    done = usv_gym("run", "calm_crossing", "--thrust-log", "log.txt", "--vessel", "jolner", "--quiet", cwd=tmp_path)
    assert (done.returncode, done.stdout, quietly(done)) == (0, "", "")
    out = tmp_path / "runs" / "calm_crossing-thrust-log-0"
    assert {path.name for path in out.iterdir()} == FILES
    episode = load(out / "episode.usv")
    assert (episode.meta["vessel"], episode.t[-1]) == ("jolner", 3.0)
    assert episode.eta[-1, 0, 0] > 2


# --- bad input: exit code 2, one clear line, nothing left ---------------------------------------------------------------
def scenario(old: str, new: str) -> dict[str, str]:
    assert old in GOOD
    return {"mine.yaml": GOOD.replace(old, new)}


RUN = ("run", "mine.yaml")
BAD = {
    "misspelt key": (scenario("length", "lenght"), RUN, ["mine.yaml:5", "ships.ferry.lenght", "did you mean 'length'"]),
    "wrong unit": (scenario("60", "60 ft"), RUN, ["mine.yaml:5", "ships.ferry.length", "expected a number, got '60 ft'"]),
    "unit in the key": (scenario("speed_kn", "speed_kmh"), RUN, ["mine.yaml:5", "speed_kmh", "did you mean 'speed_kn'"]),
    "latitude of 95": (scenario("59.44", "95"), RUN, ["mine.yaml:7", "berg.position.latitude_deg", "at most 90, got 95"]),
    "one waypoint": (scenario(", [0, -500]]", "]"), RUN, ["mine.yaml:5", "ships.ferry.waypoints", "at least two waypoints"]),
    "no YAML": (scenario("schema: 1", "schema: [1"), RUN, ["mine.yaml"]),
    "missing file": ({}, RUN, ["mine.yaml", "no such file"]),
    "unknown scenario": ({}, ("run", "busy_open_see"), ["busy_open_see", "did you mean 'busy_open_sea'"]),
    "unknown vessel": ({}, ("run", "octagon", "--vessel", "odinn"), ["vessel", "did you mean 'odin'"]),
    "unknown policy": ({}, ("run", "octagon", "--policy", "avoyd"), ["policy 'avoyd'", "did you mean 'avoid'"]),
    "unknown key to set": ({}, ("run", "octagon", "--set", "weather.wind.sped=3"), ["weather.wind.sped", "'speed'"]),
    "nothing to set": ({}, ("run", "octagon", "--set", "weather"), ["weather", "="]),
    "bad value to set": ({}, ("run", "octagon", "--set", "weather.wind.speed=-3"), ["weather.wind.speed", "-3"]),
    "negative seed": ({}, ("run", "octagon", "--seed", "-1"), ["seed", "-1"]),
    "no thrust log": ({}, ("run", "octagon", "--thrust-log", "log.txt"), ["log.txt", "no such file"]),
    "empty thrust log": ({"log.txt": ""}, ("run", "octagon", "--thrust-log", "log.txt"), ["log.txt", "empty"]),
    "NaN in a thrust log": (
        {"log.txt": LOG + "50,0,nan,50,0,100\n"}, ("run", "octagon", "--thrust-log", "log.txt"), ["log.txt:301", "finite"],
    ),
    "log and pilot": (
        {"log.txt": LOG}, ("run", "octagon", "--policy", "avoid", "--thrust-log", "log.txt"), ["policy 'avoid'"],
    ),
    "results into a file": (
        {"taken": ""}, ("run", "octagon", "--set", "simulation.duration=2", "--out", "taken"), ["taken", "is a file"],
    ),
    "validate": (scenario("length", "lenght"), ("validate", "octagon", "mine.yaml"), ["mine.yaml:5", "lenght"]),
    "list": ({}, ("list", "vessel"), ["vessel", "did you mean 'vessels'"]),
}  # fmt: skip


@pytest.mark.parametrize("case", BAD)
def test_bad_input_gets_one_line_and_leaves_nothing(tmp_path, case):
    files, arguments, words = BAD[case]
    for name, text in files.items():
        (tmp_path / name).write_text(text)
    done = usv_gym(*arguments, cwd=tmp_path)
    said = quietly(done)
    assert done.returncode == 2, done.stderr
    assert said.count("\n") == 1, said
    assert "Traceback" not in said
    for word in words:
        assert word in said
    assert {path.name for path in tmp_path.iterdir()} == set(files)


def test_every_problem_of_a_file_has_its_own_line(tmp_path):
    (tmp_path / "mine.yaml").write_text(GOOD.replace("length", "lenght").replace("59.44", "95"))
    done = usv_gym("validate", "mine.yaml", cwd=tmp_path)
    lines = quietly(done).splitlines()
    assert done.returncode == 2
    assert len(lines) == 2
    assert "lenght" in lines[0]
    assert "latitude_deg" in lines[1]


# --- the other commands ----------------------------------------------------------------------------------------------
def test_validate_says_what_is_in_a_good_file(tmp_path):
    (tmp_path / "mine.yaml").write_text(GOOD)
    done = usv_gym("validate", "mine.yaml", "busy_open_sea", cwd=tmp_path)
    assert done.returncode == 0
    assert "mine.yaml: ok: 1 ships, 1 obstacles, vessel odin" in done.stdout
    assert "busy_open_sea: ok: 2 ships, 14 obstacles" in done.stdout


def test_list_names_all_that_ships(tmp_path):
    done = usv_gym("list", cwd=tmp_path)
    assert done.returncode == 0
    for name in ("busy_open_sea", "octagon", "odin", "jolner", "otter", "thesis", "realistic", "avoid", "waypoints", "idle",
                 "thrust-log", "usv_gym/OpenSea-v0", "usv_gym/Scenario-v0"):  # fmt: skip
        assert name in done.stdout
    assert "odin" not in usv_gym("list", "policies", cwd=tmp_path).stdout


def test_schema_is_json_schema(tmp_path):
    printed = json.loads(usv_gym("schema", cwd=tmp_path).stdout)
    assert "ships" in printed["properties"]
    assert usv_gym("schema", "--out", "scenario.json", cwd=tmp_path).returncode == 0
    assert json.loads((tmp_path / "scenario.json").read_text()) == printed


def test_help_names_every_command(tmp_path):
    done = usv_gym("--help", cwd=tmp_path)
    assert done.returncode == 0
    for command in ("run", "validate", "list", "schema"):
        assert command in done.stdout


# --- what an import costs --------------------------------------------------------------------------------------------
@pytest.mark.parametrize("module", ["usv_gym", "usv_gym.cli"])
def test_an_import_loads_nothing_heavy(module):
    heavy = {"numba", "torch", "pygame", "pyais", "stable_baselines3"}
    code = f"import sys, {module}; print(sorted({heavy} & set(sys.modules)))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
