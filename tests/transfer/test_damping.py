"""Regularization belongs to the adapter: what damping and a floor add, and how much of it comes off again."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import maniport as mp
from maniport.transfer.adapter import RELEASED
from maniport.transfer.rigid_adapter import RigidMap

seeds = given(seed=st.integers(0, 2**32 - 1))
sizes = pytest.mark.parametrize("d", [2, 3, 6])


def lowest_image_eigenvalues(rigid, points):
    """Smallest eigenvalue of f(P), from the largest one of its inverse, which rounding does not hide."""
    values, vectors = np.linalg.eigh(rigid.teacher_mean)
    whitening = (vectors / np.sqrt(values)) @ vectors.T
    values, vectors = np.linalg.eigh(whitening @ points @ whitening)
    inverse = (vectors * values[:, None] ** -rigid.ratio) @ np.swapaxes(vectors, -1, -2)
    values, frame = np.linalg.eigh(rigid.student_mean)
    back = (frame / np.sqrt(values)) @ frame.T @ rigid.rotation
    return 1.0 / np.linalg.eigvalsh(back @ inverse @ back.T)[:, -1]


@sizes
@pytest.mark.parametrize("ratio", [0.2, 0.5, 0.9, 1.0, 1.0 + 1e-12, 1.001, 1.3, 2.0, 3.0])
@seeds
def test_bound_on_the_lowest_eigenvalue_holds(d, ratio, seed, random_spd, random_rotation):
    """No image of T + ε I has an eigenvalue below the bound, be T random, a needle or zero."""
    rng = np.random.default_rng(seed)
    damping = 10 ** rng.uniform(-6, 0)
    teacher_mean = random_spd(rng, 1, d, 10 ** rng.uniform(0, 3))[0]
    rigid = RigidMap(teacher_mean, random_spd(rng, 1, d)[0], random_rotation(rng, d), ratio)
    directions = rng.standard_normal((200, d))
    needles = directions[:, :, None] * directions[:, None, :] * (damping * 10 ** rng.uniform(-4, 3, (200, 1, 1)))
    shapes = np.concatenate([needles, damping * random_spd(rng, 50, d, 1e4), np.zeros((1, d, d))])
    lowest = lowest_image_eigenvalues(rigid, shapes + damping * np.eye(d))
    bound = rigid.lowest_eigenvalue(damping)
    assert bound > 0
    assert lowest.min() >= bound * (1.0 - 1e-9)
    if ratio <= 1.0:  # then the zero matrix attains it
        assert lowest.min() == pytest.approx(bound, rel=1e-9)


def test_released_damping_is_all_of_it_between_equal_domains(random_singular):
    """Where the domains are equal all but a millionth of the damping comes off again, in the table too."""
    domain = random_singular(np.random.default_rng(0), 30, 3)
    for adapter in (mp.ParallelTransport(damping=0.01), mp.NearestNeighbor(damping=0.01)):
        adapter.fit(domain, domain)
        assert adapter.released_damping_ == pytest.approx(RELEASED * adapter.student_damping_, rel=1e-9)
    for adapter in (mp.ParallelTransport(eigenvalue_floor=1e-3), mp.NearestNeighbor(eigenvalue_floor=1e-3)):
        adapter.fit(domain, domain)
        assert adapter.teacher_damping_ == adapter.student_damping_ == adapter.released_damping_ == 0.0
