"""Derived chains: other end effector or base, locked joints, pose in a world, mirror image."""

from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from maniport.arms.chain import (
    LEFT,
    REVOLUTE,
    RIGHT,
    Body,
    Chain,
    CollisionShapes,
    Shape,
    check_names,
    moved_inertia,
)
from maniport.errors import InvalidInputError, unknown_name
from maniport.util.validation import MAX_POSITION, Array, as_number


def restrict(
    chain: Chain,
    frame: str | None = None,
    joints: Sequence[str] | None = None,
    base: str | None = None,
    lock: Mapping[str, float] | None = None,
) -> Chain:
    """Return a chain with another end effector or base, or with locked coordinates.

    Bodies and masses on omitted joints are attached to the nearest remaining link, in their pose at zero.
    """
    where = f"on the arm {chain.name!r}"
    end_frame = chain.frame if frame is None else frame
    wanted = None if joints is None else check_names(joints, "joints")
    positions = check_lock(lock, wanted)
    if not isinstance(end_frame, str) or end_frame not in chain.frames:
        raise unknown_name("frame", end_frame, chain.frames, where)
    last = chain.frames[end_frame].joint
    first = 0
    if base is not None:
        first = _joint_of_base(chain, base, end_frame)
    segment = _segment(chain, first, last, end_frame)
    if base is not None:
        segment = _seen_from(segment, chain, base)

    for name in wanted or ():
        _require_moving(name, "joints", segment, chain)
    for name in positions:
        _require_moving(name, "lock", segment, chain)
    moving = np.zeros(len(segment.coordinates), dtype=bool)
    for i, name in enumerate(segment.coordinates):
        moving[i] = name not in positions and (wanted is None or name in wanted)
    if not np.any(moving):
        all_locked = ""
        if segment.coordinates:
            all_locked = "; lock contains all"
        raise InvalidInputError(
            f"no movable joint lies between the base and the frame {end_frame!r}{_seen(segment)} {where}{all_locked}"
        )
    if np.all(moving):
        return segment
    return _locked(segment, moving, positions)


def _require_moving(name: str, argument: str, segment: Chain, chain: Chain) -> None:
    """Require that a coordinate in an argument moves the end effector of a segment of a chain."""
    where = f"on the arm {chain.name!r}"
    if name not in chain.coordinates:
        place = f"on the chain to {chain.frame!r} {where}"
        raise unknown_name("joint", name, chain.coordinates, place)
    if name not in segment.coordinates:
        raise InvalidInputError(
            f"{argument}: {name!r} does not move the frame {segment.frame!r}{_seen(segment)} {where}"
        )


def _seen(chain: Chain) -> str:
    """Name the base of a chain in a message if it is not the first frame of the description."""
    if chain.base is None:
        return ""
    return f", seen from {chain.base!r}"


def _joint_of_base(chain: Chain, base: str, end_frame: str) -> int:
    """Return the number of joints before a frame that is on the chain to an end effector."""
    last = chain.frames[end_frame].joint
    reached = [name for name, place in chain.frames.items() if place.joint <= last]
    if not isinstance(base, str) or base not in reached:
        where = f"on the chain to the frame {end_frame!r} on the arm {chain.name!r}"
        raise unknown_name("base", base, reached, where)
    return chain.frames[base].joint


def _seen_from(segment: Chain, chain: Chain, base: str) -> Chain:
    """Express a segment that begins with the link of a frame of the chain in that frame."""
    placement = chain.frames[base].placement
    first = chain.frames[base].joint
    # gravity keeps its direction
    turn = _resting_poses(chain)[first][:3, :3] @ placement[:3, :3]
    to_base = np.asarray(np.linalg.inv(placement), dtype=np.float64)
    return replace(
        _expressed_in(segment, to_base, base),
        gravity=tuple((turn.T @ chain.gravity).tolist()),
        on_base_plane=chain.on_base_plane and first == 0 and _is_on_plane(placement),
    )


