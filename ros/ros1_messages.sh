#!/usr/bin/env bash
# Python classes of the project's ROS 1 messages, without catkin: simulator_messages and usv_gym_msgs.
# usage: ros/ros1_messages.sh DIRECTORY, then put DIRECTORY on PYTHONPATH.  Needs python3-genpy and ros-std-msgs.
# nav_msgs is generated as well: Debian's python3-nav-msgs would bring all of boost.
set -euo pipefail
out="$1" here="$(cd "$(dirname "$0")" && pwd)"
std="-Istd_msgs:/usr/share/std_msgs/msg -Igeometry_msgs:/usr/share/geometry_msgs/msg -Inav_msgs:/usr/share/nav_msgs/msg"
generate() {  # PACKAGE DIRECTORY MESSAGE..
    local package="$1" from="$2"
    shift 2
    mkdir -p "$out/$package/msg"
    touch "$out/$package/__init__.py"
    # shellcheck disable=SC2086
    /usr/bin/python3 /usr/lib/genpy/genmsg_py.py -p "$package" "-I$package:$from" $std -o "$out/$package/msg" "${@/#/$from/}"
    /usr/bin/python3 /usr/lib/genpy/genmsg_py.py --initpy -p "$package" -o "$out/$package/msg"
}
for package in simulator_messages usv_gym_msgs; do
    # shellcheck disable=SC2046
    generate $package "$here/$package/msg" $(cd "$here/$package/msg" && ls)
done
generate nav_msgs /usr/share/nav_msgs/msg Odometry.msg Path.msg
