"""Files that ship with the package: ``configs/`` and ``ros/`` stand at the top of the repository and inside the wheel."""

from __future__ import annotations

import functools
from pathlib import Path


@functools.cache
def configs() -> Path:
    """Directory with vessels/, sensors/, tasks/, scenarios/ and suites/."""
    package = Path(__file__).parent
    inside = package / "configs"
    return inside if inside.is_dir() else package.parent / "configs"


def shipped(kind: str) -> dict[str, Path]:
    """Name -> path of what ships in ``configs/<kind>``, sorted by name; in a directory below it: ``directory/name``."""
    top = configs() / kind
    return {path.relative_to(top).with_suffix("").as_posix(): path for path in sorted(top.rglob("*.yaml"))}


@functools.cache
def ros() -> Path:
    """Directory with the ROS packages: definitions of messages, launch files, recipes."""
    package = Path(__file__).parent
    inside = package / "ros"
    return inside if inside.is_dir() else package.parent / "ros"
