"""Requirements in signal temporal logic, each with an id: the catalogue that ships, and those that users write in YAML."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import AfterValidator, Field

from ..config import ConfigError, Document, Model, locate, problem, read_yaml, validate
from .params import Params
from .signals import MODE, NAMES, SIGNALS, arguments_of, margins, signals, work_space
from .stl import Op, Program, compile_formula
from .trajectory import Floats, Trajectory

CATALOGUE = "colregs"  #: name of the file that ships


def _formula(text: str) -> str:
    try:
        compile_formula(text, NAMES)
    except ConfigError as error:
        raise problem(str(error)) from None
    return " ".join(text.split())


class Requirement(Model):
    """One requirement."""

    rule: int | None = Field(default=None, ge=1, le=38, description="of the COLREGs")
    text: str = Field(default="", description="in words")
    stl: Annotated[str, AfterValidator(_formula)]
    engine: Literal["kernel", "rtamt"] = Field(default="rtamt", description="who judges: both give the same margins")

    @property
    def program(self) -> Program:
        """The compiled formula."""
        return compile_formula(self.stl, NAMES)

    @property
    def of_pair(self) -> bool:
        """True if it speaks of the own ship and another; it then holds for every ship."""
        program = self.program
        used = program.arguments[program.ops == Op.SIGNAL, 0].astype(int)
        return any(SIGNALS[i].of_pair for i in used)


class RequirementFile(Model):
    """A file of requirements."""

    description: str = ""
    requirements: dict[str, Requirement]


def read_requirements(name: str, directory: Path | None = None) -> dict[str, Requirement]:
    """Requirements by id, of a file that ships (``colregs``) or by path.

    The shipped ones are judged by the compiled kernels; a user's by rtamt, unless they say ``engine: kernel``.

    Raises
    ------
    ConfigError
        a line for everything that is wrong in the file.
    """
    path = locate("requirements", name, directory, what="requirements")
    document = read_yaml(path)
    found = validate(RequirementFile, document).requirements
    if name == CATALOGUE:
        return {id: requirement.model_copy(update={"engine": "kernel"}) for id, requirement in found.items()}
    return found


def requirement(text: str, name: str = "formula") -> Requirement:
    """A requirement from a formula alone, judged by the kernels.

    Raises
    ------
    ConfigError
        what is wrong with the formula.
    """
    return validate(Requirement, Document(name, {"stl": text, "engine": "kernel"}))


@dataclass(eq=False)
class Margins:
    """Robustness margins of R requirements in B episodes with V vessel slots."""

    ids: tuple[str, ...]
    value: Floats  # [R, B, V] >= 0: fulfilled; NaN: no such ship.  Of the episode alone: in the own ship's column
    sample: NDArray[np.int64]  # [R, B, V] that decided it
    time: Floats  # [R, B, V] of that sample [s]

    def worst(self) -> tuple[Floats, NDArray[np.int64], Floats]:
        """(margin, ship, time) [R, B] of the least over the ships; NaN, -1, NaN where it applies to none."""
        least = np.where(np.isnan(self.value), np.inf, self.value)
        ship = least.argmin(axis=2)
        at = np.take_along_axis
        value, time = (at(a, ship[..., None], axis=2)[..., 0] for a in (least, self.time))
        none = value >= 0.5 * MODE
        return np.where(none, np.nan, value), np.where(none, -1, ship), np.where(none, np.nan, time)


def evaluate(x: Trajectory, requirements: Mapping[str, Requirement], params: Params | None = None) -> Margins:
    """Margins of requirements in all episodes of a trajectory, each by its engine.

    Raises
    ------
    ConfigError
        if a bound is no multiple of the control interval, or rtamt is wanted and not installed.
    """
    params = params or Params()
    all_ = list(requirements.values())
    dt = sample_interval(x)
    value, sample = _by_kernels(x, all_, dt, params)
    by_rtamt = [r for r, one in enumerate(all_) if one.engine == "rtamt"]
    if by_rtamt:
        from .oracle import decide

        for b in range(len(x)):
            for j in range(x.vessels):
                wanted = [r for r in by_rtamt if not np.isnan(value[r, b, j])]
                if not wanted or x.steps[b] < 2:  # rtamt knows no trace of one sample
                    continue
                known = signals(x, b, -1 if j == x.own[b] else j, params)
                for r in wanted:
                    value[r, b, j], sample[r, b, j] = decide(all_[r].stl, known, dt)
    time = np.where(sample >= 0, x.t[np.arange(len(x))[None, :, None], np.maximum(sample, 0)], np.nan)
    return Margins(tuple(requirements), value, sample, time)


def sample_interval(x: Trajectory) -> float:
    """Time between samples [s]: the control interval (the last one may be cut short by a contact)."""
    more = np.flatnonzero(x.steps > 1)
    return float(np.round((x.t[more, 1] - x.t[more, 0]).max(), 6)) if len(more) else 1.0


def _by_kernels(
    x: Trajectory, requirements: Sequence[Requirement], dt: float, params: Params
) -> tuple[Floats, NDArray[np.int64]]:
    programs = [one.program for one in requirements]
    R, B, V, T = len(programs), len(x), x.vessels, x.t.shape[1]
    out, when = np.full((R, B, V), np.nan), np.full((R, B, V), -1, np.int64)
    if R == 0 or B == 0:
        return out, when
    ops = np.concatenate([program.ops for program in programs])
    arguments: NDArray[Any] = np.concatenate([program.in_samples(dt) for program in programs])
    starts = np.concatenate([[0], np.cumsum([len(program.ops) for program in programs])])
    depth = max(program.depth for program in programs)
    of_pair = np.array([one.of_pair for one in requirements], np.int8)
    margins(*arguments_of(x, params), *work_space(T), np.zeros((len(NAMES), T)), of_pair, ops, arguments, starts,
            np.zeros((depth + 1, T)), np.zeros((3, T)), -1, out, when)  # fmt: skip
    return out, when


def verdict_word(margin: float) -> str:
    """``holds``, ``violated`` or, for a margin that is NaN, ``not applicable``."""
    return "not applicable" if math.isnan(margin) else "holds" if margin >= 0.0 else "violated"
