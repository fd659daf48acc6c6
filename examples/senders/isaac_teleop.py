"""Frames of IsaacTeleop (OpenXR body tracking, 24 joints) for ``maniport live``.

Needs ``isaacteleop``: ``python isaac_teleop.py --record me.npz``, then ``maniport live me.npz --robot panda --udp
9000`` and ``python isaac_teleop.py``.
"""

import time
from collections.abc import Iterator
from typing import Protocol

from sending import BODY_JOINTS, Frames, Points, Position, run


class Vector(Protocol):
    """A position of IsaacTeleop."""

    x: float
    y: float
    z: float


class Pose(Protocol):
    """A pose of IsaacTeleop."""

    position: Vector


class Joint(Protocol):
    """A joint of a body of IsaacTeleop."""

    pose: Pose
    is_valid: bool


class Joints(Protocol):
    """The joints of a body of IsaacTeleop."""

    def joints(self, number: int) -> Joint:
        """Return a joint by its number."""


def points_of(joints: Joints) -> Points:
    """Return the points of a body; joints that are not valid are missing. OpenXR's axes are right-handed, y is up."""
    points: dict[str, Position | None] = {}
    for number, name in enumerate(BODY_JOINTS):
        joint = joints.joints(number)
        points[name] = None
        if joint.is_valid:
            position = joint.pose.position
            points[name] = (float(position.x), float(position.y), float(position.z))
    return points


def frames() -> Iterator[tuple[float, Points]]:
    """Yield frames as they come; none while no body is tracked."""
    from isaacteleop import deviceio, oxr

    tracker = deviceio.FullBodyTrackerPico()
    trackers = [tracker]
    extensions = deviceio.DeviceIOSession.get_required_extensions(trackers)
    with (
        oxr.OpenXRSession("maniport", extensions) as session,
        deviceio.DeviceIOSession.run(trackers, session.get_handles()) as devices,
    ):
        while True:
            devices.update()
            tracked = tracker.get_body_pose(devices)
            if tracked.data is not None:
                yield time.monotonic(), points_of(tracked.data.joints)
            time.sleep(1.0 / 90.0)


def main(source: Frames | None = None) -> None:
    """Send or record."""
    run(frames() if source is None else source, __doc__)


if __name__ == "__main__":
    main()
