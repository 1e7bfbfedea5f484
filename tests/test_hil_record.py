"""Recordings in MCAP against the episode archive, read by libraries that know nothing of us; views of a running bridge."""

from __future__ import annotations

import http.client
import json
import math
import time

import numpy as np
import pytest
from hil_helpers import Background, expected, memory_bridge

from usv_gym.config import ConfigError
from usv_gym.hil.backends import make_backend


def read(path):
    """Topic -> [(log time in ns, message)], by the mcap library."""
    from mcap.reader import make_reader
    from mcap_ros2.decoder import DecoderFactory

    topics = {}
    with path.open("rb") as file:
        for _, channel, message, decoded in make_reader(
            file, decoder_factories=[DecoderFactory()]
        ).iter_decoded_messages():
            topics.setdefault(channel.topic, []).append((message.log_time, decoded))
    return topics


def test_a_recording_equals_the_archive(tmp_path):
    path = tmp_path / "run.mcap"
    bridge, _, seen = memory_bridge(duration=20.0, more=[make_backend("mcap", {"file": str(path)})])
    bridge.run()
    assert not path.exists(), "it appears when it is whole"
    bridge.link.close()
    assert [p.name for p in tmp_path.iterdir()] == ["run.mcap"]
    episode, topics = bridge.voyage.finish(), read(path)
    assert {name.lstrip("/") for name in seen} <= {name.lstrip("/") for name in topics}
    epoch = episode.meta["epoch_us"] * 1000
    origin, scale = episode.meta["origin"], episode.meta["metres_per_degree"]
    times, fixes = zip(*topics["/sensors/gps/gps/fix"], strict=True)
    np.testing.assert_array_equal((np.array(times) - epoch) // 1000, np.round(episode.t * 1e6).astype(int))
    np.testing.assert_allclose([(f.latitude - origin[0]) * scale[0] for f in fixes], episode.nav[:, 1], atol=1e-6)
    np.testing.assert_allclose([(f.longitude - origin[1]) * scale[1] for f in fixes], episode.nav[:, 2], atol=1e-6)
    assert all(t == f.header.stamp.sec * 10**9 + f.header.stamp.nanosec for t, f in zip(times, fixes, strict=True))
    imu = [message for _, message in topics["/sensors/imu/imu/data"]]
    np.testing.assert_array_equal([m.linear_acceleration.x for m in imu], episode.nav[:, 8])
    np.testing.assert_array_equal([-m.linear_acceleration.y for m in imu], episode.nav[:, 9])
    np.testing.assert_array_equal([-m.angular_velocity.z for m in imu], episode.nav[:, 10])
    odometry = [message for _, message in topics["/sensors/position/odometry"]]
    np.testing.assert_array_equal([m.twist.twist.linear.x for m in odometry], episode.nav[:, 11])
    targets = [target for _, message in topics["/sensors/targets"] for target in message.targets]
    for name, column in {"id": "id", "sensors": "sensors", "y": "north", "x": "east", "cog": "cog", "sog": "sog",
                         "radius": "radius", "cog_variance": "var_cog"}.items():  # fmt: skip
        np.testing.assert_array_equal([getattr(target, name) for target in targets], episode.detections[column])
    np.testing.assert_array_equal([t.position_covariance[3] for t in targets], episode.detections["cov_nn"])
    heard = [m for _, m in topics["/sensors/ais"] if not m.own]
    rows = episode.ais[episode.ais["received"]]
    assert sorted((m.mmsi, m.header.stamp.sec * 10**9 + m.header.stamp.nanosec - epoch) for m in heard) == sorted(
        (int(r["mmsi"]), round(float(r["t"]) * 1e9)) for r in rows
    )
    commands = [m for _, m in topics["/cmd/actuators"]]  # what came in is in it, too
    recorded = [[m.rpm[0], m.nozzle[0], m.bucket[0], m.rpm[1], m.nozzle[1], m.bucket[1], m.rpm[2]] for m in commands]
    np.testing.assert_array_equal(recorded, episode.actions)
    np.testing.assert_array_equal(recorded, [expected(step) for step in range(1, 401)])
    markers = topics["/debug/markers"][-1][1].markers
    assert {marker.ns for marker in markers} >= {"ships", "obstacles", "names", "thrust", "track", "detections"}


def test_the_originals_messages_and_nmea_are_recorded_too(tmp_path):
    path = tmp_path / "run.mcap"
    bridge, _, _ = memory_bridge(profile="hilsim", duration=3.0, answer=False, lock_step=False,
                                 more=[make_backend("mcap", {"file": str(path)})])  # fmt: skip
    bridge.run()
    bridge.link.close()
    topics = read(path)
    heading = topics["/sensors/gps"][-1][1].heading
    assert math.cos(math.radians(heading) - bridge.voyage.world["nav"]["heading"][0]) == pytest.approx(1.0)
    assert topics["/sensors/ais"][0][1].raw_data.startswith("!AIVD")
    assert topics["/sensors/target_detection"]


def test_a_recording_says_what_is_wrong(tmp_path):
    with pytest.raises(ConfigError, match=r"file=FILE\.mcap"):
        make_backend("mcap")
    with pytest.raises(ConfigError, match="is a directory"):
        make_backend("mcap", {"file": str(tmp_path)})
    (tmp_path / "file").write_text("")
    backend = make_backend("mcap", {"file": str(tmp_path / "file" / "x.mcap")})
    with pytest.raises(ConfigError, match="cannot be written"):
        backend.open([], [], lambda row, message: None)


# --- views -----------------------------------------------------------------------------------------------------------
def test_the_browser_looks_at_a_running_bridge_and_a_click_spawns():
    import threading

    from usv_gym.hil.look import Shown
    from usv_gym.live import server

    bridge, _, _ = memory_bridge(duration=1e6, bridge={"realtime": 5.0}, lock_step=False)
    shown = Shown(bridge)
    bridge.view = shown.look
    http_server = server(shown, 0)
    serving = threading.Thread(target=http_server.serve_forever)
    serving.start()
    running = Background(bridge)
    try:
        client = http.client.HTTPConnection("127.0.0.1", http_server.server_address[1], timeout=20)
        headers = {"Content-Type": "application/json", "Host": f"127.0.0.1:{http_server.server_address[1]}"}
        client.request("POST", "/spawn", json.dumps({"north": 300.0, "east": -100.0}), headers)
        response = client.getresponse()
        assert response.status == 200, response.read()
        client.close()
        client = http.client.HTTPConnection("127.0.0.1", http_server.server_address[1], timeout=20)
        client.request("GET", "/events", headers={"Host": headers["Host"]})
        events = client.getresponse()
        kinds = []
        while kinds.count("part") < 2:
            line = events.readline().decode()
            if line.startswith("event: "):
                kinds.append(line.split()[1])
        events.close()
        client.close()
    finally:
        shown.stop()
        bridge.stop()
        running.join()
        http_server.shutdown()
        http_server.server_close()
        serving.join()
    assert "spawned_1" in bridge.voyage.commands.names


def test_the_map_looks_at_a_running_bridge(monkeypatch):
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    from usv_gym.hil.look import Onlooker
    from usv_gym.render.desk import Desk

    bridge, _, _ = memory_bridge(duration=1e6, bridge={"realtime": 5.0}, lock_step=False)
    onlooker = Onlooker(bridge)
    desk = Desk(onlooker)
    running = Background(bridge)
    try:
        until = time.monotonic() + 20
        while onlooker.t < 2.0:
            assert time.monotonic() < until
            desk.tick(0.03)
            assert desk.scene() is not None
        onlooker.commands.spawn("by_hand", {"kind": "iceberg", "radius": 10.0, "position": [100.0, 100.0]})
        with pytest.raises(ConfigError, match="this id is taken"):
            onlooker.commands.spawn("by_hand", {"kind": "iceberg", "radius": 10.0, "position": [100.0, 100.0]})
        onlooker.touched(0)
        assert "by_hand" in {thing.id for thing in onlooker.things()}
        onlooker.restart()
        assert bridge.resets == 1
        assert onlooker.t < 2.0 or bridge.voyage.t < 2.0
    finally:
        bridge.stop()
        running.join()
    with pytest.raises(TimeoutError):
        bridge.ask(lambda: None, patience=0.05)
