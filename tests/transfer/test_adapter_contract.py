"""What every method of transfer keeps: the battery of `maniport.testing`, and scikit-learn's protocol."""

import numpy as np
import pytest
from numpy.testing import assert_array_equal
from sklearn.model_selection import GridSearchCV
from sklearn.pipeline import Pipeline

import maniport as mp
from maniport.testing import check_adapter
from maniport.transfer import METHODS, method_of

methods = pytest.mark.parametrize("name", METHODS)


@methods
def test_every_method_keeps_the_contract(name):
    check_adapter(method_of(name, random_state=0, n_starts=2))


@methods
def test_pipelines_and_grid_search_take_it(name, random_singular):
    rng = np.random.default_rng(0)
    teacher = random_singular(rng, 12, 3)
    student = random_singular(rng, 12, 3)
    adapter = method_of(name, damping=0.5, random_state=0)
    search = GridSearchCV(adapter, {"damping": [0.01, 0.1]}, cv=2, error_score="raise")
    search.fit(teacher, student)
    assert search.best_params_["damping"] in (0.01, 0.1)
    assert np.all(search.cv_results_["mean_test_score"] < 0)
    step = Pipeline([("adapter", adapter)]).fit(teacher, student)
    assert_array_equal(step.transform(teacher), adapter.fit(teacher, student).transform(teacher))


class Deaf(mp.IdentityMap):
    def _in_student_frame(self, points):
        return points


class Greedy(mp.IdentityMap):
    def fit(self, teacher, student):
        super().fit(teacher, student)
        teacher *= 2.0
        return self


class Skewed(mp.IdentityMap):
    def _map(self, points):
        return points + np.triu(np.full(points.shape[1:], 1e-6), 1)


@pytest.mark.parametrize("broken", [Deaf, Greedy, Skewed])
def test_the_battery_finds_what_is_broken(broken):
    with pytest.raises((AssertionError, ValueError), match=r"(?i)not equal|read-only|symmetric"):
        check_adapter(broken())
