"""The bridge without a transport: lock-step, commands, fail-safe, orders, trouble on the way, profiles, fuzz."""

from __future__ import annotations

import math
import os
import random
import threading
import time
from pathlib import Path

import numpy as np
import pytest
from hil_helpers import Background, actuators, expected, memory_bridge, plain_env

from usv_gym.config import ConfigError
from usv_gym.hil.bridge import _Forgetful
from usv_gym.hil.fields import Stamp, decoder, encoder
from usv_gym.hil.profile import Trouble, load_profile, parse_trouble, profile_from_text
from usv_gym.run import resimulate
from usv_gym.scenarios.loader import load_scenario


# --- lock-step -------------------------------------------------------------------------------------------------------
def test_lock_step_is_the_plain_environment_bit_for_bit():
    bridge, _, seen = memory_bridge(duration=20.0)
    report = bridge.run()
    episode = bridge.voyage.finish()
    assert len(episode.actions) == report.steps == 400
    sent = np.array([expected(step) for step in range(1, 401)])
    np.testing.assert_array_equal(episode.actions, sent)  # what was decoded is what was sent
    assert plain_env(episode).tobytes() == bridge.voyage.world.tobytes()
    again = resimulate(episode)
    np.testing.assert_array_equal(again.eta, episode.eta)
    assert len(seen["hil/status"]) == 400
    assert report.failsafes == 0


def test_what_is_published_is_what_the_sensors_measured():
    bridge, _, seen = memory_bridge(duration=5.0)
    bridge.run()
    episode = bridge.voyage.finish()
    nav = {name: episode.nav[:, k] for k, name in enumerate(["stamp", "north", "east", "heading"])}
    fixes = seen["sensors/gps/gps/fix"]
    assert len(fixes) == len(episode.t)  # 20 Hz, as the tick
    origin, scale = episode.meta["origin"], episode.meta["metres_per_degree"]
    latitude = np.array([fix["latitude"] for fix in fixes])
    np.testing.assert_allclose((latitude - origin[0]) * scale[0], nav["north"], atol=1e-6)
    stamps = np.array([int(fix["header"]["stamp"]) for fix in fixes])
    np.testing.assert_allclose((stamps - episode.meta["epoch_us"] * 1000) / 1e9, episode.t, atol=1e-9)
    odometry = seen["sensors/position/odometry"][-1]["pose"]["pose"]
    yaw = 2 * math.atan2(odometry["orientation"]["z"], odometry["orientation"]["w"])
    assert math.cos(yaw - (math.pi / 2 - episode.nav[-1, 6])) == pytest.approx(1.0)  # REP-103: from the MRU's heading
    assert odometry["position"]["x"] == pytest.approx(nav["east"][-1])
    detected = [target for message in seen["sensors/targets"] for target in message["targets"]]
    np.testing.assert_array_equal([target["id"] for target in detected], episode.detections["id"])
    np.testing.assert_array_equal([target["y"] for target in detected], episode.detections["north"])
    others = [report for report in seen["sensors/ais"] if not report["own"]]
    assert len(others) == np.count_nonzero(episode.ais["received"])
    assert any(report["own"] for report in seen["sensors/ais"])


def test_truth_reaches_only_the_debug_topics():
    """Positions poisoned after the sensors fired: nothing but the operator's screens shows it."""
    bridge, _, seen = memory_bridge(duration=2.0)
    bridge.run()
    world = bridge.voyage.core.worlds[0]
    for group, name in (("vessels", "eta"), ("vessels", "nu"), ("vessels", "velocity"), ("obstacles", "position")):
        world[group][name] = math.nan
    seen.clear()
    bridge.link.publish(bridge.controller._status(), again=True)
    for topic, messages in seen.items():
        if not topic.startswith("debug/"):
            text = repr(messages).replace("'command_age': nan", "")
            assert "nan" not in text, topic


