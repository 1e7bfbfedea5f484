"""Campaigns: bad controllers cost an episode and no more, nothing is lost or flown twice, and the numbers can be defended."""

from __future__ import annotations

import json
import re
import shlex
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest
from browser import Browser, chromium

from usv_gym.campaign.compare import compare_campaigns
from usv_gym.campaign.evaluate import fly, write_results
from usv_gym.campaign.flight import Flight
from usv_gym.campaign.plan import plan_campaign, read_campaign
from usv_gym.campaign.report import command_of, worst_of, write_report
from usv_gym.campaign.runner import Fleet
from usv_gym.campaign.summary import claim, of_policy, share
from usv_gym.cli import main
from usv_gym.config import ConfigError
from usv_gym.metrics.intervals import upper_bound
from usv_gym.metrics.paired import mcnemar, shift
from usv_gym.policies import make_policy
from usv_gym.replay.archive import load
from usv_gym.scenarios.suites import Case

HERE = Path(__file__).parent
BAD = f"{HERE / 'bad_controllers.py'}:"
SHORT = ("simulation.duration=20",)
CROSSING = Case(id="crossing", scenario="calm_crossing", overrides=SHORT)


def cli(*arguments, cwd=None, **more):
    command = [sys.executable, "-m", "usv_gym.cli", *map(str, arguments)]
    return subprocess.run(command, cwd=cwd, capture_output=True, text=True, **more)


def rows_of(directory):
    """Rows of a campaign, sorted, without what the clock says."""
    return [{key: value for key, value in row.items() if key != "wall"} for row in read_campaign(directory)[1]]


# --- controllers -----------------------------------------------------------------------------------------------------
CAUSES = {
    "Raises": r"act\(\) at step 3 \(t = 3 s\) raised ValueError: lost my map \(bad_controllers.py:\d+\)",
    "NaN": r"act\(\) at step 0 \(t = 0 s\) returned \[0.0, nan\]: expected finite numbers",
    "Hangs": r"act\(\) at step 4 \(t = 4 s\) took longer than 0.5 s \(in act, bad_controllers.py:\d+\)",
    "ThreeNumbers": r"returned \[0.0, 0.0, 0.0\]: expected 2 numbers, got 3",
    "Dies": "the process of the controller ended: exit code 7",
    "NoReset": "a NoReset has no reset; a controller has reset",
    "NeedsArguments": "making it: TypeError: .*missing 1 required positional argument: 'brain'",
    "Nobody": "bad_controllers.py has no 'Nobody'; did you mean",
}


def test_a_bad_controller_costs_its_episode_and_says_why_and_the_campaign_goes_on():
    flights = [Flight(BAD + name, CROSSING, (0,), step_limit=0.5) for name in CAUSES]
    flights += [Flight(BAD + "Hangs", CROSSING, (1, 2), step_limit=0.5), Flight(BAD + "Good", CROSSING, (0, 1))]
    with Fleet(1) as fleet:
        results = {result.key: result for result in fleet.fly(flights)}
    assert len(results) == len(CAUSES) + 4
    for name, words in CAUSES.items():
        result = results[BAD + name, "crossing", 0]
        assert result.outcome == "failed", name
        assert re.search(words, result.cause), (name, result.cause)
    for seed in (1, 2):
        assert "took longer" in results[BAD + "Hangs", "crossing", seed].cause
    good = [results[BAD + "Good", "crossing", seed] for seed in (0, 1)]
    assert [(one.outcome, one.steps, one.cause) for one in good] == [("time_limit", 20, "")] * 2


def test_a_worker_that_is_killed_costs_one_episode_of_a_controller_and_none_of_a_batch(monkeypatch):
    with Fleet(1) as fleet:
        flown = fleet.fly([Flight("avoid", CROSSING, (0, 1, 2))])
        fleet._hire().process.kill()  # before it has been given anything to do
        assert sorted(result.seed for result in flown) == [0, 1, 2]


