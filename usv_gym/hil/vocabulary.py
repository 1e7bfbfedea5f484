"""The names that profiles may use: what the simulation tells (signals) and what it can be asked for (commands).

SI units and radians throughout; latitude and longitude are degrees.  {n} is north-east, {b} forward-starboard; names that
begin with ``enu_`` or ``flu_`` are east-north-up and forward-left-up, as ROS has them (REP-103).
"""

from __future__ import annotations

#: in every signal
COMMON: dict[str, str] = {
    "stamp": "time of the simulation, as a time stamp",
    "t": "time since the start [s]",
    "utc": "time of the simulation [s since 1970]",
    "step": "number of the step",
    "sentences": "what NMEA sends; of AIS only",
}

_POSE = {
    "latitude": "[deg]", "longitude": "[deg]", "altitude": "0 [m]", "north": "of the origin [m]", "east": "[m]",
    "heading": "[rad]", "enu_yaw": "pi/2 - heading [rad]", "enu_qz": "quaternion about up", "enu_qw": "of the same",
    "ned_qz": "quaternion about down", "ned_qw": "of the same",
}  # fmt: skip

SIGNALS: dict[str, dict[str, str]] = {
    "clock": {},
    "step": {  # once for each command that is waited for, behind everything else
        "paused": "", "failsafe": "no command for too long", "command_age": "[s]", "lateness": "of the last step [s]",
        "overruns": "", "rejected": "messages refused",
    },
    "gnss": {
        **_POSE, "course": "[rad]", "sog": "[m/s]", "velocity_north": "[m/s]", "velocity_east": "[m/s]",
        "heading_rate": "[rad/s]", "position_variance": "per axis [m2]", "enu_covariance": "9 numbers [m2]",
    },
    "mru": {
        "heading": "[rad]", "yaw_rate": "clockwise [rad/s]", "enu_yaw": "[rad]", "enu_qz": "", "enu_qw": "",
        "flu_yaw_rate": "counter-clockwise [rad/s]", "ned_qz": "", "ned_qw": "", "roll": "0", "pitch": "0", "heave": "0",
        "north": "[m]", "east": "[m]", "surge": "[m/s]", "sway": "[m/s]",
    },
    "imu": {
        "force_x": "specific force ahead [m/s2]", "force_y": "to starboard [m/s2]", "force_z": "down, -9.81 [m/s2]",
        "yaw_rate": "clockwise [rad/s]", "flu_force_y": "to port [m/s2]", "flu_force_z": "up, 9.81 [m/s2]",
        "flu_yaw_rate": "[rad/s]", "heading": "of the MRU [rad]", "enu_qz": "", "enu_qw": "",
        "force_covariance": "9 numbers", "rate_covariance": "9 numbers",
    },
    "speed_log": {"surge": "over ground [m/s]", "sway": "to starboard [m/s]", "flu_sway": "to port [m/s]"},
    "wind": {
        "speed": "relative [m/s]", "angle": "where it comes from, off the bow, + starboard [rad]",
        "angle_positive": "the same in [0, 2 pi)", "flu_angle": "+ port [rad]",
    },
    "odometry": {  # GNSS, MRU and speed log in one, whenever the MRU is new
        **_POSE, "surge": "[m/s]", "sway": "[m/s]", "yaw_rate": "[rad/s]", "flu_sway": "[m/s]", "flu_yaw_rate": "[rad/s]",
        "pose_covariance": "36 numbers",
    },
    "ais": {  # one for each report received, and for each that the own ship sends
        "mmsi": "", "message_type": "1, 18 or 21", "own": "true: AIVDO", "status": "0", "accuracy": "1",
        "latitude": "[deg]", "longitude": "[deg]", "cog": "[rad]", "heading": "[rad]", "sog": "[m/s]", "rot": "[rad/s]",
        "name": "", "sentence": "the position report on the wire", "hour": "UTC", "minute": "", "second": "",
    },
    "target": {  # one for each detected target
        "id": "", "descriptor": "0 fixed, 1 vessel, 2 land", "descriptor_text": "fixed_obstacle or vessel",
        "sensors": "bits: 1 AIS, 2 radar, 4 LiDAR", "motion_known": "",
        "latitude": "[deg]", "longitude": "[deg]", "north": "[m]", "east": "[m]",
        "enu_covariance": "4 numbers [m2]", "cog": "NaN while unknown [rad]", "sog": "[m/s]", "rot": "[rad/s]",
        "cog_known": "0 while unknown [rad]", "sog_known": "0 while unknown [m/s]",
        "cog_variance": "[rad2]", "sog_variance": "[m2/s2]", "radius": "NaN while only AIS has seen it [m]",
        "radius_known": "0 then [m]", "radius_variance": "[m2]",
        "distance": "from the own ship's GNSS position [m]", "bearing": "true [rad]", "dcpa": "[m]", "tcpa": "[s]",
        "name": "T and its id", "number": "id modulo 100",
    },
    "targets": {"count": ""},
    "object": {  # truth, for the eyes of the operator: one for each ship and obstacle
        "id": "", "kind": "", "descriptor": "ship or fixed_obstacle", "radius": "[m]", "size": "length of a ship, radius [m]",
        **_POSE,
    },
    "objects": {"count": ""},
    "actuators": {
        **{f"{part}.{what}": "" for part in ("port", "starboard", "bow") for what in ("rpm", "nozzle", "bucket", "shaft")},
        "surge_force": "[N]", "sway_force": "to starboard [N]", "yaw_moment": "clockwise [N m]",
    },
    "weather": {  # truth
        "wind_speed": "at 10 m [m/s]", "wind_from": "[rad]", "current_speed": "[m/s]", "current_to": "[rad]",
        "wave_height": "[m]", "paused": "", "latitude": "of the origin [deg]", "longitude": "[deg]",
    },
    "notice": {"kind": "", "id": "", "text": ""},
    "markers": {"markers": "for RViz: list of visualization_msgs/Marker"},
    "track": {"poses": "where GNSS said the own ship was: list of geometry_msgs/PoseStamped"},
}  # fmt: skip

#: signals that are lists, and what their items are
ITEMS = {"targets": "target", "objects": "object"}

_THRUSTERS = ("port", "starboard", "bow")

COMMANDS: dict[str, dict[str, str]] = {
    "actuators": {
        **{f"{name}.{part}": "demand in [-1, 1]" for name in _THRUSTERS for part in ("rpm", "nozzle", "bucket")},
        **{f"{name}.thrust": "ahead, by the thruster's curve [N]" for name in _THRUSTERS},
        **{f"{name}.angle": "of the thruster, + counter-clockwise from above [rad]" for name in _THRUSTERS},
    },
    "heading_speed": {"heading": "true [rad]", "speed": "[m/s]"},
    "demand": {"surge": "[-1, 1]", "yaw": "[-1, 1], + to starboard"},
    "order": {
        "command": "spawn, delete, move, set_waypoints, set_ais, pause, resume, reset, stop", "id": "of the object",
        "latitude": "[deg]", "longitude": "[deg]", "radius": "[m]", "heading": "[rad]", "arguments": "JSON",
        "paused": "true: pause, false: resume",
    },
    "own_pose": {  # --own-ship external
        "latitude": "[deg]", "longitude": "[deg]", "north": "[m]", "east": "[m]", "heading": "[rad]", "course": "[rad]",
        "sog": "[m/s]", "yaw_rate": "[rad/s]", "enu_yaw": "[rad]", "enu_qz": "", "enu_qw": "", "flu_yaw_rate": "[rad/s]",
    },
}  # fmt: skip
