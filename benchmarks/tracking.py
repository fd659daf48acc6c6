"""How well a Panda follows adapted ellipsoids: 12 motions of a human arm, some of them at three placements."""

import warnings
from collections.abc import Iterator

import numpy as np
from joblib import Parallel, delayed

import maniport as mp
from maniport.errors import ManiportWarning
from maniport.studies.paper.trajectories import robot_arm
from maniport.transfer import DomainAdapter
from maniport.util.defaults import STUDENT_SAMPLES, TEACHER_SAMPLES

from . import tracking_checks, tracking_plan, tracking_speed
from .measure import Row
from .tracking_checks import millimetres
from .tracking_motions import (
    ADAPTED,
    LIFE_SIZE,
    PLACEMENTS,
    Motion,
    adapters,
    motions,
)
from .tracking_runs import Outcome, place_and_track, run, spread

QUICK = ("H-Eval-3", "ladder 23.2–27.5 s")
ELSEWHERE = (*QUICK, "freeform 3.7–7 s")
"""The motions that are placed in other ways, too."""
PLACE = "free"
"""The placement at which the methods are compared."""


def rows(quick: bool) -> Iterator[Row]:
    """The motions planned, every check, then the methods side by side, and the speed."""
    chosen = [motion for motion in motions() if not quick or motion.name in QUICK]
    fitted = _fitted(chosen)
    outcomes: list[Outcome] = Parallel(n_jobs=-1)(delayed(run)(*one) for one in _work(chosen, fitted, quick))
    yield from tracking_plan.twelve(outcomes)
    yield from tracking_checks.rows(outcomes, quick)
    if not quick:
        yield _life_size([motion for motion in chosen if motion.name in ELSEWHERE], fitted)
    yield from _methods(outcomes)
    first = chosen[0]
    others = first.person.manipulability(first.person.sample(600, 3))
    yield from tracking_speed.rows(outcomes[0], fitted[first.length][ADAPTED].transform(others), quick)


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
        wanted = {name: (one.transform(profile), one.student_regularization) for name, one in fits.items()}
        for name, given in PLACEMENTS.items():
            if name == PLACE:
                yield motion.name, name, motion.robot_time, motion.hand, person, wanted, given
            elif not quick and motion.name in ELSEWHERE:
                some = {ADAPTED: wanted[ADAPTED]}
                yield motion.name, name, motion.robot_time, motion.hand, person, some, given


def _life_size(chosen: list[Motion], fitted: dict[float, dict[str, DomainAdapter]]) -> Row:
    """What it costs that the task may not be made larger or smaller."""
    work = []
    for motion in chosen:
        adapter = fitted[motion.length][ADAPTED]
        profile, damping = adapter.transform(motion.profile), adapter.student_regularization
        work.append((motion.robot_time, motion.hand, profile, damping, LIFE_SIZE))
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
        f"hand beside its path {millimetres(np.percentile(error, 95))} (95 %)",
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
