"""The floor plan of the house: one structured record holds one world.

``world_dtype(V, M, O, P)`` gives the dtype of B worlds; ``np.zeros(B, world_dtype(...))`` is the batch.  NumPy code reads
``worlds["vessels"]["eta"]`` as a ``[B, V, 3]`` view; kernels take ``worlds[b]`` and read ``w.vessels.eta[j, 0]`` at offsets
known at compile time.

Sizes: B worlds, V vessel slots (slot 0 is the own ship by convention), M obstacle slots, S = V + M sources (a source is
anything a sensor can see: vessel j is source j, obstacle m is source V + m), O observers, P plants (3-DOF vessels),
A thrusters per plant, W waypoints per route, L bearing sectors of land, T stretches of coast, E events,
R encounters that a ship keeps in mind.

Loops over slots become vector code only where LLVM can prove in one comparison that nothing they write is read: what a loop
writes stands before or behind all that it reads (``eta`` first in its group, work space last), never in between.

Units and frames: SI and radians; {n} is the local tangent plane (north, east) at ``origin``; {b} is the body frame
(forward, starboard).  Times are integers: ticks of ``dt_us``, or microseconds where the name ends in ``_us``.
"""

from __future__ import annotations

import functools
from typing import Any

import numpy as np

Dtype = np.dtype[Any]

A = 4  #: thrusters per plant
W = 32  #: waypoints per route
KNOT_FIELDS = 7  #: numbers per knot in the pool of recorded tracks (traffic/replay.py)
L = 72  #: bearing sectors of land in the picture, clockwise from north: sector i is [5 i, 5 i + 5) deg
T = 8  #: stretches of coast among the detected targets, in the slots after those of the S sources
E = 16  #: events of a scenario
R = 4  #: vessels to which a COLREGs-obeying ship remembers what it is
RADAR_PHANTOMS, LIDAR_PHANTOMS = 6, 4  #: false alarms that can be tracked at a time, see ``phantoms`` of the world

# --- codes -----------------------------------------------------------------------------------------------------------
KIND_SHIP, KIND_VESSEL, KIND_BOAT, KIND_USV = 0, 1, 2, 3
KIND_ICEBERG, KIND_BUOY, KIND_ISLET, KIND_LIGHTHOUSE, KIND_PLATFORM = 10, 11, 12, 13, 14
MODEL_KINEMATIC, MODEL_3DOF = 0, 1
#: what a ship that nobody controls does: keeps ``heading_set``; follows its route whatever comes; follows it and obeys the
#: COLREGs; leaves it to pass ahead of another; wanders about it;
#: sails a recorded track
BEHAVIOUR_HOLD, BEHAVIOUR_WAYPOINTS, BEHAVIOUR_COLREGS, BEHAVIOUR_HOSTILE, BEHAVIOUR_ERRATIC = 0, 1, 2, 3, 4
BEHAVIOUR_REPLAY = 5
AFTER_STOP, AFTER_CONTINUE, AFTER_LOOP = 0, 1, 2
AIS_NONE, AIS_CLASS_A, AIS_CLASS_B, AIS_ATON = 0, 1, 2, 3
AIS, RADAR, LIDAR = 0, 1, 2  #: sensors of the TDM, in the order of every ``[.., 3]`` axis
PHASE_NONE, PHASE_POSITION, PHASE_MOTION = 0, 1, 2  #: what a local filter knows
TRIGGER_NONE, TRIGGER_TIME, TRIGGER_DISTANCE, TRIGGER_TCPA = 0, 1, 2, 3
#: actions of events, in the order of their codes; those that write the same fields stand together (usv_gym/events.py)
EVENTS = (
    "ais_silent", "ais_spoofed", "ais_jammed", "gnss_frozen", "gnss_drifting", "radar_outage", "lidar_outage",
    "rain", "fog", "snow", "jet_stuck", "nozzle_stuck", "reduced_thrust", "change_course", "change_speed",
    "change_behaviour", "spawn", "delete",
)  # fmt: skip
EVENT_AIS_SILENT, EVENT_AIS_SPOOFED, EVENT_AIS_JAMMED, EVENT_GNSS_FROZEN, EVENT_GNSS_DRIFTING = 0, 1, 2, 3, 4
EVENT_RADAR_OUTAGE, EVENT_LIDAR_OUTAGE, EVENT_RAIN, EVENT_FOG, EVENT_SNOW = 5, 6, 7, 8, 9
EVENT_JET_STUCK, EVENT_NOZZLE_STUCK, EVENT_REDUCED_THRUST = 10, 11, 12
EVENT_CHANGE_COURSE, EVENT_CHANGE_SPEED, EVENT_CHANGE_BEHAVIOUR, EVENT_SPAWN, EVENT_DELETE = 13, 14, 15, 16, 17
DESCRIPTOR_FIXED, DESCRIPTOR_VESSEL, DESCRIPTOR_LAND = 0, 1, 2

