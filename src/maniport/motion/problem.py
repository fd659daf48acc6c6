"""Motion problems: what a search, a trajectory or a control step minimizes."""

from dataclasses import dataclass, replace

import numpy as np

from maniport.arms import Arm, ArmGroup, as_group
from maniport.arms.collisions import Collisions
from maniport.motion.configurations import Configurations
from maniport.motion.costs.capability import CapabilityCost
from maniport.motion.costs.cost import Cost, NormalEquations, PositionErrorCost
from maniport.motion.costs.ellipsoid import EllipsoidCost
from maniport.motion.costs.orientation import OrientationCost
from maniport.motion.costs.position import PositionCost
from maniport.motion.motion_limits import MotionLimits
from maniport.motion.targets import TargetTrajectory
from maniport.util.validation import Array, Rows

SEARCH_WEIGHT = 50.0
"""Weight of the position error in searches of configurations [1/m]: soft, since a stiff weight makes local minima where
the position is right and the ellipsoid is not."""
FOLLOWING_WEIGHT = 200.0
"""The same of the controller: the position error stays within half a millimeter; a stiffer weight disturbs control
steps, which use first derivatives only."""
EXACT_WEIGHT = 1000.0
"""The same of the pointwise optimum, with a position error of less than 0.1 mm."""


