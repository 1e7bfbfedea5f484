"""Which random numbers belong to which source: a slot that does not depend on how many slots the record has."""

from __future__ import annotations

from ..jit import inner

_OBSTACLES = 512  # first slot of the obstacles, beyond the vessels of the largest capacity class
_OBSERVER = 1024  # slots per observer


@inner
def noise_slot(w, s):
    """Slot of source s in the streams of ``rng.py``, for what the source does by itself."""
    V = w.vessels.active.shape[0]
    return s if s < V else _OBSTACLES + s - V


@inner
def pair_slot(w, o, s):
    """Slot of source s as seen by observer o."""
    return _OBSERVER * o + noise_slot(w, s)