def test_a_lock_step_can_wait_less_often_than_the_world_ticks():
    bridge, _, seen = memory_bridge(duration=5.0, interval=4)
    bridge.run()
    episode = bridge.voyage.finish()
    assert len(seen["hil/status"]) == 25
    assert len(seen["sensors/imu/imu/data"]) == 101
    np.testing.assert_array_equal(episode.actions[:8], [expected(1)] * 4 + [expected(2)] * 4)
    assert plain_env(episode).tobytes() == bridge.voyage.world.tobytes()


def test_answers_to_another_step_are_refused():
    bridge, wire, _ = memory_bridge(duration=1.0, answer=False)

    def listen(topic, message):
        if topic == "hil/status":
            stamp = message["header"]["stamp"]
            wire.send("cmd/actuators", actuators(7, Stamp(stamp - 1)))
            wire.send("cmd/actuators", actuators(message["step"], stamp))

    wire.listeners.append(listen)
    report = bridge.run()
    assert report.rejected["answers another step"] == 20
    np.testing.assert_array_equal(bridge.voyage.finish().actions, [expected(step) for step in range(1, 21)])


def test_in_real_time_a_late_answer_is_taken():
    bridge, wire, _ = memory_bridge(duration=1.0, answer=False, lock_step=False)
    wire.send("cmd/actuators", actuators(7, Stamp(5)))
    report = bridge.run()
    assert "answers another step" not in report.rejected
    np.testing.assert_array_equal(bridge.voyage.finish().actions[0], expected(7))


@pytest.mark.parametrize(("control", "topic"), [("actuators", "cmd/actuators"), ("heading_speed", "cmd/heading_speed")])
def test_trouble_on_the_way_is_deterministic(control, topic):
    def fly():
        trouble = [("*", Trouble(delay=0.2, jitter=0.3, loss=0.2)), ("hil/status", Trouble())]
        bridge, wire, seen = memory_bridge(duration=4.0, answer=False, trouble=trouble, seed=3, control=control)

        def listen(name, message):
            if name == "hil/status":
                body = (
                    actuators(message["step"], message["header"]["stamp"])
                    if control == "actuators"
                    else {
                        "header": {"stamp": message["header"]["stamp"]},
                        "heading": 0.1 * message["step"],
                        "speed": 3.0,
                    }
                )
                wire.send(topic, body)

        wire.listeners.append(listen)
        report = bridge.run()
        assert report.rejected["lost on purpose"] > 50
        return bridge.voyage.finish().actions, seen["sensors/gps/gps/fix"]

    (actions, fixes), (again, fixes_again) = fly(), fly()
    np.testing.assert_array_equal(actions, again)
    assert fixes == fixes_again
    assert 50 < len(fixes) < 75  # of 81
    delays = np.diff([int(fix["header"]["stamp"]) for fix in fixes])
    assert (delays < 0).any(), "jitter larger than the interval mixes up the order"


# --- steering --------------------------------------------------------------------------------------------------------
def test_thrust_in_newton_is_what_the_jets_give():
    bridge, wire, _ = memory_bridge(duration=12.0, answer=False, lock_step=False, timeout=100.0)
    for side in ("left", "right"):
        wire.send(f"thrusters/{side}/thrust", {"data": 2000.0})
        wire.send(f"thrusters/{side}/pos", {"data": 0.0})
    bridge.run()
    world = bridge.voyage.world
    np.testing.assert_allclose(world["plants"]["tau"][0], [4000.0, 0.0, 0.0], rtol=1e-3, atol=1e-6)
    wire.send("thrusters/left/thrust", {"data": -1500.0})
    wire.send("thrusters/right/thrust", {"data": 100.0})  # less than idle gives: the bucket takes the rest
    wire.send("thrusters/right/pos", {"data": 0.2})
    while bridge.t_us < 24e6:
        bridge.step()
    tau = world["plants"]["tau"][0]
    assert tau[0] == pytest.approx(-1500.0 + 100.0 * math.cos(0.2), rel=2e-3)
    assert world["plants"]["alpha"][0, 0] == pytest.approx(-0.2, rel=1e-3)  # counter-clockwise from above


