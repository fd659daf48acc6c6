"""A pair of arms: two chains in one frame, of one robot or of two, over the union of their joints."""

from collections.abc import Mapping
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import Rotation

from maniport.arms.arm import Arm
from maniport.arms.chain import LEFT, RIGHT, Chain
from maniport.arms.joint_space import JointSpace, Manipulable
from maniport.arms.manipulability import VELOCITY, EllipsoidSpec, manipulability
from maniport.errors import InvalidInputError, typed
from maniport.util.validation import Array, as_choice, as_finite, as_numbers

EACH = "each"

FACTORS: Mapping[str, tuple[float, float]] = {"relative": (-1.0, 1.0), "absolute": (0.5, 0.5)}
"""What of the left and of the right arm's Jacobian is in that of each."""


class ArmGroup(JointSpace):
    """Two arms as one body, left first everywhere. Make one with `maniport.load_arms`.

    Configurations `q` have shape (..., dof): the left arm's joints in their order, then those of the right one that
    it does not share with the left. Positions and directions are expressed in one frame, which both arms answer in.

    Parameters
    ----------
    left, right : Arm
        Joints with which both chains begin, such as those of a torso, are shared.

    Attributes
    ----------
    each : (Arm, Arm)
        Both arms. Attributes not listed here are as those of `maniport.arms.Arm`; where joints of two robots have
        the same name, all are called ``left_…`` and ``right_…``.
    shared : tuple of str
        Names of the joints that move both arms.
    trunk : int
        With so many joints, held ones included, both chains begin.
    columns : (ndarray of int, ndarray of int)
        Which entries of `q` are those of the left arm, and which those of the right one.

    Raises
    ------
    InvalidInputError
        When the arms do not answer in one frame, one lies on the other, or they do not agree on what they share.
    """

    def __init__(self, left: Arm, right: Arm):
        for side, arm in ((LEFT, left), (RIGHT, right)):
            if not isinstance(arm, Arm):
                raise InvalidInputError(f"{side} must be an arm, as load_arm makes it; found {type(arm).__name__}")
        self.left, self.right = self.each = left, right
        self.trunk, self.shared = _shared(left.chain, right.chain)
        self.frames = tuple(dict.fromkeys((*left.frames, *right.frames)))
        own = [name for name in right.joint_names if name not in self.shared]
        prefixed = not set(own).isdisjoint(left.joint_names)
        before = [f"{side}_" * prefixed for side in (LEFT, RIGHT)]
        names = [before[0] + name for name in left.joint_names] + [before[1] + name for name in own]
        self.locked = {before[i] + name: at for i, arm in enumerate(self.each) for name, at in arm.locked.items()}
        new = [right.joint_names.index(name) for name in own]
        behind = iter(range(left.dof, left.dof + right.dof))
        self.columns: tuple[NDArray[np.intp], NDArray[np.intp]] = (
            np.arange(left.dof),
            np.array([left.joint_names.index(n) if n in self.shared else next(behind) for n in right.joint_names]),
        )
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
        return f"ArmGroup({self.name!r}, dof={self.dof}, {told})"

    def __reduce__(self) -> tuple[type["ArmGroup"], tuple[Arm, Arm]]:
        return type(self), self.each

    def split(self, q: ArrayLike) -> tuple[Array, Array]:
        """Configurations of the left and of the right arm, shapes (..., left.dof) and (..., right.dof)."""
        array = self.configurations(q)
        return array[..., self.columns[0]], array[..., self.columns[1]]

    def joined(self, q_left: ArrayLike, q_right: ArrayLike) -> Array:
        """Configurations of the pair, shape (..., dof), from those of its arms, which agree on shared joints."""
        of_left, of_right = self.left.configurations(q_left, "q_left"), self.right.configurations(q_right, "q_right")
        if of_left.shape[:-1] != of_right.shape[:-1]:
            found = f"{of_left.shape} and {of_right.shape}"
            raise InvalidInputError(f"q_left and q_right must have the same leading shape; found {found}")
        q = np.empty((*of_left.shape[:-1], self.dof))
        q[..., self.columns[1]], q[..., self.columns[0]] = of_right, of_left
        apart = np.abs(q[..., self.columns[1]] - of_right)
        if np.any(apart > 1e-9):
            worst = np.unravel_index(apart.argmax(), apart.shape)
            name = self.joint_names[self.columns[1][worst[-1]]]
            raise InvalidInputError(
                f"q_left and q_right must agree on the shared joint {name!r}; found {of_right[worst]:.6g} on the "
                f"right where the left has {q[..., self.columns[1]][worst]:.6g}"
            )
        return q

    def narrowed(self, lower: ArrayLike, upper: ArrayLike) -> "ArmGroup":
        """The same pair with closer joint limits, shape (dof,); wider ones raise `InvalidInputError`."""
        low, high = as_numbers(lower, "lower", self.dof), as_numbers(upper, "upper", self.dof)
        return ArmGroup(*(arm.narrowed(low[c], high[c]) for arm, c in zip(self.each, self.columns, strict=True)))

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
        """Manipulability matrices of the pair, shape (..., 2, d, d), left first, or, of both as one, (..., d, d).

        Parameters
        ----------
        q : array_like, shape (..., dof)
        kind, part, joint_weights
            Which ellipsoids, as in `maniport.arms.EllipsoidSpec`; weights for all joints of the pair.
        of : {"each", "relative", "absolute"}
            Each arm's own, or those of both as one; see `CooperativeArm`.
        """
        return self.ellipsoids(q, EllipsoidSpec(kind, part, joint_weights), of)

    def ellipsoids(self, q: ArrayLike, spec: EllipsoidSpec = VELOCITY, of: str = EACH) -> Array:
        """Manipulability matrices as a specification asks for; see `manipulability`."""
        if as_choice(of, "of", (EACH, *FACTORS)) != EACH:
            return CooperativeArm(self, of).ellipsoids(q, spec)
        own = zip(self.each, self.split(q), self.specs(spec), strict=True)
        return np.stack([arm.ellipsoids(part, meant) for arm, part, meant in own], axis=-3)

    def specs(self, spec: EllipsoidSpec) -> tuple[EllipsoidSpec, EllipsoidSpec]:
        """The same ellipsoids for each arm: of joint weights, one for each joint of the pair, each has its own."""
        meant = self.resolved(spec)
        if meant.joint_weights is None:
            return meant, meant
        weights = as_finite(meant.joint_weights, "joint_weights")
        left, right = (EllipsoidSpec(meant.kind, meant.part, weights[columns]) for columns in self.columns)
        return left, right

    @cached_property
    def relative(self) -> "CooperativeArm":
        """How the right tip moves against the left one, as an arm."""
        return CooperativeArm(self, "relative")

    @cached_property
    def absolute(self) -> "CooperativeArm":
        """How what both tips hold would move, as an arm."""
        return CooperativeArm(self, "absolute")


