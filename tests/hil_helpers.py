"""Shared by the tests of the bridge: missions, controllers in memory, processes, free ports."""

from __future__ import annotations

import os
import socket
import subprocess
import sys
import threading
import time
import xmlrpc.client
from pathlib import Path

from hil_demand import demand

from usv_gym.envs.single import ScenarioEnv
from usv_gym.hil.backends import make_backend
from usv_gym.hil.bridge import Bridge, plan_hil
from usv_gym.hil.external import ExternalController
from usv_gym.hil.link import Link
from usv_gym.hil.profile import load_profile

ROOT = Path(__file__).parents[1]
TESTS = Path(__file__).parent
EXAMPLES = ROOT / "examples" / "hil"
#: {n} of calm_crossing's waypoints: [250, 0] and [500, 60]
ROUTE = ("59.440019,10.471651", "59.442263,10.472709")


def free_port(kind=socket.SOCK_DGRAM):
    with socket.socket(socket.AF_INET, kind) as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


def expected(step):
    """The demand of a step as an action of Odin: starboard, port, bow."""
    rpm_s, rpm_p, rpm_b, nozzle_s, nozzle_p, bucket_s, bucket_p = demand(step)
    return [rpm_s, nozzle_s, bucket_s, rpm_p, nozzle_p, bucket_p, rpm_b]


def actuators(step, stamp):
    """A usv_gym_msgs/Actuators as nested dicts."""
    rpm_s, rpm_p, rpm_b, nozzle_s, nozzle_p, bucket_s, bucket_p = demand(step)
    return {"header": {"stamp": stamp}, "rpm": [rpm_s, rpm_p, rpm_b, 0.0], "nozzle": [nozzle_s, nozzle_p, 0.0, 0.0],
            "bucket": [bucket_s, bucket_p, 0.0, 0.0]}  # fmt: skip


def memory_bridge(
    *, profile="standard", scenario="calm_crossing", duration=5.0, answer=True, overrides=(), bridge=None, more=(), **control
):
    """A bridge over memory, in lock-step unless told otherwise, with a controller that answers every step."""
    wire = make_backend("memory")
    options = {key: control.pop(key) for key in ("trouble", "external", "seed", "factor", "control") if key in control}
    link = Link(load_profile(profile), [wire, *more], **options)
    made = Bridge(plan_hil(scenario, duration=duration, overrides=overrides), link, ExternalController(link, **control),
                  record=True, **(bridge or {}))  # fmt: skip
    seen = {}

    def listen(topic, message):
        seen.setdefault(topic, []).append(message)
        if topic == "hil/status" and answer:
            wire.send("cmd/actuators", actuators(message["step"], message["header"]["stamp"]))

    wire.listeners.append(listen)
    link.open()
    return made, wire, seen


def plain_env(episode):
    """The episode of the plain environment with the actions that the bridge logged: its world at the end."""
    env = ScenarioEnv(episode.meta["scenario"], action=episode.meta["task"]["action"], end_on_collision=False,
                      end_on_arrival=False, end_out_of_area=False)  # fmt: skip
    env.reset(seed=episode.meta["seed"])
    for action in episode.actions:
        env.step(action)
    return env.world


class Background:
    """A bridge that runs in a thread."""

    def __init__(self, bridge):
        self.bridge, self.report, self.error = bridge, None, None
        self.thread = threading.Thread(target=self._run)
        self.thread.start()

    def _run(self):
        try:
            self.report = self.bridge.run()
        except BaseException as error:
            self.error = error

    def join(self, timeout=60.0):
        self.thread.join(timeout)
        assert not self.thread.is_alive(), "the bridge does not end"
        if self.error is not None:
            raise self.error
        return self.report


def spawn(*command, env=None, **kwargs):
    """A process without the traces of ROS wheels."""
    environment = {**os.environ, **(env or {})}
    for name in ("_ROS_WHEELS_BOOTSTRAP_COMPLETE", "LD_LIBRARY_PATH"):
        environment.pop(name, None)
    return subprocess.Popen([str(part) for part in command], env=environment, **kwargs)


def example(name, *arguments, python=sys.executable, **kwargs):
    """One of the example controllers."""
    return spawn(python, EXAMPLES / name, "--route", *ROUTE, *arguments, **kwargs)


def end(process):
    if process.poll() is None:
        process.terminate()
        try:
            process.wait(5)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()


# --- ROS -------------------------------------------------------------------------------------------------------------
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


def finish(process, timeout=150):
    text, _ = process.communicate(timeout=timeout)
    assert process.returncode == 0, text
    return text


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
