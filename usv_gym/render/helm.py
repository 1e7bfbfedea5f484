"""Driving by hand: arrow keys and a gamepad become a surge and a yaw demand, as the action ``throttle_nozzle`` wants them."""

from __future__ import annotations

from typing import Any

from .canvas import load_pygame

THROTTLE_RATE = 0.5  #: [1/s] how fast a held key moves the throttle, which then stays
YAW_RATE = 2.0  #: [1/s] how fast the rudder follows the keys; it comes back by itself
DEAD_ZONE = 0.12  #: of a gamepad's stick


class Helm:
    """Throttle (astern below 0) and yaw demand (to starboard above 0), each in [-1, 1].

    Up and down move the throttle, left and right the yaw demand; the backspace key stops.  A gamepad's left stick sets both
    at once.
    """

    def __init__(self) -> None:
        """Nothing asked for."""
        self.throttle = self.yaw = 0.0
        self._pg = load_pygame()
        self._held: set[int] = set()
        self._stick = [0.0, 0.0]  # to starboard, ahead
        pg = self._pg
        self._keys = (pg.K_UP, pg.K_DOWN, pg.K_LEFT, pg.K_RIGHT)

    def handle(self, event: Any) -> bool:
        """Take an event; False if it is none of the helm's."""
        pg = self._pg
        if event.type in (pg.KEYDOWN, pg.KEYUP) and event.key in self._keys:
            (self._held.add if event.type == pg.KEYDOWN else self._held.discard)(event.key)
        elif event.type == pg.KEYDOWN and event.key == pg.K_BACKSPACE:
            self.throttle = self.yaw = 0.0
        elif event.type == pg.JOYAXISMOTION and event.axis in (0, 1):
            value = 0.0 if abs(event.value) < DEAD_ZONE else float(event.value)
            self._stick[event.axis] = value if event.axis == 0 else -value
            if event.axis == 0:
                self.yaw = self._stick[0]
            else:
                self.throttle = self._stick[1]
        elif event.type == pg.WINDOWFOCUSLOST:
            self._held.clear()  # the keys will be let go where we do not hear of it
            return False
        else:
            return False
        return True

    def tick(self, seconds: float) -> None:
        """Let keys that are held down act for some time [s]."""
        up, down, left, right = (key in self._held for key in self._keys)
        self.throttle = _limit(self.throttle + (up - down) * THROTTLE_RATE * seconds)
        if not self._stick[0]:
            wanted, step = float(right - left), YAW_RATE * seconds
            self.yaw += max(-step, min(step, wanted - self.yaw))


def _limit(x: float) -> float:
    return max(-1.0, min(1.0, x))
