"""What `Live` does before the first frame: it checks its arguments, and runs all code that numba compiles."""

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from maniport.bodies import Arm, EllipsoidSpec
from maniport.demonstrations import ArmFit
from maniport.errors import InvalidInputError
from maniport.steps import Step
from maniport.tracking import PlacedPath
from maniport.transfer import DomainAdapter
from maniport.validation import Array

WARM_UP_STEP = 0.01
"""Time between two synthetic frames [s]."""


def require_kinds(person: Any, adapter: Any, robot: Any, spec: Any, path: Any) -> None:
    """Raise unless these are what `Live` takes."""
    kinds = {"person": ArmFit, "adapter": DomainAdapter, "robot": Arm, "spec": EllipsoidSpec}
    for value, (name, kind) in zip((person, adapter, robot, spec), kinds.items(), strict=True):
        if not isinstance(value, kind):
            raise InvalidInputError(f"{name} must be of type {kind.__name__}; found {type(value).__name__}")
    if path is not None and not isinstance(path, PlacedPath):
        raise InvalidInputError(f"path must be a PlacedPath or None; found {type(path).__name__}")


def require_size(adapter: DomainAdapter, spec: EllipsoidSpec) -> None:
    """Raise unless a fitted adapter maps ellipsoids of this size."""
    if (size := len(adapter.teacher_mean_)) != spec.size:
        raise InvalidInputError(f"the adapter maps ellipsoids of {size}×{size}; {spec} are {spec.size}×{spec.size}")


def warm_up(step: Callable[[Array | None, float], Any], points: int, hold_after: float, progress: Step) -> None:
    """Take steps on synthetic frames, so that none of a person's waits for numba."""
    time = 0.0
    frames = list(_synthetic(points))
    for i, frame in enumerate(frames):
        time += WARM_UP_STEP if frame is not None else 2.0 * hold_after
        step(frame, time)
        progress((i + 1) / len(frames))


def _synthetic(points: int) -> Iterator[Array | None]:
    """Frames of a person who moves, is partly hidden, jumps, leaves and returns."""
    frame = np.random.default_rng(0).normal(size=(points, 3))
    hidden = frame.copy()
    hidden[-1] = np.nan
    yield from (frame, 1.001 * frame, hidden, -frame, None, frame, frame)
