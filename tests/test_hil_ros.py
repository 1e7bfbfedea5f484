"""ROS 1 and ROS 2 for real: bridge and controller in processes of their own, over the loopback.

Needs what ``ros/ros1_apt.sh`` installs, and an environment by ``ros/ros2_venv.sh`` in ``.ros2``, or where ``USV_GYM_ROS2``
says.
"""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
import time

import numpy as np
import pytest
from hil_helpers import EXAMPLES, ROOT, ROUTE, TESTS, bridge, end, expected, finish, spawn

from usv_gym.replay.archive import load
from usv_gym.run import resimulate

pytestmark = pytest.mark.usefixtures("compiled")
STEPS = 200


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


# --- what starts them ------------------------------------------------------------------------------------------------
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


def test_ros2_example_avoids_the_crossing_ship_and_a_bare_dds_peer_reads_along(ros2, tmp_path):
    """Real time, ten times as fast; CycloneDDS, another implementation of the protocol, reads what we publish."""
    python, environment = ros2
    running = bridge(python, environment, tmp_path, "--backend", "ros2", "--control", "heading_speed", "--realtime", "10",
                     "--duration", "85", "--start",
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
