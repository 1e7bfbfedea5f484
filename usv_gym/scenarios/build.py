"""Write a scenario into world records: the only place where configuration becomes state."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from ..config import ConfigError
from ..units import DEG, DEG_PER_MIN, KNOT, metres_per_degree
from ..world import state
from ..world.disturbance import set_weather
from ..world.vessel import KinematicModel, VesselModel, load_vessel, write_kinematic, write_plant
from . import tracks
from .behaviours import write_behaviour
from .events import precipitation, waiting, write_events
from .places import GeoPoint
from .schema import OWN_SHIP, Preset, Scenario, Ship, Weather
from .sensor_schema import Error, Lidar, Radar, Sensors

Worlds: TypeAlias = np.ndarray[Any, np.dtype[Any]]
Names: TypeAlias = list[str]  #: of every source (vessel slots, then obstacle slots); "" where a slot is empty

_SHIP_KINDS = {"ship": state.KIND_SHIP, "vessel": state.KIND_VESSEL, "boat": state.KIND_BOAT}
_OBSTACLE_KINDS = {
    "iceberg": state.KIND_ICEBERG,
    "buoy": state.KIND_BUOY,
    "islet": state.KIND_ISLET,
    "lighthouse": state.KIND_LIGHTHOUSE,
    "platform": state.KIND_PLATFORM,
}
_AFTER = {"stop": state.AFTER_STOP, "continue": state.AFTER_CONTINUE, "loop": state.AFTER_LOOP}
_AIS = {"off": state.AIS_NONE, "A": state.AIS_CLASS_A, "B": state.AIS_CLASS_B}


def build_worlds(
    scenario: Scenario,
    B: int = 1,
    *,
    capacity: tuple[int, int] | None = None,
    observers: Sequence[int] | None = None,
    agents: int = 0,
) -> tuple[Worlds, Names]:
    """Allocate B worlds and write the scenario into each, with seed 0 (a reset draws the seeds).

    Parameters
    ----------
    scenario
        what to write.
    B
        number of worlds.
    capacity
        slots for vessels and for obstacles; default: the smallest capacity class that fits.
    observers
        vessel slots that carry sensors and a picture of their own; default: the own ship, slot 0.
    agents
        leave out the own ship and keep this many vessel slots, each with a plant, free for ``write_agent``.

    Raises
    ------
    ConfigError
        if there are more ships or obstacles than slots.
    """
    vessels, obstacles = max(agents, 1) + len(scenario.ships), len(scenario.obstacles) + len(scenario.phantoms())
    watching = (0,) if observers is None else tuple(observers)
    try:
        V, M = state.capacity(vessels, obstacles) if capacity is None else capacity
    except ValueError as error:
        raise ConfigError(f"scenario {scenario.name!r}: {error}") from None
    worlds: Worlds = np.zeros(B, state.world_dtype(V, M, len(watching), max(agents, 1)))
    if B > 0:
        write_world(scenario, worlds, 0, 0, observers=watching, agents=agents)
        worlds[1:] = worlds[0]
    return worlds, source_names(scenario, V, M, agents)


def source_names(scenario: Scenario, V: int, M: int, agents: int = 0) -> Names:
    """Names of all sources: ``own_ship`` in slot 0 (or slots for agents), then ships and obstacles in file order.

    The last obstacle slots are those of phantoms.
    """
    vessels = [*([""] * agents if agents else [OWN_SHIP]), *scenario.ships]
    phantoms = scenario.phantoms()
    free = M - len(scenario.obstacles) - len(phantoms)
    return [*vessels, *[""] * (V - len(vessels)), *scenario.obstacles, *[""] * free, *reversed(phantoms)]


def write_world(
    scenario: Scenario, worlds: Worlds, b: int, seed: int, *, observers: Sequence[int] | None = None, agents: int = 0
) -> None:
    """Fill row b of ``worlds`` completely, as it stands before the kernel ``reset_worlds`` starts it.

    Slot 0 is the own ship (3-DOF, plant 0, controlled), slots 1.. are the ships and the obstacles in file order.
    ``observers`` defaults to the vessel slots 0, 1, .. as many as the record has.  With ``agents`` the first so many slots
    stay empty and the ships follow them.

    Raises
    ------
    ConfigError
        if there are more ships or obstacles than slots.
    """
    w: Any = worlds[b]
    V, M = w["vessels"]["active"].shape[0], w["obstacles"]["active"].shape[0]
    first = max(agents, 1)
    phantoms = len(scenario.phantoms())
    if first + len(scenario.ships) > V or len(scenario.obstacles) + phantoms > M:
        more = f" (with {phantoms} for false targets)" if phantoms else ""
        raise ConfigError(
            f"scenario {scenario.name!r}: {first + len(scenario.ships)} vessels and {len(scenario.obstacles) + phantoms} "
            f"obstacles{more} do not fit into {V} and {M} slots"
        )
    worlds[b] = np.zeros((), worlds.dtype)
    time = scenario.simulation
    w["dt_us"], w["dt"] = time.dt_us, time.dt_us / 1e6
    w["frame_ticks"] = time.frame_ticks
    w["seed"] = seed
    w["origin"] = scenario.origin.latitude_deg, scenario.origin.longitude_deg
    w["metres_per_degree"] = metres_per_degree(scenario.origin.latitude_deg)
    w["epoch_us"] = round(time.epoch.timestamp() * 1e6)
    w["area"][0] = time.area or 0.0
    w["observer"] = range(w["observer"].shape[0]) if observers is None else observers
    w["phantoms"], w["clutter"] = phantoms, scenario.clutter
    write_weather(scenario.weather, w, scenario.preset)
    mmsis = scenario.mmsis()
    if not agents:
        _write_own_ship(scenario, worlds, b, mmsis[OWN_SHIP])
    slots = {OWN_SHIP: 0} | {name: j for j, name in enumerate(scenario.ships, start=first)}
    knot = 0
    for name, ship in scenario.ships.items():
        write_ship(scenario, w, slots[name], name, mmsis[name], slots)
        if ship.track is not None:  # as in track_pool
            w["replays"]["first"][slots[name]], w["replays"]["count"][slots[name]] = knot, tracks.knots(ship.track)
            knot += tracks.knots(ship.track)
    for i, name in enumerate(scenario.obstacles):
        write_obstacle(scenario, w, i, name, mmsis[name])
    for group, frame, now in (("vessels", "frame_eta", "eta"), ("obstacles", "frame_position", "position")):
        w[group][frame] = w[group][now]
    _write_sensors(scenario.sensors, w["sensors"])
    _write_events(scenario, w, source_names(scenario, V, M, agents), 0 if agents else None)
    _write_nothing_yet(w)


def track_pool(scenario: Scenario) -> NDArray[np.float64]:
    """The tracks of a scenario's replayed ships, in file order, as the pool [n, 7] of the kernels (traffic/replay.py)."""
    return tracks.pool(ship.track for ship in scenario.ships.values() if ship.track is not None)


