"""Kinematics of a chain through Pinocchio: tight loops over joint positions, without checks."""

import threading
from collections.abc import Sequence

import numpy as np
import pinocchio as pin

from maniport.arms.chain import PRISMATIC, Chain
from maniport.util.validation import Array


class Kinematics:
    """A Pinocchio model of a chain."""

    def __init__(self, chain: Chain):
        self._chain = chain
        self._trivial = np.array_equal(chain.coupling, np.eye(len(chain.joints))) and not np.any(chain.offset)
        self._model = model = pin.Model()
        model.name = chain.name
        parent = 0
        for joint in chain.joints:
            kind = pin.JointModelPrismaticUnaligned if joint.kind == PRISMATIC else pin.JointModelRevoluteUnaligned
            parent = model.addJoint(parent, kind(joint.axis), pin.SE3(joint.placement), joint.name)
        frame = chain.frames[chain.frame]
        placed = pin.Frame(chain.frame, frame.joint, 0, pin.SE3(frame.placement), pin.FrameType.OP_FRAME)
        self._tip = model.addFrame(placed)
        self._joint_ids = {joint.name: i + 1 for i, joint in enumerate(chain.joints)}
        self._own = _Workspace(model, self._tip)

    def positions(self, q: Array) -> Array:
        """Positions of the chain's joints, shape (n, joints), for degrees of freedom, shape (n, dof)."""
        return np.ascontiguousarray(q if self._trivial else q @ self._chain.coupling.T + self._chain.offset)

    def coupled(self, jacobians: Array) -> Array:
        """Chain rule from the chain's joints, shape (..., joints), to the degrees of freedom, shape (..., dof)."""
        if self._trivial:
            return jacobians
        # One large product is faster than one small product a configuration.
        flat = jacobians.reshape(-1, jacobians.shape[-1]) @ self._chain.coupling
        return np.asarray(flat.reshape(*jacobians.shape[:-1], flat.shape[1]))

    def forward(self, positions: Array) -> Array:
        """Poses of the tip, shape (n, 4, 4)."""
        model, data, compute = self._model, self._own.data, pin.framesForwardKinematics
        (rotation, origin), (poses, rotations, origins) = self._own.tip, _poses(len(positions))
        for i, q in enumerate(positions):
            compute(model, data, q)  # places a handful of frames more quickly than a second call places one
            rotations[i], origins[i] = rotation, origin
        return poses

    def jacobian(self, positions: Array) -> Array:
        """Jacobians of the tip with respect to the chain's joints, linear rows first, shape (n, 6, joints)."""
        model, data, tip = self._model, self._own.data, self._tip
        compute, axes = pin.computeFrameJacobian, pin.LOCAL_WORLD_ALIGNED
        jacobians = np.empty((len(positions), 6, model.nv))
        into = _as_pinocchio_shapes(jacobians)
        for i, q in enumerate(positions):
            into[i] = compute(model, data, q, tip, axes)
        return jacobians

    def motion(self, positions: Array) -> tuple[Array, Array]:
        """What `forward` and `jacobian` give, by one pass over the chain."""
        model, data, tip = self._model, self._own.data, self._tip
        compute, axes = pin.computeFrameJacobian, pin.LOCAL_WORLD_ALIGNED
        (rotation, origin), (poses, rotations, origins) = self._own.tip, _poses(len(positions))
        jacobians = np.empty((len(positions), 6, model.nv))
        into = _as_pinocchio_shapes(jacobians)
        for i, q in enumerate(positions):
            into[i] = compute(model, data, q, tip, axes)  # which places the frame, too
            rotations[i], origins[i] = rotation, origin
        return poses, jacobians

    def joint_poses(self, positions: Array, joints: Sequence[str]) -> Array:
        """Poses of joints' frames after their motion, shape (n, k, 4, 4)."""
        model, data = self._model, self._own.data
        ids = [self._joint_ids[name] for name in joints]
        poses = np.empty((len(positions), len(ids), 4, 4))
        for i, q in enumerate(positions):
            pin.forwardKinematics(model, data, q)
            for k, joint in enumerate(ids):
                poses[i, k] = data.oMi[joint].homogeneous
        return poses


class _Workspace(threading.local):
    """Where Pinocchio leaves what it computes, one for each thread; `tip` shows the rotation and origin there."""

    def __init__(self, model: pin.Model, tip: int):
        self.data = model.createData()
        pose = self.data.oMf[tip]
        self.tip: tuple[Array, Array] = pose.rotation, pose.translation


def _poses(count: int) -> tuple[Array, Array, Array]:
    """Poses to fill, shape (count, 4, 4), and their rotations and origins in the same memory."""
    poses = np.zeros((count, 4, 4))
    poses[:, 3, 3] = 1.0
    return poses, poses[:, :3, :3], poses[:, :3, 3]


def _as_pinocchio_shapes(jacobians: Array) -> Array:
    """The same memory in the shapes that Pinocchio answers in: a column alone is a vector."""
    return jacobians[..., 0] if jacobians.shape[-1] == 1 else jacobians
