"""Events and failures: each happens when it should, changes what it should, and nothing else (docs/events.md)."""

from __future__ import annotations

import numpy as np
import pytest
from sensor_helpers import V, advance, by_source, sea, watch

from usv_gym.config import ConfigError
from usv_gym.envs.core import Core
from usv_gym.replay.archive import load, save
from usv_gym.replay.outputs import print_summary, summary
from usv_gym.run import plan, resimulate, run
from usv_gym.scenarios.build import build_worlds
from usv_gym.scenarios.events import PRECIPITATION
from usv_gym.scenarios.families.failures import KINDS
from usv_gym.scenarios.loader import load_scenario
from usv_gym.tasks.task import TaskConfig
from usv_gym.world.state import EVENTS, RADAR

FERRY = {"class": "ship", "length": 60, "speed": 4.0, "waypoints": [[150, -100], [150, 900]], "ais": "A"}
TUG = {"class": "boat", "speed": 3.0, "waypoints": [[250, 200], [250, -600]], "ais": "B"}
SEA = {
    "own_ship": {"speed": 3.0, "route": [[900, 0]]},
    "ships": {"ferry": FERRY, "tug": TUG},
    "obstacles": {"berg": {"position": [60, 40], "radius": 8}},
    "sensors": {"base": "thesis", "radar": {"range_min": 10}},
}
WHEN = {"at": 10, "duration": 15}

#: what is compared: outputs by name; those of radar and LiDAR are relative to the own ship as it believes to be
OUTPUTS = (
    "vessels.eta", "vessels.nu", "vessels.velocity", "obstacles.position", "plants.command", "plants.n", "plants.alpha",
    "ais.position", "ais.sequence", "ais.received", "nav.position", "nav.sog", "nav.course", "nav.heading",
    "nav.mru_heading", "nav.yaw_rate", "nav.specific_force", "nav.water_speed", "tracks.filters.measured", "tracks.measured_us",
)  # fmt: skip


def sail(events, seconds=40.0, **keys):
    """Outputs of a sea with these events, open loop, second by second."""
    worlds, _ = sea(**{**SEA, **keys}, events=events)
    worlds["plants"]["command"][:, 0, :2, 0] = 0.3
    worlds["plants"]["command"][:, 0, :2, 1:] = 0.1, 1.0
    outputs = dict(zip(OUTPUTS, watch(worlds, seconds, 1.0, *OUTPUTS), strict=True))
    measured = by_source(outputs.pop("tracks.filters.measured"))[:, 0, 0]  # [T, 2, S, 4]
    stamp = outputs.pop("tracks.measured_us")[:, 0, 0]
    for k, sensor in enumerate(("radar", "lidar")):
        # of the real sources: phantoms are compared by themselves
        outputs[f"{sensor}.when"] = stamp[:, k, : V + 6]
        fresh = stamp[:, k, : V + 6] == 1_000_000 * np.arange(1, len(stamp) + 1)[:, None]  # own position is of now
        relative = measured[:, k, : V + 6, :2] - outputs["nav.position"][:, 0, 0][:, None]
        outputs[sensor] = np.where(fresh[..., None], relative, 0.0)
    return outputs


@pytest.fixture(scope="module")
def fine():
    """The same sea without a failure, and with room for false targets (which must not matter)."""
    return sail([])


MOTION = {name for name in OUTPUTS if name.startswith(("vessels", "nav"))} | {
    "radar", "lidar", "radar.when", "lidar.when", "ais.position"}  # fmt: skip
GNSS = {"nav.position", "nav.sog", "nav.course", "nav.heading"}
SCAN = {"radar", "radar.when"}, {"lidar", "lidar.when"}
#: failure -> what it may change; everything else is the same, bit for bit
CHANGES = [
    ({"action": "ais_silent", "target": "ferry"}, {"ais.position", "ais.sequence", "ais.received"}),
    ({"action": "ais_spoofed", "target": "ferry", "offset": [300, 0], "rate": [0, 2]}, {"ais.position"}),
    ({"action": "ais_jammed"}, {"ais.received"}),
    ({"action": "gnss_frozen"}, GNSS),
    ({"action": "gnss_drifting", "rate": [1.0, -1.0]}, {"nav.position"}),
    ({"action": "radar_outage"}, SCAN[0]),
    ({"action": "lidar_outage"}, SCAN[1]),
    ({"action": "rain"}, SCAN[0] | SCAN[1]),
    ({"action": "fog"}, SCAN[0] | SCAN[1]),
    ({"action": "snow", "intensity": 0.7}, SCAN[0] | SCAN[1]),
    ({"action": "jet_stuck"}, MOTION | {"plants.n"}),
    ({"action": "nozzle_stuck"}, MOTION | {"plants.alpha"}),
    ({"action": "reduced_thrust", "thruster": "port jet", "left": 0.2}, MOTION),
]


