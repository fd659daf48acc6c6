"""A chain: the plain description of an arm's kinematics that every reader produces and `Arm` computes with.

A chain is a row of one-degree-of-freedom joints from the base to a tip. It may have more joints than degrees of
freedom: each joint's position is an affine function of the arm's coordinates, ``q_joint = coupling @ q + offset``.
That covers the shoulder girdle of the human arm, the mimic joints of robots and joints that are locked.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import Rotation

from maniport.errors import InvalidInputError, unknown_name
from maniport.validation import MAX_POSITION, Array, as_numbers

REVOLUTE, PRISMATIC = "revolute", "prismatic"
SIDES = RIGHT, LEFT = "right", "left"

UNIT = 1e-6
"""How far axes and rotations may be from unit length: files give six digits."""

Triangles = NDArray[np.int32]
Mesh = tuple[Array, Triangles]
"""Points [m], shape (n, 3), and triangles as rows of three indices of points, shape (m, 3)."""


@dataclass(frozen=True)
class Joint:
    """One joint with one degree of freedom.

    Attributes
    ----------
    name : str
        Name of the joint.
    kind : str
        ``"revolute"`` or ``"prismatic"``.
    axis : ndarray, shape (3,)
        Unit axis in the joint's own frame.
    placement : ndarray, shape (4, 4)
        Pose of the joint's frame in the frame of the joint before it (the base for the first), at position zero.
    """

    name: str
    kind: str
    axis: Array
    placement: Array

    def __post_init__(self) -> None:
        if not abs(float(np.linalg.norm(self.axis)) - 1.0) < UNIT:
            raise InvalidInputError(f"joint {self.name!r} must have an axis of finite length above 0")
        _require_rigid(self.placement, f"joint {self.name!r}")

    def motion(self, position: float) -> Array:
        """Compute the motion of the joint to a position [rad] or [m], shape (4, 4)."""
        matrix = np.eye(4)
        if self.kind == PRISMATIC:
            matrix[:3, 3] = position * self.axis
        else:
            matrix[:3, :3] = Rotation.from_rotvec(position * self.axis).as_matrix()
        return matrix


@dataclass(frozen=True)
class Frame:
    """A frame fixed to the chain after `joint` joints (0: to the base).

    Attributes
    ----------
    joint : int
        After how many joints.
    placement : ndarray, shape (4, 4)
        Pose in the frame of the last of them.
    parent : str or None
        Name of the frame that it is attached to, where that is known.
    """

    joint: int
    placement: Array
    parent: str | None = None

    def __post_init__(self) -> None:
        _require_rigid(self.placement, "a frame")


@dataclass(frozen=True, eq=False)
class Shape:
    """One piece of what a link looks like, in the link's frame; a stand-in is of what it collides with instead."""

    link: str
    mesh: Mesh
    stand_in: bool = False


@dataclass(frozen=True, eq=False)
class Body:
    """A body off the chain that is attached to it, such as a finger, a leg or the other arm.

    Attributes
    ----------
    joint : int
        It moves with the frame after so many joints of the chain (0: with the base).
    placements : ndarray, shape (k, 4, 4)
        Its poses in that frame: one where it is held at rest, several from open to closed for part of a gripper.
    group : str
        Name of the body that stands for all bodies of a finger; its own name for other bodies.
    """

    joint: int
    placements: Array
    group: str

    def moved(self, joint: int, transform: Array) -> "Body":
        """Attach the body after `joint` joints; `transform`, (4, 4), leads to that frame from the present one."""
        return replace(self, joint=joint, placements=transform @ self.placements)


