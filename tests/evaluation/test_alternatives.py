"""Tests of the cheap alternatives."""

import numpy as np
import pytest
from sklearn.base import clone

from maniport import NearestNeighbor, ParallelTransport, RawCopy, Recentring, RiemannianICP, spd
from maniport.errors import InvalidInputError
from maniport.evaluation.alternatives import (
    LOOKUP,
    PROCRUSTES,
    RAW_COPY,
    RECENTRING,
    TRANSPORT,
    others_than,
)
from maniport.transfer.rigid_adapter import RigidMap


@pytest.fixture
def domains(make_cloud, rng):
    """Two clouds with different means."""
    return make_cloud(rng, 60), 3.0 * make_cloud(rng, 80, spread=0.3)


def test_all_are_listed_with_the_regularisation_and_the_mounting(turn_about):
    """Five rows, always; each has the adapter's damping and frame rotation, and is a scikit-learn estimator."""
    found = others_than(RiemannianICP(damping=0.02, mounting=turn_about(90.0)), "icp")
    assert [one.name for one in found] == [RAW_COPY, RECENTRING, TRANSPORT, LOOKUP, PROCRUSTES]
    for one in found:
        parameters = clone(one.adapter).get_params()
        assert parameters["damping"] == 0.02
        np.testing.assert_array_equal(parameters["mounting"], turn_about(90.0))


@pytest.mark.parametrize("regularisation", [{}, {"damping": 0.01}, {"floor": 1e-4}])
def test_raw_copy_changes_nothing(domains, regularisation):
    """The student gets the teacher's ellipsoids; of damping at most a millionth stays."""
    adapter = RawCopy(**regularisation).fit(*domains)
    images = adapter.transform(domains[0])
    np.testing.assert_allclose(images, domains[0], atol=2e-6 * adapter.student_damping_ + 1e-12)
    np.testing.assert_allclose(adapter.inverse_transform(images), domains[0], atol=1e-6)


def test_raw_copy_turns_into_the_frame_of_the_student(domains, turn_about):
    """With a known mounting the same ellipsoid is R_b T R_bᵀ."""
    turn = turn_about(35.0, axis=1)
    images = RawCopy(mounting=turn).fit(*domains).transform(domains[0])
    np.testing.assert_allclose(images, turn @ domains[0] @ turn.T, atol=1e-12)


def test_recentring_matches_the_means_and_nothing_else(domains, turn_about):
    """The teacher's mean becomes the student's, and all distances stay: a congruence by S̄^½ (R_b T̄ R_bᵀ)^-½ R_b."""
    turn = turn_about(35.0, axis=1)
    adapter = Recentring(mounting=turn).fit(*domains)
    teacher, student = (spd.mean(points) for points in domains)
    np.testing.assert_allclose(adapter.transform(teacher), student, rtol=1e-8)
    images, points = adapter.transform(domains[0]), domains[0]
    np.testing.assert_allclose(spd.distance(images[1:], images[:-1]), spd.distance(points[1:], points[:-1]), rtol=1e-8)
    factor = spd.sqrtm(student) @ spd.invsqrtm(turn @ teacher @ turn.T) @ turn
    np.testing.assert_allclose(images, factor @ points @ factor.T, rtol=1e-8)
    np.testing.assert_allclose(adapter.inverse_transform(images), points, rtol=1e-8)


def test_procrustes_is_what_pyriemann_does(domains):
    """The map of the training data is TLCenter, TLScale and TLRotate, with the student's mean put back."""
    transfer = pytest.importorskip("pyriemann.transfer")
    teacher, student = domains[0], domains[1][:60]
    classes = np.array([f"{i:06d}" for i in range(60)])
    labels = np.concatenate([np.char.add("teacher/", classes), np.char.add("student/", classes)])
    center = transfer.TLCenter("student")
    clouds = center.fit_transform(np.concatenate([teacher, student]), labels)
    spread = np.mean(spd.distance(np.eye(3), clouds[60:]) ** 2)
    clouds = transfer.TLScale("student", final_dispersion=spread, centered_data=True).fit_transform(clouds, labels)
    clouds = transfer.TLRotate("student").fit_transform(clouds, labels)
    root = center.centers_["student"].inv_filters_
    adapter = others_than(RiemannianICP(), "", pairs=(teacher, student))[-1].adapter.fit(teacher, student)
    np.testing.assert_allclose(adapter.transform(teacher), root @ clouds[:60] @ root, rtol=1e-6)
    assert adapter.stop_reason_ == "TLRotate on 60 pairs"


