"""What a world tells, as values by name: own navigation as measured, AIS as received, targets as detected.

Nothing here reads truth, but for the signals that say so (``object``, ``objects``, ``weather``, ``markers``): they are for the
operator's screens.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from typing import Any

import numpy as np

from ..envs.core import Core
from ..sensors.sentences import STATIC_INTERVAL, Station, encode, geodetic, position_report, static_reports
from ..world.encounter import cpa
from ..world.state import AIS_CLASS_A, AIS_CLASS_B, KIND_ICEBERG
from .fields import Stamp

GRAVITY = 9.80665
_MESSAGE_TYPE = {AIS_CLASS_A: 1, AIS_CLASS_B: 18}
_KINDS = {
    0: "ship",
    1: "vessel",
    2: "boat",
    3: "usv",
    10: "iceberg",
    11: "buoy",
    12: "islet",
    13: "lighthouse",
    14: "platform",
}
ALWAYS = ("clock", "objects", "object", "actuators", "weather", "markers", "track")  #: signals that are always there
_PARTS = ("port", "starboard", "bow")

Values = dict[str, Any]


def thruster_names(core: Core) -> list[str]:
    """What each thruster of the own ship is called on the wire: the first word of its name."""
    return [thruster.name.split()[0] for thruster in core.model.thrusters]


class Signals:
    """The signals of world b of a core that are ``wanted``; ``fresh`` gives those that are new since the last call."""

    def __init__(self, core: Core, wanted: Iterable[str], b: int = 0, names: list[str] | None = None) -> None:
        self.core, self.b = core, b
        self.w = core.worlds[b]
        self.wanted = set(wanted)
        self.names = names if names is not None else core.ids(b)
        self.own = int(self.w["observer"][0])
        self.dt_us, self.epoch_us = int(self.w["dt_us"]), int(self.w["epoch_us"])
        self.track: list[tuple[float, float, float, int]] = []  # x, y, yaw {enu}, stamp
        nav = self.w["nav"]
        self._nav = nav
        self._next = {
            "gnss": nav["gnss_next"], "mru": nav["mru_next"], "imu": nav["imu_next"], "speed_log": nav["log_next"],
            "wind": nav["wind_next"], "odometry": nav["mru_next"],
        }  # fmt: skip
        self._seen = dict.fromkeys(self._next, -1)
        self._heard = np.full(len(self.names), -1, np.int64)
        self._sent = -1
        self._picture = 0
        self._static_due: dict[int, float] = {}
        self._group = 0

    # --- time ---------------------------------------------------------------------------------------------------------
    @property
    def t_us(self) -> int:
        """Time since the start [us]."""
        return int(self.w["tick"]) * self.dt_us

    def common(self) -> Values:
        """What stands in every signal."""
        utc_us = self.epoch_us + self.t_us
        return {"stamp": Stamp(utc_us * 1000), "t": self.t_us / 1e6, "utc": utc_us / 1e6, "sentences": []}

    # --- what is new --------------------------------------------------------------------------------------------------
    def fresh(self) -> dict[str, list[Values]]:
        """Name -> occurrences, for every wanted signal that is new: one for sampled ones, any number of reports."""
        new: dict[str, list[Values]] = {}
        for name, fires in self._next.items():
            if fires[0] != self._seen[name]:
                self._seen[name] = int(fires[0])
                if name == "gnss":
                    self._remember()
                if name in self.wanted:
                    new[name] = [self.sample(name)]
        if "ais" in self.wanted and (reports := self._ais()):
            new["ais"] = reports
        if (tick := int(self.w["picture"]["sequence"][0])) != self._picture:
            self._picture = tick
            if self.wanted & {"target", "targets"}:
                targets = self._targets()
                if "target" in self.wanted and targets:
                    new["target"] = targets
                if "targets" in self.wanted:
                    new["targets"] = [{"count": len(targets), "items": targets}]
        return {**new, **{name: [] for name in ALWAYS if name in self.wanted}}  # made when they are due

    def present(self) -> dict[str, list[Values]]:
        """Like ``fresh``: all that is sampled, whether it is new or not."""
        return {**{name: [self.sample(name)] for name in self._next if name in self.wanted},
                **{name: [] for name in ALWAYS if name in self.wanted}}  # fmt: skip

    def sample(self, name: str) -> Values:
        """A signal as it is now."""
        build: Callable[[], Any] = getattr(self, f"_{name}")
        values: Values = build()
        return values

    def listing(self, name: str) -> list[Values]:
        """Occurrences of a signal that is always there."""
        return self._object() if name == "object" else [self.sample(name)]

    # --- own navigation ----------------------------------------------------------------------------------------------
    def _geodetic(self, north: float, east: float) -> tuple[float, float]:
        w = self.w
        latitude, longitude = geodetic(north, east, w["origin"], w["metres_per_degree"])
        return float(latitude), float(longitude)

    def _pose(self, north: float, east: float, psi: float) -> Values:
        latitude, longitude = self._geodetic(north, east)
        return {
            "latitude": latitude,
            "longitude": longitude,
            "altitude": 0.0,
            "north": north,
            "east": east,
            **attitude(psi),
        }

    def _clock(self) -> Values:
        return {}

    def _gnss(self) -> Values:
        nav, noise = self._nav, self.w["sensors"]["gnss_noise"]
        north, east = map(float, nav["position"][0])
        course, sog, variance = float(nav["course"][0]), float(nav["sog"][0]), float(noise[0]) ** 2
        return {
            **self._pose(north, east, float(nav["heading"][0])),
            "course": course, "sog": sog, "velocity_north": sog * math.cos(course), "velocity_east": sog * math.sin(course),
            "heading_rate": float(nav["yaw_rate"][0]), "position_variance": variance,
            "enu_covariance": [variance, 0.0, 0.0, 0.0, variance, 0.0, 0.0, 0.0, 0.0],
        }  # fmt: skip

    def _motion(self) -> Values:
        nav = self._nav
        u, v = map(float, nav["water_speed"][0])
        rate = float(nav["yaw_rate"][0])
        return {"surge": u, "sway": v, "yaw_rate": rate, "flu_sway": -v, "flu_yaw_rate": -rate}

    def _mru(self) -> Values:
        north, east = map(float, self._nav["position"][0])
        return {**attitude(float(self._nav["mru_heading"][0])), **self._motion(), "roll": 0.0, "pitch": 0.0, "heave": 0.0,
                "north": north, "east": east}  # fmt: skip

    def _imu(self) -> Values:
        nav, noise = self._nav, self.w["sensors"]["imu_noise"]
        x, y = map(float, nav["specific_force"][0])
        rate = float(nav["imu_yaw_rate"][0])
        return {
            **attitude(float(nav["mru_heading"][0])),
            "force_x": x, "force_y": y, "force_z": -GRAVITY, "yaw_rate": rate,
            "flu_force_y": -y, "flu_force_z": GRAVITY, "flu_yaw_rate": -rate,
            "force_covariance": _diagonal(3, float(noise[0]) ** 2), "rate_covariance": _diagonal(3, float(noise[1]) ** 2),
        }  # fmt: skip

    def _speed_log(self) -> Values:
        return self._motion()

    def _wind(self) -> Values:
        angle = float(self._nav["wind_angle"][0])
        return {"speed": float(self._nav["wind_speed"][0]), "angle": angle, "angle_positive": angle % (2 * math.pi),
                "flu_angle": -angle}  # fmt: skip

    def _odometry(self) -> Values:
        north, east = map(float, self._nav["position"][0])
        noise = self.w["sensors"]
        spread = _diagonal(6, 0.0)
        spread[0] = spread[7] = float(noise["gnss_noise"][0]) ** 2
        spread[35] = float(noise["mru_noise"][0]) ** 2
        return {
            **self._pose(north, east, float(self._nav["mru_heading"][0])),
            **self._motion(),
            "pose_covariance": spread,
        }

    def _remember(self) -> None:
        """Lengthen the track, a point every 5 m, the last 2000 of them."""
        if "track" in self.wanted or "markers" in self.wanted:
            north, east = map(float, self._nav["position"][0])
            if not self.track or math.hypot(self.track[-1][0] - east, self.track[-1][1] - north) > 5.0:
                stamp = (self.epoch_us + self.t_us) * 1000
                self.track.append((east, north, math.pi / 2 - float(self._nav["mru_heading"][0]), stamp))
                del self.track[:-2000]

    def _track(self) -> Values:
        return {"poses": [
            {"header": {"stamp": Stamp(stamp), "frame_id": "map"},
             "pose": {"position": {"x": x, "y": y, "z": 0.0}, "orientation": {"z": math.sin(yaw / 2), "w": math.cos(yaw / 2)}}}
            for x, y, yaw, stamp in self.track
        ]}  # fmt: skip

    # --- surroundings, as sensed -------------------------------------------------------------------------------------
    def station(self, source: int) -> Station:
        """What a transmitter says about itself."""
        w, V = self.w, len(self.w["vessels"]["active"])
        group, slot = (w["vessels"], source) if source < V else (w["obstacles"], source - V)
        ship = source < V
        return Station(
            int(group["mmsi"][slot]), int(group["ais_class"][slot]), int(group["kind"][slot]), self.names[source],
            float(group["length"][slot]) if ship else 2.0 * float(group["radius"][slot]),
            float(group["beam"][slot]) if ship else 2.0 * float(group["radius"][slot]),
        )  # fmt: skip

    def _ais(self) -> list[Values]:
        ais, reports = self.w["ais"], []
        if (sequence := int(ais["sequence"][self.own])) not in (self._sent, 0):
            own = self.own
            fields = (*ais["position"][own], ais["cog"][own], ais["heading"][own], ais["sog"][own], ais["rot"][own])
            reports.append(self._report(own, fields, int(ais["stamp_us"][own]), True))
        self._sent = sequence
        stamps = ais["inbox_stamp_us"][0]
        for source in np.flatnonzero((stamps != self._heard) & (stamps >= 0)).tolist():
            if self.names[source]:
                reports.append(self._report(source, ais["inbox"][0, source], int(stamps[source]), False))
        self._heard[:] = stamps
        return reports

    def _report(self, source: int, fields: Any, stamp_us: int, own: bool) -> Values:
        north, east, cog, heading, sog, rot = map(float, fields)
        station = self.station(source)
        latitude, longitude = self._geodetic(north, east)
        utc_us = self.epoch_us + stamp_us
        motion = {"cog": cog, "heading": heading, "sog": sog, "rot": rot}
        messages = [position_report(station, latitude, longitude, **motion, utc_us=utc_us)]
        if stamp_us >= self._static_due.get(station.mmsi, -math.inf):
            self._static_due[station.mmsi] = stamp_us + STATIC_INTERVAL * 1e6
            messages += static_reports(station)
        sentences: list[str] = []
        for message in messages:
            lines = encode(message, own=own, channel="AB"[self._group % 2], sequence=self._group)
            self._group += 1
            sentences += lines
        seconds = utc_us // 1_000_000
        return {
            "mmsi": station.mmsi, "message_type": _MESSAGE_TYPE.get(station.ais_class, 21), "own": own, "status": 0,
            "accuracy": 1, "latitude": latitude, "longitude": longitude, **motion, "name": station.name,
            "hour": seconds // 3600 % 24, "minute": seconds // 60 % 60, "second": seconds % 60,
            "stamp": Stamp(utc_us * 1000), "sentence": sentences[0], "sentences": sentences,
        }  # fmt: skip

    def _targets(self) -> list[Values]:
        p, nav = self.w["picture"], self._nav
        n0, e0 = map(float, nav["position"][0])
        course, sog = float(nav["course"][0]), float(nav["sog"][0])
        vn0, ve0 = sog * math.cos(course), sog * math.sin(course)
        targets = []
        for s in np.flatnonzero(p["id"][0]).tolist():
            north, east = map(float, p["position"][0, s])
            latitude, longitude = self._geodetic(north, east)
            cog, speed, rot = float(p["cog"][0, s]), float(p["sog"][0, s]), float(p["rot"][0, s])
            radius, c = float(p["radius"][0, s]), p["covariance"][0, s]
            known = not (math.isnan(cog) or math.isnan(speed))
            vn, ve = (speed * math.cos(cog), speed * math.sin(cog)) if known else (0.0, 0.0)
            dcpa, tcpa = cpa(north - n0, east - e0, vn - vn0, ve - ve0)
            descriptor, id = int(p["descriptor"][0, s]), int(p["id"][0, s])
            targets.append({
                "id": id, "descriptor": descriptor, "descriptor_text": ("fixed_obstacle", "vessel", "land")[descriptor],
                "sensors": int(p["sensors"][0, s]), "motion_known": bool(p["motion_known"][0, s]),
                "latitude": latitude, "longitude": longitude, "north": north, "east": east,
                "enu_covariance": [float(c[2]), float(c[1]), float(c[1]), float(c[0])],
                "cog": cog, "sog": speed, "rot": rot, "cog_known": _or(cog), "sog_known": _or(speed),
                "cog_variance": float(c[3]), "sog_variance": float(c[4]),
                "radius": radius, "radius_known": _or(radius), "radius_variance": float(p["radius_variance"][0, s]),
                "distance": math.hypot(north - n0, east - e0), "bearing": math.atan2(east - e0, north - n0) % (2 * math.pi),
                "dcpa": float(dcpa), "tcpa": float(tcpa), "name": f"T{id}", "number": id % 100,
            })  # fmt: skip
        return targets

    # --- own machinery -----------------------------------------------------------------------------------------------
    def _actuators(self) -> Values:
        q, p = self.w["plants"], int(self.w["vessels"]["plant"][self.own])
        values: Values = {f"{part}.{what}": 0.0 for part in _PARTS for what in ("rpm", "nozzle", "bucket", "shaft")}
        for a, name in enumerate(thruster_names(self.core)):
            for c, what in enumerate(("rpm", "nozzle", "bucket")):
                values[f"{name}.{what}"] = float(q["command"][p, a, c])
            values[f"{name}.shaft"] = float(q["n"][p, a])
        x, y, n = map(float, q["tau"][p])
        return {**values, "surge_force": x, "sway_force": y, "yaw_moment": n}

    # --- truth, for the operator -------------------------------------------------------------------------------------
    def _object(self) -> list[Values]:
        w, V = self.w, len(self.w["vessels"]["active"])
        found = []
        for s, name in enumerate(self.names):
            ship = s < V
            group, slot = (w["vessels"], s) if ship else (w["obstacles"], s - V)
            if not group["active"][slot]:
                continue
            place = group["eta"][slot] if ship else (*group["position"][slot], math.pi)
            size = float(group["length"][slot] if ship else group["radius"][slot])
            kind = int(group["kind"][slot])
            descriptor = "ship" if kind < KIND_ICEBERG else "fixed_obstacle"
            found.append({
                "id": name, "kind": _KINDS.get(kind, "object"), "descriptor": descriptor,
                "radius": size / 2 if ship else size, "size": size, "own": s == self.own,
                "beam": float(group["beam"][slot]) if ship else 2 * size,
                **self._pose(float(place[0]), float(place[1]), float(place[2])),
            })  # fmt: skip
        return found

    def _objects(self) -> Values:
        items = self._object()
        return {"count": len(items), "items": items}

    def _weather(self) -> Values:
        w = self.w["weather"]
        north, east = w["current"]
        return {
            "wind_speed": float(w["wind_u10"]), "wind_from": (float(w["wind_direction"]) + math.pi) % (2 * math.pi),
            "current_speed": math.hypot(north, east), "current_to": math.atan2(east, north) % (2 * math.pi),
            "wave_height": float(w["wave_height"]), "paused": False,
            "latitude": float(self.w["origin"][0]), "longitude": float(self.w["origin"][1]),
        }  # fmt: skip

    def _markers(self) -> Values:
        from .markers import markers

        return {"markers": markers(self)}


def attitude(psi: float) -> Values:
    """A heading [rad] in all the forms that messages want."""
    yaw = math.pi / 2 - psi
    yaw = (yaw + math.pi) % (2 * math.pi) - math.pi
    return {
        "heading": psi, "enu_yaw": yaw, "enu_qz": math.sin(yaw / 2), "enu_qw": math.cos(yaw / 2),
        "ned_qz": math.sin(psi / 2), "ned_qw": math.cos(psi / 2),
    }  # fmt: skip


def _diagonal(n: int, value: float) -> list[float]:
    return [value if i % (n + 1) == 0 else 0.0 for i in range(n * n)]


def _or(value: float) -> float:
    return 0.0 if math.isnan(value) else value
