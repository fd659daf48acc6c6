"""The step on SO(d): derivatives against finite differences, and convergence."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from maniport import spd
from maniport.spd.kernels import cholesky
from maniport.transfer.icp.rotation import RotationProblem
from maniport.transfer.rotation_group import rotation_from_vector


def make_problem(rng, n, d, random_spd, random_rotation, kind="noisy", condition=1e3):
    """Make pairs that are noisy copies of each other, or that have nothing to do with each other."""
    teacher = random_spd(rng, n, d, condition)
    student = random_spd(rng, n, d, condition)
    if kind == "noisy":
        turn = random_rotation(rng, d)
        noise = 0.1 * rng.standard_normal((n, d, d))
        student = spd.expm(turn @ spd.logm(teacher) @ turn.T + noise + np.swapaxes(noise, 1, 2))
    weights = rng.uniform(0.1, 1.0, n)
    return RotationProblem(cholesky(student), teacher, weights / weights.sum())


def nearly_equal_eigenvalues(rng, gap, rotation, random_spd):
    """Make pairs with generalized eigenvalues that differ under a rotation by a factor of 1 + gap."""
    d = len(rotation)
    axes = np.linalg.cholesky(random_spd(rng, 6, d))
    values = rng.uniform(0.5, 2.0, (6, 1)) * (1.0 + gap * np.arange(d))
    teacher = rotation.T @ (axes * values[:, None]) @ np.swapaxes(axes, -1, -2) @ rotation
    return RotationProblem(cholesky(axes @ np.swapaxes(axes, -1, -2)), teacher, np.full(6, 1 / 6))


@pytest.mark.parametrize("d", [2, 3, 4, 6])
@pytest.mark.parametrize("kind", ["noisy", "unrelated", 0.0, 1e-12, 1e-7, 3e-6, 3e-5, 1e-3])
def test_derivatives(d, kind, random_spd, random_rotation):
    """Gradient and Hessian are those of differences, also where eigenvalues of a pair (nearly) coincide."""
    rng = np.random.default_rng(d)
    rotation = random_rotation(rng, d)
    h = 1e-5
    if isinstance(kind, str):
        problem = make_problem(rng, 8, d, random_spd, random_rotation, kind)
        tolerance = 1e-6
    else:
        problem = nearly_equal_eigenvalues(rng, kind, rotation, random_spd)
        tolerance = 1e-5
    cost, gradient, hessian = problem.derivatives(rotation)
    assert cost == pytest.approx(problem.cost(rotation), rel=1e-12)
    slope = np.empty_like(gradient)
    curvature = np.empty_like(hessian)
    for a, step in enumerate(h * np.eye(len(gradient))):
        there = rotation_from_vector(step) @ rotation
        back = rotation_from_vector(-step) @ rotation
        slope[a] = (problem.cost(there) - problem.cost(back)) / (2 * h)
        curvature[a] = (problem.derivatives(there)[1] - problem.derivatives(back)[1]) / (2 * h)
    scale = max(1.0, np.abs(hessian).max())
    assert_allclose(gradient, slope, atol=tolerance * scale)
    # second derivatives commute only at the same rotation: symmetrised, the differences of gradients are the Hessian
    assert_allclose(hessian, 0.5 * (curvature + curvature.T), atol=tolerance * scale)
    assert_allclose(hessian, hessian.T, atol=1e-10 * scale)


@pytest.mark.parametrize(
    ("d", "kind", "condition", "runs"),
    [
        (2, "unrelated", 1e3, 20),
        (3, "noisy", 1e3, 50),
        (3, "unrelated", 1e4, 50),
        (4, "noisy", 1e3, 10),
        (6, "noisy", 1e3, 4),
    ],
)
def test_descent_converges_from_anywhere(d, kind, condition, runs, random_spd, random_rotation):
    """From random starts with 100 pairs at least 99 % reach a gradient below 1e-9 within a few dozen steps."""
    rng = np.random.default_rng(0)
    norms = []
    for _ in range(runs):
        problem = make_problem(rng, 100, d, random_spd, random_rotation, kind, condition)
        start = random_rotation(rng, d)
        ends = [problem.minimize(start, max_iter=steps) for steps in (25, 60)]
        assert problem.cost(ends[1]) <= problem.cost(start)
        assert_allclose(ends[1] @ ends[1].T, np.eye(d), atol=1e-12)
        norms.append([np.linalg.norm(problem.derivatives(end)[1]) for end in ends])
    half = np.median(norms, axis=0)[0]
    most = np.transpose(norms)[1]
    assert half < 1e-9
    assert np.mean(most < 1e-9) >= 0.99
    assert most.max() < 1e-6