@pytest.mark.parametrize("angle", [0.0, 40.0])
def test_procrustes_finds_the_rotation_of_known_pairs(make_cloud, rng, turn_about, angle):
    """Where the student is a rigid image of the teacher, pairs give it back, whatever the mounting is said to be."""
    pytest.importorskip("pyriemann")
    teacher = make_cloud(rng, 40)
    truth = RigidMap(spd.mean(teacher), np.diag([1.0, 2.0, 4.0]), turn_about(70.0, axis=0), 0.8)
    student = truth.apply(teacher)
    said = RiemannianICP(mounting=turn_about(angle))
    adapter = others_than(said, "", pairs=(teacher, student))[-1].adapter.fit(teacher, student)
    assert np.max(spd.distance(adapter.transform(teacher), student)) < 1e-3


def test_procrustes_without_pairs_has_no_labels_and_does_not_turn(domains, turn_about):
    """TLRotate needs classes; without pairs there are none, and the known mounting is all that turns."""
    pytest.importorskip("pyriemann")
    turn = turn_about(35.0, axis=1)
    one = others_than(RiemannianICP(mounting=turn), "")[-1]
    adapter = one.adapter.fit(*domains)
    assert "TLRotate needs pairs" in one.note
    np.testing.assert_allclose(adapter.rotation_, np.eye(3), atol=1e-12)
    np.testing.assert_allclose(adapter.transform(spd.mean(domains[0])), spd.mean(domains[1]), rtol=1e-6)


def test_without_pyriemann_the_row_says_so(monkeypatch):
    """An optional companion that is absent is told, never silently missing."""
    monkeypatch.setattr("maniport.evaluation.alternatives.find_spec", lambda name: None)
    one = others_than(RiemannianICP(), "")[-1]
    assert (one.name, one.adapter, one.note) == (
        PROCRUSTES,
        None,
        'pyriemann is not installed (pip install "maniport[compare]")',
    )


def test_a_method_is_not_its_own_alternative():
    """Parallel transport is compared with the others only, and no other method may take its name."""
    assert TRANSPORT not in [one.name for one in others_than(ParallelTransport(), "")]
    assert LOOKUP not in [one.name for one in others_than(NearestNeighbor(), "")]
    with pytest.raises(InvalidInputError, match="name must not be that of an alternative; found 'raw-copy'"):
        others_than(ParallelTransport(), RAW_COPY)


def test_only_the_rows_that_are_wanted_are_there_and_none_is_fitted_twice(domains):
    """Rows come in the order of the names; one that is fitted already is taken as it is, if it fits."""
    ready = ParallelTransport(damping=0.01).fit(*domains)
    adapter = RiemannianICP(damping=0.01, random_state=0).fit(*domains)
    found = others_than(adapter, "icp", (TRANSPORT, RAW_COPY), fitted={TRANSPORT: ready})
    assert [(one.name, one.fitted) for one in found] == [(TRANSPORT, True), (RAW_COPY, False)]
    assert found[0].adapter is ready
    with pytest.raises(InvalidInputError, match=r"fitted\['parallel-transport'\] must have the adapter's"):
        others_than(adapter, "icp", fitted={TRANSPORT: ParallelTransport(damping=0.02).fit(*domains)})
    with pytest.raises(InvalidInputError, match="unknown row 'raw copy'"):
        others_than(adapter, "icp", ("raw copy",))
