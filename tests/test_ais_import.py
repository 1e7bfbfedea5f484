"""AIS history becomes a scenario: readers on real files, cleaning against truth, replay against what was reported."""

from __future__ import annotations

import gzip
import json
import math
import subprocess
import sys
import textwrap
import zipfile
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from typer.testing import CliRunner

from usv_gym.cli import app, main
from usv_gym.config import ConfigError
from usv_gym.engine import advance_worlds, reset_worlds
from usv_gym.run import plan, resimulate, run
from usv_gym.scenarios.ais_import import clean
from usv_gym.scenarios.ais_import.csv_files import read_csv
from usv_gym.scenarios.ais_import.fixes import Harvest, Selection
from usv_gym.scenarios.ais_import.nmea_logs import read_nmea, time_of_fix
from usv_gym.scenarios.ais_import.request import parse_area, parse_duration, parse_start
from usv_gym.scenarios.ais_import.scene import Request, file_texts, import_ais
from usv_gym.scenarios.build import build_worlds, track_pool
from usv_gym.scenarios.loader import load_scenario
from usv_gym.units import KNOT
from usv_gym.world.land import NO_LAND
from usv_gym.world.lanes import lanes_for

EVERYWHERE = Selection(0.0, 0.0, 3e7)
NO_ROWS = np.zeros((0, 0, 4, 3))
CHANNEL, CHANNEL_NMEA = "ais/channel_20110726_dma.csv", "nmea/channel_20110726_1100-1300_tagblock.nmea"
SOLENT, HARLINGEN = "ais/solent_20160112_noaa.csv", "nmea/harlingen_gofree_20140416.log"
ELEVEN = parse_start("2011-07-26T11:00")


def harvest(path: Path, selection=EVERYWHERE) -> Harvest:
    found = Harvest(selection)
    (read_csv if path.suffix == ".csv" else read_nmea)(path, found)
    return found


# --- readers ---------------------------------------------------------------------------------------------------------
@pytest.mark.parametrize(("name", "lines", "fixes", "ships", "odd"), [
    (CHANNEL, 7181, 7180, 43, {}),
    (SOLENT, 17861, 17860, 75, {}),
    ("ais/dma_aisdk_original_rows_20180208.csv", 11, 10, 10, {}),
    ("ais/noaa_marinecadastre_original_1000rows_20230111.csv", 1001, 998, 998, {"rows of stations that are no ships": 2}),
    (CHANNEL_NMEA, 3854, 3605, 32, {}),
    ("nmea/dma_aislib_stream_20100611.txt", 8551, 2928, 1380, {
        "position reports of stations that are no ships": 23, "fixes without a position": 11,
        "AIS sentences with a field too many or too few": 2, "AIS sentences with a wrong checksum": 2}),
    (HARLINGEN, 6324, 1297, 161, {
        "AIS sentences with a field too many or too few": 1507, "sentences that are no NMEA 0183": 142,
        "position reports of stations that are no ships": 25}),
])  # fmt: skip
def test_real_files_are_read_and_what_is_strange_in_them_is_counted(data, name, lines, fixes, ships, odd):
    found = harvest(data / name)
    assert (found.lines, found.fixes, len(found.ships)) == (lines, fixes, ships)
    assert dict(found.odd) == odd


def test_the_log_of_a_yacht_gives_time_and_place_of_the_yacht(data):
    found = harvest(data / HARLINGEN)
    own = found.own.table()
    assert len(own) == 142
    assert own[0, :3] == pytest.approx([parse_start("2014-04-16T19:57:19"), 53 + 10.8115 / 60, 5 + 25.7025 / 60])


@pytest.mark.parametrize(("received", "second", "fix"), [
    (100.0, 38, 98.0),  # two seconds late
    (100.0, 42, 102.0),  # the receiver's clock is behind
    (121.0, 58, 118.0),
    (100.0, 10, 100.0),  # half a minute apart: not believed
    (100.0, 60, 100.0),  # not available
])
def test_the_second_of_a_report_is_the_time_of_its_fix(received, second, fix):
    assert time_of_fix(received, second) == fix


