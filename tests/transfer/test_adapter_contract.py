"""What every method of transfer keeps, whatever its regularisation and the size of its matrices."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from sklearn.base import clone
from sklearn.model_selection import GridSearchCV
from sklearn.pipeline import Pipeline

import maniport as mp
from maniport.errors import NotFittedError, NotInvertibleError

METHODS = {
    "pt": lambda **options: mp.ParallelTransport(**options),
    "icp": lambda **options: mp.RiemannianICP(n_starts=1, max_iter=10, random_state=0, **options),
    "nn": lambda **options: mp.NearestNeighbor(**options),
}
REGULARIZATIONS = {"none": {}, "damping": {"damping": 0.01}, "floor": {"floor": 1e-3}}


class Case:
    """A method, its domains of 12 and 15 ellipsoids, new ellipsoids, and the fitted adapter."""

    def __init__(self, method, regularization, d, draw):
        rng = np.random.default_rng(d)
        self.make = lambda: METHODS[method](**REGULARIZATIONS[regularization])
        self.d, self.method = d, method
        self.teacher, self.student, self.new = draw(rng, 12, d), 2.0 * draw(rng, 15, d), draw(rng, 6, d)
        self.fitted = self.make().fit(self.teacher, self.student)


@pytest.fixture(scope="module")
def cases():
    """Remember the cases, so that each is fitted once."""
    return {}


@pytest.fixture(
    params=[(m, r, d) for m in METHODS for r in REGULARIZATIONS for d in (2, 3, 6)], ids=lambda p: "-".join(map(str, p))
)
def case(request, cases, random_spd, random_singular):
    """One method with one regularisation and size; the ellipsoids are singular where they may be."""
    method, regularization, d = request.param
    if request.param not in cases:
        cases[request.param] = Case(
            method, regularization, d, random_spd if regularization == "none" else random_singular
        )
    return cases[request.param]


def test_fit_returns_the_adapter_itself(case):
    """`fit` returns self, fitted."""
    adapter = case.make()
    assert adapter.fit(case.teacher, case.student) is adapter
    assert adapter.rotation_.shape == adapter.teacher_mean_.shape == adapter.student_mean_.shape == (case.d, case.d)
    assert len(adapter.history_) == adapter.n_iter_ + 1
    assert isinstance(adapter.converged_, bool)
    assert isinstance(adapter.stop_reason_, str)
    kept = getattr(adapter, "start_kept_", False)
    assert adapter.cost_ == pytest.approx(adapter.history_[0] if kept else adapter.history_.min())


def test_results_are_positive_definite(case):
    """Every result is symmetric and positive-definite by the package's own standard."""
    images = case.fitted.transform(case.new)
    assert_array_equal(images, np.swapaxes(images, -1, -2))
    mp.spd.logm(images)


def test_one_matrix_equals_its_row_in_a_batch(case):
    """Mapping one matrix alone gives the same bits as mapping it in company."""
    images = case.fitted.transform(case.new)
    for matrix, image in zip(case.new, images, strict=True):
        assert_array_equal(case.fitted.transform(matrix), image)
    assert_array_equal(case.fitted.transform(case.new[::-1]), images[::-1])


def test_batch_shapes_are_kept(case):
    """Any leading axes pass through, also none and empty ones."""
    images = case.fitted.transform(case.new)
    assert_array_equal(case.fitted.transform(case.new.reshape(2, 3, case.d, case.d)).reshape(images.shape), images)
    assert case.fitted.transform(case.new[0]).shape == (case.d, case.d)
    assert case.fitted.transform(case.new[:0]).shape == (0, case.d, case.d)
    assert case.fitted.transform(case.new.tolist()).shape == images.shape


def test_inverse_keeps_shapes_or_says_that_there_is_none(case):
    """`inverse_transform` keeps leading axes; a table says that it has no inverse."""
    images = case.fitted.transform(case.new).reshape(2, 3, case.d, case.d)
    if case.method == "nn":
        with pytest.raises(NotInvertibleError, match="teacher and student exchanged"):
            case.fitted.inverse_transform(images)
    else:
        assert case.fitted.inverse_transform(images).shape == images.shape
        assert case.fitted.inverse_transform(images[:, :0]).shape == (2, 0, case.d, case.d)
        assert_array_equal(case.fitted.inverse_transform(images)[1, 2], case.fitted.inverse_transform(images[1, 2]))


def test_inputs_are_not_modified(case):
    """Arrays that are passed in keep their content; read-only ones are fine."""
    arrays = [case.teacher.copy(), case.student.copy(), case.new.copy()]
    for array in arrays:
        array.setflags(write=False)
    adapter = case.make().fit(arrays[0], arrays[1])
    adapter.transform(arrays[2])
    adapter.score(arrays[2], arrays[1])
    for array, original in zip(arrays, (case.teacher, case.student, case.new), strict=True):
        assert_array_equal(array, original)


