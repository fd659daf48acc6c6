"""How well a Panda follows adapted ellipsoids: 12 motions of a human arm at three placements."""

import warnings
from collections.abc import Callable, Iterator

import numpy as np
from joblib import Parallel, delayed

import maniport as mp
from maniport.errors import ManiportWarning
from maniport.evaluation.paper.trajectories import robot_arm
from maniport.tracking import StartBank, nearest_feasible
from maniport.transfer import DomainAdapter

from . import tracking_robots, tracking_speed
from .inputs import Array
from .measure import Row, duration, within
from .tracking_motions import (
    ADAPTED,
    LIFE_SIZE,
    PLACEMENTS,
    STUDENT_SAMPLES,
    TEACHER_SAMPLES,
    Motion,
    adapters,
    motions,
)
from .tracking_robots import spread
from .tracking_runs import Outcome, place_and_track, run

QUICK = ("H-Eval-3", "ladder 23.2–27.5 s")
PLACE = "free"
"""The placement at which the methods are compared."""
REACHED, ON_PLACE = 0.05, 1e-3
"""Distance, and metres, within which a target counts as reached."""
BANK, TARGETS, BEST = 40_000, 400, 5


def rows(quick: bool) -> Iterator[Row]:
    """Every check, then the methods side by side, the speed, and other robots."""
    chosen = [motion for motion in motions() if not quick or motion.name in QUICK]
    fitted = _fitted(chosen)
    outcomes: list[Outcome] = Parallel(n_jobs=-1)(delayed(run)(*one) for one in _work(chosen, fitted, quick))
    yield from _right_start(outcomes)
    yield _bank_starts(100 if quick else TARGETS)
    yield from _tracked(outcomes)
    yield from _offline(outcomes)
    if not quick:
        yield _life_size(chosen, fitted)
    yield from _methods(outcomes)
    first = chosen[0]
    others = first.person.manipulability(first.person.sample(600, 3))
    yield from tracking_speed.rows(outcomes[0], fitted[first.length][ADAPTED].transform(others), quick)
    yield from tracking_robots.rows(chosen, quick)


def _fitted(chosen: list[Motion]) -> dict[float, dict[str, DomainAdapter]]:
    """Adapters of each person, by the length of the arm."""
    student, fitted = mp.sample_domain(robot_arm(), STUDENT_SAMPLES, 1), {}
    for motion in chosen:
        if motion.length not in fitted:
            teacher = mp.sample_domain(motion.person, TEACHER_SAMPLES, 0)
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", ManiportWarning)  # of a rotation that the clouds leave open
                fitted[motion.length] = {name: one.fit(teacher, student) for name, one in adapters().items()}
    return fitted


def _work(chosen: list[Motion], fitted: dict[float, dict[str, DomainAdapter]], quick: bool) -> Iterator[tuple]:
    """What `run` is called with."""
    for motion in chosen:
        fits, profile = fitted[motion.length], motion.profile
        person = profile + fits[ADAPTED].teacher_damping_ * np.eye(3)
        wanted = {name: (one.transform(profile), float(one.student_damping_)) for name, one in fits.items()}
        for name, given in PLACEMENTS.items():
            if name == PLACE:
                yield motion.name, name, motion.robot_time, motion.hand, person, wanted, given
            elif not quick:
                some = {ADAPTED: wanted[ADAPTED]}
                yield motion.name, name, motion.robot_time, motion.hand, person, some, given


def _pool(outcomes: list[Outcome], value: Callable[[Outcome], Array]) -> Array:
    return np.concatenate([value(one) for one in outcomes])


def _about(outcomes: list[Outcome]) -> str:
    named = len({one.motion for one in outcomes}), len({one.placement for one in outcomes})
    return f"{named[0]} motions × {named[1]} placements"


def _right_start(outcomes: list[Outcome]) -> Iterator[Row]:
    distance = _pool(outcomes, lambda one: one.again.distance)
    error = _pool(outcomes, lambda one: one.again.position_error)
    yield within(
        "nearest feasible profile, right start: d, 95 %",
        float(np.percentile(distance, 95)),
        REACHED,
        "{:.3f}".format,
        f"{_about(outcomes)}: the tracker follows ellipsoids and hand of the motion that was optimized offline; "
        f"median {np.median(distance):.3f}, largest {distance.max():.2f}",
    )
    yield within(
        "nearest feasible profile, right start: hand beside its path, 95 %",
        float(np.percentile(error, 95)),
        ON_PLACE,
        _millimetres,
        f"largest {_millimetres(error.max())}",
    )


def _bank_starts(count: int) -> Row:
    """Whether descents from the best few of a bank reach ellipsoid and hand position of random configurations."""
    robot = robot_arm()
    truth = robot.sample(count, 7, "uniform")
    bank, hands = StartBank.build(robot, BANK, 0), robot.forward(truth)[:, :3, 3]
    floor = bank.floor
    found = nearest_feasible(robot, robot.manipulability(truth), floor=floor, positions=hands, n_starts=BEST, bank=bank)
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
        _millimetres,
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


