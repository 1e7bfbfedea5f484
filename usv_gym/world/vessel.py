"""Vessel files: what a controlled vessel is made of, read from ``configs/vessels`` and written into a world record.

``model`` says which kind of file it is: a 3-DOF plant with thrusters (the default), or a ``kinematic`` ship that turns and
changes speed as traffic does, without forces.
"""

from __future__ import annotations

import functools
import math
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal, Self, TypeAlias

import numpy as np
from pydantic import Field, model_validator

from ..config import ConfigError, Model, locate, problem, read_yaml, suggestion, validate
from ..units import DEG
from .state import MODEL_KINEMATIC, A

Positive = Annotated[float, Field(gt=0)]
NonNegative = Annotated[float, Field(ge=0)]
Preset = Literal["standard", "original"]


class Mass(Model):
    """Rigid body about the origin of {b}, and added mass (positive, as it adds up)."""

    mass_kg: Positive
    centre_of_gravity_x_m: float = 0.0
    inertia_z_kg_m2: Positive
    added_surge_kg: NonNegative = 0.0
    added_sway_kg: NonNegative = 0.0
    added_sway_from_yaw_kg_m: float = 0.0
    added_yaw_from_sway_kg_m: float = 0.0
    added_yaw_kg_m2: NonNegative = 0.0

    @model_validator(mode="after")
    def _positive_definite(self) -> Mass:
        m = self.matrix()
        if m[1, 1] * m[2, 2] - m[1, 2] * m[2, 1] <= 0.0:
            raise ValueError("mass matrix not positive definite: centre_of_gravity_x_m or inertia_z_kg_m2 is off")
        return self

    def matrix(self) -> np.ndarray[Any, np.dtype[np.float64]]:
        """Inertia matrix M [3, 3], rigid body and added mass."""
        static_moment = self.mass_kg * self.centre_of_gravity_x_m
        return np.array([
            [self.mass_kg + self.added_surge_kg, 0.0, 0.0],
            [0.0, self.mass_kg + self.added_sway_kg, static_moment + self.added_sway_from_yaw_kg_m],
            [0.0, static_moment + self.added_yaw_from_sway_kg_m, self.inertia_z_kg_m2 + self.added_yaw_kg_m2],
        ])


class Coriolis(Model):
    """Coriolis and centripetal forces.

    ``full``: from the mass matrix with added mass, Munk moment included.  ``rigid_body``: of the hull alone.
    ``linearised``: -sway_kg u r in sway, nothing else.
    """

    form: Literal["full", "rigid_body", "linearised"]
    sway_kg: float = 0.0


class Damping(Model):
    """Hydrodynamic derivatives in SI units: force = derivative * motion, so drag is negative."""

    Xu: float = 0.0
    Xuu: float = 0.0
    Xuuu: float = 0.0
    Xuu_ittc: float = 0.0
    Yv: float = 0.0
    Yr: float = 0.0
    Yvv: float = 0.0
    Yrv: float = 0.0
    Yvr: float = 0.0
    Yrr: float = 0.0
    Yvvv: float = 0.0
    Nv: float = 0.0
    Nr: float = 0.0
    Nvv: float = 0.0
    Nrv: float = 0.0
    Nvr: float = 0.0
    Nrr: float = 0.0
    Nrrr: float = 0.0


class Crossflow(Model):
    """Cross-flow drag of the strips from ``from_x_m`` to ``to_x_m``."""

    drag_coefficient: NonNegative
    draught_m: Positive
    from_x_m: float
    to_x_m: float
    sway_factor: NonNegative = 1.0
    yaw_factor: NonNegative = 1.0


class Wind(Model):
    """Wind load in Blendermann's form."""

    frontal_area_m2: NonNegative
    lateral_area_m2: NonNegative
    lateral_centroid_x_m: float
    drag_bow: Positive
    drag_stern: Positive
    drag_side: Positive
    cross_force: NonNegative


class Waves(Model):
    """Gain of the wave-force filter per metre of significant height."""

    surge_N_per_m: NonNegative
    sway_N_per_m: NonNegative
    yaw_Nm_per_m: NonNegative


class Transfer(Model):
    """Denominator without its leading 1, and numerator, highest power first."""

    denominator: tuple[float, ...] = Field(min_length=2, max_length=4)
    numerator: tuple[float, ...] = Field(min_length=2, max_length=4)


class FluidMemory(Model):
    """Radiation forces as transfer functions of velocity through the water."""

    force_scale: float
    moment_scale: float
    sway: Transfer
    yaw: Transfer
    coupling: Transfer


