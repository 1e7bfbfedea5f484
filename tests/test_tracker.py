"""The tracker against an oracle, against the thesis's formulas and against what its own covariances promise."""

import math

import numpy as np
import pytest
from filterpy.kalman import ExtendedKalmanFilter

from usv_gym.jit import inner
from usv_gym.sensors import ekf, fusion, motion, tracker
from usv_gym.world.state import NP_AIS, NP_SCAN, NX_AIS, NX_SCAN, PHASE_MOTION, PHASE_NONE, PHASE_POSITION, world_dtype

DEG = math.pi / 180.0
KNOT = 1852.0 / 3600.0
AIS, RADAR, LIDAR, FUSED = range(4)
SIZES = {AIS: (NX_AIS, NP_AIS), RADAR: (NX_SCAN, NP_SCAN), LIDAR: (NX_SCAN, NP_SCAN)}


def sensors(inflation=1.0):
    """Appendix B of the thesis; a bias "variance" is the density of w_b, so the stationary variance is var T / 2."""
    s = np.zeros((), world_dtype(8, 16)["sensors"])
    s["process_u"], s["process_r"], s["process_time"], s["inflation"] = 1e-6, 3e-8, 100.0, inflation
    white = np.array([5.0, 5.0, DEG**2, DEG**2, 0.5 * KNOT**2, 2000.0 * (DEG / 60.0) ** 2])
    drive = np.array([0.5, 0.5, 0.5 * DEG**2, 0.5 * DEG**2, 0.1 * KNOT**2, 500.0 * (DEG / 60.0) ** 2])
    s["ais_bias_time"] = 20.0, 20.0, 10.0, 10.0, 10.0, 10.0
    s["ais_noise"], s["ais_bias"] = np.sqrt(white), np.sqrt(drive * s["ais_bias_time"] / 2.0)
    for name, white, drive, time in (
        ("radar", (10.0, 20.0), (0.5, 3.0), (10.0, 5.0)),
        ("lidar", (0.1, 0.1), (0.1, 0.1), (0.1, 1.0)),
    ):
        s[name]["noise"], s[name]["bias_time"] = np.sqrt(white), time
        s[name]["bias"] = np.sqrt(np.array(drive) * np.array(time) / 2.0)
    return s


def unpack(packed):
    """Full symmetric matrices of packed lower triangles [..., n (n + 1) / 2]."""
    n = (math.isqrt(8 * packed.shape[-1] + 1) - 1) // 2
    i, j = np.tril_indices(n)
    full = np.empty((*packed.shape[:-1], n, n))
    full[..., i, j] = full[..., j, i] = packed
    return full


def pack(full):
    return full[np.tril_indices(len(full))].copy()


def random_covariance(rng, scale):
    a = rng.normal(size=(len(scale), len(scale) + 3))
    return (a @ a.T / len(scale)) * np.outer(scale, scale)


@inner
def step(sensor, x, P, h, z, f, s):
    """One prediction and one update of any of the three filters."""
    if sensor == 0:
        ekf.predict_ais(x, P, h, s)
        ekf.update_ais(x, P, z[0], z[1], z[2], z[3], z[4], s)
    elif sensor == 1:
        ekf.predict_scan(x, P, h, s, s.radar)
        ekf.update_scan(x, P, z[0], z[1], f, s.radar)
    else:
        ekf.predict_scan(x, P, h, s, s.lidar)
        ekf.update_scan(x, P, z[0], z[1], f, s.lidar)


