"""One message before the one wait: the first run of a size of world on a machine compiles the kernels."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from numba.core import event


class _Notice(event.Listener):
    """Speaks up at the first compilation that it sees."""

    told = False

    def on_start(self, event: Any) -> None:
        """Say it, once."""
        if not self.told:
            self.told = True
            print("usv_gym: compiling kernels for this machine, once (about a minute) ...", file=sys.stderr, flush=True)

    def on_end(self, event: Any) -> None:
        """Nothing."""


@contextmanager
def compiling() -> Iterator[None]:
    """Around anything that may compile: says so on stderr if it does, that is if no compiled kernels are on disk."""
    with event.install_listener("numba:compile", _Notice()):
        yield
