"""Floods the bridge over a real ROS with messages of the right type and the wrong content: ros1 or ros2, how many, its pid.

Every message is handed over to the transport, so that the bridge has to have counted all of them.  In ROS 1 the sender waits
for the bridge; in ROS 2 four of five come at a rate that its queues hold, and the rest all at once, which they do not.  Says as
JSON how many there were of each topic, what memory the bridge held before and after, and where GNSS then says that the ship is.
"""

import json
import math
import os
import random
import sys
import time

which, count, bridge = sys.argv[1], int(sys.argv[2]), sys.argv[3]
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
place = []


def number():
    return draw.choice(NUMBERS) if draw.random() < 0.7 else draw.uniform(-1e3, 1e3)


def resident():
    """Of the bridge [bytes]."""
    with open(f"/proc/{bridge}/statm") as file:
        return int(file.read().split()[1]) * os.sysconf("SC_PAGE_SIZE")


def heard(message):
    place[:] = message.latitude, message.longitude


if which == "ros2":
    import rclpy
    from rclpy.duration import Duration
    from rclpy.qos import HistoryPolicy, QoSProfile
    from rclpy.signals import SignalHandlerOptions
    from sensor_msgs.msg import NavSatFix
    from std_msgs.msg import Float64
    from usv_gym_msgs.msg import Actuators, Command

    rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    node = rclpy.create_node("fuzz")
    everything = QoSProfile(history=HistoryPolicy.KEEP_ALL)  # and reliable: nothing is lost on this side
    names = {"cmd/actuators": Actuators, "hil/command": Command, "thrusters/left/thrust": Float64}
    topics = {name: (cls, node.create_publisher(cls, name, everything)) for name, cls in names.items()}
    node.create_subscription(NavSatFix, "sensors/gps/gps/fix", heard, 100)
    resume = Command(command="resume"), "hil/command"

    def ready():
        return all(publisher.get_subscription_count() for _, publisher in topics.values())

    def publish(publisher, message):
        while True:
            try:
                return publisher.publish(message)
            except Exception as error:  # its history is full of what the bridge has not taken yet
                if "publish" not in str(error):
                    raise

    def done():
        assert all(publisher.wait_for_all_acked(Duration(seconds=60)) for _, publisher in topics.values())
        until = time.monotonic() + 1.0
        while time.monotonic() < until:
            rclpy.spin_once(node, timeout_sec=0.1)
else:
    import rospy
    from simulator_messages.msg import ActuatorMessage, Environment, Gps, obstacleCmd

    rospy.init_node("fuzz", disable_rostime=True)
    names = {"input/actuators": ActuatorMessage, "/simObject/command": obstacleCmd,
             "input/environment_communication": Environment}  # fmt: skip
    # without a queue it waits until the bridge has taken a message
    topics = {name: (cls, rospy.Publisher(name, cls, tcp_nodelay=True, queue_size=None)) for name, cls in names.items()}
    rospy.Subscriber("sensors/gps", Gps, heard, queue_size=100)
    resume = Environment(paused=False), "input/environment_communication"

    def ready():
        return all(publisher.get_num_connections() for _, publisher in topics.values())

    def publish(publisher, message):
        publisher.publish(message)

    def done():
        time.sleep(1.0)


def fill(message):
    names = message.get_fields_and_field_types() if which == "ros2" else message.__slots__
    for name in names:
        value = getattr(message, name)
        if isinstance(value, bool):
            setattr(message, name, draw.random() < 0.5)
        elif isinstance(value, float):
            setattr(message, name, number())
        elif isinstance(value, str):
            setattr(message, name, draw.choice(TEXTS))
        elif not hasattr(value, "stamp") and hasattr(value, "__len__"):
            setattr(message, name, [number() for _ in range(len(value))])
    return message


until = time.monotonic() + 30
while not ready():
    assert time.monotonic() < until, "nobody listens"
    time.sleep(0.05)
sent = dict.fromkeys(topics, 0)
began = time.monotonic()
for k in range(count):
    name = draw.choice(list(topics))
    cls, publisher = topics[name]
    publish(publisher, fill(cls()))
    sent[name] += 1
    if which == "ros2" and k % 20 == 0 and k < 0.8 * count:
        time.sleep(0.01)
    if k == count // 20:
        memory = [resident()]
message, name = resume
sent[name] += 1
publish(topics[name][1], message)
took = time.monotonic() - began
done()
memory.append(resident())
print(json.dumps({"sent": sent, "seconds": took, "memory": memory, "place": place}), flush=True)
