"""Contract tests of transfer methods, for methods outside of maniport too.

>>> from maniport.testing import check_adapter
>>> check_adapter(MyMethod())  # doctest: +SKIP
"""

import copy
import os
import pickle
import re
import tempfile
import warnings
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.testing import assert_allclose, assert_array_equal, assert_raises_regex

from maniport.errors import (
    IdentifiabilityWarning,
    InvalidInputError,
    NotFittedError,
    NotInvertibleError,
    NotSPDError,
)
from maniport.estimator import clone
from maniport.spd.kernels import congruence
from maniport.spd.kernels.loops import KAPPA
from maniport.transfer import load_adapter
from maniport.transfer.adapter import DomainAdapter
from maniport.transfer.rotation_group import rotation_from_vector
from maniport.util.validation import as_spd

ROUNDING = 1e-9


def check_adapter(
    adapter: DomainAdapter,
    dimensions: Sequence[int] = (3, 2, 6),
    identity: bool = True,
    random_state: int = 0,
) -> None:
    """Check that a method of transfer keeps the contract of `DomainAdapter`, as all shipped methods do.

    Shapes, SPD results, single ellipsoids and batches, order of the points, unchanged inputs, errors for bad inputs,
    failed fits, parameters and clones, files, pickles, base rotation, regularization, the inverse if there is one, and
    the identity for equal domains.

    Parameters
    ----------
    adapter : DomainAdapter
        Fitted or not; clones of it are fitted. The check sets damping and base_rotation.
    dimensions : sequence of int
        Sizes d of the ellipsoids that the method takes. The first is checked with every regularization, the others
        with damping.
    identity : bool
        Whether the map is the identity, except for damping, where the domains are equal.
    random_state : int
        Seed of the domains.

    Raises
    ------
    AssertionError
        When a property does not hold; the traceback names it.
    """
    first = dimensions[0]
    sizes: list[tuple[int, dict[str, float]]] = [
        (first, {}),
        *((d, {"damping": 0.01}) for d in dimensions),
    ]
    with warnings.catch_warnings():
        warnings.simplefilter(
            "ignore", IdentifiabilityWarning
        )  # small made-up domains determine little
        for i, (d, remedy) in enumerate(sizes):
            case = _Case(adapter, d, remedy, random_state)
            for check in (_check_fit, _check_transform, _check_copies, _check_base_rotation):
                check(case)
            _check_regularization(case, identity)
            if i == 0:
                _check_parameters_and_failed_fits(case)
                _check_bad_input(case)


class _Case:
    """A method with one regularization, its domains and new ellipsoids of one size: singular where allowed."""

    def __init__(self, adapter: DomainAdapter, d: int, remedy: dict[str, float], seed: int):
        self.prototype, self.d, self.remedy = adapter, d, remedy
        self.random = random = np.random.default_rng(seed + d)
        ellipsoids = []
        for count in (12, 15, 6):  # of condition up to 100, or flat ones
            axes = np.linalg.qr(random.standard_normal((count, d, d)))[0]
            squares = np.exp(random.uniform(0.0, np.log(100.0), (count, d)))
            squares[:, 0] *= not remedy
            ellipsoids.append(congruence(axes, squares[:, :, None] * np.eye(d)))
        self.teacher, self.student, self.new = ellipsoids[0], 2.0 * ellipsoids[1], ellipsoids[2]
        self.fitted = self.make().fit(self.teacher, self.student)
        self.images = self.fitted.transform(self.new)

    def make(self, **options: Any) -> DomainAdapter:
        """Return an unfitted adapter."""
        chosen = {"damping": None, "base_rotation": None, **self.remedy, **options}
        made: DomainAdapter = clone(self.prototype).set_params(**chosen)
        return made

    def require_same(self, other: DomainAdapter) -> None:
        """Require that another adapter has the attributes of the fitted one, and its images, bit by bit."""
        for name, value in vars(self.fitted).items():
            if name.endswith("_"):
                assert_array_equal(getattr(other, name), value, err_msg=name)
                assert np.shape(getattr(other, name)) == np.shape(value), name
        assert_array_equal(other.transform(self.new), self.images)


