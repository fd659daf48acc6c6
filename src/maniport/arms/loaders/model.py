"""Robots as trees of bodies, as readers of robot files describe them, and their limbs with default end effectors."""

import re
import shlex
from collections import Counter
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from maniport.arms.chain import PRISMATIC, Chain, Joint
from maniport.arms.loaders.document import ShapeReader
from maniport.errors import (
    FileFormatError,
    InvalidInputError,
    argument,
    nearest_first,
    unknown_name,
)
from maniport.util.validation import Array

_SIDES = ("left", "right", "l", "r")
_FINGERS = ("finger", "fngr", "thumb", "knuckle", "jaw", "claw", "pincer")
_GRIPPERS = ("grip", "grasp", "clamp")
_HANDS = (*_GRIPPERS, "hand", "palm")
_FIXED_GRIPPERS = (
    *("grip", "gripper", "clamp", "suction", "vacuum", "magnet"),
    *("epick", "schunk", "robotiq", "onrobot"),
)
_TURNS = ("wrist", "elbow", "shoulder", "forearm", "yaw", "pitch", "roll", "rotat", "twist")
_ARMS = (*_FINGERS, *_HANDS, "arm", "wrist", "elbow", "shoulder", "tcp", "tool", "eef")
_LEGS = (
    "leg",
    "foot",
    "feet",
    "ankle",
    "toe",
    "sole",
    "hip",
    "knee",
    "thigh",
    "calf",
    "shin",
    "wheel",
)
_HEADS = ("head", "neck", "eye", "camera", "tail", "antenna")
"""Parts of words in names of joints and bodies; turns are joints that turn a gripper, rather than open it."""
_FILLERS = ("link", "frame", "body", "site", "point", "pose", *_SIDES)
_SENSORS = (
    *("camera", "optical", "sensor", "marker", "aruco", "apriltag", "lidar", "scanner", "light"),
    *("realsense", "kinect", "xtion", "rgbd"),
)
_SHORT_SENSORS = ("cam", "imu", "led", "ft", "ati", "rgb", "depth", "zed")
_CAMERA_MODEL = re.compile(r"(^|_)(d4[0-9]{2}[a-z]?|l515|sr300|t265|zed[0-9][a-z]*)(_|$)")
_NO_TOOLS = ("mount", "adapter", "changer", "cover", "collision")
_END_EFFECTOR_RANK = 3
_GRIPPER_RANK = 4  # of names of points of a gripper
_NO_RANK = 9  # of names that are not those of tool frames
_PINCH = ("pinch_site", "pinch")
_ATTACHMENT = ("attachment_site",)
_BEYOND = 0.01  # distance by which a tool frame beside a gripper must lie beyond it [m]
_SAME = 1e-6  # frames at this distance and rotation coincide [m], [-]


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
    remarks: dict[str, dict[str, str]] = field(default_factory=dict)  # as in `Chain`
    gravity: tuple[float, ...] = Chain.gravity  # in the frame of the root [m/s²]
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
        huge = 20 * np.pi  # what is larger means "no limit" [rad] or [m]
        free = (-np.pi, np.pi)
        if kind == PRISMATIC:
            huge = 100.0
            free = (-np.inf, np.inf)
        if bounds[0] >= bounds[1] and any(bounds):
            self.closed[name] = bounds
        if not (-huge < bounds[0] < bounds[1] < huge):
            self.unlimited.append(name)
            bounds = free
        self.bounds[name] = bounds
        self.speeds[name] = speed if 0 < speed < 1e6 else np.inf
        self.efforts[name] = effort if 0 < effort < 1e6 else np.inf
        # `Joint` checks the axis
        with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
            direction = axis / np.linalg.norm(axis)
        try:
            return Joint(name, kind, direction, placement, armature)
        except InvalidInputError as error:
            raise FileFormatError(f"{self.path}: {error}") from None

    def remark(self, kind: str, name: str, detail: str = "") -> None:
        """Note something about a joint or link for reports."""
        self.remarks.setdefault(kind, {})[name] = detail

    def line(self, body: str) -> list[str]:
        """Return a body and all bodies that carry it, the nearest first."""
        names = [body]
        parent = self.bodies[body].parent
        while parent is not None:
            names.append(parent)
            parent = self.bodies[parent].parent
        return names