NX_AIS, NX_SCAN = 12, 9  #: states of the AIS filter and of a radar or LiDAR filter (sensors/tracker.py)
NP_AIS, NP_SCAN = NX_AIS * (NX_AIS + 1) // 2, NX_SCAN * (NX_SCAN + 1) // 2  #: packed covariances

f8, i8, i4, i2, i1, u8 = np.float64, np.int64, np.int32, np.int16, np.int8, np.uint64


def _weather() -> Dtype:
    # Ornstein-Uhlenbeck process: x <- decay x + kick noise, each tick; decay and kick follow from the rest at reset.
    # `std` is that of x (in the preset `original`: of the noise of one step); what comes out is x, limited
    ou = [("std", f8), ("time_constant", f8), ("limit", f8), ("decay", f8), ("kick", f8), ("x", f8)]
    return np.dtype([
        ("on", i1),  # 0: flat calm, no weather code runs (the air drag of a vessel's own motion stays)
        ("original", i1),  # preset `original`: per-step noise and Euler steps as in 2017
        # wind
        ("wind_speed", f8), ("wind_to", f8),  # mean at 10 m [m/s], blowing towards [rad]
        ("wind_height_factor", f8),  # wind at sensor height / wind at 10 m
        ("wind_slow", ou), ("wind_gust", ou), ("wind_turn", ou),  # [m/s], [m/s], [rad]
        ("wind_u10", f8), ("wind_direction", f8),  # realised at 10 m [m/s], towards [rad]
        # current
        ("current_speed", f8), ("current_to", f8),  # mean [m/s], towards [rad]
        ("current_slow", ou), ("current_turn", ou),  # [m/s], [rad]
        ("current", f8, (2,)),  # realised velocity of the water [N, E] {n} [m/s]
        # waves
        ("wave_height", f8), ("wave_to", f8),  # significant height [m], travelling towards [rad]
        ("wave_omega0", f8), ("wave_damping", f8),  # modal frequency [rad/s], relative damping
        ("wave_scale", f8),  # spread of the wave force per unit of gain [m]; in the preset `original` that of its noise
        # what weather does to sensors, as factors of range and of missed detections (1 = clear)
        ("radar_range_factor", f8), ("lidar_range_factor", f8), ("detection_factor", f8),
        ("radar_clutter", f8), ("lidar_clutter", f8),  # false alarms per scan, on top of those of the sensor
    ], align=True)  # fmt: skip


