"""What stands in the page's space: a person's arm, a robot, three ellipsoids. Arrays in, nothing out."""

from typing import Any

import numpy as np

from maniport.bodies import Arm, Surface
from maniport.bodies.human import middle_of
from maniport.telling.roles import ACHIEVED, PERSON, TARGET
from maniport.validation import Array
from maniport.view.bodies import RobotBody, Skeleton, quaternion, rings, shell
from maniport.view.state import Picture

PERSON_AT, ROBOT_AT = (0.0, -0.6, 1.4), (0.0, 0.5, 0.7)
"""Where the base frames stand in the page's space [m]: the person to the left of who looks at their face."""
MIDDLE = np.array([0.0, -0.05, 1.15])
"""Between both, at the height of their hands [m]."""
FIELD = 45.0
"""Vertical angle of view [degrees]."""
HIGH, WIDE = 2.4, 2.9
"""What has to be in view [m]."""
NARROW, ABOVE = 0.7, 0.3
"""On phones, of a width over height below the first, the controls cover the lower part: what there is to see stands by
such a share of the height above the middle."""


def camera_for(aspect: float) -> tuple[Array, Array]:
    """Where to look from and to, so that person and robot are seen in a view of that width over height [m]."""
    height = max(HIGH, WIDE / max(aspect, 0.2))
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
    picture : Picture
        The first one.
    teacher, student : Arm
        The person's and the robot.
    surfaces : tuple of Surface
        Of the robot; without any it is drawn as a skeleton.

    Attributes
    ----------
    gizmo
        viser's handle of the rings that turn the robot's base.
    """

    def __init__(
        self,
        scene: Any,
        picture: Picture,
        teacher: Arm,
        student: Arm,
        surfaces: tuple[Surface, ...] = (),
    ):
        scene.set_up_direction("+z")
        scene.world_axes.visible = False
        scene.add_grid(
            "/floor", 8.0, 8.0, cell_size=0.25, cell_color=(225, 228, 232), section_color=(190, 195, 202),
            fade_distance=9.0, fade_from="origin",
        )  # fmt: skip
        scene.add_frame("/person", show_axes=False, position=PERSON_AT)
        _trunk(scene, middle_of(teacher))
        self._teacher = Skeleton(scene, "/person/arm", picture.teacher_skeleton, PERSON_RADIUS, ARM)
        scene.add_label("/person/name", f"person: {teacher.name}", position=(0.0, 0.15, 0.5), anchor="bottom-center")

        _stand(scene)
        self.gizmo = scene.add_transform_controls(
            "/robot", 0.3, disable_axes=True, disable_sliders=True, position=ROBOT_AT,
            wxyz=quaternion(picture.mounting.T), line_width=3.0, opacity=0.7,
        )  # fmt: skip
        joints = tuple(joint.name for joint in student.chain.joints)
        self._student = RobotBody(scene, "/robot", surfaces, picture, joints)
        x, y, z = ROBOT_AT
        scene.add_label("/name", f"robot: {student.name}", position=(x, y, z + 1.25), anchor="bottom-center")

        self._of_teacher = Shell(scene, "/person/ellipsoid", PERSON.rgb, 0.6)
        # the robot's own first: of two translucent shells at one place, browsers draw what is behind the first no more
        self._of_student = Shell(scene, "/robot/achieved", ACHIEVED.rgb, 0.7)
        self._shell = Shell(scene, "/robot/target", TARGET.rgb, 0.15, ringed=True)
        self._target = scene.add_icosphere("/robot/target_tip", 0.02, TARGET.rgb, subdivisions=2)
        self.draw(picture)

    def draw(self, picture: Picture, covered: bool = True) -> None:
        """Show a picture, the robot with its surface where it has one and that is asked for."""
        self._teacher.draw(picture.teacher_skeleton)
        self._student.draw(picture, covered)
        self._of_teacher.draw(picture.demonstrated_ellipsoid, picture.teacher_skeleton[-1])
        self._shell.draw(picture.target_ellipsoid, picture.student_skeleton[-1])
        self._of_student.draw(picture.achieved_ellipsoid, picture.student_skeleton[-1])
        self._target.visible = picture.target_tip is not None
        if picture.target_tip is not None:
            self._target.position = picture.target_tip


def _trunk(scene: Any, middle: float) -> None:
    """Head and trunk, `middle` to the left of the trunk frame's origin [m], so that one sees whose arm it is."""
    parts = {
        "trunk": ((0.11, 0.16, 0.30), (-0.06, middle, -0.30)),
        "neck": ((0.05, 0.05, 0.12), (-0.05, middle, 0.03)),
        "head": ((0.095, 0.075, 0.12), (-0.02, middle, 0.22)),
    }
    for name, (size, place) in parts.items():
        scene.add_icosphere(f"/person/{name}", 1.0, PALE, scale=size, position=place, opacity=0.55, cast_shadow=False)


def _stand(scene: Any) -> None:
    """The column that the robot's base stands on."""
    x, y, z = ROBOT_AT
    scene.add_cylinder("/stand", 0.07, z, color=PALE, opacity=0.55, position=(x, y, 0.5 * z))
