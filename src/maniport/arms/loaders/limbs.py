"""Limbs of a robot, their default end effectors, and the bodies off a chain, such as fingers or another arm."""

import re
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from maniport.arms.chain import PRISMATIC, Body, Joint
from maniport.errors import InvalidInputError, argument, nearest_first, unknown_name
from maniport.util.validation import Array

_SIDES = ("left", "right", "l", "r")
_WORDS = re.compile(r"[A-Z](?=[A-Z][a-z])|[A-Z]?[a-z]+|[A-Z]+")


@dataclass(frozen=True)
class Limb:
    """A chain from the base of a robot to one of its ends, without fingers."""

    tip: str  # the end effector's site, else the body that carries the gripper, else the outermost body
    joints: tuple[str, ...]  # with one axis, from the base
    fork: str | None  # last body shared with another of the longest limbs; None if it is fixed


def named_frames(model: pin.Model) -> dict[str, int]:
    """Map names of bodies and sites to indices; bodies have priority."""
    kinds = (pin.FrameType.BODY, pin.FrameType.OP_FRAME)
    names: dict[str, int] = {}
    for kind in kinds:
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
    scores = [_side_score((*limb.joints, limb.tip), side) for limb in longest]
    if scores.count(max(scores)) > 1:
        raise unknown_name("arm", robot, [limb.tip for limb in longest], f"(no limb is called {side})")
    return longest[scores.index(max(scores))]


