#!/usr/bin/env bash
# ROS 1 from Debian 12: rospy, a master and the message packages; and gpsd, which reads our NMEA stream in the tests.
# usage: sudo ros/ros1_apt.sh        (26 packages, 7 MB; no roscore: `rosmaster --core -p 11311` is one)
set -euo pipefail
apt-get update -qq
DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends \
    python3-rospy=1.15.* python3-rosmaster=1.15.* python3-genpy=0.6.* \
    python3-std-msgs python3-geometry-msgs python3-sensor-msgs python3-visualization-msgs \
    ros-std-msgs ros-geometry-msgs ros-sensor-msgs ros-nav-msgs ros-visualization-msgs gpsd=3.22-*
