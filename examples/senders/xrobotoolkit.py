"""Frames of XRoboToolkit (PICO body tracking, 24 joints) for ``maniport live``.

Needs ``xrobotoolkit_sdk`` and its PC service: ``python xrobotoolkit.py --record me.npz``, then ``maniport live me.npz
--robot panda --udp 9000`` and ``python xrobotoolkit.py``.
"""

import time
from collections.abc import Iterator, Sequence

from sending import BODY_JOINTS, Frames, Points, is_mirrored, mirrored, run


def points_of(poses: Sequence[Sequence[float]]) -> Points:
    """Return the points of the 24 poses x, y, z, qx, qy, qz, qw of a frame, with right-handed axes.

    The axes of the service are left-handed or right-handed by its version; which they are, the body shows.
    """
    if len(poses) != len(BODY_JOINTS):
        raise ValueError(f"a frame must have {len(BODY_JOINTS)} poses; found {len(poses)}")
    points: Points = {
        name: (float(pose[0]), float(pose[1]), float(pose[2]))
        for name, pose in zip(BODY_JOINTS, poses, strict=True)
    }
    if is_mirrored(points):
        return mirrored(points)
    return points


def frames() -> Iterator[tuple[float, Points]]:
    """Yield frames as they come; none while the body is not tracked."""
    import xrobotoolkit_sdk

    xrobotoolkit_sdk.init()
    last = 0
    try:
        while True:
            stamp = xrobotoolkit_sdk.get_time_stamp_ns()
            if stamp == last or not xrobotoolkit_sdk.is_body_data_available():
                time.sleep(0.002)
                continue
            last = stamp
            yield 1e-9 * stamp, points_of(xrobotoolkit_sdk.get_body_joints_pose())
    finally:
        xrobotoolkit_sdk.close()


def main(source: Frames | None = None) -> None:
    """Send or record."""
    run(frames() if source is None else source, __doc__)


if __name__ == "__main__":
    main()
