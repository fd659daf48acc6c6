"""Robots as trees of bodies, as readers of robot files describe them, and their limbs with default end effectors."""

import re
from collections.abc import Collection, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from maniport.arms.chain import PRISMATIC, Joint
from maniport.arms.loaders.document import ShapeReader
from maniport.errors import InvalidInputError, argument, nearest_first, unknown_name
from maniport.util.validation import Array

_SIDES = ("left", "right", "l", "r")


@dataclass(frozen=True)
class Follower:
    """A joint whose position is ``factor · leader + offset``; without a leader it is constant."""

    leader: str | None
    factor: float
    offset: float
    linear: bool = True


@dataclass(frozen=True, eq=False)
class RobotBody:
    """A body, and the joints that move it against its parent."""

    name: str
    parent: str | None
    placement: Array  # its pose (4, 4) in the frame of the last of its joints, or of the parent without joints
    joints: tuple[Joint, ...] = ()  # the first is placed in the frame of the parent
    blocked: str = ""  # type of a joint with several axes, which is at rest
    inertia: Array | None = (
        None  # spatial inertia (6, 6) in its frame; None if only shapes determine it
    )
    welds: tuple[str, ...] = ()  # names of fixed joints, which files may declare as mimic joints


@dataclass(eq=False)
class RobotModel:
    """Bodies of a robot with a parent before its children, sites, and limits of all joints with one axis."""

    path: Path
    name: str
    shapes: ShapeReader
    bodies: dict[str, RobotBody] = field(default_factory=dict)
    sites: dict[str, tuple[str, Array]] = field(
        default_factory=dict
    )  # body, and the pose (4, 4) in its frame
    followers: dict[str, Follower] = field(default_factory=dict)
    bounds: dict[str, tuple[float, float]] = field(default_factory=dict)  # [rad] or [m]
    speeds: dict[str, float] = field(default_factory=dict)  # infinite where unknown
    efforts: dict[str, float] = field(default_factory=dict)  # infinite where unknown
    unlimited: list[str] = field(default_factory=list)
    closed: dict[str, tuple[float, float]] = field(
        default_factory=dict
    )  # limits that exclude all positions

    def joint(
        self,
        name: str,
        kind: str,
        axis: Array,
        placement: Array,
        bounds: tuple[float, float],
        speed: float = np.inf,
        effort: float = np.inf,
        armature: float = 0.0,
    ) -> Joint:
        """Make a joint with one axis and note its limits."""
        huge = (
            100.0 if kind == PRISMATIC else 20 * np.pi
        )  # what is larger means "no limit" [m or rad]
        if bounds[0] >= bounds[1] and any(bounds):
            self.closed[name] = bounds
        if not (-huge < bounds[0] < bounds[1] < huge):
            self.unlimited.append(name)
            bounds = (-np.inf, np.inf) if kind == PRISMATIC else (-np.pi, np.pi)
        self.bounds[name] = bounds
        self.speeds[name], self.efforts[name] = (
            limit if 0 < limit < 1e6 else np.inf for limit in (speed, effort)
        )
        with np.errstate(
            invalid="ignore", divide="ignore", over="ignore"
        ):  # `Joint` checks the axis
            return Joint(name, kind, axis / np.linalg.norm(axis), placement, armature)

    def line(self, body: str) -> list[str]:
        """Return a body and all bodies that carry it, the nearest first."""
        names = [body]
        while (parent := self.bodies[names[-1]].parent) is not None:
            names.append(parent)
        return names


@dataclass(frozen=True)
class Limb:
    """A chain from the base of a robot to one of its ends, without fingers."""

    frame: str  # the end effector's site, else the body that carries the gripper, else the outermost body
    joints: tuple[str, ...]  # with one axis, from the base
    fork: str | None  # last body shared with another of the longest limbs; None if it is fixed


def one_side(limbs: Sequence[Limb], side: str, robot: str) -> Limb:
    """Return the limb of one side of a robot, among its longest limbs."""
    longest = [limb for limb in limbs if len(limb.joints) == len(limbs[0].joints)]
    scores = []  # occurrences of one side, as "left" or "l", minus those of the other
    for limb in longest:
        words = [
            word for name in (*limb.joints, limb.frame) for word in _words(name) if word in _SIDES
        ]
        scores.append(sum(1 if word in (side, side[0]) else -1 for word in words))
    if scores.count(max(scores)) > 1:
        raise unknown_name(
            "arm", robot, [limb.frame for limb in longest], f"(no limb is called {side})"
        )
    return longest[scores.index(max(scores))]