def _plants(P: int) -> Dtype:
    """3-DOF vessels: parameters (data, from configs/vessels) and inner state.  SAE/SNAME signs, {b}."""
    return np.dtype([
        # rigid body and added mass, M = [[m11, 0, 0], [0, m22, m23], [0, m32, m33]]
        ("m11", f8, (P,)), ("m22", f8, (P,)), ("m23", f8, (P,)), ("m32", f8, (P,)), ("m33", f8, (P,)),
        ("i11", f8, (P,)), ("i22", f8, (P,)), ("i23", f8, (P,)), ("i32", f8, (P,)), ("i33", f8, (P,)),  # M^-1
        # C(nu) nu = [-(c22 v + c23 r) r, c11 u r, (c22 v + c23 r) u - c11 u v]; linearised: only c11 u r in sway
        ("coriolis", f8, (P, 3)), ("coriolis_linearised", i1, (P,)),  # c11, c22 [kg], c23 [kg m]
        # damping derivatives as in the literature: force = derivative * motion, hence negative numbers for drag
        ("Xu", f8, (P,)), ("Xuu", f8, (P,)), ("Xuuu", f8, (P,)),
        ("Xuu_ittc", f8, (P,)),  # times (0.075 / (log10 Re - 2)^2 + 0.014) |u| u
        ("Yv", f8, (P,)), ("Yr", f8, (P,)), ("Yvv", f8, (P,)), ("Yrv", f8, (P,)), ("Yvr", f8, (P,)), ("Yrr", f8, (P,)),
        ("Yvvv", f8, (P,)),
        ("Nv", f8, (P,)), ("Nr", f8, (P,)), ("Nvv", f8, (P,)), ("Nrv", f8, (P,)), ("Nvr", f8, (P,)), ("Nrr", f8, (P,)),
        ("Nrrr", f8, (P,)),
        # cross-flow drag over the strips x0..x1 of draught T
        ("cd2d", f8, (P,)), ("draught", f8, (P,)), ("strip_x0", f8, (P,)), ("strip_x1", f8, (P,)),
        ("crossflow_sway", f8, (P,)), ("crossflow_yaw", f8, (P,)), ("crossflow_dead_zone", f8, (P,)),  # [-], [-], [m/s]
        ("length_pp", f8, (P,)),
        # wind areas (Blendermann form)
        ("area_front", f8, (P,)), ("area_side", f8, (P,)), ("wind_arm", f8, (P,)), ("cd_t", f8, (P,)),
        ("cd_l_bow", f8, (P,)), ("cd_l_stern", f8, (P,)), ("wind_delta", f8, (P,)),
        ("wind_surge_factor", f8, (P,)),  # A_F / A_L in the standard form; 1 in the preset `original`
        ("current_turns", i1, (P,)),  # 1: the current keeps its direction in {n} while the vessel turns; 0: `original`
        ("wave_gain", f8, (P, 3)),  # X [N], Y [N], N [N m] per metre of wave height (see disturbance.py)
        # fluid memory: on, scale of force and moment, denominators (without the leading 1) and numerators of the pairs
        # sway-sway, yaw-yaw and sway-yaw (order 2)
        ("memory", i1, (P,)), ("memory_scale", f8, (P, 2)),
        ("memory_den", f8, (P, 3, 4)), ("memory_num", f8, (P, 3, 4)),
        ("yaw_gain", f8, (P,)),  # 1; preset `original` integrates heading 2.5 % fast
        # thrusters; state first-order lags. force = gain * n|n| * bucket, along direction + nozzle angle
        ("thrusters", i2, (P,)),  # how many of A are fitted
        ("x", f8, (P, A)), ("y", f8, (P, A)), ("direction", f8, (P, A)),  # [m], [m] {b}; [rad], 0 ahead, pi/2 starboard
        ("gain_ahead", f8, (P, A)), ("gain_astern", f8, (P, A)),  # [N/rpm^2]
        ("n_idle", f8, (P, A)), ("n_max", f8, (P, A)), ("n_min", f8, (P, A)),  # [rpm]; n_min is reverse at -100 %
        ("n_lag", f8, (P, A)),  # [s]
        ("nozzle_max", f8, (P, A)), ("nozzle_lag", f8, (P, A)),  # [rad] (0: fixed), [s]; +100 % turns to starboard
        ("bucket", i1, (P, A)), ("bucket_lag", f8, (P, A)), ("bucket_in_yaw", i1, (P,)),  # fitted, [s], quirk 7 off/on
        ("euler_actuators", i1, (P,)),  # preset `original`: one 0.05 s Euler step per command row
        ("lag_step", f8, (P,)), ("lag", f8, (P, A, 3)),  # share of the way (n, alpha, beta) per lag_step [s]
        # mixing of (surge, yaw) demands in [-1, 1] into commands, for autopilots and two-channel actions
        ("mix_surge", f8, (P, A)), ("mix_yaw", f8, (P, A)), ("mix_nozzle", f8, (P, A)),
        ("reverse_by_bucket", i1, (P,)),
        # faults, written by scenario events: share of thrust that is left, nozzle held where it is, shaft and bucket held
        ("thrust_left", f8, (P, A)), ("nozzle_stuck", i1, (P, A)), ("jet_stuck", i1, (P, A)),
        # autopilot: heading error to yaw rate [1/s], rate error to demand [s/rad], its integral [1/rad];
        # speed error to demand [s/m], its integral [1/m], exponent of the steady speed curve; speed at full demand
        # [m/s], largest yaw rate asked for [rad/s]
        ("ap_heading", f8, (P, 3)), ("ap_speed", f8, (P, 3)), ("ap_speed_max", f8, (P,)), ("ap_rate_max", f8, (P,)),
        ("ap_integral", f8, (P, 2)),  # state: heading, speed
        # state
        ("command", f8, (P, A, 3)),  # demanded rpm, nozzle, bucket, each in [-1, 1]
        ("n", f8, (P, A)), ("alpha", f8, (P, A)), ("beta", f8, (P, A)),  # rpm, nozzle [rad], bucket [-1, 1]
        ("tau", f8, (P, 3)), ("tau_wind", f8, (P, 3)), ("tau_wave", f8, (P, 3)),  # [N, N, N m] {b}
        ("memory_x", f8, (P, 4, 4)),  # fluid-memory states: sway-sway, yaw-yaw, yaw to sway, sway to yaw
        ("wave_x", f8, (P, 3, 2)),  # wave-force states per degree of freedom, unit variance
        ("turned", f8, (P, 3)),  # heading after the last tick [rad], its sine and cosine
    ], align=True)  # fmt: skip


