"""The report of a campaign: one HTML page that needs no network, its figures as SVG, replays of the worst cases beside it."""

from __future__ import annotations

import html
import shlex
from collections.abc import Iterable, Mapping, Sequence
from datetime import UTC, datetime
from importlib import resources
from pathlib import Path
from typing import Any

from ..config import ConfigError
from ..replay.archive import replacing
from ..scenarios.suites import Case
from .figures import NAMES, RULES, bearing_rose, clearance_histogram, score_boxes, speed_map, track_plot
from .flight import FAILED, Flight
from .runner import Fleet
from .summary import CLASSES, CONTACTS, SCORES, chance, claim, share

Row = Mapping[str, Any]

WORST = 12  #: cases that are drawn and can be replayed
FILM = "usv_gym.campaign.evidence:Film"
VERDICTS = {"pass": "PASS", "fail": "FAIL", "open": "NOT PROVEN", "none": ""}


def badness(row: Row) -> tuple[float, ...]:
    """What sorts the worst episodes to the front: contacts first, then the lowest scores and the nearest passes."""
    scores = [row.get(f"{name}_min") for name in SCORES]
    known = [score for score in scores if score is not None]
    closest = 1e9 if row["closest"] is None else float(row["closest"])
    safety = row.get("safety_min")
    return (row["outcome"] not in CONTACTS, not row.get("near_miss"), 1.0 if safety is None else safety,
            min(known, default=1.0), closest)  # fmt: skip


def worst_of(rows: Sequence[Row], count: int = WORST) -> list[Row]:
    """The worst episodes, of different cases as far as there are some, of all policies in turn."""
    policies = list(dict.fromkeys(row["policy"] for row in rows))
    queues = {}
    for name in policies:
        left = sorted((row for row in rows if row["policy"] == name and row["outcome"] != FAILED), key=badness)
        seen: dict[str, int] = {}
        keyed = []
        for row in left:
            seen[row["case"]] = seen.get(row["case"], 0) + 1
            keyed.append((badness(row)[0], seen[row["case"]], badness(row), row))
        queues[name] = [item[-1] for item in sorted(keyed, key=lambda item: item[:3])]
    chosen: list[Row] = []
    for k in range(count):
        chosen += [queue[k] for queue in queues.values() if k < len(queue)]
    return sorted(chosen[:count], key=badness)


def command_of(meta: Mapping[str, Any], row: Row, suite: str | None = None) -> str:
    """The command that does an episode again, exactly."""
    case = meta["cases"][row["case"]]
    scenario = case["scenario"]
    more = list(case.get("overrides", []))
    if case.get("difficulty") is not None:
        more.append(f"family.difficulty={case['difficulty']!r}")
    words = ["usv-gym", "run", str(scenario), "--policy", row["policy"], "--seed", str(row["seed"])]
    if not isinstance(scenario, str):
        words = ["usv-gym", "evaluate", "--suite", meta["source"], "--policy", row["policy"],
                 "--only", f"{row['case']}:{row['seed']}", "--out", "again"]  # fmt: skip
        more = []
    if meta["vessel"]:
        words += ["--vessel", meta["vessel"]]
    for override in more:
        words += ["--set", override]
    if meta["trust"]:
        words.append("--trust")
    return shlex.join(words)


def film_worst(directory: Path, meta: Mapping[str, Any], rows: Sequence[Row], workers: int | None) -> list[tuple[Row, Any]]:
    """Fly the worst episodes again with a camera; each must come out as it did before.

    Raises
    ------
    ConfigError
        if one does not: then something that is not in the seed decides, and the report would be wrong.
    """
    chosen = worst_of(rows)
    folder = directory / "replays"
    flights = []
    for k, row in enumerate(chosen):
        settings = {"directory": str(folder), "name": f"{k + 1:02d}", "meta": {"seed": row["seed"], "policy": row["policy"]}}
        case = Case(**meta["cases"][row["case"]])
        flights.append(Flight(row["policy"], case, (row["seed"],), meta["vessel"], meta["trust"], meta["step_limit"], FILM,
                              settings))  # fmt: skip
    folder.mkdir(parents=True, exist_ok=True)
    films = {}
    with Fleet(workers) as fleet:
        for result in fleet.fly(flights):
            films[result.key] = result
    out = []
    for row in chosen:
        again = films[row["policy"], row["case"], row["seed"]]
        same = (again.outcome, again.steps, again.closest) == (row["outcome"], row["steps"], row["closest"])
        if not same:
            raise ConfigError(
                f"report: {row['policy']}, {row['case']}, seed {row['seed']} came out otherwise when it was flown again "
                f"({row['outcome']} after {row['steps']} steps, then {again.outcome or again.cause} after {again.steps}): the "
                "controller depends on something besides its observations"
            )
        out.append((row, again.seen))
    return out


