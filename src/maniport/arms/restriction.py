"""Derived chains: other end effector or base, locked joints, pose in a world, mirror image."""

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from maniport.arms.chain import LEFT, REVOLUTE, RIGHT, Body, Chain, Joint, Shape, check_names
from maniport.errors import InvalidInputError, unknown_name
from maniport.util.validation import MAX_POSITION, Array, as_number


def restrict(
    chain: Chain,
    frame: str | None = None,
    joints: Sequence[str] | None = None,
    base: str | None = None,
    lock: Mapping[str, float] | None = None,
) -> Chain:
    """Return a chain with another end effector or base, or with locked coordinates."""
    where = f"on the arm {chain.name!r}"
    wanted = None if joints is None else check_names(joints, "joints")
    held = check_lock(lock, wanted)
    for name in (*(wanted or ()), *held):
        if name not in chain.coordinates:
            raise unknown_name("joint", name, chain.coordinates, f"on the chain to {chain.frame!r} {where}")
    tip = chain.frame if frame is None else frame
    if not isinstance(tip, str) or tip not in chain.frames:
        raise unknown_name("frame", tip, chain.frames, where)
    part = _ending_at(chain, tip)
    if base is not None:
        if not isinstance(base, str) or base not in part.frames:
            raise unknown_name("base", base, part.frames, f"on the chain to the frame {tip!r} {where}")
        part = _starting_at(part, base)
    seen = "" if part.base is None else f", seen from {part.base!r}"
    for what, names in (("joints", wanted or ()), ("lock", held)):
        idle = [name for name in names if name not in part.coordinates]
        if idle:
            raise InvalidInputError(f"{what}: {idle[0]!r} does not move the frame {tip!r}{seen} {where}")
    moving = np.array([n not in held and (wanted is None or n in wanted) for n in part.coordinates], dtype=bool)
    if not np.any(moving):
        held_all = "; lock contains all" if part.coordinates else ""
        raise InvalidInputError(f"no movable joint lies between the base and the frame {tip!r}{seen} {where}{held_all}")
    return part if np.all(moving) else _locked(part, moving, held)


def check_lock(lock: Any, joints: tuple[str, ...] | None) -> Mapping[str, float]:
    """Require a mapping of names to positions, without names in `joints`."""
    held = {} if lock is None else lock
    if not isinstance(held, Mapping) or not all(isinstance(name, str) for name in held):
        raise InvalidInputError(f"lock must map names of joints to positions, such as {{'lift': 0.2}}; found {lock!r}")
    both = sorted(held.keys() & set(joints or ()))
    if both:
        raise InvalidInputError(f"a joint must be in joints or in lock, not in both; found {', '.join(both)}")
    return held


def _ending_at(chain: Chain, tip: str) -> Chain:
    """The joints of a chain up to an end effector, and the coordinates that move them."""
    count = chain.frames[tip].joint
    used = np.any(chain.coupling[:count] != 0, axis=0)
    beyond = {name for name, place in chain.frames.items() if place.joint > count}
    return replace(
        chain,
        others=_rigidly_attached(chain, beyond, lambda joint: min(joint, count)),
        joints=chain.joints[:count],
        frames={name: place for name, place in chain.frames.items() if place.joint <= count},
        frame=tip,
        coupling=chain.coupling[:count, used],
        offset=chain.offset[:count],
        **_coordinates(chain, used),
    )


def _rigidly_attached(chain: Chain, frames: set[str], carrier: Callable[[int], int]) -> dict[str, Body] | None:
    """Bodies off the chain and some frames, at rest, on the joint that `carrier` returns for their present one."""
    if chain.others is None:
        return None
    poses = chain.at_rest()
    bodies = {name: Body(chain.frames[name].joint, chain.frames[name].placement[None], name) for name in frames}
    return {
        name: body.moved(carrier(body.joint), np.linalg.inv(poses[carrier(body.joint)]) @ poses[body.joint])
        for name, body in (bodies | {**chain.others}).items()
    }


def standing(chain: Chain, where: Array) -> Chain:
    """Express a chain in a world in which its base has the pose `where`, shape (4, 4)."""
    return replace(_expressed_in(chain, where, "world"), stand=where if chain.stand is None else where @ chain.stand)


def _expressed_in(chain: Chain, where: Array, base: str) -> Chain:
    """The chain expressed in a frame in which its base has the pose `where`, shape (4, 4)."""
    return replace(
        chain,
        base=base,
        joints=tuple(
            replace(joint, placement=where @ joint.placement) if i == 0 else joint
            for i, joint in enumerate(chain.joints)
        ),
        frames={
            name: place if place.joint else replace(place, placement=where @ place.placement)
            for name, place in chain.frames.items()
        },
        others=None if chain.others is None else {
            name: body if body.joint else body.moved(0, where) for name, body in chain.others.items()
        },
    )  # fmt: skip