@dataclass(frozen=True)
class Limb:
    """A chain from the base of a robot to one of its ends, without fingers."""

    frame: str  # end effector
    reason: str  # why it is that frame
    joints: tuple[str, ...]  # with one axis, from the base
    fork: str | None  # last body shared with another of the longest limbs; None if it is fixed
    is_leg: bool = False


def longest_limbs(limbs: Sequence[Limb]) -> list[Limb]:
    """Return the longest limbs, without legs if there are arms; those are first."""
    first = limbs[0]
    longest = []
    for limb in limbs:
        if limb.is_leg == first.is_leg and len(limb.joints) == len(first.joints):
            longest.append(limb)
    return longest


def one_side(limbs: Sequence[Limb], side: str, robot: str) -> Limb:
    """Return the limb of one side of a robot, among its longest limbs."""
    longest = longest_limbs(limbs)
    scores = []  # occurrences of one side, as "left" or "l", minus those of the other
    for limb in longest:
        score = 0
        for name in (*limb.joints, limb.frame):
            for word in _words(name):
                if word in (side, side[0]):
                    score += 1
                elif word in _SIDES:
                    score -= 1
        scores.append(score)
    if scores.count(max(scores)) > 1:
        raise unknown_name(
            "arm", robot, [limb.frame for limb in longest], f"(no limb is called {side})"
        )
    return longest[scores.index(max(scores))]