# --- (1) oracle ------------------------------------------------------------------------------------------------------
class Oracle(ExtendedKalmanFilter):
    """Textbook matrices; the Jacobian is a complex-step derivative of the discrete map, so it shares no algebra."""

    def __init__(self, sensor, s):
        n = SIZES[sensor][0]
        super().__init__(dim_x=n, dim_z=5 if sensor == AIS else 2)
        self.T = float(s["process_time"])
        if sensor == AIS:
            pick = [0, 1, 2, 4, 5]
            self.white, self.sigma, self.time = (s[k][pick] for k in ("ais_noise", "ais_bias", "ais_bias_time"))
        else:
            r = s["radar" if sensor == RADAR else "lidar"]
            self.white, self.sigma, self.time = (np.repeat(r[k][0], 2) for k in ("noise", "bias", "bias_time"))
        self.stationary = np.array([s["process_u"], s["process_r"]]) * self.T / 2.0

    def motion(self, x, h):
        a = np.exp(-h / self.T)
        c = self.T * (1.0 - a)
        n, e, psi, u, r, b1, b2 = x[:7]
        mid_psi, mid_u = psi + h / 2 * r, u + h / 2 * b1
        moved = [n + h * mid_u * np.cos(mid_psi), e + h * mid_u * np.sin(mid_psi)]
        moved += [psi + h * r + self.T * (h - c) * b2, u + c * b1, r + c * b2, a * b1, a * b2]
        return np.concatenate([moved, np.exp(-h / self.time) * x[7:]])

    def predict_x(self, u=0):
        self.x = self.motion(self.x, self.h)

    def advance(self, h):
        steps = motion.substeps(h, self.x[4])
        for _ in range(steps):
            self.h = h / steps
            nudge = 1e-30j * np.eye(self.dim_x)
            self.F = np.stack([self.motion(self.x + d, self.h).imag / 1e-30 for d in nudge], axis=1)
            a = np.exp(-2.0 * self.h / np.array([self.T, self.T, *self.time]))
            self.Q = np.diag(np.r_[np.zeros(5), (1.0 - a) * np.r_[self.stationary, self.sigma**2]])
            self.predict()

    def measure(self, z, f):
        use = ~np.isnan(z)
        m = len(z)
        H = np.hstack([np.eye(m, 7), f * np.eye(m, self.dim_x - 7)])[use]

        def residual(a, b):
            d = a - b
            if m == 5 and use[2]:
                i = use[:2].sum()
                d[i] = (d[i] + math.pi) % (2.0 * math.pi) - math.pi
            return d

        self.dim_z = use.sum()
        self._I = np.eye(self.dim_x)
        self.update(z[use], lambda x: H, lambda x: H @ x, R=np.diag((f * self.white[use]) ** 2), residual=residual)


@pytest.mark.parametrize("sensor", [AIS, RADAR, LIDAR])
def test_run_equals_filterpy(sensor):
    rng = np.random.default_rng(sensor)
    s = sensors()
    n, size = SIZES[sensor]
    x = np.zeros(n)
    x[:5] = 10.0, -20.0, 6.2, 5.0, 0.01  # close to 360 deg, turning across it
    scale = np.array([3.0, 3.0, 0.2, 1.0, 0.02, 0.01, 0.001, *([1.0] * 5)])[:n]
    P = pack(random_covariance(rng, scale))
    assert P.shape == (size,)
    oracle = Oracle(sensor, s)
    oracle.x, oracle.P = x.copy(), unpack(P)
    t = 0.0
    for k in range(60):
        h = [10.0, 2.5, 0.1, 1.25, rng.uniform(0.05, 11.0)][k % 5]
        t += h
        psi = 6.2 + 0.01 * t
        z = np.array([10.0 + 5.0 * t, -20.0, psi % (2.0 * math.pi), 5.0, 0.01])
        z += rng.normal(size=5) * [3.0, 3.0, 0.03, 0.3, 0.01]
        if sensor == AIS:
            z[rng.random(5) < 0.15] = np.nan
            f = 1.0
        else:
            z = z[:2]
            f = rng.uniform(0.2, 10.0)
        step(sensor, x, P, h, z, f, s[()])
        oracle.advance(h)
        oracle.measure(z, f)
        np.testing.assert_allclose(x, oracle.x, rtol=0.0, atol=1e-9)
        deviation = np.sqrt(np.diag(oracle.P))
        assert np.abs((unpack(P) - oracle.P) / np.outer(deviation, deviation)).max() < 1e-9


# --- (2) Simple Fusion -----------------------------------------------------------------------------------------------
@inner
def fuse_all(x, P, phases):
    """Fuse rows 1, 2, ... into row 0."""
    phase = phases[0]
    for i in range(1, len(phases)):
        phase = fusion.fuse(x[0], P[0], phase, x[i], P[i], phases[i])
    return phase


