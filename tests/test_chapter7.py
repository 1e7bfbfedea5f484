"""Chapter 7 of the thesis with numbers: what its figures 7.7 and 7.8 and its table 7.1 show, measured."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pyais
import pytest
from sensor_helpers import V, advance, check_error, rms, sea, watch

from usv_gym.run import plan, run, write_outputs
from usv_gym.scenarios.loader import load_scenario
from usv_gym.units import DEG, DEG_PER_MIN, KNOT
from usv_gym.world.state import AIS_CLASS_A, LIDAR, RADAR

ROTATION = 1.25  # s, of the radar
BIT_AIS, BIT_RADAR = 1, 2
REST = (149.0, -49.0)  # where thrust log a ends


# --- 7.4: the picture is worse far away ------------------------------------------------------------------------------
def test_position_error_grows_with_range_and_shrinks_inside_lidar_range():
    ranges = np.array([40.0, 95.0, 110.0, 250.0, 500.0, 1000.0, 1800.0])
    bearings = np.arange(len(ranges)) * 50 * DEG  # nothing hides anything
    places = np.stack([ranges * np.cos(bearings), ranges * np.sin(bearings)], axis=1)
    bergs = {f"berg_{i}": {"radius": 5, "position": place.tolist()} for i, place in enumerate(places)}
    worlds, _ = sea(100, obstacles=bergs)
    advance(worlds, 60.0)
    error = worlds["picture"]["position"][:, 0, V : V + len(ranges)] - places
    by_range = [rms(error[:, i]) for i in range(len(ranges))]
    # 200 numbers give an rms to 5 %; each range is about twice the last one
    assert all(far > 1.3 * near for near, far in itertools.pairwise(by_range)), by_range
    assert by_range[2] > 20.0 * by_range[1]  # 110 m is out of reach of the LiDAR, 95 m is not
    assert by_range[1] < 0.1
    assert 1.0 < by_range[2] < 3.0


# --- 7.4: the radar shadow of the research ship ----------------------------------------------------------------------
def spans(times, flags):
    """[first, last] time of every run of true flags."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], flags.astype(int), [0]])))
    return [[float(times[a]), float(times[b - 1])] for a, b in zip(edges[::2], edges[1::2], strict=True)]


class Scene:
    """300 s of the busy open sea in calm water from a boat at rest at the end of log a, sampled at every radar scan."""

    def __init__(self, obstacles=None):
        keys = load_scenario("busy_open_sea").dump()
        keys["weather"] = {}
        keys["own_ship"] |= {"position": list(REST), "route": []}
        if obstacles is not None:
            keys["obstacles"] = {name: berg for name, berg in keys["obstacles"].items() if name in obstacles}
        self.worlds, self.names = sea(**keys)
        self.visible, self.id, self.sensors, self.position, self.eta, self.filters, tick = (
            array[:, 0]
            for array in watch(self.worlds, 300.0, ROTATION, "tracks.visible", "picture.id", "picture.sensors",
                               "picture.position", "vessels.eta", "tracks.phase", "tick")
        )  # fmt: skip
        self.t = tick * 0.05
        assert np.allclose(self.eta[-1, 0, :2], REST)

    def hidden(self, name):
        return spans(self.t, self.visible[:, 0, RADAR - 1, self.names.index(name)] == 0)

    def gone(self, name):
        """When the TDM has no target after it had one, and the ids that it gave."""
        id = self.id[:, 0, self.names.index(name)]
        first = int(np.flatnonzero(id)[0]) if id.any() else len(id)
        return spans(self.t[first:], id[first:] == 0), [int(i) for i in dict.fromkeys(id[id > 0].tolist())]


@pytest.fixture(scope="module")
def scene():
    return Scene()


