"""Every kernel does what its NumPy twin does: compiled, uncompiled, for every way of broadcasting."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from maniport import spd
from maniport.errors import InvalidInputError, NotSPDError
from maniport.spd import kernels
from maniport.spd.kernels import LANES, twins

sizes = pytest.mark.parametrize("d", [2, 3, 6, 11, 12])
BATCHES = [
    ((), ()),
    ((LANES + 3,), (LANES + 3,)),
    ((), (2 * LANES,)),
    ((2 * LANES + 1,), ()),
    ((5, 1), (5, 7)),
    ((5, 7), (5, 1)),
    ((7,), (5, 7)),
    ((5, 1), (1, 7)),
    ((2, 1, 3), (2, 4, 3)),
    ((1, 3, 1), (2, 3, 5)),
    ((0,), (0,)),
    ((), (2, 0)),
]


@sizes
@pytest.mark.parametrize(("first", "second"), BATCHES)
def test_pairs_broadcast_as_in_numpy(d, first, second, random_spd):
    """Distances and congruences agree with their twins for every way in which leading axes can fit."""
    rng = np.random.default_rng(1)
    a, b = random_spd(rng, first, d, condition=100.0), random_spd(rng, second, d, condition=100.0)
    assert_allclose(kernels.distances(a, b), twins.distances_numpy(a, b), rtol=1e-11, atol=1e-12)
    left = a + 0.1 * rng.standard_normal(a.shape)  # need not be symmetric
    assert_allclose(kernels.congruence(left, b), twins.congruence_numpy(left, b), rtol=1e-12, atol=1e-12)
    assert kernels.distances(a, b).shape == np.broadcast_shapes(first, second)


@sizes
@pytest.mark.parametrize(("first", "second"), BATCHES)
def test_composing_broadcasts_as_in_numpy(d, first, second, random_symmetric):
    """Eigenvalues and eigenvectors of different batch shapes compose as the twin composes them, exactly symmetric."""
    rng = np.random.default_rng(2)
    values, vectors = rng.standard_normal((*first, d)), random_symmetric(rng, second, d)
    composed = kernels.compose(values, vectors)
    assert_allclose(composed, twins.compose_numpy(values, vectors), atol=1e-12)
    assert_array_equal(composed, np.swapaxes(composed, -1, -2))


@sizes
@pytest.mark.parametrize("shape", [(), (LANES + 5,), (3, LANES), (0,)])
@pytest.mark.parametrize("exponent", [-1.5, 0.0, 0.3, 2.0])
def test_power_between_congruences(d, shape, exponent, random_spd):
    """R (L X Lᵀ)^s Rᵀ agrees with its twin and with one matrix at a time, bit for bit, and is exactly symmetric."""
    rng = np.random.default_rng(3)
    left, right = np.eye(d) + 0.2 * rng.standard_normal((2, d, d)) / np.sqrt(d)
    x = random_spd(rng, shape, d, condition=1e3)
    found = kernels.power_congruence(left, x, exponent, right)
    assert_allclose(found, twins.power_congruence_numpy(left, x, exponent, right), rtol=1e-9, atol=1e-10)
    assert_array_equal(found, np.swapaxes(found, -1, -2))
    if shape == (LANES + 5,):
        for index in (0, LANES - 1, LANES, LANES + 4):
            assert_array_equal(kernels.power_congruence(left, x[index], exponent, right), found[index])


@sizes
def test_power_between_congruences_refuses_what_it_cannot_compute(d, random_spd):
    """A power beyond range, and a point that recentring makes indefinite, raise an error that names the points."""
    x, eye = random_spd(np.random.default_rng(4), (LANES + 1,), d), np.eye(d)
    with pytest.raises(InvalidInputError, match=r"data takes the result out of range: .* 1e-150 to 1e\+150"):
        kernels.power_congruence(eye, x, 1e4, eye, name="data")
    x[-1] = -eye
    with pytest.raises(NotSPDError, match="points are too ill-conditioned"):
        kernels.power_congruence(eye, x, 0.5, eye)


@sizes
def test_distances_of_what_is_not_positive_definite_are_refused(d, random_spd):
    """An indefinite matrix on the left or on the right of a pair raises an error instead of giving nan."""
    x = random_spd(np.random.default_rng(5), (2, LANES + 1), d)
    x[1, -1] = -np.eye(d)
    with pytest.raises(NotSPDError):
        kernels.distances(x[0], x[1])
    with pytest.raises((NotSPDError, np.linalg.LinAlgError)):
        kernels.distances(x[1], x[0])


def test_read_only_and_strided_input_is_not_compiled_for_again(random_spd):
    """Views, read-only arrays and other layouts run through the machine code there is."""
    x = random_spd(np.random.default_rng(6), (20,), 3)
    kernels.distances(x, x)
    before = len(kernels.loops.distance_loop.signatures)
    frozen = x.copy()
    frozen.setflags(write=False)
    assert_array_equal(kernels.distances(frozen[::2], np.asfortranarray(x)[::2]), kernels.distances(x, x)[::2])
    assert len(kernels.loops.distance_loop.signatures) == before


def everything(x, e):
    """What all kernels make of matrices x (n, d, d) and one more, e."""
    w = np.full(len(x), 1 / len(x))
    values, vectors = kernels.eigh(x)
    at = kernels.moments(x, e, w, w, True)
    found = [values, vectors, kernels.compose(values, vectors), kernels.congruence(e, x), spd.distance(x[0], x)]
    return [*found, kernels.power_congruence(e, x, 0.7, e), at.cost, at.rounding, at.gradient, at.hessian, spd.mean(x)]


@pytest.mark.parametrize("d", [2, 3, 6, 11])
def test_one_at_a_time_gives_the_bits_of_sixteen_at_a_time(d, random_spd, monkeypatch):
    """All kernels but the sums over a batch give the same bits for one matrix at a time, as for a small batch."""
    x, e = random_spd(np.random.default_rng(d), (3 * LANES + 1,), d, 1e6), random_spd(np.random.default_rng(0), (), d)
    sixteen = everything(x, e)
    few = [kernels.eigh(x[:count])[1] for count in range(1, LANES)]
    monkeypatch.setattr(kernels, "WIDEST", kernels.ONE)
    for index, (one, other) in enumerate(zip(everything(x, e), sixteen, strict=True)):
        if index < 6:
            assert_array_equal(one, other)
        else:
            assert_allclose(one, other, rtol=1e-9, atol=1e-12)
    for vectors in few:
        assert_array_equal(vectors, sixteen[1][: len(vectors)])


SUBPROCESS = """
import os, sys, warnings
import numba.extending, numba.np.arrayobj, numba.core, numpy as np
sys.path.insert(0, sys.argv[2])
{before}
with warnings.catch_warnings(record=True) as told:
    warnings.simplefilter("always")
    from maniport import spd
    from maniport.spd import kernels
    from test_kernel_twins import everything