def test_who_flies_does_not_matter():
    flight = Flight("avoid", Case(id="sea", scenario="open_sea", overrides=("simulation.duration=40",)), tuple(range(4)),
                    witness="usv_gym.campaign.evidence:Judgement")  # fmt: skip
    results = []
    for workers, flights in ((0, [flight]), (2, [Flight(**{**vars(flight), "seeds": (s,)}) for s in flight.seeds])):
        with Fleet(workers) as fleet:
            results.append(sorted((r.plain() for r in fleet.fly(flights)), key=lambda row: row["seed"]))
    for one in results:
        for row in one:
            del row["wall"]
    assert results[0] == results[1]


# --- built-in controllers ----------------------------------------------------------------------------------------------
@pytest.mark.parametrize("name", ["waypoints", "avoid", "vo", "sbmpc", "apf"])
def test_a_batch_decides_as_each_alone(name):
    """Bit for bit, over random pictures, with a state that goes on from step to step."""
    rng = np.random.default_rng(1)
    many = make_policy(name)
    task = many.task
    scales = {"max_speed": 7.18, "cruise_speed": 5.0, "length": 10.9, "beam": 3.5, "control_interval": 1.0, "channels": 2,
              "targets": task.targets, "rate_scale": task.rate_scale, "range_scale": task.range_scale,
              "distance_scale": task.distance_scale, "target_speed_scale": task.target_speed_scale,
              "radius_scale": task.radius_scale, "cross_track_scale": task.cross_track_scale}  # fmt: skip
    many.reset_batch(6, {"scales": scales})
    alone = [make_policy(name) for _ in range(6)]
    for one in alone:
        one.reset({"scales": scales})
    for _ in range(8):
        obs = rng.uniform(-0.15, 0.15, (6, 12 + 9 * task.targets)).astype(np.float32)
        obs[:, 0], obs[:, 6] = 0.7, 0.05
        obs[:, 3:5] = obs[:, 7:9] = [0.0, 1.0]
        targets = obs[:, 12:].reshape(6, -1, 9)
        targets[..., 0] = np.arange(task.targets) < rng.integers(0, 5, (6, 1))
        targets[..., 6:8] = 0.02
        mask = rng.random(6) < 0.8
        actions = many.act_batch(obs, mask)
        for b in np.flatnonzero(mask):
            assert actions[b].tobytes() == alone[b].act(obs[b]).tobytes()


IDEAL = ("sensors.base=perfect",)


@pytest.mark.parametrize("name", ["vo", "sbmpc"])
def test_no_collision_on_the_22_cases_of_imazu_in_calm_water_with_ideal_sensors(name):
    """Found: all arrive; ``vo`` comes as near as 26 m (hull to hull), ``sbmpc`` 46 m."""
    flights = [Flight(name, Case(id=f"{k:02d}", scenario=f"imazu/{k:02d}", overrides=IDEAL), (0,)) for k in range(1, 23)]
    with Fleet(0) as fleet:
        results = list(fleet.fly(flights))
    assert len(results) == 22
    for result in results:
        assert result.outcome == "arrival", result
        assert result.closest > 10.9, result  # one ship's length


def meeting(name, course, bearing, ratio=1.0):
    """Fly towards a ship that would be met after 150 s; returns tracks [T, 2] of both, N and E [m]."""
    u, t = 5.0, 150.0
    n, e = u * t, 0.0
    c = np.radians(course)
    start = [n - ratio * u * t * np.cos(c), e - ratio * u * t * np.sin(c)]
    assert np.isclose(np.degrees(np.arctan2(start[1], start[0])), bearing, atol=1.0)
    often = {sensor: {"rate": 10.0} for sensor in ("gnss", "mru", "imu", "speed_log", "wind")}
    sea = {"name": "met", "simulation": {"dt": 0.1, "traffic_interval": 0.5, "duration": 350.0},
           "sensors": {"base": "perfect", "navigation": often},
           "own_ship": {"speed": u, "route": [[2 * n, 0.0]]},
           "ships": {"other": {"length": 30, "speed": ratio * u, "after_last": "continue",
                               "waypoints": [start, [n + 2000 * np.cos(c), 2000 * np.sin(c)]]}}}  # fmt: skip
    from usv_gym.run import plan, run

    episode = run(plan(sea, policy=name))
    assert episode.meta["outcome"]["outcome"] in ("arrival", "time_limit")
    assert episode.meta["outcome"]["closest_m"] > 20
    return episode.eta[:, 0, :2], episode.eta[:, 1, :2]


