"""Hull distances, the collision sweep and the radar shadow against brute force."""

from __future__ import annotations

import math

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from usv_gym.jit import kernel
from usv_gym.sensors.shadow import DE, DN, RANGE, WIDTH, cast_shadows, look_around
from usv_gym.world import geometry
from usv_gym.world.land import NO_LAND
from usv_gym.world.safety import sweep
from usv_gym.world.state import world_dtype

V, M = 8, 16


@kernel
def _pair(n1, e1, p1, l1, b1, n2, e2, p2, l2, b2):
    a = np.empty((5, 2))
    b = np.empty((5, 2))
    geometry.hull_vertices(a, n1, e1, p1, l1, b1)
    geometry.hull_vertices(b, n2, e2, p2, l2, b2)
    return (
        geometry.hull_hull(a, b),
        geometry.point_hull(a, n2, e2),
        geometry.far_distance(
            n1 - n2, e1 - e2, math.sin(p1), math.cos(p1), l1, b1, math.sin(p2), math.cos(p2), l2, b2
        ),
    )


@kernel
def _sweep(worlds):
    sweep(worlds[0], NO_LAND)


@kernel
def _shadow(worlds, reach):
    for s in range(worlds[0].ranges.shape[0]):
        worlds[0].tracks.nearest[0, s] = s
    count = look_around(worlds[0], 0, reach)
    cast_shadows(worlds[0], count)
    return count


def hull(n, e, psi, length, beam):
    body = np.array([[0.5, 0], [0.25, 0.5], [-0.5, 0.5], [-0.5, -0.5], [0.25, -0.5]]) * [length, beam]
    c, s = math.cos(psi), math.sin(psi)
    return body @ np.array([[c, s], [-s, c]]) + [n, e]


def outline(vertices, step=0.02):
    """Points along a polygon, closely spaced."""
    points = []
    for a, b in zip(vertices, np.roll(vertices, -1, axis=0), strict=True):
        n = max(int(np.linalg.norm(b - a) / step), 2)
        points.append(a + (b - a) * np.linspace(0, 1, n)[:, None])
    return np.concatenate(points)


def inside(vertices, p):
    d = np.roll(vertices, -1, axis=0) - vertices
    r = p - vertices
    return bool(np.all(d[:, 0] * r[:, 1] - d[:, 1] * r[:, 0] >= 0))


pose = st.tuples(st.floats(-30, 30), st.floats(-30, 30), st.floats(-4, 4))
size = st.tuples(st.floats(3, 25), st.floats(1, 6))


@settings(max_examples=60, deadline=None)
@given(pose, size, pose, size)
def test_hull_distance_equals_brute_force(p1, s1, p2, s2):
    got, point, _ = _pair(*p1, *s1, *p2, *s2)
    a, b = hull(*p1, *s1), hull(*p2, *s2)
    if inside(a, b[0]) or inside(b, a[0]):
        assert got == 0.0
        return
    pa, pb = outline(a, 0.2), outline(b, 0.2)
    brute = np.sqrt(((pa[:, None] - pb[None]) ** 2).sum(-1)).min()
    assert got <= brute + 1e-9
    assert brute - got < 0.2
    brute_point = 0.0 if inside(a, np.array(p2[:2])) else np.linalg.norm(pa - p2[:2], axis=1).min()
    assert abs(point - brute_point) < 0.11


@settings(max_examples=100, deadline=None)
@given(st.floats(0, 6.3), st.floats(0, 6.3), st.floats(0, 6.3), st.floats(4, 15), st.floats(10, 150), st.floats(35, 900))
def test_far_distance_is_near_the_exact_one(bearing, p1, p2, l1, l2, gap):
    b1, b2 = l1 / 3, l2 / 6
    d = gap + 0.5 * (l1 + l2)
    n2, e2 = d * math.cos(bearing), d * math.sin(bearing)
    exact, _, far = _pair(0.0, 0.0, p1, l1, b1, n2, e2, p2, l2, b2)
    assert abs(far - exact) <= 0.02 * exact + 0.5 * b2 + 0.1 * l1


def _two_bodies(start1, end1, size1, start2, end2, size2, disc):
    worlds = np.zeros(1, world_dtype(V, M))
    w = worlds[0]
    v = w["vessels"]
    v["active"][0] = 1
    v["frame_eta"][0], v["eta"][0] = start1, end1
    v["length"][0], v["beam"][0] = size1
    w["safety"]["closest"][:] = np.inf
    w["safety"]["step_closest"][:] = np.inf
    w["safety"]["collided_with"][:] = -1
    if disc:
        m = w["obstacles"]
        m["active"][3] = 1
        m["frame_position"][3], m["position"][3] = start2[:2], end2[:2]
        m["radius"][3] = size2[0]
        s = V + 3
    else:
        v["active"][5] = 1
        v["frame_eta"][5], v["eta"][5] = start2, end2
        v["length"][5], v["beam"][5] = size2
        s = 5
    w["tick"], w["dt"] = 10, 0.1
    _sweep(worlds)
    return worlds[0]["safety"], s


