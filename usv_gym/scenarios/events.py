"""Schema of a scenario's ``events``: what happens, and when; and how it becomes the table in a record.

docs/events.md says what each action does; the kernel is ``usv_gym/events.py``.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Annotated, Any, Literal, Self, get_args

from pydantic import BeforeValidator, Discriminator, Field, model_validator

from ..config import Model, problem, suggestion
from ..units import DEG, KNOT
from ..world import state
from ..world.vessel import KinematicModel, VesselModel
from .behaviours import PARAMETERS, Behaviour, as_numbers
from .places import Direction, Name, Position
from .sensor_schema import NonNegative, Number, Positive, Share

Pair = tuple[Number, Number]

#: what rain, fog and snow of intensity 1 do: share of the range of radar and of LiDAR that is left, share of detections,
#: false alarms per scan of radar and of LiDAR.  Intensity 1 is heavy: 50 mm/h of rain, fog of 50 m visibility, a snow squall.
#: Assumptions of this project: rain clutters the radar, fog blinds the LiDAR, snow does a little of both
PRECIPITATION: Mapping[str, tuple[float, float, float, float, float]] = {
    "rain": (0.75, 0.5, 0.9, 1.0, 0.1),
    "fog": (1.0, 0.2, 1.0, 0.0, 0.05),
    "snow": (0.9, 0.35, 0.9, 0.4, 0.3),
}


def precipitation(kind: str, intensity: float) -> tuple[float, ...]:
    """Factors of radar range, LiDAR range and detection, and added false alarms per scan of radar and LiDAR."""
    *factors, radar, lidar = PRECIPITATION[kind]
    return *(1.0 - intensity * (1.0 - factor) for factor in factors), intensity * radar, intensity * lidar


class When(Model):
    """A source comes near the own ship or a place, or its closest approach to the own ship is near in time."""

    target: Name = Field(default="own_ship", description="whose distance or TCPA counts")
    nearer_than: Positive | None = Field(default=None, description="distance of the centres [m]")
    point: Position | None = Field(default=None, description="place that the distance is from; default: the own ship")
    tcpa_below: Positive | None = Field(default=None, description="[s] to the closest approach to the own ship")

    @model_validator(mode="after")
    def _one_trigger(self) -> Self:
        if (self.nearer_than is None) == (self.tcpa_below is None):
            raise problem("expected nearer_than or tcpa_below")
        if self.point is not None and self.tcpa_below is not None:
            raise problem("a TCPA is to the own ship, not to a point", "point")
        if self.point is None and self.target == "own_ship":
            raise problem("expected a ship or an obstacle, or a point that the own ship comes near", "target")
        return self


class _Event(Model):
    at: NonNegative | None = Field(default=None, description="time [s]")
    when: When | None = Field(default=None, description="what has to happen first")
    duration: Positive | None = Field(default=None, description="[s]; default: for good")

    @model_validator(mode="after")
    def _has_trigger(self) -> Self:
        if (self.at is None) == (self.when is None):
            raise problem("expected one of 'at' (a time [s]) and 'when'")
        return self

    def values(self) -> Sequence[float]:
        """What the action needs to know, as it stands in the record."""
        return ()


class Plain(_Event):
    """A fault of the own ship's receivers and sensors that is there or not."""

    action: Literal["ais_jammed", "gnss_frozen", "radar_outage", "lidar_outage"]


class AisSilent(_Event):
    """The AIS station of a ship or obstacle sends nothing."""

    action: Literal["ais_silent"]
    target: Name


class AisSpoofed(_Event):
    """The AIS station of a ship or obstacle reports a false position, under its own MMSI or another."""

    action: Literal["ais_spoofed"]
    target: Name
    offset: Pair = Field(default=(0.0, 0.0), description="north, east [m]")
    rate: Pair = Field(default=(0.0, 0.0), description="of the offset [m/s]")
    mmsi: Annotated[int, Field(strict=True, ge=201_000_000, le=997_999_999)] | None = None

    def values(self) -> Sequence[float]:
        """Offset, its rate, MMSI (0: its own); the phantom follows."""
        return *self.offset, *self.rate, self.mmsi or 0


class GnssDrifting(_Event):
    """The position of the GNSS is off."""

    action: Literal["gnss_drifting"]
    offset: Pair = Field(default=(0.0, 0.0), description="north, east [m]")
    rate: Pair = Field(default=(0.0, 0.0), description="of the offset [m/s]")

    def values(self) -> Sequence[float]:
        """Offset and its rate."""
        return *self.offset, *self.rate


class Shower(_Event):
    """Rain, fog or snow, on top of the weather."""

    action: Literal["rain", "fog", "snow"]
    intensity: Share = 1.0

    def values(self) -> Sequence[float]:
        """Factors and false alarms."""
        return precipitation(self.action, self.intensity)


