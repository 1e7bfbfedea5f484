"""What a ship does that nobody controls: the schema of ``ships.NAME.behaviour``, and how it becomes part of a record.

A behaviour is a word, or a mapping with ``kind`` and options.  docs/traffic.md says what each does; the kernels are in
``usv_gym.traffic``.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Annotated, Any, Literal, NamedTuple, get_args

from pydantic import BeforeValidator, Discriminator, Field

from ..config import Model, problem, suggestion
from ..units import DEG
from ..world import state
from .sensor_schema import Positive

Angle = Annotated[float, Field(strict=True, gt=0, le=90)]
Spread = Annotated[float, Field(strict=True, ge=0, le=180)]


class WatchKeeping(NamedTuple):
    """How a COLREGs-obeying ship of a class is sailed when the file does not say; assumptions of this project."""

    range: float  # [m]
    act_time: float  # [s]
    extremis_time: float  # [s]
    clearance: float  # [m]
    acceleration: float  # [m/s2]


WATCHES: Mapping[str, WatchKeeping] = {
    "ship": WatchKeeping(4000.0, 240.0, 90.0, 150.0, 0.05),
    "vessel": WatchKeeping(2000.0, 120.0, 45.0, 60.0, 0.1),
    "boat": WatchKeeping(1000.0, 60.0, 20.0, 30.0, 0.5),
}


class KeepCourse(Model):
    """Keeps the heading that it starts with; waypoints after the second do not matter."""

    kind: Literal["keep_course"] = "keep_course"


class Waypoints(Model):
    """Follows its route whatever comes."""

    kind: Literal["waypoints", "ignorant"] = "waypoints"


class Colregs(Model):
    """Follows its route and obeys the COLREGs: gives way early and to starboard, stands on, acts in extremis, returns."""

    kind: Literal["colregs"] = "colregs"
    range: Positive | None = Field(default=None, description="[m] within which it heeds other vessels; default: by class")
    act_time: Positive | None = Field(default=None, description="TCPA [s] at which it gives way; default: by class")
    extremis_time: Positive | None = Field(
        default=None, description="TCPA [s] at which it acts although it is to stand on; default: by class"
    )
    clearance: Positive | None = Field(default=None, description="[m] between hulls that it is content with")
    alteration_deg: Angle = Field(default=30.0, description="smallest alteration of course, to be readily apparent")
    look_interval: Positive = Field(default=2.0, description="[s] between two looks around")
    acceleration: Positive | None = Field(default=None, description="[m/s2] of changes of speed; default: by class")


class Hostile(Model):
    """Leaves its route to pass ahead of another vessel, gives way to nobody, and then sails on."""

    kind: Literal["hostile"] = "hostile"
    target: str = Field(default="own_ship", description="whom it passes ahead of")
    range: Positive = Field(default=1000.0, description="[m] from which on it does")
    ahead: Positive = Field(default=40.0, description="how far ahead of the bow it aims [m]")


class Erratic(Model):
    """A leisure boat: wanders about its route with changes of course and speed that nobody can foresee; never stops."""

    kind: Literal["erratic"] = "erratic"
    wander: Positive = Field(default=150.0, description="distance from its route that it never exceeds [m]")
    whim_interval: Positive = Field(default=15.0, description="mean time between changes [s]")
    spread_deg: Spread = Field(default=100.0, description="largest angle off its route")
    acceleration: Positive = Field(default=0.5, description="[m/s2] of changes of speed")


Behaviours = KeepCourse | Waypoints | Colregs | Hostile | Erratic
#: fields of ``pilots`` that a behaviour sets, in the order of an event's values after the code
PARAMETERS = ("range", "period_us", "act_time", "extremis_time", "clearance", "alteration", "acceleration", "ahead", "target",
              "wander")  # fmt: skip
KINDS = tuple(kind for model in get_args(Behaviours) for kind in get_args(model.model_fields["kind"].annotation))


def _by_kind(value: Any) -> Any:
    if isinstance(value, Model):
        return value
    kind = value.get("kind") if isinstance(value, Mapping) else value
    if kind not in KINDS:
        where = ("kind",) if isinstance(value, Mapping) and "kind" in value else ()
        known = f"expected one of {', '.join(KINDS)}, got {kind!r}"
        if isinstance(value, Mapping) and kind is None:
            raise problem("required key 'kind' is missing")
        hint = suggestion(kind, KINDS)
        raise problem(known + (hint if hint.startswith("; did") else ""), *where)
    return {"kind": kind} if isinstance(value, str) else value


Behaviour = Annotated[
    Annotated[Behaviours, Discriminator("kind")], BeforeValidator(_by_kind, json_schema_input_type=str | Behaviours)
]


class Behaving(Model):
    """A behaviour by itself, as a command gives it."""

    behaviour: Behaviour


def as_numbers(behaviour: Behaviours, ship_class: str, find: Callable[[str], int]) -> tuple[int, dict[str, float]]:
    """Code of a behaviour, and its fields of the record's ``pilots``; those that it does not need are 0.

    ``find`` gives the vessel slot of a name; ``ship_class`` decides what the options leave open.
    """
    numbers = dict.fromkeys(PARAMETERS, 0.0)
    if isinstance(behaviour, KeepCourse):
        return state.BEHAVIOUR_HOLD, numbers
    if isinstance(behaviour, Waypoints):
        return state.BEHAVIOUR_WAYPOINTS, numbers
    if isinstance(behaviour, Colregs):
        for name, usual in WATCHES[ship_class]._asdict().items():
            given = getattr(behaviour, name)
            numbers[name] = usual if given is None else given
        more = {"alteration": behaviour.alteration_deg * DEG, "period_us": round(behaviour.look_interval * 1e6)}
        return state.BEHAVIOUR_COLREGS, numbers | more
    if isinstance(behaviour, Hostile):
        more = {"range": behaviour.range, "ahead": behaviour.ahead, "target": find(behaviour.target)}
        return state.BEHAVIOUR_HOSTILE, numbers | more
    more = {"wander": behaviour.wander, "acceleration": behaviour.acceleration, "alteration": behaviour.spread_deg * DEG,
            "period_us": round(behaviour.whim_interval * 1e6)}  # fmt: skip
    return state.BEHAVIOUR_ERRATIC, numbers | more


def write_behaviour(behaviour: Behaviours, w: Any, j: int, ship_class: str, find: Callable[[str], int]) -> None:
    """Give the ship in vessel slot j a behaviour from now on."""
    code, numbers = as_numbers(behaviour, ship_class, find)
    p, v = w["pilots"], w["vessels"]
    for name in p.dtype.names or ():
        p[name][j] = numbers.get(name, 0.0)
    p["factor"][j], p["next_tick"][j] = 1.0, w["tick"]
    v["behaviour"][j], v["heading_set"][j] = code, v["eta"][j, 2]
