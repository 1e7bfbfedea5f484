"""The figures of a report as SVG, each a function from rows to text.  Text and grid take the colour of the page."""

from __future__ import annotations

import html
import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from .summary import CLASSES, values

Encounters = Sequence[Mapping[str, Any]]

NAMES = {"head_on": "Head-on", "crossing_give_way": "Crossing, give way", "crossing_stand_on": "Crossing, stand on",
         "overtaking": "Overtaking", "overtaken": "Overtaken"}  # fmt: skip
COLOURS = {"head_on": "#4c6ef5", "crossing_give_way": "#f76707", "crossing_stand_on": "#12b886", "overtaking": "#ae3ec9",
           "overtaken": "#1098ad"}  # fmt: skip
RED, AMBER, OWN, TARGET, DISC = "#e03131", "#f59f00", "#2563c9", "#d9480f", "#94a3b8"
RULES = {"safety": "Safety", "r8": "Rule 8", "r13": "Rule 13", "r14": "Rule 14", "r15": "Rule 15", "r16": "Rule 16",
         "r17": "Rule 17"}  # fmt: skip
WIDTH, LEFT, RIGHT = 460.0, 44.0, 12.0


def svg(width: float, height: float, body: str, label: str) -> str:
    """A figure that scales with its place."""
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width:g} {height:g}" role="img" '
        f'aria-label="{html.escape(label)}" font-family="system-ui, sans-serif" font-size="11">{body}</svg>'
    )


def _text(x: float, y: float, text: str, anchor: str = "middle", more: str = "") -> str:
    return f'<text x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}" fill="currentColor" {more}>{html.escape(text)}</text>'


def _line(x1: float, y1: float, x2: float, y2: float, more: str = 'stroke="currentColor" stroke-opacity=".15"') -> str:
    return f'<path d="M{x1:.1f} {y1:.1f}L{x2:.1f} {y2:.1f}" {more}/>'


def _box(x: float, y: float, w: float, h: float, more: str) -> str:
    return f'<rect x="{x:.1f}" y="{y:.1f}" width="{max(w, 0.0):.1f}" height="{max(h, 0.0):.1f}" {more}/>'


def nice(high: float, parts: int = 5) -> list[float]:
    """Round marks from 0 to at least ``high``."""
    raw = max(high, 1e-9) / parts
    unit = 10.0 ** math.floor(math.log10(raw))
    step = next(m * unit for m in (1.0, 2.0, 2.5, 5.0, 10.0) if m * unit >= raw * (1 - 1e-9))
    return [step * k for k in range(math.ceil(high / step - 1e-9) + 1)]


def legend(there: Sequence[str], x: float, y: float, width: float) -> tuple[str, float]:
    """Colours of the classes in lines of at most ``width``; returns where they end."""
    out, at = "", x
    for code in there:
        name = NAMES[code]
        wide = 24.0 + 6.0 * len(name)
        if at + wide > x + width:
            at, y = x, y + 16.0
        out += _box(at, y - 9.0, 10.0, 10.0, f'rx="2" fill="{COLOURS[code]}"') + _text(at + 14.0, y, name, "start")
        at += wide
    return out, y


def clearance_histogram(encounters: Encounters) -> str:
    """How near vessels came: smallest hull distance of each encounter, stacked by class; contacts are red."""
    there = [code for code in CLASSES if any(e["class"] == code for e in encounters)]
    x = values(encounters, "clearance")
    known = x[np.isfinite(x)]
    top = nice(float(np.percentile(known, 97)) if len(known) else 100.0)[-1] or 10.0
    edges = np.linspace(0.0, top, 21)
    stack = np.zeros(20)
    keys, below = legend(there, LEFT, 14.0, WIDTH - LEFT - RIGHT)
    y0, y1 = 262.0, below + 16.0
    missed = [e for e in encounters if not e["contact"] and e["clearance"] is not None]
    counts = {}
    for code in there:
        own = [e["clearance"] for e in missed if e["class"] == code]
        counts[code] = np.histogram(np.minimum(own, top * 0.999), edges)[0]
    hits = np.zeros(20)
    hits[0] = sum(bool(e["contact"]) for e in encounters)
    total = hits + sum(counts.values(), np.zeros(20))
    ticks = nice(float(total.max()) if len(known) else 1.0, 4)
    scale, step = (y0 - y1) / ticks[-1], (WIDTH - LEFT - RIGHT) / 20
    body = keys
    for tick in ticks:
        y = y0 - tick * scale
        body += _line(LEFT, y, WIDTH - RIGHT, y) + _text(LEFT - 6.0, y + 4.0, f"{tick:g}", "end")
    for count, colour in [(hits, RED), *((counts[code], COLOURS[code]) for code in there)]:
        for i in range(20):
            if count[i]:
                h = count[i] * scale
                body += _box(LEFT + i * step + 1.0, y0 - stack[i] * scale - h, step - 2.0, h, f'fill="{colour}"')
        stack += count
    for k in range(0, 21, 4):
        more = "+" if k == 20 and len(known) and known.max() > top else ""
        body += _text(LEFT + k * step, y0 + 16.0, f"{edges[k]:g}{more}")
    body += _text((LEFT + WIDTH) / 2, y0 + 34.0, "smallest distance between the hulls [m]")
    return svg(WIDTH, y0 + 42.0, body, "Histogram of the smallest distance of every encounter")


