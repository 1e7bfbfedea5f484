"""Floods the bridge's topics over a real ROS with messages of the right type and the wrong content: ros1 or ros2, how many."""

import math
import random
import sys
import time

which, count = sys.argv[1], int(sys.argv[2])
draw = random.Random(7)
NUMBERS = (math.nan, math.inf, -math.inf, 1e308, -1e308, 0.0, -1.0, 1e9)
TEXTS = (
    "",
    "spawn",
    "delete",
    "move",
    "reset",
    "pause",
    "resume",
    "x" * 2000,
    "\u00e5\u0000",
    '{"seed": 1e99}',
    "[",
    '{"waypoints": 1}',
)


def number():
    return draw.choice(NUMBERS) if draw.random() < 0.7 else draw.uniform(-1e3, 1e3)


if which == "ros2":
    import rclpy
    from std_msgs.msg import Float64
    from usv_gym_msgs.msg import Actuators, Command

    rclpy.init()
    node = rclpy.create_node("fuzz")
    topics = [(cls, node.create_publisher(cls, topic, 100)) for topic, cls in (
        ("cmd/actuators", Actuators), ("hil/command", Command), ("thrusters/left/thrust", Float64))]  # fmt: skip

    def ready():
        return all(publisher.get_subscription_count() for _, publisher in topics)
else:
    import rospy
    from simulator_messages.msg import ActuatorMessage, Environment, obstacleCmd

    rospy.init_node("fuzz", disable_rostime=True)
    topics = [(cls, rospy.Publisher(topic, cls, queue_size=1000, tcp_nodelay=True)) for topic, cls in (
        ("input/actuators", ActuatorMessage), ("/simObject/command", obstacleCmd),
        ("input/environment_communication", Environment))]  # fmt: skip

    def ready():
        return all(publisher.get_num_connections() for _, publisher in topics)


def fill(message):
    names = message.get_fields_and_field_types() if which == "ros2" else message.__slots__
    for name in names:
        value = getattr(message, name)
        if isinstance(value, bool):
            setattr(message, name, False)
        elif isinstance(value, float):
            setattr(message, name, number())
        elif isinstance(value, str):
            setattr(message, name, draw.choice(TEXTS))
        elif not hasattr(value, "stamp") and hasattr(value, "__len__"):
            setattr(message, name, [number() for _ in range(len(value))])
    return message


until = time.monotonic() + 30
while not ready() and time.monotonic() < until:
    time.sleep(0.05)
for k in range(count):
    cls, publisher = draw.choice(topics)
    publisher.publish(fill(cls()))
    if k % 20 == 0:
        time.sleep(0.004)  # a few thousand a second, which the transport can hold
if which == "ros2":
    topics[1][1].publish(Command(command="resume"))
time.sleep(2.0)
