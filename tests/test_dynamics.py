"""Own-ship physics: against the recordings of the simulator of 2017, against its published tables, and by property."""

from __future__ import annotations

import json

import numpy as np
import pytest
from dynamics_helpers import (
    GOLDEN,
    RECORDINGS,
    demand,
    golden_tables,
    jets,
    make_world,
    propellers,
    replay,
    run,
    simulate,
    steer,
    thrust_log,
)
from hypothesis import given, settings
from hypothesis import strategies as st

from usv_gym.jit import kernel
from usv_gym.world.dynamics import crossflow
from usv_gym.world.vessel import load_vessel, write_plant

recordings = pytest.mark.skipif(not RECORDINGS.is_dir(), reason="the recordings of 2017 are not on this machine")
NOTHING = np.zeros((0, 2))
VESSELS = ("odin", "jolner", "otter")


def rms(error):
    return np.sqrt(np.mean(error**2, axis=0))


# --- the recordings --------------------------------------------------------------------------------------------------
@recordings
@pytest.mark.parametrize(("memory", "limit"), [(False, (0.03, 0.06, 0.014)), (True, (0.03, 0.03, 0.010))])
def test_replay_of_thrust_log_b(memory, limit):
    # the replayer started 7 steps (35 rows) before the dynamics, which began at rest and published after each step
    worlds = make_world(preset="original", memory=memory)
    worlds["plants"]["n"] = 0.0
    out = np.zeros((1102, 6))
    replay(worlds, thrust_log("thrust_log_b.txt")[35:], 5, NOTHING, NOTHING, out)
    recorded = np.genfromtxt(RECORDINGS / "calm_thrust_log_b_20Hz.csv", delimiter=",", skip_header=1)[:1101, [1, 2, 6]]
    error = rms(out[1:, 3:] - recorded)
    assert np.all(error <= limit), error
    assert np.all(error <= (0.005, 0.055, 0.012)), error  # what a 3-DOF reduction of the 6-DOF model should leave


@recordings
@pytest.mark.parametrize(("memory", "limit"), [(False, (0.01, 0.03, 0.006)), (True, (0.003, 0.015, 0.004))])
def test_drift_in_wind_and_current(memory, limit):
    table = np.genfromtxt(RECORDINGS / "wind_current_drift_20Hz.csv", delimiter=",", names=True)
    worlds = make_world(preset="original", memory=memory)
    plant = worlds["plants"]
    plant["cd2d"], plant["crossflow_sway"] = 0.65, 1.0  # as before 2017-05-31
    plant["n"] = 0.0
    worlds["vessels"]["eta"][0, 0] = table["x_N_m"][0], table["y_E_m"][0], table["yaw_rad"][0]
    worlds["vessels"]["nu"][0, 0] = table["u"][0], table["v"][0], table["r"][0]
    wind = np.column_stack([table["wind_total_U10_mps"], np.radians(90.0 + table["wind_dir_dev_deg"])])
    direction = np.radians(table["current_mean_dir_deg"] + table["current_dir_dev_deg"])
    current = table["current_total_mps"][:, None] * np.column_stack([np.cos(direction), np.sin(direction)])
    out = np.zeros((len(table), 6))
    replay(worlds, np.zeros((0, 2, 3)), 1, wind, current, out)
    error = rms(out[:, 3:] - np.column_stack([table["u"], table["v"], table["r"]]))
    assert np.all(error <= limit), error


