"""Two campaigns on the same cases and seeds: is the new one worse?  The gate of a pipeline."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..config import ConfigError
from ..replay.archive import plain
from .flight import FAILED
from .plan import read_campaign
from .summary import BETTER, chance, paired

if TYPE_CHECKING:
    from rich.console import Console


def compare_campaigns(old: Path, new: Path, *, alpha: float = 0.05, tolerance: float = 0.01) -> dict[str, Any]:
    """Compare the policies that both have; if each has one only, those two, whatever they are called.

    A policy is worse if more of its episodes failed, if a McNemar test (collision, grounding, near miss, success) says so, or
    if a mean score is lower by more than ``tolerance`` and its Wilcoxon test says so; ``alpha`` is for all tests of a policy
    together (Holm 1979).

    Raises
    ------
    ConfigError
        if a directory holds no campaign, or they have nothing in common.
    """
    if not 0.0 < alpha < 1.0:
        raise ConfigError(f"alpha: expected a number between 0 and 1, got {alpha:g}")
    (meta_a, rows_a), (meta_b, rows_b) = read_campaign(old), read_campaign(new)
    changed = [part for part, what in meta_a["identity"].items()
               if part.startswith("case ") and meta_b["identity"].get(part, what) != what]  # fmt: skip
    if changed:
        raise ConfigError(f"{new}: {changed[0]} is not what it is in {old}; only the same cases can be compared")
    names_a, names_b = meta_a["policies"], meta_b["policies"]
    if len(names_a) == len(names_b) == 1:
        pairs = [(names_a[0], names_b[0])]
    else:
        pairs = [(name, name) for name in names_a if name in names_b]
    if not pairs:
        raise ConfigError(f"{new}: has {', '.join(names_b)}; {old} has {', '.join(names_a)}: no policy in common")
    policies = {}
    regressions: list[str] = []
    for a, b in pairs:
        ours = [row for row in rows_a if row["policy"] == a]
        theirs = [row for row in rows_b if row["policy"] == b]
        result = paired(ours, theirs)
        result["failed"] = {"old": _failed(ours), "new": _failed(theirs)}
        if not result["pairs"] and not result["failed"]["new"]:
            raise ConfigError(f"{new}: has no case and seed in common with {old}")
        label = b if a == b else f"{a} -> {b}"
        result["findings"] = _findings(result, alpha, tolerance)
        regressions += [f"{label}: {f['what']}" for f in result["findings"] if f["worse"]]
        policies[label] = result
    return dict(plain({"old": str(old), "new": str(new), "alpha": alpha, "tolerance": tolerance, "policies": policies,
                       "regressions": regressions}))  # fmt: skip


def _failed(rows: Sequence[Mapping[str, Any]]) -> int:
    return sum(row["outcome"] == FAILED for row in rows)


def _findings(result: Mapping[str, Any], alpha: float, tolerance: float) -> list[dict[str, Any]]:
    """What changed for sure, better or worse."""
    tests: list[tuple[float, str, bool, str]] = []
    for name, event in result["events"].items():
        change = event["new"] - event["old"]
        tests.append((event["p"], name, change * BETTER[name] < 0, f"{_words(name)} {event['old']} -> {event['new']} "
                      f"of {result['pairs']} ({chance(event['p'])})"))  # fmt: skip
    for name, number in result["numbers"].items():
        p = number["p"] if number["p"] == number["p"] else 1.0
        worse = number["mean"] * BETTER[name] < 0
        known = worse and name in SCORED and abs(number["mean"]) <= tolerance
        tests.append((1.0 if known else p, name, worse and name in SCORED,
                      f"{_words(name)} {number['mean']:+.3g} ({chance(p)})"))  # fmt: skip
    found = []
    if result["failed"]["new"] > result["failed"]["old"]:
        found.append({"what": f"failed episodes {result['failed']['old']} -> {result['failed']['new']}", "worse": True})
    for k, (p, _, worse, text) in enumerate(sorted(tests)):
        if p > alpha / (len(tests) - k):
            break  # Holm: from here on nothing is sure
        found.append({"what": text, "worse": worse})
    return found


#: numbers whose loss is a regression; the rest is told, but efficiency may be what safety was paid with
SCORED = ("safety", "r8", "r13", "r14", "r15", "r16", "r17")


def _words(name: str) -> str:
    return name.replace("_", " ")


def print_comparison(result: Mapping[str, Any], console: Console) -> None:
    """A block for each policy."""
    from rich.markup import escape

    for label, one in result["policies"].items():
        console.print(f"[bold]{escape(label)}[/]: {one['pairs']:,} pairs", highlight=False)
        for name, event in one["events"].items():
            said = f"only old {event['only_old']}, only new {event['only_new']}, McNemar {chance(event['p'])}"
            console.print(f"  {_words(name):16} {event['old']} -> {event['new']}  {said}", highlight=False)
        for name, number in one["numbers"].items():
            said = "" if number["p"] is None else f", Wilcoxon {chance(number['p'])}"
            span = f"({number['low']:+.4g} to {number['high']:+.4g})"
            console.print(f"  {_words(name):16} {number['mean']:+.4g} {span}  n = {number['n']}{said}", highlight=False)
        for finding in one["findings"]:
            console.print(f"  {'[red]worse[/]' if finding['worse'] else '[green]changed[/]'}: {escape(finding['what'])}",
                          highlight=False)  # fmt: skip
    if result["regressions"]:
        console.print(f"[bold red]regression[/]: {escape('; '.join(result['regressions']))}", highlight=False)
    else:
        console.print("[bold green]no regression[/]")
