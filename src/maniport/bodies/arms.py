"""A pair of arms: two chains in one frame, of one robot or of two, over the union of their joints."""

from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from maniport.bodies.arm import Arm
from maniport.bodies.chain import LEFT, RIGHT, Chain
from maniport.bodies.cooperative import FACTORS, CooperativeArm
from maniport.bodies.joint_space import JointSpace
from maniport.bodies.looks import Surface
from maniport.bodies.spec import VELOCITY, EllipsoidSpec
from maniport.errors import InvalidInputError, typed
from maniport.validation import Array, as_choice, as_finite, as_numbers

EACH = "each"
AGREEING = 1e-9
"""Positions of a shared joint that differ by no more are the same [rad] or [m]."""


class Arms(JointSpace):
    """Two arms as one body, left first everywhere. Make one with `maniport.load_arms`.

    Configurations `q` have shape (..., dof): the left arm's joints in their order, then those of the right one that
    it does not share with the left. Positions and directions are expressed in one frame, which both arms answer in.
    Every method raises `InvalidInputError` when `q` has a wrong shape, nan or infinity.

    Parameters
    ----------
    left, right : Arm
        Joints with which both chains begin, such as those of a torso, are shared.

    Attributes
    ----------
    left, right, each
        The arms, and both as a pair.
    dof, joint_names, lower, upper, velocity_limits, joint_units
        As those of `maniport.bodies.Arm`. Where joints of two robots have the same name, all are called ``left_…``
        and ``right_…``.
    shared : tuple of str
        Names of the joints that move both arms.
    trunk : int
        With so many joints, held ones included, both chains begin.
    columns : (ndarray of int, ndarray of int)
        Which entries of `q` are those of the left arm, and which those of the right one.
    frames : tuple of str
        Names of all frames on both chains.
    locked : mapping of str to float
        Joints that could move and are held, and where [rad] or [m].

    Raises
    ------
    InvalidInputError
        When the arms do not answer in one frame, one lies on the other, or they do not agree on what they share.

    See Also
    --------
    load_arms : reads a pair.
    Arm : one arm.
    """

    def __init__(self, left: Arm, right: Arm):
        for side, arm in ((LEFT, left), (RIGHT, right)):
            if not isinstance(arm, Arm):
                raise InvalidInputError(
                    f"{side} must be an arm, as maniport.load_arm makes it; found {type(arm).__name__}"
                )
        self.left, self.right = self.each = left, right
        self.trunk, self.shared = _shared(left.chain, right.chain)
        self.frames = tuple(dict.fromkeys((*left.frames, *right.frames)))
        own = [name for name in right.joint_names if name not in self.shared]
        prefixed = not set(own).isdisjoint(left.joint_names)
        before = [f"{side}_" * prefixed for side in (LEFT, RIGHT)]
        names = [before[0] + name for name in left.joint_names] + [before[1] + name for name in own]
        self.locked = {
            word + name: at for word, arm in zip(before, self.each, strict=True) for name, at in arm.locked.items()
        }
        new = [right.joint_names.index(name) for name in own]
        self.columns = (np.arange(left.dof), _columns(left, right, self.shared))
        speeds = [np.full(arm.dof, np.inf) if arm.velocity_limits is None else arm.velocity_limits for arm in self.each]
        super().__init__(
            left.name if left.name == right.name else f"{left.name}+{right.name}",
            tuple(names),
            np.append(left.lower, right.lower[new]),
            np.append(left.upper, right.upper[new]),
            None if np.all(np.isinf(np.concatenate(speeds))) else np.append(speeds[0], speeds[1][new]),
            (*left.joint_units, *(right.joint_units[i] for i in new)),
        )

    def __repr__(self) -> str:
        told = f"frames=({self.left.frame!r}, {self.right.frame!r}), shared={list(self.shared)}"
        return f"Arms({self.name!r}, dof={self.dof}, {told})"

    def __reduce__(self) -> tuple[type["Arms"], tuple[Arm, Arm]]:
        return type(self), self.each

    def split(self, q: ArrayLike) -> tuple[Array, Array]:
        """Configurations of the left and of the right arm, shapes (..., left.dof) and (..., right.dof)."""
        array = self.configurations(q)
        return array[..., self.columns[0]], array[..., self.columns[1]]

    def joined(self, q_left: ArrayLike, q_right: ArrayLike) -> Array:
        """Configurations of the pair, shape (..., dof), from those of its arms.

        Raises
        ------
        InvalidInputError
            When shapes do not fit, or a shared joint has another position on the right than on the left.
        """
        of_left, of_right = self.left.configurations(q_left, "q_left"), self.right.configurations(q_right, "q_right")
        if of_left.shape[:-1] != of_right.shape[:-1]:
            raise InvalidInputError(
                f"q_left and q_right must have the same leading shape; found {of_left.shape} and {of_right.shape}"
            )
        q = np.empty((*of_left.shape[:-1], self.dof))
        q[..., self.columns[1]], q[..., self.columns[0]] = of_right, of_left
        apart = np.abs(q[..., self.columns[1]] - of_right)
        if np.any(apart > AGREEING):
            worst = np.unravel_index(apart.argmax(), apart.shape)
            name = self.joint_names[self.columns[1][worst[-1]]]
            raise InvalidInputError(
                f"q_left and q_right must agree on the shared joint {name!r}; found {of_right[worst]:.6g} on the "
                f"right where the left has {q[..., self.columns[1]][worst]:.6g}"
            )
        return q

    def narrowed(self, lower: ArrayLike, upper: ArrayLike) -> "Arms":
        """The same pair with closer joint limits, shape (dof,); wider ones raise `InvalidInputError`."""
        low, high = as_numbers(lower, "lower", self.dof), as_numbers(upper, "upper", self.dof)
        arms = (arm.narrowed(low[c], high[c]) for arm, c in zip(self.each, self.columns, strict=True))
        return Arms(*arms)

    def forward(self, q: ArrayLike) -> Array:
        """Poses of both tips, left first, shape (..., 2, 4, 4) [m]."""
        return np.stack([arm.forward(part) for arm, part in zip(self.each, self.split(q), strict=True)], axis=-3)

    def jacobian(self, q: ArrayLike) -> Array:
        """Geometric Jacobians of both tips in all joints of the pair, shape (..., 2, 6, dof), linear rows first."""
        parts = self.split(q)
        jacobians = np.zeros((*parts[0].shape[:-1], 2, 6, self.dof))
        for i, (arm, part, columns) in enumerate(zip(self.each, parts, self.columns, strict=True)):
            jacobians[..., i, :, columns] = np.moveaxis(arm.jacobian(part), -1, 0)
        return jacobians

    def manipulability(
        self,
        q: ArrayLike,
        kind: str = "velocity",
        part: str = "translation",
        joint_weights: ArrayLike | str | None = None,
        of: str = EACH,
    ) -> Array:
        """Manipulability matrices of the pair.

        Parameters
        ----------
        q : array_like, shape (..., dof)
        kind, part, joint_weights
            Which ellipsoids, as in `maniport.bodies.EllipsoidSpec`; weights for all joints of the pair.
        of : {"each", "relative", "absolute"}
            Each arm's own, or those of both as one; see `maniport.bodies.cooperative`.

        Returns
        -------
        ndarray, shape (..., 2, d, d) or, of both as one, (..., d, d)
            Exactly symmetric matrices, left first.

        Raises
        ------
        InvalidInputError
            When an argument has a wrong shape or value, or the velocity limits are not known.
        NotSPDError
            When a force ellipsoid is asked for where an arm is singular.
        """
        return self.ellipsoids(q, EllipsoidSpec(kind, part, joint_weights), of)

    def ellipsoids(self, q: ArrayLike, spec: EllipsoidSpec = VELOCITY, of: str = EACH) -> Array:
        """Manipulability matrices as a specification asks for; see `manipulability`."""
        if as_choice(of, "of", (EACH, *FACTORS)) != EACH:
            return CooperativeArm(self, of).ellipsoids(q, spec)
        specs = self.specs(spec)
        found = (arm.ellipsoids(part, own) for arm, part, own in zip(self.each, self.split(q), specs, strict=True))
        return np.stack([*found], axis=-3)

    def specs(self, spec: EllipsoidSpec) -> tuple[EllipsoidSpec, EllipsoidSpec]:
        """The same ellipsoids for each arm: of joint weights, one for each joint of the pair, each has its own."""
        meant = self.resolved(spec)
        if meant.joint_weights is None:
            return meant, meant
        weights = as_finite(meant.joint_weights, "joint_weights")
        left, right = (EllipsoidSpec(meant.kind, meant.part, weights[columns]) for columns in self.columns)
        return left, right

    @cached_property
    def relative(self) -> CooperativeArm:
        """How the right tip moves against the left one, as an arm."""
        return CooperativeArm(self, "relative")

    @cached_property
    def absolute(self) -> CooperativeArm:
        """How what both tips hold would move, as an arm."""
        return CooperativeArm(self, "absolute")

    def skeleton(self, q: ArrayLike) -> tuple[Array, Array]:
        """Polylines of the arms, for drawing; see `maniport.bodies.Arm.skeleton`."""
        left, right = self.split(q)
        return self.left.skeleton(left), self.right.skeleton(right)

    def link_poses(self, q: ArrayLike) -> tuple[Array, Array]:
        """Poses of what each arm's joints move, for drawing; see `maniport.bodies.Arm.link_poses`."""
        left, right = self.split(q)
        return self.left.link_poses(left), self.right.link_poses(right)

    def surfaces(self, most_triangles: int | None = 15_000) -> tuple[tuple[Surface, ...], tuple[Surface, ...]]:
        """What each arm looks like; see `maniport.bodies.Arm.surfaces`. Shared links are drawn with both."""
        return self.left.surfaces(most_triangles), self.right.surfaces(most_triangles)


