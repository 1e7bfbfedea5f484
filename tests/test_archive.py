"""The recorder and the archive: what was seen is what is read back, or an error says why not."""

import contextlib
import dataclasses
import io
import json
import time
import zipfile

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from synthetic import ANCHORED, BUOY, DRIFTING, DT, ICEBERG, METRES, ORIGIN, advance, episode, send, world

from usv_gym.replay import archive
from usv_gym.replay.archive import AIS_REPORT, DETECTION, ArchiveError, Episode, load, sample_dtype, save
from usv_gym.replay.recorder import Recorder
from usv_gym.scenarios.loader import load_scenario
from usv_gym.units import DEG, KNOT
from usv_gym.voyage import Mission, Voyage
from usv_gym.world import state


@pytest.fixture(scope="module")
def run():
    return episode()


def same(a, b):
    assert a.meta == {key: value for key, value in b.meta.items() if key not in ("format", "version")}
    assert a.events == b.events
    for field in dataclasses.fields(Episode):
        if field.name not in ("meta", "events"):
            x, y = getattr(a, field.name), getattr(b, field.name)
            assert x.dtype == y.dtype
            assert x.shape == y.shape
            assert x.tobytes() == y.tobytes(), field.name


# --- recorder --------------------------------------------------------------------------------------------------------
def test_states_are_kept_at_every_sample(run):
    assert len(run.t) == 601
    assert run.t == pytest.approx(np.arange(601) * DT)
    assert run.eta[:, 0, 0] == pytest.approx(5 * run.t)
    assert run.active[:, [0, 1, 2, ICEBERG, BUOY]].all()
    assert run.active.sum() == 5 * 601
    assert run.obstacle[-1, 0] == pytest.approx([DRIFTING[0] + 3, DRIFTING[1] + 6])
    assert run.distance[0, BUOY] == pytest.approx(np.hypot(*ANCHORED))
    assert run.radius[:2].tolist() == [15, 2]
    assert run.length[:3].tolist() == [10.9, 30, 8]
    assert run.actions.shape == (600, 2)
    assert run.visible[:, 0, BUOY].sum() == 601 - 200
    assert run.events == [{"t": 12.0, "kind": "waypoint", "id": 1, "text": "leg 1"}]


def test_meta_comes_from_the_record(run):
    assert run.meta["origin"] == list(ORIGIN)
    assert run.meta["metres_per_degree"] == list(METRES)
    assert run.meta["own"] == 0
    assert run.meta["mmsi"][1] == 257000001
    assert run.meta["kinds"][ICEBERG] == state.KIND_ICEBERG
    assert run.meta["waypoints"][1] == [[400, -100], [400, 500]]
    assert run.meta["sensors"]["radar"] == {"sensor": 1, "on": True, "range": 1852.0, "range_min": 0.0, "period": 2.5}
    assert run.meta["seed"] == 3
    assert set(run.meta["versions"]) == {"usv_gym", "python", "numpy", "numba"}
    assert run.name(2) == "Ørnen"
    assert run.name(5) == "source 5"


def test_detections_are_kept_when_the_picture_changes(run):
    assert len(run.detections) == 30
    assert run.detections["t"] == pytest.approx(np.arange(1, 31))
    assert run.detections["source"].tolist() == [1, ICEBERG] * 15
    first = run.detections[0]
    assert (first["id"], first["sensors"], first["motion_known"]) == (7, 2, True)
    assert (first["north"], first["east"]) == pytest.approx((401, -100 + 10 * KNOT + 2))
    assert (first["cov_nn"], first["cov_ne"], first["cov_ee"], first["var_radius"]) == (9, 1, 4, 4)
    assert first["var_cog"] == pytest.approx((2 * DEG) ** 2)


def test_messages_carry_the_truth_of_their_stamp(run):
    assert run.ais["source"].tolist() == [1, BUOY, 1, BUOY, 1, 2, BUOY]
    assert run.ais["received"].tolist() == [True, False, True, False, True, True, False]
    ship = run.ais[run.ais["source"] == 1]
    assert ship["t"] == pytest.approx([10, 20, 30])
    assert ship["north_true"] == pytest.approx([400] * 3)
    assert ship["east_true"] == pytest.approx(-100 + 10 * KNOT * ship["t"])
    assert ship["cog_true"] == pytest.approx([np.pi / 2] * 3)
    assert ship["sequence"].tolist() == [1, 2, 3]
    assert ship["mmsi"].tolist() == [257000001] * 3
    buoy = run.ais[run.ais["source"] == BUOY]
    assert buoy["north_true"] == pytest.approx([ANCHORED[0]] * 3)
    assert buoy["east_true"] == pytest.approx([ANCHORED[1]] * 3)
    assert np.isnan(buoy["heading_true"]).all()