class ActuatorFault(_Event):
    """A thruster of the own ship holds its nozzle, or shaft and bucket, where they are, or loses thrust."""

    action: Literal["jet_stuck", "nozzle_stuck", "reduced_thrust"]
    thruster: str = Field(default="all", description="by its name in the vessel file")
    left: Share = Field(default=0.5, description="share of the thrust that is left (reduced_thrust)")

    def values(self) -> Sequence[float]:
        """What is left."""
        return (self.left,)


class ChangeCourse(_Event):
    """A ship leaves its route for a heading; afterwards it does what it did before."""

    action: Literal["change_course"]
    target: Name
    to_deg: Direction | None = None
    by_deg: Direction | None = Field(default=None, description="positive to starboard")

    @model_validator(mode="after")
    def _one_course(self) -> Self:
        if (self.to_deg is None) == (self.by_deg is None):
            raise problem("expected one of 'to_deg' and 'by_deg'")
        return self

    def values(self) -> Sequence[float]:
        """Angle [rad], and whether it is added to the heading."""
        return (self.to_deg * DEG, 0.0) if self.to_deg is not None else ((self.by_deg or 0.0) * DEG, 1.0)


class ChangeSpeed(_Event):
    """A ship sails faster or slower."""

    action: Literal["change_speed"]
    target: Name
    speed: NonNegative | None = Field(default=None, description="[m/s]")
    speed_kn: NonNegative | None = Field(default=None, description="[kn]")

    @model_validator(mode="after")
    def _one_speed(self) -> Self:
        if (self.speed is None) == (self.speed_kn is None):
            raise problem("expected one of 'speed' and 'speed_kn'")
        return self

    def values(self) -> Sequence[float]:
        """Speed [m/s]."""
        return (self.speed if self.speed is not None else KNOT * (self.speed_kn or 0.0),)


class ChangeBehaviour(_Event):
    """A ship behaves otherwise."""

    action: Literal["change_behaviour"]
    target: Name
    behaviour: Behaviour


class Spawn(_Event):
    """A ship or obstacle of the scenario is not there before; after the duration it is gone again."""

    action: Literal["spawn"]
    target: Name


class Delete(_Event):
    """A ship or obstacle leaves the world."""

    action: Literal["delete"]
    target: Name

    @model_validator(mode="after")
    def _for_good(self) -> Self:
        if self.duration is not None:
            raise problem("what is deleted does not come back", "duration")
        return self


Events = (
    Plain | AisSilent | AisSpoofed | GnssDrifting | Shower | ActuatorFault | ChangeCourse | ChangeSpeed | ChangeBehaviour
    | Spawn | Delete
)  # fmt: skip
ACTIONS = tuple(action for model in get_args(Events) for action in get_args(model.model_fields["action"].annotation))


def _known_action(value: Any) -> Any:
    if isinstance(value, Mapping):
        if "action" not in value:
            raise problem("required key is missing", "action")
        if value["action"] not in ACTIONS:
            raise problem(f"unknown action {value['action']!r}{suggestion(value['action'], ACTIONS)}", "action")
    return value


Event = Annotated[
    Annotated[Events, Discriminator("action")], BeforeValidator(_known_action, json_schema_input_type=Events)
]


# --- checks ----------------------------------------------------------------------------------------------------------
def check_targets(events: Sequence[Events], ships: Mapping[str, bool], obstacles: Sequence[str]) -> None:
    """Refuse targets that are not there, or that an action cannot have (validator of ``Scenario``).

    ``ships`` says of each whether it sails a recorded track.
    """
    appears: set[str] = set()
    spoofed: set[str] = set()
    for i, event in enumerate(events):
        target = getattr(event, "target", None)
        if event.when is not None:
            _known_target(event.when.target, ["own_ship", *ships, *obstacles], "events", i, "when", "target")
        if target is None:
            continue
        moves = isinstance(event, ChangeCourse | ChangeSpeed | ChangeBehaviour)
        own = ["own_ship"] if isinstance(event, AisSilent | AisSpoofed) else []
        if target in obstacles and moves:
            raise problem(f"{target!r} is an obstacle; expected a ship", "events", i, "target")
        if target == "own_ship" and not own:
            raise problem(f"not possible with the own ship: {event.action}", "events", i, "target")
        _known_target(target, [*own, *ships, *([] if moves else obstacles)], "events", i, "target")
        if ships.get(target) and isinstance(event, Spawn):
            raise problem(f"{target!r} comes and goes with its track", "events", i, "target")
        if ships.get(target) and event.duration is not None and moves:
            raise problem(f"{target!r} leaves its track for good", "events", i, "duration")
        if isinstance(event, ChangeBehaviour) and hasattr(event.behaviour, "target"):
            others = ["own_ship", *(ship for ship in ships if ship != target)]
            _known_target(event.behaviour.target, others, "events", i, "behaviour", "target")
        for once, kind in ((appears, Spawn), (spoofed, AisSpoofed)):
            if isinstance(event, kind):
                if target in once:
                    raise problem(f"{target!r} has such an event already", "events", i, "target")
                once.add(target)


