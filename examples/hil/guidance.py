"""Guidance of the example controllers: go to the waypoints, and around what is in the way.  Needs nothing but Python.

North and east in metres from the first waypoint, angles in radians clockwise from north, speeds in m/s.
"""

import math
from dataclasses import dataclass

METRES_PER_DEGREE = 111_200.0
CLEARANCE = 60.0  # to the edge of a target
HORIZON = 120.0  # [s]
OFFSETS = [math.radians(a) for a in (0, 15, -15, 30, -30, 45, -45, 60, -60, 75, -75, 90, -90)]


@dataclass
class Target:
    north: float
    east: float
    course: float = 0.0
    speed: float = 0.0
    radius: float = 10.0


class Guidance:
    """Waypoints are (latitude, longitude)."""

    def __init__(self, route, speed, acceptance=15.0):
        self.origin = route[0]
        self.scale = METRES_PER_DEGREE, METRES_PER_DEGREE * math.cos(math.radians(route[0][0]))
        self.route = [self.local(*place) for place in route]
        self.speed, self.acceptance = speed, acceptance
        self.start = None  # of the present leg
        self.last = 0.0  # deviation from the course to the waypoint that was chosen last

    def local(self, latitude, longitude):
        return (latitude - self.origin[0]) * self.scale[0], (longitude - self.origin[1]) * self.scale[1]

    def steer(self, north, east, targets):
        """Heading and speed to ask for; the speed is 0 once the last waypoint is reached."""
        self.start = self.start or (north, east)
        while self.route and self.reached(north, east):
            self.start = self.route.pop(0)
        if not self.route:
            return 0.0, 0.0
        wanted = math.atan2(self.route[0][1] - east, self.route[0][0] - north)

        def price(offset):
            gap = min((self.gap(north, east, wanted + offset, target) for target in targets), default=math.inf)
            danger = max(0.0, 1.0 - gap / CLEARANCE)
            port = 0.4 if offset < 0.0 else 0.0  # Rule 14 and 15: rather to starboard
            return 20.0 * danger + abs(offset) + port + 0.4 * abs(offset - self.last)

        self.last = min(OFFSETS, key=price)
        return (wanted + self.last) % (2.0 * math.pi), self.speed

    def reached(self, north, east):
        """Near the waypoint, or past it: beyond the line through it across the leg."""
        dn, de = self.route[0][0] - north, self.route[0][1] - east
        leg_n, leg_e = self.route[0][0] - self.start[0], self.route[0][1] - self.start[1]
        return math.hypot(dn, de) < self.acceptance or dn * leg_n + de * leg_e < 0.0

    def gap(self, north, east, heading, target):
        """Distance to the edge of a target at the closest point within the horizon, on a straight course."""
        dn, de = target.north - north, target.east - east
        vn = target.speed * math.cos(target.course) - self.speed * math.cos(heading)
        ve = target.speed * math.sin(target.course) - self.speed * math.sin(heading)
        v2 = vn * vn + ve * ve
        t = min(max(-(dn * vn + de * ve) / v2, 0.0), HORIZON) if v2 > 1e-9 else 0.0
        return math.hypot(dn + t * vn, de + t * ve) - target.radius


def waypoint(text):
    """59.44,10.47"""
    latitude, longitude = text.split(",")
    return float(latitude), float(longitude)
