"""Reads ROS 2 topics as a bare DDS participant, by CycloneDDS: domain, seconds -> JSON on standard output."""

import json
import os
import sys
import time
from dataclasses import dataclass

# the other side's type objects of messages with arrays are of another opinion; names will do
os.environ["CYCLONEDDS_URI"] = (
    "<CycloneDDS><Domain>"
    "<General><Interfaces><NetworkInterface address='127.0.0.1'/></Interfaces><AllowMulticast>false</AllowMulticast></General>"
    "<Discovery><ParticipantIndex>auto</ParticipantIndex><Peers><Peer address='127.0.0.1'/></Peers></Discovery>"
    "<Compatibility><IgnoreTypeInformation>1.15</IgnoreTypeInformation></Compatibility></Domain></CycloneDDS>"
)
from cyclonedds.core import Policy, Qos
from cyclonedds.domain import DomainParticipant
from cyclonedds.idl import IdlStruct
from cyclonedds.idl.types import array, float64, int8, int32, uint8, uint16, uint32
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic
from cyclonedds.util import duration


@dataclass
class Time(IdlStruct, typename="builtin_interfaces::msg::dds_::Time_"):
    sec: int32
    nanosec: uint32


@dataclass
class Header(IdlStruct, typename="std_msgs::msg::dds_::Header_"):
    stamp: Time
    frame_id: str


@dataclass
class Clock(IdlStruct, typename="rosgraph_msgs::msg::dds_::Clock_"):
    clock: Time


@dataclass
class Status(IdlStruct, typename="sensor_msgs::msg::dds_::NavSatStatus_"):
    status: int8
    service: uint16


@dataclass
class Fix(IdlStruct, typename="sensor_msgs::msg::dds_::NavSatFix_"):
    header: Header
    status: Status
    latitude: float64
    longitude: float64
    altitude: float64
    position_covariance: array[float64, 9]
    position_covariance_type: uint8


@dataclass
class HeadingSpeed(IdlStruct, typename="usv_gym_msgs::msg::dds_::HeadingSpeed_"):
    header: Header
    heading: float64
    speed: float64


def seconds(stamp):
    return stamp.sec + stamp.nanosec / 1e9


participant = DomainParticipant(int(sys.argv[1]))
qos = Qos(Policy.Reliability.Reliable(duration(seconds=1)), Policy.History.KeepLast(100))
TOPICS = {
    "clock": ("rt/clock", Clock),
    "fix": ("rt/sensors/gps/gps/fix", Fix),
    "heading_speed": ("rt/cmd/heading_speed", HeadingSpeed),
}
readers = {
    name: DataReader(participant, Topic(participant, topic, cls, qos=qos), qos=qos)
    for name, (topic, cls) in TOPICS.items()
}
seen = {name: [] for name in readers}
until = time.monotonic() + float(sys.argv[2])
limit = time.monotonic() + 40
while time.monotonic() < until:
    for name, reader in readers.items():
        seen[name] += reader.take(N=100)
    if not seen["clock"] and time.monotonic() < limit:
        until = time.monotonic() + float(sys.argv[2])  # it begins when there is something to hear
    time.sleep(0.01)
print(json.dumps({
    "clock": [seconds(message.clock) for message in seen["clock"]],
    "fix": [[seconds(message.header.stamp), message.latitude, message.longitude] for message in seen["fix"]],
    "heading_speed": [[message.heading, message.speed] for message in seen["heading_speed"]],
}))  # fmt: skip