def test_a_late_sample_finds_the_truth_all_the_same():
    w, recorder = world(), Recorder()
    recorder.sample(w)
    advance(w, 7)
    send(w, 1)
    send(w, 0)
    advance(w, 13)
    recorder.sample(w)
    ais = recorder.finish().ais
    assert ais["t"] == pytest.approx([0.35, 0.35])
    assert ais["north_true"] == pytest.approx(ais["north"])
    assert ais["east_true"] == pytest.approx(ais["east"])


def test_traffic_that_moves_lazily_has_its_own_time():
    """Between frames the record holds where traffic was at ``traffic_tick``; the truth at t is on the line onwards."""
    w, recorder = world(), Recorder()
    recorder.sample(w)
    for _ in range(10):
        before = w["vessels"]["eta"][0, 1].copy(), w["obstacles"]["position"].copy(), w["traffic_tick"][0]
        advance(w)
        if w["tick"][0] % 2:  # only every second tick is a frame
            w["vessels"]["eta"][0, 1], w["obstacles"]["position"], w["traffic_tick"] = before
        else:
            w["vessels"]["eta"][0, 1, 1] = -100 + 10 * KNOT * w["tick"][0] * DT
            w["obstacles"]["position"][0, 0] = np.add(DRIFTING, np.array([0.1, 0.2]) * w["tick"][0] * DT)
        recorder.sample(w)
    run = recorder.finish()
    assert run.position(1)[:, 1] == pytest.approx(-100 + 10 * KNOT * run.t)
    assert run.position(ICEBERG)[:, 0] == pytest.approx(DRIFTING[0] + 0.1 * run.t)
    assert run.velocity(ICEBERG) == pytest.approx(np.tile([0.1, 0.2], (11, 1)))
    assert run.position(0, [0.125])[0, 0] == pytest.approx(0.625)


def test_a_collision_becomes_an_event_once():
    w, recorder = world(), Recorder()
    for hit in (-1, ICEBERG, ICEBERG, -1):
        w["safety"]["collided_with"] = hit
        recorder.sample(w)
        advance(w)
    assert recorder.finish().events == [{"t": 0.05, "kind": "collision", "id": ICEBERG, "text": ""}]


def test_an_obstacle_that_appears_later_is_known():
    w, recorder = world(), Recorder()
    recorder.sample(w)
    advance(w)
    w["obstacles"]["active"][0, 5], w["obstacles"]["radius"][0, 5] = 1, 20
    w["obstacles"]["kind"][0, 5] = state.KIND_ICEBERG
    recorder.sample(w)
    run = recorder.finish()
    assert run.radius[5] == 20
    assert run.meta["kinds"][13] == state.KIND_ICEBERG
    assert run.active[:, 13].tolist() == [False, True]


def test_thrusters_of_the_own_ship():
    w, recorder = world(), Recorder()
    w["plants"]["command"][0, 0, 1] = 0.5, -0.25, 1
    w["plants"]["n"][0, 0, 1] = 1200
    recorder.sample(w)
    run = recorder.finish()
    assert run.command[0, 1].tolist() == [0.5, -0.25, 1]
    assert run.actuator[0, 1, 0] == 1200
    w["vessels"]["model"][0, 0] = state.MODEL_KINEMATIC
    recorder = Recorder()
    recorder.sample(w)
    assert np.isnan(recorder.finish().command).all()


def test_the_last_command_of_a_tick_is_kept():
    """A log with two rows of commands in every tick."""
    rows = np.random.default_rng(1).uniform(-0.5, 1.0, (12, 2, state.A, 3))
    voyage = Voyage(Mission(load_scenario("calm_crossing"), "log", rows=rows))
    while not voyage.outcome:
        voyage.step()
    np.testing.assert_array_equal(voyage.recorder.finish().command[1:], rows[:, -1])


