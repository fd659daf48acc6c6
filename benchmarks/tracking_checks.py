"""What must hold when a Panda follows adapted ellipsoids, against the figures asked for."""

from collections.abc import Callable, Iterator

import numpy as np

from maniport.motion import SeedBank, nearest_feasible
from maniport.studies.paper.trajectories import robot_arm

from .inputs import Array
from .measure import Row, within
from .tracking_runs import Outcome, spread

REACHED, ON_PLACE = 0.05, 1e-3
"""Distance, and metres, within which a target counts as reached."""
BANK, TARGETS, BEST = 40_000, 400, 5


def rows(outcomes: list[Outcome], quick: bool) -> Iterator[Row]:
    """Every check."""
    yield _bank_starts(100 if quick else TARGETS)
    yield from _tracked(outcomes)


def _bank_starts(count: int) -> Row:
    """Whether descents from the best few of a bank reach ellipsoid and hand position of random configurations."""
    robot = robot_arm()
    truth = robot.sample(count, 7, "uniform")
    bank, tips = SeedBank.build(robot, BANK, 0), robot.forward(truth)[:, :3, 3]
    profile = robot.manipulability(truth)
    found = nearest_feasible(robot, profile, damping=bank.damping, positions=tips, n_starts=BEST, bank=bank)
    share = float(np.mean((found.distance < REACHED) & (found.position_error < ON_PLACE)))
    return Row(
        f"a reachable ellipsoid and hand position, from the best {BEST} of {BANK:,} starts",
        f"{share:.1%}",
        "",
        f"{share:.1%}",
        "≥ 85 %",
        share >= 0.85,
        f"d < {REACHED} and hand within 1 mm, {count} configurations at random within the joint limits",
    )


def _tracked(outcomes: list[Outcome]) -> Iterator[Row]:
    distance = _pool(outcomes, lambda one: one.tracked.distance)
    yield _bounded(
        "adapted (mean and dispersion), placed, tracked: d, median / 95 %",
        distance,
        (0.80, 1.30),
        f"{_about(outcomes)}; " + _each(outcomes, lambda one: one.tracked.distance) + "; least at each point by "
        f"itself {spread(_pool(outcomes, lambda one: one.placed.distance))}",
    )
    error = _pool(outcomes, lambda one: one.tracked.position_error)
    yield within(
        "adapted, placed, tracked: hand beside its path, 95 %",
        float(np.percentile(error, 95)),
        ON_PLACE,
        millimetres,
        _each(outcomes, lambda one: 1e3 * one.tracked.position_error) + " mm",
    )
    without = _pool(outcomes, lambda one: one.hand_only.distance)
    worse = float(np.median(without) / np.median(distance)) - 1.0
    yield Row(
        "the same path without the ellipsoid task, from home: d, median",
        f"{np.median(distance):.2f} with the task",
        f"without: {spread(without)}",
        f"{worse:+.0%}",
        "≥ +20 %",
        worse >= 0.2,
        "Pink with tasks of position and posture only, from the joint positions next to the ready position; mean "
        f"{without.mean() / distance.mean() - 1.0:+.0%}",
    )


def _bounded(work: str, values: Array, limits: tuple[float, float], note: str) -> Row:
    reached = bool(np.median(values) <= limits[0] and np.percentile(values, 95) <= limits[1])
    return Row(work, spread(values), "", spread(values), f"≤ {limits[0]:.2f} / {limits[1]:.2f}", reached, note)


def _pool(outcomes: list[Outcome], value: Callable[[Outcome], Array]) -> Array:
    return np.concatenate([value(one) for one in outcomes])


def _about(outcomes: list[Outcome]) -> str:
    return f"{len({one.motion for one in outcomes})} motions, {len(outcomes)} placements of them"


def _each(outcomes: list[Outcome], value: Callable[[Outcome], Array]) -> str:
    """The figures of each placement."""
    names = dict.fromkeys(one.placement for one in outcomes)
    return ", ".join(f"{name} {spread(_pool([o for o in outcomes if o.placement == name], value))}" for name in names)


def millimetres(metres: float) -> str:
    """Show a length."""
    return f"{1e3 * metres:.2f} mm"
