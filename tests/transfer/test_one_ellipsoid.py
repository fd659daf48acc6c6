"""One ellipsoid at a time, as a control loop maps it: the image that it has among many others."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from maniport import LengthField, NearestNeighbor, ParallelTransport
from maniport.errors import NotFittedError, NotSPDError

METHODS = [ParallelTransport(), ParallelTransport(damping=0.01), LengthField(), NearestNeighbor()]


@pytest.fixture(scope="module")
def domains(random_spd):
    return random_spd(np.random.default_rng(3), 60, 3), random_spd(np.random.default_rng(53), 70, 3)


@pytest.mark.parametrize("adapter", METHODS, ids=repr)
def test_one_equals_many(domains, adapter):
    teacher, student = domains
    adapter.fit(teacher, student)
    images = adapter.transform(teacher)
    for point, image in zip(teacher, images, strict=True):
        rounding = 1e-12 * np.abs(image).max()
        assert_allclose(adapter.transform(point), image, rtol=1e-12, atol=rounding)


@pytest.mark.parametrize(
    "point",
    [np.triu(np.ones((3, 3))), np.diag([1.0, -1.0, 1.0]), np.diag([1.0, 0.0, 0.0])],
    ids=["asymmetric", "indefinite", "flat"],
)
def test_one_that_is_no_ellipsoid_is_refused(domains, point):
    """Live control leaves out a frame whose ellipsoid has no image, and so relies on this error."""
    adapter = ParallelTransport().fit(*domains)
    with pytest.raises(NotSPDError):
        adapter.transform(point)


def test_an_adapter_maps_after_its_fit(domains):
    with pytest.raises(NotFittedError):
        ParallelTransport().transform(domains[0][0])
