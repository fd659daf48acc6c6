"""The scene of the page: a person's arms, a robot, ellipsoids; and where cameras look from."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from maniport.arms import Arm, ArmGroup, Surface, as_group
from maniport.arms.human import middle_of
from maniport.report.roles import ACHIEVED, PERSON, TARGET
from maniport.util.validation import Array
from maniport.viewer.shapes import RobotBody, Shell, Skeleton, quaternion
from maniport.viewer.state import Frame

PERSON_AT = np.array([0.0, -0.6, 1.4])  # Base frame of the person [m], to the left for a viewer in front of them
ROBOT_AT = np.array([0.0, 0.5, 0.7])
FIELD_OF_VIEW = 45.0  # Vertical [degrees]
PALE = (196, 201, 208)


@dataclass(frozen=True)
class Layout:
    """Size of the view, and the distance of person and robot from their places with one arm [m]."""

    height: float
    width: float
    aside: float


ONE_ARM, SEVERAL_ARMS = Layout(2.4, 2.9, 0.0), Layout(2.6, 4.2, 0.45)


def camera_for(aspect: float, layout: Layout = ONE_ARM) -> tuple[Array, Array]:
    """Where to look from and to, so that person and robot are in a view of that width over height [m].

    On phones the controls cover the lower part: the scene is moved up by 30 % of the height.
    """
    height = max(layout.height, layout.width / max(aspect, 0.2))
    distance = height / (2.0 * np.tan(np.radians(0.5 * FIELD_OF_VIEW)))
    to = np.array([0.0, -0.05, 1.15 - (0.3 * height if aspect < 0.7 else 0.0)])
    return to + distance * np.array([0.97, 0.0, 0.24]), to


class Scene:
    """Everything in space: person, robot and ellipsoids of each arm."""

    def __init__(
        self,
        scene: Any,
        frames: Sequence[Frame],
        persons: Sequence[Arm],
        robot: Arm | ArmGroup,
        surfaces: Sequence[tuple[Surface, ...]],
        bases: Sequence[Array] = (np.zeros(3),),
    ):
        scene.set_up_direction("+z")
        scene.world_axes.visible = False
        scene.add_grid(
            "/floor", 8.0, 8.0, cell_size=0.25, cell_color=(225, 228, 232), section_color=(190, 195, 202),
            fade_distance=9.0, fade_from="origin",
        )  # fmt: skip
        self.layout = ONE_ARM if len(persons) == 1 else SEVERAL_ARMS
        aside = np.array([0.0, self.layout.aside, 0.0])
        scene.add_frame("/person", show_axes=False, position=PERSON_AT - aside)
        middles = [base + np.array([0.0, middle_of(arm), 0.0]) for arm, base in zip(persons, bases, strict=True)]
        _trunk(scene, np.mean(middles, axis=0))
        models = " and ".join(dict.fromkeys(arm.name for arm in persons))
        scene.add_label("/person/name", f"person: {models}", position=(0.0, 0.15, 0.5), anchor="bottom-center")

        self._base = scene.add_frame(
            "/robot", axes_length=0.15, axes_radius=0.006, position=ROBOT_AT + aside,
            wxyz=quaternion(frames[0].base_rotation.T),
        )  # fmt: skip
        arms = as_group(robot).arms
        _stands(scene, arms, ROBOT_AT + aside)
        above = ROBOT_AT + aside + [0.0, 0.0, 1.25]
        scene.add_label("/name", f"robot: {robot.name}", position=above, anchor="bottom-center")
        names = [""] if len(arms) == 1 else [f"/{k}" for k in range(len(arms))]
        parts = zip(names, frames, arms, surfaces, bases, strict=True)
        self.sides = [DrawnSide(scene, *part) for part in parts]
        self.draw(frames)

    def draw(self, frames: Sequence[Frame]) -> None:
        """Draw a frame of each arm."""
        self._base.wxyz = quaternion(frames[0].base_rotation.T)
        for side, frame in zip(self.sides, frames, strict=True):
            side.draw(frame)


class DrawnSide:
    """An arm of the person and that of the robot, with their ellipsoids; `name` is such as ``"/left"``, or empty."""

    def __init__(self, scene: Any, name: str, frame: Frame, student: Arm, surfaces: tuple[Surface, ...], base: Array):
        person, robot = f"/person{name}", f"/robot{name}"
        if name:
            scene.add_frame(person, show_axes=False, position=base)
            scene.add_frame(robot, show_axes=False)
        self.teacher = Skeleton(scene, f"{person}/arm", frame.teacher_skeleton, 0.028, (86, 120, 150))
        joints = tuple(joint.name for joint in student.chain.joints)
        self.student = RobotBody(scene, robot, surfaces, frame, joints)
        self._demonstrated = Shell(scene, f"{person}/ellipsoid", PERSON.rgb, 0.4)
        # the achieved one first: browsers draw nothing behind the first of two translucent shells at one place
        self.achieved = Shell(scene, f"{robot}/achieved", ACHIEVED.rgb, 0.35)
        self._target = Shell(scene, f"{robot}/target", TARGET.rgb, 0.12, ringed=True)
        self._tip = scene.add_icosphere(f"{robot}/target_tip", 0.02, TARGET.rgb, subdivisions=2)

    def draw(self, frame: Frame) -> None:
        """Draw a frame."""
        self.teacher.draw(frame.teacher_skeleton)
        self.student.draw(frame)
        self._demonstrated.draw(frame.demonstrated_ellipsoid, frame.teacher_skeleton[-1])
        self._target.draw(frame.target_ellipsoid, frame.student_skeleton[-1])
        self.achieved.draw(frame.achieved_ellipsoid, frame.student_skeleton[-1])
        self._tip.visible = frame.target_tip is not None
        if frame.target_tip is not None:
            self._tip.position = frame.target_tip


def _trunk(scene: Any, middle: Array) -> None:
    """Head and trunk about the middle of the neck [m], in the trunk frame."""
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
    """Columns below the robot's bases, one for all in one place."""
    bases = [at if arm.chain.stand is None else at + arm.chain.stand[:3, 3] for arm in arms]
    for i, (x, y, z) in enumerate({tuple(base.tolist()) for base in bases}):
        scene.add_cylinder(f"/stand/{i}", 0.07, z, color=PALE, opacity=0.55, position=(x, y, 0.5 * z))
