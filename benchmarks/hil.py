"""The bridge in real time: drift, lateness and the round trip of a command, over each transport that is here.

    python benchmarks/hil.py                     # 10 minutes over ROS 2: dt 0.01 s, GNSS and commands 20 Hz, IMU 100 Hz
    python benchmarks/hil.py --seconds 60 --transports nmea ros1 ros2
    python benchmarks/hil.py --round-trips       # lock-step, 2000 steps over each transport
    python benchmarks/hil.py --fuzz ros1 ros2    # 100,000 messages of wrong content through the real transport

ROS needs what ros/ros1_apt.sh and ros/ros2_venv.sh (in .ros2, or USV_GYM_ROS2) leave.  Run it on a quiet machine.
"""

from __future__ import annotations

import argparse
import os
import re
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
TESTS = ROOT / "tests"
sys.path.insert(0, str(TESTS))

from hil_helpers import end, free_port, spawn  # noqa: E402

#: dt 0.01 s, IMU 100 Hz, GNSS 20 Hz
SCENARIO = ["calm_crossing", "--set", "simulation.dt=0.01"]
EPOCH_NS = 1496318400_000_000_000


class Rig:
    """A bridge and a control process over one transport."""

    def __init__(self, transport: str, directory: Path) -> None:
        self.transport, self.children = transport, []
        self.python, self.environment = sys.executable, {}
        if transport == "ros2":
            self.python = Path(os.environ.get("USV_GYM_ROS2", ROOT / ".ros2")) / "bin" / "python"
            self.environment = {"ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST", "ROS_DOMAIN_ID": "93", "PYTHONPATH": str(TESTS),
                                "FASTDDS_DEFAULT_PROFILES_FILE": str(ROOT / "ros" / "fastdds_loopback.xml")}  # fmt: skip
            self.peer = [self.python, TESTS / "hil_ros2_peer.py"]
            self.arguments = ["--backend", "ros2"]
        elif transport == "ros1":
            subprocess.run([ROOT / "ros" / "ros1_messages.sh", directory / "messages"], check=True, capture_output=True)
            port = free_port()
            self.environment = {"ROS_MASTER_URI": f"http://127.0.0.1:{port}", "ROS_IP": "127.0.0.1", "ROS_HOME": str(directory),
                                "ROS_LOG_DIR": str(directory)}  # fmt: skip
            self.children.append(spawn("/usr/bin/rosmaster", "--core", "-p", str(port), env=self.environment,
                                       stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL))  # fmt: skip
            time.sleep(2.0)
            self.peer = ["/usr/bin/env", f"PYTHONPATH={directory / 'messages'}:{TESTS}", "/usr/bin/python3",
                         TESTS / "hil_ros1_peer.py", str(EPOCH_NS), "10000000"]  # fmt: skip
            self.arguments = ["--backend", "ros1", "--profile", "hilsim"]
        else:
            out, back = free_port(), free_port()
            self.peer = [sys.executable, TESTS / "hil_nmea_peer.py", str(out), str(back)]
            self.arguments = [
                "--backend",
                "nmea",
                "--control",
                "actuators",
                "-o",
                f"to=127.0.0.1:{out}",
                "-o",
                f"listen=127.0.0.1:{back}",
            ]

    def run(self, *arguments: str) -> str:
        """Run until it ends; returns what the bridge says."""
        command = [self.python, "-m", "usv_gym.cli", "hil", *SCENARIO, *self.arguments, *arguments]
        bridge = spawn(*command, env=self.environment, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
        assert bridge.stdout is not None
        first = bridge.stdout.readline()  # it is set up
        self.children.append(spawn(*self.peer, env=self.environment))
        try:
            return first + bridge.communicate()[0]
        except KeyboardInterrupt:
            bridge.send_signal(signal.SIGINT)
            return first + bridge.communicate()[0]
        finally:
            self.close()

    def close(self) -> None:
        for child in self.children:
            end(child)
        self.children.clear()


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=float, default=600.0)
    parser.add_argument("--transports", nargs="+", default=["ros2"], choices=["nmea", "ros1", "ros2"])
    parser.add_argument("--round-trips", action="store_true", help="lock-step instead of real time")
    parser.add_argument("--fifo", action="store_true", help="with real-time scheduling")
    parser.add_argument("--fuzz", nargs="+", default=[], choices=["ros1", "ros2"])
    arguments = parser.parse_args()
    for transport in arguments.fuzz or arguments.transports:
        with tempfile.TemporaryDirectory() as directory:
            rig = Rig(transport, Path(directory))
            if arguments.fuzz:
                rig.peer = [
                    *rig.peer[: -1 if transport == "ros2" else -3],
                    TESTS / "hil_ros_fuzz.py",
                    transport,
                    "100000",
                ]
                text = rig.run("--realtime", "1", "--duration", "100")
            elif arguments.round_trips:
                text = rig.run("--lock-step", "--interval", "0.01", "--duration", "20")
            else:
                more = ["--fifo"] if arguments.fifo else []
                text = rig.run("--realtime", "1", "--interval", "0.05", "--duration", str(arguments.seconds), *more)
        print(f"--- {transport}: {os.cpu_count()} cores, load {os.getloadavg()[0]:.1f}\n{text}")
        if (
            not arguments.round_trips
            and not arguments.fuzz
            and (pace := re.search(r"([0-9.]+) times real time\n[^c]", text))
        ):
            print(f"mean rate off by {abs(float(pace[1]) - 1.0) * 100:.4f} %")


if __name__ == "__main__":
    main()
