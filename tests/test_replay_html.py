"""The 3-D replay: small, self-contained, true to the episode, and alive in a browser."""

import base64
import dataclasses
import functools
import hashlib
import io
import json
import math
import re
import threading
import urllib.error
import urllib.request
from pathlib import Path

import numpy as np
import pytest
from browser import Browser, chromium
from synthetic import NAMES, advance, send, world
from typer.testing import CliRunner

from usv_gym.cli import app
from usv_gym.replay import html
from usv_gym.replay.archive import sample_dtype, save
from usv_gym.replay.html import QUANTUM, pack, unpack, write_replay
from usv_gym.replay.recorder import Recorder

SECONDS = 1200
#: one island with a lake, as an archive has it
LAND = [[[[400.12, -900], [700, -900], [700, 900], [400, 900]], [[500, 0], [550, 50], [500, 90]]]]
VIEWER = Path(__file__).parents[1] / "viewer"


@functools.cache
def episode(seconds=SECONDS):
    """A quarter of an hour and more among 3 ships and 16 icebergs, all of them detected every second, with noise."""
    rng = np.random.default_rng(5)
    w, recorder = world(), Recorder()
    m, p = w["obstacles"][0], w["picture"][0]
    m["active"], m["kind"], m["radius"] = 1, np.arange(16) % 5 + 10, rng.uniform(5, 25, 16)
    m["position"] = rng.uniform(-1500, 1500, (16, 2))
    m["position"][0] = 900, 60
    m["velocity"] = rng.normal(0, 0.2, (16, 2))
    w["routes"]["count"][0, 0], w["routes"]["radius"][0, 0] = 3, 20
    w["routes"]["waypoint"][0, 0, :3] = [[0, 0], [800, 0], [1600, 400]]
    w["plants"]["command"][0, 0, :, 0] = 0.5
    w["plants"]["n"][0, 0, :2] = 1200
    w["tracks"]["visible"] = 1
    seen = np.flatnonzero(np.r_[w["vessels"]["active"][0], m["active"]])[1:]
    for _ in range(seconds + 1):
        recorder.sample(w)
        advance(w, 20)
        v = w["vessels"][0]
        v["eta"][0, 2] += rng.normal(0, 0.02)
        v["velocity"][0] = 1.3 * np.cos(v["eta"][0, 2]), 1.3 * np.sin(v["eta"][0, 2])
        v["nu"][0, 0] = 1.3
        v["eta"][1, 2] += 0.002
        p["sequence"][0] += 1
        p["tick"] = w["tick"][0]
        place = np.concatenate([v["eta"][:, :2], m["position"]])[seen]
        p["id"][0, seen] = seen
        p["descriptor"][0, seen], p["sensors"][0, seen], p["motion_known"][0, seen] = seen < 8, 2 + (seen < 8), seen < 8
        p["position"][0, seen] = place + rng.normal(0, 3, place.shape)
        p["radius"][0, seen] = rng.normal(15, 1, len(seen))
        p["covariance"][0, seen] = rng.uniform(4, 9, (len(seen), 5)) * [1, 0.1, 1, 0.01, 0.01]
        p["cog"][0, seen] = np.where(seen < 8, rng.normal(1, 0.1, len(seen)), np.nan)
        p["sog"][0, seen] = np.where(seen < 8, rng.normal(5, 0.3, len(seen)), np.nan)
        if rng.random() < 0.2:
            send(w, 1, error=tuple(rng.normal(0, 3, 2)))
    recorder.event(300.0, "waypoint_reached", 0, "1 of 2")
    return recorder.finish(names=NAMES, scenario={"name": "<twenty> minutes"}, seed=3, policy="hold", vessel="odin",
                           outcome={"outcome": "time_limit"}, land=LAND)  # fmt: skip


@pytest.fixture(scope="module")
def replay(tmp_path_factory):
    path = tmp_path_factory.mktemp("replay") / "replay.html"
    write_replay(episode(), path)
    return path


def embedded(path):
    data = re.search(r'id="episode">([^<]+)<', path.read_text("utf-8"))
    return unpack(base64.b64decode(data[1]))


# --- the file --------------------------------------------------------------------------------------------------------
def test_twenty_minutes_are_small_and_complete(replay):
    header, columns = embedded(replay)
    assert replay.stat().st_size < 1_500_000
    assert columns["t"].shape == (1, SECONDS + 1)
    assert columns["d_t"].shape[1] == len(episode().detections) > 18 * SECONDS - 40
    assert header["title"] == "<twenty> minutes · hold · seed 3"
    assert "<title>&lt;twenty&gt; minutes" in replay.read_text("utf-8")