def _vessels(V: int) -> Dtype:
    return np.dtype([
        ("eta", f8, (V, 3)),  # N, E [m], psi [rad] {n}; psi is not wrapped
        ("active", i1, (V,)), ("controlled", i1, (V,)), ("kind", i1, (V,)), ("model", i1, (V,)), ("behaviour", i1, (V,)),
        ("plant", i2, (V,)),  # index into plants, -1 for kinematic ships
        ("nu", f8, (V, 3)),  # u, v [m/s], r [rad/s] {b}, over ground
        ("velocity", f8, (V, 2)),  # N, E {n} [m/s], over ground
        ("frame_eta", f8, (V, 3)),  # eta at the start of the traffic frame
        ("length", f8, (V,)), ("beam", f8, (V,)),  # [m]
        ("speed", f8, (V,)),  # set speed of kinematic ships [m/s]
        ("heading_set", f8, (V,)),  # heading that controlled kinematic ships and those on BEHAVIOUR_HOLD steer [rad]
        ("speed_hold", f8, (V,)),  # share of the speed error that is left after a frame, exp(-frame/T); 0: none
        ("turn_time", f8, (V,)), ("turn_rate_max", f8, (V,)), ("turn_decay", f8, (V,)),  # [s], [rad/s], 1 - exp(-frame/T)
        ("turn_constant", i1, (V,)),  # 1: turn at turn_rate_max with a dead band of 2 deg (the original)
        ("distance", f8, (V,)),  # sailed [m]
        ("mmsi", i8, (V,)), ("ais_class", i1, (V,)), ("ais_on", i1, (V,)),
    ], align=True)  # fmt: skip


def _routes(V: int) -> Dtype:
    return np.dtype([
        ("waypoint", f8, (V, W, 2)),  # N, E [m] {n}
        ("count", i2, (V,)), ("leg", i2, (V,)),  # number of waypoints; index of the one being approached
        ("radius", f8, (V,)),  # circle of acceptance [m]
        ("after_last", i1, (V,)), ("done", i1, (V,)),
        ("reached", i4, (V,)),  # how many waypoints were reached so far (a notice each)
    ], align=True)  # fmt: skip


def _pilots(V: int) -> Dtype:
    """Who is on the bridge of a ship with a behaviour beyond its route (usv_gym/traffic)."""
    return np.dtype([
        ("range", f8, (V,)),  # [m] within which it heeds others (hostile: begins)
        ("period_us", i8, (V,)), ("next_tick", i8, (V,)),  # between two looks (erratic: two whims); tick of the next
        ("act_time", f8, (V,)), ("extremis_time", f8, (V,)),  # TCPA [s] at which it gives way; at which it acts as stand-on
        ("clearance", f8, (V,)),  # [m] between hulls that it is content with
        ("alteration", f8, (V,)),  # smallest alteration of course [rad]; erratic: largest off its route
        ("acceleration", f8, (V,)),  # [m/s2] of changes of speed; 0: at once
        ("ahead", f8, (V,)), ("target", i2, (V,)),  # hostile: how far ahead it passes [m], and of which vessel slot
        ("wander", f8, (V,)),  # erratic: [m] from its route that it never exceeds
        # state
        ("phase", i1, (V,)),  # 0: on its route; COLREGs 1: evading; hostile 1: closing in, 2: has crossed, 3: done with it
        # course [rad] that it steers off its route (erratic: off that of its route), share of its speed that it makes
        ("course", f8, (V,)), ("factor", f8, (V,)),
        ("since", i8, (V,)),  # tick at which it left its route
        ("met", i2, (V, R)), ("role", i1, (V, R)),  # vessel slot, and the locked Encounter towards it; role 0: free
    ], align=True)  # fmt: skip


def _events(E: int) -> Dtype:
    """What happens in a scenario, and when (usv_gym/events.py)."""
    return np.dtype([
        ("trigger", i1, (E,)), ("threshold", f8, (E,)),  # TRIGGER_*; s, m or s
        # source whose distance or TCPA counts, from a point N, E [m] {n} (NaN: from the own ship)
        ("subject", i4, (E,)), ("point", f8, (E, 2)),
        ("duration", f8, (E,)),  # [s]; inf: for good
        ("action", i1, (E,)), ("target", i4, (E,)),  # EVENT_*; source, or thruster (-1: all)
        ("value", f8, (E, 13)), ("saved", f8, (E, 13)),  # how much; what was before
        ("state", i1, (E,)),  # 0 to come, 1 under way, 2 over
        ("began", i8, (E,)), ("ended", i8, (E,)),  # ticks
    ], align=True)  # fmt: skip


