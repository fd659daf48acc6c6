"""Configurations of a robot with their kinematics, which all costs of a motion share."""

from maniport.arms import Arm, ArmGroup, EllipsoidSpec
from maniport.util.validation import Array


class Configurations:
    """Configurations of an arm or a group; kinematics are computed when a cost first needs them.

    Attributes
    ----------
    robot : Arm or ArmGroup
    joint_positions : ndarray, shape (n, dof)
        [rad or m]
    time : ndarray, shape (n,)
        Time of each configuration in the demonstration [s].
    """

    def __init__(self, robot: Arm | ArmGroup, joint_positions: Array, time: Array):
        self.robot = robot
        self.joint_positions = joint_positions
        self.time = time
        self._poses: Array | None = None
        self._jacobians: Array | None = None
        self._ellipsoids: dict[EllipsoidSpec, Array] = {}
        self._derivatives: dict[EllipsoidSpec, Array] = {}

    def __len__(self) -> int:
        return len(self.joint_positions)

    @property
    def poses(self) -> Array:
        """Poses of the end effector, shape (n, 4, 4); of a group those of all arms, (n, arms, 4, 4)."""
        if self._poses is None:
            self._poses = self.robot.forward(self.joint_positions)
        return self._poses

    @property
    def jacobians(self) -> Array:
        """Jacobians of the end effector, shape (n, 6, dof); of a group (n, arms, 6, dof)."""
        if self._jacobians is None:
            if isinstance(self.robot, Arm):
                self._poses, self._jacobians = self.robot.motion(self.joint_positions)
            else:
                self._jacobians = self.robot.jacobian(self.joint_positions)
        return self._jacobians

    def ellipsoids(self, spec: EllipsoidSpec) -> Array:
        """Return the ellipsoids of an arm, shape (n, d, d)."""
        if spec not in self._ellipsoids:
            assert isinstance(self.robot, Arm)
            self._poses, ellipsoids = self.robot.posed_ellipsoids(self.joint_positions, spec)
            self._ellipsoids[spec] = ellipsoids
        return self._ellipsoids[spec]

    def ellipsoid_derivatives(self, spec: EllipsoidSpec) -> Array:
        """Return the derivatives of an arm's ellipsoids along each joint, shape (n, dof, d, d)."""
        if spec not in self._derivatives:
            assert isinstance(self.robot, Arm)
            differentials = self.robot.posed_differentials(self.joint_positions, spec)
            self._poses, self._jacobians, ellipsoids, derivatives = differentials
            self._ellipsoids[spec] = ellipsoids
            self._derivatives[spec] = derivatives
        return self._derivatives[spec]
