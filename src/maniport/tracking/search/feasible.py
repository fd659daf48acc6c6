"""The nearest ellipsoid that an arm can make: a search over its joint positions within their limits."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from maniport.bodies import Arm
from maniport.errors import NotSPDError
from maniport.notebook import ShownInNotebooks
from maniport.spd.matrix_functions import roots
from maniport.steps import Progress, Step
from maniport.tracking.search.blocks import descend_in_blocks
from maniport.tracking.search.descent import Target
from maniport.tracking.search.start_bank import StartBank, as_hand_positions, semidefinite
from maniport.validation import Array, as_choice, as_count, as_number, as_points, as_square

BANK_SIZE = 16_384
BLOCK = 128
"""Ellipsoids that are searched for together. The number is fixed, so that results do not depend on that of the jobs."""
POSITION_WEIGHT = 30.0
SINGULAR = "Give a floor, such as 0.01 tr(mean M)/d: it is added to all eigenvalues, of wanted and own ellipsoids alike"


@dataclass(frozen=True, eq=False, repr=False)
class FeasibleEllipsoids(ShownInNotebooks):
    """What an arm can make of wanted ellipsoids.

    Attributes
    ----------
    joint_positions : ndarray, shape (n, dof)
        Where the arm makes the ellipsoids that are nearest, within its limits [rad or m].
    ellipsoids : ndarray, shape (n, d, d)
        The arm's own there, without floor.
    distance : ndarray, shape (n,)
        Affine-invariant distance between these and the wanted ones, with the floor.
    position_error : ndarray, shape (n,), or None
        How far the hand is from the wanted positions [m], where there are any.
    """

    joint_positions: Array
    ellipsoids: Array
    distance: Array
    position_error: Array | None = None

    def __repr__(self) -> str:
        return f"FeasibleEllipsoids({'; '.join(f'{name} {fact}' for name, fact in self._facts().items() if fact)})"

    def _facts(self) -> dict[str, object]:
        d, away = self.ellipsoids.shape[-1], self.position_error
        return {
            "ellipsoids": f"{len(self.ellipsoids)} of {d} × {d}",
            "distance": _spread(self.distance, ""),
            "hand beside its place": None if away is None else _spread(1e3 * away, " mm"),
        }


def _spread(values: Array, unit: str) -> str:
    return f"{np.median(values):.3g}{unit} (median), {np.percentile(values, 95):.3g}{unit} (95 %)"


def nearest_feasible(
    arm: Arm,
    ellipsoids: ArrayLike,
    *,
    floor: float = 0.0,
    part: str = "translation",
    kind: str = "velocity",
    joint_weights: ArrayLike | str | None = None,
    positions: ArrayLike | None = None,
    position_weight: float = POSITION_WEIGHT,
    n_starts: int = 48,
    bank: StartBank | None = None,
    random_state: Any = 0,
    tol: float = 1e-6,
    max_iter: int = 100,
    n_jobs: int | None = None,
    progress: Progress | None = None,
) -> FeasibleEllipsoids:
    """Find the joint positions within limits whose ellipsoid is nearest: min_q d(A + floor I, M(q) + floor I).

    The distance to the ellipsoid found is an upper bound of the true minimum, since a search from finitely many starts
    may miss it. Of ellipsoids of the Panda at new joint positions, with the floor below, 99.7 % score below 0.01.

    Parameters
    ----------
    arm : Arm
    ellipsoids : array_like, shape (n, d, d)
        Wanted ellipsoids in the arm's base frame, without floor.
    floor : float
        Added to all eigenvalues of wanted and own ellipsoids [unit of M], so that flat ones can be compared; a
        hundredth of the mean eigenvalue, 0.01 tr(mean M)/d, is a good choice. Default: none.
    part, kind, joint_weights
        Which ellipsoids, as in `Arm.manipulability`.
    positions : array_like, shape (n, 3), optional
        Where the hand is wanted, in the base frame [m]. The search then minimizes
        d² + (position_weight · |position error|)².
    position_weight : float
        What a metre counts for beside the distance between ellipsoids [1/m].
    n_starts : int
        From how many samples of the bank to search for each ellipsoid. Arms whose ellipsoids have fewer degrees of
        freedom need more: of a UR5's own ellipsoids 98 % score below 0.01 with 48, above 99 % with 96.
    bank : StartBank, optional
        Built for this arm and these options. Default: one of 16 384 samples, built anew (about 0.2 s).
    random_state : None, int or numpy.random.Generator
        Seed of that bank.
    tol : float
        A target counts as reached when the root of what is minimized falls below `tol`. A search ends where no joint
        alone promises to lower it by as much.
    max_iter : int
        Most steps of a search.
    n_jobs : int, optional
        Number of processes, as in joblib. Results do not depend on it. Starting processes takes a second or two.
    progress : callable, optional
        Called with the name of a step and the fraction done.

    Returns
    -------
    FeasibleEllipsoids

    Raises
    ------
    NotSPDError
        When an ellipsoid is asymmetric or, with the floor, not positive-definite; when without a floor the arm itself
        makes none.
    InvalidInputError
        When another argument has a wrong shape or value, or the bank does not fit.
    """
    as_choice(kind, "kind", ("velocity", "force"))
    velocity: dict[str, Any] = {"part": part, "joint_weights": joint_weights}
    options = {**velocity, "kind": kind}
    starts, steps = as_count(n_starts, "n_starts"), as_count(max_iter, "max_iter")
    tolerance, lift = as_number(tol, "tol", above=0.0), as_number(floor, "floor", minimum=0.0)
    weight = as_number(position_weight, "position_weight", above=0.0)
    if bank is None:
        bank = StartBank.build(arm, BANK_SIZE, random_state, **options)
    else:
        bank.require_fits(arm, **options)
    raised = lift * np.eye(bank.ellipsoids.shape[-1])
    given = as_square(ellipsoids, "ellipsoids", len(raised))
    wanted = as_points(given + raised, "ellipsoids", minimum=1, hint=SINGULAR)
    hands = None if positions is None else as_hand_positions(positions, len(wanted))
    step = Step(progress, "search the nearest ellipsoids")
    first = bank.query(semidefinite(wanted - raised), hands, starts)
    target = Target(arm, velocity, kind == "force", lift, roots(wanted)[1], hands, weight)
    q = descend_in_blocks(target, first, tolerance, steps, BLOCK, n_jobs, None if progress is None else step)
    distance = target.distance(q)
    if not np.all(np.isfinite(distance)):
        raise NotSPDError(f"the arm {arm.name!r} is singular at all starts. {SINGULAR}")
    error = None if hands is None else np.linalg.norm(arm.forward(q)[:, :3, 3] - hands, axis=1)
    step.end(f"distance {_spread(distance, '')}")
    return FeasibleEllipsoids(q, arm.manipulability(q, **options), distance, error)
