"""Chains from robot XML files that Pinocchio reads."""

from abc import abstractmethod
from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import ClassVar
from xml.etree import ElementTree

import numpy as np
import pinocchio as pin

from maniport.arms.chain import PRISMATIC, REVOLUTE, Chain, Frame, Joint, Shape, check_names
from maniport.arms.loaders.document import parsed
from maniport.arms.loaders.limbs import Limb, Limbs, bodies_off_chain, body_above, named_frames
from maniport.arms.meshes.mesh_paths import MeshPaths
from maniport.errors import FileFormatError, InvalidInputError, unknown_name
from maniport.util.input_limits import LINKS, SHAPES, TRIANGLES, require_at_most
from maniport.util.validation import MAX_POSITION, Array


@dataclass(frozen=True)
class Follower:
    """A joint whose position is ``factor · leader + offset``; without a leader it is constant."""

    leader: str | None
    factor: float
    offset: float
    linear: bool = True


@dataclass(frozen=True)
class RobotXML:
    """A robot file as XML, for the content that Pinocchio does not pass on."""

    path: Path
    text: str
    root: ElementTree.Element

    name: ClassVar[str]
    tag: ClassVar[str]  # the root element of such a file
    bounded: ClassVar[tuple[str, str]]  # tags of links and joints

    @classmethod
    def checked(cls, path: Path, text: str, root: ElementTree.Element) -> "RobotXML":
        """Check the text and the root of a file."""
        source = cls(path, text, root)
        for tag in cls.bounded:
            require_at_most(sum(1 for _ in root.iter(tag)), LINKS, f"elements <{tag}>", path)
        fault = source.fault() if root.tag == cls.tag else f"must have the root <{cls.tag}>; found <{root.tag}>"
        if fault:
            raise FileFormatError(f"{path}: {fault}")
        return source

    @abstractmethod
    def fault(self) -> str:
        """Describe the first inconsistency; empty without one."""

    @abstractmethod
    def build(self) -> pin.Model:
        """Read the kinematics with Pinocchio."""

    @abstractmethod
    def followers(self) -> Iterable[tuple[str, Follower]]:
        """Return the joints that follow others."""

    @abstractmethod
    def shapes(self, links: Collection[str], paths: MeshPaths) -> Iterable[Shape]:
        """Return the visual shapes of some links; `paths` finds their meshes."""

    def body_joints(self) -> dict[str, dict[str, ElementTree.Element]]:
        """Return the joints of each body, if bodies may have several: body name, then joint name."""
        return {}

    def joint_range(self, name: str) -> tuple[float, float] | None:
        """Return the range of a joint [rad] or [m] if Pinocchio's is wrong, else None."""
        return None


def read_chain(source: RobotXML, frame: str | None, joints: Sequence[str] | None) -> Chain:
    """Read the chain from a robot's base to one frame; see `maniport.load_arm`."""
    return _Reader(source).chain(frame, None if joints is None else check_names(joints, "joints"))


def read_limbs(source: RobotXML) -> list[Limb]:
    """Read the limbs of a robot, the longest first."""
    return _Reader(source).limbs().all()


def read_shapes(
    kind: type[RobotXML], path: Path, links: Collection[str], mesh_folders: Sequence[Path] = ()
) -> list[Shape]:
    """Read the visual shapes of some links; meshes of others may be missing."""
    shapes: list[Shape] = []
    triangles = 0
    for shape in kind.checked(path, *parsed(path)).shapes(links, MeshPaths(path, mesh_folders)):
        shapes.append(shape)
        triangles += len(shape.mesh[1])
        require_at_most(triangles, TRIANGLES, "triangles in its shapes", path)
        require_at_most(len(shapes), SHAPES, "shapes", path)
        if not np.all(np.abs(shape.mesh[0]) < MAX_POSITION):  # false for nan, too
            raise FileFormatError(f"{path}: a shape of link {shape.link!r} reaches farther than {MAX_POSITION:g} m")
    return shapes


