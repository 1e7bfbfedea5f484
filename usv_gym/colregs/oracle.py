"""rtamt as judge of formulas: the engine of users' requirements, and what our kernels are tested against."""

from __future__ import annotations

import functools
import logging
import sys
import typing
from collections.abc import Mapping
from typing import Any

from ..config import ConfigError
from .stl import Op, compile_formula
from .trajectory import Floats


def load_rtamt() -> Any:
    """The module rtamt.

    Raises
    ------
    ConfigError
        if it is not installed.
    """
    # its parser runtime (antlr4 4.7) asks for typing.io, which Python 3.13 has no more and earlier ones warn of
    before = sys.modules.get("typing.io")
    sys.modules["typing.io"] = typing
    try:
        import rtamt
    except ImportError as error:
        raise ConfigError(
            f"rtamt is not installed ({error}); pip install 'usv-gym[verify]', or say `engine: kernel`"
        ) from None
    finally:
        if before is None:
            del sys.modules["typing.io"]
        else:
            sys.modules["typing.io"] = before
    return rtamt


@functools.lru_cache(maxsize=256)
def _specification(text: str, variables: tuple[str, ...], dt_us: int) -> Any:
    """A parsed formula; parsing takes ten times as long as judging an episode by it."""
    rtamt = load_rtamt()
    specification = rtamt.StlDiscreteTimeSpecification()
    for name in variables:
        specification.declare_var(name, "float")
    specification.set_sampling_period(dt_us, "us", 0.1)
    specification.spec = text
    logging.disable(logging.WARNING)
    try:
        specification.parse()
    except rtamt.RTAMTException as error:
        raise ConfigError(f"{text!r}: rtamt: {error}") from None
    finally:
        logging.disable(logging.NOTSET)
    return specification


def robustness(text: str, signals: Mapping[str, Floats], dt: float) -> list[float]:
    """Robustness of a formula at every sample, by rtamt.

    Parameters
    ----------
    text
        the formula; bounds in seconds.
    signals
        by name, all of the same length of at least 2.
    dt
        time between samples [s].

    Raises
    ------
    ConfigError
        if the formula is wrong, or rtamt is not installed.
    """
    names = list(signals)
    program = compile_formula(text, names)
    used = {names[int(i)] for i in program.arguments[program.ops == Op.SIGNAL, 0]}
    specification = _specification(text, tuple(sorted(used)), round(dt * 1e6))
    n = len(signals[names[0]])
    data = {"time": [k * dt for k in range(n)], **{name: signals[name].tolist() for name in used}}
    return [float(value) for _, value in specification.evaluate(data)]


def decide(text: str, signals: Mapping[str, Floats], dt: float) -> tuple[float, int]:
    """(robustness at the start, the sample that decided it); of a formula without a leading ``always`` that sample is 0."""
    program = compile_formula(text, list(signals))
    if program.ops[-1] == Op.ALWAYS and program.arguments[-1, 1] < 0:
        trace = robustness(text.strip().removeprefix("always"), signals, dt)
        return min(trace), trace.index(min(trace))
    return robustness(text, signals, dt)[0], 0
