"""The scene of the page: a person's arms, a robot, ellipsoids; and where cameras look from."""

from collections.abc import Sequence
from itertools import pairwise
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from maniport.arms import Arm, ArmGroup, Surface
from maniport.arms.human import middle_of
from maniport.report.page.animation import surfaces_of
from maniport.report.page.content import ACHIEVED, PERSON, TARGET
from maniport.spd.ellipsoid import axes
from maniport.util.validation import Array
from maniport.viewer.state import Frame

if TYPE_CHECKING:
    from viser import SceneApi

PERSON_AT = np.array(
    [0.0, -0.6, 1.4]
)  # Base frame of the person [m], to the left for a viewer in front of them
ROBOT_AT = np.array([0.0, 0.5, 0.7])
FIELD_OF_VIEW = 45.0  # Vertical [degrees]
NARROW = 0.7  # Ratio of width to height below which a window is that of a phone
PALE = (196, 201, 208)
SHORTEST = 1e-4  # Smallest length of a rod, and change of it, that can be seen [m]
SIZE = 0.25  # Length at which a semi-axis of 1 m/s per rad/s is drawn [m]

Color = tuple[int, int, int]


def camera_for(aspect: float, arms: int = 1) -> tuple[Array, Array]:
    """Where to look from and to, so that person and robot are in a view of that width over height [m].

    On phones the folded controls cover the lowest part: the scene is moved up by 10 % of the height.
    """
    height = 2.4
    width = 2.9
    if arms > 1:
        height = 2.6
        width = 5.0
    height = max(height, width / max(aspect, 0.2))
    distance = height / (2.0 * np.tan(np.radians(0.5 * FIELD_OF_VIEW)))
    to = np.array([0.0, -0.05, 1.15])
    if aspect < NARROW:
        to[2] -= 0.1 * height
    return to + distance * np.array([0.97, 0.0, 0.24]), to


def quaternion(rotation: Array) -> Array:
    """Rotation matrices (..., 3, 3) as unit quaternions (w, x, y, z), shape (..., 4)."""
    return np.asarray(Rotation.from_matrix(rotation).as_quat(scalar_first=True))


def shell(ellipsoid: Array) -> tuple[tuple[float, float, float], Array]:
    """Semi-axes [m] to scale a unit ball with, and the quaternion to turn it with, for an ellipsoid (3, 3)."""
    lengths, directions = axes(ellipsoid)
    right_handed = directions * np.array([1.0, 1.0, np.sign(np.linalg.det(directions))])
    a, b, c = np.maximum(SIZE * lengths, 1e-3).tolist()  # a flat ellipsoid can still be seen
    return (a, b, c), quaternion(right_handed)


class RodPose(NamedTuple):
    """Where a cylinder along z is, to connect two points."""

    length: float  # [m]
    position: Array  # (3,) of its middle [m]
    wxyz: Array  # (4,) unit quaternion


def rod_pose(start: Array, end: Array) -> RodPose:
    """Return the pose of a rod between two points (3,); of points at one place it is short and upright."""
    along = end - start
    length = float(np.linalg.norm(along))
    middle = 0.5 * (start + end)
    if length < SHORTEST:
        return RodPose(SHORTEST, middle, np.array([1.0, 0.0, 0.0, 0.0]))

    # about the cross product of z and the direction, by their angle: the sum of quaternions 1 and z · direction
    x, y, z = along / length
    wxyz = np.array([1.0 + z, -y, x, 0.0])
    if z < -1.0 + 1e-9:  # downward
        wxyz = np.array([0.0, 1.0, 0.0, 0.0])
    return RodPose(length, middle, wxyz / np.linalg.norm(wxyz))


