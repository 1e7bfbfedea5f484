"""A small world made by hand, for tests of recording: the record is all that a recorder sees."""

import numpy as np

from usv_gym.replay.recorder import Recorder
from usv_gym.units import DEG, KNOT, metres_per_degree
from usv_gym.world import state

ORIGIN = (59.4377744, 10.4716512)
METRES = metres_per_degree(ORIGIN[0])
EPOCH_US = 1_496_944_046_000_000
DT = 0.05
NAMES = ["Odin", "support_vessel", "Ørnen"] + [""] * 5 + ["Iceberg_1", "Buoy"]
BUOY, ICEBERG = 9, 8
ANCHORED, DRIFTING = (300.0, 40.0), (200.0, 0.0)


def world():
    """Own ship north at 5 m/s, a class A ship east at 10 kn, a class B boat at rest, an iceberg, a buoy with AIS."""
    w = np.zeros(1, state.world_dtype(8, 16))
    w["dt"], w["dt_us"], w["epoch_us"] = DT, 50_000, EPOCH_US
    w["origin"], w["metres_per_degree"] = ORIGIN, METRES
    w["safety"]["collided_with"] = -1
    w["safety"]["distance"] = np.inf
    v, m = w["vessels"][0], w["obstacles"][0]
    v["active"][:3] = 1
    v["model"][0], v["plant"][:] = state.MODEL_3DOF, -1
    v["plant"][0] = 0
    v["kind"][:3] = state.KIND_USV, state.KIND_VESSEL, state.KIND_BOAT
    v["length"][:3], v["beam"][:3] = (10.9, 30, 8), (3, 6, 2)
    v["nu"][0] = 5, 0, 0
    v["velocity"][0] = 5, 0
    v["eta"][1] = 400, -100, np.pi / 2
    v["nu"][1] = 10 * KNOT, 0, 0
    v["velocity"][1] = 0, 10 * KNOT
    v["eta"][2] = 1000, 1000, 0
    v["mmsi"][:3] = 257000000, 257000001, 257000002
    v["ais_class"][:3] = state.AIS_NONE, state.AIS_CLASS_A, state.AIS_CLASS_B
    m["active"][:2] = 1
    m["kind"][:2] = state.KIND_ICEBERG, state.KIND_BUOY
    m["position"][:2] = DRIFTING, ANCHORED
    m["velocity"][0] = 0.1, 0.2
    m["radius"][:2] = 15, 2
    m["mmsi"][1], m["ais_class"][1] = 992570001, state.AIS_ATON
    p = w["sensors"][0]
    p["ais_noise"] = np.sqrt([5, 5, DEG**2, DEG**2, 0.5 * KNOT**2, 2000 * (DEG / 60) ** 2])
    p["ais_bias"] = np.sqrt([5, 5, 2.5 * DEG**2, 2.5 * DEG**2, 0.5 * KNOT**2, 2500 * (DEG / 60) ** 2])
    for name, reach, period in (("radar", 1852.0, 2_500_000), ("lidar", 100.0, 100_000)):
        scan = w["sensors"][name][0]
        scan["on"], scan["range"], scan["period_us"] = 1, reach, period
    w["weather"]["radar_range_factor"] = w["weather"]["lidar_range_factor"] = 1.0
    w["routes"]["count"][0, 1] = 2
    w["routes"]["waypoint"][0, 1, :2] = [[400, -100], [400, 500]]
    return w


def advance(w, ticks=1):
    """Straight on, and the distances between centres in place of those between hulls."""
    w["tick"] += ticks
    w["traffic_tick"] = w["tick"]
    v, m = w["vessels"][0], w["obstacles"][0]
    v["eta"][:, :2] += v["velocity"] * DT * ticks
    m["position"] += m["velocity"] * DT * ticks
    position = np.concatenate([v["eta"][:, :2], m["position"]])
    w["safety"]["distance"][0, 0] = np.hypot(*(position - position[0]).T)


def send(w, source, error=(0.0, 0.0), received=True):
    """A message with an error of N, E; all else as it is."""
    a, v, m = w["ais"][0], w["vessels"][0], w["obstacles"][0]
    a["sequence"][source] += 1
    a["stamp_us"][source] = w["tick"][0] * w["dt_us"][0]
    ship = source < len(v["active"])
    a["position"][source] = (v["eta"][source, :2] if ship else m["position"][source - 8]) + np.array(error)
    a["cog"][source] = a["heading"][source] = v["eta"][source, 2] if ship else np.nan
    a["sog"][source] = v["nu"][source, 0] if ship else np.nan
    a["rot"][source] = 0.0 if source == 1 else np.nan
    if received:
        a["received"][0, source] = a["sequence"][source]


def report(w, source, error=(0.0, 0.0), radius=np.nan, sensors=2, motion_known=False):
    """A picture with one target, off by N, E."""
    p, v, m = w["picture"][0], w["vessels"][0], w["obstacles"][0]
    p["sequence"][0] += 1
    p["tick"] = w["tick"][0]
    p["id"][0] = 0
    p["id"][0, source] = 7
    ship = source < len(v["active"])
    p["position"][0, source] = (v["eta"][source, :2] if ship else m["position"][source - 8]) + np.array(error)
    p["radius"][0, source], p["radius_variance"][0, source] = radius, 4.0
    p["sensors"][0, source], p["motion_known"][0, source] = sensors, motion_known
    p["descriptor"][0, source] = state.DESCRIPTOR_VESSEL if ship else state.DESCRIPTOR_FIXED
    p["covariance"][0, source] = 9.0, 1.0, 4.0, (2 * DEG) ** 2, (0.5 * KNOT) ** 2
    p["cog"][0, source] = v["eta"][source, 2] + 3 * DEG if motion_known else np.nan
    p["sog"][0, source] = v["nu"][source, 0] - 1 * KNOT if motion_known else np.nan
    p["rot"][0, source] = 0.0 if motion_known else np.nan


def episode(seconds=30.0):
    """A recorded run of the world above, sampled every tick."""
    w, recorder = world(), Recorder()
    w["tracks"]["visible"] = 1
    advance(w, 0)
    recorder.sample(w)
    for k in range(1, round(seconds / DT) + 1):
        advance(w)
        t = k * DT
        # the iceberg hides the buoy for ten seconds
        w["tracks"]["visible"][0, 0, 0, BUOY] = not 10.0 < t <= 20.0
        if k % 200 == 0:
            send(w, 1, error=(3.0, -4.0))
            send(w, BUOY, received=False)
        if k % 600 == 0:
            send(w, 2)
        if k % 20 == 0:
            report(w, 1, error=(1.0, 2.0), motion_known=True) if k % 40 else report(w, ICEBERG, (-2.0, 0.0), 18.0)
        recorder.action([t, -t])
        recorder.sample(w)
    recorder.event(12.0, "waypoint", 1, "leg 1")
    return recorder.finish(names=NAMES, scenario={"name": "hand-made"}, seed=3, policy="hold", vessel="odin",
                           control_interval=DT, outcome={"ended": "time"})  # fmt: skip
