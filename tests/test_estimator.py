import subprocess
import sys

import numpy as np
import pytest
from sklearn.base import BaseEstimator, TransformerMixin
from sklearn.base import clone as sklearn_clone
from sklearn.utils import get_tags

import maniport as mp
from maniport.errors import InvalidInputError
from maniport.estimator import clone

FIT = """
import sys
import numpy as np
import maniport as mp
factors = np.random.default_rng(0).normal(size=(60, 3, 5))
clouds = factors @ np.swapaxes(factors, 1, 2)
mp.RiemannianICP().fit(clouds, 2.0 * clouds).transform(clouds)
print([name for name in ("sklearn", "scipy.stats") if name in sys.modules])
"""


@pytest.mark.parametrize(
    "estimator",
    [
        mp.ParallelTransport(base_rotation=np.eye(3), damping=0.1),
        mp.RiemannianICP(),
        mp.ProfileGMM(n_components=2),
    ],
    ids=lambda one: type(one).__name__,
)
def test_clones_are_those_of_scikit_learn(estimator):
    ours = clone(estimator)
    theirs = sklearn_clone(estimator)
    assert ours is not estimator
    assert repr(ours) == repr(theirs) == repr(estimator)
    for name, value in estimator.get_params(deep=False).items():
        assert (getattr(ours, name) is value) == (getattr(theirs, name) is value)


def test_parameters_are_set_by_name():
    model = mp.ProfileGMM(tol=0.2)
    assert model.set_params(n_components=2, tol=0.1) is model
    assert (model.n_components, model.tol) == (2, 0.1)
    expected = mp.ProfileGMM(n_components=2, tol=0.1).get_params()
    assert model.get_params() == expected
    with pytest.raises(
        InvalidInputError,
        match=r"ProfileGMM.*'counts'.*n_components",
    ):
        model.set_params(counts=1)
    assert model.get_params() == expected
    assert not hasattr(model, "counts")


class Transformer(TransformerMixin, BaseEstimator):
    """A transformer of scikit-learn."""


def test_scikit_learn_gets_the_tags_that_it_reads():
    assert get_tags(mp.ParallelTransport()) == get_tags(Transformer())
    assert get_tags(mp.ProfileGMM()) == get_tags(BaseEstimator())


def test_a_fit_loads_no_scikit_learn():
    done = subprocess.run(
        [sys.executable, "-c", FIT], capture_output=True, text=True, check=True, timeout=300
    )
    assert done.stdout.strip() == "[]"