def test_heading_and_speed_are_reached():
    bridge, wire, _ = memory_bridge(duration=60.0, answer=False, lock_step=False, timeout=1e3, control="heading_speed")
    wire.send("cmd/heading_speed", {"header": {"stamp": Stamp(0)}, "heading": -2.5, "speed": 4.0})
    bridge.run()
    eta, nu = bridge.voyage.world["vessels"]["eta"][0], bridge.voyage.world["vessels"]["nu"][0]
    assert math.cos(eta[2] + 2.5) > math.cos(math.radians(2.0))
    assert nu[0] == pytest.approx(4.0, abs=0.1)


# --- fail-safe -------------------------------------------------------------------------------------------------------
@pytest.mark.parametrize("fail_safe", ["zero", "hold"])
def test_a_silent_controller_trips_the_fail_safe_and_gets_control_back(fail_safe):
    bridge, wire, seen = memory_bridge(duration=30.0, answer=False, lock_step=False, fail_safe=fail_safe)
    for step in range(400):
        if step < 100 or step >= 300:
            wire.send("cmd/actuators", actuators(5, Stamp(0)))
        bridge.step()
    actions = bridge.voyage.finish().actions
    assert (actions[:100] == expected(5)).all()
    assert (actions[100:119] == expected(5)).all()  # within the second that is allowed
    assert (actions[122:300] == (0.0 if fail_safe == "zero" else np.array(expected(5)))).all()
    assert (actions[300:] == expected(5)).all()
    assert [notice["kind"] for notice in seen["hil/notice"]] == ["failsafe_on", "failsafe_off"]
    at = int(seen["hil/notice"][0]["header"]["stamp"]) / 1e9 - bridge.voyage.world["epoch_us"] / 1e6
    assert 5.95 < at < 6.15  # 1 s after the last command, at 4.95 s


def test_a_lock_step_goes_on_with_the_fail_safe_when_nobody_answers():
    bridge, wire, _ = memory_bridge(duration=3.0, answer=False, timeout=0.05, patience=0.2)
    alive = {"on": True}

    def listen(topic, message):
        if topic == "hil/status" and alive["on"]:
            wire.send("cmd/actuators", actuators(message["step"], message["header"]["stamp"]))
            alive["on"] = not 10 <= message["step"] < 20
        elif topic == "hil/status":
            alive["on"] = message["step"] > 30

    wire.listeners.append(listen)
    report = bridge.run()
    actions = bridge.voyage.finish().actions
    assert report.failsafes == 1
    assert (actions[11:30] == 0.0).all()
    np.testing.assert_array_equal(actions[35], expected(36))


def test_a_policy_says_so_when_no_controller_answers():
    bridge, _, _ = memory_bridge(answer=False, patience=0.1, must_answer=True)
    with pytest.raises(ConfigError, match=r"no command within 0\.1 s: is the controller running"):
        bridge.run()


# --- orders ----------------------------------------------------------------------------------------------------------
def test_spawn_delete_pause_reset_over_the_wire():
    bridge, wire, seen = memory_bridge(duration=1e6, bridge={"realtime": 20.0}, lock_step=False, timeout=1e5)
    origin = load_scenario("calm_crossing").origin
    order = {"command": "spawn", "id": "berg", "latitude": origin.latitude_deg + 0.001, "longitude": origin.longitude_deg,
             "radius": 12.0, "arguments": ""}  # fmt: skip
    running = Background(bridge)

    def tell(**what):
        wire.send("hil/command", {**order, **what})

    def wait_for(kind):
        until = time.monotonic() + 20
        while kind not in [notice["kind"] for notice in seen.get("hil/notice", [])]:
            assert time.monotonic() < until, (kind, seen.get("hil/notice"))
            time.sleep(0.01)

    tell()
    wait_for("spawned")
    assert "berg" in bridge.voyage.commands.names
    tell(id="ferry", command="spawn", arguments='{"waypoints": [[0, 300], [0, -300]], "length": 60, "speed": 5}')
    tell(command="delete")
    wait_for("removed")
    assert "ferry" in bridge.voyage.commands.names
    tell(command="move", id="own_ship")
    wait_for("moved")
    for wrong in ({"command": "explode"}, {"command": "delete", "id": "nobody"}, {"arguments": "[1"}, {"arguments": "[1]"},
                  {"latitude": 1e9}, {"command": "reset", "arguments": '{"seed": -1}'}):  # fmt: skip
        tell(**wrong)
    wait_for("refused")
    tell(command="pause")
    wait_for("paused")
    time.sleep(0.1)
    t = bridge.t_us
    time.sleep(0.2)
    assert bridge.t_us == t
    tell(command="resume")
    wait_for("resumed")
    tell(command="reset", arguments='{"seed": 5}')
    wait_for("reset")
    assert bridge.mission.seed == 5
    assert bridge.resets == 1
    tell(command="stop")
    report = running.join()
    assert report.rejected["order refused"] >= 6
    refusals = " ".join(notice["text"] for notice in seen["hil/notice"] if notice["kind"] == "refused")
    assert "unknown command 'explode'" in refusals