def passing(own, other):
    """Index of the closest point, and where the other ship is then, off the own track: + to starboard."""
    k = int(np.hypot(*(own - other).T).argmin())
    way = own[k] - own[k - 1]
    line = other[k] - own[k]
    return k, float(way[0] * line[1] - way[1] * line[0])


@pytest.mark.parametrize("name", ["vo", "sbmpc", "apf", "avoid"])
def test_head_on_it_passes_port_to_port(name):
    own, other = meeting(name, 180.0, 0.0)
    k, side = passing(own, other)
    assert side < 0  # the other ship is to port
    assert own[k, 1] > 15  # and the own ship to starboard of its track


@pytest.mark.parametrize("name", ["vo", "sbmpc", "apf"])
def test_giving_way_to_a_crossing_ship_it_passes_astern_of_it(name):
    own, other = meeting(name, 270.0, 45.0)  # from starboard, bound west
    crossed = int(np.argmax(other[:, 1] < own[:, 1]))  # when it goes by, it is ahead
    assert other[crossed, 0] > own[crossed, 0]


@pytest.mark.parametrize("name", ["vo", "sbmpc"])
def test_standing_on_it_keeps_course_and_speed_at_first(name):
    own, _ = meeting(name, 90.0, -45.0)  # from port, bound east
    early = own[10:75]  # until 75 s before they would meet
    assert np.abs(early[:, 1]).max() < 5
    assert np.abs(np.linalg.norm(np.diff(early, axis=0), axis=1) - 5.0).max() < 0.3


# --- numbers ---------------------------------------------------------------------------------------------------------
def test_the_bound_is_the_exact_one_sided_one():
    assert upper_bound(0, 1000) == pytest.approx(1 - 0.05 ** (1 / 1000), abs=1e-9)  # 0.2991 %
    assert share(upper_bound(0, 1000)) == "0.30 %"
    assert share(0.00123) == "0.13 %"  # rounded up
    assert share(1.0) == "100 %"


def test_mcnemar_and_shift_on_known_numbers():
    # 10 only in a, 2 only in b: 2 * P(X <= 2 of 12 fair coins) = 2 * 79 / 4096
    a = np.array([1] * 10 + [0] * 2 + [1] * 5 + [0] * 9, bool)
    b = np.array([0] * 10 + [1] * 2 + [1] * 5 + [0] * 9, bool)
    d = mcnemar(a, b)
    assert (d.only_a, d.only_b, d.both, d.neither) == (10, 2, 5, 9)
    assert d.p == pytest.approx(158 / 4096)
    x = np.arange(40.0)
    s = shift(x, x + 1.0 + 0.1 * np.sin(x))
    assert s.low < s.mean < s.high
    assert s.low > 0.9
    assert s.p < 1e-6
    assert shift(x, x).p == 1.0
    assert shift([np.nan, 1.0], [2.0, 3.0]).n == 1  # only pairs in which both are known


def test_a_failed_episode_is_no_collision_and_no_success():
    row = {"policy": "a", "case": "c", "seed": 0, "outcome": "failed", "cause": "why", "encounters": []}
    good = {**row, "outcome": "arrival", "cause": "", "closest": 10.0}
    one = of_policy([row, good, {**good, "outcome": "collision"}])
    assert (one["failed"]["k"], one["failed"]["n"]) == (1, 3)
    assert (one["collision"]["k"], one["collision"]["n"]) == (1, 2)
    assert one["causes"] == {"why": 1}
    assert "1 collision in 2 episodes" in claim(one)


