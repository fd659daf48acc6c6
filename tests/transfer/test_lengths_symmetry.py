"""Laws of the lengths field for students that may be turned about an axis: what it sees, its map, and who says so."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy.spatial.transform import Rotation

import maniport as mp
from maniport import spd
from maniport.bodies import EllipsoidSpec
from maniport.errors import FileFormatError, InvalidInputError
from maniport.files import load_arrays, save_arrays
from maniport.transfer.lengths.symmetry import features, features_changing, harmonics

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


@pytest.fixture(scope="module", params=[False, True], ids=["lengths", "turn"])
def fitted(request, domains):
    """A field of lengths alone, and one that may turn axes."""
    turn = Rotation.from_rotvec(0.1 * AXIS).as_matrix()
    projector = Round()
    if request.param:
        projector.__class__ = type(
            "Turned", (Round,), {"__call__": lambda self, p: turn @ Round.__call__(self, p) @ turn.T}
        )
    return mp.LengthsField(damping=0.01, projector=projector, n_centers=40, turn=request.param).fit(*domains)


def about(angle):
    """Rotation about the axis."""
    return Rotation.from_rotvec(angle * AXIS).as_matrix()


def test_features_are_what_no_turn_about_the_axis_changes(random_spd):
    """They are the same for an ellipsoid however it is turned about the axis, and tell others apart."""
    logs = spd.logm(random_spd(np.random.default_rng(1), 10, 3))
    parts = spd.to_vector(logs) @ harmonics(AXIS).T
    for angle in (0.3, 2.0, np.pi):
        turned = spd.to_vector(about(angle) @ logs @ about(angle).T) @ harmonics(AXIS).T
        assert_allclose(features(turned, 0.4), features(parts, 0.4), atol=1e-12)
    mirrored = parts * [1, 1, 1, -1, 1, 1]
    assert np.linalg.norm(features(mirrored, 0.4) - features(parts, 0.4), axis=1).min() > 1e-3


def test_harmonics_keep_lengths():
    """Their matrix is orthogonal for every axis."""
    for axis in (*np.eye(3), AXIS):
        assert_allclose(harmonics(axis) @ harmonics(axis).T, np.eye(6), atol=1e-14)


def test_derivatives_of_features_agree_with_finite_differences():
    """Also on the axis, where they are smooth."""
    parts = np.concatenate([np.random.default_rng(2).standard_normal((5, 6)), np.eye(6)[:1], 0.5 * np.eye(6)[4:]])
    steps = 1e-5 * np.eye(6)
    wanted = [(features(parts + step, 0.3) - features(parts - step, 0.3)) / 2e-5 for step in steps]
    assert_allclose(features_changing(parts, 0.3), np.stack(wanted, axis=-1), atol=1e-8)


def test_turned_about_the_axis_ellipsoids_have_turned_images(domains):
    """Where lengths alone are changed, the map commutes with every turn about the axis, and with no other."""
    adapter, points = mp.LengthsField(damping=0.01, projector=Round(), n_centers=40).fit(*domains), domains[0][:20]
    images = adapter.transform(points)
    turn = about(1.1)
    assert_allclose(adapter.transform(turn @ points @ turn.T), turn @ images @ turn.T, atol=1e-9)
    other = Rotation.from_rotvec(np.cross(AXIS, [1.0, 0.0, 0.0])).as_matrix()
    assert spd.distance(adapter.transform(other @ points @ other.T), other @ images @ other.T).max() > 0.1


def test_who_knows_of_the_axis_comes_nearer(domains, random_spd):
    """At ellipsoids that no fit has seen the gap is smaller where the field is told of the axis."""
    new, gaps = random_spd(np.random.default_rng(3), 200, 3, 30.0), []
    for axis in (AXIS, None):
        images = mp.LengthsField(projector=Round(axis), n_centers=100).fit(*domains).transform(new)
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
    assert_allclose(field.apply(points), field.image(*field.base(points)), rtol=1e-10)
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


@pytest.mark.parametrize("axis", [[0.0, 0.0, 0.0], [1.0, 0.0], [np.nan, 0.0, 1.0]])
def test_axes_that_are_no_directions_are_refused(axis, domains):
    """The message names where it stands."""
    with pytest.raises(InvalidInputError, match=r"projector\.axis"):
        mp.LengthsField(projector=Round(axis), n_centers=10).fit(*domains)


def test_files_keep_the_axis(domains, tmp_path):
    """A saved field maps the same, bit by bit; an axis that is no unit vector is refused."""
    path, points = tmp_path / "adapter.npz", domains[0][:20]
    adapter = mp.LengthsField(projector=Round(2.0 * AXIS), n_centers=40).fit(*domains)
    assert_allclose(adapter.axis_, AXIS)
    adapter.save(path)
    assert_array_equal(mp.load_adapter(path).transform(points), adapter.transform(points))
    for axis in (2.0 * AXIS, np.ones(2)):
        save_arrays(path, {**load_arrays(path, "adapter file"), "fitted.axis_": axis})
        with pytest.raises(FileFormatError, match="axis_ must be a unit vector"):
            mp.load_adapter(path)