def _known_target(name: str, known: Sequence[str], *key: str | int) -> None:
    if name not in known:
        raise problem(f"unknown object {name!r}{suggestion(name, known)}", *key)


def unfit(event: Events, model: VesselModel | KinematicModel) -> tuple[str, str] | None:
    """(key, what is wrong) if a vessel cannot have this event."""
    if not isinstance(event, ActuatorFault):
        return None
    if isinstance(model, KinematicModel):
        return "action", f"vessel {model.name!r} has no thrusters that could fail"
    names = [thruster.name for thruster in model.thrusters]
    if event.thruster not in ("all", *names):
        return "thruster", f"vessel {model.name!r} has no thruster {event.thruster!r}{suggestion(event.thruster, names)}"
    if event.action == "nozzle_stuck" and not any(
        thruster.nozzle_max_deg for thruster in model.thrusters if event.thruster in ("all", thruster.name)
    ):
        return "thruster", f"vessel {model.name!r}: {event.thruster} has no nozzle"
    return None


# --- the record ------------------------------------------------------------------------------------------------------
def waiting(events: Sequence[Events]) -> set[str]:
    """Names of the objects that are not there at the start."""
    return {event.target for event in events if isinstance(event, Spawn)}


def phantoms(events: Sequence[Events], clutter: bool) -> list[str]:
    """Names of the phantoms that a record needs, from the last obstacle slot downwards."""
    echoes = [f"{sensor}_false_{n}" for sensor, count in (("radar", state.RADAR_PHANTOMS), ("lidar", state.LIDAR_PHANTOMS))
              for n in range(1, count + 1)]  # fmt: skip
    spoofs = [f"spoofed_{event.target}" for event in events if isinstance(event, AisSpoofed)]
    return [*(echoes if clutter else []), *spoofs]


def write_events(
    events: Sequence[Events],
    w: Any,
    *,
    find: Callable[[str], int],
    local: Callable[[Any], tuple[float, float]],
    thrusters: Sequence[str],
    classes: Mapping[str, str],
) -> None:
    """Write the table of events of a record.

    ``find`` gives the source of a name, ``local`` a place in {n}; ``thrusters`` are the own ship's, ``classes`` those of the
    ships.
    """
    e = w["events"]
    w["events_left"] = len(events)
    for i, event in enumerate(events):
        e["action"][i] = state.EVENTS.index(event.action)
        e["duration"][i] = math.inf if event.duration is None else event.duration
        e["point"][i] = math.nan
        if event.when is None:
            e["trigger"][i], e["threshold"][i] = state.TRIGGER_TIME, event.at
        else:
            near = event.when.nearer_than
            e["trigger"][i] = state.TRIGGER_TCPA if near is None else state.TRIGGER_DISTANCE
            e["threshold"][i] = event.when.tcpa_below if near is None else near
            e["subject"][i] = find(event.when.target)
            if event.when.point is not None:
                e["point"][i] = local(event.when.point)
        if isinstance(event, ActuatorFault):
            e["target"][i] = -1 if event.thruster == "all" else list(thrusters).index(event.thruster)
        elif hasattr(event, "target"):
            e["target"][i] = find(event.target)
        values = [float(x) for x in event.values()]
        if isinstance(event, AisSpoofed):
            values.append(find(f"spoofed_{event.target}"))
        elif isinstance(event, ChangeBehaviour):
            code, parameters = as_numbers(event.behaviour, classes[event.target], find)
            values = [code, *(parameters[name] for name in PARAMETERS)]
        e["value"][i, : len(values)] = values


# --- what happened ---------------------------------------------------------------------------------------------------
#: actions that are about an object; the others are about the own ship or the air
_ABOUT_OBJECTS = {"ais_silent", "ais_spoofed", "change_course", "change_speed", "change_behaviour", "spawn", "delete"}


def happened(w: Any, before: Any) -> list[tuple[float, str, int, str]]:
    """(time [s], action, source or -1, "begins" or "ends") of what came about in a record since its states were ``before``."""
    table, found = w["events"], []
    for i in range(len(before)):
        for stage, column, text in ((1, "began", "begins"), (2, "ended", "ends")):
            if before[i] < stage <= table["state"][i]:
                action = state.EVENTS[table["action"][i]]
                source = int(table["target"][i]) if action in _ABOUT_OBJECTS else -1
                found.append((float(table[column][i] * w["dt_us"] / 1e6), action, source, text))
    return sorted(found, key=lambda event: event[0])