def test_icebergs_vanish_behind_the_research_ship_and_come_back():
    """The ship alone hides icebergs 10, 11 and 12 for 53-69, 89-105 and 212-227 s (to one scan and a second).

    That is, while all of the disc lies inside the bearings of the hull: half-width 15 m and, for 100 m x 16.7 m, projected.
    """
    alone = Scene(["Iceberg_10", "Iceberg_11", "Iceberg_12"])
    for name, begin, end in (("Iceberg_10", 53, 69), ("Iceberg_11", 89, 105), ("Iceberg_12", 212, 227)):
        assert alone.hidden(name) == [pytest.approx([begin, end], abs=ROTATION + 0.5)]
        # the TDM keeps a target for 2.5 rotations after its last scan, then drops it at a report; later a new one appears
        (gone,), ids = alone.gone(name)
        (hidden,) = alone.hidden(name)
        assert 2.5 * ROTATION - ROTATION < gone[0] - hidden[0] < 2.5 * ROTATION + 1.0 + ROTATION
        assert 0.0 <= gone[1] - hidden[1] < 1.0 + ROTATION
        assert len(ids) == 2


def test_shadows_add_up_in_the_whole_scene(scene):
    """Among all fourteen icebergs there is more in the way than the research ship."""
    assert scene.hidden("Iceberg_11") == [pytest.approx([89, 105], abs=ROTATION + 0.5)]
    # iceberg 2 covers all but the last half degree of iceberg 12, so the ship's bow hides it some 6 s sooner
    assert scene.hidden("Iceberg_12") == [pytest.approx([206, 227], abs=ROTATION + 0.5)]
    for name in ("Iceberg_11", "Iceberg_12"):
        assert len(scene.gone(name)[1]) == 2
    # iceberg 14, 88 m away, hides 103 to 122 deg for all the time, and iceberg 10 lies at 108 to 111 deg
    assert scene.hidden("Iceberg_10") == [[scene.t[0], scene.t[-1]]]
    assert scene.gone("Iceberg_10") == ([], [])
    # and the support vessel passes in front of iceberg 9
    assert scene.hidden("Iceberg_9") == [pytest.approx([25, 55], abs=ROTATION + 0.5)]
    always_seen = set(scene.names[V:]) - {"", *(f"Iceberg_{i}" for i in (9, 10, 11, 12))}
    assert all(scene.hidden(name) == [] for name in always_seen)


def test_a_ship_with_ais_stays_tracked_in_the_shadow(scene):
    """The research ship passes behind iceberg 14 twice: the radar loses it, AIS does not, and it stays the same target."""
    ship = scene.names.index("research_ship")
    assert len(scene.hidden("research_ship")) == 2
    assert scene.gone("research_ship") == ([], [int(scene.id[-1, 0, ship])])
    error = np.hypot(*(scene.position[:, 0, ship] - scene.eta[:, ship, :2]).T)
    for begin, end in scene.hidden("research_ship"):
        # its timeout and one report after the last scan the radar has left the picture
        within = (scene.t >= begin + 2.5 * ROTATION + 1.0) & (scene.t <= end)
        assert within.sum() > 5
        assert set(scene.sensors[within, 0, ship]) == {BIT_AIS}
        # an AIS fix is 4.5 m off (rms); the picture is up to 1 s old, in which the ship sails 5 m
        assert error[within].max() < 15.0
    seen = scene.visible[:, 0, RADAR - 1, ship] == 1
    assert (scene.sensors[seen, 0, ship] & BIT_RADAR).mean() > 0.9
    assert not scene.visible[:, 0, LIDAR - 1, ship].any()


