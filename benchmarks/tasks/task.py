"""Motions and robots of the study, the placement of a path, and tasks: all that the methods share."""

import json
import os
from collections.abc import Iterator
from dataclasses import dataclass, fields
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from maniport.arms import Arm, load_arm
from maniport.arms.collisions import Collisions
from maniport.arms.directional import half_sphere, polytope_extent
from maniport.arms.human import myoarm
from maniport.errors import FileFormatError, InvalidInputError, collected_warnings
from maniport.mocap import ArmFit, fit_arms, read_recording
from maniport.motion.plan.roadmap import IN_PLACE, moved_to_positions
from maniport.studies.trajectories import human_arm, human_evaluation
from maniport.util.atomic_io import write_text
from maniport.util.files import require_mapping
from maniport.util.input_limits import read_whole
from maniport.util.sampling import evenly_spaced
from maniport.util.validation import Array, as_finite, as_times, require_shape

MOST_BYTES = 50_000_000  # of a file


@dataclass(frozen=True, eq=False)
class Demonstration:
    """A motion of a human arm whose base frame is the trunk."""

    name: str
    arm: Arm
    time: Array  # (n,) from 0 [s]
    joint_angles: Array  # (n, 7)


@dataclass(frozen=True)
class StudyRobot:
    """A robot of the study, with the joints at which its chain has shoulder and elbow."""

    name: str
    ready: tuple[float, ...]  # usual configuration [rad]
    elbow: int
    shoulder: int = 2


ROBOTS = {
    robot.name: robot
    for robot in (
        StudyRobot("panda", (0.0, -0.785, 0.0, -2.356, 0.0, 1.571, 0.785), 4),
        StudyRobot("xarm7", (0.0, -0.247, 0.0, 0.909, 0.0, 1.156, 0.0), 4),
        StudyRobot("ur5", (0.0, -1.571, 1.571, -1.571, -1.571, 0.0), 3),
        StudyRobot("g1_right_arm", (0.0, -0.2, 0.0, 0.0, 0.0, 0.0, 0.0), 4),
    )
}
"""Configurations of Franka's MoveIt and of MuJoCo Menagerie; the UR5 turned to the front, the G1 with bent elbow."""

HELD_OUT = {"ladder 4", "ladder 5", "left arm 2", "H-Eval-3", "reach 7", "reach 8", "g1_right_arm"}
"""Motions, and a robot, that were never used while methods were tuned."""


def demonstrations() -> Iterator[Demonstration]:
    """Yield the motions that ship with the package or that it generates."""
    shipped = {
        "freeform": ("freeform", "right"),
        "left arm": ("both-arms", "left"),
        "ladder": ("ladder", "right"),
    }
    for name, (file, side) in shipped.items():
        yield from _clips(name, _recorded(file, side))
    person = human_arm()
    for name, path in human_evaluation().items():
        path[:, 3] = np.maximum(
            path[:, 3], np.radians(5.0)
        )  # force ellipsoids of a straight arm are unbounded
        yield _demonstration(name, person, np.linspace(0.0, 5.0, len(path)), path)
    person = myoarm()
    for i in range(8):
        yield _demonstration(f"reach {i + 1}", person, *_reach(person, i))


def of_folder(folder: str | os.PathLike[str]) -> Iterator[Demonstration]:
    """Yield the clips of all BVH recordings in a folder, one after the other by name."""
    files = sorted(Path(folder).rglob("*.bvh"))
    if not files:
        raise InvalidInputError(f"recordings: {str(folder)!r} holds no file .bvh")
    for file in files:
        yield from _clips(file.stem, _recorded(file))


def _recorded(file: str | os.PathLike[str], side: str = "auto") -> ArmFit:
    """Fit an arm to a recording; differences of model and person are no matter here."""
    with collected_warnings():
        return fit_arms(read_recording(file), side=side).arms[0]


def _clips(name: str, fit: ArmFit, longest: float = 8.0) -> Iterator[Demonstration]:
    """Cut a recording into equal clips of at most `longest` [s]."""
    count = int(np.ceil((fit.time[-1] - fit.time[0]) / longest))
    for i, rows in enumerate(np.array_split(np.arange(len(fit)), count), 1):
        yield _demonstration(f"{name} {i}", fit.arm, fit.time[rows], fit.joint_angles[rows])


def _reach(arm: Arm, seed: int, duration: float = 6.0) -> tuple[Array, Array]:
    """Generate times and angles of a motion through four random configurations with minimum jerk between them."""
    generator = np.random.default_rng(1000 + seed)
    middle, half = 0.5 * (arm.upper + arm.lower), 0.5 * (arm.upper - arm.lower)
    points = middle + half * generator.uniform(-0.7, 0.7, (4, arm.dof))
    time = np.linspace(0.0, duration, 121)
    share, first = np.modf(np.minimum(3.0 * time / duration, 3.0 - 1e-9))
    blend = share**3 * (10.0 - 15.0 * share + 6.0 * share**2)
    i = first.astype(int)
    return time, points[i] + blend[:, None] * (points[i + 1] - points[i])


