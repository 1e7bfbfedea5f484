"""One message before the one wait: the first run on a machine compiles the kernels."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager

_told = False


@contextmanager
def compiling() -> Iterator[None]:
    """Around anything that may compile: says so once per process, on stderr, when no compiled kernels are on disk."""
    global _told
    if not _told:
        _told = True
        from ..jit import is_warm

        if not is_warm():
            print("usv_gym: compiling kernels for this machine, once (about a minute) ...", file=sys.stderr, flush=True)
    yield