# --- campaigns -------------------------------------------------------------------------------------------------------
ARGUMENTS = ("evaluate", "--suite", "open_sea", "--policy", "avoid", "--policy", "waypoints", "--seeds", "48", "--set",
             "simulation.duration=90", "--no-report", "--workers", "2")  # fmt: skip


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory):
    out = tmp_path_factory.mktemp("campaign") / "whole"
    done = cli(*ARGUMENTS, "--out", out)
    assert done.returncode == 0, done.stderr
    return out, done.stdout


def test_killed_in_the_middle_and_resumed_it_has_the_same_rows(undisturbed, tmp_path):
    out = tmp_path / "killed"
    process = subprocess.Popen([sys.executable, "-m", "usv_gym.cli", *ARGUMENTS, "--out", str(out)], stdout=subprocess.DEVNULL)
    journal = out / "episodes.jsonl"
    while not (journal.exists() and journal.read_bytes().count(b"\n") >= 20):
        assert process.poll() is None, "it was done before it could be killed"
        time.sleep(0.01)
    process.send_signal(signal.SIGKILL)
    process.wait()
    data = journal.read_bytes()
    before = data.count(b"\n")
    assert before < 96
    journal.write_bytes(data + b'{"policy":"avoid","case":"op')  # torn, as a power cut leaves it
    done = cli(*ARGUMENTS, "--out", out)
    assert done.returncode == 0, done.stderr
    assert f"{96 - before} of {96 - before} episodes" in done.stdout  # nothing twice
    assert journal.read_bytes().count(b"\n") == 96
    assert rows_of(out) == rows_of(undisturbed[0])


def test_what_it_leaves_can_be_read(undisturbed):
    out, said = undisturbed
    table = pq.read_table(out / "episodes.parquet")
    rows = rows_of(out)
    assert table.num_rows == len(rows) == 96
    assert table.column("closest").to_pylist() == [row["closest"] for row in rows]
    assert json.loads(table.schema.metadata[b"usv_gym"])["suite"] == "open_sea"
    encounters = pq.read_table(out / "encounters.parquet")
    assert encounters.num_rows == sum(len(row["encounters"]) for row in rows) > 50
    assert {"class", "clearance", "safety", "start_dcpa"} <= set(encounters.column_names)
    summary = json.loads((out / "summary.json").read_text())
    assert summary["policies"]["avoid"]["episodes"] == 48
    assert summary["paired"][0]["pairs"] == 48
    assert "the collision probability is below" in said


def test_more_seeds_and_policies_add_to_what_is_there_and_other_things_are_refused(tmp_path):
    def campaign(policies, **more):
        more = {"seeds": 2, "overrides": SHORT, **more}
        return plan_campaign("calm_crossing", policies, **more)

    flown = []

    def go(what):
        fly(what, tmp_path, workers=0, progress=lambda done, total, result: flown.append(total) if result is None else None)

    go(campaign(["waypoints"]))
    go(campaign(["waypoints"], seeds=3))
    go(campaign(["waypoints", "idle"], seeds=3))
    assert flown == [2, 1, 3]
    assert len(rows_of(tmp_path)) == 6
    with pytest.raises(ConfigError, match=r"another case calm_crossing .* give another --out"):
        go(campaign(["waypoints"], overrides=("simulation.duration=21",)))
    with pytest.raises(ConfigError, match="a campaign of 'calm_crossing', not of 'octagon'"):
        go(plan_campaign("octagon", ["idle"], seeds=1))


def test_only_one_episode_of_a_suite_is_flown_when_only_that_is_asked_for(tmp_path):
    whole = plan_campaign("imazu", ["avoid"], seeds=3)
    assert sum(len(flight.seeds) for flight in whole.flights(set())) == 66
    (one,) = plan_campaign("imazu", ["avoid"], only=["imazu/03:7"]).flights(set())
    assert (one.case.id, one.seeds) == ("imazu/03", (7,))
    (case,) = plan_campaign("imazu", ["avoid"], seeds=3, only=["imazu/03"]).flights(set())
    assert case.seeds == (0, 1, 2)


