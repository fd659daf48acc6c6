"""Bodies in space: ellipsoids and skeletons as numbers, an arm as tubes and balls, a robot with its surface."""

from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from maniport.bodies import Arm, Arms, Surface
from maniport.errors import FileFormatError
from maniport.spd.ellipsoid import axes
from maniport.validation import Array
from maniport.view.picture import Picture

SIZE = 0.25
"""Length at which a semi-axis of 1 m/s per rad/s is drawn [m]."""
THINNEST = 1e-3
"""Semi-axes are drawn no shorter than this [m]: a flat ellipsoid is still to be seen."""

CLEAR = 1.004
"""Radius of rings about a unit ball: they shall not sink into it where a browser draws both with flat facets."""

SKELETON, SURFACE = (120, 124, 132), (203, 206, 211)
RADIUS = 0.042
"""Of the skeleton's tubes [m]."""
THINNED = 0.01
"""By so much surfaces of one link may differ, which were thinned out with others [m]."""
GLOW, GLOW_RADIUS = (255, 190, 0), 0.1
"""Of the ball about a joint that is at a limit [m]."""


def quaternion(rotation: Array) -> Array:
    """Rotation matrices (..., 3, 3) as unit quaternions (w, x, y, z), shape (..., 4)."""
    return np.asarray(Rotation.from_matrix(rotation).as_quat(scalar_first=True))


def rotation_of(wxyz: Array) -> Array:
    """Rotation matrices (..., 3, 3) of quaternions (w, x, y, z), shape (..., 4)."""
    return np.asarray(Rotation.from_quat(wxyz, scalar_first=True).as_matrix())


def roll_pitch_yaw(rotation: Array) -> Array:
    """Roll, pitch and yaw of a rotation about fixed axes, as in URDF, shape (3,) [degrees]."""
    # at a pitch of ±90° one of the other two is arbitrary, and SciPy warns; any will do here
    x, y, z = rotation[:, 0]
    pitch = np.arctan2(-z, np.hypot(x, y))
    if np.hypot(x, y) > 1e-9:
        roll, yaw = np.arctan2(rotation[2, 1], rotation[2, 2]), np.arctan2(y, x)
    else:
        roll, yaw = 0.0, np.arctan2(-rotation[0, 1], rotation[1, 1])
    return np.degrees([roll, pitch, yaw])


def from_roll_pitch_yaw(degrees: Array) -> Array:
    """Rotation matrix of roll, pitch and yaw about fixed axes [degrees]."""
    return np.asarray(Rotation.from_euler("xyz", degrees, degrees=True).as_matrix())


def shell(ellipsoid: Array) -> tuple[tuple[float, float, float], Array]:
    """Semi-axes [m] to scale a unit ball with, and the quaternion to turn it with, for an ellipsoid (3, 3)."""
    lengths, directions = axes(ellipsoid)
    right_handed = directions * np.array([1.0, 1.0, np.sign(np.linalg.det(directions))])
    a, b, c = np.maximum(SIZE * lengths, THINNEST).tolist()
    return (a, b, c), quaternion(right_handed)


def rings(corners: int = 64) -> Array:
    """Three great circles of a ball a trace larger than the unit ball, in its planes of symmetry, as lines."""
    angle = np.linspace(0.0, 2.0 * np.pi, corners + 1)
    circle = CLEAR * np.stack([np.cos(angle), np.sin(angle), np.zeros_like(angle)], axis=1)
    closed = np.stack([np.roll(circle, shift, axis=1) for shift in range(3)])
    return np.stack([closed[:, :-1], closed[:, 1:]], axis=2).reshape(-1, 2, 3)


def bones(skeleton: Array) -> tuple[Array, Array, Array]:
    """Quaternions (k − 1, 4) that turn z along the lines of a polyline (k, 3), their starts and their lengths."""
    ways = np.diff(skeleton, axis=0)
    lengths = np.linalg.norm(ways, axis=1)
    directions = np.where(lengths[:, None] > 1e-9, ways / np.maximum(lengths, 1e-9)[:, None], [0.0, 0.0, 1.0])
    # half-way between z and the direction lies the axis of half a turn that takes the one to the other
    half = directions + np.array([0.0, 0.0, 1.0])
    size = np.linalg.norm(half, axis=1, keepdims=True)
    half = np.where(size > 1e-6, half / np.maximum(size, 1e-6), [1.0, 0.0, 0.0])
    return np.concatenate([np.zeros((len(half), 1)), half], axis=1), skeleton[:-1], np.maximum(lengths, 1e-6)