def test_one_recorder_records_one_episode():
    w, recorder = world(), Recorder()
    with pytest.raises(ValueError, match="nothing was recorded"):
        recorder.finish()
    advance(w, 5)
    recorder.sample(w)
    recorder.sample(w)
    assert len(recorder.finish().t) == 1
    w["tick"] = 0
    with pytest.raises(ValueError, match="one episode"):
        recorder.sample(w)


def test_row_b_of_a_batch_is_that_world():
    w = np.concatenate([world(), world(), world()])
    w["vessels"]["eta"][2, 0] = 7, 8, 9
    recorder = Recorder()
    recorder.sample(w, 2)
    assert recorder.finish().eta[0, 0].tolist() == [7, 8, 9]


def test_a_sample_is_cheap():
    """Far above what it takes, so that a busy machine passes: a sample is some 25 copies."""
    w, recorder = world(), Recorder()
    recorder.sample(w)
    start = time.perf_counter()
    for _ in range(2000):
        w["tick"] += 1
        recorder.sample(w)
    assert (time.perf_counter() - start) / 2000 < 400e-6


# --- archive ---------------------------------------------------------------------------------------------------------
def test_round_trip(run, tmp_path):
    save(run, tmp_path / "episode.usv")
    same(run, load(tmp_path / "episode.usv"))


def test_equal_episodes_give_equal_bytes(run, tmp_path):
    save(run, tmp_path / "a.usv")
    save(load(tmp_path / "a.usv"), tmp_path / "b.usv")
    assert (tmp_path / "a.usv").read_bytes() == (tmp_path / "b.usv").read_bytes()


def test_meta_is_the_first_member_and_arrays_are_plain_npy(run, tmp_path):
    save(run, tmp_path / "a.usv")
    with zipfile.ZipFile(tmp_path / "a.usv") as z:
        assert z.namelist()[0] == "meta.json"
        assert json.loads(z.read("meta.json"))["format"] == "usv-episode"
        assert np.load(io.BytesIO(z.read("eta.npy"))).tobytes() == run.eta.tobytes()


@st.composite
def episodes(draw):
    V, M, T = draw(st.integers(1, 3)), draw(st.integers(0, 3)), draw(st.integers(1, 4))
    S = V + M

    def table(dtype, n):
        data = draw(st.binary(min_size=dtype.itemsize * n, max_size=dtype.itemsize * n))
        rows = np.frombuffer(data, dtype, n).copy()
        for name in dtype.names:
            if rows.dtype[name].base.kind == "b":  # any byte is not a bool
                rows[name] = rows[name].view(np.uint8) & 1
        return rows

    sampled = table(sample_dtype(V, M), T)
    sampled["t"] = np.cumsum(draw(hnp.arrays(float, T, elements=st.floats(1e-3, 1e3))))
    tables = {
        "detections": table(DETECTION, draw(st.integers(0, 3))),
        "ais": table(AIS_REPORT, draw(st.integers(0, 3))),
    }
    for rows in tables.values():
        rows["source"] = np.arange(len(rows)) % S
    text = st.text(max_size=8)
    meta = draw(st.dictionaries(text, st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False,
                allow_infinity=False) | text | st.lists(text, max_size=2), max_size=4))  # fmt: skip
    meta = {key: value for key, value in meta.items() if key not in ("format", "version")}
    meta |= {"own": 0, "models": [0] * V, "kinds": [0] * S, "mmsi": [0] * S, "ais_class": [0] * S}
    return Episode(
        meta=meta,
        events=draw(st.lists(st.fixed_dictionaries({"t": st.floats(0, 1e6), "text": text}), max_size=2)),
        **{name: np.ascontiguousarray(sampled[name]) for name in sampled.dtype.names},
        radius=np.zeros(M), length=np.zeros(V), beam=np.zeros(V), **tables,
        actions=draw(hnp.arrays(st.sampled_from([np.float32, np.float64, np.int64]), hnp.array_shapes(max_dims=3))),
    )  # fmt: skip


@settings(max_examples=40, deadline=None, suppress_health_check=list(HealthCheck))
@given(episodes())
def test_round_trip_of_any_bits(tmp_path_factory, any_episode):
    path = tmp_path_factory.mktemp("any") / "e.usv"
    save(any_episode, path)
    same(any_episode, load(path))