def test_particulars_reach_the_ships_and_packed_files_are_read(data, tmp_path):
    text = (data / CHANNEL).read_bytes()
    (tmp_path / "a.csv.gz").write_bytes(gzip.compress(text))
    with zipfile.ZipFile(tmp_path / "a.csv.zip", "w") as archive:
        archive.writestr("a.csv", text)
    for name in ("a.csv.gz", "a.csv.zip"):
        found = Harvest(EVERYWHERE)
        read_csv(tmp_path / name, found)
        about = found.particulars[565497000]
        assert (about.name, about.length, about.beam, about.ais_class) == ("MAERSK VISUAL", 225.0, 37.0, "A")


# --- cleaning --------------------------------------------------------------------------------------------------------
def turning_ship(seed, *, jitter=1.0, n=200, step=6.0):
    """Truth at the times told, and fixes of a ship at 8 m/s that turns; the clock is off by up to ``jitter`` seconds."""
    generator = np.random.default_rng(seed)
    told = step * np.arange(n, dtype=float)
    t = told + generator.uniform(-jitter, jitter, n)

    def place(t):
        phase = 2 * np.pi * t / 1500.0
        return np.column_stack([4000 * np.sin(phase / 2), 2000 * (1 - np.cos(phase))])

    v = (place(t + 0.5) - place(t - 0.5)) + generator.normal(0, 0.05, (n, 2))
    x = place(t) + generator.normal(0, 3.0, (n, 2))
    return place(told), np.column_stack([told, x, v, np.full(n, np.nan)])


@pytest.mark.parametrize("seed", range(3))
def test_smoothing_undoes_what_a_bad_clock_does(seed):
    truth, fixes = turning_ship(seed)
    x, v = clean.smooth(fixes)
    raw = np.hypot(*(fixes[:, 1:3] - truth).T)
    smooth = np.hypot(*(x - truth).T)
    assert np.sqrt(np.mean(smooth**2)) < 0.55 * np.sqrt(np.mean(raw**2))
    jumpy = np.linalg.norm(np.diff(fixes[:, 1:3], axis=0), axis=1) / 6.0  # speeds between raw fixes
    speed = np.hypot(*v.T)
    assert np.abs(np.diff(speed)).max() < 0.3 * np.abs(np.diff(jumpy)).max()


def test_the_smoother_is_the_textbook_one():
    """Against filterpy's Rauch-Tung-Striebel smoother with the same model."""
    from filterpy.kalman import KalmanFilter

    _, fixes = turning_ship(5, n=60)
    fixes = np.delete(fixes, [7, 8, 30], axis=0)
    x, v = clean.smooth(fixes)
    speed = np.hypot(fixes[:, 3], fixes[:, 4])
    q = clean.ACCELERATION
    for axis in (0, 1):
        kalman = KalmanFilter(dim_x=2, dim_z=2)
        kalman.x, kalman.P, kalman.H = np.array([fixes[0, 1 + axis], fixes[0, 3 + axis]]), np.diag([1e4, 100.0]), np.eye(2)
        xs, ps, fs, qs = [], [], [], []
        for i, fix in enumerate(fixes):
            dt = fix[0] - fixes[max(i - 1, 0), 0]
            f = np.array([[1.0, dt], [0.0, 1.0]])
            noise = q * np.array([[dt**3 / 3, dt**2 / 2], [dt**2 / 2, dt]])
            kalman.predict(F=f, Q=noise)
            r = np.diag([clean.POSITION_STD**2 + (speed[i] * clean.TIME_STD) ** 2,
                         clean.SPEED_STD**2 + (speed[i] * clean.COURSE_STD) ** 2])  # fmt: skip
            kalman.update(np.array([fix[1 + axis], fix[3 + axis]]), R=r)
            xs.append(kalman.x.copy())
            ps.append(kalman.P.copy())
            fs.append(f)
            qs.append(noise)
        smooth, *_ = kalman.rts_smoother(np.array(xs), np.array(ps), Fs=fs, Qs=qs)
        assert x[:, axis] == pytest.approx(smooth[:, 0], abs=1e-6)
        assert v[:, axis] == pytest.approx(smooth[:, 1], abs=1e-6)


