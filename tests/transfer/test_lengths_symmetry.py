"""Laws of the lengths field for students that may be turned about an axis: what it sees, its map, and who says so."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

import maniport as mp
from maniport import spd
from maniport.arms import EllipsoidSpec

AXIS = np.array([2.0, -1.0, 2.0]) / 3.0


class Round:
    """A made-up student whose lengths are bounded, more so along the axes that lie near its own."""

    def __init__(self, axis=AXIS):
        self.axis = axis

    def __call__(self, points):
        """Bound the lengths."""
        values, vectors = np.linalg.eigh(points)
        bound = 1.0 + np.einsum("i,nij->nj", AXIS, vectors) ** 2
        return (vectors * np.clip(values, 0.2 * bound, 2.5 * bound)[:, None]) @ np.swapaxes(vectors, -1, -2)


@pytest.fixture(scope="module")
def domains(random_spd):
    """A teacher's and a student's domain."""
    rng = np.random.default_rng(0)
    return random_spd(rng, 200, 3, 30.0), Round()(random_spd(rng, 80, 3))


@pytest.fixture(scope="module")
def fitted(domains):
    """A field that knows of the axis."""
    return mp.LengthField(damping=0.01, projector=Round(), n_centers=40).fit(*domains)


def about(angle):
    """Rotation about the axis."""
    return Rotation.from_rotvec(angle * AXIS).as_matrix()


def test_turned_about_the_axis_ellipsoids_have_turned_images(domains, fitted):
    """The map commutes with every turn about the axis, and with no other."""
    adapter, points = fitted, domains[0][:20]
    images = adapter.transform(points)
    turn = about(1.1)
    assert_allclose(adapter.transform(turn @ points @ turn.T), turn @ images @ turn.T, atol=1e-9)
    other = Rotation.from_rotvec(np.cross(AXIS, [1.0, 0.0, 0.0])).as_matrix()
    assert spd.distance(adapter.transform(other @ points @ other.T), other @ images @ other.T).max() > 0.1


def test_who_knows_of_the_axis_comes_nearer(domains, random_spd):
    """At ellipsoids that no fit has seen the gap is smaller where the field is told of the axis."""
    new, gaps = random_spd(np.random.default_rng(3), 200, 3, 30.0), []
    for axis in (AXIS, None):
        images = mp.LengthField(projector=Round(axis), n_centers=100).fit(*domains).transform(new)
        gaps.append(spd.distance(images, Round()(images)).mean())
    assert gaps[0] < 0.8 * gaps[1]


def test_derivative_inverse_and_loop_know_of_the_axis(domains, fitted):
    """Slopes are those of differences, the inverse is exact where it is told, and one at a time gives the same."""
    field, points = fitted._field(), domains[0][:20]
    x = spd.to_vector(field.power * spd.logm(points[:5]) + field.shift * np.eye(3))

    def logarithms(vectors):
        return spd.to_vector(field.logarithms(*np.linalg.eigh(spd.from_vector(vectors))))

    wanted = np.stack([(logarithms(x + e) - logarithms(x - e)) / 2e-5 for e in 1e-5 * np.eye(6)], axis=-1)
    assert_allclose(field.slopes(*np.linalg.eigh(spd.from_vector(x))), wanted, atol=1e-7)
    fair = points[fitted.singular_values(points) > 0.2]
    assert len(fair) > 5
    assert spd.distance(fitted.inverse_transform(fitted.transform(fair)), fair).max() < 1e-8
    assert_allclose(fitted.transform(points), fitted._images(fitted.teacher_side(points)), rtol=1e-12)
    logs = field.logarithms(*field.base(points)) + field.level * np.eye(3)
    assert_allclose(spd.logm(field.apply(points)), logs, atol=1e-10)
    compiled = fitted.compiled()
    assert_allclose(np.array([compiled(point) for point in points]), fitted.transform(points), rtol=1e-10, atol=1e-12)


def test_an_arm_that_goes_round_has_an_axis():
    """It is that of a first joint that is free to turn by 300°, for velocity and force; 6×6 ellipsoids have none."""
    panda = mp.load_arm("panda")
    assert_allclose(mp.FeasibleProjector(panda).axis, [0.0, 0.0, 1.0], atol=1e-12)
    lower, upper = panda.lower.copy(), panda.upper.copy()
    upper[0] = lower[0] + np.radians(299.0)
    assert mp.FeasibleProjector(panda.narrowed(lower, upper)).axis is None
    assert mp.FeasibleProjector(panda, EllipsoidSpec(part="full")).axis is None
    assert_allclose(mp.FeasibleProjector(panda, EllipsoidSpec("force")).axis, [0.0, 0.0, 1.0], atol=1e-12)
