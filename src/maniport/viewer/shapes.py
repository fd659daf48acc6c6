"""Shapes of the page: ellipsoids, an arm as tubes and balls, a robot with its surface."""

import warnings
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from maniport.arms import Arm, ArmGroup, Surface, as_group
from maniport.errors import FileFormatError
from maniport.spd.ellipsoid import axes
from maniport.util.validation import Array
from maniport.viewer.state import Frame

SIZE = 0.25  # Length at which a semi-axis of 1 m/s per rad/s is drawn [m]
Color = tuple[int, int, int]


def quaternion(rotation: Array) -> Array:
    """Rotation matrices (..., 3, 3) as unit quaternions (w, x, y, z), shape (..., 4)."""
    return np.asarray(Rotation.from_matrix(rotation).as_quat(scalar_first=True))


def roll_pitch_yaw(rotation: Array) -> Array:
    """Roll, pitch and yaw of a rotation about fixed axes, as in URDF, shape (3,) [degrees]."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # at a pitch of ±90° one of the other two is arbitrary
        return np.asarray(Rotation.from_matrix(rotation).as_euler("xyz", degrees=True))


def from_roll_pitch_yaw(degrees: Array) -> Array:
    """Rotation matrix of roll, pitch and yaw about fixed axes [degrees]."""
    return np.asarray(Rotation.from_euler("xyz", degrees, degrees=True).as_matrix())


def shell(ellipsoid: Array) -> tuple[tuple[float, float, float], Array]:
    """Semi-axes [m] to scale a unit ball with, and the quaternion to turn it with, for an ellipsoid (3, 3)."""
    lengths, directions = axes(ellipsoid)
    right_handed = directions * np.array([1.0, 1.0, np.sign(np.linalg.det(directions))])
    a, b, c = np.maximum(SIZE * lengths, 1e-3).tolist()  # a flat ellipsoid can still be seen
    return (a, b, c), quaternion(right_handed)


def rings(corners: int = 64) -> Array:
    """Three great circles of the unit ball in its planes of symmetry, as lines.

    They are a trace larger: browsers draw balls with flat facets, in which the lines would sink.
    """
    angle = np.linspace(0.0, 2.0 * np.pi, corners + 1)
    circle = 1.004 * np.stack([np.cos(angle), np.sin(angle), np.zeros_like(angle)], axis=1)
    closed = np.stack([np.roll(circle, shift, axis=1) for shift in range(3)])
    return np.stack([closed[:, :-1], closed[:, 1:]], axis=2).reshape(-1, 2, 3)


def bones(skeleton: Array) -> tuple[Array, Array, Array]:
    """Quaternions (k − 1, 4) that turn z along the lines of a polyline (k, 3), their starts and their lengths."""
    edges = np.diff(skeleton, axis=0)
    lengths = np.maximum(np.linalg.norm(edges, axis=1), 1e-6)
    # half-way between z and the direction lies the axis of half a turn that takes the one to the other
    half = edges / lengths[:, None] + [0.0, 0.0, 1.0]
    half[np.linalg.norm(half, axis=1) < 1e-6] = [1.0, 0.0, 0.0]
    half /= np.linalg.norm(half, axis=1, keepdims=True)
    return np.concatenate([np.zeros((len(half), 1)), half], axis=1), skeleton[:-1], lengths


class Skeleton:
    """A polyline of an arm as tubes and balls."""

    def __init__(self, scene: Any, name: str, skeleton: Array, radius: float, color: Color):
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


def find_surfaces(robot: Arm | ArmGroup) -> tuple[list[tuple[Surface, ...]], str]:
    """Surfaces of each arm, or none and the reason in one line; those of a shared trunk are the left arm's."""
    arms = as_group(robot).arms
    none: list[tuple[Surface, ...]] = [() for _ in arms]
    try:
        found = [arm.surfaces() for arm in arms]
    except FileFormatError as error:
        return none, " ".join(str(error).split())
    for arm, surfaces in zip(arms, found, strict=True):
        if not surfaces:
            return none, f"the description of {arm.name} names no shapes"
    if isinstance(robot, ArmGroup):
        shared = [surface for surface in found[0] if surface.joint <= robot.common[0, 1]]
        found[1] = tuple(surface for surface in found[1] if not any(_same(surface, other) for other in shared))
    return found, ""


def _same(surface: Surface, other: Surface, tolerance: float = 0.01) -> bool:
    """Whether two surfaces are of one joint and have the same bounds [m]; they may be thinned differently."""
    bounds = [np.stack([one.points.min(axis=0), one.points.max(axis=0)]) for one in (surface, other)]
    return surface.joint == other.joint and bool(np.abs(bounds[0] - bounds[1]).max() < tolerance)


class RobotBody:
    """A robot's surface, or its skeleton where it has none; saturated joints glow."""

    def __init__(
        self, scene: Any, name: str, surfaces: tuple[Surface, ...], frame: Frame, joints: tuple[str, ...] = ()
    ):
        self._joints = np.array([surface.joint for surface in surfaces], dtype=int)
        look = {"color": (203, 206, 211), "flat_shading": False, "side": "double"}
        self._meshes = [
            scene.add_mesh_simple(f"{name}/surface/{one.joint}", one.points.astype(np.float32), one.triangles, **look)
            for one in surfaces
        ]
        self._skeleton = None
        if not surfaces:
            self._skeleton = Skeleton(scene, f"{name}/skeleton", frame.student_skeleton, 0.042, (120, 124, 132))
        glow = {"radius": 0.1, "color": (230, 60, 120), "opacity": 0.5, "cast_shadow": False}
        self._glows = {
            joint: (scene.add_icosphere(f"{name}/limits/{i}", **glow), i + 1) for i, joint in enumerate(joints)
        }
        self.draw(frame)

    def draw(self, frame: Frame) -> None:
        """Draw a frame."""
        for joint, (ball, link) in self._glows.items():
            ball.visible = joint in frame.at_limit
            if ball.visible:
                ball.position = frame.student_links[link, :3, 3]
        if self._skeleton is not None:
            self._skeleton.draw(frame.student_skeleton)
        poses = frame.student_links[self._joints]
        for mesh, turn, pose in zip(self._meshes, quaternion(poses[:, :3, :3]), poses, strict=True):
            mesh.wxyz, mesh.position = turn, pose[:3, 3]


class Shell:
    """An ellipsoid at a hand; with rings along its principal sections it is visible around another one, too."""

    def __init__(self, scene: Any, name: str, color: Color, opacity: float, ringed: bool = False):
        ball = scene.add_icosphere(
            name, 1.0, color, subdivisions=4, opacity=opacity, cast_shadow=False, receive_shadow=False
        )
        self._parts = [ball]
        if ringed:
            segments = rings().astype(np.float32)
            lines = scene.add_line_segments(f"{name}_rings", segments, color, thickness=2.5, thickness_units="screen")
            self._parts.append(lines)

    def draw(self, ellipsoid: Array, position: Array) -> None:
        """Take the shape of an ellipsoid (3, 3) about a position (3,) [m]."""
        scale, turn = shell(ellipsoid)
        for part in self._parts:
            part.scale, part.wxyz, part.position = scale, turn, position
