"""Both arms of a pair as one: how the tips move against each other, and how what both hold would move.

With v_i and ω_i the velocities of the two tips, all along the axes of the common frame,

    relative   v_r = v_right − v_left,         ω_r = ω_right − ω_left,         J_r = J_right − J_left
    absolute   v_a = ½ (v_left + v_right),     ω_a = ½ (ω_left + ω_right),     J_a = ½ (J_left + J_right)

(the cooperative task space: Uchiyama & Dauchez, "A symmetric hybrid position/force control scheme for the coordination
of two robots", ICRA 1988; Chiacchio, Chiaverini & Siciliano, "Direct and inverse kinematics for coordinated motion
tasks of a two-manipulator system", Journal of Dynamic Systems, Measurement, and Control 118 (1996)). Ellipsoids are
M = J W² Jᵀ over all joints of the pair; where no joint is shared, M_r = M_left + M_right and M_a = ¼ M_r.
"""

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation

from maniport.bodies.manipulability import manipulability
from maniport.bodies.manipulable import Manipulable
from maniport.bodies.spec import VELOCITY, EllipsoidSpec
from maniport.validation import Array, as_choice

if TYPE_CHECKING:
    from maniport.bodies.arms import Arms

FACTORS: Mapping[str, tuple[float, float]] = {"relative": (-1.0, 1.0), "absolute": (0.5, 0.5)}
"""What of the left and of the right arm's Jacobian is in that of each."""


class CooperativeArm(Manipulable):
    """The relative or the absolute motion of a pair's tips, over all joints of the pair.

    It is taken where an arm is: its ellipsoids are sampled, transferred and followed alike. Get one as
    `maniport.bodies.Arms.relative` or `maniport.bodies.Arms.absolute`.

    Parameters
    ----------
    arms : Arms
    of : {"relative", "absolute"}

    Attributes
    ----------
    arms, of
        As given.
    name, dof, joint_names, lower, upper, velocity_limits, joint_units
        Those of the pair.
    frame : str
        Names of both tips.
    base, locked : str or None, mapping of str to float
        The frame in which all is expressed, and joints of both arms that are held.
    """

    def __init__(self, arms: "Arms", of: str):
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

    def __reduce__(self) -> tuple[type["CooperativeArm"], tuple["Arms", str]]:
        return type(self), (self.arms, self.of)

    def narrowed(self, lower: ArrayLike, upper: ArrayLike) -> "CooperativeArm":
        """The same with closer joint limits, shape (dof,); wider ones raise `InvalidInputError`."""
        return CooperativeArm(self.arms.narrowed(lower, upper), self.of)

    def forward(self, q: ArrayLike) -> Array:
        """Relative or absolute poses.

        Parameters
        ----------
        q : array_like, shape (..., dof)

        Returns
        -------
        ndarray, shape (..., 4, 4)
            Relative: the way from the left tip to the right one [m], along the axes of the common frame, and the right
            tip's rotation seen from the left one. Absolute: the point half-way between the tips [m], and the rotation
            half-way from the left one's to the right one's, which is not determined where they are 180° apart.
        """
        return self._pose(self.arms.forward(q))

    def jacobian(self, q: ArrayLike) -> Array:
        """J_r or J_a in all joints of the pair, shape (..., 6, dof), linear rows first, along the common axes."""
        jacobians, (left, right) = self.arms.jacobian(q), FACTORS[self.of]
        return np.asarray(left * jacobians[..., 0, :, :] + right * jacobians[..., 1, :, :])

    def posed_differentials(self, q: ArrayLike, spec: EllipsoidSpec = VELOCITY) -> tuple[Array, Array, Array, Array]:
        """What `forward` gives, and then what `differentials` does: one pass over the kinematics of each arm."""
        from maniport.bodies.manipulability_jacobian import derivatives  # here: Numba takes its time

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
