"""Limbs of a robot and their default end effectors."""

import re
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass

import pinocchio as pin

from maniport.errors import InvalidInputError, argument, nearest_first, unknown_name

_SIDES = ("left", "right", "l", "r")


@dataclass(frozen=True)
class Limb:
    """A chain from the base of a robot to one of its ends, without fingers."""

    frame: str  # the end effector's site, else the body that carries the gripper, else the outermost body
    joints: tuple[str, ...]  # with one axis, from the base
    fork: str | None  # last body shared with another of the longest limbs; None if it is fixed


def named_frames(model: pin.Model) -> dict[str, int]:
    """Map names of bodies and sites to indices; bodies have priority."""
    names: dict[str, int] = {}
    for kind in (pin.FrameType.BODY, pin.FrameType.OP_FRAME):
        for index, frame in enumerate(model.frames):
            if frame.type == kind:
                names.setdefault(frame.name, index)
    return names


def body_above(model: pin.Model, frame: int) -> int:
    """Return the index of the body that a frame is attached to; 0 without one."""
    above = model.frames[frame].parentFrame
    while above and model.frames[above].type != pin.FrameType.BODY:
        above = model.frames[above].parentFrame
    return int(above)


def one_side(limbs: Sequence[Limb], side: str, robot: str) -> Limb:
    """Return the limb of one side of a robot, among its longest limbs."""
    longest = [limb for limb in limbs if len(limb.joints) == len(limbs[0].joints)]
    scores = []  # occurrences of one side, as "left" or "l", minus those of the other
    for limb in longest:
        words = [word for name in (*limb.joints, limb.frame) for word in _words(name) if word in _SIDES]
        scores.append(sum(1 if word in (side, side[0]) else -1 for word in words))
    if scores.count(max(scores)) > 1:
        raise unknown_name("arm", robot, [limb.frame for limb in longest], f"(no limb is called {side})")
    return longest[scores.index(max(scores))]


