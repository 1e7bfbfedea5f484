"""Files of a run and the statistics in them, against numbers worked out by hand."""

import csv
import dataclasses
import io
import json

import numpy as np
import pyais
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from synthetic import ANCHORED, EPOCH_US, ICEBERG, METRES, NAMES, ORIGIN, episode, world

from usv_gym.metrics.errors import ais_errors, angle_difference, closest, hidden_intervals, statistic, tdm_errors
from usv_gym.replay.archive import AIS_REPORT
from usv_gym.replay.outputs import print_summary, summary, write_detections, write_nmea, write_summary
from usv_gym.replay.recorder import Recorder
from usv_gym.units import DEG, DEG_PER_MIN, KNOT


@pytest.fixture(scope="module")
def run():
    return episode()


@pytest.fixture(scope="module")
def numbers(run):
    return summary(run, wall_time_s=0.1)


def nothing_happened():
    recorder = Recorder()
    recorder.sample(world())
    return recorder.finish()


# --- arithmetic ------------------------------------------------------------------------------------------------------
def test_statistic_leaves_out_what_is_not_known():
    s = statistic([1.0, 3.0, np.nan])
    assert (s.count, s.mean, s.std, s.rms) == (2, 2.0, 1.0, pytest.approx(np.sqrt(5)))
    assert statistic([]).count == 0
    assert np.isnan(statistic([np.nan]).rms)


@given(hnp.arrays(float, st.integers(1, 20), elements=st.floats(-1e3, 1e3)))
def test_rms_is_bias_and_scatter_together(error):
    s = statistic(error)
    assert s.rms**2 == pytest.approx(s.mean**2 + s.std**2, abs=1e-6)


@given(st.floats(-20, 20), st.floats(-20, 20))
def test_angle_difference(a, b):
    d = float(angle_difference(a, b))
    assert -np.pi <= d < np.pi
    assert np.cos(d) == pytest.approx(np.cos(a - b), abs=1e-9)


def test_tdm_errors_by_range():
    truth = np.zeros((5, 2))
    position = np.array([[3, 4], [-3, 4], [0, 1], [0, 0], [9, 9]], float)
    near, middle, far = tdm_errors(position, truth, np.array([0, 99.9, 100, 599, 600]), (0, 100, 600, 601))
    assert (near.count, near.rms, near.bias_north, near.bias_east) == (2, pytest.approx(5), 0, 4)
    assert (middle.count, middle.rms) == (2, pytest.approx(np.sqrt(0.5)))
    assert (far.count, far.rms) == (1, pytest.approx(9 * np.sqrt(2)))
    assert np.isnan(tdm_errors(truth, truth, np.full(5, 7000.0))[0].rms)


def test_ais_errors_recover_the_variances_of_the_thesis():
    """10 m2 per axis, COG 3.5 deg2, SOG 1 kn2, ROT 4500 (deg/min)2."""
    rng = np.random.default_rng(0)
    rows = np.zeros(20000, AIS_REPORT)
    rows["cog_true"], rows["sog_true"] = 359.5 * DEG, 10 * KNOT
    std = {"north": np.sqrt(10), "east": np.sqrt(10), "cog": np.sqrt(3.5) * DEG, "heading": np.sqrt(3.5) * DEG,
           "sog": KNOT, "rot": np.sqrt(4500) * DEG_PER_MIN}  # fmt: skip
    for name, size in std.items():
        rows[name] = rows[f"{name}_true"] + rng.normal(0, size, len(rows))
    rows["cog"] %= 2 * np.pi
    for name, error in ais_errors(rows).items():
        assert error.std == pytest.approx(std[name], rel=0.03)
        assert error.mean == pytest.approx(0, abs=0.05 * std[name])
    rows["sog_true"] = 0.1  # no course to speak of
    assert ais_errors(rows)["cog"].count == 0


def test_hidden_intervals():
    t = np.arange(10.0)
    in_range = np.array([0, 1, 1, 1, 1, 1, 1, 1, 1, 1], bool)
    visible = np.array([0, 0, 1, 1, 0, 0, 0, 1, 0, 0], bool)
    assert hidden_intervals(t, in_range, visible) == [(1, 2), (4, 7), (8, 9)]
    assert hidden_intervals(t, in_range, visible, shortest=2) == [(4, 7)]
    assert hidden_intervals(t, ~in_range, visible) == [(0, 1)]
    assert hidden_intervals(t, in_range, np.ones(10, bool)) == []


def test_closest():
    t = np.array([0.0, 1, 2])
    distance = np.array([[5, np.nan, 1], [3, np.nan, 2], [4, np.nan, 3]])
    active = np.array([[1, 1, 0], [1, 1, 1], [1, 1, 1]], bool)
    smallest, when = closest(t, distance, active)
    assert smallest == pytest.approx([3, np.nan, 2], nan_ok=True)
    assert when == pytest.approx([1, np.nan, 1], nan_ok=True)