def test_the_gate_lets_the_same_pass_and_stops_a_worse_one(undisturbed, tmp_path):
    out, _ = undisturbed
    for name in ("avoid", "waypoints"):
        meta, rows = read_campaign(out)
        (tmp_path / name).mkdir()
        (tmp_path / name / "campaign.json").write_text(json.dumps({**meta, "policies": [name]}))
        lines = [json.dumps(row) for row in rows if row["policy"] == name]
        (tmp_path / name / "episodes.jsonl").write_text("\n".join(lines) + "\n")
    avoid, waypoints = tmp_path / "avoid", tmp_path / "waypoints"
    assert compare_campaigns(out, out)["regressions"] == []
    worse = compare_campaigns(avoid, waypoints)
    assert any("collision" in text for text in worse["regressions"])
    better = compare_campaigns(waypoints, avoid)  # (who keeps straight on keeps Rule 17 well)
    assert not any(event in text for text in better["regressions"] for event in ("collision", "near miss", "success"))
    assert compare_campaigns(waypoints, avoid, tolerance=1.0)["regressions"] == []
    assert any("collision" in f["what"] for f in better["policies"]["waypoints -> avoid"]["findings"])
    done = cli("compare", avoid, waypoints)
    assert done.returncode == 1
    assert "regression" in done.stdout
    assert cli("compare", out, out).returncode == 0


# --- the report ------------------------------------------------------------------------------------------------------
@pytest.fixture(scope="module")
def reported(undisturbed):
    out, _ = undisturbed
    meta, rows = read_campaign(out)
    summary = json.loads((out / "summary.json").read_text())
    size = write_report(out, meta, rows, summary, workers=0)
    return out, meta, rows, size


def test_the_report_is_small_and_has_its_figures_and_replays(reported):
    out, meta, rows, size = reported
    assert size < 2e6
    text = (out / "report.html").read_text()
    assert len(list((out / "figures").glob("*.svg"))) == 8
    worst = worst_of(rows)
    assert len(worst) == 12
    assert worst[0]["outcome"] == "collision"
    for row in worst:
        command = command_of(meta, row)
        assert command.replace("'", "&#x27;") in text
    assert set(re.findall(r'href="(replays/[^"]+)"', text)) == {f"replays/{k + 1:02d}.html" for k in range(12)}
    assert all((out / "replays" / f"{k + 1:02d}.html").exists() for k in range(12))


def test_the_printed_command_does_the_worst_case_again_exactly(reported, tmp_path):
    out, meta, rows, _ = reported
    row = worst_of(rows)[0]
    words = shlex.split(command_of(meta, row))
    assert words[0] == "usv-gym"
    done = cli(*words[1:], "--out", tmp_path / "again")
    assert done.returncode == 0, done.stderr
    again, film = load(tmp_path / "again" / "episode.usv"), load(out / "replays" / "01.usv")
    assert again.meta["outcome"] == {"outcome": row["outcome"], "closest_m": row["closest"]}
    assert again.t[-1] == row["time"]
    assert again.eta.tobytes() == film.eta.tobytes()
    assert again.actions.tobytes() == film.actions.tobytes()


@pytest.mark.skipif(chromium() is None, reason="no Chromium here")
@pytest.mark.parametrize("width", [1200, 400])
def test_the_report_opens_without_network_complaints_or_overflow(reported, width):
    page = (reported[0] / "report.html").resolve().as_uri()
    with Browser(width, 900) as browser:
        browser.open(page)
        assert browser.run("document.documentElement.scrollWidth") <= width
        assert browser.run("document.querySelectorAll('.worst svg').length") == 12
        browser.run("document.querySelectorAll('details').forEach(d => d.open = true)")
        assert browser.run("document.documentElement.scrollWidth") <= width
        assert browser.run("[...document.querySelectorAll('.figures svg')].every(s => s.getBoundingClientRect().height > 100)")
        browser.frame()
        assert browser.complaints == []
        assert [url for url in browser.requests if not url.startswith(("file:", "data:"))] == []


