"""Which frame of a robot is its tip when the user names none."""

from collections.abc import Mapping
from itertools import takewhile

import pinocchio as pin

from maniport.errors import InvalidInputError, nearest_first

_TOOL_NAMES = ("tool0", "tcp", "tool", "tool_center_point", "ee_link", "ee", "end_effector", "flange")


def named_frames(model: pin.Model) -> dict[str, int]:
    """Bodies and sites of a model with their index; bodies win where names are equal."""
    kinds = (pin.FrameType.BODY, pin.FrameType.OP_FRAME)
    names: dict[str, int] = {}
    for kind in kinds:
        for index, frame in enumerate(model.frames):
            if frame.type == kind:
                names.setdefault(frame.name, index)
    return names


def choose_tip(model: pin.Model, movable: Mapping[int, int], wanted: Mapping[int, int], source: str) -> str:
    """Choose the frame at the end of the longest chain of movable joints.

    Of several limbs the one with most of the wanted joints is taken. Where the longest chains are the fingers of one
    gripper, that is, they share more joints than they have of their own, the tip is the body that carries the
    fingers. Among several bodies at the end of the chain one with a usual tool name wins.

    Parameters
    ----------
    model : pinocchio.Model
        The robot.
    movable, wanted : mapping of int to int
        For each joint of the model, how many one-degree-of-freedom joints it holds, and how many of those the user
        wants to move.
    source : str
        What to call the robot in messages.

    Raises
    ------
    InvalidInputError
        When there is nothing to choose from, or the choice is ambiguous; the message lists the candidates.
    """
    paths = {j: [i for i in model.supports[j] if i and movable[i]] for j in movable}
    lengths = {j: (sum(wanted[i] for i in path), sum(movable[i] for i in path)) for j, path in paths.items()}
    longest = max(lengths.values(), default=(0, 0))
    ends = {paths[j][-1] for j in movable if lengths[j] == longest and paths[j]}
    if not ends:
        raise InvalidInputError(f"{source}: holds no movable joint")
    if len(ends) > 1:
        ends = {_hand(j, paths, ends, movable) for j in ends}
    if len(ends) > 1:
        _ambiguous([frame for j in sorted(ends) for frame in _candidates(model, j)], source, longest[1])
    return _at_joint(model, ends.pop(), source, longest[1])


def _hand(end: int, paths: Mapping[int, list[int]], ends: set[int], movable: Mapping[int, int]) -> int:
    """The joint that carries the fingers when `end` is one of several in a gripper, else `end` itself."""
    shared = max((_shared_prefix(paths[end], paths[j]) for j in ends if j != end), key=len)
    return shared[-1] if 2 * sum(movable[i] for i in shared) > sum(movable[i] for i in paths[end]) else end


def _at_joint(model: pin.Model, joint: int, source: str, longest: int) -> str:
    """The tip among the bodies that a joint carries."""
    candidates = _candidates(model, joint)
    usual = [name for tool in _TOOL_NAMES for name in candidates if name == tool or name.endswith(f"_{tool}")]
    if len(candidates) > 1 and not usual:
        _ambiguous(candidates, source, longest)
    return usual[0] if usual else candidates[0]


def _candidates(model: pin.Model, joint: int) -> list[str]:
    """The one body of a joint that carries further joints, else all outermost bodies on the joint."""
    carriers = {_carrier(model, child) for child in range(1, model.njoints) if model.parents[child] == joint}
    return list(carriers) if len(carriers) == 1 else _leaves(model, joint)


def _carrier(model: pin.Model, joint: int) -> str:
    """The body that a joint is attached to."""
    frame = model.frames[model.getFrameId(model.names[joint], pin.FrameType.JOINT)]
    parent = model.frames[frame.parentFrame]
    while parent.type != pin.FrameType.BODY and parent.parentFrame != 0:
        parent = model.frames[parent.parentFrame]
    return str(parent.name)


def _leaves(model: pin.Model, joint: int) -> list[str]:
    """Bodies on a joint that carry no further body on the same joint."""
    bodies = [i for i, f in enumerate(model.frames) if f.type == pin.FrameType.BODY and f.parentJoint == joint]
    inner = set()
    for i in bodies:
        above = model.frames[i].parentFrame
        while above and model.frames[above].parentJoint == joint:
            inner.add(above)
            above = model.frames[above].parentFrame
    return [str(model.frames[i].name) for i in bodies if i not in inner]


def _shared_prefix(one: list[int], other: list[int]) -> list[int]:
    return [a for a, _ in takewhile(lambda pair: pair[0] == pair[1], zip(one, other, strict=False))]


def _ambiguous(candidates: list[str], source: str, longest: int) -> None:
    raise InvalidInputError(
        f"{source}: several frames end a chain of {longest} movable joints; say which with frame=, such as "
        f"{', '.join(map(repr, nearest_first('hand', candidates)[:12]))}"
    )