class Limbs:
    """The limbs of a robot, by the last moving body of each; fingers are no limbs unless their joints are `wanted`."""

    def __init__(self, model: RobotModel, wanted: Collection[str] = ()):
        self.model = model
        self._wanted = set(wanted)
        self._paths: dict[str, list[RobotBody]] = {}  # to each body: the bodies with joints
        self._below: dict[str, list[RobotBody]] = {}  # the next bodies with joints
        self._connect()
        moving = [body for body in model.bodies.values() if body.joints]
        self._count_beyond = {body.name: 0 for body in moving}  # most joints beyond each in a row
        for body in reversed(moving):
            for child in self._below[body.name]:
                count = len(child.joints) + self._count_beyond[child.name]
                self._count_beyond[body.name] = max(self._count_beyond[body.name], count)
        self._leaders = self._leaders_of_branches()

        ends = dict[str, None]()
        for body in moving:
            if not self._count_beyond[body.name]:
                ends[self._end_of(self._paths[body.name]).name] = None
        self._ends = list(ends)
        self._tools = {end: self._tool(end) for end in self._ends}
        kinds = {end: self._kind(end) for end in self._ends}
        self._legs: set[str] = set()  # ends of legs, if there are arms
        if "arm" in kinds.values():
            self._legs = {end for end in self._ends if kinds[end] == "leg"}

    def _connect(self) -> None:
        """Find the bodies with joints above and below each body."""
        for body in self.model.bodies.values():
            above = [] if body.parent is None else self._paths[body.parent]
            self._paths[body.name] = above
            self._below[body.name] = []
            if body.joints:
                self._paths[body.name] = [*above, body]
                if above:
                    self._below[above[-1].name].append(body)

    def _leaders_of_branches(self) -> set[str]:
        """Return joints that joints on other branches follow, such as those of the other finger."""
        bodies = {}  # by the joints above them
        for body in self.model.bodies.values():
            for name in body.welds:
                bodies[name] = body.name
        for body in self.model.bodies.values():
            for joint in body.joints:
                bodies[joint.name] = body.name
        leaders = set[str]()
        for name, rule in self.model.followers.items():
            if rule.leader is None or rule.leader not in bodies or name not in bodies:
                continue
            path = self._paths[bodies[name]]
            if bodies[rule.leader] not in [body.name for body in path]:
                leaders.add(rule.leader)
        return leaders

    def _end_of(self, path: Sequence[RobotBody]) -> RobotBody:
        """Return the first hand on a path, or its last body."""
        for body in path:
            if self._is_hand(body):
                return body
        return path[-1]

    def _is_hand(self, body: RobotBody) -> bool:
        """Whether a body carries fingers of which no joint is wanted."""
        if not 0 < self._count_beyond[body.name] < len(self._joints(body.name)):
            return False
        if self._beyond(body.name) & self._wanted:
            return False
        below = self._below[body.name]
        return len(below) > 1 or self._opens(body, below[0])

    def all(self) -> list[Limb]:
        """Return all limbs, arms before legs, the longest first."""
        joints = {end: self._joints(end) for end in self._ends}
        ends = sorted(self._ends, key=lambda end: (end in self._legs, -len(joints[end])))
        arms = [end for end in ends if end not in self._legs]
        longest = [end for end in arms if len(joints[end]) == len(joints[arms[0]])]
        limbs = []
        for end in ends:
            others = set()
            for other in longest:
                if other != end:
                    for body in self._paths[other]:
                        others.add(id(body))
            shared = [body.name for body in self._paths[end] if id(body) in others]
            frame, reason = self._tools[end]
            if shared:
                fork = shared[-1]
            else:
                fork = None
            limbs.append(Limb(frame, reason, joints[end], fork, end in self._legs))
        return limbs

    def fingers(self) -> set[str]:
        """Return the names of the joints beyond all hands."""
        return set[str]().union(*(self._beyond(end) for end in self._ends))

    def choose(self) -> str:
        """Choose the end of the limb with most of the wanted joints, or of most joints."""
        source = self.model.path
        counts = {}  # of wanted joints, and of all
        for end in self._ends:
            if self._wanted or end not in self._legs:
                joints = self._joints(end)
                counts[end] = (len(self._wanted.intersection(joints)), len(joints))
        most = max(counts.values(), default=(0, 0))
        ends = [end for end, count in counts.items() if count == most]
        if not ends:
            raise InvalidInputError(f"{source}: has no movable joint")
        if len(ends) > 1:
            trunk = self._last_wanted(ends, most[0])
            if trunk is not None:
                return self._tool(trunk)[0]
            candidates = nearest_first("hand", [self._tools[end][0] for end in ends])
            raise InvalidInputError(
                f"{source}: several frames end a chain of {most[1]} movable joints; choose one with "
                f"{argument('frame')}, such as {', '.join(map(repr, candidates[:12]))}; "
                f"maniport info {shlex.quote(str(source))} lists all ends"
            )
        return self._tools[ends[0]][0]

    def _last_wanted(self, ends: Sequence[str], count: int) -> str | None:
        """Return the last body with wanted joints if limbs share all `count` of them, else None."""
        last = None
        wanted_count = 0
        for body in self._paths[ends[0]]:
            if not all(body in self._paths[end] for end in ends):
                continue
            wanted = [joint for joint in body.joints if joint.name in self._wanted]
            wanted_count += len(wanted)
            if wanted:
                last = body.name
        if wanted_count == count:
            return last
        return None

    def _tool(self, end: str) -> tuple[str, str]:
        """Return the end effector of a moving body, and why it is that frame."""
        rigid = [name for name, path in self._paths.items() if path and path[-1].name == end]
        sites = self._sites_on(rigid)
        marked = _with_usual_name(sites, _PINCH)
        if marked:
            return marked, "the site between the fingers"

        poses = self._poses(end, rigid)
        outermost = self._outermost(end, rigid)
        carriers = {str(child.parent) for child in self._below[end]}
        if carriers:
            return self._tool_of_hand(self._common(carriers), outermost, sites, poses)
        gripper = self._fixed_gripper(end, outermost, sites)
        if gripper is not None:
            return self._tool_of_gripper(gripper, outermost, sites, poses)
        marked = _with_usual_name(sites, _ATTACHMENT)
        if marked:
            return marked, "the site for tools"

        link = self._common(outermost)
        tools = _tool_frames(link, outermost, sites, poses)
        if tools:
            tool = _best_tool(tools, poses)
            is_named = _tool_rank(link) <= _tool_rank(tool)
            return link if is_named else tool, "a fixed tool frame"
        marked = _with_usual_name(outermost, ("flange",))
        if marked:
            return marked, "the flange"
        return link, "the outermost link"

    def _tool_of_hand(
        self,
        hand: str,
        outermost: Sequence[str],
        sites: Sequence[str],
        poses: Mapping[str, Array],
    ) -> tuple[str, str]:
        """Return the end effector of a body that carries fingers, and why it is that frame."""
        tools = []
        for name in _tool_frames(hand, outermost, sites, poses):
            if self._is_beyond(name, hand, poses):
                tools.append(name)
        if tools:
            return _best_tool(tools, poses), f"a fixed tool frame of {hand!r}"
        marked = _with_usual_name(sites, _ATTACHMENT)
        if marked:
            return marked, "the site for tools"
        return hand, "the link that carries the gripper"

    def _fixed_gripper(
        self, end: str, outermost: Sequence[str], sites: Sequence[str]
    ) -> str | None:
        """Return the gripper without joints that is beside a tool frame or flange, if there is one.

        Tool frames are bodies at the end or sites; that on the gripper itself is not beside it.
        """
        if _is_fixed_gripper(end):  # all bodies of the robot may have that prefix
            return None
        on_grippers = []
        others = []
        for name in (*outermost, *sites):
            line = self.model.line(self._owner(name))
            carriers = line[: line.index(end)]
            if any(_is_fixed_gripper(carrier) for carrier in carriers):
                on_grippers.append(name)
            else:
                others.append(name)
        ends = [name for name in outermost if name in on_grippers]
        if not ends or not any(_is_flange(name) for name in others):
            return None
        common = self.model.line(self._common(ends))
        carriers = [name for name in common[: common.index(end)] if _is_fixed_gripper(name)]
        if carriers:
            return carriers[-1]
        return None

    def _tool_of_gripper(
        self,
        gripper: str,
        outermost: Sequence[str],
        sites: Sequence[str],
        poses: Mapping[str, Array],
    ) -> tuple[str, str]:
        """Return the end effector of a gripper without joints, and why it is that frame."""
        own_sites = [site for site in sites if gripper in self.model.line(self._owner(site))]
        marked = _with_usual_name(own_sites, _ATTACHMENT)
        if marked:
            return marked, "the site for tools"
        tools = []
        for name in (*outermost, *sites):
            is_tool = _tool_rank(name) < _NO_RANK and name != gripper
            if is_tool and self._is_beyond(name, gripper, poses):
                tools.append(name)
        if tools:
            return _best_tool(tools, poses), f"a fixed tool frame of {gripper!r}"
        ends = [name for name in outermost if gripper in self.model.line(name)]
        return self._common(ends), "the gripper"

    def _outermost(self, end: str, rigid: Sequence[str]) -> list[str]:
        """Return the bodies rigid with a moving one that carry no others; sensors at the ends do not count."""
        carried = Counter(body.parent for body in self.model.bodies.values())
        outermost = []
        for name in reversed(rigid):  # children first
            if carried[name]:
                continue
            if name != end and _is_sensor(name):
                carried[self.model.bodies[name].parent] -= 1
            else:
                outermost.append(name)
        return outermost[::-1]

    def _sites_on(self, bodies: Collection[str]) -> list[str]:
        """Return the sites on bodies, without those that have the name of a body."""
        sites = []
        for site, (body, _) in self.model.sites.items():
            if body in bodies and site not in self.model.bodies:
                sites.append(site)
        return sites

    def _common(self, names: Iterable[str]) -> str:
        """Return the outermost body that carries all bodies of some names, or is one of them."""
        common = list[str]()
        for i, name in enumerate(names):
            line = self.model.line(name)
            common = [body for body in common if body in line] if i else line
        return common[0]

    def _poses(self, end: str, rigid: Sequence[str]) -> dict[str, Array]:
        """Poses (4, 4) of bodies and sites in the frame of the moving body that they are rigid with."""
        poses = {end: np.eye(4)}
        for name in rigid:  # parents first
            body = self.model.bodies[name]
            if name != end:
                poses[name] = poses[str(body.parent)] @ body.placement
        for site in self._sites_on(rigid):
            owner, placement = self.model.sites[site]
            poses[site] = poses[owner] @ placement
        return poses

    def _is_beyond(self, name: str, hand: str, poses: Mapping[str, Array]) -> bool:
        """Whether a frame is fixed to the hand, or lies beyond it; an older tool frame on the flange does not."""
        if hand in self.model.line(self._owner(name)):
            return True
        distance = np.linalg.norm(poses[name][:3, 3]) - np.linalg.norm(poses[hand][:3, 3])
        return bool(distance > _BEYOND)

    def _owner(self, name: str) -> str:
        """Return the body of a site, or the body itself."""
        if name in self.model.bodies:
            return name
        return self.model.sites[name][0]

    def _opens(self, body: RobotBody, moved: RobotBody) -> bool:
        """Whether the joints of a body below another one open a gripper."""
        # words of the first joint or body may be a prefix of all of them
        first = self._paths[body.name][0]
        joint_words = _Words.without_those_of(first.joints[0].name)
        body_words = _Words.without_those_of(first.name)
        for joint in moved.joints:
            # branches beyond, whose joints follow this one
            followed = set()
            for child in self._below[moved.name]:
                for other in child.joints:
                    if self._leader(other.name) == joint.name:
                        followed.add(child.name)
            if joint.name in self._leaders or len(followed) > 1:
                return True
            if _has(joint.name, joint_words.fingers):
                return True
            if _has(joint.name, _TURNS):
                continue
            if _has(joint.name, joint_words.grippers) or _has(moved.name, body_words.fingers):
                return True
            if self._grips(body, moved, body_words, slides=joint.kind == PRISMATIC):
                return True
        return False

    def _grips(self, body: RobotBody, moved: RobotBody, words: "_Words", slides: bool) -> bool:
        """Whether a body below another one is a part of a gripper or hand that opens, by the names of bodies.

        The body of a wrist may be called gripper: its name counts where the joint slides, or is carried by a hand. It
        may be called hand: that counts where it is the last, and fixed bodies of a hand carry it.
        """
        if _has(moved.name, words.grippers):
            rigid = [name for name, path in self._paths.items() if path and path[-1] is body]
            return slides or any(_has(name, _HANDS) for name in rigid)
        if self._below[moved.name] or not _has(moved.name, words.hands) or _has(moved.name, _TURNS):
            return False
        line = self.model.line(moved.name)
        carriers = line[1 : line.index(body.name)]
        return any(_has(name, words.hands) and not _is_no_tool(name) for name in carriers)

    def _leader(self, name: str) -> str | None:
        """Return the joint that another one follows."""
        rule = self.model.followers.get(name)
        if rule is None:
            return None
        return rule.leader

    def _kind(self, end: str) -> str:
        """Return whether a limb is an "arm", a "leg" or "" by its names; three joints without names are an arm."""
        joints = self._joints(end)
        names = (self._tools[end][0], end, *joints)
        is_leg = any(_has(name, _LEGS) for name in names)
        is_arm = any(_has(name, _ARMS) for name in names)
        if is_leg and (not is_arm or _has(names[0], _LEGS)):
            return "leg"
        if is_arm:
            return "arm"
        is_other = any(_has(name, _HEADS) for name in names)
        if len(joints) > 2 and not is_other:
            return "arm"
        return ""

    def _joints(self, end: str) -> tuple[str, ...]:
        names = list[str]()
        for body in self._paths[end]:
            names += [joint.name for joint in body.joints]
        return tuple(names)

    def _beyond(self, end: str) -> set[str]:
        """Names of the joints beyond a body."""
        names = set[str]()
        waiting = list(self._below[end])
        while waiting:
            body = waiting.pop()
            names.update(joint.name for joint in body.joints)
            waiting += self._below[body.name]
        return names


