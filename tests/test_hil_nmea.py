"""NMEA: sentences against independent parsers, lock-step and real time over sockets, a controller that dies, gpsd, fuzz."""

from __future__ import annotations

import contextlib
import json
import math
import os
import random
import re
import shutil
import socket
import struct
import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pyais
import pynmea2
import pytest
from hil_helpers import EXAMPLES, ROUTE, Background, end, example, expected, free_port, plain_env, spawn

from usv_gym.config import ConfigError
from usv_gym.hil.backends import make_backend
from usv_gym.hil.backends.nmea import Nmea
from usv_gym.hil.backends.nmea_fields import sentence, sentence_decoder, sentence_encoder
from usv_gym.hil.bridge import Bridge, plan_hil
from usv_gym.hil.external import ExternalController
from usv_gym.hil.link import Link
from usv_gym.hil.profile import Row, load_profile
from usv_gym.units import DEG, KNOT

pytestmark = pytest.mark.usefixtures("compiled")


def nmea_bridge(
    *,
    control="actuators",
    duration=5.0,
    scenario="calm_crossing",
    overrides=(),
    realtime=None,
    tcp=False,
    to=None,
    **more,
):
    """A bridge over NMEA on free ports; returns it and its backend."""
    out = to or free_port()
    options = {"listen": "127.0.0.1:0", "to": "off" if tcp else f"127.0.0.1:{out}"}
    backend = make_backend("nmea", {**options, **({"tcp": "127.0.0.1:0"} if tcp else {})})
    link = Link(load_profile("nmea"), [backend], control=control)
    controller = ExternalController(link, **more)
    bridge = Bridge(
        plan_hil(scenario, duration=duration, overrides=overrides), link, controller, record=True, realtime=realtime
    )
    link.open()
    return bridge, backend


def percent(step):
    rpm_s, nozzle_s, bucket_s, rpm_p, nozzle_p, bucket_p, bow = (f"{100 * v:.2f}" for v in expected(step))
    return (
        sentence(f"PUSVA,{step},{rpm_p},{nozzle_p},{bucket_p},{rpm_s},{nozzle_s},{bucket_s},{bow}").encode() + b"\r\n"
    )


# --- sentences -------------------------------------------------------------------------------------------------------
def test_sentences_are_what_independent_parsers_read():
    wire = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    wire.bind(("127.0.0.1", 0))
    wire.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1 << 22)
    wire.settimeout(0.2)
    bridge, _ = nmea_bridge(to=wire.getsockname()[1], duration=8.0, lock_step=False)
    lines = []
    for _ in range(160):
        bridge.step()
        while True:
            wire.setblocking(False)
            try:
                lines.append(wire.recv(2048).decode())
            except BlockingIOError:
                break
    bridge.link.close()
    wire.close()
    episode = bridge.voyage.finish()
    origin, scale = episode.meta["origin"], episode.meta["metres_per_degree"]
    assert all(len(line) <= 84 and line.endswith("\r\n") for line in lines)
    kinds = {}
    for line in lines:
        kinds.setdefault(line[1:6], []).append(line)
    fixes = [pynmea2.parse(line.strip(), check=True) for line in kinds["GPRMC"]]
    at = [round((fix.datetime.timestamp() - episode.meta["epoch_us"] / 1e6) / 0.05) for fix in fixes]
    nav = episode.nav[at]
    np.testing.assert_allclose([(f.latitude - origin[0]) * scale[0] for f in fixes], nav[:, 1], atol=2e-3)  # 1e-6 min
    np.testing.assert_allclose([(f.longitude - origin[1]) * scale[1] for f in fixes], nav[:, 2], atol=2e-3)
    np.testing.assert_allclose([f.spd_over_grnd for f in fixes], nav[:, 5] / KNOT, atol=0.006)
    heading = pynmea2.parse(kinds["GPHDT"][-1].strip(), check=True)
    assert float(heading.heading) == pytest.approx(episode.nav[-1, 6] / DEG, abs=0.002)
    for kind in ("GPGGA", "GPVTG", "GPROT", "WIMWV", "RATTM"):
        for line in kinds[kind]:
            pynmea2.parse(line.strip(), check=True)
    wind = pynmea2.parse(kinds["WIMWV"][0].strip(), check=True)
    assert (wind.reference, wind.wind_speed_units) == ("R", "M")
    target = pynmea2.parse(kinds["RATTM"][-1].strip(), check=True)
    assert {int(line.split(",")[1]) for line in kinds["RATTM"]} == set((episode.detections["id"] % 100).tolist())
    assert 0.0 < float(target.distance) < 1.0
    received = [pyais.decode(line.strip()) for line in kinds["AIVDM"] if line.split(",")[1] == "1"]
    reports = [message for message in received if message.msg_type in (1, 18, 21)]
    rows = episode.ais[episode.ais["received"]]
    assert len(reports) == len(rows)
    np.testing.assert_allclose([r.lat for r in reports], origin[0] + rows["north"] / scale[0], atol=1e-6)
    np.testing.assert_allclose([r.course for r in reports], rows["cog"] / DEG, atol=0.051)
    assert kinds["AIVDO"]


