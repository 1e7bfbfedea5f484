"""Commands to a running world, on any object by its id, and the notices that objects give (thesis 6.4.1 and 6.4.2).

Commands take effect at once, between two ticks.  An object that comes into a slot is new to every sensor: it has no track, no
AIS history and no bias of its predecessor.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ..config import ConfigError, Document, suggestion, validate
from ..units import DEG
from ..world.state import BEHAVIOUR_HOLD, BEHAVIOUR_REPLAY, BEHAVIOUR_WAYPOINTS, KIND_BOAT, KIND_SHIP, KIND_VESSEL, T, W
from .behaviours import Behaving, KeepCourse, write_behaviour
from .build import Names, Worlds, carry_on_from_here, write_obstacle, write_ship
from .events import happened
from .schema import OWN_SHIP, Obstacle, Scenario, Ship

_FAR = 1 << 60  # a tick that does not come
_CLASSES = {KIND_SHIP: "ship", KIND_VESSEL: "vessel", KIND_BOAT: "boat"}


@dataclass(frozen=True)
class Notice:
    """Something that happened to an object."""

    t: float  #: [s]
    #: spawned, removed, moved, waypoints_set, behaviour_set, course_set, speed_set, ais_on, ais_off, waypoint_reached,
    #: route_done; of replayed ships: appeared, vanished, handed_over; or the action of an event of the scenario
    kind: str
    id: str  #: of the object
    text: str = ""
    source: int = -1  #: number of the object among the sources


@dataclass
class Commands:
    """Commands to ``worlds[b]``.

    ``names`` [S] is the list of ids by source; spawning and deleting edit it in place.
    """

    worlds: Worlds
    b: int
    names: Names
    scenario: Scenario
    _pending: list[Notice] = field(default_factory=list)
    #: every command given, as (tick, command, arguments): what a replay needs
    log: list[tuple[int, str, dict[str, Any]]] = field(default_factory=list)

    def __post_init__(self) -> None:
        #: what each source is, or was last, called
        self.called = list(self.names)
        self._reached = self._w["routes"]["reached"].copy()
        self._done = self._w["routes"]["done"].copy()
        self._changes = self._w["replays"]["changes"].copy()
        self._stage = np.zeros_like(self._w["events"]["state"])

    # --- commands ----------------------------------------------------------------------------------------------------
    def spawn(self, id: str, spec: Mapping[str, Any]) -> int:
        """Put a new object into the world: a ship if ``spec`` has waypoints, else an obstacle (keys as in a scenario).

        Returns the number of its source.

        Raises
        ------
        ConfigError
            if the id is taken, the specification is wrong, or no slot is free.
        """
        if id in self.names or not id:
            raise ConfigError(f"spawn {id!r}: this id is taken" if id else "spawn: expected an id")
        ship = "waypoints" in spec
        group = "ships" if ship else "obstacles"
        document = Document(f"spawn {id!r}", {group: {id: dict(spec)}, "origin": self.scenario.origin.dump(),
                                              "preset": self.scenario.preset})  # fmt: skip
        one = validate(Scenario, document)
        V = self._w["vessels"]["active"].shape[0]
        active = self._w["vessels"]["active"] if ship else self._w["obstacles"]["active"]
        # a slot with a name waits for an event that lets it appear, or for the time of its track
        free = [k for k in np.flatnonzero(active == 0).tolist() if not self.names[k if ship else V + k]]
        if not free:
            raise ConfigError(f"spawn {id!r}: no free slot among {len(active)} {'vessels' if ship else 'obstacles'}")
        slot = free[0]
        source = slot if ship else V + slot
        thing: Ship | Obstacle = one.ships[id] if ship else one.obstacles[id]
        there = (self._w["vessels"]["active"] != 0) | (self._w["replays"]["count"] > 0)
        taken = {*self._w["vessels"]["mmsi"][there].tolist(),
                 *self._w["obstacles"]["mmsi"][self._w["obstacles"]["active"] != 0].tolist()}  # fmt: skip
        if thing.mmsi in taken:
            raise ConfigError(f"spawn {id!r}: mmsi {thing.mmsi} is taken")
        self._forget(source)
        mmsi = thing.mmsi or next(n for n in range(257_000_001 if ship else 992_570_001, 1 << 30) if n not in taken)
        for column in (self._w["routes"], self._w["vessels"], self._w["pilots"]) if ship else (self._w["obstacles"],):
            for name in column.dtype.names or ():
                column[name][slot] = 0
        scenario = self.scenario.model_copy(update={group: {id: thing}})
        if ship:
            write_ship(scenario, self._w, slot, id, mmsi, {OWN_SHIP: 0, id: slot})
        else:
            write_obstacle(scenario, self._w, slot, id, mmsi)
        carry_on_from_here(self._w, source)
        self._listen(source)
        self.names[source] = self.called[source] = id
        self._note("spawned", source, "spawn", {"id": id, "spec": dict(spec)})
        return source

    def delete(self, id: str) -> None:
        """Take an object out of the world; its track fades as its sensors time out."""
        source = self._find(id, "delete")
        group, slot = self._slot(source)
        group["active"][slot] = 0
        if source < len(self._changes):
            self._w["replays"]["count"][slot] = 0  # and it does not come back
        self._w["ais"]["next_tick"][source] = _FAR
        self._note("removed", source, "delete", {"id": id})
        self.names[source] = ""

    def move(self, id: str, north: float, east: float, heading_deg: float | None = None) -> None:
        """Put an object elsewhere: north, east of the origin [m], and heading."""
        source = self._find(id, "move", own=True)
        _finite("move", id, north, east, heading_deg or 0.0)
        group, slot = self._slot(source)
        self._settle()
        if "eta" in (group.dtype.names or ()):
            psi = group["eta"][slot, 2] if heading_deg is None else heading_deg * DEG
            self._end_replay(slot, BEHAVIOUR_HOLD, psi)
            group["eta"][slot] = north, east, psi
            speed = group["nu"][slot, 0]
            if group["plant"][slot] < 0:
                group["heading_set"][slot] = psi
                group["velocity"][slot] = speed * math.cos(psi), speed * math.sin(psi)
        else:
            group["position"][slot] = north, east
        carry_on_from_here(self._w, source)
        self._note("moved", source, "move", {"id": id, "north": north, "east": east, "heading_deg": heading_deg})

    def set_waypoints(self, id: str, waypoints: Sequence[Sequence[float]]) -> None:
        """Give a ship a new route, [north, east] of the origin [m] each; the first is approached first."""
        source = self._find(id, "set_waypoints", own=True)
        if source >= self._w["vessels"]["active"].shape[0]:
            raise ConfigError(f"set_waypoints {id!r}: an obstacle has no route")
        if not 1 <= len(waypoints) < W:
            raise ConfigError(f"set_waypoints {id!r}: expected 1 to {W - 1} waypoints, got {len(waypoints)}")
        for place in waypoints:
            if len(place) != 2:
                raise ConfigError(f"set_waypoints {id!r}: expected [north, east] pairs, got {list(place)!r}")
            _finite("set_waypoints", id, *place)
        self._end_replay(source, BEHAVIOUR_WAYPOINTS, float(self._w["vessels"]["eta"][source, 2]))
        route, here = self._w["routes"], self._w["vessels"]["eta"][source, :2]
        route["waypoint"][source, 0] = here
        route["waypoint"][source, 1 : 1 + len(waypoints)] = waypoints
        route["count"][source], route["leg"][source], route["done"][source] = 1 + len(waypoints), 1, 0
        route["radius"][source] = route["radius"][source] or 20.0
        for o, j in enumerate(self._w["observer"]):
            if j == source:
                self._w["nav"]["leg"][o], self._w["nav"]["route_done"][o] = 1, 0
        self._note("waypoints_set", source, "set_waypoints", {"id": id, "waypoints": [list(p) for p in waypoints]})

    def set_ais(self, id: str, on: bool) -> None:
        """Switch the AIS transmitter of an object; one without a station cannot be switched on."""
        source = self._find(id, "set_ais", own=True)
        group, slot = self._slot(source)
        if on and group["ais_class"][slot] == 0:
            raise ConfigError(f"set_ais {id!r}: carries no AIS station")
        group["ais_on"][slot] = on
        if on:
            self._listen(source)
        else:
            self._w["ais"]["next_tick"][source] = _FAR
        self._note("ais_on" if on else "ais_off", source, "set_ais", {"id": id, "on": on})

    def set_behaviour(self, id: str, behaviour: str | Mapping[str, Any]) -> None:
        """Let a ship behave otherwise from now on: what ``ships.NAME.behaviour`` of a scenario may be."""
        source = self._ship(id, "set_behaviour")
        document = Document(f"set_behaviour {id!r}", {"behaviour": behaviour})
        chosen = validate(Behaving, document).behaviour
        write_behaviour(chosen, self._w, source, _CLASSES[int(self._w["vessels"]["kind"][source])], self._vessel)
        plain = dict(behaviour) if isinstance(behaviour, Mapping) else behaviour
        self._note("behaviour_set", source, "set_behaviour", {"id": id, "behaviour": plain})

    def set_course(self, id: str, heading_deg: float) -> None:
        """Let a ship leave its route and keep a heading [deg]."""
        source = self._ship(id, "set_course")
        _finite("set_course", id, heading_deg)
        write_behaviour(KeepCourse(), self._w, source, "vessel", self._vessel)
        self._w["vessels"]["heading_set"][source] = heading_deg * DEG
        self._note("course_set", source, "set_course", {"id": id, "heading_deg": heading_deg})

    def set_speed(self, id: str, speed: float) -> None:
        """Let a ship sail at another speed [m/s]."""
        source = self._ship(id, "set_speed")
        _finite("set_speed", id, speed)
        if speed < 0.0:
            raise ConfigError(f"set_speed {id!r}: expected at least 0 m/s, got {speed:g}")
        self._w["vessels"]["speed"][source] = speed
        self._note("speed_set", source, "set_speed", {"id": id, "speed": speed})

    def apply(self, command: str, arguments: Mapping[str, Any]) -> None:
        """Give a command by name, as it stands in ``log``."""
        known = ("spawn", "delete", "move", "set_waypoints", "set_behaviour", "set_course", "set_speed", "set_ais")
        if command not in known:
            raise ConfigError(f"unknown command {command!r}{suggestion(command, known)}")
        getattr(self, command)(**arguments)

    # --- notices -----------------------------------------------------------------------------------------------------
    def notices(self) -> list[Notice]:
        """What happened since the last call, in order: commands, waypoints, replayed ships, events of the scenario."""
        route = self._w["routes"]
        for j in np.flatnonzero((route["reached"] != self._reached) | (route["done"] != self._done)).tolist():
            for k in range(int(self._reached[j]), int(route["reached"][j])):
                self._pending.append(self._notice("waypoint_reached", j, f"{k + 1} of {int(route['count'][j]) - 1}"))
            if route["done"][j] and not self._done[j]:
                self._pending.append(self._notice("route_done", j))
        self._reached[:], self._done[:] = route["reached"], route["done"]
        v, changes = self._w["vessels"], self._w["replays"]["changes"]
        for j in np.flatnonzero(changes != self._changes).tolist():
            left = v["behaviour"][j] != BEHAVIOUR_REPLAY
            self._pending.append(self._notice("handed_over" if left else "appeared" if v["active"][j] else "vanished", j))
        self._changes[:] = changes
        if (self._w["events"]["state"] != self._stage).any():
            self._pending += [Notice(t, kind, self.called[source] if source >= 0 else "", text, source)
                              for t, kind, source, text in happened(self._w, self._stage)]  # fmt: skip
            self._stage[:] = self._w["events"]["state"]
        news, self._pending = self._pending, []
        return news

    # --- inside ------------------------------------------------------------------------------------------------------
    @property
    def _w(self) -> Any:
        return self.worlds[self.b]

    def _notice(self, kind: str, source: int, text: str = "") -> Notice:
        return Notice(float(self._w["tick"] * self._w["dt"]), kind, self.called[source], text, source)

    def _note(self, kind: str, source: int, command: str, arguments: dict[str, Any]) -> None:
        self._pending.append(self._notice(kind, source, json.dumps(arguments)))
        self.log.append((int(self._w["tick"]), command, arguments))

    def _find(self, id: str, command: str, own: bool = False) -> int:
        if id and id in self.names and (own or id != OWN_SHIP):
            return self.names.index(id)
        if id == OWN_SHIP:
            raise ConfigError(f"{command} {id!r}: not possible with the own ship")
        raise ConfigError(f"{command}: unknown id {id!r}{suggestion(id, [name for name in self.names if name])}")

    def _ship(self, id: str, command: str) -> int:
        """Vessel slot of a ship that nobody controls."""
        source = self._find(id, command)
        if source >= self._w["vessels"]["active"].shape[0]:
            raise ConfigError(f"{command} {id!r}: an obstacle; expected a ship")
        return source

    def _vessel(self, name: str) -> int:
        """Vessel slot of a name that a behaviour refers to."""
        ships = self.names[: self._w["vessels"]["active"].shape[0]]
        if name not in ships:
            raise ConfigError(f"set_behaviour: unknown ship {name!r}{suggestion(name, [ship for ship in ships if ship])}")
        return ships.index(name)

    def _slot(self, source: int) -> tuple[Any, int]:
        V = self._w["vessels"]["active"].shape[0]
        return (self._w["vessels"], source) if source < V else (self._w["obstacles"], source - V)

    def _end_replay(self, slot: int, behaviour: int, psi: float) -> None:
        """A replayed ship that is given an order leaves its track for good, at its present speed."""
        v = self._w["vessels"]
        if v["behaviour"][slot] == BEHAVIOUR_REPLAY:
            v["behaviour"][slot], v["heading_set"][slot] = behaviour, psi
            v["speed"][slot] = math.hypot(*v["velocity"][slot])
            self._w["replays"]["count"][slot] = 0

    def _settle(self) -> None:
        """Bring traffic to the present tick before one of it is put elsewhere."""
        from ..engine import settle_traffic

        settle_traffic(self.worlds[self.b : self.b + 1])

    def _listen(self, source: int) -> None:
        """Let the next tick look at the transmitter, which then sends at once and goes on by its schedule."""
        group, slot = self._slot(source)
        w = self._w
        w["ais"]["next_tick"][source] = _FAR
        if group["ais_on"][slot] and group["ais_class"][slot] and w["sensors"]["ais_on"] and w["sensors"]["exteroceptive"]:
            w["ais"]["next_tick"][source] = w["tick"] + 1
            for first in ("ais_send", "next_sense"):
                self.worlds[first][self.b] = min(int(w[first]), int(w["tick"]) + 1)

    def _forget(self, source: int) -> None:
        """Make a slot new to every sensor."""
        self._settle()
        w = self._w
        for group in (w["ais"], w["tracks"], w["tracks"]["filters"], w["picture"]):
            for name in group.dtype.names:
                array = group[name]
                for axis, size in enumerate(array.shape):
                    if size in (len(self.names), len(self.names) + T):  # picture: and stretches of coast
                        array[(slice(None),) * axis + (source,)] = 0
                        break
        w["tracks"]["nearest"] = np.arange(len(self.names))
        w["ais"]["last_tick"][source] = -1
        w["ais"]["due_tick"][:, source] = w["ais"]["inbox_stamp_us"][:, source] = -1
        w["tracks"]["scan_bias_us"][:, :, source] = -1
        w["safety"]["distance"][:, source] = w["safety"]["closest"][:, source] = math.inf
        if source < len(self._reached):
            self._reached[source] = self._done[source] = 0


def _finite(command: str, id: str, *numbers: float) -> None:
    if not all(isinstance(n, int | float) and math.isfinite(n) for n in numbers):
        raise ConfigError(f"{command} {id!r}: expected finite numbers, got {list(numbers)!r}")
