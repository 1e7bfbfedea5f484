"""Unit conversions at the edges; inside, everything is SI and radians."""

from __future__ import annotations

import math

KNOT = 1852.0 / 3600.0  #: metres per second in one knot
DEG = math.pi / 180.0  #: radians in one degree
DEG_PER_MIN = DEG / 60.0  #: rad/s in one degree per minute (the unit of AIS rate of turn)

#: WGS-84 semi-major axis [m] and first eccentricity squared
WGS84_A = 6378137.0
WGS84_E2 = 0.0818191908426215**2


def metres_per_degree(latitude_deg: float) -> tuple[float, float]:
    """Length of one degree of latitude and of longitude [m] on WGS-84 at a latitude.

    Meridian radius M = a (1 - e^2) / (1 - e^2 sin^2)^1.5 and prime-vertical radius N = a / (1 - e^2 sin^2)^0.5
    (Fossen 2021, section 2.5).  The local tangent plane {n} of a world uses the values at its origin throughout.
    """
    s2 = math.sin(latitude_deg * DEG) ** 2
    w = math.sqrt(1.0 - WGS84_E2 * s2)
    return (
        WGS84_A * (1.0 - WGS84_E2) / w**3 * DEG,
        WGS84_A / w * math.cos(latitude_deg * DEG) * DEG,
    )


def wrap_360(angle_deg: float) -> float:
    """Angle [deg] wrapped to [0, 360)."""
    wrapped = angle_deg % 360.0
    return 0.0 if wrapped >= 360.0 else wrapped
