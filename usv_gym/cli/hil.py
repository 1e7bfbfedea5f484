"""`usv-gym hil`: the simulation in front of a real control system."""

from __future__ import annotations

import signal
from pathlib import Path
from typing import Annotated, Any

import typer

from .app import Scenarios, Seed, Set, Vessel, app, one_or_all


@app.command()
def hil(
    scenario: Scenarios,
    backend: Annotated[str, typer.Option(help="ros2, ros1, nmea or mcap (only records)")] = "ros2",
    profile: Annotated[
        str | None, typer.Option(help="table of topics: standard, hilsim, nmea or a YAML file; default: by backend")
    ] = None,
    option: Annotated[
        list[str] | None,
        typer.Option("-o", "--option", metavar="KEY=VALUE", help="of the backend, as tcp=127.0.0.1:10112"),
    ] = None,
    control: Annotated[
        str | None, typer.Option(help="actuators, heading_speed or demand; default: the profile's")
    ] = None,
    realtime: Annotated[float, typer.Option(help="simulated seconds per second, 0.1 to 20")] = 1.0,
    lock_step: Annotated[
        bool, typer.Option("--lock-step", help="wait for each command instead; as fast as that goes")
    ] = False,
    interval: Annotated[float, typer.Option(help="seconds between two steps that ask for a command")] = 0.1,
    timeout: Annotated[float, typer.Option(help="seconds without a command until the fail-safe acts")] = 1.0,
    fail_safe: Annotated[str, typer.Option(help="zero: thrust to zero; hold: the last command")] = "zero",
    patience: Annotated[float, typer.Option(help="seconds that a lock-step waits for the first command")] = 30.0,
    own_ship: Annotated[
        str, typer.Option(help="simulated; external: its pose comes over the wire; only: nothing but the own ship")
    ] = "simulated",
    inject: Annotated[
        list[str] | None,
        typer.Option(metavar="TOPIC:delay=S,jitter=S,loss=P", help="what happens to messages on their way"),
    ] = None,
    duration: Annotated[
        float | None, typer.Option(help="seconds of simulated time; default: until interrupted")
    ] = None,
    until_done: Annotated[bool, typer.Option("--until-done", help="end at a collision or on arrival")] = False,
    start: Annotated[str, typer.Option(metavar="COMMAND", help="controller to start, and to end with the bridge")] = "",
    record: Annotated[Path | None, typer.Option(metavar="FILE.mcap", help="record every message")] = None,
    out: Annotated[
        Path | None, typer.Option(help="directory for the episode, as of `usv-gym run`; memory grows with time")
    ] = None,
    view: Annotated[str | None, typer.Option(help="browser or map: look at it while it runs; a click spawns")] = None,
    port: Annotated[int, typer.Option(min=0, max=65535, help="of --view browser; 0: any that is free")] = 0,
    fifo: Annotated[bool, typer.Option("--fifo", help="ask for real-time scheduling (needs the right to)")] = False,
    vessel: Vessel = None,
    set_: Set = None,
    seed: Seed = 0,
) -> None:
    """Put the simulation in front of a control system: ROS 1, ROS 2 or NMEA; in real time or in lock-step.  Ctrl-C ends it."""
    from ..config import ConfigError, Document, suggestion, validate
    from ..hil.backends import BACKENDS
    from ..hil.bridge import plan_hil, real_time_priority
    from ..hil.profile import parse_trouble
    from ..hil.rig import Rig
    from ..hil.serve import serve

    if backend not in BACKENDS or backend == "memory":
        raise ConfigError(f"--backend {backend}: unknown{suggestion(backend, [b for b in BACKENDS if b != 'memory'])}")
    for key, given, known in (("--own-ship", own_ship, ("simulated", "external", "only")),
                              ("--view", view or "map", ("browser", "map"))):  # fmt: skip
        if given not in known:
            raise ConfigError(f"{key} {given}: unknown{suggestion(given, known)}")
    if not lock_step and not 0.1 <= realtime <= 20.0:
        raise ConfigError(f"--realtime {realtime:g}: expected 0.1 to 20; as fast as possible is --lock-step")
    if record is not None and record.suffix != ".mcap":
        raise ConfigError(f"--record {record}: expected a file that ends in .mcap")
    if out is not None and out.exists() and not out.is_dir():
        raise ConfigError(f"{out}: is a file; expected a directory for the results")
    options: dict[str, str] = {}
    for text in option or []:
        key, equals, value = text.partition("=")
        if not equals:
            raise ConfigError(f"--option {text!r}: expected KEY=VALUE")
        options[key] = value
    settings: dict[str, Any] = {
        "backend": backend, "profile": profile or "", "options": options, "timeout": timeout, "fail_safe": fail_safe,
        "patience": patience, "start": start, "inject": {topic: t.dump() for topic, t in map(parse_trouble, inject or [])},
    }  # fmt: skip
    if control is not None:
        settings["control"] = control
    rig = validate(Rig, Document("hil", settings))
    mission = plan_hil(one_or_all(scenario), vessel=vessel, overrides=set_ or [], seed=seed, own_ship=own_ship,  # type: ignore[arg-type]
                       duration=duration)  # fmt: skip
    if fifo and (wrong := real_time_priority()):
        typer.echo(f"usv-gym: warning: --fifo: {wrong}", err=True)
    signal.signal(signal.SIGTERM, lambda *_: signal.raise_signal(signal.SIGINT))
    serve(mission, rig, lock_step=lock_step, realtime=None if lock_step else realtime, interval=interval, own_ship=own_ship,
          record=record, out=out, endless=not until_done, view=view, port=port, say=lambda text: typer.echo(text))  # fmt: skip
