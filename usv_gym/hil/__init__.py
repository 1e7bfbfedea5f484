"""Hardware in the loop: the same world in front of a real control system, over ROS 1, ROS 2 and NMEA (docs/hil.md)."""
