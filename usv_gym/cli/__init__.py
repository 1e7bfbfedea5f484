"""The command line, one module per group of commands; each registers its own with ``app``.

Exit codes: 0 done, 1 a check failed, 2 bad input (one clear line on stderr, no traceback, nothing half-written).
"""

from __future__ import annotations

import sys
import warnings

import typer

from . import campaign, check, files, hil, judge, run, scenarios, traffic, train, views  # noqa: F401  in the order of `usv-gym --help`
from .app import app, complain


@app.callback()
def _options() -> None:
    """usv-gym: a simulated sea for unmanned surface vehicles."""


def _short_warning(message: Warning | str, category: type[Warning], *_: object, **__: object) -> None:
    typer.echo(f"usv-gym: warning: {message}", err=True)


def main() -> None:
    """Entry point: errors of input, and what is not installed, become one line and exit code 2."""
    from ..config import ConfigError
    from ..replay.archive import ArchiveError

    warnings.showwarning = _short_warning
    try:
        app()
    except (ConfigError, ArchiveError) as error:
        complain(error)
        sys.exit(2)
    except Exception as error:
        from gymnasium.error import DependencyNotInstalled  # here, for it takes its time

        if not isinstance(error, DependencyNotInstalled):
            raise
        complain(error)
        sys.exit(2)
    except KeyboardInterrupt:
        complain(KeyboardInterrupt("interrupted; nothing was written"))
        sys.exit(130)