def test_the_data_are_the_episode_within_half_a_quantum(replay):
    e, (header, columns) = episode(), embedded(replay)
    detections = e.detections[np.lexsort((e.detections["t"], e.detections["source"]))]
    received = e.ais[e.ais["received"]]
    expected = {
        "t": e.t, "north": [e.position(s)[:, 0] for s in range(e.sources)],
        "east": [e.position(s)[:, 1] for s in range(e.sources)], "psi": e.eta[:, :, 2].T, "rot": e.nu[:, :, 2].T,
        "sog": np.hypot(e.nu[:, :, 0], e.nu[:, :, 1]).T, "active": e.active.T, "distance": e.distance.T,
        "wind": e.weather[:, 0], "wave_height": e.weather[:, 4], "d_source": detections["source"],
        "d_north": detections["north"], "d_east": detections["east"], "d_cog": detections["cog"],
        "d_sog": detections["sog"], "d_radius": detections["radius"], "d_id": detections["id"],
        "d_cov_nn": detections["cov_nn"], "a_t": received["t"], "a_north": received["north"],
    }  # fmt: skip
    for name, values in expected.items():
        quantum = QUANTUM[name.removeprefix("d_").removeprefix("a_")]
        values = np.atleast_2d(np.asarray(values, float))
        values = np.where(np.isfinite(values), values, np.nan)
        np.testing.assert_allclose(columns[name], values, rtol=0, atol=0.5 * quantum + 1e-7, err_msg=name)
    assert [c[3] for c in header["columns"] if c[0] == "north"] == [0.01]
    assert np.isnan(columns["d_cog"][0, -1])


def test_land_travels_once():
    header, _ = unpack(pack(episode(20)))
    shell, lake = header["land"][0]
    assert shell == [400.1, -900.0, 700.0, -900.0, 700.0, 900.0, 400.0, 900.0]
    assert lake == [500.0, 0.0, 550.0, 50.0, 500.0, 90.0]
    assert "land" not in unpack(pack(episode(20), since=10.0))[0]


def test_thrust_is_a_share_of_the_largest_and_has_a_side():
    header, columns = unpack(pack(episode(20)))
    assert [side for _, _, side in header["thrusters"]] == ["starboard", "port", "bow"]
    # 1200 of 2000 rpm, but the bucket stands in the middle
    assert columns["thrust_x"].shape == (3, 21)
    assert np.all(columns["thrust_x"][:2] == 0.0)


def test_any_episode_can_be_packed():
    """One sample; a vessel file that is not known here; no AIS, no detections."""
    e = episode(20)
    one = dataclasses.replace(
        e,
        meta={**e.meta, "vessel": "elsewhere", "sensors": {}, "waypoints": []},
        detections=e.detections[:0],
        ais=e.ais[:0],
        **{name: getattr(e, name)[:1] for name in sample_dtype(8, 16).names},
    )
    header, columns = unpack(pack(one))
    assert header["thrusters"] == []
    assert columns["t"].tolist() == [[0.0]]
    assert columns["thrust_x"].shape == (0, 1)
    assert columns["d_t"].shape == (1, 0)


def test_pieces_make_the_whole():
    e = episode(20)
    whole = unpack(pack(e))[1]
    pieces = [unpack(pack(e, since=since))[1] for since in (-math.inf, 12.0)]
    assert pieces[1]["t"][0].tolist() == [13, 14, 15, 16, 17, 18, 19, 20]
    for name in ("north", "psi", "distance"):
        np.testing.assert_array_equal(whole[name][:, 13:], pieces[1][name])
    assert pieces[1]["d_t"].min() == 13


def test_what_does_not_fit_is_thinned(tmp_path, monkeypatch):
    bundle = len(html.page("", ""))
    monkeypatch.setattr(html, "LIMIT", bundle + 150_000)
    assert write_replay(episode(), tmp_path / "small.html") < bundle + 150_000
    _, columns = embedded(tmp_path / "small.html")
    assert 100 < columns["t"].shape[1] < SECONDS
    assert columns["t"][0, -1] == SECONDS


def test_events_tell_closest_approaches_and_faults():
    e = episode()
    e.faults[100:200, 0] = True
    events = unpack(pack(e))[0]["events"]
    e.faults[:] = False
    assert [x["text"] for x in events if x["kind"] == "radar_outage"] == ["begins", "ends"]
    for x in (x for x in events if x["kind"] == "cpa"):
        d = e.distance[:, x["id"]]
        assert x["text"] == f"{d.min():.0f} m"
        assert x["t"] == e.t[d.argmin()]
    assert [x["t"] for x in events] == sorted(x["t"] for x in events)


