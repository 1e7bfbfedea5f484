"""The bridge in real time, and the round trip of a command in lock-step, over each transport that is here.

    python benchmarks/hil.py                     # 10 minutes over each: dt 0.01 s, GNSS and commands 20 Hz, IMU 100 Hz
    python benchmarks/hil.py --seconds 60 --transports nmea ros1 ros2
    python benchmarks/hil.py --round-trips       # lock-step, 2000 steps over each transport

Mean rates and drift are those that a listener in a process of its own measured (memory: a function of the same process);
lateness is the bridge's own.  NMEA has no sentence for an IMU; its rate of turn goes at 100 Hz instead.  ROS needs what
ros/ros1_apt.sh and ros/ros2_venv.sh (in .ros2, or USV_GYM_ROS2) leave.  Writes results/hil.json after each transport.
"""

from __future__ import annotations

import argparse
import json
import os
import re
import subprocess
import sys
import tempfile
import time
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import yaml
from measure import RESULTS, machine, save

HERE = Path(__file__).resolve().parent
ROOT = HERE.parent
TESTS = ROOT / "tests"
sys.path.insert(0, str(TESTS))

from hil_helpers import end, free_port, memory_bridge, spawn  # noqa: E402
from hil_listener import rates  # noqa: E402

#: dt 0.01 s, IMU 100 Hz, GNSS 20 Hz
DT = "simulation.dt=0.01"
EPOCH_NS = 1496318400_000_000_000
TRANSPORTS = ("memory", "nmea", "ros1", "ros2")


