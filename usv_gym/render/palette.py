"""One table: what every role looks like in every palette.

``day`` is for daylight and print, ``dark`` for a dim room, ``night`` keeps eyes adapted to the dark: dim and warm.
Colours are ``#rrggbb`` or ``#rrggbbaa``; an empty string is not drawn.
"""

from __future__ import annotations

from dataclasses import dataclass

PALETTES = ("day", "dark", "night")


@dataclass(frozen=True)
class Style:
    """Line width and dash pattern [px], and per palette the colours of the area and of the line (or text)."""

    width: float
    dash: tuple[float, float] | None
    colours: tuple[tuple[str, str], tuple[str, str], tuple[str, str]]  # (fill, line) of day, dark, night

    def fill(self, palette: str) -> str:
        """Colour of the area."""
        return self.colours[PALETTES.index(palette)][0]

    def line(self, palette: str) -> str:
        """Colour of the outline or of the text."""
        return self.colours[PALETTES.index(palette)][1]


def _style(day: str, dark: str, night: str, width: float = 1.0, dash: tuple[float, float] | None = None) -> Style:
    """Colours as "fill line"; a dash stands for none."""

    def pair(text: str) -> tuple[str, str]:
        fill, line = text.split()
        return fill.replace("-", ""), line.replace("-", "")

    return Style(width, dash, (pair(day), pair(dark), pair(night)))