def _replays(V: int) -> Dtype:
    """Recorded tracks of ships on BEHAVIOUR_REPLAY: where in the pool they are, and when they are left (traffic/replay.py)."""
    return np.dtype([
        ("first", i8, (V,)), ("count", i4, (V,)), ("knot", i8, (V,)),  # first knot, how many; the one last passed (state)
        # handover to the behaviour `then`: within a range [m] of an observer's vessel, or when it will pass closer than dcpa
        # [m] within tcpa [s]
        ("hands_over", i1, (V,)), ("then", i1, (V,)), ("range", f8, (V,)), ("dcpa", f8, (V,)), ("tcpa", f8, (V,)),
        ("changes", i4, (V,)),  # how often it appeared, vanished or was handed over (a notice each)
    ], align=True)  # fmt: skip


def _obstacles(M: int) -> Dtype:
    return np.dtype([
        ("position", f8, (M, 2)),  # N, E [m] {n}
        ("active", i1, (M,)), ("kind", i1, (M,)),
        ("frame_position", f8, (M, 2)),  # at the start of the traffic frame
        ("velocity", f8, (M, 2)),  # own drift [m/s] {n}
        ("drifts", i1, (M,)),  # 1: also carried by the current
        ("radius", f8, (M,)),  # [m]
        ("mmsi", i8, (M,)), ("ais_class", i1, (M,)), ("ais_on", i1, (M,)),
    ], align=True)  # fmt: skip


@functools.cache
def pair_dtype() -> Dtype:
    """What is remembered of an own ship and one other (usv_gym/colregs/machine.py); all zeros is "safe, never met"."""
    return np.dtype([
        ("state", i1), ("code", i1),  # machine.SF..EM; encounter.Encounter, locked while not SAFE
        ("stage", i1), ("passed", i1),  # 1 far .. 4 close, by range; the closest point of this encounter is past
        ("size", f8),  # k_size of the pair
        ("r2", f8), ("r3", f8), ("r4", f8), ("r_pref", f8),  # [m] of this encounter
        ("range", f8), ("dcpa", f8), ("tcpa", f8),  # [m], [m], [s] now
        ("alpha", f8), ("beta", f8),  # contact angle, relative bearing now [rad]
        ("course", f8), ("speed", f8),  # own, as the encounter began [rad], [m/s]
    ], align=True)  # fmt: skip


def _safety(O: int, S: int) -> Dtype:
    """Truth about distances between each observer's hull and every source, kept by the collision sweep."""
    return np.dtype([
        ("distance", f8, (O, S)),  # hull to hull at the end of the last frame [m]
        ("closest", f8, (O, S)),  # smallest since reset [m]
        ("step_closest", f8, (O,)),  # smallest to anything within the last control step [m]
        ("collided_with", i4, (O,)),  # source index, -1 for none
        ("land_distance", f8, (O,)), ("land_closest", f8, (O,)),  # hull to land [m]: end of the last frame; since reset
        ("grounded", i1, (O,)),  # 1 from the first touch of land on
    ], align=True)  # fmt: skip


