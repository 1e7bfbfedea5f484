"""ROS 1 and ROS 2 for real: bridge and controller in processes of their own, over the loopback.

Needs what ``ros/ros1_apt.sh`` installs, and an environment by ``ros/ros2_venv.sh`` in ``.ros2``, or where ``USV_GYM_ROS2``
says.
"""

from __future__ import annotations

import json
import os
import re
import shutil
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pytest
from hil_helpers import EXAMPLES, ROOT, ROUTE, end, expected, free_port, memory_bridge, spawn

from usv_gym.replay.archive import load
from usv_gym.run import resimulate

TESTS = Path(__file__).parent
STEPS = 200


@pytest.fixture(scope="module", autouse=True)
def compiled():
    """Kernels are on the disk before a process needs them within seconds."""
    bridge, _, _ = memory_bridge()
    bridge.step()


# --- what is here ----------------------------------------------------------------------------------------------------
@pytest.fixture(scope="module")
def ros2():
    """Python of an environment with rclpy, and the variables that keep it on this machine."""
    python = Path(os.environ.get("USV_GYM_ROS2", ROOT / ".ros2")) / "bin" / "python"
    if not python.is_file():
        pytest.skip("no ROS 2: ros/ros2_venv.sh .ros2 $(which python)")
    profile = ROOT / "ros" / "fastdds_loopback.xml"
    return python, {
        "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST", "ROS_DOMAIN_ID": str(20 + os.getpid() % 80),
        "FASTDDS_DEFAULT_PROFILES_FILE": str(profile), "PYTHONPATH": str(TESTS),
    }  # fmt: skip


@pytest.fixture(scope="module")
def ros1(tmp_path_factory):
    """Environment of a graph with a master of its own, and Python classes built from the original's definitions."""
    if not Path("/usr/bin/rosmaster").exists() or not Path("/usr/lib/genpy/genmsg_py.py").exists():
        pytest.skip("no ROS 1: sudo ros/ros1_apt.sh")
    home = tmp_path_factory.mktemp("ros1")
    subprocess.run([ROOT / "ros" / "ros1_messages.sh", home / "messages"], check=True, capture_output=True)
    environment = {
        "ROS_MASTER_URI": f"http://127.0.0.1:{free_port()}", "ROS_IP": "127.0.0.1",
        "ROS_HOME": str(home), "ROS_LOG_DIR": str(home),
        "CONTROL_PATH": f"{home / 'messages'}:{TESTS}:{EXAMPLES}",
    }  # fmt: skip
    master = start_master(environment)
    yield environment
    end(master)