@pytest.mark.parametrize(("event", "changed"), CHANGES, ids=[event["action"] for event, _ in CHANGES])
def test_a_failure_changes_what_it_should_and_nothing_else(fine, event, changed):
    failed = sail([WHEN | event])
    for name, values in fine.items():
        other = failed[name]
        if name in ("radar", "lidar") and name not in changed:
            np.testing.assert_allclose(other, values, atol=1e-6)  # a difference of two positions
        elif name not in changed:
            assert other.tobytes() == values.tobytes(), name
        # before it begins, nothing has changed
        np.testing.assert_allclose(other[:9], values[:9], atol=1e-6, err_msg=name)
    if not event["action"].endswith("stuck"):  # the command is the same, and what is stuck is nearly there
        assert any(not np.array_equal(failed[name][10:25], fine[name][10:25]) for name in changed)
    if event["action"] in ("gnss_frozen", "gnss_drifting", "radar_outage", "ais_jammed", "lidar_outage"):
        # and after it all is well; the bias of a sensor that paused has gone another way
        later = {name: failed[name][-1] for name in changed - {"ais.received", "radar", "lidar"}}
        for name, values in later.items():
            np.testing.assert_allclose(values, fine[name][-1], atol=1e-6, err_msg=name)
    if "target" in event:  # of that ship only
        for name, axis in (("ais.position", 2), ("ais.sequence", 2), ("ais.received", 3)):
            assert np.delete(failed[name], 1, axis).tobytes() == np.delete(fine[name], 1, axis).tobytes(), name


@pytest.mark.parametrize(("action", "part"), [("jet_stuck", "n"), ("nozzle_stuck", "alpha")])
def test_what_is_stuck_stays_where_it_is_when_asked_to_move(action, part):
    worlds, _ = sea(**SEA, events=[WHEN | {"action": action, "thruster": "port jet"}])
    worlds["plants"]["command"][:, 0, :2] = 0.3
    advance(worlds, 20)
    before = worlds["plants"][part][0, 0].copy()
    worlds["plants"]["command"][:, 0, :2] = -0.8
    advance(worlds, 4)
    after = worlds["plants"][part][0, 0]
    assert after[1] == before[1]
    assert after[0] != before[0]  # the other one moves
    advance(worlds, 10)
    assert worlds["plants"][part][0, 0, 1] != before[1]


def test_a_frozen_gnss_holds_and_a_drifting_one_is_off_by_its_rate():
    held = sail([WHEN | {"action": "gnss_frozen"}])["nav.position"][:, 0, 0]
    assert (held[10:24] == held[10]).all()
    fine = sail([])["nav.position"][:, 0, 0]
    off = sail([WHEN | {"action": "gnss_drifting", "offset": [5, 0], "rate": [1.0, -2.0]}])["nav.position"][:, 0, 0] - fine
    seconds = np.arange(0, 15)
    np.testing.assert_allclose(off[9:24], np.stack([5.0 + seconds, -2.0 * seconds], axis=1), atol=0.2)


# --- AIS -------------------------------------------------------------------------------------------------------------
def targets(worlds, source):
    """Whether a source is a target, by AIS (1) and radar (2), and where."""
    picture = worlds["picture"][0]
    return picture["id"][0, source] > 0, int(picture["sensors"][0, source]) & 3, picture["position"][0, source].copy()


def test_a_spoofed_station_is_a_target_of_its_own_and_the_ship_stays_on_the_radar():
    worlds, names = sea(**SEA, events=[WHEN | {"action": "ais_spoofed", "target": "ferry", "offset": [300, 50]}])
    ghost = names.index("spoofed_ferry")
    advance(worlds, 9)
    assert targets(worlds, 1)[:2] == (True, 0b011)
    assert not targets(worlds, ghost)[0]
    advance(worlds, 11)
    assert targets(worlds, 1)[:2] == (True, 0b010)
    there, sensors, place = targets(worlds, ghost)
    assert (there, sensors) == (True, 0b001)
    np.testing.assert_allclose(place, worlds["vessels"]["eta"][0, 1, :2] + [300, 50], atol=25)
    advance(worlds, 12)
    assert targets(worlds, 1)[:2] == (True, 0b011)
    assert not targets(worlds, ghost)[0]


