"""A page that shows a person and a robot that follows them live, moment by moment."""

import time as clock

import numpy as np

from maniport.bodies import Arm
from maniport.errors import InvalidInputError
from maniport.live import Moment
from maniport.ports import LOOPBACK
from maniport.view.bodies import find_surfaces
from maniport.view.door import Door
from maniport.view.picture import Picture
from maniport.view.scene import Scene
from maniport.view.server import NUMBERS_EVERY, guarded_server, stop_server


class Onlooker:
    """Shows what `maniport.Live` gives; there is nothing to control.

    Parameters
    ----------
    person : Arm
        Of the fit that leads, such as ``fit.arm``.
    robot : Arm
    host : str
        Address to listen on. With others than the default, whoever knows the address of the page can see it from other
        machines.
    port : int
        Zero for a free one.

    Attributes
    ----------
    url : str
        Where the page is.

    Raises
    ------
    MissingPackageError
        Without viser.
    InvalidInputError
        When nothing can listen there.
    """

    def __init__(self, person: Arm, robot: Arm, host: str = LOOPBACK, port: int = 0):
        self._person, self._robot = person, robot
        self._scene: Scene | None = None
        self._server, self.url = guarded_server(Door(host), host, port)
        self._words, self._worded = self._server.gui.add_markdown("The person has not been seen yet."), 0.0

    def show(self, moment: Moment) -> None:
        """Draw a moment; nothing before the person was seen for the first time."""
        if len(moment.achieved) != 3:
            raise InvalidInputError(f"moment: the page shows 3×3 ellipsoids; found {moment.achieved.shape}")
        if moment.person is None or moment.demonstrated is None or moment.target is None or moment.distance is None:
            return
        picture = Picture(
            teacher_joints=moment.person,
            teacher_skeleton=self._person.skeleton(moment.person),
            demonstrated_ellipsoid=moment.demonstrated,
            target_ellipsoid=moment.target,
            target_tip=None,
            student_joints=moment.joint_positions,
            student_skeleton=self._robot.skeleton(moment.joint_positions),
            student_links=self._robot.link_poses(moment.joint_positions),
            achieved_ellipsoid=moment.achieved,
            mounting=np.eye(3),
            distance=moment.distance,
            position_error=moment.tip_error,
            note=moment.state,
        )
        if self._scene is not None:
            with self._server.atomic():
                self._scene.draw([picture])
                self._tell(moment)
            return
        self._scene = Scene(self._server.scene, [picture], [self._person], self._robot, find_surfaces(self._robot)[0])
        self._scene.gizmo.disable_rotations = True

    def _tell(self, moment: Moment) -> None:
        """Write state and numbers, no more often than they can be read."""
        now = clock.monotonic()
        if now - self._worded < NUMBERS_EVERY:
            return
        tip = "" if moment.tip_error is None else f", tip {1e3 * moment.tip_error:.0f} mm beside its path"
        self._words.content = f"**{moment.state}**\n\n{moment.time:.1f} s: distance {moment.distance:.2f}{tip}"
        self._worded = now

    def stop(self) -> None:
        """End the page."""
        stop_server(self._server)
