"""Target time series of an arm: checked, and sampled at control steps."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.interpolate import CubicSpline, make_interp_spline
from scipy.spatial.transform import Rotation, Slerp

from maniport.arms import Arm, ArmGroup, EllipsoidSpec, as_group
from maniport.arms.joint_space import JointSpace
from maniport.errors import InvalidInputError
from maniport.motion.arm_model import require_trackable
from maniport.motion.objective import Damping, Objective, Targets
from maniport.spd.affine_invariant import geodesic
from maniport.spd.kernels import congruence, roots, symmetrize
from maniport.spd.matrix_functions import apply
from maniport.util.validation import (
    Array,
    as_metres,
    as_positive_semidefinite,
    as_rotation,
    as_square,
    as_times,
    require_shape,
)


@dataclass(frozen=True)
class Schedule:
    """Targets of an arm over time, one row for each time."""

    objective: Objective
    time: Array  # (n,), increasing [s]
    ellipsoids: Array  # (n, d, d), without damping
    positions: Array | None = None  # (n, 3), of the end effector [m]
    weights: Array | None = None  # (n, m, m), of the directions of the ellipsoids' residual
    rotations: Array | None = None  # (n, 3, 3), of the end effector
    configurations: Array | None = None  # (n, dof), reference configurations [rad or m]

    def __len__(self) -> int:
        return len(self.time)

    def targets(self) -> Targets:
        """Return the targets of all times."""
        return self.objective.targets(self.ellipsoids, self.positions, self.weights, self.rotations)

    def sampled(self, rate: float) -> "Schedule":
        """Sample splines at evenly spaced times, `rate` per second, at least as many as there are times."""
        steps = max(int(np.ceil((self.time[-1] - self.time[0]) * rate - 1e-9)), len(self) - 1)
        return self.at(np.linspace(self.time[0], self.time[-1], steps + 1), smooth=True)

    def finer(self, gap: float) -> tuple["Schedule", NDArray[np.intp]]:
        """Insert at most 7 points between those more than `gap` [s] apart; also return the rows of its own points."""
        pieces = np.clip(np.ceil(np.diff(self.time) / gap - 1e-9), 1, 8).astype(np.intp)
        rows = np.concatenate([[0], np.cumsum(pieces)])
        if rows[-1] == len(self) - 1:
            return self, rows
        finer = self.at(np.interp(np.arange(rows[-1] + 1), rows, self.time))
        if self.positions is not None:
            finer = replace(finer, positions=CubicSpline(self.time, self.positions)(finer.time))
        return finer, rows

    def at(self, grid: Array, smooth: bool = False) -> "Schedule":
        """Interpolate at other times, by splines or linearly."""
        time, damped = self.time, symmetrize(self.objective.damped(self.ellipsoids))

        def between(values: Array | None, smooth: bool = False) -> Array | None:
            if values is None:
                return None
            spline = CubicSpline(time, values) if smooth else make_interp_spline(time, values, k=1)
            return np.asarray(spline(grid))

        if smooth:
            # in logarithms about the mean of the profile, where straight lines are nearly geodesics
            root, whitening = roots(apply(apply(damped, np.log).mean(axis=0), np.exp))
            logs = apply(congruence(whitening, damped), np.log)
            targets = congruence(root, apply(symmetrize(CubicSpline(time, logs)(grid)), np.exp))
        else:
            before = np.clip(np.searchsorted(time, grid, side="right") - 1, 0, len(time) - 2)
            share = (grid - time[before]) / (time[before + 1] - time[before])
            targets = geodesic(damped[before], damped[before + 1], share)
        return Schedule(
            self.objective,
            grid,
            self.objective.undamped(symmetrize(targets)),
            between(self.positions, smooth),
            between(self.weights),  # splines may be indefinite
            None
            if self.rotations is None
            else Slerp(time, Rotation.from_matrix(self.rotations))(grid).as_matrix(),
            between(self.configurations),  # splines may exceed limits
        )


def schedules_of(
    arms: Arm | ArmGroup,
    time: ArrayLike,
    spec: EllipsoidSpec,
    damping: Damping,
    position_weight: float,
    axes: tuple[float, float, float],
    arrays: Mapping[str, Any],
    reference: Array | None = None,
) -> list[Schedule]:
    """Check the targets of each arm: `arrays` are ellipsoids, positions, weights and rotations by argument name."""
    group = as_group(arms)
    columns = [of_each(value, name, arms) for name, value in arrays.items()]
    specs = (spec,) if isinstance(arms, Arm) else group.specs(spec)
    schedules = []
    for arm, own, joints, (profile, path, weights, rotations) in zip(
        group.arms, specs, group.columns, zip(*columns, strict=True), strict=True
    ):
        require_trackable(arm, own)
        objective = Objective.of(arm, own, damping, position_weight, positive=True)
        d, times = own.size, as_times(time, fewest=2)
        m = d * (d + 1) // 2
        objective.checked(profile, "profile", minimum=2)
        turns = None if rotations is None else as_square(rotations, "rotations", 3)
        if turns is not None:
            turns = np.array(
                [as_rotation(turn, f"rotations[{i}]", 3) for i, turn in enumerate(turns)]
            )
        values = {
            "profile": (as_square(profile, "profile", d), (d, d)),
            "path": (None if path is None else as_metres(path, "path"), (3,)),
            "weights": (
                None if weights is None else as_positive_semidefinite(weights, "weights", m),
                (m, m),
            ),
            "rotations": (turns, (3, 3)),
            "reference": (None if reference is None else reference[..., joints], (arm.dof,)),
        }
        for name, (array, shape) in values.items():
            if array is not None:
                require_shape(array, name, (len(times), *shape), ", one row for each time")
        # copies: results keep them, and later changes of the caller's arrays must not change them
        targets, *rest = (None if array is None else array.copy() for array, _ in values.values())
        assert targets is not None
        schedules.append(
            Schedule(replace(objective, axis_weights=axes), times.copy(), targets, *rest)
        )
    return schedules


def require_few(samples: float, most: int = 3_000_000) -> None:
    """Raise InvalidInputError when a motion has too many samples."""
    if not samples <= most:
        raise InvalidInputError(
            f"the motion takes {samples:.3g} samples, allowed are {most}: give a lower rate, or a path that the limits "
            "let pass sooner"
        )


def of_each(value: Any, name: str, arms: Arm | ArmGroup | Sequence[Arm]) -> Sequence[Any]:
    """Require one value for each of several arms, or none; the value itself is that of a single arm."""
    if isinstance(arms, Arm):
        return (value,)
    count = len(arms)
    if value is None:
        return (None,) * count
    if not hasattr(value, "__len__") or len(value) != count:
        size = f"{len(value)} of them" if hasattr(value, "__len__") else type(value).__name__
        raise InvalidInputError(
            f"{name} must be a sequence of {count}, one for each arm of the group; found {size}"
        )
    return value  # type: ignore[no-any-return]


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
