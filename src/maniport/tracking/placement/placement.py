"""Where in an arm's workspace a path lets the arm make the target ellipsoids best."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from maniport.bodies import VELOCITY, Arm, EllipsoidSpec
from maniport.bodies.chain import rotation_about
from maniport.errors import InvalidInputError
from maniport.notebook import ShownInNotebooks
from maniport.steps import Part, Progress, Step, between, pieces
from maniport.tracking.objective import DAMPING, EXACT_WEIGHT, Damping, Objective
from maniport.tracking.placement.placement_search import Journey, best_placement
from maniport.tracking.search.descent import descend_in_blocks
from maniport.tracking.search.start_bank import StartBank
from maniport.validation import Array, as_count, as_finite, as_generator, as_number, as_rotation, require_shape

SCALES = (0.5, 2.0)
REACHED = 1e-3
"""How far beside its point the tip may be and still count as there [m]."""
STARTS, STEPS, BLOCK, TOLERANCE = 32, 100, 64, 1e-6
COMPARED = 60
"""Points that two placements are compared on."""
SEARCHED = 0.95
"""The fraction done when the places have been found, all but the node floors."""


@dataclass(frozen=True, eq=False)
class PlacedPath(ShownInNotebooks):
    """A path in a robot's workspace, with the ellipsoids that turn with it, and how well it can be done there.

    p_robot = scale · Rz(yaw) · turn · (p − centre) + offset.

    Attributes
    ----------
    path : ndarray, shape (n, 3)
        Target positions of the tip in the robot's base frame [m].
    profile : ndarray, shape (n, d, d)
        Target ellipsoids there: the given ones, turned by the yaw.
    spec : EllipsoidSpec
        Which ellipsoids.
    scale, yaw : float
        Factor of the path's size, and turn about the vertical [rad], within ±π.
    offset : ndarray, shape (3,)
        Where the path's centre is in the robot's base frame [m].
    centre : ndarray, shape (3,)
        Mean of the given path's points [m].
    turn : ndarray, shape (3, 3)
        As given.
    distance : ndarray, shape (n,)
        The node floor: the smallest affine-invariant distance to the target ellipsoid that was found with the tip
        there, each point by itself. Smooth motions stay above it.
    position_error : ndarray, shape (n,)
        How far the tip stays beside the point [m].
    reachable : ndarray of bool, shape (n,)
        Whether that is at most 1 mm. Where it is not, `distance` belongs to the nearest place that was found.
    joint_positions : ndarray, shape (n, dof)
        Joint positions that do so, each point by itself [rad or m]: not a motion, they may jump.
    """

    path: Array
    profile: Array
    spec: EllipsoidSpec
    scale: float
    yaw: float
    offset: Array
    centre: Array
    turn: Array
    distance: Array
    position_error: Array
    reachable: NDArray[np.bool_]
    joint_positions: Array

    def apply(self, points: ArrayLike) -> Array:
        """Place other points of the same motion, shape (..., 3) [m], such as those of a denser path."""
        given = as_finite(points, "points")
        require_shape(given, "points", (..., 3))
        rotation = rotation_about(2, self.yaw) @ self.turn
        return np.asarray(self.scale * (given - self.centre) @ rotation.T + self.offset)

    def turned(self, profile: ArrayLike) -> Array:
        """Turn other ellipsoids of the same motion by the yaw, shape (n, d, d), such as those of a denser path."""
        given = as_finite(profile, "profile")
        require_shape(given, "profile", ("n", *self.profile.shape[1:]))
        rotation = self.spec.rotation(rotation_about(2, self.yaw))
        moved = rotation @ given @ rotation.T
        return np.asarray(0.5 * (moved + np.swapaxes(moved, 1, 2)))

    def __repr__(self) -> str:
        found = f"scale {self.scale:.3f}, yaw {np.degrees(self.yaw):.1f}°, node floor {np.median(self.distance):.2f}"
        return f"PlacedPath({len(self.path)} points, {found} (median), {np.sum(~self.reachable)} out of reach)"


def place_path(
    path: ArrayLike,
    profile: ArrayLike,
    arm: Arm,
    *,
    turn: ArrayLike | None = None,
    scale: float | tuple[float, float] | None = None,
    yaw: float | None = None,
    offset: Sequence[float | None] | ArrayLike | None = None,
    spec: EllipsoidSpec = VELOCITY,
    damping: Damping = DAMPING,
    bank: StartBank | None = None,
    n_points: int = 28,
    random_state: Any = 0,
    n_jobs: int | None = None,
    progress: Progress | None = None,
) -> PlacedPath:
    """Find scale, turn about the vertical and offset of a path that let an arm make the target ellipsoids best.

    A position and an ellipsoid ask more of an arm of six or seven joints than it can give, so that most of the
    distance that remains is decided by where in its workspace the path lies. The mean squared node floor, the
    distance with the tip on the path, is minimized: candidates that fill the workspace are scored from the bank, the
    best are refined by descent, and the one is taken along which the arm can move best from posture to posture. Of
    places that are as good, to 5 % of the cost, the one that turns the path least.

    The ellipsoids belong to the motion. They turn with the path, by the same yaw, as if the whole task were done in
    another direction in front of the robot; the relation between the direction of motion and the ellipsoid stays.
    Scale and offset leave them as they are. Collisions, with the robot itself or others, are not considered: fix what
    the surroundings demand.

    Parameters
    ----------
    path : array_like, shape (n, 3)
        Hand positions of the teacher in its base frame [m].
    profile : array_like, shape (n, d, d)
        Target ellipsoids of the arm, one for each point, as an adapter gives them.
    arm : Arm
    turn : array_like, shape (3, 3), optional
        Rotation that the adapter turned the ellipsoids by, known mounting or fitted: the path is turned by it, the
        profile already was. Default: the identity.
    scale : float or (float, float), optional
        Factor of the path's size to keep, or the range to search. Default: from 0.5 to 2.
    yaw : float, optional
        Turn about the vertical to keep [rad]. Default: free.
    offset : sequence of three floats, optional
        Where the path's centre shall be in the arm's base frame [m]; None in place of a coordinate leaves it free, as
        in ``(None, None, 0.4)``. Default: free.
    spec, damping, bank, progress
        As in `maniport.tracking.nearest_feasible`.
    n_points : int
        How many points of the path the search looks at, once all and once half of them; the better place is taken. The
        node floors are then computed at all points of the path.
    random_state : None, int or numpy.random.Generator
        Seed of candidates and bank.
    n_jobs : int, optional
        Number of processes for the node floors, as in joblib; the results do not depend on it.

    Raises
    ------
    NotSPDError
        When an ellipsoid is asymmetric or, with the damping, not positive-definite.
    InvalidInputError
        When another argument has a wrong shape or value.
    """
    generator, most = as_generator(random_state), as_count(n_points, "n_points")
    scales, given = _given(scale, yaw, offset)
    rotation = np.eye(3) if turn is None else as_rotation(turn, "turn", 3)
    journey, centre = _journey(Objective.of(arm, spec, damping), path, profile, rotation, bank, generator)
    step, searched = Step(progress, "place the path"), SEARCHED if np.isnan(given).any() else 0.0
    placement = _search(journey, given, scales, most, generator, between(step, 0.0, searched))
    tell = None if progress is None else between(step, searched, 1.0)
    result = _placed(journey, placement, centre, rotation, n_jobs, tell)
    step.end(f"scale {result.scale:.3f}, node floor {np.median(result.distance):.2f} (median)")
    return result


def _journey(
    objective: Objective,
    path: ArrayLike,
    profile: ArrayLike,
    turn: Array,
    bank: StartBank | None,
    generator: np.random.Generator,
) -> tuple[Journey, Array]:
    """What is asked for, checked, and the path's centre."""
    targets, tips = objective.undamped(objective.checked(profile, "profile")), as_finite(path, "path")
    require_shape(tips, "path", (len(targets), 3), ", one point for each ellipsoid of the profile")
    bank, centre = StartBank.given_or_built(bank, objective.arm, objective.spec, generator), tips.mean(axis=0)
    return Journey(objective, bank, (tips - centre) @ turn.T, targets), centre


