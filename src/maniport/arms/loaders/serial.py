"""Serial chains in robot models: joints and frames, couplings, masses and bodies off the chain."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from maniport.arms.chain import (
    IMPLAUSIBLE_INERTIA,
    PRISMATIC,
    Body,
    Chain,
    Frame,
    Joint,
    check_names,
    moved_inertia,
)
from maniport.arms.loaders.document import read_collision_shapes, read_shapes
from maniport.arms.loaders.model import Limbs, RobotBody, RobotModel
from maniport.errors import FileFormatError, InvalidInputError, unknown_name
from maniport.util.validation import Array

LEAST_RADIUS = 0.3  # of gyration, which bodies of small arms may have [m]
NEGLIGIBLE = 2e-3  # moment that changes no torque: small sensors often have 0.001 [kg m²]
TRIANGLE = 0.01  # share by which the largest moment may exceed the sum of the others, by few digits in files
ROUNDING = 1e-6  # such a moment [kg m²]

Mounts = dict[str, tuple[int, Array]]
"""Bodies and sites fixed to a chain: number of joints before each, and its pose (4, 4) in the frame of the last."""


def chain_to(model: RobotModel, end_frame: str | None, wanted: Sequence[str] | None) -> Chain:
    """Return the chain to a frame, by default the end effector of some joints; see `maniport.load_arm`."""
    path = model.path
    places = {site: body for site, (body, _) in model.sites.items()}
    places |= {name: name for name in model.bodies}
    wanted = () if wanted is None else check_names(wanted, "joints")
    _require_movable(model, wanted)
    if end_frame is None:
        end_frame = Limbs(model, wanted).choose()
    elif end_frame not in places:
        raise unknown_name("frame", end_frame, places, f"in '{path}'")
    joints, mounts = _mounted(model, places[end_frame])
    coordinates = [joint.name for joint in joints if joint.name not in model.followers]
    _require_ranges(model, coordinates)

    coupling, offset = _coupling(model, joints, coordinates)
    frames = _frames(model, mounts)
    carriers = _carriers(model, mounts)
    inertia = _inertia(model, carriers, len(joints))
    remarks = dict(model.remarks)
    if inertia is not None:
        length = 0.0
        for joint in joints:
            length += float(np.linalg.norm(joint.placement[:3, 3]))
        remarks[IMPLAUSIBLE_INERTIA] = _implausible_inertia(model, carriers, length)
    limits = np.array([model.bounds[name] for name in coordinates]).reshape(-1, 2)
    return Chain(
        name=model.name,
        joints=tuple(joints),
        frames=frames,
        frame=end_frame,
        coordinates=tuple(coordinates),
        lower=limits[:, 0],
        upper=limits[:, 1],
        coupling=coupling,
        offset=offset,
        velocity_limits=np.array([model.speeds[name] for name in coordinates]),
        effort_limits=np.array([model.efforts[name] for name in coordinates]),
        inertia=inertia,
        gravity=model.gravity,
        remarks=remarks,
        unlimited=tuple(model.unlimited),
        shapes=partial(read_shapes, model.shapes, path.absolute()),
        collision_shapes=partial(read_collision_shapes, model.shapes, path.absolute()),
        others=_bodies_off_chain(model, mounts, coordinates),
    )


def _coupling(
    model: RobotModel, joints: Sequence[Joint], coordinates: Sequence[str]
) -> tuple[Array, Array]:
    """Return positions of joints per coordinate (joints, dof), and at zero coordinates (joints,)."""
    coupling = np.zeros((len(joints), len(coordinates)))
    offset = np.zeros(len(joints))
    for row, joint in enumerate(joints):
        leader, factor, offset[row] = _resolved(model, joint.name, coordinates)
        if leader is not None:
            coupling[row, coordinates.index(leader)] = factor
    return coupling, offset


def _require_movable(model: RobotModel, names: Sequence[str]) -> None:
    """Require names of joints that move by themselves."""
    for name in names:
        if name not in model.bounds:
            raise unknown_name("joint", name, model.bounds, f"in '{model.path}'")
        if name in model.followers:
            leader = model.followers[name].leader
            reason = "it is constant" if leader is None else f"it follows {leader!r}"
            raise InvalidInputError(
                f"joints: {name!r} in '{model.path}' cannot move by itself, {reason}"
            )


def _require_ranges(model: RobotModel, coordinates: Sequence[str]) -> None:
    """Require that limits of coordinates leave positions."""
    for name in coordinates:
        if name in model.closed:
            low, high = model.closed[name]
            raise FileFormatError(
                f"{model.path}: joint {name!r} has the limits {low:g} to {high:g}; the first must be below the second, "
                "or both zero if unknown"
            )


def _frames(model: RobotModel, mounts: Mounts) -> dict[str, Frame]:
    """Return bodies and sites fixed to a chain as frames."""
    frames = {}
    for name, (joint, placement) in mounts.items():
        frames[name] = Frame(joint, placement, model.bodies[name].parent)
    for site, (body, site_placement) in model.sites.items():
        if body in mounts and site not in model.bodies:
            joint, placement = mounts[body]
            frames[site] = Frame(joint, placement @ site_placement, body)
    return frames


def _mounted(model: RobotModel, end: str) -> tuple[list[Joint], Mounts]:
    """Return the joints from the base to a body, and the bodies fixed to the chain."""
    joints = list[Joint]()
    mounts = Mounts()
    path = set(model.line(end))
    for body in model.bodies.values():
        if body.name in path and body.blocked:
            raise FileFormatError(
                f"{model.path}: the joint to {body.name!r} on the chain is of type {body.blocked}; only joints with "
                "one axis are supported"
            )
        count = 0
        pose = np.eye(4)
        if body.parent is not None:
            is_rigid = not (body.joints or body.blocked)
            if body.parent not in mounts or not (body.name in path or is_rigid):
                continue
            count, pose = mounts[body.parent]
        for joint in body.joints:
            joints.append(replace(joint, placement=pose @ joint.placement))
            count = count + 1
            pose = np.eye(4)
        mounts[body.name] = count, pose @ body.placement
    return joints, mounts


def _resolved(
    model: RobotModel, name: str, coordinates: Collection[str]
) -> tuple[str | None, float, float]:
    """Coordinate that moves a joint, factor and position at zero."""
    factor = 1.0
    offset = 0.0
    seen = set[str]()
    while name in model.followers:
        follower = model.followers[name]
        offset += factor * follower.offset
        if follower.leader is None:
            return None, 0.0, offset
        if not follower.linear or follower.leader not in model.bounds or name in seen:
            fault = "which is no joint, or in a cycle"
            if not follower.linear:
                fault = "nonlinearly"
            raise FileFormatError(
                f"{model.path}: joint {name!r} follows {follower.leader!r} {fault}"
            )
        seen.add(name)
        factor = factor * follower.factor
        name = follower.leader
    if name in coordinates:
        return name, factor, offset
    rest = float(np.clip(0.0, *model.bounds[name]))  # a joint off the chain is locked
    return None, 0.0, factor * rest + offset


def _carriers(model: RobotModel, mounts: Mounts) -> Mounts:
    """Return for all bodies what `mounts` has for those fixed to the chain, other joints at rest."""
    places = dict(mounts)
    for body in model.bodies.values():
        if body.name not in places:
            carrier, pose = places[str(body.parent)]
            places[body.name] = carrier, pose @ _poses(model, [body], ())[0]
    return places


def _inertia(model: RobotModel, carriers: Mounts, count: int) -> Array | None:
    """Spatial inertia of what the base and each joint carry, other joints at rest; None without all masses."""
    inertia = np.zeros((count + 1, 6, 6))
    for body in model.bodies.values():
        carrier, pose = carriers[body.name]
        if body.inertia is not None:
            inertia[carrier] += moved_inertia(body.inertia, pose)
        elif carrier:
            return None
    if np.any(inertia[1:]):
        return inertia
    return None


def _implausible_inertia(model: RobotModel, carriers: Mounts, length: float) -> dict[str, str]:
    """Return the moving bodies whose moments of inertia no body of their mass can have.

    The largest principal moment is at most the sum of the others. The radius of gyration of a body is below half of
    its length, and a body of an arm is no longer than the arm.
    """
    largest = max(0.5 * length, LEAST_RADIUS)
    details = {}
    for body in model.bodies.values():
        if body.inertia is None or not carriers[body.name][0]:
            continue
        mass = body.inertia[0, 0]
        moments = _principal_moments(body.inertia)
        excess = moments[2] - moments[0] - moments[1]
        no_body = excess > max(TRIANGLE * moments[2], ROUNDING)
        too_large = moments[2] > max(mass * largest**2, NEGLIGIBLE)
        if no_body or too_large:
            listed = ", ".join(f"{moment:.3g}" for moment in moments)
            details[body.name] = f"{listed} kg m² for {mass:.3g} kg"
    return details


def _principal_moments(inertia: Array) -> Array:
    """Principal moments of inertia (3,) about the center of mass, ascending, of a spatial inertia (6, 6)."""
    mass = inertia[0, 0]
    moments = inertia[3:, 3:]
    if mass > 0:
        center = (
            np.array([inertia[1, 5], inertia[2, 3], inertia[0, 4]]) / mass
        )  # sign is irrelevant
        moments = moments - mass * (center @ center * np.eye(3) - np.outer(center, center))
    return np.asarray(np.linalg.eigvalsh(moments))


def _bodies_off_chain(
    model: RobotModel, mounts: Mounts, coordinates: Sequence[str]
) -> dict[str, Body]:
    """Bodies off a chain, with their poses relative to the joints of the chain."""
    fingers = Limbs(model).fingers()
    bodies = {}
    moving = {*coordinates, *fingers - model.followers.keys()}
    for name in model.bodies:
        path = [model.bodies[above] for above in reversed(model.line(name)) if above not in mounts]
        if path:
            count, placement = mounts[str(path[0].parent)]
            finger = _first_moved_by(path, fingers)
            bodies[name] = Body(count, placement @ _poses(model, path, moving), finger.name)
    return bodies


def _first_moved_by(path: Sequence[RobotBody], joints: Collection[str]) -> RobotBody:
    """Return the first body of a path with one of some joints, or the last body."""
    for body in path:
        if any(joint.name in joints for joint in body.joints):
            return body
    return path[-1]


def _poses(
    model: RobotModel, path: Sequence[RobotBody], moving: Collection[str], most: int = 512
) -> Array:
    """Poses of the last body of a path relative to the parent of the first, shape (k, 4, 4) with k ≤ `most`."""
    rules = {}
    slides: dict[str, bool] = {}  # whether a leader moves prismatic joints only
    for body in path:
        for joint in body.joints:
            rules[joint.name] = _resolved(model, joint.name, moving)
            leader = rules[joint.name][0]
            if leader is not None:
                slides[leader] = slides.get(leader, True) and joint.kind == PRISMATIC
    positions = _sampled_positions(model, slides, most)

    poses: Array = np.eye(4)[None]
    if positions:
        count = len(next(iter(positions.values())))
        poses = np.broadcast_to(np.eye(4), (count, 4, 4))
    for body in path:
        for joint in body.joints:
            leader, factor, offset = rules[joint.name]
            if leader is None:
                of_joint = np.full(len(poses), offset)
            else:
                of_joint = factor * positions[leader] + offset
            poses = poses @ joint.placement @ joint.motion(of_joint)
        poses = poses @ body.placement
    return poses


def _sampled_positions(
    model: RobotModel, slides: Mapping[str, bool], most: int
) -> dict[str, Array]:
    """Sample the ranges of joints on a grid of at most `most` points, shape (k,) for each.

    `slides` tells of each joint whether it moves bodies along lines only, for which the ends of its range suffice.
    """
    counts: dict[str, int] = {}
    for name, is_straight in slides.items():
        span = np.ptp(model.bounds[name])
        if not np.isfinite(span):
            counts[name] = 1
        elif is_straight:
            counts[name] = 2
        else:
            counts[name] = 2 + int(span / 0.4)  # steps of 0.4 rad cut arcs by 2 % of their radius
    while np.prod(list(counts.values())) > most:
        counts[max(counts, key=lambda leader: counts[leader])] -= 1
    samples = []
    for name, count in counts.items():
        if count > 1:
            samples.append(np.linspace(*model.bounds[name], count))
        else:
            samples.append(np.zeros(1))
    grids = np.meshgrid(*samples, indexing="ij")
    return {name: grid.ravel() for name, grid in zip(counts, grids, strict=True)}