def _write_events(scenario: Scenario, w: Any, names: Names, own: int | None) -> None:
    if not scenario.events:
        return
    sources = {name: source for source, name in enumerate(names) if name} | ({OWN_SHIP: own} if own is not None else {})
    V = w["vessels"]["active"].shape[0]
    for name in waiting(scenario.events):
        group, slot = ("vessels", sources[name]) if sources[name] < V else ("obstacles", sources[name] - V)
        w[group]["active"][slot] = 0
    model = load_vessel(scenario.own_ship.vessel)
    write_events(
        scenario.events,
        w,
        find=sources.__getitem__,
        local=scenario.local,
        thrusters=[t.name for t in model.thrusters] if isinstance(model, VesselModel) else [],
        classes={name: ship.class_ for name, ship in scenario.ships.items()},
    )


def write_weather(weather: Weather, w: Any, preset: Preset) -> None:
    """Write a weather into a record; the next reset starts it.

    Raises
    ------
    ConfigError
        if it brings false alarms and the record was built for a scenario without.
    """
    falls = [precipitation(kind, getattr(weather, kind)) for kind in ("rain", "fog", "snow")]
    radar, lidar, detection = (math.prod(fall[k] for fall in falls) for k in range(3))
    radar_clutter, lidar_clutter = (sum(fall[k] for fall in falls) for k in (3, 4))
    if radar_clutter + lidar_clutter > 0.0 and not w["clutter"]:
        raise ConfigError("weather: rain, fog and snow bring false alarms, which need room: write them into the scenario")
    set_weather(
        w,
        wind_speed=weather.wind.speed,
        wind_to=_reverse(weather.wind.from_deg),
        current_speed=weather.current.speed,
        current_to=weather.current.to_deg % 360.0 * DEG,
        wave_height=weather.waves.height,
        wave_to=_reverse(weather.waves.from_deg),
        gusts=weather.wind.gusts,
        original=preset == "original",
        radar_range_factor=weather.visibility.radar_range * radar,
        lidar_range_factor=weather.visibility.lidar_range * lidar,
        detection_factor=weather.visibility.detection * detection,
        radar_clutter=radar_clutter,
        lidar_clutter=lidar_clutter,
    )