def test_under_another_mmsi_the_true_target_times_out_by_itself():
    event = {"action": "ais_spoofed", "target": "ferry", "offset": [300, 0], "mmsi": 211_000_000}
    worlds, names = sea(**SEA, events=[WHEN | event])
    advance(worlds, 13)
    assert targets(worlds, 1)[1] & 1  # not yet
    advance(worlds, 7)
    assert targets(worlds, 1)[:2] == (True, 0b010)
    assert worlds["obstacles"]["mmsi"][0, names.index("spoofed_ferry") - V] == 211_000_000


# --- triggers --------------------------------------------------------------------------------------------------------
def began(worlds, i=0):
    """Time [s] at which event i began; NaN if it has not."""
    table = worlds["events"][0]
    return float(table["began"][i] * worlds["dt"][0]) if table["state"][i] else np.nan


def test_triggers_fire_when_their_condition_becomes_true():
    ships = {"a": {"class": "boat", "speed": 5.0, "waypoints": [[1000, 0], [-3000, 0]], "ais": "off"}}
    worlds, _ = sea(own_velocity=(5.0, 0.0), ships=ships, events=[
        {"when": {"target": "a", "nearer_than": 600}, "action": "radar_outage"},  # closing at 10 m/s from 1000 m
        {"when": {"target": "a", "tcpa_below": 30}, "action": "lidar_outage"},
        {"when": {"point": [200, 0], "nearer_than": 50}, "action": "ais_jammed"},
        {"when": {"target": "a", "point": [0, 0], "nearer_than": 500}, "action": "gnss_frozen"},
        {"when": {"target": "a", "nearer_than": 10}, "action": "gnss_drifting"},
        {"at": 12.34, "action": "fog"},
    ])  # fmt: skip
    advance(worlds, 102)
    expected = [40.0, 70.0, 30.0, 100.0, 99.0, 12.35]
    np.testing.assert_allclose([began(worlds, i) for i in range(6)], expected, atol=0.11)


def test_what_is_not_there_triggers_nothing():
    worlds, _ = sea(**SEA, events=[{"at": 20, "action": "spawn", "target": "tug"},
                                   {"when": {"target": "tug", "nearer_than": 5000}, "action": "radar_outage"}])  # fmt: skip
    advance(worlds, 30)
    assert (began(worlds, 0), began(worlds, 1)) == (20.0, 20.0)


# --- events on top of each other -------------------------------------------------------------------------------------
def test_events_on_the_same_thing_act_together_and_leave_it_as_it_was():
    def half(at, duration, thruster):
        return {"at": at, "duration": duration, "action": "reduced_thrust", "left": 0.5, "thruster": thruster}

    worlds, _ = sea(**SEA, events=[half(2, 8, "port jet"), half(5, 10, "all"), half(8, 20, "port jet")])
    seen = watch(worlds, 30, 1.0, "plants.thrust_left")[0][:, 0, 0, :2]
    np.testing.assert_array_equal(seen[[0, 2, 5, 8, 10, 16, 29], 1], [1, 0.5, 0.25, 0.125, 0.25, 0.5, 1])
    np.testing.assert_array_equal(seen[[0, 2, 5, 8, 10, 16, 29], 0], [1, 1, 0.5, 0.5, 0.5, 1, 1])


# --- ships -----------------------------------------------------------------------------------------------------------
def test_a_ship_changes_course_and_speed_and_returns_to_its_route():
    worlds, _ = sea(**SEA, events=[
        {"at": 5, "duration": 60, "action": "change_course", "target": "ferry", "by_deg": 60},
        {"at": 5, "duration": 200, "action": "change_speed", "target": "tug", "speed": 1.0},
    ])  # fmt: skip
    advance(worlds, 64)
    v = worlds["vessels"][0]
    assert np.degrees(v["eta"][1, 2]) == pytest.approx(150.0, abs=6.0)
    assert v["nu"][2, 0] == 1.0
    advance(worlds, 100)
    assert np.degrees(v["eta"][1, 2]) < 80.0  # back to its waypoint
    advance(worlds, 50)
    assert v["nu"][2, 0] == 3.0


