"""AIS: when stations transmit, who receives what, and what a receiver then knows."""

from __future__ import annotations

import math

import numpy as np
import pytest
from sensor_helpers import NO_NOISE, V, advance, rms, sea, watch

from usv_gym.run import plan, run, write_outputs
from usv_gym.scenarios.commands import Commands
from usv_gym.scenarios.loader import load_scenario
from usv_gym.sensors import sentences
from usv_gym.units import DEG, KNOT
from usv_gym.world.state import AIS, PHASE_NONE

TICK = 0.05


def ship(north=500.0, east=0.0, **more):
    """A class A ship at 10 kn on its way north for ever."""
    return {
        "length": 60,
        "speed_kn": 10,
        "after_last": "continue",
        "waypoints": [[north, east], [north + 500, east]],
    } | more


def only_ais(**keys):
    """The sensors of NO_NOISE with AIS alone, and other keys of ``ais``."""
    return {"radar": {"on": False}, "lidar": {"on": False}, "ais": {"quantised": False} | keys}


# --- when stations transmit ------------------------------------------------------------------------------------------
def test_fixed_interval():
    worlds, _ = sea(200, ships={"a": ship()}, **NO_NOISE)
    (stamp,) = watch(worlds, 20.0, 2.0, "ais.stamp_us")
    stamp = stamp[:, :, 1] * 1e-6
    assert np.allclose(np.diff(stamp, axis=0), 2.0)
    # phases are uniform: 200 of them leave no eighth of the interval empty, and their mean has the spread 2 / sqrt(12 n)
    assert np.histogram(stamp[0], bins=8, range=(0, 2))[0].min() > 10
    assert stamp[0].mean() == pytest.approx(1.0, abs=4 * 2 / math.sqrt(12 * 200))


@pytest.mark.parametrize(
    ("station", "speed_kn", "turning", "interval"),
    [
        ("A", 0.0, False, 180.0),
        ("A", 10.0, False, 10.0),
        ("A", 10.0, True, 10.0 / 3.0),
        ("A", 18.0, False, 6.0),
        ("A", 18.0, True, 2.0),
        ("A", 25.0, False, 2.0),
        ("A", 25.0, True, 2.0),
        ("B", 1.5, False, 180.0),
        ("B", 10.0, False, 30.0),
        ("B", 25.0, True, 30.0),
    ],
)
def test_itu_schedule(station, speed_kn, turning, interval):
    """Table 1 of ITU-R M.1371: by class, speed and, in class A, whether the ship turns."""
    worlds, _ = sea(ships={"a": ship(speed_kn=speed_kn, ais=station)}, sensors={"ais": {"interval": "itu"}})
    v = worlds["vessels"]
    v["controlled"][0, 1] = 1
    v["turn_rate_max"][0, 1] = 0.2 * DEG  # 12 deg/min
    v["heading_set"][0, 1] = 150 * DEG if turning else 0.0  # 750 s of turn
    (stamp,) = watch(worlds, 600.0, 1.0, "ais.stamp_us")
    stamps = np.unique(stamp[:, 0, 1])
    intervals = np.diff(stamps[stamps > 0]) * 1e-6
    assert len(intervals) >= 2
    assert (np.rad2deg(v["nu"][0, 1, 2]) * 60 > 5) == turning
    # whole ticks
    assert intervals[1:] == pytest.approx(np.full(len(intervals) - 1, interval), abs=TICK)


def test_aids_to_navigation_report_every_three_minutes_whatever_the_interval_of_ships():
    buoy = {"kind": "buoy", "radius": 2, "position": [300, 300], "ais": True}
    worlds, _ = sea(obstacles={"buoy": buoy, "berg": {"radius": 5, "position": [-300, 0]}}, **NO_NOISE)
    (stamp,) = watch(worlds, 600.0, 1.0, "ais.stamp_us")
    stamps = np.unique(stamp[:, 0, V])
    assert np.allclose(np.diff(stamps[stamps > 0]), 180e6)
    assert np.isnan([worlds["ais"][name][0, V] for name in ("cog", "heading", "sog", "rot")]).all()
    assert worlds["ais"]["sequence"][0, V + 1] == 0  # the iceberg is silent


def test_only_class_a_reports_a_rate_of_turn():
    worlds, _ = sea(ships={"a": ship(), "b": ship(east=300, ais="B"), "off": ship(east=600, ais="off")}, **NO_NOISE)
    advance(worlds, 4.0)
    rot, sequence = worlds["ais"]["rot"][0], worlds["ais"]["sequence"][0]
    assert rot[1] == 0.0
    assert np.isnan(rot[2])
    assert worlds["ais"]["sog"][0, 2] == pytest.approx(10 * KNOT, abs=0.05 * KNOT)
    assert sequence[1] == sequence[2] == 2
    assert sequence[3] == 0


