"""A motion as files that controllers, players, simulators and tables take."""

import os
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

from maniport.arms import Arm, ArmGroup
from maniport.errors import InvalidInputError
from maniport.motion.arm_motion import ArmMotion
from maniport.motion.exports.messages import write_mcap, write_ros2
from maniport.motion.exports.tables import write_mujoco, write_parquet
from maniport.motion.robot_motion import RobotMotion
from maniport.motion.trajectory import Trajectory
from maniport.util.input_limits import as_path
from maniport.util.optional import mcap_writer, parquet_writer, rerun
from maniport.util.validation import as_choice

NEEDED, WELCOME = "needed", "welcome"
SCENE = "rerun"


class Format(NamedTuple):
    """What the file is called among a run's results, who writes it, and what that takes."""

    file: str
    write: Callable[..., None] | None
    """None where the file needs more than the motion: `maniport.write_results` writes it."""
    package: Callable[[], Any] | None = None  # Imports the package that it needs, or raises `MissingPackageError`
    robot: str = ""  # What the arm is to the writer: `NEEDED`, `WELCOME`, or nothing

    @property
    def ready(self) -> str:
        """The file's name, once the package is known to be there."""
        if self.package is not None:
            self.package()
        return self.file


FORMATS = {
    "ros2": Format("joints.yaml", write_ros2),
    "mcap": Format("joints.mcap", write_mcap, mcap_writer),
    "mujoco": Format("joints_mujoco.npz", write_mujoco, robot=WELCOME),
    "parquet": Format("joints.parquet", write_parquet, parquet_writer, robot=NEEDED),
    SCENE: Format("motion.rrd", None, rerun),
}
"""All formats of exports by name, on the command line and in Python."""


def export_motion(
    path: str | os.PathLike[str], motion: Trajectory | RobotMotion, format: str, robot: Arm | ArmGroup | None = None
) -> None:
    """Write the control steps of a motion, with time from 0, in a format of `FORMATS`.

    - ``"ros2"``, suffix ``.yaml``: one ``trajectory_msgs/msg/JointTrajectory`` of about 100 points a second with
      positions, velocities and accelerations, as ``ros2 topic pub`` and ``rosidl`` take it.
    - ``"mcap"``, suffix ``.mcap``: about 100 messages a second on the topic ``/joint_states``, named as in
      ``sensor_msgs/msg/JointState`` with accelerations beside, as JSON with its schema, for Foxglove and Rerun. It is
      not the binary encoding of ROS, which ``ros2 bag play`` asks for.
    - ``"mujoco"``, suffix ``.npz``: ``qpos`` and ``qvel``, shape (m, dof), at every control step, ``joint_names`` and
      ``timestep`` [s]; with the robot also where it holds joints, ``held_names`` and ``held_positions``.
    - ``"parquet"``, suffix ``.parquet``: a row for every control step with ``time``, position, velocity and
      acceleration of every joint, the tip, the entries of the achieved and the target ellipsoids, their distance with
      the motion's damping, and the tip's path and error where there is a path; the unit of each stands in the metadata
      of its column. Between the times of the profile targets are on the geodesic, as the tracker takes them; before
      and after it they are null.

    The first and the last control step are always there.

    Parameters
    ----------
    path : str or path
    motion : Trajectory, ArmMotion or RobotMotion
        Of one arm or of several; ``"parquet"`` takes that of one: ``motion.arms[0]``.
    format : {"ros2", "mcap", "mujoco", "parquet"}
        ``"rerun"`` shows a whole result: `maniport.write_results` writes it.
    robot : Arm or ArmGroup, optional
        What moves; ``"parquet"`` needs it, ``"mujoco"`` tells more with it, the others do without.

    Raises
    ------
    UnknownNameError
        When there is no such format.
    InvalidInputError
        When the file has another suffix than the format, the motion is none, or the robot is needed and missing, or has
        other joints.
    MissingPackageError
        When the format needs a package that is not there.
    OutputError
        When the file cannot be written.
    """
    found = FORMATS[as_choice(format, "format", FORMATS)]
    if found.write is None:
        raise InvalidInputError(
            f"export_motion takes only the motion; the format {format!r} shows a whole result: "
            f"maniport.write_results(result, folder, exports={format!r}) writes it"
        )
    suffix = Path(found.file).suffix
    if as_path(path).suffix != suffix:
        raise InvalidInputError(f"path must end with {suffix!r} for the format {format!r}; found {str(path)!r}")
    if isinstance(motion, RobotMotion):
        motion = motion.arms[0] if len(motion.arms) == 1 else motion.trajectory
    if not isinstance(motion, Trajectory):
        raise InvalidInputError(f"motion must be a motion, such as result.motion; found {type(motion).__name__}")
    if found.robot == NEEDED and not isinstance(motion, ArmMotion):
        raise InvalidInputError(
            f"motion must be of one arm for the format {format!r}, such as motion.arms[0]; found {motion!r}"
        )
    if robot is None and found.robot != NEEDED:
        found.write(path, motion)
        return
    names = robot.joint_names if isinstance(robot, Arm | ArmGroup) else None
    if names != motion.joint_names:
        there = f"one with the joints {list(names)}" if names is not None else "none" if robot is None else repr(robot)
        raise InvalidInputError(
            f"robot must be the arm that moves, with the joints {list(motion.joint_names)}, for the format "
            f"{format!r}; found {there}"
        )
    found.write(path, motion, *([robot] if found.robot else []))
