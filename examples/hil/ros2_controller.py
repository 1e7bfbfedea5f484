#!/usr/bin/env python3
"""A ROS 2 node that follows a route and avoids what the Target Detection Module reports.

    usv-gym hil calm_crossing --backend ros2 --profile standard --control heading_speed
    python ros2_controller.py --route 59.4400,10.4717 59.4422,10.4727

Needs rclpy and usv_gym_msgs.  It answers every hil/status, so the same node works in real time and in lock-step.
"""

import argparse
import contextlib
import math

import rclpy
from guidance import Guidance, Target, waypoint
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from sensor_msgs.msg import NavSatFix
from usv_gym_msgs.msg import HeadingSpeed, Status, Targets

DEPTH = 100


class Controller(Node):
    def __init__(self, guidance):
        super().__init__("example_controller")
        self.guidance = guidance
        self.position = None
        self.targets = []
        self.create_subscription(NavSatFix, "sensors/gps/gps/fix", self.fix, DEPTH)
        self.create_subscription(Targets, "sensors/targets", self.detected, DEPTH)
        self.create_subscription(Status, "hil/status", self.step, DEPTH)
        self.command = self.create_publisher(HeadingSpeed, "cmd/heading_speed", DEPTH)

    def fix(self, message):
        self.position = self.guidance.local(message.latitude, message.longitude)

    def detected(self, message):
        self.targets = []
        for target in message.targets:
            north, east = self.guidance.local(target.latitude, target.longitude)
            known = math.isfinite(target.cog) and math.isfinite(target.sog)
            course, speed = (target.cog, target.sog) if known else (0.0, 0.0)
            radius = target.radius if math.isfinite(target.radius) else 25.0
            self.targets.append(Target(north, east, course, speed, radius))

    def step(self, message):
        if self.position is None:
            return
        answer = HeadingSpeed()
        answer.header.stamp = message.header.stamp
        answer.heading, answer.speed = self.guidance.steer(*self.position, self.targets)
        self.command.publish(answer)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--route", nargs="+", type=waypoint, required=True, metavar="LAT,LON")
    parser.add_argument("--speed", type=float, default=5.0, help="[m/s]")
    arguments, ros = parser.parse_known_args()
    rclpy.init(args=ros)
    node = Controller(Guidance(arguments.route, arguments.speed))
    with contextlib.suppress(KeyboardInterrupt, ExternalShutdownException):
        rclpy.spin(node)


if __name__ == "__main__":
    main()