# --- summary ---------------------------------------------------------------------------------------------------------
def test_summary_of_the_run(numbers):
    assert numbers["run"]["duration_s"] == pytest.approx(30)
    assert numbers["run"]["ticks_count"] == 600
    assert numbers["run"]["real_time_factor_ratio"] == pytest.approx(300)
    assert numbers["run"]["start_utc"] == "2017-06-08T17:47:26.000Z"
    assert numbers["scenario"] == "hand-made"
    assert numbers["own_ship"]["distance_sailed_m"] == pytest.approx(150)
    assert numbers["own_ship"]["speed_mean_kn"] == pytest.approx(5 / KNOT)
    assert numbers["outcome"] == {"ended": "time"}
    assert numbers["collisions"] == []


def test_summary_of_objects(run, numbers):
    objects = {item["name"]: item for item in numbers["objects"]}
    assert set(objects) == {"support_vessel", "Ørnen", "Iceberg_1", "Buoy"}
    # the own ship ends at (150, 0), the iceberg at (203, 6)
    assert objects["Iceberg_1"]["closest_m"] == pytest.approx(np.hypot(53, 6), rel=1e-6)
    assert objects["Iceberg_1"]["closest_at_s"] == pytest.approx(30)
    assert objects["Buoy"]["closest_m"] == pytest.approx(np.hypot(150, ANCHORED[1]), rel=1e-6)
    (shadow,) = objects["Buoy"]["hidden_from_radar"]
    assert shadow["from_s"] == pytest.approx(10.05)
    assert shadow["to_s"] == pytest.approx(20.05)
    assert objects["Ørnen"]["hidden_from_radar"] == []
    sent = {name: (item["ais_sent_count"], item["ais_received_count"]) for name, item in objects.items()}
    assert sent == {"support_vessel": (3, 3), "Ørnen": (1, 1), "Iceberg_1": (0, 0), "Buoy": (3, 0)}


def test_an_outage_is_no_shadow(run):
    run.faults[:, 0] = True
    try:
        assert all(item["hidden_from_radar"] == [] for item in summary(run)["objects"])
    finally:
        run.faults[:, 0] = False


def test_summary_of_the_picture(numbers):
    tdm = numbers["tdm"]
    assert (tdm["reports_count"], tdm["detections_count"]) == (30, 30)
    bins = {b["range_from_m"]: b for b in tdm["position_error_by_range"]}
    # the iceberg comes from 200 m to 53 m: 5 m/s against 0.1 m/s, nearer than 100 m from t = 20.5 s
    assert bins[0]["count"] == 5
    assert bins[0]["rms_m"] == pytest.approx(2)
    assert bins[0]["bias_north_m"] == pytest.approx(-2)
    # the rest of the iceberg, and the ship from t = 27 s on, nearer than 300 m
    assert bins[1000]["count"] == 0
    assert bins[1000]["rms_m"] is None
    assert sum(b["count"] for b in bins.values()) == 30
    assert bins[300]["rms_m"] == pytest.approx(np.sqrt(5))
    assert tdm["radius_error"]["count"] == 15
    assert tdm["radius_error"]["bias_m"] == pytest.approx(3)
    assert tdm["course_error"]["count"] == 15
    assert tdm["course_error"]["bias_deg"] == pytest.approx(3)
    assert tdm["course_error"]["std_deg"] == pytest.approx(0, abs=1e-6)
    assert tdm["speed_error"]["rms_kn"] == pytest.approx(1)


def test_summary_of_ais(numbers):
    errors = numbers["ais"]["errors"]
    assert numbers["ais"]["messages_count"] == 7
    assert errors["north"]["count"] == 7
    assert errors["north"]["bias_m"] == pytest.approx(9 / 7)
    assert errors["east"]["bias_m"] == pytest.approx(-12 / 7)
    assert errors["rot"]["count"] == 3
    asked = {"north": ("m", 10), "cog": ("deg", 3.5), "sog": ("kn", 1), "rot": ("deg_per_min", 4500)}
    for name, (unit, variance) in asked.items():
        assert errors[name][f"design_variance_{unit}2"] == pytest.approx(variance)


def test_every_number_has_its_unit(numbers):
    units = ("_m", "_s", "_kn", "_deg", "_deg_per_min", "_count", "_ratio", "_m2", "_kn2", "_deg2", "_deg_per_min2")

    def walk(value, key):
        if isinstance(value, dict):
            for k, v in value.items():
                walk(v, k)
        elif isinstance(value, list):
            for v in value:
                walk(v, key)
        elif isinstance(value, int | float) and key not in ("seed", "source", "count"):
            assert key.endswith(units), key

    walk(numbers, "")


