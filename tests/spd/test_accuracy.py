"""How exact the kernels are, against forty digits."""

import os

import numpy as np
import pytest

from maniport import spd
from maniport.errors import NotSPDError
from maniport.spd.kernels import eigh

if not os.environ.get("CI"):  # in CI a missing reference is a failure
    pytest.importorskip("mpmath")

import mpmath

EPS = np.finfo(np.float64).eps


def rotated(rng, d, condition):
    basis = np.linalg.qr(rng.standard_normal((d, d)))[0]
    matrix = (basis * condition ** np.r_[-0.5, rng.uniform(-0.5, 0.5, d - 2), 0.5]) @ basis.T
    return 0.5 * (matrix + matrix.T)


def graded(rng, d, condition):
    units = rng.permutation(np.logspace(-0.5 * np.log10(condition), 0.0, d))
    return rotated(rng, d, 10.0) * np.outer(units, units)


@pytest.mark.parametrize("d", [2, 3, 6])
@pytest.mark.parametrize("condition", [1e2, 1e7, 1e12])
@pytest.mark.parametrize("kind", [rotated, graded])
def test_logarithms_of_eigenvalues_lose_no_more_than_they_must(d, condition, kind):
    """They are exact to machine precision times the condition number; to 13 digits where small axes are of units."""
    rng = np.random.default_rng(d)
    matrices = np.stack([kind(rng, d, condition) for _ in range(20)])
    with mpmath.workdps(40):
        spectra = [
            mpmath.eigsy(mpmath.matrix(matrix.tolist()), eigvals_only=True) for matrix in matrices
        ]
        exact = np.array(
            [sorted(float(mpmath.log(value)) for value in spectrum) for spectrum in spectra]
        )
    lost = max(EPS * condition, 4 * EPS * np.log(condition)) if kind is rotated else 1e-13
    assert np.abs(np.log(eigh(matrices)[0]) - exact).max() <= lost


def near(rng, base):
    """Draw a matrix within a distance of some units, as rounding leaves it."""
    values, vectors = np.linalg.eigh(base)
    half = vectors * np.sqrt(values)
    step = rng.normal(0.0, 0.4, base.shape)
    matrix = half @ spd.expm(step + step.T) @ half.T
    return 0.5 * (matrix + matrix.T)


class Truth:
    """The affine-invariant metric with sixty digits, for the matrices as they are stored."""

    def __init__(self, base):
        self.base = mpmath.matrix(np.asarray(base).tolist())
        values, vectors = mpmath.eigsy(self.base)
        self.root = vectors * mpmath.diag([mpmath.sqrt(x) for x in values]) * vectors.T
        self.inverse = vectors * mpmath.diag([1 / mpmath.sqrt(x) for x in values]) * vectors.T

    def along(self, point, function):
        values, vectors = mpmath.eigsy(self.whitened(point))
        return (
            self.root
            * (vectors * mpmath.diag([function(x) for x in values]) * vectors.T)
            * self.root
        )

    def whitened(self, point):
        matrix = (
            self.inverse
            * mpmath.matrix(point.tolist() if isinstance(point, np.ndarray) else point)
            * self.inverse
        )
        return (matrix + matrix.T) / 2

    def length(self, tangent):
        return float(mpmath.sqrt(sum(x * x for x in self.whitened(tangent))))

    def distance(self, point):
        values = mpmath.eigsy(self.whitened(point), eigvals_only=True)
        return (
            float(mpmath.sqrt(sum(mpmath.log(x) ** 2 for x in values)))
            if min(values) > 0
            else np.inf
        )


def errors(operation, p, q, rng):
    """Do one operation, and return by how much it is wrong: as a distance, or of a transported unit tangent."""
    base = Truth(p)
    if operation == "distance":
        return abs(float(spd.distance(p, q)) - base.distance(q))
    if operation == "log":
        return base.length(mpmath.matrix(spd.log(p, q).tolist()) - base.along(q, mpmath.log))
    if operation == "exp":
        tangent = np.array(base.along(q, mpmath.log).tolist(), dtype=float)
        tangent = 0.5 * (tangent + tangent.T)
        return Truth(base.along(tangent, mpmath.exp).tolist()).distance(spd.exp(p, tangent))
    if operation == "transport":
        values, vectors = np.linalg.eigh(p)
        tangent = (vectors * values) @ rotated(rng, len(p), 5.0) @ vectors.T
        tangent = 0.5 * (tangent + tangent.T)
        mover = base.along(q, mpmath.sqrt) * base.inverse * base.inverse
        moved = mover * mpmath.matrix(tangent.tolist()) * mover.T
        return Truth(q).length(
            mpmath.matrix(spd.transport(tangent, p, q).tolist()) - moved
        ) / base.length(tangent)
    t = float(operation.split()[1])
    return Truth(base.along(q, lambda x: x ** mpmath.mpf(t)).tolist()).distance(
        spd.geodesic(p, q, t)
    )


OPERATIONS = [
    "distance",
    "log",
    "exp",
    "transport",
    "geodesic 0.5",
    "geodesic -0.4",
    "geodesic 1.7",
]


@pytest.mark.parametrize("operation", OPERATIONS)
@pytest.mark.parametrize("d", [2, 3])
def test_results_are_true_or_refused_at_any_condition(operation, d):
    rng = np.random.default_rng(d)
    refused = 0
    with mpmath.workdps(60):
        for condition in np.logspace(2, 14, 4):
            for kind in (rotated, graded):
                p = kind(rng, d, condition)
                for q in (
                    rotated(rng, d, condition),
                    graded(rng, d, condition),
                    rotated(rng, d, 30.0),
                    near(rng, p),
                ):
                    condition_of_both = np.linalg.cond(p) + np.linalg.cond(q)
                    try:
                        error = errors(operation, p, q, rng)
                    except NotSPDError:
                        refused += 1
                        assert condition_of_both > 1e12 or operation in (
                            "exp",
                            "geodesic -0.4",
                            "geodesic 1.7",
                        )
                        continue
                    assert error <= 0.01
                    if operation in ("distance", "log", "transport", "geodesic 0.5"):
                        assert error <= max(
                            10 * EPS * condition_of_both, 1e-6 if operation == "distance" else 1e-8
                        )
    assert refused or operation == "distance"