# --- 7.5: what AIS says ----------------------------------------------------------------------------------------------
@pytest.mark.parametrize("quantised", [False, True])
def test_ais_errors_have_the_variances_of_the_thesis(quantised):
    """Variances in all, as the thesis's Listing B.3 adds up, and the bias forgets with exp(-t / T).

    At 30 kn the speed never comes near its floor at 0.
    """
    speed, course, interval = 30 * KNOT, 40 * DEG, 2.0
    along = np.array([math.cos(course), math.sin(course)])
    ferry = {"length": 100, "speed_kn": 30, "ais": "A", "after_last": "continue",
             "waypoints": [[500, 0], (np.array([500, 0]) + 20_000 * along).tolist()]}  # fmt: skip
    worlds, _ = sea(64, ships={"ferry": ferry}, sensors={"base": "thesis", "ais": {"quantised": quantised}})
    fields = ("stamp_us", "position", "cog", "heading", "sog", "rot")
    stamp, position, cog, heading, sog, rot = (
        array[:, :, 1] for array in watch(worlds, 600.0, interval, *(f"ais.{name}" for name in fields))
    )
    assert np.all(np.diff(stamp, axis=0) == interval * 1e6)  # every message once
    place = position - np.array([500.0, 0.0]) - speed * stamp[..., None] * 1e-6 * along
    east_step = worlds["metres_per_degree"][0, 1] / 600_000
    north_step = worlds["metres_per_degree"][0, 0] / 600_000
    for errors, variance, density, bias_time, step in (
        (place[..., 0], 5.0, 0.5, 20.0, north_step),
        (place[..., 1], 5.0, 0.5, 20.0, east_step),
        ((cog - course) / DEG, 1.0, 0.5, 10.0, 0.1),
        ((heading - course) / DEG, 1.0, 0.5, 10.0, 1.0),
        ((sog - speed) / KNOT, 0.5, 0.1, 10.0, 0.1),
        (rot / DEG_PER_MIN, 2000.0, 500.0, 10.0, 0.0),  # the step of the code is 3 % of the spread, and varies
    ):
        stationary = density * bias_time / 2.0
        white = variance + (step**2 / 12.0 if quantised else 0.0)
        check_error(errors, math.sqrt(white), math.sqrt(stationary), math.exp(-interval / bias_time), lags=(0, 1, 2, 5))
    total = {"position": 10.0, "cog": 3.5, "sog": 1.0, "rot": 4500.0}
    found = {"position": np.mean(place**2), "cog": np.var(cog / DEG), "sog": np.var(sog / KNOT),
             "rot": np.var(rot / DEG_PER_MIN)}  # fmt: skip
    # 19200 messages, of which the bias leaves some 4000 independent ones
    assert found == pytest.approx(total, rel=0.1)


def read_sentences(path):
    """Messages of a file with a TAG block before each sentence."""
    parts = []
    for line in path.read_text().splitlines():
        sentence = line.rsplit("\\", 1)[1]
        parts.append(sentence)
        _, count, number, *_ = sentence.split(",")
        if number == count:
            yield pyais.decode(*parts), parts[0][:6]
            parts = []


def test_every_sentence_of_a_run_decodes_to_what_was_reported(tmp_path):
    episode = run(plan("busy_open_sea", policy="avoid", overrides=["simulation.duration=120"], seed=7))
    assert episode.t[-1] == 120.0
    write_outputs(episode, tmp_path, picture=False)
    messages = list(read_sentences(tmp_path / "ais.nmea"))
    reports = [(m, start) for m, start in messages if m.msg_type == 1]
    assert len(reports) == len(episode.ais) == 3 * 60  # three class A stations, every 2 s
    assert sorted(m.mmsi for m, _ in messages if m.msg_type != 1) == sorted(set(episode.ais["mmsi"].tolist()))
    latitude0, longitude0 = episode.meta["origin"]
    north_scale, east_scale = episode.meta["metres_per_degree"]
    resolution = 1 / 600_000 + 1e-6  # and pyais rounds to six decimals
    for (m, start), row in zip(reports, episode.ais, strict=True):
        assert start == ("!AIVDO" if row["source"] == episode.own else "!AIVDM")
        assert row["ais_class"] == AIS_CLASS_A
        assert m.mmsi == row["mmsi"]
        assert m.lat == pytest.approx(latitude0 + row["north"] / north_scale, abs=resolution / 2)
        assert m.lon == pytest.approx(longitude0 + row["east"] / east_scale, abs=resolution / 2)
        assert m.speed == pytest.approx(row["sog"] / KNOT, abs=0.05)
        assert (m.course - row["cog"] / DEG + 180) % 360 - 180 == pytest.approx(0, abs=0.05)
        assert (m.heading - row["heading"] / DEG + 180) % 360 - 180 == pytest.approx(0, abs=0.5)
        assert m.turn == pytest.approx(row["rot"] / DEG_PER_MIN, abs=0.5)  # pyais rounds to whole degrees per minute
        assert m.second == int(episode.meta["epoch_us"] // 1_000_000 + row["t"]) % 60