@pytest.mark.parametrize(
    ("value", "text"), [(59.44, "5926.400000,N"), (-0.5, "0030.000000,S"), (59.99999999999, "6000.000000,N")]
)
def test_degrees_and_minutes(value, text):
    row = Row(topic="x", signal="gnss", type="XXTST", fields=["latitude [lat]"])
    assert sentence_encoder(row)({"latitude": value}).split("*")[0] == f"$XXTST,{text}"
    back = sentence_decoder(row)(text.split(","))
    assert back["latitude"] == pytest.approx(value, abs=1e-8)


def lines_of(wire):
    """A function that returns the next line of a TCP connection."""
    waiting = bytearray()

    def next_line():
        while b"\n" not in waiting:
            waiting.extend(wire.recv(4096))
        line, _, rest = bytes(waiting).partition(b"\n")
        waiting[:] = rest
        return line

    return next_line


# --- over sockets ----------------------------------------------------------------------------------------------------
@pytest.mark.parametrize("tcp", [False, True], ids=["udp", "tcp"])
def test_lock_step_over_sockets_is_the_plain_environment_bit_for_bit(tcp):
    if tcp:
        bridge, backend = nmea_bridge(tcp=True, duration=10.0)
        wire = socket.create_connection(backend.tcp)
        next_line, send = lines_of(wire), wire.sendall
    else:
        wire = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        wire.bind(("127.0.0.1", 0))
        bridge, backend = nmea_bridge(to=wire.getsockname()[1], duration=10.0)
        next_line, send = lambda: wire.recv(2048), lambda data: wire.sendto(data, backend.listen)
    running = Background(bridge)
    try:
        for step in range(1, 201):
            while not (line := next_line()).startswith(b"$PUSVT,"):
                pass
            assert line.split(b",")[1] == str(step).encode()
            send(percent(step))
        report = running.join()
    finally:
        bridge.stop()
        bridge.link.close()
        wire.close()
    episode = bridge.voyage.finish()
    np.testing.assert_allclose(
        episode.actions, [expected(step) for step in range(1, 201)], atol=1e-12
    )  # 4 decimals sent
    assert plain_env(episode).tobytes() == bridge.voyage.world.tobytes()
    assert report.failsafes == 0
    print("\n".join(report.lines()))
    assert np.median(report.round_trips) < 0.005