class Rig:
    """A bridge and a control process over one transport, each in a process of its own."""

    def __init__(self, transport: str, directory: Path) -> None:
        self.transport, self.directory = transport, directory
        self.children: list[Any] = []
        self.python, self.environment = sys.executable, {}
        self.out = directory / "listener.json"
        if transport == "ros2":
            self.python = str(Path(os.environ.get("USV_GYM_ROS2", ROOT / ".ros2")) / "bin" / "python")
            self.environment = {"ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST", "ROS_DOMAIN_ID": "93", "PYTHONPATH": str(TESTS),
                                "FASTDDS_DEFAULT_PROFILES_FILE": str(ROOT / "ros" / "fastdds_loopback.xml")}  # fmt: skip
            self.arguments = ["--backend", "ros2"]
            self.peer = [self.python, TESTS / "hil_ros2_peer.py"]
            self.listener = [self.python, HERE / "hil_listener.py", transport, self.out]
        elif transport == "ros1":
            subprocess.run([ROOT / "ros" / "ros1_messages.sh", directory / "messages"], check=True, capture_output=True)
            port = free_port()
            self.environment = {"ROS_MASTER_URI": f"http://127.0.0.1:{port}", "ROS_IP": "127.0.0.1", "ROS_HOME": str(directory),
                                "ROS_LOG_DIR": str(directory)}  # fmt: skip
            self.children.append(spawn("/usr/bin/rosmaster", "--core", "-p", str(port), env=self.environment,
                                       stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL))  # fmt: skip
            time.sleep(2.0)
            self.arguments = ["--backend", "ros1", "--profile", "hilsim"]
            python = ["/usr/bin/env", f"PYTHONPATH={directory / 'messages'}:{TESTS}", "/usr/bin/python3"]
            self.peer = [*python, TESTS / "hil_ros1_peer.py", str(EPOCH_NS), "10000000"]
            self.listener = [*python, HERE / "hil_listener.py", transport, self.out]
        else:
            out, back = str(free_port()), str(free_port())
            self.arguments = ["--backend", "nmea", "-o", f"to=127.0.0.1:{out}", "-o", f"listen=127.0.0.1:{back}"]
            self.peer = [sys.executable, TESTS / "hil_nmea_peer.py", out, back]
            self.listener = [sys.executable, HERE / "hil_listener.py", transport, self.out, out, back]

    def run(self, peer: list[Any], *arguments: str) -> str:
        """Run until it ends; returns what the bridge says."""
        command = [self.python, "-m", "usv_gym.cli", "hil", "calm_crossing", "--set", DT, *self.arguments, *arguments]
        bridge = spawn(*command, env=self.environment, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
        assert bridge.stdout is not None
        first = bridge.stdout.readline()  # it is set up
        self.children.append(spawn(*peer, env=self.environment))
        try:
            text = first + bridge.communicate()[0]
        finally:
            for child in (bridge, *reversed(self.children)):
                end(child)
        assert bridge.returncode == 0, text
        return text

    def real_time(self, seconds: float, *more: str) -> tuple[str, dict[str, Any]]:
        """What the bridge says, and what the listener measured."""
        if self.transport == "nmea":
            profile = yaml.safe_load((ROOT / "configs" / "profiles" / "nmea.yaml").read_text())
            for row in profile["rows"]:
                row.update({"GGA": {"rate": 20}, "ROT": {"rate": 100}}.get(row["topic"], {}))
            (self.directory / "fast.yaml").write_text(yaml.safe_dump(profile))
            more = (*more, "--profile", str(self.directory / "fast.yaml"))
        duration = ("--realtime", "1", "--interval", "0.05", "--duration", str(seconds))
        return self.run(self.listener, *duration, *more), json.loads(self.out.read_text())


def memory_real_time(seconds: float) -> tuple[str, dict[str, Any]]:
    """The same with the controller in this process."""
    bridge, wire, _ = memory_bridge(duration=seconds, overrides=[DT], answer=False, lock_step=False, interval=5,
                                    bridge={"realtime": 1.0})  # fmt: skip
    heard: dict[str, list[float]] = {"sensors/imu/imu/data": [], "sensors/gps/gps/fix": []}

    def listen(topic: str, message: Any) -> None:
        if topic in heard:
            heard[topic].append(time.perf_counter())
        if topic == "sensors/gps/gps/fix":
            wire.send("cmd/actuators", {"header": {"stamp": 0}, "rpm": [0.5] * 4, "nozzle": [0.0] * 4, "bucket": [1.0] * 4})

    wire.listeners[:] = [listen]
    bridge.run()
    imu, gnss = heard.values()
    return "\n".join(bridge.report().lines()), {"imu": rates(imu, 100.0), "gnss": rates(gnss, 20.0)}


def memory_round_trips() -> str:
    """Lock-step with a controller in this process."""
    bridge, _, _ = memory_bridge(duration=20.0, overrides=[DT])
    return "\n".join(bridge.run().lines())


def figures(text: str) -> dict[str, Any]:
    """Of a report of the bridge."""
    result: dict[str, Any] = {}
    for name in ("lateness", "round trip"):
        if found := re.search(name + r" \[ms\]: median ([0-9.]+)  95 % ([0-9.]+)  99 % ([0-9.]+)  worst ([0-9.]+)", text):
            values = map(float, found.groups())
            result[f"{name.replace(' ', '_')}_ms"] = dict(zip(("median", "p95", "p99", "worst"), values, strict=True))
    if found := re.search(r"in ([0-9.]+) s: ([0-9.]+) times real time", text):
        result |= {"elapsed_s": float(found[1]), "pace": float(found[2])}
    found = re.search(r"overruns (\d+), schedule begun anew (\d+), fail-safe (\d+)", text)
    names = ("overruns", "begun_anew", "failsafes")
    return result | dict(zip(names, map(int, found.groups()) if found else (0, 0, 0), strict=True))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=float, default=600.0)
    parser.add_argument("--transports", nargs="+", default=TRANSPORTS, choices=TRANSPORTS)
    parser.add_argument("--round-trips", action="store_true", help="lock-step instead of real time")
    parser.add_argument("--fifo", action="store_true", help="with real-time scheduling (not over memory)")
    given = parser.parse_args()
    kind = "round_trips" if given.round_trips else "real_time"
    for transport in given.transports:
        load = os.getloadavg()[0]
        began = datetime.now(UTC).isoformat(timespec="minutes")
        with tempfile.TemporaryDirectory() as directory:
            heard: dict[str, Any] = {}
            if transport == "memory":
                text, heard = (memory_round_trips(), {}) if given.round_trips else memory_real_time(given.seconds)
            elif given.round_trips:
                rig = Rig(transport, Path(directory))
                control = ["--control", "actuators"] if transport == "nmea" else []
                text = rig.run(rig.peer, "--lock-step", "--interval", "0.01", "--duration", "20", *control)
            else:
                rig = Rig(transport, Path(directory))
                text, heard = rig.real_time(given.seconds, *(["--fifo"] if given.fifo else []))
        print(f"--- {transport}: {os.cpu_count()} cores, load {load:.1f} before, {os.getloadavg()[0]:.1f} after\n{text}")
        for topic, measured in heard.items():
            print(f"{topic} as heard: {measured}")
        path = RESULTS / "hil.json"
        results = json.loads(path.read_text()) if path.is_file() else {}
        results["machine"] = {key: value for key, value in machine().items() if key != "load"}
        results.setdefault(kind, {})[transport] = {
            "began": began, "load_before": round(load, 2), "load_after": round(os.getloadavg()[0], 2), "fifo": given.fifo,
            **figures(text), **heard,
        }  # fmt: skip
        save("hil.json", results)


if __name__ == "__main__":
    main()