@dataclass(frozen=True)
class CostWeights:
    """Weights of the costs of an arm beside that of its ellipsoid, which is 1."""

    position: float = SEARCH_WEIGHT  # of the position error [1/m]
    axes: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Of the angles between the axes of the end effector and their targets [1/rad]."""


@dataclass(frozen=True, eq=False)
class ArmProblem:
    """Targets of an arm and the costs of missing them, a row for each target.

    The cost of a configuration is f(q) = |r_ellipsoid|² + |r_position|² + |r_orientation|² + |r_capability|².
    """

    arm: Arm
    target: TargetTrajectory
    ellipsoid: EllipsoidCost
    position: PositionCost | None = None
    orientation: OrientationCost | None = None
    capabilities: tuple[CapabilityCost, ...] = ()

    @classmethod
    def of(
        cls, arm: Arm, target: TargetTrajectory, weights: CostWeights | None = None
    ) -> "ArmProblem":
        """Make a cost of each part of the targets that has a weight."""
        if weights is None:
            weights = CostWeights()
        position = None
        if target.positions is not None:
            position = PositionCost(target.positions, weights.position)
        orientation = None
        if target.rotations is not None and any(weights.axes):
            orientation = OrientationCost(target.rotations, weights.axes)
        capabilities = tuple(CapabilityCost(direction) for direction in target.directions)
        ellipsoid = EllipsoidCost.of(target)
        return cls(arm, target, ellipsoid, position, orientation, capabilities)

    def __len__(self) -> int:
        return len(self.target)

    def __getitem__(self, rows: Rows) -> "ArmProblem":
        return ArmProblem(
            self.arm,
            self.target[rows],
            self.ellipsoid[rows],
            None if self.position is None else self.position[rows],
            None if self.orientation is None else self.orientation[rows],
            tuple(cost[rows] for cost in self.capabilities),
        )

    @property
    def robot(self) -> Arm:
        """The arm, under the name that `MotionProblem` has for it."""
        return self.arm

    @property
    def pose_costs(self) -> list[PositionCost | OrientationCost]:
        """Costs of the pose of the end effector."""
        costs: list[PositionCost | OrientationCost] = []
        if self.position is not None:
            costs.append(self.position)
        if self.orientation is not None:
            costs.append(self.orientation)
        return costs

    @property
    def path(self) -> Array:
        """Target positions, which exist, shape (n, 3) [m]."""
        return self.target.path

    def with_position_weight(self, weight: float) -> "ArmProblem":
        """Return the problem with another weight of the position error [1/m]."""
        if self.position is None:
            return self
        return replace(self, position=self.position.with_weight(weight))

    def without_positions(self) -> "ArmProblem":
        """Return the problem with a free position of the end effector."""
        return replace(self, target=replace(self.target, positions=None), position=None)

    def without_rotations(self) -> "ArmProblem":
        """Return the problem with a free orientation of the end effector."""
        return replace(self, target=replace(self.target, rotations=None), orientation=None)

    def with_ellipsoids_only(self) -> "ArmProblem":
        """Return the problem without lines along which the end effector shall be strong or fast."""
        target = replace(self.target, directions=(), with_ellipsoids=True)
        return replace(self, target=target, capabilities=())

    def at(self, q: Array) -> Configurations:
        """Return configurations (n, dof) with their kinematics."""
        return Configurations(self.arm, q, self.target.time)

    def normal_equations(self, q: Array, at: Configurations | None = None) -> NormalEquations:
        """Return f and its derivatives at q (n, dof); `at` has its kinematics where they are known."""
        if at is None:
            at = self.at(q)
        equations = NormalEquations.zeros(*q.shape)
        if self.target.with_ellipsoids:
            self.ellipsoid.add_to(equations, at)
        for capability in self.capabilities:
            capability.add_to(equations, at)
        for cost in self.pose_costs:
            equations.add(cost, at)
        return equations

    def cost(self, q: Array) -> Array:
        """Cost f at q (n, dof), shape (n,); infinite where an ellipsoid is singular."""
        at = self.at(q)
        square = np.zeros(len(q))
        if self.target.with_ellipsoids:
            square = self.ellipsoid.square(at)
        for capability in self.capabilities:
            square += np.sum(capability.residual(at) ** 2, axis=1)
        for cost in self.pose_costs:
            square += np.sum(cost.residual(at) ** 2, axis=1)
        return square

    def distance(self, q: Array) -> Array:
        """Affine-invariant distance (n,) of target and achieved ellipsoids; infinite where those are singular."""
        return self.ellipsoid.distance(self.at(q))

    def position_error(self, q: Array) -> Array | None:
        """Position error [m], shape (n,); None without target positions."""
        if self.position is None:
            return None
        return self.position.error(self.at(q))

    def orientation_error(self, q: Array) -> Array | None:
        """Largest angle between an axis with a weight and its target [rad], shape (n,); None without targets."""
        if self.orientation is None:
            return None
        return self.orientation.error(self.at(q))


@dataclass(frozen=True, eq=False)
class MotionProblem:
    """Costs at the waypoints of a motion, one row for each, with limits and collisions."""

    time: Array  # (n,), in the demonstration [s]
    arms: tuple[ArmProblem, ...]
    limits: MotionLimits
    collisions: Collisions | None = None
    costs: tuple[Cost, ...] = ()  # further ones, over all joints
    start: Array | None = None  # a motion to start from besides others, (n, dof)

    @property
    def robot(self) -> Arm | ArmGroup:
        """The arm, or the group of arms, with the margin of the limits."""
        robot: Arm | ArmGroup = self.limits.arm
        return robot

    def __len__(self) -> int:
        return len(self.time)

    def __getitem__(self, rows: Rows) -> "MotionProblem":
        arms = tuple(arm[rows] for arm in self.arms)
        start = None if self.start is None else self.start[rows]
        return replace(self, time=self.time[rows], arms=arms, start=start)

    def with_position_weight(self, weight: float) -> "MotionProblem":
        """Return the problem with another weight of position errors [1/m]."""
        arms = tuple(arm.with_position_weight(weight) for arm in self.arms)
        costs = []
        for cost in self.costs:
            if isinstance(cost, PositionErrorCost):
                cost = cost.with_weight(weight)
            costs.append(cost)
        return replace(self, arms=arms, costs=tuple(costs))

    def normal_equations(self, q: Array) -> NormalEquations:
        """Return the sum of all costs and its derivatives at q (n, dof)."""
        if len(self.arms) == 1 and not self.costs:
            return self.arms[0].normal_equations(q)

        equations = NormalEquations.zeros(*q.shape)
        for arm, columns in zip(self.arms, as_group(self.robot).columns, strict=True):
            of_arm = arm.normal_equations(q[:, columns])
            equations.square += of_arm.distance**2
            equations.gradient[:, columns] += of_arm.gradient
            equations.hessian[:, columns[:, None], columns] += of_arm.hessian
        at = Configurations(self.robot, q, self.time)
        for cost in self.costs:
            equations.add(cost, at)
        return equations

    def position_errors(self, q: Array) -> Array | None:
        """Return all position errors [m], shape (n, number of them); None where no position has a cost."""
        errors = []
        for arm, columns in zip(self.arms, as_group(self.robot).columns, strict=True):
            error = arm.position_error(q[:, columns])
            if error is not None:
                errors.append(error)
        at = Configurations(self.robot, q, self.time)
        for cost in self.costs:
            if isinstance(cost, PositionErrorCost):
                errors.append(cost.error(at))
        if not errors:
            return None
        return np.stack(errors, axis=1)