def _with_usual_name(names: Collection[str], usual: Sequence[str]) -> str | None:
    """Return the first name that equals or ends with a usual name, in the order of `usual`."""
    for end in usual:
        for name in names:
            if name == end or name.endswith((f"_{end}", f"/{end}")):
                return name
    return None


def _words(name: str) -> list[str]:
    return [word.lower() for word in re.findall(r"[A-Z](?=[A-Z][a-z])|[A-Z]?[a-z]+|[A-Z]+", name)]


def _has(name: str, parts: Collection[str]) -> bool:
    """Whether a word of a name begins or ends with one of some parts."""
    ends = tuple(parts)
    return any(word.startswith(ends) or word.endswith(ends) for word in _words(name))


@dataclass(frozen=True)
class _Words:
    """Parts of words in names of joints and bodies of grippers."""

    fingers: Sequence[str]
    grippers: Sequence[str]
    hands: Sequence[str]

    @classmethod
    def without_those_of(cls, name: str) -> "_Words":
        """Return the words that do not occur in a name."""
        lists = []
        for parts in (_FINGERS, _GRIPPERS, _HANDS):
            lists.append([part for part in parts if not _has(name, (part,))])
        return cls(*lists)


def _is_no_tool(name: str) -> bool:
    """Whether the name of a body is that of a mount or cover of a tool."""
    return any(word.startswith(_NO_TOOLS) for word in _words(name))