def _offline(outcomes: list[Outcome]) -> Iterator[Row]:
    distance = _pool(outcomes, lambda one: one.offline.distance)
    rms = [[np.sqrt(np.mean(d**2)) for d in (one.offline.distance, one.tracked.distance)] for one in outcomes]
    ratios = np.array([ours / theirs for ours, theirs in rms])
    off_path = [one for one in outcomes if "path" in one.offline.violations]
    yield _bounded(
        "adapted, placed, optimized offline: d, median / 95 %",
        distance,
        (0.75, 1.25),
        _each(outcomes, lambda one: one.offline.distance)
        + f"; path kept in {len(outcomes) - len(off_path)} of {len(outcomes)}, IPOPT converged in "
        f"{sum(one.offline.converged for one in outcomes)}",
    )
    yield Row(
        "optimized offline against tracked: rms of d, the worst motion",
        f"{ratios.max() - 1.0:+.1%}",
        "",
        f"{ratios.max() - 1.0:+.1%}",
        "≤ +5 %",
        bool(ratios.max() <= 1.05),
        f"median {np.median(ratios) - 1.0:+.1%}",
    )
    jerks = np.array([[one.tracked.rms_jerk, one.offline.rms_jerk] for one in outcomes])
    times_less = float(np.sqrt(np.mean(jerks[:, 0] ** 2) / np.mean(jerks[:, 1] ** 2)))
    each = jerks[:, 0] / jerks[:, 1]
    yield Row(
        "optimized offline against tracked: rms jerk",
        f"{np.sqrt(np.mean(jerks[:, 1] ** 2)):.3g} rad/s³",
        f"tracker: {np.sqrt(np.mean(jerks[:, 0] ** 2)):.3g} rad/s³",
        f"1/{times_less:.3g}",
        "≤ 1/5",
        times_less >= 5.0,
        f"over all; of each motion by itself 1/{np.median(each):.3g} (median), {np.mean(each >= 5.0):.0%} at most 1/5",
    )
    seconds = sum(one.offline_seconds for one in outcomes) / sum(len(one.offline.time) for one in outcomes)
    yield Row(
        "optimizing offline, 100 points",
        duration(100 * seconds),
        "",
        duration(100 * seconds),
        "about 1 s",
        None,
        "begun from the tracked motion, as many at a time as there are cores; set-up included",
    )


def _life_size(chosen: list[Motion], fitted: dict[float, dict[str, DomainAdapter]]) -> Row:
    """What it costs that the task may not be made larger or smaller."""
    work = []
    for motion in chosen:
        adapter = fitted[motion.length][ADAPTED]
        profile, floor = adapter.transform(motion.profile), float(adapter.student_damping_)
        work.append((motion.robot_time, motion.hand, profile, floor, LIFE_SIZE))
    found = Parallel(n_jobs=-1)(delayed(place_and_track)(*one) for one in work)
    distance, least = (np.concatenate([one[i].distance for one in found]) for i in (1, 0))
    error = np.concatenate([one[1].position_error for one in found])
    return Row(
        "adapted, placed life-size, tracked: d, median / 95 %",
        spread(distance),
        "",
        spread(distance),
        "–",
        None,
        f"{len(work)} motions with scale 1; the least at each point by itself is {spread(least)} already; "
        f"hand beside its path {_millimetres(np.percentile(error, 95))} (95 %)",
    )


def _methods(outcomes: list[Outcome]) -> Iterator[Row]:
    """One row a method.

    Each is a profile of its own, easy or hard to follow, so that distances to it do not compare methods; what does is
    how near the achieved ellipsoids are to where the person's lie, measured by mean and dispersion of the domains.
    """
    here = [one for one in outcomes if one.placement == PLACE]
    for name in here[0].methods:
        found = [one.methods[name] for one in here]
        own = np.concatenate([one.own for one in found])
        adapted = np.concatenate([one.adapted for one in found])
        order = np.median([one.order for one in found])
        yield Row(
            f"followed side by side: {name}",
            f"to its own profile {spread(own)}",
            "",
            f"to the person's place in the domain {spread(adapted)}",
            "–",
            None,
            f"d, median / 95 %, {len(here)} motions placed freely for {ADAPTED}; the person's place in the domain is "
            f"what {ADAPTED} make of it; rank correlation of pairwise distances with the person's {order:.2f}",
        )


def _bounded(work: str, values: Array, limits: tuple[float, float], note: str) -> Row:
    reached = bool(np.median(values) <= limits[0] and np.percentile(values, 95) <= limits[1])
    return Row(work, spread(values), "", spread(values), f"≤ {limits[0]:.2f} / {limits[1]:.2f}", reached, note)


def _each(outcomes: list[Outcome], value: Callable[[Outcome], Array]) -> str:
    """The figures of each placement."""
    names = dict.fromkeys(one.placement for one in outcomes)
    return ", ".join(f"{name} {spread(_pool([o for o in outcomes if o.placement == name], value))}" for name in names)


def _millimetres(metres: float) -> str:
    return f"{1e3 * metres:.2f} mm"
