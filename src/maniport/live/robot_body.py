"""How a robot looks: its surface, where its description brings one, or a skeleton."""

from typing import Any

import numpy as np

from maniport.bodies import Arm, Surface
from maniport.errors import FileFormatError
from maniport.live.shapes import quaternion
from maniport.live.skeleton import Skeleton
from maniport.live.state import Picture
from maniport.validation import Array

SKELETON, SURFACE = (120, 124, 132), (203, 206, 211)
RADIUS = 0.042
"""Of the skeleton's tubes [m]."""


def find_surfaces(arm: Arm) -> tuple[tuple[Surface, ...], str]:
    """Surfaces of an arm, or none and, in one line, why there are none."""
    try:
        found = arm.surfaces()
    except FileFormatError as error:
        return (), " ".join(str(error).split())
    return found, "" if found else f"the description of {arm.name} names no shapes"


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
    """

    def __init__(self, scene: Any, name: str, surfaces: tuple[Surface, ...], picture: Picture):
        self._joints = np.array([surface.joint for surface in surfaces], dtype=int)
        self._cover = scene.add_frame(f"{name}/surface", show_axes=False)
        self._meshes = [_add_mesh(scene, f"{name}/surface/{surface.joint}", surface) for surface in surfaces]
        self._inside = scene.add_frame(f"{name}/skeleton", show_axes=False)
        self._skeleton = Skeleton(scene, f"{name}/skeleton", picture.student_skeleton, RADIUS, SKELETON)
        self.draw(picture, covered=True)

    def draw(self, picture: Picture, covered: bool) -> None:
        """Take the posture of a picture, with the surface where there is one and it is wanted."""
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
