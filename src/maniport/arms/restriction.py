"""Derived chains: other end effector or base, locked joints, pose in a world, mirror image."""

from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

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
    held = check_lock(lock, wanted)
    if not isinstance(end_frame, str) or end_frame not in chain.frames:
        raise unknown_name("frame", end_frame, chain.frames, where)
    last = chain.frames[end_frame].joint
    first = 0
    if base is not None:
        reached = [name for name, place in chain.frames.items() if place.joint <= last]
        if not isinstance(base, str) or base not in reached:
            raise unknown_name(
                "base", base, reached, f"on the chain to the frame {end_frame!r} {where}"
            )
        first = chain.frames[base].joint
    part = _segment(chain, first, last, end_frame)
    if base is not None:
        placement = chain.frames[base].placement
        turn = (
            _resting_poses(chain)[first][:3, :3] @ placement[:3, :3]
        )  # gravity keeps its direction
        part = _expressed_in(part, np.asarray(np.linalg.inv(placement), dtype=np.float64), base)
        part = replace(
            part,
            gravity=tuple((turn.T @ chain.gravity).tolist()),
            on_base_plane=chain.on_base_plane and first == 0 and _is_on_plane(placement),
        )
    seen = "" if part.base is None else f", seen from {part.base!r}"
    for name in (*(wanted or ()), *held):
        if name not in chain.coordinates:
            raise unknown_name(
                "joint", name, chain.coordinates, f"on the chain to {chain.frame!r} {where}"
            )
        if name not in part.coordinates:
            if name in held:
                what = "lock"
            else:
                what = "joints"
            raise InvalidInputError(
                f"{what}: {name!r} does not move the frame {end_frame!r}{seen} {where}"
            )
    moving = np.array(
        [n not in held and (wanted is None or n in wanted) for n in part.coordinates], dtype=bool
    )
    if not np.any(moving):
        if part.coordinates:
            held_all = "; lock contains all"
        else:
            held_all = ""
        raise InvalidInputError(
            f"no movable joint lies between the base and the frame {end_frame!r}{seen} {where}{held_all}"
        )
    if np.all(moving):
        return part
    neutral = np.where(moving, 0.0, np.clip(0.0, part.lower, part.upper))
    locked = dict(part.locked)
    for i in np.flatnonzero(~moving):
        name = part.coordinates[i]
        if name in held:
            low, high = (
                float(np.clip(limit[i], -MAX_POSITION, MAX_POSITION))
                for limit in (part.lower, part.upper)
            )
            neutral[i] = as_number(
                held[name], f"lock: {name!r} [{part.units[i]}]", minimum=low, maximum=high
            )
        locked[name] = float(neutral[i])
    return replace(
        _with_coordinates(part, moving), offset=part.offset + part.coupling @ neutral, locked=locked
    )


def _is_on_plane(placement: Array) -> bool:
    """Whether a frame has the plane z = 0 of its base, upward."""
    return abs(float(placement[2, 3])) < 1e-3 and float(placement[2, 2]) > 0.999


def check_lock(lock: Any, joints: tuple[str, ...] | None) -> Mapping[str, float]:
    """Require a mapping of names to positions, without names in `joints`."""
    held = {} if lock is None else lock
    if not isinstance(held, Mapping) or not all(isinstance(name, str) for name in held):
        raise InvalidInputError(
            f"lock must map names of joints to positions, such as {{'lift': 0.2}}; found {lock!r}"
        )
    both = sorted(held.keys() & set(joints or ()))
    if both:
        raise InvalidInputError(
            f"a joint must be in joints or in lock, not in both; found {', '.join(both)}"
        )
    return held


def _segment(chain: Chain, first: int, last: int, end_frame: str) -> Chain:
    """Joints `first` to `last` of a chain, and the coordinates that move them."""
    others = chain.others
    inertia = chain.inertia
    poses = _resting_poses(chain)
    if inertia is not None:
        inertia = inertia[first : last + 1].copy()
        inertia[-1] += carried_inertia(chain, last)
    kept = {name: place for name, place in chain.frames.items() if first <= place.joint <= last}
    if others is not None:
        bodies = {
            n: Body(f.joint, f.placement[None], n) for n, f in chain.frames.items() if n not in kept
        } | {**others}
        others = {}
        for name, body in bodies.items():
            carrier = min(max(body.joint, first), last)
            others[name] = body.moved(
                carrier - first, np.linalg.inv(poses[carrier]) @ poses[body.joint]
            )
    segment = replace(
        chain,
        others=others,
        joints=chain.joints[first:last],
        frames={name: replace(place, joint=place.joint - first) for name, place in kept.items()},
        frame=end_frame,
        coupling=chain.coupling[first:last],
        offset=chain.offset[first:last],
        inertia=inertia,
    )
    return _with_coordinates(segment, np.any(segment.coupling != 0, axis=0))