def test_wild_fixes_and_a_second_ship_with_the_same_number_are_told_apart():
    _, fixes = turning_ship(1, n=50)
    other = fixes.copy()
    other[:, 1] += 30_000.0
    other[:, 0] += 2.0
    wild = fixes[20:21].copy()
    wild[:, 2] += 90_000.0
    wild[:, 0] += 1.0
    mixed = np.vstack([fixes, other, wild, fixes[10:11]])  # and one fix twice
    found = clean.chains(mixed[np.argsort(mixed[:, 0], kind="stable")])
    assert sorted(map(len, found)) == [1, 50, 50]
    assert any(np.array_equal(chain, fixes, equal_nan=True) for chain in found)
    assert any(np.array_equal(chain, other, equal_nan=True) for chain in found)


def test_a_receiver_gone_mad_costs_time_in_proportion_to_its_reports():
    draw = np.random.default_rng(0)
    n = 20_000
    fixes = np.column_stack([np.arange(n), draw.uniform(-1e7, 1e7, (n, 2)), np.zeros((n, 3))])
    assert len(clean.chains(fixes)) > n // 2


def test_a_gap_makes_two_parts_between_which_the_ship_is_not_seen():
    _, fixes = turning_ship(2, n=300)
    fixes = np.delete(fixes, slice(100, 200), axis=0)
    first, second = clean.stretches(fixes)
    assert len(first) == len(second) == 100
    track = clean.Track(tuple(np.column_stack([p[:, 0], p[:, 1:3], np.zeros((len(p), 3))]) for p in (first, second)))
    assert np.isnan(clean.at_times(track, np.array([900.0]))).all()
    assert np.isfinite(clean.at_times(track, np.array([300.0]))).all()


@settings(max_examples=30, deadline=None)
@given(seed=st.integers(0, 10_000), tolerance=st.floats(0.5, 50.0), n=st.integers(2, 150))
def test_thinning_keeps_the_ship_within_the_tolerance(seed, tolerance, n):
    _, fixes = turning_ship(seed, n=n)
    x, v = clean.smooth(fixes)
    t, psi = fixes[:, 0], np.arctan2(v[:, 1], v[:, 0])
    keep = clean.thin(t, x, v, psi, tolerance)
    assert keep[0] == 0
    assert keep[-1] == n - 1
    knots = np.column_stack([t, x, psi, np.hypot(*v.T), psi])[keep]
    off = np.hypot(*(clean.at_times(clean.Track((knots,)), t) - x).T)
    assert off.max() <= tolerance + 1e-6


def test_a_moored_ship_keeps_its_heading_and_needs_two_knots():
    t = 180.0 * np.arange(20)
    table = np.column_stack([t, np.full(20, 50.8), np.full(20, -1.1), np.zeros(20), np.full(20, np.nan), np.full(20, 87.0)])
    (track,), left_out = clean.clean(table, Selection(50.8, -1.1, 1000.0))
    assert left_out == 0
    assert track.knots == 2
    assert np.degrees(track.parts[0][:, 5]) == pytest.approx(87.0)


# --- real traffic, replayed ------------------------------------------------------------------------------------------
def request(data, name, area, start=None, duration=1800.0, **keys):
    return Request([data / name], parse_area(area), start, duration, **keys)


