"""Mirror images of arms: what is on the other side of the plane of symmetry y = 0 of the base frame.

With S = diag(1, −1, 1) every pose T becomes S T S, and so every point p of a body S p. A rotation about an axis a
becomes one about −S a by the same angle, as axes of rotations are axial vectors: equal joint angles of an arm and its
mirror image are mirrored postures, and their ellipsoids are M and S M S.
"""

from collections.abc import Callable, Collection, Iterator
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from maniport.bodies.chain import LEFT, REVOLUTE, RIGHT, Chain, Joint, Shape
from maniport.validation import Array

MIRROR = np.array([1.0, -1.0, 1.0])
"""What each coordinate is multiplied with."""

_POSE = np.append(MIRROR, 1.0)
_LEFT_NAME = f"_{LEFT}"


def mirrored(chain: Chain) -> Chain:
    """The mirror image of an arm; that of the mirror image is the arm again.

    Parameters
    ----------
    chain : Chain
        An arm, right unless its `side` says left.

    Returns
    -------
    Chain
        With the same joint names, limits and coupling, the other `side`, and a name that tells of a left arm.
    """
    left = chain.side == LEFT
    return replace(
        chain,
        name=chain.name.removesuffix(_LEFT_NAME) if left else chain.name + _LEFT_NAME,
        side=RIGHT if left else LEFT,
        joints=tuple(_joint(joint) for joint in chain.joints),
        frames={name: replace(frame, placement=_pose(frame.placement)) for name, frame in chain.frames.items()},
        others=None if chain.others is None else {
            name: replace(body, placements=np.array([_pose(placement) for placement in body.placements]))
            for name, body in chain.others.items()
        },
        stand=None if chain.stand is None else _pose(chain.stand),
        shapes=None if chain.shapes is None else partial(_shapes, chain.shapes),
    )  # fmt: skip


def _joint(joint: Joint) -> Joint:
    turn = -1.0 if joint.kind == REVOLUTE else 1.0
    return replace(joint, axis=turn * MIRROR * joint.axis + 0.0, placement=_pose(joint.placement))  # + 0.0: no -0.0


def _pose(placement: Array) -> Array:
    return np.asarray(_POSE[:, None] * placement * _POSE + 0.0)


def _shapes(shapes: Callable[..., Any], links: Collection[str], **options: Any) -> Iterator[Shape]:
    """Mirrored shapes of links; their triangles turn round, so that they are seen from outside as before."""
    for shape in shapes(links, **options):
        points, triangles = shape.mesh
        yield replace(shape, mesh=(points * MIRROR, triangles[:, ::-1]))