def carried_inertia(chain: Chain, link: int) -> Array:
    """Spatial inertia (6, 6) of all links beyond a link, in their resting poses, about the origin of that link."""
    assert chain.inertia is not None
    poses = _resting_poses(chain)
    back = np.linalg.inv(poses[link])
    beyond = range(link + 1, len(poses))
    return np.asarray(
        sum((moved_inertia(chain.inertia[k], back @ poses[k]) for k in beyond), np.zeros((6, 6)))
    )


def _resting_poses(chain: Chain) -> list[Array]:
    """Poses of the links with coordinates at zero, or at the limit next to zero."""
    poses = [np.eye(4)]
    positions = chain.coupling @ np.clip(0.0, chain.lower, chain.upper) + chain.offset
    for joint, position in zip(chain.joints, positions, strict=True):
        poses.append(poses[-1] @ joint.placement @ joint.motion(position))
    return poses


def _with_coordinates(chain: Chain, kept: Array) -> Chain:
    """Return the chain with the coordinates in `kept` (dof,) only."""
    limits = {
        name: values[kept] for name in ("lower", "upper", "velocity_limits", "effort_limits")
        if (values := getattr(chain, name)) is not None
    }  # fmt: skip
    coordinates = tuple(name for name, keep in zip(chain.coordinates, kept, strict=True) if keep)
    return replace(chain, coupling=chain.coupling[:, kept], coordinates=coordinates, **limits)


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
    joints = [replace(joint, placement=where @ joint.placement) for joint in chain.joints[:1]]
    return replace(
        chain,
        base=base,
        joints=(*joints, *chain.joints[1:]),
        frames={
            name: place if place.joint else replace(place, placement=where @ place.placement)
            for name, place in chain.frames.items()
        },
        others=None if chain.others is None else {
            name: body if body.joint else body.moved(0, where) for name, body in chain.others.items()
        },
    )  # fmt: skip


_MIRROR = np.array([1.0, -1.0, 1.0, 1.0])
_MIRROR_TWIST = np.array([1.0, -1.0, 1.0, -1.0, 1.0, -1.0])  # of linear and angular velocities


def mirrored(chain: Chain) -> Chain:
    """Mirror an arm in the plane y = 0 of its base frame.

    With S = diag(1, −1, 1) every pose T becomes S T S. A rotation about an axis a becomes one about −S a by the same
    angle: equal joint angles of an arm and its mirror image are mirrored configurations, with ellipsoids M and S M S.
    """
    left = chain.side == LEFT

    def moved(poses: Array) -> Array:
        return np.asarray(
            _MIRROR[:, None] * poses * _MIRROR + 0.0
        )  # adding zero removes negative zeros

    return replace(
        chain,
        name=chain.name.removesuffix("_left") if left else f"{chain.name}_left",
        side=RIGHT if left else LEFT,
        joints=tuple(
            replace(
                joint,
                axis=(-1.0 if joint.kind == REVOLUTE else 1.0) * _MIRROR[:3] * joint.axis + 0.0,
                placement=moved(joint.placement),
            )
            for joint in chain.joints
        ),
        frames={name: replace(place, placement=moved(place.placement)) for name, place in chain.frames.items()},
        inertia=None if chain.inertia is None else chain.inertia * np.outer(_MIRROR_TWIST, _MIRROR_TWIST) + 0.0,
        gravity=tuple((_MIRROR[:3] * chain.gravity + 0.0).tolist()),
        others=chain.others and {
            name: replace(body, placements=moved(body.placements)) for name, body in chain.others.items()
        },
        base_pose=None if chain.base_pose is None else moved(chain.base_pose),
        shapes=None if chain.shapes is None else partial(_mirrored_shapes, chain.shapes),
        collision_shapes=chain.collision_shapes
        and partial(_mirrored_collision_shapes, chain.collision_shapes),
    )  # fmt: skip


def _mirrored_shapes(
    shapes: Callable[..., Iterable[Shape]], links: Collection[str], **options: Any
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
    shapes: Callable[..., CollisionShapes], links: Collection[str], **options: Any
) -> CollisionShapes:
    read = shapes(links, **options)
    return replace(read, shapes=_mirrored_shapes(lambda _: read.shapes, links))
