"""A rig: which controller is behind which transport, as settings that a file or the command line can hold.

``--policy hil:FILE.yaml`` puts such a controller wherever a policy can be: runs, campaigns, scenario checks.
"""

from __future__ import annotations

import atexit
import os
import shlex
import subprocess
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, Literal

from pydantic import Field

from ..config import ConfigError, Model, read_yaml, validate
from .backends import BACKENDS, Backend, make_backend
from .external import ExternalController
from .link import Link
from .profile import Profile, Trouble, load_profile

DEFAULT_PROFILE = {"nmea": "nmea"}


class Rig(Model):
    """Settings of the bridge."""

    backend: str = "ros2"
    profile: str = Field(default="", description="name or file; default: nmea for NMEA, else standard")
    options: dict[str, str] = Field(default_factory=dict, description="of the backend")
    control: Literal["actuators", "heading_speed", "demand"] | None = Field(
        default=None, description="default: the profile's"
    )
    timeout: float = Field(default=1.0, gt=0, description="[s] without a command until the fail-safe acts")
    fail_safe: Literal["zero", "hold"] = "zero"
    patience: float = Field(default=30.0, gt=0, description="[s] of real time for the first command of a lock-step")
    start: str = Field(default="", description="command line that starts the controller, and is ended with the bridge")
    restart: bool = Field(default=True, description="start it anew for every episode")
    inject: dict[str, Trouble] = Field(default_factory=dict, description="topic or pattern -> delay, jitter, loss")


def profile_of(rig: Rig, directory: Path | None = None) -> Profile:
    """The profile of a rig, checked against its backend.

    Raises
    ------
    ConfigError
        if the backend cannot carry it.
    """
    name = rig.profile or DEFAULT_PROFILE.get(rig.backend, "standard")
    if directory is not None and (directory / name).is_file():
        name = str(directory / name)
    profile = load_profile(name)
    if profile.backends and rig.backend not in profile.backends:
        raise ConfigError(f"profile {name}: is for {', '.join(profile.backends)}, not for {rig.backend}")
    return profile


def make_link(
    rig: Rig,
    profile: Profile,
    *,
    more: Sequence[Backend] = (),
    seed: int = 0,
    factor: float = 0.0,
    external: bool = False,
    backend: Backend | None = None,
) -> Link:
    """The link of a rig, not yet open; ``more``: further transports, as a recording."""
    main = backend or make_backend(rig.backend, rig.options)
    return Link(profile, [main, *more], control=rig.control, trouble=list(rig.inject.items()), seed=seed, factor=factor,
                external=external)  # fmt: skip


def make_controller(
    rig: Rig, link: Link, *, lock_step: bool, interval: int = 1, must_answer: bool = False
) -> ExternalController:
    """The controller of a rig behind a link."""
    return ExternalController(link, lock_step=lock_step, timeout=rig.timeout, fail_safe=rig.fail_safe, patience=rig.patience,
                              interval=interval, must_answer=must_answer)  # fmt: skip


def _dies_with_us() -> Callable[[], object] | None:
    """What makes a child end when we are killed, as a campaign does with its workers: else it would stay, and keep the wire."""
    if sys.platform != "linux":
        return None
    import ctypes
    import signal

    prctl = ctypes.CDLL(None).prctl  # found here: between fork and exec nothing may be loaded
    return lambda: prctl(1, signal.SIGTERM)  # PR_SET_PDEATHSIG


class Process:
    """A controller that runs beside the bridge, in an environment of its own."""

    def __init__(self, command: str, directory: Path | None = None) -> None:
        """Start it."""
        environment = {key: value for key, value in os.environ.items()
                       if key not in ("_ROS_WHEELS_BOOTSTRAP_COMPLETE", "LD_LIBRARY_PATH")}  # fmt: skip  # of wheels of ROS 2
        try:
            self.child = subprocess.Popen(shlex.split(command), cwd=directory, env=environment, preexec_fn=_dies_with_us())
        except (OSError, ValueError) as error:
            raise ConfigError(f"start {command!r}: {getattr(error, 'strerror', None) or error}") from None
        atexit.register(self.end)

    def end(self) -> None:
        """Ask it to end; after two seconds, make it."""
        atexit.unregister(self.end)
        if self.child.poll() is None:
            self.child.terminate()
            try:
                self.child.wait(timeout=2.0)
            except subprocess.TimeoutExpired:
                self.child.kill()
                self.child.wait()


_LINKS: dict[str, Link] = {}  #: of this process, by rig file: a controller behind a wire is one, whoever asks for it
_PROCESSES: dict[str, Process] = {}


class RigPolicy(ExternalController):
    """An external controller that opens its link at the first reset; links and controllers end with this process.

    All policies of one rig file share link and controller, and fly one after the other.
    """

    def __init__(self, rig: Rig, directory: Path | None = None, key: str = "") -> None:
        """Check everything; nothing is opened yet."""
        link = _LINKS.get(key) or make_link(rig, profile_of(rig, directory))
        super().__init__(
            link,
            lock_step=True,
            timeout=rig.timeout,
            fail_safe=rig.fail_safe,
            patience=rig.patience,
            must_answer=True,
        )
        self._rig, self._directory, self._key = rig, directory, key

    def reset(self, info: dict[str, Any]) -> None:
        """Begin an episode; the first one opens the link and starts the controller."""
        if self._key not in _LINKS:
            self.link.open()
            _LINKS[self._key] = self.link
            atexit.register(close, self._key)
        if self._rig.start and (self._rig.restart or self._key not in _PROCESSES):
            if self._key in _PROCESSES:
                _PROCESSES.pop(self._key).end()
            _PROCESSES[self._key] = Process(self._rig.start, self._directory)
            self.ever = False  # it has to get ready
        self.link = _LINKS[self._key]
        super().reset(info)


def close(key: str = "") -> None:
    """End the controller of a rig file and close its link; without a key, all of them."""
    for each in [key] if key else list(_LINKS):
        if each in _PROCESSES:
            _PROCESSES.pop(each).end()
        if each in _LINKS:
            _LINKS.pop(each).close()


def policy(argument: str) -> RigPolicy:
    """The policy of ``hil:ARGUMENT``: a rig's YAML file.

    Raises
    ------
    ConfigError
        for anything wrong in it.
    """
    document = read_yaml(argument)
    rig = validate(Rig, document)
    if rig.backend not in BACKENDS:
        make_backend(rig.backend)  # says so
    return RigPolicy(rig, document.directory, str(Path(argument).resolve()))