def _reverse(from_deg: float) -> float:
    """Where something goes that comes from ``from_deg`` [rad]."""
    return (from_deg + 180.0) % 360.0 * DEG


def _write_own_ship(scenario: Scenario, worlds: Worlds, b: int, mmsi: int) -> None:
    own = scenario.own_ship
    _write_vessel(load_vessel(own.vessel), worlds, b, 0, scenario.preset, own.memory)
    w: Any = worlds[b]
    v = w["vessels"]
    _write_motion(v, 0, scenario.local(own.position), own.heading_deg * DEG, own.speed)
    _write_station(v, 0, mmsi, _AIS[own.ais])
    if own.route:  # the start is waypoint 0, so that the first leg has a direction
        _write_route(scenario, w["routes"], 0, (own.position, *own.route), own.acceptance_radius, state.AFTER_STOP)


def _write_vessel(model: VesselModel, worlds: Worlds, b: int, j: int, preset: Preset, memory: bool) -> None:
    """Write a controlled vessel into vessel slot j; plant j is its own, if it has one."""
    w: Any = worlds[b]
    v = w["vessels"]
    if isinstance(model, KinematicModel):
        write_kinematic(model, v, j, float(w["frame_ticks"] * w["dt"]))
    else:
        write_plant(model, worlds, b, j, preset=preset, memory=memory)
        v["model"][j], v["plant"][j] = state.MODEL_3DOF, j
    v["kind"][j], v["behaviour"][j], v["controlled"][j] = state.KIND_USV, state.BEHAVIOUR_HOLD, 1
    v["length"][j], v["beam"][j] = model.length, model.beam


def write_agent(
    model: VesselModel,
    worlds: Worlds,
    b: int,
    j: int,
    route: Sequence[tuple[float, float]],
    *,
    preset: Preset = "standard",
    acceptance_radius: float = 25.0,
) -> None:
    """Put a controlled vessel with AIS class A into vessel slot j, at cruising speed along a route; plant j is its own.

    ``route`` are two or more places [north, east] of the origin [m]; the first is where it starts.
    """
    _write_vessel(model, worlds, b, j, preset, memory=False)
    w: Any = worlds[b]
    v, routes = w["vessels"], w["routes"]
    heading = math.atan2(route[1][1] - route[0][1], route[1][0] - route[0][0])
    _write_motion(v, j, route[0], heading, model.cruise_speed)
    v["frame_eta"][j] = v["eta"][j]
    _write_station(v, j, 257_900_001 + j, state.AIS_CLASS_A)
    routes["waypoint"][j, : len(route)] = route
    routes["count"][j], routes["leg"][j], routes["radius"][j] = len(route), 1, acceptance_radius
    for o, slot in enumerate(w["observer"]):
        if slot == j:
            w["nav"]["leg"][o] = 1


def carry_on_from_here(w: Any, source: int) -> None:
    """After a source was put somewhere within a traffic frame: let the frame begin where it would have come from.

    Traffic is carried from where it was as the frame began (world/carry.py).
    """
    v, m = w["vessels"], w["obstacles"]
    w["tracks"]["slack"] = 0.0  # the LiDAR has to look for it
    seconds = float((w["tick"] - w["frame_tick"]) * w["dt"])
    V = len(v["active"])
    if source >= V:
        i = source - V
        current = np.array(w["weather"]["current"])
        m["frame_position"][i] = m["position"][i] - (m["velocity"][i] + m["drifts"][i] * current) * seconds
    else:
        v["frame_eta"][source] = v["eta"][source]
        if v["model"][source] == state.MODEL_KINEMATIC:
            v["frame_eta"][source] -= np.array([*v["velocity"][source], v["nu"][source, 2]]) * seconds