def _columns(left: Arm, right: Arm, shared: tuple[str, ...]) -> NDArray[np.intp]:
    """Where the right arm's joints are among those of the pair."""
    behind = iter(range(left.dof, left.dof + right.dof))
    return np.array([left.joint_names.index(name) if name in shared else next(behind) for name in right.joint_names])


def _shared(left: Chain, right: Chain) -> tuple[int, tuple[str, ...]]:
    """With how many joints both chains begin, and the names of the coordinates that move them."""
    if left.base != right.base:
        ends = (repr(chain.base or "the robot's base") for chain in (left, right))
        raise InvalidInputError("both arms must answer in one frame; found {} for left, {} for right".format(*ends))
    count = 0
    for ours, theirs in zip(left.joints, right.joints, strict=False):
        same = (ours.name, ours.kind) == (theirs.name, theirs.kind)
        if not same or np.any(ours.axis != theirs.axis) or np.any(ours.placement != theirs.placement):
            break
        count += 1
    if count in (len(left.joints), len(right.joints)):
        where = f", which stand in one place; place them with {two_bases()}" if left.stand is not None else ""
        raise InvalidInputError(
            f"frames: {left.frame!r} and {right.frame!r} must end two limbs; found both on one chain of "
            f"{left.name!r}{where}"
        )
    moving: list[dict[str, Array]] = [
        {name: column[:count] for name, column in zip(chain.coordinates, chain.coupling.T, strict=True)
         if np.any(column[:count])}
        for chain in (left, right)
    ]  # fmt: skip
    for i, (other, side) in enumerate(((right, RIGHT), (left, LEFT))):
        for name in moving[i].keys() - moving[1 - i].keys():
            raise InvalidInputError(
                f"the joint {name!r} carries both arms and must move or be held for both; found held at "
                f"{other.locked.get(name, 0.0):g} on the {side} alone"
            )
    _require_agreement(left, right, count, tuple(moving[0]))
    return count, tuple(moving[0])


def two_bases() -> str:
    """How two robots are placed, for messages."""
    if typed():
        return "--base-left and --base-right, such as 0 0.3 0 0 and 0 -0.3 0 0"
    return "bases=, such as ((0, 0.3, 0), (0, -0.3, 0))"


def _require_agreement(left: Chain, right: Chain, count: int, shared: tuple[str, ...]) -> None:
    """Raise unless shared joints are held and move alike."""
    for i in np.flatnonzero(left.offset[:count] != right.offset[:count]).tolist():
        raise InvalidInputError(
            f"the joint {left.joints[i].name!r} carries both arms and must be held in one place; found "
            f"{left.offset[i]:g} on the left, {right.offset[i]:g} on the right"
        )
    for name in shared:
        i, j = left.coordinates.index(name), right.coordinates.index(name)
        limits: list[Any] = [(chain.lower[k], chain.upper[k]) for chain, k in ((left, i), (right, j))]
        if limits[0] != limits[1] or np.any(left.coupling[:count, i] != right.coupling[:count, j]):
            told = " and ".join(f"{low:g} to {high:g}" for low, high in limits)
            raise InvalidInputError(
                f"the joint {name!r} carries both arms and must have one range and move both alike; found limits {told}"
            )