class CooperativeArm(Manipulable):
    """The relative or the absolute motion of a pair's tips, over all joints of the pair.

    With v_i and ω_i the velocities of the two tips, all along the axes of the common frame,

        relative   v_r = v_right − v_left,         ω_r = ω_right − ω_left,         J_r = J_right − J_left
        absolute   v_a = ½ (v_left + v_right),     ω_a = ½ (ω_left + ω_right),     J_a = ½ (J_left + J_right)

    (the cooperative task space: Uchiyama & Dauchez, ICRA 1988; Chiacchio, Chiaverini & Siciliano, J. Dyn. Syst. Meas.
    Control 118, 1996). Where no joint is shared, M_r = M_left + M_right and M_a = ¼ M_r.

    It is taken where an arm is. Get one as `maniport.arms.ArmGroup.relative` or `maniport.arms.ArmGroup.absolute`.
    """

    def __init__(self, arms: ArmGroup, of: str):
        super().__init__(arms.name, arms.joint_names, arms.lower, arms.upper, arms.velocity_limits, arms.joint_units)
        self.arms, self.of = arms, as_choice(of, "of", FACTORS)
        self.frame = f"{of}: {arms.left.frame}, {arms.right.frame}"
        self.base, self.locked = arms.left.base, arms.locked
        self._couplings = []
        for arm, columns in zip(arms.each, arms.columns, strict=True):
            coupling = np.zeros((len(arm.chain.joints), arms.dof))
            coupling[:, columns] = arm.chain.coupling
            self._couplings.append(coupling)

    def __repr__(self) -> str:
        return f"{self.arms!r}.{self.of}"

    def __reduce__(self) -> tuple[type["CooperativeArm"], tuple[ArmGroup, str]]:
        return type(self), (self.arms, self.of)

    def narrowed(self, lower: ArrayLike, upper: ArrayLike) -> "CooperativeArm":
        """The same with closer joint limits, shape (dof,); wider ones raise `InvalidInputError`."""
        return CooperativeArm(self.arms.narrowed(lower, upper), self.of)

    def forward(self, q: ArrayLike) -> Array:
        """Relative or absolute poses [m], shape (..., 4, 4).

        Relative: the vector from the left tip to the right one, along the axes of the common frame, and the right tip's
        rotation seen from the left one. Absolute: the point half-way between the tips, and the rotation half-way from
        the left one's to the right one's, which is not determined where they are 180° apart.
        """
        return self._pose(self.arms.forward(q))

    def jacobian(self, q: ArrayLike) -> Array:
        """J_r or J_a in all joints of the pair, shape (..., 6, dof), linear rows first, along the common axes."""
        jacobians, (left, right) = self.arms.jacobian(q), FACTORS[self.of]
        return np.asarray(left * jacobians[..., 0, :, :] + right * jacobians[..., 1, :, :])

    def posed_differentials(self, q: ArrayLike, spec: EllipsoidSpec = VELOCITY) -> tuple[Array, Array, Array, Array]:
        """What `forward` gives, and then what `differentials` does."""
        from maniport.arms.manipulability_jacobian import derivatives  # here: Numba takes its time

        parts, meant = self.arms.split(q), self.resolved(spec)
        shape = parts[0].shape[:-1]
        motions = [arm.motion(part) for arm, part in zip(self.arms.each, parts, strict=True)]
        chains = [
            (factor, of_joints, coupling)
            for factor, (_, of_joints), coupling in zip(FACTORS[self.of], motions, self._couplings, strict=True)
        ]
        jacobian = np.asarray(sum(factor * (of_joints @ coupling) for factor, of_joints, coupling in chains))
        changes = derivatives(chains, meant)
        poses = self._pose(np.stack([poses for poses, _ in motions], axis=-3))
        jacobian = jacobian.reshape(*shape, 6, self.dof)
        together = manipulability(jacobian, meant), changes.reshape(*shape, *changes.shape[1:])
        return poses.reshape(*shape, 4, 4), jacobian, *together

    def _pose(self, tips: Array) -> Array:
        """Relative or absolute poses, shape (..., 4, 4), of those of both tips, shape (..., 2, 4, 4)."""
        left, right = tips[..., 0, :, :], tips[..., 1, :, :]
        factors, between = FACTORS[self.of], np.swapaxes(left[..., :3, :3], -1, -2) @ right[..., :3, :3]
        poses = np.zeros(left.shape)
        poses[..., :3, 3], poses[..., 3, 3] = factors[0] * left[..., :3, 3] + factors[1] * right[..., :3, 3], 1.0
        if self.of == "absolute" and between.size:
            half = Rotation.from_rotvec(0.5 * Rotation.from_matrix(between.reshape(-1, 3, 3)).as_rotvec())
            between = left[..., :3, :3] @ half.as_matrix().reshape(between.shape)
        poses[..., :3, :3] = between
        return poses


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
    return count, _agreed(left, right, count)


