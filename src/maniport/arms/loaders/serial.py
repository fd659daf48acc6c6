"""Serial chains in robot models: joints and frames, couplings, masses and bodies off the chain."""

from collections.abc import Collection, Sequence
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
    places = {
        **{site: body for site, (body, _) in model.sites.items()},
        **{body: body for body in model.bodies},
    }
    wanted = () if wanted is None else check_names(wanted, "joints")
    for name in wanted:
        if name not in model.bounds:
            raise unknown_name("joint", name, model.bounds, f"in '{path}'")
        if name in model.followers:
            leader = model.followers[name].leader
            reason = "it is constant" if leader is None else f"it follows {leader!r}"
            raise InvalidInputError(f"joints: {name!r} in '{path}' cannot move by itself, {reason}")
    if end_frame is None:
        end_frame = Limbs(model, wanted).choose()
    elif end_frame not in places:
        raise unknown_name("frame", end_frame, places, f"in '{path}'")
    joints, mounts = _mounted(model, places[end_frame])
    coordinates = [joint.name for joint in joints if joint.name not in model.followers]
    for name in [name for name in coordinates if name in model.closed]:
        low, high = model.closed[name]
        raise FileFormatError(
            f"{path}: joint {name!r} has the limits {low:g} to {high:g}; the first must be below the second, or both "
            "zero if unknown"
        )
    coupling = np.zeros((len(joints), len(coordinates)))
    offset = np.zeros(len(joints))
    for row, joint in enumerate(joints):
        leader, factor, offset[row] = _resolved(model, joint.name, coordinates)
        if leader is not None:
            coupling[row, coordinates.index(leader)] = factor
    frames = {name: Frame(*mount, model.bodies[name].parent) for name, mount in mounts.items()}
    for site, (body, placement) in model.sites.items():
        if body in mounts and site not in model.bodies:
            frames[site] = Frame(mounts[body][0], mounts[body][1] @ placement, body)
    limits = np.array([model.bounds[name] for name in coordinates]).reshape(-1, 2)
    carriers = _carriers(model, mounts)
    inertia = _inertia(model, carriers, len(joints))
    remarks = dict(model.remarks)
    if inertia is not None:
        steps = [np.linalg.norm(joint.placement[:3, 3]) for joint in joints]
        remarks[IMPLAUSIBLE_INERTIA] = _implausible_inertia(model, carriers, float(sum(steps)))
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
        if body.parent is None or (
            body.parent in mounts and (body.name in path or not (body.joints or body.blocked))
        ):
            count, pose = (0, np.eye(4)) if body.parent is None else mounts[body.parent]
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
    while (follower := model.followers.get(name)) is not None:
        offset += factor * follower.offset
        if follower.leader is None:
            return None, 0.0, offset
        if not follower.linear or follower.leader not in model.bounds or name in seen:
            if not follower.linear:
                fault = "nonlinearly"
            else:
                fault = "which is no joint, or in a cycle"
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
            count, rest = mounts[str(path[0].parent)]
            finger = next(
                (body for body in path if any(joint.name in fingers for joint in body.joints)),
                path[-1],
            )
            bodies[name] = Body(count, rest @ _poses(model, path, moving), finger.name)
    return bodies


def _poses(
    model: RobotModel, path: Sequence[RobotBody], moving: Collection[str], most: int = 512
) -> Array:
    """Poses of the last body of a path relative to the parent of the first, shape (k, 4, 4) with k ≤ `most`."""
    joints = [joint for body in path for joint in body.joints]
    rules = {joint.name: _resolved(model, joint.name, moving) for joint in joints}
    counts: dict[str, int] = {}  # samples of the range of each leader
    for name in dict.fromkeys(leader for leader, *_ in rules.values() if leader is not None):
        slides = all(joint.kind == PRISMATIC for joint in joints if rules[joint.name][0] == name)
        span = np.ptp(model.bounds[name])  # steps of 0.4 rad cut arcs by 2 % of their radius
        if not np.isfinite(span):
            counts[name] = 1
        elif slides:
            counts[name] = 2
        else:
            counts[name] = 2 + int(span / 0.4)
    while np.prod(list(counts.values())) > most:
        counts[max(counts, key=lambda leader: counts[leader])] -= 1
    grids = [
        np.linspace(*model.bounds[leader], n) if n > 1 else np.zeros(1)
        for leader, n in counts.items()
    ]
    at = dict(
        zip(counts, (grid.ravel() for grid in np.meshgrid(*grids, indexing="ij")), strict=True)
    )
    poses: Array = np.broadcast_to(np.eye(4), (int(np.prod([len(grid) for grid in grids])), 4, 4))
    for body in path:
        for joint in body.joints:
            leader, factor, offset = rules[joint.name]
            if leader is None:
                positions = np.full(len(poses), offset)
            else:
                positions = factor * at[leader] + offset
            poses = poses @ joint.placement @ joint.motion(positions)
        poses = poses @ body.placement
    return poses