def test_order_of_points_does_not_matter(case):
    """Shuffling both domains changes results by rounding only."""
    rng = np.random.default_rng(0)
    shuffled = case.make().fit(rng.permutation(case.teacher), rng.permutation(case.student))
    assert_allclose(shuffled.transform(case.new), case.fitted.transform(case.new), rtol=1e-9, atol=1e-9)


def test_same_seed_gives_the_same_bits(case):
    """A second fit gives the same attributes and results bit for bit."""
    again = clone(case.fitted).fit(case.teacher, case.student)
    for name, value in vars(case.fitted).items():
        if name.endswith("_"):
            assert_array_equal(getattr(again, name), value)
    assert_array_equal(again.transform(case.new), case.fitted.transform(case.new))


def test_parameters_follow_scikit_learn(case):
    """`get_params`, `set_params` and `clone` work; a clone is not fitted."""
    adapter = case.make()
    assert set(adapter.get_params()) >= {"damping", "floor"}
    assert adapter.set_params(floor=0.5).get_params()["floor"] == 0.5
    copied = clone(case.fitted)
    assert copied.get_params() == case.fitted.get_params()
    with pytest.raises(NotFittedError):
        copied.transform(case.new)
    assert type(adapter).__name__ in repr(adapter)


def test_pipeline_fits_and_transforms(case):
    """As the step of a pipeline an adapter does what it does alone."""
    pipeline = Pipeline([("adapter", case.make())]).fit(case.teacher, case.student)
    assert_array_equal(pipeline.transform(case.new), case.fitted.transform(case.new))


def test_score_is_minus_the_root_mean_squared_gap(case):
    """The score is never positive and made of the distances to the nearest student ellipsoids."""
    gaps = case.fitted.gaps(case.new, case.student)
    assert gaps.shape == (6,)
    assert case.fitted.score(case.new, case.student) == pytest.approx(-np.sqrt(np.mean(gaps**2)))
    assert np.all(gaps <= case.fitted.errors(case.new, case.student[:6]) + 1e-12)


def test_not_fitted_is_said(case, tmp_path):
    """Before `fit`, and after one that failed, every use raises NotFittedError."""
    adapter = case.make()
    with pytest.raises(ValueError, match="at least 2"):
        adapter.fit(case.teacher, case.student[:1])
    for use in (adapter.transform, adapter.inverse_transform, lambda x: adapter.score(x, x)):
        with pytest.raises(NotFittedError, match="call fit"):
            use(case.new)
    with pytest.raises(NotFittedError):
        adapter.save(tmp_path / "adapter.npz")
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("method", METHODS)
def test_grid_search_over_damping(method, random_singular):
    """Grid search clones, fits and scores adapters on folds of paired domains."""
    rng = np.random.default_rng(0)
    teacher, student = random_singular(rng, 12, 3), random_singular(rng, 12, 3)
    search = GridSearchCV(METHODS[method](damping=0.5), {"damping": [0.01, 0.1]}, cv=2, error_score="raise")
    search.fit(teacher, student)
    assert search.best_params_["damping"] in (0.01, 0.1)
    assert np.all(search.cv_results_["mean_test_score"] < 0)
    assert search.transform(teacher).shape == teacher.shape


@pytest.mark.parametrize("kind", [mp.ParallelTransport, mp.RiemannianICP, mp.NearestNeighbor])
def test_init_only_stores(kind):
    """`__init__` keeps the very objects it is given, unchecked."""
    given = {name: object() for name in kind().get_params()}
    adapter = kind(**given)
    assert all(adapter.get_params(deep=False)[name] is value for name, value in given.items())
    assert set(vars(adapter)) == set(given)


@pytest.mark.parametrize("method", METHODS)
def test_failed_fit_leaves_the_adapter_as_it_was(method, random_spd):
    """When a later fit fails the adapter keeps its former map."""
    rng = np.random.default_rng(0)
    teacher, student = random_spd(rng, 12, 3), random_spd(rng, 15, 3)
    adapter = METHODS[method]().fit(teacher, student)
    before = adapter.transform(teacher)
    adapter.set_params(**({"n_samples": 0} if method == "nn" else {"dispersion": "none"}))
    with pytest.raises(ValueError, match=r"n_samples|dispersion"):
        adapter.fit(student, 3.0 * teacher)
    assert_array_equal(adapter.transform(teacher), before)
    if method == "icp":
        fresh = mp.RiemannianICP(start="nowhere")
        with pytest.raises(ValueError, match="start"):
            fresh.fit(teacher, student)
        with pytest.raises(NotFittedError):
            fresh.transform(teacher)