def _sensors() -> Dtype:
    """Sensor parameters of a world, shared by its observers.  Periods in microseconds; 0 switches a sensor off."""
    scan = np.dtype([
        ("on", i1), ("period_us", i8), ("latency_us", i8),
        ("range", f8), ("range_min", f8),  # [m]
        ("gain", f8), ("gain_floor", f8),  # f(d) = max(gain * d, gain_floor), thesis (2.5)
        ("noise", f8, (2,)),  # standard deviation of the white part at f(d) = 1: position per axis [m], radius [m]
        ("bias", f8, (2,)), ("bias_time", f8, (2,)),  # stationary standard deviation [m], time constant [s]
        ("detection", f8), ("detection_radius", f8),  # P_d of a large object; apparent radius [m] at which P_d is halved
        ("timeout_us", i8),
        ("false_alarms", f8),  # mean number per scan
        # of the time [s] between two fixes last asked for (sensors/ekf.py): decays of both biases, the share of a line's weight
        # that is left, and by how much the bias slows the convergence of a mean, (1 + a) / (1 - a)
        ("elapsed", f8), ("decay", f8, (2,)), ("fade", f8), ("slowness", f8),
        ("outage", i1),  # fault: gives nothing
    ], align=True)  # fmt: skip
    return np.dtype([
        ("exteroceptive", i1),  # 0: AIS, radar, LiDAR and TDM are not simulated (observation `truth` needs none)
        # AIS, as transmitted: E and N [m], COG [rad], true heading ("track") [rad], SOG [m/s], ROT [rad/s]
        ("ais_on", i1), ("ais_range", f8), ("ais_loss", f8), ("ais_latency_us", i8),
        ("ais_interval_us", i8),  # fixed interval; 0: the schedule of ITU-R M.1371
        ("ais_timeout", f8),  # in expected reporting intervals
        ("ais_noise", f8, (6,)), ("ais_bias", f8, (6,)), ("ais_bias_time", f8, (6,)),
        ("ais_quantised", i1),  # what is received has the resolution of the wire
        ("ais_jammed", i1),
        ("radar", scan), ("lidar", scan),
        ("radius_min", f8),  # smallest measured radius [m]
        # TDM
        ("tdm_period_us", i8),
        ("process_u", f8), ("process_r", f8), ("process_time", f8),  # PSD [(m/s2)^2/s], [(rad/s2)^2/s]; T [s] of b1, b2
        ("light", i1), ("light_q", f8),  # 1: the filters of sensors/light.py; PSD of their acceleration [(m/s2)^2/s]
        ("inflation", f8),  # Carlson's federated inflation of Q and P0; 1 in the thesis
        # own navigation: period [us], white noise per field
        ("gnss_period_us", i8), ("gnss_noise", f8, (4,)),  # position [m], heading [rad], course [rad], speed [m/s]
        # faults: holds its last fix; offset [m] {n}, growing at a rate [m/s] since a tick
        ("gnss_frozen", i1), ("gnss_drift", f8, (2,)), ("gnss_drift_rate", f8, (2,)), ("gnss_drift_tick", i8),
        ("mru_period_us", i8), ("mru_noise", f8, (2,)),  # heading [rad], yaw rate [rad/s]; roll, pitch, heave are 0 in 3 DOF
        ("imu_period_us", i8), ("imu_noise", f8, (2,)),  # specific force [m/s2], yaw rate [rad/s]
        ("log_period_us", i8), ("log_noise", f8),  # speed log: u, v [m/s]
        ("wind_period_us", i8), ("wind_noise", f8, (2,)),  # speed [m/s], angle [rad]
    ], align=True)  # fmt: skip


def _ais(O: int, S: int) -> Dtype:
    """What ships transmit and what observers receive.  ``report`` is the last message of each source, as on the wire."""
    return np.dtype([
        ("next_tick", i8, (S,)),  # of transmission
        ("last_tick", i8, (S,)),  # of the bias process
        ("bias", f8, (S, 6)),  # N, E [m], COG, heading [rad], SOG [m/s], ROT [rad/s]
        ("sequence", i4, (S,)),  # messages sent so far
        ("stamp_us", i8, (S,)),
        ("position", f8, (S, 2)),  # reported N, E [m] {n}
        ("cog", f8, (S,)), ("heading", f8, (S,)),  # [rad]
        ("sog", f8, (S,)), ("rot", f8, (S,)),  # [m/s], [rad/s]; NaN where the message type has none
        # fault: what a station says is off by an offset [m] {n} that grows at a rate [m/s] since a tick, under this MMSI
        # (0: its own), and makes a target of its own in this slot (0: no fault)
        ("spoof_offset", f8, (S, 2)), ("spoof_rate", f8, (S, 2)), ("spoof_tick", i8, (S,)), ("spoof_mmsi", i8, (S,)),
        ("spoof_source", i4, (S,)), ("sent_as", i4, (S,)),  # sent_as: the same of the last message
        ("received", i4, (O, S)),  # sequence number of the last message that got through
        ("due_tick", i8, (O, S)),  # when that message arrives; -1: nothing on its way
        # the last message that arrived: N, E [m], COG, heading [rad], SOG [m/s], ROT [rad/s]; stamp -1: none yet
        ("inbox", f8, (O, S, 6)), ("inbox_stamp_us", i8, (O, S)),
    ], align=True)  # fmt: skip


def _nav(O: int) -> Dtype:
    """Own navigation of each observer, as measured.  ``next`` are ticks."""
    return np.dtype([
        ("gnss_next", i8, (O,)), ("mru_next", i8, (O,)), ("imu_next", i8, (O,)), ("log_next", i8, (O,)),
        ("wind_next", i8, (O,)), ("gnss_stamp_us", i8, (O,)),
        ("position", f8, (O, 2)), ("heading", f8, (O,)), ("course", f8, (O,)), ("sog", f8, (O,)),
        ("mru_heading", f8, (O,)), ("yaw_rate", f8, (O,)),
        ("specific_force", f8, (O, 2)), ("imu_yaw_rate", f8, (O,)), ("imu_nu", f8, (O, 3)),  # last nu and its tick: internal
        ("imu_tick", i8, (O,)),
        ("water_speed", f8, (O, 2)),  # u, v over ground by the speed log [m/s]
        ("wind_speed", f8, (O,)), ("wind_angle", f8, (O,)),
        ("leg", i2, (O,)),  # own idea of the active waypoint, from measured position
        ("route_done", i1, (O,)),
    ], align=True)  # fmt: skip


