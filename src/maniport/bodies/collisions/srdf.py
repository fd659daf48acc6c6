"""SRDF: pairs of links that need not be checked, as MoveIt's assistant writes them."""

import os
from pathlib import Path

from maniport.bodies.arm import Arm
from maniport.bodies.arms import Arms
from maniport.bodies.readers.document import parsed
from maniport.errors import FileFormatError, InvalidInputError, nearest_first


def disabled_pairs(path: str | os.PathLike[str], arm: Arm | Arms) -> set[frozenset[str]]:
    """Names of the links of each pair that an SRDF leaves out."""
    root = parsed(Path(path))[1]
    if root.tag != "robot" or root.find("link") is not None:
        what = "a URDF" if root.tag == "robot" else f"its root is <{root.tag}>"
        raise FileFormatError(f"{path}: no SRDF, which has the root <robot> and defines no links; this is {what}")
    pairs: set[frozenset[str]] = set()
    for i, element in enumerate(root.findall("disable_collisions")):
        ends = [element.get(key, "") for key in ("link1", "link2")]
        if not all(ends):
            raise FileFormatError(f"{path}: <disable_collisions> number {i + 1} must name link1 and link2")
        pairs.add(frozenset(ends))
    if not pairs:
        raise FileFormatError(f"{path}: holds no <disable_collisions>, the pairs of links that need not be checked")
    named = set().union(*pairs)
    if named.isdisjoint(arm.frames):
        raise InvalidInputError(
            f"srdf: {path} does not fit {arm.name!r}: it names {', '.join(sorted(named)[:5])} and no link of the arm; "
            f"those are {', '.join(nearest_first(min(named), arm.frames)[:12])}"
        )
    return pairs
