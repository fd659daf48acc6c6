"""Methods that others are compared with: transport of spectra, and coherent point drift."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.spatial.distance import cdist
from scipy.stats import multivariate_normal

from maniport.errors import InvalidInputError
from maniport.spd import distance
from maniport.spd.kernels import eigh
from maniport.spd.matrix_functions import apply
from maniport.testing import check_adapter
from maniport.transfer import COMPETITORS, CoherentPointDrift, SpectralTransport, method_of, name_of
from maniport.transfer.entropic_map import EntropicMap, sinkhorn
from maniport.transfer.lengths.field import damped
from maniport.transfer.release import released


def test_spectral_transport_keeps_the_contract():
    """All laws of the battery hold, that equal domains change nothing included."""
    check_adapter(SpectralTransport(), (3, 2))


def test_coherent_point_drift_keeps_the_contract():
    """All laws of the battery hold but one: the drift stops before equal clouds are back in their place."""
    check_adapter(CoherentPointDrift(max_iter=8), (3,), identity=False)


def test_damping_is_taken_off_as_the_field_of_lengths_does(random_spd):
    """What the release leaves is SPD whatever comes in, and damping it again gives it back."""
    points = random_spd(np.random.default_rng(0), 20, 3, 1e8)
    bare = released(points, 0.5)
    assert eigh(bare)[0].min() > 0
    assert_allclose(damped(bare, 0.5), points, rtol=1e-7)


def test_competitors_have_names():
    """They are made by name, and their adapters tell the name; what has none is called by its class."""
    assert {name_of(method_of(name)) for name in COMPETITORS} == set(COMPETITORS)
    assert name_of(type("Mine", (SpectralTransport,), {})()) == "Mine"


def test_spectral_transport_keeps_axes_and_what_is_round_round(random_spd):
    """Every axis stays where it is, and axes of equal length stay equal."""
    rng = np.random.default_rng(0)
    teacher, student = random_spd(rng, 40, 3), apply(random_spd(rng, 50, 3), lambda values: 3.0 * values**0.5)
    adapter = SpectralTransport().fit(teacher, student)
    axes = eigh(teacher)[1]
    turned = np.swapaxes(axes, 1, 2) @ adapter.transform(teacher) @ axes
    off_diagonal = turned * (1.0 - np.eye(3))
    assert np.abs(off_diagonal).max() <= 1e-10 * np.abs(turned).max()
    assert_allclose(np.diff(eigh(adapter.transform(np.diag([2.0, 2.0, 5.0])))[0])[0], 0.0, atol=1e-10)


def test_spectral_transport_dilates_and_scales_where_that_is_all():
    """From diagonal ellipsoids T to 3 √T it is that map: spectra are moved to the student's mean volume and spread."""
    logs = np.random.default_rng(1).standard_normal((30, 3)) * [1.0, 0.5, 0.2]
    teacher, student = (np.exp(values)[..., None] * np.eye(3) for values in (logs, 0.5 * logs + np.log(3.0)))
    adapter = SpectralTransport().fit(teacher, student)
    assert_allclose(adapter.transform(teacher), student, rtol=1e-9)
    assert adapter.start_.mean() == pytest.approx(np.log(3.0) + 0.5 * logs.mean())


def test_spectral_transport_refuses_what_has_too_many_orders(random_spd):
    """Of six axes there are 720 orders."""
    domain = random_spd(np.random.default_rng(0), 5, 6)
    with pytest.raises(InvalidInputError, match="at most 3×3; found 6×6"):
        SpectralTransport().fit(domain, domain)


def test_sinkhorn_solves_the_transport_that_pot_solves():
    """The masses between two clouds agree with those of POT."""
    ot = pytest.importorskip("ot")
    rng = np.random.default_rng(0)
    first, other = rng.standard_normal((20, 2)), 1.0 + 2.0 * rng.standard_normal((30, 2))
    cost, epsilon = cdist(first, other, "sqeuclidean"), 2.0
    shares = np.exp(sinkhorn(-cost / epsilon) - cost / epsilon)
    shares /= 20.0 * shares.sum(axis=1, keepdims=True)
    assert_allclose(shares, ot.sinkhorn(np.full(20, 0.05), np.full(30, 1.0 / 30.0), cost, epsilon, stopThr=1e-12),
                    rtol=1e-6)  # fmt: skip


