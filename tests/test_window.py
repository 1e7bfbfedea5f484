"""The live window: events in, changes of the world out; and a real window on SDL's dummy screen, or on Xvfb's."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.error import DependencyNotInstalled

import usv_gym  # noqa: F401
from usv_gym.config import ConfigError
from usv_gym.play import BY_HAND, Live, Replay, plan_by_hand
from usv_gym.render.canvas import load_pygame
from usv_gym.render.desk import BAR, SPEEDS, Desk
from usv_gym.render.primitives import Circle, Polyline
from usv_gym.replay.archive import load, save
from usv_gym.run import listing, plan, resimulate, write_outputs

pg = load_pygame()
SCENARIO: dict[str, Any] = {
    "name": "harbour",
    "simulation": {"dt": 0.05, "control_interval": 1.0, "duration": 60.0},
    "own_ship": {"route": [[500, 0]]},
    "ships": {"coaster": {"class": "vessel", "speed": 3, "waypoints": [[200, 200], [200, -600]]}},
    "obstacles": {"berg": {"position": [120, -90], "radius": 12}},
}


@pytest.fixture
def desk() -> Desk:
    return Desk(Live(plan_by_hand(SCENARIO)))


@pytest.fixture
def watched() -> Desk:
    return Desk(Live(plan(SCENARIO, policy="waypoints")))


@pytest.fixture(scope="module")
def episode():
    live = Live(plan(SCENARIO, policy="waypoints"))
    for _ in range(20):
        live.step((0.0, 0.0))
    return live.voyage.finish()


@pytest.fixture
def recording(episode) -> Desk:
    return Desk(Replay(episode))


def press(desk: Desk, *keys: str) -> None:
    for key in keys:
        code = getattr(pg, f"K_{key}")
        desk.handle(pg.event.Event(pg.KEYDOWN, key=code))
        desk.handle(pg.event.Event(pg.KEYUP, key=code))


def pixel(desk: Desk, place: tuple[float, float]) -> tuple[float, float]:
    return desk.view.pixel(place, desk.map_size)


def mouse(desk: Desk, at: tuple[float, float], to: tuple[float, float] | None = None, button: int = 1) -> None:
    """Click, or drag from one place [px] to another."""
    desk.handle(pg.event.Event(pg.MOUSEBUTTONDOWN, button=button, pos=at))
    for k in range(1, 4 if to else 0):
        now = tuple(a + (b - a) * k / 3 for a, b in zip(at, to, strict=True))
        desk.handle(pg.event.Event(pg.MOUSEMOTION, pos=now, rel=(0, 0), buttons=(1, 0, 0)))
    desk.handle(pg.event.Event(pg.MOUSEBUTTONUP, button=button, pos=to or at))


def wait(desk: Desk, seconds: float) -> None:
    for _ in range(round(seconds / 0.1)):
        desk.tick(0.1)


def names(desk: Desk) -> list[str]:
    return [name for name in desk.show.commands.names if name]


def position(desk: Desk, id: str) -> tuple[float, float]:
    return next(thing.position for thing in desk.show.things() if thing.id == id)


def detected(desk: Desk, id: str) -> bool:
    source = desk.show.commands.names.index(id)
    return bool(desk.show.voyage.world["picture"]["id"][0, source])


# --- obstacles -------------------------------------------------------------------------------------------------------
def test_click_marks_enter_spawns_and_the_tdm_sees_what_is_in_range(desk):
    near, far, north = (60.0, 60.0), (-80.0, 90.0), (4000.0, 0.0)
    for place in (near, far):
        mouse(desk, pixel(desk, place))
    desk.scale = 0.05
    mouse(desk, pixel(desk, north))
    assert len(desk.marks) == 3
    assert len([c for c in desk.scene().all(Circle, "mark") if c.radius == 15.0]) == 3
    press(desk, "RETURN")
    assert desk.marks == []
    assert {"iceberg_1", "iceberg_2", "iceberg_3"} <= set(names(desk))
    world = desk.show.voyage.world
    spawned = world["obstacles"]["position"][[1, 2, 3]]
    np.testing.assert_allclose(spawned, [near, far, north], atol=0.1)
    assert list(world["obstacles"]["active"][:4]) == [1, 1, 1, 1]
    wait(desk, 8.0)
    assert detected(desk, "iceberg_1")
    assert detected(desk, "iceberg_2")
    assert not detected(desk, "iceberg_3")  # beyond the radar


def test_right_click_spawns_at_once_with_the_brush(desk):
    press(desk, "TAB", "TAB", "RIGHTBRACKET")
    assert desk.brush == "buoy"
    mouse(desk, pixel(desk, (-50.0, 40.0)), button=3)
    assert "buoy_1" in names(desk)
    assert desk.show.voyage.world["obstacles"]["radius"][1] == pytest.approx(2.5)


def test_a_ship_sails_through_the_marks(desk):
    desk.brush = "ship"
    for place in ((-200.0, -100.0), (-200.0, 100.0)):
        mouse(desk, pixel(desk, place))
    assert desk.scene().all(Polyline, "mark_route")
    press(desk, "RETURN")
    before = position(desk, "ship_1")
    wait(desk, 5.0)
    after = position(desk, "ship_1")
    assert after[1] - before[1] > 10.0
    assert after[0] == pytest.approx(before[0], abs=2.0)


def test_drag_moves_and_delete_removes(desk):
    mouse(desk, pixel(desk, (120.0, -90.0)), pixel(desk, (150.0, 40.0)))
    assert position(desk, "berg") == pytest.approx((150.0, 40.0), abs=0.1)
    mouse(desk, pixel(desk, (150.0, 40.0)))
    assert desk.hint().startswith("berg  iceberg, r = 12 m")
    assert desk.scene().all(Circle, "selected")
    press(desk, "DELETE")
    assert "berg" not in names(desk)
    press(desk, "DELETE")
    assert "nothing is selected" in desk.message


def test_ais_is_switched(desk):
    mouse(desk, pixel(desk, (200.0, 200.0)))
    assert "AIS on" in desk.hint()
    press(desk, "a")
    assert "AIS off" in desk.hint()
    press(desk, "a")
    assert "AIS on" in desk.hint()
    mouse(desk, pixel(desk, (120.0, -90.0)))
    press(desk, "a")
    assert "no AIS station" in desk.message


def test_what_the_world_refuses_is_said(desk):
    press(desk, "RETURN")
    assert "nothing is marked" in desk.message
    for k in range(20):
        mouse(desk, pixel(desk, (-100.0, 10.0 * k)), button=3)
    assert "no free slot" in desk.message
    desk.tick(10.0)
    assert "no free slot" not in desk.message


def test_the_own_ship_is_not_dragged(desk):
    at = pixel(desk, desk.show.here)
    mouse(desk, at, (at[0] + 60.0, at[1]))
    assert desk.show.here == (0.0, 0.0)


# --- driving ---------------------------------------------------------------------------------------------------------
def test_arrows_drive(desk):
    desk.handle(pg.event.Event(pg.KEYDOWN, key=pg.K_UP))
    wait(desk, 2.0)
    desk.handle(pg.event.Event(pg.KEYUP, key=pg.K_UP))
    assert desk.helm.throttle == 1.0
    wait(desk, 5.0)
    world = desk.show.voyage.world
    assert world["vessels"]["nu"][0, 0] > 3.0
    heading = float(world["vessels"]["eta"][0, 2])
    desk.handle(pg.event.Event(pg.KEYDOWN, key=pg.K_RIGHT))
    wait(desk, 3.0)
    assert desk.helm.yaw == 1.0
    assert world["vessels"]["eta"][0, 2] > heading + 0.2
    desk.handle(pg.event.Event(pg.WINDOWFOCUSLOST))
    wait(desk, 1.0)
    assert desk.helm.yaw == 0.0  # a key let go elsewhere is not held for ever
    press(desk, "BACKSPACE")
    assert desk.helm.throttle == 0.0


def test_a_gamepad_drives(desk):
    for axis, value in ((1, -0.8), (0, 0.5)):
        desk.handle(pg.event.Event(pg.JOYAXISMOTION, axis=axis, value=value))
    wait(desk, 0.5)
    assert (desk.helm.throttle, desk.helm.yaw) == (pytest.approx(0.8), 0.5)
    desk.handle(pg.event.Event(pg.JOYAXISMOTION, axis=0, value=0.05))
    assert desk.helm.yaw == 0.0


def test_the_keys_do_not_steer_a_policy(watched):
    assert not watched.show.manual
    press(watched, "UP")
    assert watched.helm.throttle == 0.0
    wait(watched, 3.0)
    assert watched.show.voyage.world["vessels"]["nu"][0, 0] > 1.0


@pytest.mark.parametrize("vessel", ["odin", "jolner", "otter"])
def test_every_vessel_is_driven_by_the_same_keys(vessel):
    live = Live(plan_by_hand(SCENARIO, vessel=vessel))
    for _ in range(30):
        live.step((1.0, 0.5))
    nu = live.voyage.world["vessels"]["nu"][0]
    assert nu[0] > 0.5
    assert nu[2] > 0.01


# --- time ------------------------------------------------------------------------------------------------------------
def test_pause_step_and_speed(watched):
    wait(watched, 1.0)
    t = watched.show.t
    assert t == pytest.approx(1.0)
    press(watched, "SPACE")
    wait(watched, 1.0)
    assert watched.show.t == t
    press(watched, "n")
    assert watched.show.t == pytest.approx(2.0)
    press(watched, "SPACE", "PAGEUP", "PAGEUP")
    assert watched.state() == "x5"
    wait(watched, 1.0)
    assert watched.show.t == pytest.approx(7.0)
    press(watched, *["PAGEUP"] * 9)
    assert watched.speed == SPEEDS[-1] == 50.0
    press(watched, *["PAGEDOWN"] * 9)
    assert watched.speed == SPEEDS[0] == 0.25


def test_everything_glides_between_control_steps(watched):
    wait(watched, 10.0)
    north = []
    for _ in range(20):
        watched.tick(0.1)
        north.append(watched.show.here[0])
    steps = np.diff(north)
    assert steps.min() > 0.0
    assert steps.max() < 2.0 * steps.min()


def test_it_ends_and_starts_anew(watched):
    watched.speed = 50.0
    wait(watched, 20.0)
    assert watched.state() == "time is up"
    t = watched.show.t
    press(watched, "n")
    assert watched.show.t == t
    press(watched, "r", "SPACE")
    assert watched.show.t == 0.0
    assert watched.state() == "x50"


def test_what_was_played_can_be_run_again(desk, tmp_path):
    desk.helm.throttle = 1.0
    wait(desk, 2.0)
    mouse(desk, pixel(desk, (150.0, 150.0)), button=3)
    desk.helm.yaw = 0.3
    wait(desk, 2.0)
    mouse(desk, pixel(desk, position(desk, "berg")), pixel(desk, (60.0, -90.0)))
    wait(desk, 2.0)
    save(desk.show.voyage.finish(), tmp_path / "episode.usv")
    episode = load(tmp_path / "episode.usv")
    assert episode.meta["policy"] == BY_HAND
    assert episode.meta["outcome"]["outcome"] == "interrupted"
    assert [order[1] for order in episode.meta["orders"]] == ["spawn", "move"]
    again = resimulate(episode)
    np.testing.assert_array_equal(again.eta, episode.eta)
    assert again.detections.tobytes() == episode.detections.tobytes()


# --- the map ---------------------------------------------------------------------------------------------------------
def test_zoom_pan_and_follow(desk):
    assert desk.follow
    place = (100.0, 150.0)
    mouse(desk, pixel(desk, (-100.0, -150.0)), pixel(desk, (-50.0, -150.0)))
    assert not desk.follow
    at = pixel(desk, place)
    desk.handle(pg.event.Event(pg.MOUSEWHEEL, y=2, pos=at))
    assert pixel(desk, place) == pytest.approx(at)  # what is under the mouse stays there
    scale = desk.scale
    press(desk, "PLUS")
    assert desk.scale == pytest.approx(1.25 * scale)
    press(desk, "f")
    assert desk.follow
    assert pixel(desk, desk.show.here) == pytest.approx((0.5 * desk.map_size[0], 0.5 * desk.map_size[1]))
    desk.handle(pg.event.Event(pg.MOUSEWHEEL, y=-500, pos=at))
    assert desk.scale == 0.01


def test_help_palette_escape_and_quit(desk):
    press(desk, "h")
    assert desk.help
    assert {"throttle", "spawn at the marks", "zoom"} <= {text for _, text in desk.help_text()}
    press(desk, "ESCAPE")
    assert not desk.help
    press(desk, "c")
    assert desk.palette == "dark"
    mouse(desk, (100.0, 100.0))
    press(desk, "ESCAPE")
    assert desk.marks == []
    press(desk, "q")
    assert desk.done


def test_a_picture_is_saved_beside_the_last_one(desk, tmp_path):
    desk.pictures = tmp_path
    press(desk, "p", "p")
    assert sorted(p.name for p in tmp_path.iterdir()) == ["harbour-00m00s-1.png", "harbour-00m00s.png"]


# --- recordings ------------------------------------------------------------------------------------------------------
def test_a_recording_is_scrubbed(recording):
    show = recording.show
    assert show.span == (0.0, 20.0)
    press(recording, "RIGHT", "RIGHT", "LEFT")
    assert show.t == 5.0
    press(recording, "n")
    assert show.t == 6.0
    left, right = recording.slider()
    bar = recording.size[1] - 0.5 * BAR
    mouse(recording, (left, bar), (0.5 * (left + right), bar))
    assert show.t == pytest.approx(10.0)
    press(recording, "SPACE", "PAGEUP")
    wait(recording, 3.0)
    assert show.t == pytest.approx(16.0)
    track = recording.scene().all(Polyline, "track_own")[0].points
    assert tuple(track[-1]) == show.here  # not what is to come
    press(recording, "END")
    assert recording.state() == "end"
    press(recording, "HOME")
    assert show.t == 0.0


def test_a_recording_cannot_be_changed(recording):
    mouse(recording, (300.0, 300.0), button=3)
    assert "cannot be changed" in recording.message
    mouse(recording, (300.0, 300.0))
    assert recording.marks == []


def test_events_of_a_recording_are_said(recording):
    recording.show.episode.events.append({"t": 2.0, "kind": "collision", "id": 1, "text": ""})
    wait(recording, 3.0)
    recording.show.episode.events.pop()
    assert recording.message == "0:02 collision: coaster"


# --- a window --------------------------------------------------------------------------------------------------------
@pytest.fixture
def window(monkeypatch):
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    from usv_gym.render.window import Window

    window = Window(size=(1000, 700), ratio=1.0)
    yield window
    window.close()


def test_a_click_in_the_window_spawns(window, desk):
    """The whole way: pygame's queue, the window, the desk, the world, the TDM, and the pixels."""
    window.frame(desk, 0.0)
    window.pg.event.post(window._resized())
    window.frame(desk, 0.0)
    assert desk.size == (1000.0, 700.0)
    before = pg.surfarray.array3d(window.screen)
    x, y = (round(c) for c in pixel(desk, (80.0, 90.0)))
    for kind in (pg.MOUSEBUTTONDOWN, pg.MOUSEBUTTONUP):
        pg.event.post(pg.event.Event(kind, button=1, pos=(x, y)))
    pg.event.post(pg.event.Event(pg.KEYDOWN, key=pg.K_RETURN))
    for _ in range(60):
        window.frame(desk, 0.1)
    assert "iceberg_1" in names(desk)
    assert detected(desk, "iceberg_1")
    changed = (pg.surfarray.array3d(window.screen) != before).any(axis=2)
    x, y = (round(c) for c in pixel(desk, position(desk, "iceberg_1")))
    assert changed[x - 8 : x + 8, y - 8 : y + 8].mean() > 0.5
    pg.event.post(pg.event.Event(pg.QUIT))
    window.run(desk)  # returns
    assert desk.done