class Skeleton:
    """A polyline (k, 3) of an arm as rods with balls at its corners.

    Rods and balls are moved by their poses: browsers show these at once, but new points of lines some frames later,
    so that the lines come off the balls of a moving arm.
    """

    def __init__(self, scene: "SceneApi", name: str, skeleton: Array, radius: float, color: Color):
        self.rods = []
        for i, (start, end) in enumerate(pairwise(skeleton)):
            pose = rod_pose(start, end)
            rod = scene.add_cylinder(
                f"{name}/rod/{i}",
                radius,
                pose.length,
                color,
                position=pose.position,
                wxyz=pose.wxyz,
            )
            self.rods.append(rod)
        look = {"radius": 1.25 * radius, "color": color}
        self._balls = []
        for i, corner in enumerate(skeleton):
            self._balls.append(scene.add_icosphere(f"{name}/{i}", position=corner, **look))

    def draw(self, skeleton: Array) -> None:
        """Move to a new configuration."""
        for rod, (start, end) in zip(self.rods, pairwise(skeleton), strict=True):
            pose = rod_pose(start, end)
            rod.position = pose.position
            rod.wxyz = pose.wxyz
            if abs(pose.length - rod.height) > SHORTEST:  # of links of prismatic joints alone
                rod.height = pose.length
        for ball, position in zip(self._balls, skeleton, strict=True):
            ball.position = position


class Shell:
    """An ellipsoid at a hand; as a wireframe it is visible around another one, too."""

    def __init__(
        self, scene: "SceneApi", name: str, color: Color, opacity: float, wireframe: bool = False
    ):
        radius = 1.0
        subdivisions = 4
        if wireframe:
            radius = 1.015  # the middles of its edges are outside of a ball
            subdivisions = 2
        self._ball = scene.add_icosphere(
            name,
            radius,
            color,
            subdivisions=subdivisions,
            wireframe=wireframe,
            opacity=opacity,
            cast_shadow=False,
            receive_shadow=False,
        )

    def draw(self, ellipsoid: Array, position: Array) -> None:
        """Take the shape of an ellipsoid (3, 3) about a position (3,) [m]."""
        self._ball.scale, self._ball.wxyz = shell(ellipsoid)
        self._ball.position = position


class Scene:
    """Everything in space: person, robot and ellipsoids of each arm; `no_surface`: why the robot is a skeleton."""

    def __init__(
        self,
        scene: "SceneApi",
        persons: Sequence[Arm],
        robot: ArmGroup,
        frames: Sequence[Frame],
        bases: Sequence[Array] = (np.zeros(3),),
    ):
        aside = np.zeros(3)
        if len(robot.arms) > 1:
            aside[1] = 0.45
        place = ROBOT_AT + aside
        scene.set_up_direction("+z")
        scene.world_axes.visible = False
        scene.add_grid(
            "/base_plane",
            8.0,
            8.0,
            cell_size=0.25,
            cell_color=(225, 228, 232),
            section_color=(190, 195, 202),
            fade_distance=9.0,
            fade_from="origin",
            position=(0.0, 0.0, ROBOT_AT[2]),
        )
        scene.add_frame("/person", show_axes=False, position=PERSON_AT - aside)
        # head and trunk about the middle of the neck [m], in the trunk frame
        middles = []
        for arm, base in zip(persons, bases, strict=True):
            middles.append(base + np.array([0.0, middle_of(arm), 0.0]))
        for name, size, at in (
            ("trunk", (0.11, 0.16, 0.30), (-0.06, 0.0, -0.30)),
            ("shoulders", (0.05, 0.20, 0.06), (-0.03, 0.0, -0.01)),
            ("neck", (0.05, 0.05, 0.12), (-0.05, 0.0, 0.03)),
            ("head", (0.095, 0.075, 0.12), (-0.02, 0.0, 0.22)),
        ):
            look = {
                "scale": size,
                "position": np.mean(middles, axis=0) + at,
                "opacity": 0.55,
                "cast_shadow": False,
            }
            scene.add_icosphere(f"/person/{name}", 1.0, PALE, **look)
        models = " and ".join(dict.fromkeys(arm.name for arm in persons))
        scene.add_label(
            "/person/name", f"person: {models}", position=(0.0, 0.15, 0.5), anchor="bottom-center"
        )
        self._base = scene.add_frame("/robot", axes_length=0.15, axes_radius=0.006, position=place)
        above = place + np.array([0.0, 0.0, 1.25])
        scene.add_label("/name", f"robot: {robot.name}", position=above, anchor="bottom-center")
        names = [""]
        if len(persons) > 1:
            names = [f"/{k}" for k in range(len(persons))]
        surfaces, self.no_surface = surfaces_of(robot.arms, [frame.joints for frame in frames])
        parts = zip(names, persons, robot.arms, surfaces, bases, frames, strict=True)
        self.sides = [DrawnSide(scene, *part) for part in parts]

    def draw(self, frames: Sequence[Frame], base_rotation: Array) -> None:
        """Draw a frame of each arm, at a rotation from the person's trunk frame to the robot's base frame."""
        self._base.wxyz = quaternion(base_rotation.T)
        for side, frame in zip(self.sides, frames, strict=True):
            side.draw(frame)