def sailed(whole, seconds):
    """Positions of all ships of a scenario at every second [T, ships, 2], NaN where one is not seen, through the kernel.

    Seven ships to a world: a capacity that other tests compile for too.
    """
    names = list(whole["ships"])
    out = np.full((seconds + 1, len(names), 2), np.nan)
    for first in range(0, len(names), 7):
        some = names[first : first + 7]
        scenario = load_scenario({**whole, "ships": {name: whole["ships"][name] for name in some},
                                  "own_ship": {"position": [0.0, 0.0], "ais": "off"},
                                  "simulation": {"dt": 0.05, "traffic_interval": 1.0}})  # fmt: skip
        worlds, _ = build_worlds(scenario, capacity=(8, 16))
        worlds["sensors"]["exteroceptive"] = 0
        tracks = track_pool(scenario)
        reset_worlds(worlds, NO_LAND, tracks, np.ones(1, bool))
        slots = slice(1, 1 + len(some))
        for t in range(seconds + 1):
            if t:
                advance_worlds(worlds, lanes_for(worlds), NO_LAND, tracks, 20, NO_ROWS)
            v = worlds["vessels"][0]
            there = v["active"][slots] != 0
            out[t, first : first + 7][there] = v["eta"][slots, :2][there]
    return out


@pytest.mark.parametrize(("name", "area", "start", "duration", "least"), [
    (SOLENT, "portsmouth", "2016-01-12T13:10", 1800, 50),
    (CHANNEL, "english-channel", "2011-07-26T11:00", 3600, 20),
])  # fmt: skip
def test_replayed_ships_are_where_they_reported_to_be(data, name, area, start, duration, least):
    start = parse_start(start)
    imported = import_ais(request(data, name, area, start, duration))
    names = list(imported.scenario["ships"])
    assert len(names) >= least
    positions = sailed(imported.whole(), duration)
    every = harvest(data / name, replace(parse_area(area), start=start, end=start + duration))
    off, missed = [], 0
    for k, ship in enumerate(names):
        fixes = clean.to_local(every.ships[imported.scenario["ships"][ship]["mmsi"]].table(), parse_area(area))
        seconds = np.rint(fixes[:, 0] - start).astype(int)
        d = np.hypot(*(positions[seconds, k] - fixes[:, 1:3]).T)
        off.append(d[np.isfinite(d)])
        missed += int(np.isnan(d).sum())
    off = np.concatenate(off)
    assert np.percentile(off, 95) < 15.0
    assert missed < 0.02 * len(off)  # single reports after a gap, and the last one of each track
    steps = np.linalg.norm(np.diff(positions, axis=0), axis=2)
    assert np.nanmax(steps) < 40.0 * KNOT  # nobody jumps, which they do between the raw fixes


def test_the_log_and_the_table_of_the_channel_tell_of_the_same_ships(data):
    of = [import_ais(request(data, name, "english-channel", ELEVEN, 7200.0)) for name in (CHANNEL, CHANNEL_NMEA)]
    table, log = ({ship["mmsi"]: name for name, ship in i.scenario["ships"].items()} for i in of)
    assert table.keys() == log.keys()
    assert len(table) == 28
    off = []
    for mmsi, name in table.items():
        a, b = (clean.Track(tuple(_knots(part) for part in i.tracks[n])) for i, n in zip(of, (name, log[mmsi]), strict=True))
        t = np.arange(0.0, 7200.0, 10.0)
        d = np.hypot(*(clean.at_times(a, t) - clean.at_times(b, t)).T)
        off.append(d[np.isfinite(d)])
    # the times of the table are good to 2 s: 20 m at 20 kn; the log is stamped with the second of each fix
    assert np.percentile(np.concatenate(off), 95) < 20.0


def _knots(part):
    rows = np.array(part)
    return np.column_stack([rows[:, :3], np.radians(rows[:, 3]), rows[:, 4], np.radians(rows[:, 5])])