@pytest.mark.parametrize(("size", "ratio"), [((400, 300), 1.0), ((120, 90), 1.0), ((1400, 900), 2.0), ((30, 20), 1.0)])
def test_any_size_and_density(monkeypatch, size, ratio, desk, recording):
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    from usv_gym.render.window import Window

    window = Window(size=(800, 600), ratio=ratio)
    window.screen = pg.Surface(size)
    monkeypatch.setattr(pg.display, "flip", lambda: None)
    for one in (desk, recording):
        one.handle(window._resized())
        one.help = True
        window.draw(one)
        assert one.size == (size[0] / ratio, size[1] / ratio)
    window.close()


def test_dense_screens_get_the_same_layout_in_more_pixels(desk):
    from usv_gym.render.pygame_view import render

    scene = desk.scene()
    fine = render(scene, (1600, 1200), ratio=2.0).astype(float)
    coarse = render(scene, (800, 600)).astype(float)
    shrunk = fine.reshape(600, 2, 800, 2, 3).mean(axis=(1, 3))
    assert np.abs(shrunk - coarse).mean() < 6.0


def test_no_screen_is_one_clear_line(monkeypatch):
    from usv_gym.render.window import Window

    monkeypatch.setenv("SDL_VIDEODRIVER", "no such driver")
    with pytest.raises(ConfigError, match="no window can be opened"):
        Window()