def _demonstration(
    name: str, arm: Arm, time: Array, joint_angles: Array, rate: float = 10.0
) -> Demonstration:
    """Resample a motion at a rate [Hz]."""
    at = np.arange(0.0, time[-1] - time[0] + 1e-9, 1.0 / rate)
    q = np.stack([np.interp(at, time - time[0], column) for column in joint_angles.T], axis=1)
    return Demonstration(name, arm, at, q)


def place(robot: StudyRobot, hand: Array, samples: Array) -> Array:
    """Place the path of a hand (n, 3) in front of a robot, without regard to ellipsoids.

    Trunk and base are parallel, the middle of the path is at the end effector of the ready configuration. The scale is
    the largest of 1, 0.9, 0.81, ... at which configurations from `samples` (m, dof) reach all of the path without
    collision.
    """
    arm, middle = load_arm(robot.name), 0.5 * (hand.min(axis=0) + hand.max(axis=0))
    collisions = Collisions.of(arm)
    center, positions = arm.forward(np.array(robot.ready))[:3, 3], arm.forward(samples)[:, :3, 3]
    for scale in 0.9 ** np.arange(30):
        path = center + scale * (hand - middle)
        rows = path[evenly_spaced(len(path), 24)]
        near = np.argsort(np.linalg.norm(positions - rows[:, None], axis=2), axis=1)[:, :40]
        q, error = moved_to_positions(arm, samples[near.ravel()], np.repeat(rows, 40, axis=0))
        usable = (error <= IN_PLACE) & ~collisions.collides(q)
        if np.all(usable.reshape(-1, 40).sum(axis=1) >= 20):
            return np.asarray(path)
    raise InvalidInputError(f"{robot.name!r} does not reach the path at any scale")


@dataclass(frozen=True, eq=False)
class Task:
    """A placed path of a robot with the capability of the person who demonstrated it.

    The capabilities are along the directions of `maniport.evaluation.half_sphere`, in the robot's base frame.
    """

    recording: str
    robot: str
    time: Array  # at which the waypoints are passed, (n,) [s]
    path: Array  # positions of the end effector in the base frame, (n, 3) [m]
    instants: NDArray[np.intp]  # waypoints at which tasks with a direction are evaluated, (m,)
    person_force: Array  # (m, 64) [N]
    person_speed: Array  # at unit joint velocities, (m, 64) [m/s]

    @classmethod
    def of(
        cls, recording: str, robot: str, time: Array, path: Array, person: Arm, joint_angles: Array
    ) -> "Task":
        """Evaluate the person's capability at the instants; trunk and base are parallel."""
        instants, u = evenly_spaced(len(time), 12), half_sphere()
        q = joint_angles[instants]
        force = polytope_extent(person, q, u, "force")
        speed = polytope_extent(person.with_limits(velocity=1.0), q, u, "velocity")
        return cls(recording, robot, time, path, instants, force, speed)

    @cached_property
    def arm(self) -> Arm:
        """The robot arm."""
        return load_arm(self.robot)

    @property
    def force_directions(self) -> Array:
        """Hidden directions, in which the person is strongest, shape (m, 3)."""
        return np.asarray(half_sphere()[self.person_force.argmax(axis=1)])

    @property
    def speed_directions(self) -> Array:
        """Hidden directions, in which the person is fastest, shape (m, 3)."""
        return np.asarray(half_sphere()[self.person_speed.argmax(axis=1)])

    @property
    def columns(self) -> list[str]:
        """Names of the columns of a file of joint positions."""
        units = zip(self.arm.joint_names, self.arm.joint_units, strict=True)
        return ["time_s", *(f"{name}_{unit}" for name, unit in units)]

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the task as JSON."""
        values = {item.name: getattr(self, item.name) for item in fields(self)}
        content = {
            key: value.tolist() if isinstance(value, np.ndarray) else value
            for key, value in values.items()
        }
        write_text(path, json.dumps(content) + "\n")

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> "Task":
        """Read a task; `FileFormatError` when a key is missing or a value is not allowed."""
        names, size = [item.name for item in fields(cls)], len(half_sphere())
        try:
            content = require_mapping(
                json.loads(read_whole(path, (".json",), MOST_BYTES)), names, str(path)
            )
            if missing := [name for name in names if name not in content]:
                raise InvalidInputError(f"missing keys: {', '.join(missing)}")
            time, instants = as_times(content["time"], fewest=4), np.asarray(content["instants"])
            arrays = {
                name: as_finite(content[name], name)
                for name in ("path", "person_force", "person_speed")
            }
            require_shape(arrays["path"], "path", (len(time), 3))
            allowed = instants.dtype.kind == "i" and instants.ndim == 1 and len(instants) > 0
            if not allowed or instants.min() < 0 or instants.max() >= len(time):
                raise InvalidInputError(
                    f"instants must be indices of waypoints, from 0 to {len(time) - 1}"
                )
            for name in ("person_force", "person_speed"):
                require_shape(arrays[name], name, (len(instants), size))
                if np.any(arrays[name] <= 0.0):
                    raise InvalidInputError(f"{name} must be above 0")
        except (ValueError, TypeError) as error:
            raise FileFormatError(f"{path} is no task: {error}") from None
        return cls(
            str(content["recording"]), str(content["robot"]), time, instants=instants, **arrays
        )