def _agreed(left: Chain, right: Chain, count: int) -> tuple[str, ...]:
    """Names of the coordinates that move the joints with which both chains begin; raise unless they do so alike."""
    moving: list[dict[str, Any]] = [
        {name: (low, high, column[:count].tolist())
         for name, low, high, column in zip(chain.coordinates, chain.lower, chain.upper, chain.coupling.T, strict=True)
         if np.any(column[:count])}
        for chain in (left, right)
    ]  # fmt: skip
    for name in moving[0] | moving[1]:
        if moving[0].get(name) != moving[1].get(name):
            told = [
                "{:g} to {:g}".format(*own[name][:2]) if name in own else f"held at {chain.locked.get(name, 0.0):g}"
                for own, chain in zip(moving, (left, right), strict=True)
            ]
            raise InvalidInputError(
                f"the joint {name!r} carries both arms and must be held for both, or move alike in one range; found "
                f"{told[0]} on the left, {told[1]} on the right"
            )
    for i in np.flatnonzero(left.offset[:count] != right.offset[:count]).tolist():
        raise InvalidInputError(
            f"the joint {left.joints[i].name!r} carries both arms and must be held in one place; found "
            f"{left.offset[i]:g} on the left, {right.offset[i]:g} on the right"
        )
    return tuple(moving[0])


def two_bases() -> str:
    """How two robots are placed, for messages."""
    given = "--pose of each, such as 0,0.3,0,0 and 0,-0.3,0,0"
    return given if typed() else "bases=, such as ((0, 0.3, 0), (0, -0.3, 0))"
