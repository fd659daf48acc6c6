"""An arm's kinematics and the logarithm of its ellipsoids as CasADi expressions.

Eigenvalues have no derivative where two of them meet, and their closed forms lose digits there. Instead, the integral

    log X = ∫₀¹ (X − I) (I + t (X − I))⁻¹ dt = ∫₀¹ (I − (I + t (X − I))⁻¹) / t dt

is taken by a sum over fixed nodes (tanh-sinh rule: Takahasi & Mori, Publ. RIMS 9, 1974), a rational function of X.
"""

from typing import Any

import numpy as np

from maniport.bodies import Arm
from maniport.bodies.chain import REVOLUTE
from maniport.optional import casadi
from maniport.validation import Array

NODES = 12
"""Nodes on either side of the middle: errors of 1e-7, 3e-5 and 1e-4 up to eigenvalues of 10, 100 and 1000, and their
inverses. X is the arm's ellipsoid seen from the target: eigenvalues near one matter most."""
SPAN = 3.2


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
    positions = ca.mtimes(constant(chain.coupling), q) + chain.offset
    rotation, origin = ca.DM.eye(3), ca.DM.zeros(3)
    axes, origins = [], []
    for i, joint in enumerate(chain.joints):
        origin = origin + ca.mtimes(rotation, constant(joint.placement[:3, 3]))
        rotation = ca.mtimes(rotation, constant(joint.placement[:3, :3]))
        axes.append(ca.mtimes(rotation, constant(joint.axis)))
        if joint.kind == REVOLUTE:
            cross = np.cross(np.eye(3), joint.axis)
            sine, cosine = ca.sin(positions[i]), ca.cos(positions[i])
            turn = ca.DM.eye(3) + sine * constant(cross) + (1 - cosine) * constant(cross @ cross)
            rotation = ca.mtimes(rotation, turn)
        else:
            origin = origin + axes[-1] * positions[i]
        origins.append(origin)
    tip = chain.frames[chain.frame].placement
    tip_at = origin + ca.mtimes(rotation, constant(tip[:3, 3]))
    rotation = ca.mtimes(rotation, constant(tip[:3, :3]))
    columns = []
    for joint, axis, place in zip(chain.joints, axes, origins, strict=True):
        turns = joint.kind == REVOLUTE
        columns.append(ca.vertcat(ca.cross(axis, tip_at - place), axis) if turns else ca.vertcat(axis, ca.DM.zeros(3)))
    jacobian = ca.mtimes(ca.horzcat(*columns), constant(chain.coupling))
    pose = ca.vertcat(ca.horzcat(rotation, tip_at), ca.DM([[0.0, 0.0, 0.0, 1.0]]))
    return ca.densify(pose), ca.densify(jacobian)


def constant(array: Any) -> Any:
    """A constant without its zeros, and without the rounding of right angles, so that expressions stay small."""
    ca = casadi()

    return ca.sparsify(ca.DM(np.where(np.abs(array) < 1e-15, 0.0, array)))


def log_vector(x: Any) -> Any:
    """Mandel vector of log X for a symmetric positive-definite expression X, 3×3 or 6×6; shape (m, 1)."""
    ca = casadi()

    d = x.shape[0]
    total, eye = ca.SX.zeros(d, d), ca.DM.eye(d)
    for t, weight in zip(*_rule(), strict=True):
        total += (weight / t) * (eye - _inverse(eye + t * (x - eye)))
    rows, columns = np.triu_indices(d, 1)
    off = [np.sqrt(2.0) * total[int(i), int(j)] for i, j in zip(rows, columns, strict=True)]
    return ca.vertcat(*(total[i, i] for i in range(d)), *off)


def _rule() -> tuple[Array, Array]:
    """Nodes in (0, 1) and weights."""
    steps = np.arange(-NODES, NODES + 1) * SPAN / NODES
    bent = 0.5 * np.pi * np.sinh(steps)
    weights = SPAN / NODES * 0.25 * np.pi * np.cosh(steps) / np.cosh(bent) ** 2
    return 1.0 / (1.0 + np.exp(-2.0 * bent)), weights


def _inverse(x: Any) -> Any:
    """Inverse of a symmetric 3×3 or 6×6 matrix: by cofactors, and by blocks of 3."""
    ca = casadi()

    if x.shape[0] == 3:
        a, b, c, d, e, f = x[0, 0], x[0, 1], x[0, 2], x[1, 1], x[1, 2], x[2, 2]
        first = ca.vertcat(d * f - e * e, c * e - b * f, b * e - c * d)
        det = a * first[0] + b * first[1] + c * first[2]
        other = ca.vertcat(a * f - c * c, b * c - a * e, a * d - b * b)
        rows = [[first[0], first[1], first[2]], [first[1], other[0], other[1]], [first[2], other[1], other[2]]]
        return ca.vertcat(*(ca.horzcat(*row) for row in rows)) / det
    top, side, bottom = x[:3, :3], x[:3, 3:], x[3:, 3:]
    inverse = _inverse(top)
    carried = ca.mtimes(inverse, side)
    corner = _inverse(bottom - ca.mtimes(side.T, carried))
    beside = -ca.mtimes(carried, corner)
    return ca.vertcat(ca.horzcat(inverse - ca.mtimes(beside, carried.T), beside), ca.horzcat(beside.T, corner))
