"""Frames of a Pinocchio model and the joints that move them."""

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from maniport.errors import InvalidInputError, unknown_name

ONE_TURN_OR_SLIDE = {
    *("JointModelRX", "JointModelRY", "JointModelRZ", "JointModelRevoluteUnaligned"),
    *("JointModelRUBX", "JointModelRUBY", "JointModelRUBZ", "JointModelRevoluteUnboundedUnaligned"),
    *("JointModelPX", "JointModelPY", "JointModelPZ", "JointModelPrismaticUnaligned"),
}


def frame_id(model: pin.Model, frame: str) -> int:
    """Index of a frame.

    Raises
    ------
    UnknownNameError
        When the model has no such frame; the message lists those it has, nearest first.
    """
    index = model.getFrameId(frame)
    if index == model.nframes:
        raise unknown_name("frame", frame, [f.name for f in model.frames], f"in the model {model.name!r}")
    return int(index)


def moving_columns(model: pin.Model, frame: str) -> NDArray[np.intp]:
    """Columns of the frame's Jacobian that belong to the joints between the world and the frame, base to tip.

    Raises
    ------
    InvalidInputError
        When one of these joints is neither revolute nor prismatic, or there are none.
    UnknownNameError
        When the model has no such frame.
    """
    columns = []
    joint = model.frames[frame_id(model, frame)].parentJoint
    while joint:
        kind = model.joints[joint].shortname()
        if kind not in ONE_TURN_OR_SLIDE:
            raise InvalidInputError(
                f"the joint {model.names[joint]!r} on the way to the frame {frame!r} is a {kind}; the ellipsoid's "
                "derivative is known for revolute and prismatic joints only. Fix a floating base, or lock the joint"
            )
        columns.append(model.joints[joint].idx_v)
        joint = model.parents[joint]
    if not columns:
        raise InvalidInputError(f"no joint moves the frame {frame!r} of the model {model.name!r}")
    return np.array(columns[::-1], dtype=np.intp)