def test_the_entropic_map_keeps_a_cloud_and_follows_a_shift():
    """Of a cloud to itself it is the identity; of a cloud to its shifted copy it is the shift."""
    cloud = np.random.default_rng(0).standard_normal((60, 1, 3))
    still, shifted = (EntropicMap.of(cloud, cloud + by, 0.5) for by in (0.0, 0.7))
    inside = cloud[:, 0] * 0.5
    assert_allclose(still(inside), inside, atol=1e-12)
    assert_allclose(shifted(inside), inside + 0.7, atol=1e-6)


def test_coherent_point_drift_undoes_a_bend(random_spd):
    """Onto a smoothly bent copy of its own cloud the drift comes nearer than the rigid map alone."""
    teacher = random_spd(np.random.default_rng(0), 200, 2)
    student = apply(teacher, lambda values: np.exp(np.log(values) + 0.3 * np.sin(np.log(values))))
    drifted, rigid = (method_of(name).fit(teacher, student) for name in ("coherent-point-drift", "parallel-transport"))
    assert -drifted.score(teacher, student) < -0.5 * rigid.score(teacher, student)
    assert drifted.converged_
    assert np.all(np.diff(drifted.history_[:5]) < 0.0)


def test_a_step_of_the_drift_is_that_of_the_mixture():
    """Shares are posteriors of a mixture with a uniform part, w; the field's pull λ σ² W is what it leaves of the way.

    Its width is β coordinates' standard deviations; the new variance is the mean square of what is left, by coordinate.
    """
    random = np.random.default_rng(3)
    start, goal, share, stiffness = random.standard_normal((7, 3)), 0.3 + random.standard_normal((9, 3)), 0.3, 2.0
    goal -= goal.mean(axis=0)  # as log-vectors about their mean are
    drift = CoherentPointDrift(width=2.0, stiffness=stiffness, outliers=share, max_iter=1)
    drift._fit_field(start, goal)
    before, after = drift.history_**2
    assert before == pytest.approx(np.mean((start[:, None] - goal) ** 2))
    assert drift.width_ == pytest.approx(2.0 * np.std(goal))
    likely = (
        np.array([multivariate_normal.pdf(goal, center, before * np.eye(3)) for center in start]) * (1.0 - share) / 7
    )
    posterior = likely / (likely.sum(axis=0) + share / 9)
    way = goal - drift._moved(start)[:, None]
    pull = np.einsum("ij,ijk->ik", posterior, way)
    assert_allclose(stiffness * before * drift.weights_, pull, atol=1e-12)
    assert after == pytest.approx(np.sum(posterior[..., None] * way**2) / (3.0 * posterior.sum()))


def test_the_drift_ends_where_it_hardly_moves(random_spd):
    """With a coarse tolerance it ends at the first small change of the variance, and says so."""
    teacher, student = (random_spd(np.random.default_rng(seed), 30, 2) for seed in (0, 1))
    drift = CoherentPointDrift(tol=0.05).fit(teacher, student)
    changes = np.abs(np.diff(drift.history_**2)) / drift.history_[:-1] ** 2
    assert changes[-1] <= 0.05 < changes[:-1].min()
    assert drift.converged_
    assert drift.stop_reason_ == "the clouds drift no more"


def test_the_table_costs_what_its_pairs_are_apart(random_spd):
    """The cost of a table of nearest ellipsoids is the root mean squared distance of its pairs."""
    teacher, student = (random_spd(np.random.default_rng(seed), 20, 3) for seed in (0, 1))
    apart = distance(teacher[:, None], student).min(axis=1)
    assert method_of("nearest-neighbor").fit(teacher, student).cost_ == pytest.approx(np.sqrt(np.mean(apart**2)))