def test_meta_may_hold_what_json_cannot(run, tmp_path):
    meta = {**run.meta, "outcome": {"score": np.float32(0.5), "cpa": float("inf"), "path": tmp_path, "n": np.arange(2)}}
    save(dataclasses.replace(run, meta=meta), tmp_path / "e.usv")
    outcome = load(tmp_path / "e.usv").meta["outcome"]
    assert outcome == {"score": 0.5, "cpa": None, "path": str(tmp_path), "n": [0, 1]}


def test_errors_name_the_file_and_the_reason(run, tmp_path):
    path = tmp_path / "e.usv"
    with pytest.raises(FileNotFoundError):
        load(path)
    for data in (b"", b"not a zip", b"PK\x05\x06" + bytes(18)):
        path.write_bytes(data)
        with pytest.raises(ArchiveError, match=r"e\.usv: not an episode archive, or a broken one"):
            load(path)
    save(run, path)
    whole = path.read_bytes()
    path.write_bytes(whole[: len(whole) // 2])
    with pytest.raises(ArchiveError, match="broken"):
        load(path)


def rewritten(path, name, data):
    """The archive with one member replaced, or left out when ``data`` is None."""
    with zipfile.ZipFile(path) as z:
        members = {n: z.read(n) for n in z.namelist()}
    members[name] = data
    with zipfile.ZipFile(path, "w") as z:
        for n, content in members.items():
            if content is not None:
                z.writestr(n, content)


def npy(array):
    buffer = io.BytesIO()
    np.save(buffer, array)
    return buffer.getvalue()


@pytest.mark.parametrize(
    ("member", "data", "reason"),
    [
        ("meta.json", b'{"format": "usv-episode", "version": 2}', "version 2; this usv_gym reads up to 1"),
        ("meta.json", b'{"format": "other"}', "the format is 'other'"),
        ("meta.json", b"[]", "broken"),
        ("eta.npy", None, r"eta\.npy"),
        ("eta.npy", npy(np.zeros((601, 8, 2))), "eta must be"),
        ("nu.npy", npy(np.zeros((601, 8, 3), np.float32)), "nu must be"),
        ("t.npy", npy(np.zeros(601)), "increase"),
        ("actions.npy", npy(np.array([{}])), "broken"),
    ],
)
def test_a_wrong_member_is_told(run, tmp_path, member, data, reason):
    path = tmp_path / "e.usv"
    save(run, path)
    rewritten(path, member, data)
    with pytest.raises(ArchiveError, match=reason):
        load(path)


@settings(max_examples=60, deadline=None, suppress_health_check=list(HealthCheck))
@given(st.floats(0, 1, exclude_max=True), st.integers(1, 255))
def test_a_flipped_byte_is_an_archive_error_or_changes_nothing(tmp_path_factory, where, flip):
    w, recorder = world(), Recorder()
    recorder.sample(w)
    run = recorder.finish()
    path = tmp_path_factory.mktemp("flip") / "e.usv"
    save(run, path)
    data = bytearray(path.read_bytes())
    data[int(where * len(data))] ^= flip
    path.write_bytes(data)
    with contextlib.suppress(ArchiveError):
        same(run, load(path))


def test_a_failure_leaves_no_file_and_keeps_the_old_one(run, tmp_path, monkeypatch):
    path = tmp_path / "e.usv"
    broken = dataclasses.replace(run, actions=np.array([{}]))
    with pytest.raises(ArchiveError, match="actions"):
        save(broken, path)
    assert list(tmp_path.iterdir()) == []
    save(run, path)
    before = path.read_bytes()
    calls = []

    def fail(z, name, data):
        calls.append(name)
        if name == "nu.npy":
            raise OSError("disk full")
        z.writestr(name, data)

    monkeypatch.setattr(archive, "_write", fail)
    with pytest.raises(OSError, match="disk full"):
        save(run, path)
    assert "eta.npy" in calls
    assert list(tmp_path.iterdir()) == [path]
    assert path.read_bytes() == before


def test_sources_that_do_not_exist_are_refused(run, tmp_path):
    rows = run.ais.copy()
    rows["source"][0] = 24
    with pytest.raises(ArchiveError, match="sources"):
        save(dataclasses.replace(run, ais=rows), tmp_path / "e.usv")


def test_an_exception_while_writing_leaves_nothing_and_goes_on(tmp_path):
    with pytest.raises(ZeroDivisionError), archive.replacing(tmp_path / "x"):
        raise ZeroDivisionError
    assert list(tmp_path.iterdir()) == []
