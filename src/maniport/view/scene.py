"""What stands in the page's space: a person's arm, a robot, three ellipsoids. Arrays in, nothing out."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from maniport.bodies import Arm, Arms, Surface
from maniport.bodies.human import middle_of
from maniport.demonstrations.both_arms import EACH
from maniport.telling.roles import ACHIEVED, PERSON, TARGET
from maniport.validation import Array
from maniport.view.bodies import RobotBody, Skeleton, quaternion, rings, shell
from maniport.view.picture import Picture

PERSON_AT, ROBOT_AT = np.array([0.0, -0.6, 1.4]), np.array([0.0, 0.5, 0.7])
"""Where the base frames stand in the page's space [m]: the person to the left of who looks at their face."""
MIDDLE = np.array([0.0, -0.05, 1.15])
"""Between both, at the height of their hands [m]."""
FIELD = 45.0
"""Vertical angle of view [degrees]."""
NARROW, ABOVE = 0.7, 0.3
"""On phones, of a width over height below the first, the controls cover the lower part: what there is to see stands by
such a share of the height above the middle."""


@dataclass(frozen=True)
class Room:
    """What has to be in view [m], and how much farther to the sides person and robot stand for it."""

    high: float
    wide: float
    aside: float


ROOMS = {1: Room(2.4, 2.9, 0.0), 2: Room(2.6, 4.2, 0.45)}
"""By the number of arms that person and robot have."""


def camera_for(aspect: float, room: Room = ROOMS[1]) -> tuple[Array, Array]:
    """Where to look from and to, so that person and robot are seen in a view of that width over height [m]."""
    height = max(room.high, room.wide / max(aspect, 0.2))
    distance = height / (2.0 * np.tan(np.radians(0.5 * FIELD)))
    to = MIDDLE - [0.0, 0.0, ABOVE * height if aspect < NARROW else 0.0]
    return to + distance * np.array([0.97, 0.0, 0.24]), to


ARM, PALE = (86, 120, 150), (196, 201, 208)
PERSON_RADIUS = 0.028
"""Of the tubes of the person's arm [m]."""


class Shell:
    """An ellipsoid at a hand; with rings along its principal sections it is seen around another one, too."""

    def __init__(self, scene: Any, name: str, color: tuple[int, int, int], opacity: float, ringed: bool = False):
        shell = scene.add_icosphere(
            name, 1.0, color, subdivisions=4, opacity=opacity, cast_shadow=False, receive_shadow=False
        )
        self._parts = [shell]
        if ringed:
            segments = rings().astype(np.float32)
            lines = scene.add_line_segments(f"{name}_rings", segments, color, thickness=2.5, thickness_units="screen")
            self._parts.append(lines)

    def draw(self, ellipsoid: Array, position: Array) -> None:
        """Take the shape of an ellipsoid (3, 3) about a position (3,) [m]."""
        scale, turn = shell(ellipsoid)
        for part in self._parts:
            part.scale, part.wxyz, part.position = scale, turn, position


class Scene:
    """Everything in space.

    Parameters
    ----------
    scene : viser.SceneApi
    pictures : sequence of Picture
        The first ones, of each arm.
    persons : sequence of Arm
        The person's arms.
    robot : Arm or Arms
        As many.
    surfaces : sequence of tuple of Surface, optional
        Of each of the robot's arms; without any they are drawn as skeletons.
    bases : sequence of ndarray, shape (3,), optional
        Where the base frames of the person's arms lie in the frame of both [m]. Default: at its origin.

    Attributes
    ----------
    gizmo
        viser's handle of the rings that turn the robot's base.
    sides : list of Side
    room : Room
    """

    def __init__(
        self,
        scene: Any,
        pictures: Sequence[Picture],
        persons: Sequence[Arm],
        robot: Arm | Arms,
        surfaces: Sequence[tuple[Surface, ...]],
        bases: Sequence[Array] = (np.zeros(3),),
    ):
        scene.set_up_direction("+z")
        scene.world_axes.visible = False
        scene.add_grid(
            "/floor", 8.0, 8.0, cell_size=0.25, cell_color=(225, 228, 232), section_color=(190, 195, 202),
            fade_distance=9.0, fade_from="origin",
        )  # fmt: skip
        self.room = ROOMS[len(persons)]
        aside = np.array([0.0, self.room.aside, 0.0])
        scene.add_frame("/person", show_axes=False, position=PERSON_AT - aside)
        middles = [base + np.array([0.0, middle_of(arm), 0.0]) for arm, base in zip(persons, bases, strict=True)]
        _trunk(scene, np.mean(middles, axis=0))
        told = " and ".join(dict.fromkeys(arm.name for arm in persons))
        scene.add_label("/person/name", f"person: {told}", position=(0.0, 0.15, 0.5), anchor="bottom-center")

        self.gizmo = scene.add_transform_controls(
            "/robot", 0.3, disable_axes=True, disable_sliders=True, position=ROBOT_AT + aside,
            wxyz=quaternion(pictures[0].mounting.T), line_width=3.0, opacity=0.7,
        )  # fmt: skip
        arms = robot.each if isinstance(robot, Arms) else (robot,)
        _stands(scene, arms, ROBOT_AT + aside)
        above = ROBOT_AT + aside + [0.0, 0.0, 1.25]
        scene.add_label("/name", f"robot: {robot.name}", position=above, anchor="bottom-center")
        names = ("",) if len(arms) == 1 else [f"/{side}" for side in EACH]
        parts = zip(names, pictures, arms, surfaces, bases, strict=True)
        self.sides = [Side(scene, *part) for part in parts]
        self.draw(pictures)

    def draw(self, pictures: Sequence[Picture], covered: bool = True) -> None:
        """Show a picture of each arm, the robot's with its surface where it has one and that is asked for."""
        for side, picture in zip(self.sides, pictures, strict=True):
            side.draw(picture, covered)