@settings(max_examples=40, deadline=None)
@given(pose, pose, size, pose, pose, size, st.booleans())
def test_sweep_finds_the_closest_within_a_frame(a0, a1, s1, b0, b1, s2, disc):
    safety, s = _two_bodies(a0, a1, s1, b0, b1, s2, disc)
    brute = math.inf
    a0, a1, b0, b1 = (np.array(x) for x in (a0, a1, b0, b1))
    for t in np.linspace(0, 1, 401):
        a, b = a0 + t * (a1 - a0), b0 + t * (b1 - b0)
        if disc:
            _, d, _ = _pair(*a, *s1, *b, 1.0, 1.0)
            d = max(d - s2[0], 0.0)
        else:
            d = _pair(*a, *s1, *b, *s2)[0]
        brute = min(brute, d)
    closest = safety["closest"][0, s]
    if closest > geometry.CLOSE:
        return  # approximate by design
    assert closest >= brute - 0.35
    assert closest <= brute + 0.06 * brute + 0.1


def test_nothing_tunnels():
    """A boat that jumps 400 m in one frame, straight through a 2 m buoy and through a ship's beam, is caught."""
    start, end = (-200.0, 0.0, 0.0), (200.0, 0.0, 0.0)
    safety, s = _two_bodies(start, end, (5.0, 2.0), (0.0, 0.5, 0.0), (0.0, 0.5, 0.0), (1.0, 1.0), True)
    assert safety["collided_with"][0] == s
    safety, s = _two_bodies(start, end, (5.0, 2.0), (0.0, 10.0, 1.57), (0.0, 10.0, 1.57), (50.0, 4.0), False)
    assert safety["collided_with"][0] == s
    safety, s = _two_bodies(start, end, (5.0, 2.0), (0.0, 9.0, 0.0), (0.0, 9.0, 0.0), (5.0, 2.0), False)
    assert safety["collided_with"][0] == -1
    assert abs(safety["closest"][0, s] - 7.0) < 0.4


def _scene(rng, discs, ships, spread):
    worlds = np.zeros(1, world_dtype(V, M))
    w = worlds[0]
    w["vessels"]["active"][0] = 1
    w["vessels"]["eta"][0] = (*rng.uniform(-10, 10, 2), rng.uniform(-4, 4))
    for j in range(1, 1 + ships):
        w["vessels"]["active"][j] = 1
        w["vessels"]["eta"][j] = (*rng.uniform(-spread, spread, 2), rng.uniform(-4, 4))
        w["vessels"]["length"][j] = rng.uniform(20, 200)
        w["vessels"]["beam"][j] = w["vessels"]["length"][j] / 6
    for i in range(discs):
        w["obstacles"]["active"][i] = 1
        w["obstacles"]["position"][i] = rng.uniform(-spread, spread, 2)
        w["obstacles"]["radius"][i] = rng.uniform(2, 60)
    return worlds


def test_shadow_equals_casting_rays():
    """Visible is exactly what is nearest on some ray of its own bearing interval."""
    rng = np.random.default_rng(5)
    for _ in range(60):
        worlds = _scene(rng, rng.integers(1, M + 1), rng.integers(0, V), 600.0)
        w = worlds[0]
        count = _shadow(worlds, 700.0)
        found = w["order"][:count].copy()
        dn, de, ranges = w["look"][DN, :count], w["look"][DE, :count], w["look"][RANGE, :count]
        bearings, halves = np.arctan2(de, dn), np.arctan2(w["look"][WIDTH, :count], ranges)
        np.testing.assert_allclose(ranges, np.hypot(dn, de))
        assert np.all(np.diff(ranges) >= 0)
        expected = [
            math.hypot(*(w["vessels"]["eta"][s, :2] if s < V else w["obstacles"]["position"][s - V])
                       - w["vessels"]["eta"][0, :2]) <= 700.0
            for s in range(V + M)
            if s > 0 and (w["vessels"]["active"][s] if s < V else w["obstacles"]["active"][s - V])
        ]  # fmt: skip
        assert count == sum(expected)
        # every elementary interval between two edges of any source has one nearest source
        edges = np.sort(np.mod(np.concatenate([bearings - halves, bearings + halves]), 2 * np.pi))
        middles = 0.5 * (edges + np.roll(edges, -1))
        middles[-1] = 0.5 * (edges[-1] + edges[0] + 2 * np.pi)
        seen = set()
        for ray in middles:
            hit = np.flatnonzero(np.abs((ray - bearings + np.pi) % (2 * np.pi) - np.pi) < halves)
            if len(hit):
                seen.add(int(found[hit[0]]))
        assert seen == {int(s) for s, hidden in zip(found, w["hidden"], strict=False) if not hidden}


def test_partly_hidden_is_seen_and_wholly_hidden_is_not():
    worlds = np.zeros(1, world_dtype(V, M))
    w = worlds[0]
    w["vessels"]["active"][0] = 1
    m = w["obstacles"]
    m["active"][:3] = 1
    m["radius"][:3] = 10.0, 5.0, 40.0
    m["position"][:3] = (-100.0, 0.0), (-200.0, 1.0), (-300.0, 0.0)  # due south, where bearings jump
    assert _shadow(worlds, 1000.0) == 3
    assert w["order"][:3].tolist() == [V, V + 1, V + 2]
    assert w["hidden"][:3].tolist() == [0, 1, 0]
