"""The ellipsoid task in Pink: its error and Jacobian, and what becomes of them in inverse kinematics."""

import numpy as np
import pink
import pinocchio as pin
import pytest
from configurations import at
from numpy.testing import assert_allclose
from pink.exceptions import TargetNotSet

from maniport import spd
from maniport.arms import Arm, EllipsoidSpec
from maniport.errors import InvalidInputError, NotSPDError, UnknownNameError
from maniport.motion import ManipulabilityEllipsoidTask, robot_model
from maniport.spd.regularization import Regularization

EPSILON = 0.003
DAMPING = Regularization.absolute(EPSILON)
PARTS = ["translation", "rotation", "full"]


def middle(arm, seed, spread=0.25):
    """Draw a configuration in the middle of the limits."""
    share = 0.5 + spread * np.random.default_rng(seed).uniform(-1, 1, arm.dof)
    return arm.lower + share * (arm.upper - arm.lower)


def raised(matrices, epsilon=EPSILON):
    """Add the damping."""
    return matrices + epsilon * np.eye(matrices.shape[-1])


@pytest.mark.parametrize("part", PARTS)
@pytest.mark.parametrize("speeds", [False, True])
def test_length_of_the_error_is_the_distance_to_the_wanted_ellipsoid(panda, model, part, speeds):
    """|e| is the affine-invariant distance with the damping on both sides, with joint weights too; 0 at the target."""
    spec = EllipsoidSpec(part=part, joint_weights="velocity-limits" if speeds else None)
    task = ManipulabilityEllipsoidTask(panda.frame, damping=DAMPING, spec=spec)
    here, there = middle(panda, 0), middle(panda, 1)
    wanted = panda.ellipsoids(there, spec)
    task.set_target(wanted)
    error = task.compute_error(at(model, here))
    own = panda.ellipsoids(here, spec)
    assert_allclose(np.linalg.norm(error), spd.distance(raised(wanted), raised(own)), rtol=1e-10)
    root = spd.invsqrtm(raised(own))
    assert_allclose(error, spd.to_vector(spd.logm(spd.from_vector(spd.to_vector(root @ raised(wanted) @ root)))))
    assert_allclose(task.compute_error(at(model, there)), 0, atol=1e-12)


@pytest.mark.parametrize("part", PARTS)
@pytest.mark.parametrize("turned", [False, True])
def test_jacobian_is_the_derivative_of_the_error_at_the_target(panda, model, part, turned):
    """Finite differences of the error agree with the Jacobian where the error is small: Pink's convention of signs."""
    size = 21 if part == "full" else 6
    weights = np.eye(size) if turned else None
    task = ManipulabilityEllipsoidTask(panda.frame, damping=DAMPING, spec=EllipsoidSpec(part=part), weights=weights)
    q, h = middle(panda, 2), 1e-6
    task.set_target_from_configuration(at(model, q))
    assert_allclose(task.target, panda.manipulability(q, part=part), atol=1e-14)
    moved = [task.compute_error(at(model, q + h * e)) - task.compute_error(at(model, q - h * e)) for e in np.eye(7)]
    assert_allclose(task.compute_jacobian(at(model, q)), np.array(moved).T / (2 * h), atol=2e-6)


@pytest.mark.parametrize("part", PARTS)
def test_jacobian_gives_the_exact_gradient_far_from_the_target(panda, model, part):
    """Jᵀe is the gradient of half the squared distance at any distance, by finite differences."""
    task = ManipulabilityEllipsoidTask(panda.frame, damping=DAMPING, spec=EllipsoidSpec(part=part))
    q, h = middle(panda, 3), 1e-5
    task.set_target(panda.manipulability(middle(panda, 4), part=part))

    def half_square(x):
        return 0.5 * np.sum(task.compute_error(at(model, x)) ** 2)

    slope = [(half_square(q + h * e) - half_square(q - h * e)) / (2 * h) for e in np.eye(7)]
    here = at(model, q)
    assert_allclose(task.compute_jacobian(here).T @ task.compute_error(here), slope, atol=1e-6)


def test_singular_arms_give_finite_numbers_or_say_so(panda, model):
    """A stretched arm whose ellipsoid is flat has a finite error and Jacobian; without any damping it is an error."""
    planar = robot_model(Arm.from_dh("planar", [[0, 0, 1, 0]] * 3))
    flat = at(planar, [0.3, 0.5, -0.2])
    for stretched in (flat, at(planar, np.zeros(3))):
        task = ManipulabilityEllipsoidTask("link3")
        task.set_target(np.diag([2.0, 1.0, 0.0]))
        assert np.all(np.isfinite(task.compute_error(stretched)))
        assert np.all(np.isfinite(task.compute_jacobian(stretched)))
        velocity = pink.solve_ik(stretched, [task], 0.01, solver="daqp")
        assert np.all(np.isfinite(velocity))
    strict = ManipulabilityEllipsoidTask("link3", damping=None)
    strict.set_target(np.eye(3))
    with pytest.raises(NotSPDError, match="singular at q"):
        strict.compute_error(flat)
    with pytest.raises(NotSPDError, match="damping"):
        strict.set_target(np.diag([2.0, 1.0, 0.0]))


