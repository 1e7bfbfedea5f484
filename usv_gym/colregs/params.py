"""Parameters of encounters and scores: set A of Hagen et al. (2023), and how its distances follow vessel and geometry.

The published distances are constants for vessels of one size.  Here they are those of a *reference* encounter, and scale:

* ``k_size`` = (L_own + L_target) / (2 ``reference_length``).  The collision radius of 35 m is half the sum of two lengths of
  35 m, so that is the reference length.  All R scale with it, the moving threshold with its root (Froude).
* ``k_geometry`` = relative speed at the start / ``reference_speed``.  The stage ranges R2, R3, R4 scale with the larger of the
  two factors: 190 s, 70 s and 20 s before contact at least, however slowly two vessels meet.

``scaled: false`` gives the published constants back (:data:`PUBLISHED`).
"""

from __future__ import annotations

import functools
import itertools
from typing import Any, Literal, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from ..config import Model, problem
from ..units import DEG


class Params(Model):
    """Set A.  Distances [m] of the reference encounter, angles [deg], times [s]."""

    r2: float = Field(default=1900.0, gt=0, description="[m] stage 2 begins: the rules apply")
    r3: float = Field(default=700.0, gt=0, description="[m] stage 3: the stand-on vessel may act")
    r4: float = Field(default=200.0, gt=0, description="[m] stage 4: the stand-on vessel shall act")
    r_pref: float = Field(default=200.0, gt=0, description="[m] preferred separation; also where risk of collision begins")
    r_min: float = Field(default=100.0, gt=0, description="[m] least acceptable separation")
    r_nm: float = Field(default=50.0, gt=0, description="[m] near miss")
    r_col: float = Field(default=35.0, ge=0, description="[m] contact")
    scaled: bool = Field(default=True, strict=True, description="distances follow vessel and geometry")
    reference_length: float = Field(default=35.0, gt=0, description="[m]")
    reference_speed: float = Field(default=10.0, gt=0, description="[m/s] relative")
    moving: float = Field(default=2.0, ge=0, description="[m/s] slower is not under way")
    exit_factor: float = Field(default=1.05, ge=1, description="an encounter ends beyond this times R2")
    emergency_tcpa: float = Field(default=60.0, gt=0, description="[s]")
    alpha13_deg: float = Field(default=45.0, gt=0, lt=180, description="passing ahead of an overtaken vessel: |alpha| below")
    alpha15_deg: tuple[float, float] = Field(default=(-25.0, 165.0), description="crossing ahead: alpha between")
    course_md_deg: float = Field(default=2.0, ge=0, description="smallest detectable change of course")
    course_app_deg: float = Field(default=30.0, gt=0, description="readily apparent change of course")
    speed_md: float = Field(default=0.07, ge=0, lt=1, description="smallest detectable relative change of speed")
    speed_app: float = Field(default=0.25, gt=0, le=1, description="readily apparent relative change of speed")
    turn_rate_md_deg: float = Field(default=0.6, ge=0, description="[deg/s] detectable turn")
    acceleration_md: float = Field(default=0.05, ge=0, description="[m/s2] detectable change of speed")

    @model_validator(mode="after")
    def _in_order(self) -> Self:
        for names in (("r2", "r3", "r4"), ("r_pref", "r_min", "r_nm", "r_col")):
            for far, near in itertools.pairwise(names):
                if not getattr(self, far) > getattr(self, near):
                    raise problem(f"expected less than {far} = {getattr(self, far):g}, got {getattr(self, near):g}", near)
        for low, high in (("course_md_deg", "course_app_deg"), ("speed_md", "speed_app")):
            if not getattr(self, high) > getattr(self, low):
                raise problem(f"expected more than {low} = {getattr(self, low):g}, got {getattr(self, high):g}", high)
        return self

    def record(self) -> NDArray[Any]:
        """What the kernels read: one record [1] of :func:`params_dtype`, in radians."""
        row: NDArray[Any] = np.zeros(1, params_dtype())
        for name in row.dtype.names or ():
            row[name] = getattr(self, f"{name}_deg") * DEG if f"{name}_deg" in type(self).model_fields else getattr(self, name)
        return row


ProfileName = Literal["scaled", "hagen2023", "ccta2023"]
PUBLISHED = Params(scaled=False)  #: the constants of the paper's simulations (its table 6)
PROFILES: dict[ProfileName, Params] = {
    "scaled": Params(),
    "hagen2023": PUBLISHED,
    # the values of the demonstration at CCTA 2023
    "ccta2023": Params(scaled=False, r2=2500.0, r3=1100.0, r_pref=190.0, r_col=30.0, turn_rate_md_deg=0.3, speed_md=0.2,
                       speed_app=0.5),
}  # fmt: skip


@functools.cache
def params_dtype() -> np.dtype[Any]:
    """dtype of the part of the parameters that kernels need."""
    names = ("r2", "r3", "r4", "r_pref", "scaled", "reference_length", "reference_speed", "moving", "exit_factor",
             "emergency_tcpa", "course_md", "course_app", "speed_md", "speed_app", "turn_rate_md",
             "acceleration_md")  # fmt: skip
    return np.dtype([(name, "f8") for name in names])
