"""Motions of BeyondMimic and mjlab, ``.npz``: joints and all bodies in the world, without names.

mjlab has the order of MuJoCo, depth first, Isaac Lab another one, breadth first. A wrong order moves a hand by
centimeters and no check of the numbers alone can see that. The order is therefore named by the caller, or identified by
forward kinematics of the robot against the positions of its bodies.
"""

import os
from collections.abc import Sequence

import numpy as np
from scipy.spatial.transform import Rotation

from maniport.datasets.joint_motion import RADIANS, JointMotion, times_of
from maniport.datasets.unitree_csv import require_radians
from maniport.datasets.whole_body import Order, WholeBody, require_joints
from maniport.errors import FileFormatError, InvalidInputError, some_of
from maniport.util.files import load_arrays, save_arrays
from maniport.util.sampling import evenly_spaced
from maniport.util.validation import Array

NEEDED = ("fps", "joint_pos", "body_pos_w", "body_quat_w")
SAME_PLACE = 5e-3  # largest distance of a body of the right order [m]; files have float32
FRAMES_TO_COMPARE = 40  # that identify the order


def read_mjlab_npz(
    path: str | os.PathLike[str],
    joint_names: Sequence[str] = (),
    robot: str | os.PathLike[str] | None = None,
) -> JointMotion:
    """Read a motion.

    Parameters
    ----------
    path : str or path
    joint_names : sequence of str
        Joints in the order of ``joint_pos``.
    robot : str or path, optional
        Robot whose bodies identify the order where there are no `joint_names`. Without both the
        columns have no names.

    Raises
    ------
    FileFormatError
        When an array is missing or has a wrong shape, or no order of the robot's joints brings its
        bodies to where the file has them.
    """
    source = os.fspath(path)
    arrays = load_arrays(path, "motion")
    missing = [name for name in NEEDED if name not in arrays]
    if missing:
        raise FileFormatError(f"{source}: lacks {', '.join(missing)}; found {some_of(arrays)}")
    positions = np.asarray(arrays["joint_pos"])
    body_positions = np.asarray(arrays["body_pos_w"])
    body_rotations = np.asarray(arrays["body_quat_w"])
    count = len(positions) if positions.ndim else 0
    bodies = body_positions.shape[1] if body_positions.ndim == 3 else 0
    if (
        positions.ndim != 2
        or not bodies
        or body_positions.shape != (count, bodies, 3)
        or body_rotations.shape != (count, bodies, 4)
    ):
        raise FileFormatError(
            f"{source}: joint_pos, body_pos_w and body_quat_w must have the shapes (n, k), (n, b, 3) "
            f"and (n, b, 4); found {positions.shape}, {body_positions.shape} and "
            f"{body_rotations.shape}"
        )
    times = times_of(source, count, arrays["fps"])
    root = (body_positions[:, 0], body_rotations[:, 0][:, [1, 2, 3, 0]])
    motion = JointMotion.checked(source, positions, times, joint_names, RADIANS, root)
    if joint_names or robot is None:
        return motion

    body = WholeBody(robot)
    order = _identified(motion, np.asarray(body_positions, dtype=np.float64), body)
    named = motion.named(order.joints)
    note = f"joint order {order.name}, identified by the positions of {len(order.bodies)} bodies"
    return JointMotion(**{**vars(named), "notes": (note,)})