# --- who receives what -----------------------------------------------------------------------------------------------
def test_range():
    ships = {"near": ship(990, speed_kn=0), "far": ship(1010, speed_kn=0)}
    worlds, _ = sea(ships=ships, sensors=only_ais(range=1000))
    advance(worlds, 60.0)
    assert worlds["ais"]["sequence"][0, 1] == worlds["ais"]["sequence"][0, 2] == 30
    assert worlds["ais"]["inbox_stamp_us"][0, 0, 1] > 0
    assert worlds["ais"]["inbox_stamp_us"][0, 0, 2] == -1
    assert list(worlds["picture"]["id"][0, 0, 1:3] > 0) == [True, False]


def test_nobody_receives_himself():
    worlds, _ = sea(ships={"a": ship()}, **NO_NOISE)
    advance(worlds, 10.0)
    assert worlds["ais"]["sequence"][0, 0] == 5
    assert worlds["ais"]["inbox_stamp_us"][0, 0, 0] == -1
    assert worlds["picture"]["id"][0, 0, 0] == 0


@pytest.mark.parametrize("latency", [0.0, 1.5, 5.0])
def test_lost_messages_never_reach_the_inbox(latency):
    """What the inbox holds is always a message that was sent, whole; and the share of the lost is the one asked for."""
    B, loss = 20, 0.3
    worlds, _ = sea(B, ships={"a": ship()}, sensors={"base": "thesis", "ais": {"loss": loss, "latency": latency}})
    names = ("stamp_us", "position", "sequence", "received", "inbox_stamp_us", "inbox")
    fields = watch(worlds, 100.0, TICK, *(f"ais.{name}" for name in names))
    stamp, position, sequence = (field[:, :, 1] for field in fields[:3])
    received, inbox_stamp, inbox = (field[:, :, 0, 1] for field in fields[3:])
    delivered = 0
    for b in range(B):
        sent = {int(t): tuple(p) for t, p in zip(stamp[:, b], position[:, b], strict=True)}
        got_through = {int(t) for t, n, r in zip(stamp[:, b], sequence[:, b], received[:, b], strict=True) if n == r}
        arrived = {int(t): tuple(p[:2]) for t, p in zip(inbox_stamp[:, b], inbox[:, b], strict=True) if t >= 0}
        assert arrived.keys() <= got_through
        assert all(sent[t] == place for t, place in arrived.items())
        delivered += len(arrived)
    n = B * 50
    # the last of 50 messages may still be on its way
    assert delivered / n == pytest.approx(1.0 - loss, abs=4 * math.sqrt(loss * (1 - loss) / n) + (latency > 0) / 50)


def test_latency():
    """A message arrives later, at most by the latency asked for, and carries the time at which it was measured."""
    B, latency = 30, 1.5
    worlds, _ = sea(B, ships={"a": ship(speed_kn=30)}, sensors=only_ais(latency=latency))
    stamp, track, tick = watch(worlds, 60.0, TICK, "ais.inbox_stamp_us", "tracks.stamp_us", "tick")
    stamp, track, now = stamp[:, :, 0, 1], track[:, :, 0, AIS, 1], tick * TICK
    arrived = np.diff(stamp, axis=0) > 0
    delay = (now[1:] - stamp[1:] * 1e-6)[arrived]
    assert len(delay) >= B * 29
    assert delay.min() >= 0.0
    assert delay.max() <= latency
    # uniform: the mean has the spread latency / sqrt(12 n); ticks take off half of one on average
    assert delay.mean() == pytest.approx(latency / 2 - TICK / 2, abs=4 * latency / math.sqrt(12 * len(delay)))
    assert np.all(track[1:][arrived] == stamp[1:][arrived])


def test_the_tdm_predicts_late_messages_to_now():
    """Without errors the picture of a ship at 30 kn is exact, though its messages are up to 3.5 s (54 m) old."""
    worlds, _ = sea(30, ships={"a": ship(speed_kn=30)}, sensors=only_ais(latency=1.5))
    advance(worlds, 20.0)
    position, truth = watch(worlds, 20.0, 1.0, "picture.position", "vessels.eta")
    assert np.abs(position[:, :, 0, 1] - truth[:, :, 1, :2]).max() < 0.1


def test_latency_beyond_the_interval_ends_with_the_next_message():
    """There is room for one message under way; a later one does not overtake it, and nothing starves."""
    worlds, _ = sea(20, ships={"a": ship()}, sensors=only_ais(latency=100.0))
    (stamp,) = watch(worlds, 40.0, TICK, "ais.inbox_stamp_us")
    for stamps in stamp[:, :, 0, 1].T:
        arrived = np.unique(stamps[stamps > 0])
        assert np.all(np.diff(arrived) == 2e6)
        assert len(arrived) >= 18


