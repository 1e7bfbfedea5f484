"""A control process in ROS 1 for the tests, with the original's messages: commands follow from the time of the odometry."""

import sys

import rospy
from hil_demand import demand
from nav_msgs.msg import Odometry
from simulator_messages.msg import ActuatorMessage

rospy.init_node("peer", disable_rostime=True)
publisher = rospy.Publisher("input/actuators", ActuatorMessage, queue_size=100, tcp_nodelay=True)
epoch_ns, tick_ns = int(sys.argv[1]), int(sys.argv[2])


def step(message):
    number = round((message.header.stamp.to_nsec() - epoch_ns) / tick_ns) + 1
    rpm_s, rpm_p, rpm_b, nozzle_s, nozzle_p, bucket_s, bucket_p = (100.0 * value for value in demand(number))
    publisher.publish(ActuatorMessage(message.header, rpm_s, rpm_p, nozzle_s, nozzle_p, bucket_s, bucket_p, rpm_b))


rospy.Subscriber("sensors/odom", Odometry, step, queue_size=100, tcp_nodelay=True)
rospy.spin()
