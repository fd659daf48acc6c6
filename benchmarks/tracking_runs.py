"""One motion at one placement: a Panda follows what each adapter makes of it, in every way that is compared."""

from dataclasses import dataclass
from functools import cache

import numpy as np
import pink
import pinocchio as pin
from pink.limits import ConfigurationLimit, VelocityLimit
from pink.tasks import FrameTask, PostureTask
from scipy.interpolate import CubicSpline
from scipy.optimize import least_squares
from threadpoolctl import threadpool_limits

from maniport.arms import Arm
from maniport.arms.chain import rotation_about
from maniport.evaluation import distance_preservation
from maniport.motion import ArmMotion, Placement, SeedBank, place_path, robot_model, track
from maniport.motion.objective import FOLLOWING_WEIGHT
from maniport.spd import distance
from maniport.spd.kernels import congruence
from maniport.spd.regularization import Regularization
from maniport.studies.paper.trajectories import READY, robot_arm

from .inputs import Array

RATE = 100.0  # Hz
POSTURE_COST, PULL = 1e-2, 1e-3


@dataclass(frozen=True)
class Followed:
    """How the Panda followed the profile of one method.

    Attributes
    ----------
    own : ndarray, shape (n,)
        Distance to the profile that was wanted.
    adapted : ndarray, shape (n,)
        Distance to what mean and dispersion make of the motion at this place, whatever was wanted.
    order : float
        Rank correlation of the pairwise distances of the achieved ellipsoids with those of the person's.
    """

    own: Array
    adapted: Array
    order: float


@dataclass(frozen=True)
class Outcome:
    """Everything that was measured of one motion at one placement.

    Attributes
    ----------
    motion, placement : str
    placed : Placement
    tracked : ArmMotion
        Mean and dispersion, from a start of the tracker's choice.
    hand_only : ArmMotion
        The same path without an ellipsoid task, from home.
    methods : dict of str to Followed
        By method, where several were wanted.
    """

    motion: str
    placement: str
    placed: Placement
    tracked: ArmMotion
    hand_only: ArmMotion
    methods: dict[str, Followed]


@cache
def bank() -> SeedBank:
    """Return the starts that all searches share."""
    return SeedBank.build(robot_arm(), 16_384, 0)


def place_and_track(
    time: Array, hand: Array, profile: Array, damping: Regularization, given: dict[str, float]
) -> tuple[Placement, ArmMotion]:
    """Find the place for an adapted profile, with `given` held, and follow it there."""
    placed = place_path(hand, profile, robot_arm(), damping=damping, bank=bank(), **given)
    return placed, _tracked(placed, placed.profile, time, damping)


def run(
    motion: str,
    placement: str,
    time: Array,
    hand: Array,
    person: Array,
    wanted: dict[str, tuple[Array, Regularization]],
    given: dict[str, float],
) -> Outcome:
    """Place, track, compare.

    Parameters
    ----------
    motion, placement : str
        Names.
    time, hand, person : ndarray, shapes (n,), (n, 3) and (n, 3, 3)
        Of the motion, with the person's own ellipsoids including their damping.
    wanted : dict
        Profile (n, 3, 3) and damping of each method; the first one is mean and dispersion, for which is placed.
    given : dict
        What is given to `place_path`.
    """
    robot, first = robot_arm(), next(iter(wanted))
    profile, damping = wanted[first]
    placed, tracked = place_and_track(time, hand, profile, damping, given)
    hand_only = without_ellipsoids(robot, placed, time, damping)
    methods, turn = {}, rotation_about(2, placed.yaw)
    if len(wanted) > 1:
        for name, (other, lift) in wanted.items():
            result = tracked if name == first else _tracked(placed, congruence(turn, other), time, lift)
            methods[name] = _followed(result, placed.profile, damping, person)
        methods["hand path only"] = _followed(hand_only, placed.profile, damping, person)
    return Outcome(motion, placement, placed, tracked, hand_only, methods)


def _tracked(placed: Placement, profile: Array, time: Array, damping: Regularization) -> ArmMotion:
    return track(robot_arm(), profile, time=time, path=placed.path, bank=bank(), damping=damping, rate=RATE).arms[0]


def _followed(result: ArmMotion, adapted: Array, damping: Regularization, person: Array) -> Followed:
    lift = damping.epsilon * np.eye(3)
    achieved = result.achieved + lift
    return Followed(
        result.distance, distance(achieved, adapted + lift), distance_preservation(achieved, person).rank_correlation
    )


def without_ellipsoids(arm: Arm, placed: Placement, time: Array, damping: Regularization) -> ArmMotion:
    """Follow a path by Pink with tasks of position and posture only, from the hand's place nearest to home."""
    home = np.array(READY)
    model = robot_model(arm)
    steps = int(np.ceil((time[-1] - time[0]) * RATE))
    grid = np.linspace(time[0], time[-1], steps + 1)
    hands, dt = CubicSpline(time, placed.path)(grid), (time[-1] - time[0]) / steps
    position, posture = FrameTask(arm.frame, FOLLOWING_WEIGHT, 0.0), PostureTask(cost=POSTURE_COST)
    posture.set_target(home)
    limits = [ConfigurationLimit(model, min(0.5, 10.0 * dt)), VelocityLimit(model)]
    joints = np.empty((len(grid), arm.dof))
    joints[0] = nearest_to(arm, hands[0], home)
    configuration = pink.Configuration(model, model.createData(), joints[0])
    with threadpool_limits(1, "blas"):
        for i in range(1, len(grid)):
            position.set_target(pin.SE3(np.eye(3), hands[i]))
            velocity = pink.solve_ik(configuration, [position, posture], dt, solver="daqp", limits=limits)
            joints[i] = np.clip(joints[i - 1] + velocity * dt, arm.lower, arm.upper)
            configuration.update(joints[i])
    return ArmMotion.of_motion(arm, time, placed.profile, grid, joints, damping=damping, path=placed.path)


def nearest_to(arm: Arm, hand: Array, home: Array) -> Array:
    """Joint positions near `home` with the hand at a place."""
    found = least_squares(
        lambda q: np.concatenate([arm.forward(q)[:3, 3] - hand, PULL * (q - home)]),
        home,
        lambda q: np.concatenate([arm.jacobian(q)[:3], PULL * np.eye(arm.dof)]),
        bounds=(arm.lower, arm.upper),
        xtol=1e-12,
    )
    return np.asarray(found.x)


def spread(values: Array) -> str:
    """Median and 95th percentile."""
    return f"{np.median(values):.2f} / {np.percentile(values, 95):.2f}"
