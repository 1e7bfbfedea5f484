"""What keys and the mouse do in the window: one table for the desk and for its help."""

from __future__ import annotations

from .canvas import load_pygame

Key = tuple[str, str, str, str]

#: (pygame's names of the keys, what the help calls them, what they do, method of ``Desk``)
KEYS: tuple[Key, ...] = (
    ("SPACE", "Space", "pause, go on", "pause"),
    ("n", "N", "one step", "single_step"),
    ("PAGEUP", "PgUp", "faster, up to x50", "faster"),
    ("PAGEDOWN", "PgDn", "slower, down to x0.25", "slower"),
    ("r", "R", "restart", "restart"),
    ("f", "F", "follow the own ship", "follow_own"),
    ("PLUS EQUALS KP_PLUS", "+", "nearer", "zoom_in"),
    ("MINUS KP_MINUS", "-", "further away", "zoom_out"),
    ("c", "C", "colours: day, dark, night", "next_palette"),
    ("p", "P", "picture: save as PNG", "screenshot"),
    ("h F1", "H", "this help", "toggle_help"),
    ("ESCAPE", "Esc", "drop marks and selection", "escape"),
    ("q", "Q", "quit", "quit"),
)
#: of a running world
LIVE_KEYS: tuple[Key, ...] = (
    ("TAB", "Tab", "what marks become", "next_brush"),
    ("LEFTBRACKET", "[", "smaller", "smaller"),
    ("RIGHTBRACKET", "]", "larger", "larger"),
    ("RETURN KP_ENTER", "Enter", "spawn at the marks", "spawn_marks"),
    ("DELETE x", "Del", "delete the selected", "delete"),
    ("a", "A", "its AIS on or off", "switch_ais"),
)
#: of a recording
REPLAY_KEYS: tuple[Key, ...] = (
    ("LEFT", "Left", "5 s back", "back"),
    ("RIGHT", "Right", "5 s on", "forward"),
    ("HOME", "Home", "to the start", "to_start"),
    ("END", "End", "to the end", "to_end"),
)
MOUSE: tuple[tuple[str, str], ...] = (
    ("wheel", "zoom"),
    ("drag the sea", "move the map"),
    ("click an object", "select it"),
)
LIVE_MOUSE: tuple[tuple[str, str], ...] = (
    ("click the sea", "mark a place"),
    ("right click", "spawn there at once"),
    ("drag an object", "put it elsewhere"),
)
#: of a vessel that is steered by hand; the helm listens to these
HELM: tuple[tuple[str, str], ...] = (
    ("Up, Down", "throttle"),
    ("Left, Right", "turn"),
    ("Backspace", "stop the engines"),
)


def actions(live: bool) -> dict[int, str]:
    """Method of ``Desk`` by pygame's key code."""
    pg = load_pygame()
    table = KEYS + (LIVE_KEYS if live else REPLAY_KEYS)
    return {getattr(pg, f"K_{name}"): action for names, _, _, action in table for name in names.split()}


def help_text(live: bool, manual: bool) -> list[tuple[str, str]]:
    """What to press and what it does."""
    table = KEYS + (LIVE_KEYS if live else REPLAY_KEYS)
    return [
        *(HELM if manual else ()),
        *((caption, text) for _, caption, text, _ in table),
        *MOUSE,
        *(LIVE_MOUSE if live else ()),
    ]