def _check_fit(case: _Case) -> None:
    """`fit` returns the adapter with its attributes, leaves its input alone, and the order of points is arbitrary."""
    arrays = [points.copy() for points in (case.teacher, case.student, case.new)]
    for array in arrays:
        array.setflags(write=False)
    adapter, d = case.make(), case.d
    assert adapter.fit(arrays[0], arrays[1]) is adapter, "fit must return the adapter itself"
    adapter.transform(arrays[2])
    for array, original in zip(arrays, (case.teacher, case.student, case.new), strict=True):
        assert_array_equal(array, original)
    assert (
        adapter.rotation_.shape
        == adapter.teacher_mean_.shape
        == adapter.student_mean_.shape
        == (d, d)
    )
    assert len(adapter.history_) == adapter.n_iter_ + 1
    assert isinstance(adapter.converged_, bool)
    assert isinstance(adapter.stop_reason_, str)
    assert adapter.map_rotation_.shape == ((3, 3) if d == 6 else (d, d))
    assert_allclose(
        adapter.map_rotation_ @ adapter.map_rotation_.T,
        np.eye(len(adapter.map_rotation_)),
        atol=ROUNDING,
    )
    shuffled = case.make().fit(
        *(case.random.permutation(points) for points in (case.teacher, case.student))
    )
    assert_allclose(
        shuffled.transform(case.new), case.images, rtol=1e-7, atol=1e-7 * np.abs(case.images).max()
    )


def _check_transform(case: _Case) -> None:
    """Images are SPD and have the shape of the points, also one by one; an inverse undoes the map."""
    new = case.new
    d = case.d
    transform = case.fitted.transform
    assert_array_equal(case.images, np.swapaxes(case.images, -1, -2))
    as_spd(case.images, "images")
    for shape in ((2, 3, d, d), (0, d, d)):
        assert transform(new[: 6 if shape[0] else 0].reshape(shape)).shape == shape
    assert_array_equal(transform(new.tolist()), case.images)
    assert_allclose(transform(new[::-1]), case.images[::-1], rtol=1e-12, atol=1e-15)
    for matrix, image in zip(new, case.images, strict=True):
        assert_allclose(transform(matrix), image, rtol=1e-12, atol=1e-15)
    try:
        back = case.fitted.inverse_transform(case.images.reshape(2, 3, d, d))
    except NotInvertibleError:
        return
    assert case.fitted.inverse_transform(case.images[:0]).shape == (0, d, d)
    assert_allclose(back, new.reshape(2, 3, d, d), atol=1e-6 * np.abs(new).max())


def _check_copies(case: _Case) -> None:
    """Check that clones are unfitted and that clones, files, pickles and copies give the same bits."""
    again = clone(case.fitted)
    assert repr(again.get_params()) == repr(case.fitted.get_params())
    _refused("call fit", again.transform, case.new, kind=NotFittedError)
    case.require_same(again.fit(case.teacher, case.student))
    with tempfile.TemporaryDirectory() as folder:
        path = os.path.join(folder, "adapter.npz")
        case.fitted.save(path)
        with np.load(path, allow_pickle=False) as archive:
            assert {archive[name].dtype.kind for name in archive.files} <= set("fibU"), (
                "the file holds pickled objects"
            )
        case.require_same(load_adapter(path))
    case.require_same(pickle.loads(pickle.dumps(case.fitted)))
    case.require_same(copy.deepcopy(case.fitted))


