import numpy as np
import pytest
from scipy.optimize import lsq_linear

from maniport.mocap.path_solver import solve_each, solve_path

DOF, FRAMES = 3, 7


@pytest.fixture
def linear():
    """A random linear least-squares problem for each frame."""
    generator = np.random.default_rng(3)
    return generator.normal(size=(FRAMES, 4, DOF)), generator.normal(size=(FRAMES, 4))


def bounds(width):
    """Limits of that width on both sides."""
    return np.full(DOF, -width), np.full(DOF, width)


@pytest.mark.parametrize("width", [100.0, 0.2])
def test_frames_alone_agree_with_scipy(linear, width):
    """Free and bounded, every frame finds the optimum that SciPy's bounded linear least squares finds."""
    matrices, targets = linear
    lower, upper = bounds(width)

    def residual(q, rows):
        return np.einsum("nri,ni->nr", matrices[rows], q) - targets[rows], matrices[rows].copy()

    q, cost = solve_each(residual, np.zeros((FRAMES, DOF)), lower, upper, iterations=60)
    for t in range(FRAMES):
        reference = lsq_linear(matrices[t], targets[t], (lower, upper), tol=1e-14)
        np.testing.assert_allclose(q[t], reference.x, atol=1e-5)
        assert cost[t] == pytest.approx(2 * reference.cost, abs=1e-9)


@pytest.mark.parametrize("width", [100.0, 0.2])
def test_a_path_agrees_with_one_large_problem(linear, width):
    """Smoothing, pull and limits together give the optimum of the same problem written out as one dense matrix."""
    matrices, targets = linear
    lower, upper = bounds(width)
    smoothing = np.zeros((FRAMES, DOF))
    smoothing[1:-1] = [0.5, 1.0, 2.0]
    pull, neutral = np.array([0.0, 0.3, 0.0]), np.array([0.0, 0.1, 0.0])

    def residual(q):
        return np.einsum("nri,ni->nr", matrices, q) - targets, matrices.copy()

    q = solve_path(residual, np.zeros((FRAMES, DOF)), lower, upper, smoothing, pull, neutral)
    rows, values = [], []
    for t in range(FRAMES):
        block = np.zeros((4, FRAMES, DOF))
        block[:, t] = matrices[t]
        anchor = np.zeros((DOF, FRAMES, DOF))
        anchor[:, t] = np.diag(pull)
        rows += [block, anchor]
        values += [targets[t], pull * neutral]
        if 0 < t < FRAMES - 1:
            bend = np.zeros((DOF, FRAMES, DOF))
            bend[:, t - 1], bend[:, t], bend[:, t + 1] = (np.diag(factor * smoothing[t]) for factor in (1, -2, 1))
            rows.append(bend)
            values.append(np.zeros(DOF))
    dense = np.concatenate(rows).reshape(-1, FRAMES * DOF)
    reference = lsq_linear(dense, np.concatenate(values), (np.tile(lower, FRAMES), np.tile(upper, FRAMES)), tol=1e-14)
    np.testing.assert_allclose(q.ravel(), reference.x, atol=2e-3 if width < 1 else 1e-8)
    assert np.sum((dense @ q.ravel() - np.concatenate(values)) ** 2) == pytest.approx(2 * reference.cost, rel=1e-4)