# fmt: off
STYLES: dict[str, Style] = {
    # paper
    "sea":            _style("#d7ebf0 -",         "#0a0d10 -",         "#070504 -"),
    "shallow":        _style("#b5d8f2 -",         "#0d2130 -",         "#0e0906 -"),
    "shoal":          _style("#84bbea -",         "#123a56 -",         "#170e09 -"),
    "land":           _style("#cdbd7c #4d4426",   "#6b5f3a #b8a76a",   "#35240f #7d5a2c", 1.4),
    "echo":           _style("#b4530f -",         "#ffa64d -",         "#b05820 -"),
    "grid":           _style("- #bccfd6",         "- #262c31",         "- #1f1512"),
    "text":           _style("#d7ebf0 #12181c",   "#0a0d10 #e6edf0",   "#070504 #c98a62"),
    "text_muted":     _style("#d7ebf0 #566770",   "#0a0d10 #93a1a8",   "#070504 #85573e"),
    "scale":          _style("#f3903f #12181c",   "#c8702c #dfe6e9",   "#8a3f1c #b0714e"),
    "scale_gap":      _style("#ffffff #12181c",   "#14191d #dfe6e9",   "#140c09 #b0714e"),
    "needle":         _style("#12181c #12181c",   "#e6edf0 #e6edf0",   "#b0714e #b0714e"),
    "needle_light":   _style("#ffffff #12181c",   "#14191d #e6edf0",   "#140c09 #b0714e"),
    "plate":          _style("#e8f4f7e6 #9fb2ba", "#14191de6 #3d474d", "#0f0a08e6 #38231a"),
    # sensors
    "shadow":         _style("#7f939b5c -",       "#8fa0a83c -",       "#70483830 -"),
    "ring":           _style("- #e0a072",         "- #6b4a2e",         "- #46240f", 1.0, (3, 4)),
    "ring_tick":      _style("- #e0a072",         "- #6b4a2e",         "- #46240f"),
    "ring_radar":     _style("- #e8792c",         "- #d9752f",         "- #8a3d16", 1.4),
    "ring_lidar":     _style("- #1d8f8a",         "- #37b3ac",         "- #6d5a1c", 1.3, (6, 4)),
    "label_ring":     _style("#d7ebf0 #b4530f",   "#0a0d10 #e08945",   "#070504 #a24c1f"),
    "domain":         _style("#2f6fe01c #2f6fe0", "#4d8dff20 #4d8dff", "#8a5a2a20 #7d5a2c", 1.1),
    # tracks and route
    "track_own":      _style("- #7a1fa8",         "- #cf8cff",         "- #b3684f", 2.0),
    "track_ship":     _style("- #2f9462",         "- #41c384",         "- #6f5a22", 1.3),
    "track_later":    _style("- #2f946270",       "- #41c38470",       "- #6f5a2280", 1.1, (2, 5)),
    "tick_own":       _style("#7a1fa8 -",         "#cf8cff -",         "#b3684f -"),
    "tick_ship":      _style("#2f9462 -",         "#41c384 -",         "#6f5a22 -"),
    "label_lidar":    _style("#d7ebf0 #0f6f6b",   "#0a0d10 #45c0b9",   "#070504 #8f7a30"),
    "label_track":    _style("#d7ebf0 #7a1fa8",   "#0a0d10 #cf8cff",   "#070504 #b3684f"),
    "route":          _style("- #d63c28",         "- #ff5d47",         "- #93261a", 1.6, (8, 5)),
    "waypoint":       _style("- #d63c28",         "- #ff5d47",         "- #93261a", 1.5),
    "acceptance":     _style("#d63c2812 #d63c2870", "#ff5d4716 #ff5d4770", "#93261a16 #93261a80", 1.0, (3, 3)),
    "label_route":    _style("#d7ebf0 #c42f1c",   "#0a0d10 #ff6f5b",   "#070504 #b0392a"),
    # truth
    "own_hull":       _style("#ffd83b #12181c",   "#ffd83b #fff7d0",   "#a5742a #d49a55", 1.3),
    "own_house":      _style("#12181c -",         "#57430a -",         "#2b1a08 -"),
    "own_vector":     _style("- #12181c",         "- #f2f5f6",         "- #c98a62", 1.5),
    "own_heading":    _style("- #12181c90",       "- #f2f5f690",       "- #c98a6290", 1.0),
    "ship_hull":      _style("#a88f45 #12181c",   "#e0b45f #fff0cf",   "#6d4a22 #a87848", 1.2),
    "vessel_hull":    _style("#4e86e8 #12181c",   "#5b93f5 #dbe8ff",   "#5c3b30 #9a6a55", 1.2),
    "boat_hull":      _style("#d6587f #12181c",   "#f07fa3 #ffe0ea",   "#6b2c2a #a8594e", 1.2),
    "usv_hull":       _style("#f0c948 #12181c",   "#f0c948 #fff3c4",   "#80582a #b58a50", 1.2),
    "hull_house":     _style("#ffffffd0 #12181c90", "#101418c0 -",     "#1a0f08c0 -", 0.8),
    "vector":         _style("- #1f8a55",         "- #3ed08a",         "- #83702c", 1.4),
    "iceberg":        _style("#ffffff #5b7f98",   "#dbe9f2 #8fb0c6",   "#57443a #8d6a56", 1.1),
    "iceberg_shade":  _style("#bcd5e6 -",         "#7fa0b8 -",         "#38291f -"),
    "lake":           _style("#c9e1ea #6b5f3c",   "#20303a #b5a878",   "#17100d #6a4e2c", 1.0),
    "islet":          _style("#c9ba79 #4d4426",   "#95824c #d8c88f",   "#4a3618 #86683a", 1.2),
    "islet_shade":    _style("#a9985a -",         "#6f6035 -",         "#33240f -"),
    "buoy":           _style("#f2c230 #12181c",   "#f2c230 #fff3c4",   "#8a6420 #c09048", 1.1),
    "buoy_top":       _style("#12181c -",         "#14181a -",         "#1c1208 -"),
    "lighthouse":     _style("#ffffff #12181c",   "#f4f6f7 #14181a",   "#a08468 #1c1208", 1.1),
    "light":          _style("#c32ba4 -",         "#f06bd4 -",         "#9a3d2c -"),
    "platform":       _style("#8b98a0 #12181c",   "#9aa8b0 #e8eef1",   "#54423a #957a68", 1.2),
    "platform_deck":  _style("#e3e9ec #12181c",   "#3d484e #e8eef1",   "#2c1f1a #957a68", 1.0),
    # picture
    "detection":      _style("#f28c1e50 #d97514", "#f28c1e55 #ffa64d", "#8a3f1050 #b05820", 1.1),
    "detection_vector": _style("- #d4670a",       "- #ffa64d",         "- #b05820", 1.4, (5, 3)),
    "detection_past": _style("#e0761038 -",       "#f28c1e48 -",       "#8a3f1060 -"),
    "covariance":     _style("- #b236b8",         "- #e08cf0",         "- #a8584e", 0.9),
    "ais":            _style("- #0a6f6c",         "- #56d6ce",         "- #a58c38", 1.4),
    # verdicts
    "cpa":            _style("- #c01843",         "- #ff5c83",         "- #b03028", 1.4, (2, 2)),
    "cpa_dot":        _style("#c01843 -",         "#ff5c83 -",         "#b03028 -"),
    "label_cpa":      _style("#d7ebf0 #b3143c",   "#0a0d10 #ff7d9c",   "#070504 #c24a3c"),
    "collision":      _style("- #d1001f",         "- #ff3b4e",         "- #d04030", 3.0),
    "mark":           _style("#d1001f18 #d1001f", "#ff3b4e20 #ff3b4e", "#d0403018 #d04030", 1.3),
    "mark_route":     _style("- #d1001f",         "- #ff3b4e",         "- #d04030", 1.4, (5, 3)),
    "selected":       _style("- #2461cf",         "- #6ba3ff",         "- #d49a55", 2.0),
    "label_vessel":   _style("#d7ebf0 #12181c",   "#0a0d10 #e6edf0",   "#070504 #c98a62"),
    "label_fixed":    _style("#d7ebf0 #465861",   "#0a0d10 #a9b8c0",   "#070504 #8f6047"),
    "leader":         _style("- #7c8e97",         "- #6f7d85",         "- #60402f"),
    # panel
    "panel":          _style("#cbdfe5 #8fa3ab",   "#15191c #3d474d",   "#0b0807 #38231a"),
    "panel_box":      _style("#dcebef -",         "#22282c -",         "#17100d -"),
    "panel_grid":     _style("- #bccfd6",         "- #363f45",         "- #2b1c16"),
    "panel_grid_fill": _style("#a9bdc5 -",        "#363f45 -",         "#2b1c16 -"),
    "act":            _style("- #c01843",         "- #ff7d9c",         "- #d04030"),
    "keep":           _style("- #1f7a4d",         "- #3ed08a",         "- #a58c38"),
    "chip":           _style("#3f5964 -",         "#9db0b9 -",         "#8a5740 -"),
    "chip_text":      _style("- #ffffff",         "- #15191c",         "- #0b0807"),
    "chip_off":       _style("- #a9bdc5",         "- #39434a",         "- #33211a"),
    "speed":          _style("- #2461cf",         "- #6ba3ff",         "- #b8834a", 1.8),
    "speed_area":     _style("#2f6fe038 -",       "#4d8dff38 -",       "#8a5a2a30 -"),
    "heading":        _style("- #a42bb0",         "- #e6a1f5",         "- #b8604a", 1.8),
    "heading_area":   _style("#b236b828 -",       "#e08cf028 -",       "#8a403030 -"),
    "closest":        _style("- #c01843",         "- #ff7d9c",         "- #c24a3c", 1.8),
    "closest_area":   _style("#c0184328 -",       "#ff5c8328 -",       "#b0302830 -"),
    "marker":         _style("- #566770",         "- #93a1a8",         "- #85573e", 1.0, (3, 3)),
}
# fmt: on
