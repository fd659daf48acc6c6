"""The baseline beside ellipsoids: the robot's tip on its path, its elbow turned as the person's."""

from typing import Any

import numpy as np
from scipy.optimize import least_squares

from maniport.bodies import Arm
from maniport.evaluation.elbow import elbow_angle, elbow_frames, turned_by
from maniport.validation import Array

STARTS = 4
"""Postures from which the motion is tried; the best of them counts."""
TRIED = 512
"""Samples that they are the best of."""
TIP_WEIGHT, ELBOW_WEIGHT = 1000.0, 20.0
"""What a metre beside the path and a radian of the elbow count for: 1° of the elbow as much as 0.35 mm."""
NEAR = 0.3
"""What a radian from the posture before counts for: of what is free, the least motion."""
STEP = 1e-6
"""Of differences [rad]."""


def keep_elbow(robot: Arm, path: Array, angles: Array, turn: Array, random_state: int = 0) -> Array:
    """Joint positions with the tip on a path and the elbow at given angles, shape (n, dof).

    Each posture is sought from the one before, within the joint limits, by least squares. Neither the robot's speed nor
    collisions are minded, which favours what is found.

    Parameters
    ----------
    robot : Arm
        With an elbow (`maniport.evaluation.elbow.elbow_frames`).
    path : ndarray, shape (n, 3)
        Of the tip, in the base frame [m].
    angles : ndarray, shape (n,)
        Of the elbow [rad]; where nan, it is left alone.
    turn : ndarray, shape (3, 3)
        As in `maniport.evaluation.elbow.elbow_angle`.
    random_state : int
        Seed of the postures that are tried first.

    Raises
    ------
    InvalidInputError
        When no elbow is known of the robot.
    """
    elbow_frames(robot)
    samples = robot.sample(TRIED, random_state)
    near = [_residual(q, robot, path[0], angles[0], turn, q)[: -robot.dof] for q in samples]
    begins = samples[np.argsort(np.sum(np.square(near), axis=1))[:STARTS]]
    motions = [_follow(begin, robot, path, angles, turn) for begin in begins]
    return min(motions, key=lambda found: found[1])[0]


def _follow(begin: Array, robot: Arm, path: Array, angles: Array, turn: Array) -> tuple[Array, float]:
    """One motion, and what tip and elbow cost in it."""
    q, cost, found = begin, 0.0, []
    for place, angle in zip(path, angles, strict=True):
        known = (robot, place, angle, turn, q)
        options: dict[str, Any] = {"bounds": (robot.lower, robot.upper), "args": known, "max_nfev": 50}
        q = least_squares(_residual, q, _jacobian, **options).x
        cost += float(np.sum(_residual(q, *known)[: -robot.dof] ** 2))
        found.append(q)
    return np.array(found), cost


def _residual(q: Array, robot: Arm, place: Array, angle: float, turn: Array, before: Array) -> Array:
    """Weighted: tip (3), elbow (1), and how far the posture is from the one before (dof)."""
    off = np.nan_to_num(turned_by(elbow_angle(robot, q, turn), np.asarray(angle)))
    return np.concatenate([
        TIP_WEIGHT * (robot.forward(q)[:3, 3] - place), [ELBOW_WEIGHT * off], NEAR * (q - before)
    ])  # fmt: skip


def _jacobian(q: Array, robot: Arm, place: Array, angle: float, turn: Array, before: Array) -> Array:
    """Derivatives of the residual, those of the elbow by differences."""
    del place, before
    there, aside = elbow_angle(robot, q, turn), elbow_angle(robot, q + STEP * np.eye(robot.dof), turn)
    elbow = np.nan_to_num(turned_by(aside, there)) / STEP * np.isfinite(angle)
    return np.concatenate([
        TIP_WEIGHT * robot.jacobian(q)[:3], ELBOW_WEIGHT * elbow[None], NEAR * np.eye(robot.dof)
    ])  # fmt: skip
