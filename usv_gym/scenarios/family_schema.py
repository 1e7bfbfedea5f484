"""What a scenario may say of its family: the keys that all have, and those of the families that take more."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, Literal, Self, TypeAlias

from pydantic import AfterValidator, BeforeValidator, Discriminator, Field, Tag, field_validator, model_validator

from ..config import Model, problem, read_yaml, suggestion
from ..resources import shipped
from ..world.vessel import VesselModel
from .families import FAMILIES
from .sensor_schema import NonNegative, Number, Positive, Share

REFERENCE_DISTANCE = 900.0  #: [m] from start to meeting that the distances of a task are made for: Odin's, in 180 s

EncounterName = Literal["head_on", "crossing_give_way", "crossing_stand_on", "overtaking", "overtaken"]
ENCOUNTER_NAMES: tuple[EncounterName, ...] = (
    "head_on", "crossing_give_way", "crossing_stand_on", "overtaking", "overtaken",
)  # fmt: skip
MOST_SHIPS = 7  #: that the family ``encounter`` puts into one world


def time_to_meet(model: VesselModel) -> float:
    """Shortest time [s] from the start to a closest point that gives a vessel a chance: 60 s, or ten lengths sailed."""
    return max(60.0, 10.0 * model.length / model.cruise_speed)


class Family(Model):
    """What is drawn anew at every reset, on top of the rest of the scenario."""

    name: str
    difficulty: Share = Field(default=0.5, description="0 to 1: how much there is, and how near it comes")
    failures: Share = Field(default=0.0, description="0 to 1: how much goes wrong in an episode; 0: nothing")
    weather: Literal["random", "scenario"] = Field(
        default="random", description="drawn by difficulty, or that of the scenario (the rule where one is given)"
    )

    @field_validator("name")
    @classmethod
    def _known(cls, value: str) -> str:
        if value not in FAMILIES:
            raise problem(f"unknown family {value!r}{suggestion(value, FAMILIES)}")
        return value

    def duration(self, model: VesselModel) -> float:
        """Time [s] after which an episode is truncated, where the scenario does not say."""
        return FAMILIES[self.name].reach / model.cruise_speed

    def scale(self, model: VesselModel) -> float:
        """Factor of the distances by which a task observes and rewards, where the scenario does not say."""
        return 1.0


# --- Imazu -----------------------------------------------------------------------------------------------------------
def imazu_cases() -> dict[str, list[dict[str, Any]]]:
    """Targets of every case in ``configs/imazu/cases.yaml``, by its two-digit name; the variants have a letter behind."""
    cases: dict[str, list[dict[str, Any]]] = read_yaml(shipped("imazu")["cases"]).data["cases"]
    return cases


def _case_name(value: Any) -> Any:
    """``5``, ``05`` (a number in YAML), ``"5"`` and ``"8b"`` as ``05`` and ``08b``."""
    if isinstance(value, int | float) and not isinstance(value, bool) and value == int(value):
        return f"{int(value):02d}"
    return value.zfill(len(value.lstrip("0123456789")) + 2) if isinstance(value, str) and value[:1].isdigit() else value


def _case_names(value: Any) -> Any:
    if value == "all":
        return [name for name in imazu_cases() if name.isdigit()]
    return [_case_name(item) for item in value] if isinstance(value, list | tuple) else [_case_name(value)]


class Imazu(Family):
    """The 22 cases of Imazu: all ships reach one point at the same time if nobody manoeuvres."""

    name: Literal["imazu"]
    case: Annotated[
        tuple[str, ...], BeforeValidator(_case_names, json_schema_input_type=str | int | list[str | int]), Field(min_length=1)
    ] = Field(
        default="all", validate_default=True, description="a number, a variant as 8b, a list, or all 22; drawn at reset"
    )
    time: Positive | None = Field(
        default=None, description="[s] to the meeting point; 1800 as published; default 180, or thirty lengths sailed"
    )
    heading_jitter_deg: Annotated[float, Field(strict=True, ge=0, le=45)] = Field(
        default=0.0, description="[deg] largest deviation of the own ship's heading at the start (Sawada 2021: 5)"
    )

    @field_validator("case")
    @classmethod
    def _there_is_such_a_case(cls, value: tuple[str, ...]) -> tuple[str, ...]:
        known = imazu_cases()
        for name in value:
            if name not in known:
                raise problem(f"unknown case {name!r}; expected 1 to 22, all, or one of {', '.join(list(known)[22:])}")
        return value

    def meeting_time(self, model: VesselModel) -> float:
        """Time [s] at which all reach the meeting point."""
        return self.time or 3.0 * time_to_meet(model)

    def duration(self, model: VesselModel) -> float:
        """Half as long again as the way through the meeting point and as far behind it takes."""
        return 3.0 * self.meeting_time(model)

    def scale(self, model: VesselModel) -> float:
        """Share of the reference distance that the own ship has to the meeting point."""
        return model.cruise_speed * self.meeting_time(model) / REFERENCE_DISTANCE


# --- encounters ------------------------------------------------------------------------------------------------------
def _pair(value: Any) -> Any:
    """One number stands for a range of one."""
    return (value, value) if isinstance(value, int | float) and not isinstance(value, bool) else value


def _in_order(value: tuple[Any, Any]) -> tuple[Any, Any]:
    if value[0] > value[1]:
        raise problem(f"expected [least, most], got [{value[0]:g}, {value[1]:g}]")
    return value


_Order = AfterValidator(_in_order)
_Pair = BeforeValidator(_pair, json_schema_input_type=float | tuple[float, float])
PositiveRange: TypeAlias = Annotated[tuple[Positive, Positive], _Pair, _Order]
Distances: TypeAlias = Annotated[tuple[NonNegative, NonNegative], _Pair, _Order]
Numbers: TypeAlias = Annotated[tuple[Number, Number], _Pair, _Order]
_Count = Annotated[int, Field(strict=True, ge=1, le=MOST_SHIPS)]

#: where the ship may bear at the start [deg], clockwise off the own bow (the sectors of world/encounter.py), and its speed as
#: a multiple of the own
SECTORS: Mapping[EncounterName, tuple[float, float]] = {
    "head_on": (-13.0, 13.0), "crossing_give_way": (10.0, 112.5), "crossing_stand_on": (-112.5, -10.0),
    "overtaking": (-45.0, 45.0), "overtaken": (112.5, 247.5),
}  # fmt: skip
RATIOS: Mapping[EncounterName, tuple[float, float]] = {
    "head_on": (0.5, 2.0), "crossing_give_way": (0.5, 2.0), "crossing_stand_on": (0.5, 2.0),
    "overtaking": (0.3, 0.75), "overtaken": (1.35, 2.5),
}  # fmt: skip


class Encounters(Family):
    """Ships that meet the own ship in encounters of wanted classes, drawn by distance and time of the closest point (CPA)."""

    name: Literal["encounter"]
    classes: Annotated[tuple[EncounterName, ...], Field(min_length=1)] = Field(
        default=ENCOUNTER_NAMES, description="what is drawn from, evenly, for each ship"
    )
    ships: Annotated[tuple[_Count, _Count], _Pair, _Order] | None = Field(
        default=None, description="least and most; default: 1, up to 4 with difficulty"
    )
    together: Annotated[tuple[EncounterName, ...], Field(max_length=MOST_SHIPS)] = Field(
        default=(), description="exactly these, one ship each, instead of classes and ships"
    )
    dcpa: Distances | None = Field(
        default=None, description="[m] between the middles of the ships; default: from 0, less with difficulty"
    )
    tcpa: PositiveRange | None = Field(
        default=None, description="[s] from the start; default: 60 to 180, or ten to thirty own lengths sailed"
    )
    bearing_deg: Numbers | None = Field(
        default=None, description="[deg] of the ship off the own bow at the start, clockwise; default: all of the class"
    )
    speed_ratio: PositiveRange | None = Field(default=None, description="its speed / own speed; default: by class")

    @model_validator(mode="after")
    def _can_be_met(self) -> Self:
        for name in dict.fromkeys(self.together or self.classes):
            if self.bearing_deg is not None:
                low, high = SECTORS[name]
                if not any(self.bearing_deg[0] + turn < high and self.bearing_deg[1] + turn > low for turn in (-360, 0, 360)):
                    raise problem(f"a ship on these bearings is not {name}: expected {low:g} to {high:g}", "bearing_deg")
            if self.speed_ratio is not None and (
                (name == "overtaking" and self.speed_ratio[0] >= 1.0) or (name == "overtaken" and self.speed_ratio[1] <= 1.0)
            ):
                raise problem(f"{name} needs a ship that is {'slower' if name == 'overtaking' else 'faster'}", "speed_ratio")
        return self

    def times(self, model: VesselModel) -> tuple[float, float]:
        """Least and largest time to the closest point [s]."""
        least = time_to_meet(model)
        return self.tcpa or (least, 3.0 * least)

    def duration(self, model: VesselModel) -> float:
        """Three times the latest closest point."""
        return 3.0 * self.times(model)[1]

    def scale(self, model: VesselModel) -> float:
        """Share of the reference distance that the own ship sails to the latest closest point."""
        return model.cruise_speed * self.times(model)[1] / REFERENCE_DISTANCE


# --- by name ---------------------------------------------------------------------------------------------------------
def _by_name(value: Any) -> Any:
    return {"name": value} if isinstance(value, str) else value


def _kind(value: Any) -> str:
    name = value.get("name") if isinstance(value, Mapping) else getattr(value, "name", None)
    return name if isinstance(name, str) and name in ("imazu", "encounter") else "plain"


AnyFamily: TypeAlias = Annotated[
    Annotated[
        Annotated[Imazu, Tag("imazu")] | Annotated[Encounters, Tag("encounter")] | Annotated[Family, Tag("plain")],
        Discriminator(_kind),
    ],
    BeforeValidator(_by_name, json_schema_input_type=str | Imazu | Encounters | Family),
]

