"""Films of recorded episodes: MP4 by the ffmpeg that imageio-ffmpeg brings along, GIF by Pillow (extra ``video``)."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..config import ConfigError
from ..replay.archive import Episode, replacing
from .pygame_view import View, map_size, render
from .scene_episode import scene_from_episode

#: [px] smallest sides of a film
SMALLEST = 64
#: of a GIF: colours, how many of them are simply the most frequent ones, and frames in which they are looked for
COLOURS, FREQUENT, SAMPLES = 96, 48, 6
Frame = NDArray[np.uint8]
#: called after every frame with (frames so far, frames in all)
Progress = Callable[[int, int], None]


def write_film(
    episode: Episode,
    path: str | os.PathLike[str],
    *,
    fps: float = 20.0,
    speed: float = 10.0,
    size: tuple[int, int] = (1180, 800),
    palette: str = "day",
    progress: Progress | None = None,
) -> int:
    """Write an episode as ``.mp4`` or ``.gif``; the file appears whole or not at all.  Returns the number of frames.

    Parameters
    ----------
    episode
        what to show.
    path
        where to; its ending picks the format.
    fps
        frames per second of the film; GIF knows whole hundredths of a second only.
    speed
        times real time.
    size
        width and height [px]; even numbers for MP4, so that an odd one loses a pixel.
    palette
        "day", "dark" or "night".
    progress
        called after every frame.

    Raises
    ------
    ConfigError
        if the ending is another, an argument makes no sense, or a library is missing.
    OSError
        if the file cannot be written.
    """
    target = Path(path)
    kind = target.suffix.lower()
    if kind not in (".mp4", ".gif"):
        raise ConfigError(f"{target}: expected a file that ends in .mp4, .gif or .png")
    if not (0.0 < fps <= 100.0 and 0.0 < speed < math.inf):
        raise ConfigError(f"expected fps in (0, 100] and a positive speed, got {fps:g} and {speed:g}")
    if min(size) < SMALLEST:
        raise ConfigError(f"size: expected at least {SMALLEST}x{SMALLEST}, got {size[0]}x{size[1]}")
    if kind == ".mp4":
        size = (size[0] // 2 * 2, size[1] // 2 * 2)
    times = film_times(episode, speed / fps)
    view = View.fit(scene_from_episode(episode).extent, *map_size(size))

    def frame(t: float) -> Frame:
        return render(scene_from_episode(episode, t, future=False), size, palette, view)

    def frames() -> Iterator[Frame]:
        for k, t in enumerate(times):
            yield frame(t)
            if progress is not None:
                progress(k + 1, len(times))

    if kind == ".mp4":
        _write_mp4(target, frames(), size, fps)
    else:
        _write_gif(target, frames(), [frame(t) for t in times[:: max(len(times) // SAMPLES, 1)]], fps)
    return len(times)


def film_times(episode: Episode, step: float) -> list[float]:
    """Times [s] of the frames, the last sample included."""
    start, end = float(episode.t[0]), float(episode.t[-1])
    return [*np.arange(start, end, step).tolist(), end]


def _write_mp4(path: Path, frames: Iterator[Frame], size: tuple[int, int], fps: float) -> None:
    ffmpeg = _needs("imageio_ffmpeg")
    path.parent.mkdir(parents=True, exist_ok=True)
    temporary = path.with_name(f".{path.stem}.{os.getpid()}.mp4")
    writer = ffmpeg.write_frames(str(temporary), size, fps=fps, codec="libx264", quality=7, macro_block_size=2)
    try:
        writer.send(None)
        for frame in frames:
            writer.send(frame)
        writer.close()
        os.replace(temporary, path)
    finally:
        writer.close()
        temporary.unlink(missing_ok=True)


def _write_gif(path: Path, frames: Iterator[Frame], samples: list[Frame], fps: float) -> None:
    """One set of colours for all frames, found in ``samples``, so that what stands still costs nothing."""
    image = _needs("PIL.Image")
    colours = image.new("P", (1, 1))
    colours.putpalette(_colours(image, np.hstack(samples)).tobytes())
    pictures = (image.fromarray(frame).quantize(palette=colours, dither=image.Dither.NONE) for frame in frames)
    with replacing(path) as file:
        next(pictures).save(
            file, "GIF", save_all=True, append_images=pictures, loop=0, duration=max(round(100.0 / fps), 2) * 10
        )


def _colours(image: Any, picture: Frame) -> NDArray[np.uint8]:
    """Colours [n, 3] for a picture: the most frequent ones as they are, and others spread over all that there are."""
    packed, count = np.unique(picture.reshape(-1, 3) @ np.array((65536, 256, 1)), return_counts=True)
    frequent = packed[np.argsort(-count, kind="stable")[:FREQUENT]]
    spread = image.fromarray(picture).quantize(COLOURS - FREQUENT, image.Quantize.MAXCOVERAGE).getpalette()
    rest = np.array(spread, np.uint8).reshape(-1, 3)[: COLOURS - FREQUENT]
    return np.vstack((np.column_stack((frequent >> 16, frequent >> 8 & 255, frequent & 255)).astype(np.uint8), rest))


def _needs(module: str) -> Any:
    """Import a library of the extra ``video``."""
    import importlib

    try:
        return importlib.import_module(module)
    except ImportError as error:
        raise ConfigError("writing a film needs more libraries: pip install 'usv-gym[video]'") from error