def _filters(S: int) -> Dtype:
    """The filters of one sensor of an observer, each number a row [S], and what they are fed with."""
    return np.dtype([
        ("x", f8, (6, S)), ("p", f8, (6, S)),  # of sensors/light.py
        # of radar and LiDAR only: line through the fixes (sensors/still.py); apparent radius and its bias; the last raw
        # measurement, N, E, radius, f(d); truth of the sensor error, bias of N, E, radius (unit f(d)); work space of
        # sensors/intake.py
        ("line", f8, (10, S)), ("size", f8, (2, S)), ("p_size", f8, (3, S)), ("measured", f8, (4, S)), ("bias", f8, (3, S)),
        ("todo", f8, (S,)), ("factor", f8, (S,)),
    ])  # fmt: skip


def _tracks(O: int, S: int) -> Dtype:
    """Local filters of each observer and source.  Axis of 3: AIS, radar, LiDAR; of 2: radar, LiDAR."""
    return np.dtype([
        ("stamp_us", i8, (O, 3, S)),  # time of validity of each local filter
        ("phase", i1, (O, 3, S)),
        ("id", i4, (O, S)),  # stable target id, 0: no target
        ("ais_timeout_us", f8, (O, S)),  # after the last message
        ("filters", _filters(S), (O, 3)),
        # the thesis's filters (sensors/tracker.py)
        ("x_ais", f8, (O, S, NX_AIS)), ("p_ais", f8, (O, S, NP_AIS)),
        ("x_scan", f8, (O, 2, S, NX_SCAN)), ("p_scan", f8, (O, 2, S, NP_SCAN)),
        ("scan_bias_us", i8, (O, 2, S)),  # of the truth of the sensor error
        ("measured_us", i8, (O, 2, S)),  # of the last raw measurement
        ("scan_found", i8, (O, 2)),  # how many measurements the last scan has
        ("scan_us", i8, (O, 2)), ("scan_due", i8, (O, 2)),  # stamp of the last scan; tick at which it arrives, -1: did
        ("nearest", i4, (O, S)),  # all sources by range, as they were at the last look
        # the LiDAR's last look at all sources (sensors/scan.py): tick, from where N, E [m] {n}, largest speed of any [m/s]; and
        # which were within so many metres of its reach, the only ones to look at until things have moved so far
        ("looked_tick", i8, (O,)), ("looked_from", f8, (O, 2)), ("fastest", f8, (O,)), ("slack", f8, (O,)),
        ("close_count", i4, (O,)), ("close", i4, (O, S)),
        ("visible", i1, (O, 2, S)),  # whether the last scan of that sensor could see the source (truth of the sensor)
        # echoes of land: nearest point N, E [m] {n} in each bearing sector, NaN for none; second axis of 2: the scan under
        # way, the last that arrived
        ("land", f8, (O, 2, 2, L, 2)), ("land_us", i8, (O, 2, 2)),  # stamp, -1 for none
    ], align=True)  # fmt: skip


def _picture(O: int, S: int) -> Dtype:
    """Detected targets as the TDM reports them: the only thing a controller gets to see of the surroundings.

    Slot s is source s; the T slots that follow are stretches of coast.
    """
    D = S + T
    return np.dtype([
        ("tick", i8, (O,)), ("sequence", i4, (O,)), ("next_id", i4, (O,)),
        ("count", i4, (O,)),  # how many are valid
        ("id", i4, (O, D)),  # 0: empty
        ("descriptor", i1, (O, D)), ("sensors", i1, (O, D)),  # bit 0 AIS, 1 radar, 2 LiDAR
        ("motion_known", i1, (O, D)),
        ("position", f8, (O, D, 2)),  # N, E [m] {n}
        ("cog", f8, (O, D)), ("sog", f8, (O, D)), ("rot", f8, (O, D)),  # [rad], [m/s], [rad/s]; NaN while unknown
        ("radius", f8, (O, D)),  # apparent radius [m]; NaN while only AIS has seen it
        ("covariance", f8, (O, D, 5)),  # of N, NE, E [m2], variance of cog [rad2] and sog [m2/s2]
        ("radius_variance", f8, (O, D)),
        # nearest land per bearing sector, N, E [m] {n}, NaN for none: as radar and LiDAR echo it, and as the chart has it
        # around the measured own position
        ("land", f8, (O, L, 2)), ("land_sensors", i1, (O, L)), ("chart", f8, (O, L, 2)),
        ("chart_place", f8, (O, 2)),  # where the chart was last read [m] {n}
    ], align=True)  # fmt: skip


