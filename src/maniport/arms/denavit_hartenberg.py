"""Chains from Denavit-Hartenberg tables, standard or modified (Craig)."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from maniport.arms.chain import PRISMATIC, REVOLUTE, Chain, Frame, Joint, check_names, pose
from maniport.errors import InvalidInputError
from maniport.util.validation import Array, as_choice, as_finite, as_numbers, as_rotation


def chain_from_dh(
    name: str,
    rows: ArrayLike,
    lower: ArrayLike,
    upper: ArrayLike,
    *,
    base: ArrayLike | None = None,
    joint_names: Sequence[str] | None = None,
    kinds: Sequence[str] | None = None,
    convention: str = "standard",
    velocity_limits: ArrayLike | None = None,
) -> Chain:
    """Build a chain from a table; the parameters are those of `Arm.from_dh`."""
    table = as_finite(rows, "rows")
    if table.ndim != 2 or table.shape[1] != 4 or not len(table):
        raise InvalidInputError(f"rows must have shape (n, 4), columns theta, d, a, alpha; found shape {table.shape}")
    n = len(table)
    as_choice(convention, "convention", ("standard", "modified"))
    names = _one_each([f"joint{i + 1}" for i in range(n)] if joint_names is None else joint_names, n, "joint_names")
    check_names(names, "joint_names")
    sorts = _one_each([REVOLUTE] * n if kinds is None else kinds, n, "kinds")
    low, high = as_numbers(lower, "lower", n, one=True), as_numbers(upper, "upper", n, one=True)
    if np.any(low >= high):
        i = int(np.argmax(low >= high))
        raise InvalidInputError(f"lower must lie below upper; found {low[i]:g} and {high[i]:g} for joint {names[i]!r}")
    before, after = _fixed_parts(table, convention)
    placements = [_base(base) @ before[0]] + [after[i] @ before[i + 1] for i in range(n - 1)]
    axis = np.array([0.0, 0.0, 1.0])
    joints = [
        Joint(names[i], as_choice(sorts[i], f"kinds[{i}]", (REVOLUTE, PRISMATIC)), axis, placements[i])
        for i in range(n)
    ]
    frames = {"base": Frame(0, _base(base))} | {f"link{i + 1}": Frame(i + 1, after[i]) for i in range(n)}
    speeds = None
    if velocity_limits is not None:
        speeds = as_numbers(velocity_limits, "velocity_limits", n, one=True, above=0.0)
    return Chain(name, tuple(joints), frames, f"link{n}", tuple(names), low, high, np.eye(n), np.zeros(n), speeds)


def _fixed_parts(table: Array, convention: str) -> tuple[list[Array], list[Array]]:
    """Split each row's transform into the part before the joint's motion and the part after it, shapes (4, 4)."""
    about_z = [pose((0.0, 0.0, d), (0.0, 0.0, theta)) for theta, d, _, _ in table]
    about_x = [pose((a, 0.0, 0.0), (alpha, 0.0, 0.0)) for _, _, a, alpha in table]
    if convention == "modified":
        return about_x, about_z
    return [np.eye(4) for _ in table], [z @ x for z, x in zip(about_z, about_x, strict=True)]


def _base(value: ArrayLike | None) -> Array:
    """Pose of the base: None, a rotation (3, 3) or a pose (4, 4)."""
    if value is None:
        return np.eye(4)
    matrix, result = as_finite(value, "base"), np.eye(4)
    if matrix.shape == (4, 4) and np.array_equal(matrix[3], result[3]):
        result[:3, 3] = matrix[:3, 3]
    elif matrix.shape != (3, 3):
        raise InvalidInputError(
            f"base must be a rotation, shape (3, 3), or a pose, shape (4, 4) with last row 0 0 0 1; "
            f"found shape {matrix.shape}"
        )
    as_rotation(matrix[:3, :3], "base")
    result[:3, :3] = matrix[:3, :3]  # as given: a check must not add rounding to exact quarter turns
    return result


def _one_each(values: Sequence[Any], n: int, name: str) -> list[Any]:
    if len(values) != n:
        raise InvalidInputError(f"{name} must have {n} entries, one for each row; found {len(values)}")
    return list(values)