def score_boxes(encounters: Encounters) -> str:
    """Distributions of the scores by class: 5, 25, 50, 75 and 95 % quantiles."""
    there = [code for code in CLASSES if any(e["class"] == code for e in encounters)]
    keys, y = legend(there, 64.0, 14.0, WIDTH - 64.0 - RIGHT)
    left, y = 64.0, y + 20.0
    top, scale = y - 6.0, WIDTH - 64.0 - RIGHT - 8.0
    body = ""
    for score, name in RULES.items():
        lines = []
        for code in there:
            x = values([e for e in encounters if e["class"] == code and e["complete"]], score)
            x = x[np.isfinite(x)]
            if len(x):
                lines.append((COLOURS[code], np.percentile(x, [5, 25, 50, 75, 95])))
        if not lines:
            continue
        body += _text(left - 8.0, y + 6.5 * len(lines), name, "end")
        for colour, q in lines:
            x5, x25, x50, x75, x95 = (left + scale * float(v) for v in q)
            body += _line(x5, y + 4.0, x95, y + 4.0, f'stroke="{colour}" stroke-width="1.5"')
            body += _box(x25, y, max(x75 - x25, 1.0), 8.0, f'fill="{colour}" fill-opacity=".45"')
            body += _line(x50, y - 1.0, x50, y + 9.0, 'stroke="currentColor" stroke-width="2"')
            y += 12.0
        y += 9.0
    for k in range(5):
        mark = left + scale * k / 4
        body = _line(mark, top, mark, y) + body + _text(mark, y + 16.0, f"{k / 4:g}")
    body += _text(left + scale / 2, y + 34.0, "score (lines 5 to 95 %, boxes 25 to 75 %, marks 50 %)")
    return svg(WIDTH, y + 42.0, keys + body, "Distributions of the scores by class of encounter")


def _coverage(count: int, most: int) -> str:
    return f'fill="{OWN}" fill-opacity="{0.08 + 0.72 * math.log1p(count) / math.log1p(most):.2f}"' if count else 'fill="none"'


def failed_of(e: Mapping[str, Any]) -> str:
    """Colour of an encounter that went wrong: contact, or unsafe; "" for any other."""
    if e["contact"]:
        return RED
    return AMBER if e["safety"] is not None and e["safety"] < 0.5 and e["complete"] else ""