def write_report(
    directory: Path, meta: Mapping[str, Any], rows: Sequence[Row], summary: Mapping[str, Any], *, workers: int | None = None
) -> int:
    """Write ``report.html``, ``figures/`` and ``replays/``; returns the size of the page in bytes.

    Raises
    ------
    ConfigError
        if the directory cannot be written, or the worst cases do not repeat.
    """
    try:
        films = film_worst(directory, meta, rows, workers)
        text = page(meta, rows, summary, films, directory)
        with replacing(directory / "report.html") as file:
            file.write(text.encode())
    except OSError as error:
        raise ConfigError(f"{directory}: cannot be written: {error.strerror or error}") from None
    return len(text.encode())


def page(meta: Mapping[str, Any], rows: Sequence[Row], summary: Mapping[str, Any], films: Sequence[tuple[Row, Any]],
         directory: Path) -> str:  # fmt: skip
    """The page; leaves every figure as a file too."""
    css = resources.files(__package__).joinpath("report.css").read_text("utf-8")
    title = f"Collision-avoidance campaign: {meta['suite']}"
    policies = summary["policies"]
    parts = [
        f"<h1>{_e(title)}</h1><p class=soft>{_e(meta['description'])}</p>",
        _verdict(meta, rows, summary),
        _policy_table(policies),
        _paired(summary["paired"]),
        "<h2>Worst cases</h2><p class=soft>Own ship blue, ships orange, discs grey, north up; a ring where it came closest."
        " Each has been flown again and came out the same.</p>",
        f"<div class=worst>{''.join(_worst(meta, row, film) for row, film in films)}</div>",
    ]
    figures = directory / "figures"
    for k, (name, one) in enumerate(policies.items()):
        own = [row for row in rows if row["policy"] == name]
        parts.append(_policy(name, one, own, figures, opened=k == 0))
    parts += [_case_table(summary), _provenance(meta, summary)]
    body = "\n".join(part for part in parts if part)
    opener = "addEventListener('beforeprint',()=>document.querySelectorAll('details').forEach(d=>d.open=true))"
    return (f'<!doctype html><html lang="en"><head><meta charset="utf-8"><meta name="viewport" content="width=device-width, '
            f'initial-scale=1"><title>{_e(title)}</title><link rel="icon" href="data:,"><style>{css}</style></head>'
            f"<body>{body}<script>{opener}</script></body></html>")  # fmt: skip


def _e(text: Any) -> str:
    return html.escape(str(text))


# --- parts -----------------------------------------------------------------------------------------------------------
def _verdict(meta: Mapping[str, Any], rows: Sequence[Row], summary: Mapping[str, Any]) -> str:
    lines = []
    for name, one in summary["policies"].items():
        word = VERDICTS[one["verdict"]]
        badge = f'<span class="badge {one["verdict"]}">{word}</span>' if word else ""
        failed = f" {one['failed']['k']:,} episodes failed: see below." if one["failed"]["k"] else ""
        lines.append(f"<div class=verdict>{badge}<span><b>{_e(name)}</b>: {_e(claim(one))}.{failed}</span></div>")
    asked = summary["accept"]
    wanted = "" if asked is None else f"Accepted is a probability of a collision or grounding below {share(asked)}. "
    seeds = meta["seeds"]
    span = f"{seeds[0]} to {seeds[-1]}" if len(seeds) > 1 else str(seeds[0])
    mix = "this one case" if len(meta["cases"]) == 1 else f"this mix of {len(meta['cases'])} cases"
    return (f"<div class=card>{''.join(lines)}<p class=soft>{wanted}One-sided exact (Clopper-Pearson) bounds, for {mix}; "
            f"{len(rows):,} episodes in all, seeds {span}, every policy on the same noise. "
            f"usv-gym {_e(meta['versions']['usv_gym'])}, {datetime.now(UTC):%Y-%m-%d}.</p></div>")  # fmt: skip


def _rate(rate: Mapping[str, Any], *, hit: bool = True) -> str:
    if not rate["n"]:
        return "<td class=zero>-</td>"
    kind = ("hit" if rate["k"] else "zero") if hit else ""
    low, high = (f"{100 * rate[side]:.3g}" for side in ("low", "high"))
    return (f'<td class="{kind}">{100 * rate["rate"]:.3g} %<small>{low} to {high}</small>'
            f'<small>{rate["k"]:,} of {rate["n"]:,}</small></td>')  # fmt: skip


