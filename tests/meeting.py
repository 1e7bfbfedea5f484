"""Two vessels that meet, drawn leg by leg: the cases of the tests of scores and requirements."""

from __future__ import annotations

import math

import numpy as np

from usv_gym.colregs.trajectory import Trajectory

DEG = math.pi / 180.0
#: in these cases the vessels are points, so that the distance of the hulls is that of the centres; Set A's R_col is added to it
POINT = 1e-6


def course(legs, dt=1.0):
    """[T, 3] N, E, psi of a vessel that sails legs of (seconds, course [deg], speed [m/s]) from the origin."""
    position, track = np.zeros(2), []
    for seconds, degrees, speed in legs:
        for _ in range(round(seconds / dt)):
            track.append([*position, degrees * DEG])
            position = position + speed * dt * np.array([math.cos(degrees * DEG), math.sin(degrees * DEG)])
    return np.array(track)


def meeting(own, other, offset, *, size=POINT, dt=1.0):
    """Two vessels as a trajectory; ``offset`` [N, E] is where the other starts."""
    a, b = course(own, dt), course(other, dt)
    n = min(len(a), len(b))
    b[:, :2] += offset
    eta = np.stack([a[:n], b[:n]], axis=1)
    x = Trajectory.from_tracks(dt * np.arange(n), eta, np.full(2, size), np.full(2, size))
    # a course change shows in the sample it happens at
    psi = eta[..., 2]
    v = np.hypot(*np.moveaxis(np.diff(eta[..., :2], axis=0, append=2 * eta[-1:, :, :2] - eta[-2:-1, :, :2]), -1, 0)) / dt
    x.velocity[0] = v[..., None] * np.stack([np.cos(psi), np.sin(psi)], axis=-1)
    return x


def _head_on(own):
    return meeting(own, [(600, 180, 5)], [2500, 0])


def _crossing(own, other):
    """From starboard, contact at 300 s if nobody acts."""
    return meeting(own, other, [1500, 1500])


def _from_port(own, other):
    return meeting(own, other, [1500, -1500])


def _past(own, east=0.0):
    return meeting(own, [(700, 0, 3)], [1100, east])


STANDS_ON = [(600, 0, 5)]
IT_GIVES_WAY = [(100, 90, 5), (60, 150, 5), (500, 90, 5)]


def constructed():
    """40 clear encounters: (name, class, whether the own ship complies, trajectory)."""
    cases = []

    def add(kind, complies, name, x):
        cases.append((f"{kind}: {name}", kind, complies, x))

    for turn in (35, 40, 50, 60):
        add("head_on", True, f"{turn} deg to starboard", _head_on([(100, 0, 5), (70, turn, 5), (400, 0, 5)]))
    add("head_on", False, "does nothing", _head_on([(600, 0, 5)]))
    add("head_on", False, "40 deg to port", _head_on([(100, 0, 5), (60, -40, 5), (400, 0, 5)]))
    add("head_on", False, "15 deg at 250 m", _head_on([(225, 0, 5), (25, 15, 5), (400, 0, 5)]))
    add("head_on", False, "5 deg in time", _head_on([(100, 0, 5), (60, 5, 5), (400, 0, 5)]))
    for turn in (45, 60, 70, 80):
        add("crossing_give_way", True, f"{turn} deg to starboard", _crossing([(100, 0, 5), (80, turn, 5), (500, 0, 5)],
            [(700, 270, 5)]))  # fmt: skip
    add("crossing_give_way", False, "does nothing", _crossing([(700, 0, 5)], [(700, 270, 5)]))
    add("crossing_give_way", False, "runs ahead of it", _crossing([(150, 0, 5), (400, 0, 6.5)], [(700, 270, 5)]))
    add("crossing_give_way", False, "to port, ahead of it", _crossing([(100, 0, 5), (60, -40, 8), (500, 0, 8)],
        [(700, 270, 5)]))  # fmt: skip
    add("crossing_give_way", False, "20 deg at 150 m", _crossing([(279, 0, 5), (30, 20, 5), (400, 0, 5)], [(700, 270, 5)]))
    for turn in (40, 60, 70, 80):
        add("crossing_stand_on", True, f"the other turns {turn} deg",
            _from_port(STANDS_ON, [(100, 90, 5), (90, 90 + turn, 5), (500, 90, 5)]))  # fmt: skip
    add("crossing_stand_on", False, "30 deg to port", _from_port([(100, 0, 5), (500, -30, 5)], IT_GIVES_WAY))
    add("crossing_stand_on", False, "40 deg to starboard", _from_port([(100, 0, 5), (500, 40, 5)], IT_GIVES_WAY))
    add("crossing_stand_on", False, "stops", _from_port([(100, 0, 5), (500, 0, 2.2)], IT_GIVES_WAY))
    add("crossing_stand_on", False, "40 deg to port in stage 4", _from_port([(274, 0, 5), (300, -40, 5)], [(700, 90, 5)]))
    for turn in (35, 40, 45, 50):
        add("overtaking", True, f"{turn} deg to starboard", _past([(20, 0, 8), (50, turn, 8), (500, 0, 8)]))
    add("overtaking", False, "straight at it", _past([(700, 0, 8)]))
    add("overtaking", False, "past at 20 m", _past([(700, 0, 8)], east=20.0))
    add("overtaking", False, "5 deg", _past([(20, 0, 8), (50, 5, 8), (500, 0, 8)]))
    add("overtaking", False, "30 deg at 150 m", _past([(190, 0, 8), (8, 30, 8), (500, 0, 8)]))
    for turn in (35, 40, 45, 50):
        add("overtaken", True, f"the other turns {turn} deg",
            meeting([(700, 0, 3)], [(20, 0, 8), (50, turn, 8), (500, 0, 8)], [-1100, 0]))  # fmt: skip
    for name, legs in (("30 deg to port", [(60, 0, 3), (600, -30, 3)]), ("40 deg to starboard", [(60, 0, 3), (600, 40, 3)]),
                       ("stops", [(60, 0, 3), (600, 0, 1.0)]), ("speeds up", [(60, 0, 3), (600, 0, 4.4)])):  # fmt: skip
        add("overtaken", False, name, meeting(legs, [(20, 0, 8), (50, 40, 8), (500, 0, 8)], [-1100, 0]))
    return cases
