"""All bodies and joints of a robot: their orders in simulators, and forward kinematics of the whole robot."""

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from maniport.arms.loaders import read_model
from maniport.arms.loaders.model import RobotBody, RobotModel
from maniport.arms.loaders.packages import find_robot
from maniport.errors import InvalidInputError
from maniport.util.input_limits import ROBOT_BYTES, existing_file
from maniport.util.validation import Array

DEPTH_FIRST = "depth first"  # of MuJoCo and mjlab
BREADTH_FIRST = "breadth first"  # of Isaac Lab
ORDERS = (DEPTH_FIRST, BREADTH_FIRST)
ROBOT_SUFFIXES = (".urdf", ".xml", ".mjcf")


@dataclass(frozen=True, eq=False)
class Order:
    """An order of the bodies and joints of a robot.

    Attributes
    ----------
    name : str
        One of `ORDERS`, for reports.
    bodies, joints : tuple of str
        The root body is first.
    """

    name: str
    bodies: tuple[str, ...]
    joints: tuple[str, ...]


class WholeBody:
    """The tree of all bodies of a robot; joints that mimic others do not count.

    Parameters
    ----------
    robot : str or path
        Name of a robot, or its URDF or MJCF.
    """

    def __init__(self, robot: str | os.PathLike[str]):
        named = find_robot(os.fspath(robot)) if not os.path.isfile(robot) else None
        file = existing_file(robot if named is None else named.path, ROBOT_SUFFIXES, ROBOT_BYTES)
        self.model: RobotModel = read_model(file, () if named is None else named.folders)
        self.name = self.model.name
        self._children: dict[str, list[str]] = {name: [] for name in self.model.bodies}
        for body in self.model.bodies.values():
            if body.parent is not None:
                self._children[body.parent].append(body.name)
        world = next(iter(self.model.bodies))
        alone = self._children[world]
        # the base of an MJCF is a body of its world
        self.root = (
            alone[0] if self.model.bodies[world].name == "world" and len(alone) == 1 else world
        )

    def orders(self) -> tuple[Order, ...]:
        """Return orders that simulators use: depth and breadth first, with and without fixed bodies."""
        found: list[Order] = []
        for name in ORDERS:
            bodies = self._depth_first() if name == DEPTH_FIRST else self._breadth_first()
            moving = [
                body for body in bodies if body == self.root or self.model.bodies[body].joints
            ]
            joints = []
            for body in bodies:
                if body != self.root:
                    joints += self._joints(self.model.bodies[body])
            for chosen in (bodies, moving):
                order = Order(name, tuple(chosen), tuple(joints))
                known = [(one.bodies, one.joints) for one in found]
                if (order.bodies, order.joints) not in known:
                    found.append(order)
        return tuple(found)

    def poses(
        self, positions: Mapping[str, Array], root_positions: Array, root_rotations: Array
    ) -> dict[str, Array]:
        """Compute poses of all bodies in the world, shape (n, 4, 4) by name [m].

        Parameters
        ----------
        positions : mapping of str to ndarray, shape (n,)
            Positions of joints [rad] or [m]; others are at zero.
        root_positions : ndarray, shape (n, 3)
            Of the root body [m].
        root_rotations : ndarray, shape (n, 4)
            Its quaternions x, y, z, w.
        """
        count = len(root_positions)
        root = np.zeros((count, 4, 4))
        root[:, :3, :3] = Rotation.from_quat(root_rotations).as_matrix()
        root[:, :3, 3] = root_positions
        root[:, 3, 3] = 1.0
        poses = {self.root: root}
        for name in self._depth_first()[1:]:
            body = self.model.bodies[name]
            pose = poses[str(body.parent)]
            for joint in body.joints:
                at = self._position(joint.name, positions, count)
                pose = pose @ joint.placement @ joint.motion(at)
            poses[name] = pose @ body.placement
        return poses

    def _position(self, name: str, positions: Mapping[str, Array], count: int) -> Array:
        """Positions (n,) of a joint, which may follow another one."""
        rule = self.model.followers.get(name)
        if rule is None:
            return positions.get(name, np.zeros(count))
        if rule.leader is None:
            return np.full(count, rule.offset)
        return rule.factor * self._position(rule.leader, positions, count) + rule.offset

    def _joints(self, body: RobotBody) -> list[str]:
        return [joint.name for joint in body.joints if joint.name not in self.model.followers]

    def _depth_first(self) -> list[str]:
        found = []
        waiting = [self.root]
        while waiting:
            name = waiting.pop()
            found.append(name)
            waiting += reversed(self._children[name])
        return found

    def _breadth_first(self) -> list[str]:
        found = [self.root]
        for name in found:  # grows
            found += self._children[name]
        return found


def require_joints(joint_names: Sequence[str], body: WholeBody) -> None:
    """Require that a robot has all joints of some names."""
    known = set(body.model.bounds)
    missing = [name for name in joint_names if name not in known]
    if missing:
        raise InvalidInputError(
            f"the robot {body.name!r} has no joint {missing[0]!r}; it has {', '.join(sorted(known))}"
        )
