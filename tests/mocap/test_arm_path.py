import numpy as np
import pytest
from scipy.optimize import lsq_linear

from maniport.mocap import arm_path, fit_arm, read_recording
from maniport.mocap.arm_path import JointPriors, solve_path

DOF = 3


@pytest.mark.parametrize("width", [100.0, 0.2])
def test_a_path_agrees_with_one_large_problem(width):
    smoothing = np.array([0.5, 1.0, 2.0])
    n = 7
    generator = np.random.default_rng(3)
    matrices = generator.normal(size=(n, 4, DOF))
    targets = generator.normal(size=(n, 4))
    pull = np.array([0.0, 0.3, 0.05])
    neutral = np.array([0.0, 0.1, 0.0])
    weights = np.zeros((n, DOF))
    weights[1:-1] = smoothing
    priors = JointPriors(np.full(DOF, -width), np.full(DOF, width), pull, neutral)
    q = solve_path(
        lambda q: (np.einsum("nri,ni->nr", matrices, q) - targets, matrices.copy()),
        np.zeros((n, DOF)),
        priors,
        weights,
    )
    difference = np.diff(np.eye(n), 2, axis=0)
    blocks = np.zeros((n, 4, n, DOF))
    blocks[np.arange(n), :, np.arange(n)] = matrices
    dense = np.concatenate(
        [
            blocks.reshape(-1, n * DOF),
            np.kron(np.eye(n), np.diag(pull)),
            np.kron(difference, np.diag(smoothing)),
        ]
    )
    values = np.concatenate([targets.ravel(), np.tile(pull * neutral, n), np.zeros((n - 2) * DOF)])
    reference = lsq_linear(dense, values, (-width, width), tol=1e-14)
    np.testing.assert_allclose(q.ravel(), reference.x, atol=2e-3 if width < 1 else 1e-8)
    assert np.sum((dense @ q.ravel() - values) ** 2) == pytest.approx(2 * reference.cost, rel=1e-4)


def test_blocks_are_joined_without_a_seam(monkeypatch):
    recording = read_recording("freeform")
    fractions = []
    monkeypatch.setattr(arm_path, "LEAST_GAIN", 1e-16)
    whole = fit_arm(recording)
    monkeypatch.setattr(arm_path, "BLOCK", 100)
    monkeypatch.setattr(arm_path, "AROUND", 40)
    parts = fit_arm(recording, progress=lambda step, fraction, *_: fractions.append(fraction))
    np.testing.assert_allclose(parts.joint_angles, whole.joint_angles, atol=1e-3)
    assert fractions == sorted(fractions)
    assert len(fractions) > 5
