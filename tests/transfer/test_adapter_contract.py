"""What every method of transfer keeps: the battery of `maniport.testing`, and what is asked of shipped ones alone."""

import warnings

import numpy as np
import pytest
from numpy.testing import assert_array_equal
from sklearn.model_selection import GridSearchCV
from sklearn.pipeline import Pipeline

import maniport as mp
from maniport.errors import IdentifiabilityWarning
from maniport.testing import check_adapter
from maniport.transfer import METHODS, Search, method_of

methods = pytest.mark.parametrize("name", METHODS)


@methods
def test_every_method_keeps_the_contract(name):
    """All laws of the battery hold for every shipped method, in every size and with every regularization."""
    check_adapter(method_of(name, random_state=0, search=Search(n_starts=2)))


@methods
def test_pipelines_and_grid_search_take_it(name, random_singular):
    """scikit-learn clones, fits and scores it on folds of paired domains, alone or as a step."""
    rng = np.random.default_rng(0)
    teacher, student = random_singular(rng, 12, 3), random_singular(rng, 12, 3)
    adapter = method_of(name, damping=0.5, random_state=0)
    search = GridSearchCV(adapter, {"damping": [0.01, 0.1]}, cv=2, error_score="raise")
    search.fit(teacher, student)
    assert search.best_params_["damping"] in (0.01, 0.1)
    assert np.all(search.cv_results_["mean_test_score"] < 0)
    step = Pipeline([("adapter", adapter)]).fit(teacher, student)
    assert_array_equal(step.transform(teacher), adapter.fit(teacher, student).transform(teacher))


class Deaf(mp.IdentityMap):
    """Forgets the base_rotation."""

    def _in_student_frame(self, points):
        return points


class Greedy(mp.IdentityMap):
    """Changes what it is given."""

    def _fit_or_restore(self, teacher, student, learn):
        super()._fit_or_restore(teacher, student, learn)
        teacher *= 2.0
        return self


class Skewed(mp.IdentityMap):
    """Loses symmetry."""

    def _map(self, points):
        return points + np.triu(np.full(points.shape[1:], 1e-6), 1), self.released_damping_


@pytest.mark.parametrize("broken", [Deaf, Greedy, Skewed])
def test_the_battery_finds_what_is_broken(broken):
    """A method that forgets the base_rotation, one that changes its input and one that loses symmetry do not pass."""
    with pytest.raises((AssertionError, ValueError), match=r"(?i)not equal|read-only"):
        check_adapter(broken())


@methods
def test_a_silent_clone_learns_the_same_map(name, random_spd):
    """Its fit leaves out what is told of the map and warns of nothing; the adapter it comes from is unchanged."""
    rng = np.random.default_rng(0)
    teacher, student = random_spd(rng, 40, 3), random_spd(rng, 45, 3)
    adapter = method_of(name, random_state=0)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        silent = adapter.silent().fit(teacher, student)
    assert not {"identifiability_", "report_"} & set(vars(silent))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", IdentifiabilityWarning)
        adapter.fit(teacher, student)
    assert_array_equal(silent.transform(teacher), adapter.transform(teacher))
    assert hasattr(adapter, "identifiability_") == (name in ("parallel-transport", "icp"))
    assert hasattr(adapter, "report_") == (name == "length-field")
