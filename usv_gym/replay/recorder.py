"""Recorder: watches one world of a batch and turns what it saw into an ``Episode``.

Nothing touches the disk before ``archive.save``, so a run that dies leaves no half-written file.
"""

from __future__ import annotations

import importlib.metadata
import platform
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from ..scenarios.events import happened
from ..world.state import LIDAR, MODEL_3DOF, RADAR
from .archive import AIS_REPORT, DETECTION, FAULTS, NAV, WEATHER, Array, Dtype, Episode, plain, sample_dtype


class _Table:
    """Rows of one dtype in a buffer that doubles when it is full."""

    def __init__(self, dtype: Dtype, capacity: int) -> None:
        self.rows: Array = np.zeros(capacity, dtype)
        self.count = 0

    def extend(self, n: int) -> Array:
        """The next n rows, to be filled."""
        start, self.count = self.count, self.count + n
        if self.count > len(self.rows):
            grown: Array = np.zeros(max(2 * len(self.rows), self.count), self.rows.dtype)
            grown[:start] = self.rows[:start]
            self.rows = grown
        return self.rows[start : self.count]


class Recorder:
    """Record world ``b`` of a batch: call ``sample`` at the start and after every control step, then ``finish``.

    States are kept at every sample, detections and AIS messages whenever the record shows a new one.  A collision and the
    events of the scenario become events by themselves; everything else (waypoints, notices) is told with ``event``.
    """

    # views of the record, see _start
    _tick_now: Array
    _traffic_now: Array
    _collided_now: Array
    _grounded_now: Array
    _picture_now: Array
    _sent_now: Array
    _heard_now: Array
    _stage_now: Array
    # what was seen last
    _collided: int
    _grounded: int
    _picture: int
    _sent: Array
    _heard: Array
    _stage: Array

    def __init__(self) -> None:
        """Nothing is recorded yet; the first sample decides the sizes."""
        self._worlds: Array | None = None
        self._b = -1
        self._tick = -1
        self._events: list[dict[str, Any]] = []
        self._actions: list[Array] = []

    def sample(self, worlds: Array, b: int = 0) -> None:
        """Append the state of ``worlds[b]`` (``[B]`` of ``world_dtype``); a second sample of a tick replaces the first.

        Raises
        ------
        ValueError
            if time went back: the world was reset, and a new episode needs a new recorder.
        """
        if worlds is not self._worlds or b != self._b:
            self._start(worlds, b)
        tick = int(self._tick_now[0])
        if tick < self._tick:
            raise ValueError(f"tick {tick} after tick {self._tick}: one Recorder records one episode")
        if tick > self._tick:
            rows = self._samples.rows
            self._samples.extend(1)
            if self._samples.rows is not rows:
                self._bind()
            self._tick = tick
        i = self._samples.count - 1
        for column, field in self._pairs:
            column[i] = field
        self._t[i], self._traffic_t[i] = self._seconds(tick), self._seconds(int(self._traffic_now[0]))
        if i and (self._active[i] != self._active[i - 1]).any():
            self._describe()
        if self._collided_now[0] != self._collided:
            self._collided = int(self._collided_now[0])
            if self._collided >= 0:
                self.event(self._seconds(tick), "collision", self._collided, "")
        if self._grounded_now[0] != self._grounded:
            self._grounded = int(self._grounded_now[0])
            if self._grounded:
                self.event(self._seconds(tick), "grounding")
        if (self._stage_now != self._stage).any():
            self._happen()
        if self._picture_now[0] != self._picture:
            self._picture = int(self._picture_now[0])
            self._detect()
        if (self._sent_now != self._sent).any():
            self._transmit()
        if (self._heard_now != self._heard).any():
            self._receive()

    def event(self, t: float, kind: str, id: int = -1, text: str = "") -> None:
        """Note something that happened at time t [s] to source ``id`` (-1: to nobody in particular)."""
        self._events.append({"t": float(t), "kind": kind, "id": int(id), "text": text})

    def action(self, action: npt.ArrayLike) -> None:
        """Note the action of a control step, for an exact replay."""
        self._actions.append(np.array(action))

    def finish(
        self,
        *,
        names: Sequence[str] = (),
        scenario: Mapping[str, Any] | None = None,
        seed: int | None = None,
        policy: str = "",
        vessel: str = "",
        control_interval: float | None = None,
        outcome: Mapping[str, Any] | None = None,
        **more: Any,
    ) -> Episode:
        """The episode so far.

        Parameters
        ----------
        names
            of the sources, [S] or shorter.
        scenario
            the scenario as a native mapping, from which the world can be built again.
        seed
            that the environment was reset with.
        policy, vessel
            names.
        control_interval
            in s.
        outcome
            why the episode ended, verdicts; any mapping that JSON can hold.
        more
            further entries of ``meta``.

        Raises
        ------
        ValueError
            if nothing was sampled.
        """
        if self._worlds is None:
            raise ValueError("nothing was recorded: call sample() before finish()")
        given = {
            "scenario": scenario, "seed": seed, "policy": policy, "vessel": vessel,
            "control_interval": control_interval, "outcome": outcome or {}, "names": list(names), **more,
        }  # fmt: skip
        n = self._samples.count
        sampled = {name: self._samples.rows[name][:n].copy() for name in self._samples.rows.dtype.names or ()}
        ais = self._ais.rows[: self._ais.count]
        return Episode(
            meta={**plain(given), **self._meta},
            events=list(self._events),
            **sampled,
            radius=self._radius,
            length=self._length,
            beam=self._beam,
            detections=self._detections.rows[: self._detections.count].copy(),
            ais=ais[np.argsort(ais["t"], kind="stable")],
            actions=np.stack(self._actions) if self._actions else np.zeros(0),
        )

    # --- the record: views of the fields that are watched -----------------------------------------------------------
    def _start(self, worlds: Array, b: int) -> None:
        V, M = worlds["vessels"]["active"].shape[1], worlds["obstacles"]["active"].shape[1]
        if self._worlds is None:
            self._samples = _Table(sample_dtype(V, M), 256)
            self._detections = _Table(DETECTION, 256)
            self._ais = _Table(AIS_REPORT, 256)
            self._collided, self._grounded, self._picture = -1, 0, 0
            self._sent = np.zeros(V + M, np.int32)
            self._heard = np.zeros(V + M, np.int32)
            self._stage = np.zeros_like(worlds["events"]["state"][b])
            self._last_row = np.full(V + M, -1)  # of the last message of each source in the AIS table
        elif self._samples.rows.dtype != sample_dtype(V, M):
            raise ValueError("the world has other capacities than before: one Recorder records one episode")
        self._worlds, self._b = worlds, b
        self._tick_now = worlds["tick"][b : b + 1]
        self._traffic_now = worlds["traffic_tick"][b : b + 1]
        self._collided_now = worlds["safety"]["collided_with"][b]
        self._grounded_now = worlds["safety"]["grounded"][b]
        self._picture_now = worlds["picture"]["sequence"][b]
        self._sent_now = worlds["ais"]["sequence"][b]
        self._heard_now = worlds["ais"]["received"][b, 0]
        self._stage_now = worlds["events"]["state"][b]
        self._describe()
        self._bind()

    def _describe(self) -> None:
        """Read what seldom changes: again when an object comes or goes (a spawned obstacle has a kind and a size)."""
        assert self._worlds is not None
        w = self._worlds[self._b]
        self._meta = _meta(w)
        self._radius = w["obstacles"]["radius"].copy()
        self._length, self._beam = w["vessels"]["length"].copy(), w["vessels"]["beam"].copy()

    def _bind(self) -> None:
        """Pair every column with the field that fills it.  Done once per buffer: a sample is then a list of copies."""
        assert self._worlds is not None
        w, b, rows = self._worlds, self._b, self._samples.rows
        own = self._meta["own"]
        V = w["vessels"]["active"].shape[1]
        self._t, self._traffic_t, self._active = rows["t"], rows["traffic_t"], rows["active"]
        pairs = [
            (rows["eta"], w["vessels"]["eta"][b]),
            (rows["nu"], w["vessels"]["nu"][b]),
            (rows["active"][:, :V], w["vessels"]["active"][b]),
            (rows["active"][:, V:], w["obstacles"]["active"][b]),
            (rows["obstacle"], w["obstacles"]["position"][b]),
            (rows["distance"], w["safety"]["distance"][b, 0]),
            (rows["visible"], w["tracks"]["visible"][b, 0]),
        ]
        nav = w["nav"]
        fields = [nav["gnss_stamp_us"][b, :1], nav["position"][b, 0]]
        fields += [nav[name][b, :1] for name in ("heading", "course", "sog", "mru_heading", "yaw_rate")]
        fields += [nav["specific_force"][b, 0], nav["imu_yaw_rate"][b, :1], nav["water_speed"][b, 0]]
        fields += [nav["wind_speed"][b, :1], nav["wind_angle"][b, :1]]
        pairs += _columns(rows["nav"], fields, len(NAV))
        weather = w["weather"]
        fields = [weather["wind_u10"][b : b + 1], weather["wind_direction"][b : b + 1], weather["current"][b]]
        fields += [weather["wave_height"][b : b + 1], weather["wave_to"][b : b + 1]]
        pairs += _columns(rows["weather"], fields, len(WEATHER))
        sensors = w["sensors"]
        fields = [sensors[name]["outage"][b : b + 1] for name in ("radar", "lidar")]
        fields += [sensors[name][b : b + 1] for name in ("ais_jammed", "gnss_frozen")]
        pairs += _columns(rows["faults"], fields, len(FAULTS))
        plant = int(w["vessels"]["plant"][b, own])
        if w["vessels"]["model"][b, own] == MODEL_3DOF and plant >= 0:
            plants = w["plants"]
            pairs.append((rows["command"], plants["command"][b, plant]))
            for k, name in enumerate(("n", "alpha", "beta")):
                pairs.append((rows["actuator"][:, :, k], plants[name][b, plant]))
        else:
            nothing = np.full(rows["command"].shape[1:], np.nan)
            pairs += [(rows["command"], nothing), (rows["actuator"], nothing)]
        self._pairs = pairs

    def _seconds(self, tick: int | npt.NDArray[np.int64]) -> Any:
        return tick * self._meta["dt_us"] / 1e6

    # --- the tables -------------------------------------------------------------------------------------------------
    def _happen(self) -> None:
        """Note the events of the scenario that began or ended since the last sample."""
        assert self._worlds is not None
        for t, kind, source, text in happened(self._worlds[self._b], self._stage):
            self.event(t, kind, source, text)
        self._stage[:] = self._stage_now

    def _detect(self) -> None:
        """Append the targets of a new picture."""
        assert self._worlds is not None
        picture = self._worlds["picture"][self._b]
        source = np.flatnonzero(picture["id"][0])
        rows = self._detections.extend(len(source))
        rows["t"] = self._seconds(int(picture["tick"][0]))
        rows["source"] = source
        for name in ("id", "descriptor", "sensors", "motion_known", "cog", "sog", "rot", "radius"):
            rows[name] = picture[name][0, source]
        rows["north"], rows["east"] = picture["position"][0, source].T
        for k, name in enumerate(("cov_nn", "cov_ne", "cov_ee", "var_cog", "var_sog")):
            rows[name] = picture["covariance"][0, source, k]
        rows["var_radius"] = picture["radius_variance"][0, source]

    def _transmit(self) -> None:
        """Append the AIS messages that went out since the last sample, each with the truth at its stamp."""
        assert self._worlds is not None
        w = self._worlds[self._b]
        source = np.flatnonzero(self._sent_now != self._sent)
        self._sent[:] = self._sent_now
        self._last_row[source] = np.arange(self._ais.count, self._ais.count + len(source))
        rows = self._ais.extend(len(source))
        ais, vessels, obstacles = w["ais"], w["vessels"], w["obstacles"]
        rows["t"] = ais["stamp_us"][source] / 1e6
        rows["source"] = source
        for name in ("sequence", "cog", "heading", "sog", "rot"):
            rows[name] = ais[name][source]
        rows["north"], rows["east"] = ais["position"][source].T
        V = len(vessels["active"])
        rows["mmsi"] = np.concatenate([vessels["mmsi"], obstacles["mmsi"]])[source]
        lying = (ais["sent_as"][source] != 0) & (ais["spoof_mmsi"][source] != 0)
        rows["mmsi"][lying] = ais["spoof_mmsi"][source][lying]
        rows["ais_class"] = np.concatenate([vessels["ais_class"], obstacles["ais_class"]])[source]
        # The record holds the state of now, and of traffic at its own tick; a message is younger than one sample.
        drift = obstacles["velocity"] + (obstacles["drifts"] != 0)[:, None] * w["weather"]["current"]
        velocity = np.concatenate([vessels["velocity"], drift])[source]
        position = np.concatenate([vessels["eta"][:, :2], obstacles["position"]])[source]
        heading = np.concatenate([vessels["eta"][:, 2], np.zeros(len(drift))])[source]
        rate = np.concatenate([vessels["nu"][:, 2], np.zeros(len(drift))])[source]
        integrated = np.concatenate([vessels["model"] == MODEL_3DOF, np.zeros(len(drift), bool)])[source]
        state = self._seconds(np.where(integrated, int(w["tick"]), int(w["traffic_tick"])))
        back = rows["t"] - state
        rows["north_true"], rows["east_true"] = (position + velocity * back[:, None]).T
        rows["cog_true"] = np.arctan2(velocity[:, 1], velocity[:, 0]) % (2 * np.pi)
        rows["heading_true"] = (heading + rate * back) % (2 * np.pi)
        rows["sog_true"] = np.hypot(velocity[:, 0], velocity[:, 1])
        rows["rot_true"] = rate
        fixed = source >= V
        rows["heading_true"][fixed] = np.nan  # an obstacle has no bow

    def _receive(self) -> None:
        """Mark the messages that got through to the own ship."""
        new = (self._heard_now != self._heard) & (self._heard_now == self._sent) & (self._last_row >= 0)
        self._heard[:] = self._heard_now
        self._ais.rows["received"][self._last_row[new]] = True


