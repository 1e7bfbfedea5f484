"""Shared by all tests: where the recordings are, which ROS is here, and how to skip without them."""

from __future__ import annotations

import os
import subprocess
from pathlib import Path

import pytest

TESTS = Path(__file__).resolve().parent
#: real recordings; not part of the repository
DATA = TESTS.parents[1] / "shared" / "data"


@pytest.fixture(scope="session")
def data() -> Path:
    if not DATA.is_dir():
        pytest.skip("the recordings of ../shared/data are not here")
    return DATA


# --- what the bridge needs -------------------------------------------------------------------------------------------
@pytest.fixture(scope="module")
def compiled():
    """Kernels are on the disk before a process needs them within seconds."""
    from hil_helpers import memory_bridge

    bridge, _, _ = memory_bridge()
    bridge.step()


@pytest.fixture(scope="module")
def ros2():
    """Python of an environment with rclpy, and the variables that keep it on this machine."""
    python = Path(os.environ.get("USV_GYM_ROS2", TESTS.parent / ".ros2")) / "bin" / "python"
    if not python.is_file():
        pytest.skip("no ROS 2: ros/ros2_venv.sh .ros2 $(which python)")
    profile = TESTS.parent / "ros" / "fastdds_loopback.xml"
    return python, {
        "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST", "ROS_DOMAIN_ID": str(20 + os.getpid() % 80),
        "FASTDDS_DEFAULT_PROFILES_FILE": str(profile), "PYTHONPATH": str(TESTS),
    }  # fmt: skip


@pytest.fixture(scope="module")
def ros1(tmp_path_factory):
    """Environment of a graph with a master of its own, and Python classes built from the original's definitions."""
    if not Path("/usr/bin/rosmaster").exists() or not Path("/usr/lib/genpy/genmsg_py.py").exists():
        pytest.skip("no ROS 1: sudo ros/ros1_apt.sh")
    from hil_helpers import EXAMPLES, end, free_port, start_master

    home = tmp_path_factory.mktemp("ros1")
    subprocess.run([TESTS.parent / "ros" / "ros1_messages.sh", home / "messages"], check=True, capture_output=True)
    environment = {
        "ROS_MASTER_URI": f"http://127.0.0.1:{free_port()}", "ROS_IP": "127.0.0.1",
        "ROS_HOME": str(home), "ROS_LOG_DIR": str(home),
        "CONTROL_PATH": f"{home / 'messages'}:{TESTS}:{EXAMPLES}",
    }  # fmt: skip
    master = start_master(environment)
    yield environment
    end(master)
