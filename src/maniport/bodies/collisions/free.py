"""Configurations of an arm or a pair that are free of collisions."""

from copy import deepcopy
from typing import Any

import numpy as np

from maniport.bodies.arm import Arm
from maniport.bodies.arms import Arms
from maniport.bodies.collisions.checker import Collisions
from maniport.bodies.cooperative import CooperativeArm
from maniport.errors import InvalidInputError
from maniport.validation import Array, as_generator

_MOST_TRIES = 64
"""Free configurations are looked for among so many times as many samples."""


def as_collisions(value: Any, arm: Arm | Arms | CooperativeArm) -> Collisions | None:
    """Convert what is given for `collisions`: None and False to None, True to the arm's own with itself.

    Raises
    ------
    InvalidInputError
        When it is something else, or belongs to another arm.
    """
    if value is None or value is False:
        return None
    if value is True:
        return Collisions.of(arm.arms if isinstance(arm, CooperativeArm) else arm)
    if not isinstance(value, Collisions):
        raise InvalidInputError(
            f"collisions must be a Collisions object, True, False or None; found {type(value).__name__}"
        )
    if value.arm.joint_names != arm.joint_names:
        raise InvalidInputError(
            f"collisions belong to {value.arm.name!r} with joints {', '.join(value.arm.joint_names)}, not to "
            f"{arm.name!r} with {', '.join(arm.joint_names)}; make them with Collisions.of(arm)"
        )
    return value


def free_postures(
    arm: Arm | Arms | CooperativeArm, n: int, random_state: Any, sequence: str = "sobol", collisions: Any = None
) -> Array:
    """Sample postures as `maniport.bodies.Arm.sample` does, of a pair, too; those that collide are replaced.

    The sequence is continued until n are free, shape (n, dof): the same seed gives the same postures.

    Raises
    ------
    InvalidInputError
        When an argument has a wrong value, or fewer than one in 64 samples is free.
    """
    checked = as_collisions(collisions, arm)
    if checked is None or not checked.known:
        return arm.sample(n, random_state, sequence)
    generator = as_generator(random_state)
    start = deepcopy(generator)
    q = arm.sample(n, generator, sequence)
    free = ~checked.collides(q)
    while free.sum() < n:
        if len(q) >= _MOST_TRIES * n:
            raise InvalidInputError(
                f"collisions: only {int(free.sum())} of {len(q)} sampled postures of {arm.name!r} are free; {n} are "
                "asked for"
            )
        more = arm.sample(2 * len(q), deepcopy(start), sequence)  # begins with what there is
        free = np.concatenate([free, ~checked.collides(more[len(q) :])])
        q = more
    return np.ascontiguousarray(q[free][:n])