def test_the_original_spawns_20_m_and_pauses_by_its_own_messages():
    bridge, wire, _ = memory_bridge(profile="hilsim", answer=False, lock_step=False, timeout=1e3)
    for x in (10.4717, 10.4750):
        wire.send("/simObject/command", {"cmdSpecifier": "spawn", "receiverID": "", "x": x, "y": 59.44, "psi": 90.0})
    bridge.step()
    names = bridge.voyage.commands.names
    assert {"spawned_1", "spawned_2"} <= set(names)
    obstacles = bridge.voyage.world["obstacles"]
    slot = names.index("spawned_1") - len(bridge.voyage.world["vessels"]["active"])
    assert obstacles["radius"][slot] == 20.0
    wire.send("input/environment_communication", {"paused": True})
    bridge._obey(0.0)
    assert bridge.paused


# --- own ship elsewhere ----------------------------------------------------------------------------------------------
def test_the_own_ship_can_be_another_simulator():
    """Its pose comes over the wire; AIS and targets are seen from there."""
    bridge, wire, seen = memory_bridge(duration=1e6, answer=False, lock_step=False, timeout=1e6, external=True,
                                       bridge={"own_ship": "external"})  # fmt: skip
    for step in range(400):
        psi = math.radians(40.0)
        north, east = 2.0 * step * 0.05 * math.cos(psi) - 200.0, 2.0 * step * 0.05 * math.sin(psi)
        yaw = math.pi / 2 - psi
        if step % 4 == 0:
            turned = {"z": math.sin(yaw / 2), "w": math.cos(yaw / 2)}
            wire.send("external/odometry", {
                "pose": {"pose": {"position": {"x": east, "y": north}, "orientation": turned}},
                "twist": {"twist": {"linear": {"x": 2.0}, "angular": {"z": 0.0}}},
            })  # fmt: skip
        bridge.step()
    eta = bridge.voyage.world["vessels"]["eta"][0]
    np.testing.assert_allclose(eta, [2.0 * 20 * math.cos(psi) - 200.0, 2.0 * 20 * math.sin(psi), psi], atol=0.02)
    own = [report for report in seen["sensors/ais"] if report["own"]]
    assert own
    assert abs(own[-1]["sog"] - 2.0) < 2.0
    assert len(seen["sensors/targets"][-1]["targets"]) >= 3


def test_dynamics_without_surroundings():
    bridge, _, seen = memory_bridge(duration=3.0, bridge={"own_ship": "only"})
    bridge.run()
    assert "sensors/ais" not in seen
    assert all(not message["targets"] for message in seen.get("sensors/targets", []))
    assert len(seen["sensors/gps/gps/fix"]) == 61


# --- real time -------------------------------------------------------------------------------------------------------
def test_real_time_keeps_its_schedule():
    factor = 5.0
    bridge, _, seen = memory_bridge(
        duration=10.0, lock_step=False, bridge={"realtime": factor}, overrides=["simulation.dt=0.02"]
    )
    report = bridge.run()
    print("\n".join(report.lines()))
    assert report.slips == 0
    assert report.factor == pytest.approx(factor, rel=0.05)
    assert len(seen["/clock"]) == 501


