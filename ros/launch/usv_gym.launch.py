"""ROS 2: the bridge and RViz.  `ros2 launch ros/launch/usv_gym.launch.py scenario:=calm_crossing more:="--record run.mcap"`."""

import shlex
from pathlib import Path

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, ExecuteProcess, OpaqueFunction
from launch.substitutions import LaunchConfiguration

RVIZ = Path(__file__).parents[1] / "rviz" / "usv_ros2.rviz"
ARGUMENTS = {"scenario": "calm_crossing", "profile": "standard", "control": "actuators", "realtime": "1.0", "more": "",
             "rviz": "true"}  # fmt: skip


def start(context):
    """The processes, with the arguments as given."""
    given = {name: LaunchConfiguration(name).perform(context) for name in ARGUMENTS}
    bridge = ["usv-gym", "hil", given["scenario"], "--backend", "ros2", "--profile", given["profile"],
              "--control", given["control"], "--realtime", given["realtime"], *shlex.split(given["more"])]  # fmt: skip
    processes = [ExecuteProcess(cmd=bridge, output="screen")]
    if given["rviz"].lower() == "true":
        processes.append(ExecuteProcess(cmd=["rviz2", "-d", str(RVIZ)]))
    return processes


def generate_launch_description():
    """What to start."""
    declared = [DeclareLaunchArgument(name, default_value=default) for name, default in ARGUMENTS.items()]
    return LaunchDescription([*declared, OpaqueFunction(function=start)])