def test_the_command_line_with_the_example_controller_avoids_the_crossing_ship(tmp_path):
    out, port, listen = tmp_path / "run", free_port(), free_port()
    wires = f"--listen 127.0.0.1:{port} --to 127.0.0.1:{listen}"
    command = f"{sys.executable} {EXAMPLES}/nmea_controller.py {wires} --route {' '.join(ROUTE)}"
    done = subprocess.run(
        [sys.executable, "-m", "usv_gym.cli", "hil", "calm_crossing", "--backend", "nmea", "--lock-step", "--duration", "150",
         "-o", f"to=127.0.0.1:{port}", "-o", f"listen=127.0.0.1:{listen}", "--start", command, "--out", str(out),
         "--record", str(tmp_path / "run.mcap")],
        capture_output=True, text=True, timeout=120, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    summary = json.loads((out / "summary.json").read_text())
    assert summary["collisions"] == []
    closest = {thing["name"]: thing["closest_m"] for thing in summary["objects"]}
    assert closest["coaster"] > 40.0
    assert min(closest.values()) > 20.0
    from usv_gym.replay.archive import load
    from usv_gym.run import resimulate

    episode = load(out / "episode.usv")
    end_of_route = np.hypot(episode.eta[:, 0, 0] - 500, episode.eta[:, 0, 1] - 60)
    assert end_of_route.min() < 20.0
    np.testing.assert_array_equal(resimulate(episode).eta, episode.eta)
    assert (tmp_path / "run.mcap").stat().st_size > 10_000


@pytest.mark.parametrize("bad", [["--realtime", "30"], ["--backend", "ros3"], ["--profile", "hilsim"], ["--record", "x.bag"],
                                 ["-o", "tcp=nowhere"], ["-o", "to"], ["--inject", "IMU"], ["--inject", "XYZ:delay=1"],
                                 ["--own-ship", "other"], ["--interval", "0.07"], ["--control", "sails"],
                                 ["--fail-safe", "pray"],
                                 ["--view", "window"], ["--start", "/no/such/program"]])  # fmt: skip
def test_careless_arguments_are_one_line_and_exit_2(bad, capsys, monkeypatch):
    from usv_gym import cli

    arguments = ["hil", "calm_crossing", "--backend", "nmea", "-o", "listen=127.0.0.1:0", "--duration", "1", *bad]
    monkeypatch.setattr("sys.argv", ["usv-gym", *arguments])
    with pytest.raises(SystemExit) as stop:
        cli.main()
    assert stop.value.code == 2
    error = capsys.readouterr().err.strip()
    assert error.startswith("usv-gym: ")
    assert "Traceback" not in error


def test_a_taken_port_is_said():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as taken:
        taken.bind(("127.0.0.1", 0))
        backend = Nmea(listen=f"127.0.0.1:{taken.getsockname()[1]}")
        with pytest.raises(ConfigError, match=r"nmea listen=.*in use"):
            backend.open([], [], lambda row, message: None)


def test_a_controller_behind_the_wire_flies_as_any_policy(tmp_path):
    """By `usv-gym run --policy hil:RIG.yaml`, and one episode after the other in the flights of a campaign."""
    from usv_gym.campaign.flight import Flight, Yard
    from usv_gym.hil import rig
    from usv_gym.run import plan, resimulate, run
    from usv_gym.scenarios.suites import Case

    port, listen = free_port(), free_port()
    file = tmp_path / "rig.yaml"
    wires = f"--listen 127.0.0.1:{port} --to 127.0.0.1:{listen}"
    file.write_text(f"""
backend: nmea
options: {{to: "127.0.0.1:{port}", listen: "127.0.0.1:{listen}"}}
start: {sys.executable} {EXAMPLES}/nmea_controller.py {wires} --route {" ".join(ROUTE)}
""")
    short = ["simulation.duration=40"]
    try:
        episode = run(plan("calm_crossing", policy=f"hil:{file}", overrides=short))
        assert len(episode.actions) == 40
        np.testing.assert_array_equal(resimulate(episode).eta, episode.eta)
        assert episode.eta[-1, 0, 0] > 100.0
        case = Case(id="crossing", scenario="calm_crossing", overrides=short)
        for seed in (0, 1):
            (result,) = Yard().fly(Flight(f"hil:{file}", case, (seed,)))
            assert result.outcome == "time_limit", result
    finally:
        rig.close()


def test_the_own_ship_is_another_simulator_that_speaks_nmea():
    """One bridge has the dynamics and nothing else; another has the surroundings, and hears by RMC, HDT and ROT where it is."""
    surroundings = make_backend("nmea", {"listen": "127.0.0.1:0", "to": f"127.0.0.1:{free_port()}"})
    link = Link(load_profile("nmea"), [surroundings], external=True)
    around = Bridge(plan_hil("calm_crossing", duration=1e6, own_ship="external"), link,
                    ExternalController(link, lock_step=False), realtime=5.0, own_ship="external", record=True)  # fmt: skip
    link.open()
    dynamics = make_backend("nmea", {"listen": "127.0.0.1:0", "to": f"127.0.0.1:{surroundings.listen[1]}"})
    link = Link(load_profile("nmea"), [dynamics])
    ship = Bridge(plan_hil("calm_crossing", duration=1e6, own_ship="only"), link, ExternalController(link, lock_step=False),
                  realtime=5.0, own_ship="only", record=True)  # fmt: skip
    link.open()
    runs = [Background(around), Background(ship)]
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as wire:
        until = time.monotonic() + 2.0
        while time.monotonic() < until:
            wire.sendto(sentence("PUSVH,,40,8").encode(), dynamics.listen)
            time.sleep(0.05)
    for bridge, run in zip((around, ship), runs, strict=True):
        bridge.stop()
        run.join()
        bridge.link.close()
    there, here = around.voyage.finish(), ship.voyage.finish()
    assert set(around.link.received) == {"OWN_RMC", "OWN_HDT", "OWN_ROT"}
    moved = here.eta[-1, 0]
    assert np.hypot(*moved[:2]) > 20.0
    assert math.cos(moved[2] - 40 * DEG) > 0.99
    late = there.eta[len(there.eta) // 2 :, 0]
    apart = np.hypot(*(late[:, None, :2] - here.eta[None, :, 0, :2]).transpose(2, 0, 1)).min(axis=1)
    assert np.median(apart) < 3.0  # what GNSS is off by
    assert math.cos(late[-1, 2] - moved[2]) > 0.99
    assert around.link.sent["TTM"] > 10
    assert around.link.sent["AIS"] > 3


# --- things that die -------------------------------------------------------------------------------------------------
def wait_until(condition, seconds=20.0):
    until = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < until, "waited too long"
        time.sleep(0.01)


def test_a_killed_controller_and_a_cut_wire_trip_the_fail_safe_and_control_comes_back():
    """In real time, three times as fast: the controller is killed and started again; then the wire is cut and mended."""
    port, cut = free_port(), threading.Event()
    proxy = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    proxy.bind(("127.0.0.1", 0))
    bridge, backend = nmea_bridge(
        control="heading_speed", to=port, duration=1e6, realtime=3.0, lock_step=False, interval=2
    )

    def forward():
        while True:
            data = proxy.recv(2048)
            if data == b"end":
                return
            if not cut.is_set():
                proxy.sendto(data, backend.listen)

    forwarding = threading.Thread(target=forward)
    forwarding.start()
    arguments = ("--listen", f"127.0.0.1:{port}", "--to", f"127.0.0.1:{proxy.getsockname()[1]}")
    process = example("nmea_controller.py", *arguments)
    running = Background(bridge)
    controller = bridge.controller
    last = lambda: bridge.voyage.core.actions[0]  # noqa: E731
    try:
        for kill in (True, False):
            wait_until(lambda: bridge.link.received["HEADING"] > 20 and not controller.failsafe and last()[1] > 0)
            failsafes, began = controller.failsafes, bridge.t_us
            if kill:
                process.kill()
                process.wait()
            else:
                cut.set()
            wait_until(lambda before=failsafes: controller.failsafes > before)
            assert bridge.t_us - began < 1.6e6  # within its 1 s, and what the machine takes to notice
            wait_until(lambda: (last() == [0.0, -1.0]).all())  # speed zero
            t = bridge.t_us
            wait_until(lambda before=t: bridge.t_us > before + 1e6)  # the world goes on
            bridge.link.received.clear()
            if kill:
                process = example("nmea_controller.py", *arguments)
            else:
                cut.clear()
            wait_until(lambda: not controller.failsafe and last()[1] > 0)
    finally:
        bridge.stop()
        running.join()
        end(process)
        proxy.sendto(b"end", proxy.getsockname())
        forwarding.join()
        proxy.close()
        bridge.link.close()


def test_a_lost_tcp_connection_trips_the_fail_safe_and_the_next_one_is_in_control():
    """A client steers; its connection breaks (reset, not closed in order); another one comes and steers."""
    bridge, backend = nmea_bridge(
        control="heading_speed", tcp=True, duration=1e6, realtime=5.0, lock_step=False, interval=2
    )
    running = Background(bridge)
    controller = bridge.controller
    command = sentence("PUSVH,,10,8").encode() + b"\r\n"

    def steer():
        wire = socket.create_connection(backend.tcp)
        next_line = lines_of(wire)
        for _ in range(60):
            next_line()
            wire.sendall(command)
        wait_until(lambda: not controller.failsafe and bridge.voyage.core.actions[0][1] > 0)
        return wire

    try:
        for life in (1, 2):
            wire = steer()
            failsafes, began = controller.failsafes, bridge.t_us
            wire.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
            wire.close()
            wait_until(lambda before=failsafes: controller.failsafes > before)
            assert bridge.t_us - began < 1.6e6
            wait_until(lambda: (bridge.voyage.core.actions[0] == [0.0, -1.0]).all())
            wait_until(lambda: backend.peers() == 0)
            assert life <= controller.failsafes
    finally:
        bridge.stop()
        report = running.join()
        bridge.link.close()
    assert report.slips == 0


def test_a_tcp_client_that_does_not_read_is_let_go_and_holds_nobody_up():
    bridge, backend = nmea_bridge(tcp=True, duration=1e6, lock_step=False)
    wire = socket.socket()
    wire.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
    wire.connect(backend.tcp)
    wait_until(lambda: backend.peers() == 1)
    ais = next(row for row in bridge.link.profile.rows if row.signal == "ais")
    much = {"sentences": [sentence("AIVDM,1,1,,A," + "0" * 60 + ",0")] * 1000}
    for _ in range(300):  # some 25 MB
        backend.publish(ais, much)
        bridge.step()
        if not backend.peers():
            break
    assert backend.counters()["slow client dropped"] == 1
    wire.close()
    bridge.link.close()


def test_a_controller_ends_with_the_process_that_started_it_even_if_that_is_killed():
    """A campaign kills its workers; a controller that stayed would keep the wire."""
    if sys.platform != "linux":
        pytest.skip("only Linux tells a child")
    code = "import time; from usv_gym.hil.rig import Process as P; print(P('sleep 600').child.pid, flush=True); time.sleep(600)"
    parent = subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True)
    child = int(parent.stdout.readline())
    os.kill(child, 0)
    parent.kill()
    parent.wait()
    parent.stdout.close()

    def gone():
        try:
            return Path(f"/proc/{child}/stat").read_text().rpartition(")")[2].split()[0] == "Z"
        except OSError:
            return True

    wait_until(gone, seconds=5.0)


# --- gpsd ------------------------------------------------------------------------------------------------------------
def test_gpsd_reads_position_heading_and_all_ais_targets():
    gpsd = shutil.which("gpsd") or shutil.which("/usr/sbin/gpsd")
    if gpsd is None:
        pytest.skip("gpsd is not installed (ros/ros1_apt.sh)")
    feed, control = free_port(), free_port(socket.SOCK_STREAM)
    daemon = spawn(gpsd, "-N", "-n", "-S", str(control), f"udp://127.0.0.1:{feed}", stderr=subprocess.DEVNULL)
    kinds, norths = ("ship", "vessel", "boat"), range(-500, 700, 200)
    ships = {f"ship_{n}": {"class": kinds[k % 3], "waypoints": [[n, 400], [n, -900]]} for k, n in enumerate(norths)}
    sea = {
        "simulation": {"area": 5000.0},
        "ships": ships,
        "obstacles": {"aid": {"kind": "buoy", "position": [300, 0], "radius": 2, "ais": True}},
    }
    bridge, _ = nmea_bridge(to=feed, scenario=sea, duration=1e6, realtime=3.0, lock_step=False)
    running = None
    try:
        for _ in range(100):
            try:
                wire = socket.create_connection(("127.0.0.1", control), timeout=10)
                break
            except OSError:
                time.sleep(0.05)
        wire.sendall(b'?WATCH={"enable":true,"json":true,"scaled":true};\n')
        next_line = lines_of(wire)
        running = Background(bridge)
        fixes, headings, ais = [], [], {}
        until = time.monotonic() + 15
        while time.monotonic() < until and not (len(fixes) > 20 and len(headings) > 20 and bridge.t_us > 12e6):
            line = next_line().decode()
            if line.startswith('{"class":"ATT"'):  # version 3.22 writes more into it than it knows, and no good JSON
                headings.append(float(re.search(r'"heading":([0-9.]+)', line)[1]))
                continue
            message = json.loads(line)
            kind = message["class"]
            if kind == "TPV" and message.get("mode", 0) >= 2 and "lat" in message:
                fixes.append(message)
            elif kind == "AIS" and message["type"] in (1, 18, 21):
                ais.setdefault(message["mmsi"], []).append(message)
        wire.close()
    finally:
        bridge.stop()
        if running:
            running.join()
        bridge.link.close()
        end(daemon)
    episode = bridge.voyage.finish()
    origin, scale = episode.meta["origin"], episode.meta["metres_per_degree"]
    track = episode.nav[:, 1:3]
    places = np.array([[(fix["lat"] - origin[0]) * scale[0], (fix["lon"] - origin[1]) * scale[1]] for fix in fixes])
    assert len(places) > 20
    nearest = np.hypot(*(places[:, None] - track[None]).transpose(2, 0, 1)).min(axis=1)
    assert nearest.max() < 0.01
    measured = episode.nav[:, 6] / DEG
    assert max(min(abs(measured - heading)) for heading in headings) < 0.002
    heard = {
        int(mmsi): rows
        for mmsi in np.unique(episode.ais["mmsi"])
        if len(rows := episode.ais[(episode.ais["mmsi"] == mmsi) & episode.ais["received"]])
    }
    missing = set(heard) - set(ais)
    assert len(heard) >= 6  # the buoy speaks every three minutes
    assert not {mmsi for mmsi in missing if heard[mmsi]["t"].min() < 9.0}
    for mmsi, messages in ais.items():
        if mmsi in heard:
            rows = heard[mmsi]
            places = np.stack([origin[0] + rows["north"] / scale[0], origin[1] + rows["east"] / scale[1]], axis=1)
            for message in messages:
                off = np.abs(places - [message["lat"], message["lon"]]).max(axis=1)
                row = rows[off.argmin()]
                assert off.min() < 1e-4 / 60 + 1e-6
                if message["type"] == 1:
                    assert message["speed"] == pytest.approx(row["sog"] / KNOT, abs=0.051)
                    assert math.cos((message["course"] - row["cog"] / DEG) * DEG) > math.cos(0.06 * DEG)


# --- fuzz ------------------------------------------------------------------------------------------------------------
def noise(draw):
    kind = draw.randrange(8)
    if kind == 0:
        return bytes(draw.randrange(256) for _ in range(draw.randrange(60))).replace(b"\n", b"x")
    if kind == 1:
        return b"$" + b"A" * draw.choice([10, 1023, 5000])
    if kind == 2:
        return sentence(
            f"PUSVH,{draw.randrange(99)},{draw.choice(['nan', 'inf', '-1e999', '1_0', '', 'x', '9' * 40])},{draw.random()}"
        ).encode()
    if kind == 3:
        return sentence(f"PUSVC,{draw.choice(['spawn', 'delete', '', 'x'])},{draw.randrange(50)},9999.9,N,0,Q").encode()
    if kind == 4:
        return sentence(
            ",".join(["PUSVA", *(str(draw.uniform(-1e9, 1e9)) for _ in range(draw.randrange(12)))])
        ).encode()
    if kind == 5:
        return sentence("GPRMC,1,A,1,N").encode()[: draw.randrange(20)]
    if kind == 6:
        return b"\\" * draw.randrange(1, 9) + sentence("PUSVH,,1,1").encode()
    return sentence(f"PUSVH,,{draw.uniform(-1e6, 1e6)},{draw.uniform(-1e6, 1e6)}").encode()


def test_100_000_fuzzed_lines_over_tcp_are_all_counted_and_the_world_goes_on():
    from test_hil import resident

    bridge, backend = nmea_bridge(tcp=True, control="heading_speed", duration=1e6, lock_step=False)
    draw = random.Random(2)
    pool = [noise(draw) for _ in range(5000)]
    lines = [draw.choice(pool) for _ in range(100_000)]
    wire = socket.create_connection(backend.tcp)
    wire.settimeout(5.0)

    def flood():
        for start in range(0, len(lines), 100):
            wire.sendall(b"\n".join(lines[start : start + 100]) + b"\n")
            with contextlib.suppress(TimeoutError):
                wire.recv(1 << 20)  # what the world says has to go somewhere

    thread = threading.Thread(target=flood)
    thread.start()
    steps, before = 0, 0
    total = sum(bool(line.strip(b"\r\n \0")) for line in lines)
    until = time.monotonic() + 60
    while (sum(backend.counters().values()) < total or steps < 50) and time.monotonic() < until:
        bridge.step()
        steps += 1
        before = before or (resident() if steps == 20 else 0)
    thread.join()
    wire.close()
    bridge.link.close()
    counters = backend.counters()
    assert sum(counters.values()) == total, counters
    assert counters["line too long"] > 1000
    assert counters["accepted"] > 10_000
    assert resident() - before < 40e6
    assert np.isfinite(bridge.voyage.world["vessels"]["eta"][0]).all()
    print(bridge.link.rejected(), steps)