# --- the page in docs ------------------------------------------------------------------------------------------------
def blocks():
    return re.findall(r"```python\n(.*?)```", (HERE.parent / "docs" / "campaigns.md").read_text(), re.S)


def test_the_controller_of_the_docs_flies(tmp_path):
    controller = blocks()[0]
    assert len([line for line in controller.splitlines() if line.strip()]) <= 15
    (tmp_path / "my.py").write_text(controller)
    done = cli("evaluate", "--suite", "imazu/01", "--policy", "my.py:Dodge", "--policy", "waypoints", "--seeds", "1",
               "--out", "out", "--no-report", cwd=tmp_path)  # fmt: skip
    assert done.returncode == 0, done.stderr + done.stdout
    outcomes = {row["policy"]: row["outcome"] for row in rows_of(tmp_path / "out")}
    assert outcomes == {"my.py:Dodge": "arrival", "waypoints": "collision"}


def test_the_python_of_the_docs_runs(tmp_path):
    done = subprocess.run([sys.executable, "-c", blocks()[1]], cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


# --- careless input --------------------------------------------------------------------------------------------------
CARELESS = {
    "no such suite": (["--suite", "imazzu"], "did you mean 'imazu'"),
    "no such policy": (["--policy", "avoyd"], "did you mean 'avoid'"),
    "no such file": (["--policy", "my.py:Class"], "my.py: no such file"),
    "no such module": (["--policy", "nowhere:Class"], "no module named 'nowhere'"),
    "no seeds": (["--seeds", "0"], "expected at least 1"),
    "no probability": (["--accept", "3"], "expected a probability between 0 and 1"),
    "no such case": (["--only", "octagonn"], "did you mean 'octagon'"),
    "no such seed": (["--only", "octagon:first"], "a whole number as seed"),
    "no such key": (["--set", "weather.wind.sped=3"], "weather.wind.sped"),
    "no such parameters": (["--profile", "hagen"], "did you mean 'hagen2023'"),
    "blind": (["--policy", "thrust-log"], "no controller"),
    "twice": (["--policy", "avoid", "--policy", "avoid"], "none twice"),
    "into a file": (["--out", "taken"], "is a file"),
}


@pytest.mark.parametrize("case", CARELESS)
def test_careless_input_gets_one_line_and_leaves_nothing(tmp_path, case, monkeypatch, capsys):
    arguments, words = CARELESS[case]
    (tmp_path / "taken").touch()
    before = ["--suite", "octagon"] if "--suite" not in arguments else []
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "argv", ["usv-gym", "evaluate", *before, *arguments])
    monkeypatch.setattr(sys, "path", [*sys.path])
    with pytest.raises(SystemExit) as end:
        main()
    said = capsys.readouterr().err
    assert end.value.code == 2
    assert said.count("\n") == 1
    assert words in said
    assert [path.name for path in tmp_path.iterdir()] == ["taken"]


def test_the_gate_refuses_what_it_cannot_compare(tmp_path):
    done = cli("compare", tmp_path, tmp_path)
    assert (done.returncode, done.stderr.count("\n")) == (2, 1)
    assert "holds no campaign" in done.stderr


def test_a_failed_episode_shows_in_the_exit_code_and_in_the_report(tmp_path):
    done = cli("evaluate", "--suite", "calm_crossing", "--policy", BAD + "Raises", "--policy", "avoid", "--seeds", "1",
               "--set", "simulation.duration=20", "--out", tmp_path / "out", "--workers", "0")  # fmt: skip
    assert done.returncode == 1, done.stderr
    assert "1 failed: act() at step 3" in done.stdout
    assert "raised ValueError: lost my map" in (tmp_path / "out" / "report.html").read_text()


def test_write_results_of_nothing_flown_says_so(tmp_path):
    campaign = plan_campaign("calm_crossing", [BAD + "NaN"], seeds=1, overrides=SHORT)
    rows, summary = write_results(fly(campaign, tmp_path, workers=0))
    assert rows[0]["outcome"] == "failed"
    assert claim(summary["policies"][BAD + "NaN"]) == "no episode was flown to its end"
