"""The robot executes a profile: the hand path is placed before it, and it follows."""

import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from maniport.bodies import VELOCITY, Arm, EllipsoidSpec
from maniport.errors import InvalidInputError
from maniport.files import folder_written_whole, save_ellipsoids, save_path
from maniport.notebook import ShownInNotebooks
from maniport.steps import Progress
from maniport.tracking import Control, PlacedPath, StartBank, TrackResult, feasibility_gap, place_path, track
from maniport.tracking.objective import DAMPING, Damping, Objective
from maniport.validation import Array, as_finite, as_generator, as_number

PLACED_POINTS = 250
"""Points of a path that its place is judged by, at most; more take longer and change little."""

DATA_FILES = ("placed_profile.npz", "path.npz", "joints.csv", "joints.npz")
"""The files that `Execution.save` writes."""


@dataclass(frozen=True)
class Execution(ShownInNotebooks):
    """A robot's motion along a profile.

    Attributes
    ----------
    robot : Arm
    placement : PlacedPath or None
        Where the hand path was placed; None where it was taken as it is, or there is none.
    motion : TrackResult
        The joint trajectory and what it achieves.
    gap : ndarray, shape (n,)
        Feasibility gap: distance from each target ellipsoid to the nearest that the robot makes, wherever its tip is.
    tempo : float
        Speed of the motion over that of the profile.
    random_state : int or None
        Seed of the searches, where it is known.
    sources : tuple of str
        The files that profile and path came from, as far as they did.
    """

    robot: Arm
    placement: PlacedPath | None
    motion: TrackResult
    gap: Array
    tempo: float
    random_state: int | None = 0
    sources: tuple[str, ...] = ()

    def __repr__(self) -> str:
        return f"Execution({self.robot.name!r}, tempo {self.tempo:g}, {self.motion!r})"

    @property
    def placed_time(self) -> Array:
        """Times of the points that the place of the path was judged by, shape (m,) [s]."""
        return self.motion.time[:: _step(len(self.motion.time))]

    @property
    def best_distance(self) -> Array | None:
        """Node floor: smallest distance with the tip on its path, found for each time by itself, shape (n,).

        Linear between the points that the place was judged by; None where the path was not placed.
        """
        if self.placement is None:
            return None
        return np.interp(self.motion.time, self.placed_time, self.placement.distance)

    def save(self, folder: str | os.PathLike[str]) -> None:
        """Write the data to a folder, whole or not at all; `maniport.write_results` adds figures and a page.

        Raises
        ------
        OutputError
            When the folder holds other things, or cannot be written.
        """
        with folder_written_whole(folder, DATA_FILES) as staging:
            self.write_data(staging)

    def write_data(self, folder: Path) -> None:
        """Write `DATA_FILES`, without the path where there is none, into a folder that is there."""
        save_ellipsoids(folder / "placed_profile.npz", self.motion.target, self.motion.time)
        if self.motion.path is not None:
            save_path(folder / "path.npz", self.motion.path, self.motion.time)
        self.motion.save_joints_csv(folder / "joints.csv")
        self.motion.save_joints(folder / "joints.npz")


def _step(count: int) -> int:
    """Of so many points every how manieth the place of a path is judged by."""
    return 1 + (count - 1) // PLACED_POINTS


def follow(
    robot: Arm,
    profile: ArrayLike,
    time: ArrayLike | None,
    path: ArrayLike | None = None,
    *,
    place: bool = True,
    turn: ArrayLike | None = None,
    spec: EllipsoidSpec = VELOCITY,
    tempo: float = 1.0,
    damping: Damping = DAMPING,
    bank: StartBank | None = None,
    random_state: Any = 0,
    progress: Progress | None = None,
    **control: Any,
) -> Execution:
    """Place a hand path before a robot and let it follow the target ellipsoids along it.

    Parameters
    ----------
    robot : Arm
    profile : array_like, shape (n, d, d)
        Target velocity ellipsoids.
    time : array_like, shape (n,)
        [s].
    path : array_like, shape (n, 3), optional
        Hand positions [m]; without them the robot follows the ellipsoids alone.
    place : bool
        Whether the path may be moved, scaled and turned about the vertical (`maniport.tracking.place_path`).
    turn : array_like, shape (3, 3), optional
        Rotation that the ellipsoids were turned by already and the path was not.
    spec : EllipsoidSpec
        Which ellipsoids.
    tempo : float
        Speed of the motion over that of the profile. Robots are often slower than people.
    damping : float or Regularization
        What is added to all eigenvalues before ellipsoids are compared; see `maniport.tracking.track`.
    bank : StartBank, optional
        Of this robot and these ellipsoids. Default: a new one.
    random_state : None, int or numpy.random.Generator
        For the bank and the search of a place.
    progress : callable, optional
        Called with the name of a step and the fraction done.
    **control
        How the robot follows; see `maniport.tracking.Control`.
    """
    if time is None:
        raise InvalidInputError("the profile has no times; write it with an array 'time' (n,) in seconds")
    pace = as_number(tempo, "tempo", above=0.0)
    Control(**control)  # a wrong value shall be told before any long work
    generator = as_generator(random_state)
    bank = StartBank.given_or_built(bank, robot, spec, generator)
    regularization = Objective.of(robot, spec, damping, positive=True).damping
    same: dict[str, Any] = {"spec": spec, "damping": regularization, "bank": bank, "progress": progress}
    placement, target, tips = None, profile, path
    if path is not None and place:
        points, ellipsoids = as_finite(path, "path"), as_finite(profile, "profile")
        each = slice(None, None, _step(len(points)))
        placement = place_path(points[each], ellipsoids[each], robot, turn=turn, random_state=generator, **same)
        target, tips = placement.turned(ellipsoids), placement.apply(points)
    motion = track(robot, target, time=np.asarray(time) / pace, path=tips, **control, **same)
    gap = feasibility_gap(robot, motion.target, **same)
    return Execution(robot, placement, motion, gap, pace, random_state if isinstance(random_state, int) else None)
