"""The step on SO(d): derivatives against finite differences, convergence, starts and the basis of rotations."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from scipy.linalg import expm

from maniport import spd
from maniport.transfer.icp.rotation import RotationProblem, cholesky_factors
from maniport.transfer.rotation_group import rotation_basis, rotation_from_vector

seeds = given(seed=st.integers(0, 2**32 - 1))


def make_problem(rng, n, d, random_spd, random_rotation, kind="noisy", condition=1e3):
    """Make pairs that are noisy copies of each other, or that have nothing to do with each other."""
    teacher = random_spd(rng, n, d, condition)
    student = random_spd(rng, n, d, condition)
    if kind == "noisy":
        turn, noise = random_rotation(rng, d), 0.1 * rng.standard_normal((n, d, d))
        student = spd.expm(turn @ spd.logm(teacher) @ turn.T + noise + np.swapaxes(noise, 1, 2))
    weights = rng.uniform(0.1, 1.0, n)
    return RotationProblem(cholesky_factors(student), teacher, weights / weights.sum())


def check_derivatives(problem, rotation, tolerance=1e-6):
    """Compare gradient and Hessian with central differences of the cost and of the gradient."""
    cost, gradient, hessian = problem.derivatives(rotation)
    size, h = len(gradient), 1e-5
    assert cost == pytest.approx(problem.cost(rotation), rel=1e-12)
    slope, curvature = np.empty(size), np.empty((size, size))
    for a in range(size):
        there, back = (rotation_from_vector(sign * h * np.eye(size)[a]) @ rotation for sign in (1.0, -1.0))
        slope[a] = (problem.cost(there) - problem.cost(back)) / (2 * h)
        curvature[a] = (problem.derivatives(there)[1] - problem.derivatives(back)[1]) / (2 * h)
    scale = max(1.0, np.abs(hessian).max())
    assert_allclose(gradient, slope, atol=tolerance * scale)
    # second derivatives commute only at the same rotation: symmetrised, the differences of gradients are the Hessian
    assert_allclose(hessian, 0.5 * (curvature + curvature.T), atol=tolerance * scale)
    assert_allclose(hessian, hessian.T, atol=1e-10 * scale)


@pytest.mark.parametrize("d", [2, 3, 4, 6])
@pytest.mark.parametrize("kind", ["noisy", "unrelated"])
@settings(max_examples=10)
@seeds
def test_derivatives(d, kind, seed, random_spd, random_rotation):
    """Gradient and Hessian agree with finite differences."""
    rng = np.random.default_rng(seed)
    check_derivatives(make_problem(rng, 8, d, random_spd, random_rotation, kind), random_rotation(rng, d))


@pytest.mark.parametrize("d", [2, 3, 4, 6])
@pytest.mark.parametrize("gap", [0.0, 1e-12, 1e-7, 3e-6, 3e-5, 1e-3])
def test_derivatives_at_coincident_eigenvalues(d, gap, random_spd, random_rotation):
    """They do so too where generalised eigenvalues of a pair coincide or nearly do."""
    rng = np.random.default_rng(d)
    rotation, student = random_rotation(rng, d), random_spd(rng, 6, d)
    values = np.repeat(rng.uniform(0.5, 2.0, (6, 1)), d, axis=1) * (1.0 + gap * np.arange(d))
    axes = np.linalg.cholesky(student)
    teacher = rotation.T @ (axes * values[:, None]) @ np.swapaxes(axes, -1, -2) @ rotation
    check_derivatives(RotationProblem(cholesky_factors(student), teacher, np.full(6, 1 / 6)), rotation, tolerance=1e-5)


@pytest.mark.parametrize(
    ("d", "kind", "condition", "runs"),
    [
        (2, "unrelated", 1e3, 20),
        (3, "noisy", 1e3, 100),
        (3, "unrelated", 1e4, 100),
        (4, "noisy", 1e3, 20),
        (6, "noisy", 1e3, 4),
    ],
)
def test_descent_converges_from_anywhere(d, kind, condition, runs, random_spd, random_rotation):
    """From random starts with 100 pairs at least 99 % reach a gradient below 1e-9 within a few dozen steps."""
    rng = np.random.default_rng(0)
    ends = []
    for _ in range(runs):
        problem = make_problem(rng, 100, d, random_spd, random_rotation, kind, condition)
        start = random_rotation(rng, d)
        end = problem.minimize(start)
        assert end.cost <= problem.cost(start)
        assert_allclose(end.rotation @ end.rotation.T, np.eye(d), atol=1e-12)
        ends.append(end)
    assert np.mean([end.converged for end in ends]) >= 0.99
    assert max(end.gradient_norm for end in ends) < 1e-6
    assert np.median([end.n_iter for end in ends]) <= 25
    assert max(end.n_iter for end in ends) <= 60


@pytest.mark.parametrize("d", [2, 3, 4, 6, 12])
def test_rotation_from_vector_is_the_exponential(d):
    """It agrees with SciPy's matrix exponential, for small, large and no rotation."""
    rng = np.random.default_rng(d)
    size = d * (d - 1) // 2
    for length in (0.0, 1e-9, 1.0, 3.0):
        vector = length * rng.standard_normal(size)
        wanted = expm(np.tensordot(vector, rotation_basis(d), axes=1))
        assert_allclose(rotation_from_vector(vector), wanted, atol=1e-12)
    assert_allclose(rotation_basis(3)[2] @ [1.0, 0.0, 0.0], np.cross([0.0, 0.0, 1.0], [1.0, 0.0, 0.0]))