def _locked(chain: Chain, moving: NDArray[np.bool_], positions: Mapping[str, float]) -> Chain:
    """Lock the other coordinates of a chain: at given positions by name, else at zero or the limit next to it."""
    neutral = np.where(moving, 0.0, np.clip(0.0, chain.lower, chain.upper))
    locked = dict(chain.locked)
    for i in np.flatnonzero(~moving):
        name = chain.coordinates[i]
        if name in positions:
            neutral[i] = as_number(
                positions[name],
                f"lock: {name!r} [{chain.units[i]}]",
                minimum=float(np.clip(chain.lower[i], -MAX_POSITION, MAX_POSITION)),
                maximum=float(np.clip(chain.upper[i], -MAX_POSITION, MAX_POSITION)),
            )
        locked[name] = float(neutral[i])
    offset = chain.offset + chain.coupling @ neutral
    return replace(_with_coordinates(chain, moving), offset=offset, locked=locked)


def _is_on_plane(placement: Array) -> bool:
    """Whether a frame has the plane z = 0 of its base, upward."""
    return abs(float(placement[2, 3])) < 1e-3 and float(placement[2, 2]) > 0.999


def check_lock(
    lock: Mapping[str, float] | None, joints: tuple[str, ...] | None
) -> Mapping[str, float]:
    """Require a mapping of names to positions, without names in `joints`."""
    positions = {} if lock is None else lock
    if not isinstance(positions, Mapping) or not all(isinstance(name, str) for name in positions):
        raise InvalidInputError(
            f"lock must map names of joints to positions, such as {{'lift': 0.2}}; found {lock!r}"
        )
    both = sorted(positions.keys() & set(joints or ()))
    if both:
        raise InvalidInputError(
            f"a joint must be in joints or in lock, not in both; found {', '.join(both)}"
        )
    return positions


def _segment(chain: Chain, first: int, last: int, end_frame: str) -> Chain:
    """Joints `first` to `last` of a chain, and the coordinates that move them."""
    inertia = chain.inertia
    if inertia is not None:
        inertia = inertia[first : last + 1].copy()
        inertia[-1] += carried_inertia(chain, last)
    frames = {}
    for name, frame in chain.frames.items():
        if first <= frame.joint <= last:
            frames[name] = replace(frame, joint=frame.joint - first)
    segment = replace(
        chain,
        others=_bodies_beside(chain, first, last),
        joints=chain.joints[first:last],
        frames=frames,
        frame=end_frame,
        coupling=chain.coupling[first:last],
        offset=chain.offset[first:last],
        inertia=inertia,
    )
    return _with_coordinates(segment, np.any(segment.coupling != 0, axis=0))


def _bodies_beside(chain: Chain, first: int, last: int) -> dict[str, Body] | None:
    """Attach the frames and bodies that are not on the links `first` to `last` to the nearest of these."""
    if chain.others is None:
        return None
    bodies = {}
    for name, frame in chain.frames.items():
        if not first <= frame.joint <= last:
            bodies[name] = Body(frame.joint, frame.placement[None], name)
    bodies |= chain.others

    poses = _resting_poses(chain)
    attached = {}
    for name, body in bodies.items():
        carrier = min(max(body.joint, first), last)
        transform = np.linalg.inv(poses[carrier]) @ poses[body.joint]
        attached[name] = body.moved(carrier - first, transform)
    return attached


def carried_inertia(chain: Chain, link: int) -> Array:
    """Spatial inertia (6, 6) of all links beyond a link, in their resting poses, about the origin of that link."""
    assert chain.inertia is not None
    poses = _resting_poses(chain)
    back = np.linalg.inv(poses[link])
    total = np.zeros((6, 6))
    for k in range(link + 1, len(poses)):
        total = total + moved_inertia(chain.inertia[k], back @ poses[k])
    return total


def _resting_poses(chain: Chain) -> list[Array]:
    """Poses of the links with coordinates at zero, or at the limit next to zero."""
    poses = [np.eye(4)]
    positions = chain.coupling @ np.clip(0.0, chain.lower, chain.upper) + chain.offset
    for joint, position in zip(chain.joints, positions, strict=True):
        poses.append(poses[-1] @ joint.placement @ joint.motion(position))
    return poses


def _with_coordinates(chain: Chain, kept: NDArray[np.bool_]) -> Chain:
    """Return the chain with the coordinates in `kept` (dof,) only."""
    velocity = chain.velocity_limits
    effort = chain.effort_limits
    return replace(
        chain,
        coupling=chain.coupling[:, kept],
        coordinates=tuple(chain.coordinates[i] for i in np.flatnonzero(kept)),
        lower=chain.lower[kept],
        upper=chain.upper[kept],
        velocity_limits=None if velocity is None else velocity[kept],
        effort_limits=None if effort is None else effort[kept],
    )


