"""An arm as tubes and balls."""

from typing import Any

import numpy as np

from maniport.live.shapes import bones
from maniport.validation import Array


class Skeleton:
    """A polyline of an arm as tubes and balls, that moves.

    Each bone is a frame with its tube and ball: only poses change, which a browser draws at once, while changed shapes
    of many parts would come a few frames late.
    """

    def __init__(self, scene: Any, name: str, skeleton: Array, radius: float, color: tuple[int, int, int]):
        turns, starts, lengths = bones(skeleton)
        self._lengths = lengths
        self._bones, self._tubes = [], []
        for i, (turn, start, length) in enumerate(zip(turns, starts, lengths.tolist(), strict=True)):
            bone = f"{name}/{i}"
            self._bones.append(scene.add_frame(bone, show_axes=False, wxyz=turn, position=start))
            middle = (0.0, 0.0, 0.5 * length)
            tube = scene.add_cylinder(f"{bone}/tube", radius, 1.0, color, scale=(1.0, 1.0, length), position=middle)
            self._tubes.append(tube)
            scene.add_icosphere(f"{bone}/ball", 1.25 * radius, color)
        self._hand = scene.add_icosphere(f"{name}/hand", 1.25 * radius, color, position=skeleton[-1])

    def draw(self, skeleton: Array) -> None:
        """Move to a new posture."""
        turns, starts, lengths = bones(skeleton)
        for bone, turn, start in zip(self._bones, turns, starts, strict=True):
            bone.wxyz, bone.position = turn, start
        self._hand.position = skeleton[-1]
        for i in np.flatnonzero(np.abs(lengths - self._lengths) > 1e-6):  # of slides only
            self._tubes[i].scale, self._tubes[i].position = (1.0, 1.0, lengths[i]), (0.0, 0.0, 0.5 * lengths[i])
            self._lengths[i] = lengths[i]
