"""Tasks: the path, the time and the hidden directions that all methods share, and the files that describe them."""

import json
import os
from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from maniport.arms import Arm, load_arm
from maniport.errors import FileFormatError, InvalidInputError
from maniport.evaluation.capability import FORCE, VELOCITY, half_sphere, polytope_extent
from maniport.studies.tasks.simulation import SimulatedArm
from maniport.util.atomic_io import written_whole
from maniport.util.files import require_mapping
from maniport.util.input_limits import read_whole
from maniport.util.sampling import evenly_spaced
from maniport.util.validation import Array, as_finite, as_times, require_shape

MOST_BYTES = 50_000_000  # of a file


@dataclass(frozen=True, eq=False)
class Task:
    """A placed path of a robot with the capability of the person who demonstrated it.

    Attributes
    ----------
    recording, robot : str
        Names.
    time : ndarray, shape (n,)
        At which the waypoints are passed [s].
    path : ndarray, shape (n, 3)
        Positions of the end effector in the base frame [m].
    instants : ndarray of int, shape (m,)
        Waypoints at which the tasks with a direction are evaluated.
    person_force, person_speed : ndarray, shape (m, 64)
        Largest force [N], and speed at unit joint velocities [m/s], of the person at the instants along the directions
        of `maniport.evaluation.half_sphere`, in the robot's base frame.
    """

    recording: str
    robot: str
    time: Array
    path: Array
    instants: NDArray[np.intp]
    person_force: Array
    person_speed: Array

    @classmethod
    def of(cls, recording: str, robot: str, time: Array, path: Array, person: Arm, joint_angles: Array) -> "Task":
        """Evaluate the person's capability at the instants; trunk and base are parallel."""
        instants, u = evenly_spaced(len(time), 12), half_sphere()
        q = joint_angles[instants]
        force = polytope_extent(person, q, u, FORCE)
        speed = polytope_extent(person.with_limits(velocity=1.0), q, u, VELOCITY)
        return cls(recording, robot, time, path, instants, force, speed)

    @cached_property
    def arm(self) -> Arm:
        """The robot arm."""
        return load_arm(self.robot)

    @cached_property
    def simulated(self) -> SimulatedArm:
        """Simulation of the arm."""
        return SimulatedArm(self.arm)

    @property
    def force_directions(self) -> Array:
        """Hidden directions, in which the person is strongest, shape (m, 3)."""
        return np.asarray(half_sphere()[self.person_force.argmax(axis=1)])

    @property
    def speed_directions(self) -> Array:
        """Hidden directions, in which the person is fastest, shape (m, 3)."""
        return np.asarray(half_sphere()[self.person_speed.argmax(axis=1)])

    def slower(self, factor: float) -> "Task":
        """Return the same task with `factor` times the duration."""
        return replace(self, time=factor * self.time)

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the task as JSON."""
        values = {item.name: getattr(self, item.name) for item in fields(self)}
        content = {key: value.tolist() if isinstance(value, np.ndarray) else value for key, value in values.items()}
        with written_whole(path) as temporary:
            temporary.write_text(json.dumps(content) + "\n", encoding="utf-8")

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> "Task":
        """Read a task; `FileFormatError` when a key is missing or a value is not allowed."""
        try:
            content = json.loads(read_whole(path, (".json",), MOST_BYTES))
            names = [item.name for item in fields(cls)]
            content = require_mapping(content, names, str(path))
            if missing := [name for name in names if name not in content]:
                raise InvalidInputError(f"missing keys: {', '.join(missing)}")
            return cls._checked(content)
        except (ValueError, TypeError) as error:
            raise FileFormatError(f"{path} is no task: {error}") from None

    @classmethod
    def _checked(cls, content: dict[str, Any]) -> "Task":
        """Check the values of a file."""
        time = as_times(content["time"], fewest=4)
        path, force, speed = (as_finite(content[key], key) for key in ("path", "person_force", "person_speed"))
        require_shape(path, "path", (len(time), 3))
        instants = np.asarray(content["instants"])
        allowed = instants.dtype.kind == "i" and instants.ndim == 1 and len(instants) > 0
        if not allowed or instants.min() < 0 or instants.max() >= len(time):
            raise InvalidInputError(f"instants must be indices of waypoints, from 0 to {len(time) - 1}")
        for name, values in (("person_force", force), ("person_speed", speed)):
            require_shape(values, name, (len(instants), len(half_sphere())))
            if np.any(values <= 0.0):
                raise InvalidInputError(f"{name} must be above 0")
        return cls(str(content["recording"]), str(content["robot"]), time, path, instants, force, speed)