def _check_base_rotation(case: _Case) -> None:
    """With the base rotation R, the image of T is that of R T Rᵀ without; for d = 6, R is a rotation of space twice."""
    d = case.d
    turn = rotation_from_vector(case.random.standard_normal(3 if d == 6 else d * (d - 1) // 2))
    rotation = np.asarray(np.kron(np.eye(2), turn)) if d == 6 else turn
    seen = congruence(rotation, case.new)
    plain = case.make(base_rotation=np.eye(d)).fit(congruence(rotation, case.teacher), case.student)
    fitted = case.make(base_rotation=rotation).fit(case.teacher, case.student)
    images = plain.transform(seen)
    assert_allclose(fitted.transform(case.new), images, rtol=1e-7, atol=1e-7 * np.abs(images).max())
    assert_allclose(fitted.map_rotation_, plain.map_rotation_ @ turn, atol=1e-7)
    assert_allclose(
        fitted.teacher_side(case.new), plain.teacher_side(seen), atol=1e-7 * np.abs(case.new).max()
    )


def _check_regularization(case: _Case, identity: bool) -> None:
    """ε is damping times the mean eigenvalue of each domain, and nearly all of it is removed again; then the score."""
    fitted, student, new = case.fitted, case.student, case.new
    for points, epsilon in (
        (case.teacher, fitted.teacher_damping_),
        (student, fitted.student_damping_),
    ):
        mean_eigenvalue = np.trace(points, axis1=1, axis2=2).mean() / case.d
        assert_allclose(epsilon, case.remedy.get("damping", 0.0) * mean_eigenvalue, rtol=1e-12)
    errors = fitted.errors(new, student[:6])
    assert errors.shape == (6,)
    assert 0.0 >= fitted.score(new, student) >= -np.sqrt(np.mean(errors**2)) - ROUNDING
    if identity:
        domain = case.teacher
        adapter = case.make().fit(domain, domain[::-1])
        kept = np.sqrt(KAPPA) * adapter.student_damping_  # of the damping, at most
        allowed = 1.001 * kept + 1e-8 * np.abs(domain).max()
        assert np.abs(adapter.transform(domain) - domain).max() <= allowed, (
            "equal domains must change nothing"
        )


def _check_parameters_and_failed_fits(case: _Case) -> None:
    """`__init__` only stores, unfitted adapters raise NotFittedError, and a failed fit changes nothing."""
    parameters: dict[str, Any] = {name: object() for name in case.prototype.get_params()}
    assert set(parameters) >= {"damping", "base_rotation"}, (
        "damping and base_rotation are parameters of every method"
    )
    stored = type(case.prototype)(**parameters)
    assert all(getattr(stored, name) is value for name, value in parameters.items()), (
        "__init__ must only store"
    )
    adapter = case.make()
    _refused("at least 2", adapter.fit, case.teacher, case.student[:1])
    with tempfile.TemporaryDirectory() as folder:
        save = lambda x: adapter.save(os.path.join(folder, "adapter.npz"))  # noqa: E731
        uses = (
            lambda x: adapter.score(x, x),
            lambda x: adapter.map_rotation_,
            adapter.teacher_side,
            save,
        )
        for use in (adapter.transform, adapter.inverse_transform, *uses):
            _refused("call fit", use, case.new, kind=NotFittedError)
        assert not os.listdir(folder)
    adapter.fit(case.teacher, case.student)
    _refused("damping", adapter.set_params(damping=-1.0).fit, case.teacher, case.student)
    _refused(
        "no dispersion",
        adapter.set_params(damping=None).fit,
        case.teacher,
        np.array([np.eye(case.d)] * 3),
    )
    case.require_same(adapter)


def _check_bad_input(case: _Case) -> None:
    """Errors name the argument and what is wrong with it; singular domains need regularization."""
    good, d = case.teacher, case.d
    asymmetric, indefinite, singular, broken = (good.copy() for _ in range(4))
    asymmetric[2, 0, 1] += 0.5 * np.abs(good[2]).max()
    indefinite[1] = -good[1]
    singular[3] = np.ones((d, d))
    broken[1, 1, 1] = np.nan
    bad = {"square": good[:, :1], "finite": broken, "[2] is not symmetric": asymmetric}
    bad |= {"[1] is indefinite": indefinite, "[3] is singular": singular}
    for words, points in {
        **bad,
        "no dispersion": good[:1].repeat(4, axis=0),
        "at least 2": good[:1],
    }.items():
        _refused(words, case.make().fit, points, good, start="teacher")
        _refused(words, case.make().fit, good, points, start="student")
    for words, points in {**bad, f"hold {d}×{d}": np.array([np.eye(d + 1)] * 3)}.items():
        _refused(words, case.fitted.transform, points, start="points")
    _refused("base_rotation", case.make(base_rotation=2.0 * np.eye(d)).fit, good, case.student)
    as_spd(case.make(damping=0.01).fit(singular, 2.0 * singular).transform(singular), "images")


def _refused(
    words: str,
    use: Callable[..., Any],
    *arguments: Any,
    kind: type[Exception] = InvalidInputError,
    start: str = "",
) -> None:
    """Require an error of a kind whose message starts with the argument's name and then holds some words."""
    assert_raises_regex((kind, NotSPDError), f"(?s)^{start}.*{re.escape(words)}", use, *arguments)