def write_ship(scenario: Scenario, w: Any, j: int, name: str, mmsi: int, slots: Mapping[str, int]) -> None:
    """Write ship ``name`` of a scenario into the empty vessel slot j of a record; ``slots`` are those of all names."""
    ship = scenario.ships[name]
    v = w["vessels"]
    v["kind"][j], v["model"][j], v["plant"][j] = _SHIP_KINDS[ship.class_], state.MODEL_KINEMATIC, -1
    v["length"][j], v["beam"][j] = ship.length, ship.beam
    v["turn_time"][j], v["turn_rate_max"][j] = ship.turn_time, ship.turn_rate(scenario.preset) * DEG
    frame = scenario.simulation.frame_ticks * scenario.simulation.dt
    v["turn_decay"][j] = -math.expm1(-frame / ship.turn_time)
    v["turn_constant"][j] = ship.turns_constantly(scenario.preset)
    _write_station(v, j, mmsi, _AIS[ship.ais_class])
    if ship.track is not None:
        place, heading, speed, seen = tracks.start_of(ship.track)
        _write_motion(v, j, place, heading, speed)
        v["active"][j] = seen
    else:
        start, following = (scenario.local(place) for place in ship.waypoints[:2])
        heading = math.atan2(following[1] - start[1], following[0] - start[0])
        _write_motion(v, j, start, heading, ship.set_speed)
        _write_route(scenario, w["routes"], j, ship.waypoints, ship.acceptance_radius, _AFTER[ship.after_last])
    write_behaviour(ship.behaviour, w, j, ship.class_, slots.__getitem__)
    if ship.track is not None:
        _write_replay(ship, w, j)


def _write_replay(ship: Ship, w: Any, j: int) -> None:
    """Let vessel j sail its track before it behaves."""
    v, r = w["vessels"], w["replays"]
    r["then"][j], v["behaviour"][j] = v["behaviour"][j], state.BEHAVIOUR_REPLAY
    if ship.handover is not None:
        r["hands_over"][j] = 1
        r["range"][j], r["dcpa"][j], r["tcpa"][j] = ship.handover.distance, ship.handover.dcpa, ship.handover.tcpa


def _write_motion(v: Any, j: int, start: tuple[float, float], heading: float, speed: float) -> None:
    v["active"][j] = 1
    v["eta"][j] = *start, heading
    v["heading_set"][j] = heading
    v["nu"][j, 0] = v["speed"][j] = speed
    v["velocity"][j] = speed * math.cos(heading), speed * math.sin(heading)


def _write_station(group: Any, slot: int, mmsi: int, ais_class: int) -> None:
    group["mmsi"][slot] = mmsi
    group["ais_class"][slot], group["ais_on"][slot] = ais_class, ais_class != state.AIS_NONE


def _write_route(
    scenario: Scenario,
    routes: Any,
    j: int,
    places: Sequence[tuple[float, float] | GeoPoint],
    radius: float,
    after_last: int,
) -> None:
    routes["waypoint"][j, : len(places)] = [scenario.local(place) for place in places]
    routes["count"][j], routes["leg"][j] = len(places), 1
    routes["radius"][j], routes["after_last"][j] = radius, after_last


def write_obstacle(scenario: Scenario, w: Any, i: int, name: str, mmsi: int) -> None:
    """Write obstacle ``name`` of a scenario into the empty obstacle slot i of a record."""
    obstacle = scenario.obstacles[name]
    m = w["obstacles"]
    m["active"][i], m["kind"][i] = 1, _OBSTACLE_KINDS[obstacle.kind]
    m["position"][i], m["radius"][i] = scenario.local(obstacle.position), obstacle.radius
    m["drifts"][i] = obstacle.drift == "current"
    if not isinstance(obstacle.drift, str):
        m["velocity"][i] = obstacle.drift
    _write_station(m, i, mmsi, state.AIS_ATON if obstacle.ais else state.AIS_NONE)


