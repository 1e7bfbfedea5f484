"""ROS 2: the bridge and RViz.  `ros2 launch ros/launch/usv_gym.launch.py scenario:=calm_crossing`."""

from pathlib import Path

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, ExecuteProcess
from launch.conditions import IfCondition
from launch.substitutions import LaunchConfiguration

RVIZ = Path(__file__).parents[1] / "rviz" / "usv_ros2.rviz"
ARGUMENTS = {
    "scenario": "calm_crossing",
    "control": "actuators",
    "realtime": "1.0",
    "rviz": "true",
    "record": "run.mcap",
}


def generate_launch_description():
    """What to start."""
    value = {name: LaunchConfiguration(name) for name in ARGUMENTS}
    bridge = [
        "usv-gym", "hil", value["scenario"], "--backend", "ros2", "--profile", "standard", "--control", value["control"],
        "--realtime", value["realtime"], "--record", value["record"],
    ]  # fmt: skip
    return LaunchDescription(
        [
            *(DeclareLaunchArgument(name, default_value=default) for name, default in ARGUMENTS.items()),
            ExecuteProcess(cmd=bridge, output="screen"),
            ExecuteProcess(cmd=["rviz2", "-d", str(RVIZ)], condition=IfCondition(value["rviz"])),
        ]
    )