def _level(level: Mapping[str, Any], digits: int = 2) -> str:
    if not level["n"]:
        return "<td class=zero>-</td>"
    return f"<td>{level['mean']:.{digits}f}<small>{level['low']:.{digits}f} to {level['high']:.{digits}f}</small></td>"


def _table(heads: Iterable[str], lines: Iterable[str], caption: str = "") -> str:
    head = "".join(f"<th>{_e(h)}</th>" for h in heads)
    return f"{caption}<div class=scroll><table><thead><tr>{head}</tr></thead><tbody>{''.join(lines)}</tbody></table></div>"


def _policy_table(policies: Mapping[str, Any]) -> str:
    lines = []
    aground = ["grounding"] if any(one["grounding"]["k"] for one in policies.values()) else []
    for name, one in policies.items():
        cells = "".join(_rate(one[event]) for event in ("collision", *aground, "near_miss")) + _rate(one["success"], hit=False)
        cells += "".join(_level(one[score]) for score in SCORES)
        cells += _level(one["extra_time"], 0) + _level(one["rudder_activity"], 3)
        lines.append(f"<tr><td><b>{_e(name)}</b></td>{cells}</tr>")
    heads = ["policy", "collision", *aground, "near miss", "success", *RULES.values(), "extra time [s]", "rudder"]
    return "<h2>Policies</h2><div class=card>" + _table(heads, lines) + (
        "<p class=soft><small>Rates with exact 95 % intervals, means with bootstrap 95 % intervals. Scores after Hagen et al. "
        "2023, 1 is best, of encounters whose closest point was passed; Rules 9, 10, 18 and 19 are not judged."
        "</small></p></div>")  # fmt: skip


def _paired(pairs: Sequence[Mapping[str, Any]]) -> str:
    pairs = [pair for pair in pairs if pair["pairs"]]
    if not pairs:
        return ""
    lines = []
    for pair in pairs:
        cells = "".join(
            f"<td>{e['only_old']} : {e['only_new']}<small>{_e(chance(e['p']))}</small></td>"
            for e in (pair["events"][name] for name in ("collision", "near_miss", "success"))
        )
        for name in ("safety", "r8", "extra_time"):
            s = pair["numbers"].get(name)
            if s is None:
                cells += "<td class=zero>-</td>"
                continue
            p = "" if s["p"] is None else f", {_e(chance(s['p']))}"
            cells += f"<td>{s['mean']:+.3g}<small>{s['low']:+.3g} to {s['high']:+.3g}{p}</small></td>"
        lines.append(f"<tr><td>{_e(pair['old'])} : {_e(pair['new'])}</td><td>{pair['pairs']:,}</td>{cells}</tr>")
    heads = ["a : b", "pairs", "collision, a only : b only", "near miss", "success", "safety, b - a", "Rule 8, b - a",
             "extra time, b - a"]  # fmt: skip
    return "<h2>On the same noise</h2><div class=card>" + _table(heads, lines) + (
        "<p class=soft><small>Pairs of the same case and seed. Exact McNemar tests of what only one of the two had; mean "
        "differences with bootstrap intervals and Wilcoxon tests.</small></p></div>")  # fmt: skip


def _worst(meta: Mapping[str, Any], row: Row, film: Mapping[str, Any]) -> str:
    contact = row["outcome"] in CONTACTS
    closest = "nothing near" if row["closest"] is None else f"{row['closest']:.1f} m from {row['closest_to']}"
    what = f"<b>{_e(closest)}</b>"
    if contact:
        what = f"<b class=bad>{'aground' if row['outcome'] == 'grounding' else 'collision with ' + _e(row['closest_to'])}</b>"
    reasons = [e for e in row["encounters"] if e["complete"] or e["contact"]]
    reasons.sort(key=lambda e: min((e[s] for s in SCORES if e[s] is not None), default=1.0))
    why = "".join(f"<p>{_e(NAMES.get(e['class'], e['class']))}: {_e(e['why'])}</p>" for e in reasons[:1])
    end = f"{row['outcome'].replace('_', ' ')} at {row['time']:.0f} s"
    return (f"<div class=card>{track_plot(film, contact, row['closest_to'])}<div><p>{what}</p>"
            f"<p class=soft>{_e(row['case'])}, seed {row['seed']}, {_e(row['policy'])}; {end}</p>{why}"
            f'<p><a href="replays/{film["replay"]}">3-D replay</a></p>'
            f"<code>{_e(command_of(meta, row))}</code></div></div>")  # fmt: skip


