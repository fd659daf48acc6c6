"""The score of two ellipsoids: the compiled search against plain NumPy and against the paper's formula."""

import inspect
import os
import subprocess
import sys

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from maniport.transfer.icp.correspondence.match_table import MatchTable
from maniport.transfer.icp.correspondence.match_tree import EllipsoidFeatures, MatchTree


def match_by_tree(teacher, student):
    """Match as large clouds are matched."""
    return MatchTree(student).query(teacher)


def match_by_table(teacher, student):
    """Match as small clouds are matched."""
    return MatchTable(teacher, student).query(np.eye(teacher.minor.shape[1]), np.arange(len(teacher.volume)))


def match_numpy(teacher, student):
    """Do what the others do in plain NumPy."""
    score = np.abs(teacher.minor @ student.minor.T) + np.abs(teacher.major @ student.major.T)
    score += np.exp(-np.abs(teacher.condition[:, None] - student.condition))
    score += np.exp(-np.abs(teacher.volume[:, None] - student.volume))
    index = np.argmax(score, axis=1)
    return index, score[np.arange(len(index)), index]


def clouds(kind, rng, n, d, random_spd, random_singular):
    """Make SPD matrices of one kind."""
    if kind == "singular":
        return random_singular(rng, n, d) + 1e-4 * np.eye(d)
    if kind == "isotropic":
        return rng.uniform(0.1, 10.0, (n, 1, 1)) * np.eye(d)
    if kind == "mixed":
        return np.concatenate([random_spd(rng, n - 3, d), rng.uniform(0.5, 2.0, (3, 1, 1)) * np.eye(d)])
    return random_spd(rng, n, d, {"random": 1e2, "elongated": 1e5, "huge": 1e12}[kind])


def score_of_pair(teacher, student):
    """Compute eq. 18 of the paper literally, for one pair without equal eigenvalues."""
    values_t, vectors_t = np.linalg.eigh(teacher)
    values_s, vectors_s = np.linalg.eigh(student)
    directions = abs(vectors_t[:, 0] @ vectors_s[:, 0]) + abs(vectors_t[:, -1] @ vectors_s[:, -1])
    condition = values_t[-1] / values_t[0] - values_s[-1] / values_s[0]
    volume = np.sqrt(values_t.prod()) - np.sqrt(values_s.prod())
    return directions + np.exp(-abs(condition)) + np.exp(-abs(volume))


def assert_same_matches(matching, teacher, student):
    """Compare compiled and plain matching: equal scores, and the same partner wherever no other scores as much."""
    index, score = matching(teacher, student)
    plain_index, plain_score = match_numpy(teacher, student)
    assert index.dtype == np.intp
    assert_allclose(score, plain_score, rtol=1e-12, atol=1e-12)
    for i in np.flatnonzero(index != plain_index):
        partner = EllipsoidFeatures(*(value[[index[i]]] for value in vars(student).values()))
        alone = EllipsoidFeatures(*(value[[i]] for value in vars(teacher).values()))
        assert match_numpy(alone, partner)[1][0] == pytest.approx(plain_score[i], abs=1e-12)


@pytest.mark.parametrize("kind", ["random", "singular", "isotropic", "mixed", "elongated", "huge"])
@pytest.mark.parametrize("d", [2, 3, 6])
@pytest.mark.parametrize(("n", "m"), [(40, 50), (1, 1), (7, 1100)])
@pytest.mark.parametrize("matching", [match_by_tree, match_by_table])
def test_compiled_matching_agrees_with_numpy(matching, kind, d, n, m, random_spd, random_singular):
    """Both find the same partners and scores, for few and many, round and elongated ellipsoids."""
    rng = np.random.default_rng(d)
    teacher = clouds(kind, rng, max(n, 4), d, random_spd, random_singular)[-n:]
    student = clouds(kind, rng, max(m, 4), d, random_spd, random_singular)[-m:]
    assert_same_matches(matching, EllipsoidFeatures.of(teacher), EllipsoidFeatures.of(student))