def test_a_ship_appears_and_is_gone():
    worlds, _ = sea(**SEA, events=[{"at": 10, "duration": 20, "action": "spawn", "target": "tug"},
                                   {"at": 25, "action": "delete", "target": "berg"}])  # fmt: skip
    active, ids, sent = watch(worlds, 45, 1.0, "vessels.active", "picture.id", "ais.sequence")
    assert active[:, 0, 2].tolist() == [0] * 9 + [1] * 20 + [0] * 16
    assert not ids[:10, 0, 0, 2].any()
    assert ids[14:28, 0, 0, 2].all()
    assert not ids[-1, 0, 0, 2]
    assert sent[-1, 0, 2] > 3
    assert ids[20, 0, 0, V] > 0
    assert not ids[-1, 0, 0, V]


# --- rain ------------------------------------------------------------------------------------------------------------
def test_false_alarms_come_at_their_rate_in_range_and_go_again():
    B, seconds = 8, 200
    keys = SEA | {"ships": {}, "obstacles": {}, "sensors": {"base": "thesis", "radar": {"false_alarms": 0.4}}}
    worlds, names = sea(B, **keys)
    phantoms = [s for s, name in enumerate(names) if name.startswith("radar_false")]
    assert len(phantoms) == 6
    ids, phase = watch(worlds, seconds, 0.05, "tracks.id", "tracks.phase")
    own = worlds["nav"]["position"][:, 0]
    born = 0
    for s in phantoms:
        alive = phase[:, :, 0, RADAR, s] > 0
        born += int((~alive[:-1] & alive[1:]).sum())
    scans = B * seconds / 1.25
    assert 0.3 < born / scans < 0.45  # slots that are held cannot take another
    measured = by_source(worlds["tracks"]["filters"]["measured"])[:, 0, 0, phantoms]
    assert (np.hypot(*np.moveaxis(measured[..., :2] - own[:, None], -1, 0)) < 1852.0 + 100.0).all()
    targets = ids[:, :, 0, phantoms] > 0
    assert targets.any(axis=(0, 1)).all()
    assert 0.05 < targets.mean() < 0.6
    assert not worlds["obstacles"]["active"].any()
    lidar = [s for s, name in enumerate(names) if name.startswith("lidar_false")]
    assert not ids[:, :, 0, lidar].any()
    # every target of theirs dies: an id is never held for long
    series = np.moveaxis(ids[:, :, 0, phantoms], 0, -1).reshape(-1, len(ids))
    for one in series:
        starts = np.flatnonzero(np.diff(one, prepend=-1))
        lengths = np.diff(starts, append=len(one)) * 0.05
        assert lengths[one[starts] > 0].max() < 30.0


def test_rain_from_the_start_is_as_rain_that_begins():
    falling, _ = build_worlds(load_scenario({"weather": {"rain": 0.5, "visibility": {"radar_range": 0.8}}}))
    weather = falling[0]["weather"]
    radar, lidar, detection, radar_false, lidar_false = PRECIPITATION["rain"]
    assert weather["radar_range_factor"] == pytest.approx(0.8 * (1 - 0.5 * (1 - radar)))
    assert weather["lidar_range_factor"] == pytest.approx(1 - 0.5 * (1 - lidar))
    assert weather["detection_factor"] == pytest.approx(1 - 0.5 * (1 - detection))
    assert (weather["radar_clutter"], weather["lidar_clutter"]) == pytest.approx((0.5 * radar_false, 0.5 * lidar_false))
    with pytest.raises(ConfigError, match="rain, fog and snow bring false alarms"):
        Core(1, source="calm_crossing", config=TaskConfig(), weather={"rain": 1.0}).reset(
            np.ones(1, bool), [np.random.default_rng(0)]
        )


# --- runs ------------------------------------------------------------------------------------------------------------
STORM = [
    {"at": 5, "duration": 10, "action": "snow"},
    {"at": 8, "action": "ais_spoofed", "target": "coaster", "offset": [200, 0], "mmsi": 211_000_000},
    {"when": {"target": "coaster", "nearer_than": 3000}, "action": "gnss_drifting", "rate": [0.3, 0]},
    {"at": 12, "duration": 6, "action": "reduced_thrust", "left": 0.4},
    {"at": 14, "action": "change_behaviour", "target": "coaster", "behaviour": "hostile"},
]


