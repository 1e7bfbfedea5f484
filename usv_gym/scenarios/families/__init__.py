"""Scenario families: random seas, drawn in a kernel on top of a template record.

A scenario with the key ``family`` is the template; at every reset the family draws the rest into the record from the
world's seed.  A new family is a module with ``sample`` and a row here.
"""

from __future__ import annotations

import importlib
from collections.abc import Callable
from dataclasses import dataclass

from ...world.land import Coast

#: (worlds [B], mask [B], difficulty [B], vessel model of the own ship, scenario): draws into the rows of the mask, which
#: are fresh copies of the template with their seeds set, before the kernel ``reset_worlds`` starts them
Sample = Callable[..., None]


@dataclass(frozen=True)
class FamilySpec:
    """What the rest of the package needs to know of a family."""

    description: str
    vessels: int  #: most vessel slots it fills, the own ship's among them
    obstacles: int  #: most obstacle slots it fills
    module: str  #: below this package; kernels load with the first use
    land: bool = False  #: the module has ``coasts``
    reach: float = 0.0  #: [m] what a vessel can sail at cruising speed before time is up, where nothing else says (`Family`)

    @property
    def sample(self) -> Sample:
        """The function that draws."""
        sample: Sample = importlib.import_module(f"{__name__}.{self.module}").sample
        return sample

    def coasts(self) -> tuple[Coast, ...]:
        """The coasts that ``land_id`` counts in; none for a family without land."""
        if not self.land:
            return ()
        coasts: tuple[Coast, ...] = importlib.import_module(f"{__name__}.{self.module}").coasts()
        return coasts


FAMILIES: dict[str, FamilySpec] = {
    "open_sea": FamilySpec(
        "icebergs and crossing ships along a route", vessels=8, obstacles=16, reach=2500.0, module="open_sea"
    ),
    "near_shore": FamilySpec(
        "narrow waters with islands and leisure boats", vessels=8, obstacles=0, reach=2500.0, module="near_shore", land=True
    ),
    "busy_port": FamilySpec(
        "into a port past moored and moving vessels", vessels=20, obstacles=12, reach=2500.0, module="busy_port", land=True
    ),
    "imazu": FamilySpec(
        "the 22 cases of Imazu: ships that all reach one point with the own ship", vessels=4, obstacles=0, module="imazu"
    ),
    "encounter": FamilySpec(
        "ships in encounters of wanted classes, by distance and time of the closest point",
        vessels=8,
        obstacles=0,
        module="encounter",
    ),
}
