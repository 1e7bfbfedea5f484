"""What checks leave behind: a table for people, JUnit XML for CI, and which requirement was checked where."""

from __future__ import annotations

import csv
import io
import xml.etree.ElementTree as ET
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.markup import escape
from rich.table import Table

from ..colregs.requirements import CATALOGUE, Requirement, read_requirements
from ..config import ConfigError
from ..replay.archive import replacing
from .check_run import Verdict, faults, findings, rerun
from .flight import FAILED

_COLOURS = {"passed": "green", "failed": "red", "error": "magenta"}


def print_table(verdicts: Sequence[Verdict], console: Console, most: int = 3) -> None:
    """A row per check, then what went wrong in the first ``most`` episodes of each."""
    table = Table(box=None, pad_edge=False)
    for heading in ("check", "policy", "episodes", "fulfilled", "verdict"):
        table.add_column(heading, justify="right" if heading in ("episodes", "fulfilled") else "left")
    for v in verdicts:
        status = f"[{_COLOURS[v.status]}]{v.status}[/]"
        policy = v.plan.check.policy if v.plan is not None else ""
        episodes = str(len(v.results)) if v.results else ""
        table.add_row(escape(v.name), escape(policy), episodes, str(v.passed) if v.results else "", status)
    console.print(table)
    for v in verdicts:
        if v.error:
            console.print(f"\n[bold]{escape(v.name)}[/]\n  {escape(v.error)}")
            continue
        bad = [result for result in v.results if faults(result)]
        if bad:
            console.print(f"\n[bold]{escape(v.name)}[/]: {len(bad)} of {len(v.results)} episodes")
        for result in bad[:most]:
            for fault in faults(result):
                console.print(f"  seed {result.seed}: {escape(fault)}", highlight=False)
            console.print(f"    {escape(rerun(v, result.seed))}", style="dim", highlight=False)
        if len(bad) > most:
            console.print(f"  and {len(bad) - most} more")


def junit(verdicts: Sequence[Verdict]) -> bytes:
    """JUnit XML: a suite per file, a case per episode, an error for what could not be judged."""
    root = ET.Element("testsuites", name="usv-gym check")
    for file in dict.fromkeys(v.file for v in verdicts):
        suite = ET.SubElement(root, "testsuite", name=str(file))
        for v in verdicts:
            if v.file == file:
                _cases(suite, v)
        for name, tag in (("failures", "failure"), ("errors", "error")):
            suite.set(name, str(len(suite.findall(f"testcase/{tag}"))))
        suite.set("tests", str(len(suite.findall("testcase"))))
        suite.set("time", f"{sum(result.wall for v in verdicts if v.file == file for result in v.results):.3f}")
    ET.indent(root)
    text: bytes = ET.tostring(root, encoding="utf-8", xml_declaration=True)
    return text + b"\n"


def _cases(suite: ET.Element, v: Verdict) -> None:
    name = v.plan.name if v.plan is not None else "file"
    if v.error:
        case = ET.SubElement(suite, "testcase", classname=str(v.file), name=name)
        ET.SubElement(case, "error", message=_clean(v.error.splitlines()[0])).text = _clean(v.error)
        return
    for result in v.results:
        case = ET.SubElement(suite, "testcase", classname=str(v.file), name=f"{name}[{result.seed}]", time=f"{result.wall:.3f}")
        assert v.plan is not None
        if v.plan.requirements:
            properties = ET.SubElement(case, "properties")
            for id in v.plan.requirements:
                ET.SubElement(properties, "property", name="requirement", value=id)
        wrong = faults(result)
        if wrong and v.status != "passed":
            tag = "error" if result.outcome == FAILED else "failure"
            text = "\n".join([*wrong, rerun(v, result.seed)])
            ET.SubElement(case, tag, message=_clean(wrong[0])).text = _clean(text)


def _clean(text: str) -> str:
    """Text without what XML cannot hold."""
    return "".join(c if c.isprintable() or c in "\n\t" else "?" for c in text)


#: columns of the traceability table
TRACE = ("requirement", "rule", "check", "policy", "episodes", "holds", "violated", "not applicable", "worst margin",
         "worst seed", "verdict", "text")  # fmt: skip


def trace(verdicts: Sequence[Verdict]) -> list[dict[str, Any]]:
    """Requirement -> check -> verdict: a row for each pair, and one for every shipped requirement that nothing checks."""
    known: dict[str, Requirement] = dict(read_requirements(CATALOGUE))
    for v in verdicts:
        if v.plan is not None:
            known |= v.plan.requirements
    rows = []
    for id, one in known.items():
        head = {"requirement": id, "rule": "" if one.rule is None else one.rule, "text": one.text}
        asking = [v for v in verdicts if v.plan is not None and id in v.plan.requirements]
        rows += [{**head, **_traced(id, v)} for v in asking]
        if not asking:
            rows.append({**dict.fromkeys(TRACE, ""), **head, "verdict": "not checked"})
    return rows


def _traced(id: str, v: Verdict) -> dict[str, Any]:
    assert v.plan is not None
    found = [(finding, result.seed) for result in v.results if result.outcome != FAILED
             for finding in findings(result) if finding["what"] == id]  # fmt: skip
    applied = [(finding["value"], seed) for finding, seed in found if finding["ok"] is not None]
    violated = sum(finding["ok"] is False for finding, _ in found)
    worst = min(applied, default=("", ""))
    broken = sum(result.outcome == FAILED for result in v.results)
    if v.error or broken:
        verdict = "error"
    elif violated:
        verdict = "violated"
    else:
        verdict = "holds" if applied else "not exercised"
    return {
        "check": v.name, "policy": v.plan.check.policy, "episodes": len(v.results), "holds": len(applied) - violated,
        "violated": violated, "not applicable": len(found) - len(applied),
        "worst margin": f"{worst[0]:.3g}" if applied else "", "worst seed": worst[1], "verdict": verdict,
    }  # fmt: skip


def write_trace(verdicts: Sequence[Verdict], path: Path) -> None:
    """Write the traceability table, as Markdown or CSV by the name of the file.

    Raises
    ------
    ConfigError
        for any other ending.
    """
    rows = trace(verdicts)
    if path.suffix.lower() == ".csv":
        buffer = io.StringIO()
        writer = csv.DictWriter(buffer, TRACE, lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)
        text = buffer.getvalue()
    elif path.suffix.lower() == ".md":
        lines = [TRACE, ["---"] * len(TRACE), *([row[name] for name in TRACE] for row in rows)]
        text = "".join("| " + " | ".join(str(cell).replace("|", "\\|") for cell in line) + " |\n" for line in lines)
    else:
        raise ConfigError(f"{path}: expected a file that ends in .md or .csv")
    with replacing(path) as file:
        file.write(text.encode())
