"""What dies, falls silent or floods, over real ROS and NMEA: fail-safe, bridge alive, control again; every message counted.

Needs what tests/test_hil_ros.py needs.
"""

from __future__ import annotations

import json
import os
import re
import shutil
import signal
import subprocess
import sys
import time

import numpy as np
import pytest
from hil_helpers import EXAMPLES, ROUTE, TESTS, Lines, bridge, end, free_port, spawn, start_master
from test_hil_record import read

from usv_gym.replay.archive import load

pytestmark = pytest.mark.usefixtures("compiled")


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

    def through_death_and_silence(self):
        """Nobody is there yet; a controller comes, is killed and started again, then says nothing for a while."""
        self.lost()
        self.begin()
        self.kill()
        self.begin()
        self.silence()

    def finish(self):
        time.sleep(1.0)  # what came back last is told, and a busy machine may be behind its schedule
        self.running.send_signal(signal.SIGINT)
        assert self.running.wait(150) == 0  # what draws and judges may have to be compiled first

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
        duel.through_death_and_silence()
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
        duel.through_death_and_silence()
        duel.finish()
    finally:
        duel.close()
    check_fail_safes(tmp_path, "/cmd/heading_speed", duel.failures)
    assert "episode.usv" in duel.said.lines[-1]


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


# --- fuzz ------------------------------------------------------------------------------------------------------------
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
        self.flood = spawn(peer, TESTS / "hil_ros_fuzz.py", which, count, self.running.pid, env=peer_environment,
                           stdout=subprocess.PIPE, text=True)  # fmt: skip

    def check(self):
        """All are counted, memory does not grow, and the world goes on."""
        try:
            told = json.loads(self.flood.stdout.read())
            assert self.flood.wait(30) == 0
            self.running.send_signal(signal.SIGINT)
            assert self.running.wait(150) == 0  # what draws and judges may have to be compiled first
        finally:
            self.close()
        report = {line.partition(": ")[0]: line.partition(": ")[2] for line in self.said.lines}
        grown = told["memory"][1] - told["memory"][0]
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
    "counts", [{"ros1": 100_000, "ros2": 3000}, pytest.param({"ros2": 100_000}, marks=pytest.mark.slow)], ids=["short", "long"]
)
def test_fuzzed_messages_over_ros_are_all_counted(counts, request):
    runs, missing = [], ""
    try:
        for which, count in counts.items():  # side by side
            try:
                here = request.getfixturevalue(which)
            except pytest.skip.Exception as reason:
                missing = str(reason)
                continue
            python, environment = (sys.executable, here) if which == "ros1" else here
            peer = "/usr/bin/python3" if which == "ros1" else python
            control = {**environment, "PYTHONPATH": environment.get("CONTROL_PATH", str(TESTS))}
            runs.append(Fuzz(which, python, environment, peer, control, count))
        for run in runs:
            run.check()
    finally:
        for run in runs:
            run.close()
    if not runs:
        pytest.skip(missing)
