"""Many postures at once whose tips are brought to their places, and turned as they shall be."""

import numpy as np

from maniport.bodies import Arm
from maniport.tracking.objective import SEARCH_WEIGHT, Targets
from maniport.validation import Array

NEWTON_STEPS, LONGEST_STEP, SINGULAR = 4, 0.3, 1e-6
IN_PLACE = 1e-4
"""How far beside its target the tip of a node may be [m]."""


def in_place(arm: Arm, q: Array, positions: Array, offset: Array, jacobian: Array) -> tuple[Array, Array]:
    """Bring tips to positions (n, 3) by Newton steps within the limits."""
    q, rows, away = q.copy(), np.arange(len(q)), np.linalg.norm(offset, axis=1)
    for _ in range(NEWTON_STEPS):
        square = jacobian @ np.swapaxes(jacobian, 1, 2)
        square += SINGULAR * np.trace(square, axis1=1, axis2=2)[:, None, None] * np.eye(3)
        step = (np.swapaxes(jacobian, 1, 2) @ np.linalg.solve(square, offset[..., None]))[..., 0]
        step *= np.minimum(1.0, LONGEST_STEP / np.maximum(np.abs(step).max(axis=1, keepdims=True), 1e-12))
        q[rows] = np.clip(q[rows] + step, arm.lower, arm.upper)
        offset = positions[rows] - arm.forward(q[rows])[:, :3, 3]
        away[rows] = np.linalg.norm(offset, axis=1)
        far = away[rows] > IN_PLACE
        if not far.any():
            break
        rows, offset = rows[far], offset[far]
        jacobian = arm.jacobian(q[rows])[:, :3]
    return q, away


def turned_about(targets: Targets, q: Array) -> Array:
    """Turn the tips at q (n, dof) as their targets have it, and bring them near their places."""
    arm, weights = targets.objective.arm, np.array(targets.objective.axis_weights)
    axes, rotations, q = np.flatnonzero(weights), targets.rotations, q.copy()
    assert rotations is not None
    for _ in range(NEWTON_STEPS):
        tips, jacobian = arm.forward(q), arm.jacobian(q)
        off, moves = [], []
        if targets.positions is not None:
            off.append(SEARCH_WEIGHT * (targets.positions - tips[:, :3, 3]))
            moves.append(SEARCH_WEIGHT * jacobian[:, :3])
        for k in axes:
            axis = tips[:, :3, k]
            off.append(weights[k] * (rotations[:, :, k] - axis))
            moves.append(-weights[k] * np.cross(axis[..., None], jacobian[:, 3:], axis=1))
        way, slope = np.concatenate(off, axis=1), np.concatenate(moves, axis=1)
        square = np.swapaxes(slope, 1, 2) @ slope + np.eye(arm.dof)  # a radian of any joint counts, too, a little
        step = np.linalg.solve(square, np.swapaxes(slope, 1, 2) @ way[..., None])[..., 0]
        step *= np.minimum(1.0, LONGEST_STEP / np.maximum(np.abs(step).max(axis=1, keepdims=True), 1e-12))
        q = np.clip(q + step, arm.lower, arm.upper)
    return q