@pytest.mark.parametrize("make", [episode, nothing_happened])
def test_summary_is_written_and_printed(make, tmp_path):
    from rich.console import Console

    run = make()
    result = summary(run)
    write_summary(result, tmp_path / "summary.json")
    assert json.loads((tmp_path / "summary.json").read_text()) == result
    console = Console(file=io.StringIO(), width=120)
    print_summary(result, console)
    text = console.file.getvalue()
    assert "distance sailed" in text
    if make is episode:
        for word in ("Ørnen", "Iceberg_1", "10-20", "150 m", "300-600", "67.08", "rot [deg/min]", "closest [m]"):
            assert word in text, word


def test_a_collision_is_told():
    run = nothing_happened()
    run.events.append({"t": 4.0, "kind": "collision", "id": ICEBERG, "text": ""})
    run.meta["names"] = NAMES
    assert summary(run)["collisions"] == [{"t_s": 4.0, "source": ICEBERG, "name": "Iceberg_1"}]


# --- ais.nmea --------------------------------------------------------------------------------------------------------
def read_nmea(path):
    """Unix time and message of every message of a file, by pyais alone."""
    messages, parts = [], []
    for line in path.read_bytes().splitlines():
        sentence = pyais.messages.NMEASentenceFactory.produce(line)
        assert sentence.is_valid
        sentence.tag_block.init()
        assert sentence.tag_block.is_valid
        parts.append(line)
        if len(parts) == sentence.frag_cnt:
            messages.append((int(sentence.tag_block.receiver_timestamp), pyais.decode(*parts)))
            parts = []
    assert not parts
    return messages


def test_nmea(run, tmp_path):
    write_nmea(run, tmp_path / "ais.nmea")
    messages = read_nmea(tmp_path / "ais.nmea")
    start = EPOCH_US // 1_000_000
    assert [(t - start, m.msg_type) for t, m in messages] == [
        (10, 1), (10, 5), (10, 21), (20, 1), (20, 21), (30, 1), (30, 18), (30, 24), (30, 24), (30, 21),
    ]  # fmt: skip
    report = messages[0][1]
    assert report.mmsi == 257000001
    assert report.lat == pytest.approx(ORIGIN[0] + 403 / METRES[0], abs=1.5e-6)
    assert report.lon == pytest.approx(ORIGIN[1] + (-104 + 100 * KNOT) / METRES[1], abs=1.5e-6)
    assert (report.speed, report.course, report.heading, report.turn, report.second) == (10.0, 90.0, 90, 0, 36)
    assert messages[1][1].shipname == "SUPPORT_VESSEL"
    assert messages[7][1].shipname == "ORNEN"
    assert messages[2][1].name == "BUOY"
    assert messages[2][1].aid_type == 30


def test_static_messages_every_six_minutes(run, tmp_path):
    rows = np.zeros(61, AIS_REPORT)
    rows["t"], rows["source"], rows["mmsi"], rows["ais_class"] = np.arange(61) * 20.0, 1, 257000001, 1
    write_nmea(dataclasses.replace(run, ais=rows), tmp_path / "ais.nmea")
    times = [t - EPOCH_US // 1_000_000 for t, m in read_nmea(tmp_path / "ais.nmea") if m.msg_type == 5]
    assert times == [0, 360, 720, 1080]


def test_no_messages_make_an_empty_file(tmp_path):
    write_nmea(nothing_happened(), tmp_path / "ais.nmea")
    assert (tmp_path / "ais.nmea").read_bytes() == b""


# --- detections.csv --------------------------------------------------------------------------------------------------
def test_detections(run, tmp_path):
    write_detections(run, tmp_path / "detections.csv")
    rows = list(csv.DictReader((tmp_path / "detections.csv").read_text(encoding="utf-8").splitlines()))
    assert len(rows) == 30
    ship, ice = rows[:2]
    assert ship["t_s"] == "1.000"
    assert ship["utc"] == "2017-06-08T17:47:27.000Z"
    assert (ship["name"], ship["descriptor"], ship["sensors"]) == ("support_vessel", "vessel", "radar")
    assert float(ship["latitude_deg"]) == pytest.approx(ORIGIN[0] + 401 / METRES[0], abs=1e-7)
    assert (ship["cog_deg"], ship["sog_kn"], ship["radius_m"]) == ("93.00", "9.00", "")
    assert (ship["cov_nn_m2"], ship["var_cog_deg2"], ship["var_sog_kn2"]) == ("9.0000", "4.0000", "0.2500")
    assert (ice["cog_deg"], ice["motion_known"], ice["radius_m"]) == ("", "0", "18.00")


def test_an_empty_picture_has_a_header(tmp_path):
    write_detections(nothing_happened(), tmp_path / "detections.csv")
    assert (tmp_path / "detections.csv").read_text().startswith("t_s,utc,id,source,name,")
    assert len((tmp_path / "detections.csv").read_text().splitlines()) == 1