class Side:
    """An arm of the person and that of the robot which follows it, with their ellipsoids.

    Parameters
    ----------
    scene : viser.SceneApi
    name : str
        Behind those of person and robot, such as ``"/left"``.
    picture : Picture
        The first one.
    student : Arm
    surfaces : tuple of Surface
    base : ndarray, shape (3,)
        Where the base frame of the person's arm lies in that of the person [m].
    """

    def __init__(
        self, scene: Any, name: str, picture: Picture, student: Arm, surfaces: tuple[Surface, ...], base: Array
    ):
        person, robot = f"/person{name}", f"/robot{name}"
        if name:
            scene.add_frame(person, show_axes=False, position=base)
            scene.add_frame(robot, show_axes=False)
        self.teacher = Skeleton(scene, f"{person}/arm", picture.teacher_skeleton, PERSON_RADIUS, ARM)
        joints = tuple(joint.name for joint in student.chain.joints)
        self.student = RobotBody(scene, robot, surfaces, picture, joints)
        self._of_teacher = Shell(scene, f"{person}/ellipsoid", PERSON.rgb, 0.6)
        # the robot's own first: of two translucent shells at one place, browsers draw what is behind the first no more
        self._of_student = Shell(scene, f"{robot}/achieved", ACHIEVED.rgb, 0.7)
        self._shell = Shell(scene, f"{robot}/target", TARGET.rgb, 0.15, ringed=True)
        self._target = scene.add_icosphere(f"{robot}/target_tip", 0.02, TARGET.rgb, subdivisions=2)

    def draw(self, picture: Picture, covered: bool) -> None:
        """Show a picture."""
        self.teacher.draw(picture.teacher_skeleton)
        self.student.draw(picture, covered)
        self._of_teacher.draw(picture.demonstrated_ellipsoid, picture.teacher_skeleton[-1])
        self._shell.draw(picture.target_ellipsoid, picture.student_skeleton[-1])
        self._of_student.draw(picture.achieved_ellipsoid, picture.student_skeleton[-1])
        self._target.visible = picture.target_tip is not None
        if picture.target_tip is not None:
            self._target.position = picture.target_tip


def _trunk(scene: Any, middle: Array) -> None:
    """Head and trunk about the middle of the neck [m], in the trunk frame, so that one sees whose arm it is."""
    parts = {
        "trunk": ((0.11, 0.16, 0.30), (-0.06, 0.0, -0.30)),
        "neck": ((0.05, 0.05, 0.12), (-0.05, 0.0, 0.03)),
        "head": ((0.095, 0.075, 0.12), (-0.02, 0.0, 0.22)),
    }
    for name, (size, place) in parts.items():
        scene.add_icosphere(
            f"/person/{name}", 1.0, PALE, scale=size, position=middle + place, opacity=0.55, cast_shadow=False
        )


def _stands(scene: Any, arms: Sequence[Arm], at: Array) -> None:
    """The columns that the robot's bases stand on, one for all that stand in one place."""
    bases = [at if arm.chain.stand is None else at + arm.chain.stand[:3, 3] for arm in arms]
    for i, (x, y, z) in enumerate({tuple(base.tolist()) for base in bases}):
        scene.add_cylinder(f"/stand/{i}", 0.07, z, color=PALE, opacity=0.55, position=(x, y, 0.5 * z))
