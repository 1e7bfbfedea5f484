"""Draws the panel beside the map: title, gauges, target table, plots."""

from __future__ import annotations

import math

import numpy as np

from .canvas import Canvas, fitting, text_size
from .panel import clock
from .primitives import Panel, Plot, Points, Series, TargetRow
from .shapes import nice_step

WIDTH = 402  #: [px]
PAD = 13.0
ROW = 20.0  #: [px] height of a row of the table
LEAST = 3  #: rows of the table that are worth more than a plot
PLOT = 112.0  #: [px] least height of a plot
#: columns of the table: title, offset from the left, alignment
COLUMNS = (("ID", 0.0, 0.0), ("TYPE", 34.0, 0.0), ("RULE", 82.0, 0.0), ("BRG", 174.0, 1.0), ("RNG m", 222.0, 1.0),
           ("CPA m", 268.0, 1.0), ("TCPA s", 318.0, 1.0), ("BY", 330.0, 0.0))  # fmt: skip
#: encounters in which the own ship has to act; in the others it holds its course
ACT = ("head on", "give way", "overtaking")


def draw_panel(canvas: Canvas, panel: Panel, box: tuple[float, float, float, float]) -> None:
    """Fill a box left, top, right, bottom [px]."""
    x0, y0, x1, y1 = box
    canvas.box(box, "panel")
    left, right = x0 + PAD, x1 - PAD
    canvas.text(panel.title, (left, y0 + 10.0), "text", 16)
    canvas.text("".join(panel.status[:1]), (right, y0 + 11.0), "text", 14, 1.0)
    canvas.text(fitting("  ·  ".join(panel.status[1:]), right - left, 12), (left, y0 + 30.0), "text_muted", 12)
    y = _gauges(canvas, panel.gauges, left, right, y0 + 50.0)

    def rows(plots: int) -> int:
        """Rows of the table that fit above so many plots."""
        return int((y1 - y - PAD - plots * (PLOT + 8.0) - 42.0) // ROW)

    plots = len(panel.plots)
    while plots and rows(plots) < min(LEAST, len(panel.targets)):
        plots -= 1
    y = _table(canvas, panel.targets, left, right, y + 6.0, rows(plots))
    if plots:
        height = min((y1 - PAD - y - 8.0 * (plots - 1)) / plots, 170.0)
        for k, plot in enumerate(panel.plots[:plots]):
            top = y + k * (height + 8.0)
            _plot(canvas, plot, (left, top, right, top + height))


def _gauges(canvas: Canvas, gauges: tuple[tuple[str, str], ...], left: float, right: float, y: float) -> float:
    """Boxes, three in a row; returns where they end."""
    gap, height = 6.0, 50.0
    width = (right - left - 2.0 * gap) / 3.0
    for k, (caption, value) in enumerate(gauges):
        x, top = left + (k % 3) * (width + gap), y + (k // 3) * (height + gap)
        canvas.box((x, top, x + width, top + height), "panel_box", 4.0)
        canvas.text(caption, (x + 9.0, top + 8.0), "text_muted", 11)
        canvas.text(value, (x + 9.0, top + 25.0), "text", 16)
    return y + math.ceil(len(gauges) / 3) * (height + gap)


def _table(canvas: Canvas, rows: tuple[TargetRow, ...], left: float, right: float, y: float, fit: int) -> float:
    """The nearest targets, as many as fit; returns where the table ends."""
    canvas.text("Targets", (left, y), "text", 14)
    shown = rows if len(rows) <= fit else rows[: max(fit, 0)]
    if len(rows) > len(shown):
        canvas.text(f"nearest {len(shown)} of {len(rows)}", (right, y + 2.0), "text_muted", 11, 1.0)
    elif not rows:
        canvas.text("none detected", (right, y + 2.0), "text_muted", 11, 1.0)
    y += 22.0
    if not shown:
        return y
    for title, x, align in COLUMNS:
        canvas.text(title, (left + x, y), "text_muted", 11, align)
    y += 17.0
    for row in shown:
        for text, (title, x, align) in zip(_cells(row), COLUMNS, strict=False):
            role = "text" if title != "RULE" or not row.encounter else "act" if row.encounter in ACT else "keep"
            canvas.text(text, (left + x, y), role, 12, align)
        for k, letter in enumerate("ARL"):
            _chip(canvas, letter, letter in row.sensors, left + COLUMNS[-1][1] + 15.0 * k, y)
        y += ROW
    return y + 3.0


def _cells(row: TargetRow) -> tuple[str, ...]:
    def number(value: float) -> str:
        return f"{value:.0f}" if math.isfinite(value) else "-"

    tcpa = number(row.tcpa) if row.tcpa >= 0.0 else "past" if row.tcpa < 0.0 else "-"
    return row.id, row.type, row.encounter or "-", f"{round(row.bearing) % 360:03d}°", number(row.range), number(row.cpa), tcpa


def _chip(canvas: Canvas, letter: str, on: bool, x: float, y: float) -> None:
    """Letter of a sensor that sees the target; a faint one of a sensor that does not."""
    if on:
        canvas.box((x, y - 1.5, x + 13.0, y + 13.5), "chip", 3.0)
    canvas.text(letter, (x + 6.5, y + 0.5), "chip_text" if on else "chip_off", 11, 0.5)


def _plot(canvas: Canvas, plot: Plot, box: tuple[float, float, float, float]) -> None:
    """Axes, grid and curves in a box."""
    x0, y0, x1, y1 = box
    canvas.box(box, "panel_box", 4.0)
    canvas.text(plot.title, (x0 + 9.0, y0 + 6.0), "text", 12)
    x = x1 - 9.0
    for series in reversed(plot.series):
        canvas.text(series.text, (x, y0 + 6.0), series.role, 12, 1.0)
        x -= text_size(series.text, 12)[0] + 12.0
    left, top, right, bottom = x0 + 40.0, y0 + 27.0, x1 - 12.0, y1 - 20.0
    if bottom - top < 20.0:
        return
    t0 = min(float(s.t[0]) for s in plot.series)
    t1 = max(float(s.t[-1]) for s in plot.series)
    low, high, step = _axis(plot)

    def px(t: Points, values: Points) -> Points:
        y = np.clip(bottom - (values - low) / (high - low) * (bottom - top), top, bottom)
        return np.column_stack((left + (t - t0) / max(t1 - t0, 1e-9) * (right - left), y))

    for k in range(round((high - low) / step) + 1):
        value = low + k * step
        y = float(px(np.array([t0]), np.array([value]))[0, 1])
        canvas.polyline(np.array([(left, y), (right, y)]), "panel_grid")
        text = f"{round(value) % 360:03d}" if plot.wrap_deg else f"{value:g}"
        canvas.text(text, (left - 6.0, y - 6.0), "text_muted", 10, 1.0)
    every = nice_time((t1 - t0) / 4.5)
    for k in range(math.ceil(t0 / every), math.floor(t1 / every) + 1):
        x = float(px(np.array([k * every]), np.array([low]))[0, 0])
        canvas.polyline(np.array([(x, top), (x, bottom)]), "panel_grid")
        half = 0.5 * text_size(clock(k * every), 10)[0] - 6.0
        x = min(max(x, left + half), right - half)
        canvas.text(clock(k * every), (x, bottom + 4.0), "text_muted", 10, 0.5)
    for series in plot.series:
        _curve(canvas, series, px(series.t, series.values), bottom)
    if plot.marker is not None:
        x = float(px(np.array([plot.marker]), np.array([low]))[0, 0])
        canvas.polyline(np.array([(x, top), (x, bottom)]), "marker")


def _curve(canvas: Canvas, series: Series, points: Points, bottom: float) -> None:
    """Line and the area below it, broken where values are not finite."""
    good = np.isfinite(points[:, 1])
    for run in np.split(np.arange(len(good)), np.flatnonzero(np.diff(good)) + 1):
        if len(run) > 1 and good[run[0]]:
            part = points[run]
            if len(part) > 600:
                part = part[np.linspace(0, len(part) - 1, 600).astype(int)]
            if series.filled:
                canvas.polygon(np.vstack((part, (part[-1, 0], bottom), (part[0, 0], bottom))), f"{series.role}_area")
            canvas.polyline(part, series.role)


def _axis(plot: Plot) -> tuple[float, float, float]:
    """Round limits around all values, and the step between grid lines; speeds and ranges start at zero."""
    values = np.concatenate([s.values[np.isfinite(s.values)] for s in plot.series])
    low, high = (float(values.min()), float(values.max())) if len(values) else (0.0, 1.0)
    if plot.wrap_deg:
        steps = (5.0, 15.0, 30.0, 45.0, 90.0, 180.0, 360.0)
        step = next((s for s in steps if math.ceil(high / s) - math.floor(low / s) <= 4), 720.0)
        low = math.floor(low / step) * step
    else:
        low = 0.0
        step = nice_step(max(high, 1.0) * 1.05, 3.5)
    return low, low + max(math.ceil((high * 1.0001 - low) / step), 1) * step, step


def nice_time(seconds: float) -> float:
    """A round step of time [s] of at least this length."""
    steps = (1.0, 2.0, 5.0, 10.0, 15.0, 30.0, 60.0, 120.0, 300.0, 600.0, 900.0, 1800.0)
    return next((s for s in steps if s >= seconds), 3600.0 * math.ceil(seconds / 3600.0))