class _Reader:
    """Extracts one chain from a Pinocchio model and the XML."""

    def __init__(self, source: RobotXML):
        self.source = source
        try:  # first, as Pinocchio does not name invalid numbers
            self.followers = dict(source.followers())
        except ValueError as error:
            raise FileFormatError(f"{source.path}: a mimic or equality has an invalid number: {error}") from None
        try:
            self.model = source.build()
        except (ValueError, RuntimeError, IndexError, TypeError) as error:
            raise FileFormatError(f"{source.path}: Pinocchio cannot read this {source.name}: {error}") from None
        self.bounds: dict[str, tuple[float, float]] = {}
        self.speeds: dict[str, float] = {}
        self.unlimited: list[str] = []
        self.closed: dict[str, tuple[float, float]] = {}
        self.parts = {j: self._split(j) for j in range(1, self.model.njoints)}

    def chain(self, frame: str | None, joints: tuple[str, ...] | None) -> Chain:
        """The chain from the base to a frame, by default the end effector of the given joints."""
        path = self.source.path
        for name in joints or ():
            if name not in self.bounds:
                raise unknown_name("joint", name, self.bounds, f"in '{path}'")
            if name in self.followers:
                leader = self.followers[name].leader
                raise InvalidInputError(f"joints: {name!r} in '{path}' cannot move by itself, it follows {leader!r}")
        frames = named_frames(self.model)
        if frame is None:
            frame = self.limbs(joints or ()).choose(str(path))
        elif frame not in frames:
            raise unknown_name("frame", frame, frames, f"in '{path}'")
        return self._full_chain(frame, frames)

    def limbs(self, wanted: Sequence[str] = ()) -> Limbs:
        """Limbs of the robot, without fingers unless these are in `wanted`."""
        names = {j: [part.name for part in parts] for j, parts in self.parts.items()}
        leaders = {name: follower.leader for name, follower in self.followers.items() if follower.leader is not None}
        return Limbs(self.model, names, leaders, wanted)

    def _full_chain(self, tip: str, frames: dict[str, int]) -> Chain:
        """The chain to a frame with all independent joints."""
        path = [j for j in self.model.supports[self.model.frames[frames[tip]].parentJoint] if j]
        joints: list[Joint] = []
        mounts = {0: (0, np.eye(4))}  # joint of the model: number of chain joints, remaining pose
        rest = np.eye(4)
        for j in path:
            parts = self.parts[j]
            if parts:
                joints += [replace(parts[0], placement=rest @ parts[0].placement), *parts[1:]]
                rest = np.eye(4)
            else:
                rest = rest @ self._fixed_placement(j)
            mounts[j] = len(joints), rest
        coordinates = [joint.name for joint in joints if joint.name not in self.followers]
        for name in coordinates:
            if name in self.closed:
                low, high = self.closed[name]
                raise FileFormatError(
                    f"{self.source.path}: joint {name!r} has the limits {low:g} to {high:g}; the first must be below "
                    "the second, or both zero if unknown"
                )
        coupling, offset = np.zeros((len(joints), len(coordinates))), np.zeros(len(joints))
        for row, joint in enumerate(joints):
            leader, factor, offset[row] = self._resolve(joint.name, coordinates)
            if leader is not None:
                coupling[row, coordinates.index(leader)] = factor
        fingers = self.limbs().fingers()
        resolve = partial(self._resolve, coordinates=[*coordinates, *fingers - self.followers.keys()])
        limits = np.array([self.bounds[name] for name in coordinates]).reshape(-1, 2)
        speeds = np.array([self.speeds[name] for name in coordinates])
        return Chain(
            name=self.model.name or self.source.path.stem,
            joints=tuple(joints),
            frames={name: self._mounted(i, mounts) for name, i in frames.items() if self._joint(i) in mounts},
            frame=tip,
            coordinates=tuple(coordinates),
            lower=limits[:, 0],
            upper=limits[:, 1],
            coupling=coupling,
            offset=offset,
            velocity_limits=speeds if np.any(np.isfinite(speeds)) else None,
            unlimited=tuple(self.unlimited),
            shapes=partial(read_shapes, type(self.source), self.source.path.absolute()),
            others=bodies_off_chain(self.model, self.parts, mounts, fingers, resolve, self.bounds),
        )

    def _joint(self, frame: int) -> int:
        return int(self.model.frames[frame].parentJoint)

    def _mounted(self, frame: int, mounts: dict[int, tuple[int, Array]]) -> Frame:
        count, rest = mounts[self._joint(frame)]
        above = body_above(self.model, frame)
        parent = str(self.model.frames[above].name) if above else None
        return Frame(count, rest @ self.model.frames[frame].placement.homogeneous, parent)

    def _split(self, j: int) -> list[Joint]:
        """The one-degree-of-freedom joints of a joint of the model; none for joints with more."""
        joint, placement = self.model.joints[j], self.model.jointPlacements[j].homogeneous
        if joint.shortname() != "JointModelComposite":
            single = self._single(joint, self.model.names[j], placement)
            return [] if single is None else [single]
        composite = joint.extract()
        parts = []
        for k, (sub, name) in enumerate(zip(composite.joints, self._composite_names(j), strict=True)):
            place = composite.jointPlacements[k].homogeneous
            part = self._single(sub, name, placement @ place if k == 0 else place)
            if part is None:
                raise FileFormatError(f"{self.source.path}: joint {name!r} shares its body and has no single axis")
            parts.append(part)
        return parts

    def _single(self, joint: pin.JointModel, name: str, placement: Array) -> Joint | None:
        """A joint with one axis, its limits and speed noted; None for other joints."""
        if joint.nv != 1:
            return None
        data = joint.createData()
        joint.calc(data, pin.neutral(self.model))
        linear, angular = np.split(np.asarray(data.S).reshape(6), 2)
        if np.any(linear) and np.any(angular):
            return None
        kind, axis = (PRISMATIC, linear) if np.any(linear) else (REVOLUTE, angular)
        bounds = self.source.joint_range(name)
        if bounds is None and joint.nq == 1:
            q = joint.idx_q
            bounds = float(self.model.lowerPositionLimit[q]), float(self.model.upperPositionLimit[q])
        elif bounds is None:  # a continuous joint is stored as cosine and sine
            bounds = -np.inf, np.inf
        huge = 100.0 if kind == PRISMATIC else 20 * np.pi  # what is larger means "no limit" [m or rad]
        if bounds[0] >= bounds[1] and any(bounds):
            self.closed[name] = bounds
        if not (-huge < bounds[0] < bounds[1] < huge):
            self.unlimited.append(name)
            bounds = (-np.inf, np.inf) if kind == PRISMATIC else (-np.pi, np.pi)
        speed = float(self.model.velocityLimit[joint.idx_v])
        self.bounds[name] = bounds
        self.speeds[name] = speed if 0 < speed < 1e6 else np.inf
        with np.errstate(invalid="ignore", divide="ignore", over="ignore"):  # `Joint` checks the axis
            direction = axis / np.linalg.norm(axis)
        return Joint(name, kind, direction, placement)

    def _composite_names(self, j: int) -> list[str]:
        """Names of the joints of one MJCF body, which Pinocchio merges into one without names."""
        count = len(self.model.joints[j].extract().joints)
        bodies = [f.name for f in self.model.frames if f.type == pin.FrameType.BODY and f.parentJoint == j]
        for body in bodies:
            names = list(self.source.body_joints().get(body, ()))
            if len(names) == count:
                return names
        raise FileFormatError(f"{self.source.path}: the {count} joints of {bodies or 'a body'} cannot be distinguished")

    def _fixed_placement(self, j: int) -> Array:
        """Pose of a floating base; an error for other joints without a single axis."""
        kind = self.model.joints[j].shortname()
        if kind != "JointModelFreeFlyer":
            raise FileFormatError(
                f"{self.source.path}: joint {self.model.names[j]!r} on the chain is of type "
                f"{kind.removeprefix('JointModel')}; only joints with one axis are supported"
            )
        return np.asarray(self.model.jointPlacements[j].homogeneous)

    def _resolve(self, name: str, coordinates: list[str]) -> tuple[str | None, float, float]:
        """Coordinate that moves a joint, factor and position at zero."""
        factor, offset, seen = 1.0, 0.0, set[str]()
        while (follower := self.followers.get(name)) is not None:
            offset += factor * follower.offset
            if follower.leader is None:
                return None, 0.0, offset
            if not follower.linear or follower.leader not in self.bounds or name in seen:
                fault = "nonlinearly" if not follower.linear else "which is no joint, or in a cycle"
                raise FileFormatError(f"{self.source.path}: joint {name!r} follows {follower.leader!r} {fault}")
            seen.add(name)
            factor, name = factor * follower.factor, follower.leader
        if name in coordinates:
            return name, factor, offset
        rest = float(np.clip(0.0, *self.bounds[name]))  # a joint off the chain is locked
        return None, 0.0, factor * rest + offset