class Limbs:
    """The limbs of a robot, by the last joint of each."""

    def __init__(
        self,
        model: pin.Model,
        names: Mapping[int, Sequence[str]],  # of the joints with one axis that each joint of the model consists of
        leaders: Mapping[str, str],  # by the joints that follow them
        wanted: Collection[str] = (),  # names of joints that are not fingers
    ):
        self.model, self._names, self._wanted = model, names, wanted
        owners = {name: j for j, own in names.items() for name in own}
        coupled = set()  # leaders of joints on other branches, such as the other finger
        for follower, leader in leaders.items():
            place = owners.get(follower)
            if place is None and model.existFrame(follower):  # a fixed joint with a mimic
                place = model.frames[model.getFrameId(follower)].parentJoint
            if leader in owners and place is not None and owners[leader] not in model.supports[place]:
                coupled.add(leader)
        beyond = dict.fromkeys(range(model.njoints), 0)  # largest number of moving joints beyond each
        self._below: dict[int, list[int]] = {j: [] for j in range(model.njoints)}
        for j in sorted(names, reverse=True):  # children follow their parents
            moving, parent = len(names[j]) + beyond[j], model.parents[j]
            if moving:
                self._below[parent].append(j)
                beyond[parent] = max(beyond[parent], moving)

        def is_hand(joint: int) -> bool:
            fingers = [name for child in self._below[joint] for name in names[child]]
            if not 0 < beyond[joint] < len(self._joints(joint)) or not self._beyond(joint).isdisjoint(wanted):
                return False
            return len(self._below[joint]) > 1 or any(name in coupled or _is_finger(name) for name in fingers)

        tops = [j for j in names if names[j] and not beyond[j]]
        self._ends = list(dict.fromkeys(next((j for j in self._path(top) if is_hand(j)), top) for top in tops))

    def all(self) -> list[Limb]:
        """Return all limbs, the longest first."""
        joints, limbs = {end: self._joints(end) for end in self._ends}, []
        longest = [end for end in joints if len(joints[end]) == max(map(len, joints.values()))]
        for end in sorted(self._ends, key=lambda end: -len(joints[end])):
            supports = [self.model.supports[other] for other in longest if other != end]
            shared = [j for j in self._path(end) if any(j in support for support in supports)]
            bodies = [
                str(frame.name) for frame in self.model.frames
                if shared and frame.type == pin.FrameType.BODY and frame.parentJoint == max(shared)
            ]  # fmt: skip
            limbs.append(Limb(self.end_frame(end), joints[end], bodies[0] if bodies else None))
        return limbs

    def fingers(self) -> set[str]:
        """Return the names of the joints beyond all hands."""
        return set[str]().union(*(self._beyond(end) for end in self._ends))

    def choose(self, source: str) -> str:
        """Choose the end of the limb with most of the wanted joints, or of most joints."""
        wanted = set(self._wanted)
        size = {end: (len(wanted.intersection(self._joints(end))), len(self._joints(end))) for end in self._ends}
        most = max(size.values(), default=(0, 0))
        ends = [end for end in self._ends if size[end] == most]
        if not ends:
            raise InvalidInputError(f"{source}: has no movable joint")
        shared = [j for j in self._path(ends[0]) if all(j in self.model.supports[end] for end in ends)]
        if len(ends) > 1 and most[0] and sum(name in wanted for j in shared for name in self._names[j]) == most[0]:
            ends = [max(j for j in shared if wanted.intersection(self._names[j]))]
        if len(ends) > 1:
            candidates = nearest_first("hand", [self.end_frame(end) for end in ends])
            raise InvalidInputError(
                f"{source}: several frames end a chain of {most[1]} movable joints; choose one with "
                f"{argument('frame')}, such as {', '.join(map(repr, candidates[:12]))}"
            )
        return self.end_frame(ends[0])

    def end_frame(self, joint: int) -> str:
        """Return the end-effector site, else the body that carries all further joints, else the outermost body."""
        model, frames = self.model, self.model.frames
        sites = [
            name for name, index in named_frames(model).items()
            if frames[index].type == pin.FrameType.OP_FRAME and frames[index].parentJoint == joint
        ]  # fmt: skip
        if marked := _with_usual_name(sites, ("pinch_site", "pinch", "attachment_site")):
            return marked
        ends = {
            body_above(model, model.getFrameId(model.names[child], pin.FrameType.JOINT)) for child in self._below[joint]
        }
        if not ends:
            bodies = [i for i, f in enumerate(frames) if f.type == pin.FrameType.BODY and f.parentJoint == joint]
            ends = set(bodies) - {body_above(model, i) for i in bodies}
            usual = ("tool0", "tcp", "tool", "tool_center_point", "ee_link", "ee", "end_effector", "flange")
            if named := _with_usual_name([str(frames[i].name) for i in bodies if i in ends], usual):
                return named
        ancestors = []
        for body in ends:
            line = [body]
            while line[-1]:
                line.append(body_above(model, line[-1]))
            ancestors.append(line)
        return str(frames[next(body for body in ancestors[0] if all(body in line for line in ancestors))].name)

    def _path(self, end: int) -> list[int]:
        return [j for j in self.model.supports[end] if j and self._names[j]]

    def _joints(self, end: int) -> tuple[str, ...]:
        return tuple(name for j in self._path(end) for name in self._names[j])

    def _beyond(self, joint: int) -> set[str]:
        """Names of the joints beyond a joint."""
        beyond = (j for j in self._names if j != joint and joint in self.model.supports[j])
        return {name for j in beyond for name in self._names[j]}


def _with_usual_name(names: Collection[str], usual: Sequence[str]) -> str | None:
    """Return the first name that equals or ends with a usual name, in the order of `usual`."""
    return next((name for end in usual for name in names if name == end or name.endswith((f"_{end}", f"/{end}"))), None)


def _words(name: str) -> list[str]:
    return [word.lower() for word in re.findall(r"[A-Z](?=[A-Z][a-z])|[A-Z]?[a-z]+|[A-Z]+", name)]


def _is_finger(name: str) -> bool:
    """Whether the name of a joint is that of a gripper: ``gripper_left_joint``, ``jointGripper``."""
    words = [word for word in _words(name) if word not in ("joint", "link", *_SIDES)]
    return bool(words) and words[-1] in ("gripper", "finger", "thumb", "jaw", "claw", "knuckle")
