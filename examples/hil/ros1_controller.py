#!/usr/bin/env python3
"""A ROS 1 node in the messages of the original simulator: steers two waterjets, avoids what the TDM reports.

    rosmaster --core -p 11311 &
    usv-gym hil calm_crossing --backend ros1 --profile hilsim
    PYTHONPATH=messages /usr/bin/python3 ros1_controller.py --route 59.4400,10.4717 59.4422,10.4727

Needs rospy and the package simulator_messages, built by catkin or by ros/ros1_messages.sh.  It answers every sensors/odom.
"""

import argparse
import math

import rospy
from guidance import Guidance, Target, waypoint
from nav_msgs.msg import Odometry
from simulator_messages.msg import ActuatorMessage, detectedTarget

KNOT = 1852.0 / 3600.0


class Controller:
    def __init__(self, guidance):
        self.guidance = guidance
        self.targets = {}  # id -> (time, target)
        self.now = 0.0
        self.command = rospy.Publisher("input/actuators", ActuatorMessage, queue_size=100, tcp_nodelay=True)
        rospy.Subscriber("sensors/target_detection", detectedTarget, self.detected, queue_size=100, tcp_nodelay=True)
        rospy.Subscriber("sensors/odom", Odometry, self.step, queue_size=100, tcp_nodelay=True)

    def detected(self, message):
        north, east = self.guidance.local(message.latitude, message.longitude)
        target = Target(north, east, math.radians(message.COG), message.SOG * KNOT, max(message.radius, 10.0))
        self.targets[message.targetID] = self.now, target

    def step(self, message):
        self.now = message.header.stamp.to_sec()
        pose, motion = message.pose.pose, message.twist.twist
        north, east = self.guidance.local(pose.position.y, pose.position.x)  # degrees, as in the original
        heading = 2.0 * math.atan2(pose.orientation.z, pose.orientation.w)
        targets = [target for t, target in list(self.targets.values()) if self.now - t < 5.0]
        course, speed = self.guidance.steer(north, east, targets)
        error = (course - heading + math.pi) % (2.0 * math.pi) - math.pi
        nozzle = max(-100.0, min(100.0, 100.0 * (1.2 * error - 2.0 * motion.angular.z)))
        rpm = max(0.0, min(100.0, 12.0 * speed + 20.0 * (speed - motion.linear.x)))
        answer = ActuatorMessage(rightRPM=rpm, leftRPM=rpm, rightNozzle=nozzle, leftNozzle=nozzle)
        answer.header.stamp = message.header.stamp
        answer.rightDeflector = answer.leftDeflector = 100.0 if speed > 0.0 else 0.0
        self.command.publish(answer)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--route", nargs="+", type=waypoint, required=True, metavar="LAT,LON")
    parser.add_argument("--speed", type=float, default=5.0, help="[m/s]")
    arguments = parser.parse_args(rospy.myargv()[1:])
    rospy.init_node("example_controller", disable_rostime=True)
    Controller(Guidance(arguments.route, arguments.speed))
    rospy.spin()


if __name__ == "__main__":
    main()
