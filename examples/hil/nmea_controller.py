#!/usr/bin/env python3
"""A controller that knows nothing but NMEA 0183: steers by RMC and HDT, avoids what TTM reports, asks with $PUSVH.

    usv-gym hil calm_crossing --backend nmea
    python nmea_controller.py --route 59.4400,10.4717 59.4422,10.4727

Needs nothing but Python.  It answers every $PUSVT, so the same program works in real time and in lock-step.
"""

import argparse
import contextlib
import math
import socket

from guidance import Guidance, Target, waypoint

KNOT = 1852.0 / 3600.0


def checksum(body):
    total = 0
    for byte in body.encode():
        total ^= byte
    return f"{total:02X}"


def fields_of(line):
    """Type and fields of a sentence with a good checksum, or nothing."""
    body, star, given = line.strip()[1:].partition("*")
    if star and checksum(body) == given.upper():
        return body.split(",")
    return []


def degrees(text, side):
    value = float(text)
    result = int(value / 100) + (value % 100) / 60
    return -result if side in "SW" else result


class Controller:
    def __init__(self, guidance):
        self.guidance = guidance
        self.position = None
        self.seen = {}  # number -> (time of the report, target)
        self.now = 0.0

    def hear(self, line):
        """Take a sentence in; returns the answer, if it wants one."""
        kind, *f = fields_of(line) or [""]
        if kind.endswith("RMC") and f[1] == "A":
            self.position = self.guidance.local(degrees(f[2], f[3]), degrees(f[4], f[5]))
        elif kind.endswith("TTM") and self.position:
            distance, bearing = float(f[1]) * 1852.0, math.radians(float(f[2]))
            course = math.radians(float(f[5])) if f[5] else 0.0
            speed = float(f[4]) * KNOT if f[4] else 0.0
            north = self.position[0] + distance * math.cos(bearing)
            east = self.position[1] + distance * math.sin(bearing)
            self.seen[f[0]] = self.now, Target(north, east, course, speed, radius=25.0)
        elif kind == "PUSVT":
            self.now = float(f[2])
            self.seen = {number: (t, target) for number, (t, target) in self.seen.items() if self.now - t < 5.0}
            if self.position:
                heading, speed = self.guidance.steer(*self.position, [target for _, target in self.seen.values()])
                body = f"PUSVH,{f[0]},{math.degrees(heading):.2f},{speed / KNOT:.2f}"
                return f"${body}*{checksum(body)}\r\n"
        return None


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--route", nargs="+", type=waypoint, required=True, metavar="LAT,LON")
    parser.add_argument("--speed", type=float, default=5.0, help="[m/s]")
    parser.add_argument("--listen", default="127.0.0.1:10110")
    parser.add_argument("--to", default="127.0.0.1:10111")
    arguments = parser.parse_args()
    (host, port), (to_host, to_port) = (text.rsplit(":", 1) for text in (arguments.listen, arguments.to))
    wire = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    wire.bind((host, int(port)))
    controller = Controller(Guidance(arguments.route, arguments.speed))
    while True:
        for line in wire.recv(65536).decode("ascii", "replace").splitlines():
            try:
                answer = controller.hear(line)
            except (ValueError, IndexError):
                continue
            if answer:
                wire.sendto(answer.encode(), (to_host, int(to_port)))


if __name__ == "__main__":
    with contextlib.suppress(KeyboardInterrupt):
        main()
