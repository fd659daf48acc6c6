"""An arm's kinematics as CasADi expressions, from the plain description of its chain."""

from typing import Any

import numpy as np

from maniport.bodies import Arm
from maniport.bodies.chain import REVOLUTE
from maniport.optional import casadi


def symbolic_kinematics(arm: Arm, q: Any) -> tuple[Any, Any]:
    """Pose and geometric Jacobian of the tip.

    Rotations by Rodrigues' formula R = I + sin θ [a] + (1 − cos θ) [a]²; columns of the Jacobian are a × (p − o) over a
    for a joint that turns about a through o, and a over 0 for one that slides along a.

    Parameters
    ----------
    arm : Arm
    q : casadi.SX or casadi.MX, shape (dof, 1)
        Joint coordinates [rad or m].

    Returns
    -------
    pose : same type, shape (4, 4)
        As `Arm.forward`: in the base frame, metres.
    jacobian : same type, shape (6, dof)
        As `Arm.jacobian`: linear rows first, along the axes of the base frame.
    """
    ca = casadi()

    chain = arm.chain
    positions = ca.mtimes(_sparse(chain.coupling), q) + chain.offset
    rotation, origin = ca.DM.eye(3), ca.DM.zeros(3)
    axes, origins = [], []
    for i, joint in enumerate(chain.joints):
        origin = origin + ca.mtimes(rotation, _sparse(joint.placement[:3, 3]))
        rotation = ca.mtimes(rotation, _sparse(joint.placement[:3, :3]))
        axes.append(ca.mtimes(rotation, _sparse(joint.axis)))
        if joint.kind == REVOLUTE:
            cross = np.cross(np.eye(3), joint.axis)
            sine, cosine = ca.sin(positions[i]), ca.cos(positions[i])
            turn = ca.DM.eye(3) + sine * _sparse(cross) + (1 - cosine) * _sparse(cross @ cross)
            rotation = ca.mtimes(rotation, turn)
        else:
            origin = origin + axes[-1] * positions[i]
        origins.append(origin)
    tip = chain.frames[chain.frame].placement
    hand = origin + ca.mtimes(rotation, _sparse(tip[:3, 3]))
    rotation = ca.mtimes(rotation, _sparse(tip[:3, :3]))
    columns = []
    for joint, axis, place in zip(chain.joints, axes, origins, strict=True):
        turns = joint.kind == REVOLUTE
        columns.append(ca.vertcat(ca.cross(axis, hand - place), axis) if turns else ca.vertcat(axis, ca.DM.zeros(3)))
    jacobian = ca.mtimes(ca.horzcat(*columns), _sparse(chain.coupling))
    pose = ca.vertcat(ca.horzcat(rotation, hand), ca.DM([[0.0, 0.0, 0.0, 1.0]]))
    return ca.densify(pose), ca.densify(jacobian)


def _sparse(array: Any) -> Any:
    """A constant without its zeros, and without the rounding of right angles, so that expressions stay small."""
    ca = casadi()

    return ca.sparsify(ca.DM(np.where(np.abs(array) < 1e-15, 0.0, array)))