class Limbs:
    """The limbs of a robot."""

    def __init__(
        self,
        model: pin.Model,
        names: Mapping[int, Sequence[str]],
        leaders: Mapping[str, str],
        wanted: Collection[str] = (),
    ):
        self.model, self.names, self.wanted = model, names, wanted
        self._beyond = dict.fromkeys(range(model.njoints), 0)
        self._below: dict[int, list[int]] = {j: [] for j in range(model.njoints)}
        for j in sorted(names, reverse=True):  # children follow their parents
            moving, parent = len(names[j]) + self._beyond[j], model.parents[j]
            if moving:
                self._below[parent].append(j)
                self._beyond[parent] = max(self._beyond[parent], moving)
        self._coupled = {leader for name, leader in leaders.items() if self._follows_other_branch(name, leader)}
        tops = (j for j in names if names[j] and not self._beyond[j])
        self.ends = list(dict.fromkeys(self._end(j) for j in tops))

    def all(self) -> list[Limb]:
        """Return all limbs, the longest first."""
        longest = max((len(self._joints(end)) for end in self.ends), default=0)
        equals = [end for end in self.ends if len(self._joints(end)) == longest]
        ends = sorted(self.ends, key=lambda end: -len(self._joints(end)))
        return [Limb(self.tip(end), self._joints(end), self._fork(end, equals)) for end in ends]

    def fingers(self) -> set[str]:
        """Return the names of the joints beyond all hands."""
        return {name for end in self.ends for j in self._all_below(end) for name in self.names[j]}

    def choose(self, source: str) -> str:
        """Choose the end of the limb with most of the wanted joints, or of most joints."""
        joints = {end: self._joints(end) for end in self.ends}
        size = {end: (sum(name in self.wanted for name in names), len(names)) for end, names in joints.items()}
        most = max(size.values(), default=(0, 0))
        ends = [end for end in self.ends if size[end] == most]
        if not ends:
            raise InvalidInputError(f"{source}: has no movable joint")
        shared = [j for j in self._path(ends[0]) if all(j in self.model.supports[end] for end in ends)]
        if len(ends) > 1 and most[0] and sum(name in self.wanted for j in shared for name in self.names[j]) == most[0]:
            ends = [max(j for j in shared if set(self.names[j]) & set(self.wanted))]
        if len(ends) > 1:
            candidates = nearest_first("hand", [self.tip(end) for end in ends])
            raise InvalidInputError(
                f"{source}: several frames end a chain of {most[1]} movable joints; choose one with "
                f"{argument('frame')}, such as {', '.join(map(repr, candidates[:12]))}"
            )
        return self.tip(ends[0])

    def tip(self, joint: int) -> str:
        """Return the end-effector site, else the body that carries all further joints, else the outermost body."""
        frames = named_frames(self.model)
        sites = [
            name
            for name, index in frames.items()
            if self.model.frames[index].type == pin.FrameType.OP_FRAME and self.model.frames[index].parentJoint == joint
        ]
        if marked := _with_usual_name(sites, ("pinch_site", "pinch", "attachment_site")):
            return marked
        carriers = {self._carrier(child) for child in self._below[joint]}
        if carriers:
            return self._common(carriers)
        leaves = self._leaves(joint)
        every = [str(self.model.frames[leaf].name) for leaf in leaves]
        usual = ("tool0", "tcp", "tool", "tool_center_point", "ee_link", "ee", "end_effector", "flange")
        return _with_usual_name(every, usual) or self._common(leaves)

    def _path(self, end: int) -> list[int]:
        return [j for j in self.model.supports[end] if j and self.names[j]]

    def _joints(self, end: int) -> tuple[str, ...]:
        return tuple(name for j in self._path(end) for name in self.names[j])

    def _end(self, joint: int) -> int:
        """Last joint of the limb with this outermost joint: before the hand, if it has one."""
        return next((j for j in self._path(joint) if self._is_hand(j)), joint)

    def _is_hand(self, joint: int) -> bool:
        fingers = [name for child in self._below[joint] for name in self.names[child]]
        if not 0 < self._beyond[joint] < len(self._joints(joint)):
            return False
        if any(name in self.wanted for j in self._all_below(joint) for name in self.names[j]):
            return False
        return len(self._below[joint]) > 1 or any(name in self._coupled or _is_finger(name) for name in fingers)

    def _all_below(self, joint: int) -> Iterable[int]:
        for child in self._below[joint]:
            yield child
            yield from self._all_below(child)

    def _follows_other_branch(self, follower: str, leader: str) -> bool:
        """Whether a joint follows a joint that is not one of its ancestors."""
        joints = {name: j for j, names in self.names.items() for name in names}
        if leader not in joints:
            return False
        if follower in joints:
            place = joints[follower]
        elif self.model.existFrame(follower):  # a fixed joint with a mimic
            place = self.model.frames[self.model.getFrameId(follower)].parentJoint
        else:
            return False
        return joints[leader] not in self.model.supports[place]

    def _fork(self, end: int, others: Sequence[int]) -> str | None:
        """The body of the last joint that a limb shares with others."""
        shared = [j for j in self._path(end) for other in others if other != end and j in self.model.supports[other]]
        if not shared:
            return None
        bodies = (f for f in self.model.frames if f.type == pin.FrameType.BODY and f.parentJoint == max(shared))
        return next((str(body.name) for body in bodies), None)

    def _carrier(self, joint: int) -> int:
        """The body that a joint is attached to."""
        return body_above(self.model, self.model.getFrameId(self.model.names[joint], pin.FrameType.JOINT))

    def _leaves(self, joint: int) -> list[int]:
        """Bodies on a joint that carry no further body on the same joint."""
        frames = self.model.frames
        bodies = [i for i, f in enumerate(frames) if f.type == pin.FrameType.BODY and f.parentJoint == joint]
        inner = {body_above(self.model, i) for i in bodies}
        return [i for i in bodies if i not in inner]

    def _common(self, bodies: Collection[int]) -> str:
        """Outermost common ancestor of bodies."""
        ancestors = []
        for body in bodies:
            line = [body]
            while line[-1]:
                line.append(body_above(self.model, line[-1]))
            ancestors.append(line)
        shared = next(body for body in ancestors[0] if all(body in line for line in ancestors))
        return str(self.model.frames[shared].name)