@functools.cache
def world_dtype(V: int, M: int, O: int = 1, P: int = 1) -> Dtype:
    """dtype of a world with V vessel slots, M obstacle slots, O observers and P plants (see the module's docstring)."""
    S = V + M
    return np.dtype([
        ("tick", i8), ("dt_us", i8), ("dt", f8),
        ("frame_ticks", i8), ("frame_tick", i8),  # ticks per traffic frame; tick at which the current frame began
        ("traffic_tick", i8),  # tick to which positions of traffic refer
        ("ais_send", i8), ("ais_due", i8),  # first tick at which any AIS message is sent, arrives
        ("radar_next", i8), ("lidar_next", i8), ("report_next", i8),  # ticks of the next scans and of the TDM's next report
        ("next_sense", i8), ("next_nav", i8),  # first tick at which any exteroceptive sensor, any navigation sensor fires
        ("look_tick", i8),  # before which nobody reads the own navigation, but for the position (sensors/nav.py)
        ("seed", u8),
        ("origin", f8, (2,)), ("metres_per_degree", f8, (2,)),  # latitude, longitude [deg]; [m/deg]
        ("epoch_us", i8),  # UTC of tick 0
        ("land_id", i4), ("chart_id", i4),  # coast in the pool of land, true and charted; -1: none (world/land.py)
        ("area", f8, (2,)),  # centre-free bound: out of area when |N - N0| or |E - E0| exceeds it; [0] half size, 0: none
        ("weather", _weather()),
        ("vessels", _vessels(V)), ("plants", _plants(P)), ("routes", _routes(V)), ("obstacles", _obstacles(M)),
        ("pilots", _pilots(V)), ("replays", _replays(V)),
        ("events", _events(E)), ("events_left", i4),  # how many may still begin or end
        # the last so many obstacle slots stay inactive: targets that are not there; with clutter the last of these are those of
        # the radar's and the LiDAR's false alarms, the others of spoofed AIS stations
        ("phantoms", i4), ("clutter", i1),
        ("safety", _safety(O, S)), ("pairs", pair_dtype(), (O, V)),  # kept while a reward term asks for it
        ("sensors", _sensors()), ("observer", i2, (O,)),  # vessel slot of each observer
        ("ais", _ais(O, S)), ("nav", _nav(O)), ("tracks", _tracks(O, S)), ("picture", _picture(O, S)),
        # work space of the collision sweep (world/safety.py): smallest distance within the frame, distance at its end [m]
        ("near", f8, (S,)), ("end", f8, (S,)), ("hull", f8, (2, 5, 2)),
        # work space of the steering of ships (traffic/ships.py): how, where to [m] {n} or [rad], speed [m/s];
        # what comes of it: yaw rate [rad/s], velocity N, E [m/s]
        ("steer_how", i1, (V,)), ("steer_north", f8, (V,)), ("steer_east", f8, (V,)), ("steer_heading", f8, (V,)),
        ("steer_speed", f8, (V,)), ("steered_rate", f8, (V,)), ("steered_velocity", f8, (2, V)),
        # work space of looks and scans (sensors/shadow.py): distance [m] or its square of every source; by range: which source,
        # whether it is hidden, its slot in the streams of noise
        ("ranges", f8, (S,)), ("order", i4, (S,)), ("hidden", i1, (S,)), ("slots", i8, (S,)),
        ("look", f8, (15, S)),  # rows of numbers, for vector code, also of sensors/tdm.py
        ("lit_from", f8, (2 * S + 2,)), ("lit_to", f8, (2 * S + 2,)),
        ("estimate_x", f8, (2, 7)), ("estimate_p", f8, (2, 28)),  # of the thesis's fusion (sensors/tdm.py)
    ], align=True)  # fmt: skip


#: (vessels, obstacles): compile cost is per class, so there are few
CAPACITIES = ((8, 16), (20, 40), (64, 128), (257, 256))


def capacity(vessels: int, obstacles: int) -> tuple[int, int]:
    """Smallest capacity class that holds a world.

    Raises
    ------
    ValueError
        if there are more objects than the largest class holds.
    """
    for V, M in CAPACITIES:
        if vessels <= V and obstacles <= M:
            return V, M
    V, M = CAPACITIES[-1]
    raise ValueError(f"{vessels} vessels and {obstacles} obstacles: at most {V} and {M} fit into one world")
