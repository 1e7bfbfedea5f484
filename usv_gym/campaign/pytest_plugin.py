"""pytest collects ``check_*.yaml`` as tests: one for each check in it."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest


def pytest_collect_file(file_path: Path, parent: pytest.Collector) -> pytest.Collector | None:
    """Take files of checks."""
    if file_path.suffix in (".yaml", ".yml") and file_path.name.startswith("check_"):
        collector: pytest.Collector = Checks.from_parent(parent, path=file_path)
        return collector
    return None


class Checks(pytest.File):
    """A file of checks."""

    def collect(self) -> Iterator[pytest.Item]:
        """One item per check."""
        from ..config import ConfigError
        from .checks import load_checks

        try:
            plans = load_checks(self.path)
        except ConfigError as error:
            raise self.CollectError(str(error)) from None
        for plan in plans:
            yield Item.from_parent(self, name=plan.name, plan=plan)


class CheckFailure(Exception):
    """A check that did not pass; the text says why."""


class Item(pytest.Item):
    """One check with all its seeds."""

    def __init__(self, *, plan: Any, **more: Any) -> None:
        super().__init__(**more)
        self.plan = plan
        for id in plan.requirements:
            self.user_properties.append(("requirement", id))

    def runtest(self) -> None:
        """Fly it."""
        from ..policies import POLICIES
        from .check_run import Verdict, faults, fly, rerun

        verdict = Verdict(self.path, self.plan, error=self.plan.error)
        # one's own controller may hang: it flies in a process of its own
        fly([verdict], workers=0 if self.plan.policy in POLICIES else 1)
        if verdict.status == "passed":
            return
        lines = [verdict.error] if verdict.error else []
        for result in verdict.results:
            wrong = faults(result)
            lines += [f"seed {result.seed}: {fault}" for fault in wrong]
            lines += [f"  {rerun(verdict, result.seed)}"] if wrong else []
        raise CheckFailure("\n".join(lines))

    def repr_failure(self, excinfo: pytest.ExceptionInfo[BaseException], style: Any = None) -> Any:
        """The faults alone, without a traceback through this module."""
        if isinstance(excinfo.value, CheckFailure):
            return str(excinfo.value)
        return super().repr_failure(excinfo, style)

    def reportinfo(self) -> tuple[Path, None, str]:
        """Where the check stands."""
        return self.path, None, f"{self.path.name}::{self.name}"
