"""Bodies of a robot that are not on the chain to the end effector: fingers, legs, a head, the other arm."""

from collections.abc import Callable, Collection, Mapping, Sequence

import numpy as np
import pinocchio as pin

from maniport.arms.chain import PRISMATIC, Body, Joint
from maniport.util.validation import Array


def bodies_off_chain(
    model: pin.Model,
    parts: Mapping[int, Sequence[Joint]],
    mounts: Mapping[int, tuple[int, Array]],
    fingers: Collection[str],
    resolve: Callable[[str], tuple[str | None, float, float]],
    bounds: Mapping[str, tuple[float, float]],
) -> dict[str, Body]:
    """Compute where bodies are that are not on a chain, relative to the chain's joints."""
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