@pytest.mark.parametrize("phases", [(2, 2), (2, 2, 2), (2, 1), (1, 2), (1, 2, 1), (1, 1), (0, 2), (2, 0, 1), (0, 1, 0)])
def test_fusion_is_the_inverse_covariance_average(phases):
    rng = np.random.default_rng(len(phases))
    scale = np.array([3.0, 2.0, 0.05, 0.3, 0.01])
    x, P = np.zeros((len(phases), 7)), np.zeros((len(phases), 28))
    information, weighted = np.zeros((5, 5)), np.zeros(5)
    for i, phase in enumerate(phases):
        n = {PHASE_NONE: 0, PHASE_POSITION: 2, PHASE_MOTION: 5}[phase]
        estimate = np.array([100.0, -50.0, 0.0, 5.0, 0.0])[:n] + rng.normal(size=n) * scale[:n]
        cov = random_covariance(rng, scale[:n])
        information[:n, :n] += np.linalg.inv(cov)
        weighted[:n] += np.linalg.solve(cov, estimate)
        x[i, :n] = estimate
        P[i, : n * (n + 1) // 2] = pack(cov)
        if n == 5 and i % 2:
            x[i, 2] += 2.0 * math.pi  # the same heading, one turn on
    m = 5 if PHASE_MOTION in phases else 2
    cov = np.linalg.inv(information[:m, :m])
    expected = cov @ weighted[:m]
    result = fuse_all(x, P, np.array(phases, np.int8))
    assert result == max(phases)
    got = x[0, :m].copy()
    if m == 5:
        got[2] = (got[2] + math.pi) % (2.0 * math.pi) - math.pi
    np.testing.assert_allclose(got, expected, rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(unpack(P[0, : m * (m + 1) // 2]), cov, rtol=1e-9, atol=1e-12)


def test_size_fusion():
    radius, variance = fusion.fuse_size(10.0, 4.0, 13.0, 2.0)
    assert (radius, variance) == pytest.approx((12.0, 4.0 / 3.0))


# --- (3), (5), (6): runs over many seeds -----------------------------------------------------------------------------
@inner
def run(s, h, x0, P0, z, size, x, P, alpha):
    """Filter measurements z [S, T, 3, 5] and sizes [S, T, 2]; write estimates x [S, T, 4, 5], P and alpha [S, T, 3]."""
    xa, Pa = np.empty(12), np.empty(78)
    xs, Ps = np.empty((2, 9)), np.empty((2, 45))
    a, A = np.empty((2, 2)), np.empty((2, 3))
    X, Q = np.empty((3, 7)), np.empty((3, 28))
    for k in range(z.shape[0]):
        for y, C in ((xa, Pa), (xs[0], Ps[0]), (xs[1], Ps[1])):
            y[:] = 0.0
            C[:] = 0.0
            y[:5] = x0[k]
            for i in range(7):
                C[i * (i + 1) // 2 + i] = P0[i] * s.inflation
        for i in range(5):
            bias = s.ais_bias[i if i < 3 else i + 1]
            Pa[(7 + i) * (8 + i) // 2 + 7 + i] = bias * bias
        for i in range(2):
            scan = s.radar if i == 0 else s.lidar
            Ps[i, 35] = Ps[i, 44] = scan.bias[0] ** 2
            a[i, 0], a[i, 1], A[i, 0], A[i, 1], A[i, 2] = 10.0, 0.0, 1.0, 0.0, scan.bias[1] ** 2
        for t in range(z.shape[1]):
            dt = h if t > 0 else 0.0
            step(0, xa, Pa, dt, z[k, t, 0], 1.0, s)
            step(1, xs[0], Ps[0], dt, z[k, t, 1], 1.0, s)
            step(2, xs[1], Ps[1], dt, z[k, t, 2], 1.0, s)
            for i in range(2):
                scan = s.radar if i == 0 else s.lidar
                ekf.decays(scan, dt)
                ekf.predict_size(a[i], A[i], scan.decay[1], scan.bias[1])
                ekf.update_size(a[i], A[i], size[k, t, i], 1.0, scan.noise[1])
                alpha[k, t, i] = a[i, 0]
            alpha[k, t, 2] = fusion.fuse_size(a[0, 0], A[0, 0], a[1, 0], A[1, 0])[0]
            for i in range(3):
                y, C = (xa, Pa) if i == 0 else (xs[i - 1], Ps[i - 1])
                tracker.predicted(y, C, 2, 0.0, s, X[i], Q[i])
                x[k, t, i] = X[i, :5]
                P[k, t, i] = Q[i, :15]
            fusion.fuse(X[0], Q[0], 2, X[1], Q[1], 2)
            fusion.fuse(X[0], Q[0], 2, X[2], Q[2], 2)
            x[k, t, 3] = X[0, :5]
            P[k, t, 3] = Q[0, :15]


def gauss_markov(rng, shape, sigma, time, h):
    """Stationary first-order Gauss-Markov process along axis 1 of shape."""
    b = rng.normal(size=shape) * sigma
    a = np.exp(-h / np.asarray(time))
    for t in range(1, shape[1]):
        b[:, t] = a * b[:, t - 1] + np.sqrt(1.0 - a * a) * b[:, t]
    return b


def sinusoid(seeds, steps, h, mean=45.0, fine=200):
    """Truth of thesis 3.2.3 [S, T, 5]: 5 m/s, heading mean + 25 deg sin(2 pi t / 120 s)."""
    t = np.arange((steps - 1) * fine + 1) * h / fine
    w = 2.0 * math.pi / 120.0
    psi = mean * DEG + 25.0 * DEG * np.sin(w * t)
    mid = mean * DEG + 25.0 * DEG * np.sin(w * (t[:-1] + 0.5 * h / fine))
    path = np.zeros((len(t), 5))
    path[1:, 0] = np.cumsum(5.0 * np.cos(mid)) * h / fine
    path[1:, 1] = np.cumsum(5.0 * np.sin(mid)) * h / fine
    path[:, 2], path[:, 3], path[:, 4] = psi, 5.0, 25.0 * DEG * w * np.cos(w * t)
    return np.broadcast_to(path[::fine], (seeds, steps, 5))


def matched(rng, s, seeds, steps, h, fine=20):
    """Truth that obeys the model of the filters [S, T, 5]."""
    g = h / fine
    T = float(s["process_time"])
    drive = np.sqrt(np.array([s["process_u"], s["process_r"]]) * T / 2.0)
    b = drive * rng.normal(size=(seeds, 2))
    a = math.exp(-g / T)
    n, e, psi = np.zeros(seeds), np.zeros(seeds), rng.uniform(0.0, 2.0 * math.pi, seeds)
    u, r = 5.0 + 0.0 * n, 0.01 * rng.normal(size=seeds)
    out = np.empty((seeds, steps, 5))
    for k in range((steps - 1) * fine + 1):
        if k % fine == 0:
            out[:, k // fine] = np.stack([n, e, psi, u, r], axis=1)
        mid_psi, mid_u = psi + g / 2 * r, u + g / 2 * b[:, 0]
        n, e = n + g * mid_u * np.cos(mid_psi), e + g * mid_u * np.sin(mid_psi)
        psi, u, r = psi + g * (r + g / 2 * b[:, 1]), u + g * b[:, 0], r + g * b[:, 1]
        b = a * b + math.sqrt(1.0 - a * a) * drive * rng.normal(size=b.shape)
    return out


def study(rng, s, truth, h, wrapped=True):
    """Errors [S, T, 4, 5], packed covariances and errors of the radius [S, T, 3] of all filters and their fusion."""
    seeds, steps = truth.shape[:2]
    z = np.repeat(truth[:, :, None], 3, axis=2)
    pick = [0, 1, 2, 4, 5]
    shape = (seeds, steps, 5)
    z[:, :, AIS] += rng.normal(size=shape) * s["ais_noise"][pick]
    z[:, :, AIS] += gauss_markov(rng, shape, s["ais_bias"][pick], s["ais_bias_time"][pick], h)
    if wrapped:
        z[:, :, AIS, 2] %= 2.0 * math.pi
    size = np.full((seeds, steps, 2), 10.0)
    for i, name in enumerate(("radar", "lidar")):
        r = s[name]
        error = rng.normal(size=(seeds, steps, 3)) * r["noise"][[0, 0, 1]]
        error += gauss_markov(rng, (seeds, steps, 3), r["bias"][[0, 0, 1]], r["bias_time"][[0, 0, 1]], h)
        z[:, :, 1 + i, :2] += error[..., :2]
        size[:, :, i] += error[..., 2]
    T = float(s["process_time"])
    P0 = np.array([10.0, 10.0, (10.0 * DEG) ** 2, 1.0, DEG**2, s["process_u"] * T / 2, s["process_r"] * T / 2])
    x0 = truth[:, 0] + rng.normal(size=(seeds, 5)) * np.sqrt(P0[:5])
    x, P = np.empty((seeds, steps, 4, 5)), np.empty((seeds, steps, 4, 15))
    alpha = np.empty((seeds, steps, 3))
    run(s[()], h, x0, P0, z, size, x, P, alpha)
    error = x - truth[:, :, None]
    error[..., 2] = (error[..., 2] + math.pi) % (2.0 * math.pi) - math.pi
    return error, P, alpha - 10.0


def anees(error, P):
    """Average normalised estimation error squared per state [4], and the share within the 95 % gate."""
    value = np.einsum("...i,...i", error, np.linalg.solve(unpack(P), error[..., None])[..., 0])
    return value.mean(axis=(0, 1)) / 5.0, (value < 11.07).mean(axis=(0, 1))


@pytest.fixture(scope="module")
def reference():
    """Reference configuration: 200 seeds of the thesis's manoeuvre at 100 m, every sensor measures every 2 s."""
    error, _, radius = study(np.random.default_rng(1), sensors(), sinusoid(200, 151, 2.0), 2.0)
    return error[:, 25:].std(axis=1), radius[:, 25:].std(axis=1)


def test_reference_configuration(reference):
    deviation, radius = reference
    median = np.median(deviation, axis=0)[:, [1, 0, 2, 3]] / [1.0, 1.0, DEG, 1.0]
    expected = [
        [1.90, 1.88, 1.57, 0.092],
        [2.24, 2.23, 5.79, 0.090],
        [0.225, 0.225, 1.01, 0.023],
        [0.210, 0.212, 0.974, 0.019],
    ]
    np.testing.assert_allclose(median, expected, rtol=0.15)  # E, N [m], psi [deg], u [m/s] of AIS, radar, LiDAR, fusion
    np.testing.assert_allclose(np.median(radius, axis=0), [0.219, 0.022, 0.022], rtol=0.25)


def test_fusion_follows_the_best_sensor(reference):
    deviation = reference[0][:, :, :4]
    ratio = (deviation[:, FUSED] / deviation[:, :FUSED].min(axis=1)).max(axis=1)
    assert (ratio <= 1.05).mean() >= 0.85
    assert (ratio <= 1.10).mean() >= 0.97
    assert (ratio < 1.0).mean() >= 0.60
    assert (deviation[:, :FUSED, :2].argmin(axis=1) == LIDAR).all(axis=1).mean() >= 0.99
    assert (deviation[:, :FUSED, 2].argmax(axis=1) == RADAR).mean() >= 0.99


def test_heading_across_north(reference):
    runs = [
        study(np.random.default_rng(1), sensors(), sinusoid(200, 151, 2.0, mean=0.0), 2.0, wrapped)[0]
        for wrapped in (True, False)
    ]
    np.testing.assert_allclose(runs[0], runs[1], rtol=0.0, atol=1e-8)
    across = np.median(runs[0][:, 25:].std(axis=1), axis=0)
    np.testing.assert_allclose(across[:, 2:4], np.median(reference[0], axis=0)[:, 2:4], rtol=0.05)


def test_local_filters_are_consistent_and_simple_fusion_is_not():
    """Documents the defect of the rule (module ``fusion``), and that Carlson's inflation cures it."""
    s = sensors()
    s["process_u"], s["process_r"] = 3e-7, 1.5e-10  # a calm ship: what the sensors have in common matters more
    truth = matched(np.random.default_rng(2), s, 400, 151, 2.0)
    ratio, inside = anees(*(a[:, 25:] for a in study(np.random.default_rng(3), s, truth, 2.0)[:2]))
    assert (np.abs(ratio[:FUSED] - 1.0) < 0.1).all(), ratio
    assert (inside[:FUSED] > 0.92).all(), inside
    assert ratio[FUSED] > 1.3
    assert inside[FUSED] < 0.90
    s["inflation"] = 3.0
    ratio, inside = anees(*(a[:, 25:] for a in study(np.random.default_rng(3), s, truth, 2.0)[:2]))
    assert 0.75 < ratio[FUSED] < 1.15
    assert inside[FUSED] > 0.92


@pytest.mark.parametrize("h", [0.1, 2.0])
def test_an_hour_with_a_fast_bias(h):
    """The bias of the LiDAR lives for 0.1 s; an Euler step of 2 s would multiply it by -19."""
    rng, s = np.random.default_rng(4), sensors()[()]
    x, P = np.zeros(NX_SCAN), np.zeros(NP_SCAN)
    ekf.init_scan_motion(x, P, 0.0, 0.0, 1.0, 1.0, 5.0, 0.0, 0.1, 1.0, 1e-4, s, s["lidar"])
    for k in range(1, int(3600 / h) + 1):
        z = 5.0 * k * h * np.array([math.cos(1.0), math.sin(1.0)]) + 0.33 * rng.normal(size=2)
        step(LIDAR, x, P, h, z, 1.0, s)
    assert np.hypot(x[0] - 18000.0 * math.cos(1.0), x[1] - 18000.0 * math.sin(1.0)) < 1.0
    assert np.linalg.eigvalsh(unpack(P)).min() > 0.0
    assert (abs(x[7]), P[35]) < (1.0, 0.01)


# --- (4) phases ------------------------------------------------------------------------------------------------------
@inner
def follow(s, scan, h, f, z, x, P, phase):
    """Track fixes z [S, T, 2]; write x [S, T, 9], P [S, T, 45] and phase [S, T]."""
    y, C, start = np.empty(9), np.empty(45), np.empty(10)
    for k in range(z.shape[0]):
        now = 0
        for t in range(z.shape[1]):
            now = tracker.track_scan(y, C, start, now, h, z[k, t, 0], z[k, t, 1], f, s, scan)
            x[k, t] = y
            P[k, t] = C
            phase[k, t] = now


def scans(rng, name, seeds, minutes, h, f, speed):
    """Radar or LiDAR alone on targets of constant speed and random heading: truth, x, P, phase."""
    s, steps = sensors(), int(minutes * 60.0 / h)
    psi = rng.uniform(0.0, 2.0 * math.pi, (seeds, 1))
    path = np.asarray(speed) * h * np.arange(steps)
    truth = np.stack(np.broadcast_arrays(path * np.cos(psi), path * np.sin(psi), psi, speed + 0.0 * path, 0.0), axis=-1)
    shape = (seeds, steps, 2)
    scan = s[name]
    bias = gauss_markov(rng, shape, scan["bias"][0], scan["bias_time"][0], h)
    z = truth[..., :2] + f * (rng.normal(size=shape) * scan["noise"][0] + bias)
    x, P, phase = np.empty((seeds, steps, 9)), np.empty((seeds, steps, 45)), np.empty((seeds, steps), np.int8)
    follow(s[()], s[()][name], h, f, z, x, P, phase)
    return truth, x, P, phase, z


@pytest.mark.parametrize(("f", "reversed_at_most"), [(1.0, 0.0), (10.0, 0.01)])
def test_radar_alone_finds_the_direction(f, reversed_at_most):
    truth, x, P, phase, z = scans(np.random.default_rng(6), "radar", 200, 5.0, 2.5, f, 5.0)
    off = np.abs((x[..., 2] - truth[..., 2] + math.pi) % (2.0 * math.pi) - math.pi)
    moving = phase == PHASE_MOTION
    assert moving[:, -1].all()
    first = moving.argmax(axis=1)
    rows = np.arange(200)
    assert (off[rows, first] > math.pi / 2).mean() <= reversed_at_most
    assert (off[:, -1] > math.pi / 2).mean() <= reversed_at_most
    displaced = np.hypot(*(z[rows, first] - z[:, 0]).T)
    assert (displaced > 3.0 * f * math.sqrt(2.0 * 12.5)).all()
    assert np.median(first) * 2.5 <= (10.0 if f == 1.0 else 40.0)
    unknown = phase == PHASE_POSITION
    square = ((x[..., :2] - truth[..., :2]) ** 2).sum(axis=-1)
    assert 0.5 < (square / (2.0 * P[..., 0]))[unknown].mean() < 2.0
    late = moving & (np.arange(120) > first[:, None] + 8)
    error = x[late][:, :5] - truth[late]
    error[:, 2] = (error[:, 2] + math.pi) % (2.0 * math.pi) - math.pi
    nees = np.einsum("...i,...i", error, np.linalg.solve(unpack(P[late][:, :15]), error[..., None])[..., 0]) / 5.0
    assert nees.mean() < 1.2


@pytest.mark.parametrize(
    ("name", "h", "f", "minutes"), [("radar", 2.5, 1.0, 60.0), ("radar", 2.5, 10.0, 60.0), ("lidar", 1.0, 0.5, 20.0)]
)
def test_an_iceberg_stays_unknown(name, h, f, minutes):
    truth, x, P, phase, _ = scans(np.random.default_rng(7), name, 100, minutes, h, f, 0.0)
    starts = ((phase[:, 1:] == PHASE_MOTION) & (phase[:, :-1] == PHASE_POSITION)).sum()
    assert starts / (100 * minutes / 60.0) <= 0.3  # per target and hour
    assert (phase == PHASE_MOTION).mean() < 1e-3
    square = ((x[:, -1, :2] - truth[:, -1, :2]) ** 2).sum(axis=-1)
    fix = math.sqrt(2.0) * f * math.hypot(*(sensors()[name][k][0] for k in ("noise", "bias")))
    assert math.sqrt(square.mean()) < 0.25 * fix  # averaged
    assert 0.6 < (square / (2.0 * P[:, -1, 0])).mean() < 1.6


def test_a_ship_that_stops_is_unknown_again():
    speed = np.where(np.arange(240) < 100, 5.0, 0.0)
    s = sensors()
    scan = s["radar"]
    rng = np.random.default_rng(8)
    z = np.zeros((50, 240, 2))
    z[..., 0] = np.cumsum(speed) * 2.5
    bias = gauss_markov(rng, z.shape, scan["bias"][0], scan["bias_time"][0], 2.5)
    z += rng.normal(size=z.shape) * scan["noise"][0] + bias
    x, P, phase = np.empty((50, 240, 9)), np.empty((50, 240, 45)), np.empty((50, 240), np.int8)
    follow(s[()], s[()]["radar"], 2.5, 1.0, z, x, P, phase)
    assert (phase[:, 99] == PHASE_MOTION).all()
    assert (phase[:, -1] == PHASE_POSITION).mean() >= 0.95


def test_fold_keeps_the_covariance_of_the_same_motion():
    rng = np.random.default_rng(9)
    x = rng.normal(size=9)
    x[3] = -2.0
    full = random_covariance(rng, np.ones(9))
    y, P = x.copy(), pack(full)
    tracker.fold(y, P)
    sign = np.array([1, 1, 1, -1, 1, -1, 1, 1, 1])
    np.testing.assert_allclose(y, sign * x + math.pi * (np.arange(9) == 2))
    np.testing.assert_allclose(unpack(P), full * np.outer(sign, sign))


def test_first_ais_messages():
    s = sensors()[()]
    x, P = np.zeros(NX_AIS), np.zeros(NP_AIS)
    nan = math.nan
    phase = tracker.track_ais(x, P, PHASE_NONE, 0.0, 10.0, 20.0, nan, nan, nan, s)  # an aid to navigation
    assert phase == PHASE_POSITION
    phase = tracker.track_ais(x, P, phase, 10.0, 12.0, 20.0, nan, nan, nan, s)
    assert phase == PHASE_POSITION
    assert 10.0 < x[0] < 12.0
    assert P[0] < 10.0
    phase = tracker.track_ais(x, P, phase, 10.0, 12.0, 20.0, 1.0, 5.0, nan, s)
    assert phase == PHASE_MOTION
    np.testing.assert_allclose(x[:5], [12.0, 20.0, 1.0, 5.0, 0.0])
    full = unpack(P)
    assert np.linalg.eigvalsh(full).min() > 0.0
    # the first message and the bias: what the message says of x + b is as good as its white noise
    for i, field in ((0, 0), (1, 1), (2, 2), (3, 4)):
        total = full[i, i] + 2.0 * full[i, 7 + i] + full[7 + i, 7 + i]
        assert total == pytest.approx(s["ais_noise"][field] ** 2)
    phase = tracker.track_ais(x, P, phase, 10.0, nan, nan, nan, nan, nan, s)  # nothing usable: a prediction
    np.testing.assert_allclose(x[:2], [12.0 + 50.0 * math.cos(1.0), 20.0 + 50.0 * math.sin(1.0)])


def test_copies_leave_the_filter_alone():
    s = sensors()[()]
    x, P = np.zeros(NX_SCAN), np.zeros(NP_SCAN)
    ekf.init_scan_motion(x, P, 0.0, 0.0, 1.0, 1.0, 5.0, 0.0, 0.1, 1.0, 1e-4, s, s["radar"])
    before = x.copy(), P.copy()
    X, Q = np.zeros(7), np.zeros(28)
    tracker.predicted(x, P, PHASE_MOTION, 3.0, s, X, Q)
    np.testing.assert_array_equal((x, P)[0], before[0])
    np.testing.assert_array_equal(P, before[1])
    ekf.predict_scan(x, P, 3.0, s, s["radar"])
    np.testing.assert_array_equal(X, x[:7])
    np.testing.assert_array_equal(Q, P[:28])
    tracker.predicted(x, P, PHASE_POSITION, 3.0, s, X, Q)
    assert list(X[:3]) == [x[0], x[1], 0.0]
    assert list(Q[:4]) == [P[0], 0.0, P[0], 0.0]


def test_no_time_leaves_a_bias_as_it_is():
    """Also where it is the first that a scan is asked for."""
    scan = sensors()[()]["radar"]
    for h, share in ((0.0, 1.0), (2.5, math.exp(-0.25)), (0.0, 1.0)):
        ekf.decays(scan, h)
        assert scan["decay"][0] == pytest.approx(share, rel=1e-15)


def test_sensors_without_noise():
    s = sensors()
    for name in ("radar", "lidar"):
        s[name]["noise"] = s[name]["bias"] = s[name]["bias_time"] = 0.0
    s["ais_noise"] = s["ais_bias"] = s["ais_bias_time"] = 0.0
    x, P, start = np.zeros(NX_SCAN), np.zeros(NP_SCAN), np.zeros(10)
    y, Q = np.zeros(NX_AIS), np.zeros(NP_AIS)
    scan = ais = PHASE_NONE
    for k in (0, 0, *range(1, 30)):  # the second fix comes at the time of the first
        h = 2.5 if k else 0.0
        scan = tracker.track_scan(x, P, start, scan, h, 3.0 * k, 4.0 * k, 1.0, s[()], s[()]["radar"])
        ais = tracker.track_ais(y, Q, ais, h, 3.0 * k, 4.0 * k, math.atan2(4.0, 3.0), 2.0, 0.0, s[()])
    assert scan == ais == PHASE_MOTION
    for estimate in (x, y):
        np.testing.assert_allclose(estimate[:5], [87.0, 116.0, math.atan2(4.0, 3.0), 2.0, 0.0], atol=1e-3)
