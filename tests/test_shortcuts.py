"""What a step leaves out makes no difference: every record, whoever measures, looks or carries the traffic on the way."""

from __future__ import annotations

import gymnasium as gym
import numpy as np
import pytest

import usv_gym  # noqa: F401
from usv_gym.engine import advance_worlds, settle_traffic
from usv_gym.world.land import NO_LAND
from usv_gym.world.lanes import lanes_for
from usv_gym.world.state import A

NO_ROWS = np.zeros((0, 0, A, 3))
NO_TRACKS = np.zeros((0, 7))
#: ships and drifting ice that come into the LiDAR's reach of 100 m and leave it again
CLOSE = {
    "name": "close",
    "simulation": {"dt": 0.1, "traffic_interval": 0.5, "control_interval": 1.0, "duration": 60.0},
    "own_ship": {"vessel": "odin", "route": [[500.0, 0.0], [500.0, 300.0]]},
    "weather": {"wind": {"speed": 8.0, "from_deg": 90.0}, "current": {"speed": 1.0, "to_deg": 180.0}},
    "sensors": {"base": "thesis", "navigation": {
        "gnss": {"rate": 5.0}, "imu": {"rate": 10.0}, "wind": {"rate": 3.0}, "mru": {"rate": 10.0}, "speed_log": {"rate": 4.0},
    }},
    "ships": {
        f"ship_{i}": {
            "class": "boat", "ais": "B", "speed": 9.0, "waypoints": [[90.0 + 40.0 * i, -150.0], [90.0 + 40.0 * i, 300.0]],
        } for i in range(4)
    },
    "obstacles": {
        f"ice_{i}": {"position": [170.0 + 35.0 * i, 60.0 * (-1) ** i], "radius": 4.0, "drift": "current"} for i in range(5)
    },
}  # fmt: skip
#: work space, and what the LiDAR remembers; how far ships have sailed, which is added up at every look
LEFT_OUT = (
    "look", "slots", "order", "hidden", "ranges", "lit_from", "lit_to", "near", "end", "hull", "estimate_x", "estimate_p",
    "todo", "factor", "elapsed", "decay", "fade", "slowness", "nearest", "look_tick",
    "looked_tick", "looked_from", "slack", "fastest", "close", "close_count", "distance",
)  # fmt: skip


def same(a, b, *, but=()):
    """Assert that two records agree in every bit but for some fields."""
    for name in a.dtype.names:
        if name in but:
            continue
        if a.dtype[name].base.names:
            same(a[name], b[name], but=but)
        else:
            assert np.array_equal(a[name], b[name], equal_nan=a.dtype[name].base.kind == "f"), name


@pytest.mark.parametrize("scenario", [CLOSE, "busy_open_sea"])
@pytest.mark.parametrize("filters", ["thesis", "light"])
def test_what_nobody_sees_need_not_be_worked_out(scenario, filters):
    """A step of many ticks against as many steps of one tick, each of which measures and looks at everything anew."""
    overrides = [f"sensors.tdm.filter={filters}"]
    env = gym.make("usv_gym/Scenario-v0", scenario=scenario, overrides=overrides, end_on_collision=False)
    env.reset(seed=4)
    core = env.unwrapped.core
    thorough = core.worlds.copy()
    lanes = lanes_for(thorough)
    ticks = round(core.control_interval / float(thorough["dt"][0]))
    near = 0
    for k in range(50):
        env.step(np.array([0.8, 0.2 * (-1) ** (k // 10)], np.float32))
        thorough["plants"]["command"] = core.worlds["plants"]["command"]
        thorough["safety"]["step_closest"] = np.inf
        for _ in range(ticks):
            thorough["tracks"]["slack"] = 0.0
            thorough["look_tick"] = 0
            settle_traffic(thorough)
            advance_worlds(thorough, lanes, NO_LAND, NO_TRACKS, 1, NO_ROWS)
        settle_traffic(thorough)
        near += int(thorough["tracks"]["visible"][0, 0, 1].any())
        same(core.worlds, thorough, but=LEFT_OUT)
        np.testing.assert_allclose(core.worlds["vessels"]["distance"], thorough["vessels"]["distance"], rtol=1e-12)
    assert near > 5 or scenario != CLOSE
