"""A control process that measures: commands at every GNSS fix, and when each message of the IMU and of GNSS arrived.

    hil_listener.py TRANSPORT OUT.json [PORT IN, PORT OUT of NMEA]

Imports nothing of usv_gym, and runs until it is ended.  ``rates`` is also what the benchmark says of its own process.
"""

import itertools
import json
import os
import signal
import socket
import sys
import time

SETTLED = 5.0  #: [s] after the first message from which arrivals count: connections come one after the other


def percentile(values, share):
    ordered = sorted(values)
    return ordered[min(int(share * len(ordered)), len(ordered) - 1)]


def rates(arrivals, nominal):
    """Of arrival times [s] of a topic of so many [Hz]: mean rate, how the offset from the schedule moved, gaps [ms]."""
    arrivals = [t for t in arrivals if t > arrivals[0] + SETTLED]
    if len(arrivals) < 20:
        return {"messages": len(arrivals)}
    gaps = [1e3 * (b - a) for a, b in itertools.pairwise(arrivals)]
    rate = (len(arrivals) - 1) / (arrivals[-1] - arrivals[0])
    offsets = [t - k / nominal for k, t in enumerate(arrivals)]
    tenth = len(offsets) // 10
    drift = percentile(offsets[-tenth:], 0.5) - percentile(offsets[:tenth], 0.5)
    return {
        "messages": len(arrivals), "rate_Hz": rate, "off_percent": 100.0 * abs(rate / nominal - 1.0), "drift_ms": 1e3 * drift,
        "gap_ms": {"median": percentile(gaps, 0.5), "p99": percentile(gaps, 0.99), "worst": max(gaps)},
    }  # fmt: skip


def main():
    transport, out, *ports = sys.argv[1:]
    imu, gnss = [], []

    def ended(*_):
        with open(out, "w") as file:
            json.dump({"imu": rates(imu, 100.0), "gnss": rates(gnss, 20.0)}, file)
        os._exit(0)

    def heard_imu(_=None):
        imu.append(time.perf_counter())

    if transport == "ros2":
        import rclpy
        from rclpy.signals import SignalHandlerOptions
        from sensor_msgs.msg import Imu, NavSatFix
        from usv_gym_msgs.msg import Actuators

        rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
        signal.signal(signal.SIGTERM, ended)
        node = rclpy.create_node("listener")
        publisher = node.create_publisher(Actuators, "cmd/actuators", 100)

        def heard_gnss(_):
            gnss.append(time.perf_counter())
            publisher.publish(Actuators(rpm=[0.5, 0.5, 0.0, 0.0], bucket=[1.0, 1.0, 0.0, 0.0]))

        node.create_subscription(Imu, "sensors/imu/imu/data", heard_imu, 1000)
        node.create_subscription(NavSatFix, "sensors/gps/gps/fix", heard_gnss, 1000)
        while True:
            rclpy.spin_once(node, timeout_sec=0.5)
    elif transport == "ros1":
        import rospy
        from geometry_msgs.msg import Twist
        from simulator_messages.msg import ActuatorMessage, Gps

        rospy.init_node("listener", disable_rostime=True, disable_signals=True)
        signal.signal(signal.SIGTERM, ended)
        publisher = rospy.Publisher("input/actuators", ActuatorMessage, queue_size=100, tcp_nodelay=True)

        def heard_gps(_):
            gnss.append(time.perf_counter())
            publisher.publish(ActuatorMessage(rightRPM=50, leftRPM=50, rightDeflector=100, leftDeflector=100))

        rospy.Subscriber("sensors/imu", Twist, heard_imu, queue_size=1000, tcp_nodelay=True)
        rospy.Subscriber("sensors/gps", Gps, heard_gps, queue_size=1000, tcp_nodelay=True)
        while True:
            signal.pause()
    else:
        signal.signal(signal.SIGTERM, ended)
        wire = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        wire.bind(("127.0.0.1", int(ports[0])))
        body = b"PUSVH,,10.0,8.0"
        total = 0
        for byte in body:
            total ^= byte
        command = b"$%s*%02X\r\n" % (body, total)
        while True:
            for line in wire.recv(65536).splitlines():
                if line.startswith(b"$GPROT"):
                    heard_imu()
                elif line.startswith(b"$GPGGA"):
                    gnss.append(time.perf_counter())
                    wire.sendto(command, ("127.0.0.1", int(ports[1])))


if __name__ == "__main__":
    main()
