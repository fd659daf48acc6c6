"""What following costs: derivatives by finite differences, with everything that may be asked for at once."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from arm_problems import arm_problem
from maniport import spd
from maniport.arms import EllipsoidSpec
from maniport.motion.problem import CostWeights
from maniport.spd.regularization import Regularization


@pytest.mark.parametrize("kind", ["velocity", "force"])
@pytest.mark.parametrize("part", ["translation", "full"])
@pytest.mark.parametrize("weighed", [False, True])
def test_derivatives_are_those_of_the_cost(panda, kind, part, weighed):
    """√f, Jᵀr and JᵀJ of ellipsoid, position and two axes agree with the residual in public terms."""
    random = np.random.default_rng(0)
    n = 4
    step = 1e-6
    epsilon = 0.05
    spec = EllipsoidSpec(kind, part)
    weights = (3.0, 0.0, 7.0)
    m = spec.size * (spec.size + 1) // 2
    lift = epsilon * np.eye(spec.size)
    target = panda.ellipsoids(panda.sample(n, 2), spec)
    positions = random.normal(size=(n, 3))
    rotations = Rotation.random(n, random).as_matrix()
    half = random.normal(size=(n, m, m)) if weighed else np.tile(np.eye(m), (n, 1, 1))
    metric = np.swapaxes(half, 1, 2) @ half if weighed else None
    problem = arm_problem(
        panda,
        target,
        positions,
        spec=spec,
        damping=Regularization(epsilon=epsilon),
        weights=CostWeights(5.0, weights),
        rotations=rotations,
        direction_weights=metric,
    )

    def residual(q):
        root = spd.powm(target + lift, -0.5)
        log = spd.to_vector(spd.logm(root @ (panda.ellipsoids(q, spec) + lift) @ root))
        poses = panda.forward(q)
        axes = [weights[k] * (poses[:, :3, k] - rotations[:, :, k]) for k in (0, 2)]
        return np.hstack(
            [(half @ log[..., None])[..., 0], 5.0 * (poses[:, :3, 3] - positions), *axes]
        )

    q = panda.sample(n, 1)
    equations = problem.normal_equations(q)
    length = equations.distance
    jacobian = np.stack(
        [(residual(q + step * e) - residual(q - step * e)) / (2 * step) for e in np.eye(7)], axis=-1
    )
    r = residual(q)
    scale = np.abs(jacobian).max()
    assert length == pytest.approx(np.linalg.norm(r, axis=1), rel=1e-8)
    assert length**2 == pytest.approx(problem.cost(q), rel=1e-8)
    assert equations.gradient == pytest.approx(
        np.einsum("nmk,nm->nk", jacobian, r), abs=1e-6 * scale * length.max()
    )
    assert equations.hessian == pytest.approx(
        np.swapaxes(jacobian, -1, -2) @ jacobian, abs=1e-6 * scale**2
    )


def test_axes_angles_are_those_between_directions(panda):
    q = panda.sample(5, 1)
    desired = Rotation.random(5, np.random.default_rng(1)).as_matrix()
    weights = CostWeights(axes=(0.0, 0.0, 1.0))
    ellipsoids = panda.manipulability(q)
    problem = arm_problem(panda, ellipsoids, weights=weights, rotations=desired)
    cosine = np.sum(panda.forward(q)[:, :3, 2] * desired[:, :, 2], axis=1)
    assert problem.orientation_error(q) == pytest.approx(np.arccos(cosine))
    assert arm_problem(panda, ellipsoids, weights=weights).orientation_error(q) is None
