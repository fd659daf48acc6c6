import tracemalloc

import numba
import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from maniport import NearestNeighbor, ParallelTransport
from maniport.errors import InvalidInputError, NotFittedError, NotSPDError


@pytest.fixture(scope="module")
def clouds(random_spd):
    return random_spd(np.random.default_rng(3), 60, 3), random_spd(np.random.default_rng(53), 70, 3)


@pytest.mark.parametrize("remedy", [{}, {"damping": 0.01}])
def test_compiled_map_equals_transform_and_allocates_nothing(clouds, remedy):
    """Into a new array, one of the caller's or its own; a thousand calls leave Python's memory as it was."""
    teacher, student = clouds
    adapter, out = ParallelTransport(**remedy).fit(teacher, student), np.empty((3, 3))
    compiled, images = adapter.compiled(), adapter.transform(teacher)
    for point, image in zip(teacher, images, strict=True):
        assert_allclose(compiled(point), image, rtol=1e-9, atol=1e-12 * np.abs(image).max())
    assert compiled(teacher[0], out) is out
    assert_array_equal(out, out.T)
    own = teacher[0].copy()
    assert_array_equal(compiled(own, own), out)
    tracemalloc.start()
    try:
        compiled(teacher[0], out)
        before = tracemalloc.get_traced_memory()[0]
        for _ in range(1000):
            compiled(teacher[0], out)
        assert (
            tracemalloc.get_traced_memory()[0] - before < 10_000
        )  # the smallest object in each call would be 16 kB
    finally:
        tracemalloc.stop()


UNTYPED = pytest.mark.skipif(numba.config.DISABLE_JIT, reason="Numba checks types when it compiles")


@pytest.mark.parametrize(("point", "error", "words"), [
    (np.eye(4), InvalidInputError, r"\(3, 3\); found float64 \(4, 4\)"),
    pytest.param(np.eye(3, dtype=np.float32), InvalidInputError, "float32", marks=UNTYPED),
    (np.arange(18.0).reshape(3, 6)[:, ::2], InvalidInputError, "C-contiguous"),
    pytest.param([[1, 0, 0], [0, 1, 0], [0, 0, 1]], InvalidInputError, "list", marks=UNTYPED),
    pytest.param(3.0, InvalidInputError, "float", marks=UNTYPED),
    (np.triu(np.ones((3, 3))), NotSPDError, "symmetric"), (np.full((3, 3), np.nan), NotSPDError, "finite"),
    (np.diag([1.0, np.inf, 1.0]), NotSPDError, "finite"), (np.diag([1.0, -1.0, 1.0]), NotSPDError, "positive-definite"),
])  # fmt: skip
@pytest.mark.parametrize("remedy", [{}, {"damping": 0.01}])
def test_compiled_map_refuses_bad_input(clouds, point, error, words, remedy):
    compiled, out = ParallelTransport(**remedy).fit(*clouds).compiled(), np.full((3, 3), 7.0)
    with pytest.raises(error, match=words):
        compiled(point, out)
    assert_array_equal(out, 7.0)


def test_only_rigid_fitted_adapters_have_a_compiled_map(clouds):
    with pytest.raises(NotFittedError):
        ParallelTransport().compiled()
    table = NearestNeighbor().fit(*clouds)
    assert table.compiled() == table.transform