def _with_usual_name(names: Collection[str], usual: Sequence[str]) -> str | None:
    """The first name that equals or ends with a usual name, in the order of `usual`."""
    endings = [(name, f"_{name}", f"/{name}") for name in usual]
    return next((name for ending in endings for name in names if name == ending[0] or name.endswith(ending[1:])), None)


def _is_finger(name: str) -> bool:
    """Whether the name of a joint is that of a gripper: ``gripper_left_joint``, ``jointGripper``."""
    words = [word.lower() for word in _WORDS.findall(name)]
    words = [word for word in words if word not in ("joint", "link", *_SIDES)]
    return bool(words) and words[-1] in ("gripper", "finger", "thumb", "jaw", "claw", "knuckle")


def _side_score(names: Iterable[str], side: str) -> int:
    """Number of occurrences of one side, as ``left`` or ``l``, minus those of the other."""
    words = [word.lower() for name in names for word in _WORDS.findall(name)]
    return sum((word in (side, side[0])) - (word in _SIDES and word not in (side, side[0])) for word in words)


def bodies_off_chain(
    model: pin.Model,
    parts: Mapping[int, Sequence[Joint]],
    mounts: Mapping[int, tuple[int, Array]],
    fingers: Collection[str],
    resolve: Callable[[str], tuple[str | None, float, float]],
    bounds: Mapping[str, tuple[float, float]],
) -> dict[str, Body]:
    """Compute the poses of bodies off a chain relative to the joints of the chain."""
    bodies = {}
    frames = [frame for frame in model.frames if frame.type == pin.FrameType.BODY]
    names = {frame.parentJoint: frame.name for frame in reversed(frames)}
    for frame in frames:
        support = list(model.supports[frame.parentJoint])
        path = [j for j in support if j not in mounts]
        if path:
            count, rest = mounts[support[len(support) - len(path) - 1]]
            poses = _poses(path, model, parts, resolve, bounds)
            finger = next((j for j in path if any(part.name in fingers for part in parts[j])), None)
            group = frame.name if finger is None else names.get(finger, frame.name)
            bodies[str(frame.name)] = Body(count, rest @ poses @ frame.placement.homogeneous, str(group))
    return bodies


def _poses(
    path: Sequence[int],
    model: pin.Model,
    parts: Mapping[int, Sequence[Joint]],
    resolve: Callable[[str], tuple[str | None, float, float]],
    bounds: Mapping[str, tuple[float, float]],
) -> Array:
    """Poses of the last joint of a path relative to the mount of the first, shape (k, 4, 4); k is at most 512."""
    rules = {part.name: resolve(part.name) for j in path for part in parts[j]}
    slides = {
        leader: all(part.kind == PRISMATIC for j in path for part in parts[j] if rules[part.name][0] == leader)
        for leader, _, _ in rules.values() if leader is not None
    }  # fmt: skip
    spans = {leader: np.ptp(bounds[leader]) for leader in slides}
    counts = {  # steps of 0.4 rad cut arcs by 2 % of their radius
        leader: 1 if not np.isfinite(span) else 2 if slides[leader] else 2 + int(span / 0.4)
        for leader, span in spans.items()
    }
    while np.prod(list(counts.values())) > 512:
        most = max(counts, key=lambda leader: counts[leader])
        counts[most] -= 1
    grids = [np.linspace(*bounds[leader], n) if n > 1 else np.zeros(1) for leader, n in counts.items()]
    at = dict(zip(counts, (grid.ravel() for grid in np.meshgrid(*grids, indexing="ij")), strict=True))
    poses = np.broadcast_to(np.eye(4), (int(np.prod([len(grid) for grid in grids])), 4, 4))
    for j in path:
        if not parts[j]:
            poses = poses @ model.jointPlacements[j].homogeneous
        for part in parts[j]:
            leader, factor, offset = rules[part.name]
            positions = np.full(len(poses), offset) if leader is None else factor * at[leader] + offset
            poses = poses @ part.placement @ part.motion(positions)
    return np.asarray(poses)