def _search(
    journey: Journey, given: Array, scales: tuple[float, float], most: int, seed: np.random.Generator, tell: Part
) -> Array:
    """The best placement; few points may miss what is hard, many demand that one posture lasts: both are tried."""
    counts = sorted({max(1, most // 2), most})
    found = [
        best_placement(journey, given, scales, count, seed, one)
        for count, one in zip(counts, pieces(tell, *counts), strict=True)
    ]
    return min(found, key=lambda one: _compared(journey, one))


def _placed(
    journey: Journey, placement: Array, centre: Array, turn: Array, n_jobs: int | None, tell: Part | None
) -> PlacedPath:
    """What a placement is worth at every point of the path."""
    tips, profile = (values[0] for values in journey.placed(placement[None]))
    q = _best_by_point(journey, tips, profile, n_jobs, tell)
    targets = journey.objective.targets(profile, tips)
    error = np.linalg.norm(targets.tip_offset(q), axis=1)
    return PlacedPath(
        path=tips,
        profile=profile,
        spec=journey.objective.spec,
        scale=float(np.exp(placement[0])),
        yaw=float(np.remainder(placement[1] + np.pi, 2.0 * np.pi) - np.pi),
        offset=placement[2:],
        centre=centre,
        turn=turn,
        distance=targets.distance(q),
        position_error=error,
        reachable=error <= REACHED,
        joint_positions=q,
    )


def _compared(journey: Journey, placement: Array) -> float:
    """Mean squared node floor over some of the points, and what is missing to reach them."""
    tips, profile = (values[0] for values in journey.placed(placement[None]))
    rows = np.unique(np.linspace(0, len(tips) - 1, COMPARED).round().astype(int))
    q = _best_by_point(journey, tips[rows], profile[rows], None)
    return float(np.mean(_exact(journey.objective).targets(profile[rows], tips[rows]).evaluate(q)[0] ** 2))


def _exact(objective: Objective) -> Objective:
    return replace(objective, position_weight=EXACT_WEIGHT)


def _best_by_point(
    journey: Journey, tips: Array, profile: Array, n_jobs: int | None, tell: Part | None = None
) -> Array:
    """Best joint positions at each point by itself, shape (n, dof)."""
    soft, exact = (one.targets(profile, tips) for one in (journey.objective, _exact(journey.objective)))
    starts = journey.starts(tips, profile, STARTS)
    first, then = (None, None) if tell is None else pieces(tell, 4.0, 1.0)
    q = descend_in_blocks(soft, starts, TOLERANCE, STEPS, BLOCK, n_jobs, first)
    # what is good at one point may be better at its neighbours than what they have found
    beside = np.stack([q, np.roll(q, 1, axis=0), np.roll(q, -1, axis=0)], axis=1)
    return descend_in_blocks(exact, beside, TOLERANCE, STEPS, BLOCK, n_jobs, then)


def _given(scale: Any, yaw: Any, offset: Any) -> tuple[tuple[float, float], Array]:
    """The range of scales, and log scale, yaw and offset, shape (5,), nan where free."""
    given, scales = np.full(5, np.nan), SCALES
    if isinstance(scale, tuple | list):
        if len(scale) != 2:
            raise InvalidInputError(f"scale must be one number or a range (low, high); found {scale!r}")
        low = as_number(scale[0], "scale[0]", above=0.0)
        scales = (low, as_number(scale[1], "scale[1]", above=low))
    elif scale is not None:
        given[0] = np.log(as_number(scale, "scale", above=0.0))
    if yaw is not None:
        given[1] = as_number(yaw, "yaw")
    if offset is not None:
        values = list(offset) if np.ndim(offset) == 1 else []
        if len(values) != 3:
            raise InvalidInputError(f"offset must be three numbers, None where free; found {offset!r}")
        for i, value in enumerate(values):
            given[2 + i] = np.nan if value is None else as_number(value, f"offset[{i}]")
    return scales, given
