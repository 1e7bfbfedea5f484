"""What ships do that nobody controls (docs/traffic.md)."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from sensor_helpers import advance, sea, watch, wrapped

from usv_gym.config import ConfigError
from usv_gym.scenarios.commands import Commands
from usv_gym.scenarios.loader import load_scenario
from usv_gym.units import DEG
from usv_gym.world.encounter import Encounter, encounters
from usv_gym.world.state import BEHAVIOUR_COLREGS

FAR = {"position": [90_000, 0]}  #: the own ship is not in the way
SLOW = {"simulation": {"dt": 0.1, "traffic_interval": 0.5}, "sensors": {"base": "perfect", "navigation": {
    key: {"rate": 1.0} for key in ("gnss", "mru", "imu", "speed_log", "wind")}}}  # fmt: skip
LENGTH, CLEARANCE = 30.0, 60.0  #: of the class "vessel"


def ship(*waypoints, behaviour="waypoints", **keys):
    return {"waypoints": [list(place) for place in waypoints], "behaviour": behaviour, "after_last": "continue", **keys}


def track(worlds, seconds, every=1.0):
    """eta [T, B, 2, 3] of the ships in slots 1 and 2."""
    return watch(worlds, seconds, every, "vessels.eta")[0][:, :, 1:3]


# --- keep course, waypoints ------------------------------------------------------------------------------------------
def test_a_ship_that_keeps_its_course_does_not_mind_its_waypoints():
    worlds, _ = sea(**SLOW, own_ship=FAR, ships={"a": ship([0, 0], [100, 0], [100, 500], behaviour="keep_course", speed=5)})
    advance(worlds, 60)
    np.testing.assert_allclose(worlds["vessels"]["eta"][0, 1], [300, 0, 0], atol=1e-9)


def test_alone_a_ship_that_obeys_the_colregs_sails_as_any_other_bit_for_bit():
    route = [0, 0], [300, 0], [300, 500], [0, 500]
    tracks = []
    for behaviour in ("waypoints", "ignorant", "colregs"):
        worlds, _ = sea(**SLOW, own_ship=FAR, ships={"a": ship(*route, behaviour=behaviour)})
        tracks.append(watch(worlds, 240, 10, "vessels.eta")[0].tobytes())
    assert tracks[0] == tracks[1] == tracks[2]


# --- COLREGs ---------------------------------------------------------------------------------------------------------
def meetings(B, other, seed=0):
    """B worlds in which an obedient ship (slot 1) and another meet near the origin, from all sides and at all speeds.

    Returns the worlds and the code of each encounter, as the obedient ship sees it.
    """
    worlds, _ = sea(B, **SLOW, own_ship=FAR, ships={
        "obedient": ship([0, 0], [1, 0], behaviour="colregs"), "other": ship([0, 0], [1, 0], behaviour=other)})  # fmt: skip
    draw = np.random.default_rng(seed)
    v, r = worlds["vessels"], worlds["routes"]
    when = draw.uniform(300, 400, B)
    for j in (1, 2):
        speed = draw.uniform(3.0, 7.0, B)
        course = draw.uniform(-np.pi, np.pi, B) * (j - 1)
        ahead = np.stack([np.cos(course), np.sin(course)], axis=1)
        at = draw.normal(0.0, 20.0 * (j - 1), (B, 2))
        v["speed"][:, j] = v["nu"][:, j, 0] = speed
        v["velocity"][:, j] = speed[:, None] * ahead
        v["eta"][:, j, :2] = v["frame_eta"][:, j, :2] = at - ahead * (speed * when)[:, None]
        v["eta"][:, j, 2] = v["frame_eta"][:, j, 2] = course
        r["waypoint"][:, j, 0], r["waypoint"][:, j, 1] = v["eta"][:, j, :2], at + ahead * 9000.0
    worlds["pilots"]["next_tick"] = 0
    codes, distances, times = np.zeros((B, 1), int), np.zeros((B, 1)), np.zeros((B, 1))
    state = np.concatenate([v["eta"][:, 1:3, :2], v["velocity"][:, 1:3]], axis=2)
    encounters(state[:, 0].copy(), state[:, 1:].copy(), codes, distances, times)
    return worlds, codes[:, 0]


@pytest.fixture(scope="module")
def met():
    """Encounters with a ship that never gives way, and with one that obeys as well: codes [B], tracks [T, B, 2, 3]."""
    found = {}
    for other in ("ignorant", "colregs"):
        worlds, codes = meetings(300, other)
        found[other] = codes, track(worlds, 800, 2.0)
    return found


def closest(eta):
    return np.hypot(*np.moveaxis(eta[:, :, 0, :2] - eta[:, :, 1, :2], -1, 0)).min(axis=0)


def first_turn(heading):
    """Of headings [T, B]: the first departure of more than 20 deg from the start, + to starboard; 0: none."""
    off = np.degrees(wrapped(heading - heading[0]))
    at = (np.abs(off) > 20.0).argmax(axis=0)
    return np.where((np.abs(off) > 20.0).any(axis=0), np.take_along_axis(off, at[None], 0)[0], 0.0)


@pytest.mark.parametrize("code", [Encounter.HEAD_ON, Encounter.CROSSING_GIVE_WAY])
def test_who_gives_way_turns_to_starboard_passes_at_its_clearance_and_returns(met, code):
    codes, eta = met["ignorant"]
    one = eta[:, codes == code]
    assert one.shape[1] > 20
    assert (first_turn(one[:, :, 0, 2]) > 0.0).all()
    assert (closest(one) > 0.95 * (CLEARANCE + LENGTH)).all()
    back = np.degrees(wrapped(one[-1, :, 0, 2]))
    assert (np.abs(back) < 15.0).all()  # on its way to its waypoint again
    assert (np.abs(one[-1, :, 0, 1]) < 300.0).all()


def test_who_overtakes_keeps_clear(met):
    codes, eta = met["ignorant"]
    one = eta[:, codes == Encounter.OVERTAKING]
    assert one.shape[1] > 5
    assert (closest(one) > 0.9 * (CLEARANCE + LENGTH)).all()


def test_who_stands_on_keeps_course_while_the_other_gives_way(met):
    codes, eta = met["colregs"]
    for code in (Encounter.CROSSING_STAND_ON, Encounter.OVERTAKEN):
        turns = first_turn(eta[:, codes == code, 0, 2])
        assert len(turns) > 5
        assert (turns == 0.0).mean() > 0.9


def test_ships_that_obey_meet_at_their_clearance(met):
    _, eta = met["colregs"]
    assert (closest(eta) > 0.9 * (CLEARANCE + LENGTH)).all()


def test_in_extremis_who_stands_on_acts(met):
    codes, eta = met["ignorant"]
    one = eta[:, codes == Encounter.CROSSING_STAND_ON]
    apart = np.hypot(*np.moveaxis(one[:, :, 0, :2] - one[:, :, 1, :2], -1, 0))
    off = np.degrees(np.abs(wrapped(one[:, :, 0, 2])))
    collides, turned = closest(one), first_turn(one[:, :, 0, 2])
    assert (turned >= 0.0).all()  # not to port for a vessel on its port side (Rule 17 c)
    assert (turned > 0.0).mean() > 0.9
    acted = np.array([apart[np.argmax(off[:, b] > 5.0), b] for b in np.flatnonzero(turned > 0.0)])
    assert np.median(acted) < 500.0  # late: who gives way acts at 120 s to the closest point
    assert (collides > LENGTH).mean() > 0.98


def test_a_ship_looks_no_further_than_its_range():
    behaviour = {"kind": "colregs", "range": 100.0, "act_time": 600.0}
    for distance, heeds in ((300.0, False), (120.0, True)):
        worlds, _ = sea(**SLOW, own_ship=FAR, ships={
            "a": ship([0, 0], [3000, 0], behaviour=behaviour, speed=5),
            "b": ship([distance, 0], [distance - 3000, 0], speed=5)})  # fmt: skip
        advance(worlds, 5)
        assert bool(worlds["pilots"]["phase"][0, 1]) == heeds


# --- hostile ---------------------------------------------------------------------------------------------------------
@pytest.mark.parametrize("start", [(600, 400), (600, -400), (100, 500), (900, 60)])
def test_a_hostile_ship_crosses_ahead_of_the_own_ship_and_sails_on(start):
    boat = ship(start, (start[0] - 10, start[1]), behaviour="hostile", speed=7, **{"class": "boat"})
    worlds, _ = sea(own_velocity=(4.0, 0.0), **SLOW | {"simulation": {"dt": 0.1, "traffic_interval": 0.1}}, ships={"h": boat})
    eta = watch(worlds, 200, 0.5, "vessels.eta")[0][:, 0]
    ahead, abeam = eta[:, 1, 0] - eta[:, 0, 0], eta[:, 1, 1] - eta[:, 0, 1]
    crossings = np.flatnonzero(np.diff(np.sign(abeam)) != 0)
    assert len(crossings) >= 1
    assert 10.0 < ahead[crossings[0]] < 80.0  # it aims at 40 m ahead of the bow
    assert worlds["pilots"]["phase"][0, 1] == 3


# --- erratic ---------------------------------------------------------------------------------------------------------
def off_route(place, route):
    """Distance of places [.., 2] from a polyline."""
    best = np.full(place.shape[:-1], np.inf)
    for a, b in itertools.pairwise(route):
        along = np.clip(((place - a) @ (b - a)) / ((b - a) @ (b - a)), 0.0, 1.0)
        best = np.minimum(best, np.hypot(*np.moveaxis(place - a - along[..., None] * (b - a), -1, 0)))
    return best


@pytest.mark.parametrize(("wander", "interval"), [(60.0, 0.5), (20.0, 0.1), (150.0, 2.0)])
def test_an_erratic_boat_never_leaves_its_bound(wander, interval):
    route = np.array([[0.0, 0.0], [300.0, 0.0], [300.0, 200.0]])
    boat = ship(*route.tolist(), behaviour={"kind": "erratic", "wander": wander}, **{"class": "boat"}, speed=8.0)
    keys = SLOW | {"simulation": {"dt": 0.1, "traffic_interval": interval}}
    worlds, _ = sea(40, **keys, own_ship=FAR, ships={"b": boat})
    eta, speed = watch(worlds, 600, 2.0, "vessels.eta", "vessels.nu")
    eta, speed = eta[:, :, 1], speed[:, :, 1, 0]
    off = off_route(eta[..., :2], route)
    assert off.max() < wander
    assert off.max() > 0.8 * wander
    assert np.std(wrapped(eta[..., 2])) > 0.5
    assert np.std(speed, axis=0).min() > 0.5
    assert len({row.tobytes() for row in np.moveaxis(eta, 1, 0)}) == 40  # each seed its own whims
    again, _ = sea(40, **keys, own_ship=FAR, ships={"b": boat})
    assert watch(again, 600, 2.0, "vessels.eta")[0][:, :, 1].tobytes() == eta.tobytes()


# --- at run time -----------------------------------------------------------------------------------------------------
def test_commands_change_what_a_ship_does():
    keys = SLOW | {"own_ship": FAR, "ships": {"a": ship([0, 0], [900, 0], speed=5)}}
    worlds, names = sea(**keys)
    commands = Commands(worlds, 0, names, load_scenario(keys))
    commands.set_course("a", 90.0)
    commands.set_speed("a", 3.0)
    advance(worlds, 100)
    assert np.degrees(worlds["vessels"]["eta"][0, 1, 2]) == pytest.approx(90.0, abs=0.1)
    assert worlds["vessels"]["nu"][0, 1, 0] == 3.0
    commands.set_behaviour("a", {"kind": "colregs", "act_time": 77.0})
    assert worlds["vessels"]["behaviour"][0, 1] == BEHAVIOUR_COLREGS
    assert worlds["pilots"]["act_time"][0, 1] == 77.0
    assert worlds["pilots"]["alteration"][0, 1] == pytest.approx(30 * DEG)
    assert [notice.kind for notice in commands.notices()] == ["course_set", "speed_set", "behaviour_set"]
    for bad, message in (({"id": "a", "behaviour": "colreg"}, "did you mean 'colregs'"),
                         ({"id": "b", "behaviour": "colregs"}, "unknown id 'b'"),
                         ({"id": "a", "behaviour": {"kind": "hostile", "target": "x"}}, "unknown ship 'x'"),
                         ({"id": "own_ship", "behaviour": "colregs"}, "not possible with the own ship")):  # fmt: skip
        with pytest.raises(ConfigError, match=message):
            commands.apply("set_behaviour", bad)


@pytest.mark.parametrize(("behaviour", "message"), [
    ("colreg", r"ships\.a\.behaviour: .*did you mean 'colregs'"),
    ({"kind": "erratic", "wander": -1}, r"ships\.a\.behaviour\.wander: expected a number greater than 0, got -1"),
    ({"kind": "colregs", "act_tim": 1}, r"ships\.a\.behaviour\.act_tim: unknown key; did you mean 'act_time'"),
    ({"range": 3}, r"ships\.a\.behaviour: required key 'kind' is missing"),
    ({"kind": "hostile", "target": "b"}, r"ships\.a\.behaviour\.target: unknown ship 'b'"),
    (5, r"ships\.a\.behaviour: expected one of"),
])  # fmt: skip
def test_a_behaviour_that_cannot_be_is_one_clear_line(behaviour, message):
    with pytest.raises(ConfigError, match=message) as error:
        load_scenario({"ships": {"a": ship([0, 0], [1, 0], behaviour=behaviour)}})
    assert "\n" not in str(error.value)
