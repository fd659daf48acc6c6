"""Motions as tables: the state of a simulator, and columns with their units."""

import os
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from maniport.arms import Arm, ArmGroup, EllipsoidSpec, as_group
from maniport.motion.arm_model import model_prefixes
from maniport.motion.arm_motion import ArmMotion
from maniport.motion.objective import Objective
from maniport.motion.schedule import Schedule
from maniport.motion.trajectory import Trajectory
from maniport.util.atomic_io import written_whole
from maniport.util.files import save_arrays
from maniport.util.optional import parquet_writer, pyarrow
from maniport.util.validation import Array

Columns = dict[str, tuple[Array, str]]  # Values and their unit, by name


def write_mujoco(path: str | os.PathLike[str], motion: Trajectory, robot: Arm | ArmGroup | None = None) -> None:
    """Write what `mujoco.MjData` calls qpos and qvel, and of a robot where it holds joints."""
    held = {} if robot is None else _held(robot)
    save_arrays(path, {
        "qpos": motion.control_positions,
        "qvel": motion.control_velocities,
        "joint_names": np.array(motion.joint_names),
        "timestep": np.array(np.ptp(motion.control_time) / (len(motion.control_time) - 1)),
        "held_names": np.array(list(held), dtype=str),
        "held_positions": np.array(list(held.values()), dtype=float),
    })  # fmt: skip


def _held(robot: Arm | ArmGroup) -> Mapping[str, float]:
    """Where joints are held, by name; those of two robots are called as the pair calls joints that move."""
    group = as_group(robot)
    return {
        prefix + name: value
        for prefix, arm in zip(model_prefixes(group), group.arms, strict=True)
        for name, value in arm.chain.locked.items()
    }


def write_parquet(path: str | os.PathLike[str], motion: ArmMotion, robot: Arm) -> None:
    """Write a row for each control step."""
    arrow, parquet = pyarrow(), parquet_writer()
    columns = {
        "time": (motion.control_time - motion.control_time[0], "s"),
        **_joints(motion),
        **_ellipsoids(motion, robot),
    }
    fields = [arrow.field(name, arrow.float64(), metadata={"unit": unit}) for name, (_, unit) in columns.items()]
    about = {"robot": motion.arm, "tip": motion.frame, "damping": repr(motion.damping.epsilon)}
    about |= {"kind": motion.spec.kind, "part": motion.spec.part}
    table = arrow.table(
        [arrow.array(values, from_pandas=True) for values, _ in columns.values()],  # nan becomes null
        schema=arrow.schema(fields, metadata=about),
    )
    with written_whole(path) as temporary:
        parquet.write_table(table, temporary, compression="zstd")


def _joints(motion: ArmMotion) -> Columns:
    """Positions of all joints, then velocities, then accelerations."""
    states = {
        "position": (motion.control_positions, ""),
        "velocity": (motion.control_velocities, "/s"),
        "acceleration": (motion.control_accelerations, "/s2"),
    }
    return {
        f"{name}_{what}": (values[:, k], motion.joint_units[k] + per)
        for what, (values, per) in states.items()
        for k, name in enumerate(motion.joint_names)
    }


def _ellipsoids(motion: ArmMotion, robot: Arm) -> Columns:
    """What the robot makes; what it is asked for, between the profile's times as the tracker takes it."""
    q, time, spec = motion.control_positions, motion.control_time, motion.spec
    objective = Objective.of(robot, spec, motion.damping)
    begin, end, step = motion.time[0], motion.time[-1], time[1] - time[0]
    asked = (time > begin - step) & (time < end + step)
    goal = Schedule(motion.time, motion.target, motion.path).at(objective, np.clip(time[asked], begin, end))
    targets = goal.targets(objective)
    columns = {f"tip_{axis}": (values, "m") for axis, values in zip("xyz", robot.forward(q)[:, :3, 3].T, strict=True)}
    columns |= _entries("achieved", robot.ellipsoids(q, spec), spec)
    columns |= _entries("target", _spread(goal.ellipsoids, asked), spec)
    columns["distance"] = _spread(targets.distance(q[asked]), asked), ""
    error = targets.tip_error(q[asked])
    if goal.positions is not None and error is not None:
        places = _spread(goal.positions, asked)
        columns |= {f"path_{axis}": (values, "m") for axis, values in zip("xyz", places.T, strict=True)}
        columns["tip_error"] = _spread(error, asked), "m"
    return columns


def _entries(whose: str, ellipsoids: Array, spec: EllipsoidSpec) -> Columns:
    """Entries of symmetric matrices (m, d, d) from the diagonal on, such as ``target_xy``."""
    axes = {"translation": ("x", "y", "z"), "rotation": ("rx", "ry", "rz")}
    names = axes.get(spec.part, axes["translation"] + axes["rotation"])
    unit = f"({spec.unit})²" if spec.unit else ""
    rows = zip(*np.triu_indices(len(names)), strict=True)
    return {f"{whose}_{names[i]}{names[j]}": (ellipsoids[:, i, j], unit) for i, j in rows}


def _spread(values: Array, where: NDArray[np.bool_]) -> Array:
    """Put rows where they belong among all, nan elsewhere."""
    found = np.full((len(where), *values.shape[1:]), np.nan)
    found[where] = values
    return found
