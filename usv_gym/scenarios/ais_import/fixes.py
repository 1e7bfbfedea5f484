"""What a reader hands over: position fixes and ship particulars of the chosen place and time, and a tally of all the rest.

Only what lies in the selection is kept, in compact columns, so that memory follows the traffic of the scene and not the size
of the files.
"""

from __future__ import annotations

import math
from array import array
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from datetime import UTC, datetime

import numpy as np
from numpy.typing import NDArray

from ...units import metres_per_degree

NAN = math.nan
#: columns of a fix: UTC [s since 1970], latitude, longitude [deg], SOG [kn], COG, true heading [deg]; NaN: not available
COLUMNS = ("t", "latitude", "longitude", "sog", "cog", "heading")

#: called now and then with (bytes read, bytes in all)
Progress = Callable[[int, int], None]


@dataclass(frozen=True)
class Selection:
    """A circle on the sea and a span of time; ``start`` and ``end`` are UTC [s since 1970]."""

    latitude: float  # [deg]
    longitude: float  # [deg]
    radius: float  # [m]
    start: float = -math.inf
    end: float = math.inf

    @property
    def scale(self) -> tuple[float, float]:
        """Metres per degree of latitude and of longitude at the centre."""
        return metres_per_degree(self.latitude)

    def local(self, latitude: float, longitude: float) -> tuple[float, float]:
        """North, east of the centre [m]."""
        north, east = self.scale
        turn = (longitude - self.longitude + 180.0) % 360.0 - 180.0  # the short way round, also across the date line
        return (latitude - self.latitude) * north, turn * east

    def __str__(self) -> str:
        return f"{self.radius:g} m around {self.latitude:g}, {self.longitude:g}"


@dataclass
class Particulars:
    """What a ship says about itself; what is unknown is empty, 0 or None."""

    name: str = ""
    length: float = 0.0  # [m]
    beam: float = 0.0  # [m]
    ais_class: str = ""  # A or B

    def update(self, name: str = "", length: float = 0.0, beam: float = 0.0, ais_class: str = "") -> None:
        """Take over what is known; the latest word counts."""
        self.name = name or self.name
        self.length, self.beam = length or self.length, beam or self.beam
        self.ais_class = ais_class or self.ais_class


class Fixes:
    """Fixes of one station, a compact column for each of ``COLUMNS``."""

    def __init__(self) -> None:
        self.columns = tuple(array("d") for _ in COLUMNS)

    def add(self, *fix: float) -> None:
        """Append one fix, in the order of ``COLUMNS``."""
        for column, value in zip(self.columns, fix, strict=True):
            column.append(value)

    def __len__(self) -> int:
        return len(self.columns[0])

    def table(self) -> NDArray[np.float64]:
        """[n, 6] in the order of ``COLUMNS``, by time."""
        table = np.array(self.columns, float).T.reshape(-1, len(COLUMNS))
        return table[np.argsort(table[:, 0], kind="stable")]


@dataclass
class Harvest:
    """Everything that was found: ``ships`` by MMSI within the selection, ``own`` the fixes of the receiver itself."""

    selection: Selection
    #: what stations say about themselves, by MMSI; of NMEA logs also those without a fix in the selection
    particulars: dict[int, Particulars] = field(default_factory=dict)
    ships: dict[int, Fixes] = field(default_factory=dict)
    own: Fixes = field(default_factory=Fixes)
    #: MMSI whose fixes are wanted wherever they are (the own ship's)
    everywhere: int | None = None
    lines: int = 0  #: read, in all files
    fixes: int = 0  #: position reports of ships that could be read, in all files
    odd: Counter[str] = field(default_factory=Counter)  #: what was strange, and how often
    first: float = math.inf  #: time of the earliest fix anywhere
    last: float = -math.inf
    box: list[float] = field(default_factory=lambda: [90.0, -90.0, 180.0, -180.0])  #: south, north, west, east of all fixes
    first_here: float = math.inf  #: time of the earliest fix in the circle
    first_own: float = math.inf  #: time of the earliest fix of the own ship

    def __post_init__(self) -> None:
        s = self.selection
        self._scale = s.scale
        self._limit = s.radius**2
        self._near = s.radius / self._scale[0]  # [deg] of latitude

    def add(self, mmsi: int, t: float, latitude: float, longitude: float, sog: float, cog: float, heading: float) -> bool:
        """Look at one fix of a ship; keep it if it is wanted.  Numbers as in ``COLUMNS``, with the sentinels of the wire.

        A fix without a position (latitude 91, longitude 181) is counted and left.
        """
        if not (-90.0 <= latitude <= 90.0 and -180.0 <= longitude <= 180.0):
            self.odd["fixes without a position"] += 1
            return False
        self.fixes += 1
        box = self.box
        if latitude < box[0]:
            box[0] = latitude
        if latitude > box[1]:
            box[1] = latitude
        if longitude < box[2]:
            box[2] = longitude
        if longitude > box[3]:
            box[3] = longitude
        if t < self.first:
            self.first = t
        if t > self.last:
            self.last = t
        s = self.selection
        if mmsi == self.everywhere:
            self.first_own = min(self.first_own, t)
        else:
            north = latitude - s.latitude
            if north > self._near or -north > self._near:
                return False
            north *= self._scale[0]
            east = ((longitude - s.longitude + 180.0) % 360.0 - 180.0) * self._scale[1]
            if north * north + east * east > self._limit:
                return False
            if t < self.first_here:
                self.first_here = t
        if not s.start <= t <= s.end:
            return False
        if mmsi not in self.ships:
            self.ships[mmsi] = Fixes()
        self.ships[mmsi].add(t, latitude, longitude, *motion(sog, cog, heading))
        return True

    def add_own(self, t: float, latitude: float, longitude: float, sog: float, cog: float, heading: float) -> None:
        """Keep a fix of the own ship, wherever it is."""
        if abs(latitude) <= 90.0 and abs(longitude) <= 180.0:
            self.first_own = min(self.first_own, t)
            if self.selection.start <= t <= self.selection.end:
                self.own.add(t, latitude, longitude, *motion(sog, cog, heading))

    def about(self, mmsi: int) -> Particulars:
        """The particulars of a station, to be filled."""
        found = self.particulars.get(mmsi)
        if found is None:
            found = self.particulars[mmsi] = Particulars()
        return found

    def extent(self) -> str:
        """What the files hold, in words."""
        south, north, west, east = self.box
        return (f"the files hold fixes from {utc(self.first)} to {utc(self.last)}, "
                f"latitude {south:.3f} to {north:.3f}, longitude {west:.3f} to {east:.3f}")  # fmt: skip


def motion(sog: float, cog: float, heading: float) -> tuple[float, float, float]:
    """SOG, COG and heading with the "not available" of the wire (102.3, 360, 511) as NaN."""
    return (sog if 0.0 <= sog < 102.25 else NAN, cog if 0.0 <= cog < 360.0 else NAN,
            heading if 0.0 <= heading < 360.0 else NAN)  # fmt: skip


def is_ship(mmsi: int) -> bool:
    """True for the MMSI of a ship or of a craft associated with one (ITU-R M.585); not for stations ashore, aids, aircraft."""
    return 201_000_000 <= mmsi <= 775_999_999 or 980_000_000 <= mmsi <= 989_999_999


def utc(t: float) -> str:
    """A time as text; ``nothing`` when there is none."""
    return datetime.fromtimestamp(t, UTC).strftime("%Y-%m-%dT%H:%M:%SZ") if math.isfinite(t) else "nothing"