def test_the_page_names_no_other_place_and_keeps_the_licence(replay):
    text = replay.read_text("utf-8")
    # the namespace of HTML is a name, not an address
    assert set(re.findall(r"(?:https?|wss?)://[^\s\"'`)<]*", text)) <= {"http://www.w3.org/1999/xhtml"}
    assert not re.search(r"<(?:link|img|iframe)[^>]+(?:href|src)=\"(?!data:)|<script[^>]+src=|@import|url\(", text)
    assert "default-src 'none'" in text
    assert "Three.js Authors" in text
    assert "SPDX-License-Identifier: MIT" in text


def test_the_bundle_is_built_from_the_sources_as_they_are():
    sources = b"".join(path.read_bytes() for path in sorted((VIEWER / "src").iterdir()))
    built = re.search(r"built from viewer/src ([0-9a-f]{64})", html.page("", ""))
    assert built[1] == hashlib.sha256(sources).hexdigest(), "run `npm ci && npm run build` in viewer/"


def test_the_lock_file_names_no_registry():
    assert "://" not in (VIEWER / "package-lock.json").read_text("utf-8")


def test_command(tmp_path):
    save(episode(20), tmp_path / "episode.usv")
    runner = CliRunner()
    result = runner.invoke(app, ["replay", str(tmp_path)])
    assert result.exit_code == 0, result.output
    assert "replay.html: 0." in result.output.replace("\n", "")
    assert embedded(tmp_path / "replay.html")[1]["t"][0, -1] == 20
    assert runner.invoke(app, ["replay", str(tmp_path / "episode.usv")]).exit_code == 0
    assert (tmp_path / "episode.html").stat().st_size == (tmp_path / "replay.html").stat().st_size
    assert type(runner.invoke(app, ["replay", str(tmp_path / "nothing")]).exception).__name__ == "ArchiveError"


# --- in a browser ----------------------------------------------------------------------------------------------------
@pytest.fixture(scope="module")
def browser():
    if chromium() is None:
        pytest.skip("Chromium is not installed")
    with Browser(1100, 680) as browser:
        yield browser


@pytest.fixture
def page(browser, replay):
    browser.requests.clear()
    browser.complaints.clear()
    browser.resize(1100, 680)
    browser.open("about:blank")
    browser.open(f"{replay.as_uri()}#t=600", "!!window.replay && document.title.includes('twenty')")
    browser.frame()
    yield browser
    assert browser.complaints == []
    assert [url for url in browser.requests if not url.startswith(("file:", "data:", "about:"))] == []


def pixels(page, at="#stage"):
    """What is seen of an element: [width, height, 3]."""
    import pygame

    picture = pygame.surfarray.array3d(pygame.image.load(io.BytesIO(page.screenshot()), "page.png")).astype(int)
    x, y, w, h = (round(n) for n in box(page, at))
    return picture[x : x + w, y : y + h]


def box(page, what):
    """Left, top, width and height of an element."""
    return page.run(f"(r => [r.x, r.y, r.width, r.height])(document.querySelector('{what}').getBoundingClientRect())")


def changed(before, after):
    """Share of pixels that differ clearly."""
    return float((np.abs(after - before).max(axis=2) > 12).mean())


def clock(page):
    minutes, seconds = page.run("document.getElementById('clock').textContent").split(":")
    return 60 * int(minutes) + float(seconds)


def press(page, key, **more):
    page.call("Input.dispatchKeyEvent", type="keyDown", key=key, text=key if len(key) == 1 else "", **more)
    page.call("Input.dispatchKeyEvent", type="keyUp", key=key, **more)
    page.frame()


def click(page, x, y):
    for kind in ("mousePressed", "mouseReleased"):
        page.call("Input.dispatchMouseEvent", type=kind, x=x, y=y, button="left", buttons=1, clickCount=1)
    page.frame()


def test_slider_and_keys_set_the_time(page):
    assert clock(page) == 600
    before = pixels(page)
    assert changed(before, pixels(page)) == 0.0, "a paused picture stands still"
    page.run("(s => { s.value = 900; s.dispatchEvent(new Event('input')) })(document.getElementById('time'))")
    page.frame()
    assert clock(page) == 900
    assert changed(before, pixels(page)) > 0.01
    press(page, "ArrowRight")
    assert clock(page) == 901
    press(page, "ArrowLeft", modifiers=8)
    assert clock(page) == 891
    press(page, "End")
    assert clock(page) == SECONDS
    press(page, "Home")
    assert clock(page) == 0