def standing(chain: Chain, where: Array) -> Chain:
    """Express a chain in a world, with its z axis up, in which its base has the pose `where`, shape (4, 4)."""
    return replace(
        _expressed_in(chain, where, "world"),
        base_pose=where if chain.base_pose is None else where @ chain.base_pose,
        gravity=Chain.gravity,
        on_base_plane=True,
    )


def _expressed_in(chain: Chain, where: Array, base: str) -> Chain:
    """Return the chain expressed in a frame in which its base has the pose `where`, shape (4, 4)."""
    joints = list(chain.joints)
    if joints:
        joints[0] = replace(joints[0], placement=where @ joints[0].placement)
    frames = dict(chain.frames)
    for name, frame in frames.items():
        if frame.joint == 0:
            frames[name] = replace(frame, placement=where @ frame.placement)
    others = None
    if chain.others is not None:
        others = dict(chain.others)
        for name, body in others.items():
            if body.joint == 0:
                others[name] = body.moved(0, where)
    return replace(chain, base=base, joints=tuple(joints), frames=frames, others=others)


_MIRROR = np.array([1.0, -1.0, 1.0, 1.0])
_MIRROR_TWIST = np.array([1.0, -1.0, 1.0, -1.0, 1.0, -1.0])  # of linear and angular velocities


def mirrored(chain: Chain) -> Chain:
    """Mirror an arm in the plane y = 0 of its base frame.

    With S = diag(1, −1, 1) every pose T becomes S T S. A rotation about an axis a becomes one about −S a by the same
    angle: equal joint angles of an arm and its mirror image are mirrored configurations, with ellipsoids M and S M S.
    """
    name = f"{chain.name}_left"
    side = LEFT
    if chain.side == LEFT:
        name = chain.name.removesuffix("_left")
        side = RIGHT

    joints = []
    for joint in chain.joints:
        sign = -1.0 if joint.kind == REVOLUTE else 1.0
        axis = sign * _MIRROR[:3] * joint.axis + 0.0
        joints.append(replace(joint, axis=axis, placement=_mirrored_poses(joint.placement)))
    frames = {}
    for frame_name, frame in chain.frames.items():
        frames[frame_name] = replace(frame, placement=_mirrored_poses(frame.placement))
    others = chain.others
    if others:
        others = dict(others)
        for body_name, body in others.items():
            others[body_name] = replace(body, placements=_mirrored_poses(body.placements))
    inertia = chain.inertia
    if inertia is not None:
        inertia = inertia * np.outer(_MIRROR_TWIST, _MIRROR_TWIST) + 0.0
    base_pose = chain.base_pose
    if base_pose is not None:
        base_pose = _mirrored_poses(base_pose)
    shapes = chain.shapes
    if shapes is not None:
        shapes = partial(_mirrored_shapes, shapes)
    collision_shapes = chain.collision_shapes
    if collision_shapes is not None:
        collision_shapes = partial(_mirrored_collision_shapes, collision_shapes)
    return replace(
        chain,
        name=name,
        side=side,
        joints=tuple(joints),
        frames=frames,
        inertia=inertia,
        gravity=tuple((_MIRROR[:3] * chain.gravity + 0.0).tolist()),
        others=others,
        base_pose=base_pose,
        shapes=shapes,
        collision_shapes=collision_shapes,
    )


def _mirrored_poses(poses: Array) -> Array:
    """Mirror poses (..., 4, 4) in the plane y = 0."""
    # adding zero removes negative zeros
    return np.asarray(_MIRROR[:, None] * poses * _MIRROR + 0.0)


def _mirrored_shapes(
    shapes: Callable[..., Iterable[Shape]], links: Collection[str], **options: object
) -> list[Shape]:
    """Mirrored shapes of links; reversed triangles keep their outside."""
    images = []
    for shape in shapes(links, **options):
        points, triangles = shape.mesh
        core = None if shape.core is None else shape.core * _MIRROR[:3]
        image = replace(shape, mesh=(points * _MIRROR[:3], triangles[:, ::-1]), core=core)
        images.append(image)
    return images


def _mirrored_collision_shapes(
    shapes: Callable[..., CollisionShapes], links: Collection[str], **options: object
) -> CollisionShapes:
    read = shapes(links, **options)
    return replace(read, shapes=_mirrored_shapes(lambda _: read.shapes, links))
