"""What a drawing of an arm needs: where its joints are, and what hangs on them."""

import numpy as np
from numpy.typing import ArrayLike

from maniport.bodies.arm_table import ShownArm
from maniport.bodies.chain import PRISMATIC, Chain
from maniport.bodies.kinematics import Kinematics
from maniport.bodies.surface import Surface, surfaces_on
from maniport.validation import Array, as_count


class DrawnArm(ShownArm):
    """An arm as a drawing sees it: skeleton, poses of its links and their surfaces."""

    def __init__(self, chain: Chain):
        self._chain = chain
        self._kinematics = Kinematics(chain)
        self._trivial = np.array_equal(chain.coupling, np.eye(len(chain.joints))) and not np.any(chain.offset)
        self._surfaces: dict[int | None, tuple[Surface, ...]] = {}
        super().__init__(chain.name, chain.coordinates, chain.lower, chain.upper, chain.velocity_limits)
        self.frame = chain.frame
        self.frames = tuple(chain.frames)

    @property
    def chain(self) -> Chain:
        """The description of the kinematics that the arm was made from."""
        return self._chain

    def skeleton(self, q: ArrayLike) -> Array:
        """Polyline from the base through the joints to the tip, for drawing; shape (..., k, 3) [m].

        Joints that always coincide appear once, so that k is the same for every configuration of an arm.
        """
        joints, tip = self._chain.joints, self._chain.frames[self.frame]
        apart = [j.name for j in joints if np.any(j.placement[:3, 3]) or j.kind == PRISMATIC]
        positions, shape = self._positions(q)
        corners = [np.zeros((len(positions), 1, 3)), self._kinematics.joint_poses(positions, apart)[..., :3, 3]]
        if np.any(tip.placement[:3, 3]) or not apart:
            corners.append(self._kinematics.point_positions(positions, [self.frame]))
        points = np.concatenate(corners, axis=1)
        return points.reshape(*shape, points.shape[1], 3)

    def link_poses(self, q: ArrayLike) -> Array:
        """Poses of what moves, for drawing: the base first, then the frame after each joint of the chain.

        The chain may have more joints than degrees of freedom; those that follow others or are locked count too.

        Parameters
        ----------
        q : array_like, shape (..., dof)
            Configurations; limits are not enforced.

        Returns
        -------
        ndarray, shape (..., joints + 1, 4, 4)
            Homogeneous transforms [m] in the base frame; the first is the identity. `Surface.joint` is an index
            into the axis of joints.

        Raises
        ------
        InvalidInputError
            When `q` has a wrong shape, nan or infinity.

        Examples
        --------
        Corners of all surfaces in the base frame at one configuration `q`:

        >>> poses = arm.link_poses(q)  # doctest: +SKIP
        >>> [s.points @ poses[s.joint, :3, :3].T + poses[s.joint, :3, 3] for s in arm.surfaces()]  # doctest: +SKIP
        """
        positions, shape = self._positions(q)
        count = len(self._chain.joints)
        poses = np.empty((len(positions), count + 1, 4, 4))
        poses[:, 0] = np.eye(4)
        poses[:, 1:] = self._kinematics.joint_poses(positions, [joint.name for joint in self._chain.joints])
        return poses.reshape(*shape, count + 1, 4, 4)

    def surfaces(self, most_triangles: int | None = 15_000) -> tuple[Surface, ...]:
        """What the arm looks like: triangles fixed to its joints.

        The robot's file is read again, with the meshes it names, on the first call; the answer is remembered. What
        the chain's joints carry is drawn, but nothing that is attached beyond the tip: with the tip at a flange the
        hand on it is left out, with the tip at the hand it is there. Fingers that move by themselves are left out.

        Parameters
        ----------
        most_triangles : int or None
            The largest number of triangles of the whole arm, at least 200; meshes with more are simplified. None
            keeps all of them.

        Returns
        -------
        tuple of Surface
            One for each joint index that carries something, ascending; empty for an arm whose description names no
            shapes, such as one from Denavit-Hartenberg parameters or a human arm.

        Raises
        ------
        FileFormatError
            When the robot's file or a mesh is missing or cannot be read; the message says which, and where it was
            looked for.
        InvalidInputError
            When `most_triangles` is no whole number, or smaller than 200.
        """
        most = None if most_triangles is None else as_count(most_triangles, "most_triangles", minimum=200)
        if self._chain.shapes is None:
            return ()
        if most not in self._surfaces:
            from maniport.bodies.surface_files import read_shapes  # here, since most arms are never drawn

            links = [link for link in self._chain.frames if self._chain.holds(link)]
            self._surfaces[most] = surfaces_on(self._chain, read_shapes(self._chain.shapes, links), most)
        return self._surfaces[most]

    def _positions(self, q: ArrayLike) -> tuple[Array, tuple[int, ...]]:
        """Positions of the chain's joints, shape (n, joints), and the leading shape of `q`."""
        array = self._configurations(q, "q")
        flat = array.reshape(-1, self.dof) if array.size else np.empty((0, self.dof))
        if not self._trivial:
            flat = flat @ self._chain.coupling.T + self._chain.offset
        return np.ascontiguousarray(flat), array.shape[:-1]