def _is_fixed_gripper(name: str) -> bool:
    """Whether the name of a body is that of a gripper or hand, rather than of its mount or tool frame."""
    if _is_sensor(name) or _is_no_tool(name):
        return False
    if _tool_rank(name) not in (_GRIPPER_RANK, _NO_RANK):
        return False
    return _has(name, _FIXED_GRIPPERS) or any(word.endswith("hand") for word in _words(name))


def _is_sensor(name: str) -> bool:
    """Whether the name of a body or site is that of a camera, another sensor or a marker."""
    words = _words(name)
    if any(word.startswith(_SENSORS) for word in words):
        return True
    if "tool" in words:  # it is fixed to the sensor
        return False
    if any(word in _SHORT_SENSORS for word in words) or {"force", "torque"} <= set(words):
        return True
    return _CAMERA_MODEL.search(name.lower()) is not None


def _tool_rank(name: str) -> int:
    """Return the rank of the name of a tool frame, the lowest first; `_NO_RANK` for other names."""
    words = _words(name)
    if _is_sensor(name) or _is_no_tool(name) or not {"x", "y", "z"}.isdisjoint(words):
        return _NO_RANK
    core = [word for word in words if word not in _FILLERS]
    text = "_".join(words)
    if "tcp" in core or re.search("tool_cent(er|re)", text):
        return 0
    if not core:
        return _rank_of_text(text)
    return min(_rank_of_words(core, text), _rank_of_text(text))


