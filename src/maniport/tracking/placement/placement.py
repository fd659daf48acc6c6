"""Where in an arm's workspace a hand path lets the arm make the wanted ellipsoids best."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from maniport.bodies import Arm
from maniport.errors import InvalidInputError
from maniport.spd.affine_invariant import distance_unchecked
from maniport.steps import Part, Progress, Step, between, pieces
from maniport.tracking.placement.placed_path import PlacedPath
from maniport.tracking.placement.placement_search import SEARCH_WEIGHT, STIFF_WEIGHT, Task, best_placement
from maniport.tracking.search.blocks import descend_in_blocks
from maniport.tracking.search.feasible import BANK_SIZE, SINGULAR
from maniport.tracking.search.start_bank import StartBank
from maniport.validation import Array, as_count, as_finite, as_generator, as_number, as_points, as_rotation, as_square

SCALES = (0.5, 2.0)
REACHED = 1e-3
"""How far beside its point the hand may be and still count as there [m]."""
STARTS, STEPS, BLOCK, TOLERANCE = 32, 100, 64, 1e-6
COMPARED = 60
"""Points that two placements are compared on."""
SEARCHED = 0.95
"""The fraction done when the places have been found, all but the floors."""


def place_path(
    path: ArrayLike,
    profile: ArrayLike,
    arm: Arm,
    *,
    turn: ArrayLike | None = None,
    scale: float | tuple[float, float] | None = None,
    yaw: float | None = None,
    offset: Sequence[float | None] | ArrayLike | None = None,
    floor: float = 0.0,
    kind: str = "velocity",
    part: str = "translation",
    joint_weights: ArrayLike | str | None = None,
    bank: StartBank | None = None,
    n_points: int = 28,
    random_state: Any = 0,
    n_jobs: int | None = None,
    progress: Progress | None = None,
) -> PlacedPath:
    """Find scale, turn about the vertical and offset of a hand path that let an arm make the wanted ellipsoids best.

    A hand position and an ellipsoid ask more of an arm of six or seven joints than it can give, so that most of the
    distance that remains is decided by where in its workspace the path lies. The mean squared floor of the distance,
    with the hand on the path, is minimized: candidates that fill the workspace are scored from the bank, the best are
    refined by descent, and the one is taken along which the arm can move best from posture to posture. Of places that
    are as good, to 5 % of the cost, the one that turns the path least.

    The ellipsoids belong to the motion. They turn with the path, by the same yaw, as if the whole task were done in
    another direction in front of the robot; the relation between the direction of motion and the ellipsoid stays.
    Scale and offset leave them as they are. Collisions, with the robot itself or others, are not considered: fix what
    the surroundings demand.

    Parameters
    ----------
    path : array_like, shape (n, 3)
        Hand positions of the teacher in its base frame [m].
    profile : array_like, shape (n, d, d)
        Wanted ellipsoids of the arm, one for each point, as an adapter gives them.
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
    floor : float
        Added to the eigenvalues of wanted and own ellipsoids [unit of M], such as an adapter's ``student_damping_``.
    kind, part, joint_weights
        Which ellipsoids, as in `Arm.manipulability`.
    bank : StartBank, optional
        Made for this arm and these options. Default: one of 16 384 samples, built on each call.
    n_points : int
        How many points of the path the search looks at, once all and once half of them; the better place is taken. The
        floors are then computed at all points of the path.
    random_state : None, int or numpy.random.Generator
        Seed of candidates and bank.
    n_jobs : int, optional
        Number of processes for the floors, as in joblib; the results do not depend on it.
    progress : callable, optional
        Called with the name of a step and the fraction done.

    Returns
    -------
    PlacedPath

    Raises
    ------
    NotSPDError
        When an ellipsoid is asymmetric or, with the floor, not positive-definite.
    InvalidInputError
        When another argument has a wrong shape or value.
    """
    generator = as_generator(random_state)
    options: dict[str, Any] = {"kind": kind, "part": part, "joint_weights": joint_weights}
    if bank is None:
        bank = StartBank.build(arm, BANK_SIZE, generator, **options)
    else:
        bank.require_fits(arm, **options)
    d, lift = bank.ellipsoids.shape[-1], as_number(floor, "floor", minimum=0.0)
    wanted = as_square(profile, "profile", d)
    wanted = as_points(wanted + lift * np.eye(d), "profile", d, 1, SINGULAR) - lift * np.eye(d)
    hands = as_finite(path, "path")
    if hands.shape != (len(wanted), 3):
        raise InvalidInputError(
            f"path must have shape ({len(wanted)}, 3), one point for each ellipsoid of the profile; found {hands.shape}"
        )
    rotation = np.eye(3) if turn is None else as_rotation(turn, "turn", 3)
    scales, given = _given(scale, yaw, offset)

    centre = hands.mean(axis=0)
    task = Task(arm, bank, (hands - centre) @ rotation.T, wanted, lift)
    most = as_count(n_points, "n_points")
    # few points may miss what is hard; many demand that one posture lasts all along: what comes nearer is taken
    step, counts = Step(progress, "place the hand path"), sorted({max(1, most // 2), most})
    searched = SEARCHED if np.isnan(given).any() else 0.0
    tells = pieces(between(step, 0.0, searched), *counts)
    found = [
        best_placement(task, given, scales, count, generator, tell) for count, tell in zip(counts, tells, strict=True)
    ]
    placement = min(found, key=lambda one: _compared(task, one))
    placed, turned = (values[0] for values in task.placed(placement[None]))
    q = _floors(task, placed, turned, n_jobs, None if progress is None else between(step, searched, 1.0))
    error = np.linalg.norm(arm.forward(q)[:, :3, 3] - placed, axis=1)
    raised = lift * np.eye(d)
    result = PlacedPath(
        path=placed,
        profile=turned,
        scale=float(np.exp(placement[0])),
        yaw=float(np.remainder(placement[1] + np.pi, 2.0 * np.pi) - np.pi),
        offset=placement[2:],
        centre=centre,
        turn=rotation,
        distance=distance_unchecked(turned + raised, arm.manipulability(q, **options) + raised),
        position_error=error,
        reachable=error <= REACHED,
        joint_positions=q,
    )
    step.end(result.summary.replace("\n", "; "))
    return result


def _compared(task: Task, placement: Array) -> float:
    """Mean squared floor of the distance over some of the points, and what is missing to reach them."""
    placed, turned = (values[0] for values in task.placed(placement[None]))
    rows = np.unique(np.linspace(0, len(placed) - 1, COMPARED).round().astype(int))
    q = _floors(task, placed[rows], turned[rows], None)
    return float(np.mean(task.target(placed[rows], turned[rows], STIFF_WEIGHT).evaluate(q)[0] ** 2))


def _floors(task: Task, hands: Array, profile: Array, n_jobs: int | None, tell: Part | None = None) -> Array:
    """Best joint positions at each point by itself, shape (n, dof)."""
    soft, stiff = (task.target(hands, profile, weight) for weight in (SEARCH_WEIGHT, STIFF_WEIGHT))
    starts = task.starts(hands, profile, STARTS)
    first, then = (None, None) if tell is None else pieces(tell, 4.0, 1.0)
    q = descend_in_blocks(soft, starts, TOLERANCE, STEPS, BLOCK, n_jobs, first)
    # what is good at one point may be better at its neighbours than what they have found
    beside = np.stack([q, np.roll(q, 1, axis=0), np.roll(q, -1, axis=0)], axis=1)
    return descend_in_blocks(stiff, beside, TOLERANCE, STEPS, BLOCK, n_jobs, then)


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