def test_topics_faster_than_a_transport_are_thinned_and_that_is_said():
    class Slow:
        name, max_rate = "slow", 200.0

    from usv_gym.hil.link import Link

    link = Link(load_profile("standard"), [Slow()], factor=20.0)
    assert any("sensors/position/odometry: 20 Hz at 20 times real time: sent at 10 Hz" in note for note in link.notes)
    assert all(out.rate <= 10.0 for out in link.out if out.rate)
    assert any("sensors/imu/imu/data" in note and note.endswith("at most 10 Hz") for note in link.notes)


# --- profiles --------------------------------------------------------------------------------------------------------
def test_a_team_writes_its_own_protocol_without_code():
    text = """
control: demand
rows:
  - topic: odin/nav
    signal: odometry
    type: odin_msgs/Navigation
    rate: 10
    fields: {pos: {lat_udeg: "latitude", hdg: "heading [deg] round"}, v_kn: "surge [kn]", flag: 3, who: =sim}
  - topic: odin/ctrl
    direction: in
    command: demand
    type: odin_msgs/Control
    fields: {throttle_pct: "surge [%]", rudder_pct: "yaw [%]", mode: =AUTO}
"""
    from usv_gym.hil.backends import make_backend
    from usv_gym.hil.bridge import Bridge, plan_hil
    from usv_gym.hil.external import ExternalController
    from usv_gym.hil.link import Link

    wire = make_backend("memory")
    link = Link(profile_from_text(text), [wire])
    seen = []
    wire.listeners.append(lambda topic, message: seen.append(message))
    link.open()
    bridge = Bridge(
        plan_hil("calm_crossing", duration=1.0), link, ExternalController(link, lock_step=False), record=True
    )
    wire.send("odin/ctrl", {"throttle_pct": 50.0, "rudder_pct": -25.0, "mode": "MANUAL"})
    wire.send("odin/ctrl", {"throttle_pct": 50.0, "rudder_pct": -25.0, "mode": "AUTO"})
    report = bridge.run()
    assert (bridge.voyage.finish().actions == [0.5, -0.25]).all()
    assert report.rejected["not for us"] == 1
    knots = pytest.approx(3 / 0.514444, rel=1e-5)
    assert seen[0] == {
        "pos": {"lat_udeg": pytest.approx(59.4377744), "hdg": 0.0},
        "v_kn": knots,
        "flag": 3,
        "who": "sim",
    }
    assert len(seen) == 11


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ("rows.0.signal=gnns", "unknown signal 'gnns'; did you mean 'gnss'?"),
        ("rows.0.fields.latitude=lattitude", "unknown name 'lattitude'; did you mean 'latitude'?"),
        ("rows.0.fields.latitude='latitude [knots]'", "unknown unit 'knots'"),
        ("rows.0.fields.latitude='a b c'", "expected `name [unit]`"),
        ("rows.0.rate=-1", "expected a number greater than 0"),
        ("rows.0.topik=x", "unknown key; did you mean 'topic'?"),
        ("rows.0.topic='a b'", "expected a name without spaces"),
    ],
)
def test_a_wrong_profile_says_where_and_what(change, message):
    with pytest.raises(ConfigError) as error:
        load_profile("standard", [change])
    assert message in str(error.value)
    assert "rows.0" in str(error.value)


def test_fields_go_both_ways():
    spec = {"a": "speed [kn]", "b": ["heading [deg]", "=x", 3], "c": {"d": "id"}}
    message = encoder(spec, "f")({"speed": 5.0, "heading": 1.0, "id": "n"})
    assert message["b"][1:] == ["x", 3]
    values = decoder(spec, "f")(message)
    assert values["speed"] == pytest.approx(5.0)
    assert values["heading"] == pytest.approx(1.0)
    assert values["id"] == "n"


