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
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.testing import assert_allclose, assert_array_equal, assert_raises_regex

from maniport.errors import IdentifiabilityWarning, InvalidInputError, NotFittedError, NotInvertibleError, NotSPDError
from maniport.estimator import clone
from maniport.spd.kernels import eigh
from maniport.spd.matrix_functions import congruence
from maniport.transfer import load_adapter
from maniport.transfer.adapter import DomainAdapter
from maniport.transfer.rotation_group import rotation_from_vector
from maniport.util.validation import Array, as_spd

REGULARIZATIONS: tuple[dict[str, float], ...] = ({}, {"damping": 0.01}, {"eigenvalue_floor": 1e-3})
ROUNDING = 1e-9


def check_adapter(
    adapter: DomainAdapter, dimensions: Sequence[int] = (3, 2, 6), identity: bool = True, random_state: int = 0
) -> None:
    """Check that a method of transfer keeps the contract of `DomainAdapter`, as all shipped methods do.

    Shapes, SPD results, single ellipsoids and batches, order of the points, unchanged inputs, errors for bad inputs,
    failed fits, parameters and clones, files, pickles, base rotation, regularization, the inverse if there is one, and
    the identity for equal domains.

    Parameters
    ----------
    adapter : DomainAdapter
        Fitted or not; clones of it are fitted. The check sets damping, eigenvalue_floor and base_rotation.
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
    first, *others = dimensions
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", IdentifiabilityWarning)  # small made-up domains determine little
        cases = [Case(adapter, first, remedy, random_state) for remedy in REGULARIZATIONS]
        cases += [Case(adapter, d, REGULARIZATIONS[1], random_state) for d in others]
        for case in cases:
            for law in LAWS:
                law(case)
            if identity:
                _equal_domains_change_nothing(case)
        for law in INPUT_CHECKS:
            law(cases[0])


@dataclass(frozen=True)
class Case:
    """A method with one regularization, its domains and new ellipsoids of one size: singular where allowed."""

    prototype: DomainAdapter
    d: int
    remedy: dict[str, float]
    seed: int

    def make(self, **options: Any) -> DomainAdapter:
        """Return an unfitted adapter."""
        chosen = {"damping": None, "eigenvalue_floor": None, "base_rotation": None, **self.remedy, **options}
        made: DomainAdapter = clone(self.prototype).set_params(**chosen)
        return made

    @cached_property
    def domains(self) -> tuple[Array, Array, Array]:
        """Teacher, student and new ellipsoids."""
        random = np.random.default_rng(self.seed + self.d)
        first, other, new = (self.draw(random, n) for n in (12, 15, 6))
        return first, 2.0 * other, new

    def draw(self, random: np.random.Generator, n: int) -> Array:
        """Ellipsoids of condition up to 100, or flat ones."""
        axes = np.linalg.qr(random.standard_normal((n, self.d, self.d)))[0]
        squares = np.exp(random.uniform(0.0, np.log(100.0), (n, self.d)))
        if self.remedy:
            squares[:, 0] = 0.0
        return congruence(axes, squares[:, :, None] * np.eye(self.d))

    @cached_property
    def fitted(self) -> DomainAdapter:
        """The adapter, fitted."""
        return self.make().fit(*self.domains[:2])

    @cached_property
    def images(self) -> Array:
        """Images of the new ellipsoids."""
        return self.fitted.transform(self.domains[2])

    @cached_property
    def rotation(self) -> Array:
        """Random rotation of the ellipsoids, shape (d, d); of space for d = 6."""
        random = np.random.default_rng(self.seed)
        if self.d == 6:
            return np.asarray(np.kron(np.eye(2), rotation_from_vector(random.standard_normal(3))))
        return rotation_from_vector(random.standard_normal(self.d * (self.d - 1) // 2))


def _law_fit_returns_the_adapter_with_its_attributes(case: Case) -> None:
    adapter, d = case.make(), case.d
    assert adapter.fit(*case.domains[:2]) is adapter, "fit must return the adapter itself"
    assert adapter.rotation_.shape == adapter.teacher_mean_.shape == adapter.student_mean_.shape == (d, d)
    assert len(adapter.history_) == adapter.n_iter_ + 1
    assert isinstance(adapter.converged_, bool)
    assert isinstance(adapter.stop_reason_, str)
    assert adapter.map_rotation_.shape == ((3, 3) if d == 6 else (d, d))
    assert_allclose(adapter.map_rotation_ @ adapter.map_rotation_.T, np.eye(len(adapter.map_rotation_)), atol=ROUNDING)


def _law_results_are_positive_definite(case: Case) -> None:
    assert_array_equal(case.images, np.swapaxes(case.images, -1, -2))
    as_spd(case.images, "images")


def _law_one_matrix_equals_its_row_in_a_batch(case: Case) -> None:
    new, compiled = case.domains[2], case.fitted.compiled()
    assert_allclose(case.fitted.transform(new[::-1]), case.images[::-1], rtol=1e-12, atol=1e-15)
    for matrix, image in zip(new, case.images, strict=True):
        assert_allclose(case.fitted.transform(matrix), image, rtol=1e-12, atol=1e-15)
        assert_allclose(compiled(matrix), image, rtol=1e-6, atol=ROUNDING * np.abs(image).max())


def _law_shapes_are_kept(case: Case) -> None:
    new, d = case.domains[2], case.d
    assert case.fitted.transform(new.reshape(2, 3, d, d)).shape == (2, 3, d, d)
    assert case.fitted.transform(new[0]).shape == (d, d)
    assert case.fitted.transform(new[:0]).shape == (0, d, d)
    assert_array_equal(case.fitted.transform(new.tolist()), case.images)


def _law_inverse_returns_or_is_refused(case: Case) -> None:
    new, d = case.domains[2], case.d
    try:
        back = case.fitted.inverse_transform(case.images.reshape(2, 3, d, d))
    except NotInvertibleError:
        return
    assert back.shape == (2, 3, d, d)
    assert case.fitted.inverse_transform(case.images[:0]).shape == (0, d, d)
    raised = case.fitted.teacher_regularization.apply(new) if case.fitted.eigenvalue_floor is not None else new
    assert_allclose(back.reshape(new.shape), raised, atol=1e-6 * np.abs(new).max())


def _law_inputs_are_left_alone(case: Case) -> None:
    arrays = [points.copy() for points in case.domains]
    for array in arrays:
        array.setflags(write=False)
    adapter = case.make().fit(arrays[0], arrays[1])
    adapter.transform(arrays[2])
    for array, original in zip(arrays, case.domains, strict=True):
        assert_array_equal(array, original)


def _law_order_of_points_does_not_matter(case: Case) -> None:
    random = np.random.default_rng(case.seed)
    shuffled = case.make().fit(*(random.permutation(points) for points in case.domains[:2]))
    assert_allclose(shuffled.transform(case.domains[2]), case.images, rtol=1e-7, atol=1e-7 * np.abs(case.images).max())


def _law_a_clone_fits_to_the_same_bits(case: Case) -> None:
    again = clone(case.fitted)
    assert repr(again.get_params()) == repr(case.fitted.get_params())
    _refused("call fit", again.transform, case.domains[2], kind=NotFittedError)
    _same(again.fit(*case.domains[:2]), case)


def _law_files_and_pickles_give_the_same_bits(case: Case) -> None:
    with tempfile.TemporaryDirectory() as folder:
        path = os.path.join(folder, "adapter.npz")
        case.fitted.save(path)
        with np.load(path, allow_pickle=False) as archive:
            assert {archive[name].dtype.kind for name in archive.files} <= set("fibU"), "the file holds pickled objects"
        _same(load_adapter(path), case)
    for other in (pickle.loads(pickle.dumps(case.fitted)), copy.deepcopy(case.fitted)):
        _same(other, case)


def _same(other: DomainAdapter, case: Case) -> None:
    """Require that another adapter has the attributes of the fitted one, and its images, bit by bit."""
    for name, value in vars(case.fitted).items():
        if name.endswith("_"):
            assert_array_equal(getattr(other, name), value, err_msg=name)
            assert np.shape(getattr(other, name)) == np.shape(value), name
    assert_array_equal(other.transform(case.domains[2]), case.images)


def _law_base_rotation_equals_rotated_teacher(case: Case) -> None:
    """With the base rotation R, the image of T is that of R T Rᵀ without."""
    teacher, student, new = case.domains
    rotated, seen = congruence(case.rotation, teacher), congruence(case.rotation, new)
    plain = case.make(base_rotation=np.eye(case.d)).fit(rotated, student)
    fitted = case.make(base_rotation=case.rotation).fit(teacher, student)
    images = plain.transform(seen)
    assert_allclose(fitted.transform(new), images, rtol=1e-7, atol=1e-7 * np.abs(images).max())
    rotation = case.rotation[:3, :3] if case.d == 6 else case.rotation
    assert_allclose(fitted.map_rotation_, plain.map_rotation_ @ rotation, atol=1e-7)
    assert_allclose(fitted.teacher_side(new), plain.teacher_side(seen), atol=1e-7 * np.abs(new).max())


def _law_regularization_is_that_of_the_contract(case: Case) -> None:
    """ε is damping times the mean eigenvalue of each domain; at most ε is removed again."""
    adapter, rho = case.fitted, case.remedy.get("damping", 0.0)
    for points, epsilon in zip(case.domains, (adapter.teacher_damping_, adapter.student_damping_), strict=False):
        assert_allclose(epsilon, rho * np.trace(points, axis1=1, axis2=2).mean() / case.d, rtol=1e-12)
    assert 0.0 <= adapter.released_damping_ <= adapter.student_damping_
    if "eigenvalue_floor" in case.remedy:
        lowest = eigh(adapter.teacher_side(case.domains[0]))[0][:, 0]
        assert lowest.min() >= case.remedy["eigenvalue_floor"] * (1.0 - 1e-6)


def _law_score_is_minus_the_root_mean_squared_gap(case: Case) -> None:
    student, new = case.domains[1:]
    gaps = case.fitted.gaps(new, student)
    assert gaps.shape == (6,)
    assert_allclose(case.fitted.score(new, student), -np.sqrt(np.mean(gaps**2)), rtol=1e-12)
    assert np.all(gaps <= case.fitted.errors(new, student[:6]) + ROUNDING)


def _equal_domains_change_nothing(case: Case) -> None:
    domain = case.domains[0]
    adapter = case.make().fit(domain, domain[::-1])
    kept = adapter.student_damping_ - adapter.released_damping_  # the damping that the map keeps
    allowed = 1.001 * kept + case.remedy.get("eigenvalue_floor", 0.0) + 1e-8 * np.abs(domain).max()
    assert np.abs(adapter.transform(domain) - domain).max() <= allowed, "equal domains must change nothing"


def _input_init_only_stores(case: Case) -> None:
    parameters: dict[str, Any] = {name: object() for name in case.prototype.get_params(deep=False)}
    assert set(parameters) >= {"damping", "eigenvalue_floor", "base_rotation"}, (
        "damping, floor and base_rotation are parameters of every method"
    )
    adapter = type(case.prototype)(**parameters)
    assert all(getattr(adapter, name) is value for name, value in parameters.items()), "__init__ must only store"


def _input_not_fitted_is_an_error(case: Case) -> None:
    adapter, (teacher, student, new) = case.make(), case.domains
    _refused("at least 2", adapter.fit, teacher, student[:1])
    with tempfile.TemporaryDirectory() as folder:
        uses = (adapter.transform, adapter.inverse_transform, lambda x: adapter.score(x, x), adapter.teacher_side)
        for use in (
            *uses,
            lambda x: adapter.map_rotation_,
            lambda x: adapter.save(os.path.join(folder, "adapter.npz")),
        ):
            _refused("call fit", use, new, kind=NotFittedError)
        assert not os.listdir(folder)


def _input_a_failed_fit_changes_nothing(case: Case) -> None:
    adapter = case.make().fit(*case.domains[:2])
    _refused("damping", adapter.set_params(damping=-1.0).fit, *case.domains[:2])
    _refused("no dispersion", adapter.set_params(damping=None).fit, case.domains[0], np.array([np.eye(case.d)] * 3))
    _same(adapter, case)


def _input_bad_input_is_refused_by_name(case: Case) -> None:
    good, d = case.domains[0], case.d
    asymmetric, indefinite, singular, broken = (good.copy() for _ in range(4))
    asymmetric[2, 0, 1] += 0.5 * np.abs(good[2]).max()
    indefinite[1] = -good[1]
    singular[3] = np.ones((d, d))
    broken[1, 1, 1] = np.nan
    bad = {
        "square": good[:, :1],
        "finite": broken,
        "[2] is not symmetric": asymmetric,
        "[1] is indefinite": indefinite,
        "[3] is singular": singular,
    }
    for words, points in {**bad, "no dispersion": good[:1].repeat(4, axis=0), "at least 2": good[:1]}.items():
        _refused(words, case.make().fit, points, good, start="teacher")
        _refused(words, case.make().fit, good, points, start="student")
    for words, points in {**bad, f"hold {d}×{d}": np.array([np.eye(d + 1)] * 3)}.items():
        _refused(words, case.fitted.transform, points, start="points")
    _refused("exclude", case.make(damping=0.01, eigenvalue_floor=0.01).fit, good, good)
    _refused("base_rotation", case.make(base_rotation=2.0 * np.eye(d)).fit, good, case.domains[1])
    for remedy in REGULARIZATIONS[1:]:
        as_spd(case.make(**remedy).fit(singular, 2.0 * singular).transform(singular), "images")


def _refused(
    words: str, use: Callable[..., Any], *arguments: Any, kind: type[Exception] = InvalidInputError, start: str = ""
) -> None:
    """Require an error of a kind whose message starts with the argument's name and then holds some words."""
    assert_raises_regex((kind, NotSPDError), f"(?s)^{start}.*{re.escape(words)}", use, *arguments)


LAWS, INPUT_CHECKS = (
    [use for name, use in list(globals().items()) if name.startswith(kind)] for kind in ("_law_", "_input_")
)
"""Properties for every size and regularization, and those that are checked once."""