class Limbs:
    """The limbs of a robot, by the last moving body of each; fingers are no limbs unless their joints are `wanted`."""

    def __init__(self, model: RobotModel, wanted: Collection[str] = ()):
        self.model, self._wanted = model, set(wanted)
        self._paths: dict[
            str, list[RobotBody]
        ] = {}  # bodies with joints from the base to each body
        self._below: dict[str, list[RobotBody]] = {
            name: [] for name in model.bodies
        }  # next moving bodies
        for body in model.bodies.values():
            above = [] if body.parent is None else self._paths[body.parent]
            self._paths[body.name] = [*above, body] if body.joints else above
            if above and body.joints:
                self._below[above[-1].name].append(body)
        moving = [body for body in model.bodies.values() if body.joints]
        beyond = {body.name: 0 for body in moving}  # largest number of moving joints beyond each
        for body in reversed(moving):
            for child in self._below[body.name]:
                beyond[body.name] = max(beyond[body.name], len(child.joints) + beyond[child.name])
        owners = {name: body.name for body in model.bodies.values() for name in body.welds}
        owners |= {joint.name: body.name for body in moving for joint in body.joints}
        coupled = {  # leaders of joints on other branches, such as the other finger
            rule.leader for name, rule in model.followers.items()
            if rule.leader in owners and name in owners
            and owners[rule.leader] not in [body.name for body in self._paths[owners[name]]]
        }  # fmt: skip

        def is_hand(body: RobotBody) -> bool:
            below = self._below[body.name]
            if (
                not 0 < beyond[body.name] < len(self._joints(body.name))
                or self._beyond(body.name) & self._wanted
            ):
                return False
            fingers = [joint.name for child in below for joint in child.joints]
            return len(below) > 1 or any(name in coupled or _is_finger(name) for name in fingers)

        tops = [self._paths[body.name] for body in moving if not beyond[body.name]]
        self._ends = list(
            dict.fromkeys(next(filter(is_hand, path), path[-1]).name for path in tops)
        )

    def all(self) -> list[Limb]:
        """Return all limbs, the longest first."""
        joints, limbs = {end: self._joints(end) for end in self._ends}, []
        longest = [end for end in joints if len(joints[end]) == max(map(len, joints.values()))]
        for end in sorted(self._ends, key=lambda end: -len(joints[end])):
            others = {id(body) for other in longest if other != end for body in self._paths[other]}
            shared = [body.name for body in self._paths[end] if id(body) in others]
            limbs.append(Limb(self.end_frame(end), joints[end], shared[-1] if shared else None))
        return limbs

    def fingers(self) -> set[str]:
        """Return the names of the joints beyond all hands."""
        return set[str]().union(*(self._beyond(end) for end in self._ends))

    def choose(self) -> str:
        """Choose the end of the limb with most of the wanted joints, or of most joints."""
        source, wanted = self.model.path, self._wanted
        size = {
            end: (len(wanted.intersection(self._joints(end))), len(self._joints(end)))
            for end in self._ends
        }
        most = max(size.values(), default=(0, 0))
        ends = [end for end in self._ends if size[end] == most]
        if not ends:
            raise InvalidInputError(f"{source}: has no movable joint")
        if len(ends) > 1 and most[0]:
            shared = [
                body
                for body in self._paths[ends[0]]
                if all(body in self._paths[end] for end in ends)
            ]
            chosen = [[joint.name in wanted for joint in body.joints] for body in shared]
            if sum(map(sum, chosen)) == most[0]:
                ends = [
                    [body.name for body, own in zip(shared, chosen, strict=True) if any(own)][-1]
                ]
        if len(ends) > 1:
            candidates = nearest_first("hand", [self.end_frame(end) for end in ends])
            raise InvalidInputError(
                f"{source}: several frames end a chain of {most[1]} movable joints; choose one with "
                f"{argument('frame')}, such as {', '.join(map(repr, candidates[:12]))}"
            )
        return self.end_frame(ends[0])

    def end_frame(self, end: str) -> str:
        """Return the end-effector site, else the body that carries all further joints, else the outermost body."""
        bodies, sites = self.model.bodies, self.model.sites
        rigid = [
            name for name, path in self._paths.items() if path and path[-1].name == end
        ]  # with that body
        on_end = [site for site, (body, _) in sites.items() if body in rigid and site not in bodies]
        if marked := _with_usual_name(on_end, ("pinch_site", "pinch", "attachment_site")):
            return marked
        tops = {str(child.parent) for child in self._below[end]}
        if not tops:
            tops = set(rigid) - {str(bodies[name].parent) for name in rigid}
            usual = (
                "tool0",
                "tcp",
                "tool",
                "tool_center_point",
                "ee_link",
                "ee",
                "end_effector",
                "flange",
            )
            if named := _with_usual_name([name for name in rigid if name in tops], usual):
                return named
        lines = [self.model.line(name) for name in tops]
        return next(name for name in lines[0] if all(name in line for line in lines))

    def _joints(self, end: str) -> tuple[str, ...]:
        return tuple(joint.name for body in self._paths[end] for joint in body.joints)

    def _beyond(self, end: str) -> set[str]:
        """Names of the joints beyond a body."""
        names, waiting = set[str](), list(self._below[end])
        while waiting:
            body = waiting.pop()
            names.update(joint.name for joint in body.joints)
            waiting += self._below[body.name]
        return names


def _with_usual_name(names: Collection[str], usual: Sequence[str]) -> str | None:
    """Return the first name that equals or ends with a usual name, in the order of `usual`."""
    return next(
        (
            name
            for end in usual
            for name in names
            if name == end or name.endswith((f"_{end}", f"/{end}"))
        ),
        None,
    )


def _words(name: str) -> list[str]:
    return [word.lower() for word in re.findall(r"[A-Z](?=[A-Z][a-z])|[A-Z]?[a-z]+|[A-Z]+", name)]


def _is_finger(name: str) -> bool:
    """Whether the name of a joint is that of a gripper: ``gripper_left_joint``, ``jointGripper``."""
    words = [word for word in _words(name) if word not in ("joint", "link", *_SIDES)]
    return bool(words) and words[-1] in ("gripper", "finger", "thumb", "jaw", "claw", "knuckle")