kernels.FEW = int(os.environ.get("FEW", kernels.FEW))
data = np.load(sys.argv[1])
with np.errstate(all="ignore"):
    for d in (2, 3, 6):
        for index, array in enumerate(everything(data[f"x{{d}}"], data[f"e{{d}}"])):
            np.testing.assert_allclose(array, data[f"{{index}}of{{d}}"], rtol=1e-9, atol=1e-9)
told = [str(one.message) for one in told if one.category.__name__ == "PerformanceWarning"]
{after}
"""


@pytest.fixture(scope="module")
def in_a_new_process(tmp_path_factory, random_spd):
    """Run all kernels in another process, which then compares what they give with what they give here."""
    arrays, folder = {}, tmp_path_factory.mktemp("kernels")
    for d in (2, 3, 6):
        x = arrays[f"x{d}"] = random_spd(np.random.default_rng(d), (LANES + 2,), d, condition=100.0)
        e = arrays[f"e{d}"] = random_spd(np.random.default_rng(d), (), d, condition=2.0)
        arrays |= {f"{index}of{d}": array for index, array in enumerate(everything(x, e))}
    np.savez(folder / "here.npz", **arrays)

    def run(before, after, **environment):
        code = SUBPROCESS.format(before=before, after=after)
        command = [sys.executable, "-c", code, str(folder / "here.npz"), str(Path(__file__).parent)]
        done = subprocess.run(command, env={**os.environ, **environment}, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr

    return run


@pytest.mark.parametrize("few", [0, 100])
def test_uncompiled_kernels_agree(few, in_a_new_process):
    """Every kernel, sixteen or one at a time, and the check at the door run as plain Python give what they compute."""
    in_a_new_process(
        "", "from numba import config; assert config.DISABLE_JIT and not told", NUMBA_DISABLE_JIT="1", FEW=str(few)
    )


NARROW = "assert kernels.WIDEST is kernels.ONE and len(told) == 1 and 'ten times as long' in told[0], told"


@pytest.mark.parametrize(
    ("before", "environment", "reason"),
    [
        ("", {"MANIPORT_KERNELS": "plain"}, "MANIPORT_KERNELS=plain"),
        ("import llvmlite.ir; llvmlite.ir.VectorType = None", {}, "TypeError: 'NoneType' object is not callable"),
        ("sys.modules['maniport.spd.kernels.lanes'] = None", {}, "ModuleNotFoundError"),
    ],
)
def test_without_the_vector_type_kernels_take_one_matrix_at_a_time(before, environment, reason, in_a_new_process):
    """When `lanes.py` cannot be imported, one warning says what is slower and why, and all results are the same."""
    in_a_new_process(before, f"{NARROW}\nassert {reason!r} in told[0], told", **environment)
