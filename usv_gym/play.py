"""What the live window can show: a mission under way, steered by hand or by a policy, and a recorded episode."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from .config import ConfigError
from .render.desk import Thing
from .render.palette import PALETTES
from .render.panel import clock
from .render.primitives import Primitive, Scene
from .render.scene import History, scene_from_episode, scene_from_snapshot, sea_from_record
from .render.scene_episode import sea_from_episode
from .render.sea import HULLS, OBSTACLES, Sea
from .replay.archive import Episode
from .run import plan
from .scenarios.commands import Commands
from .scenarios.loader import Source, load_scenario
from .units import KNOT
from .voyage import BY_HAND, Mission, Voyage
from .world.state import AIS_NONE

INTERVAL = 0.1  #: [s] control interval, about, when the user steers
BUDGET = 0.04  #: [s] of real time that a frame may spend on simulating; what does not fit is left out
ENDINGS = {"collision": "collision", "arrival": "arrived", "out_of_area": "left the area", "time_limit": "time is up",
           "grounding": "aground", "log_end": "the log is over"}  # fmt: skip


def plan_by_hand(source: Source, *, vessel: str | None = None, overrides: Sequence[str] = (), seed: int = 0) -> Mission:
    """A mission that the user steers, with an action every tenth of a second."""
    dt = load_scenario(source, overrides=overrides, vessel=vessel).simulation.dt
    interval = f"simulation.control_interval={dt * max(round(INTERVAL / dt), 1)!r}"
    return replace(
        plan(source, policy="idle", vessel=vessel, overrides=[interval, *overrides], seed=seed), policy=BY_HAND
    )


class Live:
    """A voyage as it is shown.  Between two control steps everything glides, one step behind the world at most."""

    span: tuple[float, float] | None = None

    def __init__(self, mission: Mission) -> None:
        """Start it."""
        self.mission = mission
        self.name = mission.scenario.name
        self.manual = mission.policy == BY_HAND
        self.restart()

    def restart(self) -> None:
        """Begin anew."""
        self.voyage = Voyage(self.mission)
        self.commands: Commands | None = self.voyage.commands
        self.history = History()
        self._news: list[str] = []
        self._hit = -1
        self._key: tuple[int, float, int] | None = None
        self._remember()
        self._shown = self.voyage.t

    # --- time --------------------------------------------------------------------------------------------------------
    @property
    def t(self) -> float:
        """Time that is shown [s]."""
        return self._shown

    @property
    def ended(self) -> str:
        """Why it is over, once all of it has been shown."""
        outcome = self.voyage.outcome
        return ENDINGS.get(outcome, outcome) if outcome and self._shown >= self.voyage.t else ""

    def advance(self, seconds: float, demand: tuple[float, float]) -> None:
        """Let simulated time pass, as much of it as the computer manages."""
        wanted, began = self._shown + seconds, time.perf_counter()
        while self.voyage.t < wanted and not self.voyage.outcome:
            if time.perf_counter() - began > BUDGET:
                break
            self._step(demand)
        self._shown = min(wanted, self.voyage.t)

    def step(self, demand: tuple[float, float]) -> None:
        """One control step."""
        if not self.voyage.outcome:
            self._step(demand)
        self._shown = self.voyage.t

    def seek(self, t: float) -> None:
        """A running world has no other times."""

    def _step(self, demand: tuple[float, float]) -> None:
        self._remember()
        for notice in self.voyage.step(demand):
            if notice.kind in ("waypoint_reached", "route_done") and notice.source:
                continue  # of another ship
            text = notice.text if notice.kind == "waypoint_reached" else notice.id
            self._news.append(f"{notice.kind.replace('_', ' ')}: {text}")
        hit = int(self.voyage.world["safety"]["collided_with"][0])
        if hit != self._hit:
            self._hit = hit
            if hit >= 0:
                self._news.append(f"COLLISION with {self.voyage.commands.called[hit] or f'source {hit}'}")

    def _remember(self) -> None:
        """Where everything is before a step."""
        w = self.voyage.world
        self._before = (self.voyage.t, w["vessels"]["eta"].copy(), w["obstacles"]["position"].copy())

    def touched(self, source: int) -> None:
        """An object was spawned or moved: it does not glide there."""
        w, (_, eta, position) = self.voyage.world, self._before
        if source < len(eta):
            eta[source] = w["vessels"]["eta"][source]
        else:
            position[source - len(eta)] = w["obstacles"]["position"][source - len(eta)]

    def _record(self) -> Any:
        """A copy of the world as it is shown; not to be changed."""
        key = (self.voyage.step_count, self._shown, len(self.voyage.commands.log))
        if key != self._key:
            self._key, self._copy = key, self._glide()
        return self._copy

    def _glide(self) -> Any:
        w = self.voyage.core.worlds[:1].copy()[0]
        t, eta, position = self._before
        share = (self._shown - t) / (self.voyage.t - t) if self.voyage.t > t else 1.0
        if share < 1.0:
            now = w["vessels"]["eta"]
            now[:, 2] = eta[:, 2] + (now[:, 2] - eta[:, 2] + math.pi) % (2.0 * math.pi) - math.pi
            now += (share - 1.0) * (now - eta)
            w["obstacles"]["position"] += (share - 1.0) * (w["obstacles"]["position"] - position)
            w["tick"] = round(self._shown / float(w["dt"]))
        return w

    # --- what is shown -----------------------------------------------------------------------------------------------
    @property
    def here(self) -> tuple[float, float]:
        """Where the own ship is shown."""
        eta = self._record()["vessels"]["eta"][0]
        return float(eta[0]), float(eta[1])

    def things(self) -> list[Thing]:
        """What can be pointed at."""
        w = self._record()
        carries = np.concatenate((w["vessels"]["ais_class"], w["obstacles"]["ais_class"])) != AIS_NONE
        on = np.concatenate((w["vessels"]["ais_on"], w["obstacles"]["ais_on"])) != 0
        texts = ["no AIS" if not c else "AIS on" if o else "AIS off" for c, o in zip(carries, on, strict=True)]
        return things(sea_from_record(w, self.voyage.commands.names), texts)

    def news(self) -> list[str]:
        """What happened since the last call."""
        news, self._news = self._news, []
        return news

    def scene(self, half_width: float, extra: Mapping[str, Sequence[Primitive]]) -> Scene:
        """The picture."""
        status = (self.name, self.mission.policy, f"seed {self.mission.seed}")
        return scene_from_snapshot(self._record(), self.voyage.commands.names, self.history, half_width=half_width,
                                   coast=self.voyage.core.coast(0),
                                   status=tuple(s for s in status if s), extra=extra)  # fmt: skip


class Replay:
    """An episode as it is shown."""

    commands: Commands | None = None
    manual = False

    def __init__(self, episode: Episode) -> None:
        """Start at its first sample."""
        self.episode = episode
        scenario = episode.meta.get("scenario")
        self.name = str(scenario.get("name", "") if isinstance(scenario, Mapping) else scenario or "")
        self.span: tuple[float, float] | None = (float(episode.t[0]), float(episode.t[-1]))
        self._t = float(episode.t[0])
        self._told = -math.inf

    @property
    def t(self) -> float:
        """Time that is shown [s]."""
        return self._t

    @property
    def ended(self) -> str:
        """Whether this is the last sample."""
        return "end" if self._t >= float(self.episode.t[-1]) else ""

    @property
    def here(self) -> tuple[float, float]:
        """Where the own ship is shown."""
        return self._sea().here

    def _sample(self) -> int:
        return int(np.searchsorted(self.episode.t, self._t, side="right")) - 1

    def _sea(self) -> Sea:
        return sea_from_episode(self.episode, self._sample(), self._t)

    def advance(self, seconds: float, demand: tuple[float, float]) -> None:
        """Let time pass."""
        self._t = min(self._t + seconds, float(self.episode.t[-1]))

    def step(self, demand: tuple[float, float]) -> None:
        """To the next sample."""
        self._t = float(self.episode.t[min(self._sample() + 1, len(self.episode.t) - 1)])

    def seek(self, t: float) -> None:
        """To a time, or the nearest there is."""
        self._t = min(max(t, float(self.episode.t[0])), float(self.episode.t[-1]))
        self._told = self._t

    def restart(self) -> None:
        """To the start."""
        self.seek(-math.inf)

    def touched(self, source: int) -> None:
        """Nothing can be."""

    def things(self) -> list[Thing]:
        """What can be pointed at."""
        return things(self._sea(), [""] * self.episode.sources)

    def news(self) -> list[str]:
        """Events that were passed since the last call."""
        passed = [e for e in self.episode.events if self._told < e["t"] <= self._t]
        self._told = self._t
        return [f"{clock(e['t'])} {e['kind'].replace('_', ' ')}" + (f": {self.episode.name(e['id'])}" if e["id"] >= 0 else "")
                for e in passed]  # fmt: skip

    def scene(self, half_width: float, extra: Mapping[str, Sequence[Primitive]]) -> Scene:
        """The picture."""
        return scene_from_episode(self.episode, self._t, future=False, half_width=half_width, extra=extra)


def things(sea: Sea, texts: Sequence[str]) -> list[Thing]:
    """Everything active of a sea, the own ship included, with a few words about each."""
    out = []
    for s in np.flatnonzero(sea.active).tolist():
        vessel, m = s < sea.vessels, s - sea.vessels
        kind = (HULLS if vessel else OBSTACLES).get(int(sea.kind[s]), "")
        size = f"{sea.length[s]:.0f} m" if vessel else f"r = {sea.radius[m]:.3g} m"
        speed = f"{float(np.hypot(*sea.velocity[s])) / KNOT:.1f} kn" if vessel else ""
        text = ", ".join(part for part in (kind, size, speed, texts[s]) if part)
        id = sea.names[s] if s < len(sea.names) and sea.names[s] else f"source {s}"
        out.append(Thing(s, id, sea.place(s), 0.5 * float(sea.length[s]) if vessel else float(sea.radius[m]), text))
    return out


def show(what: Callable[[], Any], *, palette: str = "day", ratio: float | None = None, title: str = "usv_gym") -> Any:
    """Open a window on a `Live` or a `Replay` and return it once the user has closed the window."""
    from .render.desk import Desk
    from .render.window import Window

    if palette not in PALETTES:
        raise ConfigError(f"--palette {palette}: expected one of {', '.join(PALETTES)}")
    window = Window(title, ratio=ratio)
    try:
        stage = what()
        window.run(Desk(stage, palette=palette))
    finally:
        window.close()
    return stage