@recordings
def test_end_point_of_thrust_log_a():
    log = thrust_log("thrust_log_a.txt")
    worlds = make_world(preset="original")
    out = np.zeros((len(log) // 5 + 1, 6))
    replay(worlds, log, 5, NOTHING, NOTHING, out)
    assert np.hypot(out[-1, 0] - 149.0, out[-1, 1] + 49.0) <= 6.0, out[-1]


# --- published tables ------------------------------------------------------------------------------------------------
@pytest.mark.parametrize(
    ("rpm", "speed"), [(0, 1.16), (10, 1.75), (25, 2.64), (50, 4.14), (61, 4.81), (75, 5.66), (100, 7.18)]
)
def test_steady_speed(rpm, speed):
    out = simulate(make_world(preset="original"), 120, command=jets(rpm / 100))
    assert out[-1, 3] == pytest.approx(speed, rel=0.03)


def test_astern_neutral_and_bow_thruster():
    def end(*command):
        return simulate(make_world(preset="original"), 120, command=jets(*command))[-1, 3:]

    assert end(0.5, 0.0, -1.0)[0] == pytest.approx(-3.97, rel=0.03)
    assert end(0.5, 0.0, 0.0)[0] == pytest.approx(0.0, abs=1e-9)
    _, v, r = end(0.0, 0.0, 0.0, 1.0)
    assert (v, np.degrees(r)) == pytest.approx((0.415, 21.1), rel=0.03)


def test_acceleration_and_coasting():
    worlds = make_world(preset="standard")
    simulate(worlds, 0.5)  # from rest, bucket neutral
    worlds["vessels"]["nu"][0, 0] = 7.18, 0.0, 0.0
    start = worlds["vessels"]["eta"][0, 0, 0]
    out = simulate(worlds, 60.0, command=jets(1.0, 0.0, 0.0))
    assert out[[199, 599, 1199], 3] == pytest.approx((1.12, 0.26, 0.06), abs=0.02)
    assert out[-1, 0] - start == pytest.approx(42.8, rel=0.05)


@pytest.mark.parametrize(
    ("rpm", "turns"),
    [
        (25, [(2.64, -0.24, 2.3, 66), (2.63, -0.35, 4.4, 34), (2.60, -0.44, 7.2, 21), (2.47, -0.51, 11.7, 12.4)]),
        (50, [(4.14, -0.41, 3.6, 67), (4.13, -0.58, 6.7, 36), (4.08, -0.72, 11.0, 22), (3.89, -0.82, 17.8, 12.8)]),
        (75, [(5.65, -0.59, 4.8, 68), (5.64, -0.81, 9.0, 36), (5.57, -1.00, 14.7, 22), (5.32, -1.14, 23.9, 13.0)]),
        (100, [(7.17, -0.76, 6.0, 69), (7.15, -1.05, 11.3, 37), (7.07, -1.28, 18.4, 22), (6.75, -1.46, 29.9, 13.2)]),
    ],
)
def test_steady_turns(rpm, turns):
    for nozzle, (u, v, r, radius) in zip((10, 25, 50, 100), turns, strict=True):
        out = simulate(make_world(preset="original"), 150, command=jets(rpm / 100, nozzle / 100))[-1, 3:]
        assert out[0] == pytest.approx(u, rel=0.03)
        assert out[1] == pytest.approx(v, rel=0.03)
        assert np.degrees(out[2]) == pytest.approx(r, rel=0.03)
        assert np.hypot(out[0], out[1]) / out[2] == pytest.approx(radius, rel=0.03)


def test_wind_load_samples():
    """U10 = 10 m/s, 5.7 m/s at the sensor, vessel at rest: the original's own sample forces."""
    for angle, dof, expected in ((0, 0, -122), (180, 0, 133), (90, 1, 199), (60, 2, 414)):
        worlds = make_world(preset="original")
        worlds["weather"]["wind_u10"] = 10.0
        worlds["weather"]["wind_direction"] = np.radians(180.0 + -angle)  # gamma is positive from port
        worlds["plants"]["n"], worlds["plants"]["n_idle"] = 0.0, 0.0
        run(worlds, 1, np.zeros((0, 6)))
        assert worlds["plants"]["tau_wind"][0, 0, dof] == pytest.approx(expected, rel=0.02)


def test_otter_as_published():
    otter = load_vessel("otter")
    assert otter.mass.matrix()[2, 2] == pytest.approx(41.4, abs=0.1)  # PythonVehicleSimulator
    assert simulate(make_world("otter"), 60, command=propellers(1.0, 1.0))[-1, 3] == pytest.approx(6 * 0.5144, rel=0.02)
    r = simulate(make_world("otter"), 60, command=propellers(0.5, -0.5))[-1, 5]
    assert r > 0.0  # port propeller ahead turns to starboard


def test_golden_tables():
    golden = json.loads(GOLDEN.read_text())
    tables = golden_tables()
    assert tables.keys() == golden.keys()
    for vessel, table in tables.items():
        assert table.keys() == golden[vessel].keys()
        for case, motion in table.items():
            assert motion == pytest.approx(golden[vessel][case], rel=1e-4, abs=2e-5), (vessel, case)


# --- properties ------------------------------------------------------------------------------------------------------
demands = st.floats(-1.0, 1.0)
angles = st.floats(-3.1, 3.1)
fast = settings(max_examples=25, deadline=None)


def sail(vessel, surge=0.5, yaw=0.3, start=(0.0, 0.0, 0.0), nu=(2.0, 0.2, 0.1), seconds=20, **kw):
    worlds = make_world(vessel, **kw)
    worlds["vessels"]["eta"][0, 0] = start
    worlds["vessels"]["nu"][0, 0] = nu
    demand(worlds, surge, yaw)
    return simulate(worlds, seconds)


@fast
@given(vessel=st.sampled_from(VESSELS), surge=demands, yaw=demands, wind=angles, current=angles)
def test_port_starboard_mirror(vessel, surge, yaw, wind, current):
    def weather(side):
        means = {"wind_speed": 8.0, "wind_to": side * wind, "current_speed": 0.4, "current_to": side * current}
        return {**means, "gusts": False}

    a = sail(vessel, surge=surge, yaw=yaw, nu=(1.0, 0.2, 0.1), **weather(1.0))
    b = sail(vessel, surge=surge, yaw=-yaw, nu=(1.0, -0.2, -0.1), **weather(-1.0))
    np.testing.assert_allclose(a, b * (1.0, -1.0, -1.0, 1.0, -1.0, -1.0), atol=1e-9)


@fast
@given(vessel=st.sampled_from(VESSELS), turn=angles, north=st.floats(-500, 500), east=st.floats(-500, 500), yaw=demands)
def test_rotation_and_translation(vessel, turn, north, east, yaw):
    def weather(by):
        to = {"wind_to": by, "current_to": 1.0 + by, "wave_to": 2.0 + by}
        return {"wind_speed": 8.0, "current_speed": 0.4, "wave_height": 0.5, **to}

    a = sail(vessel, yaw=yaw, memory=vessel == "odin", **weather(0.0))
    b = sail(vessel, yaw=yaw, start=(north, east, turn), memory=vessel == "odin", **weather(turn))
    c, s = np.cos(turn), np.sin(turn)
    expected = np.column_stack([
        north + c * a[:, 0] - s * a[:, 1], east + s * a[:, 0] + c * a[:, 1], a[:, 2] + turn, a[:, 3:]
    ])  # fmt: skip
    np.testing.assert_allclose(b, expected, atol=1e-7)


@fast
@given(vessel=st.sampled_from(VESSELS), to=angles, speed=st.floats(0.1, 1.0), yaw=demands)
def test_uniform_current_only_carries(vessel, to, speed, yaw):
    """In still air drag aside, a vessel moves through moving water as it does through still water."""
    current = speed * np.array([np.cos(to), np.sin(to)])

    def track(moving):
        kw = {"current_speed": speed, "current_to": to, "gusts": False} if moving else {}
        worlds = make_world(vessel, **kw)
        worlds["plants"]["area_side"] = 0.0
        worlds["vessels"]["nu"][0, 0, :2] = current if moving else 0.0
        demand(worlds, 0.6, yaw)
        return simulate(worlds, 30)[:, :3]

    still, carried = track(False), track(True)
    carried[:, :2] -= current * 0.05 * np.arange(1, len(carried) + 1)[:, None]
    np.testing.assert_allclose(carried, still, atol=1e-9)


@fast
@given(
    vessel=st.sampled_from((*VESSELS, "otter full")),
    u=st.floats(-0.3, 1.0), v=st.floats(-0.3, 0.3), r=st.floats(-0.5, 0.5),
)  # fmt: skip
def test_no_energy_gained_unforced(vessel, u, v, r):
    model = load_vessel(vessel.split()[0])
    worlds = make_world(model.name)
    if "full" in vessel:
        full = model.model_copy(update={"coriolis": model.coriolis.model_copy(update={"form": "full"})})
        write_plant(full, worlds, 0, 0)
    worlds["plants"]["n"], worlds["plants"]["n_idle"] = 0.0, 0.0
    worlds["vessels"]["nu"][0, 0] = u * model.max_speed, v * model.max_speed, r * model.max_speed / model.length
    nu = np.vstack([worlds["vessels"]["nu"][0, 0].copy(), simulate(worlds, 20)[:, 3:]])
    energy = 0.5 * np.einsum("ti,ij,tj->t", nu, model.mass.matrix(), nu)
    assert energy.max() <= energy[0] + 1e-9
    if model.coriolis.form != "linearised":  # which does a little work on its own, less than damping takes
        assert np.all(np.diff(energy) <= 1e-9)


@kernel
def _crossflow(v, r, x0, x1):
    return crossflow(v, r, x0, x1)


@settings(max_examples=200, deadline=None)
@given(v=st.floats(-3, 3), r=st.floats(-1, 1), x0=st.floats(-6, -0.5), x1=st.floats(0.5, 6))
def test_crossflow_closed_form_equals_strips(v, r, x0, x1):
    n = 20000
    x = x0 + (np.arange(n) + 0.5) * (x1 - x0) / n
    y = v + x * r
    strips = np.array([np.sum(abs(y) * y), np.sum(x * abs(y) * y)]) * (x1 - x0) / n
    np.testing.assert_allclose(_crossflow(v, r, x0, x1), strips, atol=2e-5, rtol=1e-6)


def test_crossflow_original_strip_sum():
    """The original's 1 cm strips from -L/2 to 0.9 L/2 against the closed form."""
    x = np.arange(-5.25, 4.725, 0.01)
    for v, r in ((0.5, 0.1), (-0.8, 0.3), (0.06, -0.4)):
        y = v + x * r
        strips = np.array([np.sum(abs(y) * y), np.sum(x * abs(y) * y)]) * 0.01
        np.testing.assert_allclose(_crossflow(v, r, -5.25, 4.725), strips, rtol=0.02, atol=0.02)


def test_heun_at_10_hz():
    """A hard manoeuvre of 120 s: 10 Hz against 500 Hz, actuator lags included."""
    ends = []
    for dt in (0.1, 0.002):
        worlds = make_world(dt=dt)
        for surge, yaw in ((1.0, 1.0), (0.3, -1.0), (0.8, 0.5), (-0.5, 0.2), (1.0, -0.7), (0.6, 1.0)):
            demand(worlds, surge, yaw)
            end = simulate(worlds, 20.0)[-1]
        ends.append(end)
    assert np.hypot(*(ends[0] - ends[1])[:2]) <= 1.8, ends


@pytest.mark.parametrize("dt", [0.02, 0.05, 0.1])
def test_fluid_memory_is_stable_and_vanishes_in_steady_motion(dt):
    with_memory = simulate(make_world(memory=True, dt=dt), 200, command=jets(0.7, 0.5))[-1, 3:]
    without = simulate(make_world(dt=dt), 200, command=jets(0.7, 0.5))[-1, 3:]
    np.testing.assert_allclose(with_memory, without, rtol=1e-3)


# --- actuators -------------------------------------------------------------------------------------------------------
def test_commands_saturate():
    a = simulate(make_world(), 20, command=jets(1.0, 1.0, 1.0, 1.0))
    b = simulate(make_world(), 20, command=jets(3.0, 50.0, 2.0, np.inf))
    np.testing.assert_array_equal(a, b)
    a = simulate(make_world("otter"), 20, command=propellers(-1.0, 1.0))
    b = simulate(make_world("otter"), 20, command=propellers(-np.inf, 7.0))
    np.testing.assert_array_equal(a, b)


def test_lags_are_exact_and_independent_of_dt():
    for dt in (0.02, 0.1):
        worlds = make_world(dt=dt)
        simulate(worlds, 0.4, command=jets(1.0, 1.0, 1.0))
        plant = worlds["plants"][0]
        assert plant["n"][0, 0] == pytest.approx(400 + 1600 * (1 - np.exp(-1)))
        assert plant["alpha"][0, 0] == pytest.approx(-np.radians(27) * (1 - np.exp(-0.4)))
        assert plant["beta"][0, 0] == pytest.approx(1 - np.exp(-4))


def test_original_actuators_step_once_per_call():
    worlds = make_world(preset="original", dt=0.01)
    simulate(worlds, 0.01, command=jets(1.0, 1.0, 1.0))
    plant = worlds["plants"][0]
    assert plant["n"][0, 0] == pytest.approx(400 + 1600 * 0.05 / 0.4)
    assert plant["beta"][0, 0] == pytest.approx(0.5)


def test_faults():
    worlds = make_world()
    worlds["plants"]["thrust_left"][0, 0, 0] = 0.0  # starboard jet dead: the port jet pushes the bow to starboard
    assert simulate(worlds, 10, command=jets(0.5))[-1, 5] > 0.0
    worlds = make_world()
    simulate(worlds, 10, command=jets(0.5, 1.0))
    worlds["plants"]["nozzle_stuck"][0, 0] = 1
    assert simulate(worlds, 20, command=jets(0.5, -1.0))[-1, 5] > 0.1


def test_bucket_in_the_yaw_moment():
    """A reversed jet yaws the other way, except in the preset `original`."""
    for preset, sign in (("standard", -1.0), ("original", 1.0)):
        worlds = make_world(preset=preset)
        assert sign * simulate(worlds, 3, command=jets(0.5, 1.0, -1.0))[-1, 5] > 0.0


# --- autopilot -------------------------------------------------------------------------------------------------------
@pytest.mark.parametrize(("dt", "every"), [(0.05, 1), (0.1, 10)])
@pytest.mark.parametrize(
    ("vessel", "speed"),
    [("odin", 2.0), ("odin", 5.0), ("odin", 6.8), ("jolner", 1.0), ("jolner", 1.8), ("otter", 0.6), ("otter", 2.5)],
)
def test_autopilot_holds_and_turns(vessel, speed, dt, every):
    worlds = make_world(vessel, dt=dt)
    out = np.zeros((round(60 / dt), 6))
    steer(worlds, 0.0, speed, len(out), every, out)
    half = len(out) // 2
    assert np.abs(np.degrees(out[half:, 2])).max() <= 2.0
    assert np.abs(out[half:, 3] - speed).max() <= 0.2
    for ref in (90.0, 0.0):  # to starboard and back to port
        steer(worlds, np.radians(ref), speed, len(out), every, out)
        heading = np.degrees(out[:, 2])
        beyond = heading - 90.0 if ref else -heading
        assert beyond.max() <= 10.0
        assert np.abs(beyond[-len(out) // 6 :]).max() <= 2.0
        assert np.abs(out[-len(out) // 6 :, 3] - speed).max() <= 0.2


def test_autopilot_in_wind():
    worlds = make_world(wind_speed=10.0, wind_to=np.pi / 2, gusts=False)
    out = np.zeros((2400, 6))
    for _ in range(3):
        steer(worlds, 0.0, 4.0, len(out), 1, out)
    assert abs(np.degrees(out[-1, 2])) < 1.0
    assert out[-1, 3] == pytest.approx(4.0, abs=0.05)


def test_demand_astern_turns_to_starboard():
    for vessel in VESSELS:
        worlds = make_world(vessel)
        demand(worlds, -0.5, 0.5)
        assert simulate(worlds, 3)[-1, 5] > 0.0


# --- vessel files ----------------------------------------------------------------------------------------------------
@pytest.mark.parametrize("vessel", VESSELS)
def test_vessel_files(vessel):
    model = load_vessel(vessel)
    assert model.name == vessel
    worlds = make_world(vessel)
    demand(worlds, 1.0, 0.0)
    assert simulate(worlds, 100)[-1, 3] == pytest.approx(model.max_speed, rel=0.02)
    assert model.cruise_speed < model.max_speed


def test_vessel_errors_are_one_line(tmp_path):
    with pytest.raises(ValueError, match="did you mean 'odin'"):
        load_vessel("odim")
    text = load_vessel("odin").model_dump(mode="json")
    text["damping"]["Nrx"] = 1.0
    file = tmp_path / "boat.yaml"
    file.write_text(json.dumps(text))
    with pytest.raises(ValueError, match=r"boat.yaml:1: damping.Nrx: .*did you mean 'Nr") as error:
        load_vessel(file)
    assert "\n" not in str(error.value)
    with pytest.raises(ValueError, match="fluid_memory"):
        write_plant(load_vessel("otter"), make_world(), 0, 0, memory=True)