def test_the_own_ship_sails_from_where_the_yacht_was_along_its_track(data):
    asked = request(data, CHANNEL, "english-channel", ELEVEN, 3600.0, own=str(data / "ais/channel_20110726_ownship.csv"))
    own = import_ais(asked).scenario["own_ship"]
    found = Harvest(asked.area)
    from usv_gym.scenarios.ais_import.csv_files import read_own

    read_own(Path(asked.own), found)
    fixes = clean.to_local(found.own.table(), asked.area)
    at = {int(t - ELEVEN): (n, e) for t, n, e in fixes[:, :3]}
    assert math.dist(own["position"], at[0]) < 15.0
    assert 0.5 < own["speed"] < 4.0
    assert 2 <= len(own["route"]) <= 31
    assert math.dist(own["route"][-1], at[max(t for t in at if t <= 3600)]) < 70.0
    line = np.vstack([own["position"], own["route"]])
    for place in [at[t] for t in range(0, 3600, 100) if t in at]:  # and nowhere far from it
        leg, rel = np.diff(line, axis=0), np.array(place) - line[:-1]
        share = np.clip((leg * rel).sum(1) / (leg**2).sum(1), 0, 1)
        assert np.linalg.norm(rel - share[:, None] * leg, axis=1).min() < 60.0
    log = import_ais(request(data, HARLINGEN, "harlingen", None, 120.0, own="log"))
    assert log.scenario["own_ship"]["speed"] < 0.5


# --- from the command line to an episode ------------------------------------------------------------------------------
def small_history(path: Path, *, header="# Timestamp,Type of mobile,MMSI,Latitude,Longitude,SOG,COG,Heading,Name,Width,Length"):
    """Two ships near 57 N 11 E for ten minutes, and one far off."""
    lines = [header]
    for k in range(60):
        t = f"08/02/2018 10:{k // 6:02d}:{k % 6 * 10:02d}"
        lines.append(f"{t},Class A,265177000,{57.0 + k * 4.5e-4:.6f},11.0,9.7,0.0,0,STENA GERMANICA,32,240")
        lines.append(f"{t},Class B,265550210,57.01,{11.02 - k * 4e-4:.6f},4.7,270.0,511,,4,12")
        lines.append(f"{t},Class A,219000001,55.0,{12.0 + k * 1e-4:.6f},1.2,90.0,90,FAR AWAY,10,60")
    path.write_text("\n".join(lines) + "\n")
    return path