def start_master(environment):
    port = environment["ROS_MASTER_URI"].rsplit(":", 1)[1]
    master = spawn(
        "/usr/bin/rosmaster",
        "--core",
        "-p",
        port,
        env=environment,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    import xmlrpc.client

    until = time.monotonic() + 15
    while True:
        try:
            with xmlrpc.client.ServerProxy(environment["ROS_MASTER_URI"]) as proxy:
                proxy.getPid("/test")
            return master
        except OSError:
            assert time.monotonic() < until, "the master does not start"
            time.sleep(0.05)


def bridge(python, environment, out, *arguments, **kwargs):
    """`usv-gym hil` as a process."""
    return spawn(python, "-m", "usv_gym.cli", "hil", "calm_crossing", "--out", out, *arguments,
                 env=environment, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, **kwargs)  # fmt: skip


def finish(process, timeout=90):
    text, _ = process.communicate(timeout=timeout)
    assert process.returncode == 0, text
    return text


def median_round_trip(text):
    """[ms]"""
    return float(re.search(r"round trip \[ms\]: median ([0-9.]+)", text)[1])


def check_lock_step(out):
    """What was decoded is what was sent, and the plain episode is the same bit for bit."""
    episode = load(out / "episode.usv")
    np.testing.assert_allclose(episode.actions, [expected(step) for step in range(1, STEPS + 1)], rtol=0, atol=1e-15)
    again = resimulate(episode)
    for name in ("eta", "nu", "nav", "command", "detections", "ais"):
        assert getattr(again, name).tobytes() == getattr(episode, name).tobytes(), name


# --- ROS 1 -----------------------------------------------------------------------------------------------------------
def test_ros1_lock_step_is_the_plain_environment_bit_for_bit(ros1, tmp_path):
    peer = spawn("/usr/bin/python3", TESTS / "hil_ros1_peer.py", "1496318400000000000", "50000000",
                 env={**ros1, "PYTHONPATH": ros1["CONTROL_PATH"]})  # fmt: skip
    try:
        text = finish(bridge(sys.executable, ros1, tmp_path, "--backend", "ros1", "--profile", "hilsim", "--lock-step",
                             "--interval", "0.05", "--duration", "10"))  # fmt: skip
    finally:
        end(peer)
    print(text)
    check_lock_step(tmp_path)
    assert median_round_trip(text) < 5.0


def test_ros1_messages_have_the_sums_of_the_original(ros1):
    sums = {
        "AIS": "c4b02c9a2cf4071b973def961612a531", "ActuatorMessage": "7b1b9cdb6c5ba146c90a40c3498d18b1",
        "Environment": "c7b07d3af6ed0820d5cb2f920af3dd4f", "Gps": "fabe52f68c7f92616561ddbc3f435aee",
        "detectedTarget": "4e4eb8dc86e32bf5d4f58ee71d8a0931", "obstacleCmd": "73d0006ff3da56034acc0179aa503208",
        "obstacleUpdate": "6b79b1e1cd58c9c2f5f923b5c951ba08",
    }  # fmt: skip
    code = "import json, sys, simulator_messages.msg as m; print(json.dumps({n: getattr(m, n)._md5sum for n in sys.argv[1:]}))"
    environment = {**os.environ, "PYTHONPATH": ros1["CONTROL_PATH"]}
    built = subprocess.run(
        ["/usr/bin/python3", "-c", code, *sums], env=environment, capture_output=True, text=True, check=True
    )
    assert json.loads(built.stdout) == sums
    code = """
import json, sys
from usv_gym.hil.backends import ros1
ros1._rospy()
print(json.dumps({n: ros1.message_class(f"simulator_messages/{n}", "")._md5sum for n in sys.argv[1:]}))
"""
    made = subprocess.run([sys.executable, "-c", code, *sums], cwd=ROOT, capture_output=True, text=True, check=True)
    assert json.loads(made.stdout) == sums  # as the bridge generates them at run time


class Lines:
    """What a process says, line by line."""

    def __init__(self, process):
        self.process, self.lines = process, []
        self.thread = threading.Thread(target=self._read, daemon=True)
        self.thread.start()

    def _read(self):
        for line in self.process.stdout:
            self.lines.append(line)

    def wait(self, text, count=1, seconds=60.0):
        until = time.monotonic() + seconds
        while sum(text in line for line in self.lines) < count:
            assert time.monotonic() < until, f"no {text!r} in {self.lines}"
            assert self.process.poll() is None, self.lines
            time.sleep(0.02)


class Duel:
    """A bridge in real time against a controller that can be killed and stopped, over either ROS."""

    def __init__(self, running, controller):
        self.running, self.start = running, controller
        self.said = Lines(running)
        self.process, self.failures = None, 0

    def begin(self):
        self.process = self.start()
        self.in_control()

    def kill(self):
        """Without a word: SIGKILL."""
        self.process.kill()
        self.process.wait()
        self.lost()

    def silence(self, seconds=0.0):
        """The network between the two carries nothing: the controller stands still, its connections stay, nothing is said."""
        self.process.send_signal(signal.SIGSTOP)
        self.lost()
        time.sleep(seconds)
        self.process.send_signal(signal.SIGCONT)
        self.in_control()

    def lost(self):
        self.failures += 1
        self.said.wait("failsafe_on", self.failures)

    def in_control(self):
        self.said.wait("failsafe_off", self.failures)

    def finish(self):
        self.running.send_signal(signal.SIGINT)
        assert self.running.wait(30) == 0

    def close(self, *others):
        for each in (self.process, *others, self.running):
            if each is not None:
                if each is self.process:
                    each.send_signal(signal.SIGCONT)
                end(each)
        self.said.thread.join(5)
        self.running.stdout.close()
        print("".join(self.said.lines))


def check_fail_safes(out, topic, failures, timeout=1.0):
    """By the recording and the archive: thrust was off within the timeout after the last command, until the next one came."""
    from test_hil_record import read

    episode, topics = load(out / "episode.usv"), read(out / "run.mcap")
    zero = np.zeros(7) if topic == "/input/actuators" else np.array([0.0, -1.0])
    commands = np.array([stamp for stamp, _ in topics[topic]]) / 1e9
    notices = [(stamp / 1e9, message.kind) for stamp, message in topics["/hil/notice"]]
    began = [t for t, kind in notices if kind == "failsafe_on"]
    ended = [t for t, kind in notices if kind == "failsafe_off"]
    assert len(began) == len(ended) == failures
    start = episode.meta["epoch_us"] / 1e6
    dt = episode.meta["scenario"]["simulation"]["dt"]
    acted = episode.t[: len(episode.actions)]
    off = np.all(np.abs(episode.actions - zero) < 1e-12, axis=1)
    for on, back in zip(began[1:], ended[1:], strict=True):  # before the first one nobody had spoken
        before = commands[commands < on]
        late = on - before[-1] - timeout
        assert 0.0 < late < 3.5 * dt, (on, before[-3:])  # heard, taken in, noticed and told: a tick each
        assert off[(acted >= on - start + dt / 2) & (acted < back - start - 1.5 * dt)].all()
        assert np.any(~off[acted > back - start])


def test_ros1_survives_its_controller_its_network_and_its_master(ros1, tmp_path):
    """Real time: the controller is killed and started again, then silent for a while; then the master is killed, and both."""
    ros1 = {**ros1, "ROS_MASTER_URI": f"http://127.0.0.1:{free_port()}"}
    control = {**ros1, "PYTHONPATH": ros1["CONTROL_PATH"]}
    master = start_master(ros1)
    duel = Duel(
        bridge(sys.executable, ros1, tmp_path, "--backend", "ros1", "--profile", "hilsim", "--realtime", "2"),
        lambda: spawn("/usr/bin/python3", EXAMPLES / "ros1_controller.py", "--route", *ROUTE, env=control),
    )
    try:
        duel.lost()  # nobody is there yet
        duel.begin()
        duel.kill()
        duel.begin()
        duel.silence()
        end(master)
        time.sleep(1.2)  # connections stand without it
        assert sum("failsafe_on" in line for line in duel.said.lines) == duel.failures
        master = start_master(ros1)
        duel.kill()
        time.sleep(1.5)  # the bridge registers again
        duel.begin()
        duel.finish()
    finally:
        duel.close(master)
    times = [float(line.split()[0][2:]) for line in duel.said.lines if line.startswith("t=") and "failsafe" in line]
    assert times == sorted(times)
    assert any("master was away 1" in line for line in duel.said.lines)
    assert "episode.usv" in duel.said.lines[-1]  # Ctrl-C loses nothing


# --- fuzz, over both -------------------------------------------------------------------------------------------------
#: why a message does not get to the mailbox; other counts are of what had got there
REFUSALS = ("not finite", "wrong type", "field missing", "not for us", "answers another step", "broken", "lost on the way")


class Fuzz:
    """A bridge and a process that floods it with ``count`` messages."""

    def __init__(self, which, python, environment, peer, peer_environment, count):
        more = ["--profile", "hilsim"] if which == "ros1" else []
        self.which, self.count = which, count
        self.running = spawn(python, "-m", "usv_gym.cli", "hil", "calm_crossing", "--backend", which, *more, env=environment,
                             stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)  # fmt: skip
        self.said = Lines(self.running)
        self.flood = spawn(peer, TESTS / "hil_ros_fuzz.py", which, count, env=peer_environment, stdout=subprocess.PIPE,
                           text=True)  # fmt: skip

    def resident(self):
        """[bytes]"""
        return int(Path(f"/proc/{self.running.pid}/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE")

    def check(self):
        """All are counted, memory does not grow, and the world goes on."""
        try:
            assert self.flood.stdout.readline() == "warm\n"
            before = self.resident()
            told = json.loads(self.flood.stdout.read())
            assert self.flood.wait(30) == 0
            grown = self.resident() - before
            self.running.send_signal(signal.SIGINT)
            assert self.running.wait(30) == 0
        finally:
            self.close()
        report = {line.partition(": ")[0]: line.partition(": ")[2] for line in self.said.lines}
        print(*self.said.lines[-4:], told, f"{grown / 1e6:.1f} MB more", sep="\n")
        received = sum(int(n) for n in re.findall(r" (\d+)", report["received"]))
        counts = {part.rpartition(" ")[0]: int(part.rpartition(" ")[2]) for part in report["refused"].strip().split("  ")}
        refused = {reason: n for reason, n in counts.items() if reason.startswith(REFUSALS)}
        assert received + sum(refused.values()) == sum(told["sent"].values()) == self.count + 1
        lost = sum(n for reason, n in refused.items() if reason.startswith("lost"))
        assert lost < (0.3 * self.count if self.which == "ros2" else 1)
        assert min(received, sum(refused.values()) - lost) > self.count / 10
        assert grown < 40e6
        assert abs(told["place"][0] - 59.44) < 1.0
        assert abs(told["place"][1] - 10.47) < 1.0

    def close(self):
        for each in (self.flood, self.running):
            end(each)
        self.said.thread.join(5)
        self.flood.stdout.close()
        self.running.stdout.close()


@pytest.mark.parametrize(
    ("which", "count"), [("ros1", 100_000), ("ros2", 3000), pytest.param("ros2", 100_000, marks=pytest.mark.slow)]
)
def test_fuzzed_messages_over_ros_are_all_counted(which, count, request):
    if which == "ros1":
        environment = request.getfixturevalue("ros1")
        python, peer = sys.executable, "/usr/bin/python3"
        peer_environment = {**environment, "PYTHONPATH": environment["CONTROL_PATH"]}
    else:
        python, environment = request.getfixturevalue("ros2")
        peer, peer_environment = python, environment
    Fuzz(which, python, environment, peer, peer_environment, count).check()


# --- the network -----------------------------------------------------------------------------------------------------
@pytest.fixture
def cable():
    """A network of two ends on this machine: (address here, address there, what runs a command there, what pulls the cable)."""
    if os.geteuid() != 0 or shutil.which("ip") is None:
        pytest.skip("needs root and iproute2")
    name = f"usv{os.getpid() % 10000}"
    here, there = (f"10.213.{os.getpid() % 250}.{end}" for end in (1, 2))

    def ip(*arguments, check=True):
        subprocess.run(["ip", *arguments], check=check, capture_output=True)

    try:
        ip("netns", "add", name)
        ip("link", "add", name, "type", "veth", "peer", "name", "sea", "netns", name)
        ip("addr", "add", f"{here}/24", "dev", name)
        ip("-n", name, "addr", "add", f"{there}/24", "dev", "sea")
        ip("link", "set", name, "up")
        for device in ("sea", "lo"):
            ip("-n", name, "link", "set", device, "up")
    except subprocess.CalledProcessError as error:
        ip("netns", "delete", name, check=False)
        pytest.skip(f"no network of its own: {error.stderr.decode().strip()}")
    yield here, there, ["ip", "netns", "exec", name], lambda state: ip("link", "set", name, state)
    ip("link", "delete", name)
    ip("netns", "delete", name)


@pytest.mark.slow
@pytest.mark.parametrize("seconds", [3.0, 25.0], ids=["short", "longer than a lease"])
@pytest.mark.parametrize("transport", ["nmea", "ros1", "ros2"])
def test_a_pulled_cable_trips_the_fail_safe_and_control_comes_back(transport, seconds, cable, request, tmp_path):
    """Bridge and controller are on two ends of a network that is cut in between; nothing is started again."""
    here, there, run_there, pull = cable
    python, environment, control, master = sys.executable, {}, {}, None
    if transport == "nmea":
        options = ["-o", f"to={there}:10110", "-o", f"listen={here}:10111"]
        controller = [python, EXAMPLES / "nmea_controller.py", "--listen", f"{there}:10110", "--to", f"{here}:10111"]
    elif transport == "ros1":
        graph = request.getfixturevalue("ros1")
        environment = {**graph, "ROS_IP": here, "ROS_MASTER_URI": f"http://{here}:{free_port()}"}
        control = {**environment, "ROS_IP": there, "PYTHONPATH": graph["CONTROL_PATH"]}
        options, controller = ["--profile", "hilsim"], ["/usr/bin/python3", EXAMPLES / "ros1_controller.py"]
        master = start_master(environment)
    else:
        python, environment = request.getfixturevalue("ros2")
        environment = {**environment, "ROS_AUTOMATIC_DISCOVERY_RANGE": "SUBNET", "FASTDDS_DEFAULT_PROFILES_FILE": "",
                       "FASTDDS_BUILTIN_TRANSPORTS": "UDPv4"}  # fmt: skip
        control, options, controller = environment, ["--control", "heading_speed"], [python, EXAMPLES / "ros2_controller.py"]
    duel = Duel(bridge(python, environment, tmp_path, "--backend", transport, *options),
                lambda: spawn(*run_there, *controller, "--route", *ROUTE, env=control))  # fmt: skip
    try:
        duel.lost()
        duel.begin()
        pull("down")
        duel.lost()
        time.sleep(seconds)
        pull("up")
        duel.in_control()
        duel.finish()
    finally:
        duel.close(master)


# --- what starts them -----------------------------------------------------------------------------------------------
@pytest.mark.slow
def test_roslaunch_starts_the_bridge_as_a_node(ros1, tmp_path):
    """The launch file as docs/hil.md has it, without RViz; and a controller beside it."""
    roslaunch = shutil.which("roslaunch", path="/usr/bin:/opt/ros/noetic/bin")
    if roslaunch is None:
        pytest.skip("needs python3-roslaunch")
    (tmp_path / "usv-gym").write_text(f'#!/bin/sh\nexec {sys.executable} -m usv_gym.cli "$@"\n')
    (tmp_path / "usv-gym").chmod(0o755)
    settings = {**ros1, "ROS_PACKAGE_PATH": str(ROOT / "ros"), "PATH": f"{tmp_path}:{os.environ['PATH']}"}
    launch = spawn(roslaunch, ROOT / "ros" / "launch" / "usv_gym.launch", "rviz:=false", "more:=--duration 12", env=settings,
                   stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)  # fmt: skip
    control = {**ros1, "PYTHONPATH": ros1["CONTROL_PATH"]}
    controller = spawn("/usr/bin/python3", EXAMPLES / "ros1_controller.py", "--route", *ROUTE, env=control)
    try:
        text, _ = launch.communicate(timeout=90)
    finally:
        end(controller)
        end(launch)
    assert launch.returncode == 0, text
    assert "240 steps, 12.00 s simulated" in text
    assert int(re.search(r"received: input/actuators (\d+)", text)[1]) > 50


@pytest.mark.parametrize("name", ["ros1", "ros2"])
def test_compose_files_name_what_is_there(name):
    """Every path of the project in a compose file exists, and its `usv-gym hil` is one that the command line takes."""
    import yaml
    from typer.testing import CliRunner

    from usv_gym.cli.app import app
    from usv_gym.hil import serve

    services = yaml.safe_load((ROOT / "ros" / "compose" / f"{name}.yaml").read_text())["services"]
    assert {"bridge", "controller"} <= set(services)
    for service in services.values():
        (mount,) = (volume for volume in service["volumes"] if volume.startswith("../.."))
        assert mount == "../..:/usv_gym:ro"
        script = service["command"][-1]
        for path in re.findall(r"/usv_gym(/[\w./]+)", script):
            assert (ROOT / path[1:]).exists(), path
    started = {}
    line = re.search(r"usv-gym (hil .*)", services["bridge"]["command"][-1])[1].replace("/build/", "")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(serve, "serve", lambda mission, rig, **more: started.update(rig=rig, **more))
        done = CliRunner().invoke(app, line.split())
    assert done.exit_code == 0, done.output
    assert started["rig"].backend == name


@pytest.mark.slow
def test_rviz_shows_the_markers(ros1, tmp_path):
    """Under a virtual display: obstacles, ships, detections, track and thrust are on the screen."""
    from PIL import Image

    tools = [shutil.which(name) for name in ("rviz", "Xvfb", "import")]
    if None in tools:
        pytest.skip("needs rviz, xvfb and imagemagick")
    display = f":{60 + os.getpid() % 30}"
    settings = {
        **ros1,
        "DISPLAY": display,
        "LIBGL_ALWAYS_SOFTWARE": "1",
        "QT_X11_NO_MITSHM": "1",
        "XDG_RUNTIME_DIR": str(tmp_path),
    }
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    processes = [
        spawn(tools[1], display, "-screen", "0", "1280x900x24", "+extension", "GLX", "-nolisten", "tcp", **quiet)
    ]
    try:
        time.sleep(2.0)
        processes.append(spawn(tools[0], "-d", ROOT / "ros" / "rviz" / "usv.rviz", env=settings, **quiet))
        processes.append(bridge(sys.executable, ros1, tmp_path / "out", "--backend", "ros1", "--profile", "hilsim"))
        control = {**ros1, "PYTHONPATH": ros1["CONTROL_PATH"]}
        processes.append(spawn("/usr/bin/python3", EXAMPLES / "ros1_controller.py", "--route", *ROUTE, env=control))
        time.sleep(30.0)
        subprocess.run(
            [tools[2], "-display", display, "-window", "root", tmp_path / "shot.png"], check=True, timeout=30
        )
    finally:
        for process in reversed(processes):
            end(process)
        processes[2].stdout.close()
    pixels = np.asarray(Image.open(tmp_path / "shot.png").convert("RGB"))[70:860, 370:].reshape(-1, 3).astype(int)
    painted = {
        "obstacles": ((166, 204, 230), 2000),
        "ship": ((217, 77, 64), 300),
        "track": ((242, 217, 51), 100),
        "detections": ((37, 128, 80), 2000),
        "thrust": ((255, 128, 0), 20),
    }
    for what, (colour, least) in painted.items():
        count = np.count_nonzero(np.abs(pixels - colour).max(axis=1) < 30)
        assert count > least, (what, count)


# --- ROS 2 -----------------------------------------------------------------------------------------------------------
def test_ros2_lock_step_is_the_plain_environment_bit_for_bit(ros2, tmp_path):
    python, environment = ros2
    peer = spawn(python, TESTS / "hil_ros2_peer.py", env=environment)
    try:
        text = finish(bridge(python, environment, tmp_path, "--backend", "ros2", "--lock-step", "--interval", "0.05",
                             "--duration", "10"))  # fmt: skip
    finally:
        end(peer)
    print(text)
    check_lock_step(tmp_path)
    assert median_round_trip(text) < 20.0  # 5 ms on a quiet machine (benchmarks/hil.py)


def ros2_duel(python, environment, out, *more):
    """A bridge and the example controller that can be killed."""
    return Duel(
        bridge(python, environment, out, "--backend", "ros2", "--control", "heading_speed", "--realtime", "2",
               "--record", out / "run.mcap", *more),
        lambda: spawn(python, EXAMPLES / "ros2_controller.py", "--route", *ROUTE, env=environment),
    )  # fmt: skip


def test_ros2_survives_its_controller_and_its_network(ros2, tmp_path):
    """Real time: the controller is killed without a goodbye and started again; then nothing comes from it for a while."""
    duel = ros2_duel(*ros2, tmp_path)
    try:
        duel.lost()  # nobody is there yet
        duel.begin()
        duel.kill()
        duel.begin()
        duel.silence()
        duel.finish()
    finally:
        duel.close()
    check_fail_safes(tmp_path, "/cmd/heading_speed", duel.failures)
    assert "episode.usv" in duel.said.lines[-1]


def test_ros2_example_avoids_the_crossing_ship_and_a_bare_dds_peer_reads_along(ros2, tmp_path):
    """Real time, ten times as fast; CycloneDDS, another implementation of the protocol, reads what we publish."""
    python, environment = ros2
    running = bridge(python, environment, tmp_path, "--backend", "ros2", "--control", "heading_speed", "--realtime", "10",
                     "--duration", "110", "--start",
                     f"{python} {EXAMPLES / 'ros2_controller.py'} --route {' '.join(ROUTE)}")  # fmt: skip
    try:
        pytest.importorskip("cyclonedds")
        seen = json.loads(subprocess.run(
            [sys.executable, TESTS / "hil_dds_reader.py", environment["ROS_DOMAIN_ID"], "4"],
            capture_output=True, text=True, check=True, timeout=60).stdout)  # fmt: skip
        text = finish(running)
    finally:
        end(running)
    print(text)
    summary = json.loads((tmp_path / "summary.json").read_text())
    assert summary["collisions"] == []
    closest = {thing["name"]: thing["closest_m"] for thing in summary["objects"]}
    assert closest["coaster"] > 30.0
    episode = load(tmp_path / "episode.usv")
    assert len(seen["clock"]) > 20
    assert np.all(np.diff(seen["clock"]) > 0)
    assert len(seen["heading_speed"]) > 10
    rows = {round(t, 3): k for k, t in enumerate(episode.t.tolist())}
    origin, scale = episode.meta["origin"], episode.meta["metres_per_degree"]
    assert len(seen["fix"]) > 20
    for stamp, latitude, longitude in seen["fix"]:
        k = rows[round(stamp - episode.meta["epoch_us"] / 1e6, 3)]
        assert [(latitude - origin[0]) * scale[0], (longitude - origin[1]) * scale[1]] == pytest.approx(
            episode.nav[k, 1:3], abs=1e-5
        )