def bearing_rose(encounters: Encounters) -> str:
    """Where encounters began: relative bearing around, distance at the closest point outwards; and which went wrong."""
    sectors, rings = 24, 6
    beta, dcpa = values(encounters, "start_beta_deg") % 360.0, values(encounters, "start_dcpa")
    good = np.isfinite(beta) & np.isfinite(dcpa)
    far = nice(float(max(np.percentile(dcpa[good], 95), 12.0)) if good.any() else 100.0, rings)
    top, rings = far[-1], len(far) - 1
    cx, cy, radius = WIDTH / 2, 176.0, 142.0
    i = (np.round(beta / (360.0 / sectors)).astype(float) % sectors)[good].astype(int)
    j = np.minimum((dcpa[good] / top * rings).astype(int), rings - 1)
    table = np.zeros((sectors, rings), int)
    np.add.at(table, (i, j), 1)
    body = ""
    for s in range(sectors):
        a0, a1 = (math.radians(360.0 / sectors * (s + d)) for d in (-0.5, 0.5))
        for r in range(rings):
            r0, r1 = radius * r / rings, radius * (r + 1) / rings
            (x0, y0), (x1, y1) = ((math.sin(a), -math.cos(a)) for a in (a0, a1))
            body += (
                f'<path d="M{cx + r0 * x0:.1f} {cy + r0 * y0:.1f}L{cx + r1 * x0:.1f} {cy + r1 * y0:.1f}'
                f'A{r1:.1f} {r1:.1f} 0 0 1 {cx + r1 * x1:.1f} {cy + r1 * y1:.1f}L{cx + r0 * x1:.1f} {cy + r0 * y1:.1f}'
                f'A{r0:.1f} {r0:.1f} 0 0 0 {cx + r0 * x0:.1f} {cy + r0 * y0:.1f}Z" stroke="currentColor" stroke-opacity=".12" '
                f'{_coverage(int(table[s, r]), int(table.max()))}><title>{table[s, r]} encounters</title></path>'
            )
    bad = [(e, colour) for e in encounters if (colour := failed_of(e)) and e["start_dcpa"] is not None]
    for e, colour in sorted(bad, key=lambda pair: pair[1] == RED)[-400:]:
        a, r = math.radians(e["start_beta_deg"]), radius * min(e["start_dcpa"] / top, 0.985)
        body += f'<circle cx="{cx + r * math.sin(a):.1f}" cy="{cy - r * math.cos(a):.1f}" r="2.6" fill="{colour}"/>'
    for degrees, name in ((0, "ahead"), (90, "starboard"), (180, "astern"), (270, "port")):
        a = math.radians(degrees)
        anchor = "middle" if degrees % 180 == 0 else "start" if degrees == 90 else "end"
        body += _text(cx + (radius + 8) * math.sin(a), cy - (radius + 12) * math.cos(a) + 4.0, name, anchor)
    for r in (rings // 2, rings):
        body += _text(cx + 4.0, cy - radius * r / rings + 11.0, f"{far[r]:g} m", "start", 'font-weight="600" font-size="10"')
    body += f'<path d="M{cx} {cy - 9}L{cx + 5} {cy + 7}L{cx} {cy + 3}L{cx - 5} {cy + 7}Z" fill="currentColor"/>'
    body += _map_legend(362.0)
    return svg(WIDTH, 372.0, body, "Encounters by bearing and distance at the closest point, as they began")


def _map_legend(y: float) -> str:
    items = [(f'fill="{OWN}" fill-opacity=".6"', "covered (the darker, the more)"), (f'fill="{RED}"', "contact"),
             (f'fill="{AMBER}"', "safety below 0.5")]  # fmt: skip
    out, x = "", 44.0
    for fill, name in items:
        out += _box(x, y - 9.0, 10.0, 10.0, f'rx="2" {fill}') + _text(x + 14.0, y, name, "start")
        x += 30.0 + 6.0 * len(name)
    return out


RATIOS = np.array([0.0, 0.25, 0.5, 0.71, 0.9, 1.11, 1.41, 2.0, 4.0, np.inf])


def speed_map(encounters: Encounters) -> str:
    """The same by relative bearing and ratio of speeds; a number says how many of a cell went wrong."""
    beta, ratio = values(encounters, "start_beta_deg"), values(encounters, "start_speed_ratio")
    good = np.isfinite(beta) & np.isfinite(ratio)
    columns, rows = 24, len(RATIOS) - 1
    i = np.floor(((beta[good] + 180.0) % 360.0) / (360.0 / columns)).astype(int)
    j = np.searchsorted(RATIOS, ratio[good], side="right") - 1
    table, wrong, hits = (np.zeros((columns, rows), int) for _ in range(3))
    np.add.at(table, (i, j), 1)
    colours = [failed_of(e) for e, g in zip(encounters, good, strict=True) if g]
    np.add.at(wrong, (i, j), [bool(c) for c in colours])
    np.add.at(hits, (i, j), [c == RED for c in colours])
    left, top, wide, high = 60.0, 12.0, (WIDTH - 60.0 - RIGHT) / columns, 30.0
    body = ""
    for c in range(columns):
        for r in range(rows):
            x, y = left + c * wide, top + (rows - 1 - r) * high
            shade = _coverage(int(table[c, r]), int(table.max()))
            body += _box(x, y, wide, high, f'stroke="currentColor" stroke-opacity=".12" {shade}')
            if wrong[c, r]:
                colour = RED if hits[c, r] else AMBER
                body += f'<circle cx="{x + wide / 2:.1f}" cy="{y + high / 2:.1f}" r="7.5" fill="{colour}"/>'
                body += (f'<text x="{x + wide / 2:.1f}" y="{y + high / 2 + 3:.1f}" text-anchor="middle" font-size="8" '
                         f'fill="#fff">{wrong[c, r]}</text>')  # fmt: skip
    for r in range(1, rows):
        body += _text(left - 6.0, top + (rows - r) * high + 4.0, f"{RATIOS[r]:g}", "end")
    bottom = top + rows * high
    for degrees, name in ((-180, "astern"), (-90, "port"), (0, "ahead"), (90, "starboard"), (180, "astern")):
        anchor = "start" if degrees == -180 else "end" if degrees == 180 else "middle"
        body += _text(left + (degrees + 180) / 360 * columns * wide, bottom + 16.0, name, anchor)
    y = (top + bottom) / 2
    body += _text(14.0, y, "speed of the ship / own", "middle", f'transform="rotate(-90 14 {y:.0f})"')
    body += _map_legend(bottom + 40.0)
    return svg(WIDTH, bottom + 50.0, body, "Encounters by bearing and ratio of speeds, as they began")


def track_plot(film: Mapping[str, Any], contact: bool, closest_to: str) -> str:
    """Tracks of one episode, north up: own ship blue, ships orange, discs grey; a ring where it came closest."""
    columns = [np.array([np.nan if v is None else v for v in column], float) for column in film["columns"]]
    n = len(film["vessels"])
    tracks = [np.stack([columns[1 + 2 * k], columns[2 + 2 * k]], axis=1) for k in range(n)]
    own = tracks[0]
    near = min(range(1, n), key=lambda k: _gap(own, tracks[k])[0], default=0)
    if closest_to in film["vessels"][1:]:
        near = film["vessels"].index(closest_to)
    at = int(_gap(own, tracks[near])[1]) if near else len(own) - 1
    # what is drawn: the own ship's whole way, and of the ships what lies near it
    low, high = np.nanmin(own, axis=0), np.nanmax(own, axis=0)
    span = float(max(high - low)) * 1.3 + 80.0
    middle = (low + high) / 2
    size = 220.0

    def place(point: Any) -> tuple[float, float]:
        return (size / 2 + (point[1] - middle[1]) / span * size, size / 2 - (point[0] - middle[0]) / span * size)

    body = ""
    for disc in film["discs"]:
        x, y = place(disc)
        body += f'<circle cx="{x:.1f}" cy="{y:.1f}" r="{max(disc[2] / span * size, 1.0):.1f}" fill="{DISC}" fill-opacity=".6"/>'
    if film["route"]:
        points = " ".join("{:.1f},{:.1f}".format(*place(p)) for p in film["route"])
        body += f'<polyline points="{points}" fill="none" stroke="currentColor" stroke-opacity=".35" stroke-dasharray="3 3"/>'
    for k in reversed(range(n)):
        colour = OWN if k == 0 else TARGET
        shown = tracks[k][np.isfinite(tracks[k]).all(axis=1)]
        points = " ".join("{:.1f},{:.1f}".format(*place(p)) for p in shown)
        wide = 2.0 if k in (0, near) else 1.0
        body += f'<polyline points="{points}" fill="none" stroke="{colour}" stroke-width="{wide}"/>'
        if len(shown):
            x, y = place(shown[0])
            body += f'<circle cx="{x:.1f}" cy="{y:.1f}" r="2" fill="{colour}"/>'
    if near:
        for k, colour in ((near, TARGET), (0, OWN)):
            x, y = place(tracks[k][at])
            body += f'<circle cx="{x:.1f}" cy="{y:.1f}" r="3.5" fill="{colour}" stroke="#fff"/>'
    x, y = place(own[at])
    ring = RED if contact else AMBER
    body += f'<circle cx="{x:.1f}" cy="{y:.1f}" r="9" fill="none" stroke="{ring}" stroke-width="2"/>'
    bar = nice(span / 5, 1)[1]
    body += _line(8.0, size - 8.0, 8.0 + bar / span * size, size - 8.0, 'stroke="currentColor" stroke-width="1.5"')
    body += _text(8.0, size - 13.0, f"{bar:g} m", "start", 'font-size="9"')
    return svg(size, size, body, "Tracks of the episode")  # what lies outside of the box is not drawn


def _gap(a: Any, b: Any) -> tuple[float, int]:
    d = np.hypot(*(a - b).T)
    if not np.isfinite(d).any():
        return math.inf, 0
    k = int(np.nanargmin(d))
    return float(d[k]), k