def test_events_are_in_the_archive_and_in_the_summary_and_happen_again(tmp_path, capsys):
    scenario = load_scenario("calm_crossing").dump() | {"events": STORM}
    mission = plan(scenario, policy="avoid", overrides=["simulation.duration=40"], seed=3)
    episode = run(mission)
    save(episode, tmp_path / "episode.usv")
    archive = load(tmp_path / "episode.usv")
    told = [(e["kind"], e["text"], e["t"]) for e in archive.events if e["kind"] in EVENTS]
    assert ("snow", "begins", 5.0) in told
    assert ("snow", "ends", 15.0) in told
    assert {kind for kind, _, _ in told} == {event["action"] for event in STORM}
    assert told == sorted(told, key=lambda e: e[2])
    again = resimulate(archive)
    for name in ("eta", "nu", "nav", "detections", "ais"):
        assert getattr(again, name).tobytes() == getattr(archive, name).tobytes(), name
    assert again.events == archive.events
    result = summary(archive)
    listed = {entry["event"]: entry for entry in result["events"]}
    assert (listed["snow"]["from_s"], listed["snow"]["to_s"]) == (5.0, 15.0)
    assert (listed["ais_spoofed"]["name"], listed["ais_spoofed"]["to_s"]) == ("coaster", None)
    assert result["tdm"]["false_detections_count"] > 0
    assert 211_000_000 in archive.ais["mmsi"]
    print_summary(result)
    assert "ais spoofed" in capsys.readouterr().out


def test_failures_of_a_family_are_drawn_from_the_seed_and_grow_with_difficulty():
    def drawn(failures, difficulty, B=200):
        core = Core(B, source={"family": {"name": "open_sea", "failures": failures}}, config=TaskConfig(),
                    difficulty=difficulty)  # fmt: skip
        core._set_weather = lambda b, generator: None  # type: ignore[method-assign]
        core._run = lambda rows: -1  # type: ignore[method-assign]  (the drawing only)
        core.reset(np.ones(B, bool), [np.random.default_rng(seed) for seed in range(B)])
        return core.worlds["events"]

    table = drawn(1.0, 1.0)
    there = table["trigger"] > 0
    assert there.sum(axis=1).mean() == pytest.approx(2.4, abs=0.3)
    assert {KINDS.index(action) for action in table["action"][there]} == set(range(len(KINDS)))
    assert (table["duration"][there] > 0.0).all()
    assert np.isfinite(table["duration"][there]).all()
    assert drawn(1.0, 1.0).tobytes() == table.tobytes()
    assert (drawn(1.0, 0.0)["trigger"] > 0).sum(axis=1).mean() == pytest.approx(0.5, abs=0.15)
    assert not drawn(0.0, 1.0, 4)["trigger"].any()


# --- what cannot be --------------------------------------------------------------------------------------------------
@pytest.mark.parametrize(("event", "message"), [
    ({"at": 5, "action": "radar_outtage"}, "events.0.action: unknown action 'radar_outtage'; did you mean 'radar_outage'?"),
    ({"at": 5}, "events.0.action: required key is missing"),
    ("rain", "events.0: expected a mapping of keys, got 'rain'"),
    ({"action": "radar_outage"}, "events.0: expected one of 'at' (a time [s]) and 'when'"),
    ({"at": -5, "action": "rain"}, "events.0.at: expected a number of at least 0, got -5"),
    ({"at": 5, "action": "rain", "intensity": 3}, "events.0.intensity: expected a number of at most 1, got 3"),
    ({"at": 5, "action": "ais_silent"}, "events.0.target: required key is missing"),
    ({"at": 5, "action": "ais_silent", "target": "fery"}, "events.0.target: unknown object 'fery'; did you mean 'ferry'?"),
    ({"at": 5, "action": "spawn", "target": "own_ship"}, "events.0.target: not possible with the own ship: spawn"),
    ({"at": 5, "action": "change_speed", "target": "berg", "speed": 1}, "'berg' is an obstacle; expected a ship"),
    ({"at": 5, "action": "delete", "target": "tug", "duration": 3}, "what is deleted does not come back"),
    ({"at": 5, "action": "change_course", "target": "tug"}, "expected one of 'to_deg' and 'by_deg'"),
    ({"at": 5, "action": "nozzle_stuck", "thruster": "prt jet"}, "has no thruster 'prt jet'; did you mean 'port jet'?"),
    ({"at": 5, "action": "nozzle_stuck", "thruster": "bow thruster"}, "bow thruster has no nozzle"),
    ({"when": {"nearer_than": 5}, "action": "rain"}, "events.0.when.target: expected a ship or an obstacle"),
    ({"when": {"target": "tug"}, "action": "rain"}, "events.0.when: expected nearer_than or tcpa_below"),
])  # fmt: skip
def test_an_event_that_cannot_be_is_one_clear_line(event, message):
    with pytest.raises(ConfigError) as error:
        load_scenario(SEA | {"events": [event]})
    assert message in str(error.value)
    assert "\n" not in str(error.value)