def test_playing_moves_the_clock_at_its_speed(page):
    page.run("(s => { s.value = 50; s.dispatchEvent(new Event('change')) })(document.getElementById('speed'))")
    press(page, " ")
    page.wait("replay.t > 610", 30)
    press(page, " ")
    stopped = clock(page)
    page.frame()
    assert clock(page) == stopped


def test_every_camera_shows_something_else(page):
    views = {}
    for name in ("chase", "bridge", "top", "free"):
        page.run(f"document.getElementById('camera-{name}').click()")
        views[name] = pixels(page)
        assert views[name].std() > 10
    names = list(views)
    assert all(changed(views[a], views[b]) > 0.1 for i, a in enumerate(names) for b in names[i + 1 :])
    before = pixels(page)
    page.call("Input.dispatchMouseEvent", type="mousePressed", x=400, y=300, button="left", buttons=1)
    page.call("Input.dispatchMouseEvent", type="mouseMoved", x=500, y=330, button="left", buttons=1)
    page.call("Input.dispatchMouseEvent", type="mouseReleased", x=500, y=330, button="left")
    assert changed(before, pixels(page)) > 0.1


def test_every_group_can_be_hidden(page):
    page.run("document.getElementById('camera-free').click()")
    page.run("(replay.seek(690), Object.assign(replay.rig.view, {yaw: 45}))")
    # thrusters push in this one
    page.run("(replay.episode.series.thrust_x.rows.forEach(row => row.fill(1)), replay.dirty = true)")
    names = page.run("Array.from(document.querySelectorAll('#groups input'), box => box.id)")
    assert len(names) == 15
    for name in names:
        near = name in ("show-vessels", "show-ais", "show-tracks", "show-vectors")
        view = (
            "pitch: 40, distance: 60"
            if name == "show-thrust"
            else "pitch: 50, distance: 500"
            if near
            else "pitch: 55, distance: 900"
        )
        page.run(
            f"(replay.select({1 if near else -1}), Object.assign(replay.rig.view, {{{view}}}), replay.dirty = true)"
        )
        before = pixels(page)
        page.run(f"document.getElementById('{name}').click()")
        difference = changed(before, pixels(page))
        assert difference > 2e-5, name
        page.run(f"document.getElementById('{name}').click()")
        # text may come back with an edge drawn a shade differently
        assert changed(before, pixels(page)) < 0.1 * difference, name


def test_a_click_on_a_plot_seeks_and_on_an_event_jumps(page):
    x, y, w, h = box(page, ".plot canvas")
    click(page, x + w - 7, y + h / 2)
    assert clock(page) == pytest.approx(SECONDS, abs=8)
    page.run(
        "Array.from(document.querySelectorAll('#events button')).find(b => b.textContent.includes('waypoint')).click()"
    )
    page.frame()
    assert clock(page) == 300
    assert "1 of 2" in page.run("document.querySelector('#events .now').textContent")
    press(page, "n")
    assert clock(page) > 300


def test_a_click_on_an_object_shows_its_data(page):
    page.run("document.getElementById('camera-top').click()")
    page.frame()
    spot = page.run("replay.view.spots.find(s => s.source !== 0 && s.x > 300 && s.x < 700 && s.y > 100 && s.y < 600)")
    click(page, spot["x"], spot["y"])
    card = page.run("document.getElementById('card').hidden ? '' : document.getElementById('card').innerText")
    assert "Truth" in card
    assert f"Detected as T{spot['source']:02d}" in card


def test_labels_do_not_overlap(page):
    page.run("document.getElementById('camera-free').click()")
    page.run("(Object.assign(replay.rig.view, {yaw: 45, pitch: 30, distance: 1500}), replay.dirty = true)")
    page.frame()
    boxes = page.run(
        "Array.from(document.querySelectorAll('.label:not([hidden]), [data-keep]')).filter(e => e.checkVisibility())"
        ".map(e => e.getBoundingClientRect()).map(r => [r.left, r.top, r.right, r.bottom])"
    )
    assert len(boxes) > 8
    for i, a in enumerate(boxes):
        for b in boxes[i + 1 :]:
            assert not (a[0] < b[2] and b[0] < a[2] and a[1] < b[3] and b[1] < a[3]), (a, b)


