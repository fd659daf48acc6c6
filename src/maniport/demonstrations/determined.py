"""Which joints the recorded points determine, which they leave open, and which they would have beyond a limit."""

from collections.abc import Collection

import numpy as np

from maniport.bodies import Arm
from maniport.demonstrations.directions import DEVIATION, FLEXION, TURN, Directions
from maniport.demonstrations.long_paths import BLOCK, parts_of
from maniport.validation import Array

MEASUREMENT_ERROR = np.radians(1.0)
"""Error that is assumed in a direction of weight one [rad]; directions of less weight have more of it."""

PRIOR = 1.0
"""What is known of a joint without any measurement: about this much, standard deviation [rad]."""

LARGEST_ERROR = np.radians(20.0)
"""A joint whose error is larger counts as not seen in that frame [rad]."""

AT_LIMIT = 1e-3
"""A joint nearer to a limit than this counts as being at it [rad]."""

MOST_FRAMES = 0.5
"""A joint counts as determined when it is seen in more than this part of the frames."""


def expected_error(slopes: Array) -> Array:
    """Standard deviation of each joint angle [rad] when the directions have `MEASUREMENT_ERROR`."""
    values, vectors = np.linalg.eigh(np.einsum("nri,nrj->nij", slopes, slopes))
    variance = 1.0 / (np.maximum(values, 0.0) / MEASUREMENT_ERROR**2 + PRIOR**-2)
    return np.asarray(np.sqrt(np.einsum("nik,nk->ni", vectors**2, variance)))


def open_joints(arm: Arm, roles: Collection[str]) -> dict[int, str]:
    """The joints that the roles leave open in every frame, with the reason."""
    hand, axis = "hand" in roles, "wrist_axis" in roles
    names = arm.joint_names
    if hand and axis:
        return {}
    if axis:
        held = "no hand point: held at the neutral angle"
        return {DEVIATION: held, FLEXION: held}
    if hand:
        shared = f"no wrist axis: the hand's direction gives two numbers for {names[TURN]}, {names[DEVIATION]} and "
        shared += f"{names[FLEXION]}; of the angles that agree with it, those nearest to neutral were taken"
        return dict.fromkeys((TURN, DEVIATION, FLEXION), shared)
    held = "no hand point and no wrist axis: held at the neutral angle"
    return dict.fromkeys((TURN, DEVIATION, FLEXION), held)


def judge(directions: Directions, roles: Collection[str], q: Array) -> tuple[Array, tuple[str, ...], Array]:
    """Say for each joint in what part of the frames it is seen, why it is not determined, and where a limit binds."""
    arm, errors, steps = directions.arm, [], []
    for part in parts_of(len(q), BLOCK):
        values, slopes = directions.take(part).residual(q[part])
        errors.append(expected_error(slopes))
        steps.append(beyond_limits(arm, q[part], values, slopes))
    seen = np.mean(np.concatenate(errors) <= LARGEST_ERROR, axis=0)
    reasons = [""] * arm.dof
    for joint, reason in open_joints(arm, roles).items():
        seen[joint], reasons[joint] = 0.0, reason
    for joint in range(arm.dof):
        if seen[joint] <= MOST_FRAMES and not reasons[joint]:
            reasons[joint] = (
                f"the points tell it in {seen[joint]:.0%} of the frames only; elsewhere other joints can make up for "
                "it, and it is carried over smoothly"
            )
    return seen, tuple(reasons), np.concatenate(steps)


def beyond_limits(arm: Arm, q: Array, values: Array, slopes: Array) -> Array:
    """Estimate by how much each joint at a limit would exceed it in a fit without limits."""
    downhill = -np.einsum("nri,nr->ni", slopes, values)
    curvature = np.einsum("nri,nrj->nij", slopes, slopes) + (MEASUREMENT_ERROR / PRIOR) ** 2 * np.eye(arm.dof)
    step = np.linalg.solve(curvature, downhill[..., None])[..., 0]
    outward = np.where(q - arm.lower < AT_LIMIT, -1.0, np.where(arm.upper - q < AT_LIMIT, 1.0, 0.0))
    return np.where(outward * downhill > 0.0, np.maximum(outward * step, 0.0), 0.0)
