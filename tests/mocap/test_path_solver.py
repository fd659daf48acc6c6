import numpy as np
import pytest
from scipy.optimize import lsq_linear

from maniport.mocap.path_solver import solve_long, solve_path

DOF = 3


def problem(frames, width, smoothing):
    """A random linear least-squares problem for each frame: matrices, targets, and the arguments of `solve_path`."""
    generator = np.random.default_rng(3)
    matrices, targets = generator.normal(size=(frames, 4, DOF)), generator.normal(size=(frames, 4))
    weights = np.zeros((frames, DOF))
    weights[1:-1] = smoothing
    limits = np.full(DOF, -width), np.full(DOF, width)
    pull, neutral = np.array([0.0, 0.3, 0.05]), np.array([0.0, 0.1, 0.0])
    return matrices, targets, (np.zeros((frames, DOF)), *limits, weights, pull, neutral)


def residual_of(matrices, targets, rows=slice(None)):
    return lambda q: (np.einsum("nri,ni->nr", matrices[rows], q) - targets[rows], matrices[rows].copy())


@pytest.mark.parametrize("width", [100.0, 0.2])
def test_a_path_agrees_with_one_large_problem(width):
    smoothing, n = np.array([0.5, 1.0, 2.0]), 7
    matrices, targets, arguments = problem(n, width, smoothing)
    q = solve_path(residual_of(matrices, targets), *arguments)
    *_, pull, neutral = arguments
    difference = np.diff(np.eye(n), 2, axis=0)
    blocks = np.zeros((n, 4, n, DOF))
    blocks[np.arange(n), :, np.arange(n)] = matrices
    dense = np.concatenate([
        blocks.reshape(-1, n * DOF), np.kron(np.eye(n), np.diag(pull)), np.kron(difference, np.diag(smoothing))
    ])  # fmt: skip
    values = np.concatenate([targets.ravel(), np.tile(pull * neutral, n), np.zeros((n - 2) * DOF)])
    reference = lsq_linear(dense, values, (-width, width), tol=1e-14)
    np.testing.assert_allclose(q.ravel(), reference.x, atol=2e-3 if width < 1 else 1e-8)
    assert np.sum((dense @ q.ravel() - values) ** 2) == pytest.approx(2 * reference.cost, rel=1e-4)


@pytest.mark.parametrize("width", [100.0, 0.4])
def test_blocks_are_joined_without_a_seam(monkeypatch, width):
    monkeypatch.setattr("maniport.mocap.path_solver.LEAST_GAIN", 1e-16)
    matrices, targets, arguments = problem(3200, width, 2.0)
    matrices[900:1700, :, 2] = 0.0
    whole = solve_path(residual_of(matrices, targets), *arguments)
    fractions = []
    parts = solve_long(lambda rows: residual_of(matrices, targets, rows), *arguments, fractions.append, block=1100)
    np.testing.assert_allclose(parts, whole, atol=1e-6)
    assert fractions == sorted(fractions)
    assert (len(fractions), fractions[-1]) == (5, 1.0)  # three blocks and two cuts