@pytest.mark.parametrize("size", [(360, 740), (768, 1024), (1920, 1080)])
def test_fits_phones_and_desktops(page, size):
    page.resize(*size, mobile=size[0] < 500)
    page.frame()
    assert page.run("document.documentElement.scrollWidth") <= size[0]
    outside = page.run(
        "Array.from(document.querySelectorAll('button, select, input[type=range], #gauges, #compass'))"
        ".filter(e => e.checkVisibility() && !e.closest('#panel')).map(e => [e.id, e.getBoundingClientRect()])"
        ".filter(([, r]) => r.left < 0 || r.right > innerWidth + 0.5 || r.bottom > innerHeight + 0.5).map(([id]) => id)"
    )
    assert outside == []
    assert pixels(page).std() > 10


def test_broken_data_are_said(browser, replay, tmp_path):
    text = replay.read_text("utf-8")
    (tmp_path / "broken.html").write_text(re.sub(r'(id="episode">)[^<]+', r"\1AAAA", text), "utf-8")
    browser.open((tmp_path / "broken.html").as_uri(), "document.getElementById('message')?.hidden === false")
    assert "cannot be shown" in browser.run("document.getElementById('message').textContent")


# --- live ------------------------------------------------------------------------------------------------------------
@pytest.fixture(scope="module")
def broadcast():
    from usv_gym.live import Broadcast, server
    from usv_gym.run import plan

    on_air = Broadcast(plan("calm_crossing", policy="idle"), pace=4.0)
    http = server(on_air)
    threading.Thread(target=http.serve_forever, daemon=True).start()
    yield on_air, f"http://127.0.0.1:{http.server_address[1]}"
    on_air.stop()
    http.shutdown()
    http.server_close()


def ask(address, body=None, **headers):
    kind = {"Content-Type": "application/json"} if body is not None else {}
    request = urllib.request.Request(address, None if body is None else body.encode(), {**kind, **headers})
    try:
        with urllib.request.urlopen(request, timeout=20) as answer:
            return answer.status, answer.read().decode()
    except urllib.error.HTTPError as error:
        return error.code, error.read().decode()


def test_live_refuses_what_it_should(broadcast):
    _, address = broadcast
    assert ask(f"{address}/nothing")[0] == 404
    assert ask(f"{address}/", Host="example.org")[0] == 403
    assert ask(f"{address}/spawn", '{"north": 1, "east": 1}', Origin="http://example.org")[0] == 403
    for body in ("[]", "{}", '{"north": "x", "east": 1}', '{"north": 1e999, "east": 1}', "no json"):
        assert ask(f"{address}/spawn", body)[0] == 400, body


def test_live_streams_and_a_click_puts_an_obstacle_into_the_sea(broadcast, request):
    on_air, address = broadcast
    sailing = threading.Thread(target=on_air.run)
    sailing.start()
    # as long as nobody looks, the episode goes on; a stream begins with all of it
    stream = urllib.request.urlopen(f"{address}/events", timeout=60)
    assert stream.readline() == b"event: pace\n"
    assert ask(f"{address}/spawn", '{"north": 150.0, "east": 30.0}') == (200, "")
    begun = b""
    while begun.count(b"\ndata: e") < 3:  # it goes on
        begun += stream.readline()
    if chromium() is not None:
        browser = request.getfixturevalue("browser")
        browser.complaints.clear()
        browser.open(f"{address}/", "!!window.replay && !!replay.episode.header && replay.t > 0")
        before = browser.run("replay.episode.end")
        browser.wait(f"replay.episode.end > {before} + 2")
        browser.wait("replay.episode.header.events.some(e => e.kind === 'spawned')")
        browser.run("document.getElementById('spawn').click()")
        click(browser, 500, 500)
        browser.wait("replay.episode.header.events.filter(e => e.kind === 'spawned').length === 2")
        assert browser.complaints == []
    on_air.stop()
    sailing.join(60)
    stream_text = begun + stream.read()
    stream.close()
    parts, events = [], []
    for line in stream_text.splitlines():
        if line.startswith((b"data: eJ", b"data: eN")):
            header, columns = unpack(base64.b64decode(line[6:]))
            parts.append(columns["t"][0])
            events = header["events"]
    t = np.concatenate(parts)
    assert np.all(np.diff(t) > 0)
    assert len(parts) > 1
    spawned = [e for e in events if e["kind"] == "spawned"]
    assert json.loads(spawned[0]["text"])["spec"]["position"] == [150.0, 30.0]