class Thruster(Model):
    """A propeller, bow thruster or waterjet; mixing gives its share of the demands (surge, yaw)."""

    name: str
    x_m: float
    y_m: float
    direction_deg: float = 0.0
    gain_ahead_N_per_rpm2: Positive
    gain_astern_N_per_rpm2: Positive
    rpm_idle: float = 0.0
    rpm_max: Positive
    rpm_min: float
    rpm_lag_s: NonNegative
    nozzle_max_deg: NonNegative = 0.0
    nozzle_lag_s: NonNegative = 0.0
    bucket: bool = False
    bucket_lag_s: NonNegative = 0.0
    mix_surge: float = 0.0
    mix_yaw: float = 0.0
    mix_nozzle: float = 0.0


class Autopilot(Model):
    """Gains of ``world/autopilot.py``."""

    heading_gain: Positive
    rate_gain: Positive
    rate_integral: NonNegative
    rate_max_deg_s: Positive
    speed_gain: Positive
    speed_integral: NonNegative
    speed_curve_exponent: Positive


class VesselFile(Model):
    """What every vessel file says.  Lengths in metres, speeds in metres per second, body axes forward and starboard."""

    name: str
    description: str
    source: str
    length: Positive
    beam: Positive
    cruise_speed: Positive
    max_speed: Positive

    @model_validator(mode="after")
    def _cruises_within_its_speed(self) -> Self:
        if self.cruise_speed > self.max_speed:
            raise problem(f"expected at most max_speed ({self.max_speed:g}), got {self.cruise_speed:g}", "cruise_speed")
        return self


class KinematicModel(VesselFile):
    """A ship without forces: heading through a low-pass filter with a largest rate (thesis 6.2.2), speed through another.

    Wind, waves and current do not move it, as they do not move the traffic.
    """

    model: Literal["kinematic"]
    description: str = ""
    source: str = ""
    default_action: Literal["heading_speed", "discrete"] = "heading_speed"
    turn_time: Positive = Field(description="time constant of the heading filter [s]")
    max_turn_rate_deg: Positive = Field(description="[deg/s]")
    speed_time: NonNegative = Field(default=0.0, description="time constant of the speed [s]; 0: at once")

    thrusters: ClassVar[tuple[Thruster, ...]] = ()
    fluid_memory: ClassVar[None] = None


class PlantModel(VesselFile):
    """A vessel of three degrees of freedom, with its actuators."""

    model: Literal["3dof"] = "3dof"
    length_pp: Positive
    default_action: Literal["throttle_nozzle", "thrusters"]
    mass: Mass
    coriolis: Coriolis
    damping: Damping
    crossflow: Crossflow
    wind: Wind
    waves: Waves
    thrusters: tuple[Thruster, ...] = Field(min_length=1, max_length=A)
    reverse_by_bucket: bool = False
    autopilot: Autopilot
    fluid_memory: FluidMemory | None = None

    def coriolis_masses(self) -> tuple[float, float, float]:
        """c11, c22 [kg] and c23 [kg m] of C(nu) (``state.py``)."""
        if self.coriolis.form == "linearised":
            return self.coriolis.sway_kg, 0.0, 0.0
        if self.coriolis.form == "rigid_body":
            return self.mass.mass_kg, self.mass.mass_kg, self.mass.mass_kg * self.mass.centre_of_gravity_x_m
        m = self.mass.matrix()
        return float(m[0, 0]), float(m[1, 1]), float(m[1, 2])


VesselModel: TypeAlias = PlantModel | KinematicModel


def load_vessel(name_or_path: str | Path | KinematicModel) -> VesselModel:
    """Read a vessel by the name of a shipped file (``"odin"``) or by path; one that a scenario describes is itself.

    Raises
    ------
    ConfigError
        one line per problem: the file, the key path, what was expected and the nearest known name.
    """
    if isinstance(name_or_path, KinematicModel):
        return name_or_path
    path = locate("vessels", str(name_or_path))
    return _load(path, path.stat().st_mtime_ns)


@functools.lru_cache(maxsize=32)
def _load(path: Path, modified: int) -> VesselModel:
    """Read a vessel file once for as long as it does not change."""
    document = read_yaml(path)
    models: dict[Any, type[PlantModel] | type[KinematicModel]] = {"3dof": PlantModel, "kinematic": KinematicModel}
    kind = document.data.get("model", "3dof")
    if not isinstance(kind, str) or kind not in models:
        raise ConfigError(f"{document.where(('model',))}: unknown model {kind!r}{suggestion(kind, models)}")
    return validate(models[kind], document)


def write_kinematic(model: KinematicModel, v: Any, j: int, frame: float) -> None:
    """Write how a kinematic vessel moves into slot j of the vessels group ``v`` of a record; ``frame`` seconds per frame."""
    v["model"][j], v["plant"][j] = MODEL_KINEMATIC, -1
    v["turn_time"][j], v["turn_rate_max"][j] = model.turn_time, model.max_turn_rate_deg * DEG
    v["turn_decay"][j] = -math.expm1(-frame / model.turn_time)
    v["speed_hold"][j] = math.exp(-frame / model.speed_time) if model.speed_time > 0.0 else 0.0