def _identified(motion: JointMotion, body_positions: Array, body: WholeBody) -> Order:
    """Return the order of a robot's joints and bodies that explains the positions of bodies (n, b, 3)."""
    rows = evenly_spaced(len(motion), FRAMES_TO_COMPARE)
    part = motion.select(rows)
    assert part.root_positions is not None
    assert part.root_rotations is not None
    counts = (motion.positions.shape[1], body_positions.shape[1])
    errors: list[tuple[float, Order]] = []
    for order in body.orders():
        if (len(order.joints), len(order.bodies)) != counts:
            continue
        joints = dict(zip(order.joints, part.positions.T, strict=True))
        poses = body.poses(joints, part.root_positions, part.root_rotations)
        found = np.stack([poses[name][:, :3, 3] for name in order.bodies], axis=1)
        error = float(np.linalg.norm(found - body_positions[rows], axis=-1).max())
        errors.append((error, order))
    if not errors:
        sizes = {f"{len(one.joints)} joints and {len(one.bodies)} bodies" for one in body.orders()}
        raise FileFormatError(
            f"{motion.name}: the robot {body.name!r} has {' or '.join(sorted(sizes))}; found "
            f"{counts[0]} and {counts[1]}. Name the joints in the order of the columns"
        )
    errors.sort(key=lambda pair: pair[0])
    error, order = errors[0]
    if error > SAME_PLACE:
        raise FileFormatError(
            f"{motion.name}: no order of the joints of {body.name!r} fits the positions of its "
            f"bodies: they differ by {1000.0 * error:.3g} mm or more ({order.name}). Name the joints in "
            "the order of the columns, or another robot"
        )
    others = [
        one for other, one in errors[1:] if other <= SAME_PLACE and one.joints != order.joints
    ]
    if others:
        raise FileFormatError(
            f"{motion.name}: joints move too little to tell the orders {order.name} and "
            f"{others[0].name} apart. Name the joints in the order of the columns"
        )
    return order


def write_mjlab_npz(
    path: str | os.PathLike[str], motion: JointMotion, robot: str | os.PathLike[str]
) -> None:
    """Write a motion with all bodies of a robot, in the order of MuJoCo, at the motion's own rate.

    Velocities are central differences.

    Parameters
    ----------
    path : str or path
    motion : JointMotion
        With a base, and names of all joints of the robot.
    robot : str or path
        Name of the robot, or its URDF or MJCF.

    Raises
    ------
    InvalidInputError
        When the motion has no base, joints in other units than radians, no constant rate, or not the joints of the
        robot.
    """
    if motion.root_positions is None or motion.root_rotations is None:
        raise InvalidInputError(f"{motion.name}: the file needs the motion of the base; found none")
    if not motion.columns:
        raise InvalidInputError(
            f"{motion.name}: the file needs the names of the joints; found none"
        )
    if not motion.has_constant_rate:
        raise InvalidInputError(f"{motion.name}: the file needs a constant rate")
    require_radians(motion)
    body = WholeBody(robot)
    require_joints(motion.columns, body)
    order = body.orders()[0]
    columns = dict(zip(motion.columns, motion.positions.T, strict=True))
    missing = [name for name in order.joints if name not in columns]
    if missing:
        raise InvalidInputError(
            f"{motion.name}: lacks the joints {', '.join(missing)} of {body.name!r}"
        )
    poses = body.poses(columns, motion.root_positions, motion.root_rotations)
    stacked = np.stack([poses[name] for name in order.bodies], axis=1)
    rotations = Rotation.from_matrix(stacked[..., :3, :3].reshape(-1, 3, 3))
    quaternions = rotations.as_quat().reshape(*stacked.shape[:2], 4)
    joint_positions = np.stack([columns[name] for name in order.joints], axis=1)
    step = 1.0 / motion.rate
    arrays = {
        "fps": np.array([motion.rate]),
        "joint_pos": joint_positions,
        "joint_vel": np.gradient(joint_positions, step, axis=0),
        "body_pos_w": stacked[..., :3, 3],
        "body_quat_w": quaternions[..., [3, 0, 1, 2]],
        "body_lin_vel_w": np.gradient(stacked[..., :3, 3], step, axis=0),
        "body_ang_vel_w": _angular_velocities(stacked[..., :3, :3], step),
    }
    save_arrays(path, {name: np.float32(values) for name, values in arrays.items()})


def _angular_velocities(rotations: Array, step: float) -> Array:
    """Angular velocities (n, b, 3) in the world [rad/s] of rotations (n, b, 3, 3) at steps of time [s]."""
    count = len(rotations)
    later = np.minimum(np.arange(count) + 1, count - 1)
    earlier = np.maximum(np.arange(count) - 1, 0)
    turns = rotations[later] @ np.swapaxes(rotations[earlier], -1, -2)
    vectors = (
        Rotation.from_matrix(turns.reshape(-1, 3, 3)).as_rotvec().reshape(*rotations.shape[:2], 3)
    )
    duration = step * (later - earlier)
    return np.asarray(vectors / duration[:, None, None])