class Skeleton:
    """A polyline of an arm as tubes and balls, that moves.

    Each bone is a frame with its tube and ball: only poses change, which a browser draws at once, while changed shapes
    of many parts would come a few frames late.
    """

    def __init__(self, scene: Any, name: str, skeleton: Array, radius: float, color: tuple[int, int, int]):
        turns, starts, lengths = bones(skeleton)
        self._lengths = lengths
        self._bones, self._tubes = [], []
        for i, (turn, start, length) in enumerate(zip(turns, starts, lengths.tolist(), strict=True)):
            bone = f"{name}/{i}"
            self._bones.append(scene.add_frame(bone, show_axes=False, wxyz=turn, position=start))
            middle = (0.0, 0.0, 0.5 * length)
            tube = scene.add_cylinder(f"{bone}/tube", radius, 1.0, color, scale=(1.0, 1.0, length), position=middle)
            self._tubes.append(tube)
            scene.add_icosphere(f"{bone}/ball", 1.25 * radius, color)
        self._hand = scene.add_icosphere(f"{name}/hand", 1.25 * radius, color, position=skeleton[-1])

    def draw(self, skeleton: Array) -> None:
        """Move to a new posture."""
        turns, starts, lengths = bones(skeleton)
        for bone, turn, start in zip(self._bones, turns, starts, strict=True):
            bone.wxyz, bone.position = turn, start
        self._hand.position = skeleton[-1]
        for i in np.flatnonzero(np.abs(lengths - self._lengths) > 1e-6):  # of slides only
            self._tubes[i].scale, self._tubes[i].position = (1.0, 1.0, lengths[i]), (0.0, 0.0, 0.5 * lengths[i])
            self._lengths[i] = lengths[i]


def find_surfaces(robot: Arm | Arms) -> tuple[list[tuple[Surface, ...]], str]:
    """Surfaces of each arm, or none and, in one line, why there are none; what two arms hang on is the left one's."""
    arms = robot.each if isinstance(robot, Arms) else (robot,)
    bare: list[tuple[Surface, ...]] = [() for _ in arms]
    try:
        found = [arm.surfaces() for arm in arms]
    except FileFormatError as error:
        return bare, " ".join(str(error).split())
    for arm, surfaces in zip(arms, found, strict=True):
        if not surfaces:
            return bare, f"the description of {arm.name} names no shapes"
    if isinstance(robot, Arms):
        shared = [one for one in found[0] if one.joint <= robot.trunk]
        found[1] = tuple(one for one in found[1] if not any(_same(one, other) for other in shared))
    return found, ""


def _same(one: Surface, other: Surface) -> bool:
    """Whether two surfaces are of one link: of one joint and as large in one place, thinned out differently perhaps."""
    low, high = (
        np.abs(edge(one.points, axis=0) - edge(other.points, axis=0)).max() < THINNED for edge in (np.min, np.max)
    )
    return one.joint == other.joint and bool(low and high)


class RobotBody:
    """A robot's surface and its skeleton, of which one is seen.

    Each surface is one mesh that is sent once; only poses change afterwards.

    Parameters
    ----------
    scene : viser.SceneApi
    name : str
        Of the frame in the page's space that the robot's base is at.
    surfaces : tuple of Surface
        Without any, the skeleton is seen.
    picture : Picture
        The first one.
    joints : tuple of str
        Names of all joints of the chain, in the order of the picture's links; one at its limit glows.
    """

    def __init__(
        self, scene: Any, name: str, surfaces: tuple[Surface, ...], picture: Picture, joints: tuple[str, ...] = ()
    ):
        self._joints = np.array([surface.joint for surface in surfaces], dtype=int)
        self._cover = scene.add_frame(f"{name}/surface", show_axes=False)
        self._meshes = [_add_mesh(scene, f"{name}/surface/{surface.joint}", surface) for surface in surfaces]
        self._inside = scene.add_frame(f"{name}/skeleton", show_axes=False)
        self._skeleton = Skeleton(scene, f"{name}/skeleton", picture.student_skeleton, RADIUS, SKELETON)
        self._glows = {
            joint: (
                scene.add_icosphere(f"{name}/limits/{i}", GLOW_RADIUS, GLOW, opacity=0.5, cast_shadow=False), i + 1
            )
            for i, joint in enumerate(joints)
        }  # fmt: skip
        self.draw(picture, covered=True)

    def draw(self, picture: Picture, covered: bool) -> None:
        """Take the posture of a picture, with the surface where there is one and it is asked for."""
        for joint, (ball, link) in self._glows.items():
            ball.visible = joint in picture.at_limit
            if ball.visible:
                ball.position = picture.student_links[link, :3, 3]
        shown = covered and bool(self._meshes)
        self._cover.visible, self._inside.visible = shown, not shown
        if not shown:
            self._skeleton.draw(picture.student_skeleton)
            return
        poses = picture.student_links[self._joints]
        turns = quaternion(poses[:, :3, :3])
        for mesh, turn, pose in zip(self._meshes, turns, poses, strict=True):
            mesh.wxyz, mesh.position = turn, pose[:3, 3]


def _add_mesh(scene: Any, name: str, surface: Surface) -> Any:
    points: Array = surface.points.astype(np.float32)
    return scene.add_mesh_simple(name, points, surface.triangles, color=SURFACE, flat_shading=False, side="double")