@pytest.mark.skipif(shutil.which("Xvfb") is None, reason="Xvfb is not installed")
def test_a_window_on_a_virtual_x_server():
    code = (
        "from usv_gym.render.window import Window; w = Window(size=(300, 200)); "
        "assert w.pg.display.get_driver() == 'x11'; w.events(); w.close()"
    )
    env = {k: v for k, v in os.environ.items() if k != "SDL_VIDEODRIVER"}
    subprocess.run(["xvfb-run", "-a", sys.executable, "-c", code], check=True, env=env, timeout=60)


# --- render_mode="human" ---------------------------------------------------------------------------------------------
def test_human_mode_shows_every_step(monkeypatch):
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    env = gym.make("usv_gym/Scenario-v0", scenario=SCENARIO, render_mode="human").unwrapped
    env.metadata["render_fps"] = 1000
    env.reset(seed=1)
    first = pg.surfarray.array3d(pg.display.get_surface())
    assert first.std() > 5.0
    for _ in range(3):
        env.step(np.array([1.0, 0.0], np.float32))
    assert env.render() is None
    assert (pg.surfarray.array3d(pg.display.get_surface()) != first).any()
    pg.event.post(pg.event.Event(pg.QUIT))
    env.step(np.array([1.0, 0.0], np.float32))
    assert not pg.display.get_init()
    observation, *_ = env.step(np.array([1.0, 0.0], np.float32))  # goes on without a window
    assert np.isfinite(observation).all()
    env.close()


