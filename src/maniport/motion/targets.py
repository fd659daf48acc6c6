"""Targets of an arm over time: what it shall do, without how much each part counts."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.interpolate import CubicSpline, make_interp_spline
from scipy.spatial.transform import Rotation, Slerp

from maniport.arms import VELOCITY, Arm, ArmGroup, EllipsoidSpec, as_group
from maniport.arms.joint_space import JointSpace
from maniport.errors import InvalidInputError
from maniport.motion.arm_model import require_trackable
from maniport.motion.directions import DirectionTarget
from maniport.spd.affine_invariant import geodesic
from maniport.spd.kernels import congruence, roots, symmetrize
from maniport.spd.matrix_functions import apply
from maniport.spd.regularization import Regularization
from maniport.util.defaults import DAMPING
from maniport.util.validation import (
    Array,
    Rows,
    as_metres,
    as_points,
    as_positive_semidefinite,
    as_rotation,
    as_square,
    as_times,
    require_shape,
)

Damping = float | Regularization | None  # How ellipsoids are damped before they are compared

HINT = "Give a damping, such as 0.01: ε I is added to target and achieved ellipsoids"

DAMPING_SAMPLES = 4096  # Ellipsoids of an arm, to which a damping is relative

MOST_PIECES = 8  # Into which the time between two waypoints is divided


@dataclass(frozen=True, eq=False)
class TargetTrajectory:
    """Ellipsoids of an arm over time and, optionally, positions and rotations of its end effector.

    Attributes
    ----------
    time : ndarray, shape (n,)
        Increasing [s].
    ellipsoids : ndarray, shape (n, d, d)
        In the base frame, without damping; positive-definite with it.
    spec : EllipsoidSpec
    damping : Regularization
        Its ε I is added to target and achieved ellipsoids before they are compared.
    positions : ndarray, shape (n, 3), optional
        Of the end effector in the base frame [m].
    rotations : ndarray, shape (n, 3, 3), optional
        Of the end effector in the base frame.
    direction_weights : ndarray, shape (n, m, m), optional
        Weights of the directions of the ellipsoids' residuals, m = d (d + 1) / 2.
    directions : tuple of DirectionTarget
        Lines along which the end effector shall be strong or fast.
    with_ellipsoids : bool
        Whether the distance to the ellipsoids costs; it is measured in any case.
    """

    time: Array
    ellipsoids: Array
    spec: EllipsoidSpec
    damping: Regularization
    positions: Array | None = None
    rotations: Array | None = None
    direction_weights: Array | None = None
    directions: tuple[DirectionTarget, ...] = ()
    with_ellipsoids: bool = True

    @classmethod
    def checked(
        cls,
        arm: Arm,
        time: ArrayLike,
        ellipsoids: ArrayLike,
        *,
        positions: ArrayLike | None = None,
        rotations: ArrayLike | None = None,
        spec: EllipsoidSpec = VELOCITY,
        damping: Damping = DAMPING,
        direction_weights: ArrayLike | None = None,
    ) -> "TargetTrajectory":
        """Check targets of an arm, n ≥ 2, and copy them; the arguments are the attributes.

        A number as damping is relative to the mean eigenvalue of the arm's ellipsoids.

        Raises
        ------
        InvalidInputError, NotSPDError
            When an argument has a wrong shape or value, an ellipsoid is asymmetric or, with the damping, not
            positive-definite, or the arm cannot follow such ellipsoids.
        """
        arm_damping = damping_of(arm, spec, damping, positive=True)  # also checks the arm
        require_trackable(arm, spec)
        checked_spec = arm.checked_spec(spec)
        return _checked_target(
            time, checked_spec, arm_damping, ellipsoids, positions, direction_weights, rotations
        )

    def __len__(self) -> int:
        return len(self.time)

    def __getitem__(self, rows: Rows) -> "TargetTrajectory":
        return replace(
            self,
            time=self.time[rows],
            ellipsoids=self.ellipsoids[rows],
            positions=_rows_of(self.positions, rows),
            rotations=_rows_of(self.rotations, rows),
            direction_weights=_rows_of(self.direction_weights, rows),
            directions=tuple(direction[rows] for direction in self.directions),
        )

    @property
    def shift(self) -> Array:
        """Matrix ε I, shape (d, d)."""
        return self.damping.epsilon * np.eye(self.spec.size)

    @property
    def damped_ellipsoids(self) -> Array:
        """Ellipsoids with ε I, shape (n, d, d)."""
        return np.asarray(self.ellipsoids + self.shift)

    @property
    def path(self) -> Array:
        """Positions, which exist, shape (n, 3) [m]."""
        assert self.positions is not None
        return self.positions

    def centered(self, center: Array, rotation: Array) -> "TargetTrajectory":
        """Return the targets with positions relative to a center (3,), then rotated (3, 3)."""
        return replace(self, positions=(self.path - center) @ rotation.T)

    def sampled(self, rate: float) -> "TargetTrajectory":
        """Sample splines at evenly spaced times, `rate` per second, at least as many as there are times."""
        steps = max(int(np.ceil((self.time[-1] - self.time[0]) * rate - 1e-9)), len(self) - 1)
        return self.at(np.linspace(self.time[0], self.time[-1], steps + 1), smooth=True)

    def refined(self, gap: float) -> tuple["TargetTrajectory", NDArray[np.intp]]:
        """Insert points between those more than `gap` [s] apart; also return the rows of the original points."""
        pieces = np.ceil(np.diff(self.time) / gap - 1e-9)
        pieces = np.clip(pieces, 1, MOST_PIECES).astype(np.intp)
        rows = np.concatenate([[0], np.cumsum(pieces)])
        if rows[-1] == len(self) - 1:
            return self, rows

        refined = self.at(np.interp(np.arange(rows[-1] + 1), rows, self.time))
        if self.positions is not None:
            positions = CubicSpline(self.time, self.positions)(refined.time)
            refined = replace(refined, positions=positions)
        return refined, rows

    def at(self, time: Array, *, smooth: bool = False) -> "TargetTrajectory":
        """Interpolate along geodesics and chords, or by splines, in the logarithms of the ellipsoids."""
        damped = symmetrize(self.damped_ellipsoids)
        if smooth:
            ellipsoids = _splined(self.time, damped, time)
        else:
            ellipsoids = _along_geodesics(self.time, damped, time)

        positions = None
        if self.positions is not None:
            if smooth:
                positions = CubicSpline(self.time, self.positions)(time)
            else:
                positions = linear(self.time, self.positions, time)
        rotations = None
        if self.rotations is not None:
            turns = Slerp(self.time, Rotation.from_matrix(self.rotations))
            rotations = turns(time).as_matrix()
        direction_weights = None
        if self.direction_weights is not None:  # splines may be indefinite
            direction_weights = linear(self.time, self.direction_weights, time)

        return replace(
            self,
            time=time,
            ellipsoids=np.asarray(symmetrize(ellipsoids) - self.shift),
            positions=positions,
            rotations=rotations,
            direction_weights=direction_weights,
            directions=tuple(each.nearest(self.time, time) for each in self.directions),
        )


def linear(time: Array, values: Array, at: Array) -> Array:
    """Interpolate values (n, ...) linearly at other times."""
    return np.asarray(make_interp_spline(time, values, k=1)(at))


def _rows_of(array: Array | None, rows: Rows) -> Array | None:
    if array is None:
        return None
    return array[rows]


def _splined(time: Array, damped: Array, at: Array) -> Array:
    """Interpolate by splines in logarithms about the mean, where straight lines are nearly geodesics."""
    mean = apply(apply(damped, np.log).mean(axis=0), np.exp)
    root, whitening = roots(mean)
    logs = apply(congruence(whitening, damped), np.log)
    between = symmetrize(CubicSpline(time, logs)(at))
    return congruence(root, apply(between, np.exp))


def _along_geodesics(time: Array, damped: Array, at: Array) -> Array:
    before = np.clip(np.searchsorted(time, at, side="right") - 1, 0, len(time) - 2)
    share = (at - time[before]) / (time[before + 1] - time[before])
    return geodesic(damped[before], damped[before + 1], share)


def as_damping(
    damping: Damping, ellipsoids: Callable[[], Array], positive: bool = False
) -> Regularization:
    """Convert to a damping whose ε [unit of M] is known."""
    regularization = damping
    if not isinstance(regularization, Regularization):
        regularization = Regularization(regularization)
    if regularization.damping is not None and regularization.epsilon == 0.0:
        return regularization.fitted(ellipsoids(), "ellipsoids")
    if positive and regularization.epsilon == 0.0:
        raise InvalidInputError(
            f"damping must be above 0, since arms pass singular configurations; found {damping!r}"
        )
    return regularization


def damping_of(
    arm: Arm, spec: EllipsoidSpec, damping: Damping, *, positive: bool = False
) -> Regularization:
    """Convert to a damping relative to the ellipsoids of an arm."""
    if not callable(getattr(arm, "ellipsoids", None)):
        raise InvalidInputError(
            f"arm must be an arm, such as maniport.load_arm('panda'); found {arm!r}"
        )
    return as_damping(
        damping, lambda: arm.ellipsoids(arm.sample(DAMPING_SAMPLES, 0), spec), positive
    )


def checked_ellipsoids(
    ellipsoids: ArrayLike,
    name: str,
    spec: EllipsoidSpec,
    damping: Regularization,
    minimum: int = 1,
) -> Array:
    """Convert target ellipsoids (n, d, d), which must be positive-definite with the damping."""
    shift = damping.epsilon * np.eye(spec.size)
    damped = np.asarray(as_square(ellipsoids, name, spec.size) + shift)
    label = name
    hint = HINT
    if damping.epsilon:
        label = f"{name} with damping"
        hint = ""
    return np.asarray(as_points(damped, label, minimum=minimum, hint=hint) - shift)


def targets_of_arms(
    robot: Arm | ArmGroup, targets: TargetTrajectory | Sequence[TargetTrajectory]
) -> list[TargetTrajectory]:
    """Check the targets of each arm of a group, or of an arm, which have the same times."""
    group = as_group(robot)
    if isinstance(targets, TargetTrajectory):
        targets = (targets,)
    if not isinstance(targets, Sequence):
        raise InvalidInputError(
            f"targets must be a TargetTrajectory for each arm; found {type(targets).__name__}"
        )
    if len(targets) != len(group):
        raise InvalidInputError(
            f"targets must be {len(group)}, one for each arm; found {len(targets)}"
        )

    checked = []
    for i, (arm, target) in enumerate(zip(group.arms, targets, strict=True)):
        if not isinstance(target, TargetTrajectory):
            raise InvalidInputError(
                f"targets[{i}] must be a TargetTrajectory; found {type(target).__name__}"
            )
        if not np.array_equal(target.time, targets[0].time):
            raise InvalidInputError(f"targets[{i}] must have the times of targets[0]")
        if (target.positions is None) != (targets[0].positions is None):
            raise InvalidInputError("positions must be of all arms or of none")
        again = TargetTrajectory.checked(
            arm,
            target.time,
            target.ellipsoids,
            positions=target.positions,
            rotations=target.rotations,
            spec=target.spec,
            damping=target.damping,
            direction_weights=target.direction_weights,
        )
        directions = tuple(each.checked(len(target)) for each in target.directions)
        again = replace(again, directions=directions, with_ellipsoids=target.with_ellipsoids)
        checked.append(again)
    return checked


def _checked_target(
    time: ArrayLike,
    spec: EllipsoidSpec,
    damping: Regularization,
    ellipsoids: ArrayLike,
    positions: ArrayLike | None,
    direction_weights: ArrayLike | None,
    rotations: ArrayLike | None,
) -> TargetTrajectory:
    """Check the arrays of one arm and copy them, because results keep them."""
    times = as_times(time, fewest=2)
    count = len(times)
    size = spec.size
    length = size * (size + 1) // 2

    checked_ellipsoids(ellipsoids, "profile", spec, damping, minimum=2)
    profile = as_square(ellipsoids, "profile", size)
    turns = None
    if rotations is not None:
        turns = as_rotations(rotations)
    path = None
    if positions is not None:
        path = as_metres(positions, "path")
    weights = None
    if direction_weights is not None:
        weights = as_positive_semidefinite(direction_weights, "weights", length)

    shapes = {
        "profile": (profile, (size, size)),
        "path": (path, (3,)),
        "weights": (weights, (length, length)),
        "rotations": (turns, (3, 3)),
    }
    for name, (array, shape) in shapes.items():
        if array is not None:
            require_shape(array, name, (count, *shape), ", one row for each time")

    return TargetTrajectory(
        time=times.copy(),
        ellipsoids=profile.copy(),
        spec=spec,
        damping=damping,
        positions=_copied(path),
        rotations=_copied(turns),
        direction_weights=_copied(weights),
    )


def as_rotations(rotations: ArrayLike) -> Array:
    """Convert to the rotations (n, 3, 3) nearest to those given, which must be rotations but for rounding."""
    nearest = []
    for i, rotation in enumerate(as_square(rotations, "rotations", 3)):
        nearest.append(as_rotation(rotation, f"rotations[{i}]", 3))
    return np.array(nearest)


def _copied(array: Array | None) -> Array | None:
    if array is None:
        return None
    return array.copy()


def require_few(samples: float, most: int = 3_000_000) -> None:
    """Raise InvalidInputError when a motion has too many samples."""
    if not samples <= most:
        raise InvalidInputError(
            f"the motion takes {samples:.3g} samples, allowed are {most}: give a lower rate, or a path that the limits "
            "let pass sooner"
        )


def as_limits(arm: JointSpace, value: ArrayLike | None, name: str) -> Array:
    """Convert to one positive limit for each joint, shape (dof,); infinite where there is none."""
    limits = np.asarray(np.inf if value is None else value, dtype=np.float64)
    if limits.shape not in ((), (arm.dof,)) or not np.all(limits > 0):
        raise InvalidInputError(
            f"{name} must be positive, one number or {arm.dof} (infinity: no limit); found {value!r}"
        )
    return np.full(arm.dof, limits)


def speed_limits(arm: JointSpace, value: ArrayLike | None) -> Array:
    """Convert to velocity limits, shape (dof,): those given, else the arm's, infinite where it knows none."""
    return as_limits(arm, arm.velocity_limits if value is None else value, "velocity_limits")