def _starting_at(chain: Chain, base: str) -> Chain:
    """The chain expressed in one of its frames, without the joints before it."""
    first, placement = chain.frames[base].joint, chain.frames[base].placement
    back = np.eye(4)
    back[:3, :3], back[:3, 3] = placement[:3, :3].T, -placement[:3, :3].T @ placement[:3, 3]
    others = _rigidly_attached(
        chain, {name for name, place in chain.frames.items() if place.joint < first}, lambda joint: max(joint, first)
    )
    begun = replace(
        chain,
        others=others and {name: replace(body, joint=body.joint - first) for name, body in others.items()},
        joints=chain.joints[first:],
        frames={
            name: replace(place, joint=place.joint - first)
            for name, place in chain.frames.items()
            if place.joint >= first
        },
        coupling=chain.coupling[first:],
        offset=chain.offset[first:],
    )
    return _ending_at(_expressed_in(begun, back, base), chain.frame)


def _locked(chain: Chain, moving: Array, lock: Mapping[str, float]) -> Chain:
    """The chain with locked coordinates, at the positions in `lock` or nearest to zero."""
    neutral = np.where(moving, 0.0, np.clip(0.0, chain.lower, chain.upper))
    for i, (name, unit) in enumerate(zip(chain.coordinates, chain.units, strict=True)):
        if name in lock:
            low, high = (float(np.clip(limit[i], -MAX_POSITION, MAX_POSITION)) for limit in (chain.lower, chain.upper))
            neutral[i] = as_number(lock[name], f"lock: {name!r} [{unit}]", minimum=low, maximum=high)
    held = {name: float(neutral[i]) for i, name in enumerate(chain.coordinates) if not moving[i]}
    return replace(
        chain,
        coupling=chain.coupling[:, moving],
        offset=chain.offset + chain.coupling @ neutral,
        locked={**chain.locked, **held},
        **_coordinates(chain, moving),
    )


def _coordinates(chain: Chain, kept: Array) -> dict[str, Any]:
    """Names and limits of the coordinates in `kept`."""
    return {
        "coordinates": tuple(name for name, keep in zip(chain.coordinates, kept, strict=True) if keep),
        "lower": chain.lower[kept],
        "upper": chain.upper[kept],
        "velocity_limits": None if chain.velocity_limits is None else chain.velocity_limits[kept],
    }


def mirrored(chain: Chain) -> Chain:
    """Mirror an arm in the plane y = 0 of its base frame.

    With S = diag(1, −1, 1) every pose T becomes S T S. A rotation about an axis a becomes one about −S a by the same
    angle: equal joint angles of an arm and its mirror image are mirrored configurations, with ellipsoids M and S M S.
    """
    left = chain.side == LEFT
    return replace(
        chain,
        name=chain.name.removesuffix("_left") if left else f"{chain.name}_left",
        side=RIGHT if left else LEFT,
        joints=tuple(_mirrored_joint(joint) for joint in chain.joints),
        frames={name: replace(place, placement=_mirrored(place.placement)) for name, place in chain.frames.items()},
        others=chain.others and {
            name: replace(body, placements=_mirrored(body.placements)) for name, body in chain.others.items()
        },
        stand=None if chain.stand is None else _mirrored(chain.stand),
        shapes=None if chain.shapes is None else partial(_mirrored_shapes, chain.shapes),
    )  # fmt: skip


_MIRROR = np.array([1.0, -1.0, 1.0])


def _mirrored_joint(joint: Joint) -> Joint:
    turn = -1.0 if joint.kind == REVOLUTE else 1.0
    return replace(joint, axis=turn * _MIRROR * joint.axis + 0.0, placement=_mirrored(joint.placement))


def _mirrored(placements: Array) -> Array:
    """Mirror poses (..., 4, 4); adding zero removes negative zeros."""
    signs = np.append(_MIRROR, 1.0)
    return np.asarray(signs[:, None] * placements * signs + 0.0)


def _mirrored_shapes(shapes: Callable[..., Any], links: Collection[str], **options: Any) -> Iterator[Shape]:
    """Mirrored shapes of links; reversed triangles keep their outside."""
    for shape in shapes(links, **options):
        points, triangles = shape.mesh
        yield replace(shape, mesh=(points * _MIRROR, triangles[:, ::-1]))