def tree():
    """A torso that turns, with an arm of slides and turns that starts on it, and a head beside that arm."""
    model, rng = pin.Model(), np.random.default_rng(0)
    kinds = {"torso": "RZ", "head": "RY", "shoulder": "RX", "boom": "PZ", "elbow": "RUBY", "neck": "RX", "wrist": "RZ"}
    parents = {"torso": 0, "head": "torso", "shoulder": "torso", "boom": "shoulder", "elbow": "boom", "neck": "head"}
    for name, kind in kinds.items():
        parent = parents.get(name, "elbow")
        parent = 0 if parent == 0 else model.getJointId(parent)
        place = pin.SE3(pin.exp3(rng.normal(size=3)), 0.4 * rng.normal(size=3))
        model.addJoint(parent, getattr(pin, f"JointModel{kind}")(), place, name)
    hand = pin.SE3(np.eye(3), np.array([0.1, 0.2, 0.3]))
    model.addFrame(pin.Frame("hand", model.getJointId("wrist"), 0, hand, pin.FrameType.OP_FRAME))
    return model


def test_joints_off_the_chain_have_no_part_in_it():
    """On a tree of joints, columns beside the frame's chain are zero and the others agree with finite differences."""
    model = tree()
    q, h = pin.randomConfiguration(model, -np.ones(model.nq), np.ones(model.nq)), 1e-6
    task = ManipulabilityEllipsoidTask(
        "hand", damping=Regularization.absolute(0.1), spec=EllipsoidSpec(joint_weights=np.linspace(0.5, 2, model.nv))
    )
    task.set_target_from_configuration(at(model, q))
    jacobian = task.compute_jacobian(at(model, q))
    for k, direction in enumerate(np.eye(model.nv)):
        ends = [task.compute_error(at(model, pin.integrate(model, q, s * h * direction))) for s in (1, -1)]
        assert_allclose(jacobian[:, k], (ends[0] - ends[1]) / (2 * h), atol=2e-6)
    beside = [model.joints[model.getJointId(name)].idx_v for name in ("head", "neck")]
    assert not np.any(jacobian[:, beside])


def test_other_joints_and_unknown_frames_are_named():
    """A floating base on the chain and a frame that is not there raise errors that name them."""
    humanoid = pin.buildSampleModelHumanoidRandom(True)
    configuration = at(humanoid, pin.neutral(humanoid))
    frame = humanoid.frames[humanoid.nframes - 1].name
    task = ManipulabilityEllipsoidTask(frame)
    task.set_target(np.eye(3))
    with pytest.raises(InvalidInputError, match=r"root_joint.*FreeFlyer"):
        task.compute_error(configuration)
    lost = ManipulabilityEllipsoidTask("hnad")
    lost.set_target(np.eye(3))
    with pytest.raises(UnknownNameError, match="'hand'"):
        lost.compute_error(at(tree(), pin.neutral(tree())))


def test_bad_input_is_told(panda, model):
    """Wrong shapes, signs and missing targets raise errors that say what is wrong."""
    with pytest.raises(TargetNotSet):
        ManipulabilityEllipsoidTask(panda.frame).compute_error(at(model, middle(panda, 0)))
    task = ManipulabilityEllipsoidTask(panda.frame)
    for target, error in [
        (np.eye(2), InvalidInputError),
        (np.full((3, 3), np.nan), InvalidInputError),
        (-np.eye(3), NotSPDError),
        (np.eye(3)[None], InvalidInputError),
        (np.triu(np.ones((3, 3))), NotSPDError),
    ]:
        with pytest.raises(error, match="ellipsoid"):
            task.set_target(target)
    for options, word in [
        ({"spec": EllipsoidSpec("force")}, "velocity"), ({"damping": -1.0}, "damping"),
        ({"cost": [1.0]}, "cost"), ({"cost": -1.0}, "cost"),
        ({"weights": np.eye(3)}, "weights"), ({"weights": -np.eye(6)}, "weights"), ({"gain": 0.0}, "gain"),
        ({"lm_damping": -1.0}, "lm_damping"), ({"gain": 3}, r"gain must be a number in \(0, 1\]; found 3"),
    ]:  # fmt: skip
        with pytest.raises(InvalidInputError, match=word):
            ManipulabilityEllipsoidTask(panda.frame, **options)
    task = ManipulabilityEllipsoidTask(panda.frame, spec=EllipsoidSpec(joint_weights=np.ones(5)))
    with pytest.raises(InvalidInputError, match="joint_weights"):
        task.set_target_from_configuration(at(model, middle(panda, 0)))