def test_uncompiled_matching_agrees_with_numpy():
    """The kernels do the same without the compiler."""
    code = f"""
import numpy as np
from maniport.transfer.icp.correspondence.match_table import MatchTable
from maniport.transfer.icp.correspondence.match_tree import EllipsoidFeatures, MatchTree
{"".join(map(inspect.getsource, (match_numpy, match_by_tree, match_by_table)))}
for scale in (1.0, 2000.0):
    for d in (2, 3):
        rng = np.random.default_rng(d)
        factor = rng.standard_normal((2, 9, d, d)) * np.linspace(1.0, scale, d)
        teacher, student = map(EllipsoidFeatures.of, factor @ np.swapaxes(factor, -1, -2) + np.eye(d))
        plain, best = match_numpy(teacher, student)
        for matching in (match_by_tree, match_by_table):
            index, score = matching(teacher, student)
            assert np.array_equal(index, plain) and np.allclose(score, best, rtol=1e-12)
"""
    environment = {**os.environ, "NUMBA_DISABLE_JIT": "1"}
    done = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


def test_score_is_the_paper_s(random_spd):
    """The score of a match is eq. 18, and no other partner has a larger one."""
    rng = np.random.default_rng(0)
    teacher, student = random_spd(rng, 10, 3, 5.0), random_spd(rng, 12, 3, 7.0)
    index, score = match_by_table(EllipsoidFeatures.of(teacher), EllipsoidFeatures.of(student))
    every = np.array([[score_of_pair(t, s) for s in student] for t in teacher])
    assert_allclose(score, every.max(axis=1), rtol=1e-12)
    assert_array_equal(index, every.argmax(axis=1))


@pytest.mark.parametrize("d", [2, 3, 6])
@pytest.mark.parametrize("matching", [match_by_tree, match_by_table])
def test_every_ellipsoid_matches_itself(matching, d, random_spd):
    """A set is matched with itself one to one, with the full score of 4."""
    features = EllipsoidFeatures.of(random_spd(np.random.default_rng(d), 50, d))
    index, score = matching(features, features)
    assert_array_equal(index, np.arange(50))
    assert_allclose(score, 4.0, rtol=1e-12)


@pytest.mark.parametrize("matching", [match_by_tree, match_by_table, match_numpy])
def test_first_partner_wins_a_tie(matching, random_spd):
    """Of equal student ellipsoids the first is taken."""
    points = random_spd(np.random.default_rng(0), 5, 3)
    features = EllipsoidFeatures.of(points)
    index, _ = matching(features, EllipsoidFeatures.of(np.concatenate([points[::-1]] * 300)))
    assert_array_equal(index, [4, 3, 2, 1, 0])


def test_features_turn_with_the_ellipsoid(random_spd, random_rotation):
    """Turning features is measuring turned ellipsoids, up to the sign of the directions."""
    rng = np.random.default_rng(0)
    points, rotation = random_spd(rng, 10, 3), random_rotation(rng, 3)
    turned = EllipsoidFeatures.of(points).turned(rotation)
    measured = EllipsoidFeatures.of(rotation @ points @ rotation.T)
    assert_allclose(np.abs(np.sum(turned.minor * measured.minor, axis=1)), 1.0, rtol=1e-12)
    assert_allclose(np.abs(np.sum(turned.major * measured.major, axis=1)), 1.0, rtol=1e-12)
    assert_allclose(turned.condition, measured.condition, rtol=1e-10)
    assert_allclose(turned.volume, measured.volume, rtol=1e-10)


def test_equal_eigenvalues_do_not_decide(random_rotation):
    """Directions that are undefined contribute nothing, whatever the decomposition returned for them."""
    rng = np.random.default_rng(0)
    frame = random_rotation(rng, 3)
    disc, needle = np.diag([1.0, 4.0, 4.0]), np.diag([1.0, 1.0, 4.0])
    features = EllipsoidFeatures.of(np.stack([disc, needle, 2.0 * np.eye(3)]))
    assert_array_equal(np.abs(features.minor), [[1, 0, 0], [0, 0, 0], [0, 0, 0]])
    assert_array_equal(np.abs(features.major), [[0, 0, 0], [0, 0, 1], [0, 0, 0]])
    turned = EllipsoidFeatures.of(frame @ np.stack([disc, needle, 2.0 * np.eye(3)]) @ frame.T)
    assert np.all(turned.major[[0, 2]] == 0)
    assert np.all(turned.minor[[1, 2]] == 0)
    student = EllipsoidFeatures.of(np.stack([2.0 * np.eye(3), 2.1 * np.eye(3)]))
    for shape in (features, turned):
        index, score = MatchTree(student).query(shape)
        assert index[2] == 0
        assert score[2] == pytest.approx(2.0)
