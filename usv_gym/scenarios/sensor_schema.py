"""Schema of a sensor set (``configs/sensors/*.yaml``): SI unless the key says otherwise, rates in Hz, 0 is off."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, Literal, Self

from pydantic import BeforeValidator, Field, ValidationInfo, model_validator

from ..config import ConfigError, Model, locate, problem, read_yaml, validate

Number = Annotated[float, Field(strict=True)]
Positive = Annotated[float, Field(strict=True, gt=0)]
NonNegative = Annotated[float, Field(strict=True, ge=0)]
Share = Annotated[float, Field(strict=True, ge=0, le=1)]
FalseAlarms = Annotated[float, Field(strict=True, ge=0, le=2)]
Flag = Annotated[bool, Field(strict=True)]

#: largest range [m] that the Simrad Broadband 4G allows at a number of revolutions per minute (thesis 2.3.1: 32 NM at
#: the lowest rate, 1 NM at the highest)
RADAR_REACH = {24: 59_264.0, 36: 59_264.0, 48: 1_852.0}


def _interval(value: Any) -> Any:
    number = isinstance(value, int | float) and not isinstance(value, bool)
    if value != "itu" and not (number and value > 0):
        raise problem(f"expected a number of seconds greater than 0, or 'itu', got {value!r}")
    return value


class Error(Model):
    """Error of one measured quantity: e = b + w_m, with db/dt = -b / T_b + w_b (thesis 2.1-2.3).

    The white part w_m is given by its ``std`` or its ``variance``.  The bias b is given by its stationary standard
    deviation ``bias_std``, or by ``bias_variance``, the spectral density of w_b as in the thesis's files, so that the
    stationary variance is ``bias_variance * bias_time / 2``.
    """

    std: NonNegative | None = None
    variance: NonNegative | None = None
    bias_std: NonNegative | None = None
    bias_variance: NonNegative | None = None
    bias_time: Positive | None = Field(default=None, description="time constant T_b of the bias [s]")

    @model_validator(mode="after")
    def _one_of_each(self) -> Self:
        for std, variance in (("std", "variance"), ("bias_std", "bias_variance")):
            if getattr(self, std) is not None and getattr(self, variance) is not None:
                raise problem(f"give {std} or {variance}, not both", variance)
        if (self.bias_std or self.bias_variance) and self.bias_time is None:
            raise problem("required key is missing: a bias needs its time constant", "bias_time")
        return self

    @property
    def noise(self) -> float:
        """Standard deviation of the white part."""
        return self.std or (self.variance or 0.0) ** 0.5

    @property
    def bias(self) -> float:
        """Stationary standard deviation of the bias."""
        return self.bias_std or ((self.bias_variance or 0.0) * (self.bias_time or 0.0) / 2.0) ** 0.5


class Gnss(Model):
    """Position, heading, course and speed (GNSS compass, as the Seapath of Odin); white noise."""

    rate: NonNegative = 20.0
    position_std: NonNegative = 0.0
    heading_std_deg: NonNegative = 0.0
    course_std_deg: NonNegative = 0.0
    speed_std: NonNegative = 0.0


class Mru(Model):
    """Heading and yaw rate (roll, pitch and heave are zero in a 3-DOF world); white noise."""

    rate: NonNegative = 100.0
    heading_std_deg: NonNegative = 0.0
    yaw_rate_std_deg_s: NonNegative = 0.0


class Imu(Model):
    """Specific force and yaw rate; white noise."""

    rate: NonNegative = 100.0
    acceleration_std: NonNegative = 0.0
    yaw_rate_std_deg_s: NonNegative = 0.0


class SpeedLog(Model):
    """Speed ahead and abeam; white noise."""

    rate: NonNegative = 20.0
    speed_std: NonNegative = 0.0


class WindSensor(Model):
    """Relative wind; white noise."""

    rate: NonNegative = 50.0
    speed_std: NonNegative = 0.0
    angle_std_deg: NonNegative = 0.0


class Navigation(Model):
    """What the own ship knows about itself."""

    gnss: Gnss = Gnss()
    mru: Mru = Mru()
    imu: Imu = Imu()
    speed_log: SpeedLog = SpeedLog()
    wind: WindSensor = WindSensor()


class AisReceiver(Model):
    """AIS: what ships transmit (their navigation errors) and what is received of it."""

    on: Flag = True
    range: Positive = 10_000.0
    interval: Annotated[float | Literal["itu"], BeforeValidator(_interval)] = Field(
        default=2.0, description="seconds between position reports, or 'itu': the schedule of ITU-R M.1371"
    )
    latency: NonNegative = Field(default=0.0, description="largest delay [s]; each message is delayed by U(0, latency)")
    loss: Share = Field(default=0.0, description="share of messages that do not get through")
    quantised: Flag = Field(default=True, description="values have the resolution of the wire")
    position: Error = Field(default=Error(), description="per axis [m]")
    cog_deg: Error = Error()
    heading_deg: Error = Error()
    sog_kn: Error = Error()
    rot_deg_min: Error = Error()


class Scanner(Model):
    """What radar and LiDAR have in common.  Errors hold at f(d) = 1 and grow with f(d) = distance_gain * d (2.5)."""

    on: Flag = True
    range: Positive
    range_min: NonNegative = 0.0
    latency: NonNegative = Field(default=0.0, description="delay of every scan [s]")
    distance_gain: NonNegative = Field(default=0.01, description="k of f(d) = k d [1/m]: errors hold at d = 1 / k")
    distance_floor: Positive = Field(default=0.05, description="smallest f(d) that the tracker assumes")
    false_alarms: FalseAlarms = Field(default=0.0, description="mean number per scan")
    detection: Share = Field(default=1.0, description="probability of detecting a large object per scan")
    detection_radius: NonNegative = Field(default=0.0, description="apparent radius [m] that halves that probability")
    position: Error = Field(default=Error(), description="per axis [m]")
    radius: Error = Field(default=Error(), description="apparent radius [m]")

    @model_validator(mode="after")
    def _range_is_an_interval(self) -> Self:
        if self.range_min >= self.range:
            raise problem(f"expected less than the range of {self.range:g} m, got {self.range_min:g}", "range_min")
        return self


class Radar(Scanner):
    """Radar: 24, 36 or 48 revolutions per minute; 48 allows ranges up to 1 NM."""

    range: Positive = 1_852.0
    range_min: NonNegative = 61.0
    rpm: Literal[24, 36, 48] = 48

    @model_validator(mode="after")
    def _fast_is_short(self) -> Self:
        if self.range > RADAR_REACH[self.rpm]:
            slower = [str(rpm) for rpm, reach in RADAR_REACH.items() if reach >= self.range]
            remedy = f", which needs rpm {' or '.join(slower)}" if slower else ""
            limit = f"expected at most {RADAR_REACH[self.rpm]:g} m at {self.rpm} rpm"
            raise problem(f"{limit}, got {self.range:g}{remedy}", "range")
        return self

    @property
    def period(self) -> float:
        """Seconds per revolution."""
        return 60.0 / self.rpm


class Lidar(Scanner):
    """LiDAR: 5 to 20 sweeps per second."""

    range: Positive = 100.0
    rate: Annotated[float, Field(strict=True, ge=5, le=20)] = 10.0

    @property
    def period(self) -> float:
        """Seconds per sweep."""
        return 1.0 / self.rate


class Tdm(Model):
    """Target Detection Module: how often it reports, what its filters assume, when it drops a sensor."""

    rate: Positive = 1.0
    process_u: Positive = Field(default=1e-6, description="driving noise of acceleration: density [(m/s2)^2/s]")
    process_r: Positive = Field(default=3e-8, description="the same of yaw acceleration [(rad/s2)^2/s]")
    process_time: Positive = Field(default=100.0, description="time constant of the slowly varying accelerations [s]")
    inflation: Annotated[float, Field(strict=True, ge=1)] = Field(default=1.0, description="federated inflation")
    filter: Literal["thesis", "light"] = Field(
        default="thesis", description="local filters: those of the thesis, or six states at a constant velocity"
    )
    light_q: Positive = Field(default=1e-4, description="driving noise of `light`: density [(m/s2)^2/s]")
    timeout_factor: Annotated[float, Field(strict=True, ge=1)] = Field(
        default=2.5, description="a sensor is dropped after this many of its expected intervals"
    )


class Sensors(Model):
    """A sensor set.  Defaults: the ranges and rates of the thesis (B.1, B.3), without noise."""

    description: str = ""
    navigation: Navigation = Navigation()
    ais: AisReceiver = AisReceiver()
    radar: Radar = Radar()
    lidar: Lidar = Lidar()
    radius_min: NonNegative = Field(default=2.0, description="smallest radius that radar and LiDAR measure [m]")
    tdm: Tdm = Tdm()


class SensorsInput(Sensors):
    """What may be written: a sensor set, or changes to one that has a name."""

    base: str | None = Field(default=None, description="name in configs/sensors, or path, that the rest changes")


def load_sensors(name: str, directory: Path | None = None) -> Sensors:
    """Read a sensor set: a name in ``configs/sensors`` or a path.

    Raises
    ------
    ConfigError
        if there is no such set, or it has mistakes.
    """
    return validate(Sensors, read_yaml(locate("sensors", name, directory, what="sensor set")))


def expand_sensors(value: Any, info: ValidationInfo) -> Any:
    """Replace a name, or the ``base`` of a mapping, by what it stands for (validator of ``Scenario.sensors``)."""
    directory = (info.context or {}).get("directory")
    if isinstance(value, str):
        value = {"base": value}
    if not isinstance(value, dict) or value.get("base") is None:
        return value
    if not isinstance(value["base"], str):
        raise problem(f"expected a name or path, got {value['base']!r}", "base")
    try:
        base = load_sensors(value["base"], directory).dump()
    except ConfigError as error:
        raise problem(str(error)) from None
    return changed(base, {key: below for key, below in value.items() if key != "base"})


def changed(base: dict[str, Any], changes: dict[str, Any]) -> dict[str, Any]:
    """``base`` with changes on top, mapping by mapping; a variance replaces the std it stands for, and vice versa."""
    result = dict(base)
    for pair in (("std", "variance"), ("bias_std", "bias_variance")):
        if not changes.keys().isdisjoint(pair):
            for key in pair:
                result.pop(key, None)
    for key, value in changes.items():
        below = result.get(key)
        result[key] = changed(below, value) if isinstance(below, dict) and isinstance(value, dict) else value
    return result