class DrawnSide:
    """An arm of the person and of the robot, with their ellipsoids; `name` is such as ``"/0"``, or empty."""

    def __init__(
        self,
        scene: "SceneApi",
        name: str,
        person: Arm,
        robot: Arm,
        surfaces: Sequence[Surface],
        base: Array,
        frame: Frame,
    ):
        self._person = person
        self._robot = robot
        home = f"/person{name}"
        place = f"/robot{name}"
        if name:
            scene.add_frame(home, show_axes=False, position=base)
            scene.add_frame(place, show_axes=False)
        self._teacher = Skeleton(
            scene, f"{home}/arm", person.skeleton(frame.target.joints), 0.028, (86, 120, 150)
        )
        look = {"color": (203, 206, 211), "flat_shading": False, "side": "double"}
        self._joints = np.array([surface.joint for surface in surfaces], dtype=int)
        self.meshes = []
        for surface in surfaces:
            label = f"{place}/surface/{surface.joint}"
            points = surface.points.astype(np.float32)
            mesh = scene.add_mesh_simple(label, points, surface.triangles, **look)
            self.meshes.append(mesh)
        self._skeleton = None
        if not surfaces:
            skeleton = robot.skeleton(frame.joints)
            self._skeleton = Skeleton(scene, f"{place}/skeleton", skeleton, 0.042, (120, 124, 132))
        self._demonstrated = Shell(scene, f"{home}/ellipsoid", PERSON.rgb, 0.4)
        # the achieved one first: browsers draw nothing behind the first of two translucent shells at one place
        self._achieved = Shell(scene, f"{place}/achieved", ACHIEVED.rgb, 0.35)
        self._target = Shell(scene, f"{place}/target", TARGET.rgb, 0.6, wireframe=True)
        self._position = scene.add_icosphere(
            f"{place}/target_position", 0.02, TARGET.rgb, subdivisions=2
        )

    def draw(self, frame: Frame) -> None:
        """Draw a frame."""
        target = frame.target
        person = self._person.skeleton(target.joints)
        robot = self._robot.skeleton(frame.joints)
        self._teacher.draw(person)
        if self._skeleton is not None:
            self._skeleton.draw(robot)
        poses = self._robot.link_poses(frame.joints)[self._joints]
        for mesh, turn, pose in zip(self.meshes, quaternion(poses[:, :3, :3]), poses, strict=True):
            mesh.wxyz = turn
            mesh.position = pose[:3, 3]
        self._demonstrated.draw(target.demonstrated, person[-1])
        self._target.draw(target.ellipsoid, robot[-1])
        self._achieved.draw(frame.achieved, robot[-1])
        self._position.visible = target.position is not None
        if target.position is not None:
            self._position.position = target.position