@dataclass(frozen=True)
class Chain:
    """Joints from base to tip, the frames on them and the coordinates that move them.

    Attributes
    ----------
    name : str
        Name of the arm.
    joints : tuple of Joint
        From the base to the tip.
    frames : mapping of str to Frame
        The named frames on the chain.
    frame : str
        The name of the tip frame.
    coordinates : tuple of str
        Names of the degrees of freedom.
    lower, upper : ndarray, shape (dof,)
        Limits of the degrees of freedom [rad] or [m].
    coupling : ndarray, shape (len(joints), dof)
        How the joints follow the degrees of freedom.
    offset : ndarray, shape (len(joints),)
        Joint positions at zero coordinates [rad] or [m].
    velocity_limits : ndarray, shape (dof,), or None
        Largest speeds [rad/s] or [m/s]; infinite where unknown, None when none is known.
    others : mapping of str to Body, or None
        Bodies of the robot that are not on the chain. None where the robot is the chain up to its tip.
    shapes : callable or None
        Gives the shapes of links by their names, which are those of frames, and takes `load_arm`'s ``mesh_folders=``
        where there are any; None when nothing is known of them.
    base : str or None
        The frame in which everything is expressed, where that is not the first of the description.
    stand : ndarray of shape (4, 4), or None
        Where the robot's own base stands in that frame; None where it is the base.
    locked : mapping of str to float
        Coordinates that could move and are held, and where [rad] or [m].
    unlimited : tuple of str
        Turning joints whose description has no limits, so that one turn is taken.
    source : str
        What `load_arm` was asked for, a name or a path; empty for chains made otherwise.
    side : {"right", "left"} or None
        Which arm of a person it is; None for robots, and for persons whose model does not say so, which are right arms.
    """

    name: str
    joints: tuple[Joint, ...]
    frames: Mapping[str, Frame]
    frame: str
    coordinates: tuple[str, ...]
    lower: Array
    upper: Array
    coupling: Array
    offset: Array
    velocity_limits: Array | None = None
    shapes: Callable[..., Iterable[Shape]] | None = None
    others: Mapping[str, Body] | None = None
    base: str | None = None
    stand: Array | None = None
    locked: Mapping[str, float] = field(default_factory=dict)
    unlimited: tuple[str, ...] = ()
    source: str = ""
    side: str | None = None

    @property
    def units(self) -> tuple[str, ...]:
        """Unit of each degree of freedom: ``"rad"``, or ``"m"`` where it moves slides only."""
        turns = np.array([joint.kind == REVOLUTE for joint in self.joints])
        return tuple("rad" if np.any(turns & (column != 0)) else "m" for column in self.coupling.T)

    def holds(self, link: str) -> bool:
        """Whether a link is part of the arm: it is on the chain and is not attached beyond the tip."""
        name, seen = link, {self.frame}
        while name in self.frames and self.frames[name].parent is not None:
            name = str(self.frames[name].parent)
            if name in seen:
                return name != self.frame
            seen.add(name)
        return link in self.frames

    @property
    def attached(self) -> dict[str, Body]:
        """All bodies that are attached to the chain: those off the chain, and frames beyond the tip."""
        if self.others is None:
            return {}
        beyond = {name: place for name, place in self.frames.items() if not self.holds(name)}
        return {name: Body(place.joint, place.placement[None], name) for name, place in beyond.items()} | {
            **self.others
        }

    def at_rest(self) -> Array:
        """Poses of the base and of the frame after each joint, shape (joints + 1, 4, 4).

        Coordinates are at zero, or at the limit next to zero where their limits exclude zero.
        """
        positions = self.coupling @ np.clip(0.0, self.lower, self.upper) + self.offset
        poses = [np.eye(4)]
        for joint, position in zip(self.joints, positions, strict=True):
            poses.append(poses[-1] @ joint.placement @ joint.motion(float(position)))
        return np.array(poses)

    def known_frames(self, frames: Sequence[str]) -> tuple[str, ...]:
        """Require names of frames on the chain, each once."""
        names = check_names(frames, "frames")
        for name in names:
            if name not in self.frames:
                raise unknown_name("frame", name, self.frames, f"on the arm {self.name!r}")
        return names

    def narrow(self, lower: ArrayLike, upper: ArrayLike) -> "Chain":
        """Set closer limits, shape (dof,).

        Raises
        ------
        InvalidInputError
            When the shapes do not fit, or limits are wider than they were or leave nothing.
        """
        low, high = as_numbers(lower, "lower", len(self.lower)), as_numbers(upper, "upper", len(self.upper))
        wrong = (low < self.lower) | (high > self.upper) | (low > high)
        if np.any(wrong):
            i = int(wrong.argmax())
            raise InvalidInputError(
                f"joint {self.coordinates[i]!r} of {self.name!r} must have limits within {self.lower[i]:g} to "
                f"{self.upper[i]:g}; found {low[i]:g} to {high[i]:g}"
            )
        return replace(self, lower=low, upper=high)


def _require_rigid(placement: Array, what: str) -> None:
    """Raise unless a homogeneous transform turns and shifts, by what is meant to be in metres."""
    turn, shift = placement[:3, :3], placement[:3, 3]
    if not (np.abs(turn @ turn.T - np.eye(3)).max() < UNIT and np.abs(shift).max() <= MAX_POSITION):
        raise InvalidInputError(
            f"{what} must be placed by a rotation and by finite metres, within ±{MAX_POSITION:g}; "
            f"found {np.array2string(placement[:3], precision=3, separator=', ')}".replace("\n", "")
        )


def check_names(names: Sequence[str], argument: str) -> tuple[str, ...]:
    """Require at least one name, each once, and not a bare string."""
    listed = () if isinstance(names, str) or not isinstance(names, Iterable) else tuple(names)
    if not listed or not all(isinstance(name, str) for name in listed):
        raise InvalidInputError(f"{argument} must be a sequence of names, such as ('first', 'second'); found {names!r}")
    repeated = sorted({name for name in listed if listed.count(name) > 1})
    if repeated:
        raise InvalidInputError(f"{argument} must name each once; found more than once: {', '.join(repeated)}")
    return listed


def rotation_about(axis: int, angle: float) -> Array:
    """Rotation matrix about the x (0), y (1) or z (2) axis, shape (3, 3); exact at multiples of 90°."""
    cos, sin = np.cos(angle), np.sin(angle)
    quarters = angle / (np.pi / 2)
    if quarters == round(quarters):
        cos, sin = round(cos), round(sin)
    first, second = (axis + 1) % 3, (axis + 2) % 3
    matrix = np.eye(3)
    matrix[first, first] = matrix[second, second] = cos
    matrix[second, first], matrix[first, second] = sin, -sin
    return matrix


def pose(xyz: Sequence[float] = (0.0, 0.0, 0.0), rpy: Sequence[float] = (0.0, 0.0, 0.0)) -> Array:
    """Pose from a translation [m] and roll, pitch, yaw [rad] about fixed axes, as in URDF; shape (4, 4)."""
    matrix = np.eye(4)
    matrix[:3, :3] = rotation_about(2, rpy[2]) @ rotation_about(1, rpy[1]) @ rotation_about(0, rpy[0])
    matrix[:3, 3] = xyz
    return matrix