def _policy(name: str, one: Mapping[str, Any], rows: Sequence[Row], figures: Path, *, opened: bool) -> str:
    encounters = [e for row in rows if row["outcome"] != FAILED for e in row["encounters"] if e["class"] in NAMES]
    closest = one["closest"]
    safe = one["safety"]
    tiles = [
        ("Episodes", f"{one['episodes']:,}", ""),
        ("Collisions / near misses", f"{one['collision']['k']:,} / {one['near_miss']['k']:,}",
         "bad" if one["collision"]["k"] else "good"),
        ("Success", f"{100 * (one['success']['rate'] or 0):.1f} %", ""),
        ("Median closest", f"{closest['quantiles'][2]:.0f} m" if closest["n"] else "-", ""),
        ("Safety score", f"{100 * safe['mean']:.0f} %" if safe["n"] else "-", ""),
        ("Encounters", f"{one['encounters']:,}", ""),
    ]  # fmt: skip
    cards = "".join(f'<div class=card><span>{a}</span><b class="{c}">{b}</b></div>' for a, b, c in tiles)
    out = [f"<div class=tiles>{cards}</div>"]
    if one["causes"]:
        causes = list(one["causes"].items())[:20]
        lines = [f"<tr><td style='white-space:normal'>{_e(cause)}</td><td>{n:,}</td></tr>" for cause, n in causes]
        out.append(f"<div class=card><h3 class=bad>Failed episodes</h3>{_table(['cause', 'episodes'], lines)}</div>")
    if encounters:
        out.append(f"<div class=card>{_class_table(one['classes'])}</div>")
        drawn = []
        for key, heading, draw in (("clearance", "Smallest distance", clearance_histogram), ("scores", "Scores", score_boxes),
                                   ("rose", "Encounters met: bearing and distance at the closest point", bearing_rose),
                                   ("speeds", "Encounters met: bearing and speeds", speed_map)):  # fmt: skip
            text = draw(encounters)
            stem = "".join(c if c.isalnum() or c in "-_" else "_" for c in name)
            with replacing(figures / f"{stem}-{key}.svg") as file:
                file.write(text.encode())
            drawn.append(f"<div class=card><h3>{heading}</h3>{text}</div>")
        out.append(f"<div class=figures>{''.join(drawn)}</div>")
    return f"<details{' open' if opened else ''}><summary>{_e(name)} in detail</summary>{''.join(out)}</details>"


def _class_table(classes: Mapping[str, Any]) -> str:
    lines = []
    for code in CLASSES:
        if code in classes:
            c = classes[code]
            cells = f"<td>{c['encounters']:,}</td>" + _rate(c["contact"]) + _level(c["clearance"], 0)
            cells += "".join(_level(c[score]) for score in SCORES)
            lines.append(f"<tr><td>{NAMES[code]}</td>{cells}</tr>")
    return _table(["encounter", "number", "contact", "distance [m]", *RULES.values()], lines)


def _case_table(summary: Mapping[str, Any]) -> str:
    cases = summary["cases"]
    if len(cases) < 2:
        return ""
    names = list(summary["policies"])
    lines = []
    for case, own in cases.items():
        cells = ""
        for name in names:
            rate = own[name]
            kind = "hit" if rate["k"] else "zero"
            cells += f"<td class={kind}>{rate['k']:,} <span class=soft>of {rate['n']:,}</span></td>"
        lines.append(f"<tr><td>{_e(case)}</td>{cells}</tr>")
    return f"<h2>Collisions and groundings by case</h2><div class=card>{_table(['case', *names], lines)}</div>"


def _provenance(meta: Mapping[str, Any], summary: Mapping[str, Any]) -> str:
    facts = {
        "suite": meta["suite"], "cases": ", ".join(meta["cases"]), "policies": ", ".join(meta["policies"]),
        "seeds": f"{len(meta['seeds'])}: {meta['seeds'][0]} to {meta['seeds'][-1]}",
        "vessel": meta["vessel"] or "as the scenarios say", "judge": meta["profile"],
        **{f"version of {name}": version for name, version in meta["versions"].items()},
    }  # fmt: skip
    body = "".join(f"<dt>{_e(key)}</dt><dd>{_e(value)}</dd>" for key, value in facts.items())
    hashes = "".join(f"<dt>{_e(key)}</dt><dd>{_e(value)}</dd>" for key, value in meta["identity"].items())
    return (f"<h2>What it was made of</h2><div class=card><dl>{body}</dl></div>"
            "<details><summary>Hashes of code, policies and cases</summary>"
            f"<div class=card><dl>{hashes}</dl></div></details>")  # fmt: skip
