"""Points and directions fixed to the links of a chain, with derivatives, for many configurations.

A few array operations per joint process all configurations together, and release Python's lock.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np

from maniport.arms.chain import PRISMATIC, Chain
from maniport.util.validation import Array

Attachment = tuple[int, Array]  # number of joints before it, and a vector (3,) in the frame of the last of them


class PointKinematics:
    """Forward kinematics of points and directions on a chain."""

    def __init__(self, chain: Chain, points: Sequence[str], directions: Sequence[Attachment] = ()):
        frames = [chain.frames[name] for name in points]
        self._fixed = [(frame.joint, frame.placement[:3, 3], True) for frame in frames]
        self._fixed += [(joint, vector, False) for joint, vector in directions]
        self._last = max((joint for joint, _, _ in self._fixed), default=0)
        self._coupling, self._offset = chain.coupling[: self._last], chain.offset[: self._last]
        self._joints = [
            (np.hstack([turn := joint.placement[:3, :3], turn @ (k := _cross(joint.axis)), turn @ k @ k]).T.copy(),
             np.stack([joint.placement[:3, 3], turn @ joint.axis]), joint.kind == PRISMATIC)
            for joint in chain.joints[: self._last]
        ]  # fmt: skip
        self._slides = [j for j, (_, _, slides) in enumerate(self._joints) if slides]

    def arrays(self) -> tuple[Any, ...]:
        """Return the chain and the vectors as arrays for compiled code."""
        return (
            np.ascontiguousarray(self._coupling),
            np.ascontiguousarray(self._offset),
            np.array([placed.T.reshape(3, 3, 3).swapaxes(0, 1) for placed, _, _ in self._joints]).reshape(-1, 3, 3, 3),
            np.array([place for _, place, _ in self._joints]).reshape(-1, 2, 3),
            np.array([slides for _, _, slides in self._joints], dtype=np.bool_),
            np.array([joint for joint, _, _ in self._fixed], dtype=np.int64),
            np.array([vector for _, vector, _ in self._fixed]).reshape(-1, 3),
        )

    def __call__(self, q: Array) -> tuple[Array, Array]:
        """Compute vectors (n, k, 3) and derivatives (n, k, 3, dof) at configurations (n, dof)."""
        count = len(self._fixed)
        values, slopes = np.empty((len(q), count, 3)), np.empty((len(q), count, 3, q.shape[1]))
        for first in range(0, len(q), 512):  # 512 configurations fit in the cache
            part = slice(first, first + 512)
            self._follow(q[part], values[part], slopes[part])
        return values, slopes

    def _follow(self, q: Array, values: Array, slopes: Array) -> None:
        """Fill the results of `__call__`; arrays have the configurations as their last axis, for speed."""
        n, wanted = len(q), {joint for joint, _, _ in self._fixed}
        angles = self._coupling @ q.T + self._offset[:, None]
        sines, versed = np.sin(angles), 1.0 - np.cos(angles)
        turn, origin = np.repeat(np.eye(3)[:, :, None], n, axis=2), np.zeros((3, n))
        along, origins = np.empty((2, 3, self._last, n))
        links = {0: (turn, origin)}
        for j, (placed, (shift, axis), slides) in enumerate(self._joints):
            origins[:, j] = origin = origin + shift @ turn
            along[:, j] = axis @ turn
            products = placed @ turn  # Rodrigues: R P (I + sin K + (1 - cos) K²), all three at once
            if slides:
                origin, turn = origin + angles[j] * along[:, j], products[:, :3]
            else:
                turn = products[:, :3] + sines[j] * products[:, 3:6] + versed[j] * products[:, 6:]
            if j + 1 in wanted:
                links[j + 1] = turn, origin
        shifting = _times(origins, along)  # of a joint that turns: ω = a, and v(p) = a × (p - o) = ω × p + o × a
        shifting[:, self._slides], along[:, self._slides] = along[:, self._slides], 0.0
        twists = {joint: [self._coupling[:joint].T @ part[:, :joint] for part in (along, shifting)] for joint in wanted}
        places = [place @ links[joint][0] + (links[joint][1] if fixed else 0.0) for joint, place, fixed in self._fixed]
        value = np.stack(places, axis=1)
        slope = _times(np.stack([twists[joint][0] for joint, _, _ in self._fixed], axis=1), value[:, :, None])
        for i, (joint, _, is_point) in enumerate(self._fixed):
            if is_point:
                slope[:, i] += twists[joint][1]
        values[:], slopes[:] = value.transpose(2, 1, 0), slope.transpose(3, 1, 0, 2)


def axis_of(chain: Chain, coordinate: int, above: int) -> Attachment:
    """Return the axis of the joint of a coordinate while the coordinates from `above` up to it are zero."""
    names = [joint.name for joint in chain.joints]
    last = names.index(chain.coordinates[coordinate])
    still = np.clip(0.0, chain.lower[above:coordinate], chain.upper[above:coordinate])
    before = [j for j in range(last) if chain.coupling[j, :above].any()]
    first = before[-1] + 1 if before else 0
    vector = chain.joints[last].placement[:3, :3] @ chain.joints[last].axis
    for j in range(last - 1, first - 1, -1):
        joint = chain.joints[j]
        angle = float(chain.coupling[j, above:coordinate] @ still + chain.offset[j])
        if joint.kind != PRISMATIC:
            k = _cross(joint.axis)
            vector = vector + np.sin(angle) * k @ vector + (1 - np.cos(angle)) * k @ k @ vector
        vector = joint.placement[:3, :3] @ vector
    return first, vector


def _cross(axis: Array) -> Array:
    """The matrix K with K v = a × v."""
    x, y, z = axis
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


def _times(left: Array, right: Array) -> Array:
    """Cross products along the first axis."""
    a, b, c = left
    x, y, z = right
    result = np.empty(np.broadcast_shapes(left.shape, right.shape))
    result[0], result[1], result[2] = b * z - c * y, c * x - a * z, a * y - b * x
    return result