def test_human_mode_without_pygame_says_what_to_install(monkeypatch, episode, tmp_path):
    monkeypatch.setitem(sys.modules, "pygame", None)
    load_pygame.cache_clear()
    try:
        with pytest.raises(DependencyNotInstalled, match="pip install pygame-ce"):
            gym.make("usv_gym/Scenario-v0", scenario=SCENARIO, render_mode="human")
        env = gym.make("usv_gym/Scenario-v0", scenario=SCENARIO)  # headless needs none
        env.reset(seed=1)
        env.step(env.action_space.sample())
        (tmp_path / "map.png").touch()  # of an earlier run
        with pytest.warns(UserWarning, match="map.png is left out: .*pip install pygame-ce"):
            write_outputs(episode, tmp_path)
        assert listing(tmp_path) == "episode.usv  ais.nmea  detections.csv  summary.json"
    finally:
        load_pygame.cache_clear()


def test_playing_needs_no_pygame_to_be_imported():
    code = "import sys, usv_gym.play, usv_gym.render.desk, usv_gym.render.window; assert 'pygame' not in sys.modules"
    subprocess.run([sys.executable, "-c", code], check=True)


def test_command_line(monkeypatch, tmp_path):
    from typer.testing import CliRunner

    from usv_gym.cli import app
    from usv_gym.render import window

    seen: list[float] = []

    def a_second(self: Any, desk: Desk) -> None:
        for _ in range(10):
            self.frame(desk, 0.1)
        seen.append(desk.show.t)

    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    monkeypatch.setattr(window.Window, "run", a_second)
    run = CliRunner().invoke(app, ["play", "calm_crossing", "--policy", "waypoints", "--record", str(tmp_path / "out")])
    assert run.exit_code == 0, run.output
    assert load(tmp_path / "out" / "episode.usv").meta["policy"] == "waypoints"
    assert CliRunner().invoke(app, ["watch", str(tmp_path / "out"), "--palette", "night"]).exit_code == 0
    assert seen == [pytest.approx(1.0), pytest.approx(1.0)]
    for bad in (["--palette", "noon"], ["--record", __file__]):
        run = CliRunner().invoke(app, ["play", "calm_crossing", *bad])
        assert isinstance(run.exception, ConfigError)
