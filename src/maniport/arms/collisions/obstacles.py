"""Input of collision checking: boxes around a robot, and disabled pairs of links from an SRDF."""

import os
from collections.abc import Iterable
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import Any

from maniport.arms.arm import Arm
from maniport.arms.arm_group import ArmGroup
from maniport.arms.chain import rotation_about
from maniport.arms.collisions.hulls import Hull
from maniport.arms.loaders.document import parsed, require
from maniport.errors import FileFormatError, InvalidInputError, nearest_first
from maniport.util.files import read_settings, require_mapping
from maniport.util.validation import as_number, as_numbers


@dataclass(frozen=True, eq=False)
class Box:
    """A box in the robot's base frame; `InvalidInputError` when a number is wrong.

    Parameters
    ----------
    center, size : array_like, shape (3,)
        Center, and edge lengths along x, y and z of the box [m].
    yaw : float
        Rotation about the z axis through the center [rad].
    name : str
        Name in messages.
    """

    center: Any
    size: Any
    yaw: float = 0.0
    name: str = "box"

    def __post_init__(self) -> None:
        object.__setattr__(self, "center", as_numbers(self.center, f"{self.name}: center", 3))
        object.__setattr__(self, "size", as_numbers(self.size, f"{self.name}: size", 3, above=0.0))
        object.__setattr__(self, "yaw", as_number(self.yaw, f"{self.name}: yaw"))

    def hull(self) -> Hull:
        """Compute the convex hull, fixed to the base."""
        corners = (
            self.size * [*product((-0.5, 0.5), repeat=3)] @ rotation_about(2, self.yaw).T
            + self.center
        )
        return Hull.around(self.name, 0, corners)


def read_boxes(path: str | os.PathLike[str]) -> tuple[Box, ...]:
    """Read obstacles from a YAML or JSON file; a `FileFormatError` names the box and the fault.

    Each has a name, a center [m] and a size [m] in the robot's base frame and an optional yaw [rad]::

        obstacles:
          shelf: {center: [0.5, 0.2, 0.4], size: [0.3, 0.6, 0.02]}
          crate: {center: [0.4, -0.3, 0.1], size: [0.2, 0.3, 0.2], yaw: 0.5}
    """
    named = read_settings(path, ("obstacles",)).get("obstacles")
    if not isinstance(named, dict) or not named:
        raise FileFormatError(
            f"{path}: obstacles must be a mapping of names to obstacles, each with center and size"
        )
    obstacles = []
    for name, content in named.items():
        box = require_mapping(content, ("center", "size", "yaw"), f"{path}: obstacles: {name}")
        fault = f"obstacles: {name}: a box has center, size and optional yaw; found {', '.join(box) or 'nothing'}"
        require({"center", "size"} <= box.keys(), path, fault)
        try:
            obstacles.append(Box(**box, name=str(name)))
        except InvalidInputError as error:
            raise FileFormatError(f"{path}: obstacles: {error}") from None
    return tuple(obstacles)


def as_boxes(value: object) -> tuple[Box, ...]:
    """Convert None, a file, or boxes."""
    if value is None:
        return ()
    if isinstance(value, (str, os.PathLike)):
        return read_boxes(value)
    if isinstance(value, Iterable):
        listed = list(value)
    else:
        listed = [value]
    if not all(isinstance(box, Box) for box in listed):
        raise InvalidInputError(f"obstacles must be a file or a sequence of Box; found {value!r}")
    return tuple(listed)


def disabled_pairs(path: str | os.PathLike[str], arm: Arm | ArmGroup) -> set[frozenset[str]]:
    """Read the names of the links of each pair that an SRDF disables."""
    root = parsed(Path(path))
    if root.tag == "robot":
        what = "this is a URDF"
    else:
        what = f"its root is <{root.tag}>"
    is_srdf = root.tag == "robot" and root.find("link") is None
    require(is_srdf, path, f"no SRDF, which has the root <robot> and defines no links; {what}")
    pairs: set[frozenset[str]] = set()
    for i, element in enumerate(root.findall("disable_collisions")):
        ends = [element.get(key, "") for key in ("link1", "link2")]
        require(all(ends), path, f"<disable_collisions> number {i + 1} must name link1 and link2")
        pairs.add(frozenset(ends))
    require(bool(pairs), path, "has no <disable_collisions>")
    named = set().union(*pairs)
    if named.isdisjoint(arm.frames):
        raise InvalidInputError(
            f"srdf: {path} does not fit {arm.name!r}: it names {', '.join(sorted(named)[:5])} and no link of the arm; "
            f"those are {', '.join(nearest_first(min(named), arm.frames)[:12])}"
        )
    return pairs