@pytest.mark.parametrize("text", ["a", "a:b", "a:delay=x", ":delay=1", "a:delay=-1", "a:dely=1", "a:loss=2"])
def test_wrong_trouble_is_refused(text):
    with pytest.raises(ConfigError):
        parse_trouble(text)


# --- fuzz ------------------------------------------------------------------------------------------------------------
def junk(draw, kind):
    """Something that is hardly ever a command."""
    if kind == 0:
        return draw.choice([None, "", 7, -1.5, [], {}, "x" * 1000, b"\x00\xff"])
    if kind == 1:
        return {
            "header": {"stamp": draw.choice([Stamp(0), "no", None, math.nan])},
            "rpm": [draw.choice([math.nan, math.inf, -math.inf, "a"])] * 4,
        }
    if kind == 2:
        return {"data": draw.choice([math.nan, math.inf, 1e308, -1e308, "text", None, [1.0], True])}
    if kind == 3:
        return {draw.choice("abc"): {draw.choice("abc"): [{}] * draw.randrange(50)}}
    if kind == 4:
        return {"command": draw.choice(["spawn", "reset", "\x00", "move", "x" * 500, 5]),
                "id": draw.choice(["", "own_ship", 3, None]), "latitude": draw.uniform(-1e6, 1e6),
                "longitude": draw.choice([10.0, math.nan]), "radius": draw.uniform(-10, 10),
                "arguments": draw.choice(["", "{", "[]", "{}", '{"waypoints": 5}', '{"seed": 1e99}', "\ud800"])}  # fmt: skip
    if kind == 5:
        return actuators(draw.randrange(100), Stamp(draw.randrange(1 << 62)))
    if kind == 6:
        return {"latitude": draw.uniform(-1e9, 1e9), "longitude": draw.uniform(-1e9, 1e9)}
    if kind == 7:
        return {"pose": {"pose": {"position": {"x": 1e300, "y": -1e300}, "orientation": {"z": 0.0, "w": 0.0}}},
                "twist": {"twist": {"linear": {"x": 1e300}, "angular": {"z": 1e300}}}}  # fmt: skip
    return draw.random()


#: topics that a kind of junk is meant for
AIMED = {
    1: "cmd/actuators",
    2: "thrusters/left/thrust",
    4: "hil/command",
    5: "cmd/actuators",
    6: "external/fix",
    7: "external/odometry",
}


def test_100_000_fuzzed_messages_neither_stop_nor_swell_the_bridge():
    bridge, wire, _ = memory_bridge(
        duration=1e6, answer=False, lock_step=False, external=True, bridge={"own_ship": "external"}
    )
    wire.listeners.clear()
    bridge.voyage.recorder = _Forgetful()
    bridge.record = False
    draw = random.Random(1)
    topics = [row.topic for row in bridge.link.incoming]
    sent = 100_000

    def flood():
        for _ in range(sent):
            kind = draw.randrange(9)
            wire.send(
                AIMED.get(kind) if kind in AIMED and draw.random() < 0.8 else draw.choice(topics), junk(draw, kind)
            )

    thread = threading.Thread(target=flood)
    thread.start()
    steps, before = 0, 0
    while thread.is_alive() or steps < 50:
        bridge.step()
        bridge.stopped = bridge.paused = False  # some of the orders were good ones
        steps += 1
        before = before or (resident() if steps == 20 else 0)
    thread.join()
    accepted = sum(bridge.link.received.values())
    refused = sum(bridge.link.counters[reason] for reason in bridge.link.counters if reason not in AFTERWARDS)
    assert accepted + refused == sent
    assert refused > sent / 3
    assert accepted > sent / 10
    assert resident() - before < 30e6
    assert np.isfinite(bridge.voyage.world["vessels"]["eta"][0]).all()
    print(bridge.link.rejected(), steps)


#: what is refused after it was taken in
AFTERWARDS = ("order refused", "out of range", "no place on earth")


def resident():
    """Memory of this process [bytes]."""
    return int(Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE")
