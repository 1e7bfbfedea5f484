"""How threads share the groups of a batch: the leader takes them from the front, helpers from the back.

So each thread comes back to nearly the same rows from step to step, which are then in the cache of its core; and a thread that
the machine holds up keeps the others waiting for one group at most.
"""

from __future__ import annotations

import numpy as np

from .. import atomic
from ..jit import inner

#: what a thread does: all by itself; begins and ends the work; helps as long as there is some
ALONE, LEAD, HELP = 0, 1, 2
#: numbers that the threads share: groups taken, groups taken from the back, groups done; not 0: helpers are to leave;
#: how seldom threads have been held up lately
TAKEN, BACK, DONE, STOP, CALM = 0, 8, 16, 24, 32  # each on a cache line of its own
CONTROLS = 40
NO_CONTROL = np.zeros(CONTROLS, np.int64)  # for ALONE
#: how often a helper looks for more work before it leaves, about 0.2 ms; how often the leader looks for the end, 0.05 ms
PATIENCE, ALMOST_DONE = 10_000, 2_500
#: CALM goes up by one with each step up to this, and down by so much where a thread is held up; below 0 other processes want
#: the processors, and helpers leave at once: who sleeps in between is let in soon, who stays is stopped in the middle of it
CALMEST, UPSET = 1000, 400
UNFINISHED = -2  #: the leader would have to wait longer: some thread has been held up


@inner
def announce(control):
    """Begin: all groups are to be had."""
    atomic.store(control, BACK, 0)
    atomic.store(control, DONE, 0)
    atomic.store(control, TAKEN, 0)


@inner
def claim(control, role, groups, before):
    """The next group for this thread, -1 if none is left; ``before`` are those it has had."""
    if role == ALONE:
        return before if before < groups else -1
    if atomic.load(control, TAKEN) >= groups or atomic.add(control, TAKEN, 1) >= groups:
        return -1
    return before if role == LEAD else groups - 1 - atomic.add(control, BACK, 1)


@inner
def finish(control, role):
    """A group is done."""
    if role != ALONE:
        atomic.add(control, DONE, 1)


@inner
def await_work(control, groups):
    """Helper: wait until there is work; False if it took too long."""
    for _ in range(PATIENCE if atomic.load(control, CALM) >= 0 else 1):
        if atomic.load(control, TAKEN) < groups:
            return True
        if atomic.load(control, STOP) != 0:
            return False
        atomic.pause()
    return False


@inner
def await_end(control, groups):
    """Leader: wait until all groups are done; False if it takes too long."""
    calm = atomic.load(control, CALM)
    for _ in range(ALMOST_DONE):
        if atomic.load(control, DONE) >= groups:
            atomic.store(control, CALM, min(calm + 1, CALMEST))
            return True
        atomic.pause()
    atomic.store(control, CALM, max(calm - UPSET, -CALMEST))
    return False