def test_a_scenario_is_written_runs_and_replays_bit_for_bit(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    small_history(tmp_path / "dk.csv")
    words = "dk.csv --area 57.01,11,4km --duration 60 --own 265550210 --handover 300 --behaviour colregs -o sub/kattegat.yaml"
    result = CliRunner().invoke(app, ["import-ais", *words.split()])
    assert result.exit_code == 0, result.output
    assert "181 lines, 180 position reports of ships" in result.output
    assert sorted(p.name for p in (tmp_path / "sub").iterdir()) == ["kattegat.tracks.csv", "kattegat.yaml"]
    scenario = load_scenario("sub/kattegat.yaml")
    assert list(scenario.ships) == ["stena_germanica"]
    ship = scenario.ships["stena_germanica"]
    assert (ship.mmsi, ship.length, ship.ais_class, ship.behaviour.kind) == (265177000, 240.0, "A", "colregs")
    assert scenario.own_ship.mmsi == 265550210
    assert scenario.simulation.epoch.isoformat() == "2018-02-08T10:00:00+00:00"
    episode = run(plan("sub/kattegat.yaml", policy="waypoints", overrides=["simulation.duration=40"]))
    assert set(episode.ais["mmsi"]) == {265177000, 265550210}  # and the own ship, under its real number
    assert np.isfinite(episode.position(1)).all()
    # the archive alone is enough to sail it again
    (tmp_path / "sub" / "kattegat.tracks.csv").unlink()
    again = resimulate(episode)
    assert again.eta.tobytes() == episode.eta.tobytes()
    assert again.detections.tobytes() == episode.detections.tobytes()


def test_the_same_files_give_the_same_scenario(tmp_path):
    asked = Request([small_history(tmp_path / "dk.csv")], parse_area("57.01,11.01,4km"), None, 300.0)
    texts = [file_texts(import_ais(asked), tmp_path / "a.yaml") for _ in range(2)]
    assert texts[0] == texts[1]


# --- streaming -------------------------------------------------------------------------------------------------------
def test_memory_follows_the_scene_and_not_the_file(tmp_path):
    """A file of 15 MB of which a hundredth lies in the area needs less than 12 MB on top of the interpreter."""
    rows = [f"{{t}},Class A,2190{k:05d},{55 + k * 0.01:.4f},{11 + k * 0.001:.4f},Under way using engine,0.0,10.0,90.0,90,"
            f"9000000,CALL,NAME {k},Cargo,,20,100,GPS,8.0,SOMEWHERE,,AIS" for k in range(200)]  # fmt: skip
    columns = ("# Timestamp,Type of mobile,MMSI,Latitude,Longitude,Navigational status,ROT,SOG,COG,Heading,IMO,Callsign,Name,"
               "Ship type,Cargo type,Width,Length,Position fixing device,Draught,Destination,ETA,Data source")  # fmt: skip
    with (tmp_path / "big.csv").open("w") as file:
        file.write(columns + "\n")
        for k in range(550):
            t = f"08/02/2018 {k // 360:02d}:{k // 6 % 60:02d}:{k % 6 * 10:02d}"
            file.write("\n".join(row.format(t=t) for row in rows) + "\n")
    assert (tmp_path / "big.csv").stat().st_size > 14e6
    code = """
        import resource, sys
        from pathlib import Path
        from usv_gym.scenarios.ais_import.scene import Request, import_ais
        from usv_gym.scenarios.ais_import.request import parse_area, parse_start
        peak = lambda: resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
        before = peak()
        imported = import_ais(Request([Path(sys.argv[1])], parse_area("55.5,11.05,1km"), parse_start("2018-02-08"), 7200.0))
        print(len(imported.scenario["ships"]), imported.harvest.fixes, peak() - before)
    """
    done = subprocess.run([sys.executable, "-c", textwrap.dedent(code), tmp_path / "big.csv"], check=True, capture_output=True,
                          text=True, cwd=Path(__file__).parent.parent)  # fmt: skip
    ships, fixes, grown = map(int, done.stdout.split())
    assert ships == 1
    assert fixes == 110_000
    assert grown < 12_000, f"{grown} kB"


# --- bad input -------------------------------------------------------------------------------------------------------
HEADER = "MMSI,BaseDateTime,LAT,LON,SOG,COG,Heading\n"
ROW = "265177000,2018-02-08T10:00:00,57.0,11.0,9.7,0.0,0\n"


@pytest.mark.parametrize(("text", "arguments", "message"), [
    ("MMSI,BaseDateTime,LATT,LON\n1,2,3,4\n", [], "a.csv:1: no column for latitude (called latitude or lat)"),
    ("MMSI,BaseDateTime,Latitud,LON\n1,2,3,4\n", [], "did you mean 'Latitud'?; the header has: MMSI"),
    ("a;b;c\n1;2;3\n", [], "a.csv:1: neither NMEA sentences nor a table of AIS: no columns for timestamp, mmsi"),
    (HEADER + "265177000,yesterday,57.0,11.0,9.7,0.0,0\n", [], "a.csv:2: column 'BaseDateTime': unreadable time 'yesterday'"),
    (HEADER + "265177000,2018-13-08T10:00:00,57.0,11.0,9.7,0.0,0\n", [], "unreadable time '2018-13-08T10:00:00'"),
    (HEADER, [], "no position reports of ships in 1 lines"),
    ("", [], "the first line has: nothing"),
    (HEADER + ROW, ["--area", "0,0,5km"], "no ships within 5000 m around 0, 0; the files hold fixes from 2018-02-08T10:00:00Z"),
    (HEADER + ROW, [], "no tracks within 5000 m around 57, 11: 1 ships reported only once"),
    (HEADER + ROW, ["--start", "2019-01-01"], "between 2019-01-01T00:00:00Z"),
    (HEADER + ROW, ["--start", "noon"], "--start noon: expected a date and time in UTC"),
    (HEADER + ROW, ["--duration", "long"], "--duration long: expected a time"),
    (HEADER + ROW, ["--area", "solnt"], "unknown place; did you mean 'solent'?"),
    (HEADER + ROW, ["--area", "57,11"], "expected LAT,LON,RADIUS"),
    (HEADER + ROW, ["--area", "97,11,5km"], "latitude within 89"),
    (HEADER + ROW, ["--own", "265177001"], "--own 265177001: no positions of it"),
    (HEADER + ROW, ["--own", "no.csv"], "no.csv: no such file"),
    (HEADER + ROW, ["--behaviour", "colregs"], "--behaviour colregs: is for ships that left their track"),
    (HEADER + ROW, ["--behaviour", "colreg", "--handover", "5"], "--behaviour colreg: unknown; did you mean 'colregs'?"),
    (HEADER + ROW, ["--vessel", "oddin"], "unknown vessel 'oddin'; did you mean 'odin'?"),
    (HEADER + ROW, ["-o", "out.json"], "--out out.json: expected a file that ends in .yaml"),
    ("\x00\x01\x02" * 99, [], "neither NMEA sentences nor a table of AIS"),
])  # fmt: skip
def test_bad_input_is_one_clear_line(tmp_path, monkeypatch, capsys, text, arguments, message):
    monkeypatch.chdir(tmp_path)
    Path("a.csv").write_text(text)
    given = {"--area": "57,11,5km", "-o": "out.yaml", **dict(zip(arguments[::2], arguments[1::2], strict=True))}
    monkeypatch.setattr(sys, "argv", ["usv-gym", "import-ais", "a.csv", *[part for pair in given.items() for part in pair]])
    with pytest.raises(SystemExit) as end:
        main()
    assert end.value.code == 2
    error = capsys.readouterr().err
    assert len(error.splitlines()) == 1
    assert message in error
    assert not list(tmp_path.glob("out*"))


def test_broken_archives_and_missing_files_are_said(tmp_path):
    area = parse_area("57,11,5km")
    (tmp_path / "a.zip").write_bytes(b"PK\x03\x04 not really")
    (tmp_path / "a.gz").write_bytes(b"\x1f\x8b\x08 not really")
    with zipfile.ZipFile(tmp_path / "two.zip", "w") as archive:
        archive.writestr("a.csv", "")
        archive.writestr("b.csv", "")
    for name, message in (("a.zip", "cannot be read"), ("a.gz", "cannot be read"), ("none.csv", "no such file"),
                          ("two.zip", "expected one file in the archive, found 2")):  # fmt: skip
        with pytest.raises(ConfigError, match=message):
            import_ais(Request([tmp_path / name], area))


def test_a_log_without_any_clock_is_said_to_be_one(data, tmp_path):
    lines = [line.split(b"\\")[-1] for line in (data / CHANNEL_NMEA).read_bytes().splitlines()]
    (tmp_path / "timeless.nmea").write_bytes(b"\n".join(lines))
    with pytest.raises(ConfigError, match=r"timeless.nmea: no time for its 3,6\d\d position reports: expected tag blocks"):
        import_ais(Request([tmp_path / "timeless.nmea"], parse_area("solent")))


def test_unreadable_rows_are_counted_and_not_fatal(tmp_path):
    path = small_history(tmp_path / "dk.csv")
    with path.open("a") as file:
        file.write("garbage\n08/02/2018 10:59:59,Class A,265177000,north,11\n,,,,,,,,\n")
    imported = import_ais(Request([path], parse_area("57.01,11.01,4km"), None, 300.0))
    assert imported.harvest.odd["unreadable rows"] == 3
    assert len(imported.scenario["ships"]) == 2


@pytest.mark.parametrize(("text", "seconds"), [("600", 600), ("30min", 1800), ("1.5h", 5400), ("90 s", 90)])
def test_durations(text, seconds):
    assert parse_duration(text) == seconds


def test_areas():
    assert parse_area("50.78,-1.11,3nm") == Selection(50.78, -1.11, 5556.0)
    assert parse_area("solent").radius == 12_000.0
    assert json.dumps(parse_area("-33,18,500").latitude) == "-33.0"