def _columns(block: Array, fields: list[Array], width: int) -> list[tuple[Array, Array]]:
    """Lay fields side by side into a block of columns."""
    pairs, start = [], 0
    for field in fields:
        pairs.append((block[:, start : start + len(field)], field))
        start += len(field)
    assert start == width
    return pairs


def _meta(w: Any) -> dict[str, Any]:
    """What the record itself knows about the episode."""
    from .. import __version__

    vessels, obstacles, sensors, routes = w["vessels"], w["obstacles"], w["sensors"], w["routes"]
    scans = {}
    for index, name in ((RADAR, "radar"), (LIDAR, "lidar")):
        scan = sensors[name]
        factor = w["weather"][f"{name}_range_factor"] or 1.0
        scans[name] = {
            "sensor": index, "on": bool(scan["on"]), "range": scan["range"] * factor, "range_min": scan["range_min"],
            "period": scan["period_us"] / 1e6,
        }  # fmt: skip
    meta: dict[str, Any] = plain({
        "versions": {
            "usv_gym": __version__, "python": platform.python_version(),
            **{name: importlib.metadata.version(name) for name in ("numpy", "numba")},
        },
        "origin": w["origin"], "metres_per_degree": w["metres_per_degree"], "epoch_us": w["epoch_us"],
        "dt_us": w["dt_us"], "own": w["observer"][0], "area": w["area"],
        "thruster_y": w["plants"]["y"][max(int(vessels["plant"][w["observer"][0]]), 0)],
        "models": vessels["model"],
        "kinds": np.concatenate([vessels["kind"], obstacles["kind"]]),
        "mmsi": np.concatenate([vessels["mmsi"], obstacles["mmsi"]]),
        "ais_class": np.concatenate([vessels["ais_class"], obstacles["ais_class"]]),
        "waypoints": [route[:count] for route, count in zip(routes["waypoint"], routes["count"], strict=True)],
        "acceptance_radius": routes["radius"],
        "sensors": {
            **scans,
            "ais": {
                "on": bool(sensors["ais_on"]), "range": sensors["ais_range"], "noise": sensors["ais_noise"],
                "bias": sensors["ais_bias"], "bias_time": sensors["ais_bias_time"],
            },
            "tdm": {"period": sensors["tdm_period_us"] / 1e6},
        },
    })  # fmt: skip
    return meta