# --- resolution of the wire ------------------------------------------------------------------------------------------
def test_the_kernel_rounds_like_the_sentences():
    """The same noise with and without quantisation: what the kernel rounds is what sentences.quantise_* make of it."""
    ships = {"a": ship(), "b": ship(east=300, speed_kn=0, ais="B")}
    fields = ("position", "cog", "heading", "sog", "rot")
    raw, wire = (
        dict(zip(fields, watch(worlds, 200.0, 2.0, *(f"ais.{n}" for n in fields)), strict=True))
        for worlds in (
            sea(10, ships=ships, sensors={"base": "thesis", "ais": {"quantised": quantised}})[0]
            for quantised in (False, True)
        )
    )
    scenario = load_scenario({})
    origin = (scenario.origin.latitude_deg, scenario.origin.longitude_deg)
    worlds, _ = sea()
    north, east = sentences.quantise_position(
        raw["position"][..., 0], raw["position"][..., 1], origin, worlds["metres_per_degree"][0]
    )
    expected = {
        "position": np.stack([north, east], axis=-1),
        "cog": sentences.quantise_cog(raw["cog"]),
        "heading": sentences.quantise_heading(raw["heading"]),
        "sog": sentences.quantise_sog(raw["sog"]),
        "rot": sentences.quantise_rot(raw["rot"]),
    }
    for name, values in expected.items():
        got = wire[name][:, :, 1:3]
        np.testing.assert_allclose(got, values[:, :, 1:3], rtol=0, atol=1e-8, err_msg=name)
        rounded = np.isfinite(got)
        assert rms(got[rounded] - raw[name][:, :, 1:3][rounded]) > 0.0  # there was something to round


# --- switches and faults ---------------------------------------------------------------------------------------------
def test_a_station_can_be_switched_off_and_on():
    worlds, names = sea(ships={"a": ship()}, sensors=only_ais())
    commands = Commands(worlds, 0, list(names), load_scenario({"ships": {"a": ship()}}))
    advance(worlds, 10.0)
    first = int(worlds["picture"]["id"][0, 0, 1])
    assert first > 0
    commands.set_ais("a", on=False)
    sent = int(worlds["ais"]["sequence"][0, 1])
    advance(worlds, 10.0)
    assert worlds["ais"]["sequence"][0, 1] == sent
    assert worlds["picture"]["id"][0, 0, 1] == 0
    commands.set_ais("a", on=True)
    advance(worlds, 1.0)
    assert worlds["ais"]["sequence"][0, 1] == sent + 1  # at once
    assert worlds["picture"]["id"][0, 0, 1] > first


def test_jamming_keeps_everything_out_and_radar_goes_on():
    worlds, _ = sea(ships={"a": ship()}, **NO_NOISE)
    advance(worlds, 10.0)
    id, stamp = int(worlds["picture"]["id"][0, 0, 1]), int(worlds["ais"]["inbox_stamp_us"][0, 0, 1])
    worlds["sensors"]["ais_jammed"] = 1
    advance(worlds, 20.0)
    assert worlds["ais"]["stamp_us"][0, 1] > stamp + 15e6  # it is sent
    assert worlds["ais"]["inbox_stamp_us"][0, 0, 1] == stamp  # but not heard
    assert worlds["tracks"]["phase"][0, 0, AIS, 1] == PHASE_NONE
    assert worlds["picture"]["id"][0, 0, 1] == id
    assert worlds["picture"]["sensors"][0, 0, 1] == 2  # radar
    worlds["sensors"]["ais_jammed"] = 0
    advance(worlds, 4.0)
    assert worlds["picture"]["sensors"][0, 0, 1] == 3
    assert worlds["picture"]["id"][0, 0, 1] == id


def test_ais_can_be_left_out():
    worlds, _ = sea(ships={"a": ship()}, sensors={"ais": {"on": False}})
    advance(worlds, 20.0)
    assert not worlds["ais"]["sequence"].any()
    assert worlds["picture"]["sensors"][0, 0, 1] == 2


# --- the log ---------------------------------------------------------------------------------------------------------
def test_the_log_of_a_run_has_static_data_of_every_kind_of_station(tmp_path):
    """Type 1 and 5 of ships, 18 and 24 of a boat, 21 of a lighthouse; static data again after six minutes."""
    pyais = pytest.importorskip("pyais")
    scenario = {
        "simulation": {"duration": 370.0},
        "ships": {"ferry": ship(speed_kn=1), "sloop": ship(east=200, length=8, speed_kn=1)},
        "obstacles": {"Faerder": {"kind": "lighthouse", "radius": 10, "position": [300, 300], "ais": True}},
    }
    write_outputs(run(plan(scenario, policy="idle")), tmp_path, picture=False)
    sentences_of = {}
    parts = []
    for line in (tmp_path / "ais.nmea").read_text().splitlines():
        parts.append(line.rsplit("\\", 1)[1])
        if parts[-1].split(",")[1] == parts[-1].split(",")[2]:
            message = pyais.decode(*parts)
            sentences_of.setdefault(message.msg_type, []).append(message)
            parts = []
    assert sorted(sentences_of) == [1, 5, 18, 21, 24]
    assert [m.shipname for m in sentences_of[5]].count("FERRY") == 2  # at the start and after 360 s
    assert len(sentences_of[5]) == 4  # the own ship's too
    assert [m.partno for m in sentences_of[24]] == [0, 1, 0, 1]
    assert sentences_of[24][0].shipname == "SLOOP"
    assert {m.name for m in sentences_of[21]} == {"FAERDER"}
    assert sentences_of[21][0].aid_type == 5
    assert len(sentences_of[21]) in (2, 3)  # every three minutes
    boats = {m.mmsi for m in sentences_of[18]}
    assert boats == {m.mmsi for m in sentences_of[24]}
    assert len(boats) == 1
