"""Chains from robot XML files that Pinocchio reads."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from functools import partial

import numpy as np
import pinocchio as pin

from maniport.arms.chain import PRISMATIC, REVOLUTE, Body, Chain, Frame, Joint, check_names
from maniport.arms.loaders.document import RobotXML, read_shapes
from maniport.arms.loaders.limbs import Limbs, body_above, named_frames
from maniport.errors import FileFormatError, InvalidInputError, unknown_name
from maniport.util.validation import Array


class RobotModel:
    """A Pinocchio model of a robot file, with its joints of one degree of freedom."""

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
        self.efforts: dict[str, float] = {}
        self.unlimited: list[str] = []
        self.closed: dict[str, tuple[float, float]] = {}  # limits that exclude all positions
        self.parts = {j: self._split(j) for j in range(1, self.model.njoints)}  # empty for several degrees of freedom

    def limbs(self, wanted: Sequence[str] = ()) -> Limbs:
        """Return the limbs of the robot, without fingers unless these are in `wanted`."""
        names = {j: [part.name for part in parts] for j, parts in self.parts.items()}
        leaders = {name: follower.leader for name, follower in self.followers.items() if follower.leader is not None}
        return Limbs(self.model, names, leaders, wanted)

    def chain(self, end_frame: str | None, wanted: Sequence[str] | None) -> Chain:
        """Return the chain to a frame, by default the end effector of some joints; see `maniport.load_arm`."""
        path, model, frames = self.source.path, self.model, named_frames(self.model)
        wanted = () if wanted is None else check_names(wanted, "joints")
        for name in wanted:
            if name not in self.bounds:
                raise unknown_name("joint", name, self.bounds, f"in '{path}'")
            if name in self.followers:
                leader = self.followers[name].leader
                raise InvalidInputError(f"joints: {name!r} in '{path}' cannot move by itself, it follows {leader!r}")
        if end_frame is None:
            end_frame = self.limbs(wanted).choose(str(path))
        elif end_frame not in frames:
            raise unknown_name("frame", end_frame, frames, f"in '{path}'")
        joints: list[Joint] = []
        mounts = {0: (0, np.eye(4))}  # joint of the model: number of chain joints, remaining pose
        rest = np.eye(4)
        for j in model.supports[model.frames[frames[end_frame]].parentJoint]:
            if j and self.parts[j]:
                first, *others = self.parts[j]
                joints += [replace(first, placement=rest @ first.placement), *others]
                rest = np.eye(4)
            elif j:
                if (kind := model.joints[j].shortname()) != "JointModelFreeFlyer":
                    raise FileFormatError(
                        f"{path}: joint {model.names[j]!r} on the chain is of type {kind.removeprefix('JointModel')}; "
                        "only joints with one axis are supported"
                    )
                rest = rest @ model.jointPlacements[j].homogeneous
            mounts[j] = len(joints), rest
        coordinates = [joint.name for joint in joints if joint.name not in self.followers]
        for name in [name for name in coordinates if name in self.closed]:
            low, high = self.closed[name]
            raise FileFormatError(
                f"{path}: joint {name!r} has the limits {low:g} to {high:g}; the first must be below the second, or "
                "both zero if unknown"
            )
        coupling, offset = np.zeros((len(joints), len(coordinates))), np.zeros(len(joints))
        for row, joint in enumerate(joints):
            leader, factor, offset[row] = self._resolve(joint.name, coordinates)
            if leader is not None:
                coupling[row, coordinates.index(leader)] = factor
        on_chain = {}
        for name, i in frames.items():
            if (j := int(model.frames[i].parentJoint)) in mounts:
                (count, rest), above = mounts[j], body_above(model, i)
                parent = str(model.frames[above].name) if above else None
                on_chain[name] = Frame(count, rest @ model.frames[i].placement.homogeneous, parent)
        limits = np.array([self.bounds[name] for name in coordinates]).reshape(-1, 2)
        speeds, efforts = (np.array([of[name] for name in coordinates]) for of in (self.speeds, self.efforts))
        return Chain(
            name=model.name or path.stem,
            joints=tuple(joints),
            frames=on_chain,
            frame=end_frame,
            coordinates=tuple(coordinates),
            lower=limits[:, 0],
            upper=limits[:, 1],
            coupling=coupling,
            offset=offset,
            velocity_limits=speeds if np.any(np.isfinite(speeds)) else None,
            effort_limits=efforts if np.any(np.isfinite(efforts)) else None,
            inertia=self._inertia(mounts, len(joints)),
            unlimited=tuple(self.unlimited),
            shapes=partial(read_shapes, type(self.source), path.absolute()),
            others=self._bodies_off_chain(mounts, coordinates),
        )

    def _split(self, j: int) -> list[Joint]:
        """Return the one-degree-of-freedom joints of a model joint; none for joints with more."""
        joint, placement = self.model.joints[j], self.model.jointPlacements[j].homogeneous
        if joint.shortname() != "JointModelComposite":
            single = self._single(joint, self.model.names[j], placement)
            return [] if single is None else [single]
        composite = joint.extract()  # Pinocchio merges the joints of one MJCF body into one without names
        count, parts = len(composite.joints), list[Joint]()
        bodies = [f.name for f in self.model.frames if f.type == pin.FrameType.BODY and f.parentJoint == j]
        listed = [[*self.source.body_joints().get(body, ())] for body in bodies]
        names = next((names for names in listed if len(names) == count), None)
        if names is None:
            raise FileFormatError(f"{self.source.path}: the {count} joints of {bodies or 'a body'} are not distinct")
        for k, (sub, name) in enumerate(zip(composite.joints, names, strict=True)):
            place = composite.jointPlacements[k].homogeneous
            part = self._single(sub, name, placement @ place if k == 0 else place)
            if part is None:
                raise FileFormatError(f"{self.source.path}: joint {name!r} shares its body and has no single axis")
            parts.append(part)
        return parts

    def _single(self, joint: pin.JointModel, name: str, placement: Array) -> Joint | None:
        """Return a joint with one axis, its limits noted; None for other joints."""
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
        effort = self.source.effort_limit(name)
        effort = float(self.model.upperEffortLimit[joint.idx_v]) if effort is None else effort
        self.bounds[name], speed = bounds, float(self.model.velocityLimit[joint.idx_v])
        self.speeds[name], self.efforts[name] = (limit if 0 < limit < 1e6 else np.inf for limit in (speed, effort))
        with np.errstate(invalid="ignore", divide="ignore", over="ignore"):  # `Joint` checks the axis
            direction = axis / np.linalg.norm(axis)
        part = Joint(name, kind, direction, placement)
        return replace(part, placement=placement @ part.motion(-self.source.rest_position(name)))

    def _resolve(self, name: str, coordinates: Collection[str]) -> tuple[str | None, float, float]:
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

    def _inertia(self, mounts: Mapping[int, tuple[int, Array]], count: int) -> Array | None:
        """Spatial inertia of what the base and each joint carry, other joints at rest; None without all masses."""
        inertia, names = np.zeros((count + 1, 6, 6)), self.source.unweighed()
        unweighed = {f.parentJoint for f in self.model.frames if f.type == pin.FrameType.BODY and f.name in names}
        places = dict(mounts)
        for j, own in enumerate(self.model.inertias):  # parents come first
            if j not in places:
                carrier, pose = places[self.model.parents[j]]
                places[j] = carrier, pose @ self._poses([j], ())[0]
            carrier, pose = places[j]
            if carrier and j in unweighed:
                return None
            inertia[carrier] += pin.SE3(pose).act(own).matrix()
        return inertia if np.any(inertia[1:]) else None

    def _bodies_off_chain(self, mounts: Mapping[int, tuple[int, Array]], coordinates: Sequence[str]) -> dict[str, Body]:
        """Bodies off a chain, with their poses relative to the joints of the chain."""
        fingers, bodies = self.limbs().fingers(), {}
        moving = {*coordinates, *fingers - self.followers.keys()}
        frames = [frame for frame in self.model.frames if frame.type == pin.FrameType.BODY]
        names = {frame.parentJoint: frame.name for frame in reversed(frames)}
        for frame in frames:
            support = list(self.model.supports[frame.parentJoint])
            path = [j for j in support if j not in mounts]
            if path:
                count, rest = mounts[support[len(support) - len(path) - 1]]
                poses = rest @ self._poses(path, moving) @ frame.placement.homogeneous
                finger = next((j for j in path if any(part.name in fingers for part in self.parts[j])), None)
                group = frame.name if finger is None else names.get(finger, frame.name)
                bodies[str(frame.name)] = Body(count, poses, str(group))
        return bodies

    def _poses(self, path: Sequence[int], moving: Collection[str], most: int = 512) -> Array:
        """Poses of the last joint of a path relative to the mount of the first, shape (k, 4, 4) with k ≤ `most`."""
        rules = {part.name: self._resolve(part.name, moving) for j in path for part in self.parts[j]}
        counts = {}
        for name in dict.fromkeys(leader for leader, *_ in rules.values() if leader is not None):
            kinds = [part.kind for j in path for part in self.parts[j] if rules[part.name][0] == name]
            span = np.ptp(self.bounds[name])  # steps of 0.4 rad cut arcs by 2 % of their radius
            counts[name] = 1 if not np.isfinite(span) else 2 if {*kinds} == {PRISMATIC} else 2 + int(span / 0.4)
        while np.prod(list(counts.values())) > most:
            counts[max(counts, key=lambda leader: counts[leader])] -= 1
        grids = [np.linspace(*self.bounds[leader], n) if n > 1 else np.zeros(1) for leader, n in counts.items()]
        at = dict(zip(counts, (grid.ravel() for grid in np.meshgrid(*grids, indexing="ij")), strict=True))
        poses = np.broadcast_to(np.eye(4), (int(np.prod([len(grid) for grid in grids])), 4, 4))
        for j in path:
            if not self.parts[j]:
                poses = poses @ self.model.jointPlacements[j].homogeneous
            for part in self.parts[j]:
                leader, factor, offset = rules[part.name]
                positions = np.full(len(poses), offset) if leader is None else factor * at[leader] + offset
                poses = poses @ part.placement @ part.motion(positions)
        return np.asarray(poses)
