"""Seas to measure in: so many ships and icebergs around the own ship, all within radar range."""

from __future__ import annotations

import math
from typing import Any

WEATHER = {
    "wind": {"speed": 10.0, "from_deg": 90.0},
    "current": {"speed": 0.5, "to_deg": 90.0},
    "waves": {"height": 2.0, "from_deg": 90.0},
}


def crowded_sea(ships: int = 16, icebergs: int = 32, *, weather: bool = False, dt: float = 0.1,
                traffic_interval: float = 1.0) -> dict[str, Any]:  # fmt: skip
    """A scenario mapping: ships cross at 300 to 1400 m, icebergs stand at 150 to 1700 m; nobody is ever far away."""
    scenario: dict[str, Any] = {
        "name": f"crowded_{ships}_{icebergs}",
        "simulation": {
            "dt": dt, "traffic_interval": traffic_interval, "control_interval": 1.0, "duration": 1e6,
        },
        "own_ship": {"vessel": "odin", "route": [[1000.0, 0.0], [1000.0, 1000.0]]},
        "sensors": {
            "base": "thesis",
            "navigation": {key: {"rate": 1.0 / dt} for key in ("gnss", "mru", "imu", "speed_log", "wind")},
        },
        "ships": {},
        "obstacles": {},
    }  # fmt: skip
    if weather:
        scenario["weather"] = WEATHER
    golden = math.pi * (3.0 - math.sqrt(5.0))
    for i in range(ships):
        r, a = 300.0 + 1100.0 * i / max(ships - 1, 1), golden * i
        n, e = r * math.cos(a), r * math.sin(a)
        scenario["ships"][f"ship_{i}"] = {
            "class": ("ship", "vessel", "boat")[i % 3],
            "ais": ("A", "A", "B")[i % 3],
            "waypoints": [[n, e], [n + 150.0, e], [n + 150.0, e + 150.0], [n, e + 150.0]],
            "after_last": "loop",
            "speed": 3.0 + i % 5,
        }
    for i in range(icebergs):
        r, a = 150.0 + 1550.0 * i / max(icebergs - 1, 1), golden * i + 1.0
        scenario["obstacles"][f"iceberg_{i}"] = {
            "position": [r * math.cos(a), r * math.sin(a)],
            "radius": 5.0 + i % 4 * 5.0,
        }
    return scenario
