"""What the rows of a campaign say: rates with exact intervals, scores with bootstrap intervals, policies beside each other."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..metrics.intervals import clopper_pearson, upper_bound
from ..metrics.paired import mcnemar, shift
from .flight import FAILED

Row = Mapping[str, Any]

CONFIDENCE = 0.95
SCORES = ("safety", "r8", "r13", "r14", "r15", "r16", "r17")
CLASSES = ("head_on", "crossing_give_way", "crossing_stand_on", "overtaking", "overtaken")
CONTACTS = ("collision", "grounding")  #: outcomes that a verdict is about
#: yes-or-no results of an episode
EVENTS: Mapping[str, Any] = {
    "collision": lambda row: row["outcome"] == "collision",
    "grounding": lambda row: row["outcome"] == "grounding",
    "contact": lambda row: row["outcome"] in CONTACTS,
    "near_miss": lambda row: bool(row.get("near_miss")),
    "success": lambda row: row["outcome"] == "arrival",
    "failed": lambda row: row["outcome"] == FAILED,
}
#: better when it is smaller (-1) or larger (1)
BETTER = {"collision": -1, "grounding": -1, "near_miss": -1, "success": 1, "failed": -1, "extra_time": -1, "extra_distance": -1,
          "rudder_activity": -1, "throttle_activity": -1, **dict.fromkeys(SCORES, 1)}  # fmt: skip
NUMBERS = (*SCORES, "extra_time", "extra_distance", "rudder_activity")


def rate(k: int, n: int) -> dict[str, Any]:
    """k of n with its exact (Clopper-Pearson) interval, and what it lies below, one-sided; at 95 %."""
    if n == 0:
        return {"k": 0, "n": 0, "rate": None, "low": None, "high": None, "below": None}
    low, high = clopper_pearson(k, n, CONFIDENCE)
    return {"k": k, "n": n, "rate": k / n, "low": low, "high": high, "below": upper_bound(k, n, CONFIDENCE)}


def values(rows: Iterable[Row], name: str) -> NDArray[np.float64]:
    """A number of each row, NaN where it is not known."""
    return np.array([np.nan if row.get(name) is None else float(row[name]) for row in rows])


def level(x: NDArray[np.float64]) -> dict[str, Any]:
    """Count, mean with a bootstrap interval, and quantiles of what is known of ``x``."""
    x = x[np.isfinite(x)]
    if not len(x):
        return {"n": 0}
    rng = np.random.default_rng(0)
    size = min(len(x), 4000)  # of a resample: the interval of many is that of few, scaled
    means = np.array([x[rng.integers(0, len(x), size)].mean() for _ in range(400)])
    spread = (np.percentile(means, [2.5, 97.5]) - x.mean()) * np.sqrt(size / len(x))
    return {
        "n": len(x), "mean": float(x.mean()), "low": float(x.mean() + spread[0]), "high": float(x.mean() + spread[1]),
        "quantiles": [float(q) for q in np.percentile(x, [5, 25, 50, 75, 95])],
    }  # fmt: skip


def of_policy(rows: Sequence[Row]) -> dict[str, Any]:
    """Rates, scores and effort of the episodes of one policy, in all and by class of encounter."""
    flown = [row for row in rows if row["outcome"] != FAILED]
    encounters = [e for row in flown for e in row["encounters"]]
    classes = {}
    for code in CLASSES:
        own = [e for e in encounters if e["class"] == code]
        if own:
            done = [e for e in own if e["complete"]]
            classes[code] = {
                "encounters": len(own), "contact": rate(sum(bool(e["contact"]) for e in own), len(own)),
                "clearance": level(values(own, "clearance")),
                **{name: level(values(done, name)) for name in SCORES},
            }  # fmt: skip
    causes: dict[str, int] = {}
    for row in rows:
        if row["cause"]:
            causes[row["cause"]] = causes.get(row["cause"], 0) + 1
    return {
        "episodes": len(rows), "flown": len(flown), "encounters": len(encounters),
        **{name: rate(sum(bool(test(row)) for row in (rows if name == "failed" else flown)),
                      len(rows) if name == "failed" else len(flown)) for name, test in EVENTS.items()},
        **{name: level(values(flown, name)) for name in NUMBERS},
        "closest": level(values(flown, "closest")),
        "classes": classes,
        "outcomes": {name: sum(row["outcome"] == name for row in rows) for name in sorted({row["outcome"] for row in rows})},
        "causes": causes,
    }  # fmt: skip


def paired(old: Sequence[Row], new: Sequence[Row]) -> dict[str, Any]:
    """What ``new`` did otherwise than ``old`` on the cases and seeds that both have flown."""
    ours = {(row["case"], row["seed"]): row for row in old if row["outcome"] != FAILED}
    pairs = [(ours[key], row) for row in new if row["outcome"] != FAILED and (key := (row["case"], row["seed"])) in ours]
    a, b = [pair[0] for pair in pairs], [pair[1] for pair in pairs]
    out: dict[str, Any] = {"pairs": len(pairs), "events": {}, "numbers": {}}
    if not pairs:
        return out
    aground = any(map(EVENTS["grounding"], a + b))
    for name in ("collision", *(["grounding"] if aground else []), "near_miss", "success"):
        test = EVENTS[name]
        d = mcnemar([test(row) for row in a], [test(row) for row in b])
        out["events"][name] = {"old": d.both + d.only_a, "new": d.both + d.only_b, "only_old": d.only_a, "only_new": d.only_b,
                               "p": d.p}  # fmt: skip
    for name in NUMBERS:
        s = shift(values(a, name), values(b, name))
        if s.n:
            out["numbers"][name] = {"n": s.n, "mean": s.mean, "low": s.low, "high": s.high, "p": s.p}
    return out


def summarise(meta: Mapping[str, Any], rows: Sequence[Row], accept: float | None = None) -> dict[str, Any]:
    """Everything that the report says in numbers.

    ``accept`` is the largest probability of a collision or grounding that is acceptable; the verdict on a policy is then
    ``pass`` if the probability is below it at 95 %, ``fail`` if it is above, else ``open``.
    """
    by_policy = {name: [row for row in rows if row["policy"] == name] for name in meta["policies"]}
    by_policy = {name: own for name, own in by_policy.items() if own}
    names = list(by_policy)
    policies = {name: of_policy(own) for name, own in by_policy.items()}
    for one in policies.values():
        one["verdict"] = verdict(one, accept)
    return {
        "suite": meta["suite"], "accept": accept, "confidence": CONFIDENCE, "policies": policies,
        "cases": {case: {name: _contacts([row for row in own if row["case"] == case]) for name, own in by_policy.items()}
                  for case in meta["cases"]},
        "paired": [{"old": a, "new": b, **paired(by_policy[a], by_policy[b])}
                   for i, a in enumerate(names) for b in names[i + 1 :]],
    }  # fmt: skip


def _contacts(rows: Sequence[Row]) -> dict[str, Any]:
    return rate(sum(row["outcome"] in CONTACTS for row in rows), sum(row["outcome"] != FAILED for row in rows))


def verdict(policy: Mapping[str, Any], accept: float | None) -> str:
    """``pass``, ``fail`` or ``open``; without ``accept``, ``none``, and ``fail`` only for episodes that failed."""
    if policy["failed"]["k"]:
        return "fail"
    if accept is None:
        return "none"
    contact = policy["contact"]
    if contact["n"] == 0:
        return "open"
    if contact["below"] < accept:
        return "pass"
    low = clopper_pearson(contact["k"], contact["n"], 2 * CONFIDENCE - 1)[0]
    return "fail" if low > accept else "open"


def claim(policy: Mapping[str, Any]) -> str:
    """What the collisions and groundings of a policy prove, in one sentence."""
    c = policy["contact"]
    if not c["n"]:
        return "no episode was flown to its end"

    def count(name: str) -> str:
        return f"{policy[name]['k']:,} {name}{'' if policy[name]['k'] == 1 else 's'}"

    aground = f" and {count('grounding')}" if policy["grounding"]["k"] else ""
    found = f"{count('collision')}{aground} in {c['n']:,} {'episode' if c['n'] == 1 else 'episodes'}"
    what = "probability of either" if aground else "collision probability"
    if c["rate"] > 0.1:  # nothing that anyone would want to claim
        return f"{found}: the {what} is {100 * c['low']:.3g} to {100 * c['high']:.3g} % (95 %)"
    return f"{found}: the {what} is below {share(c['below'])} at 95 %"


def chance(p: float) -> str:
    """``p = 0.021``; what is too small for a number is not called zero."""
    return f"p = {p:.2g}" if p > 0.0 else "p < 1e-300"


def share(x: float) -> str:
    """A rate in percent with two significant digits, rounded up: a claim must not get better by rounding."""
    if x <= 0.0:
        return "0 %"
    digits = max(1 - int(np.floor(np.log10(100.0 * x))), 0)
    return f"{np.ceil(100.0 * x * 10**digits) / 10**digits:.{digits}f} %"
