"""Films and pictures of recorded episodes, and Gymnasium's RecordVideo."""

from __future__ import annotations

import sys

import gymnasium as gym
import numpy as np
import pytest
from synthetic import episode
from typer.testing import CliRunner

import usv_gym  # noqa: F401
from usv_gym.cli import app
from usv_gym.config import ConfigError
from usv_gym.render.video import film_times, write_film
from usv_gym.replay.archive import ArchiveError, open_archive, save

SIZE = (200, 150)


@pytest.fixture(scope="module")
def ten_seconds():
    return episode(10.0)


@pytest.fixture(scope="module")
def results(ten_seconds, tmp_path_factory):
    directory = tmp_path_factory.mktemp("results")
    save(ten_seconds, directory / "episode.usv")
    return directory


def test_a_film_has_all_of_the_episode(ten_seconds):
    times = film_times(ten_seconds, 3.0)
    assert times == [0.0, 3.0, 6.0, 9.0, 10.0]


def test_gif(ten_seconds, tmp_path):
    image = pytest.importorskip("PIL.Image")
    told = []
    n = write_film(ten_seconds, tmp_path / "film.gif", size=SIZE, fps=10, speed=20,
                   progress=lambda done, total: told.append((done, total)))  # fmt: skip
    assert told[-1] == (n, n)
    with image.open(tmp_path / "film.gif") as film:
        assert film.size == SIZE
        assert film.n_frames == n == 6
        assert film.info["duration"] == 100
        assert film.info["loop"] == 0
        frames = []
        for k in range(n):
            film.seek(k)
            frames.append(np.asarray(film.convert("RGB"), float))
    assert frames[0].mean() > 100.0
    assert np.abs(frames[-1] - frames[0]).max() > 50.0  # something moves
    still = (np.abs(frames[-1] - frames[0]).max(axis=2) < 8).mean()
    assert still > 0.6  # and the map stays where it is


@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")  # imageio_ffmpeg's reader leaves its pipes open
def test_mp4(ten_seconds, tmp_path):
    ffmpeg = pytest.importorskip("imageio_ffmpeg")
    n = write_film(ten_seconds, tmp_path / "film.mp4", size=(201, 151), fps=10, speed=20)
    reader = ffmpeg.read_frames(str(tmp_path / "film.mp4"))
    facts = next(reader)
    assert facts["size"] == (200, 150)
    assert facts["fps"] == 10.0
    frames = [np.frombuffer(frame, np.uint8) for frame in reader]
    assert abs(len(frames) - n) <= 1
    assert np.abs(frames[-1].astype(float) - frames[0]).max() > 50.0
    assert [path.name for path in tmp_path.iterdir()] == ["film.mp4"]


@pytest.mark.parametrize("name", ["film.gif", "film.mp4"])
def test_a_film_that_breaks_off_leaves_nothing(ten_seconds, tmp_path, name):
    pytest.importorskip("imageio_ffmpeg")
    pytest.importorskip("PIL")

    def stop(done: int, total: int) -> None:
        if done == 3:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        write_film(ten_seconds, tmp_path / name, size=SIZE, speed=20, progress=stop)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(("name", "module"), [("film.gif", "PIL.Image"), ("film.mp4", "imageio_ffmpeg")])
def test_a_missing_library_is_named_with_the_extra(ten_seconds, tmp_path, monkeypatch, name, module):
    monkeypatch.setitem(sys.modules, module, None)
    with pytest.raises(ConfigError, match=r"pip install 'usv-gym\[video\]'"):
        write_film(ten_seconds, tmp_path / name, size=SIZE, speed=20)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("name", "options", "message"),
    [("film.avi", {}, ".mp4, .gif or .png"), ("film.gif", {"fps": 0}, "fps"), ("film.gif", {"size": (10, 10)}, "size")],
)
def test_arguments_are_checked(ten_seconds, tmp_path, name, options, message):
    with pytest.raises(ConfigError, match=message):
        write_film(ten_seconds, tmp_path / name, **options)


def test_render_command(results, tmp_path):
    pytest.importorskip("PIL")
    out = tmp_path / "map.png"
    for arguments in (["--t", "5", "--palette", "night"], []):
        run = CliRunner().invoke(app, ["render", str(results), "-o", str(out), "--size", "300x200", *arguments])
        assert run.exit_code == 0, run.output
        assert out.read_bytes()[:4] == b"\x89PNG"
    run = CliRunner().invoke(app, ["render", str(results), "-o", str(tmp_path / "f.gif"), "--size", "100x80", "--speed", "40"])
    assert run.exit_code == 0, run.output
    assert (tmp_path / "f.gif").read_bytes()[:3] == b"GIF"


@pytest.mark.parametrize(
    ("arguments", "message"),
    [(["--size", "wide"], "--size"), (["--palette", "noon"], "--palette"), (["--t", "99"], "outside the episode")],
)
def test_render_command_complains_in_one_line(results, tmp_path, arguments, message):
    run = CliRunner().invoke(app, ["render", str(results), "-o", str(tmp_path / "map.png"), *arguments])
    assert isinstance(run.exception, ConfigError)
    assert message in str(run.exception)
    assert "\n" not in str(run.exception)
    assert not (tmp_path / "map.png").exists()


def test_no_archive_there(tmp_path):
    with pytest.raises(ArchiveError, match=r"episode\.usv: cannot be read"):
        open_archive(tmp_path)


def test_record_video_of_gymnasium(tmp_path):
    pytest.importorskip("moviepy", reason="RecordVideo needs moviepy, an optional dependency of Gymnasium")
    env = gym.make("usv_gym/OpenSea-v0", render_mode="rgb_array")
    env = gym.wrappers.RecordVideo(env, str(tmp_path / "film"), episode_trigger=lambda k: True, disable_logger=True)
    env.reset(seed=1)
    for _ in range(3):
        env.step(env.action_space.sample())
    env.close()
    assert [path.suffix for path in (tmp_path / "film").iterdir()] == [".mp4"]


def test_frames_are_what_record_video_needs():
    """RecordVideo's own requirements, checked without moviepy: a declared mode, a rate, and frames of one shape."""
    env = gym.make("usv_gym/OpenSea-v0", render_mode="rgb_array")
    assert env.metadata["render_fps"] > 0
    assert {"human", "rgb_array"} == set(env.metadata["render_modes"])
    env.reset(seed=1)
    frames = [env.render()]
    env.step(env.action_space.sample())
    frames.append(env.render())
    assert {(frame.shape, frame.dtype) for frame in frames} == {((800, 800, 3), np.dtype(np.uint8))}
    assert not np.shares_memory(*frames)
