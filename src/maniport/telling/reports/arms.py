"""Arms as bodies of a report: with the surfaces of their links where there are any, else as skeletons."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from maniport.bodies import Arm
from maniport.errors import FileFormatError
from maniport.telling.page import Body, Part
from maniport.validation import Array


def body_of(
    arm: Arm,
    joint_positions: Array,
    ellipsoids: Mapping[str, Array] | None = None,
    path: Array | None = None,
    name: str | None = None,
) -> tuple[Body, str]:
    """Draw an arm at each time, with ellipsoids at its hand.

    Parameters
    ----------
    arm : Arm
    joint_positions : ndarray, shape (n, dof)
        [rad] or [m].
    ellipsoids, path
        See `maniport.telling.page.Body`.
    name : str, optional
        By default the arm's.

    Returns
    -------
    body : Body
    note : str
        Why it is a skeleton although its description names surfaces; empty where nothing is missing.
    """
    body = Body(name or arm.name, arm.skeleton(joint_positions), ellipsoids or {}, path)
    try:
        return replace(body, parts=parts_of(arm, joint_positions)), ""
    except FileFormatError as error:  # what was computed is worth its report without them
        return body, f"{body.name} is drawn as a skeleton: {error}"


def parts_of(arm: Arm, joint_positions: Array) -> tuple[Part, ...]:
    """Place the surfaces of an arm's links at each time; none where its description names none.

    Raises
    ------
    FileFormatError
        When they are named, and cannot be read.
    """
    surfaces, poses = arm.surfaces(), arm.link_poses(joint_positions)
    return tuple(Part(one.points, one.triangles, poses[:, one.joint]) for one in surfaces)
