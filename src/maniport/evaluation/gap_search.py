"""How far what a robot is asked for is from what it can make, searched for once for each ellipsoid."""

from typing import Any

import numpy as np

from maniport.bodies import Arm, EllipsoidSpec
from maniport.evaluation.rows import Gaps
from maniport.spd.affine_invariant import distance_unchecked
from maniport.spd.regularization import Regularization
from maniport.subsample import evenly_spaced
from maniport.tracking.search.feasible import nearest_feasible
from maniport.tracking.search.start_bank import StartBank
from maniport.validation import Array

POINTS = 128
"""Ellipsoids of a profile whose feasibility gap is searched for at most, evenly spread."""


class GapSearch:
    """Feasibility gaps of images; what was searched for before is known, since some methods map alike.

    A floor has no derivative where it sets in: the search adds it to all eigenvalues instead, and what it finds is
    measured with eigenvalues below the floor lifted to it, on both sides. Both are upper bounds of the least distance.

    Parameters
    ----------
    robot : Arm
    spec : EllipsoidSpec
    own : Regularization
        That of the student's ellipsoids, which both sides get.
    count : int
        How many ellipsoids of the profile come first among images.
    bank : StartBank, optional
    n_jobs : int, optional
    """

    def __init__(
        self,
        robot: Arm,
        spec: EllipsoidSpec,
        own: Regularization,
        count: int,
        bank: StartBank | None = None,
        n_jobs: int | None = None,
    ):
        self._robot, self._spec, self._own, self._n_jobs = robot, spec, own, n_jobs
        self._bank = StartBank.given_or_built(bank, robot, spec, 0)
        self._count, self._along = count, evenly_spaced(count, POINTS)
        self._known: dict[bytes, float] = {}

    def __call__(self, images: Array) -> tuple[Gaps | None, Gaps | None]:
        """Summarise the gaps of the profile, thinned, and of what comes after it; None where there is nothing."""
        asked = np.concatenate([images[self._along], images[self._count :]])
        gaps, n = self.distances(asked), len(self._along)
        return Gaps.of(gaps[:n], self._along) if n else None, Gaps.of(gaps[n:]) if len(gaps) > n else None

    def distances(self, targets: Array) -> Array:
        """Distances to the nearest ellipsoids of the robot that the search finds, shape (n,)."""
        keys = [target.tobytes() for target in targets]
        new = {key: index for index, key in enumerate(keys) if key not in self._known}
        if new:
            self._known |= zip(new, self._search(targets[list(new.values())]).tolist(), strict=True)
        return np.array([self._known[key] for key in keys])

    def _search(self, targets: Array) -> Array:
        own = self._own
        options: dict[str, Any] = {"spec": self._spec, "bank": self._bank, "n_jobs": self._n_jobs}
        if own.floor is None:
            return nearest_feasible(self._robot, targets, damping=own, **options).distance
        found = nearest_feasible(self._robot, targets, damping=Regularization.absolute(own.floor), **options)
        return distance_unchecked(
            own.apply(targets), own.apply(self._robot.ellipsoids(found.joint_positions, self._spec))
        )

    def in_words(self) -> str:
        """How the gaps were searched; empty where at every ellipsoid of the profile, without a floor."""
        said = []
        if self._count > POINTS:
            said.append(f"searched at {POINTS} of the profile's {self._count} ellipsoids, evenly spread")
        if self._own.floor is not None:
            said.append("the floor is added to all eigenvalues in the search, and lifts those below it in what is told")
        return "; ".join(said)