def _rank_of_words(core: Sequence[str], text: str) -> int:
    """Return the rank of the words of a tool, grasp or end effector, which `text` joins with the others."""
    if core[-1] in ("tool", "tooltip") or core[-2:] == ["tool", "tip"]:
        return 1
    if core[-1].startswith("grasp") or "grasp_center" in text:
        return 2
    if not {"ee", "eef", "eoat", "endeffector"}.isdisjoint(core):
        return _END_EFFECTOR_RANK
    return _NO_RANK


def _rank_of_text(text: str) -> int:
    """Return the rank of words that are joined by underscores, of end effectors and grippers."""
    if "end_effector" in text:
        return _END_EFFECTOR_RANK
    if re.search("grip(per)?_?(frame|center|centre|point|site|tip)", text):
        return _GRIPPER_RANK
    return _NO_RANK


def _tool_frames(
    link: str, outermost: Sequence[str], sites: Sequence[str], poses: Mapping[str, Array]
) -> list[str]:
    """Return bodies at the end and sites with names of tool frames; sites in the pose of the link are none."""
    tools = [name for name in outermost if _tool_rank(name) < _NO_RANK]
    for site in sites:
        if not _coincide(poses[site], poses[link]) and _tool_rank(site) < _NO_RANK:
            tools.append(site)
    return tools


def _is_flange(name: str) -> bool:
    """Whether the name of a body or site is that of a tool frame, flange or site for tools."""
    if _tool_rank(name) < _NO_RANK or "flange" in _words(name):
        return True
    return _with_usual_name([name], _ATTACHMENT) is not None


def _best_tool(tools: Sequence[str], poses: Mapping[str, Array]) -> str:
    """Return the tool frame with the best name, of several the farthest from the last joint."""
    distance = {name: float(np.linalg.norm(poses[name][:3, 3])) for name in tools}
    return min(tools, key=lambda name: (_tool_rank(name), -distance[name]))


def _coincide(first: Array, second: Array) -> bool:
    """Whether two poses (4, 4) are the same."""
    return bool(np.abs(first - second).max() < _SAME)