def _write_sensors(sensors: Sensors, p: Any) -> None:
    ais, tdm, nav = sensors.ais, sensors.tdm, sensors.navigation
    p["exteroceptive"] = 1
    p["ais_on"], p["ais_range"], p["ais_loss"] = ais.on, ais.range, ais.loss
    p["ais_latency_us"], p["ais_quantised"] = _micros(ais.latency), ais.quantised
    p["ais_interval_us"] = 0 if isinstance(ais.interval, str) else _micros(ais.interval)
    channels: list[tuple[Error, float]] = [
        (ais.position, 1.0),
        (ais.position, 1.0),
        (ais.cog_deg, DEG),
        (ais.heading_deg, DEG),
        (ais.sog_kn, KNOT),
        (ais.rot_deg_min, DEG_PER_MIN),
    ]
    p["ais_noise"] = [error.noise * unit for error, unit in channels]
    p["ais_bias"] = [error.bias * unit for error, unit in channels]
    p["ais_bias_time"] = [error.bias_time or 0.0 for error, _ in channels]
    p["ais_timeout"] = tdm.timeout_factor
    _write_scanner(sensors.radar, p["radar"], tdm.timeout_factor)
    _write_scanner(sensors.lidar, p["lidar"], tdm.timeout_factor)
    p["radius_min"] = sensors.radius_min
    p["tdm_period_us"] = _period(tdm.rate)
    p["process_u"], p["process_r"], p["process_time"] = tdm.process_u, tdm.process_r, tdm.process_time
    p["inflation"] = tdm.inflation
    p["light"], p["light_q"] = tdm.filter == "light", tdm.light_q
    gnss = nav.gnss
    p["gnss_period_us"] = _period(gnss.rate)
    p["gnss_noise"] = gnss.position_std, gnss.heading_std_deg * DEG, gnss.course_std_deg * DEG, gnss.speed_std
    p["mru_period_us"] = _period(nav.mru.rate)
    p["mru_noise"] = nav.mru.heading_std_deg * DEG, nav.mru.yaw_rate_std_deg_s * DEG
    p["imu_period_us"] = _period(nav.imu.rate)
    p["imu_noise"] = nav.imu.acceleration_std, nav.imu.yaw_rate_std_deg_s * DEG
    p["log_period_us"], p["log_noise"] = _period(nav.speed_log.rate), nav.speed_log.speed_std
    p["wind_period_us"] = _period(nav.wind.rate)
    p["wind_noise"] = nav.wind.speed_std, nav.wind.angle_std_deg * DEG


def _write_scanner(sensor: Radar | Lidar, p: Any, timeout_factor: float) -> None:
    p["on"], p["period_us"], p["latency_us"] = sensor.on, _micros(sensor.period), _micros(sensor.latency)
    p["range"], p["range_min"] = sensor.range, sensor.range_min
    p["gain"], p["gain_floor"] = sensor.distance_gain, sensor.distance_floor
    p["noise"] = sensor.position.noise, sensor.radius.noise
    p["bias"] = sensor.position.bias, sensor.radius.bias
    p["bias_time"] = sensor.position.bias_time or 0.0, sensor.radius.bias_time or 0.0
    p["false_alarms"] = sensor.false_alarms
    p["detection"], p["detection_radius"] = sensor.detection, sensor.detection_radius
    p["timeout_us"] = _micros(timeout_factor * sensor.period)


def _micros(seconds: float) -> int:
    return round(seconds * 1e6)


def _period(rate: float) -> int:
    """Period [us] of a rate [Hz]; 0: never."""
    return _micros(1.0 / rate) if rate > 0.0 else 0


def _write_nothing_yet(w: Any) -> None:
    """Values that mean "never" or "unknown" where that is not 0."""
    w["safety"]["distance"] = w["safety"]["closest"] = w["safety"]["step_closest"] = math.inf
    w["safety"]["collided_with"] = -1
    w["safety"]["land_distance"] = w["safety"]["land_closest"] = math.inf
    w["land_id"] = w["chart_id"] = w["tracks"]["land_us"] = -1
    w["tracks"]["land"] = w["picture"]["land"] = w["picture"]["chart"] = w["picture"]["chart_place"] = math.nan
    w["ais"]["last_tick"] = w["ais"]["due_tick"] = w["ais"]["inbox_stamp_us"] = -1
    w["tracks"]["scan_bias_us"] = w["tracks"]["scan_due"] = -1
    for o, j in enumerate(w["observer"]):
        w["nav"]["leg"][o] = w["routes"]["leg"][j]
