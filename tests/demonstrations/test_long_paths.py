import numpy as np
import pytest

from maniport.demonstrations.long_paths import parts_of, solve_long
from maniport.demonstrations.path_solver import solve_path

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
    monkeypatch.setattr("maniport.demonstrations.path_solver.LEAST_GAIN", 1e-16)
    residual, *rest = problem
    whole = solve_path(residual(slice(None)), *rest)
    told = []
    parts = solve_long(residual, *rest, told.append, block=1100)
    np.testing.assert_allclose(parts, whole, atol=1e-6)
    assert told == sorted(told)
    assert told[-1] == 1.0
    assert len(told) == 5  # three blocks and two cuts


def test_a_path_of_one_block_is_solved_at_once(problem):
    """Up to the size of a block nothing is cut: the same bytes."""
    residual, *rest = problem
    np.testing.assert_array_equal(solve_long(residual, *rest), solve_path(residual(slice(None)), *rest))


@pytest.mark.parametrize(("count", "most"), [(0, 4), (1, 4), (8, 4), (9, 4), (10, 3)])
def test_parts_are_even_and_complete(count, most):
    """Parts follow one another, hold at most so many, and differ by one at most."""
    parts = list(parts_of(count, most))
    assert [i for part in parts for i in range(part.start, part.stop)] == list(range(count))
    sizes = [part.stop - part.start for part in parts]
    assert max(sizes) <= most
    assert max(sizes) - min(sizes) <= 1
