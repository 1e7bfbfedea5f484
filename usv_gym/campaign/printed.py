"""What `usv-gym evaluate` shows on a terminal: a bar while it flies, tables when it is done."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from .evaluate import Progress
from .flight import FAILED, Result
from .summary import SCORES, claim

if TYPE_CHECKING:
    from rich.console import Console


@contextmanager
def progress_bar(console: Console) -> Iterator[Progress]:
    """A bar that counts episodes, collisions and failures; without a terminal, a line every tenth."""
    counts = {"collision": 0, "grounding": 0, FAILED: 0}

    def count(result: Result | None) -> str:
        if result is not None and result.outcome in counts:
            counts[result.outcome] += 1
        aground = f"groundings {counts['grounding']}  " if counts["grounding"] else ""
        return f"collisions {counts['collision']}  {aground}failed {counts[FAILED]}"

    if console.is_terminal:
        from rich.progress import BarColumn, TextColumn, TimeElapsedColumn, TimeRemainingColumn
        from rich.progress import Progress as Bar

        columns = (TextColumn("{task.description}"), BarColumn(), TextColumn("{task.completed:,} of {task.total:,} episodes"),
                   TimeElapsedColumn(), TimeRemainingColumn())  # fmt: skip
        with Bar(*columns, console=console, transient=True) as bar:
            task = bar.add_task("starting", total=None)
            yield lambda done, total, result: bar.update(task, completed=done, total=total, description=count(result))
        return
    told = 0

    def tell(done: int, total: int, result: Result | None) -> None:
        nonlocal told
        said = count(result)
        if total and 10 * done // total > told:
            told = 10 * done // total
            console.print(f"{done:,} of {total:,} episodes  {said}", highlight=False)

    yield tell


def print_summary(summary: Mapping[str, Any], console: Console) -> None:
    """The verdict, a line for each policy, and why episodes failed."""
    from rich.markup import escape
    from rich.table import Table

    for name, one in summary["policies"].items():
        colour = {"pass": "green", "fail": "red"}.get(one["verdict"], "yellow")
        word = "" if one["verdict"] == "none" else f"[bold {colour}]{one['verdict'].upper()}[/] "
        console.print(f"{word}[bold]{escape(name)}[/]: {claim(one)}", highlight=False)
        for cause, n in list(one["causes"].items())[:5]:
            console.print(f"  {n} failed: {escape(cause)}", highlight=False)
        if len(one["causes"]) > 5:
            console.print(f"  and {len(one['causes']) - 5} other causes: summary.json has them", highlight=False)
    table = Table(box=None, pad_edge=False)
    heads = ("policy", "episodes", "collision (95 %)", "near miss", "success (95 %)", *SCORES)
    for heading in heads:
        table.add_column(heading, justify="left" if heading == "policy" else "right", no_wrap=heading == "policy")
    for name, one in summary["policies"].items():
        table.add_row(escape(name), f"{one['flown']:,}", interval(one["collision"]), interval(one["near_miss"], False),
                      interval(one["success"]),
                      *(f"{one[s]['mean']:.2f}" if one[s]["n"] else "-" for s in SCORES))  # fmt: skip
    console.print(table)


def interval(rate: Mapping[str, Any], both: bool = True) -> str:
    """``1.2 % (0.8 to 1.7)``."""
    if not rate["n"]:
        return "-"
    share, low, high = (f"{100 * rate[key]:.3g}" for key in ("rate", "low", "high"))
    return f"{share} % ({low} to {high})" if both else f"{share} %"
