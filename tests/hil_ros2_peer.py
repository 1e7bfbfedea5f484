"""A control process in ROS 2 for the tests: answers every step with commands that follow from its number."""

import contextlib

import rclpy
from hil_demand import demand
from rclpy.executors import ExternalShutdownException
from usv_gym_msgs.msg import Actuators, Status

rclpy.init()
node = rclpy.create_node("peer")
publisher = node.create_publisher(Actuators, "cmd/actuators", 100)


def step(message):
    rpm_s, rpm_p, rpm_b, nozzle_s, nozzle_p, bucket_s, bucket_p = demand(message.step)
    answer = Actuators(
        rpm=[rpm_s, rpm_p, rpm_b, 0.0], nozzle=[nozzle_s, nozzle_p, 0.0, 0.0], bucket=[bucket_s, bucket_p, 0.0, 0.0]
    )
    answer.header.stamp = message.header.stamp
    publisher.publish(answer)


node.create_subscription(Status, "hil/status", step, 100)
with contextlib.suppress(ExternalShutdownException, KeyboardInterrupt):
    rclpy.spin(node)
