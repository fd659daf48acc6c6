import numpy as np
import pytest

from maniport.mocap.path_solver import solve_long, solve_path

DOF, FRAMES = 3, 3200


@pytest.fixture(scope="module", params=[100.0, 0.4])
def problem(request):
    """A long linear path with limits of two widths: a third of the frames says nothing of the last joint."""
    generator = np.random.default_rng(5)
    matrices, targets = generator.normal(size=(FRAMES, 4, DOF)), generator.normal(size=(FRAMES, 4))
    matrices[900:1700, :, 2] = 0.0
    smoothing = np.full((FRAMES, DOF), 2.0)
    smoothing[[0, -1]] = 0.0

    def residual(part):
        return lambda q: (np.einsum("nri,ni->nr", matrices[part], q) - targets[part], matrices[part].copy())

    width = np.full(DOF, request.param)
    pull, neutral = np.array([0.0, 0.0, 0.05]), np.zeros(DOF)
    return residual, np.zeros((FRAMES, DOF)), -width, width, smoothing, pull, neutral


def test_blocks_are_joined_without_a_seam(problem, monkeypatch):
    """Solved in three blocks, the path is that of one solution to 1e-6, at the cuts and everywhere."""
    monkeypatch.setattr("maniport.mocap.path_solver.LEAST_GAIN", 1e-16)
    residual, *rest = problem
    whole = solve_path(residual(slice(None)), *rest)
    told = []
    parts = solve_long(residual, *rest, told.append, block=1100)
    np.testing.assert_allclose(parts, whole, atol=1e-6)
    assert told == sorted(told)
    assert told[-1] == 1.0
    assert len(told) == 5  # three blocks and two cuts