def write_plant(
    model: PlantModel,
    worlds: np.ndarray[Any, Any],
    b: int,
    p: int,
    preset: Preset = "standard",
    memory: bool = False,
) -> None:
    """Fill row p of the plants group of ``worlds[b]``: parameters from the model, state at rest with engines idling.

    ``original`` restores the quirks of the simulator of 2017: no cross-flow drag below 0.05 m/s of sway, the bucket
    left out of the yaw moment, actuators stepped per message, longitudinal wind load too large by A_L / A_F, heading
    integrated 2.5 % fast, and a current that turns with the vessel within a step.  ``memory`` switches the fluid
    memory on.
    """
    if memory and model.fluid_memory is None:
        raise ConfigError(f"vessel {model.name}: has no fluid_memory")
    original = preset == "original"
    q = worlds["plants"][b]
    for field in q.dtype.names:
        q[field][p] = 0
    values: dict[str, Any] = model.damping.model_dump()
    m = model.mass.matrix()
    values |= {"m11": m[0, 0], "m22": m[1, 1], "m23": m[1, 2], "m32": m[2, 1], "m33": m[2, 2]}
    m = np.linalg.inv(m)
    values |= {"i11": m[0, 0], "i22": m[1, 1], "i23": m[1, 2], "i32": m[2, 1], "i33": m[2, 2]}
    values["turned"] = 0.0, 0.0, 1.0
    values |= {"coriolis": model.coriolis_masses(), "coriolis_linearised": model.coriolis.form == "linearised"}
    areas = model.wind.frontal_area_m2, model.wind.lateral_area_m2
    flow, wind, waves, pilot = model.crossflow, model.wind, model.waves, model.autopilot
    values |= {
        "cd2d": flow.drag_coefficient, "draught": flow.draught_m, "strip_x0": flow.from_x_m, "strip_x1": flow.to_x_m,
        "crossflow_sway": flow.sway_factor, "crossflow_yaw": flow.yaw_factor,
        "crossflow_dead_zone": 0.05 if original else 0.0,
        "length_pp": model.length_pp,
        "area_front": areas[0], "area_side": areas[1], "wind_arm": wind.lateral_centroid_x_m,
        "cd_t": wind.drag_side, "cd_l_bow": wind.drag_bow, "cd_l_stern": wind.drag_stern,
        "wind_delta": wind.cross_force,
        "wind_surge_factor": 1.0 if original or areas[1] == 0.0 else areas[0] / areas[1],
        "wave_gain": (waves.surge_N_per_m, waves.sway_N_per_m, waves.yaw_Nm_per_m),
        "current_turns": not original,
        "yaw_gain": 1.025 if original else 1.0,
        "bucket_in_yaw": not original,
        "euler_actuators": original,
        "reverse_by_bucket": model.reverse_by_bucket,
        "ap_heading": (pilot.heading_gain, pilot.rate_gain, pilot.rate_integral),
        "ap_speed": (pilot.speed_gain, pilot.speed_integral, pilot.speed_curve_exponent),
        "ap_speed_max": model.max_speed, "ap_rate_max": pilot.rate_max_deg_s * DEG,
        "thrusters": len(model.thrusters),
    }  # fmt: skip
    for field, value in values.items():
        q[field][p] = value
    for i, t in enumerate(model.thrusters):
        per_thruster = {
            "x": t.x_m, "y": t.y_m, "direction": t.direction_deg * DEG,
            "gain_ahead": t.gain_ahead_N_per_rpm2, "gain_astern": t.gain_astern_N_per_rpm2,
            "n_idle": t.rpm_idle, "n_max": t.rpm_max, "n_min": t.rpm_min, "n_lag": t.rpm_lag_s, "n": t.rpm_idle,
            "nozzle_max": t.nozzle_max_deg * DEG, "nozzle_lag": t.nozzle_lag_s,
            "bucket": t.bucket, "bucket_lag": t.bucket_lag_s,
            "mix_surge": t.mix_surge, "mix_yaw": t.mix_yaw, "mix_nozzle": t.mix_nozzle,
            "thrust_left": 1.0,
        }  # fmt: skip
        for field, value in per_thruster.items():
            q[field][p, i] = value
    if memory and model.fluid_memory is not None:
        fluid = model.fluid_memory
        q["memory"][p] = 1
        q["memory_scale"][p] = fluid.force_scale, fluid.moment_scale
        for i, pair in enumerate((fluid.sway, fluid.yaw, fluid.coupling)):
            q["memory_den"][p, i, : len(pair.denominator)] = pair.denominator
            q["memory_num"][p, i, : len(pair.numerator)] = pair.numerator
